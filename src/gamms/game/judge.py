"""What an action means: where it leads, by which way, and whether it is legal."""

from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue, GammsError, NoPath, UnknownName
from gamms.game.checks import as_heading, flight
from gamms.game.seats import Seat
from gamms.ir.agents import Position, Progress, Quat
from gamms.text import shown

if TYPE_CHECKING:
    from gamms.game.game import Game

_SLACK = 1e-9  # of the edges or metres of a turn: a way that is as long as these must not fail by rounding


class Plan(NamedTuple):
    """What one agent is going to do."""

    end: int  # node id
    path: tuple[int, ...]  # node ids, from where it is to the end
    heading: Any = ()  # (cos, sin) to face from now on, None to follow moves again; () leaves it
    times: tuple[float, ...] = ()  # when it is at each node of the path, from 0 to 1; (): evenly
    progress: Progress | None = None  # along the edge behind the end of the path
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
    plan = _walk(game, seat, here, way, is_route=is_route)
    return plan if heading == () else plan._replace(heading=heading)


def reach(game: "Game", seat: Seat, here: int) -> tuple[int, ...]:
    """Where an agent may go: its own node, the next ones, and those that its speed takes it to in this turn."""
    graph = game.ctx.graph.graph
    if game.legal == "any":
        return (here, *(id for id in graph.get_nodes() if id != here))
    speed = seat.speed or 0.0
    near = [*graph.neighborhoods[here], *_around(game, here, speed)]
    begun, covered = _begun(game, seat, here)
    if begun is not None:
        left = _limit(speed + covered) - _cost(game, here, begun)  # less than the speed
        near += [node for node, far in _around(game, begun, speed).items() if far <= left]
    return tuple(dict.fromkeys(near))


def _node(game: "Game", action: Any) -> int:
    try:
        node = as_int(action, "A node id")
    except BadType:
        raise BadType(f"An action must be a node id or a dict with 'node_id', not {shown(action)}.") from None
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


def _walk(game: "Game", seat: Seat, here: int, way: list[int], *, is_route: bool) -> Plan:
    """Where the way, or the shortest path to its one node, leads in this turn."""
    if not way or (way == [here] and not is_route):
        return Plan(here, (here,))
    if game.legal == "any":
        return Plan(way[-1], (here, *way))
    if seat.speed is None:
        near = game.ctx.graph.graph.neighborhoods[here]
        if len(way) > 1 or way[0] not in near:
            raise BadValue(f"Node {way[-1]} is not next to node {here}; legal are {list(near)}.")
        return Plan(way[0], (here, way[0]))
    begun, covered = _begun(game, seat, here)
    if not is_route:
        way = _shortest(game, here, way[0], begun, covered)
    return _as_far_as(game, seat.speed, here, way, covered if way[0] == begun else 0.0)


def _shortest(game: "Game", here: int, target: int, begun: int | None, covered: float) -> list[int]:
    """The shortest way to a node from where an agent really is: on from `here`, or along the edge it has begun."""
    graph, weight = game.ctx.graph.graph, _weight(game)
    try:
        way: list[int] = graph.shortest_path(here, target, weight)[1:]
        if begun is not None and begun != way[0]:
            left = _cost(game, here, begun) - covered + graph.distance(begun, target, weight)
            if left <= graph.distance(here, target, weight):
                way = graph.shortest_path(begun, target, weight)
    except NoPath as error:
        raise BadValue(str(error)) from None
    return way


def _as_far_as(game: "Game", speed: float, here: int, way: list[int], covered: float) -> Plan:
    """As far along a way as the edges or metres of this turn go, of which so much was covered before it."""
    budget, gone, path, reached = speed + covered, 0.0, [here], [0.0]
    limit = _limit(budget)
    for node in way:
        cost = _cost(game, path[-1], node)
        if gone + cost > limit:
            share = (budget - gone) / cost
            progress = Progress(path[-1], node, share) if _SLACK < share < 1.0 and node != path[-1] else None
            break
        gone += cost
        path.append(node)
        reached.append(gone)
    else:
        progress = None
    return Plan(path[-1], tuple(path), times=_times(game, speed, reached, covered), progress=progress)


def _times(game: "Game", speed: float, reached: list[float], covered: float) -> tuple[float, ...]:
    """When an agent is at each node of its path, by how far along it they are; () for evenly from 0 to 1."""
    if game.speed_unit == "edges":
        return ()
    pace = speed if speed < inf else reached[-1]
    return (0.0, *(min(1.0, round((far - covered) / pace, 9)) if far > covered else 0.0 for far in reached[1:]))


def _begun(game: "Game", seat: Seat, here: int) -> tuple[int | None, float]:
    """The end of the edge that an agent has covered part of, and how much of it: of one edge, or in metres."""
    progress = game.columns.progress[seat.row]
    if progress is None or progress.source != here or progress.target not in game.ctx.graph.graph.neighborhoods[here]:
        return None, 0.0
    return progress.target, progress.share * _cost(game, here, progress.target)


def _around(game: "Game", node: int, speed: float) -> dict[int, float]:
    """How far the nodes are to which a speed takes an agent in a turn."""
    # NOTE: always by a speed, because the graph keeps what it has found around a node for one cutoff.
    cutoff = None if speed == inf else _limit(speed)
    near: dict[int, float] = game.ctx.graph.graph.distances(source=node, weight=_weight(game), cutoff=cutoff)
    return near


def _limit(budget: float) -> float:
    """What of a way counts as within a budget."""
    return budget * (1.0 + _SLACK)


def _cost(game: "Game", source: int, target: int) -> float:
    """How much of a turn's edges or metres it takes to go to the next node; to wait is an edge, and no metre."""
    if game.speed_unit == "edges":
        return 1.0
    return 0.0 if source == target else game.length_of(source, target)


def _weight(game: "Game") -> str | None:
    return "length" if game.speed_unit == "metres" else None


def why_not(error: GammsError) -> str:
    """What the result says about an action that was refused."""
    return f"{type(error).__name__}: {error}"
