"""What a fork holds of a game for agents that look ahead: what they know, and the start values of all else.

Who may know of a part of the game is what the table of events says (`ir/events.py`): lives, teams, scores, events and
facts are public; moves, speeds, attributes, memories and what rules remember are not. The fields of `GameState` say by
which axis agents know them (`ir/schema.py`).
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from gamms.game.snapshots import SnapshotTaker, copy_means
from gamms.ir.game_state import FIELDS, GameState
from gamms.ir.messages import ARRIVALS
from gamms.ir.schema import Memo
from gamms.plain import copied

_IN_ALL_GAMES: dict[str, Any] = {
    "plans": {},
    "time_budget": None,
    "deadline_s": None,
}  # settings


class _Knowing(NamedTuple):
    """Agents that look ahead, and where they do."""

    state: GameState
    names: frozenset[str]
    teams: frozenset[Any]


def copy_known(
    source: SnapshotTaker, target: SnapshotTaker, memo: Memo, names: frozenset[str], starts: Mapping[str, object]
) -> None:
    """Copy what some agents of a game know of it into the game of a new context.

    Args:
        source: the parts of the game.
        target: those of the new game; its map, agents and sensors are copies already.
        memo: has the context, its engines, agents and sensors.
        names: of the agents.
        starts: agent -> where it began.
    """
    source.turns.update_counts()
    start = source.state.start.snapshot
    target.ctx.agent.storage.hide(start.agents, names)
    target.ctx.sensor.storage.hide(start.sensors, names)
    copy_means(source, target, memo, **_IN_ALL_GAMES)
    teams = frozenset(one.team for name, one in source.ctx.agent.agents.items() if name in names)
    knowing = _Knowing(source.state, names, teams)
    state = target.state
    state.data.update(copied(start.data, memo))
    state.share_logs(source.state)
    _put_known(state, knowing)
    for field, known in _LOGS.items():
        setattr(state, field, known(knowing))
    state.began = {name: place for name, place in starts.items() if name in names}
    for rule in target.rules.rules:
        if not hasattr(rule.rule, "disclose"):  # it may draw at random what no agent knows
            getattr(rule.rule, "prepare", bool)(target.ctx)
    _put_known(state, knowing)
    for rule in source.rules.rules:
        if hasattr(rule.rule, "disclose"):
            _put_in(state.data, copied(rule.rule.disclose(source.state.data, names), memo))
    state.stream_version += 1


def _put_known(state: GameState, of: _Knowing) -> None:
    """Set the fields of which agents know a part."""
    for name, field in FIELDS.items():
        if field.axis is not None:
            state.put(name, field.copy_for(getattr(of.state, name), of.names, of.teams))


def _put_in(values: dict[Any, Any], known: Mapping[Any, Any]) -> None:
    """Write values into others, also into the dicts among them."""
    for key, value in known.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            _put_in(values[key], value)
        else:
            values[key] = value


def _entries(log: str) -> Callable[[_Knowing], Any]:
    return lambda of: [dict(entry) for entry in getattr(of.state, log) if entry.get("agent") in of.names]


def _heard(of: _Knowing) -> list[dict[str, Any]]:
    """Return the messages that they have sent or heard, without what became of them elsewhere and later."""
    known, now = [], of.state.turn + 1
    for entry in of.state.messages:
        heard = {
            key: {name: turn for name, turn in entry[key].items() if name in of.names and turn <= now}
            for key in ARRIVALS
        }
        if entry["sender"] in of.names or any(heard.values()):
            known.append({**entry, **heard, "lost": [], "jammed": []})
    return known


_LOGS: dict[str, Callable[[_Knowing], Any]] = {  # of events they know all: the log is shared
    "messages": _heard,
    **{name: _entries(name) for name in ("errors", "deeds")},
}
