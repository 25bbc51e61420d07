"""The rows of a batch: games whose contexts show the columns of all games, and in which functions are called.

This module handles Python objects and holds the GIL.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import get_ident
from typing import Any

from gamms.core.agents import AgentColumns, MoveColumns
from gamms.core.draws import TurnCounter


class RowColumns:
    """The columns of the games of a batch that the contexts of rows show.

    Args:
        stop: (1,) not 0: Ctrl-C was pressed.
        turn: (games,) the number of turns that each game has played.
        node, previous: (games * agents,) the rows of nodes.
        alive, placed: (games * agents,) whether each agent lives, and whether a rule has placed it in this turn.
        number_of: (nodes,) the number that contexts give to each row of a node.
        row_of: (numbers,) the row of the node that has this number in contexts.
    """

    def __init__(
        self,
        stop: memoryview[int],
        turn: memoryview[int],
        node: memoryview[int],
        previous: memoryview[int],
        alive: memoryview[int],
        placed: memoryview[int],
        number_of: memoryview[int],
        row_of: memoryview[int],
    ) -> None:
        self.stop = stop
        self.turn = turn
        self.node = node
        self.previous = previous
        self.alive = alive
        self.placed = placed
        self.number_of = number_of
        self.row_of = row_of


class Call:
    """What is the same in all games in which a function is called.

    Attributes:
        is_moving: whether agents are about to move, or are moving.
        part: the part of the turn in which agents decide; 0 outside of them.
    """

    def __init__(self) -> None:
        self.is_moving = False
        self.part = 0


class Row:
    """A game of a batch in its own context, in which functions are called; a subclass has what few functions need.

    Args:
        number: the number of the game.
        games: the columns of all games.
        call: what is the same in all games.
        phase: the phase of the context.
        turns: its turn engine.
        values: its state, with the attributes `turn` and `facts`.
        own: the attributes of the context; `_seed` is its seed.
        seed: the seed of the game.
        state: the state of all games: its `notice_interrupt` raises KeyboardInterrupt.
        count_map_changes: returns the changes of the map.

    Attributes:
        number, turns, values, seed: see the arguments.
        why: why the game needs columns of its own; "": it does not.
        raised: what the function has raised that was called last; None: nothing.
        undone: agent -> the reasons other than conflicts why its last action failed.
        read: the fields of its state that were made when they were read.
        facts_shown: its facts before the function that is called.
        journal: records changes of agents.
        lasts: the last states of agents, and the last data of sensors, each a list of one item.
        look: this item, while no function has read it; None: the items are kept.
        epoch: the epoch of the context when the function was called.
        map_changes: the changes of the map that is shown.
        sees_world_only: whether all sensors that are called look only at the graph and the agents.
        shows_more: whether the context shows, or may have to show, more of the game than turn, nodes and lives.
    """

    def __init__(
        self,
        number: int,
        games: RowColumns,
        call: Call,
        phase: Any,
        turns: Any,
        values: Any,
        own: dict[str, Any],
        seed: object,
        state: Any,
        count_map_changes: Callable[[], object],
    ) -> None:
        self.number = number
        self._games = games
        self._call = call
        self._phase = phase
        self.turns = turns
        self.values = values
        self._own = own
        self.seed = seed
        self._state = state
        self._count_map_changes = count_map_changes
        self.map_changes: Any = None
        self.sees_world_only = True
        self._facts: dict[str, Any] = values.facts
        self.facts_shown: dict[str, Any] = dict(self._facts)
        self.read: dict[str, Any] = {}
        self.undone: dict[str, str] = {}
        self.why = ""
        self.raised: BaseException | None = None
        self.journal: Any = None
        self.lasts: list[list[Any]] = []
        self._kept: list[Any] = []  # their items before the function that is called
        self.look: Any = None
        self.epoch = -1
        self.shows_more = True

    def take_columns(self, columns: AgentColumns, places: memoryview[int]) -> int:
        """Show the agents of these columns of the context, which have these places in the columns of all games."""
        self._columns = columns
        self._places = places
        return 0

    def show_more(self, *, is_other: bool, are_placed: bool) -> None:
        """Show what in most games is as at the start.

        Args:
            is_other: whether other agents live than in the context.
            are_placed: whether rules have placed agents in this turn.
        """
        raise NotImplementedError

    def take(self) -> None:
        """Write what a function has read or changed into the columns of all games."""
        raise NotImplementedError

    def note_looks(self, *, has_drawn: bool) -> None:
        """Note that a function has called sensors, or has drawn from the streams of agents."""
        raise NotImplementedError

    def show(self) -> int:
        """Show the game as it is in the columns of all games."""
        if self.read:
            self.read.clear()
        games = self._games
        columns = self._columns
        self.values.turn = games.turn[self.number]
        is_other = False
        are_placed = False
        for i in range(len(self._places)):
            at = self._places[i]
            columns._nodes[i] = games.number_of[games.node[at]]
            columns._origins[i] = games.number_of[games.previous[at]]
            if columns._lives[i] != games.alive[at]:
                is_other = True
            if games.placed[at]:
                are_placed = True
        columns.version += 1
        columns._have_all_changed = True
        if is_other or are_placed or self.shows_more:
            self.show_more(is_other=is_other, are_placed=are_placed)
        return 0

    def take_nodes(self) -> int:
        """Write the nodes of the agents, and which of them live, to the columns of all games."""
        games = self._games
        columns = self._columns
        for i in range(len(self._places)):
            at = self._places[i]
            games.node[at] = games.row_of[columns._nodes[i]]
            games.previous[at] = games.row_of[columns._origins[i]]
            games.alive[at] = columns._lives[i]
        return 0

    def show_facts(self, known: list[Any], at: int) -> int:
        """Show facts that the core knows.

        Args:
            known: the name of each fact, and a list of it in all games.
            at: the place of the game in these lists.
        """
        for name, of_games in known:
            fact = of_games[at]
            if self._facts.get(name) is not fact:
                self._facts[name] = fact
                self.facts_shown[name] = fact
        return 0

    def has_changed(self) -> bool:
        """Return whether a function has read or changed values that are taken."""
        journal = self.journal
        if self.read or journal.log or journal.progressed or self._own["_seed"] != self.seed:
            return True
        if self._phase.epoch != self.epoch or self._count_map_changes() != self.map_changes:
            return True
        return bool(self._facts != self.facts_shown)

    def has_asked(self) -> bool:
        """Return whether a function has called sensors."""
        kept = self._kept
        for i in range(len(self.lasts)):
            if self.lasts[i][0] is not (self.look if self.look is not None else kept[i]):
                return True
        return False

    def forget_looks(self) -> int:
        """Forget what agents have sensed, unless it is kept."""
        if self.look is not None:
            for last in self.lasts:
                last[0] = self.look
        return 0

    def call(self, function: Callable[..., object], args: tuple[object, ...]) -> bool:
        """Call a function in this game, and take its changes; return whether the game needs columns of its own."""
        if self._games.stop[0]:
            self._state.notice_interrupt()
        self.show()
        order = self.turns.order_now
        table: TurnCounter | None = None if order is None else order.slots.table
        begun = 0 if table is None else table.begun
        if self.look is None:
            self._kept = [last[0] for last in self.lasts]
        self.raised = None
        self._begin()
        try:
            try:
                function(*args)
            except BaseException as error:
                self.raised = error
                raise
            finally:
                if not self.why:
                    order = self.turns.order_now
                    after: TurnCounter | None = None if order is None else order.slots.table
                    has_drawn = after is not None and after.begun != (begun if after is table else 0)
                    has_looked = has_drawn or self.has_asked()
                    if has_looked:
                        self.note_looks(has_drawn=has_drawn)
                    if has_looked or self.has_changed():
                        self.take()
                    if has_looked:
                        self.forget_looks()
        except Exception:
            if not self.why:  # else it is raised where the game goes on
                raise
        finally:
            self._end()
        return bool(self.why)

    def _begin(self) -> int:
        """Refuse from now on what functions may not do that a turn calls."""
        self._phase.player = get_ident()
        self.turns.is_moving = self._call.is_moving
        self.turns.part = self._call.part
        return 0

    def _end(self) -> int:
        """Allow it again."""
        self._phase.player = None
        self.turns.is_moving = False
        return 0

    def ask(self, asker: Any, first: int) -> int:
        """Ask agents, and write the nodes to which they move to `asker.wanted`.

        Args:
            asker: says which agents are asked, and takes uncommon decisions; a `game.rows.functions.RowFunctions`.
            first: the index of the first agent in `asker.wanted`.
        """
        if self._games.stop[0]:
            self._state.notice_interrupt()
        self.show()
        asked = asker.find_asked(self)
        if asked is None:
            return 0
        asker.asking = self
        told = asker.tell_blocked(self, asked) if self.number in asker.blocked or self.undone else ()
        self._begin()
        try:
            try:
                answers = asker.ask(self, asked) if asker.asks_anew else self.turns.decide(asked.order, asked.part)
            finally:  # sensors may have written values, and fields that were read are made for this call
                if (self.read or not self.sees_world_only) and self.has_changed():
                    self.take()
            is_common = not (answers.actions or answers.failures or answers.written or self.undone)
            if asker.takes_all or not (is_common and self.sees_world_only) or answers.paths is not None:
                asker.take_decisions(self, answers, asked)
            wanted: memoryview[int] | None = asker.wanted
            if wanted is not None:
                write_ends(answers, asked.places, wanted, first)
        finally:
            self._end()
            for slot in told:  # also after an error: the reasons are those of one turn
                slot.set_blocked(None)
            self.forget_looks()
        return 0


def write_ends(answers: Any, slots: list[int], ends: memoryview[int], first: int) -> int:
    """Write the nodes to which agents move, from an index on.

    Args:
        answers: the decisions of a part of a turn, as `core.turn.Answers`.
        slots: the slot of each agent; -1: it is dead.
        ends: receives the ids of the nodes.
        first: the index of the first agent.
    """
    moves: MoveColumns | None = answers.moves
    found = answers.ends
    for i in range(len(slots)):
        slot = slots[i]
        if slot >= 0:
            ends[first + i] = found[slot] if moves is None else moves.ends[slot]
    return 0
