"""Values of nodes or edges, such as a heat map: which number belongs to what, and in which colours it is shown."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.graph import FloatArray, IntArray
from gamms.text import shown
from gamms.visual.color import DIVERGING, LEVELS, Colorize, Rgb, colorized, levels, rgba, table
from gamms.visual.legend import Bar, Block, Row, Rows

_FEW_COLORS = 8  # so many different ones are explained one by one
_STEPS = 64  # of a bar
_HUNDRED, _HUGE = 100.0, 1e7


@dataclass(frozen=True, eq=False)
class Values:
    """What is drawn: ids with their places among a few colours; what has no value (NaN) is not in it.

    Attributes:
        of: "nodes" or "edges".
        ids: (values,)
        colors: the different colours, from low to high.
        places: (values,) of each value's colour among `colors`.
        legend: the bar or the rows that explain the colours; None where there is nothing to explain.
    """

    of: str
    ids: IntArray
    colors: tuple[Rgb, ...]
    places: IntArray
    legend: Block | None


def checked(
    of: str,
    given: Mapping[int, float],
    known: IntArray,
    cmap: str | Colorize,
    span: tuple[float | None, float | None],
    title: str,
) -> Values:
    """What a caller gave, checked and in colours.

    Args:
        of: "nodes" or "edges".
        given: id -> value; NaN leaves it out.
        known: all ids there are.
        cmap: the name of a colour map, or a function from a value to a colour.
        span: the lowest and the highest value of the map; None takes it from the values.
        title: of the legend.

    Raises:
        BadType, BadValue: not a mapping to numbers, a function that gives no colour, or an impossible span.
        UnknownName (KeyError): no such node or edge, or no such colour map.
    """
    if not isinstance(given, Mapping):
        raise BadType(f"{of} must be a mapping from ids to values, not {shown(given)} ({type(given).__name__}).")
    ids = np.array([as_int(id, f"An id of {of}") for id in given], np.int64)
    strange = ids[~np.isin(ids, known)].tolist()
    if strange:
        raise UnknownName(of.removesuffix("s"), strange[0])
    values = _numbers(given.values(), of)
    is_shown = ~np.isnan(values)
    ids, values = ids[is_shown], values[is_shown]
    if callable(cmap):
        colors, places = colorized(cmap, values)
        low, high = _span(values, span)
        return Values(of, ids, tuple(colors), places, _key_of_function(cmap, values, low, high, title))
    colors, (low, high) = list(table(cmap)), _span(values, span, is_even=cmap == DIVERGING)
    bar = _bar(title, colors, low, high) if len(values) else None
    return Values(of, ids, tuple(colors), levels(values, low, high), bar)


def _numbers(values: Iterable[Any], of: str) -> FloatArray:
    """Numbers, NaN and infinite ones among them."""
    found = list(values)
    if not all(type(value) in (float, int) for value in found):
        found = [value if _is_endless(value) else as_float(value, f"A value of {of}") for value in found]
    try:
        return np.array(found, float)
    except OverflowError:
        raise BadValue(f"A value of {of} is too large for a float.") from None


def _is_endless(value: Any) -> bool:
    return isinstance(value, float | np.floating) and not np.isfinite(value)


def _span(values: FloatArray, span: tuple[float | None, float | None], *, is_even: bool = False) -> tuple[float, float]:
    """The values at both ends of the map: the given ones, or those of the finite values.

    Raises:
        BadValue: the lower one is not below the higher.
    """
    given = tuple(
        None if end is None else as_float(end, name) for name, end in zip(("vmin", "vmax"), span, strict=True)
    )
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    if is_even and given == (None, None):
        farthest = max(abs(low), abs(high))
        return -farthest, farthest
    low, high = low if given[0] is None else given[0], high if given[1] is None else given[1]
    if given != (None, None) and low >= high:
        raise BadValue(f"The colours need vmin below vmax, not from {low:g} to {high:g}.")
    return low, high


def _key_of_function(colorize: Colorize, values: FloatArray, low: float, high: float, title: str) -> Block | None:
    distinct = np.unique(values)
    if len(distinct) == 0:
        return None
    if len(distinct) <= _FEW_COLORS:
        return Rows(title, tuple(Row(rgba(colorize(value))[:3], f"{value:g}") for value in distinct.tolist()))
    shown = distinct[np.rint(np.linspace(0, len(distinct) - 1, min(_STEPS, len(distinct)))).astype(int)]
    if (
        np.isfinite(distinct).all() and high > low
    ):  # at even steps, for each step it asks for the nearest value there is
        wanted = np.linspace(low, high, _STEPS)
        shown = distinct[np.abs(distinct[:, None] - wanted).argmin(axis=0)]
    return _bar(title, [rgba(colorize(value))[:3] for value in shown.tolist()], low, high)


def _bar(title: str, colors: list[Rgb], low: float, high: float) -> Block:
    if high <= low:
        return Rows(title, (Row(colors[LEVELS // 2 if len(colors) == LEVELS else 0], f"{low:g}"),))
    thinned = [colors[place] for place in np.rint(np.linspace(0, len(colors) - 1, _STEPS)).astype(int).tolist()]
    return Bar(title, tuple(thinned), *map(_tick, (low, (low + high) / 2, high)))


def _tick(value: float) -> str:
    """A number in three digits, or in all of a large integer's."""
    return f"{value:.0f}" if _HUNDRED <= abs(value) < _HUGE else f"{value:.3g}"
