"""What agents did, agent by agent: where one goes next resembles where it went before.

A track is what the entries of one agent hold, in their order; tracks stand in the order of the agents' numbers. Of each
track the first node stands apart, as the difference from that of the track before; the others are differences within
it. Moves are such tracks, and so are events whose data are only numbers: an agent's number, perhaps a node, and floats.
"""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir import events as kinds
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.packing import ByteReader, column, steps
from gamms.plain import Plain
from gamms.text import reason, shown


class Form(NamedTuple):
    """What an event whose data are numbers consists of, behind the number of an agent."""

    nodes: int
    floats: int


FORMS = {kinds.AERIAL_AGENT_FLIGHT: Form(1, 3), kinds.AERIAL_AGENT_TURN: Form(0, 4)}


class Layout:
    """Which entries belong to which agent, worked out from the agent of each."""

    __slots__ = ("at", "is_first", "lengths", "order")

    def __init__(self, numbers: IntArray) -> None:
        self.order = _by_number(numbers)  # (entries,): track by track
        ordered = numbers[self.order]
        self.is_first = np.ones(len(numbers), np.bool_)
        self.is_first[1:] = ordered[1:] != ordered[:-1]
        self.at = np.flatnonzero(self.is_first)  # (tracks,): where each begins
        self.lengths = np.diff(self.at, append=len(numbers))

    def columns(self, values: IntArray) -> Iterator[bytes]:
        """Yield two columns: the first value of each track; all others, as differences."""
        ordered = values[self.order]
        yield column(steps(ordered[self.is_first]))
        yield column(steps(ordered)[~self.is_first])

    def float_columns(self, values: IntArray) -> Iterator[bytes]:
        """Yield two columns of the bits of floats: as `columns`, but differences of the differences of each track.

        An agent that goes straight on makes steps that hardly differ.
        """
        ordered = values[self.order]
        yield column(steps(ordered[self.is_first]))
        others = steps(ordered)[~self.is_first]
        is_second = self.is_first[:-1][~self.is_first[1:]]  # (others,)
        yield column(np.where(is_second, others, steps(others)))

    def take(self, reader: ByteReader) -> IntArray:
        """Return the values whose `columns` come next, (entries,)."""
        firsts, others = reader.sums(len(self.at)), reader.column(len(self.order) - len(self.at))
        return self._values(firsts, others)

    def take_floats(self, reader: ByteReader) -> FloatArray:
        """Return the floats whose `float_columns` come next, (entries,)."""
        firsts, others = reader.sums(len(self.at)), reader.column(len(self.order) - len(self.at))
        return self._values(firsts, self._sums(0, others)[~self.is_first]).view(np.float64)

    def _values(self, firsts: IntArray, others: IntArray) -> IntArray:
        values = np.empty(len(self.order), np.int64)
        values[self.order] = self._sums(firsts, others)
        return values

    def _sums(self, firsts: IntArray | int, others: IntArray) -> IntArray:
        """Return the sums along each track, track by track."""
        parts = np.zeros(len(self.order), np.int64)
        parts[~self.is_first] = others
        sums = np.cumsum(parts)
        sums += np.repeat(firsts - sums[self.at], self.lengths)
        return sums


@lru_cache(maxsize=2)
def layout_of(numbers: bytes) -> Layout:
    """Return the layout of the bytes of some numbers: most blocks have the same as the one before."""
    # NOTE: which spares a third of the time of a block with ten agents (benchmarks/README.md, w4).
    return Layout(np.frombuffer(numbers, np.int64))


def _by_number(numbers: IntArray) -> IntArray:
    if len(numbers) and int(numbers.min()) >= 0 and int(numbers.max()) < 1 << 16:
        return numbers.astype(np.uint16).argsort(kind="stable")  # NOTE: a radix sort, 5 times as fast on unordered rows
    return numbers.argsort(kind="stable")


# -- events -----------------------------------------------------------------------------------------------------


class Rows(NamedTuple):
    """Events of one kind that wait for their block."""

    ints: "array[int]"  # number of the agent, and perhaps a node, of each
    floats: "array[float]"

    @classmethod
    def of(cls, kind: int, events: list[Plain]) -> "Rows":
        """Return the data of some events.

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

    @classmethod
    def joined(cls, parts: Sequence["Rows"]) -> "Rows":
        """Return the events of several turns."""
        ints, floats = (b"".join(numbers) for numbers in zip(*parts, strict=True))
        return cls(array("q", ints), array("d", floats))

    def columns(self, kind: int) -> Iterator[bytes]:
        """Yield the columns that stand in the block: of floats, their bits as integers."""
        nodes, floats = FORMS[kind]
        ints = np.frombuffer(self.ints, np.int64).reshape(-1, 1 + nodes)
        layout = Layout(ints[:, 0])
        yield column(steps(ints[:, 0]))
        bits = np.frombuffer(self.floats, np.float64).astype("<f8", copy=False).view(np.int64).reshape(-1, floats)
        for part in ints.T[1:]:
            yield from layout.columns(part)
        for part in bits.T:
            yield from layout.float_columns(part)


@dataclass(frozen=True, slots=True)
class Tracks:
    """Events of one kind, in their order."""

    numbers: IntArray  # (events,): of the agents
    nodes: IntArray  # (events, 0 or 1)
    floats: FloatArray  # (events, floats)

    def at(self, places: IntArray | slice) -> "Tracks":
        """Return some of them."""
        return Tracks(self.numbers[places], self.nodes[places], self.floats[places])

    def data(self) -> Iterator[tuple[Plain, ...]]:
        """Yield the data of each event."""
        parts = (self.numbers, *self.nodes.T, *self.floats.T)
        return zip(*(part.tolist() for part in parts), strict=True)


def take(reader: ByteReader, kind: int, size: int) -> Tracks:
    """Return the events of a kind in a block.

    Raises:
        BadFile: they are damaged.
    """
    form = FORMS[kind]
    numbers = reader.sums(size)
    layout = Layout(numbers)
    nodes, floats = np.empty((size, form.nodes), np.int64), np.empty((size, form.floats))
    for i in range(form.nodes):
        nodes[:, i] = layout.take(reader)
    for i in range(form.floats):
        floats[:, i] = layout.take_floats(reader)
    return Tracks(numbers, nodes, floats)


@dataclass(frozen=True, slots=True)
class Stretch:
    """The events of one kind in some turns of a recording, in their order."""

    tracks: Tracks
    turns: IntArray  # (events,): the turn of each
    after: IntArray  # (events,): how many moves of these turns come before each
    before: IntArray  # (others,): how many of these events come before each event of some other kinds


def concatenated(kind: int, parts: list[Tracks]) -> Tracks:
    """Return tracks of several blocks as one."""
    if len(parts) == 1:
        return parts[0]
    form = FORMS[kind]
    empty = Tracks(np.zeros(0, np.int64), np.zeros((0, form.nodes), np.int64), np.zeros((0, form.floats)))
    parts = [empty, *parts]
    return Tracks(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("numbers", "nodes", "floats")))
