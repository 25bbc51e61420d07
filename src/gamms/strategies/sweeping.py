"""A team strategy that visits all nodes: which nodes were visited, and which agent goes where."""

from collections.abc import Hashable, Iterable

import numpy as np

from gamms.arguments import as_context, as_flag, show_as_call
from gamms.context import Context
from gamms.deciding import get_phase
from gamms.ir.graph import FloatArray, IntArray
from gamms.strategies.knowledge import (
    as_otherwise,
    check_nodes,
    find_nodes_in_view,
    get_graph,
    get_node,
    get_required,
    get_shared_memory,
    move_to,
    offer_steps,
)
from gamms.strategies.travel import stay
from gamms.typing.game import NodeId, State, Strategy
from gamms.typing.routes import get_cached, get_cached_in_moment


@show_as_call
def sweep(
    ctx: Context,
    nodes: Iterable[NodeId] | None = None,
    by_sight: bool = False,
    repeat: bool = False,
    otherwise: Strategy | None = stay,
) -> Strategy:
    """Visit all nodes, each by one team member: always the nearest unvisited node in the agent's part of the map.

    The map is divided into parts with equal numbers of nodes, one for each living member ordered by name, by recursive
    coordinate bisection (Berger, Bokhari: A partitioning strategy for nonuniform problems on multiprocessors, 1987). An
    agent that has finished its part helps with the others. The visited nodes are in `state["team_memory"]`, and the
    agent's target in `state["memory"]`, under `"sweep"`.

    Args:
        ctx: the context.
        nodes: ids of the nodes to visit; None: all nodes.
        by_sight: whether nodes on which the agent's sensors would show agents also count as visited.
        repeat: whether to begin again after all nodes were visited.
        otherwise: the strategy to use if all nodes were visited, or the rest cannot be reached; None sets no action.

    Raises:
        UnknownName (KeyError), BadType, BadValue: a node is not on the map, or there are no nodes.
    """
    as_context(ctx, "sweep")
    chosen = None if nodes is None else check_nodes(ctx, nodes, "sweep", "nodes")
    sees = as_flag(by_sight, "by_sight of sweep")
    again = as_flag(repeat, "repeat of sweep")
    fallback = as_otherwise(otherwise, "sweep")

    def strategy(state: State) -> None:
        here = get_node(state, "sweep")
        memory = get_required(state, "memory", "sweep")
        board = get_shared_memory(state, "sweep")
        visited = board.setdefault("visited", set())
        visited |= {here, *(find_nodes_in_view(ctx, state) if sees else ())}
        if again and visited.issuperset(_divide_nodes(ctx, None, chosen, 1)[0]):
            visited.clear()
            visited.add(here)
        target = memory.get("sweep target")
        if target is None or target in visited:
            target = _find_next_to_visit(ctx, state, chosen, visited)
            memory["sweep target"] = target
        move_to(ctx, state, target, fallback, "sweep")

    offer_steps(strategy, None, fallback)
    return strategy


def _find_next_to_visit(ctx: Context, state: State, chosen: tuple[int, ...] | None, visited: set[int]) -> int | None:
    """Return the nearest unvisited node of the agent's part, else of the whole map; ties go to the lowest id."""
    name = get_required(state, "name", "sweep")
    here = state["curr_pos"]
    team = get_required(state, "team", "sweep")
    members = {} if team is None else _list_living_members(ctx, team)
    own = _divide_nodes(ctx, team, chosen, len(members) or 1)[members[name] if members else 0]
    routes = get_graph(ctx, state).routes
    nearest: int | None = routes.nearest(here, sorted(own - visited))
    if nearest is None:
        nearest = routes.nearest(here, sorted(_divide_nodes(ctx, None, chosen, 1)[0] - visited))
    return nearest


def _list_living_members(ctx: Context, team: Hashable) -> dict[str, int]:
    """Return a read-only mapping name -> index of the living agents of a team, ordered by name."""

    def make() -> dict[str, int]:
        agents = ctx.agent.agents.values()
        names = sorted(one.name for one in agents if one.team == team and one.alive)
        return {name: place for place, name in enumerate(names)}

    return get_cached_in_moment(ctx.graph.routes, get_phase(ctx), ("members", team), make)


def _divide_nodes(ctx: Context, team: Hashable, chosen: tuple[int, ...] | None, number: int) -> list[set[int]]:
    """Divide nodes into parts of equal size by repeated cuts across the longer side."""

    def make() -> list[set[int]]:
        ids = ctx.graph.columns().node_ids.tolist() if chosen is None else chosen
        return [set(part.tolist()) for part in _bisect_nodes(np.array(ids), ctx.graph.graph.positions(ids), number)]

    return get_cached(ctx.graph.routes, ("sweep", team, chosen), number, make)


def _bisect_nodes(ids: IntArray, xy: FloatArray, number: int) -> list[IntArray]:
    if number <= 1:
        return [ids]
    axis = int(np.argmax(np.ptp(xy, axis=0))) if len(ids) else 0
    order = np.lexsort((ids, xy[:, axis]))
    first, second = np.split(order, [len(ids) * (number // 2) // number])
    return _bisect_nodes(ids[first], xy[first], number // 2) + _bisect_nodes(
        ids[second], xy[second], number - number // 2
    )
