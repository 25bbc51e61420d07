"""A second reader of .ggr 3, .gamms 2 and .sight 3, which follows the format pages and shares no code with GAMMS."""

import io
import struct
import zlib
from collections import Counter, namedtuple
from contextlib import suppress
from fnmatch import fnmatchcase
from itertools import accumulate, islice, pairwise
from math import inf, isfinite, prod

from msgspec import MsgspecError, msgpack

Array = namedtuple("Array", "dtype shape items")  # noqa: PYI024 - one line, with items in row-major order
Block = namedtuple("Block", "type size crc key first turns moves events at body fits")  # noqa: PYI024 - one line


class Refused(Exception):
    """A file that a reader must refuse; its arguments are the limit that it breaks, and the byte of its block."""


def expect(is_right, limit, byte=None):
    """Refuse a file that is not right."""
    if not is_right:
        raise Refused(limit, byte)


# -- packed bytes and columns -----------------------------------------------------------------------------------


class Cursor(io.BytesIO):
    """A place in bytes, from which parts are taken in order."""

    def take(self, count):
        part = self.read(count)
        expect(len(part) == count, "missing bytes")
        return part

    def packed(self, most):
        """Return the content of packed bytes, of so many bytes at most."""
        groups = [*self.take(1)]
        while groups[-1] >= 128 and len(groups) < 9:
            groups += self.take(1)
        expect(groups[-1] < 128, "size")
        size = sum((group & 127) << 7 * place for place, group in enumerate(groups))
        expect(size <= most, "memory")
        inflater = zlib.decompressobj(-15)
        content = b""
        with suppress(zlib.error):
            content = inflater.decompress(self.read(), size + 1)
        expect(len(content) == size and inflater.eof, "size")
        self.seek(-len(inflater.unused_data), io.SEEK_CUR)
        return content

    def column(self, count, *, may_have_table=True):
        """Return the next column, of so many integers."""
        width = self.take(1)[0]
        if width != 9 or count == 0 or not may_have_table:
            expect(width <= 8 and (width == 0) == (count == 0), "column")
            planes = [self.take(count) for _ in range(width)]
            mapped = [int.from_bytes(parts, "little") for parts in zip(*planes, strict=True)]
            return [(number >> 1) ^ -(number & 1) for number in mapped]
        size = self.take(1)[0] + 1
        table = sums(self.column(size, may_have_table=False))
        per_byte = self.take(1)[0]
        expect(1 <= per_byte <= 8 and size**per_byte <= 256, "column")
        data = self.take(-(-count // per_byte))
        expect(max(data) < size**per_byte, "column")
        return [table[byte // size**place % size] for byte in data for place in range(per_byte)][:count]


def sums(differences, low=-(1 << 63), bits=64):
    """Return running sums, which wrap around like integers of so many bits, of which `low` is the lowest."""
    return [(total - low) % (1 << bits) + low for total in accumulate(differences)]


def split(items, sizes, limit="sizes", least=0):
    """Return parts of a list, of so many items each, which are all of them."""
    expect(min(sizes, default=least) >= least and sum(sizes) == len(items), limit)
    return [items[start:end] for start, end in pairwise(accumulate(sizes, initial=0))]


# -- values -----------------------------------------------------------------------------------------------------

ITEMS = msgpack.Decoder(list[bool | int | float | str | msgpack.Ext | None])
DTYPES = {"bool": "?", "float16": "e", "float32": "f", "float64": "d", "int8": "b", "int16": "h", "int32": "i"}
DTYPES |= {"int64": "q", "uint8": "B", "uint16": "H", "uint32": "I", "uint64": "Q"}


def make_array(items):
    """Return the array with a dtype, bytes and dimensions."""
    expect([*map(type, items[:2])] == [str, bytes], "array")
    dtype, data, *shape = items
    expect(dtype in DTYPES and len(shape) <= 8 and all(type(n) is int and 0 <= n < 1 << 40 for n in shape), "array")
    size = struct.calcsize(DTYPES[dtype])
    count = prod(shape)
    expect(size * prod(n or 1 for n in shape) < 1 << 63 and len(data) == size * count, "array")
    joined = b"".join(data[at::count] for at in range(count))
    numbers = struct.unpack(f"<{count}{DTYPES[dtype]}", joined)
    if "int" in dtype:
        numbers = sums(numbers, 0 if dtype[0] == "u" else -(1 << 8 * size - 1), 8 * size)
    return Array(dtype, shape, list(numbers))


FROM_BYTES = {5: bytes, 6: lambda data: int.from_bytes(data, "big", signed=True)}
FROM_BYTES[7] = lambda data: data.decode("utf-8", "surrogatepass")
FROM_ITEMS = {0: tuple, 1: list, 3: set, 4: frozenset, 8: make_array}
FROM_ITEMS[2] = lambda items: dict(zip(items[::2], items[1::2], strict=True))


class Values:
    """The values of a file: how many bytes they may still cost, and those of each hash."""

    def __init__(self, size, most=inf):
        self.left = min((64 << 20) + 1024 * size, most)
        self.most_packed = self.left // 4
        self.of_hash = {}

    def charge(self, cost):
        self.left -= cost
        expect(self.left >= 0, "memory")

    def unpack(self, body, crc, count):
        """Return the contents of so many packed bytes, which zeros may follow."""
        expect(zlib.crc32(body) == crc, "crc")
        cursor = Cursor(body)
        contents = [cursor.packed(self.most_packed) for _ in range(count)]
        expect(not cursor.read().strip(b"\0"), "superfluous bytes")
        return contents

    def read_dict(self, body, crc):
        """Return the dict in packed bytes."""
        value = self.read(*self.unpack(body, crc, 1))
        expect(isinstance(value, dict), "dict")
        return value

    def read(self, data):
        """Return the value in some bytes."""
        self.charge(4 * len(data))
        expect(data[:1] == b"\x91", "value")
        try:
            return self._open(ITEMS.decode(data)[0], 1)
        except (MsgspecError, ValueError, TypeError) as error:  # a TypeError if a key has no hash
            raise Refused("key" if isinstance(error, TypeError) else "value", None) from error

    def _open(self, item, depth):
        if not isinstance(item, msgpack.Ext):
            return item
        data = bytes(item.data)
        if item.code in FROM_BYTES:
            value = FROM_BYTES[item.code](data)
        else:
            expect(item.code in FROM_ITEMS, "value")
            expect(depth <= 32, "depth")
            items = ITEMS.decode(data)
            self.charge(160 + len(data) + 48 * len(items))
            value = FROM_ITEMS[item.code]([self._open(one, depth + (7 if item.code in (3, 4) else 1)) for one in items])
            expect(item.code != 2 or 2 * len(value) == len(items), "key")
        if item.code in (0, 4) or (item.code == 6 and abs(value) >= 1 << 64):
            with suppress(TypeError):  # of a tuple with a list in it
                same = self.of_hash.setdefault(hash(value), set())
                same.add(data)
                expect(len(same) <= 64, "hashes")
        return value


# -- recordings -------------------------------------------------------------------------------------------------

FLIGHTS = {0x01100020: (1, 3), 0x01100021: (0, 4)}  # kinds of events in columns: how many nodes and floats


def read_recording(data):
    """Return the header, the turns and the keyframes of a .ggr file, and whether the recording was finished."""
    expect(data[:4] == b"MMGR" and len(data) >= 8, "magic", 0)
    expect(data[4:8] == b"\0\0\0\3", "version", 4)
    block = find_block(data, 8, 0)
    expect(block and block.type == "H", "header", 8)
    found, is_complete = _find_blocks(data, 44 + block.size, block.crc)
    of_turns = [block for block in found if block.type == "T"]
    values = Values(len(data))
    try:
        answer = {"header": values.read_dict(block.body, block.crc), "turns": [], "keyframes": {}}
        for block in of_turns:
            values.charge(512 * block.turns + 32 * block.moves + 64 * block.events)
        for block in of_turns:
            answer["turns"] += _read_turns(block, values)
        for turn, block in {block.first: block for block in found if block.type == "K"}.items():
            answer["keyframes"][turn] = values.read_dict(block.body, block.crc)
    except Refused as error:
        raise Refused(error.args[0], block.at) from error
    return answer | {"is_complete": is_complete}


def find_block(data, at, key):
    """Return the block at a byte, or None if its head is not right or its body is not complete."""
    head = data[at : at + 36]
    if len(head) < 36 or head[:3] != b"\xd3GB" or zlib.crc32(head[:32]) != int.from_bytes(head[32:], "little"):
        return None
    letter, size, *fields = struct.unpack("<B7I", head[3:32])
    body = data[at + 36 : at + 36 + size]
    block = Block(chr(letter), size, *fields, at, body, zlib.crc32(body) == fields[0])
    are_few = block.turns <= 1 << 16 and block.moves <= 1 << 22 and block.events <= 1 << 20
    has_turns = block.type not in "KT" or (block.type == "T") == (block.turns > 0)
    return block if are_few and has_turns and block.key == key and len(body) == size else None


def _find_blocks(data, at, key):
    """Return the keyframes and blocks of turns, in order, and whether the recording was finished."""
    found = []
    while block := find_block(data, at, key):
        place = _find_place(found, block)
        if block.type in "EKT" and (place is None or (place < len(found) and not block.fits)):
            break
        at += 36 + block.size
        if block.type == "E" and at == len(data):
            return found, True
        if block.type in "KT":
            found[place:] = [block]
    if found and not found[-1].fits:
        at = found.pop().at
    damaged = 0
    while damaged < 8 and (at := data.find(b"\xd3GBT", at + 1)) >= 0:  # a copy of the last block
        block = find_block(data, at, key)
        place = _find_place(found, block) if block else None
        if place is not None and block.fits:
            return [*found[:place], block], False
        damaged += place is not None
    return found, False


def _find_place(found, block):
    """Return how many blocks stay before a block: all, or all but the last one; None if it cannot follow them."""
    last = found[-1] if found else block._replace(type="H", first=0, turns=0)
    if last.type == block.type == "T" and last.first == block.first and last.turns <= block.turns:
        return len(found) - 1
    return len(found) if block.first == last.first + last.turns else None


def _read_turns(block, values):
    content, columns = values.unpack(block.body, block.crc, 2)
    cursor = Cursor(columns)
    move_counts, event_counts = cursor.column(block.turns), cursor.column(block.turns)
    moves = _read_rows(cursor, block.moves, 1, 0)
    after = sums(cursor.column(block.events))
    kinds = cursor.column(block.events)
    texts = split(content, cursor.column(block.events), "counts")
    tuples = {kind: iter(_read_rows(cursor, kinds.count(kind), *FLIGHTS[kind])) for kind in FLIGHTS if kind in kinds}
    expect(not cursor.read(), "superfluous bytes")
    events = split([*zip(after, kinds, texts, strict=True)], event_counts, "counts")
    turns = []
    start = 0
    for own_moves, own_events in zip(split(moves, move_counts, "counts"), events, strict=True):
        turns.append([])
        end = start + len(own_moves)
        for at, kind, text in own_events:
            expect(start <= at <= end and not (kind in tuples and text), "events")
            value = next(tuples[kind]) if kind in tuples else values.read(text)
            turns[-1] += [*moves[start:at], (kind, value)]
            start = at
        turns[-1] += moves[start:end]
        start = end
    return turns


def _read_rows(cursor, count, nodes, floats):
    """Return moves, or the values of events in columns: an agent, and its numbers."""
    rows = sums(cursor.column(count))
    fields = [rows, *(_read_tracks(cursor, rows) for _ in range(nodes))]
    for _ in range(floats):
        bits = _read_tracks(cursor, rows, sums)
        fields.append(struct.unpack(f"<{count}d", struct.pack(f"<{count}q", *bits)))
    return [*zip(*fields, strict=True)]


def _read_tracks(cursor, rows, undo=list):
    """Return numbers in the order of their rows from two columns: the first of each row, and differences."""
    counts = sorted(Counter(rows).items())
    firsts = sums(cursor.column(len(counts)))
    others = iter(cursor.column(len(rows) - len(counts)))
    tracks = {}
    for (row, count), first in zip(counts, firsts, strict=True):
        tracks[row] = iter(sums([first, *undo(islice(others, count - 1))]))
    return [next(tracks[row]) for row in rows]


# -- tables of arrays: dtype and shape --------------------------------------------------------------------------

GRAPH = {"node_ids": "int64 nodes", "xy": "float64 nodes 2", "edge_ids": "int64 edges", "sources": "int64 edges"}
GRAPH |= {"targets": "int64 edges", "lengths": "float64 edges", "bend_rows": "int64 bends"}
GRAPH |= {"bend_sizes": "int64 bends", "bend_points": "float64 points 2"}
GRAPH |= {"face_ids": "int64 faces", "face_types": "int64 faces", "face_corners": "float64 faces 12"}
BASE_MAP = {"kinds": "int64 shapes", "sizes": "int64 shapes", "points": "float64 points 2"}
BASE_MAP |= {"face_types": "int64 walls", "face_corners": "float64 walls 12"}
FLOATS_END = (1 << 1024) - (1 << 970)  # integers from this one on are not finite as float64
ATTRIBUTE = {"rows": "int64 rows", "numbers": "int64 rows"}
LOOKS = {"agents": "*int* agents", "counts": "*int* agents", "which": "*int* looks", "forms": "*int* looks"}
LOOKS |= {"sizes": "*int* looks 2", "ids": "*int* ids", "seen": "*int* seen", "seen_at": "*int* seen"}
DISCS = {"radii": "float64 sensors", "shown": "bool sensors seen"}


def read_arrays(state, table, limit="array", **lengths):
    """Return the arrays of a dict as lists, those of two dimensions as lists of lists."""
    found = {}
    for name, description in table.items():
        dtype, *axes = description.split()
        array = state.get(name)
        expect(isinstance(array, Array) and fnmatchcase(array.dtype, dtype) and len(array.shape) == len(axes), limit)
        expect(dtype != "*int*" or max(array.items, default=0) < 1 << 63, limit)
        for axis, length in zip(axes, array.shape, strict=True):
            expect(length == (int(axis) if axis.isdigit() else lengths.setdefault(axis, length)), limit)
        found[name] = split(array.items, array.shape[1:] * array.shape[0]) if len(axes) == 2 else array.items
    return found


def expect_rows(rows, count):
    """Refuse rows that are not ascending, or do not exist."""
    expect(all(a < b for a, b in pairwise([-1, *rows, count])), "rows")


# -- saved maps and visibility tables ---------------------------------------------------------------------------


def read_frame(data, magic, version):
    """Return the dict of a saved map or a visibility table."""
    expect(data[:8] == magic and len(data) >= 20, "magic")
    found, size, crc = struct.unpack("<3I", data[8:20])
    expect(found == version, "version")
    expect(len(data) - 20 >= size, "missing bytes")
    expect(len(data) - 20 == size, "superfluous bytes")
    return Values(len(data), 2 << 30).read_dict(data[20:], crc)


def read_map(data):
    """Return the graph of a .gamms file: its columns, bends and attributes by row, closed edges and base map."""
    state = read_frame(data, b"GAMMSMAP", 2)
    graph = read_arrays(state, GRAPH)
    given = [state.get("crs", 0), state.get("attribution", 0), state.get("scenery")]
    texts = [text for text in given if text is not None]
    expect(all(isinstance(text, str) and text == text.encode(errors="ignore").decode() for text in texts), "text")
    expect(state.get("scenery") is None or "base_map" not in state, "scenery")
    nodes, edges, faces = (graph[name] for name in ("node_ids", "edge_ids", "face_ids"))
    expect(all(len(set(ids)) == len(ids) for ids in (nodes, edges, faces)), "ids")
    expect(all(0 <= row < len(nodes) for row in graph["sources"] + graph["targets"]), "rows")
    places = graph["xy"] + graph["bend_points"] + graph["face_corners"]
    expect(all(isfinite(number) for place in places for number in place), "finite")
    expect(all(0 <= length < inf for length in graph["lengths"]), "lengths")
    expect_rows(graph["bend_rows"], len(edges))
    bends = split(graph["bend_points"], graph["bend_sizes"], least=2)
    return graph | {
        "texts": given,
        "bends": dict(zip(graph["bend_rows"], bends, strict=True)),
        "node_attributes": _read_attributes(state.get("node_attributes"), len(nodes)),
        "edge_attributes": _read_attributes(state.get("edge_attributes"), len(edges)),
        "closed": _read_closed(state.get("closed", [])),
        "base_map": _read_base_map(state["base_map"]) if "base_map" in state else None,
    }


def _read_attributes(attributes, count):
    """Return the values of attributes by name and row."""
    expect(isinstance(attributes, dict), "attribute")
    found = {}
    for name, parts in attributes.items():
        expect(isinstance(name, str) and isinstance(parts, list) and len(parts) == 3, "attribute")
        rows, numbers = read_arrays({"rows": parts[0], "numbers": parts[1]}, ATTRIBUTE, "attribute").values()
        values = parts[2]
        expect(isinstance(values, list) and rows and all(0 <= number < len(values) for number in numbers), "attribute")
        expect_rows(rows, count)
        found[name] = dict(zip(rows, (values[number] for number in numbers), strict=True))
    return found


def _read_closed(edges):
    expect(isinstance(edges, list), "closed")
    for edge in edges:
        expect(isinstance(edge, dict) and all(isinstance(key, str) for key in edge), "closed")
        ids = [edge.get(key) for key in ("id", "source", "target")]
        expect(all(type(id) is int and -(1 << 63) <= id < 1 << 63 for id in ids), "closed")
        expect(type(edge.get("length")) in (int, float) and 0 <= edge["length"] < FLOATS_END, "closed")
        if edge.get("linestring") is not None:
            [points] = read_arrays(edge, {"linestring": "*[0-9] points 2"}, "closed").values()
            expect(len(points) >= 2 and all(isfinite(number) for point in points for number in point), "closed")
            edge["linestring"] = points
    expect(len({edge["id"] for edge in edges}) == len(edges), "ids")
    return edges


def _read_base_map(state):
    expect(isinstance(state, dict), "dict")
    columns = read_arrays(state, BASE_MAP)
    places = columns["points"] + columns["face_corners"]
    expect(len(places) <= 1 << 20, "points")
    expect(all(abs(number) <= 1e12 for place in places for number in place), "finite")
    shapes = split(columns["points"], columns["sizes"])
    are_long = all(len(shape) >= (3 if kind < 16 else 2) for kind, shape in zip(columns["kinds"], shapes, strict=True))
    expect(are_long, "sizes")
    return columns | {"shapes": shapes}


def read_sight(data):
    """Return the key, the radius and the height of a .sight file, and for each node the nodes that it sees."""
    state = read_frame(data, b"GAMMSEYE", 3)
    counts, rows = read_arrays(state, {"counts": "int32 nodes", "rows": "int32 rows"}).values()
    seen = split(rows, counts, least=1)
    for own in seen:
        expect_rows(own, len(seen))
    expect(isinstance(state.get("key"), bytes) and state.keys() >= {"radius", "observer_height"}, "dict")
    return {name: state[name] for name in ("key", "radius", "observer_height")} | {"seen": seen}


# -- looks of sensors -------------------------------------------------------------------------------------------

NEW_MAP, SENSED = 0x03000000, 0x06000001  # kinds of events
NONE_SEEN = dict.fromkeys(("seen", "seen_at"), Array("int64", [0], []))


def read_looks(recording):
    """Return the looks of each turn: agent, sensor, kind, form, both parts of ids, other data, and covered nodes."""
    first_map = newest = _read_places(recording["header"])
    fields = {}
    looks = []
    for turn in recording["turns"]:
        looks.append([])
        in_discs = 0
        for kind, data in turn:
            if kind == NEW_MAP:
                newest = _read_places(data)
                expect(newest is not None, "dict")
            if kind == SENSED:
                columns = _read_columns(data)
                in_discs += columns["forms"].count(6) * len(columns["seen"])
                expect(in_discs <= 1 << 24, "looks")
                for *look, field in _read_event(columns, fields, first_map):
                    looks[-1].append((*look, _find_covered(field, newest)))
    return looks


def _read_places(state):
    expect(isinstance(state, dict) and isinstance(state.get("world", b""), bytes), "dict")
    graph = read_map(state["world"]) if "world" in state else None
    return graph and dict(zip(graph["node_ids"], graph["xy"], strict=True))


def _read_columns(data):
    expect(isinstance(data, dict), "looks")
    columns = data | read_arrays(data if "seen" in data else data | NONE_SEEN, LOOKS, "looks")
    sensors = columns.get("sensors")
    expect(type(sensors) is type(columns.get("others")) is list, "looks")
    expect(all(type(one) is tuple and [*map(type, one)] == [str, str] for one in sensors), "looks")
    return columns


def _read_event(columns, fields, first_map):
    """Yield the looks of an event, each with its field."""
    which, forms, sensors, seen = (columns[name] for name in ("which", "forms", "sensors", "seen"))
    owners = zip(columns["agents"], split(which, columns["counts"], "looks"), strict=True)
    agents = [agent for agent, own in owners for _ in own]
    parts = split(columns["ids"], [size for pair in columns["sizes"] for size in pair])
    first, second = parts[::2], parts[1::2]
    expect(len(columns["others"]) == forms.count(3) + forms.count(4), "looks")
    others = iter(columns["others"])
    discs = _read_discs(columns, first_map) if 6 in forms else None
    covered = _read_fields(columns, fields)
    for row, form in enumerate(forms):
        expect(0 <= form <= 6 and 0 <= which[row] < len(sensors), "looks")
        expect(form == 1 or len(second[row]) == (len(first[row]) if form in (2, 4) else 0), "looks")
        expect(form not in (3, 6) or not first[row], "looks")
        other = next(others) if form in (3, 4) else None
        expect(form != 4 or (type(other) is list and len(other) == len(first[row])), "looks")
        if form == 6:
            first[row], covered[row] = _look_around(agents[row], columns, first_map, *discs[which[row]])
        if form in (5, 6):
            expect(all(0 <= place < len(seen) for place in first[row]), "looks")
            first[row], second[row] = ([columns[name][place] for place in first[row]] for name in NONE_SEEN)
        yield agents[row], *sensors[which[row]], 2 if form > 4 else form, first[row], second[row], other, covered[row]


def _read_discs(columns, first_map):
    """Return the radius of each sensor, and which listed agents it may report."""
    seen = columns["seen"]
    radii, shown = read_arrays(columns, DISCS, "looks", sensors=len(columns["sensors"]), seen=len(seen)).values()
    expect(all(radius >= 0 for radius in radii) and len(set(seen)) == len(seen) and first_map is not None, "looks")
    listed = zip(columns["seen_at"], *shown, strict=True)
    expect(all(node in first_map or not any(marks) for node, *marks in listed), "looks")
    return [*zip(radii, shown, strict=True)]


def _look_around(agent, columns, first_map, radius, shown):
    """Return the places of the listed agents in a disc around an agent, and the field."""
    listed = [*zip(columns["seen"], columns["seen_at"], strict=True)]
    middle = dict(listed).get(agent)
    expect(middle in first_map, "looks")
    near = _find_near(first_map, *first_map[middle], radius)
    places = [at for at, (number, node) in enumerate(listed) if shown[at] and number != agent and node in near]
    return places, (middle, radius, b"") if radius < inf else None


def _read_fields(columns, fields):
    """Return the recorded field of each look, and keep the new ones by number."""
    forms = columns["forms"]
    if "fields" not in columns:
        return [None] * len(forms)
    [numbers] = read_arrays(columns, {"fields": "uint* looks"}, "fields", looks=len(forms)).values()
    expect(not any(number for number, form in zip(numbers, forms, strict=True) if form == 6), "fields")
    first, new = columns.get("first_field"), columns.get("new_fields")
    expect(type(first) is int and type(new) is list and 0 <= first >= max(numbers, default=0) - len(new), "fields")
    for field in new:
        expect(type(field) is tuple and [*map(type, field[1:])] == [float, bytes] and 0 <= field[1] < inf, "fields")
        is_position = type(field[0]) is tuple and [*map(type, field[0])] == [float, float]
        expect(type(field[0]) is int or (is_position and all(map(isfinite, field[0]))), "fields")
    if first == 0:
        fields.clear()
    fields |= enumerate(new, first)
    return [fields.get(number - 1) for number in numbers]


def _find_covered(field, places):
    """Return the ids of the nodes that a field covers; None without a field or a map."""
    if field is None or places is None:
        return None
    place, radius, bits = field
    expect(type(place) is tuple or place in places, "fields")
    near = _find_near(places, *places.get(place, place), radius)
    expect(len(bits) in (0, -(-len(near) // 8)), "fields")
    return [id for at, id in enumerate(near) if not (bits and bits[at // 8] << at % 8 & 128)]


def _find_near(places, x, y, radius):
    """Return the ids of the nodes within a radius, ascending."""
    return sorted(id for id, (a, b) in places.items() if (a - x) * (a - x) + (b - y) * (b - y) <= radius * radius)
