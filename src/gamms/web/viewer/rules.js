// What the shipped rules keep and do: flags, territories, goals, tags, and agents that go out.
import { faded } from "./themes.js";

const TINT = 70 / 255, BAND = 0.75;
const FLAG_PX = 26, ARM_PX = 7;
const MOST = 100; // flags, territories and goals
const MOST_RUNS = 20000; // in a text of nodes
const FEW_GOALS = 12;

/** @typedef {import("./scene.js").Scene} Scene @typedef {import("./themes.js").Theme} Theme */
/** @typedef {CanvasRenderingContext2D} Context */

/** Return the rows of the nodes in a text such as "0..41 57". @param {string} text @param {Map<number, number>} rowOf */
function rowsIn(text, rowOf) {
  const runs = String(text).split(" ").filter(Boolean).map((part) => part.split("..").map(Number)).map(([begin, end]) => [begin, end ?? begin]);
  const found = new Set();
  if (runs.length > MOST_RUNS) return found;
  const length = runs.reduce((sum, [begin, end]) => sum + Math.max(end - begin + 1, 0), 0);
  if (length > 4 * rowOf.size + 1000) {
    for (const [id, row] of rowOf) if (runs.some(([begin, end]) => begin <= id && id <= end)) found.add(row);
    return found;
  }
  for (const [begin, end] of runs) for (let id = begin; id <= end; id++) if (rowOf.has(id)) found.add(rowOf.get(id));
  return found;
}

/** Return the entries of a dict, at most some; none of anything else. @param {any} value @returns {[any, any][]} */
function entriesOf(value) {
  return value instanceof Map ? [...value].slice(0, MOST) : [];
}

/**
 * Return a faint band in the colour of its team along all streets of a territory.
 * @param {Scene} scene @param {Map<string, string>} colors @returns {import("./map_layer.js").Tint[]}
 */
export function territoriesOf(scene, colors) {
  const found = [];
  for (const [, owned] of entriesOf(scene.replay.state.data.get("territories"))) {
    for (const [team, text] of entriesOf(owned)) {
      const color = faded(colors.get(String(team)) ?? "#888888", TINT);
      found.push({ path: territory(scene, String(team), String(text)), color, width: BAND * scene.world.unit });
    }
  }
  return found;
}

/** @type {WeakMap<object, Map<string, {text: string, path: Path2D}>>} */
const territories = new WeakMap(); // of a map

/** Return the streets of a team, made once while they stay the same. @param {Scene} scene @param {string} team @param {string} text */
function territory(scene, team, text) {
  const { world, map } = scene;
  const ofWorld = territories.get(world) ?? new Map();
  territories.set(world, ofWorld);
  const known = ofWorld.get(team);
  if (known !== undefined && known.text === text) return known.path;
  const rows = rowsIn(text, world.rowOf);
  const path = new Path2D();
  for (const edge of world.streets) {
    if (!rows.has(world.sources[edge]) || !rows.has(world.targets[edge])) continue;
    const points = world.pointsOf(edge);
    path.moveTo(points[0] - map.origin[0], points[1] - map.origin[1]);
    for (let i = 2; i < points.length; i += 2) path.lineTo(points[i] - map.origin[0], points[i + 1] - map.origin[1]);
  }
  ofWorld.set(team, { text, path });
  return path;
}

/** The nodes that agents are to reach. @param {Context} to @param {Scene} scene @param {Map<string, string>} colors @param {Theme} theme */
export function paintGoals(to, scene, colors, theme) {
  const { world, camera } = scene;
  for (const [team, text] of entriesOf(scene.replay.state.data.get("goals of reach"))) {
    const rows = rowsIn(text, world.rowOf);
    const color = colors.get(String(team)) ?? "#888888";
    for (const row of rows) {
      const [x, y] = camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]);
      const rings = rows.size > FEW_GOALS ? [[4, 3]] : [[11, 2.5], [5.5, 2.5]];
      for (const [radius, width] of rings) {
        circle(to, x, y, radius, theme.background, width + 2);
        circle(to, x, y, radius, color, width);
      }
    }
  }
}

/** Flags where they are, or with the agents that carry them. @param {Context} to @param {Scene} scene @param {Map<string, string>} colors @param {Set<string>} hidden */
export function paintFlags(to, scene, colors, hidden) {
  const { world, camera } = scene;
  for (const [, kept] of entriesOf(scene.replay.state.data)) {
    if (!(kept instanceof Map) || !(kept.get("bases") instanceof Map) || !(kept.get("carriers") instanceof Map)) continue;
    for (const [team, base] of entriesOf(kept.get("bases"))) {
      const carrier = kept.get("carriers").get(team);
      const color = colors.get(String(team)) ?? "#888888";
      const row = world.rowOf.get(base);
      const home = row === undefined ? null : camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]);
      if (home !== null) circle(to, home[0], home[1], 8, color, 2.5);
      if (hidden.has(carrier)) continue;
      const disc = scene.discOf(carrier);
      if (disc !== undefined) pennant(to, disc.px, disc.py, color);
      else if (home !== null && (carrier === null || carrier === undefined)) {
        dot(to, home[0], home[1], 5, color);
        pennant(to, home[0], home[1], color);
      }
    }
  }
}

/** Crosses where agents were tagged or went out in this turn. @param {Context} to @param {Scene} scene @param {Map<string, string>} colors @param {Theme} theme @param {import("./scene.js").Look} look */
export function paintMarks(to, scene, colors, theme, look) {
  const { world, camera, replay } = scene;
  const sideOf = (/** @type {string} */ name) => {
    const agent = replay.state.byName.get(name);
    return agent === undefined ? "" : agent.team ?? agent.name;
  };
  for (const event of replay.state.log.events) {
    if (event.get("kind") !== "tag") continue;
    const row = world.rowOf.get(event.get("node"));
    if (row === undefined || (look.fog !== null && ![event.get("agent"), event.get("other")].some((name) => sideOf(name) === look.fog))) continue;
    const [x, y] = camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]);
    cross(to, x, y, colors.get(sideOf(event.get("agent"))) ?? "#888888", theme.background, true);
  }
  for (const name of replay.state.log.died) {
    const disc = scene.discOf(name) ?? null;
    const way = replay.ways.find((one) => one.name === name);
    if (way === undefined || (scene.visible !== null && !scene.visible.has(way.number))) continue;
    const [x, y] = disc ? [disc.px, disc.py] : camera.toScreen(way.points[way.points.length - 2], way.points[way.points.length - 1]);
    cross(to, x, y, colors.get(sideOf(name)) ?? "#888888", theme.background, false);
  }
}

/** @param {Context} to @param {number} x @param {number} y @param {string} color @param {string} background @param {boolean} isRinged */
function cross(to, x, y, color, background, isRinged) {
  for (const [ink, width] of /** @type {[string, number][]} */ ([[background, 6], [color, 3]])) {
    if (isRinged) circle(to, x, y, 1.5 * ARM_PX, ink, width);
    to.beginPath();
    to.moveTo(x - ARM_PX, y - ARM_PX);
    to.lineTo(x + ARM_PX, y + ARM_PX);
    to.moveTo(x - ARM_PX, y + ARM_PX);
    to.lineTo(x + ARM_PX, y - ARM_PX);
    to.strokeStyle = ink;
    to.lineWidth = width;
    to.stroke();
  }
}

/** @param {Context} to @param {number} x @param {number} y @param {string} color */
function pennant(to, x, y, color) {
  to.strokeStyle = to.fillStyle = color;
  to.lineWidth = 2.5;
  to.beginPath();
  to.moveTo(x, y);
  to.lineTo(x, y - FLAG_PX);
  to.stroke();
  to.beginPath();
  to.moveTo(x, y - FLAG_PX);
  to.lineTo(x + 0.7 * FLAG_PX, y - 0.75 * FLAG_PX);
  to.lineTo(x, y - 0.5 * FLAG_PX);
  to.fill();
}

/** @param {Context} to @param {number} x @param {number} y @param {number} radius @param {string} color @param {number} width */
function circle(to, x, y, radius, color, width) {
  to.beginPath();
  to.arc(x, y, radius, 0, 2 * Math.PI);
  to.strokeStyle = color;
  to.lineWidth = width;
  to.stroke();
}

/** @param {Context} to @param {number} x @param {number} y @param {number} radius @param {string} color */
function dot(to, x, y, radius, color) {
  to.beginPath();
  to.arc(x, y, radius, 0, 2 * Math.PI);
  to.fillStyle = color;
  to.fill();
}
