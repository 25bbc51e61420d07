"""Test which sight lines are blocked by quadrangles in space, exactly and with culling of distant faces.

The corners of a quadrangle are in the order of `ir.obstacles`: top right, top left, bottom right, bottom left. A
quadrangle consists of the triangles (top left, top right, bottom right) and (top left, bottom right, bottom left), each
tested with the method of Möller and Trumbore ("Fast, minimum storage ray/triangle intersection", 1997), all borders
included: a line that touches a triangle within the rounding of the coordinates is blocked, and so is a line that begins
or ends on it. A sight line that runs along a triangle passes it; so does a line of length zero.
"""

from typing import NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.csr import expand_ranges

_LEAST = 1e-9  # smaller determinants mean that the line is parallel to the triangle
_GRAIN = 1e-11  # so do determinants below this share of |line| * size ** 2: they are rounding errors
_ROUNDING = 2.0**-48  # products of three differences are exact to this share of the product of their lengths
_MOST_SLACK = 1e-5  # largest uncertainty from rounding, as a share of the face and of the line
# With determinants above `_GRAIN`, rounding moves the point of intersection by less than this share of the distance
# between observer and face plus twice the size of the face (docs/decisions/0009); the fast form widens faces by it.
_BLUR = 1e-3
_TURN = 2.0 * np.pi
MARGIN = 0.01  # how far beyond its box a face may block a line, as a share of the sizes of both boxes
# NOTE: few pairs at a time, because the nearest faces hide most targets (decision 0009).
_SHARE = 8  # one in this many pairs of face and target is tested at a time,
_FEW = 512  # but at least this many for each observer
_MOST_FEW = 1 << 12  # or than these
_MANY = 1 << 14  # pairs between two removals of hidden pairs
_MANY_TARGETS = 384  # number of targets from which occlusion by walls is computed first
_PARTS = 512  # sectors of a full turn by which directions are compared; a power of two
_EDGE = 1e-6  # share of a sector; more than rounding moves a direction
_MOST = 1e90  # larger numbers may overflow when multiplied
# Determinants of walls that hide everything behind them are above this share of size * distance**2, so that rounding
# opens no gap between their triangles (docs/decisions/0085).
_SURE = 1e-4


def find_blocking(origins: FloatArray, targets: FloatArray, corners: FloatArray) -> BoolArray:
    """Return whether each quadrangle blocks its own sight line.

    Args:
        origins: (lines, 3) positions of the observers; or (3,), one for all lines.
        targets: (lines, 3) positions of the targets.
        corners: (lines, 4, 3) corners of the quadrangle of each line.

    Returns:
        (lines,) False if the numbers are too large to multiply three of them.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        return _find_blocked(_split_axes(np.atleast_2d(origins)), _split_axes(targets), _split_axes(corners))


def find_visible(corners: FloatArray, origin: FloatArray, targets: FloatArray) -> BoolArray:
    """Return whether no quadrangle blocks the line to each target: `find_blocking` for all pairs, but faster.

    Args:
        corners: (faces, 4, 3)
        origin: (3,)
        targets: (targets, 3)
    """
    seen = np.ones(len(targets), np.bool_)
    if not len(targets) or not len(corners):
        return seen
    if len(targets) >= _MANY_TARGETS:
        walls = np.count_nonzero(_are_walls(corners, np.append(targets[:, 2], origin[2])))
        if 2 * walls > len(corners):
            from_origin: BoolArray = find_visible_from_each(corners, origin[None], targets, seen[None])[0]
            return from_origin
    observer = _split_axes(origin[None])
    ends = _split_axes(targets)
    quads = _split_axes(corners)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        near = _pair_faces_and_targets(quads[:3] - observer[:3, None], ends[:3] - observer[:3])
        done = 0
        first = 0
        while first < len(near.faces):
            last = max(int(near.ends.searchsorted(done + _MANY, side="right")), first + 1)
            faces, rows = _list_pairs(near, slice(first, last), seen)
            while len(faces):  # the nearest faces hide most targets, which saves tests of the others
                some = slice(max(len(faces) // _SHARE, _FEW))
                blocked = _find_blocked(observer, ends.take(rows[some], axis=1), quads.take(faces[some], axis=2))
                seen[rows[some][blocked]] = False
                faces = faces[some.stop :]
                rows = rows[some.stop :]
                is_open = seen[rows]
                faces = faces[is_open]
                rows = rows[is_open]
            done = int(near.ends[last - 1])
            first = last
    return seen


def find_visible_from_each(
    corners: FloatArray, origins: FloatArray, targets: FloatArray, is_asked: BoolArray
) -> BoolArray:
    """Return a mask of the requested lines that no quadrangle blocks: `find_blocking` for all of them, but faster.

    Arrays of (observers, targets) and (observers, faces) are held in memory.

    Args:
        corners: (faces, 4, 3)
        origins: (observers, 3) close to each other for best speed.
        targets: (targets, 3)
        is_asked: (observers, targets) the requested lines.
    """
    if not is_asked.any() or not len(corners):
        return is_asked
    if not max(np.abs(numbers).max() for numbers in (corners, origins, targets)) < _MOST:
        found = [find_visible(corners, origin, targets) for origin in origins]
        return np.asarray(is_asked & found)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        return _find_visible(_split_axes(corners), _split_axes(origins), _split_axes(targets), is_asked)


def _split_axes(vectors: FloatArray) -> FloatArray:
    """Return vectors (lines, …, 3) as (5, …, lines): x, y, z, x, y, which shortens cross products."""
    return vectors.T.take(_WRAPPED, axis=0)


_WRAPPED = np.array([0, 1, 2, 0, 1])


def _find_blocked(origins: FloatArray, targets: FloatArray, corners: FloatArray) -> BoolArray:
    """Return `find_blocking`, with `_split_axes` of all arguments."""
    line = (targets - origins)[:, None]
    to_observer = origins[:, None] - corners[:, 1:2]
    first = corners[:, 0:4:2] - corners[:, 1:2]  # (5, triangles, lines)
    second = corners[:, 2:4] - corners[:, 1:2]
    across = _multiply_cross(line, second)
    det = _multiply_dot(first, across)
    sign = np.copysign(1.0, det)
    u = sign * _multiply_dot(to_observer, across)  # this and all below are multiplied by the determinant
    turned = _multiply_cross(to_observer, first)
    v = sign * _multiply_dot(line, turned)
    t = sign * _multiply_dot(second, turned)
    det = np.abs(det)
    size = _measure_extent(corners[:3].max(axis=1) - corners[:3].min(axis=1))
    length = _measure_extent(line[:, 0])
    missed_by = np.maximum(np.maximum(u + v, t) - det, -np.minimum(np.minimum(u, v), t))
    inside = missed_by <= _MOST_SLACK * det
    inside &= (det >= np.maximum(_GRAIN * length * size * size, _LEAST)) & (det < np.inf)
    is_close = inside & (missed_by > 0.0)
    if is_close.any():
        far = 2.0 * _measure_extent(origins) + _measure_extent(to_observer[:, 0]) + size
        doubt = np.minimum(_ROUNDING * far * size, _MOST_SLACK * det / (length + size))
        is_beside = np.maximum(u + v - det, -np.minimum(u, v)) > doubt * length
        inside &= ~(is_beside | (np.maximum(t - det, -t) > doubt * size))
    blocked: BoolArray = inside[0] | inside[1]
    return blocked


def _measure_extent(vectors: FloatArray) -> FloatArray:
    """Return the lengths of vectors as sums over the axes."""
    lengths = np.abs(vectors[:3])
    added: FloatArray = lengths[0] + lengths[1] + lengths[2]
    return added


def _multiply_cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return cross products (3, …)."""
    return a[1:4] * b[2:5] - a[2:5] * b[1:4]


def _multiply_dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return dot products, added from x to z."""
    parts = a[:3] * b[:3]
    product: FloatArray = parts[0] + parts[1] + parts[2]
    return product


class _NearFaces(NamedTuple):
    """The faces that may block, nearest first, and the targets that each of them may hide."""

    faces: IntArray  # (faces,)
    distance: FloatArray  # (faces,) in the plane; nearer targets are not hidden
    first: IntArray  # (faces,) start of its range in `order`
    last: IntArray  # (faces,)
    ends: IntArray  # (faces,) number of pairs of face and target up to and including this face
    order: IntArray  # target rows
    reach: FloatArray  # (targets,) distance in the plane


def _list_pairs(near: _NearFaces, some: slice, seen: BoolArray) -> tuple[IntArray, IntArray]:
    """Pairs of faces and the targets that they may hide, without targets that are hidden already."""
    groups, places = expand_ranges(near.first[some], near.last[some])
    rows = near.order[places]
    is_open = seen[rows] & ~(near.reach[rows] < near.distance[some][groups])
    return near.faces[some][groups[is_open]], rows[is_open]


def _pair_faces_and_targets(corners: FloatArray, targets: FloatArray) -> _NearFaces:
    """Return pairs of faces and targets that they may hide from an observer at the origin.

    Comparisons are written so that NaN excludes nothing.

    Args:
        corners: (3, 4, faces)
        targets: (3, targets)
    """
    low = corners.min(axis=1)
    high = corners.max(axis=1)
    gap = np.maximum(np.maximum(low, -high), 0.0)  # (3, faces) distance from the observer to the box of the face
    spread = gap + 2.0 * (high - low)
    blur = 2.0 * _BLUR * (spread[0] + spread[1] + spread[2])
    least = np.minimum(targets.min(axis=1), 0.0)[:, None]
    most = np.maximum(targets.max(axis=1), 0.0)[:, None]
    is_out = (low - blur > most) | (high + blur < least)
    faces = (~(is_out[0] | is_out[1] | is_out[2])).nonzero()[0]
    distance = np.hypot(gap[0, faces], gap[1, faces])
    by_distance = np.argsort(distance)
    faces = faces[by_distance]
    distance = distance[by_distance]
    blur = blur[faces]
    ways, order = _sort_directions(targets)
    first, last = _find_sectors(corners.take(faces, axis=2), distance, blur, ways)
    reach = np.hypot(targets[0], targets[1])
    return _NearFaces(faces, distance - blur, first, last, np.cumsum(last - first), order, reach)


def _sort_directions(targets: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return azimuths from -pi to 3 pi, ascending, and the row of the target of each; each target occurs twice."""
    ways = np.arctan2(targets[1], targets[0])
    order = np.argsort(ways)
    ways = ways[order]
    return np.concatenate((ways, ways + _TURN)), np.concatenate((order, order))


def _find_sectors(
    corners: FloatArray, distance: FloatArray, blur: FloatArray, ways: FloatArray
) -> tuple[IntArray, IntArray]:
    """Return the range in `ways` of the targets in the direction of each face, widened by its blur."""
    azimuths = np.arctan2(corners[1], corners[0])
    turns = azimuths - azimuths[0]
    turns -= _TURN * np.rint(turns / _TURN)
    slack = 1.6 * blur / distance + 1e-9
    start = azimuths[0] + turns.min(axis=0) - slack
    end = azimuths[0] + turns.max(axis=0) + slack
    shift = _TURN * np.floor((start + np.pi) / _TURN)
    first = ways.searchsorted(start - shift)
    last = ways.searchsorted(end - shift, side="right")
    is_around = ~(distance > blur)
    first[is_around] = 0
    last[is_around] = len(ways) // 2
    return first, last


def _find_visible(quads: FloatArray, observers: FloatArray, targets: FloatArray, is_asked: BoolArray) -> BoolArray:
    """Return `find_visible_from_each`, with `_split_axes` of all arguments."""
    x, y = targets[:2, None] - observers[:2, :, None]  # (observers, targets) each
    parts = np.minimum(_convert_directions(x, y).astype(np.int64), _PARTS - 1)
    parts += _PARTS * np.arange(len(x))[:, None]
    parts = parts.ravel()
    views = _make_views(quads, observers)
    heights = np.concatenate((observers[2], targets[2]))
    hidden_beyond = _find_hidden_distances(
        views, _are_walls(quads.T, heights), quads[2, :2].min(axis=0) - quads[2, 2:4].max(axis=0)
    )
    lines = np.flatnonzero(is_asked.ravel() & ~((x * x + y * y).ravel() > hidden_beyond.take(parts)))
    parts = parts.take(lines)
    lines = lines.take(np.argsort(parts))
    reach = np.hypot(x.ravel().take(lines), y.ravel().take(lines))
    seen = np.ones(len(lines), np.bool_)
    offsets = np.zeros(x.shape[0] * _PARTS + 1, np.int64)
    np.cumsum(np.bincount(parts, minlength=len(offsets) - 1), out=offsets[1:])
    faces, distance, first, last = _find_candidates(views, offsets, float(reach.max(initial=0.0)))
    pairs = np.cumsum(last - first)
    done = 0
    begin = 0
    while begin < len(faces):
        end = max(int(pairs.searchsorted(done + _MANY, side="right")), begin + 1)
        groups, rows = expand_ranges(first[begin:end], last[begin:end])
        may_block = seen[rows] & ~(reach[rows] < distance[begin:end][groups])
        in_the_way = faces[begin:end][groups[may_block]]
        rows = rows[may_block]
        while len(rows):  # the nearest faces hide most targets, which saves tests of the others
            some = slice(max(len(rows) // _SHARE, min(_FEW * len(x), _MOST_FEW)))
            ends = lines.take(rows[some])
            origins = observers
            if len(x) > 1:
                origins = observers.take(ends // x.shape[1], axis=1)
                ends = ends % x.shape[1]
            blocked = _find_blocked(origins, targets.take(ends, axis=1), quads.take(in_the_way[some], axis=2))
            seen[rows[some][blocked]] = False
            in_the_way = in_the_way[some.stop :]
            rows = rows[some.stop :]
            may_block = seen[rows]
            in_the_way = in_the_way[may_block]
            rows = rows[may_block]
        done = int(pairs[end - 1])
        begin = end
    found = np.zeros(is_asked.size, np.bool_)
    found[lines[seen]] = True
    return found.reshape(is_asked.shape)


def _convert_directions(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return directions as numbers from 0 to `_PARTS` that grow with the angle, more slowly than radians."""
    far = np.abs(x)
    far += np.abs(y)
    turns: FloatArray = y / np.maximum(far, 1e-300)
    np.copyto(turns, 2.0 - turns, where=x < 0.0)
    turns += 1.0
    turns *= _PARTS / 4
    return turns


class _FaceViews(NamedTuple):
    """The directions and distances of faces in the plane, as seen by observers, each (observers, faces)."""

    x: FloatArray  # (corners, observers, faces) relative to the observer
    y: FloatArray
    start: FloatArray  # first direction of the face, as `_convert_directions`
    end: FloatArray  # last direction, at most half a turn after the first, and maybe beyond `_PARTS`
    distance: FloatArray  # of its box
    blur: FloatArray  # uncertainty of the position
    size: FloatArray  # (faces,)


def _make_views(quads: FloatArray, observers: FloatArray) -> _FaceViews:
    is_upright = (quads[:2, :2] == quads[:2, 2:4]).all()
    x, y = quads[:2, : 2 if is_upright else 4, None] - observers[:2, None, :, None]
    turns = _convert_directions(x, y)
    away = turns - turns[0]
    away -= _PARTS * np.rint(away / _PARTS)
    start = turns[0] + away.min(axis=0)
    end = turns[0] + away.max(axis=0)
    shift = np.where(start < 0.0, float(_PARTS), 0.0)
    low = quads[:3].min(axis=1)
    high = quads[:3].max(axis=1)
    size = _measure_extent(high - low)
    gap = np.maximum(low[:, None] - observers[:3, :, None], observers[:3, :, None] - high[:, None])
    np.maximum(gap, 0.0, out=gap)
    blur = 2.0 * _BLUR * (_measure_extent(gap) + 2.0 * size)
    return _FaceViews(x, y, start + shift, end + shift, np.hypot(gap[0], gap[1]), blur, size)


def _are_walls(corners: FloatArray, heights: FloatArray) -> BoolArray:
    """Return whether faces (faces, 4, 3) are vertical and reach from the lowest to the highest of all these heights."""
    top_right, top_left, right, left = corners.transpose(1, 2, 0)
    is_wall: BoolArray = np.maximum(right[2], left[2]) <= heights.min()
    is_wall &= np.minimum(top_right[2], top_left[2]) >= heights.max()
    for top, bottom in ((top_right, right), (top_left, left)):
        is_wall &= (top[0] == bottom[0]) & (top[1] == bottom[1])
    return is_wall


def _find_hidden_distances(views: _FaceViews, is_wall: BoolArray, tall: FloatArray) -> FloatArray:
    """Return squared distances beyond which a wall hides everything, (observers * parts,); infinite without a wall.

    Args:
        views: views of faces.
        is_wall: (faces,) see `_are_walls`.
        tall: (faces,) minimum height of each face.
    """
    x = views.x
    y = views.y
    squares = np.maximum(x[0] * x[0] + y[0] * y[0], x[1] * x[1] + y[1] * y[1])
    reach = np.sqrt(squares) + views.size
    least_volume = np.maximum(_SURE * reach * reach * views.size, 10.0 * _LEAST)
    first = np.ceil(views.start + _EDGE)
    last = np.floor(views.end - _EDGE)
    is_sure = is_wall & (last > first) & (tall * np.abs(x[0] * y[1] - x[1] * y[0]) >= least_volume)
    places = np.flatnonzero(is_sure)
    begins, counts = (parts.take(places).astype(np.int64) for parts in (first, last - first))
    begins += places // len(is_wall) * (2 * _PARTS)
    least = _find_least(begins, counts, squares.take(places) * (1.0 + 1e-9), 2 * _PARTS * x.shape[1])
    around: FloatArray = least.reshape(-1, 2, _PARTS).min(axis=1).ravel()
    return around


def _find_least(begins: IntArray, counts: IntArray, values: FloatArray, size: int) -> FloatArray:
    """Return the minimum at each of `size` positions, where each value covers a range of positions; else infinity."""
    level = np.frexp(counts)[1].astype(np.int64) - 1  # two overlapping ranges of 2**level positions make up the range
    levels = int(level.max(initial=0))
    least = np.full((levels + 1, size), np.inf)
    np.minimum.at(least.ravel(), level * size + begins, values)
    np.minimum.at(least.ravel(), level * size + begins + counts - (1 << level), values)
    for step in range(levels, 0, -1):
        half = 1 << (step - 1)
        wide = least[step]
        narrow = least[step - 1]
        np.minimum(narrow, wide, out=narrow)
        np.minimum(narrow[half:], wide[:-half], out=narrow[half:])
    found: FloatArray = least[0]
    return found


def _find_candidates(
    views: _FaceViews, offsets: IntArray, reach: float
) -> tuple[IntArray, FloatArray, IntArray, IntArray]:
    """Return faces, nearest first, their minimum distances, and ranges of the lines that each may block.

    Args:
        views: views of the faces.
        offsets: (observers * parts + 1,) ranges of the lines in each sector around each observer.
        reach: length of the longest line.
    """
    nearest = views.distance - views.blur
    places = np.flatnonzero(nearest <= reach)
    nearest, blur, distance = (values.take(places) for values in (nearest, views.blur, views.distance))
    rows, faces = np.divmod(places, len(views.size))
    is_beside = distance > blur
    slack = (0.4 * _PARTS) * blur / distance + _EDGE
    begins = np.where(is_beside, np.floor(views.start.take(places) - slack), 0).astype(np.int64)
    ends = np.where(is_beside, np.floor(views.end.take(places) + slack) + 1.0, _PARTS).astype(np.int64)
    begins += (shift := np.where(begins < 0, _PARTS, 0))
    ends += shift
    over = np.minimum(ends, begins + _PARTS) - _PARTS
    base = rows * _PARTS
    around = np.flatnonzero(over > 0)  # these ranges wrap around to the beginning of the turn
    faces = np.concatenate((faces, faces[around]))
    nearest = np.concatenate((nearest, nearest[around]))
    first = offsets[np.concatenate((base + begins, base[around]))]
    last = offsets[np.concatenate((base + np.minimum(ends, _PARTS), (base + over)[around]))]
    found = np.flatnonzero(last > first)
    found = found[np.argsort(nearest[found])]
    return faces[found], nearest[found], first[found], last[found]
