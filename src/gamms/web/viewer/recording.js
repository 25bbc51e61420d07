// A recording of version 3 as it comes: a whole file, or block by block. docs/recording-format.md describes the bytes.
import { ByteReader, unpackedValue, valueOf } from "./values.js";

const HEAD_SIZE = 36;
const HEADER = 0x48, KEYFRAME = 0x4b, TURNS = 0x54, END = 0x45; // H, K, T, E
const MOST_TURNS = 1 << 16, MOST_MOVES = 1 << 22, MOST_EVENTS = 1 << 20; // of a block
const MOST_DECODED = 1 << 26; // bytes of blocks of turns that are kept decoded
export const FLIGHT = 0x01100020;
export const TURN_IN_SPACE = 0x01100021;
const FORMS = new Map([[FLIGHT, { nodes: 1, floats: 3 }], [TURN_IN_SPACE, { nodes: 0, floats: 4 }]]);

/**
 * @typedef {{type: number, first: number, turns: number, moves: number, events: number, body: Uint8Array}} Block
 * @typedef {{first: number, turns: number, bytes: number, moveEnds: Float64Array, eventEnds: Float64Array, rows: Float64Array,
 *   nodes: Float64Array, after: Float64Array, kinds: Float64Array, data: (event: number) => any}} Chunk
 *   The turns of a block. Turn i has the moves from moveEnds[i] to moveEnds[i + 1], and so for events.
 */

/** The blocks of a recording, which may still grow. */
export class Recording {
  constructor() {
    /** @type {Map<string, any>} */ this.header = new Map();
    /** @type {Block[]} */ this.keyframes = [];
    /** @type {Block[]} */ this.chunks = [];
    this.first = 0; // turns that come before it, and are not in it
    this.turns = 0;
    this.beginnings = 0; // keyframes before its first turn, of which the last counts
    this.isComplete = false;
    this.hasBegun = false;
    this.key = 0;
    this.rest = new Uint8Array(0);
    /** @type {Map<number, Chunk>} */ this.decoded = new Map(); // the one decoded first is the first
    this.bytesDecoded = 0;
  }

  /**
   * Take the next bytes of the recording; blocks that are whole count at once.
   * @param {Uint8Array} bytes
   */
  feed(bytes) {
    const data = this.rest.length ? joined(this.rest, bytes) : bytes;
    let at = this.hasBegun ? 0 : this.#begin(data);
    for (let block; at >= 0 && !this.isComplete && (block = blockAt(data, at, this.key)) !== null; ) {
      at += HEAD_SIZE + block.body.length;
      this.#add(block, data);
    }
    this.rest = data.slice(Math.max(at, 0));
  }

  /** Check the first bytes; return where the first block is, -1 while they are not there. @param {Uint8Array} data */
  #begin(data) {
    if (data.length < 8) return -1;
    const version = new DataView(data.buffer, data.byteOffset, 8).getUint32(4);
    if (String.fromCharCode(...data.subarray(0, 4)) !== "MMGR") throw new Error("This is not a recording of GAMMS.");
    if (version !== 3) throw new Error(`This recording has format version ${version}; version 3 is read here.`);
    this.hasBegun = true;
    return 8;
  }

  /** @param {Block} block */
  #add(block) {
    if (block.type === HEADER) {
      this.header = unpackedValue(block.body);
      this.key = crc32(block.body);
    } else if (block.type === KEYFRAME) {
      if (this.chunks.length === 0) this.first = this.turns = block.first;
      this.keyframes.push(block);
      if (block.first === this.first) this.beginnings++;
    } else if (block.type === TURNS) {
      if (block.first !== this.turns) throw new Error("Some turns of this recording are missing.");
      this.chunks.push(block);
      this.turns += block.turns;
    } else if (block.type === END) {
      this.isComplete = true;
    }
  }

  /**
   * Return the block of turns that has a turn, decoded.
   * @param {number} turn from 0
   * @returns {Chunk}
   */
  chunk(turn) {
    const number = lastBefore(this.chunks, turn);
    const known = this.decoded.get(number);
    if (known !== undefined) return known;
    const chunk = chunkOf(this.chunks[number]);
    this.bytesDecoded += chunk.bytes;
    for (const [other, { bytes }] of this.decoded) {
      if (this.bytesDecoded <= MOST_DECODED) break;
      this.bytesDecoded -= bytes;
      this.decoded.delete(other);
    }
    this.decoded.set(number, chunk);
    return chunk;
  }

  /**
   * Return the last keyframe that stands before a turn.
   * @param {number} turn
   * @returns {{first: number, state: Map<string, any>}}
   */
  keyframe(turn) {
    const number = lastBefore(this.keyframes, turn);
    if (number < 0) throw new Error("This recording does not say how it begins.");
    const { first, body } = this.keyframes[number];
    return { first, state: unpackedValue(body) };
  }

  /** Return how many turns come before the keyframe that `keyframe(turn)` returns. @param {number} turn */
  keyframeBefore(turn) {
    const number = lastBefore(this.keyframes, turn);
    return number < 0 ? -1 : this.keyframes[number].first;
  }
}

/**
 * Call back for what happens in one turn, in its order.
 * @param {Chunk} chunk
 * @param {number} turn of the recording
 * @param {(row: number, node: number) => void} onMove
 * @param {(kind: number, data: any) => void} onEvent
 */
export function replayTurn(chunk, turn, onMove, onEvent) {
  const i = turn - chunk.first;
  let move = chunk.moveEnds[i];
  for (let event = chunk.eventEnds[i]; event < chunk.eventEnds[i + 1]; event++) {
    for (; move < chunk.after[event]; move++) onMove(chunk.rows[move], chunk.nodes[move]);
    onEvent(chunk.kinds[event], chunk.data(event));
  }
  for (; move < chunk.moveEnds[i + 1]; move++) onMove(chunk.rows[move], chunk.nodes[move]);
}

/**
 * Return the block that begins at a byte; null while it is not all there.
 * @param {Uint8Array} data @param {number} at @param {number} key @returns {Block | null}
 */
function blockAt(data, at, key) {
  if (at + HEAD_SIZE > data.length) return null;
  const view = new DataView(data.buffer, data.byteOffset + at, HEAD_SIZE);
  if (view.getUint8(0) !== 0xd3 || view.getUint8(1) !== 0x47 || view.getUint8(2) !== 0x42) throw damaged(at);
  if (crc32(data.subarray(at, at + 32)) !== view.getUint32(32, true)) throw damaged(at);
  const [size, crc, ofKey, first, turns, moves, events] = [4, 8, 12, 16, 20, 24, 28].map((place) => view.getUint32(place, true));
  const type = view.getUint8(3);
  if ((type === HEADER ? 0 : key) !== ofKey || turns > MOST_TURNS || moves > MOST_MOVES || events > MOST_EVENTS) throw damaged(at);
  if (at + HEAD_SIZE + size > data.length) return null;
  const body = data.subarray(at + HEAD_SIZE, at + HEAD_SIZE + size);
  if (crc32(body) !== crc) throw damaged(at);
  return { type, first, turns, moves, events, body };
}

/** @param {number} at */
function damaged(at) {
  return new Error(`This recording is damaged at byte ${at} of what came last.`);
}

/** @param {Block} block @returns {Chunk} */
function chunkOf({ first, turns, moves, events, body }) {
  const packed = new ByteReader(body);
  const values = packed.unpacked();
  const reader = new ByteReader(packed.unpacked());
  const moveEnds = ends(reader.column(turns), moves);
  const eventEnds = ends(reader.column(turns), events);
  const rows = reader.sums(moves);
  const nodes = tracks(reader, rows);
  const after = reader.sums(events);
  const kinds = reader.column(events);
  const valueEnds = ends(reader.column(events), values.length);
  const columns = new Map();
  for (const kind of [...FORMS.keys()].sort((a, b) => a - b)) {
    const places = [...kinds.keys()].filter((event) => kinds[event] === kind);
    if (places.length) columns.set(kind, { places: new Map(places.map((event, i) => [event, i])), ...numbersOf(reader, kind, places.length) });
  }
  const data = (/** @type {number} */ event) => {
    const numbers = columns.get(kinds[event]);
    if (numbers === undefined) return valueOf(values.subarray(valueEnds[event], valueEnds[event + 1]));
    const row = numbers.places.get(event);
    return [numbers.rows[row], ...numbers.columns.map((/** @type {ArrayLike<number>} */ column) => column[row])];
  };
  const bytes = values.length + 16 * (turns + moves + events); // and what is decoded of floats
  return { first, turns, bytes, moveEnds, eventEnds, rows, nodes, after, kinds, data };
}

/** Return where each part ends that has such a size, after a 0. @param {Float64Array} sizes @param {number} total */
function ends(sizes, total) {
  const found = new Float64Array(sizes.length + 1);
  for (let i = 0; i < sizes.length; i++) {
    if (!(sizes[i] >= 0)) throw new Error("a block of turns is damaged");
    found[i + 1] = found[i] + sizes[i];
  }
  if (found[sizes.length] !== total) throw new Error("a block of turns is damaged");
  return found;
}

/** Return which entries belong to which row: rows ascending, each with its entries. @param {Float64Array} rows */
function entriesOf(rows) {
  /** @type {Map<number, number[]>} */
  const found = new Map();
  for (let i = 0; i < rows.length; i++) {
    const known = found.get(rows[i]);
    if (known === undefined) found.set(rows[i], [i]);
    else known.push(i);
  }
  return [...found.keys()].sort((a, b) => a - b).map((row) => /** @type {number[]} */ (found.get(row)));
}

/** Return a number for each row, from the columns of the firsts and of the others. */
function tracks(/** @type {ByteReader} */ reader, /** @type {Float64Array} */ rows) {
  const entries = entriesOf(rows);
  const firsts = reader.sums(entries.length);
  const others = reader.column(rows.length - entries.length);
  const found = new Float64Array(rows.length);
  let at = 0;
  entries.forEach((places, track) => {
    let value = (found[places[0]] = firsts[track]);
    for (let i = 1; i < places.length; i++) found[places[i]] = value += others[at++];
  });
  return found;
}

/** The data of flights, or of turns in space. */
function numbersOf(/** @type {ByteReader} */ reader, /** @type {number} */ kind, /** @type {number} */ count) {
  const form = /** @type {{nodes: number, floats: number}} */ (FORMS.get(kind));
  const rows = reader.sums(count);
  const columns = [];
  for (let i = 0; i < form.nodes; i++) columns.push(tracks(reader, rows));
  for (let i = 0; i < form.floats; i++) columns.push(floats(reader, rows));
  return { rows, columns };
}

/** Return floats whose bits are written as differences of differences. */
function floats(/** @type {ByteReader} */ reader, /** @type {Float64Array} */ rows) {
  const entries = entriesOf(rows);
  const firsts = reader.wideColumn(entries.length);
  const others = reader.wideColumn(rows.length - entries.length);
  const bits = new BigInt64Array(rows.length);
  let at = 0, first = 0n;
  entries.forEach((places, track) => {
    first += firsts[track];
    let value = (bits[places[0]] = first), step = 0n;
    for (let i = 1; i < places.length; i++) bits[places[i]] = value += step += others[at++];
  });
  return new Float64Array(bits.buffer);
}

/** Return the number of the last block that begins at or before a turn; -1 if there is none. */
function lastBefore(/** @type {Block[]} */ blocks, /** @type {number} */ turn) {
  let low = 0, high = blocks.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (blocks[middle].first <= turn) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** @param {Uint8Array} first @param {Uint8Array} second */
function joined(first, second) {
  const both = new Uint8Array(first.length + second.length);
  both.set(first);
  both.set(second, first.length);
  return both;
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let crc = byte;
  for (let bit = 0; bit < 8; bit++) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  return crc >>> 0;
});

/** @param {Uint8Array} bytes */
function crc32(bytes) {
  let crc = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) crc = CRC_TABLE[(crc ^ bytes[i]) & 255] ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}
