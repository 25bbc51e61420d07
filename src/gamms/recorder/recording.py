"""A recording that is open: any state of it, its events and its tables, without a context."""

import io
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, Self, overload

import numpy as np

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue
from gamms.ir import journal
from gamms.ir.journal import Log
from gamms.recorder import tables
from gamms.recorder.errors import RecordingError
from gamms.recorder.fold import Damaged, Fold
from gamms.recorder.formats.reader import Reader
from gamms.recorder.moment import State, roster_of, state_of
from gamms.typing.displays import displays
from gamms.typing.opcodes import MAGIC_NUMBER
from gamms.typing.packed_graph import IPackedGraph, packed_graphs

_SUFFIX = ".ggr"
_BLOBS = ("world",)  # parts of the header that are no words


def open(source: str | os.PathLike[str] | BinaryIO) -> "Recording":
    """Open a recording of version 3, by its path or as a binary stream.

    Raises:
        FileNotFoundError, OSError: it cannot be read.
        RecordingError (ValueError): it is none, it is of version 2, or its header is damaged.
        BadType (TypeError): this is neither a path nor a binary stream.
    """
    stream, is_owned = _readable(source)
    try:
        magic = stream.read(8)
        stream.seek(-len(magic), os.SEEK_CUR)
        _refuse_version_2(magic)
        return Recording(Reader(stream), stream if is_owned else None)
    except BaseException:
        if is_owned:
            stream.close()
        raise


class Recording:
    """A recording that is open for reading; of its turns only a few are in memory.

    State 0 is the start, state n is after the n-th turn; `recording[n]` is state n, `recording[-1]` the last one, and
    `len(recording)` is how many turns were completed. Iterating gives all states in their order. What happened
    between states n - 1 and n happened in turn n; what happened after the last completed turn is in turn `turns + 1`.

    Every call raises RecordingError (a ValueError), which names the byte, where the file is damaged, and BadValue for
    turns that are not there.

    Attributes:
        header: what it says of itself: `format`, `package` (version of GAMMS), `seed`, `created`, `provenance`.
        warning: what is missing of a recording that was not finished; else None.
    """

    def __init__(self, reader: Reader, owned: BinaryIO | None = None) -> None:
        self._reader, self._owned = reader, owned
        self.header = {key: value for key, value in reader.header.items() if key not in _BLOBS}
        self.warning = reader.warning
        self._turns: int | None = None
        self._fold: Fold | None = None
        self._at = 0  # turns that the fold knows
        self._roster: tuple[int, dict[str, Any]] = (-1, {})
        self._maps: dict[int, IPackedGraph] = {}  # turn in which the map became so -> the map; the first and one other
        self._map_turns: list[int] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, if it was opened here."""
        if self._owned is not None:
            self._owned.close()

    def __repr__(self) -> str:
        """Say how long it is."""
        return f"{type(self).__name__}({self.turns} turns)"

    def _repr_html_(self) -> str | None:
        """Turns, scores and a picture of the last state, for notebooks; None where it cannot be read any more."""
        try:
            return displays["recording"](self)
        except Exception:  # noqa: BLE001 - a notebook then shows its repr
            return None

    @property
    def seed(self) -> Any:
        """The seed of the context that was recorded."""
        return self.header.get("seed")

    @property
    def is_complete(self) -> bool:
        """Whether the recording was finished."""
        return self.warning is None

    @property
    def turns(self) -> int:
        """How many turns were completed."""
        if self._turns is None:
            logs = self._reader.turns
            last = self._reader.events(logs - 1, logs, {journal.UNFINISHED}) if logs else ()
            self._turns = logs - any(True for _ in last)
        return self._turns

    def __len__(self) -> int:
        return self.turns

    # -- states -------------------------------------------------------------------------------------------------

    def state(self, turn: int) -> State:
        """How things were after so many turns; 0 is the start."""
        turn = as_int(turn, "turn")
        if not 0 <= turn <= self.turns:
            raise BadValue(f"There is no state after {turn} turns: this recording has {self.turns} turns.")
        try:
            fold = self._folded(turn)
            if self._roster[0] != fold.roster:
                self._roster = fold.roster, roster_of(fold.state)
            return state_of(fold.state, turn, self._roster[1], lambda: self._map_at(turn))
        except Damaged as error:
            self._fold = None
            raise RecordingError(f"The state after turn {turn} cannot be worked out: {error}.") from error

    @overload
    def __getitem__(self, turn: int) -> State: ...
    @overload
    def __getitem__(self, turn: slice) -> list[State]: ...
    def __getitem__(self, turn: int | slice) -> State | list[State]:
        """The state after so many turns, counted from the end where negative; or those of a slice, as a list."""
        if isinstance(turn, slice):
            return [self.state(one) for one in range(*turn.indices(self.turns + 1))]
        turn = as_int(turn, "turn")
        return self.state(turn + self.turns + 1 if -self.turns - 1 <= turn < 0 else turn)

    def __iter__(self) -> Iterator[State]:
        for turn in range(self.turns + 1):
            yield self.state(turn)

    def _folded(self, turn: int) -> Fold:
        """The state after so many turns: from the last keyframe, or from the state that was asked for last."""
        fold = self._fold
        if fold is None or not max(self._reader.keyframe_before(turn), 0) <= self._at <= turn:
            found = self._reader.keyframe(turn)
            if found is None:
                raise RecordingError("This recording does not say how it begins.")
            self._fold = None
            self._roster = (-1, {})
            self._at, fold = found[0], Fold(found[1])
        fold.advance(self._reader, self._at, turn)
        self._fold, self._at = fold, turn
        return fold

    # -- the map ------------------------------------------------------------------------------------------------

    @property
    def graph(self) -> IPackedGraph:
        """The map at the start, read-only."""
        return self._map(0, lambda: self._reader.header.get("world"))

    def _map_at(self, turn: int) -> IPackedGraph:
        if self._map_turns is None:
            self._map_turns = sorted({log + 1 for log, *_ in self._reader.events(kinds={journal.WORLD})})
        last = max((one for one in self._map_turns if one <= turn), default=0)
        return self._map(last, lambda: self._changed_map(last)) if last else self.graph

    def _changed_map(self, turn: int) -> Any:
        *_, data = list(self._reader.events(turn - 1, turn, {journal.WORLD}))[-1]
        return data.get("world") if isinstance(data, dict) else None

    def _map(self, turn: int, packed: Callable[[], Any]) -> IPackedGraph:
        if turn not in self._maps:
            world = packed()
            if not isinstance(world, bytes):
                raise RecordingError(
                    f"The map of turn {turn} is not there: this recording holds {type(world)} instead."
                )
            self._maps = {one: kept for one, kept in self._maps.items() if one == 0}
            self._maps[turn] = packed_graphs["gamms"](world)
        return self._maps[turn]

    # -- what happened ------------------------------------------------------------------------------------------

    def events(self, start: int | None = None, stop: int | None = None) -> Iterator[dict[str, Any]]:
        """What rules emitted and programs recorded in the turns from `start` on and before `stop`, in its order.

        Yields:
            `turn`, `kind`, and what was given with it. The turn of what a rule emitted is the number that the game
            gave it, as in a `Result`.
        """
        return tables.events(self._reader, *self._logs_of(start, stop))

    def steps(self, start: int | None = None, stop: int | None = None) -> Iterator[dict[str, Any]]:
        """Everything that happened in these turns, in its order.

        Yields:
            `turn`; `event`, which is "MOVE", or the name of a kind that is in the format; `agent` and `node` of a move,
            `data` of any other.
        """
        return tables.steps(self._reader, *self._logs_of(start, stop), self._names_at)

    def table(self, name: str, start: int | None = None, stop: int | None = None) -> dict[str, np.ndarray[Any, Any]]:
        """One table of the turns from `start` on and before `stop`, as columns of equal length.

        `events`, `moves`, `positions` and `scores` are always there; each kind of event is a table, too.
        docs/recording.md says which columns they have.

        Raises:
            UnknownName (KeyError): there is no such table.
        """
        return tables.table(self._reader, name, *self._logs_of(start, stop), self._names_at)

    def logs(self, start: int | None = None, stop: int | None = None) -> Iterator[Log]:
        """What was written of each turn from `start` on and before `stop`, as docs/recording-format.md has it."""
        return (self._reader.log(log) for log in range(*self._logs_of(start, stop)))

    def counts(self) -> dict[str, int]:
        """How many events there are of each kind that is in the format; moves are not among them."""
        return {tables.KINDS.get(kind, f"{kind:#010x}"): count for kind, count in self._reader.count_events().items()}

    def count_moves(self) -> int:
        """How many moves of agents on the ground there are."""
        return self._reader.count_moves()

    def _names_at(self, log: int) -> tuple[dict[int, str], int]:
        """See `tables.NamesAt`."""
        try:
            fold = self._folded(log)
        except Damaged as error:
            raise RecordingError(f"The state after turn {log} cannot be worked out: {error}.") from error
        return dict(zip(fold.state["numbers"].tolist(), fold.state["names"], strict=True)), fold.following

    def _logs_of(self, start: int | None, stop: int | None) -> tuple[int, int]:
        """The logs of turns from `start` on and before `stop`; turn n is in log n - 1."""
        first = 0 if start is None else as_int(start, "start")
        last = self._reader.turns + 1 if stop is None else as_int(stop, "stop")
        if first < 0 or last < 0:
            raise BadValue(f"Turns are counted from 1 on; start={start} and stop={stop} are no such range.")
        end = min(max(last - 1, 0), self._reader.turns)
        return min(max(first - 1, 0), end), end


def _refuse_version_2(magic: bytes) -> None:
    if magic[:4] == MAGIC_NUMBER and 0 < int.from_bytes(magic[4:], "big") < 3:
        raise RecordingError(
            "This recording has format version 2, which holds neither a map nor an index. `gamms convert IN OUT` "
            "makes version 3 of it; ctx.record.replay plays it as it is."
        )


def _readable(source: Any) -> tuple[BinaryIO, bool]:
    """A stream that can seek, and whether it was opened here; the suffix of a path may be left out."""
    if isinstance(source, str | os.PathLike):
        file = Path(source)
        if not file.exists() and file.suffix != _SUFFIX:
            file = Path(f"{file}{_SUFFIX}")
        return file.open("rb"), True
    if hasattr(source, "read") and not isinstance(source, io.TextIOBase):
        stream: BinaryIO = source if source.seekable() else io.BytesIO(source.read())
        return stream, False
    raise BadType(f"A recording is opened by its path or as a binary stream, not as {source!r}.")
