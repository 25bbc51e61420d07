"""What a run gives back: one row a game, as a table, and any of the games again."""

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from gamms.arguments import as_int
from gamms.context import Context
from gamms.errors import BadValue, UnknownName
from gamms.experiment.folders import as_columns
from gamms.experiment.games import Row
from gamms.experiment.variants import Variant, digest_of
from gamms.game.result import Result
from gamms.ir.tables import frame_of
from gamms.scenario import Scenario
from gamms.visual import Engine

if TYPE_CHECKING:
    import pandas as pd


class Rows(Sequence[Row]):
    """The rows of an experiment, in the order of its variants and seeds; `rows[0]` is a dict.

    A row has id, scenario (the digest of its variant), gamms, python and numpy (versions), each varied key, seed,
    reason, winner, truncated, turns, `score.<team>`, counts by team, `collector.<name>`, and error, which is None
    where the game was played to its end.

    Attributes:
        keys: the varied keys.
    """

    def __init__(
        self, rows: Sequence[Row], keys: Sequence[str], scenario: Scenario | None, variants: Sequence[Variant]
    ) -> None:
        self._rows, self.keys = list(rows), tuple(keys)
        self._scenario, self._variants = scenario, variants

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, number: Any) -> Any:
        return self._rows[number]

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows)

    def __repr__(self) -> str:
        """Show how many games there are, and how many have raised."""
        errors = len(self.errors())
        varied = f", varied: {', '.join(self.keys)}" if self.keys else ""
        return f"Rows({len(self)} games{varied}{f', {errors} with errors' if errors else ''})"

    def errors(self) -> list[Row]:
        """Return the rows of games that have raised, or whose process has died."""
        return [row for row in self._rows if row["error"] is not None]

    def table(self) -> dict[str, Any]:
        """Return all rows as a dict of columns; numbers that are missing are NaN."""
        return as_columns(self._rows, self.keys)

    def to_pandas(self) -> "pd.DataFrame":
        """Return all rows as a data frame of pandas.

        Raises:
            MissingExtra (ImportError): pandas is not installed.
        """
        return frame_of(self.table())

    # -- games again ----------------------------------------------------------------------------------------------

    def play(self, row: str | int, *, record: str | os.PathLike[str] | None = None) -> Result:
        """Play the game of a row again; see `Scenario.play`.

        Args:
            row: its id, or its number.
            record: the file of a recording, to be replayed and rendered; None: it is not recorded.

        Raises:
            UnknownName (KeyError): there is no such row.
        """
        scenario, seed, strategies = self._game(row)
        return scenario.play(seed, strategies, record=record)

    def build(self, row: str | int, vis_engine: Engine | None = None) -> Context:
        """Return a context with the game of a row, ready to play; see `Scenario.build`.

        Raises:
            UnknownName (KeyError): there is no such row.
        """
        scenario, seed, strategies = self._game(row)
        return scenario.build(seed, strategies, vis_engine)

    def _game(self, wanted: str | int) -> tuple[Scenario, int, Mapping[str, Any]]:
        if isinstance(wanted, str):
            row = next((row for row in self._rows if row["id"] == wanted), None)
            if row is None:
                raise UnknownName("row", wanted, [row["id"] for row in self._rows[:3]])
        else:
            number = as_int(wanted, "The number of a row")
            if not -len(self) <= number < len(self):
                raise BadValue(f"There is no row {number}: there are {len(self)}, numbered from 0.")
            row = self._rows[number]
        settings = {key: row[key] for key in self.keys}
        variant = next((one for one in self._variants if one.settings == settings), None)
        if self._scenario is None or variant is None:
            raise BadValue("These rows were read without their scenario: give load(…, scenario=…, vary=…).")
        scenario = variant.of(self._scenario)
        if digest_of(scenario) != row["scenario"]:
            raise BadValue(f"The scenario or its code has changed since the game of row {row['id']} was played.")
        return scenario, row["seed"], variant.strategies
