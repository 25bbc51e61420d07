"""The viewer's reader finds in pages what Python finds in their recordings."""

import base64
import json
import math
import re
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from gamms import recorder, web

HERE = Path(__file__).parent
SAMPLES = sorted((HERE.parent / "recorder/samples/ours").glob("version3*.ggr"))
NODE = shutil.which("node")

pytestmark = pytest.mark.skipif(NODE is None, reason="Node.js is not installed")


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """What the viewer's reader finds: path of a sample -> it at once, and piece by piece."""
    folder = tmp_path_factory.mktemp("games")
    games = [content_of_page(path, folder / path.stem) for path in SAMPLES]
    done = subprocess.run([NODE, HERE / "read_recording.mjs", *games], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(zip(SAMPLES, json.loads(done.stdout), strict=True))


def content_of_page(path, out):
    """Write what the page of a sample holds; return where."""
    with recorder.open(path) as recording:
        page = web.page(recording).decode()
    [data] = re.findall(r'class="recording">([^<]*)<', page)
    out.write_bytes(zlib.decompress(base64.b64decode(data)))
    return out


def plain(state):
    """What is compared of a state."""
    agents = state.agents
    order = np.argsort(agents["name"])
    columns = {name: agents[name][order].tolist() for name in ("name", "alive", "node")}
    pairs = zip(columns["name"], agents["team"][order].tolist(), strict=True)
    columns["side"] = [name if team is None else str(team) for name, team in pairs]
    rows = zip(*(agents[part][order].tolist() for part in "xyz"), strict=True)
    columns["position"] = [[None if math.isnan(value) else value for value in row] for row in rows]
    scores = {str(of): score for of, score in state.scores.items()}
    return {**columns, "scores": scores, "is_over": state.over is not None}


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_every_state_of_a_frozen_recording_is_the_same(read, path):
    found, _ = read[path]
    with recorder.open(path) as recording:
        states = [plain(state) for state in recording]
        graph = recording.graph.columns()
    assert found["turns"] == len(states) - 1
    for one, state in zip(found["forwards"], states, strict=True):
        places = [one.pop("position"), state.pop("position")]
        assert np.allclose(*(np.array(each, float) for each in places), rtol=0.0, atol=0.1, equal_nan=True)
        assert one == state
    assert found["map"]["nodes"] == graph.node_ids.tolist()
    assert np.allclose(found["map"]["xy"], graph.xy.ravel(), rtol=0.0, atol=0.01)


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_turns_that_are_sought_and_games_that_come_in_pieces_are_the_same(read, path):
    found, in_pieces = read[path]
    assert all(state.items() >= found["forwards"][turn].items() for turn, state in found["sought"])
    assert in_pieces["sought"] == found["sought"]
