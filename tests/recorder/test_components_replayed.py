"""What a recording may do to components: declare, make, set, delete; and nothing else."""

import io
import json
from pathlib import Path

import pytest
from games import empty_context, recorded
from gamms.typing.opcodes import OpCodes
from hypothesis import given
from hypothesis import strategies as st
from recordings import opened

from gamms.recorder.components import Components
from gamms.recorder.errors import RecordingError
from gamms.recorder.formats import version2

SAMPLES = Path(__file__).parent / "samples/version2"
KEY = ["somewhere.else", "Maker.<locals>.Gate"]
STRUCT = {"count": "typing.Optional[int]", "way": "typing.Optional[tuple[int, ...]]"}


class Log(list):
    """The events of one registry."""

    def __call__(self, opcode_name, data):
        self.append((opcode_name, data))

    def names(self):
        return [name.removeprefix("COMPONENT_") for name, _ in self]


@pytest.fixture
def components():
    return Components(Log())


@pytest.fixture
def replayed(components):
    """A registry that holds one component made by a recording."""
    components.apply("COMPONENT_REGISTER", {"key": KEY, "struct": STRUCT})
    components.apply("COMPONENT_CREATE", {"name": "g", "type": KEY})
    return components


def values_of(component):
    return dict(vars(component)["__recorded_component_"])


def state(registry):
    return {name: values_of(registry.get_component(name)) for name in registry.component_iter()}


def played(events, registry=None, **options):
    registry = Components(Log()) if registry is None else registry
    for event in events:
        registry.apply(*event, **options)
    return registry


def creation(cls, name):
    return [("COMPONENT_CREATE", {"name": name, "type": [cls.__module__, cls.__qualname__]})]


def test_a_recorded_class_is_built_empty_and_never_imported(replayed):
    gate = type(replayed.get_component("g"))
    assert (gate.__module__, gate.__qualname__, gate.__name__) == (*KEY, "Gate")
    replayed.apply("COMPONENT_REGISTER", {"key": ["this", "C"], "struct": {}})
    replayed.apply("COMPONENT_CREATE", {"name": "z", "type": ["this", "C"]})
    assert vars(replayed.get_component("z")) == {"__recorded_component_": {"name": "z"}}


def test_a_class_of_the_user_is_taken_where_there_is_one(components):
    @components.component(struct={"count": int})
    class Gate:
        def __init__(self, count):
            self.count = count

    found = played(creation(Gate, "g"), components).get_component("g")
    assert type(found) is Gate
    assert found.count is None


def test_the_init_of_the_user_runs_unrecorded_where_it_needs_nothing(components):
    @components.component(struct={"count": int})
    class Easy:
        def __init__(self, start=7):
            self.count = start
            self.cache = {}

    played(creation(Easy, "e"), components)
    found = components.get_component("e")
    assert (found.cache, found.count) == ({}, None)  # the recording says what count is
    assert components._on_event.names() == ["REGISTER", "CREATE"]


def test_components_made_by_an_init_are_left_to_the_recording(components):
    @components.component(struct={})
    class Child:
        pass

    @components.component(struct={})
    class Parent:
        def __init__(self):
            self.child = Child("child")

    Parent("parent")
    events = list(components._on_event)
    for name in ("parent", "child"):
        components.delete_component(name)
    played([event for event in events if event[0] == "COMPONENT_CREATE"], components)
    assert sorted(components.component_iter()) == ["child", "parent"]


def test_an_init_that_fails_in_replay_is_an_error_of_the_recording(components):
    @components.component(struct={})
    class Bad:
        def __init__(self):
            raise RuntimeError("no")

    with pytest.raises(RecordingError, match="no"):
        played(creation(Bad, "b"), components)
    assert list(components.component_iter()) == []


REFUSED = [
    ("COMPONENT_REGISTER", {"key": KEY, "struct": {"count": "typing.Optional[str]"}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": {"x": "__import__('os').system('true')"}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": {"__del__": "int"}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": {"__class__": "int"}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": {"mro": "int"}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": {"name": "int"}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": {5: "int"}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": {str(n): "int" for n in range(2000)}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N"], "struct": [1]}),
    ("COMPONENT_REGISTER", {"key": ["m", "N\0"], "struct": {}}),
    ("COMPONENT_REGISTER", {"key": ["m", ""], "struct": {}}),
    ("COMPONENT_REGISTER", {"key": ["m", "N" * 2000], "struct": {}}),
    ("COMPONENT_REGISTER", {"key": ["m", 5], "struct": {}}),
    ("COMPONENT_REGISTER", {"key": "mN", "struct": {}}),
    ("COMPONENT_REGISTER", {}),
    ("COMPONENT_CREATE", {"name": "g", "type": KEY}),
    ("COMPONENT_CREATE", {"name": "h", "type": ["os", "system"]}),
    ("COMPONENT_CREATE", {"name": ["h"], "type": KEY}),
    ("COMPONENT_CREATE", {"type": KEY}),
    ("COMPONENT_UPDATE", {"name": "g", "key": "undeclared", "value": 1}),
    ("COMPONENT_UPDATE", {"name": "g", "key": "__class__", "value": 1}),
    ("COMPONENT_UPDATE", {"name": "g", "key": "name", "value": "h"}),
    ("COMPONENT_UPDATE", {"name": "g", "key": ["count"], "value": 1}),
    ("COMPONENT_UPDATE", {"name": "nobody", "key": "count", "value": 1}),
    ("COMPONENT_UPDATE", {"name": "foreign", "key": "count", "value": 1}),
    ("COMPONENT_DELETE", {"name": "nobody"}),
    ("COMPONENT_DELETE", {"name": {}}),
    ("COMPONENT_UNREGISTER", {"key": ["m", "N"]}),
    ("COMPONENT_EXPLODE", {"name": "g"}),
    ("COMPONENT_DELETE", ["g"]),
]


@pytest.mark.parametrize(("opcode_name", "data"), REFUSED, ids=[f"{n} {str(data)[:50]}" for n, data in REFUSED])
def test_forbidden_records_change_nothing(replayed, opcode_name, data):
    replayed.add_component("foreign", type("Foreign", (), {})())
    before = list(replayed._on_event)
    with pytest.raises(RecordingError):
        replayed.apply(opcode_name, data)
    assert replayed._on_event == before
    assert list(replayed.component_iter()) == ["g", "foreign"]
    assert list(replayed._component_registry) == [tuple(KEY)]
    assert values_of(replayed.get_component("g")) == {"count": None, "way": None, "name": "g"}
    assert vars(replayed.get_component("foreign")) == {}


def test_records_that_1_0_0_wrote_and_refused_are_skipped(replayed):
    before = list(replayed._on_event)
    bogus = [
        ("COMPONENT_CREATE", {"name": "g", "type": KEY}),
        ("COMPONENT_UPDATE", {"name": "nobody", "key": "count", "value": 1}),
        ("COMPONENT_DELETE", {"name": "nobody"}),
        ("COMPONENT_UNREGISTER", {"key": ["m", "N"]}),
    ]
    played(bogus, replayed, lenient=True)
    assert replayed._on_event == before
    with pytest.raises(RecordingError, match="'other'"):
        replayed.apply("COMPONENT_UPDATE", {"name": "g", "key": "other", "value": 1}, lenient=True)


@pytest.mark.parametrize(("field", "value"), [("count", "text"), ("count", {"a": [1.5]}), ("way", (1, "x"))])
def test_a_field_takes_a_value_of_another_type_as_it_does_in_a_game(replayed, field, value):
    replayed.apply("COMPONENT_UPDATE", {"name": "g", "key": field, "value": value})
    assert getattr(replayed.get_component("g"), field) == value


def test_a_recording_declares_a_bounded_number_of_classes(components, monkeypatch):
    monkeypatch.setattr("gamms.recorder.components._MOST_CLASSES", 3)
    with pytest.raises(RecordingError, match="more than 3"):
        played([("COMPONENT_REGISTER", {"key": ["m", f"N{n}"], "struct": {}}) for n in range(4)], components)


@pytest.mark.parametrize("game", ["components", "refused"])
def test_a_recording_of_1_0_0_reaches_the_state_of_1_0_0(components, game):
    reached = json.loads((SAMPLES / "states.json").read_text())["games"][game]["end"]
    for record in version2.read(io.BytesIO((SAMPLES / f"{game}.ggr").read_bytes())):
        name = OpCodes(record["opCode"]).name
        if name.startswith("COMPONENT"):
            components.apply(name, record["data"], lenient=True)
    assert state(components) == reached["components"]
    assert [list(key) for key in components._component_registry] == reached["classes"]


steps = st.one_of(
    st.tuples(st.just("create"), st.sampled_from("abc"), st.none()),
    st.tuples(st.just("delete"), st.sampled_from("abc"), st.none()),
    st.tuples(st.just("unregister"), st.none(), st.none()),
    st.tuples(st.just("number"), st.sampled_from("abc"), st.none() | st.integers(-9, 9)),
    st.tuples(st.just("text"), st.sampled_from("abc"), st.none() | st.text(max_size=3)),
    st.tuples(st.just("way"), st.sampled_from("abc"), st.lists(st.integers(0, 9), max_size=3).map(tuple)),
)


@given(st.lists(steps, max_size=20))
def test_a_replay_equals_the_game_and_reports_the_same(programme):
    registry = Components(Log())

    @registry.component(struct={"number": int, "text": str, "way": tuple[int, ...]})
    class Made:
        pass

    for verb, name, value in programme:
        if verb == "unregister":
            if registry._component_registry:
                registry.unregister_component((Made.__module__, Made.__qualname__))
        elif verb == "create":
            if name not in registry._components:
                Made(name)
        elif name in registry._components:
            if verb == "delete":
                registry.delete_component(name)
            else:
                setattr(registry.get_component(name), verb, value)

    again = played(registry._on_event)
    assert again._on_event == registry._on_event
    for copy in (again, played(registry.list_events_since((set(), {})))):
        assert state(copy) == state(registry)
        assert list(copy._component_registry) == list(registry._component_registry)


@pytest.mark.parametrize("version", [2, 3])
def test_a_class_that_the_program_and_the_replay_declare_is_recorded_once(version):
    def play(names, act):
        ctx = empty_context(seed=2)
        classes = [type(name, (), {"__module__": "m", "__qualname__": name}) for name in names]
        made = [ctx.record.component({"n": int})(one) for one in classes]
        return recorded(lambda ctx: act(ctx, made), ctx, version=version)

    def replay(ctx, _):
        list(ctx.record.replay(io.BytesIO(data)))

    data = play(["Door"], lambda _, classes: classes[0]("front"))
    for names in (["Door"], ["Door", "Gate"]):
        assert declared(play(names, replay), version) == names


def declared(data, version):
    """The names of the classes of components that a recording declares."""
    if version == 2:
        records = version2.read(io.BytesIO(data))
        return [one["data"]["key"][1] for one in records if one["opCode"] == OpCodes.COMPONENT_REGISTER.value]
    return [data["key"][1] for _, _, kind, data in opened(data).events() if kind == OpCodes.COMPONENT_REGISTER.value]
