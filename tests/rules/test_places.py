"""Places that teams hold for some turns, and nodes that they discover."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.agent import AgentType
from gamms.errors import BadType, BadValue, Duplicate, UnknownName
from gamms.rules import discover, hold, tag


def count(ctx, key="hold"):
    state = ctx.game.data["held"][key]
    return state["team"], state["turns"]


def test_a_team_that_holds_a_node_long_enough_wins(road):
    ctx = road(a=("red", 3, 4, 4, 4), b=("blue", 9))
    ctx.game.add(hold(4, 3, score=5))
    result = ctx.game.run(9)
    assert (result.turns, result.winner, result.reason) == (3, "red", "red held its place")
    assert (result.events, result.scores) == ([{"turn": 3, "kind": "hold", "team": "red", "turns": 3}], {"red": 5})


def test_agents_may_relieve_each_other_on_any_of_the_nodes(road):
    ctx = road(a=("red", 3, 4, 3), a2=("red", 6, 6, 5, 5))
    ctx.game.add(hold([4, 5], 3))
    result = ctx.game.run(9)
    assert (result.turns, result.scores) == (3, {})


def test_a_place_that_changes_hands_is_counted_from_the_start(road):
    ctx = road(a=("red", 4, 4, 4, 3), b=("blue", 6, 5, 4, 4))
    ctx.game.add(hold(4, 9))
    ctx.game.run(3)
    assert count(ctx) == ("blue", 1)


def test_every_node_may_be_needed(road):
    ctx = road(a=("red", 4), a2=("red", 7, 6, 5, 5))
    ctx.game.add(hold([4, 5], 2, every=True))
    assert ctx.game.run(9).turns == 3


def test_the_dead_flyers_and_agents_of_no_team_neither_hold_nor_contest(road):
    ctx = road(a=("red", 4), nobodys=(None, 4), dead=("blue", 4))
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, team="blue", start_node_id=4, speed=1.0)
    ctx.game.eliminate("dead")
    ctx.game.add(hold(4, 2))
    assert (ctx.game.run(9).turns, ctx.game.over["winner"]) == (2, "red")


def test_points_may_be_given_again_and_again(road):
    ctx = road(a=("red", 4))
    ctx.game.add(hold(4, 1, score=1, ends=False))
    ctx.game.add(hold(4, 3, score=10, ends=False, key="long"))
    assert ctx.game.run(7).scores == {"red": 7 + 2 * 10}


def test_only_some_teams_may_hold_and_all_contest(road):
    ctx = road(a=("red", 4, 4, 3), b=("blue", 4))
    ctx.game.add(hold(4, 2, teams="red"))
    assert ctx.game.run(4).reason == "max_turns"
    assert count(ctx) == (None, 0)


def test_a_tag_counts_before_the_place_whichever_rule_was_added_first(road):
    for order in (1, -1):
        ctx = road(a=("red", 4), b=("blue", 5, 4))
        for rule in [tag("blue", "red", then="eliminate"), hold(4, 1)][::order]:
            ctx.game.add(rule)
        assert (ctx.game.run(9).turns, ctx.game.over["winner"]) == (1, "blue")


teams_there = st.lists(st.lists(st.sampled_from(["red", "blue", "green"]), max_size=2), min_size=1, max_size=10)


@given(teams_there=teams_there, turns=st.integers(1, 3))
def test_holding_is_that_of_a_loop_that_counts(teams_there, turns):
    def stand(state):
        wanted = teams_there[state["turn"]] if state["turn"] < len(teams_there) else []
        state["action"] = 1 if state["team"] in wanted else 0

    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3))
        for team in ("red", "blue", "green"):
            ctx.agent.create_agent(team, start_node_id=0, team=team, strategy=stand)
        ctx.game.add(hold(1, turns, score=1, ends=False))
        result = ctx.game.run(len(teams_there))
    holder, held, scores = None, 0, {}
    for there in map(set, teams_there):
        if holder not in there:
            holder, held = None, 0
        if len(there) == 1:
            holder, held = next(iter(there)), held + 1
            if held == turns:
                scores[holder], held = scores.get(holder, 0) + 1, 0
    assert result.scores == scores


def test_impossible_places_are_refused(road):
    for call, error, words in (
        (lambda: hold([], 3), BadValue, "A node to hold"),
        (lambda: hold(4, 0), BadValue, "turns"),
        (lambda: hold("4", 2), BadType, "A node to hold"),
        (lambda: hold(4, 2, ends="yes"), BadType, "ends"),
        (lambda: discover([]), BadValue, "A node to discover"),
        (lambda: discover({4: object()}), BadType, "plain"),
    ):
        with pytest.raises(error, match=words):
            call()
    ctx = road(a=("red", 0))
    for rule in (hold(99, 2), discover([3, 99])):
        with pytest.raises(UnknownName, match="99"):
            ctx.game.add(rule)
    ctx.game.add(hold(4, 2))
    with pytest.raises(Duplicate, match="hold"):
        ctx.game.add(hold(5, 2))


# -- discover ---------------------------------------------------------------------------------------------------


def with_eyes(ctx, kind="range", metres=20.0, **agents):
    for name in agents or ctx.agent.agents:
        sensor = ctx.sensor.create_sensor(f"{kind} of {name}", kind, sensor_range=metres)
        ctx.agent.get_agent(name).register_sensor(sensor.sensor_id, sensor)
    return ctx


def test_discoveries_of_a_team_in_one_turn_are_counted_once_and_shared(road):
    ctx = with_eyes(road(a=("red", 3), b=("red", 5)))
    ctx.graph.add_nodes([10], [40.0], [0.0])  # where node 4 is
    ctx.game.add(discover([1, 4, 7, 10]))
    events = ctx.game.run(1).events
    assert [(event["agent"], event["node"]) for event in events] == [("a", 1), ("a", 4), ("a", 10), ("b", 7)]
    assert [*ctx.game.facts_of("red")["discovered"]] == [1, 4, 7, 10]


def test_without_sensors_an_agent_sees_its_own_node(road):
    ctx = road(a=("red", 0, 1, 2), nobodys=(None, 1))
    ctx.game.add(discover([1], teams="red"))
    assert [event["turn"] for event in ctx.game.run(2).events] == [1]


def test_agents_of_no_team_and_of_other_teams_discover_nothing(road):
    ctx = road(a=("red", 0, 1), b=("blue", 1), nobodys=(None, 1))
    ctx.game.add(discover([1], teams="red"))
    ctx.game.add(discover([1], key="seen by all"))
    seen = ctx.game.run(1).events
    assert [(event["agent"], event["first"]) for event in seen] == [("a", True), ("a", True), ("b", True)]


def test_agents_on_the_ground_may_see_some_edges_ahead(road):
    ctx = road(a=("red", 2, 3))
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, team="blue", start_node_id=6, speed=1.0)
    ctx.game.add(discover([5, 6, 7], hops=2))
    ctx.game.run(2)
    assert [ctx.game.facts_of(team) for team in ("red", "blue")] == [{"discovered": {5: True}}, {}]


def test_neighbours_and_fields_of_view_count_and_the_dead_see_nothing(road):
    ctx = with_eyes(road(a=("red", 3), dead=("blue", 3)), "neighbor", a=1)
    with_eyes(ctx, "map", dead=1)
    ctx.game.eliminate("dead")
    ctx.game.add(discover([2, 5]))
    ctx.game.step()
    assert [ctx.game.facts_of(team) for team in ("red", "blue")] == [{"discovered": {2: True}}, {}]
    assert ctx.game.facts == {"discovered": {}}
