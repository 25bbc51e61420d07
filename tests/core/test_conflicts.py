"""Conflicts of moves in the core: facts, laws on random moves, and a plain form of the rounds to compare with."""

from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gamms.core import conflicts, draws

NODES = 5
EDGES = 2
PLACES = NODES + EDGES
UNLIMITED = 2**63 - 1
MOST = 2**64 - 1


class Board:
    """The memory of the core for some agents in teams, and the moves of games on it."""

    def __init__(self, team_of, limits, *, allow_swaps=True, is_drawn=False):
        agents = len(team_of)
        teams = max(team_of, default=0) + 1
        self.tables = np.zeros((2, PLACES * teams), np.int32)
        self.tables[0] = -1
        self.members, self.free = np.zeros((2, agents), np.int32)
        self.first = np.zeros(agents + 1, np.int32)
        self.stays = np.zeros(agents, np.uint8)
        self.offsets = np.array(team_of, np.int64) * PLACES
        self.limits = np.array(limits, np.int64)
        self.contests = conflicts.Contests(
            agents,
            NODES,
            PLACES,
            min(limits),
            allow_swaps,
            is_drawn,
            self.tables.reshape(-1).data,
            np.zeros(7 * agents, np.int32).data,
            self.members.data,
            self.free.data,
            self.first.data,
            np.zeros(agents, np.uint64).data,
            self.stays.data,
        )

    def requests(self, starts, ends, counts, ranks):
        numbers = np.array(ranks, np.uint64).reshape(-1).data
        return conflicts.MoveRequests(starts, ends, counts, self.offsets.data, self.limits.data, numbers)

    def resolve_games(self, games, ranks, turns):
        """Return the bytes of all agents in games, each a list of (start, end, counts), and check the memory."""
        starts, ends, counts = (
            np.array([[move[k] for move in moves] for moves in games], kind).reshape(-1).data
            for k, kind in enumerate((np.int64, np.int64, np.uint8))
        )
        requests = self.requests(starts, ends, counts, ranks)
        stays = []
        for game, turn in enumerate(turns):
            found = conflicts.resolve(self.contests, requests, game, turn)
            stays.append(self.stays.tolist())
            assert found == np.count_nonzero(self.stays)
            assert (self.tables[0] == -1).all()
            assert not self.tables[1].any()
        return stays

    def resolve(self, moves, ranks, turn=0):
        return self.resolve_games([moves], ranks, [turn])[0]


def resolved(*ways, limit=1, ranks=None, **options):
    """Return who stays of agents that all count and go these ways."""
    board = Board([0] * len(ways), [limit] * PLACES, **options)
    return board.resolve([(*way, 1) for way in ways], ranks or range(len(ways)))


def test_the_smallest_rank_wins_and_rows_decide_between_equals():
    assert resolved((0, 1), (2, 1), (3, 1), ranks=[7, 3, 3]) == [1, 0, 1]
    assert resolved((0, 1), (2, 1), (3, 1), limit=2, ranks=[7, 3, 3]) == [1, 0, 0]


def test_ranks_of_none_never_win_and_missing_ones_are_named():
    assert resolved((0, 1), (2, 1), ranks=[conflicts.RANK_OF_NONE, 5]) == [1, 0]
    assert resolved((0, 1), (2, 1), ranks=[conflicts.RANK_OF_NONE] * 2) == [1, 1]
    assert resolved((0, 1), (2, 1), ranks=[conflicts.RANK_MISSING, 5]) == [conflicts.LOSES_UNRANKED, 0]
    assert resolved((0, 1), (1, 1), ranks=[conflicts.RANK_MISSING, 5]) == [1, 0], (
        "no place is free, no rank is asked for"
    )


def test_a_loser_keeps_its_place_from_those_behind_it():
    assert resolved((0, 1), (1, 2), (2, 3), (4, 3), ranks=[0, 1, 9, 2]) == [1, 1, 1, 0]
    assert resolved((0, 1), (1, 2), (2, 0)) == [0, 0, 0], "a full circle turns"


def test_an_exchange_goes_the_way_of_its_winner():
    ways = (0, 1), (1, 0), (1, 0), (0, 1), (1, 2)
    free = {"limit": UNLIMITED, "allow_swaps": False}
    assert resolved(*ways, ranks=[3, 2, 4, 5, 0], **free) == [1, 0, 0, 1, 0]
    assert resolved(*ways, ranks=[1, 2, 4, 5, 0], **free) == [0, 1, 1, 0, 0]
    assert resolved(*ways, ranks=[conflicts.RANK_OF_NONE] * 5, **free) == [1, 1, 1, 1, 0]


def test_edges_are_no_nodes_to_exchange():
    assert resolved((0, NODES), (NODES, 0), limit=UNLIMITED, allow_swaps=False) == [0, 0]
    assert resolved((0, NODES), (1, NODES)) == [0, 1]


def test_agents_that_do_not_count_are_in_no_way():
    board = Board([0, 0], [1] * PLACES)
    assert board.resolve([(0, 1, 1), (1, 1, 0)], [0, 1]) == [0, 0]
    assert board.resolve([(0, 1, 0), (2, 1, 0)], [0, 1]) == [0, 0]


def test_no_agents_have_no_conflicts():
    assert Board([], [1] * PLACES).resolve([], []) == []


def numbered(ids):
    """Return the numbers of ids, and check the memory."""
    size = 1 << len(ids).bit_length()
    slots = np.full(size, -1, np.int32)
    numbers = np.zeros(len(ids), np.int64)
    tables = np.zeros(size, np.int64).data, slots.data, np.zeros(len(ids), np.int32).data
    found = conflicts.number_ids(np.array(ids, np.int64).data, *tables, numbers.data)
    assert (slots == -1).all()
    assert found == len(set(ids))
    return numbers.tolist()


def test_ids_are_numbered_in_the_order_in_which_they_first_come():
    assert numbered([7, -(2**63), 2**63 - 1, 7, 0]) == [0, 1, 2, 0, 3]


@given(
    st.lists(st.one_of(st.integers(-(2**63), 2**63 - 1), st.integers(0, 9), st.integers(0, 9).map(lambda n: n << 40)))
)
def test_equal_ids_get_equal_numbers(ids):
    known = {one: number for number, one in enumerate(dict.fromkeys(ids))}
    assert numbered(ids) == [known[one] for one in ids]


def test_a_function_may_decide_between_the_rounds():
    board = Board([0] * 3, [1] * PLACES)
    c = board.contests
    starts, ends = (np.array(places, np.int64).data for places in ([0, 1, 2], [1, 3, 3]))
    requests = board.requests(starts, ends, bytes([1, 1, 1]), [])
    conflicts.begin(c, requests, 0)
    assert conflicts.find_contests(c, requests) == 1
    assert board.members[: board.first[1]].tolist() == [1, 2]
    board.stays[1] = conflicts.LOSES
    assert conflicts.find_more_contests(c, requests, 1) == 1
    assert (board.members[: board.first[1]].tolist(), board.free[0]) == ([0], 0), "which has no place to win"
    board.stays[0] = conflicts.LOSES
    assert conflicts.find_more_contests(c, requests, 1) == 0
    conflicts.clear(c)
    assert (board.tables == [[-1], [0]]).all()


places = st.integers(0, PLACES - 1)
some_ranks = st.one_of(
    st.integers(0, 4), st.sampled_from([conflicts.RANK_OF_NONE - 1, conflicts.RANK_OF_NONE, conflicts.RANK_MISSING])
)


@st.composite
def turns(draw):
    """Moves of a game and the options of its conflicts."""
    number = draw(st.integers(0, 12))
    moves = draw(st.lists(st.tuples(places, places, st.integers(0, 1)), min_size=number, max_size=number))
    moves = [(start, end, count or draw(st.integers(0, 1))) for start, end, count in moves]
    team_of = draw(st.lists(st.integers(0, 1), min_size=number, max_size=number))
    limits = draw(st.lists(st.sampled_from([0, 1, 1, 2, 3, UNLIMITED]), min_size=PLACES, max_size=PLACES))
    is_drawn = draw(st.booleans())
    ranks = draw(st.lists(st.integers(0, MOST) if is_drawn else some_ranks, min_size=number, max_size=number))
    return moves, team_of, limits, draw(st.booleans()), is_drawn, ranks, draw(st.integers(-(2**40), 2**40))


def plain(moves, team_of, limits, allow_swaps, is_drawn, ranks, turn):
    """Return the agents that stay, in the plain way: look at all places in every round, until nothing changes."""
    ways = {i: ((team_of[i], start), (team_of[i], end)) for i, (start, end, counts) in enumerate(moves) if counts}
    if is_drawn:
        ranks = [draws.bits_at(draws.turn_key(key, turn), 0) for key in ranks]
    unable = set() if is_drawn else {i for i, rank in enumerate(ranks) if rank >= conflicts.RANK_OF_NONE}

    def winners(members, free):
        return sorted(set(members) - unable, key=lambda i: (ranks[i], i))[:free]

    stays = set()
    nodes = {i: way for i, way in ways.items() if way[0] != way[1] and max(way[0][1], way[1][1]) < NODES}
    for way in set() if allow_swaps else set(nodes.values()):
        ahead, back = ([i for i in nodes if nodes[i] == one] for one in (way, way[::-1]))
        if back:
            best = winners(ahead + back, 1)
            stays |= set(ahead) - ({*ahead} if set(best) & set(ahead) else set())
    losers = {None}
    while losers:
        losers = set()
        ends = {i: start if i in stays else end for i, (start, end) in ways.items()}
        for place in Counter(ends.values()):
            coming = [i for i in ends if ends[i] == place != ways[i][0]]
            free = max(0, limits[place[1]] - (list(ends.values()).count(place) - len(coming)))
            if len(coming) > free:
                losers |= set(coming) - set(winners(coming, free))
        stays |= losers
    return stays


def board_of(case):
    _, team_of, limits, allow_swaps, is_drawn, _, _ = case
    return Board(team_of, limits, allow_swaps=allow_swaps, is_drawn=is_drawn)


@given(turns())
def test_who_stays_is_what_rounds_over_all_places_say(case):
    moves, *_, ranks, turn = case
    found = board_of(case).resolve(moves, ranks, turn)
    assert {i for i, stays in enumerate(found) if stays} == plain(*case)


@given(turns(), st.lists(st.permutations(range(12)), min_size=1, max_size=3), st.data())
def test_a_game_among_others_is_the_game_alone(case, orders, data):
    moves, team_of, _, _, is_drawn, ranks, turn = case
    agents = len(team_of)
    games = [[moves[i] for i in order if i < agents] for order in orders]
    numbers = [turn + k for k in range(len(games))]
    keys = [data.draw(st.permutations(ranks)) for _ in games] if is_drawn else [ranks] * len(games)
    together = board_of(case).resolve_games(games, keys if is_drawn else ranks, numbers)
    assert together == [board_of(case).resolve(*one) for one in zip(games, keys, numbers, strict=True)]
