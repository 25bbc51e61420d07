// The map behind everything: painted once for a view, then shifted and scaled until the camera rests.
import { Camera } from "./camera.js";
import { between, faded } from "./themes.js";
import { MAIN, MAJOR, ORDINARY, PATH, SERVICE, World } from "./world.js";

const GREEN = 1, WATER = 2, WATERWAY = 16, TRAM = 17;
const WIDTHS_M = { [PATH]: 0.8, [SERVICE]: 1.4, [ORDINARY]: 2, [MAIN]: 3.2, [MAJOR]: 5.2 };
const LINE_PX = 1.5;
export const NODE = 0.077; // radius of a node where a map has no metres, in lengths of a typical edge
const STEPS = 6; // tones of buildings
const MARGIN = 0.5; // of the painted area around the view, in views

/** @typedef {import("./themes.js").Theme} Theme */
/** @typedef {{path: Path2D, width: number}} Stroke */

export class MapLayer {
  /** @param {World} world */
  constructor(world) {
    this.world = world;
    this.canvas = document.createElement("canvas");
    /** @type {{x: number, y: number, scale: number, theme: string, ratio: number} | null} */
    this.painted = null;
    this.origin = [(world.box.left + world.box.right) / 2, (world.box.bottom + world.box.top) / 2];
    this.roads = this.#roads();
    this.areas = this.#areas();
    this.shapes = this.#shapes();
    this.lines = this.#path(world.buildings.lines);
  }

  /**
   * Show the map as the camera sees it.
   * @param {CanvasRenderingContext2D} to @param {Camera} camera @param {Theme} theme @param {number} ratio device pixels per CSS pixel
   * @param {boolean} isMoving whether a coarse picture will do for now
   * @returns {boolean} whether the picture is as sharp as it can be
   */
  show(to, camera, theme, ratio, isMoving) {
    const was = this.painted;
    const isStale = was === null || was.theme !== theme.name || was.ratio !== ratio;
    const isSharp = !isStale && was.scale === camera.scale && this.#covers(camera);
    const isUsable = !isStale && (isSharp || (isMoving && this.#covers(camera)));
    if (!isSharp && !isUsable) this.#paint(camera, theme, ratio);
    const { x, y, scale } = /** @type {{x: number, y: number, scale: number}} */ (this.painted);
    const zoom = camera.scale / scale;
    const [px, py] = camera.toScreen(x, y);
    const width = (this.canvas.width / ratio) * zoom, height = (this.canvas.height / ratio) * zoom;
    to.imageSmoothingEnabled = zoom !== 1;
    if (zoom === 1) to.drawImage(this.canvas, Math.round((px - width / 2) * ratio) / ratio, Math.round((py - height / 2) * ratio) / ratio, width, height);
    else to.drawImage(this.canvas, px - width / 2, py - height / 2, width, height);
    return isSharp || !isUsable;
  }

  /** @param {Camera} camera */
  #covers(camera) {
    const was = this.painted;
    if (was === null) return false;
    const halfWidth = this.canvas.width / was.ratio / was.scale / 2, halfHeight = this.canvas.height / was.ratio / was.scale / 2;
    const ownWidth = camera.width / camera.scale / 2, ownHeight = camera.height / camera.scale / 2;
    return Math.abs(camera.x - was.x) + ownWidth <= halfWidth * 1.001 && Math.abs(camera.y - was.y) + ownHeight <= halfHeight * 1.001;
  }

  /** @param {Camera} camera @param {Theme} theme @param {number} ratio */
  #paint(camera, theme, ratio) {
    const { canvas, world } = this;
    canvas.width = Math.round(camera.width * (1 + MARGIN) * ratio);
    canvas.height = Math.round(camera.height * (1 + MARGIN) * ratio);
    this.painted = { x: camera.x, y: camera.y, scale: camera.scale, theme: theme.name, ratio };
    const to = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha: false }));
    to.fillStyle = theme.background;
    to.fillRect(0, 0, canvas.width, canvas.height);
    const scale = camera.scale * ratio;
    to.setTransform(scale, 0, 0, -scale, canvas.width / 2 - (camera.x - this.origin[0]) * scale, canvas.height / 2 + (camera.y - this.origin[1]) * scale);
    to.lineCap = to.lineJoin = "round";
    this.#paintGround(to, theme, 1 / camera.scale);
    for (const { path, width } of this.roads.tunnels) this.#stroke(to, path, Math.max(width, 1 / camera.scale), faded(theme.streets, 0.5), [7, 5]);
    this.#paintBuildings(to, theme, camera.scale);
    this.paintStreets(to, theme.streets, camera.scale);
    if (!world.isMetric || camera.scale * world.unit > 14) this.#paintNodes(to, theme, camera.scale);
  }

  /** @param {CanvasRenderingContext2D} to @param {Theme} theme @param {number} pixel */
  #paintGround(to, theme, pixel) {
    const { shapes } = this;
    to.fillStyle = theme.land;
    to.fill(shapes.land);
    to.fillStyle = theme.green;
    to.fill(shapes.green, "nonzero");
    to.fillStyle = theme.water;
    to.fill(shapes.water, "nonzero");
    this.#stroke(to, shapes.waterway, Math.max(2, pixel), theme.waterway);
    this.#stroke(to, shapes.rails, Math.max(0.6, 0.7 * pixel), theme.rail);
  }

  /** @param {CanvasRenderingContext2D} to @param {Theme} theme @param {number} scale */
  #paintBuildings(to, theme, scale) {
    const width = Math.max(0.5 / scale, Math.min(0.4, 0.066 * this.world.unit));
    this.areas.forEach((path, step) => {
      to.fillStyle = between(...theme.walls, step / (STEPS - 1));
      to.fill(path, "evenodd");
    });
    if (scale * this.world.unit > 3) for (const path of this.areas) this.#stroke(to, path, width, theme.outline);
    this.#stroke(to, this.lines, Math.max(2 * width, 1.5 / scale), theme.wall);
  }

  /** Stroke all streets. @param {CanvasRenderingContext2D} to @param {string} color @param {number} scale */
  paintStreets(to, color, scale) {
    for (const { path, width } of this.roads.streets) this.#stroke(to, path, Math.max(width, (this.world.isMetric ? 0.7 : LINE_PX) / scale), color);
  }

  /** @param {CanvasRenderingContext2D} to @param {Theme} theme @param {number} scale */
  #paintNodes(to, theme, scale) {
    const { xy, unit, isMetric } = this.world;
    const radius = Math.max((isMetric ? 0.033 : NODE) * unit, (isMetric ? 0 : 1.5) / scale);
    to.fillStyle = theme.nodes;
    to.beginPath();
    for (let i = 0; i < xy.length; i += 2) {
      to.moveTo(xy[i] - this.origin[0] + radius, xy[i + 1] - this.origin[1]);
      to.arc(xy[i] - this.origin[0], xy[i + 1] - this.origin[1], radius, 0, 7);
    }
    to.fill();
  }

  #stroke(/** @type {CanvasRenderingContext2D} */ to, /** @type {Path2D} */ path, /** @type {number} */ width, /** @type {string} */ color, /** @type {number[]} */ dash = []) {
    to.lineWidth = width;
    to.strokeStyle = color;
    to.setLineDash(dash);
    to.stroke(path);
    to.setLineDash([]);
  }

  /** Return streets by their breadth, lesser ones first, and tunnels. @returns {{streets: Stroke[], tunnels: Stroke[]}} */
  #roads() {
    const { world } = this;
    const most = 0.2 * world.unit;
    const kinds = [PATH, SERVICE, ORDINARY, MAIN, MAJOR];
    const make = () => kinds.map((kind) => ({ path: new Path2D(), width: world.isMetric ? WIDTHS_M[/** @type {0} */ (kind)] * Math.min(1, most / 2) : 0 }));
    const streets = make(), tunnels = make();
    for (const edge of world.streets) {
      const kind = world.classOf(edge);
      this.#add((world.isTunnel(edge) ? tunnels : streets)[kind].path, world.pointsOf(edge));
    }
    return { streets, tunnels };
  }

  /** Return the outlines of buildings by their height, in steps. @returns {Path2D[]} */
  #areas() {
    const { areas } = this.world.buildings;
    const heights = areas.map((one) => one.height).sort((a, b) => a - b);
    const low = heights[Math.floor(0.05 * heights.length)] ?? 0, high = heights[Math.floor(0.95 * heights.length)] ?? 0;
    const paths = Array.from({ length: STEPS }, () => new Path2D());
    for (const { height, rings } of areas) {
      const share = high > low ? Math.min(Math.max((height - low) / (high - low), 0), 1) : 0;
      for (const ring of rings) this.#add(paths[Math.round(share * (STEPS - 1))], ring, true);
    }
    return paths;
  }

  #shapes() {
    const found = { land: new Path2D(), green: new Path2D(), water: new Path2D(), waterway: new Path2D(), rails: new Path2D() };
    const [left, low, right, high] = this.world.ground;
    if (right !== undefined) this.#add(found.land, [left, low, right, low, right, high, left, high], true);
    for (const { kind, points } of this.world.shapes) {
      const path = kind === GREEN ? found.green : kind === WATER ? found.water : kind === WATERWAY ? found.waterway : found.rails;
      if (kind === GREEN || kind === WATER || (kind >= WATERWAY && kind <= TRAM + 1)) this.#add(path, points, kind < WATERWAY);
    }
    return found;
  }

  #path(/** @type {ArrayLike<number>[]} */ lines) {
    const path = new Path2D();
    for (const line of lines) this.#add(path, line);
    return path;
  }

  /** Add a polyline to a path, relative to the middle of the map: canvases count in floats of four bytes. */
  #add(/** @type {Path2D} */ path, /** @type {ArrayLike<number>} */ points, isClosed = false) {
    const [x, y] = this.origin;
    path.moveTo(points[0] - x, points[1] - y);
    for (let i = 2; i < points.length; i += 2) path.lineTo(points[i] - x, points[i + 1] - y);
    if (isClosed) path.closePath();
  }
}
