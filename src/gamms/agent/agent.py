"""The agents that users hold: views of one row of a block, with sensors and a strategy."""

from abc import abstractmethod
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from copy import deepcopy
from math import hypot
from threading import get_ident
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

from gamms import kernels
from gamms.agent.carried_sensors import make_carried
from gamms.arguments import as_bool, as_float, as_key, as_name, as_range, explain_misspelled
from gamms.core.agents import AgentView
from gamms.deciding import (
    ContextPart,
    DecidePhase,
    get_phase,
    refuse_to_judges,
    refuse_unknown_look,
    refuse_while_deciding,
)
from gamms.errors import (
    BadType,
    BadValue,
    ContextTerminated,
    GammsError,
    MissingKey,
    ReservedName,
    UnknownName,
)
from gamms.ir import events
from gamms.ir.agents import AgentBlock, Position, Quat, get_speed
from gamms.ir.graph import FloatArray
from gamms.ir.schema import NUMBERS, SETTABLE, Column
from gamms.progress import delay_interrupts
from gamms.readonly import ReadOnly, ReadOnlyMapping, answer_names
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.actions import (
    as_heading,
    as_node,
    as_position,
    as_quat,
    check_mode,
    check_node,
    find_above,
    get_heading,
    make_level_quat,
    make_strategy,
    resolve_flight,
)
from gamms.typing.agent_engine import AgentType, IAerialAgent, IAgent, MaybeNone
from gamms.typing.game import AerialState, AerialStrategy, AsyncStrategy, NodeId, State, Strategy
from gamms.typing.graph_engine import IGraph
from gamms.typing.on_edges import OnEdge, locate
from gamms.typing.sensor_engine import Carried, ISensor, SensorType, find_owner, find_place_of_look, refuse_no_sensor

_KINDS = tuple(AgentType)
_SCALARS = frozenset({str, bytes, int, float, bool, type(None)})
_AT_FIRST = ("_phase", "_ctx", "_block", "_near", "_sensor_list", "_shared", "_carried", "_last", "strategy")


class NoStrategy(GammsError, AttributeError):
    """An agent without a strategy was asked to decide."""


class _DerivedProperty:
    """A property derived from the position of an agent; an attribute set by the caller hides it.

    Programs written for 1.0.0 may use these names for their own attributes.
    """

    def __init__(self, value_of: Callable[["BaseAgent"], Any]) -> None:
        self._value_of = value_of

    def __get__(self, agent: "BaseAgent | None", owner: type) -> Any:
        return self if agent is None else self._value_of(agent)


class _Mode:
    """The edge attribute that says which edges an agent may use; None: all. It is fixed when the agent is created."""

    def __get__(self, agent: "Agent | None", owner: type) -> Any:
        return self if agent is None else agent._block.modes[agent._row]

    def __set__(self, agent: "Agent", value: object) -> None:
        raise ReadOnly(
            "agent.mode cannot be set: it is fixed when the agent is created. Give create_agent mode=, and create "
            "several agents for several modes."
        )


class BaseAgent(AgentView, ContextPart, IAgent):
    """An agent of any kind; subclasses define its start, its position and its actions."""

    # NOTE: the last state is in a list, because setting an attribute checks whether a strategy is running
    # (benchmarks: loop). The caller's attributes are in __dict__.
    __slots__ = ()

    _called = "agent"

    if not TYPE_CHECKING:  # type checkers know that it has no items

        def __getitem__(self, key: object) -> Any:
            # NOTE: without `__getattr__`, see `_make_guarded_kind`.
            is_known = isinstance(key, str) and hasattr(self, key)
            raise BadType(f"An agent is neither a list nor a dict. Write agent.{key if is_known else 'name'}.")

    _SETTABLE: ClassVar = SETTABLE
    _ACTION: ClassVar[str]  # the choice of a strategy, for messages

    strategy: Strategy | MaybeNone  # the function that decides from its state; settable
    _phase: DecidePhase
    _ctx: IContext
    _block: AgentBlock
    _row: int
    _near: Mapping[int, Sequence[int]]  # legal neighbors of each node, for agents on the ground
    _sensor_list: dict[str, ISensor]
    _shared: tuple[ISensor, ...]  # sensors that another agent also carries
    _carried: tuple[Carried, ...]  # the list of sensors in the form that is read fastest
    _last: list[Any]  # the last result of `get_state`

    def __repr__(self) -> str:
        """Return a text with the name and the node, and whether the agent is eliminated."""
        state = "" if self.alive else ", alive=False"
        return f"{type(self).__name__}({self.name!r}, current_node_id={self.current_node_id}{state})"

    def __dir__(self) -> list[str]:
        """Return the names of the attributes that there are."""
        return [name for name in super().__dir__() if name in self.__dict__ or hasattr(type(self), name)]

    def __getstate__(self) -> object:
        """Return the attributes; without this, compiled classes cannot be copied."""
        return super().__getstate__()

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; refused while a strategy is running."""
        if name[0] != "_":
            phase = self._phase
            is_guarded = phase.agent is not None or phase.judge
            if is_guarded or (phase.player is not None and phase.player != get_ident()):
                phase.refuse(f"set agent.{name}", changes_game=name in self._SETTABLE or name == "strategy")
            if name not in phase.known_names:
                if name == "strategy":
                    self.decide_by(None if value is None else make_strategy(self._ctx, value))
                    return
                self._check_name(name)
            self._put_attribute(name, value)
            journal = self._block.journal
            if journal.notes_attributes and name in self.__dict__:
                journal.record_attribute([self._row], name, [value])
            return
        object.__setattr__(self, name, value)

    def __delattr__(self, name: str) -> None:
        """Delete an attribute; refused while a strategy is running."""
        is_noted = name[0] != "_" and name in self.__dict__ and self._block.journal.notes_attributes
        super().__delattr__(name)
        if is_noted:
            self._block.journal.record_attribute([self._row], name, None)

    def _check_name(self, name: str) -> None:
        """Refuse read-only names; warn once per context of a name that looks misspelled."""
        known = getattr(type(self), name, None)
        if isinstance(known, property) and known.fset is None:
            settable = ", ".join(sorted({"strategy", *self._SETTABLE}))
            raise AttributeError(f"agent.{name} cannot be set; {settable} and other names can.")
        self._phase.known_names.add(name)
        if isinstance(known, (GuardedAttribute, type(None))):
            for hint in explain_misspelled([name], sorted({"strategy", *self._SETTABLE}), "attribute"):
                self._ctx.logger.warning(f"Agent {shown(self.name)}: {hint} It is stored as an attribute.")

    def _put_attribute(self, name: str, value: object) -> None:
        """Set an attribute without checks."""
        if type(value) not in _SCALARS and not hasattr(type(self), name):
            kind = _make_guarded_kind(type(self), self._phase.agent_kinds)
            if not hasattr(kind, name):
                setattr(kind, name, GuardedAttribute(name))
            self.__class__ = kind
        object.__setattr__(self, name, value)

    # -- identity -----------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The agent's name."""
        return self._block.names[self._row]

    @property
    def type(self) -> AgentType:
        """The kind of this agent."""
        return _KINDS[self._block.kind[self._row]]

    def _put_in_team(self, team: Hashable) -> None:
        self._set("teams", as_key(team, "A team"))

    @property
    def alive(self) -> bool:
        """Whether the agent takes part; settable. Sensors and `ctx.game` ignore agents that do not."""
        return self._block.alive[self._row]

    @alive.setter
    def alive(self, alive: bool) -> None:
        self._set("alive", as_bool(alive, "alive"))

    @property
    def state(self) -> State:
        """The last result of `get_state`; `{}` before the first call. While agents decide, each sees only its own."""
        phase = self._phase
        phase.read_last_turn()
        if phase.agent is not None and phase.agent is not self and self.name not in phase.list_names():
            phase.refuse(f"read the state of agent {self.name!r}")
        phase.are_memories_known = True
        refuse_unknown_look(self._last[0], f"agent {self.name!r}")
        return self._last[0]  # type: ignore[no-any-return] # of an aerial agent it is another

    @property
    def sensors(self) -> ReadOnlyMapping:
        """The sensors that the agent carries, by their names in its state; read-only."""
        return ReadOnlyMapping(self._sensor_list)

    @property
    def prev_node_id(self) -> int:
        """The previous node, initially its own; settable. A stay keeps it in `ctx.game`, but not in custom loops."""
        return self._block.get_previous_node(self._row)

    @prev_node_id.setter
    def prev_node_id(self, node_id: int) -> None:
        if not self._is_closed:
            self._set("previous", self._check_node(node_id))

    # (source id, target id, edge id); None on a node
    edge = _DerivedProperty(lambda one: getattr(one._get_edge(), "edge", None))
    # distance from the source of the edge, map units
    offset_m = _DerivedProperty(lambda one: getattr(one._get_edge(), "offset_m", 0.0))
    xy = _DerivedProperty(lambda one: one._find_xy())  # where it is, map units

    # -- sensing, deciding, acting ------------------------------------------------------------------------------

    @refuse_to_judges
    def register_sensor(self, name: str, sensor: ISensor) -> None:
        """Carry a sensor; its results appear in the state under `name`.

        Several agents may carry one sensor: it uses the heading of the agent that asks, and leaves this agent out.
        """
        refuse_no_sensor(sensor)
        with delay_interrupts(at_most_once=True):
            self._add_sensor(name, sensor)

    @refuse_to_judges
    def deregister_sensor(self, name: str) -> None:
        """Stop carrying a sensor; an unknown name is only warned about."""
        if as_name(name, "a sensor") not in self._sensor_list:
            self._ctx.logger.warning(f"Agent {self.name!r} has no sensor {name!r} to deregister.")
            return
        with delay_interrupts(at_most_once=True):
            self._remove_sensor(name)

    def _remove_sensor(self, name: str) -> None:
        """Stop carrying a sensor."""
        sensor = self._sensor_list.pop(name)
        if not any(sensor is other for other in self._sensor_list.values()):
            self._shared = tuple(other for other in self._shared if other is not sensor)
        self._carry()
        self._note(events.AGENT_SENSOR_DEREGISTER, name, sensor)
        self._clear_owner(sensor)

    @refuse_to_judges
    def register_strategy(self, strategy: Strategy | AerialStrategy | AsyncStrategy | None) -> None:
        """Set the strategy: a function of the state, or a function that makes one from the context.

        Raises:
            BadType: not such a function, nor None.
        """
        self.strategy = strategy

    @refuse_while_deciding
    def sense(self) -> dict[str, tuple[SensorType, Any]]:
        """Read all sensors; return name -> (kind, data), as in `get_state()["sensor"]`."""
        node = self.current_node_id
        sensed = {}
        place = self._get_edge() if self._sensor_list else None
        on_edge = None if place is None else place.xy
        for sensor, (name, last, *_, look) in zip(self._sensor_list.values(), self._carried, strict=True):
            where: Any = find_place_of_look(sensor, node, on_edge)
            (look or sensor).sense(where)
            sensed[name] = sensor.type, last[0]
        return sensed

    def step(self) -> None:
        """Sense, decide and move; do nothing after the end of the context.

        Raises:
            NoStrategy (AttributeError): the agent has no strategy.
            BadType: the strategy is asynchronous, which only `ctx.game` supports.
        """
        if self._is_closed:
            return
        strategy = self.strategy
        if strategy is None:
            raise NoStrategy(f"Agent {self.name!r} has no strategy. Give it one with register_strategy.")
        answer: Any = strategy(self.get_state())
        if answer is not None and hasattr(type(answer), "__await__"):
            getattr(answer, "close", bool)()  # closes a coroutine that is never run
            raise BadType(f"The strategy of agent {self.name!r} is asynchronous: play with ctx.game.run() or step().")
        self.set_state()

    # -- inside the package -------------------------------------------------------------------------------------

    @refuse_to_judges
    def decide_by(self, strategy: Strategy | AerialStrategy | AsyncStrategy | None) -> None:
        """Set a strategy that is already checked, or None."""
        self._phase.change_strategies()
        self._block.structure.note((self._row,))
        object.__setattr__(self, "strategy", strategy)

    @property
    def _is_closed(self) -> bool:
        return self._block.is_closed

    def _begin(self, ctx: IContext, block: AgentBlock, attributes: Iterable[str]) -> IGraph:
        """Initialize as a view of a row that a subclass adds to a block; check attribute names; return the graph."""
        for key in attributes:
            if key not in self._SETTABLE and not isinstance(
                getattr(type(self), key, None), (_DerivedProperty, type(None))
            ):
                raise ReservedName(key, self._SETTABLE)
        values: tuple[Any, ...] = (get_phase(ctx), ctx, block, {}, {}, (), (), [{}], None)
        for name, value in zip(_AT_FIRST, values, strict=True):
            object.__setattr__(self, name, value)  # NOTE: a third of the time of `__setattr__` (benchmarks)
        return ctx.graph.graph

    @abstractmethod
    def _act(self, action: object) -> None:
        """Perform an action that is not a plain node id."""

    def _check_node(self, node_id: object) -> int:
        return check_node(self._ctx.graph.graph, self._block, node_id)

    def _set(self, column: str, value: object) -> None:
        self._block.set(self._row, column, value)

    def _get_edge(self) -> OnEdge | None:
        progress = self._block.get_edge_position(self._row)
        return None if progress is None else locate(self._ctx.graph.graph, progress)

    def _find_xy(self) -> tuple[float, float]:
        place = self._get_edge()
        if place is not None:
            return place.xy
        node = self._ctx.graph.graph.get_node(self.current_node_id)
        return node.x, node.y

    def _note(self, kind: int, name: str, sensor: ISensor) -> None:
        """Record in the journal that the agent gets or loses a sensor."""
        journal = self._block.journal
        if not journal.is_silent:
            journal.note(kind, {"agent_name": self.name, "name": name, "sensor_id": sensor.sensor_id})

    def _move_to_block(self, block: AgentBlock) -> None:
        """Move to a row of another block: the block of the context, or a new one to leave it; sensors stay."""
        self._row = block.take_over(self._block, self._row)
        self._block = block

    def _copy_to(
        self, ctx: IContext, block: AgentBlock, row: int, equipment: Sequence[Any], memo: dict[int, Any]
    ) -> Self:
        """Return the view of a row in a copy of the context; its attributes are not copied.

        Args:
            ctx: the copy.
            block: the rows of its agents.
            row: the row.
            equipment: the strategy, the sensors, those that another agent also carries, and the last state.
            memo: the memo of `copy.deepcopy`, with the copies of sensors; gets the view.
        """
        kind = type(self)
        twin = kind.__new__(kind)
        memo[id(self)] = twin
        strategy, carried_sensors, shared_sensors, state = equipment
        sensors = {name: deepcopy(sensor, memo) for name, sensor in carried_sensors.items()}
        shared = tuple([deepcopy(sensor, memo) for sensor in shared_sensors])
        near = deepcopy(self._near, memo)
        values = get_phase(ctx), ctx, block, near, sensors, shared, (), [state.copy()], strategy
        for name, value in zip(_AT_FIRST, values, strict=True):
            object.__setattr__(twin, name, value)  # NOTE: see `_begin`
        object.__setattr__(twin, "_row", row)
        if sensors:
            twin._carry()
        return twin

    def _make_last_state(self) -> Any:
        return self._last[0] or self._make_state(self._get_held_data())

    def _refuse_without_action(self) -> None:
        raise MissingKey(
            f"The state of agent {self.name!r} has no 'action': its strategy must set state['action'] to "
            f"{self._ACTION}."
        ) from None

    def _make_state(self, sensed: dict[str, Any]) -> State:
        """Return a state with these sensor results."""
        return cast("State", {"curr_pos": self.current_node_id, "sensor": sensed})

    def _get_held_data(self) -> dict[str, Any]:
        """Return the present data of the sensors without a new look; custom sensors may have no data."""
        held = ((name, sensor.type, getattr(sensor, "data", None)) for name, sensor in self._sensor_list.items())
        return {name: (kind, data) for name, kind, data in held}

    def _add_sensor(self, name: str, sensor: ISensor) -> None:
        as_name(name, "a sensor")
        owner = find_owner(sensor)
        other = None if owner is None else self._ctx.agent.agents.get(owner)
        sensor.set_owner(self._block.names[self._row])
        self._sensor_list[name] = sensor
        self._note(events.AGENT_SENSOR_REGISTER, name, sensor)
        if other is not None and other is not self:
            other._share(sensor)
            self._share(sensor)
        else:
            self._carry()

    def _share(self, sensor: ISensor) -> None:
        """Set this agent as the owner of a sensor before each of its looks, because another agent carries it, too."""
        self._shared = (*(other for other in self._shared if other is not sensor), sensor)
        self._carry()

    def _carry(self) -> None:
        self._block.structure.note((self._row,))
        owner_of_shared = {id(one): self.name for one in self._shared}
        sensors = self._sensor_list.items()
        self._carried = tuple(
            [make_carried(name, one, owner_of_shared.get(id(one)), self._near) for name, one in sensors]
        )

    def _clear_owner(self, sensor: ISensor) -> None:
        if find_owner(sensor) in (None, self.name):  # unless another agent carries it by now
            sensor.set_owner(None)


def _make_number_property(column: Column) -> property:
    """Return the property of an additional number column of agents."""
    return property(
        lambda agent: getattr(agent._block, column.name)[agent._row],
        lambda agent, value: agent._set(column.name, column.check_value(value, column.name)),
    )


for _column in NUMBERS:
    setattr(BaseAgent, _column.name, _make_number_property(_column))


answer_names(BaseAgent, "agent", "is_active is_alive", "Write agent.alive.")


class Agent(BaseAgent):
    """An agent on the ground; `IAgent` documents each call. All other attributes belong to the caller.

    Args:
        ctx: the context.
        name: the agent's name.
        start_node_id: its first node.
        kwargs: become attributes (`team`, `orientation`, `meta`, …).

    Raises:
        KeyError: the node does not exist.
        AttributeError: a keyword names a method or a read-only property.
    """

    __slots__ = ()

    _ACTION = "a node id"

    def __init__(
        self, ctx: IContext, name: str, start_node_id: NodeId, *, _block: AgentBlock | None = None, **kwargs: object
    ) -> None:
        block = AgentBlock(ctx.graph.graph) if _block is None else _block
        mode = check_mode(ctx, block, kwargs.pop("mode", None))
        graph = self._begin(ctx, block, kwargs)
        node = check_node(graph, block, start_node_id)
        object.__setattr__(self, "_near", graph.neighborhoods)
        object.__setattr__(self, "_row", block.add(as_name(name, "an agent"), node, mode=mode))
        for key, value in kwargs.items():
            setattr(self, key, value)

    def _put_on(self, node_id: int) -> None:
        if not self._is_closed:
            self._set("node", self._check_node(node_id))

    @property
    def speed(self) -> Any:
        """The distance it may move per turn of `ctx.game`, in edges or metres; None for one edge. Settable."""
        return get_speed(self._block, self._row)

    @speed.setter
    def speed(self, speed: float | None) -> None:
        if speed is not None:
            as_range(speed, f"speed of agent {self.name!r}")
        self._set("speed", speed)

    mode = _Mode()

    @property
    def orientation(self) -> tuple[float, float]:
        """The heading `(cos, sin)`; (0.0, 0.0) if there is none. Settable: a pair, or None to follow moves."""
        block = self._block
        row = self._row
        heading = block.heading[row]
        if heading is not None:
            return heading
        place = self._get_edge()
        if place is not None:
            return place.ahead
        here = block.get_node(row)
        before = block.get_previous_node(row)
        if here == before:
            return (0.0, 0.0)
        try:
            graph = self._ctx.graph.graph
            _, x1, y1 = graph.get_node(here)
            _, x0, y0 = graph.get_node(before)
        except (UnknownName, ContextTerminated):  # the previous node, or the whole graph, no longer exists
            return (0.0, 0.0)
        distance = hypot(x1 - x0, y1 - y0)
        return ((x1 - x0) / distance, (y1 - y0) / distance) if distance else (0.0, 0.0)

    @orientation.setter
    def orientation(self, heading: tuple[float, float] | None) -> None:
        self._set("heading", None if heading is None else as_heading(heading))

    def _act(self, action: object) -> None:
        heading: Any = ()
        if isinstance(action, dict):
            heading = get_heading(action)
            node = self._check_node(action["node_id"])
        else:
            node = self._check_node(as_node(action, self._ctx.graph.graph))
        self._block.move(self._row, node)
        if heading != ():
            self._set("heading", heading)


class AerialAgent(BaseAgent, IAerialAgent):
    """A flying agent; `IAerialAgent` documents each call. All other attributes belong to the caller.

    Args:
        ctx: the context.
        name: the agent's name.
        start_node_id: its first node; it starts at the node's x and y with z = 0.
        speed: distance per step, map units; not negative.
        position: start position `(x, y, z)` instead of the node.
        kwargs: become attributes (`team`, `quat`, `orientation`, `meta`, …).

    Raises:
        KeyError: the node does not exist.
        BadValue, BadType: an invalid speed, position, quat or orientation.
        AttributeError: a keyword names a method or a read-only property.
    """

    __slots__ = ()

    _SETTABLE = (BaseAgent._SETTABLE | {"quat"}) - {"speed"}
    _ACTION = "a direction (dx, dy, dz)"

    def __init__(
        self,
        ctx: IContext,
        name: str,
        start_node_id: NodeId,
        speed: float,
        position: Sequence[float] | FloatArray | None = None,
        *,
        _block: AgentBlock | None = None,
        **kwargs: object,
    ) -> None:
        block = AgentBlock(ctx.graph.graph) if _block is None else _block
        graph = self._begin(ctx, block, kwargs)
        node = check_node(graph, block, start_node_id)
        units = as_float(speed, f"speed of agent {name!r}")
        if units < 0.0:
            raise BadValue(f"speed of agent {name!r} must not be negative, not {units}.")
        where = find_above(graph, node, 0.0) if position is None else as_position(position)
        self._row = block.add(as_name(name, "an agent"), node, None, where, units)
        for key, value in kwargs.items():
            setattr(self, key, value)

    def __repr__(self) -> str:
        """Return a text with the name and the position, and whether the agent is eliminated."""
        state = "" if self.alive else ", alive=False"
        return f"{type(self).__name__}({self.name!r}, position={self.position}{state})"

    @property
    def position(self) -> Position:
        """The position `(x, y, z)`; settable: the old position becomes `prev_position`, above `prev_node_id`."""
        position: Position = self._block.flights.get_position(self._row)
        return position

    @position.setter
    def position(self, position: Position) -> None:
        self._block.fly(self._row, as_position(position))

    @property
    def prev_position(self) -> Position:
        """The position before the last move."""
        position: Position = self._block.flights.get_previous_position(self._row)
        return position

    @property
    def current_node_id(self) -> int:
        """The node nearest to its x and y; setting it moves the agent there without changing its z."""
        return self._block.find_nearest_node(self._row)

    @current_node_id.setter
    def current_node_id(self, node_id: int) -> None:
        if not self._is_closed:
            self._block.fly(self._row, find_above(self._ctx.graph.graph, self._check_node(node_id), self.position[2]))

    @property
    def quat(self) -> Quat:
        """The rotation `(w, x, y, z)` as a unit quaternion; settable, with any length."""
        quat: Quat = self._block.flights.get_rotation(self._row)
        return quat

    @quat.setter
    def quat(self, quat: Quat) -> None:
        self._block.set_rotation(self._row, as_quat(quat))

    @property
    def orientation(self) -> tuple[float, float]:
        """`(cos, sin)` of the yaw of `quat`; (0.0, 0.0) if it points straight up or down.

        Settable: a pair sets the rotation about the vertical, without pitch and roll; None resets it to face east.
        """
        return kernels.compute_heading(self.quat)

    @orientation.setter
    def orientation(self, heading: tuple[float, float] | None) -> None:
        self._block.set_rotation(self._row, make_level_quat(heading))

    @property
    def speed(self) -> float:
        """The distance it moves at each step, map units."""
        return get_speed(self._block, self._row)  # type: ignore[return-value] # as above

    def get_state(self) -> AerialState:  # type: ignore[override] # an agent of unknown kind is taken for one on the ground
        """Read the sensors; return a fresh dict with `curr_pos`, `quat` and `sensor`."""
        if self._is_closed:
            last: AerialState = self._make_last_state()
            return last
        sensed = self.sense()
        state = self._make_state(sensed)
        self._last[0] = state
        return state

    def _make_state(self, sensed: dict[str, Any]) -> AerialState:  # type: ignore[override] # as above
        return cast("AerialState", {"curr_pos": self.position, "quat": self.quat, "sensor": sensed})

    def _act(self, action: object) -> None:
        position, quat = resolve_flight(self._block, self._row, action)
        if position is not None:
            self._block.fly(self._row, position)
        if quat is not None:
            self._block.set_rotation(self._row, quat)


class GuardedAttribute:
    """An attribute set by the caller; while a strategy runs, reading it returns a read-only copy.

    Args:
        name: name of the attribute, whose value is in the `__dict__` of the agent.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, agent: IAgent | None, owner: type) -> Any:
        if agent is None or self._name not in agent.__dict__:
            raise AttributeError(f"{owner.__name__!r} object has no attribute {self._name!r}")
        return get_phase(agent).protect_value(agent.__dict__[self._name])

    def __set__(self, agent: IAgent, value: object) -> None:
        agent.__dict__[self._name] = value

    def __delete__(self, agent: IAgent) -> None:
        del agent.__dict__[self._name]


def _make_guarded_kind(kind: type, kinds: dict[type, type]) -> type:
    """Return a subclass of an agent class with the attributes of one context, so that the class itself stays unchanged.

    Args:
        kind: class of the agent.
        kinds: the subclasses of the context, by their classes; a new subclass is added.
    """
    # NOTE: `__getattr__` would need no class, but halve the speed of all other reads (benchmarks: the loop).
    found = kinds.get(kind)
    if found is None:
        copied = {name: getattr(kind, name) for name in ("__module__", "__qualname__", "__doc__")}
        found = type(kind)(kind.__name__, (kind,), {"__slots__": (), **copied})
        kinds[kind] = found
        kinds[found] = found
    return found
