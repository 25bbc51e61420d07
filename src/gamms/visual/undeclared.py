"""What a scenario looks like when nobody said so: grey streets, and agents in the colours of their teams or their own.

What few sensors saw is drawn in the colours of those who carry them, below the agents. Flags, territories and the
tags of this turn are drawn, and a legend tells the teams.
"""

from collections.abc import Iterator
from itertools import islice
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from gamms.errors import NotOffered
from gamms.ir.graph import GraphColumns
from gamms.ir.sensed import SensorView
from gamms.typing import ArtistType, IArtist, IContext, ISensor, SensorType
from gamms.visual.appearance import AgentData, GraphData
from gamms.visual.artist import Artist
from gamms.visual.color import Rgb
from gamms.visual.drawers import render_agent, render_graph, render_sensor
from gamms.visual.drawers.rules import (
    FLAG_LAYER,
    TAG_LAYER,
    TERRITORY_LAYER,
    TerritoryDrawer,
    flags_in,
    render_flags,
    territories_in,
)
from gamms.visual.drawers.sensors import view_of
from gamms.visual.drawers.tags import render_tags
from gamms.visual.primitives import primitives_of
from gamms.visual.sides import side_colors, side_of, team_rows

MOST_SENSORS = 20  # more of them would hide what happens
_STREETS, _NODES, _NOBODYS = (165, 168, 172), (140, 143, 148), (110, 114, 120)
_GRAPH, _SENSORS, _AGENTS = 10, 15, 20  # layers
_USUAL_PX, _LEAST_PX, _MANY = 6.0, 3.0, 150  # radius of agents; of more than so many a smaller one
_RING = 1.7  # of a sensed agent, in radii of its disc

_territory_drawers: WeakKeyDictionary[IContext, dict[str, TerritoryDrawer]] = WeakKeyDictionary()  # who know the places


def undeclared_artists(ctx: IContext) -> dict[str, IArtist]:
    """Artists of the graph, of every agent, of the sensors while they are few, of tags and of the legend, by name."""
    columns = ctx.graph.columns()
    unit = primitives_of(ctx).of_map(_sight)
    streets = Artist(ctx, render_graph, _GRAPH)
    streets.set_artist_type(ArtistType.STATIC)
    streets.data = {"graph_data": GraphData(_NODES, 0.35 * unit, _STREETS)}
    artists: dict[str, IArtist] = {"graph": streets}
    sides = {agent.name: side_of(agent) for agent in ctx.agent.create_iter()}
    least_px = max(_LEAST_PX, min(_USUAL_PX, _USUAL_PX * (_MANY / max(len(sides), 1)) ** 0.5))
    colors, carriers = side_colors(ctx), dict[int, Rgb]()
    for agent in ctx.agent.create_iter():
        color = colors[str(sides[agent.name])]
        artists[agent.name] = disc = Artist(ctx, render_agent, _AGENTS)
        disc.data = {"agent_data": AgentData(agent.name, color, unit, least_px=least_px), "_alpha": 1.0}
        carriers |= {id(sensor): color for sensor in getattr(agent, "_sensor_list", {}).values()}
    for sensor in _telling_sensors(ctx, len(columns.node_ids)):
        artists[f"sensor_{sensor.sensor_id}"] = artist = Artist(ctx, render_sensor, _SENSORS)
        color = carriers.get(id(sensor), _NOBODYS)
        artist.data = {"name": sensor.sensor_id, "color": color, "size": _RING * unit, "node_size": 0.5 * unit}
    return artists | _artists_of_rules(ctx) | {"legend": legend_of_teams(ctx)}


def _artists_of_rules(ctx: IContext) -> dict[str, IArtist]:
    """Artists of what rules remember, under the names by which rules draw it: a replay has what they remember only."""
    artists: dict[str, IArtist] = {"tags": Artist(ctx, render_tags, TAG_LAYER)}
    drawers = _territory_drawers.setdefault(ctx, {})
    for name in territories_in(ctx):
        artists[name] = Artist(ctx, drawers.setdefault(name, TerritoryDrawer(name)), TERRITORY_LAYER)
    for key in flags_in(ctx):
        artists[key] = flags = Artist(ctx, render_flags, FLAG_LAYER)
        flags.data = {"key": key}
    return artists


def legend_of_teams(ctx: IContext) -> Artist:
    """An artist that draws nothing but the legend of the teams."""
    artist = Artist(ctx, _nothing)
    artist.data = {"legend": team_rows}
    return artist


def _nothing(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw nothing."""


_nothing.once_a_turn = True  # type: ignore[attr-defined]


def _telling_sensors(ctx: IContext, nodes: int) -> list[ISensor]:
    """The sensors whose last view says something; none where too many have looked."""
    looked = list(islice(_views(ctx), MOST_SENSORS + 1))
    if len(looked) > MOST_SENSORS:
        return []
    return [sensor for sensor, view in looked if len(view.nodes) < nodes or len(view.outline)]  # not the whole map


def _views(ctx: IContext) -> Iterator[tuple[ISensor, SensorView]]:
    """Sensors that have looked, with what they saw; where one may go is no news."""
    for sensor in ctx.sensor.sensors.values():
        if sensor.type is SensorType.NEIGHBOR:
            continue
        try:
            view = view_of(sensor)
        except NotOffered:
            continue
        except Exception:  # noqa: BLE001 - a sensor is user code; its artist will fail likewise, which is logged
            yield sensor, SensorView()
            continue
        if any(len(part) for part in (view.nodes, view.lines, view.agents, view.outline)):
            yield sensor, view


def _sight(columns: GraphColumns) -> float:
    """A radius, in world units, at which agents neither hide streets nor vanish."""
    if len(columns.xy) == 0:
        return 1.0
    widest = float(np.ptp(columns.xy, axis=0).max())
    ways = columns.xy[columns.targets] - columns.xy[columns.sources]
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    typical = float(np.median(lengths)) if len(lengths) else widest
    return min(0.22 * typical, 0.018 * widest) or 1.0
