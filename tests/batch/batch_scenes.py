"""Scenarios to play in batches, and results to compare."""

import numpy as np

import gamms
from gamms.game.cursor.separate_games import SeparateGames
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
    """Return a scenario with the same games, played in contexts of their own because of a rule like `UNUSED`."""
    rules = scenario.to_dict().get("rules", [])
    return scenario.replace(rules=[*rules, {"rule": "resource", "with": {"name": "unused", "start": 1}}])


UNUSED = resource("unused", 1)
"""A rule because of which tests let games continue in contexts of their own: see `SeparateUnused`."""
BEYOND = "the rule 'resource'"
"""Why games with this rule are not played in the core."""


class SeparateUnused(SeparateGames):
    """The games in contexts of their own, with all games that have the rule `UNUSED`."""

    def __init__(self, engine, *args):
        games = [one.game for one in engine._maps]
        has_unused = any("unused" in repr(one.rule) for game in games for one in game.rules)
        self._unused = range(len(engine.is_over)) if has_unused else ()
        self._first_turn = games[0].turn
        super().__init__(engine, *args)
        self._add_unused()

    def _add_unused(self):
        for number in self._unused:
            if number not in self:
                self.add(number, BEYOND, self._first_turn)

    def forget(self, numbers):
        super().forget(numbers)
        self._add_unused()


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
