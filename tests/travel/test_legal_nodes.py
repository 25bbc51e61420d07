"""Which nodes are legal by metres, and how agents go there, against distances worked out in plain Python."""

from functools import cache
from itertools import product
from math import inf
from random import Random

import pytest

import gamms

SPEEDS = [7.0, 17.0, 17.0, 40.0, 63.0, 110.0, inf, 0.0, None]


class Town:
    """A map whose edges, `id -> (source, target, length, seconds)`, take some turns at a speed."""

    def __init__(self, size, edges, unit, weight, turn_seconds):
        self.size, self.edges, self.unit, self.weight = size, dict(enumerate(edges)), unit, weight
        self.seconds = turn_seconds if unit == "metres_per_second" else 1.0
        self.far = cache(self.far)
        self.has_speeds = unit == "metres_per_second" and weight == "travel_time"

    def open(self, seed, **game):
        """Return a context with the map."""
        game |= {"speed_unit": self.unit, "weight": self.weight, "turn_seconds": self.seconds}
        ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"}, game=game)
        ctx.graph.add_nodes(range(self.size), [10.0 * i for i in range(self.size)], [0.0] * self.size)
        for id, (source, target, length, seconds) in self.edges.items():
            road = {"id": id, "source": source, "target": target, "length": length, "travel_time": seconds}
            ctx.graph.graph.add_edge(road)
        return ctx

    def turns(self, edge, share, speed):
        """How many turns a share of an edge takes."""
        _, _, length, seconds = self.edges[edge]
        metres = share * length
        by_speed = 0.0 if metres == 0.0 or speed == inf else metres / (speed * self.seconds) if speed else inf
        return max(by_speed, share * seconds / self.seconds) if self.has_speeds else by_speed

    def cost(self, edge, share, _speed=None):
        """The weight of a share of an edge."""
        return share * self.edges[edge][2 if self.weight == "length" else 3]

    def next_to(self, node):
        return {node, *(target for source, target, *_ in self.edges.values() if source == node)}

    def far(self, of, speed):
        """What the way between all nodes comes to at least (Floyd and Warshall)."""
        far = {(a, b): 0.0 if a == b else inf for a, b in product(range(self.size), repeat=2)}
        for edge, (source, target, *_) in self.edges.items():
            far[source, target] = min(far[source, target], of(edge, 1.0, speed))
        for via, a, b in product(range(self.size), repeat=3):
            far[a, b] = min(far[a, b], far[a, via] + far[via, b])
        return far

    def ends(self, place, of, speed, heading=None):
        """Where an agent can go first, with what the way there comes to: its node, or the ends of its edge."""
        node, edge, share = place
        if edge is None:
            return {node: 0.0}
        source, target, length, _ = self.edges[edge]
        may_turn = any(one[:3] == (target, source, length) for one in self.edges.values())
        ends = {target: of(edge, 1.0 - share, speed), source: of(edge, share, speed)}
        headings = [heading] if heading is not None else [target, source] if may_turn else [target]
        return {end: ends[end] for end in headings}

    def to(self, place, target, of, speed=None):
        """What the way from a place to a node comes to at least."""
        far = self.far(of, speed)
        return min(begun + far[end, target] for end, begun in self.ends(place, of, speed).items())

    def legal(self, place, speed, left, heading=None):
        """The nodes next to the ends, and all within what is left of the turn; without a speed the ends of an edge."""
        ends, far = self.ends(place, self.turns, speed, heading), self.far(self.turns, speed)
        if speed is None and place[1] is not None and heading is None:
            return set(ends)
        reached = {b for (a, b), more in far.items() if ends.get(a, inf) + more <= left + 1e-9}
        return reached.union(*map(self.next_to, ends))


def random_town(rng):
    """Some nodes with streets of one way or both ways, parallel ones too, some longer in one direction."""
    size, edges = rng.randint(2, 9), []
    ways = [(i, i + 1, rng.choice(["both", "both", "odd"])) for i in range(size - 1)]
    ways += [(*rng.sample(range(size), 2), rng.choice(["forth", "both", "odd"])) for _ in range(rng.randint(0, 3))]
    for a, b, way in ways:
        length = rng.choice([30.0, 10.0, 15.5, 71.25])
        edges.append((a, b, length, rng.choice([2.0, 5.0, 11.0])))
        if way != "forth":
            edges.append((b, a, length + 20.0 * (way == "odd"), rng.choice([2.0, 5.0, 11.0])))
    unit = rng.choice(["metres", "metres", "metres_per_second"])
    return Town(size, edges, unit, rng.choice(["length", "travel_time"]), 3.0)


def place_of(town, agent):
    if agent.edge is None:
        return agent.current_node_id, None, 0.0
    edge = agent.edge[2]
    return agent.current_node_id, edge, agent.offset_m / town.edges[edge][2]


@pytest.mark.parametrize("decide", ["turn", "arrival"])
@pytest.mark.parametrize("seed", range(20))
def test_legal_nodes_are_those_in_reach_and_agents_go_there_by_the_cheapest_way(decide, seed):
    rng = Random(seed)
    town = random_town(rng)
    with town.open(seed, on_illegal="raise", decide=decide) as ctx:
        chosen = []

        def walk(state):
            place, legal, draw, time = place_of(town, anna), state["legal"], state["draw"], state.get("time", 0.0)
            assert set(legal) == town.legal(place, anna.speed, 1.0 - time)
            known = [to for to in range(town.size) if town.to(place, to, town.cost) < inf]
            targets = [None, *legal] if anna.speed is None else [None, *legal, *known, *known]
            state["action"] = targets[draw.below(len(targets))]
            chosen.append((place, state["action"], time))

        anna = ctx.agent.create_agent("anna", start_node_id=seed % town.size, strategy=walk)
        for anna.speed in rng.choices(SPEEDS, k=24):
            chosen.clear()
            ctx.game.step()
            legs, here = ctx.game.moves["anna"].legs, place_of(town, anna)
            if decide == "arrival" and anna.edge is not None and legs[-1].begin != legs[-1].end:  # it decides there
                heading = legs[-1].target if legs[-1].end > legs[-1].begin else legs[-1].source
                assert set(ctx.game.observation("anna")["legal"]) == town.legal(here, anna.speed, 1.0, heading)
            place, target, time = chosen[-1] if chosen else (None, None, 0.0)
            if target is not None:
                covered = sum(town.cost(leg.edge, abs(leg.end - leg.begin)) for leg in legs if leg.since >= time)
                left = town.to(here, target, town.cost)
                assert covered + left == pytest.approx(town.to(place, target, town.cost))
                assert anna.speed is not None or anna.edge is None
