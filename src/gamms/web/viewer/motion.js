// Where agents are during a turn: they glide along the edges that they took.
import { World } from "./world.js";

/** @typedef {import("./recording.js").Agent} Agent */
/** @typedef {{name: string, points: ArrayLike<number>, lengths: number[], agent: Agent, before: Agent | null}} Way */

/** Return where an agent is at the end of a turn, x and y. @param {World} world @param {Agent} agent @returns {[number, number]} */
export function placeOf(world, agent) {
  if (agent.row < 0) return [NaN, NaN]; // it is out of sight
  if (agent.position !== null) return [agent.position[0], agent.position[1]];
  if (agent.edge === null) return [world.xy[2 * agent.row], world.xy[2 * agent.row + 1]];
  const points = world.pointsBetween(agent.edge.from, agent.edge.to), lengths = lengthsOf(points);
  return onLine(points, lengths, agent.edge.share * lengths[lengths.length - 1]);
}

/**
 * Return the ways of all living agents in a turn.
 * @param {World} world @param {Map<string, Agent>} now @param {World} lastWorld @param {Map<string, Agent>} before where they were before it, on which map
 * @returns {Way[]}
 */
export function waysOf(world, now, lastWorld, before) {
  const found = [];
  for (const agent of now.values()) {
    const was = before.get(agent.name) ?? null;
    if (!agent.alive && !(was !== null && was.alive)) continue;
    const points = wayOf(world, agent, was === null ? null : placeOf(lastWorld, was), was);
    found.push({ name: agent.name, points, lengths: lengthsOf(points), agent, before: was });
  }
  return found;
}

/** Return the rows of the nodes that an agent went to in a turn. @param {Agent} agent @param {Agent | null} was @returns {number[]} */
export function passedBy(agent, was) {
  return agent.way ?? (was === null || agent.row === was.row ? [] : [agent.row]);
}

/** @param {World} world @param {Agent} agent @param {[number, number] | null} start @param {Agent | null} was @returns {ArrayLike<number>} */
function wayOf(world, agent, start, was) {
  const end = placeOf(world, agent);
  if (was === null || start === null || agent.way?.length === 0) return end;
  if (agent.flies) return [...start, ...end];
  const isBetween = agent.edge !== null || was.edge !== null;
  const points = [...start];
  let from = was.row;
  for (const to of passedBy(agent, was)) {
    if (to >= 0 && to !== from) {
      const shape = isBetween ? [world.xy[2 * to], world.xy[2 * to + 1]] : shapeOf(world, agent, from, to);
      for (let i = isBetween ? 0 : 2; i < shape.length; i++) points.push(shape[i]);
    }
    from = to;
  }
  return isBetween ? [...points, ...end] : points;
}

/** Return the points of the edge that an agent took, the one that its action has named where it leads there. @param {World} world @param {Agent} agent @param {number} from @param {number} to @returns {ArrayLike<number>} */
function shapeOf(world, agent, from, to) {
  const edge = agent.named ?? -1;
  return world.sources[edge] === from && world.targets[edge] === to ? world.pointsOf(edge) : world.pointsBetween(from, to);
}

/** Return the place after a share of a way. @param {Way} way @param {number} share @returns {[number, number]} */
export function placeOn(way, share) {
  const { points, lengths } = way;
  const total = lengths[lengths.length - 1];
  const last = points.length - 2;
  if (share >= 1 || !(total > 0)) return share >= 1 ? [points[last], points[last + 1]] : [points[0], points[1]];
  return onLine(points, lengths, share * total);
}

/** Return how far along a polyline each of its points is. @param {ArrayLike<number>} points */
function lengthsOf(points) {
  const lengths = [0];
  for (let i = 2; i < points.length; i += 2) lengths.push(lengths[lengths.length - 1] + Math.hypot(points[i] - points[i - 2], points[i + 1] - points[i - 1]));
  return lengths;
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
