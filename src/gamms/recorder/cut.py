"""Reduce a recording to the knowledge of a team: the rest is not in the file.

`gamms.knowledge.sides` decides which events, columns and parts a team knows. Agents of other teams exist in a cut while
the team senses them, at their reported positions: they are created when they are seen and deleted when they are not.
Sensor data before a turn belong to the state before it, so that a state shows what the team decides from.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from copy import deepcopy
from itertools import chain, starmap
from typing import Any, BinaryIO

import numpy as np

from gamms.errors import BadValue
from gamms.ir import events as kinds
from gamms.ir.events import EVENTS, MOVES, Log, list_events, renumber_event
from gamms.ir.game_state import FIELD_EVENTS, FIELDS, GameState
from gamms.ir.graph import GraphColumns
from gamms.ir.schema import Audience
from gamms.knowledge import looks as sensed
from gamms.knowledge.fields import FieldTable
from gamms.knowledge.looks import Look, Nearest, Report, Sighting
from gamms.knowledge.sides import (
    KnownAgents,
    Side,
    find_known_flags,
    find_named_side,
    find_side,
    find_sighted,
    label_sides,
    list_assigned_labels,
    list_sides,
    names_only,
    select_by_name,
    select_columns,
    select_event,
    select_history,
    select_public_entries,
    select_visuals,
    split_heard,
)
from gamms.plain import Plain
from gamms.recorder import keyframes
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import DAMAGES, report_damage
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Writer
from gamms.recorder.keyframes import Keyframe

_Event = tuple[int, Any]
_KEYFRAME_TURNS = 64
_NAMES = {kinds.AGENT_CREATE: "name", kinds.AGENT_ALIVE: "agent_name"}
_VALUES = {event.code: (name, event.key) for name, event in FIELD_EVENTS.items() if FIELDS[name].axis == "agent"}


class KnowledgeFilter:
    """The knowledge of some agents about a game, computed turn by turn.

    While a turn waits for the sensor data behind it, agents have numbers assigned by this class; the final numbers are
    assigned when the turn is returned, in the order in which agents appear.

    Every method may raise one of `errors.DAMAGES` if an event does not fit the state.

    Args:
        keyframe: state at the beginning; unchanged.
        is_own: function of the name and the team of an agent: whether it is one of the agents with this knowledge.
        nearest: function from a place (x, y) to the nearest node.
        get_map: returns the first map of the recording.
        visuals: artists and colors in the header of the whole recording; None: none.

    Attributes:
        is_shown: whether the previous turn was returned.
        looked: the sensor reports of the own agents after the returned turns, with its agent numbers: data of `SENSED`
            events; empty if they are unknown.
    """

    def __init__(
        self,
        keyframe: Keyframe,
        is_own: Callable[[str, Any], bool],
        nearest: Nearest,
        get_map: Callable[[], GraphColumns],
        visuals: Mapping[str, Any] | None = None,
    ) -> None:
        self._is_own = is_own
        self._nearest = nearest
        self._get_map = get_map
        self._visuals = visuals
        self._met: set[str] = set()  # names of other agents shown so far
        self._ids: dict[str, int] = {}  # name -> number, while a turn waits
        self._seen: dict[str, Sighting] = {}  # other agents seen in the waiting turn
        self._in_view: Collection[str] = ()  # other agents seen in the present turn
        self._later: dict[int, list[_Event]] = {}  # turn -> messages that arrive in it
        self._turn = 0  # number of the present turn
        self._whole_fields = FieldTable()  # of the whole recording
        self._own_fields = FieldTable()  # of this knowledge, with numbers of its own
        self._waiting: list[_Event] | None = None  # the previous turn, until it is returned
        self._happened: list[_Event] = []  # events of the present turn
        self._deleted: set[str] = set()  # agents that the events of the present turn delete
        self._sighted: dict[str, Sighting] | None = None  # other agents seen in the present turn; None: no sensor data
        self.is_shown = False
        self.looked: list[dict[str, Any]] = []
        self._all = DetachedState(deepcopy(keyframe))  # state after all added events
        self._update_agents()
        self._first = self._restrict_keyframe(keyframe)
        self._flags = self._find_known_flags()  # that are known
        self._values = self._list_values()  # that are known
        self._known = DetachedState(deepcopy(self._first))  # state after all returned events
        self._numbers = {self._ids[name]: row for row, name in enumerate(self._first["names"])}
        self._carried = {sensor["id"]: sensor for sensor in self._list_sensors(self._own)}  # that are known
        self._looks = self.list_visuals()  # that are known

    def add(self, log: Log, *, is_end: bool = True) -> Iterator[Log]:
        """Add the events of the next turn; yields the previous turn once the own agents have sensed.

        So in a running game viewers see the data of a decision before the decision.

        Args:
            log: events since the last call.
            is_end: whether the turn is over.
        """
        for kind, data in list_events(log):
            if kind == kinds.SNAPSHOT and not self.is_shown:
                yield from self._give([])  # agents that are seen from here on appear after the snapshot
            if kind == kinds.SENSED:
                yield from self._note_sensor_data(data)
            else:
                self._happened.extend(self._cut(kind, data))
            self._all.apply_event(kind, data)
            self._happened.extend(self._note_consequences(kind, data))
        self._all.agents.settle()
        if is_end:
            yield from self._end()

    def _note_sensor_data(self, data: Mapping[str, Any]) -> Iterator[Log]:
        """Record the sensor data of the own agents; yields the previous turn, with the agents seen after it."""
        looks = self._select_own_looks(data)
        others = set(self._names.values()).difference(self._own)
        reports = [Report(look, self._names) for look in chain.from_iterable(each for _, each in looks)]
        self._sighted = (self._sighted or {}) | find_sighted(reports, others, self._nearest)
        self._in_view = self._sighted.keys()
        shown = [*self._show(self._sighted), *self._note_new_flags(self._find_known_flags())] if looks else []
        report = (
            kinds.SENSED,
            sensed.renumber_looks(sensed.make_columns(looks, self._own_fields, self._turn), self._get_id, int),
        )
        later = shown  # agents of a later part of the turn
        if looks and not self.is_shown:
            later = [event for event in shown if self._is_renewal(*event)]
            yield from self._give([event for event in shown if not self._is_renewal(*event)], [report])
        self._happened.extend(later)
        self._happened.append(report)

    def _is_renewal(self, kind: int, data: Plain) -> bool:
        """Return whether an event creates an agent that this turn has deleted before, perhaps from the team only."""
        return kind in (kinds.AGENT_CREATE, kinds.AGENT_ALIVE) and data[_NAMES[kind]] in self._deleted

    def _give(self, shown: list[_Event], reports: Iterable[_Event] = ()) -> Iterator[Log]:
        """Yield the previous turn with events for the agents seen after it; note the reports that show them."""
        self.is_shown = True
        given = self._apply_events([*(self._waiting or ()), *shown])
        self.looked = [sensed.renumber_looks(data, self._find_number) for _, data in reports]
        if self._waiting is not None:
            yield given
            self._known.apply([])  # counts the turn
            self._waiting = None

    def _find_number(self, agent: int) -> int:
        """Return the number of an agent in the cut; -1 for an agent that has come after the returned turns."""
        return self._numbers.get(agent, -1)

    def _end(self) -> Iterator[Log]:
        if not self.is_shown:
            yield from self._give([] if self._sighted is None else [*self._show({})])
        own = [*self._happened, *self._later.pop(self._turn, ()), *self._note_new_flags(self._find_known_flags())]
        self._waiting = own
        self._turn = self._turn + 1
        self._happened = []
        self._deleted = set()
        self._sighted = None
        self.is_shown = False

    def take_rest(self) -> Iterator[Log]:
        """Yield the last turn, which has no sensor data after it."""
        self.looked = []
        if self._waiting is not None:
            yield self._apply_events(self._waiting)
            self._known.apply([])
            self._waiting = None

    def make_keyframe(self, turns: int) -> Keyframe:
        """Return the state after `turns` returned turns; the initial state when one turn was added."""
        return ({} if turns else self._first) | self._known.make_keyframe(turns)

    def list_visuals(self) -> dict[str, Any] | None:
        """Return the artists and colors that the team knows now; None: none are declared."""
        if self._visuals is None:
            return None
        agents = self._own.keys() | self._met
        sensors = {sensor["id"] for sensor in self._list_sensors(self._own)}
        unknown = self._ids.keys() - agents - set(map(str, self._all.agents.columns["teams"]))
        return select_visuals(self._visuals, agents, sensors, unknown)

    # -- own agents ---------------------------------------------------------------------------------------------

    def _update_agents(self) -> None:
        """Update the existing agents and the own agents."""
        columns = self._all.agents.columns
        self._all.agents.settle()
        self._version = self._all.agents.version
        self._names = self._all.agents.get_names_by_number()
        for name in columns["names"]:
            self._ids.setdefault(name, len(self._ids))
        teams = dict(zip(columns["names"], columns["teams"], strict=True))
        self._own = {name: team for name, team in teams.items() if self._is_own(name, team)}

    @property
    def _agents(self) -> KnownAgents:
        """The agents that the team knows in the present turn."""
        return KnownAgents(self._own, self._in_view, self._ids, self._names)

    def _get_id(self, number: int) -> int:
        return self._ids[self._names[number]]

    def _list_sensors(self, names: Iterable[str]) -> list[dict[str, Any]]:
        """Return the sensors of the given agents, in the order of all sensors."""
        agents = self._all.agents
        carried = set(chain.from_iterable(agents.columns["sensors"][agents.find_row(name)].values() for name in names))
        return [sensor for sensor_id, sensor in self._all.sensors.items() if sensor_id in carried]

    # -- whole states ---------------------------------------------------------------------------------------------

    def _restrict_keyframe(self, of: Keyframe) -> Keyframe:
        """Return the state as known to the own agents; data outside the columns come from a keyframe or snapshot."""
        columns = self._all.agents.columns
        names = [name for name in columns["names"] if name in self._own]
        own = select_columns(columns, [self._all.agents.find_row(name) for name in names])
        own["numbers"] = np.arange(len(names))
        packed = keyframes.pack_keyframe(own, len(names), self._list_sensors(names), self._make_known_game(), None)
        return packed | select_history(of, self._agents, self._all.game.turn)

    def _make_known_game(self) -> GameState:
        """Return the part of the game state that the own agents know."""
        game = GameState()
        game.put_known(self._all.game, self._own, set(self._own.values()))
        game.data.update(self._find_known_flags())
        return game

    def _find_known_flags(self) -> dict[Any, Any]:
        return find_known_flags(self._all.game.data, self._agents.is_in_view)

    def _note_new_flags(self, now: dict[Any, Any]) -> Iterator[_Event]:
        before = self._flags
        self._flags = now
        if now != before:
            yield kinds.GAME_DATA, {"set": now, "removed": [key for key in before if key not in now]}

    def _list_values(self) -> dict[int, dict[str, Any]]:
        """Return the values of fields by agent that are recorded as a whole: kind of the event -> name -> value."""
        known = self._make_known_game()
        return {kind: dict(getattr(known, field)) for kind, (field, _) in _VALUES.items()}

    def _note_new_values(self, kind: int, data: Mapping[str, Any]) -> Iterator[_Event]:
        """Yield the values of the own agents if they have changed: other events are about agents of other teams."""
        _, key = _VALUES[kind]
        now = select_by_name(data[key], self._own)
        if now != self._values[kind]:
            self._values[kind] = now
            yield kind, {key: now}

    # -- waiting events -----------------------------------------------------------------------------------------

    def _cut(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield the part of an event that the own agents know, given the state before the event."""
        if kind in _VALUES:
            yield from self._note_new_values(kind, data)
        elif kind in EVENTS and EVENTS[kind].audience is Audience.HEARD:
            yield from self._note_messages(kind, data)
        else:
            known = select_event(kind, data, self._agents)
            if known is not None:
                yield kind, renumber_event(kind, known, self._get_id)

    def _note_messages(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield a message of the own agents now, and messages of others in the turns in which they arrive."""
        for later, known in split_heard(data, self._own):
            if data["sender"] in self._own:
                yield kind, known
            else:
                self._later.setdefault(self._turn + later, []).append((kind, known))

    def _note_consequences(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield consequences of an event: state changes, agents that joined or left the team, new sensors."""
        if kind == kinds.SNAPSHOT:
            yield from self._hide(list(self._seen))
            self._in_view = ()
            self._update_agents()
            yield kind, self._restrict_keyframe(data)
            self._flags = self._find_known_flags()
            self._values = self._list_values()
            self._carried = {sensor["id"]: sensor for sensor in self._list_sensors(self._own)}
        elif self._all.agents.version != self._version:
            before = self._own
            self._update_agents()
            there = self._all.agents.columns["names"]
            hidden = [name for name in self._seen if name in self._own or name not in there]
            yield from self._hide(hidden)
            left = [name for name in before if name not in self._own]
            for name in left:
                yield kinds.AGENT_DELETE, {"name": name}
            self._deleted.update(hidden, left)
            for name in [name for name in self._own if name not in before]:
                is_new = kind == kinds.AGENT_CREATE and data["name"] == name
                yield kinds.AGENT_CREATE, {**data, "strategy": None} if is_new else self._make_creation(name)
            yield from self._note_new_visuals()
        if kind in (kinds.SENSORS, kinds.AGENT_CREATE, kinds.AGENT_SENSOR_REGISTER, kinds.AGENT_TEAM):
            yield from self._note_new_sensors(data.get("removed", ()))
        if kind == kinds.VISUALS:
            self._visuals = data
            yield from self._note_new_visuals()

    def _note_new_sensors(self, removed: Iterable[str]) -> Iterator[_Event]:
        """Yield new or changed sensors of the own agents."""
        gone = [sensor_id for sensor_id in removed if self._carried.pop(sensor_id, None) is not None]
        new = [sensor for sensor in self._list_sensors(self._own) if self._carried.get(sensor["id"]) != sensor]
        self._carried.update((sensor["id"], sensor) for sensor in new)
        if new or gone:
            yield kinds.SENSORS, {"sensor_kinds": keyframes.group_sensors(new), **({"removed": gone} if gone else {})}
            yield from self._note_new_visuals()

    def _make_creation(self, name: str) -> dict[str, Any]:
        """Return the creation event of an agent that joined the team."""
        agents = self._all.agents
        columns = agents.columns
        row = agents.find_row(name)
        at = keyframes.get_row(columns, row)
        given = {
            "start_node_id": at["node"],
            "sensors": dict(columns["sensors"][row]),
            "team": columns["teams"][row],
            **columns["attributes"][row],
        }
        if columns["speed"][row] is not None:
            given["speed"] = columns["speed"][row]
        return _make_creation_data(name, given, at["position"])

    # -- visible agents -----------------------------------------------------------------------------------------

    def _select_own_looks(self, data: Mapping[str, Any]) -> list[tuple[int, list[Look]]]:
        """Return the looks of the sensors of the own agents, by agent."""
        numbers = [number for number in data["agents"].tolist() if self._names.get(number) in self._own]
        looks: dict[int, list[Look]] = {number: [] for number in numbers}
        for number, look in sensed.decode_looks(data, None, self._whole_fields, self._get_map):
            if number in looks:
                looks[number].append(sensed.as_reported(look, self._nearest, self._names))
        return [(self._get_id(number), each) for number, each in looks.items()]

    def _show(self, seen: Mapping[str, Sighting]) -> Iterator[_Event]:
        """Yield events that create, delete and move other agents, so that exactly the seen ones exist."""
        self._all.agents.settle()
        columns = self._all.agents.columns
        known = set(columns["names"]) - self._own.keys()
        there = [name for name in seen if name in known]
        yield from self._hide([name for name in self._seen if name not in there])
        for name in there:
            sighting = seen[name]
            row = self._all.agents.find_row(name)
            before = self._seen.get(name)
            if before is None:
                given = {"start_node_id": sighting.node, "team": columns["teams"][row]}
                yield kinds.AGENT_CREATE, _make_creation_data(name, given, sighting.position)
                if not columns["alive"][row]:
                    yield kinds.AGENT_ALIVE, {"agent_name": name, "alive": False}
            elif before != sighting and sighting.position is not None:
                yield kinds.AERIAL_AGENT_FLIGHT, (self._ids[name], sighting.node, *sighting.position)
            elif before != sighting:
                yield MOVES, [self._ids[name], sighting.node]
            self._seen[name] = sighting
        if not self._met.issuperset(there):
            self._met.update(there)
            yield from self._note_new_visuals()

    def _note_new_visuals(self) -> Iterator[_Event]:
        """Yield the artists and colors that the team knows, if they have changed."""
        now = self.list_visuals()
        if now != self._looks:
            self._looks = now
            yield kinds.VISUALS, now

    def _hide(self, names: Iterable[str]) -> Iterator[_Event]:
        for name in names:
            del self._seen[name]
            yield kinds.AGENT_DELETE, {"name": name}

    # -- returned events
    # --------------------------------------------------------------------------------------------

    def _apply_events(self, events: Iterable[_Event]) -> Log:
        """Return events with the agent numbers of the cut, and apply them to the known state."""
        log: Log = []
        for event in events:
            for kind, data in self._number_event(*event):
                self._known.apply_event(kind, data)
                if kind == MOVES:
                    log.extend(data)
                else:
                    log.append((kind, data))
        return log

    def _number_event(self, kind: int, data: Plain) -> Iterator[_Event]:
        """Yield an event with the agent numbers of the cut; nothing for an unknown agent."""
        number_of = self._numbers.__getitem__
        if kind in (kinds.AGENT_CREATE, kinds.AGENT_DELETE, kinds.SNAPSHOT):
            if self._renumber(kind, data):
                yield kind, data
        elif kind == MOVES:
            pairs = zip(data[::2], data[1::2], strict=True)
            known: list[int] = []
            for agent, node in pairs:
                if agent in self._numbers:
                    known += (number_of(agent), node)
            if known:
                yield kind, known
        elif kind == kinds.SENSED:
            yield kind, sensed.renumber_looks(data, number_of)
        elif names_only(kind, data, lambda name: self._ids[name] in self._numbers):
            yield kind, renumber_event(kind, data, number_of)

    def _renumber(self, kind: int, data: Plain) -> bool:
        """Update the agents after a creation or deletion; return whether anything changed."""
        if kind == kinds.SNAPSHOT:
            self._numbers = {self._ids[name]: row for row, name in enumerate(data["names"])}
            return True
        agent = self._ids[data["name"]]
        is_known = self._ids[data["name"]] in self._numbers
        if kind == kinds.AGENT_CREATE and not is_known:
            self._numbers[agent] = self._known.agents.following
        elif kind == kinds.AGENT_DELETE and is_known:
            del self._numbers[agent]
        return is_known == (kind == kinds.AGENT_DELETE)


def _make_creation_data(name: str, given: dict[str, Any], position: tuple[float, ...] | None) -> dict[str, Any]:
    """Return the data of the creation event of an agent, on the ground or in the air."""
    if position is None:
        return {"name": name, "kwargs": given}
    return {
        "name": name,
        "kwargs": {**given, "type": 1},
        "state": {"position": position, "node": given["start_node_id"]},
    }


def cut_header(header: Mapping[str, Any], cut: KnowledgeFilter) -> dict[str, Any]:
    """Return the part of a header that a team knows at the beginning."""
    visuals = cut.list_visuals()
    return {**select_public_entries(header), **({} if visuals is None else {"visuals": visuals})}


def write_cut(reader: Reader, columns: GraphColumns, out: BinaryIO, team: object) -> None:
    """Write the knowledge of a team to a stream; see `Recording.cut`.

    Args:
        reader: reader of the whole recording.
        columns: columns of its map.
        out: the stream.
        team: see `Recording.cut`.
    """
    first = reader.keyframe(0)
    if first is None or not any(True for _ in reader.events(kinds={kinds.SENSED})):
        raise BadValue(
            "This recording has no sensor data: it was made with sensed=False, or no agent carries a sensor."
        )

    def is_own(name: str, team: Any) -> bool:
        return find_side(name, team) == own

    with report_damage("It cannot be cut", DAMAGES, with_type=True):
        sides = dict.fromkeys(_list_sides(reader, first[1]))
    own = find_named_side(team, sides)
    with report_damage("It cannot be cut", DAMAGES):
        nearest = sensed.make_nearest(lambda: columns)
        cut = KnowledgeFilter(first[1], is_own, nearest, lambda: columns, reader.header.get("visuals"))
        header = cut_header(reader.header, cut)
        header |= {"seed": None, "audience": own.team, "sides": list_sides(reader.header, first[1], is_own)}
        if own.agent is not None:
            header |= {"audience": label_sides(sides, list_assigned_labels(reader.header))[own], "agents": [own.agent]}
    writer = Writer(out, header, seconds=None)
    for turn in range(reader.turns):
        with report_damage(f"Turn {turn + 1} cannot be cut", DAMAGES):
            complete = list(cut.add(reader.log(turn)))
            keyframe = cut.make_keyframe(turn) if turn % _KEYFRAME_TURNS == 0 else None
        for given in complete:
            writer.add_turn(given)
        if keyframe is not None:
            writer.keyframe(keyframe)
    with report_damage("Its last turn cannot be cut", DAMAGES):
        rest = list(cut.take_rest())
    for given in rest:
        writer.add_turn(given)
    writer.end_block()
    if reader.is_complete:
        writer.close()


def _list_sides(reader: Reader, first: Keyframe) -> list[Side]:
    """Return the sides of all agents, also of those that come later or change their team."""
    come = [(data["name"], data["kwargs"].get("team")) for *_, data in reader.events(kinds={kinds.AGENT_CREATE})]
    come += [(data["agent_name"], data["team"]) for *_, data in reader.events(kinds={kinds.AGENT_TEAM})]
    there = zip(first["names"], first["teams"], strict=True)
    return list(starmap(find_side, (*there, *come)))
