// What the search lists first: titles and headings, of guides and effects before others; pages from docstrings last.
const bonus = (page, kind) => {
  if (page.startsWith("how-to/")) return kind === "title" ? 10 : 5;
  if (page.startsWith("effects/")) return 6;
  if (page.startsWith("reference/figures/")) return -10;
  return page.startsWith("api/") ? -40 : 0;
};
var Scorer = {
  objNameMatch: 1,
  objPartialMatch: 0,
  objPrio: {},
  objPrioDefault: 0,
  title: 40,
  partialTitle: 20,
  term: 5,
  partialTerm: 2,
  score: ([page, , , , score, , kind]) => score + bonus(page, kind),
};
