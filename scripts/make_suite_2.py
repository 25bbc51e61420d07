"""Write the tasks of version 2 of the suite: pursuits on districts of the test cities.

    python scripts/make_suite_2.py              # src/gamms/data/suite_2.json
    gamms suite references --version 2          # the results of the baselines: suite_2_references.json

Turns, starts and weights of opponents were chosen by measurement: `chase` wins between 0.2 and 0.8 of the games.
"""

import json
from typing import Any

from gamms import suite
from gamms.scenario import Scenario
from gamms.suite.protocol import add_digest, find_task_file

STRATEGIES = "gamms.strategies:"
EXIT = 0  # the first of the exits of each district
DISTRICTS = 3  # of each city
SEEDS = [*range(40)]
TURNS = {"pursuit": 30, "exits": 40, "sight": 40}
WEIGHTS = {"pursuit": [1, 1], "exits": [2, 1, 1], "sight": [1, 2]}  # of exact, flee, safest_exit
SIGHT_M = {"monaco": 80.0, "gothenburg": 200.0}


def main() -> None:
    """Write the file of the tasks."""
    made = [make_task(kind, city) for city in suite.CITIES["test"] for kind in TURNS]
    text = json.dumps([task._asdict() for task in made], indent=1, sort_keys=True)
    find_task_file(2).write_text(f"{text}\n", encoding="utf-8")
    print(*(task.name for task in made), sep="\n")


def make_task(kind: str, city: str) -> suite.Task:
    """Return a task: two pursuers, red, catch an evader, blue, before it is at an exit or time is over."""
    maps = dict([*suite.districts(city).items()][:DISTRICTS])
    goal = {"exits": [EXIT]} if kind == "exits" else {}
    eyes: dict[str, Any] = {"type": "AGENT_RANGE", "range_m": SIGHT_M[city]} if kind == "sight" else {"type": "AGENT"}
    members = {"exact": named("gamms.solve:exact_evader", goal), "flee": named(f"{STRATEGIES}flee")}
    if goal:
        members["safest_exit"] = named(f"{STRATEGIES}safest_exit", goal)
    rules: list[Any] = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}]
    if goal:
        rules.append({"rule": "reach", "with": {"team": "blue", "nodes": [EXIT]}})
    opponent = named(f"{STRATEGIES}pool", {"members": members, "weights": WEIGHTS[kind]})
    scenario = Scenario(
        name=f"{kind} {city}",
        map=next(iter(maps.values())),
        max_turns=TURNS[kind],
        sensors={"eyes": eyes, "all": {"type": "AGENT"}},
        teams={
            "red": {"count": 2, "sensors": ["eyes"], "strategy": f"{STRATEGIES}chase"},
            "blue": {"count": 1, "sensors": ["all"], "strategy": opponent},
        },
        settings={"order": [["red"], ["blue"]]},
        facts={"task": {"kind": kind, "team": "red", **goal}},
        rules=[*rules, "last_team"],
    )
    baselines: dict[str, Any] = {name: f"{STRATEGIES}{name}" for name in ("stay", "random_walk", "chase")}
    if kind == "sight":
        baselines["follow_belief"] = f"{STRATEGIES}follow_belief"
    baselines["exact"] = named("gamms.solve:exact_pursuers", goal)
    task = suite.Task(
        f"{kind}-{city}",
        scenario.to_dict(),
        "red",
        "blue",
        {"pool": opponent},
        SEEDS,
        "wins.red",
        maps,
        baselines,
    )
    return add_digest(task)


def named(function: str, given: dict[str, Any] | None = None) -> Any:
    """Return a reference to a function with parameters."""
    return {"function": function, **({"with": given} if given else {})}


if __name__ == "__main__":
    main()
