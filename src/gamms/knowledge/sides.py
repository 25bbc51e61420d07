"""Sights and messages of the agents of a side in a turn.

A side is a team, or an agent without a team.
"""

from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import IntArray
from gamms.ir.messages import ARRIVALS
from gamms.ir.obstacles import BoolArray
from gamms.text import as_text


def name_side(name: str, team: object) -> str:
    """Return the name of the side of an agent: its team as text, or its own name if it has no team."""
    return name if team is None else as_text(team)


# -- seen -----------------------------------------------------------------------------------------------------------


class AgentPlaces(NamedTuple):
    """Where agents are, and on which side; one item for each agent."""

    names: Sequence[str]
    sides: Sequence[str]
    rows: IntArray  # (agents,) of their nodes, or the nodes below them; -1: unknown
    is_alive: BoolArray  # (agents,)
    is_standing: BoolArray  # (agents,) on its node: neither on an edge nor in the air


class SideLook(NamedTuple):
    """The report of one sensor, as far as it counts for a side.

    Attributes:
        agent: the name of the agent that carries the sensor.
        nodes: rows of the reported nodes.
        field: rows of the nodes that the sensor covers, if it reports only agents.
        reports_all: whether it reports every agent that stands in its field.
        agents: the names of the agents that it reports where they are.
    """

    agent: str
    nodes: IntArray
    field: IntArray
    reports_all: bool
    agents: Collection[str]


class SideKnowledge(NamedTuple):
    """The nodes that a side sees, as ascending rows, and the visible agents of other sides, by name."""

    nodes: IntArray
    agents: Sequence[str]


def find_known(
    sides: Iterable[str], looks: Iterable[SideLook], places: AgentPlaces, nodes: int
) -> dict[str, SideKnowledge]:
    """Return what sides see: side -> its knowledge.

    A side sees the nodes of its living agents, and those that their sensors report or cover. It sees the agents that
    are reported where they are, and those that stand on its nodes. In the field of a sensor that misses agents, reports
    them late or elsewhere, or leaves teams out, only its reports count.

    Args:
        sides: the sides.
        looks: the reports of all sensors.
        places: the agents.
        nodes: the number of nodes of the map.
    """
    living = {name: row for row, name in enumerate(places.names) if places.is_alive[row]}
    clear = {side: np.zeros(nodes + 1, bool) for side in sides}  # the last item is for unknown nodes, row -1
    shaded = {side: np.zeros(nodes + 1, bool) for side in clear}
    reported: dict[str, dict[str, None]] = {side: {} for side in clear}
    for row in living.values():
        if places.sides[row] in clear:
            clear[places.sides[row]][places.rows[row]] = True
    for look in looks:
        side = places.sides[living[look.agent]] if look.agent in living else None
        if side is None or side not in clear:
            continue
        clear[side][look.nodes] = True
        (clear if look.reports_all else shaded)[side][look.field] = True
        reported[side].update(dict.fromkeys(look.agents))
    side_of = dict(zip(places.names, places.sides, strict=True))
    known = {}
    for side, mask in clear.items():
        mask[-1] = False
        standing = np.flatnonzero(places.is_standing & mask[places.rows]).tolist()
        found = reported[side] | dict.fromkeys(places.names[row] for row in standing)
        others = [name for name in found if side_of.get(name) != side]
        known[side] = SideKnowledge(np.flatnonzero((mask | shaded[side])[:-1]), others)
    return known


# -- heard ----------------------------------------------------------------------------------------------------------


def select_heard(entries: Iterable[Mapping[str, Any]], names: Container[str], turn: float) -> Iterator[dict[str, Any]]:
    """Yield the messages that agents have sent or heard, without their fate among others and in later turns.

    Args:
        entries: the log of messages; see `ir.messages`.
        names: the names of the agents.
        turn: the last turn of which they know.
    """
    for entry in entries:
        heard = find_receivers(entry, names, turn)
        if entry["sender"] in names or any(heard.values()):
            yield {**entry, **heard, "lost": [], "jammed": []}


def find_receivers(entry: Mapping[str, Any], names: Container[str], turn: float) -> dict[str, dict[str, int]]:
    """Return which of the agents have heard or overheard a message until a turn, each with its turn of arrival."""
    return {key: {name: at for name, at in entry[key].items() if name in names and at <= turn} for key in ARRIVALS}
