"""What the tests of recordings share: small recordings, and a look at everything in one."""

import io

import numpy as np

from gamms.ir import events as kinds
from gamms.recorder import Reader, Writer

HEADER = {"package": "2.0.0", "seed": 7, "graph": {"ids": np.arange(5), "xy": np.zeros((5, 2))}}


def written(logs, header=HEADER, *, keyframes=False, close=True, **options):
    """The bytes of a recording."""
    stream = io.BytesIO()
    writer = Writer(stream, header, **{"seconds": None, **options})
    for turn, log in enumerate(logs):
        if keyframes and not turn % 320:
            writer.keyframe({"turn": turn, "nodes": np.arange(4) + turn})
        writer.add_turn(log)
    if close:
        writer.close()
    return stream.getvalue()


def opened(data):
    return Reader(io.BytesIO(data))


def logs_of(reader):
    return [reader.log(turn) for turn in range(reader.turns)]


def read_all(data):
    """Every part of a recording by every way, and its logs."""
    reader = opened(data)
    reader.verify()
    logs = logs_of(reader)
    turns, rows, nodes = reader.moves()
    events = list(reader.events())
    assert len(turns) == len(rows) == len(nodes) == sum(type(one) is not tuple for log in logs for one in log) // 2
    assert len(events) == sum(type(one) is tuple for log in logs for one in log)
    for turn in range(reader.turns + 1):
        reader.keyframe(turn)
    return reader, logs


def fly(agents, turns, seed=0):
    """Agents who each fly straight on, or elsewhere, and sometimes turn; the logs of the turns."""
    rng = np.random.default_rng(seed)
    places, ways, logs = rng.normal(size=(agents, 3)), rng.normal(size=(agents, 3)), []
    for _ in range(turns):
        ways = np.where(rng.random((agents, 1)) < 0.2, rng.normal(size=(agents, 3)), ways)
        places = places + ways
        nodes, turned = rng.integers(0, 9, agents).tolist(), rng.normal(size=(agents, 4)).tolist()
        log = [(kinds.AERIAL_AGENT_FLIGHT, (i, nodes[i], *place)) for i, place in enumerate(places.tolist())]
        log += [(kinds.AERIAL_AGENT_TURN, (i, *turned[i])) for i in range(agents) if rng.random() < 0.3]
        logs.append(log)
    return logs


def walk(agents, turns, n=20, seed=0):
    """Agents on a grid who each stay, or go to one of the four neighbours; the logs of the turns."""
    rng = np.random.default_rng(seed)
    places = rng.integers(0, n, (agents, 2))
    ways = np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
    logs = []
    for _ in range(turns):
        aims = places + ways[rng.integers(0, 5, agents)]
        is_inside = ((aims >= 0) & (aims < n)).all(axis=1)
        places = np.where(is_inside[:, None], aims, places)
        logs.append(np.stack((np.arange(agents), places @ (1, n)), axis=1).ravel().tolist())
    return logs
