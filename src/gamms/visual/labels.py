"""Words on the map: labels beside agents, and names along streets. `layout.py` decides where they are free.

A label has the names, heights or number of agents. Agents whose discs touch share one, a line for each with a bullet
in its color. It stands at one of eight sides of its discs, or farther away at the end of a line; there it covers no
disc, sign or other label. Names of streets stand along straight parts, clear of agents, signs, labels and each other.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import atan2, cos, degrees, radians, sin
from typing import NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_known
from gamms.errors import BadType
from gamms.ir.draw import DrawSpace
from gamms.ir.geometry import find_straight_parts
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing import IAerialAgent, IArtist, IContext
from gamms.visual.appearance import AgentData, AnyColor, Rgb
from gamms.visual.artist import ArtistGroup, collect_drawn_looks, get_data, list_looks
from gamms.visual.camera import Camera, project_to_screen
from gamms.visual.drawers.agents import RING, RING_PX
from gamms.visual.drawers.marks import get_drawn_marks
from gamms.visual.drawers.streets import find_classes, find_distinct_roads, find_levels, is_in_metres, join_polylines
from gamms.visual.drawing import get_drawing
from gamms.visual.font import EM, MIDDLE, measure_words
from gamms.visual.layout import Layout, Rectangle
from gamms.visual.legend import Pen

AUTO = "auto"
Choice = bool | str | frozenset[str]
"""All names, none, as many as are easy to read ("auto"), or these."""

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
_AROUND_PX = 2.0  # from a label to signs and other labels
_DOTS_PX = 3.0  # more to other discs
_MOST_COUNTED = 5000  # agents; with more, agents at one place are not counted
# the number of legible names, and the page pixels that each needs
_MOST_AUTO = 30
_AUTO_PX = 7_000.0

# names of streets
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
            pen.draw_line(self.leader, pen.faint, 1.0)
        indent = _compute_indent(self.lines)
        for number, (words, color) in enumerate(self.lines):
            middle = top + EM * LABEL_PX / 2 + number * _LINE_PX
            if indent and color is not None:
                pen.draw_circle(left + _BULLET_PX, middle, _BULLET_PX, color)
            pen.draw_text(words, left + indent, middle, LABEL_PX)


class AgentDots(NamedTuple):
    """The drawn discs of agents, in pixels."""

    centers: FloatArray  # (dots, 2)
    radii: FloatArray  # (dots,)

    def compute_boxes(self, margin: float = 0.0) -> FloatArray:
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

    def place(
        self,
        camera: Camera,
        fine: float,
        ctx: IContext,
        artists: Mapping[str, IArtist],
        choice: Choice,
        layout: Layout,
    ) -> list[Label]:
        """Return the labels of agents that were drawn, and cover their areas; without a free place there is no label.

        Args:
            camera: of the picture.
            fine: the number of camera pixels per page pixel.
            ctx: the context.
            artists: that have drawn the agents.
            choice: whose names are shown.
            layout: of the page.
        """
        agents = ctx.agent.agents
        heights = dict(_list_heights(ctx))
        named = _find_named_agents(ctx, choice, layout.page)
        self.are_shown = bool(named)
        is_counted = get_drawing(ctx).has_stacks and len(agents) <= _MOST_COUNTED
        if not (named or heights or is_counted):
            return []
        looks = [look for look in list_looks(artists) if look.current_position is not None and look.name in agents]
        for artist in artists.values():
            looks += [mark for mark in get_drawn_marks(artist) if mark.name in named]
        dots = find_dots(looks, camera, fine, heights.keys())
        lines = _make_lines(looks, dots, heights, named)
        knots = _group_discs(dots, list(lines))
        # Labels that were there before stay, so they choose first.
        knots.sort(key=lambda knot: looks[knot[0]].name not in self._places)
        found = list[Label]()
        before = self._places
        self._places = {}
        for knot in knots:
            name = looks[knot[0]].name
            label = _shorten_lines([lines[row] for row in knot])
            places = _list_places(dots, knot, label)
            order = sorted(range(len(places)), key=lambda place: place != before.get(name))
            others = np.delete(dots.compute_boxes(_DOTS_PX), knot, axis=0)
            free = Layout(layout.page, np.vstack([layout.areas, others])).find_free(places[order], _AROUND_PX)
            if free is not None:
                place = order[free]
                layout.cover(places[place])
                self._places[name] = place
                left, top, right, bottom = places[place].tolist()
                leader = _make_leader(dots, knot[0], places[place]) if place >= _NEAR_PLACES else []
                found.append(Label(label, (left, top, right, bottom), leader))
        return found


def draw_names(
    pen: Pen,
    fine: float,
    ctx: IContext,
    artists: Mapping[str, IArtist],
    labels: Labels,
    layout: Layout,
    *,
    choice: Choice,
    has_streets: bool,
) -> None:
    """Draw the labels beside agents, and below them the names of streets, a little paler but readable on a street.

    Args:
        pen: the pen of the page.
        fine: the number of camera pixels per page pixel.
        ctx: the context.
        artists: that have drawn the map.
        labels: the labels beside agents.
        layout: of the page, whose areas stay visible.
        choice: whose names are shown.
        has_streets: whether streets have names.
    """
    layout.cover(sign_boxes(ctx, artists, pen.camera, fine))
    found = labels.place(pen.camera, fine, ctx, artists, choice, layout)
    if has_streets:
        red, green, blue = (round((2 * ink + faint) / 3) for ink, faint in zip(pen.ink, pen.faint, strict=True))
        for name in place_street_names(pen.camera, fine, ctx, artists, layout):
            name.draw(pen, (red, green, blue))
    for label in found:
        label.draw(pen)


def _find_named_agents(ctx: IContext, choice: Choice, page: Rectangle) -> frozenset[str]:
    """Return the names of the agents whose names are shown."""
    if isinstance(choice, frozenset):
        return choice
    if choice == AUTO:
        left, top, right, bottom = page
        most = min(_MOST_AUTO, (right - left) * (bottom - top) / _AUTO_PX)
        choice = get_drawing(ctx).has_default_look and len(ctx.agent.agents) <= most
    return frozenset(ctx.agent.agents if choice else ())


def _list_heights(ctx: IContext) -> Iterator[tuple[str, str]]:
    """Yield the names of agents in the air, and how high they are; "" on the ground."""
    positions = ctx.agent.positions
    for row in positions.flyers.tolist():
        z = cast("IAerialAgent", ctx.agent.agents[positions.names[row]]).position[2]
        height = f"{z:.0f} m" if z >= 10.0 else f"{z:.2g} m"
        yield positions.names[row], height if z > 0.0 else ""


def find_dots(looks: Sequence[AgentData], camera: Camera, fine: float = 1.0, flyers: Iterable[str] = ()) -> AgentDots:
    """Return the discs of drawn agents in page pixels; one has `fine` pixels of the camera."""
    above = set(flyers)
    columns = [(*(look.current_position or ()), *look.shift, look.size, look.least_px) for look in looks]
    is_above = np.array([look.name in above for look in looks], bool)
    return convert_dots(np.array(columns, np.float64).reshape(-1, 6), camera, fine, is_above)


def convert_dots(
    columns: FloatArray, camera: Camera, fine: float = 1.0, is_above: BoolArray | bool = False
) -> AgentDots:
    """Return the discs of columns (dots, 6), as in `AgentLooks.list_drawn`; `is_above` marks flying agents."""
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
    share = max(data.get("_alpha", 1.0) for data in map(get_data, marks.values()))
    commands = ArtistGroup(ctx, marks).draw_artists(share)
    if len(commands) == 0:
        return np.empty((0, 4))
    view = camera._replace(scale=camera.scale / fine)
    scale = np.where(commands.space == DrawSpace.WORLD, view.scale, 1.0)
    reach = (commands.size * scale + commands.width / 2)[:, None]
    points = project_to_screen(commands, view)
    low = np.minimum.reduceat(points, commands.offsets[:-1]) - reach
    high = np.maximum.reduceat(points, commands.offsets[:-1]) + reach
    return np.hstack([low, high])


def _make_lines(
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


def _group_discs(dots: AgentDots, rows: list[int]) -> list[list[int]]:
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


def _shorten_lines(lines: list[LabelLine]) -> list[LabelLine]:
    """Return the first lines, and the number of the others."""
    if len(lines) <= _MOST_LINES:
        return lines
    named = lines[: _MOST_LINES - 1]
    return [*named, LabelLine(f"+{len(lines) - len(named)}", None)]


def _compute_indent(lines: list[LabelLine]) -> float:
    """Return the width of the bullets, which a single line does not need."""
    return _INDENT_PX if len(lines) > 1 else 0.0


# -- where they go ------------------------------------------------------------------------------------------------


def _list_places(dots: AgentDots, knot: list[int], lines: list[LabelLine]) -> FloatArray:
    """Return where a label may stand beside discs, (places, 4)."""
    own = dots.compute_boxes()[knot]
    low = own[:, :2].min(axis=0)
    high = own[:, 2:].max(axis=0)
    width = _compute_indent(lines) + max(measure_words(words, LABEL_PX) for words, _ in lines)
    size = np.array([width, EM * LABEL_PX + (len(lines) - 1) * _LINE_PX])
    return place_beside((low + high) / 2, (high - low) / 2, size)


def _make_leader(dots: AgentDots, row: int, box: FloatArray) -> list[tuple[float, float]]:
    """Return the line from a disc to a distant label."""
    center = dots.centers[row]
    end = np.clip(center, box[:2], box[2:])
    way = end - center
    begin = center + way * (dots.radii[row] / np.hypot(*way))
    return [(float(x), float(y)) for x, y in (begin, end)]


def place_beside(middle: FloatArray, half: FloatArray, size: FloatArray) -> FloatArray:
    """Return boxes (places, 4) of a size (2,) at all sides of a box from its middle (2,): near ones, then far ones."""
    share = np.where(np.abs(SIDES).sum(axis=1) > 1.0, _CORNER, 1.0)[:, None]
    around = [middle + SIDES * ((half + gap) * share + size / 2) for gap in _GAPS_PX]
    middles = np.concatenate(around)
    return np.hstack([middles - size / 2, middles + size / 2])


# -- names of streets ---------------------------------------------------------------------------------------------


class StreetName(NamedTuple):
    """A text along a street; positions in pixels from the upper left corner."""

    words: str
    x: float  # of their middle
    y: float
    angle: float  # degrees, counter-clockwise

    @property
    def corner(self) -> tuple[float, float]:
        """The upper left corner of the words, around which they are turned."""
        across = measure_words(self.words, STREET_PX) / 2
        down = MIDDLE * STREET_PX
        turn = radians(self.angle)
        return self.x - across * cos(turn) - down * sin(turn), self.y + across * sin(turn) - down * cos(turn)

    def draw(self, pen: Pen, ink: Rgb) -> None:
        """Write the name."""
        pen.draw_turned_text(self.words, self.corner, STREET_PX, ink, self.angle)

    def compute_boxes(self) -> FloatArray:
        """Return squares (squares, 4) that cover the words: left, top, right, bottom."""
        half = EM * STREET_PX / 2
        across = measure_words(self.words, STREET_PX) / 2
        turn = radians(self.angle)
        steps = np.linspace(-across, across, int(2 * across / half) + 2)
        middles = np.column_stack([self.x + steps * cos(turn), self.y - steps * sin(turn)])
        return np.hstack([middles - half, middles + half])


class _StraightParts(NamedTuple):
    """The straight parts of named streets, the largest streets first."""

    words: list[str]
    begins: FloatArray  # (parts, 2)
    ends: FloatArray  # (parts, 2)
    widths: FloatArray  # (parts,)  of the words, pixels


def place_street_names(
    camera: Camera, fine: float, ctx: IContext, artists: Mapping[str, IArtist], layout: Layout
) -> list[StreetName]:
    """Return the names of the largest streets, if the scale of the map leaves room for names, and cover their areas.

    Args:
        camera: of the picture.
        fine: the number of camera pixels per page pixel.
        ctx: the context.
        artists: that have drawn the agents, which stay visible.
        layout: of the page.
    """
    scale = camera.scale / fine
    found = list[StreetName]()
    if scale < _CLOSE or not is_in_metres(ctx.graph.columns()):
        return found
    layout.cover(convert_dots(collect_drawn_looks(artists)[1], camera, fine).compute_boxes())
    left, top, right, bottom = layout.page
    most = int((right - left) * (bottom - top) / _NAME_AREA)
    for name in _propose_names(get_drawing(ctx).of_map(_find_straight_parts), camera._replace(scale=scale), layout):
        if len(found) == most:
            return found
        same = np.array([(one.x, one.y) for one in found if one.words == name.words]).reshape(-1, 2)
        is_near = np.hypot(*(same - (name.x, name.y)).T) < _AGAIN_PX
        if not is_near.any() and not layout.measure_overlaps(name.compute_boxes(), _CLEAR_PX).any():
            layout.cover(name.compute_boxes())
            found.append(name)
    return found


def _propose_names(parts: _StraightParts, camera: Camera, layout: Layout) -> Iterator[StreetName]:
    """Yield names at even distances along straight parts that are long enough, if they are inside the page."""
    begins = camera.to_screen(parts.begins)
    ways = camera.to_screen(parts.ends) - begins
    lengths = np.hypot(*ways.T)
    counts = np.clip(lengths / _AGAIN_PX, 1, _MOST_AGAIN).astype(np.int64)
    fits = lengths > parts.widths + 2 * _ROOM_PX
    row, number = kernels.expand_ranges(np.zeros(len(counts), np.int64), np.where(fits, counts, 0))
    middles = begins[row] + ways[row] * ((number + 0.5) / counts[row])[:, None]
    half = ways[row] * (parts.widths[row] / 2 / lengths[row])[:, None]
    is_inside = layout.are_inside(np.hstack([middles - np.abs(half), middles + np.abs(half)]))
    is_back = half[:, 0] < _UPRIGHT * half[:, 1]  # of names that are nearly upright, all read upwards
    half[is_back] *= -1.0
    for place in np.flatnonzero(is_inside).tolist():
        x, y = middles[place].tolist()
        across, down = half[place].tolist()
        yield StreetName(parts.words[row[place]], x, y, degrees(atan2(-down, across)))


def _find_straight_parts(columns: GraphColumns) -> _StraightParts:
    """Return the straight parts of streets that have names, but no tunnels; edges that meet are joined."""
    names = {row: _find_first_text(value) for row, value in columns.edge_attributes.get("name", {}).items()}
    rows = find_distinct_roads(columns)
    rows = rows[(find_levels(columns)[rows] >= 0) & np.isin(rows, [row for row, name in names.items() if name])]
    if not len(rows):
        return _StraightParts([], np.empty((0, 2)), np.empty((0, 2)), np.empty(0))
    texts, group = np.unique([names[row] for row in rows.tolist()], return_inverse=True)
    classes = np.zeros(len(texts), np.int64)
    np.maximum.at(classes, group, find_classes(columns)[rows])
    owner, ends = find_straight_parts(*join_polylines(columns, rows), group, _STRAIGHT_M)
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    order = np.lexsort((owner, -lengths, -classes[owner]))
    widths = np.array([measure_words(text, STREET_PX) for text in texts.tolist()])
    words = texts[owner[order]].tolist()
    return _StraightParts(words, ends[order, 0], ends[order, 1], widths[owner[order]])


def _find_first_text(value: object) -> str:
    """Return a name, or the first of several; "" for invalid or too long names."""
    text = value[0] if isinstance(value, list | tuple) and value else value
    return text.strip() if isinstance(text, str) and len(text) <= _LONGEST_NAME else ""
