"""What a process that plays does: games of two entries, with launchers that it keeps for the next ones."""

from collections import OrderedDict
from multiprocessing import parent_process
from pathlib import Path
from typing import NamedTuple

from gamms.experiment.games import loaded
from gamms.folders import without_link, write_whole
from gamms.limits import allowing
from gamms.scenario import Scenario
from gamms.scenario.spec import to_plain
from gamms.tournament import games
from gamms.tournament.entries import Entry
from gamms.tournament.games import Fixture, Row
from gamms.tournament.players import Allowed, Launcher

_MOST_LAUNCHERS = 4  # each takes some 60 MB


class Settings(NamedTuple):
    """What all games of a tournament have in common.

    Attributes:
        scenario: of the games.
        map: the file of its map.
        scratch: the folder in which entries get their own.
        allowed: what an entry may take.
        games: the folder for recordings; None: there are none.
        logs: the folder for what entries with a fault have written.
        memory: what `gamms.limits` allows, bytes.
    """

    scenario: Scenario
    map: Path
    scratch: Path
    allowed: Allowed
    games: Path | None
    logs: Path
    memory: int


class Task(NamedTuple):
    """Games of two entries.

    Attributes:
        settings: pickled.
        entries: both.
        fixtures: the games.
        keeps_launchers: for later tasks, in a process that ends with the tournament.
    """

    settings: bytes
    entries: tuple[Entry, Entry]
    fixtures: tuple[Fixture, ...]
    keeps_launchers: bool


class Trial(NamedTuple):
    """What a trial of an entry has shown.

    Attributes:
        reason: why the entry cannot play; None: it can.
        not_enforced: what of the limits this system cannot enforce, in words.
    """

    reason: str | None
    not_enforced: list[str]


_launchers: OrderedDict[tuple[bytes, Entry], Launcher] = OrderedDict()


def play(task: Task) -> list[Row]:
    """Play the games of a task, write their recordings and logs, and return their rows."""
    settings, rows = loaded(task.settings), []
    with allowing(settings.memory):
        launchers = {entry.name: _launcher(task.settings, entry) for entry in task.entries}
        for fixture in task.fixtures:
            parent = parent_process()
            if parent is not None and not parent.is_alive():
                raise SystemExit
            rows.append(_played(settings, fixture, launchers))
    if not task.keeps_launchers:
        close_launchers()
    return rows


def _played(settings: Settings, fixture: Fixture, launchers: dict[str, Launcher]) -> Row:
    record = None
    if settings.games is not None:
        settings.games.mkdir(exist_ok=True)
        record = without_link(settings.games / f"{fixture.id}.ggr")
    row, logs = games.play(settings.scenario, fixture, launchers, record)
    for team in row["faults"]:
        if logs[team]:
            settings.logs.mkdir(exist_ok=True)
            write_whole(settings.logs / f"{fixture.id}.{list(fixture.entries).index(team)}.txt", logs[team])
    return row


def _launcher(settings: bytes, entry: Entry) -> Launcher:
    key = settings, entry
    if key not in _launchers:
        if len(_launchers) == _MOST_LAUNCHERS:
            _launchers.popitem(last=False)[1].close()
        known: Settings = loaded(settings)
        game = to_plain(known.scenario.spec.settings)
        _launchers[key] = Launcher(entry, known.allowed, known.map, game, known.scratch)
    _launchers.move_to_end(key)
    return _launchers[key]


def close_launchers() -> None:
    """End the processes that this one has kept."""
    while _launchers:
        _launchers.popitem()[1].close()


def trial(settings: bytes, entry: Entry, sides: tuple[str, str], seed: int, *, keeps_launchers: bool) -> Trial:
    """Try an entry; see `Trial`.

    Args:
        settings: pickled.
        entry: the entry.
        sides: the team that it plays, and the other one.
        seed: of the game that it is tried in.
        keeps_launchers: see `Task`.
    """
    known: Settings = loaded(settings)
    with allowing(known.memory):
        launcher = _launcher(settings, entry)
        found = Trial(games.trial(known.scenario, seed, sides, launcher), launcher.missing())
    if not keeps_launchers:
        close_launchers()
    return found
