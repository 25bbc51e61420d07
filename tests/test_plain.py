"""What a plain value is."""

import enum
from typing import NamedTuple

import numpy as np
import pytest

from gamms.plain import MOST_DEPTH, describe_flaw, is_plain, select_plain, to_plain


class Color(enum.IntEnum):
    RED = 3


class Pair(NamedTuple):
    a: int
    b: int


def nested(depth):
    value = []
    for _ in range(depth - 1):
        value = [value]
    return value


PLAIN = [None, True, 1 << 99, -0.0, "ä", b"x", [1, (2, {3})], {(1, frozenset({2})): {}}, np.zeros((2, 3)), {1.5: []}]
PLAIN += [Color.RED, Pair(1, 2), np.int8(3), np.bool_(True), nested(MOST_DEPTH)]


@pytest.mark.parametrize("value", PLAIN, ids=repr)
def test_a_plain_value_stays_equal_and_is_of_built_in_types(value):
    assert describe_flaw(value) == ""
    found = to_plain(value)
    assert np.array_equal(found, value) if isinstance(value, np.ndarray) else found == value
    assert type(found).__module__ in ("builtins", "numpy")
    assert not isinstance(found, np.generic)


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (object(), " is of type object"),
        ({"a": [1, {2: len}]}, "['a'][1][2] is of type builtin_function_or_method"),
        ({(1, object): 2}, " has the key (1, <class 'object'>), which cannot be written"),
        ([np.array(["a"])], "[0] is of dtype <U1 and shape (1,)"),
        (
            nested(MOST_DEPTH + 1),
            "[0]" * MOST_DEPTH + f" is nested more than {MOST_DEPTH} levels deep, or holds itself",
        ),
        (1j, " is of type complex"),
    ],
    ids=["object", "function", "key", "array of texts", "depth", "complex"],
)
def test_a_value_that_is_not_plain_is_named_with_its_place(value, why):
    assert describe_flaw(value) == why
    assert not is_plain(value)


@pytest.mark.parametrize("part", [list, tuple, lambda inner: {"a": inner[0]}], ids=["list", "tuple", "dict"])
def test_a_value_that_is_nested_too_deep_becomes_a_text_there(part):
    value = 7
    for _ in range(3 * MOST_DEPTH):
        value = part([value])
    found, depth = to_plain(value), 0
    while not isinstance(found, str):
        found, depth = next(iter(found.values() if isinstance(found, dict) else found)), depth + 1
    assert depth <= MOST_DEPTH + 1


def test_sets_are_plain_up_to_three_in_each_other():
    pairs = frozenset({frozenset({(1, 2)})})
    for value in ({pairs}, {pairs: pairs}, [{pairs}] * 9, frozenset({pairs}), {"a": {(1, pairs)}}):
        assert is_plain(value)
        assert to_plain(value) == value
    for value in ({frozenset({pairs})}, [{"a": {(1, frozenset({pairs}))}}]):
        assert not is_plain(value)
        assert is_plain(to_plain(value))


def test_values_of_which_a_part_becomes_a_text_are_reported():
    deep, kept = frozenset({frozenset({frozenset({frozenset({(1,)})})})}), frozenset({frozenset({(1, 2)})})
    values = {"deep": deep, "key": {object: 1}, "list": [1, [object]], "set": {object}, "kept": kept, "scalar": 1}
    left_out = []
    part = select_plain(values, left_out)
    assert left_out == ["deep", "key", "list", "set"]
    assert part == {key: to_plain(value) for key, value in values.items()}


def test_a_value_that_is_not_plain_becomes_a_text_without_its_address():
    assert to_plain({"a": object()}) == {"a": "<object object>"}


def test_an_object_that_cannot_be_shown_is_described_by_its_class():
    class Hidden:
        def __repr__(self):
            raise ValueError("not to be shown")

    assert to_plain([Hidden()])[0].startswith(f"<{__name__}.test_an_object_that_cannot_be_shown")
