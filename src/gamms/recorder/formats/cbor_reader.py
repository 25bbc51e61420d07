"""Reads CBOR (RFC 8949) as plain data and nothing else; it never makes an object that a file asks for.

Numbers, texts, bytes, lists, maps, None, and sets (tag 258) come out as what they are. Any other tag, such as a date,
a regular expression or a shared reference, comes out as a `Tagged`, unopened. Sizes, nesting and the number of items
are bounded before anything is allocated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from typing import Any

from gamms.errors import BadFile
from gamms.limits import Keys
from gamms.plain import Plain

MOST_BYTES = 1 << 24  # of one record
MOST_ITEMS = 1 << 20  # in one record: each takes at most some 100 bytes of memory
MOST_DEPTH = 64
MOST_BIGNUM_BYTES = 1 << 10

SET = 258
_BIGNUMS = (2, 3)
_SIMPLE = {20: False, 21: True, 22: None}
_FLOATS = {25: Struct(">e"), 26: Struct(">f"), 27: Struct(">d")}
_SIZES = {24: Struct(">B"), 25: Struct(">H"), 26: Struct(">I"), 27: Struct(">Q")}


class Incomplete(Exception):
    """The bytes end before the item does."""


class BadCbor(Exception):
    """The bytes are no plain data, or too much of it."""


@dataclass(frozen=True, slots=True)
class Tagged:
    """A tagged value that was not opened: the number of the tag and the plain data behind it."""

    number: int
    value: Plain


class CborReader:
    """Reads items from bytes, front to back; `position` is where the next one begins.

    Every method raises Incomplete or BadCbor.

    Args:
        data: the bytes.
        position: where the first item begins.
        keys: those of the file that were read before.
    """

    def __init__(self, data: bytes | bytearray, position: int = 0, keys: Keys | None = None) -> None:
        self._data = data
        self._keys = keys or Keys()
        self.position = position
        self._begin = position
        self._items = 0

    def item(self, depth: int = 0) -> Plain:
        """Return the next item."""
        data, position = self._data, self.position
        if position >= len(data):
            raise Incomplete
        head = data[position]
        self.position = position + 1
        self._items += 1
        if self._items > MOST_ITEMS or position - self._begin > MOST_BYTES:
            raise BadCbor(f"it has more than {MOST_ITEMS} items or {MOST_BYTES} bytes")
        kind, info = head >> 5, head & 31
        if kind == _SIMPLE_KIND:
            return self._simple(info)
        size = info if info < 24 else self._size(info)
        return _READERS[kind](self, size, depth)

    def _size(self, info: int) -> int:
        if info not in _SIZES:
            raise BadCbor("it holds an item of no stated length")
        return int(self._unpack(_SIZES[info]))

    def _unpack(self, form: Struct) -> Any:
        position = self.position
        if position + form.size > len(self._data):
            raise Incomplete
        self.position = position + form.size
        return form.unpack_from(self._data, position)[0]

    def _bytes(self, size: int) -> bytes:
        if size > MOST_BYTES:
            raise BadCbor(f"it holds a text of {size} bytes, more than {MOST_BYTES}")
        begin, end = self.position, self.position + size
        if end > len(self._data):
            raise Incomplete
        self.position = end
        return bytes(self._data[begin:end])

    def _text(self, size: int) -> str:
        try:
            return self._bytes(size).decode()
        except UnicodeDecodeError as error:
            raise BadCbor("it holds a text that is not UTF-8") from error

    def _check_container(self, count: int, depth: int) -> None:
        if count > MOST_ITEMS:
            raise BadCbor(f"it holds a collection of {count} items, more than {MOST_ITEMS}")
        if depth >= MOST_DEPTH:
            raise BadCbor(f"it is nested deeper than {MOST_DEPTH}")

    def _list(self, count: int, depth: int) -> list[Plain]:
        self._check_container(count, depth)
        return [self.item(depth + 1) for _ in range(count)]

    def _dict(self, count: int, depth: int) -> dict[Plain, Plain]:
        self._check_container(count, depth)
        found = {}
        for _ in range(count):
            key = self.item(depth + 1)
            if type(key) is not str:
                key = self._key(key)
            found[key] = self.item(depth + 1)
        if len(found) != count:
            raise BadCbor("it holds a map with a key that is there twice")
        return found

    def _tagged(self, number: int, depth: int) -> Plain:
        """Return what is behind a tag: a whole number, a set, or something that stays closed."""
        self._check_container(1, depth)
        value = self.item(depth + 1)
        if number in _BIGNUMS and isinstance(value, bytes):
            if len(value) > MOST_BIGNUM_BYTES:
                raise BadCbor(f"it holds a number of {len(value)} bytes, more than {MOST_BIGNUM_BYTES}")
            size = int.from_bytes(value, "big")
            return self._key(size if number == _BIGNUMS[0] else -1 - size)
        if number == SET and isinstance(value, list):
            return set(map(self._key, value))
        return Tagged(number, value)

    def _key(self, value: Plain) -> Plain:
        try:
            return self._keys.check(_hashable(value))
        except BadFile as error:
            raise BadCbor(str(error)) from error

    def _simple(self, info: int) -> Plain:
        if info in _FLOATS:
            return self._unpack(_FLOATS[info])
        if info in _SIMPLE:
            return _SIMPLE[info]
        raise BadCbor("it holds a value that is no plain data")


_READERS: tuple[Callable[[CborReader, int, int], Plain], ...] = (  # by the upper three bits of the first byte
    lambda _, size, __: size,
    lambda _, size, __: -1 - size,
    lambda reader, size, _: reader._bytes(size),
    lambda reader, size, _: reader._text(size),
    CborReader._list,
    CborReader._dict,
    CborReader._tagged,
)
_SIMPLE_KIND = len(_READERS)


def _hashable(value: Plain) -> Plain:
    """Return a key: lists, which the format has instead of tuples, become tuples."""
    if isinstance(value, list):
        return tuple(_hashable(one) for one in value)
    if isinstance(value, set):
        return frozenset(value)
    if isinstance(value, dict | Tagged):
        raise BadCbor("it holds a key that is no plain value")
    return value
