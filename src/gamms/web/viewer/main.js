// Begin: read the recordings that are in the page, and show them.
import { App } from "./app.js";
import { element } from "./dom.js";
import { Live } from "./live.js";
import { Recording } from "./recording.js";
import { Replay } from "./replay.js";

/** Return the bytes that are in an element as base64. @param {Element} holder @returns {Uint8Array} */
function bytesIn(holder) {
  const text = atob((holder.textContent ?? "").trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** Show the recordings in the page; of a game that goes on there are none, and it is asked for. @returns {App | null} */
function begin() {
  const root = /** @type {HTMLElement} */ (document.getElementById("viewer"));
  const options = JSON.parse(document.getElementById("options")?.textContent || "{}");
  if (options.live) {
    new Live(root, options);
    return null;
  }
  const replays = [...document.querySelectorAll("script.recording")].map((holder) => {
    const recording = new Recording();
    recording.feed(bytesIn(holder));
    return new Replay(recording);
  });
  return new App(root, replays, options);
}

try {
  const app = begin();
  if (app !== null) Object.defineProperty(window, "gamms", { value: app }); // for consoles and tests
} catch (error) {
  const words = `This recording cannot be shown: ${error instanceof Error ? error.message : error}`;
  document.getElementById("viewer")?.replaceChildren(element("p", { class: "failure", role: "alert", text: words }));
}
