# cython: binding=False, auto_pickle=False, embedsignature=True, embedsignature.format=clinic
"""Agents of one game: the columns that moves read and write, numbers of nodes, and agents as views of one row.

A program that loops over its agents calls `get_state` and `set_state` of each; both need only the columns of this
module. Subclasses handle the rare cases: agents on edges, actions other than node ids, and errors.
"""

from __future__ import annotations

from array import array
from collections.abc import Hashable
from threading import Lock
from typing import Any

from gamms.core import block as blocks
from gamms.core.block import INT64

MASK = 0xFFFFFFFFFFFFFFFF
SPREAD = 0x9E3779B97F4A7C15  # odd, for hashes by multiplication
FIRST_ROOM = 64  # a power of two


class MoveColumns:
    """The ids of the nodes where the agents of one game begin and end a turn."""

    def __init__(self, starts: memoryview[int], ends: memoryview[int]) -> None:
        self.starts = starts
        self.ends = ends


class NodeNumbers:
    """Numbers of nodes, or of other things with ids: a hash table in which a new id gets the next number.

    A number is never used again, so it stays valid when its node is removed from a map. Contexts that share a map share
    its numbers, also in several threads.

    Args:
        dense: the ids from 0 to `dense - 1` are their own numbers, without a look-up in the table.

    Attributes:
        ids: (room,) the id of each number; the first `count` are in use.
        count: the number of ids.
        room: the maximum number of ids; it grows when necessary.
        known: id -> number, for ids that are Python objects: those that were looked up so far.
    """

    def __init__(self, dense: int = 0) -> None:
        self.dense = dense
        self.known: dict[int, int] = {}
        self.lock: Any = Lock()  # of those that add ids
        self.ids = memoryview(array(INT64, range(dense)))
        self.count = dense
        self.make_room(FIRST_ROOM)

    def __reduce__(self) -> tuple[Any, ...]:
        return number_nodes, (array(INT64, self.ids[: self.count]),)

    def __deepcopy__(self, memo: Any) -> NodeNumbers:
        """Return this object: numbers never change, so copies share them."""
        return self

    def make_room(self, places: int) -> int:
        """Make room for `places` ids beyond the dense ones, a power of two, and keep the existing ones."""
        ids = memoryview(array(INT64, bytes(8 * (self.dense + places))))
        ids[: self.count] = self.ids[: self.count]
        slots = memoryview(array(INT64, b"\xff" * (16 * places)))  # all are -1: free
        for number in range(self.dense, self.count):
            slots[find_slot(slots, ids, ids[number])] = number
        self.room = self.dense + places
        self.ids = ids  # NOTE: before the slots, for threads that look up ids meanwhile, where the core is interpreted
        self.slots = slots
        return 0

    def number(self, id: int) -> int:
        """Return the number of an id; a new id gets the next number."""
        if 0 <= id < self.dense:
            return id
        last = len(self.slots) - 1
        slot = (((id * SPREAD) & MASK) >> 32) & last
        number = self.slots[slot]
        while number >= 0 and self.ids[number] != id:
            slot = (slot + 1) & last
            number = self.slots[slot]
        return number if number >= 0 else self.add(id)

    def add(self, id: int) -> int:
        """Return the number of an id that seems to be new: another thread may have added it."""
        with self.lock:
            if self.count == self.room:
                self.make_room(len(self.slots))
            return self.enter(id)

    def enter(self, id: int) -> int:
        """Return the number of an id; a new id gets the next number, for which there must be room."""
        slot = find_slot(self.slots, self.ids, id)
        if self.slots[slot] < 0:
            self.ids[self.count] = id
            self.slots[slot] = self.count
            self.count += 1
        return self.slots[slot]

    def learn(self, id: Any) -> Any:
        """Return the number of an id as a Python object, and keep it in `known`."""
        found = self.number(id)
        self.known[id] = found
        return found

    def write(self, ids: memoryview[int], numbers: memoryview[int]) -> int:
        """Write the number of each id to `numbers`."""
        for row in range(len(ids)):
            numbers[row] = self.number(ids[row])
        return 0

    def write_moves(self, moves: MoveColumns, numbers: MoveColumns) -> int:
        """Write the numbers of the starts and the ends of moves to `numbers`."""
        self.write(moves.starts, numbers.starts)
        return self.write(moves.ends, numbers.ends)

    def write_ids(self, numbers: memoryview[int], ids: memoryview[int]) -> int:
        """Write the id of each number to `ids`."""
        for row in range(len(numbers)):
            ids[row] = self.ids[numbers[row]]
        return 0


def find_slot(slots: memoryview[int], ids: memoryview[int], id: int) -> int:
    """Return the slot of an id in a hash table of `NodeNumbers`, or the free one where it belongs."""
    last = len(slots) - 1
    slot = (((id * SPREAD) & MASK) >> 32) & last
    while slots[slot] >= 0 and ids[slots[slot]] != id:
        slot = (slot + 1) & last
    return slot


def number_nodes(ids: memoryview[int]) -> NodeNumbers:
    """Return numbers in which each id has its place in `ids`, (nodes,), if no id is there twice."""
    dense = 0
    while dense < len(ids) and ids[dense] == dense:
        dense += 1
    found = NodeNumbers(dense)
    places = FIRST_ROOM
    while places < len(ids) - dense:
        places *= 2
    if places > FIRST_ROOM:
        found.make_room(places)
    for place in range(dense, len(ids)):
        found.enter(ids[place])
    return found


class AgentColumns:
    """Columns of the agents of one game, and their moves; a subclass has the other columns and verbs.

    Attributes:
        node, previous: (agents,) the number of the current and of the previous node of each agent, see `get_node`.
        alive: (agents,) whether each agent takes part in turns.
        numbers: the numbers of the nodes.
        share: (agents,) the part that each agent has covered of an edge, see `get_progress`; NaN: it is on its node.
        teams: (agents,) the team of each agent; None: no team.
        journal: records the moves.
        travellers: the rows of agents whose progress has a motion.
        under_way: positions of agents within a turn, if agents decide at arrivals.
        is_closed: whether the journal refuses all further changes.
        is_noting: whether the journal records moves.
        version: a number that rises whenever an agent may have changed.
    """

    __slots__ = (
        *("_changed", "_edge_numbers", "_edges", "_goals", "_have_all_changed", "_journal", "_lives", "_motions"),
        *("_nodes", "_origins", "_shares", "_sources", "_targets"),
        *("alive", "is_closed", "is_noting", "node", "numbers"),
        *("previous", "share", "teams", "travellers", "under_way", "version"),
    )

    node: memoryview[int]
    previous: memoryview[int]
    alive: memoryview[bool]
    numbers: NodeNumbers
    _edge_numbers: NodeNumbers | None
    share: memoryview[float]
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

    def show(
        self, node: memoryview[int], previous: memoryview[int], share: memoryview[float], alive: memoryview[bool]
    ) -> None:
        """Use these arrays, (agents,), as the columns of these names."""
        self.node = node
        self.previous = previous
        self.share = share
        self.alive = alive
        self._lives = alive.cast("B")
        self._shares = share
        self._nodes = node
        self._origins = previous
        self._goals = node[:0]

    def show_on_edges(
        self, source: memoryview[int], target: memoryview[int], edge: memoryview[int], motion: memoryview[int]
    ) -> None:
        """Use these arrays, (agents,), as the numbers and the motions of positions on edges."""
        self._sources = source
        self._targets = target
        self._edges = edge
        self._motions = motion

    def get_node(self, row: int) -> int:
        """Return the id of the node of an agent (IndexError: the row does not exist)."""
        return self._get_node(row)

    def get_previous_node(self, row: int) -> int:
        """Return the id of the previous node of an agent (IndexError: the row does not exist)."""
        if row < 0 or row >= len(self._origins):
            raise IndexError(f"There is no agent in row {row}.")
        return self.numbers.ids[self._origins[row]]

    def put(self, row: int, node: int) -> int:
        """Set the node of an agent by its id, without noting a change (IndexError: the row does not exist)."""
        self.node[row] = self.numbers.number(node)
        return 0

    def get_ids(self, numbers: memoryview[int]) -> memoryview[int]:
        """Return the ids of nodes; maybe the same array, if ids are numbers."""
        if self.numbers.count == self.numbers.dense:
            return numbers
        ids = memoryview(array(INT64, bytes(8 * len(numbers))))
        self.numbers.write_ids(numbers, ids)
        return ids

    def move(self, row: int, node: int) -> None:
        """Move an agent on the ground, and store the node that it leaves as its previous node."""
        if not self.is_closed:
            self._move(row, node, self.numbers.number(node))

    def get_edge_position(self, row: int) -> Any:
        """Return the position of an agent on an edge; None on a node, or in the air."""
        if row not in self.travellers:
            return None
        place_at = self.under_way.places.get(row)
        if place_at is not None:
            return place_at(self.under_way.time)
        progress = self.get_progress(row)
        return progress if progress is not None and progress.source == self._get_node(row) else None

    def get_progress(self, row: int) -> Any:
        """Return the position of an agent on an edge, as `ir.progress.Progress`; None: it is on its node.

        Raises:
            IndexError: the row does not exist.
        """
        if row < 0 or row >= len(self._shares):
            raise IndexError(f"There is no agent in row {row}.")
        share = self._shares[row]
        if share != share:  # noqa: PLR0124 - NaN
            return None
        ids = self.numbers.ids
        edge = 0 if self._edges[row] < 0 else self._edge_numbers.ids[self._edges[row]]  # type: ignore[union-attr]
        return self._make_progress(ids[self._sources[row]], ids[self._targets[row]], share, edge, self._motions[row])

    def _make_progress(self, source: int, target: int, share: float, edge: int, motion: int) -> Any:
        """Return a position on an edge, given the ids of its nodes and of the edge."""
        raise NotImplementedError

    def move_all(self, rows: Any, ends: Any) -> int:
        """Move many agents on the ground; an agent that stays keeps its previous node.

        Args:
            rows: their rows, as a `Selection`.
            ends: (agents,) the ids of the nodes.
        """
        if self.is_closed:
            return 0
        nodes = memoryview(array(INT64, ends)) if type(ends) is list else ends
        before = rows.gather(self.node) if self.is_noting else None
        if len(self._goals) < len(nodes):  # NOTE: kept, because to make it takes a twentieth of a turn (w8 one)
            self._goals = memoryview(array(INT64, bytes(8 * len(nodes))))
        goals = self._goals[: len(nodes)]
        self.numbers.write(nodes, goals)
        moved = blocks.move_rows(self._nodes, self._origins, rows.buffer, goals)
        self.version += 1
        if 2 * len(rows.rows) > len(self._nodes):
            self._have_all_changed = True
        else:
            self._changed.update(rows.as_set)
        if before is not None and moved:
            self._note_moves(rows, before, rows.gather(self.node), nodes, moved)
        return 0

    def _note_moves(self, rows: Any, before: Any, goals: Any, ends: Any, moved: int) -> None:
        """Record the moves of the `moved` agents that did not stay, given the numbers of nodes, and the ids of ends."""
        raise NotImplementedError

    def _move(self, row: int, node: int, number: int) -> int:
        """Move an agent to a node, given its id and its number."""
        if row < 0 or row >= len(self._nodes):
            raise IndexError(f"There is no agent in row {row}.")
        if self.is_noting:
            journal = self._journal
            log = journal.log
            ids = journal.ids
            log.append(ids[row])
            log.append(node)
        self._origins[row] = self._nodes[row]
        self._nodes[row] = number
        self.version += 1  # NOTE: not by `_note`, which a subclass could replace (benchmarks: the loop)
        self._changed.add(row)
        return 0

    def _note(self, row: int) -> int:
        """Note the change of an agent."""
        self.version += 1
        self._changed.add(row)
        return 0

    def _get_node(self, row: int) -> int:
        if row < 0 or row >= len(self._nodes):
            raise IndexError(f"There is no agent in row {row}.")
        return self.numbers.ids[self._nodes[row]]


class MovingAgents:
    """The agents of one game, dead or alive, in the order of turns.

    Attributes:
        columns: their columns.
        rows: (agents,) the row of each agent.
        takes_part: (agents,) whether each was alive when the present part of a turn began; see `take_lives`.
        are_all: whether all were.
        lives: the same as `takes_part`, as bytes for `let_take_part`; the same object until others take part.
        has_begun: (agents,) whether each has taken part in some turn.
        counts: (agents,) the number of moves to another node that each has made.
        blocked: (agents,) the number of moves of each that were stopped.
    """

    def __init__(
        self, columns: AgentColumns, rows: memoryview[int], counts: memoryview[int], blocked: memoryview[int]
    ) -> None:
        self.columns = columns
        self.rows = rows
        self.takes_part = bytearray(len(rows))
        self.has_begun = bytearray(len(rows))
        self._takes_part = memoryview(self.takes_part)
        self._has_begun = memoryview(self.has_begun)
        self.lives = bytes(self.takes_part)
        self.are_all = len(rows) == 0
        self.counts = counts
        self.blocked = blocked

    def take_lives(self) -> bool:
        """Let the agents take part that are alive now; return whether one of them does so for the first time."""
        columns = self.columns
        are_all = True
        are_new = False
        is_other = False
        for i in range(len(self.rows)):
            is_alive = columns._lives[self.rows[i]]
            if self._takes_part[i] != is_alive:
                self._takes_part[i] = is_alive
                is_other = True
            if not is_alive:
                are_all = False
            elif not self._has_begun[i]:
                self._has_begun[i] = 1
                are_new = True
        self.are_all = are_all
        if is_other:
            self.lives = bytes(self.takes_part)
        return are_new

    def let_take_part(self, lives: bytes) -> None:
        """Let other agents take part."""
        self.takes_part[:] = lives
        self.lives = lives
        for i in range(len(lives)):
            if lives[i]:
                self._has_begun[i] = 1
        self.are_all = 0 not in lives

    def leave_out(self, starts: memoryview[int], ends: memoryview[int], took_part: bytes) -> int:
        """Let agents that took no part stay where they are now: a rule may have placed them meanwhile."""
        for i in range(len(self.rows)):
            if not took_part[i]:
                starts[i] = self.columns._get_node(self.rows[i])
                ends[i] = starts[i]
        return 0

    def select_present(self, agents: Any) -> Any:
        """Return those of some agents that take part; the same object if all agents do."""
        if self.are_all:
            return agents
        found = []
        for i in agents:
            if self._takes_part[i]:
                found.append(i)  # noqa: PERF401 - a comprehension is not compiled as well
        return found

    def select_living(self, agents: list[Any]) -> list[Any]:
        """Return those of all agents, (agents,), that are alive now."""
        columns = self.columns
        found = []
        for i in range(len(self.rows)):
            if columns._lives[self.rows[i]]:
                found.append(agents[i])  # noqa: PERF401 - a comprehension is not compiled as well
        return found

    def begin(self, moves: MoveColumns) -> int:
        """Set the start and the end of each move to the agent's current node (IndexError: a row does not exist)."""
        columns = self.columns
        for i in range(len(self.rows)):
            node = columns._get_node(self.rows[i])
            moves.starts[i] = node
            moves.ends[i] = node
        return 0

    def count(self, moves: MoveColumns) -> int:
        """Count the moves that end on another node than they begin."""
        for i in range(len(self.rows)):
            if moves.starts[i] != moves.ends[i]:
                self.counts[i] += 1
        return 0

    def list_counted(self) -> list[int]:
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
        node: int = self._block._get_node(self._row)
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
            return self._make_last_state()
        row = self._row
        node = block._get_node(row)
        share = block._shares[row]
        if share == share:  # noqa: PLR0124 - not NaN: on an edge
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
            numbers = block.numbers
            number = numbers.known.get(action)
            if number is None:
                number = numbers.learn(action)
            block._move(self._row, action, number)
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

    def _make_last_state(self) -> Any:
        """Return the last state, when the context has ended."""
        raise NotImplementedError

    def _refuse_without_action(self) -> None:
        """Raise the error for a strategy that has set no action."""
        raise NotImplementedError

    def _act(self, action: object) -> None:
        """Execute an action other than the id of a neighboring node."""
        raise NotImplementedError
