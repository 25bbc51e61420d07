"""What a fork holds of a game for agents that look ahead: what they know, and the start values of all else.

Who may know of a part of the game is what the table of events says (`ir/events.py`): lives, teams, scores, events and
facts are public; moves, speeds, attributes, memories and what rules remember are not. The fields of `GameState` say by
which axis agents know them (`ir/schema.py`).
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
        if prepare is not None and rule.spec.disclose is None:  # it may draw at random what no agent knows
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
    """Write values into others, also into the dicts among them."""
    for key, value in known.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            _put_in(values[key], value)
        else:
            values[key] = value


def _heard(state: GameState, names: frozenset[str]) -> list[dict[str, Any]]:
    """Return the messages that agents have sent or heard, without what became of them elsewhere and later."""
    known, now = [], state.turn + 1
    for entry in state.messages:
        heard = {
            key: {name: turn for name, turn in entry[key].items() if name in names and turn <= now} for key in ARRIVALS
        }
        if entry["sender"] in names or any(heard.values()):
            known.append({**entry, **heard, "lost": [], "jammed": []})
    return known
