// Where labels stand: agents whose discs touch share one, beside them or at the end of a line.

/** @typedef {{px: number, py: number, radius: number}} Dot */

const SIDES = [[1, -1], [1, 1], [1, 0], [-1, -1], [-1, 1], [-1, 0], [0, -1], [0, 1]]; // the order in which they are tried
const GAPS = [4, 13, 28]; // pixels from the discs; a line leads to the last of these places
const CORNER = 0.75; // share of the distance at corners, where a disc does not fill its square
const LINE = 15, HALF = 8, INDENT = 12, MOST_LINES = 5;

/** Return dots in groups: each joins the first group whose first dot it touches. @template {Dot} T @param {T[]} dots @returns {T[][]} */
export function knotsOf(dots) {
  /** @type {T[][]} */
  const knots = [];
  for (const dot of dots) {
    const near = knots.find(([first]) => Math.hypot(dot.px - first.px, dot.py - first.py) < dot.radius + first.radius);
    if (near === undefined) knots.push([dot]);
    else near.push(dot);
  }
  return knots;
}

/**
 * Return where the label of a knot stands: its box, the middles of its lines, the width of its bullets and the line to it.
 * @param {Dot[]} knot @param {number[]} widths of its lines @param {Dot[]} dots that no label covers @param {number[][]} taken boxes
 * @param {{width: number, height: number}} page @param {boolean} must whether it is shown even without a free place
 * @returns {{box: number[], middles: number[], indent: number, leader: [number, number][]} | null}
 */
export function placeOf(knot, widths, dots, taken, page, must) {
  const count = widths.length > MOST_LINES + 1 ? MOST_LINES + 1 : widths.length;
  const indent = count > 1 ? INDENT : 0;
  const width = indent + Math.max(...widths.slice(0, count)), height = 2 * HALF + (count - 1) * LINE;
  const own = around(knot), others = dots.filter((dot) => !knot.includes(dot)).map((dot) => around([dot]));
  const [x, y] = [(own[0] + own[2]) / 2, (own[1] + own[3]) / 2], [across, down] = [(own[2] - own[0]) / 2, (own[3] - own[1]) / 2];
  const places = GAPS.flatMap((gap) => SIDES.map(([right, below]) => {
    const share = right && below ? CORNER : 1;
    const [left, top] = [x + right * ((across + gap) * share + width / 2) - width / 2, y + below * ((down + gap) * share + height / 2) - height / 2];
    return [left, top, left + width, top + height];
  }));
  const isFree = (/** @type {number[]} */ box) => box[0] >= 0 && box[1] >= 0 && box[2] <= page.width && box[3] <= page.height && ![...others, ...taken].some((other) => touch(box, other));
  const found = places.findIndex(isFree);
  if (found < 0 && !must) return null;
  const box = places[Math.max(found, 0)];
  /** @type {[number, number][]} */
  const leader = [];
  if (found >= SIDES.length * (GAPS.length - 1)) {
    const { px, py, radius } = knot[0], end = /** @type {[number, number]} */ ([clamp(px, box[0], box[2]), clamp(py, box[1], box[3])]);
    const far = Math.hypot(end[0] - px, end[1] - py);
    leader.push([px + ((end[0] - px) * radius) / far, py + ((end[1] - py) * radius) / far], end);
  }
  return { box, indent, leader, middles: Array.from({ length: count }, (_, i) => box[1] + HALF + i * LINE) };
}

/** Return the box around dots: left, top, right, bottom. @param {Dot[]} dots */
function around(dots) {
  const [xs, ys] = [dots.map((dot) => [dot.px - dot.radius, dot.px + dot.radius]).flat(), dots.map((dot) => [dot.py - dot.radius, dot.py + dot.radius]).flat()];
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

function touch(/** @type {number[]} */ a, /** @type {number[]} */ b) {
  return a[0] < b[2] && a[2] > b[0] && a[1] < b[3] && a[3] > b[1];
}

function clamp(/** @type {number} */ value, /** @type {number} */ low, /** @type {number} */ high) {
  return Math.min(Math.max(value, low), high);
}
