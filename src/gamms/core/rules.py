"""Rules of games: tags, flags, agents that come back, goals, and ends. Each is played in one game.

Shapes. A block has games of `agents` agents in the order of their names. Row `game * agents + agent` of a column is an
agent in a game, row `game * teams + team` of `score` a team. Numbers are 64-bit integers, but `alive`, `placed` and
`over` (bytes), `score` (64-bit floats) and keys (64-bit integers without sign). Nodes, agents, teams, flags and rules
are numbers from 0; -1 stands for none. `share` is 64-bit floats.

`Games` has the columns, which `respawn`, `eliminate` and `end_game` write to; `Events` gets what happens. `Tagging`
collects the contacts that make tags, and `Tags` matches them one to one. `Flags` are taken and brought home. A `Rule`
writes to columns and events; rules form a chain in the order in which they are called, and `play` calls all of a chain
in one game. All that lasts longer than a call is in columns that the caller gave, so that games may be played in any
order and, each thread with rules of its own, at once.
"""

from __future__ import annotations

from array import array
from itertools import pairwise
from typing import Any

from gamms.core import contacts, draws
from gamms.core.agents import AgentColumns, Moves, MovingAgents
from gamms.core.contacts import Contacts, Legs, NodeNumbers, Pieces, Tracks

# kinds of events
TAG = 0  # agent, other: whom it tagged, node
RESPAWNED = 1  # agent, node
ELIMINATED = 2  # agent, node
TAKE = 3  # agent, other: the flag, node
DROP = 4  # agent, other: the flag, node
CAPTURE = 5  # agent, other: the flag, node
REACH = 6  # agent, node
ARRIVE = 7  # agent, node
END = 8  # agent: the team that wins, -1: none
ILLEGAL = 9  # agent, other: the edge that it is on, node: it cannot go there from the edge
# what becomes of tagged agents
NOTHING = 0
RESPAWN = 1
ELIMINATE = 2
NOBODY = -1
LEADER = -2  # instead of a team that wins: the one with the highest score
ITS_TEAM = -3  # the one that reached its goal
# the same for callers in Python, which do not see constants with a C type
KINDS = ("tag", "respawned", "eliminated", "take", "drop", "capture", "reach", "arrive", "end", "illegal")  # by number
THEN = {"": NOTHING, "respawn": RESPAWN, "eliminate": ELIMINATE}
WINNERS = {"nobody": NOBODY, "leader": LEADER, "its team": ITS_TEAM}


NO_INTS: memoryview[int] = memoryview(array("q"))
NO_FLOATS: Any = memoryview(array("d"))


class Games:
    """The columns of a block of games that rules read and write.

    Attributes:
        agents, teams: how many a game has.
        node: (games * agents,) where agents are.
        start: (games * agents,) where they were when the turn began.
        previous: (games * agents,) the node before.
        alive: (games * agents,) 1: the agent takes part.
        placed: (games * agents,) 1: a rule put the agent where it is since it moved, so that it passed no node.
        stops: (games * agents,) how often the agent was tagged, put back or taken out.
        home: (games * agents,) where it comes back; -1: it has not come yet.
        turn: (games,) how many turns were played.
        over: (games,) 1: a rule has ended the game.
        score: (games * teams,)
        team: (agents,) of each.
        first_node: (games,) the place at which the nodes of the map of a game begin in tables of several maps, which
            differ in the roads that are open; 0 where there is one.
        edge, share: (games * agents,) in games by metres the edge that an agent is on, -1 on its node, and how much of
            the edge is behind it; see also `by_edges`. Empty in games along one edge a turn.
        nobody: the number of the agents' team that is none; -1: all agents have a team.
    """

    def __init__(
        self,
        agents: int,
        teams: int,
        *,
        node: memoryview[int],
        start: memoryview[int],
        previous: memoryview[int],
        alive: memoryview[int],
        placed: memoryview[int],
        stops: memoryview[int],
        home: memoryview[int],
        turn: memoryview[int],
        over: memoryview[int],
        score: memoryview[float],
        team: memoryview[int],
        first_node: memoryview[int],
        edge: memoryview[int] = NO_INTS,
        share: memoryview[float] = NO_FLOATS,
        nobody: int = -1,
    ) -> None:
        self.agents = agents
        self.teams = teams
        self.node = node
        self.start = start
        self.previous = previous
        self.alive = alive
        self.placed = placed
        self.stops = stops
        self.home = home
        self.turn = turn
        self.over = over
        self.score = score
        self.team = team
        self.first_node = first_node
        self.edge = edge
        self.share = share
        self.nobody = nobody


class Events:
    """What happened in games, in order; the caller empties it by `count = 0`.

    Attributes:
        games, turns, rules, kinds, agents, others, nodes: (room,) of each event; `rules` are their numbers.
        count: how many there are.
        room: for how many there is room; more is made when it is needed.
    """

    def __init__(self, room: int) -> None:
        none: memoryview[Any] = memoryview(array("q"))
        self.games = none
        self.turns = none
        self.rules = none
        self.kinds = none
        self.agents = none
        self.others = none
        self.nodes = none
        self.count = 0
        self.make_room(room)

    def make_room(self, room: int) -> int:
        """Make room for so many events; those that there were are kept."""
        self.games = extended("q", self.games, room)
        self.turns = extended("q", self.turns, room)
        self.rules = extended("q", self.rules, room)
        self.kinds = extended("q", self.kinds, room)
        self.agents = extended("q", self.agents, room)
        self.others = extended("q", self.others, room)
        self.nodes = extended("q", self.nodes, room)
        self.room = room
        return 0

    def put(self, game: int, turn: int, rule: int, kind: int, agent: int, other: int, node: int) -> int:
        """Add an event."""
        if self.count == self.room:
            self.make_room(2 * self.room + 16)
        row = self.count
        self.games[row] = game
        self.turns[row] = turn
        self.rules[row] = rule
        self.kinds[row] = kind
        self.agents[row] = agent
        self.others[row] = other
        self.nodes[row] = node
        self.count = row + 1
        return 0


def extended(kind: str, column: memoryview[Any], room: int) -> memoryview[Any]:
    """Return a column with room for so many numbers of a kind of `array`, the first of which are those of another."""
    longer = memoryview(array(kind, bytes(8 * room)))
    longer[: len(column)] = column
    return longer


# -- verbs -------------------------------------------------------------------------------------------------------------


def respawn(games: Games, events: Events, game: int, agent: int) -> int:
    """Put an agent, dead or alive, where it began, as if it had always been there."""
    row = game * games.agents + agent
    node = games.home[row]
    games.node[row] = node
    games.previous[row] = node
    games.alive[row] = 1
    games.placed[row] = 1
    games.stops[row] += 1
    if len(games.edge) > 0:
        games.edge[row] = -1
        games.share[row] = 0.0
    return events.put(game, games.turn[game], NOBODY, RESPAWNED, agent, -1, node)


def comes_back(out: int, wait: int, turn: int, times: int, most: int) -> bool:
    """Return whether an agent that is out comes back at the end of a turn.

    Args:
        out: the turn in which it went out.
        wait: how many turns it misses.
        turn: the turn.
        times: how often it came back before.
        most: how often it may come back; -1: always.
    """
    return out + wait <= turn and times != most


def eliminate(games: Games, events: Events, game: int, agent: int) -> int:
    """Take an agent out of a game; nothing happens if it is out already."""
    row = game * games.agents + agent
    if games.alive[row]:
        games.alive[row] = 0
        games.stops[row] += 1
        events.put(game, games.turn[game], NOBODY, ELIMINATED, agent, -1, games.node[row])
    return 0


def end_game(games: Games, events: Events, game: int, rule: int, winner: int) -> int:
    """End a game after this turn; several ends of one turn are joined by whoever reads the events.

    Args:
        games: the block.
        events: get the end.
        game: the game.
        rule: the number of the rule that ends it.
        winner: the team that wins; `NOBODY`; or `LEADER`, the team with the highest score, if it is one alone.
    """
    games.over[game] = 1
    if winner == LEADER:
        winner = leader(games.score[game * games.teams : (game + 1) * games.teams], games.nobody)
    return events.put(game, games.turn[game], rule, END, winner, -1, -1)


def leader(scores: memoryview[float], nobody: int = -1) -> int:
    """Return the number of the highest of several scores; -1 where there is only one, or several are the highest.

    Args:
        scores: of teams.
        nobody: the number of one that does not count; -1: all do.
    """
    best = -1
    teams = 0
    is_alone = False
    for team in range(len(scores)):
        if team == nobody:
            continue
        teams += 1
        if best < 0 or scores[team] > scores[best]:
            best = team
            is_alone = True
        elif scores[team] == scores[best]:
            is_alone = False
    return best if is_alone and teams > 1 else -1


# -- the course of a turn ----------------------------------------------------------------------------------------------


def take_moves(
    games: Games, numbers: NodeNumbers, moves: Moves, columns: AgentColumns, agents: MovingAgents, turn: int
) -> int:
    """Write where the agents of the only game of a block were and are, and who was put elsewhere than it went.

    Args:
        games: the block.
        numbers: of the nodes.
        moves: where agents were when the turn began, and where their moves have led.
        columns: have the ids of the nodes where agents are.
        agents: the agents.
        turn: how many turns were played.
    """
    games.turn[0] = turn
    for agent in range(games.agents):
        node = columns._node_of(agents.rows[agent])
        games.start[agent] = numbers.number(moves.starts[agent])
        games.node[agent] = numbers.number(node)
        games.placed[agent] = node != moves.ends[agent]
    return 0


class Steps:
    """How the agents of one game have gone in a turn: along one edge, or none; a subclass says how others have.

    Attributes:
        are_one_edge: whether all go along one edge, or none.
        nodes, times: (2 * agents,) the nodes that agents pass, and when; see `contacts.Tracks`, of which these are the
            columns with `most=2`.
        lengths: (agents,) how many each passes.
    """

    def __init__(self, nodes: memoryview[int], times: memoryview[float], lengths: memoryview[int]) -> None:
        self.are_one_edge = True
        self.nodes = nodes
        self.times = times
        self.lengths = lengths

    def fill(self, games: Games, game: int) -> int:
        """Write how the agents of a game came to where they are."""
        for agent in range(games.agents):
            row = game * games.agents + agent
            node = games.node[row]
            self.nodes[2 * agent] = node
            self.nodes[2 * agent + 1] = node
            self.times[2 * agent] = 0.0
            self.times[2 * agent + 1] = 1.0
            self.lengths[agent] = 1
            if games.placed[row]:
                self.times[2 * agent] = 1.0
            elif games.start[row] != node:
                self.nodes[2 * agent] = games.start[row]
                self.lengths[agent] = 2
        return 0


class Courses(Steps):
    """How the agents of several games have gone in a turn, in any way; `fill` copies what there is of one game.

    Args:
        places: (games,) the number of each game of the block among the several.
        all_ints, all_floats: columns of the several, one game after the other.
        ints, floats: get those of one game.
        behind: fills more columns of that game; None: there are no more.
    """

    def __init__(
        self,
        places: memoryview[int],
        all_ints: memoryview[int],
        all_floats: memoryview[float],
        ints: memoryview[int],
        floats: memoryview[float],
        behind: Steps | None,
    ) -> None:
        super().__init__(ints, floats, ints)
        self.places = places
        self.all_ints = all_ints
        self.all_floats = all_floats
        self.behind = behind
        self.is_last = behind is None
        self.are_one_edge = not self.is_last and self.behind.are_one_edge  # type: ignore[union-attr] # there is one

    def fill(self, games: Games, game: int) -> int:
        """Copy the columns of a game."""
        begin = self.places[game] * len(self.nodes)
        self.nodes[:] = self.all_ints[begin : begin + len(self.nodes)]
        begin = self.places[game] * len(self.times)
        self.times[:] = self.all_floats[begin : begin + len(self.times)]
        if not self.is_last:
            self.behind.fill(games, game)  # type: ignore[union-attr] # it is not the last
        return 0


def fill_steps(steps: Steps, games: Games, game: int) -> int:
    """Write how the agents of a game came to where they are."""
    return steps.fill(games, game)


def fill_sides(games: Games, game: int, plays: memoryview[int], sides: memoryview[int]) -> int:
    """Write which agents of a game take part: those of `plays`, (agents,), that are alive."""
    for agent in range(games.agents):
        sides[agent] = plays[agent] if games.alive[game * games.agents + agent] else 0
    return 0


def find_arrivals(
    tracks: Tracks, legs: Legs, pieces: Pieces, members: memoryview[int], owners: memoryview[int], team: int
) -> int:
    """Find the first visit of each agent of a team to a node of the team; return how many there are.

    Args:
        tracks: of the agents of one game.
        legs: of the same.
        pieces: get all visits; those that are found stand first in `order`, by agent.
        members: (agents,) the team of each.
        owners: (nodes,) the team that each node belongs to.
        team: the team.
    """
    pieces.count = 0
    contacts.put_visits(tracks, legs, pieces, 0)
    found = 0
    last = -1
    for piece in range(pieces.count):
        agent = pieces.agents[piece]
        if agent != last and members[agent] == team and owners[pieces.nodes[piece]] == team:
            pieces.order[found] = piece
            found += 1
            last = agent
    return found


# -- tags --------------------------------------------------------------------------------------------------------------


class Tags:
    """Contacts that make tags, and which tags are made of them; all taggings of a game share one.

    Attributes:
        taken: (agents,) scratch, all 0: whether an agent is in a pair.
        count: how many contacts there are.
        number: how many tags were made.
        taggings, taggers, others, nodes: (number,) of each: by what it was made, who tagged whom, and where the latter
            was.
    """

    def __init__(self, taken: memoryview[int]) -> None:
        self.taken = taken
        self.count = 0
        self.number = 0
        self.run = 0
        none: memoryview[int] = memoryview(array("q"))
        no_floats: Any = memoryview(array("d"))
        self.times: memoryview[float] = no_floats
        self.distances: memoryview[float] = no_floats
        self.draws: memoryview[int] = memoryview(array("Q"))
        self.on_edges = none
        self.by = none
        self.a = none
        self.b = none
        self.a_nodes = none
        self.b_nodes = none
        self.ways = none
        self.order = none
        self.spare = none
        self.taggings = none
        self.taggers = none
        self.others = none
        self.nodes = none
        self.make_room(16)

    def make_room(self, room: int) -> int:
        """Make room for so many contacts; those that there were are kept."""
        self.times = extended("d", self.times, room)
        self.distances = extended("d", self.distances, room)
        self.draws = extended("Q", self.draws, room)
        self.on_edges = extended("q", self.on_edges, room)
        self.by = extended("q", self.by, room)
        self.a = extended("q", self.a, room)
        self.b = extended("q", self.b, room)
        self.a_nodes = extended("q", self.a_nodes, room)
        self.b_nodes = extended("q", self.b_nodes, room)
        self.ways = extended("q", self.ways, room)
        self.order = extended("q", self.order, room)
        self.spare = extended("q", self.spare, room)
        self.taggings = extended("q", self.taggings, 2 * room)  # a contact makes up to two tags
        self.taggers = extended("q", self.taggers, 2 * room)
        self.others = extended("q", self.others, 2 * room)
        self.nodes = extended("q", self.nodes, 2 * room)
        self.room = room
        return 0

    def begin(self) -> int:
        """Forget the contacts of the last turn."""
        self.count = 0
        self.number = 0
        self.run = 0
        return 0

    def add(self, found: Contacts, tagging: int, mutual: bool, owners: memoryview[int], team: memoryview[int]) -> int:
        """Add the contacts of a tagging that make tags, in their order.

        Args:
            found: the contacts.
            tagging: the number of the tagging; greater than those that were added before.
            mutual: whether agents of the second side tag those of the first, too.
            owners: (nodes,) the team of each; an agent is tagged only on a node of the tagger's team. Empty: anywhere.
            team: (agents,) of each.
        """
        self.run = self.count
        is_anywhere = len(owners) == 0
        for place in range(found.kept):
            contact = found.order[place]
            a = found.a[contact]
            b = found.b[contact]
            ways = 0
            if is_anywhere or owners[found.b_nodes[contact]] == team[a]:
                ways = 1
            if mutual and (is_anywhere or owners[found.a_nodes[contact]] == team[b]):
                ways += 2
            if ways == 0:
                continue
            if self.count == self.room:
                self.make_room(2 * self.room)
            row = self.count
            self.count = row + 1
            self.times[row] = found.times[contact]
            self.distances[row] = found.distances[contact]
            self.draws[row] = found.draws[contact]
            self.on_edges[row] = found.on_edges[contact]
            self.a[row] = a
            self.b[row] = b
            self.a_nodes[row] = found.a_nodes[contact]
            self.b_nodes[row] = found.b_nodes[contact]
            self.ways[row] = ways
            self.by[row] = tagging
            self.order[row] = row
        if 0 < self.run < self.count:
            self._merge()
        return 0

    def _merge(self) -> int:
        """Merge the contacts that were added last with those before, in the order of time."""
        one = 0
        other = self.run
        for place in range(self.count):
            if other == self.count or (one < self.run and not self._is_before(self.order[other], self.order[one])):
                self.spare[place] = self.order[one]
                one += 1
            else:
                self.spare[place] = self.order[other]
                other += 1
        for place in range(self.count):
            self.order[place] = self.spare[place]
        return 0

    def _is_before(self, one: int, other: int) -> bool:
        """Return whether a contact comes before one of an earlier tagging."""
        if self.times[one] != self.times[other]:
            return self.times[one] < self.times[other]
        if self.distances[one] != self.distances[other]:
            return self.distances[one] < self.distances[other]
        if self.draws[one] != self.draws[other]:
            return self.draws[one] < self.draws[other]
        return self.on_edges[one] < self.on_edges[other]

    def match(self) -> int:
        """Make tags of contacts whose agents are in no earlier one that makes some; return how many tags there are."""
        number = 0
        for place in range(self.count):
            row = self.order[place]
            a = self.a[row]
            b = self.b[row]
            if self.taken[a] or self.taken[b]:
                continue
            self.taken[a] = 1
            self.taken[b] = 1
            if self.ways[row] & 1:
                self._make(number, self.by[row], a, b, self.b_nodes[row])
                number += 1
            if self.ways[row] & 2:
                self._make(number, self.by[row], b, a, self.a_nodes[row])
                number += 1
        for row in range(self.count):
            self.taken[self.a[row]] = 0
            self.taken[self.b[row]] = 0
        self.number = number
        return number

    def made(self, numbers: NodeNumbers) -> list[tuple[int, int, int, int]]:
        """Return the tags that were made: by what, who tagged whom, and the id of the node where the latter was."""
        return [
            (self.taggings[tag], self.taggers[tag], self.others[tag], numbers.ids[self.nodes[tag]])
            for tag in range(self.number)
        ]

    def _make(self, tag: int, tagging: int, tagger: int, other: int, node: int) -> int:
        self.taggings[tag] = tagging
        self.taggers[tag] = tagger
        self.others[tag] = other
        self.nodes[tag] = node
        return 0


class Tagging:
    """One of the ways by which agents tag others in a chain of them.

    Args:
        contacts: finds the contacts; `Contacts.ask` was called with the tracks of one game, `purposes` and `turns` of
            one game.
        search: how they are found: one of `contacts.SEARCHES`.
        limit: what is near.
        plays: (agents,) 1: taggers; 2: those who are tagged; 3: both; 0: neither.
        mutual: see `Tags.add`.
        owners: see `Tags.add`.
        then: what becomes of those who are tagged: `NOTHING`, `RESPAWN` or `ELIMINATE`.
        points: for the tagger's team.
        behind: the tagging behind it in the chain; None: it is the last.
    """

    def __init__(
        self,
        contacts: Contacts,
        search: int,
        limit: float,
        plays: memoryview[int],
        sides: memoryview[int],
        *,
        mutual: bool,
        owners: memoryview[int],
        then: int,
        points: float,
        behind: Tagging | None = None,
    ) -> None:
        self.contacts = contacts
        self.search = search
        self.limit = limit
        self.plays = plays
        self.sides = sides
        self.mutual = mutual
        self.owners = owners
        self.then = then
        self.points = points
        self.behind = behind
        self.is_last = behind is None

    def collect(self, tags: Tags, games: Games, game: int, number: int) -> int:
        """Add the contacts of a turn that make tags, also those of the taggings behind; this one has a number."""
        fill_sides(games, game, self.plays, self.sides)
        if self.contacts.find(self.search, self.limit) > 0:
            tags.add(self.contacts, number, self.mutual, self.owners, games.team)
        if not self.is_last:
            self.behind.collect(tags, games, game, number + 1)  # type: ignore[union-attr] # it is not the last
        return 0

    def score(self, number: int, games: Games, game: int, tagger: int) -> int:
        """Give the points for a tag by the tagging of a number in this chain."""
        if number > 0:
            return self.behind.score(number - 1, games, game, tagger)  # type: ignore[union-attr] # there is one
        games.score[game * games.teams + games.team[tagger]] += self.points
        return 0

    def follow_up(self, number: int, games: Games, events: Events, game: int, other: int) -> int:
        """Let happen to a tagged agent what happens by the tagging of a number in this chain."""
        if number > 0:
            return self.behind.follow_up(number - 1, games, events, game, other)  # type: ignore[union-attr]
        if self.then == RESPAWN:
            return respawn(games, events, game, other)
        if self.then == ELIMINATE:
            return eliminate(games, events, game, other)
        return 0


# -- flags -------------------------------------------------------------------------------------------------------------


class Flags:
    """The flags of the games of a block: `gamms.rules.capture_flag`.

    Args:
        flags: how many a game has.
        team: (flags,) the team that owns each; -1 where no agent plays for it.
        base: (flags,) the node of each.
        home: (teams,) the base of each team; -1: it has none, and home is each node on which one of its agents began.
        owners: (nodes,) the team for which each node is home, instead. Empty: there is no territory.
        takes: (agents,) the team of each; -1: it takes no flags, because it has no team or is in the air.
        names: (agents,) the keys of their names.
        purposes: (games * flags,) the keys by which lots decide who takes a flag.
        carriers: (games * flags,) the agent that carries each; -1: it is on its base.
        stops: (games * flags,) what `Games.stops` of the carrier was at the end of the last turn.
        captures: (games * teams,) how many flags each team has captured.
        starts: (games * members,) nodes on which agents began; -1: in the air.
        members: (members,) the teams of these agents, dead or alive.
        taken: (flags,) scratch.
        goal: so many captures end the game; 0: none do.
        points: for a capture.
    """

    def __init__(
        self,
        flags: int,
        *,
        team: memoryview[int],
        base: memoryview[int],
        home: memoryview[int],
        owners: memoryview[int],
        takes: memoryview[int],
        names: memoryview[int],
        purposes: memoryview[int],
        carriers: memoryview[int],
        stops: memoryview[int],
        captures: memoryview[int],
        starts: memoryview[int],
        members: memoryview[int],
        taken: memoryview[float],
        goal: int,
        points: float,
    ) -> None:
        self.flags = flags
        self.team = team
        self.base = base
        self.home = home
        self.owners = owners
        self.takes = takes
        self.names = names
        self.purposes = purposes
        self.carriers = carriers
        self.stops = stops
        self.captures = captures
        self.starts = starts
        self.members = members
        self.taken = taken
        self.goal = goal
        self.points = points
        self.involved = 0

    def drop(self, games: Games, events: Events, game: int, rule: int) -> int:
        """Let carriers that are out, or were stopped since the last turn, drop their flags."""
        for flag in range(game * self.flags, (game + 1) * self.flags):
            agent = self.carriers[flag]
            if agent < 0:
                continue
            row = game * games.agents + agent
            if not games.alive[row] or games.stops[row] != self.stops[flag]:
                events.put(game, games.turn[game], rule, DROP, agent, flag - game * self.flags, games.node[row])
                self.carriers[flag] = -1
        return 0

    def note_stops(self, games: Games, game: int) -> int:
        """Note how often carriers were stopped until now."""
        for flag in range(game * self.flags, (game + 1) * self.flags):
            if self.carriers[flag] >= 0:
                self.stops[flag] = games.stops[game * games.agents + self.carriers[flag]]
        return 0

    def concern(self, games: Games, game: int) -> bool:
        """Return whether a carrier may be home, or one that may take a flag is on its base.

        Else nothing happens where agents go along one edge: a node that is left at once belongs to the turn before.
        """
        for flag in range(self.flags):
            carrier = self.carriers[game * self.flags + flag]
            if carrier >= 0 and self._may_be_home(games, game, carrier):
                return True
            for agent in range(games.agents):
                if games.node[game * games.agents + agent] == self.base[flag] and self._may_take(agent, flag):
                    return True
        return False

    def _may_be_home(self, games: Games, game: int, agent: int) -> bool:
        """Return whether an agent is on the base of its team, or home is more than a base."""
        team = self.takes[agent]
        if team < 0 or len(self.owners) > 0 or self.home[team] < 0:
            return True
        return games.node[game * games.agents + agent] == self.home[team]

    def _may_take(self, agent: int, flag: int) -> bool:
        """Return whether a flag is one of another team."""
        return self.takes[agent] >= 0 and self.takes[agent] != self.team[flag]

    def pass_turn(
        self, games: Games, events: Events, game: int, rule: int, tracks: Tracks, legs: Legs, pieces: Pieces
    ) -> int:
        """Let agents bring home and take flags, moment by moment.

        Args:
            games: the block.
            events: get what happens.
            game: the game.
            rule: the number of the rule.
            tracks: of the agents of this game alone; their sides are 0 for those that are out or in the air.
            legs: of the same.
            pieces: scratch.
        """
        pieces.count = 0
        contacts.put_visits(tracks, legs, pieces, 0)
        self._find_involved(game, pieces)
        for flag in range(self.flags):
            self.taken[flag] = -1.0
        now = self._next_moment(pieces, -1.0)
        while now >= 0.0:
            for flag in range(self.flags):
                self._capture(games, events, game, rule, pieces, flag, now)
            for flag in range(self.flags):
                self._take(games, events, game, rule, pieces, flag, now)
            if self._end(games, events, game, rule):
                break
            now = self._next_moment(pieces, now)
        return 0

    def _find_involved(self, game: int, pieces: Pieces) -> int:
        """Put the visits first of agents that come to a base, or carry a flag now; they stay in their order."""
        for piece in range(pieces.count):
            pieces.keys[pieces.agents[piece]] = 0
        for piece in range(pieces.count):
            for flag in range(self.flags):
                agent = pieces.agents[piece]
                if pieces.nodes[piece] == self.base[flag] or self.carriers[game * self.flags + flag] == agent:
                    pieces.keys[agent] = 1
        self.involved = 0
        for piece in range(pieces.count):
            if pieces.keys[pieces.agents[piece]]:
                pieces.order[self.involved] = piece
                self.involved += 1
        return 0

    def _next_moment(self, pieces: Pieces, now: float) -> float:
        """Return when the next of the agents involved reaches a node; -1: none does."""
        soonest = -1.0
        for place in range(self.involved):
            since = pieces.since[pieces.order[place]]
            if since > now and (soonest < 0.0 or since < soonest):
                soonest = since
        return soonest

    def _capture(
        self, games: Games, events: Events, game: int, rule: int, pieces: Pieces, flag: int, now: float
    ) -> int:
        """Let the carrier of a flag bring it home if it reaches home now."""
        row = game * self.flags + flag
        agent = self.carriers[row]
        if agent < 0 or now <= self.taken[flag]:
            return 0
        for place in range(self.involved):
            piece = pieces.order[place]
            if pieces.agents[piece] != agent or pieces.since[piece] != now:
                continue
            if self._is_home(game, self.takes[agent], pieces.nodes[piece]):
                team = game * games.teams + self.takes[agent]
                events.put(game, games.turn[game], rule, CAPTURE, agent, flag, pieces.nodes[piece])
                games.score[team] += self.points
                self.captures[team] += 1
                self.carriers[row] = -1
                return 0
        return 0

    def _is_home(self, game: int, team: int, node: int) -> bool:
        """Return whether a node is home for a team."""
        if len(self.owners) > 0:
            return self.owners[node] == team
        if self.home[team] >= 0:
            return self.home[team] == node
        begin = game * len(self.members)
        found = False
        for member in range(len(self.members)):
            found = found or (self.members[member] == team and self.starts[begin + member] == node)
        return found

    def _take(self, games: Games, events: Events, game: int, rule: int, pieces: Pieces, flag: int, now: float) -> int:
        """Let one of the agents of other teams that are on the base of a flag now take it, if none carries it."""
        row = game * self.flags + flag
        if self.carriers[row] >= 0:
            return 0
        taker = -1
        least = draws.mix(0)
        for place in range(self.involved):
            piece = pieces.order[place]
            agent = pieces.agents[piece]
            if (
                pieces.nodes[piece] != self.base[flag]
                or pieces.since[piece] > now
                or now > pieces.until[piece]
                or not self._may_take(agent, flag)
                or self._carries(game, agent)
            ):
                continue
            first = draws.first_key(self.purposes[row], self.names[agent])
            bits = draws.bits_at(draws.turn_key(first, games.turn[game]), 0)
            if taker < 0 or bits < least or (bits == least and agent < taker):
                taker = agent
                least = bits
        if taker >= 0:
            self.carriers[row] = taker
            self.taken[flag] = now
            events.put(game, games.turn[game], rule, TAKE, taker, flag, self.base[flag])
        return 0

    def _carries(self, game: int, agent: int) -> bool:
        """Return whether an agent carries a flag."""
        found = False
        for flag in range(game * self.flags, (game + 1) * self.flags):
            found = found or self.carriers[flag] == agent
        return found

    def _end(self, games: Games, events: Events, game: int, rule: int) -> bool:
        """End a game in which a team has captured as many flags as it needs; several at one moment draw."""
        if self.goal == 0:
            return False
        winner = -1
        full = 0
        for team in range(games.teams):
            if self.captures[game * games.teams + team] >= self.goal:
                winner = team
                full += 1
        if full > 0:
            end_game(games, events, game, rule, winner if full == 1 else NOBODY)
        return full > 0


# -- rules -------------------------------------------------------------------------------------------------------------


class Rule:
    """What happens after the moves of a turn, in a chain of such rules.

    Args:
        games: the block.
        events: get what happens.
        number: of the rule, for events.

    Attributes:
        behind: the rule that is called next; `is_last`: there is none. `chained` sets both.
    """

    def __init__(self, games: Games, events: Events, number: int) -> None:
        self.games = games
        self.events = events
        self.number = number
        self.behind: Rule | None = None
        self.is_last = True

    def happen(self, game: int) -> int:  # noqa: ARG002 - of rules that have something to do
        """Let happen what the rule says, in one game."""
        return 0

    def happen_all(self, game: int) -> int:
        """Call this rule and those behind it."""
        self.happen(game)
        if not self.is_last:
            self.behind.happen_all(game)  # type: ignore[union-attr] # it is not the last
        return 0


def chained(rules: list[Rule]) -> Rule:
    """Return the first of several rules, each of which is called before the next."""
    for rule, behind in pairwise(rules):
        rule.behind = behind
        rule.is_last = False
    return rules[0]


def play(rule: Rule, game: int) -> int:
    """Call a rule, and those behind it, in one game."""
    return rule.happen_all(game)


def play_games(rule: Rule, games: memoryview[int]) -> int:
    """Call a rule, and those behind it, in games of these numbers."""
    for place in range(len(games)):
        rule.happen_all(games[place])
    return 0


class TagRule(Rule):
    """Agents tag those that they meet: `gamms.rules.tag`, all such rules of a game as one.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`; events have this number, and their tags the numbers of taggings behind it.
        first: the first tagging of the chain.
        tags: scratch.
        steps: the tracks that the contacts of all taggings have.
        purpose: (1,) the key of the game that the contacts have, by which lots decide between equals.
        turn: (1,) the turn that the contacts have.
        purposes: (games,) the keys of all games.
    """

    def __init__(
        self,
        games: Games,
        events: Events,
        number: int,
        first: Tagging,
        tags: Tags,
        steps: Steps,
        purpose: memoryview[int],
        turn: memoryview[int],
        purposes: memoryview[int],
    ) -> None:
        super().__init__(games, events, number)
        self.first = first
        self.tags = tags
        self.steps = steps
        self.purpose = purpose
        self.turn = turn
        self.purposes = purposes

    def happen(self, game: int) -> int:
        """Find all pairs before any agent is moved; then count the tags; then move the tagged agents."""
        self.steps.fill(self.games, game)
        self.purpose[0] = self.purposes[game]
        self.turn[0] = self.games.turn[game]
        self.tags.begin()
        self.first.collect(self.tags, self.games, game, 0)
        if self.tags.count == 0:
            return 0
        number = self.tags.match()
        for tag in range(number):
            tagger = self.tags.taggers[tag]
            other = self.tags.others[tag]
            by = self.tags.taggings[tag]
            self.events.put(game, self.turn[0], self.number + by, TAG, tagger, other, self.tags.nodes[tag])
            self.games.stops[game * self.games.agents + other] += 1
            self.first.score(by, self.games, game, tagger)
        for tag in range(number):
            self.first.follow_up(self.tags.taggings[tag], self.games, self.events, game, self.tags.others[tag])
        return 0


class FlagRule(Rule):
    """Agents take the flags of other teams and bring them home.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        flags: of the games.
        steps: the columns of the tracks.
        tracks: of one game.
        legs: of one game, none.
        pieces: scratch.
        ground: (agents,) 1: the agent is on the ground; 0: it is in the air.
        sides: (agents,) those of the tracks.
    """

    def __init__(
        self,
        games: Games,
        events: Events,
        number: int,
        *,
        flags: Flags,
        steps: Steps,
        tracks: Tracks,
        legs: Legs,
        pieces: Pieces,
        ground: memoryview[int],
        sides: memoryview[int],
    ) -> None:
        super().__init__(games, events, number)
        self.flags = flags
        self.steps = steps
        self.tracks = tracks
        self.legs = legs
        self.pieces = pieces
        self.ground = ground
        self.sides = sides

    def happen(self, game: int) -> int:
        """Let carriers drop, bring home and take flags."""
        self.flags.drop(self.games, self.events, game, self.number)
        if not self.steps.are_one_edge or self.flags.concern(self.games, game):
            self.steps.fill(self.games, game)
            fill_sides(self.games, game, self.ground, self.sides)
            self.flags.pass_turn(self.games, self.events, game, self.number, self.tracks, self.legs, self.pieces)
            self.flags.note_stops(self.games, game)
        return 0


class Returns(Rule):
    """Agents that are out come back where they began: `gamms.rules.respawn`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        plays: (agents,) 1: the agent comes back; 0: it does not.
        out: (games * agents,) the turn in which it went out; -1: it did not.
        times: (games * agents,) how often it came back.
        wait: how many turns an agent misses.
        most: how often each comes back; -1: always.
    """

    def __init__(
        self,
        games: Games,
        events: Events,
        number: int,
        *,
        plays: memoryview[int],
        out: memoryview[int],
        times: memoryview[int],
        wait: int,
        most: int,
    ) -> None:
        super().__init__(games, events, number)
        self.plays = plays
        self.out = out
        self.times = times
        self.wait = wait
        self.most = most

    def happen(self, game: int) -> int:
        """Bring those back that have waited long enough."""
        for agent in range(self.games.agents):
            row = game * self.games.agents + agent
            if self.games.alive[row] or self.games.home[row] < 0 or not self.plays[agent]:
                self.out[row] = -1
                continue
            if self.out[row] < 0:
                self.out[row] = self.games.turn[game]
            if comes_back(self.out[row], self.wait, self.games.turn[game], self.times[row], self.most):
                self.times[row] += 1
                self.out[row] = -1
                respawn(self.games, self.events, game, agent)
        return 0


class TimeLimit(Rule):
    """The game ends after so many turns: `gamms.rules.time_limit`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        last: the turn after which it ends.
        winner: see `end_game`.
    """

    def __init__(self, games: Games, events: Events, number: int, *, last: int, winner: int) -> None:
        super().__init__(games, events, number)
        self.last = last
        self.winner = winner

    def happen(self, game: int) -> int:
        """End the game when it is time."""
        if self.games.turn[game] >= self.last:
            end_game(self.games, self.events, game, self.number, self.winner)
        return 0


class NoneLeft(Rule):
    """The game ends when no agent of a team is alive: `gamms.rules.none_left`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        team: the team, which has agents.
        winner: see `end_game`.
    """

    def __init__(self, games: Games, events: Events, number: int, *, team: int, winner: int) -> None:
        super().__init__(games, events, number)
        self.team = team
        self.winner = winner

    def happen(self, game: int) -> int:
        """End the game if none of them is alive."""
        for agent in range(self.games.agents):
            if self.games.team[agent] == self.team and self.games.alive[game * self.games.agents + agent]:
                return 0
        return end_game(self.games, self.events, game, self.number, self.winner)


class LastTeam(Rule):
    """The game ends when the living agents are of one team, which wins, or of none: `gamms.rules.last_team`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
    """

    def happen(self, game: int) -> int:
        """End the game if at most one team is left."""
        left = -1
        for agent in range(self.games.agents):
            team = self.games.team[agent]
            if team != self.games.nobody and self.games.alive[game * self.games.agents + agent]:
                if left >= 0 and team != left:
                    return 0
                left = team
        return end_game(self.games, self.events, game, self.number, left)


class Visitors:
    """The agents of one game on the ground, and the nodes that they visit in a turn.

    Args:
        steps: the columns of the tracks.
        tracks: of one game.
        legs: of one game.
        pieces: scratch, which gets the visits.
        ground: (agents,) 1: the agent is on the ground; 0: it is in the air.
        sides: (agents,) those of the tracks.
    """

    def __init__(
        self, steps: Steps, tracks: Tracks, legs: Legs, pieces: Pieces, ground: memoryview[int], sides: memoryview[int]
    ) -> None:
        self.steps = steps
        self.tracks = tracks
        self.legs = legs
        self.pieces = pieces
        self.ground = ground
        self.sides = sides

    def follow(self, games: Games, game: int) -> int:
        """Follow how the agents of a game have gone in this turn."""
        self.steps.fill(games, game)
        return fill_sides(games, game, self.ground, self.sides)


class Reach(Rule):
    """The game ends when an agent reaches a goal of its team: `gamms.rules.reach`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        visitors: the agents.
        goals: (nodes * teams,) 1: the node is a goal of the team; row `node * teams + team`.
        starters: (teams * agents,) 1: where the agent began is a goal of the team, too. Empty: there are none.
        order: (reaching,) the teams that have goals, in the order in which their agents are named in events.
        winner: the team that wins; `NOBODY`; `ITS_TEAM`: the one that reached its goal.
        points: for each team that reached its goal.
    """

    def __init__(
        self,
        games: Games,
        events: Events,
        number: int,
        *,
        visitors: Visitors,
        goals: memoryview[int],
        starters: memoryview[int],
        order: memoryview[int],
        winner: int,
        points: float,
    ) -> None:
        super().__init__(games, events, number)
        self.visitors = visitors
        self.pieces: Pieces = self.visitors.pieces
        self.goals = goals
        self.starters = starters
        self.order = order
        self.winner = winner
        self.points = points

    def happen(self, game: int) -> int:
        """Let the earliest agents reach their goals; teams that do so at one moment draw."""
        self._mark_starts(game, 1)
        self._reach(game)
        return self._mark_starts(game, 0)

    def _mark_starts(self, game: int, mark: int) -> int:
        """Mark where agents of a game began as goals, or no longer."""
        for place in range(len(self.starters)):
            home = self.games.home[game * self.games.agents + place % self.games.agents]
            if self.starters[place] and home >= 0:
                self.goals[home * self.games.teams + place // self.games.agents] = mark
        return 0

    def _reach(self, game: int) -> int:
        self.visitors.follow(self.games, game)
        self.pieces.count = 0
        contacts.put_visits(self.visitors.tracks, self.visitors.legs, self.pieces, 0)
        earliest = 2.0
        for piece in range(self.pieces.count):
            since = self.pieces.since[piece]
            if since < earliest and self._is_goal(piece, self.games.team[self.pieces.agents[piece]]):
                earliest = since
        if earliest == 2.0:
            return 0
        teams = 0
        winner = -1
        for place in range(len(self.order)):
            team = self.order[place]
            last = -1
            for piece in range(self.pieces.count):
                agent = self.pieces.agents[piece]
                is_first = agent != last and self.pieces.since[piece] == earliest
                if is_first and self.games.team[agent] == team and self._is_goal(piece, team):
                    last = agent
                    node = self.pieces.nodes[piece]
                    self.events.put(game, self.games.turn[game], self.number, REACH, agent, -1, node)
            if last >= 0:
                teams += 1
                winner = team
                self.games.score[game * self.games.teams + team] += self.points
        if teams > 1:
            winner = NOBODY
        elif self.winner != ITS_TEAM:
            winner = self.winner
        return end_game(self.games, self.events, game, self.number, winner)

    def _is_goal(self, piece: int, team: int) -> bool:
        """Return whether a visit is one of a goal of a team."""
        return self.goals[self.pieces.nodes[piece] * self.games.teams + team] == 1


class Arrive(Rule):
    """Agents that reach a goal score and are out: `gamms.rules.arrive`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        visitors: the agents.
        team: of the agents.
        owners: (nodes,) the team, if the node is a goal; else -1.
        starters: (agents,) 1: where the agent began is a goal, too. Empty: there are none.
        points: for each.
    """

    def __init__(
        self,
        games: Games,
        events: Events,
        number: int,
        *,
        visitors: Visitors,
        team: int,
        owners: memoryview[int],
        starters: memoryview[int],
        points: float,
    ) -> None:
        super().__init__(games, events, number)
        self.visitors = visitors
        self.starters = starters
        self.pieces: Pieces = self.visitors.pieces
        self.team = team
        self.owners = owners
        self.points = points

    def happen(self, game: int) -> int:
        """Let those that are at a goal arrive; all are named before one is taken out."""
        self.visitors.follow(self.games, game)
        self._mark_starts(game, self.team)
        found = find_arrivals(
            self.visitors.tracks, self.visitors.legs, self.pieces, self.games.team, self.owners, self.team
        )
        self._mark_starts(game, NOBODY)
        for place in range(found):
            piece = self.pieces.order[place]
            agent = self.pieces.agents[piece]
            self.events.put(game, self.games.turn[game], self.number, ARRIVE, agent, -1, self.pieces.nodes[piece])
        for place in range(found):
            self.games.score[game * self.games.teams + self.team] += self.points
            eliminate(self.games, self.events, game, self.pieces.agents[self.pieces.order[place]])
        return 0

    def _mark_starts(self, game: int, mark: int) -> int:
        """Let the nodes where agents of a game began belong to a team."""
        for agent in range(len(self.starters)):
            home = self.games.home[game * self.games.agents + agent]
            if self.starters[agent] and home >= 0:
                self.owners[home] = mark
        return 0
