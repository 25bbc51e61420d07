"""From a checked scenario to a context that is ready to play."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple, TypeVar, overload

from gamms import agent as agents
from gamms.arguments import as_int
from gamms.context import Context
from gamms.game import Game, Plan
from gamms.ir.agents import Position
from gamms.plain import is_same
from gamms.scenario.checks import RULES, call_in, sensor_type
from gamms.scenario.code import Library, called, first_of, needs, plan_of, rule_of, strategy_of
from gamms.scenario.documents import ScenarioError, at, joined
from gamms.scenario.spec import ByPriority, Code, Conflicts, LatLon, Sensor, Spec, checked, given_values
from gamms.scenario.spec import Rule as RuleSpec
from gamms.scenario.world import Member, members, node_at, place
from gamms.text import shown
from gamms.typing.game import Rule

T = TypeVar("T")

Strategies = Mapping[str, Callable[..., Any]]  # by team or agent


@dataclass
class _Built:
    """What was built for an agent."""

    agent: Any
    node: int
    start: Any  # the node, or (x, y, z)
    meta: dict[str, Any]
    functions: dict[str, tuple[Any, Any]]  # sensor -> itself and its function
    strategy: Any = None


class Building:
    """One context being built; the map is in it already.

    Args:
        ctx: the context.
        spec: what it is to become.
        library: where its functions are.
        strategies: by team or agent, in place of those of the scenario.
    """

    def __init__(self, ctx: Context, spec: Spec, library: Library, strategies: Strategies) -> None:
        self.ctx, self.spec, self.library, self.given = ctx, spec, library, strategies
        self.members = members(spec)
        self.by_team: dict[str, list[Member]] = {}
        for member in self.members:
            self.by_team.setdefault(member.team, []).append(member)
        self._agents: dict[str, _Built] = {}
        self._rules: dict[str, Rule] = {}  # by their names in the game
        self._plans: dict[str, Plan] = {}  # by team
        self._values = values_of(ctx.game)
        self._map: Any = None  # as it was before the code of the scenario changed it, if that did

    def build(self) -> None:
        """Put agents, facts, strategies, rules and conflicts into the context.

        Raises:
            ScenarioError: something cannot be done as it is written.
        """
        map = self.ctx.graph.storage.snapshot()
        nodes = place(self.ctx, self.spec, self.members)
        for member in self.members:
            self._agents[member.name] = self._add_agent(member, nodes[member.name])
        game = self.ctx.game
        self._add_values()
        for name, strategy in self._strategies().items():
            self._agents[name].agent.register_strategy(strategy)
            self._agents[name].strategy = strategy
        self._plans = self._made_plans()
        game.plans = self._plans
        for number, given in enumerate(self.spec.rules):
            with at(f"rules.{number}"):
                rule = self._rule(given, f"rules.{number}")
                keywords: dict[str, Any] = {} if isinstance(given, str) else {"phase": given.phase, "name": given.name}
                game.add(rule, **keywords)
            self._rules[game.rules[-1].name] = rule
        if self.spec.conflicts is not None:
            with at("conflicts"):
                game.conflicts = self._conflicts(self.spec.conflicts)
        self._values = values_of(game)
        if (map.revision, map.obstacle_revision) != (self.ctx.graph.graph.revision, self.ctx.graph.obstacle_revision):
            self._map = map

    def draw_again(self) -> None:
        """Make again what follows from the seed of the context, which has changed.

        These are places, what functions give, strategies and rules. What was changed since then stays as it is: an
        agent that was moved, another strategy, a fact that was published.

        Raises:
            ScenarioError: something cannot be done as it is written; not all agents can be placed, for example.
        """
        if self._map is not None:
            self.ctx.graph.storage.restore(self._map)
        nodes = place(self.ctx, self.spec, self.members)
        for member in self.members:
            self._draw_agent(member, nodes[member.name])
        game = self.ctx.game
        changes = take_out(game, self._values)
        self._add_values()
        for name, strategy in self._strategies().items():
            built = self._agents[name]
            if built.agent.strategy is built.strategy:
                built.agent.register_strategy(strategy)
            built.strategy = strategy
        before, self._plans = self._plans, self._made_plans()
        game.plans = {team: self._plans[team] if one == before.get(team) else one for team, one in game.plans.items()}
        self._draw_rules()
        self._values = values_of(game)
        put_back(game, *changes)

    def _draw_rules(self) -> None:
        """Make the rules again, prepare them, and let them take the places of those that are still there."""
        now = self.ctx.game.rules
        for (name, before), (number, given) in zip(list(self._rules.items()), enumerate(self.spec.rules), strict=True):
            with at(f"rules.{number}"):
                rule = self._rule(given, f"rules.{number}")
                if hasattr(rule, "prepare"):
                    rule.prepare(self.ctx)
            now = tuple(one._replace(rule=rule) if one.name == name and one.rule is before else one for one in now)
            self._rules[name] = rule
        self.ctx.game.restore_rules(now)

    def _add_values(self) -> None:
        game = self.ctx.game
        with at("facts"):
            game.publish(**self.parameters(self.spec.facts, "facts"))
        game.data.update(self.parameters(self.spec.data, "data"))

    # -- agents and sensors -------------------------------------------------------------------------------------

    def _add_agent(self, member: Member, node: int) -> "_Built":
        team, own = self.spec.teams[member.team], member.own
        start, meta = self._start(member, node), self.config(member)["meta"]
        keywords: dict[str, Any] = {"team": member.team, "meta": meta}
        if isinstance(start, tuple):
            keywords |= {"type": "AERIAL", "position": start}
        speed = _first_given(getattr(own, "speed", None), team.speed)
        if speed is not None:
            keywords["speed"] = speed
        with at(member.path):
            sensors = {name: self._sensor(name, member) for name in self.sensors_of(member)}
            agent = self.ctx.agent.create_agent(member.name, start_node_id=node, sensors=sensors, **keywords)
        functions = {name: sensor for name, sensor in sensors.items() if self.spec.sensors[name].function is not None}
        return _Built(
            agent, node, start, deepcopy(meta), {name: (one, one.function) for name, one in functions.items()}
        )

    def _draw_agent(self, member: Member, node: int) -> None:
        built, start, meta = self._agents[member.name], self._start(member, node), self.config(member)["meta"]
        agent = built.agent
        move_start(agent, built.start, start)
        if is_same(getattr(agent, "meta", None), built.meta):
            agent.meta = meta
        for name, (sensor, before) in built.functions.items():
            with at(f"sensors.{name}"):
                function = self._function(self.spec.sensors[name], f"sensors.{name}")
                if sensor.function is before:
                    sensor.function = function
            built.functions[name] = sensor, function
        built.node, built.start, built.meta = node, start, deepcopy(meta)

    def _start(self, member: Member, node: int) -> Any:
        """Return where an agent begins: a node, or (x, y, z) above it."""
        if self.kind_of(member) != "aerial":
            return node
        altitude = _first_given(getattr(member.own, "altitude", None), self.spec.teams[member.team].altitude)
        return (*self.ctx.graph.graph.get_node(node)[1:3], altitude or 0.0)

    def kind_of(self, member: Member) -> str:
        """Return whether an agent is "basic" or "aerial"."""
        return _first_given(member.own.type if member.own else None, self.spec.teams[member.team].type) or "basic"

    def sensors_of(self, member: Member) -> list[str]:
        """Return the names of the sensors that an agent carries."""
        return _first_given(member.own.sensors if member.own else None, self.spec.teams[member.team].sensors) or []

    def config(self, member: Member) -> dict[str, Any]:
        """Return what the paper's `map_strategy` gets about an agent."""
        meta = {**self.spec.teams[member.team].meta, **(member.own.meta if member.own else {})}
        return {
            "team": member.team,
            "type": self.kind_of(member),
            "sensors": list(self.sensors_of(member)),
            "meta": {"team": member.team, **self.parameters(meta, joined(member.path, "meta"))},
        }

    def _sensor(self, name: str, member: Member) -> Any:
        sensor, path, id = self.spec.sensors[name], f"sensors.{name}", f"{member.name}/{name}"
        with at(path):
            if sensor.function is not None:
                return self.ctx.sensor.from_function(id, self._function(sensor, path))
            keywords = given_values(sensor)
            kind = sensor_type(keywords.pop("type"))
            if isinstance(sensor.at, tuple):
                keywords["at"] = (float(sensor.at[0]), float(sensor.at[1]))
            return self.ctx.sensor.create_sensor(id, kind, **keywords)

    def _function(self, sensor: Sensor, path: str) -> Any:
        """Return the function of a sensor, or what it makes of its parameters."""
        function = self.library.get(sensor.function or "", path)
        given = self.parameters(sensor.with_ or {}, f"{path}.with")
        if given or first_of(function) == "ctx":
            function = called(function, given, (self.ctx,) if first_of(function) == "ctx" else (), path)
        return function

    # -- strategies ---------------------------------------------------------------------------------------------

    def _strategies(self) -> dict[str, Any]:
        """Return the strategies by agent."""
        mapped: dict[str, Mapping[str, Any]] = {}
        made = {member.name: self._strategy(member, mapped) for member in self.members}
        return {name: strategy for name, strategy in made.items() if strategy is not None}

    def _strategy(self, member: Member, mapped: dict[str, Mapping[str, Any]]) -> Any:
        given = self.given.get(member.name, self.given.get(member.team))
        own = None if member.own is None else member.own.strategy
        path = f"{f'teams.{member.team}' if own is None else member.path}.strategy"
        if given is not None:
            return strategy_of(given, None, self.ctx, f"strategies[{shown(member.team)}]")
        code = _as_code(self.spec.teams[member.team].strategy if own is None else own)
        if code is None:
            return None
        if ":" not in code.function:
            return self._mapped(member, code, path, mapped)
        return strategy_of(
            self.library.get(code.function, path), self.parameters(code.with_, f"{path}.with"), self.ctx, path
        )

    def _made_plans(self) -> dict[str, Plan]:
        """Return the plans by team, of those that are given no strategy instead."""
        plans = {}
        for name, team in self.spec.teams.items():
            if team.plan is None or name in self.given:
                continue
            code, path = _as_code(team.plan), f"teams.{name}.plan"
            named = [member.name for member in self.by_team.get(name, []) if member.name in self.given]
            if named:
                raise ScenarioError(path, f"decides for {named[0]!r} as well: give a strategy for the whole team.")
            parameters = self.parameters(code.with_, f"{path}.with")
            function = plan_of(self.library.get(code.function, path), parameters, self.ctx, path)
            plans[name] = Plan(function, getattr(code, "arrays", False))
        return plans

    def _mapped(self, member: Member, code: Code, path: str, mapped: dict[str, Mapping[str, Any]]) -> Any:
        """Return what a module's `map_strategy` gives an agent; it is called once for all agents that name it there."""
        if path not in mapped:
            is_of_team = member.own is None or member.own.strategy is None
            listed = self.by_team[member.team] if is_of_team else [member]
            config = {one.name: {"start_node_id": self._agents[one.name].node, **self.config(one)} for one in listed}
            function = self.library.get(code.function, path)
            answer = called(function, self.parameters(code.with_, f"{path}.with"), (config,), path)
            if not isinstance(answer, Mapping):
                raise ScenarioError(
                    path, f"map_strategy gives {shown(answer)}, and not a dict of agents and strategies."
                )
            mapped[path] = answer
        strategy = mapped[path].get(member.name)
        if strategy is not None and not callable(strategy):
            raise ScenarioError(
                path, f"map_strategy gives {shown(strategy)} for {member.name!r}, which is no strategy."
            )
        return strategy

    # -- rules, conflicts, values -------------------------------------------------------------------------------

    def _rule(self, given: str | RuleSpec, path: str) -> Rule:
        """Return the function that a rule names, or what it makes."""
        function, parameters = (given, {}) if isinstance(given, str) else (given.rule, given.with_)
        rule: Rule = rule_of(self.library.get(function, path, RULES), self.parameters(parameters, f"{path}.with"), path)
        return rule

    def _conflicts(self, given: Conflicts) -> Any:
        rules, path = import_module(RULES), "conflicts.resolve"
        capacity = given.capacity
        if isinstance(capacity, dict):
            capacity = {_as_node(node, "conflicts.capacity"): number for node, number in capacity.items()}
        if isinstance(given.resolve, ByPriority):
            resolve = rules.by_priority(given.resolve.by_priority)
        elif given.resolve in ("at_random", "nobody"):
            resolve = getattr(rules, given.resolve)()
        else:
            resolve = self.library.get(given.resolve, path)
        return rules.Conflicts(capacity, given.among, allow_swaps=given.allow_swaps, resolve=resolve)

    def parameters(self, given: Mapping[str, Any], path: str) -> dict[str, Any]:
        """Return parameters or facts by name, each as `value` makes it."""
        return {name: self.value(one, joined(path, name)) for name, one in given.items()}

    def value(self, value: object, path: str) -> Any:
        """Return a copy, in which `{node_at: [x, y]}` is a node, and `{function: …, with: …}` what that gives."""
        if isinstance(value, list):
            return [self.value(one, joined(path, number)) for number, one in enumerate(value)]
        if not isinstance(value, Mapping):
            return value
        call = call_in(value, path)
        if call is not None:
            return self._call(call, path)
        if set(value) == {"node_at"}:
            where = joined(path, "node_at")
            return node_at(self.ctx, checked(value["node_at"], LatLon | tuple[float, float], where), where)
        return {key: self.value(one, joined(path, key)) for key, one in value.items()}

    def _call(self, call: Code, path: str) -> Any:
        """Return what a function among the parameters gives, or itself if it is one that is called later."""
        function = self.library.get(call.function, path)
        given = self.parameters(call.with_, joined(path, "with"))
        first = (self.ctx,) if first_of(function) == "ctx" else ()
        if first_of(function) == "state":
            return strategy_of(function, given, self.ctx, path)
        return called(function, given, first, path) if given or not needs(function, first) else function


def _first_given(*values: T | None) -> T | None:
    """Return the first that is not None: an agent's own value counts before its team's."""
    return next((value for value in values if value is not None), None)


@overload
def _as_code(given: str | Code) -> Code: ...
@overload
def _as_code(given: str | Code | None) -> Code | None: ...
def _as_code(given: str | Code | None) -> Code | None:
    return Code(function=given) if isinstance(given, str) else given


def _as_node(key: str | int, path: str) -> int:
    """Return a node that is a key: in JSON, all keys are texts."""
    try:
        return as_int(int(key), "A node id")
    except ValueError:
        raise ScenarioError(joined(path, key), "is not a node id.") from None


# -- drawing a start again for another seed --------------------------------------------------------------------------


class Values(NamedTuple):
    """The values of a game before its first turn."""

    facts: dict[str, Any]
    data: dict[str, Any]
    scores: dict[Any, float]
    events: list[dict[str, Any]]


def values_of(game: Game) -> Values:
    """Return copies of what a game holds now."""
    return Values(dict(game.facts), deepcopy(game.data), dict(game.scores), [dict(event) for event in game.events])


def take_out(game: Game, built: Values) -> tuple[Values, list[str]]:
    """Empty a game; return what was added or changed since it held `built`, and which keys of `data` were removed."""
    now = values_of(game)
    removed = [key for key in built.data if key not in now.data]
    game.state.facts.clear()
    game.data.clear()
    game.scores.clear()
    game.events.clear()
    return Values(
        {name: fact for name, fact in now.facts.items() if fact is not built.facts.get(name)},
        _changed(now.data, built.data),
        _changed(now.scores, built.scores),
        now.events[len(built.events) :],
    ), removed


def put_back(game: Game, changed: Values, removed: list[str]) -> None:
    """Make the changes that `take_out` has returned."""
    game.publish(**changed.facts)
    game.data.update(changed.data)
    for key in removed:
        game.data.pop(key, None)
    game.scores.update(changed.scores)
    game.events.extend(changed.events)


def move_start(agent: agents.Member, before: int | Position, now: int | Position) -> None:
    """Let an agent begin elsewhere, unless it has been moved since: nodes, or (x, y, z)."""
    if isinstance(now, tuple):
        if agent.position == before:
            agent.position = now
            agent.position = now  # as if it had been there before, too
    elif agent.current_node_id == before:
        agent.current_node_id = agent.prev_node_id = now


def _changed(now: Mapping[Any, Any], built: Mapping[Any, Any]) -> dict[Any, Any]:
    return {key: value for key, value in now.items() if key not in built or not is_same(value, built[key])}
