"""The course of a turn in which agents decide at each arrival: who arrives when, and where all are meanwhile."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from gamms.core.arrivals import Queue
from gamms.game.moves import TurnMoves
from gamms.game.travel import ResolvedAction, progress_at
from gamms.ir.agents import AgentBlock
from gamms.typing.game import EdgePlace, Move

MOST_ARRIVALS = 1000  # in one turn; more, and an agent goes to and fro on edges of no length
WAITS = f"it arrived {MOST_ARRIVALS} times in one turn, and waits"
NO_DEEDS = "deeds are done where a turn begins, not at an arrival in it"


class Arrivals:
    """The agents that are under way in a turn, in the order of time in which they arrive at nodes.

    Only those that arrive are moved. Where the others are follows from their legs, whenever that is asked for
    (`AgentBlock.on_edge`), so that an arrival costs what the agents cost that arrive.

    Args:
        turn: the moves of all agents, which begin now.
        block: the agents.
        has_end: whether those that arrive when the turn is over are of interest, too.
    """

    def __init__(self, turn: TurnMoves, block: AgentBlock, *, has_end: bool) -> None:
        self._turn, self._under_way, self._has_end = turn, block.under_way, has_end
        self._queue = Queue(len(turn.slots))
        self._moved: set[int] = set()  # slots
        on_edges = [block.on_edge(slot.row) for slot in turn.slots]
        pairs = zip(turn.starts, on_edges, strict=True)
        self._places: list[Any] = [node if on is None else EdgePlace(on.edge) for node, on in pairs]

    def depart(self, i: int) -> None:
        """Let the agent of a slot go on, or stand, as its move says from now on."""
        action, slot = self._turn.actions.get(i), self._turn.slots[i]
        if action is None or not action.legs:
            return
        leg = action.legs[-1]
        self._moved.add(i)
        self._under_way.depart(slot.row, partial(progress_at, leg))
        if action.progress is None and (leg.until < 1.0 or self._has_end):
            self._queue.push(i, leg.until)

    def times(self) -> Iterator[tuple[float, list[int]]]:
        """Yield when agents arrive, and the slots of those that do then, in the order of their names."""
        queue, under_way, turn = self._queue, self._under_way, self._turn
        while queue.size:
            now, here = queue.first_time(), list[int]()
            while queue.first_time() == now:
                here.append(queue.pop())
            under_way.pass_time(now)
            for i in here:
                under_way.arrive(turn.slots[i].row, turn.ends[i])
            yield now, here

    # -- conflicts ------------------------------------------------------------------------------------------------

    def places(self, here: Sequence[int], actions: Mapping[int, ResolvedAction]) -> tuple[list[Any], list[Any]]:
        """Return where agents are, and where they will be if those of some slots do this: nodes and edges."""
        before, after = self._places, self._places.copy()
        for i in here:
            action = actions.get(i)
            leg = action.legs[-1] if action is not None and action.legs else None
            if leg is None:
                after[i] = self._turn.ends[i]
            elif leg.begin != leg.end:
                after[i] = EdgePlace(leg.edge)
        return before, after

    def moves(self, places: tuple[list[Any], list[Any]], indices: list[int]) -> dict[str, Move]:
        """Return agent -> its move between such places, of these slots."""
        slots, (before, after) = self._turn.slots, places
        return {
            slots[i].name: Move(slots[i].name, slots[i].team, before[i], after[i], (before[i], after[i]))
            for i in indices
        }

    def take(self, places: list[Any]) -> None:
        """Let agents be at these places from now on."""
        self._places = places

    def hold(self, i: int) -> None:
        """Let the agent of a slot that arrives now stand just before the node."""
        self._turn.stop_short(i)
        slot, action = self._turn.slots[i], self._turn.actions[i]
        self._under_way.arrive(slot.row, action.end)
        self._under_way.depart(slot.row, partial(progress_at, action.legs[-1]))
        self._under_way.pass_time(self._under_way.time)

    def close(self) -> None:
        """Put all agents back to where the turn began: their moves are made when it is over."""
        self._under_way.pass_time(0.0)
        for i in self._moved:
            self._under_way.put_back(self._turn.slots[i].row, self._turn.starts[i])
