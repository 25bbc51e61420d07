"""The table of keys of windows and pages: `window/input.py` and the viewer of `gamms.web` read it.

To add a key, add a row here, and a function for its action in the window engine, the viewer (`input.js`), or both.
"""

from typing import Literal, NamedTuple

Place = Literal["window", "page"]


class KeyBinding(NamedTuple):
    """What some keys do.

    Attributes:
        action: the name of the action, under which windows and pages have its function.
        words: the description in the help; actions with the same words are explained together.
        keys: the keys in both places, named as browsers name them, in small letters.
        window: further keys in windows.
        page: further keys in pages.
    """

    action: str
    words: str
    keys: tuple[str, ...] = ()
    window: tuple[str, ...] = ()
    page: tuple[str, ...] = ()

    def list_keys(self, place: Place) -> tuple[str, ...]:
        """Return the keys of a place."""
        return self.keys + (self.window if place == "window" else self.page)


_TURNS = "a turn back, on"
_ENDS = "the first, the last turn"
_SPEED = "slower, faster"
_MOVE = "move the map"
_ZOOM = "zoom"

KEYS = (
    KeyBinding("play", "play, pause", (" ",)),
    KeyBinding("back", _TURNS, (",",), page=("arrowleft",)),
    KeyBinding("on", _TURNS, (".",), page=("arrowright",)),
    KeyBinding("start", _ENDS, ("home",)),
    KeyBinding("end", _ENDS, ("end",)),
    KeyBinding("slower", _SPEED, ("[",), window=("-",)),
    KeyBinding("faster", _SPEED, ("]",), window=("+", "=")),
    KeyBinding("move up", _MOVE, ("w",), window=("arrowup",)),
    KeyBinding("move left", _MOVE, ("a",), window=("arrowleft",)),
    KeyBinding("move down", _MOVE, ("s",), window=("arrowdown",)),
    KeyBinding("move right", _MOVE, ("d",), window=("arrowright",)),
    KeyBinding("zoom in", _ZOOM, ("pageup",), page=("+", "=")),
    KeyBinding("zoom out", _ZOOM, ("pagedown",), page=("-",)),
    KeyBinding("see everything", "see everything", ("0",)),
    KeyBinding("follow", "follow the agent", page=("f",)),
    KeyBinding("select none", "select none", ("escape",)),
    KeyBinding("names", "names", ("l",)),
    KeyBinding("trails", "trails", ("t",)),
    KeyBinding("theme", "light or dark", ("n",)),
    KeyBinding("panel", "scores, charts, events and agents", page=("p",)),
    KeyBinding("text", "hide all text", window=("h",)),
    KeyBinding("help", "these keys", ("?", "f1")),
)
"""All keys. Keys with digits and Enter that answer a question are not in it: the question says them."""

_POINTER = {  # words of a key -> the gesture of mouse or fingers that does the same
    _MOVE: "drag",
    _ZOOM: "wheel",
    "select an agent": "click",
}
_UNNAMED = {"="}  # the key of + without shift
_SIGNS = {
    " ": "space",
    **{f"arrow{way}": sign for way, sign in (("left", "←"), ("right", "→"), ("up", "↑"), ("down", "↓"))},
    "pageup": "page up",
    "pagedown": "page down",
    "escape": "Esc",
}


def find_actions(place: Place) -> dict[str, str]:
    """Return key -> action for a window or a page."""
    return {key: one.action for one in KEYS for key in one.list_keys(place)}


def explain_keys(place: Place) -> dict[str, str]:
    """Return what keys and pointer do -> how it is done, in the order of the table; the help shows it."""
    done: dict[str, list[str]] = {}
    for is_shared in (True, False):  # the keys of both places first
        for one in KEYS:
            keys = [key for key in one.list_keys(place) if (key in one.keys) == is_shared and key not in _UNNAMED]
            if one.list_keys(place):
                done.setdefault(one.words, []).extend(map(_get_sign, keys))
    for words, act in _POINTER.items():
        done.setdefault(words, []).insert(0, f"{act},")
    return {words: " ".join(signs).removesuffix(",") for words, signs in done.items()}


def _get_sign(key: str) -> str:
    return _SIGNS.get(key, key.upper() if len(key) < len("end") else key.title())
