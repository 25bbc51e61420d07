"""The engine that draws without a display: a film of the whole game, and frames at any moment."""

import atexit
import os
from typing import Any

from gamms.arguments import misspelt
from gamms.typing import IContext
from gamms.visual.engine import PictureEngine
from gamms.visual.picture import size

_OPTIONS = ("width", "height", "video", "fps", "frames_per_turn", "simulation_time_constant", "title", "note")


class OffscreenEngine(PictureEngine):
    """Films the turns of a context that is told nothing else; `frame`, `save` and `film` work as everywhere.

    Args:
        ctx: the context.
        width: pixels, of the film and of frames.
        height: pixels.
        video: the file of the film, `.mp4` or `.gif`; None films nothing.
        fps: frames per second.
        frames_per_turn: default: so many that a turn takes `simulation_time_constant` seconds.
        simulation_time_constant: seconds per turn.
        title: a line above the film.
        note: small print in its lower right corner.
        kwargs: options of other engines are no error.

    Raises:
        BadValue, BadType: see `film`.
        MissingExtra (ImportError): pygame, or what writes the film, is not installed.
    """

    def __init__(  # noqa: PLR0913 - the options of `vis_kwargs`
        self,
        ctx: IContext,
        *,
        width: int = 1280,
        height: int = 720,
        video: str | os.PathLike[str] | None = None,
        fps: float = 30,
        frames_per_turn: int | None = None,
        simulation_time_constant: float = 2.0,
        title: str = "",
        note: str = "",
        **kwargs: Any,
    ) -> None:
        super().__init__(ctx, simulation_time_constant=simulation_time_constant)
        from gamms.visual.backends.pygame import load

        load()
        self.width, self.height = size(width, height)
        for sentence in misspelt(kwargs, _OPTIONS):
            ctx.logger.warning("vis_kwargs: %s", sentence)
        if video is not None:
            self._new_film(video, fps, self.width, self.height, frames_per_turn, title=title, note=note)
            atexit.register(self.terminate)  # a program that does not end its context keeps its film, too

    def terminate(self) -> None:
        """Close the room: films that are being made end here."""
        atexit.unregister(self.terminate)
        super().terminate()

    def get_viewport(self) -> tuple[float, float, float, float, float] | None:
        """`(left, right, low end, high end, pixels per unit)` where `look_at` was called; None sees everything."""
        if self.look is None:
            return None
        camera = self.look.camera(self.width, self.height)
        right, low = camera.left + camera.width / camera.scale, camera.top - camera.height / camera.scale
        return camera.left, right, low, camera.top, camera.scale
