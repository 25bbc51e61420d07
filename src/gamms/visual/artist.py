"""An artist: a drawer, the data it draws, and the layer it draws on."""

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any, ClassVar

from gamms.arguments import as_int
from gamms.deciding import Guarded, Protected, phase_of, refused_while_deciding
from gamms.errors import BadType
from gamms.text import shown
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.artist import Drawer
from gamms.visual.appearance import AgentData
from gamms.visual.constants import Shape
from gamms.visual.drawers import render_circle, render_rectangle

_SHAPES: dict[Shape, Drawer] = {Shape.Circle: render_circle, Shape.Rectangle: render_rectangle}


class RenderMode(Enum):
    """Whether a frame repaints an artist or shows it from memory."""

    CACHED = 1
    NON_CACHED = 2


class Artist(Guarded, IArtist):
    """Draws one thing: `drawer(ctx, data)`, or a shape that is described by `data`.

    Attributes:
        edits: a number that changes whenever anything but the data of any artist does.
    """

    edits: ClassVar[int] = 0

    _called = "artist"

    data: Protected[dict[str, Any]] = Protected(object)

    def __init__(self, ctx: IContext, drawer: Drawer | Shape, layer: int = 30) -> None:
        self._phase = phase_of(ctx)
        self.data = {}
        self._ctx = ctx
        self._layer = as_int(layer, "The layer of an artist")
        self._layer_dirty = False
        self._visible = True
        self._artist_type = ArtistType.DYNAMIC
        self._render_mode = RenderMode.NON_CACHED
        self.set_drawer(drawer)

    @refused_while_deciding
    def set_layer(self, layer: int) -> None:
        """Move to another layer; lower layers are painted first."""
        layer = as_int(layer, "The layer of an artist")
        self._layer_dirty |= layer != self._layer
        self._layer = layer
        Artist.edits += 1

    def get_layer(self) -> int:
        """The layer."""
        return self._layer

    @refused_while_deciding
    def set_visible(self, visible: bool) -> None:
        """Show or hide."""
        self._visible = bool(visible)
        Artist.edits += 1

    def get_visible(self) -> bool:
        """Whether it is shown."""
        return self._visible

    @refused_while_deciding
    def set_drawer(self, drawer: Drawer | Shape) -> None:
        """Draw with another function or shape."""
        if isinstance(drawer, Shape):
            drawer = _SHAPES[drawer]
        if not callable(drawer):
            raise BadType(f"A drawer is a function (ctx, data) or a Shape, not {shown(drawer)}.")
        self._drawer: Drawer = drawer
        Artist.edits += 1

    def get_drawer(self) -> Drawer:
        """The function that draws."""
        return self._drawer

    @refused_while_deciding
    def set_artist_type(self, artist_type: ArtistType) -> None:
        """Set whether it changes from frame to frame."""
        if not isinstance(artist_type, ArtistType):
            raise BadType(f"An artist type is ArtistType.STATIC or ArtistType.DYNAMIC, not {shown(artist_type)}.")
        self._artist_type = artist_type
        Artist.edits += 1

    def get_artist_type(self) -> ArtistType:
        """Static or dynamic."""
        return self._artist_type

    @refused_while_deciding
    def set_render_mode(self, render_mode: RenderMode) -> None:
        """Set whether it is repainted or shown from a cache; for information only."""
        if not isinstance(render_mode, RenderMode):
            raise BadType(f"A render mode is RenderMode.CACHED or RenderMode.NON_CACHED, not {shown(render_mode)}.")
        self._render_mode = render_mode

    def get_render_mode(self) -> RenderMode:
        """Whether it is repainted or shown from a cache."""
        return self._render_mode

    @property
    def layer_dirty(self) -> bool:
        """Whether the layer changed since it was last painted."""
        return self._layer_dirty

    @refused_while_deciding
    def draw(self) -> None:
        """Call the drawer with the context and `data`."""
        self._layer_dirty = False
        self._drawer(self._ctx, self.data)


def looks_of(artists: Mapping[str, IArtist]) -> Iterator[AgentData]:
    """How agents look, of those that visible artists show."""
    for artist in artists.values():
        data = getattr(artist, "data", None)
        look = data.get("agent_data") if isinstance(data, dict) and artist.get_visible() else None
        if isinstance(look, AgentData):
            yield look
