"""The tests of recordings find what they share beside them."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def ctx():
    """A grid with three sensors."""
    from games import grid_context

    with grid_context() as ctx:
        yield ctx


@pytest.fixture
def empty():
    """A context with nothing in it."""
    from games import empty_context

    with empty_context(seed=2) as ctx:
        yield ctx
