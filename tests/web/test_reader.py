"""The viewer's reader finds in recordings what Python's finds."""

import json
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from gamms import recorder
from gamms.graph.map_file import MAGIC, VERSION, framed, unframed
from gamms.ir import packed_bytes

HERE = Path(__file__).parent
SAMPLES = sorted((HERE.parent / "recorder/samples/ours").glob("version3*.ggr"))
NODE = shutil.which("node")

pytestmark = pytest.mark.skipif(NODE is None, reason="Node.js is not installed")


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """What the viewer's reader finds: path of a sample -> it at once, and piece by piece."""
    folder = tmp_path_factory.mktemp("stored")
    stored = [written_for_the_viewer(path, folder / path.name) for path in SAMPLES]
    done = subprocess.run([NODE, HERE / "read_recording.mjs", *stored], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(zip(SAMPLES, json.loads(done.stdout), strict=True))


def written_for_the_viewer(path, out):
    """Write a sample with blocks that are not deflated, as pages have them; return where."""
    with recorder.open(path) as recording, out.open("wb") as file:
        world = framed(unframed(recording.graph.packed, MAGIC, VERSION), MAGIC, VERSION, packed_bytes.STORED)
        writer = recorder.Writer(file, {**recording.header, "world": world}, seconds=None, is_deflated=False)
        for turn, log in enumerate(recording.logs()):
            if turn % 8 == 0:
                writer.keyframe(recording.detached(turn).keyframe(turn))
            writer.add_turn(log)
        writer.close()
    return out


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


COLUMNS = """
import { ByteReader } from "%s";
const found = process.argv.slice(1).map((hex) => {
  const bytes = Uint8Array.from(hex.match(/../g), (digits) => parseInt(digits, 16));
  try {
    return [[...new ByteReader(bytes).column(40000)], [...new ByteReader(bytes).wideColumn(40000)].map(Number)];
  } catch (error) {
    return error.message;
  }
});
console.log(JSON.stringify(found));
"""


def test_tables_of_columns_are_read_and_damaged_ones_refused():
    numbers = np.random.default_rng(1).choice([-1000, -1, 0, 1, 1000], 40_000)
    entries = packed_bytes.column(packed_bytes.steps(np.unique(numbers)))
    table = b"\x09\4" + entries
    rows = np.searchsorted(np.unique(numbers), numbers)
    column = table + b"\1" + rows.astype(np.uint8).tobytes()
    threes = np.append(rows, [0, 0]).reshape(-1, 3) @ [1, 5, 25]
    in_threes = table + b"\3" + threes.astype(np.uint8).tobytes()
    damaged = [
        table + b"\1" + bytes(39_999) + b"\5",  # no such entry
        table + b"\3\x7d" + bytes(13_333),  # nor are there three of them with this number
        table + b"\0" + bytes(40_000),
        table + b"\4" + bytes(10_000),  # four of five entries are more than a byte
        b"\x09\0" + table + bytes(40_000),  # a table in a table
        b"\x0a" + column[1:],  # a form of later versions
        column[:-1],
    ]
    program = COLUMNS % (HERE.parents[1] / "src/gamms/web/viewer/values.js").as_uri()
    given = [NODE, "--input-type=module", "-e", program, *(one.hex() for one in (column, in_threes, *damaged))]
    done = subprocess.run(given, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found, found_in_threes, *messages = json.loads(done.stdout)
    assert found == [numbers.tolist()] * 2
    assert found_in_threes == found
    assert messages == [
        *["a column does not fit its table"] * 2,
        *["a table is damaged"] * 3,
        "a column is damaged",
        "40000 bytes are promised and fewer are there",
    ]
