// Words on the map, and the scale bar.

/** @typedef {import("./themes.js").Theme} Theme */

/** Write words with a halo. @param {CanvasRenderingContext2D} to @param {string} words @param {number} x @param {number} y @param {Theme} theme */
export function paintWords(to, words, x, y, theme) {
  to.lineJoin = "round";
  to.lineWidth = 3;
  to.strokeStyle = theme.background;
  to.strokeText(words, x, y);
  to.fillStyle = theme.ink;
  to.fillText(words, x, y);
}

const NARROW_PX = 380; // views that have no room for it beside the source of the map

/** Paint how long some metres are. @param {CanvasRenderingContext2D} to @param {import("./camera.js").Camera} camera @param {Theme} theme */
export function paintScaleBar(to, camera, theme) {
  if (camera.width < NARROW_PX) return;
  const most = Math.min(140, camera.width / 4) / camera.scale;
  const power = 10 ** Math.floor(Math.log10(most));
  const metres = [5, 2, 1].map((n) => n * power).find((n) => n <= most) ?? power;
  const width = metres * camera.scale, x = 14 + camera.insets.left, y = camera.height - Math.max(camera.insets.bottom, 0) - 12;
  to.textAlign = "left";
  to.textBaseline = "alphabetic";
  to.font = "11px system-ui, sans-serif";
  for (const [ink, line] of /** @type {[string, number][]} */ ([[theme.background, 4], [theme.faint, 1.5]])) {
    to.strokeStyle = ink;
    to.lineWidth = line;
    to.lineCap = "butt";
    to.beginPath();
    to.moveTo(x, y - 5);
    to.lineTo(x, y);
    to.lineTo(x + width, y);
    to.lineTo(x + width, y - 5);
    to.stroke();
  }
  paintWords(to, metres >= 1000 ? `${metres / 1000} km` : `${metres} m`, x + 5, y - 5, theme);
}
