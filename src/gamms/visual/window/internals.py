"""The inside of 1.0.0's window that programs reach into, on top of ours."""

from typing import TYPE_CHECKING, Any

from gamms.arguments import as_float
from gamms.typing import ArtistType, IArtist
from gamms.visual.backends.pygame import load
from gamms.visual.engine import PictureEngine
from gamms.visual.window.display import window_surface
from gamms.visual.window.view import RenderManager

if TYPE_CHECKING:
    from gamms.visual.window.pacing import Pace


class Internals(PictureEngine):
    """Names that begin with `_` and that programs rely on all the same; see docs/compatibility.md.

    Attributes:
        _screen: the surface of the window.
        _simulation_time: seconds of the turn that have been shown.
        _waiting_simulation: whether a turn is being shown.
        _waiting_user_input: whether a person is being asked.
    """

    pace: "Pace"
    _render_manager: RenderManager
    _screen: Any
    _overlay: Any = None
    _simulation_time: float = 0.0
    _waiting_simulation: bool = False
    _waiting_user_input: bool = False
    _waiting_agent_name: str | None = None
    _will_quit: bool = False
    _has_begun: bool = False  # whether the moves of the turn that will be shown are looked up

    @property
    def _pygame(self) -> Any:
        return load()

    @property
    def _clock(self) -> Any:
        return self.pace.clock

    @property
    def _sim_time_constant(self) -> float:
        return self.turn_seconds

    @_sim_time_constant.setter
    def _sim_time_constant(self, seconds: float) -> None:
        self.turn_seconds = as_float(seconds, "_sim_time_constant")

    @property
    def _dynamic_artists(self) -> dict[str, IArtist]:
        """Artists that change from frame to frame, by name."""
        return {
            name: artist for name, artist in self._artists.items() if artist.get_artist_type() is ArtistType.DYNAMIC
        }

    @property
    def _input_overlay_artist(self) -> IArtist:
        return self._artists["input_overlay"]

    def _get_target_surface(self) -> Any:
        """What a drawer may paint on with the library itself: glass above what its layer draws; else the screen."""
        if self._drawing is None:
            return window_surface() or self._screen
        if self._overlay is None:
            pygame = load()
            self._overlay = pygame.Surface(self._screen.get_size(), pygame.SRCALPHA, 32)
        return self._overlay

    def _toggle_waiting_simulation(self, is_waiting: bool) -> None:
        """Begin to show a turn, or end it; `update` shows its frames."""
        if is_waiting and not self._has_begun:
            self.motion.begin_turn()
        self._has_begun = False
        self._waiting_simulation, self._simulation_time = bool(is_waiting), 0.0
        self.pace.clock.tick()
        if not is_waiting:
            self.pace.end_turn()
