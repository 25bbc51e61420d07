"""From a checked scenario to a context that is ready to play."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

from gamms.arguments import as_int
from gamms.context import Context
from gamms.scenario.checks import RULES, call_in, sensor_type
from gamms.scenario.code import Library, called, first_of, needs, rule_of, strategy_of
from gamms.scenario.errors import ScenarioError, at, joined
from gamms.scenario.explain import checked
from gamms.scenario.placing import Member, members, node_at, place
from gamms.scenario.shape import ByPriority, Code, Conflicts, LatLon, Sensor, Spec, said
from gamms.text import shown

Strategies = Mapping[str, Callable[..., Any]]  # by team or agent


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

    def build(self) -> None:
        """Put agents, facts, strategies, rules and conflicts into the context.

        Raises:
            ScenarioError: something cannot be done as it is written.
        """
        nodes = place(self.ctx, self.spec, self.members)
        for member in self.members:
            self._add_agent(member, nodes[member.name])
        game = self.ctx.game
        with at("facts"):
            game.publish(**self.parameters(self.spec.facts, "facts"))
        game.data.update(self.parameters(self.spec.data, "data"))
        self._add_strategies()
        for number, rule in enumerate(self.spec.rules):
            self._add_rule(rule, f"rules.{number}")
        if self.spec.conflicts is not None:
            with at("conflicts"):
                game.conflicts = self._conflicts(self.spec.conflicts)

    # -- agents and sensors -------------------------------------------------------------------------------------

    def _add_agent(self, member: Member, node: int) -> None:
        team, own = self.spec.teams[member.team], member.told
        wish = {key: _first_given(getattr(own, key, None), getattr(team, key)) for key in ("speed", "altitude")}
        keywords: dict[str, Any] = {"team": member.team, "meta": self.config(member)["meta"]}
        if self.kind_of(member) == "aerial":
            x, y = self.ctx.graph.graph.get_node(node)[1:3]
            keywords |= {"type": "AERIAL", "position": (x, y, wish["altitude"] or 0.0)}
        if wish["speed"] is not None:
            keywords["speed"] = wish["speed"]
        with at(member.path):
            sensors = {name: self._sensor(name, member) for name in self.sensors_of(member)}
            self.ctx.agent.create_agent(member.name, start_node_id=node, sensors=sensors, **keywords)

    def kind_of(self, member: Member) -> str:
        """Whether an agent is "basic" or "aerial"."""
        return _first_given(member.told and member.told.type, self.spec.teams[member.team].type) or "basic"

    def sensors_of(self, member: Member) -> list[str]:
        """The names of the sensors that an agent carries."""
        return _first_given(member.told and member.told.sensors, self.spec.teams[member.team].sensors) or []

    def config(self, member: Member) -> dict[str, Any]:
        """What the paper's `map_strategy` is told about an agent."""
        meta = {**self.spec.teams[member.team].meta, **(member.told.meta if member.told else {})}
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
                return self._function_sensor(sensor, id, path)
            keywords = said(sensor)
            kind = sensor_type(keywords.pop("type"))
            if isinstance(sensor.at, tuple):
                keywords["at"] = (float(sensor.at[0]), float(sensor.at[1]))
            return self.ctx.sensor.create_sensor(id, kind, **keywords)

    def _function_sensor(self, sensor: Sensor, id: str, path: str) -> Any:
        """A sensor whose data is what a function returns, or what one that is made with parameters does."""
        function = self.library.get(sensor.function or "", path)
        given = self.parameters(sensor.with_ or {}, f"{path}.with")
        if given or first_of(function) == "ctx":
            function = called(function, given, (self.ctx,) if first_of(function) == "ctx" else (), path)
        return self.ctx.sensor.from_function(id, function)

    # -- strategies ---------------------------------------------------------------------------------------------

    def _add_strategies(self) -> None:
        mapped: dict[str, Mapping[str, Any]] = {}
        for member in self.members:
            strategy = self._strategy(member, mapped)
            if strategy is not None:
                self.ctx.agent.get_agent(member.name).register_strategy(strategy)

    def _strategy(self, member: Member, mapped: dict[str, Mapping[str, Any]]) -> Any:
        given = self.given.get(member.name, self.given.get(member.team))
        own = None if member.told is None else member.told.strategy
        path = f"{f'teams.{member.team}' if own is None else member.path}.strategy"
        if given is not None:
            return strategy_of(given, None, self.ctx, f"strategies[{member.team!r}]")
        code = _as_code(self.spec.teams[member.team].strategy if own is None else own)
        if code is None:
            return None
        if ":" not in code.function:
            return self._mapped(member, code, path, mapped)
        return strategy_of(
            self.library.get(code.function, path), self.parameters(code.with_, f"{path}.with"), self.ctx, path
        )

    def _mapped(self, member: Member, code: Code, path: str, mapped: dict[str, Mapping[str, Any]]) -> Any:
        """What a module's `map_strategy` says for an agent: it is asked once for all that name the module there."""
        if path not in mapped:
            listed = [one for one in self.members if path in (f"teams.{one.team}.strategy", f"{one.path}.strategy")]
            config = {
                one.name: {"start_node_id": self.ctx.agent.get_agent(one.name).current_node_id, **self.config(one)}
                for one in listed
            }
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

    def _add_rule(self, given: Any, path: str) -> None:
        name, parameters, phase = (
            (given, {}, "after") if isinstance(given, str) else (given.rule, given.with_, given.phase)
        )
        rule = rule_of(self.library.get(name, path, RULES), self.parameters(parameters, f"{path}.with"), path)
        with at(path):
            self.ctx.game.add(rule, phase=phase)

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
        """Parameters or facts by name, each as `value` makes it."""
        return {name: self.value(one, joined(path, name)) for name, one in given.items()}

    def value(self, value: Any, path: str) -> Any:
        """A copy, in which `{node_at: [x, y]}` is a node, and `{function: …, with: …}` what that gives."""
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
        """What a function among the parameters gives, or itself if it is one that is called later."""
        function = self.library.get(call.function, path)
        given = self.parameters(call.with_, joined(path, "with"))
        first = (self.ctx,) if first_of(function) == "ctx" else ()
        if first_of(function) == "state":
            return strategy_of(function, given, self.ctx, path)
        return called(function, given, first, path) if given or not needs(function, first) else function


def _first_given(*values: Any) -> Any:
    """The first that is not None: what an agent says for itself counts before what its team says."""
    return next((value for value in values if value is not None), None)


def _as_code(given: str | Code | None) -> Code | None:
    return Code(function=given) if isinstance(given, str) else given


def _as_node(key: str | int, path: str) -> int:
    """A node that is a key: in JSON, all keys are texts."""
    try:
        return as_int(int(key), "A node id")
    except ValueError:
        raise ScenarioError(joined(path, key), "is no node id.") from None
