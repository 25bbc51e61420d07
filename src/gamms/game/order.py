"""The agents of a game in the order of a turn, dead or alive, with data that each turn needs."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cached_property, partial
from itertools import chain
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
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext

DECIDED_OUTSIDE = Plan(lambda _: None)  # it is not called: agents only get their states


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
        """Return the keys of the agents' draws in games of a seed, (agents,); see `kernels.compute_first_key_rows`."""
        # NOTE: looking them up by 100,000 names takes as long as the draws of a turn (benchmarks: teams).
        if self._draw_keys is None or self._draw_keys[0] != seed:
            purpose = np.array([kernels.compute_purpose_key(seed, "agent")], np.uint64)
            self._draw_keys = seed, kernels.compute_first_key_rows(purpose, self.name_keys())
        return self._draw_keys[1]


class TurnPart:
    """Agents that decide and move simultaneously: all agents, or those of some teams.

    The slot of an agent is made when it first takes part in a turn: an agent that never lives has no memory.

    Args:
        slots: the slots of all agents.
        moving: all agents; tells which take part.
        members: the indices of the agents' slots; None: all.
        settings: the settings of the game.
        is_whole: whether it is a part of the order of play; or some agents of one.

    Attributes:
        members: the indices of the slots.
        in_core: the part in the form of the core, see `prepare`; None: it is not made yet.
        on_ground: the indices of the slots of agents on the ground; None: all agents.
        ground: the rows of these agents.
        paced: the indices of the slots of agents on the ground that may be on an edge.
        decides_at_arrivals: whether some agents decide at each arrival.
    """

    def __init__(
        self,
        slots: Slots,
        moving: MovingAgents,
        members: list[int] | None,
        settings: Settings,
        *,
        is_whole: bool = True,
    ) -> None:
        self._slots = slots
        self._moving = moving
        self._is_whole = is_whole
        self._plans = settings.plans
        self._are_usual = settings.team_memory and settings.time_budget is None and not settings.channels
        self.members: Sequence[int] = range(len(slots)) if members is None else members
        self.in_core: PartInCore | None = None
        self._commanded: tuple[bytes, list[PlannedAgents]] | None = None
        self._given: list[PlannedAgents] = []
        self._take_ground()
        self.decides_at_arrivals = settings.decide == "arrival" and slots.travel and bool(self.paced)

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

    def begin_more(self) -> None:
        """Forget the data of agents, which are made when they first take part: some do so now."""
        self.in_core = None
        for name in ("_group_teams", "observing", "asked", "see_world_only", "individuals"):
            self.__dict__.pop(name, None)

    @cached_property
    def _group_teams(self) -> dict[Any, Sequence[int]]:
        """Team -> the indices of the slots of those of its agents that have taken part."""
        teams = self._slots.teams
        has_begun = self._moving.has_begun
        begun = self.members if 0 not in has_begun else [i for i in self.members if has_begun[i]]
        # NOTE: a tenth of the time of a set (benchmarks: deletion).
        if begun and teams.count(teams[begun[0]]) == len(teams):
            return {teams[begun[0]]: begun}
        of_team: dict[Any, list[int]] = {}
        for i in begun:
            of_team.setdefault(teams[i], []).append(i)
        return {**of_team}

    @cached_property
    def observing(self) -> Sequence[int]:
        """The indices of the slots of agents whose sensors are called."""
        slots = self._slots
        of_team = self._group_teams
        seeing = [team for team in of_team if not (team in self._plans and self._plans[team].arrays)]
        found: Sequence[int] = []
        if seeing:
            found = of_team[seeing[0]] if len(seeing) == 1 else sorted(chain.from_iterable(of_team[t] for t in seeing))
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
        return all(slot.sees_world_only for slot in self._slots.get_slots(self.observing))

    @cached_property
    def individuals(self) -> list[DecidingAgent]:
        """The agents without a plan in the form of the core.

        Empty if there are channels or a time budget, or teams share no memory.
        """
        return [slot.asked for slot in self._slots.get_slots(self.asked)] if self._are_usual else []

    @property
    def commanded(self) -> list[PlannedAgents]:
        """The agents with a plan that take part, by team. No slots are made for agents with a plan of arrays."""
        lives = self._moving.lives
        if self._commanded is None or self._commanded[0] != lives:
            self._commanded = lives, self._list_commanded() + self._given
        return self._commanded[1]

    def _list_commanded(self) -> list[PlannedAgents]:
        slots = self._slots
        plans = self._plans
        found = []
        for team, begun in self._group_teams.items():
            indices = self._moving.select_present(begun) if team in plans else ()
            if indices:
                is_all = len(indices) == len(slots)
                names = slots.names if is_all else [slots.names[i] for i in indices]
                members = range(len(slots)) if is_all else indices
                keys = partial(slots.list_keys, indices)
                are_plain = slots.are_plain or all(slots[i].is_plain for i in indices)
                found.append(PlannedAgents(team, plans[team], members, names, keys, are_plain=are_plain))
        return sorted(found, key=lambda one: one.indices[0])

    def select_present(self, indices: Sequence[int]) -> Sequence[int]:
        """Return those of some slots whose agents take part."""
        found: Sequence[int] = self._moving.select_present(indices)
        return found

    def let_observe(self, others: Iterable[int], given: Sequence[int] = ()) -> None:
        """Call the sensors of the agents of some slots, too, who do not decide; all observe before any decides.

        Args:
            others: the slots.
            given: the slots of agents that get their states, too, since their actions come from outside.
        """
        asked = self.asked
        self.observing = sorted({*others, *given, *self.observing})
        self.asked = asked
        self.see_world_only = False
        slots = self._slots
        self._given = []
        for i in given:
            keys = partial(slots.list_keys, [i])
            one = PlannedAgents(slots.teams[i], DECIDED_OUTSIDE, [i], [slots.names[i]], keys, are_plain=False)
            self._given.append(one)

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
            one.sensors if one.template is None else tuple([_number_sensor(look, first) for look in one.sensors])
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
            has_plans=version != NOT_ASKED and not self._plans.keys().isdisjoint(self._group_teams),
            is_paced=bool(self.paced),
            ground=self.ground,
            is_all_ground=self.on_ground is None,
        )

    def select_ground(self, values: Any) -> Any:
        """Return the values of agents on the ground, from one value per slot."""
        if self.on_ground is None:
            return values
        if isinstance(values, memoryview):
            return np.asarray(values)[self.on_ground].data
        return [values[i] for i in self.on_ground]


class ConflictingAgents(NamedTuple):
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
    """The agents of a game in the order of names, dead or alive, with data that each turn needs.

    Agents that die and return change only which agents take part, see `moving`.

    Args:
        slots: the slots of the agents, sorted by name.
        block: the agents.
        settings: the settings of the game.
        order: the order of play: lists of teams that move simultaneously; None: all teams.

    Attributes:
        slots, block: see the arguments.
        agents: all agents, by slot; None: see `list_agents`.
        groups: the order of play.
        has_channels, has_deeds: whether the game has channels and deeds.
        whole: all agents.
        parts: the groups of agents that move simultaneously, in order.
        has_parts: whether there are several groups.
        unlisted: the indices of the slots of agents whose teams are in no group.
        may_be_refused: whether some agents may not take part, because they are unlisted, or unranked in conflicts.
        selection: the rows of all agents.
        moving: all agents in the form of the core.
        blocked: (agents,) the number of stopped moves of each agent that is not yet in its counts.
        entries, rows_version: versions of the agents, apart from their lives.
        in_conflict: the agents as `TurnConflicts` has made them for this order.
        plan: the phases of a turn; None: they are not known.
        acts, conflicts: whether rules act before the moves, and the conflicts, in this plan.
        split: decisions of the core, the agents that are asked beside them, and those for which it decides; see
            `TurnEngine`. None: not known.
        ranked_by: the conflicts of `unranked`.
        unranked: the indices of the slots of agents on the ground whose teams have no rank in these conflicts.
        in_rules: the rows of agents in the rules of the core, (agents,), and the slot of each; -1: it has none.
    """

    # NOTE: slots are read faster than a dict, which is there for cached properties only (benchmarks: 5 against 5 by
    # reset).
    __slots__ = (
        *("__dict__", "_ended", "agents", "block", "blocked", "groups", "has_channels"),
        *("acts", "conflicts", "has_deeds", "has_parts", "in_conflict", "in_rules", "may_be_refused", "moving"),
        *("parts", "plan", "ranked_by", "rows_version", "selection", "settings", "slots", "split"),
        *("entries", "unlisted", "unranked", "whole"),
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
        self.settings = settings
        self.agents: list[IAgent] | None = None
        self.entries = block.structure.entries
        self.in_conflict = ConflictingAgents(None, None, None)
        self.plan: TurnPlan | None = None
        self.acts = False
        self.conflicts: object = None
        self.ranked_by: object = None
        self.unranked: list[int] = []
        self.split: tuple[ShippedDecisions, TurnPart | None, TurnPart | None] | None = None
        self.in_rules: tuple[object, Any] = None, None
        self.rows_version = block.rows.version
        self.groups = order
        self.has_channels = bool(settings.channels)
        self.has_deeds = bool(settings.deeds)
        self.selection = slots.selection
        self.blocked = slots.blocked
        self._ended: tuple[int | None, Any] = None, None  # a version of the block, and the nodes at that version
        self.moving = MovingAgents(block, self.selection.buffer, slots.moved.data, slots.blocked.data)
        self.moving.take_lives()
        self.whole = TurnPart(slots, self.moving, None, settings)
        self.parts = [self.whole]
        self.unlisted: list[int] = []
        if order is not None:
            all_teams = self.list_teams()
            listed = {team for teams in order for team in teams}
            self.unlisted = [i for i, team in enumerate(all_teams) if team not in listed]
            members = [[i for i, team in enumerate(all_teams) if team in teams] for teams in order]
            self.parts = [TurnPart(slots, self.moving, some, settings) for some in members]
        self.has_parts = len(self.parts) > 1
        self.may_be_refused = False

    def take_lives(self) -> None:
        """Set which agents take part: those that are alive now."""
        if self.moving.take_lives():
            self.begin_more()

    def begin_more(self) -> None:
        """Prepare agents that take part for the first time."""
        self.split = None
        for part in (self.whole, *self.parts):
            part.begin_more()

    def make_part(self, members: list[int], *, is_whole: bool = True) -> TurnPart:
        """Return some of these agents as a part of a turn, given the indices of their slots."""
        return TurnPart(self.slots, self.moving, members, self.settings, is_whole=is_whole)

    @property
    def names(self) -> list[str]:
        """The names of the agents."""
        return self.slots.names

    @cached_property
    def index_of(self) -> dict[str, int]:
        """Name -> index of the slot."""
        return {name: i for i, name in enumerate(self.names)}

    def list_present(self) -> Sequence[int]:
        """Return the indices of the slots of agents that take part."""
        found: Sequence[int] = self.moving.select_present(self.whole.members)
        return found

    def list_agents(self, agents: Mapping[str, IAgent]) -> list[IAgent]:
        """Return all agents by slot, from agents by name; the same list at each call."""
        if self.agents is None:
            self.agents = [agents[name] for name in self.names]
        return self.agents

    def list_teams(self) -> list[Any]:
        """Return the team of each agent, by slot."""
        return self.slots.teams

    def get_nodes(self) -> Any:
        """Return the node of each agent, by slot, as a view of an array; read-only."""
        version, ends = self._ended
        if version == self.block.version:
            return ends
        return self.block.get_ids(self.selection.gather(self.block.node))

    def end(self, ends: Any) -> None:
        """Take the nodes to which agents of plans were moved, by slot."""
        if not self.block.flyers:
            self._ended = self.block.version, ends

    def update_counts(self) -> None:
        """Add the counted moves and conflicts to the counts of the agents."""
        counted = self.moving.list_counted()
        if counted:
            self.slots.add_counts(counted)
            self.slots.restart_counts()

    def list_counts(self) -> None:
        """Add the counted conflicts, and agents that have taken part or live now, to the counts of the agents."""
        for i in np.flatnonzero(self.blocked).tolist():
            self.slots.get_counts(i)["blocked"] += int(self.blocked[i])
        self.blocked.fill(0)
        lives = self.block.alive
        has_begun = self.moving.has_begun
        is_present = self.entries == self.block.structure.entries
        for i, row in enumerate(self.selection.rows):
            if has_begun[i] or (is_present and lives[row]):
                self.slots.get_counts(i)


def _number_sensor(one: SensorCall, first: dict[Hashable, tuple[int, Any]]) -> SensorCall:
    """Return a sensor with the number of its group of equal sensors, if it can share data."""
    key = getattr(one.sensor, "looks_alike", None)
    if key is None or not hasattr(one.sensor, "shared_look"):
        return one
    number, _ = first.setdefault(key, (len(first), one.sensor))
    return SensorCall(one.name, one.last, one.sensor.type, one.sensor, number)


def make_left_out_error(name: str, team: Hashable) -> BadValue:
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
    nodes = block.get_ids(block.node)
    for name, kind, node, alive in zip(block.names, block.kind, nodes, block.alive, strict=True):
        if alive and not kind and not has_node(node):
            error.add_note(
                f"Agent {name!r} is on node {node}, which is not on the map any more: put it on another one, or "
                "delete it."
            )
            return
