"""Rules of one game by the core: facts, and random turns against the definition."""

from array import array

from hypothesis import given
from hypothesis import strategies as st

from gamms.core import contacts as meeting
from gamms.core import rules as core
from gamms.core import travel

NODES, PURPOSE = 10, 11
RED, BLUE = 0, 1


def ints(values):
    return memoryview(array("q", values))


def keys(values):
    return memoryview(array("Q", values))


def floats(values):
    return memoryview(array("d", values))


def flags_of(values):
    return memoryview(bytearray(values))


NO_LEGS = meeting.Legs(0, *[ints([])] * 5, *[floats([])] * 5)
NOTHING = (
    meeting.NearNodes(
        ints([0]), ints([]), floats([]), 0.0, travel.ReachSearch(*map({"q": ints([]), "d": floats([])}.get, "qdqqqdqq"))
    ),
    meeting.NodePositions(ints([]), floats([])),
)


class Block:
    """Games of agents that went from `starts` to `nodes`; agents of the teams of `teams`."""

    def __init__(self, starts, nodes, teams, *, alive=None, home=None, turn=1, numbers=2, nobody=-1):
        games, agents = len(nodes), len(teams)
        flat = [node for game in nodes for node in game]
        self.node, self.start = ints(flat), ints([node for game in starts for node in game])
        self.alive = flags_of(alive or [1] * len(flat))
        self.placed, self.over = flags_of([0] * len(flat)), flags_of([0] * games)
        self.stops, self.score = ints([0] * len(flat)), floats([0.0] * games * numbers)
        self.home = ints(home or [9] * len(flat))
        self.turn, self.agents = ints([turn] * games), agents
        self.games = core.GameColumns(
            agents,
            numbers,
            node=self.node,
            start=self.start,
            previous=ints(flat),
            alive=self.alive,
            placed=self.placed,
            stops=self.stops,
            home=self.home,
            turn=self.turn,
            over=self.over,
            score=self.score,
            team=ints(teams),
            first_node=ints([0] * games),
            nobody=nobody,
        )
        self.events = core.Events(0)
        self.teams = teams

    def tracks(self, *, at_end=False):
        """Steps, and tracks of one game that have their columns and these sides."""
        nodes, times, lengths = ints([0] * 2 * self.agents), floats([0.0] * 2 * self.agents), ints([0] * self.agents)
        sides = ints([0] * self.agents)
        tracks = meeting.Tracks(self.agents, 2, nodes, times, lengths, sides, at_end=at_end)
        return core.AgentPaths(nodes, times, lengths), tracks, sides

    def pieces(self):
        room = 6 * self.agents
        columns = [ints([0] * room) for _ in range(3)], [floats([0.0] * room) for _ in range(4)]
        return meeting.MotionIntervals(
            *columns[0], *columns[1], *[ints([0] * room) for _ in range(2)], ints([-1] * NODES), ints([0] * room)
        )

    def visitors(self):
        """The agents, all on the ground, with the nodes that they visit."""
        steps, tracks, sides = self.tracks()
        return core.Visitors(steps, tracks, NO_LEGS, self.pieces(), ints([1] * self.agents), sides)

    def tag(self, *rules, number=0):
        """A rule of several taggings, each (plays, what `Tagging` takes by name)."""
        nodes, times, lengths = ints([0] * 2 * self.agents), floats([0.0] * 2 * self.agents), ints([0] * self.agents)
        steps, purpose, turn = core.AgentPaths(nodes, times, lengths), keys([0]), ints([0])
        first = None
        for plays, more in reversed(rules):
            sides = ints([0] * self.agents)
            found = meeting.Contacts(self.pieces())
            found.ask(
                meeting.Tracks(self.agents, 2, nodes, times, lengths, sides, at_end=False),
                NO_LEGS,
                keys(range(1, self.agents + 1)),
                purpose,
                turn,
                reach=NOTHING[0],
                places=NOTHING[1],
                lines=meeting.PathSegments(ints([]), *[floats([])] * 4),
                crossing=True,
                by_metres=False,
            )
            said = {"mutual": False, "owners": ints([]), "then": core.THEN["respawn"], "points": 1.0, **more}
            first = core.Tagging(found, meeting.SEARCHES["on nodes"], 0.0, ints(plays), sides, behind=first, **said)
        tags = core.Tags(ints([0] * self.agents))
        purposes = keys([PURPOSE] * len(self.over))
        return core.TagRule(self.games, self.events, number, first, tags, steps, purpose, turn, purposes)

    def flags(self, bases, *, goal=0, home=None, owners=(), takes=None, at_end=False, number=0):
        """A rule of the flags of teams 0, 1, …, on their bases."""
        steps, tracks, sides = self.tracks(at_end=at_end)
        games = len(self.over)
        self.carriers, self.captures = ints([-1] * games * len(bases)), ints([0] * games * 2)
        flags = core.Flags(
            len(bases),
            team=ints(range(len(bases))),
            base=ints(bases),
            home=ints(home or bases),
            owners=ints(owners),
            takes=ints(takes or self.teams),
            names=keys(range(1, self.agents + 1)),
            purposes=keys([PURPOSE] * games * len(bases)),
            carriers=self.carriers,
            stops=ints([0] * games * len(bases)),
            captures=self.captures,
            starts=self.home,
            members=ints(self.teams),
            taken=floats([0.0] * len(bases)),
            goal=goal,
            points=2.0,
        )
        return core.FlagRule(
            self.games,
            self.events,
            number,
            flags=flags,
            steps=steps,
            tracks=tracks,
            legs=NO_LEGS,
            pieces=self.pieces(),
            ground=ints([1] * self.agents),
            sides=sides,
        )

    def happened(self):
        """The events: game, kind, agent, other, node."""
        events = self.events
        columns = events.games, events.kinds, events.agents, events.others, events.nodes
        rows = zip(*[list(column)[: events.count] for column in columns], strict=True)
        events.count = 0
        return [(game, core.KINDS[kind], agent, other, node) for game, kind, agent, other, node in rows]


def test_agents_on_one_node_tag_and_the_tagged_go_back_to_where_they_began():
    block = Block([[0, 1]], [[2, 2]], [RED, BLUE])
    core.play(block.tag(([1, 2], {})), 0)
    assert block.happened() == [(0, "tag", 0, 1, 2), (0, "respawned", 1, -1, 9)]
    assert list(block.node) == [2, 9]
    assert list(block.placed) == [0, 1]
    assert list(block.score) == [1.0, 0.0]


def test_agents_that_exchange_nodes_meet_on_the_edge():
    block = Block([[0, 1]], [[1, 0]], [RED, BLUE])
    core.play(block.tag(([1, 2], {"then": core.THEN["eliminate"]})), 0)
    assert block.happened() == [(0, "tag", 0, 1, 1), (0, "eliminated", 1, -1, 0)]
    assert list(block.alive) == [1, 0]


def test_one_game_of_a_block_leaves_the_others_as_they_are():
    block = Block([[0, 1], [0, 1]], [[2, 2], [3, 3]], [RED, BLUE])
    rule = block.tag(([1, 2], {}))
    core.play(rule, 1)
    assert block.happened() == [(1, "tag", 0, 1, 3), (1, "respawned", 1, -1, 9)]
    assert list(block.node) == [2, 2, 3, 9]
    assert list(block.score) == [0.0, 0.0, 1.0, 0.0]


def test_an_agent_that_is_out_or_was_put_on_a_node_meets_only_where_it_is():
    block = Block([[0, 1, 1]], [[1, 0, 0]], [RED, BLUE, BLUE], alive=[1, 0, 1])
    block.placed[2] = 1
    core.play(block.tag(([1, 2, 2], {})), 0)
    assert block.happened() == []


def test_taggings_are_matched_with_each_other():
    block = Block([[0, 0, 0]], [[0, 0, 0]], [RED, BLUE, RED])
    core.play(block.tag(([1, 2, 0], {}), ([2, 1, 0], {"then": core.THEN["eliminate"]}), ([1, 0, 2], {})), 0)
    tags = [event for event in block.happened() if event[1] == "tag"]
    assert len(tags) == 1


def test_a_tag_needs_the_ground_of_the_tagger_and_a_mutual_one_that_of_either():
    owners = ints([-1, BLUE, RED, *[-1] * 7])
    block = Block([[1, 1, 2, 2]], [[1, 1, 2, 2]], [RED, BLUE, RED, BLUE])
    core.play(block.tag(([1, 2, 1, 2], {"owners": owners})), 0)
    assert block.happened() == [(0, "tag", 2, 3, 2), (0, "respawned", 3, -1, 9)]
    block = Block([[1, 1]], [[1, 1]], [RED, BLUE])
    core.play(block.tag(([1, 2], {"owners": owners, "mutual": True})), 0)
    assert block.happened() == [(0, "tag", 1, 0, 1), (0, "respawned", 0, -1, 9)]


def test_a_flag_is_taken_brought_home_and_dropped():
    block = Block([[5, 7]], [[6, 7]], [RED, BLUE])
    rule = block.flags([5, 6])
    core.play(rule, 0)
    assert block.happened() == [(0, "take", 0, 1, 6)]
    assert list(block.carriers) == [-1, 0]
    block.start[0], block.node[0] = 6, 5
    core.play(rule, 0)
    assert block.happened() == [(0, "capture", 0, 1, 5)]
    assert list(block.captures) == [1, 0]
    assert list(block.score) == [2.0, 0.0]
    block.start[0], block.node[0] = 5, 6
    core.play(rule, 0)
    assert block.happened() == [(0, "take", 0, 1, 6)]
    core.respawn(block.games, block.events, 0, 0)
    core.play(rule, 0)
    assert block.happened() == [(0, "respawned", 0, -1, 9), (0, "drop", 0, 1, 9)]
    assert list(block.carriers) == [-1, -1]


def test_captures_up_to_the_goal_end_the_game():
    block = Block([[5, 6]], [[6, 5]], [RED, BLUE])
    rule = block.flags([5, 6], goal=1, number=3)
    core.play(rule, 0)
    block.start[0], block.node[0], block.start[1], block.node[1] = 6, 5, 5, 6
    core.play(rule, 0)
    assert [event[1:3] for event in block.happened()] == [
        ("take", 1), ("take", 0), ("capture", 1), ("capture", 0), ("end", -1),
    ]  # fmt: skip
    assert list(block.over) == [1]


def test_home_without_a_base_is_where_an_agent_of_the_team_began():
    block = Block([[5, 7]], [[6, 7]], [RED, BLUE], home=[5, 8])
    rule = block.flags([4, 6], home=[-1, 6])
    core.play(rule, 0)
    block.start[0], block.node[0] = 6, 5
    core.play(rule, 0)
    assert [event[1] for event in block.happened()] == ["take", "capture"]


def test_agents_come_back_after_some_turns_so_many_times():
    block = Block([[0, 1]], [[0, 1]], [RED, BLUE], alive=[0, 0])
    rule = core.RespawnRule(
        block.games, block.events, 0, plays=ints([1, 0]), out=ints([-1, -1]), times=ints([0, 0]), wait=1, most=1
    )
    core.play(rule, 0)
    assert block.happened() == []
    block.turn[0] = 2
    core.play(rule, 0)
    assert block.happened() == [(0, "respawned", 0, -1, 9)]
    block.alive[0] = 0
    for block.turn[0] in (3, 4, 5):
        core.play(rule, 0)
    assert block.happened() == []


def test_rules_of_a_chain_are_called_in_their_order():
    block = Block([[0, 1]], [[0, 1]], [RED, BLUE], alive=[1, 0], turn=5)
    block.score[BLUE] = 3.0
    limit = core.TimeLimitRule(block.games, block.events, 0, last=5, winner=core.WINNERS["leader"])
    none = core.NoneLeftRule(block.games, block.events, 1, team=BLUE, winner=core.WINNERS["nobody"])
    last = core.LastTeamRule(block.games, block.events, 2)
    core.play(core.chained([limit, none, last]), 0)
    assert list(block.events.rules)[: block.events.count] == [0, 1, 2]
    assert [event[2] for event in block.happened()] == [BLUE, -1, RED]


def test_who_reaches_its_goal_first_wins_and_two_at_once_draw():
    goals = [0] * 2 * NODES
    goals[2 * 3 + RED] = goals[2 * 4 + BLUE] = 1
    given = {"goals": ints(goals), "order": ints([0, 1]), "points": 1.0, "winner": core.WINNERS["its team"]}
    given["starters"] = ints([])
    for starts, winner, reached in (([3, 1], RED, [0]), ([1, 1], -1, [0, 1]), ([1, 4], BLUE, [1])):
        block = Block([starts], [[3, 4]], [RED, BLUE])
        core.play(core.ReachRule(block.games, block.events, 0, visitors=block.visitors(), **given), 0)
        *arrived, (_, kind, won, _, _) = block.happened()
        assert (kind, won, [event[2] for event in arrived]) == ("end", winner, reached)


def test_agents_that_arrive_score_and_are_out():
    block = Block([[2, 2, 3]], [[3, 3, 3]], [RED, BLUE, RED])
    given = {"team": RED, "owners": ints([RED if node == 3 else -1 for node in range(NODES)]), "points": 2.0}
    given["starters"] = ints([])
    core.play(core.ArriveRule(block.games, block.events, 0, visitors=block.visitors(), **given), 0)
    assert [event[1:3] for event in block.happened()] == [
        ("arrive", 0), ("arrive", 2), ("eliminated", 0), ("eliminated", 2),
    ]  # fmt: skip
    assert list(block.score) == [4.0, 0.0]


def test_where_agents_began_may_be_a_goal_of_a_team_in_their_game():
    block = Block([[2, 2, 5], [2, 3, 5]], [[3, 4, 5], [3, 4, 5]], [RED, BLUE, BLUE], home=[0, 1, 3, 0, 1, -1])
    goals, starters = ints([0] * 2 * NODES), ints([0, 1, 1, 0, 0, 0])  # of red: where blue agents began
    given = {"goals": goals, "order": ints([RED]), "points": 1.0, "winner": core.WINNERS["its team"]}
    rule = core.ReachRule(block.games, block.events, 0, visitors=block.visitors(), starters=starters, **given)
    core.play(rule, 0)
    core.play(rule, 1)
    assert [event[:3] for event in block.happened()] == [(0, "reach", 0), (0, "end", RED)]
    assert not any(goals)
    owners, given = ints([-1] * NODES), {"team": RED, "points": 1.0, "starters": starters[:3]}
    core.play(core.ArriveRule(block.games, block.events, 0, visitors=block.visitors(), owners=owners, **given), 0)
    assert [event[1:3] for event in block.happened()] == [("arrive", 0), ("eliminated", 0)]
    assert set(owners) == {-1}


def test_agents_that_have_not_come_yet_do_not_come_back():
    block = Block([[0, 1]], [[0, 1]], [RED, BLUE], alive=[0, 0], home=[5, -1])
    given = {"plays": ints([1, 1]), "out": ints([0, 0]), "times": ints([0, 0]), "wait": 1, "most": -1}
    core.play(core.RespawnRule(block.games, block.events, 0, **given), 0)
    assert block.happened() == [(0, "respawned", 0, -1, 5)]


def test_agents_of_no_team_neither_lead_nor_are_the_last_team():
    block = Block([[0, 1, 2]], [[0, 1, 2]], [RED, BLUE, 2], alive=[1, 0, 1], turn=5, numbers=3, nobody=2)
    block.score[2] = 9.0
    block.score[BLUE] = 1.0
    limit = core.TimeLimitRule(block.games, block.events, 0, last=5, winner=core.WINNERS["leader"])
    core.play(core.chained([limit, core.LastTeamRule(block.games, block.events, 1)]), 0)
    assert [event[2] for event in block.happened()] == [BLUE, RED]
    assert core.leader(floats([1.0, 9.0]), 1) == -1


def test_the_leader_is_one_of_several_alone():
    assert core.leader(floats([1.0, 2.0])) == 1
    assert core.leader(floats([2.0, 2.0])) == -1
    assert core.leader(floats([2.0])) == -1
    assert core.leader(floats([-3.0, 2.0, 2.0])) == -1


def contacts_of(starts, nodes, teams, placed, first, second):
    """The agents of two teams that meet in steps along one edge: time, whether on an edge, a, b, where b was."""
    found = []
    for a, b in (
        (a, b) for a in range(len(teams)) for b in range(len(teams)) if (teams[a], teams[b]) == (first, second)
    ):
        goes = [starts[i] != nodes[i] and not placed[i] for i in (a, b)]
        since = [1.0 if placed[i] or starts[i] != nodes[i] else 0.0 for i in (a, b)]
        if nodes[a] == nodes[b]:
            found.append((max(since), 0, a, b, nodes[b]))
        elif all(goes) and starts[a] == nodes[b] and starts[b] == nodes[a]:
            found.append((0.0, 1, a, b, starts[b]))
    return found


AGENTS = st.tuples(st.integers(0, 3), st.integers(0, 3), st.sampled_from([RED, BLUE]), st.booleans(), st.booleans())


@given(st.lists(AGENTS, min_size=1, max_size=6), st.lists(st.sampled_from([-1, RED, BLUE]), min_size=10, max_size=10))
def test_tags_are_contacts_on_the_ground_of_taggers_one_each(agents, owners):
    starts, nodes, teams, placed, alive = map(list, zip(*agents, strict=True))
    block = Block([starts], [nodes], teams, alive=[int(one) for one in alive])
    for i, was_put in enumerate(placed):
        block.placed[i] = was_put
    sides = [1 if team == RED else 2 for team in teams]
    core.play(block.tag((sides, {"owners": ints(owners), "then": core.THEN[""]})), 0)
    tags = [(a, b, node) for _, _, a, b, node in block.happened()]
    met = [one for one in contacts_of(starts, nodes, teams, placed, RED, BLUE) if alive[one[2]] and alive[one[3]]]
    able = {(a, b, node): time for time, _, a, b, node in met if owners[node] == RED}
    assert set(tags) <= set(able)
    taken = [agent for a, b, _ in tags for agent in (a, b)]
    assert len(taken) == len(set(taken))
    assert all(a in taken or b in taken for a, b, _ in able)  # else they would have been a pair, too
    times = [able[tag] for tag in tags]
    assert times == sorted(times)
    assert block.score[RED] == len(tags)
    for (a, b, _), time in able.items():  # a pair that was not made had an agent in one at least as early
        earlier = [made for tag, made in zip(tags, times, strict=True) if a in tag[:2] or b in tag[:2]]
        assert min(earlier) <= time


@given(
    st.lists(st.lists(st.integers(0, 3), min_size=4, max_size=4), min_size=1, max_size=8),
    st.lists(st.sampled_from([RED, BLUE]), min_size=4, max_size=4),
)
def test_a_flag_is_carried_by_one_enemy_and_an_agent_carries_one_flag(places, teams):
    block = Block([places[0]], [places[0]], teams)
    rule = block.flags([0, 3])
    carriers = [-1, -1]
    for here in places:
        for i in range(4):
            block.start[i], block.node[i] = block.node[i], here[i]
        core.play(rule, 0)
        for _, kind, agent, flag, node in block.happened():
            assert teams[agent] != flag
            if kind == "take":
                assert (node, carriers[flag], agent in carriers) == ([0, 3][flag], -1, False)
                carriers[flag] = agent
            else:
                assert (kind, node, carriers[flag]) == ("capture", [0, 3][teams[agent]], agent)
                carriers[flag] = -1
        assert list(block.carriers) == carriers
    assert sum(block.score) == 2.0 * sum(block.captures)


@given(st.lists(st.sampled_from([-(2**63), -1, 0, 1, 2**31, 2**63 - 1]) | st.integers(-(2**63), 2**63 - 1)))
def test_nodes_have_one_number_each_in_the_order_in_which_they_come(ids):
    numbers, written = meeting.NodeNumbers(), ints([0] * len(ids))
    numbers.write(ints(ids), written)
    known = list(dict.fromkeys(ids))
    assert list(written) == [known.index(one) for one in ids]
    assert list(numbers.ids[: numbers.count]) == known
    assert [numbers.number(one) for one in known] == list(range(len(known)))


def test_an_agent_comes_back_when_it_has_missed_its_turns_as_often_as_it_may():
    assert not core.comes_back(3, 2, 4, 0, -1)
    assert core.comes_back(3, 2, 5, 7, -1)
    assert core.comes_back(3, 2, 5, 0, 1)
    assert not core.comes_back(3, 2, 5, 1, 1)
