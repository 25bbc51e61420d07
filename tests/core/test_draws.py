"""Keyed draws of the core."""

from array import array
from importlib import import_module

import pytest

import gamms
from gamms.core import draws

KEY_0 = 0x0706050403020100
KEY_1 = 0x0F0E0D0C0B0A0908


def test_siphash_meets_the_vector_of_its_authors() -> None:
    # Entry 8 of vectors_sip64 in the reference implementation: the key 00..0f, the message 00..07.
    assert draws.compute_siphash(KEY_0, KEY_1, KEY_0) == 0x93F5F5799A932462


def test_mix_is_the_finalizer_of_splitmix64() -> None:
    # The first outputs of SplitMix64 with the seed 1234567.
    assert [draws.compute_bits(1234567, k) for k in range(3)] == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
    ]


def test_a_turn_may_be_negative() -> None:
    assert draws.compute_turn_key(5, -3) == draws.mix((5 - 3 * 0x9E3779B97F4A7C15) % 2**64)


def bounds_are_checked():
    """Return whether the core that runs is interpreted, or was built to check bounds."""
    return not gamms.core.is_compiled or import_module("gamms.core._stamp").PROFILE == "checked"


@pytest.mark.skipif(not bounds_are_checked(), reason="this build does not check bounds: make test-core")
def test_a_column_that_is_too_short_is_an_error_where_bounds_are_checked() -> None:
    keys = memoryview(array("Q", [1]))
    counts = memoryview(array("q", [0]))
    out = memoryview(array("Q", [0, 0]))
    with pytest.raises(IndexError):
        draws.fill_bits(keys, counts, out)
