"""Tables that several objects share until one of them changes them."""

from typing import Self
from weakref import WeakSet


class SharesTables:
    """An object whose tables others like it may share; it copies them before it changes them."""

    _sharers: "WeakSet[SharesTables] | None" = None  # this object, and all others that share its tables

    def share_with(self, other: Self) -> None:
        """Note that this object has the tables of another."""
        if other._sharers is None:
            other._sharers = WeakSet([other])
        self._sharers = other._sharers
        self._sharers.add(self)

    def stop_sharing(self) -> bool:
        """Leave shared tables to their other owners; return whether there are any."""
        sharers = self._sharers
        self._sharers = None
        if sharers is not None:
            sharers.discard(self)
        return bool(sharers)
