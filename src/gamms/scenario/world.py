"""The map of a scenario, loaded once and copied into every game, and the nodes on which its agents start."""

import logging
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gamms.context import Context, create_context
from gamms.errors import UnknownName
from gamms.graph import grid
from gamms.graph.storage import MapSnapshot
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import refuse_above
from gamms.scenario.code import Library, called
from gamms.scenario.documents import ScenarioError, at, joined
from gamms.scenario.references import inside
from gamms.scenario.spec import (
    Agent,
    Code,
    From,
    Grid,
    Helsinki,
    LatLon,
    Map,
    MapFile,
    MapPlace,
    Place,
    Spec,
    Team,
    given_values,
)
from gamms.text import shown

# -- the map ---------------------------------------------------------------------------------------------------------


KINDS = ("grid", "helsinki", "file", "place", "generator")


def quiet() -> dict[str, Any]:
    """Return how the contexts of scenarios log: as the program has set, or from warnings on."""
    level = logging.getLogger("gamms").level
    return {"level": logging.getLevelName(level) if level else "WARNING"}


def kind_of(map: Map) -> str:
    """Return which of the kinds of map it is.

    Raises:
        ScenarioError: none, or several.
    """
    given = [kind for kind in KINDS if getattr(map, kind) is not None]
    if len(given) != 1:
        found = f"{' and '.join(given)} are given" if given else "nothing is given"
        raise ScenarioError("map", f"give exactly one of {', '.join(KINDS)}; {found}.")
    return given[0]


def is_data(map: Map) -> bool:
    """Whether a map can be loaded without running other people's code or asking a server."""
    place = map.place
    return map.generator is None and (place is None or (isinstance(place, MapPlace) and place.offline))


def map_file(map: Map, folder: Path | None) -> Path | None:
    """Return the map file, if it is one.

    Raises:
        ScenarioError: it is not there, or not in the folder of the scenario.
    """
    if map.file is None:
        return None
    text = map.file if isinstance(map.file, str) else map.file.path
    path = "map.file" if isinstance(map.file, str) else "map.file.path"
    file = inside(text, folder, path, "map")
    if not file.is_file():
        raise ScenarioError(path, f"there is no file {text!r} in {folder}.")
    return file


def load(map: Map, folder: Path | None, library: Library) -> MapSnapshot:
    """Load graph and obstacles, for `put`.

    Raises:
        ScenarioError: the map cannot be loaded.
    """
    kind = kind_of(map)
    with create_context(logger_config=quiet()) as ctx, at(f"map.{kind}"):
        given = getattr(map, kind)
        if kind == "grid":
            _load_grid(ctx, given)
        elif kind == "helsinki":
            _load_helsinki(ctx, given)
        elif kind == "file":
            _load_file(ctx, MapFile(path=given) if isinstance(given, str) else given, map_file(map, folder))
        elif kind == "place":
            _load_place(ctx, MapPlace(location=given) if isinstance(given, str) else given)
        else:
            _generate(ctx, Code(function=given) if isinstance(given, str) else given, library)
        if not len(ctx.graph.graph):
            raise ScenarioError(f"map.{kind}", "this map has no nodes.")
        return ctx.graph.storage.snapshot()


def put(ctx: Context, map: MapSnapshot) -> None:
    """Give a new context a loaded map, which it may change, and the visibility tables of earlier games."""
    ctx.graph.storage.copy_from(map)


def _load_grid(ctx: Context, given: Grid) -> None:
    ctx.graph.attach_networkx_graph(grid(given.height, given.width, given.spacing))


def _load_helsinki(ctx: Context, given: Helsinki) -> None:
    from gamms import osm

    osm.helsinki(ctx, **given_values(given))


def _load_file(ctx: Context, given: MapFile, file: Path | None) -> None:
    from gamms import osm

    options = given_values(given)
    del options["path"]
    has_buildings = options.pop("buildings")
    if "osm_type" in options:
        options["osm_type"] = osm.OSMType[options["osm_type"].upper()]
    assert file is not None  # noqa: S101 - asked only of map files
    if file.suffix == ".gamms" or osm.is_geojson(file):
        for option in [*options] if file.suffix == ".gamms" else {"osm_type"}.intersection(options):
            raise ScenarioError(f"map.file.{option}", f"{file.name} is no OpenStreetMap file, which this is for.")
        if has_buildings:
            raise ScenarioError("map.file.buildings", f"{file.name} is no OpenStreetMap file, which this is for.")
    if file.suffix == ".gamms":
        ctx.graph.load(file)
    elif osm.is_geojson(file):
        ctx.graph.attach_networkx_graph(osm.graph_from_geojson(file, **options))
    else:
        ctx.graph.attach_networkx_graph(osm.graph_from_file(file, **options))
    if has_buildings:
        ctx.graph.add_obstacles(osm.obstacle_from_file(file, crs=ctx.graph.crs))


def _load_place(ctx: Context, given: MapPlace) -> None:
    from gamms import osm

    options = given_values(given)
    location, has_buildings = options.pop("location"), options.pop("buildings")
    if "osm_type" in options:
        options["osm_type"] = osm.OSMType[options["osm_type"].upper()]
    ctx.graph.attach_networkx_graph(osm.create_osm_graph(location, **options))
    if has_buildings:
        ctx.graph.add_obstacles(osm.obstacle_from_osm(location, crs=ctx.graph.crs, offline=given.offline))


def _generate(ctx: Context, given: Code, library: Library) -> None:
    """Attach the networkx graph that a function makes."""
    made = called(library.get(given.function, "map.generator"), given.with_, (), "map.generator")
    if not callable(getattr(made, "is_directed", None)):
        raise ScenarioError("map.generator", f"{given.function} gives {shown(made)}, which is not a networkx graph.")
    ctx.graph.attach_networkx_graph(made)


# -- where agents start ----------------------------------------------------------------------------------------------


_AGENT_BYTES = 10_000  # that plays; 5,000 measured, and what it remembers
_SENSOR_BYTES = 2_000  # 1,000 measured, and what it shows
_TRIES = 20  # as `ctx.graph.place`: when agents have to keep apart, an unlucky beginning may leave no room


class Member(NamedTuple):
    """One agent of a team."""

    name: str
    team: str
    path: str  # where in the scenario it stands
    own: Agent | None  # its own entry; None for one of the counted


def members(spec: Spec) -> list[Member]:
    """Return all agents of a scenario, in its order: of each team the listed ones, then the counted.

    Raises:
        ScenarioError: a name is there twice, or there are more agents than the allowed memory.
    """
    found: list[Member] = []
    total = 0  # bytes
    for team, given in spec.teams.items():
        path = f"teams.{team}"
        with at(f"{path}.count"):
            total += given.count * (_AGENT_BYTES + _SENSOR_BYTES * len(given.sensors or ()))
            refuse_above(total, f"{shown(given.count)} agents")
        listed = [
            Member(agent.name, team, f"{path}.agents.{number}", agent) for number, agent in enumerate(given.agents)
        ]
        counted = [Member(f"{team}_{number}", team, path, None) for number in range(given.count)]
        found += [*listed, *counted]
    seen: dict[str, Member] = {}
    for member in found:
        if member.name in seen:
            where = joined(member.path, "name" if member.own else "count")
            raise ScenarioError(
                where,
                f"there is already an agent named {shown(member.name)}, in {seen[member.name].path}. Choose another.",
            )
        seen[member.name] = member
    return found


def place(ctx: Context, spec: Spec, agents: Iterable[Member]) -> dict[str, int]:
    """Return the node on which each agent starts, by name.

    An agent that is placed at random draws from a stream of its team's and its own name: agents of other teams do not
    change its place, unless its team keeps away `from` them, and more agents of a team do not change those before.

    Raises:
        ScenarioError: a node is unknown, or so many do not fit; the message says how many did.
    """
    map = _Places(ctx)
    nodes: dict[str, int] = {}
    by_team: dict[str, list[Member]] = {team: [] for team in spec.teams}
    for member in agents:
        by_team[member.team].append(member)
    rows: dict[str, IntArray] = {}
    for name, team in spec.teams.items():
        placed = _Team(map, name, team, rows).place(by_team[name])
        rows[name] = np.array(list(placed.values()), np.int64)
        nodes.update((agent, map.ids[row]) for agent, row in placed.items())
    return nodes


def node_at(ctx: Context, given: Place, path: str) -> int:
    """Return the node that an id, [x, y] or a latitude and longitude means.

    Raises:
        ScenarioError: there is no such node, or the map has no degrees.
    """
    with at(path):
        if isinstance(given, LatLon):
            return int(ctx.graph.nearest_node(lat=given.lat, lon=given.lon))
        if isinstance(given, (tuple, list)):
            return int(ctx.graph.nearest_node(*given))
        if not ctx.graph.graph.has_node(given):
            raise UnknownName("node", given)
        return int(given)


class _Places:
    """The nodes of the map by row."""

    def __init__(self, ctx: Context) -> None:
        self.ctx, columns = ctx, ctx.graph.columns()
        self.ids: list[int] = columns.node_ids.tolist()
        self.xy: FloatArray = columns.xy
        self._row_of: dict[int, int] | None = None

    def row_of(self, node: int) -> int:
        if self._row_of is None:
            self._row_of = {id: row for row, id in enumerate(self.ids)}
        return self._row_of[node]

    def metres(self, x: float, y: float) -> FloatArray:
        """Return how far all nodes are from a place, in a straight line."""
        return np.hypot(self.xy[:, 0] - x, self.xy[:, 1] - y)


class _Team:
    """How the agents of one team are placed."""

    def __init__(self, map: _Places, name: str, spec: Team, others: Mapping[str, IntArray]) -> None:
        self.map, self.name, self.spec, self.path = map, name, spec, f"teams.{name}"
        self.away = [spec.from_] if isinstance(spec.from_, From) else spec.from_
        self.others = others

    def place(self, team: list[Member]) -> dict[str, int]:
        """Return the row of each agent's node, by name."""
        fixed = {member.name: self._fixed(member) for member in team if member.own and member.own.node is not None}
        free = [member.name for member in team if member.name not in fixed]
        drawn = self._drawn(free, list(fixed.values())) if free else {}
        return {member.name: (fixed | drawn)[member.name] for member in team}

    def _fixed(self, member: Member) -> int:
        given = member.own.node if member.own else None
        assert given is not None  # noqa: S101 - asked only of agents with a node
        return self.map.row_of(node_at(self.map.ctx, given, f"{member.path}.node"))

    def _drawn(self, names: list[str], taken: list[int]) -> dict[str, int]:
        allowed = self._allowed()
        best: dict[str, int] = {}
        for attempt in range(_TRIES if self.spec.apart else 1):
            drawn = self._try(names, allowed.copy(), taken, attempt)
            if len(drawn) == len(names):
                return drawn
            best = max(best, drawn, key=len)
        raise ScenarioError(self.path, self._refusal(len(best), len(names), taken))

    def _try(self, names: list[str], allowed: BoolArray, taken: list[int], attempt: int) -> dict[str, int]:
        """Draw a free node for one agent after the other."""
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
        """Let no other agent start on this node, or too near to it."""
        allowed[row] = False
        if self.spec.apart:
            allowed[self.map.metres(*self.map.xy[row]) < self.spec.apart] = False

    def _allowed(self) -> BoolArray:
        """Return on which nodes the team may start (nodes,)."""
        allowed = np.ones(len(self.map.ids), np.bool_)
        if self.spec.near is not None and self.spec.within is not None:
            centre = self.map.row_of(node_at(self.map.ctx, self.spec.near, f"{self.path}.near"))
            x, y = self.spec.near if isinstance(self.spec.near, tuple) else self.map.xy[centre]
            allowed &= self.map.metres(x, y) <= self.spec.within
        for one in self.away:
            for row in self.others[one.team].tolist():
                allowed &= self.map.metres(*self.map.xy[row]) >= one.at_least
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
    """Return a place as a file has it."""
    if isinstance(near, LatLon):
        return f"latitude {near.lat:g}, longitude {near.lon:g}"
    return f"[{near[0]:g}, {near[1]:g}]" if isinstance(near, tuple) else f"node {near}"
