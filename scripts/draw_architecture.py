"""Draw the layers of GAMMS, and the files of some packages, from the imports in the source.

    python scripts/draw_architecture.py [docs/figures]

Writes `layers.svg` and `files_<package>.svg`. An arrow means "imports"; one that follows from two others is left out.
"""

import ast
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from xml.sax.saxutils import escape

from syntax import nodes_of

ROOT = Path(__file__).parent.parent
SRC = ROOT / "src" / "gamms"
PACKAGES = ("game", "recorder")
FRONT_DOOR = {"", "compat", "__main__"}  # they name everything, so that completion works

CHAR, BOX_HEIGHT, GAP, ROW = 7.3, 30, 14, 74  # pixels
STYLE = "font:12px ui-monospace,SFMono-Regular,Menlo,Consolas,monospace"
MARKER = """<defs><marker id="end" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" markerHeight="6" orient="auto">
<path d="M0 0L8 4L0 8z" fill="#7a8899"/></marker></defs>"""

Imports = dict[str, set[str]]


def main() -> None:
    """Write the drawings into a folder."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "figures"
    for name, drawing in drawings().items():
        (folder / name).write_text(drawing)
        print(folder / name)


def drawings() -> dict[str, str]:
    """Return all drawings: file name -> SVG."""
    modules = imports_of_modules()
    drawn = {"layers.svg": drawing("Layers of GAMMS", layers(), imports_of_packages(modules))}
    for package in PACKAGES:
        files = imports_within(modules, package)
        drawn[f"files_{package}.svg"] = drawing(f"Files of gamms.{package}", levels(files), files)
    return drawn


def layers() -> list[list[str]]:
    """Return the rows of packages that import-linter holds, from the top."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    rows = next(contract["layers"] for contract in settings["contracts"] if contract["type"] == "layers")
    return [[name.strip().removeprefix("gamms.") for name in row.split("|")] for row in rows]


@cache
def imports_of_modules() -> Imports:
    """Return the modules of GAMMS that each of its modules imports, also for type checkers and in functions."""
    paths = {
        ".".join(path.relative_to(SRC).with_suffix("").parts).removesuffix("__init__").strip("."): path
        for path in sorted(SRC.rglob("*.py"))
        if "data" not in path.relative_to(SRC).parts  # there: code of games, as users write it
    }
    found: Imports = {}
    for module, path in paths.items():
        nodes = nodes_of(path)
        names = {name for node in nodes if isinstance(node, (ast.Import, ast.ImportFrom)) for name in names_of(node)}
        found[module] = {module_of(name, paths) for name in names} - {"", module}
    return found


def module_of(name: str, paths: dict[str, Path]) -> str:
    """Return the module that a dotted name is in; an empty text if it is in none."""
    return name if not name or name in paths else module_of(name.rpartition(".")[0], paths)


def names_of(node: ast.Import | ast.ImportFrom) -> Iterator[str]:
    """Yield the dotted names below `gamms` that a statement imports."""
    above = "" if isinstance(node, ast.Import) else f"{node.module}."
    names = [f"{above}{alias.name}" for alias in node.names]
    yield from (name.removeprefix("gamms.") for name in names if name.startswith("gamms."))


def imports_of_packages(modules: Imports) -> Imports:
    """Return the packages that each package imports."""
    packages: Imports = {}
    for module, imported in modules.items():
        package = module.split(".")[0]
        if package not in FRONT_DOOR:
            packages.setdefault(package, set()).update({name.split(".")[0] for name in imported} - {package})
    return packages


def imports_within(modules: Imports, package: str) -> Imports:
    """Return the files of a package that each of its files imports."""
    inside = {module: module.removeprefix(package + ".") for module in modules if module.startswith(package + ".")}
    return {short: {inside[name] for name in modules[module] & inside.keys()} for module, short in inside.items()}


def levels(files: Imports) -> list[list[str]]:
    """Return files in rows, such that each imports only from rows below its own; a circle is an error."""
    below: list[list[str]] = []
    left = dict(files)
    while left:
        row = sorted(name for name, imported in left.items() if not imported & left.keys())
        if not row:
            sys.exit(f"These files import each other: {', '.join(sorted(left))}")
        below.append(row)
        for name in row:
            del left[name]
    return below[::-1]


def reduced(imports: Imports) -> Imports:
    """Return the imports without those that follow from two others."""
    reached: Imports = {}

    def reach(name: str) -> set[str]:
        if name not in reached:
            reached[name] = set()
            for other in imports.get(name, ()):
                reached[name] |= {other} | reach(other)
        return reached[name]

    return {
        name: {other for other in others if not any(other in reach(third) for third in others - {other})}
        for name, others in imports.items()
    }


def drawing(title: str, rows: list[list[str]], imports: Imports) -> str:
    """Return a drawing of rows of boxes, and of arrows from each to those that it imports."""
    widths = [[len(name) * CHAR + 22 for name in row] for row in rows]
    whole = max(sum(row) + GAP * (len(row) - 1) for row in widths) + 2 * GAP
    boxes = {}
    for y, (row, sizes) in enumerate(zip(rows, widths, strict=True)):
        x = (whole - sum(sizes) - GAP * (len(row) - 1)) / 2
        for name, width in zip(row, sizes, strict=True):
            boxes[name] = (x, 40 + y * ROW, width)
            x += width + GAP
    height = 40 + (len(rows) - 1) * ROW + BOX_HEIGHT + GAP
    size = f'width="{whole:.0f}" height="{height:.0f}"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {whole:.0f} {height:.0f}" {size} style="{STYLE}">',
        f"<title>{escape(title)}</title>",
        MARKER,
        f'<rect {size} fill="#ffffff"/>',
        f'<text x="{GAP}" y="24" font-weight="bold">{escape(title)}: each imports only from rows below</text>',
    ]
    for name, others in sorted(reduced(imports).items()):
        for other in sorted(others):
            (x, y, width), (x2, y2, width2) = boxes[name], boxes[other]
            start, end = (x + width / 2, y + BOX_HEIGHT), (x2 + width2 / 2, y2 - 1)
            bend = (start[1] + end[1]) / 2
            parts.append(
                f'<path d="M{start[0]:.0f} {start[1]}C{start[0]:.0f} {bend:.0f} {end[0]:.0f} {bend:.0f} {end[0]:.0f} '
                f'{end[1]}" fill="none" stroke="#b3bfcc" marker-end="url(#end)"/>'
            )
    for name, (x, y, width) in boxes.items():
        parts.append(
            f'<rect x="{x:.0f}" y="{y}" width="{width:.0f}" height="{BOX_HEIGHT}" rx="5" fill="#eef3f8" '
            'stroke="#5b6b7b"/>'
            f'<text x="{x + width / 2:.0f}" y="{y + 19}" text-anchor="middle">{escape(name)}</text>'
        )
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    main()
