"""What has changed in a game since it was recorded last, as events."""

from collections.abc import Callable, Mapping
from marshal import dumps
from operator import is_not
from typing import Any

from gamms.ir import events as kinds
from gamms.ir.events import Log
from gamms.plain import is_same, plain_subset, to_plain
from gamms.recorder.keyframes import places_of

Changes = dict[str, Any]  # of a dict: what is `set`, what is `removed`, and what lists and sets have `more`

_NO_REFERENCES = 2  # the last version of marshal that writes a value whether or not it was written before
_MARKED = (bool, int, float, str, bytes, type(None), list, tuple, set, frozenset, dict)
_NUMBERS = (int, float)
_HEAD = 5  # bytes before the items of a list: its type and length


class Kept:
    """The plain part of a dict as it was, for comparing.

    Attributes:
        values: the plain part.
    """

    __slots__ = ("_marks", "values")

    def __init__(self, now: Mapping[Any, Any]) -> None:
        self.values = plain_subset(now)
        self._marks = {key: _mark(value) for key, value in now.items()}

    def changes(self, now: Mapping[Any, Any]) -> Changes | None:
        """What has changed since it was asked last; None if nothing has."""
        # NOTE: marks are compared first, which costs a fifth, because this is asked of every memory in every turn.
        marks = {key: _mark(value) for key, value in now.items()}
        changed = {key: now[key] for key, mark in marks.items() if mark is None or mark != self._marks.get(key)}
        if not changed and len(now) == len(self._marks):
            return None
        found: Changes = {"set": {}, "more": {}, "removed": [key for key in self.values if key not in now]}
        for key, value in changed.items():
            more = self._more(key, value, marks[key])
            if more is not None:
                found["more"][key] = more
                self.values[key] = self.values[key] | more if isinstance(more, set) else [*self.values[key], *more]
            else:
                self._note(key, value, found)
        for key in found["removed"]:
            del self.values[key]
        self._marks = marks
        return {name: one for name, one in found.items() if one} or None

    def _more(self, key: Any, value: Any, mark: bytes | None) -> Any:
        """What has been added to a list or a set; None if it is not that."""
        if type(value) not in (list, set) or mark is None:
            return None
        known: Any = self.values.get(key)
        before = self._marks.get(key)
        if type(known) is not type(value) or not known or before is None or len(value) <= len(known):
            return None
        if type(value) is list and mark.startswith(before[_HEAD:], _HEAD):
            return to_plain(value[len(known) :])
        return to_plain(value - known) if type(value) is set and known <= value else None

    def _note(self, key: Any, value: Any, found: Changes) -> None:
        """Take a value that may have changed."""
        for name, one in plain_subset({key: value}).items():
            if name not in self.values or not is_same(one, self.values[name]):
                found["set"][name] = self.values[name] = one
            return
        if key in self.values:  # it is not plain any longer
            found["removed"].append(key)


def _mark(value: Any) -> bytes | None:
    """Bytes that are others for another value; None where there are no such."""
    if type(value) not in _MARKED:  # an array, for example, of which marshal keeps the bytes and not the shape
        return None
    try:
        return dumps(value, _NO_REFERENCES)
    except ValueError:
        return None


class GameWatch:
    """What has changed since it was asked last, in `ctx.game` and the chance of its context.

    Attributes:
        pace: by how much the number of the turn went up in the last turn.
    """

    def __init__(self, ctx: Any) -> None:
        self._ctx, self._game, self._state = ctx, ctx.game, ctx.game.state
        self._events = len(ctx.game.events)
        self._scores = to_plain(ctx.game.scores)
        self._data = Kept(ctx.game.data)
        self._over = to_plain(ctx.game.over)
        self._memories = {name: Kept(memory) for name, memory in ctx.game.memories.items() if memory}
        self._team_memories = {team: Kept(memory) for team, memory in ctx.game.team_memories.items() if memory}
        self._facts = ctx.game.facts.copy()
        self._chance = to_plain(ctx.rng_state())
        self._turn, self.pace = self._state.turn, 0
        self._places = places_of(ctx)

    def accept(self, kind: int, data: Any) -> None:
        """Expect what an event of a replay has changed."""
        if kind in _ACCEPTED:
            _ACCEPTED[kind](self, data)

    def _accept_turn(self, data: Any) -> None:
        self._turn, self.pace = self._state.turn, int(data["pace"])

    def _accept_memories(self, data: Any) -> None:
        for name in data["agents"]:
            self._memories[name] = Kept(self._state.memories[name])
        for team, _ in data["teams"]:
            self._team_memories[team] = Kept(self._state.team_memories[team])

    def _accept_rest(self, _: Any) -> None:
        game = self._state
        self._events, self._scores, self._over = len(game.events), to_plain(game.scores), to_plain(game.over)
        self._facts, self._chance = game.facts.copy(), to_plain(self._ctx.rng_state())

    def _accept_data(self, _: Any) -> None:
        self._data = Kept(self._state.data)

    def count(self, log: Log) -> None:
        """A turn is over: add the event that says how the game counts it, unless it does as it did before."""
        now, before, pace = self._state.turn, self._turn, self.pace
        if now == before + pace:
            self._turn = now
            return
        self.pace, self._turn = now - before, now
        starts = self._game.starts
        is_told = before > 0 or starts.items() <= self._places.items()
        log.append(
            (kinds.GAME_TURN, {"turn": now, "pace": self.pace, **({} if is_told else {"starts": to_plain(starts)})})
        )

    def tell(self, log: Log) -> None:
        """Add the events that say what else has changed."""
        # NOTE: most games have no scores, facts or data, and are asked in every turn (benchmarks/README.md, w4).
        game = self._state
        events, scores, data, over, facts = game.events, game.scores, game.data, game.over, game.facts
        memories, team_memories = game.memories, game.team_memories
        if len(events) != self._events:
            log += [(kinds.GAME_EVENT, to_plain(event)) for event in events[self._events :]]
            self._events = len(events)
        if (scores or self._scores) and _is_other(scores, self._scores):
            self._scores = to_plain(scores)
            log.append((kinds.GAME_SCORES, {"scores": list(self._scores.items())}))
        if (data or self._data.values) and (found := self._data.changes(data)) is not None:
            log.append((kinds.GAME_DATA, found))
        if over is not None or self._over is not None:
            log += self._new_end(over)
        known = self._facts
        if (facts or known) and (facts.keys() != known.keys() or any(map(is_not, facts.values(), known.values()))):
            log += self._new_facts(dict(facts))
        has_memories = memories and any(memories.values())
        if has_memories or team_memories or self._memories or self._team_memories:
            log += self._new_memories()
        if (chance := self._ctx.rng_state()) is not None and not is_same(chance, self._chance):
            self._chance = to_plain(chance)
            log.append((kinds.GAME_CHANCE, {"chance": self._chance}))

    def _new_end(self, over: dict[str, Any] | None) -> Log:
        before, self._over = self._over, to_plain(over)
        return [] if is_same(before, self._over) else [(kinds.GAME_OVER, self._over or {})]

    def _new_facts(self, now: dict[str, Any]) -> Log:
        before, self._facts = self._facts, now
        changed = {
            name: fact
            for name, fact in now.items()
            if name not in before or not (fact is before[name] or is_same(to_plain(fact), to_plain(before[name])))
        }
        removed = [name for name in before if name not in now]
        return [(kinds.GAME_FACTS, {"set": plain_subset(changed), "removed": removed})] if changed or removed else []

    def _new_memories(self) -> Log:
        agents = _each(self._game.memories, self._memories)
        teams = list(_each(self._game.team_memories, self._team_memories).items())
        return (
            [(kinds.GAME_MEMORY, {"agents": agents, "teams": [(to_plain(team), one) for team, one in teams]})]
            if agents or teams
            else []
        )


_ACCEPTED: dict[int, Callable[[GameWatch, Any], None]] = {
    **dict.fromkeys((kinds.GAME_EVENT, kinds.GAME_SCORES, kinds.GAME_OVER), GameWatch._accept_rest),
    **dict.fromkeys((kinds.GAME_FACTS, kinds.GAME_CHANCE), GameWatch._accept_rest),
    kinds.GAME_DATA: GameWatch._accept_data,
    kinds.GAME_TURN: GameWatch._accept_turn,
    kinds.GAME_MEMORY: GameWatch._accept_memories,
}


def _is_other(scores: Mapping[Any, Any], before: Any) -> bool:
    """Whether scores are others than `plain` gave them, arrays among them, too."""
    if all(type(score) in _NUMBERS for score in scores.values()):
        return bool(scores != before)
    return not is_same(to_plain(scores), before)


def _each(now: Mapping[Any, dict[Any, Any]], kept: dict[Any, Kept]) -> dict[Any, Changes]:
    """What has changed in each of several dicts."""
    found = {}
    for key in sorted(now) if all(type(key) is str for key in now) else now:
        if now[key] or key in kept:
            changes = kept.setdefault(key, Kept({})).changes(now[key])
            if changes is not None:
                found[key] = changes
    for key in [key for key in kept if key not in now]:
        found[key] = {"removed": list(kept.pop(key).values)}
    return found
