"""The flights of agents: where those that fly are and were, how they are turned, and where they fly in a turn.

The columns have a row for each flying agent of each game; those of one game are a block with one game.
"""

from __future__ import annotations

from math import nan
from typing import Any

NOWHERE = nan


class Flights:
    """The positions and rotations of the agents that fly, in each game.

    Args:
        agents: (flyers,) the numbers of these agents among the agents of a game, ascending.
        position, previous: (games * flyers * 3,) map units: where each is, and was before its last flight.
        quat: (games * flyers * 4,) the unit quaternion `(w, x, y, z)` of each.
    """

    def __init__(
        self,
        agents: memoryview[int],
        position: memoryview[float],
        previous: memoryview[float],
        quat: memoryview[float],
    ) -> None:
        self.agents = agents
        self.count = len(agents)
        self.position = position
        self.previous = previous
        self.quat = quat

    def find(self, agent: int) -> int:
        """Return the index of an agent among those that fly; -1: it does not fly."""
        low = 0
        high = self.count
        while low < high:
            middle = (low + high) // 2
            if self.agents[middle] < agent:
                low = middle + 1
            else:
                high = middle
        return low if low < self.count and self.agents[low] == agent else -1

    def find_row(self, agent: int, game: int) -> int:
        """Return the row of a flying agent in the columns; -1: it does not fly."""
        found = self.find(agent)
        return -1 if found < 0 else game * self.count + found

    # -- positions and rotations ------------------------------------------------------------------------------------

    def get_position(self, agent: int, game: int = 0) -> Any:
        """Return the position `(x, y, z)` of an agent; None: it does not fly, or is nowhere."""
        return read_place(self.position, self.find_row(agent, game))

    def get_previous_position(self, agent: int, game: int = 0) -> Any:
        """Return the position before the last flight; None as for `get_position`."""
        return read_place(self.previous, self.find_row(agent, game))

    def get_rotation(self, agent: int, game: int = 0) -> Any:
        """Return the rotation `(w, x, y, z)` of an agent; None: it does not fly."""
        return read_rotation(self.quat, self.find_row(agent, game))

    def fly(self, agent: int, x: float, y: float, z: float, game: int = 0) -> int:
        """Move a flying agent to a position; return what this changes, see `fly_row`."""
        return self.fly_row(self.find_flyer(agent, game), x, y, z)

    def set_rotation(self, agent: int, w: float, x: float, y: float, z: float, game: int = 0) -> int:
        """Set the rotation of a flying agent."""
        return self.set_row_rotation(self.find_flyer(agent, game), w, x, y, z)

    def copy_to(self, flights: Flights, agent: int, game: int, other: int, in_game: int) -> int:
        """Copy the positions and the rotation of an agent of a game to another agent, in a game of other flights."""
        source = self.find_flyer(agent, game)
        target = flights.find_flyer(other, in_game)
        for i in range(3):
            flights.position[3 * target + i] = self.position[3 * source + i]
            flights.previous[3 * target + i] = self.previous[3 * source + i]
        for i in range(4):
            flights.quat[4 * target + i] = self.quat[4 * source + i]
        return 0

    def find_flyer(self, agent: int, game: int) -> int:
        """Return the row of a flying agent in the columns (IndexError: it does not fly)."""
        row = self.find_row(agent, game)
        if row < 0:
            raise IndexError(f"Agent {agent} does not fly.")
        return row

    def fly_row(self, row: int, x: float, y: float, z: float) -> int:
        """Move the agent of a row to a position.

        Returns:
            0: it is there already; 1: only its height changes; 2: it is above another point then.
        """
        begin = 3 * row
        for i in range(begin, begin + 3):
            self.previous[i] = self.position[i]
        self.position[begin] = x
        self.position[begin + 1] = y
        self.position[begin + 2] = z
        if x != self.previous[begin] or y != self.previous[begin + 1]:
            return 2
        return z != self.previous[begin + 2]

    def set_row_rotation(self, row: int, w: float, x: float, y: float, z: float) -> int:
        """Set the rotation of the agent of a row."""
        begin = 4 * row
        self.quat[begin] = w
        self.quat[begin + 1] = x
        self.quat[begin + 2] = y
        self.quat[begin + 3] = z
        return 0


class TurnFlights(Flights):
    """The flights of a turn in a batch; numbers are NaN where an agent has not chosen any.

    Args:
        agents, position, previous, quat: see `Flights`.
        start: (games * flyers * 3,) the position where each agent began; NaN: it came later.
        wanted: (games * flyers * 3,) the position that it flies to.
        turned: (games * flyers * 4,) the rotation that it takes.
        has_flown: (games * flyers,) whether its last flight has changed its position.

    Attributes:
        chosen: the flights of a part that has not begun: game, agent, position and rotation; None: unchanged.
    """

    def __init__(
        self,
        agents: memoryview[int],
        position: memoryview[float],
        previous: memoryview[float],
        quat: memoryview[float],
        start: memoryview[float],
        wanted: memoryview[float],
        turned: memoryview[float],
        has_flown: memoryview[int],
    ) -> None:
        Flights.__init__(self, agents, position, previous, quat)
        self.start = start
        self.wanted = wanted
        self.turned = turned
        self.has_flown = has_flown
        self.chosen: list[Any] = []

    def get_wanted(self, agent: int, game: int) -> tuple[Any, Any]:
        """Return the position and the rotation that an agent takes in the turn; None: unchanged."""
        row = self.find_row(agent, game)
        return read_place(self.wanted, row), read_rotation(self.turned, row)

    def hold(self, agent: int, game: int) -> int:
        """Keep an agent where it is, if it flies."""
        row = self.find_row(agent, game)
        if row >= 0:
            self.wanted[3 * row] = NOWHERE
        return 0

    def enter(self, agent: int, game: int, start: Any) -> int:
        """Begin an agent that comes to a game at a position, without a flight; None: it does not fly."""
        row = self.find_row(agent, game)
        if row < 0:
            return 0
        for i in range(3):
            self.start[3 * row + i] = NOWHERE if start is None else start[i]
        self.forget(row)
        return 0

    def forget(self, row: int) -> int:
        """Forget the flight of the last turn."""
        self.wanted[3 * row] = NOWHERE
        self.turned[4 * row] = NOWHERE
        self.has_flown[row] = 0
        return 0

    def set_out(self, games: memoryview[int], moves: memoryview[int]) -> int:
        """Begin a part of a turn: the chosen flights are the wanted ones.

        Args:
            games: the games that are played.
            moves: (agents,) whether each agent forgets its last flight.
        """
        for g in range(len(games)):
            first = games[g] * self.count
            for i in range(self.count):
                if moves[self.agents[i]]:
                    self.forget(first + i)
        for game, agent, position, quat in self.chosen:
            row = self.find_row(agent, game)
            for i in range(3 if position is not None else 0):
                self.wanted[3 * row + i] = position[i]
            for i in range(4 if quat is not None else 0):
                self.turned[4 * row + i] = quat[i]
        self.chosen.clear()
        return 0

    def cancel(self, games: memoryview[int], are_put: memoryview[int], agents: int) -> int:
        """Keep agents where rules have put them: a mask (games * agents,), of these games."""
        for g in range(len(games)):
            for i in range(self.count):
                if are_put[g * agents + self.agents[i]]:
                    self.wanted[3 * (games[g] * self.count + i)] = NOWHERE
        return 0

    def move(self, games: memoryview[int], moves: memoryview[int], agents: int, flown: memoryview[int]) -> int:
        """Carry out the wanted rotations and flights of a part of the turn; return the number of flights.

        Args:
            games: the games that are played.
            moves: (games * agents,) whether each agent of these games lives and moves in the part.
            agents: the number of agents in a game.
            flown: (games * flyers,) set to the rows of the agents that fly.
        """
        number = 0
        for g in range(len(games)):
            for i in range(self.count):
                if not moves[g * agents + self.agents[i]]:
                    continue
                row = games[g] * self.count + i
                a = 4 * row
                if self.turned[a] == self.turned[a]:
                    self.set_row_rotation(
                        row, self.turned[a], self.turned[a + 1], self.turned[a + 2], self.turned[a + 3]
                    )
                a = 3 * row
                if self.wanted[a] == self.wanted[a]:
                    changed = self.fly_row(row, self.wanted[a], self.wanted[a + 1], self.wanted[a + 2])
                    self.has_flown[row] = changed > 0
                    flown[number] = row
                    number += 1
        return number

    def put_back(self, games: memoryview[int], agents: memoryview[int]) -> int:
        """Place agents that fly at their starts; those that came later stay where they are."""
        for n in range(len(games)):
            row = self.find_row(agents[n], games[n])
            if row < 0:
                continue
            a = 3 * row
            if self.start[a + 2] == self.start[a + 2]:
                self.fly_row(row, self.start[a], self.start[a + 1], self.start[a + 2])
            else:
                self.fly_row(row, self.position[a], self.position[a + 1], self.position[a + 2])
            self.has_flown[row] = 0
        return 0


def read_place(column: memoryview[float], row: int) -> Any:
    """Return the three numbers of a row; None if they are NaN, or the row is -1."""
    a = 3 * row
    if row < 0 or column[a] != column[a]:
        return None
    return column[a], column[a + 1], column[a + 2]


def read_rotation(column: memoryview[float], row: int) -> Any:
    """Return the four numbers of a row; None if they are NaN, or the row is -1."""
    a = 4 * row
    if row < 0 or column[a] != column[a]:
        return None
    return column[a], column[a + 1], column[a + 2], column[a + 3]
