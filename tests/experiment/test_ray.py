"""Experiments on a local cluster of Ray; skipped without it."""

from pathlib import Path

import pytest
import small_hunts
from small_hunts import HUNT

from gamms import experiment

ray = pytest.importorskip("ray")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_gives_the_same_rows_and_survives_processes_that_die(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=":")
    for strategy in (small_hunts.raise_at_times, small_hunts.die_at_times):
        vary = {"strategies.blue": [None, strategy]}
        there = experiment.run(HUNT, range(4), vary, executor="ray", workers=2)
        assert list(there) == list(experiment.run(HUNT, range(4), vary, workers=1))
    assert not ray.is_initialized()
