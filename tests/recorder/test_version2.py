"""The recordings of gamms 1.0.0: read whole, written to the byte, and opened without fear."""

import io
import random
import struct
import tracemalloc
from pathlib import Path

import cbor2
import numpy as np
import pytest
from gamms.typing.opcodes import OpCodes
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadType, BadValue
from gamms.recorder.compat import Version2Writer
from gamms.recorder.errors import RecordingError
from gamms.recorder.formats import version2
from gamms.recorder.formats.version2 import Tagged

SAMPLES = {path.stem: path.read_bytes() for path in sorted((Path(__file__).parent / "samples/version2").glob("*.ggr"))}
MUTANTS = 2_000
ENDED = "Recording ended unexpectedly."
HEADER = b"MMGR\0\0\0\2"
MOVE = {"timestamp": 1, "opCode": OpCodes.AGENT_PREV_NODE.value, "data": {"agent_name": "a", "node_id": 5}}
END = {"timestamp": 2, "opCode": 0}
CREATE = OpCodes.AGENT_CREATE.value


def file_of(*records):
    return HEADER + b"".join(one if isinstance(one, bytes) else cbor2.dumps(one) for one in records)


def written(records):
    stream = io.BytesIO()
    writer = Version2Writer(stream)
    for record in records:
        writer.write(record["timestamp"], record["opCode"], record.get("data"))
    return stream.getvalue()


def read(data):
    return list(version2.read(io.BytesIO(data)))


def read_until_it_ends(data):
    """The records before the first error, and the error."""
    found = []
    try:
        for record in version2.read(io.BytesIO(data)):
            found.append(record)  # noqa: PERF402 - it may raise
    except RecordingError as error:
        return found, error
    return found, None


def creating(value):
    """A record with encoded data of the author's choice in it."""
    front = cbor2.dumps({"timestamp": 2**40, "opCode": CREATE, "data": {"name": "a", "kwargs": 0}})
    return front[:-1] + value


# -- exact --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SAMPLES)
def test_every_sample_is_written_again_to_the_byte(name):
    records, error = read_until_it_ends(SAMPLES[name])
    assert (error is None) == (name != "unfinished")
    assert written(records) == SAMPLES[name]


@pytest.mark.parametrize("name", sorted(set(SAMPLES) - {"unfinished", "tags"}))
def test_every_sample_reads_as_1_0_0_reads_it(name):
    stream, expected = io.BytesIO(SAMPLES[name][8:]), []
    while not expected or expected[-1]["opCode"]:
        expected.append(cbor2.load(stream))
    assert read(SAMPLES[name]) == expected


def test_a_record_has_three_parts_and_the_last_one_two():
    records = read(SAMPLES["basic"])
    assert {tuple(record) for record in records[:-1]} == {("timestamp", "opCode", "data")}
    assert tuple(records[-1]) == ("timestamp", "opCode")


def test_the_samples_hold_every_operation():
    found = {record["opCode"] for data in SAMPLES.values() for record in read_until_it_ends(data)[0]}
    assert found == {code.value for code in OpCodes}


scalars = st.none() | st.booleans() | st.integers(-(2**100), 2**100) | st.floats(allow_nan=False) | st.text()
keys = st.text() | st.integers(-(2**64), 2**64 - 1)
plain = st.recursive(
    scalars | st.binary(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4),
    max_leaves=20,
)


@given(st.lists(st.tuples(st.integers(0, 2**64 - 1), plain), max_size=5), st.sampled_from([1, 7, 1 << 16]))
def test_written_values_are_read_and_written_again_alike(values, block):
    records = [
        {"timestamp": time, "opCode": CREATE, "data": {"name": "a", "kwargs": {"meta": value}}}
        for time, value in values
    ]
    data = written([*records, END])
    found = list(version2.read(Trickle(data, block)))
    assert found == [*records, END]
    assert written(found) == data


@given(plain)
def test_plain_data_is_read_as_cbor2_reads_it(value):
    assert read(file_of({**MOVE, "data": {"agent_name": 1, "node_id": value}}, END))[0]["data"]["node_id"] == value


@given(st.floats(allow_nan=True, width=16), st.sampled_from("efd"))
def test_floats_of_every_width_are_read(value, width):
    head = {"e": b"\xf9", "f": b"\xfa", "d": b"\xfb"}[width]
    found = version2.CborReader(head + struct.pack(">" + width, value)).read_item()
    assert struct.pack(">d", found) == struct.pack(">d", value) or found != found


class Trickle(io.BytesIO):
    """A stream that gives a few bytes at a time."""

    def __init__(self, data, block):
        super().__init__(data)
        self._block = block

    def read(self, size=-1):
        return super().read(min(size, self._block))


# -- older, newer, cut off ----------------------------------------------------------------------------------------


def test_version_one_is_read_like_version_two():
    data = file_of(MOVE, END)
    assert read(data[:7] + b"\1" + data[8:]) == [MOVE, END]


def test_older_versions_are_translated_one_version_at_a_time(monkeypatch):
    assert set(version2.TRANSLATIONS) == set(range(1, version2.VERSION))
    monkeypatch.setitem(version2.TRANSLATIONS, 1, lambda record: {**record, "timestamp": record["timestamp"] + 10})
    data = file_of(MOVE, END)
    assert [one["timestamp"] for one in read(data[:7] + b"\1" + data[8:])] == [11, 12]
    assert [one["timestamp"] for one in read(data)] == [1, 2]


@pytest.mark.parametrize("data", [b"", b"MMG", b"MMGR\0\0\0", b"MMGX\0\0\0\2", b"\x1f\x8b" + bytes(20)])
def test_another_file_is_refused(data):
    with pytest.raises(RecordingError, match="not a recording"):
        read(data)


@pytest.mark.parametrize("version", [0, 3, 2**32 - 1])
def test_other_versions_are_refused(version):
    with pytest.raises(RecordingError, match=f"version {version} "):
        read(b"MMGR" + version.to_bytes(4, "big") + cbor2.dumps(END))


def test_nothing_is_read_before_the_first_record_is_asked_for():
    stream = io.BytesIO(b"nonsense")
    version2.read(stream)
    assert stream.tell() == 0


def test_bytes_after_the_last_record_are_not_read():
    assert read(file_of(MOVE, END, b"\xff\xff nonsense")) == [MOVE, END]


def test_a_text_stream_is_no_recording():
    with pytest.raises(TypeError, match="binary"):
        list(version2.read(io.StringIO("MMGR")))


def test_a_large_file_is_read_in_little_memory():
    data = file_of(*[MOVE] * 10_000, END)
    tracemalloc.start()
    count = sum(1 for _ in version2.read(io.BytesIO(data)))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert count == 10_001
    assert peak < len(data) / 2


# -- without fear -------------------------------------------------------------------------------------------------

DAMAGED = {
    "no map": cbor2.dumps([1, 2]),
    "no record": cbor2.dumps({"a": 1}),
    "no operation": cbor2.dumps({**MOVE, "opCode": 77}),
    "operation of a wrong type": cbor2.dumps({**MOVE, "opCode": "1"}),
    "operation that is a truth": cbor2.dumps({**MOVE, "opCode": True}),
    "time of a wrong type": cbor2.dumps({**MOVE, "timestamp": 1.5}),
    "unhashable operation": cbor2.dumps({**MOVE, "opCode": [1]}),
    "data of a wrong type": cbor2.dumps({**MOVE, "data": [1]}),
    "no data": cbor2.dumps({"timestamp": 1, "opCode": 1}),
    "data without its parts": cbor2.dumps({**MOVE, "data": {"agent_name": "a"}}),
    "a part too many": cbor2.dumps({**MOVE, "extra": 1}),
    "a key twice": creating(b"\xa2\x61a\x01\x61a\x02"),
    "break": b"\xff",
    "reserved": b"\x1c",
    "indefinite list": creating(b"\x9f\x01\xff"),
    "indefinite text": creating(b"\x7f\x61a\xff"),
    "undefined": creating(b"\xf7"),
    "simple value": creating(b"\xf8\xff"),
    "text that is not UTF-8": creating(b"\x61\xff"),
    "huge text": creating(b"\x7b" + b"\x0f" * 8 + b"x"),
    "huge bytes": creating(b"\x5a\x7f\xff\xff\xff" + b"x"),
    "huge list": creating(b"\x9b" + b"\x0f" * 8 + b"\x01"),
    "huge map": creating(b"\xbb" + b"\x0f" * 8 + b"\x01"),
    "list of lists of lists": creating(b"\x81" * 100_000 + b"\x01"),
    "tags of tags of tags": creating(b"\xd9\xd9\xf7" * 100_000 + b"\x01"),
    "maps in keys": creating(b"\xa1\xa0\x01"),
    "tag in keys": creating(b"\xa1\xc1\x01\x01"),
    "number of two thousand bytes": creating(b"\xc2\x59\x08\x00" + b"\xff" * 2048),
    "keys of one hash": creating(cbor2.dumps({i * (2**61 - 1) + 2**70: 1 for i in range(1_500)})),
    "set of one hash": creating(cbor2.dumps({i * (2**61 - 1) + 2**70 for i in range(1_500)})),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_record_is_refused_by_its_offset(name):
    data = file_of(MOVE, DAMAGED[name], END)
    records, error = read_until_it_ends(data)
    assert records == [MOVE]
    assert ENDED in str(error)
    assert f"byte {8 + len(cbor2.dumps(MOVE))} " in str(error)
    assert isinstance(error, ValueError)


def test_a_record_of_too_many_items_takes_little_memory(monkeypatch):
    monkeypatch.setattr(version2, "MOST_ITEMS", 1 << 16)  # to count the memory of a million takes 20 seconds
    data = file_of(creating(b"\x9a\x00\x00\xff\xff" + b"\xa0" * version2.MOST_ITEMS), END)
    tracemalloc.start()
    with pytest.raises(RecordingError, match="items"):
        read(data)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 200 * version2.MOST_ITEMS


@pytest.mark.parametrize(
    "value",
    [
        b"\xc0\x74" + b"2013-03-21T20:04:00Z",  # a date
        b"\xc1\x1a\x51\x4b\x67\xb0",  # a time
        b"\xc4\x82\x1b" + b"\x7f" * 8 + b"\x01",  # a decimal with an enormous exponent
        b"\xc5\x82\x1b" + b"\x7f" * 8 + b"\x01",  # and a binary one
        b"\xd8\x23\x68(a+)+$xx",  # a regular expression
        b"\xd8\x1c\x81\xd8\x1d\x00",  # a list that holds itself
        b"\xd9\x01\x00\x80",  # a string namespace
        b"\xc2\x01",  # a number that is none
        b"\xd9\x01\x02\x01",  # a set that is none
    ],
)
def test_a_tag_stays_closed_and_is_written_again(value):
    data = file_of(creating(b"\xa1\x61m" + value), {**END, "timestamp": 2**41})
    records = read(data)
    assert isinstance(records[0]["data"]["kwargs"]["m"], Tagged)
    assert written(records) == data


def test_large_numbers_and_sets_survive_version_2():
    value = {"big": 2**100, "low": -(2**100), "set": {1, (2, 3), "x"}, "sets": {frozenset({1})}}
    record = {"timestamp": 1, "opCode": CREATE, "data": {"name": "a", "kwargs": value}}
    assert read(written([record, END]))[0] == record


def test_sets_nested_in_many_sets_are_refused_at_once():
    with pytest.raises(RecordingError, match="nested"):
        read(file_of(creating(b"\xa1\x61m" + b"\xd9\x01\x02\x81" * 28 + b"\x01"), END))


@pytest.mark.parametrize("data", ["m", [], 0, False])
def test_a_closing_record_whose_data_are_no_map_is_damaged(data):
    with pytest.raises(RecordingError, match="at byte 8 is damaged: it has parts other than"):
        read(file_of({**END, "data": data}))


def test_a_closing_record_may_have_a_map_or_nothing():
    for more in ({}, {"data": None}, {"data": {}}):
        assert len(read(file_of({**END, **more}))) == 1


def test_a_mutated_recording_ends_in_an_error_or_is_a_valid_prefix(pytestconfig):
    seed = random.SystemRandom().randrange(2**32)
    dice = random.Random(seed)
    for turn in range(MUTANTS):
        data = mutated(dice.choice(list(SAMPLES.values())), dice)
        try:
            records, error = read_until_it_ends(data)
        except Exception as problem:
            raise AssertionError(f"seed {seed}, turn {turn}: {data!r}") from problem
        if error is None:
            assert records[-1]["opCode"] == 0
        assert all(record["opCode"] in version2.FIELDS for record in records)


def mutated(data, dice):
    """Bytes flipped, removed, doubled, cut off or put in, a few of them."""
    data = bytearray(data)
    for _ in range(dice.randint(1, 4)):
        at, size = dice.randrange(len(data)), dice.randint(1, 12)
        kind = dice.randrange(5)
        if kind == 0:
            data[at] ^= 1 << dice.randrange(8)
        elif kind == 1:
            del data[at : at + size]
        elif kind == 2:
            data[at:at] = data[at : at + size]
        elif kind == 3:
            data[at:at] = dice.randbytes(size)
        else:
            data[at:] = data[at : at + dice.randrange(len(data))]
        data = data or bytearray(b"M")
    return bytes(data)


# -- what cannot be written ---------------------------------------------------------------------------------------


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


def in_itself():
    value = []
    value.append(value)
    return value


UNRECORDABLE = {
    "an object": (object(), BadType),
    "a function": (nested, BadType),
    "half a letter": ("\ud800", BadType),
    "an object within": ([1, {"x": {3: object()}}], BadType),
    "nested": (nested(80), BadValue),
    "nested without end": (nested(5000), BadValue),
    "a list in itself": (in_itself(), BadValue),
    "a huge number": (2**10_000, BadValue),
    "too many items": ([0] * (version2.MOST_ITEMS + 1), BadValue),
}


@pytest.mark.parametrize(("value", "error"), UNRECORDABLE.values(), ids=UNRECORDABLE)
def test_values_that_cannot_be_recorded_leave_the_file_unchanged(value, error):
    stream = io.BytesIO()
    writer = Version2Writer(stream)
    writer.write(1, MOVE["opCode"], MOVE["data"])
    before = stream.getvalue()
    with pytest.raises(error, match="AGENT_CREATE cannot be recorded"):
        writer.write(2, CREATE, {"name": "a", "kwargs": {"meta": value}})
    assert stream.getvalue() == before
    writer.write(2, 0)
    assert read(stream.getvalue()) == [MOVE, END]


def test_numpy_values_are_recorded_as_plain_ones():
    value = {"n": np.int64(3), "x": np.float32(0.5), "yes": np.bool_(True), "many": np.arange(3)}
    record = {"timestamp": 1, "opCode": CREATE, "data": {"name": "a", "kwargs": value}}
    assert read(written([record, END]))[0]["data"]["kwargs"] == {"n": 3, "x": 0.5, "yes": True, "many": [0, 1, 2]}


@given(st.sets(st.text(), max_size=8))
def test_a_set_gives_the_same_bytes_whatever_order_python_keeps(values):
    def record_of(one):
        return {"timestamp": 1, "opCode": CREATE, "data": {"name": "a", "kwargs": {"s": one}}}

    again = set()
    for value in sorted(values, reverse=True):
        again.add(value)
    assert written([record_of(values)]) == written([record_of(again)])
