"""The engine keeps stores by name; a path is a value."""

import subprocess
import sys

import numpy as np
import pytest

from gamms.errors import GammsError
from gamms.memory import MemoryEngine, MemoryStore, PathLike, SqliteStore
from gamms.typing import IMemoryEngine, IStore, StoreType


@pytest.fixture
def engine():
    engine = MemoryEngine()
    yield engine
    engine.terminate()


def test_a_store_is_found_by_its_name(engine, tmp_path):
    kept = engine.create_store(StoreType.MEMORY, "kept")
    path = PathLike(str(tmp_path / "x.db"))
    filed = engine.create_store(StoreType.DATABASE, "filed", path)
    assert isinstance(engine, IMemoryEngine)
    assert isinstance(kept, MemoryStore)
    assert isinstance(filed, SqliteStore)
    assert isinstance(filed, IStore)
    assert engine.get_store("filed") is filed
    assert list(engine.list_stores()) == ["kept", "filed"]
    assert (kept.type, kept.name(), kept.path()) == (StoreType.MEMORY, "kept", None)
    assert (filed.type, filed.name(), filed.path()) == (StoreType.DATABASE, "filed", path)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ((StoreType.MEMORY, "taken"), ValueError),
        ((StoreType.DATABASE, "s"), ValueError),
        ((StoreType.DATABASE, "s", "x.db"), TypeError),
        ((StoreType.FILESYSTEM, "s"), NotImplementedError),
        ((7, "s"), ValueError),
        (("memory", "s"), ValueError),
        ((np.array([]), "s"), ValueError),
        ((StoreType.MEMORY, ""), ValueError),
        ((StoreType.MEMORY, 5), TypeError),
    ],
)
def test_a_store_that_cannot_be_is_refused(engine, arguments, error):
    engine.create_store(StoreType.MEMORY, "taken")
    with pytest.raises(error) as caught:
        engine.create_store(*arguments)
    assert isinstance(caught.value, GammsError)
    assert list(engine.list_stores()) == ["taken"]


def test_an_unknown_store_is_a_key_error(engine):
    engine.create_store(StoreType.MEMORY, "graph_store")
    with pytest.raises(KeyError, match="Did you mean 'graph_store'"):
        engine.get_store("graph_stor")


def test_the_name_of_a_closed_store_is_free(engine):
    engine.create_store(StoreType.MEMORY, "s").close()
    assert list(engine.list_stores()) == []
    engine.create_store(StoreType.MEMORY, "s")


def test_the_end_closes_the_others_when_one_cannot_be(engine, monkeypatch):
    first, broken, last = (engine.create_store(StoreType.MEMORY, name) for name in "abc")
    monkeypatch.setattr(broken, "_release", lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        engine.terminate()
    assert first.is_closed
    assert last.is_closed


def test_a_path_is_a_value():
    assert PathLike("a") == PathLike("a") != PathLike("b")
    assert len({PathLike("a"), PathLike("a")}) == 1
    assert PathLike("a") != "a"
    assert repr(PathLike(":memory:")) == "PathLike(':memory:')"
    assert (PathLike("a").path, PathLike("a").as_str()) == ("a", "a")
    assert not PathLike(":memory:").exists()
    assert PathLike(".").exists()


@pytest.mark.parametrize(("path", "error"), [("", ValueError), ("a\0", ValueError), (3, TypeError), (None, TypeError)])
def test_a_path_that_cannot_be_is_refused(path, error):
    with pytest.raises(error) as caught:
        PathLike(path)
    assert isinstance(caught.value, GammsError)


def test_sqlite_and_cbor_are_loaded_only_for_a_database():
    program = "import sys, gamms.memory; sys.exit(bool({'sqlite3', 'cbor2'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
