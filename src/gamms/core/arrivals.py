"""Turns by metres in which agents decide where they arrive: who arrives when, and who may enter what is there.

All agents set out, those on edges to the ends that they head for. Then those that arrive first decide, and so on until
the turn is over. An agent that loses a conflict where it arrives stands just before the node.
"""

from __future__ import annotations

from array import array
from typing import Any

from gamms.core import by_metres, rules, travel
from gamms.core.by_metres import Travelers
from gamms.core.conflicts import resolve
from gamms.core.rules import Games

SHORT = 1e-9  # of an edge: so far before a node stands who may not enter it


def short_of(end: float) -> float:
    """Return the share of an edge just before an end of it."""
    return 1.0 - SHORT if end == 1.0 else SHORT


class Queue:
    """The agents that are under way, the first to arrive first; of those that arrive at once, the first by number.

    Attributes:
        times: (agents,) when each arrives.
        heap: the agents.
        size: how many there are.
    """

    def __init__(self, agents: int) -> None:
        times: Any = memoryview(array("d", bytes(8 * agents)))
        self.times: memoryview[float] = times
        self.heap = memoryview(array("q", bytes(8 * agents)))
        self.size = 0

    def is_before(self, one: int, other: int) -> bool:
        """Whether an agent comes before another."""
        if self.times[one] == self.times[other]:
            return one < other
        return self.times[one] < self.times[other]

    def push(self, agent: int, time: float) -> int:
        """Add an agent that arrives at a time."""
        self.times[agent] = time
        place = self.size
        self.size += 1
        while place > 0 and self.is_before(agent, self.heap[(place - 1) >> 1]):
            self.heap[place] = self.heap[(place - 1) >> 1]
            place = (place - 1) >> 1
        self.heap[place] = agent
        return 0

    def pop(self) -> int:
        """Take the first agent out, and return it."""
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
        """Return when the first agent arrives; infinite: none is under way."""
        return self.times[self.heap[0]] if self.size > 0 else travel.INFINITE


class Arrivals:
    """The agents of a game as they arrive.

    Attributes:
        travelers: as they go.
        most: how often each may arrive in a turn; it waits then.
        queue: those under way.
        here: (agents,) those that arrive now.
        asked: (agents,) how often each has arrived in the turn.
        loses: (agents,) 1: it may not go on, by the conflicts.
        legs, passed, nodes: (agents,) what each had covered when it arrived, and where it did: see `travel.Trips`.
    """

    def __init__(self, travelers: Travelers, agents: int, most: int) -> None:
        self.travelers = travelers
        self.most = most
        self.queue = Queue(agents)
        self.here = memoryview(array("q", bytes(8 * agents)))
        self.asked = memoryview(array("q", bytes(8 * agents)))
        self.loses = memoryview(array("q", bytes(8 * agents)))
        self.legs = memoryview(array("q", bytes(8 * agents)))
        self.passed = memoryview(array("q", bytes(8 * agents)))
        self.nodes = memoryview(array("q", bytes(8 * agents)))


def play(games: Games, a: Arrivals, game: int) -> int:
    """Let the agents of a game decide and give way to each other until the turn is over."""
    set_out(games, a, a.travelers, game)
    while a.queue.size > 0:
        now = a.queue.first_time()
        count = 0
        while a.queue.first_time() == now:
            a.here[count] = a.queue.pop()
            count += 1
        arrive(games, a, a.travelers, game, now, count)
    return 0


def set_out(games: Games, a: Arrivals, t: Travelers, game: int) -> int:
    """Let all agents of this part of the turn set out: those on their way go on, the others decide."""
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


def begin(games: Games, t: Travelers, game: int, i: int) -> int:
    """Let an agent go on, or decide, or wait for its part of the turn."""
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


def place_after(t: Travelers, row: int, i: int, legs: int) -> int:
    """Return where an agent is when it has set out, as conflicts compare it; it has had so many legs before."""
    leg = i * t.trips.most + t.trips.legs[i] - 1
    if t.trips.legs[i] == legs:
        return t.trips.node[i]
    return t.starts[row] if t.trips.begins[leg] == t.trips.ends[leg] else t.nodes + t.trips.edges[leg]


def give_way(games: Games, a: Arrivals, t: Travelers, game: int) -> int:
    """Find the agents that may not go where they want to, count them, and let all be where they are then."""
    has_losers = False
    if t.movers.has_conflicts:
        has_losers = resolve(t.movers.contests, t.movers.requests, game, games.turn[game]) > 0  # type: ignore[arg-type]
    for i in range(games.agents):
        row = game * games.agents + i
        a.loses[i] = 0
        if has_losers and t.movers.contests.stays[i] and t.starts[row] != t.ends[row]:  # type: ignore[union-attr]
            a.loses[i] = 1
            t.movers.wanted[row] = t.ends[row]
            t.movers.blocked[row] = 1
            t.movers.blocks[row] += 1
            t.ends[row] = t.starts[row]
        t.starts[row] = t.ends[row]
    return 0


def depart(a: Arrivals, t: Travelers, i: int) -> int:
    """Let an agent be under way to where its last leg leads."""
    until = t.trips.until[i * t.trips.most + t.trips.legs[i] - 1]
    if t.trips.edge[i] < 0 and (until < 1.0 or t.movers.has_conflicts):
        a.queue.push(i, until)
    return 0


def arrive(games: Games, a: Arrivals, t: Travelers, game: int, now: float, count: int) -> int:
    """Let the agents that arrive now decide, unless the turn is over, and go on."""
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


def come_back(a: Arrivals, t: Travelers, i: int) -> int:
    """Put an agent back to where it has arrived."""
    t.trips.legs[i] = a.legs[i]
    t.trips.passed[i] = a.passed[i]
    t.trips.node[i] = a.nodes[i]
    t.trips.edge[i] = -1
    t.trips.share[i] = 0.0
    return 0


def hold(games: Games, t: Travelers, game: int, i: int) -> int:
    """Let an agent stand just before the node where it has arrived."""
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
