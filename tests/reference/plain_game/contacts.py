"""Who meets whom in a turn, when and where: docs/rules.md, Contacts."""

from dataclasses import dataclass
from fractions import Fraction

from plain_game.draws import bits_of_pair
from plain_game.moves import Ride, Stay


@dataclass(order=True)
class Contact:
    """Two agents at the first moment at which they are in contact, in the order in which contacts are matched."""

    time: Fraction
    distance: float
    lot: int
    a: str
    b: str
    a_node: int
    b_node: int


def contacts(game, ours, theirs, how, allows=lambda a_node, b_node: True):
    """Return the first contact of each two agents, one of each side.

    Args:
        game: the game.
        ours: the agents of one side.
        theirs: those of the other.
        how: the keywords "hops", "metres" or "euclid", and "passing".
        allows: whether a moment counts at which the two are on these nodes.
    """
    found = []
    for a in ours:
        for b in theirs:
            if a.name != b.name:
                moments = [one for one in meetings(game, a, b, how) if allows(*one[2:])]
                if moments:
                    lot = bits_of_pair(game.seed, ("contacts",), a.name, b.name, game.turn)
                    # At one time on a node rather than on an edge, which come first.
                    time, distance, a_node, b_node = min(moments, key=lambda one: one[:2])
                    found.append(Contact(time, distance, lot, a.name, b.name, a_node, b_node))
    return found


def one_to_one(met):
    """Return those of (contact, rule) whose agents are in no earlier one that was taken."""
    taken = set()
    pairs = []
    for one, rule in met:
        if not taken & {one.a, one.b}:
            taken |= {one.a, one.b}
            pairs.append((one, rule))
    return pairs


def meetings(game, a, b, how):
    """Return all moments (time, distance, node of a, node of b) at which two agents are in contact."""
    kind = next((kind for kind in ("hops", "metres", "euclid") if how.get(kind) is not None), None)
    if game.motion.is_metric:
        if kind is not None or not how["passing"]:
            raise NotImplementedError("not in the subset of the reference: a distance, or passing, in games by metres")
        return on_nodes(a, b) + on_streets(game, a, b)
    if not how["passing"]:
        distance = game.streets.distance(a.node, b.node, kind or "hops")
        if kind is None and on_edges(a, b):
            distance = 0
        is_near = distance <= (how[kind] if kind else 0)
        return [(Fraction(1), float(distance), a.node, b.node)] if is_near else []
    return on_nodes(a, b) + on_edges(a, b) if kind is None else near_each_other(game, a, b, kind, how[kind])


def on_nodes(a, b):
    """Return the moments from which on both are on one node."""
    return [
        (max(one.begin, other.begin), 0.0, one.node, other.node)
        for one in a.track
        for other in b.track
        if isinstance(one, Stay) and isinstance(other, Stay) and one.node == other.node
        if max(one.begin, other.begin) <= min(one.end, other.end)
    ]


def on_edges(a, b):
    """Return the moments from which on both are on one edge, in opposite directions."""
    return [
        (max(one.begin, other.begin), 0.0, one.source, other.source)
        for one in a.track
        for other in b.track
        if isinstance(one, Ride) and isinstance(other, Ride)
        if (one.source, one.target) == (other.target, other.source)
        if max(one.begin, other.begin) < min(one.end, other.end)
    ]


def on_streets(game, a, b):
    """Return the moments at which both are at one place between two nodes, in games by metres."""
    found = []
    for one in a.track:
        for other in b.track:
            are_rides = isinstance(one, Ride) and isinstance(other, Ride)
            if are_rides and {one.source, one.target} == {other.source, other.target}:
                time = same_place(game.streets.out[one.source][one.target], one, other)
                if time is not None:
                    found.append((time, 0.0, one.source, other.source))
    return found


def same_place(length, one, other):
    """Return the first time at which two on one street are at one place, None if they never are."""
    begin = max(one.begin, other.begin)
    end = min(one.end, other.end)
    if begin > end:
        return None
    at, speed = place_on(length, one, begin, one.source)
    other_at, other_speed = place_on(length, other, begin, one.source)
    if speed == other_speed:
        return begin if at == other_at else None
    time = begin + (other_at - at) / (speed - other_speed)
    is_between_nodes = 0 < at + speed * (time - begin) < length
    return time if is_between_nodes and begin <= time <= end and time > 0 else None


def place_on(length, ride, time, source):
    """Return where an agent is on a street at a time, in metres from one end of it, and how fast it goes from there."""
    speed = (ride.x1 - ride.x0) / (ride.end - ride.begin) if ride.end > ride.begin else Fraction(0)
    at = ride.x0 + speed * (time - ride.begin)
    return (at, speed) if ride.source == source else (length - at, -speed)


def near_each_other(game, a, b, kind, most):
    """Return the moments at which one of both reaches a node, or both stay, and they are near enough."""
    begins = reach_times(a) | reach_times(b)
    if not any(leaves_at_once(agent) for agent in (a, b)):
        begins.add(Fraction(0))
    found = []
    for time in sorted(begins):
        a_node = node_at(a, time)
        b_node = node_at(b, time)
        if a_node is not None and b_node is not None:
            distance = game.streets.distance(a_node, b_node, kind)
            if distance <= most:
                found.append((time, float(distance), a_node, b_node))
    return found


def reach_times(agent):
    """Return when an agent reaches a node that it was not on, or is put on one."""
    return {one.begin for one in agent.track if isinstance(one, Stay) and one.begin > 0}


def leaves_at_once(agent):
    """Return whether an agent leaves its node when the turn begins, or is put on one later."""
    return isinstance(agent.track[0], Ride) or agent.track[0].begin > 0


def node_at(agent, time):
    """Return the node that an agent is on or has passed last; None before a rule has put it on its node."""
    node = None
    for one in agent.track:
        if one.begin <= time:
            node = one.node if isinstance(one, Stay) else one.source
    return node
