"""What rules call on `ctx.game`: what happened in this turn, and the verbs that change the game."""

from collections.abc import Iterable, Mapping
from typing import Any, overload

from gamms.arguments import as_bool, as_key, as_name
from gamms.deciding import Protected, refused_while_deciding
from gamms.errors import BadValue, UnknownName
from gamms.game.facts import facts_to
from gamms.game.settings import Settings
from gamms.game.snapshots import GameInternals
from gamms.game.turn import TurnEngine
from gamms.ir.agents import Position
from gamms.ir.game_state import GameState, Scores, joined_end
from gamms.plain import Plain
from gamms.readonly import ReadOnlyMapping, frozen, published
from gamms.typing.agent_engine import IAerialAgent, IAgent
from gamms.typing.game import AerialState, Deed, Move, State, Track


class RuleVerbs(Settings):
    """The part of a game that rules use.

    Attributes:
        ctx: the context; Any: its own class, which knows this one.
        turn: how many turns were played.
        data: what rules remember, as plain values; `reset` restores it.
        events: what was emitted, in order: dicts with `turn` and `kind`.
        errors: what strategies did wrong, in order.
        messages: what was sent by channels and who hears it when, in order; see docs/messages.md.
    """

    ctx: Any
    _state: GameState
    _turns: TurnEngine
    _internals: GameInternals

    turn: Protected[int] = Protected(int, "_state")
    data: Protected[dict[str, Any]] = Protected(dict, "_state")
    events: Protected[list[dict[str, Any]]] = Protected(list, "_state")
    errors: Protected[list[dict[str, Any]]] = Protected(list, "_state")
    messages: Protected[list[dict[str, Any]]] = Protected(list, "_state")
    team_memories: Protected[dict[Any, dict[Any, Any]]] = Protected(dict, "_state")
    timings: Protected[dict[str, float]] = Protected(dict, "_state")

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """Agent -> how often it moved, was blocked, and so on, up to the last snapshot or result."""
        self._turns.list_counts()
        return self._phase.shown(self._state.counts)

    @property
    def scores(self) -> Scores:
        """Numbers by team, agent or any other key; one that was not set is 0."""
        scores = self._state.scores
        return scores if self._phase.agent is None else ReadOnlyMapping(Scores(frozen(scores)))  # type: ignore[return-value] # it reads like them

    @property
    def is_over(self) -> bool:
        """Whether a rule has ended the game."""
        return self._state.over is not None

    @property
    def over(self) -> dict[str, Any] | None:
        """The reason of the end, the winner, and whether time was up; None while the game goes on."""
        over = self._state.over
        return None if over is None else self._phase.shown(dict(over))

    @property
    def agents(self) -> list[IAgent]:
        """The living agents, in the order of their names."""
        return self._turns.living()

    @property
    def moves(self) -> dict[str, Move]:
        """How the agents on the ground moved in this turn, by name; rules must not change it."""
        moves = self._state.moves
        return {} if moves is None else self._phase.shown(moves.by_name())

    @refused_while_deciding
    def performed(self, kind: str | None = None) -> list[Deed]:
        """Return what agents do in this turn besides moving, in the order of their names.

        Args:
            kind: of deed; None: all.

        Raises:
            UnknownName (KeyError): there is no such deed.
        """
        if kind is not None and as_key(kind, "A kind of deed") not in self.deeds:
            raise UnknownName("deed", kind, self.deeds)
        moves = self._state.moves
        deeds: list[Deed] = [] if moves is None else moves.deeds
        return [deed for deed in deeds if kind in (None, deed.kind)]

    @refused_while_deciding
    def refuse(self, agent: IAgent | str, why: str, deed: str | None = None) -> None:
        """Refuse the move of an agent in this turn, so that it stays, or one of its deeds; for the `check` of a rule.

        The agent finds the reason in `state["blocked"]`. A refused deed counts as illegal, and is in `errors`.

        Args:
            agent: the agent, or its name.
            why: the reason; of several all are named.
            deed: the deed; None: the move.

        Raises:
            BadValue: nothing can be refused now.
        """
        refusals, reason = self._turns.refusals, as_name(why, "a reason")
        if refusals is None:
            raise BadValue("ctx.game.refuse is for the check of a rule: rule.check = function(ctx).")
        if deed is not None and deed not in self.deeds:
            raise UnknownName("deed", deed, self.deeds)
        refusals.add(self._agent(agent).name, reason, deed)

    def tracks(self, agents: Iterable[IAgent]) -> list[Track]:
        """Return how agents have moved in this turn: for each, the nodes and from 0 to 1 when it was at each.

        An agent that stayed is at its node from 0 on. An agent that flew, or that a rule has put on its node since it
        moved, is there only at 1.
        """
        moves = self._state.moves
        tracks: list[Track] | None = None if moves is None else moves.tracks(agents)
        return [Track((agent.current_node_id,), (1.0,)) for agent in agents] if tracks is None else tracks

    @overload
    def observation(self, agent: IAerialAgent) -> AerialState: ...  # type: ignore[overload-overlap] # as `get_state`
    @overload
    def observation(self, agent: IAgent | str) -> State: ...
    @refused_while_deciding
    def observation(self, agent: IAgent | str) -> Any:
        """Return the state that the strategy of a living agent, or of the one of that name, would get now.

        Its sensors are asked for it.

        Raises:
            UnknownName (KeyError): there is no such agent, or it is out of the game.
        """
        one = self._agent(agent)
        slots = self._turns.order().slots
        for slot in slots:
            if slot.agent is one:
                return self._turns.observation(slot)
        raise UnknownName("living agent", one.name, [slot.name for slot in slots])

    @refused_while_deciding
    def emit(self, kind: str, **data: Plain) -> None:
        """Note that something happened; it is in `events` and in the result. Values should be plain.

        Raises:
            BadValue: `data` has a turn, which an event has in any case.
        """
        if "turn" in data:
            raise BadValue("An event has the turn in which it is emitted: give turn= another name, such as until=.")
        turn = self._state.turn + self._turns.is_moving
        self._state.events.append({"turn": turn, "kind": as_name(kind, "a kind of event"), **data})

    @refused_while_deciding
    def end(self, reason: str, winner: Plain = None, truncated: bool = False) -> None:
        """End the game after this turn.

        Several ends in one turn count as one, in whichever order the rules are called: an end by what happened goes
        before one by time (`truncated`), reasons are named in alphabetical order, and a team wins if all agree on it.
        Between turns, the first end counts.

        Args:
            reason: of the end; reasons of one turn are joined by "; ".
            winner: a team, or anything plain; None: no one has won.
            truncated: whether the time was up, rather than that something ended the game.
        """
        over = {"reason": as_name(reason, "a reason"), "winner": winner, "truncated": as_bool(truncated, "truncated")}
        if self._state.over is None or self._turns.is_playing:
            self._state.over = joined_end(self._state.over, over)

    @refused_while_deciding
    def eliminate(self, agent: IAgent | str) -> None:
        """Take an agent, or the one of that name, out of the game; nothing happens if it is out already."""
        one = self._agent(agent)
        if one.alive:
            one.alive = False
            self.emit("eliminated", agent=one.name, node=one.current_node_id)

    @refused_while_deciding
    def respawn(self, agent: IAgent | str, node: int | None = None) -> None:
        """Put an agent, dead or alive, on a node, as if it had always been there; None: where it began."""
        one: Any = self._agent(agent)  # of any kind: its place is of the same
        where = self._internals.start_of(one) if node is None else node
        if isinstance(where, tuple):
            one.position = where
        else:
            one.current_node_id = where
            one.prev_node_id = where
        if not one.alive:
            one.alive = True
        self.emit("respawned", agent=one.name, node=one.current_node_id)

    def start_node(self, agent: IAgent | str) -> int | Position:
        """Return the node that an agent began on, or (x, y, z) of one that flies."""
        return self._internals.start_of(self._agent(agent))

    @property
    def memories(self) -> Mapping[str, dict[Any, Any]]:
        """Agent -> what it remembers. While agents decide, each sees only its own."""
        phase, memories = self._phase, self._state.memories
        return memories if phase.agent is None else frozen({name: memories.get(name, {}) for name in phase.names()})

    @property
    def is_deciding(self) -> bool:
        """Whether agents observe and decide right now."""
        return self._turns.is_deciding

    @property
    def is_moving(self) -> bool:
        """Whether agents observe, decide and move right now."""
        return self._turns.is_moving

    @refused_while_deciding
    def publish(self, *, to: object = None, **facts: object) -> None:
        """Publish facts to strategies: they are in `state["facts"]`, read-only all the way down.

        Args:
            to: a team, an agent or its name: only they learn of it. Of facts of one name an agent has its own, else
                that of its team, else that of all. None: all.
            facts: by name.

        Raises:
            UnknownName (KeyError): there is no such team or agent.
            BadValue: an agent and a team have this name.
            BadType: a fact may change.
        """
        made = [(name, published(name, value)) for name, value in facts.items()]
        facts_to(to, self._state, self.ctx).update(made)

    @refused_while_deciding
    def facts_of(self, to: object) -> dict[str, Any]:
        """Return what was published to a team, or to an agent, alone."""
        return dict(facts_to(to, self._state, self.ctx))

    def _agent(self, agent: IAgent | str) -> IAgent:
        found: IAgent = self.ctx.agent.get_agent(getattr(agent, "name", agent))
        return found
