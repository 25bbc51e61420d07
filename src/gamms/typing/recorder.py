"""Contract of the recorder, and the operation codes of recordings in format version 2."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from typing import Any, BinaryIO, Literal, TypedDict, TypeVar

from gamms.ir import events as kinds
from gamms.plugins import Registry

C = TypeVar("C", bound=type)  # a class that a decorator returns as it is

MAGIC_NUMBER = b"MMGR"
VERSION = (2).to_bytes(4, "big")


class OpCodes(Enum):
    """What one record says."""

    TERMINATE = kinds.TERMINATE
    SIMULATE = kinds.SIMULATE
    AGENT_CREATE = kinds.AGENT_CREATE
    AGENT_DELETE = kinds.AGENT_DELETE
    AGENT_CURRENT_NODE = kinds.AGENT_CURRENT_NODE
    AGENT_PREV_NODE = kinds.AGENT_PREV_NODE
    AGENT_SENSOR_REGISTER = kinds.AGENT_SENSOR_REGISTER
    AGENT_SENSOR_DEREGISTER = kinds.AGENT_SENSOR_DEREGISTER
    AGENT_ORIENTATION = kinds.AGENT_ORIENTATION
    AERIAL_AGENT_POSITION = kinds.AERIAL_AGENT_POSITION
    AERIAL_AGENT_QUATERNION = kinds.AERIAL_AGENT_QUATERNION
    COMPONENT_REGISTER = kinds.COMPONENT_REGISTER
    COMPONENT_CREATE = kinds.COMPONENT_CREATE
    COMPONENT_UPDATE = kinds.COMPONENT_UPDATE
    COMPONENT_DELETE = kinds.COMPONENT_DELETE
    COMPONENT_UNREGISTER = kinds.COMPONENT_UNREGISTER


Step = tuple[Any, Any]
"""The node, or the position (x, y, z) in the air, of an agent before and after its last move."""


class IPlayback(ABC):
    """A recording while it is replayed, of which any turn can be shown.

    Attributes:
        is_open: whether it can still be replayed.
    """

    is_open: bool

    @property
    @abstractmethod
    def turn(self) -> int:
        """How many turns have been replayed, with the one that is shown now."""

    @property
    @abstractmethod
    def turns(self) -> int:
        """How many turns there are."""

    @property
    @abstractmethod
    def can_seek(self) -> bool:
        """Whether another turn may be shown."""

    @abstractmethod
    def highlights(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield what rules emitted, changes of the scores (`scores`) and the end (`over`), each with its turn."""

    @abstractmethod
    def steps(self, turn: int) -> dict[str, Step]:
        """Return the last move of every agent up to a turn, by name."""

    @abstractmethod
    def seek(self, turn: int) -> None:
        """Let everything be as it was after so many turns, and go on from there."""

    @abstractmethod
    def play_turn(self) -> None:
        """Replay the next turn."""

    @abstractmethod
    def close(self) -> None:
        """Close the file; nothing more is replayed."""


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
        """Apply a recording, one record per step.

        Yields:
            A dict with `timestamp`, nanoseconds, `opCode`, the value of an `OpCodes`, and but at the end `data`.
        """

    @abstractmethod
    def time(self) -> int:
        """The recorder's clock in nanoseconds."""

    @abstractmethod
    def write(self, opCode: OpCodes, data: dict[str, Any]) -> None:  # noqa: N803 - published name
        """Write one record."""

    @abstractmethod
    def component(self, struct: Mapping[str, object] | None) -> Callable[[C], C]:
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
    def add_component(self, name: str, obj: object) -> None:
        """Keep a component under a name."""

    @abstractmethod
    def is_component_registered(self, key: tuple[str, str]) -> bool:
        """Whether a component class is known."""

    @abstractmethod
    def unregister_component(self, key: tuple[str, str]) -> None:
        """Forget a component class."""


class PageOptions(TypedDict, total=False):
    """The keywords of pages that replay a recording in a browser."""

    title: str
    """What stands above the map and on the tab: the name of the scenario."""
    theme: Literal["light", "dark"] | None
    """The colours: None, those that the browser prefers."""
    labels: bool | Literal["auto"]
    """Whether agents have their names beside them: "auto", while they are few."""
    trails: int
    """Of how many turns the ways of agents are shown, 200 at most: 0."""
    turn: int
    """After which turn it begins: 0."""
    follow: str | None
    """The name of an agent to keep in the middle: None."""
    audience: str | None
    """A team, by its text; what it could not know is not in the page: None, all is."""
    still: bytes | None
    """A picture, PNG or SVG, for where no scripts run: None."""


pages: Registry[bytes] = Registry("form of pages of recordings", "gamms.pages", "gamms.web")
"""What makes a page of a recording, which plays in a browser; the recorder finds it under the name "gamms"."""
