// The panel at the side: the game with its scores, events and agents; or one agent with what it knew and did.
import { wordsOf } from "./words.js";
import { dot, element, iconButton, refill } from "./dom.js";
import { sideOf } from "./sensed.js";
import { THEMES } from "./themes.js";

const MOST_ROWS = 400; // of a list
const RENEWED_MS = 200; // while a recording plays

/** @typedef {import("./app.js").App} App @typedef {import("./state.js").Agent} Agent @typedef {import("./replay.js").Replay} Replay */

export class Panel {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.renewedAt = 0;
    this.body = element("div", { class: "body" });
    this.heading = element("h2");
    this.element = element("aside", { class: "panel card", "aria-label": "Agents and events", hidden: true },
      element("div", { class: "top" }, this.heading, iconButton("close", "Close", () => this.close())), this.body);
    this.tip = element("div", { class: "tip card", role: "tooltip" });
    app.stage.append(this.tip);
  }

  open() {
    this.element.hidden = false;
    this.renew(true);
  }

  close() {
    this.element.hidden = true;
  }

  toggle() {
    if (this.element.hidden) this.open();
    else this.close();
  }

  /** Say what is so now. @param {boolean} [isAtOnce] although a recording plays */
  renew(isAtOnce = false) {
    const { app } = this;
    if (this.element.hidden || (app.isPlaying && !isAtOnce && performance.now() - this.renewedAt < RENEWED_MS)) return;
    this.renewedAt = performance.now();
    const [{ replay }] = app.views;
    const agent = app.look.selected === null ? undefined : replay.state.byName.get(app.look.selected);
    const scrolled = this.body.scrollTop;
    if (agent === undefined) {
      refill(this.heading, "The game");
      this.#renewGame(replay);
    } else {
      const color = app.views[0].scene.colors(app.look).get(sideOf(agent));
      refill(this.heading, dot(color), agent.name);
      refill(this.body, ...this.#agent(replay, agent));
    }
    this.body.scrollTop = scrolled;
  }

  /** Say what is pointed at. @param {import("./app.js").View} view @param {import("./scene.js").Disc | null} disc */
  explain(view, disc) {
    this.tip.classList.toggle("shown", disc !== null);
    if (disc === null) return;
    const agent = disc.way.agent;
    refill(this.tip, element("b", { text: agent.name }), element("span", { text: [agent.team, agent.alive ? null : "out", `node ${agent.node}`].filter(Boolean).join(" · ") }));
    const box = view.canvas.getBoundingClientRect(), stage = this.app.stage.getBoundingClientRect();
    this.tip.style.left = `${Math.min(box.left - stage.left + disc.px + 14, stage.width - 180)}px`;
    this.tip.style.top = `${box.top - stage.top + disc.py + 12}px`;
  }

  /** @param {Replay} replay */
  #renewGame(replay) {
    const chart = replay.overview.scores.length ? element("canvas", { class: "chart", role: "img", "aria-label": "Scores over the turns" }) : null;
    const { fog } = this.app.look;
    const blocks = [...replay.state.drawings.values()].filter((one) => fog === null || one.get("in_fog")).flatMap((one) => one.get("legend") ?? []);
    refill(this.body, ...(chart ? [element("h3", { text: "Scores" }), chart] : []), ...blocks.filter((one) => one.get("title") || one.get("ends")).map(legendOf), ...signs(replay, blocks), ...this.#events(replay), ...this.#agents(replay), ...this.#about(replay));
    if (chart) paintScores(chart, replay, this.app);
  }

  /** @param {Replay} replay */
  #events(replay) {
    const { app } = this;
    const all = replay.overview.captions;
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
    const all = [...replay.state.agents.values()].filter((agent) => scene.visible === null || scene.visible.has(agent.number));
    const rows = all.slice(0, MOST_ROWS).map((agent) => element("li", {}, element("button", { type: "button", class: agent.alive ? "row" : "row out", on: { click: () => app.select(agent.name) } },
      dot(colors.get(sideOf(agent))), element("span", { text: agent.name }), element("span", { class: "aside", text: agent.alive ? "" : "out" }))));
    return [element("details", { open: all.length <= 40 }, element("summary", { text: `Agents (${all.length})` }), element("ul", { class: "list" }, ...rows))];
  }

  /** @param {Replay} replay */
  #about(replay) {
    const { header } = replay.recording;
    const facts = [["seed", header.get("seed")], ["turns", replay.turns], ["nodes", replay.world.nodeIds.length], ["edges", replay.world.edgeIds.length], ["GAMMS", header.get("package")]];
    return [element("details", {}, element("summary", { text: "Recording" }), table(facts.filter((pair) => pair[1] !== null && pair[1] !== undefined)))];
  }

  /** @param {Replay} replay @param {Agent} agent @returns {(Node | string)[]} */
  #agent(replay, agent) {
    const { app } = this;
    const { state, world } = replay;
    const follow = element("button", { type: "button", class: "wanted", "aria-pressed": String(app.isFollowing), text: app.isFollowing ? "Following" : "Follow", on: { click: () => app.select(agent.name, !app.isFollowing) } });
    const back = element("button", { type: "button", class: "wanted", text: "All agents", on: { click: () => app.select(null) } });
    const row = world.rowOf.get(agent.node);
    const street = row === undefined ? undefined : streetAt(world, row);
    const isHidden = app.look.fog !== null && sideOf(agent) !== app.look.fog; // of whom the team knows only where it is
    const facts = [["team", agent.team], ["state", agent.alive ? null : "out of the game"], ["node", agent.node], ["street", street], ["before", agent.previous === agent.node ? null : agent.previous],
      ["on an edge", agent.share > 0 ? `${Math.round(agent.share * 100)} % from ${agent.source} to ${agent.target}` : null],
      ["position", agent.flies ? Array.from(agent.position, (one) => one.toFixed(1)).join(", ") : null], ["speed", agent.speed], ["strategy", agent.strategy], ...(isHidden ? [] : factsOf(state, agent.name))];
    const parts = [element("div", { class: "actions" }, follow, back), table(facts.filter((pair) => pair[1] !== null && pair[1] !== undefined))];
    if (isHidden) return [...parts, element("p", { class: "faint", text: `What ${app.look.fog} does not know of it is not shown.` })];
    return [...parts, ...this.#decision(replay, agent), ...this.#sensors(replay, agent), ...section("Memory", state.memories.get(agent.name)), ...section("Memory of the team", teamMemory(state, agent)), ...this.#messages(replay, agent), ...section("Attributes", agent.attributes)];
  }

  /** What the agent did in the turn that is shown. @param {Replay} replay @param {Agent} agent */
  #decision(replay, agent) {
    const { state } = replay;
    if (state.turn === 0) return [];
    const moves = state.log.moves.get(agent.number);
    const deeds = state.log.deeds.filter((deed) => deed.get("agent") === agent.name);
    const went = moves === undefined || moves.length === 0 ? null : moves[moves.length - 1] === replay.before.get(agent.number)?.node ? "stays" : `goes to ${moves.join(", ")}`;
    const rows = [["move", went], ...deeds.map((deed) => ["deed", wordsOf(new Map([...deed].filter(([key]) => !["turn", "agent"].includes(key))))]), ["blocked", state.blocked?.get?.(agent.name)]];
    const known = rows.filter((pair) => pair[1] !== null && pair[1] !== undefined);
    return known.length ? [element("h3", { text: `Decision in turn ${state.turn}` }), table(known)] : [];
  }

  /** What its sensors tell it now. @param {Replay} replay @param {Agent} agent */
  #sensors(replay, agent) {
    if (agent.sensors.size === 0) return [];
    const looks = new Map((replay.sensed?.get(agent.number) ?? []).map((look) => [look.sensor, look]));
    const rows = [...agent.sensors].map(([name, id]) => {
      const look = looks.get(name), type = replay.state.sensors.get(id)?.type ?? "";
      if (look === undefined) return [name, type];
      const seen = look.agents.map((number, i) => `${replay.state.agents.get(number)?.name ?? number} at ${look.nodes[i]}`);
      const words = seen.length ? seen.join(", ") : look.other !== null ? wordsOf(look.other) : look.nodes.length ? `${look.nodes.length} nodes` : look.edges.length ? `${look.edges.length} edges` : "nothing";
      return [`${name} (${type})`, look.edges.length && look.nodes.length ? `${words}, ${look.edges.length} edges` : words];
    });
    return [element("h3", { text: replay.sensed === null ? "Sensors" : "What its sensors tell it" }), table(rows)];
  }

  /** @param {Replay} replay @param {Agent} agent */
  #messages(replay, agent) {
    const now = replay.state.gameTurn;
    const rows = [];
    for (const message of replay.state.messages) {
      const body = wordsOf(message.get("body"), 120);
      if (message.get("sender") === agent.name && message.get("turn") === now) rows.push([`to ${wordsOf(message.get("to"))}`, body, fateOf(message)]);
      for (const key of ["heard", "overheard"]) if (message.get(key)?.get(agent.name) === now + 1) rows.push([`${key} from ${message.get("sender")}`, body, ""]);
    }
    return rows.length ? [element("h3", { text: "Messages" }), table(rows.slice(0, 50).map(([of, body, fate]) => [of, fate ? `${body} (${fate})` : body]))] : [];
  }
}

/** Return what became of a message. @param {Map<string, any>} message */
function fateOf(message) {
  const count = (/** @type {string} */ key) => message.get(key)?.size ?? message.get(key)?.length ?? 0;
  return ["heard", "overheard", "lost", "jammed"].filter((key) => count(key)).map((key) => `${key} by ${[...(message.get(key).keys ? (message.get(key) instanceof Map ? message.get(key).keys() : message.get(key)) : [])].slice(0, 6).join(", ")}`).join("; ");
}

/** @param {import("./state.js").State} state @param {Agent} agent */
function teamMemory(state, agent) {
  return [...state.teamMemories].find(([team]) => String(team) === agent.team)?.[1];
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

/** @param {string} title @param {any} values */
function section(title, values) {
  if (!(values instanceof Map) || values.size === 0) return [];
  return [element("h3", { text: title }), table([...values].slice(0, MOST_ROWS).map(([key, value]) => [String(key), wordsOf(value)]))];
}

/** @param {any[][]} rows */
function table(rows) {
  return element("dl", {}, ...rows.flatMap(([key, value]) => [element("dt", { text: key }), element("dd", { text: wordsOf(value) })]));
}

/** Return what drawings say of an agent. @param {import("./state.js").State} state @param {string} name @returns {[string, any][]} */
function factsOf(state, name) {
  return [...state.drawings.values()].flatMap((drawing) => drawing.get("facts")?.get(name) ?? []);
}

/** What the signs on the map mean. @param {Replay} replay @param {Map<string, any>[]} blocks @returns {Node[]} */
function signs(replay, blocks) {
  const rows = blocks.filter((one) => !one.get("title")).flatMap(rowsOf);
  if (replay.overview.hasMessages) rows.push(rowOf([undefined, "a message; dashed: overheard; crossed: lost", "", "⌒"]));
  return rows.length ? [element("details", { open: true }, element("summary", { text: "Signs" }), ...rows)] : [];
}

/** @param {any} color @returns {string | undefined} */
function cssOf(color) {
  return Array.isArray(color) || ArrayBuffer.isView(color) ? `rgb(${Array.from(/** @type {any} */ (color)).slice(0, 3).join(",")})` : undefined;
}

/** @param {any[]} row a colour, its name, a value, and a letter instead of a dot */
function rowOf([color, name, value, sign]) {
  const first = sign ? element("span", { class: "sign", "aria-hidden": "true", text: sign }) : dot(cssOf(color));
  return element("div", { class: "team" }, first, element("span", { class: "who", text: wordsOf(name) }), element("span", { class: "score", text: value === undefined || value === null ? "" : wordsOf(value) }));
}

/** @param {Map<string, any>} block of a legend */
function rowsOf(block) {
  return (block.get("rows") ?? []).slice(0, 50).map(rowOf);
}

/** What an artist says of its colours. @param {Map<string, any>} block */
function legendOf(block) {
  const steps = Array.from(block.get("colors") ?? []).slice(0, 64).map(cssOf);
  const bar = steps.length > 1 ? [element("div", { class: "gradient", style: { background: `linear-gradient(to right, ${steps.join(",")})` } }), element("div", { class: "ends" }, ...(block.get("ends") ?? []).map((/** @type {any} */ one) => element("span", { text: wordsOf(one) })))] : [];
  const title = wordsOf(block.get("title") ?? "");
  return element("section", { class: "legend" }, ...(title ? [element("h3", { text: title })] : []), ...bar, ...rowsOf(block));
}

/** Paint the scores of all teams over the turns. @param {HTMLCanvasElement} chart @param {Replay} replay @param {App} app */
function paintScores(chart, replay, app) {
  const theme = THEMES[app.look.theme], colors = app.views[0].scene.colors(app.look);
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = chart.clientWidth || 240, height = chart.clientHeight || 90;
  chart.width = width * ratio;
  chart.height = height * ratio;
  const to = /** @type {CanvasRenderingContext2D} */ (chart.getContext("2d"));
  to.scale(ratio, ratio);
  const { scores } = replay.overview;
  const names = [...new Set(scores.flatMap((one) => [...one.scores.keys()]))].slice(0, 12);
  const values = scores.flatMap((one) => [...one.scores.values()]);
  const low = Math.min(0, ...values), high = Math.max(low + 1, ...values);
  const x = (/** @type {number} */ turn) => 24 + (turn / Math.max(replay.turns, 1)) * (width - 28);
  const y = (/** @type {number} */ score) => height - 6 - ((score - low) / (high - low)) * (height - 14);
  to.font = "10px system-ui, sans-serif";
  to.fillStyle = theme.faint;
  to.textAlign = "right";
  to.textBaseline = "middle";
  for (const value of [low, high]) {
    to.fillText(String(Number(value.toPrecision(3))), 18, y(value));
    to.fillRect(22, y(value), width - 26, 0.5);
  }
  for (const name of names) {
    to.strokeStyle = colors.get(name) ?? theme.faint;
    to.lineWidth = 2;
    to.beginPath();
    let last = 0;
    to.moveTo(x(0), y(0));
    for (const one of scores) {
      to.lineTo(x(one.turn), y(last));
      last = one.scores.get(name) ?? last;
      to.lineTo(x(one.turn), y(last));
    }
    to.lineTo(x(replay.turns), y(last));
    to.stroke();
  }
  to.fillStyle = theme.ink;
  to.fillRect(x(app.turn) - 0.5, 2, 1, height - 6);
}
