"""Sheets: surfaces to paint on for a moment, kept because fresh memory costs more than what is painted on it."""

from typing import Any

from gamms.visual.backends.pygame import load

_STEP = 256  # px: sides are multiples of it, so that a view that grows does not need a new sheet in every frame
_LARGEST = 4_000_000  # px: 16 MB; larger ones are not kept


class Sheets:
    """One sheet for each use."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, int], Any] = {}

    def sheet(self, use: str, width: int, height: int, flags: int = 0) -> Any:
        """A surface of that size, on which there still is what was painted last for the same use."""
        kept = self._kept.get((use, flags))
        if kept is None or kept.get_width() < width or kept.get_height() < height:
            across, down = (-(-length // _STEP) * _STEP for length in (width, height))
            kept = load().Surface((across, down), flags, 32)
            if across * down <= _LARGEST:
                self._kept[use, flags] = kept
        return kept.subsurface((0, 0, width, height))
