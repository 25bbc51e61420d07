"""Every import path of 1.0.0: the ones that are there yield the identical objects, the others say what is missing."""

import importlib
import subprocess
import sys

import pytest

import gamms
import gamms.osm  # so that what the tests import later is new
from gamms.errors import NotYet

# old module -> the module that answers now, and the names that programs import
PATHS = {
    "gamms.AgentEngine": ("gamms.agent", "Agent AgentEngine"),
    "gamms.AgentEngine.agent_engine": (
        "gamms.agent",
        "Agent AerialAgent NoOpAgent AgentEngine AgentType IAgent IAerialAgent IAgentEngine OpCodes",
    ),
    "gamms.GraphEngine": ("gamms.graph", "GraphEngine"),
    "gamms.GraphEngine.graph_engine": (
        "gamms.graph",
        (
            "Engine Graph SqliteGraph GraphEngine Node OSMEdge ObsFace IGraph IGraphEngine StoreType MemoryStore "
            "SqliteStore PathLike LineString"
        ),
    ),
    "gamms.SensorEngine": ("gamms.sensor", "SensorEngine SensorType"),
    "gamms.SensorEngine.sensor_engine": (
        "gamms.sensor",
        "SensorEngine SensorType ISensor ISensorEngine NeighborSensor MapSensor AgentSensor",
    ),
    "gamms.SensorEngine.sensors_basic": ("gamms.sensor", "NeighborSensor MapSensor AgentSensor"),
    "gamms.MemoryEngine": ("gamms.memory", "MemoryEngine MemoryStore SqliteStore PathLike"),
    "gamms.MemoryEngine.memory_engine": ("gamms.memory", "MemoryEngine"),
    "gamms.MemoryEngine.store": ("gamms.memory.store", "PathLike MemoryStore LazyMapping"),  # and SqliteStore, below
    "gamms.Recorder": ("gamms.recorder", "Recorder"),
    "gamms.Recorder.component": ("gamms.recorder.components", "component check_validity"),
    "gamms.Recorder.recorder": ("gamms.recorder", "Recorder"),
    "gamms.VisualizationEngine": (
        "gamms.visual",
        (
            "Engine Color Space Shape Artist RenderMode NoEngine SHORT_EDGE_PIXEL_THRESHOLD SKIP_EDGE_PIXEL_THRESHOLD "
            "SKIP_NODE_PIXEL_THRESHOLD CACHE_ZOOM_MAX PygameVisualizationEngine lazy"
        ),
    ),
    "gamms.VisualizationEngine.artist": ("gamms.visual", "Artist RenderMode"),
    "gamms.VisualizationEngine.builtin_artists": ("gamms.visual", "Circle Rectangle AgentData GraphData"),
    "gamms.VisualizationEngine.default_drawers": (
        "gamms.visual",
        (
            "render_aerial_agent render_aerial_agent_sensor render_agent render_agent_sensor render_circle "
            "render_graph render_input_overlay render_map_sensor render_neighbor_sensor render_obstacles "
            "render_rectangle"
        ),
    ),
    "gamms.VisualizationEngine.no_engine": ("gamms.visual", "NoEngine"),
    "gamms.VisualizationEngine.pygame_engine": ("gamms.visual", "PygameVisualizationEngine"),
    "gamms.VisualizationEngine.render_manager": ("gamms.visual", "RenderManager"),
    "gamms.VisualizationEngine.utils": ("gamms.visual", "string_to_color"),
    "gamms.context": ("gamms.context", "Context"),
    "gamms.internal_context": ("gamms.context", "InternalContext"),
    "gamms.osm": ("gamms.osm", "OSMType graph_from_xml process_osm_graph"),
    "gamms.osm_constants": ("gamms.osm.constants", "OSM_OBSTACLE_TAGS HEIGHT_ESTIMATES_TYPES COLOR_TYPES"),
    "gamms.typing": (
        "gamms.typing",
        (
            "IComputeEngine ITask IMemoryEngine IStore IPathLike StoreType IMessageEngine IInternalContext "
            "ISensorEngine ISensor SensorType IArtist ArtistType IVisualizationEngine ColorType IAgentEngine IAgent "
            "IAerialAgent AgentType IGraphEngine IGraph OSMEdge Node ObsFace IRecorder ILogger IContext OpCodes"
        ),
    ),
    "gamms.typing.agent_engine": ("gamms.typing", "IAgent IAerialAgent IAgentEngine AgentType"),
    "gamms.typing.artist": ("gamms.typing", "IArtist ArtistType"),
    "gamms.typing.compute_engine": ("gamms.typing", "IComputeEngine ITask"),
    "gamms.typing.context": ("gamms.typing", "IContext"),
    "gamms.typing.graph_engine": ("gamms.typing", "IGraph IGraphEngine Node OSMEdge ObsFace"),
    "gamms.typing.internal_context": ("gamms.typing", "IInternalContext"),
    "gamms.typing.logger": ("gamms.typing", "ILogger"),
    "gamms.typing.memory_engine": ("gamms.typing", "IMemoryEngine IStore IPathLike StoreType"),
    "gamms.typing.message_engine": ("gamms.typing", "IMessageEngine"),
    "gamms.typing.opcodes": ("gamms.typing", "OpCodes"),
    "gamms.typing.recorder": ("gamms.typing", "IRecorder"),
    "gamms.typing.sensor_engine": ("gamms.typing", "ISensor ISensorEngine SensorType"),
    "gamms.typing.visualization_engine": ("gamms.typing", "IVisualizationEngine ColorType"),
}
LATER = {
    "from gamms.ComputationEngine.compute_egine import ComputeEngine, Task": "the computation engine",
    "import gamms.ComputationEngine": "the computation engine",
    "from gamms.MessageEngine.message_engine import IMessageEngine": "the message engine",
    "import gamms.MessageEngine.redis_message": "the message engine",
}


@pytest.mark.parametrize(
    ("old", "room", "name"), [(old, room, name) for old, (room, names) in PATHS.items() for name in names.split()]
)
def test_an_old_path_yields_the_identical_object(old, room, name):
    here, there = importlib.import_module(old), importlib.import_module(room)
    assert getattr(here, name) is getattr(there, name)
    scope = {}
    exec(f"from {old} import {name} as found", scope)
    assert scope["found"] is getattr(there, name)


def test_an_old_path_is_reached_by_attributes_after_import_gamms(printed_with_a_new_gamms):
    asked = [old for old in PATHS if not old.startswith("gamms.Recorder")]
    assert printed_with_a_new_gamms(f"import gamms; print({old}.__name__)" for old in asked) == asked


@pytest.mark.parametrize("asked", LATER)
def test_a_path_that_comes_later_names_the_feature(asked):
    before = set(sys.modules)
    kind = AttributeError if asked.rpartition(";")[2].strip().startswith("gamms.") else ImportError
    with pytest.raises(kind, match=f"^Not in this version of GAMMS yet: {LATER[asked]}") as caught:
        exec(asked, {"gamms": gamms})
    assert isinstance(caught.value, NotYet)
    assert isinstance(caught.value, NotImplementedError)
    new = {name for name in set(sys.modules) - before if name.startswith("gamms")}
    assert new <= {"gamms.SensorEngine", "gamms.AgentEngine", "gamms.VisualizationEngine", *PATHS}


def test_importing_another_library_asks_it_for_nothing(tmp_path, monkeypatch):
    """A package with a `__getattr__` that raises is imported as without gamms."""
    package = tmp_path / "lazy_library"
    package.mkdir()
    (package / "__init__.py").write_text("def __getattr__(name):\n    raise RuntimeError(name)\n")
    (package / "part.py").write_text("answer = 42\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert importlib.import_module("lazy_library.part").answer == 42
    with pytest.raises(ModuleNotFoundError, match=r"lazy_library\.missing"):
        importlib.import_module("lazy_library.missing")


@pytest.mark.parametrize("old", ["gamms.Nothing", "gamms.SensorEngine.nothing", "gamms.AgentEngine.agent_engine.x"])
def test_a_path_that_never_was_is_a_plain_import_error(old):
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module(old)
    with pytest.raises(AttributeError, match="has no attribute"):
        exec(old, {"gamms": gamms})


def test_a_missing_name_is_an_import_error_that_names_it():
    with pytest.raises(ImportError, match="no_such_thing"):
        from gamms.SensorEngine import no_such_thing  # noqa: F401


def test_a_module_that_was_taken_apart_answers_for_both_its_parts():
    from gamms.MemoryEngine.store import PathLike, SqliteStore

    assert (PathLike, SqliteStore) == (gamms.memory.PathLike, gamms.memory.SqliteStore)


def test_recorder_is_the_class_and_its_modules_can_be_imported_all_the_same(printed_with_a_new_gamms):
    imports = [
        "import gamms",
        "import gamms.Recorder",
        "import gamms.Recorder.recorder",
        "from gamms import Recorder",
        "from gamms.Recorder.recorder import Recorder",
        "from gamms.Recorder.component import component, check_validity",
        "from gamms.Recorder import component, recorder",
        "import importlib; assert importlib.import_module('gamms.Recorder.recorder').Recorder",
    ]
    check = """
import gamms, inspect
assert inspect.isclass(gamms.Recorder)
from gamms import Recorder
assert Recorder is gamms.recorder.Recorder is gamms.Recorder
print("right")
"""
    assert printed_with_a_new_gamms(one + check for one in imports) == ["right"] * len(imports)


def test_one_sensor_type_whatever_the_path():
    from gamms.SensorEngine import SensorType

    kinds = [gamms.SensorEngine.sensor_engine.SensorType, gamms.typing.SensorType, gamms.sensor.SensorType]
    assert all(kind is SensorType for kind in kinds)


@pytest.mark.parametrize("old", ["AgentEngine.agent_engine", "VisualizationEngine", "osm_constants", "MemoryEngine"])
def test_a_star_import_from_an_old_path_brings_the_public_names(old):
    scope = {}
    exec(f"from gamms.{old} import *", scope)
    room = importlib.import_module(PATHS[f"gamms.{old}"][0])
    assert set(room.__all__) <= set(scope)


def test_names_of_1_0_0_exist_after_import_gamms():
    names = (
        "agent sensor graph visual memory logger typing context internal_context osm_constants create_context Context "
        "InternalContext Recorder AgentEngine SensorEngine GraphEngine VisualizationEngine MemoryEngine osm __version__"
    )
    code = f"import gamms; print([name for name in {names.split()} if not hasattr(gamms, name)])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_osm_is_reached_in_every_way_and_loaded_only_when_asked_for(printed_with_a_new_gamms):
    asks = "from gamms import osm", "import gamms.osm", "import gamms, gamms.osm", "gamms.osm.graph_from_xml"
    is_loaded = "print('gamms.osm' in sys.modules)\n"
    codes = (f"import sys, gamms; {is_loaded}{ask}; {is_loaded}" for ask in asks)
    assert printed_with_a_new_gamms(codes) == ["False", "True"] * len(asks)


def test_old_modules_survive_what_tools_ask_of_modules():
    import inspect
    import pickle

    from gamms.SensorEngine.sensors_basic import MapSensor

    assert inspect.getmodule(MapSensor).__name__ == "gamms.sensor.ground"
    assert pickle.loads(pickle.dumps(MapSensor)) is MapSensor
    assert not hasattr(gamms.SensorEngine, "__wrapped__")
    assert "gamms.sensor" in gamms.SensorEngine.__doc__
    importlib.invalidate_caches()


def test_a_program_can_ask_whether_a_feature_is_there():
    assert hasattr(gamms, "Recorder")
    assert hasattr(gamms.visual, "PygameVisualizationEngine")
    assert not hasattr(gamms, "MessageEngine")
    assert hasattr(gamms.osm, "create_osm_graph")
