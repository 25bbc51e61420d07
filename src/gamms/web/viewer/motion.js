// Where agents are during a turn: they glide along the edges that they took.
import { State } from "./state.js";
import { World } from "./world.js";

/** @typedef {import("./state.js").Agent} Agent */
/** @typedef {{name: string, number: number, team: string | null, points: ArrayLike<number>, lengths: number[], agent: Agent, before: Agent | null}} Way */

/**
 * Return where an agent is at the end of a turn, x and y.
 * @param {World} world @param {Agent} agent @returns {[number, number]}
 */
export function placeOf(world, agent) {
  if (!world.rowOf.has(agent.node)) return [NaN, NaN]; // it is out of sight
  if (agent.flies && Number.isFinite(agent.position[0])) return [agent.position[0], agent.position[1]];
  if (agent.share > 0) {
    const from = world.rowOf.get(agent.source), to = world.rowOf.get(agent.target);
    if (from !== undefined && to !== undefined) {
      return along(world.pointsBetween(from, to), agent.share);
    }
  }
  const row = world.rowOf.get(agent.node);
  return row === undefined ? [NaN, NaN] : [world.xy[2 * row], world.xy[2 * row + 1]];
}

/**
 * Return where an agent looks, as cosine and sine; zeros while it has no heading.
 * @param {World} world @param {Agent} agent @returns {[number, number]}
 */
export function headingOf(world, agent) {
  const [w, x, y, z] = agent.quat;
  if (agent.flies && Number.isFinite(w)) return unit(1 - 2 * (y * y + z * z), 2 * (x * y + w * z));
  if (Number.isFinite(agent.heading[0])) return [agent.heading[0], agent.heading[1]];
  const isOnEdge = agent.share > 0;
  const from = world.rowOf.get(isOnEdge ? agent.source : agent.previous), to = world.rowOf.get(isOnEdge ? agent.target : agent.node);
  if (from === undefined || to === undefined || from === to) return [0, 0];
  if (!isOnEdge) return unit(world.xy[2 * to] - world.xy[2 * from], world.xy[2 * to + 1] - world.xy[2 * from + 1]);
  const points = world.pointsBetween(from, to);
  const [here, ahead] = [along(points, agent.share), along(points, Math.min(agent.share + 1e-3, 1))];
  return unit(ahead[0] - here[0], ahead[1] - here[1]);
}

/** @param {number} x @param {number} y @returns {[number, number]} */
function unit(x, y) {
  const length = Math.hypot(x, y);
  return length > 1e-9 ? [x / length, y / length] : [0, 0];
}

/**
 * Return the ways of all living agents in a turn.
 * @param {World} world @param {State} state after the turn @param {Map<number, Agent>} before the agents before it
 * @returns {Way[]}
 */
export function waysOf(world, state, before) {
  const found = [];
  for (const agent of state.agents.values()) {
    const was = before.get(agent.number) ?? null;
    if (!agent.alive && !(was !== null && was.alive)) continue;
    const points = wayOf(world, agent, was, state.log.moves.get(agent.number));
    const lengths = [0];
    for (let i = 2; i < points.length; i += 2) lengths.push(lengths[lengths.length - 1] + Math.hypot(points[i] - points[i - 2], points[i + 1] - points[i - 1]));
    found.push({ name: agent.name, number: agent.number, team: agent.team, points, lengths, agent, before: was });
  }
  return found;
}

/** @param {World} world @param {Agent} agent @param {Agent | null} was @param {number[] | undefined} moves @returns {ArrayLike<number>} */
function wayOf(world, agent, was, moves) {
  const end = placeOf(world, agent);
  if (was === null || (moves !== undefined && moves.length === 0)) return end;
  const start = placeOf(world, was);
  if (agent.flies || agent.share > 0 || was.share > 0) return moves === undefined || agent.flies ? [...start, ...end] : viaNodes(world, start, was, moves, end);
  if (moves === undefined) return end;
  /** @type {number[]} */
  const points = [...start];
  let from = world.rowOf.get(was.node);
  for (const node of moves) {
    const to = world.rowOf.get(node);
    if (from !== undefined && to !== undefined && from !== to) {
      const shape = world.pointsBetween(from, to);
      for (let i = 2; i < shape.length; i++) points.push(shape[i]);
    }
    from = to;
  }
  return points;
}

/** Return the way of an agent that begins or ends on an edge. */
function viaNodes(/** @type {World} */ world, /** @type {number[]} */ start, /** @type {Agent} */ was, /** @type {number[]} */ moves, /** @type {number[]} */ end) {
  const points = [...start];
  for (const node of moves) {
    const row = world.rowOf.get(node);
    if (row !== undefined && node !== was.node) points.push(world.xy[2 * row], world.xy[2 * row + 1]);
  }
  return [...points, ...end];
}

/** Return the place after a share of a way. @param {Way} way @param {number} share @returns {[number, number]} */
export function placeOn(way, share) {
  const { points, lengths } = way;
  const total = lengths[lengths.length - 1];
  const last = points.length - 2;
  if (share >= 1 || !(total > 0)) return share >= 1 ? [points[last], points[last + 1]] : [points[0], points[1]];
  return onLine(points, lengths, share * total);
}

/** @param {ArrayLike<number>} points @param {number} share @returns {[number, number]} */
function along(points, share) {
  const lengths = [0];
  for (let i = 2; i < points.length; i += 2) lengths.push(lengths[lengths.length - 1] + Math.hypot(points[i] - points[i - 2], points[i + 1] - points[i - 1]));
  return onLine(points, lengths, share * lengths[lengths.length - 1]);
}

/** @param {ArrayLike<number>} points @param {number[]} lengths @param {number} distance @returns {[number, number]} */
function onLine(points, lengths, distance) {
  let i = 1;
  while (i < lengths.length - 1 && lengths[i] < distance) i++;
  const piece = lengths[i] - lengths[i - 1];
  const share = piece > 0 ? Math.min((distance - lengths[i - 1]) / piece, 1) : 1;
  const a = 2 * (i - 1);
  return [points[a] + share * (points[a + 2] - points[a]), points[a + 1] + share * (points[a + 3] - points[a + 1])];
}
