"""Resources: what moves, turns and deeds cost, what is refused, how it is recharged; and deeds that cool down."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, Duplicate, UnknownName
from gamms.rules import Conflicts, cooldown, resource
from gamms.scenario import Scenario, ScenarioError


def amounts(ctx, name="fuel"):
    amounts = {agent: ctx.game.facts_of(one)[name] for agent, one in ctx.agent.agents.items() if ctx.game.facts_of(one)}
    assert amounts == ctx.game.data["resources"][name]["amounts"]
    return amounts


def why(ctx, name):
    return ctx.game.observation(name)["blocked"]


def test_a_deed_without_a_price_costs_nothing(road):
    ctx = road(a=("red", 0))
    ctx.game.deeds = {"shoot": None, "wait": None}
    ctx.agent.get_agent("a").register_strategy(lambda state: state.update(action={"do": {"shoot": None, "wait": None}}))
    ctx.game.add(resource("power", 9, per_deed={"shoot": 4}))
    ctx.game.step()
    assert amounts(ctx, "power") == {"a": 5}


def test_a_move_that_needs_more_than_is_left_is_refused_and_costs_nothing(road):
    ctx = road(a=("red", 0, 1, 3, 2))
    ctx.agent.get_agent("a").speed = 2
    ctx.game.add(resource("fuel", 25, per_metre=1))
    ctx.game.run(2)
    assert (amounts(ctx), why(ctx, "a")) == ({"a": 15}, "it needs 20 fuel, and 15 is left")
    ctx.game.step()  # one edge is paid for: 15 - 10
    assert (amounts(ctx), why(ctx, "a"), ctx.agent.get_agent("a").current_node_id) == ({"a": 5}, None, 2)


def test_an_agent_without_anything_left_stays(road):
    ctx = road(a=("red", 0, 1, 2, 3))
    ctx.game.add(resource("fuel", 2, per_turn=1))
    result = ctx.game.run(3)
    assert [(event["turn"], event["kind"]) for event in result.events] == [(2, "empty")]
    assert result.events[0]["resource"] == "fuel"
    assert (result.agents["a"]["node"], why(ctx, "a"), amounts(ctx)) == (2, "its fuel is used up", {"a": 0})


def doing(**deeds):
    """A strategy: what to do in which turn, and to which node to go in all."""
    go = deeds.pop("go", None)

    def strategy(state):
        wanted = {kind: None for kind, turns in deeds.items() if state["turn"] + 1 in turns}
        state["action"] = {"do": wanted} if go is None else {"do": wanted, "node_id": go}

    return strategy


def test_a_move_for_which_deeds_leave_too_little_is_refused(road):
    ctx = road(a=("red", 0))
    ctx.game.deeds = {"shoot": None}
    ctx.agent.get_agent("a").register_strategy(doing(shoot={1}, go=1))
    ctx.game.add(resource("power", 10, per_deed={"shoot": 4}, per_metre=1))
    ctx.game.step()
    assert (amounts(ctx, "power"), why(ctx, "a")) == ({"a": 6}, "it needs 10 power, and 6 is left")


def test_without_an_edge_the_straight_line_counts_and_who_is_stopped_pays_nothing(road):
    ctx = road(a=("red", 0, 7), b=("red", 5, 6), c=("red", 6))
    ctx.game.legal, ctx.game.conflicts = "any", Conflicts(capacity=1)
    ctx.game.add(resource("fuel", 100, per_metre=1, per_turn=2))
    ctx.game.step()
    assert amounts(ctx) == {"a": 28, "b": 98, "c": 98}  # 100 - 70 - 2; b cannot enter the node of c


def test_nothing_is_refused_any_more_when_the_rule_is_removed(road):
    ctx = road(a=("red", 0, 1, 1, 2))
    ctx.game.add(resource("fuel", 0, per_metre=1))
    ctx.game.step()
    assert why(ctx, "a") == "its fuel is used up"
    ctx.game.remove("resource")
    ctx.game.run(1)
    assert ctx.agent.get_agent("a").current_node_id == 1


def test_a_resource_that_is_just_enough_is_enough(road):
    ctx = road(a=("red", 0, 1, 2, 3))
    ctx.game.add(resource("fuel", 0.3, per_edge=0.1))  # 0.3 - 0.1 - 0.1 is less than 0.1
    assert ctx.game.run(3).agents["a"]["node"] == 3
    assert amounts(ctx) == {"a": 0}


@given(
    path=st.lists(st.sampled_from([-1, 0, 1]), max_size=12),
    start=st.integers(0, 60),
    price=st.integers(1, 3),
    per_turn=st.integers(0, 4),
    rates=st.dictionaries(st.integers(0, 9), st.integers(1, 30), max_size=3),
)
def test_amounts_are_those_of_a_loop_that_counts(path, start, price, per_turn, rates):
    def wander(state):
        step = path[state["turn"]] if state["turn"] < len(path) else 0
        state["action"] = min(9, max(0, state["curr_pos"] + step))

    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
        ctx.agent.create_agent("a", start_node_id=5, team="red", strategy=wander)
        ctx.game.add(resource("fuel", start, per_metre=price, per_turn=per_turn, recharge=rates))
        node, left = 5, float(start)
        for step in path:
            ctx.game.step()
            wanted = min(9, max(0, node + step))
            cost = 10 * price * abs(wanted - node)
            if left > 0 and cost <= left:
                node, left = wanted, left - cost
            left = min(start, max(0.0, left - per_turn) + rates.get(node, 0))
            assert (ctx.agent.get_agent("a").current_node_id, amounts(ctx)["a"]) == (node, left)


def test_a_later_agent_knows_its_resources(road):
    ctx = road(a=("red", 0, 1, 2))
    ctx.game.add(resource("fuel", 50, per_metre=1))
    ctx.game.step()
    ctx.agent.create_agent("late", start_node_id=5, team="red")
    assert [ctx.game.observation(name)["facts"]["fuel"] for name in ("a", "late")] == [40, 50]
    ctx.game.step()
    assert amounts(ctx) == {"a": 30, "late": 50}


def test_impossible_resources_are_refused(road):
    for keywords, error, words in (
        ({"start": -1}, BadValue, "start"),
        ({"start": 5, "capacity": 3}, BadValue, "at most the capacity, 3, not 5"),
        ({"start": 5, "per_metre": "2"}, BadType, "per_metre"),
        ({"start": 5, "empty": "explode"}, BadValue, "empty"),
        ({"start": 5, "recharge": {1: -2}}, BadValue, "recharge"),
        ({"start": 5, "per_deed": 3}, BadType, "per_deed"),
    ):
        with pytest.raises(error, match=words):
            resource("fuel", **keywords)
    ctx = road(a=("red", 0))
    with pytest.raises(UnknownName, match="99"):
        ctx.game.add(resource("fuel", 5, recharge={99: 1}))
    with pytest.raises(UnknownName, match=r"deed, as ctx\.game\.deeds declares none: 'shoot'"):
        ctx.game.add(resource("fuel", 5, per_deed={"shoot": 1}))
    ctx.game.add(resource("fuel", 5))
    with pytest.raises(Duplicate, match="fuel"):
        ctx.game.add(resource("fuel", 6), name="more fuel")


# -- cooldown ---------------------------------------------------------------------------------------------------


def test_a_deed_that_was_refused_does_not_start_a_cooldown(road):
    ctx = road(a=("red", 0))
    ctx.game.deeds = {"shoot": None}
    ctx.agent.get_agent("a").register_strategy(doing(shoot=range(1, 11)))
    ctx.game.add(cooldown("shoot", 1))
    ctx.game.add(resource("power", 0, capacity=9, per_deed={"shoot": 4}, recharge={0: 1}))
    # After turn t there is 1 more, up to 4 after turn 4: the first shot is in turn 5, and costs them all but 1.
    assert [deed["turn"] for deed in ctx.game.run(10).deeds] == [5, 9]


def test_impossible_cooldowns_are_refused(road):
    with pytest.raises(BadValue, match="turns"):
        cooldown("shoot", 0)
    with pytest.raises(UnknownName, match="shoot"):
        road(a=("red", 0)).game.add(cooldown("shoot", 2))


WAYS = [  # (id, source, target, length, attributes)
    (0, 0, 1, 10.0, {"taxi": True, "toll": 2.5}),
    (1, 0, 1, 20.0, {"bus": True, "taxi": False}),
    (2, 1, 2, 10.0, {"taxi": 1, "bus": True}),
    (3, 1, 2, 30.0, {"bus": True, "toll": 1}),
    (4, 2, 0, 10.0, {}),
]


def drive_by(ctx, *actions, **options):
    """Build a map with parallel edges, and an agent on node 0 that takes one action after the other."""
    for node, xy in enumerate([(0.0, 0.0), (10.0, 0.0), (5.0, 8.0)]):
        ctx.graph.add_node({"id": node, "x": xy[0], "y": xy[1]})
    for id, source, target, length, attributes in WAYS:
        ctx.graph.add_edge({"id": id, "source": source, "target": target, "length": length, **attributes})
    strategy = lambda state: state.update(action=actions[state["turn"] % len(actions)])
    ctx.agent.create_agent("a", start_node_id=0, team="red", strategy=strategy, **options)


@pytest.fixture
def city():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        yield ctx


@pytest.mark.parametrize(
    ("actions", "options", "left"),
    [
        ([{"edge": 0}, {"edge": 2}, {"edge": 4}], {}, {"taxi": [4, 3, 3], "bus": [5, 4, 4], "toll": [2.5, 2.5, 2.5]}),
        ([{"edge": 1}, {"edge": 3}, 0], {}, {"taxi": [5, 5, 5], "bus": [4, 3, 3], "toll": [5, 4, 4]}),
        ([1, 2, 0], {}, {"taxi": [4, 3, 3], "bus": [5, 4, 4], "toll": [2.5, 2.5, 2.5]}),
        ([1, 2, 2], {"mode": "bus"}, {"taxi": [5, 4, 4], "bus": [4, 3, 3], "toll": [5, 5, 5]}),
        ([2, 2, 2], {"speed": 2}, {"taxi": [3, 3, 3], "bus": [4, 4, 4], "toll": [2.5, 2.5, 2.5]}),
    ],
)
def test_an_edge_costs_the_value_of_its_attribute(city, actions, options, left):
    drive_by(city, *actions, **options)
    for name in left:
        city.game.add(resource(name, 5, per_edge=name))
    found = {name: [] for name in left}
    for _ in actions:
        city.game.step()
        for name, each in found.items():
            each.append(amounts(city, name)["a"])
    assert found == left


def test_by_metres_an_edge_is_paid_where_its_end_is_reached(city):
    city.game.speed_unit = "metres"
    drive_by(city, 1, 0, 2, 2, speed=6)
    city.game.add(resource("toll", 5, per_edge="toll"))
    found = [amounts(city, "toll")["a"] for _ in range(4) if city.game.step() or True]
    assert found == [5, 2.5, 2.5, 2.5]


def test_an_agent_without_tickets_takes_edges_that_cost_nothing(city):
    drive_by(city, {"edge": 0}, {"edge": 2}, {"edge": 4}, {"edge": 0}, {"edge": 1})
    city.game.add(resource("taxi", 2, per_edge="taxi"))
    nodes = []
    for _ in range(5):
        city.game.step()
        nodes.append((city.agent.get_agent("a").current_node_id, why(city, "a")))
    assert nodes == [(1, None), (2, None), (0, None), (0, "its taxi is used up"), (1, None)]


def test_a_price_above_the_amount_is_refused(city):
    drive_by(city, {"edge": 0})
    city.game.add(resource("money", 2, per_edge="toll"))
    city.game.step()
    assert (why(city, "a"), amounts(city, "money")) == ("it needs 2.5 money, and 2 is left", {"a": 2})


def test_an_edge_attribute_that_no_edge_has_or_that_is_no_price_is_refused(city):
    drive_by(city, 1)
    with pytest.raises(UnknownName, match=r"taxy.*taxi"):
        city.game.add(resource("taxi", 5, per_edge="taxy"))
    city.graph.add_edge({"id": 9, "source": 0, "target": 2, "length": 10.0, "taxi": "yes", "toll": -1})
    with pytest.raises(BadValue, match="'taxi' is no price: of edge 9 it is 'yes'"):
        city.game.add(resource("taxi", 5, per_edge="taxi"))
    with pytest.raises(BadValue, match="of edge 9 it is -1"):
        city.game.add(resource("toll", 5, per_edge="toll"))


@pytest.mark.parametrize("actions", [(1, 2, 0), ({"edge": 0}, {"edge": 3}, {"edge": 4})])
def test_edges_cost_the_same_in_batches(city, actions):
    drive_by(city, *actions)
    city.game.add(resource("taxi", 2, per_edge="taxi"))
    city.game.add(resource("toll", 6, per_edge="toll"))
    with city.game.batch(2) as games:
        games.run(7)
        found = [games.result(i) for i in range(2)]
    for seed in range(2):
        city.game.reset(seed=seed)
        alone = city.game.run(7)
        assert (alone.agents, alone.events) == (found[seed].agents, found[seed].events)
        assert alone.events


def test_a_file_names_the_edge_attribute(city, tmp_path):
    drive_by(city, 1)
    city.graph.save(tmp_path / "city.gamms")
    tickets = {"rule": "resource", "with": {"name": "taxi", "start": 2, "per_edge": "taxi"}}
    teams = {
        "red": {
            "agents": [{"name": "a", "node": 0}],
            "strategy": {"function": "gamms.strategies:goto", "with": {"target": 2}},
        }
    }
    spec = {"folder": tmp_path, "map": {"file": "city.gamms"}, "teams": teams, "max_turns": 4}
    game = Scenario(**spec, rules=[tickets])
    events = [(event["turn"], event["kind"]) for event in game.play(seed=1).events]
    assert events == [(2, "empty")]
    with pytest.raises(ScenarioError, match="per_edge"):
        Scenario(**spec, rules=[{**tickets, "with": {**tickets["with"], "per_edge": [1]}}]).build()
