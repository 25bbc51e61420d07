"""Make self-contained HTML pages that replay recordings: the viewer, and the data of the recording in base64.

`painter.py` prepares the data of each turn; `docs/page-format.md` describes the bytes. The map and its scenery are
included, so that the file needs no server and no other files.
"""

import base64
import json
import re
import zlib
from collections.abc import Mapping
from html import escape
from io import BytesIO
from typing import Any, Unpack

from gamms.arguments import as_bool, as_int, as_recording
from gamms.errors import BadValue
from gamms.knowledge.sides import list_sides
from gamms.plain import Plain
from gamms.recorder import Recording
from gamms.recorder import open as opened
from gamms.recorder.errors import DAMAGES, report_damage
from gamms.recordings import first_difference, with_sensed
from gamms.text import shown
from gamms.typing.recorder import PageOptions, pages
from gamms.web.bundle import read_page
from gamms.web.columns import MAGIC, frame
from gamms.web.painter import Painter, map_for_viewer

__all__ = ["page", "page_of_two"]

_OPTIONS = PageOptions.__annotations__.keys()
_MOST_TRAILS = 200
_LEVEL = 7  # of zlib; level 9 takes seven times as long and saves a tenth
_PART_MOVES = 1 << 14  # moves in a part, which the viewer reads in some milliseconds
# turns in a part
_FEWEST_TURNS = 8
_MOST_TURNS = 64
_HEADER = ("format", "package", "seed", "created", "audience", "agents", "sides")


@pages.register("gamms")
def page(recording: Recording, **options: Unpack[PageOptions]) -> bytes:
    """Return a UTF-8 HTML page that replays a recording; equal recordings and options give equal bytes.

    Args:
        recording: a recording that contains its map, or was opened with it; it is read from beginning to end.
        options: see `gamms.typing.PageOptions`.

    Raises:
        BadValue: a turn, theme or option does not exist, or no agent of the audience has a sensor.
        UnknownName (KeyError): the team does not exist.
        RecordingError (ValueError): the recording is damaged, or lacks its map.
    """
    look = _check_options(options, as_recording(recording, "page").turns, recording.title)
    if recording.warning is not None:
        look["warnings"] = [recording.warning]
    return _assemble_page(look, options.get("still"), [_encode_for_viewer(recording, options.get("audience"))])


def page_of_two(
    first: Recording, second: Recording, *, names: tuple[str, str] = ("first", "second"), **options: Unpack[PageOptions]
) -> bytes:
    """Return an HTML page that replays two recordings side by side, and marks the first turn in which they differ.

    Args:
        first: the recording at the left.
        second: the recording at the right.
        names: the titles above both.
        options: see `page`.

    Raises:
        BadValue, UnknownName, RecordingError: see `page`.
    """
    turns = max(as_recording(one, "page_of_two").turns for one in (first, second))
    look = _check_options(options, turns, f"{names[0]} and {names[1]}")
    found = first_difference(first, second)
    look |= {"names": list(names), **({} if found is None else {"parts": found.turn})}
    pairs = zip(names, (first, second), strict=True)
    warnings = [f"{name}: {one.warning}" for name, one in pairs if one.warning is not None]
    look |= {"warnings": warnings} if warnings else {}
    recordings = [_encode_for_viewer(one, options.get("audience")) for one in (first, second)]
    return _assemble_page(look, options.get("still"), recordings)


def make_live_page(title: str) -> bytes:
    """Return the page of a live game: the viewer, which requests the game from its server."""
    words = escape(f"{title}. A browser with JavaScript shows it.")
    data = f'<script type="application/json" id="options">{as_json({"title": title, "live": True})}</script>'
    return fill_page("viewer", {"title": escape(title), "still": words, "connect": "'self'"}, data)


def _check_options(options: Mapping[str, Any], turns: int, title: str) -> dict[str, Any]:
    """Check options, and return those of the viewer that are set; `title` is the default title."""
    if unknown := sorted(options.keys() - _OPTIONS):
        raise BadValue(f"A page has no {shown(unknown[0])}; there are: {', '.join(sorted(_OPTIONS))}.")
    turn = as_int(options.get("turn", 0), "turn")
    theme = options.get("theme")
    if not 0 <= turn <= turns:
        raise BadValue(f"There is no state after {turn} turns: this recording has {turns} turns.")
    if theme not in (None, "light", "dark"):
        raise BadValue(
            f"Unknown theme {shown(theme)} of a page; there are: light, dark, and None, which is as the browser."
        )
    trails = min(max(as_int(options.get("trails", 0), "trails"), 0), _MOST_TRAILS)
    look = {
        "title": options.get("title") or title,
        "theme": theme,
        "labels": options.get("labels", "auto"),
        "trails": trails,
        "sensors": as_bool(options.get("sensors", True), "sensors"),
        "turn": turn,
        "follow": options.get("follow"),
        "audience": options.get("audience"),
    }
    return {name: value for name, value in look.items() if value is not None}


def _assemble_page(look: dict[str, Any], still: bytes | None, recordings: list[bytes]) -> bytes:
    """Return the page with the data of one or two recordings."""
    held = "\n".join(
        f'<script type="application/x-gamms-recording" class="recording">{as_text_of(one)}</script>'
        for one in recordings
    )
    words = escape(f"{look['title']}. A browser with JavaScript replays it.")
    parts = {
        "title": escape(look["title"]),
        "still": words if still is None else _write_image(still, words),
        "connect": "'none'",
    }
    data = f'<script type="application/json" id="options">{as_json(look)}</script>\n{held}'
    return fill_page("viewer", parts, data)


def _write_image(picture: bytes, words: str) -> str:
    """Return a PNG or SVG picture as an HTML element with an alternative text."""
    kind = "png" if picture.startswith(b"\x89PNG") else "svg+xml"
    return f'<img alt="{words}" src="data:image/{kind};base64,{base64.b64encode(picture).decode()}">'


def fill_page(name: str, parts: Mapping[str, str], data: str) -> bytes:
    """Fill the placeholders of a page, each of which occurs once.

    Args:
        name: the page, "viewer" or "places".
        parts: `title` and `still` (shown without scripts) as HTML, and `connect`, the allowed connections.
        data: script elements with data.
    """
    left = {**parts, "data": data}  # in one pass, so that a placeholder in a title is not filled
    text = re.sub(r"\{(\w+)\}", lambda mark: left.pop(mark[1], mark[0]), read_page(name))
    return text.encode("utf-8", "replace")


def as_text_of(data: bytes) -> str:
    """Compress bytes with zlib, and encode them in base64."""
    return base64.b64encode(zlib.compress(data, _LEVEL)).decode()


def as_json(value: object) -> str:
    """Return JSON that is safe in a script element: `<` is escaped."""
    return json.dumps(value).replace("<", "\\u003c")


# -- the recording ------------------------------------------------------------------------------------------------


def _encode_for_viewer(recording: Recording, team: str | None) -> bytes:
    """Encode a recording for the viewer, in parts of several turns, so that the viewer can seek quickly."""
    if team is not None:
        known = BytesIO()
        with_sensed(recording).cut(known, team)
        recording = opened(BytesIO(known.getvalue()))
    with report_damage("This recording cannot be shown", DAMAGES, with_type=True):
        return _encode_turns(recording)


def _encode_turns(recording: Recording) -> bytes:
    state = recording.detached(0).make_keyframe(0)
    every = min(max(_PART_MOVES // max(len(state["names"]), 1), _FEWEST_TURNS), _MOST_TURNS)
    sides = recording.header.get("sides") or list_sides(recording.header, state)
    whole = {**recording.header, "world": recording.graph.packed, "sides": sides}
    with Painter(whole, state) as painter:
        parts = [MAGIC, frame(select_header(whole))]
        painter.begin()
        for turn, log in enumerate(recording.logs(1, recording.turns + 1)):
            if turn and turn % every == 0:
                parts.append(painter.encode_part(is_last=False))
            painter.add(log)
        return b"".join([*parts, painter.encode_part()])


def select_header(header: Mapping[str, Plain]) -> dict[str, Plain]:
    """Return the part of a header that the viewer reads, and the map."""
    chosen = {name: header[name] for name in _HEADER if header.get(name) is not None}
    return {**chosen, "world": map_for_viewer(header["world"])}
