"""The state of a game, except for the agents and the world."""

from collections.abc import Container, Hashable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields
from itertools import chain
from math import inf
from numbers import Real
from operator import attrgetter
from sys import float_info
from types import NoneType
from typing import Any, Self, TypeGuard, cast

from gamms.core.copies import (
    ONLY_PLAIN,
    copy_deep,
    copy_dict,
    copy_each,
    copy_fields,
    copy_filled,
    copy_items,
    refill,
    refill_counts,
    refill_each,
    restore_fields,
)
from gamms.errors import BadType, BadValue
from gamms.ir.deeds import DeedLog, DoneDeeds
from gamms.ir.schema import Audience, ChangeEvent, GameField, Memo, game_field
from gamms.plain import MOST_WHOLE, Plain, select_plain, to_plain
from gamms.readonly import make_shareable
from gamms.text import as_text, shown

PHASES = ("decide", "resolve", "apply", "rules", "draw")
KEPT = "array functions"
"""The key of `data` for the arrays of array functions in a single game."""
READ = "events"
"""With the name of a reader, the key of the numbers of events that it has read, among the arrays of array functions."""

LOGS = ("events", "errors", "deeds", "messages")
"""The append-only fields of a state."""

_HISTORY = (
    *("turn", "over", "last_turn", "moves", "counts", "team_memories", "departed", "blocked", "delayed_looks"),
    *(*LOGS, "marked", "named_edges", "timings", "driven", "collected"),
)


_LARGEST = float_info.max

_Given = Mapping[Any, float] | Iterable[tuple[Any, float]]


class Scores(dict[Any, float]):
    """Scores by team, agent or any other key; missing keys have the score 0.

    Raises:
        BadType: a new score is not a number, or NaN.
        BadValue: a new score does not fit into a float.
    """

    def __init__(self, scores: _Given = (), /, **named: float) -> None:
        super().__init__()
        self.update(scores, **named)

    def __missing__(self, key: object) -> float:
        return 0

    def __setitem__(self, key: Hashable, score: object) -> None:
        _refuse_no_score(key, score)
        super().__setitem__(key, cast("float", score))

    def update(self, scores: _Given = (), /, **named: float) -> None:  # type: ignore[override] # as that of a dict
        """Update scores like a dict; on an error nothing is set."""
        given = {**dict(scores), **named}
        for key, score in given.items():
            _refuse_no_score(key, score)
        super().update(given)

    def __ior__(self, scores: _Given) -> Self:  # type: ignore[override,misc] # as `update`
        self.update(scores)
        return self

    def setdefault(self, key: Hashable, score: object = 0) -> float:
        """Return the score of a key; set it first if it is missing."""
        if key not in self:
            self[key] = score
        return self[key]


def _refuse_no_score(key: Hashable, score: object) -> None:
    if type(score) is not int and not (isinstance(score, Real) and score == score):  # noqa: PLR0124 - NaN does not
        raise BadType(f"The score of {shown(key)} must be a number, not {shown(score)} ({type(score).__name__}).")
    number = cast("float", score)
    if not -_LARGEST <= number <= _LARGEST and number not in (inf, -inf):
        raise BadValue(f"The score of {shown(key)} must fit into a float, not {shown(score)}.")


LogMarks = tuple[Sequence[list[Any]], Sequence[int], list[DoneDeeds]]
"""A marker of logs at a moment: their lists, which may grow later, their lengths, and the deeds of the last turn."""


def cut_log(log: list[Any], entries: list[Any], length: int, marked: int) -> list[Any]:
    """Return a log as it was at a moment, as a list that may be appended to.

    Args:
        log: the present list.
        entries: the list at that moment.
        length: its length at that moment.
        marked: number of entries of the present list that other markers need.
    """
    if log is entries and marked <= length:
        del entries[length:]
    return entries if len(entries) == length else entries[:length]


def join_ends(known: dict[str, Any] | None, new: dict[str, Any]) -> dict[str, Any]:
    """Return the end of a game that two rules end in the same turn.

    An end by events overrides an end by time; reasons are sorted alphabetically, and a team wins only if both agree.
    """
    if known is None or (known["truncated"] and not new["truncated"]):
        return new
    if new["truncated"] and not known["truncated"]:
        return known
    reasons = {*known["reason"].split("; "), *new["reason"].split("; ")}
    winner = new["winner"] if new["winner"] == known["winner"] else None
    return {**new, "reason": "; ".join(sorted(reasons)), "winner": winner}


class BlockedAgents(MutableMapping[str, str]):
    """Agent -> reason why its last action was not performed.

    Conflicts are stored as indices and places, and converted to texts on access.

    Args:
        known: initial reasons.
    """

    def __init__(self, known: Mapping[str, str] | None = None) -> None:
        self.known = dict(known or {})
        self.stopped: list[tuple[Sequence[str], Sequence[int], Sequence[object]]] = []

    def __getitem__(self, name: str) -> str:
        return self._write_names()[name]

    def __setitem__(self, name: str, why: str) -> None:
        self._write_names()[name] = why

    def __delitem__(self, name: str) -> None:
        del self._write_names()[name]

    def get(self, name: str, default: Any = None) -> Any:
        """Return the reason of an agent, or the default."""
        return self._write_names().get(name, default)  # NOTE: without an exception, for each agent (benchmarks: turns)

    def __iter__(self) -> Iterator[str]:
        return iter(self._write_names())

    def __len__(self) -> int:
        return len(self._write_names())

    def __bool__(self) -> bool:
        """Return whether any agent was blocked, without writing out conflicts."""
        return bool(self.known or self.stopped)

    def add(self, name: str, why: str) -> str:
        """Add a reason to those known already; return the complete reason."""
        known = self._write_names() if self.stopped else self.known
        all_known = f"{known[name]}; {why}" if name in known else why
        known[name] = all_known
        return all_known

    def add_conflicts(self, names: Sequence[str], stopped: Sequence[int], places: Sequence[object]) -> None:
        """Add conflicts: the indices of agents in `names`, and the nodes or edges that they wanted to reach."""
        self.stopped.append((names, stopped, places))

    def drop_conflicts(self, names: Sequence[str], takes_part: Sequence[int] | None) -> None:
        """Drop conflicts that were not written out, of agents that take part in a turn.

        Args:
            names: the list of the names of all agents, as in `add_conflicts`.
            takes_part: (agents,) whether each takes part; None: all do.
        """
        left = []
        for known, agents, places in self.stopped:
            if known is not names:
                left.append((known, agents, places))
            elif takes_part is not None:
                rest = [(i, place) for i, place in zip(agents, places, strict=True) if not takes_part[i]]
                if rest:
                    left.append((known, [i for i, _ in rest], [place for _, place in rest]))
        self.stopped = left

    def copy_blocked(self) -> "BlockedAgents":
        """Return a copy, in which reasons that were not yet worked out are left so."""
        twin = BlockedAgents(self.known)
        twin.stopped = [*self.stopped]
        return twin

    def _write_names(self) -> dict[str, str]:
        if self.stopped:
            stopped = self.stopped
            self.stopped = []
            for names, agents, places in stopped:
                for i, end in zip(agents, places, strict=True):
                    self.add(names[i], describe_conflict(end))
        return self.known


def is_of_reader(key: object) -> bool:
    """Return whether arrays with this key are the numbers of events that an array function has read."""
    return isinstance(key, tuple) and key[:1] == (READ,)


def describe_conflict(end: object) -> str:
    """Return the reason of an agent that a conflict has stopped on its way to a node or edge."""
    where = f"node {end}" if isinstance(end, int) else str(end)
    return f"in conflict with other agents on the way to {where}"


def _return_value(value: object, _: Memo | None) -> object:
    return value


def _capture_each(memories: dict[Any, dict[Any, Any]]) -> list[tuple[Any, dict[Any, Any]]]:
    return [(to_plain(name), select_plain(memory)) for name, memory in memories.items() if memory]


def _restore_private_facts(each: Iterable[tuple[Any, dict[str, Any]]]) -> dict[Any, dict[str, Any]]:
    return {to: {name: make_shareable(name, value) for name, value in facts.items()} for to, facts in each}


_FACTS = (copy_each, _capture_each, _restore_private_facts)


def as_scores(scores: Plain) -> Scores:
    """Return checked scores.

    Raises:
        BadValue: the scores are invalid.
    """
    try:
        return Scores(scores)
    except (TypeError, ValueError) as error:
        raise BadValue(f"its scores are invalid ({error})") from error


def as_turn(turn: Plain) -> int:
    """Return a checked number of turns.

    Raises:
        BadValue: it is not an integer, negative or too large.
    """
    if type(turn) is not int or not 0 <= turn <= MOST_WHOLE:
        raise BadValue(f"The number of turns must be an integer from 0 to {MOST_WHOLE}, not {shown(turn)}.")
    return turn


_OVER = {"reason", "winner", "truncated"}


def as_over(value: object) -> dict[str, Any] | None:
    """Return the checked end of a game; None while it continues.

    Raises:
        BadValue: the value does not describe an end.
    """
    if value is not None and (not isinstance(value, Mapping) or set(value) != _OVER):
        raise BadValue(f"The end of a game has the keys {sorted(_OVER)}, not {shown(value)}.")
    return None if value is None else dict(value)


def as_blocked(value: object) -> BlockedAgents:
    """Return checked reasons: agent -> why its action was not performed.

    Raises:
        BadType: the value is not such a mapping.
    """
    if not isinstance(value, Mapping) or not all(isinstance(text, str) for text in chain.from_iterable(value.items())):
        raise BadType(f"Blocked agents must be a dict of texts, not {shown(value)}.")
    return BlockedAgents(value)


def as_named_edges(value: object) -> dict[str, tuple[int, int]]:
    """Return checked edges that actions have named: agent -> the number of the turn, and the id of the edge.

    Raises:
        BadType: the value is not such a mapping.
    """
    pairs = value.items() if isinstance(value, Mapping) else [(None, ())]
    found = {name: tuple(pair) if isinstance(pair, tuple | list) else () for name, pair in pairs}
    if not all(isinstance(name, str) and [*map(_is_id, pair)] == [True, True] for name, pair in found.items()):
        raise BadType(f"The named edges must be a dict of pairs of a turn and an edge, not {shown(value)}.")
    return cast("dict[str, tuple[int, int]]", found)


def as_driven(value: object) -> dict[str, tuple[int, ...]]:
    """Return checked edges that agents have moved along: agent -> ids.

    Raises:
        BadType: the value is not such a mapping.
    """
    each = value.items() if isinstance(value, Mapping) else [(None, ())]
    found = {name: tuple(edges) if isinstance(edges, tuple | list) else (None,) for name, edges in each}
    if not all(isinstance(name, str) and all(map(_is_id, edges)) for name, edges in found.items()):
        raise BadType(f"The edges that agents have moved along must be lists of ids by name, not {shown(value)}.")
    return cast("dict[str, tuple[int, ...]]", found)


CollectedNumbers = float | dict[str, float]
"""The last number of a collector, or of each agent."""


def as_collected(value: object) -> dict[str, CollectedNumbers]:
    """Return checked numbers of collectors: name -> a number, or numbers by agent.

    Raises:
        BadType: the value is not such a mapping.
    """
    known = value if isinstance(value, Mapping) else {None: value}
    each = {name: one if isinstance(one, Mapping) else {name: one} for name, one in known.items()}
    if not all(
        isinstance(name, str) and all(isinstance(key, str) and is_shown_number(one) for key, one in numbers.items())
        for name, numbers in each.items()
    ):
        raise BadType(f"Collected numbers must be a dict of numbers, or of numbers by agent, not {shown(value)}.")
    return cast("dict[str, CollectedNumbers]", deepcopy(dict(known)))


def is_shown_number(value: object) -> TypeGuard[float]:
    """Return whether a collected value can be shown in a chart: an int or a finite float, and not too large."""
    return type(value) in (int, float) and -_LARGEST_SHOWN < cast("float", value) < _LARGEST_SHOWN


_LARGEST_SHOWN = 1e300  # differences of two numbers fit into a float


def _is_id(value: object) -> bool:
    return type(value) is int and -(1 << 63) <= value < 1 << 63


def as_looks(value: object) -> dict[int, dict[str, Any]]:
    """Return checked pending reports of a sensor: turn -> data by agent name.

    Raises:
        BadType: the value is not such a mapping.
    """
    looks = value.items() if isinstance(value, Mapping) else [(None, None)]
    if not all(
        type(turn) is int and isinstance(seen, dict) and all(isinstance(name, str) for name in seen)
        for turn, seen in looks
    ):
        raise BadType(f"The pending reports of a sensor must be a dict by turn, not {shown(value)}.")
    return dict(looks)


@dataclass(eq=False, slots=True)
class GameState:
    """The state of a game: plain values that the turn engine, rules and the recorder read and write.

    Each field is declared once: snapshots, forks, keyframes and the knowledge of teams are derived from the
    declarations (`FIELDS`). Keyframes store the fields in this order.

    Attributes:
        scores: numbers by any key; this dict object is never replaced.
        data: plain values stored by rules.
        over: reason, winner and truncated of a finished game; None while it continues.
        turn: number of turns played.
        events: emitted events in order, append-only: dicts with `turn` and `kind`.
        errors: errors of strategies in order, append-only.
        deed_log: the deeds of agents; `deeds` is its list of entries.
        row: the number of the game in `deed_log`.
        unlogged: the messages that are sent and not in their log yet: `write` adds them to it, and `drop` drops them;
            None: all are in the log. Any: the game has its own class.
        under_way: the messages that agents will hear; replaced, never mutated. Any: the game has its own class.
        messages: messages sent on channels, with receivers and arrival turns, in order, append-only: see `ir.messages`.
        blocked: agent -> reason why its last action was not performed; only for blocked agents.
        named_edges: agent -> the number of a turn, and the id of the edge that its action has named and that it has
            taken in this turn, or that an agent that obeys turn restrictions has taken: of the last turn in which any
            agent has; replaced, never mutated.
        driven: agent that obeys turn restrictions -> the ids of the last edges that it moved along, as many as matter
            for the next turn, the latest last; they count while the agent is at the end of the last one.
        collected: name of a collector -> its last number, or agent -> its last number; replaced, never mutated.
        facts: published facts, read-only values; this dict object is never replaced.
        agent_facts: agent -> facts published only to it.
        team_facts: team -> facts published only to it.
        memories: agent -> its memory; this dict object and the memories are never replaced.
        team_memories: team -> its memory.
        delayed_looks: (sensor, name of its agent or "") -> turn -> data of that turn, to be reported later.
        counts: agent -> numbers of its moves, blocked moves, and so on.
        timings: seconds by phase.
        moves: moves of the last turn; None before the first turn. Any: the turn engine has its own class.
        departed: agent -> its team and node at deletion, for agents deleted during the game.
        last_turn: the turn after which the present `run` stops; None: no limit.
        began: agent -> its start, if it was created while the game was played, or the game was resumed or copied.
        start: the snapshot to which `reset` returns; None before the first turn. Any: it contains data of all engines.
        drawn: data drawn by a scenario from the seed of the start; replaced, never mutated. Any: form of the builder.
        parts_played: number of parts of the present turn that have moved, in a fork for agents that decide in it; None:
            between two turns.
        has_begun: whether a turn was played since the game was created, reset or resumed.
        stream_version: changes when counts and memories are replaced and all random streams restart.
        marked: for each log, the number of entries that snapshots need.
    """

    scores: Scores = game_field(
        Scores,
        copy_dict,
        refill=refill,
        captured=lambda scores: list(to_plain(scores).items()),
        restored=as_scores,
        axis="game",
        event=ChangeEvent(0x04000000, "GAME_SCORES", Audience.ALL, "scores"),
    )
    data: dict[str, Any] = game_field(dict, copy_items, refill=refill, captured=select_plain)
    over: dict[str, Any] | None = game_field(NoneType, copy_deep, captured=to_plain, restored=as_over, axis="game")
    turn: int = game_field(int, _return_value, captured=to_plain, restored=as_turn, axis="game")
    events: list[dict[str, Any]] = game_field(list)
    errors: list[dict[str, Any]] = game_field(list)
    deed_log: DeedLog = game_field(DeedLog)
    row: int = game_field(int)
    under_way: Any = game_field(NoneType, _return_value)
    unlogged: Any = game_field(NoneType, is_own=True)
    messages: list[dict[str, Any]] = game_field(list)
    blocked: BlockedAgents = game_field(
        BlockedAgents,
        lambda value, _: BlockedAgents(value),
        captured=to_plain,
        restored=as_blocked,
        is_seldom=True,
        axis="agent",
        event=ChangeEvent(0x04000009, "GAME_BLOCKED", Audience.ALL, "blocked"),
    )
    named_edges: dict[str, tuple[int, int]] = game_field(
        dict,
        _return_value,
        captured=to_plain,
        restored=as_named_edges,
        is_seldom=True,
        axis="agent",
        event=ChangeEvent(0x0400000C, "GAME_NAMED_EDGES", Audience.TEAM, "named_edges"),
    )
    driven: dict[str, tuple[int, ...]] = game_field(
        dict,
        copy_dict,
        captured=to_plain,
        restored=as_driven,
        is_seldom=True,
        axis="agent",
        event=ChangeEvent(0x0400000D, "GAME_DRIVEN", Audience.TEAM, "driven"),
    )
    collected: dict[str, CollectedNumbers] = game_field(
        dict,
        _return_value,
        captured=to_plain,
        restored=as_collected,
        is_seldom=True,
        event=ChangeEvent(0x0400000E, "GAME_COLLECTED", Audience.HOST, "collected"),
    )
    facts: dict[str, Any] = game_field(dict, copy_dict, refill=refill, axis="game")
    agent_facts: dict[str, dict[str, Any]] = game_field(dict, *_FACTS, is_seldom=True, axis="agent")
    team_facts: dict[Any, dict[str, Any]] = game_field(dict, *_FACTS, is_seldom=True, axis="team")
    memories: dict[str, dict[Any, Any]] = game_field(
        dict,
        copy_filled,
        refill=refill_each,
        captured=lambda memories: dict(sorted(_capture_each(memories))),
        restored=lambda memories: copy_each(deepcopy(memories)),
        axis="agent",
    )
    team_memories: dict[Any, dict[Any, Any]] = game_field(
        dict,
        copy_deep,
        captured=_capture_each,
        restored=lambda each: dict(deepcopy(list(each))),
        axis="team",
    )
    delayed_looks: dict[tuple[str, str], dict[int, dict[str, Any]]] = game_field(
        dict,
        copy_each,
        captured=lambda looks: [[*key, to_plain(one)] for key, one in sorted(looks.items()) if one],
        restored=lambda each: {(sensor, owner): as_looks(deepcopy(one)) for sensor, owner, one in each},
        is_seldom=True,
    )
    counts: dict[str, dict[str, int]] = game_field(dict, copy_each, refill=refill_counts, axis="agent")
    timings: dict[str, float] = game_field(lambda: dict.fromkeys(PHASES, 0.0), copy_dict, refill=refill)
    moves: Any = game_field(NoneType, _return_value, is_own=True)
    departed: dict[str, tuple[Any, int]] = game_field(dict, copy_dict)
    last_turn: int | None = game_field(NoneType, _return_value, axis="game")
    began: dict[str, Any] = game_field(dict, copy_dict, is_own=True)
    start: Any = game_field(NoneType, _return_value, is_own=True)
    drawn: Any = game_field(NoneType, _return_value, is_own=True)
    parts_played: int | None = game_field(NoneType, _return_value)
    has_begun: bool = game_field(bool, _return_value, is_own=True)
    stream_version: int = game_field(int)
    marked: Sequence[int] = game_field(lambda: (0,) * len(LOGS))

    @property
    def deeds(self) -> list[dict[str, Any]]:
        """Deeds of agents in order, append-only: dicts with `turn`, `agent`, `deed`, `at`."""
        return self.deed_log.list_entries(self.row)

    @deeds.setter
    def deeds(self, entries: list[dict[str, Any]]) -> None:
        self.deed_log.put(self.row, entries)

    def put(self, name: str, value: object) -> None:
        """Set a field, in place if other objects refer to its value."""
        refill = FIELDS[name].refill
        if refill is None:
            setattr(self, name, value)
        else:
            refill(getattr(self, name), value)

    def put_known(self, source: "GameState", agents: Container[str], teams: Container[Any]) -> None:
        """Copy the knowledge of agents, and of their teams, from another game, for fields that agents know partly."""
        for name, one in FIELDS.items():
            if one.axis is not None:
                self.put(name, one.copy_for(getattr(source, name), agents, teams))

    def list_values(self) -> list[Any]:
        """Return the present values of the fields `SAVED` in order, which may change later."""
        return [*_saved_of(self)]

    def copy_values(self, memo: Memo | None = None) -> list[Any]:
        """Return the values for snapshots, of the fields `SAVED` in order; None for an empty dict.

        Args:
            memo: see `core.copies.copy_deep`.
        """
        return copy_fields(self.list_values(), _COPIED, memo)

    def copy_plain_values(self) -> list[Any]:
        """Return `copy_values`; raise NotPlain if a value contains other objects than plain values."""
        return self.copy_values(ONLY_PLAIN)

    def restore(self, values: list[Any]) -> None:
        """Set the fields to copies of the values from `copy_values`."""
        restore_fields(self, values, _SHARED, _REPLACED, _REFILLED)

    def turn_copies(self) -> list[Any]:
        """Return the values for `take_back`, of the fields `SAVED` in order; those of `WRITTEN` may change later."""
        return copy_fields(self.list_values(), _COPIED_IN_TURN)

    def take_back(self, values: list[Any]) -> None:
        """Set the fields to copies of the values from `turn_copies`, but for the fields `WRITTEN`."""
        restore_fields(self, values, *_TAKEN_BACK)

    def get_marks(self) -> LogMarks:
        """Return markers of the present logs, for `go_to`."""
        logs = _logs_of(self)
        self.marked = tuple(map(len, logs))
        return logs, self.marked, self.deed_log.list_last(self.row)

    def go_to(self, marks: LogMarks) -> None:
        """Restore the logs to their state at `marks`."""
        logs, lengths, last = marks
        if self.unlogged is not None:  # they are newer than all marks
            self.unlogged.drop()
        for name, entries, length, marked in zip(LOGS, logs, lengths, self.marked, strict=True):
            setattr(self, name, cut_log(getattr(self, name), entries, length, marked))
        self.marked = lengths
        self.deed_log.go_to(last)

    def copy_logs(self, marks: LogMarks) -> None:
        """Copy the logs of another game as they were at its `marks`, with the same entries."""
        logs, lengths, last = marks
        for name, entries, length in zip(LOGS, logs, lengths, strict=True):
            setattr(self, name, entries[:length])
        self.deed_log.go_to(last)

    def get_memory(self, name: str) -> dict[Any, Any]:
        """Return the writable memory of an agent."""
        return self.memories.setdefault(name, {})

    def note_named_edges(self, named: Mapping[str, int]) -> None:
        """Note the edges that agents take in the turn that is played, because their actions have named them."""
        now = self.turn + 1
        earlier = {name: pair for name, pair in self.named_edges.items() if pair[0] == now}  # of its earlier parts
        self.named_edges = earlier | {name: (now, edge) for name, edge in named.items()}

    def find_named_edges(self, turn: int) -> dict[str, int]:
        """Return agent -> the id of the edge that its action has named, for those that took one in a turn."""
        return {name: edge for name, (number, edge) in self.named_edges.items() if number == turn}

    def clear_history(self) -> None:
        """Clear the history of the game; scores, data, facts and agents' memories stay."""
        fresh = GameState()
        for name in _HISTORY:
            setattr(self, name, getattr(fresh, name))

    def begin_from_here(self) -> None:
        """Clear the history, and make the next turn the start of the game."""
        self.clear_history()
        self.start = None
        self.has_begun = False
        self.stream_version += 1


_log_of_messages: Any = vars(GameState)["messages"]  # the slot


def _read_messages(state: GameState) -> Any:
    if state.unlogged is not None:
        state.unlogged.write()
    return _log_of_messages.__get__(state)


def _write_messages(state: GameState, log: list[dict[str, Any]]) -> None:
    if state.unlogged is not None:
        state.unlogged.drop()
    _log_of_messages.__set__(state, log)


setattr(GameState, "messages", property(_read_messages, _write_messages))  # noqa: B010 - a checker knows the field

FIELDS: dict[str, GameField] = {one.name: one.metadata["done"] for one in fields(GameState)}
"""The declaration of each field of a game."""

FIELD_EVENTS = {name: one.event for name, one in FIELDS.items() if one.event is not None}
"""Field of a game -> kind of the event that records a change."""

COPY_OF = {name: one.copied for name, one in FIELDS.items() if one.copied is not None}
"""Field of a game -> function that copies its value for snapshots."""

SAVED = [*COPY_OF]
"""The fields in snapshots, except for the logs."""

WRITTEN = frozenset({"agent_facts", "data", "facts", "memories", "team_facts"})
"""The fields that functions write: they stay as they are when a turn is taken back. What agents have shared in the
memories of teams is known from the next turn on, and goes back with the turn."""

_saved_of = attrgetter(*SAVED)
_logs_of = attrgetter(*LOGS)
_MAKERS: dict[str, Any] = {one.name: one.default_factory for one in fields(GameState)}
_SHARED = [(i, name) for i, name in enumerate(SAVED) if COPY_OF[name] is _return_value]
_COPIED = [(i, COPY_OF[name]) for i, name in enumerate(SAVED) if COPY_OF[name] is not _return_value]
_REPLACED = [(i, SAVED[i], copy, _MAKERS[SAVED[i]]) for i, copy in _COPIED if FIELDS[SAVED[i]].refill is None]
_REFILLED = [  # filling a dict of dicts copies them
    (i, SAVED[i], _return_value if copy in (copy_dict, copy_each) else copy, fill)
    for i, copy in _COPIED
    if (fill := FIELDS[SAVED[i]].refill) is not None
]


def _leave_written(entries: list[Any]) -> list[Any]:
    """Return the entries of such a table without those of the fields `WRITTEN`."""
    return [one for one in entries if SAVED[one[0]] not in WRITTEN]


_COPIED_IN_TURN = _leave_written(_COPIED)
_TAKEN_BACK = _leave_written(_SHARED), _leave_written(_REPLACED), _leave_written(_REFILLED)


ALL_PLAYED = "all turns are played"
_REASONS = {"max_turns": ALL_PLAYED}


def describe_reason(reason: object) -> str:
    """Return why a game ended as words: those of a rule, or the words for the reason of a game that no rule ended."""
    words = as_text(reason)
    return _REASONS.get(words, words)
