"""What the recorder raises on purpose."""

from types import TracebackType

from gamms.errors import ContextTerminated, GammsError
from gamms.text import reason


class RecordingError(GammsError, ValueError):
    """A recording that is damaged, foreign or absurdly large, or that can no longer be written."""


class RecorderBusy(GammsError, RuntimeError):
    """What was asked for does not go with what the recorder is doing."""


class Damaged(GammsError, ValueError):
    """A state is not right, or an event does not fit the state it happens to."""


DAMAGES = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)  # by data that no recorder wrote
UNFIT = (GammsError, *DAMAGES)  # the same, where it is handed to a context


class refusing:  # noqa: N801 - it reads as a word in `with refusing(…):`
    """Turn what data of a recording raise within the block into an error that says what is wrong with them.

    Args:
        what: the first words of the message; the reason follows.
        errors: that are turned.
        kind: of the error that is raised instead; errors of this kind, and those that a user meant, pass.
        with_type: whether the message says the type of the error, too, because its text alone may say little.
    """

    __slots__ = ("_errors", "_kind", "_what", "_with_type")

    def __init__(
        self,
        what: str,
        errors: tuple[type[Exception], ...] = UNFIT,
        kind: type[GammsError] = RecordingError,
        *,
        with_type: bool = False,
    ) -> None:
        self._what, self._errors, self._kind, self._with_type = what, errors, kind, with_type

    def __enter__(self) -> None:
        """Nothing to prepare."""

    def __exit__(self, _: object, error: BaseException | None, trace: TracebackType | None) -> None:
        if isinstance(error, self._errors) and not isinstance(error, (self._kind, ContextTerminated)):
            why = f"{type(error).__name__}: {reason(error)}" if self._with_type else reason(error)
            raise self._kind(f"{self._what}: {why.rstrip('.')}.") from error
