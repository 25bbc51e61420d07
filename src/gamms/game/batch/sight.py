"""Which agents the sensors of agents show, in all games of a view at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadValue, TooLarge, UnknownName
from gamms.game.batch.turn import GameArrays
from gamms.ir.chances import chances_at
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.sensor_engine import SensorType

SHOWING_AGENTS = {SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT}
_AT_ONCE = 1 << 20  # pairs of agents that are compared at once
_MOST_DENSE = 1 << 28  # pairs in a mask
_LEAST, _MOST = 1e-150, 1e150  # distances whose squares are neither zero nor infinite


class Seen(NamedTuple):
    """The agents that agents see, as pairs: by game, then by the agent that sees, then by the name of the other.

    Attributes:
        shape: games and agents of the view, agents of the roster.
        at: (pairs,) the game in the view.
        viewers: (pairs,) the agent of the view that sees.
        others: (pairs,) the number in the roster of the agent that is seen.
        nodes: (pairs,) the row of the node where it is seen.
    """

    shape: tuple[int, int, int]
    at: IntArray
    viewers: IntArray
    others: IntArray
    nodes: IntArray

    @property
    def mask(self) -> BoolArray:
        """Who sees whom, (games, agents of the view, agents of the roster).

        Raises:
            TooLarge: it would take more than 256 MB; the pairs do not.
        """
        if np.prod(self.shape, dtype=np.float64) > _MOST_DENSE:
            raise TooLarge(
                f"A mask of {self.shape} is too large. Use the pairs: at, viewers, others and nodes of view.seen()."
            )
        found = np.zeros(self.shape, np.bool_)
        found[self.at, self.viewers, self.others] = True
        return found

    def of(self, chosen: BoolArray) -> "Seen":
        """Return some of the pairs, (pairs,)."""
        return Seen(self.shape, self.at[chosen], self.viewers[chosen], self.others[chosen], self.nodes[chosen])


class Lookout(NamedTuple):
    """Sensors that look alike, and the agents that carry them.

    Attributes:
        look: what they show.
        agents: (agents,) numbers in the roster.
    """

    look: AgentLook
    agents: IntArray


def looks_of(agent: IAgent, names: Sequence[str]) -> list[AgentLook]:
    """Return how the sensors of an agent show agents: those of these names, or all that show agents."""
    carried, found = getattr(agent, "sensors", {}), []
    for name in names or carried:
        if name in carried and carried[name].type in SHOWING_AGENTS:
            why = why_not_seen(agent, name)
            if why is not None:
                raise BadValue(f"{why[0].upper()}{why[1:]}, and so has no array form.")
            found.append(carried[name].in_arrays(agent.name))
    return found


def why_not_seen(agent: IAgent, name: str) -> str | None:
    """Return in words why a sensor that shows agents has no array form; None: it has one, or shows no agents."""
    sensor = agent.sensors[name]
    if sensor.type not in SHOWING_AGENTS:
        return None
    form = getattr(sensor, "in_arrays", None)
    look = "is of a class of its own" if form is None else form(agent.name)
    return f"the sensor {shown(name)} of agent {shown(agent.name)}, which {look}" if isinstance(look, str) else None


def names_of(agents: Sequence[IAgent], numbers: IntArray) -> list[str]:
    """Return the names of the sensors of agents of a roster that show agents."""
    carried = [getattr(agents[number], "sensors", {}) for number in numbers.tolist()]
    return sorted({name for one in carried for name, sensor in one.items() if sensor.type in SHOWING_AGENTS})


def lookouts(agents: Sequence[IAgent], numbers: IntArray, names: Sequence[str]) -> list[Lookout]:
    """Return the sensors of agents of a roster, those that look alike together; of these names, or all.

    Raises:
        UnknownName (KeyError): no agent carries one of a name.
        BadValue: one has no array form.
    """
    unknown = [name for name in names if name not in names_of(agents, numbers)]
    if unknown:
        raise UnknownName("sensor that shows agents", unknown[0], names_of(agents, numbers))
    found: dict[AgentLook, tuple[AgentLook, list[int]]] = {}
    for number in numbers.tolist():
        for look in looks_of(agents[number], names):
            found.setdefault(look._replace(hides=None), (look, []))[1].append(number)
    return [Lookout(look, np.array(carriers)) for look, carriers in found.values()]


def seen(
    state: GameArrays,
    games: IntArray,
    agents: IntArray,
    asked: BoolArray,
    looks: Sequence[Lookout],
    *,
    with_own: bool = False,
) -> Seen:
    """Return which agents some agents see.

    Args:
        state: of the batch.
        games: (games,) numbers of games.
        agents: (agents,) numbers in the roster, ascending.
        asked: (games, agents) which of them are asked.
        looks: their sensors.
        with_own: whether sensors at fixed places show the agents that carry them.
    """
    roster, found = len(state.roster.names), [np.zeros(0, np.int64)]
    for look, carriers in looks:
        columns = np.flatnonzero(np.isin(agents, carriers))
        others = _shown(state, look)
        if not len(columns) or not len(others):
            continue
        wide = max(1, _AT_ONCE // len(others))  # agents that look at once
        games_at_once = max(1, wide // len(columns))
        for first in range(0, len(games), games_at_once):
            rows = slice(first, first + games_at_once)
            for begin in range(0, len(columns), wide):
                some = columns[begin : begin + wide]
                scene = _Scene(state, games[rows], agents[some], others)
                is_seen = scene.looked(look, asked[rows, some], is_own_hidden=look.place is None or not with_own)
                at, viewers, seen = is_seen.nonzero()
                found.append(((at + first) * len(agents) + some[viewers]) * roster + others[seen])
    keys = np.concatenate(found)
    if len(looks) > 1:
        keys = np.unique(keys)
    looking, shown_agents = np.divmod(keys, roster)
    at, viewers = np.divmod(looking, max(len(agents), 1))
    shape = len(games), len(agents), roster
    return Seen(shape, at, viewers, shown_agents, state.node[games[at], shown_agents])


def _shown(state: GameArrays, look: AgentLook) -> IntArray:
    """Return the numbers of the agents that a sensor shows where they are in view."""
    roster = state.roster
    is_shown = [(look.teams is None or team in look.teams) and team not in look.others for team in roster.teams]
    return np.flatnonzero(np.array(is_shown, np.bool_)[roster.team_of])


class _Scene:
    """Some games, agents in them that look, and others that may be seen."""

    def __init__(self, state: GameArrays, games: IntArray, agents: IntArray, others: IntArray) -> None:
        self._state, self._games, self._agents, self._others = state, games, agents, others
        self._node, self._there = state.node[np.ix_(games, agents)], state.node[np.ix_(games, others)]

    def looked(self, look: AgentLook, asked: BoolArray, *, is_own_hidden: bool) -> BoolArray:
        """Return who is seen, (games, agents, others)."""
        found: BoolArray = asked[:, :, None] & self._state.alive[np.ix_(self._games, self._others)][:, None]
        if is_own_hidden:
            columns, own = np.nonzero(self._agents[:, None] == self._others)
            found[:, columns, own] = False
        if look.radius == np.inf and look.cone is None and look.chances is None and look.hides is None:
            return found
        x, y = np.ascontiguousarray(self._state.streets.columns.xy.T)
        x0, y0 = (x[self._node], y[self._node]) if look.place is None else np.array(look.place)[:, None, None]
        dx, dy = x[self._there][:, None] - x0[..., None], y[self._there][:, None] - y0[..., None]
        found &= _within(dx, dy, look.radius)
        if look.cone is not None:
            found &= kernels.in_cone(dx, dy, *look.cone)
        if look.hides is not None:
            self._hide(found, look)
        if look.chances is not None and look.draws is not None:
            at, _, seen = places = found.nonzero()
            dx, dy = (np.broadcast_to(offsets, found.shape)[places] for offsets in (dx, dy))
            chances = chances_at(np.hypot(dx, dy), np.array(look.chances))
            found[places] = self._drawn(look.draws, at, self._others[seen]) < chances
        return found

    def _hide(self, found: BoolArray, look: AgentLook) -> None:
        """Take away whom obstacles hide."""
        at, viewers, seen = found.nonzero()
        nodes, ids, hides = len(self._state.streets.counts), self._state.streets.columns.node_ids, look.hides
        starts = self._node[at, viewers] if look.place is None else np.zeros_like(at)  # all look from one place
        pairs, which = np.unique(starts * nodes + self._there[at, seen], return_inverse=True)
        first, last = np.divmod(pairs, nodes)
        is_hidden = np.zeros(len(pairs), np.bool_)
        for run in np.split(np.arange(len(pairs)), np.flatnonzero(np.diff(first)) + 1):
            if len(run) and hides is not None:
                is_hidden[run] = hides(int(ids[first[run[0]]]), ids[last[run]])
        found[at, viewers, seen] = ~is_hidden[which]

    def _drawn(self, draws: tuple[str, str], at: IntArray, others: IntArray) -> FloatArray:
        """Return the numbers in [0, 1) that decide who is noticed."""
        state, games = self._state, self._games[at]
        purposes = state.purposes("detection", *draws)[games]
        return kernels.fraction_many(kernels.draw_bits_rows(purposes, state.roster.keys[others], state.turn[games]))


def _within(dx: FloatArray, dy: FloatArray, radius: float) -> BoolArray:
    """Return which offsets are no longer than a radius, to the bit as the index of the nodes finds them."""
    with np.errstate(over="ignore"):
        found: BoolArray = (
            dx * dx + dy * dy <= radius * radius if _LEAST < radius < _MOST else np.hypot(dx, dy) <= radius
        )
    return found
