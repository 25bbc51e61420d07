"""Components: a user's named objects, what they report, and the defects of 1.0.0 that they are rid of."""

from typing import Optional

import pytest

from gamms.errors import BadType, Duplicate, UnknownName
from gamms.recorder.components import Components


class Log(list):
    """The events of one registry; refuses them when told to."""

    is_full = False

    def __call__(self, opcode_name, data):
        if self.is_full:
            raise OSError("disk full")
        self.append((opcode_name, data))

    def names(self):
        return [name.removeprefix("COMPONENT_") for name, _ in self]


@pytest.fixture
def log():
    return Log()


@pytest.fixture
def components(log):
    return Components(log)


@pytest.fixture
def gate(components):
    """A component class whose author wrote an `__init__`."""

    @components.component(struct={"count": int, "way": tuple[int, ...], "notes": list[str]})
    class Gate:
        def __init__(self, count, *, extra=None):
            self.count = count
            self.extra = extra

    return Gate


# -- as in 1.0.0 --------------------------------------------------------------------------------------------------


def test_components_are_found_by_name(components, gate):
    one = gate("one", 1)
    components.add_component("thing", 5)
    assert components.get_component("one") is one
    assert list(components.component_iter()) == ["one", "thing"]
    assert components._components == {"one": one, "thing": 5}
    with pytest.raises(UnknownName, match=r"component 'ones'.*Did you mean 'one'"):
        components.get_component("ones")
    with pytest.raises(KeyError):
        components.delete_component("two")
    with pytest.raises(ValueError, match="'thing'"):
        components.add_component("thing", 6)


def test_classes_are_found_by_module_and_name(components, gate):
    key = (gate.__module__, gate.__qualname__)
    assert components.is_component_registered(key)
    assert components._component_registry == {key: gate}
    components.unregister_component(key)
    assert not components.is_component_registered(key)
    with pytest.raises(KeyError):
        components.unregister_component(key)


def test_a_field_takes_the_given_value(gate):
    assert gate("one", "no number").count == "no number"


def test_no_struct_leaves_the_class_alone(components, log, capsys):
    class Plain:
        pass

    before = dict(vars(Plain))
    assert components.component(struct=None)(Plain) is Plain
    assert vars(Plain) == before
    assert log == []
    assert "nothing of this class is recorded" in capsys.readouterr().out


class Named:
    def __init__(self, name):
        pass


class NamedToo:
    def __init__(self, **name):
        pass


class HasIt:
    count = 1


class Slots:
    __slots__ = ("x",)


@pytest.mark.parametrize(
    ("struct", "cls"),
    [
        ([int], type("A", (), {})),
        ({1: int}, type("A", (), {})),
        ({"name": int}, type("A", (), {})),
        ({"__del__": int}, type("A", (), {})),
        ({"__recorded_component_": int}, type("A", (), {})),
        ({"count": None}, type("A", (), {})),
        ({"count": bytes}, type("A", (), {})),
        ({"count": int}, HasIt),
        ({"count": int}, Named),
        ({"count": int}, NamedToo),
        ({"count": int}, Slots),
        ({"count": int}, len),
        ({"count": int}, 3),
    ],
)
def test_a_class_that_cannot_be_a_component_is_refused_and_unchanged(components, log, struct, cls):
    before = dict(vars(cls)) if isinstance(cls, type) else None
    with pytest.raises(BadType):
        components.component(struct=struct)(cls)
    assert log == []
    assert components._component_registry == {}
    assert before is None or dict(vars(cls)) == before


# -- what 1.0.0 gets wrong ----------------------------------------------------------------------------------------


def test_a_class_needs_no_init(components, log):
    @components.component(struct={"count": int})
    class Bare:
        pass

    Bare("b").count = 5
    assert log.names() == ["REGISTER", "CREATE", "UPDATE"]
    with pytest.raises(TypeError):
        Bare("c", 5)


def test_the_callers_dict_is_left_alone(components):
    struct = {"count": int, "maybe": Optional[int]}  # noqa: UP045
    before = dict(struct)
    components.component(struct=struct)(type("A", (), {}))
    assert struct == before


def test_a_second_component_of_a_name_is_refused_before_it_is_reported(components, gate, log):
    one = gate("one", 1)
    before = list(log)
    with pytest.raises(Duplicate, match="'one'"):
        gate("one", 2)
    assert log == before
    assert components.get_component("one") is one
    assert one.count == 1


def test_a_component_whose_init_fails_is_taken_back(gate, log):
    with pytest.raises(TypeError):
        gate("one")
    assert log.names() == ["REGISTER", "CREATE", "DELETE"]
    assert gate("one", 1).count == 1


def test_a_deleted_component_reports_nothing_until_it_comes_back(components, gate, log):
    one = gate("one", 1)
    components.delete_component("one")
    log.clear()
    one.count = 2
    assert (one.count, log) == (2, [])
    components.add_component("one", one)
    assert log.names() == ["CREATE", "UPDATE"]


def test_a_report_that_fails_changes_nothing(components, gate, log):
    one = gate("one", 1)
    log.is_full = True
    for doing in (
        lambda: setattr(one, "count", 2),
        lambda: gate("two", 2),
        lambda: components.delete_component("one"),
        lambda: components.unregister_component((gate.__module__, gate.__qualname__)),
    ):
        with pytest.raises(OSError, match="disk full"):
            doing()
    assert one.count == 1
    assert list(components.component_iter()) == ["one"]
    assert components.is_component_registered((gate.__module__, gate.__qualname__))


def made(components, struct):
    @components.component(struct=struct)
    class Made:
        pass

    return Made


def test_a_class_declared_again_alike_is_reported_once(components, log):
    first, second = made(components, {"count": int}), made(components, {"count": int})
    assert log.names() == ["REGISTER"]
    assert list(components._component_registry.values()) == [first]
    assert second("s").name == "s"


def test_a_class_declared_again_otherwise_takes_the_place_of_the_first(components, log):
    made(components, {"count": int})
    second = made(components, {"count": str})
    assert log.names() == ["REGISTER", "UNREGISTER", "REGISTER"]
    assert list(components._component_registry.values()) == [second]


def test_a_subclass_is_recorded_as_the_component_it_is(components, gate, log):
    class Special(gate):
        pass

    assert Special("s", 4).count == 4
    assert log[1] == ("COMPONENT_CREATE", {"name": "s", "type": [gate.__module__, gate.__qualname__]})
    with pytest.raises(BadType):
        components.component(struct={"more": int})(Special)
