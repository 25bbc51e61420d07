"""Rules of games: tags, flags, respawns, goals and ends, each applied to one game.

Shapes: a block has games of `agents` agents, which are numbered in the order of their names. `GameColumns.get_row` is
the row of an agent in a column of all games; row `game * teams + team` of `score` is a team. Numbers are 64-bit
integers, except `alive`, `placed` and `over` (bytes), `score` and `share` (64-bit floats), and keys (unsigned 64-bit
integers). Nodes, agents, teams, flags and rules are numbered from 0; -1 stands for none.

`GameColumns` holds the columns, which `respawn`, `eliminate` and `end_game` change; `Events` receives events. `Tagging`
collects contacts, and `Tags` turns them into tags, at most one contact per agent. `Flags` are taken and captured. A
`Rule` changes columns and adds events; rules form a chain in the order of their calls, and `play` calls a whole chain
in one game. All lasting state is in columns that the caller gave; therefore games can be played in any order and, if
each thread has its own rules, in parallel.
"""

from __future__ import annotations

from array import array
from itertools import pairwise
from typing import Any

from gamms.core import contacts, draws
from gamms.core.agents import MoveColumns, NodeNumbers
from gamms.core.contacts import Contacts, Legs, MotionIntervals, Tracks, extend_column

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
CALL = 9  # agent, other: whom it tagged, node; a function of the caller follows
ILLEGAL = 10  # agent, other: the edge that it is on, node: it cannot move there from the edge
WAITS = 11  # agent, node: it has arrived too often in a turn, and waits there
LATE_DEED = 12  # agent, node: it has decided there to do a deed, when the turn had begun
# effects of a tag
NOTHING = 0
RESPAWN = 1
ELIMINATE = 2
FUNCTION = 3  # of the caller
GONE = -2  # instead of the agent that carries a flag: it was deleted
NOBODY = -1
LEADER = -2  # as a winner: the team with the highest score
ITS_TEAM = -3  # the team that reached its goal
# why a game is over
BY_EVENT = 1
BY_TIME = 2  # no rule but its time limit has ended it
# the same for callers in Python, which do not see constants with a C type
KINDS = (  # by number
    *("tag", "respawned", "eliminated", "take", "drop", "capture", "reach", "arrive", "end", "call"),
    *("illegal", "waits", "late deed"),
)
THEN = {"": NOTHING, "respawn": RESPAWN, "eliminate": ELIMINATE, "function": FUNCTION}
CARRIERS = {"nobody": NOBODY, "gone": GONE}
WINNERS = {"nobody": NOBODY, "leader": LEADER, "its team": ITS_TEAM}


NO_INTS: memoryview[int] = memoryview(array("q"))
NO_FLOATS: Any = memoryview(array("d"))


class GameColumns:
    """The columns of a block of games that rules read and write.

    In the game of a context, the rows are those of its agents, in order of creation, and `node`, `previous` and `alive`
    are the columns of the agents themselves; `bind` sets them. Elsewhere rows are in the order of names, so modules
    that move agents compute a row as `game * agents + agent`.

    Attributes:
        agents, teams: the numbers of agents and teams in a game. In a single game, agents may come and leave while the
            columns have room.
        rows: the number of rows of a game.
        order: (agents,) the row of each agent within a game, by the number of the agent.
        applies_effects: whether `respawn` and `eliminate` write to the columns; False: they only add events, and the
            caller applies these to its agents.
        node: (games * rows,) the node of each agent.
        start: (games * rows,) its node at the start of the turn.
        previous: (games * rows,) its previous node.
        alive: (games * rows,) 1: the agent is alive.
        placed: (games * rows,) 1: a rule has placed the agent on its node since its move, so that it passed no node.
        stops: (games * rows,) how often the agent was tagged, respawned or eliminated.
        home: (games * rows,) the node where it respawns; -1: it is not in the game.
        turn: (games,) the number of turns played.
        over: (games,) `BY_EVENT`: a rule has ended the game; `BY_TIME`: only its time limit has; 0: it goes on.
        score: (games * teams,) the score of each team.
        team: (agents,) the team of each agent.
        plays: (games * teams,) 1: the team has, or had, an agent in the game.
        first_node: (games,) the place of the first node of the game's map in tables for several maps, which differ in
            the open roads; 0 if there is one map.
        mode_first: (agents,) the offset from `first_node` to the edges that each agent may use; see `find_first_place`.
            Empty in games without modes.
        edge, share: (games * rows,) in games by metres, the edge of an agent, -1 on a node, and the share of the edge
            behind it; see also `by_edges`. Empty in games along one edge per turn.
        nobody: the team number of agents without a team; -1: all agents have a team.
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
        plays: memoryview[int],
        first_node: memoryview[int],
        mode_first: memoryview[int] = NO_INTS,
        edge: memoryview[int] = NO_INTS,
        share: memoryview[float] = NO_FLOATS,
        nobody: int = -1,
        applies_effects: bool = True,
    ) -> None:
        self.agents = agents
        self.teams = teams
        self.rows = agents
        self.order = memoryview(array("q", range(agents)))
        self.applies_effects = applies_effects
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
        self.plays = plays
        self.first_node = first_node
        self.mode_first = mode_first
        self.edge = edge
        self.share = share
        self.nobody = nobody

    def get_row(self, game: int, agent: int) -> int:
        """Return the row of an agent in a game."""
        return game * self.rows + self.order[agent]

    def bind(self, node: memoryview[int], previous: memoryview[int], alive: memoryview[int]) -> int:
        """Set the columns of a single game, (rows,)."""
        self.node = node
        self.previous = previous
        self.alive = alive
        self.rows = len(node)
        return 0


def find_first_place(games: GameColumns, game: int, agent: int) -> int:
    """Return the place of the first node, in tables of the edges that an agent may use."""
    if len(games.mode_first) == 0:
        return games.first_node[game]
    return games.first_node[game] + games.mode_first[agent]


class Events:
    """The events of games, in order; the caller removes all by `count = 0`.

    Attributes:
        games, turns, rules, kinds, agents, others, nodes: (room,) the fields of each event; `rules` are rule numbers.
        times: (room,) the time of each tag within its turn, from 0 to 1; other events have no time.
        count: the number of events.
        rule: the number of the rule that is played, or was played last.
        room: the maximum number of events; it grows when necessary.
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
        no_times: Any = memoryview(array("d"))
        self.times: memoryview[float] = no_times
        self.count = 0
        self.rule = NOBODY
        self.make_room(room)

    def make_room(self, room: int) -> int:
        """Make room for `room` events, and keep the existing ones."""
        self.games = extend_column("q", self.games, room)
        self.turns = extend_column("q", self.turns, room)
        self.rules = extend_column("q", self.rules, room)
        self.kinds = extend_column("q", self.kinds, room)
        self.agents = extend_column("q", self.agents, room)
        self.others = extend_column("q", self.others, room)
        self.nodes = extend_column("q", self.nodes, room)
        self.times = extend_column("d", self.times, room)
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

    def take_all(self) -> list[tuple[int, int, int, int, int, float]]:
        """Remove all events; return the kind, rule, agent, other, node and time of each."""
        found = [
            (self.kinds[row], self.rules[row], self.agents[row], self.others[row], self.nodes[row], self.times[row])
            for row in range(self.count)
        ]
        self.count = 0
        return found


# -- verbs -------------------------------------------------------------------------------------------------------------


def respawn(games: GameColumns, events: Events, game: int, agent: int) -> int:
    """Place an agent, dead or alive, on its home node, alive."""
    row = games.get_row(game, agent)
    node = games.home[row]
    games.stops[row] += 1
    if games.applies_effects:
        games.node[row] = node
        games.previous[row] = node
        games.alive[row] = 1
        games.placed[row] = 1
        if len(games.edge) > 0:
            games.edge[row] = -1
            games.share[row] = 0.0
    return events.put(game, games.turn[game], events.rule, RESPAWNED, agent, -1, node)


def eliminate(games: GameColumns, events: Events, game: int, agent: int) -> int:
    """Eliminate an agent; do nothing if it is already eliminated.

    No rule eliminates an agent twice in one call, so the columns need not show the effects of this call.
    """
    row = games.get_row(game, agent)
    if games.alive[row]:
        if games.applies_effects:
            games.alive[row] = 0
        games.stops[row] += 1
        events.put(game, games.turn[game], events.rule, ELIMINATED, agent, -1, games.node[row])
    return 0


def end_game(games: GameColumns, events: Events, game: int, rule: int, winner: int) -> int:
    """End a game after this turn; readers of the events combine several ends of one turn.

    Args:
        games: the block.
        events: receives the end.
        game: the game.
        rule: the number of the rule that ends it.
        winner: the winning team; `NOBODY`; or `LEADER`, the team with the highest score, if no other team has it.
    """
    games.over[game] = BY_EVENT
    if winner == LEADER:
        winner = find_leader(games, game)
    return events.put(game, games.turn[game], rule, END, winner, -1, -1)


def find_leader(games: GameColumns, game: int) -> int:
    """Return the team with the highest score; -1 if several teams have it, or only one team plays."""
    first = game * games.teams
    best = -1
    teams = 0
    is_alone = False
    for team in range(games.teams):
        if team == games.nobody or not games.plays[first + team]:
            continue
        teams += 1
        if best < 0 or games.score[first + team] > games.score[first + best]:
            best = team
            is_alone = True
        elif games.score[first + team] == games.score[first + best]:
            is_alone = False
    return best if is_alone and teams > 1 else -1


# -- paths in a turn ---------------------------------------------------------------------------------------------------


def take_moves(
    games: GameColumns, moves: MoveColumns, numbers: NodeNumbers, slots: memoryview[int], took_part: bytes
) -> int:
    """Write the start nodes of the agents of a single game, and which agents have made no move to their node.

    Args:
        games: the block.
        moves: the start and end of each move.
        numbers: the numbers of the nodes.
        slots: (agents,) the move of each agent; -1: it has none.
        took_part: whether the agent of each move took part.
    """
    for agent in range(games.agents):
        row = games.get_row(0, agent)
        slot = slots[agent]
        if slot < 0 or not took_part[slot]:
            games.placed[row] = 1
            games.start[row] = games.node[row]
        else:
            games.placed[row] = numbers.ids[games.node[row]] != moves.ends[slot]
            games.start[row] = numbers.number(moves.starts[slot])
    return 0


class AgentPaths:
    """The paths of the agents of one game in a turn, along at most one edge each; subclasses handle other paths.

    Attributes:
        are_one_edge: whether all paths have at most one edge.
        nodes, times: (2 * agents,) the nodes of each path and their times: the columns of `contacts.Tracks` with
            `most=2`.
        lengths: (agents,) the number of nodes of each path.
    """

    def __init__(self, nodes: memoryview[int], times: memoryview[float], lengths: memoryview[int]) -> None:
        self.are_one_edge = True
        self.nodes = nodes
        self.times = times
        self.lengths = lengths

    def fill(self, games: GameColumns, game: int) -> int:
        """Write the paths of the agents of a game."""
        for agent in range(games.agents):
            row = games.get_row(game, agent)
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


class GivenPaths(AgentPaths):
    """The paths of the agents of a single game, written by the caller."""

    def __init__(self, nodes: memoryview[int], times: memoryview[float], lengths: memoryview[int]) -> None:
        super().__init__(nodes, times, lengths)
        self.are_one_edge = False

    def fill(self, games: GameColumns, game: int) -> int:  # noqa: ARG002 - as that of other paths
        """Leave the paths as they are."""
        return 0


def fill_steps(steps: AgentPaths, games: GameColumns, game: int) -> int:
    """Write the paths of the agents of a game."""
    return steps.fill(games, game)


def fill_sides(games: GameColumns, game: int, plays: memoryview[int], sides: memoryview[int]) -> int:
    """Write the sides, (agents,), of the living agents of a game from `plays`, and 0 for all others."""
    for agent in range(games.agents):
        sides[agent] = plays[agent] if games.alive[games.get_row(game, agent)] else 0
    return 0


def find_arrivals(
    tracks: Tracks, legs: Legs, pieces: MotionIntervals, members: memoryview[int], owners: memoryview[int], team: int
) -> int:
    """Find the first visit of each agent of a team to a node of the team; return the number of these visits.

    Args:
        tracks: the nodes that the agents of one game pass.
        legs: the edges that they cover.
        pieces: receives all visits; the first visits are the first items of `order`, by agent.
        members: (agents,) the team of each agent.
        owners: (nodes,) the team of each node.
        team: the team.
    """
    contacts.put_visits(tracks, legs, pieces)
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
    """Contacts of all taggings of a game, and the tags made from them.

    Attributes:
        taken: (agents,) working memory, all 0: whether an agent is already in a pair.
        count: the number of contacts.
        number: the number of tags.
        taggings, taggers, others, nodes, moments: (number,) for each tag, the tagging, the tagger, the tagged agent,
            its node, and the time within the turn.
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
        self.moments: memoryview[float] = no_floats
        self.make_room(16)

    def make_room(self, room: int) -> int:
        """Make room for `room` contacts, and keep the existing ones."""
        self.times = extend_column("d", self.times, room)
        self.distances = extend_column("d", self.distances, room)
        self.draws = extend_column("Q", self.draws, room)
        self.on_edges = extend_column("q", self.on_edges, room)
        self.by = extend_column("q", self.by, room)
        self.a = extend_column("q", self.a, room)
        self.b = extend_column("q", self.b, room)
        self.a_nodes = extend_column("q", self.a_nodes, room)
        self.b_nodes = extend_column("q", self.b_nodes, room)
        self.ways = extend_column("q", self.ways, room)
        self.order = extend_column("q", self.order, room)
        self.spare = extend_column("q", self.spare, room)
        self.taggings = extend_column("q", self.taggings, 2 * room)  # a contact makes up to two tags
        self.taggers = extend_column("q", self.taggers, 2 * room)
        self.others = extend_column("q", self.others, 2 * room)
        self.nodes = extend_column("q", self.nodes, 2 * room)
        self.moments = extend_column("d", self.moments, 2 * room)
        self.room = room
        return 0

    def begin(self) -> int:
        """Remove the contacts of the last turn."""
        self.count = 0
        self.number = 0
        self.run = 0
        return 0

    def add(self, found: Contacts, tagging: int, mutual: bool, ground: Territory, team: memoryview[int]) -> int:
        """Add the contacts of a tagging that can make tags, in their order.

        Args:
            found: the contacts.
            tagging: the number of the tagging, greater than the previous ones.
            mutual: whether agents of the second side also tag agents of the first.
            ground: the territory; an agent is tagged only on a node that the tagger owns. Empty: anywhere.
            team: (agents,) the team of each agent.
        """
        self.run = self.count
        is_anywhere = ground.is_empty
        for place in range(found.kept):
            contact = found.order[place]
            a = found.a[contact]
            b = found.b[contact]
            ways = 0
            if is_anywhere or ground.is_own(found.b_nodes[contact], a, team[a]):
                ways = 1
            if mutual and (is_anywhere or ground.is_own(found.a_nodes[contact], b, team[b])):
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
        """Merge the contacts added last with the earlier ones, by time."""
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
        """Return whether a contact comes before another: by time, distance, random bits, and node before edge."""
        if self.times[one] != self.times[other]:
            return self.times[one] < self.times[other]
        if self.distances[one] != self.distances[other]:
            return self.distances[one] < self.distances[other]
        if self.draws[one] != self.draws[other]:
            return self.draws[one] < self.draws[other]
        return self.on_edges[one] < self.on_edges[other]

    def match(self) -> int:
        """Make tags greedily: skip contacts of an agent that has been in an earlier pair. Return the number of tags."""
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
                self._make(number, row, a, b, self.b_nodes[row])
                number += 1
            if self.ways[row] & 2:
                self._make(number, row, b, a, self.a_nodes[row])
                number += 1
        for row in range(self.count):
            self.taken[self.a[row]] = 0
            self.taken[self.b[row]] = 0
        self.number = number
        return number

    def _make(self, tag: int, row: int, tagger: int, other: int, node: int) -> int:
        """Make a tag from the contact in a row."""
        self.taggings[tag] = self.by[row]
        self.moments[tag] = self.times[row]
        self.taggers[tag] = tagger
        self.others[tag] = other
        self.nodes[tag] = node
        return 0


class Territory:
    """The owners of nodes: teams, or roles of some agents of a team.

    Args:
        owners: (nodes,) the number of a team, -1: no owner, or -2 - number of a role. Empty: there is no territory.
        holders: (roles * agents,) whether each agent has each role.
        agents: the number of agents for which `holders` has room.
    """

    def __init__(self, owners: memoryview[int], holders: memoryview[int], agents: int) -> None:
        self.owners = owners
        self.holders = holders
        self.agents = agents
        self.is_empty = len(owners) == 0

    def is_own(self, node: int, agent: int, team: int) -> bool:
        """Return whether a node belongs to the team of an agent, or to a role that the agent has."""
        owner = self.owners[node]
        if owner >= -1:
            return owner == team
        return self.holders[(-2 - owner) * self.agents + agent] != 0


class Tagging:
    """One tag rule, in a chain of all tag rules of a game.

    Args:
        contacts: finds the contacts; `Contacts.ask` was called with the tracks, purpose and turn of one game.
        search: the kind of search, one of `contacts.SEARCHES`.
        limit: the maximum distance.
        plays: (agents,) 1: taggers; 2: agents that can be tagged; 3: both; 0: neither.
        sides: (agents,) the sides of the tracks; written before each search.
        mutual: see `Tags.add`.
        ground: see `Tags.add`.
        then: the effect on tagged agents: `NOTHING`, `RESPAWN`, `ELIMINATE` or `FUNCTION`.
        points: the points for the tagger's team.
        ends: whether a tag ends the game.
        behind: the next tagging of the chain; None: this is the last.
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
        ground: Territory,
        then: int,
        points: float,
        ends: bool,
        behind: Tagging | None = None,
    ) -> None:
        self.contacts = contacts
        self.search = search
        self.limit = limit
        self.plays = plays
        self.sides = sides
        self.mutual = mutual
        self.ground = ground
        self.then = then
        self.points = points
        self.ends = ends
        self.behind = behind
        self.is_last = behind is None

    def find(self, games: GameColumns, game: int) -> int:
        """Find the contacts of living agents; return their number."""
        fill_sides(games, game, self.plays, self.sides)
        self.contacts.reach.first = games.first_node[game]
        return self.contacts.find(self.search, self.limit)

    def may_meet(self, games: GameColumns, game: int) -> bool:
        """Return whether agents of both sides may meet, by this tagging or a later one of the chain.

        If each agent covers at most one edge, those that meet on nodes or edges have their first or last node in
        common. This test needs no paths.
        """
        if self.search != contacts.ON_NODES or self._share_ends(games, game, self.contacts.pieces):
            return True
        return not self.is_last and self.behind.may_meet(games, game)  # type: ignore[union-attr] # it is not the last

    def _share_ends(self, games: GameColumns, game: int, pieces: MotionIntervals) -> bool:
        """Return whether living agents of both sides have a first or last node in common.

        Args:
            games: the games.
            game: the game.
            pieces: working memory; `first` is -1 for all nodes.
        """
        found = False
        count = 0
        for agent in range(games.agents):
            if self.plays[agent] & contacts.THEIRS:
                row = games.get_row(game, agent)
                if games.alive[row]:
                    pieces.order[count] = games.start[row]
                    pieces.order[count + 1] = games.node[row]
                    count += 2
        for place in range(count):
            pieces.first[pieces.order[place]] = 0
        for agent in range(games.agents):
            if self.plays[agent] & contacts.OURS:
                row = games.get_row(game, agent)
                if games.alive[row] and (pieces.first[games.start[row]] == 0 or pieces.first[games.node[row]] == 0):
                    found = True
                    break
        for place in range(count):
            pieces.first[pieces.order[place]] = -1
        return found

    def collect(self, tags: Tags, games: GameColumns, game: int, number: int) -> int:
        """Add the contacts of this tagging, numbered `number`, and of all later taggings of the chain."""
        if self.find(games, game) > 0:
            tags.add(self.contacts, number, self.mutual, self.ground, games.team)
        if not self.is_last:
            self.behind.collect(tags, games, game, number + 1)  # type: ignore[union-attr] # it is not the last
        return 0

    def score(self, number: int, games: GameColumns, game: int, tagger: int) -> int:
        """Add the points for a tag by tagging `number`, counted from this one, to the tagger's team."""
        if number > 0:
            return self.behind.score(number - 1, games, game, tagger)  # type: ignore[union-attr] # there is one
        games.score[game * games.teams + games.team[tagger]] += self.points
        return 0

    def follow_up(self, number: int, games: GameColumns, events: Events, game: int, other: int) -> bool:
        """Apply the effect of tagging `number`, counted from this one; return whether a function is to be called."""
        if number > 0:
            return self.behind.follow_up(number - 1, games, events, game, other)  # type: ignore[union-attr]
        if self.then == RESPAWN:
            respawn(games, events, game, other)
        elif self.then == ELIMINATE:
            eliminate(games, events, game, other)
        return self.then == FUNCTION

    def is_ending(self, number: int) -> bool:
        """Return whether a tag of tagging `number`, counted from this one, ends the game."""
        if number > 0:
            return self.behind.is_ending(number - 1)  # type: ignore[union-attr] # there is one
        return self.ends


# -- flags -------------------------------------------------------------------------------------------------------------


class Flags:
    """The flags of the games of a block, as in `gamms.rules.capture_flag`.

    Args:
        flags: the number of flags in a game.
        team: (flags,) the owner of each flag; -1: no agent is in its team.
        base: (flags,) the node of each flag.
        home: (teams,) the base of each team; -1: none, then its home is each node where one of its agents started.
        ground: the territory; each node that an agent owns is home, as an alternative to `home`. Empty: not used.
        takes: (agents,) the team of each agent; -1: it takes no flags, because it has no team or flies.
        names: (agents,) the keys of their names.
        purposes: (games * flags,) the keys of the draws that choose between agents at a base.
        carriers: (games * flags,) the agent that carries each flag; -1: the flag is on its base; `GONE`: the agent was
            deleted.
        stops: (games * flags,) `GameColumns.stops` of the carrier at the end of the last turn.
        captures: (games * teams,) the number of captures of each team.
        members: (agents,) the teams of agents on the ground, dead or alive; -1: it flies.
        taken: (flags,) working memory.
        goal: the number of captures that ends the game; 0: no limit.
        points: the points for a capture.
    """

    def __init__(
        self,
        flags: int,
        *,
        team: memoryview[int],
        base: memoryview[int],
        home: memoryview[int],
        ground: Territory,
        takes: memoryview[int],
        names: memoryview[int],
        purposes: memoryview[int],
        carriers: memoryview[int],
        stops: memoryview[int],
        captures: memoryview[int],
        members: memoryview[int],
        taken: memoryview[float],
        goal: int,
        points: float,
    ) -> None:
        self.flags = flags
        self.team = team
        self.base = base
        self.home = home
        self.ground = ground
        self.takes = takes
        self.names = names
        self.purposes = purposes
        self.carriers = carriers
        self.stops = stops
        self.captures = captures
        self.members = members
        self.taken = taken
        self.goal = goal
        self.points = points
        self.involved = 0

    def drop(self, games: GameColumns, events: Events, game: int, rule: int) -> int:
        """Drop the flags of carriers that are out or deleted, or were tagged or respawned since the last turn."""
        for flag in range(game * self.flags, (game + 1) * self.flags):
            agent = self.carriers[flag]
            if agent == NOBODY:
                continue
            number = flag - game * self.flags
            if agent == GONE or games.home[games.get_row(game, agent)] < 0:
                events.put(game, games.turn[game], rule, DROP, agent, number, self.base[number])
                self.carriers[flag] = -1
                continue
            row = games.get_row(game, agent)
            if not games.alive[row] or games.stops[row] != self.stops[flag]:
                events.put(game, games.turn[game], rule, DROP, agent, number, games.node[row])
                self.carriers[flag] = -1
        return 0

    def note_stops(self, games: GameColumns, game: int) -> int:
        """Store the stops of carriers, for `drop` in the next turn."""
        for flag in range(game * self.flags, (game + 1) * self.flags):
            if self.carriers[flag] >= 0:
                self.stops[flag] = games.stops[games.get_row(game, self.carriers[flag])]
        return 0

    def concern(self, games: GameColumns, game: int) -> bool:
        """Return whether a carrier may be home, or an agent that may take a flag is on its base.

        If neither is true, nothing can happen in games along one edge per turn, because only end nodes count.
        """
        for flag in range(self.flags):
            carrier = self.carriers[game * self.flags + flag]
            if carrier >= 0 and self._may_be_home(games, game, carrier):
                return True
        for agent in range(games.agents):
            node = games.node[games.get_row(game, agent)]
            for flag in range(self.flags):
                if node == self.base[flag] and self._may_take(agent, flag):
                    return True
        return False

    def _may_be_home(self, games: GameColumns, game: int, agent: int) -> bool:
        """Return whether an agent is on the base of its team, or its home is not a single base."""
        team = self.takes[agent]
        if team < 0 or not self.ground.is_empty or self.home[team] < 0:
            return True
        return games.node[games.get_row(game, agent)] == self.home[team]

    def _may_take(self, agent: int, flag: int) -> bool:
        """Return whether an agent may take a flag: it takes flags, and the flag is not its team's."""
        return self.takes[agent] >= 0 and self.takes[agent] != self.team[flag]

    def pass_turn(
        self,
        games: GameColumns,
        events: Events,
        game: int,
        rule: int,
        tracks: Tracks,
        legs: Legs,
        pieces: MotionIntervals,
    ) -> int:
        """Apply captures and takes of flags, in the order of time within the turn.

        Args:
            games: the block.
            events: receives the events.
            game: the game.
            rule: the number of the rule.
            tracks: the nodes that agents of this game pass; sides are 0 for agents that are eliminated or fly.
            legs: the edges that they cover.
            pieces: working memory.
        """
        contacts.put_visits(tracks, legs, pieces)
        self._find_involved(game, pieces)
        for flag in range(self.flags):
            self.taken[flag] = -1.0
        now = self._find_next_moment(pieces, -1.0)
        while now >= 0.0:
            for flag in range(self.flags):
                self._capture(games, events, game, rule, pieces, flag, now)
            for flag in range(self.flags):
                self._take(games, events, game, rule, pieces, flag, now)
            if self._end(games, events, game, rule):
                break
            now = self._find_next_moment(pieces, now)
        return 0

    def _find_involved(self, game: int, pieces: MotionIntervals) -> int:
        """List the visits of agents that visit a base or carry a flag, in their order."""
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

    def _find_next_moment(self, pieces: MotionIntervals, now: float) -> float:
        """Return the next time when a listed agent reaches a node; -1: none."""
        soonest = -1.0
        for place in range(self.involved):
            since = pieces.since[pieces.order[place]]
            if since > now and (soonest < 0.0 or since < soonest):
                soonest = since
        return soonest

    def _capture(
        self, games: GameColumns, events: Events, game: int, rule: int, pieces: MotionIntervals, flag: int, now: float
    ) -> int:
        """Capture a flag if its carrier reaches home at this time; an agent without a team has no home."""
        row = game * self.flags + flag
        agent = self.carriers[row]
        if agent < 0 or self.takes[agent] < 0 or now <= self.taken[flag]:
            return 0
        for place in range(self.involved):
            piece = pieces.order[place]
            if pieces.agents[piece] != agent or pieces.since[piece] != now:
                continue
            if self._is_home(games, game, agent, pieces.nodes[piece]):
                team = game * games.teams + self.takes[agent]
                events.put(game, games.turn[game], rule, CAPTURE, agent, flag, pieces.nodes[piece])
                games.score[team] += self.points
                self.captures[team] += 1
                self.carriers[row] = -1
                return 0
        return 0

    def _is_home(self, games: GameColumns, game: int, carrier: int, node: int) -> bool:
        """Return whether a node is home for an agent that takes flags."""
        team = self.takes[carrier]
        if not self.ground.is_empty:
            return self.ground.is_own(node, carrier, team)
        if self.home[team] >= 0:
            return self.home[team] == node
        found = False
        for agent in range(games.agents):
            found = found or (self.members[agent] == team and games.home[games.get_row(game, agent)] == node)
        return found

    def _take(
        self, games: GameColumns, events: Events, game: int, rule: int, pieces: MotionIntervals, flag: int, now: float
    ) -> int:
        """Give a flag on its base to one of the agents of other teams there; if there are several, by random draw."""
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
                or self._is_carrying(game, agent)
            ):
                continue
            first = draws.compute_first_key(self.purposes[row], self.names[agent])
            bits = draws.compute_bits(draws.compute_turn_key(first, games.turn[game]), 0)
            if taker < 0 or bits < least or (bits == least and agent < taker):
                taker = agent
                least = bits
        if taker >= 0:
            self.carriers[row] = taker
            self.taken[flag] = now
            events.put(game, games.turn[game], rule, TAKE, taker, flag, self.base[flag])
        return 0

    def _is_carrying(self, game: int, agent: int) -> bool:
        """Return whether an agent carries a flag."""
        found = False
        for flag in range(game * self.flags, (game + 1) * self.flags):
            found = found or self.carriers[flag] == agent
        return found

    def _end(self, games: GameColumns, events: Events, game: int, rule: int) -> bool:
        """End the game if a team has enough captures, as a draw if several teams do at the same time."""
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
    """A rule that is applied after the moves of a turn; rules form a chain.

    Args:
        games: the block.
        events: receives the events.
        number: the number of the rule, for events.

    Attributes:
        behind: the next rule; `is_last`: there is none. `link_rules` sets both.
    """

    def __init__(self, games: GameColumns, events: Events, number: int) -> None:
        self.games = games
        self.events = events
        self.number = number
        self.behind: Rule | None = None
        self.is_last = True

    def happen(self, game: int) -> int:  # noqa: ARG002 - subclasses need it
        """Apply the rule to a game."""
        return 0

    def happen_all(self, game: int) -> int:
        """Apply this rule and all later rules of the chain."""
        self.events.rule = self.number
        self.happen(game)
        if not self.is_last:
            self.behind.happen_all(game)  # type: ignore[union-attr] # it is not the last
        return 0


def link_rules(rules: list[Rule]) -> Rule:
    """Link rules into a chain; return the first one."""
    for rule, behind in pairwise(rules):
        rule.behind = behind
        rule.is_last = False
    return rules[0]


def play(rule: Rule, game: int) -> int:
    """Apply a chain of rules to one game."""
    return rule.happen_all(game)


def play_games(rule: Rule, games: memoryview[int]) -> int:
    """Apply a chain of rules to the games of these numbers."""
    for place in range(len(games)):
        rule.happen_all(games[place])
    return 0


class TagRule(Rule):
    """Agents tag the agents that they meet: all rules `gamms.rules.tag` of a game together.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`; tags of later taggings have the following numbers.
        first: the first tagging of the chain.
        tags: working memory.
        steps: the paths that all taggings search.
        purpose: (1,) the key of the draws that decide ties, read by all searches.
        turn: (1,) the turn, read by all searches.
        purposes: (games,) the keys of all games.
    """

    def __init__(
        self,
        games: GameColumns,
        events: Events,
        number: int,
        first: Tagging,
        tags: Tags,
        steps: AgentPaths,
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
        """Find all tags before any agent is moved, count them, then apply their effects."""
        if self.steps.are_one_edge and not self.first.may_meet(self.games, game):
            return 0
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
            self.events.times[self.events.count - 1] = self.tags.moments[tag]
            self.games.stops[self.games.get_row(game, other)] += 1
            self.first.score(by, self.games, game, tagger)
        for tag in range(number):
            tagger = self.tags.taggers[tag]
            other = self.tags.others[tag]
            by = self.tags.taggings[tag]
            if self.first.follow_up(by, self.games, self.events, game, other):
                self.events.put(game, self.turn[0], self.number + by, CALL, tagger, other, self.tags.nodes[tag])
        return self._end(game)

    def _end(self, game: int) -> int:
        """End the game if a tag does; the team wins whose agents alone have made such tags."""
        rule = NOBODY
        winner = NOBODY
        for tag in range(self.tags.number):
            by = self.tags.taggings[tag]
            if self.first.is_ending(by):
                team = self.games.team[self.tags.taggers[tag]]
                if rule == NOBODY:
                    rule = self.number + by
                    winner = team
                elif team != winner:
                    winner = NOBODY
        if rule == NOBODY:
            return 0
        return end_game(self.games, self.events, game, rule, winner)


class Visitors:
    """The agents of one game on the ground, and the nodes that they visit in a turn.

    Args:
        steps: the paths of one game.
        tracks: the nodes of these paths.
        legs: the edges of these paths.
        pieces: receives the visits.
        ground: (agents,) 1: the agent is on the ground; 0: it flies.
        sides: (agents,) the sides of the tracks.
    """

    def __init__(
        self,
        steps: AgentPaths,
        tracks: Tracks,
        legs: Legs,
        pieces: MotionIntervals,
        ground: memoryview[int],
        sides: memoryview[int],
    ) -> None:
        self.steps = steps
        self.tracks = tracks
        self.legs = legs
        self.pieces = pieces
        self.ground = ground
        self.sides = sides

    def follow(self, games: GameColumns, game: int) -> int:
        """Write the paths and sides of the agents of a game."""
        self.steps.fill(games, game)
        return fill_sides(games, game, self.ground, self.sides)


class FlagRule(Rule):
    """Agents take the flags of other teams and bring them home.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        flags: the flags of the games.
        visitors: the agents.
    """

    def __init__(self, games: GameColumns, events: Events, number: int, *, flags: Flags, visitors: Visitors) -> None:
        super().__init__(games, events, number)
        self.flags = flags
        self.visitors = visitors

    def happen(self, game: int) -> int:
        """Apply drops, captures and takes of flags by carriers."""
        self.flags.drop(self.games, self.events, game, self.number)
        if not self.visitors.steps.are_one_edge or self.flags.concern(self.games, game):
            self.visitors.follow(self.games, game)
            self.flags.pass_turn(
                self.games,
                self.events,
                game,
                self.number,
                self.visitors.tracks,
                self.visitors.legs,
                self.visitors.pieces,
            )
            self.flags.note_stops(self.games, game)
        return 0


class RespawnRule(Rule):
    """Eliminated agents respawn on their home nodes: `gamms.rules.respawn`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        plays: (agents,) 1: the agent respawns; 0: it does not.
        out: (games * agents,) the turn of its elimination; -1: it is alive.
        times: (games * agents,) the number of its respawns.
        wait: the number of turns that an agent misses.
        most: the maximum number of respawns; -1: no limit.
    """

    def __init__(
        self,
        games: GameColumns,
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
        """Respawn the agents that have waited long enough."""
        first = game * self.games.agents
        for agent in range(self.games.agents):
            row = self.games.get_row(game, agent)
            place = first + agent
            if self.games.alive[row] or self.games.home[row] < 0 or not self.plays[agent]:
                self.out[place] = -1
                continue
            if self.out[place] < 0:
                self.out[place] = self.games.turn[game]
            if self.out[place] + self.wait <= self.games.turn[game] and self.times[place] != self.most:
                self.times[place] += 1
                self.out[place] = -1
                respawn(self.games, self.events, game, agent)
        return 0


class TimeLimitRule(Rule):
    """The game ends after a number of turns: `gamms.rules.time_limit`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        last: the turn after which it ends.
        winner: see `end_game`.
    """

    def __init__(self, games: GameColumns, events: Events, number: int, *, last: int, winner: int) -> None:
        super().__init__(games, events, number)
        self.last = last
        self.winner = winner

    def happen(self, game: int) -> int:
        """End the game at the limit."""
        if self.games.turn[game] >= self.last:
            is_first = not self.games.over[game]
            end_game(self.games, self.events, game, self.number, self.winner)
            if is_first:
                self.games.over[game] = BY_TIME
        return 0


class NoneLeftRule(Rule):
    """The game ends when no agent of a team is alive: `gamms.rules.none_left`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        team: the team, which has agents; -1: the game goes on while none of `members` is in it.
        members: (agents,) 1: the agent counts.
        winner: see `end_game`.
    """

    def __init__(
        self, games: GameColumns, events: Events, number: int, *, team: int, members: memoryview[int], winner: int
    ) -> None:
        super().__init__(games, events, number)
        self.team = team
        self.members = members
        self.winner = winner

    def happen(self, game: int) -> int:
        """End the game if none of the members is alive."""
        has_come = self.team >= 0 and self.games.plays[game * self.games.teams + self.team] == 1
        for agent in range(self.games.agents):
            if self.members[agent]:
                row = self.games.get_row(game, agent)
                if self.games.alive[row]:
                    return 0
                if self.team < 0 and self.games.home[row] >= 0:
                    has_come = True
        if not has_come:
            return 0
        return end_game(self.games, self.events, game, self.number, self.winner)


class LastTeamRule(Rule):
    """The game ends when all living agents are of one team, which wins, or none is alive: `gamms.rules.last_team`.

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
            if team != self.games.nobody and self.games.alive[self.games.get_row(game, agent)]:
                if left >= 0 and team != left:
                    return 0
                left = team
        return end_game(self.games, self.events, game, self.number, left)


class ReachRule(Rule):
    """The game ends when an agent reaches a goal of its team: `gamms.rules.reach`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        visitors: the agents.
        goals: (nodes * teams,) 1: the node is a goal of the team; row `node * teams + team`.
        starters: (agents * teams,) 1: the start node of the agent is also a goal of the team. Empty: none.
        order: (teams with goals,) these teams, in the order of their agents in events.
        winner: the winning team; `NOBODY`; `ITS_TEAM`: the team that reached its goal.
        points: the points for each team that reached its goal.
    """

    def __init__(
        self,
        games: GameColumns,
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
        self.pieces: MotionIntervals = self.visitors.pieces
        self.goals = goals
        self.starters = starters
        self.order = order
        self.winner = winner
        self.points = points

    def happen(self, game: int) -> int:
        """End the game when the earliest agents reach their goals; teams that do so at the same time draw."""
        self._mark_starts(game, 1)
        self._reach(game)
        return self._mark_starts(game, 0)

    def _mark_starts(self, game: int, mark: int) -> int:
        """Set or clear the goal marks of start nodes."""
        for place in range(self.games.agents * self.games.teams if len(self.starters) > 0 else 0):
            home = self.games.home[self.games.get_row(game, place // self.games.teams)]
            if self.starters[place] and home >= 0:
                self.goals[home * self.games.teams + place % self.games.teams] = mark
        return 0

    def _reach(self, game: int) -> int:
        self.visitors.follow(self.games, game)
        contacts.put_visits(self.visitors.tracks, self.visitors.legs, self.pieces)
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
        """Return whether a visited node is a goal of a team."""
        return self.goals[self.pieces.nodes[piece] * self.games.teams + team] == 1


class ArriveRule(Rule):
    """Agents that reach a goal score points and leave the game: `gamms.rules.arrive`.

    Args:
        games: see `Rule`.
        events: see `Rule`.
        number: see `Rule`.
        visitors: the agents.
        team: the team.
        owners: (nodes,) the team, if the node is a goal; else -1.
        starters: (agents,) 1: the start node of the agent is also a goal. Empty: none.
        points: the points for each arrival.
    """

    def __init__(
        self,
        games: GameColumns,
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
        self.pieces: MotionIntervals = self.visitors.pieces
        self.team = team
        self.owners = owners
        self.points = points

    def happen(self, game: int) -> int:
        """Add an event for each agent at a goal, then eliminate these agents."""
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
        """Set the owner of start nodes."""
        for agent in range(self.games.agents if len(self.starters) > 0 else 0):
            home = self.games.home[self.games.get_row(game, agent)]
            if self.starters[agent] and home >= 0:
                self.owners[home] = mark
        return 0
