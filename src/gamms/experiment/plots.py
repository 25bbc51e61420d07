"""Plots of rows, with matplotlib."""

from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.experiment.statistics import Interval
from gamms.extras import needing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_APART = 0.12  # of the places of categories, between series


def plot(x: str, y: str, hue: str | None, series: dict[Any, list[tuple[Any, Interval]]], ax: "Axes | None") -> "Axes":
    """Draw the means of series with their intervals.

    Args:
        x: name of the horizontal axis.
        y: name of the vertical axis.
        hue: name of what the series differ in; None: there is one.
        series: of each, its values of x and intervals.
        ax: where; None: a figure of its own.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    with needing("A plot", "plot"):
        import matplotlib.pyplot as plt
    axes: Axes = plt.subplots(layout="constrained")[1] if ax is None else ax
    places = list(dict.fromkeys(at for points in series.values() for at, _ in points))
    is_number = all(isinstance(at, (int, float)) and not isinstance(at, bool) for at in places)
    for number, (name, points) in enumerate(series.items()):
        ordered = sorted(points, key=lambda point: point[0]) if is_number else points
        aside = _APART * (number - (len(series) - 1) / 2)  # series beside each other, where x has categories
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
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if hue is not None:
        axes.legend(title=hue)
    return axes
