"""What tests of several packages need; each package brings its own `ctx`."""

import gc
import logging
import os
import signal
import subprocess
import sys
from functools import cache

import pytest
from hypothesis import is_hypothesis_test, settings
from hypothesis.internal.conjecture import providers

import gamms

if not gamms.core.is_compiled:
    os.environ["GAMMS_CORE"] = "python"  # programs of tests run the same form, and say nothing about it

# Keep what Python compiles: else each run, each of its processes and each program of a test compiles all files again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

for variable in ("COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR"):  # of the terminal in which the tests are started
    os.environ.pop(variable, None)  # or printed tables would have other lines

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a third of the time in which programs of tests import NumPy

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as shells start what runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)  # or no program of a test would hear Ctrl-C

gc.disable()  # until all tests are collected
gc.set_threshold(20_000, 30)  # much less often than usual: most of what is looked through is no garbage

SLOWEST = ("release/test_build.py", "tournament/test_tournaments.py", "tournament/test_entries.py", "web/test_live.py")

settings.register_profile("gamms", deadline=None, derandomize=True, max_examples=20)  # none is about time, or luck
settings.load_profile("gamms")
if hasattr(providers, "is_local_module_file"):  # else examples follow from all constants in all modules loaded so far
    providers.is_local_module_file = lambda path: False


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their markers
def pytest_collection_modifyitems(items):
    """Begin with the slowest files, mark all laws, and leave out what needs a compiled core where it is interpreted.

    Try ten times as many examples of each law, and others in each run, where GAMMS_THOROUGH is 1. Try half as many
    where GAMMS_BRIEF is 1: the second run of `make test`, interpreted, only has to find what differs from the first.
    """
    slowest = {path for path in {item.path for item in items} if any(map(path.match, SLOWEST))}
    items.sort(key=lambda item: item.path not in slowest)  # or a process would be left alone with one of them
    laws = [item for item in items if is_hypothesis_test(getattr(item, "function", None))]
    for item in laws:
        item.add_marker(pytest.mark.law)
    if not gamms.core.is_compiled:
        for item in items:
            if item.get_closest_marker("compiled"):
                item.add_marker(pytest.mark.skip("gamms.core is interpreted"))
    is_thorough, is_brief = (os.environ.get(name) == "1" for name in ("GAMMS_THOROUGH", "GAMMS_BRIEF"))
    if is_thorough or is_brief:
        for law in {item.function for item in laws}:
            given = law._hypothesis_internal_use_settings
            count = 10 * given.max_examples if is_thorough else (given.max_examples + 1) // 2
            chosen = settings(given, max_examples=count, derandomize=given.derandomize and not is_thorough)
            law._hypothesis_internal_use_settings = chosen


def pytest_collection_finish():
    """Do once what takes long, build the command line, and do not look through thousands of tests for garbage."""
    if (runner := sys.modules.get("typer.testing")) is not None:
        runner._get_command = cache(runner._get_command)  # half of the time of a command
    gc.freeze()
    gc.enable()


@pytest.fixture(autouse=True)
def _log_level_of_its_own():
    """Begin every test with the level that the logger of all contexts has in a new process."""
    if (logger := logging.getLogger("gamms")).level != logging.NOTSET:  # setting it asks all loggers of all libraries
        logger.setLevel(logging.NOTSET)


@pytest.fixture
def collect():
    """What collects the garbage that is new since the test began: all of pytest takes half a second to look through."""
    gc.freeze()
    return gc.collect


@pytest.fixture
def no_collection():
    """Collect no garbage: where time is measured, all of pytest would be looked through in it."""
    gc.disable()
    yield
    gc.enable()


IN_TURN = """
import sys

for code in sys.argv[1:]:
    for name in [name for name in sys.modules if name.partition(".")[0] == "gamms"]:
        del sys.modules[name]
    exec(code, {})
"""


@pytest.fixture
def printed_with_a_new_gamms():
    """What pieces of code print of which each is the first that imports GAMMS, all of them in one process."""

    def printed(codes):
        return subprocess.check_output([sys.executable, "-W", "error", "-c", IN_TURN, *codes], text=True).split()

    return printed


class Listener:
    """A logger that keeps the warnings."""

    def __init__(self):
        self.warnings = []

    def warning(self, message):
        self.warnings.append(message)

    def debug(self, message):
        """Keep nothing."""

    info = error = critical = setLevel = debug


@pytest.fixture
def heard(ctx):
    """The warnings of the context."""
    ctx.logger = Listener()
    return ctx.logger.warnings


@pytest.fixture
def town():
    """A grid of 4 x 5 nodes, 100 m apart, near Helsinki."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        grid = gamms.graph.grid(4, 5, spacing=100.0)
        for _, place in grid.nodes(data=True):
            place["x"], place["y"] = place["x"] + 385_000, place["y"] + 6_672_000
        grid.graph["crs"] = "EPSG:32635"
        ctx.graph.attach_networkx_graph(grid)
        yield ctx
