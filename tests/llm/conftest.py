"""Makes the helpers of this folder importable, and gives each test a server of its own."""

import sys
from pathlib import Path

import pytest

import gamms

sys.path.insert(0, str(Path(__file__).parent))
from loopback import KEY, LoopbackServer


@pytest.fixture
def server():
    one = LoopbackServer()
    yield one
    one.close()


@pytest.fixture(autouse=True)
def key_of_the_server(monkeypatch):
    monkeypatch.setenv("LOOPBACK_KEY", KEY)


@pytest.fixture
def strategy_of(server):
    """Make a strategy that asks the server, and is quick to give up."""

    def make(**options):
        given = {"key_variable": "LOOPBACK_KEY", "seconds": 20, **options}
        return gamms.llm.Strategy(server.url, "loop-1", "Go east.", **given)

    return make
