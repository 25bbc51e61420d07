"""Plain values as bytes, and back: MessagePack with extension types, packed by `packed_bytes.py`.

In a value each container is an extension whose content is one flat array of scalars and further extensions. So the
library decodes one level at a time: depth, memory and keys are checked before anything is made of the next one.
The same value gives the same bytes. docs/recording-format.md describes all of it byte by byte.
"""

from collections.abc import Callable, Sequence
from functools import cache
from math import prod
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from gamms.errors import BadFile, BadType, BadValue
from gamms.ir.packed_bytes import BEST, packed, steps, unpacked
from gamms.limits import PER_BYTE, Allowance, Keys
from gamms.plain import MOST_DIMENSIONS, Plain
from gamms.text import reason, shown

if TYPE_CHECKING:
    from msgspec.msgpack import Decoder as MessagePackDecoder
    from msgspec.msgpack import Encoder as MessagePackEncoder
    from msgspec.msgpack import Ext

Array = npt.NDArray[Any]
"""An array of any numbers."""

Item: TypeAlias = "bool | int | float | str | Ext | None"
"""What MessagePack holds of a value: a scalar, or an extension, which is not opened yet."""

MOST_DEPTH = 32  # containers in each other
DTYPES = {
    name: np.dtype(name)
    for name in (
        *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
        *("float16", "float32", "float64"),
    )
}

_NAMES = {dtype: name for name, dtype in DTYPES.items()}  # NOTE: NumPy takes 8 us to say a dtype's own name
_TUPLE, _LIST, _DICT, _SET, _FROZENSET, _BYTES, _INT, _TEXT, _ARRAY = range(9)  # codes of extensions
_PLAIN_CODES = frozenset({_BYTES, _INT, _TEXT})  # what is in no container
_EXTENSION_HEADS = bytes((*range(0xC7, 0xCA), *range(0xD4, 0xD9)))
_ONE = b"\x91"  # the head of an array with one item, which holds a value
_SCALARS = frozenset({type(None), bool, int, float, str})

# Bytes of memory, copies that are made of a state included.
_OF_ITEM = 48
_OF_CONTAINER = 160
_OF_BYTE = 4  # a letter of a text takes so much where there is an emoji in it

# -- bodies -----------------------------------------------------------------------------------------------------


def pack(value: Plain, where: str, level: int = BEST) -> bytes:
    """Return a plain value as packed bytes.

    Args:
        value: the value.
        where: what it is, for the message of an error.
        level: of zlib.

    Raises:
        BadType, BadValue: something in it is not plain.
    """
    return pack_parts([to_bytes(value, where)], level=level)


def unpack(body: bytes, decoder: "Decoder", *, is_new: bool = True) -> Plain:
    """Return what `pack` got.

    Args:
        body: what `pack` returned.
        decoder: of the file.
        is_new: whether the value is charged to the file; what is read again is not.

    Raises:
        BadFile: it is damaged, or the file has too much of it.
    """
    return decoder.value(unpack_parts(body, decoder.most_bytes)[0], is_new=is_new)


def pack_parts(values: Sequence[bytes], columns: Sequence[bytes] = (), cost: int = 0, level: int = BEST) -> bytes:
    """Return values, and columns behind them, as packed bytes that `unpack_parts` accepts.

    Args:
        values: the bytes of plain values.
        columns: the bytes of columns.
        cost: of the columns, in bytes of memory.
        level: of zlib.
    """
    data = b"".join(values)
    others = b"".join(columns)
    body = packed(data, level)
    if columns:
        body += packed(others, level)
    cost = max(cost, _OF_BYTE * (len(data) + len(others)))
    if PER_BYTE * len(body) < cost + most_cost_of(data):
        cost += sum(map(cost_of, values))
    return padded(body, cost)


def unpack_parts(body: bytes, most: int, *, has_columns: bool = False) -> tuple[bytes, bytes]:
    """Return the bytes of the values, and those of the columns.

    Raises:
        BadFile: they are damaged, or would decompress to more than `most` bytes.
    """
    values, rest = unpacked(body, most)
    columns = b""
    if has_columns:
        columns, rest = unpacked(rest, most)
    if rest.strip(b"\0"):
        raise BadFile(f"{len(rest)} bytes are left over")
    return values, columns


def padded(body: bytes, cost: int) -> bytes:
    """Return packed bytes, with zeros behind them where readers would refuse so much memory of so few bytes."""
    return body + bytes(max(0, -(-cost // PER_BYTE) - len(body)))


# -- arrays ----------------------------------------------------------------------------------------------------


def array_bytes(array: Array) -> bytes:
    """Return the bytes of an array: the first bytes of all items, then all second ones; of integers, of differences."""
    flat = np.ascontiguousarray(array).reshape(-1)
    if flat.dtype.kind in "iu":
        flat = steps(flat)
    flat = flat.astype(flat.dtype.newbyteorder("<"), copy=False)
    return flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T.tobytes()


def array_of(data: bytes, dtype: "np.dtype[Any]") -> Array:
    """Return the items that `array_bytes` got, (items,).

    Raises:
        BadFile: some bytes are missing.
    """
    if len(data) % dtype.itemsize:
        raise BadFile("a column is cut off")
    items = np.frombuffer(data, np.uint8).reshape(dtype.itemsize, -1).T.copy()
    if dtype.kind == "b":
        return items.reshape(-1).astype(np.bool_)
    flat: Array = items.view(dtype.newbyteorder("<")).reshape(-1).astype(dtype, copy=False)
    return np.cumsum(flat, dtype=dtype) if dtype.kind in "iu" else flat


# -- plain values to bytes --------------------------------------------------------------------------------------


def to_bytes(value: Plain, where: str, depth: int = MOST_DEPTH) -> bytes:
    """Return a plain value as bytes, the same bytes for the same value.

    Args:
        value: what is written.
        where: what it is, for the message.
        depth: how many containers may be in each other.

    Raises:
        BadType: something in it is not plain.
        BadValue: it is too deep.
    """
    try:
        return _encoder().encode([_written(value, depth)])
    except TypeError as error:
        raise BadType(
            f"{where} cannot be recorded: {reason(error)}. Only None, bool, int, float, str, bytes, list, tuple, set, "
            f"dict and NumPy arrays of numbers can; convert it first."
        ) from None
    except RecursionError:
        raise BadValue(f"{where} cannot be recorded: more than {MOST_DEPTH} containers are in each other.") from None


@cache
def _encoder() -> "MessagePackEncoder":
    from msgspec.msgpack import Encoder

    return Encoder()


@cache
def _extension() -> "type[Ext]":
    from msgspec.msgpack import Ext

    return Ext


def _written(value: Plain, depth: int) -> Item:
    """Return the scalar or the extension that says a value in which `depth` containers may be in each other."""
    kind = type(value)
    if kind is int:
        return _of_int(value)
    scalar: Item = value
    if kind in _SCALARS and (kind is not str or value.isascii()):
        return scalar
    way = _WAYS.get(kind) or next((way for kind, way in _WAYS.items() if isinstance(value, kind)), None)
    if way is None:
        raise TypeError(f"{shown(value)} is of type {kind.__name__}")
    return way(value, depth)


def _container(code: int, items: list[Plain], depth: int) -> Item:
    """Return the extension of a container."""
    if depth < 1:
        raise RecursionError
    if _SCALARS.issuperset(map(type, items)):
        try:
            return _extension()(code, _encoder().encode(items))
        except (OverflowError, UnicodeEncodeError):
            pass  # a long integer, or half of a surrogate pair
    return _extension()(code, _encoder().encode([_written(one, depth - 1) for one in items]))


def _of_int(value: int) -> Item:
    value = int(value)
    if -(1 << 63) <= value < 1 << 64:
        return value
    return _extension()(_INT, value.to_bytes(value.bit_length() // 8 + 1, "big", signed=True))


def _of_text(value: str) -> Item:
    text = str.__str__(value)  # of an enum, too
    try:
        text.encode()
    except UnicodeEncodeError:
        return _extension()(_TEXT, text.encode("utf-8", "surrogatepass"))
    return text


def _of_set(value: set[Plain] | frozenset[Plain], depth: int) -> Item:
    encode = _encoder().encode
    items = sorted(value, key=lambda one: encode([_written(one, depth - 1)]))  # a set has no order, and a file has
    return _container(_FROZENSET if isinstance(value, frozenset) else _SET, items, depth)


def _of_array(value: Array, depth: int) -> Item:
    dtype = value.dtype.newbyteorder("=")
    if dtype not in _NAMES or value.ndim > MOST_DIMENSIONS:
        raise TypeError(f"an array of dtype {value.dtype} and shape {value.shape}")
    items = [_NAMES[dtype], array_bytes(value.astype(dtype, copy=False)), *value.shape]
    return _container(_ARRAY, items, depth)


_WAYS: dict[type, Callable[[Plain, int], Item]] = {
    str: lambda value, _: _of_text(value),
    int: lambda value, _: _of_int(value),
    float: lambda value, _: float(value),
    dict: lambda value, depth: _container(_DICT, [one for pair in value.items() for one in pair], depth),
    list: lambda value, depth: _container(_LIST, list(value), depth),
    tuple: lambda value, depth: _container(_TUPLE, list(value), depth),
    bytes: lambda value, _: _extension()(_BYTES, bytes(value)),
    set: _of_set,
    frozenset: _of_set,
    np.ndarray: _of_array,
    **dict.fromkeys((np.bool_, np.integer, np.float16, np.float32), lambda value, depth: _written(value.item(), depth)),
}


# -- plain values from bytes ------------------------------------------------------------------------------------


def from_bytes(data: bytes) -> Plain:
    """Return the value that was written, where it is all that a file has.

    Raises:
        BadFile: no writer makes this.
    """
    return Decoder(Allowance(len(data), "A value")).value(data)


def cost_of(data: bytes) -> int:
    """Return what a decoder charges for a value that was written, in bytes of memory."""
    return _OF_BYTE * len(data) + _cost_within(data)


def _cost_within(data: bytes) -> int:
    """Return what is charged for the containers among the items of a MessagePack array, and for what is in them."""
    # NOTE: arrays of numbers are most of what agents sense; to open them took ten times as long (benchmarks).
    if len(data.translate(None, _EXTENSION_HEADS)) == len(data):
        return 0  # NOTE: a hundredth of the time for the names of a large team (benchmarks: teams, recorded)
    extension, cost = _extension(), 0
    for item in _flat().decode(data):
        if type(item) is extension and item.code not in _PLAIN_CODES:
            inner = bytes(item.data)
            cost += _cost_of_container(inner) + (0 if item.code == _ARRAY else _cost_within(inner))
    return cost


def _cost_of_container(data: bytes) -> int:
    """Return what is charged for a container with these bytes, but not for those in it."""
    return _OF_CONTAINER + _OF_ITEM * _count_of(data) + len(data)


def most_cost_of(data: bytes) -> int:
    """Return at most how much memory values take that were written, in a hundredth of the time."""
    containers = len(data) - len(data.translate(None, _EXTENSION_HEADS))
    return (_OF_ITEM + _OF_BYTE + MOST_DEPTH) * len(data) + _OF_CONTAINER * containers


class Decoder:
    """Decodes the values of one file, which may take time and memory in proportion to its size.

    Args:
        allowance: what all of them together may take.

    Attributes:
        most_bytes: of values at one place.
        keys: those of the file that were read before.
    """

    def __init__(self, allowance: Allowance) -> None:
        self.allowance, self.keys = allowance, Keys()
        self.most_bytes = allowance.total // _OF_BYTE

    def value(self, data: bytes, *, is_new: bool = True) -> Plain:
        """Return the value that was written.

        Args:
            data: its bytes.
            is_new: whether it is charged to the file; what is read again is not.

        Raises:
            BadFile: no writer makes this, or the file has too much of it.
        """
        self.allowance.begin()
        charge = self.allowance.charge if is_new else lambda _: None
        charge(_OF_BYTE * len(data))
        if data[:1] != _ONE:
            raise BadFile("a value does not begin like one")
        try:
            (one,) = _flat().decode(data)
            return self._opened(one, MOST_DEPTH, charge)
        except BadFile:
            raise
        except (ValueError, TypeError, OverflowError, KeyError) as error:
            raise BadFile(f"a value is damaged ({reason(error)})") from error

    def _opened(self, item: Item, depth: int, charge: Callable[[int], None]) -> Plain:
        """Return what a scalar or an extension says."""
        if not isinstance(item, _extension()):
            return item
        code, data = item.code, bytes(item.data)
        if code == _BYTES:
            return data
        if code == _TEXT:
            return data.decode("utf-8", "surrogatepass")
        if code == _INT:
            return self.keys.check(int.from_bytes(data, "big", signed=True))
        if depth < 1:
            raise BadFile(f"more than {MOST_DEPTH} containers are in each other")
        make = _MAKERS[code]
        charge(_cost_of_container(data))
        items: list[Plain] = [*_flat().decode(data)]
        if not _SCALARS.issuperset(map(type, items)):
            for place, one in enumerate(items):
                if type(one) not in _SCALARS:
                    items[place] = self._opened(one, depth - 1, charge)
        return make(items, self.keys)


@cache
def _flat() -> "MessagePackDecoder[list[Item]]":
    """Return a decoder that refuses containers but extensions, which it does not open."""
    from msgspec.msgpack import Decoder, Ext

    return Decoder(list[bool | int | float | str | Ext | None])


def _count_of(data: bytes) -> int:
    """Return how many items a MessagePack array says it has, at most as many as there are bytes."""
    head = data[0] if data else 0
    count = int.from_bytes(data[1:5] if head == 0xDD else data[1:3], "big") if head >= 0xDC else head & 15
    return min(count, len(data))


def _dict_of(items: list[Plain], keys: Keys) -> dict[Plain, Plain]:
    names = items[::2]
    found = dict(zip(names if {str}.issuperset(map(type, names)) else map(keys.check, names), items[1::2], strict=True))
    if len(found) != len(names):
        raise BadFile("a dict has a key that is there twice")
    return found


def _array_from(items: list[Plain], _: Keys) -> Array:
    name, data, *shape = items
    if len(shape) > MOST_DIMENSIONS or not all(type(length) is int and 0 <= length < 1 << 40 for length in shape):
        raise BadFile(f"an array has the impossible shape {shown(shape)}")
    if type(data) is not bytes:
        raise BadFile("an array has no bytes")
    flat = array_of(data, DTYPES[name])
    if prod(shape) != len(flat):
        raise BadFile(f"an array has {len(data)} bytes, which do not fit its shape {shown(shape)}")
    return flat.reshape(shape)


_MAKERS: dict[int, Callable[[list[Plain], Keys], Plain]] = {
    _TUPLE: lambda items, keys: keys.check(tuple(items)),
    _LIST: lambda items, _: items,
    _DICT: _dict_of,
    _SET: lambda items, keys: set(map(keys.check, items)),
    _FROZENSET: lambda items, keys: keys.check(frozenset(map(keys.check, items))),
    _ARRAY: _array_from,
}
