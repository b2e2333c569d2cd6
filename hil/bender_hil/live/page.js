// The next picture is asked for while one is being drawn; STOP goes to the button's own process, past this page's server.
(() => {
  const settings = window.benderLive;
  window.framesShown = 0;
  const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
  async function ask(last) {
    try {
      const answer = await fetch("/picture.jpg?after=" + last);
      if (answer.status !== 200) { await sleep(100); return null; }
      return { frame: answer.headers.get("X-Frame"), data: await answer.blob() };
    } catch (error) { await sleep(300); return null; }
  }
  async function show() {
    let last = -1, coming = ask(last);
    for (;;) {
      const picture = document.getElementById("picture");
      if (!picture) { await sleep(50); continue; }
      const got = await coming;
      if (got) last = got.frame;
      coming = ask(last);
      if (!got) continue;
      const url = URL.createObjectURL(got.data);
      await new Promise((done) => { picture.onload = picture.onerror = done; picture.src = url; });
      URL.revokeObjectURL(url);
      window.framesShown += 1;
      picture.dataset.frame = last;
    }
  }
  function say(words) {
    const place = document.getElementById("stop-said");
    if (place) place.textContent = words;
  }
  async function stop() {
    if (!settings.stopUrl) return;
    say("STOP is being said …");
    try {
      const answer = await fetch(settings.stopUrl, { method: "POST" });
      say((await answer.json()).said);
    } catch (error) {
      say("the STOP button's process does not answer: press OUTPUT OFF at the source");
    }
  }
  window.benderStop = stop;
  document.addEventListener("keydown", (event) => {
    if (event.code !== "Space" || event.repeat) return;
    event.preventDefault();
    event.stopPropagation();
    stop();
  }, true);
  document.addEventListener("click", (event) => {
    if (event.target.closest && event.target.closest("#stop")) stop();
  }, true);
  show();
})();
