// A recording that is shown: its state at a turn, the ways of agents in it, and what happens over all turns.
import { waysOf } from "./motion.js";
import { FLIGHT, Recording, replayTurn } from "./recording.js";
import { Knowledge, sensedAt, sideOf } from "./sensed.js";
import { KINDS, State, stateAt, teamText } from "./state.js";
import { World } from "./world.js";

const MOST_CAPTIONS = 20000, MOST_SIDES = 20000;

/** @typedef {{turn: number, words: string, agent: string | null, isMajor: boolean, isMarked: boolean}} Caption */

/** What happens in all turns, as far as they were read. */
export class Overview {
  constructor() {
    this.turns = 0; // that were read
    /** @type {Caption[]} */ this.captions = [];
    /** @type {{turn: number, scores: Map<string, number>}[]} */ this.scores = [];
    /** @type {{turn: number, artists: string[], hasColors: boolean, data: () => any}[]} */ this.shown = []; // changes of it
    /** @type {{turn: number, data: () => any}[]} */ this.worlds = [];
    /** @type {Map<string, string>} */ this.sides = new Map(); // of agents that come during the game, by their names
    this.hasSensed = false;
    this.hasMessages = false;
  }

  /** Read the next block of turns. @param {Recording} recording @returns {boolean} whether there was one */
  readOn(recording) {
    this.turns = Math.max(this.turns, recording.first);
    if (this.turns >= recording.turns) return false;
    const chunk = recording.chunk(this.turns);
    for (let i = 0; i < chunk.turns; i++) {
      const turn = chunk.first + i + 1;
      for (let event = chunk.eventEnds[i]; event < chunk.eventEnds[i + 1]; event++) {
        const kind = chunk.kinds[event];
        const data = () => recording.chunk(turn - 1).data(event);
        if (kind === KINDS.SHOWN) this.#addShown(turn, data);
        else if (kind === KINDS.SCORES) this.#addScores(turn, chunk.data(event).get("scores"));
        else if (kind === KINDS.WORLD) this.worlds.push({ turn, data });
        else if (kind === KINDS.SENSED) this.hasSensed = true;
        else if (kind === KINDS.MESSAGE) this.hasMessages = true;
        else if (kind === KINDS.AGENT_CREATE) this.#addAgent(chunk.data(event));
      }
    }
    this.turns = chunk.first + chunk.turns;
    return true;
  }

  /** @param {Map<string, any>} data */
  #addAgent(data) {
    const name = String(data.get("name"));
    if (this.sides.size < MOST_SIDES) this.sides.set(name, teamText(data.get("kwargs")?.get("team")) ?? name);
  }

  #addShown(/** @type {number} */ turn, /** @type {() => any} */ data) {
    const shown = data(), drawings = shown.get("drawings") ?? [];
    this.shown.push({ turn, artists: drawings.map((/** @type {any} */ one) => one.get("artist")), hasColors: shown.has("colors"), data });
    for (const one of shown.get("captions") ?? []) {
      if (this.captions.length >= MOST_CAPTIONS) break;
      this.captions.push({ turn, words: String(one.get("words")), agent: one.get("agent"), isMajor: one.get("major"), isMarked: one.get("marked") });
    }
  }

  #addScores(/** @type {number} */ turn, /** @type {any} */ given) {
    const scores = new Map([...(given ?? [])].map(([of, score]) => [teamText(of) ?? "", score]).filter((pair) => typeof pair[1] === "number"));
    this.scores.push({ turn, scores });
  }
}

export class Replay {
  /** @param {Recording} recording whose header and first keyframe are there */
  constructor(recording) {
    this.recording = recording;
    this.overview = new Overview();
    const world = recording.header.get("world");
    if (!(world instanceof Uint8Array)) throw new Error("This recording does not hold its map.");
    this.worldBytes = world;
    this.world = new World(world);
    this.knowledge = new Knowledge(recording, this.world);
    /** @type {State} */ this.state = stateAt(recording, recording.first);
    this.beginnings = recording.beginnings; // that are known
    this.first = [...this.state.agents.values()].map(sideOf);
    /** @type {Map<number, import("./state.js").Agent>} */ this.before = new Map();
    /** @type {import("./motion.js").Way[]} */ this.ways = [];
    /** @type {Map<number, import("./sensed.js").Look[]> | null} */ this.sensed = null;
    this.trailsKey = "";
    /** @type {Map<number, {turn: number, points: number[]}[]>} */ this.knownTrails = new Map();
    this.#prepare();
  }

  get turns() {
    return this.recording.turns;
  }

  /** Show the state after so many turns, at once. @param {number} turn */
  show(turn) {
    if (turn === this.state.turn + 1) {
      this.before = copyOf(this.state);
      this.state.advance(this.recording);
    } else if (turn !== this.state.turn) {
      const from = Math.max(turn - 1, this.recording.first);
      const isNear = this.state.turn <= from && this.recording.keyframeBefore(from) <= this.state.turn;
      const state = isNear ? this.state : stateAt(this.recording, from);
      while (state.turn < from) state.advance(this.recording);
      this.before = copyOf(state);
      if (turn > from) state.advance(this.recording);
      this.state = state;
      this.#restoreLooks(turn);
    } else {
      return;
    }
    this.#prepare();
  }

  /** Show the same turn again, of which more has become known. */
  refresh() {
    const { first, beginnings } = this.recording;
    const { turn } = this.state;
    this.beginnings = beginnings;
    this.knowledge.known.clear();
    this.state = stateAt(this.recording, Math.max(turn - 1, first));
    this.before = copyOf(this.state);
    if (turn > first) this.state.advance(this.recording);
    this.#restoreLooks(turn);
    this.#prepare();
  }

  /** Take what was sensed in the turn that is shown, which the next turn says. */
  learn() {
    this.#prepare();
  }

  #prepare() {
    const bytes = this.state.world ?? this.recording.header.get("world");
    if (bytes !== this.worldBytes) {
      this.worldBytes = bytes;
      this.world = new World(bytes);
      this.knowledge = new Knowledge(this.recording, this.world);
    }
    this.ways = waysOf(this.world, this.state, this.before);
    this.sensed = this.overview.hasSensed ? sensedAt(this.recording, this.state.turn) : null;
  }

  /** Restore what keyframes may not hold: drawings, colours, and another map. @param {number} turn */
  #restoreLooks(turn) {
    const { state, overview } = this;
    /** @type {Map<string, () => any>} */ const last = new Map(); // artist -> what has changed last, up to this turn
    let colors = () => new Map();
    for (const one of overview.shown) {
      if (one.turn > turn) break;
      for (const artist of one.artists) last.set(artist, one.data);
      if (one.hasColors) colors = one.data;
    }
    for (const [artist, data] of last) state.draw(data().get("drawings").find((/** @type {any} */ one) => one.get("artist") === artist));
    state.colors = colors().get("colors") ?? state.colors;
    state.world = overview.worlds.filter((one) => one.turn <= turn).pop()?.data().get("world") ?? null;
  }

  /**
   * Return the ways of agents in the last turns, without the one that is shown: number of an agent -> its steps, the
   * oldest first. An agent that was put elsewhere begins again there.
   * @param {number} turns
   * @returns {Map<number, {turn: number, points: number[]}[]>}
   */
  trails(turns) {
    if (this.trailsKey === `${turns} ${this.state.turn}`) return this.knownTrails;
    const { world } = this;
    /** @type {Map<number, {turn: number, points: number[]}[]>} */
    const found = new Map();
    /** @type {Map<number, number>} */
    const rows = new Map(); // where each agent was last
    const add = (/** @type {number} */ number, /** @type {number} */ turn, /** @type {number[]} */ points) => {
      const known = found.get(number);
      if (known === undefined) found.set(number, [{ turn, points }]);
      else known.push({ turn, points });
    };
    for (let turn = Math.max(this.state.turn - turns - 1, this.recording.first); turn < this.state.turn - 1; turn++) {
      replayTurn(this.recording.chunk(turn), turn, (number, node) => {
        const from = rows.get(number), to = world.rowOf.get(node);
        if (to === undefined) return;
        if (from !== undefined && from !== to) add(number, turn + 1, [...world.pointsBetween(from, to)]);
        rows.set(number, to);
      }, (kind, data) => {
        const number = kind === KINDS.CURRENT_NODE ? this.state.byName.get(data.get("agent_name"))?.number : undefined;
        if (kind === FLIGHT) add(data[0], turn + 1, [data[2], data[3]]);
        else if (number !== undefined) {
          rows.delete(number);
          found.delete(number);
        }
      });
    }
    [this.trailsKey, this.knownTrails] = [`${turns} ${this.state.turn}`, found];
    return found;
  }

  /** Return how often each node was gone to in all turns up to this one, by its row. @param {string | null} side */
  visits(side) {
    const counts = new Float64Array(this.world.nodeIds.length);
    const sides = new Map([...this.state.agents.values()].map((agent) => [agent.number, sideOf(agent)]));
    for (let { first } = this.recording; first < this.state.turn; ) {
      const chunk = this.recording.chunk(first);
      const end = chunk.moveEnds[Math.min(this.state.turn - chunk.first, chunk.turns)];
      for (let move = 0; move < end; move++) {
        const row = this.world.rowOf.get(chunk.nodes[move]);
        if (row !== undefined && (side === null || sides.get(chunk.rows[move]) === side)) counts[row]++;
      }
      first = chunk.first + chunk.turns;
    }
    return counts;
  }

  /** Return the sides of the game, in the order of their first agents, also while no agent of theirs is there. */
  sides() {
    const known = new Set([...this.first, ...this.overview.sides.values(), ...[...this.state.agents.values()].map(sideOf)]);
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
    const agent = this.state.byName.get(name);
    return agent === undefined ? this.overview.sides.get(name) ?? name : sideOf(agent);
  }
}

/** @param {State} state */
function copyOf(state) {
  return new Map([...state.agents].map(([number, agent]) => [number, { ...agent }]));
}
