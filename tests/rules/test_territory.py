"""Whose ground a node is."""

import pytest

from gamms.rules import territory


def test_every_node_goes_to_the_nearest_base(road):
    ctx = road()
    whose = territory.by_distance(ctx, {"red": 1, "blue": 6})
    assert whose == {node: "red" if node <= 3 else "blue" for node in range(10)}
    assert territory.by_distance(ctx, {"red": [1, 9], "blue": 5})[8] == "red"


def test_equally_near_teams_are_taken_by_text(road):
    assert territory.by_distance(road(), {"red": 0, "blue": 8})[4] == "blue"
    assert territory.by_distance(road(), {"b": 0, "c": 8}, weight=None)[4] == "b"


def test_a_node_that_no_way_joins_to_a_base_has_no_owner(road):
    ctx = road()
    ctx.graph.add_nodes([10, 11], [200, 210], [0, 0])
    ctx.graph.add_edges([90], [11], [9], [5.0])  # one way only
    whose = territory.by_distance(ctx, {"red": 0})
    assert 10 not in whose
    assert whose[11] == "red"


def test_halves_have_as_many_nodes(road):
    ctx = road(r=("red", 0), b=("blue", 9), nobodys=(None, 3))
    assert territory.halves(ctx) == {node: "blue" if node < 5 else "red" for node in range(10)}
    assert territory.halves(ctx, teams=("red", "blue"))[0] == "red"
    assert set(territory.halves(ctx, "y").values()) == {"red"}  # all are on the line


def test_a_published_territory_is_a_fact(road):
    ctx = road()
    ctx.game.add(territory.published({1: "red"}, "ground"))
    assert ctx.game.facts["ground"] == {1: "red"}
    ctx.game.run(1)
    assert ctx.game.facts["ground"] == {1: "red"}


def test_a_published_territory_may_be_called_by_another_rule(road):
    ctx = road()
    rule = territory.published({1: "red"})
    ctx.game.add(lambda ctx: rule(ctx))  # noqa: PLW0108 - another rule
    ctx.game.run(1)
    assert ctx.game.facts["territory"] == {1: "red"}


def test_impossible_arguments_are_refused(road):
    ctx = road(r=("red", 1))
    with pytest.raises(ValueError, match=r"teams are \['red'\]"):
        territory.halves(ctx)
    with pytest.raises(ValueError, match="axis must be"):
        territory.halves(ctx, "z")
    with pytest.raises(KeyError, match="node"):
        territory.by_distance(ctx, {"red": 77})
    with pytest.raises(TypeError, match="bases has 1, which must be a pair"):
        territory.by_distance(ctx, [1, 2])
    with pytest.raises(TypeError, match="territory must be a mapping"):
        territory.published([1, 2])
