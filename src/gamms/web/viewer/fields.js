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
const BLUR = 1e-6; // radians, and a share of the range: walls are looked for so much beside a direction
const LEAST = 1e-9, GRAIN = 1e-11, ROUNDING = 2 ** -48, MOST_SLACK = 1e-5; // of crossings, as in kernels/occlusion.py
const TURNS = 96, SHARES = [0, 0.25, 0.5, 0.75, 1]; // of the rays by which the shadow of a cone is found
const AHEAD = [1, 0, 0, 0];

/** @typedef {import("./state.js").Agent} Agent @typedef {{type: string, keywords: Map<string, any>}} Sensor */
/** @typedef {{x: number, y: number, far: number, ahead: number | null, fov: number, lines: Lines | null, eye: Eye | null}} Field `ahead` null: all around; `lines` null: through walls; `eye` null: on the ground */
/** @typedef {{z: number, above: number, tunnel: number}} Lines of sight: how high they begin, how far above the ground they end, and in which tunnel */
/** @typedef {{wall: number, least: number}} Near a wall: where its corners begin, and how near it is at least, from above */
/** @typedef {{z: number, axis: number[] | null}} Eye in the air; `axis` is where it looks, null: all around */

/**
 * Return what a sensor covers of the ground; null where it has no end.
 * @param {World} world @param {Agent} agent @param {Sensor} sensor @returns {Field | null}
 */
export function fieldOf(world, agent, { type, keywords }) {
  const range = keywords.get("sensor_range"), at = keywords.get("at") ?? null, fov = keywords.get("fov") ?? 2 * Math.PI;
  if (!(range > 0) || !Number.isFinite(range)) return null;
  const isPast = type.startsWith("OCCLUDED");
  if (type.includes("AERIAL")) {
    const [x, y] = at === null ? placeOf(world, agent) : at, z = at === null ? agent.position[2] : at[2];
    const quat = at === null ? product(agent.quat, keywords.get("quat") ?? AHEAD) : keywords.get("quat") ?? AHEAD;
    if (!Number.isFinite(x) || !Number.isFinite(z)) return null;
    const eye = { z, axis: fov >= 2 * Math.PI ? null : directionOf(quat) };
    return { x, y, far: range, ahead: null, fov, lines: isPast ? { z, above: 0, tunnel: 0 } : null, eye };
  }
  const node = typeof at === "number" ? at : at === null && (agent.flies || !(agent.share > 0)) ? agent.node : null; // it looks from
  const [x, y] = node !== null ? placeAt(world, node) : at ?? placeOf(world, agent);
  if (!Number.isFinite(x)) return null;
  const [cos, sin] = keywords.get("orientation") ?? [1, 0], [ownCos, ownSin] = at === null ? headingOf(world, agent) : [1, 0];
  const isRound = fov >= ROUND || (ownCos === 0 && ownSin === 0);
  const ahead = isRound ? null : Math.atan2(cos * ownSin + sin * ownCos, cos * ownCos - sin * ownSin);
  if (!isPast) return { x, y, far: range, ahead, fov, lines: null, eye: null };
  const row = (node === null ? undefined : world.rowOf.get(node)) ?? world.nearest(x, y), above = keywords.get("observer_height") ?? 1.6;
  const own = node === null && at === null ? world.rowOf.get(agent.node) ?? row : row; // on an edge: the node that it passed last
  const tunnel = node === null && at !== null ? 0 : world.tunnels[own];
  return { x, y, far: range, ahead, fov, lines: { z: world.heights[row] + above, above, tunnel }, eye: null };
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

/** @param {World} world @param {number} id @returns {[number, number]} */
function placeAt(world, id) {
  const row = world.rowOf.get(id);
  return row === undefined ? [NaN, NaN] : [world.xy[2 * row], world.xy[2 * row + 1]];
}

/** The fields of view on a map. */
export class Fields {
  /** @param {World} world */
  constructor(world) {
    this.world = world;
    this.squares = new Squares(world);
    this.hills = world.heights.reduce(([low, high], z) => [Math.min(low, z), Math.max(high, z)], [Infinity, -Infinity]);
    /** @type {Map<string, number[]>} */ this.known = new Map();
  }

  /** Return the rows of the nodes in a field. @param {Field} field @returns {number[]} */
  nodesIn(field) {
    const key = JSON.stringify(field);
    const known = this.known.get(key);
    if (known !== undefined) return known;
    const { x, y, far, lines, eye } = field;
    const { xy, heights, tunnels } = this.world;
    const walls = this.#walls(field);
    const found = this.squares.within(x, y, far).filter((row) => {
      const [dx, dy] = [xy[2 * row] - x, xy[2 * row + 1] - y];
      if (eye !== null ? !isInCone(field, eye.axis, [dx, dy, heights[row] - eye.z]) : (dx !== 0 || dy !== 0) && !isAhead(field, dx, dy)) return false;
      if (lines === null) return true;
      return tunnels[row] === lines.tunnel && this.#reach(field, walls, xy[2 * row], xy[2 * row + 1], heights[row] + lines.above) === Infinity;
    });
    if (this.known.size >= MOST_KNOWN) this.known.clear();
    this.known.set(key, found);
    return found;
  }

  /** Return the corners of a field past walls, or of the shadow of a cone in the air. @param {Field} field @returns {number[]} x, y, x, y, … */
  outline(field) {
    const { x, y, far, ahead, fov, lines, eye } = field;
    if (eye !== null) return shadowOf(field, eye);
    const walls = this.#walls(field);
    const [first, width] = ahead === null ? [0, 2 * Math.PI] : [ahead - fov / 2, fov];
    const corners = ahead === null ? [] : [x, y];
    for (let i = 0; i <= RAYS; i++) {
      const angle = first + (width * i) / RAYS, dx = far * Math.cos(angle), dy = far * Math.sin(angle);
      const share = Math.min(this.#reach(field, walls, x + dx, y + dy, lines?.z ?? 0), 1);
      corners.push(x + share * dx, y + share * dy);
    }
    return corners;
  }

  /** Return the walls in a field by directions, the nearest first. @param {Field} field @returns {Near[][]} */
  #walls({ x, y, far, lines }) {
    /** @type {Near[][]} */
    const found = Array.from({ length: SECTORS }, () => []);
    if (lines === null) return found;
    const { walls, wallBoxes: boxes } = this.world, [lowest, highest] = this.hills;
    const low = Math.min(lines.z, lowest + lines.above), high = Math.max(lines.z, highest + lines.above), near = [];
    for (let i = 0, box = 0; i < walls.length; i += 12, box += 6) {
      if (boxes[box + 4] > high || boxes[box + 5] < low) continue;
      const least = Math.hypot(Math.max(boxes[box] - x, x - boxes[box + 1], 0), Math.max(boxes[box + 2] - y, y - boxes[box + 3], 0));
      if (least <= far) near.push({ wall: i, least });
    }
    for (const one of near.sort((a, b) => a.least - b.least)) {
      const ways = [0, 3, 6, 9].map((at) => [walls[one.wall + at] - x, walls[one.wall + at + 1] - y]), [dx, dy] = ways[0];
      const turns = ways.map(([ex, ey]) => Math.atan2(dx * ey - dy * ex, dx * ex + dy * ey)), begin = Math.atan2(dy, dx);
      const isAround = Math.max(...turns) - Math.min(...turns) > Math.PI - BLUR || ways.some(([ex, ey]) => Math.hypot(ex, ey) < BLUR * far);
      const first = isAround ? 0 : Math.floor(sectorOf(begin + Math.min(...turns) - BLUR));
      const last = isAround ? SECTORS - 1 : Math.floor(sectorOf(begin + Math.max(...turns) + BLUR));
      for (let sector = first; sector <= last; sector++) found[((sector % SECTORS) + SECTORS) % SECTORS].push(one);
    }
    return found;
  }

  /** Return the share of a sight line after which the first wall stands in it; Infinity: none does. @param {Field} field @param {Near[][]} walls @param {number} x where it ends @param {number} y @param {number} z */
  #reach({ x: x0, y: y0, far, lines }, walls, x, y, z) {
    let least = Infinity;
    if (lines === null) return least;
    const origin = [x0, y0, lines.z], line = [x - x0, y - y0, z - lines.z], length = Math.hypot(line[0], line[1]);
    for (const near of walls[((Math.floor(sectorOf(Math.atan2(line[1], line[0]))) % SECTORS) + SECTORS) % SECTORS]) {
      if (near.least > Math.min(least, 1) * length + BLUR * far) break;
      least = Math.min(least, crossing(this.world.walls, near.wall, origin, line));
    }
    return least;
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
 * Return the share of a line at which a wall blocks it, Infinity: it does not. As `kernels/occlusion.py`, operation by operation.
 * @param {Float64Array} corners @param {number} wall where its corners begin @param {number[]} origin @param {number[]} line
 */
function crossing(corners, wall, origin, line) {
  const [right, left, lowRight, lowLeft] = [wall, wall + 3, wall + 6, wall + 9].map((at) => [corners[at], corners[at + 1], corners[at + 2]]);
  const toObserver = minus(origin, left), middle = minus(lowRight, left), length = extent(line);
  const size = extent(left.map((one, axis) => Math.max(one, right[axis], lowRight[axis], lowLeft[axis]) - Math.min(one, right[axis], lowRight[axis], lowLeft[axis])));
  let least = Infinity;
  for (const [first, second] of [[minus(right, left), middle], [middle, minus(lowLeft, left)]]) {
    const across = cross(line, second), turned = cross(toObserver, first), signed = dot(first, across);
    const det = Math.abs(signed), sign = signed < 0 ? -1 : 1;
    const u = sign * dot(toObserver, across), v = sign * dot(line, turned), t = sign * dot(second, turned);
    if (!(det >= Math.max(GRAIN * length * size * size, LEAST) && det < Infinity)) continue; // it runs along the triangle
    const missedBy = Math.max(u + v - det, t - det, -u, -v, -t);
    if (!(missedBy <= MOST_SLACK * det)) continue;
    if (missedBy > 0) {
      const far = 2 * extent(origin) + extent(toObserver) + size;
      const doubt = Math.min(ROUNDING * far * size, (MOST_SLACK * det) / (length + size));
      if (Math.max(u + v - det, -u, -v) > doubt * length || Math.max(t - det, -t) > doubt * size) continue;
    }
    least = Math.min(least, Math.max(t / det, 0));
  }
  return least;
}

/** @param {number[]} a @param {number[]} b */
function minus(a, b) {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

/** @param {number[]} a @param {number[]} b */
function dot(a, b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/** @param {number[]} vector */
function extent(vector) {
  return Math.abs(vector[0]) + Math.abs(vector[1]) + Math.abs(vector[2]);
}
