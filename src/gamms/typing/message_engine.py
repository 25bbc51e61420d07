"""Contract of messages between processes; no engine implements it yet, `ctx.ictx.message` is None."""

from abc import ABC, abstractmethod
from typing import Any


class IMessageEngine(ABC):
    """Channels that carry arrays."""

    @abstractmethod
    def generate_channel_name(self) -> str:
        """A name that no other channel has."""

    @abstractmethod
    def create_publisher(self, tensor: Any, channel_name: str | None = None, ttl: int = 0) -> None:
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
