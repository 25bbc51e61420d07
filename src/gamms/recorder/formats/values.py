"""Plain values as CBOR, and back: the only file of the recorder that knows cbor2, which is loaded when it is needed.

CBOR has no tuples, arrays of numbers, integers beyond 64 bits, text that is not Unicode or sets, or only as tags, of
which some run code. Those are arrays here that begin with a simple value, 0 to 6; tags are refused. What comes from
a file is checked before cbor2 sees it: well-formed, nothing longer than the bytes that are there, at most `MOST_DEPTH`
deep. What it takes in memory is estimated in the same pass, and charged to the allowance of the file.
"""

import sys
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from gamms.errors import BadFile, BadType, BadValue
from gamms.limits import Allowance, Keys
from gamms.recorder.formats import columns
from gamms.recorder.formats.numbered import FEWEST, numbered, texts_of
from gamms.recorder.formats.plain_cbor import Damaged, PlainReader
from gamms.text import reason, shown

MOST_DEPTH = 32  # containers in each other
_FEW_KEYS = 16  # containers among the keys of one value, which may all have one hash and take no time
_MOST_DIMENSIONS = 8
_SMALL = 256  # bytes of an array in which differences are not worth a look
_SAMPLE = 1 << 14  # bytes that show whether differences fit an array

# Bytes of memory, copies that are made of a state included.
_OF_ITEM = 48
_OF_CONTAINER = 160
_OF_TEXT_BYTE = 4
_OF_BYTE = 16  # one of nine that may be a text of 80 letters
_CONTAINERS = bytes(range(0x80, 0xC0))  # bytes with which arrays and maps begin

_PLAINLY, _MARKED, _CAREFUL = range(1, 4)  # forms: as cbor2 gives them; with marks; with keys that may do harm
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
            f"{where} cannot be recorded: {reason(error)}. Only None, bool, int, float, str, bytes, list, tuple, set, "
            f"dict and NumPy arrays of numbers can; convert it first."
        ) from None
    except RecursionError:
        raise BadValue(f"{where} cannot be recorded: more than {MOST_DEPTH} containers are in each other.") from None
    return data


def from_bytes(data: bytes) -> Any:
    """The value that was written, where it is all that a file has.

    Raises:
        BadFile: no writer makes this.
    """
    return Decoder(Allowance(len(data), "A value")).value(data)


class Decoder:
    """Decodes the values of one file, which may take time and memory in proportion to its size.

    Args:
        allowance: what all of them together may take; what is read again is not charged again.

    Attributes:
        most_bytes: of values at one place.
    """

    def __init__(self, allowance: Allowance) -> None:
        self.allowance, self.keys = allowance, Keys()
        self.most_bytes = allowance.total // _OF_TEXT_BYTE
        self._forms: dict[object, bytearray] = {}

    def value(self, data: bytes, place: object = None) -> Any:
        """The value that was written, the only one at its place in the file.

        Raises:
            BadFile: no writer makes this.
        """
        return Values(data, np.array([0, len(data)]), self, place)[0]

    def forms(self, place: object, size: int) -> bytearray:
        """What is known of the values at a place in the file: 0 of those that were not read yet."""
        return bytearray(size) if place is None else self._forms.setdefault(place, bytearray(size))

    def check(self, data: bytes) -> int:
        """The form of a value that was not read yet.

        Raises:
            BadFile: no writer makes this, or the file has too much of it.
        """
        has_marks, keys, cost = _check(data, self.allowance)
        self.allowance.charge(cost)
        return _CAREFUL if keys > _FEW_KEYS else _MARKED if has_marks else _PLAINLY

    def decoded(self, data: bytes, form: int) -> Any:
        """A value that was checked.

        Raises:
            BadFile: no writer makes this.
        """
        cbor2 = _cbor2()
        try:
            if form == _CAREFUL:
                return _CarefulReader(data, keys=self.keys).item()
            value = cbor2.loads(data)
            return _unmarked(value, self.keys) if form == _MARKED else value
        except (cbor2.CBORDecodeError, Damaged, ValueError, TypeError, OverflowError, KeyError) as error:
            raise BadFile(f"a value is damaged ({reason(error)})") from error


class Values:
    """The values at one place in a file, each decoded when it is asked for.

    Args:
        data: one behind the other.
        ends: (values + 1,), where each ends, after a 0.
        decoder: of the file.
        place: where they are in it.
    """

    __slots__ = ("_data", "_decoder", "_ends", "_forms")

    def __init__(self, data: bytes, ends: columns.IntArray, decoder: Decoder, place: object) -> None:
        self._data, self._ends, self._decoder = data, ends, decoder
        self._forms = decoder.forms(place, len(ends) - 1)

    def __getitem__(self, number: int) -> Any:
        """One of them.

        Raises:
            BadFile: no writer makes this.
        """
        data = self._data[self._ends[number] : self._ends[number + 1]]
        form = self._forms[number]
        if not form:
            form = self._forms[number] = self._decoder.check(data)
        return self._decoder.decoded(data, form)


def cost_of(data: bytes) -> int:
    """How much memory a value takes that was written, in bytes."""
    return _check(data, _UNBOUNDED)[2]


def most_cost_of(data: bytes) -> int:
    """At most how much memory values take that were written, in a hundredth of the time."""
    return _OF_ITEM * len(data) + _OF_CONTAINER * (len(data) - len(data.translate(None, _CONTAINERS)))


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
    if len(value) >= FEWEST and depth and (texts := numbered(value)) is not None:
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
    """Reads what was checked, in ten times the time of cbor2, but looks at keys before they are put into dicts."""

    most_items = most_bytes = sys.maxsize  # as many as there are

    def array(self, info: int, depth: int) -> Any:
        """A list, or what its mark says."""
        items = super().array(info, depth)
        return _meaning(items, self._keys) if items and type(items[0]) is type(_mark(0)) else items

    def mark(self, info: int, depth: int) -> Any:
        """A mark, or what else is neither text nor container."""
        return _mark(info) if info <= _NUMBERED else self.simple(info, depth)


_CarefulReader.readers = [*PlainReader.readers[:-1], _CarefulReader.mark]
_CarefulReader.readers[4] = _CarefulReader.array


def _check(data: bytes, allowance: Allowance) -> tuple[bool, int, int]:  # noqa: C901, PLR0912, PLR0915  NOTE: one loop; calls would double its time
    """Refuse what cbor2 should not see.

    Returns:
        Whether there are marks in it, how many keys are containers, and about how many bytes of memory it takes.
    """
    at, end, has_marks, keys, cost = 0, len(data), False, 0, _OF_ITEM
    left, is_map, is_in_key = 1, False, False  # of the container that we are in
    outer: list[tuple[int, bool, bool]] = []
    while True:
        while not left:
            if not outer:
                if at != end:
                    raise BadFile(f"{end - at} bytes are left over behind a value")
                return has_marks, keys, cost
            left, is_map, is_in_key = outer.pop()
        if at >= end:
            raise BadFile("a value is cut off")
        start, major, size = at, data[at] >> 5, data[at] & 31
        at, left = at + 1, left - 1
        if size > 23:
            if size > 27:
                raise BadFile(f"a value has a length without end or meaning, {at - 1} bytes from its start")
            width = 1 << (size - 24)
            size = int.from_bytes(data[at : at + width], "big")
            at += width
        if major in {2, 3}:
            at += size
            cost += size * (_OF_BYTE if major == 2 else _OF_TEXT_BYTE)
        elif major in {4, 5}:
            if size > end - at or len(outer) >= MOST_DEPTH:
                raise BadFile(f"a container of {size} items is too long or too deep, {start} bytes into its value")
            outer.append((left, is_map, is_in_key))
            is_in_key = is_in_key or (is_map and left & 1 == 1)
            keys += is_in_key
            if major == 5 and is_in_key:
                raise BadFile("a dict is in the key of a dict")
            left, is_map = size << (major == 5), major == 5
            cost += _OF_CONTAINER + left * _OF_ITEM
            if cost > allowance.left:
                allowance.charge(cost)
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


def _unmarked(value: Any, keys: Keys) -> Any:
    kind = type(value)
    if kind is list or kind is tuple:
        if value and type(value[0]) not in _PLAIN:
            return _meaning([value[0], *(_unmarked(one, keys) for one in value[1:])], keys)
        if _SCALARS.issuperset(map(type, value)):
            return value
        return kind(_unmarked(one, keys) for one in value)
    if kind is dict:
        return {_unmarked(key, keys): _unmarked(one, keys) for key, one in value.items()}
    if kind not in _PLAIN:
        raise BadFile("a mark stands where none may stand")
    return value


_SCALARS = {type(None), bool, int, float, str, bytes}
_PLAIN = _SCALARS | {list, tuple, dict}  # what else comes out of cbor2 is a mark


def _meaning(items: list[Any], keys: Keys) -> Any:
    """What an array means that begins with a mark."""
    mark, *rest = items
    return keys.check(_MEANINGS[mark.value](rest))


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
    stems, which, numbers = items
    return texts_of(stems, _is(np.ndarray, which), _is(np.ndarray, numbers))


def _is(kind: type, value: Any) -> Any:
    if type(value) is not kind:
        raise BadFile(f"a value is damaged: {shown(value)} is not of type {kind.__name__}")
    return value


_MEANINGS: dict[int, Callable[[Any], Any]] = {
    _TUPLE: tuple,
    _ARRAY: _array,
    _BIG: _big,
    _TEXT: _text,
    _SET: set,
    _FROZENSET: frozenset,
    _NUMBERED: _texts,
}
_UNBOUNDED = Allowance(1 << 60, "A value", is_streamed=True)
