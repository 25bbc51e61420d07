"""What a rule may carry besides its function, for `ctx.game.add`."""

from collections.abc import Callable, Hashable, Sequence
from typing import TypedDict, TypeVar, Unpack

from gamms.context import Context

R = TypeVar("R", bound=Callable[[Context], object])


class Hooks(TypedDict, total=False):
    """Attributes of a rule that `ctx.game.add` looks for."""

    prepare: Callable[[Context], object]
    """Called when the rule is added."""
    drawer: Callable[..., object]
    """Draws the rule: `drawer(ctx, data)`. What it needs is in `ctx.game.data`, so that replays are drawn alike."""
    teams: Sequence[Hashable]
    """The teams that the rule names; one without agents is warned about."""


def with_hooks(rule: R, **hooks: Unpack[Hooks]) -> R:
    """Return a rule with what `ctx.game.add` looks for."""
    rule.__dict__.update(hooks)
    return rule
