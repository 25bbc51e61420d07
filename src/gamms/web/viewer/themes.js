// Colours of the light and the dark theme: those of GAMMS's pictures (visual/themes.py).

/**
 * @typedef {object} Theme
 * @property {string} name @property {string} background @property {string} ink @property {string} faint @property {string} card
 * @property {string} streets @property {string} nodes @property {[number[], number[]]} walls of the lowest and the highest buildings
 * @property {string} outline @property {string} wall @property {string} green @property {string} water @property {string} waterway
 * @property {string} rail @property {string[]} fog of streets that a team has never seen, has seen, and sees @property {string[]} teams
 */

/** @type {Record<"light" | "dark", Theme>} */
export const THEMES = {
  light: {
    name: "light", background: "#fcfcfa", ink: "#2d3036", faint: "#70747c", card: "rgba(255,255,255,.9)",
    streets: "#a5a8ac", nodes: "#8c8f94", walls: [[240, 236, 228], [206, 197, 181]], outline: "#c1b8a8", wall: "#8b806e",
    green: "#e7efde", water: "#d5e3ec", waterway: "#c4d7e4", rail: "#cec6cc", fog: ["#ebeced", "#cdcfd3", "#878b92"],
    teams: ["#1450a5", "#d03028", "#1e9c5c", "#ce8cba", "#f0ac28", "#7dd7fa"],
  },
  dark: {
    name: "dark", background: "#171a1f", ink: "#e4e6ea", faint: "#969ba4", card: "rgba(38,42,50,.92)",
    streets: "#707784", nodes: "#7a818e", walls: [[37, 40, 45], [70, 68, 66]], outline: "#565451", wall: "#8c8274",
    green: "#1c2620", water: "#1a2736", waterway: "#223346", rail: "#3e3a42", fog: ["#2a2d33", "#686d76", "#ced2d8"],
    teams: ["#3272d0", "#e65044", "#3cac6c", "#de9ecc", "#f6be4c", "#96e2fc"],
  },
};
const NAMED = new Map([["blue", 0], ["red", 1], ["green", 2], ["pink", 3], ["purple", 3], ["orange", 4], ["yellow", 4], ["cyan", 5]]);

/**
 * Return a colour for each team: its own where it is named after one, else the next that is left.
 * @param {Iterable<string>} teams @param {Theme} theme @param {Map<string, ArrayLike<number>>} given
 * @returns {Map<string, string>}
 */
export function teamColors(teams, theme, given) {
  const names = [...new Set(teams)];
  const found = new Map();
  for (const name of names) {
    const own = given.get(name), named = NAMED.get(name.toLowerCase());
    if (own !== undefined) found.set(name, rgba(own));
    else if (named !== undefined) found.set(name, theme.teams[named]);
  }
  const taken = new Set(found.values());
  const free = theme.teams.filter((color) => !taken.has(color));
  const left = free.length ? free : theme.teams;
  names.filter((name) => !found.has(name)).forEach((name, i) => found.set(name, left[i % left.length]));
  return found;
}

/** Return a colour of three or four parts from 0 to 255 as CSS. @param {ArrayLike<number>} color @param {number} [alpha] */
export function rgba(color, alpha = color.length > 3 ? color[3] / 255 : 1) {
  return `rgba(${color[0] | 0},${color[1] | 0},${color[2] | 0},${alpha})`;
}

/** Return whether a colour #rrggbb or rgb(…) is bright, so that what is on it is dark. @param {string} color */
export function isBright(color) {
  const [red, green, blue] = color.startsWith("#")
    ? [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16))
    : (color.match(/[\d.]+/g) ?? []).map(Number);
  return 0.299 * red + 0.587 * green + 0.114 * blue > 170;
}

/** Return a colour between two. @param {number[]} low @param {number[]} high @param {number} share */
export function between(low, high, share) {
  return `rgb(${low.map((part, i) => Math.round(part + share * (high[i] - part))).join(",")})`;
}

/** Return a CSS colour with another alpha. @param {string} color @param {number} alpha */
export function faded(color, alpha) {
  const parts = color.startsWith("#") ? [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16)) : (color.match(/[\d.]+/g) ?? []).slice(0, 3).map(Number);
  return rgba(parts, alpha);
}
