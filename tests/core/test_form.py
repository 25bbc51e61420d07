"""The core runs compiled or interpreted, as it was built and as GAMMS_CORE asks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gamms
from gamms.core import draws

SRC = Path(gamms.__file__).parent
SHOW = """
import gamms.core
from gamms.core import draws
print(gamms.core.is_compiled, draws.__file__.rpartition('.')[2], draws.mix(1))
"""


def run(code, source=SRC.parent, form="", more=()):
    environment = {**os.environ, "PYTHONPATH": str(source), "GAMMS_CORE": form}
    return subprocess.run(
        [sys.executable, *more, "-c", code], env=environment, capture_output=True, text=True, check=False
    )


def test_the_interpreted_form_can_be_asked_for():
    done = run(SHOW, form="python")
    assert done.stderr == ""
    assert done.stdout.split() == ["False", "py", str(draws.mix(1))]


def test_the_finder_of_the_interpreted_form_finds_nothing_but_modules_of_the_core():
    names = ("gamms.core.draws", "gamms.corpus", "gamms.text", "json.tool")
    code = f"""
import sys, gamms.core
[finder] = [one for one in sys.meta_path if type(one).__module__ == "gamms.core.form"]
print(*[bool(finder.find_spec(name, gamms.core.__path__)) for name in {names}])
"""
    assert run(code, form="python").stdout.split() == ["True", "False", "False", "False"]


def test_another_form_is_refused():
    assert "ImportError: GAMMS_CORE is 'cython': set it to 'python' or 'compiled'" in run(SHOW, form="cython").stderr


@pytest.fixture
def checkout(tmp_path):
    """A copy of the source, compiled as it is, in a folder that looks like a checkout."""
    copy = tmp_path / "src" / "gamms"
    shutil.copytree(SRC, copy, ignore=shutil.ignore_patterns("data", "__pycache__"))
    (tmp_path / "pyproject.toml").touch()
    return copy


def test_compiled_modules_that_are_not_there_can_be_missed(checkout):
    for file in [*checkout.glob("core/*.so"), *checkout.glob("core/*.pyd")]:
        file.unlink()
    assert run(SHOW, checkout.parent).stdout.startswith("False py")
    assert (
        "ImportError: GAMMS_CORE is 'compiled', and gamms.core is not" in run(SHOW, checkout.parent, "compiled").stderr
    )


@pytest.mark.compiled
def test_the_compiled_form_runs_where_there_is_one(checkout):
    done = run(SHOW, checkout.parent, "compiled", ("-W", "error"))
    assert done.stdout.split()[:2] in (["True", "so"], ["True", "pyd"])


def test_modules_of_another_machine_are_not_used_and_a_warning_says_so(checkout):
    for suffix in ("so", "pyd"):
        (checkout / "core" / f"_stamp.abi3.{suffix}").write_text("of another machine")
    done = run(SHOW, checkout.parent)
    assert done.stdout.startswith("False py")
    assert done.stderr.count("RuntimeWarning: The compiled gamms.core cannot be loaded (") == 1


@pytest.mark.compiled
def test_edited_text_runs_and_says_that_it_is_not_compiled(checkout):
    path = checkout / "core" / "draws.py"
    text = path.read_text(encoding="utf-8")
    before = "return bits ^ (bits >> 31)"
    assert text.count(before) == 1
    path.write_text(text.replace(before, "return 12345"), encoding="utf-8")
    done = run(SHOW, checkout.parent)
    assert done.stdout.split() == ["False", "py", "12345"]
    assert done.stderr.count("RuntimeWarning: The text of gamms.core has changed since it was compiled.") == 1
    assert "ImportError" in run(SHOW, checkout.parent, "compiled").stderr


IN_SUBINTERPRETER = """
import gamms.core
try:
    import _interpreters as interpreters
except ImportError:
    import _xxsubinterpreters as interpreters
run = getattr(interpreters, "exec", interpreters.run_string)
run(interpreters.create(), "import sys; sys.path[:0] = [{source!r}]; " + {code!r})
"""
TOO_MANY = "RuntimeWarning: Only one interpreter of a process can load the compiled gamms.core ("


@pytest.mark.compiled
def test_a_subinterpreter_runs_the_interpreted_form_and_says_so():
    code = "import gamms.core, gamms.core.draws as draws; print(gamms.core.is_compiled, draws.mix(1), flush=True)"
    done = run(IN_SUBINTERPRETER.format(source=str(SRC.parent), code=code))
    assert done.stdout.split() == ["False", str(draws.mix(1))]
    assert done.stderr.count(TOO_MANY) == 1
    assert "It runs interpreted: the same games, slower. Other processes run it compiled" in done.stderr
    assert "make" not in done.stderr


@pytest.mark.compiled
def test_the_compiled_form_cannot_be_asked_for_in_a_subinterpreter():
    code = (
        "import os; os.environ['GAMMS_CORE'] = 'compiled'\n"
        "try:\n import gamms.core\nexcept ImportError as error:\n print(error, flush=True)"
    )
    done = run(IN_SUBINTERPRETER.format(source=str(SRC.parent), code="pass\n" + code))
    assert done.stdout.startswith("GAMMS_CORE is 'compiled', and gamms.core is not. Only one interpreter of a process")
