"""The errors of the recorder."""

from types import TracebackType

from gamms.errors import ContextTerminated, GammsError
from gamms.text import reason


class RecordingError(GammsError, ValueError):
    """An invalid, damaged or oversized recording, or a recording that can no longer be written."""


class RecorderBusy(GammsError, RuntimeError):
    """A request that conflicts with the present operation of the recorder."""


class Damaged(GammsError, ValueError):
    """An invalid state, or an event that does not fit the state."""


# raised by data that no recorder has written
DAMAGES = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)
UNFIT = (GammsError, *DAMAGES)  # raised when such data are applied to a context


class report_damage:  # noqa: N801 - it reads as a word in `with reporting_damage(…):`
    """Turn errors from damaged data into an error with a clear message; a context manager.

    Args:
        what: beginning of the message; the reason follows.
        errors: classes of errors to convert.
        kind: class of the new error; errors of this class, and deliberate errors, are not converted.
        with_type: whether the message includes the type of the error, because its text may be short.
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
        self._what = what
        self._errors = errors
        self._kind = kind
        self._with_type = with_type

    def __enter__(self) -> None:
        """Do nothing."""

    def __exit__(self, _: object, error: BaseException | None, trace: TracebackType | None) -> None:
        if isinstance(error, self._errors) and not isinstance(error, (self._kind, ContextTerminated)):
            why = f"{type(error).__name__}: {reason(error)}" if self._with_type else reason(error)
            raise self._kind(f"{self._what}: {why.rstrip('.')}.") from error
