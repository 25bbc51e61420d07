"""Turns by metres in which agents decide again on arrival at a node, and conflicts are resolved at each arrival.

First all agents set out: those on edges go on to the end that they move toward, the others decide. Then the agents
that arrive earliest decide, and so on until the turn is over. An agent that loses a conflict at a node stops just
before the node.
"""

from __future__ import annotations

from array import array
from typing import Any

from gamms.core import by_metres, moves, rules, travel
from gamms.core.by_metres import MetreMovers
from gamms.core.conflicts import resolve
from gamms.core.rules import GameColumns

SHORT = 1e-9  # the share of an edge between a node and an agent that may not enter it


def short_of(end: float) -> float:
    """Return the share of an edge just before an end of it."""
    return 1.0 - SHORT if end == 1.0 else SHORT


class Queue:
    """A priority queue of the agents under way, by arrival time; ties go to the lower agent number.

    Attributes:
        times: (agents,) the arrival time of each agent.
        heap: (agents,) a binary heap of agent numbers.
        size: the number of agents in the heap.
    """

    def __init__(self, agents: int) -> None:
        times: Any = memoryview(array("d", bytes(8 * agents)))
        self.times: memoryview[float] = times
        self.heap = memoryview(array("q", bytes(8 * agents)))
        self.size = 0

    def is_before(self, one: int, other: int) -> bool:
        """Return whether an agent arrives before another one."""
        if self.times[one] == self.times[other]:
            return one < other
        return self.times[one] < self.times[other]

    def push(self, agent: int, time: float) -> int:
        """Add an agent with its arrival time."""
        self.times[agent] = time
        place = self.size
        self.size += 1
        while place > 0 and self.is_before(agent, self.heap[(place - 1) >> 1]):
            self.heap[place] = self.heap[(place - 1) >> 1]
            place = (place - 1) >> 1
        self.heap[place] = agent
        return 0

    def pop(self) -> int:
        """Remove the agent that arrives first, and return it."""
        first = self.heap[0]
        self.size -= 1
        agent = self.heap[self.size]
        place = 0
        child = 1
        while child < self.size:
            if child + 1 < self.size and self.is_before(self.heap[child + 1], self.heap[child]):
                child += 1
            if self.is_before(agent, self.heap[child]):
                child = self.size
            else:
                self.heap[place] = self.heap[child]
                place = child
                child = 2 * place + 1
        self.heap[place] = agent
        return first

    def first_time(self) -> float:
        """Return the earliest arrival time; infinity if the queue is empty."""
        return self.times[self.heap[0]] if self.size > 0 else travel.INFINITE


class Arrivals:
    """The state of a turn by metres in which agents decide on arrival.

    Attributes:
        travelers: the agents.
        most: the number of arrivals that an agent may have in a turn; then it waits.
        queue: the agents under way.
        here: (agents,) the agents that arrive at the current time.
        asked: (agents,) the number of arrivals of each agent in this turn.
        loses: (agents,) 1: the agent has lost a conflict and may not go on.
        legs, passed, nodes: (agents,) the number of legs, the number of nodes and the node of each agent at its last
            arrival; see `travel.TurnPaths`.
    """

    def __init__(self, travelers: MetreMovers, agents: int, most: int) -> None:
        self.travelers = travelers
        self.most = most
        self.queue = Queue(agents)
        self.here = memoryview(array("q", bytes(8 * agents)))
        self.asked = memoryview(array("q", bytes(8 * agents)))
        self.loses = memoryview(array("q", bytes(8 * agents)))
        self.legs = memoryview(array("q", bytes(8 * agents)))
        self.passed = memoryview(array("q", bytes(8 * agents)))
        self.nodes = memoryview(array("q", bytes(8 * agents)))


def play(games: GameColumns, a: Arrivals, game: int) -> int:
    """Play the moves of one turn of a game: agents decide, resolve conflicts and arrive until the turn is over."""
    set_out(games, a, a.travelers, game)
    while a.queue.size > 0:
        now = a.queue.first_time()
        count = 0
        while a.queue.first_time() == now:
            a.here[count] = a.queue.pop()
            count += 1
        arrive(games, a, a.travelers, game, now, count)
    return put_back(games, a.travelers, game)


def put_back(games: GameColumns, t: MetreMovers, game: int) -> int:
    """Put the agents of this part of the turn back to where they set out; `move` writes where they arrive."""
    for i in range(games.agents):
        row = game * games.agents + i
        t.movers.ends[row] = t.trips.node[i]
        if t.movers.part_of[i] == t.movers.part[game]:
            games.node[row] = games.start[row]
    return 0


def set_out(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Start a part of the turn: agents on their way continue, others decide, and first conflicts are resolved."""
    for i in range(games.agents):
        row = game * games.agents + i
        a.asked[i] = 0
        if by_metres.is_there(games, t, game, i):
            t.ends[row] = t.starts[row]
        else:
            begin(games, t, game, i)
    give_way(games, a, t, game)
    for i in range(games.agents):
        row = game * games.agents + i
        if a.loses[i]:
            by_metres.stay(games, t, row, i)
        if games.alive[row] and t.trips.legs[i] > 0 and t.movers.part_of[i] == t.movers.part[game]:
            depart(a, t, i)
    return 0


def begin(games: GameColumns, t: MetreMovers, game: int, i: int) -> int:
    """Start the turn of an agent: it continues on its way, decides, or waits for its part of the turn."""
    row = game * games.agents + i
    edge = t.trips.edge[i]
    if games.alive[row] and t.movers.part_of[i] == t.movers.part[game]:
        if edge >= 0 and travel.is_going(t.roads, edge, t.trips.motion[i]):
            travel.go(t.roads, t.trips, i, t.trips.motion[i], 0)
        else:
            by_metres.choose(games, t, game, i)
    by_metres.rest(t, i)
    t.ends[row] = place_after(t, row, i, 0)
    return 0


def place_after(t: MetreMovers, row: int, i: int, legs: int) -> int:
    """Return the place, as in `conflicts`, where an agent is after setting out; it had `legs` legs before."""
    leg = i * t.trips.most + t.trips.legs[i] - 1
    if t.trips.legs[i] == legs:
        return t.trips.node[i]
    return t.starts[row] if t.trips.begins[leg] == t.trips.ends[leg] else t.nodes + t.trips.edges[leg]


def give_way(games: GameColumns, a: Arrivals, t: MetreMovers, game: int) -> int:
    """Resolve conflicts: mark the losers in `loses`, count them, and make the ends of all moves the new starts."""
    has_losers = False
    if t.movers.has_conflicts:
        has_losers = resolve(t.movers.contests, t.movers.requests, game, games.turn[game]) > 0  # type: ignore[arg-type]
    for i in range(games.agents):
        row = game * games.agents + i
        a.loses[i] = 0
        if has_losers and t.movers.contests.stays[i] and t.starts[row] != t.ends[row]:  # type: ignore[union-attr]
            a.loses[i] = 1
            moves.block(t.movers, row, t.ends[row])
            t.ends[row] = t.starts[row]
        t.starts[row] = t.ends[row]
    return 0


def depart(a: Arrivals, t: MetreMovers, i: int) -> int:
    """Add an agent to the queue with the time at which its last leg reaches a node."""
    until = t.trips.until[i * t.trips.most + t.trips.legs[i] - 1]
    if t.trips.edge[i] < 0 and (until < 1.0 or t.movers.has_conflicts):
        a.queue.push(i, until)
    return 0


def arrive(games: GameColumns, a: Arrivals, t: MetreMovers, game: int, now: float, count: int) -> int:
    """Move `count` agents to the nodes where they arrive at a time; if the turn is not over, they decide and go on."""
    for number in range(count):
        i = a.here[number]
        row = game * games.agents + i
        a.asked[i] += 1
        a.legs[i] = t.trips.legs[i]
        a.passed[i] = t.trips.passed[i]
        a.nodes[i] = t.trips.node[i]
        games.node[row] = t.trips.node[i]
        if now < 1.0:
            t.trips.left[i] = 1
            t.trips.pace[i] = -1.0
            by_metres.choose(games, t, game, i)
        t.ends[row] = place_after(t, row, i, a.legs[i])
    give_way(games, a, t, game)
    for number in range(count):
        i = a.here[number]
        if a.loses[i]:
            come_back(a, t, i)
            hold(games, t, game, i)
        elif a.asked[i] >= a.most:
            come_back(a, t, i)
            t.events.put(game, games.turn[game], rules.NOBODY, rules.ILLEGAL, i, -1, t.trips.node[i])
        elif t.trips.legs[i] > a.legs[i]:
            depart(a, t, i)
    return 0


def come_back(a: Arrivals, t: MetreMovers, i: int) -> int:
    """Return an agent to the node of its last arrival."""
    t.trips.legs[i] = a.legs[i]
    t.trips.passed[i] = a.passed[i]
    t.trips.node[i] = a.nodes[i]
    t.trips.edge[i] = -1
    t.trips.share[i] = 0.0
    return 0


def hold(games: GameColumns, t: MetreMovers, game: int, i: int) -> int:
    """Stop an agent just before the node where it arrives."""
    leg = i * t.trips.most + t.trips.legs[i] - 1
    edge = t.trips.edges[leg]
    if t.trips.ends[leg] == 1.0:
        t.trips.passed[i] -= 1
    t.trips.ends[leg] = short_of(t.trips.ends[leg])
    t.trips.node[i] = t.roads.sources[edge]
    t.trips.edge[i] = edge
    t.trips.share[i] = t.trips.ends[leg]
    t.trips.motion[i] = travel.STOPPED
    t.trips.now[i] = t.trips.until[leg]
    travel.stand(t.trips, i)
    games.node[game * games.agents + i] = t.trips.node[i]
    return 0
