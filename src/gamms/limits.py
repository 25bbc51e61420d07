"""Memory limits for files: declared sizes have a fixed limit, decoded values a limit proportional to the file size.

All readers of untrusted files (recordings, maps, scenarios, databases) use these limits. `refuse_above` checks
*declared* sizes, such as counts, grids and pixels, from an estimate before anything is built. `MemoryBudget` limits
*decoded* values, and is charged before they are made. `KeyBudget` limits keys of dicts and sets with equal hashes,
which a hostile file could use to waste time.

`GarbagePause` speeds up imports of maps and timed searches, which make many objects and no garbage.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from gamms.errors import BadFile, BadType, BadValue, TooLarge
from gamms.text import shown

__all__ = [
    "allowing",
    "max_memory",
    "parse_memory",
    "refuse_above",
]  # the rest is for readers of files

_GIB = 1 << 30
_DEFAULT = 2 * _GIB
_FLOOR = 1 << 26  # bytes of memory that any file may take, however small
PER_BYTE = 1 << 10  # bytes of memory for each byte of the file: deflate packs honest values up to 1,000 times
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": _GIB, "T": 1 << 40}

_max_memory: ContextVar[int] = ContextVar("gamms_max_memory", default=_DEFAULT)


def max_memory() -> int:
    """Return the memory limit of one file in bytes: 2 GiB, or the limit set by `allowing`."""
    return _max_memory.get()


@contextmanager
def allowing(max_bytes: int | str) -> Iterator[None]:
    """Allow files up to `max_bytes` of memory within the block (`--max-memory` on the command line).

    Args:
        max_bytes: A number, or a text that `parse_memory` reads, such as "8G".

    Raises:
        BadType: `max_bytes` is neither.
        BadValue: `max_bytes` is not positive, or the text names no number of bytes.
    """
    max_bytes = parse_memory(max_bytes) if isinstance(max_bytes, str) else max_bytes
    if not isinstance(max_bytes, int):
        raise BadType(f"max_memory must be a number of bytes, or a text such as 8G, not {shown(max_bytes)}.")
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
        raise BadValue(f"A size of memory is a number with a unit, such as 512M or 8G, not {shown(text)}.")
    return int(digits) * _UNITS[unit]


def refuse_above(estimated: float, what: str) -> None:
    """Raise if an object would exceed the memory limit; call it before the object is built.

    Args:
        estimated: bytes.
        what: the subject of the message, with its size, such as "grid of 3000 x 3000 nodes".

    Raises:
        TooLarge (ValueError): the estimate exceeds `max_memory()`.
    """
    if not estimated <= max_memory():
        raise TooLarge(
            f"{what} would take about {_format_size(estimated)} of memory; {_format_size(max_memory())} are allowed. "
            f"{_WAY}",
            estimated,
        )


_WAY = 'Make it smaller, or allow more: --max-memory 8G on the command line, gamms.limits.allowing("8G") in Python.'


class MemoryBudget:
    """The remaining memory for values decoded from one file, initially proportional to the size of the file.

    Args:
        file_size: bytes.
        what: the file, for the message.
        is_streamed: whether values are let go before all are read: then the size of the file alone bounds their sum,
            and `max_memory` that of each, where `begin` says that it begins.

    Attributes:
        total: the number of bytes that all values may take.
        left: the number of bytes still available.
    """

    __slots__ = ("_left_at_once", "_what", "left", "total")

    def __init__(self, file_size: int, what: str, *, is_streamed: bool = False) -> None:
        total = _FLOOR + PER_BYTE * file_size
        self.total = total if is_streamed else min(total, max_memory())
        self.left = self.total
        self._left_at_once = self.left
        self._what = what

    def begin(self) -> None:
        """Begin a value, which may take `max_memory` at most."""
        self._left_at_once = max_memory()

    def charge(self, size: int) -> None:
        """Take `size` bytes from the budget.

        Raises:
            TooLarge (ValueError): the budget is exceeded.
        """
        self.left -= size
        self._left_at_once -= size
        if self.left < 0:
            raise TooLarge(
                f"{self._what} unpacks to more than {_format_size(self.total)} of values, which honest files of its "
                "size do not; it is not read further."
            )
        if self._left_at_once < 0:
            raise TooLarge(
                f"{self._what} holds a value that would take more than the {_format_size(max_memory())} of memory that "
                f"are allowed. {_WAY}"
            )


_MOST_ALIKE = 1 << 6  # different keys of one hash; honest ones have a few, for those of -1 and -2 are the same
_MOST_HASHES = 1 << 14  # that are kept in mind: who lets others come between has fewer keys of one hash, too
_WORD = 1 << 64


class KeyBudget:
    """Limits how many keys with equal hashes the dicts and sets of one file have.

    Python compares a key with all others of the same hash, so a file could make reading take quadratic time. Texts and
    bytes have secret hashes, and few numbers of 64 bits share one; but a file can hold any number of tuples, frozen
    sets and longer integers with one hash, so these are counted. Keys are different if their bytes in the file are.
    """

    __slots__ = ("_marks_of",)

    def __init__(self) -> None:
        self._marks_of: dict[int, set[int]] = {}  # hash -> secret hashes of the bytes of the keys that have it

    def check(self, key: object, data: bytes) -> None:
        """Check a value that may become a key, before it is put into a dict or a set.

        Args:
            key: the value.
            data: its bytes in the file.

        Raises:
            BadFile: too many different ones have its hash.
        """
        if isinstance(key, int):
            if -_WORD < key < _WORD:
                return
        elif not isinstance(key, (tuple, frozenset)):
            return
        try:
            marks = self._marks_of.setdefault(hash(key), set())
        except TypeError:  # there is a list in it, for example
            return
        marks.add(hash(data))
        if len(marks) > _MOST_ALIKE:
            raise BadFile(f"it holds more than {_MOST_ALIKE} different keys that were made to have one hash")
        if len(self._marks_of) > _MOST_HASHES:
            self._marks_of.clear()


def _format_size(size: float) -> str:
    """A number of bytes for people."""
    if size != size or size >= 1e18:  # noqa: PLR0124 - NaN differs from itself; beyond are no memories
        return "an astronomical amount"
    return f"{size / _GIB:.1f} GiB" if size >= _GIB else f"{size / (1 << 20):.0f} MiB"


class GarbagePause:
    """A `with` block without garbage collection; no effect if it is disabled already.

    Args:
        is_wanted: whether to pause.
    """

    # NOTE: no generator, which makes objects behind `enable`: the collection would begin there, and not in the program
    # (benchmarks: planning.py budget).

    def __init__(self, *, is_wanted: bool = True) -> None:
        self._is_wanted = is_wanted

    def __enter__(self) -> None:
        """Begin the pause."""
        self._is_paused = self._is_wanted and gc.isenabled()
        if self._is_paused:
            gc.disable()

    def __exit__(self, *_: object) -> None:
        """End it."""
        if self._is_paused:
            gc.enable()
