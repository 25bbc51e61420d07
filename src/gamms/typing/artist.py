"""Contract of an artist: one thing that is drawn, on one layer."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gamms.typing.context import IContext

Drawer = Callable[["IContext", dict[str, Any]], None]


class ArtistType(Enum):
    """Whether what an artist draws changes from frame to frame."""

    STATIC = 1
    DYNAMIC = 2


class IArtist(ABC):
    """Draws one thing; `data` is handed to its drawer."""

    data: dict[str, Any]

    @abstractmethod
    def set_layer(self, layer: int) -> None:
        """Move to another layer; lower layers are painted first."""

    @abstractmethod
    def get_layer(self) -> int:
        """The layer."""

    @abstractmethod
    def set_visible(self, visible: bool) -> None:
        """Show or hide."""

    @abstractmethod
    def get_visible(self) -> bool:
        """Whether it is shown."""

    @abstractmethod
    def set_drawer(self, drawer: Drawer) -> None:
        """Draw with another function."""

    @abstractmethod
    def get_drawer(self) -> Drawer | None:
        """The function that draws."""

    @abstractmethod
    def get_artist_type(self) -> ArtistType:
        """Static or dynamic."""

    @abstractmethod
    def set_artist_type(self, artist_type: ArtistType) -> None:
        """Say whether it changes from frame to frame."""

    @property
    @abstractmethod
    def layer_dirty(self) -> bool:
        """Whether the layer changed since it was last painted."""

    @abstractmethod
    def draw(self) -> None:
        """Call the drawer with the context and `data`."""
