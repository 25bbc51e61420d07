"""Scenarios to play in batches, and results to compare."""

from dataclasses import replace

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


def part(ctx):
    """Let a game follow another plan from its first turn on: add a rule, which does nothing."""
    if all(rule.name != "parted" for rule in ctx.game.rules):
        ctx.game.add(do_nothing, name="parted")


def do_nothing(ctx):
    """Do nothing; a rule."""


def by_another_plan(scenario):
    """Return a scenario with the same games, which follow another plan from their first turn on; see `part`."""
    given = scenario.to_dict()
    given["rules"] = [{"rule": f"{__name__}:part", "phase": "before"}, *given.get("rules", [])]
    return Scenario(**given, folder=scenario.folder, allow=[*scenario.allow, __name__])


WAYS = [as_it_is, by_another_plan]


def assert_as_shown(games):
    """Check that each game is that of the context that shows it, where it is played alone with the same actions."""
    for number in range(len(games)):
        assert plain(games.result(number)) == plain(games.context(number).game.result())


def plain(result):
    """All of a result but what says how it was played."""
    return replace(result, timings={}, provenance={}).to_dict()


def assert_as_alone(games, alone):
    """Check that each game of a batch is that of its seed, played alone in a context."""
    for number, seed in enumerate(games.seeds):
        alone.game.reset(seed=seed)
        assert plain(games.result(number)) == plain(alone.game.run())


def assert_as_played(games, scenario, strategies=None, maps=None):
    """Check that each game of a batch is the one that a scenario plays with its seed, on its map."""
    for number, seed in enumerate(games.seeds):
        alone = scenario if maps is None else scenario.replace(map=maps[games.maps[number]])
        assert plain(games.result(number)) == plain(alone.play(seed=seed, strategies=strategies))


def check_games(ctx, *args, play=lambda games: games.run(), **options):
    """Check that the games of a batch of a game are those played alone; return their results."""
    with ctx.game.batch(*args, **options) as games, ctx.game.fork(0).ctx as alone:
        play(games)
        assert_as_alone(games, alone)
        return [games.result(number) for number in range(len(games))]
