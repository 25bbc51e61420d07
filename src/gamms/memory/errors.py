"""The three refusals that only stores need."""

from collections.abc import Iterable

from gamms.errors import GammsError, nearest
from gamms.text import shown


class UnknownMap(GammsError, IndexError):
    """A data operation on a map that was not created."""

    def __init__(self, map_name: object, known: Iterable[str]) -> None:
        super().__init__(f"Unknown map {shown(map_name)}.{nearest(map_name, known)} Create it with create_map first.")


class DuplicateKey(GammsError, KeyError):
    """A key that already has a row."""

    def __init__(self, map_name: str, key: object) -> None:
        super().__init__(f"Map {shown(map_name)} already has a row with key {shown(key)}. Change it with update_data.")


class BadKeyField(GammsError, IndexError):
    """A primary key that the schema cannot have."""
