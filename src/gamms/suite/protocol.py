"""The tasks of a version of the suite: fixed scenarios with a protocol, named by the digests of their contents."""

import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple

from gamms.arguments import as_int
from gamms.errors import BadFile, BadValue
from gamms.plain import Plain
from gamms.scenario import Scenario

VERSION = 1  # version of the tasks and the protocol; results of different versions are not comparable
_DATA = Path(__file__).parent.parent / "data"


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
    """

    name: str
    scenario: dict[str, Plain]
    team: str
    opponent: str
    opponents: dict[str, Plain]
    seeds: list[int]
    metric: str


def tasks(version: int = VERSION) -> list[Task]:
    """Return the tasks of a version of the suite, which never change.

    Raises:
        BadValue: the version does not exist.
        BadFile: the file of the version is damaged.
    """
    file = task_file(as_int(version, "version"))
    if not file.is_file():
        raise BadValue(f"There is no version {version} of the suite; the last one is {VERSION}.")
    found = [Task(**one) for one in json.loads(file.read_text(encoding="utf-8"))]
    for task in found:
        if task.name != _named(task).name:
            raise BadFile(f"{str(file)!r} is damaged: task {task.name!r} is not what its name says.")
    return found


def task_file(version: int, suffix: str = "") -> Path:
    """Return the file of a version of the suite."""
    return _DATA / f"suite_{version}{suffix}.json"


def scenario_of(task: Task, strategy: Plain = None, **code: Any) -> Scenario:
    """Return the scenario of a task with a strategy for the team; `code` locates its code: folder, allow."""
    scenario = Scenario(**task.scenario, **code)
    return scenario if strategy is None else scenario.replace(**{f"teams.{task.team}.strategy": strategy})


def _named(task: Task) -> Task:
    """Return a task with the name that its content determines."""
    kind, map = task.name.split("-")[:2]
    content = json.dumps(task[1:], sort_keys=True)
    return task._replace(name=f"{kind}-{map}-{hashlib.sha256(content.encode()).hexdigest()[:8]}")
