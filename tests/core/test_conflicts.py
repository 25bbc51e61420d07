"""Ids of nodes are numbered in the order in which they first come."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms.core import conflicts


def numbered(ids):
    """Return the numbers of ids, and check the memory."""
    size = 1 << len(ids).bit_length()
    slots = np.full(size, -1, np.int32)
    numbers = np.zeros(len(ids), np.int64)
    tables = np.zeros(size, np.int64).data, slots.data, np.zeros(len(ids), np.int32).data
    found = conflicts.number_ids(np.array(ids, np.int64).data, *tables, numbers.data)
    assert (slots == -1).all()
    assert found == len(set(ids))
    return numbers.tolist()


def test_ids_are_numbered_in_the_order_in_which_they_first_come():
    assert numbered([7, -(2**63), 2**63 - 1, 7, 0]) == [0, 1, 2, 0, 3]


@given(
    st.lists(st.one_of(st.integers(-(2**63), 2**63 - 1), st.integers(0, 9), st.integers(0, 9).map(lambda n: n << 40)))
)
def test_equal_ids_get_equal_numbers(ids):
    known = {one: number for number, one in enumerate(dict.fromkeys(ids))}
    assert numbered(ids) == [known[one] for one in ids]
