"""How many lines of code a game has: without blank lines, comments, docstrings and what calls it as a program."""

import ast
import io
import tokenize

_NO_CODE = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def code_lines(path):
    """Return the number for a file of Python; of any other kind, lines that are neither blank nor comments."""
    text = path.read_text()
    if "py" not in path.name.split("."):
        return sum(1 for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#"))
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node) is not None:
            lines -= set(range(node.body[0].lineno, node.body[0].end_lineno + 1))
        if isinstance(node, ast.If) and "__name__" in ast.unparse(node.test):
            lines -= set(range(node.lineno, node.end_lineno + 1))
    return len(lines)
