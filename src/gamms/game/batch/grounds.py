"""The maps of a batch: games in which rules have closed the same roads are played together on one ground."""

from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import PlayedGame, Roster, decider_of, joined_rows, some_rows
from gamms.game.batch.forms import form_of
from gamms.game.batch.movement import Movement, Places
from gamms.game.batch.scalar_rules import RuleContext
from gamms.game.batch.scalar_strategies import ScalarStrategies
from gamms.game.batch.sight import Seen
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import SeenNodes
from gamms.game.batch.turn import ArrayRule, MovesOfTurn, in_turns
from gamms.game.batch.vectors import Vectors
from gamms.game.batch.view import ArrayStrategy, ArrayView
from gamms.game.moves import as_stopped
from gamms.game.settings import PHASES as RULE_PHASES
from gamms.game.settings import NamedRule, Plan
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import as_code

T = TypeVar("T")
A = TypeVar("A", bound=np.ndarray[Any, Any])
P = TypeVar("P", Seen, SeenNodes)


class Group(NamedTuple):
    """Agents that one strategy decides for."""

    name: str
    agents: IntArray  # numbers in the roster
    form: ArrayStrategy


def _checked_form(of: object, named: str) -> Callable[[MovesOfTurn, IntArray], BoolArray] | None:
    """Return the array form of what stops moves, whose result is checked; None: it has none."""
    form = form_of(of)

    def checked(turn: MovesOfTurn, ends: IntArray) -> BoolArray:
        try:
            return as_stopped(form(turn, ends), named, ends.shape)
        except Exception as error:
            error.add_note(f"In {named} of a batch, {in_turns(turn.turn, turn.games)}.")
            raise

    return None if form is None else checked


class Ground:
    """A map, and the array forms that play games on it.

    Attributes:
        game: at its start, on this map.
        context: calls the rules of it that have no array form.
        roster, movement: the agents and how they go.
        asked: asks those that are asked one by one; None: there are none.
        groups: the array forms of strategies and plans, each with all agents that have the same.
        rules: phase -> its rules in their order, each with its form; those without follow each other as one.
        conflicts: the form of the conflict resolver; None: it has none, or there is none.
        has_conflicts: whether there is one.
        checks: the forms of the checks of rules.
        shared, now: what was worked out for this map, and of how its games are now; see `GameArrays`.
    """

    def __init__(
        self, game: PlayedGame, context: RuleContext, roster: Roster, movement: Movement, asked: ScalarStrategies | None
    ) -> None:
        settings = game.settings()
        self.asked = asked
        self.game, self.context, self.roster, self.movement = game, context, roster, movement
        self.rules = {phase: self._forms_of(phase) for phase in RULE_PHASES}
        conflicts = settings["conflicts"]
        self.has_conflicts = conflicts is not None
        self.conflicts = _checked_form(conflicts, f"the conflicts {as_code(conflicts)}")
        checks = [(one, getattr(one.rule, "check", None)) for one in game.rules]
        self.checks = [
            _checked_form(check, f"the check of the rule {one.name!r}") or partial(context.check, one)
            for one, check in checks
            if check is not None
        ]
        self.gather()
        self.shared: dict[Hashable, Any] = {}
        self.now: dict[Hashable, Any] = {}

    def gather(self) -> None:
        """Take the strategies and plans of agents."""
        self.groups = _groups(self.roster, self.game.settings()["plans"], frozenset(self._asked_rows()))

    def _asked_rows(self) -> list[int]:
        """Return the numbers of the agents of teams that are asked one by one, those that may come too."""
        team_of = self.roster.team_of
        return [] if self.asked is None else np.flatnonzero(np.isin(team_of, team_of[self.asked.agents])).tolist()

    def _forms_of(self, phase: str) -> list[tuple[NamedRule, ArrayRule]]:
        found: list[tuple[NamedRule, ArrayRule]] = []
        group: list[NamedRule] = []
        for one in self.game.rules:
            if one.phase != phase:
                continue
            form = form_of(one.rule)
            if form is not None:
                found.append((one, form))
                group = []
            elif group:
                group.append(one)
            else:
                group = [one]
                found.append((one, partial(self.context.call, group)))
        return found

    @property
    def forms(self) -> list[Callable[..., object]]:
        """The array forms, and what is called that has none."""
        rules = [form for rules in self.rules.values() for named, form in rules if form_of(named.rule) is form]
        checks = [getattr(one.rule, "check", None) for one in self.game.rules]
        stopping = [*checks, self.game.settings()["conflicts"]]
        declared = [form for one in stopping if (form := form_of(one)) is not None]
        asked = [] if self.asked is None else self.asked.functions()
        return [*(group.form for group in self.groups), *rules, *declared, *self.context.functions(), *asked]


class ViewOfGrounds(ArrayView):
    """A view of games that are played apart from each other: on several grounds, or by the turn engine.

    What is legal, where on edges agents are and what sensors show is that of each game where it is played: `parts` are
    games, and what has the state in which they are.
    """

    def __init__(
        self,
        state: GameArrays,
        agents: IntArray,
        parts: Sequence[tuple[IntArray, Callable[[], AbstractContextManager[GameArrays]]]],
    ) -> None:
        super().__init__(state, np.arange(len(state)), agents)
        self._parts = parts

    def _each(self, asked: Callable[[ArrayView], T]) -> Iterator[tuple[IntArray, T]]:
        """Yield the games of each part, and what a view of them gives."""
        for games, there in self._parts:
            with there() as state:
                yield games, asked(ArrayView(state, games, self.agents))

    def _joined(self, asked: Callable[[ArrayView], A], fill: float) -> A:
        """Return what views of the parts give, one value or several for each agent."""
        parts: list[Any] = list(self._each(asked))
        most = np.max([part.shape[2:] for _, part in parts], axis=0).astype(int)
        found: Any = np.full((*self.node.shape, *most), fill)
        for games, part in parts:
            found[np.ix_(games, *map(np.arange, part.shape[1:]))] = part
        joined: A = found
        return joined

    @property
    def counts(self) -> IntArray:
        """How many nodes are legal for each agent, its own included."""
        return self._joined(lambda view: view.counts, 1)

    def _legal(self) -> IntArray:
        return self._joined(lambda view: view._legal(), -1)

    def _heights(self) -> FloatArray:
        return self._joined(lambda view: view._heights(), 0.0)

    def places(self) -> Places:
        """Return where the agents are: in games by metres some may be on edges."""
        return Places(
            self._joined(lambda view: view.places().edge, -1),
            self._joined(lambda view: view.places().offset_m, 0.0),
            self._joined(lambda view: view.places().xy, 0.0),
        )

    def action_to(self, nodes: Any) -> IntArray:
        """Return the actions that lead to these nodes, (games, agents); -1 where one is not legal."""
        wanted = np.broadcast_to(nodes, self.node.shape)
        return self._joined(lambda view: view.action_to(wanted[view.games]), -1)

    def looked(self, names: tuple[str, ...]) -> Seen:
        """Return what sensors of these names show to all agents of the view, or all sensors; see `seen`."""
        return self._pairs(lambda view: view.looked(names))

    def seen_nodes(self, *names: str) -> SeenNodes:
        """Return which nodes the sensors show to those in the mask."""
        return self._pairs(lambda view: view.seen_nodes(*names))

    def _pairs(self, asked: Callable[[ArrayView], P]) -> P:
        """Return the pairs that views of the parts give, by game."""
        whole = joined_rows([found._replace(at=games[found.at]) for games, found in self._each(asked)])
        in_order = some_rows(whole, np.argsort(whole.at, kind="stable"))
        return in_order._replace(shape=(*self.node.shape, whole.shape[2]))

    def encoded(self, others: int, actions: int | None) -> Vectors:
        """Return vectors of a number of actions; None: of the most that are legal anywhere while all roads are open."""
        most = self.movement.width if actions is None else actions
        whole = super().encoded(others, most)
        for games, part in self._each(lambda view: view.encoded(others, most)):
            whole.values[games], whole.legal[games] = part.values, part.legal
        return whole


def is_other_by_roads(whole: GraphColumns, now: GraphColumns) -> bool:
    """Return whether a map differs from the whole one in nothing but roads that are closed."""
    same_nodes = np.array_equal(whole.node_ids, now.node_ids) and np.array_equal(whole.xy, now.xy)
    rows = kernels.rows_of(whole.edge_ids, now.edge_ids, np.argsort(whole.edge_ids, kind="stable"))
    if not same_nodes or (rows < 0).any():
        return False
    columns = (whole.sources, now.sources), (whole.targets, now.targets), (whole.lengths, now.lengths)
    if whole.node_attributes != now.node_attributes or not all(
        np.array_equal(one[rows], other) for one, other in columns
    ):
        return False
    if np.array_equal(whole.edge_ids, now.edge_ids):  # NOTE: as in most games, once there was one with these roads
        return bool(whole.edge_attributes == now.edge_attributes)
    numbered = list(enumerate(rows.tolist()))
    return all(
        values.get(new, _NOTHING) == whole.edge_attributes.get(name, {}).get(old, _NOTHING)
        for name, values in now.edge_attributes.items()
        for new, old in numbered
    )


_NOTHING = object()


def _groups(roster: Roster, plans: Mapping[Any, Plan], left_out: Collection[int]) -> list[Group]:
    """Return the array forms of strategies and plans of agents, each with all agents that have the same."""
    found: dict[Hashable, list[int]] = {}
    for number, agent in enumerate(roster.agents):
        decider = decider_of(agent, plans)
        if decider is not None and number not in left_out:
            found.setdefault(key_of(form_of(decider)), []).append(number)
    groups = []
    for numbers in found.values():
        decider = decider_of(roster.agents[numbers[0]], plans)
        groups.append(Group(as_code(decider), np.array(numbers), form_of(decider)))
    return groups


def key_of(form: Any) -> Hashable:
    """Return a key that is equal for forms that do the same."""
    if isinstance(form, partial):
        key = (
            form.func,
            tuple(map(key_of, form.args)),
            tuple((k, key_of(v)) for k, v in sorted(form.keywords.items())),
        )
    else:
        key = form
    try:
        hash(key)
    except TypeError:
        return id(form)
    return key
