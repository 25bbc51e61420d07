"""Positions on a map: projection to degrees and back, nearest nodes, and random nodes."""

from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_int, as_range, convert_index
from gamms.errors import BadType, BadValue
from gamms.graph import records
from gamms.graph.store import GraphStore
from gamms.ir import projection
from gamms.ir.graph import FloatArray, IntArray, label_hint
from gamms.text import shown
from gamms.typing.graph_engine import IGraph
from gamms.typing.graph_values import Numbers

if TYPE_CHECKING:
    from numpy.random import Generator

_NEAR_M = 1_000.0  # within this distance no place counts as too far
# degrees; both -10 and 350 are in use for the same meridian
_MOST_LAT = 90.0
_MOST_LON = 360.0
_TRIES = 20  # attempts to place nodes with a minimum distance


def nearest_node(store: GraphStore, xy: tuple[Any, Any], latlon: tuple[Any, Any], within: float | None) -> Any:
    """Return the id of the node nearest to a place, or the nearest ids (places,) for several places."""
    if not len(store.nodes):
        raise BadValue("The graph has no nodes, so none is nearest. Add nodes first.")
    nearest = store.indexes.find_nearest
    x, y = xy
    is_one = type(x) is type(y) is float and isfinite(x) and isfinite(y)
    if is_one and within is None and latlon[0] is None and latlon[1] is None:
        return store.nodes.ids[nearest(x, y)]  # NOTE: flying agents ask this every turn (benchmarks: flyers)
    limit = None if within is None else as_range(within, "within")
    places = convert_places(store.crs, xy, latlon)
    rows = store.indexes.find_nearest_each(*places.reshape(-1, 2).T)
    known = store.nodes.get_array("xy")
    if limit is not None:
        _refuse_beyond(limit, places.reshape(-1, 2), known[rows])
    elif latlon[0] is not None and store.crs is not None:
        refuse_far(store.crs, known[store.nodes.list_living()], places.reshape(-1, 2), known[rows])
    ids = store.nodes.get_array("ids")[rows]
    return int(ids[0]) if places.ndim == 1 else ids


def place(
    store: GraphStore,
    n: int,
    near: int | tuple[float, float] | None,
    radius: float | None,
    apart: float,
    rng: "Generator | int | None",
    leaving: IGraph | None = None,
) -> list[int]:
    """Return the ids of `n` different random nodes; `leaving`: a graph with these nodes in which edges leave each."""
    demand = _PlacementRequest(_count(n), as_range(apart, "apart"), _find_disc(store, near, radius))
    stream = _make_generator(rng)
    candidates = _find_candidates(store, demand)
    if leaving is not None:
        leads_to = leaving.neighborhoods
        candidates = candidates[[len(leads_to[store.nodes.ids[row]]) > 1 for row in candidates.tolist()]]
    best: list[int] = []
    for _ in range(_TRIES if demand.apart > 0.0 and len(candidates) >= demand.n else 1):
        drawn = _draw_rows(store, candidates[stream.permutation(len(candidates))], demand)
        if len(drawn) == demand.n:
            ids = store.nodes.ids
            return [ids[row] for row in drawn]
        best = max(best, drawn, key=len)
    raise BadValue(demand.describe_refusal(len(best)))


def to_latlon(crs: str | None, x: Numbers, y: Numbers) -> tuple[Any, Any]:
    """Return latitude and longitude in degrees: floats for numbers, arrays for arrays."""
    known = _check_crs(crs, "graph.to_latlon(x, y)")
    xy = as_pairs(x, y, ("x", "y"))
    lonlat = projection.project_back_and_forth(xy.reshape(-1, 2), known, projection.WGS84).reshape(xy.shape)
    return _get_column(lonlat, 1), _get_column(lonlat, 0)


def from_latlon(crs: str | None, lat: Numbers, lon: Numbers) -> tuple[Any, Any]:
    """Return map units x and y: floats for numbers, arrays for arrays."""
    xy = _project(crs, lat, lon, "graph.from_latlon(lat=, lon=)")
    return _get_column(xy, 0), _get_column(xy, 1)


def convert_places(crs: str | None, xy: tuple[Any, Any], latlon: tuple[Any, Any]) -> FloatArray:
    """Return places (2,) or (places, 2) in map units, given as x and y or as latitude and longitude.

    Raises:
        BadType: neither pair is complete, or both are given.
    """
    is_xy, is_latlon = ([value is not None for value in pair] for pair in (xy, latlon))
    if all(is_xy) and not any(is_latlon):
        return as_pairs(*xy, ("x", "y"))
    if all(is_latlon) and not any(is_xy):
        return _project(crs, *latlon, "graph.nearest_node(lat=, lon=)")
    raise BadType("Give a place as nearest_node(x, y) or as nearest_node(lat=…, lon=…).")


def _refuse_beyond(limit: float, places: FloatArray, nearest: FloatArray) -> None:
    off = np.hypot(*(places - nearest).T)
    far = np.flatnonzero(off > limit)
    if len(far):
        x, y = places[far[0]].tolist()
        raise BadValue(f"({x:.9g}, {y:.9g}) is {off[far[0]]:,.1f} from the nearest node, which is more than {limit:g}.")


def refuse_far(crs: str, nodes: FloatArray, places: FloatArray, nearest: FloatArray) -> None:
    """Refuse places that lie off the map.

    Args:
        crs: the CRS of the map.
        nodes: (nodes, 2) at least one node of the map.
        places: (places, 2)
        nearest: (places, 2) their nearest nodes.

    Raises:
        BadValue: the distance of a place from the map exceeds the width of the map and 1 km.
    """
    bounds = np.stack((nodes.min(axis=0), nodes.max(axis=0)))
    south_west, north_east = projection.project(bounds, crs, projection.WGS84)
    width = float(projection.measure_on_ellipsoid(south_west[None], north_east[None])[0])
    there, near = (projection.project(points, crs, projection.WGS84) for points in (places, nearest))
    off = projection.measure_on_ellipsoid(there, near)
    far = np.flatnonzero(off > max(width, _NEAR_M))
    if len(far):
        (west, south), (east, north), (lon, lat) = (point.tolist() for point in (south_west, north_east, there[far[0]]))
        raise BadValue(
            f"lat={lat:.6g}, lon={lon:.6g} is {off[far[0]] / 1000.0:,.1f} km from the nearest node: the map reaches "
            f"from lat={south:.6g}, lon={west:.6g} to lat={north:.6g}, lon={east:.6g}. Is this the right map?"
        )


def as_pairs(first: Numbers, second: Numbers, names: tuple[str, str]) -> FloatArray:
    """Return two numbers as (2,), or two arrays of equal length as (places, 2); all finite.

    Raises:
        BadType: the values are not numbers.
        BadValue: the shapes differ, or a number is not finite.
    """
    arrays = [_check_numbers(value, name) for value, name in zip((first, second), names, strict=True)]
    if arrays[0].shape != arrays[1].shape or arrays[0].ndim > 1:
        raise BadValue(
            f"{names[0]} and {names[1]} must be two numbers or two arrays of one length, not of the shapes "
            f"{arrays[0].shape} and {arrays[1].shape}."
        )
    return np.stack(arrays, axis=-1)


def _project(crs: str | None, lat: Numbers, lon: Numbers, call: str) -> FloatArray:
    known = _check_crs(crs, call)
    lonlat = as_pairs(lon, lat, ("lon", "lat"))
    for name, most, values in (("lat", _MOST_LAT, lonlat[..., 1]), ("lon", _MOST_LON, lonlat[..., 0])):
        wrong = values[np.abs(values) > most]
        if wrong.size:
            raise BadValue(f"{name} must lie between -{most:g} and {most:g} degrees, not {wrong.flat[0]}.")
    return projection.project_back_and_forth(lonlat.reshape(-1, 2), projection.WGS84, known).reshape(lonlat.shape)


def _check_crs(crs: str | None, call: str) -> str:
    if crs is None:
        raise BadValue(
            f"{call} needs to know what x and y mean: set graph.crs to the coordinate reference system of the map, "
            "such as 'EPSG:32635'."
        )
    return crs


def _check_numbers(values: Numbers, name: str) -> FloatArray:
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise BadType(f"{name} must be a number or an array of numbers: {error}.") from None
    if array.size == 0:
        array = array.astype(np.float64)
    if array.dtype.kind not in "iuf":
        raise BadType(f"{name} must be a number or an array of numbers, not {shown(values)}.")
    array = array.astype(np.float64, copy=False)
    wrong = array[~np.isfinite(array)]
    if wrong.size:
        raise BadValue(f"{name} must be finite, not {wrong.flat[0]}.")
    return array


def _get_column(pairs: FloatArray, which: int) -> Any:
    return float(pairs[which]) if pairs.ndim == 1 else pairs[:, which].copy()


class _PlacementRequest(NamedTuple):
    """The checked arguments of `place`."""

    n: int
    apart: float
    disc: tuple[float, float, float] | None  # x, y, radius

    def describe_refusal(self, placed: int) -> str:
        """Return the message for a request of more nodes than fit."""
        words = f"Only {placed} of {self.n} nodes could be placed"
        ways_out = ["ask for fewer"]
        if self.disc is not None:
            words += " within {2:g} of ({0:g}, {1:g})".format(*self.disc)
            ways_out.append("a larger radius")
        if self.apart > 0.0:
            words += f" at least {self.apart:g} apart"
            ways_out.append("a smaller apart")
        return f"{words}; {' or '.join(ways_out)}."


def _find_candidates(store: GraphStore, demand: _PlacementRequest) -> IntArray:
    if demand.disc is None or demand.disc[2] == np.inf:
        return store.nodes.list_living()
    return store.indexes.find_nodes_within(*demand.disc)


def _draw_rows(store: GraphStore, rows: IntArray, demand: _PlacementRequest) -> list[int]:
    """Return the first rows, as many as requested, that are far enough from all rows chosen before."""
    if demand.apart == 0.0:
        drawn: list[int] = rows[: demand.n].tolist()
        return drawn
    xy = store.nodes.get_array("xy")
    is_blocked = np.zeros(len(xy), np.bool_)
    drawn = []
    for row in rows.tolist():
        if len(drawn) == demand.n:
            break
        if not is_blocked[row]:
            drawn.append(row)
            is_blocked[_find_closer(store, xy, row, demand.apart)] = True
    return drawn


def _find_closer(store: GraphStore, xy: FloatArray, row: int, apart: float) -> IntArray:
    x, y = xy[row].tolist()
    around = store.nodes.list_living() if apart == np.inf else store.indexes.find_nodes_within(x, y, apart)
    with np.errstate(over="ignore"):  # an infinite distance is a valid result
        found: IntArray = around[np.hypot(*(xy[around] - (x, y)).T) < apart]
    return found


def _count(n: object) -> int:
    count = as_int(n, "n")
    if count < 0:
        raise BadValue(f"n must not be negative, not {count}.")
    return count


def _find_disc(
    store: GraphStore, near: int | tuple[float, float] | None, radius: float | None
) -> tuple[float, float, float] | None:
    if (near is None) != (radius is None):
        given, missing = ("near", "radius") if radius is None else ("radius", "near")
        raise BadValue(f"place(…) got {given}= without {missing}=: give both, or neither for the whole graph.")
    if near is None:
        return None
    try:
        row = store.nodes.find(records.as_id(convert_index(near), "a node"))
        x = store.nodes.xy[2 * row]
        y = store.nodes.xy[2 * row + 1]
    except TypeError:
        x, y = _find_point(store, near)
    return x, y, as_range(radius, "radius")


def _find_point(store: GraphStore, near: int | tuple[float, float]) -> tuple[float, float]:
    try:
        x, y = near  # type: ignore[misc] # the except is the check
    except (TypeError, ValueError):
        hint = label_hint(near, store)
        raise BadType(f"near must be the id of a node or a pair (x, y), not {shown(near)}.{hint}") from None
    return as_float(x, "x of near"), as_float(y, "y of near")


def _make_generator(rng: "Generator | int | None") -> "Generator":
    from numpy.random import Generator

    if isinstance(rng, Generator):
        return rng
    if rng is None:
        raise BadType(
            "place(…) draws at random and needs rng=, a numpy Generator or a seed, such as rng=ctx.rng; "
            "ctx.graph.place(…) has its own stream."
        )
    return kernels.stream(as_int(rng, "rng"), "graph", "place")
