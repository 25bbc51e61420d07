"""Contract of the internal context: stores, background work and messages, which serve other engines."""

from abc import ABC, abstractmethod
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gamms.typing.memory_engine import IMemoryEngine


class IInternalContext(ABC):
    """Engines that serve other engines."""

    @property
    @abstractmethod
    def memory(self) -> "IMemoryEngine":
        """The stores."""

    @property
    @abstractmethod
    def compute(self) -> "IComputeEngine | None":
        """Background work; None while there is no such engine."""

    @property
    @abstractmethod
    def message(self) -> "IMessageEngine | None":
        """Messages between processes; None while there is no such engine."""

    @abstractmethod
    def terminate(self) -> None:
        """Close every engine."""


# -- background work; no engine implements it yet, `ctx.ictx.compute` is None ----------------------------------------


class TaskStatus(Enum):
    """Where a task is in its life."""

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
        """Where the task is in its life."""

    @abstractmethod
    def run(self) -> None:
        """Do the work, once."""


class IComputeEngine(ABC):
    """Runs tasks."""

    @abstractmethod
    def submit(self, task: ITask) -> None:
        """Queue `task`."""

    @abstractmethod
    def wait(self, task: ITask) -> None:
        """Block until `task` has ended; raise what it raised."""

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
        """Offer `tensor` on a channel."""

    @abstractmethod
    def create_subscriber(self, channel_name: str) -> None:
        """Listen to a channel."""

    @abstractmethod
    def list_active_channels(self) -> list[str]:
        """Names of the open channels."""

    @abstractmethod
    def terminate(self) -> None:
        """End the engine."""
