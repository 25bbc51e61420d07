"""Keyed draws: what they follow from, that rows are drawn as one alone, and that they are spread evenly."""

from math import log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels
from gamms.kernels import draws as draws_of_kernels

KEY = kernels.compute_purpose_key(7, "conflicts")
WORDS = st.integers(0, 2**64 - 1)


def draws(seed=7, purpose="conflicts", name="anna", turn=3, k=0):
    return kernels.draw_bits(kernels.compute_purpose_key(seed, purpose), kernels.compute_name_key(name), turn, k)


def test_a_draw_follows_from_seed_purpose_name_turn_and_count():
    assert draws() == draws()
    others = [draws(seed=8), draws(purpose="contacts"), draws(name="ben"), draws(turn=4), draws(k=1)]
    assert len({draws(), *others}) == 6


def test_draws_are_the_same_on_every_machine():
    assert [draws(), draws(name="ünï"), draws(turn=-1), draws(turn=2**63 - 1)] == PINNED


@given(st.lists(st.text(), min_size=3, max_size=5))
def test_the_keys_of_many_names_are_those_of_each(names):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(draws_of_kernels, "_MOST_NAMES", 2)
        keys = kernels.compute_name_keys(iter(names))
    assert (keys.tolist(), keys.dtype) == ([kernels.compute_name_key(name) for name in names], np.uint64)


@given(WORDS, st.lists(st.text(), max_size=5), st.integers(-(2**63), 2**63 - 1), st.integers(0, 2**40))
def test_the_array_form_gives_the_same_bits(purpose, names, turn, k):
    many = kernels.draw_bits_rows(purpose, kernels.compute_name_keys(names), turn, k)
    assert many.tolist() == [kernels.draw_bits(purpose, kernels.compute_name_key(name), turn, k) for name in names]


@given(st.lists(st.tuples(WORDS, st.integers(1, 2**32)), min_size=1, max_size=5))
def test_numbers_below_n_and_fractions_agree_in_both_forms(pairs):
    bits, n = np.array([pair[0] for pair in pairs], np.uint64), np.array([pair[1] for pair in pairs])
    numbers, fractions = (
        [kernels.convert_to_integer(*pair) for pair in pairs],
        [kernels.convert_to_fraction(pair[0]) for pair in pairs],
    )
    assert kernels.convert_to_integers(bits, n).tolist() == numbers
    assert kernels.convert_to_fractions(bits).tolist() == fractions
    assert all(0 <= number < most for number, (_, most) in zip(numbers, pairs, strict=True))
    assert all(0.0 <= one < 1.0 for one in fractions)


@pytest.mark.parametrize("n", [1, 2, 3, 10])
def test_every_number_below_n_is_drawn_equally_often(n):
    bits = [kernels.draw_bits(KEY, kernels.compute_name_key("anna"), turn, k) for turn in range(200) for k in range(50)]
    counts = np.bincount([kernels.convert_to_integer(one, n) for one in bits], minlength=n)
    expected = len(bits) / n
    assert ((counts - expected) ** 2 / expected).sum() < 30.0


def test_draws_of_names_turns_and_counts_are_even_and_independent():
    names = kernels.compute_name_keys(f"agent_{i}" for i in range(5_000))
    columns = [
        kernels.convert_to_fractions(kernels.draw_bits_rows(KEY, names, turn, k)) for turn in range(4) for k in range(3)
    ]
    assert all(abs(column.mean() - 0.5) < 0.02 and abs(column.std() - 12**-0.5) < 0.02 for column in columns)
    assert np.abs(np.corrcoef(columns) - np.eye(len(columns))).max() < 0.06


def test_no_names_make_no_draws():
    assert kernels.draw_bits_rows(KEY, kernels.compute_name_keys([]), 1).shape == (0,)


PINNED = [13768235381647332207, 13059654337631412147, 4189190002378233871, 13255339459356631618]


def test_normal_numbers_have_the_quantiles_of_their_distribution():
    bits = [kernels.draw_bits(KEY, kernels.compute_name_key("anna"), turn) for turn in range(20_000)]
    found = kernels.convert_to_normals(bits)
    for bound, share in ((-1.96, 0.025), (-1.0, 0.1587), (0.0, 0.5), (0.6745, 0.75), (2.5758, 0.995)):
        assert abs((found < bound).mean() - share) < 4 * (share * (1 - share) / 20_000) ** 0.5
    assert np.isfinite(kernels.convert_to_normals([0, 2**64 - 1])).all()
    assert kernels.convert_to_normals([0, 2**64 - 1]).sum() == 0.0
    assert kernels.convert_to_normals([]).shape == (0,)


@pytest.mark.parametrize("mean", [0.0, 0.1, 1.0, 7.5, 100.0])
def test_poisson_numbers_have_their_mean_and_variance(mean):
    bits = [kernels.draw_bits(KEY, kernels.compute_name_key("anna"), turn) for turn in range(5_000)]
    counts = np.array([kernels.convert_to_poisson(one, mean) for one in bits])
    assert abs(counts.mean() - mean) <= 4 * (mean / 5_000) ** 0.5
    assert abs(counts.var() - mean) <= 0.15 * mean + 0.02
    assert kernels.convert_to_poisson(0, mean) == 0 or mean == 100.0
    assert kernels.convert_to_poisson(2**64 - 1, mean) < mean + 15 * (mean**0.5 + 1.5)


def test_a_poisson_number_is_the_first_whose_chances_up_to_it_come_to_more_than_the_draw():
    half = log(2.0)  # the chance of none
    draws = [0, (1 << 63) - 1, 1 << 63]
    assert [kernels.convert_to_poisson(bits, half) for bits in draws] == [0, 0, 1]
