"""What agents see: docs/sensors.md, kinds AGENT and AGENT_RANGE."""

from dataclasses import dataclass
from math import hypot, inf


@dataclass
class Sensor:
    """Sees living agents of some teams within a straight-line distance, which may be just that; not its owner."""

    type: str
    range_m: float | None = None
    sensor_range: float | None = None  # the name of `range_m` in 1.0.0
    team: object = None

    def __post_init__(self):
        if self.type.upper() not in ("AGENT", "AGENT_RANGE"):
            raise NotImplementedError(f"not in the subset of the reference: the type of sensor {self.type}")

    def look(self, game, owner):
        """Return name -> node of the agents that are seen, in the order in which they were created."""
        limit = self.range_m or self.sensor_range or 30.0
        reach = inf if self.type.upper() == "AGENT" else limit
        teams = self.team if isinstance(self.team, list) else [self.team]
        x, y = game.streets.xy[owner.node]
        seen = {}
        for agent in game.agents.values():
            is_sought = self.team is None or agent.team in teams
            if agent is owner or not agent.alive or not is_sought:
                continue
            other_x, other_y = game.streets.xy[agent.node]
            if hypot(other_x - x, other_y - y) <= reach:
                seen[agent.name] = agent.node
        return seen


def sensors_of(named, scenario_sensors, made):
    """Return name -> sensor for the key `sensors` of a team or an agent: names, or name -> keys."""
    given = named if isinstance(named, dict) else {name: scenario_sensors[name] for name in named}
    return {name: made(Sensor, "keyword of a sensor", keys) for name, keys in given.items()}
