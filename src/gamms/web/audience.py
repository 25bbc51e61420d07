"""A recording as one team may know it: by the table of events, and by what the team's sensors see in each turn.

Lives, teams, scores and the end are public. Of others a team has the places while its sensors report them, and nothing
else; of its own agents all that was recorded. What is not on a list here is left out, so that a new kind of event is
hidden until its audience is decided.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from io import BytesIO
from typing import Any

import numpy as np

from gamms.context import create_context
from gamms.errors import UnknownName
from gamms.ir import events as kinds
from gamms.ir.game_state import BlockedAgents, GameState
from gamms.ir.graph import IntArray
from gamms.ir.messages import ARRIVALS
from gamms.plain import Plain
from gamms.recorder import Recording, keyframes, sensed
from gamms.recorder.detached import DetachedState
from gamms.visual.fog import Fog

NOWHERE = -(1 << 52)  # the node of agents that the team does not see; no map has it

_PUBLIC = {kinds.AGENT_DELETE, kinds.AGENT_TEAM, kinds.AGENT_ALIVE, kinds.GAME_SCORES, kinds.GAME_OVER, kinds.WORLD}
_OF_THE_TEAM = {kinds.AGENT_SPEED, kinds.AGENT_SENSOR_REGISTER, kinds.AGENT_SENSOR_DEREGISTER}
_OF_PLACES = {
    kinds.AGENT_CURRENT_NODE,
    kinds.AGENT_PREV_NODE,
    kinds.AGENT_ORIENTATION,
    kinds.AERIAL_AGENT_POSITION,
    kinds.AERIAL_AGENT_QUATERNION,
}
_BY_NUMBER = {kinds.AERIAL_AGENT_FLIGHT, kinds.AERIAL_AGENT_TURN}
_TOLD_OF_NEW = ("name", "team", "type")  # of the keywords that an agent of others was created with
_PLACES = ("heading", "position", "previous_position", "quat")
_QUIET = {"level": "CRITICAL"}
_Event = tuple[int, Any]


class Audience:
    """What a team may know of a recording.

    Args:
        recording: is read.
        team: its text; of an agent without a team its name.

    Raises:
        UnknownName (KeyError): no agent is of this team.
        BadValue: none of its agents carries a sensor.
    """

    def __init__(self, recording: Recording, team: str) -> None:
        self._recording, self.team = recording, team
        first = recording.detached(0).agents.columns
        sides = {_side(name, of) for name, of in zip(first["names"], first["teams"], strict=True)}
        if team not in sides:
            raise UnknownName("team", team, sides)
        has_sensed = recording.counts().get("SENSED", 0) > 0
        self._seen = list(self._sensed() if has_sensed else self._asked_again())  # after each turn

    # -- what the team sees -----------------------------------------------------------------------------------

    def _sensed(self) -> Iterator[frozenset[str]]:
        """Yield whom the team's sensors reported in each state: what they were asked for in the turn that follows."""
        last: frozenset[str] = frozenset()
        for turn, log in enumerate(self._recording.logs(1, self._recording.turns + 1)):
            state = self._recording.detached(turn)
            names, own = state.agents.names_by_number(), self._own(state)
            found = next((data for kind, data in kinds.events_of(log) if kind == kinds.SENSED), None)
            if found is not None:
                looks = sensed.looks_of(found)
                others = {
                    other for number, look in looks if names.get(number) in own for other in sensed.seen_by(look)[1]
                }
                last = frozenset(own | {names[number] for number in others if number in names})
            yield last
        yield last

    def _asked_again(self) -> Iterator[frozenset[str]]:
        """Yield whom the team's sensors see in each state, in a replay in which they are asked again."""
        found: list[frozenset[str]] = []
        with create_context(seed=0, logger_config=_QUIET) as ctx:
            ctx.graph.storage.unpack(self._recording.graph.packed)
            fog: list[Fog] = []

            def look() -> None:
                fog.extend([] if fog else [Fog(ctx, self.team)])
                fog[0].look()
                found.append(frozenset(ctx.agent.agents.keys() - fog[0].hidden))

            ctx.visual.after_turn.append(look)
            for number, _ in enumerate(ctx.record.replay(BytesIO(self._recording.content()))):
                if number == 0 and not found:
                    look()  # the map and the agents come with the first record
        yield from found[: self._recording.turns + 1]

    def _own(self, state: DetachedState) -> set[str]:
        columns = state.agents.columns
        return {
            name for name, of in zip(columns["names"], columns["teams"], strict=True) if _side(name, of) == self.team
        }

    # -- cutting ----------------------------------------------------------------------------------------------

    def keyframe(self, turn: int) -> dict[str, Plain]:
        """Return the state after so many turns, as the team knows it."""
        state = self._recording.detached(turn)
        own, seen = self._own(state), self._seen[turn]
        columns = {name: column.copy() for name, column in state.agents.columns.items()}
        names = columns["names"]
        is_own, is_seen = (np.array([name in some for name in names], np.bool_) for some in (own, own | seen))
        columns["node"][~is_seen] = NOWHERE
        columns["previous"][~is_own] = columns["node"][~is_own]
        for name in _PLACES:
            columns[name][~is_seen] = np.nan
        columns["previous_position"][~is_own] = np.nan
        for name in kinds.ON_EDGES:
            columns[name][~is_seen] = 0
        for name, hidden in (("speed", None), ("strategies", None), ("sensors", {}), ("attributes", {})):
            columns[name] = [value if mine else hidden for value, mine in zip(columns[name], is_own, strict=True)]
        carried = {one for sensors in columns["sensors"] for one in sensors.values()}
        sensors = [sensor for id, sensor in state.sensors.items() if id in carried]
        found = keyframes.packed(columns, state.agents.following, sensors, self._game(state, own, seen), None)
        return {**found, "pace": state.keyframe(turn)["pace"], "turn": state.game.turn}

    def _game(self, state: DetachedState, own: Collection[str], seen: Collection[str]) -> GameState:
        game, known = state.game, GameState()
        state.keyframe(0)  # which brings its turn up to date
        known.scores.update(game.scores)
        known.over = game.over
        known.data.update(_flags(game.data, seen))
        known.memories.update({name: memory for name, memory in game.memories.items() if name in own})
        known.team_memories = {team: memory for team, memory in game.team_memories.items() if str(team) == self.team}
        known.blocked = BlockedAgents({name: why for name, why in game.blocked.items() if name in own})
        return known

    def logs(self) -> Iterator[kinds.Log]:
        """Yield the log of each turn, as the team knows it."""
        flags = _flags(self._recording.detached(0).game.data, self._seen[0])
        for turn, log in enumerate(self._recording.logs(1, self._recording.turns + 1)):
            before = self._recording.detached(turn)
            numbers = before.agents.names_by_number()
            own = self._own(before)
            after = self._recording.detached(turn + 1)
            numbers |= after.agents.names_by_number()
            own |= self._own(after)
            passage = _Passage(own, numbers, self._seen[turn], self._seen[turn + 1], self.team)
            cut = [entry for kind, data in kinds.steps_of(log) for entry in passage.entries(kind, data)]
            cut += passage.appearing(after)
            now = _flags(after.game.data, self._seen[turn + 1])
            if now != flags:
                cut.append((kinds.GAME_DATA, {"set": now}))
                flags = now
            yield cut


class _Passage:
    """What a team may know of one turn.

    Args:
        own: the names of its agents.
        names: of all agents, by their numbers.
        before: whom it saw before the turn.
        after: whom it sees after it.
        team: its text.
    """

    def __init__(
        self, own: Collection[str], names: Mapping[int, str], before: frozenset[str], after: frozenset[str], team: str
    ) -> None:
        self._own, self._names, self._team = frozenset(own), names, team
        self._before, self._after = before | self._own, after | self._own
        self._followed = self._before & self._after  # all the way
        self._ways: dict[int, Callable[[Any], Any]] = {
            kinds.AGENT_CREATE: self._created,
            kinds.AGENT_PROGRESS: self._progress,
            kinds.FLYERS_ABOVE: self._above,
            kinds.GAME_TURN: lambda data: {"turn": data["turn"], "pace": data["pace"]},
            kinds.GAME_EVENT: self._event,
            kinds.USER_EVENT: self._event,
            kinds.GAME_MEMORY: self._memory,
            kinds.GAME_BLOCKED: lambda data: {"blocked": self._of_own(data["blocked"])},
            kinds.GAME_DEED: lambda data: data if data["agent"] in self._before else None,
            kinds.GAME_MESSAGE: self._message,
            kinds.SENSED: self._sensed,
            kinds.VISUALS: look_of,
        }

    def entries(self, kind: int, data: Any) -> Iterator[Any]:
        """Yield what stands for an event in the log, if the team may know of it."""
        if kind == kinds.MOVES:
            if self._names.get(data[0]) in self._followed:
                yield from data
        elif kind in _BY_NUMBER:
            if self._names.get(data[0]) in self._followed:
                yield kind, data
        elif kind in self._ways:
            known = self._ways[kind](data)
            if known is not None:
                yield kind, known
        elif self._is_open(kind, data):
            yield kind, data

    def _is_open(self, kind: int, data: Any) -> bool:
        if kind in _PUBLIC:
            return True
        if kind in _OF_THE_TEAM:
            return data["agent_name"] in self._own
        return kind in _OF_PLACES and data["agent_name"] in self._followed

    def appearing(self, after: DetachedState) -> Iterator[_Event]:
        """Yield where agents are that come into view, and that others are nowhere."""
        columns = after.agents.columns
        for row, name in enumerate(columns["names"]):
            number = columns["numbers"][row : row + 1]
            if name in self._after - self._before:
                yield from _put(
                    name, int(columns["node"][row]), columns["position"][row], flies=bool(columns["kind"][row])
                )
                if columns["edge_share"][row] > 0.0:
                    yield _on_edge(number, {key: columns[key][row : row + 1] for key in kinds.ON_EDGES})
            elif name in self._before - self._after:
                yield from _put(name, NOWHERE, np.zeros(3), flies=bool(columns["kind"][row]))
                yield _on_edge(number, {key: np.zeros_like(columns[key][row : row + 1]) for key in kinds.ON_EDGES})

    # -- events that are known in part ------------------------------------------------------------------------

    def _of_own(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in values.items() if name in self._own}

    def _created(self, data: Mapping[str, Any]) -> dict[str, Any]:
        if data["name"] in self._own:
            return dict(data)
        known = {key: data["kwargs"][key] for key in _TOLD_OF_NEW if key in data["kwargs"]}
        return {"name": data["name"], "kwargs": {**known, "start_node_id": NOWHERE}}

    def _progress(self, data: Mapping[str, Any]) -> dict[str, Any] | None:
        chosen = np.array([self._names.get(number) in self._followed for number in data["numbers"].tolist()], np.bool_)
        return {key: column[chosen] for key, column in data.items()} if chosen.any() else None

    def _above(self, data: Mapping[str, Any]) -> dict[str, Any] | None:
        chosen = [row for row, name in enumerate(data["names"]) if name in self._followed]
        nodes = {key: data[key][chosen] for key in ("node", "previous")}
        return {"names": [data["names"][row] for row in chosen], **nodes} if chosen else None

    def _event(self, data: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """What names agents, all of them out of sight, is not known."""
        all_names = set(self._names.values())
        named = {value for value in data.values() if isinstance(value, str) and value in all_names}
        return data if not named or named & (self._before | self._after) else None

    def _memory(self, data: Mapping[str, Any]) -> dict[str, Any]:
        teams = [(team, changes) for team, changes in data["teams"] if str(team) == self._team]
        return {"agents": self._of_own(data["agents"]), "teams": teams}

    def _message(self, data: Mapping[str, Any]) -> dict[str, Any] | None:
        """What it sent or heard, without what became of it elsewhere."""
        heard = {key: self._of_own(data[key]) for key in ARRIVALS}
        if data["sender"] not in self._own and not any(heard.values()):
            return None
        return {**data, **heard, "lost": [], "jammed": []}

    def _sensed(self, data: Mapping[str, Any]) -> dict[str, Any]:
        is_own = np.array([self._names.get(number) in self._own for number in data["agents"].tolist()], np.bool_)
        looks = np.repeat(is_own, data["counts"])
        ids = np.repeat(looks, data["sizes"].sum(axis=1)) if len(looks) else looks
        has_other = np.isin(data["forms"], sensed.WITH_OTHER)
        others = [one for one, mine in zip(data["others"], looks[has_other], strict=True) if mine]
        return {
            **{key: data[key][is_own] for key in ("agents", "counts")},
            **_renamed(data["sensors"], data["which"][looks]),
            **{key: data[key][looks] for key in ("forms", "sizes")},
            "ids": data["ids"][ids],
            "others": others,
        }


def _renamed(sensors: list[Any], which: IntArray) -> dict[str, Any]:
    """Return only those sensors that are looked by, and which each look is of."""
    used, places = np.unique(which, return_inverse=True)
    return {"sensors": [sensors[place] for place in used.tolist()], "which": places.astype(np.int64)}


def _put(name: str, node: int, position: "np.ndarray[Any, Any]", *, flies: bool) -> Iterator[_Event]:
    """Yield events that put an agent somewhere, whatever was known of it before."""
    if flies:
        yield kinds.AERIAL_AGENT_POSITION, {"agent_name": name, "position": position.tolist(), "node": node}
    else:
        yield kinds.AGENT_CURRENT_NODE, {"agent_name": name, "node_id": node}
    yield kinds.AGENT_PREV_NODE, {"agent_name": name, "node_id": node}


def _on_edge(number: IntArray, columns: Mapping[str, Any]) -> _Event:
    return kinds.AGENT_PROGRESS, {"numbers": number.copy(), **{key: column.copy() for key, column in columns.items()}}


def _flags(data: Mapping[Any, Any], seen: Collection[str]) -> dict[Any, Any]:
    """Return the flags that rules keep; that one out of sight carries a flag is known, but not who."""
    found = {}
    for key, kept in data.items():
        if isinstance(kept, dict) and isinstance(kept.get("bases"), dict) and isinstance(kept.get("carriers"), dict):
            carriers = {team: name if name is None or name in seen else "" for team, name in kept["carriers"].items()}
            found[key] = {"bases": dict(kept["bases"]), "carriers": carriers}
    return found


def look_of(visuals: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is public of how a game looks: the colours of teams."""
    return {"artists": [], **{key: visuals[key] for key in ("team_colors",) if key in visuals}}


def _side(name: str, team: Plain) -> str:
    return name if team is None else str(team)
