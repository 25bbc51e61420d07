"""Compiled and interpreted, the functions of the core return the same and write the same.

`CASES` has a line for each function that is called with columns and numbers: its module, its name, and what it may be
called with. The functions of the modules in `PLAYED` work on the memory of a game, so games are played with them.
"""

import importlib
import json
import os
import re
import subprocess
import sys
from array import array
from copy import deepcopy
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import games_of_both_forms
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms

FOLDER = Path(gamms.core.__file__).parent


def numbers(lowest, highest):
    """Integers, of which the ends of the range and those around zero are tried more often."""
    ends = {lowest, lowest + 1, -1, 0, 1, highest - 1, highest}
    return st.sampled_from([one for one in sorted(ends) if lowest <= one <= highest]) | st.integers(lowest, highest)


U64 = numbers(0, 2**64 - 1)
I64 = numbers(-(2**63), 2**63 - 1)
CODES = {U64: "Q", I64: "q"}  # as `array` names the types of columns


def rows(*columns):
    """Columns of one length, each of a kind of numbers, and a further one of 64 bits to write to."""

    def filled(drawn):
        made = [array(CODES[kind], column) for kind, column in zip(columns, zip(*drawn, strict=True), strict=True)]
        return (*made, array("Q", bytes(8 * len(drawn))))

    return st.lists(st.tuples(*columns), min_size=1, max_size=6).map(filled)


ROW = st.integers(0, 5)


def columns(drawn):
    """Columns of six agents, and rows of some of them, each once, with a number for each."""
    first, second, chosen = drawn
    rows, values = zip(*chosen, strict=True) if chosen else ((), ())
    return array("q", first), array("q", second), array("q", rows), array("q", values)


SIX = st.lists(I64, min_size=6, max_size=6)
TEAMS = st.lists(numbers(0, 2), min_size=6, max_size=6).map(lambda one: array("q", one))
FAR = st.floats(0.0)
DISTANCES = st.lists(st.tuples(FAR, I64), min_size=1, max_size=6)
STOPS = st.lists(st.tuples(numbers(0, 3), numbers(0, 6)), min_size=1, max_size=6)
BLOCK = st.tuples(SIX, SIX, st.lists(st.tuples(ROW, I64), unique_by=lambda one: one[0])).map(columns)
SCALARS = st.none() | st.booleans() | I64 | st.floats() | st.text(max_size=3) | st.binary(max_size=3)
PLAIN = st.recursive(
    SCALARS, lambda one: st.lists(one, max_size=3) | st.dictionaries(SCALARS, one, max_size=3) | st.tuples(one, one)
)
KINDS = st.dictionaries(st.sampled_from("abc"), I64, min_size=3)
DICTS = st.dictionaries(st.sampled_from("xyz"), KINDS)
WORDS = st.lists(numbers(0, 2**32 - 1), min_size=8, max_size=8)
KEYS = st.lists(U64, min_size=6, max_size=6)  # of three streams
CASES = {
    ("block", "gather"): BLOCK.map(lambda one: (one[0], one[2], one[3])),
    ("block", "move_rows"): BLOCK,
    ("block", "stop_moves"): BLOCK.map(
        lambda one: (*one[:2], array("i", range(6)), *[array("q", [0, 2, 5]) for _ in range(3)])
    ),
    ("copies", "copy_deep"): st.tuples(PLAIN),
    ("copies", "copy_values"): st.tuples(st.dictionaries(SCALARS, PLAIN)),
    ("copies", "copy_dict"): st.tuples(KINDS),
    ("copies", "copy_each"): st.tuples(DICTS),
    ("copies", "copy_items"): st.tuples(st.dictionaries(SCALARS, PLAIN)),
    ("copies", "copy_fields"): st.lists(PLAIN, min_size=3, max_size=3).map(
        lambda one: (one, [(0, deepcopy), (2, deepcopy)])
    ),
    ("copies", "restore_fields"): st.tuples(SCALARS, st.lists(SCALARS), KINDS, KINDS).map(
        lambda one: (
            SimpleNamespace(turn=0, log=[1], counts=one[3]),
            [*one[:3]],
            [(0, "turn")],
            [(1, "log", deepcopy, list)],
            [(2, "counts", deepcopy, dict.update)],
        )
    ),
    ("copies", "copy_filled"): st.tuples(st.dictionaries(SCALARS, PLAIN)),
    ("copies", "refill"): st.tuples(KINDS, KINDS),
    ("copies", "refill_each"): st.tuples(DICTS, DICTS),
    ("copies", "refill_counts"): st.tuples(DICTS, DICTS),
    ("draws", "mix"): st.tuples(U64),
    ("draws", "rotate_left"): st.tuples(U64, numbers(1, 63)),
    ("draws", "compute_siphash"): st.tuples(U64, U64, U64),
    ("draws", "compute_first_key"): st.tuples(U64, U64),
    ("draws", "compute_turn_key"): st.tuples(U64, I64),
    ("draws", "compute_bits"): st.tuples(U64, numbers(-1, 2**63 - 2)),
    ("draws", "convert_to_integer"): st.tuples(U64, numbers(1, 2**32)),
    ("draws", "draw_integer"): st.tuples(U64, I64, numbers(-1, 2**63 - 2), numbers(1, 2**32)),
    ("draws", "convert_to_fraction"): st.tuples(U64),
    ("draws", "fill_first_keys"): rows(U64, U64),
    ("draws", "fill_turn_keys"): rows(U64, I64),
    ("draws", "fill_bits"): rows(U64, I64),
    ("draws", "fill_words"): KEYS.map(lambda one: (array("Q", one), array("Q", bytes(8 * 24)))),
    ("draws", "fill_below_of_words"): st.tuples(WORDS, numbers(1, 2**28)).map(
        lambda one: (array("Q", one[0]), array("q", [one[1]]), array("q", [0]))
    ),
    ("draws", "place_agents"): st.tuples(KEYS, st.lists(I64, min_size=3, max_size=9)).map(
        lambda one: (
            array("Q", one[0]),
            array("q", one[1]),
            array("Q", bytes(64)),
            array("q", [0] * 3),
            array("q", [0] * 3),
        )
    ),
    ("strategies", "are_mates"): st.tuples(numbers(0, 3), numbers(0, 3), numbers(-1, 3)),
    ("strategies", "mark_mates"): st.tuples(TEAMS, st.lists(st.tuples(ROW, ROW), min_size=1)).map(
        lambda one: (
            one[0],
            0,
            *(array("q", column) for column in zip(*one[1], strict=True)),
            array("B", bytes(len(one[1]))),
        )
    ),
    ("strategies", "find_farthest"): DISTANCES.map(
        lambda one: (array("d", [far for far, _ in one]), array("q", [id for _, id in one]), len(one))
    ),
    ("strategies", "is_drawn"): st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.floats(0.0, 1.0)),
    ("strategies", "is_nearer"): st.tuples(FAR, numbers(0, 6), FAR, numbers(0, 6)),
    ("strategies", "find_next_stop"): st.tuples(STOPS, numbers(0, 6), numbers(0, 3)).map(
        lambda one: (*(array("q", column) for column in zip(*one[0], strict=True)), 0, len(one[0]), *one[1:])
    ),
    ("strategies", "count_turns_left"): st.tuples(st.booleans(), numbers(-3, 9), FAR),
}

PLAYED = {
    *(
        "agents",
        "arrivals",
        "ask",
        "belief",
        "by_edges",
        "by_metres",
        "conflicts",
        "contacts",
        "flight",
        "messages",
        "moves",
        "observe",
        "pursuit",
        "routes",
        "rules",
        "sight",
    ),
    *("travel", "turn"),
}


@cache
def interpreted(module):
    """Return a module of the core once more, interpreted, beside the one that is loaded."""
    kept = {name: sys.modules.pop(name) for name in list(sys.modules) if name.startswith("gamms.core")}
    with patch.dict(os.environ, {"GAMMS_CORE": "python"}), patch.object(sys, "meta_path", list(sys.meta_path)):
        try:
            return importlib.import_module(f"gamms.core.{module}")
        finally:
            for name in [name for name in sys.modules if name.startswith("gamms.core")]:
                del sys.modules[name]
            sys.modules.update(kept)
            gamms.core = kept["gamms.core"]


def outcome(module, function, arguments):
    """Return what a function returns, and what its columns hold afterwards."""
    copies = [array(one.typecode, one) if isinstance(one, array) else deepcopy(one) for one in arguments]
    views = [memoryview(one) if isinstance(one, array) else one for one in copies]
    return getattr(module, function)(*views), copies


@pytest.mark.compiled
@pytest.mark.parametrize(("module", "function"), CASES)
@settings(max_examples=60)
@given(data=st.data())
def test_both_forms_do_the_same(module, function, data):
    compiled = importlib.import_module(f"gamms.core.{module}")
    assert Path(compiled.__file__).suffix != ".py"
    assert Path(interpreted(module).__file__).suffix == ".py"
    arguments = data.draw(CASES[module, function])
    assert repr(outcome(compiled, function, arguments)) == repr(outcome(interpreted(module), function, arguments))


@pytest.mark.compiled
def test_games_of_both_forms_are_the_same():
    program = [sys.executable, games_of_both_forms.__file__]
    environment = os.environ | {"GAMMS_CORE": "python"}
    played = subprocess.run(program, env=environment, check=True, capture_output=True, text=True)
    assert json.loads(played.stdout) == games_of_both_forms.all_results()


def test_every_function_of_the_core_has_a_case():
    declared = set()
    for types in (file for file in FOLDER.glob("*.pxd") if file.stem not in PLAYED):
        names = re.findall(r"^cpdef .*?(\w+)\(", types.read_text(encoding="utf-8"), re.MULTILINE)
        declared |= {(types.stem, name) for name in names}  # those of classes and of C are indented
    assert declared == set(CASES)
