"""Replay of a recording in a window, with seeking."""

from collections.abc import Iterator
from itertools import chain
from typing import Any, BinaryIO

from gamms.arguments import as_int
from gamms.errors import BadValue
from gamms.ir import events as kinds
from gamms.ir.events import COMPONENTS
from gamms.ir.progress import Progress, find_steps_along
from gamms.ir.schema import ON_EDGES
from gamms.recorder import keyframes
from gamms.recorder.errors import RecorderBusy, report_damage
from gamms.recorder.recording import Recording
from gamms.recorder.replaying import Replayer
from gamms.recorder.resuming import EventHistory, delete_others, read_history
from gamms.typing.context import HostContext
from gamms.typing.recorder import IPlayback, OpCodes, Step

_HIGHLIGHTS = (kinds.GAME_EVENT, kinds.GAME_SCORES, kinds.GAME_OVER)
_LOOKS = (kinds.VISUALS,)
_DRAWINGS = {kinds.VISUAL_COMMANDS}


def _find_places(columns: keyframes.Columns) -> dict[str, int | Progress]:
    """Return agent -> its node, or its progress on an edge, for agents on the ground."""
    progress = zip(*(columns[name].tolist() for name in ON_EDGES), strict=True)
    rows = zip(columns["names"], columns["kind"].tolist(), columns["node"].tolist(), progress, strict=True)
    return {name: Progress(*place) if place[4] else node for name, flies, node, place in rows if not flies}


class Playback(IPlayback):
    """A replay of a recording of version 3.

    Args:
        ctx: the context for the replay.
        recording: the recording.
        replayer: applies its events.
        owned: the file to close at the end, if it was opened for this replay.
    """

    def __init__(self, ctx: HostContext, recording: Recording, replayer: Replayer, owned: BinaryIO | None) -> None:
        self._ctx = ctx
        self._reader = recording.reader
        self._replayer = replayer
        self._owned = owned
        self._recording = recording
        self._past = EventHistory(recording.reader)
        self._drawn: list[tuple[int, str]] = []  # (log, artist) of recorded drawings by log
        self._drawn_until = 0
        self.is_open = True

    @property
    def turn(self) -> int:
        """The number of turns replayed, without one that the recorded game did not finish."""
        return min(self._replayer.turn, self.turns)

    @property
    def turns(self) -> int:
        """The number of turns."""
        return self._recording.turns

    @property
    def can_seek(self) -> bool:
        """Whether other turns can be shown; not while the context is being recorded."""
        return self.is_open and not self._ctx.record.record()

    def close(self) -> None:
        """Close the file; no further replay is possible."""
        self.is_open = False
        if self._owned is not None:
            self._owned.close()

    def highlights(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield (turn, data) of events emitted by rules, changes of the scores (`scores`) and the end (`over`)."""
        for log, _, kind, data in self._reader.events(kinds=_HIGHLIGHTS):
            if isinstance(data, dict):
                yield log + 1, {"over": data} if kind == kinds.GAME_OVER else data

    def steps(self, turn: int) -> dict[str, Step]:
        """Return the nodes, or 3D positions, of agents before and after their last move, up to a turn."""
        state = self._recording.detached(turn)
        columns = state.agents.columns
        flies = columns["kind"].tolist()
        walks = zip(columns["previous"].tolist(), columns["node"].tolist(), strict=True)
        flights = zip(columns["previous_position"].tolist(), columns["position"].tolist(), strict=True)
        steps = zip(columns["names"], flies, walks, flights, strict=True)
        found = {name: (tuple(air[0]), tuple(air[1])) if is_up else ground for name, is_up, ground, air in steps}
        if turn and columns["edge_motion"].any():
            was, now = (_find_places(self._recording.detached(one).agents.columns) for one in (turn - 1, turn))
            on_edges = [name for name in now if name in was and isinstance(now[name], Progress)]
            found.update((name, (was[name], now[name])) for name in on_edges)
        named = state.game.find_named_edges(state.number_turn(turn))
        return found | find_steps_along({name: found[name] for name in named if name in found}, named)

    def play_turn(self) -> None:
        """Replay the next turn."""
        self._ctx.record.is_replaying = True
        try:
            for _ in self._replayer.play_turn(self._reader):
                pass
        finally:
            self._ctx.record.is_replaying = False

    def seek(self, turn: int) -> None:
        """Restore the state after a number of turns; the replay continues from there.

        Raises:
            BadValue: the turn does not exist.
            RecorderBusy (RuntimeError): the context is being recorded.
            RecordingError (ValueError): the recording is damaged.
        """
        if not 0 <= as_int(turn, "turn") <= self.turns:
            raise BadValue(f"There is no turn {turn}: this recording has {self.turns} turns.")
        if not self.can_seek:
            raise RecorderBusy("Another turn cannot be shown while the replay is being recorded.")
        ctx = self._ctx
        state = self._replayer.state
        recording = self._recording
        with report_damage(f"Turn {turn} cannot be shown"):
            if recording.map_hash(turn) != recording.map_hash(min(self.turn, self.turns)):
                ctx.graph.storage.unpack(recording.map_at(turn).packed)
            snapshot = recording.detached(turn).make_keyframe(turn) | read_history(self._reader, self._past, turn)
            delete_others(ctx, snapshot["names"])
            state.restore(snapshot)
            for _, kind, data in self._past.list_events(turn, tuple(COMPONENTS)):
                ctx.record.components.apply(OpCodes(kind).name, data, lenient=True)
        self._replayer.show(*self._read_visuals(turn))
        self._replayer.turn = turn

    def _read_visuals(self, turn: int) -> tuple[Any, list[Any]]:
        """Return the declared visuals at a turn, and the recorded drawings of custom artists."""
        header = self._reader.header
        declared = self._past.list_events(turn, _LOOKS)
        if turn > self._drawn_until:
            new = self._reader.events(self._drawn_until, turn, _DRAWINGS)
            self._drawn += [(log, data["artist"]) for log, *_, data in new]
            self._drawn_until = turn
        last = {artist: log for log, artist in self._drawn if log < turn}
        logs = sorted(set(last.values()))
        later = [data for *_, data in chain.from_iterable(self._reader.events(log, log + 1, _DRAWINGS) for log in logs)]
        drawings: list[Any] = [*header.get("drawings", []), *later]
        return declared[-1][2] if declared else header.get("visuals"), drawings
