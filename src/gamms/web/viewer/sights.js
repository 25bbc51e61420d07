// What agents sense and sides see, from the columns of a game.
import { Recording, endsOf } from "./recording.js";
import { interleaved } from "./values.js";

/** @typedef {import("./recording.js").Part} Part */
/** @typedef {{isCarried: boolean, isBlocked: boolean, points: Float64Array}} Shape corners x, y, x, y, … seen from the agent that carries it, or on the map; obstacles may hide what is inside */
/** @typedef {{sensor: string, kind: string, shape: Shape | null, nodes: ArrayLike<number>, edges: ArrayLike<number>, agents: {name: string, row: number}[], words: string | null, isEarly: boolean}} Look rows of nodes and edges; the row of an agent is -1 where it is on its node; `isEarly`: sensed before the turn */
/** @typedef {{nodes: Set<number>, agents: Set<string>}} Sight rows of nodes, and names of agents of others */
/** @typedef {{part: Part, entry: number}} Moment where what is sensed at a moment is in a part */

export class Sights {
  /** @param {Recording} recording */
  constructor(recording) {
    this.recording = recording;
    /** @type {Map<string, {of: Part, entry: number, nodes: Set<number>}>} */ this.nodes = new Map(); // side -> what it saw, as it was asked for last
  }

  /** Return where it is what was sensed as the game stood so; undefined: it is not known. @param {number} turn @returns {Moment | undefined} */
  #momentOf(turn) {
    for (const at of [turn, turn - 1]) {
      for (const number of [at + 1, at]) { // what was sensed next is in the next turn; behind the last one it is with it
        const part = this.recording.partOf(number);
        const entry = part === undefined ? -1 : at + 1 - part.first;
        if (part !== undefined && this.recording.columns(part).get("looked")?.[entry] >= 0) return { part, entry };
      }
    }
    return undefined;
  }

  /** Return what a side sees at the end of a turn; null: it is not known. @param {string} side @param {number} turn @returns {Sight | null} */
  sight(side, turn) {
    const moment = this.#momentOf(turn);
    if (moment === undefined) return null;
    const { part, entry } = moment, sights = this.recording.columns(part).get("sights").get(side);
    if (sights === undefined) return null;
    const ends = endsOf(sights.get("agent_counts"));
    const agents = new Set(Array.from(sights.get("agents").subarray(ends[entry], ends[entry + 1]), (i) => part.agents[i]));
    return { nodes: this.#nodesOf(side, sights, moment), agents };
  }

  /** @param {string} side @param {Map<string, any>} sights @param {Moment} moment @returns {Set<number>} */
  #nodesOf(side, sights, { part, entry }) {
    let known = this.nodes.get(side);
    if (known?.of !== part || known.entry > entry) known = { of: part, entry: -1, nodes: new Set() };
    const ends = endsOf(sights.get("node_counts")), nodes = sights.get("nodes");
    for (let i = ends[known.entry + 1]; i < ends[entry + 1]; i++) if (!known.nodes.delete(nodes[i])) known.nodes.add(nodes[i]);
    known.entry = entry;
    this.nodes.set(side, known);
    return known.nodes;
  }

  /** Return for each node the turn in which a side first saw it; -1: never. @param {string} side @param {number} nodes how many there are @returns {Int32Array} */
  firstSeen(side, nodes) {
    const since = new Int32Array(nodes).fill(-1);
    for (const part of this.recording.parts) {
      const sights = this.recording.columns(part).get("sights")?.get(side);
      if (sights === undefined) continue;
      const counts = sights.get("node_counts"), rows = sights.get("nodes");
      for (let entry = 0, at = 0; entry < counts.length; entry++) {
        for (const end = at + counts[entry]; at < end; at++) if (since[rows[at]] < 0) since[rows[at]] = part.first + entry - 1;
      }
    }
    return since;
  }

  /** Return what the sensors of agents tell them at the end of a turn; null: it is not known. @param {number} turn @returns {Map<string, Look[]> | null} */
  looks(turn) {
    const moment = this.#momentOf(turn);
    if (moment === undefined) return null;
    const { part, entry } = moment, columns = this.recording.columns(part), size = columns.get("looks").length / 6;
    const column = (/** @type {number} */ i) => columns.get("looks").subarray(i * size, (i + 1) * size);
    const [agents, sensors, shapes, ...sizes] = [0, 1, 2, 3, 4, 5].map(column), ends = sizes.map(endsOf);
    const [first, last] = [0, 1].map((more) => columns.get("looked").subarray(0, entry + more).reduce((/** @type {number} */ sum, /** @type {number} */ one) => sum + Math.max(one, 0), 0));
    const seen = columns.get("seen_agents"), half = seen.length / 2, found = new Map();
    const isEarly = columns.get("is_early") && entry === columns.get("looked").length - 1;
    for (let i = first; i < last; i++) {
      const [sensor, kind] = columns.get("sensors")[sensors[i]], name = part.agents[agents[i]];
      const look = {
        sensor, kind, shape: shapes[i] < 0 ? null : shapeOf(columns.get("shapes")[shapes[i]], part.step),
        nodes: columns.get("seen_nodes").subarray(ends[0][i], ends[0][i + 1]), edges: columns.get("seen_edges").subarray(ends[1][i], ends[1][i + 1]),
        agents: Array.from({ length: sizes[2][i] }, (_, k) => ({ name: part.agents[seen[ends[2][i] + k]], row: seen[half + ends[2][i] + k] })), words: columns.get("words").get(i) ?? null, isEarly,
      };
      found.set(name, [...(found.get(name) ?? []), look]);
    }
    return found;
  }
}

/** @param {[boolean, ArrayLike<number>, boolean]} shape @param {number} step @returns {Shape} */
function shapeOf([isCarried, corners, isBlocked], step) {
  return { isCarried, isBlocked, points: interleaved(corners, 2, step) };
}
