"""What an action means: where it leads, by which way, and whether it is legal."""

from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue, GammsError, NoPath, UnknownName
from gamms.game.checks import as_heading, flight
from gamms.game.seats import Seat
from gamms.ir.agents import Position, Quat

if TYPE_CHECKING:
    from gamms.game.game import Game

_SLACK = 1e-9  # of the metres of a turn: a way that is as long as these must not fail by rounding


class Plan(NamedTuple):
    """What one agent is going to do."""

    end: int  # node id
    path: tuple[int, ...]  # node ids, from where it is to the end
    heading: Any = ()  # (cos, sin) to face from now on, None to follow moves again; () leaves it
    carry: float = 0.0  # metres left over
    position: Position | None = None  # of a flyer
    quat: Quat | None = None


def judged(game: "Game", seat: Seat, here: int, action: Any) -> Plan:
    """What an action leads to.

    Raises:
        GammsError: it is nonsense, or not legal; the message says why.
    """
    if seat.flies:
        position, quat = flight(game.ctx.agent.columns, seat.row, action)
        return Plan(here, (here,), position=position, quat=quat)
    heading: Any = ()
    if isinstance(action, dict):
        if "node_id" not in action:
            raise BadValue(f"An action dict needs 'node_id'; got only {sorted(map(str, action))}.")
        if "orientation" in action:
            heading = action["orientation"]
            heading = None if heading is None else as_heading(heading)
        action = action["node_id"]
    if isinstance(action, (list, np.ndarray)) and np.ndim(action) == 1:
        way, is_route = _checked_way(game, here, action), True
    else:
        way, is_route = [_node(game, action)], False
    end, path, carry = _walk(game, seat, here, way, is_route=is_route)
    return Plan(end, path, heading, carry)


def reach(game: "Game", seat: Seat, here: int) -> tuple[int, ...]:
    """Where an agent with a speed may be after this turn, its own node first."""
    graph, budget = game.ctx.graph.graph, _budget(game, seat)
    if game.legal == "any":
        return (here, *(id for id in graph.get_nodes() if id != here))
    weight = "length" if game.speed_unit == "metres" else None
    near = graph.distances(source=here, weight=weight, cutoff=budget if budget < inf else None)
    return (here, *(id for id in near if id != here))


def _node(game: "Game", action: Any) -> int:
    try:
        node = as_int(action, "A node id")
    except BadType:
        raise BadType(f"An action must be a node id or a dict with 'node_id', not {action!r}.") from None
    if not game.ctx.graph.graph.has_node(node):
        raise UnknownName("node", node)
    return node


def _checked_way(game: "Game", here: int, action: Any) -> list[int]:
    """A list of nodes that was given as an action, without the node the agent is on."""
    way = [_node(game, node) for node in action]
    way = way[1:] if way and way[0] == here else way
    near = game.ctx.graph.graph.neighborhoods
    if game.legal == "edges":
        for start, end in zip([here, *way], way, strict=False):
            if end not in near[start]:
                raise BadValue(f"No edge leads from node {start} to node {end}.")
    return way


def _walk(game: "Game", seat: Seat, here: int, way: list[int], *, is_route: bool) -> tuple[int, tuple[int, ...], float]:
    """Where the way, or the shortest path to its one node, leads in this turn: end, path, metres left over."""
    if not way or (way == [here] and not is_route):
        return here, (here,), 0.0
    graph = game.ctx.graph.graph
    if game.legal == "any":
        return way[-1], (here, *way), 0.0
    if seat.speed is None:
        if len(way) > 1 or way[0] not in graph.neighborhoods[here]:
            raise BadValue(f"Node {way[-1]} is not next to node {here}; legal are {list(graph.neighborhoods[here])}.")
        return way[0], (here, way[0]), 0.0
    weight = "length" if game.speed_unit == "metres" else None
    if not is_route:
        try:
            way = graph.shortest_path(here, way[0], weight)[1:]
        except NoPath as error:
            raise BadValue(str(error)) from None
    return _as_far_as(game, seat, here, way)


def _as_far_as(game: "Game", seat: Seat, here: int, way: list[int]) -> tuple[int, tuple[int, ...], float]:
    """As far along a way as this turn's edges or metres go."""
    if game.speed_unit == "edges":
        path = (here, *way[: int(seat.speed or 0)])
        return path[-1], path, 0.0
    left, path = _budget(game, seat), (here,)
    for node in way:
        length = game.length_of(path[-1], node)
        if length > left * (1.0 + _SLACK):
            return path[-1], path, left
        left, path = max(0.0, left - length), (*path, node)
    return path[-1], path, 0.0


def _budget(game: "Game", seat: Seat) -> float:
    speed = seat.speed or 0.0
    carried = game.ctx.agent.columns.carry[seat.row] if game.speed_unit == "metres" else 0.0
    return speed + carried


def why_not(error: GammsError) -> str:
    """What the result says about an action that was refused."""
    return f"{type(error).__name__}: {error}"
