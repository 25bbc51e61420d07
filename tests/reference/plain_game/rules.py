"""The rules of the reference: docs/rules.md. Each has a rank and is called once in a turn by `play(game)`."""

from dataclasses import dataclass, field
from fractions import Fraction

from plain_game.contacts import contacts, one_to_one
from plain_game.draws import bits
from plain_game.moves import Stay

LEADER = object()  # the team with the highest score wins, if it is one alone


def as_list(value):
    """Return a node, or several, as a list."""
    return list(value) if isinstance(value, (list, tuple)) else [value]


def places_of(game, nodes):
    """Return nodes, or those of "starts of a team"."""
    if isinstance(nodes, str):
        return [agent.start for agent in game.agents.values() if f"starts of {agent.team}" == nodes]
    return as_list(nodes)


def land_of(game, territory):
    """Return node -> team of a territory or of the name of a fact."""
    return game.facts[territory] if isinstance(territory, str) else territory


def leader(game):
    """Return the team with the highest score, None if it is not one alone."""
    teams = {agent.team for agent in game.agents.values()}
    scores = sorted(((game.scores.get(team, 0), team) for team in teams), reverse=True)
    if len(scores) < 2 or scores[0][0] == scores[1][0]:
        return None
    return scores[0][1]


def reaches(agent):
    """Return (time, node) whenever an agent reaches a node in this turn, or is on it when the turn begins."""
    return [(one.begin, one.node) for one in agent.track if isinstance(one, Stay)]


def ends(agent):
    """Return where an agent is at the end of the turn, as `reaches` does."""
    return [(Fraction(1), one.node) for one in agent.track[-1:] if isinstance(one, Stay)]


@dataclass
class Published:
    """A territory that every strategy knows."""

    nodes: dict
    name: str = "territory"
    rank = 0

    def play(self, game):
        """Publish it."""
        game.facts[self.name] = self.nodes


@dataclass
class Tag:
    """Agents that meet a tagger go back to where they began, or are out."""

    taggers: object
    tagged: object
    hops: float | None = None
    metres: float | None = None
    euclid: float | None = None
    passing: bool = True
    then: str = "respawn"
    score: float = 1
    territory: object = None
    mutual: bool = False
    rank = 0

    def contacts(self, game):
        """Return the contacts in which one of both is tagged."""
        ours = [agent for agent in game.living() if agent.team == self.taggers]
        theirs = [agent for agent in game.living() if agent.team == self.tagged]
        return contacts(game, ours, theirs, vars(self), lambda *nodes: any(self.tags(game, *nodes)))

    def tags(self, game, a_node, b_node):
        """Return whether the first of two agents tags the second, and the second the first, on these nodes."""
        if self.territory is None:
            return True, self.mutual
        land = land_of(game, self.territory)
        return land.get(b_node) == self.taggers, self.mutual and land.get(a_node) == self.tagged

    def play(self, game):
        """Let all rules that tag act as one, in the place of the first: match contacts, count tags, then move."""
        rules = [rule for rule in game.rules if isinstance(rule, Tag)]
        if self is not rules[0]:
            return
        met = sorted((one, number) for number, rule in enumerate(rules) for one in rule.contacts(game))
        tagged = []
        for one, number in one_to_one(met):
            tagged += [(agent, rules[number].then) for agent in rules[number].count(game, one)]
        for agent, then in tagged:
            if then == "eliminate":
                game.eliminate(agent)
            else:
                game.put(agent)

    def count(self, game, one):
        """Count the tags of a contact; return those that are tagged."""
        a = game.agents[one.a]
        b = game.agents[one.b]
        tags, is_tagged = self.tags(game, one.a_node, one.b_node)
        found = [(a, b, one.b_node)] if tags else []
        found += [(b, a, one.a_node)] if is_tagged else []
        for tagger, other, node in found:
            game.emit("tag", agent=tagger.name, other=other.name, node=node)
            game.score(tagger.team, self.score)
        return [other for _, other, _ in found]


@dataclass
class CaptureFlag:
    """Agents take the flags of other teams and bring them home."""

    flags: dict
    territory: object = None
    goal: int | None = 1
    score: float = 1
    announce: bool = True
    key: str = "flags"
    passing: bool = True
    rank = 0
    carriers: dict = field(default_factory=dict)  # flag -> (name, how often it had been stopped, when it was taken)
    captures: dict = field(default_factory=dict)

    def play(self, game):
        """Drop flags, then bring them home and take them, moment by moment."""
        for flag, (name, stops, _) in sorted(self.carriers.items()):
            agent = game.agents[name]
            if agent.stops != stops:
                del self.carriers[flag]
                game.emit("drop", agent=name, flag=flag, node=agent.node)
        find = reaches if self.passing else ends
        visits = {agent.name: find(agent) for agent in game.living()}
        for flag, (name, stops, _) in self.carriers.items():
            self.carriers[flag] = (name, stops, Fraction(-1))
        for moment in sorted({time for found in visits.values() for time, _ in found}):
            self.bring_home(game, moment, visits)
            self.take(game, moment, visits)
            if self.end(game):
                break
        self.publish(game)

    def bring_home(self, game, moment, visits):
        """Let carriers that come home at a moment capture their flags."""
        for flag, (name, _, taken) in sorted(self.carriers.items()):
            agent = game.agents[name]
            home = [
                node for time, node in visits[name] if time == moment > taken and self.is_home(game, agent.team, node)
            ]
            if home:
                del self.carriers[flag]
                game.emit("capture", agent=name, flag=flag, node=home[0])
                game.score(agent.team, self.score)
                self.captures[agent.team] = self.captures.get(agent.team, 0) + 1

    def is_home(self, game, team, node):
        """Return whether a team's agents bring flags home by coming to a node."""
        if self.territory is not None:
            return land_of(game, self.territory).get(node) == team
        if team in self.flags:
            return node == self.flags[team]
        return any(agent.start == node for agent in game.agents.values() if agent.team == team)

    def take(self, game, moment, visits):
        """Let agents that are on the base of another team's flag at a moment take it, one flag each, by lot."""
        for flag, base in sorted(self.flags.items()):
            if flag in self.carriers:
                continue
            busy = {name for name, _, _ in self.carriers.values()}
            there = [
                agent
                for agent in game.living()
                if agent.team not in (None, flag) and agent.name not in busy and is_on(agent, base, moment, visits)
            ]
            if there:
                purpose = ("capture_flag", self.key, str(flag))
                taker = min(there, key=lambda agent: bits(game.seed, purpose, agent.name, game.turn))
                self.carriers[flag] = (taker.name, taker.stops, moment)
                game.emit("take", agent=taker.name, flag=flag, node=base)

    def end(self, game):
        """End the game if a team has captured enough flags; return whether one has."""
        won = [team for team, count in self.captures.items() if self.goal is not None and count >= self.goal]
        if won:
            game.end("flags captured", won[0] if len(won) == 1 else None)
        return bool(won)

    def publish(self, game):
        """Tell all strategies where the flags are."""
        if self.announce:
            carriers = {flag: carrier[0] for flag, carrier in self.carriers.items()}
            game.facts[self.key] = {
                flag: {"node": base, "carrier": carriers.get(flag)} for flag, base in self.flags.items()
            }


def is_on(agent, node, moment, visits):
    """Return whether an agent is on a node at a moment."""
    if (moment, node) in visits[agent.name]:
        return True
    stays = [one for one in agent.track if isinstance(one, Stay) and one.begin <= moment <= one.end]
    return len(visits[agent.name]) > 0 and any(one.node == node for one in stays)


@dataclass
class Respawn:
    """Agents that are out come back where they began, after some turns."""

    after: int = 1
    times: int | None = None
    teams: object = None
    rank = 3
    out_since: dict = field(default_factory=dict)
    come_back: dict = field(default_factory=dict)

    def play(self, game):
        """Bring those back whose time has come."""
        for name, agent in sorted(game.agents.items()):
            if agent.alive or (self.teams is not None and agent.team not in as_list(self.teams)):
                self.out_since.pop(name, None)
                continue
            since = self.out_since.setdefault(name, game.turn)
            if self.times is not None and self.come_back.get(name, 0) >= self.times:
                continue
            if game.turn - since >= self.after:
                del self.out_since[name]
                self.come_back[name] = self.come_back.get(name, 0) + 1
                game.put(agent)


@dataclass
class TimeLimit:
    """The game ends after so many turns."""

    turns: int
    winner: object = LEADER
    rank = 5

    def play(self, game):
        """End it."""
        if game.turn >= self.turns:
            game.end("time limit", leader(game) if self.winner is LEADER else self.winner, truncated=True)


@dataclass
class LastTeam:
    """The game ends when the living agents are of one team, or of none."""

    rank = 5

    def play(self, game):
        """End it."""
        teams = {agent.team for agent in game.living() if agent.team is not None}
        if len(teams) < 2:
            team = next(iter(teams), None)
            game.end("last team", team)


@dataclass
class NoneLeft:
    """The game ends when no agent of a team is left."""

    team: object
    winner: object = LEADER
    rank = 5

    def play(self, game):
        """End it."""
        if not any(agent.team == self.team for agent in game.living()):
            reason = f"all agents of {self.team} arrived or were eliminated"
            game.end(reason, leader(game) if self.winner is LEADER else self.winner)


@dataclass
class Arrive:
    """Each agent of a team that reaches a goal scores and is out."""

    team: object
    nodes: object
    score: float = 1
    passing: bool = True
    rank = 0

    def play(self, game):
        """Count those that arrive."""
        goals = places_of(game, self.nodes)
        find = reaches if self.passing else ends
        arrived = []
        for agent in game.living():
            there = [(time, node) for time, node in find(agent) if node in goals]
            if agent.team == self.team and there:
                arrived.append(agent)
                game.emit("arrive", agent=agent.name, node=min(there)[1])
                game.score(self.team, self.score)
        for agent in arrived:
            game.eliminate(agent)


RULES = {
    "territory:published": Published,
    "tag": Tag,
    "capture_flag": CaptureFlag,
    "arrive": Arrive,
    "respawn": Respawn,
    "time_limit": TimeLimit,
    "last_team": LastTeam,
    "none_left": NoneLeft,
}


def publish_beforehand(game, rule):
    """Publish what strategies have to know from the beginning."""
    if isinstance(rule, Published):
        rule.play(game)
    elif isinstance(rule, CaptureFlag):
        rule.publish(game)
