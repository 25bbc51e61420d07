"""One turn of a game from any of its states, by the scenario's own rules: as a batch if possible, else one by one.

Each turn is played twice, the second time with another seed, turn and scores, to detect dependence on these.
"""

from collections.abc import Hashable, Mapping, Sequence
from itertools import chain
from math import ceil, prod
from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms import kernels
from gamms.context import Context
from gamms.errors import BadValue, TooLarge
from gamms.game import Game
from gamms.game.batch import Batch
from gamms.game.block.columns import AgentTable
from gamms.game.block.state import Columns
from gamms.game.hidden_state import HiddenState
from gamms.game.snapshots import Snapshot
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.scenario import Scenario
from gamms.strategies import stay
from gamms.text import shown
from gamms.typing import AgentType

GOES_ON = -2  # instead of the number of the winning team
NO_WINNER = -1
Strategies = Mapping[str, Any]
_MOST_ROWS = 1 << 13  # turns that are played at once in a batch
_FEWEST_ROWS = 128
_FEW_ROWS = 256  # turns that are played one by one
TOLERANCE = 1e-9  # for comparing scores


class Perturbation(NamedTuple):
    """The changes under which a turn is repeated for comparison.

    Attributes:
        seed: 0: the same seed; else another seed for each turn, derived from this number.
        turns: the number of turns by which it is later.
        scores: the amount that is added to the first team's score, twice to the second's, and so on.
    """

    seed: int
    turns: int
    scores: float


SAME = Perturbation(seed=0, turns=0, scores=0.0)


class States:
    """States of a game from which turns can be played: `columns` for a batch, `snapshots` for a context.

    Attributes:
        keys: keys that are equal only if all later turns are equal.
        nodes: (states, agents) ids of the agents' nodes, in the order of their names.
        alive: (states, agents)
    """

    def __init__(
        self,
        keys: list[bytes],
        nodes: IntArray,
        alive: BoolArray,
        columns: Columns | None = None,
        snapshots: Sequence[Snapshot] = (),
    ) -> None:
        self.keys = keys
        self.nodes = nodes
        self.alive = alive
        self.columns = columns
        self.snapshots = snapshots

    def __len__(self) -> int:
        return len(self.keys)

    def take(self, rows: IntArray) -> "States":
        """Return the states in these rows."""
        columns = None if self.columns is None else {name: values[rows] for name, values in self.columns.items()}
        numbers = rows.tolist()
        snapshots = [self.snapshots[row] for row in numbers] if self.snapshots else ()
        return States([self.keys[row] for row in numbers], self.nodes[rows], self.alive[rows], columns, snapshots)


def joined(parts: Sequence[States]) -> States:
    """Concatenate states of one game."""
    first = parts[0].columns
    columns = None if first is None else {name: np.concatenate([_of(one, name) for one in parts]) for name in first}
    keys = list(chain.from_iterable(part.keys for part in parts))
    snapshots = list(chain.from_iterable(part.snapshots for part in parts))
    nodes = np.concatenate([one.nodes for one in parts])
    alive = np.concatenate([one.alive for one in parts])
    return States(keys, nodes, alive, columns, snapshots)


def _of(states: States, name: Hashable) -> np.ndarray[Any, Any]:
    return states.columns[name]  # type: ignore[index] # asked of states in arrays


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

    def differs(self, other: "TurnResults", *, by_winner: bool) -> BoolArray:
        """Return whether the results of each turn differ, (states,); compare winners if `by_winner`."""
        keys = [mine != theirs for mine, theirs in zip(self.states.keys, other.states.keys, strict=True)]
        gains = (abs(self.gains - other.gains) > TOLERANCE).any(axis=1)
        winners = self.winner != other.winner
        if not by_winner:
            winners = (self.winner == GOES_ON) != (other.winner == GOES_ON)
        found: BoolArray = (np.array(keys, np.bool_) & (self.winner == GOES_ON)) | gains | winners
        return found


class TurnSimulator(Protocol):
    """A game whose turns can be played from any state.

    Attributes:
        roster: the agents.
        terms: the order of play and the last turn.
        rows: the best number of turns to play at once.
        with_scores: whether the scores so far are part of a state.
    """

    roster: AgentTable
    terms: "TurnTerms"
    rows: int
    with_scores: bool

    def start(self) -> States:
        """Return the initial state of the game."""

    def legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most), the current node first, padded with -1."""

    def play(self, states: States, actions: IntArray, turn: int, shift: Perturbation = SAME) -> TurnResults:
        """Play a turn from each state with these actions, (states, agents)."""

    def why_not(self) -> str:
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
    def of(cls, game: Game, cut: int | None) -> "TurnTerms":
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


def simulator_of(setup: GameSetup) -> TurnSimulator:
    """Return the simulator for the turns of a game.

    Raises:
        BadValue: the game has an unsupported feature.
        TooLarge: it has more joint positions than the most states.
    """
    ctx = setup.scenario.build(setup.seed, {**setup.others, **dict.fromkeys(setup.teams, stay)})
    try:
        game = ctx.game
        _refuse(game)
        number = min(_MOST_ROWS, _FEWEST_ROWS + _positions(ctx, setup))
        is_plain = not game.scores and len(game.agents) == len(ctx.agent.agents)
        # An array rule may close roads, which a batch cannot load into games in the core.
        is_plain &= not any(one.spec.is_array_function for one in game.rules)
        if is_plain and not game.settings()["channels"] and not any(one.phase == "before" for one in game.rules):
            batch = game.batch(number, seeds=range(setup.seed, setup.seed + number))
            if batch.slow is None:
                ctx.terminate()
                return BatchSimulator(batch, setup)
            batch.close()
        return ContextSimulator(ctx, setup)
    except BaseException:
        ctx.terminate()
        raise


def _positions(ctx: Context, setup: GameSetup) -> int:
    """Return the number of joint positions that agents may reach; refuse too many."""
    game = ctx.game
    graph = ctx.graph.columns()
    last = TurnTerms.of(game, setup.last_turn).last_turn
    reached = []
    for agent in game.agents:
        steps = len(graph.node_ids) if last is None else last * ceil(agent.speed or 1)
        steps = steps if game.settings()["legal"] == "edges" else len(graph.node_ids)
        reached.append(_within(graph, int(np.flatnonzero(graph.node_ids == agent.current_node_id)[0]), steps))
    joint = prod(reached)
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


def _within(graph: GraphColumns, row: int, steps: int) -> int:
    """Return the number of nodes within this many edges of a node."""
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
    return int(seen.sum())


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
    """Plays many turns at once as a batch; see `TurnSimulator`."""

    with_scores = False

    def __init__(self, batch: Batch, setup: GameSetup) -> None:
        self._batch = batch
        self._teams = setup.teams
        game = batch.game
        self.roster = AgentTable.of(game.agents)
        self.rows = len(batch)
        self.terms = TurnTerms.of(batch.game.ctx.game, setup.last_turn)
        batch.step()  # so that rules and strategies have created their memories
        batch.reset()
        self._streets = batch.observe(batch.teams[0]).streets
        self._start = batch.columns()
        self._maps = dict[bytes, int]()  # state of the roads -> a number from 1 on
        self._acting = [batch.observe(team).agents for team in setup.teams]

    def close(self) -> None:
        """End the batch."""
        self._batch.close()

    def why_not(self) -> str:
        """Return "": a batch refuses rules whose memory is not part of its states."""
        return ""

    def start(self) -> States:
        """Return the state in which the game begins."""
        states = States([], self._start["node"], self._start["alive"], self._start)
        self._load(states, np.arange(self.rows), 0, 0.0)
        return self._states().take(np.zeros(1, np.int64))

    def legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most)."""
        parts = []
        for begin in range(0, len(states), self.rows):
            rows = np.arange(begin, min(begin + self.rows, len(states)))
            self._load(states, np.arange(begin, begin + self.rows).clip(max=rows[-1]), turn, 0.0)
            legal = np.full((len(rows), len(self.roster.names), self._most()), -1)
            for team in self._batch.teams:
                view = self._batch.observe(team)
                found = view["legal"][: len(rows)]
                legal[:, view.agents, : found.shape[2]] = found
            legal[~states.alive[rows], 1:] = -1
            parts.append(legal)
        most = max(part.shape[2] for part in parts)
        padded = [np.pad(part, ((0, 0), (0, 0), (0, most - part.shape[2])), constant_values=-1) for part in parts]
        return np.concatenate(padded)

    def _most(self) -> int:
        return max(int(self._batch.observe(team).counts.max()) for team in self._batch.teams)

    def play(self, states: States, actions: IntArray, turn: int, shift: Perturbation = SAME) -> TurnResults:
        """Play a turn from each state."""
        number = len(states)
        batch = self._batch
        places = (np.arange(number) + shift.seed) % self.rows  # the games of the batch have seeds of their own
        rows = np.zeros(self.rows, np.int64)
        rows[places] = np.arange(number)
        before = self._load(states, rows, turn + shift.turns, shift.scores)
        chosen = actions[rows]
        batch.step({team: chosen[:, agents] for team, agents in zip(self._teams, self._acting, strict=True)})
        is_last = self.terms.last_turn is not None and turn + shift.turns + 1 >= self.terms.last_turn
        after = self._states()
        is_over = batch.is_over | is_last
        gains = np.stack([batch.scores.get(team, 0.0) - before[team] for team in batch.teams], axis=1)
        winner = np.where(is_over, NO_WINNER, GOES_ON)
        if is_over.any():
            numbers = {team: place for place, team in enumerate(batch.teams) if team is not None}
            won = [numbers.get(team, NO_WINNER) for team in batch.table()["winner"].tolist()]
            winner = np.where(is_over, won, winner)
        return TurnResults(after, gains, winner).take(places)

    def _load(self, states: States, rows: IntArray, turn: int, more: float) -> dict[Any, FloatArray]:
        """Load states into the games of the batch; return the scores by team."""
        columns = {name: values[rows] for name, values in (states.columns or {}).items()}
        scores = {
            team: columns.pop(("score", team), np.zeros(self.rows)) + more * (place + 1)
            for place, team in enumerate(self._batch.teams)
        }
        numbers = columns.pop("roads", np.zeros(self.rows, np.int64))
        maps = [*self._maps]
        if numbers.any():
            at_start = bytes(len(maps[0]))
            packed = b"".join(maps[number - 1] if number else at_start for number in numbers.tolist())
            columns["roads"] = np.frombuffer(packed, np.int32).reshape(self.rows, -1)
        self._batch.load(columns, turn, scores)
        return scores

    def _states(self) -> States:
        batch = self._batch
        columns = batch.columns()
        roads = columns.get("roads", np.zeros((len(batch), 0), np.int32))
        number = self._maps
        columns["roads"] = np.array(
            [number.setdefault(row.tobytes(), 1 + len(number)) if row.any() else 0 for row in roads]
        )
        if self.with_scores:
            columns |= {("score", team): batch.scores.get(team, np.zeros(len(batch))) for team in batch.teams}
        packed = [np.ascontiguousarray(one).reshape(len(batch), -1).view(np.uint8) for one in columns.values()]
        joined = np.ascontiguousarray(np.concatenate(packed, axis=1))
        keys = joined.view(f"V{joined.shape[1]}").ravel().tolist()
        return States(keys, self._streets.ids(columns["node"]), columns["alive"], columns)


class ContextSimulator:
    """Plays turns one after the other in a context; see `TurnSimulator`."""

    rows = _FEW_ROWS
    with_scores = False

    def __init__(self, ctx: Context, setup: GameSetup) -> None:
        self._game: Game = ctx.game
        self.roster = AgentTable.of(ctx.game.agents)
        self.terms = TurnTerms.of(ctx.game, setup.last_turn)
        self._actions: dict[str, int] = {}
        self._legal: dict[str, tuple[int, ...]] = {}
        for team in setup.teams:
            self._game.command(team, self._decide)
        self._hidden = HiddenState(*[one.rule for one in self._game.rules])
        self._start = self._game.snapshot()
        map = ctx.graph.columns()
        self._roads = map.offsets.tobytes() + map.targets.tobytes()

    def close(self) -> None:
        """End the context."""
        self._game.ctx.terminate()

    def why_not(self) -> str:
        """Return which rule remembers state that is not part of the game, or ""."""
        return self._hidden.changed("Keep it in ctx.game.data, so that it is part of the states.")

    def _decide(self, states: dict[str, Any]) -> None:
        """Set the actions to play, and store the legal nodes."""
        for name, state in states.items():
            legal = state["legal"]
            self._legal[name] = legal
            state["action"] = legal[self._actions.get(name, 0)]

    def start(self) -> States:
        """Return the state in which the game begins."""
        self._game.restore(self._start)
        return self._as_states([self._now()])

    def legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most)."""
        found = []
        for snapshot, nodes in zip(states.snapshots, states.nodes.tolist(), strict=True):
            self._actions = {}
            self._legal = {}
            self._restore(snapshot, turn, SAME)
            self._game.step()
            found.append([self._legal.get(name, (node,)) for name, node in zip(self.roster.names, nodes, strict=True)])
        most = max(len(legal) for legal in chain.from_iterable(found))
        return np.array([[[*legal, *[-1] * (most - len(legal))] for legal in those] for those in found])

    def play(self, states: States, actions: IntArray, turn: int, shift: Perturbation = SAME) -> TurnResults:
        """Play a turn from each state."""
        game = self._game
        moments = []
        gains = []
        winners = []
        teams = self.roster.teams
        names = self.roster.names
        for row, (snapshot, chosen) in enumerate(zip(states.snapshots, actions.tolist(), strict=True)):
            self._restore(snapshot, turn, shift._replace(seed=shift.seed and shift.seed + row))
            before = [game.scores[team] for team in teams]
            self._actions = dict(zip(names, chosen, strict=True))
            game.step()
            gains.append([game.scores[team] - points for team, points in zip(teams, before, strict=True)])
            winners.append(self._winner())
            moments.append(self._now())
        return TurnResults(self._as_states(moments), np.array(gains, np.float64), np.array(winners))

    def _restore(self, snapshot: Snapshot, turn: int, shift: Perturbation) -> None:
        game = self._game
        game.restore(snapshot)
        state = game.internals.state
        state.turn = turn + shift.turns
        if shift.seed:
            game.ctx.reseed(kernels.purpose_key(snapshot.seed, "solve", shift.seed) >> 1)
        for place, team in enumerate(self.roster.teams):
            if shift.scores:
                game.scores[team] += shift.scores * (place + 1)

    def _winner(self) -> int:
        game = self._game
        if game.over is None:
            is_late = self.terms.last_turn is not None and game.turn >= self.terms.last_turn
            return NO_WINNER if is_late else GOES_ON
        won = game.over["winner"]
        return self.roster.teams.index(won) if won is not None and won in self.roster.teams else NO_WINNER

    def _now(self) -> "_CapturedState":
        """Return the current state of the game."""
        game = self._game
        snapshot = game.snapshot()
        state = game.internals.state
        agents = game.ctx.agent.agents
        living = [name in agents and agents[name].alive for name in self.roster.names]
        nodes = [agents[name].current_node_id if name in agents else -1 for name in self.roster.names]
        block = game.ctx.agent.block
        covered = [block.progress_of(block.row_of(name)) for name in self.roster.names if name in agents]
        scores = dict(state.scores) if self.with_scores else None
        # an agent that was not asked yet has an empty memory
        memories = [{name: one for name, one in kept.items() if one} for kept in (state.memories, state.team_memories)]
        facts = (state.facts, state.agent_facts, state.team_facts)
        map = game.ctx.graph.columns()  # rules may close roads
        roads = map.offsets.tobytes() + map.targets.tobytes()
        roads = b"" if roads == self._roads else roads
        key = repr(as_sorted((nodes, living, covered, roads, state.data, memories, facts, scores))).encode()
        return _CapturedState(key, nodes, living, snapshot)

    def _as_states(self, moments: "Sequence[_CapturedState]") -> States:
        nodes, alive = (np.array([moment[place] for moment in moments]) for place in (1, 2))
        keys = [one.key for one in moments]
        snapshots = [one.snapshot for one in moments]
        return States(keys, nodes, alive.astype(np.bool_), snapshots=snapshots)


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
