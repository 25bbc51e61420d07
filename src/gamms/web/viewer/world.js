// The map of a game: nodes, edges with their shapes, buildings, parks and water.
import { interleaved } from "./values.js";

const MOST_POINTS = 1 << 23;
export const PATH = 0;
export const SERVICE = 1;
export const ORDINARY = 2;
export const MAIN = 3;
export const MAJOR = 4;
const CLASS_OF = new Map([
  ...["footway", "path", "steps", "cycleway", "pedestrian", "corridor", "bridleway", "track"].map((name) => [name, PATH]),
  ["service", SERVICE],
  ...["primary", "secondary", "motorway_link", "trunk_link"].map((name) => [name, MAIN]),
  ["motorway", MAJOR], ["trunk", MAJOR],
]);

/** A map, in columns; rows are numbers of nodes and edges in their lists. */
export class World {
  /** @param {Map<string, any>} state as `gamms.web.columns` gives it */
  constructor(state) {
    const placesOf = (/** @type {Map<string, any>} */ from, /** @type {string} */ name, axes = 2) => interleaved(from.get(name) ?? [], axes, state.get("step"));
    /** @type {string | null} */ this.crs = state.get("crs");
    /** @type {string | null} */ this.attribution = state.get("attribution");
    /** @type {Float64Array} */ this.nodeIds = state.get("node_ids");
    /** @type {Float64Array} */ this.xy = placesOf(state, "xy");
    /** @type {Float64Array} */ this.sources = state.get("sources");
    /** @type {Float64Array} */ this.targets = state.get("targets");
    /** @type {Map<number, number>} */ this.rowOf = new Map(Array.from(this.nodeIds, (id, row) => [id, row]));
    /** @type {Map<number, Float64Array>} */ this.bends = bendsOf(state, placesOf(state, "bend_points"), this.sources.length);
    /** @type {Float64Array | null} */ this.latLon = state.get("lat_lon") ?? null; // degrees, where a page needs them
    this.attributes = { node: state.get("node_attributes"), edge: state.get("edge_attributes") };
    const base = state.get("base_map") ?? new Map();
    const from = state.get("face_corners").length ? state : base;
    this.buildings = footprints(placesOf(from, "face_corners", 3), from.get("face_types") ?? []);
    this.shapes = shapesOf(base, placesOf(base, "points"));
    /** @type {Float64Array} */ this.ground = placesOf(base, "ground"); // x, y of its lower left and upper right corner, or none
    this.#check();
    this.isMetric = this.crs !== null && this.crs !== "EPSG:4326" && this.crs !== "OGC:CRS84";
    this.streets = this.#oneWayEach();
    this.box = this.#box();
    this.unit = this.#typicalLength();
    /** @type {Map<number, number>} */ this.edgeBetween = this.#edgesByEnds();
  }

  #check() {
    const nodes = this.nodeIds.length;
    if (this.xy.length !== 2 * nodes || this.sources.length !== this.targets.length) throw new Error("The map of this recording is damaged.");
    for (const rows of [this.sources, this.targets]) {
      for (const row of rows) if (!(row >= 0 && row < nodes)) throw new Error("The map of this recording is damaged.");
    }
  }

  /** Return the points of an edge: x, y, x, y, … @param {number} edge @returns {ArrayLike<number>} */
  pointsOf(edge) {
    const bend = this.bends.get(edge);
    if (bend !== undefined) return bend;
    const a = 2 * this.sources[edge], b = 2 * this.targets[edge];
    return [this.xy[a], this.xy[a + 1], this.xy[b], this.xy[b + 1]];
  }

  /** Return the value of an attribute of a row; undefined where it has none. @param {"node" | "edge"} of @param {string} name @param {number} row */
  attribute(of, name, row) {
    const column = this.attributes[of].get(name);
    if (column === undefined) return undefined;
    const [rows, codes, values] = column;
    let low = 0, high = rows.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (rows[middle] < row) low = middle + 1;
      else high = middle;
    }
    return rows[low] === row ? values[codes[low]] : undefined;
  }

  /** Return the edge from one node to another, as rows; undefined where there is none. @param {number} from @param {number} to */
  edge(from, to) {
    return this.edgeBetween.get(from * this.nodeIds.length + to);
  }

  /** Return the points of the way from one node to another, as rows: an edge, or straight. @param {number} from @param {number} to */
  pointsBetween(from, to) {
    const edge = this.edge(from, to);
    return edge === undefined ? [this.xy[2 * from], this.xy[2 * from + 1], this.xy[2 * to], this.xy[2 * to + 1]] : this.pointsOf(edge);
  }

  /** Return what kind of road an edge is. @param {number} edge */
  classOf(edge) {
    return CLASS_OF.get(this.attribute("edge", "highway", edge)) ?? ORDINARY;
  }

  /** Whether an edge is a tunnel. @param {number} edge */
  isTunnel(edge) {
    const tunnel = this.attribute("edge", "tunnel", edge);
    return tunnel !== undefined && tunnel !== "no" && tunnel !== false && tunnel !== null;
  }

  /** Return the edges without those that repeat an earlier one in the other direction. */
  #oneWayEach() {
    /** @type {Map<number, number[]>} */
    const known = new Map();
    const found = [];
    for (let edge = 0; edge < this.sources.length; edge++) {
      const low = Math.min(this.sources[edge], this.targets[edge]), high = Math.max(this.sources[edge], this.targets[edge]);
      const key = low * this.nodeIds.length + high, length = lengthOf(this.pointsOf(edge));
      const others = known.get(key);
      if (others === undefined) known.set(key, [length]);
      else if (others.some((one) => Math.abs(one - length) < 1e-3)) continue;
      else others.push(length);
      found.push(edge);
    }
    return found;
  }

  #box() {
    let [left, bottom, right, top] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let i = 0; i < this.xy.length; i += 2) {
      left = Math.min(left, this.xy[i]);
      right = Math.max(right, this.xy[i]);
      bottom = Math.min(bottom, this.xy[i + 1]);
      top = Math.max(top, this.xy[i + 1]);
    }
    return left <= right ? { left, bottom, right, top } : { left: 0, bottom: 0, right: 1, top: 1 };
  }

  /** The median length of edges as the crow flies. */
  #typicalLength() {
    const lengths = Float64Array.from(this.sources, (source, edge) => {
      const a = 2 * source, b = 2 * this.targets[edge];
      return Math.hypot(this.xy[b] - this.xy[a], this.xy[b + 1] - this.xy[a + 1]);
    }).sort();
    const extent = Math.max(this.box.right - this.box.left, this.box.top - this.box.bottom);
    return (lengths.length ? lengths[lengths.length >> 1] : extent) || extent || 1;
  }

  #edgesByEnds() {
    const found = new Map();
    const nodes = this.nodeIds.length;
    for (let edge = this.sources.length - 1; edge >= 0; edge--) found.set(this.sources[edge] * nodes + this.targets[edge], edge);
    return found;
  }
}

/** Return the length of a polyline. @param {ArrayLike<number>} points x, y, x, y, … */
export function lengthOf(points) {
  let length = 0;
  for (let i = 2; i < points.length; i += 2) length += Math.hypot(points[i] - points[i - 2], points[i + 1] - points[i - 1]);
  return length;
}

/** @param {Map<string, any>} state @param {Float64Array} points @param {number} edges @returns {Map<number, Float64Array>} */
function bendsOf(state, points, edges) {
  const [rows, sizes] = [state.get("bend_rows"), state.get("bend_sizes")];
  const found = new Map();
  let at = 0;
  for (let i = 0; i < rows.length; i++) {
    const size = 2 * sizes[i];
    if (!(rows[i] >= 0 && rows[i] < edges && size >= 4 && at + size <= points.length)) throw new Error("The map of this recording is damaged.");
    found.set(rows[i], points.subarray(at, at + size));
    at += size;
  }
  return found;
}

/** Return parks, water and rails: kind and points of each. @param {Map<string, any>} base @param {Float64Array} points */
function shapesOf(base, points) {
  const [kinds, sizes] = [base.get("kinds") ?? [], base.get("sizes") ?? []];
  if (points.length > MOST_POINTS) throw new Error("The map of this recording is too large to be drawn.");
  let at = 0;
  return Array.from(kinds, (kind, i) => {
    at += 2 * sizes[i];
    return { kind: /** @type {number} */ (kind), points: points.subarray(at - 2 * sizes[i], at) };
  });
}

/**
 * Return the outlines of buildings: walls whose top edges lead, one after the other, around something. A ring inside
 * the one before, with the same height, is a courtyard; walls around nothing are lines.
 * @param {Float64Array} corners 12 for each wall: x, y, z of its top right, top left, bottom right, bottom left corner
 * @param {ArrayLike<number>} types
 */
function footprints(corners, types) {
  if (corners.length > MOST_POINTS) throw new Error("The map of this recording is too large to be drawn.");
  const walls = corners.length / 12;
  /** @type {{type: number, height: number, rings: number[][]}[]} */
  const found = [];
  /** @type {number[][]} */
  const lines = [];
  const at = (/** @type {number} */ wall, /** @type {number} */ corner) => 12 * wall + 3 * corner;
  const meet = (/** @type {number} */ a, /** @type {number} */ b) => corners[a] === corners[b] && corners[a + 1] === corners[b + 1];
  for (let wall = 0; wall < walls; ) {
    const [from, to] = wall + 1 < walls && meet(at(wall, 0), at(wall + 1, 1)) ? [1, 0] : [0, 1];
    let end = wall + 1;
    while (end < walls && types[end] === types[wall] && meet(at(end - 1, to), at(end, from)) && !meet(at(end - 1, to), at(wall, from))) end++;
    const isRing = end - wall > 2 && meet(at(end - 1, to), at(wall, from));
    if (!isRing) {
      lines.push([corners[at(wall, 0)], corners[at(wall, 0) + 1], corners[at(wall, 1)], corners[at(wall, 1) + 1]]);
      wall++;
      continue;
    }
    const ring = [];
    for (let i = wall; i < end; i++) ring.push(corners[at(i, from)], corners[at(i, from) + 1]);
    const top = corners[at(wall, 0) + 2], base = corners[at(wall, 2) + 2];
    const last = found[found.length - 1];
    if (last !== undefined && last.type === types[wall] && last.height === top - base && isWithin(ring, last.rings[0])) last.rings.push(ring);
    else found.push({ type: types[wall], height: top - base, rings: [ring] });
    wall = end;
  }
  return { areas: found, lines };
}

/** Return whether the box of a ring is within that of another one. @param {number[]} ring @param {number[]} other */
function isWithin(ring, other) {
  const [a, b] = [boxOf(ring), boxOf(other)];
  return a[0] >= b[0] && a[1] >= b[1] && a[2] <= b[2] && a[3] <= b[3];
}

/** @param {number[]} ring */
function boxOf(ring) {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (let i = 0; i < ring.length; i++) {
    box[i % 2] = Math.min(box[i % 2], ring[i]);
    box[2 + (i % 2)] = Math.max(box[2 + (i % 2)], ring[i]);
  }
  return box;
}
