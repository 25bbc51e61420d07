"""Live reports of a game to followers, for example pages in a browser."""

from collections.abc import Callable
from typing import Any, Protocol

from gamms.ir.events import Log
from gamms.recorder.keyframes import Keyframe


class Follower(Protocol):
    """Receives the events of a running game, in their recorded form."""

    def begin(self, header: dict[str, Any], state: Keyframe) -> None:
        """Start, or restart, with the present state; turns follow.

        Args:
            header: the header of a recording that would begin now.
            state: the whole state; read-only.
        """

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Receive the events since the last call.

        Args:
            log: the events; read-only.
            is_over: whether the turn is over; otherwise agents decide next.
        """


class Following:
    """The followers of a session, and the events that they have received.

    Args:
        followers: receivers of the reports.
        header: returns the header of the session.

    Attributes:
        edits: edit count of the drawings when the followers started; None: not started.
    """

    def __init__(self, followers: tuple[Follower, ...], header: Callable[[], dict[str, Any]]) -> None:
        self._followers = followers
        self._header = header
        self._heard = 0  # entries of this turn's log already sent
        self.edits: int | None = None

    def begin(self, looks: dict[str, Any], state: Keyframe, edits: int, heard: int) -> None:
        """Start the followers.

        Args:
            looks: header items that have changed since.
            state: the whole state.
            edits: edit count of the drawings.
            heard: number of entries of this turn's log that the state includes.
        """
        self.edits = edits
        self._heard = heard
        header = self._header() | looks
        for follower in self._followers:
            follower.begin(header, state)

    def tell(self, log: Log, *, is_over: bool) -> None:
        """Send the new part of this turn's log to the followers."""
        news = log[self._heard :]
        self._heard = 0 if is_over else len(log)
        for follower in self._followers:
            follower.hear(news, is_over=is_over)
