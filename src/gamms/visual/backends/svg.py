"""SVG: consecutive commands of one style become one element, so that a city gives a small file.

Equal commands give equal bytes.
"""

import re
from base64 import b64encode
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

from gamms.errors import BadValue
from gamms.ir.draw import DrawCommands, DrawKind
from gamms.text import as_xml
from gamms.visual.appearance import Rgba
from gamms.visual.backends.vectors import SMALLEST_RADIUS_PX, VectorCommands, sheet_of
from gamms.visual.camera import CSS_DPI, Camera
from gamms.visual.font import ASCENT, FAMILIES

_HALO = ' stroke="#{:02x}{:02x}{:02x}" stroke-width="3" paint-order="stroke"'
_NEEDLESS = re.compile(r" (?=[-a-z])|(?<=[a-z]) |(?<!\d)(?<!\.)0(?=\.)")  # in a path
_Point = tuple[int, ...]  # x, y
_IMAGE_TYPES = {
    ".png": "png",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".gif": "gif",
    ".webp": "webp",
    ".svg": "svg+xml",
}


def svg(commands: DrawCommands, camera: Camera, *, title: str, background: Rgba, dpi: float = CSS_DPI) -> bytes:
    """Return the picture as an SVG file, with the paper size given by `dpi`."""
    sheet = sheet_of(commands, camera, background)
    lines = [
        _opening(camera, dpi),
        f"<title>{as_xml(title or 'GAMMS')}</title>",
        f'<rect width="100%" height="100%"{_paint("fill", background)}/>',
        '<g stroke-linecap="round" stroke-linejoin="round" fill-rule="evenodd">',
        *(_group(sheet, begin, end) for begin, end in sheet.runs()),
        "</g>",
        "</svg>\n",
    ]
    return "\n".join(line for line in lines if line).encode()


def _opening(camera: Camera, dpi: float) -> str:
    width = camera.width
    height = camera.height
    sides = (f"{side}" if dpi == CSS_DPI else f"{side / dpi:.6g}in" for side in (width, height))
    physical = 'width="{}" height="{}"'.format(*sides)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {physical} '
        f'viewBox="0 0 {width} {height}" role="img" font-family="{FAMILIES}">'
    )


def _group(sheet: VectorCommands, begin: int, end: int) -> str:
    """Return the elements of one run; empty if all are too small to be seen."""
    kind = DrawKind(int(sheet.kind[begin]))
    if kind is DrawKind.LINE:
        path = _lines(sheet, begin, end)
        return f'<path{_style(sheet, begin, kind)} d="{path}"/>' if path else ""
    body = "".join(_ELEMENTS[kind](sheet, row) for row in range(begin, end))
    return f"<g{_style(sheet, begin, kind)}>{body}</g>" if body else ""


def _style(sheet: VectorCommands, row: int, kind: DrawKind) -> str:
    red, green, blue, alpha = sheet.color[row].tolist()
    width = int(sheet.width[row])
    if kind is DrawKind.LINE or width > 0:
        return f' fill="none"{_paint("stroke", (red, green, blue, alpha))} stroke-width="{_number(width)}"'
    return _paint("fill", (red, green, blue, alpha))


def _paint(role: str, color: Rgba) -> str:
    red, green, blue, alpha = color
    opacity = "" if alpha == 255 else f' {role}-opacity="{alpha / 255:.3g}"'
    return f' {role}="#{red:02x}{green:02x}{blue:02x}"{opacity}'


def _lines(sheet: VectorCommands, begin: int, end: int) -> str:
    """Return one path through all lines of a run, in connected chains, without lines that shrank to a point."""
    offsets = (sheet.offsets[begin : end + 1] - sheet.offsets[begin]).tolist()
    points = list(map(tuple, sheet.points[sheet.offsets[begin] : sheet.offsets[end]].tolist()))
    lines = [points[first:last] for first, last in pairwise(offsets) if len(set(points[first:last])) > 1]
    steps = list[str]()
    x = 0
    y = 0
    for chain in _chains([(line[0], line[-1]) for line in lines]):
        steps.append("m")
        for row, is_reversed in chain:
            for to_x, to_y in reversed(lines[row]) if is_reversed else lines[row]:
                if to_x != x or to_y != y or steps[-1] == "m":
                    steps.append(_step(to_x - x, to_y - y))
                    x = to_x
                    y = to_y
    return _joined(steps)


def _chains(ends: Sequence[tuple[_Point, _Point]]) -> Iterator[list[tuple[int, bool]]]:
    """Yield lines as (row, whether it is reversed), in chains where each line begins at the end of the previous one."""
    at = defaultdict[_Point, list[int]](list)
    for row, (first, last) in enumerate(ends):
        at[first].append(row)
        at[last].append(row)
    is_left = [True] * len(ends)

    def onward(place: _Point) -> Iterator[tuple[int, bool]]:
        rows = at[place]
        while rows:
            row = rows.pop()
            if is_left[row]:
                is_left[row] = False
                first, last = ends[row]
                yield row, first != place
                rows = at[place := first if first != place else last]

    uneven = {place for place, rows in at.items() if len(rows) % 2}  # where chains must end
    for place in list(at):
        if place in uneven:
            chain = list(onward(place))
            row, is_reversed = chain[-1]
            uneven -= {place, ends[row][not is_reversed]}
            yield chain
    for place in list(at):
        while chain := list(onward(place)):
            yield chain


def _joined(steps: Iterable[str]) -> str:
    """Return the steps of a path without redundant spaces and zeros."""
    return _NEEDLESS.sub("", " ".join(steps))


@lru_cache(maxsize=1 << 16)
def _step(x: int, y: int) -> str:
    return f"{_number(x)} {_number(y)}"


def _number(tenths: int) -> str:
    """Return tenths of pixels as the shortest decimal number of pixels."""
    whole, tenth = divmod(abs(tenths), 10)
    sign = "-" if tenths < 0 else ""
    return f"{sign}{whole}.{tenth}" if tenth else f"{sign}{whole}"


# -- single elements ----------------------------------------------------------------------------------------


def _circle(sheet: VectorCommands, row: int) -> str:
    x, y = sheet.points_of(row)[0]
    radius = int(sheet.size[row])
    if radius < 10 * SMALLEST_RADIUS_PX:
        return ""
    return f'<circle cx="{_number(x)}" cy="{_number(y)}" r="{_number(radius)}"/>'


def _rectangle(sheet: VectorCommands, row: int) -> str:
    (x, y), (width, height) = sheet.points_of(row)
    return f'<rect x="{_number(x)}" y="{_number(y)}" width="{_number(width)}" height="{_number(height)}"/>'


def _polygon(sheet: VectorCommands, row: int) -> str:
    points = sheet.points_of(row)
    points = points[1:] if points[0] == points[1] else points  # for a polygon in pixels, see `on_screen`
    steps = [_step(x - old_x, y - old_y) for (old_x, old_y), (x, y) in pairwise([(0, 0), *points])]
    return f'<path d="{_joined(["m", *steps, "z"])}"/>'


def _text(sheet: VectorCommands, row: int) -> str:
    ((x, y),) = sheet.points_of(row)
    size = int(sheet.size[row])
    baseline = _number(y + round(ASCENT * size))
    place = f'x="{_number(x)}" y="{baseline}" font-size="{_number(size)}"{_turned(sheet, row)}{_halo(sheet, row)}'
    return f"<text {place}>{as_xml(sheet.text[row])}</text>"


def _turned(sheet: VectorCommands, row: int) -> str:
    """Return the attribute that rotates an element around its point."""
    ((x, y),) = sheet.points_of(row)
    angle = float(sheet.angle[row])
    return f' transform="rotate({-angle:.6g} {_number(x)} {_number(y)})"' if angle else ""


def _halo(sheet: VectorCommands, row: int) -> str:
    return _HALO.format(*sheet.paper) if sheet.has_halo(row) else ""


def _image(sheet: VectorCommands, row: int) -> str:
    ((x, y),) = sheet.points_of(row)
    half = int(sheet.size[row])
    turned = _turned(sheet, row)
    side = _number(2 * half)
    return (
        f'<image x="{_number(x - half)}" y="{_number(y - half)}" width="{side}" height="{side}"{turned} '
        f'href="{_embedded(Path(sheet.text[row]))}"/>'
    )


def _embedded(path: Path) -> str:
    """Return the image as embedded data, so that the picture is one file."""
    if path.suffix.lower() not in _IMAGE_TYPES:
        raise BadValue(f"Cannot put {path.name!r} into a picture; use one of {', '.join(_IMAGE_TYPES)}.")
    return f"data:image/{_IMAGE_TYPES[path.suffix.lower()]};base64,{b64encode(path.read_bytes()).decode()}"


_ELEMENTS: dict[DrawKind, Callable[[VectorCommands, int], str]] = {
    DrawKind.CIRCLE: _circle,
    DrawKind.RECTANGLE: _rectangle,
    DrawKind.POLYGON: _polygon,
    DrawKind.TEXT: _text,
    DrawKind.IMAGE: _image,
}
