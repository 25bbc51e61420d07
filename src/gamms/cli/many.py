"""`gamms run --seeds`: play a scenario with many seeds, in several processes, and compare the results."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

import typer

from gamms.cli.output import echo, explain_error, join_names, make_console, make_rich_table
from gamms.errors import BadValue, nearest
from gamms.folders import make_folder, open_whole_file, remove_link, write_csv
from gamms.limits import allowing, max_memory
from gamms.progress import show_progress
from gamms.text import describe_empty_range, describe_lone_seed, make_printable_line, shown

if TYPE_CHECKING:
    from gamms.game import Result
    from gamms.scenario import Scenario
    from gamms.scenario.code import CodeReference

Strategies = Mapping[
    str, tuple["CodeReference", Path]
]  # by team or agent: reference to its code, and the folder to import it from
_MOST = 1_000_000  # seeds
_MOST_IN_A_BATCH = 20  # games that a process plays before it reports


def parse_seeds(text: str) -> Sequence[int]:
    """Parse `0:50`, which is 0 to 49, or `1,2,5`."""
    first, colon, last = text.partition(":")
    try:
        numbers = [int(one) for one in ((first or "0", last) if colon else text.split(","))]
    except ValueError:
        raise typer.BadParameter(f"{text!r}: give 0:50 or 1,2,5.", param_hint="--seeds") from None
    if not colon and len(numbers) == 1:
        raise typer.BadParameter(describe_lone_seed(numbers[0]), param_hint="--seeds")
    if colon and numbers[1] < numbers[0]:
        raise typer.BadParameter(describe_empty_range(text, *numbers), param_hint="--seeds")
    count = numbers[1] - numbers[0] if colon else len(numbers)
    if not 0 < count <= _MOST:
        raise typer.BadParameter(f"{text!r}: give 1 to {_MOST:,} seeds, such as 0:50.", param_hint="--seeds")
    if not colon and len(set(numbers)) < count:
        raise typer.BadParameter(f"{text!r}: a seed occurs twice, and would play the same game.", param_hint="--seeds")
    return range(*numbers) if colon else numbers


def check_keys(file: Path, values: object, kind: str, required: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    """Return the values of a file, which must be a mapping with the required keys and no unknown ones.

    Args:
        file: the file, for errors.
        values: the values of the file.
        kind: the kind of the file, in a word.
        required: the required keys.
        keys: all allowed keys.

    Raises:
        BadValue: the values are not such a mapping.
    """
    if not isinstance(values, dict):
        found = "nothing" if values is None else shown(values)
        raise BadValue(f"{file}: a {kind} is a mapping with the keys {', '.join(required)}, not {found}.")
    for key in values:
        if key not in keys:
            raise BadValue(f"{file}: unknown key {shown(key)}.{nearest(key, keys)} Keys are {', '.join(keys)}.")
    for key in required:
        if key not in values:
            raise BadValue(f"{file}: {key} is missing.")
    return values


def import_strategies(strategies: Strategies) -> dict[str, Callable[..., Any]]:
    """Import the code of strategies; one person plays all agents of a team."""
    from gamms.scenario.code import import_function
    from gamms.web import human

    found = {team: import_function(*one) for team, one in strategies.items()}
    return {team: human() if function is human else function for team, function in found.items()}


def play(game: "Scenario", seeds: Sequence[int], strategies: Strategies, out: Path, jobs: int | None) -> None:
    """Play a game for each seed, write `result_<seed>.json` and `results.csv`, and print a table and a summary."""
    from gamms.workers import count_cores

    teams = list(game.spec.teams)
    played: list[dict[str, Any]] = []
    with make_folder(out):
        try:
            for seed, result in _play_seeds(game, seeds, strategies, jobs or count_cores()):
                result.save(remove_link(out / f"result_{seed}.json"))
                played.append(_make_row(result, teams))
        except KeyboardInterrupt:
            if played:
                _write_rows(played, teams, out)
            echo(f"{len(played):,} of {len(seeds):,} games were played.")
            raise
        _write_rows(played, teams, out)


def _write_rows(played: list[dict[str, Any]], teams: list[str], out: Path) -> None:
    """Write `results.csv`, and print a table and a summary."""
    with open_whole_file(out / "results.csv") as whole:
        write_csv(whole, played[0], (row.values() for row in played))
    header = ("seed", "turns", "winner", *teams, "reason")
    rows = [_format_cells(row, teams) for row in played]
    make_console().print(make_rich_table(tuple(map(make_printable_line, header)), rows))
    echo(f"\n{_summarize(played, teams)}")
    echo(f"\nWrote {join_names([out / 'results.csv', out / 'result_<seed>.json'])}.")


def _play_seeds(
    game: "Scenario", seeds: Sequence[int], strategies: Strategies, jobs: int
) -> Iterator[tuple[int, "Result"]]:
    """Yield the result of each seed, in order, from any process."""
    from gamms.workers import WorkerPool, wait_for_result

    game.warn_of_idle_teams(strategies)
    jobs = min(jobs, len(seeds))
    size = max(1, min(_MOST_IN_A_BATCH, len(seeds) // (4 * jobs)))
    batches = [seeds[first : first + size] for first in range(0, len(seeds), size)]
    batch = partial(_play_batch, game, strategies, max_memory())
    with show_progress() as show:
        done = 0
        pool = None if jobs == 1 else WorkerPool(jobs)  # its games end with it, also after Ctrl-C
        try:
            results: Iterator[list[Result] | str] = (
                map(batch, batches)
                if pool is None
                else map(wait_for_result, [pool.submit(batch, some) for some in batches])
            )
            for some, found in zip(batches, results, strict=True):
                if isinstance(found, str):
                    echo(found, err=True)
                    raise typer.Exit(1)
                yield from zip(some, found, strict=True)
                done += len(some)
                show(f"{done} of {len(seeds)} games")
        finally:
            if pool is not None:
                pool.shutdown()


def _play_batch(game: "Scenario", strategies: Strategies, memory: int, seeds: Sequence[int]) -> "list[Result] | str":
    """Return the results of some seeds, or the message for an error, whose traceback stays in this process."""
    seed = seeds[0]
    try:
        with allowing(memory):
            functions = import_strategies(strategies)
            results = []
            for seed in seeds:
                results.append(game.play(seed, functions))
            return results
    except Exception as error:  # noqa: BLE001 - it is printed by the process that has asked
        return f"{explain_error(error)}\nWith seed {seed}; to play it alone: --seed {seed}"


def _make_row(result: "Result", teams: list[str]) -> dict[str, Any]:
    """Return the contents of a CSV row."""
    table = result.table("teams")
    alive = dict(zip(table["team"].tolist(), table["alive"].tolist(), strict=True))
    return {
        "seed": result.seed,
        "turns": result.turns,
        "winner": result.winner,
        "reason": result.reason,
        "truncated": result.truncated,
        **{f"score_{team}": result.scores.get(team, 0) for team in teams},
        **{f"alive_{team}": alive.get(team, 0) for team in teams},
    }


def _format_cells(row: dict[str, Any], teams: list[str]) -> tuple[str, ...]:
    scores = (f"{row[f'score_{team}']:g}" for team in teams)
    winner = "-" if row["winner"] is None else str(row["winner"])
    return (str(row["seed"]), str(row["turns"]), winner, *scores, row["reason"])


def _summarize(rows: list[dict[str, Any]], teams: list[str]) -> str:
    """Return in words how often each team won, and the length of the games."""
    wins = Counter(row["winner"] for row in rows)
    turns = [row["turns"] for row in rows]
    winners = [*teams, *(one for one in wins if one is not None and one not in teams)]
    parts = [f"{one} won {wins[one]} ({wins[one] / len(rows):.0%})" for one in winners]
    if wins[None]:
        parts.append(f"no winner in {wins[None]} ({wins[None] / len(rows):.0%})")
    length = f"{fmean(turns):.1f} turns ({min(turns)} to {max(turns)})"
    return make_printable_line(f"{len(rows)} games: {', '.join(parts)}. Mean length {length}.")
