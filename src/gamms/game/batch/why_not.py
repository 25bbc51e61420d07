"""Says what keeps games of a batch from being played in the core, so that they are played one after the other."""

from collections.abc import Hashable, Iterator
from itertools import chain

from gamms.game.batch.begun import goes_along_one_edge, may_forget, movement_of, why_not_begun
from gamms.game.batch.columns import PlayedGame, Roster, decider_of, preparing
from gamms.game.batch.cursor import acts_before_moves, asked_of, has_function_of_conflicts, is_plain_rule
from gamms.game.batch.forms import strategy_spec_of
from gamms.game.batch.in_core import core_form_of
from gamms.game.batch.movement import Movement
from gamms.game.batch.sensing import why_not_asked_in_core
from gamms.game.settings import as_called
from gamms.text import as_code, shown
from gamms.typing import AgentType


def why_not_in_core(game: PlayedGame, roster: Roster) -> str | None:
    """Return what keeps games from being played in the core, in words; None: nothing but perhaps their map."""
    decided = why_not_decided(game, roster).values()
    called = _why_not_called(game, roster)
    return next(chain(_why_not_played(game), _why_not_agents(game, roster), decided, called), None)


def first_called(game: PlayedGame, roster: Roster) -> str | None:
    """Return the first plain function that is called game by game, in words; None: there is none."""
    called = as_called(game.rules)
    rules = [f"the rule {one.name!r}" for one in called if is_plain_rule(one)]
    rules += [f"the check of the rule {one.name!r}" for one in called if one.spec.check is not None]
    if has_function_of_conflicts(game):
        rules.append(f"the conflicts {as_code(game.settings()['conflicts'])}")
    plans = game.settings()["plans"]
    deciders = (f"the strategy {as_code(decider_of(roster.agents[i], plans))}" for i in asked_of(game, roster))
    collectors = (f"the collector {name!r}" for name in game.internals.parts.collectors.by_name)
    return next(chain(rules, deciders, collectors), None)


def movement_in_core(game: PlayedGame, roster: Roster) -> Movement:
    """Return how the agents of a game go that the core plays, where plain functions may close roads and open them."""
    may_change = goes_along_one_edge(game, roster) and first_called(game, roster) is not None
    return movement_of(game, roster, may_reopen=may_change, is_detached=may_change)


def _why_not_called(game: PlayedGame, roster: Roster) -> Iterator[str]:
    """Yield what keeps one context from being pointed at games for their plain functions."""
    first = first_called(game, roster)
    if first is None:
        return
    asked, order = asked_of(game, roster), game.settings()["order"]
    if order is not None and not goes_along_one_edge(game, roster) and acts_before_moves(game):
        yield f"{first}, before agents with speeds move in an order of play"
    if asked and _decides_at_arrivals(game):
        yield f"{first}, with agents that decide at arrivals"
    if has_function_of_conflicts(game) and _decides_at_arrivals(game):
        yield f"{first}, with conflicts at arrivals"


def _decides_at_arrivals(game: PlayedGame) -> bool:
    settings = game.settings()
    by_metres = settings["speed_unit"] != "edges" and settings["legal"] == "edges"
    return by_metres and bool(settings["decide"] == "arrival")


def _why_not_played(game: PlayedGame) -> Iterator[str]:
    """Yield the parts of the state and the settings of a game that the core does not have."""
    if game.internals.after_observing:
        yield "what is recorded of states"
    if any(one.spec.is_array_function and one.phase == "deeds" for one in as_called(game.rules)):
        yield "an array rule of the phase 'deeds'"
    yield from why_not_begun(game)


def _why_not_agents(game: PlayedGame, roster: Roster) -> Iterator[str]:
    """Yield what the core does not have of agents and their sensors."""
    asked = asked_of(game, roster)
    if not roster.is_first.all():
        yield "agents that may come"
    for number, agent in enumerate(roster.agents):
        if agent.type is AgentType.AERIAL:
            yield f"agent {shown(agent.name)}, which flies"
        for name, why in why_not_asked_in_core(agent, is_called=number in asked):
            yield f"the sensor {shown(name)} of agent {shown(agent.name)}, which {why}"


def why_not_decided(game: PlayedGame, roster: Roster) -> dict[Hashable, str]:
    """Return, by team and in words, the strategies and sensors that the core does not have."""
    found: dict[Hashable, str] = {}
    plans = game.settings()["plans"]
    for number, agent in enumerate(roster.agents):
        for one in preparing(agent, plans):
            found.setdefault(agent.team, f"{as_code(one)}, with what it prepares in a game")
        decider = decider_of(agent, plans)
        why = None if decider is None else next(_why_not_asked(game, roster, number), None)
        if why is not None:
            found.setdefault(agent.team, why)
    return found


def _why_not_asked(game: PlayedGame, roster: Roster, number: int) -> Iterator[str]:
    """Yield, in words, why the core does not have the decider of an agent."""
    settings, agent = game.settings(), roster.agents[number]
    decider = decider_of(agent, settings["plans"])
    spec = strategy_spec_of(decider)
    kind = f"plan of team {shown(agent.team)}" if agent.team in settings["plans"] else "strategy"
    if _decides_at_arrivals(game) and spec.array_form is not None:
        yield f"the {kind} {as_code(decider)}, in arrays, of agents that decide at arrivals"
    if settings["time_budget"] is not None and spec.array_form is not None:
        yield f"the {kind} {as_code(decider)}, in arrays, with a time budget"
    is_called = core_form_of(settings, roster, number) is None and spec.array_form is None  # with all that it remembers
    if may_forget(game, agent) and not is_called:
        yield f"the {kind} {as_code(decider)}, which remembers something"
