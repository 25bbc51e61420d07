import math

import numpy as np
import pytest

from gamms.arguments import as_float, as_int, as_path
from gamms.errors import BadType, BadValue, Duplicate, UnknownName
from gamms.text import make_printable, make_printable_line, shown

HUGE = 1 << 20_000  # of more digits than Python writes out


class Broken:
    def __repr__(self):
        raise RuntimeError("no words")


@pytest.mark.parametrize(
    "value",
    [HUGE, -HUGE, [HUGE], {HUGE: (HUGE,)}, {HUGE}, "x" * 10**6, [[]] * 10**5, b"a" * 10**6, np.zeros(10**5), Broken()],
    ids=lambda value: type(value).__name__,
)
def test_any_value_is_shown_in_a_bounded_length(value):
    assert len(shown(value)) < 600


@pytest.mark.parametrize(
    "value", [None, True, 7, -1 << 64, 0.5, "anna", b"a", [1, "b"], {"a": (1,)}, math.inf], ids=repr
)
def test_short_values_are_shown_as_they_are(value):
    assert shown(value) == repr(value)


@pytest.mark.parametrize(
    "call",
    [
        lambda value: as_int(value, "turn"),
        lambda value: as_int([value], "turn"),
        lambda value: as_float(value, "speed"),
        lambda value: as_path(value, "path"),
        lambda value: int(UnknownName("agent", value, [value, "anna"])),
        lambda value: int(Duplicate("an agent", value)),
    ],
)
def test_messages_name_integers_of_any_length(call):
    with pytest.raises((BadType, BadValue, TypeError)) as caught:
        call(HUGE)
    assert len(str(caught.value)) < 400


def test_control_characters_are_written_as_escapes():
    text = "a\x1b]0;b\x07\x9b2J\r\u202ec\ud800\n\ue000ü \u200d 😀\U000e0001"
    assert (
        make_printable(text) == r"a\u001b]0;b\u0007\u009b2J\u000d\u202ec\ud800" + "\n\ue000ü \u200d 😀" + r"\U000e0001"
    )
    assert make_printable_line("a\nb") == r"a\nb"


def test_hints_look_at_a_bounded_number_of_names():
    seen = []
    names = (seen.append(i) or f"agent {i}" for i in range(10**6))
    assert "agent 7" in str(UnknownName("agent", "agnt 7", names))
    assert len(seen) < 2_000
