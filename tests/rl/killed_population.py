"""A population whose process is killed while games are played, or a policy is trained."""

import os
import signal
import sys

from test_populations import grown

from gamms.experiment.folders import Journal
from gamms.rl import populations

add = Journal.add
save = populations.save_policy
moment, folder = sys.argv[1:]


def die():
    os.kill(os.getpid(), signal.SIGKILL)


def add_and_die(self, rows, series):
    add(self, rows, series)
    if moment == "games of a response" and any("learn" in str(row) for row in rows):
        die()


def die_or_save(network, path, env):
    if moment == "training" and "blue" in path.parts:
        die()
    save(network, path, env)


Journal.add = add_and_die
populations.save_policy = die_or_save
grown(folder)
