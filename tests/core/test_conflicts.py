"""Ids of nodes are numbered in the order in which they first come, except dense ones, which are their own numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.core.agents import NodeNumbers

ODD = [7, -(2**63), 2**63 - 1, 7, 0]


def numbered(ids, dense=0):
    """Return the numbers of ids, and check that the ids of these numbers are the same."""
    known, numbers = NodeNumbers(dense), np.zeros(len(ids), np.int64)
    known.write(np.array(ids, np.int64).data, numbers.data)
    assert known.count == len({*ids, *range(dense)}) <= known.room
    assert [known.ids[number] for number in numbers] == ids
    return numbers.tolist()


@pytest.mark.parametrize(("dense", "numbers"), [(0, [0, 1, 2, 0, 3]), (1, [1, 2, 3, 1, 0]), (9, [7, 9, 10, 7, 0])])
def test_ids_are_numbered_in_the_order_in_which_they_first_come(dense, numbers):
    assert numbered(ODD, dense) == numbers


@given(
    st.lists(st.one_of(st.integers(-(2**63), 2**63 - 1), st.integers(0, 9), st.integers(0, 9).map(lambda n: n << 40))),
    st.integers(0, 5),
)
def test_equal_ids_get_equal_numbers(ids, dense):
    known = {one: number for number, one in enumerate(dict.fromkeys([*range(dense), *ids]))}
    assert numbered(ids, dense) == [known[one] for one in ids]


def test_numbers_stay_when_their_table_grows():
    far = [number << 33 for number in range(1000)]
    assert numbered([*far, *far], 10) == [0, *range(10, 1009)] * 2
