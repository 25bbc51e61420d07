"""PDF: vectors and selectable text, with ReportLab, which no other file imports.

Equal commands give equal bytes: the file contains no date.
"""

import io
import re
from typing import TYPE_CHECKING, Any

from gamms.errors import BadValue
from gamms.ir.draw import DrawCommands
from gamms.plugins import require_extra
from gamms.visual.appearance import Rgb, Rgba
from gamms.visual.backends.pillow_backend import read_image_size
from gamms.visual.backends.vectors import Point, write_vectors
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


def write_pdf(commands: DrawCommands, camera: Camera, *, title: str, background: Rgba, dpi: float = CSS_DPI) -> bytes:
    """Return the picture as a one-page PDF file, with the paper size given by `dpi`.

    Raises:
        MissingExtra: ReportLab is not installed.
        BadValue: an image cannot be read.
    """
    with require_extra("Writing a PDF file", "viz"):
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
    write_vectors(commands, camera, background, _PdfWriter(page, camera, background))
    page.save()
    return data.getvalue()


class _PdfWriter:
    """Writes on a PDF page, with y up; its units are pixels."""

    def __init__(self, page: "Canvas", camera: Camera, background: Rgba) -> None:
        self._page = page
        self._height = camera.height
        self._alpha = 1.0
        self._paint = dict[str, int]()  # the arguments of drawPath
        page.setLineCap(_ROUND)
        page.setLineJoin(_ROUND)
        self._set_ink(background)
        page.rect(0, 0, camera.width, camera.height, stroke=0, fill=1)

    def begin(self, color: Rgba, width: int, *, is_outline: bool) -> None:
        self._paint = {"stroke": int(is_outline), "fill": int(not is_outline), "fillMode": _EVEN_ODD}
        self._set_ink(color)
        self._page.setLineWidth(width / 10)

    def end(self) -> None:
        pass

    def write_lines(self, lines: list[list[Point]]) -> None:
        """Draw lines as one path, so that transparent lines are blended once where they cross."""
        self._page.drawPath(self._make_path(lines), **self._paint)

    def write_circle(self, middle: Point, radius: int) -> None:
        path: Any = self._page.beginPath()
        path.circle(*self._convert_point(middle), radius / 10)
        self._page.drawPath(path, **self._paint)

    def write_rectangle(self, corner: Point, width: int, height: int) -> None:
        path: Any = self._page.beginPath()
        x, y = self._convert_point(corner)
        path.rect(x, y - height / 10, width / 10, height / 10)
        self._page.drawPath(path, **self._paint)

    def write_polygon(self, corners: list[Point]) -> None:
        path = self._make_path([corners])
        path.close()
        self._page.drawPath(path, **self._paint)

    def _set_ink(self, color: Rgba) -> None:
        red, green, blue, alpha = (part / 255 for part in color)
        self._page.setFillColorRGB(red, green, blue)
        self._page.setStrokeColorRGB(red, green, blue)
        if self._alpha != alpha:
            self._alpha = alpha
            self._page.setFillAlpha(alpha)
            self._page.setStrokeAlpha(alpha)

    def _convert_point(self, point: Point) -> tuple[float, float]:
        x, y = point
        return x / 10, self._height - y / 10

    def _make_path(self, lines: list[list[Point]]) -> Any:
        path: Any = self._page.beginPath()
        for line in lines:
            path.moveTo(*self._convert_point(line[0]))
            for point in line[1:]:
                path.lineTo(*self._convert_point(point))
        return path

    def write_text(self, words: str, corner: Point, size: int, angle: float, halo: Rgb | None) -> None:
        words = _UNWRITABLE.sub("\ufffd", words)
        if not words or not size:
            return
        warn_of_boxes(words)
        x, y = self._convert_point(corner)
        for mode in (_FILL,) if halo is None else (_STROKE, _FILL):
            self._page.saveState()
            if halo is not None and mode == _STROKE:
                self._page.setLineWidth(_HALO_PX)
                self._page.setStrokeColorRGB(*(part / 255 for part in halo))
            begin = (x, y)
            if angle:
                self._page.translate(x, y)
                self._page.rotate(angle)
                begin = 0.0, 0.0
            text: Any = self._page.beginText(begin[0], begin[1] - ASCENT * (size / 10))
            text.setFont(_FAMILY, size / 10)
            text.setTextRenderMode(mode)
            text.textOut(words)
            self._page.drawText(text)
            self._page.restoreState()

    def write_image(self, path: str, middle: Point, half: int, angle: float) -> None:
        try:
            width, height = read_image_size(path)
        except OSError as error:
            raise BadValue(f"Cannot put {path!r} into a PDF: {error}") from None
        ratio = 2 * (half / 10) / max(width, height)
        self._page.saveState()
        self._page.translate(*self._convert_point(middle))
        self._page.rotate(angle)
        sides = width * ratio, height * ratio
        self._page.drawImage(path, -sides[0] / 2, -sides[1] / 2, *sides, mask="auto")
        self._page.restoreState()
