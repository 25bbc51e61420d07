"""Programs that let worker processes play."""

import subprocess
import sys
from pathlib import Path

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
