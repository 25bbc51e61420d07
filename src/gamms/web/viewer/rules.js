// What the shipped rules keep and do: flags, territories, goals, tags, and agents that go out or arrive.
import { teamText } from "./state.js";
import { placeOf } from "./motion.js";
import { faded } from "./themes.js";

const TINT = 70 / 255, BAND = 0.75;
const FLAG_PX = 26, ARM_PX = 7, RING_PX = 8.5;
const STEP_PX = 20, ROW_PX = 40, DOWN_PX = 16.5; // between marks of a row, at each side of its middle, and from the disc to them
export const MARK_PX = 28; // how far marks reach below a disc
const TAG_TURNS = 5, PALE = 150 / 255; // for which a tag is shown; marks of earlier turns
const CROSS = [[[-1, -1], [1, 1]], [[1, -1], [-1, 1]]];
const LINES = { cross: CROSS, tag: CROSS, tick: [[[-1, 0.1], [-0.3, 0.8], [1, -0.8]]] };
const MOST = 100; // flags, territories and goals
const MOST_RUNS = 20000; // in a text of nodes
const FEW_GOALS = 12;
const PLACE_PX = 20, WIDER_PX = 4, ARC_PX = 5, BAR_PX = 26;

/** @typedef {import("./scene.js").Scene} Scene @typedef {import("./themes.js").Theme} Theme */
/** @typedef {CanvasRenderingContext2D} Context */
/** @typedef {"cross" | "tag" | "tick"} Sign */
/** @typedef {{name: string, px: number, py: number, radius: number, sign: Sign, color: string}} Mark where it is painted, and how much around it is kept clear */

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

/** Places of the rule `hold`: rings, on which an arc grows while a team holds them. @param {Context} to @param {Scene} scene @param {Map<string, string>} colors @param {Theme} theme */
export function paintHeld(to, scene, colors, theme) {
  for (const [, state] of entriesOf(scene.replay.state.data.get("held"))) {
    if (!(state instanceof Map)) continue;
    const share = Math.min(Math.max(state.get("turns") / Math.max(state.get("of"), 1), 0), 1);
    const color = state.get("team") === null ? theme.faint : colors.get(teamText(state.get("team")) ?? "") ?? theme.faint;
    for (const [x, y] of placesOf(scene, state.get("nodes"))) {
      circle(to, x, y, PLACE_PX, theme.background, 4);
      circle(to, x, y, PLACE_PX, theme.faint, 2);
      if (share > 0) arc(to, x, y, PLACE_PX, share, color, ARC_PX);
    }
  }
}

/** Nodes of the rule `discover`: a square, and one in the colour of each team that has found it. @param {Context} to @param {Scene} scene @param {Map<string, string>} colors @param {Theme} theme @param {import("./scene.js").Look} look */
export function paintDiscovered(to, scene, colors, theme, look) {
  for (const [, state] of entriesOf(scene.replay.state.data.get("discovered"))) {
    if (!(state instanceof Map)) continue;
    for (const [x, y] of look.fog === null ? placesOf(scene, state.get("nodes")) : []) {
      square(to, x, y, PLACE_PX, theme.background, 4);
      square(to, x, y, PLACE_PX, theme.faint, 2);
    }
    entriesOf(state.get("by")).forEach(([team, ids], i) => {
      if (look.fog !== null && teamText(team) !== look.fog) return;
      for (const [x, y] of placesOf(scene, ids)) square(to, x, y, PLACE_PX + WIDER_PX * i, colors.get(teamText(team) ?? "") ?? theme.faint, 3);
    });
  }
}

/** What agents have left by the rule `resource`, as bars below them, and deeds that they cannot do again yet, as arcs. @param {Context} to @param {Scene} scene @param {Theme} theme @param {import("./scene.js").Look} look */
export function paintAmounts(to, scene, theme, look) {
  const { data } = scene.replay.state;
  if (scene.discs.length > MOST) return; // too many to read
  const own = (/** @type {string} */ name) => {
    const disc = scene.discOf(name);
    return disc === undefined || (look.fog !== null && disc.side !== look.fog) ? undefined : disc;
  };
  entriesOf(data.get("resources")).forEach(([, state], i) => {
    if (!(state instanceof Map) || !(state.get("full") > 0)) return;
    for (const [name, amount] of entriesOf(state.get("amounts"))) {
      const disc = own(name);
      if (disc === undefined || typeof amount !== "number") continue;
      const [x, y] = [disc.px - BAR_PX / 2, disc.py + disc.radius + 5 + 6 * i];
      for (const [length, color, more] of /** @type {[number, string, number][]} */ ([[1, theme.background, 3], [1, theme.faint, 0], [Math.min(Math.max(amount / state.get("full"), 0), 1), disc.color, 0]])) {
        to.fillStyle = color;
        to.fillRect(x - more / 2, y - more / 2, length * BAR_PX + more, 4 + more);
      }
    }
  });
  entriesOf(data.get("cooldowns")).forEach(([, state], i) => {
    for (const [name, turns] of state instanceof Map ? entriesOf(state.get("left")) : []) {
      const disc = own(name);
      if (disc !== undefined && turns > 0) arc(to, disc.px, disc.py, disc.radius + 4 + 4 * i, Math.min(turns / Math.max(state.get("of"), 1), 1), theme.faint, 3);
    }
  });
}

/** Return what an agent has left of each resource, and of each deed for how many turns it is not ready. @param {Map<any, any>} data @param {string} name @returns {[string, any][]} */
export function amountsOf(data, name) {
  const left = (/** @type {string} */ group, /** @type {string} */ field) => entriesOf(data.get(group)).map(([key, state]) => [String(key), state instanceof Map ? state.get(field)?.get?.(name) : undefined]);
  const found = [...left("resources", "amounts").map(([key, amount]) => [`${key} left`, amount]), ...left("cooldowns", "left").map(([key, turns]) => [`${key} not ready`, turns ? `${turns} turns` : undefined])];
  return /** @type {[string, any][]} */ (found.filter(([, value]) => value !== undefined));
}

/** Return the pixels of nodes, given as ids or as a text of them. @param {Scene} scene @param {any} nodes @returns {[number, number][]} */
function placesOf(scene, nodes) {
  const { world, camera } = scene;
  const ids = Array.isArray(nodes) || ArrayBuffer.isView(nodes) ? Array.from(/** @type {ArrayLike<number>} */ (/** @type {any} */ (nodes))) : null;
  const rows = ids === null ? [...rowsIn(nodes ?? "", world.rowOf)] : ids.flatMap((id) => world.rowOf.get(id) ?? []);
  return rows.map((row) => camera.toScreen(world.xy[2 * row], world.xy[2 * row + 1]));
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

/**
 * Marks of agents that are out, crosses or, for those that arrived, ticks, and of those that were tagged in the last turns,
 * in a row below each place so that they cross out no agent.
 * @param {Context} to @param {Scene} scene @param {Map<string, string>} colors @param {Theme} theme @param {import("./scene.js").Look} look
 * @returns {Mark[]}
 */
export function paintMarks(to, scene, colors, theme, look) {
  const { world, replay } = scene;
  const { state, overview } = replay;
  /** @type {{name: string, turn: number, x: number, y: number, sign: Sign}[]} */
  const found = [];
  for (const agent of state.agents.values()) {
    const end = agent.alive || !(scene.visible?.has(agent.number) ?? true) ? undefined : overview.endOf(agent.name, state.turn);
    const [x, y] = placeOf(world, agent);
    if (end !== undefined && Number.isFinite(x)) found.push({ name: agent.name, turn: end.turn, x, y, sign: end.hasArrived ? "tick" : "cross" });
  }
  found.sort((a, b) => a.turn - b.turn);
  const out = new Set(found.map((mark) => mark.name));
  const recent = overview.tags.filter(({ turn }) => turn > state.turn - TAG_TURNS && turn <= state.turn).reverse();
  const seen = new Set();
  for (const { turn, node, agent, other } of recent) {
    const row = world.rowOf.get(node), key = `${node} ${other}`;
    const isOpen = look.fog === null || [agent, other].some((name) => replay.sideOf(name) === look.fog);
    if (row === undefined || !isOpen || out.has(other) || seen.has(key) || !state.byName.has(other)) continue;
    seen.add(key);
    found.push({ name: other, turn, x: world.xy[2 * row], y: world.xy[2 * row + 1], sign: "tag" });
  }
  /** @type {Map<string, number>} */ const sizes = new Map(); // of rows
  const marks = found.map((mark) => {
    const key = `${mark.x} ${mark.y}`, number = sizes.get(key) ?? 0;
    sizes.set(key, number + 1);
    return { ...mark, key, number };
  }).map(({ name, turn, x, y, sign, key, number }) => {
    const step = Math.min(STEP_PX, ROW_PX / Math.max(Math.floor((sizes.get(key) ?? 1) / 2), 1));
    const [px, py] = scene.camera.toScreen(x, y), right = Math.ceil(number / 2) * step * (number % 2 ? 1 : -1); // from the middle outwards
    const color = colors.get(replay.sideOf(name)) ?? "#888888";
    return { name, px: px + right, py: py + scene.discPx + DOWN_PX, radius: STEP_PX / 2, sign, color: turn === state.turn ? color : faded(color, PALE) };
  });
  for (const isEdge of [true, false]) for (const mark of marks) paintSign(to, mark, isEdge ? theme.background : mark.color, isEdge ? 6 : 3);
  return marks;
}

/** @param {Context} to @param {Mark} mark @param {string} ink @param {number} width */
function paintSign(to, { px, py, sign }, ink, width) {
  to.lineCap = to.lineJoin = "round";
  if (sign === "tag") circle(to, px, py, RING_PX, ink, width);
  const arm = sign === "tag" ? 0.6 * ARM_PX : ARM_PX;
  to.beginPath();
  for (const line of LINES[sign]) line.forEach(([x, y], i) => (i ? to.lineTo(px + arm * x, py + arm * y) : to.moveTo(px + arm * x, py + arm * y)));
  to.strokeStyle = ink;
  to.lineWidth = width;
  to.stroke();
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

/** A part of a circle, from the top on and clockwise. @param {Context} to @param {number} x @param {number} y @param {number} radius @param {number} share @param {string} color @param {number} width */
function arc(to, x, y, radius, share, color, width) {
  to.beginPath();
  to.arc(x, y, radius, -Math.PI / 2, (2 * share - 0.5) * Math.PI);
  to.strokeStyle = color;
  to.lineWidth = width;
  to.lineCap = "butt";
  to.stroke();
}

/** A square that stands on a corner. @param {Context} to @param {number} x @param {number} y @param {number} radius @param {string} color @param {number} width */
function square(to, x, y, radius, color, width) {
  to.beginPath();
  to.moveTo(x, y - radius);
  for (const [dx, dy] of [[1, 0], [0, 1], [-1, 0]]) to.lineTo(x + dx * radius, y + dy * radius);
  to.closePath();
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
