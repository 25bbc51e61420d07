"""Contract of the internal context: engines that serve other engines, not users."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gamms.typing.compute_engine import IComputeEngine
    from gamms.typing.memory_engine import IMemoryEngine
    from gamms.typing.message_engine import IMessageEngine


class IInternalContext(ABC):
    """The engines behind the rooms."""

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
