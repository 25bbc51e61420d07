// Fields of view: the nodes that a sensor covers which reports agents alone, and the outline of what it covers.
import { headingOf, placeOf } from "./motion.js";
import { Squares } from "./squares.js";
import { World } from "./world.js";

const ROUND = 6.28; // radians: all around
const SECTORS = 256; // of directions, by which walls are found
const RAYS = 360; // of an outline past walls
const MOST_KNOWN = 20000; // fields that are remembered
const SLACK = 1e-9;

/** @typedef {import("./state.js").Agent} Agent @typedef {{type: string, keywords: Map<string, any>}} Sensor */
/** @typedef {{x: number, y: number, far: number, ahead: number | null, fov: number, height: number | null}} Field `ahead` null: all around; `height` of the sight lines, null: through walls */

/**
 * Return what a sensor covers of the ground; null where it has no end, and of cones in the air.
 * @param {World} world @param {Agent} agent @param {Sensor} sensor @returns {Field | null}
 */
export function fieldOf(world, agent, { type, keywords }) {
  const range = keywords.get("sensor_range"), at = keywords.get("at") ?? null, fov = keywords.get("fov") ?? 2 * Math.PI;
  if (!(range > 0) || !Number.isFinite(range)) return null;
  const [x, y] = at === null ? placeOf(world, agent) : placeAt(world, at);
  if (!Number.isFinite(x)) return null;
  if (type.includes("AERIAL")) {
    const height = at === null ? agent.position[2] : at[2];
    const isSphere = type === "AERIAL_AGENT" && fov >= ROUND && Math.abs(height) < range;
    return isSphere ? { x, y, far: Math.sqrt(range * range - height * height), ahead: null, fov, height: null } : null;
  }
  const [cos, sin] = keywords.get("orientation") ?? [1, 0], [ownCos, ownSin] = at === null ? headingOf(world, agent) : [1, 0];
  const isRound = fov >= ROUND || (ownCos === 0 && ownSin === 0);
  const ahead = isRound ? null : Math.atan2(cos * ownSin + sin * ownCos, cos * ownCos - sin * ownSin);
  return { x, y, far: range, ahead, fov, height: type.startsWith("OCCLUDED") ? keywords.get("observer_height") ?? 1.6 : null };
}

/** @param {World} world @param {any} at the id of a node, or x and y @returns {[number, number]} */
function placeAt(world, at) {
  const row = typeof at === "number" ? world.rowOf.get(at) : undefined;
  if (row !== undefined) return [world.xy[2 * row], world.xy[2 * row + 1]];
  return typeof at === "number" ? [NaN, NaN] : [at[0], at[1]];
}

/** The fields of view on a map. */
export class Fields {
  /** @param {World} world */
  constructor(world) {
    this.world = world;
    this.squares = new Squares(world);
    /** @type {Map<string, number[]>} */ this.known = new Map();
  }

  /** Return the rows of the nodes in a field. @param {Field} field @returns {number[]} */
  nodesIn(field) {
    const key = Object.values(field).join(" ");
    const known = this.known.get(key);
    if (known !== undefined) return known;
    const { x, y, far } = field;
    const { xy } = this.world;
    const walls = this.#walls(field);
    const found = this.squares.within(x, y, far).filter((row) => {
      const [dx, dy] = [xy[2 * row] - x, xy[2 * row + 1] - y];
      return (dx === 0 && dy === 0) || (isAhead(field, dx, dy) && reach(walls, dx, dy) >= 1 - SLACK);
    });
    if (this.known.size >= MOST_KNOWN) this.known.clear();
    this.known.set(key, found);
    return found;
  }

  /** Return the corners of a field past walls. @param {Field} field @returns {number[]} x, y, x, y, … */
  outline(field) {
    const { x, y, far, ahead, fov } = field;
    const walls = this.#walls(field);
    const [first, width] = ahead === null ? [0, 2 * Math.PI] : [ahead - fov / 2, fov];
    const corners = ahead === null ? [] : [x, y];
    for (let i = 0; i <= RAYS; i++) {
      const angle = first + (width * i) / RAYS, dx = far * Math.cos(angle), dy = far * Math.sin(angle);
      const share = Math.min(reach(walls, dx, dy), 1);
      corners.push(x + share * dx, y + share * dy);
    }
    return corners;
  }

  /** Return the walls in a field that are as high as its sight lines, by directions; null: they hide nothing. @param {Field} field @returns {number[][] | null} */
  #walls({ x, y, far, height }) {
    const { walls } = this.world;
    if (height === null || walls.length === 0) return null;
    /** @type {number[][]} */
    const found = Array.from({ length: SECTORS }, () => []);
    for (let i = 0; i < walls.length; i += 6) {
      if (walls[i + 4] > height || walls[i + 5] < height) continue;
      const [ax, ay, bx, by] = [walls[i] - x, walls[i + 1] - y, walls[i + 2] - x, walls[i + 3] - y];
      if (Math.min(ax, bx) > far || Math.max(ax, bx) < -far || Math.min(ay, by) > far || Math.max(ay, by) < -far) continue;
      const begin = Math.atan2(ay, ax), turn = Math.atan2(ax * by - ay * bx, ax * bx + ay * by);
      const first = Math.floor(sectorOf(Math.min(begin, begin + turn))), last = Math.floor(sectorOf(Math.max(begin, begin + turn)));
      for (let sector = first; sector <= last; sector++) found[((sector % SECTORS) + SECTORS) % SECTORS].push(ax, ay, bx, by);
    }
    return found;
  }
}

/** @param {number} angle */
function sectorOf(angle) {
  return ((angle + Math.PI) / (2 * Math.PI)) * SECTORS;
}

/** @param {Field} field @param {number} dx @param {number} dy */
function isAhead({ ahead, fov }, dx, dy) {
  if (ahead === null) return true;
  const off = Math.abs(Math.atan2(dy, dx) - ahead) % (2 * Math.PI);
  return Math.min(off, 2 * Math.PI - off) <= fov / 2 + SLACK;
}

/** Return the share of a way (dx, dy) after which the first wall stands in it; Infinity: none does. @param {number[][] | null} walls @param {number} dx @param {number} dy */
function reach(walls, dx, dy) {
  if (walls === null) return Infinity;
  const near = walls[((Math.floor(sectorOf(Math.atan2(dy, dx))) % SECTORS) + SECTORS) % SECTORS];
  let least = Infinity;
  for (let i = 0; i < near.length; i += 4) {
    const [ex, ey] = [near[i + 2] - near[i], near[i + 3] - near[i + 1]];
    const cross = dx * ey - dy * ex;
    if (cross === 0) continue;
    const share = (near[i] * ey - near[i + 1] * ex) / cross, along = (near[i] * dy - near[i + 1] * dx) / cross;
    if (share > SLACK && along >= -SLACK && along <= 1 + SLACK && share < least) least = share;
  }
  return least;
}
