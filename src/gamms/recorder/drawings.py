"""What artists with custom drawers draw, as events of a recording at the end of each turn in which it changes."""

from typing import Any

from gamms.ir import events as kinds
from gamms.ir.events import Log
from gamms.plain import is_same


class DrawingWatch:
    """Compares what artists draw with what was recorded last.

    Args:
        visual: the visual engine of the context.
        with_custom: whether drawers of the program's own are called; else only drawings of a replay are recorded.

    Attributes:
        first: the drawings at the beginning.
    """

    def __init__(self, visual: Any, *, with_custom: bool) -> None:
        self._artists = getattr(visual, "artists", None)  # an engine of the caller's may have none
        self._with_custom = with_custom
        self._known: dict[str, Any] = {}
        self.first = [data for _, data in self.changes()]

    @property
    def edits(self) -> int:
        """A number that changes whenever an artist is declared, added or removed."""
        return 0 if self._artists is None else int(self._artists.edits)

    def specs(self) -> dict[str, Any]:
        """Describe all artists as plain values, as far as there are such; see `Artists.specs`."""
        if self._artists is None:
            return {"artists": [], "is_declared": False}
        specs: dict[str, Any] = self._artists.specs(with_drawings=self._with_custom)
        return specs

    def changes(self) -> Log:
        """Return events that say what artists draw which have not drawn that before."""
        if self._artists is None:
            return []
        known, self._known = self._known, self._artists.recorded_drawings(with_custom=self._with_custom)
        return [
            (kinds.VISUAL_COMMANDS, data)
            for name, data in self._known.items()
            if name not in known or not is_same(known[name], data)
        ]
