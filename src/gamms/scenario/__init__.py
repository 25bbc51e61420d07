"""Scenarios: a game described completely by a YAML or JSON file, or by plain values in Python.

    scenario = gamms.scenario.load("match.yaml")
    result = scenario.replace(**{"teams.red.count": 8}).play(seed=7)

Read `spec.py` first: the keys of a file. `documents.py` reads files, `checks.py` finds what is wrong beyond types,
`references.py` finds the code that a file names and `code.py` runs it. `scenario.py` has the class: `world.py` loads
the map and places agents, `building.py` puts everything into a context. May import: `context` and below, `rules`.
To add a key, write it into `spec.py`, and what it does into `building.py`.
"""

from gamms.scenario.documents import ScenarioError
from gamms.scenario.scenario import Scenario, from_recording, load
from gamms.scenario.spec import Spec, schema

__all__ = ["Scenario", "ScenarioError", "Spec", "from_recording", "load", "schema"]
