"""A scenario with every default written out: what a recording keeps, so that later versions build the same game."""

from collections.abc import Callable, Mapping
from inspect import Parameter, signature
from typing import Any

from gamms.scenario.checks import RULES, call_in, sensor_type
from gamms.scenario.code import Library, first_of, needs
from gamms.scenario.errors import ScenarioError
from gamms.scenario.plain import copied
from gamms.scenario.shape import Spec, plain_of
from gamms.sensor.catalog import KINDS

_GIVEN_LATER = ("ctx", "state")  # parameters of functions that the game calls


def written_out(spec: Spec, library: Library) -> dict[str, Any]:
    """Return what a scenario says as plain values, with the defaults of its keys and of the functions that were used.

    A default that is no plain value, such as a function, is left out. Nothing is imported: what has been replaced by
    the caller, such as a strategy, stays as it is written.
    """
    return _Defaults(library).of(copied(plain_of(spec)))


class _Defaults:
    """Writes the defaults of functions into plain values."""

    def __init__(self, library: Library) -> None:
        self._library = library

    def of(self, said: dict[str, Any]) -> dict[str, Any]:
        generator = said["map"]["generator"]
        if generator is not None:
            said["map"]["generator"] = self._code(generator, "map.generator")
        said["sensors"] = {name: self._sensor(one, f"sensors.{name}") for name, one in said["sensors"].items()}
        for name, team in said["teams"].items():
            if team["plan"] is not None:
                team["plan"] = self._code(team["plan"], f"teams.{name}.plan")
            for path, one in [(f"teams.{name}", team), *((f"teams.{name}.agents", one) for one in team["agents"])]:
                one["meta"] = self._values(one["meta"], f"{path}.meta")
                if one["strategy"] is not None:
                    one["strategy"] = self._code(one["strategy"], f"{path}.strategy")
        said["rules"] = [self._rule(one, f"rules.{number}") for number, one in enumerate(said["rules"])]
        said["facts"], said["data"] = self._values(said["facts"], "facts"), self._values(said["data"], "data")
        return said

    def _rule(self, given: Any, path: str) -> dict[str, Any]:
        rule: dict[str, Any] = (
            {"rule": given, "with": {}, "phase": "after", "name": None} if isinstance(given, str) else given
        )
        function = self._library.known(rule["rule"], RULES)
        return {**rule, "with": self._with(function, rule["with"], f"{path}.with")}

    def _sensor(self, sensor: dict[str, Any], path: str) -> dict[str, Any]:
        if sensor["function"] is None:
            kind = sensor_type(sensor["type"])
            usual = {} if kind is None else copied(KINDS[kind].keywords)
            return {**sensor, **{name: value for name, value in usual.items() if sensor[name] is None}}
        function = self._library.known(sensor["function"])
        given = sensor["with"] or {}
        is_made = given or (function is not None and first_of(function) == "ctx")  # else it is called in every turn
        return {**sensor, "with": self._with(function, given, f"{path}.with") if is_made else None}

    def _code(self, given: Any, path: str) -> Any:
        """A strategy, a generator, or a call among parameters."""
        code: dict[str, Any] = {"function": given, "with": {}} if isinstance(given, str) else given
        function = self._library.known(code["function"])
        return {**code, "with": self._with(function, code.get("with") or {}, f"{path}.with")}

    def _with(self, function: Callable[..., Any] | None, given: Mapping[str, Any], path: str) -> dict[str, Any]:
        written = self._values(given, path)
        if function is None:
            return written
        first = (None,) if first_of(function) in _GIVEN_LATER else ()
        if not given and needs(function, first):
            return written  # it is taken as it is: with parameters it would be called
        return {**_plain_defaults(function), **written}

    def _values(self, given: Mapping[str, Any], path: str) -> dict[str, Any]:
        return {name: self._value(one, f"{path}.{name}") for name, one in given.items()}

    def _value(self, value: Any, path: str) -> Any:
        if isinstance(value, list):
            return [self._value(one, path) for one in value]
        if not isinstance(value, Mapping):
            return value
        return self._values(value, path) if call_in(value, path) is None else self._code(value, path)


def _plain_defaults(function: Callable[..., Any]) -> dict[str, Any]:
    """The defaults of a function's parameters, those that a file could say."""
    try:
        parameters = signature(function).parameters.values()
    except (TypeError, ValueError):  # some functions in C
        return {}
    named = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
    defaults = {}
    for one in parameters:
        if one.kind in named and one.default is not Parameter.empty and one.name not in _GIVEN_LATER:
            try:
                defaults[one.name] = copied(one.default)
            except ScenarioError:
                continue
    return defaults
