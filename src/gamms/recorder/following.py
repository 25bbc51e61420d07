"""Reports of a game to those who follow it while it is played, such as pages in a browser."""

from collections.abc import Callable
from typing import Any, Protocol

from gamms.ir.events import Log
from gamms.recorder.keyframes import Keyframe


class Follower(Protocol):
    """Gets the events of a game while it is played, in the form in which they are recorded."""

    def begin(self, header: dict[str, Any], state: Keyframe) -> None:
        """Begin, or begin again, with the present state; turns follow.

        Args:
            header: the header of a recording that would begin now.
            state: the whole state; not to be changed.
        """

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Take the events since the last call.

        Args:
            log: the events; not to be changed.
            is_over: whether the turn is over; else agents decide next.
        """


class Following:
    """The followers of a session, and how much they know.

    Args:
        followers: get the reports.
        header: returns the header of the session.

    Attributes:
        edits: how often drawings had been edited when the followers began; None: they have not begun.
    """

    def __init__(self, followers: tuple[Follower, ...], header: Callable[[], dict[str, Any]]) -> None:
        self._followers = followers
        self._header = header
        self._heard = 0  # entries of the log of this turn that they know
        self.edits: int | None = None

    def begin(self, looks: dict[str, Any], state: Keyframe, edits: int, heard: int) -> None:
        """Let followers begin.

        Args:
            looks: items of the header that are different now.
            state: the whole state.
            edits: how often drawings were edited.
            heard: entries of the log of this turn that the state contains.
        """
        self.edits = edits
        self._heard = heard
        header = self._header() | looks
        for follower in self._followers:
            follower.begin(header, state)

    def tell(self, log: Log, *, is_over: bool) -> None:
        """Report the part of the log of this turn that the followers do not know."""
        news = log[self._heard :]
        self._heard = 0 if is_over else len(log)
        for follower in self._followers:
            follower.hear(news, is_over=is_over)
