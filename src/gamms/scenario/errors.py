"""What is wrong with a scenario, and where in its file."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gamms.errors import GammsError
from gamms.text import printable

_LONGEST = 500  # letters of a path


class ScenarioError(GammsError, ValueError):
    """A scenario that cannot be played as it is written.

    Attributes:
        path: where in the scenario, such as `teams.red.count`; "" for the whole.
        file: the file it was read from, or None.
    """

    def __init__(self, path: str, message: str, file: object = None) -> None:
        self.path, self.message, self.file = path, message, None if file is None else str(file)
        super().__init__(printable(": ".join(part for part in (self.file, path, message) if part)))

    def within(self, file: object) -> "ScenarioError":
        """The same error, with the file it is about."""
        return ScenarioError(self.path, self.message, file)


def joined(path: str, key: Any) -> str:
    """The path of what `key` leads to; of long ones the beginning, since every value of a file gets one."""
    text = f"{path}.{key}" if path else str(key)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


@contextmanager
def at(path: str) -> Iterator[None]:
    """Tell errors of the rooms by where in the scenario they come from.

    Raises:
        ScenarioError: instead of any of ours, or of a file that cannot be read.
    """
    try:
        yield
    except ScenarioError:
        raise
    except (GammsError, OSError) as error:
        raise ScenarioError(path, str(error)) from error


@contextmanager
def named(file: object) -> Iterator[None]:
    """Tell errors by the file they are about; None if there is none.

    Raises:
        ScenarioError: the same, with the file.
    """
    try:
        yield
    except ScenarioError as error:
        if file is None or error.file is not None:
            raise
        raise error.within(file) from error.__cause__
