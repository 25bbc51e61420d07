"""Laws of motion on random graphs, against an independent simulation in plain Python."""

from bisect import bisect_right
from itertools import accumulate, pairwise
from math import dist

from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.rules import contacts

TURNS, STEPS = 6, 500
NEAR = 11.0
HOW = [{}, {"euclid": NEAR}, {"metres": NEAR}]


class Walker:
    """Goes along nodes at a speed from time 0 on, and stands at the last one."""

    def __init__(self, xy, nodes, speed):
        self.xy, self.nodes, self.speed = xy, nodes, speed
        lengths = [dist(xy[a], xy[b]) for a, b in pairwise(nodes)]
        self.far = [0.0, *accumulate(lengths)]

    def on_street(self, time):
        """The ends of the street it is on, in their order, and how far from the first; a node has itself twice."""
        gone = self.speed * time
        i = bisect_right(self.far, gone) - 1
        if i >= len(self.nodes) - 1:
            return (self.nodes[-1], self.nodes[-1]), 0.0
        a, b = self.nodes[i], self.nodes[i + 1]
        along = gone - self.far[i]
        return ((a, b), along) if a < b else ((b, a), self.far[i + 1] - self.far[i] - along)

    def at(self, time):
        (a, b), along = self.on_street(time)
        length = dist(self.xy[a], self.xy[b]) or 1.0
        share = along / length
        return tuple(p + share * (q - p) for p, q in zip(self.xy[a], self.xy[b], strict=True))


@st.composite
def plays(draw):
    """A small town, and two walkers in it."""
    size = draw(st.integers(3, 6))
    xy = {i: (37.0 * i, (29.0 * i * i) % 101.0) for i in range(size)}
    pairs = {(i, i + 1) for i in range(size - 1)} | set(
        draw(st.lists(st.tuples(st.integers(0, size - 1), st.integers(0, size - 1)), max_size=4))
    )
    pairs = sorted({(min(pair), max(pair)) for pair in pairs if pair[0] != pair[1]})
    near = {i: sorted({b for a, b in pairs if a == i} | {a for a, b in pairs if b == i}) for i in range(size)}
    walks = []
    for _ in range(2):
        nodes = [draw(st.integers(0, size - 1))]
        for _ in range(draw(st.integers(0, 8))):
            nodes.append(draw(st.sampled_from(near[nodes[-1]])))
        walks.append(Walker(xy, nodes, draw(st.floats(2.0, 60.0).map(lambda v: v + 0.1234567))))
    return xy, pairs, walks


def play(xy, pairs, walks):
    """Play it, and return the times of their contacts in each turn, by each distance."""
    game = {"speed_unit": "metres", "on_illegal": "raise"}
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game=game) as ctx:
        ctx.graph.add_nodes(list(xy), [x for x, _ in xy.values()], [y for _, y in xy.values()])
        ends = [*pairs, *((b, a) for a, b in pairs)]
        lengths = [dist(xy[a], xy[b]) for a, b in ends]
        ctx.graph.add_edges(range(len(ends)), [a for a, _ in ends], [b for _, b in ends], lengths)
        left = {str(i): walk.nodes for i, walk in enumerate(walks)}
        for i, walk in enumerate(walks):
            agent = ctx.agent.create_agent(str(i), start_node_id=walk.nodes[0], speed=walk.speed, team=i)
            agent.strategy = lambda state: state.update(action=left[state["name"]] if left[state["name"]][1:] else None)
        met = []
        for _ in range(TURNS):
            ctx.game.step()
            for name, move in ctx.game.moves.items():
                left[name] = left[name][len(move.path) - 1 :]
            met.append([[one.time for one in contacts(ctx, 0, 1, **how)] for how in HOW])
        return met


def along_streets(xy, far, one, other):
    """The distance by the streets, all of which lead both ways."""
    ((a, b), i), ((c, d), k) = one, other
    ends = ((a, i), (b, dist(xy[a], xy[b]) - i)), ((c, k), (d, dist(xy[c], xy[d]) - k))
    ways = [gone + far[node, its] + more for node, gone in ends[0] for its, more in ends[1]]
    return min([*ways, abs(i - k)] if (a, b) == (c, d) else ways)


def all_distances(xy, pairs):
    """The lengths of the shortest ways between all nodes (Floyd and Warshall), and 0 from each to itself."""
    far = {(a, b): 0.0 if a == b else float("inf") for a in xy for b in xy}
    far |= {pair: dist(xy[pair[0]], xy[pair[1]]) for a, b in pairs for pair in ((a, b), (b, a))}
    for via in xy:
        for a in xy:
            for b in xy:
                far[a, b] = min(far[a, b], far[a, via] + far[via, b])
    return far


@given(town=plays())
def test_agents_are_near_each_other_when_small_steps_say(town):
    xy, pairs, (one, other) = town
    met = play(xy, pairs, (one, other))
    far = all_distances(xy, pairs)
    for kind in (1, 2):

        def apart(time, kind=kind):
            if kind == 1:
                return dist(one.at(time), other.at(time))
            return along_streets(xy, far, one.on_street(time), other.on_street(time))

        for turn in range(TURNS):
            times = met[turn][kind]
            first = min((turn + time for time in times), default=turn + 1.0)
            if times:
                assert apart(first) <= NEAR + 1e-6
            for i in range(1, STEPS, 10):
                moment = turn + i / STEPS
                assert moment >= first or apart(moment) > NEAR - 1e-6
