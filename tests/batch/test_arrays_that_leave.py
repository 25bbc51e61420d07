"""Arrays of games, batches and views are read-only or copies: writing into one changes nothing else.

The arrays are found by walking the public attributes, items and questions of the objects, so that a new one is found.
"""

import inspect
from collections.abc import Mapping
from contextlib import suppress
from itertools import islice

import numpy as np
import pytest

import gamms
from gamms.scenario import Scenario

pytestmark = pytest.mark.law
WALK = "gamms.strategies:random_waypoints"
GAMES = 3
DEPTH = 4
QUESTIONS = frozenset(  # methods without arguments that are called, because they return arrays and change nothing
    {"columns", "enemies", "get_tables", "legal_rows", "mates", "routes", "seen", "seen_nodes", "vector"}
)
LEFT_OUT = frozenset(
    {"agents", "ctx", "graph", "game", "fork", "logger", "internals"}
)  # other objects, which are walked alone


def list_parts(thing):
    """Yield (name, value) of the public attributes, items and answers of an object."""
    if isinstance(thing, Mapping):
        for key in islice(thing, 40):
            with suppress(gamms.errors.GammsError):  # games of this kind have no such value
                yield f"[{key!r}]", thing[key]
    elif isinstance(thing, (tuple, list)) and not hasattr(thing, "_fields"):
        yield from ((f"[{i}]", one) for i, one in enumerate(thing[:3]))
    if not type(thing).__module__.startswith("gamms"):
        return
    for name in dir(thing):
        if name[0] == "_" or name in LEFT_OUT:
            continue
        try:
            value = getattr(thing, name)
            if name in QUESTIONS and inspect.ismethod(value):
                yield f".{name}()", value()
                continue
        except (gamms.errors.GammsError, NotImplementedError):
            continue  # games of this kind have no such value
        if not callable(value):
            yield f".{name}", value


def walk(thing, path, found, seen):
    """Collect path -> array of all arrays that can be reached from an object by public names."""
    if isinstance(thing, np.ndarray):
        found[path] = thing
        return
    if id(thing) in seen or path.count(".") + path.count("[") > DEPTH or isinstance(thing, (str, bytes, type)):
        return
    seen[id(thing)] = thing
    for name, value in list_parts(thing):
        walk(value, path + name, found, seen)


def list_arrays(objects):
    found = {}
    for name, thing in objects.items():
        walk(thing, name, found, {})
    return found


def overwrite(array):
    """Change every number of an array; return whether it can be written to."""
    if array.dtype == object or not array.size or not array.flags.writeable:
        return False
    array[...] = ~array if array.dtype.kind == "b" else array + array.dtype.type(1)
    return True


KINDS = {
    "edges": ({"speed_unit": "edges"}, {}),
    "metres": ({"speed_unit": "metres"}, {"speed": 13.0}),
    "arrivals": ({"speed_unit": "metres", "decide": "arrival"}, {"speed": 13.0}),
}


def open_game(kind, has_plain_rule):
    settings, speed = KINDS[kind]
    sensors = {"eyes": {"type": "agent_range", "range_m": 150.0}, "map": {"type": "range", "range_m": 150.0}}
    teams = {team: {"count": 2, "strategy": WALK, "sensors": [*sensors], **speed} for team in ("red", "blue")}
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
    game = Scenario(
        map={"grid": {"rows": 4, "columns": 4}},
        max_turns=12,
        settings=settings,
        teams=teams,
        rules=[tag],
        sensors=sensors,
    )
    ctx = game.build(seed=1)
    if has_plain_rule:
        ctx.game.add(lambda ctx: None)
    return ctx


def ask_batch(games):
    """Return the objects that a batch hands out."""
    red = games.observe("red")
    objects = {
        "table": games.table(),
        "games": games,
        "red": red,
        "blue": games.observe("blue"),
        "one": games.observe_agent("red_0"),
        "of": red.of(np.array([0, 1])),
        "in_games": red.in_games(np.array([1, 2])),
        "only": red.only(np.ones((GAMES, 2), bool)),
        "map": games.game.ctx.graph.columns(),
        "result": games.result(0),
    }
    with suppress(gamms.errors.BadValue):  # the core does not play these games completely
        objects["columns"] = games.columns()
    return objects


def copy_arrays(objects):
    return {path: array.copy() for path, array in list_arrays(objects).items()}


def find_differences(before, after):
    assert before.keys() == after.keys()
    return [
        path
        for path, array in before.items()
        if not np.array_equal(array, after[path], equal_nan=array.dtype.kind == "f")
    ]


def finish(games):
    games.run()
    results = [games.result(index) for index in range(GAMES)]
    return [(one.agents, one.scores, one.turns, one.events) for one in results]


@pytest.mark.parametrize("has_plain_rule", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_writing_into_arrays_of_a_batch_changes_nothing_else(kind, has_plain_rule):
    ends = []
    for writes in (False, True):
        with open_game(kind, has_plain_rule).game.batch(GAMES) as games:
            games.step()
            games.step()
            before = copy_arrays(ask_batch(games))
            assert len(before) > 50
            written = [overwrite(array) for array in list_arrays(ask_batch(games)).values() if writes]
            assert any(written) == writes
            assert find_differences(before, copy_arrays(ask_batch(games))) == []
            ends.append(finish(games))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("key", ["games", "agents"])
def test_a_view_of_an_observer_has_numbers_that_cannot_be_written(key):
    with open_game("edges", has_plain_rule=False).game.batch(GAMES) as games:
        numbers = getattr(games.observe("red"), key)
        with pytest.raises(ValueError, match="read-only"):
            numbers[...] = 1


def score_tracks(ctx):
    """Read how the agents have moved, by a plain rule."""
    for track in ctx.game.tracks(ctx.game.agents):
        ctx.game.scores["nodes"] += sum(track.path)


def score_visits(turn):
    """Read how the agents have moved, by another rule of arrays."""
    visits = turn.visits(turn.took_part)
    turn.add_score("visits", visits.at, visits.nodes)


def end_with_an_array_function(kind, writes, phase=None):
    """Return the ends of games in which a function of arrays writes into all arrays that it gets, if `writes`.

    It is a rule of a phase, or the strategy of a team.
    """
    ctx = open_game(kind, has_plain_rule=False)
    ctx.game.add(score_tracks)

    def look(given):
        arrays = list_arrays({"given": given}).values()
        assert len([overwrite(array) for array in arrays if writes]) > 10 or not writes

    def decide(view):
        look(view)
        return np.zeros(len(view.games) * len(view.agents), np.int64).reshape(len(view.games), len(view.agents))

    if phase is not None:
        ctx.game.add(gamms.array_rule(look), phase=phase)
        ctx.game.add(gamms.array_rule(score_visits), name="visits")
    for agent in ctx.agent.create_iter() if phase is None else ():
        if agent.team == "red":
            agent.strategy = gamms.array_strategy(decide)
    with ctx.game.batch(GAMES) as games:
        return finish(games)


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
@pytest.mark.parametrize("kind", KINDS)
def test_writing_into_arrays_of_a_rule_changes_nothing_else(kind, phase):
    assert end_with_an_array_function(kind, True, phase) == end_with_an_array_function(kind, False, phase)


@pytest.mark.parametrize("kind", KINDS)
def test_writing_into_arrays_of_a_strategy_changes_nothing_else(kind):
    assert end_with_an_array_function(kind, True) == end_with_an_array_function(kind, False)


def test_writing_into_arrays_of_a_recording_changes_nothing_else(tmp_path):
    open_game("edges", has_plain_rule=False).game.run(3, record=tmp_path / "game.ggr", sensed=True)
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:

        def ask():
            tables = {name: recording.table(name) for name in ("moves", "events", "sensed")}
            return {**tables, "map": recording.map_at(1), "state": recording.state(2), "drawn": recording.detached(2)}

        before = copy_arrays(ask())
        assert len(before) > 20
        written = [overwrite(array) for array in list_arrays(ask()).values()]
        assert any(written)
        assert find_differences(before, copy_arrays(ask())) == []
