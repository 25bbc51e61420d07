"""The law of threads: any number of them, also another in each turn, plays the same games of every kind."""

import pytest
from batch_scenes import plain
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from random_games import MOTIONS, games
from test_births_and_deaths import WAYS, scenarios
from test_laws import games_with_plain_parts

from gamms.errors import GammsError

LAW = settings(
    max_examples=2,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
seeds = st.lists(st.integers(0, 2**40), min_size=2, max_size=7, unique=True)
some_threads = st.lists(st.integers(1, 3), min_size=1, max_size=4)


def outcomes(make_batch, plays):
    """Return the results of the games of a batch for each way to play them, or the errors."""
    found = []
    for play in plays:
        with make_batch() as batch:
            try:
                play(batch)
                found.append([repr(plain(batch.result(number))) for number in range(len(batch))])
            except GammsError as error:
                found.append([type(error), str(error)])
    return found


def step_to_end(threads):
    """Return a function that plays a batch step by step, with these numbers of threads in turn."""

    def play(batch):
        turn = 0
        while not batch.is_over.all():
            batch.step(threads=threads[turn % len(threads)])
            turn += 1

    return play


def check_threads(make_batch, threads):
    """Check that games are the same by one thread, by two, and by one, then three, then other numbers."""
    ways = [step_to_end([1]), step_to_end([1, 3, *threads]), lambda batch: batch.run(threads=2)]
    first, *others = outcomes(make_batch, ways)
    assert all(other == first for other in others)


@pytest.mark.parametrize("how", MOTIONS)
@LAW
@given(data=st.data(), seeds=seeds, threads=some_threads)
def test_threads_change_no_game(how, data, seeds, threads):
    kinds = st.one_of(games((how,)), games((how,), in_air=True), games_with_plain_parts((how,)))
    with data.draw(kinds).open() as ctx:
        check_threads(lambda: ctx.game.batch(seeds=seeds), threads)


@pytest.mark.parametrize("way", WAYS)
@LAW
@given(data=st.data(), seeds=seeds, threads=some_threads)
def test_threads_change_no_game_in_which_agents_come_and_go(way, data, seeds, threads):
    scenario, maps = data.draw(scenarios(way))
    check_threads(lambda: scenario.batch(seeds=seeds, maps=maps), threads)
