"""Build the game of a scenario in a context, rebuild it for another seed, and write out its defaults."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from hashlib import sha256
from importlib import import_module
from itertools import chain
from operator import is_
from typing import Any, NamedTuple

from gamms.agent import BaseAgent as Agent
from gamms.arguments import DescribedFunction
from gamms.context import Context
from gamms.game import Game, Plan
from gamms.game.hidden_state import make_image
from gamms.game.settings import get_rule_spec, refuse_unused
from gamms.game.slots import refuse_speeds
from gamms.graph.storage import MapSnapshot
from gamms.ir.graph import ClosedEdges, IntArray
from gamms.plain import Plain, as_json, is_same
from gamms.scenario import spec as schema
from gamms.scenario.code import (
    GIVEN_LATER,
    HUMAN,
    RULES,
    CodeLibrary,
    Function,
    call_function,
    find_first_parameter,
    is_defined_in,
    is_needing_more,
    list_plain_defaults,
    locate_files,
    make_from_function,
)
from gamms.scenario.documents import ScenarioError, copy_plain, join_path, locate_errors
from gamms.scenario.maps import compute_digest
from gamms.scenario.placement import AgentPlacement, TeamMember, find_node, get_mode, is_flying, list_members
from gamms.scenario.spec import Code, Spec, Values, convert_plain, expand, list_given_values, to_plain
from gamms.scenario.validation import NamedCode, call_in, find_sensor_type, list_code
from gamms.sensor.catalog import KINDS
from gamms.text import shown
from gamms.typing.actions import make_strategy
from gamms.typing.game import IConflicts, Rule

Strategies = Mapping[str, Function]  # by team or agent
_IN_FULL: dict[str, type[Any]] = {
    "rule": schema.Rule,
    "plan": schema.Plan,
}  # kind of code -> the mapping that a bare reference stands for; else Code
_Start = int | tuple[float, float, float]  # a node, or (x, y, z)


class _BuiltAgent(NamedTuple):
    """An agent and the values from which it was built."""

    agent: Agent
    node: int
    start: _Start
    meta: Values
    functions: dict[str, tuple[Any, Function]]  # sensor name -> the sensor and its function
    strategy: Function | None = None


class _SeededParts(NamedTuple):
    """Everything built with one seed; read-only."""

    agents: dict[str, _BuiltAgent]  # by name
    rules: dict[str, Rule]  # by their names in the game
    plans: dict[str, Plan]  # by team
    values: dict[str, dict[Any, Any]]  # of the game


class Builder:
    """Builds a game in a context that already has the map.

    Args:
        ctx: the context.
        spec: the scenario.
        library: the functions that it names.
        strategies: strategies by team or agent, which replace the scenario's.
    """

    def __init__(self, ctx: Context, spec: Spec, library: CodeLibrary, strategies: Strategies) -> None:
        self.ctx = ctx
        self.spec = spec
        self.library = library
        self.given = strategies
        self.by_team = list_members(spec)
        self.members = list(chain.from_iterable(self.by_team.values()))
        self._agents: dict[str, _BuiltAgent] = {}
        self._rules: dict[str, Rule] = {}  # by their names in the game
        self._plans: dict[str, Plan] = {}  # by team
        self._values = _copy_values(ctx.game)
        self._calls = 0  # number of calls whose result may change from call to call
        self._again: set[str] = set()  # the parts of the game that contain such calls
        self._lasting: set[int] = set()  # numbers of the rules that are the same for all seeds
        self._placing: AgentPlacement | None = None
        self._map: MapSnapshot | None = None  # the map before the scenario's code changed it; None if it did not
        self._called: dict[str, Any] = {}  # path of a user's function -> its first result
        self._by_seed: list[str] = []  # paths of functions that used the seed
        self._collected: frozenset[str] = frozenset()  # names of the collectors that functions have added

    def build(self) -> None:
        """Put agents, facts, strategies, rules and conflicts into the context.

        Raises:
            ScenarioError: a part cannot be built as it is written.
        """
        map = self.ctx.graph.storage.snapshot()
        nodes = self._place_agents()
        with self._note_seeded_calls("agents"):
            self._agents = {one.name: self._add_agent(one, nodes[one.name]) for one in self.members}
        game = self.ctx.game
        self._check_nodes()
        with self._note_seeded_calls("values"):
            self._add_values()
        with self._note_seeded_calls("strategies"):
            self._add_strategies()
        with self._note_seeded_calls("plans"):
            self._plans = self._make_plans()
        game.plans = self._plans
        with self._note_seeded_calls("rules"):
            for number, given in enumerate(self.spec.rules):
                self._add_rule(given, number)
        if self.spec.conflicts is not None:
            with locate_errors("conflicts"):
                game.conflicts = self._make_conflicts(self.spec.conflicts)
        with locate_errors("settings"):
            refuse_unused(game)
        with locate_errors("settings.weight"):
            self.ctx.graph.graph.weights(game.weight)
        self._collected = frozenset(game.internals.parts.collectors.by_name)
        self._values = _copy_values(game)
        self._keep()
        if (map.revision, map.obstacle_revision) != (self.ctx.graph.graph.revision, self.ctx.graph.obstacle_revision):
            self._map = map

    def draw_again(self) -> None:
        """Rebuild everything that depends on the context's seed, which has changed.

        This covers positions, results of functions, strategies and rules. Later changes by the program stay: a moved
        agent, another strategy, a published fact.

        Raises:
            ScenarioError: a part cannot be built as it is written; for example, some agents cannot be placed.
        """
        if self._map is not None:
            self.ctx.graph.storage.restore(self._map)
        drawn: _SeededParts = self.ctx.game.internals.state.drawn
        self._agents, self._rules, self._plans, self._values = drawn
        nodes = self._place_agents()
        self._agents = {one.name: self._draw_agent(one, nodes[one.name]) for one in self.members}
        if self._again:
            with self.ctx.game.internals.parts.collectors.allow_replacing(self._collected):
                self._call_again()
        self._keep()

    def _call_again(self) -> None:
        """Call the scenario's functions again and store their values; keep other values that the program has set."""
        game = self.ctx.game
        now = _copy_values(game)
        first = self._values
        changes = {name: _find_changed_values(now[name], first[name], is_same) for name in ("data", "scores", "events")}
        facts = _find_changed_values(now["facts"], first["facts"], is_)
        removed = first["data"].keys() - now["data"].keys()
        state = game.internals.state
        private = _find_changed_values(now["private"], first["private"], is_)
        for values in (state.facts, state.agent_facts, state.team_facts, game.data, game.scores):
            values.clear()
        state.events = []
        self._add_values()
        if "strategies" in self._again:
            self._add_strategies()
        if "plans" in self._again:
            self._draw_plans()
        if "rules" in self._again:
            self._draw_rules()
        self._values = _copy_values(game)
        game.publish(**facts)
        for (field, to, name), fact in private.items():
            getattr(state, field).setdefault(to, {})[name] = fact
        game.data.update(changes["data"])
        for key in removed:
            game.data.pop(key, None)
        game.scores.update(changes["scores"])
        game.events.extend(changes["events"].values())

    def list_varying(self, others: Iterable["Builder"]) -> list[str]:
        """Return the paths of functions whose results depend on the seed.

        Args:
            others: builders of the same game with other seeds; used only if there are functions of users.
        """
        if self._called:
            known = {path: _make_image(gave) for path, gave in self._called.items()}
            for other in others:
                self._by_seed += [
                    path for path, image in known.items() if _make_image(other._called.get(path)) != image
                ]
        return [*dict.fromkeys(self._by_seed)]

    def list_removed_edges(self) -> ClosedEdges:
        """Return the edges that the code of the scenario has removed from the map, by id."""
        if self._map is None:
            return {}
        storage = self.ctx.graph.storage
        now = storage.snapshot()
        edge_ids, closed = storage.list_roads()
        known = {*edge_ids.tolist(), *closed}
        storage.restore(self._map)
        edges = storage.get_edges_as_given([id for id in self._map.columns.edge_ids.tolist() if id not in known])
        storage.restore(now)
        return edges

    def place(self, seeds: Sequence[int]) -> dict[str, IntArray]:
        """Return the starting nodes of the agents for these seeds, on the map before code changes it: name -> ids."""
        assert self._placing is not None  # noqa: S101 - it is built
        return self._placing.place(seeds)

    def has_other_values(self, paths: Iterable[str]) -> bool:
        """Return whether a path is none of strategies, plans and sensors, or of their parameters."""
        known = self._find_function_paths().values()
        return any(not any(_is_within(path, one) for one in known) for path in paths)

    def get_functions(self, paths: Sequence[str], seed: int) -> dict[tuple[str, str], Function | None]:
        """Reset the game with a seed; return the functions at these paths: of strategies, plans and sensors.

        Keys are ("agent", name), ("team", name) or ("sensor", id).
        """
        self.ctx.game.reset(seed=seed)
        known = self._find_function_paths().items()
        chosen = [key for key, where in known if any(_is_within(path, where) for path in paths)]
        return {key: self._find_function(*key) for key in chosen}

    def _find_function_paths(self) -> dict[tuple[str, str], str]:
        """Return the places of strategies, plans and function sensors in the scenario."""
        where = {("agent", member.name): self._find_strategy_path(member) for member in self.members}
        where |= {("team", team): f"teams.{team}.plan" for team in self._plans}
        for member in self.members:
            declared = self._list_sensors(member)
            own = self._agents[member.name].functions
            where |= {("sensor", sensor.sensor_id): declared[name][1] for name, (sensor, _) in own.items()}
        return where

    def _find_function(self, kind: str, name: str) -> Function | None:
        if kind == "sensor":
            sensor: Any = self.ctx.sensor.get_sensor(name)
            function: Function = sensor.function
            return function
        return self._plans[name].function if kind == "team" else self._agents[name].strategy

    def _find_strategy_path(self, member: TeamMember) -> str:
        """Return the place of the strategy of an agent."""
        is_given = member.name in self.given or member.team in self.given
        return f"strategies[{shown(member.team)}]" if is_given else self._find_place(member, "strategy")

    @contextmanager
    def _note_seeded_calls(self, part: str) -> Iterator[None]:
        """Record whether the block makes calls that another seed has to repeat."""
        before = self._calls
        yield
        if self._calls != before:
            self._again.add(part)

    def _call_and_note(
        self, function: Function, path: str, call: Callable[[], Any]
    ) -> Any:  # Any: whatever functions return
        """Call a function and return its result, and record whether the result may depend on the seed."""
        before = self.ctx.seed_uses
        gave = call()
        if gave is not function and not (is_defined_in(function, RULES) and find_first_parameter(function) != "ctx"):
            self._calls += 1
        if not _is_ours(function) and gave is not function and getattr(gave, "func", None) is not function:
            self._called.setdefault(path, gave)
            if self.ctx.seed_uses != before:
                self._by_seed.append(path)
        return gave

    def _keep(self) -> None:
        """Store the seeded parts in the state of the game, so that snapshots restore them."""
        self.ctx.game.internals.state.drawn = _SeededParts(self._agents, self._rules, self._plans, self._values)

    def _draw_plans(self) -> None:
        """Make the plans again, and replace each plan that is still in use."""
        game = self.ctx.game
        before = self._plans
        self._plans = self._make_plans()
        game.plans = {team: self._plans[team] if one == before.get(team) else one for team, one in game.plans.items()}

    def _draw_rules(self) -> None:
        """Make the seeded rules again, prepare all rules, and replace each rule that is still in use."""
        now = self.ctx.game.rules
        known = self._rules
        self._rules = {}
        for (name, before), (number, given) in zip(known.items(), enumerate(self.spec.rules), strict=True):
            with locate_errors(f"rules.{number}"):
                rule = before if number in self._lasting else self._make_rule(given, f"rules.{number}")
                prepare = get_rule_spec(rule).prepare
                if prepare is not None:
                    prepare(self.ctx)
            if rule is not before:
                now = tuple(one._replace(rule=rule) if one.name == name and one.rule is before else one for one in now)
            self._rules[name] = rule
        if now is not self.ctx.game.rules:
            self.ctx.game.internals.restore_rules(now)

    def _place_agents(self) -> dict[str, int]:
        """Return the starting node of each agent for the seed of the context, by name."""
        if self._placing is None or self._placing.map.columns is not self.ctx.graph.columns():
            self._placing = AgentPlacement(self.ctx, self.spec, self.by_team)
        return {name: int(nodes[0]) for name, nodes in self._placing.place([self.ctx.seed]).items()}

    def _check_nodes(self) -> None:
        """Check ids of nodes that a game itself would not miss."""
        nodes: dict[str, object] = {"settings.default_action": self.spec.settings.default_action}
        for name, channel in self.spec.channels.items():
            nodes |= {f"channels.{name}.jammers.{i}.at": one.at for i, one in enumerate(channel.jammers)}
        for path, node in nodes.items():
            if isinstance(node, int):
                with locate_errors(path):
                    self.ctx.graph.graph.get_node(node)

    def _add_values(self) -> None:
        game = self.ctx.game
        with locate_errors("facts"):
            game.publish(**self._convert_parameters(self.spec.facts, "facts"))
        game.data.update(self._convert_parameters(self.spec.data, "data"))

    # -- agents and sensors -------------------------------------------------------------------------------------

    def _add_agent(self, member: TeamMember, node: int) -> _BuiltAgent:
        start = self._start(member, node)
        meta = self._describe_agent(member)["meta"]
        keywords: dict[str, Any] = {"team": member.team, "meta": meta}
        if isinstance(start, tuple):
            keywords |= {"type": "AERIAL", "position": start}
        speed = self._get_value(member, "speed")
        if speed is not None:
            keywords["speed"] = speed
        mode = get_mode(self.spec.teams[member.team], member.listed)
        if mode is not None:
            keywords["mode"] = mode
        if self.spec.settings.speed_unit == "edges":
            is_own = member.listed is not None and member.listed.speed is not None
            with locate_errors(join_path(member.path if is_own else f"teams.{member.team}", "speed")):
                refuse_speeds([(member.name, mode, speed)])
        with locate_errors(member.path):
            declared = self._list_sensors(member)
            sensors = {name: self._make_sensor(f"{member.name}/{name}", *one) for name, one in declared.items()}
            agent = self.ctx.agent.create_agent(member.name, start_node_id=node, sensors=sensors, **keywords)
        own = (name for name, (sensor, _) in declared.items() if sensor.function is not None)
        functions = {name: (sensors[name], sensors[name].function) for name in own}
        return _BuiltAgent(agent, node, start, deepcopy(meta), functions)

    def _draw_agent(self, member: TeamMember, node: int) -> _BuiltAgent:
        built = self._agents[member.name]
        start = self._start(member, node)
        agent: Any = built.agent  # Any: with attributes of its own
        _move_start(agent, built.start, start)
        if "agents" not in self._again:
            return built._replace(node=node, start=start)
        meta = self._describe_agent(member)["meta"]
        functions = {}
        if is_same(getattr(agent, "meta", None), built.meta):
            agent.meta = meta
        declared = self._list_sensors(member)
        for name, (sensor, before) in built.functions.items():
            with locate_errors(declared[name][1]):
                function = self._make_function(*declared[name])
                if sensor.function is before:
                    sensor.function = function
            functions[name] = sensor, function
        return _BuiltAgent(agent, node, start, deepcopy(meta), functions, built.strategy)

    def _get_value(self, member: TeamMember, key: str) -> Any:
        """Return the agent's own value of a key, else its team's value; None if neither is set."""
        own = getattr(member.listed, key, None)
        return getattr(self.spec.teams[member.team], key) if own is None else own

    def _start(self, member: TeamMember, node: int) -> _Start:
        if not is_flying(self._get_value(member, "type")):
            return node
        _, x, y = self.ctx.graph.graph.get_node(node)[:3]
        return (x, y, self._get_value(member, "altitude") or 0.0)

    def _describe_agent(self, member: TeamMember) -> Values:
        """Return the description of an agent for the paper's `map_strategy`, without its node."""
        meta = {**self.spec.teams[member.team].meta, **(member.listed.meta if member.listed else {})}
        return {
            "team": member.team,
            "type": "aerial" if is_flying(self._get_value(member, "type")) else "basic",
            "sensors": list(self._get_value(member, "sensors") or ()),
            "meta": {"team": member.team, **self._convert_parameters(meta, join_path(member.path, "meta"))},
        }

    def _list_sensors(self, member: TeamMember) -> dict[str, tuple[schema.Sensor, str]]:
        """Return the sensors that an agent carries, each with its place in the scenario, by name."""
        given = self._get_value(member, "sensors") or ()
        if not isinstance(given, dict):
            return {name: (self.spec.sensors[name], f"sensors.{name}") for name in given}
        where = self._find_place(member, "sensors")
        return {name: (sensor, join_path(where, name)) for name, sensor in given.items()}

    def _find_place(self, member: TeamMember, key: str) -> str:
        """Return the place of a key that an agent has for itself, or from its team."""
        is_own = getattr(member.listed, key, None) is not None
        return join_path(member.path if is_own else f"teams.{member.team}", key)

    def _make_sensor(self, sensor_id: str, sensor: schema.Sensor, path: str) -> Any:
        with locate_errors(path):
            if sensor.function is not None:
                return self.ctx.sensor.from_function(sensor_id, self._make_function(sensor, path))
            return self.ctx.sensor.from_declaration(sensor_id, list_given_values(sensor))

    def _make_function(self, sensor: schema.Sensor, path: str) -> Function:
        """Return the function of a sensor; with parameters, the function that it makes."""
        function = self.library.get(sensor.function or "", path)
        given = self._make_given(function, sensor.with_ or {}, path)
        if given or find_first_parameter(function) == "ctx":
            first = (self.ctx,) if find_first_parameter(function) == "ctx" else ()
            function = self._call_and_note(function, path, partial(call_function, function, given, first, path))
        return function

    # -- strategies ---------------------------------------------------------------------------------------------

    def _add_strategies(self) -> None:
        """Make the strategies, and set them on agents whose strategy the program has not replaced."""
        mapped: dict[str, Mapping[str, Function]] = {}
        for name, strategy in {one.name: self._make_strategy(one, mapped) for one in self.members}.items():
            built = self._agents[name]
            if strategy is not None and built.agent.strategy is built.strategy:
                built.agent.decide_by(strategy)
            self._agents[name] = built if strategy is None else built._replace(strategy=strategy)

    def _make_strategy(self, member: TeamMember, mapped: dict[str, Mapping[str, Function]]) -> Function | None:
        given = self.given.get(member.name, self.given.get(member.team))
        if given is not None:
            where = self._find_strategy_path(member)
            own: Function = self._call_and_note(
                given, where, partial(make_from_function, given, {}, self.ctx, where, "strategy")
            )
            return own
        path = self._find_place(member, "strategy")
        strategy = self._get_value(member, "strategy")
        if strategy is None:
            return None
        code = expand(Code, strategy)
        if ":" not in code.function:
            if path not in mapped:
                is_own = path != f"teams.{member.team}.strategy"
                mapped[path] = self._map_strategy(code, path, [member] if is_own else self.by_team[member.team])
            found = mapped[path].get(member.name)
            return None if found is None else make_strategy(self.ctx, found)
        return self._make_code(code, path, "strategy")

    def _make_code(self, code: Code, path: str, what: str) -> Function:
        """Return the strategy, plan or rule that a function is or makes."""
        function = self.library.get(code.function, path, RULES if what == "rule" else None)
        parameters = self._make_given(function, code.with_, path)
        found: Function = self._call_and_note(
            function, path, partial(make_from_function, function, parameters, self.ctx, path, what)
        )
        return found

    def _make_plans(self) -> dict[str, Plan]:
        """Return the plan of each team that has one and gets no strategy from the caller."""
        plans = {}
        for name, team in self.spec.teams.items():
            if team.plan is None or name in self.given:
                continue
            plan = expand(schema.Plan, team.plan)
            path = f"teams.{name}.plan"
            named = [member.name for member in self.by_team[name] if member.name in self.given]
            if named:
                raise ScenarioError(path, f"decides for {named[0]!r} as well: give a strategy for the whole team.")
            plans[name] = Plan(self._make_code(plan, path, "plan"), plan.arrays)
        return plans

    def _map_strategy(self, code: Code, path: str, listed: list[TeamMember]) -> Mapping[str, Function]:
        """Call the `map_strategy` of a module for agents; "human" makes one person play all of them."""
        if code.function == HUMAN:
            return dict.fromkeys([one.name for one in listed], self._make_code(code, path, "strategy"))
        config = {
            one.name: {"start_node_id": self._agents[one.name].node, **self._describe_agent(one)} for one in listed
        }
        function = self.library.get(code.function, path)
        parameters = self._make_given(function, code.with_, path)
        answer = self._call_and_note(function, path, partial(call_function, function, parameters, (config,), path))
        if not isinstance(answer, Mapping):
            raise ScenarioError(path, f"map_strategy gives {shown(answer)}, not a dict of agents and strategies.")
        for one in listed:
            given = answer.get(one.name)
            if given is not None and not callable(given):
                raise ScenarioError(
                    path, f"map_strategy gives {shown(given)} for {one.name!r}, which is not a strategy."
                )
        return answer

    # -- rules, conflicts, values -------------------------------------------------------------------------------

    def _add_rule(self, given: str | schema.Rule, number: int) -> None:
        game = self.ctx.game
        path = f"rules.{number}"
        with locate_errors(path):
            calls = self._calls
            full = expand(schema.Rule, given)
            rule = self._make_rule(given, path)
            if self._calls == calls:
                self._lasting.add(number)
            before = game.rules
            game.add(rule, phase=full.phase, name=full.name)
            if get_rule_spec(rule).prepare is not None:
                self._calls += 1
                if not _is_ours(rule):
                    self._by_seed.append(path)
        self._rules[next(one.name for one in game.rules if one not in before)] = rule

    def _make_rule(self, given: str | schema.Rule, path: str) -> Rule:
        rule = expand(schema.Rule, given)
        return self._make_code(Code(function=rule.rule, with_=rule.with_), path, "rule")

    def _make_conflicts(self, given: schema.Conflicts) -> IConflicts:
        rules = import_module(RULES)
        path = "conflicts.resolve"
        graph = self.ctx.graph.graph
        capacity = _convert_capacity(given.capacity, "conflicts.capacity", graph.get_node)
        of_edges = _convert_capacity(given.edge_capacity, "conflicts.edge_capacity", graph.get_edge)
        if isinstance(given.resolve, schema.PriorityOrder):
            with locate_errors("conflicts.resolve.by_priority"):
                resolve = rules.by_priority(given.resolve.by_priority)
        elif ":" in given.resolve:
            resolve = self.library.get(given.resolve, path)
        else:
            resolve = getattr(rules, given.resolve)()
        conflicts = rules.Conflicts(
            capacity, given.among, edge_capacity=of_edges, allow_swaps=given.allow_swaps, resolve=resolve
        )
        for key, has_edges in (("capacity", False), ("edge_capacity", True)):
            with locate_errors(f"conflicts.{key}"):
                conflicts.limits(self.ctx.graph.columns(), has_edges=has_edges)
        found: IConflicts = conflicts
        return found

    def _make_given(self, function: Function, given: Values, path: str) -> Values:
        """Return the parameters of a function, with paths resolved in the folder of the scenario."""
        return self._convert_parameters(
            locate_files(function, given, self.library.sources, path), join_path(path, "with")
        )

    def _convert_parameters(self, given: Values, path: str) -> Values:
        """Return parameters or facts by name, each converted by `_convert_value`."""
        return {name: self._convert_value(one, join_path(path, name)) for name, one in given.items()}

    def _convert_value(self, value: Plain, path: str) -> Any:
        """Copy a value; `{node_at: [x, y]}` becomes a node, and `{function: …, with: …}` the function's result."""
        if isinstance(value, list):
            return [self._convert_value(one, join_path(path, number)) for number, one in enumerate(value)]
        if not isinstance(value, Mapping):
            return value
        call = call_in(value, [path])
        if call is not None:
            return self._call(call, path)
        if set(value) == {"node_at"}:
            where = join_path(path, "node_at")
            self._calls += 1  # depends on a map that may change
            return find_node(
                self.ctx, convert_plain(value["node_at"], schema.LatLon | tuple[float, float], where), where
            )
        return {key: self._convert_value(one, join_path(path, key)) for key, one in value.items()}

    def _call(self, call: Code, path: str) -> Any:
        """Return the result of a function among the parameters, or the function itself if it is called later."""
        function = self.library.get(call.function, path)
        given = self._make_given(function, call.with_, path)
        first = (self.ctx,) if find_first_parameter(function) == "ctx" else ()
        if find_first_parameter(function) == "state":
            return self._call_and_note(
                function, path, partial(make_from_function, function, given, self.ctx, path, "strategy")
            )
        if not given and is_needing_more(function, len(first)):
            return function
        return self._call_and_note(function, path, partial(call_function, function, given, first, path))


def _is_ours(function: object) -> bool:
    return str(getattr(function, "__module__", "")).partition(".")[0] == "gamms"


def _convert_capacity(given: object, path: str, find: Callable[[int], object]) -> Any:  # Any: as `Conflicts` takes it
    """Return a capacity; the keys of a mapping become ids, because in JSON all keys are texts.

    Args:
        given: the capacity in the scenario.
        path: its place.
        find: finds a node or an edge by its id.
    """
    if not isinstance(given, dict):
        return given
    limits = {}
    for key, number in given.items():
        where = join_path(path, key)
        if not str(key).removeprefix("-").isdecimal():
            raise ScenarioError(where, "is not an id. Give ids and numbers, such as {3: 1}.")
        with locate_errors(where):
            find(int(key))
        limits[int(key)] = number
    return limits


# -- changes that are not the scenario's --------------------------------------------------------------------------


def _copy_values(game: Game) -> dict[str, dict[Any, Any]]:
    """Copy the values of a game before its first turn."""
    events = {number: dict(event) for number, event in enumerate(game.events)}
    state = game.internals.state
    private: dict[tuple[str, Any, str], Any] = {}
    for field in ("agent_facts", "team_facts"):
        for to, facts in getattr(state, field).items():
            private.update({(field, to, name): fact for name, fact in facts.items()})
    values = {"facts": dict(game.facts), "data": deepcopy(game.data), "scores": dict(game.scores), "events": events}
    return {**values, "private": private}


def _find_changed_values(
    now: Mapping[Any, Any], built: Mapping[Any, Any], is_same: Callable[[Any, Any], bool]
) -> dict[Any, Any]:
    return {key: value for key, value in now.items() if key not in built or not is_same(value, built[key])}


def _move_start(agent: Any, before: _Start, now: _Start) -> None:
    """Move an agent to another start, unless the program has moved it from its old start."""
    is_aerial = isinstance(now, tuple)
    if (agent.position if is_aerial else agent.current_node_id) != before:
        return
    if is_aerial:
        agent.position = now
        agent.position = now  # so that its previous position is the same
    else:
        agent.current_node_id = now
        agent.prev_node_id = now


# -- defaults -----------------------------------------------------------------------------------------------------


def write_out(spec: Spec, library: CodeLibrary) -> Values:
    """Return a scenario as plain values with the defaults of its keys and functions, as stored in recordings.

    Later versions build the same game from it. A default that is not a plain value, such as a function, is left out.
    Nothing is imported, so a replaced part, such as a strategy, stays as it is written.
    """
    plain: Values = copy_plain(to_plain(spec))
    if not spec.files:
        del plain["files"]  # as in recordings of earlier versions
    for sensor in _list_plain_sensors(plain):
        sensor["sensor_range"] = sensor.pop("range_m")
        kind = None if sensor["type"] is None else find_sensor_type(sensor["type"])
        defaults = {} if kind is None else copy_plain(KINDS[kind].keywords)
        sensor |= {name: value for name, value in defaults.items() if sensor[name] is None}
    for one in list_code(spec):
        if one.what != "resolver":
            _write_defaults(plain, one, library.get_known(one.reference, one.short))
    return plain


def _list_plain_sensors(plain: Values) -> Iterator[Values]:
    """Yield the sensors of a scenario, of its teams and of their agents."""
    teams = plain["teams"].values()
    for part in chain([plain], teams, *(team["agents"] for team in teams)):
        yield from part["sensors"].values() if isinstance(part["sensors"], dict) else ()


def make_digests(spec: Spec, library: CodeLibrary, map: MapSnapshot) -> dict[str, str]:
    """Return the SHA-256 of each part of a scenario that a game depends on, without strategies and plans.

    The rules and other named code are imported, so that a default counts like the same value written out.
    """
    for one in list_code(spec):
        decides = one.keys[0] == "teams" and not {"strategy", "plan"}.isdisjoint(one.keys[2:])
        if one.what != "resolver" and one.keys[0] != "map" and not decides:
            library.get(one.reference, one.path, one.short)
    plain = write_out(spec, library)
    parts = {key: value for key, value in plain.items() if key not in ("name", "description", "seed", "map")}
    for team in parts["teams"].values():
        for part in (team, *team["agents"]):
            part["strategy"] = None
            part["plan"] = None
    written = {key: json.dumps(as_json(value), sort_keys=True).encode() for key, value in parts.items()}
    found = {key: sha256(value).hexdigest() for key, value in written.items()}
    return {**found, "map": compute_digest(map.columns, map.obstacles.corners)}


def _write_defaults(plain: Values, one: NamedCode, function: Function | None) -> None:
    """Replace a bare name of a function by a mapping with its defaults."""
    here: Any = plain
    for key in one.keys[:-1]:
        here = here[key]
    code = here[one.keys[-1]]
    if isinstance(code, str):
        code = to_plain(expand(_IN_FULL.get(one.what, Code), code))
    given = code.get("with") or {}
    if function is not None:
        first = find_first_parameter(function)
        is_called = given or (
            first == "ctx" if one.what == "sensor" else not is_needing_more(function, int(first in GIVEN_LATER))
        )
        if is_called:
            given = {**list_plain_defaults(function), **given}
        elif one.what == "sensor":
            given = None
    here[one.keys[-1]] = {**code, "with": given}


def _make_image(gave: Any) -> tuple[object, str]:
    """Return an object that is equal for results that do the same; functions of GAMMS show their arguments."""
    return make_image(gave), gave.call if isinstance(gave, DescribedFunction) else ""


def _is_within(path: str, outer: str) -> bool:
    """Return whether a path equals another path, or lies below it."""
    return path == outer or path.startswith(f"{outer}.")
