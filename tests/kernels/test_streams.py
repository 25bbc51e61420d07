"""Random streams: the same name gives the same draws, everywhere and always; another name gives others."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels


@given(
    seeds=st.lists(st.integers(-(2**70), 2**70), min_size=1, max_size=3),
    names=st.lists(st.lists(st.text() | st.integers(), min_size=1, max_size=3).map(tuple), min_size=1, max_size=3),
)
def test_keys_of_many_streams_are_those_of_each(seeds, names):
    keys = kernels.stream_keys(seeds, names)
    joined = [[int(low) | int(high) << 64 for low, high in of_seed] for of_seed in keys]
    assert joined == [[kernels.stream_key(seed, *name) for name in names] for seed in seeds]
    purposes = [[kernels.compute_purpose_key(seed, *name) for name in names] for seed in seeds]
    assert kernels.compute_purpose_keys(seeds, names).tolist() == purposes


@given(seeds=st.lists(st.integers(0, 2**70), min_size=1, max_size=3), n=st.integers(1, 2**28))
def test_first_numbers_of_streams_are_those_of_their_generators(seeds, n):
    names = [("place", number) for number in range(3)]
    words = kernels.stream_words(kernels.stream_keys(seeds, names)).reshape(-1, 8)
    expected = [int(kernels.stream(seed, *name).integers(n)) for seed in seeds for name in names]
    assert kernels.draw_from_many_words(words, np.full(len(words), n)).tolist() == expected


def test_a_number_that_would_be_unfair_is_drawn_again():
    n = 2**32 // 17 + 1  # one number in seventeen is
    words = kernels.stream_words(kernels.stream_keys(range(150), [("place",)])[:, 0])
    expected = [int(kernels.stream(seed, "place").integers(n)) for seed in range(150)]
    assert kernels.draw_from_many_words(words, np.full(150, n)).tolist() == expected


@given(seed=st.integers(0, 2**40), free=st.lists(st.integers(0, 99), min_size=1, max_size=30, unique=True).map(sorted))
def test_agents_take_one_of_the_free_nodes_after_the_other(seed, free):
    names = [("place", number) for number in range(len(free))]
    placed = kernels.draw_places(kernels.stream_keys([seed], names), np.array(free))
    left = list(free)
    expected = [left.pop(int(kernels.stream(seed, *name).integers(len(left)))) for name in names]
    assert placed.tolist() == [expected]
