"""Tournaments: entries by several authors, each in a confined process of its own, and a ranking of them.

    table = gamms.tournament.run(scenario, entries={"ours": "ours.py:plan", "theirs": ["node", "entry.js"]},
                                 seeds=range(50), out="cup")

`games.py` plays one game and returns its row; read it first. `running.py` decides who plays whom, `workers.py` plays
games in a worker process, `table.py` evaluates the rows, `page.py` writes the page of results, and `entries.py` finds
entries. `players.py` asks the process of an entry and detects faults; `launcher.py` starts these processes, and
`host.py` plays a Python function in one. `confinement.py` confines them, among others by the table in
`system_calls.py`, and `scratch.py` measures and removes their folders.
A client of scenarios and experiments: May import: `experiment` and below.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.tournament.players import FAULTS
from gamms.tournament.running import load, run
from gamms.tournament.table import Cycle, Payoff, Rating, Standing, Table

__all__ = ["FAULTS", "Cycle", "Payoff", "Rating", "Standing", "Table", "load", "run"]

_suggest_names(__name__, __all__)
