"""The golden games: one or two of each kind, small enough to be played alone and in batches in a moment."""

from pathlib import Path
from typing import NamedTuple

from gamms.scenario import Scenario

FOLDER = Path(__file__).parent
WALK = "gamms.strategies:random_walk"
EXPLORE = "functions:explore"
GRID = {"grid": {"rows": 5, "columns": 5, "spacing": 10.0}}
TOWN = {"generator": "functions:make_town"}
TELL = {"rule": "functions:tell"}
TAG = {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "then": "eliminate"}}
BACK = {"rule": "respawn", "with": {"after": 2}}
FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}
CROWDED = {"conflicts": {"capacity": 1}}
METRES = {"speed_unit": "metres"}
ARRIVALS = {"speed_unit": "metres", "decide": "arrival"}
DEFUSE = {"fields": {"bomb": "node"}, "turns": 2.5, "interrupted_by": ["move", "tag"], "on_interrupt": "resume"}
REST = {"fields": {}, "turns": 3, "blocks_moving": True}
EYES = {
    "near": {"type": "AGENT_RANGE", "sensor_range": 25.0},
    "odd": {"type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.6, "position_noise_m": 4.0},
    "late": {"type": "AGENT_RANGE", "sensor_range": 35.0, "delay_turns": 2, "false_alarm_rate": 0.4},
    "next": {"type": "NEIGHBOR"},
    "below": {"type": "AERIAL_AGENT", "sensor_range": 30.0, "fov": 2.5},
}


class Golden(NamedTuple):
    """A golden game.

    Attributes:
        num_games: the number of games whose results are kept, with the seeds 0, 1, 2, …
        most_agents: see `Scenario.batch`.
    """

    scenario: Scenario
    num_games: int = 2
    most_agents: dict | None = None


def make(rules, red=2, blue=2, max_turns=8, red_strategy=WALK, blue_strategy=EXPLORE, **more):
    """Return a scenario of two teams on a grid."""
    map_spec = more.pop("map", GRID)
    of_red, of_blue = more.pop("red_has", {}), more.pop("blue_has", {})
    teams = {
        "red": {"count": red, "strategy": red_strategy, **of_red},
        "blue": {"count": blue, "strategy": blue_strategy, **of_blue},
        **more.pop("others", {}),
    }
    return Scenario(map=map_spec, teams=teams, rules=rules, max_turns=max_turns, folder=FOLDER, **more)


def call(name, phase=None, **given):
    """Return an entry of the list of rules."""
    entry = {"rule": f"functions:{name}"}
    if given:
        entry["with"] = given
    if phase is not None:
        entry["phase"] = phase
    return entry


def list_games():
    """Return name -> golden game."""
    born, buried = call("give_birth"), call("bury")
    drones = {"air": {"count": 2, "type": "aerial", "speed": 12.0, "altitude": 5.0, "strategy": WALK}}
    seeing = {"red_has": {"sensors": ["odd", "late", "next"]}, "blue_has": {"sensors": ["near"]}, "sensors": EYES}
    radio = {"range_m": 25.0, "loss": 0.2, "delay_turns": 1, "relay": ["blue"], "max_bytes_per_turn": 12}
    deeds = {"defuse": DEFUSE, "rest": REST, "shout": None}
    car, foot = {"mode": {"attribute": "drive", "turns": True}}, {"mode": "walk"}
    fast, slow = {"speed": 14.0}, {"speed": 6.0}
    changing = {
        "a_rule_is_added": "add_rule",
        "a_road_closes": "close_road",
        "an_edge_is_added": "add_edge",
        "a_scout_is_created": "create_scout",
        "agents_are_changed": "change_agents",
    }
    found = {
        "births_and_deaths": Golden(make([born, buried, TAG, TELL]), 300),
        "births_in_a_crowd": Golden(make([call("give_birth", "before"), buried, FLAGS], **CROWDED), 40),
        "births_by_metres": Golden(
            make([call("give_birth", speed=6.0), buried, TELL], settings=METRES, red_has=fast, blue_has=slow),
            40,
        ),
        "births_with_sensors": Golden(make([call("give_birth", sensors=True), buried, TAG]), 40),
        "reserved_rows": Golden(make([call("reinforce"), TAG, BACK]), 300, {"red": ["red_9"]}),
        "deleted_carriers": Golden(make([FLAGS, call("delete_carrier")], max_turns=12), 40),
        "deeds_that_last": Golden(
            make([TAG, BACK], red_strategy="functions:work", settings={"deeds": deeds}, max_turns=12), 40
        ),
        "deeds_by_metres": Golden(
            make([TAG, BACK], red_strategy="functions:work", settings={"deeds": deeds, **METRES}, red_has=slow)
        ),
        "modes_and_turns": Golden(make([TAG, TELL], map=TOWN, red_has=car, blue_has=foot)),
        "modes_and_turns_by_metres": Golden(
            make([TAG, TELL], map=TOWN, red_has=car | fast, blue_has=foot | slow, settings=METRES)
        ),
        "speeds_in_edges": Golden(make([TAG, FLAGS], red_has={"speed": 2}, blue_has={"speed": 1.5}, **CROWDED)),
        "arrivals": Golden(make([TAG, TELL], settings=ARRIVALS, red_has=fast, blue_has=slow)),
        "arrivals_in_a_crowd": Golden(
            make(
                [FLAGS], settings=ARRIVALS, red_has=fast, blue_has=slow, conflicts={"capacity": 1, "allow_swaps": True}
            )
        ),
        "flights": Golden(
            make(
                [{"rule": "tag", "with": {"taggers": "air", "tagged": "red", "euclid": 9, "air": True}}],
                others={"air": drones["air"] | {"sensors": ["below"]}},
                sensors=EYES,
            )
        ),
        "channels": Golden(make([TAG], red_strategy="functions:call", channels={"radio": radio})),
        "erring_and_late_sensors": Golden(make([TAG], red_strategy="functions:watch", **seeing)),
        "an_order_of_play": Golden(make([TAG, BACK, TELL], settings={"order": [["blue"], ["red"]]}, **CROWDED)),
        "private_memories_and_errors": Golden(
            make([TAG], settings={"team_memory": True, "on_illegal": "stay"}, **CROWDED)
        ),
    }
    for name, rule in changing.items():
        found[name] = Golden(make([call(rule), TAG, BACK, TELL], max_turns=7), 16)
        by_metres = make([call(rule, "before"), FLAGS], settings=METRES, red_has=fast, blue_has=slow, max_turns=7)
        found[f"{name}_by_metres"] = Golden(by_metres)
    return found


GAMES = list_games()
