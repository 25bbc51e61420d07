"""The set of nodes on which a target can be holds the one on which it is, and no more than was seen allows."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import belief
from gamms.errors import BadType, UnknownName
from gamms.sensor import SensorType

SPEEDS = st.one_of(st.none(), st.integers(0, 3).map(float), st.floats(0.1, 3.0))


@st.composite
def worlds(draw):
    nodes = draw(st.integers(2, 7))
    node, coordinate = st.integers(0, nodes - 1), st.floats(0, 30)
    return {
        "places": draw(st.lists(st.tuples(coordinate, coordinate), min_size=nodes, max_size=nodes)),
        "edges": draw(st.lists(st.tuples(node, node, st.floats(0.5, 9.0)), max_size=14)),
        "starts": draw(st.lists(node, min_size=3, max_size=3)),
        "speed": draw(SPEEDS),
        "unit": draw(st.sampled_from(["edges", "metres"])),
        "decide": draw(st.sampled_from(["turn", "arrival"])),
        "paces": draw(st.lists(SPEEDS, min_size=2, max_size=2)),
        "sights": draw(st.lists(st.floats(0, 25), min_size=2, max_size=2)),
        "detection": draw(st.sampled_from([None, 0.5, ((0.0, 1.0), (12.0, 0.0))])),
        "fov": draw(st.sampled_from([None, 0.8, 2.0])),
        "is_one_sensor": draw(st.booleans()),
        "changes": draw(st.dictionaries(st.integers(0, 7), st.tuples(node, node, st.floats(0.5, 9.0)), max_size=5)),
        "phase": draw(st.sampled_from(["before", "deeds", "after"])),
        "order": draw(st.sampled_from([None, [["a"], ["b"]], [["b"], ["a"]]])),
        "respawns": draw(st.sets(st.integers(0, 7), max_size=2)),
        "out": draw(st.sets(st.integers(0, 7), max_size=1)),
        "skips": draw(st.sets(st.integers(0, 7), max_size=3)),
        "share": draw(st.booleans()),
        "horizon": draw(st.integers(1, 6)),
        "seed": draw(st.integers(0, 1000)),
    }


def rover(state):
    """Go somewhere else or the same way on, as far as the speed allows, so that parts of edges count."""
    memory, draw = state["memory"], state["draw"]
    if memory.get("goal") in (None, state["curr_pos"]) or draw.random() < 0.3:
        memory["goal"] = draw.choice(state["legal"])
    stops = state.get("edge") is not None and draw.random() < 0.1
    state["action"] = None if stops else memory["goal"]


def changing(world):
    """A rule that closes an edge where there is one between two nodes, and opens one where there is none."""

    def change(ctx):
        turn, graph = ctx.game.turn, ctx.graph.graph
        if turn in world["changes"]:
            source, target, length = world["changes"][turn]
            between = [
                id for id in graph.get_edges() if (e := graph.get_edge(id)).source == source and e.target == target
            ]
            for id in between:
                graph.remove_edge(id)
            if not between:
                graph.add_edge({"id": 1000 + turn, "source": source, "target": target, "length": length})
        if turn in world["out"]:
            ctx.game.eliminate("prey")
        if turn in world["respawns"]:
            ctx.game.respawn("prey")

    return change


@settings(max_examples=16)
@given(world=worlds())
def test_the_truth_is_always_in_the_set(world):
    with gamms.create_context(seed=world["seed"], logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes(range(len(world["places"])), *zip(*world["places"], strict=True))
        for id, (source, target, length) in enumerate(world["edges"]):
            ctx.graph.graph.add_edge({"id": id, "source": source, "target": target, "length": length})
        ctx.game.speed_unit, ctx.game.on_illegal = world["unit"], "stay"
        ctx.game.decide = world["decide"] if world["unit"] == "metres" else "turn"
        checked = []

        def watch(state):
            state["action"] = state["draw"].choice(state["legal"])
            if state["turn"] in world["skips"] and not world["changes"]:  # edges that come and go would be missed
                return
            known = belief.observe(ctx, state, share=world["share"], horizon=world["horizon"])
            prey = ctx.agent.get_agent("prey")
            where = prey.current_node_id if prey.alive else None
            checked.append((known.turn, known.reachable("prey"), where))

        ctx.game.add(changing(world), phase=world["phase"])
        ctx.agent.create_agent("prey", start_node_id=world["starts"][0], team="a", strategy=rover)
        if world["speed"] is not None:
            ctx.agent.get_agent("prey").speed = world["speed"]
        for i, sight in enumerate(world["sights"]):
            options = {"sensor_range": sight, "detection": world["detection"]}
            kind = SensorType.AGENT_RANGE if world["fov"] is None else SensorType.AGENT_ARC
            if kind is SensorType.AGENT_ARC:
                options["fov"] = world["fov"]
            if i == 0 or not world["is_one_sensor"]:
                eyes = ctx.sensor.create_sensor(f"eyes {i}", kind, **options)
            start = world["starts"][i + 1]
            watcher = {"team": "b", "sensors": {"eyes": eyes}, "strategy": watch, "speed": world["paces"][i]}
            ctx.agent.create_agent(f"w{i}", start_node_id=start, **watcher)
        ctx.game.order = world["order"]
        ctx.game.run(9)
        for turn, reachable, where in checked:
            assert where in reachable or (where is None and not reachable), turn


def watching(ctx, found, name="prey"):
    def watch(state):
        found.append(belief.observe(ctx, state).reachable(name))
        state["action"] = state["curr_pos"]

    return watch


def test_an_edge_that_was_closed_at_the_first_node_counts_as_any_other(make_ctx, add):
    ctx, found = make_ctx(4), []
    add(ctx, "spy", 1, "red", sight=0.0, strategy=watching(ctx, found))
    add(ctx, "prey", 1, "blue", strategy=lambda state: state.update(action=0))

    @ctx.game.add(phase="before")
    def close(ctx):
        if ctx.game.turn == 1:
            for id in (0, 1):  # between nodes 0 and 1
                ctx.graph.graph.remove_edge(id)

    ctx.game.run(2)
    assert found == [{1}, {0, 2}]


def test_a_target_that_cannot_be_anywhere_is_looked_for_everywhere(make_ctx, add):
    ctx, found = make_ctx(4), []
    add(ctx, "spy", 0, "red", sight=10.0, strategy=watching(ctx, found))
    add(ctx, "prey", 0, "blue")
    ctx.game.run(1)
    ctx.agent.get_agent("prey").current_node_id = 3
    ctx.game.run(1)
    assert found == [{0}, {2, 3}]


def test_where_moves_need_no_edges_all_that_is_not_in_sight_can_be_reached(make_ctx, add):
    ctx, found = make_ctx(4, edges=[], game={"legal": "any"}), []
    add(ctx, "spy", 0, "red", sight=10.0, strategy=watching(ctx, found))
    add(ctx, "prey", 0, "blue", strategy=lambda state: state.update(action=3))
    ctx.game.run(2)
    assert found == [{0}, {2, 3}]


def test_a_sensor_that_may_miss_agents_or_ignores_their_team_clears_nothing(make_ctx, add):
    for option in ({"detection": 0.9}, {"team": "green"}):
        ctx, found = make_ctx(3), []
        add(ctx, "spy", 0, "red", strategy=watching(ctx, found))
        eyes = ctx.sensor.create_sensor("tower", SensorType.AGENT_RANGE, sensor_range=50.0, **option)
        ctx.agent.get_agent("spy").register_sensor("tower", eyes)
        add(ctx, "prey", 2, "blue")
        ctx.game.run(1)
        assert len(found[0]) in (1, 3)
        assert 2 in found[0]


def test_agents_that_are_dead_fly_or_are_unknown(make_ctx, add):
    ctx = make_ctx(3)
    add(ctx, "spy", 0, "red")
    add(ctx, "prey", 1, "blue").alive = False
    ctx.agent.create_agent("drone", type=gamms.agent.AgentType.AERIAL, start_node_id=0, speed=1.0)
    known = belief.belief_of(ctx, "spy")
    assert known.reachable("prey") == set()
    assert known.probability("prey") == {}
    with pytest.raises(BadType, match="'drone' flies"):
        known.reachable("drone")
    with pytest.raises(UnknownName, match="nobody"):
        known.probability("nobody")
    for asked in (known.are_reachable, known.probabilities):
        with pytest.raises(BadType, match="targets must be a list of names, not 'prey'"):
            asked("prey")


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
@pytest.mark.parametrize("order", [None, [["red"], ["blue"]], [["blue"], ["red"]]])
def test_an_agent_that_was_respawned_is_no_longer_believed_where_it_was_seen(make_ctx, add, phase, order):
    ctx, checked = make_ctx(40), []

    def watch(state):
        known, node = belief.observe(ctx, state), ctx.agent.get_agent("prey").current_node_id
        checked.append((node in known.reachable("prey"), known.probability("prey").get(node, 0.0) > 0.0))
        state["action"] = state["curr_pos"]

    def put(ctx):
        if ctx.game.turn in (3, 9):
            ctx.game.respawn("prey")

    add(
        ctx, "spy", 14, "red", sight=25.0, strategy=watch
    )  # who sees the prey on nodes 12 to 16, also when it is put back
    add(ctx, "prey", 10, "blue", strategy=lambda state: state.update(action=state["curr_pos"] + 1))
    ctx.game.order = order
    ctx.game.add(put, phase=phase)
    ctx.game.run(14)
    assert checked == [(True, True)] * 14
