"""Images of agents are measured before they are decoded."""

import os
import struct
import zlib

import pytest

from gamms.errors import BadValue, TooLarge
from gamms.limits import allowing
from gamms.visual.backends.pygame_backend import _open_image


def png(width, height):
    """The beginning of a PNG file of that size, in which no pixel is."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")


@pytest.mark.parametrize(("width", "height"), [(14_000, 14_000), (100_000, 100_000), (2**31 - 1, 2**31 - 1)])
def test_an_image_that_takes_too_much_memory_is_not_decoded(tmp_path, width, height):
    (tmp_path / "large.png").write_bytes(png(width, height))
    with pytest.raises(TooLarge, match=f"large.png' of {width} x {height} pixels would take"):
        _open_image(os.fspath(tmp_path / "large.png"))


def test_less_memory_may_be_allowed_for_an_image(tmp_path):
    (tmp_path / "small.png").write_bytes(png(10, 10))
    with allowing(1000), pytest.raises(TooLarge, match="10 x 10 pixels"):
        _open_image(os.fspath(tmp_path / "small.png"))


@pytest.mark.parametrize("data", [b"", b"not an image", b"\x89PNG\r\n\x1a\n", png(10, 10)[:40]])
def test_an_invalid_image_is_refused(tmp_path, data):
    (tmp_path / "broken.png").write_bytes(data)
    with pytest.raises(BadValue, match="Cannot read the image"):
        _open_image(os.fspath(tmp_path / "broken.png"))


def test_a_drawing_is_drawn_in_a_bounded_size(tmp_path):
    text = '<svg xmlns="http://www.w3.org/2000/svg" width="200000" height="100000"><rect width="9" height="9"/></svg>'
    (tmp_path / "drawing.svg").write_text(text)
    assert max(_open_image(os.fspath(tmp_path / "drawing.svg")).get_size()) <= 1024
