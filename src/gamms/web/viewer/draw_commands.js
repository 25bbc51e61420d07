// Paint draw commands (ir/draw.py) on a canvas: what artists of a program's own drew, in any order and unit.
import { Camera } from "./camera.js";
import { rgba } from "./themes.js";

const CIRCLE = 1, RECTANGLE = 2, LINE = 3, POLYGON = 4, TEXT = 5;
const SCREEN = 1;
const LETTERS = 0.69; // of the font height that pygame counts
const FARTHEST = 1e5; // pixels from the view: what is all beyond is not painted

/**
 * @typedef {{kind: ArrayLike<number>, space: ArrayLike<number>, size: ArrayLike<number>, width: ArrayLike<number>,
 *   angle: ArrayLike<number>, color: ArrayLike<number>, counts: ArrayLike<number>, points: ArrayLike<number>, text: string[]}} Commands
 */

/** Return the columns of recorded commands. @param {Map<string, any>} recorded @returns {Commands} */
export function commandsOf(recorded) {
  const columns = Object.fromEntries(["kind", "space", "size", "width", "angle", "color", "counts", "points"].map((name) => [name, recorded.get(name)]));
  return /** @type {Commands} */ ({ ...columns, text: recorded.get("text") ?? [] });
}

/**
 * Paint commands from back to front.
 * @param {CanvasRenderingContext2D} to @param {Commands} commands @param {Camera} camera
 */
export function paintCommands(to, commands, camera) {
  const { kind, counts } = commands;
  to.lineCap = to.lineJoin = "round";
  for (let row = 0, at = 0; row < kind.length; ) {
    const end = kind[row] === LINE ? endOfStroke(commands, row) : row + 1;
    let points = 0;
    for (let i = row; i < end; i++) points += counts[i];
    paintAlike(to, commands, camera, row, end, at);
    at += points;
    row = end;
  }
}

/** Return the row behind the lines of one look that begin in a row: they are one stroke, blended once. */
function endOfStroke(/** @type {Commands} */ { kind, space, width, color }, /** @type {number} */ row) {
  const same = (/** @type {number} */ i) => kind[i] === LINE && space[i] === space[row] && width[i] === width[row] && [0, 1, 2, 3].every((k) => color[4 * i + k] === color[4 * row + k]);
  let end = row + 1;
  while (end < kind.length && same(end)) end++;
  return end;
}

/** Paint commands of one look. */
function paintAlike(/** @type {CanvasRenderingContext2D} */ to, /** @type {Commands} */ commands, /** @type {Camera} */ camera, /** @type {number} */ row, /** @type {number} */ end, /** @type {number} */ at) {
  const { kind, space, size, width, color, counts, points, text } = commands;
  const ink = rgba([0, 1, 2, 3].map((k) => color[4 * row + k]));
  const unit = space[row] === SCREEN ? 1 : camera.scale;
  const [x, y] = camera.toScreen(points[2 * at], points[2 * at + 1]);
  to.fillStyle = to.strokeStyle = ink;
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
    else to.fill("nonzero");
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
