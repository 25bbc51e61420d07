"""Scenarios: a game described completely by a YAML or JSON file, or by plain values in Python.

    scenario = gamms.scenario.load("match.yaml")
    result = scenario.replace(**{"teams.red.count": 8}).play(seed=7)

Read `spec.py` first: the keys of a file and their types. `documents.py` reads files, `validation.py` checks consistency
beyond types, and `code.py` finds, imports and calls the functions that a file names. `scenario.py` has the class;
`maps.py` loads the map, `placement.py` draws starting nodes, `builder.py` builds the game in a context, and
`describing.py` describes it in words.
May import: `context` and below. To add a key, declare it in `spec.py` and implement it in `builder.py`.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.scenario.documents import ScenarioError
from gamms.scenario.scenario import Scenario, from_gallery, from_recording, gallery, load
from gamms.scenario.spec import Spec, schema

__all__ = ["Scenario", "ScenarioError", "Spec", "from_gallery", "from_recording", "gallery", "load", "schema"]

_suggest_names(__name__, __all__)
