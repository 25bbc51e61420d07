"""Contexts that say nothing, and a logger that listens."""

import pytest

import gamms


class Listener:
    """A logger that keeps its messages."""

    def __init__(self):
        self.heard = []
        self.debug = self.info = self.warning = self.error = self.critical = self.heard.append

    def setLevel(self, level):
        """Hear everything."""


@pytest.fixture
def listener():
    return Listener()


@pytest.fixture
def open_context():
    """Open a quiet context; all of them are closed at the end."""
    opened = []

    def open_it(*args, **kwargs):
        ctx = gamms.create_context(*args, **{"logger_config": {"level": "CRITICAL"}, **kwargs})
        opened.append(ctx)
        return ctx

    yield open_it
    for ctx in opened:
        ctx.terminate()
