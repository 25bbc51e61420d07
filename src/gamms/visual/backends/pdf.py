"""PDF: vectors and selectable text, with ReportLab, which no other file imports.

Equal commands give equal bytes: the file contains no date.
"""

import io
import re
from typing import TYPE_CHECKING, Any

from gamms.errors import BadValue
from gamms.ir.draw import DrawCommands, DrawKind
from gamms.plugins import needing
from gamms.visual.appearance import Rgba
from gamms.visual.backends.pillow_backend import image_size
from gamms.visual.backends.vectors import SMALLEST_RADIUS_PX, VectorCommands, sheet_of
from gamms.visual.camera import CSS_DPI, Camera
from gamms.visual.font import ASCENT, FONT, warn_of_boxes

if TYPE_CHECKING:
    from reportlab.pdfgen.canvas import Canvas

_INCH = 72.0  # points
# round line caps and joins; fill by the even-odd rule
_ROUND = 1
_EVEN_ODD = 0
# how words are painted
_FILL = 0
_STROKE = 1
_HALO_PX = 3.0
_FAMILY = "Arimo"
_UNWRITABLE = re.compile("[\x00-\x1f\x7f\ud800-\udfff\U00010000-\U0010ffff]")


def pdf(commands: DrawCommands, camera: Camera, *, title: str, background: Rgba, dpi: float = CSS_DPI) -> bytes:
    """Return the picture as a one-page PDF file, with the paper size given by `dpi`.

    Raises:
        MissingExtra: ReportLab is not installed.
        BadValue: an image cannot be read.
    """
    with needing("Writing a PDF file", "viz"):
        from reportlab.pdfbase import pdfmetrics, ttfonts
        from reportlab.pdfgen.canvas import Canvas
    pdfmetrics.registerFont(ttfonts.TTFont(_FAMILY, str(FONT)))
    data = io.BytesIO()
    unit = _INCH / dpi
    paper = camera.width * unit, camera.height * unit
    page = Canvas(data, paper, initialFontName=_FAMILY, invariant=True, pageCompression=1)
    page.setTitle(title or "GAMMS")
    page.setCreator("GAMMS")
    page.setAuthor("")
    page.setSubject("")
    page.scale(unit, unit)
    _Painter(page, sheet_of(commands, camera, background), camera).paint(background)
    page.save()
    return data.getvalue()


class _Painter:
    """Paints on a PDF page, with y up; all units are pixels."""

    def __init__(self, page: "Canvas", sheet: VectorCommands, camera: Camera) -> None:
        self._page = page
        self._sheet = sheet
        self._width = camera.width
        self._height = camera.height
        self._alpha = 1.0, 1.0

    def paint(self, background: Rgba) -> None:
        """Paint everything from back to front."""
        page = self._page
        sheet = self._sheet
        page.setLineCap(_ROUND)
        page.setLineJoin(_ROUND)
        self._ink(background)
        page.rect(0, 0, self._width, self._height, stroke=0, fill=1)
        singly = {DrawKind.TEXT: self._text, DrawKind.IMAGE: self._image}
        for begin, end in sheet.runs():
            kind = DrawKind(int(sheet.kind[begin]))
            color = sheet.color[begin].tolist()
            self._ink(color)
            page.setLineWidth(int(sheet.width[begin]) / 10)
            if kind is DrawKind.LINE:
                self._lines(range(begin, end))
                continue
            for row in range(begin, end):
                paint = singly.get(kind)
                self._shape(kind, row) if paint is None else paint(row)

    def _ink(self, color: Rgba) -> None:
        red, green, blue, alpha = (part / 255 for part in color)
        self._page.setFillColorRGB(red, green, blue)
        self._page.setStrokeColorRGB(red, green, blue)
        if self._alpha != (alpha, alpha):
            self._alpha = alpha, alpha
            self._page.setFillAlpha(alpha)
            self._page.setStrokeAlpha(alpha)

    def _points(self, row: int) -> list[tuple[float, float]]:
        return [(x / 10, self._height - y / 10) for x, y in self._sheet.points_of(row)]

    def _lines(self, rows: range) -> None:
        """Draw lines as one path, so that transparent lines are blended once where they cross."""
        path: Any = self._page.beginPath()
        for row in rows:
            points = self._points(row)
            kept = [point for point, before in zip(points, [None, *points], strict=False) if point != before]
            if len(kept) > 1:  # otherwise the line shrank to a point
                path.moveTo(*kept[0])
                for point in kept[1:]:
                    path.lineTo(*point)
        self._page.drawPath(path, stroke=1, fill=0)

    def _shape(self, kind: DrawKind, row: int) -> None:
        """Fill or outline a circle, a polygon or a rectangle."""
        path: Any = self._page.beginPath()
        points = self._points(row)
        if kind is DrawKind.CIRCLE:
            radius = int(self._sheet.size[row]) / 10
            if radius < SMALLEST_RADIUS_PX:
                return
            path.circle(*points[0], radius)
        elif kind is DrawKind.RECTANGLE:
            _, (width, height) = self._sheet.points_of(row)
            (x, y), _ = points
            path.rect(x, y - height / 10, width / 10, height / 10)
        else:
            path.moveTo(*points[0])
            for point in points[1:]:
                path.lineTo(*point)
            path.close()
        is_outline = bool(self._sheet.width[row] > 0)
        self._page.drawPath(path, stroke=int(is_outline), fill=int(not is_outline), fillMode=_EVEN_ODD)

    def _text(self, row: int) -> None:
        size = int(self._sheet.size[row]) / 10
        ((x, y),) = self._points(row)
        words = _UNWRITABLE.sub("\ufffd", self._sheet.text[row])
        if not words or size == 0.0:
            return
        warn_of_boxes(words)
        for mode in (_STROKE, _FILL) if self._sheet.has_halo(row) else (_FILL,):
            self._page.saveState()
            if mode == _STROKE:
                self._page.setLineWidth(_HALO_PX)
                self._page.setStrokeColorRGB(*(part / 255 for part in self._sheet.paper))
            angle = float(self._sheet.angle[row])
            begin = (x, y)
            if angle:
                self._page.translate(x, y)
                self._page.rotate(angle)
                begin = 0.0, 0.0
            text: Any = self._page.beginText(begin[0], begin[1] - ASCENT * size)
            text.setFont(_FAMILY, size)
            text.setTextRenderMode(mode)
            text.textOut(words)
            self._page.drawText(text)
            self._page.restoreState()

    def _image(self, row: int) -> None:
        path = self._sheet.text[row]
        half = int(self._sheet.size[row]) / 10
        ((x, y),) = self._points(row)
        try:
            width, height = image_size(path)
        except OSError as error:
            raise BadValue(f"Cannot put {path!r} into a PDF: {error}") from None
        ratio = 2 * half / max(width, height)
        self._page.saveState()
        self._page.translate(x, y)
        self._page.rotate(float(self._sheet.angle[row]))
        sides = width * ratio, height * ratio
        self._page.drawImage(path, -sides[0] / 2, -sides[1] / 2, *sides, mask="auto")
        self._page.restoreState()
