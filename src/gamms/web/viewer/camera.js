// Where the view looks: world units, y up, to pixels, y down.

const CLOSEST = 40; // how far beyond the scale at which all is seen one can zoom, in typical edges across the view
const MARGIN = 0.05;
const LEAST_SHARE = 0.75; // of its scale that the map keeps, or captions may cover it

/** @typedef {{left: number, right: number, top: number, bottom: number}} Covered pixels; cards at the upper edge have top 0, those at the lower one the height as bottom */

export class Camera {
  /** @param {{left: number, bottom: number, right: number, top: number}} box what is seen at first @param {number} unit */
  constructor(box, unit) {
    this.box = box;
    this.unit = unit;
    this.width = this.height = 1; // CSS pixels
    this.x = (box.left + box.right) / 2;
    this.y = (box.bottom + box.top) / 2;
    this.scale = 1; // pixels per world unit
    this.isFitted = true;
    this.insets = { left: 0, top: 0, right: 0, bottom: 0 };
    this.belowPx = 0; // for marks below the map
    /** @type {Covered[]} */ this.covered = []; // by cards in the corners
  }

  /** @param {number} width @param {number} height CSS pixels */
  resize(width, height) {
    this.width = Math.max(width, 1);
    this.height = Math.max(height, 1);
    if (this.isFitted) this.fit();
  }

  /** Show the whole map as large as it can be, clear of what covers the edges and the corners of the view; of captions if it stays large. */
  fit() {
    const upper = this.#clearOf(this.covered.filter((one) => one.top <= 0)), clear = this.#clearOf(this.covered);
    this.#fitInto(clear.scale < LEAST_SHARE * upper.scale ? upper : clear);
    this.isFitted = true;
  }

  /** Return the insets that keep the map clear of cards, and its scale. @param {Covered[]} covered */
  #clearOf(covered) {
    const { insets } = this, isLeft = (/** @type {Covered} */ one) => one.left + one.right < this.width;
    const lefts = [insets.left, ...covered.filter(isLeft).map((one) => one.right)];
    const rights = [insets.right, ...covered.filter((one) => !isLeft(one)).map((one) => this.width - one.left)];
    const tops = [insets.top, ...covered.filter((one) => one.top <= 0).map((one) => one.bottom)];
    const bottoms = [insets.bottom, ...covered.filter((one) => one.top > 0).map((one) => this.height - one.top)];
    let best = { ...insets, scale: 0 };
    for (const left of lefts) for (const right of rights) for (const top of tops) for (const bottom of bottoms) {
      this.#fitInto({ left, right, top, bottom });
      if (this.scale > best.scale && covered.every((one) => this.#isClearOf(one))) best = { left, right, top, bottom, scale: this.scale };
    }
    return best;
  }

  /** @param {Covered} one */
  #isClearOf(one) {
    const [left, top] = this.toScreen(this.box.left, this.box.top), [right, bottom] = this.toScreen(this.box.right, this.box.bottom);
    return right < one.left || left > one.right || top > one.bottom || bottom + this.belowPx < one.top;
  }

  /** @param {{left: number, top: number, right: number, bottom: number}} insets */
  #fitInto(insets) {
    const { left, bottom, right, top } = this.box;
    const low = insets.bottom + this.belowPx;
    const free = { width: Math.max(this.width - insets.left - insets.right, 50), height: Math.max(this.height - insets.top - low, 50) };
    this.scale = (1 - 2 * MARGIN) * Math.min(free.width / Math.max(right - left, this.unit), free.height / Math.max(top - bottom, this.unit));
    this.x = (left + right) / 2 - (insets.left - insets.right) / 2 / this.scale;
    this.y = (bottom + top) / 2 + (insets.top - low) / 2 / this.scale;
  }

  /** Move by pixels. @param {number} dx @param {number} dy */
  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    this.isFitted = false;
    this.#keepNear();
  }

  /** Zoom around a pixel. @param {number} factor @param {number} px @param {number} py */
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    const extent = Math.max(this.box.right - this.box.left, this.box.top - this.box.bottom, this.unit);
    const least = (0.3 * Math.min(this.width, this.height)) / extent, most = (CLOSEST * Math.min(this.width, this.height)) / (40 * this.unit);
    this.scale = Math.min(Math.max(this.scale * factor, least), Math.max(most, least));
    this.x = x - (px - this.width / 2) / this.scale;
    this.y = y + (py - this.height / 2) / this.scale;
    this.isFitted = false;
    this.#keepNear();
  }

  /** Look at a place. @param {number} x @param {number} y */
  lookAt(x, y) {
    this.x = x;
    this.y = y;
    this.isFitted = false;
  }

  #keepNear() {
    const { left, bottom, right, top } = this.box;
    this.x = Math.min(Math.max(this.x, left), right);
    this.y = Math.min(Math.max(this.y, bottom), top);
  }

  /** @param {number} x @param {number} y @returns {[number, number]} */
  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  /** @param {number} px @param {number} py @returns {[number, number]} */
  toWorld(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }
}
