"""The methods of `ctx.game` for rules: queries about the turn, and verbs that change the game."""

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, overload

from gamms.arguments import as_bool, as_ids, as_items, as_key, as_name
from gamms.deciding import Protected, leave_last_turn, refuse_to_judges, refuse_while_deciding
from gamms.errors import BadValue, UnknownName
from gamms.game.deeds import get_fields, list_performed
from gamms.game.facts import get_writable_facts
from gamms.game.movement.moves import list_stays_on_edges, list_stays_on_nodes
from gamms.game.settings import Settings
from gamms.game.snapshots import GameInternals
from gamms.game.turn import TurnEngine
from gamms.ir.agents import AgentBlock, Position
from gamms.ir.game_state import GameState, Scores, join_ends
from gamms.plain import Plain
from gamms.readonly import ReadOnlyMapping, freeze, make_shareable
from gamms.typing.actions import check_node
from gamms.typing.agent_engine import AgentType, IAerialAgent, IAgent
from gamms.typing.game import AerialState, Deed, Move, State, Track, Visit


class RuleVerbs(Settings):
    """The part of a game that rules use.

    Attributes:
        ctx: the context; Any: its class imports this one.
        turn: the number of turns played.
        data: the state of rules, as plain values; `reset` restores it.
        events: the emitted events, in order: dicts with `turn` and `kind`.
        errors: the errors of strategies, in order.
        messages: the messages sent by channels, with their recipients and times; see docs/messages.md.
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
        """Agent -> its numbers of moves, blocked moves, and so on."""
        self._phase.read_moves()
        self._turns.update_counts()
        self._turns.list_counts()
        return self._phase.protect_value(self._state.counts)

    @property
    def scores(self) -> Scores:
        """Scores by team, agent or any other key; a missing key has the score 0."""
        scores = self._state.scores
        return ReadOnlyMapping(Scores(freeze(scores))) if self._phase.is_deciding else scores  # type: ignore[return-value] # it reads like them

    @property
    def is_over(self) -> bool:
        """Whether a rule has ended the game."""
        return self._state.over is not None

    @property
    def over(self) -> dict[str, Any] | None:
        """The reason of the end, the winner, and whether the game was truncated; None while the game goes on."""
        over = self._state.over
        return None if over is None else self._phase.protect_value(dict(over))

    @property
    def agents(self) -> list[IAgent]:
        """The living agents, in the order of names."""
        return self._turns.list_living()

    @property
    def moves(self) -> dict[str, Move]:
        """Agent -> its move in this turn, for agents on the ground; rules must not change it."""
        self._phase.read_moves()
        moves = self._state.moves
        return {} if moves is None else self._phase.protect_value(moves.get_by_name())

    @refuse_while_deciding
    def performed(self, kind: str | None = None) -> list[Deed]:
        """Return the deeds of this turn, in the order of the agents' names.

        Args:
            kind: the name of a deed; None: all deeds.

        Raises:
            UnknownName (KeyError): there is no such deed.
        """
        if kind is not None:
            get_fields(as_key(kind, "A kind of deed"), self.deeds)
        deeds = list_performed(self._state, is_moving=self._turns.is_moving)
        return [deed for deed in deeds if kind in (None, deed.kind)]

    @refuse_while_deciding
    def refuse(self, agent: IAgent | str, why: str, deed: str | None = None) -> None:
        """Refuse the move of an agent in this turn, so that it stays, or one of its deeds; for the `check` of a rule.

        The agent finds the reason in `state["blocked"]`. A refused deed counts as illegal, and is added to `errors`.

        Args:
            agent: the agent, or its name.
            why: the reason; several reasons are joined.
            deed: the deed; None: the move.

        Raises:
            BadValue: no check of a rule is running.
        """
        refusals = self._turns.refusals
        reason = as_name(why, "a reason")
        if refusals is None:
            raise BadValue("ctx.game.refuse is for the check of a rule: rule.check = function(ctx).")
        if deed is not None:
            get_fields(deed, self.deeds)
        refusals.add(self._get_agent(agent).name, reason, deed)

    def tracks(self, agents: Iterable[IAgent | str]) -> list[Track]:
        """Return the track of each agent, or of its name, in this turn: its nodes, with times from 0 to 1.

        An agent that stayed is on its node from time 0 on. An agent that flew, or that a rule has placed since its
        move, is on its node only at time 1.

        Raises:
            UnknownName (KeyError): there is no such agent.
        """
        given = as_items(agents, "agents", "agents or their names")
        found = [one if hasattr(one, "name") else self._get_agent(one) for one in given]
        self._phase.read_moves()
        moves = self._state.moves
        tracks: list[Track] | None = None if moves is None else moves.list_tracks(found)
        return [Track((agent.current_node_id,), (1.0,)) for agent in found] if tracks is None else tracks

    @refuse_while_deciding
    def visits(self, nodes: int | Iterable[int] | None = None, edges: int | Iterable[int] | None = None) -> list[Visit]:
        """Return when living agents on the ground came to nodes, and to edges, in this turn; earliest first.

        An agent that waits on a node visits it until it goes on. A node that an agent has left at once when the turn
        began was visited in the turn before. An agent that a rule has placed visits its node at the end of the turn.
        Of parallel edges, an agent that counts edges is on the one that its action has named, else on the cheapest.

        Args:
            nodes: the id of a node, or several; None: all nodes, or none if edges are given.
            edges: the id of an edge, or several; None: no edges.

        Raises:
            BadType: an id is not an integer.
            UnknownName (KeyError): a node is not on the map.
        """
        wanted_nodes = None if nodes is None else _list_ids(nodes, "nodes")
        wanted_edges = frozenset[int]() if edges is None else _list_ids(edges, "edges")
        if wanted_nodes is None and edges is not None:
            wanted_nodes = frozenset()
        for node in sorted(wanted_nodes or ()):
            check_node(self.ctx.graph.graph, self.ctx.agent.block, node)
        now = self._state.turn + self._turns.is_moving - 1
        walkers = [agent for agent in self.agents if agent.type is not AgentType.AERIAL]
        found = []
        for agent, track in zip(walkers, self.tracks(walkers), strict=True):
            each: list[Any] = [
                (node, None, stay)
                for node, stay in list_stays_on_nodes(track)
                if wanted_nodes is None or node in wanted_nodes
            ]
            if wanted_edges:
                on_edges = list_stays_on_edges(
                    track, partial(self._turns.legality.find_edge, getattr(agent, "mode", None))
                )
                each += [(None, edge, stay) for edge, stay in on_edges if edge in wanted_edges]
            found += [
                Visit(agent.name, agent.team, node, edge, now + since, now + until)
                for node, edge, (since, until) in each
            ]
        return sorted(found, key=lambda visit: (visit.time, visit.until))

    @overload
    def observation(self, agent: IAerialAgent) -> AerialState: ...  # type: ignore[overload-overlap] # as `get_state`
    @overload
    def observation(self, agent: IAgent | str) -> State: ...
    @refuse_while_deciding
    def observation(self, agent: IAgent | str) -> Any:
        """Return the state that the strategy of a living agent, or of its name, would get now.

        Its sensors are called.

        Raises:
            UnknownName (KeyError): there is no such agent, or it is not alive.
        """
        one = self._get_agent(agent)
        self._phase.are_memories_known = True
        order = self._turns.get_order()
        living = self._turns.list_living()
        if not any(agent is one for agent in living):
            raise UnknownName("living agent", one.name, [agent.name for agent in living])
        return self._turns.make_observation(order.slots[order.index_of[one.name]])

    @leave_last_turn
    def emit(self, kind: str, **data: Plain) -> None:
        """Add an event to `events` and the result. Values should be plain.

        Raises:
            BadValue: `data` has the key `turn`, which every event already has.
        """
        if "turn" in data:
            raise BadValue("An event has the turn in which it is emitted: give turn= another name, such as until=.")
        turn = self._state.turn + self._turns.is_moving
        self._state.events.append({"turn": turn, "kind": as_name(kind, "a kind of event"), **data})

    @leave_last_turn
    def end(self, reason: str, winner: Plain = None, truncated: bool = False) -> None:
        """End the game after this turn.

        Several ends in one turn are combined, independent of the order of rules: an end by events in the game takes
        precedence over an end by time (`truncated`), reasons are joined in alphabetical order, and a team wins if all
        agree on it. Between turns, the first end counts.

        Args:
            reason: the reason; several reasons are joined by "; ".
            winner: a team, or any plain value; None: no winner.
            truncated: whether time was up, rather than an event ending the game.
        """
        self._phase.refuse("call ctx.game.end", changes_game=True)
        over = {"reason": as_name(reason, "a reason"), "winner": winner, "truncated": as_bool(truncated, "truncated")}
        if self._state.over is None or self._turns.is_playing:
            self._state.over = join_ends(self._state.over, over)

    @leave_last_turn
    def eliminate(self, agent: IAgent | str) -> None:
        """Eliminate an agent, given by itself or its name; do nothing if it is already eliminated."""
        self._phase.refuse("call ctx.game.eliminate", changes_game=True)
        one = self._get_agent(agent)
        if one.alive:
            self._turns.make_state_of(one.name)
            with self._phase.suspend(changes_world=False):  # its state is made
                one.alive = False
            self.emit("eliminated", agent=one.name, node=one.current_node_id)

    @refuse_to_judges
    def respawn(self, agent: IAgent | str, node: int | None = None) -> None:
        """Place an agent, dead or alive, on a node, as if it had been there before; None: on its start."""
        one: Any = self._get_agent(agent)  # of any kind: its place is of the same
        where = self._internals.find_start(one) if node is None else node
        block: AgentBlock = self.ctx.agent.block
        row = block.find_row(one.name)
        if not block.kind[row]:
            block.put_back(row, check_node(self.ctx.graph.graph, block, where))
        else:
            if isinstance(where, tuple):
                one.position = where
            else:
                one.current_node_id = where
                one.prev_node_id = where
            if not one.alive:
                one.alive = True
        self.emit("respawned", agent=one.name, node=one.current_node_id)

    def start_node(self, agent: IAgent | str) -> int | Position:
        """Return the start node of an agent, or its start position (x, y, z) if it flies."""
        return self._internals.find_start(self._get_agent(agent))

    @property
    def memories(self) -> Mapping[str, dict[Any, Any]]:
        """Agent -> its memory, also of deleted agents that remember something.

        While agents decide, each sees only its own.
        """
        phase = self._phase
        phase.read_moves()
        self._turns.read_memories()
        phase.are_memories_known = True
        memories = self._state.memories
        if phase.is_deciding:
            own: Mapping[str, dict[Any, Any]] = freeze({name: memories.get(name, {}) for name in phase.list_names()})
            return own
        names = self.ctx.agent.agents
        known: dict[str, dict[Any, Any]] = {name: memories.get(name) or self._state.get_memory(name) for name in names}
        known |= {name: memories[name] for name in sorted(memories) if memories[name] and name not in names}
        return known

    @property
    def is_deciding(self) -> bool:
        """Whether agents are observing and deciding now."""
        return self._turns.is_deciding

    @property
    def is_moving(self) -> bool:
        """Whether agents are observing, deciding or moving now."""
        return self._turns.is_moving

    @refuse_while_deciding
    def publish(self, *, to: object = None, **facts: object) -> None:
        """Publish facts to strategies, in `state["facts"]`; they are deeply read-only.

        Args:
            to: a team, an agent or its name: only they get the facts; None: everybody. Facts of an agent override those
                of its team, and these the public ones of the same name.
            facts: name -> value.

        Raises:
            UnknownName (KeyError): there is no such team or agent.
            BadValue: an agent and a team have this name.
            BadType: a fact is mutable.
        """
        made = [(name, make_shareable(name, value)) for name, value in facts.items()]
        get_writable_facts(to, self._state, self.ctx).update(made)

    @refuse_while_deciding
    def facts_of(self, to: object) -> dict[str, Any]:
        """Return the facts that were published only to a team or to an agent."""
        return dict(get_writable_facts(to, self._state, self.ctx))

    def _get_agent(self, agent: IAgent | str) -> IAgent:
        found: IAgent = self.ctx.agent.get_agent(getattr(agent, "name", agent))
        return found


def _list_ids(given: object, name: str) -> frozenset[int]:
    """Return one id, or several."""
    is_several = isinstance(given, Iterable) and not isinstance(given, str)
    return frozenset(as_ids(given if is_several else [given], name))
