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
    """The data of a game that drawing and sensors read."""

    @property
    def internals(self) -> Any:
        """Access for engines; not for strategies. Any: the game engine has its own class."""

    @property
    def turn(self) -> int:
        """The number of turns played."""

    @property
    def scores(self) -> Mapping[Any, float]:
        """Points by team."""

    @property
    def data(self) -> Mapping[Any, Any]:
        """The data of rules."""

    @property
    def events(self) -> Sequence[dict[str, Any]]:
        """The events emitted by rules, in order."""

    @property
    def messages(self) -> Sequence[dict[str, Any]]:
        """The messages sent on channels, in order."""

    @property
    def over(self) -> Mapping[str, Any] | None:
        """The reason of the end, the winner, and whether time was up; None while the game continues."""

    @property
    def last_turn(self) -> int | None:
        """The turn after which the game ends at the latest; None: unknown."""

    @property
    def is_deciding(self) -> bool:
        """Whether agents are deciding."""

    @property
    def is_moving(self) -> bool:
        """Whether agents are deciding or moving: the context must not end before they have finished."""


class IContext(ABC):
    """The engines, the random streams, and the lifetime of a scenario."""

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
        """The game, if it was started; unlike `ctx.game`, reading this does not start a game."""
        return None

    @property
    @abstractmethod
    def logger(self) -> "ILogger":
        """The logger of the context."""

    @property
    @abstractmethod
    def ictx(self) -> "IInternalContext":
        """Engines that serve other engines."""

    @property
    @abstractmethod
    def seed(self) -> int:
        """The seed of all random streams of this context."""

    @property
    @abstractmethod
    def rng(self) -> "Generator":
        """The scenario's own random stream."""

    @abstractmethod
    def stream(self, *names: str | int) -> "Generator":
        """Return the random stream of one purpose: equal seeds and names give equal draws."""

    @abstractmethod
    def is_terminated(self) -> bool:
        """Return whether the scenario has ended (or has not begun)."""

    @abstractmethod
    def terminate(self) -> None:
        """End the scenario and release its resources; a second call does nothing."""


class HostContext(Protocol):
    """A context with the engines of `gamms.context`, as needed by games, recorders and recordings.

    Any: the classes of the engines cannot be imported here.
    """

    is_seeded: bool

    # ruff: noqa: D102 - see `gamms.Context`
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
    def use_game(self, game: object) -> None: ...
    def capture(self, agents: Any, *, only_plain: bool) -> Any: ...
    def is_terminated(self) -> bool: ...
    def terminate(self) -> None: ...
    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: "TracebackType | None", /
    ) -> None: ...


contexts: Registry[IContext] = Registry("kind of context", "gamms.contexts", "gamms.context")
"""Registered factories of contexts; engines use them because they cannot import `gamms.context`."""
