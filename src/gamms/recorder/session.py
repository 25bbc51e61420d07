"""One recording while it is written: collects the journal into the log of each turn.

Events are converted to plain values at once, because programs may change their objects later.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from itertools import takewhile
from operator import attrgetter
from typing import Any, Protocol

import numpy as np

from gamms.deciding import get_phase
from gamms.ir import events as kinds
from gamms.ir.events import Log
from gamms.ir.journal import PLAIN
from gamms.knowledge.looks import ReportWriter
from gamms.plain import Plain
from gamms.progress import delay_interrupts
from gamms.recorder import keyframes
from gamms.recorder.changes import ContextChanges, DrawingChanges
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import Damaged
from gamms.recorder.journals import SessionJournal, SkippedValues
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.maps import is_map_of
from gamms.recorder.turn_writer import Encoder, TurnWriter
from gamms.typing.context import HostContext

_OF_TURN = ("_declarations", "_front", "visuals", "world")  # attributes that events of a turn change
_OTHER_AGENT = object()
_REVISIONS = attrgetter("graph.revision", "obstacle_revision")
_OF_AGENTS = kinds.AGENT_CREATE >> 24


class Follower(Protocol):
    """Receives the events of a running game, in their recorded form."""

    def begin(self, header: dict[str, Any], state: Keyframe) -> None:
        """Start, or restart, with the present state; turns follow.

        Args:
            header: the header of a recording that would begin now.
            state: the whole state; read-only.
        """

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Receive the events since the last call.

        Args:
            log: the events; read-only.
            is_over: whether the turn is over; otherwise agents decide next.
        """


class EventFollowers:
    """The followers of a session, and the events that they have received.

    Args:
        followers: receivers of the reports.
        header: returns the header of the session.

    Attributes:
        edits: edit count of the drawings when the followers started; None: not started.
        heard: the number of entries of this turn's log that they have received.
        has_failed: whether one has raised an error when it received the last ones.
    """

    def __init__(self, followers: tuple[Follower, ...], header: Callable[[], dict[str, Any]]) -> None:
        self._followers = followers
        self._header = header
        self.heard = 0
        self.has_failed = False
        self.edits: int | None = None

    def begin(self, looks: dict[str, Any], state: Keyframe, edits: int, heard: int) -> None:
        """Start the followers.

        Args:
            looks: header items that have changed since.
            state: the whole state.
            edits: edit count of the drawings.
            heard: number of entries of this turn's log that the state includes.
        """
        self.edits = edits
        self.heard = heard
        header = self._header() | looks
        for follower in self._followers:
            follower.begin(header, state)

    def tell(self, log: Log, *, is_over: bool) -> None:
        """Send the new part of this turn's log to the followers."""
        news = log[self.heard :]
        self.heard = 0 if is_over else len(log)
        self.has_failed = True
        for follower in self._followers:
            follower.hear(news, is_over=is_over)
        self.has_failed = False


class ReportObserver:
    """Lets a session record the sensor data of agents before they decide, see `game.turn.Observer`.

    Args:
        session: the session.
    """

    def __init__(self, session: "RecordingSession") -> None:
        self._session = session

    def __call__(self, agents: list[Any], states: list[dict[str, Any]]) -> None:
        """Record the data in the states of agents."""
        self._session.note_reports(agents, states)

    def observe_agents(self, agents: list[Any]) -> bool:
        """Record the data if they depend only on where agents stand; return whether they do."""
        return self._session.note_reports(agents, None)


class RecordingSession:
    """Listens to a context and passes its events to an encoder.

    Args:
        ctx: the context.
        with_sensed: whether sensor data of agents are written, too; None: once an agent carries a sensor.
        with_drawings: whether drawings of custom drawers are written, too.

    Attributes:
        is_paused: whether writing is paused.
        takes_records: whether replayed records of version 2 are written unchanged.
        visuals: visuals at the end of the first turn.
        drawings: detector of changed drawings.
        world: the first graph and its obstacles, or the map at the end of the first turn; None before.
        header: header of the first replayed recording; None: this recording has its own.
        turn: number of recorded turns.
        seed: seed of the context at the end of the first turn.
    """

    def __init__(self, ctx: HostContext, *, with_sensed: bool | None, with_drawings: bool) -> None:
        self.ctx = ctx
        self._with_sensed = with_sensed
        self._versions: tuple[Any, ...] = ()  # versions of the recorded parts, to detect changes
        self._graph = ctx.graph
        self._phase = get_phase(ctx)
        self._writer: TurnWriter | None = None
        self._front = 0  # position in the log for map changes: after earlier events of another start
        self.turn = 0
        self.seed = ctx.seed
        self.is_paused = False
        self._replayed: DetachedState | None = None  # state of the recording that this one continues
        self.takes_records = False
        self._following: EventFollowers | None = None
        self._pending: Log = []  # declarations of components that the replayed recording may repeat
        self.header: dict[str, Any] | None = None
        has_map = next(iter(ctx.graph.graph.get_nodes()), None) is not None
        self._reports = ReportWriter(ctx)
        self._observer = ReportObserver(self)
        self._skipped = SkippedValues(ctx)
        self.world: bytes | None = self._skipped.pack_map() if has_map else None
        if has_map:
            self._reports.follow_map()
        self._skipped.check_all()
        self.drawings = DrawingChanges(ctx.visual, with_custom=with_drawings)
        self._declarations = self.drawings.edits
        self.visuals = self.drawings.describe_artists()
        self._members: Mapping[str, Any] = {}  # agents at the pause
        self._journal = self._listen()
        self.begin = keyframes.capture_state(ctx) | keyframes.make_first_history(ctx) | keyframes.pack_components(ctx)
        self._revised = _REVISIONS(self._graph)
        self._changes = self._read_state()

    def write_to(self, encoder: Encoder, *, in_background: bool) -> None:
        """Start writing.

        Args:
            encoder: writes the turns.
            in_background: whether another thread writes turns that wait long; otherwise each turn is written at its
                end, if it can be read then.
        """
        self._writer = TurnWriter(self, encoder, in_background=in_background)

    @property
    def has_failed(self) -> bool:
        """Whether writing has failed: nothing more is recorded."""
        return self._writer is not None and self._writer.has_failed

    @property
    def log(self) -> Log:
        """The events of this turn so far."""
        return self._journal.log

    def end_turn(self) -> None:
        """Write the finished turn; Ctrl-C waits until it is written."""
        with delay_interrupts():
            self._write_turn()

    def _write_turn(self) -> None:
        journal = self._journal
        if not self.turn:
            self.seed = self.ctx.seed
        self._note_changes()
        journal.log += self.drawings.list_changes()
        self._changes.game.count(journal.log)
        log = journal.log
        journal.log = []
        self._front = 0
        if self._replayed is not None:
            try:
                self._replayed.apply(log)
            except Damaged:  # caused by records that a program has written
                self._replayed = None
        self.turn += 1
        if self.world is None:  # later maps are recorded as events
            self.world = self._skipped.pack_map()
            self._reports.follow_map()
        if self._writer is not None:
            self._writer.add(log, len(log) + journal.in_arrays, journal.weight, has_arrays=bool(journal.in_arrays))
        journal.in_arrays = 0
        journal.weight = 0
        self._tell_followers(log, is_over=True)

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that drops what is recorded from now on, when the turn has been taken back."""
        journal = self._journal
        drop_events = journal.checkpoint()
        changes = self._changes.copy()
        forget_reports = self._reports.checkpoint()
        before = {name: getattr(self, name) for name in _OF_TURN}
        is_map_known = self._revised == _REVISIONS(self._graph)
        following = self._following
        heard = None if following is None else (following.edits, following.heard)

        def drop() -> None:
            if self._journal is not journal:  # a function has paused it
                return
            drop_events()
            self._changes = changes
            forget_reports()
            for name, value in before.items():
                setattr(self, name, value)
            self._versions = ()
            if is_map_known:
                self._revised = _REVISIONS(self._graph)
            if following is not None and not following.has_failed and (following.edits, following.heard) != heard:
                self._begin_with_followers()

        return drop

    def follow(self, followers: tuple[Follower, ...], header: "Callable[[RecordingSession], dict[str, Any]]") -> None:
        """Send all further events to these followers only, with sensor data unless these are left out.

        Args:
            followers: receivers of the events.
            header: returns the header of a session.
        """
        self._following = EventFollowers(followers, lambda: header(self)) if followers else None
        if followers:
            self._note_sensors()
        self._begin_with_followers()

    def _begin_with_followers(self) -> None:
        """Start followers with the present state, once there is a map."""
        following = self._following
        if following is None or next(iter(self.ctx.graph.graph.get_nodes()), None) is None:
            return
        self._note_changes()
        self._front = len(self.log)
        self._journal.last_set = None  # included in their initial state
        looks = {
            "world": self._skipped.pack_map(),
            "visuals": self.drawings.describe_artists(),
            "drawings": self.drawings.noted,
        }
        state = keyframes.capture_state(self.ctx) | keyframes.make_history(self.ctx) | {"pace": self._changes.game.pace}
        following.begin(looks, state, self.drawings.edits, len(self.log))

    def _tell_followers(self, log: Log, *, is_over: bool) -> None:
        following = self._following
        if following is None:
            return
        # Declarations of the first turn are in the header, not in events.
        if following.edits is None or (self.turn == 1 and is_over and following.edits != self.drawings.edits):
            self._begin_with_followers()
            return
        self._journal.last_set = None  # they have already received this event
        following.tell(log, is_over=is_over)

    def pause(self) -> None:
        """Pause writing until `play`."""
        self.end_replay()
        self._note_changes()
        self._stop_listening()
        self.is_paused = True
        self._members = dict(self.ctx.agent.agents)

    def play(self, known: Mapping[str, Any] | None = None) -> None:
        """Resume writing with the present state.

        Args:
            known: the agents known to the reader, by name; None as a value: any agent of this name. Default: the agents
                at the pause.
        """
        known = self._members if known is None else known
        waiting = self._journal.log
        self._journal = self._listen()
        self.is_paused = False
        now = self.ctx.agent.agents
        left = [name for name, agent in known.items() if name in now and agent in (None, now[name])]
        # Returning agents are created in their order, and so are all later ones.
        kept = [name for name, other in takewhile(lambda pair: pair[0] == pair[1], zip(left, now, strict=False))]
        gone = [(kinds.AGENT_DELETE, {"name": name}) for name in known if name not in kept]
        snapshot = keyframes.capture_state(self.ctx) | keyframes.make_history(self.ctx) | {"seed": self.ctx.seed}
        self._front = len(waiting)
        self._journal.log = [*waiting, *gone, (kinds.SNAPSHOT, snapshot)]
        self._changes = self._read_state()
        self._begin_with_followers()

    def close(self) -> None:
        """Write the rest, and stop listening."""
        self.end_replay()
        self._stop_listening()
        if self._writer is None or self._writer.has_stopped():
            return
        if not self.is_paused:
            self._note_changes()
        self._skipped.check_data()
        log = self._journal.log
        if log:
            log.append((kinds.UNFINISHED, {}))
        self._writer.close(log)

    @property
    def is_new(self) -> bool:
        """Whether nothing has happened yet except declarations of component classes."""
        has_begun = self._writer is not None and self._writer.has_begun
        is_new = not has_begun and not self.turn and not self.begin["names"] and not self.is_paused
        log = self.log
        return is_new and all(entry[0] == kinds.COMPONENT_REGISTER for entry in log if type(entry) is tuple)

    def adopt(self, header: dict[str, Any], begin: keyframes.Keyframe) -> bool:
        """Begin like a replayed recording, if nothing has happened yet; return whether this was possible.

        Equal events then give equal bytes.
        """
        if not self.is_new or not (self.world is None or is_map_of(self.world, header)):
            return False
        if self.world is None:
            self._reports.follow_map()
        self._replayed = DetachedState(deepcopy(begin))
        self.header = header  # not None: there is a map
        self.world = header.get("world", b"")
        self.begin = begin
        self._set_declarations_aside()
        return True

    def take_records(self) -> None:
        """Write the records of a replay of version 2 unchanged, if nothing has happened yet."""
        self.takes_records = self.is_new
        if self.takes_records:
            self._set_declarations_aside()

    def _set_declarations_aside(self) -> None:
        """Delay declarations of components until the end of the replay, which may repeat them."""
        self._pending = self._journal.log
        self._journal.log = []

    def end_replay(self) -> None:
        """Continue with the state of the context."""
        self._replayed = None
        self.takes_records = False
        self.log.extend(self._pending)
        self._pending = []

    def renumber(self, snapshot: keyframes.Keyframe) -> None:
        """Use the agent numbers of a snapshot, and treat its state as known."""
        journal = self._journal
        block = self.ctx.agent.block
        journal.names = [""] * snapshot["next"]
        journal.living = dict.fromkeys(snapshot["names"])
        for name, number in zip(snapshot["names"], snapshot["numbers"].tolist(), strict=True):
            journal.renumber(block.find_row(name), name, number)
        self._revised = _REVISIONS(self._graph)
        self._declarations = self.drawings.edits
        self.drawings.list_changes()
        self._changes = self._read_state()

    def note_component(self, kind: int, data: dict[str, Any]) -> None:
        """Record a change of a component."""
        self.log.append((kind, data))
        self._take_from_pending(kind, data)

    def _take_from_pending(self, kind: int, data: dict[str, Any]) -> None:
        if kind == kinds.COMPONENT_REGISTER:
            self._pending = [one for one in self._pending if one[1]["key"] != data["key"]]

    @contextmanager
    def as_replayed(self, record: dict[str, Any]) -> Iterator[None]:
        """Write a record of version 2 unchanged, instead of the events in this block."""
        log = self.log
        if record["opCode"] == kinds.SIMULATE:
            log.append((kinds.REPLAYED, (record, [])))  # first, because it ends the turn
            yield
            return
        before = len(log)
        try:
            yield
        finally:
            log[before:] = [(kinds.REPLAYED, (record, log[before:]))]
        self._take_from_pending(record["opCode"], record.get("data", {}))

    def emit_snapshot(self) -> None:
        """Record the present state as a snapshot, after a replay has set it."""
        self._note_changes(is_set_next=True)
        self._stop_listening()
        self.play(self._journal.living)

    def restart(self) -> None:
        """Restart after a reset of the game, which undoes this turn's changes of agents."""
        self._stop_listening()
        events = [entry for entry in self.log if type(entry) is tuple]
        known: dict[str, Any] = dict(self._journal.living)
        for kind, data in reversed(events):
            if kind == kinds.AGENT_CREATE:
                known.pop(data["name"], None)
            elif kind == kinds.AGENT_DELETE:
                known[data["name"]] = _OTHER_AGENT
        if any(kind == kinds.SNAPSHOT for kind, _ in events):
            known = self._journal.living
        else:
            self._journal.log = [(kind, data) for kind, data in events if kind >> 24 != _OF_AGENTS]
        self.play(known)

    def abandon(self) -> None:
        """Stop listening and writing."""
        self._stop_listening()
        if self._writer is not None:
            self._writer.end()

    # -- listening ----------------------------------------------------------------------------------------------

    def _listen(self) -> SessionJournal:
        """Return a new journal of the context."""
        if self._with_sensed is None and any(getattr(agent, "sensors", None) for agent in self.ctx.agent.create_iter()):
            self._with_sensed = True
        block = self.ctx.agent.block
        block.locate()
        journal = SessionJournal(block.names, self._skipped, self._accept, self._note_sensors)
        block.journal = journal
        for callbacks, callback in self._list_callbacks():
            callbacks.append(callback)
        return journal

    def _list_callbacks(self) -> list[tuple[list[Any], Callable[..., None]]]:
        """Return (list of callbacks of the context, callback) pairs."""
        internals = self.ctx.game.internals
        found: list[Any] = [(self.ctx.visual.after_turn, self.end_turn), (internals.after_reset, self.restart)]
        found.append((internals.checkpoints, self.checkpoint))
        return [*found, (internals.after_observing, self._observer)] if self._with_sensed else found

    def _note_sensors(self) -> None:
        """Record sensor data from now on, unless left out: an agent carries a sensor, or a follower has joined."""
        if self._with_sensed is None:
            self._with_sensed = True
            self.ctx.game.internals.after_observing.append(self._observer)

    def note_reports(self, agents: list[Any], states: list[dict[str, Any]] | None) -> bool:
        """Record the sensor data from which agents will decide, after all earlier changes.

        Args:
            agents: the agents.
            states: their states; None: the data are recorded only if they depend only on where agents stand.

        Returns:
            Whether they were recorded.
        """
        self._note_changes()
        journal = self._journal
        if states is None:
            data = self._reports.write_without_states(agents, journal.ids)
        else:
            data = self._reports.write(agents, states, journal.ids, self.turn)
        if data is None:
            return False
        if self._following is not None and self._following.edits is None:
            self._begin_with_followers()
        journal.log.append((kinds.SENSED, data))
        self._front = len(journal.log)  # later changes of this turn come after the sensor data
        if self._following is not None and self._following.edits is not None:
            self._tell_followers(journal.log, is_over=False)
        return True

    def _stop_listening(self) -> None:
        block = self.ctx.agent.block
        if block.journal is self._journal:
            block.journal = PLAIN
        for callbacks, callback in self._list_callbacks():
            if callback in callbacks:
                callbacks.remove(callback)

    def make_keyframe(self) -> keyframes.Keyframe:
        """Return the state after the last turn."""
        if self._replayed is not None:  # it has data that no context can have, such as names of strategies
            return self._replayed.make_keyframe(self.turn)
        return (
            keyframes.capture_state(self.ctx) | {"pace": self._changes.game.pace} | keyframes.pack_components(self.ctx)
        )

    def _note_changes(self, *, is_set_next: bool = False) -> None:
        """Record changes that the journal does not contain: the map, before the agents on it, and the game.

        Args:
            is_set_next: whether a snapshot follows, with the positions of flying agents set by a replay.
        """
        # NOTE: in most turns no version has changed, and only the fields of the game are compared
        # (benchmarks: w4).
        log = self._journal.log
        versions = self._list_versions()
        has_changed = versions != self._versions
        if has_changed:
            self._note_world(log, is_set_next=is_set_next)
        if self._journal.progressed:
            log += self._note_progress()
        if has_changed:
            self._changes.strategies.detect(log)
            self._versions = versions
        self._changes.game.detect(log)

    def _list_versions(self) -> tuple[Any, ...]:
        """Return version numbers that change with maps, sensors, artists, agents, teams, strategies and plans."""
        ctx = self.ctx
        return (
            _REVISIONS(self._graph),
            self._phase.epoch,
            len(ctx.sensor.sensors),
            self.drawings.edits,
            ctx.agent.structure_version,
        )

    def _note_world(self, log: Log, *, is_set_next: bool) -> None:
        """Record changes of the map, the sensors and the artists."""
        if _REVISIONS(self._graph) != self._revised:
            changes = self._note_map_changes()
            log[self._front : self._front] = changes
            self._front += len(changes)
            above = None if is_set_next else keyframes.list_flyers(self.ctx)
            if above is not None:
                log.append((kinds.FLYERS_ABOVE, above))
        if self._changes.sensors.are_due:
            place = self._front + len(list(takewhile(_must_precede_sensors, log[self._front :])))
            changes = self._changes.sensors.detect()
            log[place:place] = changes
            if changes:
                self._reports.forget_fields()
        if self.drawings.edits != self._declarations:
            log += self._note_visual_changes()

    def _accept(self, kind: int, data: Plain) -> None:
        """Accept the change of a replayed event as known; later changes come after it."""
        self._front = len(self.log)
        if kind == kinds.WORLD:
            self._revised = _REVISIONS(self._graph)
            self._reports.follow_map()
        elif kind == kinds.VISUALS:
            self._declarations = self.drawings.edits
        elif kind == kinds.VISUAL_COMMANDS:
            self.drawings.list_changes()
        elif kind == kinds.SENSORS:
            self._changes.sensors.accept()
            self._reports.forget_fields()
        elif kind == kinds.SENSED:
            self.log[-1] = kind, self._reports.rewrite(data, self.turn)
        elif kind == kinds.AGENT_PROGRESS:
            self._journal.progressed.clear()
        else:
            self._changes.game.accept(kind, data)

    def _read_state(self) -> ContextChanges:
        """Return the present state, with which later states are compared."""
        self._journal.progressed.clear()
        return ContextChanges(self.ctx, self._skipped.check_sensors)

    def _note_progress(self) -> Log:
        """Return an event with the progress of agents along edges, if it changed."""
        block = self.ctx.agent.block
        ids = self._journal.ids
        progressed = self._journal.progressed
        rows = [row for row in range(len(block)) if ids[row] in progressed]
        progressed.clear()
        numbers = np.array([ids[row] for row in rows], np.int64)
        progress = keyframes.make_progress_event(block, np.array(rows, np.int64))
        return [(kinds.AGENT_PROGRESS, {"numbers": numbers, **progress})]

    def _note_visual_changes(self) -> Log:
        """Return an event with changed visuals; visuals of the first turn go to the header."""
        self._declarations = self.drawings.edits
        visuals = self.drawings.describe_artists()
        if not self.turn:
            self.visuals = visuals
            return []
        return [(kinds.VISUALS, visuals)]

    def _note_map_changes(self) -> Log:
        """Return an event with a changed map; the first map goes to the header, even if it is loaded late."""
        self._revised = _REVISIONS(self._graph)
        self._reports.follow_map()
        world = self._skipped.pack_map()
        if self.world is None:
            self.world = world
            return []
        return [(kinds.WORLD, {"world": world})]


def _must_precede_sensors(entry: Any) -> bool:
    """Return whether a log entry must precede sensor changes, which precede agents that carry the sensors."""
    return type(entry) is tuple and entry[0] in (kinds.SNAPSHOT, kinds.SENSORS)
