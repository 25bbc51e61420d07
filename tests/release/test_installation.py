"""The distribution: which libraries its extras bring, and that it refuses to run among files of gamms 1.0.0."""

import json
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import gamms
from gamms.errors import DISTRIBUTION, install_command

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]


@pytest.fixture
def metadata(tmp_path, monkeypatch):
    """The metadata of an installed distribution with the extras of pyproject.toml, in front of what is installed."""
    lines = [f"Requires-Dist: {one}; extra == '{extra}'" for extra in EXTRAS for one in EXTRAS[extra] if ";" not in one]
    folder = tmp_path / "gamms_engine-1.2.3.dist-info"
    folder.mkdir()
    header = ["Metadata-Version: 2.4", f"Name: {DISTRIBUTION}", "Version: 1.2.3"]
    (folder / "METADATA").write_text(
        "\n".join([*header, *(f"Provides-Extra: {extra}" for extra in EXTRAS), *lines, ""])
    )
    monkeypatch.syspath_prepend(tmp_path)


def test_the_distribution_and_its_extras_refer_to_each_other_by_one_name():
    assert PROJECT["name"] == DISTRIBUTION
    named = [one for extra in EXTRAS.values() for one in extra if one.startswith("gamms")]
    assert named
    assert {re.match(r"[\w-]+", one)[0] for one in named} == {DISTRIBUTION}
    assert {name for one in named for name in re.search(r"\[(.*)\]", one)[1].split(",")} <= set(EXTRAS)


@pytest.mark.usefixtures("metadata")
def test_an_install_command_names_every_library_of_an_extra_and_no_distribution_of_gamms():
    for extra in EXTRAS.keys() - {"dev"}:
        command = install_command(extra)
        assert "gamms" not in command
        assert all(f'"{one}"' in command for one in EXTRAS[extra] if not one.startswith(DISTRIBUTION))
    assert install_command("torchrl") == "pip install " + " ".join(
        f'"{one}"' for one in [*EXTRAS["rl"], *EXTRAS["torch"], *EXTRAS["torchrl"][1:]]
    )


def test_no_page_and_no_message_installs_an_extra_of_the_package_of_others():
    tracked = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "src").rglob("*.py")]
    assert not [path for path in tracked if re.search(r"pip install[^\n]*\"gamms\[", path.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("first", ["import gamms", "import gamms.scenario", "import gamms.cli; gamms.cli.main()"])
def test_files_of_gamms_1_among_ours_are_refused_at_import(tmp_path, first):
    copy = shutil.copytree(Path(gamms.__file__).parent, tmp_path / "gamms", ignore=shutil.ignore_patterns("*.gamms"))
    (copy / "AgentEngine").mkdir()
    if first != "import gamms":
        (copy / "__init__.py").write_text("")  # that of 1.0.0, which was installed last
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {first}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "ImportError: The distributions" in done.stderr
    assert f"pip uninstall gamms {DISTRIBUTION}" in done.stderr


def test_the_recipe_of_conda_installs_the_requirements_of_the_project():
    recipe = yaml.safe_load((ROOT / "tools" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    requirements = recipe["requirements"]
    assert recipe["context"]["version"] == gamms.__version__
    assert recipe["package"]["name"] == DISTRIBUTION
    assert recipe["build"]["python"]["entry_points"] == [f"gamms = {PROJECT['scripts']['gamms']}"]
    assert [one.replace(" ", "") for one in requirements["host"]] == ["python", "pip", *build]
    needed = [f"python{PROJECT['requires-python']}", *PROJECT["dependencies"]]
    assert [one.replace(" ", "") for one in requirements["run"]] == needed


def test_the_notebook_plays_with_the_extras_that_it_installs(tmp_path, monkeypatch, capsys):
    notebook = json.loads((ROOT / "examples" / "notebook.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    install, *programs = cells
    extras = re.fullmatch(rf'%pip install --quiet "{DISTRIBUTION}\[(.*)\]"', install)[1]
    assert set(extras.split(",")) <= EXTRAS.keys()
    monkeypatch.chdir(tmp_path)
    names = {}
    for program in programs:
        exec(program, names)
    with names["ctx"], names["recording"] as recording:
        assert recording.turns == names["result"].turns
    assert "police after 78 turns" in capsys.readouterr().out


@pytest.fixture(scope="module")
def check_release():
    """The names of the script that checks a release."""
    return runpy.run_path(str(ROOT / "scripts" / "check_release.py"))


def test_a_release_fails_where_its_extras_cannot_be_installed(check_release, monkeypatch, tmp_path):
    monkeypatch.setitem(check_release["_checked"].__globals__, "_environment", lambda *_: Path(sys.executable))
    said = check_release["_checked"](tmp_path, sys.executable, [tmp_path / "no.whl"], ["docs"], [])
    assert said.startswith("FAILED, cannot be installed: "), said


def test_a_release_is_not_well_if_there_is_no_interpreter_to_check(check_release, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["check_release.py", "--python", "python0.1"])
    with pytest.raises(SystemExit, match="2"):
        check_release["main"]()
    printed = capsys.readouterr()
    assert "python0.1: not found here, skipped" in printed.out
    assert "there is no interpreter to check" in printed.err


def test_the_lower_bound_of_each_library_is_installed_by_make_lowest(check_release, tmp_path):
    wanted = [one for name, extra in EXTRAS.items() if name != "dev" for one in extra if not one.startswith("gamms")]
    wanted += PROJECT["dependencies"]
    _, file = check_release["_constraints"](tmp_path, sorted(EXTRAS.keys() - {"dev"}), [])
    names = {line.partition("==")[0] for line in file.read_text("utf-8").splitlines()}
    assert names == {re.match(r"[\w.-]+", one)[0] for one in wanted}
