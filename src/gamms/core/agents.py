# cython: binding=False, auto_pickle=False, embedsignature=True, embedsignature.format=clinic
"""Agents of one game: the columns that moves read and write, and agents as views of one row.

A program that loops over its agents calls `get_state` and `set_state` of each; both need only the columns of this
module. Subclasses handle the rare cases: agents on edges, actions other than node ids, and errors.
"""

from __future__ import annotations

from array import array
from collections.abc import Hashable
from typing import Any

from gamms.core import block as blocks
from gamms.core.block import INT64


class AgentColumns:
    """Columns of the agents of one game, and their moves; a subclass has the other columns and verbs.

    Attributes:
        node, previous: (agents,) the id of the current and of the previous node of each agent.
        progress: (agents,) the position of an agent on an edge; None: it is on its node.
        teams: (agents,) the team of each agent; None: no team.
        journal: records the moves.
        travellers: the rows of agents whose progress has a motion.
        under_way: positions of agents within a turn, if agents decide at arrivals.
        is_closed: whether the journal refuses all further changes.
        is_noting: whether the journal records moves.
        version: a number that rises whenever an agent may have changed.
    """

    __slots__ = (
        *("_changed", "_have_all_changed", "_journal", "_nodes", "_origins", "is_closed", "is_noting", "node"),
        *("previous", "progress", "teams", "travellers", "under_way", "version"),
    )

    node: memoryview[int]
    previous: memoryview[int]
    progress: list[Any]
    teams: list[Any]
    travellers: set[int]
    under_way: Any
    is_closed: bool
    is_noting: bool
    _changed: set[int]
    _have_all_changed: bool
    version: int

    @property
    def journal(self) -> Any:
        """The journal of the block: it records all changes, ignores them, or refuses them."""
        return self._journal

    @journal.setter
    def journal(self, journal: Any) -> None:
        self._journal = journal
        self.is_closed = journal.is_closed
        self.is_noting = not journal.is_silent

    def show(self, node: memoryview[int], previous: memoryview[int]) -> None:
        """Use these arrays, (agents,), as the current and the previous nodes of all agents."""
        self.node = node
        self.previous = previous
        self._nodes = node
        self._origins = previous

    def move(self, row: int, node: int) -> None:
        """Move an agent on the ground, and store the node that it leaves as its previous node."""
        if not self.is_closed:
            self._move(row, node)

    def move_rows(self, rows: memoryview[int], ends: memoryview[int]) -> int:
        """Move agents to nodes without recording it; return the number of agents that change their node.

        Args:
            rows: (agents,) their rows.
            ends: (agents,) the ids of the nodes.

        Raises:
            IndexError: a row does not exist; the agents before it have moved.
        """
        return blocks.move_rows(self._nodes, self._origins, rows, ends)

    def on_edge(self, row: int) -> Any:
        """Return the position of an agent on an edge; None on a node, or in the air."""
        if row not in self.travellers:
            return None
        place_at = self.under_way.places.get(row)
        if place_at is not None:
            return place_at(self.under_way.time)
        progress = self.progress[row]
        return progress if progress is not None and progress.source == self._node_of(row) else None

    def move_all(self, rows: Any, ends: Any) -> int:
        """Move many agents on the ground; an agent that stays keeps its previous node.

        Args:
            rows: their rows, as a `Selection`.
            ends: (agents,) the ids of the nodes.
        """
        if self.is_closed:
            return 0
        nodes = memoryview(array(INT64, ends)) if type(ends) is list else ends
        before = rows.of(self.node) if self.is_noting else None
        moved = blocks.move_rows(self._nodes, self._origins, rows.buffer, nodes)
        self.version += 1
        if 2 * len(rows.rows) > len(self._nodes):
            self._have_all_changed = True
        else:
            self._changed.update(rows.as_set)
        if before is not None and moved:
            self._note_moves(rows, before, nodes, moved)
        return 0

    def _note_moves(self, rows: Any, before: Any, ends: Any, moved: int) -> None:
        """Record the moves of the `moved` agents that did not stay."""
        raise NotImplementedError

    def _move(self, row: int, node: int) -> int:
        if row < 0 or row >= len(self._nodes):
            raise IndexError(f"There is no agent in row {row}.")
        if self.is_noting:
            journal = self._journal
            log = journal.log
            ids = journal.ids
            log.append(ids[row])
            log.append(node)
        self._origins[row] = self._nodes[row]
        self._nodes[row] = node
        self.version += 1  # NOTE: not by `_note`, which a subclass could replace (benchmarks: the loop)
        self._changed.add(row)
        return 0

    def _note(self, row: int) -> int:
        """Note the change of an agent."""
        self.version += 1
        self._changed.add(row)
        return 0

    def _node_of(self, row: int) -> int:
        if row < 0 or row >= len(self._nodes):
            raise IndexError(f"There is no agent in row {row}.")
        return self._nodes[row]


class PointedColumns:
    """Loads the nodes of one game of a batch into the columns of a single game.

    Attributes:
        columns: the columns of the single game.
        node, previous: (games * agents,) the ids of nodes in all games.
    """

    def __init__(self, columns: AgentColumns, node: memoryview[int], previous: memoryview[int]) -> None:
        self.columns = columns
        self.node = node
        self.previous = previous

    def point(self, game: int) -> int:
        """Copy the current and the previous nodes of one game into the columns.

        Raises:
            IndexError: there is no game of this number.
        """
        columns = self.columns
        size = len(columns._nodes)
        first = game * size
        if game < 0 or first + size > len(self.node):
            raise IndexError(f"There is no game {game}.")
        for i in range(size):
            columns._nodes[i] = self.node[first + i]
            columns._origins[i] = self.previous[first + i]
        return 0


class MoveColumns:
    """The nodes where the agents of one game begin and end a turn."""

    def __init__(self, starts: memoryview[int], ends: memoryview[int]) -> None:
        self.starts = starts
        self.ends = ends


class MovingAgents:
    """The agents of one game that take part in a turn.

    Attributes:
        columns: the columns of all agents.
        rows: (agents,) the row of each agent of the turn.
        counts: (agents,) the number of moves to another node that each has made.
        blocked: (agents,) the number of moves of each that were stopped.
    """

    def __init__(
        self, columns: AgentColumns, rows: memoryview[int], counts: memoryview[int], blocked: memoryview[int]
    ) -> None:
        self.columns = columns
        self.rows = rows
        self.counts = counts
        self.blocked = blocked

    def begin(self, moves: MoveColumns) -> int:
        """Set the start and the end of each move to the agent's current node (IndexError: a row does not exist)."""
        columns = self.columns
        for i in range(len(self.rows)):
            node = columns._node_of(self.rows[i])
            moves.starts[i] = node
            moves.ends[i] = node
        return 0

    def count(self, moves: MoveColumns) -> int:
        """Count the moves that end on another node than they begin."""
        for i in range(len(self.rows)):
            if moves.starts[i] != moves.ends[i]:
                self.counts[i] += 1
        return 0

    def counted(self) -> list[int]:
        """Return the numbers of the agents that have moved or were stopped."""
        return [i for i in range(len(self.rows)) if self.counts[i] != 0 or self.blocked[i] != 0]


class AgentView:
    """An agent: a view of one row of the columns, with sensors and a strategy.

    Attributes:
        _phase: the phase of the context; its `agent` is not None while agents decide.
        _block: the columns.
        _row: the row of the agent.
        _near: node id -> the nodes that are legal from there.
        _carried: the sensors, as `(name, data, type, look)`; if `look` is None, `data` gets the legal nodes.
        _last: a list whose only item is the last state that the agent got.
    """

    __slots__ = (
        "_block",
        "_carried",
        "_ctx",
        "_last",
        "_near",
        "_phase",
        "_row",
        "_sensor_list",
        "_shared",
        "strategy",
    )

    _phase: Any
    _block: Any
    _row: int
    _near: Any
    _carried: tuple[Any, ...]
    _last: list[Any]

    @property
    def team(self) -> Any:
        """The team of the agent, any hashable value; None: no team. Settable."""
        return self._block.teams[self._row]

    @team.setter
    def team(self, team: Hashable) -> None:
        self._put_in_team(team)

    @property
    def current_node_id(self) -> int:
        """The id of the agent's node; setting it leaves `prev_node_id` unchanged."""
        node: int = self._block._node_of(self._row)
        return node

    @current_node_id.setter
    def current_node_id(self, node_id: int) -> None:
        self._put_on(node_id)

    def get_state(self) -> Any:
        """Ask the sensors; return a new dict with `curr_pos` and `sensor`, or the last one if the context has ended."""
        if self._phase.agent is not None:
            self._phase.refuse("call agent.get_state")
        block = self._block
        if block.is_closed:
            return self._last_state()
        row = self._row
        node = block._node_of(row)
        if block.progress[row] is not None:
            state = {"curr_pos": node, "sensor": self.sense()}
            self._last[0] = state
            return state
        sensed = {}
        for name, last, kind, look in self._carried:
            if look is None:
                seen = [*self._near[node]]
                last[0] = seen
                sensed[name] = (kind, seen)
            else:
                look.sense(node)
                sensed[name] = (look.type, last[0])
        state = {"curr_pos": node, "sensor": sensed}
        self._last[0] = state
        return state

    def set_state(self) -> None:
        """Execute `state['action']`; after the context has ended, do nothing."""
        if self._phase.agent is not None:
            self._phase.refuse("call agent.set_state")
        block = self._block
        if block.is_closed:
            return
        try:
            action = self._last[0]["action"]
        except KeyError:
            self._refuse_without_action()
        # NOTE: a plain node id comes first: it is every move of most games (benchmarks: the loop).
        if type(action) is int and action in self._near:
            block._move(self._row, action)
        else:
            self._act(action)

    def _put_in_team(self, team: Hashable) -> None:
        """Set the team."""
        raise NotImplementedError

    def _put_on(self, node_id: int) -> None:
        """Set the node."""
        raise NotImplementedError

    def sense(self) -> dict[str, Any]:
        """Ask all sensors; return a dict: name -> (type, data)."""
        raise NotImplementedError

    def _last_state(self) -> Any:
        """Return the last state, when the context has ended."""
        raise NotImplementedError

    def _refuse_without_action(self) -> None:
        """Raise the error for a strategy that has set no action."""
        raise NotImplementedError

    def _act(self, action: object) -> None:
        """Execute an action other than the id of a neighboring node."""
        raise NotImplementedError
