"""A name in a scenario means code that its folder defines, GAMMS offers or the caller allows; nothing else."""

import itertools
import sys

import pytest
import yaml
from typer.testing import CliRunner

import gamms
from gamms import cli, recorder, scenario
from gamms.errors import BadType, BadValue
from gamms.scenario import Scenario, ScenarioError

HELPER = """
import os
import subprocess
from functools import partial
from os import system
from os.path import *
from subprocess import Popen
from gamms.strategies import stay
from .paces import pace

alias = os.system
bound = partial(os.system)


class Own:
    def __call__(self, state):
        state["action"] = state["curr_pos"]


class Inherited(Popen):
    pass


def local(state):
    state["action"] = state["curr_pos"]
"""

PACKAGE = """
from os import system
from {name}.players import raid, walk
"""
PLAYERS = """
import os

def raid(state):
    state["action"] = state["curr_pos"]

def walk(state):
    state["action"] = state["curr_pos"]

system = os.system
"""

_numbers = itertools.count()


@pytest.fixture
def canary(tmp_path):
    """A file that hostile code would make."""
    path = tmp_path / "PWNED"
    yield path
    assert not path.exists()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Installs a package of players, with entry points; yields its name."""
    name, site = f"players_{next(_numbers)}_of_a_test", tmp_path / "site"

    def install(*entry_points):
        (site / name).mkdir(parents=True)
        (site / name / "__init__.py").write_text(PACKAGE.format(name=name))
        (site / name / "players.py").write_text(PLAYERS)
        info = site / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = [f"a{number} = {value}" for number, value in enumerate(entry_points)]
        (info / "entry_points.txt").write_text("\n".join(["[gamms.scenario]", *lines]).replace("PACKAGE", name))
        monkeypatch.syspath_prepend(site)
        return name

    yield install
    for module in [module for module in sys.modules if module.partition(".")[0] == name]:
        del sys.modules[module]


def hostile(canary):
    """Functions, and parameters with which they would make the canary."""
    shell = f"touch {canary}"
    return {
        "yaml:unsafe_load": {"stream": f"!!python/object/apply:os.system ['{shell}']"},
        "yaml.constructor:UnsafeConstructor": {},
        "numpy:load": {"file": str(canary), "allow_pickle": True},
        "numpy:save": {"file": str(canary), "arr": [1]},
        "numpy.ctypeslib:load_library": {"libname": "libc.so.6", "loader_path": "/"},
        "ensurepip:bootstrap": {"root": str(canary)},
        "typer:launch": {"url": str(canary)},
        "os:system": {"command": shell},
        "posix:system": {"command": shell},
        "subprocess:run": {"args": shell, "shell": True},
        "builtins:eval": {},
        "builtins:open": {"file": str(canary), "mode": "w"},
        "_frozen_importlib:__import__": {"name": "antigravity"},
        "antigravity:fly": {},
        "__main__:run": {},
        "helper:system": {"command": shell},
        "helper.py:system": {"command": shell},
        "helper:alias": {"command": shell},
        "helper:bound": {"command": shell},
        "helper:os.system": {"command": shell},
        "helper.os:system": {"command": shell},
        "helper:Popen": {"args": shell, "shell": True},
        "helper:Inherited": {"args": shell, "shell": True},
        "helper:partial": {},
        "helper:stay": {},
        "helper:abspath": {"path": "."},
        "helper:__builtins__": {},
        "helper:__loader__": {},
        "helper:__class__": {"name": "x"},
        "helper:local.__globals__": {},
        "gamms:create_context": {},
        "gamms.osm:graph_from_file": {"path": str(canary)},
        "gamms.graph:grid": {"n": 3, "m": 3},
        "gamms.scenario:load": {"path": "helper.yaml"},
        "gamms.scenario.documents:read": {"file": "x"},
        "gamms.cli:main": {},
        "gamms.folders:write_whole": {"path": str(canary), "data": "x"},
        "gamms.strategies.travel:goto": {},
        "gamms.strategies:np": {},
        "gamms.rules:territory": {},
        "gamms.rules.territory:np": {},
        "gamms.rules.territory:as_name": {},
        "gamms.demo:load": {},
        "gamms.strategies:stay.__globals__": {},
        "gamms.strategies:__builtins__": {},
        "gamms.testing:os": {},
    }


NAMES = list(hostile("x"))


@pytest.mark.parametrize("name", NAMES)
def test_no_function_of_others_is_called(folder, made, canary, name):
    (folder / "helper.py").write_text(HELPER)
    call, before = {"function": name, "with": hostile(canary)[name]}, set(sys.modules)
    for changes in (
        {"facts": {"x": call}},
        {"data": {"x": [{"y": call}]}},
        {"map": {"generator": call}},
        {"teams.red.strategy": call},
        {"teams.red.meta": {"x": call}},
        {"sensors.near": call},
        {"rules.1": {"rule": name, "with": hostile(canary)[name]}},
        {"conflicts.resolve": name},
    ):
        with pytest.raises(ScenarioError):
            made(changes).build()
    assert not {"pip", "antigravity", "this"} & (set(sys.modules) - before)


@pytest.mark.parametrize("name", [name for name in NAMES if name.partition(":")[0] not in ("helper", "helper.py")])
def test_a_check_refuses_the_same_as_a_build(folder, made, canary, name):
    call = {"function": name, "with": hostile(canary)[name]}
    with pytest.raises(ScenarioError, match=r"^facts\.x"):
        made({"facts": {"x": call}}).check()


def test_the_command_line_refuses_it_too(folder, canary):
    call = {"function": "yaml:unsafe_load", "with": hostile(canary)["yaml:unsafe_load"]}
    given = {**yaml.safe_load((folder / "little.yaml").read_text()), "facts": {"x": call}}
    (folder / "bad.yaml").write_text(yaml.safe_dump(given))
    for arguments in (["run"], ["scenario", "check", "--build"], ["run", "--allow", "os"], ["run", "--set", "allow=x"]):
        done = CliRunner().invoke(cli.app, [*arguments, str(folder / "bad.yaml")])
        assert done.exit_code == 1
        assert done.stderr.startswith("gamms: ")
        assert "imports" not in done.stdout


def test_the_folder_offers_the_functions_of_its_files(folder, made):
    (folder / "helper.py").write_text(HELPER)
    (folder / "gamms.py").write_text("def local(state): state['action'] = state['curr_pos']\n")
    for name in ("helper:local", "helper.py:local", "helper:Own", "gamms.py:local"):
        made({"teams.red.strategy": name}).play()
    with made({"facts": {"x": {"function": "helper:pace"}}}).build() as ctx:
        assert ctx.game.facts["x"].__name__ == "pace"


def test_a_check_never_runs_a_file_that_is_named_as_gamms_is(folder, made):
    (folder / "gamms.py").write_text("raise RuntimeError('this was run')\ndef rule(ctx): pass\n")
    made({"rules.1": "gamms.py:rule"}).check()


def test_a_check_reports_functions_that_a_file_only_imports(folder, made):
    (folder / "helper.py").write_text(HELPER)
    with pytest.raises(ScenarioError, match=r"'system' is not defined in .*helper\.py, only imported there"):
        made({"teams.red.strategy": "helper:system"}).check()
    with pytest.raises(ScenarioError, match=r"'alias' in 'helper:alias' is from elsewhere, posix"):
        made({"teams.red.strategy": "helper:alias"}).build()


def test_no_package_on_the_way_to_a_file_leads_out_of_the_folder(folder, made):
    (folder.parent / "outside.py").write_text("raise RuntimeError('this was run')\n")
    (folder / "sub").mkdir()
    (folder / "sub" / "__init__.py").symlink_to(folder.parent / "outside.py")
    (folder / "sub" / "own.py").write_text("def local(state): state['action'] = state['curr_pos']\n")
    for name in ("sub.own:local", "sub/own.py:local"):
        with pytest.raises(ScenarioError, match=r"sub/__init__\.py' leads out of the folder"):
            made({"teams.red.strategy": name}).check()


def test_replaced_functions_are_not_imported(folder, made):
    (folder / "players.py").write_text("raise RuntimeError('this was run')\ndef wander(state): pass\n")
    assert made().play(strategies={"red": gamms.strategies.stay}).agents["red_0"]["moves"] == 0


def test_a_package_offers_the_functions_of_its_entry_points(made, package):
    name = package("PACKAGE.players:raid", "PACKAGE:walk", "PACKAGE.players:system", "yaml", "os:system")
    made({"teams.red.strategy": f"{name}.players:raid"}).play()
    made({"teams.red.strategy": f"{name}:walk"}).play()
    for other in (f"{name}:raid", f"{name}.players:walk", f"{name}.players:system", f"{name}:system", "os:system"):
        with pytest.raises(ScenarioError):
            made({"teams.red.strategy": other}).build()


def test_an_entry_point_that_names_a_module_offers_its_functions(made, package):
    name = package("PACKAGE.players")
    made({"teams.red.strategy": f"{name}.players:walk"}).play()
    for other in (f"{name}.players:system", f"{name}:walk"):
        with pytest.raises(ScenarioError):
            made({"teams.red.strategy": other}).build()


@pytest.mark.parametrize("name", ["os", "subprocess", "builtins", "gamms", "gamms.osm", "__main__", "a b", "", "../x"])
def test_invalid_packages_cannot_be_allowed(made, name):
    with pytest.raises(BadValue):
        Scenario(allow=[name], **made().to_dict())
    with pytest.raises(BadType):
        Scenario(allow=name, **made().to_dict())


# -- recordings ----------------------------------------------------------------------------------------------------


def recorded(tmp_path, header):
    """A recording that says of itself that it was built from a scenario."""
    with gamms.create_context() as ctx:
        ctx.game.internals.scenario = header
        ctx.record.start(tmp_path / "game")
        ctx.record.stop()
    return tmp_path / "game.ggr"


def test_a_recording_names_only_code_of_gamms(tmp_path, little, folder):
    file = recorded(tmp_path, little)
    with recorder.open(file) as recording:
        for again in (scenario.from_recording(recording), Scenario(**recording.header["scenario"])):
            with pytest.raises(ScenarioError, match="there is no module 'players' installed"):
                again.build()
        again = scenario.from_recording(recording, folder=folder)
        assert again.play() == Scenario(folder=folder, **little).play(seed=again.spec.seed)


@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith("helper")])
def test_a_recording_names_no_code_of_others(tmp_path, made, canary, name):
    call = {"function": name, "with": hostile(canary)[name]}
    file = recorded(tmp_path, made(facts={"x": call}).to_dict())
    with recorder.open(file) as recording:
        for again in (
            scenario.from_recording(recording, folder="."),
            Scenario(**recording.header["scenario"]),
            Scenario(folder=".", **recording.header["scenario"]),
        ):
            with pytest.raises(ScenarioError):
                again.build()


@pytest.mark.parametrize(("key", "value"), [("allow", ["yaml"]), ("folder", "/tmp"), ("file", "x")])
def test_a_recording_cannot_allow_packages_for_its_reader(tmp_path, little, key, value):
    with pytest.raises(recorder.RecordingError, match=f"sets '{key}'"):
        recorder.open(recorded(tmp_path, {**little, key: value}))


def test_a_recording_of_a_program_holds_no_scenario(tmp_path):
    with recorder.open(recorded(tmp_path, None)) as recording, pytest.raises(ScenarioError, match="holds no scenario"):
        scenario.from_recording(recording)


# -- code that ends the program --------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["SystemExit(3)", "GeneratorExit()", "BaseException('x')"])
def test_code_that_would_end_the_program_is_an_error(folder, made, what):
    (folder / "ending.py").write_text(f"def end():\n    raise {what}\n")
    (folder / "importing.py").write_text(f"raise {what}\ndef end(): pass\n")
    for name in ("ending:end", "importing:end"):
        with pytest.raises(ScenarioError, match=r"^facts\.x: "):
            made({"facts": {"x": {"function": name}}}).build()


@pytest.mark.parametrize("given", ["red", 3, ["red"], {1: 2}])
def test_parameters_that_are_no_mapping_are_an_error(folder, made, given):
    for function in ("gamms.rules.territory:by_distance", "players:make"):
        for changes in (
            {"facts": {"x": {"function": function, "with": given}}},
            {"teams.red.meta": {"x": [{"function": function, "with": given}]}},
        ):
            with pytest.raises(ScenarioError, match=r"^(item 1 of )?(facts|teams\.red\.meta)\.x(\.|, )with"):
                made(changes).check()


def test_a_reference_with_a_dot_for_the_colon_is_named():
    made = Scenario(
        map={"grid": {"width": 2, "height": 2}}, teams={"red": {"count": 1, "strategy": "gamms.strategies.chase"}}
    )
    with pytest.raises(ScenarioError, match=r"Did you mean 'gamms\.strategies:chase'"):
        made.build()


def test_a_reference_with_arguments_is_told_where_they_belong():
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:goto(3)"}}
    made = Scenario(map={"grid": {"width": 2, "height": 2}}, teams=teams)
    with pytest.raises(ScenarioError, match=r"Parameters belong into with: \{…\}"):
        made.build()


def test_a_reference_to_a_value_says_that_it_is_no_function(folder, made):
    (folder / "values.py").write_text("speed = 3\n")
    with pytest.raises(ScenarioError, match=r"'speed' in 'values\.py:speed' is not a function, but 3"):
        made({"teams.red.strategy": "values.py:speed"}).build()
