"""The import paths of gamms 1.0.0, each an alias of the room that answers for it now.

`from gamms.SensorEngine.sensor_engine import SensorType` yields the very same object as `gamms.sensor.SensorType`.
To retire a path, delete its line.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from gamms.errors import NotYetImportable

_ROOMS_OF: dict[str, tuple[str, ...]] = {
    "gamms.AgentEngine": ("gamms.agent",),
    "gamms.AgentEngine.agent_engine": ("gamms.agent",),
    "gamms.GraphEngine": ("gamms.graph", "gamms.memory"),
    "gamms.GraphEngine.graph_engine": ("gamms.graph", "gamms.memory"),
    "gamms.MemoryEngine": ("gamms.memory",),
    "gamms.MemoryEngine.memory_engine": ("gamms.memory",),
    "gamms.MemoryEngine.store": ("gamms.memory",),
    "gamms.SensorEngine": ("gamms.sensor",),
    "gamms.SensorEngine.sensor_engine": ("gamms.sensor",),
    "gamms.SensorEngine.sensors_basic": ("gamms.sensor",),
    "gamms.VisualizationEngine": ("gamms.visual",),
    "gamms.VisualizationEngine.artist": ("gamms.visual",),
    "gamms.VisualizationEngine.builtin_artists": ("gamms.visual",),
    "gamms.VisualizationEngine.default_drawers": ("gamms.visual",),
    "gamms.VisualizationEngine.no_engine": ("gamms.visual",),
    "gamms.VisualizationEngine.utils": ("gamms.visual",),
    "gamms.internal_context": ("gamms.context",),
    "gamms.osm_constants": ("gamms.osm.constants",),
}

_LATER: dict[str, str] = {
    "gamms.ComputationEngine": "The computation engine",
    "gamms.MessageEngine": "The message engine",
    "gamms.Recorder": "Recording",
    "gamms.SensorEngine.sensors_aerial": "Sensing from the air",
    "gamms.SensorEngine.sensors_occluded": "Sensing past obstacles",
    "gamms.VisualizationEngine.pygame_engine": "The pygame window",
    "gamms.VisualizationEngine.render_manager": "The pygame window",
}

# Names that 1.0.0 also offered in a room that is not theirs: room -> (their room, names).
_GUESTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "gamms.graph": ("gamms.memory", ("MemoryStore", "SqliteStore", "PathLike")),
}


class _Alias(ModuleType):
    """An empty module that answers every question by asking its rooms."""

    def __init__(self, name: str) -> None:
        super().__init__(name, doc=f"Old name of {' and '.join(_ROOMS_OF[name])}.")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        child = f"{self.__name__}.{name}"
        if child in _ROOMS_OF:
            return import_module(child)
        for room in _ROOMS_OF[self.__name__]:
            try:
                return getattr(import_module(room), name)
            except AttributeError:
                continue
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")


class _OldPaths(MetaPathFinder, Loader):
    """Finds the modules of the tables above, and no others."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        del path, target
        if fullname in _LATER:
            raise NotYetImportable(_LATER[fullname])
        return ModuleSpec(fullname, self, is_package=True) if fullname in _ROOMS_OF else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _Alias(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """There is nothing to run in an alias."""


def install() -> None:
    """Make every old path importable; nothing is loaded until it is used."""
    if not any(isinstance(finder, _OldPaths) for finder in sys.meta_path):
        sys.meta_path.append(_OldPaths())
    for room, (home, names) in _GUESTS.items():
        for name in names:
            setattr(import_module(room), name, getattr(import_module(home), name))


def is_old_name(name: str) -> bool:
    """Whether `gamms.<name>` is one of the old paths."""
    return f"gamms.{name}" in _ROOMS_OF or f"gamms.{name}" in _LATER
