"""Agents that fly in many games at once: where they are, and where what they decide leads.

In all else they count as agents on the nodes below them, which stay there until the moves of a turn are over.
All numbers are worked out by the same operations as in `typing.actions`, so that they are the same to the bit.
"""

from collections.abc import Callable, Hashable, Sequence
from math import hypot
from typing import Any, NamedTuple, Self, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_array
from gamms.errors import BadValue
from gamms.game.batch.columns import PlayedGame, Roster
from gamms.game.streets import Streets
from gamms.ir.agents import Position, Quat
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing.actions import one_step


class Flown(NamedTuple):
    """What one agent does that flies: the game of the turn, its number in the roster, where to, and how turned."""

    at: int
    agent: int
    xyz: Position | None
    quat: Quat | None


"""Where an agent was before it flew last, where it is, and how it is turned."""


class Flights(NamedTuple):
    """What agents that fly do in a turn of some games.

    Attributes:
        agents: (flyers,) their numbers in the roster.
        goes: (games, flyers) which fly somewhere, be it where they are; the others hover.
        xyz: (games, flyers, 3) where to.
        turns: (games, flyers) which turn.
        quat: (games, flyers, 4) how they are turned then.
        flew: (games, flyers) which have flown away from where they were, once all have moved.
    """

    agents: IntArray
    goes: BoolArray
    xyz: FloatArray
    turns: BoolArray
    quat: FloatArray
    flew: BoolArray

    def put(self, several: Sequence[Flown]) -> None:
        """Write down what agents do."""
        for at, agent, xyz, quat in several:
            who = at, int(np.searchsorted(self.agents, agent))
            for value, column, is_there in ((xyz, self.xyz, self.goes), (quat, self.quat, self.turns)):
                if value is not None:
                    column[who], is_there[who] = value, True

    def of(self, games: IntArray) -> Self:
        """Return those of some games."""
        return self._replace(**{name: getattr(self, name)[games] for name in self._fields[1:]})

    def noted(self, games: IntArray, known: Self) -> Self:
        """Return the flights of all games that are known, but these of some."""
        for column, values in zip(known[1:], self[1:], strict=True):
            column[games] = values
        return known

    def without(self, stopped: BoolArray) -> Self:
        """Return them, but some agents, (games, agents), hover."""
        return self._replace(goes=self.goes & ~stopped[:, self.agents])

    def of_living(self, alive: BoolArray) -> Self:
        """Return those of agents, (games, agents), that are alive."""
        here = alive[:, self.agents]
        return self._replace(goes=self.goes & here, turns=self.turns & here)

    def joined(self, others: Self, agents: IntArray) -> Self:
        """Return these, but of some agents others."""
        column = np.isin(self.agents, agents)
        found: list[Any] = [one.copy() for one in self[1:]]
        for values, new in zip(found, others[1:], strict=True):
            values[:, column] = new[:, column]
        return type(self)(self.agents, *found)


class Flyers:
    """The agents of a batch that fly, in all games.

    Args:
        game: of the batch, which is not played in.
        roster: the agents of each game.
        streets: of its map.
        start: (games, agents) rows of the nodes where agents begin, those that fly above them.

    Attributes:
        agents: (flyers,) their numbers in the roster; until one has come, it is where the first of its team began.
        start, xyz, before: (games, flyers, 3) where they began, are, and were before they flew last.
        quat: (games, flyers, 4) how they are turned.
        speeds: (flyers,) how far they go in a turn at most.
        ground_z: (nodes,) how high nodes are.
        is_outside: (nodes,) which are not in a tunnel.
    """

    def __init__(self, game: PlayedGame, roster: Roster, streets: Streets, start: IntArray) -> None:
        self.agents, self._streets = np.flatnonzero(roster.flies), streets
        self._is_first = roster.is_first[self.agents]
        self._nearest: Callable[[FloatArray, FloatArray], IntArray] = game.ctx.graph.graph.nearest_node
        ground = game.ctx.graph.graph.ground(streets.columns.node_ids)
        nodes = len(streets.columns.node_ids)
        self.ground_z: FloatArray = np.zeros(nodes) if ground is None else ground.z
        self.is_outside: BoolArray = np.ones(nodes, np.bool_) if ground is None else ground.tunnels == 0
        agents: list[Any] = [roster.agents[number] for number in self.agents.tolist()]
        self.speeds = np.array([one.speed or 0.0 for one in agents])
        self._started = np.array([game.internals.start_of(one) for one in agents], np.float64).reshape(-1, 3)
        self._started_on = start[0, self.agents]
        self._is_begun, self._now = game.turn > 0, np.array([one.position for one in agents], np.float64).reshape(-1, 3)
        self._before = np.array([one.prev_position for one in agents], np.float64).reshape(-1, 3)
        self._turned = np.array([one.quat for one in agents], np.float64).reshape(-1, 4)
        shape = len(start), len(agents)
        self.start, self.xyz, self.before = np.zeros((3, *shape, 3))
        self.quat = np.zeros((*shape, 4))
        self.begin(np.arange(len(start)), start)

    def begin(self, games: IntArray, start: IntArray) -> None:
        """Begin some games again, their agents on these nodes, (games, agents): those that fly get those below them."""
        rows, (x, y) = start[:, self.agents], self._streets.axes
        above = np.stack((x[rows], y[rows], np.broadcast_to(self._started[:, 2], rows.shape)), axis=-1)
        self.start[games] = np.where((rows == self._started_on)[..., None], self._started, above)
        self.xyz[games] = self._now if self._is_begun else self.start[games]
        has_come = (self._before != self._now).any(axis=-1)[..., None]
        self.before[games] = np.where(has_come, self._before, self.xyz[games])
        self.quat[games] = self._turned
        start[:, self.agents] = self.below(self.start[games])

    @property
    def columns(self) -> dict[Hashable, np.ndarray[Any, Any]]:
        """What says where they are, by name, (games, …) each."""
        names = ("start", "xyz", "before", "quat")
        return {f"{name} in the air": getattr(self, name) for name in names}

    def below(self, xyz: FloatArray) -> IntArray:
        """Return the rows of the nodes below places, (…, 3)."""
        flat = xyz.reshape(-1, 3)
        ids = self._nearest(flat[:, 0], flat[:, 1]) if len(flat) else np.zeros(0, np.int64)
        return self._streets.rows(ids).reshape(xyz.shape[:-1])

    def headings(self, games: IntArray, agents: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return cos and sin of the headings of some of them, by their numbers in the roster, (looks,) each."""
        turned = self.quat[games, np.searchsorted(self.agents, agents)].tolist()
        cos, sin = np.array([kernels.yaw(quat) for quat in turned]).reshape(-1, 2).T
        return cos, sin

    def turned(self, games: IntArray, agents: IntArray) -> kernels.Quaternion:
        """Return how some of them are turned, by their numbers in the roster: four arrays, (looks,) each."""
        w, x, y, z = self.quat[games, np.searchsorted(self.agents, agents)].T
        return cast("kernels.Quaternion", (w, x, y, z))

    # -- what they decide -----------------------------------------------------------------------------------------

    def hovering(self, games: int) -> Flights:
        """Return what they do in so many games if nothing is decided."""
        shape = games, len(self.agents)
        still = np.zeros((3, *shape), np.bool_)
        return Flights(self.agents, still[0], np.zeros((*shape, 3)), still[1], np.zeros((*shape, 4)), still[2])

    def aim(
        self, flights: Flights, games: IntArray, agents: IntArray, ways: FloatArray, where: BoolArray
    ) -> list[tuple[int, int, str]]:
        """Let agents fly so far, map units, (games, agents, 3), but no farther than in one turn.

        Args:
            flights: of these games, which are written to.
            games: by their numbers in the batch.
            agents: their numbers in the roster, of which those on the ground do not count.
            ways: how far.
            where: (games, agents) which of them.

        Returns:
            The game, the agent and why, of those whose way leads too far to be said in numbers.
        """
        some = np.flatnonzero(np.isin(agents, self.agents))
        column = np.searchsorted(self.agents, agents[some])
        at, i = np.nonzero(where[:, some])
        who, wanted = column[i], ways[at, some[i]]
        here = self.xyz[games[at], who]
        far = np.minimum(_lengths(wanted), self.speeds[who])
        there = steps(here, wanted, far)
        flights.goes[at, who], flights.xyz[at, who] = True, there
        lost = []
        for row in np.flatnonzero(~np.isfinite(there).all(axis=-1)).tolist():
            flights.goes[at[row], who[row]] = False
            try:
                one_step(tuple(here[row].tolist()), wanted[row].tolist(), far[row].item())
            except BadValue as error:
                lost.append((int(at[row]), int(self.agents[who[row]]), str(error)))
        return lost

    # -- what becomes of them ---------------------------------------------------------------------------------------

    def fly(self, games: IntArray, flights: Flights, node: IntArray) -> Flights:
        """Let them do what they have decided; the nodes of all agents, (games, agents), are written to."""
        now, goes = self.xyz[games], flights.goes
        is_elsewhere = goes[..., None] & (flights.xyz != now)
        self.before[games] = np.where(goes[..., None], now, self.before[games])
        self.xyz[games] = now = np.where(goes[..., None], flights.xyz, now)
        self.quat[games] = np.where(flights.turns[..., None], flights.quat, self.quat[games])
        at, who = np.nonzero(is_elsewhere[..., :2].any(axis=-1))
        node[at, self.agents[who]] = self.below(now[at, who])
        return flights._replace(flew=is_elsewhere.any(axis=-1))

    def are_put(self, games: IntArray, flights: Flights) -> BoolArray:
        """Return which were put where they are, by flights in a turn of some games, (games, flyers)."""
        found: BoolArray = flights.goes & (flights.xyz != self.before[games]).any(axis=-1)
        return found

    def respawn(self, games: IntArray, agents: IntArray) -> None:
        """Put some back where they began, which those that came later are; agents on the ground do not count."""
        some = np.isin(agents, self.agents)
        who = games[some], np.searchsorted(self.agents, agents[some])
        back = np.where(self._is_first[who[1], None], self.start[who], self.xyz[who])
        self.before[who], self.xyz[who] = self.xyz[who], back

    def shown(self, games: IntArray, agents: IntArray, values: FloatArray, axes: slice | int) -> FloatArray:
        """Return values of agents, (games, agents, …), but of those that fly where they are on some axes."""
        some, found = np.flatnonzero(np.isin(agents, self.agents)), values.copy()
        who = np.searchsorted(self.agents, agents[some])
        found[:, some] = self.xyz[np.ix_(games, who)][..., axes]
        return found

    def put_into(self, places: FloatArray, games: IntArray) -> None:
        """Write where they are in some games into places of all agents, (games, agents, 3) or their first two."""
        places[:, self.agents] = self.xyz[games, :, : places.shape[-1]]


def steps(here: FloatArray, ways: FloatArray, far: FloatArray) -> FloatArray:
    """Return where agents at places get, (agents, 3), that go so far in some directions; see `one_step`."""
    scale = np.abs(ways).max(axis=-1, initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        parts = ways / scale[..., None]
        there = here + parts / _lengths(parts)[..., None] * far[..., None]
    return np.where((scale == 0.0)[..., None], here, there)


def _lengths(ways: FloatArray) -> FloatArray:
    # NOTE: `math.hypot` of three numbers is no sum of squares, and NumPy has none.
    return np.array(list(map(hypot, *ways.T.tolist())), np.float64)


def as_flights(given: object, what: str, shape: tuple[int, int]) -> FloatArray:
    """Return flights of so many games and agents as they were given."""
    flights = as_array(given, what, "numbers")
    if flights.shape != (*shape, 3) or flights.dtype.kind == "b" or not np.isfinite(flights).all():
        raise BadValue(
            f"{what} are finite numbers (dx, dy, dz), an array {(*shape, 3)}, not {flights.dtype} of the shape "
            f"{flights.shape}."
        )
    return flights.astype(np.float64)
