"""The strategy of a team that visits all nodes: which were visited, and who goes where next."""

from collections.abc import Hashable, Iterable

import numpy as np

from gamms.arguments import as_context, as_flag
from gamms.context import Context
from gamms.deciding import phase_of
from gamms.ir.graph import FloatArray, IntArray
from gamms.strategies.knowledge import (
    as_otherwise,
    known_nodes,
    move_to,
    node_of,
    nodes_in_view,
    required,
    shared_memory,
)
from gamms.strategies.travel import stay
from gamms.text import shown_as_called
from gamms.typing.game import NodeId, State, Strategy
from gamms.typing.routes import made_in_moment, made_last


@shown_as_called
def sweep(
    ctx: Context,
    nodes: Iterable[NodeId] | None = None,
    by_sight: bool = False,
    repeat: bool = False,
    otherwise: Strategy | None = stay,
) -> Strategy:
    """Visit all nodes, each by one member of the team: always the nearest that is left in the agent's part of the map.

    The map is cut into parts with as many nodes each, one for each living member in the order of the names, by
    recursive coordinate bisection (Berger, Bokhari: A partitioning strategy for nonuniform problems on
    multiprocessors, 1987). An agent that is done with its part helps with the others. Which nodes were visited is in
    `state["team_memory"]`, and where the agent goes in `state["memory"]`, under `"sweep"`.

    Args:
        ctx: the context.
        nodes: ids of those to visit; None: all nodes.
        by_sight: whether nodes count as visited, too, on which the agent's sensors would show agents.
        repeat: begin again when all are visited.
        otherwise: the strategy to use when all are visited, or the rest cannot be reached; None sets no action then.

    Raises:
        UnknownName (KeyError), BadType, BadValue: one is not a node of the map, or there are none.
    """
    as_context(ctx, "sweep")
    chosen = None if nodes is None else known_nodes(ctx, nodes, "sweep", "nodes")
    sees, again = as_flag(by_sight, "by_sight of sweep"), as_flag(repeat, "repeat of sweep")
    fallback = as_otherwise(otherwise, "sweep")

    def strategy(state: State) -> None:
        here, memory, board = node_of(state, "sweep"), required(state, "memory", "sweep"), shared_memory(state, "sweep")
        visited = board.setdefault("visited", set())
        visited |= {here, *(nodes_in_view(ctx, state) if sees else ())}
        if again and visited.issuperset(_parts(ctx, None, chosen, 1)[0]):
            visited.clear()
            visited.add(here)
        target = memory.get("sweep target")
        if target is None or target in visited:
            target = memory["sweep target"] = _next_to_visit(ctx, state, chosen, visited)
        move_to(ctx, state, target, fallback, "sweep")

    return strategy


def _next_to_visit(ctx: Context, state: State, chosen: tuple[int, ...] | None, visited: set[int]) -> int | None:
    """Return the nearest node that is left in the agent's part, else on the whole map; of several, the lowest id."""
    name, here = required(state, "name", "sweep"), state["curr_pos"]
    team = required(state, "team", "sweep")
    members = {} if team is None else _living_members(ctx, team)
    own = _parts(ctx, team, chosen, len(members) or 1)[members[name] if members else 0]
    nearest = ctx.graph.routes.nearest(here, sorted(own - visited))
    if nearest is None:
        nearest = ctx.graph.routes.nearest(here, sorted(_parts(ctx, None, chosen, 1)[0] - visited))
    return nearest


def _living_members(ctx: Context, team: Hashable) -> dict[str, int]:
    """Return the living agents of a team in the order of their names, name -> its place; not to be changed."""

    def make() -> dict[str, int]:
        agents = ctx.agent.agents.values()
        names = sorted(one.name for one in agents if one.team == team and one.alive)
        return {name: place for place, name in enumerate(names)}

    return made_in_moment(ctx.graph.routes, phase_of(ctx), ("members", team), make)


def _parts(ctx: Context, team: Hashable, chosen: tuple[int, ...] | None, number: int) -> list[set[int]]:
    """Return so many parts of some nodes, with as many nodes each, by cutting along the longer side again and again."""

    def make() -> list[set[int]]:
        ids = ctx.graph.columns().node_ids.tolist() if chosen is None else chosen
        return [set(part.tolist()) for part in _bisected(np.array(ids), ctx.graph.graph.positions(ids), number)]

    return made_last(ctx.graph.routes, ("sweep", team, chosen), number, make)


def _bisected(ids: IntArray, xy: FloatArray, number: int) -> list[IntArray]:
    if number <= 1:
        return [ids]
    axis = int(np.argmax(np.ptp(xy, axis=0))) if len(ids) else 0
    order = np.lexsort((ids, xy[:, axis]))
    first, second = np.split(order, [len(ids) * (number // 2) // number])
    return _bisected(ids[first], xy[first], number // 2) + _bisected(ids[second], xy[second], number - number // 2)
