"""Collect the decisions of one turn from strategies, plans and awaitables."""

from collections.abc import Awaitable, Callable, Hashable, Mapping, Sequence
from functools import cached_property, partial
from itertools import chain
from operator import itemgetter
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_edges, as_known
from gamms.core.copies import copy_deep
from gamms.core.turn import Answers
from gamms.deciding import DecidePhase
from gamms.errors import BadType, BadValue, GammsError
from gamms.game.facts import KnownFacts
from gamms.game.hints import explain_strategy_error
from gamms.game.movement.legality import IllegalAction, Legality
from gamms.game.movement.streets import LegalNodes, as_table
from gamms.game.movement.travel import GamePaths
from gamms.game.order import DECIDED_OUTSIDE, PlannedAgents
from gamms.game.random_streams import ArrayDraws
from gamms.game.settings import Settings
from gamms.game.slots import AgentSlot
from gamms.game.team_memory import Memory, find_copy_problem, merge_memory
from gamms.ir.agents import as_ids
from gamms.ir.columns import copy_column
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray, RowArray
from gamms.readonly import copy_locked
from gamms.text import shown
from gamms.typing.game import State as AgentState

if TYPE_CHECKING:
    from gamms.game.awaiting import EventLoop

State = dict[str, Any]  # of an agent

_REASONS = {"error": "its strategy or plan raised an error", "overrun": "its strategy or plan took too long"}
COUNT_OF = {"error": "errors", "overrun": "overruns"}  # kind of error -> name of its count


def _refuse_edges() -> list[tuple[int, ...]]:
    """Refuse to list legal edges in a copy.

    Raises:
        BadValue: always.
    """
    raise BadValue("A copy of what a plan is given has legal_edges only if they were read before it was copied.")


class TeamArrays:
    """The argument of a plan of arrays: the living agents of its team, in the order of names; arrays are read-only.

    Attributes:
        team: the team.
        turn: the number of turns played before this one.
        names: the names of the agents.
        facts: the published facts; read-only.
        team_memory: a copy of the team's memory; changes take effect in the next turn.
        draw: random numbers, one for each agent per call.
    """

    def __init__(
        self,
        commanded: PlannedAgents,
        turn: int,
        seed: int,
        nodes: IntArray,
        legal: LegalNodes | None,
        facts: Mapping[str, Any],
        team_memory: dict[Any, Any],
        list_edges: Callable[[], list[tuple[int, ...]]],
    ) -> None:
        self._list_edges = list_edges
        self.team: Any = commanded.team  # programs look it up in dicts of their own
        self.turn = turn
        self.names = commanded.deciders.names
        self._legal = legal
        self._nodes = nodes
        self._chosen: IntArray | None = None
        self.facts = facts
        self.team_memory = team_memory
        self.draw = ArrayDraws(partial(commanded.draw_keys, seed), np.array([turn]))
        self._seed = seed

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_list_edges": _refuse_edges}  # the game, which lists them, is not copied

    @cached_property
    def nodes(self) -> IntArray:
        """(agents,) the node id of each agent."""
        return copy_locked(self._nodes.astype(np.int64))

    @cached_property
    def legal_edges(self) -> IntArray:
        """(agents, most) the ids of the edges that each agent may take, ascending, padded with -1."""
        each = self._list_edges()
        at = np.repeat(np.arange(len(each)), [*map(len, each)])
        return copy_locked(as_table(at, np.array([*chain.from_iterable(each)], np.int64), len(each)))

    @property
    def offsets(self) -> IntArray | None:
        """(agents + 1,): the targets of agent `i` are `targets[offsets[i]:offsets[i + 1]]`; None: any node is legal."""
        return None if self._legal is None else self._legal.ragged[0]

    @property
    def targets(self) -> IntArray | None:
        """(legal,) node ids, the agent's own node first for each agent; None: all nodes of the graph are legal."""
        return None if self._legal is None else self._legal.ragged[1]

    @property
    def counts(self) -> RowArray:
        """(agents,) the number of legal nodes of each agent, including its own.

        Raises:
            BadValue: every node of the graph is legal.
        """
        return self._list_legal_nodes().counts

    def choose(self, actions: object) -> IntArray:
        """Return the nodes that actions lead to, (agents,); action k is the k-th legal node, and 0 the agent's own.

        A plan that returns this array unchanged skips the check of legality.

        Raises:
            BadType, BadValue: the actions are not numbers of legal nodes, (agents,).
        """
        legal = self._list_legal_nodes()
        numbers = np.asarray(actions)
        if numbers.dtype.kind not in "iu" or numbers.shape != self._nodes.shape:
            raise BadType(f"Actions are an array ({len(self.names)},) of integers, not {shown(actions)}.")
        is_number = numbers < legal.counts
        if not is_number.all() or numbers.min(initial=0) < 0:
            bad = np.flatnonzero(~is_number | (numbers < 0))
            raise BadValue(
                f"Action {int(numbers[bad[0]])} of agent {self.names[bad[0]]!r} is not the number of one of its "
                f"{int(legal.counts[bad[0]])} legal nodes."
            )
        self._chosen = legal.step(numbers).view()
        self._chosen.setflags(write=False)
        return self._chosen

    def take_chosen(self, nodes: object) -> Any:
        """Return the writable array behind `choose`; None if `nodes` is another array."""
        return self._chosen.base if nodes is self._chosen and self._chosen is not None else None

    def _list_legal_nodes(self) -> LegalNodes:
        if self._legal is None:
            raise BadValue("Every node of the graph is legal, so none has a number: return ids of nodes.")
        return self._legal

    @cached_property
    def rng(self) -> np.random.Generator:
        """A NumPy generator for the team and the turn."""
        return kernels.stream(self._seed, "team", str(self.team), self.turn)

    def checked(self, answer: object) -> IntArray:
        """Return the nodes that a plan has chosen, (agents,), as integers.

        Raises:
            BadType: they are not integers.
            BadValue: the number of nodes is not the number of agents.
        """
        try:
            nodes = np.asarray(answer)
        except ValueError:  # rows of several lengths
            nodes = np.asarray(None)
        if nodes.dtype.kind not in "iu" and nodes.size:
            raise BadType(f"A plan of arrays returns the ids of {len(self.names)} nodes, not {shown(answer)}.")
        if nodes.shape != self._nodes.shape:
            raise BadValue(
                f"A plan of arrays returns one node for each agent, an array ({len(self.names)},), "
                f"not one of the shape {nodes.shape}."
            )
        return nodes if nodes is self._chosen else nodes.astype(np.int64, copy=False)

    def checked_edges(self, answer: Mapping[str, Any]) -> IntArray:
        """Return the edges that a plan has chosen in a dict, (agents,), with -1 for agents that go to nodes.

        Raises:
            UnknownName (KeyError): the dict has another key than "nodes" and "edges".
            BadType, BadValue: the edges are not integers from -1, (agents,).
        """
        for key in answer:
            as_known(key, "key of the answer of a plan of arrays", ("nodes", "edges"))
        shape = self._nodes.shape
        return as_edges(answer.get("edges", np.full(shape, -1)), "The edges of a plan", shape)

    def is_legal(self, nodes: IntArray) -> "np.ndarray[Any, np.dtype[np.bool_]]":
        """Return which nodes are known to be legal, (agents,)."""
        if self.offsets is None:
            return np.zeros(len(nodes), np.bool_)
        matches = self.targets == np.repeat(nodes, np.diff(self.offsets))
        return np.logical_or.reduceat(matches, self.offsets[:-1])


ArrayPlan = Callable[[TeamArrays], Any]
"""Decides for a team in arrays: returns node ids, (agents,), or a dict of `"nodes"` and `"edges"`.

Edges are ids, (agents,), of edges that agents take instead of going to nodes, and -1. Any: anything that NumPy converts
to an array, such a dict, or an awaitable of it.
"""


class _Question(NamedTuple):
    """A strategy or a plan, with its argument."""

    decider: Any  # the agent, or `Deciders`
    name: str  # such as "plan of team 'red'"
    function: Callable[[Any], Any]
    given: Any  # a state; of a plan, its states by name, or `TeamArrays`
    indices: Sequence[int]  # of the slots that it decides for
    is_plan: bool
    are_plain: bool = False  # whether the agents of a plan move along one edge, on the ground

    def list_states(self) -> list[Any]:
        """Return the state of each of its agents; None: a plan of arrays, or one that has put another value there."""
        if isinstance(self.given, TeamArrays):
            return [None] * len(self.indices)
        if not self.is_plan:
            return [self.given]
        found = map(self.given.get, self.decider.names)
        return [state if isinstance(state, dict) else None for state in found]

    def find_hint(self, error: BaseException) -> str:
        """Return what the strategy or plan that has raised an error probably meant."""
        plan = self.given if self.is_plan and isinstance(self.given, dict) else None
        return explain_strategy_error(error, [state for state in self.list_states() if state is not None], plan)


class Decisions(Answers):
    """The decisions of one part of a turn; call `begin` first.

    Args:
        settings: the settings of the game.
        state: the state of the game.
        phase: the phase of the context.
        legality: resolves actions to moves.
        observe: returns the current state of an agent.
        sense: calls the sensors of an agent.

    Attributes:
        observe, sense, state: see the arguments.
        slots: the slots of all agents.
        starts: the node of each agent, by slot.
        ends: the node that each agent moves to, by slot, as a view of an array; see `get_writable_ends`.
        actions: slot -> its action, if it flies, turns or does deeds; a new dict for each part.
        paths: the paths of agents that do more than to move along one edge; None: there are none.
        awaited: awaitables to collect.
        written: (slot, changed copy of the team memory) of each agent that changed it.
        failures: (slot, kind, message) of each failure; `close` publishes `written` and `failures` after all decisions.
        moves: the starts and ends as arrays of the core; None: use `starts` and `ends`.
    """

    make = AgentState  # makes a state from a template

    __slots__ = ("_legality", "_phase", "_settings", "observe", "sense")

    def __init__(
        self,
        settings: Settings,
        state: GameState,
        phase: DecidePhase,
        legality: Legality,
        observe: Callable[[AgentSlot], State],
        sense: Callable[[AgentSlot], dict[str, Any]],
    ) -> None:
        self._settings = settings
        self.state = state
        self._phase = phase
        self._legality = legality
        self.observe = observe
        self.sense = sense
        self.forget()
        self.begin([], as_ids([]), None, None)

    def get_writable_ends(self) -> Any:
        """Return `ends`, copied from `starts` if it is still the same object."""
        if self.ends is self.starts:
            self.ends = copy_column(self.starts)
        return self.ends

    # -- questions ----------------------------------------------------------------------------------------------

    def ask(self, i: int, state: State | None) -> None:
        """Call the strategy of an agent of any kind with a state; None: the agent observes now."""
        slot = self.slots[i]
        self._phase.agent = None
        if state is None:
            state = self.observe(slot)
        slot.last[0] = state
        if slot.agent.strategy is not None:
            self._put(self._make_question(i, state))

    def ask_plan(self, commanded: PlannedAgents, states: list[State]) -> None:
        """Call the plan of a team with the states of its agents."""
        slots = [self.slots[i] for i in commanded.indices]
        for slot, state in zip(slots, states, strict=True):
            slot.last[0] = state
        if commanded.plan is DECIDED_OUTSIDE:
            return
        self._put_plan(commanded, {slot.name: state for slot, state in zip(slots, states, strict=True)})

    def ask_arrays(self, commanded: PlannedAgents, seed: int) -> None:
        """Call the plan of a team with arrays.

        Raises:
            BadType: an agent of the team flies.
        """
        indices = commanded.indices
        is_all = len(commanded.indices) == len(self.slots)
        flying = [] if commanded.are_plain else [i for i in indices if self.slots[i].flies]
        if flying:
            raise BadType(
                f"The plan of team {shown(commanded.team)} decides in arrays, and agent "
                f"{self.slots[flying[0]].name!r} flies. Use command(team, plan) with a plan of states."
            )
        nodes: IntArray = np.asarray(self.starts)[... if is_all else indices]
        legal: LegalNodes | None = None
        if commanded.are_plain:
            legal = LegalNodes.from_streets(self._legality.streets, nodes)
        elif self._settings.legal != "any":
            slots = [self.slots[i] for i in indices]
            legal = LegalNodes(*self._legality.list_reachable_each(slots, nodes.tolist()))
        facts = KnownFacts(self.state, commanded.team, None)
        memory = self.get_team_memory(commanded.team)

        def list_edges() -> list[tuple[int, ...]]:
            with self._phase.suspend(changes_world=False):
                each = zip(indices, nodes.tolist(), strict=True)
                return [self._legality.list_edges(self.slots[i], here) for i, here in each]

        given = TeamArrays(commanded, self.state.turn, seed, nodes, legal, facts, memory, list_edges)
        self._put_plan(commanded, given)

    def get_team_memory(self, team: Hashable) -> Memory:
        """Return a writable copy of a team's memory."""
        memory: Memory = copy_deep(self.state.team_memories.get(team, {}))
        return memory

    def wait_for(self, i: int, state: State, awaitable: Awaitable[object]) -> None:
        """Store the awaitable that an agent's strategy has returned."""
        self.awaited.append((self._make_question(i, state), awaitable))

    def collect(self, loop: "EventLoop") -> None:
        """Await all stored awaitables, and process the results in the order of names."""
        awaited = self.awaited
        self.awaited = []
        deadline = self._settings.deadline_s
        pairs = [(question.decider, awaitable) for question, awaitable in awaited]
        outcomes = loop.collect(self._phase, pairs, deadline, strict=self._settings.on_error == "raise")
        for (question, _), (_, error, _) in zip(awaited, outcomes, strict=True):
            if error is not None and self._settings.on_error == "raise":
                self._fail(question, error)
        for (question, _), (value, error, is_late) in zip(awaited, outcomes, strict=True):
            if error is not None:
                self._fail(question, error)
            elif is_late:
                self._use_default_action(question, "overrun", f"was cancelled after {deadline} s")
            else:
                self._answer(question, value)

    def drop(self) -> None:
        """Close awaitables that will not be collected."""
        for _, awaitable in self.awaited:
            getattr(awaitable, "close", bool)()

    @property
    def failed(self) -> set[int]:
        """The slots of the agents whose decision failed."""
        return {i for i, *_ in self.failures}

    def close(self) -> list[tuple[int, str]]:
        """Merge team memories and publish errors; return (slot, reason) for each action that was not executed."""
        undone = self.list_undone()
        if self.written:
            self.merge_team_memories()
        for i, kind, message in sorted(self.failures, key=itemgetter(0)):
            slot = self.slots[i]
            slot.counts[COUNT_OF.get(kind, kind)] += 1
            self.state.errors.append({"turn": self.state.turn, "agent": slot.name, "kind": kind, "message": message})
        return undone

    def list_undone(self) -> list[tuple[int, str]]:
        """Return (slot, reason) for each action that was not executed."""
        return [(i, _REASONS.get(kind, message)) for i, kind, message in sorted(self.failures, key=itemgetter(0))]

    # -- answers ------------------------------------------------------------------------------------------------

    def note(self, i: int, team_memory: object) -> None:
        """Store an agent's changed copy of the team memory."""
        self.written.append((i, team_memory))

    def take(self, i: int, state: State) -> None:
        """Read the action from the state of an agent."""
        slot = self.slots[i]
        here = self.starts[i]
        self._phase.agent = None
        if "action" in state:
            action = state["action"]
            if type(action) is int and slot.is_plain and action in self._legality.list_reachable(slot, here):
                self.get_writable_ends()[i] = action
            else:
                self._decide(i, action)
        else:
            self._refuse(i, IllegalAction.missing(self._legality.list_reachable(slot, here), state))

    def fail(self, i: int, state: State, error: Exception) -> None:
        """Handle an error of a strategy: raise it, or use the default action, depending on the settings."""
        self._phase.agent = None
        if isinstance(error, KeyError) and "action" not in state and error.args == ("action",):
            self.take(i, state)  # not the strategy's error: it has set no action
            self._note(self._make_question(i, state))
        else:
            self._fail(self._make_question(i, state), error)

    def _make_question(self, i: int, state: State) -> _Question:
        agent = self.slots[i].agent
        return _Question(agent, f"strategy of agent {agent.name!r}", agent.strategy, state, [i], is_plan=False)

    def _put_plan(self, commanded: PlannedAgents, given: TeamArrays | dict[str, State]) -> None:
        deciders = commanded.deciders
        name = f"plan of team {shown(commanded.team)}"
        self._put(
            _Question(
                *(deciders, name, commanded.plan.function, given, commanded.indices),
                is_plan=True,
                are_plain=commanded.are_plain,
            )
        )

    def _put(self, question: _Question) -> None:
        budget = self._settings.time_budget
        began = perf_counter()
        self._phase.agent = question.decider
        try:
            answer = question.function(question.given)
        except Exception as error:  # noqa: BLE001 - a strategy is the caller's code
            self._phase.agent = None
            self._fail(question, error)
            return
        finally:
            self._phase.agent = None
        if hasattr(type(answer), "__await__"):
            self.awaited.append((question, answer))
        elif budget is not None and perf_counter() - began > budget:
            self._use_default_action(question, "overrun", f"took longer than {budget} s")
            self._note(question)
        else:
            self._answer(question, answer)

    def _answer(self, question: _Question, answer: object) -> None:
        given = question.given
        indices = question.indices
        if isinstance(given, TeamArrays):
            try:
                nodes = given.checked(answer.get("nodes", given.nodes) if isinstance(answer, Mapping) else answer)
                edges = given.checked_edges(answer) if isinstance(answer, Mapping) else None
            except GammsError as error:
                self._fail(question, error)
                return
            if edges is None:
                self._take_nodes(question, given, nodes)
            else:
                for i, node, edge in zip(indices, nodes.tolist(), edges.tolist(), strict=True):
                    self._decide(i, node if edge < 0 else {"edge": edge})
        elif not question.is_plan:
            self.take(indices[0], given)
        elif answer is not None:
            form = "A plan sets state['action'] in each state that it gets, and returns None"
            self._fail(question, BadType(f"{form}, not {shown(answer)}. To return nodes, take arrays=True."))
            return
        else:
            states = question.list_states()
            if None in states:
                key = shown(question.decider.names[states.index(None)])
                form = f"A plan sets states[{key}]['action'] = …, and leaves states[{key}] in its place"
                self._fail(question, BadType(f"{form}, which is a dict."))
                return
            for i, state in zip(indices, states, strict=True):
                self.take(i, state)
        self._note(question)

    def _take_nodes(self, question: _Question, arrays: TeamArrays, nodes: IntArray) -> None:
        starts: Any = self.starts
        slots = self.slots
        indices = question.indices
        is_all = len(indices) == len(starts)
        chosen = arrays.take_chosen(nodes)
        if question.are_plain and chosen is not None and is_all:
            self.ends = chosen.data
            self.moves = None
            return
        ends = self.get_writable_ends()
        is_known = np.ones(len(nodes), np.bool_) if chosen is not None else arrays.is_legal(nodes)
        if question.are_plain and is_known.all():
            # NOTE: all at once, for teams of many (benchmarks: teams).
            np.asarray(ends)[... if is_all else indices] = nodes
            return
        for i, node, is_legal in zip(indices, nodes.tolist(), is_known.tolist(), strict=True):
            if is_legal and slots[i].is_plain:
                ends[i] = node
            else:
                ends[i] = starts[i]
                self._decide(i, node)

    def _decide(self, i: int, action: object, *, is_default: bool = False) -> None:
        try:
            resolved = self._legality.resolve(self.slots[i], self.starts[i], action)
        except GammsError as error:
            if not is_default:  # an agent for which it is not legal stays
                self._refuse(i, error)
        else:
            self.get_writable_ends()[i] = resolved.end
            slot = self.slots[i]
            if slot.travels:
                self.make_paths()
                self._legality.get_for_agent(slot).travel.put(self.paths, i)
            elif not resolved.is_step():
                self.make_paths()
                self.paths.walk(i, resolved.path, resolved.progress)
            is_step = resolved.heading == () and resolved.deeds is None and resolved.edge is None
            if slot.flies or slot.obeys_turns or not is_step:
                self.actions[i] = resolved

    def make_paths(self) -> None:
        """Make room for paths of more than a step along one edge."""
        self.paths = self.paths or GamePaths(len(self.slots))

    def _refuse(self, i: int, error: GammsError) -> None:
        """Handle an illegal action: raise the error, or keep the agent on its node, depending on the settings."""
        if self._settings.on_illegal == "raise":
            name = self.slots[i].name
            raise IllegalAction(f"Agent {shown(name)} in turn {self.state.turn}: {error}") from error
        self.failures.append((i, "illegal", f"{type(error).__name__}: {error}"))

    def _fail(self, question: _Question, error: BaseException) -> None:
        if self._settings.on_error == "raise":
            error.add_note(f"In the {question.name}, in turn {self.state.turn}.{question.find_hint(error)}")
            raise error
        self._use_default_action(question, "error", f"{type(error).__name__}: {error}")

    def _use_default_action(self, question: _Question, kind: str, message: str) -> None:
        """Use the default action for agents whose strategy or plan has failed."""
        for i, state in zip(question.indices, question.list_states(), strict=True):
            self.failures.append((i, kind, message))
            self._do_default(i, state)

    def _do_default(self, i: int, state: State | None) -> None:
        action = self._settings.default_action
        slot = self.slots[i]
        if isinstance(action, str):  # "stay"
            return
        if callable(action):
            state = self.observe(slot) if state is None else state
            self._phase.agent = slot.agent
            try:
                action = action(state)
            except Exception as error:
                error.add_note(f"In ctx.game.default_action for agent {slot.name!r}, in turn {self.state.turn}.")
                raise
            finally:
                self._phase.agent = None
        self._decide(i, action, is_default=True)

    def _note(self, question: _Question) -> None:
        """Store the changed copies of the team memory."""
        if not self._settings.team_memory:
            return
        copies: list[Memory | None]
        if isinstance(question.given, TeamArrays):
            copies = [question.given.team_memory]
        else:
            copies = [None if state is None else state.get("team_memory") for state in question.list_states()]
        for i, copy in zip(question.indices, copies, strict=False):
            if copy or self.slots[i].team in self.state.team_memories:
                self.note(i, copy)

    def merge_team_memories(self) -> None:
        """Merge the changes that the members of each team have made to its memory."""
        shared = self.state.team_memories
        written: dict[Any, list[tuple[int, Memory]]] = {}
        for i, copy in sorted(self.written, key=itemgetter(0)):
            written.setdefault(self.slots[i].team, []).append((i, copy if isinstance(copy, dict) else {}))
        for team, copies in written.items():
            before = shared.get(team, {})
            try:
                after = merge_memory(before, [copy for _, copy in copies])
            except Exception:  # noqa: BLE001 - whatever the classes of strategies raise when they are copied
                after = merge_memory(before, [copy for i, copy in copies if self._can_be_shared(i, copy)])
            if after is not before:
                shared[team] = after

    def _can_be_shared(self, i: int, team_memory: Memory) -> bool:
        """Return whether an agent's changes can be copied; otherwise count an error of the agent."""
        flaw = find_copy_problem(team_memory)
        if flaw is not None and self._settings.on_error == "raise":
            raise BadValue(f"Agent {self.slots[i].name!r} in turn {self.state.turn}: {flaw}")
        if flaw is not None:
            self.failures.append((i, "error", f"BadValue: {flaw}"))
        return flaw is None
