"""What a scenario has put into a game, told apart from what was changed since: to draw it again for another seed."""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, NamedTuple

from gamms.plain import is_same


class Values(NamedTuple):
    """The values of a game before its first turn."""

    facts: dict[str, Any]
    data: dict[str, Any]
    scores: dict[Any, float]
    events: list[dict[str, Any]]


def values_of(game: Any) -> Values:
    """Return copies of what a game holds now."""
    return Values(dict(game.facts), deepcopy(game.data), dict(game.scores), [dict(event) for event in game.events])


def take_out(game: Any, built: Values) -> tuple[Values, list[str]]:
    """Empty a game; return what was added or changed since it held `built`, and which keys of `data` were removed."""
    now = values_of(game)
    removed = [key for key in built.data if key not in now.data]
    game.state.facts.clear()
    game.data.clear()
    game.scores.clear()
    game.events.clear()
    return Values(
        {name: fact for name, fact in now.facts.items() if fact is not built.facts.get(name)},
        _changed(now.data, built.data),
        _changed(now.scores, built.scores),
        now.events[len(built.events) :],
    ), removed


def put_back(game: Any, changed: Values, removed: list[str]) -> None:
    """Make the changes that `take_out` has returned."""
    game.publish(**changed.facts)
    game.data.update(changed.data)
    for key in removed:
        game.data.pop(key, None)
    game.scores.update(changed.scores)
    game.events.extend(changed.events)


def move_start(agent: Any, before: Any, now: Any) -> None:
    """Let an agent begin elsewhere, unless it is not where it was put: nodes, or (x, y, z)."""
    flies = isinstance(now, tuple)
    if (agent.position if flies else agent.current_node_id) != before:
        return
    if flies:
        agent.position = now
        agent.position = now  # as if it had been there before, too
    else:
        agent.current_node_id = agent.prev_node_id = now


def _changed(now: Mapping[Any, Any], built: Mapping[Any, Any]) -> dict[Any, Any]:
    return {key: value for key, value in now.items() if key not in built or not is_same(value, built[key])}
