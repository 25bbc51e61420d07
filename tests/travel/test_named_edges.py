"""An agent takes the edge that its action names; of parallel edges, another agent takes the cheapest."""

import io

import numpy as np
import pytest
from shapely.geometry import LineString

import gamms
from gamms import recorder
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.movement.legality import IllegalAction
from gamms.rules import Conflicts
from gamms.scenario import Scenario

ROADS = [  # (id, source, target, length, who may use it)
    (10, 0, 1, 50.0, {"walk": True, "taxi": True}),
    (11, 0, 1, 40.0, {"walk": True}),
    (12, 0, 1, 90.0, {"taxi": True}),
    (13, 1, 0, 50.0, {"walk": True}),
    (14, 1, 2, 50.0, {"walk": True, "taxi": 1}),
    (15, 0, 0, 5.0, {"walk": True, "taxi": True}),
]


def build(ctx, **options):
    """Build a town with parallel edges, and an agent on node 0 that takes the actions of its memory in turn."""
    for node, x in enumerate([0.0, 50.0, 100.0]):
        ctx.graph.add_node({"id": node, "x": x, "y": 0.0})
    for id, source, target, length, modes in ROADS:
        ctx.graph.add_edge({"id": id, "source": source, "target": target, "length": length, **modes})
    ctx.agent.create_agent("ann", start_node_id=0, team="red", **options)


@pytest.fixture
def town():
    """An empty town."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        yield ctx


def act(*actions):
    """Return a strategy that takes one action after the other."""

    def strategy(state):
        state["action"] = actions[state["turn"]]

    return strategy


def seen_edges(ctx):
    """Return the edges that the agents have taken in this turn, as their tracks and visits name them."""
    ids = [id for id, *_ in ROADS]
    legs = [[leg.edge for leg in track.legs] for track in ctx.game.tracks(["ann"])]
    return legs, [visit.edge for visit in ctx.game.visits(edges=ids)]


def test_the_named_edge_is_taken(town):
    build(town, strategy=act({"edge": 12}, 0, {"edge": 10}, {"edge": 14}))
    town.game.step()
    (move,) = town.game.moves.values()
    assert (move.start, move.end, move.path, move.places) == (0, 1, (0, 1), (0, 1))
    assert [(leg.edge, leg.begin, leg.end, leg.since, leg.until) for leg in move.legs] == [(12, 0.0, 1.0, 0.0, 1.0)]
    assert seen_edges(town) == ([[12]], [12])
    assert [(visit.node, visit.time) for visit in town.game.visits()] == [(1, 1.0)]
    found = [seen_edges(town) for _ in range(3) if town.game.step() or True]
    assert found == [([[]], [13]), ([[10]], [10]), ([[14]], [14])]


@pytest.mark.parametrize(("mode", "edge"), [(None, 11), ("walk", 11), ("taxi", 10)])
def test_without_a_named_edge_the_cheapest_is_taken_that_the_mode_may_use(town, mode, edge):
    build(town, strategy=act(1), mode=mode)
    town.game.step()
    assert seen_edges(town) == ([[]], [edge])


@pytest.mark.parametrize(("mode", "legal"), [(None, (10, 11, 12)), ("walk", (10, 11)), ("taxi", (10, 12))])
def test_legal_edges_are_those_that_the_mode_may_use(town, mode, legal):
    seen = []

    def strategy(state):
        seen.append((state["legal_edges"], state.legal_edges, "legal_edges" in state))
        state["action"] = {"edge": state["legal_edges"][-1]}

    build(town, strategy=strategy, mode=mode)
    town.game.step()
    assert seen == [(legal, legal, True)]
    assert seen_edges(town) == ([[legal[-1]]], [legal[-1]])


@pytest.mark.parametrize(
    ("action", "kind", "message"),
    [
        ({"edge": 99}, UnknownName, "99"),
        ({"edge": 14}, BadValue, r"Edge 14 .* begins on node 1, and the agent is on node 0; .* \[10, 12\]"),
        ({"edge": 11}, BadValue, r"Edge 11 .* mode 'taxi' may not use it; .* \[10, 12\]"),
        ({"edge": 15}, BadValue, "leads from node 0 to itself"),
        ({"edge": 10, "node_id": 1}, BadValue, "leave out 'node_id'"),
        ({"edge": "10"}, BadType, "The id of an edge"),
        ({"edge": None}, BadType, "The id of an edge"),
        (
            {"edge": 10, "by": "taxi"},
            UnknownName,
            "Unknown key of an action 'by'. There are: 'node_id', 'edge', 'do', 'orientation'",
        ),
        ({"move": 1, "do": {}}, UnknownName, "Unknown key of an action 'move'"),
    ],
)
def test_errors_name_the_edge_and_the_way_out(town, action, kind, message):
    town.game.on_illegal = "raise"
    build(town, strategy=act(action), mode="taxi")
    with pytest.raises(IllegalAction, match=message) as error:
        town.game.step()
    assert isinstance(error.value.__cause__, kind)


def test_where_agents_may_move_to_any_node_named_edges_are_refused():
    legal = []

    def strategy(state):
        legal.append(state["legal_edges"])
        state["action"] = {"edge": 10}

    with gamms.create_context(seed=1, game={"legal": "any"}, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.game.on_illegal = "raise"
        build(ctx, strategy=strategy)
        with pytest.raises(IllegalAction, match="names an edge, 10, in a game in which agents may move to any node"):
            ctx.game.step()
    assert legal == [()]


@pytest.mark.parametrize("speed", [1, 1.5, 2])
def test_an_agent_with_a_speed_in_edges_takes_the_named_edge_and_stays_at_its_end(town, speed):
    build(town, strategy=act({"edge": 12}, {"edge": 14}, {"edge": 14}), speed=speed)
    town.game.step()
    (move,) = town.game.moves.values()
    assert move.path == (0, 1)
    assert [(leg.edge, leg.begin, leg.end, leg.since, leg.until) for leg in move.legs] == [(12, 0.0, 1.0, 0.0, 1.0)]
    assert seen_edges(town) == ([[12]], [12])
    town.game.step()
    assert seen_edges(town) == ([[14]], [14])


def test_a_slow_agent_is_on_the_edge_that_it_names_when_it_arrives(town):
    build(town, strategy=act({"edge": 12}, {"edge": 12}, {"edge": 14}, 2), speed=0.5)
    found = [seen_edges(town) for _ in range(4) if town.game.step() or True]
    assert found == [([[]], []), ([[12]], [12]), ([[]], []), ([[]], [14])]


def test_an_agent_by_metres_is_on_the_named_edge(town):
    town.game.configure({"speed_unit": "metres"})
    seen = []

    def strategy(state):
        seen.append((state["edge"], round(state["offset_m"], 6), state["legal_edges"]))
        state["action"] = [{"edge": 12}, {"edge": 12}, 1, {"edge": 13}, {"edge": 10}, {"edge": 10}][state["turn"]]

    build(town, strategy=strategy, speed=40)
    legs = []
    for _ in range(6):
        town.game.step()
        (track,) = town.game.tracks(["ann"])
        legs.append([(leg.edge, round(leg.begin, 6), round(leg.end, 6)) for leg in track.legs if leg.begin != leg.end])
    assert seen == [
        (None, 0.0, (10, 11, 12)),
        ((0, 1, 12), 40.0, (12,)),
        ((0, 1, 12), 80.0, (12,)),
        (None, 0.0, (13, 14)),
        ((1, 0, 13), 40.0, (10, 13)),
        (None, 0.0, (13, 14)),
    ]
    assert legs == [
        [(12, 0.0, round(40 / 90, 6))],
        [(12, round(40 / 90, 6), round(80 / 90, 6))],
        [(12, round(80 / 90, 6), 1.0)],
        [(13, 0.0, 0.8)],
        [(13, 0.8, 0.0)],  # it turns around
        [],
    ]
    assert "Edge 10 is not legal: it begins on node 0, and the agent is on node 1" in town.game.errors[0]["message"]


@pytest.mark.parametrize(("speed", "edge"), [(0, None), (None, None), (1000, None), (45, (0, 1, 12))])
def test_an_agent_by_metres_stops_at_the_end_of_the_named_edge(town, speed, edge):
    town.game.configure({"speed_unit": "metres"})
    build(town, strategy=act({"edge": 12}), speed=speed)
    town.game.step()
    ann = town.agent.get_agent("ann")
    assert (ann.edge, ann.current_node_id) == (edge, 1 if speed in (None, 1000) else 0)
    assert seen_edges(town) == ([[12]] if speed != 0 else [[]], [12] if speed != 0 else [])


def test_an_agent_on_an_edge_names_that_edge_or_the_one_back(town):
    town.game.configure({"speed_unit": "metres", "on_illegal": "raise"})
    build(town, strategy=act({"edge": 10}, {"edge": 11}), speed=10)
    town.game.step()
    with pytest.raises(
        IllegalAction, match=r"Edge 11 .* the agent is on edge 10; state\['legal_edges'\] are \[10, 13\]"
    ):
        town.game.step()


def test_agents_that_decide_at_arrivals_name_an_edge_at_each_node(town):
    town.game.configure({"speed_unit": "metres", "decide": "arrival"})

    def strategy(state):
        state["action"] = {"edge": max(state["legal_edges"])} if state["legal_edges"] else state["curr_pos"]

    build(town, strategy=strategy, speed=120)
    town.game.step()
    (track,) = town.game.tracks(["ann"])
    assert [(leg.edge, leg.begin, round(leg.end, 6)) for leg in track.legs] == [(12, 0.0, 1.0), (14, 0.0, 0.6)]


def test_an_agent_stays_whose_named_edge_a_deed_has_closed(town):
    build(town, strategy=act({"edge": 12}))
    town.game.add(lambda ctx: ctx.graph.remove_edge(12), phase="deeds")
    town.game.step()
    assert town.agent.get_agent("ann").current_node_id == 0
    assert seen_edges(town) == ([[]], [])


def test_named_edges_come_with_deeds_headings_and_parts_of_the_turn():
    game = {"deeds": {"wave": None}, "order": [["blue"], ["red"]]}
    with gamms.create_context(seed=1, game=game, logger_config={"level": "CRITICAL"}) as ctx:
        build(ctx, strategy=act({"edge": 10, "do": {"wave": None}, "orientation": (0, 1)}))
        ctx.agent.create_agent("ben", start_node_id=2, team="blue", strategy=act(2))
        ctx.game.step()
        (leg,) = ctx.game.moves["ann"].legs
        assert (leg.edge, leg.since, leg.until) == (10, 0.5, 1.0)
        assert [deed.kind for deed in ctx.game.performed()] == ["wave"]
        assert ctx.agent.get_agent("ann").orientation == (0.0, 1.0)
        assert [(visit.node, visit.edge, visit.time, visit.until) for visit in ctx.game.visits([0, 1], [10])] == [
            (0, None, 0.0, 0.5),
            (None, 10, 0.5, 1.0),
            (1, None, 1.0, 1.0),
        ]


def wander(state):
    """Take any edge of those that are legal."""
    edges = state["legal_edges"]
    state["action"] = {"edge": state["draw"].choice(edges)} if edges else state["curr_pos"]


def tell_edges(ctx):
    """Make an event of each edge that an agent has taken."""
    for visit in ctx.game.visits(edges=[id for id, *_ in ROADS]):
        ctx.game.emit("took", agent=visit.agent, edge=visit.edge)


@pytest.mark.parametrize(
    ("game", "options"),
    [
        ({}, {}),
        ({}, {"mode": "walk"}),
        ({}, {"speed": 2}),
        ({"speed_unit": "metres"}, {"speed": 60}),
        ({"speed_unit": "metres"}, {"speed": 60, "mode": "walk"}),
        ({"speed_unit": "metres", "decide": "arrival"}, {"speed": 60}),
    ],
)
def test_games_of_a_batch_take_the_edges_that_they_take_alone(town, game, options):
    town.game.configure(game)
    build(town, strategy=wander, **options)
    town.agent.create_agent("ben", start_node_id=1, team="blue", strategy=gamms.strategies.random_walk)
    town.game.add(tell_edges)
    alone = []
    with town.game.batch(4) as games:
        games.run(5)
        found = [games.result(i).events for i in range(4)]
        assert "contexts of their own" not in str(games)
    for seed in range(4):
        town.game.reset(seed=seed)
        alone.append(town.game.run(5).events)
    assert found == alone
    assert all(events for events in alone)
    taken = {event["edge"] for events in alone for event in events if event["agent"] == "ann"}
    assert len(taken & {10, 11, 12}) > 1


def test_forks_and_snapshots_take_the_same_edges(town):
    build(town, strategy=wander, mode="walk")
    town.game.add(tell_edges)
    town.game.step()
    before = town.game.snapshot()
    fork = town.game.fork(5)
    assert fork.tracks(["ann"]) == town.game.tracks(["ann"])
    assert seen_edges(fork.ctx) == seen_edges(town) != ([[]], [])
    first = town.game.run(4).events
    town.game.restore(before)
    assert seen_edges(town) == seen_edges(fork.ctx)
    assert town.game.run(4).events == first
    fork.run(4)
    town.game.restore(before)
    other = town.game.fork(5)
    assert other.run(4).events == fork.result().events


# -- recordings -------------------------------------------------------------------------------------------------------


@pytest.fixture
def recorded(town):
    """A recording of two agents that take named edges, one of them with bends, and stay, in a town of two teams."""
    town.graph.add_node({"id": 3, "x": 0.0, "y": 50.0})
    bend = LineString([(0.0, 0.0), (25.0, 30.0), (50.0, 0.0)])
    build(town, strategy=act({"edge": 12}, 0, {"edge": 10}, 1, {"edge": 14}))
    town.graph.graph.update_edge({"id": 12, "source": 0, "target": 1, "length": 90.0, "linestring": bend})
    town.agent.create_agent("ben", start_node_id=1, team="blue", strategy=act({"edge": 13}, {"edge": 11}, 1, 1, 1))
    stream = io.BytesIO()
    town.record.start(stream, sensed=True)
    town.game.run(5)
    town.record.stop()
    return stream.getvalue()


def test_recordings_have_the_edges_that_actions_have_named(recorded):
    with recorder.open(io.BytesIO(recorded)) as recording:
        table = recording.table("edges")
        assert [*zip(*(table[name].tolist() for name in ("turn", "agent", "edge")), strict=True)] == [
            (1, "ann", 12),
            (1, "ben", 13),
            (2, "ben", 11),
            (3, "ann", 10),
            (5, "ann", 14),
        ]
        assert recording.table("edges", start=4)["edge"].tolist() == [14]
        cut = io.BytesIO()
        recording.cut(cut, "blue")
    with recorder.open(io.BytesIO(cut.getvalue())) as recording:
        assert recording.table("edges")["edge"].tolist() == [13, 11]


def test_recordings_by_metres_have_the_edges_and_replays_have_the_same_bytes(town):
    town.game.configure({"speed_unit": "metres"})
    build(town, strategy=act({"edge": 12}, 1, {"edge": 13}, {"edge": 10}, {"edge": 10}), speed=50)
    first, again = io.BytesIO(), io.BytesIO()
    town.record.start(first)
    town.game.run(5)
    town.record.stop()
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.record.start(again)
        for _ in ctx.record.replay(io.BytesIO(first.getvalue())):
            pass
        ctx.record.stop()
    assert again.getvalue() == first.getvalue()
    with recorder.open(io.BytesIO(first.getvalue())) as recording:
        table = recording.table("edges")
        assert table["turn"].tolist() == [3, 4]
        assert table["edge"].tolist() == [13, 10]
        assert recording.table("travel")["edge"].tolist()[0] == 12


def test_a_replay_that_is_recorded_has_the_same_bytes(recorded):
    again = io.BytesIO()
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.record.start(again)
        for _ in ctx.record.replay(io.BytesIO(recorded)):
            pass
        ctx.record.stop()
        assert ctx.game.internals.state.named_edges == {"ann": (5, 14)}
    assert again.getvalue() == recorded


def test_recordings_of_games_whose_actions_name_no_edge_have_no_more_than_before(town):
    build(town, strategy=act(1, 0, 1))
    stream = io.BytesIO()
    town.record.start(stream)
    town.game.run(3)
    town.record.stop()
    stream.seek(0)
    with recorder.open(stream) as recording:
        assert sorted(step["event"] for step in recording.steps()) == ["GAME_TURN", "MOVE", "MOVE", "MOVE"]
        assert "named_edges" not in recording.detached(3).make_keyframe(3)
        assert recording.table("edges")["edge"].tolist() == []


def test_pictures_show_the_agent_on_the_edge(town, recorded):
    town.game.reset()
    town.game.step()
    motion = town.visual.drawing.motion
    motion.begin_turn()
    assert motion.find_position("ann", 0.5) == pytest.approx((25.0, 30.0))
    town.game.step()
    town.game.step()
    motion.begin_turn()
    assert motion.find_position("ann", 0.5) == pytest.approx((25.0, 0.0))
    trail = motion.list_past(3)[-1]
    assert trail.paths.find_points(0.5)[trail.rows["ann"]].tolist() == pytest.approx([25.0, 30.0])


# -- arrays -----------------------------------------------------------------------------------------------------------


@gamms.array_strategy
def wander_in_arrays(view):
    """Take any edge of those that are legal, in some turns."""
    edges = view["legal_edges"]
    counts = (edges >= 0).sum(axis=-1)
    number = view.draw.below(np.maximum(counts, 1))
    chosen = np.take_along_axis(edges, number[..., None], axis=-1)[..., 0] if edges.shape[-1] else number - 1
    view.take_edges(np.where((view.turn[:, None] % 3 < 2) & (counts > 0), chosen, -1))
    return np.minimum(1, view.counts - 1)


KINDS_OF_GAMES = [
    ({}, {}),
    ({}, {"mode": "walk"}),
    ({}, {"speed": 2}),
    ({"speed_unit": "metres"}, {"speed": 60, "mode": "taxi"}),
    ({"speed_unit": "metres"}, {"speed": 30}),
    ({"speed_unit": "metres", "decide": "arrival"}, {"speed": 60}),
]


@pytest.mark.parametrize(("game", "options"), KINDS_OF_GAMES)
def test_array_strategies_take_the_edges_in_a_batch_that_they_take_alone(town, game, options):
    town.game.configure(game)
    build(town, strategy=wander_in_arrays, **options)
    town.agent.create_agent("ben", start_node_id=1, team="blue", strategy=gamms.strategies.random_walk)
    town.game.add(tell_edges)
    with town.game.batch(4) as games:
        games.run(5)
        found = [games.result(i).events for i in range(4)]
        assert "contexts of their own" not in str(games)
    alone = []
    for seed in range(4):
        town.game.reset(seed=seed)
        result = town.game.run(5)
        assert not result.errors
        alone.append(result.events)
    assert found == alone
    assert len({event["edge"] for events in alone for event in events if event["agent"] == "ann"}) > 1


@pytest.mark.parametrize(("game", "options"), KINDS_OF_GAMES)
def test_legal_edges_of_views_are_those_of_states(town, game, options):
    town.game.configure(game)
    build(town, strategy=wander, **options)
    town.graph.remove_edge(11)
    town.agent.create_agent("ben", start_node_id=2, team="red", strategy=gamms.strategies.stay)
    with town.game.batch(3) as games:
        for _ in range(4):
            view = games.observe("red")
            each = [games.context(i).game.observation("ann")["legal_edges"] for i in range(3)]
            assert [tuple(row[row >= 0].tolist()) for row in view["legal_edges"][:, 0]] == each
            assert (view["legal_edges"][:, 1] == -1).all()
            games.step()


@pytest.mark.parametrize(("game", "options"), KINDS_OF_GAMES)
def test_actions_from_outside_name_edges(town, game, options):
    town.game.configure(game)
    build(town, strategy=gamms.strategies.stay, **options)
    town.game.add(tell_edges)
    with town.game.batch(2) as games:
        taken = []
        for _ in range(4):
            legal = games.observe("red")["legal_edges"]
            edges = legal.max(axis=-1, initial=-1)
            edges[0] = -1
            taken.append(edges[1, 0])
            games.step({"red": {"edges": edges}})
        assert "contexts of their own" not in str(games)
        assert games.result(0).events == []
        events = games.result(1).events
        legs = [event["edge"] for event in events]
    assert legs
    assert set(legs) <= set(taken)
    town.game.reset(seed=1)
    town.agent.get_agent("ann").strategy = act(*({"edge": edge} if edge >= 0 else None for edge in map(int, taken)))
    assert town.game.run(4).events == events


def test_games_go_on_by_their_own_strategies_after_edges_were_given(town):
    build(town, strategy=gamms.strategies.random_walk)
    town.game.add(tell_edges)
    stepped, run = [], []
    for play, found in ((lambda games: [games.step() for _ in range(3)], stepped), (lambda games: games.run(3), run)):
        with town.game.batch(2, seed=1) as games:
            games.step({"red": {"edges": [[12], [-1]]}})
            play(games)
            assert games.turn.tolist() == [4, 4]
            found += [games.result(i).events for i in range(2)]
    assert stepped == run
    assert all(run)


@pytest.mark.parametrize("on_illegal", ["raise", "stay"])
def test_actions_from_outside_that_name_an_illegal_edge_are_refused_or_the_agent_stays(town, on_illegal):
    build(town, strategy=gamms.strategies.stay, mode="taxi")
    with town.game.batch(2) as games:
        given = {"red": {"moves": [[1], [0]], "edges": [[-1], [11]]}}
        if on_illegal == "stay":
            games.step(given, on_illegal="stay")
            assert games.observe("red")["curr_pos"].tolist() == [[1], [0]]
            return
        with pytest.raises(BadValue, match=r"agent 'ann' in game 1, turn 0, may not take edge 11; .* are \[10, 12\]"):
            games.step(given)
        with pytest.raises(BadType, match="Edges of team 'red'"):
            games.step({"red": {"edges": [[0.5], [1.0]]}})
        with pytest.raises(BadValue, match="must be ids of edges from 0, or -1 for agents that take none"):
            games.step({"red": {"edges": [[-1], [-2]]}})
        assert games.observe("red")["curr_pos"].tolist() == [[0], [0]]


def test_recordings_of_games_of_a_batch_have_the_edges_that_were_given(town, tmp_path):
    build(town)
    town.graph.save(tmp_path / "town.gamms")
    teams = {"red": {"agents": [{"name": "ann", "node": 0}], "strategy": "gamms.strategies:stay"}}
    scenario = Scenario(map={"file": "town.gamms"}, teams=teams, folder=tmp_path)
    with scenario.batch(2, record=True) as games:
        for edges in ([[12], [-1]], [[13], [-1]], [[10], [11]]):
            games.step({"red": {"edges": edges}})
        for i, taken in enumerate([[12, 13, 10], [11]]):
            games.record(i, tmp_path / f"{i}.ggr")
            with recorder.open(tmp_path / f"{i}.ggr") as recording:
                assert recording.table("edges")["edge"].tolist() == taken


def tell_legs(ctx):
    """Make an event of the legs of each agent."""
    for name, move in ctx.game.moves.items():
        legs = [[leg.edge, leg.begin, leg.end, leg.since, leg.until] for leg in move.legs]
        ctx.game.emit("went", agent=name, legs=legs)


@pytest.mark.parametrize(
    ("game", "looks_ahead"),
    [
        ({}, False),
        ({"order": [["blue"], ["red"]]}, False),
        ({"conflicts": Conflicts(capacity=1, edge_capacity=1)}, False),
        ({"conflicts": Conflicts(capacity=1)}, True),
    ],
)
def test_edges_named_at_arrivals_lead_in_a_batch_where_they_lead_alone(town, game, looks_ahead):
    town.game.configure({"speed_unit": "metres", "decide": "arrival", **game})

    def wander_wildly(state):
        """Take any edge, legal or not, or go to the last legal node."""
        if looks_ahead and state["turn"] > 0 and state["time"] > 0.0:
            state["fork"](7)
        edge = state["draw"].choice([None, 10, 11, *state["legal_edges"]])
        state["action"] = state["legal"][-1] if edge is None else {"edge": edge}

    build(town, strategy=wander_wildly, speed=130)
    town.agent.create_agent("ben", start_node_id=1, team="blue", strategy=wander_wildly, speed=130)
    town.agent.create_agent("cid", start_node_id=2, team="blue", strategy=gamms.strategies.random_walk, speed=200)
    town.game.add(tell_legs)
    with town.game.batch(4) as games:
        games.run(5)
        assert games.is_in_arrays
        found = [games.result(i) for i in range(4)]
    for seed, one in enumerate(found):
        town.game.reset(seed=seed)
        alone = town.game.run(5)
        assert (one.events, one.errors) == (alone.events, alone.errors)
    assert any("Edge 10 is not legal" in error["message"] for one in found for error in one.errors)


def test_an_edge_given_from_outside_counts_at_all_arrivals_of_a_turn_where_it_is_legal(town):
    town.game.configure({"speed_unit": "metres", "decide": "arrival"})

    def change(ctx):
        """Change a setting in some games, which then follow another plan."""
        if ctx.seed % 2 and ctx.game.turn:
            ctx.game.max_turns = 9

    build(town, strategy=gamms.strategies.stay, speed=120)
    town.agent.create_agent("ben", start_node_id=2, team="blue", strategy=gamms.strategies.stay)
    town.game.add(change, phase="before")
    town.game.add(tell_legs)
    with town.game.batch(6) as games:
        for edge in (12, 14, 14):
            games.step({"red": {"edges": [[edge]] * 6}}, on_illegal="stay")
        results = [games.result(i) for i in range(6)]
        assert not games.detached
    legs = [[event["legs"] for event in one.events if event["agent"] == "ann"] for one in results]
    assert legs == [legs[0]] * 6
    assert [[leg[0] for leg in of_turn] for of_turn in legs[0]] == [[12], [14], []]
    assert not any(one.errors for one in results)


def test_views_take_edges_only_while_a_strategy_decides(town):
    build(town, strategy=gamms.strategies.stay)
    with town.game.batch(2) as games, pytest.raises(BadValue, match="only while a strategy decides"):
        games.observe("red").take_edges([[10], [10]])


def wander_by_plan(team):
    """Take the last legal edge in every second turn, else go to any node."""
    edges = team.legal_edges.max(axis=-1, initial=-1)
    nodes = team.choose(team.draw.below(team.counts))
    return {"nodes": nodes, "edges": edges} if team.turn % 2 == 0 else nodes


@pytest.mark.parametrize(("game", "options"), KINDS_OF_GAMES)
def test_plans_of_arrays_name_edges_in_a_batch_as_alone(town, game, options):
    town.game.configure(game)
    build(town, **options)
    town.agent.create_agent("amy", start_node_id=1, team="red")
    town.game.command("red", wander_by_plan, arrays=True)
    town.game.add(tell_edges)
    with town.game.batch(3) as games:
        games.run(4)
        found = [games.result(i).events for i in range(3)]
    alone = []
    for seed in range(3):
        town.game.reset(seed=seed)
        result = town.game.run(4)
        assert not result.errors
        alone.append(result.events)
    assert found == alone
    first = {event["agent"]: event["edge"] for event in alone[0] if event["turn"] == 1}
    assert first == {"ann": {None: 12, "walk": 11, "taxi": 12}[options.get("mode")], "amy": 14}


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({"edges": [0.5]}, "The edges of a plan"),
        ({"edge": [12]}, "Unknown key of the answer of a plan of arrays 'edge'. Did you mean 'edges'?"),
        ({"nodes": [1, 2]}, "one node for each agent"),
    ],
)
def test_wrong_answers_of_plans_of_arrays_are_errors(town, answer, message):
    build(town)
    town.game.on_error = "stay"
    town.game.command("red", lambda team: answer, arrays=True)
    (error,) = town.game.run(1).errors
    assert message in error["message"]


def test_an_illegal_edge_of_a_plan_of_arrays_is_an_illegal_action(town):
    build(town, mode="taxi")
    town.game.command("red", lambda team: {"edges": [11]}, arrays=True)
    (error,) = town.game.run(1).errors
    assert (error["kind"], error["agent"]) == ("illegal", "ann")
    assert "Edge 11 is not legal" in error["message"]


def take_any(state):
    """Take a legal edge, or now and then any edge."""
    edges = state["legal_edges"]
    is_any = not edges or state["draw"].random() < 0.3
    state["action"] = {"edge": state["draw"].choice([10, 11, 12, 13, 14, 15, 99] if is_any else edges)}


@gamms.array_strategy
def take_any_in_arrays(view):
    """Take a legal edge, or now and then any edge."""
    edges = np.array([10, 11, 12, 13, 14, 15, 99])[view.draw.below(np.full(view.node.shape, 7))]
    legal = view["legal_edges"].max(axis=-1, initial=-1)
    view.take_edges(np.where(view.draw.below(np.full(view.node.shape, 4)) > 0, legal, edges))
    return np.minimum(1, view.counts - 1)


def tell_fuel(ctx):
    """Make an event of the fuel that agents have left."""
    ctx.game.emit("fuel", left=dict(ctx.game.data["resources"]["fuel"]["amounts"]))


def close_or_change(ctx):
    """Close an edge in the third turn, and change a setting in one game."""
    if ctx.game.turn == 2 and not ctx.graph.closed_roads:
        ctx.graph.close_roads([12])
    if ctx.game.turn == 4 and ctx.seed == 1:
        ctx.game.max_turns = 8


@pytest.mark.parametrize(("game", "options"), KINDS_OF_GAMES)
@pytest.mark.parametrize(("strategy", "order"), [(take_any, None), (take_any_in_arrays, None), (take_any, True)])
def test_named_edges_of_a_batch_are_charged_closed_and_refused_as_alone(town, game, options, strategy, order):
    town.game.configure({**game, "order": [["blue"], ["red"]] if order else None, "on_illegal": "stay"})
    build(town, strategy=strategy, **options)
    for id, source, target, length, _ in ROADS:
        town.graph.graph.update_edge({"id": id, "source": source, "target": target, "length": length, "fare": id - 9})
    town.agent.create_agent("amy", start_node_id=1, team="red", strategy=strategy)
    town.agent.create_agent("ben", start_node_id=1, team="blue", strategy=gamms.strategies.random_walk)
    town.game.add(gamms.rules.resource("fuel", 14, per_edge="fare", teams=["red"]))
    town.game.add(close_or_change, phase="deeds")
    town.game.add(tell_edges)
    town.game.conflicts = gamms.rules.Conflicts(capacity=1)
    town.game.add(tell_fuel)
    told = ("events", "errors")
    with town.game.batch(4) as games:
        games.run(8)
        found = [[getattr(games.result(i), name) for name in told] for i in range(4)]
        assert not games.detached
        assert games.context(1).game.turn == 8
    for seed in range(4):
        town.game.reset(seed=seed)
        result = town.game.run(8)
        assert found[seed] == [getattr(result, name) for name in told]
    assert found[0][1]
