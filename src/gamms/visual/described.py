"""Artists in words, and artists from words: those of the drawers of this room; who draws by a function has no words."""

from collections.abc import Callable
from typing import Any, NamedTuple

from gamms.errors import BadType
from gamms.text import shown
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.artist import Drawer
from gamms.visual.appearance import AgentData, Circle, GraphData, Rectangle
from gamms.visual.artist import Artist
from gamms.visual.drawers import (
    render_agent,
    render_circle,
    render_graph,
    render_obstacles,
    render_rectangle,
    render_sensor,
)

_Data = dict[str, Any]


class _Kind(NamedTuple):
    """What one drawer draws."""

    drawer: Drawer
    names: tuple[str, ...]  # of the keywords
    keywords_of: Callable[[_Data], _Data]  # may have more, and may raise where the data are the caller's
    data_of: Callable[[_Data], _Data]
    is_static: bool = False


def _of_shape(kind: type) -> Callable[[_Data], _Data]:
    return lambda data: next((value.__dict__ for value in data.values() if isinstance(value, kind)), data)


_KINDS = {
    "graph": _Kind(
        render_graph,
        ("node_color", "node_size", "edge_color", "draw_id"),
        lambda data: data["graph_data"].__dict__,
        lambda given: {"graph_data": GraphData(**given)},
        is_static=True,
    ),
    "obstacles": _Kind(render_obstacles, ("color_map", "boundary_thickness", "fill"), dict, dict, is_static=True),
    "agent": _Kind(
        render_agent,
        ("name", "color", "size"),
        lambda data: data["agent_data"].__dict__,
        lambda given: {"agent_data": AgentData(**given), "_alpha": 1.0},
    ),
    "sensor": _Kind(render_sensor, ("name", "color", "size", "node_color", "node_size", "edge_color"), dict, dict),
    "circle": _Kind(render_circle, ("x", "y", "radius", "scale", "color"), _of_shape(Circle), dict),
    "rectangle": _Kind(render_rectangle, ("x", "y", "width", "height", "color"), _of_shape(Rectangle), dict),
}
_NAME_OF = {kind.drawer: name for name, kind in _KINDS.items()}


def words_of(name: str, artist: IArtist) -> dict[str, Any] | None:
    """An artist in words: `name`, `kind`, `keywords`, `layer`, `visible`; None if there are none for it."""
    kind = _NAME_OF.get(artist.get_drawer())  # type: ignore[arg-type]  # None is in no table
    if kind is None:
        return None
    try:
        given = _KINDS[kind].keywords_of(artist.data)
        keywords = {key: given[key] for key in _KINDS[kind].names if key in given}
    except (KeyError, TypeError, ValueError, AttributeError):  # data of the caller's own, which do not draw, either
        return None
    layer, visible = artist.get_layer(), artist.get_visible()
    return {"name": name, "kind": kind, "keywords": keywords, "layer": layer, "visible": visible}


def artist_of(ctx: IContext, words: dict[str, Any]) -> Artist | None:
    """An artist as `words_of` told it; None if it is of a kind that is not known here.

    Raises:
        KeyError, BadType, TypeError: nobody told this.
    """
    kind = _KINDS.get(words["kind"])
    if kind is None:
        return None
    if not isinstance(words["keywords"], dict):
        raise BadType(f"The keywords of artist {shown(words['name'])} must be a dict, not {shown(words['keywords'])}.")
    artist = Artist(ctx, kind.drawer, words["layer"])
    artist.data = kind.data_of({key: value for key, value in words["keywords"].items() if key in kind.names})
    artist.set_visible(words["visible"])
    if kind.is_static:
        artist.set_artist_type(ArtistType.STATIC)
    return artist
