"""A whole state that a stranger may have written: its columns are of the right kinds, and of one length."""

from typing import Any

import numpy as np

from gamms.recorder.errors import Damaged
from gamms.recorder.state import State, shares
from gamms.text import shown

_MOST_AGENTS = 1 << 24  # that one recording may number
LISTS = ("names", "teams", "speed", "sensors", "attributes", "strategies")
ARRAYS = {
    "numbers": (np.int64, ()),
    "kind": (np.int64, ()),
    "node": (np.int64, ()),
    "previous": (np.int64, ()),
    "heading": (np.float64, (2,)),
    "position": (np.float64, (3,)),
    "previous_position": (np.float64, (3,)),
    "quat": (np.float64, (4,)),
    "alive": (np.int64, ()),
    "edge_source": (np.int64, ()),
    "edge_target": (np.int64, ()),
    "edge_share": (np.float64, ()),
}
_MAY_LACK = ("edge_source", "edge_target", "edge_share")  # while no agent is on an edge


def checked(state: State) -> State:
    """A state of its own, whose columns are of the right kinds and of one length; an error says what is not."""
    names = [text(name) for name in state["names"]]
    whole: State = {"scores": state["scores"], "data": dict(state["data"]), "over": state["over"]}
    whole["memories"] = {name: dict(memory) for name, memory in state.get("memories", {}).items()}
    whole["team_memories"] = {team: dict(memory) for team, memory in state.get("team_memories", ())}
    whole["chance"], whole["sensor_kinds"] = state.get("chance"), list(state.get("sensor_kinds", ()))
    state = dict.fromkeys(_MAY_LACK, np.zeros(len(names))) | state
    for name in LISTS:
        whole[name] = list(state[name])
    for name, (dtype, shape) in ARRAYS.items():
        whole[name] = np.array(state[name], dtype)
        if whole[name].shape != (len(names), *shape):
            raise Damaged(f"{shown(name)} has the shape {whole[name].shape}, with {len(names)} agents")
    shares(whole["edge_share"])
    lengths = {name: len(whole[name]) for name in LISTS}
    if set(lengths.values()) != {len(names)}:
        raise Damaged(f"its lists have different lengths: {lengths}")
    return whole


def text(name: Any) -> str:
    """The name of an agent.

    Raises:
        Damaged: it is no text.
    """
    if not isinstance(name, str):
        raise Damaged(f"{shown(name)} is no name of an agent")
    return name


def following_number(numbers: list[int], following: int) -> int:
    """The number that the next new agent gets.

    Raises:
        Damaged: one of the agents has a greater one, or it is not to be believed.
    """
    if not all(0 <= number < following for number in numbers) or not 0 <= following <= _MOST_AGENTS:
        raise Damaged(f"the next agent cannot get the number {following}")
    return following
