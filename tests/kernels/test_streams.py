"""Random streams: the same name gives the same draws, everywhere and always; another name gives others."""

import os
import subprocess
import sys

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels

PINNED = [1403422898989919623, 1072404519693873581, 3850153880040479538, 2875525484172993139]
SCRIPT = "from gamms import kernels; print(kernels.stream(5, 'agent', 'red', 3).integers(2**62, size=4).tolist())"


def draws(*names):
    return kernels.stream(*names).integers(2**62, size=4).tolist()


def test_the_same_names_give_the_same_draws():
    assert draws(1, "agent", "red") == draws(1, "agent", "red")


def test_other_names_give_other_draws():
    streams = [
        (1,),
        (2,),
        (1, "a"),
        (1, "b"),
        (1, "a", "b"),
        (1, "ab"),
        (1, "b", "a"),
        (1, 2),
        (1, "2"),
        (12,),
        (1, ""),
    ]
    assert len({tuple(draws(*names)) for names in streams}) == len(streams)


def test_drawing_from_one_stream_changes_no_other():
    first = kernels.stream(1, "a")
    expected = draws(1, "b")
    first.random(100)
    assert draws(1, "b") == expected


def test_the_draws_are_the_same_in_every_process():
    environment = os.environ | {"PYTHONHASHSEED": "12345"}
    printed = subprocess.check_output([sys.executable, "-c", SCRIPT], env=environment, text=True)
    assert printed == f"{draws(5, 'agent', 'red', 3)}\n"


def test_the_draws_are_pinned():
    assert draws(5, "agent", "red", 3) == PINNED


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
