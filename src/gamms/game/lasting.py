"""Deeds that last: agents begin them, go on with them, and finish them or are interrupted, at exact times.

Three rules, which a game has if it declares such a deed, play it. What agents are doing is `ctx.game.data["doing"]`:

    deed -> {"of": turns, "left": agent -> turns, "begun": agent -> {…}, "unfinished": agent -> [[values, turns]]}

All times are numbers of turns since the start of the game: 4.25 is a quarter into the fifth turn.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import takewhile
from math import inf
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_float
from gamms.core.copies import copy_deep
from gamms.game.deeds import Duration, list_lasting
from gamms.game.movement.moves import TurnMoves
from gamms.game.settings import Rank, RuleSpec, Settings, declared
from gamms.ir.deeds import AFTER_OTHERS
from gamms.ir.game_state import GameState
from gamms.ir.graph import FloatArray, IntArray
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.game import Track

DOING = "doing"
"""The key of `ctx.game.data`, and the kind of the artist that draws it."""

_Doings = Mapping[str, Mapping[str, Any]]


class DeedInProgress(NamedTuple):
    """A deed that an agent is doing.

    Attributes:
        kind: the deed.
        since: when it began.
        until: when it is done, unless it is interrupted.
        values: the values of its fields.
    """

    kind: str
    since: float
    until: float
    values: Mapping[str, Any]


class _Interruption(NamedTuple):
    """Something that interrupts a deed: when, and what."""

    time: float
    by: str


def _find_doing(data: Mapping[Any, Any], name: str) -> DeedInProgress | None:
    """Return the deed that an agent is doing; None: it does none."""
    for kind, kept in data.get(DOING, {}).items():
        if name in kept["begun"]:
            return DeedInProgress(kind, **kept["begun"][name])
    return None


def _begin_of_part(order: Sequence[Sequence[Any]] | None, team: object) -> float:
    """Return when the agents of a team begin their part of a turn, from 0 to 1."""
    parts = order or ()
    return next((number / len(parts) for number, teams in enumerate(parts) if team in teams), 0.0)


def find_doing(name: str, team: object, state: GameState, settings: Settings, now: float) -> dict[str, Any] | None:
    """Return what an agent is doing, as its state shows it.

    Args:
        name: the agent.
        team: its team.
        state: the state of the game.
        settings: the settings of the game.
        now: the time in the turn, from 0 to 1, at which agents decide on arrival.
    """
    doing = _find_doing(state.data, name)
    if doing is None:
        return None
    present = state.turn + max(now, _begin_of_part(settings.order, team))
    return {
        "kind": doing.kind,
        "since": doing.since,
        "left": max(0.0, doing.until - present),
        "values": dict(doing.values),
    }


class DeedsInProgress(NamedTuple):
    """What agents are doing, each (games, agents).

    Attributes:
        kind: the index of the deed among the declared ones; -1: the agent does none that lasts.
        since: when it began; 0 without a deed.
        left: the turns that are left; 0 without a deed.
    """

    kind: IntArray
    since: FloatArray
    left: FloatArray


class DeedReader:
    """Reads what agents are doing, in many games.

    Args:
        settings: the settings of the games.
        names: the names of the agents.
        teams: their teams.
        data_of: returns `ctx.game.data` of a game by its number.

    Attributes:
        lengths: the index of each deed that lasts among the declared ones, and how many turns it takes.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        names: Sequence[str],
        teams: Sequence[Any],
        data_of: Callable[[int], Mapping[Any, Any]],
    ) -> None:
        lasting = list_lasting(settings["deeds"])
        self._kinds = {kind: number for number, kind in enumerate(settings["deeds"])}
        self.lengths = [
            (self._kinds[kind], lasts.count_turns(settings["turn_seconds"])) for kind, lasts in lasting.items()
        ]
        self._numbers = {name: number for number, name in enumerate(names)}
        self._begins = np.array([_begin_of_part(settings["order"], team) for team in teams])
        self._data_of = data_of

    def read(self, games: IntArray, agents: IntArray, turn: IntArray, time: FloatArray) -> DeedsInProgress:
        """Return what agents are doing; the arguments are those of a view."""
        shape = len(games), len(agents)
        kind = np.full(shape, -1)
        since = np.zeros(shape)
        left = np.zeros(shape)
        column_of = {number: column for column, number in enumerate(agents.tolist())}
        for row, game in enumerate(games.tolist()):
            for deed, kept in self._data_of(game).get(DOING, {}).items():
                for name, begun in kept["begun"].items():
                    column = column_of.get(self._numbers.get(name, -1))
                    if column is not None:
                        kind[row, column] = self._kinds.get(deed, -1)
                        since[row, column] = begun["since"]
                        left[row, column] = begun["until"]
        now = turn[:, None] + np.maximum(time[:, None], self._begins[agents])
        return DeedsInProgress(kind, since, np.where(kind >= 0, np.maximum(left - now, 0.0), 0.0))


# -- before agents move -------------------------------------------------------------------------------------------


def _check(ctx: HostContext) -> None:
    """Refuse moves of agents whose deed blocks them, and deeds that last beside another one."""
    game = ctx.game
    lasting = list_lasting(game.deeds)
    agents = ctx.agent.agents
    for kind, kept in game.data.get(DOING, {}).items():
        for name in sorted(kept["begun"]) if kind in lasting and lasting[kind].blocks_moving else ():
            if name in agents and agents[name].alive:
                until = kept["begun"][name]["until"]
                game.refuse(name, f"it is doing {kind!r} until {until:g}")
    begins: dict[str, str] = {}
    for deed in game.performed():
        if deed.kind not in lasting:
            continue
        doing = _find_doing(game.data, deed.agent)
        if doing is not None and (doing.kind, doing.values) != (deed.kind, deed.values):
            game.refuse(deed.agent, f"it is doing {doing.kind!r}", deed.kind)
        elif begins.setdefault(deed.agent, deed.kind) != deed.kind:
            game.refuse(deed.agent, f"it begins {begins[deed.agent]!r} in the same turn", deed.kind)
        elif doing is None and lasting[deed.kind].blocks_moving:
            game.refuse(deed.agent, f"it begins {deed.kind!r}")


def begin_deeds(ctx: HostContext) -> None:
    """Begin the deeds that last and that were not refused; a deed that goes on does."""
    game = ctx.game
    state: GameState = game.internals.state
    lasting = list_lasting(game.deeds)
    agents = ctx.agent.agents
    for _, _, _, name, kind, _, node, values in state.deed_log.list_begun(state.row):
        agent = agents.get(name)
        if agent is None or not agent.alive or _find_doing(game.data, name) is not None:
            continue
        turns = lasting[kind].count_turns(game.turn_seconds)
        kept = game.data.setdefault(DOING, {}).setdefault(
            kind, {"of": turns, "left": {}, "begun": {}, "unfinished": {}}
        )
        since = game.turn + _begin_of_part(game.order, agent.team)
        left = _take_unfinished(kept, name, values, turns)
        kept["begun"][name] = {"since": since, "until": since + left, "values": dict(values)}
        kept["left"][name] = left
        game.emit("begun", agent=name, deed=kind, at=node, time=since, **values)


def _take_unfinished(kept: dict[str, Any], name: str, values: Mapping[str, Any], turns: float) -> float:
    """Return how many turns of a deed an agent has to do, after an earlier interruption."""
    unfinished = kept["unfinished"].get(name, [])
    for number, (earlier, left) in enumerate(unfinished):
        if earlier == values:
            del unfinished[number]
            if not unfinished:
                del kept["unfinished"][name]
            return float(left)
    return turns


# -- after agents have moved --------------------------------------------------------------------------------------


def end_deeds(ctx: HostContext) -> None:
    """Finish deeds, or interrupt them, whichever comes first in the turn."""
    game = ctx.game
    doing: dict[str, dict[str, Any]] | None = game.data.get(DOING)
    if not doing:
        return
    state: GameState = game.internals.state
    lasting = list_lasting(game.deeds)
    ends = _TurnEnds(ctx, state)
    done = []
    for kind in sorted(doing):
        kept = doing[kind]
        for name, begun in sorted(kept["begun"].items()):
            lasts = lasting.get(kind, Duration())
            stop = ends.find_stop(name, begun["since"], lasts)
            if begun["until"] <= min(state.turn, stop.time):
                done.append((begun["until"], name, kind, begun))
            elif stop.time <= state.turn:
                left = begun["until"] - stop.time
                if lasts.on_interrupt == "resume":
                    kept["unfinished"].setdefault(name, []).append([begun["values"], left])
                game.emit(
                    "interrupted", agent=name, deed=kind, by=stop.by, time=stop.time, left=left, **begun["values"]
                )
            else:
                kept["left"][name] = begun["until"] - state.turn
                continue
            del kept["begun"][name]
            kept["left"].pop(name, None)
    rows = []
    for number, (time, name, kind, begun) in enumerate(sorted(done, key=lambda one: one[:3])):
        node = ends.get_start(name)
        game.emit("done", agent=name, deed=kind, at=node, time=time, **begun["values"])
        fields = {**begun["values"], "since": begun["since"], "time": time}
        rows.append((state.row, number, AFTER_OTHERS + number, name, kind, state.turn, node, fields))
    if rows:
        state.deed_log.add(state.row, rows)


def copy_doing(data: dict[Any, Any]) -> Any:
    """Return what agents are doing, for `put_doing`; None: no deed has begun. Any: it is a value of `ctx.game.data`."""
    return copy_deep(dict.get(data, DOING))


def put_doing(data: dict[Any, Any], doing: Any) -> None:
    """Let agents do what `copy_doing` has returned, in a turn that is taken back."""
    if doing is None:
        dict.pop(data, DOING, None)
    else:
        dict.__setitem__(data, DOING, copy_deep(doing))


def drop_deed(ctx: HostContext, name: str) -> None:
    """Interrupt the deed of a deleted agent whose name a new one gets, which begins without."""
    game = ctx.game
    for kind in list_lasting(game.deeds):
        kept = game.data.get(DOING, {}).get(kind)
        if kept is None:
            continue
        kept["unfinished"].pop(name, None)
        kept["left"].pop(name, None)
        begun = kept["begun"].pop(name, None)
        if begun is not None:
            time = float(game.turn)
            left = begun["until"] - time
            game.emit("interrupted", agent=name, deed=kind, by="eliminated", time=time, left=left, **begun["values"])


class _TurnEnds:
    """What may interrupt deeds in a turn.

    Args:
        ctx: the context.
        state: the state of the game.
    """

    def __init__(self, ctx: HostContext, state: GameState) -> None:
        self._agents: Mapping[str, IAgent] = ctx.agent.agents
        self._order = ctx.game.order
        self._turn = state.turn
        self._moves: TurnMoves | None = state.moves
        self._events = [*takewhile(lambda event: event["turn"] == self._turn, reversed(state.events))]

    def find_stop(self, name: str, since: float, lasts: Duration) -> _Interruption:
        """Return what interrupts a deed of an agent first, at `since` or later; the time is infinite: nothing does.

        A tag counts before the places to which it has brought the agent.
        """
        stops = [one for one in self._list_stops(name, lasts) if one.time >= since]
        return min(stops, key=lambda one: one.time, default=_Interruption(inf, ""))

    def get_start(self, name: str) -> int:
        """Return the node on which an agent was when the turn began."""
        i = None if self._moves is None else self._moves.find_index(name)
        return self._agents[name].current_node_id if self._moves is None or i is None else int(self._moves.starts[i])

    def _list_stops(self, name: str, lasts: Duration) -> Iterator[_Interruption]:
        tags = [_Interruption(time, "tag") for time in self._list_times("tag", "other", name)]
        for kind in lasts.interrupted_by:
            if kind == "tag":
                yield from tags
            elif kind != "move":
                yield from (_Interruption(time, kind) for time in self._list_times(kind, "agent", name))
        agent = self._agents.get(name)
        i = None if self._moves is None else self._moves.find_index(name)
        at_once = min(tags)[0] if tags else float(self._turn)  # when a rule has put the agent elsewhere or out of play
        is_out = agent is None or not agent.alive
        if is_out:
            yield _Interruption(at_once if i is not None else self._turn - 1.0, "eliminated")
        if "move" in lasts.interrupted_by and self._moves is not None and i is not None:
            slot = self._moves.slots[i]
            time = _find_departure_time(self._moves, i, self._turn - 1, _begin_of_part(self._order, slot.team))
            if time is not None:
                yield _Interruption(time, "move")
            if not (is_out or slot.flies) and self._agents[name].current_node_id != self._moves.ends[i]:
                yield _Interruption(at_once, "move")

    def _list_times(self, kind: str, field: str, name: str) -> Iterable[float]:
        """Return the times of the events of a kind in which a field names an agent."""
        named = [event for event in self._events if event["kind"] == kind and event.get(field) == name]
        return [
            as_float(event.get("time", self._turn), f"time of the event {kind!r} of agent {name!r}") for event in named
        ]


def _find_departure_time(moves: TurnMoves, i: int, now: int, part: float) -> float | None:
    """Return when the agent of a slot sets out in a turn that begins at `now`; None: it stays."""
    slot = moves.slots[i]
    if slot.flies:
        action = moves.actions.get(i)
        is_flying = action is not None and action.position not in (None, slot.agent.prev_position)
        return now + part if is_flying else None
    track: Track = moves.get_track(i)
    if track.legs:
        return next((now + leg.since for leg in track.legs if leg.begin != leg.end), None)
    waits = len([*takewhile(lambda node: node == track.path[0], track.path)]) - 1
    if waits + 1 < len(track.path) or (not slot.travels and moves.get_progress(i) is not None):
        return now + max(track.times[waits], part)
    return None


def _know_own(data: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """Return the data of the deeds under way, with those of the named agents only."""
    doings: _Doings = data.get(DOING, {})
    own = {
        kind: {"of": kept["of"]}
        | {key: {name: one for name, one in kept[key].items() if name in names} for key in kept if key != "of"}
        for kind, kept in doings.items()
    }
    return {DOING: own}


def end_late_deeds(ctx: HostContext) -> None:
    """Interrupt deeds by the rules that were called since `end_deeds`."""
    end_deeds(ctx)


LASTING_RULES = (
    ("deeds", declared(begin_deeds, RuleSpec(check=_check, key=DOING, disclose=_know_own, drawer=DOING))),
    ("after", declared(end_deeds, RuleSpec(follows_tags=True))),
    ("after", declared(end_late_deeds, RuleSpec(rank=Rank.LATE_DEEDS))),
)
"""The rules that play deeds that last, each with its phase."""
