"""What array forms of rules get: one turn of all games that are played."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_name, as_numbers_of, as_one_shape
from gamms.errors import BadValue
from gamms.game.batch.columns import once, places_of, put_locked
from gamms.game.batch.deeds import ArrayDeeds
from gamms.game.batch.moves_of_turn import MovesOfTurn
from gamms.game.batch.reports import Look, World, nodes_in_view
from gamms.game.batch.routes import RouteTable
from gamms.game.batch.routes_of_maps import RoutesOfMaps
from gamms.game.batch.state import STOPPED, Arrays, Emitted, NotTakenUp, routes_of
from gamms.ir.game_state import joined_end
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.text import shown

T = TypeVar("T")
ArrayRule = Callable[["ArrayTurn"], None]
"""The array form of a rule; `gamms.array_rule` declares it."""

IN_ARRAYS_ALONE = "is_in_arrays_alone"  # an attribute of rules whose scalar form is made of the array form


class ArrayTurn(MovesOfTurn):
    """One turn of all games that are being played, with the verbs of rules: what the array form of a rule gets.

    Its attributes are those of `MovesOfTurn`.

    Attributes:
        has_scalar_form: whether the rule that has it has one, too.
    """

    has_scalar_form = True

    def emit(
        self,
        kind: str,
        at: IntArray,
        *,
        agents: Mapping[str, IntArray] | None = None,
        nodes: Mapping[str, IntArray] | None = None,
        values: Mapping[str, list[Any]] | None = None,
    ) -> None:
        """Note that something happened, once for each of `at`; of one game in their order.

        Args:
            kind: of the events.
            at: (events,) the games of this turn.
            agents: fields that name agents, by their numbers in the roster.
            nodes: fields that are nodes, by their rows.
            values: other fields, a list of a value for each.

        Raises:
            BadType, BadValue: there is no such game, agent or node, or a field has not one value for each of `at`.
        """
        if not len(at):
            return
        at = self._places(at)
        fields: dict[str, list[Any]] = {}
        for name, given in (agents or {}).items():
            numbers = self._each(name, as_numbers_of(given, name, len(self.roster.names), "agents").tolist(), at)
            fields[name] = [self.roster.names[number] for number in numbers]
            if STOPPED.get(kind) == name:
                np.add.at(self._state.stops, (self.games[at], numbers), 1)
        for name, rows in (nodes or {}).items():
            fields[name] = self._each(name, self.streets.ids(rows).tolist(), at)
        for name, those in (values or {}).items():
            fields[name] = self._each(name, those, at)
        self._note(as_name(kind, "a kind of event"), at, fields)

    def _places(self, at: object) -> IntArray:
        return as_numbers_of(at, "at", len(self.games), "games of this turn")

    def _pairs(self, at: object, agents: object) -> tuple[IntArray, IntArray]:
        """Return the games of this turn and the agents that a verb got, one of each for each."""
        numbers = as_numbers_of(agents, "agents", len(self.roster.names), "agents")
        places = self._places(at)
        if places.shape != numbers.shape:
            places, numbers = as_one_shape({"at": places, "agents": numbers})
        return places, numbers

    def _each(self, name: str, values: object, at: IntArray) -> list[Any]:
        """Return the values of a field as a list, one for each of `at`."""
        listed = values.tolist() if isinstance(values, np.ndarray) else values
        if not isinstance(listed, list | tuple) or len(listed) != len(at):
            raise BadValue(f"{name} has a value for each of {len(at)} in `at`, not {shown(values)}.")
        return list(listed)

    def _note(self, kind: str, at: IntArray, fields: Mapping[str, list[Any]]) -> None:
        """Note events in the logs of their games."""
        self._state.events.add(kind, self.games[at], self.turn[at] + self._is_moving, fields)

    def _note_place(self, kind: str, at: IntArray, agents: IntArray) -> None:
        """Note that agents went out or came back where they are."""
        names, nodes = self.roster.names, self.streets.ids(self.node[at, agents]).tolist()
        self._note(kind, at, {"agent": [names[number] for number in agents.tolist()], "node": nodes})
        np.add.at(self._state.stops, (self.games[at], agents), 1)

    def new_events(self, reader: Hashable) -> list[Emitted]:
        """Return the events of the games of this turn since the last call for a reader, at first all so far.

        Their `games` are numbers in this turn.
        """
        if self._state.has_begun and not self._state.events.is_read_by(reader):
            raise NotTakenUp(f"it is not known which events of the turns before the batch were read by {shown(reader)}")
        number = places_of(self.games, len(self._state))
        later = self._state.is_going & (number < 0) & self._state.roads.are_closed  # they are on other maps
        found = [emitted._replace(games=number[emitted.games]) for emitted in self._state.events.new(reader, later)]
        return [one if (one.games >= 0).all() else one.those(one.games >= 0) for one in found]

    def add_score(self, key: Hashable, at: IntArray, points: float | FloatArray) -> None:
        """Add points to the score of a key, once for each of `at`, in their order: the same, or those of each.

        Raises:
            BadType, BadValue: there is no such game, or these are no points.
        """
        if len(at):
            at = self._places(at)
            if not isinstance(points, int):
                points = as_array(points, "points", "numbers", at.shape)
            self._add_score(key, at, points)

    def _add_score(self, key: Hashable, at: IntArray, points: float | FloatArray) -> None:
        self._state.add_score(key, self.games[at], points)

    def add_scores(self, at: IntArray, agents: IntArray, points: float) -> None:
        """Add points to the scores of the teams of agents.

        Raises:
            BadType, BadValue: there is no such game or agent.
        """
        at, agents = self._pairs(at, agents)
        of = self.roster.team_of[agents]
        for number in np.flatnonzero(np.bincount(of)).tolist():
            self._add_score(self.roster.teams[number], at[of == number], points)

    def scores(self, key: Hashable) -> FloatArray:
        """Return the scores of a key, (games,); 0 where there is none."""
        numbers = self._state.scores.get(key)
        return np.zeros(len(self.games)) if numbers is None else numbers[self.games]

    def end(self, at: IntArray, reason: str | Sequence[str], winner: Sequence[Any], truncated: bool = False) -> None:
        """End games after this turn, as `ctx.game.end` does.

        Args:
            at: (games,) which.
            reason: of all, or of each.
            winner: of each; None: no one has won.
            truncated: whether the time was up.

        Raises:
            BadType, BadValue: there is no such game, or not a reason and a winner for each.
        """
        at = self._places(at)
        reasons = [reason] * len(at) if isinstance(reason, str) else self._each("reason", reason, at)
        for game, why, who in zip(self.games[at].tolist(), reasons, self._each("winner", winner, at), strict=True):
            over = self._state.over
            over[game] = joined_end(over[game], {"reason": why, "winner": who, "truncated": truncated})
        self._state.is_going[self.games[at]] = False

    def eliminate(self, at: IntArray, agents: IntArray) -> None:
        """Take agents out of the game, those that are in it, each with an event.

        Raises:
            BadType, BadValue: there is no such game or agent.
        """
        at, agents = self._pairs(at, agents)
        living = self.alive[at, agents]
        at, agents = once(at[living], agents[living])
        if len(at):
            put_locked(self.alive, (at, agents), values=False)
            self._state.movement.take_out(self.games[at], agents)
            self._note_place("eliminated", at, agents)

    def respawn(self, at: IntArray, agents: IntArray) -> None:
        """Put agents, dead or alive, where they began, each with an event.

        Raises:
            BadType, BadValue: there is no such game or agent.
        """
        at, agents = self._pairs(at, agents)
        if len(at):
            is_first = self.roster.is_first[agents]  # those that have come since began where they are
            games, before = self.games[at], self.node[at, agents]
            begun = np.where(is_first, self._state.start[games, agents], before)
            put_locked(self.node, (at, agents), begun)
            put_locked(self.alive, (at, agents), values=True)
            self._state.movement.clear(games, agents)
            if self._state.flyers is not None:
                self._state.flyers.respawn(games, agents)
            if self._state.headings is not None:
                self._state.headings.put(games, agents, np.where(self.roster.flies[agents], before, begun))
            self._note_place("respawned", at, agents)

    def refuse(self, deeds: ArrayDeeds, why: Sequence[str]) -> None:
        """Refuse these deeds, each for a reason; for the array form of a rule's check."""
        for at, agent, reason in zip(deeds.at.tolist(), deeds.agents.tolist(), why, strict=True):
            self._refused.setdefault((at, agent, deeds.kind), set()).add(reason)

    def note_refusals(self, at: int, agent: int, deeds: Mapping[str, set[str]]) -> None:
        """Refuse deeds of an agent in one game: deed -> why."""
        for kind, why in deeds.items():
            self._refused.setdefault((at, agent, kind), set()).update(why)

    def close_roads(self, at: IntArray, edges: Sequence[int]) -> None:
        """Close the same roads, ids of edges, in each of these games, as `ctx.graph.close_roads` does in one.

        Raises:
            UnknownName (KeyError): there is no such edge in one of them.
            BadValue: the games are played on a device.
        """
        self._change_roads(at, edges, is_open=False)

    def open_roads(self, at: IntArray, edges: Sequence[int]) -> None:
        """Open the same roads, which were closed, in each of these games; see `close_roads`."""
        self._change_roads(at, edges, is_open=True)

    def _change_roads(self, at: IntArray, edges: Sequence[int], *, is_open: bool) -> None:
        change = self._state.change_roads
        if change is None:
            raise BadValue("Roads are opened and closed in arrays of NumPy alone: make the batch without xp=.")
        if len(at) and len(edges):
            change(self.games[self._places(at)], tuple(edges), is_open)

    def in_air(self) -> tuple[IntArray, FloatArray]:
        """Return the numbers of the agents that fly, ascending, and where they are, (games, these, 3)."""
        flyers = self._state.flyers
        if flyers is None:
            return np.zeros(0, np.int64), np.zeros((len(self.games), 0, 3))
        return flyers.agents, flyers.xyz[self.games]

    def nodes_in_view(self, look: Look, at: IntArray, agents: IntArray, nodes: IntArray) -> BoolArray:
        """Return which nodes agents have in view with a sensor that looks from the air or turns with them.

        Args:
            look: of the sensor.
            at: (looks,) the games of this turn.
            agents: (looks,) the numbers of those that look.
            nodes: rows, (nodes,) each once.

        Returns:
            (looks, nodes)
        """
        return nodes_in_view(World(self._state, self.games), look, (at, agents, self.node[at, agents]), nodes)

    def start_of(self, agents: IntArray) -> IntArray:
        """Return where agents began, (games, agents)."""
        return np.where(
            self.roster.is_first[agents], self._state.start[np.ix_(self.games, agents)], self.node[:, agents]
        )

    def stops(self, at: IntArray, agents: IntArray) -> IntArray:
        """Return how often agents were tagged, put back or eliminated so far."""
        return self._state.stops[self.games[at], agents]

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return what a rule remembers of all games of the batch, at first what `make(games)` gives.

        Index its arrays with `games`.
        """
        return self._state.keep(key, make)

    def shared(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what is the same in all games and turns of the batch: what `make()` gives at the first call."""
        known = self._shared
        if key not in known:
            known[key] = make()
        found: T = known[key]
        return found

    def routes(self, weight: str | None = "length") -> RouteTable | RoutesOfMaps:
        """Return how far it is between rows of nodes; `weight` as for `graph.distance`."""
        return routes_of(self._state, self.movement, weight, self.games)

    @property
    def facts(self) -> Mapping[str, Any]:
        """What was published to all, in the form that each rule says."""
        return self._state.facts

    def publish(self, name: str, value: object) -> None:
        """Publish a fact of all games of the batch, which strategies find in `view["facts"]`.

        Raises:
            BadValue: the rule is written in arrays alone, where only a form with a context says what it is in one game.
        """
        if not self.has_scalar_form:
            raise BadValue(
                f"turn.publish of {shown(name)} is for forms of rules that publish it with a context, too: a rule that "
                "is written in arrays alone publishes nothing. Write it with ctx, where it calls ctx.game.publish, and "
                "declare this form beside it: @gamms.array_rule(of=rule)."
            )
        self._state.facts[name] = value

    def draw_bits(self, at: IntArray, names: BitArray, *purpose: str | int) -> BitArray:
        """Return 64 random bits for a purpose, names and this turn, one for each of `at`; see `kernels.draw_bits`."""
        purposes = self._state.purposes(*purpose)[self.games[at]]
        return kernels.draw_bits_rows(purposes, names, self.turn[at])
