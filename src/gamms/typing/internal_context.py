"""Contract of the internal context: stores, background tasks and messages for other engines."""

from abc import ABC, abstractmethod
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gamms.typing.memory_engine import IMemoryEngine


class IInternalContext(ABC):
    """The engines that serve other engines."""

    @property
    @abstractmethod
    def memory(self) -> "IMemoryEngine":
        """The stores."""

    @property
    @abstractmethod
    def compute(self) -> "IComputeEngine | None":
        """Background tasks; None without such an engine."""

    @property
    @abstractmethod
    def message(self) -> "IMessageEngine | None":
        """Messages between processes; None without such an engine."""

    @abstractmethod
    def terminate(self) -> None:
        """Close every engine."""


# -- background tasks; no engine implements them yet, `ctx.ictx.compute` is None -------------------------------------


class TaskStatus(Enum):
    """The status of a task."""

    PENDING = 0
    RUNNING = 1
    COMPLETED = 2
    FAILED = 3


class ITask(ABC):
    """A unit of work."""

    @property
    @abstractmethod
    def id(self) -> str:
        """A name that no other task has."""

    @property
    @abstractmethod
    def status(self) -> TaskStatus:
        """The status of the task."""

    @abstractmethod
    def run(self) -> None:
        """Run the task once."""


class IComputeEngine(ABC):
    """Runs tasks."""

    @abstractmethod
    def submit(self, task: ITask) -> None:
        """Queue `task`."""

    @abstractmethod
    def wait(self, task: ITask) -> None:
        """Block until `task` has ended; raise its error if it failed."""

    @abstractmethod
    def terminate(self) -> None:
        """End the engine."""


# -- messages between processes; no engine implements them yet, `ctx.ictx.message` is None ---------------------------


class IMessageEngine(ABC):
    """Channels that carry arrays."""

    @abstractmethod
    def generate_channel_name(self) -> str:
        """A name that no other channel has."""

    @abstractmethod
    def create_publisher(self, tensor: object, channel_name: str | None = None, ttl: int = 0) -> None:
        """Publish `tensor` on a channel."""

    @abstractmethod
    def create_subscriber(self, channel_name: str) -> None:
        """Subscribe to a channel."""

    @abstractmethod
    def list_active_channels(self) -> list[str]:
        """Names of the open channels."""

    @abstractmethod
    def terminate(self) -> None:
        """End the engine."""
