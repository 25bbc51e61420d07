"""How much memory a file may take: what it holds in proportion to its size, what it declares up to one bound.

Readers of files that strangers can send (recordings, maps, scenarios, databases) ask here and keep no bound of their
own. `refuse_above` is for what a file *declares*: counts, grids, pieces of a line, pixels; it is estimated before it is
built. `Allowance` is for what a file *holds*: values packed in few bytes; it is charged before they are made.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from gamms.errors import BadValue, TooLarge

_GIB = 1 << 30
_DEFAULT = 2 * _GIB
_FLOOR = 1 << 26  # bytes of memory that any file may take, however small
_PER_BYTE = 1 << 10  # bytes of memory for each byte of the file: deflate packs honest values up to 1,000 times
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": _GIB, "T": 1 << 40}

_max_memory: ContextVar[int] = ContextVar("gamms_max_memory", default=_DEFAULT)


def max_memory() -> int:
    """Return how many bytes one file may make GAMMS take: 2 GiB, or what `allowing` says."""
    return _max_memory.get()


@contextmanager
def allowing(max_bytes: int) -> Iterator[None]:
    """Allow files up to `max_bytes` of memory within the block (`--max-memory` on the command line).

    Raises:
        BadValue: `max_bytes` is not positive.
    """
    if max_bytes <= 0:
        raise BadValue(f"max_memory must be a positive number of bytes, not {max_bytes}.")
    token = _max_memory.set(max_bytes)
    try:
        yield
    finally:
        _max_memory.reset(token)


def parse_memory(text: str) -> int:
    """Return the bytes that a text such as "512M", "8GiB" or "2000000" names.

    Raises:
        BadValue: the text names no number of bytes.
    """
    number = text.strip().upper().removesuffix("B").removesuffix("I")
    unit = number[-1:] if number[-1:] in {"K", "M", "G", "T"} else ""
    digits = number.removesuffix(unit).strip()
    if not digits.isdecimal() or len(digits) > 18:
        raise BadValue(f"A size of memory is a number with a unit, such as 512M or 8G, not {text!r:.60}.")
    return int(digits) * _UNITS[unit]


def refuse_above(estimated: float, what: str) -> None:
    """Refuse something that would take more memory than is allowed, before it is built.

    Args:
        estimated: bytes.
        what: the subject of the message, with the value that asks for it, such as "grid of 3000 x 3000 nodes".

    Raises:
        TooLarge (ValueError): it would take more than `max_memory()`.
    """
    if not estimated <= max_memory():
        raise TooLarge(
            f"{what} would take about {_shown(estimated)} of memory; {_shown(max_memory())} are allowed. {_WAY}"
        )


_WAY = "Make it smaller, or allow more: --max-memory 8G on the command line, gamms.limits.allowing(bytes) in Python."


class Allowance:
    """The memory that values decoded from one file may still take, in proportion to the size of the file.

    Args:
        file_size: bytes.
        what: the file, for the message.
    """

    __slots__ = ("_left", "_total", "_what")

    def __init__(self, file_size: int, what: str) -> None:
        self._total = self._left = min(_FLOOR + _PER_BYTE * file_size, max_memory())
        self._what = what

    def charge(self, size: int) -> None:
        """Take `size` bytes of the allowance.

        Raises:
            TooLarge (ValueError): they are not left.
        """
        self._left -= size
        if self._left < 0:
            raise TooLarge(
                f"{self._what} unpacks to more than {_shown(self._total)} of values, which honest files of its size "
                "do not; it is not read further."
            )


def _shown(size: float) -> str:
    """A number of bytes for people."""
    if size != size or size >= 1e18:  # noqa: PLR0124 - NaN differs from itself; beyond are no memories
        return "an astronomical amount"
    return f"{size / _GIB:.1f} GiB" if size >= _GIB else f"{size / (1 << 20):.0f} MiB"
