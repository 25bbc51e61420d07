"""The SQLITE engine: the same graph, and a database file that has it; nothing lies about where it was not asked for."""

import os
import re
import sqlite3
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from gamms.errors import BadFile, BadValue, ContextTerminated, UnknownType, WriteConflict
from gamms.graph import Engine


@pytest.fixture
def reopened(open_ctx, tmp_path):
    """Opens the same database as often as asked."""
    path, opened = tmp_path / "graph.db", []

    def reopened():
        opened.append(open_ctx(Engine.SQLITE, graph_path=path))
        return opened[-1]

    reopened.path = path
    yield reopened
    for ctx in opened:
        ctx.terminate()


# -- there and back ---------------------------------------------------------------------------------------------


def test_a_database_holds_everything_at_the_end(reopened, fill, everything):
    ctx = reopened()
    fill(ctx)
    ctx.graph.graph.remove_node(40)
    before = everything(ctx)
    ctx.terminate()
    assert everything(reopened()) == before


# -- an attribute that cannot be saved --------------------------------------------------------------------------


def test_an_attribute_that_cannot_be_saved_leaves_the_database_as_it_was(reopened, fill, everything):
    ctx = reopened()
    graph = fill(ctx)
    ctx.graph.save()
    before = everything(ctx)
    for update in (graph.update_node, graph.update_edge):
        update({"id": 1, "awkward": {1, object}})
        with pytest.raises(BadValue, match="'awkward'"):
            ctx.graph.save()
        update({"id": 1, "awkward": None})
    graph.crs = "EPSG:32635"
    assert everything(reopened()) == before  # from the file, while the first context lives


def test_values_that_cannot_be_saved_at_the_end_are_left_out_and_named(reopened, fill):
    ctx = reopened()
    heard = []
    verbs = ("debug", "info", "warning", "error", "critical", "setLevel")
    ctx.logger = SimpleNamespace(**dict.fromkeys(verbs, heard.append))
    fill(ctx).add_node({"id": 500, "x": 0.0, "y": 0.0, "name": "here", "awkward": {1, object}})
    ctx.terminate()
    assert "'awkward'" in heard[-1]
    assert "not saved to the database" in heard[-1]
    assert reopened().graph.node_attributes(500) == {"name": "here"}


def test_a_database_that_goes_with_the_context_is_not_written_at_the_end(open_ctx):
    with open_ctx(Engine.SQLITE) as ctx:
        ctx.graph.graph.add_node({"id": 1, "x": 0.0, "y": 0.0, "awkward": object()})
    assert ctx.is_terminated()


def test_a_context_ends_even_if_its_graph_cannot_be_saved(reopened, fill):
    ctx = reopened()
    graph = fill(ctx)
    ctx.graph.save()
    graph.add_node({"id": 500, "x": 0.0, "y": 0.0})
    ctx.ictx.memory.get_store(".graph").connection().execute("PRAGMA busy_timeout = 0")
    with sqlite3.connect(reopened.path, isolation_level=None) as theirs:
        theirs.execute("BEGIN EXCLUSIVE")
        with pytest.raises(BadFile, match="locked") as caught:
            ctx.terminate()
        theirs.execute("ROLLBACK")
    theirs.close()
    assert "unsaved-1.gamms" in caught.value.__notes__[0]
    assert ctx.is_terminated()
    for gone in (lambda: ctx.graph.graph, lambda: graph.get_node(1)):
        with pytest.raises(ContextTerminated):
            gone()
    assert list(reopened().graph.graph.get_nodes()) == [1, 2, -7, 40]


# -- other files ------------------------------------------------------------------------------------------------


def test_the_database_of_another_program_is_refused_and_left_alone(open_ctx, tmp_path):
    path = tmp_path / "theirs.db"
    with sqlite3.connect(path) as theirs:
        theirs.execute("CREATE TABLE recipes (name TEXT)")
    theirs.close()
    before = path.read_bytes()
    with pytest.raises(BadFile, match="a database, but not of a graph"):
        open_ctx(Engine.SQLITE, graph_path=path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "content", [b"no database " * 99, b"GAMMSMAP", b"\x89PNG\r\n\x1a\n", b"SQLite format 3\0" + bytes(90)]
)
def test_a_foreign_file_is_refused_and_left_alone(open_ctx, tmp_path, content):
    path = tmp_path / "foreign.db"
    path.write_bytes(content)
    with pytest.raises(BadFile, match="foreign"):
        open_ctx(Engine.SQLITE, graph_path=path)
    assert path.read_bytes() == content


def test_a_folder_is_no_database(open_ctx, tmp_path):
    with pytest.raises(BadFile):
        open_ctx(Engine.SQLITE, graph_path=tmp_path)


DAMAGES = {
    "a map that is cut off": "UPDATE saved_map SET map = substr(map, 1, length(map) - 9)",
    "a map of other bytes": "UPDATE saved_map SET map = zeroblob(500)",
    "a map that is text": "UPDATE saved_map SET map = 'far'",
    "no map": "UPDATE saved_map SET map = NULL",
    "a count that is text": "UPDATE saved_map SET saves = 'often'",
    "no count": "UPDATE saved_map SET saves = NULL",
    "a count of none": "UPDATE saved_map SET saves = 0",
    "a missing table": "DROP TABLE saved_map",
    "a missing column": "ALTER TABLE saved_map DROP COLUMN map",
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_database_is_refused(reopened, fill, damage):
    ctx = reopened()
    fill(ctx)
    ctx.terminate()
    connection = sqlite3.connect(reopened.path)
    connection.execute(DAMAGES[damage])
    connection.commit()
    connection.close()
    with pytest.raises(BadFile, match=str(reopened.path)):
        reopened()


@pytest.mark.parametrize("part", [0.3, 0.7, 0.95])
def test_a_database_that_was_cut_off_is_refused_or_whole(reopened, fill, everything, part):
    ctx = reopened()
    fill(ctx)
    before = everything(ctx)
    ctx.terminate()
    data = reopened.path.read_bytes()
    reopened.path.write_bytes(data[: int(part * len(data))])
    try:
        again = reopened()
    except BadFile:
        return
    assert everything(again) == before


def test_a_graph_in_memory_has_no_database(open_ctx, tmp_path):
    with pytest.raises(BadValue, match="graph_path"):
        open_ctx(Engine.MEMORY, graph_path=tmp_path / "graph.db")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("engine", ["SQLLITE", 1, None, "disk"])
def test_an_unknown_engine_is_named(open_ctx, engine):
    with pytest.raises(UnknownType, match=repr(engine)):
        open_ctx(engine)


# -- several programs -------------------------------------------------------------------------------------------


def add(ctx, id):
    ctx.graph.graph.add_node({"id": id, "x": 0.0, "y": 0.0})


def nodes_of(ctx):
    return list(ctx.graph.graph.get_nodes())


def test_the_second_of_two_writers_is_refused_and_can_go_on(reopened, tmp_path):
    first, second = reopened(), reopened()
    add(first, 1)
    add(second, 2)
    first.graph.save()
    with pytest.raises(WriteConflict, match=re.escape(str(reopened.path))):
        second.graph.save()
    with pytest.raises(WriteConflict):
        second.graph.save(tmp_path / "mine.gamms")
    assert nodes_of(second) == [2]
    second.graph.load()
    assert nodes_of(second) == [1]
    add(second, 3)
    second.graph.save()
    add(first, 4)
    with pytest.raises(WriteConflict):
        first.graph.save()
    first.graph.load(tmp_path / "mine.gamms")
    assert nodes_of(first) == [2]
    first.graph.load()
    assert nodes_of(first) == [1, 3]


def test_who_changes_nothing_writes_nothing(reopened):
    writer, reader = reopened(), reopened()
    add(writer, 1)
    writer.graph.save()
    reader.terminate()
    add(writer, 2)
    writer.terminate()
    assert nodes_of(reopened()) == [1, 2]


def test_a_map_that_cannot_be_written_at_the_end_is_saved_beside(reopened, ctx):
    lost = [reopened(), reopened()]
    winner = reopened()
    add(winner, 1)
    winner.terminate()
    for number, loser in enumerate(lost, 1):
        add(loser, 10 * number)
        with pytest.raises(WriteConflict) as caught:
            loser.terminate()
        beside = f"{reopened.path}.unsaved-{number}.gamms"
        assert beside in caught.value.__notes__[0]
        ctx.graph.load(beside)
        assert nodes_of(ctx) == [10 * number]
    assert nodes_of(reopened()) == [1]


def test_changes_saved_elsewhere_after_a_conflict_are_not_saved_twice(reopened, tmp_path):
    winner, loser = reopened(), reopened()
    add(winner, 1)
    winner.terminate()
    add(loser, 2)
    with pytest.raises(WriteConflict):
        loser.graph.save(tmp_path / "mine.gamms")
    loser.terminate()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["graph.db", "mine.gamms"]


_START = """
import sys, gamms
from gamms.errors import WriteConflict
ctx = gamms.create_context(
    graph_engine=gamms.graph.Engine.SQLITE, graph_path=sys.argv[1], logger_config={"level": "CRITICAL"}
)
graph = ctx.graph.graph
"""


def test_of_two_processes_neither_loses_a_node(reopened):
    script = f"""{_START}
done = 0
while done < 15:
    id = next(n for n in range(1000) if not graph.has_node(n))
    graph.add_node({{"id": id, "x": float(sys.argv[2]), "y": 0.0}})
    try:
        ctx.graph.save()
        done += 1
    except WriteConflict:
        ctx.graph.load()
ctx.terminate()
"""
    running = [subprocess.Popen([sys.executable, "-c", script, reopened.path, name]) for name in "01"]
    assert [one.wait() for one in running] == [0, 0]
    ctx = reopened()
    assert sorted(nodes_of(ctx)) == list(range(30))
    assert [ctx.graph.graph.get_node(id).x for id in range(30)].count(1.0) == 15


def test_a_program_that_is_killed_while_saving_leaves_a_whole_graph(reopened):
    script = f"""{_START}
for size in range(1000, 100_000, 1000):
    graph.add_nodes(range(len(graph), size), [0.0] * (size - len(graph)), [0.0] * (size - len(graph)))
    ctx.graph.save()
    print(size, flush=True)
"""
    for lines in (1, 4):
        with subprocess.Popen([sys.executable, "-c", script, reopened.path], stdout=subprocess.PIPE) as running:
            saved = [int(running.stdout.readline()) for _ in range(lines)][-1]
            time.sleep(0.004 * lines)
            running.kill()
            later = [int(line) for line in running.stdout if line.endswith(b"\n")]
        ctx = reopened()
        nodes = nodes_of(ctx)
        assert nodes == list(range(len(nodes)))
        assert len(nodes) - [saved, *later][-1] in (0, 1000)
        ctx.terminate()
        reopened.path.unlink()


# -- nothing lies about -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", Engine)
def test_nothing_is_written_into_the_working_directory(open_ctx, fill, tmp_path, monkeypatch, engine):
    monkeypatch.chdir(tmp_path)
    ctx = open_ctx(engine)
    fill(ctx)
    assert list(tmp_path.iterdir()) == []
    ctx.graph.columns()
    ctx.terminate()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ["ctx.terminate()", "pass", "import os; os.kill(os.getpid(), 9)"])
def test_without_a_path_nothing_is_left_on_the_disk(tmp_path, ending):
    script = f"""
import gamms
ctx = gamms.create_context(graph_engine=gamms.graph.Engine.SQLITE, logger_config={{"level": "CRITICAL"}})
ctx.graph.graph.add_node({{"id": 1, "x": 0, "y": 0}})
ctx.graph.save()
{ending}
"""
    folder, cwd = tmp_path / "temporary", tmp_path / "working"
    folder.mkdir()
    cwd.mkdir()
    subprocess.run(
        [sys.executable, "-c", script], env=os.environ | {"TMPDIR": str(folder)}, cwd=cwd, check="kill" not in ending
    )
    assert list(folder.iterdir()) == list(cwd.iterdir()) == []


# -- after the end ----------------------------------------------------------------------------------------------


def test_after_the_end_there_is_no_graph(any_ctx, fill, tmp_path):
    graph = fill(any_ctx)
    near = graph.neighborhoods
    graph.shortest_path(1, 2)  # which is remembered
    any_ctx.terminate()
    for ask in (
        lambda: any_ctx.graph.graph,
        any_ctx.graph.columns,
        any_ctx.graph.get_obstacle_faces,
        lambda: any_ctx.graph.save(tmp_path / "map"),
        lambda: any_ctx.graph.load(tmp_path / "map"),
        lambda: graph.get_node(1),
        lambda: graph.add_node({"id": 9, "x": 0.0, "y": 0.0}),
        lambda: graph.remove_node(1),
        lambda: graph.add_nodes([9], [0.0], [0.0]),
        graph.get_nodes,
        lambda: graph.within(1, 1.0),
        lambda: graph.has_node(1),
        lambda: near[1],
        lambda: len(graph),
        lambda: graph.shortest_path(1, 2),
        lambda: any_ctx.graph.routes.nearest_edge(0, 0),
        lambda: any_ctx.graph.visible((0, 0, 0), [(1, 1, 1)]),
        lambda: any_ctx.graph.obstacle_revision,
        lambda: any_ctx.graph.add_obstacles([]),
        any_ctx.graph.obstacle_columns,
    ):
        with pytest.raises(ContextTerminated):
            ask()
    any_ctx.terminate()
    any_ctx.graph.terminate()
