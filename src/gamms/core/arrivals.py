"""Turns by metres in which agents decide again on arrival at a node, and conflicts are resolved at each arrival.

First all agents set out: those on edges go on to the end that they move toward, the others decide. Then the agents
that arrive earliest decide, and so on until the turn is over. An agent that loses a conflict at a node stops just
before the node. If functions are called between, all games come to the end of a phase before the next begins.

A game that is played alone is the only row. Functions find the paths of its agents, which are taken as they are.
"""

from __future__ import annotations

from array import array
from typing import Any

from gamms.core import by_metres, moves, rules, travel
from gamms.core.by_metres import MetreMovers
from gamms.core.conflicts import resolve
from gamms.core.rules import GameColumns
from gamms.core.travel import TurnPaths

NOT_BEGUN = -1.0  # a time
DECIDES = 1
GOES_ON = 2
ARRIVE = 3  # phases of the moves of a turn: agents come to the next nodes,
CHOOSE = 4  # decide there,
GO_ON = 5  # resolve conflicts and set out
# names for callers in Python, which do not see constants with a C type
PHASES = (ARRIVE, CHOOSE, GO_ON)
UNBEGUN = NOT_BEGUN
ASKED = DECIDES


class Queue:
    """The agents under way in games, in priority queues by arrival time; ties go to the lower agent number.

    Attributes:
        agents: the number of agents in a game.
        times: (rows,) the arrival time of each agent.
        heap: (rows,) the agent numbers of each game, as a binary heap.
        sizes: (games,) the number of agents in each heap.
    """

    def __init__(self, agents: int, games: int = 1) -> None:
        self.agents = agents
        times: Any = memoryview(array("d", bytes(8 * agents * games)))
        self.times: memoryview[float] = times
        self.heap = memoryview(array("q", bytes(8 * agents * games)))
        self.sizes = memoryview(array("q", bytes(8 * games)))

    def is_before(self, first: int, one: int, other: int) -> bool:
        """Return whether an agent arrives before another one; `first` is the first row of their game."""
        if self.times[first + one] == self.times[first + other]:
            return one < other
        return self.times[first + one] < self.times[first + other]

    def push(self, game: int, agent: int, time: float) -> int:
        """Add an agent of a game with its arrival time."""
        first = game * self.agents
        self.times[first + agent] = time
        place = self.sizes[game]
        self.sizes[game] += 1
        while place > 0 and self.is_before(first, agent, self.heap[first + ((place - 1) >> 1)]):
            self.heap[first + place] = self.heap[first + ((place - 1) >> 1)]
            place = (place - 1) >> 1
        self.heap[first + place] = agent
        return 0

    def pop(self, game: int) -> int:
        """Remove the agent of a game that arrives first, and return it."""
        first = game * self.agents
        found = self.heap[first]
        self.sizes[game] -= 1
        size = self.sizes[game]
        agent = self.heap[first + size]
        place = 0
        child = 1
        while child < size:
            if child + 1 < size and self.is_before(first, self.heap[first + child + 1], self.heap[first + child]):
                child += 1
            if self.is_before(first, agent, self.heap[first + child]):
                child = size
            else:
                self.heap[first + place] = self.heap[first + child]
                place = child
                child = 2 * place + 1
        self.heap[first + place] = agent
        return found

    def count_agents(self, game: int) -> int:
        """Return the number of agents of a game that are under way."""
        return self.sizes[game]

    def find_first_time(self, game: int) -> float:
        """Return the earliest arrival time in a game; infinity if its queue is empty."""
        first = game * self.agents
        return self.times[first + self.heap[first]] if self.sizes[game] > 0 else travel.INFINITE


class Arrivals:
    """The state of turns by metres in which agents decide on arrival; rows are as in `rules.GameColumns`.

    Args:
        columns: (6 * rows + games,) 64-bit integers, working memory.
        chosen: see the attribute.

    Attributes:
        travelers: the agents.
        most: the number of arrivals that an agent may have in a turn; then it waits.
        has_end: whether arrivals at the end of the turn count, because there are conflicts.
        queue: the agents under way.
        now: (games,) the time of the last arrivals; `NOT_BEGUN`: the part of the turn has not begun; infinity: all its
            agents have arrived.
        comes: (rows,) `DECIDES`: the agent arrives now, or is at rest as the turn begins, and decides if the turn is
            not over; `GOES_ON`: it continues on its way as the turn begins; 0: it does neither.
        here: (rows,) the numbers of the agents that do either, game by game, ascending.
        counts: (games,) their number.
        late: (rows,) 1: the agent has decided to do deeds at an arrival.
        asked: (rows,) the number of arrivals of each agent in this turn.
        loses: (rows,) 1: the agent has lost a conflict and may not go on.
        legs, passed, nodes: (rows,) the number of legs, the number of nodes and the node of each agent at its last
            arrival; see `travel.TurnPaths`.
        last: receives the finished paths of all games, if functions are called on arrival (`keeps_last`): until the
            part of the turn is over, they see the last turn.
        chosen: the paths from here that functions have found in this game, if it is the only one (`has_chosen`).
    """

    def __init__(
        self,
        travelers: MetreMovers,
        most: int,
        queue: Queue,
        now: memoryview[float],
        comes: memoryview[int],
        late: memoryview[int],
        columns: memoryview[int],
        *,
        has_end: bool,
        chosen: TurnPaths | None = None,
    ) -> None:
        rows = len(comes)
        self.travelers = travelers
        self.most = most
        self.has_end = has_end
        self.queue = queue
        self.now = now
        self.comes = comes
        self.late = late
        self.asked = columns[:rows]
        self.loses = columns[rows : 2 * rows]
        self.legs = columns[2 * rows : 3 * rows]
        self.passed = columns[3 * rows : 4 * rows]
        self.nodes = columns[4 * rows : 5 * rows]
        self.here = columns[5 * rows : 6 * rows]
        self.counts = columns[6 * rows :]
        self.keep_last(None)
        self.chosen = chosen
        self.has_chosen = chosen is not None

    def keep_last(self, last: TurnPaths | None) -> None:
        """Keep the paths of the last turns in other trips until those of this turn are finished."""
        self.last = last
        self.keeps_last = last is not None

    def process_arrival(self, game: int, agent: int, why: int) -> int:
        """Let an agent decide or go on; `why` is as in `comes`."""
        first = game * self.queue.agents
        self.comes[first + agent] = why
        self.here[first + self.counts[game]] = agent
        self.counts[game] += 1
        return 0

    def leave(self, game: int) -> int:
        """Mark that no agent decides or continues in a game."""
        first = game * self.queue.agents
        for number in range(self.counts[game]):
            row = first + self.here[first + number]
            self.comes[row] = 0
            self.loses[row] = 0
        self.counts[game] = 0
        return 0


def play(games: GameColumns, a: Arrivals, game: int) -> int:
    """Play the moves of one turn of a game: agents decide, resolve conflicts and arrive until the turn is over."""
    set_out(games, a, a.travelers, game)
    while a.now[game] < travel.INFINITE:
        choose(games, a, a.travelers, game)
        go_on(games, a, a.travelers, game)
        arrive(games, a, a.travelers, game)
    return 0


def play_phase(games: GameColumns, a: Arrivals, t: MetreMovers, phase: int, game: int) -> int:
    """Play a phase of the moves of a turn: `ARRIVE`, `CHOOSE` or `GO_ON`.

    The phases repeat until `now` is infinite. When `ARRIVE` ends, agents are shown where they are at that time.
    """
    if a.now[game] == travel.INFINITE:
        return 0
    if a.now[game] < 0.0:
        set_out(games, a, t, game)
    elif phase == CHOOSE:
        choose(games, a, t, game)
    elif phase == GO_ON:
        go_on(games, a, t, game)
    else:
        arrive(games, a, t, game)
        if a.keeps_last:
            show(games, a, t, game)
    is_over = a.now[game] == travel.INFINITE
    for row in range(t.first, t.first + games.agents if is_over and a.keeps_last else t.first):
        travel.copy_trip(t.trips, row, a.last, row)  # type: ignore[arg-type] # there are some
    return 0


def show(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Write the positions of this part's agents at the time of arrivals to the columns of the games."""
    now = a.now[game]
    for i in range(games.agents):
        row = game * games.agents + i
        own = t.first + i
        leg = own * t.trips.most + t.trips.legs[own] - 1
        if now == travel.INFINITE or t.trips.legs[own] == 0 or t.part_of[i] != t.part[game]:
            continue
        source = t.trips.begins[leg]
        target = t.trips.ends[leg]
        share = travel.compute_share(source, target, t.trips.since[leg], t.trips.until[leg], now)
        games.node[row] = t.trips.node[own]
        games.edge[row] = -1
        games.share[row] = 0.0
        if 0.0 < share < 1.0:
            games.node[row] = t.roads.sources[t.trips.edges[leg]]
            games.edge[row] = t.trips.edges[leg]
            games.share[row] = share
            t.motion[row] = travel.get_motion(source, target)
    return 0


def put_back(games: GameColumns, t: MetreMovers, game: int) -> int:
    """Put the agents of this part of the turn back to where they set out; `move` writes where they arrive."""
    for i in range(games.agents):
        row = game * games.agents + i
        t.ends[row] = t.trips.node[t.first + i]
        if t.part_of[i] == t.part[game]:
            games.node[row] = games.start[row]
    return 0


def set_out(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Start a part of the turn: agents on their way continue, and others decide next."""
    a.now[game] = 0.0
    a.queue.sizes[game] = 0
    a.counts[game] = 0
    for i in range(games.agents):
        row = game * games.agents + i
        a.asked[row] = 0
        a.legs[row] = 0
        a.late[row] = 0
        a.comes[row] = 0
        t.roads.use(rules.find_first_place(games, game, i))
        if by_metres.is_there(games, t, game, i):
            if a.keeps_last:
                travel.copy_trip(a.last, row, t.trips, row)  # type: ignore[arg-type] # there are some
            t.end_places[row] = t.start_places[row]
        else:
            begin(games, a, t, game, i)
        if games.edge[row] >= 0 and t.part_of[i] != t.part[game]:  # also on an edge that is closed
            t.start_places[row] = t.nodes + games.edge[row]
            t.end_places[row] = t.start_places[row]
    return 0


def begin(games: GameColumns, a: Arrivals, t: MetreMovers, game: int, i: int) -> int:
    """Start the turn of an agent: it continues on its way, decides next, or waits for its part of the turn."""
    row = game * games.agents + i
    own = t.first + i
    edge = t.trips.edge[own]
    if games.alive[row] and t.part_of[i] == t.part[game]:
        a.process_arrival(game, i, DECIDES)
        if edge >= 0 and travel.is_going(t.roads, edge, t.trips.motion[own]):
            a.comes[row] = GOES_ON
            travel.go(t.roads, t.trips, own, t.trips.motion[own], 0)
    if a.comes[row] != DECIDES:
        by_metres.stop_on_edge(t, own)
    t.end_places[row] = find_place_after(t, row, own, 0)
    return 0


def choose(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Let the agents that have arrived decide, unless the turn is over."""
    for number in range(a.counts[game]):
        i = a.here[game * games.agents + number]
        row = game * games.agents + i
        t.roads.use(rules.find_first_place(games, game, i))
        if a.comes[row] == DECIDES:
            if a.now[game] < 1.0:
                decide(games, a, t, game, i)
                by_metres.stop_on_edge(t, t.first + i)
            t.end_places[row] = find_place_after(t, row, t.first + i, a.legs[row])
    return 0


def decide(games: GameColumns, a: Arrivals, t: MetreMovers, game: int, i: int) -> int:
    """Let an agent decide and set out, or take the path that a function has chosen for it."""
    own = t.first + i
    if not a.has_chosen:
        t.trips.now[own] = a.now[game]
        t.trips.speed[own] = t.speeds[i]
        t.trips.left[own] = 1
        t.trips.pace[own] = -1.0
        return by_metres.choose(games, t, game, i)
    if a.chosen.legs[own] > 0:  # type: ignore[union-attr] # there are some
        travel.add_trip(a.chosen, own, t.trips, own, 1)  # type: ignore[arg-type]
    return 0


def find_place_after(t: MetreMovers, row: int, own: int, legs: int) -> int:
    """Return the place, as in `conflicts`, where an agent is after setting out.

    Args:
        t: the agents.
        row: the row of the agent,
        own: and the row of its path.
        legs: the number of legs that it had before.
    """
    leg = own * t.trips.most + t.trips.legs[own] - 1
    if t.trips.legs[own] == legs:
        return t.trips.node[own]
    return t.start_places[row] if t.trips.begins[leg] == t.trips.ends[leg] else t.nodes + t.trips.edges[leg]


def give_way(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Resolve conflicts: mark the losers in `loses`, count them, and make the ends of all moves the new starts.

    Agents that functions have held lose, too.
    """
    has_losers = False
    if t.has_conflicts:
        has_losers = resolve(t.contests, t.requests, game, games.turn[game]) > 0  # type: ignore[arg-type]
    for number in range(a.counts[game]):
        i = a.here[game * games.agents + number]
        row = game * games.agents + i
        loses = t.held[row] or (has_losers and t.contests.stays[i])  # type: ignore[union-attr]
        a.loses[row] = 0
        t.held[row] = 0
        if loses and t.start_places[row] != t.end_places[row]:
            a.loses[row] = 1
            moves.block_agent(t, row, t.end_places[row])
            t.end_places[row] = t.start_places[row]
        t.start_places[row] = t.end_places[row]
    return 0


def depart(a: Arrivals, t: MetreMovers, game: int, i: int) -> int:
    """Add an agent to the queue with the time at which its last leg reaches a node."""
    own = t.first + i
    until = t.trips.until[own * t.trips.most + t.trips.legs[own] - 1]
    if t.trips.edge[own] < 0 and (until < 1.0 or a.has_end):
        a.queue.push(game, i, until)
    return 0


def go_on(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Continue the agents that have decided, unless they lose conflicts or have arrived too often."""
    give_way(games, a, t, game)
    for number in range(a.counts[game]):
        i = a.here[game * games.agents + number]
        row = game * games.agents + i
        own = t.first + i
        t.roads.use(rules.find_first_place(games, game, i))
        if a.asked[row] == 0:
            if a.loses[row]:
                t.stay(games, game, i)
            if t.trips.legs[own] > 0:
                depart(a, t, game, i)
        elif a.loses[row]:
            return_agent(a, t, row, own)
            hold(games, t, row, own)
        elif a.asked[row] >= a.most:
            return_agent(a, t, row, own)
            t.events.put(game, games.turn[game], rules.NOBODY, rules.WAITS, i, -1, t.trips.node[own])
        else:
            if a.late[row]:
                t.events.put(game, games.turn[game], rules.NOBODY, rules.LATE_DEED, i, -1, t.trips.node[own])
            if t.trips.legs[own] > a.legs[row]:
                depart(a, t, game, i)
        a.late[row] = 0
    return 0


def arrive(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Move the agents that arrive next to their nodes; after the last arrivals, end the moves."""
    now = a.queue.find_first_time(game)
    a.now[game] = now
    a.leave(game)
    if now == travel.INFINITE:
        return put_back(games, t, game)
    while a.queue.find_first_time(game) == now:
        i = a.queue.pop(game)
        row = game * games.agents + i
        own = t.first + i
        a.process_arrival(game, i, DECIDES)
        a.asked[row] += 1
        a.legs[row] = t.trips.legs[own]
        a.passed[row] = t.trips.passed[own]
        a.nodes[row] = t.trips.node[own]
        games.node[row] = t.trips.node[own]
    return 0


def return_agent(a: Arrivals, t: MetreMovers, row: int, own: int) -> int:
    """Return an agent to the node of its last arrival."""
    t.trips.legs[own] = a.legs[row]
    t.trips.passed[own] = a.passed[row]
    t.trips.node[own] = a.nodes[row]
    t.trips.edge[own] = -1
    t.trips.share[own] = 0.0
    return 0


def hold(games: GameColumns, t: MetreMovers, row: int, own: int) -> int:
    """Stop an agent just before the node where it arrives."""
    travel.stop_short(t.roads, t.trips, own)
    games.node[row] = t.trips.node[own]
    return 0
