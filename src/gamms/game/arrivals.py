"""The course of a turn in which agents decide at each arrival: who arrives when, and where all are meanwhile."""

from collections.abc import Iterator
from functools import partial
from heapq import heappop, heappush

from gamms.game.moves import TurnMoves
from gamms.game.travel import progress_at
from gamms.ir.agents import AgentBlock


class Arrivals:
    """The agents that are under way in a turn, in the order of time in which they arrive at nodes.

    Only those that arrive are moved. Where the others are follows from their legs, whenever that is asked for
    (`AgentBlock.on_edge`), so that an arrival costs what the agents cost that arrive.

    Args:
        turn: the moves of all agents, which begin now.
        block: the agents.
    """

    def __init__(self, turn: TurnMoves, block: AgentBlock) -> None:
        self._turn, self._under_way = turn, block.under_way
        self._queue: list[tuple[float, str, int]] = []  # when, the name, the slot
        self._moved: set[int] = set()  # slots

    def depart(self, i: int) -> None:
        """Let the agent of a slot go on, or stand, as its move says from now on."""
        action, slot = self._turn.actions.get(i), self._turn.slots[i]
        if action is None or not action.legs:
            return
        leg = action.legs[-1]
        self._moved.add(i)
        self._under_way.depart(slot.row, partial(progress_at, leg))
        if action.progress is None and leg.until < 1.0:
            heappush(self._queue, (leg.until, slot.name, i))

    def times(self) -> Iterator[tuple[float, list[int]]]:
        """Yield when agents arrive, and the slots of those that do then, in the order of their names."""
        queue, under_way, turn = self._queue, self._under_way, self._turn
        while queue:
            now, here = queue[0][0], list[int]()
            while queue and queue[0][0] == now:
                here.append(heappop(queue)[2])
            under_way.pass_time(now)
            for i in here:
                under_way.arrive(turn.slots[i].row, turn.ends[i])
            yield now, here

    def close(self) -> None:
        """Put all agents back to where the turn began: their moves are made when it is over."""
        self._under_way.pass_time(0.0)
        for i in self._moved:
            self._under_way.put_back(self._turn.slots[i].row, self._turn.starts[i])
