"""Values of the game that a context is pointed at, which are made or refused when a function reads them."""

from collections.abc import Callable
from functools import partial
from typing import Any, NoReturn

from gamms.ir.game_state import GameState
from gamms.typing.agent_engine import IAgent

_READ = ("began", "counts", "data", "deeds", "errors", "events", "memories", "messages", "moves", "scores")
"""Fields of the state of a game that are made when they are read."""
_OF_ONE = ("__contains__", "__delitem__", "__getitem__", "__setitem__", "get", "pop", "setdefault")
_OF_ALL = (
    *("__bool__", "__deepcopy__", "__eq__", "__format__", "__ior__", "__iter__", "__len__", "__ne__", "__or__"),
    *("__repr__", "__ror__", "clear", "copy", "items", "keys", "popitem", "update", "values"),
)


class GuardedDict(dict[Any, Any]):
    """A dict of a game with keys whose values only the core has; if a function reads one, its game leaves.

    Args:
        values: of the other keys.
        keys: whose values the core has; None: all.
        leave: lets the game leave the shared context, and says why.
        what: the dict, in words.
    """

    def __init__(
        self, values: dict[Any, Any], keys: frozenset[str] | None, leave: Callable[[str], NoReturn], what: str
    ) -> None:
        super().__init__(values)
        self.of_core = keys
        self.leave = leave
        self.what = what


def _refusing(name: str, *, is_of_one: bool) -> Callable[..., Any]:
    """Return a method of `GuardedDict` that reads the value of one key, or all values."""
    method = getattr(dict, name, None)

    def read(self: GuardedDict, *args: object, **named: object) -> Any:
        if method is None or self.of_core is None or not is_of_one or args[0] in self.of_core:
            self.leave(f"reads {self.what}")
        return method(self, *args, **named)

    return read


for _name in (*_OF_ONE, *_OF_ALL):
    setattr(GuardedDict, _name, _refusing(_name, is_of_one=_name in _OF_ONE))


class StartOfGame:
    """The start of the game that a context is pointed at; the game cannot be reset to it.

    Args:
        read: returns the value of a field of the game.
        replace_data: sets `ctx.game.data`.
        began: returns where agents began.
        leave: lets the game leave the shared context, and says why.
    """

    def __init__(
        self,
        read: Callable[[str], Any],
        replace_data: Callable[[dict[Any, Any]], None],
        began: Callable[[], dict[str, Any]],
        leave: Callable[[str], NoReturn],
    ) -> None:
        self.read = read
        self.replace_data = replace_data
        self._began = began
        self._leave = leave

    @property
    def snapshot(self) -> "StartOfGame":
        """The object that says where agents began."""
        return self

    def places_of(self, _: object) -> dict[str, Any]:
        """Return where agents began."""
        return self._began()

    def place_of(self, agent: IAgent) -> Any:
        """Return where an agent is that has come later."""
        return getattr(agent, "position", agent.current_node_id)

    def __getattr__(self, name: str) -> NoReturn:
        """Refuse everything else."""
        if name.startswith("__"):
            raise AttributeError(name)
        self._leave("resets the game")


class PointedState(GameState):
    """The state of the game that a context is pointed at; some fields are made when they are read."""

    __slots__ = ()

    def memory_of(self, name: str) -> dict[Any, Any]:  # noqa: ARG002 - as that of a game
        """Return an empty memory; the cursor replaces it by the memory of the agent in each game."""
        return {}


def _read_field(name: str, state: GameState) -> Any:
    return state.start.read(name)


def _play_turn_in_it(state: GameState, _: object) -> None:
    state.start._leave("plays a turn of the game")


for _name in _READ:
    _set_field: Any = _play_turn_in_it if _name != "data" else lambda state, data: state.start.replace_data(data)
    setattr(PointedState, _name, property(partial(_read_field, _name), _set_field))
