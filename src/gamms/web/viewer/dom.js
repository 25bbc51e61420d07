// Elements of the page. Whatever a recording says becomes text, never markup.

const SVG = "http://www.w3.org/2000/svg";
const ICONS = {
  play: "M7 4.5v15l12-7.5z", pause: "M7 5h3.5v14H7zM13.5 5H17v14h-3.5z",
  back: "M18 5v14l-9-7zM6 5h2.5v14H6z", next: "M6 5v14l9-7zM15.5 5H18v14h-2.5z",
  plus: "M11 5h2v6h6v2h-6v6h-2v-6H5v-2h6z", minus: "M5 11h14v2H5z",
  fit: "M4 4h6v2H6v4H4zM14 4h6v6h-2V6h-4zM4 14h2v4h4v2H4zM18 14h2v6h-6v-2h4z",
  theme: "M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18zm0 2v14a7 7 0 0 1 0-14z",
  panel: "M4 5h16v14H4zM6 7v10h7V7zM15 7v10h3V7z",
  look: "M4 7h9v2H4zM17 7h3v2h-3zM14 5h2v6h-2zM4 15h3v2H4zM11 15h9v2h-9zM8 13h2v6H8z",
  help: "M11 17h2v2h-2zM12 5a4 4 0 0 0-4 4h2a2 2 0 1 1 2.6 1.9c-1 .35-1.6 1.2-1.6 2.2V15h2v-1.9c0-.1.1-.2.2-.3A4 4 0 0 0 12 5z",
  close: "M6.4 5 12 10.6 17.6 5 19 6.4 13.4 12l5.6 5.6-1.4 1.4L12 13.4 6.4 19 5 17.6 10.6 12 5 6.4z",
};

/**
 * Make an element.
 * @param {string} tag @param {Record<string, any>} [properties] attributes; `text`, `on` and `style` are special
 * @param {...(Node | string | null)} children
 * @returns {any}
 */
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === "text") made.textContent = value;
    else if (name === "on") for (const [kind, listener] of Object.entries(value)) made.addEventListener(kind, /** @type {EventListener} */ (listener));
    else if (name === "style") for (const [key, one] of Object.entries(value)) made.style.setProperty(key, String(one));
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, String(value));
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

/** Make a picture of an icon. @param {keyof typeof ICONS} name */
export function icon(name) {
  const made = document.createElementNS(SVG, "svg");
  made.setAttribute("viewBox", "0 0 24 24");
  made.setAttribute("aria-hidden", "true");
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", ICONS[name]);
  path.setAttribute("fill-rule", "evenodd");
  made.append(path);
  return made;
}

/** Make a button with an icon. @param {keyof typeof ICONS} name @param {string} label @param {() => void} onClick @param {Record<string, any>} [properties] */
export function iconButton(name, label, onClick, properties = {}) {
  return element("button", { type: "button", "aria-label": label, title: label, on: { click: onClick }, ...properties }, icon(name));
}

/** Make a disc in a color. @param {string | undefined} color */
export function dot(color) {
  return element("span", { class: "dot", "aria-hidden": "true", style: { background: color ?? "transparent" } });
}

/** Put other children into an element. @param {Element} parent @param {...(Node | string | null)} children */
export function refill(parent, ...children) {
  parent.replaceChildren(.../** @type {any[]} */ (children.filter((child) => child !== null)));
}
