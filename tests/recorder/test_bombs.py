"""Files that promise more than they hold, or hold far more than they weigh: refused before memory is taken for it."""

import random
import tracemalloc
import zlib
from contextlib import suppress

import cbor2
import numpy as np
import pytest
from fuzzing import _block as sealed
from hostile import alike
from recordings import HEADER, opened, read_all, walk, written

from gamms import limits
from gamms.errors import BadFile
from gamms.ir import packed_bytes, packing
from gamms.recorder import RecordingError
from gamms.recorder.formats import blocks
from gamms.recorder.formats.version2 import BadCbor, CborReader

LIMIT = 200 << 20  # bytes of memory


def promised(size, stream):
    """A packed stream that says another size."""
    return packed_bytes.encode_varint(size) + stream


def zeros(size):
    """A packed stream of zeros: the packed bytes of 2**20 of them, again and again."""
    deflate = zlib.compressobj(9, zlib.DEFLATED, -15)
    part = deflate.compress(bytes(1 << 20)) + deflate.flush(zlib.Z_FULL_FLUSH)
    return part * (size >> 20) + deflate.flush()


def file_of(*parts, header=None):
    """A file with correct checksums: a header, and blocks of type, body and counts."""
    body = packing.pack(HEADER, "header") if header is None else header
    data = blocks.MAGIC + sealed(blocks.HEADER, body, 0, [0, 0, 0, 0])
    return data + b"".join(sealed(type, body_, zlib.crc32(body), counts) for type, body_, counts in parts)


def turns_of(counts, *table, data=b""):
    return blocks.TURNS, packed_bytes.pack_bytes(data) + packed_bytes.pack_bytes(b"".join(table)), counts


def number(one):
    return packed_bytes.encode_column(np.array([one]))


BOMBS = {
    "a header that promises much": lambda: file_of(header=promised(2**62, zeros(0))),
    "a header that inflates to much": lambda: file_of(header=promised(2**25, zeros(2**28))),
    "a header that promises little": lambda: file_of(header=promised(2**20, zeros(2**28))),
    "a header of lists": lambda: file_of(header=packed_bytes.pack_bytes(b"\x91" * 2**20)),
    "a header of empty lists": lambda: file_of(
        header=packed_bytes.pack_bytes(b"\x91\xc9\x00\x60\x00\x05\x01\xdd\x00\x20\0\0" + b"\xd4\x01\x90" * 2**21)
    ),
    "a header of many items": lambda: file_of(
        header=packed_bytes.pack_bytes(b"\x91\xc9\x00\x60\x00\x05\x01\xdd\x00\x60\0\0" + b"\xc0" * (3 * 2**21))
    ),
    "a header that is many values": lambda: file_of(
        header=packed_bytes.pack_bytes(b"\xdd\x00\x60\0\0" + b"\xc0" * (3 * 2**21))
    ),
    "more moves than can be": lambda: file_of(turns_of([0, 1, 2**32 - 1, 0])),
    "more turns than can be": lambda: file_of(turns_of([0, 2**32 - 1, 0, 0])),
    "moves that are not there": lambda: file_of(turns_of([0, 1, 2**22, 0], b"\1\2\0")),
    "moves that inflate to more": lambda: file_of(
        (blocks.TURNS, packed_bytes.pack_bytes(b"") + promised(2**24, zeros(2**28)), [0, 1, 2**22, 0])
    ),
    "values that inflate to more": lambda: file_of((blocks.TURNS, promised(2**24, zeros(2**28)), [0, 1, 0, 1])),
    "events that promise much": lambda: file_of(
        turns_of([0, 1, 0, 1], number(0), number(1), b"\0" * 3, number(0), number(1), number(2**60))
    ),
    "a keyframe that promises much": lambda: file_of((blocks.KEYFRAME, promised(2**40, zeros(0)), [0, 0, 0, 0])),
}


@pytest.mark.parametrize("bomb", BOMBS.values(), ids=BOMBS.keys())
def test_a_bomb_is_refused_without_much_memory(bomb):
    data = bomb()
    tracemalloc.start()
    try:
        with suppress(RecordingError):
            reader, _ = read_all(data)
            assert reader.turns == 0  # the block was not taken for one
        assert tracemalloc.get_traced_memory()[1] < LIMIT
    finally:
        tracemalloc.stop()


def test_a_regular_recording_that_looks_like_a_bomb_is_read_again(monkeypatch):
    monkeypatch.setattr(limits, "_FLOOR", 1 << 23)
    header = {"a": bytes(2**22), "b": np.zeros(2**19)}
    data = written([[1, 2, (3, bytes(2**22))]], header)
    reader = opened(data)
    assert reader.header["a"] == header["a"]
    assert reader.log(0)[2] == (3, bytes(2**22))


def test_a_million_moves_in_a_turn_are_read_again():
    log = np.stack((np.arange(10**6)[::-1], np.zeros(10**6, np.int64)), axis=1).reshape(-1).tolist()
    assert opened(written([log])).log(0) == log


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not a recording"),
        (b"PK\3\4", "not a recording: at byte 0"),
        (b"MMGR\0\0\0\2\xa3", "format version 2 at byte 4"),
        (b"MMGR\0\0\0\4", "format version 4 at byte 4"),
        (b"MMGR\0\0\0\3", "damaged at byte 8"),
        (written(walk(2, 2))[:30], "damaged at byte 8"),
    ],
    ids=["empty", "foreign", "older", "newer", "only a magic", "cut header"],
)
def test_an_invalid_recording_is_refused_with_a_reason(data, words):
    with pytest.raises(RecordingError, match=words):
        opened(data)


# -- keys that were made to have one hash ---------------------------------------------------------------------------


def test_keys_that_were_made_to_have_one_hash_are_refused():
    few, many = (dict.fromkeys(((key, 1) for key in alike(count)), 1) for count in (9, 5_000))
    assert packing.from_bytes(packing.to_bytes(few, "It")) == few
    with pytest.raises(BadFile, match="made to have one hash"):
        packing.from_bytes(packing.to_bytes(many, "It"))
    with pytest.raises(BadCbor, match="made to have one hash"):
        CborReader(cbor2.dumps(many)).read_item()


@pytest.mark.parametrize("count", [500, 5_000])
def test_any_number_of_keys_that_happen_to_be_tuples_is_read(count):
    rng = random.Random(2)
    value = {(rng.randrange(count), rng.random(), "street"): number for number in range(count)}
    value |= {1 << 70: {(1, 2), (3, 4)}, "many": set(alike(10))}
    assert packing.from_bytes(packing.to_bytes(value, "It")) == value
