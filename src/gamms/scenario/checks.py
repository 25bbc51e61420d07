"""Checks of a scenario beyond the types of its values, without running code; and its defaults, written out."""

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from inspect import Parameter, signature
from itertools import islice
from typing import Any

from gamms.errors import UnknownName, nearest
from gamms.scenario import world
from gamms.scenario.code import Library, check_parameters, first_of, function_of, needs
from gamms.scenario.documents import ScenarioError, copied, joined
from gamms.scenario.references import OFFERED, Found, Sources, find
from gamms.scenario.spec import (
    Agent,
    ByPriority,
    Code,
    From,
    Rule,
    Sensor,
    Spec,
    Team,
    checked,
    given_values,
    plain_of,
    unknown_key,
)
from gamms.scenario.world import members
from gamms.sensor.catalog import KINDS
from gamms.text import shown
from gamms.typing.game import OWNERS, team_parameters
from gamms.typing.sensor_engine import SensorType

RULES = "gamms.rules"
_FEW = 20  # names that are compared or listed
_RESOLVERS = ("by_priority", "at_random", "nobody")


def check_sense(spec: Spec) -> None:
    """Check names and numbers that have to fit each other.

    Raises:
        ScenarioError: some do not.
    """
    world.kind_of(spec.map)
    members(spec)
    for name, sensor in spec.sensors.items():
        _check_sensor(f"sensors.{name}", sensor, spec)
    earlier: set[str] = set()
    for name, team in spec.teams.items():
        _check_team(f"teams.{name}", team, earlier, spec)
        if team.plan is not None and team.strategy is not None:
            raise ScenarioError(
                f"teams.{name}.strategy", "is never asked, because the team has a plan. Give one of them."
            )
        earlier.add(name)
    if spec.conflicts is not None and isinstance(spec.conflicts.resolve, ByPriority):
        for number, team_name in enumerate(spec.conflicts.resolve.by_priority):
            _known_team(team_name, spec, f"conflicts.resolve.by_priority.{number}")
    for number, rule in enumerate(spec.rules):
        if isinstance(rule, Rule):
            _check_teams_of(rule, spec, f"rules.{number}.with")


def sensor_type(given: str) -> SensorType | None:
    """Return the type of that name, in any case; None if there is no such built-in one."""
    kind = SensorType.__members__.get(given.upper().removeprefix("SENSORTYPE."))
    return kind if kind in KINDS else None


def _check_sensor(path: str, sensor: Sensor, spec: Spec) -> None:
    given = given_values(sensor)
    if (sensor.type is None) == (sensor.function is None):
        raise ScenarioError(path, "give exactly one of type and function.")
    if sensor.function is not None:
        known = ["function", "with"]
    else:
        kind = sensor_type(sensor.type or "")
        if kind is None:
            names = [one.name for one in KINDS]
            hint = nearest((sensor.type or "").upper(), names) or f" Use one of {', '.join(names)}."
            raise ScenarioError(f"{path}.type", f"unknown sensor type {sensor.type!r}.{hint}")
        known = ["type", *sorted(KINDS[kind].names())]
    for key, value in given.items():
        if key.rstrip("_") not in known:
            whose = f"a {sensor.type} sensor has none. " if sensor.type else "a function has none. "
            error = unknown_key(path, key.rstrip("_"), value, known)
            raise ScenarioError(error.path, f"{whose}It has: {', '.join(known)}.")
    for key in ("team", "exclude"):
        teams = given.get(key, [])
        for team in [teams] if isinstance(teams, str) else teams:
            _known_team(team, spec, f"{path}.{key}")


def _check_team(path: str, team: Team, earlier: set[str], spec: Spec) -> None:
    if not team.count and not team.agents:
        raise ScenarioError(path, "this team has nobody. Give it count or agents.")
    if (team.near is None) != (team.within is None):
        missing, given = ("within", "near") if team.within is None else ("near", "within")
        raise ScenarioError(f"{path}.{missing}", f"is missing: {given} needs it.")
    for number, away in enumerate([team.from_] if isinstance(team.from_, From) else team.from_):
        if away.team not in earlier:
            where = f"{path}.from.team" if isinstance(team.from_, From) else f"{path}.from.{number}.team"
            _known_team(away.team, spec, where)
            raise ScenarioError(where, f"{away.team!r} must stand before this team in the file: it is placed first.")
    for where, one in [(path, team), *((f"{path}.agents.{i}", agent) for i, agent in enumerate(team.agents))]:
        for number, sensor in enumerate(one.sensors or []):
            if sensor not in spec.sensors:
                hint = nearest(sensor, spec.sensors)
                raise ScenarioError(f"{where}.sensors.{number}", f"there is no sensor {sensor!r} in sensors.{hint}")
        is_aerial = (one.type or team.type) == "aerial"
        if is_aerial and one.speed is None and team.speed is None and (one is not team or team.count):
            raise ScenarioError(f"{where}.speed", "is missing: an aerial agent needs it, in map units per turn.")
        if one.altitude is not None and not is_aerial and (one is not team or team.type != "aerial"):
            raise ScenarioError(f"{where}.altitude", "is for agents of type aerial.")


def _check_teams_of(rule: Rule, spec: Spec, path: str) -> None:
    """Check the parameters of our own rules whose annotations say that they name teams."""
    rules = import_module(RULES)
    name = rule.rule.removeprefix(f"{RULES}:")
    for parameter, names in team_parameters(getattr(rules, name)).items() if name in rules.__all__ else ():
        given = rule.with_.get(parameter)
        where = f"{path}.{parameter}"
        if names == OWNERS and isinstance(given, dict):  # which may be other than teams
            without = [team for team in spec.teams if team not in given]
            for team in islice((team for team in given if team not in spec.teams), _FEW):
                if nearest(team, without):
                    _known_team(team, spec, where)
            continue
        for team in given if isinstance(given, dict) else [given]:
            if isinstance(team, str):
                _known_team(team, spec, where)


def _known_team(team: object, spec: Spec, path: str) -> None:
    if team not in spec.teams:
        few = ", ".join(islice(spec.teams, _FEW))
        hint = nearest(team, spec.teams) or f" Teams are: {few}{', …' if len(spec.teams) > _FEW else ''}."
        raise ScenarioError(path, f"unknown team {shown(team)}.{hint}")


def references(spec: Spec, sources: Sources) -> Iterator[Found]:
    """Yield all code that building the scenario would import, in the order of the file.

    Raises:
        ScenarioError: some of it is not there.
    """
    if spec.map.generator is not None:
        generator = spec.map.generator
        yield find(generator if isinstance(generator, str) else generator.function, sources, "map.generator")
    for name, sensor in spec.sensors.items():
        if sensor.function is not None:
            yield from _code(Code(function=sensor.function, with_=sensor.with_ or {}), sources, f"sensors.{name}")
    for path, one in _equipped(spec):
        if one.strategy is not None:
            yield from _code(one.strategy, sources, f"{path}.strategy")
        if isinstance(one, Team) and one.plan is not None:
            yield from _code(one.plan, sources, f"{path}.plan")
        yield from nested(one.meta, sources, f"{path}.meta")
    for number, rule in enumerate(spec.rules):
        path = f"rules.{number}"
        yield find(rule if isinstance(rule, str) else rule.rule, sources, path, short=RULES)
        yield from nested(rule.with_ if isinstance(rule, Rule) else {}, sources, f"{path}.with")
    resolve = spec.conflicts.resolve if spec.conflicts else None
    if isinstance(resolve, str) and resolve not in _RESOLVERS:
        if ":" not in resolve:
            hint = nearest(resolve, _RESOLVERS)
            raise ScenarioError("conflicts.resolve", f"there is no resolver {resolve!r}.{hint}")
        yield find(resolve, sources, "conflicts.resolve")
    yield from nested(spec.facts, sources, "facts")
    yield from nested(spec.data, sources, "data")


def nested(value: object, sources: Sources, path: str) -> Iterator[Found]:
    """Yield the code that is named inside parameters and facts: `{function: …, with: {…}}`."""
    call = call_in(value, path)
    if call is not None:
        yield from _code(call, sources, path)
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from nested(one, sources, joined(path, key))
    elif isinstance(value, list):
        for number, one in enumerate(value):
            yield from nested(one, sources, joined(path, number))


def call_in(value: object, path: str) -> Code | None:
    """Return the function and its parameters, if a value among parameters is `{function: module:function, with: {…}}`.

    Raises:
        ScenarioError: the parameters are not a mapping.
    """
    if not isinstance(value, Mapping) or not set(value) <= {"function", "with"}:
        return None
    function = value.get("function")
    if not isinstance(function, str) or ":" not in function:
        return None
    code: Code = checked({key: one for key, one in value.items() if one is not None}, Code, path)
    return code


def _code(given: str | Code, sources: Sources, path: str) -> Iterator[Found]:
    yield find(given if isinstance(given, str) else given.function, sources, path)
    if isinstance(given, Code):
        yield from nested(given.with_, sources, f"{path}.with")


def check_code(spec: Spec, sources: Sources) -> list[Found]:
    """Find all code, and compare parameters with what our own functions take; no other code is run.

    Raises:
        ScenarioError: some is not there, or takes no such parameters.
    """
    found = list(references(spec, sources))
    given = dict(_given(spec))
    for one in found:
        if one.file is None and one.module in OFFERED and one.path in given:
            function = function_of(one, None)
            first = ("ctx",) if first_of(function) in ("ctx", "state") else ()
            check_parameters(function, given[one.path], first, one.path)
    world.map_file(spec.map, sources.folder)
    return found


def _given(spec: Spec) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield where each rule and strategy is in the file, and its parameters."""
    for number, rule in enumerate(spec.rules):
        yield f"rules.{number}", rule.with_ if isinstance(rule, Rule) else {}
    for path, one in _equipped(spec):
        if one.strategy is not None:
            yield f"{path}.strategy", one.strategy.with_ if isinstance(one.strategy, Code) else {}
        if isinstance(one, Team) and one.plan is not None:
            yield f"{path}.plan", one.plan.with_ if isinstance(one.plan, Code) else {}


def _equipped(spec: Spec) -> Iterator[tuple[str, Team | Agent]]:
    """Yield teams and the agents that they list, each with its path."""
    for name, team in spec.teams.items():
        yield f"teams.{name}", team
        yield from ((f"teams.{name}.agents.{number}", agent) for number, agent in enumerate(team.agents))


def unknown_strategies(given: Mapping[str, Any], spec: Spec) -> None:
    """Refuse strategies for teams and agents that are not there.

    Raises:
        UnknownName (KeyError): there is no such team or agent.
    """
    known = [*spec.teams, *(member.name for member in members(spec))]
    for name in given:
        if name not in known:
            raise UnknownName("team or agent", name, known)


# -- the defaults of functions, written out --------------------------------------------------------------------------


_GIVEN_LATER = ("ctx", "state")  # parameters of functions that the game calls


def written_out(spec: Spec, library: Library) -> dict[str, Any]:
    """Return a scenario as plain values, with the defaults of its keys and of the functions that were used.

    A default that is not a plain value, such as a function, is left out. Nothing is imported: what has been replaced by
    the caller, such as a strategy, stays as it is written.
    """
    return _Defaults(library).of(copied(plain_of(spec)))


class _Defaults:
    """Writes the defaults of functions into plain values."""

    def __init__(self, library: Library) -> None:
        self._library = library

    def of(self, spec: dict[str, Any]) -> dict[str, Any]:
        generator = spec["map"]["generator"]
        if generator is not None:
            spec["map"]["generator"] = self._code(generator, "map.generator")
        spec["sensors"] = {name: self._sensor(one, f"sensors.{name}") for name, one in spec["sensors"].items()}
        for name, team in spec["teams"].items():
            if team["plan"] is not None:
                team["plan"] = self._code(team["plan"], f"teams.{name}.plan")
            for path, one in [(f"teams.{name}", team), *((f"teams.{name}.agents", one) for one in team["agents"])]:
                one["meta"] = self._values(one["meta"], f"{path}.meta")
                if one["strategy"] is not None:
                    one["strategy"] = self._code(one["strategy"], f"{path}.strategy")
        spec["rules"] = [self._rule(one, f"rules.{number}") for number, one in enumerate(spec["rules"])]
        spec["facts"], spec["data"] = self._values(spec["facts"], "facts"), self._values(spec["data"], "data")
        return spec

    def _rule(self, given: str | dict[str, Any], path: str) -> dict[str, Any]:
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

    def _code(self, given: str | Mapping[str, Any], path: str) -> dict[str, Any]:
        """Write out a strategy, a generator, or a call among parameters."""
        code: Mapping[str, Any] = {"function": given, "with": {}} if isinstance(given, str) else given
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

    def _value(self, value: object, path: str) -> Any:
        if isinstance(value, list):
            return [self._value(one, path) for one in value]
        if not isinstance(value, Mapping):
            return value
        return self._values(value, path) if call_in(value, path) is None else self._code(value, path)


def _plain_defaults(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the defaults of a function's parameters, those that a file could have."""
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
