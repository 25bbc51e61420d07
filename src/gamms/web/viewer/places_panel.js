// What stands beside the map of places: the search, the seed, what is chosen, and the text for a scenario file.
import { dot, element, iconButton, refill } from "./dom.js";
import { changesFor, targetsOf, yamlOf } from "./scenario_text.js";

const MOST_CHIPS = 60;
const SAID_MS = 2500;

/** @typedef {import("./places.js").Places} Places */

export class PlacesPanel {
  /** @param {Places} app */
  constructor(app) {
    this.app = app;
    const { options } = app;
    const [, agents, start] = [null, `agents ${options.teams[0]?.name}`, "list"];
    this.target = options.teams.length ? agents : start;
    /** @type {"id" | "xy" | "latlon"} */ this.form = "id";
    this.search = element("input", { type: "search", placeholder: "Street, or the id of a node", "aria-label": "Search a street", autocomplete: "off", spellcheck: "false",
      on: { input: () => this.#find(), keydown: (/** @type {KeyboardEvent} */ event) => this.#onSearchKey(event) } });
    this.found = element("ul", { class: "list found", "aria-label": "Streets that were found", on: { keydown: (/** @type {KeyboardEvent} */ event) => this.#onListKey(event) } });
    this.polygon = element("button", { type: "button", class: "wanted", "aria-pressed": "false", on: { click: () => app.draw("polygon") } });
    this.circle = element("button", { type: "button", class: "wanted", "aria-pressed": "false", on: { click: () => app.draw("circle") } });
    this.undo = element("button", { type: "button", class: "wanted", text: "Undo", title: "Undo (control Z)", on: { click: () => app.undo() } });
    this.clear = element("button", { type: "button", class: "wanted", text: "Clear", on: { click: () => app.choose([], null) } });
    this.hint = element("p", { class: "faint", role: "status" });
    this.seeds = element("section", { hidden: options.starts === undefined });
    this.chosen = element("div", { class: "chips" });
    this.targets = element("select", { "aria-label": "What is chosen for", on: { change: () => this.#pick() } });
    this.forms = element("select", { "aria-label": "How places are written", on: { change: () => this.#pick() } });
    this.text = element("textarea", { class: "yaml", readonly: true, rows: 8, spellcheck: "false", "aria-label": "Text for the scenario file" });
    this.copy = element("button", { type: "button", class: "wanted main", text: "Copy", on: { click: () => this.#copy() } });
    this.element = element("aside", { class: "places card", "aria-label": "Places" },
      element("h1", { text: options.title }), this.search, this.found, this.seeds,
      element("div", { class: "actions" }, this.polygon, this.circle, this.undo, this.clear), this.hint, this.chosen,
      this.targets, this.forms, this.text, element("div", { class: "actions" }, this.copy));
    const zoom = (/** @type {number} */ factor) => app.moveCamera((camera) => camera.zoom(factor, ...app.middle()));
    this.tools = element("div", { class: "tools" }, element("div", { class: "card toolbar", role: "toolbar", "aria-label": "View" },
      iconButton("plus", "Zoom in (+)", () => zoom(1.4)), iconButton("minus", "Zoom out (−)", () => zoom(1 / 1.4)),
      iconButton("fit", "See everything (0)", () => app.flyTo(app.world.box)), iconButton("theme", "Light or dark (N)", () => app.toggleTheme())));
    this.#makeSeeds();
  }

  // -- the search

  #find() {
    const { app } = this;
    refill(this.found, ...app.streets.find(this.search.value).map((found) => {
      const rows = found.node === null ? app.streets.nodesOf(found.edges) : [found.node];
      return element("li", {}, element("button", { type: "button", class: "row", on: { click: () => app.show(found) } }, element("span", { text: found.name }), element("span", { class: "aside", text: found.node === null ? `${rows.length} nodes` : "" })),
        element("button", { type: "button", class: "add", "aria-label": `Take the nodes of ${found.name}`, title: "Take its nodes", text: "+", on: { click: () => app.add(rows) } }));
    }));
    if (this.search.value.trim() !== "" && !this.found.firstChild) refill(this.found, element("li", { class: "faint", text: "No street has this name." }));
  }

  /** @param {KeyboardEvent} event */
  #onSearchKey(event) {
    const first = this.found.querySelector("button");
    if (event.key === "Enter") first?.click();
    else if (event.key === "ArrowDown") first?.focus();
    else if (event.key === "Escape") this.search.value = "";
    else return;
    if (event.key === "Escape") this.#find();
    event.preventDefault();
    event.stopPropagation();
  }

  /** Go up and down in the list. @param {KeyboardEvent} event */
  #onListKey(event) {
    const step = event.key === "ArrowDown" ? 1 : event.key === "ArrowUp" ? -1 : 0;
    if (step === 0) return;
    const rows = [...this.found.querySelectorAll("button.row")];
    const at = rows.findIndex((row) => row.parentElement?.contains(document.activeElement)) + step;
    /** @type {HTMLElement} */ (at < 0 ? this.search : rows[Math.min(at, rows.length - 1)]).focus();
    event.preventDefault();
    event.stopPropagation();
  }

  // -- where agents start

  #makeSeeds() {
    const set = (/** @type {number} */ seed) => {
      this.app.seed = seed;
      this.app.needsPaint = true;
      this.renew();
    };
    this.seed = element("input", { type: "number", step: 1, "aria-label": "Seed", value: this.app.seed, on: { input: () => Number.isSafeInteger(this.seed.valueAsNumber) && set(this.seed.valueAsNumber) } });
    this.teams = element("div", { class: "teams" });
    this.seedWords = element("p", { class: "faint", role: "status" });
    refill(this.seeds, element("label", { class: "seed" }, element("span", { text: "Start with seed" }), this.seed,
      element("button", { type: "button", class: "wanted", text: "Next", on: { click: () => set(this.app.seed + 1) } })), this.teams, this.seedWords);
  }

  #renewSeeds() {
    const { options, seed } = this.app;
    if (options.starts === undefined) return;
    if (this.seed.valueAsNumber !== seed) this.seed.value = String(seed);
    const nodes = options.starts.seeds[String(seed)];
    const known = Object.keys(options.starts.seeds).length;
    this.seedWords.textContent = typeof nodes === "string" ? nodes : nodes === undefined ? `This page knows the starts of ${known} seeds, not of this one.` : "";
    refill(this.teams, ...options.teams.map((team) => element("div", { class: "team" }, dot(team.colors[this.app.themeName]), element("span", { class: "who", text: team.name }), element("span", { class: "count", text: `${team.count + team.agents.length} agents` }))));
  }

  // -- what is chosen

  /** Say what is so now. */
  renew() {
    const { app } = this;
    const { drawing } = app;
    this.polygon.textContent = drawing?.kind === "polygon" && drawing.points.length >= 6 ? "Finish" : "Polygon";
    this.circle.textContent = "Circle";
    this.polygon.setAttribute("aria-pressed", String(drawing?.kind === "polygon"));
    this.circle.setAttribute("aria-pressed", String(drawing?.kind === "circle"));
    this.undo.disabled = app.history.length === 0;
    this.hint.textContent = drawing === null ? `${app.chosen.length === 0 ? "Click nodes, or draw an area." : `${app.chosen.length} nodes`}`
      : drawing.kind === "polygon" ? "Click the corners; the first one, or enter, closes the area." : drawing.points.length ? "Click where the circle ends." : "Click the middle of the circle.";
    refill(this.chosen, ...app.chosen.slice(0, MOST_CHIPS).map((row) => {
      const id = app.world.nodeIds[row];
      return element("button", { type: "button", class: "chip", "aria-label": `Leave out node ${id}`, title: app.streets.namesAt(row).join(" / ") || "Leave it out", text: `${id} ×`, on: { click: () => app.toggle(row) } });
    }), app.chosen.length > MOST_CHIPS ? element("span", { class: "faint", text: `and ${app.chosen.length - MOST_CHIPS} more` }) : null);
    this.#renewSeeds();
    this.#renewText();
  }

  #renewText() {
    const { app } = this;
    const targets = targetsOf(app.options, app.area);
    if (!targets.some(({ key }) => key === this.target)) this.target = targets[0].key;
    refill(this.targets, ...targets.map(({ key, words }) => element("option", { value: key, text: words, selected: key === this.target })));
    const forms = [["id", "as ids of nodes"], ["xy", "as [x, y]"], ...(app.world.latLon === null ? [] : [["latlon", "as latitude and longitude"]])];
    refill(this.forms, ...forms.map(([key, words]) => element("option", { value: key, text: words, selected: key === this.form })));
    this.forms.hidden = /^(start|closed)/.test(this.target);
    this.text.value = this.isEmpty ? "" : yamlOf(this.changes(), app.options);
    this.copy.disabled = this.isEmpty;
  }

  /** Whether nothing is chosen that could be copied. */
  get isEmpty() {
    return this.app.chosen.length === 0 && this.app.area === null;
  }

  /** Return what is chosen as changes of the scenario. */
  changes() {
    return changesFor(this.target, this.app.options, this.app.places(), this.app.area, this.form);
  }

  #pick() {
    this.target = this.targets.value;
    this.form = /** @type {"id" | "xy" | "latlon"} */ (this.forms.value);
    this.#renewText();
  }

  async #copy() {
    let isDone = false;
    try {
      await navigator.clipboard.writeText(this.text.value);
      isDone = true;
    } catch { // pages from files may not use it
      this.text.select();
      isDone = document.execCommand("copy");
    }
    this.copy.textContent = isDone ? "Copied" : "Select it, and copy it";
    setTimeout(() => { this.copy.textContent = "Copy"; }, SAID_MS);
  }

  /** Say what is pointed at. @param {number | null} row */
  explain(row) {
    const { app } = this;
    app.tip.classList.toggle("shown", row !== null);
    if (row === null) return;
    const { world } = app;
    const [x, y] = [world.xy[2 * row], world.xy[2 * row + 1]];
    const rows = [...(world.latLon === null ? [] : [["lat, lon", `${world.latLon[2 * row].toFixed(6)}, ${world.latLon[2 * row + 1].toFixed(6)}`]]), ["x, y", `${x.toFixed(2)}, ${y.toFixed(2)}`], ...app.streets.attributesAt(row)];
    refill(app.tip, element("b", { text: `node ${world.nodeIds[row]}` }), element("span", { text: app.streets.namesAt(row).join(" / ") }),
      element("dl", {}, ...rows.flatMap(([key, value]) => [element("dt", { text: key }), element("dd", { text: value })])));
    const [px, py] = app.camera.toScreen(x, y);
    const { width, height } = app.camera;
    app.tip.style.left = `${Math.max(Math.min(px + 16, width - app.tip.offsetWidth - 8), 8)}px`;
    app.tip.style.top = `${Math.max(Math.min(py + 14, height - app.tip.offsetHeight - 8), 8)}px`;
  }
}
