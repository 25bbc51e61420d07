"""The page of results: one HTML file without scripts; all texts chosen by entries are escaped."""

from collections.abc import Iterable
from html import escape
from pathlib import Path

from gamms.errors import MissingExtra
from gamms.experiment.statistics import FEW_SEEDS
from gamms.folders import write_whole
from gamms.tournament.games import Row
from gamms.tournament.players import FAULTS
from gamms.tournament.table import Rating, Table, count_points, identify_seed, list_notes

PAGE = "index.html"
_MOST_FAULTS = 1_000  # games that are listed with their fault
_STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 75em; padding: 0 1em; }
table { border-collapse: collapse; margin: 1em 0; } th, td { padding: .25em .7em; border-bottom: 1px solid #8886; }
th { text-align: left; } th, td small { white-space: nowrap; } .s { overflow-x: auto; } small { opacity: .75; }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
a { text-decoration: none; }
.w { color: light-dark(#006d2c, #7fd79b); }
.d { color: light-dark(#666, #aaa); }
.l { color: light-dark(#a50f15, #ff9a94); }
"""
_OPENING = '<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content="width=device-width">'


def write_page(table: Table, folder: Path, title: str) -> None:
    """Write the page of a tournament into its folder."""
    sections = [
        _write_standings(table),
        _write_payoffs(table),
        _write_mixture(table),
        _write_cycles(table),
        _write_faults(table, folder),
        _write_games(table, folder),
    ]
    head = f"{_OPENING}<title>{escape(title)}</title><style>{_STYLE}</style>"
    policy = "<meta http-equiv=Content-Security-Policy content=\"default-src 'none'; style-src 'unsafe-inline'\">"
    notes = "".join(f"<p>{escape(note)}</p>" for note in list_notes(table))
    body = f"<h1>{escape(title)}</h1>{notes}{''.join(sections)}"
    write_whole(folder / PAGE, f"{head}{policy}<body>{body}</body></html>\n".encode())


def _write_rows(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return an HTML table; cells that are empty or begin with a digit or a sign are aligned to the right."""
    head = "".join(f"<th>{escape(one)}</th>" for one in header)
    body = "".join(
        "<tr>"
        + "".join(f"<td{' class=n' if not cell or cell[0] in '+-0123456789' else ''}>{cell}</td>" for cell in row)
        for row in rows
    )
    return f"<div class=s><table><tr>{head}</tr>{body}</table></div>"


def _write_standings(table: Table) -> str:
    ratings = {one.entry: _write_rating(one) for one in table.ratings()}
    rows = []
    for rank, one in enumerate(table.standings(), 1):
        faults = ", ".join(f"{count} {kind}" for kind, count in one.faults.items())
        numbers = (f"{one.points:g}", one.games, one.wins, one.draws, one.losses)
        rows.append([str(rank), _write_cell(one.entry), *map(str, numbers), ratings[one.entry], _write_cell(faults)])
    header = ("", "entry", "points", "games", "won", "drawn", "lost", "rating", "lost by faults")
    note = (
        "A win counts 1 point, a draw 1/2. Ratings are those of the Bradley-Terry model in Elo points, with 95 % "
        "bootstrap intervals over the seeds; the mean of all entries is 0."
    )
    return f"<h2>Standings</h2>{_write_rows(header, rows)}<p><small>{note}{_explain_sample_size(table)}</small></p>"


def _write_rating(one: Rating) -> str:
    return f"{one.elo:+.0f} <small>{_write_interval(f'{one.low:+.0f}', f'{one.high:+.0f}')}</small>"


def _write_interval(low: str, high: str) -> str:
    """Return an interval in words; a dash if there is no interval, because all values were equal."""
    return "-" if "nan" in low else f"{low} to {high}"


def _explain_sample_size(table: Table) -> str:
    seeds = len({identify_seed(row) for row in table.rows})
    return f" Bootstrap intervals of up to {FEW_SEEDS} seeds may be too narrow." if seeds <= FEW_SEEDS else ""


def _write_payoffs(table: Table) -> str:
    try:
        payoffs = table.payoffs()
    except MissingExtra as error:
        return f"<h2>Pay-offs</h2><p>{escape(str(error))}</p>"
    names = [one.entry for one in table.standings()]
    rows = []
    for first in names:
        cells = [f"<b>{escape(first)}</b>"]
        for second in names:
            one = payoffs.get((first, second))
            if one is None:
                cells.append("")
                continue
            points = one.points
            score = one.score
            interval = _write_interval(f"{score.low:+.2f}", f"{score.high:+.2f}")
            title = f"score {score.value:+.2f} ({interval}), {one.games} games, {one.seeds} seeds"
            between = f"<small>{points.low:.2f}-{points.high:.2f}</small>"
            cells.append(f"{points.value:.2f} <span title={_quote_text(title)}>{between}</span>")
        rows.append(cells)
    note = (
        "Points per game of the entry on the left against the one above, with 95 % score intervals over the seeds. The "
        "differences of scores beside them have 95 % bootstrap intervals over the seeds."
    )
    return (
        f"<h2>Pay-offs</h2>{_write_rows(['', *names], rows)}<p><small>{note}{_explain_sample_size(table)}</small></p>"
    )


def _write_mixture(table: Table) -> str:
    try:
        mixture = table.nash_mixture()
    except MissingExtra:
        return ""
    if mixture is None:
        return ""
    chosen = sorted(
        ((share, name) for name, share in mixture.items() if share > 1e-9), key=lambda one: (-one[0], one[1])
    )
    note = "A Nash equilibrium of the symmetrised pay-offs: no choice of an entry does better against this mixture."
    rows = [[_write_cell(name), f"{one:.3f}"] for one, name in chosen]
    return f"<h2>Nash mixture</h2>{_write_rows(('entry', 'probability'), rows)}<p><small>{note}</small></p>"


def _write_cycles(table: Table) -> str:
    try:
        cycles = table.cycles()
    except MissingExtra:
        return ""
    if not cycles:
        return "<h2>Cycles</h2><p>There are no three entries of which each beats the next.</p>"
    rows = [
        [_write_cell(" beats ".join([*one.entries, one.entries[0]])), "yes" if one.is_certain else "no"]
        for one in cycles
    ]
    return f"<h2>Cycles</h2>{_write_rows(('each beats the next', 'all intervals above 1/2'), rows)}"


def _write_faults(table: Table, folder: Path) -> str:
    rows: list[list[str]] = []
    for row in table.rows:
        for number, team in enumerate(row["entries"]):
            if team in row["faults"] and len(rows) < _MOST_FAULTS:
                log = Path("logs", f"{row['id']}.{number}.txt")
                link = f"<a href={_quote_text(log.as_posix())}>log</a>" if (folder / log).exists() else "-"
                kind = row["faults"][team]
                detail = row["details"][team]
                other = next(name for side, name in row["entries"].items() if side != team)
                rows.append([*map(_write_cell, (row["entries"][team], kind, detail, other)), str(row["seed"]), link])
    if not rows:
        return "<h2>Faults</h2><p>There were none.</p>"
    meanings = "".join(f"<li><b>{kind}</b>: {escape(meaning)}</li>" for kind, meaning in FAULTS.items())
    header = ("entry", "fault", "what", "against", "seed", "")
    explanation = f"<details><summary>What they mean</summary><ul>{meanings}</ul></details>"
    return f"<h2>Faults</h2>{explanation}{_write_rows(header, rows)}"


def _write_games(table: Table, folder: Path) -> str:
    pairs: dict[tuple[str, str], list[str]] = {}
    for row in table.rows:
        first, second = row["entries"].values()
        pairs.setdefault((first, second), []).append(_write_game(row, first, folder))
    teams = list(table.rows[0]["entries"]) if table.rows else ["", ""]
    rows = [[_write_cell(first), _write_cell(second), " ".join(some)] for (first, second), some in pairs.items()]
    note = (
        "Won, drawn and lost games of the entry that plays the first team, in the order of the seeds. Each is a "
        "recording, of which <code>gamms render games/ID.ggr game.html</code> makes a page that replays it."
    )
    return f"<h2>Games</h2><p><small>{note}</small></p>{_write_rows([*teams, 'games'], rows)}"


def _write_game(row: Row, first: str, folder: Path) -> str:
    points = count_points(row)[first]
    letter = "d" if points else "l"
    if points == 1.0:
        letter = "w"
    title = f"seed {row['seed']}: {row['reason']}, {row['turns']} turns"
    file = Path("games", f"{row['id']}.ggr")
    link = f" href={_quote_text(file.as_posix())}" if (folder / file).exists() else ""
    return f"<a class={letter} title={_quote_text(title)}{link}>{letter.upper()}</a>"


def _write_cell(text: str) -> str:
    """Return a left-aligned table cell."""
    return f"<span>{escape(text)}</span>"


def _quote_text(text: str) -> str:
    return f'"{escape(text)}"'
