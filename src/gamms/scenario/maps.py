"""The map of a scenario: load it once, and copy its arrays into every game."""

import logging
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from gamms.context import Context, create_context
from gamms.errors import BadValue, nearest
from gamms.graph.networkx_bridge import Grid
from gamms.graph.storage import MapSnapshot
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.scenery import Scenery
from gamms.scenario.code import CodeLibrary, call_function, find_path
from gamms.scenario.documents import ScenarioError, locate_errors
from gamms.scenario.spec import Code, Map, MapFile, MapPlace, StreetMap, Values, expand, list_given_values
from gamms.text import shown

if TYPE_CHECKING:  # `gamms.osm` is loaded for maps of streets alone: many processes play on others
    from gamms.osm.modes import ModeFunction

_OF_OSM = {"osm_type", "buildings", "scenery", "tags"}  # options for OpenStreetMap files only
_KINDS = [name for name in Map.__struct_fields__ if name != "closed"]


def make_log_settings() -> Values:
    """Return the logging settings for contexts of scenarios: the program's level, or warnings."""
    level = logging.getLogger("gamms").level
    return {"level": logging.getLevelName(level) if level else "WARNING"}


def compute_digest(columns: GraphColumns, walls: FloatArray) -> str:
    """Return the SHA-256 of streets and obstacles, in hexadecimal.

    Args:
        columns: the streets.
        walls: the corners of the obstacles.
    """
    arrays = (columns.node_ids, columns.xy, columns.sources, columns.targets, columns.lengths, walls)
    return sha256(b"".join(one.astype(one.dtype.newbyteorder("<"), copy=False).tobytes() for one in arrays)).hexdigest()


def find_map_kind(map: Map) -> str:
    """Return the kind of map that is given.

    Raises:
        ScenarioError: no kind or several kinds are given.
    """
    given = [kind for kind in _KINDS if getattr(map, kind) is not None]
    if len(given) != 1:
        reason = f"{' and '.join(given)} are given" if given else "nothing is given"
        raise ScenarioError("map", f"give exactly one of {', '.join(_KINDS)}; {reason}.")
    return given[0]


def is_data(map: Map) -> bool:
    """Return whether a map can be loaded without running code or asking a server."""
    place = map.place
    return map.generator is None and (place is None or (isinstance(place, MapPlace) and place.offline))


def map_file(map: Map, folder: Path | None) -> Path | None:
    """Return the map file; None if the map is not a file.

    Raises:
        ScenarioError: the file does not exist, or is not in the folder of the scenario.
    """
    if map.file is None:
        return None
    text = expand(MapFile, map.file).path
    path = "map.file" if isinstance(map.file, str) else "map.file.path"
    file = find_path(text, folder, path, "map")
    if not file.is_file():
        raise ScenarioError(path, f"there is no file {text!r} in {folder}.")
    return file


def check_names(map: Map) -> None:
    """Check a map without opening files.

    Raises:
        ScenarioError: no map or several maps are given, or the mode of travel is unknown.
    """
    find_map_kind(map)
    if getattr(map.file or map.place, "modes", None) is None:
        find_mode(map, None)


def find_mode(map: Map, folder: Path | None) -> "ModeFunction | list[ModeFunction] | None":
    """Return the mode of travel for the streets of a file or place, or its modes; None if the scenario names none.

    Raises:
        ScenarioError: the mode is unknown, or its file is missing, outside the folder or not valid.
    """
    kind = find_map_kind(map)
    given = map.file if map.place is None else map.place
    if not isinstance(given, StreetMap) or (given.osm_type is None and given.modes is None):
        return None
    from gamms import osm
    from gamms.osm.modes import as_mode, explain_name

    path = f"map.{kind}.modes"
    known = osm.modes()
    if given.modes is not None:
        with locate_errors(path):
            known |= osm.modes(find_path(given.modes, folder, path, "file of modes"))
        if given.osm_type is None:
            raise ScenarioError(path, f"name one of its modes as osm_type.{nearest('', known)}")
    found: list[ModeFunction] = []
    with locate_errors(f"map.{kind}.osm_type"):
        for one in given.osm_type if isinstance(given.osm_type, list) else [given.osm_type]:
            if isinstance(one, str) and one not in known:
                raise BadValue(f"there is no mode of travel {one!r}.{explain_name(one, known)}")
            found.append(known[one] if isinstance(one, str) else as_mode(one))
    return found if isinstance(given.osm_type, list) else found[0]


def load(map: Map, folder: Path | None, library: CodeLibrary) -> MapSnapshot:
    """Load graph and obstacles, to be copied into contexts.

    Raises:
        ScenarioError: the map cannot be loaded.
    """
    kind = find_map_kind(map)
    with create_context(logger_config=make_log_settings()) as ctx, locate_errors(f"map.{kind}"):
        if map.grid is not None:
            ctx.graph.attach_networkx_graph(Grid(**list_given_values(map.grid)))
        elif map.helsinki is not None:
            _load_helsinki(ctx, list_given_values(map.helsinki))
        elif map.place is not None:
            given = expand(MapPlace, map.place)
            _load_place(ctx, given, _make_street_options(given, find_mode(map, folder), folder))
        elif map.generator is not None:
            _generate(ctx, expand(Code, map.generator), library)
        elif map.file is not None and (file := map_file(map, folder)) is not None:
            of_file = expand(MapFile, map.file)
            _load_file(ctx, of_file, file, _make_street_options(of_file, find_mode(map, folder), folder))
        if not len(ctx.graph.graph):
            raise ScenarioError(f"map.{kind}", "this map has no nodes.")
        for number, part in enumerate(map.closed):
            with locate_errors(f"map.closed.{number}"):
                name, area = (part, None) if isinstance(part, str) else (None, part)
                ctx.graph.close_roads(name=name, inside=area)
        return ctx.graph.storage.snapshot()


def _load_helsinki(ctx: Context, options: Values) -> None:
    from gamms import osm

    osm.helsinki(ctx, **options)


def _load_file(ctx: Context, given: MapFile, file: Path, options: Values) -> None:
    from gamms import osm

    is_saved = file.suffix == ".gamms"
    is_geojson = osm.is_geojson(file)
    named = {*options, *(name for name in ("buildings", "scenery") if getattr(given, name))}
    refused = named if is_saved else named & _OF_OSM
    for option in refused if is_saved or is_geojson else ():
        raise ScenarioError(
            f"map.file.{option}",
            f"{file.name} is not an OpenStreetMap file; this option is only for OpenStreetMap files.",
        )
    if is_saved:
        ctx.graph.load(file)
    elif is_geojson:
        ctx.graph.attach_networkx_graph(osm.graph_from_geojson(file, **options))
    else:
        ctx.graph.attach_networkx_graph(osm.graph_from_file(file, **options))
    if given.buildings:
        ctx.graph.add_obstacles(osm.obstacle_from_file(file, crs=ctx.graph.crs, **_make_wall_options(given, options)))
    if given.scenery:
        ctx.graph.graph.scenery = osm.scenery_from_file(file, ctx, buildings=not given.buildings)


def load_scenery(map: Map, given: Values, folder: Path | None, ctx: Context) -> Scenery | None:
    """Return the buildings, parks and water around a built game whose scenario does not say whether they are drawn.

    They are read from the file of the map, for pictures: the map of the game, and of its recording, is without them.
    None: the scenario says so, or the map is no OpenStreetMap file.

    Args:
        map: the map.
        given: the keys of the map as the scenario has them.
        folder: the folder of the scenario.
        ctx: the context of the game.

    Raises:
        BadValue: there is too much scenery around the streets.
    """
    file = map_file(map, folder)
    of_file = given.get("file")
    if file is None or (isinstance(of_file, Mapping) and "scenery" in of_file):
        return None
    from gamms import osm

    if file.suffix == ".gamms" or osm.is_geojson(file):
        return None
    return osm.scenery_from_file(file, ctx, buildings=len(ctx.graph.obstacle_columns().ids) == 0)


def _load_place(ctx: Context, given: MapPlace, options: Values) -> None:
    from gamms import osm

    ctx.graph.attach_networkx_graph(osm.graph_from_place(given.location, **options))
    if given.buildings:
        walls = {**_make_wall_options(given, options), "offline": given.offline}
        ctx.graph.add_obstacles(osm.obstacle_from_osm(given.location, crs=ctx.graph.crs, **walls))
    if given.scenery:
        drawn: dict[str, bool] = {"buildings": not given.buildings, "offline": given.offline}
        ctx.graph.graph.scenery = osm.scenery_from_osm(given.location, ctx, **drawn)


def _make_wall_options(given: MapFile | MapPlace, options: Values) -> Values:
    """Return the options for the walls of a map."""
    return {"barriers": given.barriers, "elevation": options.get("elevation")}


def _make_street_options(
    given: MapFile | MapPlace, mode: "ModeFunction | list[ModeFunction] | None", folder: Path | None
) -> Values:
    """Return the options for the streets of a map, as arguments of `gamms.osm` functions."""
    ours = ("path", "location", "buildings", "scenery", "barriers", "modes")
    options = {name: one for name, one in list_given_values(given).items() if name not in ours}
    if given.elevation is not None:
        where = f"map.{'file' if isinstance(given, MapFile) else 'place'}.elevation"
        options["elevation"] = find_path(given.elevation, folder, where, "file of heights")
    return options if mode is None else {**options, "osm_type": mode}


def _generate(ctx: Context, given: Code, library: CodeLibrary) -> None:
    """Attach the networkx graph that a function returns."""
    made = call_function(library.get(given.function, "map.generator"), given.with_, (), "map.generator")
    if not callable(getattr(made, "is_directed", None)):
        raise ScenarioError("map.generator", f"{given.function} gives {shown(made)}, which is not a networkx graph.")
    ctx.graph.attach_networkx_graph(made)
