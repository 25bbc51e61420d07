"""Export a graph: files of OSMnx and SUMO, GraphML, GeoJSON, GeoPackage and CSV, data frames, and igraph graphs.

Values other than numbers, texts and bools become JSON. A file is written completely or not at all.
"""

import json
import os
import re
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from functools import cached_property
from itertools import product
from math import atan2, degrees
from pathlib import Path
from sys import float_info
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeGuard

import numpy as np

from gamms.arguments import as_target
from gamms.errors import BadType, BadValue, UnknownType, nearest
from gamms.folders import open_whole_file, write_csv, write_whole
from gamms.graph import positions
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.tables import make_frame, make_table
from gamms.plain import as_json, to_plain
from gamms.plugins import require_extra
from gamms.text import as_xml, write_repr

if TYPE_CHECKING:
    import igraph
    import pandas as pd
    import polars as pl

Scalar = str | int | float | bool | None
Table = dict[str, list[Scalar]]
_ESCAPED = "backslashreplace"  # for unpaired surrogates
_MOST_COLUMNS = 1_900  # SQLite allows 2,000
_DECIMALS = 9  # of degrees: a tenth of a millimetre
_LONG = 1 << 63


class GraphTables(NamedTuple):
    """A graph as a table of nodes, a table of edges, and their geometries.

    Attributes:
        nodes: column -> one value for each node.
        edges: column -> one value for each edge.
        drawn: (points, 2) of each edge, in map units.
        lines: (points, 2) of each edge, in longitude and latitude if `in_degrees`, else in map units.
        points: (nodes, 2) of the nodes, in the same unit as `lines`.
        in_degrees: whether the map has a CRS.
        attribution: the authors of the data.
        crs: the CRS of the columns x and y.
    """

    nodes: Table
    edges: Table
    drawn: list[FloatArray]
    lines: list[FloatArray]
    points: FloatArray
    in_degrees: bool
    attribution: str | None
    crs: str | None

    @property
    def points_on_map(self) -> FloatArray:
        """The points (nodes, 2) of the nodes, in map units."""
        return np.column_stack((np.array(self.nodes["x"], float), np.array(self.nodes["y"], float)))


def export(
    path: str | os.PathLike[str], columns: GraphColumns, attribution: str | None, *, has_all_nodes: bool = True
) -> list[Path]:
    """Write a graph, or only its nodes with edges, in the format named by the suffix, and return the files.

    Raises:
        UnknownType (ValueError): the suffix names no supported format.
        BadValue (ValueError): the format cannot hold this graph.
        MissingExtra (ImportError): the CRS is not a UTM zone, and pyproj is not installed.
        OSError: a file cannot be written.
    """
    target = as_target(path)
    suffix = next((one for one in _FORMATS if target.name.lower().endswith(one)), None)
    if suffix is None:
        hint = nearest(target.suffix.lower(), _FORMATS) or f" There are {', '.join(_FORMATS)}."
        raise UnknownType(f"Cannot write a graph as {target.suffix or 'a file without a suffix'!r}.{hint}")
    layers = make_layers(columns, attribution)
    return _FORMATS[suffix](target, layers if has_all_nodes else _drop_lone_nodes(layers, columns))


def _drop_lone_nodes(layers: GraphTables, columns: GraphColumns) -> GraphTables:
    kept = np.unique((columns.sources, columns.targets))
    nodes = {name: [values[row] for row in kept] for name, values in layers.nodes.items()}
    return layers._replace(nodes=nodes, points=layers.points[kept])


def make_layers(columns: GraphColumns, attribution: str | None) -> GraphTables:
    """Return a graph as tables; on a map with a CRS, geometries are in degrees, and nodes have `lat` and `lon`."""
    ids = columns.node_ids
    sources = columns.sources
    targets = columns.targets
    drawn = list_shapes(columns)
    points = columns.xy
    lines = drawn
    in_degrees = columns.crs is not None
    nodes: Table = {"id": ids.tolist(), "x": columns.xy[:, 0].tolist(), "y": columns.xy[:, 1].tolist()}
    if in_degrees:
        sizes = np.cumsum([len(points), *map(len, lines)])
        flat = np.concatenate([points, *lines])
        lat, lon = positions.to_latlon(columns.crs, flat[:, 0], flat[:, 1])
        points, *lines = np.split(np.column_stack((lon, lat)).round(_DECIMALS), sizes[:-1])
        nodes |= {"lat": points[:, 1].tolist(), "lon": points[:, 0].tolist()}
    edges: Table = {
        "id": columns.edge_ids.tolist(),
        "source": ids[sources].tolist(),
        "target": ids[targets].tolist(),
        "length": columns.lengths.tolist(),
    }
    _add_attributes(nodes, columns.node_attributes, len(ids))
    _add_attributes(edges, columns.edge_attributes, len(columns.edge_ids))
    return GraphTables(nodes, edges, drawn, lines, points, in_degrees, attribution, columns.crs)


def make_plain_cell(value: object) -> Scalar:
    """Return an attribute value as a number, a text, a bool or None; other values as JSON."""
    if value is None or type(value) in (str, int, float, bool):
        return value  # type: ignore[return-value] # as the line before says
    plain = to_plain(value)
    if isinstance(plain, (str, int, float, bool)):
        return plain
    try:
        return json.dumps(as_json(plain), ensure_ascii=False)
    except (TypeError, ValueError):
        return write_repr(plain)


def list_shapes(columns: GraphColumns) -> list[FloatArray]:
    """Return the polyline (points, 2) of every edge."""
    pairs = np.stack((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
    return [columns.polylines.get(row, pair) for row, pair in enumerate(pairs)]


def format_wkt(line: FloatArray) -> str:
    """Return a polyline (points, 2) as well-known text."""
    return f"LINESTRING ({', '.join(f'{x!r} {y!r}' for x, y in line.tolist())})"


def _add_attributes(table: Table, attributes: Mapping[str, Mapping[int, object]], count: int) -> None:
    """Add a column for each attribute; a name that equals another one, ignoring case, gets a number."""
    taken = {name.lower() for name in (*table, "fid", "geom", "geometry")}
    for name, values in sorted(attributes.items()):
        column: list[Scalar] = [None] * count
        for row, value in values.items():
            column[row] = make_plain_cell(value)
        unique = name
        number = 2
        while unique.lower() in taken:
            unique = f"{name}_{number}"
            number += 1
        taken.add(unique.lower())
        table[unique] = column


def _list_rows(table: Table) -> Iterator[dict[str, Scalar]]:
    names = list(table)
    return (dict(zip(names, row, strict=True)) for row in zip(*table.values(), strict=True))


# -- CSV ----------------------------------------------------------------------------------------------------------


def _write_csv(target: Path, layers: GraphTables) -> list[Path]:
    files = [target.with_name(f"{target.stem}_{part}.csv") for part in ("nodes", "edges")]
    shapes: list[Scalar] = [format_wkt(line) for line in layers.lines]
    with ExitStack() as all_or_none:
        for file, table in zip(files, (layers.nodes, {**layers.edges, "geometry": shapes}), strict=True):
            beside = all_or_none.enter_context(open_whole_file(file, through_links=True))
            write_csv(beside, table, zip(*table.values(), strict=True))
    return files


# -- GeoJSON ------------------------------------------------------------------------------------------------------


def _write_geojson(target: Path, layers: GraphTables) -> list[Path]:
    if not layers.in_degrees:
        raise BadValue(
            "GeoJSON needs degrees, and this graph has no CRS: set ctx.graph.graph.crs, for example to 'EPSG:32635', "
            "or write .gpkg, .graphml or .csv."
        )
    nodes = (("Point", point, row) for point, row in zip(layers.points.tolist(), _list_rows(layers.nodes), strict=True))
    edges = (
        ("LineString", line.tolist(), row) for line, row in zip(layers.lines, _list_rows(layers.edges), strict=True)
    )
    with (
        open_whole_file(target, through_links=True) as beside,
        beside.open("w", encoding="utf-8", errors=_ESCAPED) as stream,
    ):
        stream.write('{"type": "FeatureCollection"')
        if layers.attribution is not None:
            stream.write(f', "attribution": {json.dumps(layers.attribution)}')
        stream.write(', "features": [')
        stream.writelines(_write_features((*nodes, *edges)))
        stream.write("\n]}\n")
    return [target]


def _write_features(parts: Iterable[tuple[str, list[Any], dict[str, Scalar]]]) -> Iterator[str]:
    comma = "\n"
    for kind, coordinates, row in parts:
        properties = {name: as_json(value) for name, value in row.items() if value is not None}
        feature = {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}
        yield comma + json.dumps(feature, ensure_ascii=False, allow_nan=False)
        comma = ",\n"


# -- GraphML ------------------------------------------------------------------------------------------------------


def _write_graphml(target: Path, layers: GraphTables) -> list[Path]:
    shapes: list[Scalar] = [format_wkt(line) for line in layers.drawn]
    about: dict[str, Scalar] = {"crs": layers.crs, "attribution": layers.attribution}
    return _put_graphml(target, about, layers.nodes, {**layers.edges, "geometry": shapes})


def _put_graphml(
    target: Path, about: Mapping[str, Scalar], nodes: Table, edges: Table, keys: Sequence[int] | None = None
) -> list[Path]:
    """Write GraphML, with keys of edges that tell parallel ones apart."""
    tables = {"node": nodes, "edge": edges}
    with open_whole_file(target, through_links=True) as beside, beside.open("w", encoding="utf-8") as stream:
        stream.write(
            '<?xml version="1.0" encoding="UTF-8"?>\n<graphml xmlns="http://graphml.graphdrawing.org/xmlns">\n'
        )
        described: dict[str, Table] = {**tables, "graph": {name: [one] for name, one in about.items() if one}}
        for kind, table in described.items():
            for number, (name, values) in enumerate(table.items()):
                if name not in _IN_TAGS[kind]:
                    attributes = f'attr.name="{_check_xml_name(name)}" attr.type="{_find_graphml_type(values)}"'
                    stream.write(f'<key id="{kind}{number}" for="{kind}" {attributes}/>\n')
        stream.write('<graph edgedefault="directed">\n')
        stream.write(_write_data("graph", {name: one for name, one in about.items() if one}))
        for row in _list_rows(tables["node"]):
            stream.write(f'<node id="{row["id"]}">{_write_data("node", row)}</node>\n')
        for number, row in enumerate(_list_rows(tables["edge"])):
            key = "" if keys is None else f' id="{keys[number]}"'
            ends = f'source="{row["source"]}" target="{row["target"]}"'
            stream.write(f"<edge {ends}{key}>{_write_data('edge', row)}</edge>\n")
        stream.write("</graph>\n</graphml>\n")
    return [target]


_IN_TAGS = {"node": {"id"}, "edge": {"source", "target"}, "graph": set[str]()}


def _write_data(kind: str, row: Mapping[str, Scalar]) -> str:
    return "".join(
        f'<data key="{kind}{number}">{_write_xml(str(value).lower() if isinstance(value, bool) else value)}</data>'
        for number, (name, value) in enumerate(row.items())
        if value is not None and name not in _IN_TAGS[kind]
    )


def _write_xml(value: Scalar) -> str:
    return as_xml(value if isinstance(value, str) else repr(value), quote=False)


def _check_xml_name(name: str) -> str:
    return re.sub(r"[\t\n\r]", lambda blank: f"&#{ord(blank[0])};", as_xml(name))


def _find_graphml_type(values: Iterable[Scalar]) -> str:
    kinds = {type(value) for value in values} - {type(None)}
    if kinds == {bool}:
        return "boolean"
    if kinds == {int}:
        return "long"
    return "double" if kinds and kinds <= {int, float} else "string"


# -- OSMnx --------------------------------------------------------------------------------------------------------

_OSMNX_NUMBERS = {  # columns that OSMnx converts from texts
    "node": ("elevation", "elevation_res", "street_count", "x", "y"),
    "edge": ("bearing", "grade", "grade_abs", "length", "speed_kph", "travel_time"),
}
_OSMNX_FLAGS = ("oneway", "reversed")


def _write_osmnx(target: Path, layers: GraphTables) -> list[Path]:
    """Write GraphML as `osmnx.save_graphml` does: all values as texts, places in degrees, shapes of bent edges only."""
    if not layers.in_degrees:
        raise BadValue(
            "OSMnx needs degrees, and this graph has no CRS: set ctx.graph.graph.crs, for example to 'EPSG:32635', or "
            "write .graphml, .gpkg or .csv."
        )
    ends = [*zip(_find_ids(layers.edges["source"]), _find_ids(layers.edges["target"]), strict=True)]
    nodes = {name: values for name, values in layers.nodes.items() if name not in ("x", "y", "lat", "lon")}
    nodes |= {"y": layers.nodes["lat"], "x": layers.nodes["lon"]}
    nodes.setdefault("street_count", [*_count_streets(ends, _find_ids(layers.nodes["id"]))])
    shapes: list[Scalar] = [format_wkt(line) if len(line) > 2 else None for line in layers.lines]
    edges = {name: values for name, values in layers.edges.items() if name != "id"}
    known = {*ends}
    usual: Table = {
        "osmid": layers.edges["id"],
        "oneway": [pair[::-1] not in known for pair in ends],
        "reversed": [False] * len(ends),
    }
    for name, values in usual.items():
        given = edges.get(name, values)
        edges[name] = [other if one is None else one for one, other in zip(given, values, strict=True)]
    edges["geometry"] = shapes
    about: dict[str, Scalar] = {"crs": "epsg:4326", "simplified": "True", "attribution": layers.attribution}
    texts = _as_texts("node", nodes), _as_texts("edge", edges)
    return _put_graphml(target, about, *texts, [*_number_parallels(ends)])


def _find_ids(values: Iterable[Scalar]) -> list[int]:
    return [int(one) for one in values if one is not None]


def _number_parallels(ends: Iterable[tuple[int, int]]) -> Iterator[int]:
    """Yield the number of each edge among those with the same source and target."""
    count: dict[tuple[int, int], int] = {}
    for pair in ends:
        yield count.get(pair, 0)
        count[pair] = count.get(pair, 0) + 1


def _count_streets(ends: Iterable[tuple[int, int]], nodes: Iterable[int]) -> Iterator[int]:
    """Yield the number of streets at each node, where the two directions of a street are one, and a loop is two."""
    count = Counter(ends)
    streets = Counter[int]()
    for source, target in count:
        number = max(count[source, target], count.get((target, source), 0))
        if source == target:
            streets[source] += 2 * ((number + 1) // 2)
        elif source < target or (target, source) not in count:
            streets[source] += number
            streets[target] += number
    return (streets[node] for node in nodes)


def _as_texts(kind: Literal["node", "edge"], table: Table) -> Table:
    """Return a table whose values are the texts that OSMnx reads; without those that it could not convert."""
    found: Table = {}
    for name, values in table.items():
        if name in _IN_TAGS[kind]:
            found[name] = values
        elif name in _OSMNX_FLAGS and kind == "edge":
            found[name] = [str(bool(one)) for one in values]
        else:
            is_number = name in _OSMNX_NUMBERS[kind]
            found[name] = [None if one is None or (is_number and not _is_number(one)) else str(one) for one in values]
    return found


def _is_number(value: Scalar) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


# -- SUMO ---------------------------------------------------------------------------------------------------------

_USUAL_SPEED = 50 / 3.6  # metres per second, of edges without one


def _write_sumo(target: Path, layers: GraphTables) -> list[Path]:
    """Write a network of SUMO: one lane for each edge, and a connection for each way to go on at a node.

    Junctions have no extent, so that the lanes have the lengths of the edges.
    """
    origin = np.floor(_find_least(layers.drawn, layers.points_on_map))
    ids = _find_ids(layers.edges["id"])
    sources = _find_ids(layers.edges["source"])
    targets = _find_ids(layers.edges["target"])
    arriving = _group_by(targets)
    leaving = _group_by(sources)
    with open_whole_file(target, through_links=True) as beside, beside.open("w", encoding="utf-8") as stream:
        stream.write('<?xml version="1.0" encoding="UTF-8"?>\n')
        if layers.attribution is not None:
            stream.write(f"<!-- {_write_xml(layers.attribution).replace('--', '- -')} -->\n")
        stream.write(f'<net version="1.20" junctionCornerDetail="0">\n{_write_location(layers, origin)}')
        for row, line in zip(_list_rows(layers.edges), layers.drawn, strict=True):
            stream.write(_write_sumo_edge(row, line - origin))
        for node, place in zip(_find_ids(layers.nodes["id"]), (layers.points_on_map - origin).tolist(), strict=True):
            lanes = " ".join(f"{ids[one]}_0" for one in arriving.get(node, ()))
            kind = "unregulated" if lanes and node in leaving else "dead_end"
            at = f'x="{place[0]!r}" y="{place[1]!r}"'
            stream.write(f'<junction id="{node}" type="{kind}" {at} incLanes="{lanes}" intLanes="" shape=""/>\n')
        for node, numbers in arriving.items():
            for one, other in product(numbers, leaving.get(node, ())):
                way = _name_turn(layers.drawn[one], layers.drawn[other], is_back=targets[other] == sources[one])
                which = f'from="{ids[one]}" to="{ids[other]}" fromLane="0" toLane="0"'
                stream.write(f'<connection {which} dir="{way}" state="M"/>\n')
        stream.write("</net>\n")
    return [target]


def _find_least(lines: Sequence[FloatArray], points: FloatArray) -> FloatArray:
    """Return the least x and y of a map; 0 if it is empty."""
    return np.concatenate([points, *lines]).min(axis=0) if len(points) else np.zeros(2)


def _group_by(keys: Iterable[int]) -> dict[int, list[int]]:
    """Return key -> the numbers of its places."""
    found: dict[int, list[int]] = {}
    for number, key in enumerate(keys):
        found.setdefault(key, []).append(number)
    return found


def _write_location(layers: GraphTables, origin: FloatArray) -> str:
    """Return where the network is: its offset from the map units, and its bounds there and in degrees."""
    bounds = np.array(_find_bounds([layers.points_on_map, *layers.drawn]) if len(layers.points) else [0.0] * 4)
    moved = bounds - np.tile(origin, 2)
    original = _find_bounds([layers.points, *layers.lines]) if layers.in_degrees and len(layers.points) else bounds
    texts = [",".join(f"{one:.9f}" for one in several) for several in (0.0 - origin, moved, original)]
    names = ("netOffset", "convBoundary", "origBoundary")
    places = " ".join(f'{name}="{text}"' for name, text in zip(names, texts, strict=True))
    return f'<location {places} projParameter="{_write_xml(_find_projection(layers.crs))}"/>\n'


def _find_projection(crs: str | None) -> str:
    """Return the parameters of PROJ for a CRS; "!" for none, as SUMO writes it."""
    zone = re.fullmatch(r"(?i)epsg:32([67])(\d\d)", crs or "")
    if zone is None:
        return crs or "!"
    half = " +south" if zone[1] == "7" else ""
    return f"+proj=utm +zone={int(zone[2])}{half} +ellps=WGS84 +datum=WGS84 +units=m +no_defs"


def _write_sumo_edge(row: Mapping[str, Scalar], line: FloatArray) -> str:
    """Return an edge with its lane."""
    id = row["id"]
    kph = row.get("speed_kph")
    speed = kph / 3.6 if _is_number(kph) and 0 < kph <= float_info.max else _USUAL_SPEED
    name = f' name="{_check_xml_name(str(row["name"]))}"' if isinstance(row.get("name"), str) else ""
    kind = f' type="highway.{_check_xml_name(str(row["highway"]))}"' if isinstance(row.get("highway"), str) else ""
    shape = " ".join(f"{x!r},{y!r}" for x, y in line.tolist())
    lane = f'<lane id="{id}_0" index="0" speed="{speed!r}" length="{row["length"]!r}" shape="{shape}"/>'
    return f'<edge id="{id}" from="{row["source"]}" to="{row["target"]}" priority="-1"{name}{kind}>{lane}</edge>\n'


def _name_turn(line: FloatArray, following: FloatArray, *, is_back: bool) -> str:
    """Return how SUMO calls the way from one edge to the next: s(traight), l(eft), r(ight) or t(urn back)."""
    (ax, ay), (bx, by) = (line[-1] - line[-2]).tolist(), (following[1] - following[0]).tolist()
    angle = degrees(atan2(ax * by - ay * bx, ax * bx + ay * by))
    if is_back and abs(angle) > 170:
        return "t"
    if abs(angle) < 45:
        return "s"
    return "l" if angle > 0 else "r"


# -- GeoPackage -----------------------------------------------------------------------------------------------------

_SCHEMA = """
PRAGMA application_id = 0x47504B47;
PRAGMA user_version = 10300;
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY, organization TEXT NOT NULL,
    organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
INSERT INTO gpkg_spatial_ref_sys VALUES
    ('Undefined Cartesian SRS', -1, 'NONE', -1, 'undefined', NULL),
    ('Undefined geographic SRS', 0, 'NONE', 0, 'undefined', NULL),
    ('WGS 84', 4326, 'EPSG', 4326, 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],'
     || 'PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]]', NULL);
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
    description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
    min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
    CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL, column_name TEXT NOT NULL,
    geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
    CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name), CONSTRAINT uk_gc_table_name UNIQUE (table_name),
    CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
    CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys (srs_id));
"""
_SQL_TYPES = {"boolean": "BOOLEAN", "long": "INTEGER", "double": "REAL", "string": "TEXT"}


def _write_geopackage(target: Path, layers: GraphTables) -> list[Path]:
    """Write a GeoPackage (OGC 12-128r18): an SQLite database with geometries in well-known binary."""
    import sqlite3

    srs = 4326 if layers.in_degrees else -1
    head = struct.pack("<2sBBi", b"GP", 0, 1, srs)  # version 1, little-endian, without a bounding box
    points = (head + struct.pack("<BI", 1, 1) + point.tobytes() for point in layers.points)
    lines = (
        head + struct.pack("<BII", 1, 2, len(line)) + np.ascontiguousarray(line).tobytes() for line in layers.lines
    )
    bounds = _find_bounds([layers.points, *layers.lines])
    parts = [("nodes", "POINT", layers.nodes, points), ("edges", "LINESTRING", layers.edges, lines)]
    with closing(sqlite3.connect(":memory:")) as database:
        database.executescript(_SCHEMA)
        for name, kind, table, geometries in parts:
            if len(table) > _MOST_COLUMNS:
                raise BadValue(f"A GeoPackage holds at most {_MOST_COLUMNS} attributes, not {len(table)}.")
            typed = ", ".join(f"{_quote_name(one)} {_SQL_TYPES[_find_graphml_type(table[one])]}" for one in table)
            database.execute(
                f"CREATE TABLE {name} (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom {kind}, {typed})"
            )
            database.execute(
                "INSERT INTO gpkg_contents (table_name, data_type, identifier, description, min_x, min_y, max_x, "
                "max_y, srs_id) VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?)",
                (name, name, layers.attribution or "", *bounds, srs),
            )
            database.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 0, 0)", (name, kind, srs))
            marks = ", ".join("?" * (len(table) + 1))
            names = ", ".join(["geom", *map(_quote_name, table)])
            cells = (map(_convert_to_sql, row) for row in zip(*table.values(), strict=True))
            rows = ((geometry, *row) for geometry, row in zip(geometries, cells, strict=True))
            database.executemany(f"INSERT INTO {name} ({names}) VALUES ({marks})", rows)  # noqa: S608 - quoted
        database.commit()
        write_whole(target, database.serialize(), through_links=True)
    return [target]


def _quote_name(name: str) -> str:
    clean = name.encode("utf-8", _ESCAPED).decode().replace("\0", "")
    return '"' + clean.replace('"', '""') + '"'


def _convert_to_sql(value: Scalar) -> Scalar:
    if isinstance(value, str):
        return value.encode("utf-8", _ESCAPED).decode()
    return str(as_json(value)) if type(value) is int and not -_LONG <= value < _LONG else value


def _find_bounds(parts: list[FloatArray]) -> list[float | None]:
    points = np.concatenate(parts)
    return [None] * 4 if not len(points) else np.concatenate((points.min(axis=0), points.max(axis=0))).tolist()


_FORMATS: dict[str, Callable[[Path, GraphTables], list[Path]]] = {
    ".osmnx.graphml": _write_osmnx,
    ".net.xml": _write_sumo,
    ".graphml": _write_graphml,
    ".geojson": _write_geojson,
    ".gpkg": _write_geopackage,
    ".csv": _write_csv,
}


# -- other libraries ------------------------------------------------------------------------------------------------


class Frames:
    """The nodes and edges of a graph as tables of other libraries: `ctx.graph.frames`.

    Nodes have `id`, `x`, `y` and their attributes, on a map with a CRS also `lat` and `lon`; edges have `id`, `source`,
    `target`, `length` and their attributes. Values other than numbers, texts and bools are JSON.

    Args:
        columns: the graph.
    """

    def __init__(self, columns: GraphColumns) -> None:
        self._columns = columns

    @cached_property
    def _layers(self) -> GraphTables:
        return make_layers(self._columns, None)

    def arrays(self, part: Literal["nodes", "edges"]) -> "dict[str, np.ndarray[Any, Any]]":
        """Return the nodes or the edges as a dict of arrays of equal length."""
        if part not in ("nodes", "edges"):
            raise BadType(f"The tables of a graph are 'nodes' and 'edges', not {part!r}.")
        return make_table(self._layers.nodes if part == "nodes" else self._layers.edges)

    def to_pandas(self) -> "tuple[pd.DataFrame, pd.DataFrame]":
        """Return nodes and edges as pandas data frames (MissingExtra: pandas is not installed)."""
        return make_frame(self.arrays("nodes")), make_frame(self.arrays("edges"))

    def to_polars(self) -> "tuple[pl.DataFrame, pl.DataFrame]":
        """Return nodes and edges as polars data frames (MissingExtra: polars is not installed)."""
        with require_extra("A table for polars", "frames"):
            import polars as pl
        nodes, edges = (pl.DataFrame(part, strict=False) for part in (self._layers.nodes, self._layers.edges))
        return nodes, edges

    def to_igraph(self) -> "igraph.Graph":
        """Return a directed igraph graph; vertex `i` is the i-th node (MissingExtra: igraph is not installed)."""
        with require_extra("A graph for igraph", "frames"):
            import igraph
        ends = np.column_stack((self._columns.sources, self._columns.targets)).tolist()
        parts = {"vertex_attrs": self._layers.nodes, "edge_attrs": self._layers.edges}
        return igraph.Graph(len(self._columns.node_ids), ends, directed=True, **parts)
