"""How the agents play: plain functions of the state, which see the others through their sensors only.

Each agent carries three sensors: `near` (where it may go), `map` (the nodes around) and `seen` (the agents around).
Besides, it knows the map (how far it is by road to each flag and home) and what is announced to everybody: which
team an agent plays for and who carries a flag.
"""

from collections.abc import Callable
from math import hypot
from typing import Any, NamedTuple

from numpy.random import Generator

from gamms.demo.world import World

Strategy = Callable[[dict[str, Any]], None]

SIGHT_M = 120.0  # range of `map` and `seen`

_AFRAID_M = 40.0  # an attacker keeps this far away from a defender
_FEAR = 2.0  # metres of detour that a metre too close is worth
_BEAT_M = 250.0  # a defender without an intruder in sight stays this close to its flag
_WHIM_M = 6.0  # how much of a detour may look attractive, so that no two games are alike


class Announced(NamedTuple):
    """What everybody knows; it changes during the game."""

    team_of: dict[str, int]  # agent -> team
    carriers: dict[int, str]  # team -> the agent that carries its flag away


def attack(name: str, world: World, announced: Announced, rng: Generator) -> Strategy:
    """Take the other team's flag and carry it home, around the defenders in sight."""
    team = announced.team_of[name]
    enemy = 1 - team

    def strategy(state: dict[str, Any]) -> None:
        is_carrier = announced.carriers.get(enemy) == name
        to_goal = world.to_home[team] if is_carrier else world.to_flag[enemy]
        threats = _places_of(enemy, state, announced) if world.side[state["curr_pos"]] == enemy else []
        nodes = state["sensor"]["map"][1]["nodes"]

        def cost(option: int) -> float:
            fears = (_AFRAID_M - hypot(nodes[option].x - x, nodes[option].y - y) for _, x, y in threats)
            return to_goal[option] + _FEAR * sum(max(0.0, fear) for fear in fears) + _WHIM_M * rng.random()

        state["action"] = min(_steps(state), key=cost)

    return strategy


def defend(name: str, world: World, announced: Announced, rng: Generator) -> Strategy:
    """Chase the nearest intruder in sight; walk about near the own flag while there is none."""
    team = announced.team_of[name]
    to_flag = world.to_flag[team]

    def strategy(state: dict[str, Any]) -> None:
        node, steps, nodes = state["curr_pos"], _steps(state), state["sensor"]["map"][1]["nodes"]
        intruders = [place for place in _places_of(1 - team, state, announced) if world.side[place[0]] == team]

        def metres(step: int, place: tuple[int, float, float]) -> float:
            return hypot(nodes[step].x - place[1], nodes[step].y - place[2])

        if intruders:
            nearest = min(intruders, key=lambda place: metres(node, place))
            state["action"] = min(steps, key=lambda step: metres(step, nearest))
        elif to_flag[node] > _BEAT_M:
            state["action"] = min(steps, key=to_flag.__getitem__)
        else:
            state["action"] = steps[rng.integers(len(steps))]

    return strategy


def _steps(state: dict[str, Any]) -> list[int]:
    """The nodes an agent may go to; staying is no step, except at a dead end without a way out."""
    near: list[int] = state["sensor"]["near"][1]
    return near[1:] or near


def _places_of(team: int, state: dict[str, Any], announced: Announced) -> list[tuple[int, float, float]]:
    """Node, x and y of the agents of a team in sight."""
    seen, nodes = state["sensor"]["seen"][1], state["sensor"]["map"][1]["nodes"]
    return [nodes[node] for name, node in seen.items() if announced.team_of[name] == team]
