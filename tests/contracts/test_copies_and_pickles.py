"""Every public object can be copied and pickled, or says in a sentence why not and what to do instead."""

import contextlib
import copy
import enum
import pickle
import sys
import typing
from importlib import import_module
from inspect import isabstract
from pathlib import Path

import numpy as np
import pytest
from instances import HUNT, instances

import gamms
from gamms import rules, strategies
from gamms.errors import BadType

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
import reference


@pytest.fixture(scope="module")
def objects(tmp_path_factory):
    with contextlib.ExitStack() as closing:
        yield instances(tmp_path_factory.mktemp("instances"), closing)


def pickled(value):
    return pickle.loads(pickle.dumps(value))


WAYS = [copy.copy, copy.deepcopy, pickled]


def refusal(way, value):
    """Return why a value is not copied; None: it is. Other errors are raised."""
    try:
        way(value)
    except BadType as error:
        return str(error)
    return None


@pytest.mark.parametrize("way", WAYS)
def test_every_object_is_copied_or_says_why_not(objects, way):
    for name, value in objects.items():
        why = refusal(way, value)
        assert why is None or (len(why) > 60 and why.endswith(".")), name


@pytest.mark.parametrize("way", WAYS)
def test_so_is_every_part_that_an_object_shows(objects, way):
    parts = [part for value in objects.values() for part in parts_of(value)]
    assert len(parts) > 100
    for owner, name, part in parts:
        why = refusal(way, part)
        assert why is None or (len(why) > 60 and why.endswith(".")), (owner, name)


INNER = {"chain", "core", "core_with_all_legal", "func"}  # parts that no page shows


def parts_of(value):
    """Yield (class, name, part) for the parts of an object that are of our own classes."""
    for name in dir(value):
        if name[0] != "_" and name not in INNER:
            with contextlib.suppress(Exception):  # what cannot be read now is nobody's to copy
                part = getattr(value, name)
                if type(part).__module__.startswith("gamms."):
                    yield type(value), name, part


def test_there_is_an_object_of_every_public_class(objects):
    named = [(package, name) for package in reference.packages() for name in reference.names_of(package)]
    classes = {one for one in (getattr(import_module(package), name) for package, name in named) if has_instances(one)}
    classes.remove(gamms.visual.WindowEngine)  # which needs a window, and has only methods of its own
    missing = {one for one in classes if not any(isinstance(value, one) for value in objects.values())}
    assert len(classes) > 100
    assert missing == set()


def has_instances(one):
    """Return whether a public name is a class with objects of its own; TypedDicts make dicts."""
    if not isinstance(one, type) or issubclass(one, (BaseException, enum.Enum)) or typing.is_typeddict(one):
        return False
    return not (isabstract(one) or getattr(one, "_is_protocol", False))


REFUSED = {
    "view": r"A view can neither be pickled nor copied deeply, .* Copy the arrays that you need",
    "streets": r"The streets of a batch can neither be pickled nor copied deeply",
    "draws of a view": r"Draws of many agents can neither be pickled nor copied deeply",
    "turn of array rules": r"A turn of array rules can neither be pickled nor copied deeply",
    "turn of learners": r"A view can neither be pickled nor copied deeply, .* Copy the arrays that you need",
    "feed": r"A feed can neither be pickled nor copied, .* Make another one",
    "drive": r"A feed can neither be pickled nor copied, .* Make another one",
    "link": r"A link can neither be pickled nor copied, .* Open another one",
    "connection to ROS": r"A connection to rosbridge can neither be pickled nor copied, .* Open another one",
    "batch": r"A batch can neither be pickled nor copied",
    "recording in a file": r"An open file can neither be pickled nor copied: pass on its path",
    "reader": r"An open file can neither be pickled nor copied: pass on its path",
    "writer": r"A writer can neither be pickled nor copied",
    "store in a file": r"A store in a file can neither be pickled nor copied, .* Pass on its path",
    "live game": r"A server can neither be pickled nor copied, .* serve it there",
    "study": r"A server can neither be pickled nor copied, .* serve it there",
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_shows_or_holds_something_of_this_moment_is_not_copied_deeply(objects, name):
    ways = [pickled] if name == "drive" else [copy.deepcopy, pickled]  # the copy of a drive controls no robot
    for way in ways:
        with pytest.raises(BadType, match=REFUSED[name]):
            way(objects[name])


def test_a_view_and_a_turn_can_be_copied_with_their_arrays(objects):
    for name in ("view", "turn of array rules"):
        twin = copy.copy(objects[name])
        assert twin is not objects[name]
        assert twin.games is objects[name].games


OF_CONTEXT = [
    *("context", "game", "agent", "kite", "team", "sensor", "agent engine", "recorder", "pictures", "artist", "camera"),
    *("roster", "played game"),
]


@pytest.mark.parametrize("name", OF_CONTEXT)
def test_what_belongs_to_a_context_is_not_pickled(objects, name):
    with pytest.raises(BadType, match="A context cannot be pickled, and neither can what belongs to it"):
        pickled(objects[name])


@pytest.mark.parametrize("name", ["rule", "strategy", "resolver", "conflicts with a resolver"])
def test_a_function_that_a_call_makes_is_not_pickled(objects, name):
    with pytest.raises(
        BadType, match=r"^(tag|chase|by_priority)\(.*\) cannot be pickled, because a program makes it\."
    ):
        pickled(objects[name])


def test_a_language_model_is_not_pickled_with_its_key(objects):
    with pytest.raises(BadType, match="because it holds a connection and its key"):
        pickled(objects["language model"])


VALUES = [
    *(
        "random walk",
        "goals",
        "mixture",
        "checks",
        "moves",
        "facts",
        "scores",
        "events",
        "result",
        "scenario",
        "choice",
    ),
    *("sighting", "fix", "contest", "contact", "move", "plan", "access", "standing", "cycle", "difference"),
]


@pytest.mark.parametrize("name", VALUES)
def test_copies_of_values_are_equal(objects, name):
    assert pickled(objects[name]) == copy.deepcopy(objects[name]) == objects[name]


@pytest.mark.parametrize("way", [copy.deepcopy, pickled])
def test_a_copied_state_of_a_recording_has_its_map(objects, way):
    state = way(objects["state of a recording"])
    assert np.array_equal(state.xy(), objects["state of a recording"].xy(), equal_nan=True)
    assert len(state.graph.columns().node_ids) == 16


@pytest.mark.parametrize("way", [copy.deepcopy, pickled])
@pytest.mark.parametrize("name", ["filter", "filter of games"])
def test_a_copied_filter_goes_its_own_way(objects, way, name):
    original = objects[name]
    before = original.probabilities().tolist()
    twin = way(original)
    again = way(twin)
    for one in (twin, again):
        one.predict(2)
        one.weigh_states(np.where(np.arange(len(one.masses)) % 2, 0.25, 1.0)[:, None] * np.ones(one.masses.shape))
    assert twin.probabilities().tolist() == again.probabilities().tolist() != before
    assert original.probabilities().tolist() == before


def test_a_copied_rule_and_a_copied_strategy_do_the_same():
    results = []
    for change in (lambda one: one, copy.copy, copy.deepcopy):
        with HUNT.build(seed=1) as ctx:
            ctx.game.add(change(rules.tag("blue", "red", score=5)))
            ctx.agent.get_agent("red_0").strategy = change(strategies.patrol(ctx, [3, 9]))
            results.append(ctx.game.run(6))
    assert results[0] == results[1] == results[2]
