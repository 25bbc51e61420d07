"""Games that are played in a batch and one by one, and compared."""

import sys
from pathlib import Path

import pytest

from gamms.game.block import travelers
from gamms.game.movement import arrivals

sys.path.insert(0, str(Path(__file__).parent))  # for the scenarios beside


@pytest.fixture(autouse=True, scope="session")
def agents_arrive_few_times_in_a_turn():
    """Let agents that go to and fro on edges of no length wait soon, which else takes long."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arrivals, "MOST_ARRIVALS", 20)
        patch.setattr(travelers, "MOST_ARRIVALS", 20)
        yield


@pytest.fixture
def same_as_one_by_one():
    """Check that all games of a batch equal those that `play` plays."""
    from batch_scenes import assert_as_played

    def check(scenario, seeds, strategies=None):
        with scenario.batch(seeds=seeds, strategies=strategies) as played:
            played.run()
            assert_as_played(played, scenario, strategies)

    return check
