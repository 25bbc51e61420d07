// Plain values from bytes: MessagePack with extensions, as docs/recording-format.md describes it. A dict becomes a Map, so
// that no key of a file can reach a prototype.

const MOST_DEPTH = 32;
const TWO_32 = 4294967296;
const LARGEST_HIGH = 1 << 21; // a high word below it makes an exact number
const TUPLE = 0, LIST = 1, DICT = 2, SET = 3, FROZENSET = 4, BYTES = 5, INT = 6, TEXT = 7, ARRAY = 8;
const WIDTHS = { bool: 1, int8: 1, uint8: 1, int16: 2, uint16: 2, int32: 4, uint32: 4, int64: 8, uint64: 8, float32: 4, float64: 8 };
const text = new TextDecoder();

/** Reads bytes from front to back, never past their end. */
class ByteReader {
  /** @param {Uint8Array} bytes */
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
  }

  /** Return the next bytes. @param {number} size */
  take(size) {
    if (size > this.bytes.length - this.at) throw new Error(`${size} bytes are promised and fewer are there`);
    this.at += size;
    return this.bytes.subarray(this.at - size, this.at);
  }
}

/** Return the plain value in bytes. @param {Uint8Array} bytes @returns {any} */
export function valueOf(bytes) {
  const items = itemsOf(bytes, MOST_DEPTH);
  if (items.length !== 1) throw new Error("a value is an array of one item");
  return items[0];
}

/** Return the items of one array of MessagePack. @param {Uint8Array} bytes @param {number} depth @returns {any[]} */
function itemsOf(bytes, depth) {
  const reader = new ByteReader(bytes);
  const count = countOf(reader);
  if (count > bytes.length) throw new Error("an array is cut off");
  const items = new Array(count);
  for (let i = 0; i < count; i++) items[i] = itemOf(reader, depth);
  return items;
}

/** @param {ByteReader} reader */
function countOf(reader) {
  const head = reader.take(1)[0];
  if (head >> 4 === 9) return head & 15;
  if (head === 0xdc) return unsigned(reader, 2);
  if (head === 0xdd) return unsigned(reader, 4);
  throw new Error("an array is expected");
}

/** @param {ByteReader} reader @param {number} size */
function unsigned(reader, size) {
  let value = 0;
  for (const byte of reader.take(size)) value = value * 256 + byte;
  return value;
}

/** @param {ByteReader} reader @param {number} size */
function signed(reader, size) {
  const value = unsigned(reader, size);
  return value >= 2 ** (8 * size - 1) ? value - 2 ** (8 * size) : value;
}

/** @param {ByteReader} reader @param {number} depth @returns {any} */
function itemOf(reader, depth) {
  const head = reader.take(1)[0];
  if (head < 0x80) return head;
  if (head >= 0xe0) return head - 256;
  if (head >> 5 === 5) return text.decode(reader.take(head & 31));
  switch (head) {
    case 0xc0: return null;
    case 0xc2: return false;
    case 0xc3: return true;
    case 0xca: reader.at += 4; return reader.view.getFloat32(reader.at - 4);
    case 0xcb: reader.take(8); return reader.view.getFloat64(reader.at - 8);
    case 0xcc: case 0xcd: case 0xce: case 0xcf: return unsigned(reader, 1 << (head - 0xcc));
    case 0xd0: case 0xd1: case 0xd2: case 0xd3: return signed(reader, 1 << (head - 0xd0));
    case 0xd9: case 0xda: case 0xdb: return text.decode(reader.take(unsigned(reader, 1 << (head - 0xd9))));
    case 0xc7: case 0xc8: case 0xc9: return extension(reader, unsigned(reader, 1 << (head - 0xc7)), depth);
    case 0xd4: case 0xd5: case 0xd6: case 0xd7: case 0xd8: return extension(reader, 1 << (head - 0xd4), depth);
    default: throw new Error(`byte ${head} begins no value`);
  }
}

/** @param {ByteReader} reader @param {number} size @param {number} depth @returns {any} */
function extension(reader, size, depth) {
  const type = reader.take(1)[0];
  const bytes = reader.take(size);
  if (type === BYTES) return bytes;
  if (type === TEXT) return text.decode(bytes);
  if (type === INT) return largeInt(bytes);
  if (depth < 1) throw new Error("too many containers are in each other");
  const items = itemsOf(bytes, depth - 1);
  if (type === DICT) return dictOf(items);
  if (type === ARRAY) return arrayOf(items);
  if (type === TUPLE || type === LIST || type === SET || type === FROZENSET) return items;
  throw new Error(`a value of type ${type} is unknown`);
}

/** @param {Uint8Array} bytes big-endian, in two's complement */
function largeInt(bytes) {
  let value = 0;
  for (const byte of bytes) value = value * 256 + byte;
  return bytes[0] > 127 ? value - 256 ** bytes.length : value;
}

/** @param {any[]} items @returns {Map<any, any>} */
function dictOf(items) {
  const found = new Map();
  for (let i = 0; i + 1 < items.length; i += 2) found.set(keyOf(items[i]), items[i + 1]);
  return found;
}

/** Return what stands for a key: tuples are compared by what is in them. @param {any} key */
function keyOf(key) {
  return Array.isArray(key) ? JSON.stringify(key) : key;
}

/**
 * Return the flat items of an array; its shape is left out, because each reader knows it.
 * @param {any[]} items dtype, bytes, and the lengths of the dimensions
 * @returns {Float64Array | Float32Array | Int32Array | Uint8Array}
 */
function arrayOf([dtype, planes, ...shape]) {
  const width = Object.hasOwn(WIDTHS, dtype) ? WIDTHS[dtype] : 0;
  const count = shape.reduce((product, length) => product * length, 1);
  if (!width || !(planes instanceof Uint8Array) || !(count >= 0) || planes.length < count * width) {
    throw new Error("an array is damaged");
  }
  const stride = planes.length / width;
  if (dtype === "bool") return planes.slice(0, count);
  if (width === 8 && dtype !== "float64") return wideInts(planes, stride, count);
  const bytes = new Uint8Array(count * width);
  for (let byte = 0; byte < width; byte++) {
    for (let i = 0, at = byte, from = byte * stride; i < count; i++, at += width) bytes[at] = planes[from + i];
  }
  if (dtype === "float64") return new Float64Array(bytes.buffer);
  if (dtype === "float32") return new Float32Array(bytes.buffer);
  const Kind = { int8: Int8Array, uint8: Uint8Array, int16: Int16Array, uint16: Uint16Array, int32: Int32Array, uint32: Uint32Array }[dtype];
  const ints = new Kind(bytes.buffer);
  for (let i = 1; i < count; i++) ints[i] += ints[i - 1];
  return ints;
}

/** Return 64-bit integers, which are written as differences, as numbers. */
function wideInts(/** @type {Uint8Array} */ planes, /** @type {number} */ stride, /** @type {number} */ count) {
  const found = new Float64Array(count);
  for (let i = 0, sum = 0; i < count; i++) {
    let low = 0, high = 0;
    for (let byte = 3; byte >= 0; byte--) {
      low = low * 256 + planes[byte * stride + i];
      high = high * 256 + planes[(byte + 4) * stride + i];
    }
    high |= 0;
    if (high >= LARGEST_HIGH || high < -LARGEST_HIGH) return widestInts(planes, stride, count);
    sum += high * TWO_32 + low;
    found[i] = sum;
  }
  return found;
}

/** The same for differences that wrap around. */
function widestInts(/** @type {Uint8Array} */ planes, /** @type {number} */ stride, /** @type {number} */ count) {
  const found = new Float64Array(count);
  for (let i = 0, sum = 0n; i < count; i++) {
    let step = 0n;
    for (let byte = 7; byte >= 0; byte--) step = (step << 8n) | BigInt(planes[byte * stride + i]);
    sum = BigInt.asIntN(64, sum + step);
    found[i] = Number(sum);
  }
  return found;
}

/** Return points whose columns follow each other, x, y, x, y, …, counted in steps. @param {ArrayLike<number>} columns @param {number} axes @param {number} step */
export function interleaved(columns, axes, step) {
  const size = columns.length / axes;
  return Float64Array.from({ length: columns.length }, (_, i) => step * columns[(i % axes) * size + Math.floor(i / axes)]);
}
