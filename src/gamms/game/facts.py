"""What agents know: facts that were published to all, a team or an agent, and copies of the game to look ahead."""

from collections.abc import Callable, Hashable, Mapping
from typing import Any, Literal, NamedTuple

from gamms.arguments import as_choice, as_key
from gamms.deciding import phase_of
from gamms.errors import BadValue, IllegalMutation, UnknownName
from gamms.ir.game_state import GameState
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.context import HostContext


class FactsOf(ReadOnlyMapping):
    """What was published to all, to a team and to an agent; of facts of one name the last of these.

    Args:
        state: of the game.
        team: the team.
        agent: the name of the agent; None: what all agents of the team know.
    """

    __slots__ = ("_agent", "_state", "_team")

    def __init__(self, state: GameState, team: Hashable, agent: str | None) -> None:
        self._state, self._team, self._agent = state, team, agent

    @property
    def _values(self) -> dict[str, Any]:  # type: ignore[override] # what it shows changes
        state = self._state
        own = {} if self._agent is None else state.agent_facts.get(self._agent, {})
        return {**state.facts, **state.team_facts.get(self._team, {}), **own}


def facts_to(to: object, state: GameState, ctx: HostContext) -> dict[str, Any]:
    """Return the facts that a team, an agent (or its name), or all (None) know, to be added to.

    Raises:
        UnknownName (KeyError): there is no such team or agent.
        BadValue: an agent and a team have this name.
    """
    if to is None:
        return state.facts
    agents = ctx.agent.agents
    name: Any = getattr(to, "name", to)
    is_agent = isinstance(name, str) and name in agents
    is_team = name is to and as_key(to, "A team") in ctx.agent.teams  # which looks at all agents
    if is_agent and is_team:
        raise BadValue(
            f"{shown(to)} is an agent and a team. For the agent, give ctx.agent.get_agent({shown(to)}) itself; for the "
            "team, call one of them by another name."
        )
    if not is_agent and not is_team:
        raise UnknownName("team or agent", name, [*ctx.agent.teams, *agents])
    return (state.agent_facts if is_agent else state.team_facts).setdefault(name, {})


INFORMATION = ("private", "full")
Information = Literal["private", "full"]


class PrivateFork(NamedTuple):
    """A copy of a game for the agents that decide, from `state["fork"]`.

    Attributes:
        game: the copy, with a context of its own, `game.ctx`. Any: the class `Game`, which makes it.
        names: of the agents that it is for.
        own: returns what a function is in the copy that closes over the game, or over an agent of it.
    """

    game: Any
    names: tuple[str, ...]
    own: Callable[[Any], Any]


class PrivateForks:
    """Gives the agents that decide copies of their game: `state["fork"]`.

    Args:
        ctx: the context of the game; None: that of a state which was pickled.
    """

    __slots__ = ("_ctx",)

    def __init__(self, ctx: HostContext | None) -> None:
        self._ctx: Any = ctx  # whose class knows its game

    def __call__(self, seed: int, *, information: Information = "private") -> PrivateFork:
        """Return a copy of the game as far as the agents that decide know it, with random numbers of its own.

        It begins where they decide: rules of "before" were applied in this turn, and teams that are earlier in the
        order of play have moved. No random number in it follows from the seed of the game. Agents have no strategies.

        Args:
            seed: of the copy.
            information: "private": what the agents do not know is as it was at the start, see docs/planning.md;
                "full": all is as it is, where `ctx.game.information` allows that.

        Raises:
            BadValue: the game does not allow full information.
            IllegalMutation: no agent decides, whose knowledge would count.
        """
        game = None if self._ctx is None else self._ctx.current_game
        if game is None:
            raise IllegalMutation("state['fork'] is of a state that was pickled, and belongs to no game any more.")
        fork: PrivateFork = game.fork_for_deciders(seed, as_choice(information, "information", INFORMATION))
        return fork

    def note_search(self, decisions: Mapping[str, bool]) -> None:
        """Count in the timings of the game for how many agents a search has decided, and for how many it had no time.

        Args:
            decisions: agent -> whether its action was searched for; False: it follows its script.
        """
        with phase_of(self._ctx).suspended(changes_world=False):
            timings = self._ctx.game.internals.state.timings
        for has_searched in decisions.values():
            name = "searched" if has_searched else "given_up"
            timings[name] = timings.get(name, 0.0) + 1.0

    def is_of(self, ctx: object) -> bool:
        """Return whether it is of the game of a context."""
        return self._ctx is ctx

    def __deepcopy__(self, memo: dict[int, Any]) -> "PrivateForks":
        """Belong to the copy of the context if that is copied, too."""
        return PrivateForks(memo.get(id(self._ctx), self._ctx))

    def __reduce__(self) -> tuple[Any, ...]:
        return PrivateForks, (None,)

    def __eq__(self, other: object) -> bool:
        """Whether it does the same for a state that is compared."""
        return isinstance(other, PrivateForks)

    __hash__ = None  # type: ignore[assignment] # what is equal in all games has no hash

    def __repr__(self) -> str:
        return "fork(seed)"
