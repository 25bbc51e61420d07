"""Export the positions of the agents of a recording as GPX, GeoJSON and CSV files."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_range, as_target
from gamms.errors import BadValue, UnknownType, nearest
from gamms.folders import open_whole_file, write_csv
from gamms.ir import projection
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.limits import refuse_above
from gamms.text import as_xml
from gamms.typing.on_edges import find_point_along

_BYTES = 350  # of memory for one position, measured
_DECIMALS = 8  # decimals of degrees: a millimetre
_LONGEST_S = 1e9  # longest game: 30 years


class AgentsAtTurn(NamedTuple):
    """The agents after a turn.

    Attributes:
        agents: the columns of a `State`.
        columns: columns of the map.
    """

    agents: Mapping[str, "np.ndarray[Any, Any]"]
    columns: GraphColumns


class AgentTracks(NamedTuple):
    """Positions of agents, ordered by agent, then by turn.

    Attributes:
        turn: (places,) number of turns before.
        agent: (places,) name of the agent.
        team: (places,) None without a team.
        node: (places,) its node, its last node, or the node below it.
        alive: (places,)
        xyz: (places, 3) map units; z is NaN on the ground.
        latlon: (places, 2) degrees; None on a map without a CRS.
        time: (places,) in ISO 8601.
    """

    turn: IntArray
    agent: "np.ndarray[Any, Any]"
    team: "np.ndarray[Any, Any]"
    node: IntArray
    alive: "np.ndarray[Any, Any]"
    xyz: FloatArray
    latlon: FloatArray | None
    time: list[str]


def export(path: object, moments: Iterable[AgentsAtTurn], turns: int, created: object, turn_seconds: float) -> Path:
    """Write the tracks of a recording in the format named by the suffix; see `Recording.export`.

    Args:
        path: of the file.
        moments: the start, and each turn.
        turns: number of turns.
        created: start of the recording, seconds since 1970.
        turn_seconds: duration of a turn.
    """
    target = as_target(path)
    seconds = check_seconds(turn_seconds, turns)
    write = _FORMATS.get(target.suffix.lower())
    if write is None:
        hint = nearest(target.suffix.lower(), _FORMATS) or f" There are {', '.join(_FORMATS)}."
        raise UnknownType(f"Cannot write tracks as {target.suffix or 'a file without a suffix'!r}.{hint}")
    began = float(created) if isinstance(created, (int, float)) and 0 <= created < _LONGEST_S * 4 else 0.0
    found = make_tracks(moments, began, seconds)
    if found.latlon is None and write is not _write_csv:
        raise BadValue(
            f"{target.suffix} needs degrees, and the map of this recording has no CRS. Write .csv, or record a map "
            "whose ctx.graph.graph.crs is set."
        )
    with open_whole_file(target, through_links=True) as beside:
        write(beside, found)
    return target


def check_seconds(turn_seconds: float, turns: int) -> float:
    """Check the duration of a turn in a game with this number of turns.

    Raises:
        BadValue: it is negative, or too long for valid times of all turns.
    """
    seconds = as_range(turn_seconds, "turn_seconds")
    if seconds * max(turns, 1) > _LONGEST_S:
        raise BadValue(f"turn_seconds must let a game end within {_LONGEST_S:g} seconds, not {seconds:g}.")
    return seconds


def make_tracks(moments: Iterable[AgentsAtTurn], began: float, turn_seconds: float) -> AgentTracks:
    """Return the positions of agents at the start and after each turn; NaN if the node was removed."""
    parts: list[tuple[Any, ...]] = []
    count = 0
    crs = None
    times = list[str]()
    start = datetime.fromtimestamp(began, UTC)
    for turn, moment in enumerate(moments):
        agents = moment.agents
        crs = moment.columns.crs
        xyz = make_positions(agents, moment.columns)
        parts.append((np.full(len(xyz), turn), agents["name"], agents["team"], agents["node"], agents["alive"], xyz))
        times.append((start + timedelta(seconds=turn * turn_seconds)).isoformat().replace("+00:00", "Z"))
        count += len(xyz)
        refuse_above(count * _BYTES, f"The tracks of {len(xyz):,} agents in {turn:,} turns and more")
    turns, names, teams, nodes, alive, xyz = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((turns, np.unique(names.astype(np.str_), return_inverse=True)[1]))
    order = order[np.isfinite(xyz[order, 0])]
    xy = xyz[order, :2]
    latlon = None
    if crs is not None:
        latlon = projection.project_back_and_forth(xy, crs, projection.WGS84)[:, ::-1].round(_DECIMALS)
    texts = [times[turn] for turn in turns[order].tolist()]
    return AgentTracks(turns[order], names[order], teams[order], nodes[order], alive[order], xyz[order], latlon, texts)


def make_positions(agents: Mapping[str, "np.ndarray[Any, Any]"], columns: GraphColumns) -> FloatArray:
    """Return positions (agents, 3) for the columns of a `State`; NaN for z on the ground, and for removed nodes."""
    xyz = np.column_stack([np.asarray(agents[axis], np.float64) for axis in "xyz"])
    on_ground = np.flatnonzero(~np.isfinite(xyz[:, 0]))
    rows = kernels.find_rows(columns.node_ids, np.asarray(agents["node"])[on_ground], columns.node_order)
    xyz[on_ground[rows >= 0], :2] = columns.xy[rows[rows >= 0]]
    if "edge" in agents:
        between = np.flatnonzero(~np.isnan(agents["edge_share"]))
        edges = kernels.find_rows(columns.edge_ids, np.asarray(agents["edge"])[between], columns.edge_order)
        for row, edge in zip(between[edges >= 0].tolist(), edges[edges >= 0].tolist(), strict=True):
            line = columns.polylines.get(edge, columns.xy[[columns.sources[edge], columns.targets[edge]]])
            xyz[row, :2] = find_point_along(line.ravel().tolist(), agents["edge_share"].item(row))[:2]
    return xyz


# -- formats ------------------------------------------------------------------------------------------------------


def _list_agents(tracks: AgentTracks) -> Iterator[tuple[str, Any, slice]]:
    """Yield the name and team of each agent, and the range of its positions."""
    starts = (np.flatnonzero(tracks.agent[1:] != tracks.agent[:-1]) + 1).tolist()
    bounds = [0, *starts, len(tracks.agent)] if len(tracks.agent) else [0]
    for start, stop in pairwise(bounds):
        yield str(tracks.agent[start]), tracks.team[start], slice(start, stop)


def _write_csv(file: Path, tracks: AgentTracks) -> None:
    columns: dict[str, list[Any]] = {
        "turn": tracks.turn.tolist(),
        "time": tracks.time,
        "agent": tracks.agent.tolist(),
        "team": tracks.team.tolist(),
        "node": tracks.node.tolist(),
        "alive": tracks.alive.tolist(),
        "x": tracks.xyz[:, 0].tolist(),
        "y": tracks.xyz[:, 1].tolist(),
        "z": [None if z != z else z for z in tracks.xyz[:, 2].tolist()],  # noqa: PLR0124 - NaN differs from itself
    }
    if tracks.latlon is not None:
        columns |= {"lat": tracks.latlon[:, 0].tolist(), "lon": tracks.latlon[:, 1].tolist()}
    write_csv(file, columns, zip(*columns.values(), strict=True))


def _write_gpx(file: Path, tracks: AgentTracks) -> None:
    with file.open("w", encoding="utf-8") as stream:
        stream.write('<?xml version="1.0" encoding="UTF-8"?>\n')
        stream.write('<gpx version="1.1" creator="GAMMS" xmlns="http://www.topografix.com/GPX/1/1">\n')
        for name, team, rows in _list_agents(tracks):
            kind = "" if team is None else f"<type>{as_xml(str(team), quote=False)}</type>"
            stream.write(f"<trk><name>{as_xml(name, quote=False)}</name>{kind}<trkseg>\n")
            for (lat, lon), z, time in _list_places(tracks, rows):
                height = "" if z is None else f"<ele>{z:.3f}</ele>"
                stream.write(f'<trkpt lat="{lat:.8f}" lon="{lon:.8f}">{height}<time>{time}</time></trkpt>\n')
            stream.write("</trkseg></trk>\n")
        stream.write("</gpx>\n")


def _write_geojson(file: Path, tracks: AgentTracks) -> None:
    with file.open("w", encoding="utf-8", errors="backslashreplace") as stream:
        stream.write('{"type": "FeatureCollection", "features": [')
        comma = "\n"
        for name, team, rows in _list_agents(tracks):
            places = [([lon, lat] if z is None else [lon, lat, z]) for (lat, lon), z, _ in _list_places(tracks, rows)]
            is_line = len(places) > 1
            geometry = {"type": "LineString" if is_line else "Point", "coordinates": places if is_line else places[0]}
            given = {"agent": name, "team": team, "turns": tracks.turn[rows].tolist(), "times": tracks.time[rows]}
            line = {"type": "Feature", "properties": given, "geometry": geometry}
            stream.write(comma + json.dumps(line, ensure_ascii=False))
            comma = ",\n"
        stream.write("\n]}\n")


def _list_places(tracks: AgentTracks, rows: slice) -> Iterator[tuple[list[float], float | None, str]]:
    """Yield (latitude and longitude, height, time) of the positions of an agent."""
    latlon = np.zeros((0, 2)) if tracks.latlon is None else tracks.latlon
    heights = [float(z) if np.isfinite(z) else None for z in tracks.xyz[rows, 2]]
    return zip(latlon[rows].tolist(), heights, tracks.time[rows], strict=True)


_FORMATS: dict[str, Callable[[Path, AgentTracks], None]] = {
    ".gpx": _write_gpx,
    ".geojson": _write_geojson,
    ".csv": _write_csv,
}
