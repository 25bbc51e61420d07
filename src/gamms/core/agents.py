# cython: binding=False, auto_pickle=False, embedsignature=True, embedsignature.format=clinic
"""Agents of one game: the columns that each of their moves reads and writes, and agents as views of one row.

The loop of a program over its agents asks `get_state` and `set_state` of each, which read nothing else than what is
here. What is rare (agents on edges, actions that are no nodes, errors) is left to methods of the subclasses.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

from gamms.core import block as blocks


class AgentColumns:
    """Columns of the agents of one game, and their moves; a subclass has the other columns and verbs.

    Attributes:
        node, previous: (agents,) the ids of nodes.
        progress: (agents,) where on an edge an agent is; None: on its node.
        teams: (agents,) the team of each agent; None: no team.
        journal: how moves are noted.
        is_closed: whether nothing changes any more, as the journal says.
        is_noting: whether the journal notes moves.
    """

    __slots__ = (
        *("_changed", "_journal", "_nodes", "_origins", "is_closed", "is_noting", "node", "previous", "progress"),
        "teams",
    )

    node: memoryview[int]
    previous: memoryview[int]
    progress: list[Any]
    teams: list[Any]
    is_closed: bool
    is_noting: bool
    _changed: set[int]

    @property
    def journal(self) -> Any:
        """How it writes: plainly, noting what it writes, or not at all."""
        return self._journal

    @journal.setter
    def journal(self, journal: Any) -> None:
        self._journal = journal
        self.is_closed = journal.is_closed
        self.is_noting = not journal.is_silent

    def show(self, node: memoryview[int], previous: memoryview[int]) -> None:
        """Let these be the nodes and the previous nodes of the agents that there are now."""
        self.node = node
        self.previous = previous
        self._nodes = node
        self._origins = previous

    def move(self, row: int, node: int) -> None:
        """Move an agent on the ground; the node it was on is its previous one."""
        if not self.is_closed:
            self._move(row, node)

    def move_rows(self, rows: memoryview[int], ends: memoryview[int]) -> int:
        """Move agents to nodes and note nothing, `rows` and `ends` (agents,); return how many do not stay.

        Raises:
            IndexError: there is no such row; agents before it have moved.
        """
        return blocks.move_rows(self._nodes, self._origins, rows, ends)

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
        self._changed.add(row)
        return 0

    def _node_of(self, row: int) -> int:
        if row < 0 or row >= len(self._nodes):
            raise IndexError(f"There is no agent in row {row}.")
        return self._nodes[row]


class PointedColumns:
    """Points the columns of the agents of one game at each of several games.

    Attributes:
        columns: of the agents.
        node, previous: (games * agents,) the ids of nodes in these games.
    """

    def __init__(self, columns: AgentColumns, node: memoryview[int], previous: memoryview[int]) -> None:
        self.columns = columns
        self.node = node
        self.previous = previous

    def point(self, game: int) -> int:
        """Put the agents where they are in a game, by its number among these (IndexError)."""
        columns = self.columns
        size = len(columns._nodes)
        first = game * size
        if game < 0 or first + size > len(self.node):
            raise IndexError(f"There is no game {game}.")
        for i in range(size):
            columns._nodes[i] = self.node[first + i]
            columns._origins[i] = self.previous[first + i]
        return 0


class Moves:
    """Where agents of one game begin and end a turn.

    Attributes:
        starts, ends: (agents,) ids of nodes.
    """

    def __init__(self, starts: memoryview[int], ends: memoryview[int]) -> None:
        self.starts = starts
        self.ends = ends


class MovingAgents:
    """The agents of one game that take part in a turn.

    Attributes:
        columns: of all agents.
        rows: (agents,) of these.
        counts: (agents,) how often each has gone to another node.
    """

    def __init__(self, columns: AgentColumns, rows: memoryview[int], counts: memoryview[int]) -> None:
        self.columns = columns
        self.rows = rows
        self.counts = counts

    def begin(self, moves: Moves) -> int:
        """Let the moves begin where the agents are, and end there as long as nothing else is decided (IndexError)."""
        columns = self.columns
        for i in range(len(self.rows)):
            node = columns._node_of(self.rows[i])
            moves.starts[i] = node
            moves.ends[i] = node
        return 0

    def count(self, moves: Moves) -> int:
        """Count the moves that end elsewhere than they begin."""
        for i in range(len(self.rows)):
            if moves.starts[i] != moves.ends[i]:
                self.counts[i] += 1
        return 0


class AgentView:
    """An agent: a view of a row of columns, with sensors and a strategy.

    Attributes:
        _phase: in which part of a turn the context is; its `agent` is not None while agents decide.
        _block: the columns.
        _row: of the agent in these.
        _near: node id -> the nodes that are legal from there.
        _carried: the sensors, each as `(name, data, type, look)`; without a look, `data` gets the legal nodes.
        _last: a list of the state that it was given last.
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
        """The team it plays for, any value that can be a key of a dict; None for no team. Settable."""
        return self._block.teams[self._row]

    @team.setter
    def team(self, team: Hashable) -> None:
        self._put_in_team(team)

    @property
    def current_node_id(self) -> int:
        """The node it stands on; settable, without changing `prev_node_id`."""
        node: int = self._block._node_of(self._row)
        return node

    @current_node_id.setter
    def current_node_id(self, node_id: int) -> None:
        self._put_on(node_id)

    def get_state(self) -> Any:
        """Sense; return a fresh dict with `curr_pos` and `sensor`, or the last one after the end of the context."""
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
        """Do what `state['action']` says; do nothing after the end of the context."""
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
        """Ask all sensors; return name -> (kind, data)."""
        raise NotImplementedError

    def _last_state(self) -> Any:
        """Return the state of an agent of a context that has ended."""
        raise NotImplementedError

    def _refuse_without_action(self) -> None:
        """Raise that the strategy has set no action."""
        raise NotImplementedError

    def _act(self, action: object) -> None:
        """Do what an action that is no plain node id says."""
        raise NotImplementedError
