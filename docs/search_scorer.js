// The ranking of the site's search: pages of the guide first, then the reference, then changes. A query that looks like a name
// in code, such as create_agent or Scenario, ranks the reference like the guide.
const asked = typeof location === "undefined" ? "" : new URLSearchParams(location.search).get("q") || "";
const isName = /[_.]|[A-Z]/.test(asked);

var Scorer = {
  score: ([docname, , , , score]) => {
    if (docname.startsWith("decisions/") || docname === "changelog") return score - 100;
    return docname.startsWith("reference/") && !isName ? score - 50 : score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
