"""Actions from outside, which replace the decisions of a team's strategies in all games."""

from collections.abc import Hashable, Mapping, Sequence
from math import hypot
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_array, as_edges, as_mapping
from gamms.core.moves import NO_EDGE, STOP
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.array_functions.view import ArrayView, as_actions, as_flights
from gamms.game.block.columns import AgentTable, PlayedGame
from gamms.game.deeds import parse_field
from gamms.game.settings import Plan
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

    @property
    def are_moves(self) -> bool:
        """Whether the core needs the moves alone."""
        has_moves = self.edges is None or self.leads
        return has_moves and self.flights is None and not (self.deeds or self.messages)

    def select_agents(self, roster: AgentTable, team: Hashable) -> IntArray:
        """Return the numbers of the agents of a team that the actions are for."""
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
        edges = np.where(view.mask, self.edges[view.games], NO_EDGE)
        is_legal = (view["legal_edges"] == edges[..., None]).any(axis=-1)
        found: IntArray = np.where((edges >= 0) & ~is_legal, STOP, edges)
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
    """Replaces the decisions of strategies and plans in one game by given actions.

    Its plans stay until `end`, because each change of plans makes the turn engine compute again which agents it asks.
    """

    def __init__(self, game: PlayedGame, roster: AgentTable) -> None:
        self._game = game
        self._roster = roster
        self._taking: dict[Hashable, _OutsideStrategy] = {}

    def take(self, given: Mapping[Hashable, OutsideActions], number: int) -> None:
        """Use the actions of a game of the batch, by team, from now on."""
        if given.keys() != self._taking.keys():
            self.end()
            plans = self._game.plans
            self._taking = {team: _OutsideStrategy(self._game, self._roster, team, plans.get(team)) for team in given}
            self._game.plans = {**plans, **{team: Plan(one) for team, one in self._taking.items()}}
        for team, one in self._taking.items():
            one.given = given[team]
            one.number = number

    def end(self) -> None:
        """Restore the strategies and plans, also in the start to which a reset returns."""
        plans = self._game.plans
        if any(isinstance(plan.function, _OutsideStrategy) for plan in plans.values()):
            own = {
                team: one.function.own if isinstance(one.function, _OutsideStrategy) else one
                for team, one in plans.items()
            }
            self._game.plans = {team: plan for team, plan in own.items() if plan is not None}
        self._taking = {}


def _select_value(value: Any, number: int, agent: int) -> Any:  # Any: what a caller has given
    """Return the value for one agent, from one value for all or an array that broadcasts to (games, agents)."""
    if not isinstance(value, np.ndarray) or not value.ndim:
        return value.item() if isinstance(value, np.ndarray | np.generic) else value
    one = value[number, agent] if value.ndim > 1 else value[agent]
    return one.tolist() if isinstance(one, np.ndarray | np.generic) else one


class _OutsideStrategy:
    """A plan that sets the given actions of a team's living agents; it may replace a plan of the game.

    Other agents, such as those that rules have created, follow their strategies, or stay.
    """

    given: OutsideActions
    number: int

    def __init__(self, game: PlayedGame, roster: AgentTable, team: Hashable, own: Plan | None) -> None:
        self._game = game
        self._roster = roster
        self.own = own
        self._place_of = {roster.names[agent]: i for i, agent in enumerate(roster.members(team).tolist())}

    def __call__(self, states: dict[str, Any]) -> None:
        agents = self._game.ctx.agent.agents
        places = self._place_of if self.given.name is None else {self.given.name: 0}
        for name, state in states.items():
            if name in places:
                self._act(state, places[name], agents[name].speed)
            elif agents[name].strategy is None:
                state["action"] = state["legal"][0]
            else:
                agents[name].strategy(state)

    def _act(self, state: dict[str, Any], i: int, speed: float | None) -> None:
        """Set the action of the agent at an index of the columns."""
        moves, deeds, messages, flights = self.given[:4]
        number = self.number
        do = {
            deed: self._convert_fields(deed, {key: _select_value(value, number, i) for key, value in fields.items()})
            for deed, (where, fields) in deeds.items()
            if where[number, i]
        }
        for channel, (where, body, to) in messages.items():
            if where[number, i]:
                receiver = self._roster.names[_select_value(to, number, i)] if isinstance(to, np.ndarray) else to
                message = {"channel": channel, "to": receiver, "body": _select_value(body, number, i)}
                state.get("outbox", []).append(message)
        if "quat" in state:  # it flies
            flight = [0.0, 0.0, 0.0] if flights is None else flights[number, i].tolist()
            state["action"] = make_flight_action(flight, speed, do)
            return
        if self.given.edges is not None and self.given.edges[number, i] >= 0:
            edge = int(self.given.edges[number, i])
            may_stay = self.given.may_stay or state.get("time", 0.0) > 0.0  # it counts for all arrivals of a turn
            is_legal = not may_stay or edge in state["legal_edges"]
            state["action"] = {**({"edge": edge} if is_legal else {}), "do": do}
            return
        legal = state["legal"]
        move = int(moves[number, i])
        if not 0 <= move < len(legal):
            if not self.given.may_stay:
                raise BadValue(
                    f"Action {move} of agent {shown(state['name'])}, turn {state['turn']}, is not the number of a "
                    f"legal node: it has {len(legal)}, numbered from 0."
                )
            move = 0
        state["action"] = {"node_id": legal[move], "do": do} if do else legal[move]

    def _convert_fields(self, deed: str, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of a deed of one agent as plain values."""
        declared = self._game.settings()["deeds"].get(deed, {})
        plain = dict[str, Any]()
        for key, value in fields.items():
            kind = parse_field(declared[key]).kind if key in declared else ""
            known = {"agent": self._roster.names, "node": self._game.ctx.graph.columns().node_ids}.get(kind)
            if known is not None and value not in (None, -1):
                plain[key] = known[value] if kind == "agent" else int(known[value])
            elif known is None and value is not None:
                plain[key] = value
        return plain


def make_flight_action(flight: Sequence[float], speed: float | None, do: Mapping[str, Any]) -> dict[str, Any]:
    """Return the action for a displacement in map units, limited by the agent's speed."""
    action = {"direction": flight, "distance": min(hypot(*flight), speed or 0.0)}
    return {**action, "do": do} if do else action
