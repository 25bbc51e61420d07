"""The actions that lead agents toward nodes: steps of strategies, and in array strategies of single games."""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import takewhile
from math import hypot, isfinite
from typing import Any

import numpy as np

from gamms.arguments import as_array
from gamms.core import routes as core
from gamms.errors import BadType, NoPath
from gamms.game.movement.legal_moves import Movement
from gamms.game.movement.routes import RoutesWithTurns
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing.game import EdgeAction
from gamms.typing.graph_engine import IGraph

_FIRST = 1 << 32  # the number of the first action that is not the number of a legal node


def step_towards(
    graph: IGraph,
    here: int,
    legal: Sequence[int],
    target: int,
    *,
    weight: str | None = "length",
    has_speed: bool,
    ends: Iterable[int] = (),
    is_allowed: Callable[[int], bool] | None = None,
) -> int | list[int] | None:
    """Return the action that leads an agent toward a node.

    Args:
        graph: the graph.
        here: the id of the agent's node.
        legal: the ids of its legal nodes.
        target: a node id.
        weight: the edge weight by which the agent chooses paths in games by metres.
        has_speed: whether the agent may move along several edges, or part of one, in a turn.
        ends: in games by metres, the nodes from which an agent with a speed can go on: its own, or the ends of its
            edge.
        is_allowed: whether the agent may enter a node; None: every node.

    Returns:
        A node id, maybe the agent's own; for an agent with a speed the nodes of the path, up to the first one out of
        reach, so that the rest of its metres is used next turn; None if there is no path.

    Raises:
        BadType: `legal` has values other than node ids.
    """
    if ends and is_allowed is None:
        is_near = target in legal
        return target if is_near or any(isfinite(graph.distance(end, target, weight)) for end in ends) else None
    if target in legal and (is_allowed is None or is_allowed(target)):
        return target
    try:
        ids: Any = array("q", legal)
    except (TypeError, OverflowError):
        raise BadType(f"state['legal'] has ids of nodes, 64-bit integers, not {shown(legal)}.") from None
    path = [here]
    edges = 0
    steps = 0
    while steps == edges:  # all known nodes are legal: more may be
        edges = max(2, 2 * edges)  # 2 are enough for agents that move along one edge
        try:
            path = graph.shortest_path(here, target, most_edges=edges)
        except NoPath:
            return None
        if is_allowed is not None:
            path = [here, *takewhile(is_allowed, path[1:])]
        nodes: Any = array("q", path)
        steps = core.count_steps(nodes, len(path), ids, 0, len(legal))
    if has_speed:
        return path[1 : steps + 2] or here
    return path[steps]


def step_with_turns(
    routes: RoutesWithTurns,
    legal: Sequence[int],
    target: int,
    *,
    by_metres: bool,
    is_allowed: Callable[[int], bool] | None = None,
) -> int | list[int] | EdgeAction | None:
    """Return the action that leads an agent that obeys turn restrictions toward a node.

    Args:
        routes: its routes.
        legal: see `step_towards`; so are `target` and `is_allowed`.
        target: a node id.
        by_metres: whether it may go any distance toward a node.
        is_allowed: whether it may enter a node; None: every node.

    Returns:
        A node id, or the edge to it, if the path does not go on from the cheapest one; from an edge, its end and the
        next node. None if there is no path.
    """
    if by_metres and is_allowed is None:
        return target if target in legal or routes.find_path(routes.here, target) is not None else None
    is_free = is_allowed is None or is_allowed(target)
    if target == routes.here or (not by_metres and target in legal and is_free):
        return target
    found = routes.find_step(target)
    if found is not None and is_allowed is not None and not is_allowed(found[0]):
        return routes.here
    if found is None or not routes.is_on_edge:
        return None if found is None else found[1]
    return [routes.here, found[0]]


class ActionFinder:
    """Finds the actions that lead agents of a single game toward nodes, as strategies do.

    Args:
        graphs: the graph, and the graphs of the modes of `movement`.
        movement: the movement of the agents.
        routes: number of an agent -> its routes; None: it does not obey turn restrictions.
    """

    def __init__(
        self, graphs: Sequence[IGraph], movement: Movement, routes: Mapping[int, RoutesWithTurns | None]
    ) -> None:
        self._graphs = graphs
        self._movement = movement
        self._routes = routes
        self._actions: list[int | list[int] | EdgeAction] = []

    def find_action_towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None
    ) -> IntArray:
        """Return the actions of agents, as `Movement.find_action_towards` does; `which` are their games and numbers."""
        movement = self._movement
        ids = movement.streets.get_ids
        is_allowed: Callable[[int], bool] | None = None
        if allowed is not None:
            allowed = as_array(allowed, "allowed", "booleans", (movement.streets.num_nodes,))
            is_allowed = set(ids(np.flatnonzero(allowed)).tolist()).__contains__
        rows, are_legal = movement.find_legal(node, which)
        are_paced = movement.is_paced[which[1]].tolist()
        modes = movement.mode_of[which[1]].tolist()
        edges = movement.find_edges(which)
        found = np.full(node.shape, -1)
        for place, has_speed in enumerate(are_paced):
            here, target = ids(np.array([node[place], targets[place]])).tolist()
            ends = list[int]()
            if has_speed and movement.leaves_nodes:
                after = movement.columns.targets[edges[place : place + 1]]
                ends = [here, *ids(after if edges[place] >= 0 else after[:0]).tolist()]
            legal = ids(rows[place][are_legal[place]]).tolist()
            routes = self._routes[int(which[1][place])]
            graph = self._graphs[modes[place]]
            options: Any = {"is_allowed": is_allowed}
            step: int | list[int] | EdgeAction | None
            if routes is not None:
                step = step_with_turns(routes, legal, target, by_metres=bool(ends), **options)
            else:
                if movement.by_metres:
                    options["weight"] = movement.terms.weight
                step = step_towards(graph, here, legal, target, ends=ends, has_speed=has_speed, **options)
            if step is not None:
                found[place] = self._find_number(step, legal)
        return found

    def _find_number(self, action: int | list[int] | EdgeAction, legal: list[int]) -> int:
        if isinstance(action, int) and action in legal:
            return legal.index(action)
        self._actions.append(action)
        return _FIRST + len(self._actions) - 1

    def are_known(self, actions: IntArray) -> BoolArray:
        """Return a mask of the actions that `find_action_towards` has returned."""
        return (actions >= _FIRST) & (actions < _FIRST + len(self._actions))

    def get_action(self, number: int) -> int | list[int] | EdgeAction | None:
        """Return the value of `state["action"]` of an action by its number; None: it is the number of a legal node."""
        return self._actions[number - _FIRST] if number >= _FIRST else None


def make_flight_action(flight: Sequence[float], speed: float | None, do: Mapping[str, Any]) -> dict[str, Any]:
    """Return the action for a displacement in map units, limited by the agent's speed."""
    action = {"direction": flight, "distance": min(hypot(*flight), speed or 0.0)}
    return {**action, "do": do} if do else action
