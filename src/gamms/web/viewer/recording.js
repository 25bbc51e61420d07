// What a page holds, and a live game sends piece by piece: a header, and turns in parts. docs/page-format.md describes them.
import { valueOf } from "./values.js";

const MAGIC = "GAMMSPLY";
const MOST_DECODED = 1 << 26; // bytes of parts whose columns are kept
const THERE = 1, ALIVE = 2, FLIES = 4; // bits of the status of an agent
const SHARES = 1 << 16, TURN = 256; // parts of an edge, and of a full turn

/**
 * @typedef {object} Part some turns
 * @property {number} first @property {number} end the numbers of the first of them, and of the one behind the last
 * @property {number} size how many it has, one more where the next part says the last one again
 * @property {boolean} isWhole whether it needs no part before it
 * @property {string[]} agents @property {any[]} changes @property {any[]} facts @property {Uint8Array} bytes of its columns
 * @property {number} step in which positions are counted
 *
 * @typedef {object} Agent
 * @property {string} name @property {string} side @property {boolean} alive @property {boolean} flies
 * @property {number} row of the node it is on, or above; -1: none
 * @property {{from: number, to: number, share: number} | null} edge that it is on: rows of nodes
 * @property {[number, number, number] | null} position in the air
 * @property {number | null} heading in the air, radians
 * @property {number[] | null} way rows of the nodes that it passed, where it did not simply go from its node to the next; none: it did not travel
 * @property {number | null} named row of the edge that its action has named, by which it came to its node
 */

/** The parts of a game, which may still grow. */
export class Recording {
  constructor() {
    /** @type {Map<string, any>} */ this.header = new Map();
    /** @type {Part[]} */ this.parts = [];
    this.first = 0; // turns that come before it, and are not in it
    this.turns = 0;
    this.repeats = 0; // whole parts, each of which has said the last turn again
    this.rest = new Uint8Array(0);
    this.hasBegun = false;
    /** @type {Map<Part, Map<string, any>>} */ this.decoded = new Map(); // the one decoded first is the first
    this.bytesDecoded = 0;
  }

  /** Whether these bytes begin a game. @param {Uint8Array} bytes */
  static begins(bytes) {
    return String.fromCharCode(...bytes.subarray(0, MAGIC.length)) === MAGIC;
  }

  /** Take the next bytes; parts that are whole count at once. @param {Uint8Array} bytes */
  feed(bytes) {
    const data = new Uint8Array(this.rest.length + bytes.length);
    data.set(this.rest);
    data.set(bytes, this.rest.length);
    const view = new DataView(data.buffer);
    let at = 0;
    if (!this.hasBegun) {
      if (!Recording.begins(data)) throw new Error("This is no game of GAMMS.");
      this.hasBegun = true;
      at = MAGIC.length;
    }
    for (let end; at + 4 <= data.length && (end = at + 4 + view.getUint32(at, true)) <= data.length; at = end) this.#add(valueOf(data.subarray(at + 4, end)));
    this.rest = data.slice(at);
  }

  /** @param {Map<string, any>} value */
  #add(value) {
    if (this.header.size === 0) {
      this.header = value;
      return;
    }
    const first = value.get("first"), end = first + value.get("turns"), isWhole = value.get("is_whole");
    const part = { first, end, size: end - first, isWhole, agents: value.get("agents"), changes: value.get("changes"), facts: value.get("facts"), bytes: value.get("columns"), step: value.get("step") };
    if (this.parts.length === 0) this.first = first;
    else if (isWhole && first === this.turns) { // it says the last turn again, perhaps with more
      this.parts[this.parts.length - 1].end--;
      this.repeats++;
    } else if (first !== this.turns + 1) throw new Error("Some turns of this game are missing.");
    this.parts.push(part);
    this.turns = end - 1;
  }

  /** Return the part that has a turn; undefined where there is none. @param {number} turn @returns {Part | undefined} */
  partOf(turn) {
    let low = 0, high = this.parts.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.parts[middle].end <= turn) low = middle + 1;
      else high = middle;
    }
    return turn < this.first ? undefined : this.parts[low];
  }

  /** Return the columns of a part. @param {Part} part @returns {Map<string, any>} */
  columns(part) {
    const known = this.decoded.get(part);
    if (known !== undefined) return known;
    const columns = valueOf(part.bytes);
    for (const name of ["on_edges", "in_air", "ways", "named_edges"]) {
      const found = columns.get(name);
      if (found === undefined) continue; // no action of the part names an edge
      found.set("index", new Map(Array.from(found.get("at"), (place, i) => [place, i])));
    }
    columns.get("ways").set("ends", endsOf(columns.get("ways").get("counts")));
    this.bytesDecoded += part.bytes.length;
    for (const [other] of this.decoded) {
      if (this.bytesDecoded <= MOST_DECODED) break;
      this.bytesDecoded -= other.bytes.length;
      this.decoded.delete(other);
    }
    this.decoded.set(part, columns);
    return columns;
  }

  /** Return the agents at the end of a turn, by their names. @param {number} turn @returns {Map<string, Agent>} */
  agentsAt(turn) {
    const part = this.partOf(turn), found = new Map();
    if (part === undefined) return found;
    const columns = this.columns(part), { size } = part;
    const [status, nodes, side, sides] = ["status", "nodes", "side", "sides"].map((name) => columns.get(name));
    part.agents.forEach((name, i) => {
      const at = i * size + turn - part.first;
      if (!(status[at] & THERE)) return;
      found.set(name, {
        name, side: sides[side[at]], alive: Boolean(status[at] & ALIVE), flies: Boolean(status[at] & FLIES), row: nodes[at],
        edge: edgeAt(columns.get("on_edges"), at), ...airAt(columns.get("in_air"), at, part.step), way: wayAt(columns.get("ways"), at), named: namedAt(columns.get("named_edges"), at),
      });
    });
    return found;
  }

  /** Return how often nodes were visited up to a turn, by their rows. @param {number} turn @param {string | null} side null: by all @param {number} nodes how many there are */
  visits(turn, side, nodes) {
    const counts = new Float64Array(nodes);
    for (const part of this.parts) {
      if (part.first > turn) break;
      const columns = this.columns(part), { size } = part, ways = columns.get("ways"), wanted = columns.get("sides").indexOf(side);
      const isCounted = (/** @type {number} */ at) => columns.get("status")[at] & ALIVE && (side === null || columns.get("side")[at] === wanted) && part.first + (at % size) < Math.min(turn + 1, part.end);
      for (let at = 0; at < part.agents.length * size; at++) if (isCounted(at) && columns.get("nodes")[at] >= 0) counts[columns.get("nodes")[at]]++;
      ways.get("at").forEach((/** @type {number} */ at, /** @type {number} */ i) => {
        if (isCounted(at)) for (let k = ways.get("ends")[i]; k < ways.get("ends")[i + 1] - 1; k++) if (ways.get("nodes")[k] >= 0) counts[ways.get("nodes")[k]]++;
      });
    }
    return counts;
  }
}

/** @param {Map<string, any>} columns @param {number} at */
function edgeAt(columns, at) {
  const i = columns.get("index").get(at);
  return i === undefined ? null : { from: columns.get("from")[i], to: columns.get("to")[i], share: columns.get("share")[i] / SHARES };
}

/** @param {Map<string, any>} columns @param {number} at @param {number} step */
function airAt(columns, at, step) {
  const i = columns.get("index").get(at);
  if (i === undefined) return { position: null, heading: null };
  const heading = columns.get("heading")[i];
  return { position: /** @type {[number, number, number]} */ (["x", "y", "z"].map((axis) => step * columns.get(axis)[i])), heading: heading < 0 ? null : (heading / TURN) * 2 * Math.PI };
}

/** @param {Map<string, any>} columns @param {number} at @returns {number[] | null} */
function wayAt(columns, at) {
  const i = columns.get("index").get(at), ends = columns.get("ends");
  return i === undefined ? null : [...columns.get("nodes").subarray(ends[i], ends[i + 1])];
}

/** Return the row of the edge that an action has named. @param {Map<string, any> | undefined} columns @param {number} at @returns {number | null} */
function namedAt(columns, at) {
  const i = columns?.get("index").get(at);
  return i === undefined ? null : columns?.get("edges")[i];
}

/** Return where each of several runs ends that have these lengths, behind a 0. @param {ArrayLike<number>} counts */
export function endsOf(counts) {
  const found = new Float64Array(counts.length + 1);
  for (let i = 0; i < counts.length; i++) found[i + 1] = found[i] + counts[i];
  return found;
}
