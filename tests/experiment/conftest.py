"""Makes the helpers of this folder importable, by worker processes too."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from gamms.workers import WorkerPool


@pytest.fixture(scope="session")
def pool():
    """Two worker processes for all tests."""
    with WorkerPool(2) as workers:
        yield workers
