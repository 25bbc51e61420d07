"""Opening a context: its arguments, its rooms, and that a failure leaves nothing open."""

import sqlite3
import subprocess
import sys

import pytest

import gamms
from gamms import graph, visual
from gamms.errors import GammsError


def test_by_default_a_context_has_every_room_and_lives(open_context):
    ctx = open_context()
    assert isinstance(ctx, gamms.Context)
    assert isinstance(ctx, gamms.typing.IContext)
    for room, kind in (
        (ctx.agent, gamms.agent.AgentEngine),
        (ctx.graph, gamms.graph.GraphEngine),
        (ctx.sensor, gamms.sensor.SensorEngine),
        (ctx.visual, gamms.visual.NoEngine),
        (ctx.ictx, gamms.InternalContext),
        (ctx.ictx.memory, gamms.memory.MemoryEngine),
    ):
        assert isinstance(room, kind)
    assert (ctx.ictx.compute, ctx.ictx.message, ctx.is_terminated()) == (None, None, False)
    assert (ctx.agent_engine, ctx.graph_engine, ctx.sensor_engine) == (ctx.agent, ctx.graph, ctx.sensor)
    assert (ctx.visual_engine, ctx.recorder, ctx.internal_context) == (ctx.visual, ctx.record, ctx.ictx)
    assert ctx._alive is True


@pytest.mark.parametrize("room", ["agent", "graph", "sensor", "visual", "record", "ictx", "rng", "seed"])
def test_rooms_cannot_be_assigned_by_their_short_names(open_context, room):
    with pytest.raises(AttributeError):
        setattr(open_context(), room, None)


def test_the_published_arguments_may_be_positional():
    arguments = (graph.Engine.SQLITE, visual.Engine.NO_VIS, {"width": 3}, {"level": "CRITICAL"})
    with gamms.create_context(*arguments) as ctx:
        ctx.graph.graph.add_node({"id": 0, "x": 0, "y": 0})
        assert list(ctx.graph.graph.get_nodes()) == [0]


@pytest.mark.parametrize("engine", ["SQLIGHT", 1, None, visual.Engine.PYGAME])
def test_an_unknown_graph_engine_is_a_value_error(engine):
    with pytest.raises(ValueError, match="Unknown graph engine") as caught:
        gamms.create_context(graph_engine=engine)
    assert isinstance(caught.value, GammsError)


@pytest.mark.parametrize("engine", ["PYGME", 0, None, graph.Engine.MEMORY])
def test_an_unknown_visual_engine_is_a_not_implemented_error(engine):
    with pytest.raises(NotImplementedError, match="Unknown visual engine"):
        gamms.create_context(vis_engine=engine)


def test_a_window_without_a_display_says_what_else_there_is(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "none of that name")
    with pytest.raises(RuntimeError, match=r"No window can be opened here.*OFFSCREEN.*SDL_VIDEODRIVER=dummy") as caught:
        gamms.create_context(vis_engine=visual.Engine.PYGAME, vis_kwargs={"width": 800})
    assert isinstance(caught.value, GammsError)


def test_options_of_other_visual_engines_are_swallowed(open_context):
    options = {"width": 1, "height": 2, "simulation_time_constant": 0.1, "input_overlay": {}, "anything": 5}
    ctx = open_context(vis_kwargs=options)
    ctx.visual.simulate()
    assert options["anything"] == 5


def test_a_path_needs_a_database(tmp_path):
    with pytest.raises(ValueError, match=r"graph_path=.*SQLITE"):
        gamms.create_context(graph_path=tmp_path / "graph.db")
    assert list(tmp_path.iterdir()) == []


def test_a_graph_in_a_file_is_there_again(open_context, tmp_path):
    for _ in range(2):
        ctx = open_context(graph_engine=graph.Engine.SQLITE, graph_path=tmp_path / "graph.db")
        if not list(ctx.graph.graph.get_nodes()):
            ctx.graph.graph.add_node({"id": 7, "x": 1, "y": 2})
        ctx.terminate()
    assert ctx.is_terminated()
    again = open_context(graph_engine=graph.Engine.SQLITE, graph_path=str(tmp_path / "graph.db"))
    assert again.graph.graph.get_node(7) == (7, 1.0, 2.0)


@pytest.mark.parametrize(
    "bad",
    [
        {"vis_engine": visual.Engine.PYGAME, "vis_kwargs": {"theme": "loud"}},
        {"vis_engine": "window"},
        {"vis_kwargs": {"ctx": None}},
        {"vis_kwargs": 5},
        {"seed": "one"},
        {"logger_config": {"level": "loud"}},
    ],
)
def test_a_room_that_cannot_be_built_leaves_nothing_open(tmp_path, bad):
    path = tmp_path / "graph.db"
    with pytest.raises((TypeError, ValueError, NotImplementedError)):
        gamms.create_context(graph_engine=graph.Engine.SQLITE, graph_path=path, **bad)
    assert [one.name for one in tmp_path.iterdir()] in ([], ["graph.db"])  # no journal beside it
    if path.exists():
        with sqlite3.connect(path, timeout=0) as connection:
            connection.execute("PRAGMA journal_mode = DELETE")
            connection.execute("BEGIN EXCLUSIVE")
        connection.close()


def test_something_else_at_the_path_is_left_as_it_is(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("not a database, and longer than the header of one would be" * 10)
    with pytest.raises(ValueError, match=r"notes\.txt"):
        gamms.create_context(graph_engine=graph.Engine.SQLITE, graph_path=path)
    assert path.read_text().startswith("not a database")


@pytest.mark.parametrize("ending", ["ctx.terminate()", "held.append(ctx)"], ids=["terminated", "left open"])
def test_nothing_is_left_on_disk(tmp_path, ending):
    code = f"""
import gamms
held = []
for engine in (gamms.graph.Engine.MEMORY, gamms.graph.Engine.SQLITE):
    ctx = gamms.create_context(engine, logger_config={{"level": "CRITICAL"}})
    ctx.graph.graph.add_node({{"id": 0, "x": 0, "y": 0}})
    ctx.agent.create_agent("a", start_node_id=0).get_state()
    {ending}
"""
    run = [sys.executable, "-W", "error", "-c", code]
    subprocess.run(run, cwd=tmp_path, env={"TMPDIR": str(tmp_path)}, check=True, capture_output=True)
    assert list(tmp_path.iterdir()) == []


def test_an_engine_that_shows_nothing_is_made_when_it_is_first_asked_for(open_context):
    ctx = open_context()
    assert ctx._visual_engine is None
    assert ctx.visual is ctx.visual_engine is ctx.visual
    assert isinstance(ctx.visual, gamms.visual.NoEngine)


def test_a_strategy_may_be_the_first_to_ask_for_the_visual_engine(open_context):
    ctx = open_context(seed=1)
    ctx.graph.graph.add_node({"id": 0, "x": 0.0, "y": 0.0})
    seen = []

    def look(state):
        seen.append(type(ctx.visual))
        state["action"] = 0

    ctx.agent.create_agent("anna", start_node_id=0, strategy=look)
    ctx.game.step()
    assert seen == [gamms.visual.NoEngine]


def test_the_options_of_a_visual_engine_are_checked_at_once(open_context):
    with pytest.raises(GammsError, match="simulation_time_constant"):
        open_context(vis_kwargs={"simulation_time_constant": "slow"})


def test_engines_may_be_given_by_their_names(tmp_path):
    path = tmp_path / "map.db"
    with gamms.create_context("sqlite", "no_vis", graph_path=path, logger_config={"level": "CRITICAL"}) as ctx:
        assert isinstance(ctx.visual, gamms.visual.NoEngine)
    assert path.exists()


def test_each_part_of_a_context_describes_its_contents(tmp_path):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        assert repr(ctx.agent) == "AgentEngine(0 agents)"
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.sensor.create_sensor("near", "neighbor")
        for name, team in (("a", "red"), ("b", "blue"), ("c", "red")):
            ctx.agent.create_agent(name, start_node_id=0, team=team)
        ctx.game.add(gamms.rules.time_limit(2))
        assert repr(ctx.record) == "Recorder(not recording)"
        ctx.record.start(tmp_path / "game")
        ctx.game.run(1)
        ctx.game.scores["red"] = 2
        assert repr(ctx.graph.graph) == "Graph(9 nodes, 24 edges)"
        assert repr(ctx.graph) == "GraphEngine(Graph(9 nodes, 24 edges))"
        assert repr(ctx.agent) == "AgentEngine(3 agents; 'red': 2, 'blue': 1)"
        assert repr(ctx.sensor) == "SensorEngine(1 NEIGHBOR)"
        assert repr(ctx.game) == "Game(turn=1, rules=[time_limit], scores={'red': 2})"
        assert repr(ctx.record) == "Recorder(recording)"
        ctx.record.pause()
        assert repr(ctx.record) == "Recorder(paused)"
        ctx.visual.set_graph_visual()
        assert repr(ctx.visual) == "NoEngine(artists=['graph'])"
        ctx.record.play()
        ctx.game.run(1)
        assert repr(ctx.game).endswith("over: time limit)")
    assert repr(ctx.graph) == "GraphEngine(terminated)"
