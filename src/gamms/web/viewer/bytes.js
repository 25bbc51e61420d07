// Bytes as pages and messages hold them: deflated, and in pages as base64.

/** Inflate bytes of zlib, by the browser. @param {Uint8Array} bytes @returns {Promise<Uint8Array>} */
export async function inflated(bytes) {
  const stream = new Blob([/** @type {any} */ (bytes)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer().catch(() => { throw new Error("its bytes are damaged"); });
  return new Uint8Array(buffer);
}

/** Return the bytes in an element of the page. @param {Element | null} holder @returns {Promise<Uint8Array>} */
export async function bytesIn(holder) {
  return inflated(Uint8Array.from(atob((holder?.textContent ?? "").trim()), (letter) => letter.charCodeAt(0)));
}
