"""The data format of pages and streams: the map, and parts with the columns of one or many turns.

A part has columns for all its turns, for example the nodes of all agents; values that rarely change are stored as lists
of changes. `docs/page-format.md` describes the format. `painter.py` makes the turns.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from gamms.graph.map_file import MAGIC as MAP_MAGIC
from gamms.graph.map_file import VERSION, load_scenery, pack_base_map, unframe_file
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.packing import to_bytes
from gamms.ir.scenery import find_ground
from gamms.plain import Plain
from gamms.web.knowledge import SensedTurn

MAGIC = b"GAMMSPLY"
# bits of the status of an agent
THERE = 1
ALIVE = 2
FLIES = 4
_SHARES = 1 << 16  # parts of an edge
_TURN = 256  # headings: parts of a full rotation
_STEPS = 1 << 18  # coordinates: parts of the larger side of the map, some millimetres for a town
_LAT_LON_STEP = 2.0**-23  # degrees, about a centimetre
_READ = (
    *("crs", "attribution", "node_ids", "sources", "targets", "bend_rows", "bend_sizes", "face_types"),
    *("node_attributes", "edge_attributes"),
)

Change = tuple[str, bytes]
"""The name of a slot, and the bytes of its new value."""
Fact = tuple[str, str, str, str | None]
"""An agent, a heading, a key, and the new text; None: the fact no longer holds."""


class AgentsOnEdges(NamedTuple):
    """The agents on the ground that are between two nodes."""

    agents: IntArray  # (agents,) rows
    ends: IntArray  # (agents, 2) rows of the source and the target of the edge
    shares: FloatArray  # (agents,) the covered share of the edge, from 0 to 1


class FlyingAgents(NamedTuple):
    """The flying agents that have a position."""

    agents: IntArray  # (agents,) rows
    places: FloatArray  # (agents, 3) x, y and z, map units
    headings: FloatArray  # (agents,) radians; NaN: straight up or down


class Turn(NamedTuple):
    """The state after a turn, and the events in it.

    Attributes:
        names: the names of the agents, in the order of the other columns.
        status: (agents,) sums of `THERE`, `ALIVE` and `FLIES`.
        nodes: (agents,) rows of the agents' nodes, or of the nodes below flying agents; -1: not on this map.
        sides: the side of each agent: its team as text, or its name.
        on_edges: the agents between two nodes.
        in_air: the flying agents.
        ways: row of an agent -> rows of the nodes that it passed, unless it moved directly from one node to the next;
            an empty list: it was placed on its node without travel.
        named: row of an agent -> row of the edge that its action has named, by which it came to its node; -1: the edge
            is not on this map.
        messages: sender, receiver, and the fate: 0 heard next turn, 1 overheard, 2 lost; 3 for a message that no agent
            is known to hear, which has no receiver.
        changes: changed slots.
        facts: changed facts about agents.
        captions: sentences about the events.
        sensed: the sensor reports at the beginning of the turn; None: there were none.
    """

    names: Sequence[str]
    status: IntArray
    nodes: IntArray
    sides: Sequence[str]
    on_edges: AgentsOnEdges
    in_air: FlyingAgents
    ways: Mapping[int, Sequence[int]]
    named: Mapping[int, int]
    messages: Sequence[tuple[str, str | None, int]]
    changes: Sequence[Change]
    facts: Sequence[Fact]
    captions: Sequence[Mapping[str, Plain]]
    sensed: SensedTurn | None


def frame(value: Plain) -> bytes:
    """Encode a header or a part, and put its size in front."""
    body = to_bytes(value, "A part of a page")
    return len(body).to_bytes(4, "little") + body


def make_part(
    first: int,
    turns: Sequence[Turn],
    step: float,
    *,
    is_whole: bool = False,
    rest: SensedTurn | None = None,
    is_early: bool = False,
) -> dict[str, Plain]:
    """Return turns as a part, a plain value.

    Args:
        first: the number of the first turn.
        turns: the turns, at least one.
        step: the unit of positions, map units.
        is_whole: whether the part contains all slots and facts, so that no earlier part is needed.
        rest: the sensor reports after the last turn, as far as known.
        is_early: whether `rest` reports what was sensed before the last turn; only its fields of view are up to date.
    """
    names = list(dict.fromkeys(chain.from_iterable(turn.names for turn in turns)))
    row_of = {name: row for row, name in enumerate(names)}
    rows = [np.array([row_of[name] for name in turn.names], np.int64) for turn in turns]
    captions = list[Plain]()
    changes = list[Plain]()
    facts = list[Plain]()
    for at, turn in enumerate(turns):
        captions += [{**caption, "turn": at} for caption in turn.captions]
        for change in turn.changes:
            changes += (at, *change)
        for name, *fact in turn.facts:
            facts += (at, row_of.get(name, name), *fact)
    body: dict[str, Plain] = {
        **_make_state_columns(turns, rows, len(names)),
        "on_edges": _join_sparse_columns(turns, rows, _find_agents_on_edges),
        "in_air": _join_sparse_columns(turns, rows, lambda turn: _find_agents_in_air(turn, step)),
        "ways": _make_way_columns(turns, rows),
        "messages": _make_message_columns(turns, row_of),
        "captions": captions,
    }
    if any(turn.named for turn in turns):
        body["named_edges"] = _make_named_edge_columns(turns, rows)
    sensed = [turn.sensed for turn in turns] + [rest]
    if any(one is not None for one in sensed):
        body |= _make_sensor_columns(sensed, row_of) | {"is_early": is_early}
    return {
        "first": first,
        "step": step,
        "turns": len(turns),
        "is_whole": is_whole,
        "agents": names,
        "changes": changes,
        "facts": facts,
        "columns": to_bytes(body, "A part of a page"),
    }


def _make_state_columns(turns: Sequence[Turn], rows: list[IntArray], agents: int) -> dict[str, Plain]:
    """Return the columns of all agents, (agents, turns): neighboring values differ little, which compresses well."""
    status = np.zeros((agents, len(turns)), np.uint8)
    nodes = np.full((agents, len(turns)), -1, np.int64)
    sides = np.zeros((agents, len(turns)), np.int64)
    texts: dict[str, int] = {}
    for at, (turn, row) in enumerate(zip(turns, rows, strict=True)):
        status[row, at] = turn.status
        nodes[row, at] = turn.nodes
        sides[row, at] = [texts.setdefault(side, len(texts)) for side in turn.sides]
    return {"status": status, "nodes": narrow(nodes), "side": narrow(sides), "sides": list(texts)}


def _join_sparse_columns(
    turns: Sequence[Turn], rows: list[IntArray], columns_of: Callable[[Turn], tuple[IntArray, dict[str, Any]]]
) -> dict[str, Plain]:
    """Return sparse columns: `at`, the indices in a flattened column (agents, turns), and the items there."""
    found = [columns_of(turn) for turn in turns]
    at = np.concatenate(
        [row[agents] * len(turns) + i for i, (row, (agents, _)) in enumerate(zip(rows, found, strict=True))]
    )
    order = np.argsort(at, kind="stable")
    keys = found[0][1].keys()
    columns = {key: np.concatenate([items[key] for _, items in found])[order] for key in keys}
    return {"at": narrow(at[order]), **{key: narrow(column) for key, column in columns.items()}}


def _find_agents_on_edges(turn: Turn) -> tuple[IntArray, dict[str, Any]]:
    agents, ends, shares = turn.on_edges
    numbers = np.rint(np.asarray(shares) * _SHARES).astype(np.int64)
    return agents, {"from": ends[:, 0], "to": ends[:, 1], "share": numbers}


def _find_agents_in_air(turn: Turn, step: float) -> tuple[IntArray, dict[str, Any]]:
    agents, places, headings = turn.in_air
    counted = np.rint(places / step).astype(np.int64)
    turned = np.rint(np.nan_to_num(headings) / (2.0 * np.pi) * _TURN).astype(np.int64) % _TURN
    return agents, {
        **{axis: counted[:, i] for i, axis in enumerate("xyz")},
        "heading": np.where(np.isnan(headings), -1, turned),
    }


def _make_way_columns(turns: Sequence[Turn], rows: list[IntArray]) -> dict[str, Plain]:
    """Return the paths in `Turn.ways` as columns: `at`, see `_join_sparse_columns`, counts of nodes, and nodes."""
    found = dict[int, Sequence[int]]()
    for at, (turn, row) in enumerate(zip(turns, rows, strict=True)):
        found |= {int(row[agent]) * len(turns) + at: way for agent, way in turn.ways.items()}
    ordered = dict(sorted(found.items()))
    nodes = list(chain.from_iterable(ordered.values()))
    return {
        "at": narrow(list(ordered)),
        "counts": narrow([len(way) for way in ordered.values()]),
        "nodes": narrow(nodes),
    }


def _make_named_edge_columns(turns: Sequence[Turn], rows: list[IntArray]) -> dict[str, Plain]:
    """Return the edges in `Turn.named` as columns: `at`, see `_join_sparse_columns`, and the edges."""
    found = dict[int, int]()
    for at, (turn, row) in enumerate(zip(turns, rows, strict=True)):
        found |= {int(row[agent]) * len(turns) + at: edge for agent, edge in turn.named.items() if edge >= 0}
    ordered = dict(sorted(found.items()))
    return {"at": narrow(list(ordered)), "edges": narrow(list(ordered.values()))}


def _make_message_columns(turns: Sequence[Turn], row_of: Mapping[str, int]) -> "np.ndarray[Any, Any]":
    """Return the messages, (4, messages): turn in the part, row of the sender, row of the receiver, and fate."""
    found = list[tuple[int, int, int, int]]()
    for at, turn in enumerate(turns):
        for sender, receiver, fate in turn.messages:
            if receiver is None or receiver in row_of:
                found.append((at, row_of.get(sender, -1), -1 if receiver is None else row_of[receiver], fate))
    return narrow(np.array(found, np.int64).reshape(-1, 4).T)


def _make_sensor_columns(sensed: Sequence[SensedTurn | None], row_of: Mapping[str, int]) -> dict[str, Plain]:
    """Return the columns of sensor reports: at the beginning of each turn, and after the last one."""
    found = [one for one in sensed if one is not None]
    shapes: dict[int, int] = {}
    kept: list[Plain] = []
    sensors: dict[tuple[str, str], int] = {}
    looks: list[tuple[int, ...]] = []
    words: dict[int, str] = {}
    for one in found:
        for look in one.looks:
            shape = -1
            if look.shape is not None:
                shape = shapes.setdefault(id(look.shape), len(shapes))
                if shape == len(kept):
                    kept.append([look.shape.is_carried, narrow(look.shape.corners), look.shape.is_blocked])
            if look.words is not None:
                words[len(looks)] = look.words
            sensor = sensors.setdefault((look.sensor, look.kind), len(sensors))
            sizes = len(look.seen.nodes), len(look.seen.edges), len(look.seen.agents)
            looks.append((row_of.get(look.agent, -1), sensor, shape, *sizes))
    every = list(chain.from_iterable(one.looks for one in found))
    sides = dict.fromkeys(chain.from_iterable(one.sides for one in found))
    agents = chain.from_iterable(look.seen.agents for look in every)
    pairs = [(row_of.get(name, -1), node) for name, node in agents]
    return {
        "looked": narrow([-1 if one is None else len(one.looks) for one in sensed]),
        "sensors": [list(sensor) for sensor in sensors],
        "shapes": kept,
        "looks": narrow(np.array(looks, np.int64).reshape(-1, 6).T),
        "seen_nodes": _concatenate([look.seen.nodes for look in every]),
        "seen_edges": _concatenate([look.seen.edges for look in every]),
        "seen_agents": narrow(np.array(pairs, np.int64).reshape(-1, 2).T),
        "words": words,
        "sights": {side: _make_sight_columns(side, sensed, row_of) for side in sides},
    }


def _make_sight_columns(side: str, sensed: Sequence[SensedTurn | None], row_of: Mapping[str, int]) -> dict[str, Plain]:
    """Return the columns of a side's knowledge: the nodes whose visibility changes in each turn, and visible agents."""
    before = np.zeros(0, np.int64)
    changed = list[IntArray]()
    agents = list[list[int]]()
    for one in sensed:
        sight = None if one is None else one.sides.get(side)
        now = before if sight is None else sight.nodes
        changed.append(np.setxor1d(before, now, assume_unique=True))
        agents.append([] if sight is None else [row_of[name] for name in sight.agents if name in row_of])
        before = now
    return {
        "node_counts": narrow([len(part) for part in changed]),
        "nodes": _concatenate(changed),
        "agent_counts": narrow([len(part) for part in agents]),
        "agents": narrow(list(chain.from_iterable(agents))),
    }


def _concatenate(parts: Sequence[IntArray]) -> "np.ndarray[Any, Any]":
    return narrow(np.concatenate([np.zeros(0, np.int64), *parts]))


# -- the map ------------------------------------------------------------------------------------------------------


def encode_drawn_map(
    world: bytes, attributes: Collection[str] | None = None, lat_lon: "np.ndarray[Any, Any] | None" = None
) -> bytes:
    """Encode the drawn parts of a map, with its scenery.

    Args:
        world: the bytes of a saved map.
        attributes: the attributes of nodes and edges to include; None: all.
        lat_lon: (nodes, 2) the coordinates of nodes in degrees, to be included; rounded to a centimetre.
    """
    state = unframe_file(world, MAP_MAGIC, VERSION)
    base = state["base_map"] if "base_map" in state else pack_base_map(load_scenery(state.get("scenery")))
    if len(state["face_ids"]):  # obstacles are drawn instead of buildings
        base = base | {name: base[name][:0] for name in ("face_types", "face_corners")}
    step = _find_step(state["xy"])
    drawn: dict[str, Any] = {name: state[name] for name in _READ}
    drawn |= {"step": step, "base_map": {name: base[name] for name in ("kinds", "sizes", "face_types")}}
    for of, name, width in (
        (state, "xy", 2),
        (state, "bend_points", 2),
        (state, "face_corners", 3),
        (base, "points", 2),
        (base, "face_corners", 3),
    ):
        to = drawn if of is state else drawn["base_map"]
        to[name] = convert_to_steps(of[name].reshape(-1, width), step)
    walls = (state if len(state["face_ids"]) else base)["face_corners"].reshape(-1, 3)[:, :2]
    ground = find_ground(base["points"].reshape(-1, 2), state["xy"], state["bend_points"].reshape(-1, 2), walls)
    drawn["base_map"]["ground"] = convert_to_steps(ground, step)
    if attributes is not None:
        drawn |= {kind: _select_attributes(state[kind], attributes) for kind in ("node_attributes", "edge_attributes")}
    if lat_lon is not None:
        drawn["lat_lon"] = np.round(lat_lon / _LAT_LON_STEP) * _LAT_LON_STEP
    return to_bytes(drawn, "A map")


def convert_to_steps(points: FloatArray, step: float) -> "np.ndarray[Any, Any]":
    """Convert points (points, axes) to integer multiples of `step`, (axes, points); along lines they compress well."""
    return narrow(np.rint(points.T / step).astype(np.int64))


def narrow(numbers: "Sequence[int] | np.ndarray[Any, Any]") -> "np.ndarray[Any, Any]":
    """Convert integers to the smallest signed type that holds all of them."""
    wide = np.asarray(numbers, np.int64)
    low, high = (int(wide.min()), int(wide.max())) if wide.size else (0, 0)
    return wide.astype(np.promote_types(np.min_scalar_type(min(low, -1)), np.min_scalar_type(-1 - max(high, 0))))


def _select_attributes(attributes: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    return {name: column for name, column in attributes.items() if name in names}


def _find_step(xy: "np.ndarray[Any, Any]") -> float:
    """Return the step to which coordinates are rounded, in map units: a power of two."""
    extent = float(np.ptp(xy, axis=0).max()) if len(xy) else 0.0
    return float(2.0 ** np.floor(np.log2(extent / _STEPS))) if extent > 0.0 else 2.0**-32
