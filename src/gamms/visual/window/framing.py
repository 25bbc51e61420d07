"""The view of the window: the whole graph until a person moves the camera, and the choices of a person who is asked."""

from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.visual.camera import WindowCamera
from gamms.visual.default_scene import reach_of_views
from gamms.visual.drawers.graph import measure_longer_side
from gamms.visual.drawers.marks import MARK_PX
from gamms.visual.window.input import Input
from gamms.visual.window.overlay import Overlay
from gamms.visual.window.panels import EDGE_PX

# of choices: from the edge, and from the one who is asked
_CHOICES_PX = 80
_APART_PX = 36
_NEAREST_PX = 90
_FOOT_PX = 16 + MARK_PX  # below a whole graph, from a mark to the parts there
_MARGINS = (40, 0.06), (40, 0.06), (84, 0.12)  # at the sides, above, below a whole graph: pixels, share of the height


class Framing:
    """Moves the camera so that important objects are visible.

    Args:
        ctx: the context.
        camera: the camera of the window.
        overlay: the overlay, which must not hide the graph.
        input: knows whether a person has moved the camera.
    """

    def __init__(self, ctx: IContext, camera: WindowCamera, overlay: Overlay, input: Input) -> None:
        self._ctx = ctx
        self._camera = camera
        self._overlay = overlay
        self._input = input
        self._fitted: Any = None
        self._reach = 0.0  # of the farthest field of view so far

    @property
    def map_extent(self) -> float | None:
        """The larger side of the graph, in world units; None if all nodes are at one place."""
        return measure_longer_side(self._ctx.graph.columns()) or None

    def fit(self) -> None:
        """Show the whole graph, as long as the camera was not moved."""
        if self._camera.is_pointed:
            return
        revision = getattr(self._ctx.graph.graph, "revision", None)
        camera = self._camera
        # Not the width of the legend: with it, the map would jump whenever a score has one more digit.
        blocks = self._overlay.hud.legend.blocks
        size = (camera.screen_width, camera.screen_height)
        self._reach = max(self._reach, reach_of_views(self._ctx, self._overlay.shown))
        now = revision, size, len(blocks), self._overlay.foot, self._reach
        if revision is None or now != self._fitted:
            self._fitted = now
            self._see_graph()

    def see_everything(self) -> None:
        """Show the whole graph, also after the window is resized."""
        self._camera.is_pointed = False
        self._input.has_moved_camera = False
        self._see_graph()

    def _see_graph(self) -> None:
        xy = self._ctx.graph.columns().xy
        if len(xy):
            side, top, low = (min(px, share * self._camera.screen_height) for px, share in _MARGINS)
            low = max(low, self._overlay.foot + _FOOT_PX)
            legend = self._overlay.hud.legend
            beside = side, top, max(side, legend.width + EDGE_PX), low
            below = side, max(top, legend.height + EDGE_PX), side, low
            box = xy.min(axis=0) - self._reach, xy.max(axis=0) + self._reach
            self._camera.look_at_box(*box, below)
            size_below = self._camera.camera_size
            self._camera.look_at_box(*box, beside)
            if size_below < self._camera.camera_size:
                self._camera.look_at_box(*box, below)

    def see_choices(self, places: FloatArray) -> None:
        """Look at the one who is asked, unless all choices are seen, and apart from it, already.

        A person who has moved or zoomed keeps the scale, and is only taken to where the agent is.
        """
        self.fit()
        view = self._camera
        has_moved = self._input.has_moved_camera
        here = places[0]
        ways = places[1:] - places[0]
        on_screen = view.camera().to_screen(places)
        size = (view.screen_width, view.screen_height)
        is_seen = bool(((on_screen >= _CHOICES_PX) & (on_screen <= np.subtract(size, _CHOICES_PX))).all())
        lengths = np.hypot(ways[:, 0], ways[:, 1])
        if is_seen and (has_moved or (lengths * view.scale >= _APART_PX).all()):
            return
        view.camera_x, view.camera_y = here.tolist()
        if not has_moved and lengths.max(initial=0.0) > 0.0:
            free = np.maximum(np.divide(size, 2) - _CHOICES_PX, 1.0)
            unit = max(float((np.abs(ways).max(axis=0) / free).max()), float(lengths.min()) / _NEAREST_PX)
            view.camera_size = unit * view.screen_width / 2
