"""Reads CBOR (RFC 8949) as plain data and nothing else; it never makes an object that a file asks for.

Numbers, texts, bytes, lists, maps, None, and sets (tag 258) come out as what they are. Any other tag, such as a date,
a regular expression or a shared reference, comes out as a `Tagged`, unopened. Sizes, nesting and the number of items
are bounded before anything is allocated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from struct import Struct
from typing import Any, ClassVar

from gamms.errors import BadFile
from gamms.limits import Keys

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


class Damaged(Exception):
    """The bytes are no plain data, or too much of it."""


@dataclass(frozen=True, slots=True)
class Tagged:
    """A tagged value that was not opened: the number of the tag and the plain data behind it."""

    number: int
    value: Any


class PlainReader:
    """Reads items from bytes, front to back; `position` is where the next one begins.

    Every method raises Incomplete or Damaged.

    Args:
        data: the bytes.
        position: where the first item begins.
        keys: those of the file that were read before.

    Attributes:
        readers: what reads items, by major type, the upper three bits of the first byte.
        most_items: that one may have, with all that is in it.
        most_bytes: likewise.
    """

    readers: "ClassVar[list[Callable[[Any, int, int], Any]]]"
    most_items: ClassVar[int] = MOST_ITEMS
    most_bytes: ClassVar[int] = MOST_BYTES

    def __init__(self, data: bytes | bytearray, position: int = 0, keys: Keys | None = None) -> None:
        self._data = data
        self._keys = keys or Keys()
        self.position = position
        self._begin = position
        self._items = 0

    def item(self, depth: int = 0) -> Any:
        """The next item."""
        data, position = self._data, self.position
        if position >= len(data):
            raise Incomplete
        head = data[position]
        self.position = position + 1
        self._items += 1
        if self._items > self.most_items or position - self._begin > self.most_bytes:
            raise Damaged(f"it has more than {self.most_items} items or {self.most_bytes} bytes")
        return self.readers[head >> 5](self, head & 31, depth)

    def _size(self, info: int) -> int:
        if info < 24:
            return info
        if info not in _SIZES:
            raise Damaged("it holds an item of no stated length")
        return int(self._unpack(_SIZES[info]))

    def _unpack(self, form: Struct) -> Any:
        position = self.position
        if position + form.size > len(self._data):
            raise Incomplete
        self.position = position + form.size
        return form.unpack_from(self._data, position)[0]

    def _bytes(self, info: int) -> bytes:
        size = self._size(info)
        if size > self.most_bytes:
            raise Damaged(f"it holds a text of {size} bytes, more than {self.most_bytes}")
        begin, end = self.position, self.position + size
        if end > len(self._data):
            raise Incomplete
        self.position = end
        return bytes(self._data[begin:end])

    def _count(self, info: int, depth: int) -> int:
        count = self._size(info)
        if count > self.most_items:
            raise Damaged(f"it holds a collection of {count} items, more than {self.most_items}")
        if depth >= MOST_DEPTH:
            raise Damaged(f"it is nested deeper than {MOST_DEPTH}")
        return count

    def unsigned(self, info: int, depth: int) -> int:  # noqa: ARG002 - all readers of the table have one shape
        """A whole number from zero up."""
        return self._size(info)

    def negative(self, info: int, depth: int) -> int:  # noqa: ARG002 - see `unsigned`
        """A whole number below zero."""
        return -1 - self._size(info)

    def bytes_of(self, info: int, depth: int) -> bytes:  # noqa: ARG002 - see `unsigned`
        """Bytes."""
        return self._bytes(info)

    def text(self, info: int, depth: int) -> str:  # noqa: ARG002 - see `unsigned`
        """A text."""
        try:
            return self._bytes(info).decode()
        except UnicodeDecodeError as error:
            raise Damaged("it holds a text that is not UTF-8") from error

    def array(self, info: int, depth: int) -> list[Any]:
        """A list."""
        return [self.item(depth + 1) for _ in range(self._count(info, depth))]

    def map(self, info: int, depth: int) -> dict[Any, Any]:
        """A dict, in the order of the file."""
        count, found = self._count(info, depth), {}
        for _ in range(count):
            key = self.item(depth + 1)
            if type(key) is not str:
                key = self._key(key)
            found[key] = self.item(depth + 1)
        if len(found) != count:
            raise Damaged("it holds a map with a key that is there twice")
        return found

    def tagged(self, info: int, depth: int) -> Any:
        """What is behind a tag: a whole number, a set, or something that stays closed."""
        number = self._size(info)
        if depth >= MOST_DEPTH:
            raise Damaged(f"it is nested deeper than {MOST_DEPTH}")
        value = self.item(depth + 1)
        if number in _BIGNUMS and isinstance(value, bytes):
            if len(value) > MOST_BIGNUM_BYTES:
                raise Damaged(f"it holds a number of {len(value)} bytes, more than {MOST_BIGNUM_BYTES}")
            size = int.from_bytes(value, "big")
            return self._key(size if number == _BIGNUMS[0] else -1 - size)
        if number == SET and isinstance(value, list):
            return set(map(self._key, value))
        return Tagged(number, value)

    def _key(self, value: Any) -> Any:
        """A value as a key."""
        try:
            return self._keys.check(_hashable(value))
        except BadFile as error:
            raise Damaged(str(error)) from error

    def simple(self, info: int, depth: int) -> Any:  # noqa: ARG002 - see `unsigned`
        """A truth value, None, or a floating-point number."""
        if info in _FLOATS:
            return self._unpack(_FLOATS[info])
        if info in _SIMPLE:
            return _SIMPLE[info]
        raise Damaged("it holds a value that is no plain data")


PlainReader.readers = [
    PlainReader.unsigned,
    PlainReader.negative,
    PlainReader.bytes_of,
    PlainReader.text,
    PlainReader.array,
    PlainReader.map,
    PlainReader.tagged,
    PlainReader.simple,
]


def _hashable(value: Any) -> Any:
    """A key: lists, which the format has instead of tuples, become tuples."""
    if isinstance(value, list):
        return tuple(_hashable(one) for one in value)
    if isinstance(value, set):
        return frozenset(value)
    if isinstance(value, dict | Tagged):
        raise Damaged("it holds a key that is no plain value")
    return value
