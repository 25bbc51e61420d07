"""Travel by metres: where agents are on the edges of the map, and the legs of their way through a turn.

Rules of motion as in microscopic traffic models with a constant speed per edge (Treiber and Kesting, Traffic Flow
Dynamics, 2013, chapter 6), without interaction: an agent covers speed times time on each edge.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator
from heapq import heappop, heappush
from itertools import chain, islice
from math import inf
from typing import Any, NamedTuple

from gamms.errors import BadValue, NoPath, UnknownName
from gamms.game.settings import Settings
from gamms.ir.graph import GraphColumns
from gamms.ir.progress import Motion, Progress
from gamms.typing.context import HostContext
from gamms.typing.game import Leg
from gamms.typing.graph_engine import IGraph
from gamms.typing.on_edges import Line, OnEdge, placed

ROUNDED = 1e-12  # of a turn: who arrives so shortly before its end is not asked again in it
SLACK = 1e-9  # of a turn: a way that takes exactly as long must not fail by rounding
_MOST_KEPT = 1 << 17  # nodes in reach of others and on paths, about 100 bytes each
LEAST, MOST = 5e-324, 1.0 - 2.0**-53  # of an edge: who is under way is on it, though these shares may be rounded


class Road(NamedTuple):
    """One edge, as agents go along it."""

    edge: int  # id
    source: int  # node id
    target: int  # node id
    length: float  # map units
    cost: float  # by the weight of the game
    seconds: float  # that it takes at least; 0.0 where edges have no speed of their own


class Step(NamedTuple):
    """What an agent covers of one edge if it goes on for long enough."""

    road: Road
    begin: float  # share of the road, from its source
    end: float
    node: int  # that it leads to


class Reached(NamedTuple):
    """The nodes within a turn from one at a speed."""

    legal: tuple[int, ...]  # the node, those next to it, then the others
    nodes: tuple[int, ...]  # as they are reached, of those at once the one with the least id first
    times: tuple[float, ...]  # when each is, in turns


class Roads:
    """The edges of one revision of a graph by their ends; of parallel ones the cheapest, of equal ones the first.

    Args:
        graph: with the edges.
        columns: of the graph.
        weight: of the game, by which agents find their ways.
        seconds: (edges,) that each takes at least; None: edges have no speed of their own.
        turn_seconds: how long a turn lasts, in the time of speeds.
    """

    def __init__(
        self, graph: IGraph, columns: GraphColumns, weight: str | None, seconds: Any, turn_seconds: float
    ) -> None:
        self._graph, self._near, self._weight, self._turn_seconds = graph, graph.neighborhoods, weight, turn_seconds
        self._columns, self._costs, self._seconds = columns, graph.weights(weight), seconds
        self._row_of = {id: row for row, id in enumerate(columns.node_ids.tolist())}
        self._edge_row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())}
        # NOTE: kept, because each agent looks around in each turn (benchmarks: travel).
        self._leaving: dict[int, list[Road]] = {}  # by node; those that were asked for
        self._cheapest: dict[int, dict[int, Road]] = {}  # by nodes
        self._on: dict[int, Road] = {}
        self._back: dict[int, Road | None] = {}  # by the id of an edge
        self._lines: dict[int, Line] = {}
        self._arcs: dict[tuple[int, float], list[tuple[float, int]]] = {}  # by node and speed: turns and target
        self._reached: dict[tuple[int, float], Reached] = {}  # by node and speed
        self._begins: dict[tuple[int, int], list[int]] = {}  # by source and target: the path, or its first nodes
        self._distances: dict[tuple[int, int], float] = {}  # by source and target
        self._kept = 0  # how many nodes are in the last four

    def road(self, source: int, target: int) -> Road | None:
        """Return the cheapest edge from one node to another; None where there is none."""
        found = self._cheapest.get(source)
        if found is None:
            found = self._cheapest[source] = {}
            for road in self.leaving(source):
                if road.target not in found or road.cost < found[road.target].cost:
                    found[road.target] = road
        return found.get(target)

    def on(self, edge: int) -> Road | None:
        """Return an edge by its id; None where there is none."""
        road = self._on.get(edge)
        if road is None:
            row = self._edge_row_of.get(edge)
            road = None if row is None else self._on.setdefault(edge, self._at(row))
        return road

    def of(self, place: Progress) -> Road:
        """Return the edge that an agent is on.

        Raises:
            UnknownName (KeyError): it was closed; agents leave such edges before they are asked.
        """
        road = self.on(place.edge)
        if road is None:
            raise UnknownName("edge", place.edge)
        return road

    def back(self, road: Road) -> Road | None:
        """Return the edge by which one turns round on a road: as long, and the other way."""
        if road.edge not in self._back:
            roads, slack = self.between(road.target, road.source), SLACK * road.length
            self._back[road.edge] = next((one for one in roads if abs(one.length - road.length) <= slack), None)
        return self._back[road.edge]

    def leaving(self, node: int) -> list[Road]:
        """Return the edges that leave a node, in insertion order."""
        roads = self._leaving.get(node)
        if roads is None:
            columns, row = self._columns, self._row_of[node]
            edges = columns.out_edges[columns.offsets[row] : columns.offsets[row + 1]].tolist()
            roads = self._leaving[node] = [self._at(edge) for edge in edges]
        return roads

    def between(self, source: int, target: int) -> list[Road]:
        """Return all edges from one node to another, in insertion order."""
        return [road for road in self.leaving(source) if road.target == target]

    def located(self, place: Progress) -> OnEdge | None:
        """Return what `typing.on_edges.located` does."""
        road = self.on(place.edge)
        if road is None:
            return None
        line = self._lines.get(road.edge)
        if line is None:
            line = self._lines[road.edge] = Line.of(self._graph.get_edge(road.edge).points)
        return placed(place, road.length, line)

    # -- ways -----------------------------------------------------------------------------------------------------

    def steps(self, place: Progress | None, here: int, nodes: Iterable[int], *, is_back: bool) -> Iterator[Step]:
        """Yield the edges of a way, from where an agent is."""
        at = here
        if place is not None:
            road = self.of(place)
            if is_back and self.back(road) is None:
                raise one_way(place.source, place.target)
            at = here if is_back else place.target
            yield Step(road, place.share, 0.0 if is_back else 1.0, at)
        for node in nodes:
            if node == at:
                continue
            next_road = self.road(at, node)
            if next_road is None:
                raise BadValue(f"No edge leads from node {at} to node {node}.")
            yield Step(next_road, 0.0, 1.0, node)
            at = node

    def path(self, source: int, target: int) -> Iterator[int]:
        """Yield the nodes behind `source` on the shortest path to `target`.

        Raises:
            BadValue: no path leads there.
        """
        most_edges = 8
        while source != target:
            begin = self._begins.get((source, target))
            if begin is None:
                try:
                    begin = self._graph.shortest_path(source, target, self._weight, most_edges=most_edges)[1:]
                except NoPath as error:
                    raise BadValue(str(error)) from None
                self._keep(len(begin))
                self._begins[source, target] = begin
            yield from begin
            source, most_edges = begin[-1], 2 * most_edges

    def distance(self, source: int, target: int) -> float:
        """Return the distance from one node to another by the weight of the game; infinite where there is no path."""
        found = self._distances.get((source, target))
        if found is None:
            self._keep(1)
            found = self._distances[source, target] = self._graph.distance(source, target, self._weight)
        return found

    def leg(self, road: Road, begin: float, end: float, since: float, until: float) -> Leg:
        """Return what an agent covers of a road from one time to another."""
        back = self.back(road)
        return Leg(road.source, road.target, road.edge, begin, end, since, until, None if back is None else back.edge)

    # -- how far agents get ---------------------------------------------------------------------------------------

    def turns(self, road: Road, share: float, speed: float | None) -> float:
        """Return how many turns a share of a road takes."""
        if speed is None:
            return share
        metres, seconds = share * road.length, self._turn_seconds
        by_speed = 0.0 if speed == inf or metres == 0.0 else (metres / (speed * seconds) if speed > 0.0 else inf)
        return max(by_speed, share * road.seconds / seconds)

    def reached(self, node: int, speed: float) -> Reached:
        """Return the nodes within a turn from a node."""
        found = self._reached.get((node, speed))
        if found is None:
            times = self.around(node, speed, 0.0, 1.0)
            legal = tuple(dict.fromkeys([*self._near[node], *times]))
            self._keep(len(legal))
            found = self._reached[node, speed] = Reached(legal, tuple(times), tuple(times.values()))
        return found

    def around(self, node: int, speed: float, begun: float, left: float) -> dict[int, float]:
        """Return the nodes within what is left of a turn from a node, with the times at which they are reached.

        Args:
            node: the first one.
            speed: of the agent.
            begun: when it is there.
            left: of the turn.
        """
        found, heap, latest, arcs = dict[int, float](), [(begun, node)], left + SLACK, self._arcs
        while heap:
            now, at = heappop(heap)
            if at in found:
                continue
            found[at] = now
            leaving = arcs.get((at, speed))
            for turns, target in self._arcs_from(at, speed) if leaving is None else leaving:
                then = now + turns
                if then > latest:  # nor will the rest be in reach
                    break
                if target not in found:
                    heappush(heap, (then, target))
        return found

    def _arcs_from(self, node: int, speed: float) -> list[tuple[float, int]]:
        """Return the nodes next to a node that are within a turn from it, by the turns to them."""
        pairs = sorted((self.turns(road, 1.0, speed), road.target) for road in self.leaving(node))
        arcs = self._arcs[node, speed] = [pair for pair in pairs if pair[0] <= 1.0 + SLACK]
        self._keep(len(arcs) + 1)
        return arcs

    def _keep(self, nodes: int) -> None:
        """Count nodes that will be kept; what was kept before is forgotten where there are too many."""
        self._kept += nodes
        if self._kept > _MOST_KEPT:
            for kept in (self._arcs, self._reached, self._begins, self._distances):
                kept.clear()
            self._kept = nodes

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
        graph, settings = self._ctx.graph.graph, self._settings
        key = graph.revision, settings.weight, settings.speed_unit, settings.turn_seconds
        if self._roads is None or key != self._key or key[0] is None:
            turn_seconds = settings.turn_seconds if settings.speed_unit == "metres_per_second" else 1.0
            seconds = graph.weights(settings.weight) if self._has_speeds else None
            roads = Roads(graph, self._ctx.graph.columns(), settings.weight, seconds, turn_seconds)
            self._roads, self._key = roads, key
        return self._roads

    def place(self, row: int) -> Progress | None:
        """Return where on an edge an agent is; None: on its node."""
        place: Progress | None = self._ctx.agent.block.on_edge(row)
        return place

    def is_going(self, place: Progress) -> bool:
        """Whether an agent is on its way along an edge that is there, or back where one may turn round on it."""
        road = self.roads.on(place.edge)
        if road is None or place.motion == Motion.BACK:
            return road is not None and self.roads.back(road) is not None
        return place.motion == Motion.FORWARD

    # -- ways -----------------------------------------------------------------------------------------------------

    def stay(self, place: Progress | None, here: int) -> Way:
        """Return the way of an agent that stops where it is: on an edge, or on its node."""
        return self._ended(self.roads, [here], [self.now], [], place and place._replace(motion=Motion.STOPPED))

    def go_on(self, place: Progress, here: int, speed: float | None) -> Way:
        """Return the way of an agent that is on its way along an edge, and goes on to the end that it heads for."""
        roads = self.roads
        steps = roads.steps(place, here, [], is_back=place.motion == Motion.BACK)
        return self._advance(roads, speed, here, steps, place)

    def along(self, place: Progress | None, here: int, speed: float | None, route: list[int]) -> Way:
        """Return the way along nodes that follow each other, as far as the turn goes.

        Raises:
            BadValue: no edge leads from one to the next, or an agent would have to turn round on a one-way road.
        """
        if not route:
            return self.stay(place, here)
        roads, nodes = self.roads, route[1:] if route[0] == here else route
        is_back = place is not None and (not nodes or nodes[0] != place.target)
        if place is not None and not is_back:
            nodes = nodes[1:]
        return self._advance(roads, speed, here, [*roads.steps(place, here, nodes, is_back=is_back)], place)

    def towards(self, place: Progress | None, here: int, speed: float | None, target: int) -> Way:
        """Return the way towards a node, by the shortest path, as far as the turn goes.

        Raises:
            BadValue: no path leads there.
        """
        roads = self.roads
        if place is None:
            if target == here:
                return self.stay(None, here)
            self._refuse_far(here, target, speed)
            steps = roads.steps(None, here, roads.path(here, target), is_back=False)
            return self._advance(roads, speed, here, steps, None)
        road = roads.of(place)
        may_turn = roads.back(road) is not None
        if target == place.target or (target == here and may_turn):
            return self._advance(roads, speed, here, roads.steps(place, here, [], is_back=target == here), place)
        if speed is None:
            raise BadValue(no_end(target, here, place.target))
        ahead = (1.0 - place.share) * road.cost + roads.distance(place.target, target)
        behind = place.share * road.cost + roads.distance(here, target) if may_turn else inf
        if ahead == behind == inf:
            raise BadValue(
                str(NoPath(place.target, target) if may_turn or target != here else one_way(place.source, place.target))
            )
        is_back = behind < ahead
        nodes = roads.path(here if is_back else place.target, target)
        return self._advance(roads, speed, here, roads.steps(place, here, nodes, is_back=is_back), place)

    def reachable(self, place: Progress | None, here: int, speed: float | None) -> tuple[int, ...]:
        """Return the nodes that an agent may go to: those next to it, then those in reach in this turn.

        Without a speed it may leave an edge for one of its ends only. One whose edge was closed is on the node that it
        has passed last when the next turn begins. One on its way that decides where it arrives gets the nodes that are
        in reach from there.
        """
        roads = self.roads
        road = None if place is None else roads.on(place.edge)
        if place is None or road is None:
            return self._legal_from(roads, here, speed, 0.0)
        ahead, behind = roads.turns(road, 1.0 - place.share, speed), roads.turns(road, place.share, speed)
        if self._settings.decide == "arrival" and self.is_going(place):
            next_node, begun = (here, behind) if place.motion is Motion.BACK else (place.target, ahead)
            return self._legal_from(roads, next_node, speed, begun)
        ends = [(place.target, ahead), *([] if roads.back(road) is None else [(here, behind)])]
        found = [end for end, _ in reversed(ends)]
        if speed is not None:  # else it goes to one of the ends
            near = self._ctx.graph.graph.neighborhoods
            found += chain.from_iterable(near[end] for end, _ in ends)
            found += chain.from_iterable(self._around(roads, end, speed, begun) for end, begun in ends)
        return tuple(dict.fromkeys(found))

    def _legal_from(self, roads: Roads, node: int, speed: float | None, begun: float) -> tuple[int, ...]:
        """Return the nodes that an agent may go to from a node, where it is in a part of a turn."""
        near = self._ctx.graph.graph.neighborhoods[node]
        if speed is None:
            return tuple(near)
        if begun == self.now == 0.0 and (speed < inf or self._has_speeds):
            return roads.reached(node, speed).legal
        return tuple(dict.fromkeys([*near, *self._around(roads, node, speed, begun)]))

    # -- what ways are made of --------------------------------------------------------------------------------------

    def _advance(
        self, roads: Roads, speed: float | None, here: int, steps: Iterable[Step], place: Progress | None
    ) -> Way:
        """Follow steps until the turn is over, or, where agents decide at each node, as far as the next one."""
        if self._settings.decide == "arrival" or speed is None:
            steps = islice(steps, 1)
        now, path, times, legs, endless = self.now, [here], [self.now], list[Leg](), None
        if speed is None or (speed == inf and not self._has_speeds):
            steps = [*steps]
            endless = self._endless(steps)
        for road, begin, end, node in steps:
            share = abs(end - begin)
            takes = roads.turns(road, share, speed) if endless is None else share * road.length * endless
            if now + takes > 1.0 + SLACK:
                part = share * (1.0 - now) / takes if takes < inf else 0.0
                at = begin + part if end > begin else begin - part
                if part > 0.0 and 0.0 < at < 1.0:
                    legs.append(roads.leg(road, begin, at, now, 1.0))
                    motion = Motion.FORWARD if end > begin else Motion.BACK
                    progress = Progress(road.source, road.target, at, road.edge, motion)
                    return self._ended(roads, path, times, legs, progress)
                break
            until = now + takes if now + takes < 1.0 - ROUNDED else 1.0
            legs.append(roads.leg(road, begin, end, now, until))
            now = until
            if node != path[-1]:
                path.append(node)
                times.append(now)
            place = None
        return self._ended(roads, path, times, legs, place)

    def _ended(self, roads: Roads, path: list[int], times: list[float], legs: list[Leg], place: Progress | None) -> Way:
        """Return a way; one that ends on an edge before the turn does stands there."""
        if place is not None:
            since = legs[-1].until if legs else self.now
            if since < 1.0:
                legs.append(roads.leg(roads.of(place), place.share, place.share, since, 1.0))
        return Way(tuple(path), tuple(times), tuple(legs), place)

    def _endless(self, steps: list[Step]) -> float:
        """Return the turns per metre of an agent whose way takes the rest of the turn, however long it is."""
        metres = sum(abs(step.end - step.begin) * step.road.length for step in steps)
        return (1.0 - self.now) / metres if metres else 0.0

    def _refuse_far(self, here: int, target: int, speed: float | None) -> None:
        near = self._ctx.graph.graph.neighborhoods[here]
        if speed is None and target not in near:
            raise BadValue(f"Node {target} is not next to node {here}; legal are {list(near)}.")

    def _around(self, roads: Roads, node: int, speed: float, begun: float) -> Iterable[int]:
        """Return the nodes within what is left of the turn from a node, where an agent is in a part of a turn."""
        left = 1.0 - self.now
        if speed == inf and not self._has_speeds:
            found: Iterable[int] = self._ctx.graph.graph.distances(source=node)
            return found
        if begun > 0.0:
            return roads.around(node, speed, begun, left)
        _, nodes, times = roads.reached(node, speed)
        return nodes[: bisect_right(times, left + SLACK)]

    @property
    def _has_speeds(self) -> bool:
        """Whether edges have speeds of their own."""
        return self._settings.weight == "travel_time" and self._settings.speed_unit == "metres_per_second"


def one_way(source: int, target: int) -> BadValue:
    """Return the error of agents that cannot turn round on an edge."""
    return BadValue(
        f"The edge from node {source} to node {target} is a one-way road: the agent cannot turn round on "
        f"it; legal is node {target}, and what lies beyond."
    )


def no_end(target: int, source: int, end: int) -> str:
    """Return the error of agents without a speed that want to leave their edge for a node that is none of its ends."""
    return f"Node {target} is no end of the edge from node {source} to node {end}."
