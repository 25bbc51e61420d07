"""The observations of agents in the states of a solved game."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import product
from sys import maxsize

from gamms.context import Context
from gamms.solve.table import Table, explore
from gamms.solve.worlds import as_sorted
from gamms.typing import IAgent

_CHANCY = ("detection", "position_noise_m", "false_alarm_rate", "delay_turns")  # settings that make a sensor unreliable


class SensorObserver:
    """Places agents as in a state, and reads their sensors.

    Args:
        ctx: a context with the game.
        table: its states.

    Attributes:
        is_full: whether the game gives agents full information.
        may_stop_moves: whether agents may end a turn elsewhere than at their chosen node.
    """

    def __init__(self, ctx: Context, table: Table) -> None:
        self._table = table
        self._agents = [ctx.agent.get_agent(name) for name in table.roster.names]
        self._seen: dict[tuple[int, ...], tuple[str, ...]] = {}
        settings = ctx.game.settings()
        self.is_full: bool = settings["information"] == "full"
        self.may_stop_moves = settings["conflicts"] is not None or any(one.phase == "deeds" for one in ctx.game.rules)

    def observe(self, state: int, moved: Mapping[str, int] | None = None) -> tuple[str, ...]:
        """Return the observation of each agent in a state, as a text of its position and sensor data; "" if it is out.

        Args:
            state: the number of the state.
            moved: agents that have moved since -> their current nodes.
        """
        table = self._table
        since = moved or {}
        who = zip(table.roster.names, table.nodes[state].tolist(), table.alive[state].tolist(), strict=True)
        places = tuple(since.get(name, node) if is_alive else -1 for name, node, is_alive in who)
        if places not in self._seen:
            for agent, node in zip(self._agents, places, strict=True):
                agent.alive = node >= 0
                if node >= 0:
                    agent.prev_node_id = node
                    agent.current_node_id = node
            self._seen[places] = tuple([self._describe_look(agent) if agent.alive else "" for agent in self._agents])
        return self._seen[places]

    def _describe_look(self, agent: IAgent) -> str:
        return repr(as_sorted(agent.get_state().copy()))

    def is_reliable(self, agent: int) -> bool:
        """Return whether an agent's sensors work without chance, noise and delay."""
        sensors = self._agents[agent].sensors.values()
        return not any(getattr(sensor, name, None) for sensor, name in product(sensors, _CHANCY))


@contextmanager
def open_observer(table: Table) -> Iterator[SensorObserver]:
    """Make an observer for the states of a table, and terminate its context afterwards."""
    with table.setup.scenario.build(table.setup.seed) as ctx:
        yield SensorObserver(ctx, table)


def find_sensor_information(table: Table) -> dict[str, str]:
    """Return how much the sensors of each deciding team show; see `Solution.sees`."""
    if table.sorted_agents is not None:  # sensors may tell agents apart that are sorted
        table = explore(table.setup._replace(max_states=maxsize), by_winner=table.by_winner)
    with open_observer(table) as observer:
        if observer.is_full:
            return dict.fromkeys(table.setup.teams, "full")
        return {team: _find_observability(table, observer, side) for side, team in enumerate(table.setup.teams)}


def _find_observability(table: Table, observer: SensorObserver, side: int) -> str:
    """Return "full", "team" or "agent": who in a team can tell all positions from observations."""
    members = table.list_members(side).tolist()
    groups = [(agent,) for agent in members]
    if not all(observer.is_reliable(agent) for agent in members):
        return "agent"
    if all(_has_distinct_observations(table, observer, group) for group in groups):
        return "full"
    return "team" if len(members) > 1 and _has_distinct_observations(table, observer, tuple(members)) else "agent"


def _has_distinct_observations(table: Table, observer: SensorObserver, agents: tuple[int, ...]) -> bool:
    """Return whether observations of some agents together determine all positions, in states where one is alive."""
    known: dict[tuple[str, ...], tuple[tuple[int, ...], tuple[bool, ...]]] = {}
    states = [state for state in range(len(table)) if table.offsets[state] < table.offsets[state + 1]]
    for state in states:
        if not table.alive[state, list(agents)].any():
            continue
        places = tuple(table.nodes[state].tolist()), tuple(table.alive[state].tolist())
        seen = observer.observe(state)
        if known.setdefault(tuple(seen[agent] for agent in agents), places) != places:
            return False
    return True
