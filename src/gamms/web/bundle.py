"""The pages that replay games and choose places: each is one file, made of the modules and styles in `viewer/`.

Modules of JavaScript become functions that are called in the order of their imports; comments on lines of their own and
indentation are left out. What belongs into a page is marked in it, see `pages.filled`.
"""

import base64
import hashlib
import re
from functools import cache
from pathlib import Path

SOURCES = Path(__file__).parent / "viewer"
PAGES = {"viewer": ("main", ("viewer",)), "places": ("places", ("viewer", "places"))}  # entry and styles of each

IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.js";$', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) (\w+))", re.MULTILINE)
_COMMENTS = re.compile(r"^\s*(?://.*|/\*\*(?:(?!\*/).)*\*/|/\*\*$(?s:.*?)\*/)\s*$", re.MULTILINE)


@cache
def page_called(name: str) -> str:
    """Return a page without what belongs into it, "viewer" or "places"."""
    entry, styles = PAGES[name]
    modules: dict[str, str] = {}
    _add(entry, modules)
    script = '"use strict";\n(() => {\n' + "\n".join(modules.values()) + "\n})();\n"
    # In ASCII, so that its hash holds in pages of any encoding; other letters are in strings only.
    script = re.sub(r"[^\x00-\x7f]", lambda match: f"\\u{ord(match[0]):04x}", script)
    style = "".join(_read(f"{one}.css") for one in styles)
    parts = {"script_hash": hash_of(script), "style_hash": hash_of(style), "script": script, "style": style}
    return re.sub(r"\{(\w+)\}", lambda match: parts.get(match[1], match[0]), _read("page.html"))


def hash_of(text: str) -> str:
    """Return what a content security policy calls an inline script or style."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _read(name: str) -> str:
    return (SOURCES / name).read_text(encoding="utf-8")


def _add(name: str, modules: dict[str, str]) -> None:
    """Add a module behind those that it imports."""
    if name in modules:
        return
    text = _read(f"{name}.js")
    for _, other in IMPORT.findall(text):
        _add(other, modules)
    body = IMPORT.sub(r"const {\1} = \2_js;", text)
    body = _COMMENTS.sub("", EXPORT.sub("", body))
    lines = "\n".join(filter(None, map(str.strip, body.splitlines())))
    modules[name] = f"const {name}_js = (() => {{\n{lines}\nreturn {{ {', '.join(EXPORT.findall(text))} }};\n}})();"
