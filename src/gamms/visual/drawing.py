"""Draw commands, and the primitives that add commands."""
# ruff: noqa: ARG002 - published signatures; culling and smoothing are the backend's business

import os
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from gamms.arguments import as_float, as_range
from gamms.errors import BadType, BadValue
from gamms.ir.draw import FARTHEST, DrawCommands, DrawKind, DrawSpace, Owner
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, read_only
from gamms.knowledge.sides import Side, find_side, label_sides
from gamms.text import as_text, shown
from gamms.typing import IAgent, IContext
from gamms.visual.appearance import AnyColor, Color, Rgb, assign_team_colors, parse_color, sort_sides
from gamms.visual.camera import Viewpoint, find_shifted_points
from gamms.visual.shown_turn import LastMoves, PastTurns, SensorCarriers, TurnEvents
from gamms.visual.themes import THEMES, Theme

_ONE = array("q", (1,))  # point, of as many commands as it is repeated
_CIRCLES = 4  # that make a disc: two edges and two areas, in world units and in pixels
_COLUMNS = {"kind": "q", "layer": "q", "space": "q", "size": "d", "width": "d", "angle": "d"}  # and their type codes


Points = Sequence[Sequence[float]] | FloatArray
"""(x, y) pairs of numbers."""
Offsets = Sequence[int] | IntArray
"""(items + 1,) the index of the first point of each line or polygon, and the number of points."""


EDGE_PX = 3.0


class Disc(NamedTuple):
    """The look of a disc with an edge: `radius` in world units, but at least some pixels."""

    radius: float
    at_least_px: float
    color: AnyColor
    edge: AnyColor
    edge_px: float = EDGE_PX  # half of it is hidden


class DiscOffsets(NamedTuple):
    """The offsets of discs on a shared node before and after a turn, in radii."""

    on: IntArray  # (discs,) the node of each, by any number
    rows: IntArray  # (discs,) the look of each
    moves: object  # of the turn
    starts: FloatArray  # (discs, 2)
    ends: FloatArray  # (discs, 2)

    def is_of(self, on: IntArray, rows: IntArray) -> bool:
        """Return whether it belongs to these discs."""
        return np.array_equal(self.on, on) and np.array_equal(self.rows, rows)


class Commands:
    """A growing list of draw commands; commands are added on `layer`, above earlier ones.

    Attributes:
        layer: the layer of the next commands.
        owner: the owner of the next commands; None: they have no owner.
    """

    def __init__(self) -> None:
        self.layer = 0
        self.owner: Owner | None = None
        self._owners: dict[int, Owner] = {}  # by row
        self._columns = {name: array(code) for name, code in _COLUMNS.items()}
        self._color = bytearray()
        self._text = list[str]()
        self._points: list[FloatArray] = []
        self._counts = array("q")  # of points, of each command

    def add_circles(
        self, centers: Points, radius: float, color: AnyColor, width: float = 0.0, space: DrawSpace = DrawSpace.WORLD
    ) -> None:
        """Draw equal circles around `centers` (circles, 2); `radius` in the unit of `space`, `width` px."""
        points = _as_points(centers)
        self._add(DrawKind.CIRCLE, points, _ONE * len(points), color, space=space, size=radius, width=width)

    def add_discs(
        self, centers: Points, discs: Sequence[Disc], looks: IntArray, shifts: FloatArray | None = None
    ) -> None:
        """Draw discs around `centers` (discs, 2), each above the previous ones; `looks` (discs,) are rows of `discs`.

        `shifts` (discs, 2) moves discs right and down, by at most one radius: so the smaller of the two sizes of a
        disc stays within the larger one, whichever that is.
        """
        points = _as_points(centers)
        n = _CIRCLES * len(looks)
        sizes = []
        widths = []
        inks = []
        for disc in discs:
            radius = _as_extent(disc.radius, "size")
            least = _as_extent(disc.at_least_px, "size")
            edge_px = _as_extent(disc.edge_px, "width")
            edge = parse_color(disc.edge)
            ink = parse_color(disc.color)
            # Both edges come first, so that the larger disc hides the edge of the smaller.
            sizes.append((radius, least, radius, least))
            widths.append((edge_px, edge_px, 0.0, 0.0))
            inks.append((edge, edge, ink, ink))
        spaces = np.tile(np.array((DrawSpace.WORLD, DrawSpace.SCREEN), np.int64), n // 2)
        size, width = (np.array(column, np.float64)[looks] for column in (sizes, widths))
        values = {"kind": DrawKind.CIRCLE, "layer": self.layer, "space": spaces, "size": size, "width": width}
        self._append(n, values | {"angle": 0.0}, np.array(inks, np.uint8)[looks].tobytes(), "")
        if shifts is None or not shifts.any():
            self._points.append(np.repeat(points, _CIRCLES, axis=0))
            self._counts.extend(_ONE * n)
            return
        in_world = (spaces == DrawSpace.WORLD).reshape(-1, _CIRCLES)
        both = np.empty((len(looks), _CIRCLES, 2, 2))  # of each circle its centre, and in pixels how far it is moved
        moves = shifts[:, None] * size[:, :, None]
        both[:, :, 1] = moves
        both[:, :, 0] = points[:, None] + np.where(in_world[:, :, None], moves * (1.0, -1.0), 0.0)
        is_there = np.ones(both.shape[:3], bool)
        is_there[:, :, 1] = ~in_world & moves.any(axis=2)
        self._points.append(both[is_there])
        self._counts.frombytes(is_there.sum(axis=2, dtype=np.int64).tobytes())

    def add_lines(
        self, points: Points, offsets: Offsets, color: AnyColor, width: float = 1.0, space: DrawSpace = DrawSpace.SCREEN
    ) -> None:
        """Draw polylines of one style; line `i` is `points[offsets[i]:offsets[i + 1]]`.

        `width` is in the unit of `space`.

        Raises:
            BadValue: a line of fewer than two points, or offsets that do not divide the points.
        """
        points = _as_points(points)
        counts = np.diff(offsets)
        if len(offsets) == 0 or offsets[0] != 0 or offsets[-1] != len(points) or (counts < 2).any():
            raise BadValue("Each line needs two points or more, and the offsets must go from 0 to their number.")
        self._add(DrawKind.LINE, points, counts, color, space=space, width=width)

    def add_line(self, points: Points, color: AnyColor, width: float = 1.0) -> None:
        """Draw one polyline; `width` in pixels."""
        self.add_lines(points, (0, len(points)), color, width)

    def add_polygon(self, points: Points, color: AnyColor, width: float = 0.0) -> None:
        """Draw a polygon; `width` of its outline in pixels, 0 = filled."""
        points = _as_points(points)
        if len(points) < 3:
            raise BadValue(f"A polygon needs three points or more, not {len(points)}.")
        self._add(DrawKind.POLYGON, points, [len(points)], color, width=width)

    def add_polygons(self, points: Points, offsets: Offsets, color: AnyColor, width: float = 0.0) -> None:
        """Draw polygons of one style; polygon `i` is `points[offsets[i]:offsets[i + 1]]`.

        Raises:
            BadValue: a polygon of fewer than three points, or offsets that do not divide the points.
        """
        points = _as_points(points)
        counts = np.diff(offsets)
        if len(offsets) == 0 or offsets[0] != 0 or offsets[-1] != len(points) or (counts < 3).any():
            raise BadValue("Each polygon needs three points or more, and the offsets must go from 0 to their number.")
        self._add(DrawKind.POLYGON, points, counts, color, width=width)

    def add_symbols(self, places: Points, corners: Points, color: AnyColor, width: float = 0.0) -> None:
        """Draw the same polygon at each of `places` (symbols, 2); `corners` are pixels right of there and below.

        Raises:
            BadValue: fewer than two corners.
        """
        places = _as_points(places)
        corners = _as_points(corners)
        if len(corners) < 2:
            raise BadValue(f"A symbol needs two corners or more, not {len(corners)}.")
        points = np.empty((len(places), 1 + len(corners), 2))
        points[:, 0] = places
        points[:, 1:] = corners
        counts = [1 + len(corners)] * len(places)
        self._add(DrawKind.POLYGON, points.reshape(-1, 2), counts, color, space=DrawSpace.SCREEN, width=width)

    def add_rectangle(self, x: float, y: float, width: float, height: float, color: AnyColor) -> None:
        """Fill a rectangle whose top-left corner is at (x, y); `width` and `height` in pixels."""
        extent = as_range(width, "The width of a rectangle"), as_range(height, "The height of a rectangle")
        self._add(DrawKind.RECTANGLE, _as_points([(x, y), extent]), [2], color, space=DrawSpace.SCREEN)

    def add_text(self, text: str, x: float, y: float, color: AnyColor, font_px: float, angle: float = 0.0) -> None:
        """Write `text` with its top-left corner at (x, y), turned around that counter-clockwise by `angle` degrees."""
        self._add(
            DrawKind.TEXT,
            _as_points([(x, y)]),
            [1],
            color,
            space=DrawSpace.SCREEN,
            size=font_px,
            angle=as_float(angle, "angle"),
            text=str(text),
        )

    def add_image(self, path: str, x: float, y: float, half_side: float, angle: float = 0.0) -> None:
        """Draw an image file around (x, y), turned counter-clockwise by `angle` degrees."""
        points = _as_points([(x, y)])
        self._add(DrawKind.IMAGE, points, [1], (0, 0, 0), size=half_side, angle=as_float(angle, "angle"), text=path)

    def add_commands(self, commands: DrawCommands) -> None:
        """Add existing commands, moved to the current layer."""
        first = len(self._text)
        self._owners |= {first + row: owner for row, owner in commands.owners.items()}
        values = {name: getattr(commands, name) for name in _COLUMNS} | {"layer": self.layer}
        self._append(len(commands), values, commands.color.tobytes(), "")
        self._text[len(self._text) - len(commands) :] = commands.text
        self._points.append(commands.points)
        self._counts.frombytes(np.diff(commands.offsets).tobytes())

    def _add(  # noqa: PLR0913 - one argument per column
        self,
        kind: DrawKind,
        points: FloatArray,
        counts: Sequence[int] | IntArray,
        color: AnyColor,
        *,
        space: DrawSpace = DrawSpace.WORLD,
        size: float = 0.0,
        width: float = 0.0,
        angle: float = 0.0,
        text: str = "",
    ) -> None:
        size = _as_extent(size, "size")
        width = _as_extent(width, "width")
        values = {"kind": kind, "layer": self.layer, "space": space, "size": size, "width": width, "angle": angle}
        self._append(len(counts), values, bytes(parse_color(color)) * len(counts), text)
        self._points.append(points)
        if isinstance(counts, np.ndarray):
            self._counts.frombytes(counts.astype(np.int64).tobytes())
        else:
            self._counts.extend(counts)

    def _append(self, commands: int, values: Mapping[str, Any], color: bytes, text: str) -> None:
        """Append a value for all commands, or an array with one for each, to every column."""
        if self.owner is not None:
            first = len(self._text)
            self._owners |= dict.fromkeys(range(first, first + commands), self.owner)
        for name, column in self._columns.items():
            value = values[name]
            if isinstance(value, np.ndarray):
                column.frombytes(value.tobytes())
            elif commands == 1:
                column.append(value)
            else:
                column.extend(array(column.typecode, (value,)) * commands)
        self._color += color
        self._text += [text] * commands

    def freeze(self) -> DrawCommands:
        """Return everything added so far, as read-only columns."""
        columns = {name: read_only(np.array(column)) for name, column in self._columns.items()}
        return DrawCommands(
            **columns,
            color=read_only(np.array(self._color, np.uint8).reshape(-1, 4)),
            offsets=read_only(np.concatenate(([0], np.cumsum(np.array(self._counts, np.int64))))),
            points=read_only(np.concatenate([np.empty((0, 2)), *self._points])),
            text=tuple(self._text),
            owners=self._owners,
        )


def join_drawings(below: DrawCommands, above: DrawCommands) -> DrawCommands:
    """Return both, the second on the highest layer of all."""
    if len(above) == 0:
        return below
    top = max(int(below.layer.max(initial=0)), int(above.layer.max(initial=0)))
    arrays = {
        name: np.concatenate([getattr(below, name), getattr(above, name)])
        for name in ("kind", "space", "size", "width", "angle", "color", "points")
    }
    return DrawCommands(
        layer=np.concatenate([below.layer, np.full(len(above), top)]),
        offsets=np.concatenate([below.offsets, below.offsets[-1] + above.offsets[1:]]),
        text=(*below.text, *above.text),
        owners={**below.owners, **{len(below) + row: owner for row, owner in above.owners.items()}},
        **arrays,
    )


def magnify(commands: DrawCommands, factor: float) -> DrawCommands:
    """Return a copy in which all pixel sizes are multiplied by a factor."""
    if factor == 1.0:
        return commands
    in_pixels = commands.space == DrawSpace.SCREEN
    points = commands.points.copy()
    extents = commands.offsets[:-1][in_pixels & (commands.kind == DrawKind.RECTANGLE)] + 1
    points[extents] *= factor
    points[find_shifted_points(commands)[0]] *= factor
    width_in_pixels = in_pixels | (commands.kind != DrawKind.LINE)  # outlines always are
    return replace(
        commands,
        size=commands.size * np.where(in_pixels, factor, 1.0),
        width=commands.width * np.where(width_in_pixels, factor, 1.0),
        points=points,
    )


def _as_points(points: Sequence[Any] | FloatArray) -> FloatArray:
    try:
        # A copy, because the caller may change the array later.
        array = np.array(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise BadValue(f"Points are (x, y) pairs of numbers, not {shown(points)}: {error}") from None
    if array.size == 0:
        return np.empty((0, 2))
    if array.ndim != 2 or array.shape[1] != 2:
        raise BadValue(f"Points are (x, y) pairs, not an array of shape {array.shape}.")
    if not np.abs(array).max() <= FARTHEST:  # nor NaN
        bad = array[~(np.abs(array) <= FARTHEST).all(axis=1)][0].tolist()
        raise BadValue(f"A point is not finite or farther away than {FARTHEST:g}: {tuple(bad)}.")
    return array


def _as_extent(value: object, name: str) -> float:
    if type(value) is float and 0.0 <= value <= FARTHEST:
        return value
    number = as_range(value, name)
    if number > FARTHEST:
        raise BadValue(f"{name} must be at most {FARTHEST:g}, not {number}.")
    return number


Measured = TypeVar("Measured")

_FONT_PX = 36


class Drawing:
    """The drawing primitives, and queries of drawers about the turn that is shown.

    Args:
        ctx: the context.
        theme: the default theme.
        held_image: turns an image into the path of a file, or the name of a loaded image.

    Attributes:
        theme: the current theme.
        turns: how the last ones ended.
        motion: the last moves of agents.
        events: of the turn that is shown.
        carriers: of sensors.
        viewpoint: of pictures.
        team_colors: text of a team -> the color that was declared for it.
        sides: the order in which teams choose their colors, as a cut recording says; None: an agent of no team.
        labels: the texts that the header of a recording has assigned to sides.
        has_default_look: whether the graph was not declared, so that agents on one node are drawn beside each other.
        has_stacks: whether so many agents are on one node that they are counted.
        spread: how agents on one node were moved before and after a turn.
        commands: the open list; None: nothing is drawn.
    """

    def __init__(
        self, ctx: IContext, theme: Theme = THEMES["light"], held_image: Callable[[object], str] | None = None
    ) -> None:
        self._ctx = ctx
        self.theme = theme
        self._held_image = held_image or image_path
        self.turns = PastTurns(ctx)
        self.motion = LastMoves(ctx, self.turns)
        self.carriers = SensorCarriers(ctx, self.motion.list_on_edges)
        self.events = TurnEvents(ctx)
        self.viewpoint = Viewpoint(ctx, self.motion.find_position)
        self.team_colors: Mapping[str, Rgb] = {}
        self.sides: Sequence[str | None] = ()
        self.labels: Sequence[str] = ()
        self.has_default_look = False
        self.has_stacks = False
        self.spread: DiscOffsets | None = None
        self.commands: Commands | None = None
        self._measured: tuple[GraphColumns | None, dict[Any, Any]] = None, {}
        self._labeled: tuple[object, dict[Side, str]] = None, {}  # their inputs, and the texts of sides
        self._colors: tuple[object, dict[str, Rgb]] = None, {}  # their inputs, and the colors of groups

    @contextmanager
    def themed(self, theme: Theme) -> Iterator[None]:
        """Draw in another theme in a `with` block."""
        before = self.theme
        self.theme = theme
        try:
            yield
        finally:
            self.theme = before

    @contextmanager
    def owned(self, agent: str = "", sides: Iterable[str] | None = None) -> Iterator[None]:
        """Set the owner of the commands of a `with` block; see `gamms.ir.draw.Owner`."""
        commands = self.commands
        if commands is None:
            yield
            return
        before = commands.owner
        commands.owner = Owner(agent, None if sides is None else tuple(sides))
        try:
            yield
        finally:
            commands.owner = before

    def record(self, draw: "Callable[[Commands], None]") -> DrawCommands:
        """Run a function, and return its drawing as draw commands."""
        outer = self.commands
        self.commands = Commands()
        try:
            draw(self.commands)
            return self.commands.freeze()
        finally:
            self.commands = outer

    def render_text(
        self,
        text: str,
        x: float,
        y: float,
        color: AnyColor = Color.Black,
        perform_culling_test: bool = True,
        font_size: int | None = None,
    ) -> None:
        """Write `text` with its top-left corner at (x, y); `font_size` in pixels, default 36."""
        if self.commands is not None:
            self.commands.add_text(text, x, y, color, _FONT_PX if font_size is None else font_size)

    def render_rectangle(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        color: AnyColor = Color.Black,
        perform_culling_test: bool = True,
    ) -> None:
        """Fill a rectangle whose top-left corner is at (x, y); `width` and `height` in pixels."""
        if self.commands is not None:
            self.commands.add_rectangle(x, y, width, height, color)

    def render_circle(
        self,
        x: float,
        y: float,
        radius: float,
        color: AnyColor = Color.Black,
        width: int = 0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a circle; `width` is its outline in pixels, 0 = filled."""
        if self.commands is not None:
            self.commands.add_circles([(x, y)], radius, color, width)

    def render_line(  # noqa: PLR0913, PLR0917 - 1.0.0's signature
        self,
        start_x: float,
        start_y: float,
        end_x: float,
        end_y: float,
        color: AnyColor = Color.Black,
        width: int = 1,
        is_aa: bool = False,
        perform_culling_test: bool = True,
        force_no_aa: bool = False,
    ) -> None:
        """Draw a line, `width` in pixels."""
        if self.commands is not None:
            self.commands.add_line([(start_x, start_y), (end_x, end_y)], color, width)

    def render_linestring(
        self,
        points: Sequence[tuple[float, float]],
        color: AnyColor = Color.Black,
        width: int = 1,
        closed: bool = False,
        is_aa: bool = False,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a polyline, `width` in pixels; a closed one returns to its first point."""
        if self.commands is not None:
            self.commands.add_line([*points, *points[:1]] if closed else points, color, width)

    def render_polygon(
        self,
        points: Sequence[tuple[float, float]],
        color: AnyColor = Color.Black,
        width: int = 0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a polygon; `width` is its outline in pixels, 0 = filled."""
        if self.commands is not None:
            self.commands.add_polygon(points, color, width)

    def render_image(
        self,
        x: float,
        y: float,
        image: object,
        size: float,
        angle: float = 0.0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw the image file `image` with side `2 * size`, turned by `angle` degrees."""
        if self.commands is not None:
            self.commands.add_image(self._held_image(image), x, y, size, angle)

    def render_lines(
        self,
        points: Points,
        offsets: Offsets,
        color: AnyColor = Color.Black,
        width: float = 1,
        *,
        in_world: bool = False,
    ) -> None:
        """Draw many polylines at once: line `i` is `points[offsets[i]:offsets[i + 1]]`.

        `width` is in pixels, or in world units if `in_world` is set; lines thinner than a pixel are paler.
        """
        if self.commands is not None:
            self.commands.add_lines(points, offsets, color, width, DrawSpace.WORLD if in_world else DrawSpace.SCREEN)

    def render_polygons(
        self, points: Points, offsets: Offsets, color: AnyColor = Color.Black, width: float = 0
    ) -> None:
        """Draw many polygons at once: polygon `i` is `points[offsets[i]:offsets[i + 1]]`.

        `width` is the outline in pixels, 0 = filled. A polygon is filled by the even-odd rule; so one with a seam to an
        inner ring has a hole there.
        """
        if self.commands is not None:
            self.commands.add_polygons(points, offsets, color, width)

    def render_circles(
        self,
        centers: Points,
        radius: float,
        color: AnyColor = Color.Black,
        width: float = 0,
        *,
        in_pixels: bool = False,
    ) -> None:
        """Draw many equal circles at once; `radius` in world units, or in pixels where `in_pixels` is set."""
        if self.commands is not None:
            space = DrawSpace.SCREEN if in_pixels else DrawSpace.WORLD
            self.commands.add_circles(centers, radius, color, width, space)

    def render_symbols(self, places: Points, corners: Points, color: AnyColor = Color.Black, width: float = 0) -> None:
        """Draw a sign of one size in all pictures and windows at each of `places`: a polygon with two corners or more.

        Args:
            places: (x, y) pairs, in world units.
            corners: of each sign, in pixels right of its place and below it.
            color: of all signs.
            width: of the outline, in pixels; 0 = filled.
        """
        if self.commands is not None:
            self.commands.add_symbols(places, corners, color, width)

    def position_of(self, agent_name: str, share: float = 1.0) -> tuple[float, float]:
        """Return the position of an agent after a share of its last move; 1.0 is its current position.

        While a film or a window shows a turn, `data["_alpha"]` is this share.

        Raises:
            UnknownName (KeyError): there is no such agent.
        """
        if type(share) is not float:
            share = as_float(share, "share")
        return self.motion.find_position(agent_name, share)

    def is_shown(self, agent: IAgent, share: float = 1.0) -> bool:
        """Return whether an agent is drawn after a share of its last move; an eliminated one is until it arrives."""
        return getattr(agent, "alive", True) or (
            as_float(share, "share") < 1.0 and agent.name in self.events.list_eliminated()
        )

    def hidden_agents(self, share: float = 1.0) -> set[str]:
        """Return the names of the agents that are not drawn, after a share of their last moves."""
        positions = self._ctx.agent.positions
        out = {positions.names[row] for row in positions.inactive}
        return out - self.events.list_eliminated() if out and as_float(share, "share") < 1.0 else out

    def color_of(self, team: object) -> Rgb:
        """Return the color of a team, or of an agent without a team by its name: declared, or that of the theme.

        Agents, legends and captions have the same color. A team without agents has the next free color.
        """
        name = as_text(team)
        known = self.group_colors()
        return known[name] if name in known else self.group_colors([team])[name]

    def label_sides(self) -> dict[Side, str]:
        """Return the side of each agent -> its text in pictures, by which it has its color."""
        version = self._ctx.agent.structure_version
        key = version, self.labels
        if version is None or key != self._labeled[0]:
            positions = self._ctx.agent.positions
            self._labeled = key, label_sides(map(find_side, positions.names, positions.teams), self.labels)
        return self._labeled[1]

    def label_side(self, side: Side) -> str:
        """Return the text of a side in pictures."""
        return self.label_sides().get(side, side.text)

    def group_colors(self, more: Iterable[Any] = ()) -> dict[str, Rgb]:
        """Return text -> color for the sides of all agents and for further teams; constant during a game."""
        version = self._ctx.agent.structure_version
        key = version, self.team_colors, self.theme, self.sides, tuple(map(as_text, more))
        if version is None or key != self._colors[0]:
            self._colors = key, self._assign_colors(key[-1])
        return self._colors[1]

    def _assign_colors(self, more: Iterable[str]) -> dict[str, Rgb]:
        known = [*dict.fromkeys((*self.label_sides().values(), *more))]
        colors = assign_team_colors(sort_sides(self.sides, known), self.team_colors, self.theme.teams)
        return {side: colors[side] for side in known}

    def of_map(self, measure: Callable[[GraphColumns], Measured]) -> Measured:
        """Return the result of a function of the map, cached per map, because drawers need it in every frame."""
        columns = self._ctx.graph.columns()
        if self._measured[0] is not columns:
            self._measured = columns, {}
        known = self._measured[1]
        if measure not in known:
            known[measure] = measure(columns)
        found: Measured = known[measure]
        return found

    def map_version(self) -> tuple[int | None, int | None]:
        """Return a key that changes with the graph and the obstacles: two revisions, None where none is counted."""
        graph = self._ctx.graph
        return getattr(graph.graph, "revision", None), getattr(graph, "obstacle_revision", None)

    def render_discs(
        self,
        centers: Points,
        radius: float,
        color: AnyColor = Color.Black,
        edge: AnyColor = Color.White,
        *,
        at_least_px: float = 0.0,
    ) -> None:
        """Fill many equal discs with a thin edge; `radius` in world units, but never less than some pixels."""
        if self.commands is not None:
            self.render_all_discs(centers, [Disc(radius, at_least_px, color, edge)], np.zeros(len(centers), np.int64))

    def render_all_discs(
        self, centers: Points, discs: "Sequence[Disc]", looks: IntArray, shifts: FloatArray | None = None
    ) -> None:
        """Draw discs of several looks, each above the previous ones; see `Commands.add_discs`."""
        if self.commands is not None:
            self.commands.add_discs(centers, discs, looks, shifts)


def get_drawing(ctx: IContext) -> Drawing:
    """Return the drawing object for the built-in drawers of a context, with bulk primitives."""
    return cast("Drawing", ctx.visual.drawing)  # type: ignore[attr-defined] # of our own engines


def image_path(image: object) -> str:
    """Check the path of an image file.

    Raises:
        BadType, BadValue: the path is invalid, or the file does not exist.
    """
    if not isinstance(image, str | os.PathLike):
        raise BadType(f"An image is given by the path of its file here, not by {shown(image)}.")
    if not os.path.isfile(image):  # noqa: PTH113 - pathlib is not loaded for a game without pictures
        raise BadValue(f"There is no image file {str(image)!r}.")
    return str(image)
