"""What tests of several rooms need; each room brings its own `ctx`."""

import pytest
from hypothesis import settings

settings.register_profile("gamms", deadline=None)  # no test is about time
settings.load_profile("gamms")


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
    """The warnings that the context utters."""
    ctx.logger = Listener()
    return ctx.logger.warnings
