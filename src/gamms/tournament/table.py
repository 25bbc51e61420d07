"""The table of a tournament: points, faults, and what follows from all games together."""

from collections.abc import Sequence
from typing import NamedTuple

from gamms.text import printable_line
from gamms.tournament.games import Row

WIN, DRAW = 1.0, 0.5


class Standing(NamedTuple):
    """What an entry has come to.

    Attributes:
        entry: its name.
        points: 1 for a win, 1/2 for a draw.
        games: that it has played.
        wins, draws, losses: of these.
        faults: kind of fault -> how many games it has lost by it.
    """

    entry: str
    points: float
    games: int
    wins: int
    draws: int
    losses: int
    faults: dict[str, int]


def points_of(row: Row) -> dict[str, float]:
    """Return the points of both entries of a game: a fault loses, and so do both if both have one."""
    if row["winner"] is None:
        return {entry: 0.0 if team in row["faults"] else DRAW for team, entry in row["entries"].items()}
    return {entry: WIN if team == row["winner"] else 0.0 for team, entry in row["entries"].items()}


class Table:
    """What came of a tournament. `print(table)` shows the ranking.

    Args:
        rows: of all games, in the order of the plan.
        entries: the names of the entries.

    Attributes:
        rows: see above.
        entries: see above.
    """

    def __init__(self, rows: Sequence[Row], entries: Sequence[str]) -> None:
        self.rows, self.entries = list(rows), list(entries)

    def standings(self) -> list[Standing]:
        """Return the entries, the best first: by points per game, then by name."""
        points: dict[str, list[float]] = {name: [] for name in self.entries}
        faults: dict[str, dict[str, int]] = {name: {} for name in self.entries}
        for row in self.rows:
            for entry, one in points_of(row).items():
                points[entry].append(one)
            for team, kind in row["faults"].items():
                of = faults[row["entries"][team]]
                of[kind] = of.get(kind, 0) + 1
        found = [
            Standing(
                name,
                sum(some),
                len(some),
                some.count(WIN),
                some.count(DRAW),
                some.count(0.0),
                dict(sorted(faults[name].items())),
            )
            for name, some in points.items()
        ]
        return sorted(found, key=lambda one: (-one.points / max(one.games, 1), one.entry))

    def __str__(self) -> str:
        header = ("", "entry", "points", "games", "won", "drawn", "lost", "faults")
        lines: list[tuple[str, ...]] = [header]
        for rank, one in enumerate(self.standings(), 1):
            faults = ", ".join(f"{count} {kind}" for kind, count in one.faults.items())
            numbers = (one.games, one.wins, one.draws, one.losses)
            lines.append((str(rank), printable_line(one.entry), f"{one.points:g}", *map(str, numbers), faults))
        widths = [max(len(line[column]) for line in lines) for column in range(len(header))]
        return "\n".join(
            "  ".join(
                text.ljust(width) if column in (1, 7) else text.rjust(width)
                for column, (text, width) in enumerate(zip(line, widths, strict=True))
            ).rstrip()
            for line in lines
        )
