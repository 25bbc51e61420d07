"""Fields of view as polygons and polylines, computed on demand for drawing."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from math import atan2, inf, pi

import numpy as np

from gamms.ir import geometry
from gamms.ir.graph import FloatArray, IntArray
from gamms.typing.graph_engine import OSMEdge

Point = Sequence[float] | FloatArray  # (3,)

_CORNERS = 48  # of a full circle
_AROUND = np.linspace(0.0, 2.0 * pi, _CORNERS, endpoint=False)
# of rays around the border of a cone, some of which miss the ground
_TURNS = np.linspace(0.0, 2.0 * pi, 96, endpoint=False)
_RINGS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of rays inside a cone, as shares of its half angle
_RAYS = 180  # rays along which a visible area is measured
# bisections of each ray, and of the angle between rays whose lengths differ by this share
_HALVINGS = 10
_ROUNDS = 4
_JUMP = 0.05
_RIM = 1e-9  # share of a radius: points on the border are inside in spite of rounding


def make_disc(x: float, y: float, radius: float) -> FloatArray:
    """Return the corners (48, 2) of a disc around a place; (0, 2) if the radius is infinite."""
    return _compute_arc(x, y, radius, _AROUND)


def make_sector(x: float, y: float, radius: float, heading: tuple[float, float], fov: float) -> FloatArray:
    """Return the corners (corners, 2) of a sector of `fov` radians around `heading`: its center, then the arc.

    Without a heading, (0.0, 0.0), the sector is a disc. Returns no corners, (0, 2), if the radius is infinite.
    """
    if fov >= 2.0 * pi or heading == (0.0, 0.0):
        return make_disc(x, y, radius)
    ahead = atan2(heading[1], heading[0])
    arc = _compute_arc(x, y, radius, np.linspace(ahead - fov / 2.0, ahead + fov / 2.0, _CORNERS))
    return np.vstack([[(x, y)], arc]) if len(arc) else arc


def find_area_in_sight(
    is_visible: Callable[[FloatArray], "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"],
    x: float,
    y: float,
    radius: float,
    heading: tuple[float, float],
    fov: float,
) -> FloatArray:
    """Return the corners (corners, 2) of the part of a sector visible from its center; (0, 2) for an infinite radius.

    Args:
        is_visible: returns whether each of some points (points, 2) is visible.
        x: x of the center.
        y: y of the center.
        radius: map units.
        heading: see `make_sector`.
        fov: full opening angle in radians.
    """
    if radius == inf:
        return np.zeros((0, 2))
    is_round = fov >= 2.0 * pi or heading == (0.0, 0.0)
    ahead, half = (pi, pi) if is_round else (atan2(heading[1], heading[0]), fov / 2.0)

    def reach(angles: FloatArray) -> FloatArray:
        rays = np.column_stack([np.cos(angles), np.sin(angles)])
        near = np.zeros(len(angles))
        far = np.full(len(angles), radius)
        middle = far
        for _ in range(_HALVINGS):
            is_free = is_visible((x, y) + rays * middle[:, None])
            near = np.where(is_free, middle, near)
            far = np.where(is_free, far, middle)
            middle = (near + far) / 2.0
        return near

    angles = np.linspace(ahead - half, ahead + half, _RAYS)
    reaches = reach(angles)
    for _ in range(_ROUNDS):
        jumps = np.flatnonzero(np.abs(np.diff(reaches)) > _JUMP * radius)
        between = (angles[jumps] + angles[jumps + 1]) / 2.0
        angles, reaches = (
            np.insert(known, jumps + 1, new) for known, new in ((angles, between), (reaches, reach(between)))
        )
    rim = np.column_stack([x + reaches * np.cos(angles), y + reaches * np.sin(angles)])
    return rim if is_round else np.vstack([[(x, y)], rim])


def make_footprint(position: Point, axis: Point, radius: float, fov: float) -> FloatArray:
    """Return the corners (corners, 2) of the ground, z = 0, inside a cone of view and at most `radius` from its tip.

    If the cone meets no ground, returns its shadow instead; (0, 2) if the view is unlimited.

    Args:
        position: (3,) the tip of the cone.
        axis: (3,) viewing direction, of any positive length.
        radius: map units, in 3D; may be infinite.
        fov: full opening angle in radians; from pi on, the cone is treated as a ball.
    """
    x, y, z = position
    if fov >= pi or radius == 0.0:
        return make_disc(x, y, radius)
    cone = _Cone(axis, fov / 2.0)
    rim = cone.make_rays(np.concatenate([_TURNS, cone.find_turns(-z / radius)]))
    reach = _measure_to_ground(z, rim)
    meets = (reach >= 0.0) & (reach < inf)
    if radius == inf and not meets.all():
        return np.zeros((0, 2))
    meets &= reach <= radius * (1.0 + _RIM)
    corners = np.array([x, y]) + rim[meets, :2] * reach[meets, None]
    if abs(z) < radius < inf:
        edge = make_disc(0.0, 0.0, np.sqrt(radius * radius - z * z))  # the radius on the ground
        is_seen = edge @ cone.axis[:2] - z * cone.axis[2] >= radius * np.cos(fov / 2.0)
        corners = np.vstack([corners, np.array([x, y]) + edge[is_seen]])
    outline = geometry.find_hull(corners)
    return outline if len(outline) >= 3 else make_shadow(position, axis, radius, fov)


def make_shadow(position: Point, axis: Point, radius: float, fov: float) -> FloatArray:
    """Return the corners (corners, 2) of the vertical shadow of a cone of view, limited by `radius` and by the ground.

    All visible points in the air are above it. The arguments are those of `make_footprint`.
    """
    x, y, z = position
    if fov >= pi or radius == inf:
        return make_disc(x, y, radius)
    rays = np.vstack([_Cone(axis, share * fov / 2.0).make_rays(_TURNS) for share in _RINGS])
    reach = _measure_to_ground(z, rays)
    reach = np.where((reach >= 0.0) & (reach <= radius), reach, radius)
    return geometry.find_hull(np.vstack([[(x, y)], np.array([x, y]) + rays[:, :2] * reach[:, None]]))


def join_polylines(edges: Iterable[OSMEdge]) -> tuple[FloatArray, IntArray]:
    """Return points (points, 2) and offsets (lines + 1,) of edges; straight edges are left out."""
    flats = [flat for edge in edges if len(flat := edge.points) >= 4]
    offsets = np.cumsum([0, *(len(flat) // 2 for flat in flats)], dtype=np.int64)
    return np.fromiter(chain.from_iterable(flats), np.float64).reshape(-1, 2), offsets


def _compute_arc(x: float, y: float, radius: float, angles: FloatArray) -> FloatArray:
    if radius == inf:
        return np.zeros((0, 2))
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


class _Cone:
    """Rays around an axis (3,), at an angle of `half` radians from it."""

    def __init__(self, axis: Point, half: float) -> None:
        self.axis = np.asarray(axis, np.float64) / np.linalg.norm(axis)
        aside = np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))])
        self._aside = np.sin(half) * aside / np.linalg.norm(aside)
        self._ahead = np.cos(half) * self.axis
        self._across = np.cross(self.axis, self._aside)

    def make_rays(self, turns: FloatArray) -> FloatArray:
        """Return unit rays (turns, 3) at angles around the axis."""
        around = np.outer(np.cos(turns), self._aside) + np.outer(np.sin(turns), self._across)
        rays: FloatArray = self._ahead + around
        return rays

    def find_turns(self, slope: float) -> FloatArray:
        """Return the angles around the axis (0 or 2,) at which rays have `slope` as their z."""
        tilt = np.hypot(self._aside[2], self._across[2])
        if abs(slope - self._ahead[2]) >= tilt:
            return np.zeros(0)
        highest = np.arctan2(self._across[2], self._aside[2])
        away = np.arccos((slope - self._ahead[2]) / tilt)
        return np.array([highest - away, highest + away])


def _measure_to_ground(z: float, rays: FloatArray) -> FloatArray:
    """Return distances to the ground along unit rays (rays, 3) from a height; negative behind, NaN or inf if none."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reach: FloatArray = -z / rays[:, 2]
    return reach
