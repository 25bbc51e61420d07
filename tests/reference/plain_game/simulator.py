"""A game of a scenario, turn by turn: docs/game.md. Read `Game.step` first."""

from dataclasses import dataclass, field, fields
from fractions import Fraction
from math import inf

from plain_game.channels import Channel, deliver, inbox_of
from plain_game.conflicts import Conflicts
from plain_game.draws import Draw
from plain_game.moves import ByEdges, ByMetres, Illegal, Stay
from plain_game.rules import RULES, publish_beforehand
from plain_game.sensors import sensors_of
from plain_game.streets import Streets

KEYS = {"name", "description", "seed", "max_turns", "map", "sensors", "teams", "rules", "conflicts", "channels"}
KEYS |= {"settings", "facts"}
TEAM_KEYS = {"agents", "count", "near", "within", "apart", "from", "speed", "strategy", "sensors"}
AGENT_KEYS = {"name", "node", "speed", "strategy", "sensors"}
OWN = {"carriers", "captures", "out_since", "come_back"}  # what rules remember, which are no keywords
MOTIONS = {"edges": ByEdges, "metres": ByMetres}
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
    sensors: dict = field(default_factory=dict)
    track: list = field(default_factory=list)  # of this turn: Stay and Ride, in the order of time
    path: list = field(default_factory=list)  # of this turn
    stops: int = 0  # how often it was put on a node, or taken out
    moves: int = 0
    blocks: int = 0
    illegal: int = 0


class Game:
    """A game of a scenario.

    Args:
        scenario: a `gamms.scenario.Scenario`; its map, and where agents start, are taken as it gives them.
        seed: of the game; by default that of the scenario.
        strategies: team or name of an agent -> function of the state.
        plans: team -> function of the states of its agents by name, in place of their strategies.
    """

    def __init__(self, scenario, seed=None, strategies=None, plans=None):
        given = scenario.to_dict()
        refuse("key of a scenario", given, KEYS)
        settings = given.get("settings", {})
        refuse("setting", settings, SETTINGS)
        settings = SETTINGS | settings
        refuse("value of on_illegal", [settings["on_illegal"]], ["stay"])
        refuse("unit of speeds", [settings["speed_unit"]], MOTIONS)
        self.seed = given.get("seed") if seed is None else seed
        self.max_turns = given.get("max_turns") or inf
        self.streets = Streets.of(scenario.columns())
        self.motion = MOTIONS[settings["speed_unit"]](self.streets)
        if self.motion.is_metric and self.streets.is_bent:
            raise NotImplementedError("not in the subset of the reference: games by metres where streets have bends")
        starts = {name: int(nodes[0]) for name, nodes in scenario.starts([self.seed]).items()}
        self.plans = plans or {}
        teams = {name: without_plan(keys) if name in self.plans else keys for name, keys in given["teams"].items()}
        self.agents = agents_of(teams, given.get("sensors", {}), starts, strategies or {})
        self.order = settings["order"] or [list(dict.fromkeys(agent.team for agent in self.agents.values()))]
        self.conflicts = made(Conflicts, "keyword of conflicts", given["conflicts"]) if given.get("conflicts") else None
        self.channels = {
            name: made(Channel, "keyword of channels", {"name": name} | keys)
            for name, keys in given.get("channels", {}).items()
        }
        self.facts = dict(given.get("facts", {}))
        self.turn = 0
        self.scores = {}
        self.events = []
        self.messages = []
        self.ends = []  # (reason, winner, truncated) of this turn
        self.over = None
        self.rules = [rule_of(one) for one in given.get("rules", [])]
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
            begin = Fraction(number, len(self.order))
            end = Fraction(number + 1, len(self.order))
            movers = [agent for agent in self.living() if agent.team in teams]
            states = {agent.name: self.state_of(agent) for agent in movers}
            for team, plan in self.plans.items():
                own = {agent.name: states[agent.name] for agent in movers if agent.team == team}
                if own:
                    plan(own)
            routes = {agent.name: self.decision(agent, states[agent.name], outboxes) for agent in movers}
            walks = {agent.name: self.motion.walk(agent, routes[agent.name], begin, end) for agent in movers}
            for name in self.conflicts.stopped(self, walks) if self.conflicts else ():
                agent = self.agents[name]
                agent.blocked = "a conflict"
                agent.blocks += 1
                walks[name] = self.motion.walk(agent, (), begin, end)
            for agent in movers:
                self.move(agent, walks[agent.name])
        self.turn += 1
        deliver(self, outboxes)
        for rule in self.rules:
            rule.play(self)
        self.finish()

    def living(self):
        """Return the living agents in the order of their names."""
        return [agent for _, agent in sorted(self.agents.items()) if agent.alive]

    def xy_of(self, agent):
        """Return where an agent is on the map; one that has covered part of an edge counts as on the node behind."""
        x, y = self.streets.xy[agent.node]
        if agent.target is None or not self.motion.is_metric:
            return x, y
        x1, y1 = self.streets.xy[agent.target]
        part = float(agent.offset / self.streets.out[agent.node][agent.target])
        return x + part * (x1 - x), y + part * (y1 - y)

    def node_of(self, agent):
        """Return the node that an agent is on, None between two nodes in a game by metres."""
        return None if self.motion.is_metric and agent.target is not None else agent.node

    # What agents know and decide.

    def state_of(self, agent):
        """Return what an agent knows when it decides."""
        state = {
            "name": agent.name,
            "team": agent.team,
            "turn": self.turn,
            "curr_pos": agent.node,
            "legal": self.motion.legal(agent),
            "blocked": agent.blocked,
            "facts": self.facts,
            "memory": agent.memory,
            "draw": Draw(self.seed, agent.name, self.turn),
            "sensor": {name: (one.type, one.look(self, agent)) for name, one in agent.sensors.items()},
        }
        if self.motion.is_metric:
            state["offset_m"] = float(agent.offset)
            state["edge"] = None if agent.target is None else (agent.node, agent.target)
        if self.channels:
            state["inbox"], state["outbox"] = inbox_of(self, agent), []
        return state

    def decision(self, agent, state, outboxes):
        """Ask an agent; return the nodes that it wants to go along, none to stay."""
        agent.blocked = None
        if agent.team not in self.plans:
            if agent.strategy is None:
                return ()
            agent.strategy(state)
        try:
            route = self.motion.route(agent, state["action"])
        except Illegal as why:
            agent.blocked = str(why)
            agent.illegal += 1
            return ()
        outboxes[agent.name] = state.get("outbox", [])
        return route

    def move(self, agent, walk):
        """Let an agent be where its walk leads."""
        agent.path = walk.path
        agent.track = walk.track
        agent.node = walk.node
        agent.target = walk.target
        agent.offset = walk.offset
        if walk.path[0] != walk.path[-1]:
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
        agent.node = agent.start if node is None else node
        agent.target = None
        agent.offset = Fraction(0)
        agent.alive = True
        agent.stops += 1
        agent.track = [Stay(Fraction(1), Fraction(1), agent.node)]
        self.emit("respawned", agent=agent.name, node=agent.node)

    def eliminate(self, agent):
        """Take an agent out of the game."""
        agent.alive = False
        agent.stops += 1
        agent.target = None
        agent.offset = Fraction(0)
        self.emit("eliminated", agent=agent.name, node=agent.node)

    def end(self, reason, winner=None, truncated=False):
        """End the game after this turn."""
        self.ends.append((reason, winner, truncated))

    def finish(self):
        """Make one end of those of a turn: by what happened rather than by time, with the winner if all agree."""
        if self.ends:
            ends = [one for one in self.ends if not one[2]] or self.ends
            reasons = {reason for reason, _, _ in ends}
            winners = {winner for _, winner, _ in ends}
            winner = winners.pop() if len(winners) == 1 else None
            self.over = {"reason": "; ".join(sorted(reasons)), "winner": winner, "truncated": ends[0][2]}


def random_walk(state):
    """Go to one of the legal nodes, each as likely; from between two nodes go on to the next."""
    edge = state.get("edge")
    state["action"] = state["draw"].choice(state["legal"]) if edge is None else edge[1]


STRATEGIES = {"gamms.strategies:random_walk": random_walk, None: None}


def agents_of(teams, sensors, starts, strategies):
    """Return the agents of a scenario by name."""
    agents = {}
    for team, keys in teams.items():
        refuse("key of a team", keys, TEAM_KEYS)
        named = {one["name"]: one for one in keys.get("agents", ())}
        named |= {f"{team}_{number}": {} for number in range(keys.get("count", 0))}
        for name, own in named.items():
            refuse("key of an agent", own, AGENT_KEYS)
            speed = own.get("speed", keys.get("speed"))
            strategy = strategies.get(name, strategies.get(team))
            if strategy is None:
                given = own.get("strategy", keys.get("strategy"))
                refuse("strategy", [given if isinstance(given, (str, type(None))) else str(given)], STRATEGIES)
                strategy = STRATEGIES[given]
            agents[name] = Agent(name, team, starts[name], None if speed is None else Fraction(speed), strategy)
            agents[name].node = starts[name]
            carried = own.get("sensors", []), keys.get("sensors", [])
            for some in carried:
                agents[name].sensors |= sensors_of(some, sensors, made)
    return agents


def without_plan(keys):
    """Return the keys of a team without its plan."""
    return {key: value for key, value in keys.items() if key != "plan"}


def rule_of(given):
    """Return the rule of an item of a scenario's list."""
    given = {"rule": given} if isinstance(given, str) else given
    refuse("key of a rule", given, {"rule", "with", "name"})
    name = given["rule"].removeprefix("gamms.rules:").removeprefix("gamms.rules.")
    refuse("rule", [name], RULES)
    return made(RULES[name], f"keyword of {name}", given.get("with", {}))


def made(kind, what, keywords):
    """Return an instance of a dataclass; refuse keywords that it does not have."""
    refuse(what, keywords, [one.name for one in fields(kind) if one.name not in OWN])
    return kind(**keywords)


def refuse(what, given, known):
    """Refuse what is not in the subset by its name."""
    others = [str(one) for one in given if one not in known]
    if others:
        raise NotImplementedError(f"not in the subset of the reference: the {what} {', '.join(others)}")
