"""The state of a game of a batch in a context of its own."""

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any, NoReturn

from gamms.game.snapshots import Snapshot
from gamms.ir.game_state import GameState
from gamms.typing.agent_engine import IAgent

_READ = ("began", "counts", "driven", "errors", "events", "memories", "messages", "moves", "scores")
"""Fields of the state of a game that are made when they are read; so is `over`, which may be set."""
_OF_ONE = ("__contains__", "__delitem__", "__getitem__", "__setitem__", "get", "pop", "setdefault")
_OF_ALL = (
    *("__eq__", "__format__", "__ior__", "__iter__", "__len__", "__ne__", "__or__"),
    *("__repr__", "__ror__", "clear", "copy", "items", "keys", "popitem", "update", "values"),
)


class GuardedDict(dict[Any, Any]):
    """A dict of a game, some of whose values are not in it until a function reads one of them.

    Args:
        values: the values of the other keys.
        keys: the keys whose values are not in it; None: all.
        fill: called with the dict before such a value is read, to put all of them in.

    Attributes:
        is_filled: whether all values are in it.
    """

    def __init__(
        self, values: dict[Any, Any], keys: frozenset[str] | None, fill: Callable[["GuardedDict"], object]
    ) -> None:
        super().__init__(values)
        self._unread = keys
        self.fill_by(fill)
        self.is_filled = False

    def __bool__(self) -> bool:
        return len(self) > 0

    def __deepcopy__(self, memo: dict[int, Any]) -> dict[Any, Any]:
        return deepcopy({**self}, memo)

    def fill_by(self, fill: Callable[["GuardedDict"], object]) -> None:
        """Set the function that puts the values in."""
        self._fill = fill

    def fill(self) -> None:
        """Put all values in, unless they are."""
        if not self.is_filled:
            self.is_filled = True
            try:
                self._fill(self)
            except BaseException:
                self.is_filled = False
                raise

    def may_lack(self, key: object) -> bool:
        """Return whether the value of a key is possibly not in it."""
        return not self.is_filled and (self._unread is None or key in self._unread)


def _make_filling_method(name: str, *, is_of_one: bool) -> Callable[..., Any]:
    """Return the method of `dict` with this name, which first fills the dict if it may lack the key, or any value."""
    method = getattr(dict, name)

    def read(self: GuardedDict, *args: object, **named: object) -> Any:
        if not is_of_one or self.may_lack(args[0]):
            self.fill()
        return method(self, *args, **named)

    return read


for _name in (*_OF_ONE, *_OF_ALL):
    setattr(GuardedDict, _name, _make_filling_method(_name, is_of_one=_name in _OF_ONE))


class RowStart:
    """The start of a game of a batch; the game cannot be reset to it.

    Args:
        row: the game, as a `RowOfGame`. Any: its class imports this module.
        at_rest: the start of a game like it.
    """

    def __init__(self, row: Any, at_rest: Snapshot) -> None:
        self.row = row
        self.at_rest = at_rest

    @property
    def snapshot(self) -> "RowStart":
        """The object with the start places of agents."""
        return self

    @property
    def agents(self) -> Any:
        """What agents know of others that look ahead: see `Snapshot.agents`."""
        return self.at_rest.agents

    @property
    def sensors(self) -> Any:
        """The same of sensors; see `Snapshot.sensors`."""
        return self.at_rest.sensors

    @property
    def data(self) -> dict[str, Any]:
        """The data of rules at the start; read-only."""
        return self.at_rest.data

    def places_of(self, _: object) -> dict[str, Any]:
        """Return the start places of agents."""
        return {**self.row.read_field("began")}

    def place_of(self, agent: IAgent) -> Any:
        """Return the place of an agent that came later."""
        return getattr(agent, "position", agent.current_node_id)

    def __getattr__(self, name: str) -> NoReturn:
        """Refuse everything else."""
        if name.startswith("__"):
            raise AttributeError(name)
        self.row.refuse_verb("resets the game")
        raise AttributeError(name)


class RowState(GameState):
    """The state of a game of a batch; some fields are made from the columns of all games when they are read."""

    __slots__ = ()

    def get_memory(self, name: str) -> dict[Any, Any]:
        """Return the writable memory of an agent."""
        return get_memories(self).setdefault(name, {})

    @property
    def row(self) -> int:  # type: ignore[override] # it is not set here
        """The number of the game in `deed_log`."""
        number: int = self.start.row.number
        return number

    @property
    def last_turn(self) -> int | None:  # type: ignore[override] # it is not set here
        """The turn after which the present `run` stops; None: no limit."""
        turn: int | None = self.start.row.find_last_turn()
        return turn


def _read_field(name: str, state: GameState) -> Any:
    return state.start.row.read_field(name)


def _refuse_turn(state: GameState, _: object) -> None:
    state.start.row.refuse_verb("plays a turn of the game")


def _replace_data(state: GameState, data: dict[Any, Any]) -> None:
    put_data(state, data)
    state.start.row.read["data"] = data


_memories: Any = vars(GameState)["memories"]  # the slots
_data: Any = vars(GameState)["data"]
_moves: Any = vars(GameState)["moves"]


def get_memories(state: GameState) -> dict[str, dict[Any, Any]]:
    """Return the memories of the agents of a game of a batch that functions have written."""
    found: dict[str, dict[Any, Any]] = _memories.__get__(state)
    return found


def get_moves(state: GameState) -> Any:
    """Return the moves of the last turn before the batch; None: there are none."""
    return _moves.__get__(state)


def put_data(state: GameState, data: dict[Any, Any]) -> None:
    """Set `ctx.game.data` of a game of a batch."""
    _data.__set__(state, data)


for _name in _READ:
    setattr(RowState, _name, property(partial(_read_field, _name), _refuse_turn))
_read_data: Any = _data.__get__
for _name, _read, _write in (
    ("data", _read_data, _replace_data),
    ("over", partial(_read_field, "over"), lambda state, over: state.start.row.end(over)),
):
    setattr(RowState, _name, property(_read, _write))
