"""What strategies decide by, in a game alone and in batches."""

from array import array
from math import inf

from gamms.core import strategies


def ints(*values):
    return memoryview(array("q", values))


def floats(*values):
    return memoryview(array("d", values))


def test_an_agent_on_its_stop_goes_on_to_the_next_one():
    stops, following = ints(7, 7, 8), ints(2, 2, 3)
    assert strategies.next_stop(stops, following, 0, 3, 0, 5) == 0
    assert strategies.next_stop(stops, following, 0, 3, 0, 7) == 2
    assert strategies.next_stop(stops, following, 0, 3, 2, 8) == 3
    assert strategies.next_stop(stops, following, 0, 3, 3, 8) == 3


def test_an_agent_stays_at_its_waypoint_and_draws_another_one_then():
    assert strategies.turns_left(True, 2, 0.0) == 1
    assert strategies.turns_left(True, 0, 0.0) == -1
    assert strategies.turns_left(False, 2, 5.0) == 2


def test_an_agent_without_a_path_to_its_waypoint_draws_another_one():
    assert strategies.turns_left(False, 2, inf) == -1


def test_the_farthest_of_several_nodes_is_that_of_the_lowest_id():
    assert strategies.farthest(floats(1.0, 3.0, 3.0), ints(4, 9, 2), 3) == 2
    assert strategies.farthest(floats(inf, 3.0, inf), ints(4, 1, 5), 3) == 0
    assert strategies.farthest(floats(1.0, 3.0, 3.0), ints(4, 9, 2), 1) == 0
