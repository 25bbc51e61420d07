"""Keyframes and snapshots of a state: columns of agents, and the game as plain values."""

from collections.abc import Iterable, Mapping
from itertools import chain
from math import isnan
from typing import Any

import numpy as np

from gamms.ir.agents import AgentBlock, list_speeds
from gamms.ir.events import LOGGED
from gamms.ir.game_state import FIELDS, GameState
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.progress import Motion, Progress
from gamms.ir.schema import AGENT_COLUMNS, BESIDE_AGENTS, ON_EDGES, PLACES, RECORDED_NUMBERS, VECTORS
from gamms.plain import Plain, select_plain, to_plain
from gamms.recorder.errors import Damaged
from gamms.text import shown
from gamms.typing.context import HostContext
from gamms.typing.game import find_strategy_name

Keyframe = dict[str, Any]
Columns = dict[str, Any]  # the columns of `LISTS` and `ARRAYS`

_WRITTEN = list(chain.from_iterable(column.parts or (column,) for column in AGENT_COLUMNS if column.is_recorded))
LISTS = [column.name for column in _WRITTEN if column.kind is None]
ARRAYS: dict[str, tuple[type, tuple[int, ...]]] = {  # dtype, and shape of a row
    column.name: (np.int64 if column.kind is np.bool_ else column.kind, column.shape)
    for column in _WRITTEN
    if column.kind is not None
}
_MOST_AGENTS = 1 << 24  # most agents in a recording


# -- writing ------------------------------------------------------------------------------------------------------


def capture_state(ctx: HostContext) -> Keyframe:
    """Return the present state of a context as a keyframe."""
    rows = ctx.agent.block
    described = ctx.sensor.storage.describe_sensors()
    groups = group_sensors(described)
    details = ctx.agent.storage.list_details()
    rows.locate()
    columns: Columns = rows.copy_columns(column.name for column in PLACES if column.is_recorded and not column.parts)
    columns |= rows.copy_columns(("names", "kind", "alive")) | list_columns_beside_agents(rows)
    columns |= make_progress_columns(rows, np.arange(len(rows)))
    columns["numbers"] = np.array(rows.journal.ids[: len(details)], np.int64)
    columns["alive"] = columns["alive"].astype(np.int64)
    columns["teams"] = to_plain(list(rows.teams))
    columns["speed"] = list_speeds(rows.games)
    carried = [{name: sensor.sensor_id for name, sensor in sensors.items()} for sensors, _, _ in details]
    columns["carried"] = _list_carried_sensors(carried, groups)
    columns["strategies"] = _find_names(list_deciders(ctx, [strategy for *_, strategy in details]))
    attributes = {row: select_plain(one) for row, one in ctx.agent.storage.get_attributes().items()}
    state = ctx.game.internals.state
    return _make_keyframe(columns, len(rows.journal.names), groups, attributes, state, ctx.rng_state())


def list_columns_beside_agents(rows: AgentBlock) -> Columns:
    """Return the recorded columns of teams (team -> numbers) and of the game, without initial values."""
    columns: Columns = {}
    for one in BESIDE_AGENTS:
        numbers = np.asarray(rows.games.get_row(one.name)).reshape(-1, *one.shape)
        if one.is_recorded and (numbers != one.initial).any():
            listed = numbers.tolist()
            columns[one.name] = (
                listed[0] if one.axis == "game" else to_plain(dict(zip(rows.team_rows, listed, strict=True)))
            )
    return columns


def get_columns_beside_agents(keyframe: Keyframe) -> Columns:
    """Return the columns of teams and of the game in a keyframe."""
    return {one.name: keyframe[one.name] for one in BESIDE_AGENTS if one.name in keyframe}


def restore_beside_agents(rows: AgentBlock, keyframe: Keyframe) -> None:
    """Set the columns of teams and of the game from a keyframe, or to their initial values.

    Raises:
        Damaged: a column has a wrong number of values, or invalid values.
    """
    for one in BESIDE_AGENTS:
        held = keyframe.get(one.name, {} if one.axis == "team" else one.initial)
        values = held if one.axis == "team" else {None: held}
        try:
            if one.axis == "team":
                rows.number_teams(values)
            numbers = np.asarray(rows.games.get_row(one.name)).reshape(-1, *one.shape)
            numbers[:] = one.initial
            for team, value in values.items():
                numbers[rows.team_rows[team] if one.axis == "team" else 0] = value
        except (AttributeError, TypeError, ValueError, OverflowError):
            raise Damaged(f"{shown(one.name)} has invalid numbers for a column of its kind: {shown(held)}") from None


def pack_keyframe(
    columns: Columns, following: int, sensors: list[dict[str, Any]], game: GameState, rng_state: Plain
) -> Keyframe:
    """Return a state in the compact form for writing.

    It has `came` instead of `previous`, and `carried` instead of the `sensors` of each agent.

    Args:
        columns: columns of the agents, and of teams and the game as in a keyframe.
        following: number of the next new agent.
        sensors: each with its `id`, `type` and `keywords`.
        game: state of the game.
        rng_state: state of the context's own random stream.
    """
    groups = group_sensors(sensors)
    attributes = {row: values for row, values in enumerate(columns["attributes"]) if values}
    copies = {name: columns[name].copy() for name in (*ARRAYS, *LISTS) if name in columns}
    copies |= {**get_columns_beside_agents(columns), "carried": _list_carried_sensors(columns["sensors"], groups)}
    return _make_keyframe(copies, following, groups, attributes, game, rng_state)


def _make_keyframe(
    columns: Columns, following: int, groups: list[dict[str, Any]], attributes: Plain, game: GameState, rng_state: Plain
) -> Keyframe:
    """Return a keyframe of these parts."""
    came = columns["previous"] - columns["node"]
    return {
        "names": columns["names"],
        "numbers": columns["numbers"],
        "next": following,
        "kind": columns["kind"],
        "node": columns["node"],
        "came": (came << 1) ^ (came >> 63),  # 0, -1, 1, -2 as 0, 1, 2, 3
        **{name: columns[name] for name in (*VECTORS, "alive")},
        **{name: columns[name] for name in _find_needed_columns(columns)},
        **{one.name: columns[one.name] for one in RECORDED_NUMBERS if (columns[one.name] != one.initial).any()},
        **{name: columns[name] for name in ("teams", "speed", "carried")},
        **get_columns_beside_agents(columns),
        "sensor_kinds": groups,
        "attributes": attributes,
        "strategies": columns["strategies"],
        **{
            name: captured(getattr(game, name))
            for name, captured in CAPTURED.items()
            if getattr(game, name) or not FIELDS[name].is_seldom
        },
        "chance": to_plain(rng_state),
    }


# -- the game -----------------------------------------------------------------------------------------------------


CAPTURED = {name: field.captured for name, field in FIELDS.items() if field.captured is not None}
"""Field of `GameState` -> function that returns its value for keyframes."""

_IN_ALL_KEYFRAMES = frozenset({"scores", "data", "over"})  # also in keyframes of the first recordings of version 3
_FIRST_GAME = {name: captured(getattr(GameState(), name)) for name, captured in CAPTURED.items()}


def restore_game(game: GameState, keyframe: Keyframe) -> None:
    """Set the fields of a game from a keyframe, or to initial values for fields that an older keyframe lacks.

    Raises:
        KeyError: a field that all keyframes have is missing.
    """
    for name, first in _FIRST_GAME.items():
        captured = keyframe[name] if name in _IN_ALL_KEYFRAMES else keyframe.get(name, first)
        game.put(name, FIELDS[name].restored(captured))


def make_history(ctx: HostContext) -> Keyframe:
    """Return data of snapshots that are too large for keyframes: events, facts, settings, starts."""
    game = ctx.game
    logs = {log: getattr(game.internals.state, log) for log in LOGGED.values()}
    return {
        **{log: to_plain(entries) for log, entries in logs.items() if entries or log == "events"},
        "settings": game.plain_settings(),
        **({"facts": select_plain(game.facts)} if game.facts else {}),
        **({"starts": to_plain(game.internals.starts)} if game.internals.starts else {}),
    }


def make_first_history(ctx: HostContext) -> Keyframe:
    """Return `make_history` for the beginning of a recording, without starts of agents that still exist."""
    first = make_history(ctx)
    if first.get("starts") == list_places(ctx):
        del first["starts"]
    return first


def list_places(ctx: HostContext) -> dict[str, Any]:
    """Return the positions of agents: nodes, or (x, y, z) for flying agents."""
    columns = ctx.agent.block
    nodes = columns.get_ids(columns.node)
    found: dict[str, Any] = dict(zip(columns.names, nodes, strict=True))
    for row in columns.flyers:
        found[columns.names[row]] = columns.flights.get_position(row)
    return found


def pack_components(ctx: HostContext) -> Keyframe:
    """Return the recorded components for a keyframe; after a snapshot they are recorded as events."""
    return {"components": to_plain(ctx.record.components.make_keyframe())}


def list_flyers(ctx: HostContext) -> dict[str, Any] | None:
    """Return the present and previous nodes below all flying agents; None without flying agents."""
    columns = ctx.agent.block
    columns.locate()
    if not columns.flyers:
        return None
    found: dict[str, Any] = {"names": [columns.names[row] for row in columns.flyers]}
    for name, node_of in {"node": columns.get_node, "previous": columns.get_previous_node}.items():
        found[name] = np.array([*map(node_of, columns.flyers)], np.int64)
    return found


def make_progress_columns(block: AgentBlock, rows: IntArray) -> Columns:
    """Return the progress of the agents in some rows along edges as columns; zeros for agents on nodes."""
    columns: dict[str, Any] = {name: np.zeros(len(rows), ARRAYS[name][0]) for name in ON_EDGES}
    shares = np.asarray(block.share)[rows]
    for place in np.flatnonzero(~np.isnan(shares)).tolist():
        for name, value in zip(ON_EDGES, block.get_progress(rows[place]) or (), strict=True):
            columns[name][place] = value
    return columns


def make_progress_event(block: AgentBlock, rows: IntArray) -> Columns:
    """Return `make_progress_columns` without columns that games which count edges do not need."""
    columns = make_progress_columns(block, rows)
    return {name: columns[name] for name in (ON_EDGES if columns["edge_motion"].any() else ON_EDGES[:3])}


def _find_needed_columns(columns: Columns) -> tuple[str, ...]:
    """Return the names of the progress columns that are not all zero."""
    if "edge_motion" not in columns:
        return ()
    if columns["edge_motion"].any():
        return ON_EDGES
    return ON_EDGES[:3] if columns["edge_share"].any() else ()


def group_sensors(described: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Group sensors that differ only by their ids; of several sensors with one id the first is kept."""
    groups: dict[str, dict[str, Any]] = {}
    firsts: dict[str, dict[str, Any]] = {}
    for one in described:
        firsts.setdefault(one["id"], one)
    places: dict[str, list[int]] = {}
    for at, one in enumerate(firsts.values()):
        keywords = select_plain(one["keywords"])
        key = repr((one["type"], keywords))
        group = groups.setdefault(key, {"type": one["type"], "keywords": keywords, "ids": []})
        group["ids"].append(one["id"])
        places.setdefault(key, []).append(at)
    # otherwise the order follows from the groups
    if list(chain.from_iterable(places.values())) != list(range(len(firsts))):
        for key, group in groups.items():
            group["at"] = places[key]
    return list(groups.values())


def list_deciders(ctx: HostContext, strategies: list[Any]) -> list[Any]:
    """Return the functions that decide for the agents: the plan of a team, or the agent's own strategy."""
    plans = ctx.game.plans
    if not plans:
        return strategies
    functions = {team: plan.function for team, plan in plans.items()}
    return list(map(functions.get, ctx.agent.block.teams, strategies))


def _find_names(functions: list[Any]) -> list[str | None]:
    keys = list(map(id, functions))
    names = {key: find_strategy_name(function) for key, function in dict(zip(keys, functions, strict=True)).items()}
    return list(map(names.__getitem__, keys))


def _list_carried_sensors(sensors: list[dict[str, str]], groups: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the sensors of agents, as indices in the list of all sensors, and names that differ from their ids."""
    names = list(chain.from_iterable(sensors))
    ids = list(chain.from_iterable(one.values() for one in sensors))
    place = {sensor["id"]: i for i, sensor in enumerate(list_sensors(groups))}
    others = [sensor_id for sensor_id in dict.fromkeys(ids) if sensor_id not in place]
    place |= {sensor_id: len(place) + i for i, sensor_id in enumerate(others)}
    return {
        "names": None if names == ids else names,
        "ids": np.array([place[sensor_id] for sensor_id in ids], np.int64),
        "others": others,
        "counts": np.array(list(map(len, sensors)), np.int64),
    }


# -- reading ------------------------------------------------------------------------------------------------------


def unpack_keyframe(keyframe: Keyframe) -> Columns:
    """Return the columns of agents of a keyframe in either form."""
    columns = {name: keyframe[name] for name in (*LISTS, *ARRAYS) if name in keyframe}
    if "came" not in keyframe:
        return columns
    came = keyframe["came"]
    carried = keyframe["carried"]
    columns["previous"] = keyframe["node"] + ((came >> 1) ^ -(came & 1))
    known = [*(sensor["id"] for sensor in list_sensors(keyframe.get("sensor_kinds", ()))), *carried["others"]]
    ids = [known[place] for place in carried["ids"].tolist()]
    ends = np.cumsum(carried["counts"]).tolist()
    pairs = list(zip(ids if carried["names"] is None else carried["names"], ids, strict=True))
    columns["sensors"] = [dict(pairs[start:end]) for start, end in zip([0, *ends], ends, strict=False)]
    if isinstance(attributes := keyframe["attributes"], dict):  # a list in the first recordings of version 3
        columns["attributes"] = [attributes.get(row, {}) for row in range(len(keyframe["names"]))]
    return columns


def check_columns(columns: Columns) -> Columns:
    """Return copies of the columns, with the right types and equal lengths.

    Raises:
        Damaged: the columns are invalid; other errors mean the same.
    """
    names = [check_name(name) for name in columns["names"]]
    columns = {
        one.name: np.full(len(names), one.initial, one.kind) for one in _WRITTEN if one.initial is not None
    } | columns
    whole: Columns = {name: list(columns[name]) for name in LISTS}
    for name, (dtype, shape) in ARRAYS.items():
        whole[name] = np.array(columns[name], dtype)
        if whole[name].shape != (len(names), *shape):
            raise Damaged(f"{shown(name)} has the shape {whole[name].shape}, with {len(names)} agents")
    check_shares(whole["edge_share"])
    check_motions(whole["edge_motion"])
    lengths = {name: len(whole[name]) for name in LISTS}
    if set(lengths.values()) != {len(names)}:
        raise Damaged(f"its lists have different lengths: {lengths}")
    return whole


def check_name(name: object) -> str:
    """Return the checked name of an agent.

    Raises:
        Damaged: not a text.
    """
    if not isinstance(name, str):
        raise Damaged(f"{shown(name)} is not the name of an agent")
    return name


def check_following(numbers: list[int], following: int) -> int:
    """Return the checked number of the next new agent.

    Raises:
        Damaged: an agent has a greater number, or the number is too large.
    """
    is_number = type(following) is int and 0 <= following <= _MOST_AGENTS
    if not is_number or not all(0 <= number < following for number in numbers):
        raise Damaged(f"the next agent cannot get the number {shown(following)}")
    return following


def check_shares(values: Plain) -> FloatArray:
    """Return the checked shares of edges that agents have covered, (agents,).

    Raises:
        Damaged: a share is not between 0 and 1.
    """
    found: FloatArray = np.asarray(values, np.float64)
    if not ((found >= 0.0) & (found < 1.0)).all():
        raise Damaged("an agent has covered a share of its edge that is not between 0 and 1")
    return found


def check_motions(values: object) -> IntArray:
    """Return the checked motions of agents on edges, (agents,), as numbers of `ir.progress.Motion`.

    Raises:
        Damaged: a number is not a motion.
    """
    found: IntArray = np.asarray(values, np.int64)
    if not ((found >= 0) & (found < len(Motion))).all():
        raise Damaged("an agent has an unknown motion on its edge")
    return found


def make_progress(source: int, target: int, share: float, edge: int = 0, motion: int = 0) -> Progress | None:
    """Return the checked progress of an agent along an edge; None on a node.

    Raises:
        Damaged: the share is not between 0 and 1, or the motion is unknown.
    """
    covered = float(check_shares(share))
    if not covered:
        return None
    return Progress(int(source), int(target), covered, int(edge), int(check_motions(motion)))


def list_sensors(groups: Iterable[Mapping[str, Plain]]) -> list[dict[str, Any]]:
    """Return the sensors in groups of `group_sensors`, one by one."""
    groups = list(groups)
    found: list[dict[str, Any]] = []
    places: list[int] = []
    for group in groups:
        found += [{"id": one, "type": group["type"], "keywords": group["keywords"]} for one in group["ids"]]
        places += map(int, group.get("at", ()))
    if not places:
        return found
    if len(places) != len(found):
        raise Damaged(f"{len(found)} sensors have {len(places)} places in their order")
    return [found[row] for row in sorted(range(len(found)), key=places.__getitem__)]


def get_row(columns: Columns, row: int) -> dict[str, Any]:
    """Return the position of an agent in the form of the columns of a live context."""
    return {
        "node": int(columns["node"][row]),
        "previous": int(columns["previous"][row]),
        **{name: None if isnan(columns[name][row][0]) else tuple(columns[name][row].tolist()) for name in VECTORS},
        **{one.name: one.check_value(columns[one.name][row].item(), one.name) for one in RECORDED_NUMBERS},
        "progress": make_progress(*(columns[name][row] for name in ON_EDGES)),
    }
