"""Interfaces of states to which events are applied: a live context, or columns read from a file."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.ir.graph import IntArray
from gamms.plain import Plain

if TYPE_CHECKING:
    from gamms.ir.game_state import GameState

Row = Any  # reference to an agent in a state: a row of its columns, or the agent itself


class AgentsState:
    """The agents of a state; subclasses override the methods for data that they store.

    Methods raise KeyError or ValueError for unknown agents.
    """

    def add(self, name: str, kwargs: dict[str, Any], state: dict[str, Any], strategy: str | None) -> None:
        """Add an agent: the keywords of its creation, and the columns that do not follow from them."""

    def remove(self, name: str) -> None:
        """Remove an agent."""

    def find_row(self, name: str) -> Row:
        """Return an agent by name."""

    def find_numbered_row(self, number: int) -> Row:
        """Return an agent by number."""

    def set(self, row: Row, column: str, value: Plain) -> None:
        """Set a column of `ir.schema.BY_ROW`, or `strategies`, which are names."""

    def move(self, numbers: Sequence[int], nodes: Sequence[int]) -> None:
        """Move agents on the ground, in this order; a number may occur more than once."""

    def fly(self, row: Row, node: int | None, position: tuple[float, ...]) -> None:
        """Move a flying agent to a position above a node; None: the node was not recorded."""

    def set_rotation(self, row: Row, quat: tuple[float, ...]) -> None:
        """Set the rotation of a flying agent."""

    def set_progress(self, numbers: IntArray, columns: "Mapping[str, np.ndarray[Any, Any]]") -> None:
        """Set the progress of agents along edges, as arrays by the names in `ir.events.ON_EDGES`."""

    def set_attribute(self, numbers: Sequence[int], name: str, values: Sequence[Plain] | None) -> None:
        """Set a custom attribute, one value for each agent; None: delete it."""

    def equip(self, row: Row, name: str, sensor_id: str) -> None:
        """Add a sensor to an agent."""

    def unequip(self, row: Row, name: str) -> None:
        """Remove a sensor from an agent."""


class State:
    """A state to which events are applied: a live context, or columns; subclasses override methods for data they store.

    Attributes:
        agents: the agents.
        game: the state of the game.
    """

    agents: AgentsState
    game: "GameState"

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Replace the state by a snapshot."""

    def end_turn(self) -> None:
        """End the turn."""

    def count(self, turn: int, pace: int, starts: dict[str, Any]) -> None:
        """Set the number of this turn, and the increment for the following turns; agents began at `starts`."""

    def append(self, log: str, entry: dict[str, Any]) -> None:
        """Append to a log of the game."""

    def publish(self, facts: dict[str, Any], removed: Sequence[str]) -> None:
        """Publish facts, and withdraw other facts."""

    def set_rng(self, rng_state: Mapping[str, Plain] | None) -> None:
        """Set the state of the context's own random stream."""

    def change_sensors(self, groups: list[dict[str, Any]], removed: Sequence[str]) -> None:
        """Remove sensors, then add or update others: each group has a type, keywords and all `ids`."""

    def replace_world(self, world: bytes) -> None:
        """Replace the graph and the obstacles."""

    def show(self, visuals: dict[str, Any]) -> None:
        """Declare visuals."""

    def draw(self, drawing: dict[str, Any]) -> None:
        """Set the draw commands of an artist."""

    def change_component(self, kind: int, data: dict[str, Any]) -> None:
        """Apply an operation on components, one of five operation codes."""
