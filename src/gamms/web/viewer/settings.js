// The buttons at the upper right: zoom, theme, what is shown, and the keys.
import { element, iconButton, refill } from "./dom.js";
import { IS_FRAMED, KEY_TABLE } from "./input.js";

const TRAILS = 12;

/** @typedef {import("./app.js").App} App */

export class Settings {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.menu = element("div", { class: "menu card", id: "look", hidden: true });
    this.keys = element("div", { class: "menu card", id: "keys", hidden: true }, element("h2", { text: "Keys" }),
      element("dl", {}, ...Object.entries(KEY_TABLE.help).flatMap(([words, keys]) => [element("dt", { text: IS_FRAMED ? keys.replace("wheel", "ctrl + wheel") : keys }), element("dd", { text: words })])));
    this.lookButton = iconButton("look", "What is shown", () => this.toggle(this.menu, this.lookButton), { "aria-expanded": "false", "aria-controls": "look" });
    this.keysButton = iconButton("help", "Keys (?)", () => this.toggle(this.keys, this.keysButton), { "aria-expanded": "false", "aria-controls": "keys", class: "wide" });
    const zoom = (/** @type {number} */ factor) => app.moveCamera((camera) => camera.zoom(factor));
    this.element = element("div", { class: "tools" },
      element("div", { class: "card toolbar", role: "toolbar", "aria-label": "View" },
        iconButton("plus", "Zoom in (+)", () => zoom(1.4), { class: "wide" }), iconButton("minus", "Zoom out (−)", () => zoom(1 / 1.4), { class: "wide" }),
        iconButton("fit", "See everything (0)", () => this.fit()), iconButton("theme", "Light or dark (N)", () => this.toggleTheme()), this.lookButton, this.keysButton,
        iconButton("panel", "Agents and events (P)", () => app.panel.toggle())),
      this.menu, this.keys);
    this.renew();
  }

  /** Show the whole map, and follow none. */
  fit() {
    this.app.isFollowing = false;
    this.app.moveCamera((camera) => camera.fit());
    this.app.panel.renew(true);
  }

  toggleTheme() {
    this.app.change({ theme: this.app.look.theme === "light" ? "dark" : "light" });
  }

  toggleTrails() {
    this.app.change({ trails: this.app.look.trails ? 0 : TRAILS });
  }

  toggleLabels() {
    const { scene } = this.app.views[0];
    const areShown = this.app.look.labels === true || (this.app.look.labels === "auto" && scene.discs.length <= 30);
    this.app.change({ labels: !areShown });
  }

  toggleKeys() {
    this.toggle(this.keys, this.keysButton);
  }

  /** Open a menu, or close it. @param {HTMLElement} menu @param {HTMLElement} button */
  toggle(menu, button) {
    const isOpen = menu.hidden;
    this.close();
    menu.hidden = !isOpen;
    button.setAttribute("aria-expanded", String(isOpen));
  }

  /** Close the menus. @returns {boolean} whether one was open */
  close() {
    const wasOpen = !this.menu.hidden || !this.keys.hidden;
    this.menu.hidden = this.keys.hidden = true;
    for (const button of [this.lookButton, this.keysButton]) button.setAttribute("aria-expanded", "false");
    return wasOpen;
  }

  /** Offer what this recording has. */
  renew() {
    const { app } = this;
    const { look } = app;
    const [{ replay }] = app.views;
    const { timeline } = replay;
    const sides = replay.sides();
    const hasSides = sides.length <= 20;
    const controls = () => /** @type {HTMLElement[]} */ ([...this.menu.querySelectorAll("input, select")]);
    const focused = controls().findIndex((one) => one === document.activeElement);
    refill(this.menu, element("h2", { text: "Show" }),
      this.#box("Names", look.labels === true || (look.labels === "auto" && replay.ways.length <= 30), (isOn) => app.change({ labels: isOn })),
      this.#box("Trails", look.trails > 0, (isOn) => app.change({ trails: isOn ? TRAILS : 0 })),
      timeline.hasSensed ? this.#box("What sensors see", look.sensors, (isOn) => app.change({ sensors: isOn })) : null,
      timeline.hasMessages ? this.#box("Messages", look.messages, (isOn) => app.change({ messages: isOn })) : null,
      timeline.hasSensed && hasSides && !app.options.audience ? this.#choice("Fog of war", look.fog, [[null, "none: all is seen"], ...sides.map((side) => /** @type {[string, string]} */ ([side, `as ${side} sees it`]))], (fog) => app.change({ fog })) : null,
      this.#choice("Heat map", look.heat, [[null, "none"], ["", "visits of all agents"], ...(hasSides ? sides.map((side) => /** @type {[string, string]} */ ([side, `visits of ${side}`])) : [])], (heat) => app.change({ heat })));
    controls()[focused]?.focus();
  }

  /** @param {string} words @param {boolean} isOn @param {(isOn: boolean) => void} onChange */
  #box(words, isOn, onChange) {
    const box = element("input", { type: "checkbox", on: { change: () => onChange(box.checked) } });
    box.checked = isOn;
    return element("label", {}, box, element("span", { text: words }));
  }

  /** @param {string} words @param {string | null} value @param {[string | null, string][]} choices @param {(value: string | null) => void} onChange */
  #choice(words, value, choices, onChange) {
    const menu = element("select", { on: { change: () => onChange(choices[menu.selectedIndex][0]) } }, ...choices.map(([one, text]) => element("option", { text, selected: one === value })));
    return element("label", { class: "choice" }, element("span", { text: words }), menu);
  }
}
