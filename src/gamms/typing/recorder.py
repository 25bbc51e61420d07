"""Contract of the recorder."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from typing import Any, BinaryIO

from gamms.typing.opcodes import OpCodes


class IRecorder(ABC):
    """Writes what happens and plays it again."""

    @abstractmethod
    def record(self) -> bool:
        """Whether events are being written now."""

    @abstractmethod
    def start(self, path: str | BinaryIO) -> None:
        """Begin a recording."""

    @abstractmethod
    def stop(self) -> None:
        """End the recording."""

    @abstractmethod
    def pause(self) -> None:
        """Stop writing for a while."""

    @abstractmethod
    def play(self) -> None:
        """Write again."""

    @abstractmethod
    def replay(self, path: str | BinaryIO) -> Iterator[dict[str, Any]]:
        """Apply a recording, one record per step."""

    @abstractmethod
    def time(self) -> int:
        """The recorder's clock in nanoseconds."""

    @abstractmethod
    def write(self, opCode: OpCodes, data: dict[str, Any]) -> None:  # noqa: N803 - published name
        """Write one record."""

    @abstractmethod
    def component(self, struct: dict[str, type]) -> Callable[[type], type]:
        """Decorator: a class whose declared fields are recorded."""

    @abstractmethod
    def get_component(self, name: str) -> object:
        """A component by name."""

    @abstractmethod
    def delete_component(self, name: str) -> None:
        """Forget a component."""

    @abstractmethod
    def component_iter(self) -> Iterable[str]:
        """Names of the components."""

    @abstractmethod
    def add_component(self, name: str, obj: Any) -> None:
        """Keep a component under a name."""

    @abstractmethod
    def is_component_registered(self, key: tuple[str, str]) -> bool:
        """Whether a component class is known."""

    @abstractmethod
    def unregister_component(self, key: tuple[str, str]) -> None:
        """Forget a component class."""
