"""Plays the games of a batch one after the other in one context, where the core does not have all their parts."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property, partial
from typing import Any, Self

import numpy as np

from gamms.errors import BadValue, UnknownName
from gamms.game.batch.channels import radio_of
from gamms.game.batch.columns import AgentTable, PlayedGame
from gamms.game.batch.deeds import DeclaredDeeds
from gamms.game.batch.given import OutsideActions, OutsideActor
from gamms.game.batch.initial_state import movement_of
from gamms.game.batch.movement import AnyNodeMovement, Movement, Places
from gamms.game.batch.roads import RoadMap
from gamms.game.batch.sensing import note_sensors, note_sights
from gamms.game.batch.state import GameArrays
from gamms.game.batch.view import ArrayView
from gamms.game.deeds import checked_value
from gamms.game.hidden_state import HiddenState
from gamms.game.result import Result
from gamms.game.snapshots import Snapshot
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing import AgentType
from gamms.typing.on_edges import located

_ABSENT: dict[str, Any] = {}  # how a game is over that another engine plays


class SequentialEngine:
    """Plays the games of a batch one after the other: each is a snapshot that is restored for its turn.

    Attributes:
        loaded: the number of the game that the context has; None: of none.
        ran_from: games that were played to their ends at once -> how many turns they had before.
    """

    def __init__(self, game: PlayedGame, roster: AgentTable, seeds: Sequence[int]) -> None:
        agents = game.ctx.agent.agents
        likely = [
            agents.get(one.name) or next((a for a in agents.values() if a.team == one.team), None)
            for one in roster.agents
        ]
        roster = roster._replace(agents=[one or next(iter(agents.values())) for one in likely])
        self._game, self._roster, self.seeds = game, roster, list(seeds)
        self._snapshots: list[Snapshot | None] = [None] * len(seeds)  # None: at the start, over, or in the context
        self.loaded: int | None = None
        self._shown: int | None = None  # the game that the context was pointed at by `show`
        self.ran_from = dict[int, int]()
        self._beyond_arrays = dict[int, UnknownName]()  # games with agents at or next to nodes that rules have added
        self._acting = OutsideActor(game, roster)
        self._results: list[Result | None] = [None] * len(seeds)
        self._first = game.turn, dict(game.scores)  # of games that have begun
        self._turns = np.full(len(seeds), game.turn)
        self._scores: list[dict[Any, float]] = [dict(game.scores) for _ in seeds]
        self._last: int | None = game.settings()["max_turns"]
        self._first_over = self._how_over()
        self._over = [self._first_over] * len(seeds)
        self._observed = self._nothing_observed()
        self._is_watched = False  # whether games were observed, and probably will be after each turn
        self._is_observed = np.zeros(len(seeds), np.bool_)
        self._hidden = [HiddenState(one) for one in _functions_of(game, roster)]
        self._played = 0  # turns, and games that were played to their ends

    @property
    def is_over(self) -> BoolArray:
        """Which games have ended, (games,)."""
        return np.array([over is not None for over in self._over])

    def leave(self, games: IntArray) -> None:
        """Play these games no more until they start again: another engine plays them."""
        for game in games.tolist():
            self._forget(game)
            self._over[game] = _ABSENT
            if game == self._shown:
                self._shown = None

    def start(self, games: IntArray, seeds: Sequence[int]) -> None:
        """Begin games again, with other seeds."""
        for game, seed in zip(games.tolist(), seeds, strict=True):
            self._forget(game)
            self.seeds[game] = seed
            self._turns[game], self._scores[game] = self._first
            self._observed.reset(np.array([game]), [seed], self._observed.node[[game]])

    def _forget(self, game: int) -> None:
        """Forget what has become of a game."""
        if game == self.loaded:
            self.loaded = None
        self._snapshots[game] = self._results[game] = None
        self._over[game] = self._first_over
        self.ran_from.pop(game, None)
        self._beyond_arrays.pop(game, None)
        self._is_observed[game] = False

    @contextmanager
    def undoing_after_error(self, playing: IntArray) -> Iterator[None]:
        """Let a turn of some games be played in the block; where it raises, they are as they were before."""
        self._put_aside()
        before = [*self._snapshots], [*self._results], [*self._over], self._turns.copy(), [*self._scores]
        try:
            yield
        except BaseException:
            self._acting.end()
            self.loaded = None
            self._snapshots, self._results, self._over, self._turns, self._scores = before
            self._is_observed[playing] = False
            raise

    def check(self, given: Mapping[Hashable, OutsideActions], games: IntArray) -> None:
        """Refuse what cannot be done in one of some games as they are now, before any is played."""
        if not given:
            return
        self._observe_all(games)
        is_played = np.isin(np.arange(len(self.seeds)), games)[:, None]
        for team, one in given.items():
            view = ArrayView(self._observed, np.arange(len(self.seeds)), self._roster.members(team))
            view.mask = view.mask & is_played
            view._deeds, view._outboxes = [], []
            one.act(view)
            if not one.may_stay:
                view.mask = view.mask & ~np.isin(view.agents, self._flyers)
                if self._game.settings()["decide"] == "arrival":
                    view.mask = view.mask & (view._places().edge[..., 0] < 0)
                view._checked(one.moves, f"team {shown(team)}")

    def _are_open(self, edges: IntArray, games: IntArray) -> BoolArray:
        """Return which edges, by their ids, are there in games of these numbers."""
        found = np.zeros(edges.shape, np.bool_)
        for number in np.unique(games).tolist():
            there = games == number
            found[there] = np.isin(edges[there], self._load(number).ctx.graph.columns().edge_ids)
        return found

    def step_game(self, number: int, given: Mapping[Hashable, OutsideActions]) -> None:
        """Play one turn of a game."""
        with self._named(number):
            game = self._load(number)
            try:
                self._acting.take(given, number)
                game.step()
            except BaseException:
                self._acting.end()
                if game.turn > self._turns[number]:  # a rule has raised when all had moved
                    self._store(number)
                raise
        self._store(number)
        self._refuse_hidden()

    def run(self, number: int) -> None:
        """Play a game to its end; after an interrupt it is where it was before."""
        if number == self.loaded:
            self._put_aside()
        before = self._snapshots[number]
        game = self.load(number)
        last = None if self._last is None else max(0, self._last - game.turn)
        self.ran_from[number] = game.turn
        try:
            with self._named(number):
                game.run(last)
        except Exception:
            self._store(number)
            raise
        except BaseException:
            self.loaded, self._snapshots[number] = None, before
            self.ran_from.pop(number)
            raise
        self._store(number)
        self._refuse_hidden()

    def _refuse_hidden(self) -> None:
        """Refuse what has remembered a game where the others would find it; looked at in turns that get rarer."""
        self._played += 1
        for one in () if self._played & (self._played - 1) else self._hidden:
            changed = one.changed("A batch plays its games in turns: keep it in state['memory'] or ctx.game.data.")
            if changed:
                raise BadValue(changed)

    @contextmanager
    def _named(self, number: int) -> Iterator[None]:
        """Say of errors in which game they are."""
        try:
            yield
        except Exception as error:
            error.add_note(f"In game {number} of a batch, with the seed {self.seeds[number]}.")
            raise

    def view(self, agents: IntArray, games: IntArray) -> ArrayView:
        """Return what agents observe in some games."""
        self._observe_all(games)
        for roads, _ in self._observed.roads.by_map(games):
            if roads is not None:
                roads.world = None  # which has what was legal before
        self.return_to_shown()
        return ArrayView(self._observed, games, agents)

    def _observe_all(self, games: IntArray) -> None:
        self._is_watched = True
        for number in games[~self._is_observed[games]].tolist():
            self.load(number)
            self._observe(number)
        self.refuse_beyond_arrays(games.tolist())

    def refuse_beyond_arrays(self, games: Iterable[int]) -> None:
        """Refuse to observe games in which agents are at nodes that rules have added, or next to these."""
        for number in games:
            if number in self._beyond_arrays:
                error = self._beyond_arrays[number]
                raise BadValue(
                    f"Game {number} cannot be observed, nor be given actions: {error} A rule has added it to "
                    "the map of this game, and arrays have the nodes that are there at the start. Have it there."
                )

    def _nothing_observed(self) -> GameArrays:
        movement = movement_of(self._game, self._roster, may_reopen=True, is_detached=True)
        shape = len(self.seeds), len(self._roster.names)
        self._roads_at_start = self._game.ctx.graph.graph.revision
        self._flyers = [i for i, agent in enumerate(self._roster.agents) if agent.type is AgentType.AERIAL]
        agents = range(len(self._roster.agents))
        self._odd = [i for i in agents if i in self._flyers or not movement.are_plain(np.array([i]))]
        self._revision = None if isinstance(movement, AnyNodeMovement) else self._game.ctx.graph.graph.revision
        self._legal = (
            TurnEngineMovement(movement) if self._flyers or not isinstance(movement, AnyNodeMovement) else None
        )
        state = GameArrays(self._roster, self._legal or movement, self.seeds, np.zeros(shape, np.int64))
        settings, check = self._game.settings(), partial(checked_value, ctx=self._game.ctx)
        state.deeds = DeclaredDeeds(settings["deeds"], check, self._roster, state.streets, self._are_open)
        state.radio = radio_of(settings, self._roster, shape[0])
        self._places = state.places = Places(np.full((*shape, 3), -1), np.zeros(shape), np.zeros((*shape, 2)))
        self._note_sensors(state)
        return state

    def _note_sensors(self, state: GameArrays) -> None:
        """Note which sensors the agents of the roster carry."""
        note_sensors(state, range(len(self._roster.agents)), with_nodes=True)
        state.shared.clear()

    def _observe(self, number: int) -> None:
        """Note where the agents of the game that the context has are, if that is where arrays can say."""
        self._beyond_arrays.pop(number, None)
        try:
            self._note(number)
        except UnknownName as error:
            self._beyond_arrays[number] = error

    def _note(self, number: int) -> None:
        state, ctx, known = self._observed, self._game.ctx, self._game.ctx.agent.agents
        # One that has not come is not there; one that was deleted stays where it was.
        agents = [known.get(name, one) for name, one in zip(self._roster.names, self._roster.agents, strict=True)]
        if agents != self._roster.agents:  # some have come, with sensors of their own
            self._roster.agents[:] = agents
            self._note_sensors(state)
        state.is_there[number] = [name in known for name in self._roster.names] | self._roster.is_first
        nodes = state.streets.rows([agent.current_node_id for agent in agents])
        state.turn[number], state.node[number] = self._game.turn, nodes
        state.put_roads(np.array([number]), self._roads())
        state.alive[number] = [name in known and known[name].alive for name in self._roster.names]
        self._is_observed[number] = True
        state.now.clear()
        if self._legal is not None:
            paced = [i for i, agent in enumerate(agents) if agent.speed is not None]  # which rules may have set
            self._note_legal(self._legal, number, nodes, {*self._odd, *paced})
        edge, offset_m, xy = (column[number] for column in self._places)
        edge[:], offset_m[:], xy[:] = -1, 0.0, state.streets.columns.xy[nodes]
        if state.flights is not None:
            flying: list[Any] = [agents[i] for i in self._flyers]
            state.flights.position[number] = [
                one.position if one.type is AgentType.AERIAL else (*xy[i], 0.0)  # another kind may have come
                for i, one in zip(self._flyers, flying, strict=True)
            ]
        note_sights(state, ctx, self._game.internals.parts.turns.looks, number)
        block = ctx.agent.block
        for i, agent in enumerate(agents if block.travellers else ()):
            progress = block.on_edge(block.row_of(agent.name)) if agent.name in known else None
            place = None if progress is None else located(ctx.graph.graph, progress)
            if place is not None:
                edge[i], offset_m[i], xy[i] = place[:3]

    def _roads(self) -> RoadMap | None:
        """Return which roads are open in the game that the context has; None: those of the start, or it has others."""
        graph = self._game.ctx.graph
        if graph.graph.revision == self._roads_at_start:
            return None
        try:
            return self._observed.roads.map_with(*graph.storage.roads())
        except (BadValue, UnknownName):
            return None

    def _note_legal(self, noted: "TurnEngineMovement", number: int, nodes: IntArray, odd: Iterable[int]) -> None:
        """Note where the agents of the game that the context has may go: those that are out stay; some go oddly."""
        revision = self._game.ctx.graph.graph.revision
        is_known, names = revision is not None and revision == self._revision, self._roster.names
        if is_known:
            noted.note_plain(number, nodes)
        odd = odd if is_known else range(len(names))
        legal, rows = self._game.internals.parts.turns.legal([names[agent] for agent in odd]), noted.streets.rows
        for agent in odd:
            found = legal.get(names[agent])
            noted.note(number, agent, rows(found) if found else nodes[agent : agent + 1])

    def over(self, number: int) -> dict[str, Any] | None:
        """Return how a game has ended; None: it goes on."""
        return self._over[number]

    def scores(self) -> dict[Any, Any]:
        """Return the scores of all games: key -> (games,)."""
        keys = dict.fromkeys(key for scores in self._scores for key in scores)
        return {key: np.array([scores.get(key, 0) for scores in self._scores], np.float64) for key in keys}

    def turns(self) -> IntArray:
        """Return how many turns were played, (games,)."""
        return self._turns.copy()

    def result(self, number: int) -> Result:
        """Return the result of a game so far."""
        known = self._results[number]
        if known is None:
            self.load(number)
            known = self._results[number] = self._result()
        return known

    def release(self) -> None:
        """Have the context as it was before games were played in it."""
        self._put_aside()
        self._game.reset(seed=self.seeds[0])
        self._acting.end()

    def can_show(self, number: int) -> bool:
        """Whether the context can be pointed at a game, because it goes on or is still there."""
        return self._over[number] is None or number == self.loaded or self._snapshots[number] is not None

    def show(self, number: int) -> PlayedGame:
        """Point the context at a game, and point it there again after each turn."""
        self._shown = number
        return self.load(number)

    def return_to_shown(self) -> None:
        """Point the context at the game that it was pointed at by `show`, if it was."""
        if self._shown is not None and self._shown != self.loaded:
            self.load(self._shown)

    def load(self, number: int) -> PlayedGame:
        """Let the context have a game as it is now, in which strategies and plans decide."""
        self._acting.end()
        return self._load(number)

    def _load(self, number: int) -> PlayedGame:
        game, snapshot = self._game, self._snapshots[number]
        if self.loaded == number:
            return game
        self._put_aside()
        self._snapshots[number] = None
        if snapshot is None:
            game.reset(seed=self.seeds[number])
            self._acting.end()
        else:
            game.restore(snapshot)
        self.loaded = number
        return game

    def _put_aside(self) -> None:
        """Keep the game that the context has as a snapshot."""
        self._acting.end()
        if self.loaded is not None and (self._over[self.loaded] is None or self.loaded == self._shown):
            self._snapshots[self.loaded] = self._game.snapshot()
        self.loaded = None

    def _store(self, number: int) -> None:
        """Keep what has become of the game that the context has."""
        game = self._game
        self._turns[number], self._scores[number], self._results[number] = game.turn, dict(game.scores), None
        self._over[number] = self._how_over()
        self._is_observed[number] = False
        if self._is_watched or self._over[number] is not None:
            self._observe(number)
        if self._over[number] is not None:
            self._acting.end()
            self._results[number] = self._result()

    def _how_over(self) -> dict[str, Any] | None:
        """Return how the game that the context has is over; None: it goes on."""
        if self._game.over is not None:
            return dict(self._game.over)
        is_late = self._last is not None and self._game.turn >= self._last
        return {"reason": "max_turns", "winner": None, "truncated": True} if is_late else None

    def _result(self) -> Result:
        result = self._game.result()
        if result.reason == "unfinished" and self._last is not None and result.turns >= self._last:
            result.reason = "max_turns"
        return result


def _functions_of(game: PlayedGame, roster: AgentTable) -> list[Callable[..., object]]:
    """Return the functions that decide, rule and collect in a game, each once."""
    conflicts = game.settings()["conflicts"]
    functions = [agent.strategy for agent in roster.agents]
    functions += [plan.function for plan in game.plans.values()]
    for one in game.rules:
        functions += [one.rule, getattr(one.rule, "check", None)]
    functions += [one.fn for one in game.internals.parts.collectors.by_name.values()]
    functions.append(None if conflicts is None else conflicts.resolve)
    return [*{id(one): one for one in functions if one is not None}.values()]


class TurnEngineMovement(Movement):
    """Agents of games that are played by the turn engine, which says of each where it may go.

    A choice is the number of a game and an agent.

    Args:
        movement: how the agents go.
    """

    def __init__(self, movement: Movement) -> None:
        super().__init__(movement.streets, movement.whole, movement.closed)
        self._movement, self.leaves_nodes = movement, movement.leaves_nodes
        self.is_plain = movement.is_plain  # while no agent was noted by itself
        self._noted = set[int]()  # agents that were
        self.begin((0, 0))

    @cached_property
    def width(self) -> int:
        """How many actions there are; see `Movement`."""
        return self._movement.width

    def on(self, roads: RoadMap) -> Self:
        """Return how the same agents go in games that have a map of their own, where they have noted the same."""
        own = super().on(roads)
        own.is_plain = False
        return own

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents, all of which stay."""
        super().begin(shape)
        self._agents, self.now = shape[1], np.zeros(shape[0])
        self._count, self._nodes = np.ones(shape[0] * shape[1], np.int64), np.zeros((shape[0] * shape[1], 1), np.int64)

    def note(self, game: int, agent: int, legal: IntArray, now: float = 0.0) -> None:
        """Note where an agent of a game may go, rows of nodes, at a time of the turn."""
        number, most = game * self._agents + agent, len(legal)
        self._widen(most)
        self.is_plain = False
        self._noted.add(agent)
        self.now[game] = now
        self._count[number], self._nodes[number, :most] = most, legal

    def note_plain(self, game: int, node: IntArray) -> None:
        """Note that the agents of a game, on these nodes, may go along one edge."""
        rows, legal = slice(game * self._agents, (game + 1) * self._agents), self.streets.legal[node]
        self._widen(legal.shape[1])
        self._count[rows], self._nodes[rows, : legal.shape[1]] = self.streets.counts[node], legal

    def are_plain(self, agents: IntArray) -> bool:
        """Whether none of some agents was noted by itself."""
        return self._noted.isdisjoint(agents.tolist())

    def _widen(self, most: int) -> None:
        """Make the columns of legal nodes so wide for each agent."""
        more = most - self._nodes.shape[1]
        if more > 0:
            self._nodes = np.pad(self._nodes, ((0, 0), (0, more)))

    def counts(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return how many nodes are legal."""
        return self._count[np.broadcast_to(which[0] * self._agents + which[1], node.shape)]

    def legal(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, BoolArray]:
        """Return the rows of legal nodes, and which of them count."""
        counts = self.counts(node, which)[..., None]
        columns = np.arange(int(counts.max(initial=1)))
        numbers = np.broadcast_to(which[0] * self._agents + which[1], node.shape)
        return self._nodes[numbers[..., None], np.minimum(columns, counts - 1)], columns < counts
