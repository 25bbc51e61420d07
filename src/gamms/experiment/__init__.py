"""Experiments: thousands of games of a scenario and its variants, as a table with intervals.

    rows = gamms.experiment.run(scenario, range(1000), {"teams.red.count": [3, 5, 8]}, workers=4, out="results")
    print(rows.summary())

Read `running.py` first: it hands out games and handles processes that die. `variants.py` makes grids, `sampling.py`
samples, `games.py` plays in a worker, `folders.py` stores a run on disk, `rows.py` is the result, `verification.py`
checks a folder, `statistics.py` computes intervals, and `tables.py` prints tables. A client of scenarios: May import:
`scenario` and below.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.experiment.folders import merge, pack, unpack
from gamms.experiment.rows import Rows, power
from gamms.experiment.running import load, run
from gamms.experiment.sampling import Sample, sample
from gamms.experiment.tables import Table
from gamms.experiment.verification import Verification

__all__ = ["Rows", "Sample", "Table", "Verification", "load", "merge", "pack", "power", "run", "sample", "unpack"]

_suggest_names(__name__, __all__)
