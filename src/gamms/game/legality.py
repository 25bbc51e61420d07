"""Which actions are legal, and where they lead."""

from collections.abc import Iterable, Sequence
from math import inf
from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms.arguments import as_float
from gamms.errors import BadValue, GammsError, NoPath, UnknownName
from gamms.game.settings import Settings
from gamms.ir.agents import Position, Progress, Quat
from gamms.typing.actions import as_node, flight, heading_in
from gamms.typing.context import HostContext

_SLACK = 1e-9  # of the edges or metres of a turn: a path that is as long as these must not fail by rounding


class IllegalAction(GammsError, ValueError):
    """An action that is malformed, or not legal."""


class Mover(Protocol):
    """What of an agent decides which actions are legal."""

    row: int
    flies: bool
    is_plain: bool  # whether it moves along one edge, on the ground
    speed: float | None  # in the unit of the game; None for one edge


class ResolvedAction(NamedTuple):
    """What one agent is going to do."""

    end: int  # node id
    path: tuple[int, ...]  # node ids, from the agent's node to the end
    heading: Any = ()  # (cos, sin) to face from now on, None to follow moves again; () leaves it
    times: tuple[float, ...] = ()  # when it is at each node of the path, from 0 to 1; (): evenly
    progress: Progress | None = None  # along the edge behind the end of the path
    position: Position | None = None  # of a flyer
    quat: Quat | None = None


class Legality:
    """Which actions of agents are legal, and where they lead.

    Args:
        ctx: the context, whose graph and agents count.
        settings: of the game.
    """

    def __init__(self, ctx: HostContext, settings: Settings) -> None:
        self._ctx, self._settings = ctx, settings
        self._lengths: tuple[int | None, dict[tuple[int, int], float]] = (None, {})

    def resolve(self, mover: Mover, here: int, action: object) -> ResolvedAction:
        """Return what an action leads to.

        Raises:
            GammsError: it is malformed, or not legal; the message says why.
        """
        if mover.flies:
            position, quat = flight(self._ctx.agent.block, mover.row, action)
            return ResolvedAction(here, (here,), position=position, quat=quat)
        heading: Any = ()
        if isinstance(action, dict):
            heading = heading_in(action)
            action = action["node_id"]
        if isinstance(action, (list, np.ndarray)) and np.ndim(action) == 1:
            path, is_route = self._checked_path(here, action), True
        else:
            path, is_route = [self._node(action)], False
        resolved = self._walk(mover, here, path, is_route=is_route)
        return resolved if heading == () else resolved._replace(heading=heading)

    def reachable(self, mover: Mover, here: int) -> tuple[int, ...]:
        """Return the nodes that an agent may move to in this turn, its own first; none for a flyer."""
        if mover.flies:
            return ()
        graph = self._ctx.graph.graph
        if mover.is_plain:
            return tuple(graph.neighborhoods[here])
        if self._settings.legal == "any":
            return (here, *(id for id in graph.get_nodes() if id != here))
        speed = mover.speed or 0.0
        near = [*graph.neighborhoods[here], *self._around(here, speed)]
        begun, covered = self._begun(mover, here)
        if begun is not None:
            left = _limit(speed + covered) - self._cost(here, begun)  # less than the speed
            near += [node for node, far in self._around(begun, speed).items() if far <= left]
        return tuple(dict.fromkeys(near))

    def reachable_each(self, movers: Sequence[Mover], starts: Sequence[int]) -> list[Sequence[int]]:
        """Return what `reachable` returns for each of several agents."""
        near = self._ctx.graph.graph.neighborhoods
        pairs = zip(movers, starts, strict=True)
        return [near[here] if mover.is_plain else self.reachable(mover, here) for mover, here in pairs]

    def _node(self, action: object) -> int:
        node = as_node(action)
        if not self._ctx.graph.graph.has_node(node):
            raise UnknownName("node", node)
        return node

    def _checked_path(self, here: int, action: Iterable[object]) -> list[int]:
        """Return a list of nodes that was given as an action, without the node the agent is on."""
        path = [self._node(node) for node in action]
        path = path[1:] if path and path[0] == here else path
        near = self._ctx.graph.graph.neighborhoods
        if self._settings.legal == "edges":
            for start, end in zip([here, *path], path, strict=False):
                if end not in near[start]:
                    raise BadValue(f"No edge leads from node {start} to node {end}.")
        return path

    def _walk(self, mover: Mover, here: int, path: list[int], *, is_route: bool) -> ResolvedAction:
        """Return where a path, or the shortest one to its only node, leads in this turn."""
        if not path or (path == [here] and not is_route):
            return ResolvedAction(here, (here,))
        if self._settings.legal == "any":
            return ResolvedAction(path[-1], (here, *path))
        if mover.speed is None:
            near = self._ctx.graph.graph.neighborhoods[here]
            if len(path) > 1 or path[0] not in near:
                raise BadValue(f"Node {path[-1]} is not next to node {here}; legal are {list(near)}.")
            return ResolvedAction(path[0], (here, path[0]))
        begun, covered = self._begun(mover, here)
        if not is_route:
            path = self._shortest(here, path[0], begun, covered)
        return self._as_far_as(mover.speed, here, path, covered if path[0] == begun else 0.0)

    def _shortest(self, here: int, target: int, begun: int | None, covered: float) -> list[int]:
        """Return the shortest path to a node, on from `here` or along the edge that the agent has begun."""
        graph, weight = self._ctx.graph.graph, self._weight()
        try:
            path: list[int] = graph.shortest_path(here, target, weight)[1:]
            if begun is not None and begun != path[0]:
                left = self._cost(here, begun) - covered + graph.distance(begun, target, weight)
                if left <= graph.distance(here, target, weight):
                    path = graph.shortest_path(begun, target, weight)
        except NoPath as error:
            raise BadValue(str(error)) from None
        return path

    def _as_far_as(self, speed: float, here: int, route: list[int], covered: float) -> ResolvedAction:
        """Follow a path as far as the edges or metres of this turn go; `covered` is what was gone before it."""
        budget, gone, path, reached = speed + covered, 0.0, [here], [0.0]
        limit = _limit(budget)
        for node in route:
            cost = self._cost(path[-1], node)
            if gone + cost > limit:
                share = (budget - gone) / cost
                progress = Progress(path[-1], node, share) if _SLACK < share < 1.0 and node != path[-1] else None
                break
            gone += cost
            path.append(node)
            reached.append(gone)
        else:
            progress = None
        return ResolvedAction(path[-1], tuple(path), times=self._times(speed, reached, covered), progress=progress)

    def _times(self, speed: float, reached: list[float], covered: float) -> tuple[float, ...]:
        """Return when an agent is at each node of its path, by their distances; () for evenly from 0 to 1."""
        if self._settings.speed_unit == "edges":
            return ()
        pace = speed if speed < inf else reached[-1]
        return (0.0, *(min(1.0, round((far - covered) / pace, 9)) if far > covered else 0.0 for far in reached[1:]))

    def _begun(self, mover: Mover, here: int) -> tuple[int | None, float]:
        """Return the end of the edge that an agent has covered part of, and how much of it in edges or metres."""
        progress = self._ctx.agent.block.progress[mover.row]
        if (
            progress is None
            or progress.source != here
            or progress.target not in self._ctx.graph.graph.neighborhoods[here]
        ):
            return None, 0.0
        return progress.target, progress.share * self._cost(here, progress.target)

    def _around(self, node: int, speed: float) -> dict[int, float]:
        """Return the nodes within one turn at a speed, with their distances."""
        # NOTE: always by a speed, because the graph keeps what it has found around a node for one cutoff.
        cutoff = None if speed == inf else _limit(speed)
        near: dict[int, float] = self._ctx.graph.graph.distances(source=node, weight=self._weight(), cutoff=cutoff)
        return near

    def _cost(self, source: int, target: int) -> float:
        """Return the edges or metres to the next node; to wait costs one edge, and no metres."""
        if self._settings.speed_unit == "edges":
            return 1.0
        return 0.0 if source == target else self._length_of(source, target)

    def _weight(self) -> str | None:
        return "length" if self._settings.speed_unit == "metres" else None

    def _length_of(self, source: int, target: int) -> float:
        """Return the length of the shortest edge from one node to another, map units."""
        revision, lengths = self._lengths
        graph = self._ctx.graph.graph
        if revision is None or revision != graph.revision:
            columns, lengths = self._ctx.graph.columns(), {}
            ends = columns.node_ids[columns.sources].tolist(), columns.node_ids[columns.targets].tolist()
            for start_id, end_id, length in zip(*ends, columns.lengths.tolist(), strict=True):
                known = lengths.get((start_id, end_id))
                lengths[start_id, end_id] = length if known is None else min(known, length)
            self._lengths = graph.revision, lengths
        return as_float(lengths[source, target], "length")


def _limit(budget: float) -> float:
    """Return the largest length that counts as within a budget."""
    return budget * (1.0 + _SLACK)
