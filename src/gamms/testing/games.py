"""Games that are played for a check: the same one several times, and how two differ."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

_WHERE = "where (check)"  # the name of the collector


class Play:
    """A game that can be played again from the beginning.

    Attributes:
        make_ctx: makes the context.
        turns: how long it is played.
    """

    def __init__(self, make_ctx: Callable[..., Any], rule: Callable[[Any], Any] | None, turns: int) -> None:
        self.make_ctx, self.turns = make_ctx, turns
        self._rule = rule

    @contextmanager
    def opened(self, *, with_rule: bool = True, **keywords: Any) -> Iterator[Any]:
        """A context with the rule, ready to be played."""
        with self.make_ctx(**keywords) as ctx:
            if ctx.is_terminated():
                raise AssertionError("make_ctx must make a new context at every call; this one has ended already.")
            if not ctx.is_seeded:
                raise AssertionError("make_ctx must give its context a seed: gamms.create_context(seed=…).")
            ctx.game.collect(_WHERE, _place_of, per="agent")
            if with_rule and self._rule is not None:
                ctx.game.add(self._rule)
            yield ctx

    def once(self, *, with_rule: bool = True, **keywords: Any) -> dict[str, Any]:
        """What has come of it."""
        with self.opened(with_rule=with_rule, **keywords) as ctx:
            return collected(ctx, self.turns)

    def trust(self) -> None:
        """See to it that what differs later is not the fault of `make_ctx`."""
        one, other = self.once(with_rule=False), self.once(with_rule=False)
        if one != other:
            raise AssertionError(
                "make_ctx must always make the same game, and two that it made went differently: "
                f"{first_difference(one, other)} Do its strategies draw from state['rng']?"
            )


def collected(ctx: Any, turns: int) -> dict[str, Any]:
    """Play on, and tell all that can be seen of the game."""
    found: dict[str, Any] = ctx.game.run(turns).to_dict()
    del found["timings"]
    return found


def first_difference(one: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """Where two games part, in a sentence."""
    seen = [_by_turn(game["collected"][_WHERE]) for game in (one, other)]
    for turn in sorted(seen[0].keys() & seen[1].keys()):
        for agent in sorted(seen[0][turn].keys() | seen[1][turn].keys()):
            before, now = (places[turn].get(agent, "gone") for places in seen)
            if before != now:
                return f"after turn {turn}, agent {agent!r} is at {now}, and was at {before}."
    for key in one:
        if one[key] != other[key]:
            return f"its {key} is {_short(other[key])}, and was {_short(one[key])}."
    return ""


def _place_of(agent: Any) -> Any:
    return getattr(agent, "position", agent.current_node_id)


def _by_turn(table: Mapping[str, Any]) -> dict[int, dict[str, Any]]:
    places: dict[int, dict[str, Any]] = {}
    for turn, agent, place in zip(table["turn"], table["agent"], table["value"], strict=True):
        places.setdefault(turn, {})[agent] = place
    return places


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."
