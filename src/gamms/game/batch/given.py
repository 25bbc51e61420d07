"""Actions that come from outside: what agents of a team do in all games, instead of what their strategies decide."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import hypot
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_mapping
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.columns import PlayedGame, Roster
from gamms.game.batch.view import ArrayView
from gamms.game.deeds import field_of
from gamms.game.settings import Plan
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown

_KEYS = ("moves", "flights", "deeds", "messages")


class Given(NamedTuple):
    """What the agents of a team do in a turn, in all games of a batch.

    Attributes:
        moves: numbers of legal nodes, (games, agents), of the library of the batch; None: all stay.
        deeds: deed -> which agents do it, (games, agents), and its fields; see `ArrayView.do`.
        messages: channel -> which agents send, the body, and to whom; see `ArrayView.send`.
        flights: how far agents that fly go, map units, (games, agents, 3); None: they hover.
        may_stay: whether agents stay whose moves are no numbers of legal nodes; else such moves are refused.
    """

    moves: Any
    deeds: Mapping[str, tuple[BoolArray, Mapping[str, Any]]]
    messages: Mapping[str, tuple[BoolArray, Any, Any]]
    flights: FloatArray | None = None
    may_stay: bool = False

    def moves_in(self, view: ArrayView, moves: Any) -> Any:
        """Return moves of the agents of a view, of which those that are not legal may be to stay."""
        if not self.may_stay:
            return moves
        return view.xp.where((moves >= 0) & (moves < view.counts), moves, 0)

    def act(self, view: ArrayView) -> None:
        """Let the agents of a view of all games, in its mask, do and send what is given."""
        for deed, (where, fields) in self.deeds.items():
            view.do(deed, where, **fields)
        for channel, (where, body, to) in self.messages.items():
            view.send(channel, where, body, to)


def as_given(value: object, team: Hashable, shape: tuple[int, int], own: Callable[[Any], Any]) -> Given:
    """Return the actions of a team as they were given to `Batch.step`.

    Args:
        value: integers, or a dict of moves, deeds and messages.
        team: the team.
        shape: games and agents.
        own: returns an array of NumPy for one that was given.

    Raises:
        UnknownName (KeyError): a dict has another key.
        BadType, BadValue: a dict has not the form that `Batch.step` says.
    """
    if not isinstance(value, Mapping):
        return Given(value, {}, {})
    for key in value:
        if key not in _KEYS:
            raise UnknownName(f"key of the actions of team {shown(team)}:", key, _KEYS)
    deeds, messages = {}, {}
    for deed, done in as_mapping(value.get("deeds", {}), f"deeds of team {shown(team)}").items():
        where, fields = done if isinstance(done, tuple) and len(done) == 2 else (done, {})
        fields = as_mapping(fields, f"The fields of the deed {deed!r}")
        deeds[deed] = _as_mask(own(where), shape, deed), {key: own(one) for key, one in fields.items()}
    for channel, sent in as_mapping(value.get("messages", {}), f"messages of team {shown(team)}").items():
        if not isinstance(sent, tuple) or len(sent) not in (2, 3):
            raise BadType(f"messages[{channel!r}] must be (where, body) or (where, body, to), not {shown(sent)}.")
        where, body, to = (*sent, None)[:3]
        messages[channel] = _as_mask(own(where), shape, channel), own(body), own(to)
    return Given(value.get("moves"), deeds, messages, _as_flights(own(value.get("flights")), team, shape))


def _as_flights(given: object, team: Hashable, shape: tuple[int, int]) -> FloatArray | None:
    if given is None:
        return None
    flights = np.asarray(given)
    if flights.shape != (*shape, 3) or flights.dtype.kind not in "iuf" or not np.isfinite(flights).all():
        raise BadValue(
            f"Flights of team {shown(team)} are finite numbers (dx, dy, dz), an array {(*shape, 3)}, not "
            f"{flights.dtype} of the shape {flights.shape}."
        )
    return flights.astype(np.float64)


def _as_mask(where: object, shape: tuple[int, int], what: str) -> BoolArray:
    mask = np.asarray(where)
    if mask.dtype != np.bool_ or mask.shape not in (shape, ()):
        raise BadValue(
            f"{what!r} is done by agents: give booleans {shape}, not {mask.dtype} of the shape {mask.shape}."
        )
    return np.broadcast_to(mask, shape)


@contextmanager
def acting(game: PlayedGame, roster: Roster, given: Mapping[Hashable, Given], number: int) -> Iterator[None]:
    """Let agents take actions that were given, instead of what their strategies and plans decide.

    Args:
        game: that is played.
        roster: its agents.
        given: by team.
        number: of the game.
    """
    plans = game.plans
    if given:
        own = {
            team: Plan(_taking(_of_agents(game, roster, given, number, team), game, may_stay=one.may_stay))
            for team, one in given.items()
        }
        game.plans = {**plans, **own}
    try:
        yield
    finally:
        if given:
            game.plans = plans


class _ActionOfOne(NamedTuple):
    """What one agent does in one game, as its state has it."""

    move: int
    flight: list[float]
    do: dict[str, dict[str, Any]]
    outbox: list[dict[str, Any]]


def _of_agents(
    game: PlayedGame, roster: Roster, given: Mapping[Hashable, Given], number: int, team: Hashable
) -> dict[str, _ActionOfOne]:
    """Return what agents of a team do, by name."""
    moves, deeds, messages, flights, _ = given[team]
    found = {}
    for i, (agent, move) in enumerate(zip(roster.members(team).tolist(), moves[number].tolist(), strict=True)):
        do = {
            deed: _plain_fields(game, roster, deed, {key: _one_of(value, number, i) for key, value in fields.items()})
            for deed, (where, fields) in deeds.items()
            if where[number, i]
        }
        outbox = [
            {"channel": channel, "to": _receiver(roster, to, number, i), "body": _one_of(body, number, i)}
            for channel, (where, body, to) in messages.items()
            if where[number, i]
        ]
        flight = [0.0, 0.0, 0.0] if flights is None else flights[number, i].tolist()
        found[roster.names[agent]] = _ActionOfOne(move, flight, do, outbox)
    return found


def _plain_fields(game: PlayedGame, roster: Roster, deed: str, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a deed of one agent as scalar forms have them."""
    declared = game.settings()["deeds"].get(deed, {})
    plain: dict[str, Any] = {}
    for key, value in fields.items():
        kind = field_of(declared[key]).kind if key in declared else ""
        known = {"agent": roster.names, "node": game.ctx.graph.columns().node_ids}.get(kind)
        if known is not None and value not in (None, -1):
            plain[key] = known[value] if kind == "agent" else int(known[value])
        elif known is None and value is not None:
            plain[key] = value
    return plain


def _receiver(roster: Roster, to: object, number: int, agent: int) -> Any:
    return roster.names[_one_of(to, number, agent)] if isinstance(to, np.ndarray) else to


def _one_of(value: Any, number: int, agent: int) -> Any:  # Any: what a caller has given
    """Return the value for one agent of a game; it is one for all, or an array that broadcasts to (games, agents)."""
    if not isinstance(value, np.ndarray) or not value.ndim:
        return value.item() if isinstance(value, np.ndarray | np.generic) else value
    one = value[number, agent] if value.ndim > 1 else value[agent]
    return one.tolist() if isinstance(one, np.ndarray | np.generic) else one


def _taking(
    actions: Mapping[str, _ActionOfOne], game: PlayedGame, *, may_stay: bool
) -> Callable[[dict[str, Any]], None]:
    """Return a plan by which agents, if they are alive, take actions, by name.

    Those that were not there from the start follow their strategies, or stay.
    """

    def plan(states: dict[str, Any]) -> None:
        for name, state in states.items():
            if name not in actions:
                strategy = game.ctx.agent.agents[name].strategy
                if strategy is None:
                    state["action"] = state["legal"][0]
                else:
                    strategy(state)
                continue
            legal, action = state["legal"], actions[name]
            state.get("outbox", []).extend(action.outbox)
            if "quat" in state:  # it flies
                state["action"] = flown(action.flight, game.ctx.agent.agents[name].speed, action.do)
                continue
            move = action.move
            if may_stay and not 0 <= move < len(legal):
                move = 0
            if not 0 <= move < len(legal):
                raise BadValue(
                    f"Action {move} of agent {shown(name)}, turn {state['turn']}, is not the number of a legal node: "
                    f"it has {len(legal)}, numbered from 0."
                )
            state["action"] = {"node_id": legal[move], "do": action.do} if action.do else legal[move]

    return plan


def flown(flight: Sequence[float], speed: float | None, do: Mapping[str, Any]) -> dict[str, Any]:
    """Return the action of an agent that flies by so many map units, and by its speed at most."""
    action = {"direction": flight, "distance": min(hypot(*flight), speed or 0.0)}
    return {**action, "do": do} if do else action
