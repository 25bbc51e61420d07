"""Messages of a turn: which agents hear the messages of a channel, when, and which do not.

Messages spread after all agents have moved. First the sender of a message transmits it. On a channel with relays, the
agents that hear it and may relay transmit it next, until no agent hears it for the first time. Columns have a row for
each agent of each game: the row of agent `i` is `game * agents + i`.

The reach of a channel may depend on the number of edges between agents, or on line of sight. Then each transmitter
needs a row of `ChannelNetwork.reach`, which the caller computes: `spread_all` lists the transmitters that have no row,
and is called again when they have one.
"""

from __future__ import annotations

from math import sqrt

from gamms.core import draws

IS_HEARD = 1
IS_OVERHEARD = 2
IS_LOST = 3
IS_JAMMED = 4
MAY_USE = 1
MAY_OVERHEAR = 2
MAY_RELAY = 4
IS_MEANT = 1  # equal to `MAY_USE`
CAN_HEAR = 2
IN_REACH = 4
NO_ROW = -1
AWAITED = -2
ADMITS = -1
IS_FOR_OTHERS = -2
IS_FOR_SENDER = -3
IS_UNKNOWN = -4
# names for callers in Python, which do not see constants with a C type
HEARD = IS_HEARD
OVERHEARD = IS_OVERHEARD
LOST = IS_LOST
JAMMED = IS_JAMMED
USES = MAY_USE
OVERHEARS = MAY_OVERHEAR
RELAYS = MAY_RELAY
ADMITTED = ADMITS
FOR_OTHERS = IS_FOR_OTHERS
FOR_SENDER = IS_FOR_SENDER
UNKNOWN = IS_UNKNOWN


class Channel:
    """The properties of one channel.

    Attributes:
        agents: the number of agents of a game.
        range_m: the range of a transmission, metres; infinite if there is no limit.
        needs_rows: whether `ChannelNetwork.reach` has the agents that a transmitter reaches.
        is_relayed: whether some agents relay messages.
        delay: the turns that a transmission takes.
        roles: (agents,) sums of `USES`, `OVERHEARS` and `RELAYS`.
        distances: (points,) ascending, metres.
        chances: (points,) the probability that a transmission over these distances is lost; no points: none is lost.
        jammers: (jammers,) the agents that jam; -1: a fixed place.
        places: (jammers * 3,) x, y and z of jammers at fixed places, metres.
        radii: (jammers,) the radius within which nothing is heard, metres.
    """

    def __init__(
        self,
        agents: int,
        range_m: float,
        delay: int,
        roles: memoryview[int],
        distances: memoryview[float],
        chances: memoryview[float],
        jammers: memoryview[int],
        places: memoryview[float],
        radii: memoryview[float],
        *,
        needs_rows: bool,
        is_relayed: bool,
    ) -> None:
        self.agents = agents
        self.range_m = range_m
        self.delay = delay
        self.roles = roles
        self.distances = distances
        self.chances = chances
        self.jammers = jammers
        self.places = places
        self.radii = radii
        self.needs_rows = needs_rows
        self.is_relayed = is_relayed


class ChannelNetwork:
    """The places of the agents of games, and the agents that they reach by a channel.

    Attributes:
        xyz: (rows * 3,) the places of agents, metres.
        alive: (rows,) 1: the agent is alive.
        names: (agents,) hashes of names, for draws.
        purposes: (rows,) of senders, hashes of the seed of the game, the channel and the agent; empty where no message
            can be lost.
        turns: (games,) the number of turns played before this one.
        slots: (rows,) the slot of a transmitter in `reach`; -1: it has none; -2: the caller has to compute it.
        awaited: (rows,) the rows of the transmitters that the caller has to compute.
        reach: (slots * agents,) 1: the transmitter reaches the agent.
        rows: (3 * agents,) working memory.
        jammed, states: (agents,) working memory.
    """

    def __init__(
        self,
        xyz: memoryview[float],
        alive: memoryview[int],
        names: memoryview[int],
        purposes: memoryview[int],
        turns: memoryview[int],
        slots: memoryview[int],
        awaited: memoryview[int],
        reach: memoryview[int],
        rows: memoryview[int],
        jammed: memoryview[int],
        states: memoryview[int],
    ) -> None:
        self.xyz = xyz
        self.alive = alive
        self.names = names
        self.purposes = purposes
        self.turns = turns
        self.slots = slots
        self.awaited = awaited
        self.reach = reach
        self.waves = rows[: len(jammed)]
        self.now = rows[len(jammed) : 2 * len(jammed)]
        self.next = rows[2 * len(jammed) :]
        self.jammed = jammed
        self.states = states


class Messages:
    """Messages of one turn by one channel, and their outcomes.

    Attributes:
        games: (messages,) ascending.
        senders: (messages,) the agents that send them.
        groups: (messages,) the group of recipients of each message; -1: everybody.
        first: (groups + 1,) the members of group `i` are entries `first[i]` to `first[i + 1] - 1` of `members`.
        members: the agents of all groups.
        numbers: (messages,) the number of messages that the sender sent before in this turn.
        is_known: (messages,) 1: the outcome is known.
        outcomes: (messages * agents,) `HEARD`, `OVERHEARD`, `LOST`, `JAMMED`, or 0.
        arrivals: (messages * agents,) the turn, from 1, in which the agent hears the message; 0: it does not.
    """

    def __init__(
        self,
        games: memoryview[int],
        senders: memoryview[int],
        groups: memoryview[int],
        first: memoryview[int],
        members: memoryview[int],
        numbers: memoryview[int],
        is_known: memoryview[int],
        outcomes: memoryview[int],
        arrivals: memoryview[int],
    ) -> None:
        self.games = games
        self.senders = senders
        self.groups = groups
        self.first = first
        self.members = members
        self.numbers = numbers
        self.is_known = is_known
        self.outcomes = outcomes
        self.arrivals = arrivals


def compute_distance(places: memoryview[float], k: int, others: memoryview[float], other: int) -> float:
    """Return the distance in metres between place `k` of one column of x, y, z and place `other` of another."""
    x = places[3 * k] - others[3 * other]
    y = places[3 * k + 1] - others[3 * other + 1]
    z = places[3 * k + 2] - others[3 * other + 2]
    return sqrt((x * x + y * y) + z * z)


def compute_loss_chance(channel: Channel, far: float) -> float:
    """Return the probability that a transmission over a distance is lost, by linear interpolation between points."""
    k = 0
    while k < len(channel.distances) and channel.distances[k] < far:
        k += 1
    if k == len(channel.distances):
        return channel.chances[k - 1]
    if k == 0 or channel.distances[k] == far:
        return channel.chances[k]
    slope = (channel.chances[k] - channel.chances[k - 1]) / (channel.distances[k] - channel.distances[k - 1])
    return slope * (far - channel.distances[k - 1]) + channel.chances[k - 1]


def jam(channel: Channel, network: ChannelNetwork, game: int) -> int:
    """Find the agents of a game that a jammer silences."""
    base = game * channel.agents
    for i in range(channel.agents):
        network.jammed[i] = 0
    for k in range(len(channel.jammers)):
        jammer = base + channel.jammers[k]
        for i in range(channel.agents):
            if channel.jammers[k] < 0:
                far = compute_distance(network.xyz, base + i, channel.places, k)
            elif network.alive[jammer]:
                far = compute_distance(network.xyz, base + i, network.xyz, jammer)
            else:
                break
            if far <= channel.radii[k]:
                network.jammed[i] = 1
    return 0


def is_in_range(channel: Channel, network: ChannelNetwork, row: int, other: int) -> bool:
    """Return whether another agent lives and is within the range of a transmitter."""
    if row == other or not network.alive[other]:
        return False
    return compute_distance(network.xyz, other, network.xyz, row) <= channel.range_m


def find_in_range(channel: Channel, network: ChannelNetwork, count: int, reach: memoryview[int]) -> int:
    """Write which agents are within range of the first `count` awaited transmitters, (count * agents,)."""
    for k in range(count):
        row = network.awaited[k]
        base = row - row % channel.agents
        for i in range(channel.agents):
            reach[k * channel.agents + i] = is_in_range(channel, network, row, base + i)
    return 0


def is_lost(channel: Channel, network: ChannelNetwork, sent: Messages, m: int, by: int, to: int) -> bool:
    """Return whether a message between two agents is lost at random."""
    if not len(channel.distances):
        return False
    base = sent.games[m] * channel.agents
    name = network.names[to]
    if channel.is_relayed:
        name = draws.compute_bits(draws.compute_turn_key(draws.compute_first_key(network.names[by], name), 0), 0)
    first = draws.compute_first_key(network.purposes[base + sent.senders[m]], name)
    bits = draws.compute_bits(draws.compute_turn_key(first, network.turns[sent.games[m]]), sent.numbers[m])
    return draws.convert_to_fraction(bits) < compute_loss_chance(
        channel, compute_distance(network.xyz, base + to, network.xyz, base + by)
    )


def prepare(channel: Channel, network: ChannelNetwork, sent: Messages, m: int) -> int:
    """Find the recipients of a message, and the agents that can hear it."""
    base = sent.games[m] * channel.agents
    for i in range(channel.agents):
        network.waves[i] = 0
        network.states[i] = channel.roles[i] & MAY_USE if sent.groups[m] < 0 else 0
    for k in range(sent.first[max(sent.groups[m], 0)], sent.first[sent.groups[m] + 1]):  # nothing for everybody
        network.states[sent.members[k]] = channel.roles[sent.members[k]] & MAY_USE
    for i in range(channel.agents):
        if i == sent.senders[m] or not network.alive[base + i]:
            network.states[i] = 0
        elif not network.jammed[i] and (channel.is_relayed or network.states[i] or channel.roles[i] & MAY_OVERHEAR):
            network.states[i] |= CAN_HEAR
    return 0


def transmit(channel: Channel, network: ChannelNetwork, sent: Messages, m: int, wave: int, transmitters: int) -> int:
    """Transmit a message from agents; return the number of agents that transmit it next."""
    base = sent.games[m] * channel.agents
    found = 0
    for k in range(transmitters):
        by = network.now[k]
        at = network.slots[base + by] * channel.agents
        for i in range(channel.agents):
            if channel.needs_rows:
                reaches = network.reach[at + i]
            else:
                reaches = is_in_range(channel, network, base + by, base + i)
            if not reaches:
                continue
            network.states[i] |= IN_REACH
            can_hear = network.states[i] & CAN_HEAR and not network.waves[i]
            if can_hear and not is_lost(channel, network, sent, m, by, i):
                network.waves[i] = wave
                if channel.roles[i] & MAY_RELAY:
                    network.next[found] = i
                    found += 1
    for k in range(found):
        network.now[k] = network.next[k]
    return found


def spread(channel: Channel, network: ChannelNetwork, sent: Messages, m: int, awaited: int) -> int:
    """Find the outcome of a message, unless a row of `reach` is missing; return the number of awaited rows so far."""
    base = sent.games[m] * channel.agents
    prepare(channel, network, sent, m)
    network.now[0] = sent.senders[m]
    transmitters = 1
    wave = 1
    while transmitters:
        is_waiting = False
        for k in range(transmitters if channel.needs_rows else 0):
            row = base + network.now[k]
            if network.slots[row] == NO_ROW:
                network.slots[row] = AWAITED
                network.awaited[awaited] = row
                awaited += 1
            if network.slots[row] == AWAITED:
                is_waiting = True
        if is_waiting:
            return awaited
        transmitters = transmit(channel, network, sent, m, wave, transmitters)
        wave += 1
    note(channel, network, sent, m)
    return awaited


def note(channel: Channel, network: ChannelNetwork, sent: Messages, m: int) -> int:
    """Write the outcome of a message."""
    at = m * channel.agents
    for i in range(channel.agents):
        state = network.states[i]
        outcome = 0
        sent.arrivals[at + i] = 0
        if network.waves[i]:
            sent.arrivals[at + i] = network.turns[sent.games[m]] + 1 + network.waves[i] * channel.delay
            if state & IS_MEANT:
                outcome = IS_HEARD
            elif channel.roles[i] & MAY_OVERHEAR:
                outcome = IS_OVERHEARD
        elif state & IS_MEANT and state & IN_REACH:
            outcome = IS_JAMMED if network.jammed[i] else IS_LOST
        sent.outcomes[at + i] = outcome
    sent.is_known[m] = 1
    return 0


def admit(
    games: memoryview[int],
    senders: memoryview[int],
    groups: memoryview[int],
    first: memoryview[int],
    members: memoryview[int],
    uses: memoryview[int],
    there: memoryview[int],
    sizes: memoryview[int],
    left: memoryview[int],
    verdicts: memoryview[int],
) -> int:
    """Find which messages can be sent by a channel, in the order in which they are given.

    Args:
        games: (messages,) as in `Messages`, but in any order.
        senders: (messages,) as in `Messages`.
        groups: (messages,) as in `Messages`.
        first: (groups + 1,) as in `Messages`.
        members: as in `Messages`.
        uses: (agents,) 1: the agent may use the channel.
        there: (rows,) 1: the agent is in the game, alive or not.
        sizes: (messages,) bytes.
        left: (rows,) the bytes that each agent may still send; reduced by each message that can be sent.
        verdicts: (messages,) the result: `ADMITTED`, or the reason of a refusal: `UNKNOWN`, the group has no agent;
            `FOR_SENDER`, the group has only the sender; `FOR_OTHERS`, no other agent of the group may use the channel;
            or a number from 0: the bytes that were left, fewer than the message has.
    """
    for m in range(len(games)):
        base = games[m] * len(uses)
        verdict = ADMITS if groups[m] < 0 else IS_UNKNOWN
        for k in range(first[max(groups[m], 0)], first[groups[m] + 1]):  # nothing for everybody
            if there[base + members[k]]:
                found = ADMITS if uses[members[k]] else IS_FOR_OTHERS
                if members[k] == senders[m]:
                    found = IS_FOR_SENDER
                verdict = max(verdict, found)
        if verdict == ADMITS:
            if sizes[m] > left[base + senders[m]]:
                verdict = left[base + senders[m]]
            else:
                left[base + senders[m]] -= sizes[m]
        verdicts[m] = verdict
    return 0


def count_messages(
    games: memoryview[int], senders: memoryview[int], counts: memoryview[int], numbers: memoryview[int]
) -> int:
    """Count the messages that the sender of each message sent before it in the turn.

    Args:
        games: (messages,) ascending.
        senders: (messages,) the agents that send them.
        counts: (agents,) working memory.
        numbers: (messages,) the counts.
    """
    for m in range(len(games)):
        if m == 0 or games[m] != games[m - 1]:
            for i in range(len(counts)):
                counts[i] = 0
        numbers[m] = counts[senders[m]]
        counts[senders[m]] += 1
    return 0


def spread_all(channel: Channel, network: ChannelNetwork, sent: Messages) -> int:
    """Find the outcomes of messages; return the number of awaited rows of transmitters, 0 if all outcomes are known."""
    game = -1
    awaited = 0
    for m in range(len(sent.games)):
        if not sent.is_known[m]:
            if sent.games[m] != game:
                game = sent.games[m]
                jam(channel, network, game)
            awaited = spread(channel, network, sent, m, awaited)
    return awaited
