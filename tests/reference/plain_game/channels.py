"""Messages between agents: docs/messages.md."""

from dataclasses import dataclass
from itertools import pairwise
from math import dist

from plain_game.draws import bits, bits_of, fraction, hashed


@dataclass
class Channel:
    """A channel and its keywords."""

    name: str
    range_m: float | None = None
    hops: int | None = None
    relay: object = False
    loss: object = 0.0
    delay_turns: int = 1
    jammers: tuple = ()
    teams: object = None
    eavesdroppers: tuple = ()

    def is_open_to(self, agent):
        """Return whether an agent may use the channel."""
        return self.teams is None or agent.team in as_list(self.teams)

    def passes_on(self, agent):
        """Return whether an agent passes messages on."""
        if isinstance(self.relay, bool):
            return self.relay and self.is_open_to(agent)
        return is_of(agent, self.relay)

    def reaches(self, game, sender, receiver):
        """Return whether one agent is in the range of the other."""
        if self.range_m is not None and distance(game, sender, receiver) > self.range_m:
            return False
        if self.hops is not None:
            ways = game.streets.ways_from(sender.node, False)
            return receiver.node in ways and ways[receiver.node][0] <= self.hops
        return True

    def is_jammed(self, game, agent):
        """Return whether an agent hears nothing, since a jammer is near."""
        for jammer in self.jammers:
            jamming = [
                one for one in game.living() if one.name == jammer.get("agent") or one.team == jammer.get("team")
            ]
            places = [game.xy_of(one) for one in jamming]
            if "at" in jammer:
                at = jammer["at"]
                places.append(game.streets.xy[at] if isinstance(at, int) else tuple(at))
            if any(dist(place, game.xy_of(agent)) <= jammer["radius_m"] for place in places):
                return True
        return False

    def is_lost(self, game, sender, by, receiver, number):
        """Return whether message `number` of a sender in a turn is lost on its way from one agent to another."""
        if not self.loss:
            return False
        name = hashed(receiver.name)
        if self.relay:
            name = bits_of(hashed(by.name), name, 0)
        drawn = fraction(bits(game.seed, ("channel", self.name, sender.name), name, game.turn - 1, number))
        return drawn < chance_at(self.loss, distance(game, by, receiver))


def as_list(value):
    """Return one value, or several, as a list."""
    return list(value) if isinstance(value, (list, tuple)) else [value]


def is_of(agent, names):
    """Return whether an agent, or its team, is among these names."""
    return agent.name in as_list(names) or agent.team in as_list(names)


def distance(game, a, b):
    """Return how many metres are between two agents in a straight line."""
    return dist(game.xy_of(a), game.xy_of(b))


def chance_at(loss, metres):
    """Return how probably a message is lost over a distance: a number, or straight lines between pairs."""
    if not isinstance(loss, (list, tuple)):
        return loss
    if metres <= loss[0][0]:
        return loss[0][1]
    for (before, low), (behind, high) in pairwise(loss):
        if metres <= behind:
            return low + (high - low) * (metres - before) / (behind - before)
    return loss[-1][1]


def problem_of(game, sender, message):
    """Return why a message cannot be sent, None if it can."""
    if set(message) != {"channel", "to", "body"}:
        return "a message has the keys channel, to and body"
    channel = game.channels.get(message["channel"])
    to = message["to"]
    if channel is None or not channel.is_open_to(sender):
        return "the agent has no such channel"
    if to is not None and not addressees(game, channel, sender, to):
        return "nobody can be meant"
    return None


def addressees(game, channel, sender, to):
    """Return those that a message is for, dead ones included: an agent, a team, or all on the channel."""
    others = [agent for agent in game.agents.values() if agent is not sender and channel.is_open_to(agent)]
    if to is None:
        return others
    if to in game.agents:
        return [agent for agent in others if agent.name == to]
    return [agent for agent in others if agent.team == to]


def deliver(game, outboxes):
    """Send what agents have put into their outboxes: work out who hears each message, and when."""
    for name, outbox in outboxes.items():
        sender = game.agents[name]
        sent = {}
        for message in outbox:
            problem = problem_of(game, sender, message)
            if problem is not None:
                sender.blocked = problem
                sender.illegal += 1
                continue
            channel = game.channels[message["channel"]]
            number = sent[channel.name] = sent.get(channel.name, -1) + 1
            game.messages.append(entry_of(game, channel, sender, message, number))


def entry_of(game, channel, sender, message, number):
    """Return what `result.messages` says of a message."""
    is_for = {agent.name for agent in addressees(game, channel, sender, message["to"])}
    listens = {agent.name for agent in game.living() if is_of(agent, channel.eavesdroppers)} | is_for
    waves, in_reach = spread(game, channel, sender, number)
    entry = {
        "turn": game.turn,
        "sender": sender.name,
        **message,
        "heard": {},
        "overheard": {},
        "lost": [],
        "jammed": [],
    }
    for name in sorted(in_reach & listens):
        if name in waves:
            entry["heard" if name in is_for else "overheard"][name] = game.turn + waves[name] * channel.delay_turns
        elif name in is_for:
            entry["jammed" if channel.is_jammed(game, game.agents[name]) else "lost"].append(name)
    return entry


def spread(game, channel, sender, number):
    """Return name -> by how many transmissions a message comes to it, and the names of all agents in reach of one."""
    others = [agent for agent in game.living() if agent is not sender]
    waves = {}
    in_reach = set()
    transmitters = [sender]
    wave = 1
    while transmitters:
        new = []
        for receiver in others:
            near = [by for by in transmitters if by is not receiver and channel.reaches(game, by, receiver)]
            if near:
                in_reach.add(receiver.name)
            if receiver.name in waves or channel.is_jammed(game, receiver):
                continue
            if not all(channel.is_lost(game, sender, by, receiver, number) for by in near):
                waves[receiver.name] = wave
                new.append(receiver)
        transmitters = [agent for agent in new if channel.passes_on(agent)]
        wave += 1
    return waves, in_reach


def inbox_of(game, agent):
    """Return the messages that an agent hears in this turn, in the order in which they were sent."""
    inbox = []
    for entry in game.messages:
        arrival = entry["heard"].get(agent.name, entry["overheard"].get(agent.name))
        if arrival == game.turn + 1:
            message = {key: entry[key] for key in ("channel", "sender", "to", "body")}
            inbox.append({**message, "turn": entry["turn"] - 1, "overheard": agent.name in entry["overheard"]})
    return inbox
