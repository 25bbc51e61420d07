"""Games that are played in a batch and one by one, and compared."""

import sys
from pathlib import Path

import pytest

from gamms.game.batch import games

sys.path.insert(0, str(Path(__file__).parent))  # for the scenarios beside


@pytest.fixture(autouse=True, scope="session")
def agents_are_asked_in_few_games():
    """Ask strategies and call rules in array turns of few games, too, which are faster one by one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(games, "why_slower", lambda *_, **__: None)
        yield


@pytest.fixture
def same_as_one_by_one():
    """Check that all games of a batch, played in arrays, equal those that `play` plays."""
    from batch_scenes import plain

    def check(scenario, seeds, strategies=None):
        with scenario.batch(seeds=seeds, strategies=strategies) as games:
            assert games.slow is None
            games.run()
            for number, seed in enumerate(seeds):
                assert plain(games.result(number)) == plain(scenario.play(seed=seed, strategies=strategies))

    return check
