"""Says what keeps games from being played in arrays."""

from collections.abc import Hashable, Iterator
from itertools import chain
from typing import Any

from gamms.game.batch.begun import may_forget, why_not_begun
from gamms.game.batch.columns import PlayedGame, agents_of, decider_of, preparing
from gamms.game.batch.forms import strategy_spec_of
from gamms.game.batch.sight import why_not_seen
from gamms.game.conflicts import ranked
from gamms.game.settings import as_called
from gamms.text import as_code, shown
from gamms.typing import AgentType, IAgent


def why_not_in_arrays(game: PlayedGame) -> str | None:
    """Return what keeps games from being played in arrays, in words; None: nothing."""
    return next(chain(_why_not_played(game), _without_forms(game), why_not_decided(game).values()), None)


def _why_not_played(game: PlayedGame) -> Iterator[str]:
    """Yield the parts of the state and the settings of a game that have no array form."""
    settings, agents = game.settings(), agents_of(game)
    why = _why_not_moved(game)
    if why is not None:
        yield why
    if settings["time_budget"] is not None:
        yield "a time budget"
    if game.internals.after_observing:
        yield "what is recorded of states"
    yield from why_not_begun(game)
    for agent in agents:
        for one in preparing(agent, settings["plans"]):
            yield f"{as_code(one)}, with what it prepares in a game"
    for named in game.rules:
        refuses = named.spec.why_not_in_arrays
        why = None if refuses is None else refuses(agents)
        if why is not None:
            yield why


def _without_forms(game: PlayedGame) -> Iterator[str]:
    """Yield the rules, checks, collectors and conflicts that have no array form."""
    conflicts = game.settings()["conflicts"]
    for one in as_called(game.rules):
        if one.spec.array_form is None:
            yield f"the rule {one.name!r}"
    for one in game.rules:
        if one.spec.check is not None and one.spec.array_check is None:
            yield f"the check of the rule {one.name!r}"
    for name in game.internals.parts.collectors.by_name:
        yield f"the collector {name!r}"
    if conflicts is not None and ranked(conflicts) is None:
        yield f"the conflicts {as_code(conflicts)}"


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


def why_not_decided(game: PlayedGame) -> dict[Hashable, str]:
    """Return, by team and in words, the strategies and sensors that have no array form."""
    found: dict[Hashable, str] = {}
    plans = game.settings()["plans"]
    for agent in agents_of(game):
        decider = decider_of(agent, plans)
        why = None if decider is None else next(_why_not_asked(game, agent, decider), None)
        if why is not None:
            found.setdefault(agent.team, why)
    return found


def _why_not_asked(game: PlayedGame, agent: IAgent, decider: Any) -> Iterator[str]:
    """Yield, in words, why the decider of an agent or a sensor that it asks has no array form."""
    spec, has_plan = strategy_spec_of(decider), agent.team in game.settings()["plans"]
    if spec.array_form is None or may_forget(game, agent):
        kind = f"plan of team {shown(agent.team)}" if has_plan else "strategy"
        yield f"the {kind} {as_code(decider)}{', which remembers something' * (spec.array_form is not None)}"
    for refuses in spec.refuses:
        why = refuses(game, agent)
        if why is not None:
            yield f"the strategy {as_code(decider)}, {why}"
    if agent.type is AgentType.AERIAL and (has_plan or not spec.flies):
        yield f"{as_code(decider)} of agent {agent.name!r}, which flies"
    for name in getattr(agent, "sensors", {}) if spec.looks else ():
        why = why_not_seen(agent, name)
        if why is not None:
            yield why
