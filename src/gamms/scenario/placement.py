"""Place the agents: on their given nodes, or on nodes drawn under the constraints of their team."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_member
from gamms.context import Context
from gamms.errors import BadValue, UnknownName
from gamms.ir.graph import IntArray, as_mode, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.limits import refuse_above
from gamms.scenario.documents import ScenarioError, join_path, locate_errors
from gamms.scenario.spec import Agent, LatLon, ModeAttribute, Place, Spec, Team, TeamDistance
from gamms.text import shown
from gamms.typing.agent_engine import AgentType

_AGENT_BYTES = 10_000  # of a playing agent with its memory; 5,000 measured
_SENSOR_BYTES = 2_000  # 1,000 measured, plus its data
_TRIES = 20  # as `ctx.graph.place`: if agents have to keep apart, unlucky first draws may leave no node
_AT_ONCE = 1 << 24  # nodes over all games that are processed together
_MOST_BYTES = 1 << 26  # of the cache of distant nodes
_BITS = np.arange(16, dtype=np.uint16)

WordArray = np.ndarray[tuple[int, ...], np.dtype[np.uint16]]  # sets of nodes, 16 bits in each word


class TeamMember(NamedTuple):
    """One agent of a team, with its place in the scenario."""

    name: str
    team: str
    path: str  # its place in the scenario
    listed: Agent | None  # its entry in the list of agents; None for a counted one


def list_members(spec: Spec) -> dict[str, list[TeamMember]]:
    """Return the agents of each team of a scenario, in order: first the listed ones, then the counted.

    Raises:
        ScenarioError: a name is repeated, or the agents would take more memory than allowed.
    """
    found: dict[str, list[TeamMember]] = {}
    total = 0  # bytes
    for name, team in spec.teams.items():
        path = f"teams.{name}"
        with locate_errors(f"{path}.count"):
            total += team.count * (_AGENT_BYTES + _SENSOR_BYTES * len(team.sensors or ()))
            refuse_above(total, f"{shown(team.count)} agents")
        listed = [TeamMember(one.name, name, f"{path}.agents.{number}", one) for number, one in enumerate(team.agents)]
        found[name] = listed + [TeamMember(f"{name}_{number}", name, path, None) for number in range(team.count)]
    seen: dict[str, str] = {}
    for member in chain.from_iterable(found.values()):
        if member.name in seen:
            where = join_path(member.path, "name" if member.listed else "count")
            taken = f"there is already an agent named {shown(member.name)}, in {seen[member.name]}"
            raise ScenarioError(where, f"{taken}. Choose another.")
        seen[member.name] = member.path
    return found


class AgentPlacement:
    """Places the agents of a scenario on the map of a context, for one seed or many.

    A randomly placed agent draws from a stream of its team's and its own name. So the number of agents in other teams
    changes nothing, unless a team keeps away `from` them, and further agents of a team do not move earlier ones.

    Args:
        ctx: the context.
        spec: the scenario.
        agents: the agents of each team; see `list_members`.

    Attributes:
        map: the nodes.
    """

    def __init__(self, ctx: Context, spec: Spec, agents: Mapping[str, list[TeamMember]]) -> None:
        self.map = NodePlaces(ctx)
        self._teams = {name: _TeamPlacement(self.map, name, team, agents[name]) for name, team in spec.teams.items()}

    def place(self, seeds: Sequence[int]) -> dict[str, IntArray]:
        """Return the starting nodes of the agents for these seeds: name -> (seeds,) ids.

        Raises:
            ScenarioError: a node is unknown, or not all agents fit; the message tells how many did.
        """
        if not len(seeds):
            members = chain.from_iterable(team.members for team in self._teams.values())
            return {one.name: np.empty(0, np.int64) for one in members}
        size = max(1, _AT_ONCE // max(1, len(self.map.ids)))
        parts = [self._place_rows(seeds[first : first + size]) for first in range(0, len(seeds), size)]
        ids = {name: self.map.ids[np.concatenate([part[name] for part in parts])] for name in self._teams}
        found: dict[str, IntArray] = {}
        for name, team in self._teams.items():
            found.update({one.name: ids[name][:, column] for column, one in enumerate(team.members)})
        return found

    def _place_rows(self, seeds: Sequence[int]) -> dict[str, IntArray]:
        rows = dict[str, IntArray]()
        for name, team in self._teams.items():
            rows[name] = team.place(seeds, rows)
        return rows


def is_flying(given: str | None) -> bool:
    """Return whether this names the type of aerial agents, in upper or lower case."""
    return as_member(AgentType, given) is AgentType.AERIAL


def get_mode(team: Team, agent: Agent | None) -> str | None:
    """Return the mode of an agent, its own or that of its team; None: it may use all edges, or it flies."""
    given = team.mode if agent is None or agent.mode is None else agent.mode
    if is_flying((agent and agent.type) or team.type):
        return None
    return as_mode({"attribute": given.attribute, "turns": given.turns} if isinstance(given, ModeAttribute) else given)


def find_node(ctx: Context, given: Place, path: str) -> int:
    """Return the node for an id, [x, y], a street, or a latitude and longitude.

    Raises:
        ScenarioError: the node does not exist, or the map has no degrees.
    """
    with locate_errors(path):
        if isinstance(given, LatLon):
            return int(ctx.graph.nearest_node(lat=given.lat, lon=given.lon))
        if isinstance(given, tuple):
            return int(ctx.graph.nearest_node(*given))
        if isinstance(given, str):
            try:
                return ctx.graph.find(given).node
            except BadValue as error:
                raise BadValue(f"{error} A place may also be the id of a node, [x, y] or {{lat: …, lon: …}}.") from None
        if not ctx.graph.graph.has_node(given):
            raise UnknownName("node", given, ctx.graph.columns().node_ids.tolist())
        return int(given)


class NodePlaces:
    """Rows and positions of the nodes of a map, and sets of nodes as bits.

    Attributes:
        columns: the columns of the graph.
    """

    def __init__(self, ctx: Context) -> None:
        self.ctx = ctx
        self.columns = ctx.graph.columns()
        self.ids = self.columns.node_ids
        self.xy = self.columns.xy
        self._xs, self._ys = np.ascontiguousarray(self.xy.T)
        self._far: dict[tuple[int, float], WordArray] = {}

    @cached_property
    def row_of(self) -> dict[int, int]:
        """The row of each node, by its id."""
        return {id: row for row, id in enumerate(self.ids.tolist())}

    def can_leave(self, mode: str) -> BoolArray:
        """Return a mask (nodes,) of the nodes from which agents of a mode can move."""
        offsets, _ = self.ctx.graph.routes.select_mode(split_mode(mode)[0]).routes.neighborhoods()
        found: BoolArray = np.diff(offsets) > 1  # besides the node itself
        return found

    def find_far(self, rows: IntArray, metres: float) -> WordArray:
        """Return sets of nodes at a straight-line distance of at least `metres` from each row, (rows, words)."""
        keys = [(row, metres) for row in rows.tolist()]
        if (len(self._far) + len(keys)) * len(self.ids) // 8 > _MOST_BYTES:
            self._far.clear()
        for key in keys:
            if key not in self._far:
                self._far[key] = as_words(~self._are_within(*key))
        return np.array([self._far[key] for key in keys])

    def _are_within(self, row: int, metres: float) -> BoolArray:
        """Return a mask (nodes,) of the nodes nearer than `metres` to a row, in a straight line."""
        dx = self._xs - self._xs[row]
        dy = self._ys - self._ys[row]
        squares = dx * dx + dy * dy
        limit = metres * metres
        within: BoolArray = squares < limit
        border = np.flatnonzero(np.abs(squares - limit) <= 1e-9 * limit)  # where squares round differently from lengths
        within[border] = np.hypot(dx[border], dy[border]) < metres
        return within


def as_words(are_in: BoolArray) -> WordArray:
    """Return a boolean mask of nodes, (nodes,), as bits, (words,)."""
    words = np.zeros(-(-len(are_in) // 16), "<u2")
    words.view(np.uint8)[: -(-len(are_in) // 8)] = np.packbits(are_in, bitorder="little")
    return words.astype(np.uint16, copy=False)


class _TeamPlacement:
    """Places the agents of one team."""

    def __init__(self, map: NodePlaces, name: str, spec: Team, team: list[TeamMember]) -> None:
        self.map = map
        self.name = name
        self.spec = spec
        self.path = f"teams.{name}"
        self.away = [spec.from_] if isinstance(spec.from_, TeamDistance) else spec.from_
        self.members = team

    @cached_property
    def fixed(self) -> dict[int, int]:
        """The rows of given nodes, by the number of the member."""
        given = [(number, one.listed.node, f"{one.path}.node") for number, one in enumerate(self.members) if one.listed]
        map = self.map
        return {number: map.row_of[find_node(map.ctx, node, path)] for number, node, path in given if node is not None}

    def place(self, seeds: Sequence[int], others: Mapping[str, IntArray]) -> IntArray:
        """Return the rows of this team's starting nodes, (seeds, agents); `others` has the rows of earlier teams."""
        rows = np.full((len(seeds), len(self.members)), -1)
        rows[:, list(self.fixed)] = list(self.fixed.values())
        free = [number for number in range(len(self.members)) if number not in self.fixed]
        if not free:
            return rows
        if not (self.spec.apart or self.away):
            if len(free) > len(self._free_rows):
                raise ScenarioError(self.path, self._describe_refusal(len(self._free_rows), len(free)))
            rows[:, free] = kernels.draw_places(self._make_keys(seeds, free, 0), self._free_rows)
            return rows
        allowed = np.repeat(self._near[None], len(seeds), axis=0)
        for one in self.away:
            for of_agent in others[one.team].T:
                allowed &= self.map.find_far(of_agent, one.at_least)
        left = np.arange(len(seeds))
        most = np.zeros(len(seeds), np.int64)
        for attempt in range(_TRIES if self.spec.apart else 1):
            drawn = self._try([seeds[number] for number in left.tolist()], free, allowed[left], attempt)
            rows[left[:, None], free] = drawn
            placed = (drawn >= 0).sum(axis=1)
            most[left] = np.maximum(most[left], placed)
            left = left[placed < len(free)]
            if not len(left):
                return rows
        raise ScenarioError(self.path, self._describe_refusal(int(most[left[0]]), len(free), seeds[left[0]]))

    def _try(self, seeds: Sequence[int], free: list[int], allowed: WordArray, attempt: int) -> IntArray:
        """Draw a remaining node for one agent after the other, (seeds, agents); -1: no node remained."""
        drawn = np.full((len(seeds), len(free)), -1)
        at = np.arange(len(seeds))
        for row in self.fixed.values():
            self._close(allowed, np.full(len(seeds), row))
        words = kernels.stream_words(self._make_keys(seeds, free, attempt))
        for column in range(len(free)):
            counts = _COUNTS[allowed]
            is_left = counts.any(axis=1)
            at = at[is_left]
            allowed = allowed[is_left]
            counts = counts[is_left]
            if not len(at):
                break
            rows = _draw_rows(words[at, column], allowed, counts)
            drawn[at, column] = rows
            self._close(allowed, rows)
        return drawn

    def _make_keys(self, seeds: Sequence[int], free: list[int], attempt: int) -> BitArray:
        """Return the keys of the streams of the agents' draws, (seeds, agents, 2)."""
        names = [("scenario", "place", self.name, self.members[number].name, attempt) for number in free]
        return kernels.stream_keys(seeds, names)

    def _close(self, allowed: WordArray, rows: IntArray) -> None:
        """Remove a node from each set, and nodes too near to it."""
        allowed[np.arange(len(rows)), rows >> 4] &= ~(np.uint16(1) << (rows & 15).astype(np.uint16))
        if self.spec.apart:
            allowed &= self.map.find_far(rows, self.spec.apart)

    @cached_property
    def _free_rows(self) -> IntArray:
        """The rows of nodes where the team may start and that are not given to one of its agents, ascending."""
        near = np.unpackbits(self._near.astype("<u2", copy=False).view(np.uint8), bitorder="little")
        near[list(self.fixed.values())] = 0
        return np.flatnonzero(near)

    @cached_property
    def _modes(self) -> dict[str, str]:
        """The modes of the members that are placed at random, each with the path of the first that has it."""
        found: dict[str, str] = {}
        for number, one in enumerate(self.members):
            mode = get_mode(self.spec, one.listed)
            if mode is not None and number not in self.fixed:
                is_own = one.listed is not None and one.listed.mode is not None
                found.setdefault(mode, join_path(one.path if is_own else self.path, "mode"))
        return found

    @cached_property
    def _near(self) -> WordArray:
        """The set of nodes where the team may start, before other teams are considered, (words,)."""
        allowed = np.ones(len(self.map.ids), np.bool_)
        for mode, path in self._modes.items():
            with locate_errors(path):
                allowed &= self.map.can_leave(mode)
        if self.spec.near is not None and self.spec.within is not None:
            centre = self.map.row_of[find_node(self.map.ctx, self.spec.near, f"{self.path}.near")]
            x, y = self.spec.near if isinstance(self.spec.near, tuple) else self.map.xy[centre]
            allowed &= np.hypot(self.map.xy[:, 0] - x, self.map.xy[:, 1] - y) <= self.spec.within
        return as_words(allowed)

    def _describe_refusal(self, placed: int, wanted: int, seed: int | None = None) -> str:
        words = [f"only {placed} of {wanted} agents could be placed"]
        ways_out = ["count"]
        if self._modes:
            words.append(f"on nodes that mode {next(iter(self._modes))} can leave")
            ways_out.append("mode")
        if self.spec.within is not None:
            words.append(f"within {self.spec.within:g} of {_describe_place(self.spec.near)}")
            ways_out.append("within")
        if self.spec.apart:
            words.append(f"at least {self.spec.apart:g} apart")
            ways_out.append("apart")
        for one in self.away:
            words.append(f"at least {one.at_least:g} from {one.team}")
            ways_out.append("from")
        if seed is not None:
            words.append(f"with the seed {seed}")
        others = f", beside {len(self.fixed)} on nodes of their own" if self.fixed else ""
        return f"{', '.join(words)}{others}. Change {' or '.join(dict.fromkeys(ways_out))}."


_COUNTS = np.unpackbits(np.arange(1 << 16, dtype=np.uint16).view(np.uint8)).reshape(-1, 16).sum(axis=1, dtype=np.uint8)


def _draw_rows(words: BitArray, sets: WordArray, counts: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> IntArray:
    """Return a row drawn from each set of nodes, (sets,).

    Args:
        words: (sets, 8) random words of the drawing streams.
        sets: (sets, words) the sets of nodes.
        counts: (sets, words) the number of nodes in each word.
    """
    ends = counts.cumsum(axis=1, dtype=np.int64)
    at = np.arange(len(sets))
    number = kernels.draw_from_many_words(words, ends[:, -1])[:, None]
    word = (ends <= number).sum(axis=1)
    before = ends[at, word] - counts[at, word]
    bits = sets[at, word][:, None] >> _BITS & np.uint16(1)
    rows: IntArray = word * 16 + (before[:, None] + bits.cumsum(axis=1, dtype=np.int64) <= number).sum(axis=1)
    return rows


def _describe_place(near: Place | None) -> str:
    """Return a place in the words of a file."""
    if isinstance(near, LatLon):
        return f"latitude {near.lat:g}, longitude {near.lon:g}"
    if isinstance(near, str):
        return near
    return f"[{near[0]:g}, {near[1]:g}]" if isinstance(near, tuple) else f"node {near}"
