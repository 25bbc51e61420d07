// Print what the viewer's reader finds in a recording: every state, forwards and by seeking, as JSON.
import { readFileSync } from "node:fs";
import { Recording } from "../../src/gamms/web/viewer/recording.js";
import { stateAt } from "../../src/gamms/web/viewer/state.js";
import { World } from "../../src/gamms/web/viewer/world.js";

/** What is compared of a state. */
function plain(state) {
  const agents = [...state.agents.values()];
  const numbers = (values) => values.map((value) => (Number.isNaN(value) ? null : value));
  return {
    name: agents.map((agent) => agent.name), team: agents.map((agent) => agent.team), alive: agents.map((agent) => Boolean(agent.alive)),
    node: agents.map((agent) => agent.node), previous: agents.map((agent) => agent.previous),
    position: agents.map((agent) => numbers([...agent.position].slice(0, 3))), quat: agents.map((agent) => numbers([...agent.quat])),
    scores: Object.fromEntries(state.scores), over: state.over === null ? null : Object.fromEntries(state.over),
  };
}

/** Return what is in a recording whose bytes come so many at once. */
function read(path, size) {
  const bytes = new Uint8Array(readFileSync(path));
  const recording = new Recording();
  for (let at = 0; at < bytes.length; at += size) recording.feed(bytes.slice(at, Math.min(at + size, bytes.length)));
  const state = stateAt(recording, 0);
  const forwards = [plain(state)];
  while (state.turn < recording.turns) {
    state.advance(recording);
    forwards.push(plain(state));
  }
  const sought = [...forwards.keys()].filter((turn) => turn % 7 === 0).map((turn) => [turn, plain(stateAt(recording, turn))]);
  const world = new World(recording.header.get("world"));
  const map = { nodes: [...world.nodeIds], xy: [...world.xy], edges: [...world.edgeIds] };
  return { turns: recording.turns, isComplete: recording.isComplete, forwards, sought, map };
}

const paths = process.argv.slice(2);
console.log(JSON.stringify(paths.map((path) => [read(path, Infinity), read(path, 333)])));
