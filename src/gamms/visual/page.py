"""Page layout: its size, the position of the map, and the parts around the map.

From top to bottom: the title; the map, with the legend to its right; the turn and its captions; a line with the scale
bar, the north arrow and the note.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil, floor, log10
from typing import Unpack

import numpy as np

from gamms.arguments import as_bool, as_text, refuse_keywords
from gamms.arguments import as_choice as one_of
from gamms.ir.draw import DrawCommands
from gamms.ir.graph import FloatArray
from gamms.typing import IArtist, IContext
from gamms.typing.visualization_engine import PictureOptions
from gamms.visual.appearance import PAPER, Rgb, Rgba, choose_inks, parse_color
from gamms.visual.camera import NO_MARGINS, Box, Camera, Margins, Point, Viewpoint, fit_box
from gamms.visual.captions import LINE_PX, CaptionBar, ResultCard, draw_caption_bar, draw_card
from gamms.visual.drawers.streets import is_in_metres
from gamms.visual.drawing import join_drawings
from gamms.visual.font import measure_words, shorten_text
from gamms.visual.labels import AUTO, Choice, Labels, as_choice, draw_names
from gamms.visual.layout import Layout
from gamms.visual.legend import Block, Legend, Pen
from gamms.visual.shown_turn import as_turns
from gamms.visual.themes import THEMES, Theme, find_theme

_FITS = "page", "tight"
_AREA = 560_000.0  # square pixels of the map on a page of no given size
_SLIMMEST = 0.45  # the shorter side of such a map, as a share of the longer one, at least
_ENDLESS = 1_000_000  # pixels
# around the map: at most, and as a share of the longer side of the page
_MARGIN_PX = 16.0
_MARGIN = 0.04
_HEADER_PX = 44.0
_TITLE_PX = 28.0
# of the line at the bottom
_ROW_PX = 20.0
_NOTE_PX = 16.0
_EDGE_PX = 8.0
_GAP_PX = 6.0
# of a scale bar: at most; its words; a page with one
_BAR_PX = 120.0
_BAR = 0.25
_LABEL_PX = 60.0
_LEAST_PX = 200.0
_NORTH_PX = 32.0
_LEAST_HEIGHTS_PX = 120.0, 280.0  # of pages that have room for one caption, and for two
_GROUND = 230  # alpha of the background of texts on the map


@dataclass(frozen=True)
class PageStyle:
    """The texts of a page, and the parts around the map; see `PictureOptions`."""

    title: str = ""
    note: str = ""
    background: Rgba = (*PAPER, 255)
    is_tight: bool = False
    unit: str | None = None  # of the scale bar; None: no scale bar
    north: bool = False
    theme: Theme = THEMES["light"]
    labels: Choice = AUTO
    trails: int = 0
    sensors: bool = True
    has_captions: bool = False
    street_names: bool = True
    has_legend: bool = True


def make_style(ctx: IContext, **options: Unpack[PictureOptions]) -> PageStyle:
    """Check the options of a picture; the source of the map is added to the note unless the note names it already.

    Raises:
        BadType, BadValue: an unknown keyword, a value of the wrong type, an unknown `fit`, or no color.
    """
    refuse_keywords(options, ("width", "height", "dpi", *PictureOptions.__annotations__), "A picture")
    fit = one_of(options.get("fit", _FITS[0]), "fit", _FITS)
    scale_bar = options.get("scale_bar")
    columns = ctx.graph.columns()
    theme = find_theme(options.get("theme", "light"))
    has_bar = is_in_metres(columns) if scale_bar is None else as_bool(scale_bar, "scale_bar")
    unit = " m" if columns.crs else ""
    return PageStyle(
        title=as_text(options.get("title", ""), "title"),
        note=add_source(ctx, options.get("note", "")),
        background=parse_color(options.get("background") or theme.background),
        is_tight=fit == _FITS[1],
        unit=unit if has_bar else None,
        north=as_bool(options.get("north", False), "north"),
        theme=theme,
        labels=as_choice(ctx, options.get("labels", AUTO)),
        trails=as_turns(options.get("trails", 0)),
        sensors=as_bool(options.get("sensors", True), "sensors"),
        has_captions=as_bool(options.get("captions", False), "captions"),
        street_names=as_bool(options.get("street_names", True), "street_names"),
        has_legend=as_bool(options.get("legend", True), "legend"),
    )


def add_source(ctx: IContext, note: str) -> str:
    """Return the note, and the source of the map unless the note already names it."""
    note = as_text(note, "note")
    attribution: str | None = getattr(ctx.graph, "attribution", None)
    if attribution and attribution not in note:
        return f"{note} · {attribution}" if note else attribution
    return note


class Page:
    """A page of a size.

    Args:
        width: pixels.
        height: pixels.
        blocks: the blocks of the legend.
        style: the texts, and the parts around the map.
        fine: the number of pixels per 1/96 inch, the unit of the parts around the map.
        spill: how far signs on the map reach beyond it, in 96ths of an inch.

    Attributes:
        legend: the legend; empty if it does not fit.
        has_captions: whether there is room for what happens.
    """

    def __init__(
        self,
        width: int,
        height: int,
        blocks: tuple[Block, ...],
        style: PageStyle,
        fine: float = 1.0,
        spill: Margins = NO_MARGINS,
    ) -> None:
        self._fine = fine
        self._size = (width / fine, height / fine)
        self._margin = min(_MARGIN_PX, _MARGIN * max(self._size))
        room = self._size[0] - 2 * self._margin
        title = shorten_text(style.title, _TITLE_PX, room, is_title=True)
        note = shorten_text(style.note, _NOTE_PX, room, is_title=True)
        self._style = replace(style, title=title, note=note)
        self._bar_px = min(_BAR_PX, _BAR * self._size[0])
        self._feet = self._measure_feet_px()
        self._foot = 2.0 if not any(self._feet) else _ROW_PX * self._rows
        foot = self._margin if not any(self._feet) else _ROW_PX * self._rows + _GAP_PX
        self._lines = sum(self._size[1] >= least for least in _LEAST_HEIGHTS_PX) if style.has_captions else 0
        self.has_captions = self._lines > 0
        foot = foot + LINE_PX * self._lines
        self._foot = self._foot + LINE_PX * self._lines
        header = _HEADER_PX if style.title else self._margin
        self.legend = Legend(blocks if style.has_legend else (), self._size[0], self._size[1] - header - foot)
        aside = self._margin + (self.legend.width + self._margin if self.legend.width else 0.0)
        self._margins = self._margin, header, aside, foot
        self.spill = spill

    def fit(self, low: FloatArray, high: FloatArray) -> tuple[Camera, Point]:
        """Return a camera that sees all from corner to corner, and the pixel of the map's upper right corner."""
        left, top, right, bottom = (margin * self._fine for margin in self._compute_margins())
        width, height = (round(side * self._fine) for side in self._size)
        camera = fit_box(low, high, width, height, (left, top, right, bottom))
        x, y = camera.to_screen(high[None])[0].tolist()
        return camera, (x, y)

    def find_camera(self, viewpoint: Viewpoint, share: float = 1.0) -> Camera | None:
        """Return the camera of a view that the user has chosen, beside the legend; None: there is no such view.

        Args:
            viewpoint: the view.
            share: the share of the moves of a followed agent.
        """
        width, height = (round(side * self._fine) for side in self._size)
        camera = viewpoint.make_camera(width - round(self._column_px * self._fine), height, share)
        return None if camera is None else camera._replace(width=width)

    @property
    def _column_px(self) -> float:
        """The width of the column of the legend on a page that the map fills otherwise."""
        return self.legend.width + 2 * self._margin if self.legend.width else 0.0

    def _compute_margins(self) -> Margins:
        """Return the margins around the map, for the parts there and for signs that reach beyond the map."""
        left, top, right, bottom = (
            margin + max(reach - _GAP_PX, 0.0) for margin, reach in zip(self._margins, self.spill, strict=True)
        )
        return left, top, right, bottom

    def find_tight_size(self, low: FloatArray, high: FloatArray) -> tuple[int, int]:
        """Return how large a page is that the map, at the scale of this one, fills; at most as large as this one."""
        across, up = ((high - low) * self.fit(low, high)[0].scale / self._fine).tolist()
        width, height = (
            min(side, most) for side, most in zip(self.find_size_around(across, up), self._size, strict=True)
        )
        return max(ceil(width * self._fine), 1), max(ceil(height * self._fine), 1)

    def find_size_around(self, across: float, up: float) -> tuple[float, float]:
        """Return how large a page is around a map of a size, both in 96ths of an inch."""
        left, top, right, bottom = self._compute_margins()
        title = measure_words(self._style.title, _TITLE_PX) + 2 * self._margin if self._style.title else 0.0
        foot = (max if self._rows > 1 else sum)(self._feet) + 2 * _EDGE_PX
        width, height = self.legend.least
        return max(across + left + right, foot, title, width), max(up, height) + top + bottom

    def make_pen(self, camera: Camera) -> Pen:
        """Return a pen for this page."""
        return Pen(camera, self._fine, choose_inks(self._style.background)[0])

    # -- parts around the map --------------------------------------------------------------------------

    def make_commands(self, camera: Camera, corner: Point | None = None) -> DrawCommands:
        """Return it as the camera has to see it; sizes in pixels are not `fine` yet.

        Args:
            camera: of the map.
            corner: the upper right corner of the map, beside which the legend stands; None: that of the page.
        """
        style = self._style
        _, faint = choose_inks(self._style.background)
        pen = self.make_pen(camera)
        if style.title:
            pen.draw_text(style.title, self._margin, 0.6 * _HEADER_PX, _TITLE_PX)
        left, top = self._place_legend(corner)
        is_beside = corner is None or left > corner[0] / self._fine
        if corner is None and self.legend.width:
            width, height = self._size
            pen.draw_rectangle(width - self._column_px, 0.0, self._column_px, height, style.background[:3])
        self.legend.draw(pen, left, top, None if is_beside else (*style.background[:3], _GROUND))
        self._draw_foot(pen, faint, camera.scale / self._fine)
        return pen.commands.freeze()

    def _place_legend(self, corner: Point | None) -> Point:
        """Return the upper left corner of the legend; it stays on the page where it grows after the map is placed."""
        _, top, _, bottom = self._margins
        width, height = self._size
        right = width - self._margin
        legend = np.array([self.legend.width, self.legend.height])
        at = (right, top) if corner is None else (corner[0] / self._fine + self._margin, corner[1] / self._fine)
        inside = Layout((self._margin, top, right, height - bottom))
        left, top = inside.move_inside(np.append(at, at + legend)[None])[0, :2].tolist()
        return left, top

    def draw_parts(
        self,
        camera: Camera,
        corner: Point | None,
        ctx: IContext,
        artists: Mapping[str, IArtist],
        labels: Labels,
        bar: CaptionBar,
    ) -> DrawCommands:
        """Return the names on the map, the parts around it, and the captions if there is room for them.

        Args:
            camera: of the map.
            corner: see `make_commands`.
            ctx: the context.
            artists: that have drawn the map.
            labels: place the names of agents.
            bar: the captions.
        """
        around = join_drawings(
            self._draw_names(camera, corner, ctx, artists, labels), self.make_commands(camera, corner)
        )
        return join_drawings(around, self._draw_captions(camera, bar, corner)) if self.has_captions else around

    def _draw_names(
        self, camera: Camera, corner: Point | None, ctx: IContext, artists: Mapping[str, IArtist], labels: Labels
    ) -> DrawCommands:
        """Return the names of streets, and the labels beside agents, for the position of the map on this page."""
        style = self._style
        layout = self._lay_out(corner)
        pen = self.make_pen(camera)
        draw_names(pen, self._fine, ctx, artists, labels, layout, choice=style.labels, has_streets=style.street_names)
        return pen.commands.freeze()

    def _lay_out(self, corner: Point | None) -> Layout:
        """Return where words may be, beside the legend."""
        width, height = self._size
        layout = Layout((2.0, _HEADER_PX if self._style.title else 2.0, width - 2.0, height - self._foot))
        if self.legend.width and corner is None:
            layout.cover((width - self._column_px, 0.0, width, height))
        elif self.legend.width:
            left, top = self._place_legend(corner)
            right = left + self.legend.width
            bottom = top + self.legend.height
            layout.cover((left - self._margin, top - self._margin, right, bottom + self._margin))
        return layout

    def _draw_captions(self, camera: Camera, bar: CaptionBar, corner: Point | None) -> DrawCommands:
        """Return the captions of the turn, below the map, or on the map if the page has no free corner."""
        width, height = self._size
        (left, *_, foot) = self._margins
        lines = self._lines
        pen = self.make_pen(camera)
        top = height - foot + _GAP_PX
        if corner is None:
            pen.draw_rectangle(0.0, top, width, lines * LINE_PX, (*self._style.background[:3], _GROUND))
        scores = not self.legend.width
        _, faint = choose_inks(self._style.background)
        draw_caption_bar(pen, bar, (left, top, width - 2 * left), lines, faint, scores=scores)
        return pen.commands.freeze()

    def draw_card(self, camera: Camera, card: ResultCard) -> DrawCommands:
        """Return how the game ended, on a card upon the map."""
        pen = self.make_pen(camera)
        (left, top, right, bottom) = self._margins
        width, height = self._size
        center = (left + width - right) / 2, top + 0.4 * (height - top - bottom)
        draw_card(pen, card, center, self._style.background[:3], choose_inks(self._style.background)[1])
        return pen.commands.freeze()

    @property
    def _rows(self) -> int:
        """Return the number of lines below the map."""
        is_much = sum(self._feet) + 3 * _EDGE_PX > self._size[0]
        return 2 if all(self._feet) and is_much else int(any(self._feet))

    def _measure_feet_px(self) -> tuple[float, float]:
        """Return how broad the bar and north are, and the note."""
        style = self._style
        bar = self._bar_px + _LABEL_PX if style.unit is not None and self._size[0] >= _LEAST_PX else 0.0
        note = measure_words(style.note, _NOTE_PX)
        return bar + _NORTH_PX * style.north, note + 2 * _EDGE_PX if note else 0.0

    def _draw_foot(self, pen: Pen, ink: Rgb, scale: float) -> None:
        """Draw the scale bar and north at the left, the note at the right, or below where they are too broad."""
        width, height = self._size
        mark_px, note_px = self._feet
        ground = (*self._style.background[:3], _GROUND)
        middle = height - 0.5 * _ROW_PX
        x = self._margin
        if note_px:
            left = width - max(self._margin - _EDGE_PX, 0.0) - note_px
            pen.draw_rectangle(left, middle - 0.4 * _ROW_PX, note_px, 0.8 * _ROW_PX, ground)
            pen.draw_text(self._style.note, left + _EDGE_PX, middle, _NOTE_PX, ink)
        if not mark_px:
            return
        middle -= _ROW_PX * (self._rows - 1)
        pen.draw_rectangle(x - _EDGE_PX, middle - 0.4 * _ROW_PX, mark_px + _EDGE_PX, 0.8 * _ROW_PX, ground)
        if mark_px > _NORTH_PX:
            length = find_round_length(self._bar_px / scale)
            end = x + length * scale
            low = middle + 4.0
            pen.draw_line([(x, low - 5.0), (x, low), (end, low), (end, low - 5.0)], ink, 1.5)
            words = f"{length / 1000:g} km" if self._style.unit and length >= 1000 else f"{length:g}{self._style.unit}"
            pen.draw_text(words, end + 6.0, middle, _NOTE_PX, ink)
            x = end + 6.0 + measure_words(words, _NOTE_PX) + 16.0
        if self._style.north:
            pen.draw_polygon(
                [(x, middle + 5.0), (x + 4.0, middle - 7.0), (x + 8.0, middle + 5.0), (x + 4.0, middle + 2.0)], ink
            )
            pen.draw_text("N", x + 12.0, middle, _NOTE_PX, ink)


def find_round_length(longest: float) -> float:
    """Return the longest of 1, 2, 5, 10, 20, 50 … and of their tenths that is not longer than this."""
    ten = 10.0 ** floor(log10(longest))
    return max(ten * step for step in (1, 2, 5) if ten * step <= longest * (1 + 1e-9))


def compute_page_size(
    box: Box,
    asked: tuple[int | None, int | None],
    blocks: tuple[Block, ...],
    style: PageStyle,
    fine: float = 1.0,
    spill: Margins = NO_MARGINS,
) -> tuple[int, int]:
    """Return the width and height of a page, pixels; a length that is not given follows from the map.

    Args:
        box: the lower left and upper right corners of the map, world units.
        asked: the requested width and height; None: as the map needs. If the style is tight, they are maximum values.
        blocks: of the legend.
        style: the style of the page.
        fine: how many pixels are a 96th of an inch.
        spill: how far signs on the map reach beyond it, in 96ths of an inch.
    """
    width, height = asked
    if width is not None and height is not None and not style.is_tight:
        return width, height
    low, high = box
    if width is None and height is None:
        across, up = np.maximum(high - low, 1e-9).tolist()
        ratio = min(max(across / up, _SLIMMEST), 1 / _SLIMMEST)
        page = Page(_ENDLESS, _ENDLESS, blocks, style, spill=spill)
        free = page.find_size_around((_AREA * ratio) ** 0.5, (_AREA / ratio) ** 0.5)
        width, height = (round(side * fine) for side in free)
    width = width or round((height or 0) / _SLIMMEST)
    height = height or round(width / _SLIMMEST)
    tight = Page(width, height, blocks, style, fine, spill).find_tight_size(low, high)
    if style.is_tight:
        return tight
    return asked[0] or tight[0], asked[1] or tight[1]
