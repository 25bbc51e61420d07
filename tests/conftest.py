"""What tests of several packages need; each package brings its own `ctx`."""

import logging

import pytest
from hypothesis import settings

settings.register_profile("gamms", deadline=None)  # no test is about time
settings.load_profile("gamms")


@pytest.fixture(autouse=True)
def _levels_end_with_the_test():
    """Give the logger, which all contexts share, the level back that it had."""
    ours = logging.getLogger("gamms")
    level = ours.level
    yield
    ours.setLevel(level)


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
