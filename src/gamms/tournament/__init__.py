"""Tournaments: entries by several authors, each in a confined process of its own, and a ranking of them.

    table = gamms.tournament.run(scenario, entries={"ours": "ours.py:plan", "theirs": ["node", "entry.js"]},
                                 seeds=range(50), out="cup")

`games.py` plays one game: what each entry is asked, and the row that comes of it; read it first. `running.py` has who
plays whom, `workers.py` what a process that plays keeps, `table.py` what follows from the rows, `page.py` the page of
results, `entries.py` finds entries. `players.py` asks a process and says by which fault it loses; `launcher.py` starts
such processes, and `host.py` plays a Python function in one. `confinement.py` bounds what they may do, by the table in
`system_calls.py` among others, and `scratch.py` measures and removes their folders.
A client of scenarios and experiments: May import: `experiment` and below.
"""

from gamms.tournament.players import FAULTS
from gamms.tournament.running import load, run
from gamms.tournament.table import Cycle, Payoff, Rating, Standing, Table

__all__ = ["FAULTS", "Cycle", "Payoff", "Rating", "Standing", "Table", "load", "run"]
