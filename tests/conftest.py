"""What tests of several packages need; each package brings its own `ctx`."""

import gc
import logging

import pytest
from hypothesis import settings

settings.register_profile("gamms", deadline=None, derandomize=True)  # no test is about time, or about luck
settings.load_profile("gamms")


def pytest_collection_finish():
    """Keep thousands of collected tests from being looked through by each garbage collection."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _log_level_of_its_own():
    """Begin every test with the level that the logger of all contexts has in a new process."""
    logging.getLogger("gamms").setLevel(logging.NOTSET)


class Listener:
    """A logger that keeps the warnings."""

    def __init__(self):
        self.warnings = []

    def warning(self, message):
        self.warnings.append(message)

    def debug(self, message):
        """Keep nothing."""

    info = error = critical = setLevel = debug


@pytest.fixture
def heard(ctx):
    """The warnings of the context."""
    ctx.logger = Listener()
    return ctx.logger.warnings
