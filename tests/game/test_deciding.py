"""While agents decide, nothing can be changed: every verb and every setter refuses, and what can be read is a copy."""

import copy
import inspect
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from operator import setitem
from types import SimpleNamespace

import numpy as np
import pytest
from whole_world import kind_of, objects, other, public, sensor, world

import gamms
from gamms.deciding import Guarded
from gamms.game import IllegalMutation
from gamms.readonly import ReadOnlyMapping, freeze
from gamms.sensor import SensorType

SETTERS = {  # beside the attributes that there are, of which the law of all verbs and setters says it
    "agent alive": lambda ctx, s: setattr(other(ctx), "alive", False),
    "agent color": lambda ctx, s: setattr(other(ctx), "color", "red"),
    "agent new": lambda ctx, s: setattr(other(ctx), "new", 1),
    "own agent new": lambda ctx, s: setattr(ctx.agent.get_agent("cheater"), "hp", [1]),
    "sensor new": lambda ctx, s: setattr(sensor(ctx), "own", 1),
    "visual new": lambda ctx, s: setattr(ctx.visual, "own", 1),
    "artist new": lambda ctx, s: setattr(ctx.visual.artists.list_shown()["other"], "own", 1),
    "context stream": lambda ctx, s: setattr(ctx, "stream", print),
}

VERBS = {
    "create_agent": lambda ctx, s: ctx.agent.create_agent("m", start_node_id=0),
    "delete_agent": lambda ctx, s: ctx.agent.delete_agent("other"),
    "agents cleared": lambda ctx, s: ctx.agent.agents.clear(),
    "agent block": lambda ctx, s: setitem(ctx.agent.block.node, 1, 0),
    "positions": lambda ctx, s: ctx.agent.positions,
    "agent storage": lambda ctx, s: ctx.agent.storage,
    "other state": lambda ctx, s: other(ctx).state,
    "del color": lambda ctx, s: delattr(other(ctx), "color"),
    "sensors cleared": lambda ctx, s: ctx.sensor.sensors.clear(),
    "sensor storage": lambda ctx, s: ctx.sensor.storage.memory,
    "data of others' sensors": lambda ctx, s: sensor(ctx).data,
    "unpack": lambda ctx, s: ctx.graph.storage.unpack(b""),
    "place": lambda ctx, s: ctx.graph.place(1),
    "neighborhoods": lambda ctx, s: setitem(ctx.graph.graph.neighborhoods, 0, (0, 8)),
    "columns of the graph": lambda ctx, s: setitem(ctx.graph.columns().xy, 0, 9.0),
    "attributes in columns": lambda ctx, s: ctx.graph.columns().node_attributes["tags"].clear(),
    "scores": lambda ctx, s: setitem(ctx.game.scores, "red", 100),
    "scores update": lambda ctx, s: ctx.game.scores.update(red=100),
    "data": lambda ctx, s: setitem(ctx.game.data, "x", 1),
    "data inside": lambda ctx, s: ctx.game.data["inbox"].append(1),
    "data deep inside": lambda ctx, s: ctx.game.data["inbox"][0]["seen"].append(1),
    "array in data": lambda ctx, s: ctx.game.data["wind"].fill(9),
    "events": lambda ctx, s: ctx.game.events.append({}),
    "event": lambda ctx, s: ctx.game.events[0].clear(),
    "errors": lambda ctx, s: ctx.game.errors.append({}),
    "counts": lambda ctx, s: ctx.game.counts["other"].clear(),
    "others' memory": lambda ctx, s: ctx.game.memories["other"].clear(),
    "team memory": lambda ctx, s: setitem(ctx.game.team_memories, "blue", {}),
    "fact": lambda ctx, s: setitem(s["facts"], "x", 1),
    "array in a fact": lambda ctx, s: setitem(s["facts"]["heat"], 0, 9.0),
    "array in a fact unlocked": lambda ctx, s: s["facts"]["heat"].setflags(write=True),
    "array deep in a fact": lambda ctx, s: s["facts"]["nested"]["rows"][0].fill(9),
    "bytes in a fact": lambda ctx, s: s["facts"]["nested"]["log"].append(1),
    "game close": lambda ctx, s: ctx.game.internals.close(),
    "starts": lambda ctx, s: ctx.game.internals.starts.clear(),
    "after_reset": lambda ctx, s: ctx.game.internals.after_reset.append(print),
    "after_observing": lambda ctx, s: ctx.game.internals.after_observing.clear(),
    "inside an artist's data": lambda ctx, s: ctx.visual.artists.list_shown()["other"].data.clear(),
    "after_turn": lambda ctx, s: ctx.visual.after_turn.clear(),
    "record stop": lambda ctx, s: ctx.record.stop(),
    "component": lambda ctx, s: ctx.record.component({"x": int})(type("X", (), {})),
    "terminate": lambda ctx, s: ctx.terminate(),
    "ctx exit": lambda ctx, s: ctx.__exit__(None, None, None),
    "copy": lambda ctx, s: copy.deepcopy(ctx),
    "rng": lambda ctx, s: ctx.rng.random(),
    "seed": lambda ctx, s: ctx.seed,
    "random_actions": lambda ctx, s: ctx.agent.teams["red"].random_actions(),
    "ictx": lambda ctx, s: ctx.ictx.terminate(),
    "user's attribute": lambda ctx, s: setitem(other(ctx).meta, "hp", 0),
    "inside a user's attribute": lambda ctx, s: other(ctx).meta["hp"].append(0),
    "rules": lambda ctx, s: ctx.game.rules.clear(),
    "state of the game": lambda ctx, s: ctx.game.internals.state.get_memory("other").clear(),
}

HARMLESS = {  # on what is a copy, or the strategy's own
    "sensors of others": lambda ctx, s: vandalise(other(ctx).sensors),
    "teams": lambda ctx, s: vandalise(ctx.agent.teams),
    "agents of the game": lambda ctx, s: vandalise(ctx.game.agents),
    "described visuals": lambda ctx, s: vandalise(ctx.visual.artists.describe_artists()),
    "node_attributes": lambda ctx, s: vandalise(ctx.graph.node_attributes(4)),
    "neighborhoods": lambda ctx, s: vandalise(ctx.graph.graph.neighborhoods),
    "columns": lambda ctx, s: [vandalise(part) for part in ctx.graph.columns().polylines.values()],
    "obstacle_columns": lambda ctx, s: vandalise(ctx.graph.obstacle_columns()),
    "scenery_columns": lambda ctx, s: vandalise(ctx.graph.scenery_columns()),
    "weights": lambda ctx, s: vandalise(ctx.graph.graph.weights(None)),
    "neighborhoods of routes": lambda ctx, s: vandalise(ctx.graph.routes.neighborhoods()),
    "arcs of routes": lambda ctx, s: vandalise(ctx.graph.routes.arcs()),
    "weights of routes": lambda ctx, s: vandalise(ctx.graph.routes.weights("length")),
    "distances": lambda ctx, s: vandalise(ctx.graph.distances(source=0)),
    "shortest_path": lambda ctx, s: vandalise(ctx.graph.shortest_path(0, 8)),
    "visibility": lambda ctx, s: vandalise(ctx.graph.visibility(30.0).from_node(0)),
    "settings": lambda ctx, s: vandalise(ctx.game.plain_settings()),
    "start_node": lambda ctx, s: ctx.game.start_node("other"),
    "sense_many": lambda ctx, s: vandalise(sensor(ctx, "tower").sense_many([0, 4, 8])),
    "sense_many of others": lambda ctx, s: vandalise(sensor(ctx).sense_many([0, 4])),
    "last_view": lambda ctx, s: vandalise(sensor(ctx, "tower").last_view()),
    "own data": lambda ctx, s: vandalise(sensor(ctx, "inbox").data),
    "sensed": lambda ctx, s: vandalise(s["sensor"]),
    "own state": lambda ctx, s: s.clear(),
    "own state legal": lambda ctx, s: s.update(legal=(8,)),
    "no legal": lambda ctx, s: s.pop("legal"),
    "moves of the last turn": lambda ctx, s: vandalise(ctx.game.moves),
    "tracks": lambda ctx, s: vandalise(ctx.game.tracks(ctx.game.agents)),
    "copy of the map": lambda ctx, s: copy.copy(ctx.graph.graph).clear(),
    "copy of facts": lambda ctx, s: vandalise(s["facts"].__reduce__()[1]),
    "picture": lambda ctx, s: ctx.visual.picture(".svg"),
    "draw_commands": lambda ctx, s: ctx.visual.draw_commands(),
}


def vandalise(value):
    """Change whatever can be changed."""
    if isinstance(value, np.ndarray):
        if value.base is not None:
            with suppress(ValueError):
                value.setflags(write=True)
        if value.flags.writeable:
            value.fill(77)
        return
    parts = (
        list(value.values()) if isinstance(value, Mapping) else list(value) if isinstance(value, list | tuple) else ()
    )
    for part in parts:
        vandalise(part)
    for spoil in ("clear", "reverse"):
        if hasattr(value, spoil) and not isinstance(value, ReadOnlyMapping):
            getattr(value, spoil)()


@pytest.mark.parametrize("name", [*SETTERS, *VERBS])
def test_a_strategy_cannot_change_anything_but_by_its_action(name):
    caught = []

    def cheat(ctx, state):
        with pytest.raises((IllegalMutation, TypeError, AttributeError, ValueError, KeyError)) as raised:
            (SETTERS | VERBS)[name](ctx, state)
        caught.append(raised.value)

    with world(cheat) as ctx:
        before = public(ctx)
        result = ctx.game.run(2)
        assert len(caught) == 2
        if name in SETTERS:
            assert isinstance(caught[0], IllegalMutation)
            assert "may not set " in str(caught[0])
        assert public(ctx) == before
        assert (result.turns, result.reason, result.errors) == (2, "max_turns", [])


@pytest.mark.parametrize("name", ["create_agent", "delete_agent", "record stop", "agent alive", "data", "terminate"])
@pytest.mark.parametrize("is_recorded", [False, True])
def test_a_cheat_that_is_not_caught_stops_the_game_or_is_counted(tmp_path, name, is_recorded):
    with world((SETTERS | VERBS)[name]) as ctx:
        if is_recorded:
            ctx.record.start(tmp_path / "game")
        before = public(ctx)
        with pytest.raises((IllegalMutation, TypeError)) as raised:
            ctx.game.run(2)
        assert raised.value.__notes__[-1] == "In the strategy of agent 'cheater', in turn 0."
        assert (public(ctx), ctx.game.turn) == (before, 0)
        ctx.game.on_error = "stay"
        before = public(ctx)
        result = ctx.game.run(2)
        assert public(ctx) == before
        assert (result.turns, result.agents["cheater"]["errors"], result.agents["other"]["errors"]) == (2, 2, 0)
        ctx.game.reset()
        ctx.game.on_error = "stay"
        assert ctx.game.run(2) == result


def test_a_recording_of_a_game_full_of_cheats_is_that_of_a_game_without(grid, tmp_path):
    def every_cheat(ctx, state):
        assert [complaint for thing in objects(ctx) for complaint in complaints(thing)] == []
        for cheat in (SETTERS | VERBS).values():
            with pytest.raises((IllegalMutation, TypeError, AttributeError, ValueError, KeyError)):
                cheat(ctx, state)

    recorded = []
    for name, cheat in (("fair", lambda ctx, state: None), ("cheats", every_cheat)):
        with world(cheat) as ctx:
            ctx.record.start(tmp_path / name)
            ctx.game.run(3)
            ctx.record.stop()
            recorded.append((tmp_path / f"{name}.ggr").read_bytes())
    assert recorded[0] == recorded[1]


@pytest.mark.parametrize("name", HARMLESS)
def test_the_state_of_a_strategy_is_a_copy(name):
    with world() as fair:
        expected = fair.game.run(2)
    with world(HARMLESS[name]) as ctx:
        before = public(ctx)
        result = ctx.game.run(2)
        assert public(ctx) == before
        assert result.agents["other"] == expected.agents["other"]
        assert ctx.agent.get_agent("other").get_state()["sensor"]["others"][1] == {"cheater": 0, "drone": 8}


@pytest.mark.parametrize("spoil", [dict.clear, lambda state: state.pop("legal"), lambda state: state.pop("action")])
@pytest.mark.parametrize("speed", [None, 2])
def test_a_state_without_an_action_is_no_action_whatever_else_is_gone(grid, spoil, speed):
    def strategy(state):
        state["action"] = "nonsense"
        spoil(state)
        state.pop("action", None)

    with grid() as ctx:
        agent = ctx.agent.create_agent("a", start_node_id=0, strategy=strategy, speed=speed)
        result = ctx.game.run(2)
        assert (agent.current_node_id, result.agents["a"]["illegal"]) == (0, 2)
        assert "legal are [0, 1, 4" in result.errors[0]["message"]
        ctx.game.on_illegal = "raise"
        with pytest.raises(gamms.game.IllegalAction, match="was not set"):
            ctx.game.step()


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, GeneratorExit])
@pytest.mark.parametrize("budget", [None, 9.0])
def test_an_interrupt_changes_nothing_and_closes_the_phase(grid, error, budget):
    def interrupted(ctx, state):
        with pytest.raises(IllegalMutation):
            other(ctx).current_node_id = 0
        raise error

    with world(interrupted, time_budget=budget) as ctx:
        before = public(ctx)
        with pytest.raises(error):
            ctx.game.run(2)
        assert (public(ctx), ctx.game.turn, ctx.game.is_deciding) == (before, 0, False)
        other(ctx).current_node_id = 0
        ctx.game.data["x"] = 1
        ctx.agent.get_agent("cheater").register_strategy(None)
        assert ctx.game.run(1).turns == 1


def test_errors_of_one_agent_are_reported_when_all_have_decided(grid):
    seen = []
    with grid(on_error="stay") as ctx:
        ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: state["nothing"])
        ctx.agent.create_agent("b", start_node_id=1, strategy=lambda state: seen.append(len(ctx.game.errors)))
        assert len(ctx.game.run(2).errors) == 4
        assert seen == [0, 2]


def test_an_agent_sees_its_own_memory_and_state_and_no_other(grid):
    seen = []

    def look(state):
        state["memory"]["n"] = state["memory"].get("n", 0) + 1
        seen.append((ctx.game.memories, ctx.agent.get_agent(state["name"]).state is state))
        with pytest.raises(IllegalMutation, match="read the state of agent"):
            ctx.agent.get_agent({"a": "b", "b": "a"}[state["name"]]).state["action"]

    with grid(on_illegal="stay") as ctx:
        for name in "ab":
            ctx.agent.create_agent(name, start_node_id=0, strategy=look)
        ctx.game.run(1)
        assert seen == [({"a": {"n": 1}}, True), ({"b": {"n": 1}}, True)]
        assert ctx.game.memories == {"a": {"n": 1}, "b": {"n": 1}}


def test_trial_looks_of_a_strategy_do_not_change_detection(grid):
    def play(is_trying):
        with grid(side=5, seed=4) as ctx:
            eyes = ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=99, detection=0.5)

            def look(state):
                if is_trying:
                    eyes.sense_many([0, 1, 2])
                    with pytest.raises(IllegalMutation):
                        eyes.notice.look(ctx, "b")
                seen.append(dict(state["sensor"].get("eyes", (None, {}))[1]))

            seen = []
            for i, name in enumerate("abcdef"):
                ctx.agent.create_agent(name, start_node_id=i, sensors=["eyes"], strategy=look)
            ctx.game.run(3)
            return seen

    assert play(is_trying=True) == play(is_trying=False)


def test_nested_lists_of_function_sensors_are_no_channel(grid):
    with grid() as ctx:
        ctx.game.data["inbox"] = [{"seen": []}, np.zeros(2)]
        ctx.sensor.from_function("inbox", lambda node_id, agent: ctx.game.data["inbox"])

        def write(state):
            inbox = state["sensor"]["inbox"][1]
            assert inbox[0]["seen"] == []
            assert inbox[1].sum() == 0
            inbox[0]["seen"].append(7)
            inbox[1][0] = 7

        for name in "ab":
            ctx.agent.create_agent(name, start_node_id=0, sensors=["inbox"], strategy=write)
        ctx.game.run(2)
        assert ctx.game.data["inbox"][0] == {"seen": []}


def test_data_of_custom_sensors_is_copied_in_a_game(grid):
    class Shared:
        def __init__(self):
            self.sensor_id, self.type, self.data = "shared", SensorType.CUSTOM, {"log": []}

        def sense(self, node_id):
            pass

        update = set_owner = sense

    with grid() as ctx:
        ctx.sensor.add_sensor(Shared())
        for name in "ab":
            strategy = lambda state: state["sensor"]["shared"][1]["log"].append(1)
            ctx.agent.create_agent(name, start_node_id=0, sensors=["shared"], strategy=strategy)
        ctx.game.run(2)
        assert ctx.sensor.get_sensor("shared").data == {"log": []}
        state = ctx.agent.get_agent("a").get_state()
        assert state["sensor"]["shared"][1] is ctx.sensor.get_sensor("shared").data  # in a loop of one's own


# -- that nothing is forgotten -----------------------------------------------------------------------------------------

READERS = {
    "Context": "is_terminated",
    "Game": "fork_for_deciders plain_settings settings start_node tracks",
    "AgentEngine": "create_iter get_agent",
    "Agent": "",
    "AerialAgent": "",
    "SensorEngine": "get_sensor",
    "Sensor": "called_with_both coverage heading in_arrays last_view outline place places_of pose sense_many",
    "DetectionModel": "compute_chances in_arrays is_noticed mark repeat_look select_wanted undo_looks",
    "GraphEngine": """columns distance distance_matrix distances edge_attributes find from_latlon get_edge get_edges
        get_neighbors get_node get_nodes get_obstacle_face get_obstacle_faces inside isochrone match_track
        nearest_node networkx_labels node_attributes obstacle_columns place positions scenery_columns shortest_path
        to_latlon to_networkx track visibility visibility_table visible weights""",
    "Graph": """among columns distance distance_matrix distances edge_attributes from_latlon get_edge get_edges
        get_neighbors get_node get_nodes ground has_node nearest_node node_attributes nodes_near place positions
        shortest_path to_latlon to_networkx weights within""",
    "NoEngine": """artist as_html clear_layer create_layer draw_commands fill_layer frame get_viewport
        human_input picture position_of save stay_open update""",
    "Artist": "get_artist_type get_drawer get_layer get_render_mode get_visible",
    "Recorder": "component_iter get_component is_component_registered record time",
    "Components": """component_iter get_component get_recorded is_component_registered list_events_since make_keyframe
        snapshot""",
}
OWN = {"Components": {"begin", "abandon", "assign"}, "Recorder": {"component"}}  # of the program's own objects
PARTS = {
    "NoEngine": {"drawing"},
    "GraphEngine": {"routes"},  # which only answers
    "Graph": {"routes"},
    "Game": {"conflicts"},
    "Agent": {"state"},
}  # see docs/deciding.md


def members(thing):
    """Public name -> whether it is a verb."""
    names = {name for name in (*dir(type(thing)), *getattr(thing, "__dict__", {})) if not name.startswith("_")}
    return {name: callable(inspect.getattr_static(thing, name, None)) for name in sorted(names)}


def arguments(verb):
    """One argument for each that is needed."""
    parameters = inspect.signature(verb).parameters.values()
    needed = [one for one in parameters if one.default is one.empty and one.kind is one.POSITIONAL_OR_KEYWORD]
    return [None] * len(needed)


def is_fixed(value):
    """Whether a value cannot be changed: a read-only copy of it is itself, or it refuses."""
    if isinstance(value, ReadOnlyMapping):
        return all(map(is_fixed, value.values()))
    if isinstance(value, tuple):
        return all(map(is_fixed, tuple.__iter__(value)))
    return isinstance(value, Guarded) or freeze(value) is value


def complaints(thing):
    kind = kind_of(thing)
    for name, is_verb in members(thing).items():
        if is_verb:
            if name not in READERS[kind].split() and name not in OWN.get(kind, ()) and not name.startswith("render_"):
                verb = getattr(thing, name)
                yield from refusal(f"{kind}.{name}()", partial(verb, *arguments(verb)))
            continue
        yield from refusal(f"{kind}.{name} =", partial(setattr, thing, name, 5))
        try:
            value = getattr(thing, name)
        except (IllegalMutation, AttributeError):
            continue
        is_copy = getattr(thing, name) is not value
        if name not in ("clock", "ctx", "logger", *PARTS.get(kind, ())) and not is_copy and not is_fixed(value):
            yield f"{kind}.{name} hands out {value!r:.80}"


def refusal(what, deed):
    try:
        deed()
    except IllegalMutation:
        return
    except Exception as error:  # noqa: BLE001 - whatever it is, it is no refusal
        yield f"{what} raises {error!r:.80}"
    else:
        yield f"{what} is not refused"


def test_no_verb_setter_or_attribute_is_forgotten(grid):
    """Where this fails, mark the verb `@refuse_while_deciding`, make the attribute `Protected`, or list the reader."""
    found = []

    def look(ctx, state):
        found.extend(complaint for thing in objects(ctx) for complaint in complaints(thing))

    with world(look) as ctx:
        for kind in SensorType:
            if kind not in (SensorType.CUSTOM, SensorType.NEIGHBOR) and kind.value < 14:
                ctx.sensor.create_sensor(f"one more {kind.name}", kind)
        before = public(ctx)
        ctx.game.run(1)
        assert found == [], "\n".join(found)
        assert public(ctx) == before


def test_a_read_only_copy_is_one_all_the_way_down():
    class Thing:
        def __init__(self):
            self.parts = []

    thing = Thing()
    given = {"list": [1, {2}], "array": np.ones((2, 2)), "bytes": bytearray(b"a"), "thing": thing, "row": (1, [2])}
    shown = freeze(given)
    assert shown == {**given, "list": (1, frozenset({2})), "array": shown["array"], "bytes": b"a", "row": (1, (2,))} | {
        "thing": shown["thing"]
    }
    assert shown["thing"] is not thing
    for array in (shown["array"], freeze(np.zeros(0)), freeze(np.array("2024-01-01", "M8[D]"))):
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.setflags(write=True)
    objects = freeze(np.array([[1], [2, 3]], object))
    assert objects.tolist() == [(1,), (2, 3)]
    assert not objects.flags.writeable


@pytest.mark.parametrize("value", [SimpleNamespace(x=1), [{"a": SimpleNamespace()}], np.random.default_rng(1)])
def test_a_fact_that_may_change_is_refused_by_name(grid, value):
    with grid() as ctx:
        with pytest.raises(TypeError, match="fact 'thing' has an object of the class"):
            ctx.game.publish(fine=1, thing=value)
        assert ctx.game.facts == {}


def test_facts_may_be_of_kinds_that_cannot_change(grid):
    with grid() as ctx:
        table = ctx.graph.visibility(20.0)
        agent = ctx.agent.create_agent("a", start_node_id=0)
        facts = {"kind": SensorType.MAP, "node": ctx.graph.graph.get_node(0), "edge": ctx.graph.graph.get_edge(0)}
        facts |= {
            "table": table,
            "agent": agent,
            "far": ctx.graph.distance,
            "number": np.float64(2),
            "on": IllegalMutation,
        }
        ctx.game.publish(**facts)
        assert all(ctx.game.facts[name] is fact for name, fact in facts.items() if name != "far")


def test_a_published_array_may_be_written_to_afterwards_and_the_fact_stays(grid):
    heat = np.zeros(3)
    with grid() as ctx:
        ctx.game.publish(heat=heat)
        heat[0] = 9
        assert ctx.game.facts["heat"].tolist() == [0, 0, 0]
