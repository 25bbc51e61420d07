"""A recording as one HTML page: the viewer, and behind it what the viewer reads of the recording, in base64.

`painter.py` adds what rules, artists and captions show; `docs/page-format.md` describes the bytes. What the viewer does
not read is left out: random streams, facts, what rules keep, components, attributes of streets. The scenery of the map,
which recordings name, is put in. So the file needs nothing else, and no server.
"""

import base64
import json
import re
import zlib
from collections.abc import Collection, Mapping
from functools import lru_cache
from html import escape
from io import BytesIO
from typing import Any, Unpack

import numpy as np

from gamms.arguments import as_int
from gamms.errors import BadValue
from gamms.graph.map_file import MAGIC, VERSION, base_map_of, framed, scenery_called, unframed
from gamms.ir import events as kinds
from gamms.ir.events import Log
from gamms.ir.packed_bytes import STORED
from gamms.plain import Plain
from gamms.recorder import Recording, Writer
from gamms.recorder import open as opened
from gamms.recorder.cut import sides_of
from gamms.recordings import first_difference, with_sensed
from gamms.text import shown
from gamms.typing.recorder import PageOptions, pages
from gamms.web.bundle import page_called
from gamms.web.painter import Painter

__all__ = ["page", "page_of_two"]

_OPTIONS = PageOptions.__annotations__.keys()
_MOST_TRAILS = 200
_KEYFRAME_MOVES = 1 << 14  # between two keyframes, which the viewer reads in some milliseconds
_FEWEST_TURNS, _MOST_TURNS = 8, 64  # between them
_UNREAD = {  # kinds of events that neither the viewer nor what paints for it reads
    kinds.GAME_FACTS,
    kinds.GAME_CHANCE,
    kinds.GAME_PRIVATE_FACTS,
    kinds.AGENT_STRATEGY,
    kinds.AGENT_ATTRIBUTE,
    kinds.DELAYED_LOOKS,
    *kinds.COMPONENTS,
}
_PAINTED = {  # kinds of events that a page has as what they make it show
    kinds.GAME_DATA,
    kinds.GAME_EVENT,
    kinds.USER_EVENT,
    kinds.VISUALS,
    kinds.VISUAL_COMMANDS,
}
_UNREAD_STATE = ("components", "chance", "delayed_looks", "agent_facts", "team_facts")  # of keyframes
_HEADER = ("format", "package", "seed", "created", "audience", "sides")
_ATTRIBUTES = {"highway", "name", "tunnel", "z", "underground"}
_STEPS = 1 << 21  # in which coordinates are rounded, of the larger side of the map: a city to millimetres
_LAT_LON_STEP = 2.0**-23  # degrees: a centimetre


@pages.register("gamms")
def page(recording: Recording, **options: Unpack[PageOptions]) -> bytes:
    """Return an HTML page that replays a recording: UTF-8, the same bytes for the same recording and options.

    Args:
        recording: is read from its first turn to its last; it holds its map, or was opened with it.
        options: `gamms.typing.PageOptions` has them.

    Raises:
        BadValue: there is no such turn, theme or option, or no agent of the audience has a sensor.
        UnknownName (KeyError): there is no such team.
        RecordingError (ValueError): the recording is damaged, or does not hold its map.
    """
    look = _checked(options, recording.turns, _title_of(recording))
    return _assembled(look, options.get("still"), [_rewritten(recording, options.get("audience"))])


def page_of_two(
    first: Recording, second: Recording, *, names: tuple[str, str] = ("first", "second"), **options: Unpack[PageOptions]
) -> bytes:
    """Return an HTML page that replays two recordings side by side, and marks the turn where they part.

    Args:
        first: is shown at the left.
        second: is shown at the right.
        names: what stands above them.
        options: see `page`.

    Raises:
        BadValue, UnknownName, RecordingError: see `page`.
    """
    look = _checked(options, max(first.turns, second.turns), f"{names[0]} and {names[1]}")
    found = first_difference(first, second)
    look |= {"names": list(names), **({} if found is None else {"parts": found.turn})}
    recordings = [_rewritten(one, options.get("audience")) for one in (first, second)]
    return _assembled(look, options.get("still"), recordings)


def live_page(title: str) -> bytes:
    """Return the page of a game that is served: the viewer, which asks the server that it comes from for the game."""
    words = escape(f"{title}. A browser with JavaScript shows it.")
    data = f'<script type="application/json" id="options">{as_json({"title": title, "live": True})}</script>'
    return filled("viewer", {"title": escape(title), "still": words, "connect": "'self'"}, data)


def _checked(options: Mapping[str, Any], turns: int, title: str) -> dict[str, Any]:
    """Return the options of the viewer, with the title that it has by default."""
    if unknown := sorted(options.keys() - _OPTIONS):
        raise BadValue(f"A page has no {shown(unknown[0])}; there is: {', '.join(sorted(_OPTIONS))}.")
    turn, theme = as_int(options.get("turn", 0), "turn"), options.get("theme")
    if not 0 <= turn <= turns:
        raise BadValue(f"There is no state after {turn} turns: this recording has {turns} turns.")
    if theme not in (None, "light", "dark"):
        raise BadValue(
            f"Unknown theme {shown(theme)} of a page; there is: light, dark, and None, which is as the browser."
        )
    trails = min(max(as_int(options.get("trails", 0), "trails"), 0), _MOST_TRAILS)
    look = {
        "title": options.get("title") or title,
        "theme": theme,
        "labels": options.get("labels", "auto"),
        "trails": trails,
        "turn": turn,
        "follow": options.get("follow"),
        "audience": options.get("audience"),
    }
    return {name: value for name, value in look.items() if value is not None}


def _assembled(look: dict[str, Any], still: bytes | None, recordings: list[bytes]) -> bytes:
    """Return the page of some recordings."""
    held = "\n".join(
        f'<script type="application/x-gamms-recording" class="recording">{as_text_of(one)}</script>'
        for one in recordings
    )
    words = escape(f"{look['title']}. A browser with JavaScript replays it.")
    parts = {
        "title": escape(look["title"]),
        "still": words if still is None else _image(still, words),
        "connect": "'none'",
    }
    data = f'<script type="application/json" id="options">{as_json(look)}</script>\n{held}'
    return filled("viewer", parts, data)


def _image(picture: bytes, words: str) -> str:
    """Return a picture as an element of a page."""
    kind = "png" if picture.startswith(b"\x89PNG") else "svg+xml"
    return f'<img alt="{words}" src="data:image/{kind};base64,{base64.b64encode(picture).decode()}">'


def filled(name: str, parts: Mapping[str, str], data: str) -> bytes:
    """Return a page with what belongs into it, of which each mark is there once.

    Args:
        name: of the page, "viewer" or "places".
        parts: its title and what is shown without scripts, as markup; and what it may connect to.
        data: elements of scripts that are no JavaScript.
    """
    left = {**parts, "data": data}  # in one pass, so that a title that looks like a mark is none
    text = re.sub(r"\{(\w+)\}", lambda mark: left.pop(mark[1], mark[0]), page_called(name))
    return text.encode("utf-8", "replace")


def as_text_of(data: bytes) -> str:
    """Return bytes as a script element holds them: deflated, in base64."""
    return base64.b64encode(zlib.compress(data, 9)).decode()


def as_json(value: object) -> str:
    """Return JSON that can stand in a script element, which only a `<` could end."""
    return json.dumps(value).replace("<", "\\u003c")


def _title_of(recording: Recording) -> str:
    scenario = recording.header.get("scenario")
    name = scenario.get("name") if isinstance(scenario, dict) else None
    return name if isinstance(name, str) and name else "A recorded game"


# -- the recording ------------------------------------------------------------------------------------------------


def _rewritten(recording: Recording, team: str | None) -> bytes:
    """Return the recording with what the viewer reads, and with more keyframes, so that any turn comes at once."""
    if team is not None:
        known = BytesIO()
        with_sensed(recording).cut(known, team)
        recording = opened(BytesIO(known.getvalue()))
    agents = len(recording.detached(0).agents)
    every = min(max(_KEYFRAME_MOVES // max(agents, 1), _FEWEST_TURNS), _MOST_TURNS)
    stream = BytesIO()
    sides = recording.header.get("sides") or sides_of(recording.header, recording.detached(0).keyframe(0))
    whole = {**recording.header, "world": recording.graph.packed, "sides": sides}
    with Painter(whole, recording.detached(0).keyframe(0)) as painter:
        writer = Writer(stream, {**drawn_header(whole), "shown": painter.present()}, seconds=None, is_deflated=False)
        for turn, log in enumerate(recording.logs(1, recording.turns + 1)):
            if turn % every == 0:
                writer.keyframe(drawn_keyframe(recording.detached(turn).keyframe(turn)))
            writer.add_turn(drawn_log(log, painter))
    if not recording.turns:
        writer.keyframe(drawn_keyframe(recording.detached(0).keyframe(0)))
    writer.close()
    return stream.getvalue()


def drawn_header(header: Mapping[str, Plain]) -> dict[str, Plain]:
    """Return what the viewer reads of a header, which holds its map."""
    chosen = {name: header[name] for name in _HEADER if header.get(name) is not None}
    return {**chosen, "world": _map_for_viewer(header["world"])}


def drawn_log(log: Log, painter: Painter) -> Log:
    """Return what the viewer reads of the log of a turn, which the painter plays."""
    read = [entry for entry in log if type(entry) is not tuple or entry[0] not in _UNREAD]
    kept = [_drawn_event(entry) for entry in read if type(entry) is not tuple or entry[0] not in _PAINTED]
    return kept + painter.turn(read)


def drawn_keyframe(state: dict[str, Plain]) -> dict[str, Plain]:
    """Return what the viewer reads of a keyframe."""
    return {name: value for name, value in state.items() if name not in _UNREAD_STATE} | {"data": {}}


def _drawn_event(entry: Any) -> Any:
    """Return an event of a log, with a map as the viewer reads it."""
    if type(entry) is tuple and entry[0] == kinds.WORLD:
        return kinds.WORLD, {"world": _map_for_viewer(entry[1]["world"])}
    return entry


@lru_cache(maxsize=2)  # games that are begun again have the same map
def _map_for_viewer(world: bytes) -> bytes:
    return drawn_map(world, _ATTRIBUTES)


# -- the map ------------------------------------------------------------------------------------------------------


def drawn_map(
    world: bytes, attributes: Collection[str] | None = None, lat_lon: "np.ndarray[Any, Any] | None" = None
) -> bytes:
    """Return a map with what is drawn of it: rounded, with its scenery, and not deflated.

    Args:
        world: the map, as it is saved.
        attributes: those that it keeps; None: all.
        lat_lon: (nodes, 2) degrees, which it then has, too; rounded to a centimetre.
    """
    state = unframed(world, MAGIC, VERSION)
    base = state["base_map"] if "base_map" in state else base_map_of(scenery_called(state.pop("scenery", None)))
    if len(state["face_ids"]):  # which are drawn instead
        base = base | {name: base[name][:0] for name in ("face_types", "face_corners")}
    step = _step(state["xy"])
    for name in ("xy", "bend_points", "face_corners"):
        state[name] = _rounded(state[name], step)
    state |= {
        "base_map": base | {name: _rounded(base[name], step) for name in ("points", "face_corners")},
        "lengths": np.zeros(len(state["edge_ids"])),
    }
    if attributes is not None:
        state |= {kind: _chosen(state[kind], attributes) for kind in ("node_attributes", "edge_attributes")}
    if lat_lon is not None:
        state["lat_lon"] = _rounded(lat_lon, _LAT_LON_STEP)
    return framed(state, MAGIC, VERSION, STORED)


def _chosen(attributes: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    return {name: column for name, column in attributes.items() if name in names}


def _step(xy: "np.ndarray[Any, Any]") -> float:
    """Return a power of two to whose multiples coordinates are rounded, so that their last bytes are zeros."""
    extent = float(np.ptp(xy, axis=0).max()) if len(xy) else 0.0
    return float(2.0 ** np.floor(np.log2(extent / _STEPS))) if extent > 0.0 else 2.0**-32


def _rounded(places: "np.ndarray[Any, Any]", step: float) -> "np.ndarray[Any, Any]":
    return np.round(places / step) * step
