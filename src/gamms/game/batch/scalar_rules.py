"""What has no array form in games that are played in arrays: called game by game, in one context for all."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from functools import cache
from itertools import pairwise
from operator import itemgetter
from typing import Any

import numpy as np

from gamms.game.batch.columns import PlayedGame, put_locked
from gamms.game.batch.flights import InAir
from gamms.game.batch.movement import Moves, Paths
from gamms.game.batch.rule_fork import Admit, GameColumns, LeavesArrays, NoRow, OwnState, RuleFork
from gamms.game.batch.state import GameArrays
from gamms.game.batch.turn import ArrayTurn
from gamms.game.batch.unknown import NeedsTurnEngine
from gamms.game.conflicts import ranked
from gamms.game.legality import ResolvedAction
from gamms.game.result import Collector
from gamms.game.settings import NamedRule, as_called
from gamms.ir.agents import Position
from gamms.ir.graph import ClosedEdges, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Progress
from gamms.text import as_code


def called_one_by_one(game: PlayedGame) -> dict[str, Callable[..., object]]:
    """Return what of a game has no array form and is called game by game: in words -> it."""
    specs = [(one.name, one.spec) for one in game.rules]
    conflicts = game.settings()["conflicts"]
    found = {f"the rule {one.name!r}": one.rule for one in as_called(game.rules) if one.spec.array_form is None}
    found |= {
        f"the check of the rule {name!r}": spec.check
        for name, spec in specs
        if spec.check is not None and spec.array_check is None
    }
    found |= {f"the collector {name!r}": one.fn for name, one in collectors_of(game).items()}
    if conflicts is not None and ranked(conflicts) is None:
        found[f"the conflicts {as_code(conflicts)}"] = conflicts.resolve
    return found


def collectors_of(game: PlayedGame) -> dict[str, Collector]:
    """Return what is collected in a game, by name."""
    return game.internals.parts.collectors.by_name


def why_not_called(game: PlayedGame) -> str | None:
    """Return why what has no array form cannot be called game by game either, in words; None: it can."""
    block = game.ctx.agent.block
    sensors = [sensor for agent in game.agents for sensor in agent.sensors.values()]
    reasons = [
        (block.has_teams, "agents of a team in arrays"),
        (not all(getattr(one, "sees_world_only", False) for one in sensors), "sensors that may see more than the map"),
    ]
    return next((why for is_so, why in reasons if is_so), None)


_LISTED_AT_ONCE = 32  # games
Act = Callable[["RuleFork", int], None]  # what is done in a context that has a game, the one at a place in the turn


class RuleContext:
    """The context in which rules without an array form are called: it is made to have one game after the other.

    A game in which a rule does what arrays cannot have leaves them: the turn engine plays it again from its start.

    Args:
        start: returns the game of the batch at its start, whose context is not played in.
        state: of all games.
        own: what each game has beside the arrays; None: as at the start.
        take_roads: lets a game have the edges that a rule has left open, or returns why that is not possible.
        admit: lets arrays have an agent that has come and its sensors, or returns why that is not possible.
    """

    def __init__(
        self,
        start: Callable[[], PlayedGame],
        state: GameArrays,
        own: list[OwnState | None],
        take_roads: Callable[[int, IntArray, ClosedEdges], str | None],
        admit: Admit,
    ) -> None:
        self.start, self._state, self._own = cache(start), state, own
        self._take_roads, self._admit = take_roads, admit
        self._known: RuleFork | None = None

    @property
    def fork(self) -> "RuleFork":
        """The context; made when it is needed, and again after a rule has changed more than a game."""
        if self._known is None:
            self._known = RuleFork(self.start(), self._state, self._admit)
        return self._known

    def functions(self) -> list[Callable[..., object]]:
        """Return the rules, checks and the conflict resolver that are called game by game."""
        return [*called_one_by_one(self.fork.game).values()] if called_one_by_one(self.start()) else []

    def call(self, rules: Sequence[NamedRule], turn: ArrayTurn) -> None:
        """Call rules of one phase in each game of a turn."""
        named = " or ".join([f"the rule {one.name!r}" for one in rules])
        self._each(turn, rules[0].phase, named, lambda fork, _: fork.call(rules))

    def check(self, named: NamedRule, turn: ArrayTurn, _ends: IntArray) -> BoolArray:
        """Let the check of a rule refuse moves, (games, agents) are returned, and deeds, which the turn notes."""
        refused = np.zeros(turn.node.shape, np.bool_)

        def act(fork: "RuleFork", at: int) -> None:
            refusals, number = fork.refusals(named), fork.number
            refused[at, [number[name] for name in refusals.moves]] = True
            for name, deeds in refusals.deeds.items():
                for kind, why in deeds.items():
                    turn._refused.setdefault((at, number[name], kind), set()).update(why)

        self._each(turn, "deeds", f"the check of the rule {named.name!r}", act)
        return refused

    def resolve(self, turn: ArrayTurn, moves: Moves) -> BoolArray:
        """Return which agents the conflict resolver of the game stops, (games, agents)."""
        stopped, turn = np.zeros(turn.node.shape, np.bool_), copy(turn)
        turn.starts, turn.ends, turn.paths, turn.took_part = moves.starts, moves.ends, moves.paths, turn.alive

        def act(fork: "RuleFork", at: int) -> None:
            stopped[at, [fork.number[name] for name in fork.losers()]] = True

        self._each(turn, "conflicts", "the conflict resolver", act)
        turn._find_roads()
        return stopped

    def collect(self, turn: ArrayTurn) -> None:
        """Collect values in each game of a turn in which one is due."""
        due = [turn.turn % one.every == 0 for one in collectors_of(self.start()).values()]
        is_due = np.logical_or.reduce(due, axis=0) if due else np.zeros(0, np.bool_)
        if is_due.any():
            part = turn if is_due.all() else turn._of(is_due)
            self._each(part, "after", "a collector", lambda fork, _: fork.collect())
            put_locked(turn.node, is_due, part.node)
            put_locked(turn.alive, is_due, part.alive)

    def ask(self, turn: ArrayTurn, named: str, act: Act, *, needs_game: bool) -> None:
        """Let strategies decide in each game of a turn, which is loaded if they need it; nothing changes there."""
        self._each(turn, "decide", named, act, needs_game=needs_game)

    def _each(self, turn: ArrayTurn, phase: str, named: str, act: Act, *, needs_game: bool = True) -> None:
        """Do something in each game of a turn that arrays have; where that is not possible, the game leaves them.

        Errors of what decides are raised, but those which say that a game needs the turn engine.
        """
        decides = phase == "decide"
        unloaded = ((at, 0, None) for at in range(len(turn.games)))
        for at, i, columns in self._in_turns(turn, phase) if needs_game else unloaded:
            game = int(turn.games[at])
            if game in self._state.apart:
                continue
            fork = self.fork
            fork.forget_calls()
            fork.show_roads(self._state.roads.of(game))
            try:
                if columns is not None:
                    fork.load(i, game, self._own[game] or fork.first_state(), columns, phase)
                act(fork, at)
                if not decides:
                    self._own[game] = fork.taken(at, turn)
                    self._take_map(game)
            except NoRow as error:
                by = self.fork.calling or named
                error.add_note(f"In game {game} of a batch, in turn {int(turn.turn[at])}, called by {by}.")
                raise
            except Exception as error:
                if decides and not isinstance(error, NeedsTurnEngine | LeavesArrays) and not self.fork.notes:
                    error.add_note(f"In game {game} of a batch, with the seed {self._state.seeds[game]}.")
                    raise
                # whatever a rule raises, the turn engine raises it again
                by = self.fork.calling or named
                self._leave([game], by, error)
                self._recover(by, error)

    def _take_map(self, game: int) -> None:
        """Let a game have the roads that were left open in it."""
        changed = self.fork.taken_roads()
        if changed is not None:
            self.fork.calling = self.fork.changed_map_by
            why = self._take_roads(game, *changed)
            if why is not None:
                raise LeavesArrays(why)

    def _recover(self, named: str, error: Exception) -> None:
        """Have the context as it was before an error, or another one, without the agents that have come there."""
        if not self.fork.has_recovered():
            self._known = None
            for game, own in enumerate(self._own):
                if own is not None and own.came:
                    self._leave([game], named, LeavesArrays(str(error)))

    def _in_turns(self, turn: ArrayTurn, phase: str) -> Iterator[tuple[int, int, GameColumns]]:
        """Yield the games of a turn by who has come in them: the place in the turn, and that in columns of some."""
        by_cast: dict[tuple[str, ...], list[int]] = {}
        # NOTE: games in which the same agents live share what the turn engine works out of that.
        for at in np.lexsort(np.concatenate((turn.alive, turn.took_part), axis=1).T).tolist():
            own = self._own[turn.games[at]]
            by_cast.setdefault(() if own is None else own.came, []).append(at)
        for came, several in by_cast.items():
            those = [at for at in several if int(turn.games[at]) not in self._state.apart]  # some may just have left
            if not those:
                continue
            self.fork.stand(came)
            listed = _columns(self._state, turn, those, self.fork.rows, is_moving=phase not in ("before", "after"))
            places = ((i, columns) for columns in listed for i in range(len(columns.turns)))
            for at, (i, columns) in zip(those, places, strict=True):
                if self.fork.came != came and int(turn.games[at]) not in self._state.apart:
                    self.fork.stand(came)
                yield at, i, columns

    def _leave(self, games: list[int], named: str, error: Exception) -> None:
        """Let games leave the arrays; all that go on, too, where that is for what the rule is, not for what it did."""
        over = self._state.over
        others = range(len(over)) if isinstance(error, NeedsTurnEngine) else ()
        for one in [*games, *(other for other in others if over[other] is None)]:
            self._state.apart.setdefault(one, f"{named}: {error}")


def _columns(
    state: GameArrays, turn: ArrayTurn, those: Sequence[int], rows: IntArray, *, is_moving: bool
) -> Iterator[GameColumns]:
    """Yield games of a turn as lists, in their order, of the agents of these numbers."""
    at, ids = np.array(those), turn.streets.ids_of
    games, number = turn.games[at], {one: i for i, one in enumerate(those)}
    headings = state.headings
    assert headings is not None  # noqa: S101 - there are such rules
    progress = state.movement.progress(turn.node[at], games)
    row_of = {one: row for row, one in enumerate(rows.tolist())}
    of_rows: list[dict[int, Progress]] = [
        {row_of[agent]: one for agent, one in of_game.items() if agent in row_of} for of_game in progress
    ] or [{} for _ in those]
    actions = _actions(state, turn, at, progress if is_moving else [])
    for i, number_of, flight in _flights(turn, at):
        actions[i][number_of] = flight
    for (one, agent), done in _deeds(state, turn).items():
        if one in number:
            known = actions[number[one]].get(agent)
            if known is None:
                start, end = (ids(nodes[one, agent]).item() for nodes in (turn.starts, turn.ends))
                known = ResolvedAction(end, (start,) if start == end else (start, end))
            actions[number[one]][agent] = known._replace(deeds=done)
    in_air, began = _in_air(state, games, row_of)
    found = (
        turn.turn[at],
        ids(turn.node[at][:, rows]),
        ids(headings.previous[games][:, rows]),
        turn.alive[at][:, rows],
        turn.took_part[at][:, rows],
        state.placed[games][:, rows],
        turn.took_part[at],
        ids(turn.starts[at]),
        ids(turn.ends[at]),
        ids(state.start[games][:, state.roster.is_first]),
    )
    others = of_rows, in_air, began, actions, state.scores.of(games)
    # NOTE: so many lists at once as Python's garbage collector does not look through again and again, which took a
    # quarter of the time (benchmarks: a plain rule).
    for first in range(0, len(those), _LISTED_AT_ONCE):
        some = slice(first, first + _LISTED_AT_ONCE)
        yield GameColumns(*(column[some].tolist() for column in found), *(column[some] for column in others))


def _in_air(
    state: GameArrays, games: IntArray, row_of: Mapping[int, int]
) -> tuple[list[dict[int, InAir]], list[dict[str, Position]]]:
    """Return where agents that fly are in some games, by row, and where they began, by name."""
    flyers = state.flyers
    if flyers is None:
        return [{}] * len(games), [{}] * len(games)
    here, is_first = np.flatnonzero(np.isin(flyers.agents, [*row_of])), state.roster.is_first[flyers.agents]
    rows = [row_of[one] for one in flyers.agents[here].tolist()]
    places = [dict(zip(rows, of_game, strict=True)) for of_game in flyers.places(games, here)]
    names = [state.roster.names[number] for number in flyers.agents[is_first].tolist()]
    starts = flyers.start[games][:, is_first].tolist()
    return places, [dict(zip(names, [tuple(xyz) for xyz in of_game], strict=True)) for of_game in starts]


def _deeds(state: GameArrays, turn: ArrayTurn) -> dict[tuple[int, int], dict[str, dict[str, Any]]]:
    """Return what agents do besides moving: place in the turn and agent -> deed -> its fields."""
    several: list[tuple[int, int, int, str, dict[str, Any]]] = []
    for done in map(turn.performed, state.deeds.declared):
        fields = {key: state.deeds.plain(done, key) for key in done.values}
        numbers = zip(done.order.tolist(), done.at.tolist(), done.agents.tolist(), strict=True)
        for i, (order, at, agent) in enumerate(numbers):
            values = {key: column[i] for key, column in fields.items() if column[i] is not None}
            several.append((order, at, agent, done.kind, values))
    deeds: dict[tuple[int, int], dict[str, dict[str, Any]]] = {}
    for _, at, agent, kind, values in sorted(several, key=itemgetter(0)):
        deeds.setdefault((at, agent), {})[kind] = values
    return deeds


def _actions(
    state: GameArrays, turn: ArrayTurn, at: IntArray, begun: Sequence[Mapping[int, Progress]]
) -> list[dict[int, ResolvedAction]]:
    """Return how agents go in some games of a turn that do not just go along one edge, by their numbers."""
    if turn.paths is None:
        return [{} for _ in at]
    paths: Paths = turn.paths.of(at)
    nodes, times, stays = turn.streets.ids(paths.nodes).tolist(), paths.times.tolist(), paths.stays.tolist()
    legs, lengths, waits = state.movement.legs(paths), paths.lengths.tolist(), paths.waits.tolist()
    found: list[dict[int, ResolvedAction]] = [{} for _ in at]
    for i, actions in enumerate(found):
        for agent, length in enumerate(lengths[i]):
            gone, ended = legs.get((i, agent), ((), None))
            if gone or not stays[i][agent]:
                stops = [*zip(nodes[i][agent][:length], times[i][agent][:length], strict=True)]
                if gone:  # one that turns back on an edge does not come to the node that it passed last
                    left = 1 + waits[i][agent]
                    stops = stops[:left] + [here for last, here in pairwise(stops[left - 1 :]) if last[0] != here[0]]
                path, when = zip(*stops, strict=True)
                place = begun[i].get(agent) if begun else None
                actions[agent] = ResolvedAction(
                    path[-1], path, times=when, progress=ended, legs=tuple(gone), begun=place
                )
    return found


def _flights(turn: ArrayTurn, at: IntArray) -> Iterator[tuple[int, int, ResolvedAction]]:
    """Yield what agents do that fly in some games of a turn: the place of the game, the number of the agent, and it."""
    if turn.flights is None:
        return
    flights = turn.flights.of(at)
    nodes = turn.streets.ids(turn.starts[at][:, flights.agents])
    for i, which in zip(*(one.tolist() for one in np.nonzero(flights.goes)), strict=True):
        node, xyz = int(nodes[i, which]), flights.xyz[i, which].tolist()
        yield i, int(flights.agents[which]), ResolvedAction(node, (node,), position=tuple(xyz))
