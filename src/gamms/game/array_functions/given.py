"""Actions from outside, which replace the decisions of a team's strategies in all games."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from gamms.arguments import as_array, as_edges, as_mapping
from gamms.core.moves import NO_EDGE, STOP
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.array_functions.declarations import act_in_arrays
from gamms.game.array_functions.view import ArrayView, as_actions, as_flights
from gamms.game.block.columns import AgentTable, PlayedGame
from gamms.game.deeds import parse_field
from gamms.game.settings import Plan
from gamms.game.strategy_specs import StrategySpec, declare
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown

_KEYS = ("moves", "edges", "flights", "deeds", "messages")


class OutsideActions(NamedTuple):
    """The actions of a team in one turn, in all games of a batch.

    Attributes:
        moves: numbers of legal nodes, (games, agents).
        deeds: deed -> a mask of the agents that do it, (games, agents), and its fields; see `ArrayView.do`.
        messages: channel -> a mask of the senders, the body, and the recipients; see `ArrayView.send`.
        flights: the displacements of flying agents, map units, (games, agents, 3); None: they hover.
        may_stay: whether agents with illegal moves stay; else illegal moves are refused.
        are_legal: whether the moves are legal when the turn begins, so that they are not checked then.
        name: the only agent of the team that the actions are for; None: they are for all.
        edges: ids of edges that agents take instead of their moves, (games, agents), -1 for none; None: none does.
        leads: whether the moves lead to the ends of these edges, in games along one edge a turn.
        numbers: the numbers of the agents that the actions are for, if they are not all of the team; None: see `name`.
    """

    moves: IntArray
    deeds: Mapping[str, tuple[BoolArray, Mapping[str, Any]]]
    messages: Mapping[str, tuple[BoolArray, Any, Any]]
    flights: FloatArray | None = None
    may_stay: bool = False
    are_legal: bool = False
    name: str | None = None
    edges: IntArray | None = None
    leads: bool = False
    numbers: IntArray | None = None

    @property
    def are_moves(self) -> bool:
        """Whether the core needs the moves alone."""
        has_moves = self.edges is None or self.leads
        return has_moves and self.flights is None and not (self.deeds or self.messages)

    def select_agents(self, roster: AgentTable, team: Hashable) -> IntArray:
        """Return the numbers of the agents of a team that the actions are for."""
        if self.numbers is not None:
            return self.numbers
        return roster.members(team) if self.name is None else np.array([roster.names.index(self.name)])

    def get_moves(self, view: ArrayView, moves: IntArray) -> IntArray:
        """Return the moves of the agents of a view; with `may_stay`, illegal moves become 0."""
        if not self.may_stay:
            return moves
        return np.where((moves >= 0) & (moves < view.counts), moves, 0)

    def get_edges(self, view: ArrayView) -> IntArray | None:
        """Return the edges of the agents of a view; with `may_stay`, agents stop that name an illegal edge."""
        if self.edges is None:
            return None
        return self.find_legal_edges(view, self.edges[view.games])

    def find_legal_edges(self, view: ArrayView, edges: IntArray) -> IntArray:
        """Return the edges of the agents of a view; -1 for agents without one, `STOP` in place of illegal edges."""
        chosen = np.where(view.mask, edges, NO_EDGE)
        is_legal = (view["legal_edges"] == chosen[..., None]).any(axis=-1)
        found: IntArray = np.where((chosen >= 0) & ~is_legal, STOP, chosen)
        return found

    def check_edges(self, view: ArrayView, by: str) -> None:
        """Refuse edges that agents in the mask of a view may not take, unless these agents may stay.

        Raises:
            BadValue: an edge is not legal.
        """
        if self.edges is None or self.may_stay:
            return
        edges = self.edges[view.games]
        is_wrong = view.mask & (edges >= 0) & ~(view["legal_edges"] == edges[..., None]).any(axis=-1)
        for game, agent in np.argwhere(is_wrong)[:1].tolist():
            legal = view["legal_edges"][game, agent]
            raise BadValue(
                f"{by}: agent {shown(view['name'][agent])} in game {view.games[game]}, turn {view.turn[game]}, may not "
                f"take edge {edges[game, agent]}; view['legal_edges'] are {legal[legal >= 0].tolist()}."
            )

    def select_game(
        self, game: int, places: IntArray, numbers: IntArray, declared: Mapping[str, Mapping[str, Any]]
    ) -> Self:
        """Return the actions of agents of one game, as those of a batch of this game alone.

        Args:
            game: the number of the game.
            places: (agents,) the column of each agent in these actions; -1: it has no actions.
            numbers: the numbers that agents have there, which fields of deeds refer to; -1: they are not there.
            declared: deed -> its fields.
        """

        def select(value: Any) -> Any:
            if not isinstance(value, np.ndarray) or not value.ndim:
                return value.item() if isinstance(value, np.ndarray | np.generic) else value
            return value[[game]][:, places] if value.ndim > 1 else value[places]

        def renumber(value: Any) -> Any:
            return value if value is None or (np.ndim(value) == 0 and value < 0) else numbers[value]

        has_actions = places >= 0
        deeds = {}
        for deed, (where, fields) in self.deeds.items():
            kinds = {key: parse_field(kind).kind for key, kind in declared.get(deed, {}).items()}
            own = {key: select(value) for key, value in fields.items()}
            own |= {key: renumber(value) for key, value in own.items() if kinds.get(key) == "agent"}
            deeds[deed] = select(where) & has_actions, own
        messages = {}
        for channel, (where, body, to) in self.messages.items():
            receivers = numbers[select(to)] if isinstance(to, np.ndarray) else to
            messages[channel] = select(where) & has_actions, select(body), receivers
        return self._replace(
            moves=np.where(has_actions, select(self.moves), 0),
            deeds=deeds,
            messages=messages,
            flights=None if self.flights is None else np.where(has_actions[:, None], select(self.flights), 0.0),
            edges=None if self.edges is None else select(self.edges),
        )

    def act(self, view: ArrayView) -> None:
        """Carry out the given deeds and messages of the agents in the mask of a view."""

        def here(value: Any) -> Any:
            return value[view.games] if isinstance(value, np.ndarray) and value.ndim > 1 else value

        for deed, (where, fields) in self.deeds.items():
            view.do(deed, where[view.games], **{key: here(value) for key, value in fields.items()})
        for channel, (where, body, to) in self.messages.items():
            view.send(channel, where[view.games], here(body), here(to))


def as_given(value: object, team: Hashable, shape: tuple[int, int], *, is_copied: bool) -> OutsideActions:
    """Return the checked actions of a team from an argument of `Batch.step`.

    Args:
        value: integers, or a dict of moves, deeds and messages.
        team: the team.
        shape: games and agents.
        is_copied: whether to copy its arrays, because they are kept.

    Raises:
        UnknownName (KeyError), BadType, BadValue: the value is not a set of actions.
    """
    by = f"team {shown(team)}"
    if value is None:
        raise BadType(f"{by}: its actions are None: leave out a team that plays its own strategies.")
    if not isinstance(value, Mapping):
        value = {"moves": value}

    def own(one: Any) -> Any:
        return one.copy() if is_copied and isinstance(one, np.ndarray) else one

    for key in value:
        if key not in _KEYS:
            raise UnknownName(f"key of the actions of {by}:", key, _KEYS)
    deeds = {}
    messages = {}
    for deed, done in as_mapping(value.get("deeds", {}), f"deeds of {by}").items():
        where, fields = done if isinstance(done, tuple) and len(done) == 2 else (done, {})
        fields = as_mapping(fields, f"The fields of the deed {deed!r}")
        deeds[deed] = _as_mask(own(where), shape, deed), {key: own(one) for key, one in fields.items()}
    for channel, sent in as_mapping(value.get("messages", {}), f"messages of {by}").items():
        if not isinstance(sent, tuple) or len(sent) not in (2, 3):
            raise BadType(f"messages[{channel!r}] must be (where, body) or (where, body, to), not {shown(sent)}.")
        where, body, to = (*sent, None)[:3]
        messages[channel] = _as_mask(own(where), shape, channel), own(body), own(to)
    flights = own(value.get("flights"))
    if flights is not None:
        flights = as_flights(flights, f"Flights of {by}", shape)
    named = own(value.get("edges"))
    edges = None if named is None else as_edges(named, f"Edges of {by}", shape)
    given = value.get("moves")
    moves = np.zeros(shape, np.int64) if given is None else as_actions(given, shape, by)
    return OutsideActions(moves, deeds, messages, flights, edges=edges)


class ActionLog:
    """The actions from outside that the games of a batch have got since they began, with which games are recorded.

    Args:
        games: the number of games.
        is_kept: whether actions are kept.
    """

    def __init__(self, games: int, *, is_kept: bool) -> None:
        self.is_kept = is_kept
        self._entries: list[tuple[IntArray, dict[Hashable, OutsideActions]]] = []
        self._begun = np.zeros(games, np.int64)  # the number of entries when each game began
        self._has_lost = np.zeros(games, np.bool_)  # whether a game got actions that were not kept

    def note(self, turns: IntArray, given: Mapping[Hashable, OutsideActions]) -> None:
        """Note the actions, team by team, that games got which had played `turns`, (games,)."""
        if not given:
            return
        if not self.is_kept:
            self._has_lost[:] = True
            return
        kept = {team: one._replace(moves=as_kept(one.moves)) for team, one in given.items()}
        self._entries.append((turns, kept))

    def forget(self, games: IntArray) -> None:
        """Forget the actions of games that begin."""
        self._begun[games] = len(self._entries)
        self._has_lost[games] = False
        first = int(self._begun.min())  # no game needs the entries before
        del self._entries[:first]
        self._begun -= first

    def list_actions(self, game: int) -> dict[int, dict[Hashable, OutsideActions]]:
        """Return the actions of a game: the number of turns played before -> team -> actions.

        Raises:
            BadValue: they were not kept.
        """
        if self._has_lost[game]:
            raise BadValue(
                "The actions that were given to step were not kept: make the batch with scenario.batch(…, record=True)."
            )
        return {int(turns[game]): given for turns, given in self._entries[self._begun[game] :]}


def as_kept(moves: IntArray) -> IntArray:
    """Return a copy of moves, in single bytes if the numbers fit."""
    return moves.astype(np.min_scalar_type(moves.max())) if moves.size and moves.min() >= 0 else moves.copy()


def _as_mask(where: object, shape: tuple[int, int], what: str) -> BoolArray:
    return as_array(where, f"The agents of {what!r}", "booleans", shape)


class OutsideActor:
    """Lets agents of one game act as was given to a batch: plans of their teams are functions of arrays.

    The plans stay until `end`, because each change of plans makes the turn engine compute again which agents it asks.

    Args:
        game: the game.
        roster: the agents of the batch, whose numbers the actions have.
    """

    def __init__(self, game: PlayedGame, roster: AgentTable) -> None:
        self._game = game
        self._roster = roster
        self._given: Mapping[Hashable, OutsideActions] = {}
        self._number = 0
        self._plans: dict[Hashable, tuple[Plan | None, Plan]] = {}  # the own plan of a team, and that of these actions

    def take(self, given: Mapping[Hashable, OutsideActions], number: int) -> None:
        """Use the actions of a game of the batch, by team, from now on."""
        self._given = given
        self._number = number
        if given.keys() != self._plans.keys():
            self.end()
            own = self._game.plans
            self._plans = {team: (own.get(team), Plan(self._make_plan(team))) for team in given}
            self._game.plans = {**own, **{team: plan for team, (_, plan) in self._plans.items()}}

    def end(self) -> None:
        """Restore the plans, also in the start to which a reset returns."""
        plans = dict(self._game.plans)
        for team, (own, given) in self._plans.items():
            if team in plans and plans[team].function is given.function:
                del plans[team]
                if own is not None:
                    plans[team] = own
        if plans != self._game.plans:
            self._game.plans = plans
        self._plans = {}

    def _make_plan(self, team: Hashable) -> Callable[[dict[str, Any]], None]:
        """Return a plan by which agents of a team act as given; others, such as new ones, follow their strategies."""
        ctx = self._game.ctx
        of_team = {self._roster.names[agent]: i for i, agent in enumerate(self._roster.members(team).tolist())}

        def find_columns() -> dict[str, int]:
            name = self._given[team].name
            return of_team if name is None else {name: 0}

        def act(view: ArrayView) -> Any:
            return self._act(view, self._given[team], find_columns())

        def plan(states: dict[str, Any]) -> None:
            columns = find_columns()
            known = ctx.agent.agents
            for name, state in states.items():
                if name in columns:
                    act_in_arrays(ctx, state, act, "The given actions")
                elif known[name].strategy is None:
                    state["action"] = state["legal"][0]
                else:
                    known[name].strategy(state)

        declare(plan, StrategySpec(array_form=act))
        return plan

    def _act(self, view: ArrayView, given: OutsideActions, columns: Mapping[str, int]) -> Any:
        """Return the actions of the agents of a view of the game; do their deeds and send their messages.

        Args:
            view: the agents, in one game.
            given: the actions of the team.
            columns: name -> the column of the agent in these actions.
        """
        places = np.array([columns.get(name, -1) for name in view["name"]])
        some = view.only((places >= 0)[None])
        one = self._select_agents(given, places, view.roster.names)
        one.act(some)
        if view.flies:
            return np.zeros((*view.node.shape, 3)) if one.flights is None else one.flights
        if one.edges is None:
            return one.get_moves(some, one.moves)
        is_late = bool(view._state.time.any())  # the edges count for all arrivals of a turn
        edges = one.edges if not (one.may_stay or is_late) else one.find_legal_edges(some, one.edges)
        view.take_edges(np.where(some.mask, np.maximum(edges, NO_EDGE), NO_EDGE))
        return np.where(edges == STOP, 0, one.get_moves(some, one.moves))

    def _select_agents(self, given: OutsideActions, places: IntArray, names: Sequence[str]) -> OutsideActions:
        """Return the given actions of agents in the game.

        Args:
            given: the actions of the team.
            places: (agents,) the column of each agent in these actions; -1: it has no actions.
            names: the agents of the game, whose numbers the fields of deeds have then.
        """
        number_of = {name: number for number, name in enumerate(names)}
        numbers = np.array([number_of.get(name, -1) for name in self._roster.names], np.int64)
        return given.select_game(self._number, places, numbers, self._game.settings()["deeds"])
