// A game that is shown: how it stands at a turn, the ways of agents in it, and what happens over all turns.
import { waysOf } from "./motion.js";
import { Recording } from "./recording.js";
import { Sights } from "./sights.js";
import { Timeline } from "./timeline.js";
import { valueOf } from "./values.js";
import { World } from "./world.js";

/** @typedef {import("./recording.js").Agent} Agent */
/** @typedef {{sender: string | null, receiver: string | null, fate: number}} Message fate: 0 it is heard next, 1 overheard, 2 lost, 3 nobody is known to hear it */
/**
 * @typedef {object} State how the game stands at the end of a turn
 * @property {number} turn @property {Map<string, Agent>} agents @property {Map<string, any>} drawings by the names of their artists
 * @property {Map<string, any>} colors side -> theme -> its color @property {Map<string, any>} scores @property {boolean} isOver @property {Message[]} messages
 */

export class Replay {
  /** @param {Recording} recording whose header and first part are there */
  constructor(recording) {
    this.recording = recording;
    this.timeline = new Timeline();
    this.sights = new Sights(recording);
    /** @type {Map<Uint8Array, World>} */ this.worlds = new Map();
    this.isCut = recording.header.has("audience"); // what is not known is not in it
    /** @type {Set<string> | null} */ this.own = recording.header.has("agents") ? new Set(recording.header.get("agents")) : null; // agents whose knowledge is in it, where they need not be a whole side
    this.repeats = recording.repeats; // that are known
    this.trailsKey = "";
    /** @type {Map<string, {turn: number, points: ArrayLike<number>}[]>} */ this.knownTrails = new Map();
    this.#stand(recording.first);
    this.first = [...this.state.agents.values()].map((agent) => agent.side);
  }

  get turns() {
    return this.recording.turns;
  }

  /** Show the state after so many turns, at once. @param {number} turn */
  show(turn) {
    if (turn !== this.state.turn) this.#stand(turn);
  }

  /** Show the same turn again, of which more has become known. */
  refresh() {
    this.repeats = this.recording.repeats;
    this.#stand(this.state.turn);
  }

  /** @param {number} turn */
  #stand(turn) {
    const { recording, timeline } = this;
    while ((recording.parts[timeline.parts]?.first ?? Infinity) <= turn) timeline.readOn(recording);
    const before = turn > recording.first ? turn - 1 : turn;
    this.world = this.worldAt(turn);
    /** @type {State} */
    this.state = {
      turn, agents: recording.agentsAt(turn), drawings: timeline.drawings(turn), colors: timeline.at("colors", turn) ?? new Map(),
      scores: timeline.at("scores", turn) ?? new Map(), isOver: Boolean(timeline.at("is_over", turn)), messages: this.#messagesAt(turn),
    };
    this.before = recording.agentsAt(before);
    this.ways = waysOf(this.world, this.state.agents, this.worldAt(before), this.before);
    this.sensed = this.sights.looks(turn);
  }

  /** Return the map at the end of a turn. @param {number} turn @returns {World} */
  worldAt(turn) {
    const bytes = this.timeline.at("world", turn) ?? this.recording.header.get("world");
    if (!(bytes instanceof Uint8Array)) throw new Error("This recording does not hold its map.");
    const world = this.worlds.get(bytes) ?? new World(valueOf(bytes));
    if (this.worlds.size > 1) this.worlds.clear(); // a map may be large
    this.worlds.set(bytes, world);
    return world;
  }

  /** @param {number} turn @returns {Message[]} */
  #messagesAt(turn) {
    const part = this.recording.partOf(turn), found = [];
    if (part === undefined) return [];
    const columns = this.recording.columns(part).get("messages"), size = columns.length / 4;
    for (let i = 0; i < size; i++) {
      if (columns[i] !== turn - part.first) continue;
      const [sender, receiver] = [1, 2].map((column) => part.agents[columns[column * size + i]] ?? null);
      found.push({ sender, receiver, fate: columns[3 * size + i] });
    }
    return found;
  }

  /** Whether an agent belongs to an audience. @param {Agent} agent @param {string} audience a side, or the one of a game of which only a part is here */
  isOwn(agent, audience) {
    return this.own === null ? agent.side === audience : this.own.has(agent.name);
  }

  /** Return the sides of an audience. @param {string} audience @returns {string[]} */
  sidesOf(audience) {
    return this.own === null ? [audience] : [...new Set([...this.state.agents.values()].filter((agent) => this.isOwn(agent, audience)).map((agent) => agent.side))];
  }

  /** Return what an audience sees now: rows of nodes, and names of agents. @param {string} audience @returns {import("./sights.js").Sight} */
  sight(audience) {
    const known = this.sidesOf(audience).map((side) => this.sights.sight(side, this.state.turn));
    const own = [...this.state.agents.values()].filter((agent) => this.isCut || agent.side === audience).map((agent) => agent.name);
    return { nodes: new Set(known.flatMap((one) => [...(one?.nodes ?? [])])), agents: new Set([...own, ...known.flatMap((one) => [...(one?.agents ?? [])])]) };
  }

  /** Return for each node the turn in which an audience first saw it; -1: never. @param {string} audience @returns {Int32Array} */
  firstSeen(audience) {
    const [first, ...others] = this.sidesOf(audience).map((side) => this.sights.firstSeen(side, this.world.nodeIds.length));
    return others.reduce((all, one) => all.map((turn, i) => (turn < 0 || (one[i] >= 0 && one[i] < turn) ? one[i] : turn)), first ?? new Int32Array(this.world.nodeIds.length).fill(-1));
  }

  /**
   * Return the ways of agents in the last turns, without the one that is shown: name of an agent -> its steps, the
   * oldest first. An agent that was put elsewhere begins again there.
   * @param {number} turns
   */
  trails(turns) {
    const { turn } = this.state, key = `${turns} ${turn}`;
    if (this.trailsKey === key) return this.knownTrails;
    const first = Math.max(turn - turns - 1, this.recording.first);
    this.knownTrails = new Map();
    for (let at = first + 1, before = this.recording.agentsAt(first); at < turn; at++) {
      const agents = this.recording.agentsAt(at);
      for (const { name, points, agent } of waysOf(this.worldAt(at), agents, this.worldAt(at - 1), before)) {
        const known = agent.way?.length === 0 ? [] : this.knownTrails.get(name) ?? [];
        if (points.length > 2) known.push({ turn: at, points });
        this.knownTrails.set(name, known);
      }
      before = agents;
    }
    this.trailsKey = key;
    return this.knownTrails;
  }

  /** Return the sides of the game, in the order of their first agents, also while no agent of theirs is there. */
  sides() {
    const known = new Set([...this.first, ...this.timeline.sides]);
    return this.#inOrder(known).filter((side) => known.has(side));
  }

  /** @param {Set<string>} known */
  #inOrder(known) {
    /** @type {(string | null)[]} */ const all = this.recording.header.get("sides") ?? [];
    const others = [...known].filter((side) => !all.includes(side)); // the first of them are those that a cut did not name
    return [...all.map((side, i) => side ?? others.shift() ?? `\0${i}`), ...others];
  }

  /** Return the side of an agent by its name; the name itself where there is no such agent. @param {string} name */
  sideOf(name) {
    return this.state.agents.get(name)?.side ?? name;
  }
}
