"""The answers of map servers that are kept on disk: only good ones go in, and only good ones come out."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NoReturn

from gamms.errors import PlaceError
from gamms.osm.answers import fault_of_places, has_shapes


@dataclass(slots=True)
class AnswerCache:
    """Stands between OSMnx and its own functions that load and save the answers for one place."""

    name: str  # of the place, for messages
    folder: str
    fault_of_map: Callable[[Any], str]
    offline: bool
    load: Callable[..., Any]
    save: Callable[..., None]
    waiting: list[tuple[str, Any, bool]] = field(default_factory=list)

    def retrieve(self, url: str, *rest: Any) -> Any:
        """The kept answer; where none is there or it is damaged None, so that OSMnx asks the server.

        Raises:
            PlaceError: offline, there is none or it is damaged.
        """
        try:
            answer = self.load(url, *rest)
            fault = "" if answer is None else self._fault_of(answer)
        except (ValueError, RecursionError) as error:
            answer, fault = None, str(error)
        if answer is not None and not fault:
            return answer
        if self.offline:
            self.refuse(damage=fault)
        return None

    def keep(self, url: str, answer: Any, ok: bool) -> None:
        """Keep an answer at once if it has shapes; one without may be a mistake, and waits until the map is made."""
        if has_shapes(answer):
            self._write(url, answer, ok)
        else:
            self.waiting.append((url, answer, ok))

    def keep_rest(self) -> None:
        """Keep the others: the map is made, so they were meant."""
        for answer in self.waiting:
            self._write(*answer)

    def refuse(self, *_: Any, damage: str = "", **__: Any) -> NoReturn:
        """Say that offline there is nothing to answer with.

        Raises:
            PlaceError: always.
        """
        what = f"what was kept of it is damaged ({damage})" if damage else "it was never downloaded"
        raise PlaceError(
            f"There is no map of {self.name} on this computer: {what}. Run this once without offline=True, with a "
            f"connection and otherwise the same arguments and osmnx.settings; answers are kept in {self.folder!r}."
        )

    def _fault_of(self, answer: Any) -> str:
        return fault_of_places(answer) if isinstance(answer, list) else self.fault_of_map(answer)

    def _write(self, url: str, answer: Any, ok: bool) -> None:
        try:
            self.save(url, answer, ok)
        except OSError as error:
            warnings.warn(
                f"The map of {self.name} cannot be kept in {self.folder!r} for later: {error}. "
                "Set osmnx.settings.cache_folder to a folder that you may write into.",
                RuntimeWarning,
                stacklevel=2,
            )
