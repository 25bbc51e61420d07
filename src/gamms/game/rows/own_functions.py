"""Differences between games of a batch from their start: functions that a seed makes, or that a game prepares."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, NoReturn, Protocol

import numpy as np

from gamms.core.copies import copy_deep, copy_items, copy_values
from gamms.errors import BadValue
from gamms.game.block.columns import PlayedGame
from gamms.game.settings import NamedRule, Plan, declared
from gamms.game.snapshots import get_counterpart
from gamms.game.strategy_specs import get_strategy_spec
from gamms.ir.graph import ClosedEdges, GraphColumns, IntArray
from gamms.ir.obstacles import ObstacleColumns
from gamms.text import as_code

Owner = tuple[str, str]
"""The owner of a function: ("agent", name) for a strategy, ("team", team) for a plan, ("sensor", id) for a sensor."""
MakeFunctions = Callable[[int], Mapping[Owner, Any]]
"""Resets a game with a seed, and returns its strategies, plans and sensor functions that depend on the seed."""


class FunctionPerGame:
    """Stands for a strategy, a rule, a sensor, or the plan of a team, with a different function in each game.

    Attributes:
        of_game: the function of each game; None: the game has none yet.
    """

    def __init__(self, num_games: int) -> None:
        self.of_game: list[Any] = [None] * num_games

    def __deepcopy__(self, memo: dict[int, Any]) -> "FunctionPerGame":
        """Return this object: the context of each game has its own function instead."""
        return self

    def __call__(self, *_: object) -> NoReturn:
        """Refuse to be called: the context of each game has its own function instead."""
        raise NotImplementedError

    def __repr__(self) -> str:
        """Return the name of the first game's function that exists."""
        return as_code(find_some_function(self))


def get_function_in(decider: Any, game: int) -> Any:
    """Return the function of a strategy or plan in a game."""
    return decider.of_game[game] if isinstance(decider, FunctionPerGame) else decider


def get_function_of_game(decider: FunctionPerGame, game: int) -> Any:
    """Return the function that a game alone has; None: nothing decides there."""
    function = decider.of_game[game]
    return None if function is _stay else function


def find_some_function(decider: Any) -> Any:
    """Return the function of a strategy or plan in the first game that has one."""
    return next(filter(None, decider.of_game)) if isinstance(decider, FunctionPerGame) else decider


def list_functions_of_games(functions: Iterable[Any]) -> list[Any]:
    """Return functions, and those of each game in place of a `FunctionPerGame`."""
    found: list[Any] = []
    for one in functions:
        found += one.of_game if isinstance(one, FunctionPerGame) else [one]
    return found


def make_rule_per_game(rule: NamedRule, of_game: FunctionPerGame) -> NamedRule:
    """Return a rule that calls the function of each game."""
    spec = rule.spec
    check = FunctionPerGame(len(of_game.of_game)) if spec.check is not None else None
    if check is not None:
        check.of_game = [one and rule._replace(rule=one).spec.check for one in of_game.of_game]
    plain = replace(
        spec,
        prepare=None,
        check=check,
        act_as_one=None,
        parts=(),
        array_form=None,
        core_form=None,
        player=None,
        prepare_arrays=None,
        facts_of=None,
        begin_arrays=None,
        is_array_function=False,
    )
    return rule._replace(rule=declared(of_game, plain))


def _stay(state: dict[str, Any]) -> None:
    """Stay, in a game in which the agent has no strategy."""
    state["action"] = state["legal"][0] if state["legal"] else (0.0, 0.0, 0.0)


class FirstValues(NamedTuple):
    """The values with which a game begins; see `GameState`. `attributes` are of the agents, in the order of rows."""

    facts: dict[str, Any]
    data: dict[Any, Any]
    scores: dict[Any, Any]
    events: list[dict[str, Any]]
    attributes: list[dict[str, Any]]
    agent_facts: dict[Any, dict[str, Any]]
    team_facts: dict[Any, dict[str, Any]]

    @classmethod
    def from_game(cls, game: PlayedGame) -> "FirstValues":
        """Return the values with which a game begins."""
        state = game.internals.state
        private = copy_deep((state.agent_facts, state.team_facts))
        attributes = [copy_values(vars(agent)) for agent in game.ctx.agent.storage.share().members]
        events = [dict(event) for event in state.events]
        return cls(dict(state.facts), copy_items(state.data), dict(state.scores), events, attributes, *private)

    def put(self, game: PlayedGame) -> None:
        """Give these values to a game in a new context, but for scores and events."""
        state = game.internals.state
        for agent, own in zip(game.ctx.agent.storage.share().members, self.attributes, strict=True):
            agent.__dict__.clear()
            for name, value in copy_values(own).items():
                setattr(agent, name, value)
        state.put("facts", dict(self.facts))
        state.put("data", copy_items(self.data))
        state.agent_facts = copy_deep(self.agent_facts)
        state.team_facts = copy_deep(self.team_facts)


class _Map(Protocol):
    """The part of the snapshot of a map that games compare."""

    columns: GraphColumns
    obstacles: ObstacleColumns
    closed: ClosedEdges


class FirstMap(NamedTuple):
    """The first map of a game whose closed roads differ from those of the game with the first seed.

    Attributes:
        edge_ids: the ids of the open edges, in order.
        closed: the closed edges.
        snapshot: the map, as `ctx.graph.storage.snapshot` returns it.
    """

    edge_ids: IntArray
    closed: ClosedEdges
    snapshot: Any


class FunctionsPerGame:
    """The differences between the games on one map from their start.

    Args:
        game: the game in whose context the functions are made.
        make: resets the game with a seed, and makes the functions of the seed; None: they do not differ.
        seeds: the seeds of all games of the batch.
        more_edges: see the attribute.
        differs: whether rules, facts, data or attributes of agents differ with the seed, too.

    Attributes:
        first: the start values of each game; empty: all games begin with the same.
        rngs: the state of `ctx.rng` with which each game begins; None: it is created on first use.
        maps: the map that each game begins with; None: that of the first seed.
        more_edges: edges that are not on the map of the first seed, but may be on those of other seeds.
    """

    def __init__(
        self,
        game: PlayedGame,
        make: MakeFunctions | None,
        seeds: Sequence[int],
        more_edges: ClosedEdges,
        *,
        differs: bool,
    ) -> None:
        self._game = game
        self._make = make
        self._seed = seeds[0]
        self._own: dict[Owner, FunctionPerGame] = {}
        self._rules: dict[str, FunctionPerGame] = {}
        self._values: list[FirstValues | None] = [None] * len(seeds)
        self.rngs: list[Any] = [None] * len(seeds)
        self.maps: list[FirstMap | None] = [None] * len(seeds)
        self.more_edges = dict(more_edges)
        agents = game.ctx.agent.agents.values()
        deciders: dict[Owner, Any] = {("agent", agent.name): agent.strategy for agent in agents}
        deciders |= {("team", team): plan.function for team, plan in game.plans.items()}
        self._preparing = {who: one for who, one in deciders.items() if _is_preparing(one)}
        self._differs = differs or len(self._preparing) > 0
        self.first = self._values if self._differs else []
        self._shared = {who: one for who, one in deciders.items() if one is not None}
        self._first_rules = game.rules
        self._unprepared_rules = self._first_rules
        self._first: Mapping[Owner, Any] = {}  # of the seed of the context

    @property
    def is_needed(self) -> bool:
        """Whether games may differ from their start."""
        return self._make is not None or len(self._preparing) > 0

    def list_functions(self) -> list[FunctionPerGame]:
        """Return what stands for functions that differ between games."""
        return [*self._own.values(), *self._rules.values()]

    def take(self, games: IntArray, seeds: Sequence[int]) -> None:
        """Make the functions of games; afterwards, the context is reset with its first seed."""
        self._decide_by(self._first)
        self._first = self._begin(self._seed)
        map = self._game.ctx.graph.storage.snapshot()
        for number, seed in zip(games.tolist(), seeds, strict=True):
            for owner, function in self._begin(seed).items():
                self._get_function(self._own, owner).of_game[number] = self._find_called_function(owner, function)
            for rule in self._game.rules if self._differs else ():
                self._get_function(self._rules, rule.name).of_game[number] = rule.rule
            self._values[number] = FirstValues.from_game(self._game) if self._differs else None
            self.rngs[number] = self._game.ctx.rng_state()
            self.maps[number] = self._map_beside(map, seed)
        self._first = self._begin(self._seed)
        self._first_rules = self._game.rules

    def _get_function(self, known: dict[Any, FunctionPerGame], key: Hashable) -> FunctionPerGame:
        return known.setdefault(key, FunctionPerGame(len(self._values)))

    def _map_beside(self, first: _Map, seed: int) -> FirstMap | None:
        """Return the map of the context; None: it is the map of the first seed.

        Raises:
            BadValue: the maps differ in more than the open roads.
        """
        graph = self._game.ctx.graph
        now = graph.storage.snapshot()
        if now is first:
            return None
        edge_ids, closed = graph.storage.list_roads()
        have_same_rows = len(edge_ids) == len(first.columns.edge_ids) and (edge_ids == first.columns.edge_ids).all()
        if not _has_same_places(now, first):
            raise BadValue(
                "Code of the game changes more of the map by the seed than its open roads: nodes, obstacles or lengths "
                f"differ between the games with the seeds {self._seed} and {seed}. Close roads there, or give maps=[…]."
            )
        if have_same_rows and [*closed] == [*first.closed]:
            return None
        known = {*first.columns.edge_ids.tolist(), *first.closed}
        self.more_edges |= graph.storage.get_edges_as_given([id for id in edge_ids.tolist() if id not in known])
        return FirstMap(edge_ids, closed, now)

    def _find_called_function(self, owner: Owner, function: Callable[..., Any] | None) -> Any:
        """Return the function that a game calls in place of its own."""
        kind, name = owner
        return self._game.ctx.sensor.get_sensor(name).called_with_both() if kind == "sensor" else function or _stay

    def _begin(self, seed: int) -> dict[Owner, Any]:
        """Reset the game with a seed; return its own functions, which are prepared and may add rules."""
        self._game.internals.restore_rules(self._unprepared_rules)
        if self._make is None:
            self._game.reset(seed=seed)
            found = {}
        else:
            found = dict(self._make(seed))
        memo: dict[int, Any] = {}
        found = {who: get_counterpart(one, memo) for who, one in self._preparing.items()} | found
        self._decide_by(found)
        self._unprepared_rules = self._game.rules
        for function in {id(one): one for one in found.values() if _is_preparing(one)}.values():
            function.prepare(self._game.ctx)
        return found

    def install(self) -> None:
        """Set the functions of the context that differ between games to those that call the function of each game."""
        if not self.is_needed:
            return
        if self._differs:  # functions of arrays are called for each game, too, because they may read facts
            for who, function in self._shared.items():
                if get_strategy_spec(function).array_form is not None and who not in self._own:
                    self._get_function(self._own, who).of_game[:] = [function] * len(self._values)
        self._decide_by(self._own)
        self._game.internals.restore_rules([self._make_shared_rule(rule) for rule in self._first_rules])

    def _make_shared_rule(self, rule: NamedRule) -> NamedRule:
        """Return a rule that calls the rule of each game, if the rules differ or are functions of arrays."""
        own = self._rules.get(rule.name)
        if own is None or not (rule.spec.is_array_function or any(one not in (None, rule.rule) for one in own.of_game)):
            return rule
        return make_rule_per_game(rule, own)

    def remove(self) -> None:
        """Set the functions of the context to those of its first seed, not prepared."""
        if not self.is_needed:
            return
        self._decide_by({**self._first, **self._preparing})
        self._game.internals.restore_rules(self._unprepared_rules)

    def _decide_by(self, functions: Mapping[Owner, Any]) -> None:
        plans = dict(self._game.plans)
        for (kind, name), function in functions.items():
            if kind == "team":
                plans[name] = Plan(function, plans[name].arrays)
            elif kind == "sensor":
                self._game.ctx.sensor.get_sensor(name).function = function
            else:
                self._game.ctx.agent.agents[name].decide_by(function)
        self._game.plans = plans


def _has_same_places(one: _Map, other: _Map) -> bool:
    """Return whether two maps have the same nodes, obstacles and edges, apart from edges that only one of them has."""
    columns = one.columns
    others = other.columns
    have_same_nodes = np.array_equal(columns.node_ids, others.node_ids) and np.array_equal(columns.xy, others.xy)
    if not (have_same_nodes and np.array_equal(one.obstacles.corners, other.obstacles.corners)):
        return False
    _, rows, other_rows = np.intersect1d(columns.edge_ids, others.edge_ids, return_indices=True)
    each = ("sources", "targets", "lengths")
    return all(np.array_equal(getattr(columns, name)[rows], getattr(others, name)[other_rows]) for name in each)


def _is_preparing(function: object) -> bool:
    return hasattr(function, "prepare") and not isinstance(function, type)
