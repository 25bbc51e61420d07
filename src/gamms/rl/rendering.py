"""Pictures of a game that is learned in."""

from typing import Any, Literal

import numpy as np

from gamms.errors import BadValue
from gamms.rl.learners import Learners
from gamms.text import shown
from gamms.visual import Engine

METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 5, "is_parallelizable": True}
RenderMode = Literal["human", "rgb_array"] | None
_SIZE = 480, 480


def engine_of(mode: object) -> Engine | None:
    """Return the visual engine for a render mode.

    Raises:
        BadValue: there is no such mode.
    """
    if mode not in (None, *METADATA["render_modes"]):
        raise BadValue(f"render_mode must be None, 'human' or 'rgb_array', not {shown(mode)}.")
    return Engine.PYGAME if mode == "human" else None


def prepare(learners: Learners, mode: RenderMode) -> None:
    """Let a window show a turn as long as `render_fps` says, not as long as for people who watch a game."""
    if mode == "human":
        learners.games.context(0).visual.turn_seconds = 1.0 / METADATA["render_fps"]


def rendered(learners: Learners, mode: str | None) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
    """Return a picture of the first game as it is now, (height, width, 3), or show it in its window."""
    if mode is None:
        learners.games.game.ctx.logger.warning(
            "render() shows nothing: make the environment with render_mode='rgb_array' or 'human'."
        )
        return None
    visual = learners.games.context(0).visual
    if mode == "human":
        visual.update()
        return None
    pixels: np.ndarray[Any, np.dtype[np.uint8]] = visual.frame(*_SIZE)
    return pixels
