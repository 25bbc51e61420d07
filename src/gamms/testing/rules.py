"""Does a rule play fair: the same game every time, whoever was created first?"""

from collections.abc import Callable
from inspect import signature
from typing import Any

from gamms.plain import why_not_plain
from gamms.testing.games import Play, collected, first_difference

_ORDERS = (1, 2)  # seeds by which agents are shuffled


def check_rule(rule: Callable[[Any], Any], make_ctx: Callable[..., Any], *, turns: int = 30) -> None:
    """Play with a rule, again and again, and see to it that every game is the same.

    It finds what a rule remembers elsewhere than in `ctx.game.data`, what it draws otherwise than from `ctx.stream`,
    what it keeps there that is not plain, and whom it treats differently because of the order of creation.

    Args:
        rule: as it would be given to `ctx.game.add`.
        make_ctx: makes a context, always the same, with a seed, a map and agents that meet what the rule is about, but
            without the rule. If it takes the keyword `shuffled`, it is also called with a seed by which to shuffle the
            order in which the agents are created, for example with `random.Random(shuffled).shuffle(names)`; None
            leaves the order as it is.
        turns: how long each game is played.

    Raises:
        AssertionError: a game went differently; the message says which, and what to do about it.
    """
    play = Play(make_ctx, rule, turns)
    play.trust()
    first = play.once()
    for promise in (_restarts, _is_forgotten, _shares, _ignores_order):
        promise(play, first)


def _restarts(play: Play, first: Any) -> None:
    with play.opened() as ctx:
        ctx.game.run(play.turns)
        flaw = why_not_plain(dict(ctx.game.data))
        _expect(not flaw, f"ctx.game.data holds plain values only; ctx.game.data{flaw}. Keep names of agents.")
        ctx.game.reset()
        again = collected(ctx, play.turns)
    _same(
        "a game that is reset and played again",
        again,
        first,
        "Keep what the rule remembers in ctx.game.data, and draw from ctx.stream(name, ctx.game.turn).",
    )


def _is_forgotten(play: Play, first: Any) -> None:
    _same(
        "a new game with the same rule",
        play.once(),
        first,
        "The rule remembers earlier games: keep that in ctx.game.data, not in a global, a default or a closure.",
    )


def _shares(play: Play, first: Any) -> None:
    with play.opened() as one, play.opened() as other:
        for _ in range(play.turns):
            one.game.run(1)
            other.game.run(1)
        _same(
            "a game that takes turns with another one of the same rule",
            collected(one, 0),
            first,
            "The rule mixes games up: keep what it remembers in the ctx.game.data of the context it is called with.",
        )


def _ignores_order(play: Play, first: Any) -> None:
    if "shuffled" not in signature(play.make_ctx).parameters:
        return
    for seed in _ORDERS:
        _same(
            f"the game with the agents created in another order (shuffled={seed})",
            play.once(shuffled=seed),
            first,
            "Go through ctx.game.agents, which is in the order of the names, and judge all before moving any.",
        )


def _same(what: str, seen: Any, promised: Any, advice: str) -> None:
    if seen != promised:
        raise AssertionError(f"{what} went differently: {first_difference(promised, seen)} {advice}")


def _expect(is_kept: bool, promise: str) -> None:
    if not is_kept:
        raise AssertionError(promise)
