"""Columns and plain values as bytes: everything comes back as it was, and nothing else is accepted."""

import enum
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gamms.errors import BadFile, BadType, BadValue
from gamms.ir import packed_bytes, packing
from gamms.limits import MemoryBudget

DTYPES = list(packing.DTYPES)

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(st.characters()) | st.binary(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.lists(inner, max_size=3).map(tuple)
        | st.dictionaries(st.text() | st.integers() | st.tuples(st.integers(), st.text()), inner, max_size=3)
    ),
    max_leaves=5,
)


def there_and_back(value):
    return packing.from_bytes(packing.to_bytes(value, "It"))


@given(plain)
def test_a_plain_value_comes_back(value):
    assert repr(there_and_back(value)) == repr(value)


@given(plain)
def test_the_memory_of_a_value_is_never_more_than_the_bound_from_its_bytes(value):
    data = packing.to_bytes(value, "It")
    assert 0 < packing.compute_cost(data) <= packing.bound_cost(data)


@given(plain, hnp.arrays("int32", hnp.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4)))
def test_the_memory_of_a_value_equals_the_charge_of_a_decoder(value, array):
    data, allowance = packing.to_bytes([value, {"a": array}], "It"), MemoryBudget(1 << 20, "It")
    packing.Decoder(allowance).decode(data)
    assert packing.compute_cost(data) == allowance.total - allowance.left


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
    assert packing.to_bytes(set(names), "It") == packing.to_bytes(other, "It")


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
    assert there_and_back(nested(5, frozenset)) == nested(5, frozenset)  # sets count as seven
    loop = []
    loop.append(loop)
    for value in (
        nested(33),
        nested(33, tuple),
        nested(6, frozenset),
        [[nested(31)]],
        loop,
        [[[nested(30)], np.zeros(1)], nested(40)],
    ):
        with pytest.raises(BadValue, match="nested more than 32"):
            packing.to_bytes(value, "It")


@pytest.mark.parametrize("value", [{1j}, 1j, Kind, np.array(["a"]), np.array([None]), bytearray(b"a"), len], ids=str)
def test_a_value_that_is_not_plain_is_refused_by_its_name(value):
    with pytest.raises(BadType, match=r"It cannot be recorded: .*convert it first"):
        packing.to_bytes({"a": [value]}, "It")


def extension(code, *items):
    """A container of a plain value, whatever is in it."""
    content = bytes([0x90 + len(items)]) + b"".join(items)
    return b"\xc7" + bytes([len(content), code]) + content


TUPLE, LIST, DICT, SET, FROZENSET, BYTES, INT, TEXT, ARRAY = range(9)
UINT8, ONE, A = b"\xa5uint8", b"\xd4\x05a", b"\xa1a"

BAD = {
    "nothing": b"",
    "two values": b"\x91\x01\x01",
    "two values in one": b"\x92\x01\x01",
    "no value": b"\x90",
    "a bare value": b"\x01",
    "cut off": b"\x91",
    "cut off inside": b"\x91\xcf\x00",
    "a long text": b"\x91\xdb" + b"\xff" * 4,
    "long bytes": b"\x91\xc6" + b"\xff" * 4,
    "a long container": b"\x91\xc9" + b"\xff" * 4 + b"\1",
    "a long list": b"\x91" + b"\xc7\x05\x01" + b"\xdd" + b"\xff" * 4,
    "a list of its own": b"\x91\x91\x01",
    "a map of its own": b"\x91\x81\xa1a\x01",
    "bytes of their own": b"\x91\xc4\x01a",
    "a list inside": b"\x91" + extension(LIST, b"\x90"),
    "a date": b"\x91\xd6\xff\0\0\0\0",
    "an unknown container": b"\x91" + extension(9),
    "a container without items": b"\x91\xc7\x00\x01",
    "a container and more": b"\x91\xc7\x02\x01\x90\x90",
    "a reserved byte": b"\x91\xc1",
    "no text": b"\x91\xa1\xff",
    "no text inside": b"\x91" + b"\xd4\x07\xff",
    "a dict without a value": b"\x91" + extension(DICT, A),
    "a dict with a key twice": b"\x91" + extension(DICT, A, b"\1", A, b"\2"),
    "a key that is a dict": b"\x91" + extension(DICT, extension(DICT), b"\1"),
    "a key with a list": b"\x91" + extension(DICT, extension(TUPLE, extension(LIST)), b"\1"),
    "a set of lists": b"\x91" + extension(SET, extension(LIST)),
    "a frozen set of dicts": b"\x91" + extension(FROZENSET, extension(DICT)),
    "an array as a key": b"\x91" + extension(DICT, extension(ARRAY, UINT8, ONE, b"\1"), b"\1"),
    "an array without parts": b"\x91" + extension(ARRAY),
    "an array of objects": b"\x91" + extension(ARRAY, b"\xa6object", b"\xd7\x05aaaaaaaa", b"\1"),
    "an array of text": b"\x91" + extension(ARRAY, UINT8, A, b"\1"),
    "an array with too few bytes": b"\x91" + extension(ARRAY, UINT8, ONE, b"\2"),
    "an array with half an item": b"\x91" + extension(ARRAY, b"\xa5int16", ONE, b"\1"),
    "an array with a wide shape": b"\x91" + extension(ARRAY, UINT8, b"\xc7\0\5", b"\0", b"\xcf" + b"\xff" * 8),
    "an array with a negative shape": b"\x91" + extension(ARRAY, UINT8, ONE, b"\xff", b"\xff"),
    "an array with a shape of floats": b"\x91" + extension(ARRAY, UINT8, ONE, b"\xcb\x3f\xf0" + bytes(6)),
    "an array with ten dimensions": b"\x91" + extension(ARRAY, UINT8, ONE, *[b"\1"] * 10),
}


@pytest.mark.parametrize("data", BAD.values(), ids=BAD.keys())
def test_bytes_that_no_writer_makes_are_refused(data):
    with pytest.raises(BadFile):
        packing.from_bytes(data)


def test_a_container_may_not_be_too_deep():
    for depth in (33, 60):
        data = extension(LIST)
        for _ in range(depth - 1):
            data = extension(LIST, data)
        with pytest.raises(BadFile, match="nested more than 32"):
            packing.from_bytes(b"\x91" + data)


@given(plain, st.data())
def test_a_damaged_value_is_refused_or_another_plain_value(value, chance):
    data = bytearray(packing.to_bytes([value, {"a": (value, {1, "b"})}], "It"))
    data[chance.draw(st.integers(0, len(data) - 1))] ^= chance.draw(st.integers(1, 255))
    try:
        found = packing.from_bytes(bytes(data))
    except BadFile:
        return
    again = packing.to_bytes(found, "It")  # by its bytes, for sets have no order
    assert packing.to_bytes(packing.from_bytes(again), "It") == again


def test_a_value_may_have_any_number_of_items_that_its_size_explains():
    def nothings(count):
        return b"\x91\xc9" + (count + 5).to_bytes(4, "big") + b"\1\xdd" + count.to_bytes(4, "big") + b"\xc0" * count

    assert packing.from_bytes(nothings(2**20)) == [None] * 2**20
    decoder = packing.Decoder(MemoryBudget(0, "it"))
    with pytest.raises(BadFile, match="it unpacks to more than 64 MiB"):
        decoder.decode(nothings(2**21))


@given(st.lists(st.integers(-(2**63), 2**63 - 1) | st.integers(-3, 3)))
def test_a_column_comes_back(numbers):
    column = np.array(numbers, np.int64)
    reader = packed_bytes.ByteReader(
        packed_bytes.encode_column(column) + packed_bytes.encode_column(packed_bytes.compute_differences(column))
    )
    assert reader.read_column(len(numbers)).tolist() == numbers
    assert reader.read_sums(len(numbers)).tolist() == numbers
    reader.finish()


def test_a_few_integers_take_as_many_bytes_as_the_one_farthest_from_zero():
    for farthest, size in ((0, 1), (-128, 1), (127, 1), (-129, 2), (128, 2), (1 << 23, 4), (-(1 << 63), 8)):
        assert len(packed_bytes.encode_column(np.array([0, farthest, 0]))) == 1 + 3 * size


def test_a_column_of_narrow_integers_has_the_bytes_of_wide_ones():
    wide = np.random.default_rng(1).integers(-(2**30), 2**30, 9)
    assert packed_bytes.encode_column(wide.astype(np.int32)) == packed_bytes.encode_column(wide)


def test_a_table_that_was_written_once_says_the_same_for_ever():
    for numbers in ("01 01 01 00 01", "03 03 01", "08 0b"):
        reader = packed_bytes.ByteReader(bytes.fromhex("09 01 02 9f 70 0f 17" + numbers))
        assert reader.read_column(4).tolist() == [1000, 1000, -2000, 1000]
        reader.finish()


@pytest.mark.parametrize(
    ("column", "size", "words"),
    [
        ("09 01 01 00 02 01 00 02", 2, "2 numbers does not fit its table of 2 entries"),
        ("09 01 01 00 02 02 04", 2, "2 numbers does not fit its table of 2 entries"),
        ("09 00 01 00 01", 0, "0 numbers does not fit its table of 1 entries"),
        ("09 00 01 00 00 00", 1, "a byte cannot have 0 of 1 entries"),
        ("09 00 01 00 09 00", 1, "a byte cannot have 9 of 1 entries"),
        ("09 02 01 00 02 02 06 00", 1, "a byte cannot have 6 of 3 entries"),
        ("09 00 09 00 01 00 00", 1, "1 numbers cannot have the form 9"),
        ("09 00 00 00", 1, "1 numbers cannot have the form 0"),
        ("09 ff 01 00", 1, "256 bytes are stated, but only 1 exist"),
        ("09 00", 1, "2 bytes are stated, but only 1 exist"),
        ("0a 00 01 00 00", 1, "1 numbers cannot have the form 10"),
    ],
    ids=[
        "no such entry",
        "no such pair of entries",
        "empty",
        "bytes without numbers",
        "bytes with nine numbers",
        "bytes with too many numbers",
        "a table in a table",
        "no entries",
        "cut entries",
        "cut off",
        "a form of later versions",
    ],
)
def test_a_damaged_column_is_refused(column, size, words):
    with pytest.raises(BadFile, match=words):
        packed_bytes.ByteReader(bytes.fromhex(column)).read_column(size)


@given(st.binary(), st.binary(), st.sampled_from([packed_bytes.BEST, packed_bytes.FAST]))
def test_packed_bytes_are_unpacked_with_the_following_bytes(data, rest, level):
    assert packed_bytes.unpack_bytes(packed_bytes.pack_bytes(data, level) + rest, len(data)) == (data, rest)


def test_packed_bytes_are_refused_that_are_not_what_they_promise():
    packed = packed_bytes.pack_bytes(b"a" * 1000)
    for damaged in (
        b"",
        packed[:-1],
        packed_bytes.encode_varint(999) + packed[2:],
        packed_bytes.encode_varint(1001) + packed[2:],
        b"\xff" * 12,
    ):
        with pytest.raises(BadFile):
            packed_bytes.unpack_bytes(damaged, 2000)
    with pytest.raises(BadFile, match="1000 bytes of memory"):
        packed_bytes.unpack_bytes(packed, 999)
