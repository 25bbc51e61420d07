// What a person is asked in a game that is played: legal moves on the map and as buttons, deeds, messages, and the time that is left.
import { dot, element, refill } from "./dom.js";
import { faded } from "./themes.js";

const FAR_PX = 18; // how far beside a node a pointer may be; fingers more
const LEAST_WAY_PX = 40, WANTED_WAY_PX = 64; // between an agent and its moves: it is looked at more closely where less
const AGAIN_MS = 400; // after a choice, in which a click is the second half of a double click
const MOST_BUTTONS = 10; // moves that have a number and a button
const MOST_LETTERS = 500; // of a message
const WINDS = ["→", "↗", "↑", "↖", "←", "↙", "↓", "↘"];
const WIND_NAMES = ["east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east"];
/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/**
 * @typedef {{kind: string, choices: any[] | null, is_required: boolean}} Field
 * @typedef {object} Question of the server, about one agent
 * @property {number} question @property {string} agent @property {number} turn @property {number | number[]} here
 * @property {(number | null)[] | null} moves nodes; null among them: stop on the edge; null: it flies
 * @property {number} speed @property {Record<string, Record<string, Field>>} deeds @property {{ kind: string, left: number }} [doing] @property {number} left_s @property {boolean} is_chosen
 * @property {{edge: number, to: number, length: number, attributes: Record<string, any>}[]} [edges] to each node to which several lead
 * @property {Record<string, {to: any[], bytes: number | null}>} channels by which it can send @property {any[]} inbox what it hears
 * @typedef {{x: number, y: number, move?: number | null, direction?: number[], distance?: number, words: string}} Option what can be chosen, and where that is
 */

export class Player {
  /** @param {import("./app.js").App} app @param {(message: Record<string, any>) => void} send to the server */
  constructor(app, send) {
    this.app = app;
    this.send = send;
    /** @type {Question[]} */ this.questions = [];
    this.isWaiting = false;
    this.agent = ""; // the one that is asked about
    this.number = -1; // of the question that is shown
    /** @type {Option | null} */ this.selected = null;
    /** @type {Map<number, number>} */ this.ends = new Map(); // question -> when its time is over
    /** @type {Map<number, number>} */ this.limits = new Map(); // question -> seconds that there were
    this.chosenAt = -Infinity;
    this.who = element("h2", {});
    this.clock = element("span", { class: "clock", "aria-hidden": "true" });
    this.gauge = element("div", { class: "gauge", "aria-hidden": "true" });
    this.words = element("p", { class: "words", role: "status", "aria-live": "polite" });
    this.shared = element("p", { class: "words faint", role: "status" }); // said where the link is open on several pages
    this.moves = element("div", { class: "moves", role: "group", "aria-label": "Moves" });
    this.edges = element("div", { class: "deeds" }); // by which of several edges to go to a node
    this.deeds = element("div", { class: "deeds" });
    this.inbox = element("ul", { class: "inbox", "aria-label": "Messages that came" });
    this.outbox = element("div", { class: "outbox" });
    this.element = element("section", { class: "ask card", "aria-label": "Your move", hidden: true },
      element("div", { class: "asked" }, this.who, this.clock), this.gauge, this.inbox, this.words, this.moves, this.edges, this.deeds, this.outbox, this.shared);
    app.root.append(this.element);
    for (const { scene } of app.views) scene.overlay = (shown) => this.#paint(shown);
    setInterval(() => this.#tick(), 200);
  }

  /** The question that is shown; undefined while there is none that is not answered. */
  get question() {
    return this.questions.find((one) => one.question === this.number && !one.is_chosen);
  }

  /** Take what the server asks. @param {{questions: Question[], waiting: boolean, pages: number}} message */
  hear(message) {
    this.shared.textContent = message.pages > 1 ? `This link is open on ${message.pages} pages; the first choice counts.` : "";
    const now = performance.now();
    for (const one of message.questions) {
      this.ends.set(one.question, now + 1000 * one.left_s);
      if (!this.limits.has(one.question)) this.limits.set(one.question, Math.max(one.left_s, 0.1));
    }
    for (const known of this.ends.keys()) if (!message.questions.some((one) => one.question === known)) this.ends.delete(known);
    this.questions = message.questions;
    this.isWaiting = message.waiting;
    if (this.question === undefined) this.#ask(this.questions.find((one) => !one.is_chosen));
    else this.#renew();
  }

  /** Say why a choice was refused. @param {string} words */
  refuse(words) {
    this.words.textContent = words;
  }

  /** @param {Question | undefined} question */
  #ask(question) {
    this.number = question?.question ?? -1;
    this.agent = question?.agent ?? "";
    this.selected = null;
    if (question !== undefined && !this.app.isLive) {
      this.app.seek(this.app.turns);
      this.app.play();
    }
    this.#renew(true);
    if (question !== undefined) this.#lookAt(question);
  }

  /** Show the question, or what is waited for. @param {boolean} [isNew] */
  #renew(isNew = false) {
    const { question, app } = this;
    this.element.hidden = this.questions.length === 0 && !this.isWaiting;
    const left = this.questions.filter((one) => !one.is_chosen).length;
    if (question === undefined) {
      refill(this.who, "Your move is made");
      this.words.textContent = this.isWaiting ? "Waiting for others …" : "";
      for (const part of [this.moves, this.edges, this.deeds, this.inbox, this.outbox]) refill(part);
    } else if (isNew) {
      const color = app.views[0].scene.discOf(question.agent)?.color;
      const others = this.questions.length > 1 ? ` (${this.questions.length - left + 1} of ${this.questions.length})` : "";
      refill(this.who, dot(color), `Your move: ${question.agent}${others}`);
      const isTouch = matchMedia("(pointer: coarse)").matches;
      const where = `${isTouch ? "Touch" : "Click"} ${question.moves === null ? "where it flies to" : "a marked place"}`;
      this.words.textContent = isTouch ? `${where}.` : `${where}, or use ${question.moves === null ? "" : "numbers or "}arrow keys and Enter.`;
      if (question.doing) this.words.textContent += ` ${question.agent} is doing ${question.doing.kind}, with ${+question.doing.left.toFixed(2)} turns left.`;
      this.#showMoves(question);
      this.#showEdges(question);
      this.#showDeeds(question);
      refill(this.inbox, ...question.inbox.map((one) => element("li", {}, element("b", { text: one.sender }), element("span", { class: "aside", text: ` ${one.overheard ? "(overheard) " : ""}${one.channel} ` }), wordsOf(one.body))));
      this.#showOutbox(question);
    }
    this.element.style.setProperty("--top", `${app.controls.head.offsetHeight + 24}px`);
    this.#tick();
    app.needsPaint = true;
  }

  // -- what can be chosen -------------------------------------------------------------------------------------------

  /** Where the agent of a question is, in world units. @param {Question} question @returns {[number, number]} */
  #placeOf(question) {
    const { here } = question, { world } = this.app.views[0].replay;
    if (Array.isArray(here)) return [here[0], here[1]];
    const disc = this.app.views[0].scene.discOf(question.agent);
    const row = world.rowOf.get(here) ?? 0;
    return disc !== undefined && question.moves?.includes(null) ? [disc.x, disc.y] : [world.xy[2 * row], world.xy[2 * row + 1]];
  }

  /** Return the moves of a question that are legal: the first is to stay. @param {Question} question @returns {Option[]} */
  #options(question) {
    const [x, y] = this.#placeOf(question), { world } = this.app.views[0].replay;
    if (question.moves === null) {
      const { speed } = question;
      const around = WINDS.map((_, i) => [Math.cos((i * Math.PI) / 4), Math.sin((i * Math.PI) / 4), 0]);
      const ways = around.map((direction, i) => ({ x: x + speed * direction[0], y: y + speed * direction[1], direction, words: WIND_NAMES[i] }));
      return [{ x, y, direction: [0, 0, 0], words: "stay" }, ...ways, { x, y, direction: [0, 0, 1], words: "up" }, { x, y, direction: [0, 0, -1], words: "down" }];
    }
    return question.moves.map((move) => {
      const row = move === null ? undefined : world.rowOf.get(move);
      if (row === undefined) return { x, y, move, words: "stop here" };
      const to = [world.xy[2 * row], world.xy[2 * row + 1]];
      const words = move === question.here ? "stay" : `node ${move}, ${WIND_NAMES[windOf(to[0] - x, to[1] - y)]}`;
      return { x: to[0], y: to[1], move, words };
    });
  }

  /** @param {Question} question */
  #showMoves(question) {
    const [x, y] = this.#placeOf(question);
    const isFlight = question.moves === null;
    const options = isFlight ? this.#options(question).filter((one) => one.words.length < 5 && !(one.words in { east: 1, west: 1 })) : this.#options(question).slice(0, MOST_BUTTONS);
    refill(this.moves, ...options.map((one, i) => {
      const isHere = one.x === x && one.y === y;
      const text = isHere ? one.words : `${i} ${WINDS[windOf(one.x - x, one.y - y)]}`;
      return element("button", { type: "button", class: "wanted", text: text[0].toUpperCase() + text.slice(1), "aria-label": `${i}: ${one.words}`, on: { click: () => this.choose(one, true) } });
    }));
  }

  /** Offer the edges to each node to which several lead. @param {Question} question */
  #showEdges({ edges = [] }) {
    refill(this.edges, ...[...new Set(edges.map((one) => one.to))].map((to) => {
      const label = `To node ${to} by`, any = element("option", { value: "", text: "the cheapest edge" });
      const options = edges.filter((one) => one.to === to).map((one) => element("option", { value: one.edge, text: wordsOfEdge(one) }));
      return element("div", { class: "deed" }, element("label", {}, `${label} `, element("select", { "data-to": to, "aria-label": label }, any, ...options)));
    }));
  }

  /** Return the edge that is chosen for a move, to be sent with it. @param {number | null | undefined} move @returns {{edge?: number}} */
  #wantedEdge(move) {
    const found = this.edges.querySelector(`select[data-to="${move}"]`);
    return found?.value ? { edge: Number(found.value) } : {};
  }

  /** @param {Question} question */
  #showDeeds(question) {
    refill(this.deeds, ...Object.entries(question.deeds).map(([deed, fields]) => {
      const box = element("input", { type: "checkbox", "data-deed": deed });
      const inputs = Object.entries(fields).map(([key, field]) => inputOf(key, field, () => (box.checked = true)));
      const lacks = Object.values(fields).some((field) => field.is_required && field.choices?.length === 0);
      if (lacks) box.disabled = true;
      return element("div", { class: "deed" }, element("label", {}, box, ` ${deed}`), ...inputs);
    }));
  }

  /** Show what a message is written in. @param {Question} question */
  #showOutbox({ channels }) {
    const names = Object.keys(channels);
    if (names.length === 0) return refill(this.outbox);
    const select = (/** @type {string} */ label) => element("select", { "aria-label": label, title: label });
    const channel = select("Channel"), to = select("To"), text = element("input", { type: "text", class: "body", placeholder: "Message, sent with your move", "aria-label": "Message", maxlength: MOST_LETTERS });
    const offer = () => {
      const { bytes } = channels[channel.value];
      refill(to, ...channels[channel.value].to.map((one, i) => element("option", { value: i, text: one === null ? "to all" : `to ${one}` })));
      text.title = bytes === null ? "It is sent with your move" : `It is sent with your move; ${channel.value} takes ${bytes} bytes a turn`;
    };
    refill(channel, ...names.map((name) => element("option", { value: name, text: name })));
    channel.addEventListener("change", offer);
    channel.hidden = names.length === 1;
    offer();
    refill(this.outbox, channel, to, text);
  }

  /** Return the message that is written, to be sent with the choice. */
  #wantedMessages() {
    const [channel, to, text] = this.outbox.children, { question } = this;
    if (question === undefined || !text?.value.trim()) return [];
    return [{ channel: channel.value, to: question.channels[channel.value].to[Number(to.value)], body: text.value.trim() }];
  }

  /** Return the deeds that are ticked; throws words where a field makes no sense. */
  #wantedDeeds() {
    const question = this.question;
    /** @type {Record<string, any>} */
    const wanted = {};
    for (const row of this.deeds.children) {
      const box = row.querySelector("input[data-deed]"), deed = box.dataset.deed;
      if (!box.checked || question === undefined) continue;
      wanted[deed] = {};
      for (const input of row.querySelectorAll("[data-field]")) {
        const field = question.deeds[deed][input.dataset.field];
        const value = valueOf(input, field);
        if (value !== null) wanted[deed][input.dataset.field] = value;
        else if (field.is_required) throw new Error(`${deed}: ${input.dataset.field} is missing.`);
      }
    }
    return wanted;
  }

  /** Choose, with the deeds that are ticked. @param {Option} option @param {boolean} [isPointed] whether by a pointer */
  choose(option, isPointed = false) {
    const { question } = this;
    if (question === undefined || (isPointed && performance.now() - this.chosenAt < AGAIN_MS)) return;
    try {
      const deeds = this.#wantedDeeds(), messages = this.#wantedMessages();
      const move = option.direction === undefined ? { move: option.move ?? null, ...this.#wantedEdge(option.move) } : { direction: option.direction, ...(option.distance === undefined ? {} : { distance: option.distance }) };
      this.send({ type: "choose", question: question.question, ...move, ...(Object.keys(deeds).length ? { do: deeds } : {}), ...(messages.length ? { messages } : {}) });
      this.chosenAt = performance.now();
    } catch (error) {
      this.refuse(error instanceof Error ? error.message : String(error));
    }
  }

  // -- pointers and keys --------------------------------------------------------------------------------------------

  /** Take a click on the map; returns whether it was for this. @param {import("./app.js").View} view @param {number} px @param {number} py @param {number} far */
  click(view, px, py, far) {
    const option = this.#at(view, px, py, Math.max(far + 6, FAR_PX));
    if (option === null) return false;
    this.choose(option, true);
    return true;
  }

  /** Select what is pointed at; returns whether there is something. @param {import("./app.js").View} view @param {number} px @param {number} py */
  point(view, px, py) {
    const found = this.#at(view, px, py, FAR_PX);
    if (found !== null) this.#select(found);
    return found !== null;
  }

  /** @param {import("./app.js").View} view @param {number} px @param {number} py @param {number} far @returns {Option | null} */
  #at(view, px, py, far) {
    const { question } = this, { camera } = view.scene;
    if (question === undefined) return null;
    if (question.moves === null) {
      const [x, y] = this.#placeOf(question), [tx, ty] = camera.toWorld(px, py);
      const distance = Math.hypot(tx - x, ty - y), share = Math.min(1, question.speed / (distance || 1));
      if (distance > 1.5 * question.speed) return null;
      return { x: x + (tx - x) * share, y: y + (ty - y) * share, direction: [tx - x, ty - y, 0], distance: Math.min(distance, question.speed), words: "there" };
    }
    let [best, least] = [/** @type {Option | null} */ (null), far];
    for (const one of this.#options(question)) {
      const [ox, oy] = camera.toScreen(one.x, one.y), distance = Math.hypot(ox - px, oy - py);
      if (distance < least) [best, least] = [one, distance];
    }
    return best;
  }

  /** Take a key; returns whether it was for this. @param {KeyboardEvent} event */
  key(event) {
    const { question } = this;
    if (question === undefined || event.shiftKey) return false;
    const options = this.#options(question);
    if (event.key === "Enter" && this.selected !== null) this.choose(this.selected);
    else if (/^\d$/.test(event.key) && Number(event.key) < Math.min(options.length, MOST_BUTTONS)) this.#select(options[Number(event.key)]);
    else if (event.key in ARROWS) this.#selectTowards(question, options, ARROWS[event.key]);
    else return false;
    return true;
  }

  /** Select the move nearest to a direction; pressed again, the next one. @param {Question} question @param {Option[]} options @param {[number, number]} direction */
  #selectTowards(question, options, [dx, dy]) {
    const [x, y] = this.#placeOf(question);
    const turned = (/** @type {Option} */ one) => (dx * (one.x - x) + dy * (one.y - y)) / (Math.hypot(one.x - x, one.y - y) || 1);
    const ahead = options.filter((one) => turned(one) > 0.3).sort((a, b) => turned(b) - turned(a));
    if (ahead.length === 0) return;
    const now = ahead.findIndex((one) => one.x === this.selected?.x && one.y === this.selected.y);
    this.#select(ahead[(now + 1) % ahead.length]);
  }

  /** @param {Option} option */
  #select(option) {
    if (this.selected?.x !== option.x || this.selected.y !== option.y) this.words.textContent = `Selected: ${option.words}. Enter confirms.`;
    this.selected = option;
    this.app.needsPaint = true;
  }

  // -- the map ------------------------------------------------------------------------------------------------------

  /** Move the map so that the moves can be told apart. @param {Question} question */
  #lookAt(question) {
    const [x, y] = this.#placeOf(question);
    const others = this.#options(question).filter((one) => one.x !== x || one.y !== y);
    for (const { scene } of this.app.views) {
      const { camera } = scene, covered = this.#isAtBottom ? this.element.offsetHeight : 0;
      camera.insets.bottom = Math.max(camera.insets.bottom, covered + this.app.controls.bar.offsetHeight + 60 * Number(covered > 0));
      camera.covered = this.app.covered();
      if (camera.isFitted) camera.fit();
      const nearest = Math.min(...others.map((one) => Math.hypot(one.x - x, one.y - y))) * camera.scale;
      const margin = 12, top = margin + camera.insets.top, bottom = camera.height - camera.insets.bottom - margin;
      const isOut = [{ x, y }, ...others].some((one) => {
        const [px, py] = camera.toScreen(one.x, one.y);
        return px < margin || py < top || px > camera.width - margin || py > bottom;
      });
      if (!(nearest < LEAST_WAY_PX) && !isOut) continue;
      if (nearest < LEAST_WAY_PX) camera.zoom(WANTED_WAY_PX / Math.max(nearest, 0.1));
      camera.lookAt(x, y);
      camera.pan(0, -covered / 2);
    }
    this.app.moveCamera(() => {});
  }

  /** Mark the moves. @param {import("./scene.js").Scene} scene */
  #paint(scene) {
    const { question, selected } = this;
    if (question === undefined) return;
    const { to, camera } = scene;
    const [x, y] = this.#placeOf(question), [hx, hy] = camera.toScreen(x, y);
    const isDark = this.app.look.theme === "dark", ink = isDark ? "#ffd75e" : "#b0004e", paper = isDark ? "#171a1f" : "#ffffff";
    to.lineWidth = 2;
    to.strokeStyle = ink;
    if (selected !== null) {
      const [sx, sy] = camera.toScreen(selected.x, selected.y);
      to.lineWidth = 4;
      to.beginPath();
      to.moveTo(hx, hy);
      to.lineTo(sx, sy);
      to.stroke();
      to.lineWidth = 2;
    }
    if (question.moves === null) {
      to.setLineDash([6, 5]);
      ring(to, hx, hy, question.speed * camera.scale);
      to.setLineDash([]);
    }
    const marks = question.moves === null ? (selected === null ? [] : [selected]) : this.#options(question).filter((one) => one.move !== null);
    to.font = "bold 12px system-ui, sans-serif";
    to.textAlign = "center";
    to.textBaseline = "middle";
    marks.forEach((one, i) => {
      const [px, py] = camera.toScreen(one.x, one.y);
      const isSelected = selected?.x === one.x && selected.y === one.y, isHere = one.x === x && one.y === y;
      const radius = isHere ? Math.max((scene.discOf(question.agent)?.radius ?? 6) + 5, 11) : 11;
      to.fillStyle = isSelected ? ink : isHere ? "transparent" : faded(paper, 0.85);
      ring(to, px, py, radius);
      to.fill();
      to.stroke();
      if (isHere || i >= MOST_BUTTONS || question.moves === null) return;
      to.fillStyle = isSelected ? paper : ink;
      to.fillText(String(i), px, py + 0.5);
    });
  }

  /** Whether it covers the map below, as on phones. */
  get #isAtBottom() {
    return matchMedia("(max-width: 640px)").matches;
  }

  /** Show the time that is left. */
  #tick() {
    const { question } = this;
    const left = question === undefined ? 0 : Math.max(((this.ends.get(question.question) ?? 0) - performance.now()) / 1000, 0);
    this.clock.textContent = question === undefined ? "" : left > 90 ? `${Math.ceil(left / 60)} min` : `${Math.ceil(left)} s`;
    this.gauge.style.setProperty("--left", String(question === undefined ? 0 : left / (this.limits.get(question.question) ?? 1)));
    this.gauge.classList.toggle("short", left < 5);
  }
}

/** @param {CanvasRenderingContext2D} to @param {number} x @param {number} y @param {number} radius */
function ring(to, x, y, radius) {
  to.beginPath();
  to.arc(x, y, radius, 0, 2 * Math.PI);
  if (to.getLineDash().length) to.stroke();
}

/** Return what the body of a message says. @param {any} body */
function wordsOf(body) {
  const words = typeof body === "string" ? body : JSON.stringify(body);
  return words.length > MOST_LETTERS ? `${words.slice(0, MOST_LETTERS)}…` : words;
}

/** Return what an edge is called: its number, its length and its attributes. @param {{edge: number, length: number, attributes: Record<string, any>}} edge */
function wordsOfEdge({ edge, length, attributes }) {
  const known = Object.entries(attributes).filter(([, value]) => value !== false && value !== null).map(([name, value]) => (value === true ? name : `${name} ${wordsOf(value)}`));
  return [`edge ${edge}`, `${Math.round(length)} long`, ...known].join(", ");
}

/** Return which of the eight winds a direction is nearest to. @param {number} dx @param {number} dy */
function windOf(dx, dy) {
  return (Math.round(Math.atan2(dy, dx) / (Math.PI / 4)) + 8) % 8;
}

/** Make what a field of a deed is entered in. @param {string} key @param {Field} field @param {() => void} onChange */
function inputOf(key, field, onChange) {
  const properties = { "data-field": key, "aria-label": key, title: key, on: { change: onChange, input: onChange } };
  if (field.choices !== null || field.kind === "boolean") {
    const choices = field.choices ?? [true, false];
    const first = field.is_required ? [] : [element("option", { value: "", text: "–" })];
    return element("select", properties, ...first, ...choices.map((one, i) => element("option", { value: i, text: typeof one === "string" ? one : JSON.stringify(one) })));
  }
  const isNumber = ["node", "edge", "integer", "number"].includes(field.kind);
  return element("input", { type: isNumber ? "number" : "text", step: field.kind === "number" ? "any" : 1, placeholder: key, maxlength: 200, ...properties });
}

/** Return the value that is entered; null: none. @param {any} input @param {Field} field */
function valueOf(input, field) {
  if (input.value === "") return null;
  if (field.choices !== null || field.kind === "boolean") return (field.choices ?? [true, false])[Number(input.value)];
  return input.type === "number" ? Number(input.value) : input.value;
}
