"""Bundle the JavaScript modules and styles in `viewer/` into self-contained pages: the viewer and the place chooser.

Each JavaScript module becomes a function that is called in import order; indentation and full-line comments are
removed. Placeholders such as `{title}` are filled later, see `pages.filled`.
"""

import base64
import hashlib
import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from gamms.visual.keys import explain_keys, find_actions
from gamms.visual.themes import THEMES

SOURCES = Path(__file__).parent / "viewer"
PAGES = {"viewer": ("main", ("viewer",)), "places": ("places", ("viewer", "places"))}  # page -> entry module, styles
VIEWER_THEMES = ("light", "dark")

IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.js";$', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) (\w+))", re.MULTILINE)
_COMMENTS = re.compile(r"^\s*(?://.*|/\*\*(?:(?!\*/).)*\*/|/\*\*$(?s:.*?)\*/)\s*$", re.MULTILINE)


@cache
def read_page(name: str) -> str:
    """Return the page "viewer" or "places", with placeholders for its data."""
    entry, styles = PAGES[name]
    modules: dict[str, str] = {}
    _add(entry, modules)
    script = '"use strict";\n(() => {\n' + "\n".join(modules.values()) + "\n})();\n"
    # The script is ASCII, so that its hash is valid in any encoding; other letters occur only in strings.
    script = re.sub(r"[^\x00-\x7f]", lambda match: f"\\u{ord(match[0]):04x}", script)
    style = "".join(_read(f"{one}.css") for one in styles)
    parts = {"script_hash": compute_hash(script), "style_hash": compute_hash(style), "script": script, "style": style}
    parts["themes"] = json.dumps({name: _make_color_table(name) for name in VIEWER_THEMES})
    parts["keys"] = json.dumps({"actions": find_actions("page"), "help": explain_keys("page")})
    return re.sub(r"\{(\w+)\}", lambda match: parts.get(match[1], match[0]), _read("page.html"))


def _make_color_table(name: str) -> dict[str, Any]:
    """Return the colors of a theme for the viewer: as CSS, or as numbers if the viewer interpolates them."""
    theme = THEMES[name]
    walls = theme.map.walls
    ground = theme.map.ground
    return {
        "name": name,
        "background": format_css(theme.background),
        "ink": format_css(theme.ink),
        "faint": format_css(theme.faint),
        "card": format_css(theme.card),
        "streets": format_css(theme.map.streets),
        "nodes": format_css(theme.map.nodes),
        "walls": [walls.low, walls.high],
        "outline": format_css(walls.outline),
        "wall": format_css(walls.wall),
        **{part: format_css(color) for part, color in ground._asdict().items()},
        "fog": [format_css(color) for color in theme.fog],
    }


def format_css(color: Sequence[int]) -> str:
    """Return an RGB or RGBA color, 0 to 255 each, as CSS."""
    return "#" + bytes(color).hex().removesuffix("ff" if len(color) > 3 else "")


def compute_hash(text: str) -> str:
    """Return the hash of an inline script or style, as written in a content security policy."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _read(name: str) -> str:
    return (SOURCES / name).read_text(encoding="utf-8")


def _add(name: str, modules: dict[str, str]) -> None:
    """Add a module to `modules`, after the modules that it imports."""
    if name in modules:
        return
    text = _read(f"{name}.js")
    for _, other in IMPORT.findall(text):
        _add(other, modules)
    body = IMPORT.sub(r"const {\1} = \2_js;", text)
    body = _COMMENTS.sub("", EXPORT.sub("", body))
    lines = "\n".join(filter(None, map(str.strip, body.splitlines())))
    modules[name] = f"const {name}_js = (() => {{\n{lines}\nreturn {{ {', '.join(EXPORT.findall(text))} }};\n}})();"
