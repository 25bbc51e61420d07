"""Checks that an implementer can run over a graph, a sensor, a rule, a strategy or a picture format of their own.

    from gamms.testing import check_graph
    check_graph(MyGraph)

Each raises `AssertionError` with a sentence that says what was promised and what was seen. A client: it uses what it
checks as anybody would. To add a check, write a function here or in a file beside and name it below.
"""

from gamms.testing.backends import check_backend
from gamms.testing.graphs import check_graph
from gamms.testing.rules import check_rule
from gamms.testing.sensors import check_sensor
from gamms.testing.strategies import check_strategy

__all__ = ["check_backend", "check_graph", "check_rule", "check_sensor", "check_strategy"]
