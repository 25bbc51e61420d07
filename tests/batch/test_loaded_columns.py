"""Columns that a batch loads are those of its games: every column has limits, and odd values do no harm."""

from contextlib import suppress
from functools import cache

import numpy as np
import pytest
from batch_scenes import WALK, scene
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, GammsError

FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}}}
RETURN = {"rule": "respawn", "with": {"teams": "blue"}}
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
ROAM = "gamms.strategies:random_waypoints"
PATROL = {"function": "gamms.strategies:patrol", "with": {"nodes": [3, 4, 21]}}
METRES = {"speed_unit": "metres"}


def teams(**speeds):
    return {name: {"count": 3, "strategy": ROAM, "speed": speed} for name, speed in speeds.items()}


SCENES = {
    "one edge": scene([TAG, FLAGS, RETURN]),
    "patrols": scene(teams={"red": {"count": 2, "strategy": PATROL}}),
    "speeds": scene([TAG, RETURN], teams=teams(red=2.5, blue=1.3)),
    "metres": scene([TAG, RETURN], teams=teams(red=7.0, blue=12.5), settings=METRES),
    "arrivals": scene([TAG], teams=teams(red=7.0, blue=12.5), settings={**METRES, "decide": "arrival"}),
    "flyers": scene(teams={"red": {"count": 2, "type": "AERIAL", "speed": 3.0, "strategy": WALK, "altitude": 5.0}}),
    "more to come": scene([TAG]),
}


@gamms.array_strategy
def glide(view):
    return np.ones((*view.mask.shape, 3))


MORE = {"more to come": {"most_agents": {"red": 4, "blue": 4}}, "flyers": {"strategies": {"red": glide}}}


@cache
def played(name):
    """Return two games after three turns."""
    games = SCENES[name].batch(2, seed=1, **MORE.get(name, {}))
    for _ in range(3):
        games.step()
    return games, games.columns()


def load(name, columns, turn=3):
    """Load columns, and play on; errors of GAMMS are allowed."""
    games, _ = played(name)
    games.load(columns, turn)
    games.step()
    games.step()


FLOATS = [0.0, -0.5, 0.5, 1.0, 7.0, -1e300, 1e300, 5e-324, float("nan"), float("inf"), float("-inf")]
INTEGERS = [0, -1, -2, 1, 3, 4, 24, 25, 99, 2**31, 2**53, 2**62, 2**63 - 1, -(2**63)]
ODD = {"f": FLOATS, "i": INTEGERS, "u": [abs(one) for one in INTEGERS], "b": [False, True]}


@pytest.mark.parametrize("name", SCENES)
def test_columns_of_games_fit_these_games_after_every_turn(name):
    with (
        SCENES[name].batch(3, seed=2, **MORE.get(name, {})) as games,
        SCENES[name].batch(3, seed=2, **MORE.get(name, {})) as others,
    ):
        for turn in range(1, 9):
            games.step()
            columns = games.columns()
            others.load(columns, turn)
            again = others.columns()
            assert all(np.array_equal(columns[key], again[key], equal_nan=True) for key in columns)


@given(data=st.data(), name=st.sampled_from([*SCENES]))
def test_odd_values_of_any_column_are_refused_or_do_no_harm(data, name):
    column = data.draw(st.sampled_from([*played(name)[1]]))
    columns = {key: values.copy() for key, values in played(name)[1].items()}
    values = columns[column]
    odd = data.draw(st.sampled_from(ODD[values.dtype.kind]))
    if data.draw(st.booleans()):
        values[...] = odd
    else:
        values.flat[data.draw(st.integers(0, max(0, values.size - 1)))] = odd
    with suppress(GammsError):
        load(name, columns)


@given(data=st.data(), name=st.sampled_from([*SCENES]))
def test_columns_of_other_moments_are_refused_or_do_no_harm(data, name):
    """Each column may be that of another game, so that they contradict each other."""
    before = played(name)[1]
    columns = {key: values[data.draw(st.sampled_from([[0, 1], [1, 0], [1, 1]]))] for key, values in before.items()}
    with suppress(GammsError):
        load(name, columns)


WRONG = [
    ("metres", "share", 7.0, "'share' has numbers of at least 0 and less than 1, not 7.0"),
    ("metres", "share", 1.0, "'share' has numbers of at least 0 and less than 1, not 1.0"),
    ("metres", "share", float("nan"), "'share' has numbers of at least 0 and less than 1, not nan"),
    ("metres", "motion", 99, "'motion' has numbers from 0 to 3, not 99"),
    ("metres", "edge", 10**6, "'edge' has numbers from -1 to 79, not 1000000"),
    ("metres", "node", 99, "'node' has numbers from 0 to 24, not 99"),
    ("metres", "node", 12, r"'edge' has \d+ for agent '\w+' of game \d, and this edge does not begin at its 'node'"),
    ("speeds", "covered", -0.5, "'covered' has numbers of at least 0 and less than 1, not -0.5"),
    ("speeds", "begun", 25, "'begun' has numbers from -1 to 24, not 25"),
    ("speeds", "begun", 12, r"'begun' has 12 for agent '\w+' of game \d, and no edge leads there from its 'node'"),
    ("one edge", "stops", -1, r"'stops' has numbers from 0 to \d+, not -1"),
    ("one edge", "stops", 2**60, r"'stops' has numbers from 0 to \d+, not \d+"),
    ("more to come", "is_there", False, "'alive' has True for agent 'blue_0' of game 0, who is not in the game"),
    ("flyers", "position", float("nan"), r"'position' has \[nan nan nan\] for agent 'red_0' of game 0, who is in the"),
    ("flyers", "quat", float("inf"), r"'quat' has \[inf inf inf inf\] .* which is not a rotation"),
]


@pytest.mark.parametrize(("name", "column", "value", "message"), WRONG)
def test_a_column_beyond_its_limits_is_refused_and_changes_nothing(name, column, value, message):
    games, columns = played(name)
    games.load(columns, 3)
    wrong = {**columns, column: np.full_like(columns[column], value)}
    with pytest.raises(BadValue, match=message):
        games.load(wrong, 3)
    assert all(np.array_equal(games.columns()[key], columns[key], equal_nan=True) for key in columns)


@pytest.mark.parametrize("turn", [2**63 - 1, 2**53 + 1, 10**400, -1, 1.5, None])
def test_a_turn_that_no_game_reaches_is_refused(turn):
    games, columns = played("one edge")
    with pytest.raises((BadType, BadValue), match="turn"):
        games.load(columns, turn)
