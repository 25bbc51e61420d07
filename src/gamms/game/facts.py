"""Facts: what is published to all strategies, to those of a team, or to one agent."""

from collections.abc import Hashable
from typing import Any

from gamms.arguments import as_key
from gamms.errors import BadValue, UnknownName
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
