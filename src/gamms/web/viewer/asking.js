// Calls of the program that serves a page, which has a token behind # in its address.

/** Ask the program that serves this page. @param {string} path @param {Record<string, any>} message @returns {Promise<any>} */
export async function ask(path, message) {
  const headers = { Authorization: `Bearer ${location.hash.slice(1)}`, "Content-Type": "application/json" };
  const answer = await fetch(path, { method: "POST", headers, body: JSON.stringify(message) });
  const found = await answer.json();
  if (!answer.ok) throw new Error(found.error ?? `The program answers ${answer.status}.`);
  return found.value;
}
