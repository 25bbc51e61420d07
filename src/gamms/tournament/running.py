"""Runs a tournament: who plays whom, and where, until all games are played."""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

from gamms.arguments import as_float, as_int, as_items, as_path
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.progress import progress
from gamms.scenario import Scenario
from gamms.scenario.spec import to_plain
from gamms.text import shown
from gamms.tournament.entries import Entry, Given, found_entries
from gamms.tournament.games import MOST_TURNS, Fixture, play
from gamms.tournament.players import Allowed, Launcher
from gamms.tournament.table import Table

_LEAST_MB = 64
_MAP = "map.gamms"


def run(
    scenario: Scenario,
    *,
    entries: Mapping[str, Given],
    seeds: Iterable[int],
    out: str | os.PathLike[str],
    move_seconds: float = 1.0,
    memory_mb: int = 512,
    sides: Sequence[str] | None = None,
) -> Table:
    """Let all entries play each other on both sides with the same seeds, and return the table.

    Args:
        scenario: the game.
        entries: name -> `file.py:function`, `module:function`, or a program and its arguments; see docs/tournaments.md.
        seeds: of the games of each two entries.
        out: the folder for all that is written.
        move_seconds: how long an entry may take for a move, by the clock on the wall.
        memory_mb: how much memory the process of an entry may use, MiB.
        sides: the two teams that entries play; None: the scenario has no others.

    Raises:
        BadType, BadValue: there are too few entries, sides or seeds, or a limit is too low.
        UnknownName (KeyError): the scenario has no such team.
        ScenarioError (ValueError): an entry has no such function, or the scenario cannot be built.
        GammsError: the system is Windows, where processes cannot be confined so.
    """
    if not hasattr(os, "fork"):
        raise GammsError("Tournaments run on Linux and macOS: Windows has no way to bound the processes of entries.")
    if not isinstance(scenario, Scenario):
        raise BadType(f"scenario must be a Scenario, as gamms.scenario.load gives it, not {shown(scenario)}.")
    folder = as_path(out, "out")
    folder.mkdir(parents=True, exist_ok=True)
    teams = _sides(scenario, sides)
    private = [one for one in (scenario.file, scenario.folder) if one is not None]
    found = found_entries(entries, Path.cwd(), folder, private)
    allowed = _allowed(scenario, move_seconds, memory_mb)
    numbers = [as_int(seed, "a seed") for seed in as_items(seeds, "seeds", "integers")]
    fixtures = _round_robin(found, teams, numbers)
    with scenario.build(seed=numbers[0]) as ctx:
        ctx.graph.save(folder / _MAP)
    rows = []
    settings = to_plain(scenario.spec.settings)
    launchers = {entry.name: Launcher(entry, allowed, folder / _MAP, settings) for entry in found}
    try:
        with progress() as show:
            for fixture in fixtures:
                row, _ = play(scenario, fixture, launchers)
                rows.append(row)
                show(f"{len(rows)} of {len(fixtures)} games")
    finally:
        for launcher in launchers.values():
            launcher.close()
    return Table(rows, [entry.name for entry in found])


def _sides(scenario: Scenario, given: Sequence[str] | None) -> tuple[str, str]:
    teams = list(scenario.spec.teams)
    if given is None and len(teams) != 2:
        raise BadValue(f"The scenario has the teams {', '.join(teams)}. Say by sides= which two of them entries play.")
    sides = teams if given is None else list(as_items(given, "sides", "two teams"))
    for one in sides:
        if one not in teams:
            raise UnknownName("team", one, teams)
    if len(sides) != 2 or sides[0] == sides[1]:
        raise BadValue(f"sides must be two teams, not {shown(given)}.")
    return sides[0], sides[1]


def _allowed(scenario: Scenario, move_seconds: float, memory_mb: int) -> Allowed:
    seconds, megabytes = as_float(move_seconds, "move_seconds"), as_int(memory_mb, "memory_mb")
    if seconds <= 0.0:
        raise BadValue(f"move_seconds must be more than 0, not {seconds:g}.")
    if megabytes < _LEAST_MB:
        raise BadValue(f"memory_mb must be at least {_LEAST_MB}, which programs take to start, not {megabytes}.")
    turns = scenario.spec.max_turns or MOST_TURNS
    return Allowed(seconds, megabytes << 20, int(seconds * (turns + 10)) + 1)


def _round_robin(entries: Sequence[Entry], sides: tuple[str, str], seeds: Sequence[int]) -> list[Fixture]:
    return [
        _fixture(pair, sides, seed, 1)
        for first, second in combinations(entries, 2)
        for seed in seeds
        for pair in ((first, second), (second, first))
    ]


def _fixture(pair: tuple[Entry, Entry], sides: tuple[str, str], seed: int, number: int) -> Fixture:
    entries = {side: entry.name for side, entry in zip(sides, pair, strict=True)}
    whole: list[Any] = [entries, [entry.digest for entry in pair], seed, number]
    return Fixture(hashlib.sha256(json.dumps(whole).encode()).hexdigest()[:16], entries, seed, number)
