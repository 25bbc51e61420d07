// Mouse, wheel, touch and keys.

const WRITTEN = new Set(["text", "number", "search"]); // kinds of fields in which one types
const CLICK_PX = 6; // a pointer that moves less is a click
const PAN_PX = 60, ZOOM = 1.25;
const PINCH_PX = 25; // of one event of a pinch, which comes as a wheel with ctrl: a notch of a wheel is not more
/** Whether this page stands in a frame of another one, which the wheel scrolls unless a modifier key is held. */
export const IS_FRAMED = window.parent !== window;

/** The keys of pages, which Python has put into the page: key -> action, and what it does -> keys. @type {{actions: Record<string, string>, help: Record<string, string>}} */
export const KEY_TABLE = JSON.parse(document.getElementById("key-table")?.textContent ?? '{"actions": {}, "help": {}}');

/** @typedef {import("./app.js").App} App @typedef {import("./app.js").View} View */

/**
 * @typedef {object} Target what pointers on a canvas act on
 * @property {boolean} isFollowing whether the camera follows an agent
 * @property {(move: (camera: import("./camera.js").Camera) => void) => void} moveCamera
 * @property {() => void} press a pointer goes down
 * @property {(view: any, px: number, py: number, far: number) => void} click near a pixel, at most so far from it
 * @property {(px: number, py: number) => void} doubleClick
 * @property {(view: any, px: number | null, py: number) => void} point to a pixel; null: to none
 */

/** Let a person move, point, click and type. @param {App} app */
export function listen(app) {
  for (const view of app.views) new Pointers(app, view);
  document.addEventListener("keydown", (event) => onKey(app, event));
  releaseControls();
}

/** Give the keys back to the page when a pointer has used a control; a control that the tab key reached keeps them. */
export function releaseControls() {
  let isPointed = false;
  document.addEventListener("pointerdown", () => { isPointed = true; }, true);
  document.addEventListener("keydown", () => { isPointed = false; }, true);
  for (const kind of ["click", "change"])
    document.addEventListener(kind, ({ target }) => {
      const control = /** @type {HTMLElement} */ (target).closest("button, input, select, summary");
      const isOpening = kind === "click" && control?.tagName === "SELECT";
      if (isPointed && !isOpening && control instanceof HTMLElement && !isWritten(control)) control.blur();
    });
}

/** Return whether one types into a control. @param {HTMLElement} control */
function isWritten(control) {
  return control.tagName === "TEXTAREA" || (control instanceof HTMLInputElement && WRITTEN.has(control.type));
}

/** The pointers that are down on a view: one moves the map, two zoom it. */
export class Pointers {
  /** @param {Target} app @param {{canvas: HTMLCanvasElement}} view */
  constructor(app, view) {
    this.app = app;
    this.view = view;
    /** @type {Map<number, {x: number, y: number}>} */ this.down = new Map();
    this.travelled = 0;
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (event) => this.#onDown(event));
    canvas.addEventListener("pointermove", (event) => this.#onMove(event));
    for (const kind of /** @type {const} */ (["pointerup", "pointercancel"])) canvas.addEventListener(kind, (event) => this.#onUp(event));
    canvas.addEventListener("pointerleave", () => this.#point(null));
    canvas.addEventListener("dblclick", (event) => app.doubleClick(event.offsetX, event.offsetY));
    canvas.addEventListener("wheel", (event) => this.#onWheel(event), { passive: false });
  }

  /** @param {PointerEvent} event */
  #onDown(event) {
    this.view.canvas.setPointerCapture(event.pointerId);
    this.view.canvas.focus({ preventScroll: true });
    this.app.press();
    if (this.down.size === 0) this.travelled = 0;
    this.down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
  }

  /** @param {PointerEvent} event */
  #onMove(event) {
    const was = this.down.get(event.pointerId);
    if (was === undefined) {
      this.#point(event);
      return;
    }
    const [dx, dy] = [event.offsetX - was.x, event.offsetY - was.y];
    const others = [...this.down].filter(([id]) => id !== event.pointerId).map((pair) => pair[1]);
    this.down.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    this.travelled += Math.abs(dx) + Math.abs(dy);
    if (this.travelled < CLICK_PX) return;
    this.app.isFollowing = false;
    if (others.length === 0) {
      this.app.moveCamera((camera) => camera.pan(dx, dy));
      return;
    }
    const [other] = others;
    const before = Math.hypot(was.x - other.x, was.y - other.y), after = Math.hypot(event.offsetX - other.x, event.offsetY - other.y);
    this.app.moveCamera((camera) => {
      camera.pan(dx / 2, dy / 2);
      if (before > 0) camera.zoom(after / before, (event.offsetX + other.x) / 2, (event.offsetY + other.y) / 2);
    });
  }

  /** @param {PointerEvent} event */
  #onUp(event) {
    const isClick = this.down.size === 1 && this.travelled < CLICK_PX && event.type === "pointerup";
    this.down.delete(event.pointerId);
    if (!isClick) return;
    this.app.click(this.view, event.offsetX, event.offsetY, event.pointerType === "touch" ? 22 : 12);
  }

  /** @param {WheelEvent} event */
  #onWheel(event) {
    if (IS_FRAMED && !event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 20 : 1);
    const [most, rate] = event.ctrlKey ? [PINCH_PX, 0.01] : [300, 0.002];
    const factor = Math.exp(-Math.min(Math.max(pixels, -most), most) * rate);
    this.app.moveCamera((camera) => (this.app.isFollowing ? camera.zoom(factor) : camera.zoom(factor, event.offsetX, event.offsetY)));
  }

  /** Show what is pointed at. @param {PointerEvent | null} event */
  #point(event) {
    const isNone = event === null || event.pointerType === "touch";
    this.app.point(this.view, isNone ? null : event.offsetX, isNone ? 0 : event.offsetY);
  }
}

/** @param {App} app @param {KeyboardEvent} event */
function onKey(app, event) {
  const target = /** @type {HTMLElement} */ (event.target);
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (actionOf(event) === "select none") act(app, event); // in a field, too
  else if (isTaken(target, event.key)) return;
  else if (app.player?.key(event)) event.stopPropagation();
  else if (!act(app, event)) return;
  event.preventDefault();
}

/** Return whether the control that has the focus takes a key itself. @param {HTMLElement} control @param {string} key */
function isTaken(control, key) {
  if (isWritten(control) || control.tagName === "SELECT") return true;
  if (control instanceof HTMLInputElement) return key.length > 1 || (key === " " && control.type !== "range"); // arrows move the timeline
  return ["BUTTON", "SUMMARY"].includes(control.tagName) && (key === " " || key === "Enter");
}

/** @param {App} app */
function escape(app) {
  if (!app.settings.close()) app.select(null);
}

/** Return the action of a key, or "". @param {KeyboardEvent} event */
function actionOf(event) {
  const key = event.key.toLowerCase();
  return Object.hasOwn(KEY_TABLE.actions, key) ? KEY_TABLE.actions[key] : "";
}

/** Do what a key means; return whether it means anything. @param {App} app @param {KeyboardEvent} event */
function act(app, event) {
  const pan = (/** @type {number} */ dx, /** @type {number} */ dy) => {
    app.isFollowing = false;
    app.moveCamera((camera) => camera.pan(dx * PAN_PX, dy * PAN_PX));
  };
  const zoom = (/** @type {number} */ factor) => app.moveCamera((camera) => camera.zoom(factor));
  /** @type {Record<string, () => void>} */
  const actions = {
    play: () => (app.isPlaying ? app.pause() : app.play()),
    back: () => app.step(event.shiftKey ? -10 : -1), on: () => app.step(event.shiftKey ? 10 : 1),
    start: () => app.step(-app.turns), end: () => app.step(app.turns),
    slower: () => app.controls.changeSpeed(-1), faster: () => app.controls.changeSpeed(1),
    "move up": () => pan(0, 1), "move down": () => pan(0, -1), "move left": () => pan(1, 0), "move right": () => pan(-1, 0),
    "zoom in": () => zoom(ZOOM), "zoom out": () => zoom(1 / ZOOM),
    "see everything": () => app.settings.fit(), follow: () => app.select(app.look.selected, !app.isFollowing),
    names: () => app.settings.toggleLabels(), trails: () => app.settings.toggleTrails(), theme: () => app.settings.toggleTheme(), panel: () => app.panel.toggle(), help: () => app.settings.toggleKeys(),
    "select none": () => escape(app),
  };
  const action = actions[actionOf(event)];
  action?.();
  return action !== undefined;
}
