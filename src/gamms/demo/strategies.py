"""Strategies of the demo: plain functions of the state, which see other agents only through their sensor.

They also know the map and the public facts: the team of each node, and the carriers of flags.
"""

from collections.abc import Sequence
from math import hypot

from gamms.context import Context
from gamms.typing.game import State, Strategy

__all__ = ["attacker", "defender", "player"]

_AFRAID_M = 40.0  # an attacker keeps this far away from a defender
_FEAR = 2.0  # metres of detour that a metre too close is worth
_BEAT_M = 250.0  # a defender without an intruder in sight stays this close to its flag
_BOLD = 0.3  # how often an attacker forgets its fear: two that wait for each other would wait for ever
_WHIM_M = 6.0  # how much of a detour may look attractive, so that no two games are alike


def player(ctx: Context, defenders: int) -> Strategy:
    """Return a strategy: the first few of a team defend, the others attack."""
    defend = defender(ctx)
    attack = attacker(ctx)

    def strategy(state: State) -> None:
        number = int(state["name"].rpartition("_")[2])
        (defend if number < defenders else attack)(state)

    return strategy


def attacker(ctx: Context) -> Strategy:
    """Return a strategy: take the other team's flag and carry it home, avoiding visible defenders."""
    graph = ctx.graph.graph

    def strategy(state: State) -> None:
        flags = state["facts"]["flags"]
        whose = state["facts"]["territory"]
        (enemy,) = (team for team in flags if team != state["team"])
        home = flags[enemy]["carrier"] == state["name"]
        goal = flags[state["team"] if home else enemy]["node"]
        is_afraid = whose.get(state["curr_pos"]) == enemy and state["draw"].random() >= _BOLD
        threats = _list_places(ctx, state, enemy) if is_afraid else []

        def cost(option: int) -> float:
            _, x, y = graph.get_node(option)
            fears = (_AFRAID_M - hypot(x - there_x, y - there_y) for _, there_x, there_y in threats)
            whim = _WHIM_M * float(state["draw"].random())
            return graph.distance(option, goal) + _FEAR * sum(max(0.0, fear) for fear in fears) + whim

        state["action"] = min(_list_steps(state), key=cost)

    return strategy


def defender(ctx: Context) -> Strategy:
    """Return a strategy: chase the nearest visible intruder; without one, walk around near the own flag."""
    graph = ctx.graph.graph

    def strategy(state: State) -> None:
        flags = state["facts"]["flags"]
        whose = state["facts"]["territory"]
        steps = _list_steps(state)
        (enemy,) = (team for team in flags if team != state["team"])
        flag = flags[state["team"]]["node"]
        intruders = [place for place in _list_places(ctx, state, enemy) if whose.get(place[0]) == state["team"]]

        def metres(step: int, place: tuple[int, float, float]) -> float:
            _, x, y = graph.get_node(step)
            return hypot(x - place[1], y - place[2])

        if intruders:
            nearest = min(intruders, key=lambda place: metres(state["curr_pos"], place))
            state["action"] = min(steps, key=lambda step: metres(step, nearest))
        elif graph.distance(state["curr_pos"], flag) > _BEAT_M:
            state["action"] = min(steps, key=lambda step: graph.distance(step, flag))
        else:
            state["action"] = state["draw"].choice(steps)

    return strategy


def _list_steps(state: State) -> Sequence[int]:
    """Return the nodes that an agent may go to; its own node is included only at a dead end."""
    legal = state["legal"]
    return legal[1:] or legal


def _list_places(ctx: Context, state: State, team: str) -> list[tuple[int, float, float]]:
    """Return node, x and y of the visible agents of a team."""
    seen = state["sensor"]["seen"][1]
    nodes = [node for name, node in seen.items() if ctx.agent.get_agent(name).team == team]
    return [(node, *ctx.graph.get_node(node)[1:3]) for node in nodes]
