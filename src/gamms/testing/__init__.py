"""Checks of graphs, sensors, rules, strategies and picture formats, for their implementers, and games as text.

    from gamms.testing import check_graph
    check_graph(MyGraph)

Each check raises `AssertionError` with a sentence that names the promise and the observed value. A client: it uses the
checked objects as any program would. `contracts.py` checks graphs, sensors and picture formats, `reproducibility.py`
rules and strategies; `playthroughs.py` writes games as text. To add a check, write a function in one of these files,
and list it below.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.testing.contracts import check_backend, check_graph, check_sensor
from gamms.testing.playthroughs import playthrough
from gamms.testing.reproducibility import check_rule, check_strategy

__all__ = ["check_backend", "check_graph", "check_rule", "check_sensor", "check_strategy", "playthrough"]

_suggest_names(__name__, __all__)
