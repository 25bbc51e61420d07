"""Contacts of one game by the core: facts, and random games against the definition, pair by pair."""

from array import array
from itertools import pairwise, product
from math import dist, inf

from hypothesis import given
from hypothesis import strategies as st

from gamms.core import contacts as core
from gamms.core import draws, travel

NODES = 5
XY = [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (0.0, 4.0), (1.5, 2.0)]
OURS, THEIRS = 1, 2


def ints(values):
    return memoryview(array("q", values))


def keys(values):
    return memoryview(array("Q", values))


def floats(values):
    return memoryview(array("d", values))


NO_LEGS = core.Legs(0, *[ints([])] * 6, *[floats([])] * 5)


def contacts(game, *, reach=None, limit=None, crossing=False, at_end=False, seed=7):
    """The contacts of agents (side, path, times), in their order.

    Each is (a, b, time, distance, on an edge?, where a was, where b was).
    """
    agents = len(game)
    most = max(len(path) for _, path, _ in game)
    tracks = core.Tracks(
        agents,
        most,
        ints([node for _, path, _ in game for node in (*path, *path[-1:] * (most - len(path)))]),
        floats([time for _, path, times in game for time in (*times, *[1.0] * (most - len(path)))]),
        ints([len(path) for _, path, _ in game]),
        ints([side for side, _, _ in game]),
        at_end=at_end,
    )
    pieces = agents * 2 * (most + 2)
    scratch = core.MotionIntervals(
        *[ints([0] * pieces) for _ in range(3)],
        *[floats([0.0] * pieces) for _ in range(4)],
        ints([0] * pieces),
        ints([0] * pieces),
        ints([-1] * NODES),
        ints([0] * pieces),
    )
    found = core.Contacts(scratch)
    nodes = ints([node for _, path, _ in game for node in (*path, *path[-1:] * (most - len(path)))])
    found.ask(
        tracks,
        NO_LEGS,
        keys(range(1, agents + 1)),
        keys([seed]),
        ints([3]),
        reach=table(reach or {}, limit or 0.0),
        places=core.NodePositions(nodes, floats([value for x, y in XY for value in (x, y, 0.0)])),
        lines=core.PathSegments(0, core.Polylines(), floats([])),
        crossing=crossing,
        by_metres=False,
    )
    search = "by paths" if reach is not None else "on nodes" if limit is None else "near places"
    kept = found.find(core.SEARCHES[search], limit or 0.0)
    columns = found.a, found.b, found.times, found.distances, found.on_edges, found.a_nodes, found.b_nodes
    return [tuple(column[k] for column in columns) for k in found.order[:kept]]


def table(reach, limit=0.0):
    """`core.NearNodes` of the edges of node -> {node: length}."""
    rows = [sorted(reach.get(node, {}).items()) for node in range(NODES)]
    arcs = [sum(map(len, rows[:node])) for node in range(NODES + 1)]
    flat = [edge for row in rows for edge in row]
    search = travel.ReachSearch(*[ints([0] * NODES) if kind == "q" else floats([0.0] * NODES) for kind in "qdqqqdqq"])
    return core.NearNodes(ints(arcs), ints([end for end, _ in flat]), floats([far for _, far in flat]), limit, search)


def pairs(*args, **kwargs):
    return [one[:3] for one in contacts(*args, **kwargs)]


# -- facts ------------------------------------------------------------------------------------------------------------


def test_agents_pass_each_other_only_while_both_are_on_the_edge():
    together = [(OURS, (0, 1), (0.0, 0.5)), (THEIRS, (1, 0), (0.25, 1.0))]
    one_after_the_other = [(OURS, (0, 1), (0.0, 0.5)), (THEIRS, (1, 1, 0), (0.0, 0.5, 1.0))]
    assert contacts(together, crossing=True) == [(0, 1, 0.25, 0.0, True, 0, 1)]
    assert contacts(together, crossing=True, at_end=True) == [(0, 1, 1.0, 0.0, True, 1, 0)]
    assert set(pairs(one_after_the_other, crossing=True)) == {(0, 1, 0.5)}  # on the node, as the one comes
    assert pairs(one_after_the_other, crossing=True, at_end=True) == []


def test_lots_follow_from_both_names_in_their_order():
    game = [(OURS, (0,), (0.0,)), *[(THEIRS, (0,), (0.0,))] * 6]
    order = [b for _, b, _ in pairs(game)]
    bits = {
        b: draws.compute_bits(draws.compute_turn_key(draws.compute_first_key(7, draws.mix(1) ^ (b + 1)), 3), 0)
        for b in range(1, 7)
    }
    assert order == sorted(bits, key=bits.get)


# -- the definition ---------------------------------------------------------------------------------------------------


@st.composite
def tracks(draw):
    path = [draw(st.integers(0, NODES - 1))]
    for _ in range(draw(st.integers(0, 3))):
        path.append(draw(st.integers(0, NODES - 1).filter(lambda node: node != path[-1])))
    steps = len(path) - 1
    times = [k / steps for k in range(steps + 1)] if steps else [draw(st.sampled_from([0.0, 1.0]))]
    parts = draw(st.integers(1, 3))
    part = draw(st.integers(0, parts - 1))
    if steps:
        times = [(part + time) / parts for time in times]
        if part:
            path, times = [path[0], *path], [0.0, *times]
    return draw(st.integers(0, 3)), tuple(path), tuple(times)


def presence(path, times):
    """When an agent is on a node: (node, from, until)."""
    stays = len(path) == 1 or path[0] == path[1]
    for k in range(0 if stays else 1, len(path)):
        until = 1.0 if k == len(path) - 1 else times[k + 1] if path[k] == path[k + 1] else times[k]
        yield path[k], times[k], until


def passed(path, times, now):
    """The node that an agent has passed last; None before it is there."""
    return next((node for node, time in reversed([*zip(path, times, strict=True)]) if time <= now), None)


def arrives(path, times):
    stays = len(path) == 1 or path[0] == path[1]
    return set(times if stays else times[1:])


def on_nodes(one, other):
    for (node, begin, end), (there, came, left) in product(presence(*one), presence(*other)):
        if node == there and begin <= left and came <= end:
            yield max(begin, came), 0.0, False


def on_edges(one, other):
    legs = [
        [(*way, *span) for way, span in zip(pairwise(path), pairwise(times), strict=True)]
        for path, times in (one, other)
    ]
    for (a, b, begin, end), (c, d, came, left) in product(*legs):
        if (a, b) == (d, c) and a != b and begin < left and came < end:
            yield max(begin, came), 0.0, True


def near(one, other, distance):
    for now in arrives(*one) | arrives(*other):
        if now == 0.0 and not (0.0 in arrives(*one) and 0.0 in arrives(*other)):
            continue
        here, there = passed(*one, now), passed(*other, now)
        if here is not None and there is not None and distance(here, there) < inf:
            yield now, distance(here, there), False


def expected(game, found):
    return {
        (a, b, *meeting)
        for (a, (side, *one)), (b, (other_side, *other)) in product(enumerate(game), enumerate(game))
        if a != b and side & OURS and other_side & THEIRS
        for meeting in found(one, other)
    }


games = st.lists(tracks(), min_size=3, max_size=3)


@given(games)
def test_contacts_on_nodes_and_edges_are_those_of_the_definition(game):
    found = contacts(game, crossing=True)
    assert {one[:5] for one in found} == expected(
        game, lambda one, other: [*on_nodes(one, other), *on_edges(one, other)]
    )


distances = st.dictionaries(
    st.integers(0, NODES - 1), st.dictionaries(st.integers(0, NODES - 1), st.sampled_from([1.0, 2.0])), max_size=4
)


@given(games, distances)
def test_contacts_by_paths_are_those_of_the_definition(game, edges):
    reach = {node: {**edges.get(node, {}), node: 0.0} for node in range(NODES)}
    for one, end in product(range(NODES), repeat=2):  # of edges of 1 or 2, two are the most within 2
        over = [edges.get(one, {}).get(middle, inf) + edges.get(middle, {}).get(end, inf) for middle in range(NODES)]
        reach[one][end] = min(reach[one].get(end, inf), *over)

    def distance(one, other):
        far = min(reach[one][other], reach[other][one])
        return far if far <= 2.0 else inf

    found = contacts(game, reach=edges, limit=2.0)
    assert {one[:5] for one in found} == expected(game, lambda one, other: near(one, other, distance))


@given(games, st.sampled_from([0.0, 2.5, 4.0, 5.0]))
def test_contacts_in_straight_lines_are_those_of_the_definition(game, limit):
    def distance(one, other):
        far = dist(XY[one], XY[other])
        return far if far <= limit else inf

    found = contacts(game, limit=limit)
    assert {one[:5] for one in found} == expected(game, lambda one, other: near(one, other, distance))


@given(games, st.booleans())
def test_contacts_come_in_the_order_of_time_and_those_of_a_pair_by_one_lot(game, crossing):
    found = contacts(game, crossing=crossing)
    times = [one[2] for one in found]
    assert times == sorted(times)
