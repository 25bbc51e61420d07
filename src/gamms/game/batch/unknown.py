"""What games in arrays do not have: values that stand for it where scalar rules are called, and refuse to be read."""

from typing import Any, NoReturn

from gamms.errors import GammsError


class NeedsTurnEngine(GammsError):
    """A rule uses what games that are played in arrays do not have, or changes more than one game."""


class Unknown(dict[Any, Any]):
    """What arrays do not have: a rule that looks at it needs the turn engine, which is added to the notes."""

    def __init__(self, notes: list[str], what: str) -> None:
        super().__init__()
        self._notes, self._what = notes, what

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        self._notes.append(f"it needs {self._what}")
        raise NeedsTurnEngine(self._notes[-1])

    __bool__ = __contains__ = __delitem__ = __eq__ = __getitem__ = __iter__ = __len__ = __ne__ = __or__ = __ror__ = (
        __setitem__
    ) = __repr__ = __format__ = _refuse
    clear = copy = get = items = keys = pop = popitem = setdefault = update = values = _refuse


class OfSome(Unknown):
    """What agents or teams have, such as facts; that there is some is known."""

    def __bool__(self) -> bool:  # type: ignore[override] # alone of all that refuse
        """Whether there is any: slots ask for it."""
        return True


class OfSlots(OfSome):
    """What slots of the turn engine have a part of: how often agents moved, what they remember and learn."""

    def setdefault(self, _: object, default: object = None) -> Any:  # type: ignore[override] # likewise
        """Return what a slot is to have."""
        return default
