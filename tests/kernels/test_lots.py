"""Lots by name: the same on every machine, whoever else draws."""

from gamms.kernels import lots_by_name


def test_a_lot_follows_from_seed_purpose_and_name_alone():
    anna, ben = lots_by_name(7, ("conflicts", 3), ["anna", "ben"])
    assert lots_by_name(7, ("conflicts", 3), ["ben", "carl", "anna"])[::2] == [ben, anna]
    others = [(8, ("conflicts", 3)), (7, ("conflicts", 4)), (7, ("weather", 3))]
    assert len({anna, ben, *(lots_by_name(*other, ["anna"])[0] for other in others)}) == 5


def test_lots_are_the_same_everywhere():
    assert lots_by_name(7, ("conflicts", 3), ["anna"]) == [0x8A0EEAC9B0960A75]
