// A game that goes on: the recording as it comes over a WebSocket, how the game goes, and what may be done with it.
import { App } from "./app.js";
import { inflated } from "./bytes.js";
import { element, iconButton, icon, refill } from "./dom.js";
import { Player } from "./player.js";
import { Recording } from "./recording.js";
import { Replay } from "./replay.js";

const SPEEDS = [0.5, 1, 2, 4, 8, 16, 32];
const AGAIN_MS = 1000, MOST_AGAIN_MS = 15000; // between two attempts to connect
const BAD_TOKEN = 4401;
const FAST = 30; // turns a second that are shown of a game that is played as fast as possible

/**
 * @typedef {{path: string, value: number, low: number, high: number, step: number}} Choice
 * @typedef {{paused: boolean, speed: number | null, over: boolean, control: boolean, watching: number, dropped: number, error: string | null,
 *   restart?: boolean, numbers?: Choice[], seed?: number | null}} Status
 */

/** The connection to the server of a game. */
export class Live {
  /** @param {HTMLElement} root @param {import("./app.js").Options} options */
  constructor(root, options) {
    this.root = root;
    this.options = options;
    /** @type {App | null} */ this.app = null;
    this.recording = new Recording();
    /** @type {Status | null} */ this.status = null;
    /** @type {any} */ this.asked = null; // the questions that came last, to who plays
    this.wait = AGAIN_MS;
    this.taken = Promise.resolve(); // once the messages that have come were taken, one after the other
    this.waiting = 0; // messages that have come and were not taken
    this.hasMore = false; // turns that are not shown
    this.strip = new LiveStrip(this);
    refill(root, element("p", { class: "waiting", role: "status", text: "Waiting for the game." }));
    this.#connect();
  }

  /** Turns a second. */
  get speed() {
    return this.status?.speed ?? FAST;
  }

  /** Send a message. @param {Record<string, any>} message */
  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  #connect() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket = socket;
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => socket.send(JSON.stringify({ type: "join", token: location.hash.slice(1) })));
    socket.addEventListener("message", (event) => {
      this.waiting++;
      this.taken = this.taken.then(() => this.#take(event.data));
    });
    socket.addEventListener("close", (event) => this.#closed(event));
  }

  /** @param {ArrayBuffer | string} data */
  async #take(data) {
    this.wait = AGAIN_MS;
    this.waiting--;
    try {
      if (typeof data === "string") this.#hear(JSON.parse(data));
      else this.#feed(await inflated(new Uint8Array(data)));
      if (this.hasMore && this.waiting === 0) this.#show(); // who comes late is sent many turns, and sees them together
    } catch (error) {
      this.#say(`This game cannot be shown: ${error instanceof Error ? error.message : error}`);
      this.socket?.close();
    }
  }

  /** @param {any} message */
  #hear(message) {
    if (message.type === "status") this.status = message;
    else if (message.type === "refused") this.strip.refuse(message.words);
    else if (message.type === "questions") this.#ask(message);
    this.strip.renew();
  }

  /** Ask a person who plays, once the game is there to be seen. @param {any} message */
  #ask(message) {
    this.asked = message;
    if (this.app === null) return;
    this.app.player ??= new Player(this.app, (choice) => this.send(choice));
    this.app.player.hear(message);
  }

  /** @param {Uint8Array} bytes */
  #feed(bytes) {
    if (Recording.begins(bytes)) this.recording = new Recording();
    this.recording.feed(bytes);
    this.hasMore = this.recording.parts.length > 0;
  }

  #show() {
    this.hasMore = false;
    const shown = this.app?.views[0].replay.recording;
    if (this.app === null) this.#begin();
    else if (shown !== this.recording) this.app.replace(new Replay(this.recording));
    else this.app.grow();
    this.strip.renew();
  }

  #begin() {
    const audience = this.recording.header.get("audience");
    this.app = new App(this.root, [new Replay(this.recording)], audience === undefined ? this.options : { ...this.options, audience });
    this.app.enliven(this);
    this.root.dataset.live = "true";
    this.root.append(this.strip.element);
    this.app.panel.hold(this.strip.numbers.element);
    this.app.seek(this.recording.turns);
    this.app.play();
    this.app.grow();
    Object.defineProperty(window, "gamms", { value: this.app, configurable: true });
    if (this.asked !== null) this.#ask(this.asked);
  }

  /** @param {CloseEvent} event */
  #closed(event) {
    if (event.code === BAD_TOKEN) {
      this.#say("This link is not known here, or not any more. Ask for another one.");
      return;
    }
    this.strip.renew();
    setTimeout(() => this.#connect(), this.wait);
    this.wait = Math.min(this.wait * 2, MOST_AGAIN_MS);
  }

  /** Say why there is no game to be seen. @param {string} words */
  #say(words) {
    if (this.app === null) refill(this.root, element("p", { class: "failure", role: "status", text: words }));
    else this.strip.refuse(words);
  }
}

/** What stands above the map of a game that goes on: how it goes, and the buttons of those who may change it. */
class LiveStrip {
  /** @param {Live} live */
  constructor(live) {
    this.live = live;
    this.edge = element("button", { type: "button", class: "edge", title: "Show the last turn, as soon as it is there", on: { click: () => this.#toEdge() } }, element("span", { class: "dot" }), element("span", { text: "Live" }));
    this.words = element("span", { class: "words", role: "status" });
    this.pause = iconButton("pause", "Pause the game", () => live.send({ type: "pause", paused: !live.status?.paused }));
    this.step = iconButton("next", "Play one turn of the game", () => live.send({ type: "step" }));
    this.speed = element("select", { "aria-label": "Speed of the game", title: "Speed of the game", on: { change: () => live.send({ type: "speed", speed: this.speed.value ? Number(this.speed.value) : null }) } },
      ...SPEEDS.map((speed) => element("option", { value: speed, text: `${speed} turn${speed === 1 ? "" : "s"}/s` })), element("option", { value: "", text: "fastest" }));
    this.again = element("button", { type: "button", class: "wanted", text: "Restart…", on: { click: () => this.numbers.show() } });
    this.control = element("span", { class: "control", hidden: true }, this.pause, this.step, this.speed, this.again);
    this.study = sessionStorage.getItem("study"); // the page of a study that has led here
    this.next = element("button", { type: "button", class: "wanted", text: "Continue", hidden: true, on: { click: () => location.assign(this.study ?? "/") } });
    this.element = element("section", { class: "live card", "aria-label": "The game that is played" }, this.edge, this.words, this.next, this.control);
    this.numbers = new ScenarioNumbers(live);
    this.refused = "";
  }

  /** Say what was refused, until something else is new. @param {string} words */
  refuse(words) {
    this.live.app?.player?.refuse(words);
    this.refused = words;
    this.renew();
    setTimeout(() => { this.refused = ""; this.renew(); }, 6000);
  }

  renew() {
    const { status, app, socket } = this.live;
    this.edge.classList.toggle("now", Boolean(app?.isLive));
    this.edge.setAttribute("aria-pressed", String(Boolean(app?.isLive)));
    const isOpen = socket?.readyState === WebSocket.OPEN;
    this.next.hidden = !(this.study && status?.over);
    const words = this.next.hidden ? wordsOfStatus(status) : "This round is over.";
    const first = this.live.recording.first;
    this.words.textContent = this.refused || (isOpen ? [words, first ? `since turn ${first}` : ""].filter(Boolean).join(" · ") : "connecting again");
    this.control.hidden = !status?.control || !isOpen;
    if (!status?.control) return;
    refill(this.pause, icon(status.paused ? "play" : "pause"));
    for (const [name, words] of [["aria-label", status.paused ? "Let the game go on" : "Pause the game"], ["title", status.paused ? "Let the game go on" : "Pause the game"]]) this.pause.setAttribute(name, words);
    this.pause.disabled = this.step.disabled = status.over;
    this.speed.value = status.speed === null ? "" : String(SPEEDS.find((speed) => speed >= /** @type {number} */ (status.speed)) ?? "");
    this.again.hidden = !status.restart;
    this.numbers.renew(status);
  }

  #toEdge() {
    const { app } = this.live;
    app?.seek(app.turns);
    app?.play();
    this.renew();
  }
}

/** The form in the panel with the seed and the numbers of the scenario, each with a slider, with which the game restarts. */
class ScenarioNumbers {
  /** @param {Live} live */
  constructor(live) {
    this.live = live;
    this.known = ""; // what the fields were made of
    this.seed = element("input", { type: "number", step: 1 });
    /** @type {(Choice & {input: HTMLInputElement})[]} */ this.fields = [];
    this.element = element("form", { class: "numbers", hidden: true, "aria-label": "Restart with other numbers", on: { submit: (/** @type {Event} */ event) => this.#restart(event) } });
  }

  /** Take the numbers of a status, and show them beside a wide map at first; fields in which a number was chosen stay. @param {Status} status */
  renew(status) {
    const { app } = this.live, known = JSON.stringify([status.numbers, status.seed]);
    if (app === null || !status.restart || known === this.known) return;
    const isFirst = this.known === "";
    this.known = known;
    this.seed = element("input", { type: "number", step: 1, value: status.seed ?? "", placeholder: "that of the scenario" });
    this.fields = (status.numbers ?? []).map((one) => ({ ...one, input: element("input", { type: "number", min: one.low, max: one.high, step: one.step === 1 ? 1 : "any", value: one.value, "aria-label": one.path }) }));
    refill(this.element, element("h3", { text: "Restart with" }), element("label", { class: "choice" }, element("span", { text: "seed" }), this.seed),
      ...this.fields.map(rowOf), element("button", { type: "submit", class: "wanted", text: "Restart" }));
    this.element.hidden = false;
    if (isFirst && app.isWide) app.panel.open();
  }

  /** Open the panel at the numbers. */
  show() {
    this.live.app?.panel.open();
    this.element.scrollIntoView({ block: "nearest" });
    this.seed.focus();
  }

  /** @param {Event} event */
  #restart(event) {
    event.preventDefault(); // the browser has checked that the numbers are in their ranges
    const changed = this.fields.filter((one) => one.input.value !== "" && one.input.valueAsNumber !== one.value);
    const seed = this.seed.value ? Number(this.seed.value) : null;
    this.live.send({ type: "restart", seed, numbers: Object.fromEntries(changed.map((one) => [one.path, one.input.valueAsNumber])) });
  }
}

/** Make the row of a number: its path, a field to type it, and a slider. @param {Choice & {input: HTMLInputElement}} one */
function rowOf({ path, value, low, high, step, input }) {
  const range = element("input", { type: "range", min: low, max: high, step, value, "aria-label": `${path}, slider` });
  range.addEventListener("input", () => { input.value = String(Number(range.valueAsNumber.toPrecision(4))); });
  input.addEventListener("input", () => { if (input.value !== "") range.value = input.value; });
  return element("div", { class: "number-row" }, element("span", { text: path }), input, range);
}

/** @param {Status | null} status */
function wordsOfStatus(status) {
  if (status === null) return "";
  const state = status.error ?? (status.over ? "over" : status.paused ? "paused" : "");
  const watching = status.watching === 0 ? "nobody else watching" : `${status.watching} ${status.watching === 1 ? "other" : "others"} watching`;
  return [state, watching, status.dropped ? `${status.dropped} turns skipped` : ""].filter(Boolean).join(" · ");
}
