// What happens in a game, in words, as the films of GAMMS say it (visual/captions.py).

const LONGEST = 90;
const LAST = "starts again";
const DECISIONS = new Set(["choice", "llm"]); // kinds of events that say what was decided for an agent
const UNMARKED = new Set(["tag", "respawned", ...DECISIONS]); // kinds of events that are too many for the timeline
const REASONS = new Map([["max_turns", "all turns are played"]]);
/** @type {Map<string, [string, string]>} kind -> the field that the sentence is about, and what it says of it */
const SENTENCES = new Map([
  ["tag", ["other", "is tagged by {agent}"]], ["take", ["agent", "takes the {flag} flag"]], ["drop", ["agent", "loses the {flag} flag"]],
  ["capture", ["agent", "brings the {flag} flag home"]], ["reach", ["agent", "reaches the goal"]], ["arrive", ["agent", "arrives at node {node}"]], ["discover", ["agent", "discovers node {node}"]],
  ["empty", ["agent", "has no {resource} left"]], ["hold", ["team", "has held its place for {turns} turns"]],
  ["eliminated", ["agent", "is out"]], ["respawned", ["agent", LAST]],
]);

/** @typedef {{words: string, agent: string | null}} Caption */

/** Return a sentence for each agent to whom something happened. @param {Map<string, any>[]} events @returns {Caption[]} */
export function captionsOf(events) {
  /** @type {Map<string, {agent: string | null, kind: string, said: string[]}>} */
  const found = new Map();
  const arrived = new Set(events.filter((event) => event.get("kind") === "arrive").map((event) => event.get("agent")));
  for (const event of events) {
    if (event.get("kind") === "eliminated" && arrived.has(event.get("agent"))) continue; // an arrival says enough
    const kind = String(event.get("kind") ?? "");
    const [about, predicate] = SENTENCES.get(kind) ?? ["", ""];
    const isKnown = about !== "" && [about, ...[...predicate.matchAll(/{(\w+)}/g)].map((match) => match[1])].every((key) => event.has(key));
    const agent = isKnown ? String(event.get(about)) : event.has("agent") ? String(event.get("agent")) : null;
    const key = JSON.stringify([agent, isKnown ? "" : kind]);
    const known = found.get(key) ?? { agent, kind, said: [] };
    if (isKnown) known.said.push(predicate.replace(/{(\w+)}/g, (_, name) => wordsOf(event.get(name))));
    if (!DECISIONS.has(kind)) found.set(key, known);
  }
  return [...found.values()].map((one) => ({ words: sentence(one), agent: one.agent }));
}

/** @param {{agent: string | null, kind: string, said: string[]}} of */
function sentence({ agent, kind, said }) {
  let words = agent === null ? kind : `${agent}: ${kind}`;
  if (said.length) {
    const sorted = [...said.filter((one) => one !== LAST), ...said.filter((one) => one === LAST)];
    const last = sorted.pop();
    words = sorted.length ? `${agent} ${sorted.join(", ")} and ${last}` : `${agent} ${last}`;
  }
  return words.length > LONGEST ? `${words.slice(0, LONGEST - 1)}…` : words;
}

/** Whether an event has a mark on the timeline. @param {Map<string, any>} event */
export function isMarked(event) {
  return !UNMARKED.has(String(event.get("kind")));
}

/** Return how a game ended, in words. @param {Map<string, any>} over */
export function endingOf(over) {
  const winner = over.get("winner") ?? null;
  const reason = String(over.get("reason") ?? "");
  return `${winner === null ? "No winner" : `${wordsOf(winner)} won`}: ${REASONS.get(reason) ?? reason}`;
}

/** Return a value as short text. @param {any} value @param {number} [most] letters @returns {string} */
export function wordsOf(value, most = 400) {
  const words = textOf(value, 4);
  return words.length > most ? `${words.slice(0, most - 1)}…` : words;
}

/** @param {any} value @param {number} depth @returns {string} */
function textOf(value, depth) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(6)));
  if (value instanceof Uint8Array && value.length > 64) return `${value.length} bytes`;
  if (depth === 0) return "…";
  if (value instanceof Map) return [...value].slice(0, 50).map(([key, one]) => `${key}: ${textOf(one, depth - 1)}`).join(", ") || "–";
  if (Array.isArray(value) || ArrayBuffer.isView(value)) {
    const items = Array.from(/** @type {ArrayLike<any>} */ (/** @type {any} */ (value)));
    return items.slice(0, 24).map((one) => textOf(one, depth - 1)).join(", ") + (items.length > 24 ? `, … (${items.length})` : "") || "–";
  }
  return String(value);
}
