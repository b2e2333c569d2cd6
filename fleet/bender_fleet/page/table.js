"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const perPage = 50;
  const text = (coded) => coded.at.map((k) => coded.of[k]);
  const verdict = text(data.verdict), batch = text(data.batch), effects = text(data.effects);
  const labels = { before_um: "as given, µm", recalibrated_um: "calibrated, µm", after_um: "with effects, µm", gain: "gain",
    offset_um: "offset, µm", since_s: "since, s", change_um: "change, µm", noise_um: "noise, µm",
    gain_change: "gain moved", offset_change_um: "offset moved, µm", held_out_percent: "held out, %", floor_percent: "floor, %" };
  const columns = [
    { label: "unit", of: data.unit }, { label: "batch", of: batch }, { label: "date", of: data.date },
    { label: data.action === "compare" ? "status" : data.action === "identify" ? "model" : "verdict", of: verdict },
    { label: "effects", of: effects },
    ...Object.entries(data.numbers).map(([name, of]) => ({ label: labels[name] || name, of, number: true })),
    { label: "distance", of: data.far, number: true },
  ].filter((c) => c.of.some((v) => v !== "" && v !== null));
  const pages = new Set(data.pages);
  const words = data.unit.map((u, k) => `${u} ${verdict[k]} ${effects[k]} ${batch[k]} ${data.told[k]}`.toLowerCase());
  const get = (id) => document.getElementById(id);
  const find = get("find"), byVerdict = get("verdict"), byBatch = get("batch");
  const head = document.querySelector("#all thead tr"), body = document.querySelector("#all tbody");
  let sorted = 0, down = false, page = 0, open = -1, rows = [];

  const fill = (select, coded) => {
    const names = coded.of.filter((x) => x !== "").sort((a, b) => a.localeCompare(b, undefined, { numeric: true }));
    names.forEach((x) => select.add(new Option(x.replace(/_/g, " "), x)));
    select.parentElement.hidden = names.length < 2;
  };
  const cell = (tag, value, isNumber) => {
    const made = document.createElement(tag);
    if (isNumber) made.className = "number";
    made.append(value);
    return made;
  };
  const number = (v) => v === null ? "–" : String(v).replace("-", "−");

  const choose = () => {
    const wanted = find.value.toLowerCase().split(/\s+/).filter(Boolean);
    rows = [];
    for (let k = 0; k < data.unit.length; k++) {
      if (byVerdict.value && verdict[k] !== byVerdict.value) continue;
      if (byBatch.value && batch[k] !== byBatch.value) continue;
      if (wanted.every((w) => words[k].includes(w))) rows.push(k);
    }
    const of = columns[sorted].of, sign = down ? -1 : 1;
    const compare = columns[sorted].number ? (a, b) => of[a] - of[b] : (a, b) => of[a].localeCompare(of[b], undefined, { numeric: true });
    const empty = (k) => of[k] === null || of[k] === "";
    rows.sort((a, b) => empty(a) - empty(b) || (empty(a) ? 0 : sign * compare(a, b)) || a - b);
    page = 0; open = -1; draw();
  };
  const linked = (k) => {
    const link = document.createElement("a");
    const own = pages.has(data.folder[k]) ? "report.html" : data.file;
    link.href = `units/${data.folder[k]}/${own}`;
    link.textContent = data.unit[k];
    return link;
  };
  const draw = () => {
    [...head.children].forEach((th, k) => {
      if (k === sorted) th.setAttribute("aria-sort", down ? "descending" : "ascending"); else th.removeAttribute("aria-sort");
    });
    body.replaceChildren();
    for (const k of rows.slice(page * perPage, (page + 1) * perPage)) {
      const tr = document.createElement("tr");
      columns.forEach((c, n) => {
        const value = n === 0 && verdict[k] !== "broken" && verdict[k] !== "failed" ? linked(k) : c.number ? number(c.of[k]) : c.of[k];
        tr.append(cell("td", value, c.number));
      });
      tr.addEventListener("click", (event) => { if (event.target.tagName !== "A") { open = open === k ? -1 : k; draw(); } });
      body.append(tr);
      if (open === k) {
        const told = document.createElement("tr"), td = cell("td", data.told[k]);
        told.className = "told"; td.colSpan = columns.length; told.append(td); body.append(told);
      }
    }
    const count = Math.max(1, Math.ceil(rows.length / perPage));
    get("shown").textContent = `${rows.length} of ${data.unit.length} units`;
    get("place").textContent = count > 1 ? `page ${page + 1} of ${count}` : "";
    get("back").disabled = page === 0; get("on").disabled = page >= count - 1;
    get("back").hidden = get("on").hidden = count === 1;
  };

  columns.forEach((c, n) => {
    const th = cell("th", c.label, c.number);
    th.addEventListener("click", () => { down = sorted === n ? !down : Boolean(c.number); sorted = n; choose(); });
    head.append(th);
  });
  fill(byVerdict, data.verdict); fill(byBatch, data.batch);
  [find, byVerdict, byBatch].forEach((x) => x.addEventListener("input", choose));
  get("back").addEventListener("click", () => { page--; draw(); });
  get("on").addEventListener("click", () => { page++; draw(); });
  document.querySelectorAll("[data-effect], [data-unit]").forEach((x) => x.addEventListener("click", () => {
    byVerdict.value = byBatch.value = ""; find.value = x.dataset.effect || x.dataset.unit; choose();
  }));
  choose();
})();
