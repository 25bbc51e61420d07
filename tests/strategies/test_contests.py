"""Each strategy beats a weaker one and is beaten by a stronger one, in the game of `gamms new`; fixed seeds."""

from functools import cache
from pathlib import Path

import pytest
import yaml

import gamms
from gamms.scenario import Scenario

SEEDS, FEW = range(6), range(2)
EXITS = [19, 299]  # two corners


def of(name, **arguments):
    return {"function": f"gamms.strategies:{name}", "with": arguments} if arguments else f"gamms.strategies:{name}"


def searching(name, way, **arguments):
    return of(name, otherwise={"function": f"gamms.strategies:{way}", "with": arguments})


PURSUERS = {
    "random_walk": of("random_walk"),
    "chase": of("chase"),
    "chase and sweep": searching("chase", "sweep", repeat=True),
    "chase and random_waypoints": searching("chase", "random_waypoints"),
    "intercept and sweep": searching("intercept", "sweep", repeat=True),
    "assign and sweep": searching("assign", "sweep", repeat=True),
    "follow_belief": of("follow_belief"),
    "intercept with goals": of("intercept", goals=EXITS),
    "guard": None,  # of each exit one
}
EVADERS = {
    "random_walk": of("random_walk"),
    "random_waypoints": of("random_waypoints"),
    "mix": of("mix", p=0.8, a={"function": "gamms.strategies:flee"}, b={"function": "gamms.strategies:random_walk"}),
    "flee": searching("flee", "random_walk"),
    "patrol": of("patrol", nodes=EXITS),
    "safest_exit": of("safest_exit", exits=EXITS),
}


def pursuit(pursuers, evaders):
    """The game that comes with GAMMS: three pursuers tag two evaders, who see as far as they do."""
    raw = yaml.safe_load(
        (Path(gamms.__file__).parent / "data" / "gallery" / "pursuit.yaml").read_text(encoding="utf-8")
    )
    for team, strategy in (("pursuers", PURSUERS[pursuers]), ("evaders", EVADERS[evaders])):
        raw["teams"][team]["strategy"] = strategy
    if evaders == "flee":
        raw["rules"][-1]["with"]["turns"] = 50  # after which those that do not look out are all caught
    return raw


def escape(pursuers, evaders):
    """The same map with two exits in the east; one evader in the west, two pursuers between."""
    raw = pursuit(pursuers, evaders)
    raw["teams"]["pursuers"] |= {"count": 2, "near": [120, 70], "within": 60}
    if pursuers == "guard":
        raw["teams"]["pursuers"] = {
            "sensors": raw["teams"]["evaders"]["sensors"],
            "agents": [{"name": f"g{e}", "node": e, "strategy": of("guard", node=e, radius=60)} for e in EXITS],
        }
    raw["teams"]["evaders"] |= {"count": 1, "near": [30, 70], "within": 60}
    del raw["teams"]["evaders"]["from"]
    raw["rules"].insert(1, {"rule": "reach", "with": {"team": "evaders", "nodes": EXITS}})
    raw["rules"][-1]["with"]["winner"] = "pursuers"
    return raw


@cache
def wins(game, pursuers, evaders, seeds=SEEDS):
    """How often the pursuers win."""
    scenario = Scenario(**game(pursuers, evaders))
    results = [scenario.play(seed=seed) for seed in seeds]
    assert not any(result.errors for result in results)
    return sum(result.winner == "pursuers" for result in results)


@pytest.mark.parametrize(
    "pursuers",
    ["chase and sweep", "chase and random_waypoints", "intercept and sweep", "assign and sweep", "follow_belief"],
)
def test_pursuers_catch_evaders_that_do_not_look_out_and_none_that_flee(pursuers):
    assert wins(pursuit, pursuers, "random_waypoints", FEW) == len(FEW)
    assert wins(pursuit, pursuers, "mix", FEW) >= wins(pursuit, "random_walk", "mix", FEW) + 2
    assert wins(pursuit, pursuers, "flee", FEW) == 0


def test_evaders_reach_the_exit_that_is_safe_where_the_nearest_is_not():
    assert wins(escape, "chase", "safest_exit") <= 1
    assert wins(escape, "chase", "patrol") >= 2
    assert wins(escape, "guard", "safest_exit") >= 5


def test_pursuers_that_know_the_exits_cut_evaders_off():
    many = range(24)
    assert wins(escape, "intercept with goals", "patrol", many) >= wins(escape, "chase", "patrol", many) + 2
    assert wins(escape, "intercept with goals", "safest_exit") <= 1
