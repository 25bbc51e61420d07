"""Contract of an artist: one thing that is drawn, on one layer."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import Enum
from typing import Any

Drawer = Callable[[Any, dict[str, Any]], None]
"""Draws an artist: a function of the context and of the artist's `data`.

Any: the context is made of what is declared here and cannot be named here; a drawer says it itself:
`def draw(ctx: gamms.Context, data: dict[str, Any]) -> None`.
"""


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
        """Return the layer."""

    @abstractmethod
    def set_visible(self, visible: bool) -> None:
        """Show or hide."""

    @abstractmethod
    def get_visible(self) -> bool:
        """Return whether it is shown."""

    @abstractmethod
    def set_drawer(self, drawer: Drawer) -> None:
        """Draw with another function."""

    @abstractmethod
    def get_drawer(self) -> Drawer | None:
        """Return the function that draws."""

    @abstractmethod
    def get_artist_type(self) -> ArtistType:
        """Return whether it changes from frame to frame."""

    @abstractmethod
    def set_artist_type(self, artist_type: ArtistType) -> None:
        """Set whether it changes from frame to frame."""

    @property
    @abstractmethod
    def layer_dirty(self) -> bool:
        """Whether the layer changed since it was last painted."""

    @abstractmethod
    def draw(self) -> None:
        """Call the drawer with the context and `data`."""
