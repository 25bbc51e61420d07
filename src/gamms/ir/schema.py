"""The schema: one table of the columns of agents, teams and games, `COLUMNS`.

Used by `ir/agents.py` (the block, snapshots and forks), `ir/events.py` (event kinds for changes), `agent/agent.py`
(properties), `recorder` (keyframes, replays, states of recordings) and `game/block`. The fields of the game are
declared in `GameState` in `ir/game_state.py`.

To add a number per agent, add one entry, for example `Column("battery", np.float64, 1.0, event=ChangeEvent(0x01100015,
"AGENT_BATTERY", Audience.TEAM, "battery"))`. It becomes a settable property of agents, is stored by snapshots and
forks, and is recorded where it differs from 1.0; cuts have it for the agents of a team. A column without an audience,
its own or that of its event, is left out of them. A number per team or for the game, for example the map of a game, is
an entry with another `axis`.
"""

from collections.abc import Callable, Container
from copy import deepcopy
from dataclasses import field
from enum import Enum
from itertools import chain
from math import nan
from typing import Any, Literal, NamedTuple

import numpy as np

from gamms.arguments import as_bool, as_float, as_int
from gamms.core.block import INT64, BlockColumn

Memo = dict[int, Any]  # id() of an object -> its counterpart in a fork; see `copy.deepcopy`


class Audience(Enum):
    """The audience of an event while the game is played."""

    ALL = "everyone; an agent's own value: its team and those who see it; values kept per agent or team: that team"
    TEAM = "the team of the agent"
    SENSED = "the team of the agent; others know what their sensors report"
    WITNESSED = "the team of the agents that the event names, and those who see one of them; all if it names none"
    HEARD = "the team of the sender, and those who hear or overhear it"
    HOST = "only the program that runs the game"


class ChangeEvent(NamedTuple):
    """The kind of event that records a change of a column of agents, or of a field of the game.

    Attributes:
        code: its number in recordings.
        name: its name in tables and streams.
        audience: which agents may know of it.
        key: key of the value in its data.
        is_record: whether it is also a record of format version 2.
    """

    code: int
    name: str
    audience: Audience
    key: str
    is_record: bool = False


class Column(NamedTuple):
    """A column of agents, of teams or of the game.

    Attributes:
        name: name of the column.
        kind: type of its numbers in arrays; None: any Python values.
        initial: value of new agents, and of agents in keyframes without the column; None: all keyframes have the
            column.
        shape: shape of a row in arrays; values of such columns may be None, which is NaN in arrays.
        event: records a change for one agent; None: other events record it, or it never changes.
        attribute: name of the attribute of agents, if it differs from `name`.
        is_structure: whether it defines which agents exist and their kind, not their position.
        is_watched: whether a change of it changes the version of a block.
        is_in_block: whether blocks have it; other columns exist only in keyframes, from data of the agents.
        parts: the columns that store it in keyframes.
        numbers: the columns that store it in a block, if a value is not one number but can be made of several.
        axis: owner of each value: "agent", "team", or "game". Columns of the last two are in blocks of games
            (`AgentBlock.games`), and in keyframes if they differ from the initial value.
        is_copied: whether snapshots and forks copy the numbers; otherwise they begin with the initial value.
        is_recorded: whether keyframes have it.
        audience: which agents may know the values of an agent; None: those that may know of its `event`.
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
    numbers: tuple[BlockColumn, ...] = ()
    axis: Literal["agent", "team", "game"] = "agent"
    is_copied: bool = True
    is_recorded: bool = True
    audience: Audience | None = None

    def find_audience(self) -> Audience:
        """Return which agents may know the values of an agent; without a declaration only the host."""
        if self.audience is not None:
            return self.audience
        return Audience.HOST if self.event is None else self.event.audience

    def check_value(self, value: object, name: str) -> Any:
        """Return a checked value of the column as a plain number; `name` is its name in error messages.

        Raises:
            BadType, BadValue: the value is invalid.
        """
        return _CHECKS[self.kind](value, name)


_CHECKS: dict[type | None, Any] = {np.bool_: as_bool, np.int64: as_int, np.float64: as_float}
_CODES: dict[type, str] = {np.bool_: "?", np.int64: INT64, np.float64: "d"}

COLUMNS = (  # in the order of keyframes
    Column("names", is_structure=True, audience=Audience.SENSED),
    # by which moves in recordings refer to agents; cuts have their own
    Column("numbers", np.int64, is_in_block=False, audience=Audience.HOST),
    Column("kind", np.int64, is_structure=True, audience=Audience.SENSED),
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
    Column(
        "position",
        np.float64,
        shape=(3,),
        numbers=(BlockColumn("position", "d", nan, "flyer", 3),),
        audience=Audience.SENSED,
    ),
    Column(
        "previous_position",
        np.float64,
        shape=(3,),
        numbers=(BlockColumn("previous_position", "d", nan, "flyer", 3),),
        audience=Audience.SENSED,
    ),
    Column(
        "quat",
        np.float64,
        shape=(4,),
        numbers=(BlockColumn("quat", "d", nan, "flyer", 4),),
        audience=Audience.SENSED,
    ),
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
        numbers=(
            BlockColumn("source", INT64, 0),
            BlockColumn("target", INT64, 0),
            BlockColumn("share", "d", nan),
            BlockColumn("edge", INT64, -1),
            BlockColumn("motion", INT64, 0),
        ),
        audience=Audience.SENSED,
    ),
    Column(
        "teams",
        event=ChangeEvent(0x01100010, "AGENT_TEAM", Audience.ALL, "team"),
        attribute="team",
        is_structure=True,
        is_watched=True,
    ),
    Column(
        "speed",
        event=ChangeEvent(0x01100012, "AGENT_SPEED", Audience.TEAM, "speed"),
        is_structure=True,
        numbers=(BlockColumn("speed", "d", nan), BlockColumn("has_int_speed", "?", False)),
    ),
    # recorded with the attributes
    Column("modes", attribute="mode", is_structure=True, is_recorded=False, audience=Audience.TEAM),
    Column("sensors", is_in_block=False, audience=Audience.TEAM),
    Column("attributes", is_in_block=False, audience=Audience.TEAM),
    Column("strategies", is_in_block=False, audience=Audience.HOST),
)
"""All columns."""

AGENT_COLUMNS = tuple(column for column in COLUMNS if column.axis == "agent")
"""The columns of agents."""

BESIDE_AGENTS = tuple(column for column in COLUMNS if column.axis != "agent")
"""The columns of teams and of the game."""

BY_ROW = tuple(column.name for column in AGENT_COLUMNS if column.is_in_block)
"""The names of the columns of agents in a block."""

PLACES = tuple(column for column in AGENT_COLUMNS if column.is_in_block and not column.is_structure)
"""The columns of positions and states in a block: all that may change in each turn."""

_ONE_NUMBER = tuple(
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

IN_GAMES = (*_ONE_NUMBER, *chain.from_iterable(column.numbers for column in COLUMNS))
"""The number columns, as in a `core.block.Block`."""

NUMBERS = tuple(column for column in AGENT_COLUMNS if column.initial is not None)
"""The columns of additional numbers per agent, which agents have as properties."""

RECORDED_NUMBERS = tuple(column for column in NUMBERS if column.is_recorded)
"""The additional numbers in keyframes."""

VECTORS = {column.name: column.shape[0] for column in AGENT_COLUMNS if column.shape}
"""Name -> number of values per row, for columns that may be None."""

CHANGE_EVENTS = {column.name: column.event for column in AGENT_COLUMNS if column.event is not None}
"""Name of a column -> kind of the event that records its changes."""

ATTRIBUTES = {column.name: column.attribute or column.name for column in AGENT_COLUMNS}
"""Name of a column -> name of the attribute of agents."""

SETTABLE = {ATTRIBUTES[name] for name in CHANGE_EVENTS} | {column.name for column in NUMBERS}
"""The names of settable attributes of agents that are stored in columns."""

ON_EDGES = tuple(part.name for part in chain.from_iterable(column.parts for column in AGENT_COLUMNS))
"""The columns of an `ir.progress.Progress`; the last two may be missing in games that count edges."""


# -- the game ---------------------------------------------------------------------------------------------------


class GameField(NamedTuple):
    """The declaration of a field of `GameState`.

    Attributes:
        copied: function that copies a value for a snapshot or a fork, with a memo of replaced objects (see
            `copy.deepcopy`); None: not copied.
        is_own: whether forks begin with a new value if it is not copied.
        refill: function that sets the contents of a dict to which other objects refer; None: the value is replaced.
        captured: function that returns a value as plain values for keyframes; None: not in keyframes.
        restored: function that restores a captured value.
        is_seldom: whether keyframes have it only if it is not empty.
        axis: the part known to agents: everything ("game"), or the value under the agent's name or team ("agent",
            "team"); None: nothing.
        event: records the captured value after a change; None: other events record it, or nothing does.
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
        """Return a copy of the part of a value that some agents, of these teams, may know."""
        own = {"agent": agents, "team": teams}.get(self.axis or "game")
        known = value if own is None else {key: one for key, one in value.items() if key in own}
        return known if self.copied is None else self.copied(known, None)


def game_field(make: Callable[[], Any], *done: Any, **by_name: Any) -> Any:
    """Return a field of `GameState`: with its initial value, and the arguments of `GameField`."""
    return field(default_factory=make, metadata={"done": GameField(*done, **by_name)})
