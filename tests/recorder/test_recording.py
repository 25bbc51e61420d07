"""`gamms.recorder.open`: any state, events and tables of a recording, without a context."""

import copy
import io
import pickle

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from recordings import written
from test_event_kinds import programmes

import gamms
from gamms import recorder
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir import events as kinds
from gamms.recorder import Recording, RecordingError, Writer
from gamms.recorder.detached import DetachedState
from gamms.recorder.keyframes import capture_state

QUIET = {"level": "CRITICAL"}
NODES = 9


def context(seed=1):
    ctx = gamms.create_context(seed=seed, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
    return ctx


def wander(state):
    ways = state["legal"]
    state["action"] = ways[(state["turn"] * 7 + state["curr_pos"]) % len(ways)]


def fly(state):
    state["action"] = (1.0, 2.0, 0.5)


def tag(ctx):
    """Now and then: an event, a point, something to remember, an end."""
    if ctx.game.turn % 3 == 0:
        ctx.game.emit("tagged", agent="anna", by="bert", node=ctx.agent.get_agent("anna").current_node_id)
        ctx.game.scores["red"] = ctx.game.scores.get("red", 0) + 2
        ctx.game.data["last"] = {"turn": ctx.game.turn}
    if ctx.game.turn == 4:
        ctx.game.eliminate("bert")


def played(turns=8, **options):
    """The bytes of a game, its result, and the state of the context after each turn."""
    with context() as ctx:
        ctx.agent.create_agent("anna", start_node_id=0, team="red", sensors=["near"], strategy=wander)
        ctx.agent.create_agent("bert", start_node_id=4, team="blue", strategy=wander)
        ctx.agent.create_agent("kite", start_node_id=8, type=1, speed=5.0, strategy=fly)
        ctx.game.scores["red"] = 1
        stream, states = io.BytesIO(), []
        ctx.record.start(stream, sensed=False, **options)
        ctx.game.add(tag)
        ctx.visual.after_turn.append(lambda: states.append(capture_state(ctx)))
        states.append(capture_state(ctx))
        ctx.record.event("hello", words=["a", 1])
        result = ctx.game.run(max_turns=turns)
        ctx.record.stop()
        return stream.getvalue(), result, states


@pytest.fixture(scope="module")
def game():
    return played()


@pytest.fixture
def rec(game):
    return recorder.open(io.BytesIO(game[0]))


def as_lists(table):
    return {name: column.tolist() for name, column in table.items()}


# -- states -----------------------------------------------------------------------------------------------------


def test_turns_are_asked_for_in_any_order(rec, game):
    fresh = [recorder.open(io.BytesIO(game[0])).state(turn).agents["node"].tolist() for turn in range(9)]
    for turn in (8, 0, 3, 2, 7, 7, 4):
        assert rec.state(turn).turn == turn
        assert rec[turn].agents["node"].tolist() == fresh[turn]
    assert [state.turn for state in rec[2:5]] == [2, 3, 4]
    assert [state.turn for state in rec[::-4]] == [8, 4, 0]
    assert rec[-1].turn == 8
    assert rec[-9].turn == 0


@pytest.mark.parametrize("turn", [9, -10, 2**70])
def test_a_turn_that_is_not_there_is_refused(rec, turn):
    with pytest.raises(BadValue, match=r"8 turns|64 bits"):
        rec[turn]
    for call in (rec.state, rec.map_at, rec.map_hash):
        with pytest.raises(BadValue):
            call(turn)
    with pytest.raises(BadValue):
        rec.state(-1)
    with pytest.raises(BadType):
        rec.state("1")


def test_events_after_the_last_turn_are_not_a_turn():
    with context() as ctx:
        ctx.agent.create_agent("anna", start_node_id=0, strategy=wander)
        stream = io.BytesIO()
        ctx.record.start(stream)
        ctx.game.run(max_turns=2)
        ctx.record.event("late")
        ctx.agent.get_agent("anna").current_node_id = 8
        ctx.record.stop()
    rec = recorder.open(io.BytesIO(stream.getvalue()))
    assert (rec.turns, len(list(rec.logs()))) == (2, 3)
    assert list(rec.events()) == [{"turn": 3, "kind": "late"}]
    assert rec[-1].agents["node"].tolist() != [8]


# -- what happened ----------------------------------------------------------------------------------------------


def test_each_table_has_its_columns(rec):
    assert as_lists(rec.table("hello")) == {"turn": [1], "words": [["a", 1]]}
    assert as_lists(rec.table("scores")) == {"turn": [3, 6], "of": ["red", "red"], "score": [3, 5]}
    positions = rec.table("positions")
    assert positions["turn"].tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    assert set(positions["agent"]) == {"kite"}
    assert positions["z"].dtype == np.float64
    assert as_lists(rec.table("hello", 2)) == {"turn": []}
    with pytest.raises(UnknownName, match="Did you mean 'tagged'"):
        rec.table("taged")


@settings(deadline=None)
@example(start=None, stop=1)
@example(start=1, stop=2)
@given(start=st.none() | st.integers(0, 12), stop=st.none() | st.integers(0, 12))
def test_a_range_of_turns_equals_a_filter(game, start, stop):
    rec = recorder.open(io.BytesIO(game[0]))

    def is_in(turn):
        return (start or 0) <= turn and (stop is None or turn < stop)

    for name in ("events", "moves", "positions", "scores", "tagged"):
        whole, part = as_lists(rec.table(name)), as_lists(rec.table(name, start, stop))
        rows = [i for i, turn in enumerate(whole["turn"]) if is_in(turn)]
        if rows:
            assert part == {key: [values[i] for i in rows] for key, values in whole.items()}
        assert part["turn"] == [whole["turn"][i] for i in rows]
    assert list(rec.events(start, stop)) == [event for event in rec.events() if is_in(event["turn"])]
    assert list(rec.logs(start, stop)) == [log for turn, log in enumerate(rec.logs(), 1) if is_in(turn)]


def test_negative_turns_are_refused_in_ranges(rec):
    for call in (rec.events, rec.logs, lambda *turns: rec.table("moves", *turns)):
        with pytest.raises(BadValue, match="counted from 1"):
            call(-1)


def test_kinds_are_counted_by_name(rec):
    counts = rec.counts()
    assert counts["USER_EVENT"] == 1
    assert counts["GAME_EVENT"] == 3
    assert counts["AERIAL_AGENT_POSITION"] == 8


# -- agents who come and go ------------------------------------------------------------------------------------


def blank(agents):
    """A keyframe of agents 0, 1, …, of whom every third flies."""
    kinds = np.arange(agents) % 3 // 2
    return {
        "names": [f"a{i}" for i in range(agents)],
        "numbers": np.arange(agents),
        "next": agents,
        "kind": kinds,
        "node": np.arange(agents) % NODES,
        "previous": np.arange(agents) % NODES,
        "heading": np.full((agents, 2), np.nan),
        "position": np.where(kinds[:, None] > 0, 0.0, np.full((agents, 3), np.nan)),
        "previous_position": np.full((agents, 3), np.nan),
        "quat": np.full((agents, 4), np.nan),
        "alive": np.ones(agents, np.int64),
        "teams": [None] * agents,
        "speed": [None] * agents,
        "sensors": [{} for _ in range(agents)],
        "attributes": [{} for _ in range(agents)],
        "strategies": [None] * agents,
        "scores": [],
        "data": {},
        "over": None,
    }


@settings(deadline=None)
@given(programmes(), st.integers(1, 9), st.integers(1, 4), st.data())
def test_many_moves_at_once_equal_single_moves(events, most, turns, data):
    with context() as ctx:
        begin = capture_state(ctx)
    game = []
    for number, (kind, what) in enumerate(events):
        if number % most == 0:
            game.append([])
        game[-1] += what if kind == kinds.MOVES else [(kind, what)]
    stream = io.BytesIO()
    writer = Writer(stream, {"world": b""}, turns=turns)
    writer.keyframe(begin)
    for log in game:
        writer.add_turn(log)
    writer.close()
    rec = recorder.open(io.BytesIO(stream.getvalue()))
    one_by_one = DetachedState(copy.deepcopy(begin))
    stops = data.draw(st.lists(st.integers(0, len(game)), max_size=4))
    for turn in range(len(game) + 1):
        if turn:
            one_by_one.apply(game[turn - 1])
        if turn in stops or turn == len(game):
            state = rec.detached(turn)
            np.testing.assert_equal(state.agents.columns, one_by_one.agents.columns)
            assert state.game.scores == one_by_one.game.scores


# -- the map ----------------------------------------------------------------------------------------------------


def test_the_map_comes_out_as_it_was(rec):
    with context() as ctx:
        before = ctx.graph.columns()
        graph = ctx.graph.to_networkx()
    assert rec.graph.columns().node_ids.tolist() == before.node_ids.tolist()
    assert rec.graph.columns().edge_ids.tolist() == before.edge_ids.tolist()
    assert nx.utils.graphs_equal(rec.graph.to_networkx(), graph)
    assert "world" not in rec.header
    assert rec.header["seed"] == rec.seed == 1


def test_the_map_can_be_attached_with_ids_and_order_kept():
    with gamms.create_context(logger_config=QUIET) as ctx:
        graph = nx.MultiDiGraph(crs="EPSG:32635", attribution="somebody")
        for node in (7, 3, 5):
            graph.add_node(node, x=float(node), y=0.0, name=f"node {node}")
        graph.add_edge(7, 3, id=40, length=9.0, linestring=[(7.0, 0.0), (5.0, 2.0), (3.0, 0.0)], lanes=2)
        graph.add_edge(7, 3, id=10, length=4.0)
        ctx.graph.attach_networkx_graph(graph)
        stream = io.BytesIO()
        ctx.record.start(stream)
        ctx.record.stop()
        packed = ctx.graph.storage.pack()
    map = recorder.open(io.BytesIO(stream.getvalue())).graph
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(map)
        assert ctx.graph.storage.pack() == packed
        assert ctx.graph.columns().node_ids.tolist() == [7, 3, 5]
        assert (ctx.graph.crs, ctx.graph.attribution) == ("EPSG:32635", "somebody")
        with pytest.raises(BadValue, match="already a node with id"):
            ctx.graph.attach_networkx_graph(map)
        assert ctx.graph.storage.pack() == packed
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.add_nodes([1, 2], x=[0, 1], y=[0, 0])
        ctx.graph.attach_networkx_graph(map)
        assert ctx.graph.columns().node_ids.tolist() == [1, 2, 7, 3, 5]
        assert ctx.graph.graph.get_edge(40).source == 7
        assert ctx.graph.node_attributes(3) == {"name": "node 3"}


# -- files ------------------------------------------------------------------------------------------------------


def test_a_path_is_opened_with_and_without_its_suffix(game, tmp_path):
    (tmp_path / "game.ggr").write_bytes(game[0])
    for path in (tmp_path / "game.ggr", str(tmp_path / "game")):
        with recorder.open(path) as rec:
            assert isinstance(rec, Recording)
            assert repr(rec) == "Recording(8 turns)"
            assert rec.warning is None
    with pytest.raises(FileNotFoundError):
        recorder.open(tmp_path / "none")
    with pytest.raises(BadType, match="path or a binary stream"):
        recorder.open(io.StringIO("text"))


def test_a_recording_that_was_cut_off_opens_and_says_so(game):
    rec = recorder.open(io.BytesIO(game[0][:-40]))
    assert not rec.is_complete
    assert "was not finished" in rec.warning
    assert rec[-1].turn == rec.turns


def test_a_path_is_no_reader_of_which_a_recording_is_made(tmp_path):
    with pytest.raises(BadType, match=r"gamms\.recorder\.open opens a recording"):
        Recording(tmp_path)


def test_version_2_is_refused_with_the_way_out():
    with pytest.raises(RecordingError, match="gamms convert IN OUT"):
        recorder.open(io.BytesIO(b"MMGR\0\0\0\2\xa2"))
    with pytest.raises(RecordingError, match="not a recording"):
        recorder.open(io.BytesIO(b"MMGX"))


@pytest.mark.parametrize(
    ("log", "reason"),
    [
        ([9, 1], "agent number 9 moves, but does not exist"),
        ([9, 1] * 40, "agent number 9 moves, but does not exist"),
        ([(kinds.AGENT_TEAM, {"agent_name": "nobody", "team": 1})], "does not fit"),
        ([(kinds.AGENT_CREATE, {"name": 5, "kwargs": {"start_node_id": 1}})], "not the name"),
        ([(kinds.AGENT_CREATE, {"name": "a0", "kwargs": {"start_node_id": 1}})], "same name"),
        ([(kinds.AGENT_CREATE, 7)], "does not fit"),
        ([(kinds.AERIAL_AGENT_POSITION, {"agent_name": "a0", "position": (0, 0, 0)})], "on the ground"),
        ([(kinds.AERIAL_AGENT_FLIGHT, (0, 1, 0.0, 0.0, 0.0))], "on the ground"),
        ([(kinds.AERIAL_AGENT_FLIGHT, (0, 1, 0.0, 0.0, 0.0))] * 40, "on the ground"),
        ([(kinds.AERIAL_AGENT_FLIGHT, (9, 1, 0.0, 0.0, 0.0))], "agent number 9 moves, but does not exist"),
        ([(kinds.AERIAL_AGENT_FLIGHT, (9, 1, 0.0, 0.0, 0.0))] * 40, "agent number 9 moves, but does not exist"),
        ([(kinds.AERIAL_AGENT_TURN, (-1, 1.0, 0.0, 0.0, 0.0))], "agent number -1 moves, but does not exist"),
        ([(kinds.SNAPSHOT, {"names": []})], "whole state is invalid"),
        ([(kinds.GAME_SCORES, {"scores": 5})], "scores are invalid"),
    ],
)
def test_an_event_that_does_not_fit_is_reported_with_its_turn(log, reason):
    stream = io.BytesIO()
    writer = Writer(stream, {"world": b""})
    writer.keyframe(blank(3))
    for one in ([0, 1], log):
        writer.add_turn(one)
    writer.close()
    rec = recorder.open(io.BytesIO(stream.getvalue()))
    with pytest.raises(RecordingError, match=f"state after turn 2 .*{reason}"):
        rec.state(2)
    assert rec.state(1).agents["node"].tolist() == [1, 1, 2]


@pytest.mark.parametrize(
    ("table", "event"),
    [
        ("positions", (kinds.AERIAL_AGENT_POSITION, {"agent_name": "a0", "position": (1.0,)})),
        ("positions", (kinds.AERIAL_AGENT_POSITION, None)),
        ("positions", (kinds.AERIAL_AGENT_FLIGHT, (9, 1, 0.0, 0.0, 0.0))),
        ("scores", (kinds.GAME_SCORES, {"scores": [("red",)]})),
        ("events", (kinds.GAME_EVENT, {"turn": 1})),
        ("moves", (kinds.SNAPSHOT, np.zeros(3))),
        ("moves", (kinds.AGENT_CREATE, [])),
    ],
)
def test_an_event_that_does_not_fit_a_table_is_an_error(table, event):
    stream = io.BytesIO()
    writer = Writer(stream, {"world": b""})
    writer.keyframe(blank(3))
    writer.add_turn([event])
    writer.add_turn([event])
    writer.close()
    rec = recorder.open(io.BytesIO(stream.getvalue()))
    with pytest.raises(RecordingError, match=r"damaged|has no kind|does not exist"):
        rec.table(table)


def test_a_recording_without_a_beginning_or_a_map_says_so():
    rec = recorder.open(io.BytesIO(written([[0, 1]])))
    with pytest.raises(RecordingError, match="no initial state"):
        rec.state(0)
    with pytest.raises(RecordingError, match="map of turn 0"):
        _ = rec.graph
    assert rec.turns == 1
    assert list(rec.logs()) == [[0, 1]]


@pytest.mark.parametrize("copied", [pickle.dumps, copy.deepcopy])
def test_an_open_file_says_that_its_path_is_to_be_passed_on(copied, tmp_path):
    stream = io.BytesIO(played()[0])
    (tmp_path / "game.ggr").write_bytes(stream.getvalue())
    with recorder.open(tmp_path / "game.ggr") as recording, pytest.raises(BadType, match="pass on its path"):
        copied(recording)
    assert len(copy.deepcopy(recorder.open(stream))) == 8
