"""Copies of plain Python values."""

import threading

import numpy as np

from gamms.core.copies import copy_deep, copy_each, copy_values, refill, refill_counts, refill_each

PLAIN = {"a": [1, (2.5, {3})], (4, "b"): {"c": None, "d": np.arange(3)}, "e": (), "f": b"x"}


def test_a_copy_is_equal_and_shares_nothing_that_can_change():
    made = copy_deep(PLAIN)
    assert repr(made) == repr(PLAIN)
    assert made is not PLAIN
    assert made["a"] is not PLAIN["a"]
    assert made["a"][1][1] is not PLAIN["a"][1][1]
    assert made[4, "b"]["d"] is not PLAIN[4, "b"]["d"]


def test_an_object_that_is_there_twice_stays_one_object():
    twice = [1]
    first, second = copy_deep([twice, twice])
    assert first is second is not twice


def test_a_dict_that_holds_itself_is_copied():
    known = {"a": 1}
    known["self"] = known
    made = copy_deep(known)
    assert made is not known
    assert made["self"] is made


def test_a_memo_says_what_takes_the_place_of_an_object():
    one, other = object(), object()
    assert copy_deep([one], {id(one): other}) == [other]


def test_a_value_that_cannot_be_copied_is_shared():
    lock, numbers = threading.Lock(), [1]
    made = copy_values({"lock": lock, "numbers": numbers})
    assert made == {"lock": lock, "numbers": [1]}
    assert made["numbers"] is not numbers


def test_dicts_that_are_refilled_stay_the_same_objects():
    red, blue = {"moves": 1}, {"moves": 2}
    known = {"red": red, "blue": blue}
    before = copy_each(known)
    red["moves"] = blue["moves"] = 9
    del before["blue"]
    before["green"] = {"moves": 3}
    assert refill_counts(known, before) == {"red": {"moves": 1}, "blue": {"moves": 0}, "green": {"moves": 3}}
    assert refill_each(known, {"red": {"a": 1}}) == {"red": {"a": 1}, "blue": {}, "green": {}}
    assert known["red"] is red
    assert refill(red, {"b": 2}) is red == {"b": 2}
