// Values as words.

/** Return a value as short text. @param {any} value @param {number} [most] letters @returns {string} */
export function wordsOf(value, most = 400) {
  const words = textOf(value, 4);
  return words.length > most ? `${words.slice(0, most - 1)}…` : words;
}

/** @param {any} value @param {number} depth @returns {string} */
function textOf(value, depth) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(6)));
  if (value instanceof Uint8Array && value.length > 64) return `${value.length} bytes`;
  if (depth === 0) return "…";
  if (value instanceof Map) return [...value].slice(0, 50).map(([key, one]) => `${key}: ${textOf(one, depth - 1)}`).join(", ") || "–";
  if (Array.isArray(value) || ArrayBuffer.isView(value)) {
    const items = Array.from(/** @type {ArrayLike<any>} */ (/** @type {any} */ (value)));
    return items.slice(0, 24).map((one) => textOf(one, depth - 1)).join(", ") + (items.length > 24 ? `, … (${items.length})` : "") || "–";
  }
  return String(value);
}
