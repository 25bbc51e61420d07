"""Who has to stay where too many want to go, or where two want to exchange nodes."""

import pytest

from gamms.rules import Conflicts, by_priority, nobody


def by_name(contest, _ctx):
    return contest.movers[: contest.places]


def last(contest, _ctx):
    return [mover.agent for mover in contest.movers[-contest.places :]]


class Heard:
    """Lets the first win, and keeps what it was asked."""

    def __init__(self):
        self.contests = []

    def __call__(self, contest, ctx):
        self.contests.append(contest)
        return by_name(contest, ctx)


def test_those_who_go_the_way_of_the_winner_may(stay):
    heard = Heard()
    conflicts = Conflicts(None, resolve=heard, allow_swaps=False)
    assert stay(conflicts, (0, 1), (0, 1), (1, 0), (1, 0), (1, 2), (0, 0)) == "cd"
    assert [(contest.node, contest.places, len(contest.movers)) for contest in heard.contests] == [((0, 1), 1, 4)]
    assert stay(Conflicts(None, resolve=last, allow_swaps=False), (0, 1), (0, 1), (1, 0), (1, 0)) == "ab"


def test_a_contest_names_the_node_its_places_and_those_who_come(stay):
    heard = Heard()
    assert stay(Conflicts(3, resolve=heard), (0, 5), (5, 5), (1, 5), (2, 5), (4, 4)) == "d"
    ((node, places, movers),) = heard.contests
    assert (node, places, [mover.agent for mover in movers]) == (5, 2, ["a", "c", "d"])


def test_no_resolver_is_asked_where_no_place_is_free(stay):
    heard = Heard()
    assert stay(Conflicts(resolve=heard), (0, 1), (1, 1), (2, 1)) == "ac"
    assert heard.contests == []


def test_contests_of_a_round_are_decided_in_the_order_of_the_nodes(stay):
    heard = Heard()
    stay(Conflicts(resolve=heard), (0, 7), (1, 7), (2, 3), (4, 3), (5, 6), (8, 6))
    assert [contest.node for contest in heard.contests] == [3, 6, 7]


def test_a_node_that_loses_a_place_is_contested_again(stay):
    """Node 1 takes two: a and b. Then c, who wanted to leave it, finds node 9 taken, and one place is left for them."""
    heard = Heard()
    conflicts = Conflicts({1: 2, 9: 1}, resolve=heard)
    assert stay(conflicts, (0, 1), (2, 1), (1, 9), (3, 1), (9, 9)) == "bcd"
    assert [(contest.node, contest.places) for contest in heard.contests] == [(1, 2), (1, 1)]


def test_nodes_that_a_mapping_leaves_out_take_any_number(stay):
    rooms = {1: 1, 3: None, 5: 0}
    conflicts = Conflicts(rooms, resolve=by_name)
    assert stay(conflicts, (0, 1), (2, 1), (0, 3), (2, 3), (0, 4), (2, 4)) == "b"
    assert stay(conflicts, (4, 5), (5, 5), (5, 6)) == "a"
    rooms[1] = 2
    assert stay(conflicts, (0, 1), (2, 1)) == "b"
    assert stay(Conflicts({}, resolve=nobody()), (0, 1), (2, 1)) == ""


def test_an_attribute_no_node_has_is_an_error_with_a_hint(ctx, stay):
    ctx.graph.graph.update_node({"id": 2, "rooms": 1})
    with pytest.raises(KeyError, match=r"Unknown node attribute 'room'\. Did you mean 'rooms'\?"):
        stay(Conflicts("room"), (0, 1))


@pytest.mark.parametrize(
    ("value", "error"), [(-1, ValueError), (1.5, TypeError), ("two", TypeError), (True, TypeError)]
)
def test_an_invalid_capacity_is_an_error_even_at_a_node_without_agents(ctx, stay, value, error):
    ctx.graph.graph.update_node({"id": 7, "beds": value})
    with pytest.raises(error, match=r"Attribute 'beds' of node 7 must .*: 0 closes the place to others, and None"):
        stay(Conflicts("beds"), (0, 1))


def test_no_team_is_a_team_too(stay):
    assert stay(Conflicts(among="team", resolve=by_name), (0, 1), (2, 1), (3, 1), teams={"b": "red"}) == "c"


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        *(
            ({"capacity": value}, TypeError, "must be an integer")
            for value in (1.0, True, [1], b"room", {1: "two"}, {"1": 1}, {1: True})
        ),
        *(({"capacity": value}, ValueError, "capacity") for value in (0, -1, "", {1: -1})),
        ({"among": "teams"}, ValueError, r"among must be 'all' or 'team', not 'teams'\. Did you mean 'team'\?"),
        ({"allow_swaps": "no"}, TypeError, "allow_swaps must be True or False, not 'no'"),
    ],
)
def test_impossible_options_are_refused(options, error, words):
    with pytest.raises(error, match=words):
        Conflicts(**options)


def test_conflicts_show_their_arguments():
    assert repr(Conflicts()) == "Conflicts(capacity=1, among='all', allow_swaps=True, resolve=at_random())"
    priority = Conflicts({3: None}, "team", allow_swaps=False, resolve=by_priority(["red"]))
    assert (
        repr(priority) == "Conflicts(capacity={3: None}, among='team', allow_swaps=False, resolve=by_priority(['red']))"
    )
