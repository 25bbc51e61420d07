"""One game of capture the flag, from start to end, in the paper's own loop."""

from typing import Any

import gamms.typing as contracts
from gamms.agent import Member
from gamms.context import Context
from gamms.demo import strategies
from gamms.demo.rules import RULES
from gamms.demo.world import Team, make_world, starts

SensorType = contracts.SensorType

_DEFENDERS = 2  # of five; at least one of a team of two
_GOAL = 3


class Match:
    """A game in the context whose graph is the map.

    Args:
        ctx: a context with a graph; its seed decides the game.
        teams: the two sides.
        max_turns: the game ends then at the latest.
        goal: it ends earlier when a team has captured the flag that often.

    Raises:
        BadValue: the map is too small or in two pieces.
    """

    def __init__(self, ctx: Context, teams: tuple[Team, Team], max_turns: int, goal: int = _GOAL) -> None:
        self.ctx, self.max_turns, self.goal = ctx, max_turns, goal
        self.world = make_world(ctx, teams)
        self.announced = strategies.Announced({}, {})
        self.start_of: dict[str, int] = {}
        self.turn = 0
        self.scores = [0, 0]
        self.events: list[dict[str, Any]] = []
        self.reason = ""
        self.agents: list[Member] = []
        places = [starts(self.world, team, ctx.stream("demo", "start", team)) for team in (0, 1)]
        for number in range(max(team.size for team in teams)):  # by turns, so that no team always moves first
            for team in (0, 1):
                if number < teams[team].size:
                    self._add_agent(team, number, places[team][number])

    def _add_agent(self, team: int, number: int, node: int) -> None:
        side = self.world.teams[team]
        name = f"{side.name}_{number}"
        self.start_of[name], self.announced.team_of[name] = node, team
        kinds = {"near": SensorType.NEIGHBOR, "map": SensorType.RANGE, "seen": SensorType.AGENT_RANGE}
        sensors = {
            key: self.ctx.sensor.create_sensor(f"{name}/{key}", kind, sensor_range=strategies.SIGHT_M)
            for key, kind in kinds.items()
        }
        play_as = strategies.defend if number < side.size * _DEFENDERS // 5 else strategies.attack
        strategy = play_as(name, self.world, self.announced, self.ctx.stream("demo", "agent", name))
        create = self.ctx.agent.create_agent
        self.agents.append(create(name, start_node_id=node, team=team, sensors=sensors, strategy=strategy))

    def play(self) -> None:
        """Play to the end."""
        while not self.reason:
            self.turn += 1
            for agent in self.ctx.agent.create_iter():
                agent.step()
            for rule in RULES:
                rule(self)
            self.ctx.visual.simulate()

    def note(self, kind: str, agent: Member, other: Member | None = None) -> None:
        """Remember that something happened."""
        event = {"turn": self.turn, "kind": kind, "agent": agent.name, "team": self.world.teams[agent.team].name}
        self.events.append(event if other is None else {**event, "other": other.name})

    def end(self, reason: str) -> None:
        """Let this turn be the last."""
        self.reason = reason

    @property
    def winner(self) -> str | None:
        """The team with more captures; None for a draw."""
        first, second = self.scores
        return None if first == second else self.world.teams[int(second > first)].name


def play(ctx: Context, teams: tuple[Team, Team], max_turns: int) -> Match:
    """Play one game on the map that is the graph of `ctx`."""
    match = Match(ctx, teams, max_turns)
    match.play()
    return match
