"""Random streams: the same name gives the same draws, everywhere and always; another name gives others."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels


@given(
    seeds=st.lists(st.integers(0, 2**70), min_size=1, max_size=2),
    n=st.integers(1, 2**28),
    copies=st.sampled_from([1, 130]),
)
def test_first_numbers_of_streams_are_those_of_their_generators(seeds, n, copies):
    names = [(seed, "place", number) for seed in seeds for number in range(copies)]
    keys = [kernels.stream_key(*name) for name in names]
    expected = [int(kernels.stream(*name).integers(n)) for name in names]
    assert kernels.below_of_words(kernels.stream_words(keys), np.full(len(keys), n)).tolist() == expected


def test_a_number_that_would_be_unfair_is_drawn_again():
    n = 2**32 // 17 + 1  # one number in seventeen is
    names = [(seed, "place") for seed in range(150)]
    keys = [kernels.stream_key(*name) for name in names]
    expected = [int(kernels.stream(*name).integers(n)) for name in names]
    assert kernels.below_of_words(kernels.stream_words(keys), np.full(150, n)).tolist() == expected
    few = [kernels.below_of_words(kernels.stream_words([key]), np.array([n])) for key in keys]
    assert np.concatenate(few).tolist() == expected
