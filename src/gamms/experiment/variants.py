"""The variants of a scenario in an experiment: their settings, and the names of these in rows."""

import json
from collections.abc import Callable, Mapping, Sequence
from itertools import chain, product
from math import prod
from typing import Any, NamedTuple

from gamms.arguments import as_items, as_mapping
from gamms.errors import BadValue, UnknownName, nearest
from gamms.experiment.digests import hash_value
from gamms.limits import refuse_above
from gamms.plain import Plain
from gamms.scenario import Scenario, ScenarioError
from gamms.scenario.placement import list_members
from gamms.text import as_code, remove_addresses, shown

Function = Callable[..., Any]
Vary = Mapping[str, Sequence[Any] | Mapping[str, Any]] | Sequence[Mapping[str, Any]]

_BYTES = 1_500  # bytes of a variant; 940 measured
_OPEN = ("data", "facts")  # parts of a scenario that accept any keys
_ROW = ("id", "scenario", "seed", "reason", "winner", "truncated", "turns", "error", "gamms", "python", "numpy")


class Variant(NamedTuple):
    """A variant of a scenario.

    Attributes:
        settings: varied key -> the name of its value in rows.
        changes: the arguments of `Scenario.replace`.
        strategies: the argument of `Scenario.play`, by team or agent.
    """

    settings: dict[str, Plain]
    changes: dict[str, Plain]
    strategies: dict[str, Function]

    def apply_to(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the changes of this variant."""
        return scenario.replace(**self.changes) if self.changes else scenario


def make_variants(scenario: Scenario, vary: Vary | None) -> list[Variant]:
    """Return the variants of a grid, or of a list of settings, after checking each with the scenario.

    Raises:
        BadType, BadValue: `vary` is neither, or two values of a key would have one name in the rows.
        ScenarioError, UnknownName: a key is misspelled, or a value is not allowed for its key.
    """
    if vary is None:
        points: list[dict[str, tuple[Plain, Any]]] = [{}]
    elif isinstance(vary, Mapping):
        points = _make_grid({key: _name_values(key, values) for key, values in vary.items()})
    else:
        given = [dict(as_mapping(one, "Each of vary")) for one in as_items(vary, "vary", "dicts of settings")]
        points = _read_list(given)
    variants = [_make_variant(scenario, point) for point in points]
    if not variants:
        raise BadValue("vary has no values: give each key at least one, or leave vary out.")
    return variants


def _make_grid(values: Mapping[str, list[tuple[Plain, Any]]]) -> list[dict[str, tuple[Plain, Any]]]:
    count = prod(len(some) for some in values.values())
    refuse_above(count * _BYTES, f"A grid of {count:,} variants")
    return [dict(zip(values, some, strict=True)) for some in product(*values.values())]


def _read_list(given: list[dict[str, Any]]) -> list[dict[str, tuple[Plain, Any]]]:
    refuse_above(len(given) * _BYTES, f"A list of {len(given):,} variants")
    known = list(given[0]) if given else []
    for point in given:
        if list(point) != known:
            raise BadValue(f"All variants have the same keys, {', '.join(known)}; one has {', '.join(point)}.")
    names = {key: _ValueNames(key) for key in known}
    return [{key: (names[key].find_name(value), value) for key, value in point.items()} for point in given]


def _name_values(key: str, values: object) -> list[tuple[Plain, Any]]:
    """Return the values of a key with their names in rows; a dict gives the names."""
    if isinstance(values, Mapping):
        return [(_find_name(name), value) for name, value in values.items()]
    names = _ValueNames(key)
    found = [
        (names.find_name(value), value) for value in as_items(values, f"The values of {shown(key)} in vary", "values")
    ]
    if len({(type(name), name) for name, _ in found}) < len(found):
        raise BadValue(f"A value of {shown(key)} in vary is there twice: {shown(values)}.")
    return found


class _ValueNames:
    """Names in rows for the values of a key; different functions must have different names."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._values: dict[Plain, Any] = {}

    def find_name(self, value: Any) -> Plain:
        name = _find_name(value)
        other = self._values.setdefault((type(name), name), value)
        if callable(value) and other is not value:
            raise BadValue(
                f"Two values of {shown(self._key)} in vary would both be called {shown(name)}. Give a dict of names: "
                f"{{{self._key!r}: {{'first': …, 'second': …}}}}."
            )
        return name


def _find_name(value: Any) -> Plain:
    """Return the name of a value in rows: a number or text itself, the name of code, or JSON."""
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # a scalar of NumPy
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if callable(value):
        return remove_addresses(as_code(value))
    if isinstance(value, Mapping) and set(value) == {"function"}:
        return value["function"]
    return json.dumps(value, default=str, ensure_ascii=False)


def _make_variant(scenario: Scenario, point: Mapping[Any, tuple[Plain, Any]]) -> Variant:
    found = Variant({key: name for key, (name, _) in point.items()}, {}, {})
    for key, (_, value) in point.items():
        if not isinstance(key, str) or not key:
            raise BadValue(f"A key of vary is a path in the scenario, such as 'teams.red.count', not {shown(key)}.")
        if key == "seed":
            raise BadValue("seed cannot be varied: give seeds=; each variant plays all of them.")
        if key in _ROW:
            raise BadValue(f"{key!r} cannot be varied: it is a column of every row.")
        if key.startswith("strategies."):
            _set_strategy(scenario, key.partition(".")[2], value, found)
        else:
            _check_open(scenario, key)
            found.changes[key] = value
    found.apply_to(scenario)  # checks the spelling of keys
    return found


def _check_open(scenario: Scenario, key: str) -> None:
    """Refuse a new key in a part that accepts any keys: it is probably misspelled."""
    part, _, name = key.partition(".")
    known = scenario.to_dict().get(part) or {} if part in _OPEN else {}
    first = name.partition(".")[0]
    if name and part in _OPEN and first not in map(str, known):
        hint = nearest(first, map(str, known)) or f" Give it a first value in the scenario, in {part}."
        raise ScenarioError(key, f"there is no {first!r} to vary.{hint}")


def _set_strategy(scenario: Scenario, of: str, value: Any, variant: Variant) -> None:
    """Set the strategy of a team or agent: a function, a reference to code, or None for the scenario's own."""
    by_team = list_members(scenario.spec)
    agents = {member.name: member for member in chain.from_iterable(by_team.values())}
    if of not in by_team and of not in agents:
        raise UnknownName("team or agent", of, [*by_team, *agents])
    if callable(value):
        variant.strategies[of] = value
    elif value is not None and of in by_team:
        team = scenario.spec.teams[of]
        if team.plan is not None:
            variant.changes[f"teams.{of}.plan"] = None
        own = [i for i, one in enumerate(team.agents) if one.strategy is not None]
        variant.changes.update({f"teams.{of}.agents.{i}.strategy": None for i in own})
        variant.changes[f"teams.{of}.strategy"] = value
    elif value is not None:
        if agents[of].listed is None:
            raise BadValue(f"{of!r} is one of a count: list it under agents, or vary the strategy of its team.")
        variant.changes[f"{agents[of].path}.strategy"] = value


def compute_row_id(digest: str, settings: Mapping[str, Plain], collected: Sequence[str], seed: int) -> str:
    """Return the id of a row: the first 16 digits of the SHA-256 of its settings and seed."""
    return hash_value([digest, dict(settings), sorted(collected), seed])[:16]
