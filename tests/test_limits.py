import gc
import math
from contextlib import suppress

import pytest

from gamms import limits
from gamms.errors import BadFile, BadType, BadValue, TooLarge

GIB = 1 << 30


def test_what_fits_into_the_bound_passes_and_one_byte_more_does_not():
    limits.refuse_above(2 * GIB, "A grid")
    with pytest.raises(TooLarge, match=r"A grid would take about 2\.0 GiB .* 2\.0 GiB are allowed.*--max-memory"):
        limits.refuse_above(2 * GIB + 1, "A grid")


@pytest.mark.parametrize("size", [math.inf, math.nan, 10**400])
def test_sizes_beyond_all_memories_are_refused_in_words(size):
    with pytest.raises(TooLarge, match="an astronomical amount"):
        limits.refuse_above(size, "count: 1e30")


def test_more_is_allowed_within_the_block_only():
    with limits.allowing(8 * GIB):
        assert limits.max_memory() == 8 * GIB
        limits.refuse_above(5 * GIB, "A grid")
    assert limits.max_memory() == 2 * GIB
    with limits.allowing("8G"):
        assert limits.max_memory() == 8 * GIB
    with pytest.raises(BadType, match=r"a text such as 8G, not 8\.0"), limits.allowing(8.0):
        pass
    with pytest.raises(BadValue, match="positive"), limits.allowing(0):
        pass


def test_values_of_a_file_may_take_memory_in_proportion_to_its_size():
    small, large = limits.MemoryBudget(0, "game.ggr"), limits.MemoryBudget(1 << 20, "game.ggr")
    small.charge(1 << 26)
    with pytest.raises(TooLarge, match=r"game\.ggr unpacks to more than 64 MiB"):
        small.charge(1)
    large.charge((1 << 26) + (1 << 30))
    with pytest.raises(TooLarge):
        large.charge(1)


def test_no_file_may_take_more_than_the_bound():
    with limits.allowing(1 << 27):
        allowance = limits.MemoryBudget(1 << 40, "city.gamms")
    allowance.charge(1 << 27)
    with pytest.raises(TooLarge):
        allowance.charge(1)


@pytest.mark.parametrize(
    ("text", "size"), [("100", 100), ("3K", 3072), ("512M", 512 << 20), ("8GiB", 8 * GIB), ("1 tb", 1 << 40)]
)
def test_sizes_are_read_with_their_units(text, size):
    assert limits.parse_memory(text) == size


@pytest.mark.parametrize("text", ["", "G", "-1G", "1.5G", "many", "9" * 30])
def test_texts_that_are_no_sizes_are_named(text):
    with pytest.raises(BadValue, match="512M or 8G"):
        limits.parse_memory(text)


def test_values_that_are_let_go_are_bounded_by_the_size_of_the_file_alone():
    with limits.allowing(1 << 20):
        allowance = limits.MemoryBudget(1 << 30, "game.ggr", is_streamed=True)
    allowance.charge(1 << 40)
    with pytest.raises(TooLarge):
        allowance.charge(1 << 27)


PRIME = (1 << 61) - 1  # the hash of an integer is what is left when it is divided by this


@pytest.mark.parametrize(
    "made", [lambda i: PRIME * i + 5, lambda i: (PRIME * i + 5, "a"), lambda i: frozenset([PRIME * i])]
)
def test_different_keys_that_were_made_to_have_one_hash_are_refused(made):
    keys = limits.KeyBudget()
    for i in range(16, 80):
        keys.check(made(i), b"%d" % i)
        keys.check(made(16), b"16")  # is the same one again
    with pytest.raises(BadFile, match="made to have one hash"):
        keys.check(made(80), b"80")


def test_any_number_of_honest_keys_is_taken():
    keys = limits.KeyBudget()
    for i in range(40_000):
        data = b"%d" % i
        keys.check((i % 100 - 50, i // 100), data)  # -1 and -2 have one hash
        keys.check((1 << 70) + i, data)
        keys.check([i], data)
        keys.check((i, [i]), data)


@pytest.mark.parametrize("is_enabled", [True, False])
@pytest.mark.parametrize("is_wanted", [True, False])
def test_no_garbage_is_collected_in_a_pause_and_then_as_before(is_enabled, is_wanted):
    (gc.enable if is_enabled else gc.disable)()
    try:
        with suppress(ZeroDivisionError), limits.GarbagePause(is_wanted=is_wanted):
            assert gc.isenabled() == (is_enabled and not is_wanted)
            with limits.GarbagePause():
                assert not gc.isenabled()
            assert gc.isenabled() == (is_enabled and not is_wanted)
            raise ZeroDivisionError
        assert gc.isenabled() == is_enabled
    finally:
        gc.enable()
