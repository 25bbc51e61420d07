// The state of a game after a turn: columns of agents and plain values that events are applied to.
import { FLIGHT, Recording, TURN_IN_SPACE, replayTurn } from "./recording.js";

export const KINDS = {
  SNAPSHOT: 0x00000010, AGENT_CREATE: 0x01000000, AGENT_DELETE: 0x01000001, CURRENT_NODE: 0x01100000, PREV_NODE: 0x01100001,
  SENSOR_REGISTER: 0x01100002, SENSOR_DEREGISTER: 0x01100003, ORIENTATION: 0x01100004, POSITION: 0x01100005, QUATERNION: 0x01100006,
  TEAM: 0x01100010, ALIVE: 0x01100011, SPEED: 0x01100012, PROGRESS: 0x01100014, FLYERS_ABOVE: 0x01100030, WORLD: 0x03000000,
  SCORES: 0x04000000, OVER: 0x04000003,
  GAME_TURN: 0x04000004, MEMORY: 0x04000005, DEED: 0x04000008, BLOCKED: 0x04000009, MESSAGE: 0x0400000a,
  SENSORS: 0x06000000, SENSED: 0x06000001, SHOWN: 0x07000000,
};
const MOST_AGENTS = 200000;
const MOST_MESSAGES = 5000; // that are kept: those of the last turns
const NOWHERE = Object.freeze([NaN, NaN, NaN, NaN]); // of agents that have no such place
const OLDEST_MESSAGE = 200; // turns

/**
 * @typedef {object} Agent
 * @property {string} name
 * @property {number} number
 * @property {boolean} flies
 * @property {string | null} team
 * @property {boolean} alive
 * @property {number} node the id of the node it is on, or above
 * @property {number} previous
 * @property {number} source where the edge begins that it is on
 * @property {number} target
 * @property {number} share of that edge; 0 where it is on none
 * @property {number[]} position x, y, z; NaN on the ground
 * @property {number[]} heading cosine and sine; NaN where it has none
 * @property {number[]} quat
 * @property {number | null} speed
 * @property {Map<string, string>} sensors name -> id
 * @property {Map<string, any>} attributes
 * @property {string | null} strategy
 */

/** What one turn has done, for drawing it: where agents went, and what they did. */
export class TurnLog {
  constructor() {
    /** @type {Map<number, number[]>} */ this.moves = new Map(); // number of an agent -> the nodes it went to, in order
    /** @type {Map<string, any>[]} */ this.deeds = [];
    /** @type {Map<string, any>[]} */ this.messages = []; // that were sent
    /** @type {Map<string, any> | null} */ this.sensed = null; // at the beginning of the turn
  }
}

/** A state that events are applied to. */
export class State {
  /** @param {Map<string, any>} keyframe @param {number} turn how many turns come before it */
  constructor(keyframe, turn) {
    this.turn = turn;
    /** @type {Map<number, Agent>} */ this.agents = new Map();
    /** @type {Map<string, Agent>} */ this.byName = new Map();
    /** @type {Map<string, any>} */ this.drawings = new Map(); // by the names of their artists
    /** @type {Map<string, any>} */ this.colors = new Map(); // side -> theme -> its colour
    /** @type {Uint8Array | null} */ this.world = null; // another map than that of the header
    /** @type {Map<string, any>[]} */ this.messages = [];
    this.log = new TurnLog();
    this.restore(keyframe);
  }

  /** Become what a keyframe or a snapshot says. @param {Map<string, any>} keyframe */
  restore(keyframe) {
    const names = keyframe.get("names");
    if (!Array.isArray(names) || names.length > MOST_AGENTS) throw new Error("a keyframe is damaged");
    const column = (/** @type {string} */ name) => keyframe.get(name) ?? [];
    const row = (/** @type {string} */ name, /** @type {number} */ i, /** @type {number} */ width) => {
      const values = column(name);
      return values.length < width * (i + 1) || Number.isNaN(values[width * i]) ? NOWHERE : Array.from(values.subarray(width * i, width * (i + 1)));
    };
    this.agents.clear();
    this.byName.clear();
    this.sensors = sensorsIn(column("sensor_kinds"));
    const carried = carriedBy(keyframe.get("carried"), [...this.sensors.keys()]);
    const attributes = keyframe.get("attributes");
    names.forEach((name, i) => {
      const came = column("came")[i] ?? 0;
      this.#add({
        name: String(name), number: column("numbers")[i], flies: Boolean(column("kind")[i]),
        team: teamText(column("teams")[i]), alive: column("alive")[i] !== 0, node: column("node")[i],
        previous: column("node")[i] + (came % 2 ? -(came + 1) / 2 : came / 2),
        source: column("edge_source")[i] ?? 0, target: column("edge_target")[i] ?? 0, share: column("edge_share")[i] ?? 0,
        position: row("position", i, 3), heading: row("heading", i, 2), quat: row("quat", i, 4),
        speed: column("speed")[i] ?? null, sensors: carried[i] ?? new Map(),
        attributes: (attributes instanceof Map ? attributes.get(i) : attributes?.[i]) ?? new Map(),
        strategy: column("strategies")[i] ?? null,
      });
    });
    this.following = keyframe.get("next") ?? names.length;
    this.scores = new Map((keyframe.get("scores") ?? []).map((/** @type {[any, any]} */ [of, score]) => [teamText(of), score]));
    this.over = keyframe.get("over") ?? null;
    this.blocked = keyframe.get("blocked") ?? new Map();
    this.memories = keyframe.get("memories") ?? new Map();
    this.teamMemories = new Map(keyframe.get("team_memories") ?? []);
    this.show(keyframe.get("shown"));
    this.clock = { turn: keyframe.get("turn") ?? this.turn, at: this.turn, pace: keyframe.get("pace") ?? 1 };
  }

  /** The number that the game itself gives the turn. */
  get gameTurn() {
    return this.clock.turn + this.clock.pace * (this.turn - this.clock.at);
  }

  /** Apply the next turn. @param {Recording} recording */
  advance(recording) {
    this.log = new TurnLog();
    const now = this.gameTurn;
    if (this.messages.length) this.messages = this.messages.filter((one) => one.get("turn") > now - OLDEST_MESSAGE).slice(-MOST_MESSAGES);
    replayTurn(recording.chunk(this.turn), this.turn, (number, node) => this.#move(number, node), (kind, data) => this.#apply(kind, data));
    this.turn++;
  }

  /** @param {Agent} agent */
  #add(agent) {
    if (this.agents.size >= MOST_AGENTS) throw new Error("there are too many agents");
    this.agents.set(agent.number, agent);
    this.byName.set(agent.name, agent);
  }

  /** @param {number} number @param {number} node */
  #move(number, node) {
    const agent = this.agents.get(number);
    if (agent === undefined) throw new Error(`agent number ${number} moves and is not there`);
    agent.previous = agent.node;
    agent.node = node;
    const known = this.log.moves.get(number);
    if (known === undefined) this.log.moves.set(number, [node]);
    else known.push(node);
  }

  /** @param {number} kind @param {any} data */
  #apply(kind, data) {
    const apply = APPLY.get(kind);
    if (apply !== undefined) apply(this, data, data instanceof Map ? this.byName.get(data.get("agent_name")) : undefined);
  }

  /** Add an agent that comes during the game. @param {Map<string, any>} data */
  create(data) {
    const given = data.get("kwargs") ?? new Map();
    const state = data.get("state") ?? new Map();
    const place = (/** @type {string} */ name, /** @type {number} */ width) => [...(state.get(name) ?? new Array(width).fill(NaN))];
    const node = given.get("start_node_id");
    const sensors = given.get("sensors") ?? [];
    this.#add({
      name: String(data.get("name")), number: this.following++, flies: given.get("type") === 1 || !Number.isNaN(place("position", 3)[0]),
      team: teamText(given.get("team")), alive: true, node: state.get("node") ?? node, previous: node,
      source: 0, target: 0, share: 0, position: place("position", 3), heading: place("heading", 2), quat: place("quat", 4),
      speed: given.get("speed") ?? null, sensors: new Map(sensors instanceof Map ? sensors : sensors.map((/** @type {string} */ one) => [one, one])),
      attributes: given, strategy: data.get("strategy") ?? null,
    });
  }

  /** Remove an agent. @param {string} name */
  remove(name) {
    const agent = this.byName.get(name);
    if (agent === undefined) return;
    this.agents.delete(agent.number);
    this.byName.delete(name);
  }

  /** Show from now on these drawings and colours. @param {Map<string, any> | undefined} shown */
  show(shown) {
    for (const drawing of shown?.get("drawings") ?? []) this.draw(drawing);
    this.colors = shown?.get("colors") ?? this.colors;
  }

  /** Draw from now on what an artist draws. @param {Map<string, any>} data */
  draw(data) {
    if (data.has("commands")) this.drawings.set(data.get("artist"), data);
    else this.drawings.delete(data.get("artist"));
  }
}

/** @typedef {(state: State, data: any, agent: Agent | undefined) => void} Apply */

/** @type {Map<number, Apply>} What events do to a state. */
const APPLY = new Map([
  [KINDS.SNAPSHOT, (state, data) => state.restore(data)],
  [KINDS.AGENT_CREATE, (state, data) => state.create(data)],
  [KINDS.AGENT_DELETE, (state, data) => state.remove(data.get("name"))],
  [KINDS.CURRENT_NODE, (state, data, agent) => {
    if (agent === undefined) return;
    agent.node = data.get("node_id");
    state.log.moves.set(agent.number, []); // it was put there: it does not travel
  }],
  [KINDS.PREV_NODE, (_, data, agent) => { if (agent) agent.previous = data.get("node_id"); }],
  [KINDS.SENSOR_REGISTER, (_, data, agent) => agent?.sensors.set(data.get("name"), data.get("sensor_id"))],
  [KINDS.SENSOR_DEREGISTER, (_, data, agent) => agent?.sensors.delete(data.get("name"))],
  [KINDS.ORIENTATION, (_, data, agent) => { if (agent) agent.heading = [...(data.get("orientation") ?? [NaN, NaN])]; }],
  [KINDS.POSITION, (_, data, agent) => {
    if (agent) Object.assign(agent, { position: [...data.get("position")], node: data.get("node") ?? agent.node });
  }],
  [KINDS.QUATERNION, (_, data, agent) => { if (agent) agent.quat = [...data.get("quat")]; }],
  [KINDS.TEAM, (_, data, agent) => { if (agent) agent.team = teamText(data.get("team")); }],
  [KINDS.ALIVE, (_, data, agent) => {
    if (agent) agent.alive = data.get("alive");
  }],
  [KINDS.SPEED, (_, data, agent) => { if (agent) agent.speed = data.get("speed"); }],
  [KINDS.PROGRESS, (state, data) => progress(state, data)],
  [FLIGHT, (state, [number, node, ...position]) => {
    const agent = state.agents.get(number);
    if (agent === undefined) return;
    agent.previous = agent.node;
    Object.assign(agent, { node, position });
  }],
  [TURN_IN_SPACE, (state, [number, ...quat]) => { Object.assign(state.agents.get(number) ?? {}, { quat }); }],
  [KINDS.FLYERS_ABOVE, (state, data) => data.get("names").forEach((/** @type {string} */ name, /** @type {number} */ i) =>
    Object.assign(state.byName.get(name) ?? {}, { node: data.get("node")[i], previous: data.get("previous")[i] }))],
  [KINDS.WORLD, (state, data) => { state.world = data.get("world"); }],
  [KINDS.SHOWN, (state, data) => state.show(data)],
  [KINDS.SCORES, (state, data) => { state.scores = new Map([...pairsOf(data.get("scores"))].map(([of, score]) => [teamText(of), score])); }],
  [KINDS.OVER, (state, data) => { state.over = data.size ? data : null; }],
  [KINDS.GAME_TURN, (state, data) => { state.clock = { turn: data.get("turn"), at: state.turn + 1, pace: data.get("pace") }; }],
  [KINDS.MEMORY, (state, data) => remember(state, data)],
  [KINDS.DEED, (state, data) => state.log.deeds.push(data)],
  [KINDS.BLOCKED, (state, data) => { state.blocked = data.get("blocked"); }],
  [KINDS.MESSAGE, (state, data) => { state.log.messages.push(data); state.messages.push(data); }],
  [KINDS.SENSORS, (state, data) => {
    for (const id of data.get("removed") ?? []) state.sensors.delete(id);
    for (const [id, sensor] of sensorsIn(data.get("sensor_kinds"))) state.sensors.set(id, sensor);
  }],
  [KINDS.SENSED, (state, data) => { state.log.sensed = data; }],
]);

/** Return the state after so many turns. @param {Recording} recording @param {number} turn */
export function stateAt(recording, turn) {
  const { first, state: keyframe } = recording.keyframe(turn);
  const state = new State(keyframe, first);
  if (!keyframe.has("shown")) state.show(recording.header.get("shown"));
  while (state.turn < turn) state.advance(recording);
  return state;
}

/** @param {State} state @param {Map<string, any>} data */
function progress(state, data) {
  const [sources, targets, shares] = ["edge_source", "edge_target", "edge_share"].map((key) => data.get(key));
  data.get("numbers").forEach((/** @type {number} */ number, /** @type {number} */ i) => {
    Object.assign(state.agents.get(number) ?? {}, { source: sources[i], target: targets[i], share: shares[i] });
  });
}

/** Change a dict: what is `set`, what is `removed`, and what lists have `more`. */
function change(/** @type {Map<any, any>} */ values, /** @type {Map<string, any>} */ changes) {
  for (const [key, value] of changes.get("set") ?? []) values.set(key, value);
  for (const [key, more] of changes.get("more") ?? []) values.set(key, [...(values.get(key) ?? []), ...more]);
  for (const key of changes.get("removed") ?? []) values.delete(Array.isArray(key) ? JSON.stringify(key) : key);
}

/** @param {State} state @param {Map<string, any>} data */
function remember(state, data) {
  const all = [...[...data.get("agents")].map((pair) => [state.memories, ...pair]), ...data.get("teams").map((/** @type {any[]} */ pair) => [state.teamMemories, ...pair])];
  for (const [memories, of, changes] of all) {
    if (!memories.has(of)) memories.set(of, new Map());
    change(memories.get(of), changes);
  }
}

/** Return pairs of a dict, or of a list of pairs. @param {any} value @returns {Iterable<[any, any]>} */
function pairsOf(value) {
  return value instanceof Map ? value : value ?? [];
}

/** Return the text of a team; null of an agent without one. @param {any} team */
export function teamText(team) {
  return team === null || team === undefined ? null : Array.isArray(team) ? `(${team.join(", ")})` : String(team);
}

/** Return sensors by their ids. @param {Map<string, any>[]} groups @returns {Map<string, {type: string, keywords: Map<string, any>}>} */
function sensorsIn(groups) {
  const found = [], places = [];
  for (const group of groups ?? []) {
    for (const id of group.get("ids")) found.push([id, { type: group.get("type"), keywords: group.get("keywords") }]);
    places.push(...(group.get("at") ?? []));
  }
  if (places.length !== found.length) return new Map(/** @type {any} */ (found));
  return new Map(/** @type {any} */ (found.map((one, i) => [places[i], one]).sort((a, b) => /** @type {any} */ (a[0]) - /** @type {any} */ (b[0])).map((pair) => pair[1])));
}

/** Return the sensors of each agent: name -> id. @param {Map<string, any> | undefined} carried @param {string[]} ids */
function carriedBy(carried, ids) {
  if (!(carried instanceof Map)) return [];
  const known = [...ids, ...carried.get("others")];
  const names = carried.get("names");
  let at = 0;
  return Array.from(carried.get("counts"), (count) => {
    const found = new Map();
    for (let i = 0; i < count; i++, at++) {
      const id = known[carried.get("ids")[at]];
      found.set(names === null ? id : names[at], id);
    }
    return found;
  });
}
