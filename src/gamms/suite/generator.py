"""Draw scenarios of the suite by seed: the starts of teams, the places of flags and goals, and of towers."""

import hashlib
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gamms.arguments import as_choice, as_int
from gamms.plain import Plain
from gamms.scenario import Scenario

Values = dict[str, Plain]

# The old names of rows and columns: tasks of version 1 are named by the digests of these values.
MAPS: dict[str, Values] = {"grid": {"grid": {"width": 16, "height": 12, "spacing": 10}}, "helsinki": {"helsinki": {}}}
"""The maps for generated scenarios, as `map` in a scenario file."""

_SIGHT_M = {"grid": 40.0, "helsinki": 200.0}
_TOWER_M = {"grid": 50.0, "helsinki": 250.0}
_START_M = {"grid": 30.0, "helsinki": 120.0}  # radius around a team's base in which it starts
_TAG_M = {"grid": 5.0, "helsinki": 12.0}  # reach of a tag, in a straight line
_TURNS = {"grid": 120, "helsinki": 250}
_TURNS_OF_HUNTS = {"grid": 18, "helsinki": 40}
_APART = {  # distance between the bases, as shares of the map's diagonal
    **{(kind, "grid"): (0.3, 0.6) for kind in ("pursuit", "evasion")},
    **{(kind, "helsinki"): (0.05, 0.1) for kind in ("pursuit", "evasion")},
    **{("flags", map): (0.25, 0.4) for map in MAPS},
}
_ELSE_APART = (0.4, 1.0)
_TRIES = 1000
_SPEEDS: dict[tuple[str, str], dict[str, float]] = {  # in edges per turn, for teams whose speed is not 1
    **{(kind, "grid"): {"blue": 0.9} for kind in ("pursuit", "evasion")},
    **{(kind, "helsinki"): {"blue": 0.7} for kind in ("pursuit", "evasion")},
    ("flags", "helsinki"): {"red": 2, "blue": 2},
}


class GeneratedTask(NamedTuple):
    """A generated scenario, and the strategies that play in it.

    Attributes:
        scenario: the scenario, in which the team plays its baseline.
        team: the team of the strategy under test.
        opponent: the other team.
        opponents: strategies of the other team, by name.
    """

    scenario: Scenario
    team: str
    opponent: str
    opponents: dict[str, Plain]


def generate(kind: str, map: str = "grid", seed: int = 0) -> GeneratedTask:
    """Return a scenario of a kind, with starts, flags, goals and towers drawn by a seed.

    Args:
        kind: "pursuit" and "evasion" (red tags blue), "breach" and "defence" (red runs to a goal that blue guards), or
            "flags" (both capture the flag of the other); the first named side is under test.
        map: "grid" or "helsinki".
        seed: the seed of all draws.

    Returns:
        A named tuple: `scenario`, in which the team under test plays its baseline; `team`, its name; `opponent`, the
        other team; `opponents`, strategies of that team by name.

    Raises:
        BadValue: the kind or the map does not exist.
    """
    chosen = as_choice(kind, "kind", KINDS)
    where = as_choice(map, "map", list(MAPS))
    return _DRAWN[chosen](_TaskMap(where, as_int(seed, "seed"), chosen))


class _TaskMap:
    """A map with two drawn bases and two towers: the common part of all kinds of scenarios."""

    def __init__(self, map: str, seed: int, kind: str) -> None:
        self.map = map
        self._seed = seed
        self._kind = kind
        columns = Scenario(map=MAPS[map], teams={"one": {"count": 1}}).columns()
        self._ids = columns.node_ids
        self._xy = columns.xy
        self.bases = self._draw_bases(map)
        self.towers = [self._draw_node("tower", number) for number in range(2)]
        self.turns = (_TURNS_OF_HUNTS if kind in ("pursuit", "evasion") else _TURNS)[map]

    def _draw_node(self, *names: object) -> int:
        """Draw a node by the SHA-256 of the seed and names."""
        text = "/".join(map(str, (self._seed, *names)))
        return int(self._ids[int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") % len(self._ids)])

    def _draw_bases(self, map: str) -> tuple[int, int]:
        """Draw two nodes with a distance in the range of the kind."""
        xy_of = dict(zip(self._ids.tolist(), self._xy.tolist(), strict=True))
        diagonal = float(np.hypot(*np.ptp(self._xy, axis=0)))
        least, most = (share * diagonal for share in _APART.get((self._kind, map), _ELSE_APART))
        pairs = ((self._draw_node("red", trial), self._draw_node("blue", trial)) for trial in range(_TRIES))
        return next(pair for pair in pairs if least <= np.hypot(*np.subtract(*(xy_of[node] for node in pair))) <= most)

    def make_scenario(
        self, strategies: tuple[Plain, Plain], counts: tuple[int, int], rules: list[Plain], task: Values
    ) -> Scenario:
        """Return the scenario of a red and a blue team around their bases; both have sensors, and blue has a tower."""
        near = {"within": _START_M[self.map], "sensors": ["seen"]}
        teams: dict[str, Values] = {
            team: {"count": count, "near": base, **near, "strategy": strategy}
            for team, count, base, strategy in zip(("red", "blue"), counts, self.bases, strategies, strict=True)
        }
        for team, speed in _SPEEDS.get((self._kind, self.map), {}).items():
            teams[team]["speed"] = speed
        teams["blue"]["sensors"] = ["seen", "blue_tower"]
        sensors: dict[str, Values] = {"seen": {"type": "AGENT_RANGE", "sensor_range": _SIGHT_M[self.map]}}
        sensors["blue_tower"] = {"type": "AGENT_RANGE", "sensor_range": _TOWER_M[self.map], "at": self.towers[0]}
        if self._kind == "flags":
            teams["red"]["sensors"] = ["seen", "red_tower"]
            sensors["red_tower"] = {**sensors["blue_tower"], "at": self.towers[1]}
        return Scenario(
            name=f"{self._kind} {self.map} {self._seed}",
            map=MAPS[self.map],
            sensors=sensors,
            teams=teams,
            facts={"task": {"kind": self._kind, **task}},
            rules=rules,
        )

    def tag(self, taggers: str, tagged: str, **more: Plain) -> Values:
        """Return the rule by which a team tags another at short distance."""
        given = {"taggers": taggers, "tagged": tagged, "euclid": _TAG_M[self.map], "then": "eliminate", "score": 0}
        return {"rule": "tag", "with": {**given, **more}}


def _name_function(function: str, **given: Plain) -> Values:
    return (
        {"function": f"gamms.strategies:{function}", "with": given}
        if given
        else {"function": f"gamms.strategies:{function}"}
    )


def _make_pursuit(ground: _TaskMap, team: str = "red") -> GeneratedTask:
    limit = {"rule": "time_limit", "with": {"turns": ground.turns, "winner": "blue"}}
    rules: list[Plain] = [ground.tag("red", "blue"), "last_team", limit]
    made = ground.make_scenario((_name_function("assign"), _name_function("flee")), (4, 2), rules, {"team": team})
    if team == "red":
        opponents = {
            "flee": _name_function("flee"),
            "waypoints": _name_function("random_waypoints"),
            "walk": _name_function("random_walk"),
        }
        return GeneratedTask(made, "red", "blue", opponents)
    opponents = {
        "assign": _name_function("assign"),
        "intercept": _name_function("intercept"),
        "chase": _name_function("chase"),
    }
    return GeneratedTask(made, "blue", "red", opponents)


def _make_breach(ground: _TaskMap, team: str = "red") -> GeneratedTask:
    goal = ground.bases[1]
    limit = {"rule": "time_limit", "with": {"turns": ground.turns, "winner": "blue"}}
    reach = {"rule": "reach", "with": {"team": "red", "nodes": goal}}
    rules: list[Plain] = [ground.tag("blue", "red"), reach, "last_team", limit]
    radius = _SIGHT_M[ground.map]
    strategies = _name_function("safest_exit", exits=[goal]), _name_function("guard", node=goal, radius=radius)
    made = ground.make_scenario(strategies, (3, 2), rules, {"team": team, "goal": goal})
    if team == "red":
        guards = {
            "guard": strategies[1],
            "intercept": _name_function("intercept", goals=[goal]),
            "chase": _name_function("chase"),
        }
        return GeneratedTask(made, "red", "blue", guards)
    runners = {
        "exit": strategies[0],
        "straight": _name_function("goto", target=goal),
        "waypoints": _name_function("random_waypoints"),
    }
    return GeneratedTask(made, "blue", "red", runners)


def _make_flags(ground: _TaskMap) -> GeneratedTask:
    bases = dict(zip(("red", "blue"), ground.bases, strict=True))
    nodes = {"function": "gamms.rules.territory:by_distance", "with": {"bases": bases}}
    rules: list[Plain] = [
        {"rule": "gamms.rules.territory:published", "with": {"nodes": nodes}},
        ground.tag("red", "blue", territory="territory", mutual=True, then="respawn"),
        {"rule": "capture_flag", "with": {"flags": bases, "territory": "territory", "goal": 1}},
        {"rule": "time_limit", "with": {"turns": ground.turns}},
    ]
    players = [{"function": "gamms.demo.strategies:player", "with": {"defenders": number}} for number in (1, 0, 3)]
    made = ground.make_scenario((players[0], players[0]), (4, 4), rules, {"team": "red", "flags": bases})
    return GeneratedTask(made, "red", "blue", dict(zip(("balanced", "rush", "siege"), players, strict=True)))


_DRAWN: dict[str, Callable[[_TaskMap], GeneratedTask]] = {  # name -> the function that draws a scenario of this kind
    "pursuit": _make_pursuit,
    "evasion": lambda ground: _make_pursuit(ground, "blue"),
    "breach": _make_breach,
    "defence": lambda ground: _make_breach(ground, "blue"),
    "flags": _make_flags,
}

KINDS = tuple(_DRAWN)
"""The kinds of scenarios that `generate` draws."""
