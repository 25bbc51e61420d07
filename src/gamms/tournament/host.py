"""Play a Python entry in its process: make its functions, and call them with states like those of a game.

Questions come pickled from the master, which is trusted; answers go back as lines of JSON, because the entry is not
trusted. The entry's `ctx` holds the map, the settings of the game, the names and teams of all agents, and the
positions of the entry's own agents, whose sensors show what the master sends; opponents cannot be looked up in it.
"""

import json
import os
import pickle
import random
import sys
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from importlib.machinery import PathFinder
from typing import Any, NoReturn

import numpy as np

from gamms.context import Context, create_context
from gamms.core.copies import copy_deep
from gamms.errors import BadType
from gamms.game.random_streams import Draws, DrawTable, TurnGenerator
from gamms.game.team_memory import merge_memory
from gamms.ir.game_state import GameState
from gamms.plain import as_json, to_plain
from gamms.readonly import freeze
from gamms.scenario.code import find_first_parameter, find_function, import_function, make_from_function
from gamms.text import reason, shown
from gamms.typing.sensor_engine import ISensor, SensorType

Play = Callable[[int, int], None]
_HEAD = 4  # bytes before each question: its length
_FAILED = 71


def make_host(reference: str, packages: list[str], map: str, settings: dict[str, Any]) -> Play:
    """Load the map; return a function of two file descriptors (questions, answers) that plays the entry."""
    import_module("gamms.strategies")  # here once, instead of in each child
    ctx = create_context(logger_config={"level": "ERROR"}, game=settings)
    ctx.graph.load(map)
    ctx.graph.columns()
    PathFinder.find_spec(
        reference, packages
    )  # Python remembers the contents of these folders, which the child may not list

    def play(asked: int, answered: int) -> None:
        sys.path[:0] = packages  # in the child only: the entry's modules must not replace modules of the launcher
        _play(reference, ctx, asked, answered)

    return play


def _play(reference: str, ctx: Context, asked: int, answered: int) -> None:
    questions = _read_questions(asked)
    try:
        team = _HostedTeam(ctx, reference, next(questions))
        _write(answered, {"type": "ready"})
        for question in questions:
            _write(answered, team.answer(question))
    except MemoryError:
        _fail(answered, "memory", "it used more memory than it may")
    except BaseException as error:  # noqa: BLE001 - SystemExit, too, is a fault of the entry
        traceback.print_exc()
        _fail(answered, "error", f"{type(error).__name__}: {reason(error)}")


def _fail(answered: int, kind: str, message: str) -> NoReturn:
    _write(answered, {"type": "failed", "kind": kind, "message": message[:1000]})
    sys.stderr.flush()
    os._exit(_FAILED)


def _read_questions(asked: int) -> Iterator[dict[str, Any]]:
    with os.fdopen(asked, "rb") as file:
        while head := file.read(_HEAD):
            yield pickle.loads(file.read(int.from_bytes(head, "big")))  # noqa: S301 - of the master


def _write(answered: int, answer: dict[str, Any]) -> None:
    data = memoryview(json.dumps(answer).encode() + b"\n")
    while data:
        data = data[os.write(answered, data) :]


def frame_question(question: dict[str, Any]) -> bytes:
    """Return the bytes of a question to a Python entry: its length, then its pickle."""
    data = pickle.dumps(question, pickle.HIGHEST_PROTOCOL)
    return len(data).to_bytes(_HEAD, "big") + data


class _ReceivedSensor(ISensor):
    """A sensor that shows what the sensor of the game has shown.

    Args:
        sensor_id: its name.
        type: its type.
    """

    sees_world_only = True

    def __init__(self, sensor_id: str, type: SensorType) -> None:
        self._id = sensor_id
        self._type = type
        self._data: Any = {}

    @property
    def sensor_id(self) -> str:
        """The name of the sensor."""
        return self._id

    @property
    def type(self) -> SensorType:
        """The type of the sensor."""
        return self._type

    @property
    def data(self) -> Any:
        """A copy of what the sensor of the game has shown last."""
        return copy_deep(self._data)

    @data.setter
    def data(self, data: Any) -> None:
        self._data = data

    def sense(self, node_id: int) -> None:
        """Do nothing: the game looks."""

    def update(self, data: dict[str, Any]) -> None:
        """Do nothing: the game looks."""

    def set_owner(self, owner: str | None) -> None:
        """Do nothing: the game looks."""


@dataclass
class _HostedAgent:
    """The random streams, the memory and the strategy of one agent."""

    draw: Draws
    rng: TurnGenerator
    memory: dict[Any, Any]
    decide: Callable[[Any], Any] | None  # None: the plan decides


class _HostedTeam:
    """The agents of the entry, and the plan or strategies that decide for them."""

    def __init__(self, ctx: Context, reference: str, start: dict[str, Any]) -> None:
        self._ctx = ctx
        self._team = start["team"]
        self._memory = dict[Any, Any]()
        self._clock = GameState()
        ctx.reseed(start["seed"])
        random.seed(start["seed"])
        np.random.seed(start["seed"] % (1 << 32))  # noqa: NPY002 - what programs for 1.0.0 draw from
        for name, keywords in start["agents"].items():
            ctx.agent.create_agent(name, **keywords)
        found, folder = find_function(reference, "the entry")
        function = import_function(found, folder)
        self._plan: Callable[[Any], Any] | None = None
        own = [name for name, keywords in start["agents"].items() if keywords["team"] == self._team]
        kind = "plan" if find_first_parameter(function) == "states" else "strategy"
        one = make_from_function(function, {}, ctx, "the entry", kind)
        if find_first_parameter(one) == "states":
            self._plan = one
            kind = "plan"
        self._players = {}
        table = DrawTable(start["seed"], self._clock)
        for number, name in enumerate(own):
            decide = one if number == 0 else make_from_function(function, {}, ctx, "the entry", kind)
            draw = Draws(table, name)
            rng = TurnGenerator(table, name)
            self._players[name] = _HostedAgent(draw, rng, {}, None if self._plan else decide)

    def answer(self, question: dict[str, Any]) -> dict[str, Any]:
        """Return the actions and messages of the agents whose states are in a question."""
        states: dict[str, dict[str, Any]] = {}
        for name, sent in question["agents"].items():
            player = self._players[name]
            agent = self._ctx.agent.get_agent(name)
            self._clock.turn = sent["turn"]
            self._ctx.game.internals.state.turn = sent["turn"]
            state = {**sent, "name": name, "team": self._team, "draw": player.draw, "rng": player.rng}
            state |= {"memory": player.memory, "facts": freeze(sent["facts"])}
            if question["shares_memory"]:
                state["team_memory"] = copy_deep(self._memory)
            if isinstance(sent["curr_pos"], int):
                agent.current_node_id = sent["curr_pos"]
            self._show_sensors(name, sent["sensor"])
            states[name] = state
        self._decide(states)
        copies = [_as_dict(state["team_memory"]) for state in states.values() if "team_memory" in state]
        self._memory = merge_memory(self._memory, copies)
        return {
            "type": "turn",
            "question": question["question"],
            "actions": {name: as_json(to_plain(one["action"])) for name, one in states.items() if "action" in one},
            "outbox": {name: as_json(to_plain(one["outbox"])) for name, one in states.items() if one.get("outbox")},
        }

    def _show_sensors(self, owner: str, sent: dict[str, tuple[SensorType, Any]]) -> None:
        """Give an agent the sensors of the game, with their last data."""
        agent: Any = self._ctx.agent.get_agent(owner)
        for name in [name for name in agent.sensors if name not in sent]:
            agent.deregister_sensor(name)
        for name, (kind, data) in sent.items():
            if name not in agent.sensors:
                agent.register_sensor(name, _ReceivedSensor(f"{owner}.{name}", kind))
            agent.sensors[name].data = data

    def _decide(self, states: dict[str, dict[str, Any]]) -> None:
        if self._plan is not None:
            _check(self._plan(states), "A plan")
            return
        for name, state in states.items():
            decide = self._players[name].decide
            if decide is not None:
                _check(decide(state), "A strategy")


def _as_dict(value: object) -> dict[Any, Any]:
    return value if isinstance(value, dict) else {}


def _check(returned: object, what: str) -> None:
    """Refuse an awaitable: an entry has nothing to wait for."""
    if hasattr(type(returned), "__await__"):
        raise BadType(f"{what} of an entry must be an ordinary function, not one that returns {shown(returned)}.")
