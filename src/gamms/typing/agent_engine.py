"""Contract of the agent room."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.agents import AgentColumns, Position, Quat
from gamms.ir.graph import FloatArray, IntArray
from gamms.typing.sensor_engine import ISensor
from gamms.typing.state import AerialStrategy, AsyncStrategy, NodeId, State, Strategy

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
        """Carry a sensor no longer; an unknown name is only warned about."""

    @abstractmethod
    def register_strategy(self, strategy: Strategy | AerialStrategy | AsyncStrategy | None) -> None:
        """Decide with `strategy` from now on."""

    @abstractmethod
    def step(self) -> None:
        """`get_state`, decide, `set_state`."""

    @abstractmethod
    def get_state(self) -> State:
        """Sense; a fresh dict with `curr_pos` and `sensor: {name: (SensorType, data)}`."""

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
    any sequence, and `quat`; without both, nothing happens at all. A KeyError tells of no action, a ValueError of a
    wrong count of numbers or of NaN and infinity, a TypeError of anything else; nothing has changed then.
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


class Roll(NamedTuple):
    """Who is in the world, in the order of creation; valid until something in it changes."""

    names: list[str]
    nodes: IntArray  # (agents,)  ids; of a flyer the nearest node
    moves: int | None  # changes whenever anything here may have; None means: never remember anything
    teams: list[Any]
    flying: IntArray  # (flying,)  rows of the aerial agents, ascending
    places: FloatArray  # (flying, 3)  where these are, map units
    out: Collection[int]  # rows of the agents that are not alive, and stand nowhere


class Standing(NamedTuple):
    """Who stands on which node; valid until something in it changes."""

    names: list[str]
    nodes: Sequence[int]  # (agents,)  ids; of a flyer the nearest node
    teams: list[Any]
    rows_at: Mapping[int, Sequence[int]]  # node id -> rows of the agents there, in any order
    taken: set[int]  # the ids of these nodes; not to be written to
    moves: int | None  # as in Roll


class IMoves(ABC):
    """The one writer of where agents are. Every method checks first and changes nothing when it raises."""

    @abstractmethod
    def act(self, columns: AgentColumns, row: int, action: Any) -> None:
        """Do what an action says; see `IAgent.set_state`."""

    @abstractmethod
    def place(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Put an agent on a node; where it was before stays as it is (KeyError)."""

    @abstractmethod
    def place_previous(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Say on which node an agent was before (KeyError)."""

    @abstractmethod
    def turn(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Face `(cos, sin)`, of any length but zero, until told otherwise; None follows the moves again."""

    # -- in the air ---------------------------------------------------------------------------------------------

    @abstractmethod
    def launch(self, columns: AgentColumns, row: int, node_id: Any, speed: Any, position: Any) -> None:
        """Begin on a node (KeyError), or at a position near it, as if it had always been there."""

    @abstractmethod
    def fly(self, columns: AgentColumns, row: int, action: Any) -> None:
        """Do what a flyer's action says; see `IAerialAgent`."""

    @abstractmethod
    def place_at(self, columns: AgentColumns, row: int, position: Any) -> None:
        """Put a flyer at `(x, y, z)`; where it was is where it was before."""

    @abstractmethod
    def place_above(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Put a flyer above a node (KeyError), as high as it is; where it was is where it was before."""

    @abstractmethod
    def face(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Turn a flyer about the vertical to `(cos, sin)`, of any length but zero, and level; None: unturned."""

    @abstractmethod
    def turn_in_space(self, columns: AgentColumns, row: int, quat: Any) -> None:
        """Turn a flyer to `(w, x, y, z)`, of any length; all zeros: unturned."""

    @abstractmethod
    def nearest(self, columns: AgentColumns, row: int) -> int:
        """The node nearest to a flyer, worked out unless neither it nor the graph has changed; the first of several.

        In a graph without nodes it is the one of before.
        """

    @abstractmethod
    def trusting(self) -> AbstractContextManager[None]:
        """Take any integer for a node that is there; for who plays a recording, whose map may have changed since."""

    @abstractmethod
    def locate(self, columns: AgentColumns) -> None:
        """Bring the nodes of all flyers up to date."""


class IAgentEngine(ABC):
    """Creates agents and keeps them by name."""

    moves: IMoves
    agents: dict[str, Any]  # name -> agent; Any: an engine's own class of agents

    @abstractmethod
    def create_agent(
        self,
        name: str,
        *,
        start_node_id: NodeId,
        sensors: SensorsOfAgent = (),
        team: Hashable = None,
        strategy: Strategy | AsyncStrategy | None = None,
        orientation: tuple[float, float] | None = None,
        speed: float | None = None,
        type: AgentType = AgentType.BASIC,
        **attributes: object,
    ) -> IAgent:
        """Create an agent.

        Args:
            name: a name that no other agent has.
            start_node_id: the node that it starts on.
            sensors: ids of sensors, or a dict from the names in the agent's state to sensors or ids; unknown ids are
                warned about and left out.
            team: any value that can be a key of a dict; None: no team.
            strategy: the function that decides; None: none yet.
            orientation: `(cos, sin)`, a heading that stays; None: it follows from the moves.
            speed: on the ground how far it may go in a turn of `ctx.game`, in edges or metres, None for one edge; of
                an aerial agent, where it is required, map units per step.
            type: kind of agent; `agent_type` is a synonym. With AERIAL there are two more: `position`, `(x, y, z)`
                where it starts, and `quat`, `(w, x, y, z)` how it is turned.
            attributes: any other becomes an attribute of the agent.

        Raises:
            Duplicate (ValueError): the name is taken.
            KeyError: no `start_node_id`, an unknown node, or an aerial agent without `speed`.
            ContextTerminated: the context has ended.
        """

    @abstractmethod
    def get_agent(self, name: str) -> IAgent:
        """An agent by name (KeyError)."""

    @abstractmethod
    def delete_agent(self, name: str) -> None:
        """Take an agent out of the world; an unknown name is only warned about."""

    @abstractmethod
    def create_iter(self) -> Iterator[IAgent]:
        """The agents in the order of their creation; agents may be created and deleted meanwhile."""

    def roll(self) -> Roll:
        """Who is where, as arrays; override for speed."""
        agents = list(self.create_iter())
        flying = [row for row, agent in enumerate(agents) if agent.type == AgentType.AERIAL]
        return Roll(
            [agent.name for agent in agents],
            np.array([agent.current_node_id for agent in agents], np.int64),
            None,
            [getattr(agent, "team", None) for agent in agents],
            np.array(flying, np.int64),
            np.array([getattr(agents[row], "position") for row in flying], np.float64).reshape(-1, 3),  # noqa: B009 - IAgent has none; only those who fly do
            {row for row, agent in enumerate(agents) if not getattr(agent, "alive", True)},
        )

    def standing(self) -> Standing:
        """Who stands on which node; override for speed."""
        agents = list(self.create_iter())
        nodes = [agent.current_node_id for agent in agents]
        rows_at: dict[int, list[int]] = {}
        for row, node in enumerate(nodes):
            if getattr(agents[row], "alive", True):
                rows_at.setdefault(node, []).append(row)
        teams = [getattr(agent, "team", None) for agent in agents]
        return Standing([agent.name for agent in agents], nodes, teams, rows_at, set(rows_at), None)

    @abstractmethod
    def terminate(self) -> None:
        """Close the room; agents stay readable."""
