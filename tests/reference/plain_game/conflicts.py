"""Which agents have to stay where moves conflict: docs/rules.md, Conflicts."""

from dataclasses import dataclass
from math import inf

from plain_game.draws import bits


@dataclass
class Conflicts:
    """The conflicts of a game, and how they are resolved."""

    capacity: object = 1
    among: str = "all"
    allow_swaps: bool = True
    resolve: object = "at_random"

    def __post_init__(self):
        if isinstance(self.capacity, str):
            raise NotImplementedError(f"not in the subset of the reference: the attribute {self.capacity} of nodes")

    def stopped(self, game, walks):
        """Return the names of the agents that stay, of which each would go as its walk says; names -> walks."""
        there = {agent.name: game.node_of(agent) for agent in game.living()}
        ends = {name: walk.node if not game.motion.is_metric else walk.end for name, walk in walks.items()}
        goes = {name: game.agents[name] for name in walks if ends[name] != there[name]}
        losers = set() if self.allow_swaps else self.swaps_lost(game, goes, there, ends)
        while True:
            for name in losers:
                goes.pop(name, None)
            lost = set()
            for (node, team), wanting in self.by_node(goes, ends).items():
                stays = [name for name in there if name not in goes and there[name] == node]
                if self.among == "team":
                    stays = [name for name in stays if game.agents[name].team == team]
                places = max(0, self.room(node) - len(stays))
                if len(wanting) > places:
                    lost |= {agent.name for agent in wanting} - set(self.winners(game, wanting, places))
            if not lost:
                return losers
            losers |= lost

    def by_node(self, goes, ends):
        """Return the agents that want to go to each node, each team by itself where these count by themselves."""
        wanting = {}
        for name, agent in goes.items():
            if ends[name] is None:
                continue
            group = None if self.among == "all" else agent.team
            wanting.setdefault((ends[name], group), []).append(agent)
        return wanting

    def swaps_lost(self, game, goes, there, ends):
        """Return those that may not go, because others that won come towards them."""
        groups = {}
        for name, agent in goes.items():
            pair = frozenset((there[name], ends[name]))
            if None in pair:
                continue
            groups.setdefault((pair, None if self.among == "all" else agent.team), []).append(agent)
        lost = set()
        for agents in groups.values():
            if len({agent.node for agent in agents}) == 2:
                winners = self.winners(game, agents, 1)
                starts = {agent.node for agent in agents if agent.name in winners}
                lost |= {agent.name for agent in agents if agent.node not in starts}
        return lost

    def room(self, node):
        """Return how many agents may end a turn on a node."""
        room = self.capacity
        if isinstance(room, dict):
            room = room.get(node)
        return inf if room is None else room

    def winners(self, game, agents, places):
        """Return the names of those that win the places."""
        if self.resolve == "nobody" or not places:
            return []
        if self.resolve == "at_random":
            ranked = sorted(agents, key=lambda agent: bits(game.seed, ("conflicts",), agent.name, game.turn))
        elif isinstance(self.resolve, dict) and set(self.resolve) == {"by_priority"}:
            teams = self.resolve["by_priority"]
            ranked = sorted(agents, key=lambda agent: (teams.index(agent.team), agent.name))
        else:
            raise NotImplementedError(f"the resolver {self.resolve!r} is not in the subset of the reference")
        return [agent.name for agent in ranked[:places]]
