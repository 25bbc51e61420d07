"""The game of tag_on_helsinki.py without GAMMS."""

from math import inf
from statistics import median

from keyed import Draw, bits_of_pair
from plain_roads import Roads

TEAMS, TURNS = ("red", "blue"), 60


def play(seed, nodes, edges, starts):
    """Yield after each turn: agent -> node of the living, and the scores.

    Args:
        seed: of the game.
        nodes: node -> (x, y).
        edges: (source, target, length), in their order.
        starts: agent -> node; names begin with the team.
    """
    roads, middle = Roads(nodes, edges), median(y for _, y in nodes.values())
    owner = {node: TEAMS[y >= middle] for node, (_, y) in nodes.items()}
    at, out, waypoints, scores = dict(sorted(starts.items())), {}, {}, {}
    for turn in range(1, TURNS + 1):
        paths = {}
        for name, here in at.items():
            seen = {one: node for one, node in at.items() if roads.are_near(here, node, 80.0)}
            enemies = {one: node for one, node in seen.items() if team_of(one) != team_of(name)}
            legal = roads.around(here, 2)
            goal = None
            if enemies and owner[here] == team_of(name):
                goal = nearest(roads, here, enemies)
            elif enemies:
                goal = safest(roads, legal, enemies)
            if goal is None:
                goal = waypoints.get(name)
                if goal is None or goal == here:
                    options = list(nodes)
                    goal = waypoints[name] = Draw(seed, name, turn - 1).choice(options)
            paths[name] = roads.fewest(here, goal) if goal in legal else roads.shortest(here, goal)[:3]
        at = {name: path[-1] for name, path in paths.items()}
        for tagger, tagged in tags(seed, turn, paths, owner):
            scores[team_of(tagger)] = scores.get(team_of(tagger), 0) + 1
            out[tagged] = turn
            at.pop(tagged, None)
        for name in [name for name, since in out.items() if since + 5 <= turn]:
            at[name] = starts[name]
            del out[name]
        at = dict(sorted(at.items()))
        yield at, dict(scores)


def team_of(name):
    return name.partition("_")[0]


def nearest(roads, here, enemies):
    """Return the node of the nearest enemy by road, of several the first by name; None where no path leads to any."""
    far, _, node = min((roads.distance(here, node), name, node) for name, node in enemies.items())
    return None if far == inf else node


def safest(roads, legal, enemies):
    """Return the legal node that is farthest from the nearest enemy, of several the lowest."""
    threats = set(enemies.values())
    return max(legal, key=lambda node: (min(roads.distance(threat, node) for threat in threats), -node))


def tags(seed, turn, paths, owner):
    """Return who tags whom, each in one pair at most: the earliest, and by lot."""
    meetings = []
    for red, path in paths.items():
        for blue, other in paths.items():
            if team_of(red) == "red" and team_of(blue) == "blue" and set(path) & set(other):
                lot = bits_of_pair(seed, ("contacts",), red, blue, turn)
                meetings += [(time, lot, on_edge, red, blue, *where) for time, on_edge, *where in met(path, other)]
    found, taken = [], set()
    for *_, red, blue, red_node, blue_node in sorted(meetings):
        some = [(red, blue)] * (owner[blue_node] == "red") + [(blue, red)] * (owner[red_node] == "blue")
        if some and not taken & {red, blue}:
            taken |= {red, blue}
            found += some
    return found


def met(path, other):
    """Yield when two ways of a turn come together: time, whether on an edge, and the node of each."""
    for node, begin, end in visits(path):
        for place, came, left in visits(other):
            if node == place and begin <= left and came <= end:
                yield max(begin, came), False, node, node
    for source, target, begin, end in legs(path):
        for start, goal, came, left in legs(other):
            if (source, target) == (goal, start) and begin <= left and came <= end:
                yield max(begin, came), True, source, start


def visits(path):
    """Return (node, from when, until when) of a way; the node that is left at once belongs to the turn before."""
    if len(path) == 1:
        return [(path[0], 0.0, 1.0)]
    edges = len(path) - 1
    return [(node, k / edges, 1.0 if k == edges else k / edges) for k, node in enumerate(path)][1:]


def legs(path):
    edges = len(path) - 1
    return [(path[k], path[k + 1], k / edges, (k + 1) / edges) for k in range(edges)]
