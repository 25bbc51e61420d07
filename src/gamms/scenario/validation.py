"""Checks of a scenario beyond the types of its values: names that refer to each other, and named code."""

from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping
from collections.abc import Callable as AnyCallable
from functools import reduce
from itertools import chain, islice
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, NamedTuple, get_args, get_origin

from gamms.arguments import as_int, as_member, find_annotations
from gamms.errors import nearest
from gamms.game.channels import as_channel
from gamms.game.roles import as_team_or_role, is_role
from gamms.game.settings import check_setting
from gamms.plain import Plain
from gamms.scenario import maps
from gamms.scenario import spec as schema
from gamms.scenario.code import (
    GIVEN_LATER,
    RULES,
    CodeReference,
    CodeSources,
    Function,
    check_parameters,
    find,
    find_first_parameter,
    find_offered_function,
    find_path,
    is_needing_more,
    list_offered_functions,
    list_plain_defaults,
    locate_files,
)
from gamms.scenario.documents import MOST_BYTES, ScenarioError, join_path, locate_errors
from gamms.scenario.placement import is_flying, list_members
from gamms.scenario.spec import Code, Spec, Values, convert_plain, expand, list_given_values
from gamms.sensor.catalog import KINDS
from gamms.text import shown
from gamms.typing.agent_engine import AgentType
from gamms.typing.game import OWNERS, AerialState, State, find_team_parameters
from gamms.typing.sensor_engine import SensorType

_MOST_FILES = 500
_FEW = 20  # names that are compared or listed
_ARTICLES = {
    "strategy": "a strategy",
    "plan": "a plan",
    "rule": "a rule",
    "resolver": "a resolver of conflicts",
    "sensor": "the function of a sensor",
}
_FIRST = {"state": "strategy", "states": "plan", "arrays": "plan"}


class NamedCode(NamedTuple):
    """A reference to code in a scenario, with its place and parameters."""

    what: str  # "strategy", "plan", "rule", "sensor", "resolver", or "value" for a value made when the game is built
    keys: tuple[str | int, ...]  # its place in the scenario
    reference: str
    given: Values

    @property
    def path(self) -> str:
        """The place in the scenario as a text."""
        return reduce(join_path, self.keys, "")

    @property
    def short(self) -> str | None:
        """The module in which a name without a colon is looked up; None: there is none."""
        return RULES if self.what == "rule" else None


def check_sense(spec: Spec) -> None:
    """Check names and numbers that depend on each other.

    Raises:
        ScenarioError: a check failed.
    """
    maps.check_names(spec.map)
    list_members(spec)
    for name, sensor in spec.sensors.items():
        _check_sensor(f"sensors.{name}", sensor, spec)
    earlier: set[str] = set()
    for name, team in spec.teams.items():
        _check_team(f"teams.{name}", team, earlier, spec)
        earlier.add(name)
    _check_settings(spec)
    _check_orders(spec)
    for name, channel in spec.channels.items():
        _check_channel(f"channels.{name}", name, channel, spec)
    for one in list_code(spec):
        _check_teams_of(one, spec)


def _check_settings(spec: Spec) -> None:
    """Check the values of settings, each alone."""
    with locate_errors("seed"):
        as_int(spec.seed or 0, "A seed")
    with locate_errors("max_turns"):
        check_setting("max_turns", spec.max_turns)
    for name in spec.settings.__struct_fields__:
        with locate_errors(f"settings.{name}"):
            check_setting(name, getattr(spec.settings, name))


def _check_orders(spec: Spec) -> None:
    """Check that the order of play and the priorities in conflicts name the teams of the game."""
    order = spec.settings.order
    for number, group in enumerate(order or ()):
        for team_name in group:
            _check_known_team(team_name, spec, f"settings.order.{number}")
    if order is not None:
        _check_complete("settings.order", [*chain.from_iterable(order)], spec.teams)
    if spec.conflicts is not None and isinstance(spec.conflicts.resolve, schema.PriorityOrder):
        path = "conflicts.resolve.by_priority"
        ranked = spec.conflicts.resolve.by_priority
        for number, member in enumerate(ranked):
            if isinstance(member, dict):
                _check_role(member, spec, f"{path}.{number}")
            else:
                _check_known_team(member, spec, f"{path}.{number}")
        teams = [member if isinstance(member, str) else str(member["team"]) for member in ranked]
        _check_complete(path, teams, [name for name, team in spec.teams.items() if _is_on_ground(team)])


def find_sensor_type(given: str) -> SensorType | None:
    """Return the built-in sensor type of this name, in upper or lower case, or None."""
    kind = as_member(SensorType, given)
    return kind if kind in KINDS else None


def _make_type_error(path: str, kind: str, given: str, names: list[str]) -> ScenarioError:
    offered = [name.lower() for name in names] if given.islower() else names  # as the file writes names
    hint = nearest(given if given.islower() else given.upper(), offered) or f" Use one of {', '.join(offered)}."
    return ScenarioError(f"{path}.type", f"unknown {kind} type {given!r}.{hint}")


def _check_sensor(path: str, sensor: schema.Sensor, spec: Spec) -> None:
    given = list_given_values(sensor)
    if (sensor.type is None) == (sensor.function is None):
        raise ScenarioError(path, "give exactly one of type and function.")
    if sensor.function is not None:
        known = ["function", "with"]
    else:
        kind = find_sensor_type(sensor.type or "")
        if kind is None:
            raise _make_type_error(path, "sensor", sensor.type or "", [one.name for one in KINDS])
        known = ["type", *sorted(KINDS[kind].list_names() - {"sensor_range"})]
    for key in (key.rstrip("_") for key in given):
        if key not in known:
            what = f"a {sensor.type} sensor" if sensor.type else "a function"
            hint = nearest(key, known) or f" It has: {', '.join(known)}."
            raise ScenarioError(join_path(path, key), f"{what} has none.{hint}")
    if sensor.at is not None:
        _check_place(f"{path}.at", sensor.at, f"{sensor.type} sensors are", flies="quat" in known)
    for key in ("team", "exclude"):
        teams = given.get(key, [])
        for team in [teams] if isinstance(teams, str) else teams:
            _check_known_team(team, spec, f"{path}.{key}")


def _check_place(path: str, place: int | list[float], what: str, *, flies: bool) -> None:
    if flies and (isinstance(place, int) or len(place) != 3):
        raise ScenarioError(path, f"cannot be {place}: {what} in the air. Give [x, y, z].")
    if not flies and isinstance(place, list) and len(place) != 2:
        raise ScenarioError(path, f"cannot be {place}: {what} on the ground. Give a node or [x, y].")


def _check_channel(path: str, name: str, channel: schema.Channel, spec: Spec) -> None:
    with locate_errors(path):
        declared = as_channel(name, schema.to_plain(channel))
    for team in declared.teams or ():
        _check_known_team(team, spec, f"{path}.teams")
    known = {*spec.teams, *chain.from_iterable((one.name for one in agents) for agents in list_members(spec).values())}
    relays = declared.relay if isinstance(declared.relay, tuple) else ()
    named = [("relay", relays), ("eavesdroppers", declared.eavesdroppers)]
    named += [(f"jammers.{i}.agent", (one.agent,)) for i, one in enumerate(declared.jammers) if one.agent is not None]
    for key, names in named:
        for one in names:
            if one not in known:
                raise ScenarioError(f"{path}.{key}", f"there is no agent or team {shown(one)}.{nearest(one, known)}")
    for number, jammer in enumerate(declared.jammers):
        if jammer.team is not None:
            _check_known_team(jammer.team, spec, f"{path}.jammers.{number}.team")


def _check_team(path: str, team: schema.Team, earlier: set[str], spec: Spec) -> None:
    if not team.count and not team.agents:
        raise ScenarioError(path, "this team has no agents. Give it count or agents.")
    if (team.near is None) != (team.within is None):
        missing, given = ("within", "near") if team.within is None else ("near", "within")
        raise ScenarioError(f"{path}.{missing}", f"is missing: {given} needs it.")
    for number, away in enumerate([team.from_] if isinstance(team.from_, schema.TeamDistance) else team.from_):
        if away.team not in earlier:
            where = f"{path}.from.team" if isinstance(team.from_, schema.TeamDistance) else f"{path}.from.{number}.team"
            _check_known_team(away.team, spec, where)
            raise ScenarioError(where, f"{away.team!r} must stand before this team in the file: it is placed first.")
    for where, one in [(path, team), *((f"{path}.agents.{i}", agent) for i, agent in enumerate(team.agents))]:
        _check_equipment(where, one, team, spec)


def _is_on_ground(team: schema.Team) -> bool:
    """Return whether an agent of a team does not fly."""
    return bool(team.count and not is_flying(team.type)) or any(
        not is_flying(one.type or team.type) for one in team.agents
    )


def _check_equipment(where: str, one: schema.AgentKeys, team: schema.Team, spec: Spec) -> None:
    """Check settings that a team makes for all its agents, or one agent for itself."""
    if isinstance(one.sensors, dict):
        for name, sensor in one.sensors.items():
            _check_sensor(f"{where}.sensors.{name}", sensor, spec)
    else:
        for number, named in enumerate(one.sensors or []):
            if named not in spec.sensors:
                way_out = " Declare it there, or here: sensors: {eyes: {type: agent_range}}."
                hint = nearest(named, spec.sensors) or way_out
                raise ScenarioError(f"{where}.sensors.{number}", f"there is no sensor {named!r} in sensors.{hint}")
    if team.plan is not None and one.strategy is not None:
        raise ScenarioError(f"{where}.strategy", "is never asked, because the team has a plan. Give one of them.")
    if one.type is not None and as_member(AgentType, one.type) is None:
        raise _make_type_error(where, "agent", one.type, list(AgentType.__members__))
    is_aerial = is_flying(one.type or team.type)
    if is_aerial and one.speed is None and team.speed is None and (one is not team or team.count):
        raise ScenarioError(f"{where}.speed", "is missing: an aerial agent needs it, in map units per turn.")
    if one.mode is not None and is_aerial:
        raise ScenarioError(f"{where}.mode", "is for agents on the ground: this one flies over all edges.")
    if one.altitude is not None and not is_aerial and (one is not team or not is_flying(team.type)):
        raise ScenarioError(f"{where}.altitude", "is for agents of type aerial.")


def _check_teams_of(one: NamedCode, spec: Spec) -> None:
    """Check the parameters of a function of GAMMS that are annotated as teams."""
    function = find_offered_function(one.reference, one.short)
    for name, names in ({} if function is None else find_team_parameters(function)).items():
        given = one.given.get(name)
        path = reduce(join_path, ("with", name), one.path)
        if is_call(given):
            continue
        is_several = isinstance(given, (dict, list)) and ("team" in spec.teams or not is_role(given))
        listed: Any = given if is_several else [given]
        listed = [one[0] if isinstance(one, list) and one else one for one in listed]  # pairs of owners and bases
        for number, role in enumerate(listed):
            if isinstance(role, dict):
                _check_role(role, spec, path if role is given else join_path(path, number))
        teams = [team for team in listed if isinstance(team, (str, int, float))]
        unknown = (team for team in teams if team not in spec.teams)
        if names == OWNERS:  # other values are allowed, unless they look like misspelled teams
            without = [team for team in spec.teams if team not in teams]
            unknown = (team for team in islice(unknown, _FEW) if nearest(team, without))
        for team in unknown:
            _check_known_team(team, spec, path)


def _check_role(given: Plain, spec: Spec, path: str) -> None:
    """Check a role that a rule takes instead of a team: its form, its team, and the names of its agents."""
    with locate_errors(path):
        role = as_team_or_role(given)
    _check_known_team(role.team, spec, join_path(path, "team"))
    if any(code.what == "rule" and ":" in code.reference for code in list_code(spec)):
        return  # it may create the agents
    known = [one.name for one in list_members(spec)[str(role.team)]]
    for name in sorted(role.names or ()):
        if name not in known:
            hint = nearest(name, known) or f" Its agents are: {', '.join(islice(known, _FEW))}."
            raise ScenarioError(join_path(path, "names"), f"team {shown(role.team)} has no agent {shown(name)}.{hint}")


def _check_complete(path: str, listed: list[str], teams: Iterable[str]) -> None:
    for team in teams:
        if team not in listed:
            raise ScenarioError(path, f"leaves out team {shown(team)}. Put it into the list {shown(listed)}.")


def _check_known_team(team: object, spec: Spec, path: str) -> None:
    if team not in spec.teams:
        few = ", ".join(islice(spec.teams, _FEW))
        hint = nearest(team, spec.teams) or f" Teams are: {few}{', …' if len(spec.teams) > _FEW else ''}."
        raise ScenarioError(path, f"unknown team {shown(team)}.{hint}")


# -- code -------------------------------------------------------------------------------------------------------


def list_code(spec: Spec) -> Iterator[NamedCode]:
    """Yield all code that a scenario names, in the order of the file."""
    if spec.map.generator is not None:
        yield from _list_given_code("value", ("map", "generator"), spec.map.generator)
    yield from _list_sensor_code((), spec)
    for name, team in spec.teams.items():
        if team.plan is not None:
            yield from _list_given_code("plan", ("teams", name, "plan"), team.plan)
        own = [((*("teams", name, "agents"), number), agent) for number, agent in enumerate(team.agents)]
        for keys, one in [(("teams", name), team), *own]:
            if one.strategy is not None:
                yield from _list_given_code("strategy", (*keys, "strategy"), one.strategy)
            yield from _list_sensor_code(keys, one)
            yield from _list_parameter_code((*keys, "meta"), one.meta)
    for number, rule in enumerate(spec.rules):
        yield from _list_given_code("rule", ("rules", number), rule)
    resolve = spec.conflicts.resolve if spec.conflicts else None
    if isinstance(resolve, str) and ":" in resolve:
        yield from _list_given_code("resolver", ("conflicts", "resolve"), resolve)
    yield from _list_parameter_code(("facts",), spec.facts)
    yield from _list_parameter_code(("data",), spec.data)


def _list_sensor_code(keys: tuple[str | int, ...], part: Spec | schema.AgentKeys) -> Iterator[NamedCode]:
    for name, sensor in part.sensors.items() if isinstance(part.sensors, dict) else ():
        if sensor.function is not None:
            code = Code(function=sensor.function, with_=sensor.with_ or {})
            yield from _list_given_code("sensor", (*keys, "sensors", name), code)


def _list_given_code(what: str, keys: tuple[str | int, ...], given: str | Code | schema.Rule) -> Iterator[NamedCode]:
    code = expand(Code, given) if isinstance(given, str) else given
    yield NamedCode(what, keys, code.rule if isinstance(code, schema.Rule) else code.function, code.with_)
    yield from _list_parameter_code((*keys, "with"), code.with_)


def _list_parameter_code(keys: tuple[str | int, ...], values: Values | list[Plain]) -> Iterator[NamedCode]:
    """Yield the code named among parameters and facts: `{function: …, with: {…}}`."""
    for key, value in values.items() if isinstance(values, dict) else enumerate(values):
        call = call_in(value, (*keys, key))
        if call is not None:
            yield from _list_given_code("value", (*keys, key), call)
        elif isinstance(value, (dict, list)):
            yield from _list_parameter_code((*keys, key), value)


def is_call(value: Plain) -> bool:
    """Return whether a value has the form `{function: module:function, with: {…}}`."""
    if not isinstance(value, Mapping) or not set(value) <= {"function", "with"}:
        return False
    function = value.get("function")
    return isinstance(function, str) and ":" in function


def call_in(value: Plain, keys: Iterable[str | int]) -> Code | None:
    """Return the function and its parameters if a value is a call, else None.

    Raises:
        ScenarioError: the parameters are not a mapping.
    """
    if not is_call(value):
        return None
    code: Code = convert_plain(
        {key: one for key, one in value.items() if one is not None}, Code, reduce(join_path, keys, "")
    )
    return code


def check_code(spec: Spec, sources: CodeSources) -> list[CodeReference]:
    """Find all code, and check parameters for functions of GAMMS; run no other code.

    Raises:
        ScenarioError: some code does not exist, or does not take its parameters.
    """
    _check_resolver(spec)
    found = []
    known: dict[tuple[str | int, ...], Function] = {}  # functions of GAMMS, by the keys that lead to them
    for one in list_code(spec):
        found.append(find(one.reference, sources, one.path, short=one.short))
        function = find_offered_function(one.reference, one.short)
        if function is not None:
            known[one.keys] = function
            _check_kind(one, function, known)
        if function is not None and (one.given or one.what in ("strategy", "plan", "rule")):
            check_parameters(function, one.given, int(find_first_parameter(function) in GIVEN_LATER), one.path)
            locate_files(function, one.given, sources, one.path)
    list_files(spec, sources)
    maps.find_mode(spec.map, sources.folder)
    return found


def list_files(spec: Spec, sources: CodeSources) -> list[Path]:
    """Return the files that a scenario names: of its map, of parameters of GAMMS's functions, and declared ones.

    Raises:
        ScenarioError: a file does not exist, or is not in the folder of the scenario.
    """
    map = maps.map_file(spec.map, sources.folder)
    found = [] if map is None else [map]
    named = {f"files.{number}": text for number, text in enumerate(spec.files)}
    for kind in ("file", "place"):
        for key in ("modes", "elevation"):
            text = getattr(getattr(spec.map, kind), key, None)
            named |= {} if text is None else {f"map.{kind}.{key}": text}
    for one in list_code(spec):
        for key in getattr(find_offered_function(one.reference, one.short), "files", ()):
            named |= {f"{one.path}.with.{key}": one.given[key]} if isinstance(one.given.get(key), str) else {}
    for path, text in named.items():
        file = find_path(text, sources.folder, path, "file")
        inner = sorted(file.rglob("*")) if path.endswith(".elevation") else []
        if not file.is_file() and not inner:
            raise ScenarioError(path, f"there is no file {text!r} in {sources.folder}.")
        found += [one for one in (file, *inner) if one.is_file()]
    return found


def _check_resolver(spec: Spec) -> None:
    """Check the name of a resolver of GAMMS."""
    resolve = spec.conflicts.resolve if spec.conflicts else None
    if resolve == "by_priority":
        form = f"{{by_priority: [{', '.join(spec.teams)}]}}"
        raise ScenarioError("conflicts.resolve", f"by_priority needs the teams in their order, such as {form}.")
    if isinstance(resolve, str) and ":" not in resolve and resolve not in list_resolvers():
        hint = nearest(resolve, list_resolvers()) or f" There are: {', '.join(list_resolvers())}."
        raise ScenarioError("conflicts.resolve", f"there is no resolver {resolve!r}.{hint}")


def _check_kind(one: NamedCode, function: Function, known: Mapping[tuple[str | int, ...], Function]) -> None:
    """Check that a function of GAMMS is allowed at its place; `known` holds the functions around it."""
    kind = find_kind(function, find_first_parameter(function))
    name = one.reference.rpartition(":")[2]
    if one.what != "value":
        check_kind(kind, one.what, name, one.path)
    elif "with" in one.keys:
        at = len(one.keys) - 1 - one.keys[::-1].index("with")
        outer = known.get(one.keys[:at])
        taken = {} if outer is None else find_annotations(outer.__init__ if isinstance(outer, type) else outer)  # type: ignore[misc] # of the class itself
        if one.keys[at + 1] in taken:
            check_parameter(kind, taken[str(one.keys[at + 1])], name, one.path)


def find_unread_data(spec: Spec, found: Iterable[CodeReference]) -> list[str | int]:
    """Return the keys of `data` that neither the game's files nor parameters of GAMMS functions mention."""
    if any(one.file is None and one.module.partition(".")[0] != "gamms" for one in found):
        return []  # an installed package may read anything
    texts = [file.read_text(errors="replace") for file in _list_files_beside(found)]
    for one in list_code(spec):
        function = find_offered_function(one.reference, one.short)
        texts.append(str(one.given if function is None else {**list_plain_defaults(function), **one.given}))
    return [key for key in spec.data if not any(str(key) in text for text in texts)]


def _list_files_beside(found: Iterable[CodeReference]) -> Iterator[Path]:
    """Yield the Python files in the folders of code, up to a number and a size."""
    folders = dict.fromkeys(one.file.parent for one in found if one.file is not None)
    files = chain.from_iterable(sorted(folder.glob("*.py")) for folder in folders)
    yield from (file for file in islice(files, _MOST_FILES) if file.stat().st_size <= MOST_BYTES)


# -- kinds of functions -------------------------------------------------------------------------------------------
# They are derived from annotations. Functions of users are checked only when a game is built and they are imported.


def find_kind(function: Callable[..., Any], first: str) -> str | None:
    """Return the kind of a function of GAMMS or of its result.

    Args:
        function: the function.
        first: the name of its first parameter.

    Returns:
        The kind; None for anything else. A "team strategy" is also a plan.
    """
    if first in _FIRST:
        return _FIRST[first]
    given = function if isinstance(function, type) else find_annotations(function).get("return")
    if isinstance(given, type):
        call = find_annotations(vars(given).get("__call__"))
        return "strategy" if "state" in call else None
    if get_origin(given) is not AnyCallable:
        return None
    arguments, result = get_args(given)
    if getattr(arguments[0], "__name__", "") == "Contest":  # of gamms.rules, which this package does not import
        return "resolver"
    if result is object:
        return "rule"
    return "strategy" if arguments[0] in (State, AerialState) else "team strategy"


def list_resolvers() -> list[str]:
    """Return the names of the resolvers of conflicts that GAMMS offers, by_priority first."""
    functions = list_offered_functions(RULES).items()
    made = [
        name
        for name, one in functions
        if find_kind(one, find_first_parameter(one)) == "resolver" and not is_needing_more(one)
    ]
    return ["by_priority", *made]


def check_kind(kind: str | None, wanted: str, name: str, path: str) -> None:
    """Check that a function of GAMMS has the kind that its place in a scenario needs.

    Raises:
        ScenarioError: it has another kind.
    """
    fits = {"strategy": ("strategy", "team strategy"), "plan": ("plan", "team strategy"), "rule": ("rule",)}
    if kind in fits.get(wanted, ()):
        return
    found = "no such function" if kind is None else _ARTICLES[kind.removeprefix("team ")]
    hint = " It belongs into conflicts.resolve." if kind == "resolver" else ""
    if wanted == "resolver":
        hint = f" Write {', '.join(list_resolvers())}, without a module, or name a function of your own."
    if kind == wanted:
        raise ScenarioError(path, f"{name} makes {found}, but is not one itself.{hint}")
    raise ScenarioError(path, f"{name} is {found}, and {_ARTICLES[wanted]} belongs here.{hint}")


def check_parameter(kind: str | None, annotation: object, name: str, path: str) -> None:
    """Check a function of GAMMS that is the parameter of another one.

    Args:
        kind: the kind of the function.
        annotation: the annotation of the parameter.
        name: the name of the function.
        path: the place that names it.

    Raises:
        ScenarioError: it is a strategy, rule or resolver, which the parameter does not accept.
    """
    takes_strategy = annotation is Any or any(map(_is_strategy, _list_callables(annotation)))
    if kind is None or (takes_strategy and kind in ("strategy", "team strategy")):
        return
    article = _ARTICLES[kind.removeprefix("team ")]
    raise ScenarioError(path, f"{name} is {article}, and the parameter takes none.")


def _list_callables(annotation: object) -> list[Any]:
    """Return the function types in an annotation."""
    if get_origin(annotation) is AnyCallable:
        return [annotation]
    parts = get_args(annotation)[:1] if get_origin(annotation) is Annotated else get_args(annotation)
    return list(chain.from_iterable(_list_callables(part) for part in parts))


def _is_strategy(function: object) -> bool:
    """Return whether a function of this type can be a strategy: it takes one argument and need not return anything."""
    arguments, result = get_args(function) or (..., None)
    results = get_args(result) or (result,)
    takes_state = len(arguments) == 1 if isinstance(arguments, list) else True  # not a list: `...`, which takes all
    returns_nothing = result is Any or {NoneType, None, Awaitable[None]}.issuperset(results)
    return takes_state and returns_nothing
