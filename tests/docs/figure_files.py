"""Compares figures that the documentation shows with those that its code makes."""

import numpy as np

from gamms.visual.backends.pillow_backend import decode_pixels


def assert_same_figure(shown, made):
    """Assert that a shown file, SVG or PNG, is what was made: to the letter, or as pixels nearly so."""
    if made.suffix == ".svg":
        assert made.read_text() == shown.read_text(), f"{shown} is not what its code makes: run make figures"
        return
    before, now = (decode_pixels(path.read_bytes()).astype(int) for path in (shown, made))
    assert now.shape == before.shape
    differs = np.abs(now - before).max(axis=2)
    # Letters and hairlines differ a little between versions of pygame.
    assert (differs > 64).mean() < 0.002, f"{shown} is not what its code makes: run make figures"
    assert differs.mean() < 0.5, f"{shown} is not what its code makes: run make figures"
