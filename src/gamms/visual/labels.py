"""Words beside agents: names, heights, and how many stand on one node; where they go, and how they are drawn.

A label stands at one of eight sides of its own dot, and never on a dot, another label, what stands around the map or
the edge of the page; one that finds no place is left out. `Labels` remembers the sides from frame to frame.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from gamms.errors import BadType, UnknownName
from gamms.ir.draw import DrawKind, DrawSpace
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing import IAerialAgent, IArtist, IContext
from gamms.visual.appearance import AgentData, Rgb
from gamms.visual.artist import ArtistGroup, data_of, looks_of
from gamms.visual.camera import Camera, on_screen
from gamms.visual.drawers.agents import RING, RING_PX
from gamms.visual.drawing import Commands, drawing_of
from gamms.visual.lettering import EM, MIDDLE, words_width

if TYPE_CHECKING:
    from gamms.visual.backends.pygame_backend import Canvas

AUTO = "auto"
Choice = bool | str | frozenset[str]
"""All names, none, as many as are easy to read ("auto"), or these."""
Rectangle = tuple[float, float, float, float]  # left, top, right, bottom; pixels

# Above at the right first, as on maps, where the streets of a grid do not pass: the order in which they are tried.
SIDES = np.array([(1, -1), (1, 1), (1, 0), (-1, -1), (-1, 1), (-1, 0), (0, -1), (0, 1)], np.float64)
LABEL_PX = 18.0
_GAP_PX, _DOTS_PX = 3.0, 5.0  # between a label and its dot; other dots
_APART_PX = 2.0  # other labels, and dots that touch its own
_COMES_PX = 6.0  # what is free around a label that was left out in the frame before
_DIAGONAL, _CELL_PX = 0.5**0.5, 48.0
_MOST_MARKS = 200  # commands of flags, goals and the like of which names are kept clear
_MOST_AUTO, _AUTO_PX = 30, 10_000.0  # so many names are easy to read, if each has so many pixels of the page


def as_choice(ctx: IContext, labels: object) -> Choice:
    """Check whose names are to be shown.

    Raises:
        BadType: it is no bool, "auto" or collection of names.
        UnknownName (KeyError): there is no such agent.
    """
    if isinstance(labels, bool) or labels == AUTO:
        return cast("Choice", labels)
    if isinstance(labels, str) or not isinstance(labels, Iterable):
        raise BadType(f"labels is True, False, {AUTO!r} or a list of names of agents, not {shown(labels)}.")
    names = list(labels)
    for name in names:
        if name not in ctx.agent.agents:
            raise UnknownName("agent", name, ctx.agent.agents)
    return frozenset(names)


class Label(NamedTuple):
    """Words, where they begin, and the middle of their small letters, pixels from the upper left corner."""

    words: str
    left: float
    middle: float


class Dots(NamedTuple):
    """What is seen of agents, in pixels."""

    centers: FloatArray  # (dots, 2)
    radii: FloatArray  # (dots,)


class Labels:
    """The words beside agents, which stay at their sides of the dots from frame to frame as long as they can.

    Attributes:
        are_shown: whether there were names among them.
    """

    def __init__(self) -> None:
        self._sides: dict[str, int] = {}
        self._is_first, self.are_shown = True, False

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
            fine: how many of its pixels are one of the page.
            ctx: the context.
            artists: that have drawn the agents.
            choice: whose names are shown.
            page: where labels may be.
            taken: where they may not.
        """
        heights, named, agents = dict(_heights(ctx)), _named(ctx, choice, page), ctx.agent.agents
        words, self.are_shown = dict[int, str](), bool(named)
        if named or heights or drawing_of(ctx).has_stacks:
            looks = [look for look in looks_of(artists) if look.current_position is not None and look.name in agents]
            dots = dots_of(looks, camera, fine, heights.keys())
            words = dict(_words(looks, dots, heights, named))
        if not words:
            self._sides = {}
            return []
        # Those that were there stay; counts and heights say more than names.
        order = {row: (looks[row].name not in self._sides, words[row] == looks[row].name, row) for row in words}
        rows = np.array(sorted(words, key=order.__getitem__))
        sizes = np.array([(words_width(words[row], LABEL_PX), EM * LABEL_PX) for row in rows.tolist()])
        names = [looks[row].name for row in rows.tolist()]
        before = np.array([self._sides.get(name, -1) for name in names])
        rings, shapes = _marks(ctx, artists, camera, fine)
        dots, taken = _ringed(dots, rings), [*taken, *shapes]
        boxes = beside(Dots(dots.centers[rows], dots.radii[rows]), sizes)
        comes = np.where((before < 0) & (not self._is_first), _COMES_PX, 0.0)
        sides = placed(boxes, are_free(boxes, dots, rows, page, taken, comes), before)
        self._sides = {name: side for name, side in zip(names, sides.tolist(), strict=True) if side >= 0}
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


def _heights(ctx: IContext) -> Iterator[tuple[str, str]]:
    """Yield the names of agents in the air, and how high they are; "" on the ground."""
    positions = ctx.agent.positions
    for row in positions.flyers.tolist():
        z = cast("IAerialAgent", ctx.agent.agents[positions.names[row]]).position[2]
        yield positions.names[row], "" if z <= 0.0 else f"{z:.0f} m" if z >= 10.0 else f"{z:.2g} m"


def dots_of(looks: Sequence[AgentData], camera: Camera, fine: float = 1.0, flyers: Iterable[str] = ()) -> Dots:
    """Return the dots of agents that were drawn, in pixels of which the camera has `fine` in one."""
    scale, above = camera.scale / fine, set(flyers)
    columns = np.array(
        [(*(look.current_position or ()), *look.shift, look.size, look.least_px, look.name in above) for look in looks],
        np.float64,
    ).reshape(-1, 7)
    radii = np.maximum(columns[:, 4] * scale, columns[:, 5])
    centers = camera.to_screen(columns[:, :2]) / fine + columns[:, 2:4] * radii[:, None]
    rings = np.maximum(RING * columns[:, 4] * scale, RING_PX) + 2.0
    return Dots(centers, np.where(columns[:, 6] > 0.0, rings, radii + 1.5))


def _marks(ctx: IContext, artists: Mapping[str, IArtist], camera: Camera, fine: float) -> tuple[Dots, list[Rectangle]]:
    """Return the circles of flags, goals and the like, and the boxes around what else is drawn of them, in pixels."""
    marks = {name: artist for name, artist in artists.items() if getattr(artist.get_drawer(), "is_mark", False)}
    share = max((data.get("_alpha", 1.0) for data in map(data_of, marks.values())), default=1.0)
    commands = ArtistGroup(ctx, marks).commands(share) if marks else Commands().freeze()
    if not 0 < len(commands) <= _MOST_MARKS:
        return Dots(np.empty((0, 2)), np.empty(0)), []
    view = camera._replace(scale=camera.scale / fine)
    in_world, points = commands.space == DrawSpace.WORLD, on_screen(commands, view)
    reach = (commands.size * np.where(in_world, view.scale, 1.0) + commands.width / 2)[:, None]
    low = np.minimum.reduceat(points, commands.offsets[:-1]) - reach
    high = np.maximum.reduceat(points, commands.offsets[:-1]) + reach
    is_round = commands.kind == DrawKind.CIRCLE
    boxes: list[Rectangle] = [(*box[:2], *box[2:]) for box in np.hstack([low, high])[~is_round].tolist()]
    return Dots((low + high)[is_round] / 2, reach[is_round, 0]), boxes


def _ringed(dots: Dots, rings: Dots) -> Dots:
    """Return dots, each as large as the widest ring that is drawn around it, and then the rings."""
    apart = np.hypot(*np.moveaxis(dots.centers[:, None] - rings.centers, 2, 0))
    around = np.where(apart < dots.radii[:, None], apart + rings.radii, 0.0).max(axis=1, initial=0.0)
    radii = np.maximum(dots.radii, around)
    return Dots(np.concatenate([dots.centers, rings.centers]), np.concatenate([radii, rings.radii]))


def _words(
    looks: Sequence[AgentData], dots: Dots, heights: Mapping[str, str], named: frozenset[str]
) -> Iterator[tuple[int, str]]:
    """Yield rows of dots and the words beside them: of those at one place the first counts how many there are."""
    at: dict[tuple[object, ...], list[int]] = {}
    for row, (look, place) in enumerate(zip(looks, np.rint(dots.centers).tolist(), strict=True)):
        at.setdefault((*place, look.color), []).append(row)
    for rows in at.values():
        if len(rows) > 1:
            yield rows[0], f"\N{MULTIPLICATION SIGN}{len(rows)}"
        else:
            name = looks[rows[0]].name
            words = ", ".join(filter(None, (name if name in named else "", heights.get(name, ""))))
            if words:
                yield rows[0], words


# -- where they go ------------------------------------------------------------------------------------------------


def beside(dots: Dots, sizes: FloatArray) -> FloatArray:
    """Return rectangles of sizes (dots, 2) at all sides of their dots, (dots, sides, 4): left, top, right, bottom."""
    away = (
        (dots.radii + _GAP_PX)[:, None, None]
        * np.where(np.abs(SIDES).sum(axis=1) > 1.0, _DIAGONAL, 1.0)[:, None]
        * SIDES
    )
    middle = dots.centers[:, None] + away + SIDES * sizes[:, None] / 2
    half = np.broadcast_to(sizes[:, None] / 2, middle.shape)
    found: FloatArray = np.concatenate([middle - half, middle + half], axis=2)
    return found


def are_free(
    boxes: FloatArray, dots: Dots, own: IntArray, page: Rectangle, taken: Sequence[Rectangle], comes: FloatArray
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
    around_low, around_high = low.min(axis=1) - comes[:, None], high.max(axis=1) + comes[:, None]
    reach = dots.radii[:, None] + _DOTS_PX
    dots_low, dots_high = (dots.centers - reach).T, (dots.centers + reach).T
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
    sides, kept = np.full(len(boxes), -1), dict[tuple[int, int], list[Rectangle]]()
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
