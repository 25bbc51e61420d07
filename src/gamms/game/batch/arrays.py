"""Plays all games of a batch in the core, phase by phase where array functions are called between its phases."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.game.batch.begun import Beginning
from gamms.game.batch.columns import PlayedGame, Roster, decider_of, in_turns
from gamms.game.batch.cursor import Cursor, asked_of, is_plain_rule
from gamms.game.batch.forms import key_of, strategy_spec_of
from gamms.game.batch.given import Given
from gamms.game.batch.in_core import CoreGames
from gamms.game.batch.movement import Movement
from gamms.game.batch.sensing import ContextOfRows, note_sensors
from gamms.game.batch.state import GameArrays
from gamms.game.batch.turn import ArrayTurn
from gamms.game.batch.view import ArrayStrategy, ArrayView
from gamms.game.result import Result
from gamms.game.settings import NamedRule, Plan, as_called
from gamms.ir.game_state import PHASES
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import as_code, shown
from gamms.typing.game import strategy_name


class Group(NamedTuple):
    """Agents that one array function decides for, or those that plain functions decide for."""

    name: str
    agents: IntArray  # numbers in the roster
    form: ArrayStrategy


class Numbers(NamedTuple):
    """What some agents do in a turn of all games.

    Attributes:
        actions: (games, agents of the roster) numbers of legal nodes; those of dead agents do not count.
        is_given: (agents,) which agents take them.
    """

    actions: IntArray
    is_given: BoolArray


class ArrayEngine:
    """Plays the games of a batch in the core.

    A turn is: array rules of the phase "before", array strategies, all that the core plays, and array rules of the
    phase "after" between those of the core.

    Args:
        game: at its start.
        movement: how its agents go.
        seeds: of the games.
        start: the ids of the nodes where agents begin, (games, agents).
        roster: the agents.

    Attributes:
        state: of all games.

    Raises:
        GammsError: a rule or the conflicts cannot be played in the core, or not from where the game is.
    """

    def __init__(
        self, game: PlayedGame, movement: Movement, seeds: Sequence[int], start: IntArray, roster: Roster
    ) -> None:
        self._game = game
        self.state = GameArrays(roster, movement, seeds, movement.streets.rows(start))
        settings = game.settings()
        if settings["team_memory"]:
            self.state.share_memories()
        self._last: int | None = settings["max_turns"]
        self._before = [one for one in as_called(game.rules) if one.phase == "before"]
        self._groups = _groups(roster, settings["plans"])
        rules, asked = as_called(game.rules), asked_of(game, roster)
        calls_each = len(asked) > 0 or any(map(is_plain_rule, rules))
        self._core = CoreGames(game, self.state, is_apart=calls_each)
        self._cursor: Cursor | None = None
        if calls_each:
            has_arrays = len(self._groups) > 0 or any(one.spec.is_array_function for one in rules)
            self._cursor = Cursor(game, self.state, self._core, asked, has_array_functions=has_arrays)
        if self._cursor is not None and asked:
            named = as_code(decider_of(roster.agents[asked[0]], settings["plans"]))
            self._groups.append(Group(named, np.array(asked), self._cursor.decide))
        self._beginning = Beginning(game, self.state)
        note_sensors(self.state, range(len(roster.names)), with_nodes=False)
        self.state.look = ContextOfRows(game, self.state).look
        self._publish_facts(game.facts)
        self._core.begin(np.arange(len(seeds)))

    def _publish_facts(self, facts: Mapping[str, Any]) -> None:
        self.state.facts.update(facts)
        for one in as_called(self._game.rules):
            prepare = one.spec.prepare_arrays
            if prepare is not None:
                prepare(self.state)

    @property
    def functions(self) -> list[Callable[..., object]]:
        """The functions that it calls."""
        rules = [one.spec.array_form for one in as_called(self._game.rules) if one.spec.is_array_function]
        plain = [] if self._cursor is None else self._cursor.functions
        return [*(group.form for group in self._groups), *filter(None, rules), *plain]

    @property
    def calls_each(self) -> bool:
        """Whether plain functions are called game by game."""
        return self._cursor is not None

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that takes back what happens from now on, where plain functions are called."""
        return _keep if self._cursor is None else self._cursor.checkpoint()

    def release(self) -> None:
        """Have the context as it was before plain functions were called."""
        if self._cursor is not None:
            self._cursor.release()

    def leave(self, games: IntArray) -> None:
        """Play these games no more until they start again: another engine plays them."""
        self.state.is_going[games] = False

    def start(self, games: IntArray, seeds: Sequence[int], start: IntArray) -> None:
        """Begin games again, with other seeds, their agents on these nodes, (games, agents)."""
        self.state.reset(games, seeds, self.state.streets.rows(start))
        self._beginning.put(self.state, games)
        self._core.begin(games)
        if self._cursor is not None:
            self._cursor.forget(games)

    @property
    def is_over(self) -> BoolArray:
        """Which games have ended, (games,)."""
        over = ~self.state.is_going
        return over if self._last is None else over | (self.state.turn >= self._last)

    def play(self, turns: int, threads: int) -> int:
        """Play so many turns of the games that are not over; return how many were played at most.

        Only where there are no array functions.
        """
        before = self.state.turn.copy()
        last = before + turns
        self._core.play(last if self._last is None else np.minimum(last, self._last), threads=threads)
        return int((self.state.turn - before).max())

    def phases(
        self, given: Mapping[Hashable, Given], numbers: Numbers | None = None, threads: int = 1
    ) -> Iterator[None]:
        """Play one turn of all games that are not over, and yield between its phases.

        Args:
            given: team -> what its agents do, in place of what their strategies decide.
            numbers: what agents do that follow neither these nor their strategies.
            threads: how many play.

        Raises:
            NotTakenUp: a function asks for what the core does not have.
        """
        state = self.state
        if given and self._before:
            self._decided(np.flatnonzero(~self.is_over), given, [])  # refused before a rule is called
        yield
        for named in self._before:  # a game that one of them ends is over for the others
            self._call(named, np.flatnonzero(~self.is_over))
        games = np.flatnonzero(~self.is_over)
        if not len(games):
            return
        yield
        decided = self._decided(games, given, self._groups, numbers)
        yield
        until = np.zeros_like(state.turn)
        until[games] = state.turn[games] + 1
        self._core.play(until, decided, threads)
        yield
        if self._core.has_functions:
            for named in self._core.play_rules(games):
                self._call(named, games)

    def _decided(
        self,
        games: IntArray,
        given: Mapping[Hashable, Given],
        groups: Sequence[Group],
        numbers: Numbers | None = None,
    ) -> tuple[IntArray, BoolArray] | None:
        """Return the actions of agents that do not decide in the core, (games of the batch, agents), and which do not.

        Args:
            games: that are played.
            given: team -> what its agents do, in place of what their strategies decide.
            groups: of array strategies.
            numbers: see `step`.
        """
        state = self.state
        if not given and not groups and not self._before:
            return numbers
        actions = np.zeros(state.node.shape, np.int64)
        is_given = np.zeros(len(state.roster.names), np.bool_)
        if numbers is not None:
            counts = self._asked(games, np.arange(len(is_given))).counts
            actions[games] = numbers.actions[games]
            actions[games] *= (actions[games] >= 0) & (actions[games] < counts)  # a rule may have moved the agent
            is_given |= numbers.is_given
            self._note_given(games, np.flatnonzero(is_given), actions)
        for team, wanted in given.items():
            agents = state.roster.members(team)
            view = self._asked(games, agents)
            actions[np.ix_(games, agents)] = view._checked(
                wanted.moves_in(view, wanted.moves[games]), f"team {shown(team)}"
            )
            is_given[agents] = True
            self._note_given(games, agents, actions)
        for team, wanted in given.items():
            wanted.act(self._asked(np.arange(len(state)), state.roster.members(team)))
        for group in groups:
            agents = group.agents[~is_given[group.agents]]
            if len(agents):
                view = self._asked(games, agents)
                try:
                    actions[np.ix_(games, agents)] = view._checked(group.form(view), group.name)
                except Exception as error:
                    error.add_note(f"In the strategy {group.name} of a batch, {in_turns(view.turn, view.games)}.")
                    raise
                is_given[agents] = True
        return actions, is_given

    def _note_given(self, games: IntArray, agents: IntArray, actions: IntArray) -> None:
        """Note the actions that agents were given, (games of the batch, agents of the roster)."""
        if self._cursor is not None:
            self._cursor.note_given(ArrayView(self.state, games, agents), actions[np.ix_(games, agents)])

    def _asked(self, games: IntArray, agents: IntArray) -> ArrayView:
        """Return the view of agents that are asked what they do."""
        view = ArrayView(self.state, games, agents)
        view._deeds, view._outboxes = [], []
        view._lock()
        return view

    def _call(self, named: NamedRule, games: IntArray) -> None:
        """Call a rule that is a function for some games."""
        if not len(games):
            return
        form = named.spec.array_form
        if form is None:
            if self._cursor is not None:
                self._cursor.call(named, games)
            return
        turn = ArrayTurn(self.state, games)
        turn.starts, turn.ends, turn.took_part = self._core.last_moves(games)
        turn._lock()
        try:
            form(turn)
        except Exception as error:
            error.add_note(
                f"In the rule {named.name!r} (phase {named.phase!r}) of a batch, {in_turns(turn.turn, turn.games)}."
            )
            raise
        finally:
            turn._close()

    def view(self, agents: IntArray, games: IntArray) -> ArrayView:
        """Return what agents observe in some games."""
        return ArrayView(self.state, games, agents)

    def over(self, game: int) -> dict[str, Any] | None:
        """Return how a game has ended; None: it goes on."""
        known, is_late = self.state.over[game], self._last is not None and self.state.turn[game] >= self._last
        return {"reason": "max_turns", "winner": None, "truncated": True} if known is None and is_late else known

    def scores(self) -> dict[Any, Any]:
        """Return the scores of all games: key -> (games,)."""
        return {key: numbers.copy() for key, numbers in self.state.scores.items()}

    def turns(self) -> IntArray:
        """Return how many turns were played, (games,)."""
        return self.state.turn.copy()

    def result(self, game: int) -> Result:
        """Return the result of a game so far."""
        state, template = self.state, self._game.result()
        nodes, roster = state.streets.ids(state.node[game]).tolist(), state.roster
        agents = {
            name: {
                "team": roster.teams[team],
                "alive": bool(state.alive[game, number]),
                "node": nodes[number],
                **{kind: int(counts[game, number]) for kind, counts in state.counts.items()},
            }
            for number, (name, team) in enumerate(zip(roster.names, roster.team_of.tolist(), strict=True))
            if state.is_there[game, number]
        }
        plans, known = self._game.settings()["plans"], template.provenance["strategies"]
        come = [(name, one) for name, one in zip(roster.names, roster.agents, strict=True) if name in agents]
        strategies = {name: strategy_name(decider_of(one, plans)) for name, one in come if name not in known} | known
        departed = {name: one for name, one in template.agents.items() if name not in self._game.ctx.agent.agents}
        over = self.over(game) or {"reason": "unfinished", "winner": None, "truncated": True}
        return Result(
            turns=int(state.turn[game]),
            scores=state.scores.of(np.array([game]))[0],
            events=[dict(event) for event in state.events.of(game)],
            agents=dict(sorted((departed | agents).items())),
            errors=[dict(error) for error in state.errors[game]],
            deeds=template.deeds,
            collected=template.collected,
            messages=template.messages,
            timings=dict.fromkeys(PHASES, 0.0),
            seed=state.seeds[game],
            provenance=template.provenance | {"strategies": dict(sorted(strategies.items()))},
            **over,
        )


def _keep() -> None:
    """Take nothing back."""


def _groups(roster: Roster, plans: Mapping[Any, Plan]) -> list[Group]:
    """Return the array functions that decide, each with all agents that have the same."""
    found: dict[Hashable, list[int]] = {}
    for number, agent in enumerate(roster.agents):
        spec = strategy_spec_of(decider_of(agent, plans))
        if spec.array_form is not None:
            found.setdefault(key_of(spec.array_form), []).append(number)
    groups = []
    for numbers in found.values():
        decider = decider_of(roster.agents[numbers[0]], plans)
        form = strategy_spec_of(decider).array_form
        assert form is not None  # noqa: S101 - they are array functions
        groups.append(Group(as_code(decider), np.array(numbers), form))
    return groups
