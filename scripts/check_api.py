"""Compare the public names of GAMMS with those that are stored, so that no release changes them by accident.

    python scripts/check_api.py            # the exit status is 1 if they differ
    python scripts/check_api.py --write    # store the names as they are now

A public name is one that the reference lists (see `reference.py`), or a public member of a class that it lists. Its
line in `public_api.txt` has its parameters with types and defaults. The source is read by griffe, not imported.
"""

import argparse
import difflib
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import griffe

import reference

STORED = Path(__file__).with_name("public_api.txt")
_SPACES = re.compile(r"\s+")


def describe_api(source: Path = reference.SRC) -> list[str]:
    """Return one line for each public name, sorted."""
    root = griffe.load("gamms", search_paths=[source], resolve_aliases=True, resolve_external=False)
    lines = set[str]()
    described = dict[griffe.Object, str]()  # classes, by the first path that has them
    for package in reference.packages():
        module = root if package == "gamms" else root[package.removeprefix("gamms.")]
        for name in reference.names_of(package):
            path = f"{package}.{name}"
            target = _find(module, name)
            if target in described:
                lines.add(f"class {path}: {described[target]}")
            elif isinstance(target, griffe.Class):
                described[target] = path
                lines.update(_describe_class(path, target))
            elif target is not None and not isinstance(target, griffe.Module):
                lines.add(_describe_member(path, target))
            else:
                lines.add(path)
    return sorted(lines)


def _find(owner: griffe.Module, name: str) -> griffe.Object | None:
    """Return the definition of a public name, which may be loaded on first use; None for another library's."""
    found = owner.members.get(name)
    target = None if found is None else _find_target(found)
    if target is not None:
        return target
    place = reference.found_as(owner.path, name)
    return None if place is None else _find_in(owner, place.module, name)


def _find_target(found: griffe.Object | griffe.Alias) -> griffe.Object | None:
    """Return the definition that a name stands for; None if it is not in the source."""
    if not isinstance(found, griffe.Alias):
        return found
    try:
        return found.final_target
    except (griffe.AliasResolutionError, griffe.CyclicAliasError):
        return None


def _find_in(owner: griffe.Module, module: str, name: str) -> griffe.Object | None:
    """Return the definition of a name in a module of the source."""
    package: griffe.Module = owner.package
    found = package if module == package.path else package[module.removeprefix(f"{package.path}.")]
    inner = found.members.get(name)
    return _find_target(found if inner is None else inner)


def _describe_class(path: str, found: griffe.Class) -> Iterator[str]:
    """Yield the lines of a class: its bases, how it is made, and its public members, inherited ones included."""
    bases = ", ".join(_flatten(one) for one in found.bases)
    yield f"class {path}({bases})"
    for name, member in found.all_members.items():
        target = _find_target(member)
        if target is None or isinstance(target, griffe.Module | griffe.Class):
            continue
        if name == "__init__" or not name.startswith("_"):
            yield _describe_member(f"{path}.{name}", target)


def _describe_member(path: str, found: griffe.Object) -> str:
    """Return the line of a function or a value."""
    if isinstance(found, griffe.Function):
        return _flatten(found.signature(return_type=True, name=path))
    if not isinstance(found, griffe.Attribute) or found.annotation is None:
        return path
    is_read_only = "property" in found.labels and found.setter is None
    return f"{path}: {_flatten(found.annotation)}" + " (read only)" * is_read_only


def _flatten(value: object) -> str:
    """Return an expression of the source in one line."""
    return _SPACES.sub(" ", str(value)).strip()


def compare(stored: list[str], now: list[str]) -> list[str]:
    """Return the lines that differ: `-` for lines that are gone, `+` for new ones."""
    changes = difflib.unified_diff(stored, now, lineterm="", n=0)
    return [line for line in changes if line[0] in "+-" and line[:3] not in ("+++", "---")]


def main() -> int:
    """Run the command, and return its exit status."""
    parser = argparse.ArgumentParser(description="Compare the public names of GAMMS with those that are stored.")
    parser.add_argument("--write", action="store_true", help="store the names as they are now")
    options = parser.parse_args()
    now = describe_api()
    if options.write:
        STORED.write_text("\n".join(now) + "\n", encoding="utf-8")
        return 0
    changes = compare(STORED.read_text(encoding="utf-8").splitlines(), now)
    if not changes:
        return 0
    print("\n".join(changes))
    gone = sum(line.startswith("-") for line in changes)
    print(
        f"The public API differs from {STORED.name}: {gone} lines are gone or changed, {len(changes) - gone} are new. "
        "Programs rely on the old ones: keep a deprecated alias for one release. "
        "If the change is meant, run: python scripts/check_api.py --write"
    )
    return 1


if __name__ == "__main__":
    sys.exit(main())
