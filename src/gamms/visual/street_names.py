"""Names of streets: along straight parts of streets, clear of agents, labels, legends and each other."""

from collections.abc import Iterator, Mapping, Sequence
from math import atan2, cos, degrees, radians, sin
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.geometry import straight_parts
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.typing import IArtist, IContext
from gamms.visual.appearance import Rgb
from gamms.visual.artist import drawn_looks
from gamms.visual.camera import Camera
from gamms.visual.drawers.streets import classes_of, in_metres, levels_of, one_way_each, polylines
from gamms.visual.drawing import drawing_of
from gamms.visual.font import EM, MIDDLE, words_width
from gamms.visual.labels import Rectangle, are_hit, dots_in
from gamms.visual.legend import Pen

STREET_PX = 15.0
_CLOSE = 0.8  # pixels per metre from which streets have names
_NAME_AREA = 50_000.0  # pixels of the page for each name
_AGAIN_PX = 500.0  # from a name to the same one
_MOST_AGAIN = 100  # names of one straight part
_ROOM_PX = 10.0  # of a street beyond each end of its name
_CLEAR_PX = 4.0  # around a name
_STRAIGHT_M = 2.0  # metres by which a street may be beside its name
_UPRIGHT = 0.2  # so far across, as a share of how far down, a name still reads upwards
_LONGEST_NAME = 60  # letters


class StreetName(NamedTuple):
    """A text along a street; positions in pixels from the upper left corner."""

    words: str
    x: float  # of their middle
    y: float
    angle: float  # degrees, counter-clockwise

    @property
    def corner(self) -> tuple[float, float]:
        """The upper left corner of the words, around which they are turned."""
        across = words_width(self.words, STREET_PX) / 2
        down = MIDDLE * STREET_PX
        turn = radians(self.angle)
        return self.x - across * cos(turn) - down * sin(turn), self.y + across * sin(turn) - down * cos(turn)

    def draw(self, pen: Pen, ink: Rgb) -> None:
        """Write the name."""
        pen.turned_text(self.words, self.corner, STREET_PX, ink, self.angle)

    def boxes(self, margin: float = 0.0) -> FloatArray:
        """Return squares (squares, 4) that cover the words and a margin: left, top, right, bottom."""
        half = EM * STREET_PX / 2
        across = words_width(self.words, STREET_PX) / 2
        turn = radians(self.angle)
        steps = np.linspace(-across, across, int(2 * across / half) + 2)
        middles = np.column_stack([self.x + steps * cos(turn), self.y - steps * sin(turn)])
        return np.hstack([middles - half - margin, middles + half + margin])


class _StraightParts(NamedTuple):
    """The straight parts of named streets, the largest streets first."""

    words: list[str]
    begins: FloatArray  # (parts, 2)
    ends: FloatArray  # (parts, 2)
    widths: FloatArray  # (parts,)  of the words, pixels


def draw_street_names(
    pen: Pen,
    fine: float,
    ctx: IContext,
    artists: Mapping[str, IArtist],
    page: Rectangle,
    taken: Sequence[Rectangle],
) -> None:
    """Write the names of streets, a little paler than those of agents, but readable on a street.

    Args:
        pen: the pen of the page.
        fine: the number of camera pixels per page pixel.
        ctx: the context.
        artists: that have drawn the agents, which stay visible.
        page: the area for names.
        taken: other occupied areas.
    """
    dots = dots_in(drawn_looks(artists)[1], pen.camera, fine).boxes()
    red, green, blue = (round((2 * ink + faint) / 3) for ink, faint in zip(pen.ink, pen.faint, strict=True))
    for name in street_names(pen.camera, fine, ctx, page, np.vstack([dots, np.array(taken).reshape(-1, 4)])):
        name.draw(pen, (red, green, blue))


def street_names(
    camera: Camera, fine: float, ctx: IContext, page: Rectangle, taken: FloatArray
) -> Iterator[StreetName]:
    """Yield the names of the largest streets, if the scale of the map leaves room for names.

    Args:
        camera: of the picture.
        fine: the number of camera pixels per page pixel.
        ctx: the context.
        page: the area for names.
        taken: (boxes, 4) occupied areas.
    """
    scale = camera.scale / fine
    if scale < _CLOSE or not in_metres(ctx.graph.columns()):
        return
    left, top, right, bottom = page
    most = int((right - left) * (bottom - top) / _NAME_AREA)
    places = dict[str, list[tuple[float, float]]]()
    count = 0
    for name in _tries(drawing_of(ctx).of_map(_straight_parts), camera._replace(scale=scale), page):
        if count == most:
            return
        same = np.array(places.get(name.words, ())).reshape(-1, 2)
        is_near = np.hypot(*(same - (name.x, name.y)).T) < _AGAIN_PX
        if is_near.any() or are_hit(name.boxes(_CLEAR_PX), taken).any():
            continue
        taken = np.vstack([taken, name.boxes()])
        places.setdefault(name.words, []).append((name.x, name.y))
        count += 1
        yield name


def _tries(parts: _StraightParts, camera: Camera, page: Rectangle) -> Iterator[StreetName]:
    """Yield names at even distances along straight parts that are long enough, if they are inside the page."""
    begins = camera.to_screen(parts.begins)
    ways = camera.to_screen(parts.ends) - begins
    lengths = np.hypot(*ways.T)
    counts = np.clip(lengths / _AGAIN_PX, 1, _MOST_AGAIN).astype(np.int64)
    fits = lengths > parts.widths + 2 * _ROOM_PX
    row, number = kernels.expand_ranges(np.zeros(len(counts), np.int64), np.where(fits, counts, 0))
    middles = begins[row] + ways[row] * ((number + 0.5) / counts[row])[:, None]
    half = ways[row] * (parts.widths[row] / 2 / lengths[row])[:, None]
    low = middles - np.abs(half)
    high = middles + np.abs(half)
    is_inside = (low > page[:2]).all(axis=1) & (high < page[2:]).all(axis=1)
    is_back = half[:, 0] < _UPRIGHT * half[:, 1]  # of names that are nearly upright, all read upwards
    half[is_back] *= -1.0
    for place in np.flatnonzero(is_inside).tolist():
        x, y = middles[place].tolist()
        across, down = half[place].tolist()
        yield StreetName(parts.words[row[place]], x, y, degrees(atan2(-down, across)))


def _straight_parts(columns: GraphColumns) -> _StraightParts:
    """Return the straight parts of streets that have names, but no tunnels; edges that meet are joined."""
    names = {row: _first_text(value) for row, value in columns.edge_attributes.get("name", {}).items()}
    rows = one_way_each(columns)
    rows = rows[(levels_of(columns)[rows] >= 0) & np.isin(rows, [row for row, name in names.items() if name])]
    if not len(rows):
        return _StraightParts([], np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    texts, group = np.unique([names[row] for row in rows.tolist()], return_inverse=True)
    classes = np.zeros(len(texts), np.int64)
    np.maximum.at(classes, group, classes_of(columns)[rows])
    owner, ends = straight_parts(*polylines(columns, rows), group, _STRAIGHT_M)
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    order = np.lexsort((owner, -lengths, -classes[owner]))
    widths = np.array([words_width(text, STREET_PX) for text in texts.tolist()])
    words = texts[owner[order]].tolist()
    return _StraightParts(words, ends[order, 0], ends[order, 1], widths[owner[order]])


def _first_text(value: object) -> str:
    """Return a name, or the first of several; "" for invalid or too long names."""
    text = value[0] if isinstance(value, list | tuple) and value else value
    return text.strip() if isinstance(text, str) and len(text) <= _LONGEST_NAME else ""
