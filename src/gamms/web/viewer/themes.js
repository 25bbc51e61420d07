// Colors of the light and the dark theme, which Python has put into the page, and what is made of colors.

/**
 * @typedef {object} Theme
 * @property {string} name @property {string} background @property {string} ink @property {string} faint @property {string} card
 * @property {string} streets @property {string} nodes @property {[number[], number[]]} walls of the lowest and the highest buildings
 * @property {string} outline @property {string} wall @property {string} land @property {string} green @property {string} water @property {string} waterway
 * @property {string} rail @property {string[]} fog of streets that a team has never seen, has seen, and sees
 */

/** @type {Record<"light" | "dark", Theme>} */
export const THEMES = JSON.parse(document.getElementById("themes")?.textContent ?? "{}");

/** Return a color of three or four parts from 0 to 255 as CSS. @param {ArrayLike<number>} color @param {number} [alpha] */
export function rgba(color, alpha = color.length > 3 ? color[3] / 255 : 1) {
  return `rgba(${color[0] | 0},${color[1] | 0},${color[2] | 0},${alpha})`;
}

/** Return whether a color #rrggbb or rgb(…) is bright, so that what is on it is dark. @param {string} color */
export function isBright(color) {
  const [red, green, blue] = color.startsWith("#")
    ? [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16))
    : (color.match(/[\d.]+/g) ?? []).map(Number);
  return 0.299 * red + 0.587 * green + 0.114 * blue > 170;
}

/** Return a color between two. @param {number[]} low @param {number[]} high @param {number} share */
export function between(low, high, share) {
  return `rgb(${low.map((part, i) => Math.round(part + share * (high[i] - part))).join(",")})`;
}

/** Return a CSS color with another alpha. @param {string} color @param {number} alpha */
export function faded(color, alpha) {
  const parts = color.startsWith("#") ? [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16)) : (color.match(/[\d.]+/g) ?? []).slice(0, 3).map(Number);
  return rgba(parts, alpha);
}
