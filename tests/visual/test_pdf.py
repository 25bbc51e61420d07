"""PDF files: vectors on a page of the right size, words in one embedded font, and no date."""

import builtins
import re
import shutil
import subprocess
import zlib
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from gamms.errors import BadValue, MissingExtra
from gamms.ir.draw import DrawSpace
from gamms.visual.backends.pdf import write_pdf
from gamms.visual.backends.pillow_backend import decode_pixels
from gamms.visual.camera import Camera
from gamms.visual.drawing import Commands

CAMERA = Camera(200, 100, 0.0, 100.0, 1.0)  # the world point (x, y) is pixel (x, 100 - y)
WHITE = (255, 255, 255, 255)


def written(commands, camera=CAMERA, title="", dpi=72.0):
    return write_pdf(commands.freeze(), camera, title=title, background=WHITE, dpi=dpi)


def operators(file):
    """The lines of the page, in points where an inch has 72 pixels."""
    streams = re.findall(rb"stream\r?\n(.*?)endstream", file, re.DOTALL)
    pages = [_inflated(stream) for stream in streams]
    return next(page for page in pages if b" re " in page).decode("latin-1")


def _inflated(stream):
    import base64

    data = base64.a85decode(stream.strip().removesuffix(b"~>")) if b"~>" in stream else stream
    try:
        return zlib.decompress(data)
    except zlib.error:
        return b""


def test_a_page_is_as_large_on_paper_as_its_dots_per_inch_say(ctx, tmp_path):
    ctx.visual.save(tmp_path / "a.pdf", 600, 300, dpi=300)
    assert b"/MediaBox [ 0 0 144 72 ]" in (tmp_path / "a.pdf").read_bytes()


def test_the_same_state_gives_the_same_bytes_without_a_date(ctx):
    first, second = (ctx.visual.picture(".pdf", title="A") for _ in range(2))
    assert first == second
    assert set(re.findall(rb"Date \(D:(\d{4})", first)) == {b"2000"}


def test_every_font_is_embedded(ctx):
    file = ctx.visual.picture(".pdf", title="A title", note="a note")
    assert set(re.findall(rb"/BaseFont /(\S+)", file)) == {b"AAAAAA+Arimo"}
    assert b"/FontFile2" in file
    assert b"/ToUnicode" in file


def test_lines_of_one_style_are_one_path_and_points_are_left_out():
    commands = Commands()
    commands.add_lines([(10, 10), (20, 10), (20, 30), (50, 50), (50, 50)], [0, 3, 5], "red", 2)
    page = operators(written(commands))
    assert "n 10 10 m 20 10 l 20 30 l\nS" in page
    assert "50 50 m" not in page


def test_transparency_is_kept():
    commands = Commands()
    commands.add_polygon([(10, 10), (50, 10), (50, 50)], (255, 0, 0, 51))
    assert b"/ca .2" in written(commands)


def test_invisible_shapes_are_left_out():
    commands = Commands()
    commands.add_circles([(900, 900)], 5, "red")
    commands.add_circles([(50, 50)], 0.1, "red")
    assert operators(written(commands)).count(" c ") == 0


def test_an_image_is_part_of_the_file(tmp_path):
    Image.new("RGB", (40, 20), (200, 0, 0)).save(tmp_path / "red.png")
    commands = Commands()
    commands.add_image(str(tmp_path / "red.png"), 100, 50, 20)
    assert b"/Width 40" in written(commands)
    commands.add_image(str(tmp_path / "none.png"), 100, 50, 20)
    with pytest.raises(BadValue, match=r"none\.png"):
        written(commands)


@pytest.mark.parametrize("words", ["", "a < b & (c)", "\x00\n", "\ud800", "\U0001f600 漢字", "(" * 300, "a" * 5000])
def test_any_words_can_be_written(words):
    commands = Commands()
    commands.add_text(words, 20, 60, "black", 20)
    commands.add_text(words, 20, 60, "black", 0)
    assert written(commands, title=words.encode("utf-8", "replace").decode())[:5] == b"%PDF-"


def test_without_reportlab_the_extra_is_named(ctx, tmp_path, monkeypatch):
    real = builtins.__import__

    def without(name, *arguments, **keywords):
        if name.partition(".")[0] == "reportlab":
            raise ImportError(name)
        return real(name, *arguments, **keywords)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtra, match=r"\(extra 'viz'\): pip install "):
        ctx.visual.save(tmp_path / "a.pdf")
    assert list(tmp_path.iterdir()) == []


# -- as a viewer shows it ---------------------------------------------------------------------------------------

needs_poppler = pytest.mark.skipif(shutil.which("pdftoppm") is None, reason="poppler-utils are not installed")


def seen(file, tmp_path):
    """The page as pixels."""
    (tmp_path / "a.pdf").write_bytes(file)
    subprocess.run(["pdftoppm", "-r", "72", "-png", "-singlefile", "a.pdf", "a"], cwd=tmp_path, check=True)
    return decode_pixels((tmp_path / "a.png").read_bytes()).astype(int)


@needs_poppler
def test_a_viewer_shows_the_same_as_the_png(tmp_path):
    from gamms.visual.backends.raster import paint_picture

    commands = Commands()
    commands.add_polygon([(20, 10), (180, 10), (100, 90)], (0, 114, 178))
    commands.add_lines([(0, 50), (200, 50)], [0, 2], (213, 94, 0, 128), 12)
    commands.add_circles([(60, 50)], 20, (0, 158, 115), 6)
    commands.add_circles([(140, 40)], 12, "yellow", space=DrawSpace.SCREEN)
    commands.add_rectangle(10, 95, 40, 20, "black")
    shown, frozen = seen(written(commands), tmp_path), commands.freeze()
    expected = paint_picture(frozen, CAMERA, WHITE).pixels().astype(int)
    assert np.abs(shown - expected).max(axis=2).mean() < 2
    moved = replace(frozen, points=frozen.points + np.array([8.0, 0.0]))
    assert np.abs(shown - paint_picture(moved, CAMERA, WHITE).pixels()).max(axis=2).mean() > 10


@needs_poppler
def test_words_can_be_selected(ctx, tmp_path):
    ctx.visual.save(tmp_path / "a.pdf", title="Zwölf Boxkämpfer, größer", note="see §4")
    text = subprocess.run(["pdftotext", "a.pdf", "-"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert {"Zwölf Boxkämpfer, größer", "see §4"} <= {line.strip() for line in text.splitlines()}
