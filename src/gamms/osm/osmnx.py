"""The one door to OSMnx: places, streets and features from map servers, or from what they answered before.

OSMnx asks, keeps the answers on disk and builds the graph in degrees; it never projects for us. While it works, `_door`
stands between it and the servers: waiting and retrying is bounded, an answer is checked before it is kept, and
everything that was changed is put back.
"""

import math
import socket
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from types import ModuleType
from typing import Any, NamedTuple, NoReturn
from urllib.parse import urlsplit

from gamms.arguments import as_float
from gamms.errors import BadType, BadValue, GammsError, MissingExtra, PlaceError, WrongVersion
from gamms.folders import cache_folder
from gamms.ir.geometry import shape_error
from gamms.osm.answers import fault_of_areas, fault_of_places, fault_of_streets, without_cut_ways
from gamms.osm.cache import AnswerCache
from gamms.osm.requests import MapServer
from gamms.progress import progress
from gamms.text import shown

_EXTRA = ("Loading places by name", "osm-online")
_BROKEN = ("2.0.0", "2.0.5", "2.0.6", "2.0.7", "2.1.0")  # the last four project one graph to two projections
_INSIDE = {  # what the door changes in OSMnx: modules and names in them
    "_http": ("requests", "socket", "_retrieve_from_cache", "_save_to_cache"),
    "_nominatim": ("requests", "time"),
    "_overpass": ("requests", "time", "_download_overpass_features"),
}
_DEFAULT_FOLDER = "./cache"  # of OSMnx: below wherever the program happens to run
_DEFAULT_DOH = "https://8.8.8.8/resolve?name={hostname}"
_SEARCH_S = 30.0  # Nominatim answers at once, unlike Overpass
_MOST_KM2 = 20_000.0
_KM_PER_DEGREE = 111.32
_FARTHEST = (180.0, 90.0)
_DATE_LINE = "it lies on both sides of the 180th meridian, where map servers end; take one side, or read a file"
_OTHER_PLACE = "Check the spelling, or use graph_from_point or graph_from_bbox."
_OTHER_STREETS = "Try a larger area, or another osm_type or custom_filter."
_OTHER_TAGS = "Try a larger area, or other tags."
_ONE_AT_A_TIME = threading.RLock()  # the door changes OSMnx for the whole process

Show = Callable[[str], None]
Location = str | dict[str, str] | Sequence[str | dict[str, str]]
Tags = dict[str, bool | str | list[str]]
Change = tuple[Any, str, Any]  # of a module: the name and the value that it gets


class StreetOptions(NamedTuple):
    """Which streets, in the words of OSMnx."""

    network_type: str
    simplify: bool
    retain_all: bool
    truncate_by_edge: bool
    custom_filter: str | list[str] | None


def streets_of_place(location: Location, options: StreetOptions, show: Show, *, offline: bool) -> Any:
    """The streets inside the boundary of a place, as OSMnx's MultiDiGraph in degrees.

    Raises:
        BadType, BadValue: the location is impossible.
        PlaceError, NetworkError: there is no such map, or no answer.
        MissingExtra, WrongVersion: OSMnx is not installed, or does not work.
    """
    _check_location(location)
    with _door(repr(location), fault_of_streets, show, offline=offline) as osmnx:
        return _streets(osmnx, _boundary(osmnx, location, show), repr(location), options, show)


def streets_of_polygon(polygon: Any, name: str, options: StreetOptions, show: Show, *, offline: bool) -> Any:
    """The streets inside a shapely Polygon or MultiPolygon in degrees; raises what `streets_of_place` raises."""
    if getattr(polygon, "geom_type", None) not in ("Polygon", "MultiPolygon"):
        raise BadType(
            f"polygon must be a shapely Polygon or MultiPolygon of (longitude, latitude), not {shown(polygon)}."
        )
    fault = _fault_of(polygon)
    if fault:
        raise BadValue(f"The area {name} is impossible: {fault}.")
    with _door(name, fault_of_streets, show, offline=offline) as osmnx:
        return _streets(osmnx, polygon, name, options, show)


def features_of_place(location: Location, tags: Tags, *, offline: bool = False) -> list[tuple[Any, dict[str, str]]]:
    """The areas with some of these tags in a place: shapely polygons in degrees, each with all of its tags.

    Raises:
        BadType, BadValue: the location or the tags are impossible.
        PlaceError, NetworkError: there is no such place, nothing in it, or no answer.
        MissingExtra, WrongVersion: OSMnx is not installed, or does not work.
    """
    _check_location(location)
    _check_tags(tags)
    name = repr(location)
    with progress(1.0 if offline else 0.0) as show, _door(name, fault_of_areas, show, offline=offline) as osmnx:
        boundary = _boundary(osmnx, location, show)
        show(f"Downloading the features of {name}")
        whole = [(osmnx._overpass, "_download_overpass_features", _whole_features(osmnx._overpass))]
        with _explained(f"There is nothing tagged {', '.join(tags)} in {name}", _OTHER_TAGS), _changed(whole):
            areas = _areas(osmnx.features.features_from_polygon(boundary, dict(tags)))
            if not areas:
                raise ValueError("the answer has no areas")
            return areas


def _boundary(osmnx: Any, location: Location, show: Show) -> Any:
    name = repr(location)
    show(f"Asking {osmnx.settings.nominatim_url} where {name} is")
    query = location if isinstance(location, (str, dict)) else list(location)
    with _explained(f"There is no place {name}, or its boundary is not on the map", _OTHER_PLACE):
        polygon = osmnx.geocoder.geocode_to_gdf(query).union_all()
    fault = _fault_of(polygon)
    if fault:
        raise PlaceError(f"The boundary of {name} is of no use: {fault}. Name a part of it, or use graph_from_bbox.")
    return polygon


def _streets(osmnx: Any, polygon: Any, name: str, options: StreetOptions, show: Show) -> Any:
    show(f"Downloading the streets of {name} from {osmnx.settings.overpass_url}")
    kind = options.custom_filter or options.network_type
    with _explained(f"There are no streets of the type {kind!r} in {name}", _OTHER_STREETS):
        graph = osmnx.graph.graph_from_polygon(polygon, **options._asdict())
        graph.remove_nodes_from([node for node, degree in graph.degree() if degree == 0])
        if not graph.number_of_edges():
            raise ValueError("the answer has nodes only")
        return graph


def _whole_features(overpass: Any) -> Callable[..., Iterator[Any]]:
    download = overpass._download_overpass_features

    def whole(*asked: Any) -> Iterator[Any]:
        yield from map(without_cut_ways, download(*asked))

    return whole


def _areas(frame: Any) -> list[tuple[Any, dict[str, str]]]:
    """The polygons of a GeoDataFrame; a cell without a tag holds NaN."""
    rows = zip(frame.geometry, frame.drop(columns="geometry").to_dict("records"), strict=True)
    return [
        (shape, {key: text for key, text in cells.items() if isinstance(text, str)})
        for shape, cells in rows
        if shape.geom_type in ("Polygon", "MultiPolygon")
    ]


@contextmanager
def _explained(nothing: str, way_out: str) -> Iterator[None]:
    """Whatever OSMnx says of answers without what it needs, say it with the place and the way out."""
    try:
        yield
    except GammsError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, shape_error()) as error:
        raise PlaceError(f"{nothing} (OSMnx says: {str(error) or repr(error)}). {way_out}") from error


@contextmanager
def _door(name: str, fault_of_map: Callable[[Any], str], show: Show, *, offline: bool) -> Iterator[Any]:
    """OSMnx, changed for as long as the door is open."""
    # What OSMnx calls in pandas and geopandas is no business of the user of GAMMS.
    with _ONE_AT_A_TIME, warnings.catch_warnings():
        for category in (DeprecationWarning, PendingDeprecationWarning, FutureWarning):
            warnings.simplefilter("ignore", category)
        show("Loading OSMnx")
        osmnx = _osmnx()
        _check_addresses(osmnx.settings)
        with _changed(_settings(osmnx.settings, offline=offline)):
            http = osmnx._http
            cache = AnswerCache(
                name=name,
                folder=str(osmnx.settings.cache_folder),
                fault_of_map=fault_of_map,
                offline=offline,
                load=http._retrieve_from_cache,
                save=http._save_to_cache,
            )
            changes = _blocked(osmnx, cache) if offline else _bounded(osmnx, fault_of_map, show)
            with _changed(
                [*changes, (http, "_retrieve_from_cache", cache.retrieve), (http, "_save_to_cache", cache.keep)]
            ):
                yield osmnx
                cache.keep_rest()


def _osmnx() -> Any:
    try:
        import osmnx
    except ImportError as error:
        raise MissingExtra(*_EXTRA) from error
    installed = version("osmnx")
    if installed in _BROKEN or installed.startswith(("0.", "1.")):
        _unfit(f"is one of the releases that corrupt maps or are too old ({', '.join(_BROKEN)}, 1 and before)")
    if not all(hasattr(getattr(osmnx, module, None), name) for module, names in _INSIDE.items() for name in names):
        _unfit("is built differently from those that this version of GAMMS knows, 2.0.1 to 2.1.1")
    return osmnx


def _unfit(why: str) -> NoReturn:
    raise WrongVersion(f'OSMnx {version("osmnx")} {why}. Install another: pip install --upgrade "gamms[{_EXTRA[1]}]"')


def _settings(settings: Any, *, offline: bool) -> list[Change]:
    """Ours, but only where the user has not chosen otherwise."""
    changes: list[Change] = []
    if str(settings.cache_folder) == _DEFAULT_FOLDER:
        changes.append((settings, "cache_folder", cache_folder("osmnx")))
    if settings.doh_url_template == _DEFAULT_DOH:
        changes.append((settings, "doh_url_template", None))  # nobody else is asked where the servers are
    if offline:
        changes.append((settings, "use_cache", True))
    return changes


def _bounded(osmnx: Any, fault_of_map: Callable[[Any], str], show: Show) -> list[Change]:
    """OSMnx's modules with our servers in place of `requests` and `time`, with which it would retry for ever."""
    settings, search, map_ = osmnx.settings, osmnx._nominatim, osmnx._overpass
    patience_s = float(settings.requests_timeout)
    nominatim = MapServer(settings.nominatim_url, fault_of_places, min(patience_s, _SEARCH_S), show)
    overpass = MapServer(settings.overpass_url, fault_of_map, patience_s, show)
    return [
        (search, "requests", _StandIn(search.requests, get=nominatim.get)),
        (search, "time", _StandIn(search.time, sleep=nominatim.sleep)),
        (map_, "requests", _StandIn(map_.requests, get=overpass.status, post=overpass.post)),
        (map_, "time", _StandIn(map_.time, sleep=overpass.sleep)),
        (socket, "getaddrinfo", socket.getaddrinfo),  # OSMnx changes it, and leaves it so
    ]


def _blocked(osmnx: Any, cache: AnswerCache) -> list[Change]:
    """OSMnx's modules without a way to the network."""
    modules = (osmnx._http, osmnx._nominatim, osmnx._overpass)
    changes = [
        (module, "requests", _StandIn(module.requests, get=cache.refuse, post=cache.refuse)) for module in modules
    ]
    return [*changes, (osmnx._http, "socket", _StandIn(socket, gethostbyname=cache.refuse))]


@contextmanager
def _changed(changes: Sequence[Change]) -> Iterator[None]:
    """Set these names of modules, and put back what was there."""
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in changes]
    try:
        for owner, name, value in changes:
            setattr(owner, name, value)
        yield
    finally:
        for owner, name, value in before:
            setattr(owner, name, value)


class _StandIn:
    """A module in which some names mean something else."""

    def __init__(self, module: ModuleType, **replaced: Any) -> None:
        self._module = module
        self.__dict__.update(replaced)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)


def _check_addresses(settings: Any) -> None:
    if as_float(settings.requests_timeout, "osmnx.settings.requests_timeout") <= 0.0:
        raise BadValue(f"osmnx.settings.requests_timeout must be more than 0 seconds, not {settings.requests_timeout}.")
    for name in ("nominatim_url", "overpass_url"):
        parts = urlsplit(str(getattr(settings, name)))
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise BadValue(
                f"osmnx.settings.{name} is {getattr(settings, name)!r}, which is no address of a server. "
                "Set one that begins with http:// or https://."
            )


def _check_location(location: object) -> None:
    places = location if isinstance(location, (list, tuple)) else [location]
    for place in places:
        texts: list[Any] = [*place.keys(), *place.values()] if isinstance(place, dict) else [place]
        if not all(isinstance(text, str) for text in texts):
            raise BadType(
                f"location must be the name of a place, a dict such as {{'city': 'Turku'}} or a list of these, "
                f"not {shown(location)} ({type(location).__name__})."
            )
        if not any(text.strip() for text in texts):
            raise BadValue(f"location must name a place, not {shown(location)}.")
    if not places:
        raise BadValue("location must name a place, not be an empty list.")


def _check_tags(tags: object) -> None:
    if not isinstance(tags, dict):
        raise BadType(f"tags must be a dict such as {{'building': True}}, not {shown(tags)} ({type(tags).__name__}).")
    if not tags:
        raise BadValue("tags must name what to look for, such as {'building': True}, not be empty.")
    for key, value in tags.items():
        values = value if isinstance(value, list) else [value]
        if not isinstance(key, str) or not (value is True or all(isinstance(one, str) for one in values)):
            raise BadType(f"tags[{shown(key)}] must be True, a text or a list of texts, not {shown(value)}.")


def _fault_of(polygon: Any) -> str:
    """Why no map can be made of the area inside a shapely shape, in words."""
    if polygon.geom_type not in ("Polygon", "MultiPolygon"):
        return f"it is a {polygon.geom_type}, not an area"
    west, south, east, north = polygon.bounds
    if max(-west, east) <= _FARTHEST[0] < east - west:  # of a circle around the meridian, the outline crosses itself
        return _DATE_LINE
    if polygon.is_empty or not polygon.is_valid:
        return "its outline is empty or crosses itself"
    if max(-west, east) > _FARTHEST[0] or max(-south, north) > _FARTHEST[1]:
        return f"its bounds {polygon.bounds} are not degrees of longitude and latitude"
    km2 = polygon.area * _KM_PER_DEGREE**2 * math.cos(math.radians((south + north) / 2.0))
    return f"it has {km2:.0f} km², and {_MOST_KM2:.0f} km² are the most" if km2 > _MOST_KM2 else ""
