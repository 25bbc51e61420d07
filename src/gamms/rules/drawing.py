"""How rules are drawn: flags, territories, tags, in the colours of the teams.

What has to be known for that is in `ctx.game.data`, so that a recording holds it; the drawers are in `gamms.visual`,
and draw a replay like the game itself.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gamms.typing.game import Rule
from gamms.visual.drawers.rules import as_text


def equipped(rule: Rule, **extras: Any) -> Rule:
    """A rule with what `ctx.game.add` looks for: `prepare(ctx)`, called at once, and `drawer(ctx, data)`."""
    rule.__dict__.update(extras)
    return rule


def packed(territory: Mapping[int, Any]) -> dict[Any, str]:
    """A territory as the ids of each team's nodes, as text."""
    owned: dict[Any, list[int]] = {}
    for node, team in territory.items():
        if team is not None:
            owned.setdefault(team, []).append(node)
    return {team: as_text(np.array(sorted(nodes), np.int64)) for team, nodes in owned.items()}
