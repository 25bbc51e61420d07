"""From opening to the end: what ends in which order, what still works, and several contexts at once."""

import pytest

import gamms
from gamms.errors import ContextTerminated, GammsError
from gamms.graph import Engine
from gamms.sensor import SensorType


class Room:
    """A room of the user's own that notes when it is closed, and whether the context still lived then."""

    def __init__(self, name, notes, fails=False):
        self.name, self.notes, self.fails, self.ctx = name, notes, fails, None

    def terminate(self):
        self.notes.append((self.name, self.ctx.is_terminated()))
        if self.fails:
            raise OSError(self.name)


class Recorder(Room):
    """... that records."""

    def record(self):
        return True

    stop = Room.terminate


ROOMS = ("agent_engine", "sensor_engine", "graph_engine", "internal_context", "visual_engine")


def built_by_hand(notes, fails=()):
    rooms = {name: Room(name, notes, name in fails) for name in ROOMS}
    rooms["recorder"] = Recorder("recorder", notes)
    ctx = gamms.Context(**rooms)
    for room in rooms.values():
        room.ctx = ctx
    ctx.set_alive()
    return ctx


def test_a_with_statement_ends_the_context():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        assert not ctx.is_terminated()
    assert ctx.is_terminated()


def test_an_error_in_a_with_statement_ends_the_context_and_goes_on():
    with pytest.raises(ZeroDivisionError), gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        _ = 1 / 0
    assert ctx.is_terminated()


def test_an_error_in_a_with_statement_is_not_hidden_by_one_while_closing(listener):
    ctx = built_by_hand([], fails=["graph_engine"])
    ctx.logger = listener
    with pytest.raises(ZeroDivisionError) as caught, ctx:
        _ = 1 / 0
    assert ctx.is_terminated()
    assert caught.value.__notes__ == ["The context could not be closed properly either: graph_engine"]
    assert len(listener.heard) == 1


def test_the_recorder_stops_first_and_the_graph_is_written_before_the_stores_close():
    notes = []
    ctx = built_by_hand(notes)
    ctx.terminate()
    assert notes == [(name, False) for name in ("recorder", *ROOMS)]
    assert ctx.is_terminated()


def test_a_second_end_does_nothing():
    notes = []
    ctx = built_by_hand(notes)
    ctx.terminate()
    ctx.terminate()
    assert len(notes) == 6


@pytest.mark.parametrize("broken", ["recorder", *ROOMS])
def test_a_room_that_fails_to_close_does_not_keep_the_others_open(broken):
    notes = []
    ctx = built_by_hand(notes, fails=[broken])
    ctx.recorder.fails = broken == "recorder"
    with pytest.raises(OSError, match=broken):
        ctx.terminate()
    assert [name for name, _ in notes] == ["recorder", *ROOMS]
    assert ctx.is_terminated()


def test_a_context_without_rooms_can_begin_and_end():
    ctx = gamms.Context()
    assert (ctx.agent, ctx.graph, ctx.sensor, ctx.visual, ctx.ictx) == (None, None, None, None, None)
    assert (ctx.is_terminated(), ctx.record.record(), ctx.logger.name) == (True, False, "gamms")
    ctx.set_alive()
    assert not ctx.is_terminated()
    ctx.terminate()
    assert ctx.is_terminated()


def test_a_context_can_be_put_together_by_hand():
    ctx = gamms.Context()
    ctx.internal_context = gamms.InternalContext(memory_engine=gamms.memory.MemoryEngine())
    ctx.graph_engine = gamms.graph.GraphEngine(ctx, engine=Engine.MEMORY)
    ctx.agent_engine = gamms.agent.AgentEngine(ctx)
    ctx.sensor_engine = gamms.sensor.SensorEngine(ctx)
    ctx.visual_engine = gamms.visual.NoEngine(ctx)
    ctx.set_alive()
    ctx.graph.graph.add_node({"id": 0, "x": 0, "y": 0})
    ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    agent = ctx.agent.create_agent("a", start_node_id=0, sensors=["near"])
    assert agent.get_state()["sensor"]["near"][1] == [0]
    ctx.terminate()


@pytest.mark.parametrize("engine", list(Engine))
def test_after_the_end_the_graph_is_gone_and_says_so(open_context, engine):
    ctx = open_context(graph_engine=engine)
    kept = ctx.graph.graph
    kept.add_node({"id": 0, "x": 0, "y": 0})
    ctx.terminate()
    for ask in (
        lambda: ctx.graph.graph,
        lambda: ctx.graph.get_obstacle_face(0),
        ctx.graph.columns,
        lambda: kept.get_node(0),
        lambda: list(kept.get_nodes()),
        lambda: list(kept.get_edges()),
        lambda: kept.get_neighbors(0),
        lambda: kept.add_node({"id": 1, "x": 0, "y": 0}),
    ):
        with pytest.raises(AttributeError, match="terminated") as caught:
            ask()
        assert isinstance(caught.value, ContextTerminated)
        assert isinstance(caught.value, GammsError)


def test_after_the_end_nothing_is_created(open_context):
    ctx = open_context()
    ctx.terminate()
    for create in (
        lambda: ctx.agent.create_agent("a", start_node_id=0),
        lambda: ctx.sensor.create_sensor("s", SensorType.MAP),
    ):
        with pytest.raises(ContextTerminated):
            create()


def test_after_the_end_drawing_and_recording_are_quiet(open_context):
    ctx = open_context()
    ctx.terminate()
    ctx.visual.simulate()
    ctx.visual.set_graph_visual()
    ctx.visual.set_agent_visual("a", color=(0, 0, 0))
    ctx.visual.set_sensor_visual("s")
    ctx.visual.remove_artist("x")
    ctx.visual.render_circle(0, 0, 1)
    assert ctx.visual.human_input("a", {"curr_pos": 3}) == 3
    assert ctx.record.record() is False
    ctx.record.start("game.ggr")
    ctx.record.stop()


def test_several_contexts_live_side_by_side(open_context):
    first, second = (open_context(graph_engine=engine) for engine in (Engine.SQLITE, Engine.SQLITE))
    for number, ctx in enumerate((first, second)):
        ctx.graph.graph.add_node({"id": number, "x": number, "y": 0})
        ctx.sensor.create_sensor("s", SensorType.AGENT)
        ctx.agent.create_agent("a", start_node_id=number, sensors=["s"])
    first.terminate()
    assert first.is_terminated()
    assert not second.is_terminated()
    assert second.agent.get_agent("a").get_state()["curr_pos"] == 1
    assert list(second.graph.graph.get_nodes()) == [1]
    assert first.agent.get_agent("a").current_node_id == 0
