"""A second reader of .ggr 3, .gamms 2 and .sight 3, which follows the format pages and shares no code with GAMMS."""

import struct
import zlib
from collections import Counter, namedtuple
from contextlib import contextmanager
from itertools import accumulate, pairwise
from math import isfinite, prod

from msgspec import MsgspecError, msgpack

DTYPES = {"bool": "?", "float16": "e", "float32": "f", "float64": "d", "int8": "b", "int16": "h", "int32": "i"}
DTYPES |= {"int64": "q", "uint8": "B", "uint16": "H", "uint32": "I", "uint64": "Q"}
FLOATS_OF = {0x01100020: 3, 0x01100021: 4}  # of events that are columns of numbers
MOST_IN_BLOCK = (1 << 16, 1 << 22, 1 << 20)  # turns, moves, events
Array = namedtuple("Array", "dtype shape items")  # noqa: PYI024 - one line; items in row-major order


class Refused(ValueError):
    """A file that a reader must refuse: the limit that it breaks, and the byte of its block."""

    def __init__(self, limit, byte=None):
        self.limit = limit
        self.byte = byte


def expect(is_right, limit, byte=None):
    """Refuse a file that is not right."""
    if not is_right:
        raise Refused(limit, byte)


class Budget:
    """What the values of a file may still cost, in bytes, and the values of each hash."""

    def __init__(self, size, most=float("inf")):
        self.left = min((64 << 20) + 1024 * size, most)
        self.most_packed = self.left // 4
        self.values = {}

    def charge(self, cost):
        self.left -= cost
        expect(self.left >= 0, "memory")

    def count_hash(self, value, data):
        same = self.values.setdefault(hash(value), set())
        same.add(data)
        expect(len(same) <= 64, "hashes")


class Cursor:
    """A place in bytes, from which parts are taken in order."""

    def __init__(self, data):
        self.data = data
        self.at = 0

    def take(self, count):
        self.at += count
        expect(self.at <= len(self.data), "missing bytes")
        return self.data[self.at - count : self.at]

    def varint(self):
        value = 0
        for place in range(9):
            byte = self.take(1)[0]
            value |= (byte & 127) << 7 * place
            if byte < 128:
                return value
        raise Refused("size")

    def packed(self, most):
        size = self.varint()
        expect(size <= most, "memory")
        inflater = zlib.decompressobj(-15)
        try:
            content = inflater.decompress(self.data[self.at :], size + 1)
        except zlib.error as error:
            raise Refused("size") from error
        expect(len(content) == size and inflater.eof, "size")
        self.at = len(self.data) - len(inflater.unused_data)
        return content

    def column(self, count):
        """Return the next column, of so many integers."""
        width = self.take(1)[0]
        if width == 9 and count:
            return self._column_by_table(count)
        expect(width <= 8 and (width == 0) == (count == 0), "column")
        planes = [self.take(count) for _ in range(width)]
        mapped = [int.from_bytes(parts, "little") for parts in zip(*planes, strict=True)]
        return [number >> 1 if number % 2 == 0 else -(number >> 1) - 1 for number in mapped]

    def _column_by_table(self, count):
        size = self.take(1)[0] + 1
        table = sums(self.column(size))
        per_byte = self.take(1)[0]
        expect(1 <= per_byte <= 8 and size**per_byte <= 256, "column")
        data = self.take(-(-count // per_byte))
        expect(max(data) < size**per_byte, "column")
        return [table[byte // size**place % size] for byte in data for place in range(per_byte)][:count]

    def end(self, *, zeros=False):
        rest = self.data[self.at :]
        expect(not (rest.strip(b"\0") if zeros else rest), "superfluous bytes")


def sums(differences):
    """Return running sums, which wrap around at 64 bits."""
    return [(total + (1 << 63)) % (1 << 64) - (1 << 63) for total in accumulate(differences)]


# -- values -----------------------------------------------------------------------------------------------------

MESSAGES = msgpack.Decoder(list[bool | int | float | str | msgpack.Ext | None])


def read_value(data, budget):
    """Return the value in some bytes."""
    budget.charge(4 * len(data))
    expect(data[:1] == b"\x91", "value")
    return _open(_items(data)[0], 1, budget)


def _items(data):
    try:
        return MESSAGES.decode(data)
    except (MsgspecError, UnicodeDecodeError) as error:
        raise Refused("value") from error


def _open(item, depth, budget):
    if not isinstance(item, msgpack.Ext):
        return item
    data = bytes(item.data)
    if item.code == 5:
        return data
    if item.code == 6:
        number = int.from_bytes(data, "big", signed=True)
        if abs(number) >= 1 << 64:
            budget.count_hash(number, data)
        return number
    try:
        if item.code == 7:
            return data.decode("utf-8", "surrogatepass")
        expect(item.code in MAKERS, "value")
        return _container(item.code, data, depth, budget)
    except UnicodeDecodeError as error:
        raise Refused("value") from error
    except TypeError as error:  # of a key without a hash
        raise Refused("key") from error


def _container(code, data, depth, budget):
    expect(depth <= 32, "depth")
    items = _items(data)
    budget.charge(160 + len(data) + 48 * len(items))
    value = MAKERS[code]([_open(item, depth + 1, budget) for item in items])
    if code == 4 or (code == 0 and _is_key(value)):
        budget.count_hash(value, data)
    return value


def _is_key(value):
    return all(_is_key(item) for item in value) if type(value) is tuple else type(value) not in (list, dict, set, Array)


def _dict(items):
    expect(len(items) % 2 == 0, "value")
    value = dict(zip(items[::2], items[1::2], strict=True))
    expect(2 * len(value) == len(items) and all(map(_is_key, value)), "key")
    return value


def _array(items):
    expect(len(items) >= 2 and isinstance(items[0], str) and isinstance(items[1], bytes), "array")
    dtype, data, *shape = items
    expect(dtype in DTYPES and len(shape) <= 8, "array")
    expect(all(type(length) is int and 0 <= length < 1 << 40 for length in shape), "array")
    size = struct.calcsize(DTYPES[dtype])
    expect(size * prod(length or 1 for length in shape) < 1 << 63, "array")
    count = prod(shape)
    expect(len(data) == size * count, "array")
    joined = bytearray(len(data))
    for plane in range(size):
        joined[plane::size] = data[plane * count : (plane + 1) * count]
    numbers = struct.unpack(f"<{count}{DTYPES[dtype]}", joined)
    if "int" in dtype:
        low = 0 if dtype[0] == "u" else -(1 << 8 * size - 1)
        numbers = [(total - low) % (1 << 8 * size) + low for total in accumulate(numbers)]
    return Array(dtype, shape, list(numbers))


MAKERS = {0: tuple, 1: list, 2: _dict, 3: set, 4: frozenset, 8: _array}


def read_dict(body, budget):
    """Return the dict in packed bytes, which zeros may follow."""
    cursor = Cursor(body)
    content = cursor.packed(budget.most_packed)
    cursor.end(zeros=True)
    value = read_value(content, budget)
    expect(isinstance(value, dict), "dict")
    return value


# -- recordings -------------------------------------------------------------------------------------------------

Block = namedtuple("Block", "type size crc key first turns moves events at body")  # noqa: PYI024 - one line


def _find_block(data, at, key):
    """Return the block at a byte, or None if its head is not right or its body is not complete."""
    head = data[at : at + 36]
    if len(head) < 36 or head[:3] != b"\xd3GB" or zlib.crc32(head[:32]) != int.from_bytes(head[32:], "little"):
        return None
    fields = struct.unpack("<B7I", head[3:32])
    body = data[at + 36 : at + 36 + fields[1]]
    block = Block(chr(fields[0]), *fields[1:], at, body)
    too_many = any(count > most for count, most in zip(block[5:8], MOST_IN_BLOCK, strict=True))
    return None if too_many or block.key != key or len(body) < block.size else block


def _fits(block):
    return zlib.crc32(block.body) == block.crc


def _find_blocks(data, at, key):
    """Return the keyframes and blocks of turns, in order, and whether the recording was finished."""
    found = []
    while (block := _find_block(data, at, key)) and _continues(found, block):
        at += 36 + block.size
        if block.type == "E" and at == len(data):
            return found, True
        if block.type in "KT":
            _add(found, block)
    if found and not _fits(found[-1]):
        at = found.pop().at
    if copy := _find_copy(data, at, key, found):
        _add(found, copy)
    return found, False


def _is_next(found, block):
    return block.first == (found[-1].first + found[-1].turns if found else 0)


def _continues(found, block):
    if block.type in "KT" and (block.type == "T") != (block.turns > 0):
        return False
    return block.type not in "EKT" or _is_next(found, block) or (_replaces(found, block) and _fits(block))


def _replaces(found, block):
    last = found[-1] if found else block._replace(type="H")
    return last.type == block.type == "T" and last.first == block.first and last.turns <= block.turns


def _add(found, block):
    if _replaces(found, block):
        found.pop()
    found.append(block)


def _find_copy(data, at, key, found):
    damaged = 0
    while damaged < 8 and (at := data.find(b"\xd3GBT", at + 1)) >= 0:
        block = _find_block(data, at, key)
        if block and block.turns and (_replaces(found, block) or _is_next(found, block)):
            if _fits(block):
                return block
            damaged += 1
    return None


@contextmanager
def _naming(byte):
    try:
        yield
    except Refused as error:
        raise Refused(error.limit, byte) from error


def read_recording(data):
    """Return the header, the keyframes and the turns of a .ggr file, and whether the recording was finished."""
    expect(data[:4] == b"MMGR" and len(data) >= 8, "magic", 0)
    expect(data[4:8] == b"\0\0\0\3", "version", 4)
    budget = Budget(len(data))
    with _naming(8):
        header = _find_block(data, 8, 0)
        expect(header and header.type == "H", "header")
        answer = {"header": _read_state(header, budget), "turns": []}
    found, answer["is_complete"] = _find_blocks(data, 44 + header.size, header.crc)
    chunks = [block for block in found if block.type == "T"]
    for block in chunks:
        with _naming(block.at):
            budget.charge(512 * block.turns + 32 * block.moves + 64 * block.events)
    for block in chunks:
        with _naming(block.at):
            answer["turns"] += _read_turns(block, budget)
    keyframes = {}
    for turn, block in {block.first: block for block in found if block.type == "K"}.items():
        with _naming(block.at):
            keyframes[turn] = _read_state(block, budget)
    return answer | {"keyframes": keyframes}


def _read_state(block, budget):
    expect(_fits(block), "crc")
    return read_dict(block.body, budget)


def _read_turns(block, budget):
    expect(_fits(block), "crc")
    cursor = Cursor(block.body)
    values = Cursor(cursor.packed(budget.most_packed))
    columns = Cursor(cursor.packed(budget.most_packed))
    cursor.end(zeros=True)
    sizes_of_turns = columns.column(block.turns), columns.column(block.turns)
    for sizes, total in zip(sizes_of_turns, (block.moves, block.events), strict=True):
        expect(min(sizes) >= 0 and sum(sizes) == total, "counts")
    rows = sums(columns.column(block.moves))
    moves = list(zip(rows, _read_tracks(columns, rows), strict=True))
    after = sums(columns.column(block.events))
    kinds = columns.column(block.events)
    sizes = columns.column(block.events)
    expect(min(sizes, default=0) >= 0 and sum(sizes) == len(values.data), "counts")
    numbers = {kind: _read_numbers(columns, kind, kinds.count(kind)) for kind in FLOATS_OF if kind in kinds}
    columns.end()
    events = iter(zip(after, kinds, sizes, strict=True))
    turns = []
    start = 0
    for move_count, event_count in zip(*sizes_of_turns, strict=True):
        log = []
        last = start
        for _ in range(event_count):
            at, kind, size = next(events)
            expect(last <= at <= start + move_count and not (kind in numbers and size), "events")
            data = next(numbers[kind]) if kind in numbers else read_value(values.take(size), budget)
            log += [*moves[last:at], (kind, data)]
            last = at
        start += move_count
        turns.append([*log, *moves[last:start]])
    return turns


def _read_tracks(columns, rows, *, of_second_differences=False):
    """Return numbers in the order of their rows from two columns: the first of each row, and differences."""
    counts = sorted(Counter(rows).items())
    firsts = sums(columns.column(len(counts)))
    others = Cursor(columns.column(len(rows) - len(counts)))
    tracks = {}
    for (row, count), first in zip(counts, firsts, strict=True):
        steps = others.take(count - 1)
        tracks[row] = iter(sums([first, *(sums(steps) if of_second_differences else steps)]))
    return [next(tracks[row]) for row in rows]


def _read_numbers(columns, kind, count):
    """Return the values of events of a kind that is stored as columns: the agent, perhaps a node, and floats."""
    rows = sums(columns.column(count))
    fields = [rows, _read_tracks(columns, rows)] if kind == 0x01100020 else [rows]
    for _ in range(FLOATS_OF[kind]):
        bits = _read_tracks(columns, rows, of_second_differences=True)
        fields.append(struct.unpack(f"<{count}d", struct.pack(f"<{count}q", *bits)))
    return zip(*fields, strict=True)


# -- saved maps and visibility tables ---------------------------------------------------------------------------

GRAPH = {"node_ids": "nodes", "xy": "nodes 2", "edge_ids": "edges", "sources": "edges", "targets": "edges"}
GRAPH |= {"lengths": "edges", "bend_rows": "bends", "bend_sizes": "bends", "bend_points": "points 2"}
GRAPH |= {"face_ids": "faces", "face_types": "faces", "face_corners": "faces 12"}
BASE_MAP = {"kinds": "shapes", "sizes": "shapes", "points": "points 2"}
BASE_MAP |= {"face_types": "walls", "face_corners": "walls 12"}
FLOATS = {"xy", "lengths", "bend_points", "face_corners", "points"}


def _read_frame(data, magic, version):
    expect(data[:8] == magic and len(data) >= 20, "magic")
    found, size, crc = struct.unpack("<3I", data[8:20])
    expect(found == version, "version")
    expect(len(data) - 20 >= size, "missing bytes")
    expect(len(data) - 20 == size, "superfluous bytes")
    expect(zlib.crc32(data[20:]) == crc, "crc")
    return read_dict(data[20:], Budget(len(data), 2 << 30))


def read_map(data):
    """Return the graph of a .gamms file, by ids: nodes, edges, attributes, obstacle faces, and what else it has."""
    state = _read_frame(data, b"GAMMSMAP", 2)
    graph = _read_columns(state, GRAPH)
    texts = {name: state.get(name, None if name == "scenery" else 0) for name in ("crs", "attribution", "scenery")}
    given = [text for text in texts.values() if text is not None]
    expect(all(isinstance(text, str) and text == text.encode(errors="ignore").decode() for text in given), "text")
    expect(texts["scenery"] is None or "base_map" not in state, "scenery")
    nodes, edges, closed = graph["node_ids"], graph["edge_ids"], state.get("closed", [])
    expect(isinstance(closed, list), "closed")
    closed = [_check_closed(edge) for edge in closed]
    expect(len({edge["id"] for edge in closed}) == len(closed), "ids")
    expect(all(len(set(ids)) == len(ids) for ids in (nodes, edges, graph["face_ids"])), "ids")
    expect(all(0 <= row < len(nodes) for row in graph["sources"] + graph["targets"]), "rows")
    places = graph["xy"] + graph["bend_points"] + graph["face_corners"]
    expect(all(isfinite(number) for place in places for number in place), "finite")
    expect(all(isfinite(length) and length >= 0 for length in graph["lengths"]), "lengths")
    _check_rows(graph["bend_rows"], edges)
    bends = dict(zip(graph["bend_rows"], split(graph["bend_points"], graph["bend_sizes"], 2), strict=True))
    columns = zip(edges, graph["sources"], graph["targets"], graph["lengths"], strict=True)
    faces = zip(graph["face_ids"], graph["face_types"], graph["face_corners"], strict=True)
    return texts | {
        "nodes": [[id, *xy] for id, xy in zip(nodes, graph["xy"], strict=True)],
        "edges": [[id, nodes[a], nodes[b], length, bends.get(row)] for row, (id, a, b, length) in enumerate(columns)],
        "faces": [[id, kind, *corners] for id, kind, corners in faces],
        "node_attributes": _read_attributes(state.get("node_attributes"), nodes),
        "edge_attributes": _read_attributes(state.get("edge_attributes"), edges),
        "closed": closed,
        "base_map": _read_base_map(state["base_map"]) if "base_map" in state else None,
    }


def _read_columns(state, shapes):
    """Return the arrays of a dict as lists, those of two dimensions as lists of lists."""
    found, lengths = {}, {}
    for name, shape in shapes.items():
        axis, *width = shape.split()
        array = state.get(name)
        expect(isinstance(array, Array) and array.dtype == ("float64" if name in FLOATS else "int64"), "array")
        expect([str(length) for length in array.shape[1:]] == width and array.shape, "array")
        expect(lengths.setdefault(axis, array.shape[0]) == array.shape[0], "array")
        found[name] = split(array.items, [int(width[0])] * array.shape[0]) if width else array.items
    return found


def split(items, sizes, least=0):
    """Return parts of a list, of so many items each, which are all of them."""
    expect(all(size >= least for size in sizes) and sum(sizes) == len(items), "sizes")
    return [items[start:end] for start, end in pairwise(accumulate(sizes, initial=0))]


def _check_rows(rows, ids):
    expect(all(a < b for a, b in pairwise(rows)) and all(0 <= row < len(ids) for row in rows), "rows")


def _read_attributes(columns, ids):
    """Return the values of attributes by name, as pairs of an id and a value."""
    expect(isinstance(columns, dict), "attribute")
    found = {}
    for name, column in columns.items():
        expect(isinstance(name, str) and isinstance(column, list) and len(column) == 3, "attribute")
        *arrays, values = column
        are_columns = all(isinstance(part, Array) and part[:2] == ("int64", [len(part.items)]) for part in arrays)
        expect(are_columns, "attribute")
        rows, numbers = (part.items for part in arrays)
        expect(isinstance(values, list) and len(rows) == len(numbers) > 0, "attribute")
        expect(all(0 <= number < len(values) for number in numbers), "attribute")
        _check_rows(rows, ids)
        found[name] = [[ids[row], values[number]] for row, number in zip(rows, numbers, strict=True)]
    return found


def _check_closed(edge):
    expect(isinstance(edge, dict) and all(isinstance(key, str) for key in edge), "closed")
    ids = [edge.get(key) for key in ("id", "source", "target")]
    expect(all(type(id) is int and -(1 << 63) <= id < 1 << 63 for id in ids), "closed")
    length = edge.get("length")
    expect(type(length) in (int, float) and isfinite(length) and length >= 0, "closed")
    line = edge.get("linestring")
    if line is None:
        return edge
    expect(isinstance(line, Array) and line.shape[1:] == [2] and line.shape[0] >= 2, "closed")
    expect(line.dtype != "bool" and all(map(isfinite, line.items)), "closed")
    return edge | {"linestring": split(line.items, [2] * line.shape[0])}


def _read_base_map(state):
    expect(isinstance(state, dict), "dict")
    arrays = [array for array in map(state.get, ("points", "face_corners")) if isinstance(array, Array)]
    expect(sum(array.shape[0] for array in arrays if array.shape) <= 1 << 20, "points")
    columns = _read_columns(state, BASE_MAP)
    places = columns["points"] + columns["face_corners"]
    shapes = list(zip(columns["kinds"], split(columns["points"], columns["sizes"]), strict=True))
    expect(all(len(points) >= (3 if kind < 16 else 2) for kind, points in shapes), "sizes")
    expect(all(abs(number) <= 1e12 for place in places for number in place), "finite")
    walls = zip(columns["face_types"], columns["face_corners"], strict=True)
    return {"shapes": [list(shape) for shape in shapes], "walls": [[kind, *corners] for kind, corners in walls]}


def read_sight(data):
    """Return the key, the radius and the height of a .sight file, and for each node the nodes that it sees."""
    state = _read_frame(data, b"GAMMSEYE", 3)
    arrays = [state.get(name) for name in ("counts", "rows")]
    expect(all(isinstance(part, Array) and part[:2] == ("int32", [len(part.items)]) for part in arrays), "array")
    seen = split(arrays[1].items, arrays[0].items, 1)
    for rows in seen:
        _check_rows(rows, seen)
    expect(isinstance(state.get("key"), bytes) and state.keys() >= {"radius", "observer_height"}, "dict")
    return {name: state[name] for name in ("key", "radius", "observer_height")} | {"seen": seen}
