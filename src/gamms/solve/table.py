"""All states that a game can reach, and the outcome of each joint action."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from gamms.core.block import RecordTable
from gamms.errors import BadValue, TooLarge
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.solve.worlds import (
    GOES_ON,
    SAME,
    TOLERANCE,
    GameSetup,
    Perturbation,
    States,
    TurnResults,
    TurnSimulator,
    WordArray,
    concatenate,
    make_simulator,
)
from gamms.text import shown

_ALL_TURNS = np.iinfo(np.int64).max
_SHORT = 3  # turns: for shorter games, states include the turn instead of being compared across turns
_MORE_SCORE = 1024.0
_DRAWS = 32  # least number of turns repeated with other seeds at each moment of a game, to detect random draws
_FIRST_ROOM = 1 << 10  # states
_CHECKED = 100  # states reached in several ways whose turns are repeated, in games in a context


class Transition(NamedTuple):
    """One turn of a game, for a function as `reward=`.

    Attributes:
        before, after: agent -> its node before and after the turn, None if it is out.
        gains: team -> the change of its score.
        is_over: whether the game ended.
        winner: the team that has won; None: none.
    """

    before: Mapping[str, int | None]
    after: Mapping[str, int | None]
    gains: Mapping[Hashable, float]
    is_over: bool
    winner: Hashable


class Outcomes(NamedTuple):
    """The outcomes of joint actions, (rows,) each.

    Attributes:
        after: the next states.
        gains: (rows, teams) the changes of scores.
        winner: the number of the winning team, NO_WINNER, or GOES_ON.
    """

    after: IntArray
    gains: FloatArray
    winner: IntArray


class StateGroup(NamedTuple):
    """The states in which the teams have the same numbers of joint actions.

    Attributes:
        states: (n,) their numbers.
        rows: (n, actions of the first team, actions of the second) rows of the table.
    """

    states: IntArray
    rows: IntArray


class Table:
    """The states of a game and its transitions.

    States are numbered in the order in which they were found; state 0 is the start. A row is a state with a joint
    action of each team. Rows are sorted by state, then by the first team's action. A state in which the game is over
    has no rows.

    Attributes:
        setup: the setup of the game.
        roster: the agents.
        order: -1 if the first team moves before the second, 1 if it moves after it, 0 if they move simultaneously.
        earlier: the names of the agents that move before each team in a turn.
        last_turn: the turn after which the game ends; None: unknown.
        start_places: the nodes of all agents at the start, -1: out.
        sorted_agents: interchangeable agents, which are sorted by their nodes in all states; None: there are none.
        is_merged: whether ends with the same winner are one state, which has no places.
        by_winner: whether winners were compared.
        by_turn: whether the turn is part of the state.
        by_scores: whether the scores so far are part of the state.
        nodes: (states, agents) the positions of agents.
        alive: (states, agents)
        level: (states,) the turn at which a state was first found.
        legal: (states, agents, most) ids of nodes, padded with -1.
        counts: (states, agents) the number of choices of an agent, 1 if it decides nothing.
        sizes: (states, 2) the number of joint actions of each team.
        offsets: (states + 1,) the first row of each state.
        usual: outcomes of the rows in turns before the last one.
        last: outcomes of the rows in the last turn; None: as usual.
    """

    def __init__(
        self,
        setup: GameSetup,
        world: TurnSimulator,
        parts: "_FoundStates",
        *,
        by_turn: bool,
        by_winner: bool,
        is_merged: bool,
    ) -> None:
        self.setup = setup
        self.roster = world.roster
        self.last_turn = world.terms.last_turn
        self.start_places = world.start_places
        self.sorted_agents = world.sorted_agents
        self.is_merged = is_merged
        self.by_winner = by_winner
        self.order = _find_order(world, setup.teams)
        self.by_turn = by_turn
        self.by_scores = world.with_scores
        self.earlier = [_list_earlier_agents(world, team) for team in setup.teams]
        states = len(parts.level)
        self.nodes = np.concatenate(parts.nodes)
        self.alive = np.concatenate(parts.alive)
        self.level = np.array(parts.level)
        most = max((one.shape[2] for one in parts.legal), default=1)
        self.legal = np.full((states, len(self.roster.names), most), -1)
        self.counts = np.ones(self.nodes.shape, np.int64)
        self.sizes = np.zeros((states, 2), np.int64)
        for ids, legal, counts, sizes in zip(parts.played, parts.legal, parts.counts, parts.sizes, strict=True):
            self.legal[ids, :, : legal.shape[2]] = legal
            self.counts[ids] = counts
            self.sizes[ids] = sizes
        self.offsets = np.concatenate(([0], np.cumsum(self.sizes.prod(axis=1))))
        self.usual = _join_outcomes(parts.usual)
        self.last = _join_outcomes(parts.last) if parts.last else None

    def __len__(self) -> int:
        return len(self.nodes)

    def list_members(self, team: int) -> IntArray:
        """Return the numbers of the agents of the first or the second team."""
        return self.roster.members(self.setup.teams[team])

    @cached_property
    def shapes(self) -> list[StateGroup]:
        """The states from which turns were played, grouped by their numbers of joint actions."""
        shapes = []
        played = np.flatnonzero(np.diff(self.offsets))
        for rows, columns in np.unique(self.sizes[played], axis=0).tolist():
            states = played[(self.sizes[played] == (rows, columns)).all(axis=1)]
            grid = np.arange(rows * columns).reshape(rows, columns)
            shapes.append(StateGroup(states, self.offsets[states][:, None, None] + grid))
        return shapes

    def name_actions(self, state: int, team: int, action: int, places: Sequence[int] | None = None) -> dict[str, int]:
        """Return living agent -> the node that it goes to, for a joint action of the first or the second team.

        Args:
            state: the number of the state.
            team: 0 or 1.
            action: the number of the joint action.
            places: the nodes of all agents, in order, before they are sorted; None: they are sorted.
        """
        named = range(len(self.roster.names)) if places is None else self._sort(places)[0].tolist()
        chosen = {}
        for agent in reversed(self.list_members(team).tolist()):
            action, own = divmod(action, int(self.counts[state, agent]))
            if self.alive[state, agent]:
                chosen[self.roster.names[named[agent]]] = int(self.legal[state, agent, own])
        return chosen

    def _sort(self, places: Sequence[int]) -> tuple[IntArray, IntArray]:
        """Return whose place each agent takes in a sorted state, and the sorted nodes, (agents,) each."""
        nodes = np.array(places)
        if self.sorted_agents is None:
            return np.arange(len(nodes)), nodes
        order = self.sorted_agents.find_order(nodes[None], nodes[None] >= 0)[0]
        return order, nodes[order]

    def find_row(self, state: int, actions: Sequence[int]) -> int:
        """Return the row of a state and the joint actions of the teams."""
        return int(self.offsets[state] + actions[0] * self.sizes[state, 1] + actions[1])

    def find_states(self, places: Sequence[int], turn: int) -> list[int]:
        """Return the unfinished states with agents on these nodes, -1: out of the game.

        States that the game reaches only later are left out, because their remaining turns were not all played.

        Args:
            places: the nodes of all agents, in order.
            turn: the number of turns played.
        """
        nodes = self._sort(places)[1].tolist()
        found = self._at.get((turn if self.by_turn else None, *nodes), [])
        return found if self.last_turn is None else [state for state in found if self._is_played_from(state, turn)]

    def _is_played_from(self, state: int, turn: int) -> bool:
        last = self.last_turn or 0
        return bool(self.level[state] <= turn or self._turns_played[state] >= last - turn)

    def find_first_turn(self, places: Sequence[int]) -> int | None:
        """Return the number of turns before agents are first on these nodes in an unfinished game; None: never.

        Args:
            places: the nodes of all agents, in order.
        """
        is_there = (np.where(self.alive, self.nodes, -1) == self._sort(places)[1]).all(axis=1)
        levels = self.level[is_there & (np.diff(self.offsets) > 0)]
        return int(levels.min()) if len(levels) else None

    @cached_property
    def _turns_played(self) -> IntArray:
        """(states,) the number of turns played from each state for all actions; `_ALL_TURNS` if there is no limit."""
        last = self.last_turn or 0
        after = self.usual.after
        sources = np.repeat(np.arange(len(self)), np.diff(self.offsets))
        played = np.full(len(self), _ALL_TURNS)
        reached = (self.level == last - 1) & (np.diff(self.offsets) > 0)  # only the last turn was played from them
        for turns in range(1, last + 1):
            played[reached] = turns
            leads_there = np.bincount(sources, reached[after], len(self)) > 0
            reached = leads_there & (played == _ALL_TURNS)
            if not reached.any():
                break
        return played

    def name_nodes(self, places: Sequence[int]) -> dict[str, int | None]:
        """Return agent -> its node, None: it is out, for nodes in the order of agents."""
        return {name: None if node < 0 else node for name, node in zip(self.roster.names, places, strict=True)}

    @cached_property
    def _at(self) -> dict[tuple[int | None, ...], list[int]]:
        found: dict[tuple[int | None, ...], list[int]] = {}
        places = np.where(self.alive, self.nodes, -1).tolist()
        levels = self.level.tolist()
        for state in np.flatnonzero(np.diff(self.offsets)).tolist():
            found.setdefault((levels[state] if self.by_turn else None, *places[state]), []).append(state)
        return found

    def list_transitions(self, outcomes: Outcomes) -> Iterator[Transition]:
        """Yield each row as a `Transition`, for reward functions; not for a table whose ends are merged."""
        teams = self.roster.teams
        where = [self.name_nodes(nodes) for nodes in np.where(self.alive, self.nodes, -1).tolist()]
        sources = np.repeat(np.arange(len(self)), np.diff(self.offsets))
        for source, after, gains, winner in zip(sources.tolist(), *(one.tolist() for one in outcomes), strict=True):
            won = teams[winner] if winner >= 0 else None
            gained = dict(zip(teams, gains, strict=True))
            yield Transition(where[source], where[after], gained, winner != GOES_ON, won)


def _find_order(world: TurnSimulator, teams: Sequence[Any]) -> int:
    order = world.terms.order
    if order is None or len(teams) < 2:
        return 0
    parts = [next(number for number, part in enumerate(order) if team in part) for team in teams]
    return int(np.sign(parts[0] - parts[1]))


def _list_earlier_agents(world: TurnSimulator, team: Any) -> list[str]:
    order = world.terms.order or []
    own = next((number for number, part in enumerate(order) if team in part), 0)
    teams = list(chain.from_iterable(order[:own]))
    return [world.roster.names[agent] for agent in np.flatnonzero(world.roster.find_players(teams)).tolist()]


def _join_outcomes(parts: "list[Outcomes]") -> Outcomes:
    """Return the outcomes of all rows; states are played in the order of their numbers, so that they are in order."""
    return Outcomes(*[np.concatenate(each) for each in zip(*parts, strict=True)])


class _FoundStates:
    """The states of a game found so far, part by part."""

    def __init__(self) -> None:
        self.level: list[int] = []  # of each state
        self.nodes: list[IntArray] = []
        self.alive: list[BoolArray] = []
        self.played: list[IntArray] = []  # the states for `legal`, `counts` and `sizes`
        self.legal: list[IntArray] = []
        self.counts: list[IntArray] = []
        self.sizes: list[IntArray] = []
        self.usual: list[Outcomes] = []  # by state, then by the number of the joint action
        self.last: list[Outcomes] = []


class _StateNumbers:
    """Numbers states in the order in which they were first added.

    Args:
        words: the number of words of a record.
        first: the first number.
    """

    def __init__(self, words: int, first: int) -> None:
        self._table = RecordTable(words)
        self._first = first
        self._records = np.zeros((0, words), np.uint64)
        self._make_room(_FIRST_ROOM)

    def _make_room(self, room: int) -> None:
        """Make room for this number of states, a power of two."""
        records = np.zeros((room, self._records.shape[1]), np.uint64)
        records[: len(self._records)] = self._records
        self._records = records
        self._table.take_memory(records.reshape(-1).data, np.zeros(2 * room, np.int64).data)

    def add(self, keys: WordArray) -> IntArray:
        """Return the numbers of records, (rows, words); new ones get the next numbers."""
        while self._table.count + len(keys) > len(self._records):
            self._make_room(2 * len(self._records))
        numbers = np.zeros(len(keys), np.int64)
        self._table.add(keys.reshape(-1).data, numbers.data)
        return numbers + self._first


class _HiddenDependence(Exception):
    """Turns depend on the time, the scores or the agents' names, which therefore must be part of the state."""


def explore(setup: GameSetup, *, by_winner: bool, merges: bool = False) -> Table:
    """Return all states of a game that can be reached from its start, and its transitions.

    Args:
        setup: the setup of the game.
        by_winner: whether the winner matters.
        merges: whether ends with the same winner are one state, and states that differ only by interchangeable agents.

    Raises:
        TooLarge: there are too many states.
        BadValue: the game has an unsupported feature, such as random draws.
    """
    world = make_simulator(setup, sorts_agents=merges)
    last = world.terms.last_turn
    by_turn = last is not None and last <= _SHORT
    try:
        while True:
            try:
                explorer = _Explorer(world, setup, by_turn=by_turn, by_winner=by_winner, merges_ends=merges)
                found = explorer.explore()
                return Table(setup, world, found, by_turn=by_turn, by_winner=by_winner, is_merged=merges)
            except _HiddenDependence as what:
                by_turn = by_turn or what.args[0] == "turn"
                if what.args[0] == "agents":
                    world.sorted_agents = None
                world.with_scores = world.with_scores or what.args[0] == "scores"
    finally:
        world.close()


class _Explorer:
    """Plays all turns from all states, level by level."""

    def __init__(
        self, world: TurnSimulator, setup: GameSetup, *, by_turn: bool, by_winner: bool, merges_ends: bool
    ) -> None:
        self._merges_ends = merges_ends
        self._world = world
        self._setup = setup
        self._by_turn = by_turn
        self._by_winner = by_winner
        self._members = [world.roster.members(team) for team in setup.teams]
        self._last = world.terms.last_turn
        self._numbers: _StateNumbers | None = None
        self._found = _FoundStates()
        self._new: list[tuple[IntArray, States]] = []  # numbers and states of the next level
        self._again: list[tuple[int, States, int]] = []  # states that were reached again, at a later turn

    def explore(self) -> _FoundStates:
        start = self._world.start()
        self._number_states(start, np.full(1, GOES_ON), 0)
        turn = 0
        while self._new and (self._last is None or turn < self._last):
            ids = np.concatenate([numbers for numbers, _ in self._new])
            frontier = concatenate([states for _, states in self._new])
            self._new = []
            if self._by_turn:
                self._numbers = None
            self._expand(frontier, ids, turn)
            turn += 1
        why_not = self._world.explain_refusal()
        if why_not:
            raise BadValue(f"This game cannot be solved: {why_not}")
        self._check_again()
        return self._found

    def _expand(self, frontier: States, ids: IntArray, turn: int) -> None:
        """Play all turns from the states of a turn."""
        legal = self._world.list_legal(frontier, turn)
        counts = np.ones(legal.shape[:2], np.int64)
        for members in self._members:
            counts[:, members] = np.maximum(1, (legal[:, members] >= 0).sum(axis=2))
        sizes = np.ones((len(ids), 2), np.int64)
        for team, members in enumerate(self._members):
            sizes[:, team] = counts[:, members].prod(axis=1)
        found = self._found
        for name, part in (("played", ids), ("legal", legal), ("counts", counts), ("sizes", sizes)):
            getattr(found, name).append(part)
        numbers = sizes.prod(axis=1)
        sources = np.repeat(np.arange(len(ids)), numbers)
        actions = np.arange(len(sources)) - np.repeat(np.cumsum(numbers) - numbers, numbers)
        for begin in range(0, len(sources), self._world.rows):
            source = sources[begin : begin + self._world.rows]
            action = actions[begin : begin + self._world.rows]
            chosen = self._decode_actions(action, counts[source], sizes[source])
            played = self._play(frontier, source, chosen, turn)
            after = self._number_states(played.states, played.winner, turn + 1)
            found.usual.append(Outcomes(after, played.gains, played.winner))
            if self._world.terms.has_last_rule and self._last is not None and not self._by_turn:
                late = played if turn == self._last - 1 else self._play_last(frontier, source, chosen, self._last - 1)
                found.last.append(Outcomes(after, late.gains, late.winner))

    def _decode_actions(self, action: IntArray, counts: IntArray, sizes: IntArray) -> IntArray:
        """Return the action of each agent, (rows, agents), from numbers of joint actions."""
        chosen = np.zeros(counts.shape, np.int64)
        for members, joint in zip(self._members, np.divmod(action, sizes[:, 1]), strict=False):
            left = joint
            for agent in reversed(members.tolist()):
                left, chosen[:, agent] = np.divmod(left, counts[:, agent])
        return chosen

    def _play(self, states: States, rows: IntArray, chosen: IntArray, turn: int) -> TurnResults:
        """Play turns, and again with another seed, turn and scores, to detect whether they depend on these."""
        world = self._world
        played = world.play(states, rows, chosen, turn)
        more = 0.0 if world.with_scores else _MORE_SCORE
        shift = Perturbation(
            seed=1, turns=self._find_turn_shift(turn), scores=more, exchanges=world.sorted_agents is not None
        )
        again = np.tile(np.arange(len(rows)), max(1, _DRAWS // len(rows)))  # each with a seed of its own
        other = world.play(states, rows[again], chosen[again], turn, shift)
        same = played if len(again) == len(rows) else played.take(again)
        differs = same.find_differing(other, by_winner=self._by_winner)
        if differs.any():
            row = again[np.flatnonzero(differs)[:1]]
            self._explain(states.take(rows[row]), chosen[row], turn, shift)
        return played

    def _play_last(self, states: States, rows: IntArray, chosen: IntArray, turn: int) -> TurnResults:
        """Play the last turn, which may depend on the scores so far if the winner matters."""
        play = self._play if self._by_winner else self._world.play
        return play(states, rows, chosen, turn)

    def _find_turn_shift(self, turn: int) -> int:
        """Return the shift in turns for the repetition, 0 if the turn is part of the state."""
        if self._by_turn or (self._last is not None and turn >= self._last - 1):
            return 0
        if self._last is None:
            return 5
        return 1 if turn + 1 < self._last - 1 else -1

    def _explain(self, states: States, chosen: IntArray, turn: int, shift: Perturbation) -> None:
        """Raise an error that names the hidden dependence of a turn."""
        rows = np.arange(len(states))
        played = self._world.play(states, rows, chosen, turn)

        def goes_differently(shift: Perturbation) -> bool:
            other = self._world.play(states, rows, chosen, turn, shift)
            return bool(played.find_differing(other, by_winner=self._by_winner).any())

        for name, one in (("turn", SAME._replace(turns=shift.turns)), ("scores", SAME._replace(scores=shift.scores))):
            if goes_differently(one):
                raise _HiddenDependence(name)
        if shift.exchanges:
            raise _HiddenDependence("agents")
        roster = self._world.roster
        nodes = self._world.get_places(states)[0][0].tolist()
        where = ", ".join(f"{name} on {node}" for name, node in zip(roster.names, nodes, strict=True))
        others = [team for team in roster.teams if team not in self._setup.teams]
        whose = f", a conflict or a strategy of {', '.join(map(shown, others))}" if others else " or a conflict"
        raise BadValue(
            f"This game cannot be solved, because a rule{whose} draws random numbers: turn {turn} differs with another "
            f"seed ({where}). Use deterministic rules, such as gamms.rules.by_priority, or estimate by playing many "
            "games: scenario.batch(…)."
        )

    def _number_states(self, states: States, winner: IntArray, turn: int) -> IntArray:
        """Return the numbers of states; store new ones."""
        level = self._found.level
        numbers = self._find(states, winner)
        is_new = numbers >= len(level)
        if states.snapshots:
            reached = np.flatnonzero(~is_new & (winner == GOES_ON)).tolist()
            later = [row for row in reached if level[numbers[row]] < turn]
            room = _CHECKED - len(self._again)
            self._again += [(int(numbers[row]), states.take(np.array([row])), turn) for row in later[:room]]
        rows = np.flatnonzero(is_new)
        if len(rows):
            new = rows[np.unique(numbers[rows], return_index=True)[1]]
            level += [turn] * len(new)
            self._store(states, new, winner, numbers)
        return numbers

    def _find(self, states: States, winner: IntArray) -> IntArray:
        """Return the numbers of states with these winners; new ones get the next numbers."""
        keys = states.make_keys(winner)
        if self._merges_ends:
            keys[winner != GOES_ON, :-1] = 0
        if self._numbers is None:
            self._numbers = _StateNumbers(keys.shape[1], len(self._found.level))
        return self._numbers.add(keys)

    def _store(self, states: States, new: IntArray, winner: IntArray, numbers: IntArray) -> None:
        """Store new states, in these rows; those in which the game goes on are on the next level."""
        found = self._found
        nodes, alive = self._world.get_places(states.take(new))
        found.nodes.append(nodes)
        found.alive.append(alive)
        if len(found.level) > self._setup.max_states:
            raise TooLarge(self._explain_limit())
        going = new[winner[new] == GOES_ON]
        if len(going):
            self._new.append((numbers[going], states.take(going)))

    def _explain_limit(self) -> str:
        places = np.column_stack((np.concatenate(self._found.nodes), np.concatenate(self._found.alive)))
        joint = {tuple(one) for one in places.tolist()}
        return (
            f"This game has more than {self._setup.limit}={self._setup.max_states:,} states, but only {len(joint):,} "
            "joint positions: its rules or strategies store more than positions"
            f"{', and states include the turn' * self._by_turn}. Use rules that store less, fewer turns=, a smaller "
            f"map, or a larger {self._setup.limit}=."
        )

    def _check_again(self) -> None:
        """Play again from states that were reached a second time, and compare the outcomes."""
        found = self._found
        if not self._again:
            return
        played, counts, sizes = (np.concatenate(part) for part in (found.played, found.counts, found.sizes))
        place_of = {number: place for place, number in enumerate(played.tolist())}
        ends = np.cumsum(sizes.prod(axis=1)).tolist()
        usual = _join_outcomes(found.usual)
        for number, states, turn in self._again:
            if number in place_of and (self._last is None or turn < self._last - 1):
                place = place_of[number]
                rows = np.arange(ends[place] - sizes[place].prod(), ends[place])
                first = Outcomes(usual.after[rows], usual.gains[rows], usual.winner[rows])
                self._compare(states, turn, counts[place], sizes[place], first)

    def _compare(self, states: States, turn: int, counts: IntArray, sizes: IntArray, first: Outcomes) -> None:
        """Play all actions from a state again, and compare the outcomes with those when it was first reached."""
        actions = np.arange(len(first.after))
        of_rows = np.zeros(len(actions), np.int64)
        chosen = self._decode_actions(actions, np.tile(counts, (len(actions), 1)), np.tile(sizes, (len(actions), 1)))
        later = self._world.play(states, of_rows, chosen, turn)
        reached = self._find(later.states, later.winner)
        if (reached != first.after).any() or (abs(later.gains - first.gains) > TOLERANCE).any():
            nodes = self._world.get_places(states)[0][0].tolist()
            where = dict(zip(self._world.roster.names, nodes, strict=True))
            raise BadValue(
                f"This game cannot be solved: from {where} a turn has other outcomes after another history, "
                "although ctx.game.data is equal. Store the memory of rules there."
            )
