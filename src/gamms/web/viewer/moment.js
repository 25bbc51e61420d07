// Links to a moment of a replay: the address names the turn, the agent and the fog, `#turn=359&agent=blue_2&fog=red`; `&play` plays on from there.
const RESTS_MS = 300; // browsers refuse many changes of an address in a row

/** Show the moment that the address names, and let the address name the moment that is shown. @param {import("./app.js").App} app */
export function followAddress(app) {
  let timer = 0;
  readAddress(app);
  window.addEventListener("hashchange", () => readAddress(app));
  if (window.parent !== window) return; // the address of a page in a page is not seen
  app.whenShown = () => {
    clearTimeout(timer);
    timer = window.setTimeout(() => writeAddress(app), RESTS_MS);
  };
}

/** @param {import("./app.js").App} app */
function readAddress(app) {
  const named = new URLSearchParams(location.hash.slice(1));
  const fog = named.get("fog"), turn = Number.parseInt(named.get("turn") ?? "", 10), agent = named.get("agent");
  const isKnown = app.views.some(({ replay }) => replay.timeline.hasSensed && replay.sides().includes(fog ?? ""));
  if (isKnown && !app.options.audience) app.change({ fog });
  if (Number.isFinite(turn)) {
    app.pause();
    app.seek(turn);
  }
  if (agent !== null) app.select(agent);
  if (named.has("play")) app.play();
}

/** @param {import("./app.js").App} app */
function writeAddress(app) {
  if (app.isPlaying) return;
  const { selected, fog } = app.look;
  const named = new URLSearchParams({ turn: String(app.turn) });
  if (selected !== null) named.set("agent", selected);
  if (fog !== null && !app.options.audience) named.set("fog", fog);
  history.replaceState(null, "", `#${named}`);
}
