// Streets by their names, and what is at a node.
import { wordsOf } from "./words.js";
import { World } from "./world.js";

const MOST_FOUND = 30;
const MOST_VALUES = 4; // of an attribute that are named

/** @typedef {{name: string, edges: number[], node: number | null}} Found a street by its edges, or a node by its row */

export class Streets {
  /** @param {World} world */
  constructor(world) {
    this.world = world;
    /** @type {Map<string, number[]>} */ this.edges = new Map(); // name -> rows
    /** @type {Map<number, number[]>} */ this.at = new Map(); // row of a node -> rows of edges that begin or end there
    for (const edge of world.streets) {
      for (const name of namesOf(world.attribute("edge", "name", edge))) put(this.edges, name, edge);
      put(this.at, world.sources[edge], edge);
      put(this.at, world.targets[edge], edge);
    }
    this.plain = [...this.edges.keys()].map((name) => ({ name, words: folded(name) })).sort((a, b) => (a.words < b.words ? -1 : 1));
  }

  /** Return the streets whose names hold a text, those that begin with it first, or the node that it is the id of. @param {string} text @returns {Found[]} */
  find(text) {
    const wanted = folded(text.trim());
    if (wanted === "") return [];
    const node = /^-?\d+$/.test(wanted) ? this.world.rowOf.get(Number(wanted)) : undefined;
    const rank = (/** @type {string} */ words) => (words.startsWith(wanted) ? 0 : words.includes(` ${wanted}`) ? 1 : 2);
    const found = this.plain.filter(({ words }) => words.includes(wanted)).sort((a, b) => rank(a.words) - rank(b.words)).slice(0, MOST_FOUND);
    return [...(node === undefined ? [] : [{ name: `node ${wanted}`, edges: [], node }]), ...found.map(({ name }) => ({ name, edges: this.edges.get(name) ?? [], node: null }))];
  }

  /** Return the names of the streets at a node. @param {number} row @returns {string[]} */
  namesAt(row) {
    return [...new Set((this.at.get(row) ?? []).flatMap((edge) => namesOf(this.world.attribute("edge", "name", edge))))];
  }

  /** Return the attributes of a node, and those of the streets at it, in words. @param {number} row @returns {[string, string][]} */
  attributesAt(row) {
    const { world } = this;
    /** @type {Map<string, Set<string>>} */
    const found = new Map();
    const add = (/** @type {"node" | "edge"} */ of, /** @type {number} */ one) => {
      for (const key of world.attributes[of].keys()) {
        const value = key === "name" ? undefined : world.attribute(of, key, one);
        if (value !== undefined && value !== null) found.set(key, (found.get(key) ?? new Set()).add(wordsOf(value, 60)));
      }
    };
    add("node", row);
    for (const edge of this.at.get(row) ?? []) add("edge", edge);
    return [...found].map(([key, values]) => [key, [...values].slice(0, MOST_VALUES).join(", ") + (values.size > MOST_VALUES ? ", …" : "")]);
  }

  /** Return the rows of the nodes of a street. @param {number[]} edges @returns {number[]} */
  nodesOf(edges) {
    return [...new Set(edges.flatMap((edge) => [this.world.sources[edge], this.world.targets[edge]]))];
  }
}

/** @param {any} value of the attribute `name` @returns {string[]} */
function namesOf(value) {
  return (Array.isArray(value) ? value : [value]).filter((one) => typeof one === "string" && one !== "");
}

/** Return a text in small letters without accents, as it is searched. @param {string} text */
function folded(text) {
  return text.normalize("NFKD").replace(/\p{M}/gu, "").toLowerCase();
}

/** @template K @param {Map<K, number[]>} lists @param {K} key @param {number} value */
function put(lists, key, value) {
  const known = lists.get(key);
  if (known === undefined) lists.set(key, [value]);
  else known.push(value);
}
