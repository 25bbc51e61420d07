"""Who meets whom in a turn, when and where: docs/rules.md, Contacts."""

from dataclasses import dataclass
from fractions import Fraction

from reference.draws import bits
from reference.tracks import Ride, Stay


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
    """Return the first contact of each two agents, one of each side, in their order.

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
                    lot = bits(game.seed, ("contacts",), repr((a.name, b.name)), game.turn)
                    time, distance, a_node, b_node = min(moments)
                    found.append(Contact(time, distance, lot, a.name, b.name, a_node, b_node))
    return sorted(found)


def one_to_one(found):
    """Return those contacts whose agents are in no earlier one that was taken."""
    taken, pairs = set(), []
    for one in found:
        if not taken & {one.a, one.b}:
            taken |= {one.a, one.b}
            pairs.append(one)
    return pairs


def meetings(game, a, b, how):
    """Return all moments (time, distance, node of a, node of b) at which two agents are in contact."""
    kind = next((kind for kind in ("hops", "metres", "euclid") if how.get(kind) is not None), None)
    crosses = kind is None if how.get("crossing") is None else how["crossing"]
    found = on_edges(a, b) if crosses else []
    if not how.get("passing", True):
        found = [(Fraction(1), 0.0, *nodes) for _, _, *nodes in found]
        nodes = (a.node, b.node)
        distance = 0.0 if a.node == b.node else None
        if kind is not None:
            distance = game.streets.distance(a.node, b.node, kind)
            distance = distance if distance <= how[kind] else None
        return found if distance is None else [*found, (Fraction(1), distance, *nodes)]
    return found + (on_nodes(a, b) if kind is None else near_each_other(game, a, b, kind, how[kind]))


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


def near_each_other(game, a, b, kind, most):
    """Return the moments at which one of both reaches a node, or both stay, and they are near enough."""
    begins = {one.begin for agent in (a, b) for one in agent.track if isinstance(one, Stay) and one.begin > 0}
    if all(isinstance(agent.track[0], Stay) and agent.track[0].begin == 0 for agent in (a, b)):
        begins.add(Fraction(0))
    found = []
    for time in sorted(begins):
        a_node, b_node = node_at(a, time), node_at(b, time)
        if a_node is not None and b_node is not None:
            distance = game.streets.distance(a_node, b_node, kind)
            if distance <= most:
                found.append((time, float(distance), a_node, b_node))
    return found


def node_at(agent, time):
    """Return the node that an agent is on or has passed last; None before a rule has put it on its node."""
    node = None
    for one in agent.track:
        if one.begin <= time:
            node = one.node if isinstance(one, Stay) else one.source
    return node
