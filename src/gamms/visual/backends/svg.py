"""SVG: commands of one style that follow each other become one element, so that a city stays a small file.

The same commands give the same bytes.
"""

import re
from base64 import b64encode
from collections.abc import Callable
from html import escape
from pathlib import Path

import numpy as np

from gamms.errors import BadValue
from gamms.ir.draw import DrawCommands, DrawKind
from gamms.ir.graph import IntArray
from gamms.visual.appearance import Rgba
from gamms.visual.backends.vectors import SMALLEST_RADIUS_PX, Sheet, sheet_of
from gamms.visual.camera import CSS_DPI, Camera
from gamms.visual.lettering import ASCENT, FAMILIES

_HALO = ' stroke="#{:02x}{:02x}{:02x}" stroke-width="3" paint-order="stroke"'
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_IMAGE_TYPES = {
    ".png": "png",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".gif": "gif",
    ".webp": "webp",
    ".svg": "svg+xml",
}


def svg(commands: DrawCommands, camera: Camera, *, title: str, background: Rgba, dpi: float = CSS_DPI) -> bytes:
    """Return the whole picture as an SVG file, as large on paper as `dpi` says."""
    sheet = sheet_of(commands, camera, background)
    lines = [
        _opening(camera, dpi),
        f"<title>{_escaped(title or 'GAMMS')}</title>",
        f'<rect width="100%" height="100%"{_paint("fill", background)}/>',
        '<g stroke-linecap="round" stroke-linejoin="round">',
        *(_group(sheet, begin, end) for begin, end in sheet.runs()),
        "</g>",
        "</svg>\n",
    ]
    return "\n".join(line for line in lines if line).encode()


def _opening(camera: Camera, dpi: float) -> str:
    width, height = camera.width, camera.height
    sides = (f"{side}" if dpi == CSS_DPI else f"{side / dpi:.6g}in" for side in (width, height))
    physical = 'width="{}" height="{}"'.format(*sides)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {physical} '
        f'viewBox="0 0 {width} {height}" role="img" font-family="{FAMILIES}">'
    )


def _group(sheet: Sheet, begin: int, end: int) -> str:
    """Return the elements of one run; empty where nothing of it is large enough to be seen."""
    kind = DrawKind(int(sheet.kind[begin]))
    if kind is DrawKind.LINE:
        path = _lines(sheet, begin, end)
        return f'<path{_style(sheet, begin, kind)} d="{path}"/>' if path else ""
    body = "".join(_ELEMENTS[kind](sheet, row) for row in range(begin, end))
    return f"<g{_style(sheet, begin, kind)}>{body}</g>" if body else ""


def _style(sheet: Sheet, row: int, kind: DrawKind) -> str:
    red, green, blue, alpha = sheet.color[row].tolist()
    width = int(sheet.width[row])
    if kind is DrawKind.LINE or width > 0:
        return f' fill="none"{_paint("stroke", (red, green, blue, alpha))} stroke-width="{_number(width)}"'
    return _paint("fill", (red, green, blue, alpha))


def _paint(role: str, color: Rgba) -> str:
    red, green, blue, alpha = color
    opacity = "" if alpha == 255 else f' {role}-opacity="{alpha / 255:.3g}"'
    return f' {role}="#{red:02x}{green:02x}{blue:02x}"{opacity}'


def _lines(sheet: Sheet, begin: int, end: int) -> str:
    """Return one path through all lines of a run: where each starts, then steps; repeated points are left out."""
    offsets = sheet.offsets[begin : end + 1] - sheet.offsets[begin]
    points = sheet.points[sheet.offsets[begin] : sheet.offsets[end]]
    line = np.repeat(np.arange(end - begin), np.diff(offsets))
    steps = np.diff(points, axis=0, prepend=points[:1])
    is_first = np.zeros(len(points), bool)
    is_first[offsets[:-1]] = True
    is_kept = is_first | (steps != 0).any(axis=1)
    # A line that shrank to a point is left out altogether.
    is_kept &= np.bincount(line[is_kept], minlength=end - begin)[line] > 1
    numbers = np.where(is_first[:, None], points, steps)[is_kept]
    letters = np.where(is_first[is_kept], "M", "l").tolist()
    xs, ys = _numbers(numbers[:, 0]), _numbers(numbers[:, 1])
    return "".join(
        f"{letter}{x}{y}" if y[0] == "-" else f"{letter}{x} {y}" for letter, x, y in zip(letters, xs, ys, strict=True)
    )


def _numbers(tenths: IntArray) -> list[str]:
    values, inverse = np.unique(tenths, return_inverse=True)
    texts: list[str] = np.array([_number(value) for value in values.tolist()], object)[inverse].tolist()
    return texts


def _number(tenths: int) -> str:
    """Return tenths of pixels as the shortest decimal number of pixels."""
    whole, tenth = divmod(abs(tenths), 10)
    sign = "-" if tenths < 0 else ""
    return f"{sign}{whole}.{tenth}" if tenth else f"{sign}{whole}"


# -- single elements ----------------------------------------------------------------------------------------


def _circle(sheet: Sheet, row: int) -> str:
    (x, y), radius = sheet.points_of(row)[0], int(sheet.size[row])
    if radius < 10 * SMALLEST_RADIUS_PX:
        return ""
    return f'<circle cx="{_number(x)}" cy="{_number(y)}" r="{_number(radius)}"/>'


def _rectangle(sheet: Sheet, row: int) -> str:
    (x, y), (width, height) = sheet.points_of(row)
    return f'<rect x="{_number(x)}" y="{_number(y)}" width="{_number(width)}" height="{_number(height)}"/>'


def _polygon(sheet: Sheet, row: int) -> str:
    corners = "L".join(f"{_number(x)} {_number(y)}" for x, y in sheet.points_of(row))
    return f'<path d="M{corners}Z"/>'


def _text(sheet: Sheet, row: int) -> str:
    ((x, y),), size = sheet.points_of(row), int(sheet.size[row])
    baseline = _number(y + round(ASCENT * size))
    place = f'x="{_number(x)}" y="{baseline}" font-size="{_number(size)}"{_halo(sheet, row)}'
    return f"<text {place}>{_escaped(sheet.text[row])}</text>"


def _halo(sheet: Sheet, row: int) -> str:
    return _HALO.format(*sheet.paper) if sheet.has_halo(row) else ""


def _image(sheet: Sheet, row: int) -> str:
    ((x, y),), half = sheet.points_of(row), int(sheet.size[row])
    turn = float(sheet.angle[row])
    turned = f' transform="rotate({-turn:.6g} {_number(x)} {_number(y)})"' if turn else ""
    side = _number(2 * half)
    return (
        f'<image x="{_number(x - half)}" y="{_number(y - half)}" width="{side}" height="{side}"{turned} '
        f'href="{_embedded(Path(sheet.text[row]))}"/>'
    )


def _embedded(path: Path) -> str:
    """Return the image itself, so that the picture is one file."""
    if path.suffix.lower() not in _IMAGE_TYPES:
        raise BadValue(f"Cannot put {path.name!r} into a picture; use one of {', '.join(_IMAGE_TYPES)}.")
    return f"data:image/{_IMAGE_TYPES[path.suffix.lower()]};base64,{b64encode(path.read_bytes()).decode()}"


def _escaped(text: str) -> str:
    return escape(_NO_XML.sub("\ufffd", text))


_ELEMENTS: dict[DrawKind, Callable[[Sheet, int], str]] = {
    DrawKind.CIRCLE: _circle,
    DrawKind.RECTANGLE: _rectangle,
    DrawKind.POLYGON: _polygon,
    DrawKind.TEXT: _text,
    DrawKind.IMAGE: _image,
}
