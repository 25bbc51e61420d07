"""Samples of a space of settings: random, evenly spread, or for Sobol indices."""

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

from gamms.arguments import as_choice, as_count, as_float, as_int, as_mapping
from gamms.errors import BadValue
from gamms.experiment.statistics import sample_points
from gamms.ir.graph import FloatArray
from gamms.limits import refuse_above
from gamms.plain import Plain
from gamms.text import shown

Range = Sequence[Any] | Mapping[str, float]
METHODS = ("sobol", "latin", "random")
# bytes of a point, measured
_POINT_BYTES = 190
_NUMBER_BYTES = 42


class Sample(Sequence[dict[str, Plain]]):
    """Points of a space, for `vary`; each is a dict of key -> value.

    Attributes:
        keys: the keys of the space.
        n: see `sample`.
        method: see `sample`.
    """

    def __init__(self, keys: Sequence[str], n: int, method: str, points: Sequence[dict[str, Plain]]) -> None:
        self.keys = tuple(keys)
        self.n = n
        self.method = method
        self._points = list(points)

    def __len__(self) -> int:
        return len(self._points)

    def __getitem__(self, number: Any) -> Any:
        return self._points[number]

    def __repr__(self) -> str:
        return f"Sample({len(self)} points of {', '.join(self.keys)}, method={self.method!r})"


def sample(space: Mapping[str, Range], n: int, method: str = "sobol", *, seed: int = 0) -> Sample:
    """Return points of a space of settings, to be played as `vary`; the same seed gives the same points.

    Args:
        space: path in the scenario -> its range, `(low, high)` or `{"min": low, "max": high}`, both ends included, of
            integers if both are; or a list of values.
        n: the number of points; with "sobol" a power of two, which gives n * (keys + 2) points.
        method: "sobol" is the design of Saltelli et al. 2010, for `Rows.indices`; "latin" is a Latin hypercube, which
            spreads n points evenly along each key; "random" draws n points independently.
        seed: the seed of the points.

    Raises:
        BadType, BadValue: a range is not valid, or n is not a power of two.
        MissingExtra: SciPy is not installed, which "sobol" and "latin" need.
    """
    given = as_mapping(space, "space")
    if not given:
        raise BadValue("space has no keys: give each key that is varied a range.")
    ranges = {key: _check_range(key, one) for key, one in given.items()}
    count = as_count(n, "n")
    how = as_choice(method, "method", METHODS)
    is_sobol = how == "sobol"
    if is_sobol and count & (count - 1):
        raise BadValue(f"n must be a power of two for method='sobol', such as {1 << count.bit_length()}, not {count}.")
    size = len(ranges)
    rows = count * (size + 2 if is_sobol else 1)
    refuse_above(rows * (_POINT_BYTES + _NUMBER_BYTES * size), f"A sample of {count:,} points")
    unit = sample_points(count, 2 * size if is_sobol else size, how, as_int(seed, "seed"))
    blocks = _sample_saltelli(unit, size) if is_sobol else [unit]
    points = [
        {key: _find_value(one, float(share)) for (key, one), share in zip(ranges.items(), row, strict=True)}
        for row in chain.from_iterable(blocks)
    ]
    return Sample(list(ranges), count, how, points)


def _sample_saltelli(unit: FloatArray, size: int) -> list[FloatArray]:
    """Return the point sets A, B, and for each key A with that key taken from B."""
    first = unit[:, :size]
    second = unit[:, size:]
    mixed = []
    for key in range(size):
        points = first.copy()
        points[:, key] = second[:, key]
        mixed.append(points)
    return [first, second, *mixed]


def _check_range(key: str, given: object) -> tuple[float, float] | list[Any]:
    """Return the ends of a range, or the values of a list."""
    if isinstance(given, Mapping):
        if set(given) != {"min", "max"}:
            raise BadValue(f"The range of {shown(key)} is {{'min': …, 'max': …}}, not {shown(given)}.")
        given = given["min"], given["max"]
    if isinstance(given, list) and given:
        return given
    if not isinstance(given, tuple) or len(given) != 2:
        raise BadValue(f"The range of {shown(key)} is (low, high) or a list of values, not {shown(given)}.")
    low, high = (one if type(one) is int else as_float(one, f"Each end of the range of {shown(key)}") for one in given)
    if not low < high:
        raise BadValue(f"The range of {shown(key)} must grow, not go from {low} to {high}.")
    return low, high


def _find_value(of: tuple[float, float] | list[Any], share: float) -> Plain:
    """Return the value at a share of a range, 0 to 1."""
    if isinstance(of, list):
        return of[min(int(share * len(of)), len(of) - 1)]
    low, high = of
    if isinstance(low, int) and isinstance(high, int):
        return min(low + int(share * (high - low + 1)), high)
    return low + share * (high - low)
