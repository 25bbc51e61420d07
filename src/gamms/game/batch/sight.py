"""Which agents the sensors of agents show, in all games of a view at once."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from gamms.arguments import as_array, as_numbers_of
from gamms.errors import BadValue, UnknownName
from gamms.game.batch.columns import Roster, places_of, some_rows
from gamms.game.batch.reports import Lookout, World, reports, split
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import mask_of_pairs
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook, NodeLook
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.sensor_engine import FROM_AIR, IN_AIR, ON_GROUND, ISensor, SensorType

SHOWING_AGENTS = ON_GROUND | IN_AIR
Sighted = Mapping[tuple[int, int], Mapping[str, tuple[IntArray, IntArray]]]
"""Game and agent -> sensor -> the others that it shows, and the rows of nodes where they are reported."""


class Seen(NamedTuple):
    """The agents that agents see, as pairs: by game, then by the agent that sees, then by the name of the other.

    Attributes:
        shape: games and agents of the view, agents of the roster.
        at: (pairs,) the game in the view.
        viewers: (pairs,) the agent of the view that sees.
        others: (pairs,) the number in the roster of the agent that is seen.
        nodes: (pairs,) the row of the node where it is seen.
    """

    shape: tuple[int, int, int]
    at: IntArray
    viewers: IntArray
    others: IntArray
    nodes: IntArray

    @property
    def mask(self) -> BoolArray:
        """Who sees whom, (games, agents of the view, agents of the roster).

        Raises:
            TooLarge: it would take more than 256 MB; the pairs do not.
        """
        use = "at, viewers, others and nodes of view.seen()"
        return mask_of_pairs(self.shape, (self.at, self.viewers, self.others), use)

    def in_games(self, games: IntArray) -> "Seen":
        """Return the pairs of some games, which ascend, as a view of these has them."""
        at = places_of(games, self.shape[0])[self.at]
        return self._replace(shape=(len(games), *self.shape[1:]), at=at).of(at >= 0)

    def with_sights(
        self, sighted: Sighted, names: Sequence[str], who: tuple[IntArray, IntArray], asked: BoolArray
    ) -> "Seen":
        """Return these pairs with others, of which that counts which comes first.

        Args:
            sighted: see `GameArrays`.
            names: of the sensors, which show their own agents; none: all, which do not.
            who: the games of the view by their numbers in the batch, and its agents by those in the roster.
            asked: (games, agents) which agents are asked.
        """
        number, column = ({one: i for i, one in enumerate(of.tolist())} for of in who)
        parts = list[tuple[IntArray, ...]]()
        for (game, agent), of_agent in sighted.items():
            if game in number and agent in column and asked[number[game], column[agent]]:
                for others, nodes in [sight for name, sight in of_agent.items() if name in names or not names]:
                    looking = np.full_like(others, number[game]), np.full_like(others, column[agent])
                    counts = (others != agent) | bool(names)
                    parts.append(tuple(part[counts] for part in (*looking, others, nodes)))
        return self.joined(parts)

    def joined(self, parts: Sequence[tuple[IntArray, ...]]) -> "Seen":
        """Return these pairs with others, the columns of each part, of which that counts which comes first."""
        own = self.at, self.viewers, self.others, self.nodes
        at, viewers, others, nodes = (np.concatenate(columns) for columns in zip(own, *parts, strict=True))
        keys = (at * self.shape[1] + viewers) * self.shape[2] + others
        _, first = np.unique(keys, return_index=True)
        return Seen(self.shape, at[first], viewers[first], others[first], nodes[first])

    def of(self, chosen: BoolArray | IntArray) -> "Seen":
        """Return some of the pairs: which, (pairs,), or their places.

        Raises:
            BadType, BadValue: there are no such pairs.
        """
        if getattr(chosen, "dtype", None) == np.bool_:
            return some_rows(self, as_array(chosen, "chosen", "booleans", self.at.shape))
        return some_rows(self, as_numbers_of(chosen, "chosen", len(self.at), "pairs").reshape(-1))


def looks_of(
    agent: IAgent,
    names: Sequence[str],
    *,
    may_lack_forms: bool = False,
    left_out: Collection[str] = (),
    kinds: Collection[SensorType] = SHOWING_AGENTS,
) -> list[AgentLook]:
    """Return how the sensors of an agent show agents: those of these names, or all of these kinds."""
    carried, found = getattr(agent, "sensors", {}), []
    for name in carried:
        if (not names or name in names) and carried[name].type in kinds and name not in left_out:
            why = why_not_seen(agent, name)
            if why is not None:
                if may_lack_forms:
                    continue
                raise BadValue(f"{why[0].upper()}{why[1:]}, and so has no array form.")
            found.append(carried[name].in_arrays(agent.name))
    return found


def look_of(sensor: ISensor, agent: IAgent) -> AgentLook | None:
    """Return how a sensor shows other agents to one, to be computed for many games; None: that has no array form."""
    look = sensor.in_arrays(agent.name) if sensor.type in SHOWING_AGENTS and hasattr(sensor, "in_arrays") else None
    return look if isinstance(look, AgentLook) else None


def _all_looks(agent: IAgent) -> list[AgentLook]:
    looks = [look_of(sensor, agent) for sensor in getattr(agent, "sensors", {}).values()]
    return [look for look in looks if look is not None]


def looks_from_the_air(agent: IAgent) -> bool:
    """Return whether an agent carries a sensor that looks from the air; one on the ground may, at a place."""
    return any(sensor.type in IN_AIR | FROM_AIR for sensor in getattr(agent, "sensors", {}).values())


def reports_late(agent: IAgent) -> bool:
    """Whether a sensor of an agent reports what it saw in an earlier turn."""
    return any(look.delay for look in _all_looks(agent))


def turns_with_its_agent(agent: IAgent) -> bool:
    """Whether a sensor of an agent has a field of view that turns with it."""
    sensors = getattr(agent, "sensors", {}).values()
    looks = [one.nodes_in_arrays() for one in sensors if hasattr(one, "nodes_in_arrays")]
    return any(not isinstance(look, str) and look.turns for look in (*looks, *_all_looks(agent)))


def why_not_seen(agent: IAgent, name: str) -> str | None:
    """Return in words why a sensor that shows agents has no array form; None: it has one, or shows no agents."""
    sensor = agent.sensors[name]
    if sensor.type not in SHOWING_AGENTS:
        return None
    form = getattr(sensor, "in_arrays", None)
    look = "is of a class of its own" if form is None else form(agent.name)
    return f"the sensor {shown(name)} of agent {shown(agent.name)}, which {look}" if isinstance(look, str) else None


def names_of(agents: Sequence[IAgent], numbers: IntArray) -> list[str]:
    """Return the names of the sensors of agents of a roster that show agents."""
    carried = [getattr(agents[number], "sensors", {}) for number in numbers.tolist()]
    return sorted({name for one in carried for name, sensor in one.items() if sensor.type in SHOWING_AGENTS})


def noted_node_sensors(agent: IAgent) -> list[str]:
    """Return the sensors of an agent that show nodes and turn with it, which only the turn engine can ask."""
    found = []
    for name, sensor in getattr(agent, "sensors", {}).items():
        look = sensor.nodes_in_arrays() if hasattr(sensor, "nodes_in_arrays") else None
        if isinstance(look, NodeLook) and look.turns:
            found.append(name)
    return found


def noted_sensors(agent: IAgent) -> list[str]:
    """Return the sensors of an agent that show agents, that which counts first, if only the turn engine can ask one.

    In games that are played one by one it asks those that look from the air, turn with the agent, report late, or are
    of a class of their own.
    """
    carried = getattr(agent, "sensors", {})
    looks = [look_of(one, agent) for one in carried.values() if one.type in SHOWING_AGENTS]
    is_odd = any(look is None or look.quat is not None or look.turns or look.delay for look in looks)
    ground, air = ([name for name, one in carried.items() if one.type in kinds] for kinds in (ON_GROUND, IN_AIR))
    return [*ground[::-1], *air] if is_odd else []


def lookouts(
    roster: Roster,
    numbers: IntArray,
    names: Sequence[str],
    *,
    may_lack_forms: bool = False,
    left_out: Mapping[int, Collection[str]] | None = None,
    kinds: Collection[SensorType] = SHOWING_AGENTS,
) -> list[Lookout]:
    """Return the sensors of agents of a roster, those that look alike together; of these names, or all.

    Args:
        roster: of the batch.
        numbers: of the agents.
        names: of sensors.
        may_lack_forms: whether those without an array form are left out.
        left_out: agent -> its sensors that are left out.
        kinds: of sensors; the others are left out.
    """
    agents = roster.agents
    unknown = [name for name in names if name not in names_of(agents, numbers)]
    if unknown:
        raise UnknownName("sensor that shows agents", unknown[0], names_of(agents, numbers))
    found: dict[tuple[AgentLook, int], tuple[AgentLook, list[tuple[int, int]], list[tuple[str, str] | None]]] = {}
    for column, number in enumerate(numbers.tolist()):
        carried = Counter[AgentLook]()  # an agent may carry several that look alike
        without = (left_out or {}).get(number, ())
        looks = looks_of(agents[number], names, may_lack_forms=may_lack_forms, left_out=without, kinds=kinds)
        for order, look in enumerate(looks):
            key = look.what
            _, columns, draws = found.setdefault((key, carried[key]), (look, [], []))
            columns.append((column, order))
            draws.append(look.draws)
            carried[key] += 1
    made = []
    for look, listed, draws in found.values():
        among, ranks = np.array(listed).T
        made.append(Lookout(look, among, numbers[among], _shown(roster, look), draws, ranks))
    return made


def _shown(roster: Roster, look: AgentLook) -> IntArray:
    """Return the numbers of the agents that a sensor shows where they are in view."""
    return np.flatnonzero(np.array([look.shows(team) for team in roster.teams], np.bool_)[roster.team_of])


def seen(
    state: GameArrays,
    games: IntArray,
    agents: IntArray,
    asked: BoolArray,
    looks: Sequence[Lookout],
    *,
    with_own: bool = False,
) -> Seen:
    """Return which agents some agents see."""
    world, roster, found = World(state, games), len(state.roster.names), list[tuple[IntArray, ...]]()
    for lookout in looks:
        for at, carriers, others, places in reports(world, lookout, asked, with_own=with_own):
            looking = at * len(agents) + lookout.columns[carriers]
            found.append((looking * roster + lookout.others[others], places, lookout.order[carriers]))
    none = np.zeros(0, np.int64)
    keys, nodes, order = (np.concatenate(parts) for parts in zip((none, none, none), *found, strict=True))
    if len(looks) > 1 or any(one.look.false_alarms for one in looks):  # of what several sensors show, the last counts
        by_key = np.lexsort((order, keys))
        kept = by_key[np.append(np.diff(keys[by_key]) != 0, True)[: len(keys)]]
        keys, nodes = keys[kept], nodes[kept]
    looking, shown_agents = split(keys, roster)
    at, viewers = split(looking, len(agents))
    return Seen((len(games), len(agents), roster), at, viewers, shown_agents, nodes)
