"""All agents of a context, one row each, in the order of their creation."""

from collections.abc import Callable, Iterable, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.events import NOBODY, Journal
from gamms.ir.graph import FloatArray, IntArray

Position = tuple[float, float, float]  # x, y, z; map units
Quat = tuple[float, float, float, float]  # w, x, y, z; of length 1

UNTURNED: Quat = (1.0, 0.0, 0.0, 0.0)


class Progress(NamedTuple):
    """How much of an edge an agent on the ground has covered, short of its end."""

    source: int  # node id; the agent counts as on it
    target: int  # node id
    share: float  # of the edge; more than 0, less than 1


BY_ROW = (
    "names",
    "teams",
    "kind",
    "node",
    "previous",
    "heading",
    "position",
    "previous_position",
    "quat",
    "speed",
    "alive",
    "progress",
)


class AgentColumns:
    """Row `i` is agent `i`.

    The columns are lists, because the paper's loop reads and writes them one by one, and arrays are made of them
    when asked for (benchmarks/README.md, w2).

    Attributes:
        names, teams: of each agent; a team is whatever the caller calls one.
        kind: 0 on the ground, 1 in the air: the values of `AgentType`.
        node, previous: ids of nodes; of a flyer those below it, the nearest ones.
        heading: `(cos, sin)` where it was set; None where it follows from the last move, and for flyers.
        position, previous_position: `(x, y, z)` of flyers, map units; None on the ground.
        quat: `(w, x, y, z)` of flyers, of length 1; None on the ground.
        speed: of flyers, map units per step; on the ground what the turn engine lets it move, None for one edge.
        alive: whether it takes part.
        progress: on the edge that an agent on the ground is moving along; None where it has covered nothing of one.
        progressed: rows whose `progress` was written; the reader clears it.
        out: the rows of those that are not alive.
        journal: where what happens to agents is noted.
        roster: a number that changes whenever an agent comes, goes, dies, returns, or has another team, speed or
            sensor.
        touched: rows whose node, position or team may have changed; whoever writes one of these adds to it.
        flying: row of a flyer -> how many flyers stand before it, ascending.
        adrift: rows of flyers that have moved since their node was worked out.
        moves: a number that has changed, after `nodes` or `rows_at`, whenever a node, position or team may have.
        surveyed: the revision of the graph in which the nodes of the other flyers were.
    """

    __slots__ = (
        *BY_ROW,
        "_crowds",
        "_flyers",
        "_nodes",
        "_places",
        "_stale",
        "adrift",
        "flying",
        "journal",
        "moves",
        "out",
        "progressed",
        "roster",
        "surveyed",
        "touched",
    )

    _crowds: "Crowds | None"
    _nodes: IntArray  # (agents,)
    _flyers: IntArray  # (flying,)
    _places: FloatArray  # (flying, 3)

    def __init__(self) -> None:
        self.names: list[str] = []
        self.teams: list[Any] = []
        self.kind: list[int] = []
        self.node: list[int] = []
        self.previous: list[int] = []
        self.heading: list[tuple[float, float] | None] = []
        self.position: list[Position | None] = []
        self.previous_position: list[Position | None] = []
        self.quat: list[Quat | None] = []
        self.speed: list[float | None] = []
        self.alive: list[bool] = []
        self.progress: list[Progress | None] = []
        self.progressed: set[int] = set()
        self.roster = 0
        self.journal: Journal = NOBODY
        self.touched: set[int] = set()
        self.adrift: set[int] = set()
        self.surveyed: int | None = None
        self.moves = 0
        self._forget()

    def __len__(self) -> int:
        return len(self.names)

    def append(
        self, name: str, node: int, team: Any, position: Position | None = None, speed: float | None = None
    ) -> int:
        """Add an agent that stands on `node`, or one that flies at `position`; returns its row."""
        row = len(self.names)
        flies = position is not None
        self.names.append(name)
        self.teams.append(team)
        self.kind.append(int(flies))
        self.node.append(node)
        self.previous.append(node)
        self.heading.append(None)
        self.position.append(position)
        self.previous_position.append(position)
        self.quat.append(UNTURNED if flies else None)
        self.speed.append(speed)
        self.alive.append(True)
        self.progress.append(None)
        self.roster += 1
        self.touched.add(row)
        if flies:
            self.flying[row] = len(self.flying)
            self.adrift.add(row)
        return row

    def copy_row(self, source: "AgentColumns", row: int) -> int:
        """Add the agent in a row of other columns; returns its row here."""
        new = self.append(*(getattr(source, name)[row] for name in ("names", "node", "teams", "position", "speed")))
        for name in ("previous", "heading", "previous_position", "quat", "progress"):
            getattr(self, name)[new] = getattr(source, name)[row]
        self.set_alive(new, alive=source.alive[row])
        return new

    def set_progress(self, row: int, progress: Progress | None) -> None:
        """Say how far along an edge an agent is."""
        if self.progress[row] != progress:
            self.progress[row] = progress
            self.progressed.add(row)

    def set_alive(self, row: int, *, alive: bool) -> None:
        """Let an agent take part, or no longer."""
        self.alive[row] = alive
        if not alive:
            self.set_progress(row, None)
        (self.out.discard if alive else self.out.add)(row)
        self.roster += 1
        self.touched.add(row)

    def keep(self, rows: list[int]) -> None:
        """Forget every row but `rows`, which become rows 0, 1, … in the order given."""
        for name in BY_ROW:
            column = getattr(self, name)
            setattr(self, name, [column[row] for row in rows])
        self.journal.kept(rows)
        self.moves += 1
        self.roster += 1
        self.progressed = {i for i, row in enumerate(rows) if row in self.progressed}
        adrift = {i for i, row in enumerate(rows) if row in self.adrift}
        self._forget()
        self.adrift = adrift

    def move_back(self, values: dict[str, list[Any]]) -> None:
        """Restore where agents were; there are the same agents, with the same teams, speeds and sensors."""
        for name in ("node", "previous", "heading", "position", "previous_position", "quat", "progress"):
            getattr(self, name)[:] = values[name]
        self.touched.update(range(len(self.names)))
        self.adrift.update(self.flying)

    def write_back(self, values: dict[str, list[Any]]) -> None:
        """Give as many rows as there are the values that they had, by the names of the columns."""
        for name, column in values.items():
            getattr(self, name)[:] = column
        self.touched.update(range(len(self.names)))
        self.adrift.update(self.flying)
        self.out.clear()
        self.out.update(row for row, alive in enumerate(self.alive) if not alive)
        self.roster += 1

    # -- who is where -------------------------------------------------------------------------------------------

    def nodes(self) -> tuple[IntArray, int]:
        """The node ids (agents,) as an array not to be written to, and a number that changes whenever it does.

        The number changes with positions and teams, too.
        """
        self._catch_up()
        return self._nodes, self.moves

    def places(self) -> tuple[IntArray, FloatArray]:
        """The rows (flying,) of the flyers, ascending, and where they are (flying, 3); not to be written to."""
        self._catch_up()
        return self._flyers, self._places

    def crowds(self) -> "Crowds":
        """Who stands on which node.

        It is brought up to date by the next call, which also sets `moves`, and is not to be written to.
        """
        # NOTE: asked after every single move of the paper's loop, so it follows what was touched and makes nothing
        # anew (benchmarks/README.md, w3).
        if self._crowds is None:
            self._crowds = Crowds(self.node, self.out)
        if self.touched:
            self._note()
        return self._crowds

    def settle(self) -> None:
        """Hand on what was touched, so that nothing is."""
        if self.touched:
            self._note()

    def _note(self) -> None:
        """Hand on what was touched: to the crowds at once, to the arrays when they are asked for."""
        touched = self.touched
        self.moves += 1
        self._stale |= touched
        if self._crowds is not None:
            self._crowds.follow(touched, self.node, self.out)
        touched.clear()

    def _catch_up(self) -> None:
        """Bring the arrays up to date; those that were handed out stay as they are."""
        if self.touched:
            self._note()
        stale = self._stale
        if not stale:
            return
        is_few = len(self._nodes) == len(self.node) and len(stale) < len(self.node) // 8
        flown = stale & self.flying.keys()
        if is_few:
            self._nodes = _changed(self._nodes, stale, [self.node[row] for row in stale])
        else:
            self._nodes = _frozen(self.node, np.int64)
        if flown and is_few:
            at = [self.flying[row] for row in flown]
            self._places = _changed(self._places, at, [self.position[row] for row in flown])
        elif flown:
            self._flyers = _frozen(self.flying, np.int64)
            self._places = _frozen([self.position[row] for row in self.flying], np.float64)
        stale.clear()

    def _forget(self) -> None:
        """Forget what was worked out from the columns."""
        self.out: set[int] = {row for row, alive in enumerate(self.alive) if not alive}
        self._crowds = None
        self._nodes = _frozen([], np.int64)
        self._flyers = self._nodes
        self._places = _frozen(np.zeros((0, 3)), np.float64)
        self._stale: set[int] = set()
        self.touched = set(range(len(self.names)))
        rows = [row for row, kind in enumerate(self.kind) if kind]
        self.flying: dict[int, int] = {row: i for i, row in enumerate(rows)}


class Selection:
    """Some rows of columns, in an order of their own.

    Attributes:
        rows: which.
        as_set: the same, in no order.
    """

    __slots__ = ("_inverse", "_pick", "as_set", "rows")

    def __init__(self, rows: list[int]) -> None:
        self.rows = rows
        self.as_set = frozenset(rows)
        # NOTE: getters pick whole columns in C: every turn reads and writes all agents (benchmarks/README.md, turns).
        self._pick = _picker(rows)
        self._inverse: Callable[[Sequence[Any]], Iterable[Any]] | None = None

    def of(self, column: Sequence[Any]) -> list[Any]:
        """What the column holds in these rows."""
        return list(self._pick(column))

    def write(self, column: list[Any], values: list[Any]) -> None:
        """Set the column in these rows."""
        if len(column) == len(self.rows):
            if self._inverse is None:
                self._inverse = _picker(sorted(range(len(self.rows)), key=self.rows.__getitem__))
            column[:] = self._inverse(values)
        else:
            for row, value in zip(self.rows, values, strict=True):
                column[row] = value


class Crowds:
    """Who stands on which node, kept up to date row by row; those who are not alive stand nowhere.

    Attributes:
        at: node id -> rows of the agents there, in any order.
        taken: the ids of these nodes.
    """

    __slots__ = ("_home", "_seat", "at", "taken")

    def __init__(self, node: list[int], out: set[int]) -> None:
        self.at: dict[int, list[int]] = {}
        self.taken: set[int] = set()
        self._home: list[int | None] = []  # row -> the node whose list it is in
        self._seat: list[int] = []  # row -> where in that list
        self.follow(range(len(node)), node, out)

    def follow(self, rows: Iterable[int], node: list[int], out: set[int]) -> None:
        """Move some rows, new ones among them, to their nodes."""
        at, home, seat = self.at, self._home, self._seat
        if len(home) != len(node):
            new = len(node) - len(home)
            home += [None] * new
            seat += [0] * new
        for row in rows:
            here, before = None if row in out else node[row], home[row]
            if here == before:
                continue
            if before is not None:
                there = at[before]
                last = there.pop()
                if last != row:  # the last one takes the seat that becomes free, so that a crowd costs nothing
                    free = seat[last] = seat[row]
                    there[free] = last
                elif not there:
                    del at[before]
                    self.taken.discard(before)
            home[row] = here
            if here is None:
                continue
            if here in at:
                there = at[here]
                seat[row] = len(there)
                there.append(row)
            else:
                at[here] = [row]
                self.taken.add(here)
                seat[row] = 0


def _picker(places: list[int]) -> Callable[[Sequence[Any]], Iterable[Any]]:
    """The function that gives what is at these places of a list."""
    return itemgetter(*places) if len(places) > 1 else lambda values: [values[i] for i in places]


def _frozen(values: Iterable[Any], kind: type) -> Any:
    """A read-only array of what a column holds."""
    array: np.ndarray[Any, Any] = np.array(values if isinstance(values, (Sequence, np.ndarray)) else list(values), kind)
    array.setflags(write=False)
    return array


def _changed(array: np.ndarray[Any, Any], rows: Iterable[int], values: list[Any]) -> Any:
    """A read-only copy with other values in some rows."""
    array = array.copy()
    for row, value in zip(rows, values, strict=True):
        array[row] = value
    array.setflags(write=False)
    return array
