"""Write the format vectors: small .ggr, .gamms and .sight files, and beside each the answer of a reader, as JSON.

    python scripts/make_vectors.py              # tests/formats/vectors

Files are built byte by byte, with the answer beside them, except games and maps, which GAMMS writes. A file is written
only if GAMMS and the second reader give the same answer, and the stated one.
"""

import io
import struct
import sys
import zlib
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from msgspec import msgpack

import gamms
from gamms import recorder
from gamms.agent import AgentType
from gamms.graph.visibility import VisibilityRows
from gamms.graph.visibility import encode as encode_sight
from gamms.recorder import Writer
from gamms.rules import tag, time_limit
from gamms.scenario import Scenario
from gamms.typing import ArtistType
from gamms.visual import Artist
from gamms.visual.legend import ColorScale, LegendRow, LegendRows

TESTS = Path(__file__).parent.parent / "tests" / "formats"
sys.path.insert(0, str(TESTS))
import answers  # noqa: E402 - it is beside the vectors

VECTORS = TESTS / "vectors"
FLIGHT = 0x01100020
TURN = 0x01100021
NEW_MAP = 0x03000000
SENSED = 0x06000001
PRIME = (1 << 61) - 1  # the hash of an integer is its remainder

Vector = tuple[str, bytes, dict[str, Any]]  # the name of the file, its bytes, the answer; empty if GAMMS says it


def main() -> None:
    """Write all vectors."""
    VECTORS.mkdir(exist_ok=True)
    for old in VECTORS.iterdir():
        old.unlink()
    for name, data, stated in make_all():
        answer, problem = find_answer(Path(name).suffix, data, stated)
        if problem:
            print(f"{name}: {problem}")
        (VECTORS / name).write_bytes(data)
        (VECTORS / f"{name}.json").write_text(answers.as_text(answer), encoding="utf-8")
    files = [path for path in VECTORS.iterdir() if path.suffix != ".json"]
    print(f"{len(files)} vectors, {sum(path.stat().st_size for path in files)} bytes")


def find_answer(suffix: str, data: bytes, stated: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """Return the answer of both readers, and what is wrong with it."""
    second = answers.ask_second(suffix, data)
    first, message = answers.ask_gamms(suffix, data)
    if "refused" in first:
        first["refused"] = second.get("refused")
    problem = ""
    if answers.as_text(first) != answers.as_text(second):
        problem = f"the readers differ ({message}; {str(second)[:300]})"
    if any(
        second.get(key) != (value if key in ("refused", "byte") else answers.as_json(value))
        for key, value in stated.items()
    ):
        problem = f"{ {key: second.get(key) for key in stated} } is not {stated}; {message}"
    return second, problem


def make_all() -> Iterator[Vector]:
    """Yield all vectors."""
    for suffix, makers in (
        (".ggr", (make_values, make_bad_values, make_forms, make_keys, make_hashes)),
        (".ggr", (make_columns, make_packed, make_sums, make_blocks, make_looks, make_limits, make_games)),
        (".gamms", (make_maps, make_ranges, make_bad_maps, make_bad_ranges)),
        (".sight", (make_sights,)),
    ):
        for make in makers:
            for name, data, answer in make():
                yield f"{name}{suffix}", data, answer


# -- parts of files ---------------------------------------------------------------------------------------------


def varint(value: int) -> bytes:
    """Return a varint."""
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def packed(data: bytes, size: int | None = None) -> bytes:
    """Return packed bytes, with another size than theirs if one is given."""
    deflater = zlib.compressobj(9, zlib.DEFLATED, -15)
    return varint(len(data) if size is None else size) + deflater.compress(data) + deflater.flush()


def column(*numbers: int, width: int | None = None) -> bytes:
    """Return a column without a table, of a width in bytes or the least one."""
    mapped = [2 * n if n >= 0 else -2 * n - 1 for n in numbers]
    if width is None:
        width = max([1, *((n.bit_length() + 7) // 8 for n in mapped)]) if mapped else 0
    planes = [n.to_bytes(8, "little") for n in mapped]
    return bytes([width]) + bytes(plane[place] for place in range(width) for plane in planes)


def differences(*numbers: int) -> list[int]:
    """Return the differences of consecutive numbers, the first from 0."""
    return [b - a for a, b in zip((0, *numbers), numbers, strict=False)]


def array(*items: object) -> bytes:
    """Return a MessagePack array."""
    return msgpack.encode(list(items))


def extension(code: int, *items: object) -> msgpack.Ext:
    """Return a container."""
    return msgpack.Ext(code, array(*items))


def nested(item: object, code: int, depth: int) -> object:
    """Return an item in so many containers of a type."""
    for _ in range(depth):
        item = extension(code, item)
    return item


def plain(value: object) -> object:
    """Return a value as an item of MessagePack."""
    if type(value) in (tuple, list, set, frozenset):
        code = {tuple: 0, list: 1, set: 3, frozenset: 4}[type(value)]
        items = [plain(item) for item in value]
        return extension(code, *(sorted(items, key=array) if code > 1 else items))
    if type(value) is dict:
        return extension(2, *(plain(part) for pair in value.items() for part in pair))
    if type(value) is bytes:
        return msgpack.Ext(5, value)
    if type(value) is int and not -(1 << 63) <= value < 1 << 64:
        return msgpack.Ext(6, value.to_bytes(value.bit_length() // 8 + 1, "big", signed=True))
    return value


def value_of(value: object) -> bytes:
    """Return a value as bytes."""
    return array(plain(value))


def block(type: str, body: bytes, key: int = 0, *counts: int, crc: int | None = None) -> bytes:
    """Return a block; `counts` are the turns before it, and its turns, moves and events."""
    front = b"\xd3GB" + type.encode()
    front += struct.pack("<7I", len(body), zlib.crc32(body) if crc is None else crc, key, *(*counts, 0, 0, 0, 0)[:4])
    return front + struct.pack("<I", zlib.crc32(front)) + body


MAGIC = b"MMGR\0\0\0\3"
HEADER_BODY = packed(value_of({"format": 3}))
HEADER = MAGIC + block("H", HEADER_BODY)
KEY = zlib.crc32(HEADER_BODY)


def end(turns: int = 0) -> bytes:
    """Return the end of a recording."""
    return block("E", b"", KEY, turns)


def headed(item: bytes, *, after: bytes = b"") -> bytes:
    """Return a recording without turns, whose header is the bytes of a value."""
    body = packed(item) + after
    return MAGIC + block("H", body) + block("E", b"", zlib.crc32(body))


def holding(item: object) -> bytes:
    """Return a recording whose header is a dict with one item of MessagePack."""
    return headed(array(extension(2, "value", item)))


def turns_body(columns: Sequence[bytes], values: bytes = b"") -> bytes:
    """Return the body of a block of turns."""
    return packed(values) + packed(b"".join(columns))


def walk(first: int, count: int) -> bytes:
    """Return a block of turns in which agent 0 goes on by one node in each."""
    steps = [column(*([1] * (count - 1)))]
    body = turns_body(
        [
            column(*([1] * count)),
            column(*([0] * count)),
            column(*([0] * count)),
            column(first + 1),
            *steps,
            *[b"\0"] * 3,
        ]
    )
    return block("T", body, KEY, first, count, count)


def walked(count: int) -> list[list[tuple[int, int]]]:
    """Return the turns that blocks of `walk` have."""
    return [[(0, turn + 1)] for turn in range(count)]


def played(columns: Sequence[bytes], counts: Sequence[int], values: bytes = b"") -> bytes:
    """Return a finished recording with one block of turns."""
    return HEADER + block("T", turns_body(columns, values), KEY, 0, *counts) + end(counts[0])


def refused(limit: str, byte: int | None = 8) -> dict[str, Any]:
    """Return the answer to a file that breaks a limit."""
    return {"refused": limit, "byte": byte}


# -- values -----------------------------------------------------------------------------------------------------


def make_values() -> Iterator[Vector]:
    """Yield recordings whose headers have values of every type."""
    numbers = [0, 127, 128, 255, 256, 65535, 65536, 2**32 - 1, 2**32, 2**63, 2**64 - 1]
    numbers += [-1, -32, -33, -128, -129, -32768, -32769, -(2**31), -(2**31) - 1, -(2**63)]
    samples = {
        "scalars": [None, False, True, 0.5, -0.0, 1e300, float("inf"), float("nan")],
        "integers": numbers,
        "long_integers": [2**64, -(2**63) - 1, 2**100, -(2**100)],
        "texts": ["", "a" * 31, "b" * 32, "c" * 255, "d" * 256, "\u00e4\u20ac\U0001f600", "e" * 66000],
        "bytes": [bytes(size) for size in (0, 1, 2, 3, 4, 8, 16, 255, 256)],
        "containers": [(), (1, "a"), [], [[1], [2]], {}, {"a": {1: 2}}],
        "sets": [set(), {1, 2, 3}, frozenset(), frozenset({1, "a"})],
        "keys": {"a": 1, 2: 2, None: 3, 0.5: 4, (1, ("b",)): 5, frozenset({1}): 6, b"k": 7, 2**70: 8, False: 9},
    }
    for name, value in samples.items():
        yield f"value_{name}", headed(value_of({"value": value})), {"header": {"value": value}}
    surrogate = msgpack.Ext(7, "a\ud800".encode("utf-8", "surrogatepass"))
    yield "value_surrogates", holding(surrogate), {"header": {"value": "a\ud800"}}
    yield "value_float32", headed(array(msgpack.Ext(2, b"\x92\xa1a\xca\x3f\x00\x00\x00"))), {"header": {"a": 0.5}}
    long_head = b"\x92\xa1a\xdd\x00\x00\x00\x00"[:3] + b"\xc9\x00\x00\x00\x01\x05\x00"
    yield "value_extension32", headed(array(msgpack.Ext(2, long_head))), {"header": {"a": b"\0"}}
    wide = msgpack.Ext(2, b"\xdd\x00\x00\x00\x02\xdb\x00\x00\x00\x01a\xd3" + bytes(7) + b"\x05")
    yield "value_wide_heads", headed(array(wide)), {"header": {"a": 5}}
    yield "value_short_long_integer", holding(msgpack.Ext(6, b"\xff")), {"header": {"value": -1}}
    yield "value_set_in_another_order", holding(extension(3, 2, 1, 2)), {"header": {"value": {1, 2}}}
    many = {str(i): i for i in range(20)}
    yield "value_array16", headed(value_of(many)), {"header": many}
    yield "value_depth_32", holding(nested(extension(1), 1, 30)), {}
    yield "value_depth_33", holding(nested(extension(1), 1, 31)), refused("depth")
    yield "zeros_after_a_header", headed(value_of({}), after=bytes(9)), {"header": {}}
    yield "hashes_64", headed(value_of({"value": [5 + k * PRIME for k in range(16, 80)]})), {}
    for dtype in answers.second_reader.DTYPES:
        items = np.array([0, 1, 1, 0, 1, 1] if dtype == "bool" else [1, 3, 2, 0, 5, 100], dtype)
        if dtype.startswith("int"):
            items[3] = np.iinfo(dtype).min
        elif dtype.startswith("float"):
            items[3:5] = (-0.5, np.inf)
        yield f"array_{dtype}", write_header(items.reshape(2, 3)), {"header": {"value": items.reshape(2, 3)}}
    other_bytes = extension(8, "bool", msgpack.Ext(5, b"\0\2\xff"), 3)
    yield "array_bool_of_other_bytes", holding(other_bytes), {"header": {"value": np.array([False, True, True])}}
    for name, shape in {"0": (), "8": (1, 2, 1, 2, 1, 1, 1, 1), "empty": (0, 3)}.items():
        items = np.arange(int(np.prod(shape)), dtype=np.int16).reshape(shape)
        yield f"array_dimensions_{name}", write_header(items), {"header": {"value": items}}


def write_header(value: object) -> bytes:
    """Return a recording without turns that GAMMS writes."""
    stream = io.BytesIO()
    Writer(stream, {"value": value}, seconds=None).close()
    return stream.getvalue()


def make_bad_values() -> Iterator[Vector]:
    """Yield recordings with values that readers refuse."""
    alike = [5 + k * PRIME for k in range(9)]
    tuples = [*product(alike, alike)][:65]
    sets = [*map(frozenset, combinations(alike, 3))][:65]
    bad = {
        "key_twice": (extension(2, "a", 1, "a", 2), "key"),
        "key_true_and_1": (extension(2, 1, 1, True, 2), "key"),
        "key_float_and_1": (extension(2, 1, 1, 1.0, 2), "key"),
        "key_list": (extension(2, extension(1), 1), "key"),
        "key_set": (extension(2, extension(3), 1), "key"),
        "key_list_in_tuple": (extension(2, extension(0, extension(1)), 1), "key"),
        "key_array": (extension(2, extension(8, "int8", msgpack.Ext(5, b""), 0), 1), "key"),
        "set_of_lists": (extension(3, extension(1)), "key"),
        "frozen_set_of_dicts": (extension(4, extension(2)), "key"),
        "dict_of_3_items": (extension(2, "a", 1, "b"), "value"),
        "extension_9": (msgpack.Ext(9, b"\x90"), "value"),
        "extension_minus_1": (msgpack.Ext(-1, b"\x90"), "value"),
        "extension_empty": (msgpack.Ext(1, b""), "value"),
        "extension_of_two": (msgpack.Ext(1, b"\x90\x90"), "value"),
        "array_in_array": ([1], "value"),
        "map": ({"a": 1}, "value"),
        "bytes_without_extension": (b"a", "value"),
        "utf8": (msgpack.Ext(1, b"\x91\xa2\xc3\x28"), "value"),
        "utf8_in_surrogates": (msgpack.Ext(7, b"\xff"), "value"),
        "cut_item": (msgpack.Ext(1, b"\x92\x01"), "value"),
        "array_unknown_dtype": (extension(8, "complex128", msgpack.Ext(5, bytes(16)), 1), "array"),
        "array_dtype_no_text": (extension(8, 3, msgpack.Ext(5, bytes(1)), 1), "array"),
        "array_without_bytes": (extension(8, "int8", "a", 1), "array"),
        "array_without_anything": (extension(8), "array"),
        "array_9_dimensions": (extension(8, "int8", msgpack.Ext(5, b"\0"), *[1] * 9), "array"),
        "array_too_few_bytes": (extension(8, "int16", msgpack.Ext(5, bytes(3)), 2), "array"),
        "array_too_many_bytes": (extension(8, "int16", msgpack.Ext(5, bytes(6)), 2), "array"),
        "array_negative_dimension": (extension(8, "int8", msgpack.Ext(5, bytes(1)), -1, -1), "array"),
        "array_dimension_no_integer": (extension(8, "int8", msgpack.Ext(5, bytes(1)), True), "array"),
        "array_dimension_product": (extension(8, "int8", msgpack.Ext(5, b""), 0, *[(1 << 40) - 1] * 2), "array"),
        "array_dimension_2_to_40": (extension(8, "int8", msgpack.Ext(5, b""), 0, 1 << 40), "array"),
        "hashes_long_integers": (plain([5 + k * PRIME for k in range(16, 81)]), "hashes"),
        "hashes_tuples": (plain(tuples), "hashes"),
        "hashes_frozen_sets": (plain(sets), "hashes"),
    }
    for name, (item, limit) in bad.items():
        yield f"refused_{name}", holding(item), refused(limit)
    yield "refused_two_items", headed(array(extension(2), 1)), refused("value")
    yield "refused_no_array", headed(b"\xc0"), refused("value")
    yield "refused_nothing", headed(b""), refused("value")
    yield "refused_wide_array_around", headed(b"\xdd\0\0\0\1" + array(extension(2))[1:]), refused("value")
    yield "refused_bytes_behind_a_value", headed(value_of({}) + b"\0"), refused("value")
    yield "refused_header_list", headed(value_of([])), refused("dict")
    yield "refused_bytes_behind_a_header", headed(value_of({}), after=b"\0\1"), refused("superfluous bytes")


def make_forms() -> Iterator[Vector]:
    """Yield recordings with every form of MessagePack, and forms of integers and arrays that readers take or refuse."""
    five = [b"\5", b"\xcc\5", b"\xcd\0\5", b"\xce\0\0\0\5", b"\xcf" + bytes(7) + b"\5"]
    five += [b"\xd0\5", b"\xd1\0\5", b"\xd2\0\0\0\5", b"\xd3" + bytes(7) + b"\5"]
    texts = [b"\xa1a", b"\xd9\1a", b"\xda\0\1a", b"\xdb\0\0\0\1a"]
    extensions = [b"\xd4\5z", b"\xc7\1\5z", b"\xc8\0\1\5z", b"\xc9\0\0\0\1\5z"]
    for name, forms, value in (("integer", five, 5), ("text", texts, "a"), ("extension", extensions, b"z")):
        items = msgpack.Ext(1, bytes([0x90 + len(forms)]) + b"".join(forms))
        yield f"value_forms_of_{name}", holding(items), {"header": {"value": [value] * len(forms)}}
    tuples = [msgpack.Ext(0, form) for form in (b"\x91\1", b"\xdc\0\1\1", b"\xdd\0\0\0\1\1")]
    yield "value_forms_of_array", holding(extension(1, *tuples)), {"header": {"value": [(1,)] * 3}}
    for name, item, value in (
        ("long_integer_of_no_bytes", msgpack.Ext(6, b""), 0),
        ("long_integer_with_zeros", msgpack.Ext(6, bytes(20) + b"\5"), 5),
        ("text_in_type_7", msgpack.Ext(7, "a\u00e9".encode()), "a\u00e9"),
        ("frozen_set_in_another_order", extension(4, 3, 1, 3, 2), frozenset({1, 2, 3})),
        ("set_of_equal_items", extension(3, 1, 1.0, True), {1}),
        ("keys_of_nan", extension(2, float("nan"), 1, float("nan"), 2), {float("nan"): 1, float("-nan"): 2}),
        ("keys_text_and_bytes", extension(2, "a", 1, msgpack.Ext(5, b"a"), 2), {"a": 1, b"a": 2}),
    ):
        yield f"value_{name}", holding(item), {"header": {"value": value}}
    one_array = extension(8, "int8", msgpack.Ext(5, b"\0"), 1)
    yield "value_depth_32_bytes", holding(nested(msgpack.Ext(5, b"x"), 0, 31)), {}
    yield "value_depth_32_array", holding(nested(one_array, 1, 30)), {}
    yield "value_depth_33_array", holding(nested(one_array, 1, 31)), refused("depth")
    yield "value_depth_of_5_frozen_sets", holding(nested(extension(4), 4, 4)), {}
    yield "value_depth_33_of_frozen_sets", holding(nested(extension(4), 4, 5)), refused("depth")
    tuple_in_sets = extension(3, nested(extension(0), 4, 4))
    yield "value_depth_33_of_a_tuple_in_sets", holding(extension(1, tuple_in_sets)), refused("depth")
    for name, shape in {"most": (0, 1 << 39, 1 << 23), "largest": ((1 << 40) - 1, 0)}.items():
        yield f"array_dimensions_{name}", holding(extension(8, "int8", msgpack.Ext(5, b""), *shape)), {}
    for name, limit, item in (
        ("byte_c1", "value", msgpack.Ext(1, b"\x91\xc1")),
        ("container_of_bytes", "value", msgpack.Ext(1, b"\xc4\1a")),
        ("container_of_map", "value", msgpack.Ext(2, b"\x80")),
        ("utf8_overlong", "value", msgpack.Ext(7, b"\xc0\x80")),
        ("utf8_of_a_surrogate", "value", msgpack.Ext(1, b"\x91\xa3\xed\xa0\x80")),
        ("array_dimension_float", "array", extension(8, "int8", msgpack.Ext(5, b"\0"), 1.0)),
        ("array_dimension_product_2_to_63", "array", extension(8, "int8", msgpack.Ext(5, b""), 0, 1 << 39, 1 << 24)),
        ("array_dimension_product_of_items", "array", extension(8, "int16", msgpack.Ext(5, b""), 0, 1 << 39, 1 << 23)),
        ("array_too_many_bytes_for_none", "array", extension(8, "int8", msgpack.Ext(5, b"\0"), 0, 3)),
        ("array_too_few_bytes_for_one", "array", extension(8, "int8", msgpack.Ext(5, b""))),
        ("array_unknown_dtype_big_endian", "array", extension(8, ">i4", msgpack.Ext(5, bytes(4)), 1)),
    ):
        yield f"refused_{name}", holding(item), refused(limit)


def make_keys() -> Iterator[Vector]:
    """Yield recordings with keys, and items of sets, that readers refuse."""
    no_keys = {"list": extension(1), "dict": extension(2), "set": extension(3)}
    no_keys["array"] = extension(8, "int8", msgpack.Ext(5, b""), 0)
    for name in ("dict", "set", "array"):
        inside = extension(0, extension(0, no_keys[name]))
        yield f"refused_key_{name}_in_tuple", holding(extension(2, inside, 1)), refused("key")
    yield "refused_key_dict", holding(extension(2, extension(2), 1)), refused("key")
    for name, first, second in (
        ("tuple_twice", extension(0, 1), extension(0, 1.0)),
        ("frozen_set_twice", extension(4, 1, 2), extension(4, 2, 1)),
        ("text_of_both_types", "a", msgpack.Ext(7, b"a")),
        ("zero_and_minus_zero", 0.0, -0.0),
    ):
        yield f"refused_key_{name}", holding(extension(2, first, 1, second, 2)), refused("key")
    for name in ("dict", "array"):
        yield f"refused_set_of_{name}s", holding(extension(3, no_keys[name])), refused("key")
    yield "refused_set_of_tuples_of_lists", holding(extension(3, extension(0, extension(1)))), refused("key")
    yield "refused_frozen_set_of_sets", holding(extension(4, extension(3))), refused("key")


def make_hashes() -> Iterator[Vector]:
    """Yield recordings with many values of one hash."""
    alike = [5 + k * PRIME for k in range(9)]
    tuples = [*product(alike, alike)]
    for name, values in {
        "64_tuples": tuples[:64],
        "64_frozen_sets": [*map(frozenset, combinations(alike, 3))][:64],
        "of_equal_tuples": tuples[:1] * 100,
        "of_tuples_with_lists": [(1, [k]) for k in range(100)],
    }.items():
        yield f"hashes_{name}", holding(plain(values)), {"header": {"value": values}}
    padded = [msgpack.Ext(6, bytes(size) + b"\1" + bytes(9)) for size in range(65)]
    yield "refused_hashes_of_other_bytes", holding(extension(1, *padded)), refused("hashes")
    long = [5 + k * PRIME for k in range(16, 96)]
    head = packed(value_of({"value": long[:40]}))
    state = packed(value_of({"value": long[40:]}))
    value = value_of(long[40:])
    key = zlib.crc32(head)
    start = MAGIC + block("H", head)
    keyframe_too = start + block("K", state, key) + block("E", b"", key)
    yield "refused_hashes_in_a_keyframe", keyframe_too, refused("hashes", len(start))
    columns = [column(0), column(1), *[b"\0"] * 3, column(0), column(1), column(len(value))]
    event_too = start + block("T", turns_body(columns, value), key, 0, 1, 0, 1) + block("E", b"", key, 1)
    yield "refused_hashes_in_an_event", event_too, refused("hashes", len(start))


# -- columns ----------------------------------------------------------------------------------------------------


def table_column(entries: Sequence[int], per_byte: int, data: bytes) -> bytes:
    """Return a column with a table."""
    return bytes([9, len(entries) - 1]) + column(*differences(*entries)) + bytes([per_byte]) + data


def moves_of(nodes: Sequence[int], encoded: bytes) -> tuple[bytes, dict[str, Any]]:
    """Return a recording in which agent 0 moves by differences that are encoded already, and its answer."""
    count = len(nodes)
    columns = [column(count), column(0), column(*[0] * count), column(nodes[0]), encoded, *[b"\0"] * 3]
    return played(columns, (1, count, 0)), {"turns": [[(0, node) for node in nodes]]}


def make_columns() -> Iterator[Vector]:
    """Yield recordings with columns of each form, and with columns that readers refuse."""
    for width in range(1, 9):
        most = (1 << 8 * width - 1) - 1
        steps = [most, -most - 1, 1, -1]
        nodes = [0]
        for step in steps:
            nodes.append((nodes[-1] + step + 2**63) % 2**64 - 2**63)
        yield f"column_width_{width}", *moves_of(nodes, column(*steps))
    yield "column_wider_than_needed", *moves_of([0, 1, 0], column(1, -1, width=5))
    yield "column_table_with_a_rest", *moves_of([0, 1], table_column([0, 1], 8, b"\xff"))
    wraps = [2**63 - 1, -(2**63), 2**63 - 1]
    yield "column_wraps_around", *moves_of(wraps, column(1, -1))
    for per_byte, size in {1: 256, 2: 16, 3: 6, 4: 4, 5: 3, 6: 2, 7: 2, 8: 2}.items():
        entries = [3 * i - 5 for i in range(size)]
        numbers = [(7 * i) % size for i in range(11)]
        groups = [numbers[at : at + per_byte] for at in range(0, 11, per_byte)]
        data = bytes(sum(number * size**place for place, number in enumerate(group)) for group in groups)
        nodes = [0]
        for number in numbers:
            nodes.append(nodes[-1] + entries[number])
        yield f"column_table_{per_byte}", *moves_of(nodes, table_column(entries, per_byte, data))
    bad = {
        "width_0": b"\0",
        "width_10": bytes([10]) + bytes(30),
        "table_of_0_in_a_byte": table_column([0, 1], 0, bytes(3)),
        "table_of_9_in_a_byte": table_column([0], 9, bytes(1)),
        "table_beyond_a_byte": table_column([0, 1, 2], 6, bytes(1)),
        "table_number_outside": table_column([0, 1], 7, b"\x80"),
        "table_in_a_table": bytes([9, 1]) + table_column([3, 4], 1, b"\0\1") + b"\1\0\1\1",
    }
    for name, encoded in bad.items():
        yield f"refused_column_{name}", moves_of([0] * 4, encoded)[0], refused("column", len(HEADER))
    cut = moves_of([0] * 4, bytes([9, 1]) + column(0, 1) + b"\1")[0]
    yield "refused_column_table_cut", cut, refused("missing bytes", len(HEADER))
    first = [column(1), column(0), column(0), column(5)]
    at = len(HEADER)
    yield "refused_column_without_numbers", played([*first, b"\1", *[b"\0"] * 3], (1, 1, 0)), refused("column", at)
    empty_table = bytes([9, 0]) + column(0) + b"\1"
    yield "refused_table_without_numbers", played([*first, empty_table, *[b"\0"] * 3], (1, 1, 0)), refused("column", at)
    yield "refused_column_cut", played([*first, b"\0", b"\0", b"\0"], (1, 1, 0)), refused("missing bytes", at)
    yield "refused_column_too_many", played([*first, *[b"\0"] * 5], (1, 1, 0)), refused("superfluous bytes", at)


def make_packed() -> Iterator[Vector]:
    """Yield recordings with packed bytes of each form, and with some that readers refuse."""
    content = value_of({"a": 1})
    size = len(content)

    def deflated(level: int = 9, strategy: int = zlib.Z_DEFAULT_STRATEGY) -> bytes:
        deflater = zlib.compressobj(level, zlib.DEFLATED, -15, 8, strategy)
        return deflater.compress(content) + deflater.flush()

    deflater = zlib.compressobj(9, zlib.DEFLATED, -15)
    in_parts = deflater.compress(content[:4]) + deflater.flush(zlib.Z_FULL_FLUSH)
    in_parts += deflater.compress(content[4:]) + deflater.flush()
    for name, body in {
        "stored": varint(size) + deflated(0),
        "by_fixed_codes": varint(size) + deflated(9, zlib.Z_FIXED),
        "in_two_parts": varint(size) + in_parts,
        "with_a_size_of_3_bytes": bytes([size | 128, 128, 0]) + deflated(),
        "with_a_size_of_9_bytes": bytes([size | 128, *[128] * 7, 0]) + deflated(),
    }.items():
        whole = MAGIC + block("H", body) + block("E", b"", zlib.crc32(body))
        yield f"packed_{name}", whole, {"header": {"a": 1}, "is_complete": True}
    for name, body in {
        "of_10_bytes": bytes([size | 128, *[128] * 8, 0]) + deflated(),
        "with_a_frame_of_zlib": varint(size) + zlib.compress(content),
    }.items():
        yield f"refused_size_{name}", MAGIC + block("H", body), refused("size")


def make_sums() -> Iterator[Vector]:
    """Yield recordings whose numbers go beyond 64 bits, and whose events have no place or value."""
    nothing = [b"\0"] * 3
    rows = [column(2), column(0), column(2**63 - 1, 1), column(4, 1), b"\0", *nothing]
    yield "rows_wrap_around", played(rows, (1, 2, 0)), {"turns": [[(2**63 - 1, 5), (-(2**63), 4)]]}
    nodes = [column(2), column(0), column(1, 1), column(2**63 - 1, 1), b"\0", *nothing]
    yield "first_nodes_wrap_around", played(nodes, (1, 2, 0)), {"turns": [[(1, 2**63 - 1), (2, -(2**63))]]}
    large = [2**62] * 4
    one = [column(0), column(1), column(2)]
    for name, limit, columns, counts in (
        (
            "moves_of_turns_beyond_64_bits",
            "counts",
            [column(*large[1:], 2**62 + 2), column(*[0] * 4), column(0, 0), column(1), column(1), *nothing],
            (4, 2, 0),
        ),
        (
            "events_of_turns_beyond_64_bits",
            "counts",
            [column(*[0] * 4), column(*large[1:], 2**62 + 1), *nothing, *one],
            (4, 0, 1),
        ),
        (
            "sizes_beyond_64_bits",
            "counts",
            [column(0), column(5), *nothing, column(*[0] * 5), column(*[1] * 5), column(*large, 2)],
            (1, 0, 5),
        ),
        (
            "event_at_a_negative_place",
            "events",
            [column(1), column(1), column(0), column(1), b"\0", column(-1), *one[1:]],
            (1, 1, 1),
        ),
        (
            "event_without_a_value",
            "value",
            [column(0), column(2), *nothing, column(0, 0), column(1, 1), column(0, 2)],
            (1, 0, 2),
        ),
        (
            "flight_without_columns",
            "missing bytes",
            [column(0), column(1), *nothing, column(0), column(FLIGHT), column(0)],
            (1, 0, 1),
        ),
    ):
        values = b"" if name.startswith(("moves", "flight")) else array(1)
        yield f"refused_{name}", played(columns, counts, values), refused(limit, len(HEADER))


# -- blocks -----------------------------------------------------------------------------------------------------


def state_of(turn: int) -> dict[str, Any]:
    """Return a keyframe."""
    return {"turn": turn}


def keyframe(turn: int) -> bytes:
    """Return the block of a keyframe."""
    return block("K", packed(value_of(state_of(turn))), KEY, turn)


def example() -> tuple[list[bytes], bytes]:
    """Return the columns and the values of the example of the page."""
    values = value_of({"hit": True})
    columns = [column(2, 1), column(0, 1), column(*differences(0, 1, 0)), column(5, 4), column(1), column(3), column(4)]
    return [*columns, column(len(values))], values


def make_blocks() -> Iterator[Vector]:
    """Yield whole, unfinished and damaged recordings."""
    columns, values = example()
    turns = [[(0, 5), (1, 9)], [(0, 6), (4, {"hit": True})]]
    body = turns_body(columns, values)
    yield "example", played(columns, (2, 3, 1), values), {"turns": turns, "is_complete": True, "header": {"format": 3}}
    padded = HEADER + block("T", body + bytes(7), KEY, 0, 2, 3, 1) + end(2)
    yield "zeros_after_turns", padded, {"turns": turns, "is_complete": True}
    yield "no_turns", HEADER + end(), {"turns": [], "keyframes": {}, "is_complete": True}
    nothing = played([column(0, 0), column(0, 0), *[b"\0"] * 6], (2, 0, 0))
    yield "turns_without_moves", nothing, {"turns": [[], []]}
    rows = played(
        [column(5), column(0), column(*differences(3, -1, 3, 7, -1)), column(*differences(-4, 10, 2)), column(1, -3)]
        + [b"\0"] * 3,
        (1, 5, 0),
    )
    yield "agents_in_any_order", rows, {"turns": [[(3, 10), (-1, -4), (3, 7), (7, 2), (-1, -3)]]}
    a, b, c = (value_of(value) for value in ("a", None, [1]))
    between = played(
        [
            *(column(1, 2), column(2, 2), column(0, 0, 0), column(1), column(1, 1), column(*differences(0, 1, 1, 2))),
            *(column(9, -1, 9, 2**62), column(len(a), len(b), len(c), len(a))),
        ],
        (2, 3, 4),
        a + b + c + a,
    )
    yield (
        "events_between_moves",
        between,
        {"turns": [[(9, "a"), (0, 1), (-1, None)], [(9, [1]), (0, 2), (2**62, "a"), (0, 3)]]},
    )
    yield (
        "flights",
        *write_turns(
            [
                [(FLIGHT, (2, 7, 1.0, 2.5, -3.0)), (FLIGHT, (1, 4, 0.0, -0.0, 1e-300))],
                [(FLIGHT, (2, 8, 2.0, 2.75, -3.5))],
                [(FLIGHT, (2, 9, 3.0, 3.0, float("inf"))), 0, 3, (FLIGHT, (2, 9, 4.5, 3.0, float("nan")))],
            ]
        ),
    )
    yield (
        "turns_in_space",
        *write_turns(
            [
                [(TURN, (5, 1.0, 0.0, 0.0, 0.0)), 1, 1, (FLIGHT, (5, 1, 1.0, 1.0, 1.0))],
                [(TURN, (4, 0.5, 0.5, 0.5, 0.5)), (TURN, (5, 0.5, -0.5, 0.5, -0.5))],
                [(TURN, (5, 0.0, 1.0, 0.0, 0.0)), (3, {"a": 1})],
            ]
        ),
    )
    later = block("Z", b"of a later version", KEY, 77)
    several = HEADER + keyframe(0) + walk(0, 2) + later + keyframe(2) + walk(2, 3) + keyframe(5) + end(5)
    whole = {"turns": walked(5), "is_complete": True}
    yield "keyframes_and_blocks", several, whole | {"keyframes": {turn: state_of(turn) for turn in (0, 2, 5)}}
    again = HEADER + block("H", HEADER_BODY, KEY) + walk(0, 2) + end(2)
    yield "header_again", again, {"turns": walked(2), "is_complete": True}
    spoiled = HEADER + walk(0, 2) + block("Z", b"of a later version", KEY, crc=4) + walk(2, 1) + end(3)
    yield "later_block_damaged", spoiled, {"turns": walked(3), "is_complete": True}
    yield "end_with_a_body", HEADER + walk(0, 2) + block("E", b"more", KEY, 2), {"turns": walked(2)}
    zeros = HEADER + block("K", keyframe(0)[36:] + bytes(4), KEY) + end()
    yield "zeros_after_a_keyframe", zeros, {"keyframes": {0: state_of(0)}}
    other_steps = [column(1, 1), column(0, 0), column(0, 0), column(5), column(4), *[b"\0"] * 3]
    as_long = HEADER + walk(0, 2) + block("T", turns_body(other_steps), KEY, 0, 2, 2) + end(2)
    yield "block_of_as_many_turns_replaces", as_long, {"turns": [[(0, 5)], [(0, 9)]], "is_complete": True}
    two = HEADER + block("K", packed(value_of({"turn": 9})), KEY, 0) + keyframe(0) + walk(0, 1) + end(1)
    yield "two_keyframes_of_one_turn", two, {"keyframes": {0: state_of(0)}}
    replaced = {
        "damaged": block("K", keyframe(0)[36:], KEY, 0, crc=5),
        "list": block("K", packed(value_of([])), KEY, 0),
        "costly": block("K", packed(value_of({"value": [None] * 1_400_000})), KEY, 0),
    }
    for name, first in replaced.items():
        data = HEADER + first + keyframe(0) + walk(0, 1) + end(1)
        yield f"replaced_keyframe_{name}", data, {"keyframes": {0: state_of(0)}, "turns": walked(1)}
    yield from _make_unfinished()
    yield from _make_damaged()


def write_turns(logs: Sequence[list[Any]]) -> tuple[bytes, dict[str, Any]]:
    """Return a recording that GAMMS writes, and its turns."""
    stream = io.BytesIO()
    writer = Writer(stream, {"format": 3}, seconds=None)
    turns = []
    for log in logs:
        writer.add_turn(log)
        turns.append(answers._pair_moves(log))
    writer.close()
    return stream.getvalue(), {"turns": turns}


def _make_unfinished() -> Iterator[Vector]:
    start = HEADER + keyframe(0)
    two = start + walk(0, 2)
    other = block("T", walk(2, 3)[36:], KEY ^ 1, 2, 3, 3)
    torn = walk(2, 3)[:-1] + b"\xff"
    torn_keyframe = keyframe(2)[:-1] + b"\xff"
    cases = {
        "no_end": (two, 2),
        "header_alone": (HEADER, 0),
        "end_with_bytes_behind": (two + end(2) + b"\0", 2),
        "end_of_another_turn": (two + end(3), 2),
        "end_of_another_file": (two + block("E", b"", KEY ^ 1, 2), 2),
        "blocks_behind_an_end": (two + end(2) + walk(2, 3), 5),
        "cut_in_a_head": (two + walk(2, 3)[:20], 2),
        "cut_in_a_body": (two + walk(2, 3)[:-1], 2),
        "last_body_damaged": (two + torn, 2),
        "head_damaged": (two + walk(2, 3)[:4] + b"\xff" + walk(2, 3)[5:] + end(5), 2),
        "block_of_another_file": (two + other + end(5), 2),
        "block_of_a_later_turn": (two + walk(3, 1) + end(4), 2),
        "block_of_no_turns": (two + block("T", walk(2, 1)[36:], KEY, 2) + end(2), 2),
        "keyframe_with_turns": (two + block("K", keyframe(2)[36:], KEY, 2, 1) + end(2), 2),
        "65537_turns": (two + block("T", b"", KEY, 2, (1 << 16) + 1) + end(2), 2),
        "4194305_moves": (two + block("T", b"", KEY, 2, 1, (1 << 22) + 1) + end(2), 2),
        "1048577_events": (two + block("T", b"", KEY, 2, 1, 0, (1 << 20) + 1) + end(2), 2),
        "provisional_blocks": (two + walk(2, 1) + walk(3, 2), 5),
        "longer_block_replaces": (two + walk(2, 1) + walk(2, 3), 5),
        "shorter_block_does_not_replace": (two + walk(2, 3) + walk(2, 1), 5),
        "damaged_block_does_not_replace": (two + walk(2, 1) + torn, 3),
        "copy_behind_a_damaged_block": (two + torn[:60] + b"junk" + walk(2, 3), 5),
        "copy_of_the_last_block": (two + walk(2, 1) + b"junk" + walk(2, 3), 5),
        "copy_of_another_file": (two + b"junk" + other, 2),
        "copy_damaged": (two + b"junk" + torn + walk(2, 1), 3),
        "copy_of_another_turn": (two + b"junk" + walk(3, 1), 2),
        "copy_behind_8_damaged_ones": (two + b"junk" + torn * 8 + walk(2, 1), 2),
        "copy_behind_7_damaged_ones": (two + b"junk" + torn * 7 + walk(2, 1), 3),
        "copy_behind_a_keyframe": (two + keyframe(2) + b"junk" + walk(2, 1), 3),
        "copy_behind_a_damaged_keyframe": (two + torn_keyframe + b"junk" + walk(2, 1), 3),
        "copy_behind_the_header": (HEADER + b"junk" + walk(0, 2), 2),
        "copy_cut": (two + b"junk" + walk(2, 3)[:-1], 2),
        "copy_of_fewer_turns": (two + walk(2, 3) + b"junk" + walk(2, 1), 5),
        "copy_in_a_damaged_body": (two + block("T", b"\xd3GBT" + walk(2, 1), KEY, 2, 3, 3, crc=7), 3),
        "keyframe_of_another_turn": (two + keyframe(1) + end(2), 2),
        "keyframe_damaged": (two + torn_keyframe, 2),
        "only_block_damaged": (HEADER + walk(0, 1)[:-1] + b"\xff", 0),
        "longer_block_behind_a_keyframe": (two + keyframe(2) + walk(0, 3) + end(3), 2),
    }
    for name, (data, turns) in cases.items():
        yield f"unfinished_{name}", data, {"turns": walked(turns), "is_complete": False}


def _make_damaged() -> Iterator[Vector]:
    crc = zlib.crc32(HEADER_BODY) ^ 1
    at = len(HEADER)
    columns, values = example()
    later = len(HEADER + walk(0, 1))
    yield "refused_magic", b"MMGX" + HEADER[4:] + end(), refused("magic", 0)
    yield "refused_empty", b"", refused("magic", 0)
    yield "refused_cut_magic", MAGIC[:7], refused("magic", 0)
    for version in (2, 4):
        other = b"MMGR" + struct.pack(">I", version)
        yield f"refused_version_{version}", other + HEADER[8:] + end(), refused("version", 4)
    for name, data in {
        "missing": MAGIC,
        "keyframe": MAGIC + block("K", HEADER_BODY),
        "with_key": MAGIC + block("H", HEADER_BODY, 1),
        "head_damaged": HEADER[:8] + b"\xd2" + HEADER[9:],
        "head_crc": HEADER[:40] + b"\0\0\0\0" + HEADER[44:],
        "cut": HEADER[:-1],
        "with_too_many_turns": MAGIC + block("H", HEADER_BODY, 0, 0, (1 << 16) + 1),
    }.items():
        yield f"refused_header_{name}", data, refused("header")
    yield "refused_header_crc", MAGIC + block("H", HEADER_BODY, crc=crc) + end(), refused("crc")
    torn = block("T", walk(0, 1)[36:], KEY, 0, 1, 1, crc=5)
    yield "refused_turns_crc", HEADER + torn + walk(1, 1) + end(2), refused("crc", at)
    yield "refused_turns_crc_without_end", HEADER + torn + walk(1, 1), refused("crc", at)
    more = HEADER + block("K", keyframe(0)[36:] + b"\1", KEY) + end()
    yield "refused_bytes_behind_a_keyframe", more, refused("superfluous bytes", at)
    yield "refused_last_turns_crc", HEADER + torn + end(1), refused("crc", at)
    yield "refused_keyframe_crc", HEADER + block("K", keyframe(0)[36:], KEY, crc=5) + end(), refused("crc", at)
    yield "refused_keyframe_list", HEADER + block("K", packed(value_of([])), KEY) + end(), refused("dict", at)
    beyond = packed(value_of({}))
    for name, body in {
        "more": packed(value_of({}), 99),
        "fewer": packed(value_of({}), 1),
        "cut": beyond[:-2],
        "no_deflate": varint(4) + b"\xff\xff\xff\xff",
        "endless": b"\xff" * 9 + b"\0",
    }.items():
        yield f"refused_size_{name}", MAGIC + block("H", body), refused("size")
    yield "refused_size_missing", MAGIC + block("H", b""), refused("missing bytes")
    extra = block("T", turns_body(columns, values) + b"\1", KEY, 0, 2, 3, 1) + end(2)
    yield "refused_bytes_behind_turns", HEADER + extra, refused("superfluous bytes", at)
    size = len(values)
    for name, limit, changes in (
        ("moves_of_turns", "counts", {0: column(2, 2)}),
        ("negative_moves", "counts", {0: column(4, -1)}),
        ("events_of_turns", "counts", {1: column(0, 0)}),
        ("negative_events", "counts", {1: column(2, -1)}),
        ("event_before_its_turn", "events", {5: column(1)}),
        ("event_after_its_turn", "events", {5: column(4)}),
        ("event_of_flight_with_value", "events", {6: column(FLIGHT)}),
        ("sizes", "counts", {7: column(size - 1)}),
        ("negative_size", "counts", {7: column(-1)}),
    ):
        changed = [changes.get(place, part) for place, part in enumerate(columns)]
        if "flight" in name:
            changed += [column(0), column(5), *[part for _ in range(4) for part in (column(0), b"\0")]][:1]
            changed += [column(5), b"\0", *[column(0), b"\0"] * 3]
        yield f"refused_{name}", played(changed, (2, 3, 1), values), refused(limit, at)
    twice = [column(0, 0), column(1, 1), *[b"\0"] * 3, column(0, 0), column(1, 1), column(1, 1)]
    yield "refused_value_of_an_event", played(twice, (2, 0, 2), b"\x90\x90"), refused("value", at)
    unordered = [column(2), column(2), column(0, 0), column(1), column(1), column(2, -1), column(1, 1), column(2, 2)]
    yield "refused_events_in_wrong_order", played(unordered, (1, 2, 2), array(1) * 2), refused("events", at)
    second = block("T", turns_body([b"\0"]), KEY, 1, 1, 1)
    yield "refused_second_block", HEADER + walk(0, 1) + second + end(2), refused("column", later)


# -- memory -----------------------------------------------------------------------------------------------------


PLACES = {"turns": 2, "moves": 0, "events": 1}  # the block that costs too much


def make_limits() -> Iterator[Vector]:
    """Yield recordings that cost as much as allowed, or more."""
    at = len(HEADER)
    yield "refused_packed_size", MAGIC + block("H", varint(1 << 40) + packed(b"")[1:]), refused("memory")
    texts = value_of({"value": "x" * (17 << 20)})
    yield "refused_memory_bytes", headed(texts), refused("memory")
    lists = array(extension(2, "value", extension(1, *[extension(1)] * 400_000)))
    yield "refused_memory_containers", headed(lists), refused("memory")
    yield "refused_memory_items", headed(value_of({"value": [None] * 1_400_000})), refused("memory")
    for name, counts in {"turns": (1 << 16, 0, 0), "moves": (1, 1 << 22, 0), "events": (1, 0, 1 << 20)}.items():
        empty = b"".join(block("T", packed(b"") * 2, KEY, i * counts[0], *counts) for i in range(3))
        place = at + len(empty) * PLACES[name] // 3
        yield f"refused_memory_{name}", HEADER + empty + end(3 * counts[0]), refused("memory", place)
    for name, more in {"most_memory": 0, "refused_most_memory": 1}.items():
        yield name, _costing(more), refused("memory") if more else {"is_complete": True}


def _costing(more: int) -> bytes:
    """Return a recording whose header costs all that is allowed, and so many bytes more."""
    size = 17_000_000
    while (_cost_of_text(size) - more - (64 << 20)) % 1024:
        size += 1
    body = packed(value_of({"": "x" * size}))
    total = (_cost_of_text(size) - more - (64 << 20)) // 1024  # bytes of the file
    body += bytes(total - len(MAGIC) - 2 * 36 - len(body))
    return MAGIC + block("H", body) + block("E", b"", zlib.crc32(body))


def _cost_of_text(size: int) -> int:
    """Return the cost of a dict with a text of so many characters, more than 65,535, by the empty key."""
    inside = 1 + 1 + 5 + size  # heads of an array, of the key, of the text
    value = 1 + 6 + inside  # heads of an array and of an extension
    return 4 * value + 160 + inside + 2 * 48


# -- games ------------------------------------------------------------------------------------------------------


def make_games() -> Iterator[Vector]:
    """Yield recordings of games that have each key and each kind of event of the page."""
    for name, play in (("walkers", play_walkers), ("drawings", play_drawings), ("roads", play_roads)):
        stream = io.BytesIO()
        with gamms.create_context(seed=2, logger_config={"level": "CRITICAL"}) as ctx:
            play(ctx, stream)
        yield f"game_{name}", stream.getvalue(), {"is_complete": True}
    whole = io.BytesIO()
    with gamms.create_context(seed=2, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, 10.0))
        ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=15.0)
        ctx.sensor.create_sensor("late", "AGENT_RANGE", sensor_range=30.0, delay_turns=2)
        for agent, node in (("anna", 0), ("bert", 8)):
            sensors = ["eyes", "late"]
            ctx.agent.create_agent(agent, start_node_id=node, team=agent[0], sensors=sensors, strategy=wander)
        ctx.game.add(time_limit(4))
        ctx.game.run(1)
        ctx.record.start(whole, sensed=True)
        ctx.game.run(4)
        ctx.record.stop()
    cut = io.BytesIO()
    with recorder.open(io.BytesIO(whole.getvalue())) as recording:
        recording.cut(cut, "a")
    yield "game_to_cut", whole.getvalue(), {"is_complete": True}
    yield "game_cut", cut.getvalue(), {"is_complete": True}
    team = {"agents": [{"name": "ann", "node": 0}], "strategy": "gamms.strategies:random_walk"}
    scenario = Scenario(map={"grid": {"width": 3, "height": 2}}, teams={"red": team}, max_turns=2)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "game.ggr"
        scenario.play(1, record=path)
        yield "game_scenario", path.read_bytes(), {"is_complete": True}
    yield "rare_events", *write_turns([[(kind, data)] for kind, data in RARE.items()])


# Events that take long games to come about, as the page describes them.
RARE: dict[int, Any] = {
    0x00000011: None,
    0x01100005: {"agent_name": "kite", "position": (1.0, 2.0, 3.0), "node": 3},
    0x01100006: {"agent_name": "kite", "quat": (1.0, 0.0, 0.0, 0.0)},
    0x01100030: {"names": ["kite"], "node": np.array([4]), "previous": np.array([3])},
    0x02000004: {"key": ["module", "Battery"]},
    0x0400000D: {"driven": {"ann": 5}},
}


def wander(state: dict[str, Any]) -> None:
    """Go to and fro, remember, report and mark."""
    state["memory"].setdefault("path", []).append(state["curr_pos"])
    state["team_memory"]["seen"] = {state["curr_pos"]}
    goal = (min if state["turn"] % 2 else max)(state["legal"])
    state["action"] = goal
    if "deeds" in state:
        state["action"] = {"node_id": 99 if state["turn"] == 2 else goal, "do": {"mark": state["turn"]}}
        state["outbox"] += [{"channel": "radio", "to": None, "body": {"at": state["curr_pos"]}}]


def fly(state: dict[str, Any]) -> None:
    """Fly straight on."""
    state["action"] = (1.0, 0.5, 0.0)


def play_walkers(ctx: Any, stream: io.BytesIO) -> None:
    """Play a game with walkers, a flyer, sensors, messages, deeds, facts, components and changes of the map."""
    set_up_walkers(ctx)
    ctx.record.start(stream, sensed=True, provenance={"by": "vectors"}, created=1)
    ctx.game.collect("turn", lambda ctx: ctx.game.turn)
    ctx.game.collect("node", lambda agent: agent.current_node_id, per="agent")

    @ctx.record.component(struct={"charge": float, "log": list[int]})
    class Battery:
        pass

    batteries = [Battery(name=name) for name in ("battery", "spare")]

    def note(ctx: Any) -> None:
        turn = ctx.game.turn
        batteries[0].charge = float(ctx.rng.random())
        ctx.game.scores["red"] += 1
        ctx.game.data.setdefault("turns", []).append(turn)
        ctx.game.emit("tick", n=turn)
        ctx.record.event("note", n=turn)
        ctx.game.publish(to="red", turn=turn)
        ctx.game.publish(wind=(turn, 2))
        ctx.sensor.get_sensor("eyes").range = 15.0 + turn

    changes = {1: change_agents, 2: change_map, 3: delete_things}
    ctx.game.add(note)
    ctx.game.add(lambda ctx: changes.get(ctx.game.turn, note_nothing)(ctx))
    ctx.game.run(4)
    ctx.game.reset(5)
    ctx.game.run(2)
    ctx.record.stop()


def set_up_walkers(ctx: Any) -> None:
    """Build the map, the sensors, the agents and the settings of the game of walkers."""
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, 10.0))
    ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=15.0)
    ctx.sensor.create_sensor("late", "AGENT_RANGE", sensor_range=30.0, delay_turns=2)
    ctx.sensor.create_sensor("map", "RANGE", sensor_range=12.0)
    ctx.sensor.create_sensor("near", "NEIGHBOR")
    for name, node in (("anna", 0), ("bert", 5)):
        team = "red" if name == "anna" else "blue"
        ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=["eyes"], strategy=wander, fuel=3)
    ctx.agent.get_agent("anna").register_sensor("late", ctx.sensor.get_sensor("late"))
    ctx.agent.create_agent("kite", start_node_id=3, type=AgentType.AERIAL, speed=2.0, team="blue", strategy=fly)
    ctx.game.deeds = {"mark": {"what": "integer"}}
    ctx.game.add_channel("radio", range_m=25.0, loss=0.2, delay_turns=1)
    ctx.game.publish(wind=(1, 2))
    ctx.game.publish(to="anna", word="fox")
    ctx.game.data["flag"] = 1


def change_agents(ctx: Any) -> None:
    """Change every value of agents that is recorded."""
    anna = ctx.agent.get_agent("anna")
    anna.register_sensor("near", ctx.sensor.get_sensor("near"))
    anna.orientation = (0.0, 1.0)
    anna.fuel = 2
    anna.speed = 1.0
    ctx.agent.get_agent("bert").team = "green"
    kite = ctx.agent.get_agent("kite")
    kite.quat = (0.5, 0.5, 0.5, 0.5)
    kite.position = (5.0, 5.0, 5.0)
    del ctx.game.data["flag"]


def change_map(ctx: Any) -> None:
    """Remove a node, and change who plays."""
    ctx.graph.graph.remove_node(8)
    anna = ctx.agent.get_agent("anna")
    anna.deregister_sensor("near")
    anna.register_strategy(gamms.strategies.stay)
    ctx.agent.create_agent("dora", start_node_id=1)


def delete_things(ctx: Any) -> None:
    """Delete an agent and a component, and put an agent elsewhere."""
    ctx.agent.get_agent("bert").alive = False
    anna = ctx.agent.get_agent("anna")
    anna.prev_node_id = 4
    anna.current_node_id = 4
    ctx.agent.delete_agent("dora")
    ctx.record.delete_component("spare")


def note_nothing(_: Any) -> None:
    """Do nothing, in a turn without changes."""


def play_drawings(ctx: Any, stream: io.BytesIO) -> None:
    """Play a game with drawings and legends, without its map."""
    ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2, 10.0))
    ctx.agent.create_agent("a", start_node_id=0, team="red", strategy=gamms.strategies.random_walk)
    ctx.agent.create_agent("b", start_node_id=3, team="blue", strategy=gamms.strategies.stay)
    ctx.game.add(tag("red", "blue"))

    def draw(ctx: Any, data: dict[str, Any]) -> None:
        x, y = ctx.visual.drawing.position_of("a", data["_alpha"])
        ctx.visual.render_circle(x, y, 4.0, (200, 0, 100), 2)
        ctx.visual.render_text(f"turn {ctx.game.turn}", x, y + 2.0, font_size=14)
        ctx.visual.drawing.render_lines([(0, 0), (x, y), (20, 20)], [0, 3], (1, 2, 3, 99), 0.5, in_world=True)

    rows = {"drawer": draw, "legend": lambda ctx: LegendRows("Score", (LegendRow((1, 2, 3), "a", str(ctx.game.turn)),))}
    ctx.visual.add_artist("around", rows)
    still = Artist(ctx, lambda ctx, data: ctx.visual.render_circle(5, 5, data["r"], (0, 99, 0)), 12)
    still.set_artist_type(ArtistType.STATIC)
    still.data = {"r": 2.0, "legend": ColorScale("heat", ((0, 0, 0), (9, 9, 9)), "0", "1", "2")}
    ctx.visual.add_artist("still", still)
    ctx.visual.artists.team_colors = {"red": "orange"}
    ctx.record.start(stream, embed_graph=False)
    ctx.game.step()
    still.data["r"] = 3.0
    ctx.visual.set_graph_visual(node_size=1.0)
    ctx.game.step()
    ctx.visual.artists.get("around").set_visible(False)
    ctx.game.run(1)
    ctx.record.stop()


def take_edge(state: dict[str, Any]) -> None:
    """Take the last legal edge, or go on."""
    edges = state["legal_edges"]
    state["action"] = {"edge": edges[-1]} if edges else max(state["legal"])


def play_roads(ctx: Any, stream: io.BytesIO) -> None:
    """Play a game by metres on parallel edges, with agents on them."""
    ctx.graph.add_nodes([0, 1, 2], [0.0, 30.0, 60.0], [0.0, 0.0, 0.0])
    for id, (source, target) in enumerate([(0, 1), (0, 1), (1, 2), (1, 0), (2, 1)]):
        ctx.graph.add_edge({"id": id, "source": source, "target": target, "length": 30.0 + id})
    ctx.agent.create_agent("car", start_node_id=0, team="red", strategy=gamms.strategies.random_walk, speed=20.0)
    ctx.agent.create_agent("cab", start_node_id=0, team="red", strategy=take_edge)
    ctx.game.speed_unit = "metres"
    ctx.game.run(1)
    ctx.record.start(stream)
    ctx.game.run(3)
    ctx.record.stop()


# -- maps -------------------------------------------------------------------------------------------------------


def numbers(items: Sequence[Any], width: int = 0, dtype: str = "int64") -> msgpack.Ext:
    """Return an array of integers or floats, with rows of a width if it is not 0."""
    found = np.array(items, dtype)
    shape = (-1, width) if width else (-1,)
    found = found.reshape(shape)
    flat = found.reshape(-1)
    if "int" in dtype:
        flat = np.diff(flat, prepend=flat.dtype.type(0))
    planes = flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T.tobytes()
    return extension(8, dtype, msgpack.Ext(5, planes), *found.shape)


def floats(items: Sequence[Any], width: int = 0) -> msgpack.Ext:
    """Return an array of floats."""
    return numbers(items, width, "float64")


def attribute(rows: Sequence[int], codes: Sequence[int], values: list[Any]) -> msgpack.Ext:
    """Return an attribute."""
    return extension(1, numbers(rows), numbers(codes), plain(values))


FACE = [0.0, 0.0, 5.0, 4.0, 0.0, 5.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0]
CLOSED = {"id": 30, "source": 7, "target": 9, "length": 5.0, "lanes": 2}
LINE = [[0.0, 0.0], [3.0, 4.0]]
GRAPH: dict[str, object] = {
    "crs": "EPSG:32635",
    "attribution": None,
    "node_ids": numbers([7, -2, 9]),
    "xy": floats([0.0, 0.0, 10.0, 0.0, 10.0, -0.5], 2),
    "edge_ids": numbers([20, 10]),
    "sources": numbers([0, 2]),
    "targets": numbers([1, 0]),
    "lengths": floats([10.0, 12.5]),
    "bend_rows": numbers([1]),
    "bend_sizes": numbers([3]),
    "bend_points": floats([10.0, -0.5, 5.0, 5.0, 0.0, 0.0], 2),
    "face_ids": numbers([1, 4]),
    "face_types": numbers([0, 2]),
    "face_corners": floats(FACE * 2, 12),
    "node_attributes": extension(2, "name", attribute([0, 2], [1, 0], ["a", "b"])),
    "edge_attributes": extension(2, "lanes", attribute([1], [0], [(1, 2)])),
}
BASE_MAP: dict[str, object] = {
    "kinds": numbers([1, 16, 99]),
    "sizes": numbers([3, 2, 2]),
    "points": floats(range(14), 2),
    "face_types": numbers([0]),
    "face_corners": floats(FACE, 12),
}
ANSWER: dict[str, Any] = {
    "crs": "EPSG:32635",
    "attribution": None,
    "scenery": None,
    "nodes": [[7, 0.0, 0.0], [-2, 10.0, 0.0], [9, 10.0, -0.5]],
    "edges": [[20, 7, -2, 10.0, None], [10, 9, 7, 12.5, [[10.0, -0.5], [5.0, 5.0], [0.0, 0.0]]]],
    "faces": [[1, 0, *FACE], [4, 2, *FACE]],
    "node_attributes": {"name": [[7, "b"], [9, "a"]]},
    "edge_attributes": {"lanes": [[10, (1, 2)]]},
    "closed": [],
    "base_map": None,
}


def framed(body: bytes, magic: bytes = b"GAMMSMAP", version: int = 2, more: int = 0, crc: int | None = None) -> bytes:
    """Return a saved map or a visibility table."""
    return magic + struct.pack("<3I", version, len(body) + more, zlib.crc32(body) if crc is None else crc) + body


def dict_body(state: dict[str, object]) -> bytes:
    """Return a dict as packed bytes."""
    return packed(array(extension(2, *(part for pair in state.items() for part in pair))))


def saved(**changes: object) -> bytes:
    """Return the map with other items, without those that are given as `LEFT_OUT`."""
    state = {key: value for key, value in (GRAPH | changes).items() if value is not LEFT_OUT}
    return framed(dict_body(state))


LEFT_OUT = object()


def make_maps() -> Iterator[Vector]:
    """Yield maps."""
    yield "map", saved(), ANSWER
    yield "zeros_behind_a_map", framed(dict_body(GRAPH) + bytes(5)), ANSWER
    yield "unknown_key", saved(future=extension(1, 1, 2)), ANSWER
    names = {name: numbers([]) for name in GRAPH if name.endswith(("ids", "rows", "sizes", "types"))}
    names |= {"sources": numbers([]), "targets": numbers([]), "lengths": floats([])}
    names |= {"xy": _no_rows(2), "bend_points": _no_rows(2), "face_corners": _no_rows(12)}
    names |= {"node_attributes": extension(2), "edge_attributes": extension(2), "crs": None}
    nothing = {"nodes": [], "edges": [], "faces": [], "node_attributes": {}, "edge_attributes": {}, "crs": None}
    yield "empty_map", saved(**names), ANSWER | nothing
    yield "attribution", saved(attribution="\u00a9 me"), ANSWER | {"attribution": "\u00a9 me"}
    yield "scenery", saved(scenery="helsinki"), ANSWER | {"scenery": "helsinki"}
    yield "closed", saved(closed=plain([CLOSED])), ANSWER | {"closed": [CLOSED]}
    bent = [part for pair in (CLOSED | {"linestring": floats(LINE, 2)}).items() for part in pair]
    curved = saved(closed=extension(1, msgpack.Ext(2, array(*map(plain, bent)))))
    yield "closed_polyline", curved, ANSWER | {"closed": [CLOSED | {"linestring": LINE}]}
    base_map = extension(2, *(part for pair in BASE_MAP.items() for part in pair))
    places = [[float(x), float(x + 1)] for x in range(0, 14, 2)]
    shapes = [[1, places[:3]], [16, places[3:5]], [99, places[5:]]]
    yield "base_map", saved(base_map=base_map), ANSWER | {"base_map": {"shapes": shapes, "walls": [[0, *FACE]]}}
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 2, 10.0))
        ctx.graph.graph.add_edge({"id": 99, "source": 0, "target": 5, "length": 30.5, "oneway": True})
        ctx.graph.graph.add_edge(
            {"id": 98, "source": 1, "target": 2, "length": 9.0, "linestring": [(0, 0), (1, 5), (2, 0)]}
        )
        ctx.graph.close_roads([98])
        ctx.graph.add_obstacles([[(2, 2, 5), (6, 2, 5), (6, 2, 0), (2, 2, 0)]])
        yield "saved_by_gamms", ctx.graph.storage.pack(), {}


def make_ranges() -> Iterator[Vector]:
    """Yield maps whose values are as large, as small or as few as allowed."""
    yield "scenery_none", saved(scenery=None), ANSWER
    ids = saved(node_ids=numbers([2**63 - 1, -(2**63), 9]), node_attributes=extension(2))
    yield "ids_of_64_bits", ids, {"nodes": [[2**63 - 1, 0.0, 0.0], [-(2**63), 10.0, 0.0], [9, 10.0, -0.5]]}
    yield "loops_and_parallel_edges", saved(sources=numbers([1, 1]), targets=numbers([1, 1])), {}
    yield "lengths_of_0", saved(lengths=floats([0.0, -0.0])), {}
    bend = saved(bend_sizes=numbers([2]), bend_points=floats([10.0, -0.5, 0.0, 0.0], 2))
    yield "bend_of_two_points", bend, {"edges": [ANSWER["edges"][0], [10, 9, 7, 12.5, [[10.0, -0.5], [0.0, 0.0]]]]}
    for name, values in {"unused": [1, "other"], "of_each_type": [[None, {"a": (1.5, b"b")}]], "twice": [1, 1]}.items():
        held = extension(2, "a", attribute([1], [0], values))
        yield f"attribute_value_{name}", saved(node_attributes=held), {"node_attributes": {"a": [[-2, values[0]]]}}
    yield "closed_without_edges", saved(closed=plain([])), ANSWER
    for name, changes in {
        "ids_of_64_bits": {"id": -(2**63), "source": 2**63 - 1},
        "length_integer": {"length": 5},
        "length_of_100_bits": {"length": 2**100},
        "polyline_none": {"linestring": None},
    }.items():
        edge = CLOSED | changes
        yield f"closed_{name}", saved(closed=plain([edge])), ANSWER | {"closed": [edge]}
    for dtype in ("int8", "uint64", "float16", "float32"):
        bent = _close_along(numbers([0, 0, 3, 4], 2, dtype))
        yield f"closed_polyline_of_{dtype}", bent, ANSWER | {"closed": [CLOSED | {"linestring": [[0, 0], [3, 4]]}]}
    none = {"kinds": numbers([]), "sizes": numbers([]), "face_types": numbers([])}
    none |= {"points": _no_rows(2), "face_corners": _no_rows(12)}
    yield "base_map_without_shapes", _draw(none), ANSWER | {"base_map": {"shapes": [], "walls": []}}
    yield "base_map_of_other_kinds", _draw({"kinds": numbers([15, 16, 1 << 40])}), {}
    yield "base_map_farthest", _draw({"points": floats([*range(12), 1e12, -1e12], 2)}), {}


def _close_along(line: object) -> bytes:
    """Return the map with a closed edge that has a polyline."""
    edge = [
        plain(part) if part is not line else part for pair in (CLOSED | {"linestring": line}).items() for part in pair
    ]
    return saved(closed=extension(1, extension(2, *edge)))


def _draw(changes: dict[str, object]) -> bytes:
    """Return the map with a base map."""
    return saved(base_map=extension(2, *(part for pair in (BASE_MAP | changes).items() for part in pair)))


def make_bad_ranges() -> Iterator[Vector]:
    """Yield maps with values outside of their limits."""
    body = dict_body(GRAPH)
    yield "refused_size_too_large", framed(body, more=1), refused("missing bytes", None)
    yield "refused_size_too_small", framed(body, more=-1), refused("superfluous bytes", None)
    large = numbers([2**62] * 4 + [7])
    lines = numbers([16] * 5)
    yield "refused_base_map_sizes_beyond_64_bits", _draw({"kinds": lines, "sizes": large}), refused("sizes", None)
    negative = _draw({"kinds": numbers([16] * 3), "sizes": numbers([8, -3, 2])})
    yield "refused_base_map_size_negative", negative, refused("sizes", None)
    area = _draw({"kinds": numbers([1, 16, -5])})
    yield "refused_base_map_area_of_a_negative_kind", area, refused("sizes", None)
    for key in ("sizes", "points", "face_types", "face_corners"):
        yield f"refused_base_map_without_{key}", _draw({key: None}), refused("array", None)
    for name, line in {
        "booleans": extension(8, "bool", msgpack.Ext(5, bytes(4)), 2, 2),
        "one_dimension": floats([0, 0, 3, 4]),
    }.items():
        yield f"refused_closed_polyline_of_{name}", _close_along(line), refused("closed", None)
    yield "refused_closed_none", saved(closed=None), refused("closed", None)
    for name, key, value in (
        ("id_boolean", "id", True),
        ("id_float", "id", 30.0),
        ("length_boolean", "length", True),
        ("length_beyond_floats", "length", 10**400),
    ):
        yield f"refused_closed_{name}", saved(closed=plain([CLOSED | {key: value}])), refused("closed", None)
    rows = {"edge_ids": numbers(range(5)), "sources": numbers([0] * 5), "targets": numbers([1] * 5)}
    rows |= {"lengths": floats([1.0] * 5), "bend_rows": numbers(range(5)), "edge_attributes": extension(2)}
    beyond = saved(**rows, bend_sizes=numbers([2**62] * 4 + [3]))
    yield "refused_bend_sizes_beyond_64_bits", beyond, refused("sizes", None)
    yield "refused_bend_row_negative", saved(bend_rows=numbers([-1])), refused("rows", None)
    for name, limit, column in (
        ("row_negative", "rows", attribute([-1], [0], [1])),
        ("too_few_rows", "attribute", attribute([0], [0, 0], [1])),
        ("without_values", "attribute", attribute([0], [0], [])),
        ("four_items", "attribute", extension(1, numbers([0]), numbers([0]), plain([1]), 1)),
    ):
        held = saved(node_attributes=extension(2, "a", column))
        yield f"refused_attribute_{name}", held, refused(limit, None)
    surrogate = msgpack.Ext(7, b"a\xed\xa0\x80")
    yield "refused_scenery_surrogate", saved(scenery=surrogate), refused("text", None)
    yield "refused_attribution_surrogate", saved(attribution=surrogate), refused("text", None)


def _no_rows(width: int) -> msgpack.Ext:
    return extension(8, "float64", msgpack.Ext(5, b""), 0, width)


def make_bad_maps() -> Iterator[Vector]:
    """Yield maps that readers refuse."""
    body = dict_body(GRAPH)
    yield "refused_magic", framed(body, b"GAMMSMAX"), refused("magic", None)
    yield "refused_cut_head", framed(body)[:19], refused("magic", None)
    for version in (1, 3):
        yield f"refused_version_{version}", framed(body, version=version), refused("version", None)
    yield "refused_crc", framed(body, crc=1), refused("crc", None)
    yield "refused_cut", framed(body)[:-1], refused("missing bytes", None)
    yield "refused_bytes_behind", framed(body) + b"\0", refused("superfluous bytes", None)
    yield "refused_bytes_behind_the_value", framed(body + b"\1"), refused("superfluous bytes", None)
    yield "refused_list", framed(packed(value_of([]))), refused("dict", None)
    big = framed(packed(value_of({"": "x" * (17 << 20)})))
    yield "refused_memory", big, refused("memory", None)
    alike = [5 + k * PRIME for k in range(16, 81)]
    yield "refused_hashes", saved(future=plain(dict.fromkeys(alike, 0))), refused("hashes", None)
    an_array = extension(8, "int64", msgpack.Ext(5, bytes(8)))
    closed_with_array = [part for pair in (CLOSED | {"target": an_array}).items() for part in pair]
    bad: dict[str, tuple[str, dict[str, object]]] = {
        "no_dtype": ("array", {"xy": numbers([0] * 6, 2)}),
        "integers_as_floats": ("array", {"node_ids": floats([7, -2, 9])}),
        "integers_of_32_bits": ("array", {"sources": numbers([0, 2], 0, "int32")}),
        "no_array": ("array", {"lengths": 3}),
        "shape_of_xy": ("array", {"xy": floats([0.0] * 9, 3)}),
        "too_few_xy": ("array", {"xy": floats([0.0] * 4, 2)}),
        "too_few_sources": ("array", {"sources": numbers([0])}),
        "too_many_lengths": ("array", {"lengths": floats([1.0, 2.0, 3.0])}),
        "shape_of_ids": ("array", {"node_ids": numbers([7, -2, 9], 1)}),
        "node_id_twice": ("ids", {"node_ids": numbers([7, -2, 7])}),
        "edge_id_twice": ("ids", {"edge_ids": numbers([20, 20])}),
        "face_id_twice": ("ids", {"face_ids": numbers([1, 1])}),
        "source_beyond": ("rows", {"sources": numbers([0, 3])}),
        "target_negative": ("rows", {"targets": numbers([1, -1])}),
        "xy_not_finite": ("finite", {"xy": floats([0.0, np.nan, 10.0, 0.0, 10.0, -0.5], 2)}),
        "length_not_finite": ("lengths", {"lengths": floats([10.0, np.inf])}),
        "length_negative": ("lengths", {"lengths": floats([10.0, -1.0])}),
        "bend_row_beyond": ("rows", {"bend_rows": numbers([2])}),
        "bend_row_twice": ("rows", {"bend_rows": numbers([1, 1]), "bend_sizes": numbers([3, 0])}),
        "bend_rows_descending": (
            "rows",
            {"bend_rows": numbers([1, 0]), "bend_sizes": numbers([2, 2]), "bend_points": floats(range(8), 2)},
        ),
        "bend_of_one_point": (
            "sizes",
            {"bend_rows": numbers([0, 1]), "bend_sizes": numbers([1, 2])},
        ),
        "bend_sizes": ("sizes", {"bend_sizes": numbers([2])}),
        "too_few_bend_sizes": ("array", {"bend_sizes": numbers([])}),
        "bend_not_finite": ("finite", {"bend_points": floats([10.0, np.inf, 5.0, 5.0, 0.0, 0.0], 2)}),
        "face_not_finite": ("finite", {"face_corners": floats([*FACE[1:], np.nan, *FACE], 12)}),
        "faces_of_8_numbers": ("array", {"face_corners": floats(FACE * 2, 8)}),
        "too_few_faces": ("array", {"face_types": numbers([0])}),
        "crs_number": ("text", {"crs": 32635}),
        "attribution_list": ("text", {"attribution": plain(["me"])}),
        "scenery_number": ("text", {"scenery": 3}),
        "closed_without_length": ("closed", {"closed": plain([{"id": 1, "source": 7, "target": 9}])}),
        "closed_without_id": ("closed", {"closed": plain([{"source": 7, "target": 9, "length": 1.0}])}),
        "closed_length_negative": ("closed", {"closed": plain([CLOSED | {"length": -1.0}])}),
        "closed_source_text": ("closed", {"closed": plain([CLOSED | {"source": "a"}])}),
        "closed_target_array": ("closed", {"closed": extension(1, extension(2, *closed_with_array))}),
        "closed_key_number": ("closed", {"closed": plain([{**CLOSED, 1: 2}])}),
        "closed_list": ("closed", {"closed": plain([[1, 2]])}),
        "closed_tuple": ("closed", {"closed": plain((CLOSED,))}),
        "closed_id_twice": ("ids", {"closed": plain([CLOSED, CLOSED])}),
        "closed_id_beyond_64_bits": ("closed", {"closed": plain([CLOSED | {"id": 1 << 63}])}),
        "closed_length_not_finite": ("closed", {"closed": plain([CLOSED | {"length": np.nan}])}),
        "closed_polyline_list": ("closed", {"closed": plain([CLOSED | {"linestring": LINE}])}),
        "closed_polyline_text": ("closed", {"closed": plain([CLOSED | {"linestring": "LINESTRING (0 0, 3 4)"}])}),
        "closed_polyline_of_one_point": ("closed", {"closed": plain([CLOSED | {"linestring": floats([0, 0], 2)}])}),
        "closed_polyline_of_three_numbers": (
            "closed",
            {"closed": plain([CLOSED | {"linestring": floats([0] * 6, 3)}])},
        ),
        "closed_polyline_not_finite": (
            "closed",
            {"closed": plain([CLOSED | {"linestring": floats([0, np.inf] * 2, 2)}])},
        ),
        "crs_surrogate": ("text", {"crs": msgpack.Ext(7, "a\ud800".encode("utf-8", "surrogatepass"))}),
        "base_map_none": ("dict", {"base_map": None}),
        "base_map_and_scenery": (
            "scenery",
            {"scenery": "helsinki", "base_map": extension(2, *(part for pair in BASE_MAP.items() for part in pair))},
        ),
    }
    for name, column in {
        "without_rows": attribute([], [], []),
        "row_beyond": attribute([0, 3], [0, 0], [1]),
        "rows_descending": attribute([2, 0], [0, 0], [1]),
        "rows_twice": attribute([2, 2], [0, 0], [1]),
        "number_beyond": attribute([0], [1], [1]),
        "number_negative": attribute([0], [-1], [1]),
        "too_few_numbers": attribute([0, 1], [0], [1]),
        "two_items": extension(1, numbers([0]), numbers([0])),
        "values_tuple": extension(1, numbers([0]), numbers([0]), plain((1,))),
        "rows_of_32_bits": extension(1, numbers([0], 0, "int32"), numbers([0]), plain([1])),
        "no_rows_array": extension(1, plain([0]), numbers([0]), plain([1])),
    }.items():
        limit = "rows" if name in ("row_beyond", "rows_descending", "rows_twice") else "attribute"
        bad[f"attribute_{name}"] = (limit, {"node_attributes": extension(2, "a", column)})
    as_tuple = extension(0, numbers([1]), numbers([0]), plain([1]))
    bad["attribute_tuple"] = ("attribute", {"edge_attributes": extension(2, "a", as_tuple)})
    bad["attribute_name_number"] = ("attribute", {"edge_attributes": extension(2, 1, attribute([0], [0], [1]))})
    bad["attributes_list"] = ("attribute", {"edge_attributes": extension(1)})
    for name, limit, changes in (
        ("sizes", "sizes", {"sizes": numbers([3, 2, 3])}),
        ("sizes_in_rows", "array", {"sizes": numbers([3, 2, 2], 1)}),
        ("area_of_two_points", "sizes", {"sizes": numbers([2, 3, 2])}),
        ("line_of_one_point", "sizes", {"sizes": numbers([3, 1, 3])}),
        ("kinds", "array", {"kinds": numbers([1, 16])}),
        ("points", "array", {"points": floats(range(12), 3)}),
        ("walls", "array", {"face_types": numbers([])}),
        ("without_kinds", "array", {"kinds": None}),
        ("not_finite", "finite", {"points": floats([*range(13), np.nan], 2)}),
        ("far_away", "finite", {"points": floats([*range(13), 1.1e12], 2)}),
        ("wall_not_finite", "finite", {"face_corners": floats([*FACE[1:], np.inf], 12)}),
    ):
        columns = BASE_MAP | changes
        bad[f"base_map_{name}"] = (
            limit,
            {"base_map": extension(2, *(part for pair in columns.items() for part in pair))},
        )
    many = floats(np.zeros(2 << 20), 2)  # and a wall
    shapes = BASE_MAP | {"kinds": numbers([16]), "sizes": numbers([1 << 20]), "points": many}
    shapes_with_points = [part for pair in shapes.items() for part in pair]
    large = dict_body(GRAPH | {"base_map": extension(2, *shapes_with_points)})
    yield "refused_base_map_points_1048577", framed(large + bytes(60_000)), refused("points", None)
    bad["base_map_list"] = ("dict", {"base_map": extension(1)})
    for key in GRAPH:
        limit = "text" if key in ("crs", "attribution") else "attribute" if key.endswith("attributes") else "array"
        bad[f"without_{key}"] = (limit, {key: LEFT_OUT})
    for name, (limit, changes) in bad.items():
        yield f"refused_{name}", saved(**changes), refused(limit, None)


def make_sights() -> Iterator[Vector]:
    """Yield visibility tables."""
    state: dict[str, object] = {"key": plain(b"k" * 32), "radius": 50.0, "observer_height": 1.5}
    state |= {"counts": numbers([2, 1, 3], 0, "int32"), "rows": numbers([0, 1, 1, 0, 1, 2], 0, "int32")}
    answer = {"key": b"k" * 32, "radius": 50.0, "observer_height": 1.5, "seen": [[0, 1], [1], [0, 1, 2]]}
    seal = partial(framed, magic=b"GAMMSEYE", version=3)
    yield "sight", seal(dict_body(state)), answer
    seen = VisibilityRows(np.array([1, 1], np.int32), np.array([0, 1], np.int32))
    yield "saved_by_gamms", encode_sight(seen, b"key", 5.0, 0.0), {"seen": [[0], [1]]}
    none = numbers([], 0, "int32")
    yield "sight_of_no_node", seal(dict_body(state | {"counts": none, "rows": none})), answer | {"seen": []}
    yield "sight_with_an_unknown_key", seal(dict_body(state | {"future": 1})), answer
    for key in state:
        without = seal(dict_body({name: value for name, value in state.items() if name != key}))
        limit = "array" if key in ("counts", "rows") else "dict"
        yield f"refused_without_{key}", without, refused(limit, None)
    yield "refused_magic", framed(dict_body(state), version=3), refused("magic", None)
    yield "refused_version", seal(dict_body(state), version=2), refused("version", None)
    yield "refused_crc", seal(dict_body(state), crc=1), refused("crc", None)
    yield "refused_cut", seal(dict_body(state))[:-1], refused("missing bytes", None)
    yield "refused_bytes_behind", seal(dict_body(state)) + b"\0", refused("superfluous bytes", None)
    for name, limit, changes in (
        ("counts_of_64_bits", "array", {"counts": numbers([2, 1, 3])}),
        ("counts", "sizes", {"counts": numbers([2, 1, 2], 0, "int32")}),
        ("counts_negative", "sizes", {"counts": numbers([-1, 4, 3], 0, "int32")}),
        ("counts_of_two_dimensions", "array", {"counts": numbers([2, 1, 3], 1, "int32")}),
        ("count_0", "sizes", {"counts": numbers([0, 3, 3], 0, "int32")}),
        ("row_beyond", "rows", {"rows": numbers([0, 1, 1, 0, 1, 3], 0, "int32")}),
        ("row_negative", "rows", {"rows": numbers([-1, 1, 1, 0, 1, 2], 0, "int32")}),
        ("rows_descending", "rows", {"rows": numbers([1, 0, 1, 0, 1, 2], 0, "int32")}),
        ("rows_missing", "array", {"rows": None}),
        ("key_text", "dict", {"key": "k" * 32}),
    ):
        yield f"refused_{name}", seal(dict_body(state | changes)), refused(limit, None)


# -- looks ------------------------------------------------------------------------------------------------------


def sensed(*turns: Sequence[tuple[int, object]], world: bytes | None = b"") -> bytes:
    """Return a recording of turns of events, with a map: the one of `saved` if none is given, no map if it is None."""
    header = {"format": 3} | ({} if world is None else {"world": world or saved()})
    head = packed(value_of(header))
    key = zlib.crc32(head)
    values = [value_of(data) for turn in turns for _, data in turn]
    kinds = [kind for turn in turns for kind, _ in turn]
    columns = [column(*[0] * len(turns)), column(*map(len, turns)), *[b"\0"] * 3, column(*[0] * len(values))]
    body = turns_body([*columns, column(*kinds), column(*map(len, values))], b"".join(values))
    blocks = block("T", body, key, 0, len(turns), 0, len(values)) + block("E", b"", key, len(turns))
    return MAGIC + block("H", head) + blocks


def small(items: Sequence[int], width: int = 0) -> msgpack.Ext:
    """Return an array of bytes."""
    return numbers(items, width, "uint8")


def flags(items: Sequence[int], *shape: int) -> msgpack.Ext:
    """Return an array of booleans."""
    return extension(8, "bool", msgpack.Ext(5, bytes(items)), *shape)


# Agent 4 has two sensors and agent 0 has four. The looks have the forms 0 to 5.
LOOKS: dict[str, object] = {
    "agents": small([4, 0]),
    "counts": small([2, 4]),
    "sensors": [("eyes", "AGENT_RANGE"), ("map", "MAP"), ("gauge", "CUSTOM"), ("radar", "AERIAL_AGENT")],
    "which": small([1, 1, 0, 2, 3, 0]),
    "forms": small([0, 1, 2, 3, 4, 5]),
    "sizes": small([2, 0, 1, 2, 1, 1, 0, 0, 1, 1, 2, 0], 2),
    "ids": numbers([7, -2, 7, 20, 10, 4, 9, 4, 9, 1, 0]),
    "others": [{"volts": 2.5}, [(1, (1.0, 2.0, 3.0))]],
    "seen": small([2, 4]),
    "seen_at": small([7, 9]),
}
SEEN: list[tuple[object, ...]] = [
    (4, "map", "MAP", 0, [7, -2], [], None),
    (4, "map", "MAP", 1, [7], [20, 10], None),
    (0, "eyes", "AGENT_RANGE", 2, [4], [9], None),
    (0, "gauge", "CUSTOM", 3, [], [], {"volts": 2.5}),
    (0, "radar", "AERIAL_AGENT", 4, [4], [9], [(1, (1.0, 2.0, 3.0))]),
    (0, "eyes", "AGENT_RANGE", 2, [4, 2], [9, 7], None),
]
FIELDS: dict[str, object] = {
    "fields": small([0, 0, 1, 0, 2, 3]),
    "first_field": 0,
    "new_fields": [(7, 10.0, b""), ((10.0, -0.25), 0.25, b"\x40"), (9, 0.0, b"")],
}
ONE_LOOK: dict[str, object] = {
    "agents": small([4]),
    "counts": small([1]),
    "sensors": [("eyes", "AGENT_RANGE")],
    "which": small([0]),
    "forms": small([0]),
    "sizes": small([0, 0], 2),
    "ids": numbers([]),
    "others": [],
}


def one_look(number: int, first: int, *fields: object) -> tuple[int, dict[str, object]]:
    """Return an event with one look, which has the field of a number."""
    return SENSED, ONE_LOOK | {"fields": small([number]), "first_field": first, "new_fields": [*fields]}


def covering(*covered: list[int] | None) -> list[tuple[object, ...]]:
    """Return looks of `one_look`."""
    return [(4, "eyes", "AGENT_RANGE", 0, [], [], None, nodes) for nodes in covered]


def make_looks() -> Iterator[Vector]:
    """Yield recordings with sensed data, and with sensed data that readers refuse."""
    without = [(*look, None) for look in SEEN]
    yield "looks_of_each_form", sensed([(SENSED, LOOKS)]), {"looks": [without]}
    covered = [None, None, [-2, 7], None, [-2], [9]]
    answer = [(*look, nodes) for look, nodes in zip(SEEN, covered, strict=True)]
    yield "looks_with_fields", sensed([(SENSED, LOOKS | FIELDS)]), {"looks": [answer]}
    yield "looks_without_a_map", sensed([(SENSED, LOOKS | FIELDS)], world=None), {"looks": [without]}
    nothing = {name: small([], 2) if name == "sizes" else small([]) for name in ("agents", "counts", "which", "forms")}
    nothing |= {
        "sizes": extension(8, "uint8", msgpack.Ext(5, b""), 0, 2),
        "ids": small([]),
        "sensors": [],
        "others": [],
    }
    yield "looks_of_no_agent", sensed([(SENSED, nothing)], []), {"looks": [[], []]}
    again = sensed([one_look(1, 0, (7, 0.0, b""))], [one_look(1, 1)], [one_look(2, 1, (9, 0.0, b""))])
    yield "looks_with_a_field_again", again, {"looks": [covering([7]), covering([7]), covering([9])]}
    numbered = sensed([one_look(1, 0, (7, 0.0, b""))], [one_look(1, 0, (9, 0.0, b""))], [one_look(1, 1)])
    yield "looks_with_numbers_from_0_again", numbered, {"looks": [covering([7]), covering([9]), covering([9])]}
    missing = sensed([one_look(3, 3)], [one_look(4, 3, (9, 0.0, b""))], [one_look(0, 4)])
    yield "looks_with_a_missing_field", missing, {"looks": [covering(None), covering([9]), covering(None)]}
    moved = saved(xy=floats([0.0, 0.0, 10.0, 0.0, 0.0, 0.0], 2))
    at_two_nodes = one_look(1, 0, (7, 0.0, b"\x80"))
    changed = sensed([one_look(1, 0, (7, 0.0, b""))], [(NEW_MAP, {"world": moved}), at_two_nodes])
    yield "looks_after_a_new_map", changed, {"looks": [covering([7]), covering([9])]}
    one = {name: value for name, value in LOOKS.items() if name not in ("seen", "seen_at")}
    five_forms = one | {"forms": small([0, 1, 2, 3, 4, 0])}
    unlisted = [*without[:-1], (0, "eyes", "AGENT_RANGE", 0, [1, 0], [], None, None)]
    yield "looks_without_listed_agents", sensed([(SENSED, five_forms)]), {"looks": [unlisted]}
    for name, field, nodes in (
        ("of_radius_minus_zero", (7, -0.0, b""), [7]),
        ("at_minus_zero", ((-0.0, 0.0), 0.0, b""), [7]),
        ("of_no_node", ((50.0, 50.0), 1.0, b""), []),
    ):
        yield f"looks_with_a_field_{name}", sensed([one_look(1, 0, field)]), {"looks": [covering(nodes)]}
    unused = sensed([one_look(1, 0, (7, 0.0, b""), (8, 1.0, b""))])
    yield "looks_with_an_unused_field_at_no_node", unused, {"looks": [covering([7])]}
    for name, limit, data in (
        ("without_world", "dict", {}),
        ("of_a_text", "dict", {"world": "map"}),
        ("cut", "missing bytes", {"world": saved()[:-1]}),
    ):
        yield f"refused_looks_after_a_map_{name}", sensed([(NEW_MAP, data), (SENSED, LOOKS)]), refused(limit, None)
    yield from _make_bad_looks()
    yield from _make_discs()


def _make_bad_looks() -> Iterator[Vector]:
    huge = numbers([1 << 62] * 4)
    bad: dict[str, tuple[str, dict[str, object]]] = {
        "looks_counts": ("looks", {"counts": small([2, 3])}),
        "looks_counts_negative": ("looks", {"counts": numbers([7, -1])}),
        "looks_counts_with_a_sum_beyond_64_bits": (
            "looks",
            {"agents": small([0] * 4), "counts": huge, "which": small([]), "forms": small([])}
            | {"sizes": extension(8, "uint8", msgpack.Ext(5, b""), 0, 2), "ids": small([]), "others": []},
        ),
        "looks_agents": ("looks", {"agents": small([4])}),
        "looks_agents_beyond_64_bits": ("looks", {"agents": numbers([4, 1 << 63], 0, "uint64")}),
        "looks_agents_list": ("looks", {"agents": [4, 0]}),
        "looks_agents_floats": ("looks", {"agents": floats([4.0, 0.0])}),
        "looks_agents_table": ("looks", {"agents": small([4, 0], 1)}),
        "looks_sensor_beyond": ("looks", {"which": small([1, 1, 0, 2, 4, 0])}),
        "looks_sensor_negative": ("looks", {"which": numbers([1, 1, 0, 2, -1, 0])}),
        "looks_sensor_of_three": ("looks", {"sensors": [("eyes", "AGENT_RANGE", 1)] * 4}),
        "looks_sensor_number": ("looks", {"sensors": [(1, "AGENT_RANGE")] * 4}),
        "looks_sensors_tuple": ("looks", {"sensors": (("eyes", "AGENT_RANGE"),) * 4}),
        "looks_sensor_list": ("looks", {"sensors": [["eyes", "AGENT_RANGE"]] * 4}),
        "looks_forms": ("looks", {"forms": small([0, 1, 2, 3, 4])}),
        "looks_form_4_without_nodes": ("looks", {"sizes": small([2, 0, 1, 2, 1, 1, 0, 0, 2, 0, 2, 0], 2)}),
        "looks_seen_with_a_second_part": ("looks", {"sizes": small([2, 0, 1, 2, 1, 1, 0, 0, 1, 1, 1, 1], 2)}),
        "looks_other_data_with_a_second_part": ("looks", {"sizes": small([2, 0, 1, 2, 1, 1, 0, 1, 1, 1, 1, 0], 2)}),
        "looks_sizes_beyond_64_bits": ("sizes", {"sizes": numbers([*[2**62, 0, 2**62] * 2, 0, 0, 1, 1, 9, 0], 2)}),
        "looks_ids_beyond_64_bits": ("looks", {"ids": numbers([1 << 63, *range(10)], 0, "uint64")}),
        "looks_form_7": ("looks", {"forms": small([7, 1, 2, 3, 4, 5])}),
        "looks_form_negative": ("looks", {"forms": numbers([-1, 1, 2, 3, 4, 5])}),
        "looks_sizes": ("sizes", {"sizes": small([1, 0, 1, 2, 1, 1, 0, 0, 1, 1, 2, 0], 2)}),
        "looks_sizes_negative": ("sizes", {"sizes": numbers([3, -1, 1, 2, 1, 1, 0, 0, 1, 1, 2, 0], 2)}),
        "looks_sizes_of_three": ("looks", {"sizes": small([2, 0, 1, 2, 1, 1, 0, 0, 1, 1, 2, 0], 3)}),
        "looks_second_part_of_nodes": ("looks", {"sizes": small([1, 1, 1, 2, 1, 1, 0, 0, 1, 1, 2, 0], 2)}),
        "looks_agents_without_nodes": ("looks", {"sizes": small([2, 0, 1, 2, 2, 0, 0, 0, 1, 1, 2, 0], 2)}),
        "looks_other_data_with_ids": ("looks", {"sizes": small([2, 0, 1, 2, 1, 1, 1, 0, 1, 1, 1, 0], 2)}),
        "looks_others_missing": ("looks", {"others": [{"volts": 2.5}]}),
        "looks_others_superfluous": ("looks", {"others": [{}, [(1, (1.0, 2.0, 3.0))], 0]}),
        "looks_others_tuple": ("looks", {"others": ({}, [(1, (1.0, 2.0, 3.0))])}),
        "looks_positions": ("looks", {"others": [{}, []]}),
        "looks_positions_tuple": ("looks", {"others": [{}, ((1, (1.0, 2.0, 3.0)),)]}),
        "looks_seen": ("looks", {"seen": small([2, 4, 6])}),
        "looks_seen_beyond": ("looks", {"ids": numbers([7, -2, 7, 20, 10, 4, 9, 4, 9, 2, 0])}),
        "looks_seen_negative": ("looks", {"ids": numbers([7, -2, 7, 20, 10, 4, 9, 4, 9, -1, 0])}),
        "fields_of_5_looks": ("fields", {"fields": small([0, 0, 1, 0, 2])}),
        "fields_list": ("fields", {"fields": [0, 0, 1, 0, 2, 3]}),
        "fields_signed": ("fields", {"fields": numbers([0, 0, 1, 0, 2, 3])}),
        "fields_number_beyond": ("fields", {"fields": small([0, 0, 1, 0, 2, 4])}),
        "fields_first_negative": ("fields", {"first_field": -1}),
        "fields_first_boolean": ("fields", {"first_field": True}),
        "fields_new_tuple": ("fields", {"new_fields": ((7, 10.0, b""),) * 3}),
    }
    for name, field in {
        "list": [7, 10.0, b""],
        "of_two": (7, 10.0),
        "of_four": (7, 10.0, b"", 1),
        "at_a_boolean": (True, 10.0, b""),
        "radius_boolean": (7, True, b""),
        "at_a_text": ("7", 10.0, b""),
        "at_three_numbers": ((1.0, 2.0, 3.0), 10.0, b""),
        "at_integers": ((1, 2), 10.0, b""),
        "at_infinity": ((1.0, float("inf")), 10.0, b""),
        "at_no_node": (8, 10.0, b""),
        "radius_integer": (7, 10, b""),
        "radius_negative": (7, -1.0, b""),
        "radius_infinite": (7, float("inf"), b""),
        "radius_nan": (7, float("nan"), b""),
        "bits_text": (7, 10.0, "@"),
        "bits_too_many": (7, 10.0, b"\x40\x40"),
        "bits_of_no_node": ((50.0, 50.0), 1.0, b"\0"),
    }.items():
        bad[f"field_{name}"] = ("fields", {"new_fields": [(7, 10.0, b""), field, field]})
    for key in sorted(LOOKS.keys() - {"seen"} | FIELDS.keys() - {"fields"}):
        without = {name: value for name, value in (LOOKS | FIELDS).items() if name != key}
        limit = "fields" if key in FIELDS else "looks"
        yield f"refused_looks_without_{key}", sensed([(SENSED, without)]), refused(limit, None)
    yield "refused_looks_list", sensed([(SENSED, [])]), refused("looks", None)
    for name, (limit, changes) in bad.items():
        yield f"refused_{name}", sensed([(SENSED, LOOKS | FIELDS | changes)]), refused(limit, None)


# Agents 0 and 4 look around: 0 sees those of some teams at any distance, and 4 all within 10.0. Agent 4 also reports
# agent 3, which is at no node of the map, by a sensor with a field.
DISCS: dict[str, object] = {
    "agents": small([0, 4]),
    "counts": small([1, 2]),
    "sensors": [("all", "AGENT"), ("eyes", "AGENT_RANGE"), ("late", "AGENT_RANGE")],
    "which": small([0, 1, 2]),
    "forms": small([6, 6, 5]),
    "sizes": small([0, 0, 0, 0, 1, 0], 2),
    "ids": small([3]),
    "others": [],
    "seen": small([4, 0, 2, 3]),
    "seen_at": numbers([9, 7, -2, 50]),
    "radii": floats([float("inf"), 10.0, 0.0]),
    "shown": flags([1, 1, 0, 0, 1, 1, 1, 0, 0, 0, 0, 0], 3, 4),
    "fields": small([0, 0, 1]),
    "first_field": 0,
    "new_fields": [(9, 0.0, b"")],
}


def _make_discs() -> Iterator[Vector]:
    """Yield recordings with looks at all agents within a radius, and those that readers refuse."""
    around_0 = (0, "all", "AGENT", 2, [4], [9], None, None)
    around_4 = (4, "eyes", "AGENT_RANGE", 2, [2], [-2], None)
    late = (4, "late", "AGENT_RANGE", 2, [3], [50], None, [9])
    yield "looks_in_discs", sensed([(SENSED, DISCS)]), {"looks": [[around_0, (*around_4, [-2, 9]), late]]}
    moved = (NEW_MAP, {"world": saved(xy=floats([100.0, 0.0, 300.0, 0.0, 0.0, 0.0], 2))})
    answer = [around_0, (*around_4, [9]), late]
    yield "looks_in_discs_after_a_new_map", sensed([moved, (SENSED, DISCS)]), {"looks": [answer]}
    on_the_circle = DISCS | {
        "radii": floats([0.5, 10.0, 0.0]),
        "agents": small([2, 4]),
        "shown": flags([1] * 3 + [0] + [0] * 8, 3, 4),
    }
    at_half = [(2, "all", "AGENT", 2, [4], [9], None, [-2, 9]), (*around_4[:4], [], [], None, [-2, 9]), late]
    yield "looks_in_discs_to_the_circle", sensed([(SENSED, on_the_circle)]), {"looks": [at_half]}
    of_other_bytes = DISCS | {"shown": flags([2, 1, 0, 0, 255, 1, 1, 0, 0, 0, 0, 0], 3, 4)}
    same = {"looks": [[around_0, (*around_4, [-2, 9]), late]]}
    yield "looks_in_discs_shown_by_other_bytes", sensed([(SENSED, of_other_bytes)]), same
    for name in ("radii", "shown", "seen", "seen_at"):
        without = {key: value for key, value in DISCS.items() if key != name}
        yield f"refused_looks_in_discs_without_{name}", sensed([(SENSED, without)]), refused("looks", None)
    yield "refused_looks_in_discs_without_a_map", sensed([(SENSED, DISCS)], world=None), refused("looks", None)
    zeros = [0] * 12
    bad: dict[str, tuple[str, dict[str, object]]] = {
        "ids": ("looks", {"sizes": small([0, 0, 1, 0, 0, 0], 2)}),
        "second_part": ("looks", {"sizes": small([0, 0, 0, 1, 0, 0], 2)}),
        "field": ("fields", {"fields": small([0, 1, 1])}),
        "radii_list": ("looks", {"radii": [1.0, 10.0, 0.0]}),
        "radii_integers": ("looks", {"radii": numbers([1, 10, 0])}),
        "radii_of_two": ("looks", {"radii": floats([1.0, 10.0])}),
        "radius_negative": ("looks", {"radii": floats([1.0, -10.0, 0.0])}),
        "radius_nan": ("looks", {"radii": floats([1.0, float("nan"), 0.0])}),
        "radius_unused_negative": ("looks", {"radii": floats([1.0, 10.0, -1.0])}),
        "sensor_beyond": ("looks", {"which": small([0, 3, 2])}),
        "shown_bytes": ("looks", {"shown": extension(8, "uint8", msgpack.Ext(5, bytes(zeros)), 3, 4)}),
        "shown_of_two_sensors": ("looks", {"shown": flags([0] * 8, 2, 4)}),
        "shown_of_three_agents": ("looks", {"shown": flags([0] * 9, 3, 3)}),
        "shown_in_a_row": ("looks", {"shown": flags(zeros, 12)}),
        "shown_at_no_node": ("looks", {"shown": flags([1] * 12, 3, 4)}),
        "around_no_node": ("looks", {"agents": small([3, 4])}),
        "around_no_listed_agent": ("looks", {"agents": small([1, 4])}),
        "agent_twice": ("looks", {"seen": small([4, 0, 2, 4])}),
        "seen_without_nodes": ("looks", {"seen_at": small([9, 7, 7])}),
    }
    for name, (limit, changes) in bad.items():
        yield f"refused_looks_in_discs_{name}", sensed([(SENSED, DISCS | changes)]), refused(limit, None)
    listed = 1 << 11
    many = DISCS | {
        "agents": numbers([0]),
        "counts": numbers([listed + 1]),
        "which": small([0] * (listed + 1)),
        "forms": small([6] * (listed + 1)),
        "sizes": small([0] * 2 * (listed + 1), 2),
        "seen": numbers(range(listed), 0, "uint16"),
        "seen_at": small([7] * listed),
        "shown": flags([0] * 3 * listed, 3, listed),
        "ids": small([]),
    }
    many = {key: value for key, value in many.items() if key not in FIELDS}
    turn = [(SENSED, many)] * 4
    yield "refused_looks_in_discs_many", sensed(turn), refused("looks", None)


if __name__ == "__main__":
    main()
