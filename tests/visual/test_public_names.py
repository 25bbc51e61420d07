"""The public names of `gamms.visual`, and what its `__init__` says about the rest."""

import subprocess
import sys

import pytest

import gamms.visual


def test_every_public_name_is_there():
    assert all(hasattr(gamms.visual, name) for name in gamms.visual.__all__)


def test_enum_values_are_those_programs_know():
    visual = gamms.visual
    assert [one.value for one in visual.Engine] == [0, 1, 2, 3]  # 3, the browser, is ours
    assert [one.value for one in visual.Space] == [0, 1, 2]
    assert [one.value for one in visual.Shape] == [1, 2]
    assert [one.value for one in visual.RenderMode] == [1, 2]
    assert visual.CACHE_ZOOM_MAX == 1.2


def test_the_window_is_loaded_when_it_is_first_asked_for():
    code = """
import sys, gamms
before = {name for name in sys.modules if name.startswith("gamms.visual.window")}
from gamms.visual import PygameVisualizationEngine, RenderManager
print(before, PygameVisualizationEngine is gamms.visual.WindowEngine, "pygame" in sys.modules)
"""
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set() True False\n"


def test_a_lazy_module_is_imported_when_it_is_used():
    assert gamms.visual.lazy("math").sqrt(4.0) == 2.0
    with pytest.raises(ModuleNotFoundError):
        _ = gamms.visual.lazy("gamms.no_such_module").anything


def test_any_other_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nonsense"):
        _ = gamms.visual.nonsense
