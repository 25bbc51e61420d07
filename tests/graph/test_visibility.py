"""Visibility tables: they answer as sight lines do, in memory and from their files, for as long as they hold."""

import itertools
import math
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import limits
from gamms import workers as workers_
from gamms.errors import BadFile, BadType, BadValue, MissingFolder, NotOffered, Outdated, UnknownName
from gamms.graph import map_file, visibility, visibility_workers
from gamms.graph.visibility_workers import VisibilityRows, VisibilityTask
from gamms.ir import packed_bytes
from gamms.typing.graph_engine import IGraphEngine


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """The user's cache folder."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "gamms" / "visibility"


@pytest.fixture
def town(ctx):
    """A row of five nodes, 10 apart, with ids 50, 40, … 10; a wall stands between the second and the third."""
    ids = [50, 40, 30, 20, 10]
    ctx.graph.add_nodes(ids, [0.0, 10.0, 20.0, 30.0, 40.0], [0.0] * 5)
    ctx.graph.add_edges(range(8), ids[:-1] + ids[1:], ids[1:] + ids[:-1])
    ctx.graph.add_obstacle_face(1, (15, -1, 3), (15, 1, 3), (15, -1, 0), (15, 1, 0), 0)
    return ctx


def on_demand(ctx, radius, height=1.6):
    """Node id -> ids it sees, by sight lines."""
    graph = ctx.graph.graph
    seen = {}
    for id in graph.get_nodes():
        here = graph.get_node(id)
        near = [graph.get_node(other) for other in graph.get_nodes(radius, here.x, here.y)]
        visible = ctx.graph.visible((here.x, here.y, height), [(node.x, node.y, height) for node in near])
        seen[id] = [node.id for node, is_seen in zip(near, visible, strict=True) if is_seen]
    return seen


def strewn(ctx, nodes=120, faces=200, extent=200.0, seed=0):
    rng = np.random.default_rng(seed)
    ctx.graph.add_nodes(np.arange(nodes) * 3, *rng.uniform(0, extent, (2, nodes)))
    corners = np.zeros((faces, 4, 3))
    a, b = rng.uniform(0, extent, (faces, 2)), rng.normal(0, 6, (faces, 2))
    corners[:, ::2, :2], corners[:, 1::2, :2] = a[:, None], (a + b)[:, None]
    corners[:, :2, 2] = rng.uniform(1, 9, (faces, 1))
    ctx.graph.add_obstacles(corners)


# -- questions --------------------------------------------------------------------------------------------------


def test_a_table_answers_who_sees_whom(town):
    table = town.graph.visibility(20.0)
    assert (table.radius, table.observer_height, len(table)) == (20.0, 1.6, 5)
    assert table.from_node(50).tolist() == [50, 40]
    assert table.from_node(10).tolist() == [30, 20, 10]  # 20 away is within
    assert table.watchers(30).tolist() == [30, 20, 10]
    assert [table.sees(20, id) for id in (50, 40, 30, 20, 10)] == [False, False, True, True, True]
    assert not table.sees(30, 40)  # hidden
    assert not table.sees(50, 10)  # too far away
    assert table.mask(20, [10, 40, 20]).tolist() == [True, False, True]
    assert table.mask(20, np.array([], np.int64)).tolist() == []
    assert table.mask(20, {40: "x", 30: "y"}).tolist() == [False, True]


def test_the_nearest_hidden_node_is_nearest_by_path(town):
    table = town.graph.visibility(10.0)
    assert table.nearest_hidden(50, [50]) == 30
    assert table.nearest_hidden(30, [50]) == 30  # hidden itself
    assert table.nearest_hidden(20, [20]) == 40  # as far as through the wall: sight is not needed on the way
    assert table.nearest_hidden(30, [30, 10, 50]) is None
    assert table.nearest_hidden(40, [30]) == 40
    town.graph.graph.update_edge({"id": 1, "source": 40, "target": 30, "length": 99.0, "toll": 0.5})
    assert table.nearest_hidden(40, [40]) == 30
    town.graph.graph.remove_edge(1)
    assert table.nearest_hidden(40, [40]) is None  # no way leads there


def test_of_equally_near_hidden_nodes_the_first_counts(ctx):
    ctx.graph.add_nodes([7, 9, 8], [0.0, 50.0, -50.0], [0.0, 0.0, 0.0])
    ctx.graph.add_edges([1, 2], [7, 7], [8, 9])
    assert ctx.graph.visibility(10.0, path=False).nearest_hidden(7, [7]) == 9


def test_a_table_without_nodes_has_no_rows(ctx):
    table = ctx.graph.visibility(5.0)
    assert len(table) == 0
    assert table.coverage([]).tolist() == table.hidden([]).tolist() == []
    assert len(ctx.graph.visibility(6.0, workers=2)) == 0


def test_an_unknown_node_is_named(town):
    table = town.graph.visibility(5.0)
    questions = [
        lambda: table.sees(50, 8),
        lambda: table.sees(8, 50),
        lambda: table.from_node(8),
        lambda: table.watchers(8),
        lambda: table.coverage([50, 8]),
        lambda: table.hidden([8]),
        lambda: table.nearest_hidden(8, [50]),
        lambda: table.nearest_hidden(50, [8]),
        lambda: table.mask(8, [50]),
        lambda: table.mask(50, [40, 8]),
    ]
    for question in questions:
        with pytest.raises(UnknownName, match="node 8"):
            question()
    with pytest.raises(BadType):
        table.mask(50, [1.5])
    with pytest.raises(BadType):
        table.sees("50", 40)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"radius": -1.0}, BadValue, "radius"),
        ({"radius": math.nan}, BadValue, "radius"),
        ({"radius": "wide"}, BadType, "radius"),
        ({"radius": 5.0, "observer_height": math.inf}, BadValue, "observer_height"),
        ({"radius": 5.0, "workers": 0}, BadValue, "at least 1"),
        ({"radius": 5.0, "workers": 1.5}, BadType, "workers"),
        ({"radius": 5.0, "path": 7}, BadType, "path"),
        ({"radius": 5.0, "path": True}, BadType, "path"),
        ({"radius": 5.0, "path": "no/such/folder/x.sight"}, MissingFolder, "no/such/folder"),
    ],
)
def test_impossible_arguments_are_refused(town, arguments, error, words):
    with pytest.raises(error, match=words):
        town.graph.visibility(**arguments)


def test_a_foreign_engine_need_not_offer_tables(ctx):
    with pytest.raises(NotOffered, match="visibility"):
        IGraphEngine.visibility(ctx.graph, 5.0)
    assert IGraphEngine.visibility_table(ctx.graph, 5.0, 1.6) is None


# -- laws -------------------------------------------------------------------------------------------------------

spots = st.tuples(st.integers(-6, 6), st.integers(-6, 6))


@given(
    places=st.lists(spots, min_size=1, max_size=12),
    walls=st.lists(st.tuples(spots, spots, st.integers(0, 3)), max_size=6),
    radius=st.sampled_from([0.0, 1.0, 5.0, 6.5, math.inf]),
    height=st.sampled_from([0.0, 1.6, 3.0]),
)
def test_a_table_answers_as_sight_lines_do(open_ctx, places, walls, radius, height):
    with open_ctx() as ctx:
        for id, (x, y) in enumerate(places):
            ctx.graph.graph.add_node({"id": 7 * id % 89, "x": x, "y": y})
        for id, (a, b, top) in enumerate(walls):
            ctx.graph.add_obstacle_face(id, (*a, top), (*b, top), (*a, 0), (*b, 0), 0)
        table, expected = ctx.graph.visibility(radius, height, path=False), on_demand(ctx, radius, height)
        ids = list(expected)
        for id in ids:
            assert table.from_node(id).tolist() == expected[id]
            assert table.mask(id, ids).tolist() == [other in expected[id] for other in ids]
            assert [table.sees(id, other) for other in ids] == [other in expected[id] for other in ids]
            assert table.watchers(id).tolist() == [other for other in ids if id in expected[other]]
        for watchers in itertools.combinations(ids, 2):
            covered = {*expected[watchers[0]], *expected[watchers[1]]}
            assert table.coverage(watchers).tolist() == [id for id in ids if id in covered]
            assert table.hidden(watchers).tolist() == [id for id in ids if id not in covered]


def scene(nodes=200):
    rng = np.random.default_rng(1)
    return VisibilityTask(rng.uniform(0, 90, (nodes, 2)), np.zeros((0, 4, 3)), 30.0, 1.6, np.zeros((nodes, 2)))


@pytest.mark.parametrize("script", ["raise SystemExit(3)", "print('abc')", "import sys; sys.stdin.read(9)"])
def test_where_a_worker_breaks_down_its_work_is_done_nevertheless(monkeypatch, script):
    expected = visibility_workers.compute_visibility(scene(), 1, lambda _: None)
    monkeypatch.setattr(workers_, "_SCRIPT", script)
    found = visibility_workers.compute_visibility(scene(), 2, lambda _: None)
    assert all(np.array_equal(*columns) for columns in zip(found, expected, strict=True))


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="such limits are of Linux")
def test_a_process_that_may_use_one_core_starts_no_workers(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a worker was started"))
    monkeypatch.setattr(visibility_workers, "_FEW", 1)
    assert len(visibility_workers.compute_visibility(scene(), None, lambda _: None).counts) == 200


@pytest.mark.parametrize("executable", ["", "/no/such/python"])
def test_without_an_interpreter_to_start_the_work_is_done_here(monkeypatch, executable):
    monkeypatch.setattr(sys, "executable", executable)
    assert len(visibility_workers.compute_visibility(scene(), 2, lambda _: None).counts) == 200


@pytest.mark.parametrize("workers", [1, 3])
def test_an_interruption_leaves_neither_processes_nor_files(ctx, cache, monkeypatch, workers):
    started = []
    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **k: started.append(popen(*a, **k)) or started[-1])

    def interrupt(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        visibility_workers.compute_visibility(scene(), workers, interrupt)
    assert all(process.returncode is not None for process in started)
    strewn(ctx)
    monkeypatch.setattr("gamms.graph.visibility.compute_visibility", lambda *_: interrupt(""))
    with pytest.raises(KeyboardInterrupt):
        ctx.graph.visibility(9.0)
    assert list(cache.iterdir()) == []
    assert ctx.graph.visibility_table(9.0, 1.6) is None


@pytest.mark.skipif(os.name == "nt", reason="signals for one thread are of Unix")
def test_ctrl_c_that_does_not_wake_who_waits_for_workers_ends_them_all_the_same(monkeypatch):
    def begin(*words, **options):
        begun = popen(*words, **options)
        if is_first.acquire(blocking=False):  # a second signal could come when this test is over
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # the main thread waits on
        return begun

    is_first, popen = threading.Lock(), subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", begin)
    monkeypatch.setattr(workers_, "_SCRIPT", "import time; time.sleep(60)")
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        visibility_workers.compute_visibility(scene(60), 2, lambda _: None)
    assert time.monotonic() - began < 50


def test_workers_do_not_run_the_users_script_again(tmp_path):
    script = tmp_path / "game.py"
    script.write_text(
        "import gamms\n"
        "print('begin')\n"
        "with gamms.create_context(logger_config={'level': 'CRITICAL'}) as ctx:\n"
        "    ctx.graph.add_nodes(range(200), range(200), [0.0] * 200)\n"
        "    print(len(ctx.graph.visibility(2.0, path=False, workers=2).coverage([10])))\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    printed = subprocess.check_output([sys.executable, str(script)], text=True, env=environment)
    assert printed.split() == ["begin", "5"]


def test_progress_is_shown_on_a_terminal_if_asked_for(town, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    town.graph.visibility(5.0, path=False)
    assert capsys.readouterr().err == ""
    town.graph.visibility(6.0, path=False, progress=True)
    assert "5 of 5 nodes done" in capsys.readouterr().err


# -- how long a table holds -------------------------------------------------------------------------------------


def move_a_node_and_put_up_a_face_for_a_while(ctx):
    ctx.graph.graph.update_node({"id": 10, "x": 42.0})
    ctx.graph.add_obstacle_face(2, (5, -1, 3), (5, 1, 3), (5, -1, 0), (5, 1, 0), 0)
    ctx.graph.remove_obstacle_face(2)


CHANGES = {
    "a node elsewhere, and a face for a while": move_a_node_and_put_up_a_face_for_a_while,
    "a node more": lambda ctx: ctx.graph.graph.add_node({"id": 60, "x": 5.0, "y": 5.0}),
    "a node elsewhere": lambda ctx: ctx.graph.graph.update_node({"id": 10, "x": 41.0}),
    "a node less": lambda ctx: ctx.graph.graph.remove_node(10),
    "no nodes": lambda ctx: ctx.graph.graph.clear(),
    "a face more": lambda ctx: ctx.graph.add_obstacle_face(2, (5, -1, 3), (5, 1, 3), (5, -1, 0), (5, 1, 0), 0),
    "a face less": lambda ctx: ctx.graph.remove_obstacle_face(1),
}


@pytest.mark.parametrize("name", CHANGES)
def test_after_a_change_of_nodes_or_faces_a_table_no_longer_counts(town, name):
    table = town.graph.visibility(20.0)
    CHANGES[name](town)
    assert town.graph.visibility_table(20.0, 1.6) is None
    for question in (lambda: table.sees(50, 40), lambda: table.hidden([]), lambda: table.mask(50, [40])):
        with pytest.raises(Outdated, match=r"ctx\.graph\.visibility"):
            question()
    new = town.graph.visibility(20.0)
    assert new is not table
    assert {id: new.from_node(id).tolist() for id in on_demand(town, 20.0)} == on_demand(town, 20.0)
    assert town.graph.visibility_table(20.0, 1.6) is new


def test_closed_roads_and_undone_changes_leave_a_table_as_good_as_it_was(town, tmp_path):
    table = town.graph.visibility(20.0, path=False)
    town.graph.graph.remove_edge(3)
    town.graph.graph.update_node({"id": 10, "name": "square"})
    assert table.sees(50, 40)
    town.graph.graph.update_node({"id": 10, "x": 41.0})
    town.graph.graph.update_node({"id": 10, "x": 40.0})
    town.graph.save(tmp_path / "map.gamms")
    town.graph.load(tmp_path / "map.gamms")
    assert town.graph.visibility_table(20.0, 1.6) is table
    assert town.graph.visibility(20.0, path=False) is table


# -- files ------------------------------------------------------------------------------------------------------


def files(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.exists() else []


def test_every_world_radius_and_height_has_its_own_file(town, cache):
    for count, change in enumerate([*CHANGES.values(), lambda _: None], start=1):
        for radius, height in ((20.0, 1.6), (20.0, 1.5), (21.0, 1.6)):
            town.graph.visibility(radius, height)
        assert len(files(cache)) == 3 * count
        change(town)


def test_a_table_goes_to_the_given_path(town, cache, tmp_path):
    table = town.graph.visibility(20.0, path=False)
    assert files(cache) == []
    assert town.graph.visibility(20.0, path=tmp_path / "town.sight") is table
    assert town.graph.visibility(20.0, path=str(tmp_path)) is table
    names = [path.name for path in files(tmp_path)]
    assert "town.sight" in names
    assert len(names) == 2
    before = (tmp_path / "town.sight").read_bytes()
    town.graph.remove_obstacle_face(1)
    town.graph.visibility(20.0, path=tmp_path / "town.sight")
    assert (tmp_path / "town.sight").read_bytes() != before  # the file of a world that is gone is replaced
    assert files(cache) == []


def test_the_same_world_gives_the_same_bytes(town, open_ctx, tmp_path):
    town.graph.visibility(20.0, path=tmp_path / "a")
    town.graph.save(tmp_path / "map.gamms")
    with open_ctx() as other:
        other.graph.load(tmp_path / "map.gamms")
        other.graph.visibility(20.0, path=tmp_path / "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


DAMAGES = {
    "empty": lambda data: b"",
    "cut off in the head": lambda data: data[:15],
    "cut off": lambda data: data[:-1],
    "longer": lambda data: data + b"x",
    "too new": lambda data: data[:8] + b"\x04" + data[9:],
    "too old": lambda data: data[:8] + b"\x02" + data[9:],
    "a flipped bit": lambda data: data[:-3] + bytes([data[-3] ^ 1]) + data[-2:],
    "another checksum": lambda data: data[:16] + b"abcd" + data[20:],
    "no deflate": lambda data: (
        changed(lambda state: state, data)[:16]
        + zlib.crc32(bytes(len(data) - 20)).to_bytes(4, "little")
        + bytes(len(data) - 20)
    ),
    "no dict": lambda data: changed(lambda state: [*state], data),
    "a row more": lambda data: changed(lambda state: state | {"rows": np.append(state["rows"], np.int32(0))}, data),
    "a row less": lambda data: changed(lambda state: state | {"rows": state["rows"][:-1]}, data),
    "no counts": lambda data: changed(lambda state: {"key": state["key"], "rows": state["rows"]}, data),
    "too few nodes": lambda data: changed(lambda state: state | {"counts": state["counts"][1:]}, data),
    "other numbers": lambda data: changed(lambda state: state | {"rows": state["rows"].astype(np.float32)}, data),
    "other shapes": lambda data: changed(lambda state: state | {"rows": state["rows"][None]}, data),
    "no arrays": lambda data: changed(lambda state: state | {"counts": [1, 2]}, data),
}


def changed(change, data):
    """The bytes of a file with other contents."""
    return map_file.frame_file(change(map_file.unframe_file(data, data[:8], 3)), data[:8], 3)


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_file_is_replaced_with_a_warning(town, heard, cache, name):
    table = town.graph.visibility(20.0)
    (kept,) = files(cache)
    sound = kept.read_bytes()
    kept.write_bytes(DAMAGES[name](sound))
    town.graph._tables = None
    again = town.graph.visibility(20.0)
    assert len(heard) == 1
    assert str(kept) in heard[0]
    assert all(np.array_equal(*columns) for columns in zip(again.seen, table.seen, strict=True))
    assert kept.read_bytes() == sound


KEY = bytes(32)
SOUND = VisibilityRows(np.array([2, 1], np.int32), np.array([0, 1, 1], np.int32))


def test_decoding_reverses_encoding():
    found = visibility.decode(visibility.encode(SOUND, KEY, 5.0, 1.6), KEY, 2)
    assert [column.tolist() for column in found] == [[2, 1], [0, 1, 1]]
    assert [column.dtype for column in found] == [np.int32] * 2


@pytest.mark.parametrize(
    ("counts", "rows"),
    [
        ([2, 2], [0, 1, 1]),
        ([3, 0], [0, 1, 1]),
        ([4, -1], [0, 1, 1]),
        ([2, 1], [1, 0, 1]),
        ([2, 1], [0, 0, 1]),
        ([2, 1], [0, 2, 1]),
        ([2, 1], [-1, 1, 1]),
    ],
)
def test_rows_that_are_no_table_are_refused(counts, rows):
    data = visibility.encode(VisibilityRows(np.array(counts, np.int32), np.array(rows, np.int32)), KEY, 5.0, 1.6)
    with pytest.raises(BadFile):
        visibility.decode(data, KEY, 2)


def test_a_small_file_is_not_believed_to_hold_a_large_table():
    deflate = zlib.compressobj(9, zlib.DEFLATED, -15)
    part = deflate.compress(bytes(1 << 20)) + deflate.flush(zlib.Z_FULL_FLUSH)
    body = packed_bytes.encode_varint(1 << 28) + part * (1 << 8) + deflate.flush()
    data = struct.pack("<8sIII", b"GAMMSEYE", 3, len(body), zlib.crc32(body)) + body
    with pytest.raises(BadFile, match="too many for the size of the file"):
        visibility.decode(data, KEY, 20_000)


def test_a_table_of_an_open_field_is_believed(monkeypatch):
    monkeypatch.setattr(limits, "_FLOOR", 1000)
    nodes = 300  # all see all, which would pack into next to nothing
    field = VisibilityRows(np.full(nodes, nodes, np.int32), np.tile(np.arange(nodes, dtype=np.int32), nodes))
    found = visibility.decode(visibility.encode(field, KEY, math.inf, 1.6), KEY, nodes)
    assert np.array_equal(found.rows, field.rows)


def test_a_foreign_file_is_left_alone(town, heard, tmp_path):
    theirs = tmp_path / "notes.txt"
    theirs.write_text("do not lose this")
    assert town.graph.visibility(20.0, path=theirs).sees(50, 40)
    assert theirs.read_text() == "do not lose this"
    assert "is not a visibility table" in heard[0]
    assert "not overwritten" in heard[1]


def test_where_a_table_cannot_be_written_it_is_made_nevertheless(town, tmp_path):
    long = "x" * 250  # too long for the file beside it that is written first
    with pytest.raises(OSError, match="name too long") as caught:
        town.graph.visibility(20.0, path=tmp_path / long)
    assert "could not be stored" in caught.value.__notes__[0]
    assert town.graph.visibility_table(20.0, 1.6).sees(50, 40)
    assert files(tmp_path) == []


def test_a_cache_folder_that_cannot_be_made_costs_a_warning(town, heard, cache):
    cache.parent.parent.mkdir(parents=True)
    cache.parent.write_text("a file where the folder should be")
    assert town.graph.visibility(20.0).sees(50, 40)
    assert len(heard) == 1
    assert "path=False" in heard[0]
