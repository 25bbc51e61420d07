"""The state of a game at a moment, apart from the agents and the world."""

from collections.abc import Container, Hashable, Iterable, Iterator, Mapping, MutableMapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, fields
from numbers import Real
from operator import attrgetter
from types import NoneType
from typing import Any, Self, cast

from gamms.core.copies import copied, copied_each, refill, refill_counts, refill_each
from gamms.errors import BadType, BadValue
from gamms.ir.graph import IntArray
from gamms.ir.schema import Audience, ChangeEvent, GameField, Memo, kept
from gamms.plain import Plain, plain_subset, to_plain
from gamms.readonly import published
from gamms.text import shown

PHASES = ("decide", "resolve", "apply", "rules", "draw")
LOGS = ("events", "errors", "deeds", "messages")
"""The fields of a state to which entries are only appended."""

_HISTORY = (
    *("turn", "over", "last_turn", "moves", "counts", "team_memories", "departed", "blocked", "delayed_looks"),
    *(*LOGS, "marked", "timings"),
)


_Given = Mapping[Any, float] | Iterable[tuple[Any, float]]


class Scores(dict[Any, float]):
    """Scores by team, agent or any other key; one that was not set is 0.

    Raises:
        BadType: one that is set is no number, or NaN.
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
        """Set scores as a dict takes them: all, or none where one cannot be."""
        given = {**dict(scores), **named}
        for key, score in given.items():
            _refuse_no_score(key, score)
        super().update(given)

    def __ior__(self, scores: _Given) -> Self:  # type: ignore[override,misc] # as `update`
        self.update(scores)
        return self

    def setdefault(self, key: Hashable, score: object = 0) -> float:
        """Set a score that was not set yet, and return it."""
        if key not in self:
            self[key] = score
        return self[key]


def _refuse_no_score(key: Hashable, score: object) -> None:
    if type(score) is not int and not (isinstance(score, Real) and score == score):  # noqa: PLR0124 - NaN does not
        raise BadType(f"The score of {shown(key)} must be a number, not {shown(score)} ({type(score).__name__}).")


LogMarks = tuple[Sequence[list[Any]], Sequence[int]]
"""Logs at a moment: their lists, which may have further entries by now, and how many entries each had."""


def log_at(log: list[Any], entries: list[Any], length: int, marked: int) -> list[Any]:
    """Return a log as it was at a moment, to append to.

    Args:
        log: as it is now.
        entries: its list at that moment.
        length: how many entries this had.
        marked: up to which entry of the log other marks may need it.
    """
    if log is entries and marked <= length:
        del entries[length:]
    return entries if len(entries) == length else entries[:length]


def joined_end(known: dict[str, Any] | None, new: dict[str, Any]) -> dict[str, Any]:
    """Return the end of a game that two rules end in one turn.

    An end by what happened goes before one by time; reasons are in alphabetical order, and a team wins if both agree.
    """
    if known is None or (known["truncated"] and not new["truncated"]):
        return new
    if new["truncated"] and not known["truncated"]:
        return known
    reasons = {*known["reason"].split("; "), *new["reason"].split("; ")}
    winner = new["winner"] if new["winner"] == known["winner"] else None
    return {**new, "reason": "; ".join(sorted(reasons)), "winner": winner}


class BlockedAgents(MutableMapping[str, str]):
    """Agent -> why it did not do in its last turn what it wanted.

    Conflicts of many agents are noted as arrays, and written out when one of them is read.

    Args:
        known: what is in it at first.
    """

    def __init__(self, known: Mapping[str, str] | None = None) -> None:
        self.known = dict(known or {})
        self.stopped: list[tuple[Sequence[str], IntArray, IntArray]] = []

    def __getitem__(self, name: str) -> str:
        return self._written()[name]

    def __setitem__(self, name: str, why: str) -> None:
        self._written()[name] = why

    def __delitem__(self, name: str) -> None:
        del self._written()[name]

    def get(self, name: str, default: Any = None) -> Any:
        """Return why an agent was blocked; the default if it was not."""
        return self._written().get(name, default)  # NOTE: without an exception, for each agent (benchmarks: turns)

    def __iter__(self) -> Iterator[str]:
        return iter(self._written())

    def __len__(self) -> int:
        return len(self._written())

    def __bool__(self) -> bool:
        """Whether there are any, without writing them out."""
        return bool(self.known or self.stopped)

    def add(self, name: str, why: str) -> str:
        """Note why an agent was blocked, after what is known already; return all of it."""
        known = self._written() if self.stopped else self.known
        known[name] = all_known = f"{known[name]}; {why}" if name in known else why
        return all_known

    def add_conflicts(self, names: Sequence[str], agents: IntArray, nodes: IntArray) -> None:
        """Note which agents, by their numbers among names, conflicts have stopped on the way to nodes."""
        self.stopped.append((names, agents, nodes))

    def drop_conflicts(self, names: Sequence[str]) -> None:
        """Forget those conflicts of the agents of these names, this very list, that were not written out."""
        self.stopped = [stopped for stopped in self.stopped if stopped[0] is not names]

    def _written(self) -> dict[str, str]:
        if self.stopped:
            stopped, self.stopped = self.stopped, []
            for names, agents, nodes in stopped:
                for i, node in zip(agents.tolist(), nodes.tolist(), strict=True):
                    self.add(names[i], in_conflict(node))
        return self.known


def in_conflict(end: object) -> str:
    """Say on the way to which node or edge an agent was stopped by a conflict."""
    where = f"node {end}" if isinstance(end, int) else str(end)
    return f"in conflict with other agents on the way to {where}"


def _same(value: object, _: Memo | None) -> object:
    return value


def _dict_of(value: Mapping[Any, Any], _: Memo | None) -> dict[Any, Any]:
    return dict(value)


def _dicts_of(value: Mapping[Any, Mapping[Any, Any]], _: Memo | None) -> Any:
    return copied_each(value)


def _memories_of(value: Mapping[Any, Any], memo: Memo | None) -> dict[Any, Any]:
    return {name: copied(memory, memo) for name, memory in value.items() if memory}


def _captured_each(memories: dict[Any, dict[Any, Any]]) -> list[tuple[Any, dict[Any, Any]]]:
    return [(to_plain(name), plain_subset(memory)) for name, memory in memories.items() if memory]


def _private_facts(each: Iterable[tuple[Any, dict[str, Any]]]) -> dict[Any, dict[str, Any]]:
    return {to: {name: published(name, value) for name, value in facts.items()} for to, facts in each}


_FACTS = (_dicts_of, _captured_each, _private_facts)


def as_scores(scores: Plain) -> Scores:
    """Return scores.

    Raises:
        BadValue: these are none.
    """
    try:
        return Scores(scores)
    except (TypeError, ValueError) as error:
        raise BadValue(f"its scores are none ({error})") from error


_OVER = {"reason", "winner", "truncated"}


def as_over(value: object) -> dict[str, Any] | None:
    """Return why a game is over; None: it goes on.

    Raises:
        BadValue: a game is not over like this.
    """
    if value is not None and (not isinstance(value, Mapping) or set(value) != _OVER):
        raise BadValue(f"A game is over with {sorted(_OVER)}, not with {shown(value)}.")
    return None if value is None else dict(value)


def as_blocked(value: object) -> BlockedAgents:
    """Return agent -> why it did not do what it wanted.

    Raises:
        BadType: it is something else.
    """
    if not isinstance(value, Mapping) or not all(isinstance(text, str) for pair in value.items() for text in pair):
        raise BadType(f"Agents and why they were blocked are texts, not {shown(value)}.")
    return BlockedAgents(value)


def as_looks(value: object) -> dict[int, dict[str, Any]]:
    """Return what a sensor is still to report: turn -> what it saw then, by the names of agents.

    Raises:
        BadType: it is something else.
    """
    looks = value.items() if isinstance(value, Mapping) else [(None, None)]
    if not all(
        type(turn) is int and isinstance(seen, dict) and all(isinstance(name, str) for name in seen)
        for turn, seen in looks
    ):
        raise BadType(f"What a sensor is still to report is a dict of turns, not {shown(value)}.")
    return dict(looks)


@dataclass(eq=False, slots=True)
class GameState:
    """What a game has come to: plain values, which the turn engine, rules and the recorder read and write.

    Each field is one entry: snapshots, forks, keyframes and what a team knows follow from it (`FIELDS`). Keyframes have
    the fields in this order.

    Attributes:
        scores: numbers by any key; this dict is never replaced.
        data: the plain values that rules remember.
        over: reason, winner and truncated of a game that has ended; None while it goes on.
        turn: the number of turns that were played.
        events: what was emitted, in order; append-only: dicts with `turn` and `kind`.
        errors: what strategies did wrong, in order; append-only.
        deeds: what agents did besides moving, in order; append-only: dicts with `turn`, `agent`, `deed`, `at`.
        messages: what agents sent by channels and who hears it when, in order; append-only: see `ir.messages`.
        blocked: agent -> why it did not do in its last turn what it wanted; only those that did not.
        facts: what was published, read-only values; this dict is never replaced.
        agent_facts: agent -> what was published to it alone.
        team_facts: team -> what was published to it alone.
        memories: agent -> what it remembers; this dict is never replaced, nor are those in it.
        team_memories: team -> what it remembers.
        delayed_looks: (sensor, the agent that carries it, or "") -> turn -> what it saw then and is still to report.
        counts: agent -> how often it moved, was blocked, and so on.
        timings: seconds by phase.
        moves: of the last turn; None before the first. Any: the turn engine's own class.
        departed: agent -> its team and node when it was deleted, of those that were since the game has begun.
        last_turn: the turn after which the latest `run` stops; None: no such.
        began: agent -> where it began, for a game that was resumed from a recording.
        start: the snapshot to which `reset` returns; None before the first turn. Any: it holds what all engines gave.
        drawn: what a scenario has made for the seed of the start; replaced, never changed. Any: the builder's own form.
        parts_played: of a turn that is under way how many parts have moved, in a fork for agents that decide in it;
            None: it is between two turns.
        has_begun: whether a turn was played since the game was created, reset or resumed.
        stream_version: changes whenever counts and memories are other objects, and all random streams begin again.
        marked: of each log, up to which entry snapshots need its list.
    """

    scores: Scores = kept(
        Scores,
        _dict_of,
        refill=refill,
        captured=lambda scores: list(to_plain(scores).items()),
        restored=as_scores,
        axis="game",
        event=ChangeEvent(0x04000000, "GAME_SCORES", Audience.ALL, "scores"),
    )
    data: dict[str, Any] = kept(dict, copied, refill=refill, captured=plain_subset)
    over: dict[str, Any] | None = kept(NoneType, copied, captured=to_plain, restored=as_over, axis="game")
    turn: int = kept(int, _same, captured=to_plain, restored=int, axis="game")
    events: list[dict[str, Any]] = kept(list)
    errors: list[dict[str, Any]] = kept(list)
    deeds: list[dict[str, Any]] = kept(list)
    messages: list[dict[str, Any]] = kept(list)
    blocked: BlockedAgents = kept(
        BlockedAgents,
        lambda value, _: BlockedAgents(value),
        captured=to_plain,
        restored=as_blocked,
        is_seldom=True,
        axis="agent",
        event=ChangeEvent(0x04000009, "GAME_BLOCKED", Audience.ALL, "blocked"),
    )
    facts: dict[str, Any] = kept(dict, _dict_of, refill=refill, axis="game")
    agent_facts: dict[str, dict[str, Any]] = kept(dict, *_FACTS, is_seldom=True, axis="agent")
    team_facts: dict[Any, dict[str, Any]] = kept(dict, *_FACTS, is_seldom=True, axis="team")
    memories: dict[str, dict[Any, Any]] = kept(
        dict,
        _memories_of,
        refill=refill_each,
        captured=lambda memories: dict(sorted(_captured_each(memories))),
        restored=lambda memories: _dicts_of(deepcopy(memories), None),
        axis="agent",
    )
    team_memories: dict[Any, dict[Any, Any]] = kept(
        dict,
        copied,
        captured=_captured_each,
        restored=lambda each: dict(deepcopy(list(each))),
        axis="team",
    )
    delayed_looks: dict[tuple[str, str], dict[int, dict[str, Any]]] = kept(
        dict,
        _dicts_of,
        captured=lambda looks: [[*key, to_plain(one)] for key, one in sorted(looks.items()) if one],
        restored=lambda each: {(sensor, owner): as_looks(deepcopy(one)) for sensor, owner, one in each},
        is_seldom=True,
    )
    counts: dict[str, dict[str, int]] = kept(dict, _dicts_of, refill=refill_counts, axis="agent")
    timings: dict[str, float] = kept(lambda: dict.fromkeys(PHASES, 0.0), _dict_of, refill=refill)
    moves: Any = kept(NoneType, _same, is_own=True)
    departed: dict[str, tuple[Any, int]] = kept(dict, _dict_of)
    last_turn: int | None = kept(NoneType, _same, axis="game")
    began: dict[str, Any] = kept(dict, _dict_of, is_own=True)
    start: Any = kept(NoneType, _same, is_own=True)
    drawn: Any = kept(NoneType, _same, is_own=True)
    parts_played: int | None = kept(NoneType, _same)
    has_begun: bool = kept(bool, _same, is_own=True)
    stream_version: int = kept(int)
    marked: Sequence[int] = kept(lambda: (0,) * len(LOGS))

    def put(self, name: str, value: object) -> None:
        """Set a field to another value, in place where others hold a reference to it."""
        refill = FIELDS[name].refill
        if refill is None:
            setattr(self, name, value)
        else:
            refill(getattr(self, name), value)

    def put_known(self, source: "GameState", agents: Container[str], teams: Container[Any]) -> None:
        """Set the fields of which agents know a part to what some agents, of these teams, know of another game."""
        for name, one in FIELDS.items():
            if one.axis is not None:
                self.put(name, one.copy_for(getattr(source, name), agents, teams))

    def copies(self) -> list[Any]:
        """Return the values that snapshots hold, those of the fields `SAVED` in their order; None for an empty dict."""
        values = [*_saved_of(self)]
        for i, copy in _COPIED:
            values[i] = copy(values[i], None) if values[i] else None
        return values

    def restore(self, values: list[Any]) -> None:
        """Set the fields to copies of what `copies` returned."""
        for i, name in _SHARED:
            setattr(self, name, values[i])
        for i, name, copy, make in _REPLACED:
            value = values[i]
            if value or getattr(self, name):
                setattr(self, name, copy(value, None) if value else make())
        for i, name, copy, fill in _REFILLED:
            fill(getattr(self, name), copy(values[i], None) if values[i] else {})

    def marks(self) -> LogMarks:
        """Return the logs as they are now, for `go_to`."""
        logs = _logs_of(self)
        self.marked = tuple(map(len, logs))
        return logs, self.marked

    def go_to(self, marks: LogMarks) -> None:
        """Let the logs be as they were when `marks` was called."""
        logs, lengths = marks
        for name, entries, length, marked in zip(LOGS, logs, lengths, self.marked, strict=True):
            setattr(self, name, log_at(getattr(self, name), entries, length, marked))
        self.marked = lengths

    def copy_logs(self, source: "GameState") -> None:
        """Take copies of the logs of another game, with the same entries."""
        for name in LOGS:
            setattr(self, name, getattr(source, name).copy())

    def memory_of(self, name: str) -> dict[Any, Any]:
        """Return the memory of an agent, to be written to."""
        return self.memories.setdefault(name, {})

    def clear_history(self) -> None:
        """Forget what has happened in the game; scores, data, facts and agents' memories stay."""
        fresh = GameState()
        for name in _HISTORY:
            setattr(self, name, getattr(fresh, name))

    def begin_from_here(self) -> None:
        """Forget what has happened, and take the game at its next turn for its start."""
        self.clear_history()
        self.start, self.has_begun = None, False
        self.stream_version += 1


FIELDS: dict[str, GameField] = {one.name: one.metadata["done"] for one in fields(GameState)}
"""What is done with each field of a game."""

FIELD_EVENTS = {name: one.event for name, one in FIELDS.items() if one.event is not None}
"""Field of a game -> the kind of event that notes another value of it."""

COPY_OF = {name: one.copied for name, one in FIELDS.items() if one.copied is not None}
"""Field of a game -> what returns the copy of its value that snapshots hold."""

SAVED = [*COPY_OF]
"""The fields whose values snapshots hold, but for the logs."""

_saved_of = attrgetter(*SAVED)
_logs_of = attrgetter(*LOGS)
_MAKERS: dict[str, Any] = {one.name: one.default_factory for one in fields(GameState)}
_SHARED = [(i, name) for i, name in enumerate(SAVED) if COPY_OF[name] is _same]
_COPIED = [(i, COPY_OF[name]) for i, name in enumerate(SAVED) if COPY_OF[name] is not _same]
_REPLACED = [(i, SAVED[i], copy, _MAKERS[SAVED[i]]) for i, copy in _COPIED if FIELDS[SAVED[i]].refill is None]
_REFILLED = [  # filling a dict of dicts copies them
    (i, SAVED[i], _same if copy in (_dict_of, _dicts_of) else copy, fill)
    for i, copy in _COPIED
    if (fill := FIELDS[SAVED[i]].refill) is not None
]
