"""The door of the room: what may be imported from `gamms.visual`, and what it says about the rest."""

import pytest

import gamms.visual
from gamms.errors import NotYetAttribute


def test_every_public_name_is_there():
    assert all(hasattr(gamms.visual, name) for name in gamms.visual.__all__)


def test_enum_values_are_those_programs_know():
    visual = gamms.visual
    assert [one.value for one in visual.Engine] == [0, 1, 2]
    assert [one.value for one in visual.Space] == [0, 1, 2]
    assert [one.value for one in visual.Shape] == [1, 2]
    assert [one.value for one in visual.RenderMode] == [1, 2]
    assert visual.CACHE_ZOOM_MAX == 1.2


@pytest.mark.parametrize("name", ["PygameVisualizationEngine", "RenderManager", "lazy", "render_input_overlay"])
def test_a_name_of_the_window_says_that_it_is_not_built_yet(name):
    with pytest.raises(NotYetAttribute, match="Not in this version of GAMMS yet"):
        getattr(gamms.visual, name)


def test_an_import_of_the_window_is_an_import_error():
    with pytest.raises(ImportError, match="the pygame window"):
        from gamms.visual import PygameVisualizationEngine  # noqa: F401


def test_any_other_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="nonsense"):
        _ = gamms.visual.nonsense
