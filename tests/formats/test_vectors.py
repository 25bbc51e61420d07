"""GAMMS and a second reader, which follows the format pages, agree on small files, whole and damaged."""

import json
import random
import re
import struct
import zlib
from fnmatch import filter as filter_names
from fnmatch import fnmatch
from pathlib import Path

import answers
import second_reader
from msgspec import msgpack

HERE = Path(__file__).parent
VECTORS = HERE / "vectors"
DOCS = HERE.parent.parent / "docs"
FILES = sorted(path for path in VECTORS.iterdir() if path.suffix != ".json")
SMALL = [path for path in FILES if path.stat().st_size < 3000 and "memory" not in path.name]
HOLDING_VALUES = [
    path
    for path in SMALL
    if path.stem.startswith(("value_", "array_", "looks_")) or path.suffix in (".gamms", ".sight")
]
DAMAGED_COPIES = 1500
CHANGED_FIELDS = 1000


def read_answer(path):
    return path.with_name(f"{path.name}.json").read_text(encoding="utf-8")


def test_both_readers_answer_each_vector_as_stated():
    for path in FILES:
        data = path.read_bytes()
        stated = read_answer(path)
        assert answers.as_text(answers.ask_second(path.suffix, data)) == stated, path.name
        found, message = answers.ask_gamms(path.suffix, data)
        if "refused" in found:
            found["refused"] = limit = json.loads(stated).get("refused", "nothing")
            assert re.search(answers.MESSAGES.get(limit, "^$"), message), f"{path.name}: {message}"
        assert answers.as_text(found) == stated, path.name


def test_both_readers_agree_on_damaged_copies():
    chance = random.Random(0)
    for number in range(DAMAGED_COPIES):
        path = chance.choice(SMALL)
        data = damage(chance, path.suffix, path.read_bytes())
        first, message = answers.ask_gamms(path.suffix, data)
        second = answers.ask_second(path.suffix, data)
        if "refused" in first and "refused" in second:
            first["refused"] = second["refused"]
        assert first == second, f"copy {number}, of {path.name}: {message}"


def damage(chance, suffix, data):
    """Return a damaged copy, half of the time with right checksums around the damage."""
    if chance.random() < 0.5:
        return change(chance, data)
    if suffix != ".ggr":
        return data[:12] + frame(repack(chance, data[20:]))
    blocks = list_blocks(data)
    spoiled = chance.choice(blocks or [None])
    bodies = [repack(chance, one.body) if one is spoiled else one.body for one in blocks]
    return data[:8] + join_blocks(data, blocks, bodies)


def join_blocks(data, blocks, bodies):
    """Return the bytes of blocks of a file with other bodies."""
    copy = b""
    key = 0
    for block, body in zip(blocks, bodies, strict=True):
        front = data[block.at : block.at + 4] + struct.pack("<7I", len(body), zlib.crc32(body), key, *block[4:8])
        copy += front + struct.pack("<I", zlib.crc32(front)) + body
        key = key or zlib.crc32(body)
    return copy


def list_blocks(data):
    """Return the blocks of a recording up to the first damage."""
    blocks = []
    at = 8
    key = 0
    while block := second_reader.find_block(data, at, key):
        blocks.append(block)
        key = blocks[0].crc
        at += 36 + block.size
    return blocks


def frame(body):
    return struct.pack("<2I", len(body), zlib.crc32(body)) + body


def repack(chance, body):
    """Return packed bytes of which the content of one is changed, followed by what follows them."""
    parts = []
    cursor = second_reader.Cursor(body)
    try:
        while cursor.tell() < len(body):
            parts.append(cursor.packed(1 << 20))
    except second_reader.Refused:
        return change(chance, body)
    spoiled = chance.randrange(len(parts) or 1)
    return b"".join(pack(change(chance, part) if at == spoiled else part) for at, part in enumerate(parts))


def pack(content):
    deflater = zlib.compressobj(1, zlib.DEFLATED, -15)
    size = len(content)
    varint = bytes([size & 127 | 128, size >> 7 & 127 | 128, size >> 14])
    return varint + deflater.compress(content) + deflater.flush()


def change(chance, data):
    """Return bytes of which one is changed, some are lost, or the end is cut off."""
    at = chance.randrange(len(data) or 1)
    old = data[at : at + 1]
    kind = chance.choice(["cut", "lost", "replaced", "flipped"])
    if kind == "cut" or not data:
        return data[:at]
    if kind == "lost":
        return data[:at] + data[at + chance.randrange(1, 9) :]
    new = chance.randrange(256) if kind == "replaced" else old[0] ^ 1 << chance.randrange(8)
    return data[:at] + bytes([new]) + data[at + 1 :]


def test_both_readers_agree_on_changed_fields():
    chance = random.Random(0)
    files = [path for path in HOLDING_VALUES if not path.stem.startswith("refused_")]
    for number in range(CHANGED_FIELDS):
        path = chance.choice(files)
        data = change_file(chance, path.suffix, path.read_bytes())
        first, message = answers.ask_gamms(path.suffix, data)
        second = answers.ask_second(path.suffix, data)
        if "refused" in first and "refused" in second:
            first["refused"] = second["refused"]
        assert first == second, f"copy {number}, of {path.name}: {message}"


SAMPLES = [None, True, 0, -1, 1 << 62, (1 << 64) - 1, 1.5, float("nan"), "", "int64", msgpack.Ext(5, b"\1")]
SAMPLES += [msgpack.Ext(6, bytes(9)), *(msgpack.Ext(code, b"\x90") for code in (0, 1, 2, 3))]
SAMPLES += [
    msgpack.Ext(8, msgpack.encode([dtype, msgpack.Ext(5, bytes(8)), *shape]))
    for dtype, *shape in (["int64", 1], ["float64", 1, 1], ["uint8", 8], ["int64"])
]


def change_file(chance, suffix, data):
    """Return a copy of a file with another field, in its dict, in its header, or in its only event."""
    if suffix != ".ggr":
        return data[:12] + frame(pack(change_field(chance, second_reader.Cursor(data[20:]).packed(1 << 20))))
    blocks = list_blocks(data)
    of_turns = [block for block in blocks if block.events == 1]
    changed = (of_turns or blocks)[0]
    cursor = second_reader.Cursor(changed.body)
    before = cursor.packed(1 << 20)
    after = change_field(chance, before)
    body = pack(after)
    if of_turns:
        columns = cursor.packed(1 << 20)
        body += pack(columns[: -len(write_size(before))] + write_size(after))
    return data[:8] + join_blocks(data, blocks, [body if one is changed else one.body for one in blocks])


def write_size(value):
    """Return the last column of a block with one event: the size of its value."""
    mapped = 2 * len(value)
    width = (mapped.bit_length() + 7) // 8
    return bytes([width]) + mapped.to_bytes(width, "little")


def change_field(chance, content):
    """Return a value in which a container has lost an item, has one twice or another one, or has another type."""
    value = open_item(msgpack.decode(content)[0])
    container = chance.choice([*list_containers(value)])
    place = chance.randrange(1, len(container) + 1)
    kind = chance.choice(["lost", "twice", "replaced", "replaced", "type"])
    if kind == "type" or place == len(container):
        container[0] = chance.choice([*second_reader.FROM_ITEMS])
    elif kind == "lost":
        del container[place]
    else:
        container[place : place + (kind == "replaced")] = [
            chance.choice(SAMPLES if kind == "replaced" else container[1:])
        ]
    return msgpack.encode([close_item(value)])


def open_item(item):
    """Return a container as a list of its type and its items; all else as it is."""
    is_container = isinstance(item, msgpack.Ext) and item.code in second_reader.FROM_ITEMS
    return [item.code, *map(open_item, msgpack.decode(item.data))] if is_container else item


def close_item(item):
    return msgpack.Ext(item[0], msgpack.encode([*map(close_item, item[1:])])) if isinstance(item, list) else item


def list_containers(item):
    if isinstance(item, list):
        yield item
        for part in item[1:]:
            yield from list_containers(part)


def test_the_second_reader_has_400_lines_of_code_and_does_not_import_gamms():
    lines = (HERE / "second_reader.py").read_text(encoding="utf-8").splitlines()
    of_code = [line for line in lines if not re.match(r"\s*(#|\"\"\"|$)", line)]  # no blank, comment or docstring
    assert len(of_code) <= 400
    assert not [line for line in of_code if ";" in line or re.match(r"\s*(import|from) .*gamms", line)]


def test_the_vectors_are_small():
    assert sum(path.stat().st_size for path in FILES) < 380_000


# -- the pages --------------------------------------------------------------------------------------------------


def read_pages():
    """Return the text of the page about each kind of file, by suffix."""
    maps, tables = read_page("save-format.md").split("## Visibility tables")
    return {".ggr": read_page("recording-format.md"), ".gamms": maps, ".sight": tables}


def read_page(name):
    return (DOCS / name).read_text(encoding="utf-8")


def test_the_pages_name_every_vector_and_no_other():
    for suffix, page in read_pages().items():
        stems = [path.stem for path in FILES if path.suffix == suffix]
        patterns = set(re.findall(r"`([a-z0-9_*]+)`", page))
        assert not [stem for stem in stems if not any(fnmatch(stem, pattern) for pattern in patterns)], suffix
        named = {pattern for pattern in patterns if "*" in pattern or pattern.startswith(("refused_", "game_"))}
        rows = re.findall(r"\| `(?:refused|value|array|column|no_turns|game).*", page)
        named |= {name for row in rows for name in re.findall(r"`([a-z0-9_*]+)`", row)}
        assert not [pattern for pattern in named if not filter_names(stems, pattern)], suffix


def test_vectors_have_every_key_and_every_kind_of_event_of_the_page():
    answers_of_games = [json.loads(read_answer(path)) for path in FILES if path.stem.startswith(("game_", "rare_"))]
    found = {key for answer in answers_of_games for key in list_keys(answer)}
    _, section = read_page("recording-format.md").split("## Header and keyframes")
    section, _ = section.split("## Recordings that were not finished")
    keys = set(re.findall(r"`([a-z_0-9]+)`", section)) - {"number", "w", "x", "y", "z"}  # the last: of tuples
    assert not keys - found
    turns = [entry["tuple"] for answer in answers_of_games for turn in answer["turns"] for entry in turn]
    turns += [[FLIGHT], [TURN_IN_SPACE]]  # vectors of their own
    kinds = {pair[0] for pair in turns}
    assert not [f"{kind:08X}" for kind in list_kinds(section) if kind not in kinds]


FLIGHT = 0x01100020
TURN_IN_SPACE = 0x01100021


def list_keys(part):
    """Yield the keys of all dicts in an answer."""
    if isinstance(part, list):
        for item in part:
            yield from list_keys(item)
    elif isinstance(part, dict):
        for name, item in part.items():
            if name == "dict":
                yield from (key for key, _ in item if isinstance(key, str))
            yield from list_keys(item)


def list_kinds(section):
    """Yield the kinds of events of the table."""
    for row in re.findall(r"^\| ([0-9A-F]{8}[^|]*) \|", section, re.MULTILINE):
        first, *others = (int(digits, 16) for digits in re.findall("[0-9A-F]{8}", row))
        if " to " in row:
            yield from range(first, others[0] + 1)
        else:
            yield from (first, *others)


def test_vectors_have_every_key_of_a_saved_map():
    stems = {path.stem for path in FILES if path.suffix == ".gamms"}
    _, section = read_page("save-format.md").split("## The dict")
    section, _ = section.split("## Limits")
    columns = re.findall(r"^\| (`[^|]*) \|(.*)", section, re.MULTILINE)
    optional = {key for names, rest in columns if rest.endswith("optional |") for key in re.findall("`(.*?)`", names)}
    keys = {key for names, _ in columns for key in re.findall("`(.*?)`", names)}
    assert optional == {"scenery", "closed", "base_map"} & stems
    assert not [key for key in keys - optional if f"refused_without_{key}" not in stems]
