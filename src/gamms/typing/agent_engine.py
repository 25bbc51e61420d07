"""Contract of the agent engine."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.ir.agents import AgentBlock, Position, Quat
from gamms.ir.graph import FloatArray
from gamms.ir.positions import Positions
from gamms.typing.game import AerialStrategy, AsyncStrategy, NodeId, State, Strategy
from gamms.typing.sensor_engine import Carried, ISensor

SensorsOfAgent = Iterable[str | ISensor] | Mapping[str, str | ISensor]
MaybeNone = Any  # of a value that is None at times, and is used as if it never were


class AgentType(IntEnum):
    """Kinds of agent."""

    BASIC = 0
    AERIAL = 1


class IAgent(ABC):
    """Senses, decides and moves. On the ground, its position is a node of the graph."""

    current_node_id: int
    prev_node_id: int
    if TYPE_CHECKING:
        team: Any  # of engines that have teams; any value that can be a key of a dict
        alive: bool  # of engines whose agents can be out of the game

        def __getattr__(self, name: str) -> Any:
            """Let type checkers read the attributes that a program has given to an agent."""

        def __setattr__(self, name: str, value: object) -> None:
            """Let type checkers set them."""

    @property
    @abstractmethod
    def name(self) -> str:
        """The agent's name."""

    @property
    @abstractmethod
    def type(self) -> AgentType:
        """What kind of agent this is."""

    @property
    @abstractmethod
    def state(self) -> State:
        """What `get_state` returned last; `{}` before the first time."""

    @property
    @abstractmethod
    def strategy(self) -> Strategy | MaybeNone:
        """The function that decides; None before one is registered."""

    @property
    @abstractmethod
    def orientation(self) -> tuple[float, float]:
        """`(cos, sin)` of the heading; (0.0, 0.0) while there is none.

        Follows from the last move until it is set; set to None it follows again.
        """

    @abstractmethod
    def register_sensor(self, name: str, sensor: ISensor) -> None:
        """Carry a sensor; its results appear in the state under `name`."""

    @abstractmethod
    def deregister_sensor(self, name: str) -> None:
        """Stop carrying a sensor; an unknown name is only warned about."""

    @abstractmethod
    def register_strategy(self, strategy: Strategy | AerialStrategy | AsyncStrategy | None) -> None:
        """Decide with `strategy` from now on."""

    @abstractmethod
    def step(self) -> None:
        """Sense, decide and move: `get_state`, the strategy, `set_state`."""

    @abstractmethod
    def get_state(self) -> State:
        """Sense; return a fresh dict with `curr_pos` and `sensor: {name: (SensorType, data)}`."""

    @abstractmethod
    def set_state(self) -> None:
        """Do what `state['action']` says: a node id, or `{'node_id': …, 'orientation': (cos, sin)}`.

        Nothing changes when an error is raised.

        Raises:
            KeyError: no action, or an unknown node.
            ValueError: an action dict without `node_id`, or an impossible orientation.
            TypeError: an action of any other kind.
        """


class IAerialAgent(IAgent):
    """An agent that flies: anywhere in space, `speed` map units at each step, and turned anyhow.

    `current_node_id` is the node nearest to its x and y, also after the graph has changed; while the graph has no
    nodes, it stays what it was. Setting it is like setting `position` to the node's x and y and the present z.
    `orientation` is the yaw of `quat`; setting it turns the agent about the vertical, to None not at all.

    `get_state` gives `curr_pos`, `quat` and `sensor`. The action is a direction `(dx, dy, dz)` of any length, a tuple
    or a NumPy array: the agent moves by `speed` map units, or stays if all of it is 0. A dict may have `direction`,
    any sequence, with it `distance`, from 0 to `speed`, and `quat`; without a direction and a quat, nothing happens at
    all. A missing action raises KeyError, a wrong count of numbers, NaN and infinity ValueError, anything else
    TypeError; nothing has changed then.
    """

    @property
    @abstractmethod
    def position(self) -> Position:
        """`(x, y, z)`, map units. Setting it also sets `prev_position` and `prev_node_id` to what was before."""

    @property
    @abstractmethod
    def prev_position(self) -> Position:
        """Where it was before the last move; at first where it began."""

    @property
    @abstractmethod
    def quat(self) -> Quat:
        """How it is turned: `(w, x, y, z)` of length 1; settable, of any length. All zeros mean unturned."""

    @property
    @abstractmethod
    def speed(self) -> float:
        """How far it moves at each step, map units."""


class TurnAccess(NamedTuple):
    """What the turn engine reads and writes of one agent."""

    row: int  # in the block
    carried: tuple[Carried, ...]
    last: list[dict[str, Any]]  # its only item is the state that the agent got last


class Departure:
    """An agent that was deleted, and the one that was deleted next.

    All that were deleted after one are found from it; those before it are kept only where something asks for them.

    Attributes:
        agent: which; None: the beginning, before any was deleted.
        team, node: of it, when it was deleted.
        next: None: none was deleted since.
    """

    __slots__ = ("agent", "next", "node", "team")

    def __init__(self, agent: IAgent | None = None) -> None:
        self.agent: MaybeNone = agent
        self.team: Any = agent and agent.team
        self.node: MaybeNone = agent and agent.current_node_id
        self.next: Departure | None = None


class IAgentEngine(ABC):
    """Creates agents and keeps them by name."""

    agents: dict[str, Any]  # name -> agent; Any: an engine's own class of agents

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
        position: Sequence[float] | FloatArray | None = None,
        quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
        **attributes: object,
    ) -> IAgent:
        """Create an agent, or change nothing and raise.

        Args:
            name: a name that no other agent has.
            start_node_id: the id of the node that the agent starts on; required.
            sensors: ids of sensors, or a dict from the names in the agent's state to sensors or ids. Unknown ids are
                warned about and left out.
            team: any value that can be a key of a dict; None: no team.
            strategy: the function that decides for the agent in `ctx.game`; None: none yet.
            orientation: a heading `(cos, sin)` that stays; None: the heading follows from the moves.
            speed: how far an agent on the ground may go in a turn of `ctx.game`, in edges, or in metres where
                `ctx.game.speed_unit` says so; None: one edge. For an AERIAL agent: map units per step; required.
            type: "BASIC", an agent on the ground, or "AERIAL", an agent that flies; or the `AgentType`.
            agent_type: a synonym of `type`.
            position: for an AERIAL agent, where it starts, `(x, y, z)` in map units; None: at the x and y of its node,
                with z = 0.
            quat: for an AERIAL agent, how it is turned, `(w, x, y, z)`; (1, 0, 0, 0): level, facing east.
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
        """Return the agents in the order of their creation; agents may be created and deleted meanwhile."""

    @property
    def positions(self) -> Positions:
        """Where all agents are; override for speed."""
        block = AgentBlock()
        for agent in self.create_iter():
            position = getattr(agent, "position", None) if agent.type == AgentType.AERIAL else None
            row = block.add(agent.name, agent.current_node_id, getattr(agent, "team", None), position)
            if not getattr(agent, "alive", True):
                block.set(row, "alive", value=False)
        return Positions(block)

    @property
    def structure_version(self) -> int | None:
        """A number that changes whenever an agent comes, goes, dies, returns, or has another team, speed or sensor.

        None, as by default: what was remembered about the agents has to be looked up again.
        """
        return None

    @abstractmethod
    def terminate(self) -> None:
        """Close the engine; agents stay readable."""
