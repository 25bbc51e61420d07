// What stands above and below the map: the title, teams with scores, what happens, and the timeline.
import { dot, element, icon, iconButton, refill } from "./dom.js";
import { wordsOf } from "./words.js";
import { THEMES } from "./themes.js";

const SPEEDS = [0.5, 1, 2, 4, 8, 16, 32, 64];
const CAPTION_TURNS = 8; // for which a line is shown
const MOST_LINES = 3;
const CAPTION_PX = 27, LETTER_PX = 7, MOST_CAPTION_PX = 380; // the height of a caption, the width of a letter and of a caption

/** @typedef {import("./app.js").App} App */

export class Controls {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.title = element("h1", { text: app.options.title || "A game" });
    this.teams = element("div", { class: "teams" });
    this.end = element("p", { class: "end" });
    this.head = element("header", { class: "head card" }, this.title, app.options.audience ? element("p", { class: "audience", text: `As ${app.options.audience} saw it` }) : null, ...(app.options.warnings ?? []).map((text) => element("p", { class: "warning", role: "status", text })), this.teams, this.end);
    this.captions = element("div", { class: "captions", role: "log", "aria-live": "polite", "aria-label": "What happens" });
    this.playButton = iconButton("play", "Play (space)", () => (app.isPlaying ? app.pause() : app.play()), { class: "play" });
    this.range = element("input", { type: "range", min: 0, max: 1, step: 1, value: 0, "aria-label": "Turn", on: { input: () => this.#dragged() } });
    this.marks = element("canvas", { class: "marks", "aria-hidden": "true" });
    this.tip = element("div", { class: "tip", role: "tooltip" });
    this.track = element("div", { class: "track", on: { pointermove: (/** @type {PointerEvent} */ event) => this.#explain(event), pointerleave: () => this.#explain(null) } }, this.marks, this.range, this.tip);
    this.turnText = element("output", { class: "turn" });
    this.speedMenu = element("select", { class: "speed", "aria-label": "Speed", title: "Turns a second", on: { change: () => this.#setSpeed() } },
      ...SPEEDS.map((speed) => element("option", { value: speed, text: `${speed} turn${speed === 1 ? "" : "s"}/s`, selected: speed === app.speed })));
    this.bar = element("nav", { class: "bar card", "aria-label": "Timeline" }, this.captions,
      element("div", { class: "buttons" }, iconButton("back", "One turn back (left arrow)", () => app.step(-1)), this.playButton, iconButton("next", "One turn on (right arrow)", () => app.step(1))),
      this.track, this.turnText, this.speedMenu);
  }

  #dragged() {
    const turn = Number(this.range.value); // which a pause would set back
    this.app.pause();
    this.app.seek(turn);
  }

  #setSpeed() {
    this.app.speed = Number(this.speedMenu.value);
  }

  /** Play faster, or slower. @param {1 | -1} by */
  changeSpeed(by) {
    const place = SPEEDS.indexOf(this.app.speed) + by;
    this.app.speed = SPEEDS[Math.min(Math.max(place, 0), SPEEDS.length - 1)];
    this.speedMenu.value = String(this.app.speed);
  }

  /** Say what is different after the recording, the theme or the size has changed. */
  renew() {
    this.range.min = String(this.app.first);
    this.range.max = String(Math.max(this.app.turns, 1));
    this.#paintMarks();
    this.renewTurn();
  }

  /** Say what is different in another turn. */
  renewTurn() {
    const { app } = this;
    this.renewPosition();
    const label = app.isPlaying ? "Pause (space)" : "Play (space)";
    this.playButton.setAttribute("aria-label", label);
    this.playButton.title = label;
    refill(this.playButton, icon(app.isPlaying ? "pause" : "play"));
    this.turnText.textContent = `${app.turn} / ${app.turns}`;
    this.range.setAttribute("aria-valuetext", `Turn ${app.turn} of ${app.turns}`);
    this.#renewTeams();
    this.#renewCaptions();
  }

  /** Return where on the line a turn is, 0 to 1. @param {number} turn */
  #share(turn) {
    const { first, turns } = this.app;
    return (turn - first) / Math.max(turns - first, 1);
  }

  /** Move the handle. */
  renewPosition() {
    this.range.value = String(this.app.turn);
    this.track.style.setProperty("--share", String(this.#share(this.app.position)));
  }

  #renewTeams() {
    const { app } = this;
    app.views.forEach(({ replay: { state, turns }, label }, i) => {
      if (label === null) return;
      const scores = [...state.scores].map(([of, score]) => `${of} ${wordsOf(score)}`).join(" : ");
      const words = [app.options.names?.[i] ?? "", scores, app.turn > turns ? `over after turn ${turns}` : "", app.options.parts === app.turn ? "here the games part" : ""];
      label.textContent = words.filter(Boolean).join(" · ");
    });
    const [{ replay, scene }] = app.views;
    const colors = scene.colors(app.look);
    const sides = new Map(replay.sides().map((side) => [side, { living: 0, all: 0 }]));
    for (const agent of replay.state.agents.values()) {
      const side = sides.get(agent.side);
      if (side === undefined) continue;
      side.all++;
      side.living += agent.alive ? 1 : 0;
    }
    const { scores, isOver } = replay.state;
    const names = [...new Set([...sides.keys(), ...scores.keys()])].slice(0, 8);
    const hasScores = scores.size > 0 || replay.timeline.scores.some((one) => one.values.size > 0);
    refill(this.teams, ...names.map((name) => {
      const side = sides.get(name);
      const isForeign = app.options.audience !== undefined && app.options.audience !== name;
      const count = isForeign ? `${side?.living ?? 0} in sight` : side !== undefined && side.all > 1 ? `${side.living < side.all ? `${side.living} of ${side.all}` : side.all} agents` : "";
      const score = hasScores ? Number((scores.get(name) ?? 0).toPrecision?.(5) ?? 0) : "";
      return element("div", { class: "team" }, dot(colors.get(name)), element("span", { class: "who", text: name }), element("span", { class: "count", text: count }), element("span", { class: "score", text: score }));
    }));
    const ending = replay.timeline.captions.filter((one) => one.isMajor).pop();
    this.end.textContent = isOver && ending !== undefined && ending.turn === replay.state.turn ? ending.words : "";
  }

  /** Return how many pixels captions take at most, from the left edge and up from the scale bar. */
  captionRoom() {
    const longest = this.app.views[0].replay.timeline.captions.reduce((most, one) => Math.max(most, one.words.length), 0);
    return { width: longest && Math.min(60 + LETTER_PX * longest, MOST_CAPTION_PX), height: 30 + CAPTION_PX * MOST_LINES };
  }

  #renewCaptions() {
    const { app } = this;
    const [{ replay, scene }] = app.views;
    const colors = scene.colors(app.look);
    const now = replay.timeline.captions.filter((one) => one.turn <= app.turn && one.turn > app.turn - CAPTION_TURNS && this.#isOpen(one)).slice(-MOST_LINES);
    refill(this.captions, ...now.map((one) => {
      const color = colors.get(replay.sideOf(one.agent ?? ""));
      return element("p", { class: one.turn === app.turn ? "now" : "" }, dot(color), element("span", { text: one.words }));
    }));
  }

  /** Whether a team that looks on knows of what happened. @param {import("./replay.js").Caption} caption */
  #isOpen(caption) {
    const [{ replay, scene }] = this.app.views;
    if (this.app.look.fog === null || caption.agent === null) return true;
    return scene.visible === null || !replay.state.agents.has(caption.agent) || scene.visible.has(caption.agent);
  }

  #paintMarks() {
    const { app, marks } = this;
    const theme = THEMES[app.look.theme];
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = marks.clientWidth, height = marks.clientHeight;
    marks.width = width * ratio;
    marks.height = height * ratio;
    const to = /** @type {CanvasRenderingContext2D} */ (marks.getContext("2d"));
    to.scale(ratio, ratio);
    to.clearRect(0, 0, width, height);
    app.views.forEach(({ replay, scene }) => {
      const colors = scene.colors(app.look);
      for (const one of replay.timeline.captions) {
        if (!one.isMarked) continue;
        to.fillStyle = colors.get(replay.sideOf(one.agent ?? "")) ?? theme.faint;
        const x = this.#share(one.turn) * width, high = one.isMajor ? 16 : 9;
        to.fillRect(x - (one.isMajor ? 1.5 : 0.75), height / 2 - high / 2, one.isMajor ? 3 : 1.5, high);
      }
    });
    if (app.options.parts) {
      const x = this.#share(app.options.parts) * width;
      to.strokeStyle = theme.ink;
      to.setLineDash([3, 2]);
      to.beginPath();
      to.moveTo(x, 0);
      to.lineTo(x, height);
      to.stroke();
    }
  }

  /** Say what happened in the turn that is pointed at. @param {PointerEvent | null} event */
  #explain(event) {
    if (event === null) {
      this.tip.classList.remove("shown");
      return;
    }
    const { app } = this;
    const box = this.marks.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    const at = app.first + share * (app.turns - app.first), turn = Math.round(at), far = Math.max((4 / box.width) * (app.turns - app.first), 0.5);
    const near = app.views[0].replay.timeline.captions.filter((one) => one.isMarked && Math.abs(one.turn - at) <= far && this.#isOpen(one)).slice(0, 4);
    const parts = app.options.parts && Math.abs(app.options.parts - at) <= far ? ["here the games part"] : [];
    this.tip.textContent = [`Turn ${near.length ? near[0].turn : turn}`, ...near.map((one) => one.words), ...parts].join(" · ");
    this.tip.style.left = `${share * 100}%`;
    this.tip.classList.add("shown");
  }
}
