"""The functions of the core by which strategies decide, in single games and in batches."""

from array import array
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.core import routes, strategies
from gamms.ir.agents import are_mates

DISTANCES = st.lists(st.sampled_from([0.0, 1.0, 2.5, inf]), max_size=5)


def column(values):
    """A column of integers, as the core takes them."""
    return memoryview(array("q", values))


def steps_along(path, legal):
    """The number of steps along a path in one move, among legal nodes that begin behind others."""
    return routes.count_steps(column(path), len(path), column([*path, *legal]), len(path), len(legal))


def test_an_agent_steps_as_far_along_its_path_as_all_nodes_are_legal():
    assert steps_along([7, 5, 3, 1], [7, 5, 3]) == 2
    assert steps_along([7, 5, 3, 1], [7, 5, 1]) == 1
    assert steps_along([7, 5, 3, 1], [7, 3, 1]) == 0


def test_an_agent_steps_from_a_node_that_is_not_legal_itself():
    assert steps_along([7, 5, 3], [5]) == 1
    assert steps_along([7], [5]) == 0


@given(path=st.lists(st.integers(-3, 9), min_size=1, unique=True), legal=st.sets(st.integers(-3, 9)))
def test_the_first_step_that_is_not_taken_leads_to_a_node_that_is_not_legal(path, legal):
    steps = steps_along(path, legal)
    assert legal.issuperset(path[1 : steps + 1])
    assert legal.isdisjoint(path[steps + 1 : steps + 2])


def nearest(distances, order):
    """The number of the nearest of several, looked at in an order; None if no path leads to any."""
    least = inf
    found = len(distances)
    for number in order:
        if strategies.is_nearer(distances[number], number, least, found):
            least = distances[number]
            found = number
    return found if found < len(distances) else None


@given(distances=DISTANCES, data=st.data())
def test_in_any_order_the_first_of_the_nearest_is_found(distances, data):
    order = data.draw(st.permutations(range(len(distances))))
    reached = [far for far in distances if far < inf]
    assert nearest(distances, order) == (distances.index(min(reached)) if reached else None)


@pytest.mark.parametrize(("far", "counts"), [(2.5, True), (3.0, True), (3.5, False), (inf, False)])
def test_up_to_the_greatest_distance_that_counts_one_is_found(far, counts):
    assert strategies.is_nearer(far, 0, 3.0, 1) == counts
    assert not strategies.is_nearer(inf, 0, inf, 1)


TEAMS = st.sampled_from([None, "red", "blue", 7])


@given(own=TEAMS, other=TEAMS)
def test_agents_of_one_team_are_mates_and_agents_without_a_team_have_none(own, other):
    numbers = {None: 0, "red": 1, "blue": 2, 7: 3}
    expected = own is not None and other == own
    assert are_mates(own, other) == expected
    assert strategies.are_mates(numbers[own], numbers[other], 0) == expected


def test_where_all_agents_have_a_team_each_team_has_mates():
    assert strategies.are_mates(0, 0, -1)
    assert not strategies.are_mates(0, 1, -1)


@given(fraction=st.floats(0.0, 1.0, exclude_max=True))
def test_certain_events_happen_and_impossible_ones_do_not(fraction):
    assert strategies.is_drawn(fraction, 1.0)
    assert not strategies.is_drawn(fraction, 0.0)
