"""The benchmark suite: fixed scenarios with a protocol for comparing strategies, in two versions.

    results = gamms.suite.run("mine:strategy", folder="players", workers=4, out="results")
    print(results.table)

Read `protocol.py` first: it defines tasks, and the districts of version 2. `generator.py` draws scenarios of version 1
by seed, `results.py` plays a strategy on all tasks and has the results of the baselines. A client of experiments: May
import: `experiment`, `scenario` and below.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.suite.generator import KINDS, MAPS, generate
from gamms.suite.protocol import BASELINES, CITIES, VERSION, VERSIONS, Task, district, districts, tasks
from gamms.suite.results import Results, references, run

__all__ = [
    "BASELINES",
    "CITIES",
    "KINDS",
    "MAPS",
    "VERSION",
    "VERSIONS",
    "Results",
    "Task",
    "district",
    "districts",
    "generate",
    "references",
    "run",
    "tasks",
]

FOR_SCENARIOS = {"district": district}

_suggest_names(__name__, __all__)
