"""The structural rules, as tests: a broken rule names the file and the fix."""

import ast
import inspect
import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import gamms
from gamms.ir.schema import AGENT_COLUMNS

sys.path.insert(0, str(Path(__file__).parent.parent / "scripts"))
import draw_architecture
from syntax import is_there, nodes_of, size_of, tree_of

SRC = Path(gamms.__file__).parent
MODULES = sorted(
    path for path in SRC.rglob("*.py") if "data" not in path.relative_to(SRC).parts
)  # there: code of games, as users write it
PACKAGES = sorted(path for path in MODULES if path.name == "__init__.py")

FORBIDDEN = {"utils", "helpers", "common", "base", "manager", "impl"}
HEAVY = [
    "http.client",
    "networkx",
    "shapely",
    "pygame",
    "osmnx",
    "pandas",
    "requests",
    "matplotlib",
    "numba",
    "scipy",
    "cbor2",
    "sqlite3",
    "osmium",
    "pyproj",
    "typer",
    "rich",
    "msgspec",
    "yaml",
    "PIL",
    "av",
]

# The layers from the top, as pyproject.toml gives them to import-linter.
LAYERS = draw_architecture.layers()
UNINSTALLED = {"rl.sb3", "rl.tensor_env"}  # modules for libraries that the tests do without
OUTSIDE = {"", "compat", "__main__"}  # the package root, and the table of old paths, which names every package
CLIENTS = {name for row in LAYERS[: LAYERS.index(["context"])] for name in row}  # they use a context as users do
LEVEL = {package: -row for row, packages in enumerate(LAYERS) for package in packages}


def shown(path):
    return str(path.relative_to(SRC))


def package_of(path):
    parts = path.relative_to(SRC).with_suffix("").parts
    return "" if parts == ("__init__",) else parts[0]


def packages_imported_by(nodes):
    """Yield the packages of gamms that a module imports, but for those that only a type checker sees."""
    hidden = {
        id(node)
        for test in nodes
        if isinstance(test, ast.If) and isinstance(test.test, ast.Name) and test.test.id == "TYPE_CHECKING"
        for part in test.body
        for node in ast.walk(part)
    }
    for node in nodes:
        if id(node) in hidden:
            continue
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module == "gamms":
            names = [f"gamms.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        else:
            continue
        yield from (name.split(".")[1] for name in names if name.startswith("gamms."))


def test_a_file_states_its_purpose():
    for path in MODULES:
        docstring = ast.get_docstring(tree_of(path))
        assert docstring, f"{shown(path)} has no module docstring"
        assert docstring.splitlines()[0].rstrip().endswith((".", ":", "!", "?", "─")), shown(path)


def test_a_file_imports_only_from_lower_layers():
    for path in MODULES:
        package = package_of(path)
        if package in OUTSIDE:
            continue
        assert package in LEVEL, f"{package!r} is in no layer: give it one in pyproject.toml"
        for other in set(packages_imported_by(nodes_of(path))) - {package}:
            assert LEVEL.get(other, 99) < LEVEL[package], f"{shown(path)} imports {other}, which is not below {package}"


def test_names_of_files_are_words_of_the_field():
    vague = [shown(path) for path in MODULES if FORBIDDEN & set(path.relative_to(SRC).with_suffix("").parts)]
    assert vague == [], "use a word of the domain"


def test_a_package_states_its_allowed_imports():
    for path in PACKAGES:
        is_empty = len(path.read_text().splitlines()) == 1
        docstring = ast.get_docstring(tree_of(path)) or ""
        is_said = is_empty or re.search(r"[Mm]ay import|A client", docstring)
        assert is_said or path.parent.parent != SRC, f"{shown(path)}: say 'May import: …'"


def test_an_import_from_a_higher_layer_would_be_found():
    lines = ast.parse("from gamms import agent\nimport gamms.osm.load")
    assert set(packages_imported_by(list(ast.walk(lines)))) == {"agent", "osm"}
    tree = ast.parse("if TYPE_CHECKING:\n    from gamms.agent.engine import X\nelse:\n    import gamms.ir.draw")
    assert list(packages_imported_by(list(ast.walk(tree)))) == ["ir"]


def test_the_package_root_lists_exactly_the_public_names():
    assert gamms.__all__ == sorted(gamms.__all__)
    assert len(set(gamms.__all__)) == len(gamms.__all__)
    public = {name for name, value in vars(gamms).items() if not name.startswith("_")}
    submodules = {name for name in public if isinstance(getattr(gamms, name), ModuleType)}
    assert public - submodules <= set(gamms.__all__)
    assert all(hasattr(gamms, name) for name in gamms.__all__)


@pytest.mark.parametrize("path", [path for path in PACKAGES if path.parent != SRC], ids=shown)
def test_a_package_lists_its_public_names(path):
    module = __import__(".".join(("gamms", *path.parent.relative_to(SRC).parts)), fromlist=["x"])
    offered = getattr(module, "__all__", [])
    assert len(set(offered)) == len(offered)
    for name in offered:
        getattr(module, name)


def test_only_clients_import_the_package_root():
    for path in MODULES:
        for node in nodes_of(path):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert "gamms" not in names or package_of(path) in CLIENTS, f"{shown(path)} imports gamms itself"
            assert not (isinstance(node, ast.ImportFrom) and node.level), f"{shown(path)} imports relatively"


def test_importing_gamms_loads_next_to_nothing():
    code = f"""
import sys, gamms
ours = [name for name, module in sys.modules.items() if "gamms" in name and type(module) is type(sys)]
print([name for name in ["numpy", "logging", *{HEAVY}] if name in sys.modules], len(ours) <= 5)
"""
    loaded = subprocess.check_output([sys.executable, "-W", "error", "-c", code], text=True).strip()
    assert loaded == "[] True"


def test_completion_sees_every_package_that_type_checkers_see():
    tree = ast.parse((SRC / "__init__.py").read_text())
    typed = {
        alias.name
        for block in tree.body
        if isinstance(block, ast.If)
        for line in block.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
    folders = {path.parent.name for path in PACKAGES if path.parent.parent == SRC}
    assert folders - {"cli", "demo", "ir", "kernels", "knowledge"} <= typed <= set(dir(gamms))
    assert all(getattr(gamms, name) is not None for name in typed)


def test_a_game_without_maps_and_files_loads_nothing_heavy_and_scenarios_only_what_they_use():
    code = f"""
import sys, gamms
with gamms.create_context(logger_config={{"level": "CRITICAL"}}) as ctx:
    for id in (0, 1):
        ctx.graph.graph.add_node({{"id": id, "x": id, "y": 0}})
    ctx.graph.graph.add_edge({{"id": 0, "source": 0, "target": 1, "length": 1.0}})
    for kind in ("NEIGHBOR", "MAP", "RANGE", "AGENT_ARC"):
        ctx.sensor.create_sensor(kind, gamms.sensor.SensorType[kind])
    ctx.visual.set_graph_visual()
    agent = ctx.agent.create_agent("a", start_node_id=0, sensors=list(ctx.sensor.sensors))
    agent.get_state()["action"] = 1
    agent.set_state()
    ctx.rng.random()
print([m for m in {HEAVY} if m in sys.modules])
import gamms.tournament.host  # as the launcher of an entry does, with all that scenarios load
print([m for m in ["gamms.osm", "gamms.bridge", "asyncio"] if m in sys.modules])
import gamms.osm
print([m for m in ["http.client", "ssl"] if m in sys.modules])
"""
    loaded = subprocess.check_output([sys.executable, "-W", "error", "-c", code], text=True).splitlines()
    assert loaded == ["[]", "[]", "[]"]


def test_a_command_loads_its_libraries_when_it_runs():
    """All commands are listed without NumPy and without what plays games, as for `gamms --version` and `--help`."""
    code = "import sys, gamms.cli.commands; print(*sys.modules)"
    loaded = subprocess.check_output([sys.executable, "-W", "error", "-c", code], text=True).split()
    packages = {name.split(".")[1] for name in loaded if name.startswith("gamms.")}
    assert packages - {"Recorder"} == {"compat", "cli", "errors", "folders", "limits", "progress", "text"}
    assert "numpy" not in loaded


@pytest.mark.parametrize("path", sorted(SRC.glob("cli/*.py")), ids=shown)
def test_commands_print_by_way_of_one_file(path):
    text = path.read_text()
    assert path.name == "output.py" or not re.search(r"typer\.echo|(?<![.\w])print\(|Console\(", text), (
        f"{shown(path)} prints on its own: use echo and console of cli/output.py, which escape control characters"
    )


def test_no_files_import_each_other_in_a_circle():
    """Imports for type checkers and those in functions count; the package root, which names everything, does not."""
    modules = draw_architecture.imports_of_modules()
    modules = {name: others - OUTSIDE for name, others in modules.items() if name not in OUTSIDE}
    draw_architecture.levels(modules)  # which names the files of a circle


ENGINE = ("core", "game", "rules", "strategies", "belief")
GONE = tomllib.loads((Path(__file__).parent / "gone.toml").read_text(encoding="utf-8"))
PARTS = [part for part, value in GONE.items() if isinstance(value, dict)]


def test_the_source_stays_small():
    assert len(MODULES) <= 465, f"{len(MODULES)} files: merge those that are always read together"


@pytest.mark.parametrize("part", PARTS)
def test_what_is_deleted_stays_deleted(part):
    lists = GONE[part]
    back = [entry for entry in lists["gone"] if is_there(entry, SRC)]
    assert back == [], "these were deleted"
    deleted = [entry for entry in lists["there"] if not is_there(entry, SRC)]
    assert deleted == [], "move these lines of tests/gone.toml to `gone`"


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ("context.py", True),
        ("recorder/", True),
        ("game/guests.py", False),
        ("Context", True),
        ("context.py:Context", True),
        ("clocks.py:Context", False),
        ("Context.terminate", True),
        ("Context.play", False),
        ("context.py <= 10", True),
        ("context.py <= 100000", False),
        ("Context <= 100000", False),
    ],
)
def test_what_is_there_is_found(entry, expected):
    assert is_there(entry, SRC) is expected


@pytest.mark.parametrize(("number", "packages"), [("engine", ENGINE), ("src", ("",))])
def test_the_source_has_the_stated_number_of_syntax_nodes(number, packages):
    found = sum(size_of(path) for package in packages for path in (SRC / package).rglob("*.py"))
    most = GONE[number]
    assert most - 500 < found < most, f"{found} syntax nodes: tests/gone.toml says {number} = {most}"


def test_a_span_of_time_is_written_once():
    """Constants of the same name and as many seconds are one: import it."""
    places = {}
    for path in MODULES:
        for line in tree_of(path).body:
            if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]).endswith("_S"):
                places.setdefault(ast.unparse(line), []).append(shown(path))
    assert {constant: files for constant, files in places.items() if len(files) > 1} == {}


def test_a_context_has_a_type():
    untyped = [
        f"{shown(path)}:{arg.lineno}"
        for path in MODULES
        if path.parent.name != "core"  # which knows no context
        for arg in nodes_of(path)
        if isinstance(arg, ast.arg) and arg.arg == "ctx" and arg.annotation and ast.unparse(arg.annotation) == "Any"
    ]
    assert not untyped


def test_few_parameters_take_anything():
    bare = [
        f"{shown(path)}:{arg.lineno} {arg.arg}"
        for path in MODULES
        if path.parent.name != "core"  # which knows none of the classes of the objects that it is handed
        for arg in nodes_of(path)
        if isinstance(arg, ast.arg) and arg.annotation is not None and ast.unparse(arg.annotation) == "Any"
    ]
    assert len(bare) < 150, f"{len(bare)} parameters are Any: give them a type"


def test_a_class_has_at_most_25_public_methods():
    for path in MODULES:
        for node in nodes_of(path):
            if isinstance(node, ast.ClassDef):
                methods = {part.name for part in node.body if is_plain_method(part)}
                assert len(methods) <= PUBLISHED.get(node.name, 25), f"{shown(path)}: {node.name} has {len(methods)}"


PUBLISHED = {"Graph": 35, "IGraph": 28}  # of which 1.0.0 published 12


def is_plain_method(node):
    if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
        return False
    decorators = {ast.unparse(decorator) for decorator in node.decorator_list}
    return not any("property" in name or name.endswith(".setter") for name in decorators)


def classes():
    """Yield all classes of GAMMS."""
    for module in draw_architecture.imports_of_modules():
        if module not in OUTSIDE | UNINSTALLED:
            loaded = import_module(f"gamms.{module}")
            yield from (one for one in vars(loaded).values() if inspect.isclass(one) and is_of(one, loaded.__name__))


def is_of(kind, module):
    return getattr(kind, "__module__", None) == module


def levels(kind):
    """Return how many classes inherit from each other; contracts, the guards of strategies and errors are no levels."""
    module = kind.__module__
    counts = module.startswith("gamms.") and module.split(".")[1] not in ("typing", "deciding", "readonly", "errors")
    return counts + max((levels(base) for base in kind.__bases__), default=0)


def test_a_class_has_at_most_three_levels():
    deep = {f"{kind.__module__}.{kind.__qualname__}" for kind in classes() if levels(kind) > 3}
    assert {name for name in deep if "Occluded" not in name} == set()  # these are names of 1.0.0's


PUBLIC = {"_replace", "_asdict", "_fields", "_make"}  # of every NamedTuple
ALLOWED = {
    "os._exit",  # public, whatever its name
    "look.sensor._owner",  # of a built-in sensor, read at each ask
    "numpy_random._bit_generator",  # decision 0063
}


def test_no_package_uses_underscore_names_of_another():
    defined = {}
    for path in MODULES:
        names = defined.setdefault(package_of(path), set(PUBLIC))
        for node in nodes_of(path):
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                names.add(node.name)
            elif (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id in ("self", "cls")
            ):
                names.add(node.attr)
            elif isinstance(node, ast.Constant):
                names.add(node.value)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names.add(node.id)
    foreign = [
        f"{shown(path)}:{node.lineno} {ast.unparse(node)}"
        for path in MODULES
        for node in nodes_of(path)
        if isinstance(node, ast.Attribute) and re.match(r"_[a-z]", node.attr)
        if node.attr not in defined[package_of(path)] and path.name != "engine.py"
        if ast.unparse(node) not in ALLOWED
    ]
    assert not foreign


PLAYS = {
    "advances the turn": {"core/moves.py end_part", "core/turn.py run_after_moves"},  # in the core, and of a game alone
    "plays the phases": {"core/turn.py play_entries"},  # of a game, and of the games of a batch
    "orders the phases": {"core/turn.py make_plan"},
    "calls a strategy": {
        "agent/agent.py step",  # outside of turns
        "core/ask.py ask_each",
        "game/array_functions/given.py _make_plan",
        "game/array_functions/given.py plan",  # of agents that outside actions leave to their strategies
        "game/decisions.py _put",  # plans, and strategies of agents that the core does not ask
    },
    "calls a rule": {
        "game/settings.py apply",
        "game/settings.py _make_player",  # makes what `apply` calls
    },
}


def test_each_step_of_a_turn_has_one_place():
    found = {what: set() for what in PLAYS}
    for path in MODULES:
        if path.parts[path.parts.index("gamms") + 1] not in ("agent", "core", "game", "rules", "strategies"):
            continue
        for function in nodes_of(path):
            if isinstance(function, ast.FunctionDef):
                for what in steps_of(function):
                    found[what].add(f"{shown(path)} {function.name}")
    assert found == PLAYS


OF_AGENTS = {column.name for column in AGENT_COLUMNS if column.is_in_block}


def test_only_the_block_of_agents_writes_its_columns():
    writers = set()
    for path in MODULES:
        for node in nodes_of(path):
            if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
                column = ast.unparse(node.value)
                of_block, _, name = column.rpartition(".")
                if (of_block.endswith("block") and name in OF_AGENTS) or re.match(r"getattr\(.*block\b", column):
                    writers.add(shown(path))
    assert writers == {"ir/agents.py"}


def steps_of(function):
    """Yield which steps of a turn a function plays itself."""
    for node in ast.walk(function):
        if isinstance(node, ast.AugAssign) and re.fullmatch(
            r"(state|games)\.turn(\[game\])?", ast.unparse(node.target)
        ):
            yield "advances the turn"
        elif isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            if called == "entry.play":
                yield "plays the phases"
            if called == "Entry":
                yield "orders the phases"
            if re.search(r"(^|\.)strategy$|^question\.function$", called) and node.args:
                yield "calls a strategy"
            if called == "now.play" or "named.rule" in (called, *(ast.unparse(one) for one in node.args[:1])):
                yield "calls a rule"


def attributes_set_by(method):
    """Return the names of the attributes of `self` that a method sets."""
    return {
        node.attr
        for node in ast.walk(method)
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and ast.unparse(node.value) == "self"
    }


def test_objects_have_most_of_their_attributes_from_the_beginning():
    """At most 15 attributes are set by other methods than `__init__`; those of the core are declared in its headers."""
    late = {}
    packages = {"game", "rules", "strategies", "belief"}
    for path in MODULES:
        for node in nodes_of(path) if packages.intersection(path.parts) else ():
            if isinstance(node, ast.ClassDef):
                methods = [one for one in node.body if isinstance(one, ast.FunctionDef)]
                of = {
                    is_init: set().union(
                        *(attributes_set_by(one) for one in methods if (one.name == "__init__") is is_init)
                    )
                    for is_init in (True, False)
                }
                late[f"{shown(path)} {node.name}"] = len(of[False] - of[True])
    assert {name: number for name, number in late.items() if number > 15} == {}


def test_code_that_handles_all_columns_of_a_batch_names_none():
    """A new column is declared once: starts, checkpoints and `columns()` follow from its declaration."""
    state = next(path for path in MODULES if path.parts[-3:] == ("game", "block", "state.py"))
    tree = tree_of(state)
    table = next(line.value for line in tree.body if isinstance(line, ast.Assign) and line.targets[0].id == "COLUMNS")
    columns = {entry.args[0].value for entry in table.elts}
    assert {"node", "turn"} < columns
    of_games = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "GameArrays")
    named = {
        (method.name, node.attr)
        for method in of_games.body
        if isinstance(method, ast.FunctionDef) and method.name in ("reset", "checkpoint", "_get_remembered_columns")
        for node in ast.walk(method)
        if isinstance(node, ast.Attribute) and node.attr in columns and ast.unparse(node.value) == "self"
    }
    assert named == set()
