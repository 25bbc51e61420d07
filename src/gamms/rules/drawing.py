"""How rules are drawn: flags, territories, tags, in the colours of the teams. A drawer only reads.

What has to be known for that is in `ctx.game.data`, so that a recording holds it: `add_recorded` draws a replay like
the game itself.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gamms.ir.graph import IntArray
from gamms.typing.game import Rule
from gamms.visual.color import rgba
from gamms.visual.drawers.tags import render_tags
from gamms.visual.drawers.values import usual_edge
from gamms.visual.primitives import primitives_of
from gamms.visual.sides import side_colors

TERRITORIES = "territories"  # in `ctx.game.data`: name of the fact -> what `packed` made of it
_TINT, _DOT_PX, _BASE_PX = 60, 5.0, 8.0
_FLAG = 0.03  # the height of a flag, in widths of what is seen
FLAG_LAYER = 22  # above the agents, who carry them
_TERRITORY_LAYER, _TAG_LAYER = 12, 25


def equipped(rule: Rule, artist: str = "", layer: int = _TERRITORY_LAYER, **extras: Any) -> Rule:
    """A rule with what `ctx.game.add` looks for: `prepare(ctx)`, called at once, and `drawer(ctx, data)`.

    Args:
        rule: the rule.
        artist: the name under which it is drawn.
        layer: where.
        extras: `prepare` and `drawer`.
    """
    if "drawer" in extras and artist:
        extras["drawer"].artist, extras["drawer"].layer = artist, layer
    rule.__dict__.update(extras)
    return rule


# -- flags --------------------------------------------------------------------------------------------------------


def flags_drawer(key: str, colors: Mapping[Any, Any] | None) -> Any:
    """A drawer of what `capture_flag` keeps as `ctx.game.data[key]`."""

    def drawer(ctx: Any, data: Any) -> None:
        kept = ctx.game.data.get(key, {})
        draw_flags(ctx, kept.get("bases", {}), kept.get("carriers", {}), colors, data.get("_alpha", 1.0))

    return drawer


def draw_flags(
    ctx: Any, bases: Mapping[Any, int], carriers: Mapping[Any, Any], colors: Mapping[Any, Any] | None, share: float
) -> None:
    """A pennant in the colour of each team: on its base, or with who carries it, and then a ring on the base."""
    visual, graph = primitives_of(ctx), ctx.graph.graph
    height = _FLAG * visual.extent()
    for team, color in _colors(ctx, bases, colors).items():
        is_carried, is_there = carriers.get(team) in ctx.agent.agents, graph.has_node(bases[team])
        if is_there:
            base = graph.get_node(bases[team])
            visual.render_circles([(base.x, base.y)], _BASE_PX, color, 2.5, in_pixels=True)
        if not (is_carried or is_there):
            continue
        x, y = visual.position_of(carriers[team], share) if is_carried else (base.x, base.y)
        top = y + height
        visual.render_circles([(x, y)], _DOT_PX, color, in_pixels=True)
        visual.render_lines([(x, y), (x, top)], [0, 2], color, 2.5)
        visual.render_polygon([(x, top), (x + 0.7 * height, top - 0.25 * height), (x, top - 0.5 * height)], color)


# -- territories --------------------------------------------------------------------------------------------------


def packed(territory: Mapping[int, Any]) -> dict[Any, str]:
    """A territory as the ids of each team's nodes, as text such as "0..41 57": it is short, and nobody need copy it."""
    owned: dict[Any, list[int]] = {}
    for node, team in territory.items():
        if team is not None:
            owned.setdefault(team, []).append(node)
    return {team: _as_text(np.array(sorted(nodes), np.int64)) for team, nodes in owned.items()}


def _as_text(ids: IntArray) -> str:
    cuts = np.flatnonzero(np.diff(ids) != 1)
    begins, ends = ids[np.r_[0, cuts + 1]].tolist(), ids[np.r_[cuts, len(ids) - 1]].tolist()
    runs = zip(begins, ends, strict=True)
    return " ".join(f"{begin}" if begin == end else f"{begin}..{end}" for begin, end in runs)


def _from_text(text: str) -> list[int]:
    runs = (part.partition("..") for part in text.split())
    return [id for begin, _, end in runs for id in range(int(begin), int(end or begin) + 1)]


class TerritoryDrawer:
    """A faint disc in the colour of its team on every node, as large as its streets are long.

    Args:
        name: of the fact, whose nodes are in `ctx.game.data`.
        colors: team -> colour; None: those of the agents where nothing else is declared.
    """

    once_a_turn = True

    def __init__(self, name: str, colors: Mapping[Any, Any] | None) -> None:
        self.artist, self.layer = name, _TERRITORY_LAYER
        self._name, self._given = name, colors
        self._seen: Any = None  # the map and the territory for which the discs were worked out
        self._places: dict[Any, Any] = {}  # team -> (nodes, 2)
        self._radius = 0.0

    def __call__(self, ctx: Any, data: Any) -> None:  # noqa: ARG002 - the arguments of every drawer
        """Draw it."""
        owned = ctx.game.data.get(TERRITORIES, {}).get(self._name, {})
        columns = ctx.graph.columns()
        if self._seen is None or self._seen[0] is not columns or self._seen[1] != owned:
            self._seen, self._radius, self._places = (
                (columns, owned),
                0.5 * usual_edge(columns),
                _places(ctx, columns, owned),
            )
        for team, color in _colors(ctx, self._places, self._given).items():
            primitives_of(ctx).render_circles(self._places[team], self._radius, (*rgba(color)[:3], _TINT))


def _places(ctx: Any, columns: Any, owned: Mapping[Any, str]) -> dict[Any, Any]:
    """Where the nodes of each team are, without those that are gone."""
    ids = {team: np.array(_from_text(nodes), np.int64) for team, nodes in owned.items()}
    left = {team: nodes[np.isin(nodes, columns.node_ids)].tolist() for team, nodes in ids.items()}
    return {team: ctx.graph.graph.positions(nodes) for team, nodes in left.items() if nodes}


# -- tags, and replays --------------------------------------------------------------------------------------------


def with_tags(rule: Rule) -> Rule:
    """A rule that tags, with the marks of its tags."""
    rule.__dict__["drawer"] = _tags_drawer
    return rule


def _tags_drawer(ctx: Any, data: Any) -> None:
    render_tags(ctx, data)


_tags_drawer.__dict__.update(artist="tags", layer=_TAG_LAYER, once_a_turn=True)


def add_recorded(ctx: Any) -> None:
    """Let flags and territories be drawn that `ctx.game.data` tells of: a replay has the data, but no rules.

    It does nothing for those that are drawn already; call it again when more has been replayed.
    """
    for name in ctx.game.data.get(TERRITORIES, {}):
        ctx.visual.propose_artist(name, {"drawer": TerritoryDrawer(name, None), "layer": _TERRITORY_LAYER})
    for key, kept in ctx.game.data.items():
        if isinstance(kept, dict) and {"bases", "carriers"} <= kept.keys():
            ctx.visual.propose_artist(key, {"drawer": flags_drawer(key, None), "layer": FLAG_LAYER})


def _colors(ctx: Any, teams: Mapping[Any, Any], given: Mapping[Any, Any] | None) -> dict[Any, Any]:
    """A colour for each team: the given one, or what its agents have where nothing is declared."""
    usual = side_colors(ctx, sorted(teams, key=str))
    return {team: (given or {}).get(team, usual[str(team)]) for team in sorted(teams, key=str)}
