"""Build the pages that GAMMS writes, in which what Python fills in is marked, from the sources in `web/viewer`.

    python scripts/build_viewer.py

Writes `src/gamms/data/viewer.html`, which replays recordings, and `places.html`, on which places are chosen. Modules
become functions that are called in the order of their imports; whole-line comments and indentation are left out. There
is nothing to install.
"""

import base64
import hashlib
import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
SOURCES = ROOT / "src" / "gamms" / "web" / "viewer"
BUILT = ROOT / "src" / "gamms" / "data"
PAGES = {"viewer": ("main", ("viewer",)), "places": ("places", ("viewer", "places"))}  # entry and styles of each

_IMPORT = re.compile(r'^import \{([^}]*)\} from "\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) (\w+))", re.MULTILINE)
_COMMENT = re.compile(r"^\s*(?://.*|/\*\*(?:(?!\*/).)*\*/)\s*$", re.MULTILINE)
_DOCS = re.compile(r"^\s*/\*\*$.*?\*/\s*$", re.MULTILINE | re.DOTALL)


def main() -> None:
    """Write the pages."""
    for name in PAGES:
        file = BUILT / f"{name}.html"
        file.write_text(built(name), encoding="utf-8")
        print(file)


def built(name: str) -> str:
    """Return a page, which must be the same as the file that is there."""
    entry, styles = PAGES[name]
    script = bundle(entry)
    style = "".join((SOURCES / f"{one}.css").read_text(encoding="utf-8") for one in styles)
    page = (SOURCES / "page.html").read_text(encoding="utf-8")
    filled = {"script_hash": hash_of(script), "style_hash": hash_of(style), "script": script, "style": style}
    return re.sub(r"\{(\w+)\}", lambda match: filled.get(match[1], match[0]), page)


def bundle(entry: str) -> str:
    """Return a module and all that it imports as one script."""
    found: dict[str, str] = {}
    _add(entry, found, ())
    script = '"use strict";\n(() => {\n' + "\n".join(found.values()) + "\n})();\n"
    # In ASCII, so that its hash holds in pages of any encoding; other letters are in strings only.
    return re.sub(r"[^\x00-\x7f]", lambda match: f"\\u{ord(match[0]):04x}", script)


def hash_of(text: str) -> str:
    """Return what a content security policy calls an inline script or style."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _add(name: str, found: dict[str, str], above: tuple[str, ...]) -> None:
    """Add a module behind those that it imports."""
    if name in found:
        return
    if name in above:
        raise SystemExit(f"{name}.js imports itself: {' -> '.join((*above, name))}")
    text = (SOURCES / f"{name}.js").read_text(encoding="utf-8")
    for names, other in _IMPORT.findall(text):
        _add(other, found, (*above, name))
        missing = set(_names(names)) - set(_EXPORT.findall((SOURCES / f"{other}.js").read_text(encoding="utf-8")))
        if missing:
            raise SystemExit(f"{name}.js imports {', '.join(sorted(missing))}, which {other}.js does not export")
    exports = ", ".join(_EXPORT.findall(text))
    body = _IMPORT.sub(lambda match: f"const {{{match[1]}}} = {match[2]}_js;", text)
    body = _COMMENT.sub("", _DOCS.sub("", _EXPORT.sub("", body)))
    lines = [line.strip() for line in body.splitlines() if line.strip()]
    found[name] = f"const {name}_js = (() => {{\n" + "\n".join(lines) + f"\nreturn {{ {exports} }};\n}})();"


def _names(names: str) -> list[str]:
    return [name.strip() for name in names.split(",") if name.strip()]


if __name__ == "__main__":
    main()
