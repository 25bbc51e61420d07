"""Fog: what a team cannot see is not shown, what it has seen once is dimmed.

Sensors are asked again, for a recording does not hold what they saw: those of the kinds that come with GAMMS.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from gamms import kernels
from gamms.agent.agent import BaseAgent
from gamms.context import Context
from gamms.errors import BadValue, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import SensorView
from gamms.text import shown
from gamms.typing import SensorType
from gamms.typing.visualization_engine import Drawer
from gamms.visual import Artist
from gamms.visual.appearance import Rgb
from gamms.visual.camera import inside
from gamms.visual.constants import Layer
from gamms.visual.default_scene import MOST_SENSORS, artists_of_sights, sight_radius
from gamms.visual.drawers.graph import one_way_each, polylines, usual_edge
from gamms.visual.drawers.rules import flags_in, render_flags, render_tags, territories_in
from gamms.visual.drawing import drawing_of
from gamms.visual.shown_turn import Sight

DARK: Rgb = (20, 22, 26)
_SHADES: tuple[Rgb, ...] = ((42, 45, 51), (104, 109, 118), (206, 210, 216))  # never seen, seen, seen now
_STREET, _SLIM, _DOT, _LINE_PX = 2.0, 0.2, 0.08, 1.5  # as broad as in other pictures
_DIGITS = 6  # of the coordinates by which agents and nodes are found again


class Fog:
    """What a team knows of the map, and artists that show no more than that.

    Args:
        ctx: a context in which a recording is replayed.
        team: its text.

    Raises:
        UnknownName (KeyError): no agent is of this team.
        BadValue: none of its agents carries a sensor.
    """

    def __init__(self, ctx: Context, team: str) -> None:
        self._ctx, self._team = ctx, team
        if not any(True for _ in self._own()):
            raise UnknownName("team", team, {str(agent.team) for agent in ctx.agent.create_iter()})
        if not any(agent.sensors for agent in self._own()):
            raise BadValue(f"No agent of team {shown(team)} has a sensor in this recording, so it sees nothing.")
        self._seen: set[int] = set()
        self._now: set[int] = set()
        self._hidden: dict[str, Any] = {}  # agent -> the artist that it had, if one was declared
        self._sights: dict[str, Artist] = {}  # of sensors
        self._made: tuple[Any, ...] = ()  # columns, points, offsets, ends of streets
        self._declare()

    def _own(self) -> Iterator[BaseAgent]:
        return (agent for agent in self._ctx.agent.create_iter() if str(agent.team) == self._team)

    def _declare(self) -> None:
        visual = self._ctx.visual
        visual.artists.drawings.are_shown = False  # for they may show what the team does not see
        streets = Artist(self._ctx, _TurnDrawer(self._draw_streets), Layer.GRAPH)
        visual.add_artist("graph", streets)
        for name in territories_in(self._ctx):
            visual.add_artist(name, _hidden(self._ctx))
        for key in flags_in(self._ctx):
            visual.add_artist(key, {"drawer": self._draw_flags, "layer": Layer.FLAGS, "key": key})
        visual.add_artist("tags", {"drawer": _TurnDrawer(self._draw_tags), "layer": Layer.TAGS})

    # -- what is known ---------------------------------------------------------------------------------------

    def look(self) -> None:
        """Ask the team's sensors where its agents are now, and hide whom they do not see."""
        sights = [sight for agent in self._own() if agent.alive for sight in self._sights_of(agent)]
        self._show_sights([sight for sight in sights if sight.sensor.type is not SensorType.NEIGHBOR])
        views = [sight.view or SensorView() for sight in sights]
        columns = self._ctx.graph.columns()
        own = [agent.current_node_id for agent in self._own() if agent.alive]
        is_seen = np.isin(columns.node_ids, own)
        for view in views:
            is_seen |= _at(columns.xy, view.nodes) if len(view.nodes) else _inside(columns.xy, view.outline)
        self._now = set(columns.node_ids[is_seen].tolist())
        self._seen |= self._now
        found = {_rounded(place) for view in views for place in view.agents.tolist()}
        self._hide({agent.name for agent in self._others() if not self._is_found(agent, found)})

    def _others(self) -> Iterator[BaseAgent]:
        return (agent for agent in self._ctx.agent.create_iter() if str(agent.team) != self._team)

    def _is_found(self, agent: BaseAgent, found: set[tuple[float, float]]) -> bool:
        is_on_seen_node = not agent.type and agent.current_node_id in self._now
        return is_on_seen_node or _rounded(self._ctx.visual.position_of(agent.name)) in found

    def _hide(self, names: set[str]) -> None:
        visual = self._ctx.visual
        for name in names - self._hidden.keys():
            self._hidden[name] = visual.artist(name)
            visual.add_artist(name, _hidden(self._ctx))
        for name in self._hidden.keys() - names:
            declared = self._hidden.pop(name)
            visual.remove_artist(name)
            if declared is not None:
                visual.add_artist(name, declared)

    def _sights_of(self, agent: BaseAgent) -> Iterator[Sight]:
        return (self._ctx.visual.drawing.carriers.sight(sensor, agent) for sensor in agent.sensors.values())

    def _show_sights(self, sights: list[Sight]) -> None:
        """Draw what the team's sensors see, while they are few, and no others."""
        visual, found = self._ctx.visual, dict[str, list[Any]]()
        color = visual.drawing.group_colors()[self._team]
        for sight in sights if len(sights) <= MOST_SENSORS else ():
            found.setdefault(sight.sensor.sensor_id, []).append((color, sight.view or SensorView()))
        for name in self._sights:
            if visual.artist(name) is not None:  # which a recording may have replaced
                visual.remove_artist(name)
        hidden = {f"sensor_{name}": _hidden(self._ctx) for name in self._ctx.sensor.sensors}
        unit = sight_radius(self._ctx.graph.columns())
        shown = artists_of_sights(self._ctx, found, unit, visual.artists.declared)
        self._sights = {"rings": _hidden(self._ctx), **hidden, **shown}
        for name, artist in self._sights.items():
            visual.add_artist(name, artist)

    # -- drawers ---------------------------------------------------------------------------------------------

    def _draw_streets(self, ctx: Context, _: dict[str, Any]) -> None:
        columns = ctx.graph.columns()
        points, offsets, ends = self._streets(columns)
        shades = np.isin(columns.node_ids, list(self._seen)).astype(np.int64)
        shades += np.isin(columns.node_ids, list(self._now))
        of_streets, unit, visual = shades[ends].min(axis=1), usual_edge(columns), drawing_of(ctx)
        is_real = columns.crs is not None
        width = min(_STREET, _SLIM * unit) if is_real else _LINE_PX
        for shade, color in enumerate(_SHADES):
            rows = np.flatnonzero(of_streets == shade)
            take, ends_of = kernels.chosen_runs(offsets, rows)
            visual.render_lines(points[take], ends_of, color, width, in_world=is_real)
            visual.render_circles(columns.xy[shades == shade], _DOT * unit, color)

    def _streets(self, columns: GraphColumns) -> tuple[FloatArray, IntArray, IntArray]:
        if not self._made or self._made[0] is not columns:
            rows = one_way_each(columns)
            ends = np.column_stack([columns.sources[rows], columns.targets[rows]])
            self._made = (columns, *polylines(columns, rows), ends)
        points, offsets, ends = self._made[1:]
        return points, offsets, ends

    def _draw_flags(self, ctx: Context, data: dict[str, Any]) -> None:
        render_flags(ctx, data | {"hidden": set(self._hidden)})

    def _draw_tags(self, ctx: Context, data: dict[str, Any]) -> None:
        render_tags(ctx, data | {"of": {agent.name for agent in self._own()}})


class _TurnDrawer:
    """A method as a drawer that is called once a turn."""

    once_a_turn = True

    def __init__(self, draw: Drawer) -> None:
        self._draw = draw

    def __call__(self, ctx: Context, data: dict[str, Any]) -> None:
        self._draw(ctx, data)


def _hidden(ctx: Context) -> Artist:
    artist = Artist(ctx, lambda *_: None)
    artist.set_visible(False)
    return artist


def _rounded(place: Sequence[float]) -> tuple[float, float]:
    return round(float(place[0]), _DIGITS), round(float(place[1]), _DIGITS)


def _at(xy: FloatArray, places: FloatArray) -> BoolArray:
    """Return which of `xy` (nodes, 2) are among places (places, 2)."""
    if len(places) == 0:
        return np.zeros(len(xy), bool)
    wanted = np.round(places, _DIGITS) @ (1.0, 1.0j)
    return np.isin(np.round(xy, _DIGITS) @ (1.0, 1.0j), wanted)


def _inside(xy: FloatArray, outline: FloatArray) -> BoolArray:
    """Return which of `xy` (nodes, 2) are inside a polygon (corners, 2)."""
    is_inside = np.zeros(len(xy), bool)
    if len(outline) < 3 or not np.isfinite(outline).all():
        return is_inside
    is_near = ((xy >= outline.min(axis=0)) & (xy <= outline.max(axis=0))).all(axis=1)
    is_inside[is_near] = inside(xy[is_near], outline)
    return is_inside
