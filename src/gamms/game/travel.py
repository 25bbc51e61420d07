"""Travel by metres: where agents are on the edges of the map, and the legs of their way through a turn.

Rules of motion as in microscopic traffic models with a constant speed per edge (Treiber and Kesting, Traffic Flow
Dynamics, 2013, chapter 6), without interaction: an agent covers speed times time on each edge.
"""

from collections.abc import Iterable
from heapq import heappop, heappush
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple

from gamms.errors import BadValue, NoPath, UnknownName
from gamms.game.settings import Settings
from gamms.ir.agents import Motion, Progress
from gamms.ir.graph import GraphColumns
from gamms.typing.context import HostContext
from gamms.typing.game import Leg

ROUNDED = 1e-12  # of a turn: who arrives so shortly before its end is not asked again in it
SLACK = 1e-9  # of a turn: a way that takes exactly as long must not fail by rounding
LEAST, MOST = 5e-324, 1.0 - 2.0**-53  # of an edge: who is under way is on it, though these shares may be rounded


class Road(NamedTuple):
    """One edge, as agents go along it."""

    edge: int  # id
    source: int  # node id
    target: int  # node id
    length: float  # map units
    cost: float  # by the weight of the game
    seconds: float  # that it takes at least; 0.0 where edges have no speed of their own


class Roads:
    """The edges of one revision of a graph by their ends; of parallel ones the cheapest, of equal ones the first.

    Args:
        columns: of the graph.
        costs: (edges,) by the weight of the game.
        seconds: (edges,) that each takes at least; None: edges have no speed of their own.
    """

    def __init__(self, columns: GraphColumns, costs: Any, seconds: Any) -> None:
        self._columns, self._costs, self._seconds = columns, costs, seconds
        self._row_of = {id: row for row, id in enumerate(columns.node_ids.tolist())}
        self._edge_row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
        self._leaving: dict[int, list[Road]] = {}  # by node; those that were asked for
        self._on: dict[int, Road] = {}

    def road(self, source: int, target: int) -> Road | None:
        """Return the cheapest edge from one node to another; None where there is none."""
        roads = self.between(source, target)
        return min(roads, key=lambda road: road.cost) if roads else None

    def on(self, edge: int) -> Road | None:
        """Return an edge by its id; None where there is none."""
        if edge not in self._on:
            row = self._edge_row_of.get(edge)
            if row is None:
                return None
            self._on[edge] = self._at(row)
        return self._on[edge]

    def back(self, road: Road) -> Road | None:
        """Return the edge by which one turns round on a road: as long, and the other way."""
        roads = self.between(road.target, road.source)
        return next((one for one in roads if abs(one.length - road.length) <= SLACK * road.length), None)

    def leaving(self, node: int) -> list[Road]:
        """Return the edges that leave a node, in insertion order."""
        # NOTE: kept, because each agent looks around in each turn (benchmarks: travel).
        roads = self._leaving.get(node)
        if roads is None:
            columns, row = self._columns, self._row_of[node]
            edges = columns.out_edges[columns.offsets[row] : columns.offsets[row + 1]].tolist()
            roads = self._leaving[node] = [self._at(edge) for edge in edges]
        return roads

    def between(self, source: int, target: int) -> list[Road]:
        """Return all edges from one node to another, in insertion order."""
        return [road for road in self.leaving(source) if road.target == target]

    def _at(self, row: int) -> Road:
        columns = self._columns
        return Road(
            columns.edge_ids.item(row),
            columns.node_ids.item(columns.sources.item(row)),
            columns.node_ids.item(columns.targets.item(row)),
            columns.lengths.item(row),
            float(self._costs[row]),
            0.0 if self._seconds is None else float(self._seconds[row]),
        )


class Way(NamedTuple):
    """Where an agent goes in a turn.

    Attributes:
        path: ids of the nodes that it passes, the last one that it had passed before first.
        times: when it is at each, from 0 to 1.
        legs: what it covers, in order; those on which it stands on an edge, too.
        progress: where on an edge it is at the end; None: on the last node of the path.
    """

    path: tuple[int, ...]
    times: tuple[float, ...]
    legs: tuple[Leg, ...]
    progress: Progress | None


def progress_at(leg: Leg, time: float) -> Progress | None:
    """Return where an agent on a leg is at a time of the turn; None: on a node."""
    share = leg.share_at(time) if time < leg.until else leg.end
    if time < leg.until and leg.begin != leg.end:
        share = min(max(share, LEAST), MOST)
    if not 0.0 < share < 1.0:
        return None
    moving = Motion.FORWARD if leg.end > leg.begin else Motion.BACK
    motion = Motion.STOPPED if leg.end == leg.begin else moving
    return Progress(leg.source, leg.target, share, leg.edge, motion)


class _Step(NamedTuple):
    road: Road
    begin: float  # share of the road, from its source
    end: float
    node: int  # that it leads to


class Travel:
    """Where agents of a game by metres go.

    Args:
        ctx: the context, whose graph and agents count.
        settings: of the game.

    Attributes:
        now: of the turn, from 0 to 1: when the agents that are asked act.
    """

    def __init__(self, ctx: HostContext, settings: Settings) -> None:
        self._ctx, self._settings = ctx, settings
        self._roads: Roads | None = None
        self._key: tuple[Any, ...] = ()
        self.now = 0.0

    @property
    def roads(self) -> Roads:
        """The edges as they are now."""
        graph, weight = self._ctx.graph.graph, self._settings.weight
        key = graph.revision, weight, self._settings.speed_unit
        if self._roads is None or key != self._key or key[0] is None:
            costs = graph.weights(weight)
            seconds = costs if self._has_speeds else None
            self._roads, self._key = Roads(self._ctx.graph.columns(), costs, seconds), key
        return self._roads

    def place(self, row: int) -> Progress | None:
        """Return where on an edge an agent is; None: on its node."""
        place: Progress | None = self._ctx.agent.block.on_edge(row)
        return place

    def is_going(self, place: Progress) -> bool:
        """Whether an agent is on its way along an edge that is there."""
        return place.motion in (Motion.FORWARD, Motion.BACK) and self.roads.on(place.edge) is not None

    # -- ways -----------------------------------------------------------------------------------------------------

    def stay(self, row: int, here: int) -> Way:
        """Return the way of an agent that stops where it is."""
        place = self.place(row)
        return self._ended([here], [self.now], [], place and place._replace(motion=Motion.STOPPED))

    def go_on(self, row: int, here: int, speed: float | None) -> Way:
        """Return the way of an agent that is on its way along an edge, and goes on to the end that it heads for."""
        place = self.place(row)
        if place is None:
            return self.stay(row, here)
        return self._advance(speed, here, self._steps(place, here, [], is_back=place.motion == Motion.BACK), place)

    def along(self, row: int, here: int, speed: float | None, route: list[int]) -> Way:
        """Return the way along nodes that follow each other, as far as the turn goes.

        Raises:
            BadValue: no edge leads from one to the next, or an agent would have to turn round on a one-way road.
        """
        if not route:
            return self.stay(row, here)
        place = self.place(row)
        nodes = route[1:] if route[0] == here else route
        is_back = place is not None and (not nodes or nodes[0] != place.target)
        if place is not None and not is_back:
            nodes = nodes[1:]
        return self._advance(speed, here, self._steps(place, here, nodes, is_back=is_back), place)

    def towards(self, row: int, here: int, speed: float | None, target: int) -> Way:
        """Return the way towards a node, by the shortest path, as far as the turn goes.

        Raises:
            BadValue: no path leads there.
        """
        place = self.place(row)
        if place is None:
            if target == here:
                return self.stay(row, here)
            self._refuse_far(here, target, speed)
            nodes = self._path(here, target, speed)
            return self._advance(speed, here, self._steps(None, here, nodes, is_back=False), None)
        road = self._road_of(place)
        may_turn = self.roads.back(road) is not None
        if target == place.target or (target == here and may_turn):
            return self._advance(speed, here, self._steps(place, here, [], is_back=target == here), place)
        if speed is None:
            raise BadValue(no_end(target, here, place.target))
        graph, weight = self._ctx.graph.graph, self._settings.weight
        ahead = (1.0 - place.share) * road.cost + graph.distance(place.target, target, weight)
        behind = place.share * road.cost + graph.distance(here, target, weight) if may_turn else inf
        if ahead == behind == inf:
            raise BadValue(
                str(NoPath(place.target, target) if may_turn or target != here else one_way(place.source, place.target))
            )
        is_back = behind < ahead
        nodes = self._path(here if is_back else place.target, target, speed)
        return self._advance(speed, here, self._steps(place, here, nodes, is_back=is_back), place)

    def reachable(self, row: int, here: int, speed: float | None) -> tuple[int, ...]:
        """Return the nodes that an agent may go to: those next to it, then those in reach in this turn.

        Without a speed it may leave an edge for one of its ends only. One whose edge was closed is on the node that it
        has passed last when the next turn begins. One on its way that decides where it arrives gets the nodes that are
        in reach from there.
        """
        near, place = self._ctx.graph.graph.neighborhoods, self.place(row)
        if place is None or self.roads.on(place.edge) is None:
            found = [*near[here], *self._around(here, speed, 0.0)]
        elif self._settings.decide == "arrival" and self.is_going(place):
            is_back = place.motion is Motion.BACK
            end, share = (here, place.share) if is_back else (place.target, 1.0 - place.share)
            found = [*near[end], *self._around(end, speed, self._turns(self._road_of(place), share, speed))]
        else:
            road = self._road_of(place)
            may_turn = self.roads.back(road) is not None
            ends = [(place.target, 1.0 - place.share), *([(here, place.share)] if may_turn else [])]
            found = [*([here] if may_turn else []), place.target]
            if speed is not None:  # else it goes to one of the ends
                found += [node for end, _ in ends for node in near[end]]
                found += [
                    node for end, part in ends for node in self._around(end, speed, self._turns(road, part, speed))
                ]
        return tuple(dict.fromkeys(found))

    # -- what ways are made of --------------------------------------------------------------------------------------

    def _steps(self, place: Progress | None, here: int, nodes: Iterable[int], *, is_back: bool) -> list[_Step]:
        """Return the edges of a way, from where an agent is."""
        steps, at = [], here
        if place is not None:
            road = self._road_of(place)
            if is_back and self.roads.back(road) is None:
                raise one_way(place.source, place.target)
            at = here if is_back else place.target
            steps.append(_Step(road, place.share, 0.0 if is_back else 1.0, at))
        for node in nodes:
            if node == at:
                continue
            next_road = self.roads.road(at, node)
            if next_road is None:
                raise BadValue(f"No edge leads from node {at} to node {node}.")
            steps.append(_Step(next_road, 0.0, 1.0, node))
            at = node
        return steps

    def _advance(self, speed: float | None, here: int, steps: list[_Step], place: Progress | None) -> Way:
        """Follow steps until the turn is over, or, where agents decide at each node, as far as the next one."""
        if self._settings.decide == "arrival" or speed is None:
            steps = steps[:1]
        now, path, times, legs = self.now, [here], [self.now], list[Leg]()
        endless = self._endless(steps) if speed in (None, inf) else None
        for step in steps:
            share = abs(step.end - step.begin)
            takes = self._turns(step.road, share, speed) if endless is None else share * step.road.length * endless
            if now + takes > 1.0 + SLACK:
                part = share * (1.0 - now) / takes if takes < inf else 0.0
                end = step.begin + part if step.end > step.begin else step.begin - part
                if part > 0.0 and 0.0 < end < 1.0:
                    legs.append(self._leg(step.road, step.begin, end, now, 1.0))
                    motion = Motion.FORWARD if step.end > step.begin else Motion.BACK
                    return self._ended(path, times, legs, Progress(*step.road[1:3], end, step.road.edge, motion))
                break
            until = now + takes if now + takes < 1.0 - ROUNDED else 1.0
            legs.append(self._leg(step.road, step.begin, step.end, now, until))
            now = until
            if step.node != path[-1]:
                path.append(step.node)
                times.append(now)
            place = None
        return self._ended(path, times, legs, place)

    def _ended(self, path: list[int], times: list[float], legs: list[Leg], place: Progress | None) -> Way:
        """Return a way; one that ends on an edge before the turn does stands there."""
        if place is not None:
            since = legs[-1].until if legs else self.now
            if since < 1.0:
                legs.append(self._leg(self._road_of(place), place.share, place.share, since, 1.0))
        return Way(tuple(path), tuple(times), tuple(legs), place)

    def _endless(self, steps: list[_Step]) -> float:
        """Return the turns per metre of an agent whose way takes the rest of the turn, however long it is."""
        metres = sum(abs(step.end - step.begin) * step.road.length for step in steps)
        return (1.0 - self.now) / metres if metres else 0.0

    def _turns(self, road: Road, share: float, speed: float | None) -> float:
        """Return how many turns a share of a road takes."""
        if speed is None:
            return share
        settings = self._settings
        seconds = settings.turn_seconds if settings.speed_unit == "metres_per_second" else 1.0
        metres = share * road.length
        by_speed = 0.0 if speed == inf or metres == 0.0 else (metres / (speed * seconds) if speed > 0.0 else inf)
        return max(by_speed, share * road.seconds / seconds)

    def _path(self, source: int, target: int, speed: float | None) -> list[int]:
        """Return the nodes behind `source` on the shortest path to `target`, as many at least as a turn leads to."""
        graph, weight, edges = self._ctx.graph.graph, self._settings.weight, 2
        if source == target:
            return []
        while True:
            try:
                path: list[int] = graph.shortest_path(source, target, weight, most_edges=edges)
            except NoPath as error:
                raise BadValue(str(error)) from None
            if path[-1] == target or self._lasts(path, speed):
                return path[1:]
            edges *= 2

    def _lasts(self, path: list[int], speed: float | None) -> bool:
        """Whether a path takes longer than a turn."""
        roads = [self.roads.road(a, b) for a, b in pairwise(path)]
        return sum(self._turns(road, 1.0, speed) for road in roads if road is not None) > 1.0 + SLACK

    def _refuse_far(self, here: int, target: int, speed: float | None) -> None:
        near = self._ctx.graph.graph.neighborhoods[here]
        if speed is None and target not in near:
            raise BadValue(f"Node {target} is not next to node {here}; legal are {list(near)}.")

    def _around(self, node: int, speed: float | None, begun: float) -> dict[int, float]:
        """Return the nodes within a turn from a node, with the time of the turn at which they are reached.

        `begun` is the part of the turn that it takes to the node.
        """
        left = 1.0 - self.now
        if speed is None:
            return {}
        if speed == inf and not self._has_speeds:
            return dict.fromkeys(self._ctx.graph.graph.distances(source=node), begun)
        found, heap, roads = dict[int, float](), [(begun, node)], self.roads
        while heap:
            now, at = heappop(heap)
            if at in found:
                continue
            found[at] = now
            for road in roads.leaving(at):
                if road.target not in found:
                    then = now + self._turns(road, 1.0, speed)
                    if then <= left + SLACK:
                        heappush(heap, (then, road.target))
        return found

    @property
    def _has_speeds(self) -> bool:
        """Whether edges have speeds of their own."""
        return self._settings.weight == "travel_time" and self._settings.speed_unit == "metres_per_second"

    def _leg(self, road: Road, begin: float, end: float, since: float, until: float) -> Leg:
        back = self.roads.back(road)
        return Leg(road.source, road.target, road.edge, begin, end, since, until, None if back is None else back.edge)

    def _road_of(self, place: Progress) -> Road:
        road = self.roads.on(place.edge)
        if road is None:  # closed edges are left before agents are asked
            raise UnknownName("edge", place.edge)
        return road


def one_way(source: int, target: int) -> BadValue:
    """Return the error of agents that cannot turn round on an edge."""
    return BadValue(
        f"The edge from node {source} to node {target} is a one-way road: the agent cannot turn round on "
        f"it; legal is node {target}, and what lies beyond."
    )


def no_end(target: int, source: int, end: int) -> str:
    """Return the error of agents without a speed that want to leave their edge for a node that is none of its ends."""
    return f"Node {target} is no end of the edge from node {source} to node {end}."
