"""The map of a game as a page has it: what is drawn of it, in columns of small integers."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from gamms.graph.map_file import MAGIC, VERSION, base_map_of, scenery_called, unframed
from gamms.ir.graph import FloatArray
from gamms.ir.packing import to_bytes

_STEPS = 1 << 18  # in which coordinates are rounded, of the larger side of the map: a town to some millimetres
_LAT_LON_STEP = 2.0**-23  # degrees: a centimetre
_READ = (
    *("crs", "attribution", "node_ids", "sources", "targets", "bend_rows", "bend_sizes", "face_types"),
    *("node_attributes", "edge_attributes"),
)


def drawn_map(
    world: bytes, attributes: Collection[str] | None = None, lat_lon: "np.ndarray[Any, Any] | None" = None
) -> bytes:
    """Return what is drawn of a map, with its scenery, as the bytes of a plain value.

    Args:
        world: the map, as it is saved.
        attributes: those that it keeps; None: all.
        lat_lon: (nodes, 2) degrees, which it then has, too; rounded to a centimetre.
    """
    state = unframed(world, MAGIC, VERSION)
    base = state["base_map"] if "base_map" in state else base_map_of(scenery_called(state.get("scenery")))
    if len(state["face_ids"]):  # which are drawn instead
        base = base | {name: base[name][:0] for name in ("face_types", "face_corners")}
    step = _step(state["xy"])
    drawn: dict[str, Any] = {name: state[name] for name in _READ}
    drawn |= {"step": step, "base_map": {name: base[name] for name in ("kinds", "sizes", "face_types")}}
    for of, name, width in (
        (state, "xy", 2),
        (state, "bend_points", 2),
        (state, "face_corners", 3),
        (base, "points", 2),
        (base, "face_corners", 3),
    ):
        to = drawn if of is state else drawn["base_map"]
        to[name] = in_steps(of[name].reshape(-1, width), step)
    if attributes is not None:
        drawn |= {kind: _chosen(state[kind], attributes) for kind in ("node_attributes", "edge_attributes")}
    if lat_lon is not None:
        drawn["lat_lon"] = np.round(lat_lon / _LAT_LON_STEP) * _LAT_LON_STEP
    return to_bytes(drawn, "A map")


def in_steps(points: FloatArray, step: float) -> "np.ndarray[Any, Any]":
    """Return points (points, axes) as integers (axes, points): along a line their differences are small."""
    return narrow(np.rint(points.T / step).astype(np.int64))


def narrow(numbers: "Sequence[int] | np.ndarray[Any, Any]") -> "np.ndarray[Any, Any]":
    """Return integers in the smallest type that holds all of them."""
    wide = np.asarray(numbers, np.int64)
    low, high = (int(wide.min()), int(wide.max())) if wide.size else (0, 0)
    return wide.astype(np.promote_types(np.min_scalar_type(min(low, -1)), np.min_scalar_type(-1 - max(high, 0))))


def _chosen(attributes: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    return {name: column for name, column in attributes.items() if name in names}


def _step(xy: "np.ndarray[Any, Any]") -> float:
    """Return a power of two in whose multiples coordinates are written."""
    extent = float(np.ptp(xy, axis=0).max()) if len(xy) else 0.0
    return float(2.0 ** np.floor(np.log2(extent / _STEPS))) if extent > 0.0 else 2.0**-32
