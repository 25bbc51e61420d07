"""The table of event kinds: whole, and the same whether applied to a live context or to columns."""

import dataclasses
import io
import re
from pathlib import Path

import numpy as np
import pytest
from games import copied, empty_context, grid_context, recorded
from gamms.typing.opcodes import OpCodes
from hypothesis import given, settings
from hypothesis import strategies as st
from test_frozen_recordings import everything_of_version_3, flights_of_version_3, turns_of_version_3

from gamms.ir import events as kinds
from gamms.ir.events import EVENTS, Field, Mover, Role, records_of, renumber_event
from gamms.ir.game_state import GameState
from gamms.ir.schema import Audience
from gamms.recorder import Reader
from gamms.recorder.changes import DETECTED
from gamms.recorder.detached import DetachedState
from gamms.recorder.formats.chunks import FORMS
from gamms.recorder.formats.version2 import FIELDS
from gamms.recorder.keyframes import CAPTURED, capture_state, pack_components
from gamms.recorder.replaying import Replayer

ALL = EVENTS.values()


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.name)
def test_every_kind_has_a_code_fields_an_audience_and_an_effect(kind):
    assert EVENTS[kind.code] is kind
    assert getattr(kinds, kind.name) == kind.code
    assert all(isinstance(field, Field) and isinstance(field.role, Role) for field in kind.fields.values())
    assert isinstance(kind.audience, Audience)
    assert callable(kind.apply)


def test_every_code_is_in_the_table():
    codes = {name: code for name, code in vars(kinds).items() if name.isupper() and type(code) is int}
    assert codes.pop("REPLAYED") < 0  # which no file holds
    assert {code: name for name, code in codes.items()} == {kind.code: kind.name for kind in ALL}


def test_the_records_of_version_2_are_those_of_its_operation_codes():
    assert {code.value for code in OpCodes} <= {kind.code for kind in ALL if kind.records is not None}
    assert FIELDS[kinds.AGENT_CREATE] == {"name", "kwargs"}
    assert FIELDS[kinds.AERIAL_AGENT_POSITION] == {"agent_name", "position"}
    assert FIELDS[kinds.COMPONENT_UPDATE] == {"name", "key", "value"}


@pytest.mark.parametrize("kind", [kind for kind in ALL if kind.records is not None], ids=lambda kind: kind.name)
def test_replacements_of_events_in_version_2_are_of_version_2(kind):
    values = {"name": "anna", "agent_name": "anna", "kwargs": {"start_node_id": 4}, "node_id": 5}
    if kind.is_tuple:
        data = (3, *(float(i) for i in range(1, len(kind.fields))))
    else:
        data = {key: values.get(key, 0) for key, field in kind.fields.items() if not field.is_optional}
    found = list(records_of(kind.code, data, Mover("anna", 7) if kind.is_tuple else None))
    assert found
    for code, record in found:
        assert code in FIELDS
        assert FIELDS[code] <= record.keys()
        assert "number" not in record


def test_events_whose_data_are_numbers_have_as_many_fields():
    for code, (nodes, floats) in FORMS.items():
        roles = [field.role for field in EVENTS[code].fields.values()]
        assert EVENTS[code].is_tuple
        assert roles == [Role.NUMBER, *[Role.NODE] * nodes, *[Role.PLAIN] * floats]


def test_who_may_know_follows_from_the_kind_alone():
    assert EVENTS[kinds.GAME_SCORES].audience is Audience.ALL
    assert EVENTS[kinds.GAME_MEMORY].audience is Audience.TEAM
    assert EVENTS[kinds.MOVES].audience is Audience.SENSED
    assert EVENTS[kinds.GAME_CHANCE].audience is Audience.HOST  # it would foretell what others draw


def test_agents_get_other_numbers_wherever_an_event_has_some():
    numbers = {0: 10, 1: 11}.get
    assert renumber_event(kinds.AERIAL_AGENT_TURN, (1, 1.0, 0.0, 0.0, 0.0), numbers) == (11, 1.0, 0.0, 0.0, 0.0)
    data = {"numbers": np.array([0, 1]), "edge_source": np.array([0, 1])}
    found = renumber_event(kinds.AGENT_PROGRESS, data, numbers)
    assert (found["numbers"].tolist(), found["edge_source"].tolist()) == ([10, 11], [0, 1])
    assert data["numbers"].tolist() == [0, 1]


# -- live and detached --------------------------------------------------------------------------------------------

NODES = st.integers(0, 8)  # of the grid; node `3 * y + x` is at (10 x, 10 y)
VALUES = st.recursive(st.none() | st.integers() | st.text(max_size=3), lambda inner: st.lists(inner, max_size=3))


def position_of(node, z):
    return (10.0 * (node % 3), 10.0 * (node // 3), z)


@st.composite
def programmes(draw):
    """Events of a game: agents who come, go and change, and what the game comes to."""
    agents, found = {}, []  # number -> (name, whether it flies)
    number_of_next = 0
    whats = ["come", "walk", "fly", "turn", "put", "came", "face", "team", "alive", "speed", "progress", "equip", "go"]
    whats += ["attribute", "score", "data", "over", "memory", "sensor", "component", "strategy"]
    for what in draw(st.lists(st.sampled_from(["come", "come", "walk", "walk", "fly", *whats]), max_size=25)):
        walkers = [number for number, (_, flies) in agents.items() if not flies]
        flyers = [number for number, (_, flies) in agents.items() if flies]
        node, z = draw(NODES), float(draw(st.integers(0, 3)))
        if what == "come":
            name, flies = f"a{number_of_next}", draw(st.booleans())
            kwargs = {"start_node_id": node, "team": z, "sensors": ["near"][: draw(st.integers(0, 1))], "fuel": 3}
            state = {}
            if flies:
                place = position_of(node, z)
                kwargs |= {"type": 1, "speed": 2.0}
                state = {"position": place, "previous_position": place, "quat": (1.0, 0.0, 0.0, 0.0), "node": node}
            found.append((kinds.AGENT_CREATE, {"name": name, "kwargs": kwargs, "state": state}))
            agents[number_of_next] = name, flies
            number_of_next += 1
        elif what == "walk" and walkers:
            moves = draw(st.lists(st.tuples(st.sampled_from(walkers), NODES), min_size=1, max_size=40))
            found.append((kinds.MOVES, [number for move in moves for number in move]))
        elif what in ("fly", "turn") and flyers:
            number = draw(st.sampled_from(flyers))
            flight = kinds.AERIAL_AGENT_FLIGHT, (number, node, *position_of(node, z))
            turn = kinds.AERIAL_AGENT_TURN, (number, 0.0, 0.6, 0.8, 0.0)
            found += [flight if what == "fly" else turn] * draw(st.sampled_from([1, 1, 30]))
        elif what in ("put", "came", "face", "speed", "progress") and walkers:
            number = draw(st.sampled_from(walkers))
            name = {"agent_name": agents[number][0]}
            columns = {key: np.array([node]) for key in ("edge_source", "edge_target")}
            found.append(
                {
                    "put": (kinds.AGENT_CURRENT_NODE, {**name, "node_id": node}),
                    "came": (kinds.AGENT_PREV_NODE, {**name, "node_id": node}),
                    "face": (kinds.AGENT_ORIENTATION, {**name, "orientation": [0.6, 0.8] if z else None}),
                    "speed": (kinds.AGENT_SPEED, {**name, "speed": z or None}),
                    "progress": (
                        kinds.AGENT_PROGRESS,
                        {"numbers": np.array([number]), **columns, "edge_share": np.array([z / 4])},
                    ),
                }[what]
            )
        elif what == "attribute" and agents:
            numbers = draw(st.lists(st.sampled_from(sorted(agents)), min_size=1, max_size=3))
            values = draw(st.none() | st.lists(VALUES, min_size=len(numbers), max_size=len(numbers)))
            data = {"numbers": numbers, "name": draw(st.sampled_from(["fuel", "load"]))}
            found.append((kinds.AGENT_ATTRIBUTE, data if values is None else {**data, "values": values}))
        elif what in ("team", "alive", "equip", "strategy", "go") and agents:
            number = draw(st.sampled_from(sorted(agents)))
            name = {"agent_name": agents[number][0]}
            sensor = {**name, "name": "eyes", "sensor_id": "others"}
            carried = kinds.AGENT_SENSOR_REGISTER if z else kinds.AGENT_SENSOR_DEREGISTER
            found.append(
                {
                    "team": (kinds.AGENT_TEAM, {**name, "team": node}),
                    "alive": (kinds.AGENT_ALIVE, {**name, "alive": z > 1}),
                    "equip": (carried, sensor),
                    "strategy": (kinds.AGENT_STRATEGY, {**name, "strategy": "here:there"}),
                    "go": (kinds.AGENT_DELETE, {"name": agents[number][0]}),
                }[what]
            )
            if what == "go":
                del agents[number]
        elif what in ("score", "data", "over", "memory", "sensor", "component"):
            changes = {"set": {"key": draw(VALUES), "list": [node]}, "removed": ["gone"]}
            over = {"reason": "won", "winner": node, "truncated": False}
            group = {"type": "NEIGHBOR", "keywords": {}, "ids": [f"sensor {node}"]}
            found.append(
                {
                    "score": (kinds.GAME_SCORES, {"scores": [("red", node)]}),
                    "data": (kinds.GAME_DATA, changes),
                    "over": (kinds.GAME_OVER, over if z else {}),
                    "memory": (kinds.GAME_MEMORY, {"agents": {"anna": changes}, "teams": [(1, changes)]}),
                    "sensor": (kinds.SENSORS, {"sensor_kinds": [group]}),
                    "component": (kinds.COMPONENT_REGISTER, {"key": ["here", f"C{node}"], "struct": {"x": "int"}}),
                }[what]
            )
    return found


def comparable(keyframe):
    """What of a keyframe a context can hold: strategies are functions."""
    sensors = {sensor_id for group in keyframe["sensor_kinds"] for sensor_id in group["ids"]}
    left_out = ("strategies", "numbers", "next", "pace", "chance", "turn", "sensor_kinds")
    return {key: value for key, value in keyframe.items() if key not in left_out} | {"sensors": sensors}


@settings(deadline=None)
@given(programmes())
def test_events_come_to_the_same_live_and_detached(programme):
    with grid_context() as ctx:
        ctx.record.start(io.BytesIO())
        begin = capture_state(ctx) | pack_components(ctx)
        detached = DetachedState(begin)
        replayer = Replayer(ctx)
        for kind, data in programme:
            replayer.apply(kind, data)
            detached.apply_event(kind, data)
        live = capture_state(ctx) | pack_components(ctx)
        np.testing.assert_equal(comparable(detached.make_keyframe(0)), comparable(live))


def test_an_event_that_cannot_happen_changes_nothing_and_is_not_noted():
    stream = io.BytesIO()
    with empty_context() as ctx:
        ctx.record.start(stream)
        before = capture_state(ctx)
        replayer = Replayer(ctx)
        with pytest.raises(ValueError, match="cannot happen here"):
            replayer.apply(kinds.AGENT_TEAM, {"agent_name": "nobody", "team": 1})
        np.testing.assert_equal(capture_state(ctx), before)
        ctx.record.stop()
    with Reader(io.BytesIO(stream.getvalue())) as reader:
        assert reader.count_events() == {}


# -- keyframes follow from events ---------------------------------------------------------------------------------


@pytest.fixture
def a_keyframe_after_each_turn(monkeypatch):
    monkeypatch.setattr("gamms.recorder.turn_writer._TURNS_AT_ONCE", 1)
    monkeypatch.setattr("gamms.recorder.turn_writer._KEYFRAME_ENTRIES", 0)
    monkeypatch.setattr("gamms.recorder.turn_writer._KEYFRAME_TURNS", 0)


@pytest.mark.parametrize("game", [everything_of_version_3, flights_of_version_3, turns_of_version_3])
def test_a_replay_that_is_recorded_works_out_the_very_keyframes(game, a_keyframe_after_each_turn):
    data = recorded(game)
    with Reader(io.BytesIO(data)) as reader:
        assert reader.keyframe(50)[0] == 50
    assert copied(data) == data


def test_every_field_of_a_game_is_recorded_or_is_known_not_to_be():
    """A new field of `GameState` gets an event kind, and a line in one of these tables, or a place in this set."""
    not_recorded = {"errors", "counts", "timings", "moves", "departed", "last_turn", "start", "has_begun"}
    not_recorded |= {"stream_version", "marked", "drawn", "parts_played"}
    not_recorded |= {"under_way", "unlogged"}  # they follow from the messages
    by_itself = {"began", "turn"}  # with GAME_TURN
    names = {field.name for field in dataclasses.fields(GameState)} - {"deed_log", "row"} | {"deeds"}  # which they hold
    assert names - not_recorded == DETECTED.keys() | by_itself
    assert names >= not_recorded
    assert CAPTURED.keys() == DETECTED.keys() - {"events", "deeds", "messages", "facts"} | {
        "turn"
    }  # which snapshots hold


def test_codes_of_events_are_those_of_the_documented_format():
    page = (Path(__file__).parents[2] / "docs" / "recording-format.md").read_text(encoding="utf-8")
    documented = {int(code, 16) for code in re.findall(r"\b0[0-9A-F]{7}\b", page)}
    assert len(documented) > 30
    assert documented <= set(EVENTS)
