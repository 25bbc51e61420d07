// What sensors saw in a turn, from the columns of an event; and what a team knows of the map and of others.
import { Fields, fieldOf } from "./fields.js";
import { Recording } from "./recording.js";
import { KINDS, State, stateAt, teamText } from "./state.js";
import { World } from "./world.js";

const IDS = 0, MAP = 1, AGENTS = 2, OTHER = 3, IN_SPACE = 4; // forms
const OF_NODES = new Set(["NEIGHBOR", "MAP", "RANGE", "ARC", "AERIAL", "OCCLUDED_MAP", "OCCLUDED_AERIAL"]);

/**
 * @typedef {{sensor: string, kind: string, nodes: number[], edges: number[], agents: number[], other: any}} Look
 * What one sensor saw: ids of nodes and edges, numbers of agents.
 */

/** Return what was sensed, by the number of the agent. @param {Map<string, any>} data @returns {Map<number, Look[]>} */
export function looksOf(data) {
  const [agents, counts, sensors, which, forms, sizes, ids, others] = ["agents", "counts", "sensors", "which", "forms", "sizes", "ids", "others"].map((key) => data.get(key));
  const found = new Map();
  let look = 0, at = 0, other = 0;
  for (let i = 0; i < agents.length; i++) {
    const looks = [];
    for (let n = 0; n < counts[i]; n++, look++) {
      const [sensor, kind] = sensors[which[look]] ?? ["", ""];
      const first = [...ids.slice(at, at + sizes[2 * look])];
      const second = [...ids.slice(at + sizes[2 * look], at + sizes[2 * look] + sizes[2 * look + 1])];
      at += first.length + second.length;
      const form = forms[look];
      const given = form === OTHER || form === IN_SPACE ? others[other++] : null;
      const isMap = form === IDS ? OF_NODES.has(kind) : form === MAP;
      looks.push({
        sensor, kind, nodes: isMap ? first : form === AGENTS || form === IN_SPACE ? second : [], edges: form === MAP ? second : [],
        agents: form === AGENTS || form === IN_SPACE ? first : [], other: isMap || form === AGENTS ? null : given ?? first,
      });
    }
    found.set(agents[i], looks);
  }
  return found;
}

/** Return what was sensed in a turn; null where that is not recorded. @param {Recording} recording @param {number} turn from 0 */
export function sensedIn(recording, turn) {
  if (turn < recording.first || turn >= recording.turns) return null;
  const chunk = recording.chunk(turn);
  for (let event = chunk.eventEnds[turn - chunk.first]; event < chunk.eventEnds[turn - chunk.first + 1]; event++) {
    if (chunk.kinds[event] === KINDS.SENSED) return looksOf(chunk.data(event));
  }
  return null;
}

/** Return what agents knew when the game stood so: what they sensed next; at the end, what they sensed last. */
export function sensedAt(/** @type {Recording} */ recording, /** @type {number} */ turn) {
  return sensedIn(recording, turn) ?? sensedIn(recording, turn - 1);
}

/** What a team sees: rows of nodes, and numbers of agents. @typedef {{nodes: Set<number>, agents: Set<number>}} Sight */

/** What teams know of the map: which nodes they see, and since when they have seen others. */
export class Knowledge {
  /** @param {Recording} recording @param {World} world */
  constructor(recording, world) {
    this.recording = recording;
    this.world = world;
    this.fields = new Fields(world);
    /** @type {Map<string, {since: Int32Array, state: State}>} */ this.known = new Map(); // team -> when it first saw each node, up to a state
    this.isCut = recording.header.has("audience"); // what is not known is not in it
  }

  /** Return what a team sees in a state. @param {State} state @param {string} team @param {Map<number, Look[]> | null} sensed @returns {Sight} */
  sight(state, team, sensed = sensedAt(this.recording, state.turn)) {
    const nodes = new Set(), agents = new Set();
    for (const agent of state.agents.values()) {
      if (this.isCut) agents.add(agent.number);
      if (sideOf(agent) !== team) continue;
      agents.add(agent.number);
      if (!agent.alive) continue;
      nodes.add(this.world.rowOf.get(agent.node));
      for (const look of sensed?.get(agent.number) ?? []) {
        for (const number of look.agents) agents.add(number);
        if (look.agents.length === 0 || OF_NODES.has(look.kind)) for (const id of look.nodes) nodes.add(this.world.rowOf.get(id));
        for (const row of this.#inField(state, agent, look)) nodes.add(row);
      }
    }
    for (const agent of state.agents.values()) {
      if (!agent.flies && agent.share === 0 && nodes.has(this.world.rowOf.get(agent.node))) agents.add(agent.number);
    }
    return { nodes, agents };
  }

  /** Return the nodes in the field of a sensor that sees agents wherever they are in it. */
  #inField(/** @type {State} */ state, /** @type {import("./state.js").Agent} */ agent, /** @type {Look} */ look) {
    const sensor = state.sensors.get(agent.sensors.get(look.sensor) ?? "");
    if (sensor === undefined || OF_NODES.has(look.kind)) return [];
    const field = fieldOf(this.world, agent, sensor);
    return field === null ? [] : this.fields.nodesIn(field);
  }

  /** Return for each node the turn in which a team first saw it; -1: never. @param {string} team @returns {Int32Array} */
  firstSeen(team) {
    const known = this.known.get(team) ?? { since: new Int32Array(this.world.nodeIds.length).fill(-1), state: stateAt(this.recording, this.recording.first) };
    this.known.set(team, known);
    const { since, state } = known;
    for (;;) { // the last state again: what is sensed in it may have come only now
      for (const row of this.sight(state, team).nodes) if (since[row] < 0) since[row] = state.turn;
      if (state.turn >= this.recording.turns) return since;
      state.advance(this.recording);
    }
  }
}

/** Return the side of an agent: its team, or without one itself. @param {{team: string | null, name: string}} agent */
export function sideOf(agent) {
  return teamText(agent.team) ?? agent.name;
}
