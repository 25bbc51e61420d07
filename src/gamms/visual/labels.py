"""Labels on the map: names of agents, heights, numbers of agents on a node, and street names; and their placement.

A label is at one of eight sides of its dot. It never covers a dot, another label, the parts around the map or the edge
of the page; a label without a free place is omitted. The name of a street stands along it where it is straight and
nothing else is. `Labels` and `StreetNames` remember places from frame to frame.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import atan2, cos, degrees, radians, sin
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from gamms.arguments import as_known
from gamms.errors import BadType
from gamms.ir.draw import DrawKind, DrawSpace
from gamms.ir.geometry import joined_lines
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing import IAerialAgent, IArtist, IContext
from gamms.visual.appearance import AgentData, Rgb, Rgba, inks
from gamms.visual.artist import ArtistGroup, data_of, drawn_looks, looks_of
from gamms.visual.camera import Camera, on_screen, touching
from gamms.visual.drawers.agents import RING, RING_PX
from gamms.visual.drawers.marks import drawn_marks
from gamms.visual.drawers.streets import classes_of, in_metres, levels_of, one_way_each, polylines
from gamms.visual.drawing import Commands, drawing_of
from gamms.visual.font import EM, MIDDLE, words_width

if TYPE_CHECKING:
    from gamms.visual.backends.pygame_backend import Canvas

AUTO = "auto"
Choice = bool | str | frozenset[str]
"""All names, none, as many as are easy to read ("auto"), or these."""
Rectangle = tuple[float, float, float, float]  # left, top, right, bottom; pixels

# Above at the right first, as on maps, where the streets of a grid do not pass: the order in which they are tried.
SIDES = np.array([(1, -1), (1, 1), (1, 0), (-1, -1), (-1, 1), (-1, 0), (0, -1), (0, 1)], np.float64)
LABEL_PX = 18.0
# between a label and its dot; other dots
_GAP_PX = 3.0
_DOTS_PX = 5.0
_APART_PX = 2.0  # other labels, and dots that touch its own
_COMES_PX = 6.0  # the free space around a label that was omitted in the previous frame
_DIAGONAL = 0.5**0.5
_CELL_PX = 48.0
_MOST_COUNTED = 5000  # agents; with more, agents at one place are not counted
_MOST_MARKS = 200  # commands of flags, goals and similar signs that names avoid
# the number of legible names, and the page pixels that each needs
_MOST_AUTO = 30
_AUTO_PX = 10_000.0


def as_choice(ctx: IContext, labels: object) -> Choice:
    """Check the option `labels`: the agents whose names are shown.

    Raises:
        BadType: the value is not a bool, "auto" or a collection of names.
        UnknownName (KeyError): there is no such agent.
    """
    if isinstance(labels, bool) or labels == AUTO:
        return cast("Choice", labels)
    if isinstance(labels, str) or not isinstance(labels, Iterable):
        raise BadType(f"labels is True, False, {AUTO!r} or a list of names of agents, not {shown(labels)}.")
    names = list(labels)
    for name in names:
        as_known(name, "agent", ctx.agent.agents)
    return frozenset(names)


class Label(NamedTuple):
    """A text, its left end, and the vertical middle of its small letters, in pixels from the upper left corner."""

    words: str
    left: float
    middle: float


class AgentDots(NamedTuple):
    """The drawn discs of agents, in pixels."""

    centers: FloatArray  # (dots, 2)
    radii: FloatArray  # (dots,)


class Labels:
    """The labels beside agents; each stays on the same side of its dot from frame to frame if possible.

    Attributes:
        are_shown: whether the last labels included names.
    """

    def __init__(self) -> None:
        self._sides: dict[tuple[str, bool], int] = {}  # (name of an agent, whether it is at a mark) -> side
        self._is_first = True
        self.are_shown = False

    def placed(
        self,
        camera: Camera,
        fine: float,
        ctx: IContext,
        artists: Mapping[str, IArtist],
        choice: Choice,
        page: Rectangle,
        taken: Sequence[Rectangle],
    ) -> list[Label]:
        """Return the labels of agents that were drawn.

        Args:
            camera: of the picture.
            fine: the number of camera pixels per page pixel.
            ctx: the context.
            artists: that have drawn the agents.
            choice: whose names are shown.
            page: where labels may be.
            taken: occupied areas.
        """
        heights = dict(_heights(ctx))
        named = _named(ctx, choice, page)
        agents = ctx.agent.agents
        words = dict[int, str]()
        self.are_shown = bool(named)
        # Among very many agents no count could be read.
        if named or heights or (drawing_of(ctx).has_stacks and len(agents) <= _MOST_COUNTED):
            looks = [look for look in looks_of(artists) if look.current_position is not None and look.name in agents]
            marks = _named_marks(artists, named)
            keys = [(look.name, False) for look in looks] + [(look.name, True) for look in marks]
            looks += marks
            dots = dots_of(looks, camera, fine, heights.keys())
            words = dict(_words(looks, dots, heights, named))
        if not words:
            self._sides = {}
            return []
        # Earlier labels stay; counts and heights come before names.
        order = {row: (keys[row] not in self._sides, words[row] == looks[row].name, row) for row in words}
        rows = np.array(sorted(words, key=order.__getitem__))
        sizes = np.array([(words_width(words[row], LABEL_PX), EM * LABEL_PX) for row in rows.tolist()])
        keys = [keys[row] for row in rows.tolist()]
        before = np.array([self._sides.get(key, -1) for key in keys])
        rings, shapes = _marks(ctx, artists, camera, fine)
        dots = _ringed(dots, rings)
        taken = [*taken, *shapes]
        boxes = beside(AgentDots(dots.centers[rows], dots.radii[rows]), sizes)
        comes = np.where((before < 0) & (not self._is_first), _COMES_PX, 0.0)
        sides = placed(boxes, are_free(boxes, dots, rows, page, taken, comes), before)
        self._sides = {key: side for key, side in zip(keys, sides.tolist(), strict=True) if side >= 0}
        self._is_first = False
        there = [
            (row, boxes[number, side]) for number, (row, side) in enumerate(zip(rows, sides, strict=True)) if side >= 0
        ]
        return [Label(words[int(row)], float(box[0]), float(box[1] + box[3]) / 2) for row, box in there]


def write_labels(canvas: "Canvas", labels: Sequence[Label], ink: Rgb) -> None:
    """Write labels on a picture of pixels."""
    for words, left, middle in labels:
        canvas.text(words, left, middle - MIDDLE * LABEL_PX, LABEL_PX, (*ink, 255))


def _named(ctx: IContext, choice: Choice, page: Rectangle) -> frozenset[str]:
    """Return the names of the agents whose names are shown."""
    if isinstance(choice, frozenset):
        return choice
    if choice == AUTO:
        left, top, right, bottom = page
        most = min(_MOST_AUTO, (right - left) * (bottom - top) / _AUTO_PX)
        choice = drawing_of(ctx).has_default_look and len(ctx.agent.agents) <= most
    return frozenset(ctx.agent.agents if choice else ())


def _named_marks(artists: Mapping[str, IArtist], named: frozenset[str]) -> list[AgentData]:
    """Return where marks of named agents were drawn, of tags and the like."""
    marks = [mark for artist in artists.values() for mark in drawn_marks(artist)]
    return [mark for mark in marks if mark.name in named]


def _heights(ctx: IContext) -> Iterator[tuple[str, str]]:
    """Yield the names of agents in the air, and how high they are; "" on the ground."""
    positions = ctx.agent.positions
    for row in positions.flyers.tolist():
        z = cast("IAerialAgent", ctx.agent.agents[positions.names[row]]).position[2]
        height = f"{z:.0f} m" if z >= 10.0 else f"{z:.2g} m"
        yield positions.names[row], height if z > 0.0 else ""


def dots_of(looks: Sequence[AgentData], camera: Camera, fine: float = 1.0, flyers: Iterable[str] = ()) -> AgentDots:
    """Return the discs of drawn agents in page pixels; one has `fine` pixels of the camera."""
    above = set(flyers)
    columns = [(*(look.current_position or ()), *look.shift, look.size, look.least_px) for look in looks]
    is_above = np.array([look.name in above for look in looks], bool)
    return dots_in(np.array(columns, np.float64).reshape(-1, 6), camera, fine, is_above)


def dots_in(columns: FloatArray, camera: Camera, fine: float = 1.0, is_above: BoolArray | bool = False) -> AgentDots:
    """Return the discs of columns (dots, 6), as in `AgentLooks.drawn`; `is_above` marks flying agents."""
    scale = camera.scale / fine
    radii = np.maximum(columns[:, 4] * scale, columns[:, 5])
    centers = camera.to_screen(columns[:, :2]) / fine + columns[:, 2:4] * radii[:, None]
    rings = np.maximum(RING * columns[:, 4] * scale, RING_PX) + 2.0
    return AgentDots(centers, np.where(is_above, rings, radii + 1.5))


def _marks(
    ctx: IContext, artists: Mapping[str, IArtist], camera: Camera, fine: float
) -> tuple[AgentDots, list[Rectangle]]:
    """Return the circles of flags, goals and similar signs, and the boxes around their other drawings, in pixels."""
    marks = {name: artist for name, artist in artists.items() if getattr(artist.get_drawer(), "is_mark", False)}
    share = max((data.get("_alpha", 1.0) for data in map(data_of, marks.values())), default=1.0)
    commands = ArtistGroup(ctx, marks).commands(share) if marks else Commands().freeze()
    if not 0 < len(commands) <= _MOST_MARKS:
        return AgentDots(np.empty((0, 2)), np.empty(0)), []
    view = camera._replace(scale=camera.scale / fine)
    in_world = commands.space == DrawSpace.WORLD
    points = on_screen(commands, view)
    reach = (commands.size * np.where(in_world, view.scale, 1.0) + commands.width / 2)[:, None]
    low = np.minimum.reduceat(points, commands.offsets[:-1]) - reach
    high = np.maximum.reduceat(points, commands.offsets[:-1]) + reach
    is_round = commands.kind == DrawKind.CIRCLE
    boxes: list[Rectangle] = [(*box[:2], *box[2:]) for box in np.hstack([low, high])[~is_round].tolist()]
    return AgentDots((low + high)[is_round] / 2, reach[is_round, 0]), boxes


def _ringed(dots: AgentDots, rings: AgentDots) -> AgentDots:
    """Return dots, each as large as the widest ring that is drawn around it, and then the rings."""
    apart = np.hypot(*np.moveaxis(dots.centers[:, None] - rings.centers, 2, 0))
    around = np.where(apart < dots.radii[:, None], apart + rings.radii, 0.0).max(axis=1, initial=0.0)
    radii = np.maximum(dots.radii, around)
    return AgentDots(np.concatenate([dots.centers, rings.centers]), np.concatenate([radii, rings.radii]))


def _words(
    looks: Sequence[AgentData], dots: AgentDots, heights: Mapping[str, str], named: frozenset[str]
) -> Iterator[tuple[int, str]]:
    """Yield (row of a disc, text beside it); at a place with several discs, the first has their number."""
    at: dict[tuple[object, ...], list[int]] = {}
    for row, (look, place) in enumerate(zip(looks, np.rint(dots.centers).tolist(), strict=True)):
        at.setdefault((*place, repr(look.color)), []).append(row)
    for rows in at.values():
        if len(rows) > 1:
            yield rows[0], f"\N{MULTIPLICATION SIGN}{len(rows)}"
        else:
            name = looks[rows[0]].name
            words = ", ".join(filter(None, (name if name in named else "", heights.get(name, ""))))
            if words:
                yield rows[0], words


# -- where they go ------------------------------------------------------------------------------------------------


def beside(dots: AgentDots, sizes: FloatArray) -> FloatArray:
    """Return rectangles of sizes (dots, 2) at all sides of their dots, (dots, sides, 4): left, top, right, bottom."""
    away = (
        (dots.radii + _GAP_PX)[:, None, None]
        * np.where(np.abs(SIDES).sum(axis=1) > 1.0, _DIAGONAL, 1.0)[:, None]
        * SIDES
    )
    middle = dots.centers[:, None] + away + SIDES * sizes[:, None] / 2
    half = np.broadcast_to(sizes[:, None] / 2, middle.shape)
    return np.concatenate([middle - half, middle + half], axis=2)


def are_free(
    boxes: FloatArray, dots: AgentDots, own: IntArray, page: Rectangle, taken: Sequence[Rectangle], comes: FloatArray
) -> BoolArray:
    """Return which rectangles (labels, sides, 4) touch no dot, nothing that is taken, and no edge of the page.

    Args:
        boxes: of labels.
        dots: of all agents.
        own: (labels,) the row of the dot of each.
        page: where labels may be.
        taken: where they may not.
        comes: (labels,) how much has to be free around each, besides.
    """
    low, high = boxes[:, :, :2], boxes[:, :, 2:]
    is_free = np.asarray(((low >= page[:2]) & (high <= page[2:])).all(axis=2), np.bool_)
    for left, top, right, bottom in taken:
        is_free = is_free & ((high <= (left, top)) | (low >= (right, bottom))).any(axis=2)
    around_low = low.min(axis=1) - comes[:, None]
    around_high = high.max(axis=1) + comes[:, None]
    reach = dots.radii[:, None] + _DOTS_PX
    dots_low = (dots.centers - reach).T
    dots_high = (dots.centers + reach).T
    # NOTE: one axis after the other, which takes a fraction of the time (frames with 1,000 names).
    is_near = (dots_high[0] > around_low[:, :1]) & (dots_low[0] < around_high[:, :1])
    is_near &= (dots_high[1] > around_low[:, 1:]) & (dots_low[1] < around_high[:, 1:])
    labels, others = np.nonzero(is_near)
    centers = dots.centers[others, None]
    beyond = np.maximum(np.maximum(low[labels] - centers, centers - high[labels]), 0.0)
    ways = dots.centers[own[labels]] - dots.centers[others]
    is_beside = np.hypot(ways[:, 0], ways[:, 1]) < dots.radii[own[labels]] + dots.radii[others]
    apart = np.where(is_beside, _APART_PX, _DOTS_PX) + comes[labels]
    apart[own[labels] == others] = 0.0
    is_hit = np.hypot(beyond[..., 0], beyond[..., 1]) < (dots.radii[others] + apart)[:, None]
    rows, sides = np.nonzero(is_hit)
    is_free[labels[rows], sides] = False
    return is_free


def placed(boxes: FloatArray, is_free: BoolArray, before: IntArray) -> IntArray:
    """Return the side of each label, one after the other: that of before, else the first that is free; -1 for none."""
    sides = np.full(len(boxes), -1)
    kept = dict[tuple[int, int], list[Rectangle]]()
    for label, (free, last) in enumerate(zip(is_free.tolist(), before.tolist(), strict=True)):
        for side in dict.fromkeys((last, *range(len(SIDES)))):
            if side < 0 or not free[side]:
                continue
            left, top, right, bottom = boxes[label, side].tolist()
            box = left - _APART_PX, top - _APART_PX, right + _APART_PX, bottom + _APART_PX
            cells = _cells(box)
            if not any(_touch(box, other) for cell in cells for other in kept.get(cell, ())):
                for cell in cells:
                    kept.setdefault(cell, []).append((left, top, right, bottom))
                sides[label] = side
                break
    return sides


def _cells(box: Rectangle) -> list[tuple[int, int]]:
    """Return the cells of a coarse grid that a rectangle touches."""
    left, top, right, bottom = (int(end // _CELL_PX) for end in box)
    return [(column, row) for column in range(left, right + 1) for row in range(top, bottom + 1)]


def _touch(one: Rectangle, other: Rectangle) -> bool:
    return one[0] < other[2] and one[2] > other[0] and one[1] < other[3] and one[3] > other[1]


# -- names of streets -------------------------------------------------------------------------------------------


STREET_PX = 15.0
_CLOSE = 0.8  # pixels per metre from which streets have names
_NAME_AREA = 50_000.0  # pixels of the page for each name
# from a name to the same one, and to another
_AGAIN_PX = 320.0
_BETWEEN_PX = 14.0
# of a street beyond each end of its name; from place to place that is tried
_ROOM_PX = 10.0
_TRY_PX = 24.0
# a stretch for a name: how straight, and how far its middle may be beside
_STRAIGHT = 0.99
_BENT_PX = 2.0
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


class _NamedStreets(NamedTuple):
    """Named streets, the largest first, and their bounding boxes."""

    words: list[str]
    points: list[FloatArray]  # (points, 2) each
    along: list[FloatArray]  # (points,) each: how far from its beginning, world units
    lengths: FloatArray  # (streets,)  world units
    widths: FloatArray  # (streets,)  of the words, pixels
    low: FloatArray  # (streets, 2)
    high: FloatArray  # (streets, 2)


class StreetNames:
    """The names of streets; each stays at its place on the map if possible."""

    def __init__(self) -> None:
        self._places: dict[int, float] = {}  # street -> how far along it its name was, world units
        self._known: tuple[object, list[StreetName]] = None, []  # the inputs of the last names, and the names

    def placed(
        self,
        camera: Camera,
        fine: float,
        ctx: IContext,
        artists: Mapping[str, IArtist],
        page: Rectangle,
        taken: Sequence[Rectangle],
    ) -> list[StreetName]:
        """Return the names of the largest streets, if the scale of the map leaves room for names.

        Args:
            camera: of the picture.
            fine: the number of camera pixels per page pixel.
            ctx: the context.
            artists: the artists of agents, whose dots names avoid.
            page: the area for names.
            taken: occupied areas.
        """
        columns = ctx.graph.columns()
        scale = camera.scale / fine
        if scale < _CLOSE or not in_metres(columns):
            self._places = {}
            self._known = (None, [])
            return []
        dots = dots_in(drawn_looks(artists)[1], camera, fine)
        key = columns, camera, fine, page, tuple(taken), dots.centers.tobytes(), dots.radii.tobytes()
        if key != self._known[0]:  # a window at rest shows many equal frames
            streets = drawing_of(ctx).of_map(_named_streets)
            self._known = key, self._fresh(streets, camera._replace(scale=scale), page, taken, dots)
        return self._known[1]

    def _fresh(
        self, streets: _NamedStreets, camera: Camera, page: Rectangle, taken: Sequence[Rectangle], kept: AgentDots
    ) -> list[StreetName]:
        scale = camera.scale
        before = self._places
        self._places = dict[int, float]()
        found = list[StreetName]()
        left, top, right, bottom = page
        west, east = (camera.left + x / scale for x in (left, right))
        south, north = (camera.top - y / scale for y in (bottom, top))
        is_near = touching(streets.low, streets.high, (west, south, east, north))
        is_near &= streets.lengths * scale > streets.widths + 2 * _ROOM_PX
        for row in np.flatnonzero(is_near).tolist():
            if (len(found) + 1) * _NAME_AREA > (right - left) * (bottom - top):
                break
            words = streets.words[row]
            width = float(streets.widths[row])
            same = np.array([(name.x, name.y) for name in found if name.words == words]).reshape(-1, 2)
            tries = _stretches(camera.to_screen(streets.points[row]), streets.along[row] * scale, width, page)
            for place in _in_order(tries, before.get(row, -1.0) * scale):
                name = _name_at(words, tries, place)
                reach = _marks_along(width, tries, place)
                if (np.hypot(*(same - (name.x, name.y)).T) < _AGAIN_PX).any() or not _is_clear(reach, kept, taken):
                    continue
                radii = np.concatenate([kept.radii, reach.radii + _BETWEEN_PX])
                kept = AgentDots(np.concatenate([kept.centers, reach.centers]), radii)
                self._places[row] = float(tries.along[place]) / scale
                found.append(name)
                break
        return found


class _StraightParts(NamedTuple):
    """The straight parts of a street on the page, from end to end."""

    along: FloatArray  # (stretches,)  of their middles, pixels
    begins: FloatArray  # (stretches, 2)
    ends: FloatArray  # (stretches, 2)


def _stretches(points: FloatArray, along: FloatArray, width: float, page: Rectangle) -> _StraightParts:
    """Return the straight parts of a street that are long enough and inside the page, left end first."""
    half = width / 2 + _ROOM_PX
    middles = np.arange(half, max(float(along[-1]) - half, 0.0), _TRY_PX)
    between = _points_at(points, along, middles)
    is_there = ((between > page[:2]) & (between < page[2:])).all(axis=1)
    middles = middles[is_there]
    between = between[is_there]
    begins, ends = (_points_at(points, along, middles + way) for way in (-half, half))
    is_good = np.hypot(*(ends - begins).T) >= _STRAIGHT * 2 * half
    is_good &= np.hypot(*(between - (begins + ends) / 2).T) <= _BENT_PX
    for places in (begins, ends):
        is_good &= ((places > page[:2]) & (places < page[2:])).all(axis=1)
    ways = ends - begins
    is_back = ways[:, 0] < _UPRIGHT * ways[:, 1]  # of names that are nearly upright, all read upwards
    begins, ends = np.where(is_back[:, None], ends, begins), np.where(is_back[:, None], begins, ends)
    return _StraightParts(middles[is_good], begins[is_good], ends[is_good])


def _points_at(points: FloatArray, along: FloatArray, places: FloatArray) -> FloatArray:
    """Return the points (places, 2) of a line so far along it."""
    return np.column_stack([np.interp(places, along, axis) for axis in points.T])


def _in_order(tries: _StraightParts, before: float) -> list[int]:
    """Return the stretches: that of the frame before first, then from the middle outwards."""
    if not len(tries.along):
        return []
    goal = before if before >= 0.0 and abs(tries.along - before).min() < _TRY_PX else float(np.median(tries.along))
    order: list[int] = np.argsort(abs(tries.along - goal), kind="stable").tolist()
    return order


def _name_at(words: str, tries: _StraightParts, place: int) -> StreetName:
    (x, y), (across, down) = (tries.begins[place] + tries.ends[place]) / 2, tries.ends[place] - tries.begins[place]
    return StreetName(words, float(x), float(y), degrees(atan2(-float(down), float(across))))


def _marks_along(width: float, tries: _StraightParts, place: int) -> AgentDots:
    """Return circles that cover the words on a stretch."""
    radius = EM * STREET_PX / 2 + 1.0
    count = max(int(width / radius), 1) + 1
    shares = np.linspace(0.0, 1.0, count)[:, None]
    return AgentDots(tries.begins[place] * (1 - shares) + tries.ends[place] * shares, np.full(count, radius))


def _is_clear(reach: AgentDots, kept: AgentDots, taken: Sequence[Rectangle]) -> bool:
    """Return whether circles touch no others, and nothing that is taken."""
    apart = np.hypot(*np.moveaxis(reach.centers[:, None] - kept.centers, 2, 0))
    if (apart < reach.radii[:, None] + kept.radii + _APART_PX).any():
        return False
    boxes = np.array(taken).reshape(-1, 4)
    beyond = np.maximum(np.maximum(boxes[:, :2] - reach.centers[:, None], reach.centers[:, None] - boxes[:, 2:]), 0.0)
    return not (np.hypot(beyond[..., 0], beyond[..., 1]) < reach.radii[:, None] + _APART_PX).any()


def box_of(label: Label) -> Rectangle:
    """Return the rectangle around a label."""
    half = EM * LABEL_PX / 2
    return label.left, label.middle - half, label.left + words_width(label.words, LABEL_PX), label.middle + half


def name_ink(background: Rgba) -> Rgb:
    """Return the color of street names: a little paler than agent names, but readable on a street."""
    red, green, blue = (round((2 * ink + faint) / 3) for ink, faint in zip(*inks(background), strict=True))
    return red, green, blue


def write_street_names(canvas: "Canvas", names: Sequence[StreetName], ink: Rgb) -> None:
    """Write names of streets on a picture of pixels."""
    for name in names:
        canvas.turned_text(name.words, name.corner, STREET_PX, (*ink, 255), name.angle)


def _named_streets(columns: GraphColumns) -> _NamedStreets:
    """Return the streets of a map that have names, joined where their edges meet, but no tunnels."""
    names = {row: _first_text(value) for row, value in columns.edge_attributes.get("name", {}).items()}
    rows = one_way_each(columns)
    rows = rows[(levels_of(columns)[rows] >= 0) & np.isin(rows, [row for row, name in names.items() if name])]
    if not len(rows):
        return _NamedStreets([], [], [], np.zeros(0), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)))
    texts, group = np.unique([names[row] for row in rows.tolist()], return_inverse=True)
    classes = np.zeros(len(texts), np.int64)
    np.maximum.at(classes, group, classes_of(columns)[rows])
    parts = joined_lines(*polylines(columns, rows), group)
    along = [np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))]) for _, points in parts]
    order = sorted(range(len(parts)), key=lambda part: (-classes[parts[part][0]], -along[part][-1]))
    points = [parts[part][1] for part in order]
    low, high = (np.array([measure(one, axis=0) for one in points]) for measure in (np.min, np.max))
    words = [str(texts[parts[part][0]]) for part in order]
    widths = np.array([words_width(one, STREET_PX) for one in words])
    along = [along[part] for part in order]
    return _NamedStreets(words, points, along, np.array([way[-1] for way in along]), widths, low, high)


def _first_text(value: object) -> str:
    """Return a name, or the first of several; "" for invalid or too long names."""
    text = value[0] if isinstance(value, list | tuple) and value else value
    return text.strip() if isinstance(text, str) and len(text) <= _LONGEST_NAME else ""
