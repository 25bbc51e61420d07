"""The stores that every test of one behaviour runs over."""

import pytest

from gamms.memory import MemoryStore, PathLike, SqliteStore


@pytest.fixture
def rows_of():
    """Gives all rows of a map, in order."""
    return lambda store, name: [store.get_data(name, key) for key in store.query_keys(name)]


@pytest.fixture(params=["memory", "sqlite", "sqlite in memory"])
def store(request, tmp_path):
    path = ":memory:" if request.param == "sqlite in memory" else str(tmp_path / "new folder" / "store.db")
    opened = MemoryStore("s") if request.param == "memory" else SqliteStore("s", PathLike(path))
    yield opened
    opened.close()


@pytest.fixture
def database(tmp_path):
    """Opens the same file as often as asked; closes what is still open."""
    path, opened = tmp_path / "store.db", []

    def open_it():
        opened.append(SqliteStore("s", PathLike(str(path))))
        return opened[-1]

    open_it.path = path
    yield open_it
    for one in opened:
        one.close()
