"""The knowledge of agents as pages show it: sensor results, the nodes that teams see, and facts as short texts.

The nodes that sensors of agents cover are read from the recording. Older recordings lack them: there the sensors of a
context that follows the game are asked.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from math import inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from gamms.ir import events as kinds
from gamms.ir.events import Log, list_events
from gamms.ir.graph import IntArray
from gamms.ir.messages import ARRIVALS
from gamms.ir.schema import RECORDED_NUMBERS
from gamms.ir.sensor_results import SensorView
from gamms.knowledge.fields import FieldTable, find_field, find_node_rows, find_places, find_pose
from gamms.knowledge.looks import Look, Report, decode_looks, refuse_many
from gamms.knowledge.sides import (
    AgentPlaces,
    SeenParts,
    Side,
    SideKnowledge,
    SideLook,
    as_side_look,
    find_known,
    find_seen,
    find_side,
    label_sides,
)
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import report_damage
from gamms.text import as_digits, as_text
from gamms.typing import IAgent, ISensor
from gamms.typing.context import HostContext

MOST_SIDES = 20  # with more sides, pages do not show what each side sees
# cached fields of view, and their nodes
_MOST_KNOWN = 20_000
_MOST_NODES = 1 << 24
_NONE = np.zeros(0, np.int64)
_MOST_WORDS = 400
_MOST_ITEMS = 24
_MOST_PAIRS = 50
_MOST_ROWS = 400
_MOST_BODY = 120  # letters of a message
_NOTHING = "\u2013"  # a dash
_OPEN = ""
# fates of messages, after the indices in `ARRIVALS`
LOST = 2
UNHEARD = 3
_DECISION = "Decision"
_MESSAGES = "Messages"
_OF_ONE = {  # kinds of events that change the facts about the agent that they name
    kinds.AGENT_TEAM,
    kinds.AGENT_SPEED,
    kinds.AGENT_STRATEGY,
    kinds.AGENT_SENSOR_REGISTER,
    kinds.AGENT_SENSOR_DEREGISTER,
    *(one.event.code for one in RECORDED_NUMBERS if one.event is not None),
}
_OF_ALL = {kinds.SNAPSHOT, kinds.AGENT_CREATE, kinds.AGENT_DELETE, kinds.SENSORS, kinds.AGENT_ATTRIBUTE}

Facts = dict[tuple[str, str], str]
"""(heading, key) -> text."""


# -- sensor reports -----------------------------------------------------------------------------------------------


class FieldOutline(NamedTuple):
    """The outline of a field of view.

    Attributes:
        is_carried: whether the corners are relative to the agent, and move with it.
        is_blocked: whether obstacles can hide places inside.
        corners: (2, corners) x and y, in steps of the map.
    """

    is_carried: bool
    is_blocked: bool
    corners: IntArray


class SensorLook(NamedTuple):
    """The report of one sensor of an agent.

    Attributes:
        agent: the name of the agent.
        sensor: the name of the sensor.
        kind: the type of the sensor.
        shape: the outline of the field of view; None: there is none.
        seen: the content of the report.
        words: any other report, as text; None: there is none.
    """

    agent: str
    sensor: str
    kind: str
    shape: FieldOutline | None
    seen: SeenParts
    words: str | None


class SensedTurn(NamedTuple):
    """The sensor reports of one turn, and the knowledge of each side."""

    looks: Sequence[SensorLook]
    sides: Mapping[str, SideKnowledge]


class KnowledgeTracker:
    """Computes what agents sense, in a context that follows a game.

    Args:
        ctx: the context, with the first map of the recording.
        step: returns the unit of the corners of outlines, map units.
        labels: texts of sides in the header; see `label_sides`.
    """

    def __init__(self, ctx: HostContext, step: Callable[[], float], labels: Sequence[str] = ()) -> None:
        self._ctx = ctx
        self._labels = labels
        self._step = step
        self._fields = FieldTable()
        self._first_map = ctx.graph.columns()
        self._covered: dict[Any, IntArray] = {}
        self._held = 0  # nodes in it
        self._shapes: dict[Any, FieldOutline | None] = {}
        self._on_edges: Mapping[str, tuple[float, float]] = {}  # the positions of agents between nodes

    def forget(self) -> None:
        """Clear the cached fields of view, because sensors or the map have changed."""
        self._covered.clear()
        self._held = 0
        self._shapes.clear()

    def make_sensed_turn(self, looked: Sequence[Mapping[str, Any]], state: DetachedState) -> SensedTurn:
        """Return the sensor reports of the current state, and the knowledge of each side.

        Args:
            looked: the data of events of the kind `SENSED`.
            state: the current state of the game.
        """
        names = state.agents.get_names_by_number()
        self._on_edges = find_places(self._ctx)
        nodes = find_node_rows(self._ctx.graph, state.agents.columns["node"]).tolist()
        at = dict(zip(state.agents.columns["names"], nodes, strict=True))
        with report_damage("What was sensed is not right", with_type=True):
            refuse_many(looked)
            each = [decode_looks(data, None, self._fields, lambda: self._first_map) for data in looked]
            found = list(chain.from_iterable(each))
            looks = [self._describe(names[number], look, names, at) for number, look in found if number in names]
        return SensedTurn([look for look, _ in looks], self._list_sides([part for _, part in looks], state))

    def _describe(
        self, name: str, look: Look, names: Mapping[int, str], now: Mapping[str, int]
    ) -> tuple[SensorLook, SideLook]:
        """Return the report of a sensor of an agent, and the part of it that counts for its side."""
        agent: Any = self._ctx.agent.agents.get(name)
        sensor: Any = None if agent is None else agent.sensors.get(look.sensor)
        seen = find_seen(Report(look, names), sensor, now, self._ctx.graph)
        has_end = isfinite(getattr(sensor, "range", inf))
        pose = find_pose(sensor, agent) if has_end else (None, None)
        shape = self._outline_unblocked_field(agent, sensor, pose) if has_end else None
        field = self._find_field_rows(look, agent, sensor, pose) if has_end else _NONE
        words = None if seen.other is None else format_words(seen.other)
        described = SensorLook(name, as_text(look.sensor), as_text(look.kind), shape, seen, words)
        return described, as_side_look(name, sensor, seen, field)

    # -- fields of view -----------------------------------------------------------------------------------------

    def _outline_unblocked_field(self, agent: IAgent, sensor: ISensor, pose: tuple[Any, Any]) -> FieldOutline | None:
        """Return the outline of a sensor's field of view, as if nothing blocked it; None if it has none."""
        place, look = pose
        key = sensor.sensor_id, look
        if key not in self._shapes:
            self._shapes[key] = self._outline_field(
                sensor.view_of({}, agent.current_node_id, agent.name), sensor, place
            )
        return self._shapes[key]

    def _outline_field(self, view: SensorView, sensor: ISensor, place: "int | Sequence[float]") -> FieldOutline | None:
        is_blocked = len(view.reach) > 0
        outline = view.reach if is_blocked else view.outline
        if len(outline) < 3 or not np.isfinite(outline).all():
            return None
        is_carried = getattr(sensor, "at", None) is None
        if isinstance(place, int):
            node = self._ctx.graph.graph.get_node(place)
            place = node.x, node.y
        corners = np.rint((outline - place[:2] if is_carried else outline) / self._step())
        return FieldOutline(is_carried, is_blocked, corners.astype(np.int64).T)

    def _find_field_rows(self, look: Look, agent: IAgent, sensor: ISensor, pose: tuple[Any, Any]) -> IntArray:
        """Return the rows of the nodes that a sensor of agents covers; empty for other sensors."""
        key = look.field or (sensor.sensor_id, *pose, self._on_edges.get(agent.name))
        known = self._covered.get(key)
        if known is None:
            known = find_field(look.field, sensor, agent, self._on_edges, self._ctx.graph)
            self._held += len(known)
            if len(self._covered) >= _MOST_KNOWN or self._held > _MOST_NODES:
                self._covered.clear()
                self._held = len(known)
            self._covered[key] = known
        return known

    # -- sides --------------------------------------------------------------------------------------------------

    def _list_sides(self, looks: Sequence[SideLook], state: DetachedState) -> dict[str, SideKnowledge]:
        """Return side -> its knowledge; empty if there are more than `MOST_SIDES` sides."""
        columns = state.agents.columns
        all_sides = list_sides_of_agents(columns)
        labels = label_sides(all_sides, self._labels)
        if len(labels) > MOST_SIDES:
            return {}
        places = AgentPlaces(
            columns["names"],
            all_sides,
            find_node_rows(self._ctx.graph, columns["node"]),
            np.asarray(columns["alive"]) != 0,
            (np.asarray(columns["kind"]) == 0) & (np.asarray(columns["edge_share"]) == 0),
        )
        known = find_known(labels, looks, places, len(self._ctx.graph.columns().node_ids))
        return {labels[side]: one for side, one in known.items()}


def list_sides_of_agents(columns: Mapping[str, Any]) -> list[Side]:
    """Return the side of each agent."""
    return list(map(find_side, columns["names"], columns["teams"]))


# -- facts in words -----------------------------------------------------------------------------------------------


def format_words(value: object, most: int = _MOST_WORDS) -> str:
    """Return a plain value as text of at most `most` characters."""
    words = _format_value(value, 4)
    return words if len(words) <= most else f"{words[: most - 1]}…"


def _format_value(value: object, depth: int) -> str:
    if isinstance(value, dict):
        return _format_items([(f"{as_text(key)}: ", one) for key, one in value.items()], _MOST_PAIRS, depth)
    if isinstance(value, set | frozenset):
        value = sorted(value, key=as_text)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return _format_items([("", one) for one in value], _MOST_ITEMS, depth)
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, float):
        return as_digits(value)
    if value is None:
        return _NOTHING
    return as_text(value).lower() if isinstance(value, bool) else as_text(value)


def _format_items(items: Sequence[tuple[str, Any]], most: int, depth: int) -> str:
    """Return the first items as text, each after its label."""
    if not items or not depth:
        return "…" if items else _NOTHING
    shown = ", ".join(f"{label}{_format_value(one, depth - 1)}" for label, one in items[:most])
    return f"{shown}, … ({len(items)})" if len(items) > most else shown


class AgentFacts:
    """Collects facts about agents as short texts, and finds the ones that change.

    Args:
        state: the state of the game, which the caller updates.
    """

    def __init__(self, state: DetachedState) -> None:
        self._state = state
        self._known: dict[str, Facts] = {}  # agent -> lasting facts
        self._momentary: dict[str, Facts] = {}  # agent -> facts about the last turn
        self._sent: dict[int, list[tuple[str, str, int, str, str]]] = {}  # turn -> messages that arrive in it
        self.messages: list[tuple[str, str | None, int]] = []  # see `columns.Turn`

    def list_present(self) -> Iterator[tuple[str, str, str, str | None]]:
        """Yield all current facts: agent, heading, key, text."""
        for known in (self._known, self._momentary):
            for name, facts in known.items():
                yield from ((name, *key, words) for key, words in facts.items())

    def list_changes(self, log: Log | None, turn: int) -> Iterator[tuple[str, str, str, str | None]]:
        """Yield the changed facts: agent, heading, key, and the new text, or None if the fact no longer holds.

        Args:
            log: the log of the turn that was applied to the state; None: any fact may have changed.
            turn: the turn number of the game.
        """
        for name in self._find_changed_agents(log):
            now = self._list_facts(self._state.agents.find_row(name))
            yield from _list_differences(name, self._known.get(name, {}), now)
            self._known[name] = now
        momentary = self._list_facts_of_turn(log or [], turn)
        for name in {**self._momentary, **momentary}:
            yield from _list_differences(name, self._momentary.get(name, {}), momentary.get(name, {}))
        self._momentary = momentary

    def _find_changed_agents(self, log: Log | None) -> list[str]:
        """Return the agents whose lasting facts may have changed."""
        names = self._state.agents.columns["names"]
        events = [] if log is None else list(list_events(log))
        wanted: set[str] = set()
        if log is None or any(kind in _OF_ALL for kind, _ in events):
            self._known = {name: self._known[name] for name in names if name in self._known}
            return list(names)
        for kind, data in events:
            if kind in _OF_ONE:
                wanted.add(data["agent_name"])
            elif kind == kinds.GAME_MEMORY:
                wanted.update(data["agents"])
                teams = [team for team, _ in data["teams"]]
                own = zip(names, self._state.agents.columns["teams"], strict=True)
                wanted.update(name for name, team in own if team in teams)
        return [name for name in names if name in wanted] if wanted else []

    def _list_facts(self, row: int) -> Facts:
        """Return the lasting facts about the agent in a row: team, speed, strategy, sensors, memories, attributes."""
        columns = self._state.agents.columns
        game = self._state.game
        name = columns["names"][row]
        team = columns["teams"][row]
        facts: Facts = {}
        strategy = columns["strategies"][row]
        if isinstance(strategy, str):
            strategy = strategy.partition(".<locals>")[0]  # the function that made it
        for key, value in (("team", team), ("speed", columns["speed"][row]), ("strategy", strategy)):
            if value is not None:
                facts[_OPEN, key] = format_words(value)
        for sensor, sensor_id in columns["sensors"][row].items():
            facts["Sensors", as_text(sensor)] = as_text(self._state.sensors.get(sensor_id, {}).get("type", ""))
        memories: dict[str, Any] = {"Memory": game.memories.get(name)}
        memories["Memory of the team"] = None if team is None else game.team_memories.get(team)
        numbers = {one.name: columns[one.name][row].item() for one in RECORDED_NUMBERS}
        memories["Attributes"] = {**numbers, **columns["attributes"][row]}
        for heading, values in memories.items():
            if isinstance(values, Mapping):
                pairs = list(values.items())[:_MOST_ROWS]
                facts.update(((heading, as_text(key)), format_words(value)) for key, value in pairs)
        return facts

    # -- of one turn --------------------------------------------------------------------------------------------

    def _list_facts_of_turn(self, log: Log, turn: int) -> dict[str, Facts]:
        """Return agent -> facts about this turn: deeds, refused actions and messages."""
        found: dict[str, Facts] = {}
        self.messages = []
        for kind, data in list_events(log):
            if kind == kinds.GAME_DEED:
                rest = {key: value for key, value in data.items() if key not in ("turn", "agent")}
                _put(found, data["agent"], _DECISION, "deed", format_words(rest))
            elif kind == kinds.GAME_MESSAGE:
                self._send(data, found)
        for name, why in dict(self._state.game.blocked).items():
            _put(found, name, _DECISION, "blocked", format_words(why))
        for sender, receiver, fate, key, body in self._sent.pop(turn + 1, ()):
            self.messages.append((sender, receiver, fate))
            _put(found, receiver, _MESSAGES, key, body)
        self._sent = {when: sent for when, sent in self._sent.items() if when > turn}
        return found

    def _send(self, message: Mapping[str, Any], found: dict[str, Facts]) -> None:
        """Add the facts about a message that was sent: to its sender now, and to its receivers on arrival."""
        sender = message["sender"]
        body = format_words(message["body"], _MOST_BODY)
        fates = {key: list(message.get(key) or ()) for key in (*ARRIVALS, "lost", "jammed")}
        fate = "; ".join(f"{key} by {', '.join(map(as_text, to[:6]))}" for key, to in fates.items() if to)
        words = f"{body} ({fate})" if fate else body
        _put(found, sender, _MESSAGES, f"to {format_words(message.get('to'))}", words)
        for number, key in enumerate(ARRIVALS):
            for receiver, when in dict(message.get(key) or {}).items():
                self._sent.setdefault(when, []).append((sender, receiver, number, f"{key} from {sender}", body))
        lost = [*fates["lost"], *fates["jammed"]]
        self.messages += [(sender, receiver, LOST) for receiver in lost]
        if not any(fates.values()):
            self.messages.append((sender, None, UNHEARD))


def _put(found: dict[str, Facts], name: str, heading: str, key: str, words: str) -> None:
    """Add a fact; texts of equal keys are joined."""
    facts = found.setdefault(name, {})
    known = facts.get((heading, key))
    facts[heading, key] = words if known is None else f"{known}; {words}"[:_MOST_WORDS]


def _list_differences(name: str, before: Facts, now: Facts) -> Iterable[tuple[str, str, str, str | None]]:
    """Yield new and changed facts, then removed ones with None as text."""
    for key, words in now.items():
        if before.get(key) != words:
            yield name, *key, words
    yield from ((name, *key, None) for key in before if key not in now)
