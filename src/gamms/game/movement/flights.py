"""The agents of a batch that fly: their positions in each game, and their flights in a turn."""

from collections.abc import Sequence
from math import hypot

import numpy as np

from gamms.game.block.columns import AgentTable
from gamms.game.movement.travel import ResolvedAction
from gamms.ir.agents import UNTURNED, AgentBlock, Pose, Position, Quat
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing.actions import one_step


class Flights:
    """The positions and flights of the agents that fly, in all games.

    Args:
        roster: the agents of every game.
        games: the number of games.

    Attributes:
        agents: (flying agents,) their numbers in the roster, ascending.
        start, position, previous_position: (games, flying agents, 3) map units: where each began, is, and was before
            its last flight.
        quat: (games, flying agents, 4) the rotation of each.
        wanted, turned: (games, flying agents, 3), (games, flying agents, 4) the position and the rotation that it has
            chosen in its last part of a turn; NaN: none.
        has_flown: (games, flying agents) whether the last flight has changed the position.
    """

    def __init__(self, roster: AgentTable, games: int) -> None:
        self.agents = np.flatnonzero(roster.flies)
        self._speeds = [roster.agents[number].speed or 0.0 for number in self.agents.tolist()]
        shape = games, len(self.agents)
        self.start, self.position, self.previous_position, self.wanted = np.full((4, *shape, 3), np.nan)
        self.quat, self.turned = np.full((2, *shape, 4), np.nan)
        self.has_flown = np.zeros(shape, np.bool_)
        self._chosen: list[tuple[int, int, Position | None, Quat | None]] = []  # in the part that is under way

    @property
    def remembered(self) -> dict[str, FloatArray]:
        """The columns that determine later turns, by name."""
        return {name: getattr(self, name) for name in ("position", "previous_position", "quat")}

    @property
    def columns(self) -> list[FloatArray | BoolArray]:
        """The columns that turns change."""
        return [*self.remembered.values(), self.wanted, self.turned, self.has_flown]

    def begin(self, games: IntArray, starts: FloatArray, poses: Sequence[Pose], has_flown: Sequence[bool]) -> None:
        """Reset the flights of games that begin.

        Args:
            games: the numbers of the games.
            starts: (games, flying agents, 3) the start positions.
            poses: the poses in the played game; an agent at its start there is at its start in all games.
            has_flown: whether the agents have just arrived by a flight.
        """
        self.start[games] = starts
        self.wanted[games] = np.nan
        self.turned[games] = np.nan
        self.has_flown[games] = has_flown
        for number, (position, previous, quat) in enumerate(poses):
            self.quat[games, number] = quat
            self.position[games, number] = starts[:, number] if position is None else position
            self.previous_position[games, number] = starts[:, number] if previous is None else previous

    def enter(self, game: int, agent: int, start: Position | None) -> None:
        """Add an agent to a game in which it was not at the start, without a flight; `start` None: it does not fly."""
        k = self.agents == agent
        self.start[game, k] = np.nan if start is None else start
        self.wanted[game, k] = np.nan
        self.turned[game, k] = np.nan
        self.has_flown[game, k] = False

    # -- the context of one game --------------------------------------------------------------------------------

    def poses(self, game: int) -> list[Pose]:
        """Return the positions and rotations of the agents in a game."""
        each = zip(
            self.position[game].tolist(), self.previous_position[game].tolist(), self.quat[game].tolist(), strict=True
        )
        return [(tuple(now), tuple(before), tuple(quat)) for now, before, quat in each]

    def take(self, game: int, block: AgentBlock, places: Sequence[int], rows: Sequence[int]) -> BoolArray:
        """Take the poses of some of the agents from the rows of a block that shows a game; return who has flown."""
        self.position[game, places] = np.array([block.position[row] for row in rows]).reshape(-1, 3)
        self.previous_position[game, places] = np.array([block.previous_position[row] for row in rows]).reshape(-1, 3)
        self.quat[game, places] = np.array([block.quat[row] for row in rows]).reshape(-1, 4)
        has_flown: BoolArray = self.has_flown[game]  # in place
        has_flown[places] &= np.array([row not in block.placed for row in rows], np.bool_)
        return has_flown

    def actions(self, game: int, numbers: IntArray, nodes: Sequence[int]) -> dict[int, ResolvedAction]:
        """Return the flights of agents, on these nodes, by their places among these numbers."""
        found = {}
        for place, number in enumerate(numbers.tolist()):
            k = int(np.searchsorted(self.agents, number))
            if k == len(self.agents) or self.agents[k] != number:
                continue
            position = self.wanted[game, k].tolist()
            quat = self.turned[game, k].tolist()
            found[place] = ResolvedAction(
                nodes[place],
                (nodes[place],),
                position=None if position[0] != position[0] else tuple(position),
                quat=None if quat[0] != quat[0] else tuple(quat),
            )
        return found

    # -- turns ----------------------------------------------------------------------------------------------------

    def choose(self, game: int, agent: int, position: Position | None, quat: Quat | None) -> None:
        """Set the position to which an agent flies, and its rotation; None: unchanged."""
        self._chosen.append((game, int(np.searchsorted(self.agents, agent)), position, quat))

    def fly(self, game: int, agent: int, offset: Sequence[float]) -> None:
        """Set the displacement of an agent, in map units, limited by its speed.

        Raises:
            BadValue: the position exceeds the range of floats.
        """
        k = int(np.searchsorted(self.agents, agent))
        x, y, z = self.position[game, k].tolist()
        self.choose(game, agent, one_step((x, y, z), offset, min(hypot(*offset), self._speeds[k])), None)

    def forget_choices(self) -> None:
        """Drop what agents have chosen in a part of a turn that was not played."""
        self._chosen.clear()

    def set_out(self, games: IntArray, members: BoolArray, *, is_first: bool) -> None:
        """Begin a part of a turn: the chosen flights become the wanted ones.

        Args:
            games: the games that are played.
            members: (agents,) a mask of the agents of the roster that move in this part.
            is_first: whether it is the first part of the turn.
        """
        which = np.ones(len(self.agents), np.bool_) if is_first else members[self.agents]
        rows = np.ix_(games, np.flatnonzero(which))
        self.wanted[rows] = np.nan
        self.turned[rows] = np.nan
        self.has_flown[rows] = False
        for game, k, position, quat in self._chosen:
            if position is not None:
                self.wanted[game, k] = position
            if quat is not None:
                self.turned[game, k] = quat
        self._chosen.clear()

    def hold(self, game: int, agent: int) -> None:
        """Keep an agent where it is, if it flies."""
        self.wanted[game, self.agents == agent] = np.nan

    def cancel(self, games: IntArray, members: BoolArray, are_put: BoolArray) -> None:
        """Keep agents of a part of the turn where rules have put them, (games, agents of the roster)."""
        at, k = np.nonzero((are_put & members)[:, self.agents])
        self.wanted[games[at], k] = np.nan

    def move(self, games: IntArray, members: BoolArray) -> tuple[IntArray, IntArray]:
        """Execute the wanted rotations and flights of a part of the turn; return the games and numbers of the agents.

        Args:
            games: the games that are played.
            members: (games, agents of the roster) a mask of the living agents that move in this part.
        """
        at, k = np.nonzero(members[:, self.agents] & ~np.isnan(self.turned[games, :, 0]))
        self.quat[games[at], k] = self.turned[games[at], k]
        at, k = np.nonzero(members[:, self.agents] & ~np.isnan(self.wanted[games, :, 0]))
        those = games[at], k
        self.previous_position[those] = self.position[those]
        self.position[those] = self.wanted[those]
        self.has_flown[those] = (self.position[those] != self.previous_position[those]).any(axis=-1)
        return games[at], self.agents[k]

    def put_back(self, games: IntArray, agents: IntArray) -> None:
        """Place flying agents at their starts; agents that came later stay where they are."""
        for game, agent in zip(games.tolist(), agents.tolist(), strict=True):
            k = int(np.searchsorted(self.agents, agent))
            if k < len(self.agents) and self.agents[k] == agent:
                self.previous_position[game, k] = self.position[game, k]
                if not np.isnan(self.start[game, k, 2]):
                    self.position[game, k] = self.start[game, k]
                self.has_flown[game, k] = False

    # -- views ----------------------------------------------------------------------------------------------------

    def xyz(self, games: IntArray, agents: IntArray) -> tuple[BoolArray, FloatArray]:
        """Return a mask of the flying agents, (agents,), and their positions, (games, flying agents, 3)."""
        flies = np.isin(agents, self.agents)
        return flies, self.position[np.ix_(games, np.searchsorted(self.agents, agents[flies]))]


def poses_in(block: AgentBlock, rows: Sequence[int | None], starts: Sequence[Position]) -> list[Pose]:
    """Return the poses of agents by their rows in a block, None for agents that come later.

    A position is None if it is where the agent began.
    """
    found: list[Pose] = []
    for row, start in zip(rows, starts, strict=True):
        if row is None:
            found.append((None, None, UNTURNED))
            continue
        places = (block.position[row], block.previous_position[row])
        now, before = (None if place == start else place for place in places)
        found.append((now, before, block.quat[row]))
    return found


def starts_above(below: FloatArray, starts: FloatArray, first: FloatArray) -> FloatArray:
    """Return the start positions of flying agents, (games, agents, 3), at the same heights in all games.

    Args:
        below: (games, agents, 2) the places of the nodes above which they begin.
        starts: (agents, 3) the start positions in the played game.
        first: (agents, 2) the places of the nodes below these.
    """
    found = np.tile(starts, (len(below), 1, 1))
    is_elsewhere = (below != first).any(axis=-1)
    found[is_elsewhere, :2] = below[is_elsewhere]
    return found
