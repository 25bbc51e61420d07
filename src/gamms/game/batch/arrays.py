"""Plays all games of a batch at once, in arrays; for games of which every part has an array form."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from gamms.game.batch.arrivals import Arrivals
from gamms.game.batch.asking import Asking
from gamms.game.batch.begun import Beginning, movement_of
from gamms.game.batch.channels import Outbox, Radio
from gamms.game.batch.columns import PlayedGame, Roster, decider_of, in_turns
from gamms.game.batch.deeds import ArrayDeeds, DeclaredDeeds
from gamms.game.batch.delays import DelayedLooks
from gamms.game.batch.flights import Flyers
from gamms.game.batch.game_forms import GameForms
from gamms.game.batch.given import Given
from gamms.game.batch.headings import Headings
from gamms.game.batch.in_core import CoreGames, why_not_in_core
from gamms.game.batch.movement import Moves
from gamms.game.batch.moves_of_turn import (
    TurnPart,
    begin_part,
    close,
    end_moves,
    keep_moves,
    left_of,
    move,
    resume,
    without_refused,
)
from gamms.game.batch.reports import DELAYS
from gamms.game.batch.sight import looks_from_the_air, turns_with_its_agent
from gamms.game.batch.state import GameArrays
from gamms.game.batch.travel import ByMetres
from gamms.game.batch.turn import ArrayRule, ArrayTurn
from gamms.game.batch.view import ArrayView
from gamms.game.deeds import checked_value
from gamms.game.messages import ANTENNA, Scene
from gamms.game.order import left_out
from gamms.game.result import Result
from gamms.game.settings import NamedRule
from gamms.ir.game_state import PHASES
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing.game import strategy_name

_MOST_AT_ONCE = 1 << 17  # agents whose games are played to their ends before others


class ArrayEngine:
    """Plays the games of a batch in arrays; agents begin on the nodes of these ids, `start`, (games, agents).

    Every part of the games has an array form; a form that refuses to go on raises `NotTakenUp`.

    Attributes:
        state: of all games.
        num_played: of the games, the first ones; others wait until these are over.
    """

    def __init__(self, game: PlayedGame, seeds: Sequence[int], start: IntArray, roster: Roster) -> None:
        self._game, movement = game, movement_of(game, roster, may_reopen=True)
        first = movement.streets.rows(start)
        has_space = roster.flies.any() or any(map(looks_from_the_air, roster.agents))
        flyers = Flyers(game, roster, movement.streets, first) if has_space else None
        self.state = GameArrays(roster, movement, seeds, first)
        self.state.flyers = flyers
        settings = game.settings()
        if any(map(turns_with_its_agent, roster.agents)):
            self.state.headings = self._headings_of(roster)
        self.state.shared[DELAYS] = DelayedLooks(self.state, game.internals.state.delayed_looks)
        if settings["team_memory"]:
            self.state.share_memories()
        self.num_played, self._last = len(seeds), settings["max_turns"]
        self._parts: list[IntArray | None] = [None]  # the agents that move at once, one part after the other; None: all
        move_now = np.stack([roster.plays_for(teams) for teams in settings["order"] or [None]])  # (parts, agents)
        self._is_listed = move_now.any(axis=0)
        if len(move_now) > 1:
            self._parts, self.state.part_of = [np.flatnonzero(one) for one in move_now], move_now.argmax(axis=0)
        check, are_open = partial(checked_value, ctx=game.ctx), self.state.roads.are_open
        self.state.deeds = DeclaredDeeds(settings["deeds"], check, roster, movement.streets, len(seeds), are_open)
        if settings["channels"]:
            self.state.radio = Radio(settings["channels"], roster, len(seeds))
        self._arriving = movement if isinstance(movement, ByMetres) and movement.terms.decides_at_arrivals else None
        self._here = GameForms(game, self.state)
        self.state.change_roads = self._change_roads
        self._core = None if why_not_in_core(game, self.state, self._here) else CoreGames(game, self.state)
        self._beginning = Beginning(game, self.state)
        self._publish_facts(game.facts)

    def _headings_of(self, roster: Roster) -> Headings:
        block, streets = self._game.ctx.agent.block, self.state.streets
        rows = [block.row_of(agent.name) for agent in roster.agents]
        turned = [block.heading[row] if is_first else None for row, is_first in zip(rows, roster.is_first, strict=True)]
        fixed = [(np.nan, np.nan) if heading is None else heading for heading in turned]
        nodes = [(block.previous[row], block.node[row]) for row in rows]
        before = [-1 if node == here else int(streets.rows(node)) for node, here in nodes]
        turned_to = np.array(fixed, np.float64).reshape(-1, 2)
        return Headings(self.state.movement, turned_to, np.array(before), self.state.start, self.state.flyers)

    def _change_roads(self, games: IntArray, edges: tuple[int, ...], is_open: bool) -> None:
        """Open or close roads in games, too."""
        state = self.state
        changed = [
            (games[places], state.roads.changed(roads, edges, is_open=is_open))
            for roads, places in state.roads.by_map(games)
        ]
        for those, roads in changed:
            state.put_roads(those, roads)

    def _scene(self, turn: ArrayTurn, radio: Radio) -> Scene:
        """Return where agents are when messages are sent."""
        movement, graph, node, columns = turn._movement, self._game.ctx.graph, turn.node, turn.streets.columns
        ground = graph.graph.ground(columns.node_ids)
        z = np.zeros(node.shape) if ground is None else ground.z[node]
        places = movement.places(node, (np.broadcast_to(turn.games[:, None], node.shape), np.indices(node.shape)[1]))
        xyz = np.concatenate((places.xy, z[..., None]), axis=-1)
        antennas = xyz + ANTENNA
        if self.state.flyers is not None:
            self.state.flyers.put_into(xyz, turn.games)
            self.state.flyers.put_into(antennas, turn.games)

        def is_within(at: IntArray, transmitters: IntArray, hops: int) -> BoolArray:
            games = turn.games[at][:, None]
            return movement.ways(None).distances(node[at, transmitters][:, None], node[at], at=games) <= hops

        return Scene(
            teams=radio.teams,
            keys=turn.roster.keys,
            turns=turn.turn,
            xyz=xyz,
            antennas=antennas,
            alive=turn.alive,
            purposes=lambda *purpose: self.state.purposes(*purpose)[turn.games],
            is_within=is_within,
            visible=graph.visible,
            place_of=lambda node: columns.xy[columns.node_ids == node].tolist(),
        )

    def _publish_facts(self, facts: Mapping[str, Any]) -> None:
        self.state.facts.update(facts)
        for rules in self._here.rules.values():
            for one, _ in rules:
                prepare = one.spec.prepare_arrays
                if prepare is not None:
                    prepare(self.state)

    @property
    def forms(self) -> list[Callable[..., object]]:
        """The array forms that it calls."""
        return self._here.forms

    def start(self, games: IntArray, seeds: Sequence[int], start: IntArray) -> None:
        """Begin games again, with other seeds, their agents on these nodes, (games, agents)."""
        self.state.reset(games, seeds, self.state.streets.rows(start))
        self._beginning.put(self.state, games)
        if self._core is not None:
            self._core.forget()

    @property
    def is_over(self) -> BoolArray:
        """Which games have ended, (games,)."""
        over = ~self.state.is_going
        return over if self._last is None else over | (self.state.turn >= self._last)

    def _playing(self) -> IntArray:
        """Return the games that are not over and are to be played now."""
        is_played = ~self.is_over
        is_played[self.num_played :] = False
        return np.flatnonzero(is_played)

    def play_parts(self, play: Callable[[], object]) -> None:
        """Call a function, which plays a turn, until all games are over: some of them before others."""
        # NOTE: as many as a cache holds: 1.4 times as fast (benchmarks: 32,768 games).
        games = len(self.state)
        num_parts = min(games, -(-games * len(self.state.roster.names) // _MOST_AT_ONCE))
        try:
            for part in range(1, num_parts + 1):
                self.num_played = part * games // num_parts
                while not self.is_over[: self.num_played].all():
                    play()
        finally:
            self.num_played = games

    @property
    def is_in_core(self) -> bool:
        """Whether the core plays the games."""
        if self._core is not None and not self._core.can_play():
            self._core = None
        return self._core is not None

    def play_in_core(self, turns: int, threads: int) -> int:
        """Let the core play so many turns of the games that are not over; return how many were played at most."""
        assert self._core is not None  # noqa: S101 - `is_in_core` says so
        before = self.state.turn.copy()
        last = before + turns
        self._core.play(last if self._last is None else np.minimum(last, self._last), threads=threads)
        return int((self.state.turn - before).max())

    def _step_in_core(self, given: Mapping[Hashable, Given]) -> bool:
        """Let the core play a turn; return whether it does."""
        if (
            not self.is_in_core
            or self._core is None
            or any(one.deeds or one.messages or one.flights is not None for one in given.values())
        ):
            return False
        playing, until = self._playing(), np.zeros_like(self.state.turn)
        until[playing] = self.state.turn[playing] + 1
        if not given or not len(playing):
            self._core.play(until)
            return True
        actions = np.zeros(self.state.node.shape, np.int64)
        asking = Asking(self.state, self._here, given, at_arrivals=False)
        actions[playing], is_given = asking.given(ArrayTurn(self.state, playing))
        self._core.play(until, (actions, is_given))
        return True

    def step(self, given: Mapping[Hashable, Given]) -> None:
        """Play one turn of all games that are not over.

        Raises:
            NotTakenUp: a form lacks what it keeps of earlier turns.
        """
        if self._step_in_core(given):
            return
        state, before = self.state, self._here.rules["before"]
        if given and (before or state.roads.are_closed):
            self._check(given)
        for named, form in before:  # a game that one of them ends is over for the others
            if len(playing := self._playing()):
                turn = ArrayTurn(state, playing)
                resume(turn)
                self._call(named, form, turn)
                close(turn)
        state.last_deeds = []
        if given and (before or state.roads.are_closed):
            self._check(given)  # again, by the roads that these rules have closed
        if len(playing := self._playing()):
            self._play_turn(ArrayTurn(state, playing), given)
        state.now.clear()
        if state.radio is not None:
            state.radio.end_turn()

    def _check(self, given: Mapping[Hashable, Given]) -> None:
        """Refuse what cannot be done in one of the games, before rules are called and others are played."""
        if len(playing := self._playing()):
            asking = Asking(self.state, self._here, given, at_arrivals=self._arriving is not None)
            asking.check(ArrayTurn(self.state, playing), self._resting(playing))

    def _resting(self, games: IntArray) -> BoolArray | None:
        """Return which agents are not on their way where they decide at arrivals, (games, agents); else None."""
        return None if self._arriving is None else ~self._arriving.is_going(games)

    def _play_turn(self, turn: ArrayTurn, given: Mapping[Hashable, Given]) -> None:
        """Play one turn of games whose rules of the phase "before" were applied."""
        state, asking = self.state, Asking(self.state, self._here, given, at_arrivals=self._arriving is not None)
        state.placed[turn.games] = False
        actions, is_given = asking.given(turn, self._resting(turn.games))
        self._refuse_left_out(turn)
        for number, members in enumerate(self._parts):
            is_going = state.is_going[turn.games]
            if number and not is_going.all():  # rules have ended some
                self._finish(turn._of(~is_going), asking.outboxes)
                turn = turn._of(is_going)
                if not len(turn.games):
                    break
            part, is_member = None, np.ones(len(is_given), np.bool_)
            if members is not None:
                is_member = np.isin(np.arange(len(is_given)), members)
                part = TurnPart(number, len(self._parts), members)
            asked, course = turn.alive & is_member, None
            self._leave_closed_edges(turn, asked)
            if self._arriving is not None:
                course = self._course(turn, self._arriving, asked)
                asked = asked & ~self._arriving.is_going(turn.games)
            if part is not None:  # what is legal for those that move now follows from the parts before
                actions, is_given = asking.given(turn, asked)
            chosen, deeds = asking.ask(turn, actions, is_given | ~is_member, asked)
            flights, lost = asking.flights, asking.lost
            if course is None:
                moves, in_conflict = turn._movement.moves(turn.node, chosen, turn.games), None
                asking.note(turn, moves.illegal)
            else:
                moves = course.play(chosen, asking.at_arrivals, partial(asking.note, turn))
                in_conflict = course.blocked
            moves = moves._replace(flights=flights)
            illegal = {(one.at, one.agent) for one in [*lost, *(moves if course is None else course).illegal]}
            self._play_part(turn, moves, in_conflict, [one.without(illegal) for one in deeds], part)
        if len(turn.games):
            self._finish(turn, asking.outboxes)

    def _refuse_left_out(self, turn: ArrayTurn) -> None:
        """Refuse to play a turn of games in which agents live that are in no part of it."""
        for at, agent in np.argwhere(turn.alive & ~self._is_listed)[:1].tolist():
            roster, game = turn.roster, int(turn.games[at])
            error = left_out(roster.names[agent], roster.teams[roster.team_of[agent]])
            error.add_note(f"In game {game} of a batch, with the seed {self.state.seeds[game]}.")
            raise error

    def _leave_closed_edges(self, turn: ArrayTurn, asked: BoolArray) -> None:
        """Put agents, (games, agents), whose edges were closed on the nodes that they had passed last."""
        state, by = self.state, self.state.movement
        if state.roads.are_all_open or not len(by.edge):
            return
        which = turn.games[:, None], np.arange(by.edge.shape[1])
        at, agents = np.nonzero(asked & (by.edge[which] >= 0) & (by.on_edge(which) < 0))
        by.clear(turn.games[at], agents)
        state.now.clear()

    def _course(self, turn: ArrayTurn, by: ByMetres, members: BoolArray) -> Arrivals:
        """Return the course of a turn in which agents decide at arrivals."""
        stops = self._here.conflicts
        if stops is None:
            return Arrivals(self.state, turn, by, members, None)

        def resolve(part: ArrayTurn, ends: IntArray) -> BoolArray:
            stopped: BoolArray = stops(part, ends) & (ends != part._origins)
            return stopped

        return Arrivals(self.state, turn, by, members, resolve)

    def _finish(self, turn: ArrayTurn, outboxes: Sequence[Outbox]) -> None:
        """Send what is to be sent in a turn in which all have moved, and apply its rules."""
        state = self.state
        if outboxes and state.radio is not None:
            state.radio.send(turn.games, self._scene(turn, state.radio), outboxes)
        end_moves(turn)
        if self._here.rules["before"]:
            keep_moves(turn)
        try:
            for named, form in self._here.rules["after"]:
                self._call(named, form, turn)
        finally:  # the agents have moved: the turn is played, without the rules that follow
            close(turn)

    def _play_part(
        self,
        turn: ArrayTurn,
        moves: Moves,
        in_conflict: BoolArray | None,
        deeds: list[ArrayDeeds],
        part: TurnPart | None,
    ) -> None:
        """Let some agents do and move at once what they have decided; None: all.

        Args:
            turn: of the games.
            moves: of all agents; those that do not move now stay.
            in_conflict: which agents conflicts have stopped; None: that is to be found.
            deeds: that they do.
            part: of the turn, by the order of play; None: all move at once.
        """
        turn.paths = moves.paths
        if self._here.checks or deeds or self._here.rules["deeds"]:
            begin_part(turn, moves, deeds)
            is_refused = np.zeros(moves.ends.shape, np.bool_)
            for name, check in self._here.checks:
                is_refused |= self._here.stopped(name, check, turn, moves.ends) & moves.acts
            moves = without_refused(turn, moves, is_refused)
            changes = self.state.roads.changes[turn.games]
            for named, form in self._here.rules["deeds"]:
                self._call(named, form, turn)
            moves = left_of(turn, moves, changes)
        stops = self._here.conflicts
        if in_conflict is None and stops is not None:
            turn._origins, ends = self.state.movement.ends(moves)
            in_conflict = self._here.stopped("the conflicts", stops, turn, ends) & moves.goes
            moves = moves.without(in_conflict)
        move(turn, moves, in_conflict, part)

    def _call(self, named: NamedRule, form: ArrayRule, turn: ArrayTurn) -> None:
        turn._may_publish = not named.spec.is_in_arrays_alone
        turn._lock()
        try:
            self._here.play(named, form, turn)
        except Exception as error:
            error.add_note(
                f"In the rule {named.name!r} (phase {named.phase!r}) of a batch, {in_turns(turn.turn, turn.games)}."
            )
            raise

    def view(self, agents: IntArray) -> ArrayView:
        """Return what agents observe, in all games."""
        return ArrayView(self.state, np.arange(len(self.state)), agents)

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
            deeds=[dict(deed) for deed in state.deeds.of(game)],
            collected=template.collected,
            messages=[] if state.radio is None else [dict(one) for one in state.radio.of(game)],
            timings=dict.fromkeys(PHASES, 0.0),
            seed=state.seeds[game],
            provenance=template.provenance | {"strategies": dict(sorted(strategies.items()))},
            **over,
        )
