"""Plain values as CBOR, and back: the only file of the recorder that knows cbor2, which is loaded when it is needed.

CBOR has no tuples, arrays of numbers, integers beyond 64 bits, text that is not Unicode or sets, or only as tags, of
which some run code. Those are arrays here that begin with a simple value, 0 to 6; tags are refused. What comes from
a file is checked before cbor2 sees it: well-formed, nothing longer than the bytes that are there, at most `MOST_DEPTH`
deep.
"""

import sys
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from gamms.errors import BadFile, BadType, BadValue
from gamms.recorder.formats import columns
from gamms.recorder.formats.numbered import FEWEST, MOST, numbered, texts_of
from gamms.recorder.formats.plain_cbor import Damaged, PlainReader, refuse_alike
from gamms.text import shown

_FEW_KEYS = 1 << 9  # that may all have the same hash and take no time
MOST_DEPTH = 32  # containers in each other
MOST_ITEMS = 1 << 22  # in one value, containers included
_MOST_DIMENSIONS = 8
_SMALL = 256  # bytes of an array in which differences are not worth a look
_SAMPLE = 1 << 14  # bytes that show whether differences fit an array

_TUPLE, _ARRAY, _BIG, _TEXT, _SET, _FROZENSET, _NUMBERED = range(7)
_LAST_MARK = 0xE0 + _NUMBERED
_BIGGEST = 1 << 64
_AS_IS = {type(None), bool, float, bytes}
_DTYPES = {
    name: np.dtype(name)
    for name in (
        *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
        *("float16", "float32", "float64"),
    )
}
_NAMES = {dtype: name for name, dtype in _DTYPES.items()}  # NOTE: NumPy takes 8 us to say a dtype's own name


def to_bytes(value: Any, where: str) -> bytes:
    """A plain value as bytes, the same bytes for the same value.

    Raises:
        BadType: something in it is not plain.
        BadValue: it is too deep or has too many items.
    """
    try:
        data: bytes = _cbor2().dumps(_marked(value, MOST_DEPTH))
    except TypeError as error:
        raise BadType(
            f"{where} cannot be recorded: {error}. Only None, bool, int, float, str, bytes, list, tuple, set, "
            f"dict and NumPy arrays of numbers can; convert it first."
        ) from None
    except RecursionError:
        raise BadValue(f"{where} cannot be recorded: more than {MOST_DEPTH} containers are in each other.") from None
    if len(data) > MOST_ITEMS:
        try:
            _check(data)
        except BadFile as error:
            raise BadValue(f"{where} cannot be recorded: {error}. Use NumPy arrays for long lists.") from None
    return data


def from_bytes(data: bytes) -> Any:
    """The value that was written.

    Raises:
        BadFile: nobody wrote this.
    """
    has_marks, keys = _check(data)
    cbor2 = _cbor2()
    try:
        value = cbor2.loads(data) if keys <= _FEW_KEYS else _CarefulReader(data).item()
        return _unmarked(value) if has_marks else value
    except (cbor2.CBORDecodeError, Damaged, ValueError, TypeError, OverflowError, KeyError) as error:
        raise BadFile(f"a value is damaged ({error})") from error


# -- to CBOR ----------------------------------------------------------------------------------------------------


@cache
def _cbor2() -> ModuleType:
    import cbor2

    return cbor2


def _mark(number: int) -> Any:
    return _cbor2().CBORSimpleValue(number)


def _marked(value: Any, depth: int) -> Any:
    """What cbor2 is given for a value, in which as many containers may be in each other as `depth` says."""
    kind = type(value)
    if kind in _AS_IS or (kind is str and value.isascii()) or (kind is int and -_BIGGEST <= value < _BIGGEST):
        return value
    way = _WAYS.get(kind) or next((way for kind, way in _WAYS.items() if isinstance(value, kind)), None)
    if way is None:
        raise TypeError(f"{shown(value)} is of type {kind.__name__}")
    return way(value, depth)


def _inside(depth: int) -> int:
    if depth < 1:
        raise RecursionError
    return depth - 1


def _of_int(value: int, depth: int) -> Any:
    value = int(value)
    if -_BIGGEST <= value < _BIGGEST:
        return value
    _inside(depth)
    return [_mark(_BIG), value.to_bytes(value.bit_length() // 8 + 1, "big", signed=True)]


def _of_text(value: str, depth: int) -> Any:
    value = str.__str__(value)  # of an enum, too
    try:
        value.encode()
    except UnicodeEncodeError:
        _inside(depth)
        return [_mark(_TEXT), value.encode("utf-8", "surrogatepass")]
    return value


def _of_tuple(value: tuple[Any, ...], depth: int) -> Any:
    depth = _inside(depth)
    return [_mark(_TUPLE), *(_marked(one, depth) for one in value)]


def _of_list(value: list[Any], depth: int) -> Any:
    depth = _inside(depth)
    if FEWEST <= len(value) <= MOST and depth and (texts := numbered(value)) is not None:
        return [_mark(_NUMBERED), texts.stems, _of_array(texts.which, depth), _of_array(texts.numbers, depth)]
    kinds = set(map(type, value))
    if kinds <= _AS_IS or (kinds == {str} and all(map(str.isascii, value))):
        return value
    return [_marked(one, depth) for one in value]


def _of_dict(value: dict[Any, Any], depth: int) -> Any:
    depth = _inside(depth)
    if not value:
        return {}
    return {_key(_marked(key, depth)): _marked(one, depth) for key, one in value.items()}


def _key(value: Any) -> Any:
    return tuple(_key(one) for one in value) if isinstance(value, list) else value


def _of_array(value: np.ndarray[Any, Any], depth: int) -> Any:
    _inside(depth)
    dtype = value.dtype.newbyteorder("=")
    if dtype not in _NAMES or value.ndim > _MOST_DIMENSIONS:
        raise TypeError(f"an array of dtype {value.dtype} and shape {value.shape}")
    flat = np.ascontiguousarray(value).reshape(-1).astype(dtype, copy=False)
    planes, is_stepped = columns.planes_of(flat), False
    if dtype.kind in "iu" and flat.nbytes > _SMALL:
        steps = columns.planes_of(np.diff(flat, prepend=dtype.type(0)))
        is_stepped = len(columns.packed(steps[:_SAMPLE])) < len(columns.packed(planes[:_SAMPLE]))
        planes = steps if is_stepped else planes
    return [_mark(_ARRAY), _NAMES[dtype], is_stepped, planes, *value.shape]


def _of_set(value: set[Any] | frozenset[Any], depth: int) -> Any:
    depth = _inside(depth)
    keys = [_key(_marked(one, depth)) for one in value]
    mark = _mark(_FROZENSET if isinstance(value, frozenset) else _SET)
    return [mark, *sorted(keys, key=_cbor2().dumps)]  # a set has no order of its own, and a file has


def _of_number(value: Any, depth: int) -> Any:
    return _marked(value.item(), depth)


_WAYS: dict[type, Callable[[Any, int], Any]] = {
    str: _of_text,
    int: _of_int,
    float: lambda value, _: float(value),
    dict: _of_dict,
    list: _of_list,
    tuple: _of_tuple,
    bytes: lambda value, _: bytes(value),
    set: _of_set,
    frozenset: _of_set,
    np.ndarray: _of_array,
    np.bool_: _of_number,
    np.integer: _of_number,
    np.float16: _of_number,
    np.float32: _of_number,
}


# -- from CBOR --------------------------------------------------------------------------------------------------


class _CarefulReader(PlainReader):
    """Reads what was checked as cbor2 does, in ten times the time, but refuses keys that were made to harm."""

    def mark(self, info: int, depth: int) -> Any:
        """A mark, or what else is neither text nor container."""
        return _mark(info) if info <= _NUMBERED else self.simple(info, depth)


_CarefulReader.readers = [*PlainReader.readers[:-1], _CarefulReader.mark]
_CarefulReader.most_items, _CarefulReader.most_bytes = MOST_ITEMS, sys.maxsize  # as many bytes as there are


def _check(data: bytes) -> tuple[bool, int]:  # noqa: C901, PLR0912, PLR0915  NOTE: one loop; calls would double its time
    """Refuse what cbor2 should not see; whether there are marks in it, and how many keys are containers."""
    at, end, items, has_marks, keys = 0, len(data), 0, False, 0
    left, is_map, is_in_key = 1, False, False  # of the container that we are in
    outer: list[tuple[int, bool, bool]] = []
    while True:
        while not left:
            if not outer:
                if at != end:
                    raise BadFile(f"{end - at} bytes are left over behind a value")
                return has_marks, keys
            left, is_map, is_in_key = outer.pop()
        if at >= end:
            raise BadFile("a value is cut off")
        start, major, size = at, data[at] >> 5, data[at] & 31
        at, items, left = at + 1, items + 1, left - 1
        if items > MOST_ITEMS:
            raise BadFile(f"a value has more than {MOST_ITEMS} items")
        if size > 23:
            if size > 27:
                raise BadFile(f"a value has a length without end or meaning, {at - 1} bytes from its start")
            width = 1 << (size - 24)
            size = int.from_bytes(data[at : at + width], "big")
            at += width
        if major in {2, 3}:
            at += size
        elif major in {4, 5}:
            if size > min(end - at, MOST_ITEMS) or len(outer) >= MOST_DEPTH:
                raise BadFile(f"a container of {size} items is too long or too deep, {start} bytes into its value")
            outer.append((left, is_map, is_in_key))
            is_in_key = is_in_key or (is_map and left & 1 == 1)
            keys += is_in_key
            if major == 5 and is_in_key:
                raise BadFile("a dict is in the key of a dict")
            left, is_map = size << (major == 5), major == 5
        elif major == 6:
            raise BadFile(f"a value has the tag {size}, and tags are not read, {start} bytes from its start")
        elif major == 7:
            head = data[start]
            if head <= _LAST_MARK:
                has_marks = True
            elif not (0xF4 <= head <= 0xF6 or 0xF9 <= head <= 0xFB):
                raise BadFile(f"a value has the unknown byte {head}, {start} bytes from its start")
        if at > end:
            raise BadFile(f"a value is cut off, {start} bytes from its start")


def _unmarked(value: Any) -> Any:
    kind = type(value)
    if kind is list or kind is tuple:
        if value and type(value[0]) not in _PLAIN:
            return _MEANINGS[value[0].value](value[1:])
        return kind(_unmarked(one) for one in value)
    if kind is dict:
        return _dict([_unmarked(key) for key in value], [_unmarked(one) for one in value.values()])
    if kind not in _PLAIN:
        raise BadFile("a mark stands where none may stand")
    return value


_PLAIN = {type(None), bool, int, float, str, bytes, list, tuple, dict}  # what else comes out of cbor2 is a mark


def _dict(keys: list[Any], values: list[Any]) -> dict[Any, Any]:
    if len(keys) > _FEW_KEYS:
        refuse_alike(keys)
    return dict(zip(keys, values, strict=True))


def _tuple(items: Any) -> Any:
    return tuple(_unmarked(one) for one in items)


def _big(items: Any) -> int:
    (data,) = items
    return int.from_bytes(_is(bytes, data), "big", signed=True)


def _text(items: Any) -> str:
    (data,) = items
    text: str = _is(bytes, data).decode("utf-8", "surrogatepass")
    return text


def _array(items: Any) -> np.ndarray[Any, Any]:
    name, is_stepped, planes, *shape = items
    dtype, size = _DTYPES[_is(str, name)], 1
    for length in shape:
        size *= _is(int, length)
    if len(shape) > _MOST_DIMENSIONS or not all(0 <= length < 1 << 40 for length in shape):
        raise BadFile(f"an array has the impossible shape {shown(shape)}")
    if len(_is(bytes, planes)) != size * dtype.itemsize:
        raise BadFile(f"an array has {len(planes)} bytes, which do not fit its shape {shown(shape)}")
    flat = np.frombuffer(planes, np.uint8) != 0 if dtype.kind == "b" else columns.from_planes(planes, dtype)
    if _is(bool, is_stepped):
        flat = np.cumsum(flat, dtype=dtype)
    array: np.ndarray[Any, Any] = flat.reshape(shape)
    return array


def _texts(items: Any) -> list[str]:
    stems, *pair = items
    which, numbers = (_is(np.ndarray, _unmarked(column)) for column in pair)
    return texts_of(stems, which, numbers)


def _set(items: Any) -> set[Any]:
    keys = [_unmarked(_key(one)) for one in items]
    if len(keys) > _FEW_KEYS:
        refuse_alike(keys)
    return set(keys)


def _frozenset(items: Any) -> frozenset[Any]:
    return frozenset(_set(items))


def _is(kind: type, value: Any) -> Any:
    if type(value) is not kind:
        raise BadFile(f"a value is damaged: {shown(value)} is not of type {kind.__name__}")
    return value


_MEANINGS: dict[int, Callable[[Any], Any]] = {
    _TUPLE: _tuple,
    _ARRAY: _array,
    _BIG: _big,
    _TEXT: _text,
    _SET: _set,
    _FROZENSET: _frozenset,
    _NUMBERED: _texts,
}
