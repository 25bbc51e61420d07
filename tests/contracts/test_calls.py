import math

import numpy as np
import pytest
from calling import fuzz

import gamms
import gamms.osm
import gamms.recorder
import gamms.recordings
import gamms.rules
import gamms.scenario
from gamms.errors import GammsError
from gamms.sensor import SensorType
from gamms.typing import ISensor

HUGE = 1 << 20_000  # of more digits than Python writes out
MANY = np.array([1, 2])


def test_calls_with_odd_arguments_work_or_are_refused_with_an_error_of_ours():
    assert fuzz("calls", 4) == []


@pytest.fixture
def ctx():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
        ctx.sensor.create_sensor("far", SensorType.RANGE, sensor_range=15)
        ctx.sensor.create_sensor("walls", SensorType.OCCLUDED_MAP, sensor_range=15)
        ctx.sensor.create_sensor("others", SensorType.AGENT_RANGE, sensor_range=15)
        ctx.sensor.create_sensor("below", SensorType.AERIAL, sensor_range=30)
        ctx.agent.create_agent("ann", start_node_id=0, team="red")
        yield ctx


def setting(find, name, value):
    return lambda ctx: setattr(find(ctx), name, value)


REFUSED = {
    "a component's name": (TypeError, lambda ctx: ctx.record.add_component([], 1)),
    "a component": (KeyError, lambda ctx: ctx.record.get_component({})),
    "a component to delete": (KeyError, lambda ctx: ctx.record.delete_component({})),
    "a component class": (TypeError, lambda ctx: ctx.record.is_component_registered(None)),
    "a component class to forget": (TypeError, lambda ctx: ctx.record.unregister_component("x")),
    "a kind of event": (TypeError, lambda ctx: ctx.record.event(HUGE)),
    "a version": (ValueError, lambda ctx: ctx.record.start("x", version=MANY)),
    "a flag": (TypeError, lambda ctx: ctx.record.start("x", overwrite=MANY)),
    "an artist": (TypeError, lambda ctx: ctx.visual.artists.get([])),
    "an artist to remove": (TypeError, lambda ctx: ctx.visual.remove_artist({})),
    "a sensor to draw": (TypeError, lambda ctx: ctx.visual.set_sensor_visual(HUGE)),
    "what is collected per": (TypeError, lambda ctx: ctx.game.collect("x", print, per=MANY)),
    "a share": (TypeError, lambda ctx: ctx.visual.drawing.position_of("ann", share="x")),
    "a title": (TypeError, lambda ctx: ctx.visual.picture(".svg", title=HUGE)),
    "a note": (TypeError, lambda ctx: ctx.visual.picture(".svg", note=MANY)),
    "a place of an array": (TypeError, setting(lambda ctx: ctx.sensor.sensors["far"], "at", np.array(1.5))),
    "one who does not fly": (ValueError, lambda ctx: ctx.sensor.sensors["below"].view_from(1, "ann")),
    "a kind of deed": (TypeError, lambda ctx: ctx.game.performed({"id": 3})),
    "a winner when time is up": (TypeError, lambda _: gamms.rules.time_limit(3, winner=MANY)),
    "a kind of sensor": (ValueError, lambda ctx: ctx.sensor.create_sensor("x", HUGE)),
    "no sensor": (TypeError, lambda ctx: ctx.sensor.add_sensor(HUGE)),
    "a node without a dict": (TypeError, lambda ctx: ctx.graph.graph.update_node(np.array([]))),
    "an edge without a dict": (TypeError, lambda ctx: ctx.graph.graph.update_edge(np.int64(3))),
    "a distance": (TypeError, lambda ctx: ctx.graph.graph.get_nodes(d=MANY)),
    "a distance of edges": (TypeError, lambda ctx: ctx.graph.graph.get_edges(d=HUGE)),
    "a distance of faces": (TypeError, lambda ctx: ctx.graph.get_obstacle_faces(d=MANY)),
    "a radius": (TypeError, lambda ctx: ctx.graph.graph.nodes_near(1, 1, [0])),
    "a radius around a node": (TypeError, lambda ctx: ctx.graph.graph.within(1, {})),
    "an opening angle": (TypeError, lambda ctx: ctx.graph.graph.within(1, 9.0, fov=MANY)),
    "a heading": (TypeError, lambda ctx: ctx.graph.graph.within(1, 9.0, fov=1.0, heading=[None, {}])),
    "a weight": (TypeError, lambda ctx: ctx.graph.graph.weights(MANY)),
    "a weight of ways": (TypeError, lambda ctx: ctx.graph.distance(0, 8, weight={})),
    "alive": (TypeError, setting(lambda ctx: ctx.agent.get_agent("ann"), "alive", MANY)),
    "a team": (TypeError, setting(lambda ctx: ctx.agent.get_agent("ann"), "team", HUGE)),
    "a heading of an agent": (ValueError, setting(lambda ctx: ctx.agent.get_agent("ann"), "orientation", HUGE)),
    "a reason": (TypeError, lambda ctx: ctx.game.end(HUGE)),
    "truncated": (TypeError, lambda ctx: ctx.game.end("x", truncated=MANY)),
    "data of a game": (TypeError, setting(lambda ctx: ctx.game, "data", MANY)),
    "a phase": (ValueError, lambda ctx: ctx.game.add(lambda _: None, phase=MANY)),
    "a rule": (TypeError, lambda ctx: ctx.game.add(HUGE)),
    "a table": (TypeError, lambda ctx: ctx.game.result().table([])),
    "a store's name": (TypeError, lambda ctx: ctx.ictx.memory.create_store(gamms.typing.StoreType.MEMORY, {})),
    "a store": (TypeError, lambda ctx: ctx.ictx.memory.get_store([])),
    "keywords": (TypeError, lambda _: gamms.create_context(vis_kwargs=5)),
    "settings of the log": (TypeError, lambda _: gamms.create_context(logger_config="x")),
    "an unknown visual engine": (NotImplementedError, lambda _: gamms.create_context(vis_engine=HUGE)),
    "an unknown graph engine": (ValueError, lambda _: gamms.create_context(graph_engine=HUGE)),
    "a goal's team": (TypeError, lambda _: gamms.rules.reach([], 1)),
    "contacts": (TypeError, lambda _: gamms.rules.one_to_one(5)),
    "teams in order": (TypeError, lambda _: gamms.rules.by_priority([[1]])),
    "conflicts": (TypeError, lambda _: gamms.rules.Conflicts(among=MANY)),
    "a strategy without a context": (TypeError, lambda _: gamms.strategies.chase(None)),
    "a way without a context": (TypeError, lambda _: gamms.strategies.goto("x", 1)),
    "nodes of a patrol": (TypeError, lambda ctx: gamms.strategies.patrol(ctx, np.array(1))),
    "no recordings": (TypeError, lambda _: gamms.recordings.first_difference(1, 2)),
    "no recording": (TypeError, lambda _: gamms.scenario.from_recording(5)),
    "half a character": (ValueError, lambda _: gamms.recorder.open("\ud800")),
    "a path with NUL": (ValueError, lambda _: gamms.scenario.load("a\0b")),
    "a number as a path": (TypeError, lambda _: gamms.recordings.version_of(3)),
    "a flag of a map": (TypeError, lambda _: gamms.osm.graph_from_file("x", bidirectional=MANY)),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_a_verb_cannot_take_is_refused_in_our_own_words(ctx, case):
    builtin, call = REFUSED[case]
    with pytest.raises(GammsError) as error:
        call(ctx)
    assert isinstance(error.value, builtin)
    assert not any(words in str(error.value) for words in ("4300", "unhashable", "ambiguous"))


@pytest.mark.parametrize("name", ["near", "far", "walls", "others"])
@pytest.mark.parametrize("node", [{}, [0, 1], "x", 1.5, MANY, HUGE, math.nan], ids=lambda node: type(node).__name__)
def test_a_sensor_refuses_an_unknown_node(ctx, name, node):
    sensor = ctx.sensor.sensors[name]
    for look in (sensor.sense, lambda one: sensor.view_from(one, None), lambda one: sensor.sense_many([one])):
        with pytest.raises(GammsError, match=r"integer|64 bits"):
            look(node)


@pytest.mark.parametrize("name", ["near", "far", "others", "below"])
def test_many_looks_want_a_list_of_nodes(ctx, name):
    for nodes in ("12", 1, np.array(1), None):
        with pytest.raises(TypeError, match="node_ids must be a list of integers, not "):
            ctx.sensor.sensors[name].sense_many(nodes)


@pytest.mark.parametrize("name", ["near", "far", "others"])
def test_a_sensor_says_that_its_data_was_set_to_what_cannot_be_drawn(ctx, name):
    sensor = ctx.sensor.sensors[name]
    sensor.data = object()
    with pytest.raises(ValueError, match=f"The data of sensor '{name}' was set to <object object") as error:
        sensor.last_view()
    assert isinstance(error.value, GammsError)


class Own(ISensor):
    """A sensor of a program's own that says it were a range sensor, as 1.0.0 lets it."""

    sensor_id, type, data = "own", SensorType.RANGE, {}

    def sense(self, node_id):
        pass

    def update(self, data):
        pass

    def set_owner(self, owner):
        pass


def test_a_game_with_a_sensor_of_its_own_that_names_a_built_in_type_is_recorded(ctx, tmp_path):
    ctx.sensor.add_sensor(Own())
    ctx.record.start(tmp_path / "game")
    ctx.record.stop()
    with gamms.recorder.open(tmp_path / "game") as recording:
        assert recording.turns == 0
