"""The viewer's reader finds in recordings what Python's finds."""

import json
import math
import shutil
import subprocess
from pathlib import Path

import pytest

from gamms import recorder

HERE = Path(__file__).parent
SAMPLES = sorted((HERE.parent / "recorder/samples/ours").glob("version3*.ggr"))
NODE = shutil.which("node")

pytestmark = pytest.mark.skipif(NODE is None, reason="Node.js is not installed")


@pytest.fixture(scope="module")
def read():
    """What the viewer's reader finds: path of a sample -> it at once, and piece by piece."""
    done = subprocess.run([NODE, HERE / "read_recording.mjs", *SAMPLES], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(zip(SAMPLES, json.loads(done.stdout), strict=True))


def text_of(team):
    return None if team is None else str(team)


def plain(state):
    agents = state.agents
    columns = {name: agents[name].tolist() for name in ("name", "alive", "node", "previous")}
    columns["team"] = [text_of(team) for team in agents["team"].tolist()]
    for name, parts in (("position", "xyz"), ("quat", ("quat_w", "quat_x", "quat_y", "quat_z"))):
        rows = zip(*(agents[part].tolist() for part in parts), strict=True)
        columns[name] = [[None if math.isnan(value) else value for value in row] for row in rows]
    return {**columns, "scores": {str(of): score for of, score in state.scores.items()}, "over": state.over}


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_every_state_of_a_frozen_recording_is_the_same(read, path):
    found, in_pieces = read[path]
    with recorder.open(path) as recording:
        states = [plain(state) for state in recording]
        graph = recording.graph.columns()
        assert found["turns"] == recording.turns
    assert found["forwards"] == states
    assert all(state == states[turn] for turn, state in found["sought"])
    assert found["map"]["nodes"] == graph.node_ids.tolist()
    assert found["map"]["xy"] == graph.xy.ravel().tolist()
    assert found["map"]["edges"] == graph.edge_ids.tolist()
    assert in_pieces == found  # as they come live
