"""Who meets whom: on one node, past each other, by edges, by road, in a straight line; matched nearest first."""

from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.errors import UnknownName
from gamms.rules import contacts, one_to_one


def pairs(ctx, **nearness):
    return {(contact.a, contact.b): contact.distance for contact in contacts(ctx, "red", "blue", **nearness)}


def test_agents_that_pass_each_other_on_an_edge_meet(road):
    ctx = road(r=("red", 3, 4), b=("blue", 4, 3), behind=("blue", 5, 4), same_way=("blue", 3, 4))
    ctx.game.step()
    assert pairs(ctx) == {("r", "b"): 0.0, ("r", "behind"): 0.0, ("r", "same_way"): 0.0}
    assert pairs(ctx, crossing=False) == {("r", "behind"): 0.0, ("r", "same_way"): 0.0}


def test_a_misspelled_team_is_refused_and_one_whose_agents_come_later_has_no_contacts(road):
    ctx = road(r=("red", 3, 4), b=("blue", 4, 3))
    ctx.game.step()
    for sides in (("rde", "blue"), ("blue", {"team": "rde", "names": ["r"]})):
        with pytest.raises(UnknownName, match="Unknown team 'rde'"):
            contacts(ctx, *sides)
    assert contacts(ctx, "red", "visitors") == []
    ctx.agent.delete_agent("r")
    ctx.agent.create_agent("n", start_node_id=3, team="reds")
    assert contacts(ctx, "red", "reds") == []


@pytest.mark.parametrize("team", ["drones", "red"])
def test_agents_that_fly_change_nothing_between_those_on_the_ground(road, team):
    ctx = road(r=("red", 3, 4, 5), b=("blue", 4, 3, 3), far=("blue", 9), late=("blue", 8, 7, 6))
    drone = {"type": AgentType.AERIAL, "position": (31.0, 0.0, 9.0), "speed": 20.0, "start_node_id": 3}
    ctx.agent.create_agent("d", team=team, strategy=lambda state: state.update(action=(20.0, 0.0, 0.0)), **drone)
    ctx.game.step()
    assert pairs(ctx) == {("r", "b"): 0.0}
    ctx.game.step()
    assert pairs(ctx) == {}
    ctx.agent.get_agent("r").current_node_id = 6
    assert pairs(ctx) == {("r", "late"): 0.0}


def test_who_was_put_back_has_met_no_agent_on_its_way(road):
    ctx = road(r=("red", 3, 4), b=("blue", 4, 3))
    ctx.game.step()
    ctx.game.respawn("b", 9)
    assert pairs(ctx) == {}


def test_with_a_distance_passing_each_other_counts_only_where_asked_for(road):
    ctx = road(r=("red", 3, 4), b=("blue", 4, 3))
    ctx.game.step()
    assert pairs(ctx, metres=5) == {}
    assert pairs(ctx, metres=5, crossing=True) == {("r", "b"): 0.0}


def test_the_dead_meet_no_agent_and_none_meets_itself(road):
    ctx = road(r=("red", 3), b=("blue", 3))
    assert contacts(ctx, "red", "red", hops=3) == []
    assert {contact[:2] for contact in contacts(ctx, lambda _: True, lambda _: True)} == {("r", "b"), ("b", "r")}
    ctx.game.eliminate("b")
    assert pairs(ctx, hops=9) == {}


def test_sides_are_teams_or_functions_of_an_agent(road):
    ctx = road(a=("red", 3), b=("blue", 3), c=(None, 3))
    (contact,) = contacts(ctx, lambda agent: agent.name == "a", None)
    assert contact[:3] == ("a", "c", 0.0)


def test_draws_of_each_turn_decide_between_equals_and_favour_no_agent(road):
    ctx = road(a=("red", 3), b=("red", 3), z=("blue", 3))
    winners = ""
    for turn in range(400):
        ctx.game.turn = turn
        ((winner, *_),) = one_to_one(contacts(ctx, "red", "blue"))
        winners += winner
    assert 160 < winners.count("a") < 240


def test_the_order_of_two_pairs_does_not_depend_on_who_else_is_there(road):
    def order(**others):
        ctx = road(**dict.fromkeys("abcde", ("red", 3)), z=("blue", 3), **others)
        return [contact.a for contact in contacts(ctx, "red", "blue") if contact.a in "abcde" and contact.b == "z"]

    assert order() == order(aa=("red", 3), y=("blue", 3)) != sorted(order())


@pytest.mark.parametrize("given", [{"hops": -1}, {"metres": float("nan")}, {"hops": 1, "euclid": 2.0}])
def test_impossible_distances_are_refused(road, given):
    with pytest.raises(ValueError, match=r"negative|finite|Give one distance"):
        contacts(road(), "red", "blue", **given)


def test_an_invalid_distance_is_refused(road):
    with pytest.raises(TypeError, match="metres must be a number"):
        contacts(road(), "red", "blue", metres="far")
    with pytest.raises(TypeError, match="crossing must be True or False"):
        contacts(road(), "red", "blue", crossing=1)


@given(
    spots=st.lists(st.tuples(st.integers(0, 12), st.integers(0, 12)), min_size=20, max_size=30),
    limit=st.sampled_from([0.0, 1.0, 2.5, 5.0, 40.0]),
    split=st.integers(1, 19),
)
def test_few_and_many_agents_are_compared_alike(spots, limit, split):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes(range(len(spots)), *zip(*spots, strict=True))
        for number in range(len(spots)):
            ctx.agent.create_agent(f"{number:02}", start_node_id=number, team="red" if number < split else "blue")
        expected = {
            (f"{i:02}", f"{k:02}"): sqrt(sum((p - q) ** 2 for p, q in zip(spots[i], spots[k], strict=True)))
            for i in range(split)
            for k in range(split, len(spots))
            if sum((p - q) ** 2 for p, q in zip(spots[i], spots[k], strict=True)) <= limit * limit
        }
        assert pairs(ctx, euclid=limit) == expected


def test_a_game_caches_near_nodes_for_a_few_distances_alone(road):
    ctx = road(anna=("red", 3), bob=("blue", 4))
    ctx.game.step()
    for metres in range(1, 60):
        assert bool(contacts(ctx, "red", "blue", metres=float(metres))) == (metres >= 10)
    kept = ctx.game.internals.kept["contacts"].near.cache_info()
    assert kept.currsize == kept.maxsize < 59


def test_agents_eliminated_in_this_turn_have_no_contacts(road):
    ctx = road(a=("red", 4, 5), b=("blue", 5, 5), c=("blue", 6, 5), d=("red", 5, 5))
    met = {}

    def rule(ctx):
        met["before"] = [pair[:2] for pair in gamms.rules.contacts(ctx, "red", "blue")]
        ctx.game.eliminate("b")
        ctx.game.eliminate("a")
        met["after"] = [pair[:2] for pair in gamms.rules.contacts(ctx, "red", "blue")]
        met["by a function"] = [
            pair[:2] for pair in gamms.rules.contacts(ctx, lambda agent: agent.name == "d", lambda _: True)
        ]

    ctx.game.add(rule)
    ctx.game.step()
    assert sorted(met["before"]) == [("a", "b"), ("a", "c"), ("d", "b"), ("d", "c")]
    assert met["after"] == [("d", "c")]
    assert met["by a function"] == [("d", "c")]
