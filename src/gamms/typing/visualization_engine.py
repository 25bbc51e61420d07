"""Contract of the visual engine, and the keywords of visuals."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from enum import Enum
from os import PathLike
from typing import Any, Literal, TypedDict, Unpack

from gamms.arguments import spell_out_options
from gamms.plugins import Registry

Drawer = Callable[[Any, dict[str, Any]], None]
"""A function that draws an artist, called with the context and the artist's `data`.

Any: the context cannot be imported here; annotate your drawer: `def draw(ctx: gamms.Context, data: dict[str, Any]) ->
None`.
"""


class ArtistType(Enum):
    """Whether the drawing of an artist changes from frame to frame."""

    STATIC = 1
    DYNAMIC = 2


class IArtist(ABC):
    """A drawn object; `data` is passed to its drawer."""

    data: dict[str, Any]

    @abstractmethod
    def set_layer(self, layer: int) -> None:
        """Move to another layer; lower layers are painted first."""

    @abstractmethod
    def get_layer(self) -> int:
        """Return the layer."""

    @abstractmethod
    def set_visible(self, visible: bool) -> None:
        """Set whether the artist is shown."""

    @abstractmethod
    def get_visible(self) -> bool:
        """Return whether the artist is shown."""

    @abstractmethod
    def set_drawer(self, drawer: Drawer) -> None:
        """Set the function that draws."""

    @abstractmethod
    def get_drawer(self) -> Drawer | None:
        """Return the function that draws."""

    @abstractmethod
    def get_artist_type(self) -> ArtistType:
        """Return whether the drawing changes from frame to frame."""

    @abstractmethod
    def set_artist_type(self, artist_type: ArtistType) -> None:
        """Set whether the drawing changes from frame to frame."""

    @property
    @abstractmethod
    def layer_dirty(self) -> bool:
        """Whether the layer changed since it was last painted."""

    @abstractmethod
    def draw(self) -> None:
        """Call the drawer with the context and `data`."""


ColorType = tuple[float, float, float] | tuple[float, float, float, float]  # RGB or RGBA, 0-255

_BLACK = (0, 0, 0)


class PictureOptions(TypedDict, total=False):
    """The keywords of pictures, frames and films: their look, and the elements around the map.

    Attributes:
        title: a line above the map. Default: none.
        note: small print in the lower right corner, to which the source of the map is added. Default: none.
        background: the color behind everything. Default: the one of the theme.
        fit: "page", the requested size, or "tight", reduced to the shape of the map. Default: "page".
        scale_bar: whether there is a scale bar. Default: None, where lengths on the map are metres.
        north: whether an arrow shows where north is. Default: False.
        theme: the colors of the background, of words, of the map and of teams: "light", "dark" or "print". Default:
            "light".
        labels: whether names are shown beside agents, or the names of the agents to label. Default: "auto", if there
            are few agents.
        trails: the number of turns for which the paths of agents are shown. Default: 0.
        sensors: whether the views of sensors are drawn, if they are by default or were declared. Default: True.
        captions: whether the turn and its events are shown below the map. Default: True in films, False in pictures.
        street_names: whether street names are shown when the map is enlarged. Default: True.
        legend: whether colors and signs are explained beside the map. Default: True.
    """

    title: str
    note: str
    background: ColorType | str
    fit: Literal["page", "tight"]
    scale_bar: bool | None
    north: bool
    theme: Literal["light", "dark", "print"]
    labels: bool | Literal["auto"] | Collection[str]
    trails: int
    sensors: bool
    captions: bool
    street_names: bool
    legend: bool


class GraphVisual(TypedDict, total=False):
    """The keywords of `set_graph_visual`.

    Attributes:
        node_color: the color of nodes. Default: (128, 128, 128).
        node_size: the radius of nodes, in map units. Default: 2.0.
        edge_color: the color of edges. Default: (211, 211, 211).
        draw_id: whether the ids of nodes are written beside them. Default: False.
    """

    node_color: ColorType | str
    node_size: float
    edge_color: ColorType | str
    draw_id: bool


class ObstacleVisual(TypedDict, total=False):
    """The keywords of `set_obstacle_visual`.

    Attributes:
        color_map: type -> color, in place of the palette of the types 0 to 31; other types are grey. Default: none.
        boundary_thickness: the width of top edges, in map units. Default: 1.0.
        fill: whether the inside of walls is filled, with the color of its type in `color_map`, else with a tone by
            height; False draws only the top edges of faces. Default: False.
    """

    color_map: Mapping[int, ColorType | str]
    boundary_thickness: float
    fill: bool


class AgentVisual(TypedDict, total=False):
    """The keywords of `set_agent_visual`.

    Attributes:
        color: the color of the disc. Default: (0, 0, 0).
        size: the radius of the disc, or half the side of the image, in map units. Default: 8.0.
        image_path: the file of an image that is drawn in place of the disc. Default: None.
    """

    color: ColorType | str
    size: float
    image_path: str | PathLike[str] | None


class SensorVisual(TypedDict, total=False):
    """The keywords of `set_sensor_visual`.

    Attributes:
        color: the color of the sensed objects. Default: (0, 255, 255).
        node_color: the color of nodes. Default: `color`.
        edge_color: the color of edges. Default: `color`.
        size: the radius of the rings around agents, in map units. Default: 8.0.
        node_size: the radius of nodes, in map units. Default: 2.0, or 1.0 if edges are sensed, too.
        layer: the layer to draw on; lower layers are painted first. Default: 40, in a window 30.
    """

    color: ColorType | str
    node_color: ColorType | str
    edge_color: ColorType | str
    size: float
    node_size: float
    layer: int


class IVisualizationEngine(ABC):
    """Shows a scenario. All coordinates are world coordinates, y up."""

    @abstractmethod
    @spell_out_options()
    def set_graph_visual(self, **kwargs: Unpack[GraphVisual]) -> IArtist:
        """Set the look of the graph, and draw only declared artists from now on; a window shows the whole graph.

        Args:
            kwargs: see `GraphVisual`.
        """

    @abstractmethod
    @spell_out_options()
    def set_obstacle_visual(self, **kwargs: Unpack[ObstacleVisual]) -> IArtist:
        """Set the look of obstacles.

        Args:
            kwargs: see `ObstacleVisual`.
        """

    @abstractmethod
    @spell_out_options()
    def set_agent_visual(self, name: str, **kwargs: Unpack[AgentVisual]) -> IArtist:
        """Set the look of an agent, which need not exist yet; if others do, a warning says so once.

        Args:
            name: the name of the agent.
            kwargs: see `AgentVisual`.

        Raises:
            BadType, BadValue: the size is not a finite number.
            MissingFile (FileNotFoundError): in a window, the image file does not exist.
        """

    @abstractmethod
    @spell_out_options()
    def set_sensor_visual(self, name: str, **kwargs: Unpack[SensorVisual]) -> IArtist:
        """Set the look of a sensor's last view.

        Args:
            name: the id of the sensor.
            kwargs: see `SensorVisual`.

        Raises:
            UnknownName (KeyError): in a window, the sensor does not exist.
            BadValue: in a window, the sensor is a custom one without a view to draw.
        """

    @abstractmethod
    def add_artist(self, name: str, artist: IArtist | dict[str, Any]) -> IArtist:
        """Draw an artist; an artist of the same name is replaced.

        Args:
            name: the name by which the artist can be removed.
            artist: an artist, or a dict that becomes the `data` of a new one: its key `drawer` is the function that
                draws, or `shape` a shape; `layer` the layer to draw on.

        Raises:
            BadType: neither an artist nor a dict.
        """

    @abstractmethod
    def remove_artist(self, name: str) -> None:
        """Stop drawing an artist."""

    @abstractmethod
    def simulate(self) -> None:
        """Show the last turn."""

    @abstractmethod
    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:
        """Ask a person for an action."""

    @abstractmethod
    def terminate(self) -> None:
        """Release films, windows and other resources."""

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
        image: object,
        size: float,
        angle: float = 0.0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw an image of side `2 * size`, rotated by `angle` degrees."""

    @abstractmethod
    def render_layer(self, layer_id: int) -> None:
        """Paint a layer."""

    @abstractmethod
    def get_viewport(self) -> tuple[float, float, float, float, float] | None:
        """Return `(left, right, top, bottom, pixels per unit)`; None if nothing is shown."""


live_engines: Registry[IVisualizationEngine] = Registry("kind of live engine", "gamms.live_engines", "gamms.web.engine")
"""Registered live engines, which show games in browsers; the context uses the one named "gamms"."""
