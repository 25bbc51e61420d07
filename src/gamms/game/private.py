"""Fill a fork with the knowledge of the agents that look ahead; all other state is as at the start.

The table of events defines who may know which part of the game (`ir/events.py`): lives, teams, scores, events and facts
are public; moves, speeds, attributes, memories and data of rules are private. For each field of `GameState`,
`ir/schema.py` defines who knows it.
"""

from collections.abc import Mapping
from typing import Any

from gamms.core.copies import copied
from gamms.game.snapshots import SnapshotTaker, copy_means
from gamms.ir.game_state import GameState
from gamms.ir.messages import ARRIVALS
from gamms.ir.schema import Memo

_IN_ALL_GAMES: dict[str, Any] = {
    "plans": {},
    "time_budget": None,
    "deadline_s": None,
}  # settings


def copy_known(
    source: SnapshotTaker, target: SnapshotTaker, memo: Memo, names: frozenset[str], starts: Mapping[str, object]
) -> None:
    """Copy the knowledge of some agents into the game of a new context.

    Args:
        source: the parts of the game.
        target: the parts of the new game; its map, agents and sensors are already copies.
        memo: id of an object -> its copy, for the context, its engines, agents and sensors.
        names: the names of the agents.
        starts: agent -> its start.
    """
    source.turns.update_counts()
    start = source.state.start.snapshot
    target.ctx.agent.storage.hide(start.agents, names)
    target.ctx.sensor.storage.hide(start.sensors, names)
    copy_means(source, target, memo, **_IN_ALL_GAMES)
    teams = frozenset(one.team for name, one in source.ctx.agent.agents.items() if name in names)
    state = target.state
    state.data.update(copied(start.data, memo))
    state.copy_logs(source.state)
    state.put_known(source.state, names, teams)
    state.messages = _heard(source.state, names)
    for log in ("errors", "deeds"):
        setattr(state, log, [dict(entry) for entry in getattr(source.state, log) if entry.get("agent") in names])
    state.began = {name: place for name, place in starts.items() if name in names}
    for rule in target.rules.rules:
        prepare = rule.spec.prepare
        if prepare is not None and rule.spec.disclose is None:  # it may draw random state that no agent knows
            prepare(target.ctx)
    state.put_known(source.state, names, teams)
    for name in filter(names.__contains__, source.state.memories):
        state.memory_of(name)  # also of agents that remember nothing
    for rule in source.rules.rules:
        disclose = rule.spec.disclose
        if disclose is not None:
            _put_in(state.data, copied(disclose(source.state.data, names), memo))
    state.stream_version += 1


def _put_in(values: dict[Any, Any], known: Mapping[Any, Any]) -> None:
    """Merge values into others, recursively for dicts."""
    for key, value in known.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            _put_in(values[key], value)
        else:
            values[key] = value


def _heard(state: GameState, names: frozenset[str]) -> list[dict[str, Any]]:
    """Return the messages that agents have sent or heard, without their outcomes for other agents and later turns."""
    known = []
    now = state.turn + 1
    for entry in state.messages:
        heard = {
            key: {name: turn for name, turn in entry[key].items() if name in names and turn <= now} for key in ARRIVALS
        }
        if entry["sender"] in names or any(heard.values()):
            known.append({**entry, **heard, "lost": [], "jammed": []})
    return known
