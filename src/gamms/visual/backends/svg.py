"""SVG: consecutive commands of one style become one element, so that a city gives a small file.

Equal commands give equal bytes.
"""

import re
from base64 import b64encode
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

from gamms.errors import BadValue
from gamms.ir.draw import DrawCommands
from gamms.text import as_xml
from gamms.visual.appearance import Rgb, Rgba
from gamms.visual.backends.vectors import Point, write_vectors
from gamms.visual.camera import CSS_DPI, Camera
from gamms.visual.font import ASCENT, FAMILIES

_HALO = ' stroke="#{:02x}{:02x}{:02x}" stroke-width="3" paint-order="stroke"'
_NEEDLESS = re.compile(r" (?=[-a-z])|(?<=[a-z]) |(?<!\d)(?<!\.)0(?=\.)")  # in a path
_IMAGE_TYPES = {
    ".png": "png",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".gif": "gif",
    ".webp": "webp",
    ".svg": "svg+xml",
}


def write_svg(commands: DrawCommands, camera: Camera, *, title: str, background: Rgba, dpi: float = CSS_DPI) -> bytes:
    """Return the picture as an SVG file, with the paper size given by `dpi`."""
    writer = _SvgWriter()
    write_vectors(commands, camera, background, writer)
    lines = [
        _write_opening(camera, dpi),
        f"<title>{as_xml(title or 'GAMMS')}</title>",
        f'<rect width="100%" height="100%"{_paint("fill", background)}/>',
        '<g stroke-linecap="round" stroke-linejoin="round" fill-rule="evenodd">',
        *writer.elements,
        "</g>",
        "</svg>\n",
    ]
    return "\n".join(lines).encode()


def _write_opening(camera: Camera, dpi: float) -> str:
    width = camera.width
    height = camera.height
    sides = (f"{side}" if dpi == CSS_DPI else f"{side / dpi:.6g}in" for side in (width, height))
    physical = 'width="{}" height="{}"'.format(*sides)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {physical} '
        f'viewBox="0 0 {width} {height}" role="img" font-family="{FAMILIES}">'
    )


class _SvgWriter:
    """Writes each run as one element.

    Attributes:
        elements: the runs; those without anything that can be seen are left out.
    """

    def __init__(self) -> None:
        self.elements: list[str] = []
        self._style = ""
        self._body: list[str] = []

    def begin(self, color: Rgba, width: int, *, is_outline: bool) -> None:
        stroke = f' fill="none"{_paint("stroke", color)} stroke-width="{_format_number(width)}"'
        self._style = stroke if is_outline else _paint("fill", color)
        self._body = []

    def end(self) -> None:
        if self._body:
            self.elements.append(f"<g{self._style}>{''.join(self._body)}</g>")

    def write_lines(self, lines: list[list[Point]]) -> None:
        if lines:
            self.elements.append(f'<path{self._style} d="{_write_path(lines)}"/>')

    def write_circle(self, middle: Point, radius: int) -> None:
        x, y = middle
        self._body.append(f'<circle cx="{_format_number(x)}" cy="{_format_number(y)}" r="{_format_number(radius)}"/>')

    def write_rectangle(self, corner: Point, width: int, height: int) -> None:
        sides = f'width="{_format_number(width)}" height="{_format_number(height)}"'
        self._body.append(f"<rect {_format_point(corner)} {sides}/>")

    def write_polygon(self, corners: list[Point]) -> None:
        steps = [_step(x - old_x, y - old_y) for (old_x, old_y), (x, y) in pairwise([(0, 0), *corners])]
        self._body.append(f'<path d="{_join_steps(["m", *steps, "z"])}"/>')

    def write_text(self, words: str, corner: Point, size: int, angle: float, halo: Rgb | None) -> None:
        x, y = corner
        start = _format_point((x, y + round(ASCENT * size)))
        place = f'{start} font-size="{_format_number(size)}"{_write_rotation(corner, angle)}'
        outline = "" if halo is None else _HALO.format(*halo)
        self._body.append(f"<text {place}{outline}>{as_xml(words)}</text>")

    def write_image(self, path: str, middle: Point, half: int, angle: float) -> None:
        x, y = middle
        side = _format_number(2 * half)
        place = f'{_format_point((x - half, y - half))} width="{side}" height="{side}"{_write_rotation(middle, angle)}'
        self._body.append(f'<image {place} href="{_embed_image(Path(path))}"/>')


def _paint(role: str, color: Rgba) -> str:
    red, green, blue, alpha = color
    opacity = "" if alpha == 255 else f' {role}-opacity="{alpha / 255:.3g}"'
    return f' {role}="#{red:02x}{green:02x}{blue:02x}"{opacity}'


def _write_path(lines: list[list[Point]]) -> str:
    """Return one path through all lines of a run, in connected chains."""
    steps = list[str]()
    x = 0
    y = 0
    for chain in _chain_lines([(line[0], line[-1]) for line in lines]):
        steps.append("m")
        for row, is_reversed in chain:
            for to_x, to_y in reversed(lines[row]) if is_reversed else lines[row]:
                if to_x != x or to_y != y or steps[-1] == "m":
                    steps.append(_step(to_x - x, to_y - y))
                    x = to_x
                    y = to_y
    return _join_steps(steps)


def _chain_lines(ends: Sequence[tuple[Point, Point]]) -> Iterator[list[tuple[int, bool]]]:
    """Yield lines as (row, whether it is reversed), in chains where each line begins at the end of the previous one."""
    at = defaultdict[Point, list[int]](list)
    for row, (first, last) in enumerate(ends):
        at[first].append(row)
        at[last].append(row)
    is_left = [True] * len(ends)

    def onward(place: Point) -> Iterator[tuple[int, bool]]:
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


def _join_steps(steps: Iterable[str]) -> str:
    """Return the steps of a path without redundant spaces and zeros."""
    return _NEEDLESS.sub("", " ".join(steps))


@lru_cache(maxsize=1 << 16)
def _step(x: int, y: int) -> str:
    return f"{_format_number(x)} {_format_number(y)}"


def _format_number(tenths: int) -> str:
    """Return tenths of pixels as the shortest decimal number of pixels."""
    whole, tenth = divmod(abs(tenths), 10)
    sign = "-" if tenths < 0 else ""
    return f"{sign}{whole}.{tenth}" if tenth else f"{sign}{whole}"


def _format_point(point: Point) -> str:
    x, y = point
    return f'x="{_format_number(x)}" y="{_format_number(y)}"'


def _write_rotation(middle: Point, angle: float) -> str:
    """Return the attribute that rotates an element around a point."""
    x, y = middle
    return f' transform="rotate({-angle:.6g} {_format_number(x)} {_format_number(y)})"' if angle else ""


def _embed_image(path: Path) -> str:
    """Return the image as embedded data, so that the picture is one file."""
    if path.suffix.lower() not in _IMAGE_TYPES:
        raise BadValue(f"Cannot put {path.name!r} into a picture; use one of {', '.join(_IMAGE_TYPES)}.")
    return f"data:image/{_IMAGE_TYPES[path.suffix.lower()]};base64,{b64encode(path.read_bytes()).decode()}"
