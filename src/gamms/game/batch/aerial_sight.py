"""Which agents sensors show from the air, AERIAL_AGENT, in all games of a view at once."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import pi
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import Roster
from gamms.game.batch.flights import Flyers
from gamms.game.batch.state import GameArrays
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AerialLook
from gamms.text import shown
from gamms.typing import AgentType
from gamms.typing.agent_engine import IAgent
from gamms.typing.sensor_engine import IN_AIR, ISensor

Sighting = tuple[AgentType, tuple[float, float, float]]  # the kind of an agent, and where it is


class SeenInSpace(NamedTuple):
    """The agents that agents see from the air, as pairs: by agent that sees and its sensors, then by game.

    Attributes:
        at: (pairs,) the game in the view.
        viewers: (pairs,) the agent of the view that sees.
        others: (pairs,) the number in the roster of the agent that is seen.
        xyz: (pairs, 3) where it is.
    """

    at: IntArray
    viewers: IntArray
    others: IntArray
    xyz: FloatArray


def aerial_look_of(sensor: ISensor, agent: IAgent) -> AerialLook | None:
    """Return how a sensor shows agents from the air, to be computed for many games; None: that has no array form."""
    look = sensor.in_arrays(agent.name) if sensor.type in IN_AIR and hasattr(sensor, "in_arrays") else None
    return look if isinstance(look, AerialLook) else None


def looks_from_the_air(agent: IAgent) -> bool:
    """Return whether an agent carries a sensor that shows agents from the air; one on the ground may, at a place."""
    return any(sensor.type in IN_AIR for sensor in getattr(agent, "sensors", {}).values())


def why_not_seen_in_space(agent: IAgent) -> Iterator[str]:
    """Yield in words which sensors of an agent show agents from the air and have no array form."""
    for name, sensor in getattr(agent, "sensors", {}).items():
        form = getattr(sensor, "in_arrays", None)
        look = "is of a class of its own" if form is None else form(agent.name)
        if sensor.type in IN_AIR and isinstance(look, str):
            yield f"the sensor {shown(name)} of agent {shown(agent.name)}, which {look}"


def seen_in_space(
    state: GameArrays, flyers: Flyers, games: IntArray, agents: IntArray, asked: BoolArray, names: Sequence[str]
) -> SeenInSpace:
    """Return which agents some agents see from the air, with sensors of these names, or all sensors.

    Args:
        state: of the batch.
        flyers: its agents that fly.
        games: by their numbers in the batch.
        agents: those that look, by their numbers in the roster.
        asked: (games, agents) which of them look.
        names: of the sensors; none: all.
    """
    none = np.zeros(0, np.int64)
    found, space = [SeenInSpace(none, none, none, np.zeros((0, 3)))], None
    for column, number in enumerate(agents.tolist()):
        agent = state.roster.agents[number]
        carried = getattr(agent, "sensors", {})
        looks = [aerial_look_of(one, agent) for name, one in carried.items() if not names or name in names]
        for look in [one for one in looks if one is not None]:
            space = _in_space(state, flyers, games) if space is None else space
            at = np.flatnonzero(asked[:, column])
            which, others = _pairs(state, flyers, (games[at], number), space[at], look)
            viewers = np.full(len(which), column)
            found.append(SeenInSpace(at[which], viewers, others, space[at[which], others]))
    at, viewers, others, xyz = (np.concatenate(columns) for columns in zip(*found, strict=True))
    return SeenInSpace(at, viewers, others, xyz)


def sightings(seen: SeenInSpace, roster: Roster, rank: IntArray, shape: tuple[int, int]) -> list[dict[str, Sighting]]:
    """Return what is seen as sensors have it in `data`, by game and agent, for so many of them.

    Args:
        seen: with one sensor.
        roster: of the batch.
        rank: (agents,) by which agents are in order.
        shape: games and agents.
    """
    looking = seen.at * shape[1] + seen.viewers
    order = np.lexsort((rank[seen.others], looking))
    kinds, names = (AgentType.BASIC, AgentType.AERIAL), roster.names
    others, places = seen.others[order], seen.xyz[order].tolist()
    flies = roster.flies[others].tolist()
    listed = [
        (names[number], (kinds[is_flying], (x, y, z)))
        for number, is_flying, (x, y, z) in zip(others.tolist(), flies, places, strict=True)
    ]
    ends = np.cumsum(np.bincount(looking, minlength=shape[0] * shape[1])).tolist()
    return [dict(listed[a:b]) for a, b in pairwise([0, *ends])]


def _in_space(state: GameArrays, flyers: Flyers, games: IntArray) -> FloatArray:
    """Return where all agents of some games are, (games, agents, 3); on an edge as high as the node passed last."""
    node = state.node[games]
    which = np.broadcast_to(games[:, None], node.shape), np.indices(node.shape)[1]
    xyz = np.concatenate((state.movement.places(node, which).xy, flyers.ground_z[node][..., None]), axis=-1)
    flyers.put_into(xyz, games)
    return xyz


def _pairs(
    state: GameArrays, flyers: Flyers, looking: tuple[IntArray, int], space: FloatArray, look: AerialLook
) -> tuple[IntArray, IntArray]:
    """Return which of some games an agent looks in, by their places, and which agents it sees there."""
    games, number = looking
    roster, carrier = state.roster, np.searchsorted(flyers.agents, number)
    is_shown = np.array([look.shows(team) for team in roster.teams], np.bool_)[roster.team_of]
    if look.place is None:
        is_shown[number] = False
        here = flyers.xyz[games, carrier]
    else:
        here = np.broadcast_to(look.place, (len(games), 3))
    at, others = np.nonzero(state.alive[games] & is_shown)
    offsets = space[at, others] - here[at]
    with np.errstate(over="ignore"):
        is_near = np.einsum("ij,ij->i", offsets, offsets) <= look.radius * look.radius
    is_near &= offsets.any(axis=1)
    at, others, offsets = at[is_near], others[is_near], offsets[is_near]
    if look.fov >= 2.0 * pi:
        return at, others
    ends, is_ahead = np.searchsorted(at, np.arange(len(games) + 1)).tolist(), np.zeros(len(at), np.bool_)
    for i, (first, last) in enumerate(pairwise(ends)):
        if last > first:
            quat = look.quat
            if look.place is None:
                quat = kernels.multiply_quaternions(flyers.quat[games[i], carrier].tolist(), look.quat)
            axis = kernels.quaternion_to_direction(quat)
            is_ahead[first:last] = kernels.in_view(offsets[first:last], axis, look.fov)
    return at[is_ahead], others[is_ahead]
