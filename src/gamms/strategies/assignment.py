"""A team strategy that assigns visible enemies to agents."""

from collections.abc import Hashable
from math import inf

import numpy as np

from gamms import kernels
from gamms.arguments import as_context, as_count, show_as_call
from gamms.context import Context
from gamms.deciding import get_phase
from gamms.game.movement.routes import RoutesFromNodes
from gamms.ir.graph import FloatArray
from gamms.strategies.knowledge import (
    as_otherwise,
    find_enemies_in_sight,
    get_graph,
    get_graph_of_mode,
    get_node,
    get_required,
    get_shared_memory,
    move_to_agent,
    offer_steps,
)
from gamms.strategies.travel import random_walk
from gamms.typing.game import State, Strategy
from gamms.typing.routes import get_cached, get_cached_in_moment


@show_as_call
def assign(ctx: Context, patience: int = 10, otherwise: Strategy | None = random_walk) -> Strategy:
    """Go to the enemy that is assigned to the agent, by minimizing the total distance between the team and the enemies.

    Agents share their positions and the enemies they see, in `state["team_memory"]` under `"assign"`. In the next turn
    all agents compute the same matching from it (Kuhn: The Hungarian method for the assignment problem, 1955). If there
    are more agents than enemies, an enemy gets several agents; agents without teammates go to the nearest enemy.

    Args:
        ctx: the context.
        patience: number of turns in which an enemy is searched for where it was seen last.
        otherwise: the strategy to use if no enemy is known, or there is no path; None sets no action.

    Raises:
        BadType, BadValue: `patience` is not a number of turns.
    """
    as_context(ctx, "assign")
    turns = as_count(patience, "patience of assign", 0)
    fallback = as_otherwise(otherwise, "assign")

    def strategy(state: State) -> None:
        here = get_node(state, "assign")
        seen = find_enemies_in_sight(ctx, state, "assign")
        mates, enemies = _recall_agents(ctx, state, turns)
        _report(state, here, seen)
        mine = _match_enemies(ctx, state["team"], mates, enemies).get(state["name"]) if enemies and mates else None
        if mine is None:
            target = get_graph(ctx, state).routes.nearest(here, seen.values())
        else:
            target = seen.get(mine, None if enemies[mine] == here else enemies[mine])
        move_to_agent(ctx, state, target, seen, fallback, "assign")

    offer_steps(strategy, None, fallback)
    return strategy


# -- shared knowledge
# -------------------------------------------------------------------------------------------------


def _report(state: State, here: int, seen: dict[str, int]) -> None:
    """Share the position of the agent and the visible enemies with the team."""
    board = get_shared_memory(state, "assign")
    turn = get_required(state, "turn", "assign")
    board.setdefault("mates", {})[get_required(state, "name", "assign")] = (turn, here)
    board.setdefault("enemies", {}).update((name, (turn, node)) for name, node in seen.items())


def _recall_agents(ctx: Context, state: State, patience: int) -> tuple[dict[str, int], dict[str, int]]:
    """Return where living teammates were in the last turn, and where living enemies were last seen, by name."""
    board = get_shared_memory(state, "assign")
    now = get_required(state, "turn", "assign")
    agents = ctx.agent.agents
    reports = [dict(board.get(part, {})) for part in ("mates", "enemies")]

    def make() -> tuple[dict[str, int], dict[str, int]]:
        found = []
        for part, oldest in zip(reports, (now - 1, now - 1 - patience), strict=True):
            known = sorted((name, node) for name, (turn, node) in part.items() if turn >= oldest)
            found.append({name: node for name, node in known if name in agents and agents[name].alive})
        return found[0], found[1]

    return get_cached_in_moment(
        ctx.graph.routes, get_phase(ctx), ("assign reports", state["team"]), make, (now, patience, reports)
    )


def _find_distances(ctx: Context, mates: dict[str, int], targets: list[int]) -> FloatArray:
    """Return the distances (mates, targets), each along the edges that the agent may use."""
    modes = [getattr(ctx.agent.get_agent(name), "mode", None) for name in mates]
    nodes = list(mates.values())
    far = np.empty((len(nodes), len(targets)))
    for mode in dict.fromkeys(modes):
        own = [place for place, one in enumerate(modes) if one == mode]
        graph = get_graph_of_mode(ctx, mode)
        places = [nodes[place] for place in own]
        if isinstance(graph, RoutesFromNodes):
            far[own] = graph.distance_matrix(places, np.array(targets, np.int64))
        else:
            far[own] = graph.routes.distances(places, targets)
    return far


def _match_enemies(ctx: Context, team: Hashable, mates: dict[str, int], enemies: dict[str, int]) -> dict[str, str]:
    """Return the reachable enemy of each agent, by the matching of least total distance."""
    routes = ctx.graph.routes
    rounds = -(-len(mates) // len(enemies))

    def make() -> dict[str, str]:
        costs = np.tile(_find_distances(ctx, mates, list(enemies.values())), rounds)
        names = list(enemies) * rounds
        pairs = zip(mates, kernels.find_least_matching(costs), costs, strict=True)
        return {mate: names[column] for mate, column, row in pairs if row[column] < inf}

    # NOTE: all agents of a team share one result per turn (500 agents: 0.2 s instead of 100 s).
    return get_cached(routes, ("assign", team), (mates, enemies), make)
