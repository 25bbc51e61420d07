"""Lots and draws by name: the same on every machine, whoever else draws."""

import numpy as np

from gamms.kernels import draws_by_name, lots_by_name


def test_a_lot_follows_from_seed_purpose_and_name_alone():
    anna, ben = lots_by_name(7, ("conflicts", 3), ["anna", "ben"])
    assert lots_by_name(7, ("conflicts", 3), ["ben", "carl", "anna"])[::2] == [ben, anna]
    others = [(8, ("conflicts", 3)), (7, ("conflicts", 4)), (7, ("weather", 3))]
    assert len({anna, ben, *(lots_by_name(*other, ["anna"])[0] for other in others)}) == 5


def test_lots_are_the_same_everywhere():
    assert lots_by_name(7, ("conflicts", 3), ["anna"]) == [0x8A0EEAC9B0960A75]


def test_a_draw_follows_from_seed_purpose_and_name_alone():
    anna, ben = draws_by_name(7, ("detection", "s", 3), ["anna", "ben"])
    assert draws_by_name(7, ("detection", "s", 3), ["ben", "carl", "anna"])[::2].tolist() == [ben, anna]
    others = [(8, ("detection", "s", 3)), (7, ("detection", "s", 4)), (7, ("detection", "t", 3))]
    assert len({anna, ben, *(draws_by_name(*other, ["anna"])[0] for other in others)}) == 5


def test_draws_are_the_same_everywhere():
    assert draws_by_name(7, ("detection",), ["anna", "ben"]).tolist() == PINNED


def test_draws_are_uniform_over_names_and_over_purposes():
    names = [f"agent_{i}" for i in range(20_000)]
    by_name = draws_by_name(1, ("detection",), names)
    by_purpose = np.concatenate([draws_by_name(1, ("detection", look), ["anna", "ben"]) for look in range(5_000)])
    for draws in (by_name, by_purpose):
        counts, _ = np.histogram(draws, bins=10, range=(0.0, 1.0))
        assert counts.sum() == len(draws)
        assert abs(counts - len(draws) / 10).max() < 5 * np.sqrt(len(draws) / 10)


def test_nobody_draws_nothing():
    assert draws_by_name(1, (), []).shape == (0,)


PINNED = [0.8665741820466719, 0.17505995256263085]
