"""Writes the pages of the reference: every public name of every public package, from signatures and docstrings.

The source is read, and what is described is not imported: a signature is shown as it is written, with the names of its
types, and no optional library is needed. A public name is one in `__all__` of a package that `gamms` offers, or, where
a module has no `__all__`, one without an underscore.
"""

import ast
import builtins
import contextlib
import copy
import inspect
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import pages
import syntax

from gamms.arguments import add_attributes

SRC = Path(__file__).parent.parent / "src"

_SECTIONS = ("Args", "Attributes", "Ensures", "Raises", "Requires", "Returns", "Yields")
_SECTION = re.compile(rf"^((?:{'|'.join(_SECTIONS)})(?: \([^)]*\))?):(.*)$")
_NAMED = r"[\w*][\w.* ]*?(?: \([\w ]+\))?"
_ITEM = re.compile(rf"^({_NAMED}(?:, {_NAMED})*): (.*)$")
_INITS = ("__init__", "__new__")
PARAGRAPH = "\n\n"
_Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Assign | ast.AnnAssign


class Found(NamedTuple):
    """Where a public name is defined."""

    module: str  # the whole module, if `node` is one
    node: ast.AST


@cache
def packages() -> list[str]:
    """Return the public packages: those that `gamms` offers, itself first."""
    modules = next(
        node for node in tree_of("gamms").body if isinstance(node, ast.Assign) and _target_of(node) == "_MODULES"
    )
    names = sorted(node.value for node in ast.walk(modules.value) if isinstance(node, ast.Constant))
    return ["gamms", *(f"gamms.{name}" for name in names)]


@cache
def tree_of(module: str) -> ast.Module:
    """Return the syntax tree of a module."""
    return syntax.tree_of(_file_of(module))


@cache
def _lines_of(module: str) -> list[str]:
    return _file_of(module).read_text(encoding="utf-8").splitlines()


def _file_of(module: str) -> Path:
    path = SRC.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@cache
def names_of(module: str) -> list[str]:
    """Return the public names of a module."""
    body = tree_of(module).body
    for node in body:
        if isinstance(node, ast.Assign) and _target_of(node) == "__all__":
            return list(ast.literal_eval(node.value))
    names = [node.name for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    return [name for name in names if not name.startswith("_")]


@cache
def find(module: str, name: str) -> Found:
    """Return where a name that a module defines or imports is defined.

    Raises:
        LookupError: it is not in the source.
    """
    defined, imported = _index_of(module)
    if name in defined:
        return Found(module, defined[name])
    if name in imported:
        above, original = imported[name]
        inner = f"{above}.{original}"
        return Found(inner, tree_of(inner)) if _file_of(inner).exists() else find(above, original)
    raise LookupError(f"{module} offers {name}, which is not in the source of GAMMS")


@cache
def _index_of(module: str) -> tuple[dict[str, ast.AST], dict[str, tuple[str, str]]]:
    """Return what a module defines, and what it imports from which other module of GAMMS."""
    tree = tree_of(module)
    checked = [node for one in tree.body if isinstance(one, ast.If) for node in one.body]  # `if TYPE_CHECKING:`
    imports = [
        node
        for node in [*tree.body, *checked]
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gamms")
    ]
    imported = {one.asname or one.name: (str(node.module), one.name) for node in imports for one in node.names}
    defined: dict[str, ast.AST] = {_name_of(node): node for node in tree.body if _name_of(node)}
    for node in tree.body:
        if isinstance(node, ast.Assign) and len(node.targets) > 1:  # other names of one thing: a = b = thing
            others = {one.id: node.value for one in node.targets if isinstance(one, ast.Name)}
            defined |= {name: defined.get(ast.unparse(value), node) for name, value in others.items()}
    return defined, imported


@cache
def _find_below(module: str, name: str) -> Found:
    """Return where a name is defined that a package loads when it is first used."""
    for path in sorted(_file_of(module).parent.rglob("*.py")):
        inner = ".".join(path.relative_to(SRC).with_suffix("").parts)
        if path.name != "__init__.py" and name in _index_of(inner)[0]:
            return find(inner, name)
    raise LookupError(f"{module} offers {name}, which is not in the source of GAMMS")


def found_as(module: str, name: str) -> Found | None:
    """Return where a public name is defined; None for one of the standard library."""
    for search in (find, _find_below):
        with contextlib.suppress(LookupError):
            return search(module, name)
    return None


@cache
def owner_of(found: Found, name: str) -> str | None:
    """Return the public package that has the entry of a definition: the one where it is defined, else the first."""
    inside = [one for one in packages()[1:] if f"{found.module}.".startswith(f"{one}.")]
    return next(iter(inside), None) or next((one for one in packages()[1:] if name in names_of(one)), None)


@cache
def examples_in(package: str) -> list[tuple[list[str], str]]:
    """Return the sections of the page of examples of a package: the names of its heading, and the text below it."""
    page = pages.EXAMPLES / f"{package}.md"
    parts = re.split(r"^## (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE) if page.exists() else []
    return [(heading.split(", "), text.strip()) for heading, text in zip(parts[1::2], parts[2::2], strict=True)]


def examples_of(module: str, name: str) -> str:
    """Return the examples of a public name, and links to the pages whose programs use it."""
    sections = [text.replace("](../../", "](../") for names, text in examples_in(module) if name in names]
    return PARAGRAPH.join([*sections, _pages_with(module, name)]).strip()


def _pages_with(module: str, name: str) -> str:
    """Return links to the pages whose programs use a public name, three at most."""
    last = module.rpartition(".")[2]
    used = re.compile(rf"\b{last}[.:]{name}\b|from {re.escape(module)} import (?:\w+, )*{name}\b")
    found = [(title, path) for title, path, code in _programs() if name in code and used.search(code)]
    found = sorted(found, key=lambda one: last not in one[1])[:3]  # the page of the package first
    links = ", ".join(f"[{title}](../{path})" for title, path in found)
    return f"Used in: {links}." if found else ""


@cache
def _programs() -> list[tuple[str, str, str]]:
    """Return the title, the path and the code of each page that has programs."""
    named = [
        (page, "\n".join(fence.code for fence in pages.fences_of(page)))
        for page in pages.all_pages()
        if page.stem not in {"README", "index"} and page.parent != pages.EXAMPLES
    ]
    titles = {page: re.search(r"^# (.+)$", pages.prose_of(page), re.MULTILINE) for page, code in named if code}
    return [
        (titles[page][1], page.relative_to(pages.DOCS).as_posix(), code) for page, code in named if titles.get(page)
    ]


def page_of(module: str) -> str:
    """Return the page of a package, in Markdown with directives of the Python domain."""
    entries = "\n".join(_entry(module, name) for name in sorted(names_of(module), key=str.lower))
    docs = (ast.get_docstring(tree_of(module)) or "").split("\n\n")
    shown = [docs[0], *takewhile(lambda part: part.startswith("    "), docs[1:])]
    return f"# {module}\n\n{markdown_of(PARAGRAPH.join(shown))}\n\n{entries}"


def docstring_of(found: Found) -> str:
    """Return the docstring of a definition; for a value, the text below it or the comment beside it."""
    if isinstance(found.node, ast.FunctionDef | ast.AsyncFunctionDef):
        return _docstring_of_function(found)
    if isinstance(found.node, ast.Module | ast.ClassDef):
        return ast.get_docstring(found.node) or ""
    return _text_at(found, tree_of(found.module).body)


def _docstring_of_function(found: Found) -> str:
    """Return the docstring that a function has at run time, where `as_declared` and `spell_out_options` complete it."""
    text, keywords = ast.get_docstring(found.node) or "", found.node.args.kwarg
    for mark in (one for one in found.node.decorator_list if isinstance(one, ast.Call)):
        match ast.unparse(mark.func):
            case "as_declared":
                method = mark.args[0]
                contract = find(found.module, method.value.id)
                declared = next(one for one in contract.node.body if _name_of(one) == method.attr)
                return _docstring_of_function(Found(contract.module, declared))
            case "spell_out_options" if isinstance(keywords.annotation, ast.Subscript):
                options = find(found.module, ast.unparse(keywords.annotation.slice))
                text = add_attributes(text, keywords.arg, _docstrings_of(options))
    return text


def _docstrings_of(options: Found) -> Iterator[str]:
    """Yield the docstrings of a TypedDict, after those of the ones that it inherits from."""
    for base in options.node.bases:
        if ast.unparse(base) != "TypedDict":
            yield from _docstrings_of(find(options.module, ast.unparse(base)))
    yield docstring_of(options)


def _text_at(found: Found, body: list[ast.stmt]) -> str:
    """Return the text below a value, or the comment beside it."""
    after = body[body.index(found.node) + 1 :][:1] if found.node in body else []
    if after and isinstance(after[0], ast.Expr) and isinstance(after[0].value, ast.Constant):
        return inspect.cleandoc(after[0].value.value)
    return _comment_at(found)


def _comment_at(found: Found) -> str:
    line = _lines_of(found.module)[found.node.end_lineno - 1]
    behind = line.encode()[found.node.end_col_offset :].decode().strip()
    opening = re.search(r"[\[({]\s+(# .*)$", _lines_of(found.module)[found.node.lineno - 1])
    comment = behind if behind.startswith("#") or not opening else opening[1]
    return comment.lstrip("# ") if comment.startswith("#") and "noqa" not in comment else ""


def described_in(module: str, name: str) -> str:
    """Return the package that has the entry of a public name: `module`, or that which owns the definition."""
    found = found_as(module, name)
    home = owner_of(found, name) if found else None
    return home if home and (found.module == home or name in names_of(home)) else module


def _entry(module: str, name: str) -> str:
    found, home = found_as(module, name), described_in(module, name)
    if home != module:
        return f"* `{name}`: see [`{home}`]({home}.md)\n"
    if found is None:
        return _directive("py:data", name, "", _in(module), examples_of(module, name))
    match found.node:
        case ast.Module():
            inner = [_entry(found.module, one) for one in names_of(found.module)]
            head = _directive("py:module", found.module, docstring_of(found), [], examples_of(module, name))
            return head + "\n" + "\n".join(inner)
        case ast.ClassDef():
            return _class(module, name, found)
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            signatures = _signatures(found, name, tree_of(found.module).body)
            return _directive("py:function", signatures, docstring_of(found), _in(module), examples_of(module, name))
        case _:
            options = [*_in(module), *_value_of(found.node)]
            return _directive("py:data", name, docstring_of(found), options, examples_of(module, name))


def _value_of(node: ast.Assign | ast.AnnAssign) -> list[str]:
    value = ast.unparse(node.value) if node.value and not isinstance(node.value, ast.Call) else ""
    return [f":value: {value}"] if value and len(value) < 100 and "lambda" not in value else []


def _in(module: str) -> list[str]:
    return [f":module: {module}"]


def _class(module: str, name: str, found: Found) -> str:
    docs, members = docstring_of(found), list(_members(found))
    inner = PARAGRAPH.join(part for part in (_bases_of(found), examples_of(module, name)) if part) + PARAGRAPH
    above = [docstring_of(one) for one in _lineage(found)[1:]]
    inner += "\n".join(
        _member(one, body, "" if f"{_name_of(one.node)}:" in docs else _said_of(_name_of(one.node), above))
        for one, body in members
    )
    constructor = next(_inits(found), None)
    signature = _signatures(constructor[0], name, constructor[1]) if constructor else name
    return _directive("py:class", signature, docs, _in(module), inner)


def _bases_of(found: Found) -> str:
    """Return a line with the classes that a class is derived from: public ones, and those of Python itself."""
    shown = []
    for text in (ast.unparse(base.value if isinstance(base, ast.Subscript) else base) for base in found.node.bases):
        with contextlib.suppress(LookupError):  # a class of another library
            module, name = _split(found, text) if "." in text else (found.module, text)
            home = owner_of(find(module, name), name)
            shown += [f"{{py:class}}`~{home}.{name}`"] if home and name in names_of(home) else []
        shown += [f"`{text}`"] if hasattr(builtins, text) else []
    return f"Bases: {', '.join(shown)}." if shown else ""


def _inits(found: Found) -> Iterator[tuple[Found, list[ast.stmt]]]:
    for one in _lineage(found):
        inits = [node for node in one.node.body if _name_of(node) in _INITS] or _init_of_fields(one.node)
        yield from ((Found(one.module, node), one.node.body) for node in inits[-1:])


def _init_of_fields(node: ast.ClassDef) -> list[ast.stmt]:
    """Return the constructor that Python gives to a dataclass and a named tuple; nothing for other classes."""
    marks = " ".join(ast.unparse(one) for one in [*node.decorator_list, *node.bases])
    if not re.search(r"\bdataclass\b|\bNamedTuple\b", marks):
        return []
    fields = [one for one in node.body if isinstance(one, ast.AnnAssign) and "ClassVar" not in ast.unparse(one)]
    given = [
        f"{_name_of(one)}: {ast.unparse(one.annotation)}{_default_of(one)}"
        for one in fields
        if "init=False" not in ast.unparse(one)
    ]
    keywords = ["*"] if "kw_only=True" in marks and given else []
    return ast.parse(f"def __init__({', '.join(['self', *keywords, *given])}): ...").body


def _default_of(field: ast.AnnAssign) -> str:
    """Return the default of a field; dots for one that is made for each object."""
    return (
        "" if field.value is None else f" = {'...' if isinstance(field.value, ast.Call) else ast.unparse(field.value)}"
    )


def _lineage(found: Found) -> list[Found]:
    """Return a class and the classes of GAMMS that it inherits from."""
    line = [found]
    for base in found.node.bases:
        named = base.value if isinstance(base, ast.Subscript) else base
        text = ast.unparse(named)
        try:
            above = find(found.module, text) if isinstance(named, ast.Name) else find(*_split(found, text))
        except (LookupError, OSError):
            continue  # a class of the standard library, or of another package
        if isinstance(above.node, ast.ClassDef):
            line += _lineage(above)
    return [one for i, one in enumerate(line) if one not in line[i + 1 :]]  # as Python orders them: bases of bases last


def _split(found: Found, text: str) -> tuple[str, str]:
    module, _, name = text.rpartition(".")
    return find(found.module, module.split(".")[0]).module, name


def _members(found: Found) -> Iterator[tuple[Found, list[ast.stmt]]]:
    """Yield the public members of a class with the body where each is, its own before those that it inherits."""
    seen = set()
    for one in _lineage(found):
        for node in one.node.body:
            name = _name_of(node)
            is_setter = isinstance(node, ast.FunctionDef) and any(
                ast.unparse(mark).endswith((".setter", ".deleter")) or "overload" in ast.unparse(mark)
                for mark in node.decorator_list
            )
            if name and not name.startswith("_") and name not in seen and not is_setter:
                seen.add(name)
                yield _forwarded(one.module, node) or (Found(one.module, node), one.node.body)


def _forwarded(module: str, node: ast.AST) -> tuple[Found, list[ast.stmt]] | None:
    """Return the method that an attribute calls, `x = forwarded(Graph.x)` or `x = _of("part", Part.x)`, and its body.

    It has the name of the attribute.
    """
    call = node.value if isinstance(node, ast.Assign) else None
    verb = call.args[-1] if isinstance(call, ast.Call) and call.args else None
    if not isinstance(verb, ast.Attribute) or not isinstance(verb.value, ast.Name):
        return None
    for owner in _lineage(find(module, verb.value.id)):
        for one in owner.node.body:
            if _name_of(one) == verb.attr:
                own = copy.copy(one)
                own.name = _target_of(node)
                return Found(owner.module, own), owner.node.body
    return None


def _said_of(name: str, docs: list[str]) -> str | None:
    """Return what docstrings of classes say of an attribute; None: nothing."""
    said = (re.search(rf"^    {name}: (.*(?:\n {{5,}}.*)*)", one, re.MULTILINE) for one in docs)
    return next((" ".join(one[1].split()) for one in said if one), None)


def _member(found: Found, scope: list[ast.stmt], said: str | None) -> str:
    node, name = found.node, _name_of(found.node)
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        marks = {ast.unparse(mark) for mark in node.decorator_list}
        if marks & {"property", "cached_property"}:
            kind = [f":type: {_qualified(node.returns, found.module).strip(chr(39))}"] if node.returns else []
            return _directive("py:property", name, docstring_of(found), kind)
        return _directive("py:method", _signatures(found, name, scope), docstring_of(found), [])
    if isinstance(node, ast.ClassDef):
        return _directive("py:class", name, docstring_of(found), [])
    kind = [f":type: {_qualified(node.annotation, found.module)}"] if isinstance(node, ast.AnnAssign) else []
    text = _text_at(found, scope) if said is None else said
    return _directive("py:attribute", name, text, kind + _value_of(node))


def _signatures(found: Found, name: str, scope: list[ast.stmt]) -> str:
    """Return the signature of a function as it is written; one a line where it has several."""
    same = [one for one in scope if isinstance(one, ast.FunctionDef) and one.name == _name_of(found.node)]
    several = [one for one in same if any("overload" in ast.unparse(mark) for mark in one.decorator_list)]
    return "\n".join(_signature(one, name, found.module) for one in several or [found.node])


def _offers(package: str | None, name: str, found: Found) -> bool:
    return package is not None and name in names_of(package) and found_as(package, name) == found


class _Qualifier(ast.NodeTransformer):
    """Names types of GAMMS by the package that has their entry, so that the site links to them."""

    def __init__(self, module: str) -> None:
        self.module = module

    def visit_arg(self, node: ast.arg) -> ast.arg:
        return ast.arg(node.arg, node.annotation and self.visit(node.annotation))

    def visit_Name(self, node: ast.Name) -> ast.Name:
        with contextlib.suppress(LookupError):
            found = find(self.module, node.id)
            name = _name_of(found.node) or node.id
            offering = [one for one in packages() if name in names_of(one)]
            home = next((one for one in (owner_of(found, name), *offering) if _offers(one, name, found)), None)
            if isinstance(found.node, ast.Module):
                return ast.Name(found.module)
            if home or offering:  # without its module, the site would link to another class of this name
                return ast.Name(f"{home or found.module}.{name}")
        return node


def _qualified(node: ast.AST, module: str) -> str:
    return ast.unparse(_Qualifier(module).visit(copy.deepcopy(node)))


def _signature(node: ast.FunctionDef, name: str, module: str) -> str:
    given = re.sub(r"^(self|cls)(, /)?(, |$)", "", _qualified(node.args, module))
    returns = f" -> {_qualified(node.returns, module)}" if node.returns and node.name not in _INITS else ""
    return f"{name}({given}){returns}".replace("\n", " ")


def _directive(kind: str, head: str, docs: str, options: list[str], inner: str = "") -> str:
    fence = ":" * (6 if kind in {"py:class", "py:module"} and inner else 4)
    *others, last = head.splitlines()  # a directive of MyST has one signature: the last one gets the text
    heads = [part for one in others for part in (f"::::{{{kind}}} {one}", *options, ":no-index:", "::::", "")]
    body = "\n\n".join(part for part in (markdown_of(docs), inner.strip()) if part)
    return "\n".join([*heads, f"{fence}{{{kind}}} {last}", *options, "", body, fence, ""])


def markdown_of(docs: str) -> str:
    """Return a docstring as Markdown: its sections as lists, its indented examples as code."""
    lines, out = docs.splitlines(), []
    i = 0
    while i < len(lines):
        section = _SECTION.match(lines[i])
        block, after = _indented(lines, i + 1) if section or not lines[i].strip() else ([], i)
        if section:
            out += ["", f"**{section[1]}:**{section[2]}", "", *_items(block)]
            i = after
        elif block and not lines[i].strip():
            out += ["", "```python", *block, "```", ""]
            i = after
        else:
            out.append(lines[i])
            i += 1
    return "\n".join(out).strip()


def _indented(lines: list[str], start: int) -> tuple[list[str], int]:
    end = start
    while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
        end += 1
    while end > start and not lines[end - 1].strip():
        end -= 1
    return textwrap.dedent("\n".join(lines[start:end])).splitlines(), end


def _items(block: list[str]) -> list[str]:
    out = []
    for line in block:
        item = _ITEM.match(line)
        if item:
            out.append(f"* **{item[1].replace('*', chr(92) + '*')}**: {item[2]}")
        else:
            out.append(f"  {line.strip()}" if out else line)
    return out


def _target_of(node: ast.Assign) -> str:
    return node.targets[0].id if isinstance(node.targets[0], ast.Name) else ""


def _name_of(node: ast.AST) -> str:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return node.name
    if isinstance(node, ast.Assign):
        return _target_of(node)
    return node.target.id if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) else ""
