"""Names of gamms 1.0.0 and of earlier versions: import paths, and names of the parts of `ctx`.

Each old import path is an alias of the package that has its names now: `gamms.SensorEngine.sensor_engine.SensorType` is
the very same object as `gamms.sensor.SensorType`.
To retire a path, delete its line. `OLD_NAMES` still work and are not shown, nor are those
`FOR_ENGINES` or `AS_KEYWORDS`; `MOVED` say where they went.
"""

import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from itertools import chain
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar

from gamms.errors import BadType, NotYetAttribute, NotYetImportable, UnknownAttribute

_FEW = 8  # names that an error lists
_OLD_PATHS: dict[tuple[str, ...], str] = {
    ("gamms.agent",): "AgentEngine AgentEngine.agent_engine",
    ("gamms.context",): "internal_context",
    ("gamms.graph", "gamms.memory"): "GraphEngine GraphEngine.graph_engine",
    ("gamms.memory",): "MemoryEngine MemoryEngine.memory_engine",
    ("gamms.memory", "gamms.memory.store"): "MemoryEngine.store",
    ("gamms.osm.constants",): "osm_constants",
    ("gamms.recorder",): "Recorder Recorder.recorder",
    ("gamms.recorder.components",): "Recorder.component",
    ("gamms.sensor",): "SensorEngine SensorEngine.sensor_engine SensorEngine.sensors_aerial SensorEngine.sensors_basic "
    "SensorEngine.sensors_occluded",
    ("gamms.typing.internal_context",): "typing.compute_engine typing.message_engine",
    ("gamms.typing.recorder",): "typing.opcodes",
    ("gamms.typing.visualization_engine",): "typing.artist",
    ("gamms.visual",): "VisualizationEngine VisualizationEngine.artist VisualizationEngine.builtin_artists "
    "VisualizationEngine.default_drawers VisualizationEngine.no_engine VisualizationEngine.pygame_engine "
    "VisualizationEngine.render_manager VisualizationEngine.utils",
}
_PACKAGES_OF = {f"gamms.{path}": packages for packages, paths in _OLD_PATHS.items() for path in paths.split()}

_LATER: dict[str, str] = {
    "gamms.ComputationEngine": "the computation engine",
    "gamms.MessageEngine": "the message engine",
}

# Old modules whose name says a class once `gamms` is imported, as in 1.0.0; they exist from the start, because an
# import that loads a module would also put it in the place of the class.
_SHADOWED = {"gamms.Recorder": ("gamms.recorder", "Recorder")}


class _Alias(ModuleType):
    """An empty module that looks up every name in the packages of its path."""

    def __init__(self, name: str) -> None:
        super().__init__(name, doc=f"Old name of {' and '.join(_PACKAGES_OF[name])}.")

    def __getattr__(self, name: str) -> Any:
        packages = _PACKAGES_OF[self.__name__]
        if name == "__all__":  # the names of `from … import *`
            return list(chain.from_iterable(getattr(import_module(package), name, ()) for package in packages))
        if name.startswith("__"):
            raise AttributeError(name)
        child = f"{self.__name__}.{name}"
        if child in _LATER:
            raise NotYetAttribute(_LATER[child])
        if child in _PACKAGES_OF:
            return import_module(child)
        for package in packages:
            try:
                return getattr(import_module(package), name)
            except AttributeError:
                continue
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")


class _OldPaths:
    """Finds and loads the modules of the tables above, and no others."""

    # NOTE: not a MetaPathFinder by inheritance: importlib.abc alone costs a tenth of NumPy's import.

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        del path, target
        if fullname in _LATER:
            raise NotYetImportable(_LATER[fullname])
        if fullname not in _PACKAGES_OF:
            return None
        return ModuleSpec(fullname, self, is_package=True)  # type: ignore[arg-type]  # see NOTE

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _Alias(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing: an alias has no code."""


OLD_NAMES = {  # names of 1.0.0 that programs of today need no longer
    "ctx": "agent_engine graph_engine internal_context recorder sensor_engine set_alive visual_engine",
    "ctx.agent": "terminate",
    "ctx.game": "ctx",
    "ctx.graph": "graph terminate",
    "ctx.record": "add_component component component_iter ctx delete_component get_component is_component_registered "
    "time unregister_component write",
    "ctx.sensor": "ctx terminate",
    "ctx.visual": "clear_layer create_layer ctx fill_layer get_viewport render_layer terminate",
}
FOR_ENGINES = {  # names that only engines and clients use
    "ctx": "capture current_game is_recording is_seeded reseed rng_state seed_uses use_game",
    "ctx.agent": "block storage structure_version",
    "ctx.game": "fork_for_deciders internals is_deciding is_moving last_turn plain_settings settings_now timings",
    "ctx.graph": "obstacle_revision scenery_columns storage",
    "ctx.record": "follow unfollow",
    "ctx.sensor": "from_declaration storage",
    "ctx.visual": "after_turn is_closing quiet_turns",
}
AS_KEYWORDS = {  # settings that `create_context(game=…)` takes, and that few games read or set later
    "ctx.game": "clock decide deeds deadline_s default_action information legal on_error on_illegal speed_unit "
    "team_memory time_budget turn_seconds weight",
}
MOVED = {
    **{
        f"ctx.visual.{name}": f"ctx.visual.drawing.{name}"
        for name in ("position_of", "render_circles", "render_discs", "render_lines", "render_polygons")
    },
    **{f"ctx.visual.{name}": f"ctx.visual.pictures.{name}" for name in ("as_html", "height", "width")},
    **{f"ctx.visual.{name}": f"ctx.visual.viewpoint.{name}" for name in ("followed", "look")},
    "ctx.graph.weights": "ctx.graph.graph.weights",
    "ctx.visual.artist": "ctx.visual.artists.get",
    "ctx.visual.team_colors": "ctx.visual.artists.team_colors",
}


_PARTS = {  # of a context -> the class that has their names
    "ctx.game": ("gamms.game.game", "Game"),
    "ctx.agent": ("gamms.agent.engine", "AgentEngine"),
    "ctx.graph": ("gamms.graph.engine", "GraphEngine"),
    "ctx.sensor": ("gamms.sensor.engine", "SensorEngine"),
    "ctx.record": ("gamms.recorder.recorder", "Recorder"),
    "ctx.visual": ("gamms.visual.engine", "NoEngine"),
}
_SEARCHED = (
    *("strategies", "rules", "scenario", "graph", "sensor", "osm", "recorder", "game"),
    *("rl", "planning", "solve", "experiment"),
)


def suggest_part(name: str) -> str:
    """Return the hint that parts of a context have a name; nothing if none has."""
    return _join_places([f"{called}.{name}" for called, (module, kind) in _PARTS.items() if _has(module, kind, name)])


def describe_place(name: str) -> str:
    """Return the hint that packages or parts of a context have a name; nothing if none has."""
    packages = [f"gamms.{one}.{name}" for one in _SEARCHED if name in import_module(f"gamms.{one}").__all__]
    parts = [f"{called}.{name}" for called, (module, kind) in _PARTS.items() if _has(module, kind, name)]
    return _join_places([*packages, *parts])


def _has(module: str, kind: str, name: str) -> bool:
    return hasattr(getattr(import_module(module), kind), name)


def _join_places(places: Sequence[str]) -> str:
    return f" There is {' and '.join(places[:3])}." if places else ""


class Surface:
    """Mix-in for objects that users read: lists current names, and answers unknown names with similar ones."""

    _called: ClassVar[str]
    _items: ClassVar[str] = ""  # the call that returns items of such an object, as a sentence
    _elsewhere: ClassVar[Callable[[str], str] | None] = None  # returns the hint of where else there is such a name

    def __dir__(self) -> list[str]:
        """Return the names of the part, except settings, and names for engines and for programs of 1.0.0."""
        return sorted({*self._list_known_names()} - {*AS_KEYWORDS.get(self._called, "").split()})

    def _list_known_names(self) -> set[str]:
        hidden = f"{OLD_NAMES.get(self._called, '')} {FOR_ENGINES.get(self._called, '')}"
        return {*super().__dir__()} - {*hidden.split()}

    if not TYPE_CHECKING:  # type checkers know which names there are

        def __getattr__(self, name: str) -> Any:
            if hasattr(type(self), name):  # a property of that name has raised this error
                return object.__getattribute__(self, name)
            moved = MOVED.get(f"{self._called}.{name}")
            if moved is not None:
                raise AttributeError(f"{self._called}.{name} is {moved} now.")
            if name.startswith("_"):
                raise UnknownAttribute(self._called, name, ())
            raise UnknownAttribute(self._called, name, sorted(self._list_known_names()), type(self)._elsewhere)

        def __getitem__(self, key: object) -> Any:
            # Also called by loops, with 0.
            names = [one for one in dir(self) if not one.startswith("_")]
            hint = f" Write {self._called}.{key}." if key in names else self._items
            raise BadType(f"{self._called} is neither a list nor a dict.{hint or _join_first_names(names)}")


def _join_first_names(names: Sequence[str]) -> str:
    """Return a sentence with the first few names of a part."""
    return f" It has, among others: {', '.join(names[:_FEW])}." if names else ""


def install() -> None:
    """Make every old path importable; nothing is loaded until it is used."""
    if not any(isinstance(finder, _OldPaths) for finder in sys.meta_path):
        sys.meta_path.append(_OldPaths())
    for path in _SHADOWED:
        module = sys.modules.setdefault(path, _Alias(path))
        module.__spec__ = ModuleSpec(path, None, is_package=True)
        module.__path__ = []


def resolve(name: str) -> Any:
    """Return the object for an old import path `gamms.<name>`: a module or a class; None if the path is not old.

    Raises:
        NotYetAttribute: it belongs to a feature that is not built yet.
    """
    path = f"gamms.{name}"
    if path in _LATER:
        raise NotYetAttribute(_LATER[path])
    if path in _SHADOWED:
        home, name = _SHADOWED[path]
        return getattr(import_module(home), name)
    return import_module(path) if path in _PACKAGES_OF else None
