// Messages: arcs from senders to those that hear or overhear them, crosses where they are lost, and rings that fade where nobody hears them.
import { faded } from "./themes.js";

const HEIGHT = 0.12; // of an arc, in lengths of the way
const MOST = 2000;
const HEARD = 0, OVERHEARD = 1, UNHEARD = 3; // fates
const ALPHAS = [0.8, 0.45];
const RING_PX = 4, WIDER_PX = 6, RING_ALPHA = 0.9, FADED = 0.6, FLYER = 1.8; // of the ring around an agent: beyond its disc or the ring of a flyer; around a sender it grows over the turn and fades

/** @typedef {import("./scene.js").Scene} Scene */

/**
 * Paint what agents hear next, and what was lost in this turn, in the colors of the senders.
 * @param {CanvasRenderingContext2D} to @param {Scene} scene @param {import("./scene.js").Look} look @param {number} share of the turn
 */
export function paintMessages(to, scene, look, share) {
  const discs = new Map(scene.discs.map((disc) => [disc.name, disc]));
  const isOwn = (/** @type {string | null} */ name) => {
    const agent = discs.get(name ?? "")?.way.agent;
    return look.fog === null || (agent !== undefined && scene.replay.isOwn(agent, look.fog));
  };
  for (const { sender, receiver, fate } of scene.replay.state.messages.slice(0, MOST)) {
    const from = discs.get(sender ?? ""), end = discs.get(receiver ?? ""), isHeard = fate <= OVERHEARD;
    if (fate === UNHEARD && from !== undefined && isOwn(sender)) ring(to, from, WIDER_PX * share, faded(from.color, RING_ALPHA - FADED * share));
    if (end === undefined || !((isOwn(sender) && fate !== OVERHEARD) || (isOwn(receiver) && isHeard))) continue;
    if (from === undefined && isHeard) ring(to, end, 0, "#808080");
    else if (from !== undefined && isHeard) arc(to, from, end, faded(from.color, ALPHAS[fate]), fate === HEARD ? [] : [3, 5]);
    else if (from !== undefined) lost(to, from, end);
  }
}

/** @typedef {{px: number, py: number, color: string}} End */

/** @param {CanvasRenderingContext2D} to @param {End} from @param {End} end @param {string} color @param {number[]} dash */
function arc(to, from, end, color, dash) {
  const [x, y] = bend(from, end);
  to.strokeStyle = color;
  to.lineWidth = 2;
  to.setLineDash(dash);
  to.beginPath();
  to.moveTo(from.px, from.py);
  to.quadraticCurveTo(x, y, end.px, end.py);
  to.stroke();
  to.setLineDash([]);
}

/** Half an arc that ends in a cross: this one did not come through. @param {CanvasRenderingContext2D} to @param {End} from @param {End} end */
function lost(to, from, end) {
  const [bx, by] = bend(from, end);
  const x = 0.25 * from.px + 0.5 * bx + 0.25 * end.px, y = 0.25 * from.py + 0.5 * by + 0.25 * end.py;
  to.strokeStyle = faded(from.color, 0.6);
  to.lineWidth = 1.5;
  to.setLineDash([2, 4]);
  to.beginPath();
  to.moveTo(from.px, from.py);
  to.quadraticCurveTo((from.px + bx) / 2, (from.py + by) / 2, x, y);
  to.stroke();
  to.setLineDash([]);
  to.beginPath();
  to.moveTo(x - 4, y - 4);
  to.lineTo(x + 4, y + 4);
  to.moveTo(x - 4, y + 4);
  to.lineTo(x + 4, y - 4);
  to.stroke();
}

/** Return the control point of an arc that bends to the left. @param {End} from @param {End} end */
function bend(from, end) {
  const dx = end.px - from.px, dy = end.py - from.py;
  return [from.px + dx / 2 + 2 * HEIGHT * dy, from.py + dy / 2 - 2 * HEIGHT * dx];
}

/** @param {CanvasRenderingContext2D} to @param {import("./scene.js").Disc} around @param {number} wider @param {string} color */
function ring(to, { px, py, radius, way }, wider, color) {
  to.strokeStyle = color;
  to.lineWidth = 2;
  to.beginPath();
  to.arc(px, py, (way.agent.flies ? FLYER : 1) * radius + RING_PX + wider, 0, 2 * Math.PI);
  to.stroke();
}
