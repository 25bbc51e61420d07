"""The living agents in the order of a turn, with data that each turn needs."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core.agents import MovingAgents
from gamms.core.ask import DecidingAgent, SensorCall
from gamms.core.turn import NOT_ASKED, PartInCore, ShippedDecisions, TurnPlan
from gamms.deciding import Deciders
from gamms.errors import BadValue, UnknownName
from gamms.game.settings import Plan, Settings
from gamms.game.slots import Slots
from gamms.ir.agents import AgentBlock
from gamms.ir.columns import Selection
from gamms.ir.graph import RowArray
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext


class PlannedAgents:
    """The agents of a team that a plan decides for.

    Attributes:
        team, plan: the team and its plan.
        indices: their slots.
        are_plain: whether all move along one edge, on the ground.
        deciders: their names.
        name_keys: returns the hashes of their names.
    """

    def __init__(
        self,
        team: Hashable,
        plan: Plan,
        indices: Sequence[int],
        names: Sequence[str],
        name_keys: Callable[[], BitArray],
        *,
        are_plain: bool,
    ) -> None:
        self.team = team
        self.plan = plan
        self.indices = indices
        self.are_plain = are_plain
        self.deciders = Deciders(f"The plan of team {shown(team)}", tuple(names))
        self.name_keys = name_keys
        self._draw_keys: tuple[int, BitArray] | None = None  # a seed, and the keys

    def draw_keys(self, seed: int) -> BitArray:
        """Return the keys of the agents' draws in games of a seed, (agents,); see `kernels.first_key_rows`."""
        # NOTE: looking them up by 100,000 names takes as long as the draws of a turn (benchmarks: teams).
        if self._draw_keys is None or self._draw_keys[0] != seed:
            purpose = np.array([kernels.purpose_key(seed, "agent")], np.uint64)
            self._draw_keys = seed, kernels.first_key_rows(purpose, self.name_keys())
        return self._draw_keys[1]


class TurnPart:
    """Agents that decide and move simultaneously: all living agents, or those of some teams.

    Args:
        slots: the slots of all living agents.
        members: the indices of the agents' slots; None: all.
        settings: the settings of the game.
        is_whole: whether it is a part of the order of play; or some agents of one.

    Attributes:
        members: the indices of the slots.
        in_core: the part in the form of the core, see `prepare`; None: it is not made yet.
        on_ground: the indices of the slots of agents on the ground; None: all living agents.
        ground: the rows of these agents.
        paced: the indices of the slots of agents on the ground that may be on an edge.
        decides_at_arrivals: whether some agents decide at each arrival.
    """

    def __init__(self, slots: Slots, members: list[int] | None, settings: Settings, *, is_whole: bool = True) -> None:
        self._slots = slots
        self._is_whole = is_whole
        self._plans = settings.plans
        self._are_usual = settings.team_memory and settings.time_budget is None and not settings.channels
        self.members: Sequence[int] = range(len(slots)) if members is None else members
        self.in_core: PartInCore | None = None
        self._take_ground()
        self.decides_at_arrivals = settings.decide == "arrival" and any(slots[i].travels for i in self.paced)

    def _take_ground(self) -> None:
        """Find the agents on the ground, and those that may be on an edge."""
        slots = self._slots
        mine = set(self.members) if slots.flying or slots.paced else set[int]()
        flying = set(slots.flying)
        ground = [i for i in self.members if i not in flying] if flying else self.members
        self.on_ground = None if len(ground) == len(slots) else list(ground)
        rows = slots.selection.rows
        self.ground = slots.selection if len(ground) == len(slots) else Selection([rows[i] for i in ground])
        self.paced = [i for i in slots.paced if i in mine]

    # NOTE: what follows is made when agents are asked, not if the core decides for them (w9 first).

    @cached_property
    def _group_teams(self) -> dict[Any, Sequence[int]]:
        """Team -> the indices of the slots of its agents."""
        teams = self._slots.teams
        if teams and teams.count(teams[0]) == len(teams):  # NOTE: a tenth of the time of a set (benchmarks: deletion).
            return {teams[0]: self.members}
        of_team: dict[Any, list[int]] = {team: [] for team in dict.fromkeys(teams)}
        for i in self.members:
            of_team[teams[i]].append(i)
        return {**of_team}

    @cached_property
    def observing(self) -> Sequence[int]:
        """The indices of the slots of agents whose sensors are called."""
        slots = self._slots
        of_team = self._group_teams
        blind = {team for team in of_team if team in self._plans and self._plans[team].arrays}
        found = [i for i in self.members if slots.teams[i] not in blind] if blind < of_team.keys() else []
        idle = slots.idle() if found else ()
        if idle:  # NOTE: agents that just stand there take no time (benchmarks: teams)
            found = [i for i in found if slots.teams[i] in self._plans or slots.names[i] not in idle]
        return found

    @cached_property
    def asked(self) -> Sequence[int]:
        """The indices of the slots of agents without a plan."""
        slots = self._slots
        return [i for i in self.observing if slots.teams[i] not in self._plans] if self._plans else self.observing

    @cached_property
    def see_world_only(self) -> bool:
        """Whether all sensors look only at the graph and the agents."""
        return all(slot.sees_world_only for slot in self._slots.at(self.observing))

    @cached_property
    def individuals(self) -> list[DecidingAgent]:
        """The agents without a plan in the form of the core.

        Empty if there are channels or a time budget, or teams share no memory.
        """
        return [slot.asked for slot in self._slots.at(self.asked)] if self._are_usual else []

    @cached_property
    def commanded(self) -> list[PlannedAgents]:
        """The agents with a plan, by team. No slots are made for agents with a plan of arrays."""
        slots = self._slots
        plans = self._plans
        found = []
        for team, indices in self._group_teams.items():
            if team in plans and indices:
                is_all = len(indices) == len(slots)
                names = slots.names if is_all else [slots.names[i] for i in indices]
                members = range(len(slots)) if is_all else indices
                keys = partial(slots.keys_of, indices)
                are_plain = slots.are_plain or all(slots[i].is_plain for i in indices)
                found.append(PlannedAgents(team, plans[team], members, names, keys, are_plain=are_plain))
        return found

    def let_observe(self, others: Iterable[int]) -> None:
        """Call the sensors of the agents of some slots, too, who do not decide; all observe before any decides."""
        asked = self.asked
        self.observing = sorted({*others, *self.observing})
        self.asked = asked
        self.see_world_only = False

    def prepare(self, order: "TurnOrder", version: int) -> PartInCore:
        """Return the part in the form of the core.

        Args:
            order: the agents of the turn.
            version: the version of the sensors; those that look alike share a look. `NOT_ASKED`: agents just move.
        """
        first = dict[Hashable, tuple[int, Any]]()  # Any: sensors that share looks are of that package
        individuals = []
        if version != NOT_ASKED and (not self._is_whole or order.whole.individuals):  # memories begin by names
            individuals = self.individuals
        sensors = [
            one.sensors if one.template is None else tuple([_numbered(look, first) for look in one.sensors])
            for one in individuals
        ]
        return PartInCore(
            individuals,
            sensors,
            [*self.asked] if individuals else [],
            [sensor.shared_look() for _, sensor in first.values()],
            version,
            order.moving,
            len(order.slots),
            has_starts=version == NOT_ASKED or bool(order.whole.asked),
            see_world_only=version == NOT_ASKED or self.see_world_only,
            has_plans=version != NOT_ASKED and bool(self.commanded),
            is_paced=bool(self.paced),
            ground=self.ground,
            is_all_ground=self.on_ground is None,
        )

    def of_ground(self, values: Any) -> Any:
        """Return the values of agents on the ground, from one value per slot."""
        if self.on_ground is None:
            return values
        if isinstance(values, memoryview):
            return np.asarray(values)[self.on_ground].data
        return [values[i] for i in self.on_ground]


class InConflict(NamedTuple):
    """The agents of an order with conflicts.

    Attributes:
        conflicts: the conflicts.
        key: the other data that the agents depend on.
        agents: the agents in the form of the core; None: the core does not find the conflicts. Any: the class imports
            this module.
    """

    conflicts: object
    key: object
    agents: Any


class TurnOrder:
    """The living agents in the order of names, with data that each turn needs.

    Args:
        slots: the slots of the agents, sorted by name.
        block: the agents.
        settings: the settings of the game.
        order: the order of play: lists of teams that move simultaneously; None: all teams.

    Attributes:
        slots, block: see the arguments.
        groups: the order of play.
        has_channels, has_deeds: whether the game has channels and deeds.
        whole: all agents.
        parts: the groups of agents that move simultaneously, in order.
        has_parts: whether there are several groups.
        unlisted: the slot of the first agent whose team is in no group; None: there is none.
        selection: the rows of all agents.
        moving: all agents in the form of the core.
        blocked: (agents,) the number of stopped moves of each agent that is not yet in its counts.
        structure_version, rows_version: versions of the agents.
        in_conflict: the agents as `TurnConflicts` has made them for this order.
        plan: the phases of a turn; None: they are not known.
        acts, conflicts: whether rules act before the moves, and the conflicts, in this plan.
        split: decisions of the core, the agents that are asked beside them, and those for which it decides; see
            `TurnEngine`. None: not known.
        ranked_by: the last conflicts in which the team of every agent has a rank.
        in_rules: the rows of agents in the rules of the core, (agents,), and the slot of each; -1: it has none.
    """

    # NOTE: what has slots is read at once, also where there is a dict for what is cached (benchmarks: 5 against 5 by
    # reset).
    __slots__ = (
        *("__dict__", "_ended", "_moved", "block", "blocked", "groups", "has_channels"),
        *("acts", "conflicts", "has_deeds", "has_parts", "in_conflict", "in_rules", "moving", "parts"),
        *("plan", "ranked_by", "rows_version", "selection", "slots", "split", "structure_version", "unlisted", "whole"),
    )

    def __init__(
        self,
        slots: Slots,
        block: AgentBlock,
        settings: Settings,
        order: Sequence[Sequence[Any]] | None,
    ) -> None:
        self.slots = slots
        self.block = block
        self.structure_version = block.structure.version
        self.in_conflict = InConflict(None, None, None)
        self.plan: TurnPlan | None = None
        self.acts = False
        self.conflicts: object = None
        self.ranked_by: object = None
        self.split: tuple[ShippedDecisions, TurnPart | None, TurnPart | None] | None = None
        self.in_rules: tuple[object, Any] = None, None
        self.rows_version = block.rows.version
        self.groups = order
        self.has_channels = bool(settings.channels)
        self.has_deeds = bool(settings.deeds)
        self.whole = TurnPart(slots, None, settings)
        self.parts = [self.whole]
        self.unlisted = None
        if order is not None:
            all_teams = self.all_teams()
            listed = {team for teams in order for team in teams}
            self.unlisted = next((slots[i] for i, team in enumerate(all_teams) if team not in listed), None)
            members = [[i for i, team in enumerate(all_teams) if team in teams] for teams in order]
            self.parts = [TurnPart(slots, some, settings) for some in members]
        self.has_parts = len(self.parts) > 1
        self.selection = slots.selection
        self._moved: RowArray = np.zeros(len(slots), np.int32)  # the number of moves of each agent
        self.blocked: RowArray = np.zeros(len(slots), np.int32)
        self._ended: tuple[int | None, Any] = None, None  # a version of the block, and the nodes at that version
        self.moving = MovingAgents(block, self.selection.buffer, self._moved.data, self.blocked.data)

    @property
    def names(self) -> list[str]:
        """The names of the agents."""
        return self.slots.names

    @cached_property
    def living(self) -> list[IAgent]:
        """The agents."""
        return [slot.agent for slot in self.slots]

    @cached_property
    def index_of(self) -> dict[str, int]:
        """Name -> index of the slot."""
        return {name: i for i, name in enumerate(self.names)}

    @property
    def keys(self) -> BitArray:
        """The hashes of the names, for keyed draws, (agents,)."""
        return self.slots.keys

    def all_teams(self) -> list[Any]:
        """Return the team of each agent, by slot."""
        return self.slots.teams

    def nodes(self) -> Any:
        """Return the node of each agent, by slot, as a view of an array; read-only."""
        version, ends = self._ended
        if version == self.block.version:
            return ends
        return self.block.ids_of(self.selection.of(self.block.node))

    def end(self, ends: Any) -> None:
        """Take the nodes to which agents of plans were moved, by slot."""
        if not self.block.flyers:
            self._ended = self.block.version, ends

    def update_counts(self) -> None:
        """Add the counted moves and conflicts to the counts of the agents."""
        counted = self.moving.counted()
        if counted:
            self._add_to_counts(counted)
            self.restart_counts()

    def _add_to_counts(self, indices: list[int]) -> None:
        """Add the counted moves and conflicts of some slots."""
        columns = indices, self._moved[indices].tolist(), self.blocked[indices].tolist()
        for i, moved, blocked in zip(*columns, strict=True):
            counts = self.slots.counts_of(i)
            counts["moves"] += moved
            counts["blocked"] += blocked

    def list_counts(self) -> None:
        """Add the counted conflicts, and agents that have no counts yet, to the counts of the agents."""
        for i in np.flatnonzero(self.blocked).tolist():
            self.slots.counts_of(i)["blocked"] += int(self.blocked[i])
        self.blocked.fill(0)
        self.slots.list_counts()

    def restart_counts(self) -> None:
        """Set the counters to 0."""
        self._moved.fill(0)
        self.blocked.fill(0)


def _numbered(one: SensorCall, first: dict[Hashable, tuple[int, Any]]) -> SensorCall:
    """Return a sensor with the number of its group of equal sensors, if it can share data."""
    key = getattr(one.sensor, "looks_alike", None)
    if key is None or not hasattr(one.sensor, "shared_look"):
        return one
    number, _ = first.setdefault(key, (len(first), one.sensor))
    return SensorCall(one.name, one.last, one.sensor.type, one.sensor, number)


def left_out(name: str, team: Hashable) -> BadValue:
    """Return the error for an order of play that lacks the team of a living agent."""
    return BadValue(
        f"ctx.game.order leaves out team {shown(team)}, of which agent {name!r} is. Add the team to one of its lists."
    )


def note_lost(error: BaseException, ctx: HostContext) -> None:
    """Add a note to an error that names the first agent on a node that is no longer on the map."""
    if not isinstance(error, UnknownName) or ctx.is_terminated():
        return
    block = ctx.agent.block
    has_node = ctx.graph.graph.has_node
    nodes = block.ids_of(block.node)
    for name, kind, node, alive in zip(block.names, block.kind, nodes, block.alive, strict=True):
        if alive and not kind and not has_node(node):
            error.add_note(
                f"Agent {name!r} is on node {node}, which is not on the map any more: put it on another one, or "
                "delete it."
            )
            return
