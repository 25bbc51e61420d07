"""What many agents did in a few turns, which can happen all at once, up to where something else comes between."""

from typing import Any, NamedTuple

import numpy as np

from gamms.ir import events as kinds
from gamms.ir.graph import IntArray
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.tracks import Tracks
from gamms.recorder.state import State


class Batch(NamedTuple):
    """Moves, flights and turns in space, in the order of each of the three."""

    numbers: IntArray  # (moves,): of agents
    nodes: IntArray  # (moves,)
    flights: Tracks
    after: IntArray  # (flights,): how many of these moves come before each
    turns: Tracks

    def __bool__(self) -> bool:
        """Whether there is anything."""
        return bool(len(self.numbers) or len(self.flights.numbers) or len(self.turns.numbers))


class Waiting:
    """The moves, flights and turns in space of some turns of a recording that have not happened yet.

    Args:
        reader: of the recording.
        start: the first turn.
        stop: the turn behind the last.
        others: the kinds of events that may come between.

    Attributes:
        numbers: of the agents of all moves.
        has_flyers: whether there are flights, or turns in space.
    """

    def __init__(self, reader: Reader, start: int, stop: int, others: frozenset[int]) -> None:
        turns, self.numbers, self._nodes = reader.moves(start, stop)
        self._flights = reader.tracks(kinds.AERIAL_AGENT_FLIGHT, start, stop, others)
        self._turns = reader.tracks(kinds.AERIAL_AGENT_TURN, start, stop, others)
        self._start, self._begins = start, turns.searchsorted(np.arange(start, stop)).tolist()
        self._before = self._flights.before.tolist(), self._turns.before.tolist()
        self._done = 0, 0, 0
        self.has_flyers = bool(len(self._flights.turns) or len(self._turns.turns))

    def before(self, event: int, turn: int, place: int) -> Batch:
        """What waits of what comes before an event; it waits no longer.

        Args:
            event: the event, counted in those of the other kinds.
            turn: in which it happens.
            place: how many moves of this turn come before it.
        """
        flown, turned = self._before
        return self._until(self._begins[turn - self._start] + place, flown[event], turned[event])

    def rest(self) -> Batch:
        """All that waits; it waits no longer."""
        return self._until(len(self.numbers), len(self._flights.turns), len(self._turns.turns))

    def _until(self, *ends: int) -> Batch:
        moves, flights, turns = (slice(begin, end) for begin, end in zip(self._done, ends, strict=True))
        after = self._flights.after[flights] - self._done[0]
        self._done = ends  # type: ignore[assignment] # three of them
        return Batch(
            self.numbers[moves],
            self._nodes[moves],
            self._flights.tracks.at(flights),
            after,
            self._turns.tracks.at(turns),
        )


def follow(state: State, rows: IntArray, paths: dict[str, tuple[str, np.ndarray[Any, Any]]]) -> None:
    """Let the columns of a state have the last of the values that each row gets, and other columns the one before it.

    Args:
        state: see `recorder.state.opened`.
        rows: (values,), where each goes; a row may get several, one after the other.
        paths: column -> the column of what was before, and the values, (values, …).
    """
    places = np.arange(len(rows))
    last, last_but_one = np.full((2, len(state["node"])), -1)
    last[rows] = places  # of several at one row, the last one stays
    is_earlier = last[rows] != places
    last_but_one[rows[is_earlier]] = places[is_earlier]
    moved = np.flatnonzero(last >= 0)
    ends, came = last[moved], last_but_one[moved]
    for name, (before, values) in paths.items():
        column = state[name]
        came_from = column[moved]
        came_from[came >= 0] = values[came[came >= 0]]
        state[before][moved] = came_from
        column[moved] = values[ends]
