"""Contract of the visual engine, and the keywords with which visuals are declared."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from enum import Enum
from os import PathLike
from typing import Any, Literal, TypedDict, Unpack

from gamms.plugins import Registry

Drawer = Callable[[Any, dict[str, Any]], None]
"""Draws an artist: a function of the context and of the artist's `data`.

Any: the context is made of what is declared here and cannot be named here; a drawer says it itself:
`def draw(ctx: gamms.Context, data: dict[str, Any]) -> None`.
"""


class ArtistType(Enum):
    """Whether what an artist draws changes from frame to frame."""

    STATIC = 1
    DYNAMIC = 2


class IArtist(ABC):
    """Draws one thing; `data` is handed to its drawer."""

    data: dict[str, Any]

    @abstractmethod
    def set_layer(self, layer: int) -> None:
        """Move to another layer; lower layers are painted first."""

    @abstractmethod
    def get_layer(self) -> int:
        """Return the layer."""

    @abstractmethod
    def set_visible(self, visible: bool) -> None:
        """Show or hide."""

    @abstractmethod
    def get_visible(self) -> bool:
        """Return whether it is shown."""

    @abstractmethod
    def set_drawer(self, drawer: Drawer) -> None:
        """Draw with another function."""

    @abstractmethod
    def get_drawer(self) -> Drawer | None:
        """Return the function that draws."""

    @abstractmethod
    def get_artist_type(self) -> ArtistType:
        """Return whether it changes from frame to frame."""

    @abstractmethod
    def set_artist_type(self, artist_type: ArtistType) -> None:
        """Set whether it changes from frame to frame."""

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
    """The keywords of pictures, frames and films that say how they look, and what is around the map."""

    title: str
    """A line above the map: none."""
    note: str
    """Small print in the lower right corner, to which the source of the map is added: none."""
    background: ColorType | str
    """The colour behind everything: that of the theme."""
    fit: Literal["page", "tight"]
    """Whether the page is as large as was asked, or as tight as the map allows within that: "page"."""
    scale_bar: bool | None
    """Whether there is one: None, where lengths on the map are metres."""
    north: bool
    """Whether an arrow shows where north is: False."""
    theme: Literal["light", "dark", "print"]
    """The colours of the background, of words, of the map and of teams: "light"."""
    labels: bool | Literal["auto"] | Collection[str]
    """Whether agents have their names beside them, or which have: "auto", while they are few."""
    trails: int
    """Of how many turns the ways of agents are shown: 0."""
    sensors: bool
    """Whether what sensors see is drawn, as far as it is by default or was declared: True."""
    captions: bool
    """Whether the turn and what happens in it stand below the map: in films, not in pictures."""
    street_names: bool
    """Whether streets have their names along them where the map is shown close by: True."""


class GraphVisual(TypedDict, total=False):
    """The keywords of `set_graph_visual`."""

    node_color: ColorType | str
    """Of nodes: (128, 128, 128)."""
    node_size: float
    """The radius of nodes, world units: 2.0."""
    edge_color: ColorType | str
    """Of edges: (211, 211, 211)."""
    draw_id: bool
    """Whether the ids of nodes are written beside them: False."""


class ObstacleVisual(TypedDict, total=False):
    """The keywords of `set_obstacle_visual`."""

    color_map: Mapping[int, ColorType | str]
    """The colours of types, over a palette of the types 0 to 31; others are grey."""
    boundary_thickness: float
    """The width of top edges, world units: 1.0."""
    fill: bool
    """Whether what walls stand around is filled: False."""


class AgentVisual(TypedDict, total=False):
    """The keywords of `set_agent_visual`."""

    color: ColorType | str
    """Of the disc: (0, 0, 0)."""
    size: float
    """The radius, or half the side of an image, world units: 8.0."""
    image_path: str | PathLike[str] | None
    """The file of an image that is drawn instead of a disc: None."""


class SensorVisual(TypedDict, total=False):
    """The keywords of `set_sensor_visual`."""

    color: ColorType | str
    """Of what it sees: (0, 255, 255)."""
    node_color: ColorType | str
    """Of nodes: as `color`."""
    edge_color: ColorType | str
    """Of edges: as `color`."""
    size: float
    """The radius of the rings around agents, world units: 8.0."""
    node_size: float
    """The radius of nodes, world units: 2.0, or 1.0 where edges are sensed, too."""
    layer: int
    """Lower ones are painted first: 40; in a window 30."""


class IVisualizationEngine(ABC):
    """Shows a scenario. All coordinates are world coordinates, y up."""

    @abstractmethod
    def set_graph_visual(self, **kwargs: Unpack[GraphVisual]) -> IArtist:
        """Declare how the graph looks."""

    @abstractmethod
    def set_obstacle_visual(self, **kwargs: Unpack[ObstacleVisual]) -> IArtist:
        """Declare how obstacles look."""

    @abstractmethod
    def set_agent_visual(self, name: str, **kwargs: Unpack[AgentVisual]) -> IArtist:
        """Declare how an agent looks; it need not exist yet."""

    @abstractmethod
    def set_sensor_visual(self, name: str, **kwargs: Unpack[SensorVisual]) -> IArtist:
        """Declare how a sensor's last view looks."""

    @abstractmethod
    def add_artist(self, name: str, artist: IArtist | dict[str, Any]) -> IArtist:
        """Draw an artist; one of that name is replaced."""

    @abstractmethod
    def remove_artist(self, name: str) -> None:
        """Stop drawing an artist."""

    @abstractmethod
    def simulate(self) -> None:
        """Show the turn that was played."""

    @abstractmethod
    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:
        """Ask a person for an action."""

    @abstractmethod
    def terminate(self) -> None:
        """Release what is held: films, windows."""

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
        """Draw an image of side `2 * size`, turned by `angle` degrees."""

    @abstractmethod
    def render_layer(self, layer_id: int) -> None:
        """Paint a layer."""

    @abstractmethod
    def get_viewport(self) -> tuple[float, float, float, float, float] | None:
        """Return `(left, right, top, bottom, pixels per unit)`; None where nothing is shown."""


live_engines: Registry[IVisualizationEngine] = Registry("kind of live engine", "gamms.live_engines", "gamms.web.engine")
"""What shows a game to browsers; the context finds it under the name "gamms"."""
