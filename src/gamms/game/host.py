"""What a game needs of its context, whose class knows this package and cannot be named here."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from gamms.ir.agents import AgentBlock
from gamms.typing.agent_engine import IAgent, TurnAccess
from gamms.typing.graph_engine import IGraphEngine
from gamms.typing.logger import ILogger
from gamms.typing.visualization_engine import IVisualizationEngine

if TYPE_CHECKING:
    from numpy.random import Generator


class GameAgentStorage(Protocol):
    """Snapshots of agents, and what turns need of each; Any: an engine's own classes, which only it knows."""

    def snapshot(self) -> Any:
        """Return all agents as they are now, for `restore`."""

    def restore(self, before: Any) -> None:
        """Restore all agents."""

    def turn_access(self, agent: Any) -> TurnAccess:
        """Return what a turn reads and writes of an agent."""


class GameAgents(Protocol):
    """What a game needs of the engine of agents."""

    @property
    def agents(self) -> Mapping[str, IAgent]:
        """Name -> agent, in the order of their creation."""

    @property
    def block(self) -> AgentBlock:
        """The rows of the agents."""

    @property
    def teams(self) -> Mapping[Any, Sequence[IAgent]]:
        """Team -> its agents."""

    def get_agent(self, name: str) -> IAgent:
        """Return an agent by name (KeyError)."""

    @property
    def storage(self) -> GameAgentStorage:
        """Snapshots of the agents."""


class GameSensorStorage(Protocol):
    """Snapshots of sensors; Any: the engine's own class."""

    def snapshot(self) -> Any:
        """Return the sensors as they are now, for `restore`."""

    def restore(self, before: Any, *, forget: bool = False) -> None:
        """Restore the sensors; with `forget`, they forget what they have sensed."""


class GameSensors(Protocol):
    """What a game needs of the engine of sensors."""

    @property
    def sensors(self) -> Mapping[str, Any]:
        """Name -> sensor."""

    @property
    def storage(self) -> GameSensorStorage:
        """Snapshots of the sensors."""


class GameContext(Protocol):
    """What a game needs of its context; `gamms.Context` has it all."""

    is_seeded: bool

    @property
    def agent(self) -> GameAgents:
        """The agent engine."""

    @property
    def sensor(self) -> GameSensors:
        """The sensor engine."""

    @property
    def graph(self) -> IGraphEngine:
        """The graph engine."""

    @property
    def visual(self) -> IVisualizationEngine:
        """The visual engine."""

    @property
    def logger(self) -> ILogger:
        """Where messages go."""

    @property
    def game(self) -> Any:
        """The game; Any: its class knows this one."""

    @property
    def seed(self) -> int:
        """What every random stream follows from."""

    @property
    def is_recording(self) -> bool:
        """Whether a recording was started and not stopped yet, or is being replayed."""

    def reseed(self, seed: int, rng_state: Mapping[str, Any] | None = None) -> None:
        """Key every stream by another seed; `rng` continues from a state of it."""

    def rng_state(self) -> Any:
        """Return the state of `rng`; None before its first use."""

    def stream(self, *names: str | int) -> "Generator":
        """Return the random stream of one purpose."""

    def is_terminated(self) -> bool:
        """Whether the context has ended."""

    def fork(self, seed: int) -> "tuple[GameContext, dict[int, Any]]":
        """Return a context with copies of all engines, and what takes the place of which objects there."""
