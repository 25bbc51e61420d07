"""What agents on the ground and in the air share: a view of one row of the columns, sensors, a strategy."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, ClassVar

from gamms.arguments import as_bool, as_function_of, as_key, as_name
from gamms.deciding import DecidePhase, Guarded, phase_of, refused_while_deciding
from gamms.errors import GammsError, MissingKey
from gamms.ir import events as kinds
from gamms.ir.agents import AgentColumns, Position
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType, IAgent, IMoves, MaybeNone
from gamms.typing.sensor_engine import ISensor, SensorType, refuse_no_sensor
from gamms.typing.state import AerialStrategy, AsyncStrategy, State, Strategy

_KINDS = tuple(AgentType)
_SCALARS = frozenset({str, bytes, int, float, bool, type(None)})


class NoStrategy(GammsError, AttributeError):
    """An agent was told to decide and has no strategy."""


class Member(Guarded, IAgent):
    """An agent of any kind; a subclass says where it begins, where it is and how it acts.

    Args:
        ctx: the context.
        name: the agent's name.
        attributes: the names of what is to become attributes, only checked here.
        position: where it is, if it flies.

    Raises:
        AttributeError: a keyword that is the name of a method or of something read-only.
    """

    # NOTE: slots keep its own attributes close together; the caller's are in __dict__. The last state is in a list,
    # because setting an attribute asks whether a strategy is running (benchmarks/README.md, w2).
    __slots__ = (
        "_act",
        "_carried",
        "_columns",
        "_ctx",
        "_last",
        "_moves",
        "_phase",
        "_row",
        "_sensor_list",
        "_shared",
        "strategy",
    )

    _called = "agent"

    _SETTABLE: ClassVar = frozenset({"alive", "current_node_id", "prev_node_id", "orientation", "speed", "team"})
    _ACTION: ClassVar[str]  # what a strategy is to choose

    strategy: Strategy | MaybeNone
    _act: Callable[[AgentColumns, int, Any], None]  # the writer's way to do its actions

    def __init__(self, ctx: IContext, name: str, attributes: Iterable[str], position: Position | None = None) -> None:
        for key in attributes:
            if key not in self._SETTABLE and hasattr(type(self), key):
                raise AttributeError(f"{key!r} cannot be set when an agent is created.")
        self._phase: DecidePhase = phase_of(ctx)
        self._ctx = ctx
        self._moves = ctx.agent.moves
        self._sensor_list: dict[str, ISensor] = {}
        self._shared: dict[int, ISensor] = {}  # by id(): those that another agent carries, too
        self._carried: tuple[tuple[str, Any], ...] = ()  # the same as the list, in the form that is read fastest
        self._last: list[Any] = [{}]  # what `get_state` returned last
        self.strategy = None
        self._row = 0
        self._columns = AgentColumns()  # of its own, until the engine takes it in
        self._columns.append(as_name(name, "an agent"), 0, None, position)

    def __repr__(self) -> str:
        """Name the agent and where it stands."""
        return f"{type(self).__name__}({self.name!r}, current_node_id={self.current_node_id})"

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Let type checkers read the attributes that a program has given to an agent."""

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute; refused while a strategy is running."""
        if name[0] != "_":
            self._phase.refuse(f"set agent.{name}")
            if name == "strategy" and value is not None:
                as_function_of(value, "A strategy", "the state")
            if type(value) not in _SCALARS and not hasattr(type(self), name):
                setattr(Member, name, _Attribute(name))
        object.__setattr__(self, name, value)

    # -- what it is ---------------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The agent's name."""
        return self._columns.names[self._row]

    @property
    def type(self) -> AgentType:
        """What kind of agent this is."""
        return _KINDS[self._columns.kind[self._row]]

    @property
    def team(self) -> Any:
        """The team it plays for; None for nobody's. Any value that can be a key of a dict will do."""
        return self._columns.teams[self._row]

    @team.setter
    def team(self, team: Any) -> None:
        self._columns.teams[self._row] = as_key(team, "A team")
        self._note(kinds.AGENT_TEAM, team=team)
        self._columns.roster += 1
        self._columns.touched.add(self._row)  # those who look for a team should see it

    @property
    def alive(self) -> bool:
        """Whether it takes part: who does not is neither sensed nor asked nor moved by `ctx.game`. Settable."""
        return self._columns.alive[self._row]

    @alive.setter
    def alive(self, alive: bool) -> None:
        alive = as_bool(alive, "alive")
        self._columns.set_alive(self._row, alive=alive)
        self._note(kinds.AGENT_ALIVE, alive=alive)

    @property
    def state(self) -> State:
        """What `get_state` returned last; `{}` before the first time. While agents decide, each sees only its own."""
        phase = self._phase
        if phase.agent is not None and phase.agent is not self and self.name not in phase.names():
            phase.refuse(f"look into the state of agent {self.name!r}")
        return self._last[0]  # type: ignore[no-any-return] # of an aerial agent it is another

    @property
    def prev_node_id(self) -> int:
        """The node it came from; settable. At first the node it started on."""
        return self._columns.previous[self._row]

    @prev_node_id.setter
    def prev_node_id(self, node_id: int) -> None:
        self._moves.place_previous(self._columns, self._row, node_id)

    # -- sensing, deciding, acting ------------------------------------------------------------------------------

    @refused_while_deciding
    def register_sensor(self, name: str, sensor: ISensor) -> None:
        """Carry a sensor; its results appear in the state under `name`.

        Several agents may carry one sensor: it looks with the heading of the one that asks, and leaves that one out.
        """
        as_name(name, "a sensor")
        refuse_no_sensor(sensor)
        other = self._ctx.agent.agents.get(getattr(sensor, "_owner", None) or "")
        sensor.set_owner(self.name)
        self._sensor_list[name] = sensor
        self._note(kinds.AGENT_SENSOR_REGISTER, name=name, sensor_id=sensor.sensor_id)
        self._carry()
        if other is not None and other is not self:
            other._share(sensor)
            self._share(sensor)

    @refused_while_deciding
    def deregister_sensor(self, name: str) -> None:
        """Carry a sensor no longer; an unknown name is only warned about."""
        as_name(name, "a sensor")
        sensor = self._sensor_list.pop(name, None)
        if not any(sensor is other for other in self._sensor_list.values()):
            self._shared.pop(id(sensor), None)
        self._carry()
        if sensor is None:
            self._ctx.logger.warning(f"Agent {self.name!r} has no sensor {name!r} to deregister.")
        else:
            self._note(kinds.AGENT_SENSOR_DEREGISTER, name=name, sensor_id=sensor.sensor_id)
            self._disown(sensor)

    @refused_while_deciding
    def register_strategy(self, strategy: Strategy | AerialStrategy | AsyncStrategy | None) -> None:
        """Decide with `strategy` from now on.

        Raises:
            BadType: it is neither a function of the state nor None.
        """
        self.strategy = strategy

    def get_state(self) -> State:
        """Sense; a fresh dict with `curr_pos` and `sensor`."""
        if self._phase.agent is not None:
            self._phase.refuse("call agent.get_state")
        node = self._columns.node[self._row]
        sensed = {}
        for name, sensor in self._carried:
            sensor.sense(node)
            sensed[name] = (sensor.type, sensor._last[0])
        state: State = {"curr_pos": node, "sensor": sensed}
        self._last[0] = state
        return state

    @refused_while_deciding
    def sense(self) -> dict[str, tuple[SensorType, Any]]:
        """Ask all sensors: name -> (kind, data); what `get_state` has under `sensor`."""
        node = self._columns.node[self._row]
        sensed = {}
        for name, sensor in self._carried:
            sensor.sense(node)
            sensed[name] = (sensor.type, sensor._last[0])
        return sensed

    def set_state(self) -> None:
        """Do what `state['action']` says."""
        if self._phase.agent is not None:
            self._phase.refuse("call agent.set_state")
        try:
            action = self._last[0]["action"]
        except KeyError:
            raise MissingKey(
                f"The state of agent {self.name!r} has no 'action': its strategy must set state['action'] to "
                f"{self._ACTION}."
            ) from None
        self._act(self._columns, self._row, action)

    def step(self) -> None:
        """`get_state`, decide, `set_state`.

        Raises:
            NoStrategy (AttributeError): there is no strategy.
        """
        strategy = self.strategy
        if strategy is None:
            raise NoStrategy(f"Agent {self.name!r} has no strategy. Give it one with register_strategy.")
        strategy(self.get_state())
        self.set_state()

    # -- coming and going ---------------------------------------------------------------------------------------

    def _note(self, kind: int, **data: Any) -> None:
        """Tell the journal what has happened to the agent."""
        self._columns.journal.note(kind, {"agent_name": self.name, **data})

    def _adopt(self, attributes: dict[str, Any]) -> None:
        """Take on what the caller gave to be attributes."""
        for key, value in attributes.items():
            setattr(self, key, value)

    def _live_in(self, columns: AgentColumns) -> None:
        """Move into a row of other columns: those of the world, or new ones to leave it; sensors stay."""
        self._row, self._columns = columns.copy_row(self._columns, self._row), columns

    def _leave(self) -> None:
        """Leave the world with columns of its own; its sensors are nobody's."""
        self._live_in(AgentColumns())
        for sensor in self._sensor_list.values():
            self._disown(sensor)

    def _write_by(self, moves: IMoves) -> None:
        """Be moved by another writer from now on."""
        self._moves = moves
        self._act = moves.fly if self.type is AgentType.AERIAL else moves.act

    def _rest(self) -> None:
        """Do nothing from now on: the context has ended, and a loop that is ending should end quietly."""
        # NOTE: set on the instance, so that living agents need not ask at every step (benchmarks/README.md, w2).
        last = self._last[0] or self._state_of(self._unasked())
        self._moves = _NoMoves()
        self._act = self._moves.act
        for name, quiet in (("get_state", lambda: last), ("set_state", _do_nothing), ("step", _do_nothing)):
            setattr(self, name, quiet)

    def _state_of(self, sensed: dict[str, Any]) -> State:
        """A state with these results of sensors."""
        return {"curr_pos": self.current_node_id, "sensor": sensed}

    def _unasked(self) -> dict[str, Any]:
        """What the sensors hold without having been asked; a sensor of the caller's may have nothing to show yet."""
        held = ((name, sensor.type, getattr(sensor, "data", None)) for name, sensor in self._sensor_list.items())
        return {name: (kind, data) for name, kind, data in held}

    def _share(self, sensor: ISensor) -> None:
        """Tell a sensor whose eyes it is before every look: another agent carries it, too."""
        self._shared[id(sensor)] = sensor
        self._carry()

    def _carry(self) -> None:
        self._columns.roster += 1
        own = self.name
        self._carried = tuple(
            (name, sensor if _is_own(sensor, self._shared) else _Carried(sensor, own, self._shared))
            for name, sensor in self._sensor_list.items()
        )

    def _disown(self, sensor: ISensor) -> None:
        if getattr(sensor, "_owner", self.name) == self.name:  # unless another agent carries it by now
            sensor.set_owner(None)


class _Attribute:
    """An attribute of the caller's, of whose value strategies see a read-only copy."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, agent: Any, owner: type) -> Any:
        if agent is None or self._name not in agent.__dict__:
            raise AttributeError(f"{owner.__name__!r} object has no attribute {self._name!r}")
        return agent._phase.shown(agent.__dict__[self._name])

    def __set__(self, agent: Any, value: Any) -> None:
        agent.__dict__[self._name] = value

    def __delete__(self, agent: Any) -> None:
        del agent.__dict__[self._name]


def _is_own(sensor: ISensor, shared: dict[int, ISensor]) -> bool:
    """Whether a sensor is a built-in one that no other agent carries."""
    return type(sensor).__module__.startswith("gamms.sensor.") and id(sensor) not in shared


class _Carried:
    """A sensor of a caller's class, or one that several agents carry, as one of them uses it."""

    __slots__ = ("_is_shared", "_name", "_sensor")

    def __init__(self, sensor: ISensor, name: str, shared: dict[int, ISensor]) -> None:
        self._sensor, self._name, self._is_shared = sensor, name, id(sensor) in shared

    def sense(self, node_id: int) -> None:
        sensor = self._sensor
        if not self._is_shared:
            sensor.sense(node_id)
            return
        owner = getattr(sensor, "_owner", self._name)
        sensor.set_owner(self._name)
        try:
            sensor.sense(node_id)
        finally:
            if owner != self._name:  # whoever asks the sensor itself gets the view of the one that registered it last
                sensor.set_owner(owner)

    @property
    def type(self) -> SensorType:
        return self._sensor.type

    @property
    def _last(self) -> tuple[Any]:
        return (self._sensor.data,)


def _do_nothing(*_: Any, **__: Any) -> None:
    return


class _NoMoves(IMoves):
    """Writes nothing: the context has ended, and a rule that puts agents back should end quietly, too."""

    act = place = place_previous = turn = _do_nothing
    launch = fly = place_at = place_above = face = turn_in_space = locate = _do_nothing

    def nearest(self, columns: AgentColumns, row: int) -> int:
        return columns.node[row]

    def trusting(self) -> AbstractContextManager[None]:
        return nullcontext()
