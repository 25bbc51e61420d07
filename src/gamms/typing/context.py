"""Contract of the context: the single point of access to one running scenario."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, Self

from gamms.plugins import Registry

if TYPE_CHECKING:
    from types import TracebackType

    from numpy.random import Generator

    from gamms.typing.agent_engine import IAgentEngine
    from gamms.typing.graph_engine import IGraphEngine
    from gamms.typing.internal_context import IInternalContext
    from gamms.typing.logger import ILogger
    from gamms.typing.recorder import IRecorder
    from gamms.typing.sensor_engine import ISensorEngine
    from gamms.typing.visualization_engine import IVisualizationEngine


class IGameState(Protocol):
    """What drawing and sensors read of a game."""

    @property
    def internals(self) -> Any:
        """What engines do with it; not for strategies. Any: the game engine's own class."""

    @property
    def turn(self) -> int:
        """How many turns were played."""

    @property
    def scores(self) -> Mapping[Any, float]:
        """Points by team."""

    @property
    def data(self) -> Mapping[Any, Any]:
        """What rules remember."""

    @property
    def events(self) -> Sequence[dict[str, Any]]:
        """What rules have emitted, in order."""

    @property
    def messages(self) -> Sequence[dict[str, Any]]:
        """What was sent by channels, in order."""

    @property
    def over(self) -> Mapping[str, Any] | None:
        """The reason of the end, the winner, and whether time was up; None while the game goes on."""

    @property
    def last_turn(self) -> int | None:
        """The turn after which the game ends at the latest; None: not known."""

    @property
    def is_deciding(self) -> bool:
        """Whether agents are deciding now."""

    @property
    def is_moving(self) -> bool:
        """Whether agents are deciding or moving now: a context that ends has to wait for that."""


class IContext(ABC):
    """The engines, the random streams, and the life of a scenario."""

    @property
    @abstractmethod
    def agent(self) -> "IAgentEngine":
        """The agent engine."""

    @property
    @abstractmethod
    def graph(self) -> "IGraphEngine":
        """The graph engine."""

    @property
    @abstractmethod
    def sensor(self) -> "ISensorEngine":
        """The sensor engine."""

    @property
    @abstractmethod
    def visual(self) -> "IVisualizationEngine":
        """The visual engine."""

    @property
    @abstractmethod
    def record(self) -> "IRecorder":
        """The recorder."""

    @property
    def current_game(self) -> IGameState | None:
        """The game that was begun, if there is one; unlike `ctx.game`, asking for it begins none."""
        return None

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
        """Return the random stream of one purpose: the same seed and names give the same draws."""

    @abstractmethod
    def is_terminated(self) -> bool:
        """Whether the scenario has ended (or has not begun)."""

    @abstractmethod
    def terminate(self) -> None:
        """End the scenario and release what it holds; a second call does nothing."""


class HostContext(Protocol):
    """A context as games and recorders use it and recordings open it: its engines offer more than their contracts.

    Any: the engines of `gamms.context`, of which an engine may know no class.
    """

    is_seeded: bool

    # ruff: noqa: D102 - `gamms.Context` says what these are
    @property
    def agent(self) -> Any: ...
    @property
    def graph(self) -> Any: ...
    @property
    def sensor(self) -> Any: ...
    @property
    def visual(self) -> Any: ...
    @property
    def record(self) -> Any: ...
    @property
    def game(self) -> Any: ...
    @property
    def current_game(self) -> IGameState | None: ...
    @property
    def ictx(self) -> "IInternalContext": ...
    @property
    def logger(self) -> "ILogger": ...
    @property
    def seed(self) -> int: ...
    @property
    def rng(self) -> "Generator": ...
    @property
    def is_recording(self) -> bool: ...
    def rng_state(self) -> Any: ...
    def reseed(self, seed: int, rng_state: Mapping[str, Any] | None = None) -> None: ...
    def stream(self, *names: str | int) -> "Generator": ...
    def fork(self, seed: int) -> "tuple[HostContext, dict[int, Any]]": ...
    def is_terminated(self) -> bool: ...
    def terminate(self) -> None: ...
    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: "TracebackType | None", /
    ) -> None: ...


contexts: Registry[IContext] = Registry("kind of context", "gamms.contexts", "gamms.context")
"""What makes a context. Engines ask here, for they do not import `gamms.context`."""
