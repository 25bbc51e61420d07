"""Contract of the context: the single point of access to one running scenario."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from gamms.plugins import Registry

if TYPE_CHECKING:
    from numpy.random import Generator

    from gamms.typing.agent_engine import IAgentEngine
    from gamms.typing.graph_engine import IGraphEngine
    from gamms.typing.internal_context import IInternalContext
    from gamms.typing.logger import ILogger
    from gamms.typing.sensor_engine import ISensorEngine
    from gamms.typing.visualization_engine import IVisualizationEngine


class IContext(ABC):
    """Every room, the random streams, and the life of a scenario."""

    @property
    @abstractmethod
    def agent(self) -> "IAgentEngine":
        """The agent room."""

    @property
    @abstractmethod
    def graph(self) -> "IGraphEngine":
        """The graph room."""

    @property
    @abstractmethod
    def sensor(self) -> "ISensorEngine":
        """The sensor room."""

    @property
    @abstractmethod
    def visual(self) -> "IVisualizationEngine":
        """The visual room."""

    @property
    @abstractmethod
    def record(self) -> Any:
        """The recorder."""

    @property
    @abstractmethod
    def logger(self) -> "ILogger":
        """Where messages go."""

    @property
    @abstractmethod
    def ictx(self) -> "IInternalContext":
        """Engines that serve other engines."""

    @property
    @abstractmethod
    def seed(self) -> int:
        """What every random stream of this context follows from."""

    @property
    @abstractmethod
    def rng(self) -> "Generator":
        """The scenario's own random stream."""

    @abstractmethod
    def stream(self, *names: str | int) -> "Generator":
        """The random stream of one purpose: same seed and names, same draws, whoever else draws."""

    @abstractmethod
    def is_terminated(self) -> bool:
        """Whether the scenario has ended (or has not begun)."""

    @abstractmethod
    def terminate(self) -> None:
        """End the scenario and release what it holds; a second call does nothing."""


contexts: Registry[IContext] = Registry("kind of context", "gamms.contexts")
"""What opens a context. The hall answers to "gamms"; rooms ask here, for they do not know it."""
