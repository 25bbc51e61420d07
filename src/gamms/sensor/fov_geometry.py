"""Fields of view as polygons and polylines, for drawing: computed when asked for, never while sensing."""

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from math import atan2, inf, pi

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.typing.graph_engine import OSMEdge

Point = Sequence[float] | FloatArray  # (3,)

_CORNERS = 48  # of a full circle
_AROUND = np.linspace(0.0, 2.0 * pi, _CORNERS, endpoint=False)
_TURNS = np.linspace(0.0, 2.0 * pi, 96, endpoint=False)  # of rays around the rim of a cone: not all reach the ground
_RINGS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of rays inside a cone, as shares of its half angle
_RAYS = 180  # along which an area in sight is measured
_HALVINGS, _ROUNDS, _JUMP = 10, 4, 0.05  # of each ray, and of the angle where the next ray reaches so much less far
_RIM = 1e-9  # of a radius: what lies on its rim is inside, however it was rounded


def disc(x: float, y: float, radius: float) -> FloatArray:
    """Corners (48, 2) of the disc around a place; none (0, 2) where the radius is infinite."""
    return _arc(x, y, radius, _AROUND)


def sector(x: float, y: float, radius: float, heading: tuple[float, float], fov: float) -> FloatArray:
    """Corners (corners, 2) of the sector that opens `fov` radians around `heading`: its centre, then the arc.

    An agent without a heading, (0.0, 0.0), sees a disc. No corners, (0, 2), where the radius is infinite.
    """
    if fov >= 2.0 * pi or heading == (0.0, 0.0):
        return disc(x, y, radius)
    ahead = atan2(heading[1], heading[0])
    arc = _arc(x, y, radius, np.linspace(ahead - fov / 2.0, ahead + fov / 2.0, _CORNERS))
    return np.vstack([[(x, y)], arc]) if len(arc) else arc


def area_in_sight(
    is_visible: Callable[[FloatArray], "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"],
    x: float,
    y: float,
    radius: float,
    heading: tuple[float, float],
    fov: float,
) -> FloatArray:
    """Corners (corners, 2) of what of a sector is in sight from its centre; none (0, 2) where the radius is infinite.

    Args:
        is_visible: whether each of some points (points, 2) is in sight.
        x: of the centre.
        y: of the centre.
        radius: map units.
        heading: see `sector`.
        fov: full opening angle in radians.
    """
    if radius == inf:
        return np.zeros((0, 2))
    is_round = fov >= 2.0 * pi or heading == (0.0, 0.0)
    ahead, half = (pi, pi) if is_round else (atan2(heading[1], heading[0]), fov / 2.0)

    def reach(angles: FloatArray) -> FloatArray:
        rays = np.column_stack([np.cos(angles), np.sin(angles)])
        near, far = np.zeros(len(angles)), np.full(len(angles), radius)
        middle = far
        for _ in range(_HALVINGS):
            is_free = is_visible((x, y) + rays * middle[:, None])
            near, far = np.where(is_free, middle, near), np.where(is_free, far, middle)
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


def footprint(position: Point, axis: Point, radius: float, fov: float) -> FloatArray:
    """Corners (corners, 2) of the ground, z = 0, that is inside a cone of view and at most `radius` away from its tip.

    Where no ground is, the shadow of the cone stands in. None (0, 2) where the view has no end.

    Args:
        position: (3,) the tip of the cone.
        axis: (3,) where it looks, of any positive length.
        radius: map units, through the air; may be infinite.
        fov: full opening angle in radians; from pi on, the cone counts as a ball.
    """
    x, y, z = position
    if fov >= pi or radius == 0.0:
        return disc(x, y, radius)
    cone = _Cone(axis, fov / 2.0)
    rim = cone.rays(np.concatenate([_TURNS, cone.turns_that_fall(-z / radius)]))
    reach = _to_ground(z, rim)
    meets = (reach >= 0.0) & (reach < inf)
    if radius == inf and not meets.all():
        return np.zeros((0, 2))
    meets &= reach <= radius * (1.0 + _RIM)
    corners = np.array([x, y]) + rim[meets, :2] * reach[meets, None]
    if abs(z) < radius < inf:
        edge = disc(0.0, 0.0, np.sqrt(radius * radius - z * z))  # as far as the eye reaches on the ground
        is_seen = edge @ cone.axis[:2] - z * cone.axis[2] >= radius * np.cos(fov / 2.0)
        corners = np.vstack([corners, np.array([x, y]) + edge[is_seen]])
    outline = _hull(corners)
    return outline if len(outline) >= 3 else shadow(position, axis, radius, fov)


def shadow(position: Point, axis: Point, radius: float, fov: float) -> FloatArray:
    """Corners (corners, 2) of the shadow that a cone of view, cut off at `radius` and at the ground, casts from above.

    All that is seen in the air is over it. The arguments are those of `footprint`.
    """
    x, y, z = position
    if fov >= pi or radius == inf:
        return disc(x, y, radius)
    rays = np.vstack([_Cone(axis, share * fov / 2.0).rays(_TURNS) for share in _RINGS])
    reach = _to_ground(z, rays)
    reach = np.where((reach >= 0.0) & (reach <= radius), reach, radius)
    return _hull(np.vstack([[(x, y)], np.array([x, y]) + rays[:, :2] * reach[:, None]]))


def polylines(edges: Iterable[OSMEdge]) -> tuple[FloatArray, IntArray]:
    """Points (points, 2) and offsets (lines + 1,) of edges; those without a polyline are left out."""
    flats = [flat for edge in edges if len(flat := edge.points) >= 4]
    offsets = np.cumsum([0, *(len(flat) // 2 for flat in flats)], dtype=np.int64)
    return np.fromiter(chain.from_iterable(flats), np.float64).reshape(-1, 2), offsets


def _arc(x: float, y: float, radius: float, angles: FloatArray) -> FloatArray:
    if radius == inf:
        return np.zeros((0, 2))
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


class _Cone:
    """Rays around an axis (3,), all `half` radians away from it."""

    def __init__(self, axis: Point, half: float) -> None:
        self.axis = np.asarray(axis, np.float64) / np.linalg.norm(axis)
        aside = np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))])
        self._aside = np.sin(half) * aside / np.linalg.norm(aside)
        self._ahead, self._across = np.cos(half) * self.axis, np.cross(self.axis, self._aside)

    def rays(self, turns: FloatArray) -> FloatArray:
        """Unit rays (turns, 3), by how far around the axis each is."""
        around = np.outer(np.cos(turns), self._aside) + np.outer(np.sin(turns), self._across)
        rays: FloatArray = self._ahead + around
        return rays

    def turns_that_fall(self, slope: float) -> FloatArray:
        """Where around the axis (0 or 2,) the rays have `slope` as their z."""
        tilt = np.hypot(self._aside[2], self._across[2])
        if abs(slope - self._ahead[2]) >= tilt:
            return np.zeros(0)
        highest, away = np.arctan2(self._across[2], self._aside[2]), np.arccos((slope - self._ahead[2]) / tilt)
        return np.array([highest - away, highest + away])


def _to_ground(z: float, rays: FloatArray) -> FloatArray:
    """How far along each unit ray (rays, 3) from a height the ground is: negative behind, infinite or NaN nowhere."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reach: FloatArray = -z / rays[:, 2]
    return reach


def _hull(points: FloatArray) -> FloatArray:
    """Corners (corners, 2) of the convex hull, counter-clockwise."""
    ordered = sorted(set(map(tuple, points.tolist())))
    if len(ordered) < 3:
        return np.array(ordered, np.float64).reshape(-1, 2)
    halves = [_lower(ordered), _lower(ordered[::-1])]
    return np.array([corner for half in halves for corner in half[:-1]])


def _lower(points: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """The lower half of the hull of points that are in order (monotone chain)."""
    chain: list[tuple[float, ...]] = []
    for x, y in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], (x, y)) <= 0.0:
            chain.pop()
        chain.append((x, y))
    return chain


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    """Positive where the way from a over b to c bends to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
