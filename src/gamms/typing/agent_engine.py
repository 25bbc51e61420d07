"""Contract of the agent engine."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.ir.agents import AgentBlock, Position, Quat
from gamms.ir.graph import FloatArray
from gamms.ir.positions import Positions
from gamms.typing.game import AerialStrategy, AsyncStrategy, NodeId, State, Strategy
from gamms.typing.sensor_engine import Carried, ISensor, SensorDeclaration

SensorsOfAgent = Iterable[str | ISensor] | Mapping[str, str | ISensor | SensorDeclaration]
MaybeNone = Any  # a value that may be None, but is used without a check


class AgentType(IntEnum):
    """Kinds of agent."""

    BASIC = 0
    AERIAL = 1


class IAgent(ABC):
    """An agent, which senses, decides and moves. On the ground, its position is a node of the graph."""

    current_node_id: int
    prev_node_id: int
    if TYPE_CHECKING:
        team: Any  # optional; any value that can be a dict key
        alive: bool  # optional; False if the agent is out of the game

        def __getattr__(self, name: str) -> Any:
            """Return an attribute set by the program; for type checkers."""

        def __setattr__(self, name: str, value: object) -> None:
            """Set an attribute; for type checkers."""

    @property
    @abstractmethod
    def name(self) -> str:
        """The agent's name."""

    @property
    @abstractmethod
    def type(self) -> AgentType:
        """The kind of this agent."""

    @property
    @abstractmethod
    def state(self) -> State:
        """The last result of `get_state`; `{}` before the first call."""

    @property
    @abstractmethod
    def strategy(self) -> Strategy | MaybeNone:
        """The function that decides; None if there is none."""

    @property
    @abstractmethod
    def orientation(self) -> tuple[float, float]:
        """The heading `(cos, sin)`; (0.0, 0.0) if there is none.

        Follows from the last move unless it is set; setting None makes it follow moves again.
        """

    @abstractmethod
    def register_sensor(self, name: str, sensor: ISensor) -> None:
        """Carry a sensor; its results appear in the state under `name`."""

    @abstractmethod
    def deregister_sensor(self, name: str) -> None:
        """Stop carrying a sensor; an unknown name is only warned about."""

    @abstractmethod
    def register_strategy(self, strategy: Strategy | AerialStrategy | AsyncStrategy | None) -> None:
        """Set the strategy."""

    @abstractmethod
    def step(self) -> None:
        """Sense, decide and move: `get_state`, the strategy, `set_state`."""

    @abstractmethod
    def get_state(self) -> State:
        """Sense; return a fresh dict with `curr_pos` and `sensor: {name: (SensorType, data)}`."""

    @abstractmethod
    def set_state(self) -> None:
        """Perform `state['action']`: a node id, or `{'node_id': …, 'orientation': (cos, sin)}`.

        On an error nothing changes.

        Raises:
            KeyError: no action, or an unknown node.
            ValueError: an action dict without `node_id`, or an invalid orientation.
            TypeError: an action of any other type.
        """


class IAerialAgent(IAgent):
    """A flying agent: at any position and rotation in space, moving `speed` map units per step.

    `current_node_id` is the node nearest to its x and y, also after the graph has changed; if the graph has no nodes,
    it is unchanged. Setting it is equal to setting `position` to the node's x and y and the present z. `orientation` is
    the yaw of `quat`; setting it rotates the agent about the vertical, and None resets the rotation.

    `get_state` returns `curr_pos`, `quat` and `sensor`. The action is a direction `(dx, dy, dz)` of any length, a tuple
    or a NumPy array: the agent moves by `speed` map units, or stays if the direction is zero. An action dict may have
    `direction`, any sequence, with an optional `distance`, from 0 to `speed`, and `quat`; without both it does nothing.
    A missing action raises KeyError; a wrong count of numbers, NaN and infinity raise ValueError; anything else raises
    TypeError; on an error nothing has changed.
    """

    @property
    @abstractmethod
    def position(self) -> Position:
        """The position `(x, y, z)`, map units. Setting it sets `prev_position` and `prev_node_id` to the old values."""

    @property
    @abstractmethod
    def prev_position(self) -> Position:
        """The position before the last move; initially the start position."""

    @property
    @abstractmethod
    def quat(self) -> Quat:
        """The rotation `(w, x, y, z)` as a unit quaternion; settable, with any length. All zeros mean no rotation."""

    @property
    @abstractmethod
    def speed(self) -> float:
        """The distance it moves at each step, map units."""


class TurnAccess(NamedTuple):
    """The values of one agent that the turn engine reads and writes."""

    row: int  # in the block
    carried: tuple[Carried, ...]
    last: list[dict[str, Any]]  # one item: the last state given to the agent


class DeletedAgent:
    """A deleted agent, linked to the agent that was deleted next.

    All later deletions can be found from one object; earlier ones are freed unless something refers to them.

    Attributes:
        agent: the deleted agent; None: the start of the list.
        team, node: its team and node at deletion.
        next: the next deleted agent; None: none yet.
    """

    __slots__ = ("agent", "next", "node", "team")

    def __init__(self, agent: IAgent | None = None) -> None:
        self.agent: MaybeNone = agent
        self.team: Any = agent and agent.team
        self.node: MaybeNone = agent and agent.current_node_id
        self.next: DeletedAgent | None = None


class IAgentEngine(ABC):
    """Creates agents and stores them by name."""

    agents: dict[str, Any]  # name -> agent; Any: engines have their own agent classes

    @abstractmethod
    def create_agent(  # noqa: PLR0913 - the published interface
        self,
        name: str,
        *,
        start_node_id: NodeId,
        sensors: SensorsOfAgent = (),
        team: Hashable = None,
        strategy: Strategy | AerialStrategy | AsyncStrategy | None = None,
        orientation: tuple[float, float] | None = None,
        speed: float | None = None,
        type: AgentType | str = AgentType.BASIC,
        agent_type: AgentType | str = AgentType.BASIC,
        mode: str | Mapping[str, str] | None = None,
        position: Sequence[float] | FloatArray | None = None,
        quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        **attributes: object,
    ) -> IAgent:
        """Create an agent, or raise and change nothing.

        Args:
            name: a name that no other agent has.
            start_node_id: id of the first node of the agent; required.
            sensors: a dict from names in the agent's state to sensors, such as
                `{"eyes": gamms.sensor.agent_range(range_m=60)}`; also ids of existing sensors. Or a list of
                ids, of which unknown ones are left out with a warning.
            team: any value that can be a dict key; None: no team.
            strategy: the function that decides for the agent in `ctx.game`; None: none yet.
            orientation: a fixed heading `(cos, sin)`; None: the heading follows from the moves.
            speed: distance that an agent on the ground may move per turn of `ctx.game`, in edges, or in metres if
                `ctx.game.speed_unit` is set so; None: one edge. For an AERIAL agent: map units per step; required.
            type: "BASIC", an agent on the ground, or "AERIAL", an agent that flies; or the `AgentType`.
            agent_type: a synonym of `type`.
            mode: the edge attribute that says which edges an agent on the ground may use in `ctx.game`: a mode of the
                map, such as "drive", or `{"attribute": name}` for any attribute with booleans or speeds; None: all
                edges.
            position: for an AERIAL agent, its start position `(x, y, z)` in map units; None: the x and y of its node,
                with z = 0.
            quat: for an AERIAL agent, its rotation `(w, x, y, z)`; (1, 0, 0, 0): level, facing east.
            attributes: any other keyword becomes an attribute of the agent.

        Raises:
            Duplicate (ValueError): the name is taken.
            KeyError: no `start_node_id`, an unknown node, or an aerial agent without `speed`.
            ContextTerminated: the context has ended.
        """

    @abstractmethod
    def get_agent(self, name: str) -> IAgent:
        """Return an agent by its name (KeyError)."""

    @abstractmethod
    def delete_agent(self, name: str) -> None:
        """Delete an agent; an unknown name is only warned about."""

    @abstractmethod
    def create_iter(self) -> Iterator[IAgent]:
        """Return the agents in order of creation; agents may be created and deleted during the iteration."""

    @property
    def positions(self) -> Positions:
        """The positions of all agents; override for speed."""
        block = AgentBlock()
        for agent in self.create_iter():
            position = getattr(agent, "position", None) if agent.type == AgentType.AERIAL else None
            row = block.add(agent.name, agent.current_node_id, getattr(agent, "team", None), position)
            if not getattr(agent, "alive", True):
                block.set(row, "alive", value=False)
        return Positions(block)

    @property
    def structure_version(self) -> int | None:
        """A number that changes if an agent is created, deleted, dies, returns, or changes its team, speed or sensors.

        None, the default, means that nothing about agents may be cached.
        """
        return None

    @abstractmethod
    def terminate(self) -> None:
        """Close the engine; agents stay readable."""
