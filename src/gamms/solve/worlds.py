"""One turn of a game from any of its states, by the scenario's own rules: in arrays where it can be, else one by one.

Each turn is played twice, the second time with another seed, turn and scores, so that what depends on these shows.
"""

from collections.abc import Hashable, Mapping, Sequence
from math import ceil, prod
from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms import kernels
from gamms.context import Context
from gamms.errors import BadValue, TooLarge
from gamms.game import Game
from gamms.game.batch import Batch
from gamms.game.batch.columns import Roster
from gamms.game.batch.state import Columns
from gamms.game.hidden_state import HiddenState
from gamms.game.snapshots import Snapshot
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.scenario import Scenario
from gamms.strategies import stay
from gamms.text import shown
from gamms.typing import AgentType

GOES_ON, NO_WINNER = -2, -1  # instead of the number of the team that has won
Strategies = Mapping[str, Any]
_MOST_ROWS, _FEWEST_ROWS = 1 << 13, 128  # turns that are played at once in arrays
_FEW_ROWS = 256  # ... and one by one
TOLERANCE = 1e-9  # of scores that are compared


class Shift(NamedTuple):
    """By what turns that are played for comparison differ from the real ones.

    Attributes:
        seed: 0: their own one; else each of them has another one, which follows from this.
        turns: by how many turns they are later.
        scores: what is added to those of the teams, once for the first, twice for the second, and so on.
    """

    seed: int
    turns: int
    scores: float


SAME = Shift(seed=0, turns=0, scores=0.0)


class States:
    """States of a game from which turns can be played: `columns` in arrays, `snapshots` one by one.

    Attributes:
        keys: what tells states apart, all that later turns follow from.
        nodes: (states, agents) ids of the nodes where agents are, in the order of their names.
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
        self.keys, self.nodes, self.alive, self.columns, self.snapshots = keys, nodes, alive, columns, snapshots

    def __len__(self) -> int:
        return len(self.keys)

    def take(self, rows: IntArray) -> "States":
        """Return some of the states."""
        columns = None if self.columns is None else {name: values[rows] for name, values in self.columns.items()}
        numbers = rows.tolist()
        snapshots = [self.snapshots[row] for row in numbers] if self.snapshots else ()
        return States([self.keys[row] for row in numbers], self.nodes[rows], self.alive[rows], columns, snapshots)


def joined(parts: Sequence[States]) -> States:
    """Return the states of several parts, of one game."""
    first = parts[0].columns
    columns = None if first is None else {name: np.concatenate([_of(one, name) for one in parts]) for name in first}
    keys, snapshots = ([one for part in parts for one in getattr(part, name)] for name in ("keys", "snapshots"))
    nodes, alive = np.concatenate([one.nodes for one in parts]), np.concatenate([one.alive for one in parts])
    return States(keys, nodes, alive, columns, snapshots)


def _of(states: States, name: Hashable) -> np.ndarray[Any, Any]:
    return states.columns[name]  # type: ignore[index] # asked of states in arrays


class Played(NamedTuple):
    """What a turn has led to, of many states.

    Attributes:
        states: afterwards.
        gains: (states, teams) by how much scores have changed.
        winner: (states,) the number of the team that has won, NO_WINNER, or GOES_ON.
    """

    states: States
    gains: FloatArray
    winner: IntArray

    def take(self, rows: IntArray) -> "Played":
        """Return what some of the turns have led to."""
        return Played(self.states.take(rows), self.gains[rows], self.winner[rows])

    def differs(self, other: "Played", *, by_winner: bool) -> BoolArray:
        """Return which turns have gone differently, (states,); whether it counts who wins."""
        keys = [mine != theirs for mine, theirs in zip(self.states.keys, other.states.keys, strict=True)]
        gains = (abs(self.gains - other.gains) > TOLERANCE).any(axis=1)
        winners = self.winner != other.winner
        if not by_winner:
            winners = (self.winner == GOES_ON) != (other.winner == GOES_ON)
        found: BoolArray = (np.array(keys, np.bool_) & (self.winner == GOES_ON)) | gains | winners
        return found


class World(Protocol):
    """A game of which any turn can be played.

    Attributes:
        roster: the agents.
        terms: how it is played.
        rows: how many turns are best played at once.
        with_scores: whether the scores so far are part of a state.
    """

    roster: Roster
    terms: "Terms"
    rows: int
    with_scores: bool

    def start(self) -> States:
        """Return the state in which the game begins."""

    def legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most), the own one first; behind the last one -1."""

    def play(self, states: States, actions: IntArray, turn: int, shift: Shift = SAME) -> Played:
        """Play a turn from each state, in which agents take actions, (states, agents)."""

    def why_not(self) -> str:
        """Return why what was played cannot be relied on; "" if it can."""

    def close(self) -> None:
        """End its contexts."""


class Terms(NamedTuple):
    """How a game is played.

    Attributes:
        order: the teams that move one after the other; None: all at once.
        last_turn: the turn after which it ends; None: not known.
        has_last_rule: whether a rule ends it then, which may give points or a winner.
    """

    order: list[list[Any]] | None
    last_turn: int | None
    has_last_rule: bool

    @classmethod
    def of(cls, game: Game, cut: int | None) -> "Terms":
        """Return those of a game that is cut after a turn; None: it is not."""
        order = game.settings()["order"]
        last = min((turn for turn in (game.last_turn, cut) if turn is not None), default=None)
        ends = [one.spec.last_turn for one in game.rules]
        return cls(order if order is not None and len(order) > 1 else None, last, last is not None and last in ends)


class Setup(NamedTuple):
    """Which game is looked at.

    Attributes:
        scenario: of the game.
        seed: of its start.
        teams: that are given actions, by what is solved.
        others: strategies of the others, by team or agent, in place of those of the scenario.
        last_turn: the turn after which the game is cut; None: as the scenario says.
        max_states: how many states there may be.
        limit: the argument that has said so.
    """

    scenario: Scenario
    seed: int
    teams: tuple[str, ...]
    others: Strategies
    last_turn: int | None
    max_states: int
    limit: str = "max_states"


def world_of(setup: Setup) -> World:
    """Return a game of which any turn can be played.

    Raises:
        BadValue: the game has something that is not solved.
        TooLarge: it has more joint positions than there may be states.
    """
    ctx = setup.scenario.build(setup.seed, {**setup.others, **dict.fromkeys(setup.teams, stay)})
    try:
        game = ctx.game
        _refuse(game)
        number = min(_MOST_ROWS, _FEWEST_ROWS + _positions(ctx, setup))
        is_plain = not game.scores and len(game.agents) == len(ctx.agent.agents)
        if is_plain and not game.settings()["channels"] and not any(one.phase == "before" for one in game.rules):
            batch = game.batch(number, seeds=range(setup.seed, setup.seed + number))
            if batch.slow is None:
                ctx.terminate()
                return ArrayWorld(batch, setup)
            batch.close()
        return ContextWorld(ctx, setup)
    except BaseException:
        ctx.terminate()
        raise


def _positions(ctx: Context, setup: Setup) -> int:
    """Return how many joint positions agents may get to; refuse more than there may be states."""
    game, graph = ctx.game, ctx.graph.columns()
    last = Terms.of(game, setup.last_turn).last_turn
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
            f"This game has up to {joint:,} joint positions ({len(reached)} agents that get to "
            f"{' x '.join(map(str, reached))} nodes), and {setup.limit}={setup.max_states:,} is allowed: "
            f"{fitting} of these agents on this map would fit, or {len(reached)} agents on {nodes} nodes. A smaller "
            f"map, fewer turns=, or a larger {setup.limit}= if there are time and memory."
        )
    return joint


def _within(graph: GraphColumns, row: int, steps: int) -> int:
    """Return how many nodes are at most so many edges away from a node."""
    seen, frontier = np.zeros(len(graph.node_ids), np.bool_), np.array([row])
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
        (settings["speed_unit"] != "edges", "agents travel by metres, and are anywhere on edges: use speeds in edges"),
        (bool(settings["deeds"]), f"agents may do {', '.join(settings['deeds'])} besides moving: leave the deeds out"),
        (settings["time_budget"] is not None, "a time budget makes it depend on the clock: leave time_budget out"),
    ]
    reasons += [
        (one.type is AgentType.AERIAL, f"agent {shown(one.name)} flies: let it go on the ground") for one in game.agents
    ]
    for is_there, reason in reasons:
        if is_there:
            raise BadValue(f"This game is not solved, because {reason}.")


class ArrayWorld:
    """A game that is played in arrays, many turns at once; see `World`."""

    with_scores = False

    def __init__(self, batch: Batch, setup: Setup) -> None:
        self._batch, self._teams = batch, setup.teams
        game = batch.game
        self.roster, self.rows = Roster.of(game.agents), len(batch)
        self.terms = Terms.of(batch.game.ctx.game, setup.last_turn)
        batch.step()  # now rules and strategies have what they remember
        batch.reset()
        self._streets = batch.observe(batch.teams[0]).streets
        self._start, self._maps = batch.columns(), dict[bytes, int]()  # which roads are open -> a number from 1 on
        self._acting = [batch.observe(team).agents for team in setup.teams]

    def close(self) -> None:
        """End the batch."""
        self._batch.close()

    def why_not(self) -> str:
        """Return "": a batch refuses what is not part of its states."""
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

    def play(self, states: States, actions: IntArray, turn: int, shift: Shift = SAME) -> Played:
        """Play a turn from each state."""
        number, batch = len(states), self._batch
        places = (np.arange(number) + shift.seed) % self.rows  # the games of the batch have seeds of their own
        rows = np.zeros(self.rows, np.int64)
        rows[places] = np.arange(number)
        before = self._load(states, rows, turn + shift.turns, shift.scores)
        chosen = actions[rows]
        batch.step({team: chosen[:, agents] for team, agents in zip(self._teams, self._acting, strict=True)})
        is_last = self.terms.last_turn is not None and turn + shift.turns + 1 >= self.terms.last_turn
        after, is_over = self._states(), batch.is_over | is_last
        gains = np.stack([batch.scores.get(team, 0.0) - before[team] for team in batch.teams], axis=1)
        winner = np.where(is_over, NO_WINNER, GOES_ON)
        if is_over.any():
            numbers = {team: place for place, team in enumerate(batch.teams) if team is not None}
            won = [numbers.get(team, NO_WINNER) for team in batch.table()["winner"].tolist()]
            winner = np.where(is_over, won, winner)
        return Played(after, gains, winner).take(places)

    def _load(self, states: States, rows: IntArray, turn: int, more: float) -> dict[Any, FloatArray]:
        """Let the games of the batch be in some states; return the scores by team."""
        columns = {name: values[rows] for name, values in (states.columns or {}).items()}
        scores = {
            team: columns.pop(("score", team), np.zeros(self.rows)) + more * (place + 1)
            for place, team in enumerate(self._batch.teams)
        }
        numbers, maps = columns.pop("roads", np.zeros(self.rows, np.int64)), [*self._maps]
        if numbers.any():
            at_start = bytes(len(maps[0]))
            packed = b"".join(maps[number - 1] if number else at_start for number in numbers.tolist())
            columns["roads"] = np.frombuffer(packed, np.int32).reshape(self.rows, -1)
        self._batch.load(columns, turn, scores)
        return scores

    def _states(self) -> States:
        batch = self._batch
        columns = batch.columns()
        roads, number = columns.get("roads", np.zeros((len(batch), 0), np.int32)), self._maps
        columns["roads"] = np.array(
            [number.setdefault(row.tobytes(), 1 + len(number)) if row.any() else 0 for row in roads]
        )
        if self.with_scores:
            columns |= {("score", team): batch.scores.get(team, np.zeros(len(batch))) for team in batch.teams}
        packed = [np.ascontiguousarray(one).reshape(len(batch), -1).view(np.uint8) for one in columns.values()]
        joined = np.ascontiguousarray(np.concatenate(packed, axis=1))
        keys = joined.view(f"V{joined.shape[1]}").ravel().tolist()
        return States(keys, self._streets.ids(columns["node"]), columns["alive"], columns)


class ContextWorld:
    """A game that is played in a context, one turn after the other; see `World`."""

    rows, with_scores = _FEW_ROWS, False

    def __init__(self, ctx: Context, setup: Setup) -> None:
        self._game: Game = ctx.game
        self.roster, self.terms = Roster.of(ctx.game.agents), Terms.of(ctx.game, setup.last_turn)
        self._actions: dict[str, int] = {}
        self._legal: dict[str, tuple[int, ...]] = {}
        for team in setup.teams:
            self._game.command(team, self._decide)
        self._hidden = [HiddenState(one.rule) for one in self._game.rules]
        self._start, map = self._game.snapshot(), ctx.graph.columns()
        self._roads = map.offsets.tobytes() + map.targets.tobytes()

    def close(self) -> None:
        """End the context."""
        self._game.ctx.terminate()

    def why_not(self) -> str:
        """Return which rule remembers what is not part of the game."""
        changed = [one.changed("Keep it in ctx.game.data, so that it is part of the states.") for one in self._hidden]
        return next(filter(None, changed), "")

    def _decide(self, states: dict[str, Any]) -> None:
        """Let agents take the actions that are to be played, and note what is legal."""
        for name, state in states.items():
            legal = self._legal[name] = state["legal"]
            state["action"] = legal[self._actions.get(name, 0)]

    def start(self) -> States:
        """Return the state in which the game begins."""
        self._game.restore(self._start)
        return self._as_states([self._now()])

    def legal(self, states: States, turn: int) -> IntArray:
        """Return the ids of legal nodes, (states, agents, most)."""
        found = []
        for snapshot, nodes in zip(states.snapshots, states.nodes.tolist(), strict=True):
            self._actions, self._legal = {}, {}
            self._restore(snapshot, turn, SAME)
            self._game.step()
            found.append([self._legal.get(name, (node,)) for name, node in zip(self.roster.names, nodes, strict=True)])
        most = max(len(legal) for those in found for legal in those)
        return np.array([[[*legal, *[-1] * (most - len(legal))] for legal in those] for those in found])

    def play(self, states: States, actions: IntArray, turn: int, shift: Shift = SAME) -> Played:
        """Play a turn from each state."""
        game, moments, gains, winners = self._game, [], [], []
        teams, names = self.roster.teams, self.roster.names
        for row, (snapshot, chosen) in enumerate(zip(states.snapshots, actions.tolist(), strict=True)):
            self._restore(snapshot, turn, shift._replace(seed=shift.seed and shift.seed + row))
            before = [game.scores[team] for team in teams]
            self._actions = dict(zip(names, chosen, strict=True))
            game.step()
            gains.append([game.scores[team] - points for team, points in zip(teams, before, strict=True)])
            winners.append(self._winner())
            moments.append(self._now())
        return Played(self._as_states(moments), np.array(gains, np.float64), np.array(winners))

    def _restore(self, snapshot: Snapshot, turn: int, shift: Shift) -> None:
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

    def _now(self) -> "_Moment":
        """Return how the game is now."""
        game = self._game
        snapshot, state, agents = game.snapshot(), game.internals.state, game.ctx.agent.agents
        living = [name in agents and agents[name].alive for name in self.roster.names]
        nodes = [agents[name].current_node_id if name in agents else -1 for name in self.roster.names]
        block = game.ctx.agent.block
        covered = [block.progress[block.row_of(name)] for name in self.roster.names if name in agents]
        scores = dict(state.scores) if self.with_scores else None
        # An empty memory is that of an agent that was not asked yet.
        memories = [{name: one for name, one in kept.items() if one} for kept in (state.memories, state.team_memories)]
        facts = (state.facts, state.agent_facts, state.team_facts)
        map = game.ctx.graph.columns()  # rules may close roads
        roads = map.offsets.tobytes() + map.targets.tobytes()
        roads = b"" if roads == self._roads else roads
        key = repr(as_sorted((nodes, living, covered, roads, state.data, memories, facts, scores))).encode()
        return _Moment(key, nodes, living, snapshot)

    def _as_states(self, moments: "Sequence[_Moment]") -> States:
        nodes, alive = (np.array([moment[place] for moment in moments]) for place in (1, 2))
        keys, snapshots = [one.key for one in moments], [one.snapshot for one in moments]
        return States(keys, nodes, alive.astype(np.bool_), snapshots=snapshots)


class _Moment(NamedTuple):
    key: bytes
    nodes: list[int]
    alive: list[bool]
    snapshot: Snapshot


def as_sorted(value: object) -> object:
    """Return a value that prints alike if it is equal: dicts and sets in a fixed order, arrays as their bytes."""
    if isinstance(value, Mapping):
        return "dict", sorted(((repr(key), as_sorted(one)) for key, one in value.items()), key=lambda item: item[0])
    if isinstance(value, set | frozenset):
        return "set", sorted(map(repr, map(as_sorted, value)))
    if isinstance(value, list | tuple):
        return [as_sorted(one) for one in value]
    return (value.dtype.str, value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value
