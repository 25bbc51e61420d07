"""What came of a game."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gamms.arguments import as_path
from gamms.errors import MissingFolder, UnknownName
from gamms.folders import write_whole
from gamms.ir.tables import table_of


@dataclass(eq=False)
class Result:
    """One game, played to its end or as far as it was played. Two are equal if all but their timings is.

    Attributes:
        turns: how many were played.
        scores: by whatever the rules keep scores for.
        winner: whom the rules made the winner; None: nobody.
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
        """Plain values, as `save` writes them: keys that are no strings become their text."""
        plain: dict[str, Any] = _plain({name: getattr(self, name) for name in self.__dataclass_fields__})
        return plain

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it as JSON.

        Raises:
            MissingFolder: there is no such folder.
        """
        file: Path = as_path(path, "path")
        if not file.parent.is_dir():
            raise MissingFolder(file.name, file.parent)
        write_whole(file, (json.dumps(self.to_dict(), indent=1) + "\n").encode())

    def table(self, name: str) -> dict[str, "np.ndarray[Any, Any]"]:
        """One table as columns of equal length, which pandas and polars take as they are.

        `agents`, `scores`, `errors` and `events` are always there; each kind of event and each collected name is a
        table, too. docs/game.md says which columns they have.

        Raises:
            UnknownName (KeyError): there is no such table.
        """
        rows = self._tables().get(name)
        if rows is None:
            raise UnknownName("table", name, self._tables())
        return table_of(rows)

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


def _plain(value: Any) -> Any:
    """What JSON can hold of a value."""
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
