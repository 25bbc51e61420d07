"""The schema: one table of the columns of agents, teams and games, `COLUMNS`.

It is read by `ir/agents.py` (the block, snapshots and forks), `ir/events.py` (the kinds of event that note a change),
`agent/agent.py` (properties), `recorder` (keyframes, replays, states of recordings) and `game/batch`. The fields of the
game are entries of `GameState` in `ir/game_state.py`, one for each.

A further number per agent is one entry, such as
`Column("battery", np.float64, 1.0, event=ChangeEvent(0x01100015, "AGENT_BATTERY", Audience.TEAM, "battery"))`. Then it
is a property of agents that can be set, kept by snapshots and forks, and written to recordings where it is not 1.0. A
number for each team or for the game, such as the map that it is played on, is an entry with another `axis`.
"""

from collections.abc import Callable, Container
from copy import deepcopy
from dataclasses import field
from enum import Enum
from typing import Any, Literal, NamedTuple

import numpy as np

from gamms.arguments import as_bool, as_float, as_int
from gamms.core.block import INT64, BlockColumn

Memo = dict[int, Any]  # id() of an object -> what takes its place in a fork; see `copy.deepcopy`


class Audience(Enum):
    """Who may know of an event while the game goes on."""

    ALL = "all; of values by agents and teams, a team knows its own"
    TEAM = "the team of the agent"
    SENSED = "the team of the agent; others know what their sensors report"
    WITNESSED = "the team of the agents that the event names, and whoever sees one of them; all if it names none"
    HEARD = "the team of the sender, and those who hear or overhear it"
    HOST = "only the program that runs the game"


class ChangeEvent(NamedTuple):
    """The kind of event that notes a change of a column of agents, or of a field of the game.

    Attributes:
        code: the number that stands for it in recordings.
        name: what tables and streams call it.
        audience: who may know of it.
        key: of the value in its data.
        is_record: whether it is a record of format version 2, too.
    """

    code: int
    name: str
    audience: Audience
    key: str
    is_record: bool = False


class Column(NamedTuple):
    """A column of agents, of teams or of the game.

    Attributes:
        name: of the column.
        kind: of its numbers in arrays; None: it holds any Python values.
        initial: the number that a new agent has, and agents in keyframes without the column; None: all keyframes have
            it.
        shape: of a row in arrays; a value that has one may be None, which is NaN in arrays.
        event: notes a change of one agent; None: other events say it, or nothing changes it.
        attribute: what agents call it where that is not the name.
        is_structure: whether it says which agents there are and what they are, not where.
        is_watched: whether a change of it gives a block another version.
        is_in_block: whether blocks have it; the other columns are in keyframes alone, from what agents hold.
        parts: the columns that stand for it in keyframes.
        axis: what has a value in it: each "agent", each "team", or the "game". The last two are in blocks of games
            (`AgentBlock.games`) and in keyframes where they are not as at first.
        is_copied: whether snapshots and forks have the numbers; otherwise they begin with the initial one.
        is_recorded: whether keyframes have it.
    """

    name: str
    kind: type | None = None
    initial: Any = None
    shape: tuple[int, ...] = ()
    event: ChangeEvent | None = None
    attribute: str = ""
    is_structure: bool = False
    is_watched: bool = False
    is_in_block: bool = True
    parts: "tuple[Column, ...]" = ()
    axis: Literal["agent", "team", "game"] = "agent"
    is_copied: bool = True
    is_recorded: bool = True

    def checked(self, value: object, name: str) -> Any:
        """Return a value of the column as a plain number; `name` is what to call it in an error.

        Raises:
            BadType, BadValue: it is none.
        """
        return _CHECKS[self.kind](value, name)


_CHECKS: dict[type | None, Any] = {np.bool_: as_bool, np.int64: as_int, np.float64: as_float}
_CODES: dict[type, str] = {np.bool_: "?", np.int64: INT64, np.float64: "d"}

COLUMNS = (  # in the order of keyframes
    Column("names", is_structure=True),
    Column("numbers", np.int64, is_in_block=False),  # by which moves in recordings name agents
    Column("kind", np.int64, is_structure=True),
    Column(
        "node",
        np.int64,
        event=ChangeEvent(0x01100000, "AGENT_CURRENT_NODE", Audience.SENSED, "node_id", is_record=True),
        attribute="current_node_id",
        is_watched=True,
    ),
    Column(
        "previous",
        np.int64,
        event=ChangeEvent(0x01100001, "AGENT_PREV_NODE", Audience.SENSED, "node_id", is_record=True),
        attribute="prev_node_id",
    ),
    Column(
        "heading",
        np.float64,
        shape=(2,),
        event=ChangeEvent(0x01100004, "AGENT_ORIENTATION", Audience.SENSED, "orientation", is_record=True),
        attribute="orientation",
    ),
    Column("position", np.float64, shape=(3,)),
    Column("previous_position", np.float64, shape=(3,)),
    Column("quat", np.float64, shape=(4,)),
    Column(
        "alive",
        np.bool_,
        event=ChangeEvent(0x01100011, "AGENT_ALIVE", Audience.ALL, "alive"),
        is_structure=True,
        is_watched=True,
    ),
    Column(
        "progress",
        parts=(
            Column("edge_source", np.int64, 0),
            Column("edge_target", np.int64, 0),
            Column("edge_share", np.float64, 0.0),
            Column("edge_id", np.int64, 0),
            Column("edge_motion", np.int64, 0),
        ),
    ),
    Column(
        "teams",
        event=ChangeEvent(0x01100010, "AGENT_TEAM", Audience.ALL, "team"),
        attribute="team",
        is_structure=True,
        is_watched=True,
    ),
    Column("speed", event=ChangeEvent(0x01100012, "AGENT_SPEED", Audience.TEAM, "speed"), is_structure=True),
    Column("sensors", is_in_block=False),
    Column("attributes", is_in_block=False),
    Column("strategies", is_in_block=False),
)
"""All columns."""

AGENT_COLUMNS = tuple(column for column in COLUMNS if column.axis == "agent")
"""The columns of agents."""

BESIDE_AGENTS = tuple(column for column in COLUMNS if column.axis != "agent")
"""The columns of teams and of the game."""

BY_ROW = tuple(column.name for column in AGENT_COLUMNS if column.is_in_block)
"""The names of the columns of agents in a block."""

PLACES = tuple(column for column in AGENT_COLUMNS if column.is_in_block and not column.is_structure)
"""The columns of a block that say where agents are and how: whatever may change in each turn."""

IN_GAMES = tuple(
    BlockColumn(
        column.name,
        _CODES[column.kind],
        column.initial or 0,
        column.axis,
        column.shape[0] if column.shape else 1,
        column.is_copied,
    )
    for column in COLUMNS
    if column.is_in_block and column.kind is not None and not (column.shape and column.axis == "agent")
)
"""The columns of numbers that cannot be None, as a `core.block.Block` has them."""

NUMBERS = tuple(column for column in AGENT_COLUMNS if column.initial is not None)
"""The columns of a further number per agent, which agents have as a property."""

RECORDED_NUMBERS = tuple(column for column in NUMBERS if column.is_recorded)
"""Those of them that keyframes have."""

VECTORS = {column.name: column.shape[0] for column in AGENT_COLUMNS if column.shape}
"""Name -> how many numbers a row has, of columns that may be None."""

CHANGE_EVENTS = {column.name: column.event for column in AGENT_COLUMNS if column.event is not None}
"""Name of a column -> the kind of event that notes a change of it."""

ATTRIBUTES = {column.name: column.attribute or column.name for column in AGENT_COLUMNS}
"""Name of a column -> what agents call it."""

SETTABLE = {ATTRIBUTES[name] for name in CHANGE_EVENTS} | {column.name for column in NUMBERS}
"""The names of the attributes of agents that stand for a column and can be set."""

ON_EDGES = tuple(part.name for column in AGENT_COLUMNS for part in column.parts)
"""The columns that hold an `ir.progress.Progress`; the last two may be missing in games that count edges."""


# -- the game ---------------------------------------------------------------------------------------------------


class GameField(NamedTuple):
    """What is done with a field of `GameState`.

    Attributes:
        copied: returns the copy of a value that a snapshot or a fork holds, with what takes the place of which objects
            (see `copy.deepcopy`); None: they do not hold it.
        is_own: whether forks begin with one of their own all the same.
        refill: sets what is in a dict of which others hold a reference; None: the value is replaced.
        captured: returns a value as plain values for keyframes; None: they do not hold it.
        restored: returns the value that was captured.
        is_seldom: whether keyframes have it only where it is not empty.
        axis: what agents know of it: all ("game"), or what is under the name of an agent or under a team ("agent",
            "team"); None: nothing.
        event: notes the captured value where it has changed; None: other events say it, or nothing does.
    """

    copied: Callable[[Any, Memo | None], Any] | None = None
    captured: Callable[[Any], Any] | None = None
    restored: Callable[[Any], Any] = deepcopy
    refill: Callable[[Any, Any], None] | None = None
    is_own: bool = False
    is_seldom: bool = False
    axis: Literal["game", "agent", "team"] | None = None
    event: ChangeEvent | None = None

    def copy_for(self, value: Any, agents: Container[str], teams: Container[Any]) -> Any:
        """Return a copy of what some agents, of these teams, may know of a value."""
        own = {"agent": agents, "team": teams}.get(self.axis or "game")
        known = value if own is None else {key: one for key, one in value.items() if key in own}
        return known if self.copied is None else self.copied(known, None)


def kept(make: Callable[[], Any], *done: Any, **by_name: Any) -> Any:
    """Return a field of `GameState`: what makes its first value, and the arguments of `GameField`."""
    return field(default_factory=make, metadata={"done": GameField(*done, **by_name)})
