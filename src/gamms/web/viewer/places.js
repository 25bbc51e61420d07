// A page on which places of a map are found and chosen, and become text of a scenario file. Begin here.
import { bytesIn } from "./bytes.js";
import { Camera } from "./camera.js";
import { element } from "./dom.js";
import { Pointers, releaseControls } from "./input.js";
import { paintScaleBar, paintWords } from "./lettering.js";
import { MapLayer } from "./map_layer.js";
import { PlacesPanel } from "./places_panel.js";
import { outlineOf } from "./scenario_text.js";
import { Squares } from "./squares.js";
import { Streets } from "./streets.js";
import { THEMES, faded, isBright } from "./themes.js";
import { valueOf } from "./values.js";
import { World } from "./world.js";

const RESTS_MS = 160; // after which the map is painted sharply
const FLIGHT_MS = 450;
const NODE_PX = 18; // between neighbours, from where on nodes are shown
const POINT_PX = 30; // from which a node is pointed at
const CLOSE_PX = 12; // a click so near to the first corner closes an area
const AROUND_M = 120, AROUND = 8; // what is seen around a node: metres, or typical edges
const MOST_STEPS = 200; // that can be undone
const PAN_PX = 60, ZOOM = 1.25;

/** @typedef {import("./scenario_text.js").Area} Area @typedef {import("./scenario_text.js").Place} Place */
/** @typedef {{names: string[], seeds: Record<string, number[] | string>}} Starts */
/** @typedef {import("./scenario_text.js").Scenario & {title: string, theme?: "light" | "dark", seed?: number, starts?: Starts}} Options */

export class Places {
  /** @param {HTMLElement} root @param {World} world @param {Options} options */
  constructor(root, world, options) {
    this.root = root;
    this.world = world;
    this.options = options;
    this.streets = new Streets(world);
    this.squares = new Squares(world);
    this.map = new MapLayer(world);
    this.camera = new Camera(world.box, world.unit);
    this.themeName = options.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    this.isFollowing = false;
    /** @type {number[]} */ this.chosen = []; // rows of nodes, in the order in which they were chosen
    /** @type {Area | null} */ this.area = null;
    /** @type {{kind: "polygon" | "circle", points: number[]} | null} */ this.drawing = null;
    /** @type {{chosen: number[], area: Area | null}[]} */ this.history = [];
    /** @type {number | null} */ this.hovered = null;
    /** @type {number[]} */ this.street = []; // edges that are shown
    this.seed = options.seed ?? 0;
    this.pointer = [0, 0];
    this.movedAt = this.finishedAt = -Infinity;
    /** @type {{from: number[], to: number[], begun: number} | null} */ this.flight = null;
    this.needsPaint = true;
    /** @type {number[][]} */ this.named = []; // where names stand: left, top, right
    this.canvas = element("canvas", { class: "view", tabindex: "0", role: "img", "aria-label": "The map. Keys: W A S D move it, + and - zoom, enter takes the node in the middle." });
    this.to = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { alpha: false }));
    this.tip = element("div", { class: "tip card", role: "tooltip" });
    this.stage = element("div", { class: "stage" }, element("div", { class: "half" }, this.canvas), this.tip);
    this.panel = new PlacesPanel(this);
    root.replaceChildren(this.stage, this.panel.element, this.panel.tools, element("footer", { class: "credit", text: [world.attribution, "GAMMS"].filter(Boolean).join(" · ") }));
    this.dress();
    new ResizeObserver(() => this.#resize()).observe(this.stage);
    this.#resize();
    new Pointers(this, { canvas: this.canvas });
    document.addEventListener("keydown", (event) => this.#onKey(event));
    releaseControls();
    this.panel.renew();
    root.dataset.isRead = "true";
    this.#frame(performance.now());
  }

  // -- what is chosen

  /** Return what is chosen as places. @returns {Place[]} */
  places() {
    const { nodeIds, xy, latLon } = this.world;
    const degrees = (/** @type {number} */ at) => (latLon === null ? null : Number(latLon[at].toFixed(6)));
    return this.chosen.map((row) => ({ id: nodeIds[row], x: xy[2 * row], y: xy[2 * row + 1], lat: degrees(2 * row), lon: degrees(2 * row + 1) }));
  }

  /** Choose other nodes, and perhaps another area. @param {number[]} chosen @param {Area | null} [area] */
  choose(chosen, area = this.area) {
    this.history = [...this.history, { chosen: this.chosen, area: this.area }].slice(-MOST_STEPS);
    [this.chosen, this.area] = [chosen, area];
    this.needsPaint = true;
    this.panel.renew();
  }

  /** Add nodes to those that are chosen. @param {number[]} rows @param {Area | null} [area] */
  add(rows, area = this.area) {
    this.choose([...new Set([...this.chosen, ...rows])], area);
  }

  /** Choose a node, or no longer. @param {number} row */
  toggle(row) {
    this.choose(this.chosen.includes(row) ? this.chosen.filter((one) => one !== row) : [...this.chosen, row]);
  }

  undo() {
    const before = this.history.pop();
    if (before === undefined) return;
    [this.chosen, this.area] = [before.chosen, before.area];
    this.needsPaint = true;
    this.panel.renew();
  }

  /** Begin an area, finish it, or begin none. @param {"polygon" | "circle" | null} kind */
  draw(kind) {
    if (kind !== null && this.drawing?.kind === kind) {
      this.#finish();
      return;
    }
    this.drawing = kind === null ? null : { kind, points: [] };
    this.needsPaint = true;
    this.panel.renew();
  }

  /** Take the nodes in the area that was drawn. */
  #finish() {
    const drawn = this.drawing;
    this.drawing = null;
    this.finishedAt = performance.now();
    const { xy } = this.world;
    if (drawn !== null && drawn.kind === "circle" && drawn.points.length === 4) {
      const [x, y, ex, ey] = drawn.points;
      const radius = Math.hypot(ex - x, ey - y);
      this.add(this.squares.within(x, y, radius), { points: [x, y], radius });
    } else if (drawn !== null && drawn.kind === "polygon" && drawn.points.length >= 6) {
      const rows = Array.from(this.world.nodeIds.keys()).filter((row) => isInside(drawn.points, xy[2 * row], xy[2 * row + 1]));
      this.add(rows, { points: drawn.points, radius: null });
    }
    this.needsPaint = true;
    this.panel.renew();
  }

  // -- what pointers and keys do

  press() {
    this.flight = null;
  }

  /** @param {any} _ @param {number} px @param {number} py @param {number} far */
  click(_, px, py, far) {
    if (this.drawing !== null) this.#addCorner(px, py);
    else {
      const row = this.nodeAt(px, py, Math.max(far, POINT_PX));
      if (row !== null) this.toggle(row);
    }
  }

  /** @param {number} px @param {number} py */
  #addCorner(px, py) {
    const { kind, points } = /** @type {{kind: string, points: number[]}} */ (this.drawing);
    const isNear = (/** @type {number} */ at) => Math.hypot(...this.camera.toScreen(points[at], points[at + 1]).map((one, i) => one - [px, py][i])) < CLOSE_PX;
    if (kind === "polygon" && points.length >= 6 && (isNear(0) || isNear(points.length - 2))) {
      this.#finish();
      return;
    }
    points.push(...this.camera.toWorld(px, py));
    if (kind === "circle" && points.length === 4) this.#finish();
    this.needsPaint = true;
    this.panel.renew();
  }

  /** @param {number} px @param {number} py */
  doubleClick(px, py) {
    if (this.drawing === null && performance.now() - this.finishedAt > 500) this.moveCamera((camera) => camera.zoom(1.6, px, py));
  }

  /** @param {any} _ @param {number | null} px @param {number} py */
  point(_, px, py) {
    this.pointer = [px ?? 0, py];
    const row = px === null || this.drawing !== null ? null : this.nodeAt(px, py, POINT_PX);
    if (this.drawing !== null) this.needsPaint = true;
    this.canvas.style.cursor = this.drawing !== null ? "crosshair" : row === null ? "" : "pointer";
    if (row === this.hovered) return;
    this.hovered = row;
    this.needsPaint = true;
    this.panel.explain(row);
  }

  /** Return the row of the node nearest to a pixel; null where none is so near. @param {number} px @param {number} py @param {number} far pixels */
  nodeAt(px, py, far) {
    const { xy } = this.world;
    const [x, y] = this.camera.toWorld(px, py);
    const distance = (/** @type {number} */ row) => Math.hypot(xy[2 * row] - x, xy[2 * row + 1] - y);
    const [nearest] = this.squares.within(x, y, far / this.camera.scale).sort((a, b) => distance(a) - distance(b));
    return nearest ?? null;
  }

  /** @param {(camera: Camera) => void} move */
  moveCamera(move) {
    move(this.camera);
    this.movedAt = performance.now();
    this.needsPaint = true;
  }

  /** @param {KeyboardEvent} event */
  #onKey(event) {
    const target = /** @type {HTMLElement} */ (event.target);
    const isField = ["INPUT", "SELECT", "TEXTAREA"].includes(target.tagName);
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z" && !isField) this.undo();
    else if (event.ctrlKey || event.metaKey || event.altKey) return;
    else if (event.key === "Escape") this.draw(null);
    else if (isField || !this.#act(event.key.toLowerCase(), target.tagName === "BUTTON")) return;
    event.preventDefault();
  }

  /** Do what a key means; return whether it means anything. @param {string} key @param {boolean} isButton whether a button has the focus */
  #act(key, isButton) {
    const pan = (/** @type {number} */ dx, /** @type {number} */ dy) => this.moveCamera((camera) => camera.pan(dx * PAN_PX, dy * PAN_PX));
    const zoom = (/** @type {number} */ factor) => this.moveCamera((camera) => camera.zoom(factor));
    /** @type {Record<string, () => void>} */
    const actions = {
      w: () => pan(0, 1), s: () => pan(0, -1), a: () => pan(1, 0), d: () => pan(-1, 0), arrowup: () => pan(0, 1), arrowdown: () => pan(0, -1), arrowleft: () => pan(1, 0), arrowright: () => pan(-1, 0),
      "+": () => zoom(ZOOM), "=": () => zoom(ZOOM), "-": () => zoom(1 / ZOOM), 0: () => this.flyTo(this.world.box), n: () => this.toggleTheme(), "/": () => this.panel.search.focus(),
      ...(isButton ? {} : { enter: () => (this.drawing === null ? this.click(null, ...this.middle(), 0) : this.#finish()) }),
    };
    const action = Object.hasOwn(actions, key) ? actions[key] : undefined;
    action?.();
    return action !== undefined;
  }

  /** Return the pixel in the middle of what is seen of the map. @returns {[number, number]} */
  middle() {
    const { width, height, insets } = this.camera;
    return [(width + insets.left - insets.right) / 2, (height + insets.top - insets.bottom) / 2];
  }

  toggleTheme() {
    this.themeName = this.themeName === "light" ? "dark" : "light";
    this.dress();
    this.panel.renew();
  }

  /** Show a street, or a node. @param {import("./streets.js").Found} found */
  show(found) {
    const { xy, isMetric, unit } = this.world;
    this.street = found.edges;
    const rows = found.node === null ? this.streets.nodesOf(found.edges) : [found.node];
    const around = isMetric ? AROUND_M : AROUND * unit;
    const box = { left: Infinity, bottom: Infinity, right: -Infinity, top: -Infinity };
    for (const row of rows) {
      box.left = Math.min(box.left, xy[2 * row] - around);
      box.right = Math.max(box.right, xy[2 * row] + around);
      box.bottom = Math.min(box.bottom, xy[2 * row + 1] - around);
      box.top = Math.max(box.top, xy[2 * row + 1] + around);
    }
    if (rows.length) this.flyTo(box);
  }

  /** Move to where a box fills the view. @param {{left: number, bottom: number, right: number, top: number}} box */
  flyTo(box) {
    const { camera } = this;
    const there = new Camera(box, camera.unit);
    there.insets = camera.insets;
    there.resize(camera.width, camera.height);
    const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.flight = { from: [camera.x, camera.y, Math.log(camera.scale)], to: [there.x, there.y, Math.log(there.scale)], begun: isStill ? -Infinity : performance.now() };
    this.needsPaint = true;
  }

  // -- painting

  dress() {
    const theme = THEMES[this.themeName];
    this.root.dataset.theme = theme.name;
    for (const name of /** @type {const} */ (["background", "ink", "faint", "card"])) this.root.style.setProperty(`--${name}`, theme[name]);
    this.needsPaint = true;
  }

  #resize() {
    const isWide = this.root.clientWidth > 640;
    const panel = this.panel.element;
    this.camera.insets = isWide ? { left: panel.offsetWidth + 12, top: 0, right: 0, bottom: 0 } : { left: 0, top: 50, right: 0, bottom: panel.offsetHeight };
    this.ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.canvas.width = Math.round(this.canvas.clientWidth * this.ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * this.ratio);
    this.camera.resize(this.canvas.clientWidth, this.canvas.clientHeight);
    this.needsPaint = true;
  }

  /** @param {number} now */
  #frame(now) {
    if (this.flight !== null) this.#fly(now);
    const isMoving = now - this.movedAt < RESTS_MS;
    if (this.needsPaint) {
      this.needsPaint = !this.#paint(isMoving);
    } else if (isMoving) {
      this.needsPaint = true;
    }
    requestAnimationFrame((next) => this.#frame(next));
  }

  /** @param {number} now */
  #fly(now) {
    const { from, to, begun } = /** @type {{from: number[], to: number[], begun: number}} */ (this.flight);
    const share = Math.min((now - begun) / FLIGHT_MS, 1), eased = share * share * (3 - 2 * share);
    const [x, y, scale] = from.map((one, i) => one + eased * (to[i] - one));
    this.moveCamera((camera) => {
      camera.lookAt(x, y);
      camera.scale = Math.exp(scale);
    });
    if (share >= 1) this.flight = null;
  }

  /** Paint all. @param {boolean} isMoving @returns {boolean} whether the map is as sharp as it can be */
  #paint(isMoving) {
    const { to, camera, world } = this;
    const theme = THEMES[this.themeName];
    to.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    const isSharp = this.map.show(to, camera, theme, this.ratio, isMoving);
    this.named = [];
    to.lineCap = to.lineJoin = "round";
    to.beginPath();
    for (const edge of this.street) this.#line(world.pointsOf(edge));
    this.#stroke("#f0ac28", 5);
    this.#paintNodes(theme);
    this.#paintTeams(theme);
    if (this.area !== null) this.#paintArea(this.area, theme.ink, []);
    if (this.drawing !== null) this.#paintDrawing(theme);
    for (const row of this.chosen) this.#disc(row, 5, "#d81b60", "#ffffff");
    if (this.chosen.length <= 40) this.chosen.forEach((row, i) => this.#label(row, String(i + 1), theme));
    if (this.hovered !== null) this.#disc(this.hovered, 6, faded(theme.ink, 0.25), theme.ink);
    if (world.isMetric) paintScaleBar(to, camera, theme);
    return isSharp;
  }

  /** The nodes in view, where they can be told apart. @param {import("./themes.js").Theme} theme */
  #paintNodes(theme) {
    const { to, camera, world } = this;
    if (camera.scale * world.unit < NODE_PX) return;
    to.beginPath();
    for (const row of this.squares.within(camera.x, camera.y, Math.hypot(camera.width, camera.height) / 2 / camera.scale)) {
      const [x, y] = camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]);
      to.moveTo(x + 2, y);
      to.arc(x, y, 2, 0, 7);
    }
    to.fillStyle = theme.faint;
    to.fill();
  }

  /** Where the agents of a scenario start. @param {import("./themes.js").Theme} theme */
  #paintTeams(theme) {
    const { options } = this;
    const colors = new Map(options.teams.map((one) => [one.name, one.colors[this.themeName]]));
    for (const { name, near, within } of options.teams) {
      if (near !== undefined && within !== undefined) this.#paintArea({ points: near, radius: within }, colors.get(name) ?? theme.ink, [6, 5]);
    }
    const nodes = options.starts?.seeds[String(this.seed)];
    if (!Array.isArray(nodes)) return;
    const sides = options.teams.flatMap((team) => [...team.agents, ...Array.from({ length: team.count }, () => "")].map(() => team.name));
    nodes.forEach((id, i) => {
      const row = this.world.rowOf.get(id), color = colors.get(sides[i]) ?? theme.ink;
      if (row === undefined) return;
      this.#disc(row, 7, color, isBright(color) ? "#3c3c3c" : "#ffffff");
      if (nodes.length <= 30) this.#label(row, options.starts?.names[i] ?? "", theme);
    });
  }

  /** @param {Area} area @param {string} color @param {number[]} dash */
  #paintArea(area, color, dash) {
    const { to } = this;
    to.beginPath();
    this.#line(outlineOf(area).flat());
    to.closePath();
    to.fillStyle = faded(color, 0.08);
    to.fill();
    to.setLineDash(dash);
    this.#stroke(faded(color, 0.7), 1.5);
    to.setLineDash([]);
  }

  /** The area that is being drawn, as far as the pointer. @param {import("./themes.js").Theme} theme */
  #paintDrawing(theme) {
    const { kind, points } = /** @type {{kind: string, points: number[]}} */ (this.drawing);
    if (points.length === 0) return;
    const [x, y] = this.camera.toWorld(this.pointer[0], this.pointer[1]);
    if (kind === "circle") this.#paintArea({ points: points.slice(0, 2), radius: Math.hypot(x - points[0], y - points[1]) }, theme.ink, [4, 4]);
    else this.#paintArea({ points: [...points, x, y], radius: null }, theme.ink, [4, 4]);
    for (let i = 0; i < points.length; i += 2) {
      this.to.beginPath();
      this.to.arc(...this.camera.toScreen(points[i], points[i + 1]), 4, 0, 7);
      this.to.fillStyle = theme.ink;
      this.to.fill();
    }
  }

  /** @param {ArrayLike<number>} points */
  #line(points) {
    this.to.moveTo(...this.camera.toScreen(points[0], points[1]));
    for (let i = 2; i < points.length; i += 2) this.to.lineTo(...this.camera.toScreen(points[i], points[i + 1]));
  }

  /** @param {string} color @param {number} width */
  #stroke(color, width) {
    this.to.strokeStyle = color;
    this.to.lineWidth = width;
    this.to.stroke();
  }

  /** @param {number} row @param {number} radius @param {string} fill @param {string} edge */
  #disc(row, radius, fill, edge) {
    this.to.beginPath();
    this.to.arc(...this.camera.toScreen(this.world.xy[2 * row], this.world.xy[2 * row + 1]), radius, 0, 7);
    this.to.fillStyle = fill;
    this.to.fill();
    this.#stroke(edge, 1.5);
  }

  /** Write a name beside a node, unless it would cover another one. @param {number} row @param {string} words @param {import("./themes.js").Theme} theme */
  #label(row, words, theme) {
    const [x, y] = this.camera.toScreen(this.world.xy[2 * row], this.world.xy[2 * row + 1]);
    if (this.named.some(([left, top, right]) => Math.abs(top - y) < 14 && x < right && x + 7 * words.length > left)) return;
    this.named.push([x, y, x + 7 * Math.min(words.length, 24)]);
    this.to.font = "12px system-ui, sans-serif";
    this.to.textAlign = "left";
    this.to.textBaseline = "middle";
    paintWords(this.to, words.slice(0, 24), x + 9, y - 8, theme);
  }
}

/** Whether a place is in a polygon. @param {number[]} points x, y, x, y, … @param {number} x @param {number} y */
function isInside(points, x, y) {
  let isIn = false;
  for (let i = 0, j = points.length - 2; i < points.length; j = i, i += 2) {
    if (points[i + 1] > y !== points[j + 1] > y && x < ((points[j] - points[i]) * (y - points[i + 1])) / (points[j + 1] - points[i + 1]) + points[i]) isIn = !isIn;
  }
  return isIn;
}

/** Show the map in the page. */
async function begin() {
  const options = JSON.parse(document.getElementById("options")?.textContent || "{}");
  const world = new World(valueOf(await bytesIn(document.getElementById("map"))));
  Object.defineProperty(window, "gamms", { value: new Places(/** @type {HTMLElement} */ (document.getElementById("viewer")), world, options) });
}

begin().catch((error) => {
  const words = `This map cannot be shown: ${error instanceof Error ? error.message : error}`;
  document.getElementById("viewer")?.replaceChildren(element("p", { class: "failure", role: "alert", text: words }));
});
