"""Every shipped picture format keeps the contract, and an error says why another does not."""

import builtins
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from gamms.errors import MissingExtra
from gamms.testing import check_backend
from gamms.visual.backends import FORMATS


@pytest.mark.parametrize("suffix", [".svg", ".png", ".pdf"])
def test_a_shipped_format_keeps_the_contract(suffix):
    check_backend(FORMATS[suffix])


def test_a_format_that_forgets_the_alpha_is_found():
    def opaque(commands, camera, **words):
        color = np.column_stack([commands.color[:, :3], np.full(len(commands), 255, np.uint8)])
        return FORMATS[".png"](replace(commands, color=color), camera, **words)

    with pytest.raises(AssertionError, match=r"transparency is blended; pixel \(100, 50\)"):
        check_backend(opaque)


def test_a_format_that_draws_nothing_is_found():
    with pytest.raises(AssertionError, match="text is shown"):
        check_backend(lambda commands, camera, **words: b"always the same")


def test_png_says_how_large_it_is_on_paper(ctx, tmp_path):
    ctx.visual.save(tmp_path / "a.png", 300, 150, dpi=300)
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (300, 150)
        assert image.info["dpi"] == pytest.approx((300, 300), abs=0.02)
    ctx.visual.save(tmp_path / "a.svg", 300, 150, dpi=300)
    assert 'width="1in" height="0.5in" viewBox="0 0 300 150"' in (tmp_path / "a.svg").read_text()


@pytest.mark.parametrize(
    ("library", "call", "extra"),
    [
        ("pygame", lambda visual, folder: visual.frame(), "viz"),
        ("PIL", lambda visual, folder: visual.save(folder / "a.png"), "viz"),
        ("av", lambda visual, folder: visual.film(folder / "a.mp4"), "video"),
        ("PIL", lambda visual, folder: visual.film(folder / "a.gif"), "viz"),
    ],
)
def test_a_missing_library_is_asked_for_by_its_extra(ctx, tmp_path, monkeypatch, library, call, extra):
    from gamms.visual.backends import pygame_backend

    real = builtins.__import__

    def without(name, *arguments, **keywords):
        if name.partition(".")[0] == library:
            raise ImportError(name)
        return real(name, *arguments, **keywords)

    pygame_backend.load.cache_clear()
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtra, match=rf"\(extra '{extra}'\): pip install "):
        call(ctx.visual, tmp_path)
    assert list(tmp_path.iterdir()) == []
