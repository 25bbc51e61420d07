"""The whole state of a context as plain values and arrays, and back again."""

from copy import deepcopy
from math import isnan
from typing import Any

import numpy as np

from gamms.ir.agents import Progress
from gamms.ir.graph import FloatArray, IntArray
from gamms.plain import plain_subset, to_plain
from gamms.recorder import game_state
from gamms.recorder.errors import Damaged

State = dict[str, Any]

_NOT = float("nan")  # stands for None in a column of floats


def captured(ctx: Any) -> State:
    """Agents, scores and data of a context, as a keyframe holds them."""
    columns, agents = ctx.agent.block, list(ctx.agent.agents.values())
    columns.locate()
    sensors = grouped(ctx.sensor.described())
    return {
        "names": list(columns.names),
        "numbers": np.array(columns.journal.ids[: len(agents)], np.int64),
        "next": len(columns.journal.names),
        "kind": np.array(columns.kind, np.int64),
        "node": np.array(columns.node, np.int64),
        "came": _folded(np.array(columns.previous, np.int64) - np.array(columns.node, np.int64)),
        "heading": _floats(columns.heading, 2),
        "position": _floats(columns.position, 3),
        "previous_position": _floats(columns.previous_position, 3),
        "quat": _floats(columns.quat, 4),
        "alive": np.array(columns.alive, np.int64),
        **(progress_of(columns.progress) if any(columns.progress) else {}),
        "teams": [to_plain(team) for team in columns.teams],
        "speed": [to_plain(speed) for speed in columns.speed],
        "carried": _carried(agents, sensors),
        "sensor_kinds": sensors,
        "attributes": {row: plain_subset(vars(agent)) for row, agent in enumerate(agents) if vars(agent)},
        "strategies": [name_of(decider_of(ctx, agent)) for agent in agents],
        **game_state.captured(ctx),
    }


def progress_of(progress: list[Progress | None]) -> State:
    """How far along edges some agents are, as columns; zeros where an agent is on no edge."""
    sources, targets, shares = zip(*(one or (0, 0, 0.0) for one in progress), strict=True)
    return {
        "edge_source": np.array(sources, np.int64),
        "edge_target": np.array(targets, np.int64),
        "edge_share": np.array(shares, np.float64),
    }


def progress_from(columns: State, row: int) -> Progress | None:
    """The inverse of `progress_of`, for one agent; None where there are no such columns.

    Raises:
        Damaged: it has covered less than nothing, or all, of the edge it is on.
    """
    if "edge_share" not in columns or columns["edge_share"][row] == 0.0:
        return None
    (share,) = shares(columns["edge_share"][row : row + 1]).tolist()
    return Progress(int(columns["edge_source"][row]), int(columns["edge_target"][row]), share)


def shares(values: Any) -> FloatArray:
    """How much of their edges agents have covered, (agents,).

    Raises:
        Damaged: one of them less than nothing, or all.
    """
    found: FloatArray = np.asarray(values, np.float64)
    if not ((found >= 0.0) & (found < 1.0)).all():
        raise Damaged("an agent has covered less than nothing, or all, of the edge it is on")
    return found


def opened(state: State) -> State:
    """A state with columns that are easy to use, whether or not it was `captured` in a form that is short to write.

    It then has `previous` instead of `came`, and `sensors` of each agent (name -> id) instead of `carried`.
    """
    if "came" not in state:
        return state
    whole = {key: value for key, value in state.items() if key not in ("came", "carried")}
    came = state["came"]
    whole["previous"] = state["node"] + ((came >> 1) ^ -(came & 1))
    known = [*(sensor["id"] for sensor in sensors_of(state)), *state["carried"]["others"]]
    ids = [known[place] for place in state["carried"]["ids"].tolist()]
    names = state["carried"]["names"]
    ends = np.cumsum(state["carried"]["counts"]).tolist()
    pairs = list(zip(ids if names is None else names, ids, strict=True))
    attributes = state["attributes"]
    if isinstance(attributes, dict):  # in the first recordings of version 3 it is a list
        whole["attributes"] = [attributes.get(row, {}) for row in range(len(state["names"]))]
    whole["sensors"] = [dict(pairs[start:end]) for start, end in zip([0, *ends], ends, strict=False)]
    return whole


def sensors_of(state: State) -> list[dict[str, Any]]:
    """What `ctx.sensor.described` told."""
    return [
        {"id": sensor_id, "type": group["type"], "keywords": group["keywords"]}
        for group in state.get("sensor_kinds", ())
        for sensor_id in group["ids"]
    ]


def _folded(numbers: IntArray) -> IntArray:
    """Small numbers of either sign as small ones without: 0, -1, 1, -2 as 0, 1, 2, 3."""
    folded: IntArray = (numbers << 1) ^ (numbers >> 63)
    return folded


def _carried(agents: list[Any], groups: list[dict[str, Any]]) -> dict[str, Any]:
    """Which sensors agents carry, as places in the list of all of them, and under which names, unless by their ids."""
    names = [name for agent in agents for name in agent.sensors]
    ids = [sensor.sensor_id for agent in agents for sensor in agent.sensors.values()]
    place = {sensor_id: i for i, sensor_id in enumerate(one for group in groups for one in group["ids"])}
    others = [sensor_id for sensor_id in dict.fromkeys(ids) if sensor_id not in place]
    place |= {sensor_id: len(place) + i for i, sensor_id in enumerate(others)}
    return {
        "names": None if names == ids else names,
        "ids": np.array([place[sensor_id] for sensor_id in ids], np.int64),
        "others": others,
        "counts": np.array([len(agent.sensors) for agent in agents], np.int64),
    }


def grouped(described: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Sensors that differ by their ids alone, together."""
    groups: dict[str, dict[str, Any]] = {}
    for one in described:
        keywords = plain_subset(one["keywords"])
        group = groups.setdefault(repr((one["type"], keywords)), {"type": one["type"], "keywords": keywords, "ids": []})
        group["ids"].append(one["id"])
    return list(groups.values())


def of_components(ctx: Any) -> State:
    """The user's recorded objects, which keyframes have; a snapshot is followed by events that tell them."""
    return {"components": to_plain(ctx.record.components.told())}


def put(ctx: Any, state: State) -> None:
    """Set what a snapshot says: agents of the same name and kind are moved, missing ones made, others left alone.

    The writer of moves is to be trusting: agents may be on nodes that were taken away under their feet.
    """
    make_sensors(ctx, state)
    state = opened(state)
    for row, name in enumerate(state["names"]):
        flies, node = bool(state["kind"][row]), int(state["node"][row])
        agent = ctx.agent.agents.get(name)
        if agent is None or bool(agent.type) != flies:
            if agent is not None:
                ctx.agent.delete_agent(name)
            given: dict[str, Any] = {"start_node_id": node, "sensors": state["sensors"][row]}
            if flies:
                given |= {"type": 1, "speed": state["speed"][row]}
            agent = ctx.agent.create_agent(name, **given)
        _equip(ctx, agent, state["sensors"][row])
        for key, value in state["attributes"][row].items():
            agent.__dict__[key] = deepcopy(value)
        agent.team, agent.alive = state["teams"][row], bool(state["alive"][row])
        if not flies:
            agent.speed = state["speed"][row]
        ctx.agent.block.write(ctx.agent.block.row_of(name), _row_of(state, row))
    game_state.put(ctx, state)


def make_sensors(ctx: Any, state: State) -> None:
    """Make the sensors that there are not yet."""
    for sensor in sensors_of(state):
        if sensor["id"] not in ctx.sensor.sensors:
            ctx.sensor.make(sensor)


def above(ctx: Any) -> State | None:
    """Which nodes are and were below all who fly, which follows from the map; None if nobody does."""
    columns = ctx.agent.block
    columns.locate()
    if not columns.flyers:
        return None
    found: State = {"names": [columns.names[row] for row in columns.flyers]}
    for name in ("node", "previous"):
        column = getattr(columns, name)
        found[name] = np.array([column[row] for row in columns.flyers], np.int64)
    return found


def _equip(ctx: Any, agent: Any, sensors: dict[str, str]) -> None:
    """Let an agent carry these sensors, as far as there are such."""
    there = {name: sensor_id for name, sensor_id in sensors.items() if sensor_id in ctx.sensor.sensors}
    if list(there.items()) != [(name, sensor.sensor_id) for name, sensor in agent.sensors.items()]:
        for name in list(agent.sensors):
            agent.deregister_sensor(name)
        for name, sensor_id in there.items():
            agent.register_sensor(name, ctx.sensor.get_sensor(sensor_id))


def _row_of(state: State, row: int) -> dict[str, Any]:
    """The columns that say where an agent is, of one row, as the agents' columns hold them."""
    return {
        "node": int(state["node"][row]),
        "previous": int(state["previous"][row]),
        "heading": _tuple(state["heading"][row]),
        "position": _tuple(state["position"][row]),
        "previous_position": _tuple(state["previous_position"][row]),
        "quat": _tuple(state["quat"][row]),
        "progress": progress_from(state, row),
    }


def decider_of(ctx: Any, agent: Any) -> Any:
    """Return the function that decides for an agent: the plan of its team, its own strategy, or None."""
    plan = ctx.game.plans.get(agent.team)
    return agent.strategy if plan is None else plan.function


def name_of(strategy: Any) -> str | None:
    """What a strategy is called: the module and the name in it."""
    if strategy is None:
        return None
    return f"{getattr(strategy, '__module__', '?')}:{getattr(strategy, '__qualname__', type(strategy).__qualname__)}"


def _floats(values: list[Any], width: int) -> FloatArray:
    rows = [(_NOT,) * width if value is None else value for value in values]
    return np.array(rows, np.float64).reshape(-1, width)


def _tuple(row: FloatArray) -> tuple[float, ...] | None:
    values = tuple(row.tolist())
    return None if isnan(values[0]) else values
