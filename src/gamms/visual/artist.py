"""Artists: a drawer, its data, and its layer; and groups of artists that draw together."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from itertools import groupby
from typing import Any, ClassVar
from zlib import crc32

import numpy as np

from gamms.arguments import as_int
from gamms.deciding import Guarded, Protected, get_phase, refuse_while_deciding
from gamms.errors import BadType
from gamms.ir.draw import DrawCommands
from gamms.ir.graph import FloatArray
from gamms.text import shown
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.agent_engine import AgentType
from gamms.typing.visualization_engine import Drawer
from gamms.visual.appearance import AgentData, AgentLooks
from gamms.visual.constants import Shape
from gamms.visual.drawers import render_circle, render_rectangle
from gamms.visual.drawers.agents import render_agent, render_agents
from gamms.visual.drawing import Commands, get_drawing

_SHAPES: dict[Shape, Drawer] = {Shape.Circle: render_circle, Shape.Rectangle: render_rectangle}


class RenderMode(Enum):
    """How a frame shows an artist: repainted, or from a cache."""

    CACHED = 1
    NON_CACHED = 2


class Artist(Guarded, IArtist):
    """Draws one object: `drawer(ctx, data)`, or a shape described by `data`.

    Attributes:
        edits: a number that changes with every change of any artist, except of its data.
    """

    edits: ClassVar[int] = 0

    _called = "artist"

    data: Protected[dict[str, Any]] = Protected(object)

    def __init__(self, ctx: IContext, drawer: Drawer | Shape, layer: int = 30) -> None:
        self._phase = get_phase(ctx)
        self.data = {}
        self._ctx = ctx
        self._layer = as_int(layer, "The layer of an artist")
        self._layer_dirty = False
        self._visible = True
        self._artist_type = ArtistType.DYNAMIC
        self._render_mode = RenderMode.NON_CACHED
        self.set_drawer(drawer)

    @refuse_while_deciding
    def set_layer(self, layer: int) -> None:
        """Move to another layer; lower layers are painted first."""
        layer = as_int(layer, "The layer of an artist")
        self._layer_dirty |= layer != self._layer
        self._layer = layer
        Artist.edits += 1

    def get_layer(self) -> int:
        """Return the layer."""
        return self._layer

    @refuse_while_deciding
    def set_visible(self, visible: bool) -> None:
        """Set whether the artist is shown."""
        self._visible = bool(visible)
        Artist.edits += 1

    def get_visible(self) -> bool:
        """Return whether the artist is shown."""
        return self._visible

    @refuse_while_deciding
    def set_drawer(self, drawer: Drawer | Shape) -> None:
        """Set the drawer, a function or shape."""
        if isinstance(drawer, Shape):
            drawer = _SHAPES[drawer]
        if not callable(drawer):
            raise BadType(f"A drawer is a function (ctx, data) or a Shape, not {shown(drawer)}.")
        self._drawer: Drawer = drawer
        Artist.edits += 1

    def get_drawer(self) -> Drawer:
        """Return the function that draws."""
        return self._drawer

    @refuse_while_deciding
    def set_artist_type(self, artist_type: ArtistType) -> None:
        """Set whether the drawing changes from frame to frame."""
        if not isinstance(artist_type, ArtistType):
            raise BadType(f"An artist type is ArtistType.STATIC or ArtistType.DYNAMIC, not {shown(artist_type)}.")
        self._artist_type = artist_type
        Artist.edits += 1

    def get_artist_type(self) -> ArtistType:
        """Return whether the drawing changes from frame to frame."""
        return self._artist_type

    @refuse_while_deciding
    def set_render_mode(self, render_mode: RenderMode) -> None:
        """Set whether it is repainted or shown from a cache; for information only."""
        if not isinstance(render_mode, RenderMode):
            raise BadType(f"A render mode is RenderMode.CACHED or RenderMode.NON_CACHED, not {shown(render_mode)}.")
        self._render_mode = render_mode

    def get_render_mode(self) -> RenderMode:
        """Return whether it is repainted or shown from a cache."""
        return self._render_mode

    @property
    def layer_dirty(self) -> bool:
        """Return whether the layer changed since it was last painted."""
        return self._layer_dirty

    @refuse_while_deciding
    def draw(self) -> None:
        """Call the drawer with the context and `data`."""
        self._layer_dirty = False
        self._drawer(self._ctx, self.data)


def list_looks(artists: Mapping[str, IArtist]) -> Iterator[AgentData]:
    """Yield the looks of agents that visible artists show."""
    for artist in artists.values():
        look = _get_look(artist)
        if isinstance(look, AgentData):
            yield look
        elif look is not None:
            yield from look


def collect_drawn_looks(artists: Mapping[str, IArtist]) -> tuple[list[str], FloatArray]:
    """Return the names of agents that visible artists have drawn, and columns; see `AgentLooks.list_drawn`."""
    names = list[str]()
    columns = [np.empty((0, 6))]
    for look in map(_get_look, artists.values()):
        if isinstance(look, AgentLooks):
            more, found = look.list_drawn()
            names += more
            columns.append(found)
        elif look is not None and look.current_position is not None:
            names.append(look.name)
            columns.append(np.array([(*look.current_position, *look.shift, look.size, look.least_px)], np.float64))
    return names, np.concatenate(columns)


def _get_look(artist: IArtist) -> AgentData | AgentLooks | None:
    data = get_data(artist) if artist.get_visible() else {}
    look = data.get("agent_data", data.get("looks"))
    return look if isinstance(look, AgentData | AgentLooks) else None


_Item = tuple[str, IArtist]


def sort_for_painting(artists: Mapping[str, IArtist]) -> list[_Item]:
    """Sort the visible artists by layer; within a layer, static artists come first."""
    return sorted((item for item in artists.items() if item[1].get_visible()), key=_make_sort_key)


def _make_sort_key(item: _Item) -> tuple[int, bool]:
    return item[1].get_layer(), item[1].get_artist_type() is not ArtistType.STATIC


class ArtistGroup:
    """The visible artists of a collection, sorted once and drawn any number of times.

    Args:
        ctx: the context.
        artists: by name; any change except of their data needs a new group.

    Attributes:
        artists: in painting order.
    """

    def __init__(self, ctx: IContext, artists: Mapping[str, IArtist]) -> None:
        items = sort_for_painting(artists)
        self._ctx = ctx
        self.artists = tuple(artist for _, artist in items)
        by_step = groupby(items, lambda item: (item[1].get_layer(), _is_disc(ctx, item[1])))
        self._steps = [(layer, are_discs, list(members)) for (layer, are_discs), members in by_step]

    def draw_artists(self, share: float = 1.0) -> DrawCommands:
        """Return the commands of all artists after a share of the agents' last moves, from 0.0 to 1.0.

        Errors of an artist are logged, and the others draw.
        """
        return get_drawing(self._ctx).record(lambda commands: self._draw(commands, share))

    def _draw(self, commands: Commands, share: float) -> None:
        for layer, are_discs, members in self._steps:
            commands.layer = layer
            for _, artist in members:
                if artist.get_artist_type() is ArtistType.DYNAMIC:
                    get_data(artist)["_alpha"] = share
            if not (are_discs and self._draw_discs(members, share)):
                self._draw_singly(members)

    def _draw_discs(self, members: list[_Item], share: float) -> bool:
        """Draw agents together; return False if one of them needs to be drawn alone."""
        try:
            return render_agents(self._ctx, [get_data(artist)["agent_data"] for _, artist in members], share)
        except Exception:  # noqa: BLE001 - drawn by itself, the agent that is the reason fails, too
            return False

    def _draw_singly(self, members: list[_Item]) -> None:
        for name, artist in members:
            try:
                artist.draw()
            except Exception as error:  # noqa: BLE001 - a drawer is user code; the contract is to log and go on
                self._ctx.logger.error(  # noqa: TRY400 - ILogger has no `exception`
                    "Artist %r could not be drawn: %s: %s", name, type(error).__name__, error
                )


def _is_disc(ctx: IContext, artist: IArtist) -> bool:
    """Return whether an artist draws an agent on the ground as a disc."""
    if artist.get_drawer() is not render_agent or type(artist).draw is not Artist.draw:
        return False
    look = get_data(artist).get("agent_data")
    agent = ctx.agent.agents.get(look.name) if isinstance(look, AgentData) else None
    return agent is not None and agent.type != AgentType.AERIAL


def get_data(artist: IArtist) -> dict[str, Any]:
    """Return the data of an artist; an artist of a program may have none."""
    data = getattr(artist, "data", None)
    return data if isinstance(data, dict) else {}


def make_state_key(name: str, artist: IArtist) -> Any:
    """Return a hashable key that changes whenever a STATIC artist must draw again in an unchanged world."""
    return name, artist.get_layer(), artist.get_drawer(), _make_print(getattr(artist, "data", None))


def _make_print(value: object) -> Any:
    """Return a hashable key that differs if two values are drawn differently."""
    if isinstance(value, dict):
        return tuple((_make_print(key), _make_print(one)) for key, one in value.items())
    if isinstance(value, list | tuple | set | frozenset):
        return type(value), tuple(_make_print(one) for one in value)
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), tuple(_make_print(getattr(value, field.name)) for field in fields(value) if field.compare)
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.shape, value.dtype.str, crc32(value.tobytes())
    if value is None or isinstance(value, str | int | float | bytes | complex):
        return type(value), value
    return id(value)
