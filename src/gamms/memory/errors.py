"""The three refusals that only stores need."""

from collections.abc import Iterable

from gamms.errors import GammsError, nearest


class UnknownMap(GammsError, IndexError):
    """A data operation on a map that was not created."""

    def __init__(self, map_name: object, known: Iterable[str]) -> None:
        super().__init__(f"Unknown map {map_name!r}.{nearest(map_name, known)} Create it with create_map first.")


class DuplicateKey(GammsError, KeyError):
    """A key that already has a row."""

    def __init__(self, map_name: str, key: object) -> None:
        super().__init__(f"Map {map_name!r} already has a row with key {key!r}. Change it with update_data.")


class BadKeyField(GammsError, IndexError):
    """A primary key that the schema cannot have."""
