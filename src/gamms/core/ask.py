"""Call sensors and strategies of agents one by one, and read the common answers.

This module handles Python objects and holds the GIL. Uncommon answers - awaitables, errors, and actions other than a
legal node - go to the `answers` object; see `ask_each`.
"""

from __future__ import annotations

from typing import Any

from gamms.core.agents import MoveColumns
from gamms.core.form import as_dict
from gamms.core.sight import RangeSearch


class StateKey:
    """A descriptor that reads a key of a dict as an attribute; only `action` can be set.

    Args:
        name: the key.
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, state: Any, owner: Any) -> Any:
        """Return the value of the key (AttributeError: the key does not exist)."""
        if state is None:
            return self
        try:
            return state[self.name]
        except KeyError:
            keys = ", ".join([str(key) for key in state])
            raise AttributeError(f"This state has no {self.name!r}. Its keys are: {keys}.") from None

    def __set__(self, state: Any, value: object) -> None:
        """Set `action` (AttributeError: any other key)."""
        if self.name != "action":
            raise AttributeError(f"state.{self.name} cannot be set: a strategy sets state.action.")
        state["action"] = value


class SensorCall:
    """A sensor of an agent, prepared for repeated calls.

    Attributes:
        name: its name in the state.
        last: a list whose first item is the last data; for a user's sensor class, an object that can be indexed alike.
        kind: its type, as in the state; None: the type is read after each call.
        sensor: the object that is called, with `sense` and `type`; None: the sensor shows the neighbors of the node.
        number: the group of equal sensors that share data; -1: the sensor shares no data.
    """

    def __init__(self, name: str, last: Any, kind: Any, sensor: Any, number: int = -1) -> None:
        self.name = name
        self.last = last
        self.kind = kind
        self.sensor = sensor
        self.number = number


class DecidingAgent:
    """An agent with its own strategy.

    Attributes:
        agent, strategy, team: the agent, its strategy and its team.
        template: the constant part of its state; None: the agent needs `answers.observe`, or it has no strategy.
        sensors: its sensors.
        last: a list whose only item is the last state that it got.
    """

    def __init__(
        self, agent: Any, strategy: Any, template: Any, sensors: tuple[SensorCall, ...], last: list[Any]
    ) -> None:
        self.agent = agent
        self.strategy = strategy
        self.template = template
        self.team = agent.team
        self.sensors = sensors
        self.last = last


def hold(lists: list[list[Any]], value: object) -> bool:
    """Return whether the first item of each list is an object."""
    for one in lists:  # noqa: SIM110 - a generator costs as much as ten lists
        if one[0] is not value:
            return False
    return True


def sense_all(
    carried: tuple[SensorCall, ...], phase: Any, moment: Any, alike: Any, here: Any, legal: Any
) -> dict[Any, Any]:
    """Call the sensors of an agent at its node; return name -> (type, data). `ask_each` describes the arguments."""
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


def look_around(known: Any, look: SensorCall, here: Any) -> Any:
    """Return the data of a sensor from data shared by equal sensors; None: the sensor has to be called.

    Args:
        known: a `RangeSearch` or `NodeViews`.
        look: the sensor.
        here: the id of the observer's node.
    """
    if type(known) is RangeSearch:
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
    individuals: list[DecidingAgent],
    sensors: list[tuple[SensorCall, ...]],
    slots: Any,
    moves: MoveColumns,
    near: Any,
    alike: Any,
) -> int:
    """Call the strategies of agents one by one, and store their actions.

    All agents decide from the same state of the game: nothing may change in between. After the call, `phase.agent` is
    still the last agent.

    Args:
        answers: handles uncommon cases by `observe`, `take`, `fail`, `wait_for`, `note` and `team_memory`; `make` makes
            a state from a template.
        phase: its `agent` is set to the agent that decides; its `moment` changes whenever the world may have changed.
        individuals: the agents.
        sensors: the sensors of each agent.
        slots: the slot of each agent.
        moves: the moves of all agents, by slot; the ends are written.
        near: node id -> the nodes that are legal along one edge.
        alike: the data that each group of equal sensors shares: a `RangeSearch`, `NodeViews`, or None.
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
