"""What the panel of a page says of agents, in words: speed, strategy, sensors, memories, deeds and messages."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gamms.ir import events as kinds
from gamms.ir.events import Log, events_of
from gamms.ir.messages import ARRIVALS
from gamms.recorder.detached import DetachedState
from gamms.text import as_digits, as_text

_MOST_WORDS, _MOST_ITEMS, _MOST_PAIRS, _MOST_ROWS = 400, 24, 50, 400
_MOST_BODY = 120  # letters of a message
_NOTHING = "\u2013"  # a dash
_OPEN, _DECISION, _MESSAGES = "", "Decision", "Messages"
_OF_ONE = {  # kinds of events that change what is said of the agent that they name
    kinds.AGENT_TEAM,
    kinds.AGENT_SPEED,
    kinds.AGENT_STRATEGY,
    kinds.AGENT_SENSOR_REGISTER,
    kinds.AGENT_SENSOR_DEREGISTER,
}
_OF_ALL = {kinds.SNAPSHOT, kinds.AGENT_CREATE, kinds.AGENT_DELETE, kinds.SENSORS, kinds.AGENT_ATTRIBUTE}

Facts = dict[tuple[str, str], str]
"""The words for each key below a heading."""


def words_of(value: object, most: int = _MOST_WORDS) -> str:
    """Return a plain value as short text."""
    words = _text_of(value, 4)
    return words if len(words) <= most else f"{words[: most - 1]}…"


def _text_of(value: Any, depth: int) -> str:
    if isinstance(value, dict):
        return _text_of_items([(f"{as_text(key)}: ", one) for key, one in value.items()], _MOST_PAIRS, depth)
    if isinstance(value, set | frozenset):
        value = sorted(value, key=as_text)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return _text_of_items([("", one) for one in value], _MOST_ITEMS, depth)
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, float):
        return as_digits(value)
    if value is None:
        return _NOTHING
    return as_text(value).lower() if isinstance(value, bool) else as_text(value)


def _text_of_items(items: Sequence[tuple[str, Any]], most: int, depth: int) -> str:
    """Return the first items as text, each behind its label."""
    if not items or not depth:
        return "…" if items else _NOTHING
    shown = ", ".join(f"{label}{_text_of(one, depth - 1)}" for label, one in items[:most])
    return f"{shown}, … ({len(items)})" if len(items) > most else shown


class AgentFacts:
    """Says what has changed of what is said of agents.

    Args:
        state: how the game stands, which others change.
    """

    def __init__(self, state: DetachedState) -> None:
        self._state = state
        self._known: dict[str, Facts] = {}  # of each agent
        self._momentary: dict[str, Facts] = {}  # likewise, of the last turn
        self._sent: dict[int, list[tuple[str, str, int, str, str]]] = {}  # turn -> what agents have in it
        self.messages: list[tuple[str, str, int]] = []  # see `turns.Turn`

    def present(self) -> Iterator[tuple[str, str, str, str | None]]:
        """Yield all facts of the present."""
        for known in (self._known, self._momentary):
            for name, facts in known.items():
                yield from ((name, *key, words) for key, words in facts.items())

    def changes(self, log: Log | None, turn: int) -> Iterator[tuple[str, str, str, str | None]]:
        """Yield the facts that have changed.

        Args:
            log: of the turn that was added to the state; None: everything may be another.
            turn: as the game counts it.
        """
        for name in self._about(log):
            now = self._of(self._state.agents.row(name))
            yield from _differences(name, self._known.get(name, {}), now)
            self._known[name] = now
        momentary = self._of_turn(log or [], turn)
        for name in {**self._momentary, **momentary}:
            yield from _differences(name, self._momentary.get(name, {}), momentary.get(name, {}))
        self._momentary = momentary

    def _about(self, log: Log | None) -> list[str]:
        """Return the agents of whom something else may be said."""
        names = self._state.agents.columns["names"]
        events = [] if log is None else list(events_of(log))
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

    def _of(self, row: int) -> Facts:
        """Return what is said of an agent until something of it changes."""
        columns, game = self._state.agents.columns, self._state.game
        name, team = columns["names"][row], columns["teams"][row]
        facts: Facts = {}
        for key, value in (("team", team), ("speed", columns["speed"][row]), ("strategy", columns["strategies"][row])):
            if value is not None:
                facts[_OPEN, key] = words_of(value)
        for sensor, sensor_id in columns["sensors"][row].items():
            facts["Sensors", as_text(sensor)] = as_text(self._state.sensors.get(sensor_id, {}).get("type", ""))
        memories: dict[str, Any] = {"Memory": game.memories.get(name)}
        memories["Memory of the team"] = None if team is None else game.team_memories.get(team)
        memories["Attributes"] = columns["attributes"][row]
        for heading, values in memories.items():
            if isinstance(values, Mapping):
                pairs = list(values.items())[:_MOST_ROWS]
                facts.update(((heading, as_text(key)), words_of(value)) for key, value in pairs)
        return facts

    # -- of one turn --------------------------------------------------------------------------------------------

    def _of_turn(self, log: Log, turn: int) -> dict[str, Facts]:
        """Return what is said of agents for one turn alone."""
        found: dict[str, Facts] = {}
        self.messages = []
        for kind, data in events_of(log):
            if kind == kinds.GAME_DEED:
                rest = {key: value for key, value in data.items() if key not in ("turn", "agent")}
                _put(found, data["agent"], _DECISION, "deed", words_of(rest))
            elif kind == kinds.GAME_MESSAGE:
                self._send(data, found)
        for name, why in dict(self._state.game.blocked).items():
            _put(found, name, _DECISION, "blocked", words_of(why))
        for sender, receiver, fate, key, body in self._sent.pop(turn + 1, ()):
            self.messages.append((sender, receiver, fate))
            _put(found, receiver, _MESSAGES, key, body)
        self._sent = {when: sent for when, sent in self._sent.items() if when > turn}
        return found

    def _send(self, message: Mapping[str, Any], found: dict[str, Facts]) -> None:
        """Note what becomes of a message."""
        sender, body = message["sender"], words_of(message["body"], _MOST_BODY)
        fates = {key: list(message.get(key) or ()) for key in (*ARRIVALS, "lost", "jammed")}
        fate = "; ".join(f"{key} by {', '.join(map(as_text, to[:6]))}" for key, to in fates.items() if to)
        words = f"{body} ({fate})" if fate else body
        _put(found, sender, _MESSAGES, f"to {words_of(message.get('to'))}", words)
        for number, key in enumerate(ARRIVALS):
            for receiver, when in dict(message.get(key) or {}).items():
                self._sent.setdefault(when, []).append((sender, receiver, number, f"{key} from {sender}", body))
        self.messages += [(sender, receiver, 2) for receiver in (*fates["lost"], *fates["jammed"])]


def _put(found: dict[str, Facts], name: str, heading: str, key: str, words: str) -> None:
    """Note one of several facts of the same key."""
    facts = found.setdefault(name, {})
    known = facts.get((heading, key))
    facts[heading, key] = words if known is None else f"{known}; {words}"[:_MOST_WORDS]


def _differences(name: str, before: Facts, now: Facts) -> Iterable[tuple[str, str, str, str | None]]:
    """Yield what is said otherwise, and what is said no longer."""
    for key, words in now.items():
        if before.get(key) != words:
            yield name, *key, words
    yield from ((name, *key, None) for key in before if key not in now)
