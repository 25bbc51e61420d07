// A recording that is shown: its state at a turn, the ways of agents in it, and what happens over all turns.
import { captionsOf, endingOf, isMarked } from "./captions.js";
import { waysOf } from "./motion.js";
import { FLIGHT, Recording, replayTurn } from "./recording.js";
import { Knowledge, sensedAt, sideOf } from "./sensed.js";
import { KINDS, State, stateAt, teamText } from "./state.js";
import { World } from "./world.js";

const MOST_MARKS = 20000;

/** @typedef {{turn: number, words: string, agent: string | null, isMajor: boolean, isMarked: boolean}} Happening */

/** What happens in all turns, as far as they were read. */
export class Overview {
  constructor() {
    this.turns = 0; // that were read
    /** @type {Happening[]} */ this.happenings = [];
    /** @type {{turn: number, scores: Map<string, number>}[]} */ this.scores = [];
    /** @type {{turn: number, artist: string, data: () => any}[]} */ this.drawings = [];
    /** @type {{turn: number, data: () => any}[]} */ this.visuals = [];
    /** @type {{turn: number, data: () => any}[]} */ this.worlds = [];
    /** @type {Map<string, string>} */ this.sides = new Map(); // of agents that come during the game, by their names
    /** @type {Set<string>} */ this.kinds = new Set(); // of what happens
    /** @type {Map<string, {turn: number, hasArrived: boolean}[]>} */ this.ends = new Map(); // when agents went out, by their names
    /** @type {{turn: number, node: number, agent: string, other: string}[]} */ this.tags = [];
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
      const events = [], died = [];
      for (let event = chunk.eventEnds[i]; event < chunk.eventEnds[i + 1]; event++) {
        const kind = chunk.kinds[event];
        const data = () => recording.chunk(turn - 1).data(event);
        if (kind === KINDS.EVENT || kind === KINDS.USER_EVENT) events.push(chunk.data(event));
        else if (kind === KINDS.SCORES) this.#addScores(turn, chunk.data(event).get("scores"));
        else if (kind === KINDS.OVER) this.#addEnd(turn, chunk.data(event));
        else if (kind === KINDS.DRAWING) this.drawings.push({ turn, artist: chunk.data(event).get("artist"), data });
        else if (kind === KINDS.VISUALS) this.visuals.push({ turn, data });
        else if (kind === KINDS.WORLD) this.worlds.push({ turn, data });
        else if (kind === KINDS.SENSED) this.hasSensed = true;
        else if (kind === KINDS.MESSAGE) this.hasMessages = true;
        else if (kind === KINDS.ALIVE && !chunk.data(event).get("alive")) died.push(String(chunk.data(event).get("agent_name")));
        else if (kind === KINDS.AGENT_CREATE) this.#addAgent(chunk.data(event));
      }
      for (const event of events) this.kinds.add(String(event.get("kind")));
      this.#addMarks(turn, events, died);
      for (const { words, agent } of captionsOf(events)) this.#add({ turn, words, agent, isMajor: false, isMarked: events.some(isMarked) });
    }
    this.turns = chunk.first + chunk.turns;
    return true;
  }

  /** Note which agents were tagged, and which went out. @param {number} turn @param {Map<string, any>[]} events @param {string[]} died */
  #addMarks(turn, events, died) {
    const arrived = new Set(events.filter((event) => event.get("kind") === "arrive").map((event) => event.get("agent")));
    for (const name of died) {
      const hasArrived = arrived.has(name);
      this.kinds.add(hasArrived ? "arrived" : "died");
      const ends = this.ends.get(name) ?? [];
      if (ends.length < MOST_MARKS) ends.push({ turn, hasArrived });
      if (this.ends.size < MOST_MARKS) this.ends.set(name, ends);
    }
    for (const event of events) {
      if (event.get("kind") !== "tag" || this.tags.length >= MOST_MARKS) continue;
      this.tags.push({ turn, node: event.get("node"), agent: String(event.get("agent")), other: String(event.get("other")) });
    }
  }

  /** Return when an agent went out that is out after a turn, and whether it had arrived. @param {string} name @param {number} turn */
  endOf(name, turn) {
    return this.ends.get(name)?.filter((one) => one.turn <= turn).pop();
  }

  /** @param {Map<string, any>} data */
  #addAgent(data) {
    const name = String(data.get("name"));
    if (this.sides.size < MOST_MARKS) this.sides.set(name, teamText(data.get("kwargs")?.get("team")) ?? name);
  }

  /** @param {Happening} happening */
  #add(happening) {
    if (this.happenings.length < MOST_MARKS) this.happenings.push(happening);
  }

  #addScores(/** @type {number} */ turn, /** @type {any} */ given) {
    const scores = new Map([...(given ?? [])].map(([of, score]) => [teamText(of) ?? "", score]).filter((pair) => typeof pair[1] === "number"));
    const before = this.scores.length ? this.scores[this.scores.length - 1].scores : new Map();
    for (const [of, score] of scores) {
      if (score > (before.get(of) ?? 0)) this.#add({ turn, words: `${of} ${Number(score.toPrecision(6))}`, agent: of, isMajor: true, isMarked: true });
    }
    this.scores.push({ turn, scores });
  }

  #addEnd(/** @type {number} */ turn, /** @type {Map<string, any>} */ over) {
    if (over.size) this.#add({ turn, words: endingOf(over), agent: teamText(over.get("winner")), isMajor: true, isMarked: true });
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

  /** Restore what keyframes do not hold: drawings, declared looks, and another map. @param {number} turn */
  #restoreLooks(turn) {
    const { state, overview } = this;
    const last = (/** @type {{turn: number, data: () => any}[]} */ all) => all.filter((one) => one.turn <= turn).pop();
    const artists = new Map(overview.drawings.filter((one) => one.turn <= turn).map((one) => [one.artist, one]));
    state.drawings.clear();
    for (const drawing of this.recording.header.get("drawings") ?? []) if (!artists.has(drawing.get("artist"))) state.draw(drawing);
    for (const one of artists.values()) state.draw(one.data());
    state.visuals = last(overview.visuals)?.data() ?? this.recording.header.get("visuals") ?? null;
    state.world = last(overview.worlds)?.data().get("world") ?? null;
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

  /** Return the sides in the order in which they choose colours, also those of which nothing is known. */
  sidesWithColors() {
    return this.#inOrder(new Set(this.sides()));
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
