"""Asking agents: what their sensors show, their states, the calls of their strategies, and the plain answers.

This module holds Python objects and the GIL. What is not plain - an answer that has to be awaited, an error, an action
that is no legal node - goes to the object that takes the answers, see `ask_each`.
"""

from __future__ import annotations

from typing import Any

from gamms.core.agents import Moves
from gamms.core.form import as_dict
from gamms.core.sight import Sight


class Key:
    """An attribute of a dict subclass that stands for a key; only `action` can be set.

    Args:
        name: the key.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, state: Any, owner: Any) -> Any:
        """Return the value of the key (AttributeError)."""
        if state is None:
            return self
        try:
            return state[self.name]
        except KeyError:
            keys = ", ".join([str(key) for key in state])
            raise AttributeError(f"This state has no {self.name!r}. Its keys are: {keys}.") from None

    def __set__(self, state: Any, value: object) -> None:
        """Set `action`; anything else raises AttributeError."""
        if self.name != "action":
            raise AttributeError(f"state.{self.name} cannot be set: a strategy sets state.action.")
        state["action"] = value


class Sensing:
    """A sensor as its agent asks it.

    Attributes:
        name: what it is called in the state.
        last: a list whose first item is what it showed last; of a class of the user's own, an object that reads like
            one.
        kind: its type, as it is in the state; None: it is read after each look.
        sensor: what is asked, by `sense` and `type`; None: a look copies the neighborhood of the agent's node.
        number: of the sensors that it looks alike with, which share what they know; -1: it looks by itself.
    """

    def __init__(self, name: str, last: Any, kind: Any, sensor: Any, number: int = -1) -> None:
        self.name = name
        self.last = last
        self.kind = kind
        self.sensor = sensor
        self.number = number


class Individual:
    """An agent that decides by itself.

    Attributes:
        agent, strategy, team: its own.
        template: its state, but for what changes from turn to turn; None: it is not plain, or has no strategy.
        sensors: those that it carries.
        last: a list whose only item is the state that it got last.
    """

    def __init__(self, agent: Any, strategy: Any, template: Any, sensors: tuple[Sensing, ...], last: list[Any]) -> None:
        self.agent = agent
        self.strategy = strategy
        self.template = template
        self.team = agent.team
        self.sensors = sensors
        self.last = last


def sense_all(
    carried: tuple[Sensing, ...], phase: Any, moment: Any, alike: Any, here: Any, legal: Any
) -> dict[Any, Any]:
    """Return what the sensors of an agent show at its node, by their names; see `ask_each` for the arguments."""
    sensed = {}
    for look in carried:
        if look.sensor is None:
            seen = [*legal]
            look.last[0] = seen
            sensed[look.name] = (look.kind, seen)
            continue
        known = alike[look.number] if look.number >= 0 else None
        if known is not None and phase.moment is moment:
            data = look_around(known, look, here)
            if data is not None:
                sensed[look.name] = (look.kind, data)
                continue
        phase.agent = None
        look.sensor.sense(here)
        sensed[look.name] = (look.sensor.type, look.last[0])
    return sensed


def look_around(known: Any, look: Sensing, here: Any) -> Any:
    """Return what a sensor shows by what it shares; None: it has to look by itself.

    Args:
        known: a `Sight` or `Views`.
        look: the sensor.
        here: the node from which it looks.
    """
    if type(known) is Sight:
        sight = known
        data = sight.seen_from(here, look.sensor._owner)
        view = sight.view
    else:
        views = known
        seen = views.known.get(here)
        if seen is None:
            return None
        data = {"nodes": seen[0].copy(), "edges": seen[1].copy()}
        view = views.view
    look.last[0] = data
    look.last[1] = (here, view[0], view[1], view[2])
    return data


def ask_each(
    answers: Any,
    phase: Any,
    individuals: list[Individual],
    sensors: list[tuple[Sensing, ...]],
    slots: Any,
    moves: Moves,
    near: Any,
    alike: Any,
) -> int:
    """Ask individuals one by one, and take their answers.

    No agent sees what others decide: nothing may change while they do. When it returns, the last of them is still
    deciding for the phase.

    Args:
        answers: takes the answers: `observe`, `take`, `fail`, `wait_for`, `note` and `team_memory` do what is not
            plain; `make` makes a state of a template.
        phase: its `agent` says who decides, its `moment` changes where the world may have changed.
        individuals: the agents.
        sensors: those of each.
        slots: their numbers.
        moves: of all agents, by slot; the ends of theirs are written.
        near: node -> the nodes that are legal along one edge.
        alike: by number, what sensors that look alike share: a `Sight`, `Views`, or None.
    """
    make = answers.make
    shared = answers.state.team_memories
    turn = answers.state.turn
    moment = phase.moment
    has_memories = bool(shared)
    for place in range(len(individuals)):
        one = individuals[place]
        i = slots[place]
        here = moves.starts[i]
        if one.template is None:
            phase.agent = None
            legal = ()
            state = as_dict(answers.observe(answers.slots[i]))
            one.last[0] = state
            if one.strategy is None:
                continue
        else:
            legal = near[here]
            sensed = sense_all(sensors[place], phase, moment, alike, here, legal)
            state = as_dict(make(one.template))
            one.last[0] = state
            state["curr_pos"] = here
            state["sensor"] = sensed
            state["turn"] = turn
            state["legal"] = legal
            state["team_memory"] = answers.team_memory(one.team) if has_memories else {}
        phase.agent = one.agent
        try:
            answer = one.strategy(state)
            if answer is not None and hasattr(type(answer), "__await__"):
                answers.wait_for(i, state, answer)
                continue
            action = state["action"]
        except Exception as error:  # noqa: BLE001 - a strategy is the caller's code
            answers.fail(i, state, error)
            continue
        if type(action) is int and action in legal:
            moves.ends[i] = action
        else:
            answers.take(i, state)
        mine = state.get("team_memory")
        if mine or (has_memories and one.team in shared):
            answers.note(i, mine)
    return 0
