import pytest

from gamms.errors import GammsError
from gamms.readonly import ReadOnlyMapping

WRITES = {
    "set": lambda view: view.__setitem__("a", 2),
    "item": lambda view: exec("view['a'] = 2", {"view": view}),
    "delete": lambda view: exec("del view['a']", {"view": view}),
    "merge": lambda view: exec("view |= {'a': 2}", {"view": view}),
    **{name: lambda view, name=name: getattr(view, name)() for name in ("clear", "popitem")},
    **{name: lambda view, name=name: getattr(view, name)("a", 2) for name in ("pop", "setdefault")},
    "update": lambda view: view.update(a=2),
}


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_writing_to_a_view_says_what_to_do_instead(write):
    values = {"a": 1}
    with pytest.raises(TypeError, match=r"read-only view: .* state\['action'\] .* copy\(\)") as caught:
        write(ReadOnlyMapping(values))
    assert isinstance(caught.value, GammsError)
    assert values == {"a": 1}
