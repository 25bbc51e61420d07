// The panel at the side: the game with its scores, events and agents; or one agent with what it knew and did.
import { wordsOf } from "./words.js";
import { dot, element, iconButton, refill } from "./dom.js";
import { passedBy } from "./motion.js";
import { THEMES } from "./themes.js";

const MOST_ROWS = 400; // of a list
const MOST_CHARTS = 4;
const RENEWED_MS = 200; // while a recording plays

/** @typedef {import("./app.js").App} App @typedef {import("./recording.js").Agent} Agent @typedef {import("./replay.js").Replay} Replay */

export class Panel {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.renewedAt = 0;
    this.hasShownCharts = false;
    /** @type {(() => void)[]} */ this.painting = []; // paints the charts that were made
    this.body = element("div", { class: "body" });
    this.heading = element("h2");
    this.element = element("aside", { class: "panel card", "aria-label": "Agents and events", hidden: true },
      element("div", { class: "top" }, this.heading, iconButton("close", "Close", () => this.close())), this.body);
    this.tip = element("div", { class: "tip card", role: "tooltip" });
    app.stage.append(this.tip);
  }

  /** Keep an element below the rest of the panel, which is made again in each turn. @param {HTMLElement} held */
  hold(held) {
    this.element.append(held);
  }

  open() {
    this.element.hidden = false;
    this.app.fitStage();
    this.renew(true);
  }

  close() {
    this.element.hidden = true;
    this.app.fitStage();
  }

  /** Open the panel beside a wide map once the game has charts, unless it was opened or closed before. */
  showCharts() {
    if (this.hasShownCharts || !this.app.isWide || this.app.views[0].replay.timeline.charts.length === 0) return;
    this.hasShownCharts = true;
    this.open();
  }

  toggle() {
    this.hasShownCharts = true;
    if (this.element.hidden) this.open();
    else this.close();
  }

  /** Say what is so now. @param {boolean} [isAtOnce] although a recording plays */
  renew(isAtOnce = false) {
    const { app } = this;
    if (this.element.hidden || (app.isPlaying && !isAtOnce && performance.now() - this.renewedAt < RENEWED_MS)) return;
    this.renewedAt = performance.now();
    const [{ replay }] = app.views;
    const agent = app.look.selected === null ? undefined : replay.state.agents.get(app.look.selected);
    const scrolled = this.body.scrollTop;
    if (agent === undefined) {
      refill(this.heading, "The game");
      this.#renewGame(replay);
    } else {
      const color = app.views[0].scene.colors(app.look).get(agent.side);
      refill(this.heading, dot(color), agent.name);
      refill(this.body, ...this.#agent(replay, agent));
    }
    this.body.scrollTop = scrolled;
  }

  /** Say what is pointed at. @param {import("./app.js").View} view @param {import("./scene.js").Disc | null} disc */
  explain(view, disc) {
    this.tip.classList.toggle("shown", disc !== null);
    if (disc === null) return;
    const { agent } = disc.way, { world } = view.replay;
    refill(this.tip, element("b", { text: agent.name }), element("span", { text: [agent.side === agent.name ? null : agent.side, agent.alive ? null : "out", `node ${world.nodeIds[agent.row]}`].filter(Boolean).join(" · ") }));
    const box = view.canvas.getBoundingClientRect(), stage = this.app.stage.getBoundingClientRect();
    this.tip.style.left = `${Math.min(box.left - stage.left + disc.px + 14, stage.width - 180)}px`;
    this.tip.style.top = `${box.top - stage.top + disc.py + 12}px`;
  }

  /** @param {Replay} replay */
  #renewGame(replay) {
    const chart = replay.timeline.scores.some((one) => one.values.size > 0) ? element("canvas", { class: "chart", role: "img", "aria-label": "Scores over the turns" }) : null;
    const { fog } = this.app.look;
    const blocks = [...replay.state.drawings.values()].filter((one) => fog === null || one.get("in_fog")).flatMap((one) => one.get("legend") ?? []);
    refill(this.body, ...(chart ? [element("h3", { text: "Scores" }), chart] : []), ...this.#charts(replay), ...blocks.filter((one) => one.get("title") || one.get("ends")).map(legendOf), ...signs(replay, blocks), ...this.#events(replay), ...this.#agents(replay), ...this.#about(replay));
    if (chart) paintLines(chart, replay, this.app, replay.timeline.scores, this.app.views[0].scene.colors(this.app.look), 0);
    for (const paint of this.painting) paint();
  }

  /** Make the charts of collected values; they are painted once they are in the page. @param {Replay} replay */
  #charts(replay) {
    const { app } = this, colors = new Map();
    /** @type {(() => void)[]} */ this.painting = [];
    if (app.look.fog !== null) return []; // a team does not know them
    const sides = app.views[0].scene.colors(app.look);
    for (const agent of replay.state.agents.values()) colors.set(agent.name, sides.get(agent.side));
    const all = replay.timeline.charts, names = [...new Set(all.flatMap((one) => [...one.values.keys()]))].slice(0, MOST_CHARTS);
    return names.map((name) => {
      const points = all.flatMap((one) => { const values = one.values.get(name); return values === undefined ? [] : [{ turn: one.turn, values }]; });
      const now = [...(points.filter((one) => one.turn <= app.turn).at(-1)?.values.values() ?? [])].filter((one) => typeof one === "number");
      const words = now.length ? [...new Set([Math.min(...now), Math.max(...now)])].map(shortNumber).join(" to ") : "";
      const canvas = element("canvas", { class: "chart small", role: "img", "aria-label": `${name} over the turns${words ? `, now ${words}` : ""}` });
      this.painting.push(() => paintLines(canvas, replay, app, points, colors, null));
      return element("section", { class: "collected" }, element("h3", {}, element("span", { text: name }), element("output", { text: words })), canvas);
    });
  }

  /** @param {Replay} replay */
  #events(replay) {
    const { app } = this;
    const all = replay.timeline.captions;
    if (all.length === 0 || app.look.fog !== null) return [];
    const shown = all.length > MOST_ROWS ? all.filter((one) => one.isMarked).slice(0, MOST_ROWS) : all;
    const rows = shown.map((one) => element("li", {}, element("button", { type: "button", class: one.turn === app.turn ? "row now" : "row", on: { click: () => { app.pause(); app.seek(one.turn); } } },
      element("span", { class: "number", text: one.turn }), element("span", { text: one.words }))));
    return [element("details", { open: true }, element("summary", { text: `Events (${all.length})` }), element("ul", { class: "list" }, ...rows))];
  }

  /** @param {Replay} replay */
  #agents(replay) {
    const { app } = this;
    const { scene } = app.views[0];
    const colors = scene.colors(app.look);
    const all = [...replay.state.agents.values()].filter((agent) => scene.visible === null || scene.visible.has(agent.name));
    const rows = all.slice(0, MOST_ROWS).map((agent) => element("li", {}, element("button", { type: "button", class: agent.alive ? "row" : "row out", on: { click: () => app.select(agent.name) } },
      dot(colors.get(agent.side)), element("span", { text: agent.name }), element("span", { class: "aside", text: agent.alive ? "" : "out" }))));
    return [element("details", { open: all.length <= 40 }, element("summary", { text: `Agents (${all.length})` }), element("ul", { class: "list" }, ...rows))];
  }

  /** @param {Replay} replay */
  #about(replay) {
    const { header } = replay.recording;
    const facts = [["seed", header.get("seed")], ["turns", replay.turns], ["nodes", replay.world.nodeIds.length], ["edges", replay.world.sources.length], ["GAMMS", header.get("package")]];
    return [element("details", {}, element("summary", { text: "Recording" }), table(facts.filter((pair) => pair[1] !== null && pair[1] !== undefined)))];
  }

  /** @param {Replay} replay @param {Agent} agent @returns {(Node | string)[]} */
  #agent(replay, agent) {
    const { app } = this;
    const { state, world } = replay;
    const follow = element("button", { type: "button", class: "wanted", "aria-pressed": String(app.isFollowing), text: app.isFollowing ? "Following" : "Follow", on: { click: () => app.select(agent.name, !app.isFollowing) } });
    const back = element("button", { type: "button", class: "wanted", text: "All agents", on: { click: () => app.select(null) } });
    const { turn } = state, before = replay.before.get(agent.name), nameOf = (/** @type {number} */ row) => world.nodeIds[row];
    const isHidden = app.look.fog !== null && !replay.isOwn(agent, app.look.fog); // of whom the team knows only where it is
    const facts = [["state", agent.alive ? null : "out of the game"], ["node", nameOf(agent.row)], ["street", agent.row < 0 ? undefined : streetAt(world, agent.row)], ["before", before === undefined || before.row === agent.row ? null : nameOf(before.row)],
      ["on an edge", agent.edge === null ? null : `${Math.round(agent.edge.share * 100)} % from ${nameOf(agent.edge.from)} to ${nameOf(agent.edge.to)}`],
      ["position", placeOf(agent)], ...replay.timeline.factsOf(agent.name, "", turn), ...(isHidden ? [] : factsOf(state, agent.name))];
    const parts = [element("div", { class: "actions" }, follow, back), table(facts.filter((pair) => pair[1] !== null && pair[1] !== undefined))];
    if (isHidden) return [...parts, element("p", { class: "faint", text: `What ${app.look.fog} does not know of it is not shown.` })];
    const section = (/** @type {string} */ heading) => titled(heading, replay.timeline.factsOf(agent.name, heading, turn));
    return [...parts, ...this.#decision(replay, agent), ...this.#sensors(replay, agent), ...["Memory", "Memory of the team", "Messages", "Attributes"].flatMap(section)];
  }

  /** What the agent did in the turn that is shown. @param {Replay} replay @param {Agent} agent */
  #decision(replay, agent) {
    const { turn } = replay.state, before = replay.before.get(agent.name);
    if (turn === replay.recording.first || agent.way?.length === 0 || !before?.alive) return [];
    return titled(`Decision in turn ${turn}`, [["move", moveOf(replay, agent, before)], ...replay.timeline.factsOf(agent.name, "Decision", turn)]);
  }

  /** What its sensors tell it now. @param {Replay} replay @param {Agent} agent */
  #sensors(replay, agent) {
    const { state, sensed, world } = replay, looks = new Map((sensed?.get(agent.name) ?? []).map((look) => [look.sensor, look]));
    const rows = replay.timeline.factsOf(agent.name, "Sensors", state.turn).map(([name, kind]) => {
      const look = looks.get(name);
      if (look === undefined) return [name, kind];
      const seen = look.agents.map((one) => `${one.name} at ${world.nodeIds[one.row < 0 ? state.agents.get(one.name)?.row ?? -1 : one.row]}`);
      const words = [...seen, look.words, look.nodes.length ? `${look.nodes.length} nodes` : null, look.edges.length ? `${look.edges.length} edges` : null];
      return [`${name} (${kind})`, words.filter(Boolean).join(", ") || "nothing"];
    });
    const isEarly = [...looks.values()].some((look) => look.isEarly);
    return titled(sensed === null ? "Sensors" : isEarly ? `What its sensors told it in turn ${state.turn}` : "What its sensors tell it", rows);
  }
}

/** Return what an agent did in a turn, as a verb and where to. @param {Replay} replay @param {Agent} agent @param {Agent} before */
function moveOf({ world }, agent, before) {
  const nameOf = (/** @type {number} */ row) => world.nodeIds[row];
  if (agent.flies) return String(agent.position) === String(before.position) ? "stays" : `flies to (${placeOf(agent)})`;
  const passed = passedBy(agent, before).map(nameOf), { edge } = agent;
  const isOn = edge !== null && (passed.length > 0 || edge.to !== before.edge?.to || edge.share !== before.edge.share);
  const parts = [passed.length ? `goes to ${passed.join(", ")}` : null, isOn ? `goes on toward ${nameOf(edge.to)}` : null].filter(Boolean);
  return parts.join(", ") || "stays";
}

/** Return where an agent in the air is. @param {Agent} agent */
function placeOf({ position }) {
  return position?.map((one) => one.toFixed(1)).join(", ");
}

/** Return the name of a street at a node. @param {import("./world.js").World} world @param {number} row */
function streetAt(world, row) {
  const known = new Set();
  for (let edge = 0; edge < world.sources.length; edge++) {
    if (world.sources[edge] !== row && world.targets[edge] !== row) continue;
    const name = world.attribute("edge", "name", edge);
    if (typeof name === "string") known.add(name);
  }
  return known.size ? [...known].slice(0, 3).join(" / ") : undefined;
}

/** @param {string} title @param {any[][]} rows */
function titled(title, rows) {
  return rows.length ? [element("h3", { text: title }), table(rows.slice(0, MOST_ROWS))] : [];
}

/** @param {any[][]} rows */
function table(rows) {
  return element("dl", {}, ...rows.flatMap(([key, value]) => [element("dt", { text: key }), element("dd", { text: wordsOf(value) })]));
}

/** Return what drawings say of an agent. @param {import("./replay.js").State} state @param {string} name @returns {[string, any][]} */
function factsOf(state, name) {
  return [...state.drawings.values()].flatMap((drawing) => drawing.get("facts")?.get(name) ?? []);
}

/** What the signs on the map mean. @param {Replay} replay @param {Map<string, any>[]} blocks @returns {Node[]} */
function signs(replay, blocks) {
  const rows = blocks.filter((one) => !one.get("title")).flatMap(rowsOf);
  if (replay.timeline.hasMessages) rows.push(rowOf([undefined, "a message; dashed: overheard; crossed: lost; a ring: nobody is known to hear it", "", "⌒"]));
  return rows.length ? [element("details", { open: true }, element("summary", { text: "Signs" }), ...rows)] : [];
}

/** @param {any} color @returns {string | undefined} */
function cssOf(color) {
  return Array.isArray(color) || ArrayBuffer.isView(color) ? `rgb(${Array.from(/** @type {any} */ (color)).slice(0, 3).join(",")})` : undefined;
}

/** @param {any[]} row a color, its name, a value, and a letter instead of a dot */
function rowOf([color, name, value, sign]) {
  const first = sign ? element("span", { class: "sign", "aria-hidden": "true", text: sign }) : dot(cssOf(color));
  return element("div", { class: "team" }, first, element("span", { class: "who", text: wordsOf(name) }), element("span", { class: "score", text: value === undefined || value === null ? "" : wordsOf(value) }));
}

/** @param {Map<string, any>} block of a legend */
function rowsOf(block) {
  return (block.get("rows") ?? []).slice(0, 50).map(rowOf);
}

/** What an artist says of its colors. @param {Map<string, any>} block */
function legendOf(block) {
  const steps = Array.from(block.get("colors") ?? []).slice(0, 64).map(cssOf);
  const bar = steps.length > 1 ? [element("div", { class: "gradient", style: { background: `linear-gradient(to right, ${steps.join(",")})` } }), element("div", { class: "ends" }, ...(block.get("ends") ?? []).map((/** @type {any} */ one) => element("span", { text: wordsOf(one) })))] : [];
  const title = wordsOf(block.get("title") ?? "");
  return element("section", { class: "legend" }, ...(title ? [element("h3", { text: title })] : []), ...bar, ...rowsOf(block));
}

/**
 * Paint values over the turns, with the least and the largest beside them, and a line at the turn that is shown.
 * @param {HTMLCanvasElement} chart @param {Replay} replay @param {App} app
 * @param {{turn: number, values: Map<string, any>}[]} points @param {Map<string, string | undefined>} colors by line
 * @param {number | null} first the value before the first turn, which is in the scale; null: there is none
 */
function paintLines(chart, replay, app, points, colors, first) {
  const theme = THEMES[app.look.theme];
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = chart.clientWidth || 240, height = chart.clientHeight || 90;
  chart.width = width * ratio;
  chart.height = height * ratio;
  const to = /** @type {CanvasRenderingContext2D} */ (chart.getContext("2d"));
  to.scale(ratio, ratio);
  const names = [...new Set(points.flatMap((one) => [...one.values.keys()]))].slice(0, 12);
  let low = first ?? Infinity, high = first === null ? -Infinity : first + 1;
  for (const one of points) for (const value of one.values.values()) if (typeof value === "number") [low, high] = [Math.min(low, value), Math.max(high, value)];
  const left = first === null ? 46 : 24, span = high - low;
  const x = (/** @type {number} */ turn) => left + (turn / Math.max(replay.turns, 1)) * (width - left - 4);
  const y = (/** @type {number} */ value) => height - 6 - (span > 0 ? (value - low) / span : 0.5) * (height - 14);
  to.font = "10px system-ui, sans-serif";
  to.fillStyle = theme.faint;
  to.textAlign = "right";
  to.textBaseline = "middle";
  for (const value of new Set([low, high])) {
    to.fillText(shortNumber(value), left - 6, y(value));
    to.fillRect(left - 2, y(value), width - left - 2, 0.5);
  }
  for (const name of names) {
    to.strokeStyle = colors.get(name) ?? (first === null ? theme.ink : theme.faint);
    to.lineWidth = first === null ? 1.5 : 2;
    to.beginPath();
    let last = first;
    if (last !== null) to.moveTo(x(0), y(last));
    for (const one of points) {
      const value = one.values.get(name) ?? (first === null ? null : last);
      if (last !== null) to.lineTo(x(one.turn), y(last));
      if (value === null) last = null;
      else to[last === null ? "moveTo" : "lineTo"](x(one.turn), y(value));
      last = value;
    }
    if (last !== null) to.lineTo(x(replay.turns), y(last));
    to.stroke();
  }
  to.fillStyle = theme.ink;
  to.fillRect(x(app.turn) - 0.5, 2, 1, height - 6);
}

/** Return a number with few digits. @param {number} value */
function shortNumber(value) {
  const words = String(Number(value.toPrecision(3)));
  return words.length > 7 ? value.toExponential(1) : words;
}
