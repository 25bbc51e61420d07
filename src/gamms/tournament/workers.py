"""The work of a process that plays: games of two entries, with launchers that stay ready for later games."""

from collections import OrderedDict
from multiprocessing import parent_process
from pathlib import Path
from typing import NamedTuple

from gamms.experiment.games import load_settings
from gamms.folders import remove_link, write_whole
from gamms.limits import allowing
from gamms.scenario import Scenario
from gamms.scenario.spec import to_plain
from gamms.tournament import games
from gamms.tournament.entries import Entry
from gamms.tournament.games import Fixture, Row
from gamms.tournament.players import Launcher, ResourceLimits

_MOST_LAUNCHERS = 4  # each takes some 60 MB


class TournamentSettings(NamedTuple):
    """Settings shared by all games of a tournament.

    Attributes:
        scenario: the scenario of the games.
        secret: the secret of the run, from which the seeds follow.
        map: the file of its map.
        scratch: the folder for the scratch folders of entries.
        allowed: the resources that an entry may use.
        games: the folder for recordings; None: do not record.
        logs: the folder for the logs of entries with a fault.
        memory: the memory limit of `gamms.limits`, bytes.
    """

    scenario: Scenario
    secret: str
    map: Path
    scratch: Path
    allowed: ResourceLimits
    games: Path | None
    logs: Path
    memory: int


class Task(NamedTuple):
    """Games of two entries, for one process.

    Attributes:
        settings: the pickled `TournamentSettings`.
        entries: the two entries.
        fixtures: the games.
        keeps_launchers: whether to keep launchers for later tasks, in a process that ends with the tournament.
    """

    settings: bytes
    entries: tuple[Entry, Entry]
    fixtures: tuple[Fixture, ...]
    keeps_launchers: bool


class TrialResult(NamedTuple):
    """The result of trying an entry.

    Attributes:
        reason: why the entry cannot play; None: it can.
        not_enforced: descriptions of the limits that this system cannot enforce.
    """

    reason: str | None
    not_enforced: list[str]


_launchers: OrderedDict[tuple[bytes, Entry], Launcher] = OrderedDict()


def play(task: Task) -> list[Row]:
    """Play the games of a task, write their recordings and logs, and return their rows."""
    settings = load_settings(task.settings)
    rows = []
    with allowing(settings.memory):
        launchers = {entry.name: _make_launcher(task.settings, entry) for entry in task.entries}
        for fixture in task.fixtures:
            parent = parent_process()
            if parent is not None and not parent.is_alive():
                raise SystemExit
            rows.append(_play_fixture(settings, fixture, launchers))
    if not task.keeps_launchers:
        close_launchers()
    return rows


def _play_fixture(settings: TournamentSettings, fixture: Fixture, launchers: dict[str, Launcher]) -> Row:
    record = None
    if settings.games is not None:
        settings.games.mkdir(exist_ok=True)
        record = remove_link(settings.games / f"{fixture.id}.ggr")
    row, logs = games.play(settings.scenario, settings.secret, fixture, launchers, record)
    for team in row["faults"]:
        if logs[team]:
            settings.logs.mkdir(exist_ok=True)
            write_whole(settings.logs / f"{fixture.id}.{list(fixture.entries).index(team)}.txt", logs[team])
    return row


def _make_launcher(settings: bytes, entry: Entry) -> Launcher:
    key = settings, entry
    if key not in _launchers:
        if len(_launchers) == _MOST_LAUNCHERS:
            _launchers.popitem(last=False)[1].close()
        known: TournamentSettings = load_settings(settings)
        game = to_plain(known.scenario.spec.settings)
        _launchers[key] = Launcher(entry, known.allowed, known.map, game, known.scratch)
    _launchers.move_to_end(key)
    return _launchers[key]


def close_launchers() -> None:
    """Close all launchers that this process has kept."""
    while _launchers:
        _launchers.popitem()[1].close()


def run_trial(
    settings: bytes, entry: Entry, sides: tuple[str, str], seed: int, *, keeps_launchers: bool
) -> TrialResult:
    """Try an entry; see `TrialResult`.

    Args:
        settings: the pickled `TournamentSettings`.
        entry: the entry.
        sides: the team that the entry plays, and the other one.
        seed: the label of the trial game.
        keeps_launchers: see `Task`.
    """
    known: TournamentSettings = load_settings(settings)
    with allowing(known.memory):
        launcher = _make_launcher(settings, entry)
        reason = games.try_entry(known.scenario, known.secret, seed, sides, launcher)
        found = TrialResult(reason, launcher.list_missing())
    if not keeps_launchers:
        close_launchers()
    return found
