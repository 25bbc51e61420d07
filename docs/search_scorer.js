// How the search of the site ranks what it finds: as Sphinx does, but pages of the guide before records of decisions.
var Scorer = {
  score: ([docname, , , , score]) => (docname.startsWith("decisions/") || docname === "changelog" ? score - 100 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
