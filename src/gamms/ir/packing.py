"""Encoding of plain values as bytes: MessagePack with extension types, packed by `packed_bytes.py`.

Each container in a value is an extension whose content is one flat array of scalars and further extensions. So the
library decodes one level at a time: depth, memory and keys are checked before the next level is created. Equal values
give equal bytes. docs/recording-format.md describes the format byte by byte.
"""

from collections.abc import Callable, Sequence
from functools import cache
from itertools import chain
from math import prod
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from gamms.errors import BadFile, BadType, BadValue
from gamms.ir.packed_bytes import BEST, compute_differences, pack_bytes, unpack_bytes
from gamms.limits import PER_BYTE, KeyBudget, MemoryBudget
from gamms.plain import LEVELS_OF_SET, MOST_DIMENSIONS, Plain
from gamms.text import reason, shown

if TYPE_CHECKING:
    from msgspec.msgpack import Decoder as MessagePackDecoder
    from msgspec.msgpack import Encoder as MessagePackEncoder
    from msgspec.msgpack import Ext

Array = npt.NDArray[Any]
"""An array of any numbers."""

Item: TypeAlias = "bool | int | float | str | Ext | None"
"""MessagePack's form of a value: a scalar, or an unopened extension."""

MOST_DEPTH = 32  # nested containers; a set counts as `LEVELS_OF_SET`
DTYPES = {
    name: np.dtype(name)
    for name in (
        *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
        *("float16", "float32", "float64"),
    )
}

_NAMES = {dtype: name for name, dtype in DTYPES.items()}  # NOTE: NumPy takes 8 us to return the name of a dtype
_TUPLE, _LIST, _DICT, _SET, _FROZENSET, _BYTES, _INT, _TEXT, _ARRAY = range(9)  # codes of extensions
_PLAIN_CODES = frozenset({_BYTES, _INT, _TEXT})  # types without containers
_EXTENSION_HEADS = bytes((*range(0xC7, 0xCA), *range(0xD4, 0xD9)))
_ONE = b"\x91"  # the head of an array with one item, which contains a value
_SCALARS = frozenset({type(None), bool, int, float, str})

# Bytes of memory, including the copies of a state.
_OF_ITEM = 48
_OF_CONTAINER = 160
_OF_BYTE = 4  # a character of a text takes this much if the text has an emoji

# -- bodies -----------------------------------------------------------------------------------------------------


def pack(value: Plain, where: str, level: int = BEST) -> bytes:
    """Return a plain value as packed bytes.

    Args:
        value: the value.
        where: name of the value, for error messages.
        level: zlib level.

    Raises:
        BadType, BadValue: a part of the value is not plain.
    """
    return pack_parts([to_bytes(value, where)], level=level)


def unpack(body: bytes, decoder: "Decoder", *, is_new: bool = True) -> Plain:
    """Unpack the value of `pack`.

    Args:
        body: the packed bytes.
        decoder: decoder of the file.
        is_new: whether the memory of the value is charged to the file; not for repeated reads.

    Raises:
        BadFile: the bytes are damaged, or the memory limit of the file is exceeded.
    """
    return decoder.decode(unpack_parts(body, decoder.most_bytes)[0], is_new=is_new)


def pack_parts(values: Sequence[bytes], columns: Sequence[bytes] = (), cost: int = 0, level: int = BEST) -> bytes:
    """Return values, followed by columns, as packed bytes for `unpack_parts`.

    Args:
        values: the bytes of plain values.
        columns: the bytes of columns.
        cost: memory of the columns in bytes.
        level: zlib level.
    """
    data = b"".join(values)
    others = b"".join(columns)
    body = pack_bytes(data, level)
    if columns:
        body += pack_bytes(others, level)
    cost = max(cost, _OF_BYTE * (len(data) + len(others)))
    if PER_BYTE * len(body) < cost + bound_cost(data):
        cost += sum(map(compute_cost, values))
    return pad_bytes(body, cost)


def unpack_parts(body: bytes, most: int, *, has_columns: bool = False) -> tuple[bytes, bytes]:
    """Return the bytes of the values, and the bytes of the columns.

    Raises:
        BadFile: the bytes are damaged, or would decompress to more than `most` bytes.
    """
    values, rest = unpack_bytes(body, most)
    columns = b""
    if has_columns:
        columns, rest = unpack_bytes(rest, most)
    if rest.strip(b"\0"):
        raise BadFile(f"{len(rest)} bytes are left over")
    return values, columns


def pad_bytes(body: bytes, cost: int) -> bytes:
    """Return packed bytes, padded with zeros if readers would otherwise refuse their memory cost."""
    return body + bytes(max(0, -(-cost // PER_BYTE) - len(body)))


# -- arrays ----------------------------------------------------------------------------------------------------


def encode_array(array: Array) -> bytes:
    """Return the bytes of an array: the first byte of all items, then the second; integers as differences."""
    flat = np.ascontiguousarray(array).reshape(-1)
    if flat.dtype.kind in "iu":
        flat = compute_differences(flat)
    flat = flat.astype(flat.dtype.newbyteorder("<"), copy=False)
    return flat.view(np.uint8).reshape(-1, flat.dtype.itemsize).T.tobytes()


def decode_array(data: bytes, dtype: "np.dtype[Any]") -> Array:
    """Return the items (items,) encoded by `encode_array`.

    Raises:
        BadFile: bytes are missing.
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
    """Encode a plain value; equal values give equal bytes.

    Args:
        value: the value.
        where: name of the value, for error messages.
        depth: maximum depth of nested containers.

    Raises:
        BadType: a part of the value is not plain.
        BadValue: the value is nested too deeply.
    """
    try:
        return _make_encoder().encode([_write_value(value, depth)])
    except TypeError as error:
        raise BadType(
            f"{where} cannot be recorded: {reason(error)}. Only None, bool, int, float, str, bytes, list, tuple, set, "
            f"dict and NumPy arrays of numbers can be recorded; convert it first."
        ) from None
    except RecursionError:
        raise BadValue(f"{where} cannot be recorded: containers are nested more than {MOST_DEPTH} deep.") from None


@cache
def _make_encoder() -> "MessagePackEncoder":
    from msgspec.msgpack import Encoder

    return Encoder()


@cache
def _import_extension() -> "type[Ext]":
    from msgspec.msgpack import Ext

    return Ext


def _write_value(value: Plain, depth: int) -> Item:
    """Return the scalar or the extension for a value with at most `depth` nested containers."""
    kind = type(value)
    if kind is int:
        return _write_int(value)
    scalar: Item = value
    if kind in _SCALARS and (kind is not str or value.isascii()):
        return scalar
    way = _WAYS.get(kind) or next((way for kind, way in _WAYS.items() if isinstance(value, kind)), None)
    if way is None:
        raise TypeError(f"{shown(value)} is of type {kind.__name__}")
    return way(value, depth)


def _write_container(code: int, items: list[Plain], depth: int) -> Item:
    """Return the extension of a container."""
    if depth < 1:
        raise RecursionError
    if _SCALARS.issuperset(map(type, items)):
        try:
            return _import_extension()(code, _make_encoder().encode(items))
        except (OverflowError, UnicodeEncodeError):
            pass  # a long integer, or an unpaired surrogate
    return _import_extension()(code, _make_encoder().encode([_write_value(one, depth - 1) for one in items]))


def _write_int(value: int) -> Item:
    value = int(value)
    if -(1 << 63) <= value < 1 << 64:
        return value
    return _import_extension()(_INT, value.to_bytes(value.bit_length() // 8 + 1, "big", signed=True))


def _write_text(value: str) -> Item:
    text = str.__str__(value)  # of an enum, too
    try:
        text.encode()
    except UnicodeEncodeError:
        return _import_extension()(_TEXT, text.encode("utf-8", "surrogatepass"))
    return text


def _write_set(value: set[Plain] | frozenset[Plain], depth: int) -> Item:
    if depth < 1:
        raise RecursionError
    encode = _make_encoder().encode
    items = [_write_value(one, depth - LEVELS_OF_SET) for one in value]
    items.sort(key=lambda item: encode([item]))  # because sets have no order
    return _import_extension()(_FROZENSET if isinstance(value, frozenset) else _SET, encode(items))


def _write_array(value: Array, depth: int) -> Item:
    dtype = value.dtype.newbyteorder("=")
    if dtype not in _NAMES or value.ndim > MOST_DIMENSIONS:
        raise TypeError(f"an array of dtype {value.dtype} and shape {value.shape}")
    items = [_NAMES[dtype], encode_array(value.astype(dtype, copy=False)), *value.shape]
    return _write_container(_ARRAY, items, depth)


_WAYS: dict[type, Callable[[Plain, int], Item]] = {
    str: lambda value, _: _write_text(value),
    int: lambda value, _: _write_int(value),
    float: lambda value, _: float(value),
    dict: lambda value, depth: _write_container(_DICT, list(chain.from_iterable(value.items())), depth),
    list: lambda value, depth: _write_container(_LIST, list(value), depth),
    tuple: lambda value, depth: _write_container(_TUPLE, list(value), depth),
    bytes: lambda value, _: _import_extension()(_BYTES, bytes(value)),
    set: _write_set,
    frozenset: _write_set,
    np.ndarray: _write_array,
    **dict.fromkeys(
        (np.bool_, np.integer, np.float16, np.float32), lambda value, depth: _write_value(value.item(), depth)
    ),
}


# -- plain values from bytes ------------------------------------------------------------------------------------


def from_bytes(data: bytes) -> Plain:
    """Decode a value that makes up a whole file.

    Raises:
        BadFile: the bytes are invalid.
    """
    return Decoder(MemoryBudget(len(data), "A value")).decode(data)


def compute_cost(data: bytes) -> int:
    """Return the memory cost of an encoded value, in bytes, as charged by a decoder."""
    return _OF_BYTE * len(data) + _find_cost_within(data)


def _find_cost_within(data: bytes) -> int:
    """Return the memory cost of the containers among the items of a MessagePack array, including their contents."""
    # NOTE: arrays of numbers are most of the sensor data; opening them would take ten times as long (benchmarks).
    if len(data.translate(None, _EXTENSION_HEADS)) == len(data):
        return 0  # NOTE: a hundredth of the time for the names of a large team (benchmarks: teams, recorded)
    extension = _import_extension()
    cost = 0
    for item in _make_flat_decoder().decode(data):
        if type(item) is extension and item.code not in _PLAIN_CODES:
            inner = bytes(item.data)
            cost += _find_cost_of_container(inner) + (0 if item.code == _ARRAY else _find_cost_within(inner))
    return cost


def _find_cost_of_container(data: bytes) -> int:
    """Return the memory cost of a container, without nested containers."""
    return _OF_CONTAINER + _OF_ITEM * _read_count(data) + len(data)


def bound_cost(data: bytes) -> int:
    """Return an upper bound of the memory cost of encoded values, in a hundredth of the time."""
    containers = len(data) - len(data.translate(None, _EXTENSION_HEADS))
    return (_OF_ITEM + _OF_BYTE + MOST_DEPTH) * len(data) + _OF_CONTAINER * containers


class Decoder:
    """Decodes the values of one file, within time and memory proportional to its size.

    Args:
        allowance: memory limit for all values together.

    Attributes:
        most_bytes: memory limit for the values of one block.
        keys: dict keys read before in this file.
    """

    def __init__(self, allowance: MemoryBudget) -> None:
        self.allowance = allowance
        self.keys = KeyBudget()
        self.most_bytes = allowance.total // _OF_BYTE

    def decode(self, data: bytes, *, is_new: bool = True) -> Plain:
        """Decode a value.

        Args:
            data: its bytes.
            is_new: whether its memory is charged to the file; not for repeated reads.

        Raises:
            BadFile: the bytes are invalid, or the memory limit of the file is exceeded.
        """
        self.allowance.begin()
        charge = self.allowance.charge if is_new else lambda _: None
        charge(_OF_BYTE * len(data))
        if data[:1] != _ONE:
            raise BadFile("a value has an invalid beginning")
        try:
            (one,) = _make_flat_decoder().decode(data)
            return self._open_item(one, MOST_DEPTH, charge)
        except BadFile:
            raise
        except (ValueError, TypeError, OverflowError, KeyError) as error:
            raise BadFile(f"a value is damaged ({reason(error)})") from error

    def _open_item(self, item: Item, depth: int, charge: Callable[[int], None]) -> Plain:
        """Return the value of a scalar or an extension."""
        if not isinstance(item, _import_extension()):
            return item
        code = item.code
        data = bytes(item.data)
        if code == _BYTES:
            return data
        if code == _TEXT:
            return data.decode("utf-8", "surrogatepass")
        if code == _INT:
            number = int.from_bytes(data, "big", signed=True)
            self.keys.check(number, data)
            return number
        if depth < 1:
            raise BadFile(f"containers are nested more than {MOST_DEPTH} levels deep")
        make = _MAKERS[code]
        inner = LEVELS_OF_SET if code in (_SET, _FROZENSET) else 1
        charge(_find_cost_of_container(data))
        items: list[Plain] = [*_make_flat_decoder().decode(data)]
        if not _SCALARS.issuperset(map(type, items)):
            for place, one in enumerate(items):
                if type(one) not in _SCALARS:
                    items[place] = self._open_item(one, depth - inner, charge)
        value = make(items)
        self.keys.check(value, data)
        return value


@cache
def _make_flat_decoder() -> "MessagePackDecoder[list[Item]]":
    """Return a decoder that allows only extensions as containers, and does not open them."""
    from msgspec.msgpack import Decoder, Ext

    return Decoder(list[bool | int | float | str | Ext | None])


def _read_count(data: bytes) -> int:
    """Return the stated number of items of a MessagePack array, limited by the number of bytes."""
    head = data[0] if data else 0
    count = int.from_bytes(data[1:5] if head == 0xDD else data[1:3], "big") if head >= 0xDC else head & 15
    return min(count, len(data))


def _make_dict(items: list[Plain]) -> dict[Plain, Plain]:
    names = items[::2]
    found = dict(zip(names, items[1::2], strict=True))
    if len(found) != len(names):
        raise BadFile("a dict has the same key twice")
    return found


def _make_array(items: list[Plain]) -> Array:
    name, data, *shape = items
    if len(shape) > MOST_DIMENSIONS or not all(type(length) is int and 0 <= length < 1 << 40 for length in shape):
        raise BadFile(f"an array has the invalid shape {shown(shape)}")
    if type(data) is not bytes:
        raise BadFile("an array has no bytes")
    flat = decode_array(data, DTYPES[name])
    if prod(shape) != len(flat):
        raise BadFile(f"an array has {len(data)} bytes, which do not fit its shape {shown(shape)}")
    return flat.reshape(shape)


_MAKERS: dict[int, Callable[[list[Plain]], Plain]] = {
    _TUPLE: tuple,
    _LIST: list,
    _DICT: _make_dict,
    _SET: set,
    _FROZENSET: frozenset,
    _ARRAY: _make_array,
}
