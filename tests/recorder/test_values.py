"""Plain values as CBOR: everything comes back as it was, and nothing else is accepted."""

import enum
from typing import NamedTuple

import cbor2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from test_container import plain

from gamms.errors import BadFile, BadType, BadValue
from gamms.limits import Allowance
from gamms.recorder.formats import values

DTYPES = list(values._DTYPES)


def there_and_back(value):
    return values.from_bytes(values.to_bytes(value, "It"))


@given(plain)
def test_a_plain_value_comes_back(value):
    assert repr(there_and_back(value)) == repr(value)


@given(plain)
def test_what_a_value_costs_is_never_more_than_its_bytes_say_at_a_glance(value):
    data = values.to_bytes(value, "It")
    assert 0 < values.cost_of(data) <= values.most_cost_of(data)


@given(
    st.sampled_from(DTYPES).flatmap(lambda name: hnp.arrays(name, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0)))
)
def test_an_array_comes_back_with_its_shape_and_type(array):
    found = there_and_back({"a": [array]})["a"][0]
    assert (found.dtype, found.shape) == (array.dtype, array.shape)
    assert np.array_equal(found, array, equal_nan=array.dtype.kind == "f")
    assert found.flags.writeable


@pytest.mark.parametrize(
    "array", [np.arange(9, dtype=">i4"), np.arange(12).reshape(3, 4).T, np.arange(9)[::2]], ids=str
)
def test_arrays_of_any_layout_come_back(array):
    assert np.array_equal(there_and_back(array), array)


class Kind(enum.IntEnum):
    BASIC = 3


class Pair(NamedTuple):
    a: int
    b: int


class Name(enum.StrEnum):
    RED = "red"


@pytest.mark.parametrize(
    ("value", "found"),
    [
        (np.int64(3), 3),
        (np.float32(0.5), 0.5),
        (np.bool_(1), True),
        (Kind.BASIC, 3),
        (Name.RED, "red"),
        (Pair(1, 2), (1, 2)),
    ],
    ids=str,
)
def test_relatives_of_plain_values_come_back_plain(value, found):
    assert there_and_back(value) == found
    assert type(there_and_back(value)) is type(found)


def test_sets_come_back_and_are_written_in_one_order():
    for value in ({3, "a", (1, frozenset({2}))}, frozenset({None, 2.5}), set(), {"a": [{b"b"}]}):
        assert there_and_back(value) == value
        assert type(there_and_back(value)) is type(value)
    names = [f"name {i}" for i in range(50)]
    other = set(names[25:])
    other.update(names[:25])
    assert values.to_bytes(set(names), "It") == values.to_bytes(other, "It")


@pytest.mark.parametrize("stems", [["agent_"], ["red_", "blue_", ""], ["a b/"], ["ä"], ["x" * 65]])
def test_lists_of_numbered_texts_come_back(stems):
    texts = [f"{stem}{i * i}" for i in range(100) for stem in stems]
    assert there_and_back(texts) == texts
    for odd in ("agent_007", "agent", 7, "agent_" + "1" * 30, "", None):
        assert there_and_back([*texts, odd]) == [*texts, odd]
    assert len(values.to_bytes([f"agent_{i}" for i in range(5000)], "It")) < 50_000


def test_damaged_lists_of_numbered_texts_are_refused():
    data = values.to_bytes([f"agent_{i}" for i in range(40)], "It")
    assert b"agent_" in data
    for place in range(len(data)):
        for bits in (1, 128):
            broken = bytearray(data)
            broken[place] ^= bits
            try:
                found = values.from_bytes(bytes(broken))
            except BadFile:
                continue
            assert values.from_bytes(values.to_bytes(found, "It")) is not None


def test_extreme_numbers_come_back():
    for value in (2**64 - 1, -(2**64), 2**64, -(2**64) - 1, 10**5000, -0.0, float("inf"), 5e-324):
        assert repr(there_and_back(value) == value) == "True"
    assert np.isnan(there_and_back(float("nan")))


def nested(depth, kind=list):
    value = kind()
    for _ in range(depth - 1):
        value = kind([value])
    return value


def test_thirty_two_containers_in_each_other_are_enough():
    assert there_and_back(nested(32)) == nested(32)
    assert there_and_back(nested(32, tuple)) == nested(32, tuple)
    loop = []
    loop.append(loop)
    for value in (nested(33), nested(33, tuple), [[nested(31)]], loop, [[[nested(30)], np.zeros(1)], nested(40)]):
        with pytest.raises(BadValue, match="more than 32 containers"):
            values.to_bytes(value, "It")


@pytest.mark.parametrize("value", [{1j}, 1j, Kind, np.array(["a"]), np.array([None]), bytearray(b"a"), len], ids=str)
def test_what_is_not_plain_is_refused_by_its_name(value):
    with pytest.raises(BadType, match=r"It cannot be recorded: .*convert it first"):
        values.to_bytes({"a": [value]}, "It")


BAD = {
    "nothing": b"",
    "two values": b"\x01\x01",
    "cut off": b"\x82\x01",
    "cut off inside": b"\x1b\x00",
    "long text": b"\x7b" + b"\xff" * 8,
    "long bytes": b"\x5b\x7f" + b"\xff" * 7,
    "long list": b"\x9b\x7f" + b"\xff" * 7,
    "long map": b"\xbb\x80" + b"\0" * 7,
    "without an end": b"\x9f\x01\xff",
    "text without an end": b"\x7f\x61a\xff",
    "deep": b"\x81" * 33 + b"\x01",
    "very deep": b"\x81" * 10**6 + b"\x01",
    "reserved": b"\x1c",
    "undefined": b"\xf7",
    "simple": b"\xe4",
    "long simple": b"\xf8\xff",
    "break": b"\xff",
    "no text": b"\x61\xff",
    "a date": cbor2.dumps(cbor2.CBORTag(0, "2013-03-21T20:04:00Z")),
    "a pattern": cbor2.dumps(cbor2.CBORTag(35, "(a+)+$")),
    "big": cbor2.dumps(2**70),
    "a loop": b"\xd8\x1c\x81\xd8\x1d\x00",
    "a set": cbor2.dumps({1, 2}),
    "a key that is a map": b"\xa1\xa0\x01",
    "a key with a map": b"\xa1\x81\xa0\x01",
    "a lone mark": b"\xe0",
    "a mark inside": b"\x82\x01\xe0",
    "a mark as a key": b"\xa1\xe0\x01",
    "an array as a key": b"\xa1\x85\xe1\x65uint8\xf4\x41a\x01\x01",
    "an array without parts": b"\x81\xe1",
    "an array of objects": b"\x85\xe1\x66object\xf4\x48aaaaaaaa\x01",
    "an array with too few bytes": b"\x85\xe1\x65uint8\xf4\x41a\x02",
    "an array with a wide shape": b"\x86\xe1\x65uint8\xf4\x40\x00\x1b\x00\xff" + b"\xff" * 6,
    "an array with a negative shape": b"\x86\xe1\x65uint8\xf4\x41a\x20\x20",
    "an array with ten dimensions": b"\x8e\xe1\x65uint8\xf4\x41a" + b"\x01" * 10,
    "an array with a strange form": b"\x85\xe1\x65uint8\x02\x41a\x01",
    "text as a big number": b"\x82\xe2\x61a",
}


@pytest.mark.parametrize("data", BAD.values(), ids=BAD.keys())
def test_what_nobody_wrote_is_refused(data):
    with pytest.raises(BadFile):
        values.from_bytes(data)


def test_a_value_may_have_any_number_of_items_that_its_size_explains():
    assert values.from_bytes(b"\x9a\x00\x10\x00\x00" + b"\xf6" * 2**20) == [None] * 2**20
    decoder = values.Decoder(Allowance(0, "it"))
    with pytest.raises(BadFile, match="it unpacks to more than 64 MiB"):
        decoder.value(b"\x9a\x00\x20\x00\x00" + b"\xf6" * 2**21)
