"""What agents did, side by side for each of them: where one goes next resembles where it went before.

A track is what the entries of one agent hold, in their order; tracks stand in the order of the agents' numbers. Of each
track the first node stands apart, as the difference from that of the track before; the others are differences within
it. Moves are such tracks, and so are events whose data are but numbers: an agent's number, perhaps a node, and floats.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from gamms.errors import BadFile, BadType, BadValue
from gamms.ir import events as kinds
from gamms.recorder.formats import columns
from gamms.recorder.formats.columns import IntArray
from gamms.text import reason, shown

FloatArray = npt.NDArray[np.float64]

_ORDERS = (1, 2)  # how often differences of floats are taken


class Form(NamedTuple):
    """What an event whose data are numbers consists of, behind the number of an agent."""

    nodes: int
    floats: int


FORMS = {kinds.AERIAL_AGENT_FLIGHT: Form(1, 3), kinds.AERIAL_AGENT_TURN: Form(0, 4)}


class Layout:
    """Which entries are whose, worked out from the agent of each."""

    __slots__ = ("at", "is_first", "lengths", "order")

    def __init__(self, numbers: IntArray) -> None:
        self.order = _by_number(numbers)  # (entries,): track by track
        ordered = numbers[self.order]
        self.is_first = np.ones(len(numbers), np.bool_)
        self.is_first[1:] = ordered[1:] != ordered[:-1]
        self.at = np.flatnonzero(self.is_first)  # (tracks,): where each begins
        self.lengths = np.empty_like(self.at)
        self.lengths[:-1] = self.at[1:] - self.at[:-1]
        self.lengths[-1:] = len(numbers) - self.at[-1:]

    def split(self, column: IntArray) -> tuple[IntArray, IntArray]:
        """The first item of each track, and of all others how much they differ from the one before."""
        ordered = column[self.order]
        return ordered[self.is_first], steps(ordered)[~self.is_first]

    def joined(self, firsts: IntArray, others: IntArray) -> IntArray:
        """What `split` split."""
        column = np.empty(len(self.order), np.int64)
        column[self.order] = self.sums(firsts, others)
        return column

    def sums(self, firsts: IntArray | int, others: IntArray) -> IntArray:
        """The sums along each track, track by track."""
        parts = np.zeros(len(self.order), np.int64)
        parts[~self.is_first] = others
        sums = np.cumsum(parts)
        sums += np.repeat(firsts - sums[self.at], self.lengths)
        return sums


class Sequence:
    """Whose entries follow each other in a block, and what is worked out from that alone."""

    __slots__ = ("_column", "_numbers", "layout")

    def __init__(self, numbers: IntArray) -> None:
        self._numbers, self.layout = numbers.copy(), Layout(numbers)
        self._column: bytes | None = None

    def of(self, numbers: IntArray) -> "Sequence":
        """The one of these numbers: most blocks have the same as the one before."""
        # NOTE: which spares a third of the time of a block with ten agents (benchmarks/README.md, w4).
        return self if np.array_equal(numbers, self._numbers) else Sequence(numbers)

    def column(self) -> bytes:
        """The numbers, as differences from the one before."""
        if self._column is None:
            self._column = columns.put(steps(self._numbers))
        return self._column


def steps(numbers: IntArray) -> IntArray:
    """Differences from the number before, which wrap around at 64 bits."""
    differences = numbers.copy()
    differences[1:] -= numbers[:-1]
    return differences


def _by_number(numbers: IntArray) -> IntArray:
    if len(numbers) and int(numbers.min()) >= 0 and int(numbers.max()) < 1 << 16:
        return numbers.astype(np.uint16).argsort(kind="stable")  # NOTE: a radix sort, 5 times as fast on unordered rows
    return numbers.argsort(kind="stable")


# -- nodes and floats -------------------------------------------------------------------------------------------


def columns_of(layout: Layout, nodes: IntArray) -> tuple[IntArray, IntArray]:
    """The columns that say where entries go: of each track the first node; all others."""
    firsts, others = layout.split(nodes)
    return steps(firsts), others


def take_nodes(cursor: columns.Cursor, layout: Layout) -> IntArray:
    """The nodes again, (entries,)."""
    firsts = np.cumsum(columns.take(cursor, len(layout.at)), dtype=np.int64)
    return layout.joined(firsts, columns.take(cursor, len(layout.order) - len(layout.at)))


def put_floats(layout: Layout, floats: FloatArray) -> Iterator[bytes]:
    """One byte, how often differences are taken of the others; and two columns, of the bits as integers.

    Who goes straight on makes steps that hardly differ.
    """
    firsts, others = layout.split(floats.astype("<f8", copy=False).view(np.int64))
    is_second = layout.is_first[:-1][~layout.is_first[1:]]  # of the others
    again = np.where(is_second, others, steps(others))
    order = 2 if _width(again) < _width(others) else 1
    yield bytes([order])
    yield columns.put(steps(firsts))
    yield columns.put(again if order == 2 else others)


def take_floats(cursor: columns.Cursor, layout: Layout) -> FloatArray:
    """The floats again, to the last bit, (entries,)."""
    (order,) = cursor.take(1)
    if order not in _ORDERS:
        raise BadFile(f"differences of floats cannot be taken {order} times")
    firsts = np.cumsum(columns.take(cursor, len(layout.at)), dtype=np.int64)
    others = columns.take(cursor, len(layout.order) - len(layout.at))
    if order == 2:
        others = layout.sums(0, others)[~layout.is_first]
    return layout.joined(firsts, others).view(np.float64)


def _width(numbers: IntArray) -> float:
    """How many bits numbers have, about, all together."""
    return float(np.log2(np.abs(numbers.astype(np.float64)) + 1.0).sum())


# -- events -----------------------------------------------------------------------------------------------------


@dataclass(slots=True)
class Rows:
    """The events of one kind that wait for their block."""

    ints: "array[int]" = field(default_factory=lambda: array("q"))  # number of the agent, and perhaps a node, of each
    floats: "array[float]" = field(default_factory=lambda: array("d"))

    @property
    def numbers(self) -> int:
        """How many numbers there are."""
        return len(self.ints) + len(self.floats)

    @classmethod
    def of(cls, kind: int, events: list[Any]) -> "Rows":
        """The data of some events.

        Raises:
            BadType, BadValue: some are none for their kind.
        """
        nodes, floats = FORMS[kind]
        for data in events:
            if not isinstance(data, tuple) or len(data) != 1 + nodes + floats:
                raise BadValue(
                    f"An event of kind {kind:#010x} is a tuple of {1 + nodes} ints and {floats} floats, not "
                    f"{shown(data)}."
                )
        try:
            return cls(
                array("q", chain.from_iterable([data[: 1 + nodes] for data in events])),
                array("d", chain.from_iterable([data[1 + nodes :] for data in events])),
            )
        except TypeError as error:
            raise BadType(f"An event of kind {kind:#010x} has something else than numbers ({reason(error)}).") from None
        except OverflowError:
            raise BadValue(f"An event of kind {kind:#010x} has a number of more than 64 bits.") from None

    def extend(self, other: "Rows") -> None:
        """Add the events of a turn."""
        self.ints.extend(other.ints)
        self.floats.extend(other.floats)

    def since(self, ints: int, floats: int) -> "Rows":
        """Those behind so many numbers."""
        return Rows(self.ints[ints:], self.floats[floats:])

    def until(self, ints: int, floats: int) -> "Rows":
        """Those in front of so many numbers."""
        return Rows(self.ints[:ints], self.floats[:floats])

    def body(self, kind: int) -> Iterator[bytes]:
        """What stands in the block."""
        nodes, floats = FORMS[kind]
        ints = np.frombuffer(self.ints, np.int64).reshape(-1, 1 + nodes)
        layout = Layout(ints[:, 0])
        yield columns.put(steps(ints[:, 0]))
        for part in ints.T[1:]:
            for column in columns_of(layout, part):
                yield columns.put(column)
        for part in np.frombuffer(self.floats, np.float64).reshape(-1, floats).T:
            yield from put_floats(layout, part)


@dataclass(frozen=True, slots=True)
class Tracks:
    """Events of one kind, in their order."""

    numbers: IntArray  # (events,): of the agents
    nodes: IntArray  # (events, 0 or 1)
    floats: FloatArray  # (events, floats)

    def at(self, places: Any) -> "Tracks":
        """Some of them."""
        return Tracks(self.numbers[places], self.nodes[places], self.floats[places])

    def data(self) -> Iterator[tuple[Any, ...]]:
        """The data of each event."""
        parts = (self.numbers, *self.nodes.T, *self.floats.T)
        return zip(*(part.tolist() for part in parts), strict=True)


def take(cursor: columns.Cursor, kind: int, size: int) -> Tracks:
    """The events of a kind in a block.

    Raises:
        BadFile: they are damaged.
    """
    form = FORMS[kind]
    numbers = np.cumsum(columns.take(cursor, size), dtype=np.int64)
    layout = Layout(numbers)
    nodes, floats = np.empty((size, form.nodes), np.int64), np.empty((size, form.floats))
    for i in range(form.nodes):
        nodes[:, i] = take_nodes(cursor, layout)
    for i in range(form.floats):
        floats[:, i] = take_floats(cursor, layout)
    return Tracks(numbers, nodes, floats)


@dataclass(frozen=True, slots=True)
class Stretch:
    """The events of one kind in some turns of a recording, in their order."""

    tracks: Tracks
    turns: IntArray  # (events,): the turn of each
    after: IntArray  # (events,): how many moves of these turns come before each
    before: IntArray  # (others,): how many of these events come before each event of some other kinds


def concatenated(kind: int, parts: list[Tracks]) -> Tracks:
    """Tracks of several blocks as one."""
    if len(parts) == 1:
        return parts[0]
    form = FORMS[kind]
    empty = Tracks(np.zeros(0, np.int64), np.zeros((0, form.nodes), np.int64), np.zeros((0, form.floats)))
    parts = [empty, *parts]
    return Tracks(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("numbers", "nodes", "floats")))
