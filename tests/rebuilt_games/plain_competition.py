"""The competition of `gamms new cup --from competition` without GAMMS."""

from math import dist, inf

from keyed import bits_of_pair, stream
from plain_roads import Roads

TURNS = 400
TOWERS = (385860.0, 6672680.0), (386120.0, 6672250.0)


def play(seed, nodes, edges, starts, candidates, walls):
    """Yield after each turn: agent -> node of the living, and the scores.

    Args:
        seed: of the game.
        nodes: node -> (x, y).
        edges: (source, target, length), in their order.
        starts: agent -> node; names begin with the team.
        candidates: the nodes of the flags.
        walls: ((x, y), (x, y), z below, z above).
    """
    roads, sight = Roads(nodes, edges), Sight(nodes, walls)
    real = stream(seed, "flags").permutation(sorted(candidates))[:3].tolist()
    known, captured, at, out, returned = [], [], dict(sorted(starts.items())), {}, set()
    scores = {}
    for turn in range(1, TURNS + 1):
        paths = {}
        for name, here in at.items():
            eyes = {one: node for one, node in at.items() if one != name and roads.are_near(here, node, 120.0)}
            if name.startswith("attackers"):
                enemies = {one: node for one, node in eyes.items() if one.startswith("defenders")}
                paths[name] = attack(roads, here, enemies, candidates, real, known, captured)
            else:
                seen = eyes | {one: node for one, node in at.items() if sight.from_towers(node)}
                enemies = {one: node for one, node in sorted(seen.items()) if one.startswith("attackers")}
                paths[name] = defend(roads, here, enemies, real[int(name.rpartition("_")[2]) % 3])
        at = {name: path[-1] for name, path in paths.items()}
        for pair in tags(roads, seed, turn, paths):
            for name in pair:
                del at[name]
                out[name] = turn
        for name, here in at.items():
            for flag in candidates if name.startswith("attackers") else ():
                if flag not in known and roads.are_near(here, flag, 120.0):
                    known.append(flag)
                    pay(scores, 1)
        for name, here in list(at.items()):
            near = roads.around(here, 1) if name.startswith("attackers") else ()
            flags = [flag for flag in known if flag in real and flag in near and flag not in captured]
            if flags:
                captured.append(flags[0])
                pay(scores, 10)
                del at[name]
                out[name] = turn
        for name in [name for name, since in out.items() if since + 20 <= turn]:
            if name.startswith("defenders") or name not in returned:
                returned.add(name)
                at[name] = starts[name]
                del out[name]
        at = dict(sorted(at.items()))
        yield at, dict(scores)
        if len(captured) == 3:
            return


def pay(scores, points):
    scores["attackers"] = scores.get("attackers", 0.0) + points
    scores["defenders"] = scores.get("defenders", 0.0) - points


def attack(roads, here, enemies, candidates, real, known, captured):
    """Return the way of an attacker in a turn."""
    if any(roads.distance(here, node) < 60.0 for node in enemies.values()):
        legal, threats = roads.around(here, 2), set(enemies.values())
        safest = max(legal, key=lambda node: (min(roads.distance(one, node) for one in threats), -node))
        return roads.fewest(here, safest)
    goals = [flag for flag in known if flag in real and flag not in captured]
    goals = goals or [flag for flag in candidates if flag not in known]
    return way(roads, here, min(goals, key=lambda flag: (roads.distance(here, flag), flag), default=here))


def defend(roads, here, enemies, post):
    """Return the way of a defender in a turn."""
    far, _, goal = min(((roads.distance(here, node), one, node) for one, node in enemies.items()), default=(inf, "", 0))
    return way(roads, here, post if far == inf else goal)


def way(roads, here, goal):
    return roads.fewest(here, goal) if goal in roads.around(here, 2) else roads.shortest(here, goal)[:3]


def tags(roads, seed, turn, paths):
    """Return the pairs that come within two edges: the earliest first, then the nearest, then by lot."""
    found = []
    for defender, path in paths.items():
        for attacker, other in paths.items():
            if defender.startswith("defenders") and attacker.startswith("attackers"):
                lot = bits_of_pair(seed, ("contacts",), defender, attacker, turn)
                found += [(*when, lot, defender, attacker) for when in met(roads, path, other)]
    pairs, taken = [], set()
    for *_, defender, attacker in sorted(found):
        if not taken & {defender, attacker}:
            taken |= {defender, attacker}
            pairs.append((defender, attacker))
    return pairs


def met(roads, path, other):
    """Yield (time, edges between them) whenever one of two agents reaches a node, and both are near."""
    times = {k / (len(one) - 1) for one in (path, other) for k in range(1, len(one))} or {0.0}
    for time in sorted(times):
        here, there = (one[int(time * (len(one) - 1))] for one in (path, other))
        hops = min(roads.around(here, 2).get(there, inf), roads.around(there, 2).get(here, inf))
        if hops < inf:
            yield time, hops


class Sight:
    """What towers see past walls, at the height of an eye."""

    def __init__(self, nodes, walls):
        self.xy, self.known = nodes, {}
        self.walls = {
            tower: [
                (a, b)
                for a, b, below, above in walls
                if below <= 1.6 <= above
                and min(a[0], b[0]) <= tower[0] + 300
                and max(a[0], b[0]) >= tower[0] - 300
                and min(a[1], b[1]) <= tower[1] + 300
                and max(a[1], b[1]) >= tower[1] - 300
            ]
            for tower in TOWERS
        }

    def from_towers(self, node):
        """Return whether a tower sees a node."""
        if node not in self.known:
            place = self.xy[node]
            self.known[node] = any(
                dist(tower, place) <= 300.0 and not any(is_crossed(tower, place, *wall) for wall in self.walls[tower])
                for tower in TOWERS
            )
        return self.known[node]


def is_crossed(a, b, c, d):
    """Return whether two segments touch, unless they run along each other."""
    sides = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
    return any(sides) and sides[0] * sides[1] <= 0 and sides[2] * sides[3] <= 0


def side(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
