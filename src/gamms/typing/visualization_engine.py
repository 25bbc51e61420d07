"""Contract of the visual room."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from gamms.typing.artist import IArtist

ColorType = tuple[float, float, float] | tuple[float, float, float, float]  # RGB or RGBA, 0-255

_BLACK = (0, 0, 0)


class IVisualizationEngine(ABC):
    """Shows a scenario. All coordinates are world coordinates, y up."""

    @abstractmethod
    def set_graph_visual(self, **kwargs: Any) -> IArtist:
        """Declare how the graph looks: `node_color`, `node_size`, `edge_color`, `draw_id`."""

    @abstractmethod
    def set_obstacle_visual(self, **kwargs: Any) -> IArtist:
        """Declare how obstacles look: `color_map`, `boundary_thickness`, `fill`."""

    @abstractmethod
    def set_agent_visual(self, name: str, **kwargs: Any) -> IArtist:
        """Declare how an agent looks: `color`, `size`, `image_path`."""

    @abstractmethod
    def set_sensor_visual(self, name: str, **kwargs: Any) -> IArtist:
        """Declare how a sensor's last view looks: `color`, `size`, or `node_color`, `edge_color`; `layer`."""

    @abstractmethod
    def add_artist(self, name: str, artist: IArtist | dict[str, Any]) -> IArtist:
        """Show an artist; an artist of that name is replaced."""

    @abstractmethod
    def remove_artist(self, name: str) -> None:
        """Show an artist no longer."""

    @abstractmethod
    def simulate(self) -> None:
        """Show the turn that was played."""

    @abstractmethod
    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:
        """Ask a person for an action."""

    @abstractmethod
    def terminate(self) -> None:
        """Close the room."""

    @abstractmethod
    def render_text(
        self,
        text: str,
        x: float,
        y: float,
        color: ColorType = _BLACK,
        perform_culling_test: bool = True,
        font_size: int | None = None,
    ) -> None:
        """Write `text` with its top-left corner at (x, y); `font_size` in pixels, default 36."""

    @abstractmethod
    def render_rectangle(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        color: ColorType = _BLACK,
        perform_culling_test: bool = True,
    ) -> None:
        """Fill a rectangle whose top-left corner is at (x, y); `width` and `height` in pixels."""

    @abstractmethod
    def render_circle(
        self,
        x: float,
        y: float,
        radius: float,
        color: ColorType = _BLACK,
        width: int = 0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a circle; `width` is its outline in pixels, 0 = filled."""

    @abstractmethod
    def render_line(
        self,
        start_x: float,
        start_y: float,
        end_x: float,
        end_y: float,
        color: ColorType = _BLACK,
        width: int = 1,
        is_aa: bool = False,
        perform_culling_test: bool = True,
        force_no_aa: bool = False,
    ) -> None:
        """Draw a line, `width` in pixels."""

    @abstractmethod
    def render_linestring(
        self,
        points: Sequence[tuple[float, float]],
        color: ColorType = _BLACK,
        width: int = 1,
        closed: bool = False,
        is_aa: bool = False,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a polyline, `width` in pixels."""

    @abstractmethod
    def render_polygon(
        self,
        points: Sequence[tuple[float, float]],
        color: ColorType = _BLACK,
        width: int = 0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a polygon; `width` is its outline in pixels, 0 = filled."""

    @abstractmethod
    def render_image(
        self,
        x: float,
        y: float,
        image: Any,
        size: float,
        angle: float = 0.0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw an image of side `2 * size`, turned by `angle` degrees."""

    @abstractmethod
    def render_layer(self, layer_id: int) -> None:
        """Paint a layer."""

    @abstractmethod
    def get_viewport(self) -> tuple[float, float, float, float, float] | None:
        """`(left, right, top, bottom, pixels per unit)`; None where nothing is shown."""
