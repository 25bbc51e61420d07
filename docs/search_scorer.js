// The ranking of the site's search: pages of the guide first, then the reference, then changes. A query that looks like a name
// in code, such as create_agent or Scenario, ranks the reference like the guide. A page whose index words are words of the query
// is lifted, most if it has all of them. `conf.py` writes `pageWords` above: page -> its index words.
const asked = typeof location === "undefined" ? "" : new URLSearchParams(location.search).get("q") || "";
const isName = /[_.]|[A-Z]/.test(asked);
const small = new Set("a an and as at by do for from how i in is my of on or the to with".split(" "));
const mostLifted = 40;

// The share of the words of a query that are among some words, from 0 to 1; the beginning of a word counts, too.
function shareOf(query, words) {
  const wanted = (query.toLowerCase().match(/[\p{L}\p{N}]+/gu) || []).filter((word) => !small.has(word));
  const isKnown = (word) => words.some((one) => one === word || (word.length > 3 && one.startsWith(word)) || word === `${one}s`);
  return wanted.length === 0 ? 0 : wanted.filter(isKnown).length / wanted.length;
}

function liftOf(docname, query) {
  const known = typeof pageWords === "undefined" ? {} : pageWords;
  return Math.round(mostLifted * shareOf(query, Object.hasOwn(known, docname) ? known[docname] : []));
}

var Scorer = {
  score: ([docname, , , , score]) => {
    if (docname.startsWith("decisions/") || docname === "changelog") return score - 100;
    if (docname.startsWith("reference/") && !isName) return score - 50;
    return score + liftOf(docname, asked);
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
