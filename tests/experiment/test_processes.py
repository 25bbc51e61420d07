"""Programs that let worker processes play."""

import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Future
from pathlib import Path
from traceback import walk_stack

import numpy as np
import pytest
import small_hunts
from small_hunts import HUNT

from gamms import experiment
from gamms.errors import BadType
from gamms.workers import Worker, make_task, wait_for_result

HERE = Path(__file__).parent
PROGRAM = """
import sys
sys.path.insert(0, {here!r})
from small_hunts import HUNT
from gamms import experiment

def is_long(result):
    return result.turns > 1

{begin}
    print(len(experiment.run(HUNT, range(3), workers=1{more})), "games")
"""


def said_by(tmp_path, begin, more=""):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM.format(here=str(HERE), begin=begin, more=more))
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=False, timeout=120)
    return done.stdout, done.stderr.strip().rpartition("\n")[2]


def test_a_script_that_begins_at_once_is_not_run_again_in_workers(tmp_path):
    assert said_by(tmp_path, "if True:") == ("3 games\n", "")


def test_functions_of_the_script_are_there_in_workers(tmp_path):
    own = ', collect={"long": is_long}'
    assert said_by(tmp_path, 'if __name__ == "__main__":', own) == ("3 games\n", "")
    printed, error = said_by(tmp_path, "if True:", own)
    assert not printed
    assert 'under if __name__ == "__main__":' in error


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is another signal there")
def test_ctrl_c_is_not_for_a_worker_not_even_while_python_starts_there():
    worker = Worker()
    try:
        for wait_s in (0.0, 0.01, 0.02, 0.05):
            time.sleep(wait_s)
            os.kill(worker.pid, signal.SIGINT)
        assert worker.ask(make_task(len, "four")) == (True, 4)
    finally:
        worker.end()


KILLED = """
import sys
sys.path.insert(0, {here!r})
import small_hunts
from gamms import experiment

if __name__ == "__main__":
    vary = {{"strategies.blue": [small_hunts.linger]}}
    experiment.run(small_hunts.HUNT, range(30), vary, workers=2, out="killed")
"""


def children(of):
    try:
        tasks = list(Path(f"/proc/{of}/task").iterdir())
        below = [int(one) for task in tasks for one in (task / "children").read_text().split()]
    except OSError:
        return []
    return below + [one for child in below for one in children(child)]


@pytest.mark.skipif(os.name == "nt", reason="signals for one thread are of Unix")
def test_ctrl_c_that_does_not_wake_who_waits_ends_the_wait_all_the_same():
    def is_waiting():
        frames = walk_stack(sys._current_frames()[threading.main_thread().ident])
        return any(frame.f_code is wait_for_result.__code__ for frame, _ in frames)

    def interrupt():
        while not is_waiting():
            time.sleep(0.005)
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        woken.append(is_interrupted.wait(10.0))
        future.set_result(None)

    future, is_interrupted, woken = Future(), threading.Event(), []
    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        wait_for_result(future)
    is_interrupted.set()
    thread.join()
    assert woken == [True]


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_a_runner_that_was_killed_leaves_no_process_and_goes_on_to_the_same_rows(tmp_path):
    (tmp_path / "program.py").write_text(KILLED.format(here=str(HERE)))
    (tmp_path / "gate").touch()
    path = os.pathsep.join(sys.path)
    process = subprocess.Popen([sys.executable, "program.py"], cwd=tmp_path, env={**os.environ, "PYTHONPATH": path})
    journal = tmp_path / "killed" / "journal.jsonl"
    while not journal.exists() or len(journal.read_bytes().splitlines()) < 3:
        assert process.poll() is None
        time.sleep(0.01)
    below = children(process.pid)
    process.kill()
    process.wait()
    (tmp_path / "gate").unlink()
    until = time.monotonic() + 60.0  # they end when they ask for more, which one that begins does last
    while any(Path(f"/proc/{one}").exists() for one in below) and time.monotonic() < until:
        time.sleep(0.01)
    assert below
    assert not any(Path(f"/proc/{one}").exists() for one in below)
    done = len(journal.read_bytes().splitlines())
    assert 3 <= done < 30
    vary = {"strategies.blue": [small_hunts.linger]}
    whole = experiment.run(HUNT, range(30), vary, out=tmp_path / "whole")
    assert list(experiment.run(HUNT, range(30), vary, out=tmp_path / "killed")) == list(whole)
    files = [(tmp_path / name / "rows.jsonl").read_bytes() for name in ("whole", "killed")]
    assert files[0] == files[1]


def test_functions_of_a_console_are_refused_for_workers_with_the_way_out():
    program = """
from gamms import experiment, rl
from gamms.errors import BadValue
from gamms.scenario import Scenario

game = Scenario(max_turns=2, map={"grid": {"rows": 3, "columns": 3}}, teams={"red": {"count": 1}})
def f(one):
    return 1.0

for vary, collect in (({"strategies.red": {"f": f}}, None), (None, {"f": f})):
    try:
        experiment.run(game, range(2), vary, workers=2, collect=collect)
    except BadValue as error:
        print(error)
try:
    rl.vector_env(game, num_games=4, team="red", reward=f, workers=2)
except BadValue as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    sentence = "cannot import functions of a notebook or console: put them into a file and import it, or leave workers"
    assert done.stdout.count(sentence) == 3, done
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("seeds", [50, np.int64(50)])
def test_one_integer_is_not_seeds(seeds):
    with pytest.raises(BadType, match=r"\[50\] for the one seed, range\(50\) for the first ones"):
        experiment.run(HUNT, seeds)
