"""Games that are played through random faults: `scripts/simulate_faults.py` plays many more."""

import sys
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("limits the process and looks into /proc", allow_module_level=True)
pytest.importorskip("openai", reason="language models are among the players")

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import simulate_faults
from simulate_faults import FAULTS, INVARIANTS, PARTS, Case, draw_case, failure_of, hold, play, report


@pytest.mark.parametrize("seed", [1, 3, 6, 7, 21])
def test_a_game_ends_as_without_its_faults(seed):
    assert failure_of(draw_case(seed)) is None


def test_each_fault_happens_and_is_one_sentence():
    faults = [name for name in FAULTS if name != "worker killed"]  # it takes a second
    struck = play(Case(3, tuple(PARTS), tuple((number // 3, name) for number, name in enumerate(faults))))
    assert [line.partition(": ")[2].partition(": ")[0] for line in struck] == faults


def test_the_same_seed_draws_the_same_scenario_and_faults():
    cases = [draw_case(seed) for seed in range(50)]
    assert cases == [draw_case(seed) for seed in range(50)]
    assert {name for case in cases for _, name in case.faults} == {*FAULTS}
    assert cases[7].scenario() == draw_case(7).scenario()


def test_a_failure_is_reported_with_its_seed_and_the_least_of_its_scenario(monkeypatch):
    def fail_of_rules(run):
        """Fail in games with rules in which Ctrl-C has been pressed."""
        hold("planted", "rules" not in run.case.parts or not any("Ctrl-C" in line for line in run.log))

    monkeypatch.setitem(INVARIANTS, "planted", fail_of_rules)
    case = Case(9, ("map", "rules"), ((0, "file cut"), (1, "Ctrl-C")))
    words = report(case, failure_of(case))
    assert words.startswith("seed 9 fails at commit ")
    assert "planted" in words
    assert "parts: rules\n  faults: Ctrl-C in turn 1\n" in words


def test_a_thread_that_is_left_is_noticed(monkeypatch):
    before = simulate_faults.resources()
    left = before._replace(threads=before.threads - {"MainThread"})
    monkeypatch.setattr(simulate_faults, "GRACE_S", 0.0)
    with pytest.raises(simulate_faults.Broken, match="no process, descriptor or thread is left"):
        simulate_faults.check_resources(left)
