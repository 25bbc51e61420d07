"""What `ctx.game` and the context's own chance have come to, as plain values, and back again."""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from gamms.ir import journal as kinds
from gamms.ir.journal import Log
from gamms.recorder.plain import is_same, plain, plain_part

Changes = dict[str, Any]  # of a dict: what is `set`, what is `removed`, and what lists have `more`


def captured(ctx: Any) -> dict[str, Any]:
    """What a keyframe holds of a game."""
    game = ctx.game
    return {
        "scores": list(plain(game.scores).items()),
        "data": plain_part(game.data),
        "over": plain(game.over),
        "turn": game.turn,
        "memories": _memories(game),
        "team_memories": list(_team_memories(game).items()),
        "chance": plain(ctx.chance()),
    }


def told(game: Any) -> dict[str, Any]:
    """What a snapshot has as well, and keyframes are too many for: events so far, facts, where agents began."""
    starts, settings = game.starts, game.chosen()
    return {
        "events": plain(game.events),
        **({"settings": settings} if settings else {}),
        **({"facts": plain_part(game.facts)} if game.facts else {}),
        **({"starts": plain(starts)} if starts else {}),
    }


def put(ctx: Any, state: Mapping[str, Any]) -> None:
    """Let a game be as a keyframe or a snapshot says."""
    game = ctx.game
    game.scores.clear()
    game.scores.update((key, value) for key, value in state["scores"])
    game.data.clear()
    game.data.update(deepcopy(state["data"]))
    game.take_over(state["over"])
    game.turn = int(state.get("turn", 0))
    for memory in game.memories.values():
        memory.clear()
    for name, memory in state.get("memories", {}).items():
        game.memory_of(name).update(deepcopy(memory))
    game.team_memories = dict(deepcopy(state.get("team_memories", [])))
    put_chance(ctx, state.get("chance"))
    if "events" in state:
        game.events[:] = deepcopy(state["events"])
    if "facts" in state:
        game.publish_anew(deepcopy(state["facts"]))
    if "starts" in state:
        game.began = dict(state["starts"])


def put_chance(ctx: Any, chance: Any) -> None:
    """Let the context's own random stream go on from here; None: nobody had asked for it."""
    if chance is not None:
        ctx.rng.bit_generator.state = chance


def remember(ctx: Any, data: Mapping[str, Any]) -> None:
    """Let agents and teams remember what an event says."""
    game = ctx.game
    for name, changes in data["agents"].items():
        apply(game.memory_of(name), changes)
    for team, changes in data["teams"]:
        apply(game.team_memories.setdefault(team, {}), changes)


def apply(values: dict[Any, Any], changes: Changes) -> None:
    """Change a dict as `changes` gave it."""
    values.update(deepcopy(changes["set"]))
    for key, more in changes.get("more", {}).items():
        values[key] = [*values[key], *deepcopy(more)]
    for key in changes["removed"]:
        values.pop(key, None)


def changes(now: dict[Any, Any], before: dict[Any, Any]) -> Changes | None:
    """What has changed in a dict of plain values; None if nothing has."""
    changed = {key: value for key, value in now.items() if key not in before or not is_same(value, before[key])}
    removed = [key for key in before if key not in now]
    if not changed and not removed:
        return None
    more = {key: value[len(before[key]) :] for key, value in changed.items() if _has_grown(value, before.get(key))}
    whole = {key: value for key, value in changed.items() if key not in more}
    return {"set": whole, "removed": removed, **({"more": more} if more else {})}


class GameWatch:
    """What has changed since it was asked last, in `ctx.game` and in who plays by which strategy.

    Attributes:
        pace: by how much the number of the turn went up in the last turn.
    """

    def __init__(self, ctx: Any, pace: int = 0) -> None:
        self._ctx, self._game = ctx, ctx.game
        self._events = len(ctx.game.events)
        self._scores = plain(ctx.game.scores)
        self._data = plain_part(ctx.game.data)
        self._over = plain(ctx.game.over)
        self._memories = _memories(ctx.game)
        self._team_memories = _team_memories(ctx.game)
        self._facts = dict(ctx.game.facts)
        self._chance = plain(ctx.chance())
        self._turn, self.pace = ctx.game.turn, pace
        self._places = _places(ctx)

    def count(self) -> tuple[int, Any] | None:
        """A turn is over: the event that says how the game counts it, unless it does as it did before."""
        now, before, pace = self._game.turn, self._turn, self.pace
        self.pace, self._turn = now - before, now
        if now == before + pace:
            return None
        starts = self._game.starts
        is_told = before > 0 or starts.items() <= self._places.items()
        return (kinds.GAME_TURN, {"turn": now, "pace": self.pace, **({} if is_told else {"starts": plain(starts)})})

    def tell(self, log: Log) -> None:
        """Add the events that say what else has changed."""
        game = self._game
        if len(game.events) != self._events:
            log += [(kinds.GAME_EVENT, plain(event)) for event in game.events[self._events :]]
            self._events = len(game.events)
        if game.scores != self._scores:
            self._scores = plain(game.scores)
            log.append((kinds.GAME_SCORES, {"scores": list(self._scores.items())}))
        if game.data or self._data:
            now, before = plain_part(game.data), self._data
            self._data = now
            if (found := changes(now, before)) is not None:
                log.append((kinds.GAME_DATA, found))
        if game.over != self._over:
            self._over = plain(game.over)
            log.append((kinds.GAME_OVER, self._over or {}))
        if game.facts != self._facts:
            log.append(self._new_facts())
        if self._memories or self._team_memories or game.team_memories or any(game.memories.values()):
            log += self._new_memories()
        if (chance := self._ctx.chance()) is not None and not is_same(chance, self._chance):
            self._chance = plain(chance)
            log.append((kinds.GAME_CHANCE, {"chance": self._chance}))

    def _new_facts(self) -> tuple[int, Any]:
        before, now = self._facts, dict(self._game.facts)
        self._facts = now
        changed = {name: fact for name, fact in now.items() if name not in before or before[name] != fact}
        removed = [name for name in before if name not in now]
        return (kinds.GAME_FACTS, {"set": plain_part(changed), "removed": removed})

    def _new_memories(self) -> Log:
        before, self._memories = self._memories, _memories(self._game)
        agents = _each(self._memories, before)
        known, self._team_memories = self._team_memories, _team_memories(self._game)
        teams = list(_each(self._team_memories, known).items())
        return [(kinds.GAME_MEMORY, {"agents": agents, "teams": teams})] if agents or teams else []


def _each(now: dict[Any, Any], before: dict[Any, Any]) -> dict[Any, Changes]:
    """What has changed in each of several dicts."""
    found = {key: changes(now.get(key, {}), before.get(key, {})) for key in {**now, **before}}
    return {key: one for key, one in found.items() if one is not None}


def _memories(game: Any) -> dict[str, dict[Any, Any]]:
    return {name: plain_part(memory) for name, memory in sorted(game.memories.items()) if memory}


def _team_memories(game: Any) -> dict[Any, dict[Any, Any]]:
    return {plain(team): plain_part(memory) for team, memory in game.team_memories.items() if memory}


def _places(ctx: Any) -> dict[str, Any]:
    """Where the agents are: nodes, or (x, y, z) of those who fly."""
    columns = ctx.agent.columns
    at = (node if position is None else position for node, position in zip(columns.node, columns.position, strict=True))
    return dict(zip(columns.names, at, strict=True))


def _has_grown(now: Any, before: Any) -> bool:
    """Whether a list is what it was and more."""
    if type(now) is not list or type(before) is not list or not before or len(now) <= len(before):
        return False
    return all(map(is_same, now, before))
