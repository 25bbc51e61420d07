"""What a page or a stream holds of a game, as columns: the map, and turns in parts of one or many.

A part has a column for the agents of all its turns, one for the nodes that they are on, and so on; what changes
seldom is a list of changes. `docs/page-format.md` describes them. `painter.py` makes the turns.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from gamms.graph.map_file import MAGIC as MAP_MAGIC
from gamms.graph.map_file import VERSION, base_map_of, scenery_called, unframed
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.packing import to_bytes
from gamms.plain import Plain
from gamms.web.knowledge import SensedTurn

MAGIC = b"GAMMSPLY"
THERE, ALIVE, FLIES = 1, 2, 4  # bits of the status of an agent
_SHARES = 1 << 16  # parts of an edge
_TURN = 256  # parts of a full turn
_STEPS = 1 << 18  # in which coordinates are rounded, of the larger side of the map: a town to some millimetres
_LAT_LON_STEP = 2.0**-23  # degrees: a centimetre
_READ = (
    *("crs", "attribution", "node_ids", "sources", "targets", "bend_rows", "bend_sizes", "face_types"),
    *("node_attributes", "edge_attributes"),
)

Change = tuple[str, bytes]
"""A slot, and the bytes of the value that it has from a turn on."""
Fact = tuple[str, str, str, str | None]
"""An agent, a heading, and the words from a turn on for a key below it; None: it is not so any more."""


class OnEdges(NamedTuple):
    """Agents on the ground that have covered a share of an edge."""

    agents: IntArray  # (agents,) rows
    ends: IntArray  # (agents, 2) rows of the nodes that the edge leads from and to
    shares: FloatArray  # (agents,)


class InAir(NamedTuple):
    """Agents in the air that have a position."""

    agents: IntArray  # (agents,) rows
    places: FloatArray  # (agents, 3)
    headings: FloatArray  # (agents,) radians; NaN: straight up or down


class Turn(NamedTuple):
    """How a turn has ended, and what happened in it.

    Attributes:
        names: of the agents, which the other columns follow.
        status: bits.
        nodes: rows of the nodes that they are on, or above; -1: on none of this map.
        sides: the texts of their teams, or their own names.
        on_edges: those that are between nodes.
        in_air: those that fly.
        ways: row of an agent -> the rows of the nodes that it passed, where it did not simply go from its node to the
            next one; none: it did not travel.
        messages: sender, receiver, and 0 where it is heard next, 1 where it is overheard, 2 where it was lost.
        changes: of slots.
        facts: about agents.
        captions: what happened.
        sensed: what was sensed at its beginning; None: nothing.
    """

    names: Sequence[str]
    status: IntArray
    nodes: IntArray
    sides: Sequence[str]
    on_edges: OnEdges
    in_air: InAir
    ways: Mapping[int, Sequence[int]]
    messages: Sequence[tuple[str, str, int]]
    changes: Sequence[Change]
    facts: Sequence[Fact]
    captions: Sequence[Mapping[str, Plain]]
    sensed: SensedTurn | None


def frame(value: Plain) -> bytes:
    """Return a header or a part with its size before it."""
    body = to_bytes(value, "A part of a page")
    return len(body).to_bytes(4, "little") + body


def part_of(
    first: int, turns: Sequence[Turn], step: float, *, is_whole: bool = False, rest: SensedTurn | None = None
) -> dict[str, Plain]:
    """Return turns as a part.

    Args:
        first: the number of the first of them.
        turns: one at least.
        step: positions are counted in it.
        is_whole: whether nothing before the part is needed: it has all slots and facts.
        rest: what is known to be sensed behind the last of the turns.
    """
    names = list(dict.fromkeys(chain.from_iterable(turn.names for turn in turns)))
    row_of = {name: row for row, name in enumerate(names)}
    rows = [np.array([row_of[name] for name in turn.names], np.int64) for turn in turns]
    body: dict[str, Plain] = {
        **_states(turns, rows, len(names)),
        "on_edges": _joined(turns, rows, _on_edges),
        "in_air": _joined(turns, rows, lambda turn: _in_air(turn, step)),
        "ways": _ways(turns, rows),
        "messages": _messages(turns, row_of),
        "captions": [{**caption, "turn": at} for at, turn in enumerate(turns) for caption in turn.captions],
    }
    sensed = [turn.sensed for turn in turns] + [rest]
    if any(one is not None for one in sensed):
        body |= _sensed(sensed, row_of)
    return {
        "first": first,
        "step": step,
        "turns": len(turns),
        "is_whole": is_whole,
        "agents": names,
        "changes": [one for at, turn in enumerate(turns) for change in turn.changes for one in (at, *change)],
        "facts": [
            one
            for at, turn in enumerate(turns)
            for name, *fact in turn.facts
            for one in (at, row_of.get(name, name), *fact)
        ],
        "columns": to_bytes(body, "A part of a page"),
    }


def _states(turns: Sequence[Turn], rows: list[IntArray], agents: int) -> dict[str, Plain]:
    """Return the columns of all agents, (agents, turns): so changes from turn to turn are small."""
    status = np.zeros((agents, len(turns)), np.uint8)
    nodes = np.full((agents, len(turns)), -1, np.int64)
    sides = np.zeros((agents, len(turns)), np.int64)
    texts: dict[str, int] = {}
    for at, (turn, row) in enumerate(zip(turns, rows, strict=True)):
        status[row, at] = turn.status
        nodes[row, at] = turn.nodes
        sides[row, at] = [texts.setdefault(side, len(texts)) for side in turn.sides]
    return {"status": status, "nodes": narrow(nodes), "side": narrow(sides), "sides": list(texts)}


def _joined(
    turns: Sequence[Turn], rows: list[IntArray], columns_of: Callable[[Turn], tuple[IntArray, dict[str, Any]]]
) -> dict[str, Plain]:
    """Return what some agents have in some turns: `at`, the places of their items in a column of all, and the items."""
    found = [columns_of(turn) for turn in turns]
    at = np.concatenate(
        [row[agents] * len(turns) + i for i, (row, (agents, _)) in enumerate(zip(rows, found, strict=True))]
    )
    order = np.argsort(at, kind="stable")
    keys = found[0][1].keys()
    columns = {key: np.concatenate([items[key] for _, items in found])[order] for key in keys}
    return {"at": narrow(at[order]), **{key: narrow(column) for key, column in columns.items()}}


def _on_edges(turn: Turn) -> tuple[IntArray, dict[str, Any]]:
    agents, ends, shares = turn.on_edges
    numbers = np.rint(np.asarray(shares) * _SHARES).astype(np.int64)
    return agents, {"from": ends[:, 0], "to": ends[:, 1], "share": numbers}


def _in_air(turn: Turn, step: float) -> tuple[IntArray, dict[str, Any]]:
    agents, places, headings = turn.in_air
    counted = np.rint(places / step).astype(np.int64)
    turned = np.rint(np.nan_to_num(headings) / (2.0 * np.pi) * _TURN).astype(np.int64) % _TURN
    return agents, {
        **{axis: counted[:, i] for i, axis in enumerate("xyz")},
        "heading": np.where(np.isnan(headings), -1, turned),
    }


def _ways(turns: Sequence[Turn], rows: list[IntArray]) -> dict[str, Plain]:
    """Return the ways that are not simply from node to node."""
    found = {
        int(row[agent]) * len(turns) + at: way
        for at, (turn, row) in enumerate(zip(turns, rows, strict=True))
        for agent, way in turn.ways.items()
    }
    ordered = dict(sorted(found.items()))
    nodes = list(chain.from_iterable(ordered.values()))
    return {
        "at": narrow(list(ordered)),
        "counts": narrow([len(way) for way in ordered.values()]),
        "nodes": narrow(nodes),
    }


def _messages(turns: Sequence[Turn], row_of: Mapping[str, int]) -> "np.ndarray[Any, Any]":
    """Return the messages, (4, messages): in which turn, who sent them, who is to have them, and what becomes of it."""
    found = [
        (at, row_of.get(sender, -1), row_of[receiver], fate)
        for at, turn in enumerate(turns)
        for sender, receiver, fate in turn.messages
        if receiver in row_of
    ]
    return narrow(np.array(found, np.int64).reshape(-1, 4).T)


def _sensed(sensed: Sequence[SensedTurn | None], row_of: Mapping[str, int]) -> dict[str, Plain]:
    """Return what was sensed at the beginning of each turn, and behind the last one."""
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
                    kept.append([look.shape.is_carried, narrow(look.shape.corners)])
            if look.words is not None:
                words[len(looks)] = look.words
            sensor = sensors.setdefault((look.sensor, look.kind), len(sensors))
            sizes = len(look.nodes), len(look.edges), len(look.agents)
            looks.append((row_of.get(look.agent, -1), sensor, shape, *sizes))
    every = [look for one in found for look in one.looks]
    sides = dict.fromkeys(chain.from_iterable(one.sides for one in found))
    pairs = [(row_of.get(name, -1), node) for look in every for name, node in look.agents]
    return {
        "looked": narrow([-1 if one is None else len(one.looks) for one in sensed]),
        "sensors": [list(sensor) for sensor in sensors],
        "shapes": kept,
        "looks": narrow(np.array(looks, np.int64).reshape(-1, 6).T),
        "seen_nodes": _concatenated([look.nodes for look in every]),
        "seen_edges": _concatenated([look.edges for look in every]),
        "seen_agents": narrow(np.array(pairs, np.int64).reshape(-1, 2).T),
        "words": words,
        "sights": {side: _sights(side, sensed, row_of) for side in sides},
    }


def _sights(side: str, sensed: Sequence[SensedTurn | None], row_of: Mapping[str, int]) -> dict[str, Plain]:
    """Return what a side sees: of the nodes those that it sees and did not before, or the other way around."""
    before = np.zeros(0, np.int64)
    changed, agents = list[IntArray](), list[list[int]]()
    for one in sensed:
        sight = None if one is None else one.sides.get(side)
        now = before if sight is None else sight.nodes
        changed.append(np.setxor1d(before, now, assume_unique=True))
        agents.append([] if sight is None else [row_of[name] for name in sight.agents if name in row_of])
        before = now
    return {
        "node_counts": narrow([len(part) for part in changed]),
        "nodes": _concatenated(changed),
        "agent_counts": narrow([len(part) for part in agents]),
        "agents": narrow(list(chain.from_iterable(agents))),
    }


def _concatenated(parts: Sequence[IntArray]) -> "np.ndarray[Any, Any]":
    return narrow(np.concatenate([np.zeros(0, np.int64), *parts]))


# -- the map ------------------------------------------------------------------------------------------------------


def drawn_map(
    world: bytes, attributes: Collection[str] | None = None, lat_lon: "np.ndarray[Any, Any] | None" = None
) -> bytes:
    """Return what is drawn of a map, with its scenery, as the bytes of a plain value.

    Args:
        world: the map, as it is saved.
        attributes: those that it keeps; None: all.
        lat_lon: (nodes, 2) degrees, which it then has, too; rounded to a centimetre.
    """
    state = unframed(world, MAP_MAGIC, VERSION)
    base = state["base_map"] if "base_map" in state else base_map_of(scenery_called(state.get("scenery")))
    if len(state["face_ids"]):  # which are drawn instead
        base = base | {name: base[name][:0] for name in ("face_types", "face_corners")}
    step = _step(state["xy"])
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
        to[name] = in_steps(of[name].reshape(-1, width), step)
    if attributes is not None:
        drawn |= {kind: _chosen(state[kind], attributes) for kind in ("node_attributes", "edge_attributes")}
    if lat_lon is not None:
        drawn["lat_lon"] = np.round(lat_lon / _LAT_LON_STEP) * _LAT_LON_STEP
    return to_bytes(drawn, "A map")


def in_steps(points: FloatArray, step: float) -> "np.ndarray[Any, Any]":
    """Return points (points, axes) as integers (axes, points): along a line their differences are small."""
    return narrow(np.rint(points.T / step).astype(np.int64))


def narrow(numbers: "Sequence[int] | np.ndarray[Any, Any]") -> "np.ndarray[Any, Any]":
    """Return integers in the smallest type that holds all of them."""
    wide = np.asarray(numbers, np.int64)
    low, high = (int(wide.min()), int(wide.max())) if wide.size else (0, 0)
    return wide.astype(np.promote_types(np.min_scalar_type(min(low, -1)), np.min_scalar_type(-1 - max(high, 0))))


def _chosen(attributes: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    return {name: column for name, column in attributes.items() if name in names}


def _step(xy: "np.ndarray[Any, Any]") -> float:
    """Return a power of two in whose multiples coordinates are written."""
    extent = float(np.ptp(xy, axis=0).max()) if len(xy) else 0.0
    return float(2.0 ** np.floor(np.log2(extent / _STEPS))) if extent > 0.0 else 2.0**-32
