// Paint draw commands (ir/draw.py) on a canvas: signs of rules, and what artists of a program drew.
import { Camera } from "./camera.js";
import { rgba } from "./themes.js";
import { interleaved } from "./values.js";

const CIRCLE = 1, RECTANGLE = 2, LINE = 3, POLYGON = 4, TEXT = 5;
const SCREEN = 1;
const LETTERS = 0.69; // of the font height that pygame counts
const FARTHEST = 1e5; // pixels from the view: what is all beyond is not painted

/**
 * @typedef {{kind: ArrayLike<number>, space: ArrayLike<number>, size: ArrayLike<number>, width: ArrayLike<number>,
 *   angle: ArrayLike<number>, style: ArrayLike<number>, counts: ArrayLike<number>, points: ArrayLike<number>, text: string[],
 *   agents: string[], sides: (string[] | null)[], inks: string[]}} Commands `inks` are the colors of the styles
 * @typedef {(agent: string | undefined, sides: string[] | null | undefined, x: number, y: number) => [number, number] | null} Shift
 *   by how many pixels a command is moved that belongs to an agent or to some sides and is at a place; null: it is not shown
 */

/** Return the commands of a drawing in the colors of a theme. @param {Map<string, any>} drawing @param {string} theme @returns {Commands} */
export function commandsOf(drawing, theme) {
  const recorded = drawing.get("commands"), colors = drawing.get("colors").get(theme);
  const columns = Object.fromEntries(["kind", "space", "size", "width", "angle", "style", "counts"].map((name) => [name, recorded.get(name)]));
  const inks = Array.from({ length: colors.length / 4 }, (_, i) => rgba(colors.subarray(4 * i, 4 * i + 4)));
  return /** @type {Commands} */ ({ ...columns, inks, points: pointsOf(drawing, recorded.get("points")), text: recorded.get("text") ?? [], agents: recorded.get("agents") ?? [], sides: recorded.get("sides") ?? [] });
}

/** Return the points of a drawing as x, y, x, y, … @param {Map<string, any>} drawing @param {ArrayLike<number>} columns all x, then all y */
export function pointsOf(drawing, columns) {
  return interleaved(columns, 2, drawing.get("commands").get("step"));
}

/**
 * Paint commands from back to front.
 * @param {CanvasRenderingContext2D} to @param {Commands} commands @param {Camera} camera @param {Shift} shift of those that belong to somebody
 */
export function paintCommands(to, commands, camera, shift) {
  const { kind, counts, agents, sides, points } = commands;
  to.lineCap = to.lineJoin = "round";
  for (let row = 0, at = 0; row < kind.length; ) {
    const end = kind[row] === LINE ? endOfStroke(commands, row) : row + 1;
    const moved = agents[row] || sides[row] ? shift(agents[row], sides[row], points[2 * at], points[2 * at + 1]) : [0, 0];
    if (moved !== null) {
      to.translate(moved[0], moved[1]);
      paintAlike(to, commands, camera, row, end, at);
      to.translate(-moved[0], -moved[1]);
    }
    for (; row < end; row++) at += counts[row];
  }
}

/** Return the boxes of signs, which have sizes in pixels: left, top, right, bottom. @param {Commands} commands @param {Camera} camera @param {Shift} shift @returns {number[][]} */
export function signBoxes({ kind, space, size, width, counts, points, agents, sides }, camera, shift) {
  const found = [];
  for (let row = 0, at = 0; row < kind.length; at += counts[row++]) {
    if (kind[row] !== CIRCLE && (kind[row] !== POLYGON || space[row] !== SCREEN)) continue;
    const moved = agents[row] || sides[row] ? shift(agents[row], sides[row], points[2 * at], points[2 * at + 1]) : [0, 0];
    if (moved === null) continue;
    const [x, y] = camera.toScreen(points[2 * at], points[2 * at + 1]);
    const corners = counts[row] > 1 ? Array.from(points).slice(2 * at + 2, 2 * (at + counts[row])) : [0, 0];
    const across = corners.filter((_, i) => i % 2 === 0), down = corners.filter((_, i) => i % 2 === 1);
    const reach = (kind[row] === CIRCLE ? size[row] * (space[row] === SCREEN ? 1 : camera.scale) : 0) + width[row] / 2;
    const [left, top] = [x + moved[0] - reach, y + moved[1] - reach], [right, bottom] = [x + moved[0] + reach, y + moved[1] + reach];
    found.push([left + Math.min(...across), top + Math.min(...down), right + Math.max(...across), bottom + Math.max(...down)]);
  }
  return found;
}

/** Return the row behind the lines of one look that begin in a row: they are one stroke, blended once. */
function endOfStroke(/** @type {Commands} */ { kind, space, width, style, agents, sides }, /** @type {number} */ row) {
  const same = (/** @type {number} */ i) => kind[i] === LINE && space[i] === space[row] && width[i] === width[row] && style[i] === style[row] && agents[i] === agents[row] && sides[i] === sides[row];
  let end = row + 1;
  while (end < kind.length && same(end)) end++;
  return end;
}

/** Paint commands of one look. */
function paintAlike(/** @type {CanvasRenderingContext2D} */ to, /** @type {Commands} */ commands, /** @type {Camera} */ camera, /** @type {number} */ row, /** @type {number} */ end, /** @type {number} */ at) {
  const { kind, space, size, width, style, counts, points, text } = commands;
  const unit = space[row] === SCREEN ? 1 : camera.scale;
  const [x, y] = camera.toScreen(points[2 * at], points[2 * at + 1]);
  to.fillStyle = to.strokeStyle = commands.inks[style[row]];
  to.lineWidth = width[row] * (kind[row] === LINE ? unit : 1);
  if (kind[row] === LINE) {
    to.beginPath();
    for (let i = row; i < end; at += counts[i++]) addLine(to, camera, points, at, counts[i]);
    to.stroke();
  } else if (kind[row] === POLYGON) {
    to.beginPath();
    if (space[row] === SCREEN) addCorners(to, x, y, points, at + 1, counts[row] - 1);
    else addLine(to, camera, points, at, counts[row]);
    to.closePath();
    if (width[row]) to.stroke();
    else to.fill("evenodd");
  } else if (Math.abs(x) > FARTHEST || Math.abs(y) > FARTHEST) {
    return;
  } else if (kind[row] === CIRCLE) {
    const [right, down] = counts[row] > 1 ? [points[2 * at + 2], points[2 * at + 3]] : [0, 0];
    to.beginPath();
    to.arc(x + right, y + down, Math.min(size[row] * unit, FARTHEST), 0, 2 * Math.PI);
    if (width[row]) to.stroke();
    else to.fill();
  } else if (kind[row] === RECTANGLE) {
    const [wide, high] = [points[2 * at + 2] * unit, points[2 * at + 3] * unit];
    if (width[row]) to.strokeRect(x, y, wide, high);
    else to.fillRect(x, y, wide, high);
  } else if (kind[row] === TEXT) {
    paintText(to, text[row] ?? "", x, y, size[row] * unit, commands.angle[row]);
  }
}

/** @param {CanvasRenderingContext2D} to @param {Camera} camera @param {ArrayLike<number>} points @param {number} at @param {number} count */
function addLine(to, camera, points, at, count) {
  for (let i = at; i < at + count; i++) {
    const [x, y] = camera.toScreen(points[2 * i], points[2 * i + 1]);
    if (i === at) to.moveTo(x, y);
    else to.lineTo(x, y);
  }
}

/** Add corners that are pixels right of a place and below it. @param {CanvasRenderingContext2D} to @param {number} x @param {number} y @param {ArrayLike<number>} points @param {number} at @param {number} count */
function addCorners(to, x, y, points, at, count) {
  for (let i = at; i < at + count; i++) to.lineTo(x + points[2 * i], y + points[2 * i + 1]);
}

/** @param {CanvasRenderingContext2D} to @param {string} words @param {number} x @param {number} y @param {number} height @param {number} angle */
function paintText(to, words, x, y, height, angle) {
  to.save();
  to.translate(x, y);
  to.rotate((-angle * Math.PI) / 180);
  to.font = `${Math.min(height * LETTERS, 1000)}px system-ui, sans-serif`;
  to.textBaseline = "top";
  to.fillText(words, 0, 0);
  to.restore();
}
