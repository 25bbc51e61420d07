"""Slots: the data of each agent in the turn engine, made on first use."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_range
from gamms.core.ask import DecidingAgent, SensorCall
from gamms.errors import BadValue, GammsError
from gamms.game.deeds import list_lasting
from gamms.game.facts import PrivateForks, get_facts
from gamms.game.random_streams import Draws, DrawTable, TurnGenerator
from gamms.game.settings import Settings
from gamms.ir.agents import AgentBlock
from gamms.ir.columns import AgentSetChange, Selection
from gamms.ir.game_state import GameState
from gamms.ir.graph import RowArray, split_mode
from gamms.kernels.draws import BitArray
from gamms.readonly import thaw
from gamms.text import shown
from gamms.typing import AgentType
from gamms.typing.agent_engine import DeletedAgent, IAgent, TurnAccess
from gamms.typing.context import HostContext
from gamms.typing.sensor_engine import SensorType

COUNTED = ("moves", "blocked", "illegal", "errors", "overruns")


class SlotGame(NamedTuple):
    """The data of a game that its slots share.

    Attributes:
        state: the state of the game.
        table: the seed and the clock of the agents' draws.
        facts: a read-only view of the public facts.
        settings: the settings of the game.
        fork: makes copies of the game for an agent.
    """

    state: GameState
    table: DrawTable
    facts: Mapping[str, Any]
    settings: Settings
    fork: PrivateForks


class AgentSlot:
    """The data of one agent in the turn engine.

    Args:
        agent: the agent.
        access: its row, its sensors and its last state.
        game: the data of the game.

    Attributes:
        agent, game: see the arguments.
        name, team: the agent's name and team.
        row: its current row in the block; orders of earlier turns have the earlier row in `selection`.
        flies: whether it flies.
        speed: its speed per turn, in the unit of the game; None: one edge.
        mode: the edge attribute that says which edges it may use; None: all.
        obeys_turns: whether the turn restrictions of the map bind it.
        travels: whether it may be anywhere on an edge.
        is_plain: whether it moves along one edge, any, on the ground.
        carried: its sensors, prepared for calls.
        last: a list whose only item is the last state that it got.
        shows_doing: whether its state says which deed it is doing.
        sees_world_only: whether all its sensors are built-in, and look only at the graph and the agents.
        foreign: the names of its sensors of users' classes.
        counts: its numbers of moves, blocked moves, and so on; see `COUNTED`.
    """

    __slots__ = (
        *("_asked", "_draws", "_rng", "_template", "agent", "carried", "counts", "flies", "foreign", "game"),
        *(
            "is_plain",
            "last",
            "mode",
            "name",
            "obeys_turns",
            "row",
            "sees_world_only",
            "shows_doing",
            "speed",
            "team",
            "travels",
        ),
    )

    def __init__(
        self,
        agent: IAgent,
        access: TurnAccess,
        game: SlotGame,
    ) -> None:
        settings = game.settings
        self.agent = agent
        self.game = game
        self.name = agent.name
        self.team = agent.team
        self.row, self.carried, self.last = access
        self.flies = agent.type is AgentType.AERIAL
        self.speed = None if self.flies else _get_speed(agent)
        self.travels = not self.flies and settings.legal == "edges" and settings.speed_unit != "edges"
        self.mode: str | None = None if self.flies else getattr(agent, "mode", None)
        self.obeys_turns = self.mode is not None and split_mode(self.mode)[1]
        self.shows_doing = bool(list_lasting(settings.deeds))
        is_slow = self.speed is None and self.mode is None
        self.is_plain = is_slow and not (self.flies or self.travels) and settings.legal == "edges"
        # NOTE: made on demand: an agent with a plan of arrays has no state and draws nothing
        # (benchmarks: teams).
        self._draws: Draws | None = None
        self._rng: TurnGenerator | None = None
        self._template: dict[str, Any] | None = None
        self._asked: DecidingAgent | None = None
        self.foreign: Sequence[str] = ()
        self.sees_world_only = True
        if self.carried:
            self.foreign = [name for name, last, *_ in self.carried if type(last) is not list]
            looks = [look for *_, look in self.carried if look is not None]
            self.sees_world_only = all(getattr(look, "sees_world_only", False) for look in looks)
        self.counts = game.state.counts.setdefault(self.name, dict.fromkeys(COUNTED, 0))

    def copy_for(self, agent: IAgent) -> "AgentSlot":
        """Return the same slot for the copy of the agent in a copied game."""
        twin = AgentSlot.__new__(AgentSlot)
        for name, value in zip(self.__slots__, _values_of(self), strict=True):
            setattr(twin, name, value)
        twin.agent = agent
        return twin

    def is_valid_for(self, agent: IAgent, access: TurnAccess) -> bool:
        """Return whether the slot is still valid for an agent of this game, perhaps in another row."""
        is_own = self.agent is agent and self.last is access.last
        is_equal = self.carried is access.carried and self.team == agent.team
        return is_own and is_equal and (self.flies or self.speed == agent.speed)

    @property
    def draws(self) -> Draws:
        """The agent's keyed draws: `state["draw"]`."""
        if self._draws is None:
            self._draws = Draws(self.game.table, self.name)
        return self._draws

    @property
    def rng(self) -> TurnGenerator:
        """The agent's generator: `state["rng"]`."""
        if self._rng is None:
            self._rng = TurnGenerator(self.game.table, self.name)
        return self._rng

    @property
    def template(self) -> dict[str, Any]:
        """The constant part of the agent's state."""
        if self._template is None:
            self._template = self._make_template()
        return self._template

    @property
    def asked(self) -> DecidingAgent:
        """The agent in the form of the core, for usual turns."""
        agent = self.agent
        if self._asked is None or self._asked.strategy is not agent.strategy:
            is_usual = (self.is_plain or self.travels) and self.mode is None
            is_usual = is_usual and agent.strategy is not None and not self.shows_doing
            template = self.template if is_usual else None
            sensors = tuple([SensorCall(*one) for one in self.carried])
            args = agent, agent.strategy, template, sensors, self.last
            self._asked = DecidingAgent(*args, travels=self.travels, speed=self.speed)
        return self._asked

    def _make_template(self) -> dict[str, Any]:
        state, _, facts, settings, fork = self.game
        return {
            "curr_pos": None,
            **({"quat": None} if self.flies else {}),
            **({"edge": None, "offset_m": 0.0, "xy": None} if self.travels else {}),
            **({"time": 0.0} if settings.decide == "arrival" else {}),
            "sensor": None,
            "name": self.name,
            "team": self.team,
            "turn": 0,
            "legal": (),
            "draw": self.draws,
            "rng": self.rng,
            "memory": state.get_memory(self.name),
            **({"team_memory": None} if settings.team_memory else {}),
            "facts": get_facts(self.name, self.team, state, facts),
            "blocked": self._explain_block(),
            "fork": fork,
            **({"deeds": settings.deeds} if settings.deeds else {}),
            **({"doing": None} if self.shows_doing else {}),
            **({"inbox": [], "outbox": []} if settings.channels else {}),
        }

    def show_blocked(self) -> None:
        """Update the reason in the state why the last action was not executed."""
        if self._template is not None:
            self._template["blocked"] = self._explain_block()

    def set_blocked(self, why: str | None) -> None:
        """Set the reason in the state why the last action was not executed."""
        if self._template is not None:
            self._template["blocked"] = why

    def _explain_block(self) -> str | None:
        blocked = self.game.state.blocked
        return blocked.get(self.name) if blocked else None

    def get_marks(self) -> tuple[Any, Any]:
        """Return how far its random streams have been read in this turn, for `go_to`."""
        return self._draws and self._draws.mark(), self._rng and self._rng.mark()

    def go_to(self, marks: tuple[Any, Any]) -> None:
        """Continue its random streams from marks of this turn."""
        draws, rng = marks
        if draws is not None or self._draws is not None:
            self.draws.go_to(draws)
        if rng is not None or self._rng is not None:
            self.rng.go_to(rng)


_values_of = attrgetter(*AgentSlot.__slots__)


class Slots(Sequence[AgentSlot]):
    """The slots of all agents, dead or alive, in the order of names, each made on first use.

    Args:
        agents: the agent engine. Any: its class cannot be imported here.
        settings: the settings of the game.
        make: makes the slot of an agent from its name, or from a deleted agent of this name.
        idle: returns the names of agents with neither a strategy nor sensors.
        counts: agent -> its counts.
        table: the seed and the clock of the agents' draws.
        before: the slots at an earlier time; None: there are none.
        change: the agents that came, left or changed since then.

    Attributes:
        idle, table: see the arguments.
        has_made: whether any slot is made.
        selection, names, teams: the rows, names and teams of the agents.
        flying: the indices of agents that fly.
        paced: the indices of agents on the ground that may be on an edge.
        travel: whether agents on the ground may be anywhere on an edge.
        moved, blocked: (agents,) the number of moves, and of stopped moves, that is not yet in the counts of each.
        are_plain: whether all agents move along one edge, any, on the ground.
    """

    def __init__(
        self,
        agents: Any,
        settings: Settings,
        make: Callable[[str, IAgent | None], AgentSlot],
        idle: Callable[[], Collection[str]],
        counts: dict[str, dict[str, int]],
        table: DrawTable,
        before: "Slots | None",
        change: AgentSetChange,
    ) -> None:
        block: AgentBlock = agents.block
        selection = Selection([])
        names = list[str]()
        teams = list[Any]()
        made = list[AgentSlot | None]()
        self.has_made: bool = before is not None and before.has_made
        if before is not None:
            selection = before.selection
            names = before.names
            teams = before.teams
            made = before._made
        self.names: list[str] = change.update_list(names, [block.names[row] for row in change.rows])
        self.selection: Selection = selection.follow_change(change)
        self.teams: list[Any] = change.update_list(teams, [block.teams[row] for row in change.rows])
        none: RowArray = np.zeros(len(change.rows), np.int32)
        self.moved: RowArray = none
        self.blocked: RowArray = none.copy()
        if before is not None:
            self.moved, self.blocked = before._hand_over(change, none)
        self._made: list[AgentSlot | None] = change.update_list(made, [None] * len(change.rows))
        self._agents = agents.storage
        self.idle = idle
        self.table = table
        self._make = make
        self._counts = counts
        self._departure: DeletedAgent = agents.storage.last_departure
        self._departed: dict[str, IAgent] = {}
        self._find_kinds(block, settings)
        if change.closed:
            self._renumber(block)
        if before is not None and "keys" in before.__dict__:
            self.keys = change.update_array(
                before.keys, kernels.compute_name_keys(self.names[i] for i in change.places)
            )

    def _find_kinds(self, block: AgentBlock, settings: Settings) -> None:
        """Find the agents that fly, or may be on an edge."""
        kind = block.kind
        has_speed = ~np.isnan(block.speed)
        has_progress = ~np.isnan(block.share)
        rows = self.selection.rows
        self.flying = [i for i, row in enumerate(rows) if kind[row]] if block.flyers else []
        travels = settings.legal == "edges" and settings.speed_unit != "edges"
        self.travel = travels
        some = travels or has_speed.any() or has_progress.any()
        self.paced = [
            i
            for i, row in enumerate(rows if some else ())
            if not kind[row] and (travels or has_speed[row] or has_progress[row])
        ]
        have_modes = any(mode is not None for mode in block.modes)
        if have_modes:
            refuse_modes(settings.legal, [(name, block.modes[row]) for name, row in zip(self.names, rows, strict=True)])
            if settings.decide == "arrival":
                refuse_turns([(name, block.modes[row]) for name, row in zip(self.names, rows, strict=True)])
            if settings.speed_unit == "edges":
                fast = [i for i in self.paced if has_speed[rows[i]]]
                refuse_speeds((self.names[i], block.modes[rows[i]], block.speed[rows[i]]) for i in fast)
        are_slow = not travels and not have_modes and not any(has_speed[rows[i]] for i in self.paced)
        self.are_plain = settings.legal == "edges" and not self.flying and are_slow

    def _renumber(self, block: AgentBlock) -> None:
        """Update the rows of slots, after agents have left."""
        slots = self.list_made()
        for slot, row in zip(slots, block.rows.find_rows([slot.name for slot in slots]), strict=True):
            slot.row = row

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, i: Any) -> Any:
        slot = self._made[i]
        if slot is None:
            self.has_made = True
            name = self.names[i]
            slot = self._make(name, self.departed.get(name))
            self._made[i] = slot
        return slot

    @property
    def block_now(self) -> AgentBlock:
        """The block that has the agents of the game now: in a batch, births and deaths change it."""
        block: AgentBlock = self._agents.present_block
        return block

    @cached_property
    def keys(self) -> BitArray:
        """The hashes of the names, for keyed draws, (agents,)."""
        return kernels.compute_name_keys(self.names)

    def _hand_over(self, change: AgentSetChange, none: RowArray) -> tuple[RowArray, RowArray]:
        """Return `moved` and `blocked` after a change, and set them to 0 here."""
        self.add_counts([i for i in change.gone if self.moved[i] or self.blocked[i]])
        found = change.update_array(self.moved, none), change.update_array(self.blocked, none)
        self.restart_counts()
        return found

    def list_keys(self, indices: Sequence[int]) -> BitArray:
        """Return the keys of the agents at some indices."""
        return self.keys if len(indices) == len(self) else self.keys[indices]

    def get_slots(self, indices: Sequence[int]) -> list[AgentSlot]:
        """Return the slots at some indices."""
        slots = [self._made[i] for i in indices]
        return [self[i] if slot is None else slot for i, slot in zip(indices, slots, strict=True)]

    def get_counts(self, i: int) -> dict[str, int]:
        """Return the counts of an agent; see `COUNTED`."""
        counts = self._counts.get(self.names[i])
        if counts is None:
            counts = dict.fromkeys(COUNTED, 0)
            self._counts[self.names[i]] = counts
        return counts

    def add_counts(self, indices: list[int]) -> None:
        """Add `moved` and `blocked` of some agents to their counts."""
        columns = indices, self.moved[indices].tolist(), self.blocked[indices].tolist()
        for i, moved, blocked in zip(*columns, strict=True):
            counts = self.get_counts(i)
            counts["moves"] += moved
            counts["blocked"] += blocked

    def keep_counts(self) -> Callable[[], None]:
        """Return a function that adds the present `moved` and `blocked` to the counts of agents, and sets both to 0."""
        moved = self.moved.copy()
        blocked = self.blocked.copy()

        def add() -> None:
            self.moved[:] = moved
            self.blocked[:] = blocked
            self.add_counts(np.flatnonzero(moved | blocked).tolist())
            self.restart_counts()

        return add

    def restart_counts(self) -> None:
        """Set `moved` and `blocked` to 0."""
        self.moved.fill(0)
        self.blocked.fill(0)

    def begin_departures(self, last: DeletedAgent) -> None:
        """Count agents as deleted since these slots were made if they were deleted after another one."""
        self._departure = last

    @property
    def departed(self) -> dict[str, IAgent]:
        """Name -> the agent deleted since these slots were current; if several had the name, the first."""
        while self._departure.next is not None:
            self._departure = self._departure.next
            self._departed.setdefault(self._departure.agent.name, self._departure.agent)
        return self._departed

    def list_made(self) -> list[AgentSlot]:
        """Return all slots made so far."""
        return [slot for slot in self._made if slot is not None]

    def set_blocked(self, i: int, why: str | None) -> None:
        """Set the reason in the state of an agent why its last action was not executed, if its slot is made."""
        slot = self._made[i]
        if slot is not None:
            slot.set_blocked(why)

    def show_blocked(self, indices: Sequence[int]) -> None:
        """Update the reasons in the states of agents whose slots are made."""
        for slot in [self._made[i] for i in indices] if self.has_made else ():
            if slot is not None:
                slot.show_blocked()

    def copy_for_agents(self, agents: Any, twin_of: Callable[[IAgent], IAgent]) -> "Slots":
        """Return the same slots for a copied game.

        Args:
            agents: the agent engine of the copy.
            twin_of: returns the copy of an agent, which may be deleted.
        """

        def make(name: str, departed: IAgent | None) -> AgentSlot:
            slot = self._make(name, departed)
            return slot.copy_for(agents.agents.get(name, slot.agent))

        twin = copy(self)
        twin._make = make
        twin._agents = agents.storage
        twin._departed = dict(self.departed)
        twin._departure = agents.storage.last_departure
        twin._made = [None if slot is None else slot.copy_for(twin_of(slot.agent)) for slot in self._made]
        return twin


class SlotMaker:
    """Makes the slots of the agents of a game.

    Args:
        ctx: the context, for its agents.
        state, facts, settings, fork: see `SlotGame`.
    """

    def __init__(
        self,
        ctx: HostContext,
        state: GameState,
        facts: Mapping[str, Any],
        settings: Settings,
        fork: PrivateForks,
    ) -> None:
        self._ctx = ctx
        self._state = state
        self._facts = facts
        self._settings = settings
        self._fork = fork

    def make(self, before: Slots | None, entry: int) -> Slots:
        """Return the slots of all agents by name; previous slots are reused if they are still valid.

        Args:
            before: the slots of the game at an earlier time; None: there are none.
            entry: the number of the last entry of the log of agents at that time.
        """
        agents = self._ctx.agent
        block = agents.block
        known = dict[str, AgentSlot]()
        since = None
        if before is None:
            table = DrawTable(self._ctx.seed, self._state)
        else:
            table = before.table
            since = block.structure.list_changes_since(entry)
        if since is not None and before is not None:
            rows, closed = since
            change = AgentSetChange(before.names, rows, block.names, closed)
            known = {slot.name: slot for i in change.gone if (slot := before._made[i]) is not None}
        else:
            change = AgentSetChange((), range(len(block)), block.names)
            known = {} if before is None else {slot.name: slot for slot in before.list_made()}
        all_agents = agents.agents
        access_of = agents.storage.get_turn_access
        game = SlotGame(self._state, table, self._facts, self._settings, self._fork)

        def make_slot(name: str, departed: IAgent | None) -> AgentSlot:
            agent = all_agents[name] if departed is None else departed
            slot = known.get(name)
            access = access_of(agent)
            if slot is None or not slot.is_valid_for(agent, access):
                return AgentSlot(agent, access, game)
            slot.row = access.row
            return slot

        def idle() -> set[str]:
            if not block.has_teams:
                return set()
            found = {
                name for name, one in zip(block.names, agents.storage.list_strategies(), strict=True) if one is None
            }
            return found and found - {agent.name for agent in agents.storage.list_created() if agent.sensors}

        past = None if since is None else before
        slots = Slots(agents, self._settings, make_slot, idle, self._state.counts, table, past, change)
        if known:
            slots.get_slots([i for i in change.places if slots.names[i] in known])
        return slots


def refuse_modes(legal: str, agents: Iterable[tuple[str, str | None]]) -> None:
    """Refuse agents with a mode in games whose moves follow no edges.

    Args:
        legal: the setting.
        agents: names and modes.

    Raises:
        BadValue: the moves follow none.
    """
    for name, mode in agents:
        if legal == "any" and mode is not None:
            raise BadValue(
                f"Agent {shown(name)} has mode={mode!r}, which says which edges it may use, and with ctx.game.legal = "
                "'any' moves use no edges: leave out mode=, or leave legal='edges'. There, a rule can put an agent on "
                "any node: ctx.game.respawn(agent, node)."
            )


def refuse_turns(agents: Iterable[tuple[str, str | None]]) -> None:
    """Refuse agents that obey turn restrictions and decide on arrival.

    Args:
        agents: names and modes.

    Raises:
        BadValue: one of the modes says that its agents obey turn restrictions.
    """
    for name, mode in agents:
        if mode is None:
            continue
        attribute, obeys_turns = split_mode(mode)
        if obeys_turns:
            raise BadValue(
                f"Agent {shown(name)} obeys turn restrictions (mode {mode!r}), and such agents decide once in a turn: "
                f"leave decide='turn'. Or make it an agent with mode={attribute!r}, whose action is the rest of one "
                f"route that obeys: ctx.graph.shortest_path(a, b, turns={attribute!r}). Of parallel edges it takes the "
                "cheapest."
            )


def refuse_speeds(agents: Iterable[tuple[str, str | None, float | None]]) -> None:
    """Refuse agents that obey turn restrictions and have a speed in edges.

    Args:
        agents: names, modes and speeds.

    Raises:
        BadValue: an agent has a speed, and its mode says that it obeys turn restrictions.
    """
    for name, mode, speed in agents:
        if mode is not None and speed is not None and split_mode(mode)[1]:
            raise BadValue(
                f"An agent that obeys turns moves by one edge or by metres. Agent {shown(name)} has mode={mode!r} and "
                f"speed={float(speed)} in edges per turn: leave out its speed, or set ctx.game.speed_unit = 'metres'."
            )


def _get_speed(agent: IAgent) -> float | None:
    if agent.speed is None:
        return None
    try:
        return as_range(agent.speed, f"speed of agent {agent.name!r}")
    except GammsError as error:
        error.add_note("On the ground it is what ctx.game lets the agent move in a turn; None for one edge.")
        raise


def copy_data(name: str, kind: SensorType, data: object) -> tuple[SensorType, Any]:
    """Return a copy of the data of a user's sensor, which may return the same object to several agents."""
    try:
        return kind, thaw(data)
    except Exception as error:
        error.add_note(f"What the sensor {name!r} shows is copied: every agent gets its own.")
        raise
