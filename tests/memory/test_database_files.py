"""A database file: what is kept, what is refused, and that nothing in it is run."""

import contextlib
import json
import random
import sqlite3

import pytest

from gamms.errors import BadFile, BadValue
from gamms.ir import packing
from gamms.memory import PathLike, SqliteStore
from gamms.memory.database import Database

SCHEMA = {"id": int, "a b": list, "X": float}


def fill(store):
    store.create_map("nodes", SCHEMA, "id")
    store.insert_data("nodes", {"id": 2, "a b": [(1,)], "X": 0.5})
    store.insert_data("nodes", {"id": 1, "a b": None, "X": -0.0})


def run(path, sql, *values):
    connection = sqlite3.connect(path)
    with connection:
        connection.execute(sql, values)
    connection.close()


def tables_of(path):
    with contextlib.closing(sqlite3.connect(path)) as connection:
        return [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]


@pytest.mark.parametrize(
    ("schema", "key"),
    [(SCHEMA | {"X": int}, "id"), ({"id": int}, "id"), (SCHEMA, "X"), (SCHEMA | {"y": int}, "id")],
)
def test_a_map_of_the_file_keeps_its_schema(database, schema, key):
    first = database()
    fill(first)
    first.close()
    second = database()
    with pytest.raises(ValueError, match=r"has the schema \{'id': 'int'.*, not \{'id'"):
        second.create_map("nodes", schema, key)
    assert second.list_maps() == []


def test_a_map_that_was_deleted_leaves_no_table_in_the_file(database):
    store = database()
    fill(store)
    store.delete_map("nodes")
    store.close()
    assert tables_of(database.path) == ["gamms_maps"]


def test_nothing_is_kept_before_flush(database):
    writer = database()
    fill(writer)
    writer.flush()
    writer.insert_data("nodes", {"id": 3, "a b": [], "X": 0.0})
    reader = database()
    reader.create_map("nodes", SCHEMA, "id")
    assert list(reader.query_keys("nodes")) == [2, 1]
    writer.flush()
    assert list(reader.query_keys("nodes")) == [2, 1, 3]


def test_a_failed_insert_keeps_earlier_rows(database):
    store = database()
    fill(store)
    with pytest.raises(KeyError):
        store.insert_data("nodes", {"id": 2, "a b": [], "X": 0.0})
    store.close()
    again = database()
    again.create_map("nodes", SCHEMA, "id")
    assert list(again.query_keys("nodes")) == [2, 1]


def test_own_sql_sees_the_map_under_its_name(database):
    store = database()
    fill(store)
    assert store.cursor().execute('SELECT id, "a b" IS NULL FROM nodes ORDER BY id').fetchall() == [
        (1, 1),
        (2, 0),
    ]
    store.mark_dirty()
    store.cursor().execute("CREATE TABLE mine (x)")
    assert store.connection().in_transaction
    store.flush()
    assert not store.connection().in_transaction


def test_a_closed_store_gives_no_connection(database):
    store = database()
    store.close()
    for call in (store.connection, store.cursor, store.flush, store.mark_dirty):
        with pytest.raises(ValueError, match="closed"):
            call()


def test_folders_are_made_and_only_the_file_stays(tmp_path):
    path = tmp_path / "a" / "b" / "store.db"
    store = SqliteStore("s", PathLike(str(path)))
    fill(store)
    store.close()
    assert [one.name for one in path.parent.iterdir()] == ["store.db"]
    assert PathLike(str(path)).exists()


@pytest.mark.parametrize("content", [b"this is no database, it is text" * 50, b"SQLite format 3\0" + b"\xff" * 500])
def test_a_foreign_file_is_named(database, content):
    database.path.write_bytes(content)
    with pytest.raises(BadFile, match=r"store\.db"):
        database()
    assert database.path.read_bytes() == content


def test_a_folder_and_a_path_through_a_file_are_named(tmp_path):
    (tmp_path / "file").write_text("x")
    for path in (tmp_path, tmp_path / "file" / "store.db"):
        with pytest.raises(BadFile, match="another path"):
            SqliteStore("s", PathLike(str(path)))


@pytest.mark.parametrize(
    "place",
    [
        "no json",
        "[]",
        "{}",
        b"\xff",
        5,
        "[" * 100_000,
        json.dumps({"table": "nodes", "key": "id", "types": {"id": "int"}, "columns": {"id": 3}}),
        json.dumps({"table": ["nodes"], "key": "id", "types": {}, "columns": {}}),
        json.dumps({"table": "t", "key": "id", "types": [], "columns": 1}),
        json.dumps({"table": "t", "key": "id", "types": {"id": "int"}, "columns": {}, "more": 1}),
    ],
)
def test_a_damaged_list_of_maps_is_named(database, place):
    run(database.path, "CREATE TABLE gamms_maps (name TEXT PRIMARY KEY, place TEXT NOT NULL)")
    run(database.path, "INSERT INTO gamms_maps VALUES ('nodes', ?)", place)
    with pytest.raises(BadFile, match="damaged"):
        database()


def test_a_list_of_maps_without_its_tables_is_named(database):
    place = {"table": "gone", "key": "id", "types": {"id": "int"}, "columns": {"id": "id"}}
    run(database.path, "CREATE TABLE gamms_maps (name TEXT PRIMARY KEY, place TEXT NOT NULL)")
    run(database.path, "INSERT INTO gamms_maps VALUES ('nodes', ?)", json.dumps(place))
    store = database()
    with pytest.raises(BadFile, match="damaged"):
        store.create_map("nodes", {"id": int}, "id")


def test_a_foreign_table_of_our_name_is_named(database):
    run(database.path, "CREATE TABLE gamms_maps (x)")
    with pytest.raises(BadFile, match="not as GAMMS made it"):
        database()


ADDED = {
    "a view": """DROP TABLE nodes; CREATE VIEW nodes AS WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c)
                 SELECT i gamms_order, i id, NULL "a b", 0.5 X FROM c""",
    "a view of the maps": """DROP TABLE gamms_maps; CREATE VIEW gamms_maps AS
                 WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c) SELECT i name, i place FROM c""",
    "a generated column": """DROP TABLE nodes; CREATE TABLE nodes (gamms_order INTEGER PRIMARY KEY,
                 id INTEGER NOT NULL UNIQUE, "a b" BLOB AS (zeroblob(900000000)), X REAL)""",
    "a virtual table": """DROP TABLE nodes; CREATE VIRTUAL TABLE nodes USING fts5(gamms_order, id, "a b", X)""",
    "a table without row numbers": """DROP TABLE nodes; CREATE TABLE nodes (gamms_order INTEGER PRIMARY KEY,
                 id INTEGER NOT NULL UNIQUE, "a b" BLOB, X REAL) WITHOUT ROWID""",
    "a check": """DROP TABLE nodes; CREATE TABLE nodes (gamms_order INTEGER PRIMARY KEY,
                 id INTEGER NOT NULL UNIQUE, "a b" BLOB, X REAL, CHECK (length(zeroblob(900000000)) > 0))""",
    "a column with a default": "ALTER TABLE nodes ADD COLUMN more DEFAULT 5",
    "a trigger": "CREATE TRIGGER again AFTER DELETE ON nodes BEGIN INSERT INTO nodes (id) VALUES (OLD.id); END",
    "a trigger under another case": "CREATE TRIGGER again AFTER DELETE ON NoDeS BEGIN SELECT 1; END",
    "a trigger on the maps": "CREATE TRIGGER again BEFORE INSERT ON gamms_maps BEGIN SELECT 1; END",
    "an index": "CREATE INDEX slow ON nodes (length(zeroblob(900000000)))",
}


@pytest.mark.parametrize("added", ADDED)
def test_what_might_run_when_a_table_is_used_is_refused(database, added):
    first = database()
    fill(first)
    first.close()
    connection = sqlite3.connect(database.path)
    connection.executescript(ADDED[added])
    connection.close()
    with pytest.raises(BadFile, match=r"not as GAMMS made it|There is an? (trigger|index)"):
        database().create_map("nodes", SCHEMA, "id")


def test_pages_that_refer_to_each_other_are_not_read_for_ever(rows_of, database):
    """A tree of five pages with 10 ** 10 leaves, which would take hours to count."""
    first = database()
    first.create_map("m", {"id": int}, "id")
    with first.transaction():
        first.cursor().executemany("INSERT INTO m (id) VALUES (?)", ((id,) for id in range(100_000)))
    ((root,),) = first.connection().execute("SELECT rootpage FROM sqlite_master WHERE name = 'm'").fetchall()
    ((size,),) = first.connection().execute("PRAGMA page_size").fetchall()
    first.close()
    data = bytearray(database.path.read_bytes())
    pages = [data[at : at + size] for at in range(0, len(data), size)]
    leaf = next(n for n, page in enumerate(pages, 1) if page[0] == 13 and n > root)
    inner = [n for n in range(root + 1, root + 12) if n != leaf][:5]
    for page, child in zip([root, *inner], [*inner, leaf], strict=True):
        cells = 100
        first_cell = size - 5 * cells
        head = b"\x05\0\0" + cells.to_bytes(2, "big") + first_cell.to_bytes(2, "big") + b"\0" + child.to_bytes(4, "big")
        places = b"".join((first_cell + 5 * i).to_bytes(2, "big") for i in range(cells))
        tail = b"".join(child.to_bytes(4, "big") + b"\x01" for _ in range(cells))
        data[(page - 1) * size : page * size] = (head + places).ljust(first_cell, b"\0") + tail
    database.path.write_bytes(data)
    again = database()
    again.create_map("m", {"id": int}, "id")
    with pytest.raises(BadFile, match="far longer to read than its size explains"):
        rows_of(again, "m")


@pytest.mark.parametrize(("size", "changes", "is_enough"), [(100, 0, False), (500_000, 0, True), (100, 5_000, True)])
def test_a_longer_file_and_more_changes_may_take_more_steps_to_read(tmp_path, size, changes, is_enough):
    database = Database(str(tmp_path / "some.db"))
    database.write("CREATE TABLE filled AS SELECT zeroblob(?)", [size])
    database.commit()
    database.abandon()
    database = Database(database.path)
    database.connection.executemany("INSERT INTO filled VALUES (?)", [(0,)] * changes)
    steps = "WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n LIMIT 250000) SELECT count(*) FROM n"
    with contextlib.nullcontext() if is_enough else pytest.raises(BadFile, match="far longer to read"):
        assert database.read(steps) == [(250_000,)]
    database.abandon()


def test_a_row_that_cannot_be_written_is_no_duplicate(database):
    first = database()
    first.create_map("m", {"id": int}, "id")
    first.close()
    store = database()
    store.create_map("m", {"id": int}, "id")
    with contextlib.closing(sqlite3.connect(database.path)) as connection, connection:
        connection.execute("DROP TABLE m")
    with pytest.raises(BadFile, match="no such table"):
        store.insert_data("m", {"id": 1})


def test_no_flipped_byte_leaks_an_error_of_sqlite(rows_of, database):
    first = database()
    fill(first)
    first.close()
    data, rng = database.path.read_bytes(), random.Random(4)
    used = [at for at, byte in enumerate(data) if byte]
    for at in rng.sample(used, 250):
        database.path.write_bytes(data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :])
        store = None
        try:
            store = database()
            store.create_map("nodes", SCHEMA, "id")
            rows_of(store, "nodes")
            store.delete_map("nodes")
            store.create_map("nodes", SCHEMA, "id")
            store.insert_data("nodes", {"id": 7, "a b": [], "X": 0.0})
        except (BadFile, BadValue, KeyError):
            pass
        finally:
            with contextlib.suppress(BadFile):
                store and store.close()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("X", "text"),
        ("X", b"short"),
        ("id", "text"),
        ("a b", b"\xff\xff"),
        ("a b", 3),
        ("a b", packing.to_bytes(5, "it")),
        ("a b", packing.to_bytes({1: 2}, "it")),
        ("a b", packing.to_bytes([1, 2], "it")[:-1]),
        ("a b", packing.to_bytes([1, 2], "it") + b"\x00"),
        ("a b", b"\x91\xd4\x63\x00"),  # an extension that we never write
        ("a b", b""),
    ],
)
def test_a_damaged_value_is_named_and_never_run(rows_of, database, column, value):
    first = database()
    fill(first)
    first.close()
    run(database.path, f'UPDATE nodes SET "{column}" = ? WHERE id = 2', value)
    second = database()
    second.create_map("nodes", SCHEMA, "id")
    with pytest.raises(BadFile, match="damaged"):
        rows_of(second, "nodes")
