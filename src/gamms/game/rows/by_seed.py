"""Games of a batch that differ from their start: by functions that a seed makes, or that a strategy prepares."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NoReturn, Protocol

import numpy as np

from gamms.errors import BadValue
from gamms.game.block.columns import PlayedGame
from gamms.game.settings import NamedRule, Plan, declared
from gamms.game.snapshots import ForkSource, get_counterpart, list_shareable
from gamms.game.strategy_specs import get_strategy_spec
from gamms.ir.graph import ClosedEdges, GraphColumns, IntArray
from gamms.ir.obstacles import ObstacleColumns
from gamms.text import as_code

Owner = tuple[str, str]
"""The owner of a function: ("agent", name) for a strategy, ("team", team) for a plan, ("sensor", id) for a sensor."""
MakeFunctions = Callable[[int], Mapping[Owner, Any]]
"""Resets a game with a seed, and returns its strategies, plans and sensor functions that depend on the seed."""


class _Map(Protocol):
    """The part of the snapshot of a map that games compare."""

    columns: GraphColumns
    obstacles: ObstacleColumns
    closed: ClosedEdges


class GamesBySeed:
    """The games on one map that differ from their start by more than columns.

    The game of the context begins as each of them, and its fork is the context of the row. Afterwards, functions that
    only say how they are called stand in it for those that differ.

    Args:
        game: the game in whose context the functions are made.
        make: resets the game with a seed, and makes the functions of the seed; None: they do not differ.
        seed: the seed of the first game of the batch.
        more_edges: see the attribute.
        differs: whether rules, facts, data or attributes of agents differ with the seed, too.
        goes_on: whether the only game goes on from its present state, instead of the start by its seed.

    Attributes:
        begun: the games that have begun and have no row yet, by number, each in a context of its own.
        more_edges: edges that are not on the map of the first seed, but may be on those of other seeds.
        goes_on: see above.
    """

    def __init__(
        self,
        game: PlayedGame,
        make: MakeFunctions | None,
        seed: int,
        more_edges: ClosedEdges,
        *,
        differs: bool,
        goes_on: bool = False,
    ) -> None:
        self._game = game
        self._make = make
        self._seed = seed
        self.begun: dict[int, PlayedGame] = {}
        self.more_edges = dict(more_edges)
        self._stands: dict[Owner, Any] = {}  # the functions that stand for others
        self._standing_rules: dict[str, Any] = {}  # the same, by the names of rules
        self._standing_checks: dict[str, Any] = {}
        self._examples: dict[int, Any] = {}  # by the `id` of a function that stands for others, one of these
        self._map: _Map | None = None  # of the first seed
        agents = game.ctx.agent.agents.values()
        deciders: dict[Owner, Any] = {("agent", agent.name): agent.strategy for agent in agents}
        deciders |= {("team", team): plan.function for team, plan in game.plans.items()}
        self.goes_on = goes_on
        self._preparing = {} if goes_on else {who: one for who, one in deciders.items() if _is_preparing(one)}
        self._differs = differs or len(self._preparing) > 0
        self._shared = {who: one for who, one in deciders.items() if one is not None}
        self._first_rules = game.rules
        self._unprepared_rules = self._first_rules
        self._first: Mapping[Owner, Any] = {}  # of the seed of the context

    @property
    def is_needed(self) -> bool:
        """Whether games may differ from their start."""
        return self._make is not None or len(self._preparing) > 0

    def get_example(self, function: object) -> Any:
        """Return one of the functions for which a function stands; other functions stand for themselves."""
        return self._examples.get(id(function), function)

    def take(self, games: IntArray, seeds: Sequence[int]) -> None:
        """Begin games in contexts of their own; afterwards, the context is reset with its first seed.

        Raises:
            BadValue: their maps differ in more than the open roads; then no game has begun.
        """
        begun: dict[int, PlayedGame] = {}
        try:
            self._begin_each(games, seeds, begun)
        except BaseException:
            for one in begun.values():
                one.ctx.terminate()
            if self._map is not None:
                self._game.ctx.graph.storage.restore(self._map)
            self._first = self._begin(self._seed)
            self.install()
            raise
        for number, one in begun.items():
            self._end(number)
            self.begun[number] = one

    def _begin_each(self, games: IntArray, seeds: Sequence[int], begun: dict[int, PlayedGame]) -> None:
        """Put the games, by number, into `begun`, each in a context of its own; see `take`."""
        self._decide_by(self._first)
        self._first = self._begin(self._seed)
        first_rules = {one.name: one for one in self._game.rules}
        self._map = self._game.ctx.graph.storage.snapshot()
        shared = list_shared(self._game)
        for number, seed in zip(games.tolist(), seeds, strict=True):
            for owner, function in self._begin(seed).items():
                self._stand_for(self._stands, owner, function)
            for rule in self._game.rules if self._differs else ():
                first = first_rules.get(rule.name, rule)
                if rule.spec.is_array_function or rule.rule != first.rule:
                    self._stand_for(self._standing_rules, rule.name, rule.rule)
                    self._stand_for(self._standing_checks, rule.name, rule.spec.check)
            self._check_map(seed)
            begun[number] = self._make_fork(seed, shared)
        self._first = self._begin(self._seed)
        self._first_rules = self._game.rules

    def _make_fork(self, seed: int, shared: Sequence[object]) -> PlayedGame:
        """Return a fork of the game of the context."""
        ctx, _ = ForkSource(self._game.internals.parts, only_plain=False).make_fork(seed, shared=shared)
        ctx.reseed(seed, self._game.ctx.rng_state())
        game: PlayedGame = ctx.game
        return game

    def _stand_for(self, known: dict[Any, Any], key: object, function: object) -> None:
        """Let a function stand for one that differs between games, and is called game by game."""
        before = id(known.get(key))
        if self._examples.get(before) is None:  # an agent may have no strategy in some games
            self._examples.pop(before, None)
            known[key] = _make_stand_in(function)
            self._examples[id(known[key])] = function

    def _check_map(self, seed: int) -> None:
        """Refuse a map of the context that differs from the first one in more than the open roads."""
        first = self._map
        graph = self._game.ctx.graph
        now = graph.storage.snapshot()
        if now is first or first is None:
            return
        if not _has_same_places(now, first):
            raise BadValue(
                "Code of the game changes more of the map by the seed than its open roads: nodes, obstacles or lengths "
                f"differ between the games with the seeds {self._seed} and {seed}. Close roads there, or give maps=[…]."
            )
        edge_ids, _ = graph.storage.list_roads()
        known = {*first.columns.edge_ids.tolist(), *first.closed}
        self.more_edges |= graph.storage.get_edges_as_given([id for id in edge_ids.tolist() if id not in known])

    def find_roads(self, number: int) -> tuple[IntArray, ClosedEdges, Any] | None:
        """Return the ids of the open edges of a game that has begun, its closed edges, and its map.

        None: they are those of the first seed.
        """
        first = self._map
        storage = self.begun[number].ctx.graph.storage
        edge_ids, closed = storage.list_roads()
        assert first is not None  # noqa: S101 - `take` has set it
        if np.array_equal(edge_ids, first.columns.edge_ids) and [*closed] == [*first.closed]:
            return None
        return edge_ids, closed, storage.snapshot()

    def close(self) -> None:
        """End the contexts of games that have no row."""
        for number in [*self.begun]:
            self._end(number)

    def _end(self, number: int) -> None:
        """End the context of a game, if it has begun and has no row."""
        if number in self.begun:
            self.begun.pop(number).ctx.terminate()

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
        """Let functions stand in the context for those that differ between games."""
        if not self.is_needed:
            return
        if self._differs:  # functions of arrays are called for each game, too, because they may read facts
            for who, function in self._shared.items():
                if get_strategy_spec(function).array_form is not None:
                    self._stand_for(self._stands, who, function)
        self._decide_by(self._stands)
        self._game.internals.restore_rules([self._make_called_rule(rule) for rule in self._first_rules])

    def _make_called_rule(self, rule: NamedRule) -> NamedRule:
        """Return a rule that is called game by game, if it differs between games or is a function of arrays."""
        stand_in = self._standing_rules.get(rule.name)
        if stand_in is None:
            return rule
        plain = replace(
            rule.spec,
            prepare=None,
            check=None if rule.spec.check is None else self._standing_checks[rule.name],
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
        return rule._replace(rule=declared(stand_in, plain))

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


def list_shared(game: PlayedGame, functions: Iterable[object] = ()) -> list[object]:
    """Return the functions and settings of a game that are objects which its forks share.

    Args:
        game: the game.
        functions: further functions.
    """
    settings = game.settings()
    plans = [plan.function for plan in settings["plans"].values()]
    several = [*functions, *game.ctx.agent.storage.list_strategies(), *plans, *settings.values()]
    several += [rule.rule for rule in game.rules]
    several += [one.fn for one in game.internals.parts.collectors.by_name.values()]
    ctx, memo = ForkSource(game.internals.parts, only_plain=False).make_context(0)
    found = list_shareable({id(one): one for one in several}.values(), memo)
    ctx.terminate()
    return found


def _make_stand_in(function: object) -> Callable[..., NoReturn]:
    """Return a function with the name of another one; it is never called."""

    def stand_in(*_: object) -> NoReturn:
        raise NotImplementedError

    stand_in.__name__ = as_code(function)
    return stand_in


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
