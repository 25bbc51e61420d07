"""The laws of conflicts, on random graphs with random moves."""

import random
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.rules import Conflicts, by_priority, nobody
from gamms.typing.game import Move

TEAMS = ("red", "blue", None)
NODES = 7


def some(contest, _ctx):
    """Fewer than might win, and none where the node is odd."""
    number = contest.node[0] if isinstance(contest.node, tuple) else contest.node
    return [] if number % 2 else contest.movers[1 : contest.places + 1]


FULL = {
    "teams": by_priority(TEAMS),
    "last": lambda contest, _: contest.movers[-contest.places :],
    "far": lambda contest, _: sorted(contest.movers, key=lambda m: (m.start * 5 % 7, m.agent))[: contest.places],
}
RESOLVERS = {**FULL, "nobody": nobody(), "some": some}


@pytest.fixture(scope="module")
def ctx():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes(range(NODES), range(NODES), [0] * NODES)
        yield ctx


@st.composite
def turns(draw):
    """Moves on a random graph: along an edge, or none."""
    edges = draw(st.lists(st.tuples(st.integers(0, NODES - 1), st.integers(0, NODES - 1)), min_size=1, max_size=12))
    ways = draw(st.lists(st.sampled_from([*edges, *((end, start) for start, end in edges), (0, 0)]), max_size=14))
    teams = draw(st.lists(st.sampled_from(TEAMS), min_size=len(ways), max_size=len(ways)))
    return {
        f"{number:02}": Move(f"{number:02}", team, start, end, (start, end) if start != end else (start,))
        for number, ((start, end), team) in enumerate(zip(ways, teams, strict=True))
    }


CAPACITIES = st.one_of(
    st.none(),
    st.integers(1, 3),
    st.dictionaries(st.integers(0, NODES - 1), st.one_of(st.none(), st.integers(0, 3))),
)
AMONG = st.sampled_from(["all", "team"])


def limit(capacity, node):
    found = capacity.get(node) if isinstance(capacity, dict) else capacity
    return 99 if found is None else found


def place(move, node, among):
    return (node, move.team) if among == "team" else (node, None)


def after(moves, stopped):
    return {
        name: move._replace(end=move.start, path=(move.start,)) if name in stopped else move
        for name, move in moves.items()
    }


def crowds(moves, among, field):
    return Counter(place(move, getattr(move, field), among) for move in moves.values())


def swaps(moves, among):
    return {
        (one.agent, other.agent)
        for one in moves.values()
        for other in moves.values()
        if one.start == other.end != one.end == other.start and (among == "all" or one.team == other.team)
    }


def resolved(moves, ctx, resolve, capacity, among, allow_swaps):
    conflicts = Conflicts(capacity, among, allow_swaps=allow_swaps, resolve=RESOLVERS[resolve])
    return conflicts.resolve(moves, ctx)


ANY = given(turns(), st.sampled_from(sorted(RESOLVERS)), CAPACITIES, AMONG, st.booleans())


@ANY
def test_no_node_takes_in_more_than_its_capacity_and_no_agents_exchange_against_the_rule(
    ctx, moves, resolve, capacity, among, allow_swaps
):
    stopped = resolved(moves, ctx, resolve, capacity, among, allow_swaps)
    assert all(moves[name].start != moves[name].end for name in stopped)
    done = after(moves, stopped)
    stay = {name: move for name, move in done.items() if move.start == move.end}
    staying, ending = crowds(stay, among, "end"), crowds(done, among, "end")
    for key, number in ending.items():
        assert number <= limit(capacity, key[0]) or number == staying[key]
    assert allow_swaps or not swaps(done, among)


@ANY
def test_the_order_of_the_moves_does_not_matter(ctx, moves, resolve, capacity, among, allow_swaps):
    shuffled = list(moves.items())
    random.Random(len(moves)).shuffle(shuffled)
    arguments = (ctx, resolve, capacity, among, allow_swaps)
    assert resolved(moves, *arguments) == resolved(dict(shuffled), *arguments)


@ANY
def test_what_is_resolved_needs_no_more_resolving(ctx, moves, resolve, capacity, among, allow_swaps):
    arguments = (ctx, resolve, capacity, among, allow_swaps)
    assert resolved(after(moves, resolved(moves, *arguments)), *arguments) == set()


@given(turns(), st.sampled_from(sorted(FULL)), CAPACITIES, AMONG, st.booleans())
def test_no_agent_stays_whose_node_has_a_place_left(ctx, moves, resolve, capacity, among, allow_swaps):
    """But for those against whom an exchange was decided."""
    stopped = resolved(moves, ctx, resolve, capacity, among, allow_swaps)
    ending = crowds(after(moves, stopped), among, "end")
    exchanging = set() if allow_swaps else {one for one, _ in swaps(moves, among)}
    for name in stopped - exchanging:
        key = place(moves[name], moves[name].end, among)
        assert ending[key] >= limit(capacity, key[0])
