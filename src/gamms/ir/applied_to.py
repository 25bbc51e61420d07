"""What events are applied to: a live context, or columns that were read."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.ir.graph import IntArray
from gamms.plain import Plain

if TYPE_CHECKING:
    from gamms.ir.game_state import GameState

Row = Any  # what a state calls an agent: a row of its columns, or the agent itself


class AgentsState:
    """The agents of a state; a subclass overrides what it keeps.

    What names an agent that is not there raises a KeyError or a ValueError.
    """

    def add(self, name: str, kwargs: dict[str, Any], state: dict[str, Any], strategy: str | None) -> None:
        """Add an agent: the keywords it was created with, and those columns that do not follow from them."""

    def remove(self, name: str) -> None:
        """Take an agent out."""

    def row(self, name: str) -> Row:
        """Return an agent by its name."""

    def row_of(self, number: int) -> Row:
        """Return an agent by its number."""

    def set(self, row: Row, column: str, value: Plain) -> None:
        """Set one of the columns of `ir.agents.BY_ROW`, or `strategies`, which are names."""

    def move(self, numbers: Sequence[int], nodes: Sequence[int]) -> None:
        """Move agents on the ground, in this order; a number may come more than once."""

    def fly(self, row: Row, node: int | None, position: tuple[float, ...]) -> None:
        """Move a flyer to a position, above this node; None: the node was not noted."""

    def turn(self, row: Row, quat: tuple[float, ...]) -> None:
        """Turn a flyer in space."""

    def progress(self, numbers: IntArray, columns: "Mapping[str, np.ndarray[Any, Any]]") -> None:
        """Set how far along edges agents are, as arrays by the names in `ir.events.ON_EDGES`."""

    def attribute(self, numbers: Sequence[int], name: str, values: Sequence[Plain] | None) -> None:
        """Set an attribute of the caller's, one value for each agent; None: they have it no longer."""

    def equip(self, row: Row, name: str, sensor_id: str) -> None:
        """Let an agent carry a sensor."""

    def unequip(self, row: Row, name: str) -> None:
        """Let an agent carry a sensor no longer."""


class State:
    """What events are applied to: a live context, or columns that were read; a subclass overrides what it keeps.

    Attributes:
        agents: the agents.
        game: what the game has come to.
    """

    agents: AgentsState
    game: "GameState"

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Become what a snapshot says."""

    def end_turn(self) -> None:
        """End the turn."""

    def count(self, turn: int, pace: int, starts: dict[str, Any]) -> None:
        """Number this turn, and the following ones by adding `pace`; agents began at `starts`."""

    def append(self, log: str, entry: dict[str, Any]) -> None:
        """Add to one of the logs of the game."""

    def publish(self, facts: dict[str, Any], removed: Sequence[str]) -> None:
        """Publish facts, and withdraw others."""

    def set_rng(self, rng_state: Mapping[str, Plain] | None) -> None:
        """Set the state of the context's own random stream."""

    def change_sensors(self, groups: list[dict[str, Any]], removed: Sequence[str]) -> None:
        """Remove sensors, then make or set others: of each type and keywords all `ids`."""

    def replace_world(self, world: bytes) -> None:
        """Replace graph and obstacles."""

    def show(self, visuals: dict[str, Any]) -> None:
        """Declare what it looks like."""

    def draw(self, drawing: dict[str, Any]) -> None:
        """Let an artist draw these commands from now on."""

    def change_component(self, kind: int, data: dict[str, Any]) -> None:
        """Do what one of the five operation codes of components says."""
