"""The import paths of gamms 1.0.0, each an alias of the package that has its names now.

`from gamms.SensorEngine.sensor_engine import SensorType` yields the very same object as `gamms.sensor.SensorType`.
To retire a path, delete its line.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from gamms.errors import NotYetAttribute, NotYetImportable

_PACKAGES_OF: dict[str, tuple[str, ...]] = {
    "gamms.AgentEngine": ("gamms.agent",),
    "gamms.AgentEngine.agent_engine": ("gamms.agent",),
    "gamms.GraphEngine": ("gamms.graph", "gamms.memory"),
    "gamms.GraphEngine.graph_engine": ("gamms.graph", "gamms.memory"),
    "gamms.MemoryEngine": ("gamms.memory",),
    "gamms.MemoryEngine.memory_engine": ("gamms.memory",),
    "gamms.MemoryEngine.store": ("gamms.memory", "gamms.memory.store"),
    "gamms.Recorder": ("gamms.recorder",),
    "gamms.Recorder.component": ("gamms.recorder.published",),
    "gamms.Recorder.recorder": ("gamms.recorder",),
    "gamms.SensorEngine": ("gamms.sensor",),
    "gamms.SensorEngine.sensor_engine": ("gamms.sensor",),
    "gamms.SensorEngine.sensors_aerial": ("gamms.sensor",),
    "gamms.SensorEngine.sensors_basic": ("gamms.sensor",),
    "gamms.SensorEngine.sensors_occluded": ("gamms.sensor",),
    "gamms.VisualizationEngine": ("gamms.visual",),
    "gamms.VisualizationEngine.artist": ("gamms.visual",),
    "gamms.VisualizationEngine.builtin_artists": ("gamms.visual",),
    "gamms.VisualizationEngine.default_drawers": ("gamms.visual",),
    "gamms.VisualizationEngine.no_engine": ("gamms.visual",),
    "gamms.VisualizationEngine.pygame_engine": ("gamms.visual",),
    "gamms.VisualizationEngine.render_manager": ("gamms.visual",),
    "gamms.VisualizationEngine.utils": ("gamms.visual",),
    "gamms.internal_context": ("gamms.context",),
    "gamms.osm_constants": ("gamms.osm.constants",),
    "gamms.typing.artist": ("gamms.typing.visualization_engine",),
    "gamms.typing.compute_engine": ("gamms.typing.internal_context",),
    "gamms.typing.message_engine": ("gamms.typing.internal_context",),
    "gamms.typing.opcodes": ("gamms.typing.recorder",),
}

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
        if name == "__all__":  # what `from … import *` brings
            return [public for package in packages for public in getattr(import_module(package), name, ())]
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
        feature = _feature_of(fullname)
        if feature is not None:
            raise NotYetImportable(feature)
        is_old = fullname in _PACKAGES_OF
        return ModuleSpec(fullname, self, is_package=True) if is_old else None  # type: ignore[arg-type]  # see NOTE

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _Alias(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """There is nothing to run in an alias."""


def install() -> None:
    """Make every old path importable; nothing is loaded until it is used."""
    if not any(isinstance(finder, _OldPaths) for finder in sys.meta_path):
        sys.meta_path.append(_OldPaths())
    for path in _SHADOWED:
        module = sys.modules.setdefault(path, _Alias(path))
        module.__spec__, module.__path__ = ModuleSpec(path, None, is_package=True), []


def _feature_of(path: str) -> str | None:
    """Return the feature that is not built yet and that an import needs: an old module, or a name in a package."""
    parent, _, name = path.rpartition(".")
    names = [getattr(sys.modules.get(package), "LATER", {}) for package in _PACKAGES_OF.get(parent, (parent,))]
    return next((later[name] for later in names if name in later), _LATER.get(path))


def resolve(name: str) -> Any:
    """Return what `gamms.<name>` is: a module, or a class in the place of one; None if it is not an old path.

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
