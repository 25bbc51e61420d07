"""Mutated recordings: they may raise `RecordingError`, or give a prefix of what was written, and nothing else.

Half of them are damaged as a disk or an editor would do it; the other half as an enemy would, with correct checksums.
"""

import random
import struct
import zlib
from contextlib import suppress

import numpy as np
from recordings import HEADER, fly, read_all, walk, written

from gamms.ir import packed_bytes, packing
from gamms.recorder import RecordingError
from gamms.recorder.formats import blocks
from gamms.recorder.formats.chunks import FORMS

NUMBERS = [0, 1, 2, 63, 64, 127, 128, 255, 256, 65535, 65536, 2**20, 2**23, 2**24, 2**31 - 1, 2**31, 2**32 - 1]
BYTES = [
    b"\0",
    b"\xff",
    b"\x7f",
    b"\xc1",
    b"\x91",
    b"\xc4\xff",
    b"\xd4\xff\0",
    b"\xdd" + b"\x7f" * 4,
    b"\xc9" + b"\x7f" * 5,
    b"\xc7\x02\x01",
    b"\x91\xd4\x01\x90" * 10,
    b"\x91" * 40,
]
SYNC = blocks.SYNC
MOST = 1 << 30
EVENTS = [
    (1, {"name": "a", "kwargs": {"start_node_id": 3, "meta": (1, 2.5)}}),
    (2, ["x", None, True, 2**70, b"bytes", -1.5]),
    (3, {"array": np.arange(6).reshape(2, 3), ("key", 1): "\ud800"}),
]


def originals():
    """Recordings of several kinds, with what is in them."""
    mixed = [[*log[:6], EVENTS[turn % 3], *log[6:], EVENTS[0]] for turn, log in enumerate(walk(5, 14))]
    flown = [[*log[:2], *flights, *log[2:]] for log, flights in zip(mixed, fly(3, 14), strict=True)]
    games = (walk(3, 9), mixed, [[]], flown)
    found = [written(logs, turns=turns, keyframes=True) for turns in (3, 64) for logs in games]
    found += [written(mixed, {}, turns=4, close=False), written([], HEADER)]
    clock = iter(range(1000))
    found.append(written(mixed, turns=20, seconds=1, clock=lambda: next(clock), close=False))
    return [(data, text_of(read_all(data)[1])) for data in found]


def text_of(logs):
    """Logs as bytes that can be compared, whatever is in them."""
    return [packing.to_bytes(log, "A log") for log in logs]


def fuzz(seed, count):
    """Read so many mutated recordings; the same seed gives the same ones."""
    sources = originals()
    for number in range(count):
        check(f"{seed}/{number}", sources)


def check(name, sources):
    chance = random.Random(name)
    data, logs = chance.choice(sources)
    is_hostile = chance.random() < 0.5
    mutant = hostile(chance, data) if is_hostile else damaged(chance, data)
    try:
        found = text_of(read_all(mutant)[1])
    except RecordingError as error:
        is_fine = "byte " in str(error)
    except Exception as error:
        raise AssertionError(f"Mutant {name!r} raises {type(error).__name__}: {error}") from error
    else:
        is_fine = is_hostile or found == logs[: len(found)]
    assert is_fine, f"Mutant {name!r} is no prefix, or does not say where it is damaged"


# -- as a disk would do it --------------------------------------------------------------------------------------


def damaged(chance, data):
    data = bytearray(data)
    for _ in range(chance.choice([1, 1, 1, 2, 5])):
        chance.choice([_flip, _overwrite, _remove, _insert, _repeat, _cut, _move])(chance, data)
    return bytes(data)


def _range(chance, data):
    at = chance.randrange(len(data) + 1)
    return at, min(len(data), at + chance.choice([1, 2, 4, 8, 30, 200]))


def _flip(chance, data):
    if data:
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def _overwrite(chance, data):
    at, end = _range(chance, data)
    data[at:end] = (chance.choice(BYTES) * 200)[: end - at]


def _remove(chance, data):
    at, end = _range(chance, data)
    del data[at:end]


def _insert(chance, data):
    at = chance.randrange(len(data) + 1)
    data[at:at] = chance.choice([*BYTES, SYNC, blocks.MAGIC, chance.randbytes(chance.randrange(1, 50))])


def _repeat(chance, data):
    at, end = _range(chance, data)
    data[end:end] = data[at:end]


def _cut(chance, data):
    del data[chance.randrange(len(data) + 1) :]


def _move(chance, data):
    at, end = _range(chance, data)
    piece = data[at:end]
    del data[at:end]
    at = chance.randrange(len(data) + 1)
    data[at:at] = piece


# -- as an enemy would ------------------------------------------------------------------------------------------


def hostile(chance, data):
    """Change blocks where it hurts, and make all checksums right again."""
    parts = parts_of(data)
    for _ in range(chance.choice([1, 1, 2, 4])):
        with suppress(
            ValueError, TypeError, AttributeError, KeyError
        ):  # what was broken before cannot be changed again
            chance.choice(_HOSTILE)(chance, parts)
    return rebuilt(chance, parts)


def parts_of(data):
    """The blocks of an honest recording: [type, body, counts]."""
    at, parts = len(blocks.MAGIC), []
    while at + blocks.HEAD_SIZE <= len(data):
        head = blocks.decode_head(data[at : at + blocks.HEAD_SIZE])
        parts.append([head.type, data[at + blocks.HEAD_SIZE : at + head.end], list(head[4:8])])
        at += head.end
    return parts


def rebuilt(chance, parts):
    """A file of blocks; what their heads say of the turns before them fits, unless it was changed."""
    key, out, is_mended, turns = zlib.crc32(parts[0][1]), blocks.MAGIC, chance.random() < 0.7, 0
    for number, part in enumerate(parts):
        if is_mended and part[0] == blocks.END:
            part[2] = [turns, 0, 0, 0]
        out += _block(part[0], part[1], key if number else 0, part[2])
        turns += part[2][1]
    return out


def _block(type, body, key, counts):
    front = struct.pack("<3sBIIIIIII", SYNC, type, len(body), zlib.crc32(body), key, *(n % 2**32 for n in counts))
    return front + struct.pack("<I", zlib.crc32(front)) + body


def _change_head(chance, parts):
    part = chance.choice(parts)
    if chance.random() < 0.2:
        part[0] = chance.choice(b"HKTEX\0")
    else:
        part[2][chance.randrange(4)] = chance.choice([*NUMBERS, *part[2]])


def _change_body(chance, parts):
    part = chance.choice(parts)
    part[1] = damaged(chance, part[1])


def _change_value(chance, parts):
    found = [part for part in parts if part[0] != blocks.TURNS and part[1]]
    part = chance.choice(found or parts)
    value, _ = packing.unpack_parts(part[1], MOST)
    part[1] = packed_bytes.pack_bytes(damaged(chance, value))


def _change_column(chance, parts):
    """Put other numbers into a column of turns, or damage the data of its events."""
    part = chance.choice([part for part in parts if part[0] == blocks.TURNS] or parts)
    data, rest = packing.unpack_parts(part[1], MOST, has_columns=True)
    reader = packed_bytes.ByteReader(rest)
    table = _columns_of(reader, part[2])
    table += _tracks_of(reader, table[6])
    column = chance.choice(table)
    if chance.random() < 0.4 or not len(column):
        data = damaged(chance, data)
    else:
        number = chance.choice([-1, 2**40, -(2**63), 2**63 - 1, *NUMBERS, *FORMS])
        column[chance.randrange(len(column))] = number
    part[1] = packed_bytes.pack_bytes(data) + packed_bytes.pack_bytes(b"".join(map(packed_bytes.encode_column, table)))


def _columns_of(reader, counts):
    _, turns, moves, events = counts
    table = [reader.read_column(size) for size in (turns, turns, moves)]
    rows = len(np.unique(np.cumsum(table[2])))
    return table + [reader.read_column(size) for size in (rows, moves - rows, events, events, events)]


def _tracks_of(reader, kinds):
    """The columns of events whose data are numbers."""
    for kind, (nodes, floats) in sorted(FORMS.items()):
        size = int(np.count_nonzero(kinds == kind))
        if size:
            numbers = reader.read_column(size)
            yield numbers
            rows = len(np.unique(np.cumsum(numbers)))
            for _ in range(nodes + floats):
                yield from (reader.read_column(each) for each in (rows, size - rows))


def _shuffle(chance, parts):
    if len(parts) > 1:
        at, to = chance.randrange(1, len(parts)), chance.randrange(1, len(parts))
        part = parts[at]
        if chance.random() < 0.5:
            del parts[at]
        parts.insert(to, [part[0], part[1], list(part[2])])


_HOSTILE = [_change_head, _change_body, _change_value, _change_column, _shuffle]
