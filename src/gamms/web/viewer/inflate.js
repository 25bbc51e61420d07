// Inflate raw deflate streams (RFC 1951) synchronously, and say where they end: DecompressionStream can do neither.

const LENGTH_BASE = [3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258];
const LENGTH_EXTRA = [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0];
const DISTANCE_BASE = [1, 2, 3, 4, 5, 7, 9, 13, 17, 25, 33, 49, 65, 97, 129, 193, 257, 385, 513, 769, 1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577];
const DISTANCE_EXTRA = [0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 8, 9, 9, 10, 10, 11, 11, 12, 12, 13, 13];
const CODE_ORDER = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
const END_OF_BLOCK = 256;

/**
 * @typedef {{codes: Int32Array, bits: number}} Huffman A table: the next `bits` bits give `symbol << 4 | length`.
 */

/**
 * Build the table of a canonical Huffman code.
 * @param {ArrayLike<number>} lengths bits of each symbol's code; 0: it has none
 * @returns {Huffman}
 */
function huffmanOf(lengths) {
  const counts = new Int32Array(16);
  for (let i = 0; i < lengths.length; i++) counts[lengths[i]]++;
  counts[0] = 0;
  let bits = 15;
  while (bits > 1 && counts[bits] === 0) bits--;
  const next = new Int32Array(16);
  for (let length = 1, code = 0; length <= 15; length++) {
    code = (code + counts[length - 1]) << 1;
    next[length] = code;
  }
  const codes = new Int32Array(1 << bits).fill(-1);
  for (let symbol = 0; symbol < lengths.length; symbol++) {
    const length = lengths[symbol];
    if (length === 0) continue;
    let code = next[length]++;
    if (code >= 1 << length) throw new Error("a Huffman code is over-subscribed");
    let reversed = 0;
    for (let i = 0; i < length; i++, code >>= 1) reversed = (reversed << 1) | (code & 1);
    for (let at = reversed; at < codes.length; at += 1 << length) codes[at] = (symbol << 4) | length;
  }
  return { codes, bits };
}

const FIXED_LENGTHS = new Uint8Array(288).fill(8, 0, 144).fill(9, 144, 256).fill(7, 256, 280).fill(8, 280, 288);
const FIXED_DISTANCES = new Uint8Array(30).fill(5);

/** Reads bits of deflated bytes, lowest first. */
class Bits {
  /** @param {Uint8Array} bytes @param {number} at */
  constructor(bytes, at) {
    this.bytes = bytes;
    this.at = at;
    this.hold = 0;
    this.count = 0;
  }

  /** Return the next bits as a number. @param {number} count at most 16 */
  take(count) {
    while (this.count < count) {
      if (this.at >= this.bytes.length) throw new Error("the deflated bytes are cut off");
      this.hold |= this.bytes[this.at++] << this.count;
      this.count += 8;
    }
    const value = this.hold & ((1 << count) - 1);
    this.hold >>>= count;
    this.count -= count;
    return value;
  }

  /** Return the next symbol. @param {Huffman} huffman */
  symbol(huffman) {
    while (this.count < huffman.bits && this.at < this.bytes.length) {
      this.hold |= this.bytes[this.at++] << this.count;
      this.count += 8;
    }
    const found = huffman.codes[this.hold & ((1 << huffman.bits) - 1)];
    const length = found & 15;
    if (found < 0 || length > this.count) throw new Error("the deflated bytes are damaged");
    this.hold >>>= length;
    this.count -= length;
    return found >> 4;
  }

  /** Drop the bits up to the next whole byte, and return where that is. */
  align() {
    this.at -= this.count >> 3;
    this.hold = this.count = 0;
    return this.at;
  }
}

/**
 * Inflate one deflate stream.
 * @param {Uint8Array} bytes
 * @param {number} start where the stream begins
 * @param {number} size how many bytes it must inflate to
 * @returns {{data: Uint8Array, end: number}} the inflated bytes, and where the stream ends
 */
export function inflate(bytes, start, size) {
  const bits = new Bits(bytes, start);
  const data = new Uint8Array(size);
  let at = 0;
  for (let isLast = false; !isLast; ) {
    isLast = bits.take(1) === 1;
    const type = bits.take(2);
    if (type === 0) at = copyStored(bits, data, at);
    else if (type < 3) at = inflateBlock(bits, data, at, ...(type === 1 ? fixedCodes() : dynamicCodes(bits)));
    else throw new Error("the deflated bytes are damaged");
  }
  if (at !== size) throw new Error(`${size} bytes are promised and ${at} are there`);
  return { data, end: bits.align() };
}

/** @returns {[Huffman, Huffman]} */
function fixedCodes() {
  return [huffmanOf(FIXED_LENGTHS), huffmanOf(FIXED_DISTANCES)];
}

/** Read the two codes of a dynamic block. @param {Bits} bits @returns {[Huffman, Huffman]} */
function dynamicCodes(bits) {
  const literals = bits.take(5) + 257;
  const distances = bits.take(5) + 1;
  const count = bits.take(4) + 4;
  const ofCodes = new Uint8Array(19);
  for (let i = 0; i < count; i++) ofCodes[CODE_ORDER[i]] = bits.take(3);
  const huffman = huffmanOf(ofCodes);
  const lengths = new Uint8Array(literals + distances);
  for (let i = 0; i < lengths.length; ) {
    const symbol = bits.symbol(huffman);
    if (symbol < 16) {
      lengths[i++] = symbol;
      continue;
    }
    if (symbol === 16 && i === 0) throw new Error("the deflated bytes are damaged");
    const value = symbol === 16 ? lengths[i - 1] : 0;
    const times = symbol === 16 ? 3 + bits.take(2) : symbol === 17 ? 3 + bits.take(3) : 11 + bits.take(7);
    if (i + times > lengths.length) throw new Error("the deflated bytes are damaged");
    lengths.fill(value, i, i + times);
    i += times;
  }
  return [huffmanOf(lengths.subarray(0, literals)), huffmanOf(lengths.subarray(literals))];
}

/** @param {Bits} bits @param {Uint8Array} data @param {number} at @returns {number} */
function copyStored(bits, data, at) {
  const from = bits.align();
  const size = bits.bytes[from] | (bits.bytes[from + 1] << 8);
  if (from + 4 + size > bits.bytes.length || at + size > data.length) throw new Error("the deflated bytes are cut off");
  data.set(bits.bytes.subarray(from + 4, from + 4 + size), at);
  bits.at = from + 4 + size;
  return at + size;
}

/** @param {Bits} bits @param {Uint8Array} data @param {number} at @param {Huffman} literals @param {Huffman} distances */
function inflateBlock(bits, data, at, literals, distances) {
  for (;;) {
    const symbol = bits.symbol(literals);
    if (symbol === END_OF_BLOCK) return at;
    if (symbol < END_OF_BLOCK) {
      if (at >= data.length) throw new Error("more bytes are there than are promised");
      data[at++] = symbol;
      continue;
    }
    const row = symbol - 257;
    if (row >= LENGTH_BASE.length) throw new Error("the deflated bytes are damaged");
    const length = LENGTH_BASE[row] + bits.take(LENGTH_EXTRA[row]);
    const far = bits.symbol(distances);
    if (far >= DISTANCE_BASE.length) throw new Error("the deflated bytes are damaged");
    const distance = DISTANCE_BASE[far] + bits.take(DISTANCE_EXTRA[far]);
    if (distance > at || at + length > data.length) throw new Error("the deflated bytes are damaged");
    if (distance >= length) data.copyWithin(at, at - distance, at - distance + length);
    else for (let i = 0; i < length; i++) data[at + i] = data[at + i - distance];
    at += length;
  }
}
