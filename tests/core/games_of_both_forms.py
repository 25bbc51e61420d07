"""Random games in which agents seek, meet and stop each other, and send messages.

Run as a program, it prints what becomes of them.
"""

import json
import logging
import sys
from random import Random

from gamms.graph import grid
from gamms.scenario import Scenario
from gamms.solve import pursuit

RADIOS = [
    {"range_m": 15.0, "loss": [[0, 0.1], [15, 0.7]]},
    {"range_m": 12.0, "relay": True, "loss": 0.4, "jammers": [{"agent": "red_0", "radius_m": 9}]},
    {"hops": 1, "relay": ["red"], "delay_turns": 2, "eavesdroppers": ["blue_0"], "jammers": [{"at": 1, "radius_m": 8}]},
]
NEARNESS = [{}, {"hops": 1}, {"metres": 10.0}, {"metres": 1e300}, {"euclid": 14.2}, {"passing": False}]


def talk(state):
    """Send something to all and to the red team, and go to a random place."""
    state["outbox"] += [{"channel": "radio", "to": to, "body": len(state["inbox"])} for to in (None, "red")]
    state["action"] = state["legal"][state["draw"].below(len(state["legal"]))]


def scenario_of(number):
    """Return a random scenario."""
    rng = Random(number)
    is_metric = rng.random() < 0.3
    speeds = [7.0, 12.5] if is_metric else [1, 3]
    walks = rng.random() < 0.5
    team = {"count": rng.randint(1, 4), "strategy": "gamms.strategies:random_waypoints", "speed": rng.choice(speeds)}
    if walks:  # compiled, the core plays a batch of these, and arrays do not
        strategy = rng.choice(["random_walk", "random_waypoints"]) if is_metric else "random_walk"
        team = {"count": rng.randint(1, 4), "strategy": f"gamms.strategies:{strategy}"}
        team |= {"speed": rng.choice([0.5, *speeds])} if is_metric else {}
    elif rng.random() < 0.5:  # agents that look around go along one edge in a turn
        is_metric = False
        team = {"count": rng.randint(1, 4), "strategy": "gamms.strategies:chase", "sensors": ["near", "eyes"]}
    eyes = {"type": rng.choice(["agent_range", "agent_arc"]), "sensor_range": rng.choice([0.0, 10.0, 25.0, 1e300])}
    hunters = team | {"sensors": ["near", "seen"]}
    if not walks:
        hunters["strategy"] = rng.choice([team["strategy"], "gamms.strategies:follow_belief"])
    seen = {"type": "AGENT_RANGE", "sensor_range": 10.0, "detection": 0.7}
    tag = {"taggers": "red", "tagged": "blue", "then": rng.choice(["respawn", "eliminate"])} | rng.choice(NEARNESS)
    decide = rng.choice(["turn", "arrival"]) if is_metric else "turn"
    allows_swaps = decide == "arrival" or rng.random() < 0.5
    return Scenario(
        max_turns=8,
        sensors={"near": {"type": "neighbor"}, "eyes": eyes, "seen": seen},
        map={"grid": {"width": rng.randint(3, 5), "height": 3}},
        teams={"red": hunters, "blue": team},
        rules=[
            {"rule": "tag", "with": tag},
            {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 5}, "goal": rng.choice([None, 1])}},
            {"rule": "respawn", "with": {"after": 2}},
            {"rule": "time_limit", "with": {"turns": rng.randint(5, 9)}},
        ],
        channels={} if walks else {"radio": rng.choice(RADIOS)},
        conflicts={"capacity": rng.randint(1, 3), "allow_swaps": allows_swaps},
        settings={"speed_unit": "metres", "decide": decide} if is_metric else {},
    )


def results_of(number):
    """Return what becomes of a random game alone, and of two in a batch, and what agents observe in these, as text."""
    scenario = scenario_of(number)
    talking = {"blue": talk} if number % 2 and scenario.to_dict().get("channels") else {}
    with scenario.batch(2, seed=number, strategies=talking) as games:
        first = games.observe("red").vector().values
        games.run()
        results = [scenario.play(number, strategies=talking), *map(games.result, range(2))]
        last = games.observe("blue").vector().values
    told = [result.to_dict() for result in results]
    for one in told:
        del one["timings"], one["provenance"]["strategies"]
    observed = [one.tolist() for one in (first, last)]
    return json.dumps([told, observed], default=str, sort_keys=True)


def pursuit_of(first):
    """Return how all positions of a pursuit end."""
    return pursuit(grid(3, 4), pursuers=2, exits=[0, 7], moves_first=first).outcomes.codes.tolist()


def all_results():
    """Return those of all games."""
    logging.getLogger("gamms").setLevel(logging.ERROR)
    return [results_of(number) for number in range(16)] + [pursuit_of(first) for first in ("pursuers", "evader")]


if __name__ == "__main__":
    sys.stdout.write(json.dumps(all_results()))
