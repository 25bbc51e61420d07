"""The order of a turn: the living agents, and what each turn needs of them."""

from collections.abc import Hashable, Iterable, Mapping
from operator import add, ne
from typing import Any, NamedTuple

from gamms.arguments import as_range
from gamms.deciding import Deciders
from gamms.errors import GammsError
from gamms.game.deciders import Plan
from gamms.game.random_streams import Draws, TurnGenerator
from gamms.ir.agents import Selection
from gamms.ir.game_state import GameState
from gamms.text import shown
from gamms.typing import AgentType
from gamms.typing.agent_engine import IAgent, TurnAccess

COUNTED = ("moves", "blocked", "illegal", "errors", "overruns")


class AgentSlot:
    """What the turn engine holds of one living agent.

    Args:
        agent: the agent.
        access: to its sensors and its last state.
        state: of the game.
        seed: of the game.
        facts: a read-only view of what was published.
        follows_edges: whether moves must follow edges.

    Attributes:
        agent: the agent.
        name, team, row: its own.
        flies: whether it is in the air.
        speed: how far it may go in a turn, in the unit of the game; None for one edge.
        is_plain: whether it moves along one edge, on the ground.
        draws, rng: its random numbers.
        carried: its sensors, in the form in which they are asked.
        last: a list whose only item is the state it got last.
        template: its state, but for what changes from turn to turn.
        sees_world_only: whether all its sensors are built-in ones, which look at nothing but the graph and the agents.
        foreign: the names of its sensors of the caller's own classes.
        counts: how often it moved, was blocked, and so on; see `COUNTED`.
    """

    __slots__ = (
        "agent",
        "carried",
        "counts",
        "draws",
        "flies",
        "foreign",
        "is_plain",
        "last",
        "name",
        "rng",
        "row",
        "sees_world_only",
        "speed",
        "team",
        "template",
    )

    def __init__(
        self,
        agent: IAgent,
        access: TurnAccess,
        state: GameState,
        seed: int,
        facts: Mapping[str, Any],
        *,
        follows_edges: bool,
    ) -> None:
        self.agent = agent
        self.name, self.team = agent.name, agent.team
        self.row, self.carried, self.last = access
        self.flies = agent.type is AgentType.AERIAL
        self.speed = None if self.flies else _speed(agent)
        self.is_plain = not self.flies and self.speed is None and follows_edges
        self.draws, self.rng = Draws(seed, state, self.name), TurnGenerator(seed, state, self.name)
        self.template: dict[str, Any] = _with_shared_keys(
            {
                "curr_pos": None,
                **({"quat": None} if self.flies else {}),
                "sensor": None,
                "name": self.name,
                "team": self.team,
                "turn": 0,
                "legal": (),
                "draw": self.draws,
                "rng": self.rng,
                "memory": state.memory_of(self.name),
                "team_memory": None,
                "facts": facts,
            }
        )
        self.foreign = [name for name, _, _, result in self.carried if type(result) is not list]
        self.sees_world_only = all(getattr(sensor, "sees_world_only", False) for _, _, sensor, _ in self.carried)
        self.counts = state.counts.setdefault(self.name, dict.fromkeys(COUNTED, 0))


class Commanded(NamedTuple):
    """The agents of a team that a plan decides for."""

    team: Hashable
    plan: Plan
    indices: list[int]  # of their slots
    deciders: Deciders


class TurnOrder:
    """The living agents in the order of their names, and what each turn needs of them.

    Args:
        slots: of the agents, sorted by name.
        progress: by row of the agents, on the edge that one has covered part of.
        plans: by team.

    Attributes:
        slots: the slots.
        usual: of each agent that no plan decides for, what a usual turn needs, in the form that is read fastest: the
            index of its slot, the agent, its template if it is plain, its sensors and its last state.
        commanded: the agents that plans decide for, team by team.
        observing: the indices of the slots of agents whose sensors are asked.
        selection: the rows of all.
        see_world_only: whether no agent has a sensor that may look at more than the graph and the agents.
        on_ground: the indices of the slots of agents on the ground; None: all.
        ground: the rows of these.
        index_of: name -> index of the slot.
        paced: the indices of the slots of agents on the ground that may cover part of an edge.
    """

    def __init__(self, slots: list[AgentSlot], progress: list[Any], plans: Mapping[Any, Plan]) -> None:
        self.slots = slots
        self.usual = [
            (i, slot.agent, slot.template if slot.is_plain else None, slot.carried, slot.last)
            for i, slot in enumerate(slots)
            if slot.team not in plans
        ]
        self.commanded = [_commanded(slots, team, plans[team]) for team in _teams(slots) if team in plans]
        blind = {i for one in self.commanded if one.plan.arrays for i in one.indices}
        self.observing = [i for i in range(len(slots)) if i not in blind]
        self.see_world_only = all(slots[i].sees_world_only for i in self.observing)
        ground = [i for i, slot in enumerate(slots) if not slot.flies]
        self.on_ground = None if len(ground) == len(slots) else ground
        self.selection = Selection([slot.row for slot in slots])
        self.ground = self.selection if self.on_ground is None else Selection([slots[i].row for i in ground])
        self.index_of = {slot.name: i for i, slot in enumerate(slots)}
        self.paced = [i for i, slot in enumerate(slots) if slot.speed is not None or progress[slot.row]]
        self._moved = [0] * len(slots)

    def of_ground(self, values: list[Any]) -> list[Any]:
        """Return those values, one per slot, that are of agents on the ground."""
        return values if self.on_ground is None else [values[i] for i in self.on_ground]

    def count_moves(self, starts: list[int], ends: list[int]) -> None:
        """Count the agents that have moved."""
        # NOTE: in C, because all agents are counted in every turn (benchmarks/README.md, turns).
        self._moved = list(map(add, self._moved, map(ne, starts, ends)))

    def update_counts(self) -> None:
        """Add the counted moves to the counts of the agents."""
        for slot, moved in zip(self.slots, self._moved, strict=True):
            slot.counts["moves"] += moved
        self.restart_counts()

    def restart_counts(self) -> None:
        """Count moves from here."""
        self._moved = [0] * len(self.slots)


def _teams(slots: list[AgentSlot]) -> Iterable[Hashable]:
    """Return the teams, in the order of their first agents."""
    return dict.fromkeys([slot.team for slot in slots])


def _commanded(slots: list[AgentSlot], team: Hashable, plan: Plan) -> Commanded:
    indices = [i for i, slot in enumerate(slots) if slot.team == team]
    names = tuple([slots[i].name for i in indices])
    return Commanded(team, plan, indices, Deciders(f"The plan of team {shown(team)}", names))


class _Layout:
    """Its instances have the keys that states share."""


def _with_shared_keys(template: dict[str, Any]) -> dict[str, Any]:
    """Return an equal dict whose copies share one table of keys, which has room for the action.

    Python has such dicts for the attributes of instances (PEP 412); without them states would be twice as large, and
    those of 1,000 agents would not stay in the cache (benchmarks/README.md, turns).
    """
    instance = _Layout()
    for key in (*template, "action"):
        setattr(instance, key, template.get(key))
    del instance.action  # type: ignore[attr-defined]
    return instance.__dict__


def _speed(agent: IAgent) -> float | None:
    if agent.speed is None:
        return None
    try:
        return as_range(agent.speed, f"speed of agent {agent.name!r}")
    except GammsError as error:
        error.add_note("On the ground it is what ctx.game lets the agent move in a turn; None for one edge.")
        raise
