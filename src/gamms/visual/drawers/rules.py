"""Drawers of rule data: flags, territories and goals.

They read only `ctx.game.data`, because replays have no rules. Flags are `{"bases": team -> node,
"carriers": team -> name or None}`; in a cut, the name of a carrier out of view is empty. Territories are in
`data["territories"]`, as `as_text` made them.
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, islice
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadType
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.knowledge.sides import HIDDEN, find_known_flags
from gamms.text import as_text as text_of
from gamms.text import shown
from gamms.typing import IContext
from gamms.visual.appearance import AnyColor, parse_color
from gamms.visual.constants import Layer
from gamms.visual.drawers.graph import find_typical_edge_length
from gamms.visual.drawers.streets import find_distinct_roads, join_polylines
from gamms.visual.drawing import get_drawing
from gamms.visual.legend import SIGN, LegendRow, LegendRows

TERRITORIES = "territories"  # in `ctx.game.data`: name -> team -> ids of its nodes, as text
GOALS = "goals of reach"  # in `ctx.game.data`: team -> ids of its nodes, as text
_FLAGS = LegendRows("", (LegendRow(SIGN, "flag", sign="flag"), LegendRow(SIGN, "home of a flag", sign="base")))
_GOALS = LegendRows("", (LegendRow(SIGN, "goal", sign="goal"),))
_MOST = 100  # the maximum numbers of flags, territories, and their teams
_TINT = 70
_DOT_PX = 5.0
_BASE = np.array([(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)])  # a square
# half of it, of the smaller one in it while the flag is there, and the width of its line
_BASE_PX = 7.5
_AT_HOME_PX = 4.0
_BASE_LINE_PX = 2.5
_GOAL_PX = 11.0, 5.5  # radii of the rings around a goal
_GOAL_LINE_PX = 2.5
_GOAL_TICKS = np.array([[(1.0, 0.0)], [(0.0, 1.0)], [(-1.0, 0.0)], [(0.0, -1.0)]]) * ((11.0,), (16.0,))
_FEW_GOALS = 12  # with more discs of a team, each is a dot
_BAND = 0.75  # the breadth of a territory's streets, in lengths of a typical edge
FLAG_PX = 26.0  # the height of a flag
_POLE_PX = 2.5  # the width of its pole
_POLE = np.array([(0.0, 0.0), (0.0, -1.0)]) * FLAG_PX
_CLOTH = np.array([(0.0, -1.0), (0.7, -0.75), (0.0, -0.5)]) * FLAG_PX


def get_game_data(ctx: IContext) -> Mapping[Any, Any]:
    """Return the data of rules in a context; empty before a game has begun."""
    game = ctx.current_game
    return {} if game is None else game.data


def find_flags(ctx: IContext) -> dict[str, dict[str, Any]]:
    """Return all data of rules that describe flags, by key."""
    return _take_first(
        (key, kept | {"bases": _take_first(kept["bases"].items())})
        for key, kept in get_game_data(ctx).items()
        if isinstance(kept, dict) and isinstance(kept.get("bases"), dict) and isinstance(kept.get("carriers"), dict)
    )


def find_territories(ctx: IContext) -> dict[str, dict[Any, str]]:
    """Return all territories in the data of rules, by name: team -> node ids as text."""
    kept = get_game_data(ctx).get(TERRITORIES)
    if not isinstance(kept, dict):
        return {}
    return _take_first((name, _take_first(owned.items())) for name, owned in kept.items() if _is_owned(owned))


def find_goals(ctx: IContext) -> dict[Any, str]:
    """Return all goals in the data of rules: team -> node ids as text."""
    kept = get_game_data(ctx).get(GOALS)
    return _take_first(kept.items()) if isinstance(kept, dict) and _is_owned(kept) else {}


def find_teams_of_rules(ctx: IContext) -> set[str]:
    """Return the teams of flags, territories and goals, by their text."""
    owned = [flags["bases"] for flags in find_flags(ctx).values()] + [*find_territories(ctx).values(), find_goals(ctx)]
    return {text_of(team) for team in chain.from_iterable(owned)}


def _take_first(items: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """Return the first items up to the limit, because a hostile recording may have any number."""
    return dict(islice(items, _MOST))


def _is_owned(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(nodes, str) for nodes in value.values())


# -- flags --------------------------------------------------------------------------------------------------------


def render_flags(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the flags under `data["key"]` that agents carry, beside these agents; see `render_homes` for `data`."""
    visual = get_drawing(ctx)
    for color, _, carrier in _list_flags(ctx, data):
        if carrier in ctx.agent.agents:
            with visual.owned(agent=carrier):
                _draw_pennant(ctx, *visual.position_of(carrier, data.get("_alpha", 1.0)), color)


def render_homes(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the homes of the flags that a rule stores under `data["key"]`, and the flags that are there.

    `data` may have `colors` by team, and a function `is_in_view` of the name of an agent: flags that other agents carry
    are not shown.
    """
    visual = get_drawing(ctx)
    graph = ctx.graph.graph
    for color, base, carrier in _list_flags(ctx, data):
        if not graph.has_node(base):
            continue
        home = graph.get_node(base)
        visual.render_symbols([(home.x, home.y)], _BASE_PX * _BASE, color, _BASE_LINE_PX)
        if carrier != HIDDEN and carrier not in ctx.agent.agents:
            visual.render_symbols([(home.x, home.y)], _AT_HOME_PX * _BASE, color)
            _draw_pennant(ctx, home.x, home.y, color)


def _list_flags(ctx: IContext, data: dict[str, Any]) -> Iterator[tuple[AnyColor, Any, Any]]:
    """Yield the color, the home and the carrier of each flag."""
    flags = find_flags(ctx)
    if "is_in_view" in data:
        flags = find_known_flags(flags, data["is_in_view"])
    kept = flags.get(data["key"], {"bases": {}, "carriers": {}})
    for team, color in find_team_colors(ctx, kept["bases"], data.get("colors")).items():
        yield color, kept["bases"][team], kept["carriers"].get(team)


class KeyedDrawer:
    """Draws the data of rules under a key; drawers with equal arguments are equal.

    Args:
        key: the key in `ctx.game.data`.
        colors: team -> color; None: the declared colors, else the colors of the agents.
    """

    def __init__(self, key: str, colors: Mapping[Any, Any] | None = None) -> None:
        self.artist = key
        self.keywords = {"key": key, "colors": _check_colors(colors)}

    def __eq__(self, other: object) -> bool:
        """Return whether the other drawer draws the same."""
        return type(other) is type(self) and other.keywords == self.keywords

    def __hash__(self) -> int:
        return hash((type(self), self.artist))


class HomesDrawer(KeyedDrawer):
    """Draws the homes of flags, below agents; see `KeyedDrawer`."""

    layer = Layer.GOALS
    once_a_turn = True
    is_mark = True
    is_in_fog = True
    settles_in = 0

    def __call__(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw the homes of the flags."""
        render_homes(ctx, {**data, **self.keywords})


class FlagsDrawer(KeyedDrawer):
    """Draws the flags under a key of `ctx.game.data`; see `KeyedDrawer`.

    Attributes:
        beneath: draws what belongs to them but lies below agents.
    """

    layer = Layer.FLAGS
    legend = _FLAGS
    is_mark = True
    is_in_fog = True
    settles_in = 0

    def __init__(self, key: str, colors: Mapping[Any, Any] | None = None) -> None:
        super().__init__(key, colors)
        self.beneath = HomesDrawer(key, colors)

    def __call__(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw the flags that agents carry."""
        render_flags(ctx, {**data, **self.keywords})


def _check_colors(colors: object) -> Mapping[Any, Any] | None:
    """Raise BadType unless these are colors by team."""
    if colors is not None and not isinstance(colors, Mapping):
        raise BadType(f"colors must be a mapping from teams to colors, not {shown(colors)}.")
    return colors


def _draw_pennant(ctx: IContext, x: float, y: float, color: AnyColor) -> None:
    visual = get_drawing(ctx)
    visual.render_symbols([(x, y)], _POLE, color, _POLE_PX)
    visual.render_symbols([(x, y)], _CLOTH, color)


# -- territories --------------------------------------------------------------------------------------------------


def as_text(ids: IntArray) -> str:
    """Return ascending ids as a short, immutable text, for example "0..41 57"."""
    if len(ids) == 0:
        return ""
    cuts = np.flatnonzero(np.diff(ids) != 1)
    begins = ids[np.r_[0, cuts + 1]].tolist()
    ends = ids[np.r_[cuts, len(ids) - 1]].tolist()
    runs = zip(begins, ends, strict=True)
    return " ".join(f"{begin}" if begin == end else f"{begin}..{end}" for begin, end in runs)


def find_ids_in_text(text: str, ids: IntArray) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Return a mask of the ids (ids,) in a text of `as_text`; a malicious text may have any number.

    Raises:
        ValueError, OverflowError: the text was not made so.
    """
    runs = [(int(begin), int(end or begin)) for begin, _, end in (part.partition("..") for part in text.split())]
    begins, ends = np.array(sorted(runs), np.int64).reshape(-1, 2).T
    ends = np.maximum.accumulate(ends)
    place = np.searchsorted(begins, ids, side="right") - 1
    is_in = np.zeros(len(ids), bool)
    is_in[place >= 0] = ends[place[place >= 0]] >= ids[place >= 0]
    return is_in


class TerritoryDrawer(KeyedDrawer):
    """Draws territories: faint bands along the streets of a team, in its color, and discs on its nodes without streets.

    See `KeyedDrawer` for the arguments.
    """

    once_a_turn = True
    settles_in = 0
    layer = Layer.TERRITORIES
    legend = LegendRows("", (LegendRow(SIGN, "territory", sign="band"),))

    def __init__(self, key: str, colors: Mapping[Any, Any] | None = None) -> None:
        super().__init__(key, colors)
        self._name = key
        self._given = colors
        self._seen: Any = None  # the map and the territory of the cached discs
        self._places: dict[Any, _TeamStreets] = {}
        self._breadth = 0.0

    def __call__(self, ctx: IContext, data: dict[str, Any]) -> None:  # noqa: ARG002 - the arguments of every drawer
        """Draw the territory."""
        owned = find_territories(ctx).get(self._name, {})
        columns = ctx.graph.columns()
        if self._seen is None or self._seen[0] is not columns or self._seen[1] != owned:
            self._seen = (columns, owned)
            self._breadth = _BAND * find_typical_edge_length(columns)
            self._places = _find_team_streets(columns, owned)
        visual = get_drawing(ctx)
        for team, color in find_team_colors(ctx, self._places, self._given).items():
            tint = (*parse_color(color)[:3], _TINT)
            ground = self._places[team]
            visual.render_lines(ground.points, ground.offsets, tint, self._breadth, in_world=True)
            visual.render_circles(ground.alone, self._breadth / 2, tint)


class _TeamStreets(NamedTuple):
    """The streets of a team as polylines, and its nodes without streets."""

    points: FloatArray  # (points, 2)
    offsets: IntArray  # (streets + 1,)
    alone: FloatArray  # (nodes, 2)


def _find_team_streets(columns: GraphColumns, owned: Mapping[Any, str]) -> dict[Any, _TeamStreets]:
    """Return the ground of each team, without nodes that are gone."""
    streets = find_distinct_roads(columns)
    found = {}
    for team, nodes in owned.items():
        is_own = find_ids_in_text(nodes, columns.node_ids)
        rows = streets[is_own[columns.sources[streets]] & is_own[columns.targets[streets]]]
        is_alone = is_own.copy()
        is_alone[columns.sources[rows]] = False
        is_alone[columns.targets[rows]] = False
        if is_own.any():
            found[team] = _TeamStreets(*join_polylines(columns, rows), columns.xy[is_alone])
    return found


def find_team_colors(ctx: IContext, teams: Mapping[Any, Any], given: Mapping[Any, Any] | None) -> dict[Any, Any]:
    """Return a color for each team: the given color, or that of its agents if none is declared."""
    colors = get_drawing(ctx).group_colors(sorted(teams, key=str))
    return {team: (given or {}).get(team, colors[text_of(team)]) for team in sorted(teams, key=text_of)}


def render_goals(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the nodes that agents are to reach, by the rule `reach`; `data` may have `colors` by team."""
    goals = find_goals(ctx)
    columns = ctx.graph.columns()
    visual = get_drawing(ctx)
    for team, color in find_team_colors(ctx, goals, data.get("colors")).items():
        places = columns.xy[find_ids_in_text(goals[team], columns.node_ids)]
        if len(places) > _FEW_GOALS:
            visual.render_circles(places, _DOT_PX, (*parse_color(color)[:3], 2 * _TINT), in_pixels=True)
            continue
        for ink, width in ((visual.theme.background, _GOAL_LINE_PX + 2.0), (color, _GOAL_LINE_PX)):
            for radius in _GOAL_PX:
                visual.render_circles(places, radius, ink, width, in_pixels=True)
            for tick in _GOAL_TICKS:  # which tell a goal where an agent stands from an agent in view
                visual.render_symbols(places, tick, ink, width)


render_flags.__dict__["legend"] = _FLAGS
render_homes.__dict__["once_a_turn"] = True
render_goals.__dict__.update(artist="goals", layer=Layer.GOALS, legend=_GOALS, once_a_turn=True, settles_in=0)
for _drawer in (render_flags, render_homes, render_goals):
    _drawer.is_mark = True  # type: ignore[attr-defined] # no name is written upon it
    _drawer.is_in_fog = True  # type: ignore[attr-defined] # teams that see little know of it
