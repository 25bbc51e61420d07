"""The types of component fields: what 1.0.0 wrote, what ours adds, and nothing that a file makes up."""

import types
from typing import Any, Dict, List, Literal, Optional, Tuple, Union  # noqa: UP035 - users write them

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadType
from gamms.recorder.errors import RecordingError
from gamms.recorder.struct_types import parse, parse_hint

# What 1.0.0 writes for what it is given, found by running it.
OF_1_0_0 = {
    "typing.Optional[int]": [int, Optional[int], int | None],  # noqa: UP045
    "typing.Optional[float]": [float],
    "typing.Optional[str]": [str],
    "typing.Optional[bool]": [bool],
    "<class 'NoneType'>": [types.NoneType, Optional[types.NoneType]],  # noqa: UP045
    "typing.Optional[...]": [...],
    "typing.Union[int, str, NoneType]": [Union[int, str], int | str, Union[int, str, None]],  # noqa: UP007
    "typing.Union[int, float, str, bool, NoneType]": [Union[int, float, str, bool, None]],  # noqa: UP007
    "typing.Union[int, NoneType, str]": [Union[Optional[int], str]],  # noqa: UP007, UP045
    "typing.Union[bool, int, NoneType]": [Union[bool, int]],  # noqa: UP007
}
OF_OURS = {
    "typing.Optional[tuple[int, str]]": [tuple[int, str], Tuple[int, str]],  # noqa: UP006
    "typing.Optional[tuple[float, ...]]": [tuple[float, ...], Tuple[float, ...]],  # noqa: UP006
    "typing.Optional[tuple[int, tuple[float, ...]]]": [tuple[int, tuple[float, ...]]],
    "typing.Optional[tuple[typing.Optional[int], str]]": [tuple[int | None, str]],
    "typing.Optional[tuple[NoneType, int]]": [tuple[None, int]],
    "typing.Optional[list[int]]": [list[int], List[int], list[int] | None],  # noqa: UP006
    "typing.Optional[list[typing.Union[int, str]]]": [list[int | str]],
    "typing.Union[int, list[str], NoneType]": [int | list[str]],
}
HINTS = [(text, hint) for text, hints in {**OF_1_0_0, **OF_OURS}.items() for hint in hints]


@pytest.mark.parametrize(("text", "hint"), HINTS, ids=str)
def test_a_hint_is_written_as_1_0_0_writes_it(text, hint):
    assert str(parse_hint(hint).make_optional()) == text


@pytest.mark.parametrize("text", [*OF_1_0_0, *OF_OURS])
def test_a_text_is_read_and_written_again(text):
    assert str(parse(text)) == text


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("int | None", "typing.Optional[int]"),
        ("None | int", "typing.Optional[int]"),
        ("int|str|None", "typing.Union[int, str, NoneType]"),
        ("Optional[int]", "typing.Optional[int]"),
        ("typing.Optional[typing.Tuple[int, ...]]", "typing.Optional[tuple[int, ...]]"),
        ("typing.List[str]", "list[str]"),
        ("  int ", "<class 'int'>"),
    ],
)
def test_other_spellings_mean_the_same(text, same):
    assert parse(text) == parse(same)


hints = st.recursive(
    st.sampled_from([int, float, str, bool, types.NoneType]),
    lambda inner: st.one_of(
        st.lists(inner, min_size=1, max_size=3).map(lambda parts: Union[tuple(parts)]),  # noqa: UP007
        st.lists(inner, min_size=1, max_size=3).map(lambda parts: tuple[tuple(parts)]),
        inner.map(lambda part: tuple[part, ...]),
    ),
    max_leaves=6,
)


@given(hints)
def test_every_type_survives_its_text(hint):
    try:
        found = parse_hint(hint).make_optional()
    except BadType:
        return  # nested too deep
    assert parse(str(found)) == found
    assert found.is_valid(None)


@pytest.mark.parametrize(
    "hint",
    [None, tuple, list, dict, bytes, complex, object, Any, "int", 3, [int], Dict[str, int], List, Literal[1],  # noqa: UP006
     tuple[()], tuple[...], list[list[int]], list[tuple[int]], tuple[list[int], int], list[int] | tuple[int, int],
     Union[tuple([tuple[(int,) * n] for n in range(1, 100)])]],  # noqa: UP007
    ids=lambda hint: str(hint)[:40],
)  # fmt: skip
def test_a_hint_that_no_recording_can_hold_is_refused(hint):
    with pytest.raises(BadType, match="Use int"):
        parse_hint(hint)


@pytest.mark.parametrize(
    "text",
    ["__import__('os').system('true')", "exec('1')", "os", "typing.os", "typing.typing.Optional[int]", "int.__class__",
     "[int][0]", "lambda: 0", "int or str", "(int)", "int()", "Optional", "Optional[]", "Optional[int",
     "Optional[int]]", "Optional[int, str]", "Union[]", "Union[int,]", "int str", "in t", "", " ", "tuple",
     "tuple[...]", "tuple[..., int]", "list[int, str]", "list[list[int]]", "tuple[list[int]]",
     "list[int] | tuple[int]", "typing.Any", "Dict[str, int]", "<class 'os'>", "<class 'int'", "<class int>", "\x00",
     "int\x00", "é", "Optional[" * 9 + "int" + "]" * 9, "int | " * 1000 + "int", "[" * 100_000, None, 5, b"int",
     ["int"]],
    ids=lambda text: str(text)[:40],
)  # fmt: skip
def test_a_text_outside_the_grammar_is_refused(text):
    with pytest.raises(RecordingError, match="type of a field"):
        parse(text)


@given(st.text(alphabet="int|[],. typogUOlus<'>", max_size=40) | st.text(max_size=40))
def test_any_text_is_a_type_or_refused(text):
    try:
        found = parse(text)
    except RecordingError:
        return
    assert parse(str(found)) == found


@pytest.mark.parametrize(
    ("hint", "fitting", "others"),
    [
        (int, [0, -5, 2**70, True], [1.5, "1", [1], (1,)]),
        (float, [0.5, 3, float("nan")], ["1", [0.5]]),
        (str, ["", "é"], [b"", 1]),
        (bool, [True], [1, 0.0, "True"]),
        (types.NoneType, [], [0, "", False]),
        (int | str, [1, "1"], [1.5]),
        (tuple[int, str], [(1, "a")], [("a", 1), (1,), (1, "a", 2), [1, "a"], 1]),
        (tuple[int, ...], [(), (1, 2)], [(1, "a"), [1]]),
        (list[float], [[], [0.5, 1]], [["a"], (0.5,), [None]]),
    ],
    ids=str,
)
def test_values_are_distinguished(hint, fitting, others):
    field = parse_hint(hint).make_optional()
    assert all(field.is_valid(value) for value in [None, *fitting])
    assert not any(field.is_valid(value) for value in others)


@pytest.mark.parametrize(
    ("hint", "given", "shaped"),
    [
        (tuple[int, int], [1, 2], (1, 2)),
        (tuple[int, tuple[float, ...]], [1, [0.5, 2]], (1, (0.5, 2))),
        (tuple[int, int] | tuple[int, int, int], [1, 2, 3], (1, 2, 3)),
        (list[int], (1, 2), [1, 2]),
        (tuple[int, int], ["not", "declared", "so"], ("not", "declared", "so")),
        (int, [1, 2], [1, 2]),
        (int, np.int64(3), 3),
        (tuple[float, float], np.array([0.5, 1.0]), (0.5, 1.0)),
    ],
    ids=str,
)
def test_arrays_take_the_declared_shape(hint, given, shaped):
    found = parse_hint(hint).make_optional().convert(given)
    assert found == shaped
    assert type(found) is type(shaped)


def test_a_list_is_copied():
    value = [1, 2]
    assert parse_hint(list[int]).convert(value) is not value
