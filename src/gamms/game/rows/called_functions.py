"""Find the plain functions of a game that are called game by game."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from gamms.game.block.columns import AgentTable, PlayedGame, find_decider, get_sensors
from gamms.game.block.in_core import list_called_rules
from gamms.game.hidden_state import find_names
from gamms.game.plan import find_first_called, has_function_of_conflicts, is_plain_rule
from gamms.game.rows.own_functions import FunctionPerGame, find_some_function
from gamms.ir.game_state import KEPT, GameState

_OF_SENSORS = {"get_sensor", "sensors"}
"""Names by which a function gets sensors."""
_OF_ANY_NAME = {"__getattribute__", "attrgetter", "getattr", "getattr_static"}
"""Names by which a function may read attributes whose names are not in its code."""
_LOOKS = {"get_state", "observation", "sense"}
"""Names by which a function asks sensors, or gets the random streams of an agent."""
_DRAWS = {"draw", "rng"}
"""Keys of the random streams of an agent in its state."""


class StartValues(NamedTuple):
    """The values with which games begin; see `GameState`."""

    turn: int
    counts: dict[str, dict[str, int]]
    blocked: dict[str, str]

    @classmethod
    def from_state(cls, state: GameState) -> "StartValues":
        """Return the values with which the game of a context begins."""
        counts = {name: each.copy() for name, each in state.counts.items()}
        return cls(state.turn, counts, dict(state.blocked))


class CalledFunctions(NamedTuple):
    """The plain functions of a game that are called game by game in a batch.

    Attributes:
        functions: the functions.
        periods: the periods of the collectors, in turns.
        asked: the numbers in the roster of agents whose strategies and plans are called.
        observing: the names of these agents, and of those whose sensors are called in each turn.
        core_keys: the keys of `ctx.game.data` and of facts that belong to rules of the core or of arrays.
        facts_in_core: the key of each fact that the core knows, and the function that returns it for games.
        has_array_functions: whether array functions are called, too.
        asks_all: whether all agents decide in contexts; see `find_why_all_decide`.
        first: the values with which games begin.
    """

    functions: Sequence[Callable[..., object]]
    periods: frozenset[int]
    asked: frozenset[int]
    observing: frozenset[str]
    core_keys: frozenset[str]
    facts_in_core: Sequence[tuple[str, Callable[..., Any]]]
    has_array_functions: bool
    asks_all: bool
    first: StartValues

    @classmethod
    def from_game(
        cls,
        game: PlayedGame,
        roster: AgentTable,
        asked: Sequence[int],
        observing: Sequence[int],
        *,
        has_array_functions: bool,
        asks_all: bool,
    ) -> "CalledFunctions":
        """Return the functions that are called in games like one.

        Args:
            game: the game at its start.
            roster: the agents.
            asked: the numbers of agents whose strategies and plans are called.
            observing: the numbers of other agents whose sensors are called in each turn.
            has_array_functions: whether array functions are called, too.
            asks_all: whether all agents decide in contexts; see `find_why_all_decide`.
        """
        deciders = [find_decider(roster.agents[number], game.settings()["plans"]) for number in asked]
        collectors = game.internals.parts.collectors.by_name.values()
        specs = [one.spec for one in list_called_rules(game, roster) if one.spec.core_form is not None]
        rules = list_rule_functions(game, roster)
        return cls(
            functions=[
                *map(find_some_function, rules),
                *map(find_some_function, deciders),
                *(one.fn for one in collectors),
            ],
            periods=frozenset(one.every for one in collectors),
            asked=frozenset(asked),
            observing=frozenset(roster.names[number] for number in (*asked, *observing)),
            core_keys=frozenset(list_core_keys(game, roster)),
            facts_in_core=[(str(spec.key), spec.facts_of) for spec in specs if spec.facts_of is not None],
            has_array_functions=has_array_functions,
            asks_all=asks_all,
            first=StartValues.from_state(game.internals.state),
        )


def list_rule_functions(game: PlayedGame, roster: AgentTable) -> Iterator[Callable[..., object]]:
    """Yield the plain functions of rules and conflicts that are called."""
    for one in list_called_rules(game, roster):
        if is_plain_rule(one):
            yield one.rule
    for _, check in game.internals.parts.rules.now.checks:
        yield check
    if has_function_of_conflicts(game, roster):
        yield game.settings()["conflicts"].resolve


def list_core_keys(game: PlayedGame, roster: AgentTable) -> Iterator[str]:
    """Yield the keys of `ctx.game.data` and of facts that belong to rules of the core or of arrays."""
    called = list_called_rules(game, roster)
    if any(one.spec.is_array_function for one in called):
        yield KEPT
    for one in called:
        spec = one.spec
        if spec.core_form is not None and spec.key is not None:
            yield spec.key
            if spec.disclose is not None:
                yield from spec.disclose({}, ())


def find_why_all_decide(game: PlayedGame, roster: AgentTable) -> str:
    """Return why the strategies of all agents are called game by game, shipped ones included; "": they are not.

    The reason is found in the code of functions and of those that they call: a plain function names what agents have
    sensed in earlier turns, `agent.state` or `sensor.data`, which each game must then keep.
    """
    if any(map(_may_look_back, _name_all(game, roster))):
        return "functions may read what agents have sensed before"
    return ""


def _list_functions_of_games(functions: Iterable[Any]) -> list[Callable[..., object]]:
    """Return functions, and those of each game in place of a `FunctionPerGame`."""
    found: list[Any] = []
    for one in functions:
        found += one.of_game if isinstance(one, FunctionPerGame) else [one]
    return [*filter(callable, found)]


def _name_all(game: PlayedGame, roster: AgentTable) -> Iterator[frozenset[str]]:
    """Yield the names in the code of each plain function that is called; see `find_names`."""
    plans = game.settings()["plans"]
    deciders = [find_decider(agent, plans) for agent in roster.agents]
    sensors = [sensor for agent in roster.agents for sensor in get_sensors(agent).values()]
    called = [*list_rule_functions(game, roster), *deciders, *(getattr(one, "function", None) for one in sensors)]
    called += [one.fn for one in game.internals.parts.collectors.by_name.values()]
    return find_names(_list_functions_of_games(called))


def _may_look_back(names: frozenset[str]) -> bool:
    """Return whether a function with these names in its code may read states of agents or data of sensors."""
    reads_data = "data" in names and not _OF_SENSORS.isdisjoint(names)
    return "state" in names or reads_data or not _OF_ANY_NAME.isdisjoint(names)


def find_why_apart(game: PlayedGame, roster: AgentTable) -> str:
    """Return why games are played one after the other in contexts of their own from the start; "": they are not.

    The reason is something that the rows of a batch do not store, so that a game could not take it along later.
    """
    if roster.obey_turns and game.settings()["speed_unit"] != "edges":
        return "agents by metres obey turn restrictions, which the core does not know"
    if game.internals.state.parts_played is not None and find_first_called(game, roster) is not None:
        return "functions are called, and the games begin in the middle of a turn"
    before_moves = [check for _, check in game.internals.parts.rules.now.checks]
    before_moves += [one.rule for one in list_called_rules(game, roster) if one.phase == "deeds" and is_plain_rule(one)]
    if has_function_of_conflicts(game, roster):
        before_moves.append(game.settings()["conflicts"].resolve)
    of_agents = [sensor for agent in roster.agents for sensor in get_sensors(agent).values()]
    looks_count = game.settings()["decide"] == "arrival" and not all(map(_is_repeatable, of_agents))
    for names in find_names(_list_functions_of_games(before_moves)):
        if not _LOOKS.isdisjoint(names) and (looks_count or not _DRAWS.isdisjoint(names)):
            return "functions that are called before the moves draw by the streams of agents, or ask sensors"
    return ""


def _is_repeatable(sensor: object) -> bool:
    """Return whether repeated looks of a sensor in a turn are the same."""
    look = sensor.in_arrays() if hasattr(sensor, "in_arrays") else None
    return getattr(sensor, "sees_world_only", False) and (look is None or look.is_plain)
