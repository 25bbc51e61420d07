"""The benchmark suite: ten fixed scenarios with a protocol for comparing strategies.

    results = gamms.suite.run("mine:strategy", folder="players", workers=4, out="results")
    print(results.table)

Read `protocol.py` first: it defines tasks, and the ten tasks of this version. `generator.py` draws scenarios by seed,
`results.py` plays a strategy on all tasks and has the results of the baselines. A client of experiments: May import:
`experiment`, `scenario` and below.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.suite.generator import KINDS, MAPS, generate
from gamms.suite.protocol import VERSION, Task, tasks
from gamms.suite.results import BASELINES, Results, references, run

__all__ = ["BASELINES", "KINDS", "MAPS", "VERSION", "Results", "Task", "generate", "references", "run", "tasks"]

_suggest_names(__name__, __all__)
