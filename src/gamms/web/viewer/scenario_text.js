// What is chosen on a map as a scenario file takes it: changes of its keys, and the same as YAML.

/**
 * @typedef {{name: string, count: number, agents: string[], near?: number[], within?: number}} Team
 * @typedef {{points: number[], radius: number | null}} Area corners x, y, x, y, …; with a radius only its centre
 * @typedef {{x: number, y: number, id: number, lat: number | null, lon: number | null}} Place
 * @typedef {{teams: Team[], rules?: {path: string, name: string}[], map?: Map<string, any> | Record<string, any>}} Scenario
 * @typedef {{key: string, words: string}} Target
 * @typedef {{keys: (string | number)[], value: any}} Change what is to be at a place in the file
 */

const SIDES = 24; // of a circle as a polygon
const PLAIN = /^[A-Za-z_][\w-]*$/;
const RESERVED = new Set(["true", "false", "null", "yes", "no", "on", "off", "y", "n"]);

/** Return for what places can be chosen. @param {Scenario} scenario @param {Area | null} area @returns {Target[]} */
export function targetsOf(scenario, area) {
  return [
    ...scenario.teams.map(({ name }) => ({ key: `agents ${name}`, words: `agents of ${name}, each on a node` })),
    ...scenario.teams.map(({ name }) => ({ key: `start ${name}`, words: `the start of ${name}: near and within` })),
    ...(scenario.rules ?? []).map(({ path, name }) => ({ key: `rule ${path}`, words: `nodes of the rule ${name} (item ${Number(path.split(".")[1]) + 1})` })),
    ...(area === null ? [] : [{ key: "closed", words: "closed roads, in the area" }]),
    { key: "list", words: "a list of nodes, for a rule" },
  ];
}

/**
 * Return values by the keys of a scenario file that they are for, in the form of the file.
 * @param {string} key of the target @param {Scenario} scenario @param {Place[]} places @param {Area | null} area @param {"id" | "xy" | "latlon"} form
 * @returns {Change[]}
 */
export function changesFor(key, scenario, places, area, form) {
  const [kind, of] = [key.split(" ", 1)[0], key.slice(key.indexOf(" ") + 1)];
  const given = places.map((place) => formOf(place, form));
  const inRule = given.map((one) => (form === "id" ? one : { node_at: one }));
  if (kind === "rule") return [{ keys: of.split(".").map((one) => (/^\d+$/.test(one) ? Number(one) : one)), value: inRule }];
  if (kind === "list") return [{ keys: ["nodes"], value: inRule }];
  if (kind === "closed") return [{ keys: ["map", "closed"], value: area === null ? [] : [outlineOf(area)] }];
  const team = /** @type {Team} */ (scenario.teams.find(({ name }) => name === of));
  if (kind === "agents") return [{ keys: ["teams", of, "agents"], value: given.map((node, i) => ({ name: team.agents[i] ?? newName(scenario, team, i), node })) }];
  const { x, y, radius } = circleAround(places, area);
  return [{ keys: ["teams", of, "near"], value: [rounded(x), rounded(y)] }, { keys: ["teams", of, "within"], value: Math.ceil(radius * 10) / 10 }];
}

/** Return YAML of changes; with the map, if it is to be a whole scenario. @param {Change[]} changes @param {Scenario} scenario */
export function yamlOf(changes, scenario) {
  const isWhole = scenario.map !== undefined && changes[0].keys.length > 1;
  const root = new Map(isWhole ? [["map", new Map(Object.entries(/** @type {any} */ (scenario.map)))]] : []);
  for (const { keys, value } of changes) {
    const names = keys[0] === "rules" ? keys.slice(-1) : keys; // of a rule what stands after `with:`
    let here = root;
    for (const part of names.slice(0, -1)) {
      if (!here.has(part)) here.set(part, new Map());
      here = here.get(part);
    }
    here.set(names[names.length - 1], value);
  }
  return block(root, "");
}

/** @param {Scenario} scenario @param {Team} team @param {number} i */
function newName(scenario, team, i) {
  const taken = new Set(scenario.teams.flatMap((one) => [...one.agents, ...Array.from({ length: one.count }, (_, n) => `${one.name}_${n}`)]));
  let number = i - team.agents.length;
  for (let n = 0; ; n++) if (!taken.has(`${team.name}_${n}`) && number-- === 0) return `${team.name}_${n}`;
}

/** @param {Place} place @param {"id" | "xy" | "latlon"} form */
function formOf(place, form) {
  if (form === "latlon" && place.lat !== null) return { lat: place.lat, lon: place.lon };
  return form === "xy" ? [rounded(place.x), rounded(place.y)] : place.id;
}

/** @param {number} metres */
function rounded(metres) {
  return Number(metres.toFixed(3));
}

/** Return the circle that was drawn, or one around the places. @param {Place[]} places @param {Area | null} area */
function circleAround(places, area) {
  if (area !== null && area.radius !== null) return { x: area.points[0], y: area.points[1], radius: area.radius };
  const points = area === null ? places.flatMap(({ x, y }) => [x, y]) : area.points;
  const count = Math.max(points.length / 2, 1);
  const sum = (/** @type {number} */ part) => points.reduce((total, one, i) => total + (i % 2 === part ? one : 0), 0) / count;
  const [x, y] = [sum(0), sum(1)];
  let radius = 0;
  for (let i = 0; i < points.length; i += 2) radius = Math.max(radius, Math.hypot(points[i] - x, points[i + 1] - y));
  return { x, y, radius };
}

/** Return the corners of an area. @param {Area} area @returns {number[][]} */
export function outlineOf({ points, radius }) {
  if (radius === null) return Array.from({ length: points.length / 2 }, (_, i) => [rounded(points[2 * i]), rounded(points[2 * i + 1])]);
  const [x, y] = points;
  return Array.from({ length: SIDES }, (_, i) => [x + radius * Math.cos((2 * Math.PI * i) / SIDES), y + radius * Math.sin((2 * Math.PI * i) / SIDES)].map(rounded));
}

/** @param {Map<string, any>} mapping @param {string} indent @returns {string} */
function block(mapping, indent) {
  return [...mapping].map(([key, value]) => {
    if (value instanceof Map) return `${indent}${scalar(key)}:\n${block(value, `${indent}  `)}`;
    const isList = Array.isArray(value) && value.length > 0 && value.every((one) => typeof one === "object");
    return isList ? `${indent}${scalar(key)}:\n${value.map((one) => `${indent}  - ${flow(one)}\n`).join("")}` : `${indent}${scalar(key)}: ${flow(value)}\n`;
  }).join("");
}

/** @param {any} value @returns {string} */
function flow(value) {
  if (Array.isArray(value)) return `[${value.map(flow).join(", ")}]`;
  if (value !== null && typeof value === "object") return `{${Object.entries(value).map(([key, one]) => `${scalar(key)}: ${flow(one)}`).join(", ")}}`;
  return typeof value === "string" ? scalar(value) : String(value);
}

/** Return a text as a scalar of YAML: JSON's form of it is one, too. @param {string} text */
function scalar(text) {
  if (PLAIN.test(text) && !RESERVED.has(text.toLowerCase())) return text;
  return JSON.stringify(text).replace(/[\u007f-\u00a0\u2028\u2029\ufeff]/g, (one) => `\\u${one.charCodeAt(0).toString(16).padStart(4, "0")}`);
}
