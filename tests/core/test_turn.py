"""Turns along edges in the core: facts of small games, and laws of random ones."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms.core import conflicts, draws, moves, rules, turn

RING = 5  # nodes, in a ring: each node has itself, the next and the one before as legal nodes
ACTIONS = 3
UNLIMITED = 2**63 - 1
KEYS = st.integers(0, 2**64 - 1)


class Ring:
    """Games of some agents on a ring, and what plays them.

    Args:
        node: (games, agents) where they are.
        decides_by: of each agent.
        capacity: of nodes; None: there are no conflicts.
        last: the turn after which games end; None: nothing ends them.
        part_of: the part of the turn of each agent; None: all are of the only one.
    """

    def __init__(self, node, decides_by, *, capacity=None, last=None, keys=None, allow_swaps=True, part_of=None):
        self.parts = 1 if part_of is None else max(part_of) + 1
        self.node = np.array(node, np.int64)
        shape = self.node.shape
        agents = shape[1]
        self.start, self.ends, self.given, self.counts = np.zeros((4, *shape), np.int64)
        self.moves, self.blocks, self.stops = np.zeros((3, *shape), np.int64)
        self.alive = np.ones(shape, np.uint8)
        self.placed, self.blocked, self.takes_part = np.zeros((3, *shape), np.uint8)
        self.turn, self.until = np.zeros((2, shape[0]), np.int64)
        self.over = np.zeros(shape[0], np.uint8)
        self.keys = np.zeros(shape, np.uint64) if keys is None else np.array(keys, np.uint64)
        self.games = rules.GameColumns(
            agents,
            1,
            node=flat(self.node),
            start=flat(self.start),
            previous=flat(self.node.copy()),
            alive=flat(self.alive),
            placed=flat(self.placed),
            stops=flat(self.stops),
            home=flat(self.node.copy()),
            turn=flat(self.turn),
            over=flat(self.over),
            score=flat(np.zeros(shape[0])),
            team=flat(np.zeros(agents, np.int64)),
            first_node=flat(np.zeros(shape[0], np.int64)),
        )
        self.events = rules.Events(1)
        targets = [(node + step) % RING for node in range(RING) for step in (0, 1, -1)]
        contests, requests = self.conflicts(capacity, agents, allow_swaps) if capacity else (None, None)
        self.movers = movers = moves.OneEdgeMovers(
            moves.LegalMoves(flat(np.arange(RING + 1, dtype=np.int32) * ACTIONS), flat(np.array(targets, np.int32))),
            flat(np.array(decides_by, np.uint8)),
            draws.RandomChoices(flat(self.keys), flat(self.counts), flat(self.ends)),
            moves.RANDOM_WALK in decides_by,
            flat(self.given),
            contests,
            requests,
            ends=flat(self.ends),
            takes_part=flat(self.takes_part),
            counts=flat(self.counts),
            moves=flat(self.moves),
            blocks=flat(self.blocks),
            blocked=flat(self.blocked),
            wanted=flat(np.zeros_like(self.node)),
            went=flat(np.zeros_like(self.node)),
            held=flat(np.zeros_like(self.takes_part)),
            part_of=flat(np.zeros(agents, np.int64) if part_of is None else np.array(part_of)),
            part=flat(np.zeros(shape[0], np.int64)),
            parts=self.parts,
        )
        first = None
        if last is not None:
            first = rules.TimeLimitRule(self.games, self.events, 0, last=last, winner=rules.WINNERS["nobody"])
        self.player = turn.Player(self.games, movers, None, None, None, first, flat(self.until))

    def conflicts(self, capacity, agents, allow_swaps):
        tables = np.zeros((2, RING), np.int32)
        tables[0] = -1
        contests = conflicts.Contests(
            agents,
            RING,
            RING,
            capacity,
            allow_swaps,
            False,
            flat(tables),
            flat(np.zeros(7 * agents, np.int32)),
            flat(np.zeros(agents, np.int32)),
            flat(np.zeros(agents, np.int32)),
            flat(np.zeros(agents + 1, np.int32)),
            flat(np.zeros(agents, np.uint64)),
            flat(np.zeros(agents, np.uint8)),
        )
        limits, ranks = np.full(RING, capacity), np.arange(agents, dtype=np.uint64)
        offsets = np.zeros(agents, np.int64)
        where = flat(self.node), flat(self.ends), flat(self.takes_part)
        return contests, conflicts.MoveRequests(*where, flat(offsets), flat(limits), flat(ranks))

    def play(self, turns, begin=0, end=None):
        self.until[:] = (self.turn + turns) * self.parts
        turn.play(self.player, begin, len(self.node) if end is None else end)


def flat(column):
    return column.reshape(-1).data


def test_agents_do_what_they_are_given():
    ring = Ring([[0, 0, 0]], [moves.GIVEN] * 3)
    ring.given[:] = [[0, 1, 2]]
    ring.play(1)
    assert ring.node.tolist() == [[0, 1, 4]]
    assert ring.start.tolist() == [[0, 0, 0]]
    assert ring.moves.tolist() == [[0, 1, 1]]
    assert ring.turn.tolist() == [1]


def test_agents_that_are_out_stay_where_they_are():
    ring = Ring([[0, 0]], [moves.GIVEN] * 2)
    ring.alive[0, 0] = 0
    ring.given[:] = 1
    ring.blocked[:] = 1
    ring.play(1)
    assert ring.node.tolist() == [[0, 1]]
    assert ring.moves.tolist() == [[0, 1]]
    assert ring.blocked.tolist() == [[1, 0]], "who did not decide is blocked as before"


def test_losers_of_conflicts_are_blocked_and_counted():
    ring = Ring([[0, 2, 4]], [moves.GIVEN] * 3, capacity=1)
    ring.given[:] = [[1, 2, 0]]
    ring.play(1)
    assert ring.node.tolist() == [[1, 2, 4]]
    assert (ring.blocked.tolist(), ring.blocks.tolist()) == ([[0, 1, 0]], [[0, 1, 0]])
    ring.given[:] = 0
    ring.play(1)
    assert (ring.blocked.tolist(), ring.blocks.tolist()) == ([[0, 0, 0]], [[0, 1, 0]])


def test_agents_exchange_nodes_where_that_is_allowed():
    for allow_swaps, nodes in ((True, [[1, 0]]), (False, [[0, 1]])):
        ring = Ring([[0, 1]], [moves.GIVEN] * 2, capacity=1, allow_swaps=allow_swaps)
        ring.given[:] = [[1, 2]]
        ring.play(1)
        assert ring.node.tolist() == nodes


def test_a_rule_ends_a_game_and_others_go_on():
    ring = Ring([[0], [0]], [moves.STAY], last=3)
    ring.turn[1] = 2
    ring.play(2)
    assert ring.turn.tolist() == [2, 3]
    assert ring.over.tolist() == [0, 1]
    ring.play(9)
    assert ring.turn.tolist() == [3, 3]
    assert ring.events.count == 2


def test_games_outside_of_the_bounds_are_not_played():
    ring = Ring([[0], [0], [0]], [moves.STAY])
    ring.play(4, 1, 2)
    assert ring.turn.tolist() == [0, 4, 0]
    turn.play_aside(ring.player, 2, 3)
    assert ring.turn.tolist() == [0, 4, 4]


@given(st.lists(st.tuples(st.integers(0, RING - 1), KEYS), min_size=1, max_size=6), st.integers(0, 9))
def test_a_walk_is_the_choice_that_follows_from_keys_and_turns(agents, turns):
    nodes, keys = map(list, zip(*agents, strict=True))
    ring = Ring([nodes], [moves.RANDOM_WALK] * len(nodes), keys=[keys])
    ring.play(turns)
    for number in range(turns):
        drawn = [draws.below(draws.bits_at(draws.turn_key(key, number), 0), ACTIONS) for key in keys]
        nodes = [(node + (0, 1, -1)[action]) % RING for node, action in zip(nodes, drawn, strict=True)]
    assert ring.node.tolist() == [nodes]


GIVEN = st.lists(st.lists(st.integers(0, ACTIONS - 1), min_size=4, max_size=4), min_size=1, max_size=8)


@given(st.permutations(range(RING)), GIVEN, st.integers(1, 2), st.booleans())
def test_no_node_gets_fuller_than_it_may_be(nodes, actions, capacity, allow_swaps):
    ring = Ring([nodes[:4]], [moves.GIVEN] * 4, capacity=capacity, allow_swaps=allow_swaps)
    for row in actions:
        ring.given[:] = [row]
        before = ring.node.copy()
        ring.play(1)
        assert np.bincount(ring.node[0]).max() <= capacity
        wanted = (before + np.array([0, 1, -1])[row]) % RING
        stays = ring.node == before
        assert ((ring.node == wanted) | stays).all()
        assert (ring.blocked == (stays & (wanted != before))).all()
    assert (ring.moves + ring.blocks <= len(actions)).all()


@given(st.lists(st.lists(st.tuples(st.integers(0, RING - 1), KEYS), min_size=2, max_size=2), min_size=2, max_size=5))
def test_a_game_among_others_is_the_game_alone(games):
    nodes = [[node for node, _ in game] for game in games]
    keys = [[key for _, key in game] for game in games]
    together = Ring(nodes, [moves.RANDOM_WALK] * 2, capacity=1, keys=keys, last=5)
    together.play(9)
    for number, (here, own) in enumerate(zip(nodes, keys, strict=True)):
        alone = Ring([here], [moves.RANDOM_WALK] * 2, capacity=1, keys=[own], last=5)
        alone.play(9)
        for name in ("node", "moves", "blocks", "blocked", "turn"):
            assert getattr(alone, name)[0].tolist() == getattr(together, name)[number].tolist()


def test_agents_of_a_later_part_move_when_those_before_them_have_moved():
    ring = Ring([[0, 1]], [moves.GIVEN] * 2, capacity=1, part_of=[1, 0])
    ring.given[:] = [[1, 1]]
    ring.play(1)
    assert ring.node.tolist() == [[1, 2]]  # at once, nobody may come to the node of another that has to stay
    nodes, times, lengths = np.zeros(6, np.int64), np.zeros(6), np.zeros(2, np.int64)
    steps = moves.PartPaths(ring.movers, flat(nodes), flat(times), flat(lengths))
    rules.fill_steps(steps, ring.games, 0)
    assert nodes.tolist() == [0, 0, 1, 1, 2, 0]
    assert times.tolist() == [0.0, 0.5, 1.0, 0.0, 0.5, 0.0]
    assert lengths.tolist() == [3, 2]
