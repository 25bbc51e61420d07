"""Contract of the recorder, and the operation codes of recordings in format version 2."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from typing import Any, BinaryIO, Literal, TypedDict, TypeVar

from gamms.ir import events as kinds
from gamms.plugins import Registry

C = TypeVar("C", bound=type)  # a class returned unchanged by a decorator

MAGIC_NUMBER = b"MMGR"
VERSION = (2).to_bytes(4, "big")


class OpCodes(Enum):
    """The kind of a record."""

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
"""The node, or the position (x, y, z), of an agent before and after its last move."""


class IPlayback(ABC):
    """A recording during replay, which can show any turn.

    Attributes:
        is_open: whether it can still be replayed.
    """

    is_open: bool

    @property
    @abstractmethod
    def turn(self) -> int:
        """The number of turns replayed, including the turn that is shown."""

    @property
    @abstractmethod
    def turns(self) -> int:
        """The number of turns."""

    @property
    @abstractmethod
    def can_seek(self) -> bool:
        """Whether another turn can be shown."""

    @abstractmethod
    def highlights(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield (turn, data) of events emitted by rules, changes of the scores (`scores`) and the end (`over`)."""

    @abstractmethod
    def steps(self, turn: int) -> dict[str, Step]:
        """Return the last move of every agent up to a turn, by name."""

    @abstractmethod
    def seek(self, turn: int) -> None:
        """Show the state after this number of turns, and continue from there."""

    @abstractmethod
    def play_turn(self) -> None:
        """Replay the next turn."""

    @abstractmethod
    def close(self) -> None:
        """Close the file; no further replay is possible."""


class IRecorder(ABC):
    """Records events and replays them."""

    @abstractmethod
    def record(self) -> bool:
        """Return whether events are being written."""

    @abstractmethod
    def start(self, path: str | BinaryIO) -> None:
        """Begin a recording."""

    @abstractmethod
    def stop(self) -> None:
        """End the recording."""

    @abstractmethod
    def pause(self) -> None:
        """Pause writing."""

    @abstractmethod
    def play(self) -> None:
        """Resume writing."""

    @abstractmethod
    def replay(self, path: str | BinaryIO) -> Iterator[dict[str, Any]]:
        """Apply a recording, one record per step.

        Yields:
            A dict with `timestamp` in nanoseconds, `opCode`, the value of an `OpCodes`, and `data`, except at the end.
        """

    @abstractmethod
    def time(self) -> int:
        """Return the recorder's clock in nanoseconds."""

    @abstractmethod
    def write(self, opCode: OpCodes, data: dict[str, Any]) -> None:  # noqa: N803 - published name
        """Write one record."""

    @abstractmethod
    def component(self, struct: Mapping[str, object] | None) -> Callable[[C], C]:
        """Return a decorator for a class whose declared fields are recorded."""

    @abstractmethod
    def get_component(self, name: str) -> object:
        """Return a component by name."""

    @abstractmethod
    def delete_component(self, name: str) -> None:
        """Delete a component."""

    @abstractmethod
    def component_iter(self) -> Iterable[str]:
        """Return the names of the components."""

    @abstractmethod
    def add_component(self, name: str, obj: object) -> None:
        """Add a component under a name."""

    @abstractmethod
    def is_component_registered(self, key: tuple[str, str]) -> bool:
        """Return whether a component class is registered."""

    @abstractmethod
    def unregister_component(self, key: tuple[str, str]) -> None:
        """Unregister a component class."""


class PageOptions(TypedDict, total=False):
    """The keywords of pages that replay a recording in a browser."""

    title: str
    """The title above the map and on the tab. Default: the name of the scenario."""
    theme: Literal["light", "dark"] | None
    """The colors. Default: None, those that the browser prefers."""
    labels: bool | Literal["auto"]
    """Whether the names of agents are shown beside them. Default: "auto", if there are few agents."""
    trails: int
    """The number of turns for which the paths of agents are shown, at most 200. Default: 0."""
    sensors: bool
    """Whether the views of sensors are shown, if the recording has them and few agents live. Default: True.
    """
    turn: int
    """The turn after which the replay begins. Default: 0."""
    follow: str | None
    """The name of an agent to keep in the center. Default: None."""
    audience: str | None
    """A team, by its text; the page leaves out what this team could not know. Default: None, the page has everything.
    """
    still: bytes | None
    """A PNG or SVG picture for browsers without scripts. Default: None."""


pages: Registry[bytes] = Registry("form of pages of recordings", "gamms.pages", "gamms.web")
"""Registered makers of browser pages of recordings; the recorder uses the one named "gamms"."""
