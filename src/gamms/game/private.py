"""What a fork holds of a game for agents that look ahead: what they know, and the start values of all else.

Who may know of a part of the game is what the table of events says (`ir/events.py`): lives, teams, scores, events and
facts are public; moves, speeds, attributes, memories and what rules remember are not. Each field of `GameState` has an
entry in `_KNOWN`.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from gamms.game.snapshots import Memo, SnapshotTaker, copy_means
from gamms.ir.game_state import BlockedAgents, GameState
from gamms.ir.messages import ARRIVALS
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
    starts: Mapping[str, object]  # agent -> where it began
    memo: Memo


_Known = Callable[[_Knowing], Any]


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
    knowing = _Knowing(source.state, names, teams, starts, memo)
    state = target.state
    state.data.update(copied(start.data, memo))
    state.share_logs(source.state)
    for field, known in _KNOWN.items():
        if known is not None:
            _set(state, field, known(knowing))
    for rule in target.rules.rules:
        if not hasattr(rule.rule, "disclose"):  # it may draw at random what no agent knows
            getattr(rule.rule, "prepare", bool)(target.ctx)
    for field, facts in _FACTS.items():
        _set(state, field, facts(knowing))
    for rule in source.rules.rules:
        if hasattr(rule.rule, "disclose"):
            _put_in(state.data, copied(rule.rule.disclose(source.state.data, names), memo))
    state.stream_version += 1


def _set(state: GameState, field: str, value: object) -> None:
    """Set a field; a dict of which others hold a reference is written to."""
    if field in ("scores", "facts", "memories"):
        values: dict[Any, Any] = getattr(state, field)
        values.clear()
        values.update(value)  # type: ignore[call-overload] # a dict
    else:
        setattr(state, field, value)


def _put_in(values: dict[Any, Any], known: Mapping[Any, Any]) -> None:
    """Write values into others, also into the dicts among them."""
    for key, value in known.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            _put_in(values[key], value)
        else:
            values[key] = value


def _field(name: str) -> _Known:
    return lambda of: copied(getattr(of.state, name), of.memo)


def _part(field: str, of_whom: str) -> _Known:
    """Return what of a field is under the names or teams of those that look ahead."""
    copy = dict if field.endswith("facts") else copied  # facts do not change
    return lambda of: {
        key: copy(value) for key, value in getattr(of.state, field).items() if key in getattr(of, of_whom)
    }


def _entries(log: str) -> _Known:
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


_FACTS: dict[str, _Known] = {
    "facts": lambda of: of.state.facts,
    "agent_facts": _part("agent_facts", "names"),
    "team_facts": _part("team_facts", "teams"),
}
_KNOWN: dict[str, _Known | None] = {  # field of `GameState` -> what they know of it; None: nothing
    **{name: _field(name) for name in ("turn", "last_turn", "over", "scores")},
    **_FACTS,
    "memories": _part("memories", "names"),
    "team_memories": _part("team_memories", "teams"),
    "counts": _part("counts", "names"),
    "blocked": lambda of: BlockedAgents({name: why for name, why in of.state.blocked.items() if name in of.names}),
    "began": lambda of: {name: place for name, place in of.starts.items() if name in of.names},
    "messages": _heard,
    **{name: _entries(name) for name in ("errors", "deeds")},
    "events": None,  # all: the log is shared
    "data": None,  # what rules draw and disclose
    **dict.fromkeys(("delayed_looks", "timings", "moves", "departed"), None),
    **dict.fromkeys(("start", "drawn", "has_begun", "parts_played"), None),
    **dict.fromkeys(("stream_version", "histories", "shared_logs"), None),
}
