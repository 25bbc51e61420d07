"""The array forms that play a game: of strategies and plans, rules and checks, and conflicts."""

from collections.abc import Callable, Hashable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms.game.batch.channels import Outbox
from gamms.game.batch.columns import PlayedGame, Roster, decider_of, in_turns, put_locked
from gamms.game.batch.deeds import ArrayDeeds
from gamms.game.batch.forms import key_of, strategy_spec_of
from gamms.game.batch.roads import NeedsOneMap, StreetsOfMaps
from gamms.game.batch.state import GameArrays
from gamms.game.batch.turn import ArrayRule, ArrayTurn, draw_keys_in, movement_in
from gamms.game.batch.view import ArrayStrategy, ArrayView
from gamms.game.conflicts import ArrayMoves, ranked, stopped_in_arrays
from gamms.game.moves import as_stopped
from gamms.game.settings import PHASES as RULE_PHASES
from gamms.game.settings import NamedRule, Plan, as_called
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import as_code

T = TypeVar("T")
V = TypeVar("V", ArrayTurn, ArrayView)
A = TypeVar("A", bound=np.ndarray[Any, Any])
Stopping = Callable[[Any, IntArray], BoolArray]  # of a turn and where agents want to go: who has to stay


class Group(NamedTuple):
    """Agents that one strategy decides for."""

    name: str
    agents: IntArray  # numbers in the roster
    form: ArrayStrategy
    flies: bool  # whether they fly, all of them
    may_skip: bool  # whether the form may set no action


def _moves_of(turn: ArrayTurn, ends: IntArray) -> ArrayMoves:
    """Return the moves of a turn as conflicts are found in them; agents that fly do not count."""
    return ArrayMoves(
        turn.roster,
        movement_in(turn).columns,
        turn.node if turn._origins is None else turn._origins,
        ends,
        has_edges=turn._origins is not None,
        counts=turn.alive & ~turn.roster.flies,
        turns=turn.turn,
        first_keys=partial(draw_keys_in, turn),
        shared=turn.shared,
    )


def _resolved_in_arrays(conflicts: object) -> Stopping | None:
    """Return the function that finds the agents that conflicts stop; None: there are no conflicts."""
    known = ranked(conflicts)
    return (
        None
        if known is None
        else _noted(
            lambda turn, ends: stopped_in_arrays(known, _moves_of(turn, ends)), f"the conflicts {as_code(conflicts)}"
        )
    )


def _checked_form(form: Callable[[Any, Any], object], named: str) -> Stopping:
    """Return the array form of a check, whose result is checked."""
    return _noted(lambda turn, ends: as_stopped(form(turn, ends), named, ends.shape), named)


def _noted(stops: Stopping, named: str) -> Stopping:
    """Return the same, whose errors say in which turns and games they were."""

    def noted(turn: ArrayTurn, ends: IntArray) -> BoolArray:
        try:
            return stops(turn, ends)
        except Exception as error:
            error.add_note(f"In {named} of a batch, {in_turns(turn.turn, turn.games)}.")
            raise

    return noted


class GameForms:
    """The array forms that play a game.

    Attributes:
        game: at its start.
        roster: the agents.
        groups: the array forms of strategies and plans, each with all agents that have the same.
        rules: phase -> its rules in their order, each with its form.
        conflicts: finds the agents that conflicts stop; None: there are no conflicts.
        checks: the names of rules, and the forms of their checks.
    """

    def __init__(self, game: PlayedGame, state: GameArrays) -> None:
        self._state = state
        settings = game.settings()
        self._need_one_map = set[Hashable]()  # forms that ask for what differs
        self.game = game
        self.roster = state.roster
        self.rules = {phase: _forms_of(game, phase) for phase in RULE_PHASES}
        self.conflicts = _resolved_in_arrays(settings["conflicts"])
        checks = [(one.name, form) for one in game.rules if (form := one.spec.array_check) is not None]
        self.checks = [(name, _checked_form(form, f"the check of the rule {name!r}")) for name, form in checks]
        self.groups = _groups(self.roster, settings["plans"])

    def play(self, named: NamedRule, form: ArrayRule, turn: ArrayTurn) -> None:
        """Apply a rule to a turn, in games with the same roads at a time where it asks for what differs."""
        self._play(("rule", named.name), turn, lambda part, _: form(part))
        turn._find_roads()

    def stopped(self, name: str, form: Stopping, turn: ArrayTurn, ends: IntArray) -> BoolArray:
        """Return which agents a check or conflicts stop, likewise."""
        stopped = self._play(("check", name), turn, lambda part, games: form(part, ends[games]))
        turn._find_roads()
        return np.zeros(ends.shape, np.bool_) if stopped is None else stopped

    def _play(
        self, key: Hashable, turn: ArrayTurn, form: Callable[[ArrayTurn, Any], BoolArray | None]
    ) -> BoolArray | None:
        def play_on_maps() -> BoolArray | None:
            found: BoolArray | None = None
            for _, places in self._state.roads.by_map(turn.games):
                which = np.zeros(len(turn.games), np.bool_)
                which[places] = True
                part = turn._of(which)
                part._lock()
                stopped = form(part, which)
                put_locked(turn.node, which, part.node)
                put_locked(turn.alive, which, part.alive)
                turn._refused |= {(int(places[at]), one, kind): why for (at, one, kind), why in part._refused.items()}
                if stopped is not None:
                    found = np.zeros((len(which), *stopped.shape[1:]), np.bool_) if found is None else found
                    found[which] = stopped
            return found

        return self._ask(key, turn, form, play_on_maps)

    def decide(self, group: "Group", view: ArrayView, ask: Callable[[ArrayView], A]) -> A:
        """Return what a strategy decides, likewise.

        Args:
            group: the agents.
            view: of them, which gets what they do and send.
            ask: asks them.
        """

        def decide(part: ArrayView, _: object) -> A:
            part._deeds, part._outboxes = [], []
            return ask(part)

        def decide_on_maps() -> A:
            parts, deeds, outboxes = list[tuple[IntArray, A]](), list[ArrayDeeds](), list[Outbox]()
            for places, part in views_by_map(view):
                parts.append((places, decide(part, places)))
                deeds += [one._replace(at=places[one.at]) for one in part._deeds or ()]
                outboxes += part._outboxes or ()
            view._deeds, view._outboxes = deeds, outboxes
            where, chosen = zip(*parts, strict=True)
            found: Any = np.concatenate(chosen)
            ordered: A = found[np.argsort(np.concatenate(where))]
            return ordered

        return self._ask(("strategy", group.name), view, decide, decide_on_maps)

    def _ask(self, key: Hashable, of: V, ask: Callable[[V, Any], T], ask_on_maps: Callable[[], T]) -> T:
        """Return what a form gives for games, at first for all; where it needs one map, also the next time.

        Args:
            key: of the form.
            of: the turn, or the view.
            ask: asks it, given that and which games these are.
            ask_on_maps: asks it for games with the same roads at a time.
        """
        if not isinstance(of.streets, StreetsOfMaps):
            return ask(of, np.s_[:])
        if key not in self._need_one_map:
            undo, node, alive = self._state.checkpoint(), of.node.copy(), getattr(of, "alive", of.node).copy()
            try:
                return ask(of, np.s_[:])
            except NeedsOneMap:
                undo()
                self._need_one_map.add(key)
            if isinstance(of, ArrayTurn):
                put_locked(of.node, (np.s_[:],), node)
                put_locked(of.alive, (np.s_[:],), alive)
        return ask_on_maps()

    @property
    def forms(self) -> list[Callable[..., object]]:
        """The array forms."""
        rules = [form for rules in self.rules.values() for _, form in rules]
        checks = [form for one in self.game.rules if (form := one.spec.array_check) is not None]
        return [*(group.form for group in self.groups), *rules, *checks]


def _forms_of(game: PlayedGame, phase: str) -> list[tuple[NamedRule, ArrayRule]]:
    """Return the rules of a phase in their order, each with its array form."""
    rules = [one for one in as_called(game.rules) if one.phase == phase]
    return [(one, form) for one in rules if (form := one.spec.array_form) is not None]


def views_by_map(view: ArrayView) -> Iterator[tuple[IntArray, ArrayView]]:
    """Yield the views of games with the same roads, and their places in a view."""
    for _, places in view._state.roads.by_map(view.games):
        yield places, view.in_games(places)


def _groups(roster: Roster, plans: Mapping[Any, Plan]) -> list[Group]:
    """Return the array forms of strategies and plans of agents, each with all agents that have the same."""
    found: dict[Hashable, list[int]] = {}
    for number, agent in enumerate(roster.agents):
        decider = decider_of(agent, plans)
        if decider is not None:
            form = key_of(strategy_spec_of(decider).array_form)
            found.setdefault((form, bool(roster.flies[number])), []).append(number)
    groups = []
    for numbers in found.values():
        decider = decider_of(roster.agents[numbers[0]], plans)
        spec, flies = strategy_spec_of(decider), bool(roster.flies[numbers[0]])
        assert spec.array_form is not None  # noqa: S101 - the others are asked one by one
        groups.append(Group(as_code(decider), np.array(numbers), spec.array_form, flies, spec.may_skip))
    return groups
