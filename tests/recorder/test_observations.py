"""`Recording.observation`: the very state by which an agent decided."""

import copy
import io
from itertools import islice

import numpy as np
import pytest

import gamms
from gamms import recorder, recordings, web
from gamms.agent import AgentType
from gamms.errors import BadValue, UnknownName
from gamms.game.turn import TurnEngine
from gamms.ir import events as kinds
from gamms.knowledge import looks as sensed
from gamms.knowledge.fields import FieldTable, find_places
from gamms.recorder import RecordingError
from gamms.sensor import SensorType
from gamms.sensor.detection import DetectingSensor
from gamms.sensor.ground import AgentSensor

QUIET = {"level": "CRITICAL"}


def rng_of(state):
    """What the agent's stream would give next; each turn begins it again."""
    return state["rng"].random(3).tolist()


def look_and_spoil(seen):
    """A strategy that keeps a copy of all it is told, and then spoils what it may."""

    def strategy(state):
        told = {key: value for key, value in state.items() if key not in ("rng", "draw")}
        seen[state["turn"] + 1, state["name"]] = copy.deepcopy({**told, "facts": dict(state["facts"])})
        seen[state["turn"] + 1, state["name"]]["lots"] = rng_of(state)
        state["memory"].setdefault("been", set()).add(state["curr_pos"])
        state["team_memory"].setdefault("been", []).append(state["turn"])
        if state["legal"]:
            state["action"] = state["legal"][state["turn"] % len(state["legal"])]
        else:
            state["action"] = (1.0, 0.5, 0.0)
        for _, data in state["sensor"].values():
            data.clear() if hasattr(data, "clear") else None

    return strategy


def build(seen):
    ctx = gamms.create_context(seed=6, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6, 10.0))
    strategy = look_and_spoil(seen)
    kinds = (SensorType.NEIGHBOR, SensorType.RANGE, SensorType.AGENT_RANGE, SensorType.ARC, SensorType.OCCLUDED_MAP)
    for i, node in enumerate((0, 8, 14)):
        sensors = {}
        for kind in kinds:
            more = {} if kind is SensorType.NEIGHBOR else {"sensor_range": 25.0}
            if kind is SensorType.AGENT_RANGE:
                more["detection"] = 0.5
            sensors[kind.name.lower()] = ctx.sensor.create_sensor(f"{kind.name} {i}", kind, **more)
        name = f"walker_{i}"
        ctx.agent.create_agent(name, start_node_id=node, team="red", sensors=sensors, strategy=strategy)
    ctx.sensor.from_function(
        "smell", lambda ctx, agent: {"strength": agent.current_node_id * 0.5, "from": ("west", agent.name)}
    )
    ctx.agent.get_agent("walker_0").register_sensor("smell", ctx.sensor.get_sensor("smell"))
    ctx.sensor.create_sensor("below", SensorType.AERIAL, sensor_range=40.0)
    ctx.sensor.create_sensor("traffic", SensorType.AERIAL_AGENT, sensor_range=60.0)
    ctx.agent.create_agent(
        "kite", start_node_id=7, type=AgentType.AERIAL, speed=3.0, sensors=["below", "traffic"], strategy=strategy
    )
    ctx.agent.get_agent("kite").position = (20.0, 20.0, 15.0)

    def weather(ctx):
        """Changes the world before anybody looks."""
        ctx.game.publish(wind=ctx.game.turn)
        if ctx.game.turn == 3:
            ctx.agent.get_agent("walker_1").current_node_id = 35
            ctx.agent.create_agent("late", start_node_id=1, team="red", sensors={"near": near}, strategy=strategy)
        if ctx.game.turn == 5:
            ctx.game.eliminate("walker_2")

    near = ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    ctx.game.add(weather, phase="before")
    ctx.game.configure({"legal": "any", "on_error": "raise"})
    return ctx


@pytest.fixture(scope="module")
def game():
    """A recording, and what its agents were told."""
    seen, stream = {}, io.BytesIO()
    with build(seen) as ctx:
        ctx.record.start(stream, sensed=True)
        ctx.game.run(8)
        ctx.record.stop()
    return recorder.open(io.BytesIO(stream.getvalue())), seen


def test_an_observation_is_the_very_state_that_the_strategy_got(game):
    recording, seen = game
    assert {turn for turn, _ in seen} == set(range(1, 9))
    for (turn, name), told in seen.items():
        state = recording.observation(turn, name)
        lots = rng_of(state)
        del state["rng"], state["draw"]
        assert list(state) == [key for key in told if key != "lots"]
        assert {**state, "facts": dict(state["facts"]), "lots": lots} == told, (turn, name)


def test_the_table_of_sensor_data_has_nodes_and_agents(game):
    recording, seen = game
    table = recording.table("sensed", 2, 4)
    rows = list(zip(*(column.tolist() for column in table.values()), strict=True))
    assert {row[0] for row in rows} == {2, 3}
    near = [node for turn, agent, sensor, node, _ in rows if (turn, agent, sensor) == (3, "walker_1", "neighbor")]
    assert near == seen[3, "walker_1"]["sensor"]["neighbor"][1]
    others = {
        other: node for turn, agent, sensor, node, other in rows if (agent, sensor) == ("walker_0", "agent_range")
    }
    assert set(others) <= {"walker_1", "walker_2"}
    assert list(table) == ["turn", "agent", "sensor", "node", "other"]
    assert len(recording.table("sensed", 5, 5)["node"]) == 0


@pytest.mark.parametrize("given", [[1, 2, 3], {"anna": 5}, {"nodes": {1: None}, "edges": []}])
def test_the_result_of_a_function_is_not_taken_for_nodes_or_agents(given):
    stream = io.BytesIO()
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, 10.0))
        ctx.sensor.from_function("dice", lambda: given)
        ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
        ctx.agent.create_agent("anna", start_node_id=0, sensors=["dice", "near"], strategy=lambda state: None)
        ctx.record.start(stream, sensed=True)
        ctx.game.run(1)
    with recorder.open(io.BytesIO(stream.getvalue())) as recording:
        assert set(recording.table("sensed")["sensor"]) == {"near"}
        assert recording.observation(1, "anna")["sensor"]["dice"][1] == given


def test_sensing_changes_nothing_by_being_recorded(game):
    recording, _ = game
    stream = io.BytesIO()
    with build({}) as ctx:
        ctx.record.start(stream, sensed=False)
        ctx.game.run(8)
        ctx.record.stop()
    with recorder.open(io.BytesIO(stream.getvalue())) as other:
        assert np.array_equal(other.table("moves")["node"], recording.table("moves")["node"])
        with pytest.raises(BadValue, match="sensed=True"):
            other.observation(3, "walker_0")


@pytest.mark.parametrize(("sensed", "turns"), [(None, [3, 4]), (True, [1, 2, 3, 4]), (False, [])])
def test_reports_are_recorded_once_an_agent_carries_a_sensor_unless_they_are_left_out(sensed, turns):
    stream = io.BytesIO()
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, 10.0))
        for node in (0, 1):
            ctx.agent.create_agent(f"a{node}", start_node_id=node, strategy=gamms.strategies.random_walk)
        near = ctx.sensor.create_sensor("near", SensorType.RANGE, sensor_range=15.0)
        ctx.record.start(stream, sensed=sensed)
        ctx.game.run(2)
        ctx.agent.get_agent("a0").register_sensor("near", near)
        ctx.game.run(2)
        ctx.record.stop()
    with recorder.open(io.BytesIO(stream.getvalue())) as recording:
        assert [turn + 1 for turn, *_ in recording.reader.events(kinds={kinds.SENSED})] == turns
        if turns:
            assert set(recording.table("sensed")["turn"]) == {3, 4}
            assert list(recording.observation(3, "a0")["sensor"]) == ["near"]


def test_a_recording_without_observations_is_refused(game):
    recording, _ = game
    with pytest.raises(BadValue, match="no turn 0"):
        recording.observation(0, "walker_0")
    with pytest.raises(BadValue, match="no turn 9"):
        recording.observation(9, "walker_0")
    with pytest.raises(UnknownName, match="'walker'"):
        recording.observation(2, "walker")
    with pytest.raises(UnknownName, match="living agent"):
        recording.observation(8, "walker_2")
    with pytest.raises(UnknownName, match="late"):
        recording.observation(2, "late")


def test_agents_are_listed_once_unless_looks_differ_about_their_nodes():
    numbers = {"anna": 300, "bert": 2, "carl": 1}
    reports = [
        (300, {"eyes": {"bert": 7, "carl": 9}}),
        (2, {"eyes": {"anna": 4, "carl": 9}, "ears": {}}),
        (1, {"eyes": {"bert": 70_000}}),
    ]
    looks = [
        (agent, [sensed.make_look(name, SensorType.AGENT, data, numbers, numbers) for name, data in own.items()])
        for agent, own in reports
    ]
    data = sensed.make_columns(looks, FieldTable(), 0)
    assert data["seen"].tolist() == [1, 2, 300]
    assert data["seen_at"].tolist() == [9, 70_000, 4]
    assert data["ids"].tolist() == [2, 1, 7, 9, 2, 0, 1]
    flat = [(number, look) for number, own in looks for look in own]
    assert sensed.decode_looks(data) == flat
    assert sensed.decode_looks(data, 2) == flat[1:3]
    renumbered = sensed.decode_looks(sensed.renumber_looks(data, lambda number: number + 1000))
    assert [look.first for _, look in renumbered] == [[1002, 1001], [1300, 1001], [], [1002]]
    assert [look.second for _, look in renumbered] == [look.second for _, look in flat]
    for key, value in (("seen", np.array([1])), ("seen_at", np.array([0.5] * 3)), ("ids", np.array([-1] * 7))):
        with pytest.raises((ValueError, TypeError, IndexError)):
            sensed.decode_looks({**data, key: value})


def spoil(recording, header, keyframe, events):
    """The first turn of a recording, with other values in the header and the first keyframe, and with more events."""
    reader = recording.reader
    stream = io.BytesIO()
    writer = recorder.Writer(stream, reader.header | header, seconds=None)
    writer.keyframe(reader.keyframe(0)[1] | keyframe)
    writer.add_turn([*reader.log(0), *events])
    writer.close()
    return recorder.open(io.BytesIO(stream.getvalue()))


@pytest.mark.parametrize(
    ("header", "keyframe", "events"),
    [
        ({"sides": [3]}, {}, []),
        ({}, {"team_memories": [("red", (1, 2))]}, []),
        ({}, {}, [(kinds.USER_EVENT, 2.5)]),
    ],
)
def test_pages_of_values_of_other_types_are_refused(game, header, keyframe, events):
    with spoil(game[0], header, keyframe, events) as recording, pytest.raises(RecordingError):
        web.page(recording)


@pytest.mark.parametrize(
    ("keyframe", "events"),
    [({"teams": ["red"] * 9}, []), ({"teams": [np.zeros(2)] * 4}, []), ({}, [(kinds.AGENT_CREATE, [1])])],
)
def test_cuts_of_values_of_other_types_are_refused(game, keyframe, events):
    with spoil(game[0], {}, keyframe, events) as recording, pytest.raises(RecordingError):
        recording.cut(io.BytesIO(), "red")


# -- covered nodes ------------------------------------------------------------------------------------------------


def roam(state):
    legal = state["legal"]
    state["action"] = legal[(state["turn"] * 7 + state["curr_pos"]) % len(legal)]


def build_lookouts(turns):
    """Agents with sensors of all kinds that report agents; and for each turn agent, sensor -> the covered nodes."""
    ctx = gamms.create_context(seed=6, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6, 10.0))
    ctx.graph.add_obstacles([[(25.0, 28.0, 9.0), (25.0, 12.0, 9.0), (25.0, 28.0, 0.0), (25.0, 12.0, 0.0)]])
    kinds_of_sensors = {
        "disc": ("agent_range", {}),
        "late": ("agent_range", {"delay_turns": 2, "position_noise_m": 3.0, "detection": 0.5}),
        "fan": ("agent_arc", {"fov": 1.5}),
        "tower": ("agent_range", {"at": 14}),
        "mast": ("agent_range", {"at": (12.0, 31.0)}),
        "blocked": ("occluded_agent", {}),
        "everywhere": ("agent", {}),
        "streets": ("range", {}),
    }
    for number, node in enumerate((0, 20)):
        sensors = {}
        for name, (kind, more) in kinds_of_sensors.items():
            given = {} if name == "everywhere" else {"sensor_range": 25.0}
            sensors[name] = ctx.sensor.create_sensor(f"{name} {number}", kind, **given, **more)
        speed = {"speed": 3.0} if number else {}
        ctx.agent.create_agent(
            f"walker_{number}", start_node_id=node, team="red", sensors=sensors, strategy=roam, **speed
        )
    ctx.sensor.create_sensor("traffic", SensorType.AERIAL_AGENT, sensor_range=30.0)
    ctx.agent.create_agent(
        "kite",
        start_node_id=7,
        type=AgentType.AERIAL,
        speed=3.0,
        sensors=["traffic"],
        strategy=lambda s: s.update(action=(1, 1, 0)),
    ).position = (20.0, 20.0, 15.0)
    ctx.game.configure({"speed_unit": "metres"})

    def note_covered(agents, _):
        places = find_places(ctx)
        turns.append(
            {
                (agent.name, name): sorted(
                    sensor.coverage(places.get(agent.name, agent.current_node_id), agent.name).node_ids.tolist()
                )
                for agent in agents
                for name, sensor in agent.sensors.items()
                if name not in ("streets", "everywhere")
            }
        )

    ctx.game.internals.after_observing.append(note_covered)
    return ctx


@pytest.fixture(scope="module")
def lookouts():
    """A recording, and the covered nodes of each turn."""
    turns, stream = [], io.BytesIO()
    with build_lookouts(turns) as ctx:
        ctx.record.start(stream, sensed=True)
        ctx.game.run(270)
        ctx.record.stop()
    return stream.getvalue(), turns


def fields_in(recording, start=0):
    """Yield the number of a turn, and agent, sensor -> its recorded field."""
    table = FieldTable()
    for turn, _, _, data in recording.reader.events(start, kinds={kinds.SENSED}):
        looks = sensed.decode_looks(data, fields=table)
        names = recording[turn].agents["name"].tolist()
        yield turn, {(names[number], look.sensor): look.field for number, look in looks}


def test_recordings_have_the_nodes_that_sensors_cover(lookouts):
    data, turns = lookouts
    with recorder.open(io.BytesIO(data)) as recording, gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.storage.unpack(recording.graph.packed)
        read = {}
        for turn, fields in fields_in(recording):
            covered = {key: one.list_nodes(ctx.graph.graph).tolist() for key, one in fields.items() if one is not None}
            assert covered == turns[turn], turn
            read[turn] = fields
        assert len({tuple(nodes) for one in turns for nodes in one.values()}) > 100
        assert any(isinstance(one.place, tuple) for (_, name), one in read[5].items() if name == "disc" and one)
        assert dict(fields_in(recording, 256)) == {turn: read[turn] for turn in range(256, 270)}
        later = dict(fields_in(recording, 100))
        assert all(one in (None, read[turn][key]) for turn, fields in later.items() for key, one in fields.items())
        assert later[256] == read[256]


def test_each_field_is_written_once(lookouts):
    with recorder.open(io.BytesIO(lookouts[0])) as recording:
        events = [data for *_, data in recording.reader.events(0, 256, kinds={kinds.SENSED})]
    written = [field for data in events for field in data["new_fields"]]
    assert len(written) == len(set(written))
    assert len(written) < sum(np.count_nonzero(data["fields"]) for data in events) / 3


def test_a_replay_is_recorded_with_the_same_bytes(lookouts, tmp_path):
    (tmp_path / "game.ggr").write_bytes(lookouts[0])
    recordings.verify(tmp_path / "game.ggr")
    with gamms.create_context(logger_config=QUIET) as ctx, recorder.open(io.BytesIO(lookouts[0])) as recording:
        stream = io.BytesIO()
        for record in ctx.record.replay(recording):
            if record["opCode"] == kinds.SIMULATE and record["timestamp"] == 39 * 10**9:
                ctx.record.start(stream, sensed=True)
        ctx.record.close()
        with recorder.open(io.BytesIO(stream.getvalue())) as again:
            known = dict(fields_in(recording))
            copied = [fields for _, fields in fields_in(again)]
        assert len(copied) == 230
        for turn, fields in enumerate(copied, 40):
            assert all(one in (None, known[turn][key]) for key, one in fields.items())
        assert copied[-1] == known[269]


def rewritten(data, *, with_fields):
    """The first turns of a recording; agents stay in the last one. Without fields it is one of an earlier format."""
    turns = 60
    stream = io.BytesIO()
    with recorder.open(io.BytesIO(data)) as recording:
        writer = recorder.Writer(stream, recording.reader.header, seconds=None)
        writer.keyframe(recording.reader.keyframe(0)[1])
        for turn, log in enumerate(islice(recording.logs(), turns), 1):
            for at, entry in enumerate(log):
                if type(entry) is tuple and entry[0] == kinds.SENSED:
                    left = {key: value for key, value in entry[1].items() if with_fields or "field" not in key}
                    log[at] = (kinds.SENSED, left)
            is_last = turn == turns
            writer.add_turn(
                [entry for entry in log if not is_last or (type(entry) is tuple and entry[0] == kinds.SENSED)]
            )
        writer.close()
    return stream.getvalue()


def test_pages_ask_no_sensor_for_its_field_and_older_recordings_give_the_same_page(lookouts, monkeypatch):
    data, old = (rewritten(lookouts[0], with_fields=with_fields) for with_fields in (True, False))
    assert len(old) < len(data)
    with recorder.open(io.BytesIO(old)) as recording:
        expected = web.page(recording)
    asked = []
    ask = DetectingSensor.coverage
    monkeypatch.setattr(DetectingSensor, "coverage", lambda *given: asked.append(given) or ask(*given))
    with recorder.open(io.BytesIO(data)) as recording:
        assert web.page(recording) == expected
    assert asked == []
    with recorder.open(io.BytesIO(old)) as recording:
        web.page(recording)
    assert asked != []


def test_a_page_of_fields_that_do_not_fit_the_map_is_refused(lookouts):
    damaged = lookouts[0]
    stream = io.BytesIO()
    with recorder.open(io.BytesIO(damaged)) as recording:
        writer = recorder.Writer(stream, recording.reader.header, seconds=None)
        writer.keyframe(recording.reader.keyframe(0)[1])
        log = recording.reader.log(0)
        at = next(at for at, entry in enumerate(log) if type(entry) is tuple and entry[0] == kinds.SENSED)
        fields = [(99, 25.0, b"")] * len(log[at][1]["new_fields"])
        log[at] = kinds.SENSED, {**log[at][1], "new_fields": fields}
        writer.add_turn(log)
        writer.close()
    with (
        recorder.open(io.BytesIO(stream.getvalue())) as recording,
        pytest.raises(RecordingError, match="sensed is not right"),
    ):
        web.page(recording)


# -- agents around an agent ---------------------------------------------------------------------------------------


def build_crowd(told, *, strategy=None, moves_node=False, others=()):
    """Agents whose sensors report all agents around them, of some teams; `told` receives what each was told."""
    ctx = gamms.create_context(seed=3, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6, 10.0))
    sensors = {"near": {"sensor_range": 20.0}, "wide": {"sensor_range": 31.7}, "all": {}}
    filters = {"red": {"team": "blue"}, "blue": {"exclude": ["blue", "none"]}, None: {}}

    def note(state):
        told[state["turn"] + 1, state["name"]] = {key: as_items(report) for key, (_, report) in state["sensor"].items()}
        roam(state)

    def add(name, team):
        carried = {}
        for key, given in sensors.items():
            kind = "agent" if key == "all" else "agent_range"
            carried[key] = ctx.sensor.create_sensor(f"{key} of {name}", kind, **given, **filters[team])
        for kind, given in others:
            carried[kind] = ctx.sensor.create_sensor(f"{kind} of {name}", kind, **given)
        decide = note if strategy is None else strategy
        ctx.agent.create_agent(name, start_node_id=5 * len(name) % 36, team=team, sensors=carried, strategy=decide)

    for number, team in enumerate(["red", "blue", None, "blue", "red", None]):
        add("z" * (number + 1) if number % 2 else f"a{number}", team)

    def change(ctx):
        if ctx.game.turn == 3:
            ctx.game.eliminate("zz")
            add("newcomer", "red")
        if ctx.game.turn == 5:
            ctx.agent.get_agent("a0").team = "blue"
            ctx.sensor.get_sensor("near of a4").range = 12.0
        if ctx.game.turn == 6 and moves_node:
            ctx.graph.graph.add_node({"id": 99, "x": 500.0, "y": 500.0})

    ctx.game.add(change, phase="before")
    return ctx


def as_items(report):
    return list(report.items() if isinstance(report, dict) else report)


def record_crowd(told, observer=None, *, sensed=None, **given):
    stream = io.BytesIO()
    with build_crowd(told, **given) as ctx:
        ctx.record.start(stream, sensed=sensed)
        if observer is not None:
            ctx.game.internals.after_observing.append(observer)
        ctx.game.run(9)
        ctx.record.stop()
    return stream.getvalue()


def forms_in(data):
    with recorder.open(io.BytesIO(data)) as recording:
        return [set(event["forms"].tolist()) for *_, event in recording.reader.events(kinds={kinds.SENSED})]


@pytest.mark.parametrize("moves_node", [False, True])
def test_readers_find_the_agents_in_discs_in_the_order_in_which_they_were_reported(moves_node):
    told = {}
    data = record_crowd(told, moves_node=moves_node)
    assert forms_in(data) == [{6}] * 6 + [{5} if moves_node else {6}] * 3
    with recorder.open(io.BytesIO(data)) as recording:
        read = {}
        table = recording.table("sensed")
        for turn, agent, sensor, node, other in zip(*(column.tolist() for column in table.values()), strict=True):
            read.setdefault((turn, agent), {}).setdefault(sensor, []).append((other, node))
        for key, reports in told.items():
            assert {name: read.get(key, {}).get(name, []) for name in reports} == reports
        for turn, name in [key for key in told if key[0] in (4, 7)]:
            state = recording.observation(turn, name)["sensor"]
            assert {key: as_items(report) for key, (_, report) in state.items()} == told[turn, name]
    assert any(len(one) > 3 for reports in told.values() for one in reports.values())


def test_recording_discs_calls_no_sensor_and_gives_the_bytes_that_states_give(monkeypatch):
    plain = {"strategy": gamms.strategies.random_walk}
    asked = record_crowd({}, lambda agents, states: None, **plain)
    called = []
    sense = AgentSensor.sense
    monkeypatch.setattr(AgentSensor, "sense", lambda self, *given: called.append(self) or sense(self, *given))
    record_crowd({}, sensed=False, **plain)
    count = len(called)
    called.clear()
    assert record_crowd({}, **plain) == asked
    assert len(called) == count
    assert forms_in(asked) == [{6}] * 9


SOME_MISS = [
    ("agent_range", {"sensor_range": 25.0, "detection": 0.5}),
    ("agent_arc", {"sensor_range": 25.0, "fov": 2.0}),
]


@pytest.mark.parametrize("others", [(), SOME_MISS])
def test_pages_and_cuts_of_discs_are_those_of_listed_reports(others, monkeypatch):
    data = record_crowd({}, others=others)
    with monkeypatch.context() as patched:
        patched.setattr(sensed, "find_disc", lambda sensor, owner: None)
        listed = record_crowd({}, others=others)
    assert forms_in(data)[1] == ({5, 6} if others else {6})
    assert forms_in(listed)[1] == {5}
    found = []
    for one in (data, listed):
        cut = io.BytesIO()
        with recorder.open(io.BytesIO(one)) as recording:
            recording.cut(cut, "blue")
            found.append((web.page(recording), cut.getvalue()))
    assert found[0] == found[1]


@pytest.mark.parametrize(
    "others", [[("neighbor", {})], [("map", {}), ("neighbor", {})], [("range", {"sensor_range": 12.0})]]
)
def test_nodes_that_depend_on_where_agents_stand_are_recorded_as_states_have_them(others):
    told = {}
    data = record_crowd(told, others=others)
    assert data == record_crowd({}, lambda agents, states: None, others=others)
    with recorder.open(io.BytesIO(data)) as recording:
        for turn, name in [key for key in told if key[0] in (1, 6)]:
            reports = told[turn, name]
            state = recording.observation(turn, name)["sensor"]
            assert {key: [*map(str, one)] for key, one in reports.items()} == {
                key: [*map(str, as_items(report))] for key, (_, report) in state.items()
            }


def test_reports_of_the_last_turn_are_read_though_a_node_has_gone_since():
    stream = io.BytesIO()
    with gamms.create_context(seed=3, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 5, 10.0))
        for name, node in (("a", 0), ("b", 1)):
            eyes = ctx.sensor.create_sensor(f"eyes of {name}", "agent_range", sensor_range=12.0)
            ctx.agent.create_agent(name, start_node_id=node, sensors=[eyes], strategy=go_right)
        ctx.game.add(lambda ctx: ctx.graph.graph.remove_node(0))
        ctx.record.start(stream)
        ctx.game.step()
        ctx.record.stop()
    assert forms_in(stream.getvalue()) == [{6}]
    with gamms.create_context(logger_config=QUIET) as ctx:
        for _ in ctx.record.replay(io.BytesIO(stream.getvalue())):
            pass
        reports = ctx.visual.drawing.carriers.list_reports()
        seen = {name: report.look.second for (name, _), report in reports.items()}
        assert seen == {"a": [1], "b": [0]}
        assert all(report.is_early for report in reports.values())


def go_right(state):
    state["action"] = max(state["legal"])


def test_the_table_of_reports_from_discs_needs_the_map(tmp_path):
    path = tmp_path / "game.ggr"
    with build_crowd({}) as ctx:
        ctx.record.start(path, embed_graph=False)
        ctx.game.run(2)
        ctx.record.stop()
        with recorder.open(path) as recording, pytest.raises(RecordingError, match="does not contain its map"):
            recording.table("sensed")
        with recorder.open(path, graph=ctx) as recording:
            assert len(recording.table("sensed")["node"])
        written, _ = recordings.to_csv(path, tmp_path / "game.csv")
    assert {file.name for file in written} >= {"game_moves.csv"}
    assert not (tmp_path / "game_sensed.csv").exists()


def test_damaged_discs_are_refused():
    (event, *_), columns = discs_of(record_crowd({}))
    assert len(sensed.decode_looks(event, get_map=columns)) == 18
    damages = {
        "seen": event["seen"] + 1,
        "seen_at": event["seen_at"].astype(np.int64) + 1000,
        "radii": [event["radii"] * value for value in (-1.0, np.nan)] + [event["radii"][:1], [1.0]],
        "shown": [event["shown"][:, :2], event["shown"].astype(np.int8)],
        "which": event["which"] + 50,
    }
    for key, values in damages.items():
        for value in values if isinstance(values, list) else [values]:
            with pytest.raises((KeyError, ValueError, TypeError, IndexError)):
                sensed.decode_looks({**event, key: value}, get_map=columns)
    with pytest.raises(ValueError, match="no map"):
        sensed.decode_looks(event)
    with pytest.raises(ValueError, match="more than 16777216 in a turn"):
        sensed.refuse_many([event] * (sensed.MOST_IN_DISCS // 100))


def discs_of(data):
    """Return the data of the events of a recording, and a function that returns its map."""
    with recorder.open(io.BytesIO(data)) as recording:
        columns = recording.graph.columns()
        return [event for *_, event in recording.reader.events(kinds={kinds.SENSED})], lambda: columns


def add_hundred_walkers(ctx):
    """Let agents with sensors walk at random on a grid, for which the core decides."""
    ctx.graph.attach_networkx_graph(gamms.graph.grid(20, 20, 10.0))
    for number in range(100):
        eyes = ctx.sensor.create_sensor(f"eyes {number}", "agent_range", sensor_range=60.0)
        ctx.agent.create_agent(
            f"a{number}", start_node_id=4 * number, sensors=[eyes], strategy=gamms.strategies.random_walk
        )


def test_a_recorded_turn_makes_no_states_of_agents_for_which_the_core_decides(monkeypatch):
    made = []
    read_states = TurnEngine._read_states
    monkeypatch.setattr(TurnEngine, "_read_states", lambda turns: made.append(turns) or read_states(turns))
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        add_hundred_walkers(ctx)
        ctx.record.start(io.BytesIO())
        ctx.game.run(9)
        assert made == []


def test_reports_of_a_hundred_agents_take_few_bytes():
    sizes = []
    for sensed_too in (None, False):
        stream = io.BytesIO()
        with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
            add_hundred_walkers(ctx)
            ctx.record.start(stream, sensed=sensed_too)
            ctx.game.run(20)
            ctx.record.stop()
        sizes.append(len(stream.getvalue()))
    assert sizes[0] - sizes[1] < 6_000, sizes  # 100 agents report about 20 others each


def test_a_team_is_not_told_what_a_team_with_the_same_text_knows():
    file = io.BytesIO()
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 9))
        ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=5.0)
        ctx.agent.create_agent("number", team=1, start_node_id=0, sensors=["eyes"])
        ctx.agent.create_agent("text", team="1", start_node_id=8)
        ctx.record.start(file, sensed=True)
        ctx.game.step()
        ctx.record.stop()
    known = {}
    with recorder.open(io.BytesIO(file.getvalue())) as recording:
        for team in (1, "1"):
            cut = io.BytesIO()
            recording.cut(cut, team)
            with recorder.open(io.BytesIO(cut.getvalue())) as opened, gamms.create_context(seed=2) as ctx:
                for _ in ctx.record.replay(opened):
                    known[team] = [agent.name for agent in ctx.agent.create_iter()]
    assert known == {1: ["number"], "1": ["text"]}
