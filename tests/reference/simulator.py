"""The specification of a game: a plain simulator of what the documentation says, independent of the library's engine.

It plays a scenario that is in its subset, one turn at a time, by dicts, lists and fractions: exact, and slow. What is
not in the subset is refused by its name. Random games are compared with it in `test_against_the_reference.py`.

Read `Game.step` first: it is the turn of docs/game.md. The rules are in `rules.py`.
"""

from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from math import inf

from reference.channels import Channel, deliver, inbox_of
from reference.conflicts import Conflicts
from reference.draws import Draw
from reference.rules import RULES, publish_beforehand
from reference.streets import Streets
from reference.tracks import Stay, track_along

KEYS = {
    "name",
    "description",
    "seed",
    "max_turns",
    "map",
    "teams",
    "rules",
    "conflicts",
    "channels",
    "settings",
    "facts",
}
SETTINGS = {"on_illegal": "stay", "speed_unit": "edges", "order": None}


@dataclass
class Agent:
    """An agent on the ground. Where `target` is not None, it has covered `offset` of the edge to that node."""

    name: str
    team: object
    start: int
    speed: Fraction | None
    strategy: object
    node: int = 0
    target: int | None = None
    offset: Fraction = Fraction(0)
    alive: bool = True
    blocked: str | None = None
    memory: dict = field(default_factory=dict)
    track: list = field(default_factory=list)  # of this turn: Stay and Ride, in the order of time
    path: tuple = ()  # of this turn
    stops: int = 0  # how often it was put on a node, or taken out
    moves: int = 0
    blocks: int = 0
    illegal: int = 0

    @property
    def place(self):
        """Where it is, as one value."""
        return self.node, self.target, self.offset


class Illegal(Exception):
    """An action that is not legal."""


class Game:
    """A game of a scenario.

    Args:
        scenario: a `gamms.scenario.Scenario`, whose map and starts are taken from it, or a mapping of its keys.
        seed: of the game; by default that of the scenario.
        strategies: team or name of an agent -> function of the state.
    """

    def __init__(self, scenario, seed=None, strategies=None):
        given = scenario.to_dict()
        refuse("keys of scenarios", given, KEYS)
        settings = given.get("settings", {})
        refuse("settings", settings, SETTINGS)
        settings = SETTINGS | settings
        if settings["on_illegal"] != "stay" or settings["speed_unit"] not in ("edges", "metres"):
            raise NotImplementedError("the subset of the reference has on_illegal='stay', and edges or metres")
        self.seed = given.get("seed") if seed is None else seed
        self.max_turns = given.get("max_turns") or inf
        self.is_metric = settings["speed_unit"] == "metres"
        self.streets = Streets.of(scenario.columns())
        starts = {name: int(nodes[0]) for name, nodes in scenario.starts([self.seed]).items()}
        self.agents = agents_of(given["teams"], starts, strategies or {})
        self.order = settings["order"] or [list(dict.fromkeys(agent.team for agent in self.agents.values()))]
        self.conflicts = Conflicts(**given["conflicts"]) if given.get("conflicts") else None
        self.channels = {name: Channel(name, **keys) for name, keys in given.get("channels", {}).items()}
        self.facts = dict(given.get("facts", {}))
        self.turn = 0
        self.scores, self.events, self.messages, self.ends = {}, [], [], []
        self.over = None
        self.rules = [make_rule(one) for one in given.get("rules", [])]
        self.rules.sort(key=lambda rule: rule.rank)  # a stable sort: those of one rank as they were added
        for rule in self.rules:
            publish_beforehand(self, rule)

    def run(self):
        """Play until a rule ends the game, or the turns are over."""
        while self.over is None and self.turn < self.max_turns:
            self.step()

    def step(self):
        """Play one turn; see docs/game.md."""
        outboxes = {}
        for number, teams in enumerate(self.order):
            begin, end = Fraction(number, len(self.order)), Fraction(number + 1, len(self.order))
            movers = [agent for agent in self.living() if agent.team in teams]
            states = {agent.name: self.state_of(agent) for agent in movers}
            routes = {agent.name: self.decision(agent, states[agent.name], outboxes) for agent in movers}
            ends = {agent.name: self.end_of(agent, routes[agent.name]) for agent in movers}
            stopped = self.conflicts.stopped(self, movers, ends) if self.conflicts else set()
            for agent in movers:
                if agent.name in stopped:
                    agent.blocked = "a conflict"
                    agent.blocks += 1
                    routes[agent.name] = None
                self.move(agent, routes[agent.name], begin, end)
        self.turn += 1
        deliver(self, outboxes)
        for rule in self.rules:
            rule.play(self)
        self.finish()

    def living(self):
        """Return the living agents in the order of their names."""
        return [agent for _, agent in sorted(self.agents.items()) if agent.alive]

    def xy_of(self, agent):
        """Return where an agent is on the map."""
        return self.streets.xy[agent.node]

    # What agents know and decide.

    def state_of(self, agent):
        """Return what an agent knows when it decides."""
        state = {
            "name": agent.name,
            "team": agent.team,
            "turn": self.turn,
            "curr_pos": agent.node,
            "legal": self.legal(agent),
            "blocked": agent.blocked,
            "facts": self.facts,
            "memory": agent.memory,
            "draw": Draw(self.seed, agent.name, self.turn),
        }
        if self.is_metric:
            state["offset_m"] = float(agent.offset)
        if self.channels:
            state["inbox"], state["outbox"] = inbox_of(self, agent), []
        return state

    def legal(self, agent):
        """Return the nodes that an agent may move to: its own, its neighbours, and what else it reaches in a turn."""
        near = [agent.node, *self.streets.neighbours(agent.node)]
        reached = []
        if agent.speed is not None:
            ways = self.ways(agent)
            reached = [node for node in self.streets.xy if node in ways and ways[node][0] <= agent.speed]
            reached = [node for node in reached if node not in near]
        return (*near, *reached)

    def ways(self, agent):
        """Return node -> (how much of an agent's speed the way takes, the way), from where the agent is."""
        ways = {}
        for end, (far, _, way) in self.streets.ways_from(agent.node, self.is_metric).items():
            ways[end] = (far, len(way), way)
        if agent.target is not None:
            rest = 1 - agent.offset
            for end, (far, _, way) in self.streets.ways_from(agent.target, self.is_metric).items():
                if agent.node not in way:
                    ways[end] = min(ways[end], (rest + far, len(way) + 1, (agent.node, *way)))
        return {end: (far, way) for end, (far, _, way) in ways.items()}

    def decision(self, agent, state, outboxes):
        """Ask an agent; return the nodes that it wants to go along, from its own, or None to stay."""
        agent.blocked = None
        if agent.strategy is None:
            return None
        agent.strategy(state)
        try:
            route = self.route(agent, state["action"])
        except Illegal as why:
            agent.blocked = str(why)
            agent.illegal += 1
            return None
        outboxes[agent.name] = state.get("outbox", [])
        return route

    def route(self, agent, action):
        """Return the nodes that an action means, from the agent's own, or None to stay. Raises Illegal."""
        if isinstance(action, dict):
            action = action["node_id"]
        if isinstance(action, (list, tuple)):
            return self.route_along(agent, list(action))
        if action == agent.node:
            return None
        if agent.speed is None:
            if action not in self.streets.neighbours(agent.node):
                raise Illegal(f"{action!r} is not legal")
            return (agent.node, action)
        ways = self.ways(agent)
        if action not in ways:
            raise Illegal(f"no way leads to {action!r}")
        return ways[action][1]

    def route_along(self, agent, nodes):
        """Return the route along a list of nodes, each next to the one before; a node twice is a pause."""
        route = [agent.node, *(nodes[1:] if nodes[:1] == [agent.node] else nodes)]
        if agent.speed is None and len(route) > 2:
            raise Illegal("an agent without a speed goes along one edge")
        for start, end in pairwise(route):
            if end != start and end not in self.streets.out.get(start, {}):
                raise Illegal(f"no edge leads from {start!r} to {end!r}")
        return tuple(route) if len(route) > 1 else None

    # Moves.

    def end_of(self, agent, route):
        """Return the node on which an agent is going to be at the end of its way."""
        return self.walk(agent, route)[0][-1]

    def walk(self, agent, route):
        """Return the nodes that an agent passes on a route in one turn, its own first, and where it gets beyond them.

        That is the next node, None if there is none, and how much of the edge to it is covered.
        """
        nodes, left = [agent.node], Fraction(1) if agent.speed is None else agent.speed
        for end in (route or ())[1:]:
            covered = agent.offset if len(nodes) == 1 and end == agent.target else Fraction(0)
            if left < 1 - covered:
                is_edge = end != nodes[-1]
                return nodes, *((end, covered + left) if is_edge and covered + left else (None, Fraction(0)))
            left -= 1 - covered
            nodes.append(end)
        return nodes, None, Fraction(0)

    def move(self, agent, route, begin, end):
        """Let an agent go along its route, as far as a turn leads, in a part of the turn."""
        nodes, target, offset = self.walk(agent, route)
        agent.path = tuple(nodes)
        agent.track = track_along(nodes, begin, end)
        agent.node, agent.target, agent.offset = nodes[-1], target, offset
        if nodes[-1] != nodes[0]:
            agent.moves += 1

    # What rules do.

    def emit(self, kind, **data):
        """Note an event."""
        self.events.append({"turn": self.turn, "kind": kind, **data})

    def score(self, team, points):
        """Give points to a team."""
        if points:
            self.scores[team] = self.scores.get(team, 0) + points

    def put(self, agent, node=None):
        """Put an agent on a node, or where it began: it is there at the end of the turn, and has met no agent."""
        agent.node, agent.target, agent.offset = agent.start if node is None else node, None, Fraction(0)
        agent.alive = True
        agent.stops += 1
        agent.track = [Stay(Fraction(1), Fraction(1), agent.node)]
        self.emit("respawned", agent=agent.name, node=agent.node)

    def eliminate(self, agent):
        """Take an agent out of the game."""
        agent.alive = False
        agent.stops += 1
        agent.target, agent.offset = None, Fraction(0)
        self.emit("eliminated", agent=agent.name, node=agent.node)

    def end(self, reason, winner=None, truncated=False):
        """End the game after this turn."""
        self.ends.append((reason, winner, truncated))

    def finish(self):
        """Make one end of those of a turn: by what happened rather than by time, with the winner if all agree."""
        if self.ends:
            ends = [one for one in self.ends if not one[2]] or self.ends
            reasons, winners = sorted({one[0] for one in ends}), {one[1] for one in ends}
            winner = winners.pop() if len(winners) == 1 else None
            self.over = {"reason": "; ".join(reasons), "winner": winner, "truncated": ends[0][2]}


def agents_of(teams, starts, strategies):
    """Return the agents of a scenario by name."""
    agents = {}
    for team, keys in teams.items():
        refuse("keys of teams", keys, {"agents", "count", "near", "within", "apart", "from", "speed", "strategy"})
        named = {one["name"]: one for one in keys.get("agents", ())}
        named |= {f"{team}_{number}": {} for number in range(keys.get("count", 0))}
        for name, own in named.items():
            refuse("keys of agents", own, {"name", "node", "speed", "strategy"})
            speed = own.get("speed", keys.get("speed"))
            strategy = strategies.get(name, strategies.get(team, own.get("strategy", keys.get("strategy"))))
            if isinstance(strategy, (str, dict)):
                raise NotImplementedError(f"give the strategy {strategy!r} by strategies=")
            agents[name] = Agent(name, team, starts[name], None if speed is None else Fraction(speed), strategy)
            agents[name].node = starts[name]
    return agents


def make_rule(given):
    """Return the rule of an item of a scenario's list."""
    given = {"rule": given} if isinstance(given, str) else given
    refuse("keys of rules", given, {"rule", "with", "name"})
    name = given["rule"].removeprefix("gamms.rules:").removeprefix("gamms.rules.")
    if name not in RULES:
        raise NotImplementedError(f"the rule {name!r} is not in the subset of the reference")
    return RULES[name](**given.get("with", {}))


def refuse(what, given, known):
    """Refuse keys that are not in the subset."""
    if others := sorted(set(given) - set(known)):
        raise NotImplementedError(f"not in the subset of the reference: the {what} {', '.join(others)}")
