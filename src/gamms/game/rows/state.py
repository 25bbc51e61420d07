"""The state of a game of a batch in a context of its own."""

from functools import partial
from typing import Any, NoReturn

from gamms.game.snapshots import Snapshot
from gamms.ir.game_state import GameState
from gamms.typing.agent_engine import IAgent

_READ = ("began", "counts", "driven", "errors", "events", "memories", "messages", "moves", "scores")
"""Fields of the state of a game that are made when they are read; so is `over`, which may be set."""


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
        turn: int | None = self.start.row.last_turn
        return turn


def _read_field(name: str, state: GameState) -> Any:
    return state.start.row.read_field(name)


def _refuse_turn(state: GameState, _: object) -> None:
    state.start.row.refuse_verb("plays a turn of the game")


def _read_data(state: GameState) -> dict[Any, Any]:
    data: dict[Any, Any] = state.start.row.read_data()
    return data


def _replace_data(state: GameState, data: dict[Any, Any]) -> None:
    row = state.start.row
    row.read_data()
    put_data(state, data)
    row.read["data"] = data


_memories: Any = vars(GameState)["memories"]  # the slots
_data: Any = vars(GameState)["data"]
_moves: Any = vars(GameState)["moves"]
_driven: Any = vars(GameState)["driven"]


def get_memories(state: GameState) -> dict[str, dict[Any, Any]]:
    """Return the memories of the agents of a game of a batch that functions have written."""
    found: dict[str, dict[Any, Any]] = _memories.__get__(state)
    return found


def get_moves(state: GameState) -> Any:
    """Return the moves of the last turn before the batch; None: there are none."""
    return _moves.__get__(state)


def get_driven(state: GameState) -> dict[str, tuple[int, ...]]:
    """Return the edges that agents of a game of a batch have driven that obey turns by metres."""
    found: dict[str, tuple[int, ...]] = _driven.__get__(state)
    return found


def get_data(state: GameState) -> dict[Any, Any]:
    """Return `ctx.game.data` of a game of a batch, perhaps without the data of rules in the core."""
    found: dict[Any, Any] = _data.__get__(state)
    return found


def put_data(state: GameState, data: dict[Any, Any]) -> None:
    """Set `ctx.game.data` of a game of a batch."""
    _data.__set__(state, data)


for _name in _READ:
    setattr(RowState, _name, property(partial(_read_field, _name), _refuse_turn))
for _name, _read, _write in (
    ("data", _read_data, _replace_data),
    ("over", partial(_read_field, "over"), lambda state, over: state.start.row.end(over)),
):
    setattr(RowState, _name, property(_read, _write))
