"""Games that are played in a batch and one by one, and compared."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # for the scenarios beside


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
