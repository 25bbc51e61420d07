"""Tables of statistics, printed or as LaTeX, and plots with matplotlib."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import UnknownName
from gamms.experiment.statistics import Interval
from gamms.ir.tables import make_table
from gamms.plugins import require_extra
from gamms.text import make_printable_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NOTHING = "-"
_SPECIAL = {
    "\\": r"\textbackslash{}",
    **{one: f"\\{one}" for one in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
}


class Table(dict[str, Any]):
    """Columns of equal length; `print` shows them, and `latex` returns them as a LaTeX table.

    Attributes:
        notes: sentences that are printed below the columns.
        least: column -> the least value that its method can give; numbers up to it are printed as "< 0.0002".
        unit: a sentence about the unit of replication, which `latex` adds below the table; "" omits it.
    """

    def __init__(
        self,
        columns: Mapping[str, Any],
        *,
        notes: Sequence[str] = (),
        least: Mapping[str, float] | None = None,
        unit: str = "",
    ) -> None:
        super().__init__(columns)
        self.notes = list(notes)
        self.least = dict(least or {})
        self.unit = unit

    def __missing__(self, column: object) -> Any:
        raise UnknownName("column", column, self)

    @classmethod
    def of(
        cls,
        rows: list[dict[str, Any]],
        *,
        notes: Sequence[str] = (),
        least: Mapping[str, float] | None = None,
        unit: str = "",
    ) -> "Table":
        """Return a table of rows."""
        return cls(make_table(rows), notes=notes, least=least, unit=unit)

    def __str__(self) -> str:
        """Return the columns, aligned."""
        lines = [list(self), *self._format_cells("g", ".4")]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        is_number = [column.dtype.kind in "if" for column in self.values()]
        aligned = [
            "  ".join(
                cell.rjust(width) if right else cell.ljust(width)
                for cell, width, right in zip(line, widths, is_number, strict=True)
            ).rstrip()
            for line in lines
        ]
        return "\n".join([*aligned, *self.notes])

    def latex(self, *, caption: str = "", label: str = "", digits: int = 2) -> str:
        """Return a LaTeX table for the package booktabs; intervals follow their values, notes and the unit are below.

        Student's intervals, where a table has them, are the column `t`.

        Args:
            caption: the caption; "" omits it.
            label: the label for references; "" omits it.
            digits: the number of decimals of fractional numbers.
        """
        names = [name for name in self if name not in ("low", "high", "t_high")]
        has_interval = "low" in self and "high" in self
        of_value = list(self)[list(self).index("low") - 1] if has_interval else None
        lines = []
        for cells in self._format_cells("f", f".{digits}"):
            row = dict(zip(self, cells, strict=True))
            if of_value is not None and row["low"] != _NOTHING:
                row[of_value] += f" [{row['low']}, {row['high']}]"
            if row.get("t_low", _NOTHING) != _NOTHING:
                row["t_low"] = f"[{row['t_low']}, {row['t_high']}]"
            lines.append(" & ".join(_escape_text(row[name]) for name in names) + r" \\")
        titles = ["t" if name == "t_low" else name for name in names]
        kinds = "".join("r" if self[name].dtype.kind in "if" else "l" for name in names)
        parts = [
            [r"\begin{table}", r"\centering"],
            [rf"\caption{{{_escape_text(caption)}}}"] if caption else [],
            [rf"\label{{{label}}}"] if label else [],
            [
                rf"\begin{{tabular}}{{{kinds}}}",
                r"\toprule",
                " & ".join(map(_escape_text, titles)) + r" \\",
                r"\midrule",
            ],
            lines,
            [r"\bottomrule", r"\end{tabular}"],
            [rf"\par\footnotesize {_escape_text(note)}" for note in [*self.notes, *filter(None, [self.unit])]],
            [r"\end{table}", ""],
        ]
        return "\n".join(chain.from_iterable(parts))

    def _format_cells(self, kind: str, digits: str) -> list[list[str]]:
        """Return the rows as texts; floats are formatted."""
        columns = []
        for name, column in self.items():
            least = self.least.get(name)
            columns.append([_format_value(one, kind, digits, least) for one in column.tolist()])
        return [list(row) for row in zip(*columns, strict=True)]


def _format_value(value: object, kind: str, digits: str, least: float | None) -> str:
    if value is None:
        return _NOTHING
    if not isinstance(value, float):
        return make_printable_line(str(value))
    if np.isnan(value):
        return _NOTHING
    if least is not None and value <= least * (1.0 + 1e-9):
        return f"< {least:.4g}"
    return format(value, f"{digits}{kind}")


def _escape_text(text: str) -> str:
    return "".join(_SPECIAL.get(one, one) for one in text)


_APART = 0.12  # offset between series of a category


_WORDS = {  # the first part of a column or varied key -> its words on an axis
    "wins": "share of games won by {}",
    "score": "score of {}",
    "alive": "{}: agents alive",
    "strategies": "strategy of {}",
}


def describe_key(key: str) -> str:
    """Return the words of a column or varied key on an axis: "red: count" for `teams.red.count`."""
    first, _, rest = key.partition(".")
    words = _WORDS.get(first, "{}").format(rest) if rest else first
    return words.replace(".", ": ", 1).replace("_", " ")


def plot(
    x: str,
    y: str,
    hue: str | None,
    series: dict[Any, list[tuple[Any, Interval]]],
    ax: "Axes | None",
    notes: Sequence[str],
) -> "Axes":
    """Draw the means of series with their intervals.

    Args:
        x: the label of the horizontal axis.
        y: the label of the vertical axis.
        hue: the title of the legend; None: there is only one series.
        series: the values of x and the intervals of each series.
        ax: the axes to draw on; None: a new figure.
        notes: sentences above the axes.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    with require_extra("A plot", "plot"):
        import matplotlib.pyplot as plt
        from matplotlib.ticker import MaxNLocator
    axes: Axes = plt.subplots(layout="constrained")[1] if ax is None else ax
    places = list(dict.fromkeys(at for at, _ in chain.from_iterable(series.values())))
    is_number = all(isinstance(at, (int, float)) and not isinstance(at, bool) for at in places)
    for number, (name, points) in enumerate(series.items()):
        ordered = sorted(points, key=lambda point: point[0]) if is_number else points
        aside = _APART * (number - (len(series) - 1) / 2)  # series side by side, if x has categories
        at = [one if is_number else places.index(one) + aside for one, _ in ordered]
        means = np.array([interval for _, interval in ordered], float)  # (points, 3)
        errors = np.abs(means[:, [1, 2]].T - means[:, 0])
        line = "-" if is_number else "none"
        axes.errorbar(
            at, means[:, 0], errors, marker="o", linestyle=line, capsize=3, label=None if hue is None else str(name)
        )
    if not is_number:
        axes.set_xticks(range(len(places)), [str(at) for at in places])
        axes.margins(x=0.2)
    elif all(isinstance(at, int) for at in places):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel(describe_key(x))
    axes.set_ylabel(describe_key(y))
    if hue is not None:
        axes.legend(title=describe_key(hue))
    if notes:
        axes.set_title("\n".join(notes), fontsize="small")
    return axes
