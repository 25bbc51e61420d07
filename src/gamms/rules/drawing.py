"""How rules are drawn: flags, territories, in the colours of the teams. A drawer only reads."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gamms.typing.game import Rule
from gamms.visual.color import rgba, team_colors
from gamms.visual.primitives import primitives_of

_TINT, _DOT_PX = 60, 5.0
_FLAG = 0.03  # the height of a flag, in widths of the map


def equipped(rule: Rule, **extras: Any) -> Rule:
    """A rule with what `ctx.game.add` looks for: `prepare(ctx)`, called at once, and `drawer(ctx, data)`."""
    if "drawer" in extras:
        extras["drawer"].once_a_turn = True  # what rules draw does not glide
    rule.__dict__.update(extras)
    return rule


def draw_flags(ctx: Any, flags: Mapping[Any, int], colors: Mapping[Any, Any] | None) -> None:
    """A pennant in the colour of each team on the node where its flag is."""
    height, visual = _FLAG * _extent(ctx), primitives_of(ctx)
    for team, color in _colors(ctx, flags, colors).items():
        node = ctx.graph.graph.get_node(flags[team])
        x, y, top = node.x, node.y, node.y + height
        visual.render_circles([(x, y)], _DOT_PX, color, in_pixels=True)
        visual.render_lines([(x, y), (x, top)], [0, 2], color, 2.0)
        visual.render_polygon([(x, top), (x + 0.7 * height, top - 0.25 * height), (x, top - 0.5 * height)], color)


class TerritoryDrawer:
    """A faint disc in the colour of its team on every node, as large as its streets are long.

    Args:
        territory: node -> team; it must not change.
        colors: team -> colour; None: those of the agents where nothing else is declared.
    """

    def __init__(self, territory: Mapping[int, Any], colors: Mapping[Any, Any] | None) -> None:
        self._territory, self._given = territory, colors
        self._columns: Any = None  # of the map for which the discs were worked out
        self._places: dict[Any, Any] = {}  # team -> (nodes, 2)
        self._radius = 0.0

    def __call__(self, ctx: Any, data: Any) -> None:  # noqa: ARG002 - the arguments of every drawer
        """Draw it."""
        columns = ctx.graph.columns()
        if columns is not self._columns:
            self._columns, self._radius, self._places = columns, 0.5 * _street(ctx), self._found(ctx, columns)
        for team, color in _colors(ctx, self._places, self._given).items():
            primitives_of(ctx).render_circles(self._places[team], self._radius, (*rgba(color)[:3], _TINT))

    def _found(self, ctx: Any, columns: Any) -> dict[Any, Any]:
        """Where the nodes of each team are, without those that are gone."""
        owned: dict[Any, list[int]] = {}
        for node, team in self._territory.items():
            if team is not None:
                owned.setdefault(team, []).append(node)
        left = {team: np.array(nodes)[np.isin(nodes, columns.node_ids)] for team, nodes in owned.items()}
        return {team: ctx.graph.graph.positions(nodes) for team, nodes in left.items() if len(nodes)}


def _colors(ctx: Any, teams: Mapping[Any, Any], given: Mapping[Any, Any] | None) -> dict[Any, Any]:
    """A colour for each team: the given one, or what its agents have where nothing is declared."""
    met = (agent.name if agent.team is None else agent.team for agent in ctx.agent.create_iter())
    usual = team_colors([*met, *sorted(teams, key=str)])
    return {team: (given or {}).get(team, usual[str(team)]) for team in sorted(teams, key=str)}


def _extent(ctx: Any) -> float:
    xy = ctx.graph.columns().xy
    return float(np.ptp(xy, axis=0).max()) if len(xy) else 0.0


def _street(ctx: Any) -> float:
    """The usual length of an edge, map units; of a map without any, of the map."""
    columns = ctx.graph.columns()
    ways = columns.xy[columns.targets] - columns.xy[columns.sources]
    return float(np.median(np.hypot(ways[:, 0], ways[:, 1]))) if len(ways) else _extent(ctx)
