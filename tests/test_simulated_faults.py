"""Games that are played through random faults: `scripts/simulate_faults.py` plays many more."""

import signal
import sys
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("limits the process and looks into /proc", allow_module_level=True)
if find_spec("openai") is None:  # which takes long to import
    pytest.skip("language models are among the players: openai is not installed", allow_module_level=True)

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import simulate_faults
from simulate_faults import (
    FAULTS,
    INVARIANTS,
    PARTS,
    PLAYERS,
    Case,
    Memory,
    draw_case,
    failure_of,
    hold,
    minimize,
    play,
    report,
)

from gamms import folders
from gamms.bridge import Feed
from gamms.context import Context
from gamms.llm.limits import UsageAccount
from gamms.recorder import Recording
from gamms.recorder.session import RecordingSession
from gamms.scenario import Scenario
from gamms.web.people import People


@pytest.mark.parametrize("seed", [1, 3, 7, 8])
def test_a_game_ends_as_without_its_players_and_faults(seed):
    assert failure_of(draw_case(seed)) is None


def test_games_are_interrupted_where_programs_do_not_hear_ctrl_c(monkeypatch, capsys):
    case = Case(2, (), ((1, "Ctrl-C"), (2, "Ctrl-C in an experiment")))
    monkeypatch.setattr(simulate_faults, "draw_case", lambda _: case)
    monkeypatch.setattr(sys, "argv", ["simulate_faults.py", "--seed", "2"])
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as nohup, cron and shells in the background start programs
    try:
        with pytest.raises(SystemExit):
            simulate_faults.main()
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().out == "0 failures in 1 runs from seed 2\n"


def test_each_fault_happens_and_is_one_sentence():
    faults = [name for name in FAULTS if name != "worker killed"]  # it takes a second
    parts = [name for name in (*PARTS, *PLAYERS) if name != "strategies"]  # some of which no person can say
    struck = play(Case(3, tuple(parts), tuple((number // 3, name) for number, name in enumerate(faults))))
    assert [line.partition(": ")[2].partition(": ")[0] for line in struck] == faults


def test_the_same_seed_draws_the_same_scenario_and_faults():
    cases = [draw_case(seed) for seed in range(50)]
    assert cases == [draw_case(seed) for seed in range(50)]
    assert {name for case in cases for _, name in case.faults} == {*FAULTS}
    assert {name for case in cases for name in case.parts} == {*PARTS, *PLAYERS}
    assert cases[7].scenario() == draw_case(7).scenario()


def test_a_failure_is_reported_with_its_seed_and_the_least_of_its_scenario(monkeypatch):
    def fail_of_rules(run):
        """Fail in games with rules in which Ctrl-C has been pressed."""
        hold("planted", "rules" not in run.case.parts or not any("Ctrl-C" in line for line in run.log))

    monkeypatch.setitem(INVARIANTS, "planted", fail_of_rules)
    case = Case(9, ("map", "rules"), ((0, "file cut"), (1, "Ctrl-C")))
    failure = failure_of(case)
    words = report(case, failure, minimize(case, failure))
    assert words.startswith("seed 9 fails at commit ")
    assert "planted" in words
    assert "parts: rules\n  faults: Ctrl-C in turn 1\n" in words


# -- planted bugs -------------------------------------------------------------------------------------------------


kept = []


def keep(thing):
    """Keep a thing in memory, and do nothing else."""
    kept.append(thing)


def write_in_place(patch):
    """Write files where they are, without one beside them."""
    patch.setattr(folders, "open_whole_file", contextmanager(lambda path, **_: (one for one in [path])))


def keep_files_open(patch):
    """Close no recording."""
    patch.setattr(Recording, "close", keep)


def let_threads_wait(patch):
    """Stop no thread of a feed."""
    patch.setattr(Feed, "close", keep)


def swallow_choices(patch):
    """Emit no events about people."""
    patch.setattr(People, "__call__", lambda *_: None)


def count_twice(patch):
    """Emit each event about a model twice."""
    real = UsageAccount.note

    def note(account, decision, time, **options):
        real(account, decision, time - 1.0, **options)
        real(account, decision, time, **options)

    patch.setattr(UsageAccount, "note", note)


def shift_seeds(patch):
    """Give the games of a batch the seeds of others."""
    real = Scenario.batch

    def batch(scenario, count, *, seed, **options):
        return real(scenario, count, seed=seed + 1, **options)

    patch.setattr(Scenario, "batch", batch)


def keep_contexts(patch):
    """Keep each context that is terminated."""
    real = Context.terminate
    patch.setattr(Context, "terminate", lambda ctx: kept.append(ctx) or real(ctx))


def keep_questions(patch):
    """Leave questions to people open when their turn is over."""
    real = People.__call__

    def end_turn(people, ctx):
        left = dict(people._questions)
        real(people, ctx)
        people._questions |= left

    patch.setattr(People, "__call__", end_turn)


def keep_logs(patch):
    """Keep what is recorded of each turn."""
    real = RecordingSession._write_turn

    def write_turn(session):
        session.__dict__.setdefault("past", []).append(session.log)
        real(session)

    patch.setattr(RecordingSession, "_write_turn", write_turn)
    patch.setattr(simulate_faults, "FLAT_EVERY", 1)


PLANTED = {
    write_in_place: ("disk full of a file", "no file is half-written"),
    keep_files_open: ("file cut", "no process, descriptor or thread is left"),
    let_threads_wait: ("dead robot", "no process, descriptor or thread is left"),
    swallow_choices: ("late person", "each fault is one logged sentence"),
    count_twice: ("model timeout", "each choice counts once"),
    shift_seeds: ("Ctrl-C", "alone = batch"),
    keep_contexts: ("Ctrl-C", "memory is flat"),
    keep_questions: ("late person", "no question is left"),
    keep_logs: ("Ctrl-C", "memory is flat"),
}


@pytest.mark.parametrize("plant", PLANTED, ids=lambda plant: plant.__name__)
def test_a_planted_bug_is_found(plant, monkeypatch):
    fault, invariant = PLANTED[plant]
    with monkeypatch.context() as patch:
        patch.setattr(simulate_faults, "GRACE_S", 0.2)
        plant(patch)
        found = failure_of(Case(3, (), ((1, fault),)))
    for one in kept:
        if not isinstance(one, Context):
            one.close()
    kept.clear()
    assert found is not None, "The run succeeds."
    assert found.startswith(invariant), found


@pytest.mark.parametrize(
    ("leak", "what"), [(lambda: [[] for _ in range(2000)], "objects"), (lambda: bytes(1_000_000), "bytes")]
)
def test_memory_that_grows_with_each_run_is_noticed(leak, what, monkeypatch):
    monkeypatch.setattr(simulate_faults, "WARM_RUNS", 3)
    memory = Memory()
    things = []
    found = []
    for _ in range(6):
        things.append(leak())
        found.append(memory.check_run())
    assert found[:3] == [None] * 3
    assert f"more {what} after 3 runs" in found[-1]


def test_a_run_that_takes_too_long_is_a_failure(monkeypatch):
    monkeypatch.setattr(simulate_faults, "MOST_CPU_S", 0.0)
    monkeypatch.setattr(simulate_faults, "TRIES", 1)
    assert "a run takes at most 0.0 CPU-s" in simulate_faults.run_seed(1)
