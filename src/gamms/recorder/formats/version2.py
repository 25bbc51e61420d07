"""Format version 2, of gamms 1.0.0: reads all of its recordings; `compat.py` writes the same bytes.

Layout: 4 bytes `MMGR`; the version, a big-endian uint32; then one CBOR map per event, with the keys `timestamp` (int,
nanoseconds), `opCode` (int) and, except for the last record, `data` (a map). There is no index and no checksum. The
last record is TERMINATE; bytes after it are not read.

`CborReader` reads CBOR (RFC 8949) as plain data only; it never creates objects that a file requests. Numbers, texts,
bytes, lists, maps, None, and sets (tag 258) are decoded; a value with any other tag, for example a date, a regular
expression or a shared reference, is returned as a `Tagged`. Sizes, nesting and the number of items are checked before
memory is allocated.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from struct import Struct
from typing import Any, BinaryIO

from gamms.errors import BadFile, BadType, BadValue
from gamms.ir.events import EVENTS
from gamms.ir.packing import to_bytes
from gamms.limits import KeyBudget
from gamms.plain import Plain
from gamms.recorder.errors import RecordingError
from gamms.typing.recorder import MAGIC_NUMBER, OpCodes

Record = dict[str, Plain]  # timestamp, opCode, data

VERSION = 2
ENDED = "Recording ended unexpectedly."  # the message of 1.0.0, which programs check

# Conversion of the records of each version to the next. Version 1 has the layout of version 2.
TRANSLATIONS: dict[int, Callable[[Record], Record]] = {1: lambda record: record}

# Required keys of the data of each record.
FIELDS = {
    code.value: frozenset(key for key, field in EVENTS[code.value].fields.items() if not field.is_optional)
    for code in OpCodes
}

_HEADER = Struct(">4sI")
_BLOCK = 1 << 16
_TERMINATE = OpCodes.TERMINATE.value
# Common beginning of the records of 1.0.0, read at once; `CborReader` reads the rest.
_FRONT = Struct(">11sxQ7sxI5s")
_FRONT_TEXTS = (b"\xa3\x69timestamp", b"\x66opCode", b"\x64data")
_MARKS = (0x1B, 0x1A)
_MARKS_AT = (11, 27)

MOST_BYTES = 1 << 24  # of one record
MOST_ITEMS = 1 << 20  # per record, at about 100 bytes of memory each
MOST_DEPTH = 64
MOST_BIGNUM_BYTES = 1 << 10

SET = 258
_BIGNUMS = (2, 3)
_SIMPLE = {20: False, 21: True, 22: None}
_FLOATS = {25: Struct(">e"), 26: Struct(">f"), 27: Struct(">d")}
_SIZES = {24: Struct(">B"), 25: Struct(">H"), 26: Struct(">I"), 27: Struct(">Q")}


# -- plain data of CBOR -----------------------------------------------------------------------------------------


class Incomplete(Exception):
    """The bytes end before the item is complete."""


class BadCbor(Exception):
    """The bytes are not plain data, or exceed a limit."""


@dataclass(frozen=True, slots=True)
class Tagged:
    """A tagged value that was not decoded: the number of the tag and the plain data after it."""

    number: int
    value: Plain


class CborReader:
    """Reads items from bytes sequentially; `position` is the start of the next item.

    Every method raises Incomplete or BadCbor.

    Args:
        data: the bytes.
        position: start of the first item.
        keys: dict keys read before in this file.
    """

    def __init__(self, data: bytes | bytearray, position: int = 0, keys: KeyBudget | None = None) -> None:
        self._data = data
        self._keys = keys or KeyBudget()
        self.position = position
        self._begin = position
        self._items = 0

    def read_item(self, depth: int = 0) -> Plain:
        """Return the next item."""
        data = self._data
        position = self.position
        if position >= len(data):
            raise Incomplete
        head = data[position]
        self.position = position + 1
        self._items += 1
        if self._items > MOST_ITEMS or position - self._begin > MOST_BYTES:
            raise BadCbor(f"it has more than {MOST_ITEMS} items or {MOST_BYTES} bytes")
        kind = head >> 5
        info = head & 31
        if kind == _SIMPLE_KIND:
            if info not in _FLOATS and info not in _SIMPLE:
                raise BadCbor("it holds a value that is no plain data")
            return self._unpack(_FLOATS[info]) if info in _FLOATS else _SIMPLE[info]
        size = info if info < 24 else self._read_size(info)
        return _READERS[kind](self, size, depth)

    def _read_size(self, info: int) -> int:
        if info not in _SIZES:
            raise BadCbor("it holds an item of no stated length")
        return int(self._unpack(_SIZES[info]))

    def _unpack(self, form: Struct) -> Any:
        position = self.position
        if position + form.size > len(self._data):
            raise Incomplete
        self.position = position + form.size
        return form.unpack_from(self._data, position)[0]

    def _read_bytes(self, size: int) -> bytes:
        if size > MOST_BYTES:
            raise BadCbor(f"it holds a text of {size} bytes, more than {MOST_BYTES}")
        begin = self.position
        end = self.position + size
        if end > len(self._data):
            raise Incomplete
        self.position = end
        return bytes(self._data[begin:end])

    def _read_text(self, size: int) -> str:
        try:
            return self._read_bytes(size).decode()
        except UnicodeDecodeError as error:
            raise BadCbor("it holds a text that is not UTF-8") from error

    def _check_container(self, count: int, depth: int) -> None:
        if count > MOST_ITEMS:
            raise BadCbor(f"it holds a collection of {count} items, more than {MOST_ITEMS}")
        if depth >= MOST_DEPTH:
            raise BadCbor(f"it is nested deeper than {MOST_DEPTH}")

    def _read_list(self, count: int, depth: int) -> list[Plain]:
        self._check_container(count, depth)
        return [self.read_item(depth + 1) for _ in range(count)]

    def _read_dict(self, count: int, depth: int) -> dict[Plain, Plain]:
        self._check_container(count, depth)
        found = {}
        for _ in range(count):
            key = self.read_item(depth + 1)
            if type(key) is not str:
                key = self._make_key(key)
            found[key] = self.read_item(depth + 1)
        if len(found) != count:
            raise BadCbor("it holds a map with a key that is there twice")
        return found

    def _read_tagged(self, number: int, depth: int) -> Plain:
        """Return the value of a tag: an integer, a set, or a `Tagged`."""
        self._check_container(1, depth)
        value = self.read_item(depth + 1)
        if number in _BIGNUMS and isinstance(value, bytes):
            if len(value) > MOST_BIGNUM_BYTES:
                raise BadCbor(f"it holds a number of {len(value)} bytes, more than {MOST_BIGNUM_BYTES}")
            size = int.from_bytes(value, "big")
            return self._make_key(size if number == _BIGNUMS[0] else -1 - size)
        if number == SET and isinstance(value, list):
            return set(map(self._make_key, value))
        return Tagged(number, value)

    def _make_key(self, value: Plain) -> Plain:
        key = _make_hashable(value)
        if type(key) is str:
            return key
        try:
            self._keys.check(key, to_bytes(key, "A key", MOST_DEPTH))
        except (BadFile, BadValue) as error:  # also of sets nested too deeply
            raise BadCbor(str(error)) from error
        return key


_READERS: tuple[Callable[[CborReader, int, int], Plain], ...] = (  # by the upper three bits of the first byte
    lambda _, size, __: size,
    lambda _, size, __: -1 - size,
    lambda reader, size, _: reader._read_bytes(size),
    lambda reader, size, _: reader._read_text(size),
    CborReader._read_list,
    CborReader._read_dict,
    CborReader._read_tagged,
)
_SIMPLE_KIND = len(_READERS)


def _make_hashable(value: Plain) -> Plain:
    """Return a dict key; lists, which the format has instead of tuples, become tuples."""
    if isinstance(value, list):
        return tuple(_make_hashable(one) for one in value)
    if isinstance(value, set):
        return frozenset(value)
    if isinstance(value, dict | Tagged):
        raise BadCbor("it holds a key that is no plain value")
    return value


# -- reading ----------------------------------------------------------------------------------------------------


def read(stream: BinaryIO) -> Iterator[Record]:
    """Yield the records of a recording, TERMINATE last, within bounded memory.

    Raises:
        RecordingError: at the first `next`, if this is not a recording of version 1 or 2; later, if a record is damaged
            or the file ends before TERMINATE. All earlier records have been yielded.
    """
    window = _StreamWindow(stream)
    lifts = [TRANSLATIONS[version] for version in range(_read_version(window), VERSION)]
    while True:
        offset = window.offset
        record = _read_record(window)
        for lift in lifts:
            record = lift(record)
        _check(record, offset)
        yield record
        if record["opCode"] == _TERMINATE:
            return


class _StreamWindow:
    """The part of the stream in memory: `data` from `position` on; `offset` bytes are before it."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._behind = 0  # bytes of the stream before `data`
        self.data = b""
        self.position = 0
        self.keys = KeyBudget()

    @property
    def offset(self) -> int:
        return self._behind + self.position

    def grow(self) -> bool:
        """Read more data, at least doubling the window for long records; return whether there was any."""
        left = self.data[self.position :]
        more = self._stream.read(max(_BLOCK, len(left)))
        if not isinstance(more, bytes):
            raise BadType(f"A recording is read from a binary stream, not one that gives {type(more).__name__}.")
        self._behind += self.position
        self.data = left + more
        self.position = 0
        return bool(more)


def _read_version(window: _StreamWindow) -> int:
    while len(window.data) < _HEADER.size and window.grow():
        pass
    if len(window.data) < _HEADER.size or not window.data.startswith(MAGIC_NUMBER):
        raise RecordingError("This is not a recording: it does not begin with 'MMGR' and a version (byte 0).")
    version = int(_HEADER.unpack_from(window.data)[1])
    if not 0 < version <= VERSION:
        raise RecordingError(f"The recording has format version {version} (byte 4); this reads 1 to {VERSION}.")
    window.position = _HEADER.size
    return version


def _read_record(window: _StreamWindow) -> Record:
    while True:
        try:
            return _read_next_record(window)
        except Incomplete:
            if window.grow():
                continue
        except BadCbor as error:
            raise _make_damage_error(window.offset, str(error)) from error
        if window.position == len(window.data):
            raise RecordingError(f"{ENDED} There is no closing record at byte {window.offset}.")
        raise RecordingError(f"{ENDED} The record at byte {window.offset} is cut off.")


def _read_next_record(window: _StreamWindow) -> Record:
    data = window.data
    position = window.position
    if len(data) - position > _FRONT.size:
        begin, time, code, opcode, rest = _FRONT.unpack_from(data, position)
        marks = (data[position + _MARKS_AT[0]], data[position + _MARKS_AT[1]])
        if (begin, code, rest) == _FRONT_TEXTS and marks == _MARKS:
            reader = CborReader(data, position + _FRONT.size, window.keys)
            record: Record = {"timestamp": time, "opCode": opcode, "data": reader.read_item(1)}
            window.position = reader.position
            return record
    reader = CborReader(data, position, window.keys)
    found = reader.read_item()
    if type(found) is not dict:
        raise BadCbor("it is not a map")
    window.position = reader.position
    return found


def _check(record: Record, offset: int) -> None:
    opcode = record.get("opCode")
    if type(opcode) is not int or type(record.get("timestamp")) is not int:
        raise _make_damage_error(offset, "it has no whole 'timestamp' and 'opCode'")
    if opcode not in FIELDS:
        raise _make_damage_error(offset, f"there is no operation {opcode:#x}")
    data = record.get("data")
    is_map = type(data) is dict or (data is None and opcode == _TERMINATE)
    if len(record) != (3 if "data" in record else 2) or not is_map:
        raise _make_damage_error(offset, "it has parts other than 'timestamp', 'opCode' and a map 'data'")
    if data is not None and not FIELDS[opcode] <= data.keys():
        missing = ", ".join(sorted(FIELDS[opcode] - data.keys()))
        raise _make_damage_error(offset, f"{OpCodes(opcode).name} needs {missing}")


def _make_damage_error(offset: int, reason: str) -> RecordingError:
    return RecordingError(f"{ENDED} The record at byte {offset} is damaged: {reason}.")
