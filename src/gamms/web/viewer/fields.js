// Fields of view: the nodes that a sensor covers which reports agents alone, and the outline of what it covers.
import { headingOf, placeOf } from "./motion.js";
import { Squares } from "./squares.js";
import { World } from "./world.js";

const ROUND = 6.28; // radians: all around
const SECTORS = 256; // of directions, by which walls are found
const RAYS = 360; // of an outline past walls
const MOST_KNOWN = 20000; // fields that are remembered
const SLACK = 1e-9;
const RIM = 1e-12; // radians: what lies on the rim of a cone is inside
const TURNS = 96, SHARES = [0, 0.25, 0.5, 0.75, 1]; // of the rays by which the shadow of a cone is found
const AHEAD = [1, 0, 0, 0];

/** @typedef {import("./state.js").Agent} Agent @typedef {{type: string, keywords: Map<string, any>}} Sensor */
/** @typedef {{x: number, y: number, far: number, ahead: number | null, fov: number, height: number | null, eye: Eye | null}} Field `ahead` null: all around; `height` of the sight lines, null: through walls; `eye` null: on the ground */
/** @typedef {{z: number, axis: number[] | null}} Eye in the air; `axis` is where it looks, null: all around */

/**
 * Return what a sensor covers of the ground; null where it has no end.
 * @param {World} world @param {Agent} agent @param {Sensor} sensor @returns {Field | null}
 */
export function fieldOf(world, agent, { type, keywords }) {
  const range = keywords.get("sensor_range"), at = keywords.get("at") ?? null, fov = keywords.get("fov") ?? 2 * Math.PI;
  if (!(range > 0) || !Number.isFinite(range)) return null;
  const [x, y] = at === null ? placeOf(world, agent) : placeAt(world, at);
  if (!Number.isFinite(x)) return null;
  if (type.includes("AERIAL")) {
    const z = at === null ? agent.position[2] : at[2];
    const quat = at === null ? product(agent.quat, keywords.get("quat") ?? AHEAD) : keywords.get("quat") ?? AHEAD;
    const eye = { z, axis: fov >= 2 * Math.PI ? null : directionOf(quat) };
    return Number.isFinite(z) ? { x, y, far: range, ahead: null, fov, height: type.startsWith("OCCLUDED") ? z : null, eye } : null;
  }
  const [cos, sin] = keywords.get("orientation") ?? [1, 0], [ownCos, ownSin] = at === null ? headingOf(world, agent) : [1, 0];
  const isRound = fov >= ROUND || (ownCos === 0 && ownSin === 0);
  const ahead = isRound ? null : Math.atan2(cos * ownSin + sin * ownCos, cos * ownCos - sin * ownSin);
  return { x, y, far: range, ahead, fov, height: type.startsWith("OCCLUDED") ? keywords.get("observer_height") ?? 1.6 : null, eye: null };
}

/** Return Hamilton's product of two quaternions. @param {ArrayLike<number>} a @param {ArrayLike<number>} b */
function product(a, b) {
  const [w, x, y, z] = Array.from(a), [u, p, q, r] = Array.from(b);
  return [w * u - x * p - y * q - z * r, w * p + x * u + y * r - z * q, w * q - x * r + y * u + z * p, w * r + x * q - y * p + z * u];
}

/** Return where the x axis points after a rotation. @param {ArrayLike<number>} quat */
function directionOf(quat) {
  const [w, x, y, z] = Array.from(quat);
  return [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)];
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
    const key = JSON.stringify(field);
    const known = this.known.get(key);
    if (known !== undefined) return known;
    const { x, y, far, eye } = field;
    const { xy } = this.world;
    const walls = this.#walls(field);
    const found = this.squares.within(x, y, far).filter((row) => {
      const [dx, dy] = [xy[2 * row] - x, xy[2 * row + 1] - y];
      if (eye === null) return (dx === 0 && dy === 0) || (isAhead(field, dx, dy) && reach(walls, dx, dy, 0) >= 1 - SLACK);
      const dz = this.world.heightOf(row) - eye.z;
      if (!isInCone(field, eye.axis, [dx, dy, dz])) return false;
      return walls === null || (!this.world.isUnderground(row) && reach(walls, dx, dy, dz) >= 1 - SLACK);
    });
    if (this.known.size >= MOST_KNOWN) this.known.clear();
    this.known.set(key, found);
    return found;
  }

  /** Return the corners of a field past walls, or of the shadow of a cone in the air. @param {Field} field @returns {number[]} x, y, x, y, … */
  outline(field) {
    const { x, y, far, ahead, fov, eye } = field;
    if (eye !== null) return shadowOf(field, eye);
    const walls = this.#walls(field);
    const [first, width] = ahead === null ? [0, 2 * Math.PI] : [ahead - fov / 2, fov];
    const corners = ahead === null ? [] : [x, y];
    for (let i = 0; i <= RAYS; i++) {
      const angle = first + (width * i) / RAYS, dx = far * Math.cos(angle), dy = far * Math.sin(angle);
      const share = Math.min(reach(walls, dx, dy, 0), 1);
      corners.push(x + share * dx, y + share * dy);
    }
    return corners;
  }

  /**
   * Return the walls in a field, by directions, with how high they begin and end above the eye; null: they hide nothing.
   * @param {Field} field @returns {number[][] | null}
   */
  #walls({ x, y, far, height, eye }) {
    const { walls } = this.world;
    if (height === null) return null;
    /** @type {number[][]} */
    const found = Array.from({ length: SECTORS }, () => []);
    for (let i = 0; i < walls.length; i += 6) {
      if (eye === null && (walls[i + 4] > height || walls[i + 5] < height)) continue;
      const [ax, ay, bx, by] = [walls[i] - x, walls[i + 1] - y, walls[i + 2] - x, walls[i + 3] - y];
      if (Math.min(ax, bx) > far || Math.max(ax, bx) < -far || Math.min(ay, by) > far || Math.max(ay, by) < -far) continue;
      const begin = Math.atan2(ay, ax), turn = Math.atan2(ax * by - ay * bx, ax * bx + ay * by);
      const first = Math.floor(sectorOf(Math.min(begin, begin + turn))), last = Math.floor(sectorOf(Math.max(begin, begin + turn)));
      for (let sector = first; sector <= last; sector++) found[((sector % SECTORS) + SECTORS) % SECTORS].push(ax, ay, bx, by, walls[i + 4] - height, walls[i + 5] - height);
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

/** @param {Field} field @param {number[] | null} axis @param {number[]} way from the eye */
function isInCone({ far, fov }, axis, [dx, dy, dz]) {
  if (dx * dx + dy * dy + dz * dz > far * far) return false;
  if (axis === null) return true;
  const [ax, ay, az] = axis;
  const across = Math.hypot(dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax);
  return Math.atan2(across, dx * ax + dy * ay + dz * az) <= fov / 2 + RIM;
}

/** Return the corners of the shadow that a cone, cut off at its range and at the ground, casts from above. @param {Field} field @param {Eye} eye */
function shadowOf({ x, y, far, fov }, { z, axis }) {
  const turns = Array.from({ length: TURNS }, (_, i) => (2 * Math.PI * i) / TURNS);
  if (axis === null || fov >= Math.PI) {
    const radius = axis === null ? Math.sqrt(Math.max(far * far - z * z, 0)) : far;
    return turns.flatMap((turn) => [x + radius * Math.cos(turn), y + radius * Math.sin(turn)]);
  }
  const least = axis.map(Math.abs).indexOf(Math.min(...axis.map(Math.abs)));
  const aside = cross(axis, [0, 1, 2].map((i) => Number(i === least)));
  const length = Math.hypot(...aside), one = aside.map((part) => part / length), other = cross(axis, one);
  const points = [[x, y]];
  for (const share of SHARES) {
    const half = (share * fov) / 2, [cos, sin] = [Math.cos(half), Math.sin(half)];
    for (const turn of turns) {
      const ray = axis.map((part, i) => cos * part + sin * (Math.cos(turn) * one[i] + Math.sin(turn) * other[i]));
      const ground = -z / ray[2], end = ground >= 0 && ground <= far ? ground : far;
      points.push([x + end * ray[0], y + end * ray[1]]);
    }
  }
  return hullOf(points).flat();
}

/** @param {number[]} a @param {number[]} b */
function cross(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** Return the corners of the convex hull of points. @param {number[][]} points */
function hullOf(points) {
  const ordered = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (/** @type {number[][]} */ some) => {
    /** @type {number[][]} */ const chain = [];
    for (const point of some) {
      while (chain.length > 1 && turnOf(chain[chain.length - 2], chain[chain.length - 1], point) <= 0) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  return [...half(ordered), ...half(ordered.reverse())];
}

/** Return a positive number where the way from a over b to c bends to the left. @param {number[]} a @param {number[]} b @param {number[]} c */
function turnOf(a, b, c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/**
 * Return the share of a way after which the first wall stands in it; Infinity: none does.
 * @param {number[][] | null} walls @param {number} dx @param {number} dy @param {number} dz
 */
function reach(walls, dx, dy, dz) {
  if (walls === null) return Infinity;
  const near = walls[((Math.floor(sectorOf(Math.atan2(dy, dx))) % SECTORS) + SECTORS) % SECTORS];
  let least = Infinity;
  for (let i = 0; i < near.length; i += 6) {
    const [ex, ey] = [near[i + 2] - near[i], near[i + 3] - near[i + 1]];
    const cross = dx * ey - dy * ex;
    if (cross === 0) continue;
    const share = (near[i] * ey - near[i + 1] * ex) / cross, along = (near[i] * dy - near[i + 1] * dx) / cross;
    if (share > SLACK && along >= -SLACK && along <= 1 + SLACK && share < least && near[i + 4] <= share * dz && share * dz <= near[i + 5]) least = share;
  }
  return least;
}
