"""A recording while it is replayed in a window: any of its turns can be shown, earlier ones too."""

from collections.abc import Iterator
from typing import Any, BinaryIO

from gamms.arguments import as_int
from gamms.errors import BadValue
from gamms.ir import events as kinds
from gamms.ir.events import COMPONENTS
from gamms.ir.progress import Progress
from gamms.ir.schema import ON_EDGES
from gamms.recorder import keyframes
from gamms.recorder.errors import RecorderBusy, refusing
from gamms.recorder.formats.reader import Reader
from gamms.recorder.recording import Recording
from gamms.recorder.replaying import Replayer
from gamms.recorder.resuming import Past, delete_others, history
from gamms.typing.context import HostContext
from gamms.typing.recorder import IPlayback, OpCodes, Step

_HIGHLIGHTS = (kinds.GAME_EVENT, kinds.GAME_SCORES, kinds.GAME_OVER)
_LOOKS, _DRAWINGS = (kinds.VISUALS,), {kinds.VISUAL_COMMANDS}


def _places_of(columns: keyframes.Columns) -> dict[str, int | Progress]:
    """Return agent -> its node, or where on an edge it is, of those on the ground."""
    progress = zip(*(columns[name].tolist() for name in ON_EDGES), strict=True)
    rows = zip(columns["names"], columns["kind"].tolist(), columns["node"].tolist(), progress, strict=True)
    return {name: Progress(*place) if place[4] else node for name, flies, node, place in rows if not flies}


class Playback(IPlayback):
    """A replay of a recording of version 3.

    Args:
        ctx: the context into which it is replayed.
        reader: of the recording.
        replayer: applies its events.
        owned: what is to be closed in the end, if that was opened for it.
    """

    def __init__(self, ctx: HostContext, reader: Reader, replayer: Replayer, owned: BinaryIO | None) -> None:
        self._ctx, self._reader, self._replayer, self._owned = ctx, reader, replayer, owned
        self._recording, self._past = Recording(reader), Past(reader)
        self._drawn: list[tuple[int, str]] = []  # the logs in which artists have drawn something else
        self._drawn_until = 0
        self.is_open = True

    @property
    def turn(self) -> int:
        """How many turns have been replayed."""
        return self._replayer.turn

    @property
    def turns(self) -> int:
        """How many turns there are."""
        return self._recording.turns

    @property
    def can_seek(self) -> bool:
        """Whether other turns may be shown: not while the context is being recorded."""
        return self.is_open and not self._ctx.record.record()

    def close(self) -> None:
        """Close the file; nothing more is replayed."""
        self.is_open = False
        if self._owned is not None:
            self._owned.close()

    def highlights(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield what rules emitted, changes of the scores (`scores`) and the end (`over`), each with its turn."""
        for log, _, kind, data in self._reader.events(kinds=_HIGHLIGHTS):
            if isinstance(data, dict):
                yield log + 1, {"over": data} if kind == kinds.GAME_OVER else data

    def steps(self, turn: int) -> dict[str, Step]:
        """Return the nodes, or positions in the air, of agents before and after their last move, up to a turn."""
        columns = self._recording.detached(turn).agents.columns
        flies = columns["kind"].tolist()
        walks = zip(columns["previous"].tolist(), columns["node"].tolist(), strict=True)
        flights = zip(columns["previous_position"].tolist(), columns["position"].tolist(), strict=True)
        steps = zip(columns["names"], flies, walks, flights, strict=True)
        found = {name: (tuple(air[0]), tuple(air[1])) if is_up else ground for name, is_up, ground, air in steps}
        if turn and columns["edge_motion"].any():
            was, now = (_places_of(self._recording.detached(one).agents.columns) for one in (turn - 1, turn))
            on_edges = [name for name in now if name in was and isinstance(now[name], Progress)]
            found.update((name, (was[name], now[name])) for name in on_edges)
        return found

    def play_turn(self) -> None:
        """Replay the next turn."""
        self._ctx.record.is_replaying = True
        try:
            for _ in self._replayer.play_turn(self._reader):
                pass
        finally:
            self._ctx.record.is_replaying = False

    def seek(self, turn: int) -> None:
        """Let everything be as it was after so many turns; the replay goes on from there.

        Raises:
            BadValue: there is no such turn.
            RecorderBusy (RuntimeError): the context is being recorded.
            RecordingError (ValueError): the recording is damaged.
        """
        if not 0 <= as_int(turn, "turn") <= self.turns:
            raise BadValue(f"There is no turn {turn}: this recording has {self.turns} turns.")
        if not self.can_seek:
            raise RecorderBusy("Another turn cannot be shown while the replay is being recorded.")
        ctx, state, recording = self._ctx, self._replayer.state, self._recording
        with refusing(f"Turn {turn} cannot be shown"):
            if recording.map_hash(turn) != recording.map_hash(min(self.turn, self.turns)):
                ctx.graph.storage.unpack(recording.map_at(turn).packed)
            snapshot = recording.detached(turn).keyframe(turn) | history(self._reader, self._past, turn)
            delete_others(ctx, snapshot["names"])
            state.restore(snapshot)
            for _, kind, data in self._past.events(turn, tuple(COMPONENTS)):
                ctx.record.components.apply(OpCodes(kind).name, data, lenient=True)
        self._replayer.show(*self._looks(turn))
        self._replayer.turn = turn

    def _looks(self, turn: int) -> tuple[Any, list[Any]]:
        """Return the visuals that were declared then, and what artists with drawers of the program's own drew."""
        header, declared = self._reader.header, self._past.events(turn, _LOOKS)
        if turn > self._drawn_until:
            new = self._reader.events(self._drawn_until, turn, _DRAWINGS)
            self._drawn += [(log, data["artist"]) for log, *_, data in new]
            self._drawn_until = turn
        last = {artist: log for log, artist in self._drawn if log < turn}
        logs = sorted(set(last.values()))
        later = [data for log in logs for *_, data in self._reader.events(log, log + 1, _DRAWINGS)]
        drawings: list[Any] = [*header.get("drawings", []), *later]
        return declared[-1][2] if declared else header.get("visuals"), drawings
