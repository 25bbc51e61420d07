"""The tasks of a version of the suite: fixed scenarios with a protocol, named by the digests of their contents."""

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.arguments import as_choice, as_int, as_known
from gamms.context import create_context
from gamms.errors import BadFile, BadValue
from gamms.plain import Plain
from gamms.scenario import Scenario

if TYPE_CHECKING:
    import networkx as nx

VERSION = 1  # version of the tasks and the protocol by default; results of different versions are not comparable
VERSIONS = (1, 2)
"""The versions of the suite."""
CITIES = {"train": ("helsinki", "victoria", "bejaia"), "test": ("monaco", "gothenburg")}
"""The cities of the districts of version 2, for training and for tests."""

_DATA = Path(__file__).parent.parent / "data"
_DISTRICTS = _DATA / "districts"
_NO_MAPS: dict[str, Plain] = {}
_FIELDS_1 = 7  # the number of fields of tasks of version 1
BASELINES: dict[str, Plain] = {
    "scripted": None,
    "random_walk": "gamms.strategies:random_walk",
    "stay": "gamms.strategies:stay",
}
"""The baselines of version 1: name -> strategy; None: the scenario's own strategy."""


class Task(NamedTuple):
    """A scenario, and how a strategy is measured on it.

    Attributes:
        name: kind and map, and the first eight digits of the SHA-256 of the other attributes.
        scenario: the scenario as plain values; the team plays its baseline in it.
        team: the team whose agents all play the strategy.
        opponent: the other team.
        opponents: strategies of the other team, by name, with equal weights.
        seeds: the seeds of the games against each of them.
        metric: `wins.<team>`, the share of games that the team wins.
        maps: the maps of the task, by name, with equal weights; {}: the map of the scenario.
        baselines: strategies of the team for comparison, by name; None: the scenario's own strategy.
    """

    name: str
    scenario: dict[str, Plain]
    team: str
    opponent: str
    opponents: dict[str, Plain]
    seeds: list[int]
    metric: str
    maps: dict[str, Plain] = _NO_MAPS
    baselines: dict[str, Plain] = BASELINES


def tasks(version: int = VERSION) -> list[Task]:
    """Return the tasks of a version of the suite, which never change.

    Raises:
        BadValue: the version does not exist.
        BadFile: the file of the version is damaged.
    """
    file = find_task_file(version)
    found = [Task(**one) for one in json.loads(file.read_text(encoding="utf-8"))]
    for task in found:
        if task.name != add_digest(task).name:
            raise BadFile(f"{str(file)!r} is damaged: task {task.name!r} is not what its name says.")
    return found


def find_task_file(version: int, suffix: str = "") -> Path:
    """Return the file of a version of the suite.

    Raises:
        BadValue: the version does not exist.
    """
    if as_int(version, "version") not in VERSIONS:
        known = " and ".join(map(str, VERSIONS))
        raise BadValue(f"There is no version {version} of the suite; there are the versions {known}.")
    return _DATA / f"suite_{version}{suffix}.json"


def districts(part: str = "train") -> dict[str, Plain]:
    """Return the districts of version 2 of the suite: name -> map, as `maps=` of environments and `rl.evaluate` takes.

    Args:
        part: "train" or "test": the districts of the cities for training, or for tests; or a city.

    Raises:
        BadValue: the part does not exist.
    """
    every = [city for cities in CITIES.values() for city in cities]
    chosen = as_choice(part, "part", [*CITIES, *every])
    cities = CITIES.get(chosen, (chosen,))
    names = [file.stem for city in cities for file in sorted(_DISTRICTS.glob(f"{city}_*.gamms"))]
    return {name: {"generator": {"function": "gamms.suite:district", "with": {"name": name}}} for name in names}


def district(name: str) -> "nx.DiGraph[int]":
    """Return a district of version 2 of the suite, such as "monaco_1": its junctions, and the ways between them.

    Nodes 0, 1 and 2 are the exits, far from the center and from each other; node 3 is the center.

    Raises:
        UnknownName (KeyError): the district does not exist.
    """
    known = as_known(name, "district", [file.stem for file in sorted(_DISTRICTS.glob("*.gamms"))])
    with create_context() as ctx:
        ctx.graph.load(_DISTRICTS / f"{known}.gamms")
        return ctx.graph.to_networkx()


def make_scenario(task: Task, strategy: Plain = None, **code: Any) -> Scenario:
    """Return the scenario of a task with a strategy for the team; `code` locates its code: folder, allow."""
    scenario = Scenario(**task.scenario, **code)
    return scenario if strategy is None else scenario.replace(**{f"teams.{task.team}.strategy": strategy})


def add_digest(task: Task) -> Task:
    """Return a task with the name that its content determines."""
    kind, map = task.name.split("-")[:2]
    content = json.dumps(task[1:] if task.maps else task[1:_FIELDS_1], sort_keys=True)
    return task._replace(name=f"{kind}-{map}-{hashlib.sha256(content.encode()).hexdigest()[:8]}")
