"""Knowledge of agents: published facts, and copies of the game for looking ahead."""

from collections.abc import Callable, Hashable, Mapping
from typing import Any, Literal, NamedTuple

from gamms.arguments import as_choice, as_key
from gamms.deciding import get_phase
from gamms.errors import BadValue, IllegalMutation, UnknownName
from gamms.ir.game_state import GameState
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.context import HostContext


class KnownFacts(ReadOnlyMapping):
    """The facts that an agent or a team knows; its own facts override those of its team, and these the public ones.

    Args:
        state: the state of the game.
        team: the team.
        agent: the name of the agent; None: only facts that all agents of the team know.
    """

    __slots__ = ("_agent", "_state", "_team")

    def __init__(self, state: GameState, team: Hashable, agent: str | None) -> None:
        self._state = state
        self._team = team
        self._agent = agent

    @property
    def _values(self) -> dict[str, Any]:  # type: ignore[override] # its contents change
        state = self._state
        own = {} if self._agent is None else state.agent_facts.get(self._agent, {})
        return {**state.facts, **state.team_facts.get(self._team, {}), **own}


def get_facts(agent: str, team: Hashable, state: GameState, public: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the facts that an agent knows; `public` is a view of those that all know."""
    return KnownFacts(state, team, agent) if state.agent_facts or state.team_facts else public


def get_writable_facts(to: object, state: GameState, ctx: HostContext) -> dict[str, Any]:
    """Return the writable dict of facts published to a team, an agent (or its name), or everybody (None).

    Raises:
        UnknownName (KeyError): there is no such team or agent.
        BadValue: an agent and a team have this name.
    """
    if to is None:
        return state.facts
    agents = ctx.agent.agents
    name: Any = getattr(to, "name", to)
    is_agent = isinstance(name, str) and name in agents
    is_team = name is to and as_key(to, "A team") in ctx.agent.teams  # slow, because it looks at all agents
    if is_agent and is_team:
        raise BadValue(
            f"{shown(to)} is an agent and a team. For the agent, give ctx.agent.get_agent({shown(to)}) itself; for the "
            "team, call one of them by another name."
        )
    if not is_agent and not is_team:
        raise UnknownName("team or agent", name, [*ctx.agent.teams, *agents])
    if not (state.agent_facts or state.team_facts):
        get_phase(ctx).drop_plans()
    return (state.agent_facts if is_agent else state.team_facts).setdefault(name, {})


INFORMATION = ("private", "full")
Information = Literal["private", "full"]


class PrivateFork(NamedTuple):
    """A copy of a game for the deciding agents, from `state["fork"]`.

    Attributes:
        game: the copy, with its own context `game.ctx`. Any: the class `Game` imports this module.
        names: the names of these agents.
        own: returns a function's counterpart in the copy, if it closes over the game or its agents.
    """

    game: Any
    names: tuple[str, ...]
    own: Callable[[Any], Any]


class PrivateForks:
    """Makes copies of the game for deciding agents: `state["fork"]`.

    Args:
        ctx: the context of the game; None: the state was pickled.
    """

    __slots__ = ("_ctx",)

    def __init__(self, ctx: HostContext | None) -> None:
        self._ctx: Any = ctx  # whose class knows its game

    def __call__(self, seed: int, *, information: Information = "private") -> PrivateFork:
        """Return a copy of the game with only the knowledge of the deciding agents, and its own random numbers.

        The copy begins in the middle of this turn: rules of the phase "before" have run, and teams earlier in the order
        of play have moved. Its random numbers do not depend on the seed of the game. Its agents have no strategies.

        Args:
            seed: the seed of the copy.
            information: "private": state that the agents do not know is as at the start, see docs/planning.md; "full":
                the true state, if `ctx.game.information` allows it.

        Raises:
            BadValue: the game does not allow full information.
            IllegalMutation: no agent is deciding.
        """
        game = None if self._ctx is None else self._ctx.current_game
        if game is None:
            raise IllegalMutation("state['fork'] is of a state that was pickled, and belongs to no game any more.")
        fork: PrivateFork = game.fork_for_deciders(seed, as_choice(information, "information", INFORMATION))
        return fork

    def list_legal_edges(self, state: Mapping[str, Any]) -> tuple[int, ...]:
        """Return the ids of the edges that the action of the agent with a state may name.

        Raises:
            IllegalMutation: the state was pickled.
        """
        if self._ctx is None:
            raise IllegalMutation("state['legal_edges'] was not read before the state was pickled. Read it before.")
        with get_phase(self._ctx).suspend(changes_world=False):
            turns = self._ctx.game.internals.parts.turns
            order = turns.get_order()
            at = order.index_of.get(state["name"])
            found: tuple[int, ...] = ()  # the agent is gone
            if at is not None:
                found = turns.legality.list_edges(order.slots[at], state["curr_pos"])
        return found

    def list_driven(self, state: Mapping[str, Any]) -> tuple[int, ...]:
        """Return the ids of the edges on which the agent with a state has come to its node; see `GameState.driven`."""
        if self._ctx is None:
            return ()
        with get_phase(self._ctx).suspend(changes_world=False):
            driven: tuple[int, ...] = self._ctx.game.internals.parts.turns.legality.find_driven(state["name"])
        return driven

    def note_search(self, decisions: Mapping[str, bool]) -> None:
        """Count the agents whose action a search found, and the agents for which it had no time, in the timings.

        Args:
            decisions: agent -> whether its action was searched for; False: it follows its script.
        """
        with get_phase(self._ctx).suspend(changes_world=False):
            timings = self._ctx.game.internals.state.timings
        for has_searched in decisions.values():
            name = "searched" if has_searched else "given_up"
            timings[name] = timings.get(name, 0.0) + 1.0

    def is_of(self, ctx: object) -> bool:
        """Return whether this object belongs to a context."""
        return self._ctx is ctx

    def __deepcopy__(self, memo: dict[int, Any]) -> "PrivateForks":
        """Refer to the copy of the context, if the context is copied, too."""
        return PrivateForks(memo.get(id(self._ctx), self._ctx))

    def __reduce__(self) -> tuple[Any, ...]:
        return PrivateForks, (None,)

    def __eq__(self, other: object) -> bool:
        """Return True for any other object of this class, so that states can be compared."""
        return isinstance(other, PrivateForks)

    __hash__ = None  # type: ignore[assignment] # equal objects of different games

    def __repr__(self) -> str:
        return "fork(seed)"
