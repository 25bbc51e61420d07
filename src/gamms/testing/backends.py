"""Check that a picture format shows its drawing commands."""

from collections.abc import Callable
from typing import NamedTuple
from xml.etree import ElementTree as ET

from gamms.ir.draw import DrawCommands
from gamms.testing.contracts import expect
from gamms.visual.backends import Backend
from gamms.visual.backends.pillow_backend import decode_pixels
from gamms.visual.camera import Camera
from gamms.visual.drawing import Commands

_CAMERA = Camera(200, 100, 0.0, 100.0, 1.0)  # the world point (x, y) is pixel (x, 100 - y)
_PAPER = (255, 255, 255, 255)
_TOLERANCE = 6  # of color components: formats may round
_PNG = b"\x89PNG"
_SVG = b"<svg"

_Point = tuple[int, int]
_Rgb = tuple[int, int, int]


class _PictureCase(NamedTuple):
    """A drawing, and its expected pixels in every format."""

    promise: str
    draw: Callable[[Commands], None]
    tag: str  # expected SVG element
    color: _Rgb  # of the painted pixels, over the paper
    painted: tuple[_Point, ...]  # pixels
    free: tuple[_Point, ...]  # pixels


_RING = ((40, 10), (160, 10), (160, 90), (40, 90))  # world units
_HOLE = ((80, 30), (80, 70), (120, 70), (120, 30))
_CORNERS = ((2, 2), (197, 2), (2, 97), (197, 97))
_RED = (200, 0, 0)
_BLUE = (0, 0, 200)
_FAINT = (*_RED, 51)
_PINK = (244, 204, 204)  # a fifth of red over white

_CASES = (
    _PictureCase(
        "a filled circle covers its centre and nothing far outside",
        lambda commands: commands.add_circles([(100, 50)], 20, _RED),
        "circle",
        _RED,
        ((100, 50), (85, 50), (100, 65)),
        ((100, 75), (75, 50), *_CORNERS),
    ),
    _PictureCase(
        "an outlined circle leaves its middle free",
        lambda commands: commands.add_circles([(100, 50)], 20, _RED, 6),
        "circle",
        _RED,
        ((120, 50), (100, 30)),
        ((100, 50), (110, 50), *_CORNERS),
    ),
    _PictureCase(
        "a rectangle hangs from its upper left corner, in pixels",
        lambda commands: commands.add_rectangle(40, 80, 60, 30, _BLUE),
        "rect",
        _BLUE,
        ((42, 22), (97, 47)),
        ((37, 22), (42, 17), (103, 47), (97, 53)),
    ),
    _PictureCase(
        "a polygon is filled",
        lambda commands: commands.add_polygon([(40, 20), (160, 20), (100, 90)], _BLUE),
        "path",
        _BLUE,
        ((100, 40), (60, 76)),
        ((45, 20), (155, 20), (100, 90)),
    ),
    _PictureCase(
        "a polygon with a seam to a ring that runs the other way around has a hole",
        lambda commands: commands.add_polygon([*_RING, _RING[0], *_HOLE, _HOLE[0]], _BLUE),
        "path",
        _BLUE,
        ((60, 50), (100, 20), (140, 50), (100, 80)),
        ((100, 50), (85, 38), (115, 62), *_CORNERS),
    ),
    _PictureCase(
        "a line is as broad as it says",
        lambda commands: commands.add_line([(20, 50), (180, 50)], _RED, 10),
        "path",
        _RED,
        ((30, 50), (100, 47), (170, 52)),
        ((100, 40), (100, 60), *_CORNERS),
    ),
    _PictureCase(
        "transparency is blended",
        lambda commands: commands.add_circles([(100, 50)], 20, _FAINT),
        "circle",
        _PINK,
        ((100, 50),),
        _CORNERS,
    ),
    _PictureCase(
        "a transparent line is blended once where it crosses itself",
        lambda commands: commands.add_lines([(20, 50), (180, 50), (100, 5), (100, 95)], [0, 2, 4], _FAINT, 10),
        "path",
        _PINK,
        ((40, 50), (100, 50), (100, 20)),
        _CORNERS,
    ),
    _PictureCase(
        "a line that crosses the view with both ends outside is seen",
        lambda commands: commands.add_line([(-900, 50), (900, 50)], _RED, 10),
        "path",
        _RED,
        ((2, 50), (197, 50)),
        _CORNERS,
    ),
    _PictureCase(
        "a closed road whose ends are outside is seen",
        lambda commands: commands.add_line([(100, -400), (100, 50), (600, 50), (100, -400)], _RED, 10),
        "path",
        _RED,
        ((100, 80), (150, 50)),
        _CORNERS[:2],
    ),
    _PictureCase(
        "a polygon around the view covers it",
        lambda commands: commands.add_polygon([(-900, -900), (900, -900), (0, 2000)], _BLUE),
        "path",
        _BLUE,
        ((100, 50), *_CORNERS),
        (),
    ),
)


def check_backend(backend: Backend) -> None:
    """Check every promise for a picture format.

    PNG pictures are compared pixel by pixel, SVG pictures element by element; for other formats only general promises
    are checked.

    Args:
        backend: a picture format, as described in `gamms.visual.backends`.

    Raises:
        AssertionError: a promise is broken; the message names it.
    """
    for case in _CASES:
        commands = Commands()
        case.draw(commands)
        picture = _render_picture(backend, commands.freeze())
        if picture.startswith(_PNG):
            _check_pixels(case, picture)
        elif picture.lstrip().startswith(_SVG):
            _check_elements(case, picture)
    _check_layers(backend)
    _check_words(backend)
    _check_distance(backend)


def _render_picture(backend: Backend, commands: DrawCommands) -> bytes:
    def draw() -> object:
        return backend(commands, _CAMERA, title="", background=_PAPER, dpi=96.0)

    picture = draw()
    if not isinstance(picture, bytes) or not picture:
        raise AssertionError(f"a backend returns the bytes of a file: got {type(picture)!r}.")
    expect("the same commands give the same bytes", draw() == picture, "other bytes")
    return picture


def _check_pixels(case: _PictureCase, picture: bytes) -> None:
    pixels = decode_pixels(picture)
    expect("a picture has the size of its camera", pixels.shape == (100, 200, 3), pixels.shape)
    for expected, places in ((case.color, case.painted), (_PAPER[:3], case.free)):
        for x, y in places:
            seen = pixels[y, x]
            is_right = max(abs(int(a) - b) for a, b in zip(seen, expected, strict=True)) <= _TOLERANCE
            expect(f"{case.promise}; pixel ({x}, {y}) should be {expected}", is_right, seen.tolist())


def _check_elements(case: _PictureCase, picture: bytes) -> None:
    root = ET.fromstring(picture)  # noqa: S314 - made a moment ago, by the backend
    tags = [element.tag.rpartition("}")[2] for element in root.iter()]
    wanted = 1 + (case.tag == "rect")  # the paper is a rectangle, too
    expect(f"{case.promise}; <{case.tag}> should be there", tags.count(case.tag) >= wanted, tags)


def _check_layers(backend: Backend) -> None:
    commands = Commands()
    for layer, color in ((20, _RED), (10, _BLUE)):
        commands.layer = layer
        commands.add_circles([(100, 50)], 20, color)
    picture = _render_picture(backend, commands.freeze())
    promise = "higher layers are painted over lower ones"
    if picture.startswith(_PNG):
        seen = decode_pixels(picture)[50, 100].tolist()
        expect(promise, max(abs(a - b) for a, b in zip(seen, _RED, strict=True)) <= _TOLERANCE, seen)
    elif picture.lstrip().startswith(_SVG):
        red, blue = (picture.find("#{:02x}{:02x}{:02x}".format(*color).encode()) for color in (_RED, _BLUE))
        expect(promise, 0 <= blue < red, (blue, red))


def _check_words(backend: Backend) -> None:
    nothing = Commands().freeze()
    words = Commands()
    words.add_text("A <b> & ©", 20, 60, (0, 0, 0), 30)
    blank = _render_picture(backend, nothing)
    expect("text is shown", _render_picture(backend, words.freeze()) != blank, "an empty picture")


def _check_distance(backend: Backend) -> None:
    commands = Commands()
    for x, y in ((1e9, 50.0), (-1e9, -1e9), (100.0, 1e6)):
        commands.add_circles([(x, y)], 20, _RED)
        commands.add_line([(x, y), (x + 10, y)], _RED, 3)
        commands.add_polygon([(x, y), (x + 10, y), (x, y + 10)], _RED)
        commands.add_rectangle(x, y, 10, 10, _RED)
        commands.add_text("far", x, y, _RED, 12)
    picture = _render_picture(backend, commands.freeze())
    if picture.startswith(_PNG):
        expect("what is far away is not seen", bool((decode_pixels(picture) == 255).all()), "something")
