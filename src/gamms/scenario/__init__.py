"""Scenarios: a game described completely by a YAML or JSON file, or by plain values in Python.

    scenario = gamms.scenario.load("match.yaml")
    result = scenario.replace(**{"teams.red.count": 8}).play(seed=7)

Read `shape.py` first: what a file may say. `files.py` reads it, `explain.py` and `checks.py` say what is wrong with it,
`references.py` finds the code it names and `code.py` runs that. `scenario.py` builds: `worlds.py` loads the map,
`placing.py` draws places, `building.py` puts everything into a context. A client: it uses a context as you would.
To add a key, write it into `shape.py`, and what it does into `building.py`.
"""

from gamms.scenario.errors import ScenarioError
from gamms.scenario.scenario import Scenario, from_recording, load
from gamms.scenario.shape import Spec, schema

__all__ = ["Scenario", "ScenarioError", "Spec", "from_recording", "load", "schema"]
