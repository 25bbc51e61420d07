"""From artists to a picture file: draw, point the camera, hand the columns to a backend, write."""

import os
from pathlib import Path
from typing import NamedTuple

from gamms.arguments import as_float, as_int, as_path, as_text
from gamms.errors import BadValue, MissingFolder, NotYet, UnknownName
from gamms.ir.draw import DrawCommands
from gamms.limits import refuse_above
from gamms.typing import ColorType, IContext
from gamms.visual.backends import FORMATS, Backend
from gamms.visual.camera import CSS_DPI, Camera, fit
from gamms.visual.color import rgba
from gamms.visual.commands import joined, magnified
from gamms.visual.legend import Block, Legend

_HEADER_PX = 44.0
_LONGEST_PX = 65_535  # as GIF counts them
_FINEST_DPI = 10_000.0
_PICTURE_BYTES = 20  # of memory per pixel, measured: the canvas, its copies and the file
FILM_BYTES = 48  # and what an encoder keeps


class Sheet(NamedTuple):
    """The size of a picture, and the backend that paints it."""

    width: int
    height: int
    dpi: float
    backend: Backend


def place(path: str | os.PathLike[str]) -> Path:
    """Check a path that is to be written to.

    Raises:
        MissingFolder: its folder does not exist.
    """
    path = as_path(path, "path")
    if not path.parent.is_dir():
        raise MissingFolder(path.name, path.parent)
    return path


def sheet(name: str | os.PathLike[str], width: int, height: int, dpi: float) -> Sheet:
    """Check everything that can be checked before drawing; the suffix of a name, or a mere suffix, is the format.

    Raises:
        BadValue: a size or dpi that is not positive, or too large.
        NotYet: a format that cannot be written.
    """
    path, (width, height) = as_path(name, "path"), size(width, height)
    if not 0.0 < (dpi := as_float(dpi, "dpi")) <= _FINEST_DPI:
        raise BadValue(f"A picture needs between 0 and {_FINEST_DPI:g} pixels per inch, not dpi={dpi:g}.")
    return Sheet(width, height, dpi, _backend(path))


def size(width: int, height: int, bytes_per_pixel: int = _PICTURE_BYTES) -> tuple[int, int]:
    """Check a width and height in pixels.

    Raises:
        BadValue: one is not positive, or too large.
        TooLarge (BadValue): it would take more memory than is allowed.
    """
    width, height = as_int(width, "The width of a picture"), as_int(height, "The height of a picture")
    if width <= 0 or height <= 0:
        raise BadValue(f"A picture needs a positive width and height, not {width} x {height}.")
    if max(width, height) > _LONGEST_PX:
        raise BadValue(f"A picture has at most {_LONGEST_PX} pixels at each side, not {width} x {height}.")
    refuse_above(bytes_per_pixel * width * height, f"A picture of {width} x {height} pixels")
    return width, height


def _backend(path: Path) -> Backend:
    try:
        return FORMATS[(path.suffix or path.name).lower()]
    except UnknownName:
        known = ", ".join(FORMATS)
        raise NotYet(f"saving a picture as {path.suffix or path.name!r} (there is: {known})") from None


def header_px(title: str) -> float:
    """How much room a title takes above a picture."""
    return _HEADER_PX if title else 0.0


def noted(ctx: IContext, note: str) -> str:
    """The note, and the source of the map unless the note already names it."""
    note = as_text(note, "note")
    attribution: str | None = getattr(ctx.graph, "attribution", None)
    if attribution and attribution not in note:
        return f"{note} · {attribution}" if note else attribution
    return note


def painted(
    sheet: Sheet,
    commands: DrawCommands,
    blocks: tuple[Block, ...],
    camera: Camera | None,
    *,
    title: str,
    note: str,
    background: ColorType,
) -> bytes:
    """Paint the columns and the legend, as the content of a file; no camera sees everything."""
    fine = sheet.dpi / CSS_DPI  # so that lines, letters and marks are as large on paper whatever the dpi
    legend, header = Legend(blocks, sheet.width, sheet.height, fine), fine * header_px(title)
    if camera is None:
        camera = fit(commands, sheet.width, sheet.height, header, legend.aside)
    commands = magnified(joined(commands, legend.commands(camera, header, rgba(background))), fine)
    words = {"title": as_text(title, "title"), "note": note, "background": rgba(background), "dpi": sheet.dpi}
    return sheet.backend(commands, camera, **words)
