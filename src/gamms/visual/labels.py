"""Labels beside agents: names, heights, and the numbers of agents on a node; and their placement.

Agents whose discs touch share one label, a line for each with a bullet in its color. A label stands at one of eight
sides of its discs, or farther away at the end of a line; there it covers no disc, sign or other label.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np

from gamms.arguments import as_known
from gamms.errors import BadType
from gamms.ir.draw import DrawSpace
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing import IAerialAgent, IArtist, IContext
from gamms.visual.appearance import AgentData, AnyColor
from gamms.visual.artist import ArtistGroup, data_of, looks_of
from gamms.visual.camera import Camera, on_screen
from gamms.visual.drawers.agents import RING, RING_PX
from gamms.visual.drawers.marks import drawn_marks
from gamms.visual.drawing import drawing_of
from gamms.visual.font import EM, words_width
from gamms.visual.legend import Pen

AUTO = "auto"
Choice = bool | str | frozenset[str]
"""All names, none, as many as are easy to read ("auto"), or these."""
Rectangle = tuple[float, float, float, float]  # left, top, right, bottom; pixels

# Above at the right first, as on maps, where the streets of a grid do not pass: the order in which they are tried.
SIDES = np.array([(1, -1), (1, 1), (1, 0), (-1, -1), (-1, 1), (-1, 0), (0, -1), (0, 1)], np.float64)
LABEL_PX = 18.0
_LINE_PX = 14.0
_MOST_LINES = 6
_BULLET_PX = 3.5  # radius
_INDENT_PX = 11.0
# from the discs to the label; a line leads to the last of these places
_GAPS_PX = 3.0, 12.0, 28.0
_NEAR_PLACES = len(SIDES) * (len(_GAPS_PX) - 1)  # without a line
_CORNER = 0.5**0.5  # share of the distance at corners, where a disc does not fill its square
_DOTS_PX = 5.0  # from a label to other discs
_AROUND = np.array([-2.0, -2.0, 2.0, 2.0])  # from a label to signs and other labels
_MOST_COUNTED = 5000  # agents; with more, agents at one place are not counted
# the number of legible names, and the page pixels that each needs
_MOST_AUTO = 30
_AUTO_PX = 7_000.0


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


class LabelLine(NamedTuple):
    """A line of a label."""

    words: str
    color: AnyColor | None  # of its bullet; None: it counts agents without a line


class Label(NamedTuple):
    """A label, in pixels from the upper left corner of the page."""

    lines: list[LabelLine]
    box: Rectangle
    leader: list[tuple[float, float]]  # the line from a distant label to its discs; empty for other labels

    def draw(self, pen: Pen) -> None:
        """Draw the label."""
        left, top, _, _ = self.box
        if self.leader:
            pen.line(self.leader, pen.faint, 1.0)
        indent = _indent(self.lines)
        for number, (words, color) in enumerate(self.lines):
            middle = top + EM * LABEL_PX / 2 + number * _LINE_PX
            if indent and color is not None:
                pen.circle(left + _BULLET_PX, middle, _BULLET_PX, color)
            pen.text(words, left + indent, middle, LABEL_PX)


class AgentDots(NamedTuple):
    """The drawn discs of agents, in pixels."""

    centers: FloatArray  # (dots, 2)
    radii: FloatArray  # (dots,)

    def boxes(self, margin: float = 0.0) -> FloatArray:
        """Return the squares (dots, 4) around the discs: left, top, right, bottom."""
        reach = self.radii[:, None] + margin
        return np.hstack([self.centers - reach, self.centers + reach])


class Labels:
    """The labels beside agents; each stays at the same place of its disc from frame to frame if possible.

    Attributes:
        are_shown: whether the last labels included names.
    """

    def __init__(self) -> None:
        self._places: dict[str, int] = {}  # name of the first agent of a label -> its place
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
        """Return the labels of agents that were drawn; labels without a free place are omitted.

        Args:
            camera: of the picture.
            fine: the number of camera pixels per page pixel.
            ctx: the context.
            artists: that have drawn the agents.
            choice: whose names are shown.
            page: where labels may be.
            taken: occupied areas.
        """
        agents = ctx.agent.agents
        heights = dict(_heights(ctx))
        named = _named(ctx, choice, page)
        self.are_shown = bool(named)
        is_counted = drawing_of(ctx).has_stacks and len(agents) <= _MOST_COUNTED
        if not (named or heights or is_counted):
            return []
        looks = [look for look in looks_of(artists) if look.current_position is not None and look.name in agents]
        for artist in artists.values():
            looks += [mark for mark in drawn_marks(artist) if mark.name in named]
        dots = dots_of(looks, camera, fine, heights.keys())
        lines = _lines(looks, dots, heights, named)
        knots = _knots(dots, list(lines))
        # Labels that were there before stay, so they choose first.
        knots.sort(key=lambda knot: looks[knot[0]].name not in self._places)
        signs = sign_boxes(ctx, artists, camera, fine)
        occupied = np.vstack([signs, np.array(taken).reshape(-1, 4)])
        found = list[Label]()
        before = self._places
        self._places = {}
        for knot in knots:
            name = looks[knot[0]].name
            label = _shortened([lines[row] for row in knot])
            places = _places(dots, knot, label)
            boxes = np.vstack([occupied + _AROUND, np.delete(dots.boxes(_DOTS_PX), knot, axis=0)])
            place = _first_free(places, page, boxes, before.get(name, -1))
            if place is not None:
                occupied = np.vstack([occupied, places[place]])
                self._places[name] = place
                left, top, right, bottom = places[place].tolist()
                leader = _leader(dots, knot[0], places[place]) if place >= _NEAR_PLACES else []
                found.append(Label(label, (left, top, right, bottom), leader))
        return found


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


def sign_boxes(ctx: IContext, artists: Mapping[str, IArtist], camera: Camera, fine: float = 1.0) -> FloatArray:
    """Return the boxes (signs, 4) of flags, goals and similar signs in page pixels."""
    marks = {name: artist for name, artist in artists.items() if getattr(artist.get_drawer(), "is_mark", False)}
    if not marks:
        return np.empty((0, 4))
    share = max(data.get("_alpha", 1.0) for data in map(data_of, marks.values()))
    commands = ArtistGroup(ctx, marks).commands(share)
    if len(commands) == 0:
        return np.empty((0, 4))
    view = camera._replace(scale=camera.scale / fine)
    scale = np.where(commands.space == DrawSpace.WORLD, view.scale, 1.0)
    reach = (commands.size * scale + commands.width / 2)[:, None]
    points = on_screen(commands, view)
    low = np.minimum.reduceat(points, commands.offsets[:-1]) - reach
    high = np.maximum.reduceat(points, commands.offsets[:-1]) + reach
    return np.hstack([low, high])


def _lines(
    looks: Sequence[AgentData], dots: AgentDots, heights: Mapping[str, str], named: frozenset[str]
) -> dict[int, LabelLine]:
    """Return row of a disc -> text beside it; the first of several discs of one color at one place has their number."""
    at: dict[tuple[object, ...], list[int]] = {}
    for row, (look, place) in enumerate(zip(looks, np.rint(dots.centers).tolist(), strict=True)):
        at.setdefault((*place, repr(look.color)), []).append(row)
    found = dict[int, LabelLine]()
    for first, *others in at.values():
        look = looks[first]
        parts = [look.name if look.name in named else "", heights.get(look.name, "")]
        words = ", ".join(filter(None, parts))
        if others:
            words = f"\N{MULTIPLICATION SIGN}{1 + len(others)}"
        if words:
            found[first] = LabelLine(words, look.color)
    return found


def _knots(dots: AgentDots, rows: list[int]) -> list[list[int]]:
    """Return discs in groups: each joins the first group whose first disc it touches."""
    firsts = np.zeros(len(rows), np.int64)
    knots = list[list[int]]()
    for row in rows:
        known = firsts[: len(knots)]
        apart = np.hypot(*(dots.centers[known] - dots.centers[row]).T)
        near = np.flatnonzero(apart < dots.radii[known] + dots.radii[row])
        if len(near):
            knots[near[0]].append(row)
        else:
            firsts[len(knots)] = row
            knots.append([row])
    return knots


def _shortened(lines: list[LabelLine]) -> list[LabelLine]:
    """Return the first lines, and the number of the others."""
    if len(lines) <= _MOST_LINES:
        return lines
    named = lines[: _MOST_LINES - 1]
    return [*named, LabelLine(f"+{len(lines) - len(named)}", None)]


def _indent(lines: list[LabelLine]) -> float:
    """Return the width of the bullets, which a single line does not need."""
    return _INDENT_PX if len(lines) > 1 else 0.0


# -- where they go ------------------------------------------------------------------------------------------------


def _first_free(places: FloatArray, page: Rectangle, boxes: FloatArray, before: int) -> int | None:
    """Return the place before, else the first of `places` (places, 4), that is on the page and hits no box."""
    around = np.concatenate([places[:, :2].min(axis=0), places[:, 2:].max(axis=0)])
    boxes = boxes[are_hit(boxes, around[None])]
    is_inside = (places[:, :2] >= page[:2]).all(axis=1) & (places[:, 2:] <= page[2:]).all(axis=1)
    free = np.flatnonzero(is_inside & ~are_hit(places, boxes)).tolist()
    if before in free:
        return before
    return free[0] if free else None


def are_hit(boxes: FloatArray, others: FloatArray) -> BoolArray:
    """Return which boxes (boxes, 4) overlap one of `others` (others, 4)."""
    begins_before = (boxes[:, None, :2] < others[:, 2:]).all(axis=2)
    ends_behind = (boxes[:, None, 2:] > others[:, :2]).all(axis=2)
    is_hit: BoolArray = np.any(begins_before & ends_behind, axis=1)
    return is_hit


def _places(dots: AgentDots, knot: list[int], lines: list[LabelLine]) -> FloatArray:
    """Return where a label may stand beside discs, (places, 4)."""
    own = dots.boxes()[knot]
    low = own[:, :2].min(axis=0)
    high = own[:, 2:].max(axis=0)
    width = _indent(lines) + max(words_width(words, LABEL_PX) for words, _ in lines)
    size = np.array([width, EM * LABEL_PX + (len(lines) - 1) * _LINE_PX])
    return beside((low + high) / 2, (high - low) / 2, size)


def _leader(dots: AgentDots, row: int, box: FloatArray) -> list[tuple[float, float]]:
    """Return the line from a disc to a distant label."""
    center = dots.centers[row]
    end = np.clip(center, box[:2], box[2:])
    way = end - center
    begin = center + way * (dots.radii[row] / np.hypot(*way))
    return [(float(x), float(y)) for x, y in (begin, end)]


def beside(middle: FloatArray, half: FloatArray, size: FloatArray) -> FloatArray:
    """Return boxes (places, 4) of a size (2,) at all sides of a box from its middle (2,): near ones, then far ones."""
    share = np.where(np.abs(SIDES).sum(axis=1) > 1.0, _CORNER, 1.0)[:, None]
    around = [middle + SIDES * ((half + gap) * share + size / 2) for gap in _GAPS_PX]
    middles = np.concatenate(around)
    return np.hstack([middles - size / 2, middles + size / 2])
