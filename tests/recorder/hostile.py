"""Recordings that small bytes make costly: each builder gives the bytes of a whole one, as large as its argument says.

They are finished and have right checksums, so that every command takes them for what they say.
"""

import io
from contextlib import contextmanager
from unittest import mock

import numpy as np

import gamms
from gamms.ir import events as kinds
from gamms.ir import packing
from gamms.recorder import Reader, Writer

PRIME = (1 << 61) - 1  # the hash of an integer is what is left when it is divided by this


def alike(count):
    """Different integers of one hash."""
    return [PRIME * i + 5 for i in range(16, 16 + count)]


def honest(turns=2):
    """Header and first keyframe of a small recording that can be replayed."""
    stream = io.BytesIO()
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        for id in range(3):
            ctx.graph.graph.add_node({"id": id, "x": float(id), "y": 0.0})
        ctx.graph.graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 1.0})
        ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
        ctx.agent.create_agent("anna", start_node_id=0, sensors=["near"], team="red")
        ctx.record.start(stream)
        for _ in range(turns):
            ctx.visual.simulate()
        ctx.record.stop()
    stream.seek(0)
    reader = Reader(stream)
    return reader.header, reader.keyframe(0)[1]


@contextmanager
def unpadded():
    """Write blocks that take less than readers believe."""
    with mock.patch.object(packing, "pad_bytes", lambda body, _: body):
        yield


def recording(logs=(), state=None, header=None, *, turns=64, size=1 << 40, states=()):
    """The bytes of a recording: what the header and the first keyframe have besides, logs, and later keyframes."""
    base, begin = honest()
    stream = io.BytesIO()
    with unpadded():
        writer = Writer(stream, base | (header or {}), turns=turns, size=size, seconds=None)
        writer.keyframe(begin | (state or {}))
        for log in logs:
            writer.add_turn(log)
        for more in states:
            writer.keyframe(begin | more)
        writer.close()
    return stream.getvalue()


def created(name, node=0):
    return (kinds.AGENT_CREATE, {"name": name, "kwargs": {"start_node_id": node}})


def deleted(name):
    return (kinds.AGENT_DELETE, {"name": name})


def team_of(name, team="blue"):
    return (kinds.AGENT_TEAM, {"agent_name": name, "team": team})


def crowd(count):
    """What a keyframe says of so many agents."""
    column, rows = np.zeros(count, np.int64), np.full((count, 4), np.nan)
    return {
        "names": [f"agent_{i}" for i in range(count)],
        "numbers": np.arange(count),
        "next": count,
        "kind": column,
        "node": column,
        "came": column,
        "heading": rows[:, :2],
        "position": rows[:, :3],
        "previous_position": rows[:, :3],
        "quat": rows,
        "alive": column + 1,
        "carry": column * 0.0,
        "teams": [None] * count,
        "speed": [None] * count,
        "carried": {"names": None, "ids": column[:0], "others": [], "counts": column},
        "attributes": {},
        "strategies": [None] * count,
    }


def sensors(count):
    return (kinds.SENSORS, {"sensor_kinds": [{"type": "NEIGHBOR", "keywords": {}, "ids": [f"more {count}"]}]})


# -- keys of one hash -------------------------------------------------------------------------------------------

COLLISIONS = {
    "scores in a keyframe": lambda n: recording(state={"scores": [(key, 0) for key in alike(n)]}),
    "scores in an event": lambda n: recording([[(kinds.GAME_SCORES, {"scores": [(key, 0) for key in alike(n)]})]]),
    "team memories": lambda n: recording(state={"team_memories": [(key, {}) for key in alike(n)]}),
    "memories": lambda n: recording(state={"memories": {"anna": dict.fromkeys(alike(n), 0)}}),
    "events of one key": lambda n: recording([[(kinds.GAME_DATA, {"set": {key: 0}}) for key in alike(n)]]),
    "events of one key in many turns": lambda n: recording(
        [[(kinds.GAME_DATA, {"set": {key: 0}})] for key in alike(n)]
    ),
    "memories of one key": lambda n: recording(
        [[(kinds.GAME_MEMORY, {"agents": {"anna": {"set": {key: 0}}}, "teams": []}) for key in alike(n)]]
    ),
    "memories of one team": lambda n: recording(
        [[(kinds.GAME_MEMORY, {"agents": {}, "teams": [(key, {"set": {"a": 0}})]}) for key in alike(n)]]
    ),
    "facts of one key": lambda n: recording(
        [[(kinds.GAME_FACTS, {"set": {key: 0}, "removed": []}) for key in alike(n)]]
    ),
    "teams": lambda n: recording([[team_of("anna", key) for key in alike(n)]]),
    "names of components": lambda n: recording(
        [
            [(0x02000000, {"key": ["m", "C"], "struct": {"a": "int"}})]
            + [(0x02000001, {"name": key, "type": ["m", "C"]}) for key in alike(n)]
        ]
    ),
    "names of component classes": lambda n: recording(
        [[(0x02000000, {"key": ["m", key], "struct": {}}) for key in alike(n)]]
    ),
    "names of sensors": lambda n: recording(
        [[(kinds.AGENT_SENSOR_REGISTER, {"agent_name": "anna", "name": key, "sensor_id": "near"}) for key in alike(n)]]
    ),
    "tuples": lambda n: recording(state={"data": {"a": {(key, 1): 0 for key in alike(n)}}}),
    "events of one tuple": lambda n: recording([[(kinds.GAME_DATA, {"set": {(key, 1): 0}}) for key in alike(n)]]),
    "a set": lambda n: recording(state={"data": {"a": set(alike(n))}}),
    "events of the user": lambda n: recording([[(kinds.USER_EVENT, {"kind": "a", key: 0}) for key in alike(n)]]),
    "the header": lambda n: recording(header={"provenance": dict.fromkeys(alike(n), 0)}),
}

# -- memory -----------------------------------------------------------------------------------------------------


def texts(count):
    """Texts that are all the same, which deflate best."""
    return ["x" * 40] * count


def spec(name):
    """What the header says of an artist whose draw commands are recorded."""
    return {"name": name, "kind": "drawing", "keywords": {}, "layer": 30, "visible": True}


def drawing(name, points):
    """One line of so many points in one place."""
    columns = {column: np.zeros(1) for column in ("size", "width", "angle")}
    columns |= {"kind": np.array([3]), "space": np.zeros(1, int), "color": np.zeros((1, 4), int)}
    columns |= {"counts": np.array([points]), "points": np.zeros((points, 2))}
    return {"artist": name, "layer": 30, "visible": True, "commands": columns, "start": columns["points"]}


MEMORY = {
    "empty lists": lambda n: recording(state={"data": {"a": [[]] * n}}),
    "empty dicts": lambda n: recording(state={"data": {"a": [{}] * n}}),
    "empty tuples": lambda n: recording(state={"data": {"a": [()] * (n // 8)}}),
    "texts": lambda n: recording(state={"data": {f"a{i}": texts(n // 8) for i in range(2)}}),
    "texts in the header": lambda n: recording(header={"provenance": {f"a{i}": texts(n // 8) for i in range(2)}}),
    "lists in events": lambda n: recording(
        [[(kinds.GAME_DATA, {"set": {f"a{i}": [[]] * (n // 20)}})] for i in range(20)], turns=1
    ),
    "texts in events": lambda n: recording(
        [[(kinds.GAME_DATA, {"set": {f"a{i}": texts(n // 160)}})] for i in range(20)], turns=1
    ),
    "lists in events of the user": lambda n: recording(
        [[(kinds.USER_EVENT, {"kind": "a", "x": [[]] * (n // 20)})] for _ in range(20)], turns=1
    ),
    "keyframes": lambda n: recording([[]] * 8, states=[{"data": {"a": [[]] * (n // 8)}} for _ in range(8)], turns=1),
    "zeros": lambda n: recording(state={"data": {"a": np.zeros(n)}}),
    "agents": lambda n: recording(state=crowd(n // 64)),
    "turns without events": lambda n: recording([[]] * n, turns=1 << 16),
    "moves to one node": lambda n: recording([[0, 0] * (n // 16)] * 16),
    "drawings": lambda n: recording(
        [[(kinds.VISUAL_COMMANDS, drawing(f"a{i}", n // 320)) for i in range(20)]],
        header={"visuals": {"artists": [spec(f"a{i}") for i in range(20)], "is_declared": False}},
    ),
}

# -- time -------------------------------------------------------------------------------------------------------

TIME = {
    "a long name among many": lambda n: recording(
        [[0, 0] * n], crowd(n) | {"names": ["x" * n, *crowd(n)["names"][1:]]}
    ),
    "events of many kinds of columns": lambda n: recording(
        [[(kinds.USER_EVENT, {"kind": "a", f"{i}": i}) for i in range(n)]]
    ),
    "sensors come one by one": lambda n: recording([[sensors(i) for i in range(n)]]),
    "agents come one by one": lambda n: recording(
        [[one for i in range(n) for one in (created(f"agent {i}"), team_of("anna"))]]
    ),
    "agents go one by one": lambda n: recording([[deleted(f"agent_{i}") for i in range(n)]], crowd(n * 5 // 3)),
    "agents come and go": lambda n: recording(
        [[one for _ in range(n) for one in (created("agent_x"), deleted("agent_x"))]], crowd(n)
    ),
    "agents go and move": lambda n: recording(
        [[one for i in range(n // 2) for one in (deleted(f"agent_{i}"), n - 1, 1)] for _ in range(1)], crowd(n)
    ),
    "nobody goes": lambda n: recording([[deleted(f"nobody {i}") for i in range(n)]], crowd(n)),
    "teams change among many": lambda n: recording([[team_of("agent_0")]] * n, crowd(n)),
    "notes that never fit": lambda n: recording([[(kinds.USER_EVENT, {"kind": f"{i}", f"{i}": i}) for i in range(n)]]),
}
