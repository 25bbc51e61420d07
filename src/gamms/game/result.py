"""What came of a game, and the values that are collected while it is played."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_choice, as_key, as_path, as_text
from gamms.errors import BadType, Duplicate, MissingFolder, UnknownName
from gamms.folders import write_whole
from gamms.ir.game_state import LogHistory, LogPoint
from gamms.ir.tables import table_of
from gamms.plain import Plain
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext


@dataclass(eq=False)
class Result:
    """One game, played to its end or as far as it was played. Two are equal if all but their timings is.

    Attributes:
        turns: how many were played.
        scores: by whatever the rules keep scores for.
        winner: what the rules made the winner; None: no winner.
        reason: why it ended: what a rule said, "max_turns", "closed" (its context ended) or "unfinished".
        truncated: whether it stopped before it was over.
        events: what rules emitted, in order: each with `turn` and `kind`.
        agents: name -> what became of it: team, alive, node (where it is), moves (turns in which it went on), blocked
            (by conflicts), illegal, errors, overruns (how often each).
        errors: what strategies did wrong, in order: turn, agent, kind ("illegal", "error", "overrun"), message.
        timings: seconds by phase: decide (sensing included), resolve, apply, rules, draw.
        seed: of the context.
        collected: name -> columns of what was collected.
    """

    turns: int
    scores: dict[Any, float]
    winner: Any
    reason: str
    truncated: bool
    events: list[dict[str, Any]]
    agents: dict[str, dict[str, Any]]
    errors: list[dict[str, Any]]
    timings: dict[str, float]
    seed: int
    collected: dict[str, dict[str, list[Any]]] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as `save` writes them: keys that are no strings become their text."""
        plain: dict[str, Any] = _plain({name: getattr(self, name) for name in self.__dataclass_fields__})
        return plain

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the result as JSON.

        Raises:
            MissingFolder: there is no such folder.
        """
        file: Path = as_path(path, "path")
        if not file.parent.is_dir():
            raise MissingFolder(file.name, file.parent)
        write_whole(file, (json.dumps(self.to_dict(), indent=1) + "\n").encode())

    def table(self, name: str) -> dict[str, "np.ndarray[Any, Any]"]:
        """Return one table as columns of equal length, which pandas and polars take as they are.

        `agents`, `scores`, `errors` and `events` are always there; each kind of event and each collected name is a
        table, too. docs/game.md says which columns they have.

        Raises:
            UnknownName (KeyError): there is no such table.
        """
        tables = self._tables()
        if as_key(name, "The name of a table") not in tables:
            raise UnknownName("table", name, tables)
        return table_of(tables[name])

    def _tables(self) -> dict[str, Any]:
        events: dict[str, Any] = {}
        for event in self.events:
            events.setdefault(event["kind"], []).append({key: event[key] for key in event if key != "kind"})
        return {
            **events,
            **self.collected,
            "events": {key: [event[key] for event in self.events] for key in ("turn", "kind")},
            "errors": self.errors or {"turn": [], "agent": [], "kind": [], "message": []},
            "scores": {"of": list(self.scores), "score": list(self.scores.values())},
            "agents": [{"agent": name, **summary} for name, summary in self.agents.items()],
        }

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Result):
            return NotImplemented
        mine, theirs = self.to_dict(), other.to_dict()
        del mine["timings"], theirs["timings"]
        return bool(mine == theirs)

    __hash__ = None  # type: ignore[assignment] # what can be changed has no hash


def _plain(value: object) -> Plain:
    """Return what JSON can hold of a value."""
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if isinstance(value, (set, frozenset)):
        return sorted((_plain(one) for one in value), key=str)
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


class _Collector(NamedTuple):
    fn: Callable[[Any], Any]
    every: int
    per: str
    columns: dict[str, list[Any]]
    histories: dict[str, LogHistory]


class _SharedColumns(dict[str, list[Any]]):
    """The columns of a collector of another game, up to some points; each is copied when it is first asked for."""

    def __init__(self, points: dict[str, LogPoint], histories: dict[str, LogHistory]) -> None:
        super().__init__()
        self._points, self._histories = points, histories

    def __missing__(self, name: str) -> list[Any]:
        column: list[Any] = []
        self._histories[name].go_to(column, self._points[name])
        self[name] = column
        return column


class Collectors:
    """The collectors of one game, by name."""

    def __init__(self) -> None:
        self._all: dict[str, _Collector] = {}

    def add(self, name: str, fn: Callable[[Any], Any], every: int, per: str) -> None:
        """Add a collector; see `Game.collect`."""
        if name in self._all:
            raise Duplicate("a collector", name)
        if not callable(fn):
            raise BadType(f"Collector {shown(name)} needs a function, not {shown(fn)}.")
        as_choice(as_text(per, "per"), "per", ("game", "agent"))
        names = ("turn", "value") if per == "game" else ("turn", "agent", "value")
        columns: dict[str, list[Any]] = {column: [] for column in names}
        self._all[name] = _Collector(fn, every, per, columns, {column: LogHistory() for column in names})

    def collect(self, turn: int, ctx: HostContext, agents: Callable[[], Sequence[IAgent]]) -> None:
        """Take the values of a turn; `agents` gives the living agents."""
        for fn, every, per, columns, _ in self._all.values():
            if turn % every:
                continue
            for agent in agents() if per == "agent" else (None,):
                columns["turn"].append(turn)
                if agent is not None:
                    columns["agent"].append(agent.name)
                columns["value"].append(deepcopy(fn(ctx if agent is None else agent)))

    def tables(self) -> dict[str, dict[str, list[Any]]]:
        """Return what was collected so far, by name."""
        return {name: {key: list(one.columns[key]) for key in one.histories} for name, one in self._all.items()}

    def copy_from(self, other: "Collectors", own: Callable[[Any], Any]) -> None:
        """Take over the collectors of another game and what they have collected, which is copied when it is needed.

        Args:
            other: the collectors of that game.
            own: gives the function to call for one of theirs.
        """
        for name, (one, points) in other.snapshot().items():
            histories = {key: LogHistory() for key in points}
            columns = _SharedColumns(points, histories)
            self._all[name] = one._replace(fn=own(one.fn), columns=columns, histories=histories)

    def snapshot(self) -> dict[str, tuple[_Collector, dict[str, LogPoint]]]:
        """Return the collectors and what they have collected, for `restore`."""
        return {
            name: (one, {key: history.mark(one.columns[key]) for key, history in one.histories.items()})
            for name, one in self._all.items()
        }

    def restore(self, before: dict[str, tuple[_Collector, dict[str, LogPoint]]]) -> None:
        """Restore the collectors and what they had collected."""
        self._all = {name: one for name, (one, _) in before.items()}
        for one, points in before.values():
            for key, point in points.items():
                one.histories[key].go_to(one.columns[key], point)
