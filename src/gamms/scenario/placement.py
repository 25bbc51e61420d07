"""Places the agents: on the node that is given for them, or on one drawn as their team says."""

from collections.abc import Callable, Mapping
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np

from gamms.context import Context
from gamms.errors import UnknownName
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import refuse_above
from gamms.scenario.documents import ScenarioError, at, joined
from gamms.scenario.spec import Agent, From, LatLon, Place, Spec, Team
from gamms.text import shown

_AGENT_BYTES = 10_000  # that plays; 5,000 measured, and what it remembers
_SENSOR_BYTES = 2_000  # 1,000 measured, and what it shows
_TRIES = 20  # as `ctx.graph.place`: when agents have to keep apart, unlucky first draws may leave no node


class Member(NamedTuple):
    """One agent of a team."""

    name: str
    team: str
    path: str  # in the scenario
    listed: Agent | None  # its entry in the list of agents; None for a counted one


def members(spec: Spec) -> dict[str, list[Member]]:
    """Return the agents of each team of a scenario, in its order: first the listed ones, then the counted.

    Raises:
        ScenarioError: a name is there twice, or there are more agents than memory is allowed for.
    """
    found: dict[str, list[Member]] = {}
    total = 0  # bytes
    for name, team in spec.teams.items():
        path = f"teams.{name}"
        with at(f"{path}.count"):
            total += team.count * (_AGENT_BYTES + _SENSOR_BYTES * len(team.sensors or ()))
            refuse_above(total, f"{shown(team.count)} agents")
        listed = [Member(one.name, name, f"{path}.agents.{number}", one) for number, one in enumerate(team.agents)]
        found[name] = listed + [Member(f"{name}_{number}", name, path, None) for number in range(team.count)]
    seen: dict[str, str] = {}
    for member in chain.from_iterable(found.values()):
        if member.name in seen:
            where = joined(member.path, "name" if member.listed else "count")
            taken = f"there is already an agent named {shown(member.name)}, in {seen[member.name]}"
            raise ScenarioError(where, f"{taken}. Choose another.")
        seen[member.name] = member.path
    return found


def place(ctx: Context, spec: Spec, agents: Mapping[str, list[Member]]) -> dict[str, int]:
    """Return the node on which each agent starts, by name.

    An agent that is placed by chance draws from a stream of its team's and its own name: how many there are in other
    teams moves no agent, unless a team keeps away `from` them, and more agents of a team do not move those before.

    Raises:
        ScenarioError: a node is unknown, or so many do not fit; it says how many did.
    """
    return _Placing(ctx, spec, agents).place()


def starts(ctx: Context, spec: Spec) -> Callable[[int], dict[str, int]]:
    """Return a function that gives what `place` gives with another seed than that of the context."""
    placing = _Placing(ctx, spec, members(spec))

    def with_seed(seed: int) -> dict[str, int]:
        own, own_stream = ctx.seed, ctx.rng_state()
        ctx.reseed(seed)
        try:
            return placing.place()
        finally:
            ctx.reseed(own, own_stream)

    return with_seed


def node_at(ctx: Context, given: Place, path: str) -> int:
    """Return the node that an id, [x, y], or a latitude and longitude means.

    Raises:
        ScenarioError: there is no such node, or the map knows no degrees.
    """
    with at(path):
        if isinstance(given, LatLon):
            return int(ctx.graph.nearest_node(lat=given.lat, lon=given.lon))
        if isinstance(given, tuple):
            return int(ctx.graph.nearest_node(*given))
        if isinstance(given, str):
            return ctx.graph.find(given).node
        if not ctx.graph.graph.has_node(given):
            raise UnknownName("node", given)
        return int(given)


class _Places:
    """Rows and positions of the nodes of a map."""

    def __init__(self, ctx: Context) -> None:
        self.ctx, columns = ctx, ctx.graph.columns()
        self.ids = columns.node_ids
        self.xy: FloatArray = columns.xy
        self._xs, self._ys = np.ascontiguousarray(columns.xy.T)

    @cached_property
    def row_of(self) -> dict[int, int]:
        return {id: row for row, id in enumerate(self.ids.tolist())}

    def are_within(self, row: int, metres: float) -> BoolArray:
        """Return which nodes are nearer than so far to a node, in a straight line."""
        dx, dy = self._xs - self._xs[row], self._ys - self._ys[row]
        squares, limit = dx * dx + dy * dy, metres * metres
        within: BoolArray = squares < limit
        border = np.flatnonzero(np.abs(squares - limit) <= 1e-9 * limit)  # where squares round otherwise than lengths
        within[border] = np.hypot(dx[border], dy[border]) < metres
        return within


class _Placing:
    """Places the agents of all teams, with one seed after the other."""

    def __init__(self, ctx: Context, spec: Spec, agents: Mapping[str, list[Member]]) -> None:
        self._map = _Places(ctx)
        self._teams = {name: _Team(self._map, name, team, agents[name]) for name, team in spec.teams.items()}

    def place(self) -> dict[str, int]:
        """Return the node on which each agent starts, by name."""
        rows = dict[str, dict[str, int]]()
        for name, team in self._teams.items():
            rows[name] = team.place(rows)
        return {agent: int(self._map.ids[row]) for of_team in rows.values() for agent, row in of_team.items()}


class _Team:
    """Places the agents of one team."""

    def __init__(self, map: _Places, name: str, spec: Team, team: list[Member]) -> None:
        self.map, self.name, self.spec, self.path = map, name, spec, f"teams.{name}"
        self.away = [spec.from_] if isinstance(spec.from_, From) else spec.from_
        self.members = team

    @cached_property
    def fixed(self) -> dict[str, int]:
        """The rows of nodes that are given, by name."""
        team, map = self.members, self.map
        given = [(one.name, one.listed.node, f"{one.path}.node") for one in team if one.listed]
        return {name: map.row_of[node_at(map.ctx, node, path)] for name, node, path in given if node is not None}

    def place(self, others: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
        """Return the row of each agent's node, by name; `others` are those of the teams before."""
        free = [member.name for member in self.members if member.name not in self.fixed]
        drawn = self._drawn(free, list(self.fixed.values()), others) if free else {}
        return {member.name: (self.fixed | drawn)[member.name] for member in self.members}

    def _drawn(self, names: list[str], taken: list[int], others: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
        allowed = self._near.copy()
        for one in self.away:
            for row in others[one.team].values():
                allowed &= ~self.map.are_within(row, one.at_least)
        best: dict[str, int] = {}
        for attempt in range(_TRIES if self.spec.apart else 1):
            drawn = self._try(names, allowed.copy(), taken, attempt)
            if len(drawn) == len(names):
                return drawn
            best = max(best, drawn, key=len)
        raise ScenarioError(self.path, self._refusal(len(best), len(names), taken))

    def _try(self, names: list[str], allowed: BoolArray, taken: list[int], attempt: int) -> dict[str, int]:
        """Draw a node for one agent after the other, of those that are left."""
        for row in taken:
            self._close(allowed, row)
        drawn: dict[str, int] = {}
        for name in names:
            rows = np.flatnonzero(allowed)
            if not len(rows):
                break
            stream = self.map.ctx.stream("scenario", "place", self.name, name, attempt)
            drawn[name] = row = int(rows[stream.integers(len(rows))])
            self._close(allowed, row)
        return drawn

    def _close(self, allowed: BoolArray, row: int) -> None:
        """Exclude a node, and those that are too near to it."""
        allowed[row] = False
        if self.spec.apart:
            allowed[self.map.are_within(row, self.spec.apart)] = False

    @cached_property
    def _near(self) -> BoolArray:
        """On which nodes the team may start, for all that other teams do, (nodes,)."""
        allowed = np.ones(len(self.map.ids), np.bool_)
        if self.spec.near is not None and self.spec.within is not None:
            centre = self.map.row_of[node_at(self.map.ctx, self.spec.near, f"{self.path}.near")]
            x, y = self.spec.near if isinstance(self.spec.near, tuple) else self.map.xy[centre]
            allowed = np.hypot(self.map.xy[:, 0] - x, self.map.xy[:, 1] - y) <= self.spec.within
        return allowed

    def _refusal(self, placed: int, wanted: int, taken: list[int]) -> str:
        words, ways_out = [f"only {placed} of {wanted} agents could be placed"], ["count"]
        if self.spec.within is not None:
            words.append(f"within {self.spec.within:g} of {_in_words(self.spec.near)}")
            ways_out.append("within")
        if self.spec.apart:
            words.append(f"at least {self.spec.apart:g} apart")
            ways_out.append("apart")
        for one in self.away:
            words.append(f"at least {one.at_least:g} from {one.team}")
            ways_out.append("from")
        others = f", beside {len(taken)} on nodes of their own" if taken else ""
        return f"{', '.join(words)}{others}. Change {' or '.join(dict.fromkeys(ways_out))}."


def _in_words(near: Place | None) -> str:
    """Return a place as a file gives it."""
    if isinstance(near, LatLon):
        return f"latitude {near.lat:g}, longitude {near.lon:g}"
    if isinstance(near, str):
        return near
    return f"[{near[0]:g}, {near[1]:g}]" if isinstance(near, tuple) else f"node {near}"
