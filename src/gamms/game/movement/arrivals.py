"""Positions during a turn in which agents decide on arrival: who arrives when, and where the others are meanwhile."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from gamms.core.arrivals import Queue
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.travel import GamePaths, Travel, progress_at
from gamms.ir.agents import AgentBlock
from gamms.typing.game import EdgePlace

MOST_ARRIVALS = 1000  # per turn; beyond, an agent would move endlessly on edges of length 0
WAITS = f"it arrived {MOST_ARRIVALS} times in one turn, and waits"
NO_DEEDS = "deeds are done where a turn begins, not at an arrival in it"


class Arrivals:
    """The agents under way in a turn, in the order of their arrivals at nodes.

    Only arriving agents are moved. The positions of the others are computed from their legs when needed
    (`AgentBlock.on_edge`), so that the cost of an arrival depends only on the arriving agents.

    Args:
        turn: the moves of all agents, which begin now.
        block: the agents.
        has_end: whether arrivals at the end of the turn are needed, too.
    """

    def __init__(self, turn: TurnMoves, block: AgentBlock, *, has_end: bool) -> None:
        self._turn = turn
        self._under_way = block.under_way
        self._has_end = has_end
        self._queue = Queue(len(turn.slots))
        self._moved: set[int] = set()  # slots
        on_edges = [block.on_edge(slot.row) for slot in turn.slots]
        pairs = zip(turn.starts, on_edges, strict=True)
        self._places: list[Any] = [node if on is None else EdgePlace(on.edge) for node, on in pairs]

    def depart(self, i: int) -> None:
        """Start the agent of a slot on its move: it goes on, or stands."""
        paths = self._turn.paths
        leg = None if paths is None else paths.last_leg(i)
        if leg is None:
            return
        self._moved.add(i)
        self._under_way.depart(self._turn.slots[i].row, partial(progress_at, leg))
        if leg.end in (0.0, 1.0) and (leg.until < 1.0 or self._has_end):
            self._queue.push(0, i, leg.until)

    def times(self) -> Iterator[tuple[float, list[int]]]:
        """Yield (time, slots of the agents that arrive then, in the order of their names)."""
        queue = self._queue
        under_way = self._under_way
        turn = self._turn
        while queue.size(0):
            now = queue.first_time(0)
            here = list[int]()
            while queue.first_time(0) == now:
                here.append(queue.pop(0))
            under_way.pass_time(now)
            for i in here:
                under_way.arrive(turn.slots[i].row, turn.ends[i])
            yield now, here

    # -- conflicts ------------------------------------------------------------------------------------------------

    def places(self, here: Sequence[int], paths: GamePaths | None) -> tuple[list[Any], list[Any]]:
        """Return the places of all agents (node ids or edges) before and after some slots set out on their paths."""
        before = self._places
        after = self._places.copy()
        for i in here:
            leg = None if paths is None else paths.last_leg(i)
            if leg is None:
                after[i] = self._turn.ends[i]
            elif leg.begin != leg.end:
                after[i] = EdgePlace(leg.edge)
        return before, after

    def take(self, places: list[Any]) -> None:
        """Set the current places of all agents."""
        self._places = places

    def hold(self, i: int, travel: Travel) -> None:
        """Stop the arriving agent of a slot just before the node."""
        self._turn.stop_short(i, travel.roads)
        self._under_way.arrive(self._turn.slots[i].row, self._turn.ends[i])
        self.depart(i)
        self._under_way.pass_time(self._under_way.time)

    def close(self) -> None:
        """Put all agents back to their places at the start of the turn; their moves are applied after the turn."""
        self._under_way.pass_time(0.0)
        for i in self._moved:
            self._under_way.put_back(self._turn.slots[i].row, self._turn.starts[i])
