// What holds until it changes: slots with values, facts about agents; and the captions of all turns.
import { Recording } from "./recording.js";
import { valueOf } from "./values.js";

const MOST_CAPTIONS = 20000;
const NEXT_TURNS = 60;

/** @typedef {{turn: number, words: string, agent: string | null, isMajor: boolean, isMarked: boolean}} Caption */
/** @template T @typedef {{turn: number, value: T}} Entry */

export class Timeline {
  constructor() {
    this.parts = 0; // that were read
    /** @type {Map<string, Entry<Uint8Array>[]>} */ this.slots = new Map();
    /** @type {Map<string, {entry: Entry<Uint8Array>, value: any}>} */ this.opened = new Map(); // the last value of each slot that was asked for
    /** @type {Map<string, Map<string, Map<string, Entry<string | null>[]>>>} */ this.facts = new Map(); // agent -> heading -> key
    /** @type {{turn: number, values: Map<string, any>}[]} */ this.scores = [];
    /** @type {{turn: number, values: Map<string, Map<string, any>>}[]} */ this.charts = []; // chart -> line -> number
    /** @type {Caption[]} */ this.captions = [];
    /** @type {Set<string>} */ this.sides = new Set();
    this.hasSensed = this.hasMessages = false;
  }

  /** Read the next part. @param {Recording} recording @returns {boolean} whether there was one */
  readOn(recording) {
    const part = recording.parts[this.parts];
    if (part === undefined) return false;
    this.parts++;
    const { first, agents, changes, facts } = part, columns = recording.columns(part);
    for (let i = 0; i < changes.length; i += 3) put(listIn(this.slots, changes[i + 1]), first + changes[i], changes[i + 2]);
    for (const { turn, value } of (this.slots.get("scores") ?? []).slice(this.scores.length)) this.scores.push({ turn, values: valueOf(value) });
    for (const { turn, value } of (this.slots.get("charts") ?? []).slice(this.charts.length)) this.charts.push({ turn, values: valueOf(value) });
    for (let i = 0; i < facts.length; i += 5) {
      const [turn, agent, heading, key, words] = facts.slice(i, i + 5);
      const about = mapIn(this.facts, typeof agent === "number" ? agents[agent] : agent);
      put(listIn(mapIn(about, heading), key), first + turn, words);
    }
    for (const one of columns.get("captions")) {
      if (this.captions.length >= MOST_CAPTIONS) break;
      this.captions.push({ turn: first + one.get("turn"), words: one.get("words"), agent: one.get("agent"), isMajor: one.get("major"), isMarked: one.get("marked") });
    }
    for (const side of columns.get("sides")) this.sides.add(side);
    this.hasSensed ||= columns.get("looks")?.length > 0;
    this.hasMessages ||= columns.get("messages").length > 0;
    return true;
  }

  /** Return the value of a slot at the end of a turn; undefined: it has none. @param {string} slot @param {number} turn */
  at(slot, turn) {
    const entry = lastBefore(this.slots.get(slot) ?? [], turn), known = this.opened.get(slot);
    if (entry === undefined) return undefined;
    if (known?.entry === entry) return known.value;
    const value = valueOf(entry.value);
    this.opened.set(slot, { entry, value });
    return value;
  }

  /** Return what artists draw at the end of a turn, by their names. @param {number} turn @returns {Map<string, any>} */
  drawings(turn) {
    const found = new Map();
    for (const slot of this.slots.keys()) {
      const drawing = slot.startsWith("drawing ") ? this.at(slot, turn) : null;
      if (drawing) found.set(drawing.get("artist"), drawing);
    }
    return found;
  }

  /** Return the agent that is in the game and that the captions of the next turns name most; else the first one. @param {number} turn @param {Map<string, import("./recording.js").Agent>} agents @returns {string | null} */
  mostNamed(turn, agents) {
    const counts = new Map([...agents.values()].filter((agent) => agent.alive).map((agent) => [agent.name, 0]));
    for (const one of this.captions) if (one.turn > turn && one.turn <= turn + NEXT_TURNS && one.agent !== null && counts.has(one.agent)) counts.set(one.agent, (counts.get(one.agent) ?? 0) + 1);
    return [...counts].reduce((best, one) => (best === null || one[1] > best[1] ? one : best), /** @type {[string, number] | null} */ (null))?.[0] ?? null;
  }

  /** Return what is said of an agent: pairs of a key and words. @param {string} agent @param {string} heading @param {number} turn @returns {[string, string][]} */
  factsOf(agent, heading, turn) {
    const known = [...(this.facts.get(agent)?.get(heading) ?? [])].map(([key, entries]) => [key, lastBefore(entries, turn)?.value]);
    return /** @type {[string, string][]} */ (known.filter((pair) => typeof pair[1] === "string"));
  }
}

/** @template T @param {Entry<T>[]} entries @param {number} turn @param {T} value */
function put(entries, turn, value) {
  if (entries.length && entries[entries.length - 1].turn === turn) entries.pop();
  entries.push({ turn, value });
}

/** Return the last entry at or before a turn. @template T @param {Entry<T>[]} entries @param {number} turn @returns {Entry<T> | undefined} */
function lastBefore(entries, turn) {
  let low = 0, high = entries.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (entries[middle].turn <= turn) low = middle + 1;
    else high = middle;
  }
  return entries[low - 1];
}

/** @template K, V @param {Map<K, Map<string, V>>} maps @param {K} key @returns {Map<string, V>} */
function mapIn(maps, key) {
  const known = maps.get(key) ?? new Map();
  maps.set(key, known);
  return known;
}

/** @template K, V @param {Map<K, V[]>} lists @param {K} key @returns {V[]} */
function listIn(lists, key) {
  const known = lists.get(key) ?? [];
  lists.set(key, known);
  return known;
}
