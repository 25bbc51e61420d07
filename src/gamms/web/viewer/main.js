// Begin: read the recordings that are in the page, and show them.
import { App } from "./app.js";
import { bytesIn } from "./bytes.js";
import { element } from "./dom.js";
import { Live } from "./live.js";
import { followAddress } from "./moment.js";
import { Recording } from "./recording.js";
import { Replay } from "./replay.js";

/** Show the recordings in the page; of a game that goes on there are none, and it is asked for. */
async function begin() {
  const root = /** @type {HTMLElement} */ (document.getElementById("viewer"));
  const options = JSON.parse(document.getElementById("options")?.textContent || "{}");
  if (options.live) {
    new Live(root, options);
    return;
  }
  const held = await Promise.all([...document.querySelectorAll("script.recording")].map(bytesIn));
  const replays = held.map((bytes) => {
    const recording = new Recording();
    recording.feed(bytes);
    return new Replay(recording);
  });
  const app = new App(root, replays, options);
  Object.defineProperty(window, "gamms", { value: app }); // for consoles and tests
  app.whenRead = () => {
    followAddress(app);
    app.beginNear();
  };
}

begin().catch((error) => {
  const words = `This recording cannot be shown: ${error instanceof Error ? error.message : error}`;
  document.getElementById("viewer")?.replaceChildren(element("p", { class: "failure", role: "alert", text: words }));
});
