"""From the tags of a building to its walls: from what height to what height, and of which type."""

import re
from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue
from gamms.text import shown

HeightEstimates = Mapping[tuple[str, str], tuple[float, int]]  # (key, value or "*") -> (height in metres, type)
TagFilter = Mapping[str, bool | str | Iterable[str]]  # key -> True for every value, or the values

ANY = "*"
_LEVEL_M = 3.0
_FOOT_M = 0.3048
_TALLEST_M = 1000.0  # what is taller is a slip of the pen
_NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:[.,][0-9]+)?|[.,][0-9]+)")
_FEET = ("ft", "feet", "foot", "'")
_NO_WALLS = ("no", "roof", "carport", "proposed", "razed", "demolished")
_BURIED = ("underground", "underwater")


class Wall(NamedTuple):
    """What the walls around one footprint have in common."""

    base: float  # metres above the ground
    top: float  # metres above the ground
    type: int


class WallRules:
    """Which tagged things are walls, and how high: the two tables of a caller, checked.

    Args:
        tags: only things with one of these tags; None: all.
        estimates: (key, value) -> (height, type); `"*"` as the value stands for every other one. An exact row beats
            a `"*"`, and of several rows the later one counts.

    Raises:
        BadType, BadValue: a table is not of this form.
    """

    def __init__(self, tags: TagFilter | None, estimates: HeightEstimates) -> None:
        self._tags = None if tags is None else checked_filter(tags)
        self._estimates = _checked_estimates(estimates)
        self._rank = {row: rank for rank, row in enumerate(self._estimates)}
        self.keys = sorted({key for key, _ in self._estimates})

    def wall_of(self, tags: Mapping[str, str]) -> Wall | None:
        """Return the walls of a thing with these tags; None if it has none."""
        if tags.get("location") in _BURIED or not (self._tags is None or is_asked_for(tags, self._tags)):
            return None
        row = self._row_of(tags)
        if row is None:
            return None
        estimate, type = self._estimates[row]
        top = _measured(tags, "height", "building:levels") or estimate
        base = _measured(tags, "min_height", "building:min_level") or 0.0
        return Wall(base if base < top else 0.0, top, type)

    def _row_of(self, tags: Mapping[str, str]) -> tuple[str, str] | None:
        given = [(key, tags[key]) for key in self.keys if key in tags]
        exact = [row for row in given if row in self._rank]
        others = [(key, ANY) for key, value in given if value not in _NO_WALLS and (key, ANY) in self._rank]
        return max(exact or others, key=self._rank.__getitem__, default=None)


def _measured(tags: Mapping[str, str], metres: str, levels: str) -> float | None:
    """Return a height that the tags say, in metres or else in levels; None where they say nothing that can be true."""
    text = tags.get(metres, "").lower()
    unit = _FOOT_M if any(word in text for word in _FEET) else 1.0
    return _plausible(text, unit) or _plausible(tags.get(levels, ""), _LEVEL_M)


def _plausible(text: str, unit: float) -> float | None:
    found = _NUMBER.search(text)
    metres = float(found[0].replace(",", ".")) * unit if found else 0.0
    return metres if 0.0 < metres <= _TALLEST_M else None


# -- the tables of a caller -------------------------------------------------------------------------------------


def checked_filter(tags: object) -> dict[str, tuple[str, ...] | None]:
    """Return a caller's filter of tags: key -> the values, or None for any.

    Raises:
        BadType: it is not of this form.
    """
    if not isinstance(tags, Mapping):
        raise BadType(f"tags must be a dict such as {{'building': True}}, not {shown(tags)} ({type(tags).__name__}).")
    checked: dict[str, tuple[str, ...] | None] = {}
    for key, values in tags.items():
        if isinstance(key, str) and isinstance(values, bool):
            checked.update({key: None} if values else {})
            continue
        texts = (values,) if isinstance(values, str) else tuple(values) if isinstance(values, Iterable) else (None,)
        if not all(isinstance(text, str) for text in (key, *texts)):
            raise BadType(f"tags[{shown(key)}] must be True, a value or a list of values, not {shown(values)}.")
        checked[key] = texts
    return checked


def is_asked_for(tags: Mapping[str, str], wanted: Mapping[str, Collection[str] | None]) -> bool:
    """Return whether a thing has one of the wanted tags, given as `checked_filter` returns them."""
    return any(values is None or tags[key] in values for key, values in wanted.items() if key in tags)


def _checked_estimates(estimates: object) -> dict[tuple[str, str], tuple[float, int]]:
    if not isinstance(estimates, Mapping):
        raise BadType(f"height_estimates must be a dict, not {shown(estimates)}. Start from HEIGHT_ESTIMATES_TYPES.")
    checked: dict[tuple[str, str], tuple[float, int]] = {}
    for row, estimate in estimates.items():
        name = f"height_estimates[{shown(row)}]"
        if not (isinstance(row, tuple) and len(row) == 2 and all(isinstance(part, str) for part in row)):
            raise BadType(f"{name}: its key must be two strings such as ('building', 'house').")
        try:
            height, type = estimate
        except (TypeError, ValueError):
            raise BadType(f"{name} must be (height in metres, type), not {shown(estimate)}.") from None
        metres = as_float(height, f"The height in {name}")
        if metres <= 0.0:
            raise BadValue(f"The height in {name} must be more than 0 metres, not {metres}.")
        checked[row] = (metres, as_int(type, f"The type in {name}"))
    return checked
