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
  // the button's process answers within a second; one that hangs must not keep anybody waiting
  const patienceMs = 2500;
  let pressed = false;
  const end = () => { const facts = document.querySelector(".facts"); return facts ? facts.dataset.end || "" : ""; };
  function say(words) {
    const place = document.getElementById("stop-said");
    if (place && place.textContent !== words) place.textContent = words;
  }
  // once the run is over, what was said of STOP gives way to what became of the output
  function sayEnd() { if (pressed && end()) say(end()); }
  async function stop() {
    if (!settings.stopUrl) return;
    pressed = false;
    say("STOP is being said …");
    try {
      const answer = await fetch(settings.stopUrl, { method: "POST", signal: AbortSignal.timeout(patienceMs) });
      say((await answer.json()).said);
    } catch (error) {
      const before = end() ? "the run is over (" + end() + "), and nobody hears STOP any more; if in doubt" :
        "the STOP button's process does not answer:";
      say(before + " press OUTPUT OFF at the source");
      return;
    }
    pressed = true;
    setTimeout(sayEnd, 1000);
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
  setInterval(sayEnd, 200);
  show();
})();
