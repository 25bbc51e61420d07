"""Checks of graphs, sensors, rules, strategies and picture formats, for their implementers.

    from gamms.testing import check_graph
    check_graph(MyGraph)

Each raises `AssertionError` with a sentence that names the promise and the observed value. A client: it uses the
checked objects as any program would. `contracts.py` checks graphs, sensors and picture formats,
`reproducibility.py` rules and strategies. To add a check, write a function in one of these files or a new one, and
list it below.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.testing.contracts import check_backend, check_graph, check_sensor
from gamms.testing.reproducibility import check_rule, check_strategy

__all__ = ["check_backend", "check_graph", "check_rule", "check_sensor", "check_strategy"]

_suggest_names(__name__, __all__)
