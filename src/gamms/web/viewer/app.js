// The viewer: one or two recordings on one timeline, and what a person does with them.
import { element, iconButton } from "./dom.js";
import { Controls } from "./controls.js";
import { IS_FRAMED, listen } from "./input.js";
import { Panel } from "./panel.js";
import { Replay } from "./replay.js";
import { Scene } from "./scene.js";
import { Settings } from "./settings.js";
import { THEMES } from "./themes.js";

const SLICE_MS = 12; // of reading on at once
const RESTS_MS = 160; // after which the map is painted sharply
const PHONE_PX = 480; // the shorter side of pages on phones
const STAMP = 0.4, SLIM = 1.4; // a map is a stamp if it fills less of the free width or height, and is that much longer than wide
const EDGE_PX = 24; // from the edge of the map that is in view to an agent that is looked at
const NARROW_PX = 1100; // as in the style sheet
const WIDE_PX = 1000; // pages that show the panel at first

/** @typedef {{title?: string, theme?: "light" | "dark", labels?: boolean | "auto", trails?: number, sensors?: boolean, turn?: number, follow?: string, audience?: string, names?: string[], parts?: number, warnings?: string[]}} Options `warnings`: what is missing in recordings */
/** @typedef {{replay: Replay, scene: Scene, canvas: HTMLCanvasElement, label: HTMLElement | null}} View */

export class App {
  /** @param {HTMLElement} root @param {Replay[]} replays @param {Options} options */
  constructor(root, replays, options) {
    this.root = root;
    this.options = options;
    /** @type {import("./scene.js").Look} */
    this.look = {
      theme: options.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"),
      fog: options.audience ?? null, trails: options.trails ?? 0, labels: options.labels ?? "auto", sensors: options.sensors ?? true, messages: true, heat: null,
      selected: null, hovered: null,
    };
    this.position = 0; // turns, with the share of the one that is under way
    this.isPlaying = false;
    this.speed = 4; // turns a second
    this.isLive = false; // whether the last turn of a game that goes on is shown, as soon as it is there
    /** @type {{speed: number} | null} */ this.live = null; // the game that goes on
    this.isFollowing = false;
    this.movedAt = -Infinity; // when the camera was moved
    /** @type {import("./player.js").Player | null} */ this.player = null; // of who plays in a live game
    this.whenRead = () => {}; // called when all turns have been read
    this.whenShown = () => {}; // called when another moment is shown, or in another way
    this.needsPaint = true;
    this.paintMs = 0; // that the last frame took
    this.stage = element("div", { class: "stage" });
    /** @type {View[]} */
    this.views = replays.map((replay, i) => this.#view(replay, i));
    this.pointedAt = this.views[0]; // where an agent is pointed at
    this.controls = new Controls(this);
    this.panel = new Panel(this);
    this.settings = new Settings(this);
    root.replaceChildren(this.stage, this.controls.head, this.settings.element, this.#corner(), this.panel.element, this.controls.bar);
    this.#dress();
    new ResizeObserver(() => this.fitStage()).observe(this.stage);
    this.fitStage();
    listen(this);
    this.seek(options.turn ?? 0);
    if (options.follow) this.select(options.follow, true);
    this.lastFrame = performance.now();
    this.#frame(this.lastFrame);
    setTimeout(() => this.readOn(), 0);
  }

  get turns() {
    return Math.max(...this.views.map((view) => view.replay.turns));
  }

  /** The first turn that can be shown. */
  get first() {
    return Math.min(...this.views.map((view) => view.replay.recording.first));
  }

  /** The turn that is shown, at its end or on the way there. */
  get turn() {
    return Math.ceil(this.position);
  }

  /** Whether the panel stands beside the map at first. */
  get isWide() {
    return this.root.clientWidth >= WIDE_PX;
  }

  /** @param {Replay} replay @param {number} number @returns {View} */
  #view(replay, number) {
    const name = this.options.names?.[number];
    const words = name ? `The map with the agents of ${name}` : "The map with the agents";
    const canvas = element("canvas", { class: "view", tabindex: "0", role: "img", "aria-label": `${words}. Keys: ? shows them.` });
    const label = name ? element("div", { class: "name" }) : null;
    this.stage.append(element("div", { class: "half" }, canvas, label));
    return { replay, scene: new Scene(replay, canvas), canvas, label };
  }

  #corner() {
    const { attribution } = this.views[0].replay.world;
    return element("footer", { class: "credit", text: [attribution, "GAMMS"].filter(Boolean).join(" · ") });
  }

  /** Read what happens in the turns, a few milliseconds at a time. */
  readOn() {
    const until = performance.now() + SLICE_MS;
    let isMore = true;
    while (isMore && performance.now() < until) isMore = this.views.map((view) => view.replay.timeline.readOn(view.replay.recording)).some(Boolean);
    if (isMore) {
      setTimeout(() => this.readOn(), 0);
      return;
    }
    this.fitStage(); // now that the captions are known
    this.settings.renew();
    this.panel.renew(true);
    this.panel.showCharts();
    this.needsPaint = true;
    this.whenRead();
    this.root.dataset.isRead = "true";
  }

  /** Show a game that goes on. @param {{speed: number}} live */
  enliven(live) {
    this.live = live;
    this.fitStage();
  }

  /** Take further turns of a game that goes on, which have come. */
  grow() {
    const [{ replay, scene }] = this.views;
    const offers = () => [replay.timeline.hasSensed, replay.timeline.hasMessages, replay.timeline.sides.size].join(), offered = offers();
    if (replay.repeats !== replay.recording.repeats || replay.state.turn >= replay.turns - 1) replay.refresh();
    while (replay.timeline.readOn(replay.recording));
    this.panel.showCharts();
    if (offered !== offers()) this.settings.renew();
    scene.sightKey = "";
    scene.caches.clear();
    this.controls.renew();
    this.panel.renew();
    this.needsPaint = true;
    this.root.dataset.isRead = "true";
  }

  /** Show another game in place of the one that is shown. @param {Replay} replay */
  replace(replay) {
    const [view] = this.views;
    const { camera, overlay } = view.scene;
    const isSameMap = JSON.stringify(view.replay.world.box) === JSON.stringify(replay.world.box);
    view.replay = replay;
    view.scene = new Scene(replay, view.canvas);
    view.scene.overlay = overlay;
    if (isSameMap) view.scene.camera = camera;
    this.look.selected = this.look.hovered = null;
    this.position = replay.recording.first;
    this.fitStage();
    this.seek(replay.turns);
    this.grow();
  }

  /** Go to a place in the turns. @param {number} position */
  seek(position) {
    this.position = Math.min(Math.max(position, this.first), this.turns);
    for (const { replay, scene } of this.views) {
      replay.show(Math.min(this.turn, replay.turns));
      scene.see(this.look);
    }
    this.needsPaint = true;
    this.controls.renewTurn();
    this.panel.renew();
    this.whenShown();
  }

  /** Go some whole turns on or back, and stop there. @param {number} turns */
  step(turns) {
    this.pause(); // a live game goes on, and is looked at no more
    this.seek(turns > 0 ? Math.floor(this.position) + turns : Math.ceil(this.position) + turns);
  }

  play() {
    if (this.position >= this.turns && this.live === null) this.seek(0);
    this.isLive = this.live !== null && this.position >= this.turns;
    this.isPlaying = true;
    this.lastFrame = performance.now();
    this.controls.renewTurn();
  }

  pause() {
    this.isPlaying = this.isLive = false;
    this.controls.renewTurn();
    this.panel.renew(true);
    this.whenShown();
  }

  /** Select an agent, or none. @param {string | null} name @param {boolean} [isFollowed] */
  select(name, isFollowed = false) {
    this.look.selected = name !== null && this.views.some((view) => view.replay.state.agents.has(name)) ? name : null;
    this.isFollowing = isFollowed && this.look.selected !== null;
    if (this.isFollowing) this.#lookCloser();
    if (this.look.selected !== null && this.isWide) this.panel.open();
    this.needsPaint = true;
    this.panel.renew(true);
    this.whenShown();
  }

  /** A pointer goes down on the map. */
  press() {
    this.settings.close();
  }

  /** Select the agent near a pixel, or none. @param {View} view @param {number} px @param {number} py @param {number} far */
  click(view, px, py, far) {
    if (this.player?.click(view, px, py, far)) return;
    const found = view.scene.agentAt(px, py, far);
    this.select(found === null ? null : found.name);
    if (found === null) return;
    this.panel.open();
    this.#keepInView(found);
  }

  /** Move the map where an agent would be out of view. @param {import("./scene.js").Disc} disc */
  #keepInView({ x, y }) {
    for (const { camera } of this.views.map((view) => view.scene)) {
      const [px, py] = camera.toScreen(x, y), { insets } = camera;
      const isSeen = px > EDGE_PX && px < camera.width - EDGE_PX && py > insets.top + EDGE_PX && py < camera.height - insets.bottom - EDGE_PX;
      if (!isSeen) camera.pan(camera.width / 2 - px, (insets.top + camera.height - insets.bottom) / 2 - py);
    }
    this.movedAt = performance.now();
  }

  /** Look closer at a place. @param {number} px @param {number} py */
  doubleClick(px, py) {
    this.moveCamera((camera) => camera.zoom(1.6, px, py));
  }

  /** Show what is pointed at. @param {View} view @param {number | null} px @param {number} py */
  point(view, px, py) {
    const isMove = px !== null && this.player !== null && this.player.point(view, px, py);
    const found = px === null ? null : view.scene.agentAt(px, py);
    view.canvas.style.cursor = found === null && !isMove ? "" : "pointer";
    if (this.look.hovered === (found?.name ?? null)) return;
    this.look.hovered = found?.name ?? null;
    this.pointedAt = view;
    this.needsPaint = true;
    this.panel.explain(view, found);
  }

  /** Change how all is painted. @param {Partial<import("./scene.js").Look>} changes */
  change(changes) {
    Object.assign(this.look, changes);
    for (const { scene } of this.views) scene.see(this.look);
    if ("theme" in changes) this.#dress();
    this.needsPaint = true;
    this.controls.renew();
    this.settings.renew();
    this.panel.renew(true);
    this.whenShown();
  }

  /** Move all cameras. @param {(camera: import("./camera.js").Camera) => void} move */
  moveCamera(move) {
    for (const { scene } of this.views) move(scene.camera);
    this.movedAt = performance.now();
    this.needsPaint = true;
  }

  /** Follow the selected agent from some hundred metres. */
  #lookCloser() {
    for (const { scene } of this.views) if (scene.camera.scale < scene.closeScale) scene.camera.zoom(scene.closeScale / scene.camera.scale);
    this.movedAt = performance.now();
  }

  /** In a frame of another page, and on phones, follow an agent if the whole map would be a stamp, and is larger than what is seen then. */
  beginNear() {
    const isSmall = IS_FRAMED || Math.min(this.root.clientWidth, this.root.clientHeight) < PHONE_PX;
    const [{ replay, scene: { camera, closeScale } }] = this.views, { box, insets } = camera;
    const shown = [(box.right - box.left) * camera.scale, (box.top - box.bottom) * camera.scale];
    const free = [camera.width - insets.left - insets.right, camera.height - insets.top - insets.bottom];
    const isStamp = Math.min(shown[0] / free[0], shown[1] / free[1]) < STAMP && Math.max(...shown) > SLIM * Math.min(...shown);
    if (!isSmall || !isStamp || camera.scale >= closeScale || this.isFollowing || !camera.isFitted) return;
    this.look.selected ??= replay.timeline.mostNamed(this.turn, replay.state.agents);
    this.isFollowing = this.look.selected !== null;
    if (this.isFollowing) this.#lookCloser();
    this.needsPaint = true;
  }

  #follow() {
    if (!this.isFollowing || this.look.selected === null) return;
    for (const { scene } of this.views) {
      const disc = scene.discOf(this.look.selected);
      if (disc === undefined || (disc.x === scene.camera.x && disc.y === scene.camera.y)) continue;
      scene.camera.lookAt(disc.x, disc.y);
      this.needsPaint = true;
    }
  }

  /** Put on the colors of the theme. */
  #dress() {
    const theme = THEMES[this.look.theme];
    this.root.dataset.theme = theme.name;
    for (const name of /** @type {const} */ (["background", "ink", "faint", "card"])) this.root.style.setProperty(`--${name}`, theme[name]);
  }

  /** Fit the maps into the part of the page that is not beside or above the panel. */
  fitStage() {
    const strip = this.live !== null && this.root.clientWidth <= NARROW_PX ? 46 : 0; // with what is said of a live game
    this.root.style.setProperty("--bar", `${this.controls.bar.offsetHeight}px`);
    const isAbovePanel = this.stage.getBoundingClientRect().bottom < this.controls.bar.getBoundingClientRect().top;
    const bar = isAbovePanel ? 12 : (this.controls.bar.offsetHeight || 64) + 12 + strip;
    for (const { scene } of this.views) {
      scene.camera.insets = { left: 0, top: this.isWide ? 0 : 64, right: 0, bottom: bar };
      scene.camera.covered = this.covered();
      scene.resize();
    }
    this.controls.renew();
    this.needsPaint = true;
  }

  /** Return what cards cover of the upper corners of views, which have one scale, and captions of the lower left one. */
  covered() {
    const cards = [this.controls.head, ...(this.isWide ? [this.settings.element, this.player?.element] : [])];
    const boxes = cards.flatMap((card) => (card?.offsetHeight ? [card.getBoundingClientRect()] : []));
    const areas = this.views.map(({ canvas }) => canvas.getBoundingClientRect());
    const upper = areas.flatMap((area) => boxes.filter((box) => box.left < area.right && box.right > area.left)
      .map((box) => ({ left: box.left - area.left, right: box.right - area.left, top: 0, bottom: box.bottom - area.top })));
    const { width, height } = this.controls.captionRoom(), bottom = areas[0].height - this.views[0].scene.camera.insets.bottom;
    return width ? [...upper, { left: 0, right: width, top: bottom - height, bottom: areas[0].height }] : upper;
  }

  /** @param {number} now */
  #frame(now) {
    if (this.isPlaying) this.#playOn((now - this.lastFrame) / 1000);
    this.lastFrame = now;
    this.#follow();
    const isMoving = now - this.movedAt < RESTS_MS;
    if (this.needsPaint) {
      const begun = performance.now();
      this.needsPaint = false;
      const share = this.position === this.turn ? 1 : this.position - this.turn + 1;
      for (const { replay, scene } of this.views) {
        if (!scene.paint(this.look, this.turn > replay.turns ? 1 : share, isMoving)) this.needsPaint = true;
      }
      this.paintMs = performance.now() - begun;
      if (this.look.hovered !== null) this.panel.explain(this.pointedAt, this.pointedAt.scene.discOf(this.look.hovered) ?? null);
      this.firstPaintMs ??= performance.now(); // since the page was opened
    } else if (isMoving) {
      this.needsPaint = true;
    }
    requestAnimationFrame((next) => this.#frame(next));
  }

  /** @param {number} seconds */
  #playOn(seconds) {
    const behind = this.turns - this.position;
    const speed = this.isLive ? Math.max(behind, 1) * (this.live?.speed ?? this.speed) : this.speed;
    const position = Math.min(this.position + Math.min(seconds, 0.25) * speed, this.turns);
    if (Math.ceil(position) !== this.turn) this.seek(position);
    this.needsPaint ||= position !== this.position;
    this.position = position;
    this.controls.renewPosition();
    if (position >= this.turns && this.live !== null) this.isLive = true;
    else if (position >= this.turns) this.pause();
  }
}
