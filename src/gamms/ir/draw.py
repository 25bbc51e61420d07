"""Draw commands: the output of all drawers and the input of all render backends.

This is the visualization IR that the paper leaves as future work: columns instead of objects.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray

FARTHEST = 1e12  # largest coordinates and sizes; beyond this, differences lose metres by rounding
MOST_POINTS = 1 << 20  # most points of recorded drawings


class DrawKind(IntEnum):
    """The kind of a command, which defines its points and size."""

    CIRCLE = 1  # the center, and maybe an offset in pixels to the right and down; size = radius
    RECTANGLE = 2  # two points: top-left corner, in world units; (width, height), in the unit of `space`
    LINE = 3  # two or more points, an open polyline; width
    # Three or more points, closed; filled by the even-odd rule, so a seam to a ring makes a hole. In pixels: a
    # place on the map, then at least two corners, as offsets to the right and down.
    POLYGON = 4
    TEXT = 5  # one point, the upper left corner, which is the center of rotation by the angle; size = font height
    IMAGE = 6  # one point, the center; size = half of the side; `text` is the path or name of the image


class DrawSpace(IntEnum):
    """The unit of a command's size, of a rectangle's extent, of a line's width, and of a polygon's corners.

    All other positions are in world units, y up; outlines are in pixels.
    """

    WORLD = 0
    SCREEN = 1  # pixels


class Owner(NamedTuple):
    """The agent and the teams that a command belongs to.

    Attributes:
        agent: name of the agent that the command shows or belongs to; "": none.
        sides: the teams that may see it, by their texts; None: all teams.
    """

    agent: str = ""
    sides: tuple[str, ...] | None = None


@dataclass(slots=True, frozen=True, eq=False)
class DrawCommands:
    """One row per command, in painting order within a layer; lower layers are painted first.

    The points of row `i` are `points[offsets[i]:offsets[i + 1]]`.
    """

    kind: IntArray  # (commands,)  DrawKind
    layer: IntArray  # (commands,)
    space: IntArray  # (commands,)  DrawSpace
    size: FloatArray  # (commands,)  radius, font height or half side
    width: FloatArray  # (commands,)  line width, in the unit of `space`; outline width, in pixels; 0 = filled
    angle: FloatArray  # (commands,)  degrees, counter-clockwise
    color: "np.ndarray[Any, np.dtype[np.uint8]]"  # (commands, 4)  RGBA
    offsets: IntArray  # (commands + 1,)
    points: FloatArray  # (points, 2)
    text: tuple[str, ...]  # (commands,)  "" if not used
    owners: Mapping[int, Owner] = field(default_factory=dict)  # row -> owner, for commands with an owner

    def __len__(self) -> int:
        return len(self.kind)

    def in_painting_order(self) -> IntArray:
        """Return the rows from back to front."""
        if (self.layer[1:] >= self.layer[:-1]).all():  # as it nearly always is
            return np.arange(len(self.layer))
        return np.argsort(self.layer, kind="stable")

    def to_plain(self) -> dict[str, Any]:
        """Return the columns as plain values for a recording, without images, which are files, and without layers.

        Raises:
            BadValue: there are more points than a recording may have.
        """
        if len(self.points) > MOST_POINTS:
            raise BadValue(
                f"A drawing of {len(self.points)} points cannot be recorded; at most {MOST_POINTS} points can."
            )
        counts = np.diff(self.offsets)
        is_kept = self.kind != DrawKind.IMAGE
        columns: dict[str, Any] = {name: getattr(self, name)[is_kept].astype(np.uint8) for name in ("kind", "space")}
        columns |= {name: getattr(self, name)[is_kept] for name in ("size", "width", "angle", "color")}
        columns |= {"counts": counts[is_kept], "points": self.points[np.repeat(is_kept, counts)]}
        rows = np.flatnonzero(is_kept).tolist()
        if any(self.text):
            columns["text"] = [self.text[row] for row in rows]
        if self.owners:
            owners = [self.owners.get(row, Owner()) for row in rows]
            columns["agents"] = [one.agent for one in owners]
            columns["sides"] = [None if one.sides is None else list(one.sides) for one in owners]
        return columns

    @classmethod
    def from_plain(cls, columns: object) -> "DrawCommands":
        """Return commands, on layer 0, from the result of `to_plain`.

        Raises:
            BadType, BadValue, KeyError: the columns are not such a result.
        """
        if not isinstance(columns, dict):
            raise BadType(f"A recorded drawing is a dict of columns, not a {type(columns).__name__}.")
        found = {name: _read_column(columns, name, *form) for name, form in _FORMS.items()}
        kind = found["kind"]
        counts = found.pop("counts")
        points = found["points"]
        text = columns.get("text") or [""] * len(counts)
        if not isinstance(text, list) or not all(isinstance(one, str) for one in text):
            raise BadType("The texts of a recorded drawing must be a list of str.")
        owners = _read_owners(columns, len(counts))
        if {len(text), *(len(column) for name, column in found.items() if name != "points")} != {len(counts)}:
            raise BadValue("The columns of a recorded drawing have different lengths.")
        _check_kinds(kind, found["space"], counts, len(points))
        for name in ("size", "width", "angle", "points"):
            if not (np.abs(found[name]) <= FARTHEST).all():  # nor NaN
                raise BadValue(f"One of the {name} in a recorded drawing is not finite, or beyond {FARTHEST:g}.")
        offsets = np.concatenate(([0], np.cumsum(counts, dtype=np.int64)))
        extents = points[offsets[:-1][kind == DrawKind.RECTANGLE] + 1]
        if any((values < 0.0).any() for values in (found["size"], found["width"], extents)):
            raise BadValue("A size in a recorded drawing is negative.")
        return cls(layer=np.zeros(len(kind), np.int64), offsets=offsets, text=tuple(text), owners=owners, **found)


def _read_owners(columns: dict[str, Any], count: int) -> dict[int, Owner]:
    """Return row -> owner of the commands of a recorded drawing.

    Raises:
        BadType, BadValue: the columns are invalid.
    """
    agents = columns.get("agents") or [""] * count
    sides = columns.get("sides") or [None] * count
    are_lists = isinstance(agents, list) and isinstance(sides, list)
    if not are_lists or not all(isinstance(one, str) for one in agents):
        raise BadType("The agents of a recorded drawing must be a list of str.")
    known = [one for one in sides if one is not None]
    if not all(isinstance(one, list) and all(isinstance(side, str) for side in one) for one in known):
        raise BadType("The sides of a recorded drawing must be a list with lists of str, or None.")
    if {len(agents), len(sides)} != {count}:
        raise BadValue("The columns of a recorded drawing have different lengths.")
    owners = (Owner(agent, None if one is None else tuple(one)) for agent, one in zip(agents, sides, strict=True))
    return {row: owner for row, owner in enumerate(owners) if owner != Owner()}


_FORMS: dict[str, tuple[str, tuple[int, ...], type]] = {  # number kinds, row shape, type
    **dict.fromkeys(("kind", "space", "counts"), ("iu", (), np.int64)),
    **dict.fromkeys(("size", "width", "angle"), ("f", (), np.float64)),
    "color": ("iu", (4,), np.uint8),
    "points": ("f", (2,), np.float64),
}
_POINTS_OF = {  # fewest and most points of recorded commands, by kind
    DrawKind.CIRCLE: (1, 1),
    DrawKind.RECTANGLE: (2, 2),
    DrawKind.LINE: (2, MOST_POINTS),
    DrawKind.POLYGON: (3, MOST_POINTS),
    DrawKind.TEXT: (1, 1),
}


def _read_column(
    columns: dict[str, Any], name: str, kinds: str, row: tuple[int, ...], dtype: type
) -> "np.ndarray[Any, Any]":
    """Return a column of a recorded drawing."""
    column = columns[name]
    if (
        not isinstance(column, np.ndarray)
        or column.dtype.kind not in kinds
        or column.shape[1:] != row
        or not column.ndim
    ):
        raise BadType(f"The column {name!r} of a recorded drawing must be an array of numbers.")
    return column.astype(dtype)


def _check_kinds(kind: IntArray, space: IntArray, counts: IntArray, points: int) -> None:
    """Check that all commands of a recorded drawing have a known kind and a valid number of points."""
    is_known = np.isin(space, list(DrawSpace))
    for one, (fewest, most) in _POINTS_OF.items():
        is_known[kind == one] &= ((counts >= fewest) & (counts <= most))[kind == one]
    if not (is_known & np.isin(kind, list(_POINTS_OF))).all() or points > MOST_POINTS or int(counts.sum()) != points:
        raise BadValue("A recorded drawing has commands of an unknown kind, or a wrong number of points.")
