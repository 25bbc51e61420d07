"""Says what keeps games from being played in arrays, and which agents are asked one by one there."""

from collections.abc import Hashable, Iterator, Sequence

from gamms.game.batch.begun import may_forget, why_not_begun
from gamms.game.batch.columns import PlayedGame, agents_of, decider_of, preparing
from gamms.game.batch.forms import spec_of
from gamms.game.batch.scalar_rules import called_one_by_one, why_not_called
from gamms.game.batch.scalar_strategies import why_not_asked
from gamms.game.batch.sight import why_not_seen
from gamms.game.conflicts import ranked
from gamms.text import as_code, shown
from gamms.typing import AgentType, IAgent


def why_not_in_arrays(game: PlayedGame) -> str | None:
    """Return what keeps games from being played in arrays, in words; None: nothing."""
    settings, asked, scalar, agents = game.settings(), teams_asked(game), called_one_by_one(game), agents_of(game)
    reasons = [
        (settings["time_budget"] is not None, "a time budget"),
        (bool(game.internals.after_observing), "what is recorded of states"),
    ]
    not_asked = why_not_asked(game, [agent for agent in agents if agent.team in asked])
    not_called = why_not_called(game)
    found = [_why_not_moved(game), *(why for is_so, why in reasons if is_so)]
    found += why_not_begun(game)
    found += [as_prepared(one) for agent in agents for one in preparing(agent, settings["plans"])]
    found += [f"{one}, with {not_asked}" for one in asked.values() if not_asked is not None]
    found += [f"{one}, with {not_called}" for one in scalar if not_called is not None]
    found += [why_not(agents) for one in game.rules if (why_not := one.spec.why_not_in_arrays) is not None]
    return next((why for why in found if why is not None), None)


def _why_not_moved(game: PlayedGame) -> str | None:
    """Return what has no array form of how agents move, in words; None: all has."""
    settings = game.settings()
    by_metres, conflicts = settings["speed_unit"] != "edges" and settings["legal"] == "edges", settings["conflicts"]
    at_arrivals = by_metres and settings["decide"] == "arrival"
    graph = game.ctx.graph
    reasons = [
        (by_metres and not len(graph.columns().edge_ids) + len(graph.closed_roads), "a map without edges, by metres"),
        (at_arrivals and conflicts is not None and ranked(conflicts) is None, f"the conflicts {as_code(conflicts)}"),
    ]
    return next((why for is_so, why in reasons if is_so), None)


def as_prepared(decider: object) -> str:
    """Say that a strategy or a plan prepares something in a game."""
    return f"{as_code(decider)}, with what it prepares in a game"


def why_not_decided(game: PlayedGame, agents: Sequence[IAgent]) -> Iterator[tuple[IAgent, str]]:
    """Yield agents, and what of their strategies and sensors has no array form, in words."""
    plans = game.settings()["plans"]
    deciders = [(agent, one) for agent in agents if (one := decider_of(agent, plans)) is not None]
    for agent, one in deciders:
        spec = spec_of(one)
        if spec.array_form is None or may_forget(game, agent):
            kind = f"plan of team {shown(agent.team)}" if agent.team in plans else "strategy"
            yield agent, f"the {kind} {as_code(one)}{', which remembers something' * (spec.array_form is not None)}"
        for refuses in spec.refuses:
            if (why := refuses(game, agent)) is not None:
                yield agent, f"the strategy {as_code(one)}, {why}"
        if _flies(agent) and (agent.team in plans or not spec.flies):
            yield agent, f"{as_code(one)} of agent {agent.name!r}, which flies"
        for name in getattr(agent, "sensors", {}) if spec.looks else ():
            why = why_not_seen(agent, name)
            if why is not None:
                yield agent, why


def teams_asked(game: PlayedGame) -> dict[Hashable, str]:
    """Return the teams whose agents are asked one by one, and what of each has no array form, in words.

    These are all agents of a team, because they share a memory.
    """
    found: dict[Hashable, str] = {}
    for agent, why in why_not_decided(game, agents_of(game)):
        found.setdefault(agent.team, why)
    return found


def _flies(agent: IAgent) -> bool:
    return agent.type is AgentType.AERIAL
