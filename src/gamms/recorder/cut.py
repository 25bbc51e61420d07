"""Cut a recording down to what a team knew: fog of war in the bytes, not on the screen.

Who may know of an event is what the table of events says (`ir/events.py`). Agents of others are there while the team
senses them, where its sensors reported them: they come when they are seen and are taken out when they are not. What
is sensed in front of a turn belongs to the state before it, so that a state shows what the team decides by.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from copy import deepcopy
from itertools import chain
from typing import Any, BinaryIO

import numpy as np

from gamms.errors import BadValue, UnknownName
from gamms.ir import events as kinds
from gamms.ir.events import DECISIONS, EVENTS, MOVES, Log, Role, events_of, renumbered
from gamms.ir.game_state import GameState
from gamms.ir.graph import GraphColumns
from gamms.ir.messages import ARRIVALS
from gamms.ir.schema import Audience
from gamms.plain import Plain
from gamms.recorder import keyframes, sensed
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import DAMAGES, refusing
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Writer
from gamms.recorder.keyframes import ARRAYS, LISTS, Keyframe
from gamms.recorder.sensed import Look, Nearest, Sighting
from gamms.text import as_text

_Event = tuple[int, Any]
_KEYFRAME_TURNS = 64
_PUBLIC = ("format", "package", "created", "world", "world_sha256")  # of a header; the rest may name agents of others
_OF_ALL = ("graph", "obstacles", "flags", "territory", "tags", "goals", "held", "discovered", "resources", "cooldowns")
_OF_AGENTS = (Role.AGENT, Role.NUMBER, Role.EACH, Role.BY_AGENT, Role.BY_TEAM)  # fields that tell of agents
_OF_STATE = ("pace", "components", "events", "settings", "facts")  # of a keyframe that all may know


class Cut:
    """What some agents know of a game, worked out turn by turn.

    While a turn waits for what is sensed behind it, its agents have numbers that this class gives to their names; only
    when it is given out is it clear which agents come in which order, and so which numbers they have there.

    Every call raises one of `errors.DAMAGES` where an event does not fit the state.

    Args:
        keyframe: how the game begins; not changed.
        is_own: says of the name and the team of an agent whether it is one of those that know.
        nearest: gives the node below a place, (x, y).
        visuals: what the header of the whole recording says of artists and colours; None: nothing.

    Attributes:
        is_shown: whether the turn before the one that is added was given out.
    """

    def __init__(
        self,
        keyframe: Keyframe,
        is_own: Callable[[str, Any], bool],
        nearest: Nearest,
        visuals: Mapping[str, Any] | None = None,
    ) -> None:
        self._is_own, self._nearest = is_own, nearest
        self._visuals = visuals
        self._met: set[str] = set()  # the names of others that were shown so far
        self._ids: dict[str, int] = {}  # name -> number while a turn waits
        self._seen: dict[str, Sighting] = {}  # others that the team sees, in the turn that waits
        self._in_view: Collection[str] = ()  # those that it sees in the turn that is added
        self._later: dict[int, list[_Event]] = {}  # turn -> messages that arrive in it
        self._turn = 0  # of the log that is added
        self._waiting: list[_Event] | None = None  # the turn that was added last, until it is given out
        self._happened: list[_Event] = []  # in the turn that is added
        self._sighted: dict[str, Sighting] | None = None  # others that are seen in it; None: nothing was sensed
        self.is_shown = False
        self._all = DetachedState(deepcopy(keyframe))  # where the events that are added have led to
        self._look_around()
        self._first = self._restricted(keyframe)
        self._flags = self._flags_in_view()  # that are known
        self._known = DetachedState(deepcopy(self._first))  # where those that were given out have led to
        self._numbers = {self._ids[name]: row for row, name in enumerate(self._first["names"])}
        self._carried = {sensor["id"]: sensor for sensor in self._sensors_of(self._own)}  # that are known
        self._looks = self.visuals()  # that are known

    def add(self, log: Log, *, is_end: bool = True) -> Iterator[Log]:
        """Add what has happened in the next turn; yields the one before it once its own agents have sensed.

        So a game that goes on shows what they decide by before they decide.

        Args:
            log: since the last call.
            is_end: whether the turn is over.
        """
        for kind, data in events_of(log):
            if kind == kinds.SENSED:
                yield from self._look(data)
            else:
                self._happened.extend(self._cut(kind, data))
            self._all.apply_event(kind, data)
            self._happened.extend(self._after(kind, data))
        self._all.agents.settle()
        if is_end:
            yield from self._end()

    def _look(self, data: Mapping[str, Any]) -> Iterator[Log]:
        """Note what its own agents sense; yields the turn before, with what they see behind it."""
        looks = self._own_looks(data)
        self._sighted = (self._sighted or {}) | self._sightings(looks)
        self._in_view = self._sighted.keys()
        shown = [*self._show(self._sighted), *self._new_flags(self._flags_in_view())] if looks else []
        if looks and not self.is_shown:
            yield from self._give(shown)
        else:  # agents of a later part of the turn
            self._happened.extend(shown)
        self._happened.append((kinds.SENSED, sensed.renumbered(sensed.columns_of(looks), self._id_of)))

    def _give(self, shown: list[_Event]) -> Iterator[Log]:
        """Yield the turn before with what is shown behind it."""
        self.is_shown = True
        if self._waiting is None:
            self._given(shown)
        else:
            yield self._given([*self._waiting, *shown])
            self._known.apply([])  # counts the turn
            self._waiting = None

    def _end(self) -> Iterator[Log]:
        if not self.is_shown:
            yield from self._give([] if self._sighted is None else [*self._show({})])
        own = [*self._happened, *self._later.pop(self._turn, ()), *self._new_flags(self._flags_in_view())]
        self._waiting, self._turn = own, self._turn + 1
        self._happened, self._sighted, self.is_shown = [], None, False

    def rest(self) -> Iterator[Log]:
        """Yield the last turn, behind which nothing was sensed."""
        if self._waiting is not None:
            yield self._given(self._waiting)
            self._known.apply([])
            self._waiting = None

    def keyframe(self, turns: int) -> Keyframe:
        """Return the state after so many turns, all that were given out; the first one when one turn was added."""
        return ({} if turns else self._first) | self._known.keyframe(turns)

    def visuals(self) -> dict[str, Any] | None:
        """Return the artists and colours that the team knows now; None: nothing was declared.

        Artists with drawers or shapes of the program's own are left out: they see everything.
        """
        if self._visuals is None:
            return None
        agents, sensors = self._own.keys() | self._met, {sensor["id"] for sensor in self._sensors_of(self._own)}
        names = {"agent": agents, "sensor": sensors}
        artists = [
            one
            for one in self._visuals["artists"]
            if one["kind"] in _OF_ALL or one["keywords"].get("name") in names.get(one["kind"], ())
        ]
        known = {**self._visuals, "artists": artists}
        if "team_colors" in known:
            hidden = self._ids.keys() - agents - set(map(str, self._all.agents.columns["teams"]))
            known["team_colors"] = {side: one for side, one in known["team_colors"].items() if side not in hidden}
        return known

    # -- who is known -------------------------------------------------------------------------------------------

    def _look_around(self) -> None:
        """Note who is there, and who is one of those that know."""
        columns = self._all.agents.columns
        self._all.agents.settle()
        self._version = self._all.agents.version
        self._names = self._all.agents.names_by_number()
        for name in columns["names"]:
            self._ids.setdefault(name, len(self._ids))
        teams = dict(zip(columns["names"], columns["teams"], strict=True))
        self._own = {name: team for name, team in teams.items() if self._is_own(name, team)}

    def _id_of(self, number: int) -> int:
        return self._ids[self._names[number]]

    def _sensors_of(self, names: Iterable[str]) -> list[dict[str, Any]]:
        """Return the sensors that agents carry, in the order of all."""
        agents = self._all.agents
        carried = {one for name in names for one in agents.columns["sensors"][agents.row(name)].values()}
        return [sensor for sensor_id, sensor in self._all.sensors.items() if sensor_id in carried]

    # -- whole states ---------------------------------------------------------------------------------------------

    def _restricted(self, of: Keyframe) -> Keyframe:
        """Return the state as its own agents know it; what is not in columns is taken from a keyframe or snapshot."""
        columns = self._all.agents.columns
        names = [name for name in columns["names"] if name in self._own]
        rows = [self._all.agents.row(name) for name in names]
        own = {name: [columns[name][row] for row in rows] for name in LISTS}
        own |= {name: columns[name][rows] for name in ARRAYS} | {"numbers": np.arange(len(rows))}
        own["strategies"] = [None] * len(rows)
        packed = keyframes.packed(own, len(rows), self._sensors_of(names), self._game(), None)
        history: dict[str, Any] = {key: deepcopy(of[key]) for key in _OF_STATE if key in of}
        events = history.get("events", ())
        history["events"] = [event for event in events if self._is_witnessed(kinds.GAME_EVENT, event)]
        for channel in history.get("settings", {}).get("channels", {}).values():
            if "jammers" in channel:
                channel["jammers"] = [one for one in channel["jammers"] if one.get("agent", "") in {"", *self._own}]
        if "deeds" in of:
            history["deeds"] = [deed for deed in of["deeds"] if deed["agent"] in self._own]
        if "messages" in of:
            history["messages"] = list(self._heard(of["messages"]))
        if "starts" in of:
            history["starts"] = self._of_own(of["starts"])
        return packed | history

    def _heard(self, entries: Iterable[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
        """Yield the messages that its own agents sent, or have heard by now, without what they do not know of them."""
        for entry in entries:
            heard = self._heard_until(entry, self._all.game.turn)
            if entry["sender"] in self._own or any(heard.values()):
                yield {**entry, **heard, "lost": [], "jammed": []}

    def _heard_until(self, entry: Mapping[str, Any], turn: float) -> dict[str, dict[str, int]]:
        return {
            key: {name: at for name, at in entry[key].items() if name in self._own and at <= turn} for key in ARRIVALS
        }

    def _game(self) -> GameState:
        """Return what its own agents know of what the game has come to."""
        game = GameState()
        game.put_known(self._all.game, self._own, set(self._own.values()))
        game.data.update(self._flags_in_view())
        return game

    def _flags_in_view(self) -> dict[Any, Any]:
        """Return the flags that rules keep: where they begin, and that one is carried, but not by whom out of sight."""
        found = {}
        for key, kept in self._all.game.data.items():
            if isinstance(kept, dict) and all(isinstance(kept.get(part), dict) for part in ("bases", "carriers")):
                carriers = {
                    team: name if name is None or self._is_in_view(name) else ""
                    for team, name in kept["carriers"].items()
                }
                found[key] = {"bases": dict(kept["bases"]), "carriers": carriers}
        return found

    def _new_flags(self, now: dict[Any, Any]) -> Iterator[_Event]:
        before, self._flags = self._flags, now
        if now != before:
            yield kinds.GAME_DATA, {"set": now, "removed": [key for key in before if key not in now]}

    def _is_in_view(self, name: str) -> bool:
        return name in self._own or name in self._in_view

    def _of_own(self, by_name: Mapping[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in by_name.items() if name in self._own}

    # -- events, while they wait ------------------------------------------------------------------------------------

    def _cut(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield the part of an event that the agents know, given the state before the event."""
        audience = EVENTS[kind].audience if kind in EVENTS else Audience.HOST
        if audience is Audience.HEARD:
            yield from self._heard_later(kind, data)
        elif audience is Audience.WITNESSED:
            if self._is_witnessed(kind, data):
                yield kind, data
        elif audience is not Audience.HOST:
            own = self._own_part(kind, data)
            if own is not None:
                yield kind, own

    def _own_part(self, kind: int, data: Plain) -> Any:
        """Return the data of an event as far as the agents know it; None: they know nothing of it."""
        if kind == MOVES:
            return [item for pair in zip(data[::2], data[1::2], strict=True) for item in self._own_move(*pair)] or None
        if isinstance(data, tuple):  # (number, …)
            return (self._id_of(data[0]), *data[1:]) if self._names.get(data[0]) in self._own else None
        known = EVENTS[kind]
        own = {}
        is_empty = known.audience is not Audience.ALL
        rows = self._own_rows(kind, data)
        for key, value in data.items():
            role = known.fields[key].role if key in known.fields else Role.PLAIN
            own[key] = value
            if role is Role.AGENT and isinstance(value, str):
                is_empty = is_empty and value not in self._own
            elif role in _OF_AGENTS:
                own[key] = self._own_items(role, value, rows)
                is_empty = is_empty and not len(own[key])
        has_agents = any(field.role in _OF_AGENTS for field in known.fields.values())
        return None if is_empty and has_agents else own

    def _own_move(self, number: int, node: int) -> Iterator[int]:
        if self._names.get(int(number)) in self._own:
            yield self._id_of(int(number))
            yield int(node)

    def _own_rows(self, kind: int, data: Mapping[str, Any]) -> list[int]:
        """Return the places of the agents in the columns of an event."""
        names: list[str] = []
        for key, field in EVENTS[kind].fields.items():
            if field.role is Role.NUMBER:
                names = [self._names[number] for number in np.asarray(data[key]).tolist()]
            elif field.role is Role.AGENT and isinstance(data.get(key), list):
                names = data[key]
        return [row for row, name in enumerate(names) if name in self._own]

    def _own_items(self, role: Role, value: Plain, rows: list[int]) -> Any:
        """Return the part of the value of a field that is of the agents."""
        if role is Role.BY_AGENT:
            return self._of_own(value)
        if role is Role.BY_TEAM:
            teams = set(self._own.values())
            return [pair for pair in value if pair[0] in teams]
        items = value[rows] if isinstance(value, np.ndarray) else [value[row] for row in rows]
        if role is Role.NUMBER:
            items[:] = [self._id_of(number) for number in np.asarray(items).tolist()]
        return items

    def _is_witnessed(self, kind: int, data: Mapping[str, Any]) -> bool:
        """Whether an event names no agents, or one that is in sight; rules emit for those who watch a game."""
        if data.get("kind") in DECISIONS and "agent" in data:
            return data["agent"] in self._own
        actors = [data[key] for key, field in EVENTS[kind].fields.items() if field.role is Role.AGENT]
        named = actors or [text for text in _texts_in(data) if text in self._ids]
        return not named or any(map(self._is_in_view, named))

    def _heard_later(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield a message of its own agents now; those of others in the turns in which they are heard."""
        own = {**data, "lost": [], "jammed": []}
        if data["sender"] in self._own:
            yield kind, own | self._heard_until(data, np.inf)
            return
        heard = self._heard_until(data, np.inf)
        for turn in sorted({turn for each in heard.values() for turn in each.values()}):
            now = {key: {name: at for name, at in each.items() if at == turn} for key, each in heard.items()}
            self._later.setdefault(self._turn + max(turn - data["turn"], 0), []).append((kind, own | now))

    def _after(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield what follows from an event that has happened: the state it set, who joined or left, new sensors."""
        if kind == kinds.SNAPSHOT:
            yield from self._hide(list(self._seen))
            self._in_view = ()
            self._look_around()
            yield kind, self._restricted(data)
            self._flags = self._flags_in_view()
            self._carried = {sensor["id"]: sensor for sensor in self._sensors_of(self._own)}
        elif self._all.agents.version != self._version:
            before = self._own
            self._look_around()
            there = self._all.agents.columns["names"]
            yield from self._hide([name for name in self._seen if name in self._own or name not in there])
            for name in [name for name in before if name not in self._own]:
                yield kinds.AGENT_DELETE, {"name": name}
            for name in [name for name in self._own if name not in before]:
                is_new = kind == kinds.AGENT_CREATE and data["name"] == name
                yield kinds.AGENT_CREATE, {**data, "strategy": None} if is_new else self._creation(name)
            yield from self._new_visuals()
        if kind in (kinds.SENSORS, kinds.AGENT_CREATE, kinds.AGENT_SENSOR_REGISTER, kinds.AGENT_TEAM):
            yield from self._new_sensors(data.get("removed", ()))
        if kind == kinds.VISUALS:
            self._visuals = data
            yield from self._new_visuals()

    def _new_sensors(self, removed: Iterable[str]) -> Iterator[_Event]:
        """Yield which sensors its own agents carry that were not known, or are set otherwise now."""
        gone = [sensor_id for sensor_id in removed if self._carried.pop(sensor_id, None) is not None]
        new = [sensor for sensor in self._sensors_of(self._own) if self._carried.get(sensor["id"]) != sensor]
        self._carried.update((sensor["id"], sensor) for sensor in new)
        if new or gone:
            yield kinds.SENSORS, {"sensor_kinds": keyframes.grouped(new), **({"removed": gone} if gone else {})}
            yield from self._new_visuals()

    def _creation(self, name: str) -> dict[str, Any]:
        """Return what says that an agent comes which has come to the team."""
        agents = self._all.agents
        columns, row = agents.columns, agents.row(name)
        at = keyframes.row_of(columns, row)
        given = {
            "start_node_id": at["node"],
            "sensors": dict(columns["sensors"][row]),
            "team": columns["teams"][row],
            **columns["attributes"][row],
        }
        if columns["speed"][row] is not None:
            given["speed"] = columns["speed"][row]
        return _coming(name, given, at["position"])

    # -- who is seen ------------------------------------------------------------------------------------------------

    def _own_looks(self, data: Mapping[str, Any]) -> list[tuple[int, list[Look]]]:
        """Return what sensors of its own agents gave, by agent."""
        numbers = [number for number in data["agents"].tolist() if self._names.get(number) in self._own]
        looks: dict[int, list[Look]] = {number: [] for number in numbers}
        for number, look in sensed.looks_of(data):
            if number in looks:
                looks[number].append(sensed.as_reported(look, self._nearest, self._names))
        return [(self._id_of(number), each) for number, each in looks.items()]

    def _sightings(self, observers: Iterable[tuple[int, list[Look]]]) -> dict[str, Sighting]:
        """Return where looks have seen agents of others that are there."""
        found, there = {}, set(self._names.values())
        for look in chain.from_iterable(looks for _, looks in observers):
            for agent, sighting in sensed.sightings(look, self._nearest):
                name = self._names.get(agent) if isinstance(agent, int) else agent
                if name in there and name not in self._own:
                    found[name] = sighting
        return found

    def _show(self, seen: Mapping[str, Sighting]) -> Iterator[_Event]:
        """Yield the coming, going and moving of others by which just those are there that are seen."""
        self._all.agents.settle()
        columns = self._all.agents.columns
        known = set(columns["names"]) - self._own.keys()
        there = [name for name in seen if name in known]
        yield from self._hide([name for name in self._seen if name not in there])
        for name in there:
            sighting, row, before = seen[name], self._all.agents.row(name), self._seen.get(name)
            if before is None:
                given = {"start_node_id": sighting.node, "team": columns["teams"][row]}
                yield kinds.AGENT_CREATE, _coming(name, given, sighting.position)
                if not columns["alive"][row]:
                    yield kinds.AGENT_ALIVE, {"agent_name": name, "alive": False}
            elif before != sighting and sighting.position is not None:
                yield kinds.AERIAL_AGENT_FLIGHT, (self._ids[name], sighting.node, *sighting.position)
            elif before != sighting:
                yield MOVES, [self._ids[name], sighting.node]
            self._seen[name] = sighting
        if not self._met.issuperset(there):
            self._met.update(there)
            yield from self._new_visuals()

    def _new_visuals(self) -> Iterator[_Event]:
        """Yield the artists and colours that the team knows, if these are others than before."""
        now = self.visuals()
        if now != self._looks:
            self._looks = now
            yield kinds.VISUALS, now

    def _hide(self, names: Iterable[str]) -> Iterator[_Event]:
        for name in names:
            del self._seen[name]
            yield kinds.AGENT_DELETE, {"name": name}

    # -- events, given out --------------------------------------------------------------------------------------------

    def _given(self, events: Iterable[_Event]) -> Log:
        """Return events with the numbers that agents have where the cut is read, and apply them to what is known."""
        log: Log = []
        for event in events:
            for kind, data in self._numbered(*event):
                self._known.apply_event(kind, data)
                if kind == MOVES:
                    log.extend(data)
                else:
                    log.append((kind, data))
        return log

    def _numbered(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield an event with these numbers; nothing, if it is of an agent that is not known."""
        number_of = self._numbers.__getitem__
        if kind in (kinds.AGENT_CREATE, kinds.AGENT_DELETE, kinds.SNAPSHOT):
            if self._renumber(kind, data):
                yield kind, data
        elif kind == MOVES:
            pairs = zip(data[::2], data[1::2], strict=True)
            known = [item for agent, node in pairs if agent in self._numbers for item in (number_of(agent), node)]
            if known:
                yield kind, known
        elif kind == kinds.SENSED:
            yield kind, sensed.renumbered(renumbered(kind, data, number_of), number_of)
        elif "agent_name" not in EVENTS[kind].fields or self._ids[data["agent_name"]] in self._numbers:
            yield kind, renumbered(kind, data, number_of)

    def _renumber(self, kind: int, data: Plain) -> bool:
        """Note who comes and goes by an event; returns whether that is news."""
        if kind == kinds.SNAPSHOT:
            self._numbers = {self._ids[name]: row for row, name in enumerate(data["names"])}
            return True
        agent, is_known = self._ids[data["name"]], self._ids[data["name"]] in self._numbers
        if kind == kinds.AGENT_CREATE and not is_known:
            self._numbers[agent] = self._known.agents.following
        elif kind == kinds.AGENT_DELETE and is_known:
            del self._numbers[agent]
        return is_known == (kind == kinds.AGENT_DELETE)


def _coming(name: str, given: dict[str, Any], position: tuple[float, ...] | None) -> dict[str, Any]:
    """Return the data of the event that an agent comes, on the ground or in the air."""
    if position is None:
        return {"name": name, "kwargs": given}
    return {
        "name": name,
        "kwargs": {**given, "type": 1},
        "state": {"position": position, "node": given["start_node_id"]},
    }


def _texts_in(value: Plain) -> Iterator[str]:
    """Yield all texts in a plain value, those in lists and dicts in it, too."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        yield from _texts_in([*value.keys(), *value.values()])
    elif isinstance(value, (list, tuple, set, frozenset)):
        for one in value:
            yield from _texts_in(one)


def sides_of(
    header: Mapping[str, Any], first: Keyframe, is_own: Callable[[str, Any], bool] = lambda _name, _team: True
) -> list[str | None]:
    """Return the sides of a game in the order in which they choose their colours, which no cut changes.

    A side is a team, by its text, or an agent without one, by its name; None for such an agent that is not known.

    Args:
        header: of the whole recording.
        first: the first keyframe of the game.
        is_own: says of the name and the team of an agent whether it is known.
    """
    sides: dict[str | int, str | None] = {}
    for name, team in zip(first["names"], first["teams"], strict=True):
        if team is None and not is_own(name, team):
            sides[len(sides)] = None
        else:
            side = name if team is None else as_text(team)
            sides[side] = side
    scenario = header.get("scenario")
    teams = scenario.get("teams") if isinstance(scenario, Mapping) else None
    sides |= {team: team for team in teams or () if isinstance(team, str)}  # some may come later
    return list(sides.values())


def cut_header(header: Mapping[str, Any], cut: Cut) -> dict[str, Any]:
    """Return what a team knows of the header of a game in the beginning."""
    visuals = cut.visuals()
    public = {key: header[key] for key in _PUBLIC if key in header}
    return {**public, **({} if visuals is None else {"visuals": visuals})}


def write_cut(reader: Reader, columns: GraphColumns, out: BinaryIO, team: object) -> None:
    """Write what a team knew into a stream; see `Recording.cut`.

    Args:
        reader: of the whole recording.
        columns: of its map.
        out: the stream.
        team: see there.
    """
    first = reader.keyframe(0)
    if first is None or not any(True for _ in reader.events(kinds={kinds.SENSED})):
        raise BadValue("This recording does not say what agents sensed: record with ctx.record.start(…, sensed=True).")

    def is_own(name: str, team: Any) -> bool:
        return bool((name if team is None else team) == own)

    own = _team_of(reader, first[1], team)
    with refusing("It cannot be cut", DAMAGES):
        cut = Cut(first[1], is_own, sensed.nearest_on(lambda: columns), reader.header.get("visuals"))
        header = cut_header(reader.header, cut)
    header |= {"seed": None, "audience": own, "sides": sides_of(reader.header, first[1], is_own)}
    writer = Writer(out, header, seconds=None)
    for turn in range(reader.turns):
        with refusing(f"Turn {turn + 1} cannot be cut", DAMAGES):
            complete = list(cut.add(reader.log(turn)))
        for given in complete:
            writer.add_turn(given)
        if turn % _KEYFRAME_TURNS == 0:
            writer.keyframe(cut.keyframe(turn))
    for given in cut.rest():
        writer.add_turn(given)
    writer.close()


def _team_of(reader: Reader, first: Keyframe, team: object) -> Any:
    """Return the team that a caller means, as agents have it; the name of an agent that has none."""
    come = [(data["name"], data["kwargs"].get("team")) for *_, data in reader.events(kinds={kinds.AGENT_CREATE})]
    come += [(data["agent_name"], data["team"]) for *_, data in reader.events(kinds={kinds.AGENT_TEAM})]
    there = zip(first["names"], first["teams"], strict=True)
    teams = [name if own is None else own for name, own in (*there, *come)]
    for known in teams:
        if known == team or str(known) == team:
            return known
    raise UnknownName("team", team, dict.fromkeys(map(str, teams)))
