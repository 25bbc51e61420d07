// Which nodes are near a place.
import { World } from "./world.js";

/** Nodes by squares, to find those near a place. */
export class Squares {
  /** @param {World} world */
  constructor(world) {
    this.world = world;
    this.side = 4 * world.unit;
    /** @type {Map<string, number[]>} */ this.squares = new Map();
    for (let row = 0; row < world.nodeIds.length; row++) {
      const key = this.#key(world.xy[2 * row], world.xy[2 * row + 1]);
      const known = this.squares.get(key);
      if (known === undefined) this.squares.set(key, [row]);
      else known.push(row);
    }
  }

  #key(/** @type {number} */ x, /** @type {number} */ y) {
    return `${Math.floor(x / this.side)} ${Math.floor(y / this.side)}`;
  }

  /** Return the rows of the nodes within a distance. @param {number} x @param {number} y @param {number} far @returns {number[]} */
  within(x, y, far) {
    const { xy } = this.world;
    const isNear = (/** @type {number} */ row) => Math.hypot(xy[2 * row] - x, xy[2 * row + 1] - y) <= far;
    if (far / this.side > 50) return Array.from(this.world.nodeIds.keys()).filter(isNear);
    const found = [];
    for (let i = Math.floor((x - far) / this.side); i <= Math.floor((x + far) / this.side); i++) {
      for (let j = Math.floor((y - far) / this.side); j <= Math.floor((y + far) / this.side); j++) {
        found.push(...(this.squares.get(`${i} ${j}`) ?? []).filter(isNear));
      }
    }
    return found;
  }
}
