"""Scenarios to play in batches, and results to compare."""

import numpy as np

import gamms
from gamms.game.batch.arrays import ArrayEngine
from gamms.game.batch.state import NotInCore
from gamms.rules import resource
from gamms.scenario import Scenario

WALK = "gamms.strategies:random_walk"


def scene(rules=(), red=3, blue=3, side=5, max_turns=12, **more):
    """A scenario of two teams that walk about on a grid."""
    teams = {"red": {"count": red, "strategy": WALK}, "blue": {"count": blue, "strategy": WALK}}
    given = {"map": {"grid": {"width": side, "height": side}}, "teams": teams, "rules": list(rules), **more}
    return Scenario(max_turns=max_turns, **given)


def as_it_is(scenario):
    """Return a scenario whose games are played in the core."""
    return scenario


def beyond_core(scenario):
    """Return a scenario with the same games, played one after the other because of a rule like `UNUSED`."""
    rules = scenario.to_dict().get("rules", [])
    return scenario.replace(rules=[*rules, {"rule": "resource", "with": {"name": "unused", "start": 1}}])


UNUSED = resource("unused", 1)
"""A rule that tests take for one that the core does not have: see `EngineWithoutUnused`."""
BEYOND = "the rule 'resource'"
"""Why games with this rule are not played in the core."""


class EngineWithoutUnused(ArrayEngine):
    """The engine of games in the core, which cannot take up the rule `UNUSED`."""

    def __init__(self, games, *args):
        if any("unused" in repr(one.rule) for game in games for one in game.rules):
            raise NotInCore(BEYOND)
        super().__init__(games, *args)


WAYS = [as_it_is, beyond_core]


def assert_as_shown(games):
    """Check that each game is that of the context that shows it, where it is played alone with the same actions."""
    for number in range(len(games)):
        assert plain(games.result(number)) == plain(games.context(number).game.result())


def plain(result):
    """All of a result but what says how it was played."""
    values = result.to_dict()
    for name in ("timings", "provenance"):
        del values[name]
    return values


@gamms.array_strategy
def shadow(view):
    """Fly to the last agent of another team that is seen."""
    seen, ways = view.enemies(), np.ones((*view.node.shape, 3))
    x, y = view.streets.axes
    ways[seen.at, seen.viewers, 0] = x[seen.nodes] - view["xy"][seen.at, seen.viewers, 0]
    ways[seen.at, seen.viewers, 1] = y[seen.nodes] - view["xy"][seen.at, seen.viewers, 1]
    return ways
