"""What the games of a batch share that have the same agents, settings, rules and strategies: the plan of their rows."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from gamms.game.array_functions.view import ArrayStrategy
from gamms.game.block.columns import AgentTable, ComingAgent, PlayedGame, find_decider, get_sensors
from gamms.game.block.in_core import find_conflicts_in_core, find_core_forms, list_called_rules
from gamms.game.block.sensing import list_sensors_called_each_turn
from gamms.game.conflicts import find_unranked, refuse_unranked
from gamms.game.hidden_state import find_names
from gamms.game.order import make_left_out_error
from gamms.game.rows.by_seed import GamesBySeed
from gamms.game.settings import NamedRule, Plan
from gamms.game.strategy_specs import get_strategy_spec, is_deciding_in_arrays, make_form_key
from gamms.ir.game_state import KEPT
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import as_code, shown

_OF_SENSORS = {"get_sensor", "sensors"}
"""Names by which a function gets sensors."""


class StrategyGroup(NamedTuple):
    """The agents for which one array function decides."""

    name: str
    agents: IntArray  # numbers in the roster
    form: ArrayStrategy


class RowPlan(NamedTuple):
    """What games with the same agents, settings, rules and strategies share. It never changes.

    Attributes:
        roster: the agents, and those that may come.
        settings: the settings.
        rules: the rules that are called in turns, outside of the core.
        groups: the array functions that decide.
        is_asked: (agents,) whether the strategy or the team plan of each agent is called game by game.
        is_observing: (agents,) whether the sensors of each agent are called in each turn.
        drives: (agents,) whether each agent obeys turns by metres: its context knows by which edges it has come.
        is_left_out: (agents,) whether the order of play, or the priorities in conflicts, leave out each agent's team.
        is_unlisted: (agents,) whether the order of play does.
        has_checks: whether rules may refuse moves and deeds.
        has_conflicts: whether functions decide conflicts.
        acts: whether functions are called between decisions and moves.
        calls_each: whether functions are called game by game.
        has_array_functions: whether functions of arrays are called.
        asks_all: whether the strategies of all agents of the start are called game by game.
        functions: the plain functions that are called.
        periods: the periods of the collectors, in turns.
        core_keys: the keys of `ctx.game.data` and of facts that belong to rules of the core or of arrays.
        facts_in_core: the key of each fact that the core knows, and the function that returns it for games.
    """

    roster: AgentTable
    settings: Mapping[str, Any]
    rules: Sequence[NamedRule]
    groups: Sequence[StrategyGroup]
    is_asked: BoolArray
    is_observing: BoolArray
    drives: BoolArray
    is_left_out: BoolArray
    is_unlisted: BoolArray
    has_checks: bool
    has_conflicts: bool
    acts: bool
    calls_each: bool
    has_array_functions: bool
    asks_all: bool
    functions: Sequence[Callable[..., object]]
    periods: frozenset[int]
    core_keys: frozenset[str]
    facts_in_core: Sequence[tuple[str, Callable[..., Any]]]

    @classmethod
    def from_game(cls, game: PlayedGame, roster: AgentTable, own: GamesBySeed, *, asks_all: bool) -> "RowPlan":
        """Return the plan of games like one.

        Args:
            game: the game at its start.
            roster: the agents.
            own: the games that differ by their seeds.
            asks_all: whether the strategies of all agents of the start are called game by game.
        """
        settings = game.settings()
        rules = list_called_rules(game, roster)
        groups = _group_strategies(roster, settings)
        is_asked = np.zeros(len(roster.names), np.bool_)
        is_asked[list_asked(game, roster, all_first=asks_all)] = True
        is_observing = _find_observing_agents(game, roster)
        is_unlisted = roster.find_unlisted(settings["order"])
        is_unranked = find_unranked(settings["conflicts"], roster.names, roster.list_teams()) & ~roster.flies
        acts = is_acting_before_moves(game, roster)
        collectors = [*game.internals.parts.collectors.by_name.values()]
        drives = roster.find_driving(settings["speed_unit"])
        are_called = bool((is_asked | is_observing | drives).any()) or any(map(is_plain_rule, rules))
        deciders = [
            find_decider(roster.agents[number], settings["plans"]) for number in np.flatnonzero(is_asked).tolist()
        ]
        in_core = [one.spec for one in rules if one.spec.core_form is not None]
        has_array_functions = len(groups) > 0 or any(one.spec.is_array_function for one in rules)
        return cls(
            roster=roster,
            settings=settings,
            rules=rules,
            groups=groups,
            is_asked=is_asked,
            is_observing=is_observing,
            drives=drives,
            is_left_out=is_unlisted | is_unranked,
            is_unlisted=is_unlisted,
            has_checks=len(game.internals.parts.rules.now.checks) > 0,
            has_conflicts=has_function_of_conflicts(game, roster),
            acts=acts,
            calls_each=acts or len(collectors) > 0 or are_called,
            has_array_functions=has_array_functions,
            asks_all=asks_all,
            functions=[
                *map(own.get_example, chain(list_rule_functions(game, roster), deciders)),
                *(one.fn for one in collectors),
            ],
            periods=frozenset(one.every for one in collectors),
            core_keys=frozenset(_list_core_keys(rules)) | ({KEPT} if has_array_functions else set()),
            facts_in_core=[(str(spec.key), spec.facts_of) for spec in in_core if spec.facts_of is not None],
        )

    def list_rules(self, phase: str) -> list[NamedRule]:
        """Return the rules of a phase of the turn."""
        return [one for one in self.rules if one.phase == phase]

    @property
    def asks_functions(self) -> bool:
        """Whether functions decide for agents, or sensors of agents are called, or contexts find their routes."""
        return len(self.groups) > 0 or bool((self.is_asked | self.is_observing | self.drives).any())

    @property
    def leaves_out(self) -> bool:
        """Whether the order of play, or the priorities in conflicts, leave out the team of an agent."""
        return bool(self.is_left_out.any())

    def refuse_left_out(self, agent: int) -> None:
        """Refuse to play with an agent whose team the order of play or the priorities in conflicts leave out.

        Raises:
            BadValue, MissingKey (KeyError): always.
        """
        name = self.roster.names[agent]
        team = self.roster.teams[self.roster.team_of[agent]]
        if self.is_unlisted[agent]:
            raise make_left_out_error(name, team)
        refuse_unranked(self.settings["conflicts"], name, team)


def list_rule_functions(game: PlayedGame, roster: AgentTable) -> Iterator[Callable[..., object]]:
    """Yield the plain functions of rules and conflicts that are called."""
    for one in list_called_rules(game, roster):
        if is_plain_rule(one):
            yield one.rule
    for _, check in game.internals.parts.rules.now.checks:
        yield check
    if has_function_of_conflicts(game, roster):
        yield game.settings()["conflicts"].resolve


def are_all_asked(game: PlayedGame, roster: AgentTable, own: GamesBySeed) -> bool:
    """Return whether the strategies of all agents are called game by game, shipped ones included.

    They are if the code of a plain function, or of one that it calls, names what agents have sensed in earlier turns,
    `agent.state` or `sensor.data`, which each game must then keep; or if a function has drawn or looked for them.
    """
    if game.internals.asks_all:
        return True
    plans = game.settings()["plans"]
    deciders = [find_decider(agent, plans) for agent in roster.agents]
    sensors = [sensor for agent in roster.agents for sensor in get_sensors(agent).values()]
    called = [*list_rule_functions(game, roster), *deciders, *(getattr(one, "function", None) for one in sensors)]
    called += [one.fn for one in game.internals.parts.collectors.by_name.values()]
    return any(map(_may_look_back, find_names(filter(callable, map(own.get_example, called)))))


def _may_look_back(names: frozenset[str]) -> bool:
    """Return whether a function with these names in its code may read states of agents or data of sensors."""
    return "state" in names or ("data" in names and not _OF_SENSORS.isdisjoint(names))


def _list_core_keys(rules: Sequence[NamedRule]) -> Iterator[str]:
    """Yield the keys of `ctx.game.data` and of facts that belong to rules of the core."""
    for one in rules:
        spec = one.spec
        if spec.core_form is not None and spec.key is not None:
            yield spec.key
            if spec.disclose is not None:
                yield from spec.disclose({}, ())


def has_function_of_conflicts(game: PlayedGame, roster: AgentTable) -> bool:
    """Return whether a function decides conflicts, rather than ranks of the agents."""
    return game.settings()["conflicts"] is not None and find_conflicts_in_core(game, roster) is None


def is_acting_before_moves(game: PlayedGame, roster: AgentTable) -> bool:
    """Return whether functions are called between the decisions of agents and their moves."""
    return game.internals.parts.rules.now.act_before_moves or has_function_of_conflicts(game, roster)


def is_plain_rule(rule: NamedRule) -> bool:
    """Return whether a rule is a function of the context alone."""
    return rule.spec.core_form is None and not rule.spec.is_array_function


def list_asked(game: PlayedGame, roster: AgentTable, *, all_first: bool) -> list[int]:
    """Return the numbers of the agents whose strategies or team plans are called game by game.

    Args:
        game: the game at its start.
        roster: the agents.
        all_first: whether those of all agents of the start are.
    """
    are_created = find_first_called(game, roster) is not None  # by a function
    asked = [
        number
        for number in list_possibly_asked(game, roster)
        if are_created or not isinstance(roster.agents[number], ComingAgent)
    ]
    return sorted({*asked, *np.flatnonzero(roster.is_first).tolist()}) if all_first else asked


def list_possibly_asked(game: PlayedGame, roster: AgentTable) -> Iterator[int]:
    """Yield the numbers of agents, also of those to come, whose strategies or plans are called game by game."""
    settings = game.internals.parts.settings.settings_now()
    plans = settings["plans"]
    for number, form in enumerate(find_core_forms(game, roster)):
        if form is None and not is_deciding_in_arrays(find_decider(roster.agents[number], plans), settings):
            yield number


def find_first_called(game: PlayedGame, roster: AgentTable) -> str | None:
    """Return the first plain function that is called game by game, in words; None: there is none."""
    called = list_called_rules(game, roster)
    rules = [f"the rule {one.name!r}" for one in called if is_plain_rule(one)]
    rules += [f"the check of the rule {one.name!r}" for one in called if one.spec.check is not None]
    if has_function_of_conflicts(game, roster):
        rules.append(f"the conflicts {as_code(game.settings()['conflicts'])}")
    settings = game.settings()
    plans = settings["plans"]
    deciders = (
        f"the strategy {as_code(find_decider(roster.agents[number], plans))}"
        for number in list_possibly_asked(game, roster)
        if not isinstance(roster.agents[number], ComingAgent)
    )
    collectors = (f"the collector {name!r}" for name in game.internals.parts.collectors.by_name)
    sensors = (
        f"the sensor {shown(name)} of agent {shown(agent.name)}"
        for agent in roster.agents
        for name in list_sensors_called_each_turn(agent)
    )
    return next(chain(rules, deciders, collectors, sensors), None)


def _group_strategies(roster: AgentTable, settings: Mapping[str, Any]) -> list[StrategyGroup]:
    """Return the array functions that decide for all games at once, each with its agents."""
    plans: Mapping[Any, Plan] = settings["plans"]
    found: dict[Hashable, list[int]] = {}
    for number, agent in enumerate(roster.agents):
        decider = find_decider(agent, plans)
        if is_deciding_in_arrays(decider, settings):
            key = make_form_key(get_strategy_spec(decider).array_form), bool(roster.flies[number])
            found.setdefault(key, []).append(number)
    groups = []
    for numbers in found.values():
        decider = find_decider(roster.agents[numbers[0]], plans)
        form = get_strategy_spec(decider).array_form
        assert form is not None  # noqa: S101 - they are array functions
        groups.append(StrategyGroup(as_code(decider), np.array(numbers), form))
    return groups


def _find_observing_agents(game: PlayedGame, roster: AgentTable) -> BoolArray:
    """Return a mask of the agents whose sensors are called in each turn, perhaps only in some games, (agents,)."""
    are_created = find_first_called(game, roster) is not None
    are_called = [len(list_sensors_called_each_turn(agent)) > 0 for agent in roster.agents]
    found: BoolArray = np.array(are_called, np.bool_) | (~roster.is_first & are_created)
    return found
