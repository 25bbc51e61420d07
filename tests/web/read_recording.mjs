// Print what the viewer's reader finds in a game: every state, forwards and by seeking, as JSON.
import { readFileSync } from "node:fs";

globalThis.document = { getElementById: () => null }; // themes are in pages
const [{ Recording }, { Replay }] = await Promise.all(["recording", "replay"].map((name) => import(`../../src/gamms/web/viewer/${name}.js`)));

/** What is compared of a state. */
function plain({ state, world }) {
  const agents = [...state.agents.values()].sort((a, b) => (a.name < b.name ? -1 : 1));
  return {
    name: agents.map((agent) => agent.name), side: agents.map((agent) => agent.side), alive: agents.map((agent) => agent.alive),
    node: agents.map((agent) => world.nodeIds[agent.row]), position: agents.map((agent) => agent.position ?? [null, null, null]),
    scores: Object.fromEntries(state.scores), is_over: state.isOver,
  };
}

/** Return what is in a game whose bytes come so many at once. */
function read(path, size) {
  const bytes = new Uint8Array(readFileSync(path));
  const recording = new Recording();
  for (let at = 0; at < bytes.length; at += size) recording.feed(bytes.slice(at, Math.min(at + size, bytes.length)));
  const replay = new Replay(recording), { world } = replay;
  const at = (/** @type {number} */ turn) => (replay.show(turn), plain(replay));
  const forwards = Array.from({ length: recording.turns + 1 }, (_, turn) => at(turn));
  const sought = [...forwards.keys()].filter((turn) => turn % 7 === 0).reverse().map((turn) => [turn, at(turn)]);
  return { turns: recording.turns, forwards, sought, map: { nodes: [...world.nodeIds], xy: [...world.xy] } };
}

const paths = process.argv.slice(2);
console.log(JSON.stringify(paths.map((path) => [read(path, Infinity), read(path, 333)])));
