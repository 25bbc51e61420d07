"""Call public functions and set attributes with odd arguments: each works, or refuses with an error of ours.

A call is at fault if it raises anything but a `GammsError`, if it raises one and has changed something, or if what it
has set cannot be read afterwards. `fuzz` returns the faults it found, each once.
"""

import contextlib
import inspect
import os
import random
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import gamms
import gamms.belief
import gamms.osm
import gamms.recorder
import gamms.recordings
import gamms.rules
import gamms.scenario
import gamms.strategies
from gamms.errors import GammsError
from gamms.sensor import SensorType
from gamms.text import shown

_CALLS = 100  # in one world


class Unreadable:
    """A value that cannot be shown, and is neither true nor false."""

    def __repr__(self) -> str:
        raise ValueError("not to be shown")

    def __bool__(self) -> bool:
        raise ValueError("neither true nor false")


# fmt: off
_ODD: list[Callable[[], Any]] = [  # functions, because iterators and arrays are used up or changed
    lambda: None, lambda: True, lambda: 0, lambda: 1, lambda: -1, lambda: 5, lambda: 10**30, lambda: 1 << 20_000,
    lambda: -(1 << 20_000), lambda: 1.5, lambda: -0.0, lambda: 1e308, lambda: float("nan"), lambda: float("inf"),
    lambda: complex(1, 2), lambda: "", lambda: "x", lambda: "ann", lambda: "near", lambda: "\ud800", lambda: "a\0b",
    lambda: b"b", list, lambda: [0, 1], lambda: [None] * 3, lambda: [[1]], lambda: (0, 0), lambda: (1, 2, 3),
    lambda: (0, 0, 0, 0), dict, lambda: {"node_id": 1}, lambda: {"id": 3, "x": 0, "y": 0}, lambda: {1 << 20_000},
    lambda: {"id": 99, "source": 0, "target": 1, "length": 1.0}, lambda: {"a": {"b": [1]}}, lambda: {1: 1 << 20_000},
    lambda: {"id": 1 << 20_000, "x": "\ud800"}, lambda: {None: []}, set, object, lambda: range(3), lambda: iter([1]),
    lambda: np.int64(3), lambda: np.float64("nan"), lambda: np.array([1, 2]), lambda: np.array([]), lambda: np.array(1),
    lambda: np.zeros((2, 2)), lambda: np.array([None, {}]), lambda: type, lambda: Ellipsis, lambda: SensorType.RANGE,
    lambda: lambda *_: None, lambda: Path("missing"), lambda: Path("none/missing"), Path.cwd, Unreadable,
]
_ODD_ARRAYS: list[Callable[[], Any]] = [  # for arguments that are arrays, of (2 games, 2 agents) and 9 nodes
    lambda: np.ones((2, 2), np.int64), lambda: np.ones((2, 2), np.bool_), lambda: np.full((2, 9), 0.5),
    lambda: np.array([-1]), lambda: np.array([9]), lambda: np.array([1 << 62]), lambda: np.array([1 << 63], np.uint64),
    lambda: np.array([np.nan]), lambda: np.array([True]), lambda: np.array([]), lambda: np.array([1, 2], object),
    lambda: np.array(["a"]), lambda: np.zeros((3, 2), np.int64), lambda: np.arange(20)[::9], lambda: [[0], [0, 1]],
    lambda: np.full((9, 2), -1.0), lambda: np.broadcast_to(np.int64(1), (2, 2)), lambda: np.datetime64("2026-01-01"),
]
_ARRAYS = frozenset((  # arguments that are
    "actions", "agents", "allowed", "asked", "bodies", "body", "chosen", "columns", "detection_probability", "found",
    "games", "ids", "likelihoods", "limits", "masses", "n", "node", "node_ids", "nodes", "not_shown", "scores", "seen",
    "seen_nodes", "sources", "targets", "to", "values", "where", "which", "xy",
))
_IN_ARRAYS: dict[str, tuple[str, ...]] = {  # the verbs of what plays in arrays, as programs call them
    "batch": ("step", "reset", "columns", "load", "observe", "observe_agent", "result", "table"),
    "view": ("action_to", "do", "send", "heard", "seen", "seen_nodes", "only", "of", "in_games", "routes",
             "vector"),
    "view.draw": ("below",), "view.enemies()": ("of",), "view.streets": ("rows",),
    "view.routes()": ("distances", "actions"),
    "filter": ("update", "weigh", "weigh_states", "predict", "probability"), "games filter": ("update", "reset"),
    "team": ("set", "move", "sense", "__getitem__"),
    "ctx.graph.routes": (
        "k_shortest_paths", "isochrones", "nearest", "distances", "distances_from_nearest", "tables", "nearest_edge"
    ),
}
_USUAL: dict[str, Any] = {  # what makes a call go far with one argument odd
    "name": "ann", "agent": "ann", "agent_name": "ann", "sensor_id": "near", "node_id": 1, "edge_id": 1, "face_id": 1,
    "source": 0, "target": 8, "sources": [0], "targets": [8], "x": 1.0, "y": 1.0, "d": 5.0, "radius": 15.0, "turn": 1,
    "team": "red", "sensor_type": SensorType.RANGE, "sensor_range": 10.0, "start_node_id": 1, "ids": [50, 51],
    "faces": np.ones((1, 4, 3)), "tr": (1, 1, 3), "tl": (5, 1, 3), "br": (1, 1, 0), "bl": (5, 1, 0), "type": 1,
    "kind": "seen", "key": ("module", "name"), "metres": 5.0, "taggers": "red", "tagged": "blue", "nodes": [0, 1, 2],
    "start": 0, "stop": 2, "fps": 10, "width": 40, "height": 30, "n": 2, "m": 2, "near": 0, "lat": 60.0, "lon": 25.0,
    "node": 2, "p": 0.5, "deed": "scan", "channel": "radio", "names": "near",
    "weight": "length", "column": "energy", "read": lambda _: 1, "bases": {},
    "flags": {"red": 0, "blue": 8}, "filepath": "map.osm", "turns": 3, "layer_id": 10, "artist": {"x": 1.0, "y": 1.0},
    "data": {"x": 1}, "fn": lambda _: 1, "strategies": {"red": gamms.strategies.stay}, "obj": object(), "reason": "end",
    "table": "moves", "color": (1, 2, 3), "origin": (0.0, 0.0, 1.0), "points": [(0, 0), (1, 1)], "tolerance": 1.0,
}
_KEYWORDS: dict[str, tuple[str, ...]] = {  # of functions that take **keywords
    "create_agent": ("start_node_id", "type", "agent_type", "speed", "position", "team", "sensors", "strategy", "meta",
                     "orientation", "alive", "quat", "extra"),
    "create_sensor": ("type", "sensor_range", "fov", "orientation", "at", "owner", "quat", "observer_height", "teams",
                      "detection"),
    "set_agent_visual": ("color", "size", "image_path"),
    "set_sensor_visual": ("color", "size", "node_color", "edge_color", "layer"),
    "set_graph_visual": ("color", "node_color", "node_size", "edge_color", "edge_width", "draw_id", "width", "height"),
    "set_obstacle_visual": ("color_map", "boundary_thickness", "fill"),
    "emit": ("place", "kind2"), "event": ("place",), "publish": ("place",),
    "replace": ("teams", "map", "seed", "max_turns", "name", "sensors", "rules", "game"),
    "Scenario": ("teams", "map", "seed", "max_turns", "name", "sensors", "rules", "game"),
    "create_context": ("game", "seed", "graph_engine", "vis_engine", "vis_kwargs", "logger_config", "graph_path"),
}
_NOT_CALLED = frozenset((
    # they end, restart or play the game, wait for a person, or need a network
    "terminate", "close", "simulate", "human_input", "stay_open", "run", "step", "reset", "set_alive", "update", "play",
    # what engines say to each other
    "after_reset", "after_turn", "agent_engine", "block", "live_result", "positions",
    "columns", "copy", "described", "graph_engine", "internal_context", "is_copying",
    "kept", "make", "memory", "noted", "notice", "of_map", "packed",
    "packed_part", "places_of", "pointed", "put", "recorder", "renumber", "reseed",
    "restore", "restore_rules", "sensor_engine", "show", "sights", "strategy",
    "after_observing", "counts", "ctx", "errors", "events", "scenario", "team_memories", "timings",
    "tell_anew", "tracks", "unpack", "visual_engine", "place_of", "clear",
    "film", "look", "followed",
    "turn_seconds", "width", "height", "viewpoint", "stream_of", "plain_settings", "configure",
    "storage", "visibility_table", "neighborhoods",
    "is_playing", "restart_stream", "rng_state", "snapshot", "state",
))
# fmt: on
_FUNCTIONS: list[Callable[..., Any]] = [
    *(getattr(gamms.rules, name) for name in ("at_random", "by_priority", "capture_flag", "contacts", "last_team")),
    *(getattr(gamms.rules, name) for name in ("one_to_one", "reach", "tag", "time_limit", "Conflicts")),
    *(getattr(gamms.strategies, name) for name in ("chase", "first", "flee", "follow_path", "goto", "guard", "human")),
    *(getattr(gamms.strategies, name) for name in ("mix", "patrol")),
    *(gamms.graph.grid, gamms.create_context, gamms.osm.graph_from_file, gamms.osm.graph_from_geojson),
    *(gamms.osm.graph_from_xml, gamms.osm.obstacle_from_file, gamms.osm.obstacle_from_xml, gamms.osm.is_geojson),
    *(gamms.osm.process_osm_graph, gamms.osm.consolidate, gamms.osm.get_network_type, gamms.osm.helsinki),
    *(gamms.scenario.Scenario, gamms.scenario.load, gamms.scenario.from_recording, gamms.recorder.open),
    *(gamms.recordings.version_of, gamms.recordings.to_version_3, gamms.recordings.to_json_lines),
    *(gamms.recordings.verify, gamms.recordings.context_for, gamms.recordings.first_difference),
]
_CHECKED_WHEN_CALLED = {gamms.strategies.first}  # they take *arguments


def fuzz(seed: object, worlds: int) -> list[str]:
    """Make 100 calls, or those up to a fault, in each of some worlds; return the faults, each as it showed first."""
    faults: dict[object, str] = {}
    with _in_a_folder_of_its_own(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number in range(worlds):
            with contextlib.closing(World(random.Random(f"{seed}/{number}"))) as world:
                found = next(filter(None, (list(world.call()) for _ in range(_CALLS))), []) or list(world.end())
            faults |= {key: f"{seed}/{number}: {fault}" for key, fault in found if key not in faults}
    return list(faults.values())


class World:
    """A small game, and a call at a time."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._ctx = ctx = _game()
        if chance.random() < 0.5:
            ctx.record.start("played.ggr", overwrite=True)
            ctx.game.step()
        played = _game()
        played.record.start("whole.ggr", overwrite=True)
        result = played.game.run(3)
        played.terminate()
        self._recording = gamms.recorder.open("whole.ggr")
        self._targets: list[tuple[str, Any]] = [
            *(("ctx", ctx), ("ctx.agent", ctx.agent), ("ctx.sensor", ctx.sensor), ("ctx.graph", ctx.graph)),
            *(("ctx.graph.graph", ctx.graph.graph), ("ctx.game", ctx.game), ("ctx.visual", ctx.visual)),
            *(("ctx.record", ctx.record), ("ctx.ictx.memory", ctx.ictx.memory), ("result", result)),
            *((f"agent {agent.name}", agent) for agent in ctx.agent.create_iter()),
            *((f"sensor {name}", sensor) for name, sensor in ctx.sensor.sensors.items()),
            ("recording", self._recording),
            ("scenario", gamms.scenario.Scenario(**_SCENARIO)),
        ]
        self._in_arrays = _played_in_arrays(ctx)
        self._calls = [
            *((name, target, member) for name, target in self._targets for member in _members(name, target)),
            *((function.__module__, None, function) for function in _FUNCTIONS),
            *((name, self._in_arrays[name], verb) for name, verbs in _IN_ARRAYS.items() for verb in verbs * 3),
        ]

    def close(self) -> None:
        """End the game."""
        self._recording.close()
        self._in_arrays["batch"].close()
        with contextlib.suppress(Exception):  # the faults that `end` tells
            self._ctx.terminate()

    def end(self) -> Iterator[tuple[object, str]]:
        """End the game; yield the fault if it cannot."""
        try:
            self._ctx.terminate()
        except Exception as error:  # noqa: BLE001
            yield ("end", type(error)), f"ctx.terminate() raises {type(error).__name__}: {str(error)[:200]!a}"

    def call(self) -> Iterator[tuple[object, str]]:
        """Make one call; yield its faults, each with a key that is the same for the same fault."""
        where, target, member = self._chance.choice(self._calls)
        name = member if isinstance(member, str) else member.__name__
        before = self._state()
        if target is not None and _is_settable(type(target), name):
            value = self._odd(is_kept=True)
            call = f"{where}.{name} = {_shown(value)}"
            todo = lambda: setattr(target, name, value)
        else:
            function = getattr(target, name) if target is not None else member
            args, keywords = self._arguments(name, function)
            given = [*map(_shown, args), *(f"{key}={_shown(value)}" for key, value in keywords.items())]
            call = f"{where}.{name}({', '.join(given)})"
            todo = lambda: _exhaust(function(*args, **keywords))
        yield from self._fault(f"{where.split()[0]}.{name}", call, todo, before)

    def _fault(self, kind: str, call: str, todo: Callable[[], Any], before: str) -> Iterator[tuple[object, str]]:
        failed = False
        try:
            todo()
        except (GammsError, OSError) as error:  # the system's own words for a file are clear
            failed = True
            if not str(error).isprintable() and "\n" not in str(error):
                yield ("unprintable", kind), f"{call} raises what cannot be printed: {error!a}"
        except Exception as error:  # noqa: BLE001 - whatever it is, it is a fault
            failed = True
            last = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{Path(last.filename).name}:{last.lineno}"
            yield (kind, type(error), place), f"{call} raises {type(error).__name__} in {place}: {str(error)[:200]!a}"
        try:
            after = self._state()
        except Exception as error:  # noqa: BLE001
            yield ("unreadable", kind), f"{call} leaves what cannot be read: {type(error).__name__}: {error!a:.200}"
            return
        if failed and after != before:
            at = next((at for at, (a, b) in enumerate(zip(before, after, strict=False)) if a != b), len(before))
            change = f"{before[max(0, at - 40) : at + 60]} -> {after[max(0, at - 40) : at + 60]}"
            yield ("half-changed", kind), f"{call} fails, and has changed {change}"

    def _arguments(self, name: str, function: Callable[..., Any]) -> tuple[list[Any], dict[str, Any]]:
        args: list[Any] = []
        keywords: dict[str, Any] = {}
        for one in inspect.signature(function).parameters.values():
            if one.kind is one.VAR_POSITIONAL:
                args += [self._odd() for _ in range(self._chance.randrange(3))] if not keywords else []
            elif one.kind is one.VAR_KEYWORD:
                wanted = [word for word in _KEYWORDS.get(name, ()) if self._chance.random() < 0.3]
                keywords |= {word: self._value(word, is_kept=True) for word in wanted if word not in keywords}
            elif one.default is not one.empty and self._chance.random() < 0.6:
                continue
            elif one.kind is one.KEYWORD_ONLY or keywords or one.default is not one.empty:
                keywords[one.name] = self._value(one.name)
            else:
                args.append(self._value(one.name))
        return args, keywords

    def _value(self, name: str, *, is_kept: bool = False) -> Any:
        if name == "ctx" and self._chance.random() < 0.8:
            return self._ctx
        if name in _ARRAYS and self._chance.random() < 0.5:
            return self._chance.choice(_ODD_ARRAYS)()
        if name in _USUAL and self._chance.random() < 0.4:
            return _USUAL[name]
        return self._odd(is_kept=is_kept)

    def _odd(self, *, is_kept: bool = False) -> Any:
        odd = self._chance.choice(_ODD)
        return odd() if not is_kept or odd is not Unreadable else None

    def _state(self) -> str:
        """All that calls can change, as text."""
        ctx, graph, most = self._ctx, self._ctx.graph.graph, sys.get_int_max_str_digits()
        sys.set_int_max_str_digits(0)
        try:
            return repr(
                (
                    [(id, graph.get_node(id), graph.node_attributes(id)) for id in graph.get_nodes()],
                    [(graph.get_edge(id), graph.edge_attributes(id)) for id in graph.get_edges()],
                    [ctx.graph.get_obstacle_face(id) for id in ctx.graph.get_obstacle_faces()],
                    (ctx.graph.crs, ctx.graph.attribution, ctx.seed),
                    [_state_of_agent(agent) for agent in ctx.agent.create_iter()],
                    [_state_of_sensor(name, sensor) for name, sensor in ctx.sensor.sensors.items()],
                    (ctx.game.settings(), ctx.game.turn, dict(ctx.game.scores), dict(ctx.game.data), ctx.game.is_over),
                    (list(ctx.game.events), dict(ctx.game.facts), list(ctx.game.rules), ctx.record.record()),
                    (list(ctx.visual.artists.list_shown()), list(ctx.record.component_iter())),
                )
            )
        finally:
            sys.set_int_max_str_digits(most)


_SCENARIO: dict[str, Any] = {"map": {"grid": {"width": 3, "height": 3}}, "teams": {"red": {"count": 1}}}


_IN_BATCHES: dict[str, Any] = {
    "map": {"grid": {"width": 3, "height": 3}},
    "teams": {name: {"count": 2, "strategy": "gamms.strategies:random_walk"} for name in ("red", "blue")},
    "settings": {"deeds": {"scan": {"node": "node"}}},
    "channels": {"radio": {"range_m": 30.0}},
}


def _game() -> Any:
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.graph.add_obstacle_face(0, (1, 1, 3), (5, 1, 3), (1, 1, 0), (5, 1, 0), 1)
    ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    ctx.sensor.create_sensor("far", SensorType.RANGE, sensor_range=15)
    ctx.sensor.create_sensor("others", SensorType.AGENT_ARC, sensor_range=15, fov=2.0)
    ctx.sensor.create_sensor("below", SensorType.AERIAL, sensor_range=30)
    walk, stay = gamms.strategies.random_walk, gamms.strategies.stay
    red = {"team": "red", "strategy": walk, "meta": {"hp": 3}}
    ctx.agent.create_agent("ann", start_node_id=0, sensors=["near", "others"], **red)
    ctx.agent.create_agent("bob", start_node_id=8, team="blue", sensors=["far"], strategy=stay, speed=2)
    ctx.agent.create_agent("kite", type="AERIAL", start_node_id=4, speed=1.0, sensors=["below"], **red)
    return ctx


def _played_in_arrays(ctx: Any) -> dict[str, Any]:
    """Games in arrays and what they give to programs, and what asks for many nodes or agents of a context at once."""
    games = gamms.scenario.Scenario(**_IN_BATCHES).batch(2)
    view = games.observe("red")
    view._deeds, view._outboxes = [], []
    columns, model = view.streets.columns, gamms.belief.random_walk()
    return {
        "batch": games,
        "view": view,
        "view.draw": view.draw,
        "view.enemies()": view.enemies(),
        "view.streets": view.streets,
        "view.routes()": view.routes(),
        "filter": gamms.belief.Filter(ctx, model, ["ann", "bob"]),
        "games filter": gamms.belief.GamesFilter(columns, model, 2, 2),
        "team": ctx.agent.create_team("crowd", [0, 1]),
        "ctx.graph.routes": ctx.graph.routes,
    }


def _members(where: str, target: object) -> list[str]:
    """The public methods of an object, and what can be set of it."""
    kind = type(target)
    names = [name for name in dir(kind) if name[0] != "_" and not {name, f"{where}.{name}"} & _NOT_CALLED]
    return [name for name in names if _is_settable(kind, name) or callable(inspect.getattr_static(kind, name))]


def _is_settable(kind: type, name: str) -> bool:
    member = inspect.getattr_static(kind, name, None)
    return member.fset is not None if isinstance(member, property) else hasattr(member, "__set__")


def _state_of_agent(agent: Any) -> object:
    names = ("name", "team", "alive", "current_node_id", "prev_node_id", "orientation", "position", "quat", "speed")
    return [getattr(agent, name, None) for name in names], sorted(agent._sensor_list), agent.strategy


def _state_of_sensor(name: str, sensor: Any) -> object:
    names = ("sensor_id", "type", "_owner", "range", "fov", "orientation", "quat", "at")
    return name, [getattr(sensor, one, None) for one in names]


def _shown(value: object) -> str:
    return f"{type(value).__name__} {shown(value)}" if isinstance(value, np.ndarray | np.generic) else shown(value)


def _exhaust(value: Any) -> None:
    if inspect.isgenerator(value):
        list(value)


@contextlib.contextmanager
def _in_a_folder_of_its_own() -> Iterator[None]:
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            Path("map.osm").write_text("<osm/>")
            Path("x").write_bytes(b"\x89PNG\r\n\x1a\n")
            yield
        finally:
            os.chdir(before)
