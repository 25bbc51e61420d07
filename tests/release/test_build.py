"""What is built and installed: with a C compiler, and without one."""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("Cython", reason="builds the core")
pytest.importorskip("setuptools", "77", reason="builds the core")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="there, setuptools finds the compiler by itself")

ROOT = Path(__file__).parents[2]
BUILT_FROM = ("LICENSE", "MANIFEST.in", "NOTICE", "README.md", "pyproject.toml", "setup.py", "src", "tools")
NO_COMPILER = {"CC": "/bin/false", "PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull}  # and no ziglang
WHEEL = "import sys, build_backend; print(build_backend.build_wheel(sys.argv[1]))"
GAME = """
import hashlib, pathlib, gamms, gamms.core
from gamms.core import draws
game = gamms.scenario.from_gallery("grid_tag").replace(max_turns=12)
result = game.play(seed=3, record="game.ggr")
said = hashlib.sha256(pathlib.Path("game.ggr").read_bytes()).hexdigest()
print(gamms.__file__, gamms.core.is_compiled, draws.compute_first_key(1, 2), result.scores, said)
"""


def copy_to(folder, root=ROOT):
    """Copy what GAMMS is built from, without what is built."""
    built = shutil.ignore_patterns("*.so", "*.pyd", "*.pyc", "__pycache__", "*.egg-info")
    for name in BUILT_FROM:
        source = root / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=built, copy_function=shutil.copy)
        else:
            shutil.copy(source, folder / name)
    return folder


@pytest.fixture
def checkout(tmp_path):
    """A copy of what GAMMS is built from."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    return copy_to(folder)


@pytest.fixture
def small_core(checkout):
    """A checkout whose core is two modules of one function each, which are soon compiled."""
    core = checkout / "src/gamms/core"
    for path in core.glob("*.pxd"):
        if path.stem != "__init__":
            path.unlink()
            path.with_suffix(".py").unlink()
    for name in ("copies", "pursuit"):
        (core / f"{name}.py").write_text("def twice(number: int) -> int:\n    return 2 * number\n")
        (core / f"{name}.pxd").write_text("cpdef long long twice(long long number)\n")
    return checkout


def run(*command, folder, **environment):
    """Run Python in a folder, without the variables of this process that matter; return its output and errors."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "GAMMS", "PIP"))}
    done = subprocess.run(
        list(map(str, command)),
        cwd=folder,
        env=clean | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def wheel_of(checkout, out, **environment):
    """Build a wheel by the backend alone; return its path and what was printed."""
    out.mkdir()
    said = run(sys.executable, "-c", WHEEL, out, folder=checkout, PYTHONPATH=str(checkout / "tools"), **environment)
    return out / said.split()[-1], said


def files_of(wheel):
    """Return the files of the package in a wheel, from its folder."""
    with zipfile.ZipFile(wheel) as archive:
        return {name.removeprefix("gamms/") for name in archive.namelist() if name.startswith("gamms/")}


def sources_of(checkout):
    """Return the files of the package in a checkout, from its folder."""
    folder = checkout / "src" / "gamms"
    files = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    return {file for file in files if "__pycache__" not in file}


def modules_of(checkout):
    """Return the files of the compiled modules that a checkout should give, without their suffixes."""
    names = {path.stem for path in (checkout / "src/gamms/core").glob("*.pxd")} - {"__init__"}
    return {f"core/{name}" for name in names | {"_stamp", "_shared"}}


def quick_compiler(folder):
    """Write a C compiler that neither optimizes nor keeps what debuggers need."""
    return script_in(folder, f'exec {sysconfig.get_config_var("CC")} "$@" -O0 -g0')


def empty_compiler(folder, but_for="nothing"):
    """Write a C compiler that lists its calls and leaves empty files: for what is compiled, not for what comes of it.

    It fails for one file.
    """
    return script_in(
        folder,
        f'echo "$*" >> {folder / "calls"}',
        f'case "$*" in *{but_for}.c*) exit 1;; esac',
        'while [ $# -gt 0 ]; do if [ "$1" = -o ]; then : > "$2"; fi; shift; done',
    )


def script_in(folder, *lines):
    """Write a C compiler as a script; return its path."""
    script = folder / "cc"
    script.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    script.chmod(0o755)
    return str(script)


def compiled_by(checkout, compiler):
    """Build a checkout in place; return the modules that an empty compiler compiled, by their names."""
    calls = Path(compiler).with_name("calls")
    calls.unlink(missing_ok=True)
    run(sys.executable, "setup.py", "-q", "build_ext", "--inplace", folder=checkout, CC=compiler)
    assert {path.name.partition(".")[0] for path in checkout.glob("src/gamms/core/*.so")} == {
        name.removeprefix("core/") for name in modules_of(checkout)
    }
    return {Path(word).stem for line in calls.read_text().splitlines() for word in line.split() if word.endswith(".c")}


def environment_in(folder):
    """Make an environment that has all libraries of this one, but not GAMMS."""
    run(sys.executable, "-m", "venv", "--without-pip", folder / "env", folder=folder)
    [packages] = (folder / "env" / "lib").glob("python*/site-packages")
    found = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "others.pth").write_text("\n".join(found), encoding="utf-8")
    return folder / "env" / "bin" / "python"


def has_compiler():
    """Return whether this machine compiles C."""
    command = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    return shutil.which(command[0]) is not None and "false" not in command[0]


needs_compiler = pytest.mark.skipif(not has_compiler(), reason="needs a C compiler")


@pytest.fixture(scope="module")
def game_here(tmp_path_factory):
    """What the program `GAME` prints of its game, played by this checkout."""
    folder = tmp_path_factory.mktemp("here")
    return run(sys.executable, "-c", GAME, folder=folder, PYTHONPATH=str(ROOT / "src")).split()[2:]


@pytest.mark.parametrize("how", [["."], ["-e", "."]], ids=["a wheel", "editable"])
def test_without_a_compiler_the_same_games_are_played_interpreted(checkout, tmp_path, how, game_here):
    stale = checkout / "src/gamms/core/draws.abi3.so"
    stale.write_text("of an earlier build")
    python = environment_in(tmp_path)
    options = ["-v", "--no-build-isolation", "--no-deps", "--no-compile", "--ignore-installed"]
    said = run(python, "-m", "pip", "install", *options, *how, folder=checkout, **NO_COMPILER)
    assert said.count("gamms: no C compiler works here; the core runs interpreted: the same games, slower") == 1
    file, is_compiled, *game = run(python, "-c", GAME, folder=tmp_path).split()
    assert Path(file).is_relative_to(checkout if "-e" in how else tmp_path / "env")
    assert is_compiled == "False"
    assert game_here == game


def test_a_wheel_without_compiled_modules_runs_everywhere_and_has_every_file_of_the_source(checkout, tmp_path):
    (checkout / "build/lib/gamms").mkdir(parents=True)
    (checkout / "build/lib/gamms/of_an_earlier_build.py").touch()
    wheel, _ = wheel_of(checkout, tmp_path / "out", GAMMS_CORE_BUILD="python")
    assert wheel.name.endswith("-py3-none-any.whl")
    assert files_of(wheel) == sources_of(checkout)


def test_ziglang_is_asked_for_where_no_compiler_works_and_it_can_be_had(checkout, tmp_path):
    with zipfile.ZipFile(tmp_path / "ziglang-1-py3-none-any.whl", "w") as wheel:  # only its name is looked at
        wheel.writestr("ziglang-1.dist-info/METADATA", "Metadata-Version: 2.1\nName: ziglang\nVersion: 1\n")
        wheel.writestr("ziglang-1.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        wheel.writestr("ziglang-1.dist-info/RECORD", "")
    tools = {"folder": checkout, "PYTHONPATH": str(checkout / "tools")}
    hooks = "build_backend.get_requires_for_build_wheel(), build_backend.get_requires_for_build_editable()"
    asked = "import build_backend; print('asked for', {})"
    wheel = asked.format("build_backend.get_requires_for_build_wheel()")
    assert "asked for []" in run(sys.executable, "-c", wheel, **tools, **NO_COMPILER)
    found = NO_COMPILER | {"PIP_FIND_LINKS": str(tmp_path)}
    assert "asked for ['ziglang'] ['ziglang']" in run(sys.executable, "-c", asked.format(hooks), **tools, **found)


def test_all_modules_are_compiled_or_none(small_core, tmp_path):
    wheel, said = wheel_of(small_core, tmp_path / "out", CC=empty_compiler(tmp_path, but_for="copies"))
    assert "gamms: the core could not be compiled; it runs interpreted: the same games, slower" in said
    assert wheel.name.endswith("-py3-none-any.whl")
    assert files_of(wheel) == sources_of(small_core)


def test_only_modules_whose_text_types_or_compiler_changed_are_compiled(small_core, tmp_path):
    core = small_core / "src/gamms/core"
    compiler = empty_compiler(tmp_path)
    (core / "pursuit.pxd").write_text("from gamms.core cimport copies\n" + (core / "pursuit.pxd").read_text())
    assert compiled_by(small_core, compiler) == {"pursuit", "copies", "_stamp", "_shared"}
    (core / "copies.py").write_text((core / "copies.py").read_text() + "# an edit\n")
    assert compiled_by(small_core, compiler) == {"copies", "_stamp"}
    (core / "copies.pxd").write_text((core / "copies.pxd").read_text() + "# an edit\n")
    assert compiled_by(small_core, compiler) == {"pursuit", "copies", "_stamp"}
    other = tmp_path / "other"
    other.mkdir()
    assert compiled_by(small_core, empty_compiler(other)) == {"pursuit", "copies", "_stamp", "_shared"}


@needs_compiler
def test_two_builds_in_two_folders_are_the_same_bytes(small_core, tmp_path):
    compiler = quick_compiler(tmp_path)
    for name in ("pursuit.py", "pursuit.pxd"):  # a single module is soon compiled
        (small_core / "src/gamms/core" / name).unlink()
    first, _ = wheel_of(small_core, tmp_path / "out", CC=compiler)
    assert first.name.endswith(".whl")
    assert "-cp311-abi3-" in first.name
    built = {name.partition(".abi3")[0] for name in files_of(first) - sources_of(small_core)}
    assert built == modules_of(small_core)
    before = os.umask(0o077)
    try:
        other = tmp_path / "another folder"
        other.mkdir()
        copy_to(other, small_core)
    finally:
        os.umask(before)
    for leftover in ("build/lib.of_another_machine", "src/gamms/core"):
        (other / leftover).mkdir(parents=True, exist_ok=True)
        (other / leftover / "leftover.abi3.so").touch()
    second, _ = wheel_of(other, tmp_path / "second", CC=compiler)
    assert first.read_bytes() == second.read_bytes()


@needs_compiler
def test_a_build_in_place_that_fails_leaves_no_module_of_an_earlier_one(small_core):
    for name in modules_of(small_core):
        for folder in (small_core / "src/gamms", small_core / "out/gamms"):
            (folder / "core").mkdir(parents=True, exist_ok=True)
            (folder / f"{name}.abi3.so").write_text("of an earlier build")
    options = ["--inplace", "--build-lib=out", "--compiler=none"]
    said = run(sys.executable, "setup.py", "build_ext", *options, folder=small_core)
    assert "gamms: the core could not be compiled" in said
    assert not list(small_core.rglob("*.so"))


def test_a_build_has_no_files_of_an_earlier_one(checkout):
    build = (sys.executable, "setup.py", "-q", "build", "--build-lib", "built")
    gone = checkout / "src/gamms/gone.py"
    gone.touch()
    run(*build, folder=checkout, GAMMS_CORE_BUILD="python")
    assert (checkout / "built/gamms/gone.py").exists()
    gone.unlink()
    run(*build, folder=checkout, GAMMS_CORE_BUILD="python")
    assert (checkout / "built/gamms/plain.py").exists()
    assert not (checkout / "built/gamms/gone.py").exists()
