"""The map of a scenario: loaded once, and put into every game from arrays."""

import logging
from pathlib import Path
from typing import Any

from gamms.context import Context, create_context
from gamms.graph import grid
from gamms.graph.storage import MapSnapshot
from gamms.scenario.code import Library, called, inside
from gamms.scenario.documents import ScenarioError, at
from gamms.scenario.spec import Code, Grid, Helsinki, Map, MapFile, MapPlace, given_values
from gamms.text import shown

KINDS = ("grid", "helsinki", "file", "place", "generator")


def quiet() -> dict[str, Any]:
    """Return how the contexts of scenarios log: as the program has set it, or from warnings on."""
    level = logging.getLogger("gamms").level
    return {"level": logging.getLevelName(level) if level else "WARNING"}


def kind_of(map: Map) -> str:
    """Return which of the maps it is.

    Raises:
        ScenarioError: none, or several.
    """
    given = [kind for kind in KINDS if getattr(map, kind) is not None]
    if len(given) != 1:
        reason = f"{' and '.join(given)} are given" if given else "nothing is given"
        raise ScenarioError("map", f"give exactly one of {', '.join(KINDS)}; {reason}.")
    return given[0]


def is_data(map: Map) -> bool:
    """Return whether a map can be loaded without running code and without asking a server."""
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
    """Copy a loaded map into a new context, and share the visibility tables of earlier games with it."""
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
        raise ScenarioError("map.generator", f"{given.function} gives {shown(made)}, which is no networkx graph.")
    ctx.graph.attach_networkx_graph(made)
