"""Reads the source as syntax trees, each file once, for the scripts and tests that look at its structure."""

import ast
import gc
from functools import cache
from pathlib import Path


@cache
def tree_of(path: Path) -> ast.Module:
    """Return the syntax tree of a file."""
    was_enabled = gc.isenabled()
    gc.disable()  # looking for garbage among the nodes takes three times as long as parsing
    try:
        return ast.parse(path.read_text(encoding="utf-8"))
    finally:
        if was_enabled:
            gc.enable()


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """Return all nodes of a file's syntax tree, in the order of `ast.walk`."""
    return tuple(ast.walk(tree_of(path)))


def count_nodes(tree: ast.AST) -> int:
    """Return the number of expressions and statements below a node, without docstrings."""
    docstrings: set[ast.AST] = set()
    for node in ast.walk(tree):
        is_documented = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
        if is_documented and ast.get_docstring(node, clean=False) is not None:
            docstrings |= {node.body[0], node.body[0].value}
    return sum(isinstance(node, (ast.expr, ast.stmt)) and node not in docstrings for node in ast.walk(tree))


@cache
def size_of(path: Path) -> int:
    """Return the number of expressions and statements of a file, without docstrings."""
    return count_nodes(tree_of(path))


def is_there(entry: str, folder: Path) -> bool:
    """Return whether a folder of source has what an entry names.

    Args:
        entry: a file `a/b.py`, a folder `a/`, a `Name` at the top of any file, or a `Class.member`; both also in one
            file, `a/b.py:Name`. With ` <= 900` behind it, what is there must have more syntax nodes than that.
        folder: the folder.
    """
    what, _, most = (part.strip() for part in entry.partition("<="))
    if what.endswith("/") or (what.endswith(".py") and ":" not in what):
        paths = [*(folder / what).rglob("*.py")] if what.endswith("/") else [folder / what]
        return sum(size_of(path) for path in paths if path.exists()) > int(most or 0)
    file, _, name = what.rpartition(":")
    paths = [folder / file] if file else [*folder.rglob("*.py")]
    found = [node for path in paths if path.exists() for node in _find_named(tree_of(path), name)]
    return any(count_nodes(node) > int(most or 0) for node in found)


def _find_named(tree: ast.Module, name: str) -> list[ast.AST]:
    """Return the definitions of a name at the top of a file, or of a member of a class there."""
    outer, _, member = name.partition(".")
    found = [node for known, node in _list_definitions(tree.body) if known == outer]
    if not member:
        return found
    classes = [node for node in found if isinstance(node, ast.ClassDef)]
    return [node for one in classes for known, node in _list_members(one) if known == member]


def _list_definitions(body: list[ast.stmt]) -> list[tuple[str, ast.AST]]:
    """Return the classes, functions and assigned names of a body, also those below `if` and `try`."""
    found: list[tuple[str, ast.AST]] = []
    for node in body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            found.append((node.name, node))
        elif isinstance(node, ast.Assign):
            found += [(target.id, node) for target in node.targets if isinstance(target, ast.Name)]
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.append((node.target.id, node))
        elif isinstance(node, (ast.If, ast.Try)):
            found += _list_definitions([*node.body, *node.orelse])
    return found


def _list_members(of: ast.ClassDef) -> list[tuple[str, ast.AST]]:
    """Return the methods and attributes of a class: those in its body, and those that its methods set."""
    found = _list_definitions(of.body)
    for node in ast.walk(of):
        is_set = isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
        if is_set and isinstance(node.value, ast.Name) and node.value.id == "self":
            found.append((node.attr, node))
    return found
