"""Tables of statistics: columns that print, and that LaTeX sets."""

from itertools import chain
from typing import Any

import numpy as np

from gamms.ir.tables import table_of
from gamms.text import printable_line

_SPECIAL = {
    "\\": r"\textbackslash{}",
    **{one: f"\\{one}" for one in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
}


class Table(dict[str, Any]):
    """Columns of equal length; `print` shows them, and `latex` sets them."""

    @classmethod
    def of(cls, rows: list[dict[str, Any]]) -> "Table":
        """Return a table of rows."""
        return cls(table_of(rows))

    def __str__(self) -> str:
        """Return the columns, aligned."""
        lines = [list(self), *self._cells("g", ".4")]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        is_number = [column.dtype.kind in "if" for column in self.values()]
        return "\n".join(
            "  ".join(
                cell.rjust(width) if right else cell.ljust(width)
                for cell, width, right in zip(line, widths, is_number, strict=True)
            ).rstrip()
            for line in lines
        )

    def latex(self, *, caption: str = "", label: str = "", digits: int = 2) -> str:
        """Return a table of LaTeX for the package booktabs; an interval stands behind its value.

        Args:
            caption: of the table; "" leaves it out.
            label: by which the text refers to it; "" leaves it out.
            digits: behind the point of numbers that are not whole.
        """
        names = [name for name in self if name not in ("low", "high")]
        has_interval = len(names) < len(self) - 1
        of_value = list(self)[list(self).index("low") - 1] if has_interval else None
        lines = []
        for cells in self._cells("f", f".{digits}"):
            row = dict(zip(self, cells, strict=True))
            if of_value is not None:
                row[of_value] += f" [{row['low']}, {row['high']}]"
            lines.append(" & ".join(_escaped(row[name]) for name in names) + r" \\")
        kinds = "".join("r" if self[name].dtype.kind in "if" else "l" for name in names)
        parts = [
            [r"\begin{table}", r"\centering"],
            [rf"\caption{{{_escaped(caption)}}}"] if caption else [],
            [rf"\label{{{label}}}"] if label else [],
            [rf"\begin{{tabular}}{{{kinds}}}", r"\toprule", " & ".join(map(_escaped, names)) + r" \\", r"\midrule"],
            lines,
            [r"\bottomrule", r"\end{tabular}", r"\end{table}", ""],
        ]
        return "\n".join(chain.from_iterable(parts))

    def _cells(self, kind: str, digits: str) -> list[list[str]]:
        """Return the rows as texts; floats of a format."""
        rows = zip(*(column.tolist() for column in self.values()), strict=True)
        return [[_shown(one, kind, digits) for one in row] for row in rows]


def _shown(value: object, kind: str, digits: str) -> str:
    if isinstance(value, float):
        return "-" if np.isnan(value) else format(value, f"{digits}{kind}")
    return "-" if value is None else printable_line(str(value))


def _escaped(text: str) -> str:
    return "".join(_SPECIAL.get(one, one) for one in text)
