"""One turn of a game from any of its states, by the scenario's own rules: many at once in a batch, or one by one.

A batch plays games whose states are in its columns; see `_fits_columns`. Each turn is played twice, the second time
with another seed, turn and scores, and with interchangeable agents exchanged, to detect dependence on these.
"""

from collections.abc import Hashable, Mapping, Sequence
from functools import partial
from itertools import chain, combinations
from math import ceil, comb, prod
from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms import kernels
from gamms.context import Context
from gamms.errors import BadValue, TooLarge
from gamms.game import Game
from gamms.game.array_functions.given import OutsideActions
from gamms.game.batch import Batch, find_winners, load_columns, step_with
from gamms.game.block.columns import AgentTable, get_mode, make_roster
from gamms.game.block.state import Columns
from gamms.game.hidden_state import HiddenState
from gamms.game.plan import find_first_called
from gamms.game.roles import Role
from gamms.game.settings import NamedRule
from gamms.game.snapshots import Snapshot
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rules.in_core import FORMS
from gamms.scenario import Scenario
from gamms.strategies import stay
from gamms.text import shown
from gamms.typing import AgentType

GOES_ON = -2  # instead of the number of the winning team
NO_WINNER = -1
Strategies = Mapping[str, Any]
_MOST_ROWS = 1 << 12  # turns that are played at once in a batch
_FEWEST_ROWS = 128
_FEW_ROWS = 256  # turns that are played one by one
_FIXED = ("start", "is_there")  # columns of a batch that only functions change, which these games do not call
_PLACES = {"node", "alive"}  # columns that are exchanged with agents
_OF_TEAMS = {"tag", "reach", "arrive", "last_team", "none_left", "time_limit", "published"}  # rules without a memory
TOLERANCE = 1e-9  # for comparing scores


class Perturbation(NamedTuple):
    """The changes under which a turn is repeated for comparison.

    Attributes:
        seed: 0: the same seed; else another seed for each turn, derived from this number.
        turns: the number of turns by which it is later.
        scores: the amount that is added to the first team's score, twice to the second's, and so on.
        exchanges: whether interchangeable agents exchange their places and actions.
    """

    seed: int
    turns: int
    scores: float
    exchanges: bool = False


SAME = Perturbation(seed=0, turns=0, scores=0.0)


WordArray = np.ndarray[tuple[int, ...], np.dtype[np.uint64]]
"""Records of states, (states, words)."""


class States:
    """States of a game from which turns can be played.

    Attributes:
        records: (states,) a record of 64-bit words for each state; equal ones have equal later turns.
        snapshots: what a context restores for each state; empty for a batch, which restores the records.
    """

    def __init__(self, records: np.ndarray[Any, Any], snapshots: Sequence[Snapshot] = ()) -> None:
        self.records = records
        self.snapshots = snapshots

    def __len__(self) -> int:
        return len(self.records)

    @property
    def words(self) -> WordArray:
        """The records as words, (states, words)."""
        return self.records.view(np.uint64).reshape(len(self), -1)

    def make_keys(self, winner: IntArray) -> WordArray:
        """Return records of the states with these winners, (states, words); see `TurnResults`."""
        return np.column_stack((self.words, winner.view(np.uint64)))

    def find_differing(self, other: "States") -> BoolArray:
        """Return whether each state differs from the one in the same row of `other`, (states,)."""
        found = np.zeros(len(self), np.bool_)
        is_other = self.words != other.words
        found[np.flatnonzero(is_other) // is_other.shape[1]] = True
        return found

    def take(self, rows: IntArray) -> "States":
        """Return the states in these rows."""
        snapshots = [self.snapshots[row] for row in rows.tolist()] if self.snapshots else ()
        return States(self.records.take(rows), snapshots)


def concatenate(parts: Sequence[States]) -> States:
    """Concatenate states of one game."""
    snapshots = list(chain.from_iterable(part.snapshots for part in parts))
    return States(np.concatenate([one.records for one in parts]), snapshots)


class SortedAgents(NamedTuple):
    """Groups of interchangeable agents, which are sorted by their places, so that states do not tell them apart.

    Attributes:
        groups: the numbers of the agents of each group, two at least.
        exchanges: (exchanges, agents) ways to exchange agents of the groups: for each agent, whose place it takes.
    """

    groups: Sequence[IntArray]
    exchanges: IntArray

    @classmethod
    def from_groups(cls, groups: Sequence[IntArray], agents: int) -> "SortedAgents":
        """Return groups of a number of agents, with all exchanges of two, and one that exchanges all at once."""
        every = np.arange(agents)
        pairs = [pair for group in groups for pair in combinations(group.tolist(), 2)]
        exchanges = np.tile(every, (len(pairs) + 1, 1))
        for number, (one, two) in enumerate(pairs):
            exchanges[number, [one, two]] = two, one
        for group in groups:
            exchanges[-1, group] = group[::-1]
        return cls(groups, exchanges)

    def find_order(self, nodes: IntArray, alive: BoolArray) -> IntArray:
        """Return for each agent the number of the agent whose place it takes in the sorted state, (states, agents).

        Args:
            nodes: (states, agents) the ids of nodes.
            alive: (states, agents)
        """
        order = np.tile(np.arange(nodes.shape[1]), (len(nodes), 1))
        for group in self.groups:
            order[:, group] = group[np.lexsort((nodes[:, group], alive[:, group]))]
        return order


class TurnResults(NamedTuple):
    """The results of a turn from many states.

    Attributes:
        states: the states after the turn.
        gains: (states, teams) the changes of scores.
        winner: (states,) the number of the winning team, NO_WINNER, or GOES_ON.
    """

    states: States
    gains: FloatArray
    winner: IntArray

    def take(self, rows: IntArray) -> "TurnResults":
        """Return the results in these rows."""
        return TurnResults(self.states.take(rows), self.gains[rows], self.winner[rows])

    def find_differing(self, other: "TurnResults", *, by_winner: bool) -> BoolArray:
        """Return whether the results of each turn differ, (states,); compare winners if `by_winner`."""
        gains = (abs(self.gains - other.gains) > TOLERANCE).any(axis=1)
        winners = self.winner != other.winner
        if not by_winner:
            winners = (self.winner == GOES_ON) != (other.winner == GOES_ON)
        found: BoolArray = (self.states.find_differing(other.states) & (self.winner == GOES_ON)) | gains | winners
        return found


class TurnSimulator(Protocol):
    """A game whose turns can be played from any state.

    Attributes:
        roster: the agents.
        terms: the order of play and the last turn.
        rows: the best number of turns to play at once.
        with_scores: whether the scores so far are part of a state.
        sorted_agents: interchangeable agents, which are sorted in all states; None: there are none.
        start_places: the nodes of all agents at the start, -1: out.
    """

    roster: AgentTable
    terms: "TurnTerms"
    rows: int
    with_scores: bool
    sorted_agents: SortedAgents | None
    start_places: list[int]

    def start(self) -> States:
        """Return the initial state of the game."""

    def get_places(self, states: States) -> tuple[IntArray, BoolArray]:
        """Return the ids of the agents' nodes, and whether they are alive, (states, agents) each, ordered by name."""

    def list_legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most), the current node first, padded with -1."""

    def play(
        self, states: States, rows: IntArray, actions: IntArray, turn: int, shift: Perturbation = SAME
    ) -> TurnResults:
        """Play a turn from the states in these rows with these actions, (rows, agents)."""

    def explain_refusal(self) -> str:
        """Return why the results cannot be relied on, or ""."""

    def close(self) -> None:
        """Terminate its contexts."""


class TurnTerms(NamedTuple):
    """The order of play and the last turn of a game.

    Attributes:
        order: the teams that move one after the other; None: all move simultaneously.
        last_turn: the turn after which the game ends; None: unknown.
        has_last_rule: whether a rule ends it then, which may give points or a winner.
    """

    order: list[list[Any]] | None
    last_turn: int | None
    has_last_rule: bool

    @classmethod
    def from_game(cls, game: Game, cut: int | None) -> "TurnTerms":
        """Return the terms of a game that is cut after turn `cut`; None: it is not cut."""
        order = game.settings()["order"]
        last = min((turn for turn in (game.last_turn, cut) if turn is not None), default=None)
        ends = [one.spec.last_turn for one in game.rules]
        return cls(order if order is not None and len(order) > 1 else None, last, last is not None and last in ends)


class GameSetup(NamedTuple):
    """The game to solve.

    Attributes:
        scenario: the scenario of the game.
        seed: the seed of its start.
        teams: the teams whose actions are chosen by the solver.
        others: strategies of the others, by team or agent, which replace the scenario's.
        last_turn: the turn after which the game is cut; None: as in the scenario.
        max_states: the most states.
        limit: the name of the argument that sets this limit.
    """

    scenario: Scenario
    seed: int
    teams: tuple[str, ...]
    others: Strategies
    last_turn: int | None
    max_states: int
    limit: str = "max_states"


def make_simulator(setup: GameSetup, *, sorts_agents: bool) -> TurnSimulator:
    """Return the simulator for the turns of a game.

    Args:
        setup: the setup of the game.
        sorts_agents: whether states may be merged that differ only by interchangeable agents.

    Raises:
        BadValue: the game has an unsupported feature.
        TooLarge: it has more joint positions than the most states.
    """
    ctx = setup.scenario.build(setup.seed, {**setup.others, **dict.fromkeys(setup.teams, stay)})
    try:
        game = ctx.game
        _refuse(game)
        in_columns = _fits_columns(ctx)
        groups = _find_interchangeable(ctx, setup) if in_columns and sorts_agents else []
        number = min(_MOST_ROWS, _FEWEST_ROWS + _count_positions(ctx, setup, groups))
        if not in_columns:
            return ContextSimulator(ctx, setup)
        batch = game.batch(number + 1, seeds=range(setup.seed, setup.seed + number + 1))
        ctx.terminate()
        return BatchSimulator(batch, setup, groups)
    except BaseException:
        ctx.terminate()
        raise


def _fits_columns(ctx: Context) -> bool:
    """Return whether a batch can continue a game from any of its states, because its columns hold all of a state.

    They hold neither the values of plain functions, nor roads that array rules close, messages under way, and scores or
    dead agents of the start. For agents that obey turns they hold more than the next legal nodes, which would make many
    states of one. Rules before the moves may make actions illegal that were legal before.
    """
    game: Game = ctx.game
    return not (
        find_first_called(game, make_roster(game))
        or any(one.phase == "before" or one.spec.is_array_function for one in game.rules)
        or game.settings()["channels"]
        or game.scores
        or len(game.agents) < len(ctx.agent.agents)
        or make_roster(game).obey_turns
    )


def name_shipped_rule(rule: NamedRule) -> str:
    """Return the name of a shipped rule that is called after the moves; "": it is another one."""
    form = rule.spec.core_form
    name = form.func.__name__ if isinstance(form, partial) else ""
    is_shipped = isinstance(form, partial) and FORMS.get(name) is form.func and rule.phase == "after"
    return name if is_shipped else ""


def _find_interchangeable(ctx: Context, setup: GameSetup) -> list[IntArray]:
    """Return groups of agents that may exchange their places without changing later turns, by their numbers.

    All teams must be decided by the solver, because strategies may tell agents apart by their names. So may conflicts,
    and all rules but those that name teams only and remember nothing. Agents of a group have the same team, speed, and,
    if a tag puts agents back there, start.
    """
    game: Game = ctx.game
    is_decided = not setup.others and all(agent.team in setup.teams for agent in game.agents)
    if not is_decided or game.settings()["conflicts"] is not None:
        return []
    if not all(name_shipped_rule(rule) in _OF_TEAMS for rule in game.rules):
        return []
    if any(isinstance(member, Role) for rule in game.rules for member in rule.spec.teams):
        return []
    parts = chain.from_iterable(rule.spec.parts for rule in game.rules if name_shipped_rule(rule) == "tag")
    goes_back = any(part.then != "eliminate" for part in parts)
    groups: dict[tuple[Any, ...], list[int]] = {}
    for number, agent in enumerate(AgentTable.of(game.agents).agents):
        key = agent.team, agent.speed, get_mode(agent), agent.current_node_id if goes_back else None
        groups.setdefault(key, []).append(number)
    return [np.array(group) for group in groups.values() if len(group) > 1]


def _count_positions(ctx: Context, setup: GameSetup, groups: Sequence[IntArray]) -> int:
    """Return the number of joint positions that agents may reach, with groups sorted; refuse too many."""
    game = ctx.game
    graph = ctx.graph.columns()
    last = TurnTerms.from_game(game, setup.last_turn).last_turn
    places = []
    for agent in AgentTable.of(game.agents).agents:
        steps = len(graph.node_ids) if last is None else last * ceil(agent.speed or 1)
        steps = steps if game.settings()["legal"] == "edges" else len(graph.node_ids)
        places.append(_find_nodes_within(graph, int(np.flatnonzero(graph.node_ids == agent.current_node_id)[0]), steps))
    reached = [int(place.sum()) for place in places]
    joint = prod(reached)
    for group in groups:
        several = int(np.logical_or.reduce([places[agent] for agent in group]).sum())
        apart = prod(reached[agent] for agent in group)
        joint = joint // apart * min(apart, comb(several + len(group) - 1, len(group)))
    if joint > setup.max_states:
        fitting = next(n for n in range(len(reached), -1, -1) if prod(sorted(reached)[:n]) <= setup.max_states)
        nodes = int(setup.max_states ** (1 / len(reached)))
        raise TooLarge(
            f"This game has up to {joint:,} joint positions ({len(reached)} agents that can reach "
            f"{' x '.join(map(str, reached))} nodes), and {setup.limit}={setup.max_states:,} is allowed: "
            f"{fitting} of these agents on this map would fit, or {len(reached)} agents on {nodes} nodes. A smaller "
            f"map, fewer turns=, or a larger {setup.limit}= would help."
        )
    return joint


def _find_nodes_within(graph: GraphColumns, row: int, steps: int) -> BoolArray:
    """Return a mask (nodes,) of the nodes within this many edges of a node."""
    seen = np.zeros(len(graph.node_ids), np.bool_)
    frontier = np.array([row])
    seen[row] = True
    for _ in range(steps):
        _, entries = kernels.expand_ranges(graph.offsets[frontier], graph.offsets[frontier + 1])
        ends = graph.targets[entries]
        frontier = np.unique(ends[~seen[ends]])
        seen[frontier] = True
        if not len(frontier):
            break
    return seen


def _refuse(game: Game) -> None:
    """Refuse games whose joint states or actions cannot be listed."""
    settings = game.settings()
    reasons = [
        (
            settings["speed_unit"] != "edges",
            "agents travel in meters and can be anywhere on an edge: set speeds in edges",
        ),
        (bool(settings["deeds"]), f"agents may do {', '.join(settings['deeds'])} besides moving: remove the deeds"),
        (settings["time_budget"] is not None, "its time_budget makes results depend on the clock: remove it"),
    ]
    reasons += [
        (one.type is AgentType.AERIAL, f"agent {shown(one.name)} flies: use an agent on the ground")
        for one in game.agents
    ]
    for is_there, reason in reasons:
        if is_there:
            raise BadValue(f"This game cannot be solved, because {reason}.")


class BatchSimulator:
    """Plays many turns at once as a batch; see `TurnSimulator`.

    A record of a state has the columns of the batch as fields, and the scores of the teams if they are part of states.
    """

    with_scores = False

    def __init__(self, batch: Batch, setup: GameSetup, groups: Sequence[IntArray]) -> None:
        self._batch = batch
        self._teams = setup.teams
        game = batch.game
        self.roster = AgentTable.of(game.agents)
        self.rows = len(batch) - 1
        self.terms = TurnTerms.from_game(batch.game.ctx.game, setup.last_turn)
        batch.step()  # so that rules and strategies have created their memories
        batch.reset()
        self._streets = batch.observe(batch.teams[0]).streets
        self._start = {name: column for name, column in batch.columns().items() if name not in _FIXED}
        can_sort = groups and {*self._start} == _PLACES
        self.sorted_agents = SortedAgents.from_groups(groups, len(self.roster.names)) if can_sort else None
        self.start_places: list[int] = self._streets.get_ids(self._start["node"][0]).tolist()
        self._acting = [batch.observe(team).agents for team in setup.teams]
        self._scored: tuple[Hashable, ...] = ()  # the teams whose scores are fields of a record, after the columns
        self._fields: list[str] = []
        self._record = np.dtype([])

    def close(self) -> None:
        """End the batch."""
        self._batch.close()

    def explain_refusal(self) -> str:
        """Return "": a batch refuses rules whose memory is not part of its states."""
        return ""

    def start(self) -> States:
        """Return the state in which the game begins."""
        self._scored = self._batch.teams if self.with_scores else ()
        fields = [(f"column {number}", one.dtype, one.shape[1:]) for number, one in enumerate(self._start.values())]
        fields += [(f"score {number}", np.dtype(np.float64), ()) for number in range(len(self._scored))]
        self._fields = [name for name, *_ in fields]
        rest = -np.dtype(fields).itemsize % 8
        self._record = np.dtype([*fields, ("rest of the last word", np.dtype(np.uint8), (rest,))])
        load_columns(self._batch, self._start, 0, {}, slice(None))
        return self._read_states(self._batch.columns(), self._batch.scores, slice(0, 1))

    def get_places(self, states: States) -> tuple[IntArray, BoolArray]:
        """Return the ids of the agents' nodes, and whether they are alive, (states, agents) each."""
        columns = dict(zip(self._start, self._fields, strict=False))
        return self._streets.get_ids(states.records[columns["node"]]), states.records[columns["alive"]]

    def list_legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most)."""
        parts = []
        for begin in range(0, len(states), self.rows):
            rows = np.arange(begin, min(begin + self.rows, len(states)))
            self._load(states, rows, slice(0, len(rows)), turn, 0.0)
            found = dict[int, IntArray]()
            for team in self._batch.teams:
                view = self._batch.observe(team)
                most = int(view.counts[: len(rows)].max())
                found.update(
                    zip(view.agents.tolist(), view["legal"][: len(rows), :, :most].swapaxes(0, 1), strict=True)
                )
            width = max(part.shape[1] for part in found.values())
            legal = np.full((len(rows), len(found), width), -1)
            for agent, nodes in found.items():
                legal[:, agent, : nodes.shape[1]] = nodes
            parts.append(legal)
        most = max(part.shape[2] for part in parts)
        padded = [np.pad(part, ((0, 0), (0, 0), (0, most - part.shape[2])), constant_values=-1) for part in parts]
        legal = np.concatenate(padded)
        legal[~self.get_places(states)[1], 1:] = -1
        return legal

    def play(
        self, states: States, rows: IntArray, actions: IntArray, turn: int, shift: Perturbation = SAME
    ) -> TurnResults:
        """Play a turn from the states in these rows."""
        batch = self._batch
        games = slice(shift.seed, shift.seed + len(rows))  # each game has a seed of its own
        chosen = np.zeros((len(batch), actions.shape[1]), np.int64)
        chosen[games] = actions
        exchange = None
        if shift.exchanges and self.sorted_agents is not None:
            ways = self.sorted_agents.exchanges
            exchange = ways[np.arange(len(rows)) % len(ways)]
            chosen[games] = np.take_along_axis(actions, exchange, 1)
        before = self._load(states, rows, games, turn + shift.turns, shift.scores, exchange)
        given: dict[Hashable, OutsideActions] = {
            team: OutsideActions(chosen[:, agents], {}, {}, are_legal=True)
            for team, agents in zip(self._teams, self._acting, strict=True)
        }
        step_with(batch, given, 1)
        scores = batch.scores
        is_last = self.terms.last_turn is not None and turn + shift.turns + 1 >= self.terms.last_turn
        gains = np.zeros((len(rows), len(batch.teams)))
        for number, team in enumerate(batch.teams):
            gains[:, number] = scores[team][games] - before.get(team, 0.0)
        winner = np.where(batch.is_over | is_last, find_winners(batch), GOES_ON)[games]
        return TurnResults(self._read_states(batch.columns(), scores, games), gains, winner)

    def _load(
        self,
        states: States,
        rows: IntArray,
        games: slice,
        turn: int,
        more: float,
        exchange: IntArray | None = None,
    ) -> dict[Any, FloatArray]:
        """Load the states in these rows into games of the batch, with so much more points.

        Args:
            states: the states.
            rows: their rows.
            games: the games.
            turn: the number of turns played.
            more: see `Perturbation.scores`.
            exchange: (rows, agents) for each agent, whose place it takes; None: its own.

        Returns:
            The scores by team; without those of teams that have none.
        """
        records = states.records.take(rows)
        fields = [records[name] for name in self._fields]
        columns = dict(zip(self._start, fields, strict=False))
        if exchange is not None:
            columns = {name: np.take_along_axis(column, exchange, 1) for name, column in columns.items()}
            columns["node"][~columns["alive"]] = self._streets.num_nodes - 1  # where they went out makes no difference
        scores = dict[Any, FloatArray](zip(self._scored, fields[len(columns) :], strict=True))
        for place, team in enumerate(self._batch.teams if more else ()):
            scores[team] = scores.get(team, 0.0) + np.full(len(rows), more * (place + 1))
        load_columns(self._batch, columns, turn, scores, games)
        return scores

    def _read_states(self, columns: Columns, scores: Mapping[Any, FloatArray], games: slice) -> States:
        """Return the states of games of the batch from its columns and scores.

        Interchangeable agents are sorted; then all agents that are out have the same node.
        """
        places = {name: columns[name][games] for name in self._start}
        if self.sorted_agents is not None:
            order = self.sorted_agents.find_order(self._streets.get_ids(places["node"]), places["alive"])
            places = {name: np.take_along_axis(column, order, 1) for name, column in places.items()}
            places["node"][~places["alive"]] = 0
        values = list(places.values())
        values += [scores[team][games] for team in self._scored]
        records = np.zeros(len(self._batch), self._record)[games]
        for name, column in zip(self._fields, values, strict=True):
            records[name] = column
        return States(records)


class ContextSimulator:
    """Plays turns one after the other in a context; see `TurnSimulator`."""

    rows = _FEW_ROWS
    with_scores = False
    sorted_agents: SortedAgents | None = None

    def __init__(self, ctx: Context, setup: GameSetup) -> None:
        self._game: Game = ctx.game
        self.roster = AgentTable.of(ctx.game.agents)
        self.start_places = [one.current_node_id if one.alive else -1 for one in self.roster.agents]
        self.terms = TurnTerms.from_game(ctx.game, setup.last_turn)
        self._actions: dict[str, int] = {}
        self._legal: dict[str, tuple[int, ...]] = {}
        for team in setup.teams:
            self._game.command(team, self._decide)
        self._hidden = HiddenState(*[one.rule for one in self._game.rules])
        self._start = self._game.snapshot()
        self._numbers: dict[bytes, int] = {}  # the text of a state -> its number, which is its record
        self._nodes: list[list[int]] = []  # of each number
        self._alive: list[list[bool]] = []
        map = ctx.graph.columns()
        self._roads = map.offsets.tobytes() + map.targets.tobytes()

    def close(self) -> None:
        """End the context."""
        self._game.ctx.terminate()

    def explain_refusal(self) -> str:
        """Return which rule remembers state that is not part of the game, or ""."""
        return self._hidden.describe_change("Keep it in ctx.game.data, so that it is part of the states.")

    def _decide(self, states: dict[str, Any]) -> None:
        """Set the actions to play, and store the legal nodes."""
        for name, state in states.items():
            legal = state["legal"]
            self._legal[name] = legal
            state["action"] = legal[self._actions.get(name, 0)]

    def start(self) -> States:
        """Return the state in which the game begins."""
        self._game.restore(self._start)
        return self._read_states([self._capture_state()])

    def get_places(self, states: States) -> tuple[IntArray, BoolArray]:
        """Return the ids of the agents' nodes, and whether they are alive, (states, agents) each."""
        numbers = states.records.tolist()
        nodes = np.array([self._nodes[number] for number in numbers])
        return nodes, np.array([self._alive[number] for number in numbers], np.bool_)

    def list_legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most)."""
        found = []
        nodes_of, _ = self.get_places(states)
        for snapshot, nodes in zip(states.snapshots, nodes_of.tolist(), strict=True):
            self._actions = {}
            self._legal = {}
            self._restore(snapshot, turn, SAME)
            self._game.step()
            found.append([self._legal.get(name, (node,)) for name, node in zip(self.roster.names, nodes, strict=True)])
        most = max(len(legal) for legal in chain.from_iterable(found))
        return np.array([[[*legal, *[-1] * (most - len(legal))] for legal in those] for those in found])

    def play(
        self, states: States, rows: IntArray, actions: IntArray, turn: int, shift: Perturbation = SAME
    ) -> TurnResults:
        """Play a turn from the states in these rows."""
        game = self._game
        moments = []
        gains = []
        winners = []
        teams = self.roster.teams
        names = self.roster.names
        for number, (row, chosen) in enumerate(zip(rows.tolist(), actions.tolist(), strict=True)):
            self._restore(states.snapshots[row], turn, shift._replace(seed=shift.seed and shift.seed + number))
            before = [game.scores[team] for team in teams]
            self._actions = dict(zip(names, chosen, strict=True))
            game.step()
            gains.append([game.scores[team] - points for team, points in zip(teams, before, strict=True)])
            winners.append(self._find_winner())
            moments.append(self._capture_state())
        return TurnResults(self._read_states(moments), np.array(gains, np.float64), np.array(winners))

    def _restore(self, snapshot: Snapshot, turn: int, shift: Perturbation) -> None:
        game = self._game
        game.restore(snapshot)
        state = game.internals.state
        state.turn = turn + shift.turns
        if shift.seed:
            game.ctx.reseed(kernels.compute_purpose_key(snapshot.seed, "solve", shift.seed) >> 1)
        for place, team in enumerate(self.roster.teams):
            if shift.scores:
                game.scores[team] += shift.scores * (place + 1)

    def _find_winner(self) -> int:
        game = self._game
        if game.over is None:
            is_late = self.terms.last_turn is not None and game.turn >= self.terms.last_turn
            return NO_WINNER if is_late else GOES_ON
        won = game.over["winner"]
        return self.roster.teams.index(won) if won is not None and won in self.roster.teams else NO_WINNER

    def _capture_state(self) -> "_CapturedState":
        """Return the current state of the game."""
        game = self._game
        snapshot = game.snapshot()
        state = game.internals.state
        agents = game.ctx.agent.agents
        living = [name in agents and agents[name].alive for name in self.roster.names]
        nodes = [agents[name].current_node_id if name in agents else -1 for name in self.roster.names]
        block = game.ctx.agent.block
        covered = [block.get_progress(block.find_row(name)) for name in self.roster.names if name in agents]
        scores = dict(state.scores) if self.with_scores else None
        # an agent that was not asked yet has an empty memory
        memories = [{name: one for name, one in kept.items() if one} for kept in (state.memories, state.team_memories)]
        find_driven = game.internals.parts.turns.legality.find_driven
        driven = {name: edges for name in state.driven if name in agents and (edges := find_driven(name))}
        facts = (state.facts, state.agent_facts, state.team_facts)
        map = game.ctx.graph.columns()  # rules may close roads
        roads = map.offsets.tobytes() + map.targets.tobytes()
        roads = b"" if roads == self._roads else roads
        key = repr(as_sorted((nodes, living, covered, driven, roads, state.data, memories, facts, scores))).encode()
        return _CapturedState(key, nodes, living, snapshot)

    def _read_states(self, moments: "Sequence[_CapturedState]") -> States:
        records = []
        for one in moments:
            if one.key not in self._numbers:
                self._numbers[one.key] = len(self._nodes)
                self._nodes.append(one.nodes)
                self._alive.append(one.alive)
            records.append(self._numbers[one.key])
        return States(np.array(records), [one.snapshot for one in moments])


class _CapturedState(NamedTuple):
    key: bytes
    nodes: list[int]
    alive: list[bool]
    snapshot: Snapshot


def as_sorted(value: object) -> object:
    """Return a value whose text is equal for equal values: dicts and sets sorted, arrays as bytes."""
    if isinstance(value, Mapping):
        return "dict", sorted(((repr(key), as_sorted(one)) for key, one in value.items()), key=lambda item: item[0])
    if isinstance(value, set | frozenset):
        return "set", sorted(map(repr, map(as_sorted, value)))
    if isinstance(value, list | tuple):
        return [as_sorted(one) for one in value]
    return (value.dtype.str, value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value
