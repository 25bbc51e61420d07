"""The events of a recording as dicts, and as tables with the columns of a `Result`."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from gamms.arguments import as_name
from gamms.errors import UnknownName
from gamms.ir import events as kinds
from gamms.ir.events import EVENTS, as_entry, list_steps
from gamms.ir.game_state import as_named_edges
from gamms.ir.graph import GraphColumns, IntArray
from gamms.ir.messages import MESSAGE_COLUMNS, make_message_table
from gamms.ir.schema import ON_EDGES
from gamms.ir.tables import make_table
from gamms.knowledge.looks import decode_looks, list_seen
from gamms.plain import Plain
from gamms.recorder import keyframes
from gamms.recorder.errors import DAMAGES, RecordingError, report_damage
from gamms.recorder.formats.chunks import FORMS
from gamms.recorder.formats.reader import Reader
from gamms.text import reason, shown

Table = dict[str, np.ndarray[Any, Any]]
NamesAt = Callable[[int], tuple[dict[int, str], int]]
"""Function from a log number to (number -> name of the agents at its beginning, number of the next agent)."""

KINDS = {code: kind.name for code, kind in EVENTS.items()} | {
    kinds.MOVES: "MOVE",
    kinds.AERIAL_AGENT_FLIGHT: "AERIAL_AGENT_POSITION",  # the same by number
    kinds.AERIAL_AGENT_TURN: "AERIAL_AGENT_QUATERNION",
}
"""Event code -> name in steps and tables."""

_LONG_NAME = 64  # characters; arrays of texts have room for the longest in each row
_MOST_CHARACTERS = 1 << 18

_ROSTER = {kinds.AGENT_CREATE, kinds.SNAPSHOT}
_FLIGHTS = {kinds.AERIAL_AGENT_FLIGHT, kinds.AERIAL_AGENT_POSITION}
_EMITTED = {kinds.GAME_EVENT, kinds.USER_EVENT}
_EVENTS: dict[str, type] = {"turn": np.int64, "kind": np.str_}
_POSITIONS: dict[str, type] = {"turn": np.int64, "agent": np.str_, **dict.fromkeys("xyz", np.float64)}
_SCORES: dict[str, type] = {"turn": np.int64, "of": np.str_, "score": np.float64}
_DEEDS: dict[str, type] = {"turn": np.int64, "agent": np.str_, "deed": np.str_, "at": np.int64}
_MESSAGES: dict[str, type] = {name: np.int64 if name in ("turn", "size") else object for name in MESSAGE_COLUMNS}
_EDGES: dict[str, type] = {"turn": np.int64, "agent": np.str_, "edge": np.int64}
_TRAVEL: dict[str, type] = {
    "turn": np.int64,
    "agent": np.str_,
    "edge_source": np.int64,
    "edge_target": np.int64,
    "edge": np.int64,
    "edge_share": np.float64,
}
_SENSED: dict[str, type] = {"turn": np.int64, "agent": np.str_, "sensor": np.str_, "node": np.int64, "other": np.str_}


def read_events(reader: Reader, start: int, stop: int) -> Iterator[dict[str, Any]]:
    """Yield events emitted by rules or recorded by programs, in these logs."""
    for log, _, _, data in reader.events(start, stop, _EMITTED):
        if not (isinstance(data, dict) and isinstance(data.get("kind"), str)):
            raise RecordingError(f"An event of turn {log + 1} has no kind: {shown(data)}.")
        yield {"turn": log + 1, **data}


def read_steps(reader: Reader, start: int, stop: int, names_at: NamesAt) -> Iterator[dict[str, Any]]:
    """Yield all events in these logs: `turn`, `event`, and for a move `agent` and `node`, else `data`."""
    names, following = names_at(start)
    for log in range(start, stop):
        for kind, data in list_steps(reader.log(log)):
            if kind == kinds.MOVES:
                yield {"turn": log + 1, "event": "MOVE", "agent": _find_name(names, data[0], log), "node": data[1]}
                continue
            if kind in _ROSTER:
                names, following = _update_roster(kind, data, names, following)
            named = _name_agent(kind, data, _find_name(names, data[0], log)) if kind in FORMS else data
            yield {"turn": log + 1, "event": KINDS.get(kind, f"{kind:#010x}"), "data": named}


def _name_agent(kind: int, data: tuple[Plain, ...], name: str) -> dict[str, Any]:
    """Return the data of an event with the name of its agent instead of its number."""
    if kind == kinds.AERIAL_AGENT_FLIGHT:
        return {"agent_name": name, "position": list(data[2:]), "node": data[1]}
    return {"agent_name": name, "quat": list(data[1:])}


def _find_name(names: dict[int, str], number: int, log: int) -> str:
    if number not in names:
        raise RecordingError(f"Agent number {number} moves in turn {log + 1}, but does not exist.")
    return names[number]


def _update_roster(
    kind: int, data: Mapping[str, Plain], names: dict[int, str], following: int
) -> tuple[dict[int, str], int]:
    """Return the names of agents by number, and the next number, after a creation or a snapshot."""
    with report_damage(f"An event of kind {KINDS[kind]} is damaged", DAMAGES, with_type=True):
        if kind == kinds.SNAPSHOT:
            numbers = data["numbers"].tolist()
            return dict(zip(numbers, data["names"], strict=True)), keyframes.check_following(numbers, data["next"])
        names[following] = data["name"]  # in place, because a thousand agents may be created one by one
    return names, following + 1


def _read_with_names(
    reader: Reader, start: int, stop: int, names_at: NamesAt, of: set[int]
) -> Iterator[tuple[int, int, Any, dict[int, str]]]:
    """Yield the events of some kinds in these logs: log, kind, data, and number -> name of the agents at that time."""
    names, following = names_at(start)
    for log, _, kind, data in reader.events(start, stop, of | _ROSTER):
        if kind in of:
            yield log, kind, data, names
        else:
            names, following = _update_roster(kind, data, names, following)


def read_table(
    reader: Reader, name: str, start: int, stop: int, names_at: NamesAt, get_map: Callable[[], GraphColumns]
) -> Table:
    """Return a table of these logs.

    Args:
        reader: reader of the recording.
        name: name of the table.
        start: first log.
        stop: log after the last one.
        names_at: see `NamesAt`.
        get_map: returns the first map of the recording.

    Raises:
        UnknownName (KeyError): the table does not exist.
    """
    if as_name(name, "a table") in _NAMES:
        with report_damage(
            f"The table {shown(name)} cannot be made: an event in it is damaged", DAMAGES, with_type=True
        ):
            if name == "sensed":
                return _read_sensed(reader, start, stop, names_at, get_map)
            return _TABLES[name](reader, start, stop, names_at)
    rows = [event for event in read_events(reader, start, stop) if event["kind"] == name]
    if not rows:
        known = {event["kind"] for event in read_events(reader, 0, reader.turns)}
        if name not in known:
            raise UnknownName("table", name, [*_NAMES, *sorted(known)])
        return _make_table({"turn": np.int64}, [])
    return make_table([{key: value for key, value in row.items() if key != "kind"} for row in rows])


def _read_events(reader: Reader, start: int, stop: int, _names_at: NamesAt) -> Table:
    return _make_table(_EVENTS, [(event["turn"], event["kind"]) for event in read_events(reader, start, stop)])


def _read_moves(reader: Reader, start: int, stop: int, names_at: NamesAt) -> Table:
    """Return all moves of agents on the ground: turn, agent, node."""
    turns, numbers, nodes = reader.moves(start, stop)
    places = turns.searchsorted(np.arange(start, stop))
    roster = list(reader.events(start, stop, _ROSTER))
    before = [int(places[log - start]) + place for log, place, _, _ in roster]
    names = _find_names(numbers, before, [(kind, data) for _, _, kind, data in roster], names_at(start))
    return {"turn": turns + 1, "agent": names, "node": nodes.copy()}


def _find_names(
    numbers: IntArray, before: list[int], roster: list[tuple[int, Any]], known: tuple[dict[int, str], int]
) -> np.ndarray[Any, Any]:
    """Return the names of agents by number; `before` numbers come before each event of the roster."""
    parts = []
    done = 0
    names, following = known
    for until, (kind, data) in zip(before, roster, strict=True):
        if kind == kinds.SNAPSHOT:
            parts.append(_replace_numbers(numbers[done:until], names))
            done = until
        names, following = _update_roster(kind, data, names, following)
    parts.append(_replace_numbers(numbers[done:], names))
    return np.concatenate(parts)


def _replace_numbers(numbers: IntArray, known: dict[int, str]) -> np.ndarray[Any, Any]:
    if not len(numbers):
        return np.zeros(0, np.str_)
    distinct, places = np.unique(numbers, return_inverse=True)
    try:
        names = [known[number] for number in distinct.tolist()]
    except KeyError as error:
        raise RecordingError(f"Agent number {reason(error)} moves, but does not exist.") from error
    is_long = max(map(len, names)) > max(_LONG_NAME, _MOST_CHARACTERS // len(numbers))
    return np.array(names, object if is_long else np.str_)[places]


def _read_positions(reader: Reader, start: int, stop: int, names_at: NamesAt) -> Table:
    """Return all moves of flying agents: turn, agent, position."""
    rows: list[tuple[Any, ...]] = []
    for log, kind, data, names in _read_with_names(reader, start, stop, names_at, _FLIGHTS):
        if kind == kinds.AERIAL_AGENT_FLIGHT:
            rows.append((log + 1, _find_name(names, data[0], log), *data[2:]))
        else:
            rows.append((log + 1, data["agent_name"], *data["position"]))
    return _make_table(_POSITIONS, rows)


def _read_travel(reader: Reader, start: int, stop: int, names_at: NamesAt) -> Table:
    """Return the progress of agents after each change: turn, agent, edge, and share."""
    rows: list[tuple[Any, ...]] = []
    for log, _, data, names in _read_with_names(reader, start, stop, names_at, {kinds.AGENT_PROGRESS}):
        columns = [np.asarray(data[name]).tolist() for name in ("numbers", *ON_EDGES) if name in data]
        for number, source, target, share, *place in zip(*columns, strict=True):
            if place and place[1]:
                rows.append((log + 1, _find_name(names, number, log), source, target, place[0], share))
    return _make_table(_TRAVEL, rows)


def _read_edges(reader: Reader, start: int, stop: int, _names_at: NamesAt) -> Table:
    """Return the edges that actions have named and agents have taken: turn, agent, edge."""
    rows: list[tuple[Any, ...]] = []
    for log, _, _, data in reader.events(start, stop, {kinds.GAME_NAMED_EDGES}):
        rows += [(log + 1, name, edge) for name, (_, edge) in as_named_edges(data["named_edges"]).items()]
    return _make_table(_EDGES, rows)


def _read_scores(reader: Reader, start: int, stop: int, _names_at: NamesAt) -> Table:
    """Return all scores of each turn in which a score changed."""
    found: dict[int, Any] = {}  # the last value of each turn
    for log, _, _, data in reader.events(start, stop, {kinds.GAME_SCORES, kinds.SNAPSHOT}):
        found[log + 1] = data["scores"]
    rows: list[tuple[Any, ...]] = []
    for turn, scores in found.items():
        rows += [(turn, of, score) for of, score in scores]
    return _make_table(_SCORES, rows)


def _read_deeds(reader: Reader, start: int, stop: int, _names_at: NamesAt) -> Table:
    """Return all deeds of agents: turn, agent, deed, node, and fields."""
    rows = [data for *_, data in reader.events(start, stop, {kinds.GAME_DEED})]
    return make_table([dict(row) for row in rows]) if rows else _make_table(_DEEDS, [])


def _read_messages(reader: Reader, start: int, stop: int, _names_at: NamesAt) -> Table:
    """Return all messages: one row per message and receiver; see `ir.messages`."""
    sent = [as_entry("messages", data) for *_, data in reader.events(start, stop, {kinds.GAME_MESSAGE})]
    return make_table(make_message_table(sent)) if sent else _make_table(_MESSAGES, [])


def _read_sensed(
    reader: Reader, start: int, stop: int, names_at: NamesAt, get_map: Callable[[], GraphColumns]
) -> Table:
    """Return all nodes seen by sensors: turn, agent, sensor, node, and the agent there if it was seen."""
    rows: list[tuple[Any, ...]] = []
    for log, _, data, names in _read_with_names(reader, start, stop, names_at, {kinds.SENSED}):
        for number, look in decode_looks(data, get_map=get_map):
            for node, other in zip(*list_seen(look), strict=True):
                rows.append((log + 1, names[number], look.sensor, node, "" if other < 0 else names[other]))
    return _make_table(_SENSED, rows)


def _make_table(dtypes: Mapping[str, type], rows: list[tuple[Any, ...]]) -> Table:
    """Return rows as columns, with these types if there are no rows."""
    if not rows:
        return {name: np.zeros(0, dtype) for name, dtype in dtypes.items()}
    return make_table(dict(zip(dtypes, zip(*rows, strict=True), strict=True)))


_TABLES: dict[str, Callable[[Reader, int, int, NamesAt], Table]] = {
    "deeds": _read_deeds,
    "edges": _read_edges,
    "events": _read_events,
    "messages": _read_messages,
    "moves": _read_moves,
    "positions": _read_positions,
    "scores": _read_scores,
    "travel": _read_travel,
}
_NAMES = sorted((*_TABLES, "sensed"))
