"""What a page shows, turn by turn: columns of agents, signs, colors and captions, made as pictures are made.

A game is followed in a context of its own, whose artists draw what has changed in both themes. The viewer paints these
draw commands; it knows no rule and no kind of event. `columns.py` makes columns of the turns, `knowledge.py` says
what agents sense and know; `docs/page-format.md` describes what comes of it.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from functools import lru_cache
from typing import Any, Self

import numpy as np

from gamms.errors import BadValue
from gamms.ir import events as kinds
from gamms.ir.events import DECISIONS, Log, events_of
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.packing import to_bytes
from gamms.plain import Plain, is_same
from gamms.recorder.detached import DetachedState
from gamms.recorder.replaying import Replayer
from gamms.recorder.resuming import opened_context
from gamms.text import as_digits, as_text
from gamms.typing import IArtist
from gamms.visual.artist import ArtistGroup, state_of
from gamms.visual.captions import captions_of, ending
from gamms.visual.drawers.marks import drawn_marks
from gamms.visual.drawers.rules import teams_of_rules
from gamms.visual.legend import LegendRow, blocks_of, plain_block
from gamms.visual.recorded_drawings import RecordedDrawer
from gamms.visual.themes import THEMES
from gamms.web.bundle import VIEWER_THEMES
from gamms.web.columns import (
    ALIVE,
    FLIES,
    THERE,
    Change,
    Fact,
    InAir,
    OnEdges,
    Turn,
    drawn_map,
    frame,
    in_steps,
    part_of,
)
from gamms.web.knowledge import AgentFacts, KnowledgeTracker, SensedTurn, sides_in

_STEPS = 1 << 15  # of the larger side of the map: on a city some centimetres
_PIXEL_STEP = 2.0**-4
_UNMARKED = {"tag", "respawned", *DECISIONS}  # kinds of events that are too many for the line of turns
_SIGNS = {  # the letters for signs of legends
    "flag": "⚑",
    "ring": "○",
    "band": "▒",
    "goal": "◎",
    "arc": "◔",
    "base": "□",
    "plus": "+",
    "timer": "◝",
    "square": "◇",
    "gauge": "▬",
    "tag": "⊗",
    "cross": "✕",
    "tick": "✓",
    "curve": "⌒",
    "line": "─",
    "dot": "•",
    "field": "◗",
}

_UNREAD = {  # kinds of events that nothing reads which paints
    kinds.GAME_FACTS,
    kinds.GAME_CHANCE,
    kinds.GAME_PRIVATE_FACTS,
    kinds.AGENT_STRATEGY,
    kinds.AGENT_ATTRIBUTE,
    kinds.DELAYED_LOOKS,
    *kinds.COMPONENTS,
}
_QUIET = _UNREAD | {  # kinds of events after which rules, teams and the map are as before
    kinds.MOVES,
    kinds.SENSED,
    kinds.AGENT_PROGRESS,
    kinds.AERIAL_AGENT_FLIGHT,
    kinds.AERIAL_AGENT_TURN,
    kinds.GAME_SCORES,
    kinds.GAME_TURN,
    kinds.GAME_MEMORY,
    kinds.GAME_DEED,
    kinds.GAME_BLOCKED,
    kinds.GAME_MESSAGE,
}
_LEAST = 1e-9
_ATTRIBUTES = {"highway", "name", "tunnel"}

Drawn = dict[str, Any]


class Painter:
    """Follows a game, and gives what a page shows of it in parts.

    Args:
        header: of the recording of the game, with its map.
        state: how the game begins, as a keyframe.
        turns: how many come before.
    """

    def __init__(self, header: Mapping[str, Plain], state: dict[str, Plain], turns: int = 0) -> None:
        self._ctx: Any = opened_context(0, None, is_quiet=True)
        self._ctx.record.is_replaying = True  # so that recorded drawings stay
        self._replayer = Replayer(self._ctx)
        self._replayer.begin_with(dict(header), state)
        self._state = DetachedState(deepcopy(state), turns)
        sides: Any = header.get("sides") or ()
        self._sides = [side for side in sides if side is not None]
        self._at = turns
        self._is_whole = False
        self._edition = 0  # changes whenever rules, teams or the map may have changed
        self._edited_at = turns
        self._artists: dict[str, tuple[Any, dict[str, IArtist]]] = {}  # theme -> by which edition, and by name
        self._read: dict[str, Any] = {}  # artist -> when it drew last
        self._commands: dict[str, Drawn] = {}  # what artists drew last in the first theme, by name
        self._scores: dict[str, Any] = {}
        self._listed: tuple[Any, list[str], list[str]] = ((), [], [])  # names and sides of the agents of a version
        self._slots: dict[str, bytes] = {}  # what is so at present
        self._values: dict[str, Plain] = {}  # the same, of those that are compared
        self._facts = AgentFacts(self._state)
        self._sights = KnowledgeTracker(self._ctx, self._step)
        self._looked: list[Mapping[str, Any]] = []  # what was sensed last
        self._turns: list[Turn] = []  # that are in no part
        self._last: Turn | None = None
        list(self._changes())
        list(self._facts.changes(None, self._game_turn()))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the context."""
        self._ctx.terminate()

    def begin(self) -> None:
        """Begin a part that needs none before it, with the last turn."""
        changes, facts = list(self._slots.items()), list(self._facts.present())
        last = self._turn({}, [], [], [], None) if self._last is None else self._last
        self._turns = [last._replace(changes=changes, facts=facts, captions=[])]
        self._is_whole = True

    def restore(self, state: dict[str, Plain]) -> None:
        """Become what a keyframe says."""
        self._replayer.apply(kinds.SNAPSHOT, state)
        self._state.restore(deepcopy(state))
        self._edition += 1
        self._edited_at = self._at
        self._last = None
        list(self._changes())
        list(self._facts.changes(None, self._game_turn()))

    def add(self, log: Log) -> None:
        """Play the log of a turn."""
        events = list(events_of(log))
        self._looked = [data for kind, data in events if kind == kinds.SENSED] or self._looked
        has_sensed = any(kind == kinds.SENSED for kind, _ in events)
        sensed = self._sights.sensed(self._looked, self._state) if has_sensed else None
        self._state.apply(log)
        self._replayer.play_log([one for one in log if type(one) is not tuple or one[0] not in _UNREAD])
        self._at += 1
        if any(kind not in _QUIET for kind, _ in events):
            self._edition += 1
            self._edited_at = self._at
        if any(kind in (kinds.WORLD, kinds.SENSORS, kinds.SNAPSHOT) for kind, _ in events):
            self._sights.forget()
        facts = list(self._facts.changes(log, self._game_turn()))
        ways = self._ways(events)
        self._last = self._turn(ways, list(self._changes(events)), facts, list(self._captions(events)), sensed)
        self._turns.append(self._last)

    def part(self, *, is_last: bool = True) -> bytes:
        """Return the turns since the last call as a part; none: there are none.

        Args:
            is_last: whether it says what is sensed behind the last of them, as far as that is known.
        """
        if not self._turns:
            return b""
        rest = self._sights.sensed(self._looked, self._state) if is_last and self._looked else None
        first = self._at - len(self._turns) + 1
        found = part_of(first, self._turns, self._step(), is_whole=self._is_whole, rest=rest)
        self._turns, self._is_whole = [], False
        return frame(found)

    def _game_turn(self) -> int:
        game = self._ctx.current_game
        return 0 if game is None else int(game.turn)

    def _step(self) -> float:
        step: float = self._ctx.visual.drawing.of_map(_step)
        return step

    # -- columns ------------------------------------------------------------------------------------------------

    def _turn(
        self,
        ways: Mapping[int, Sequence[int]],
        changes: Sequence[Change],
        facts: Sequence[Fact],
        captions: Sequence[Drawn],
        sensed: SensedTurn | None,
    ) -> Turn:
        """Return how the turn has ended."""
        columns = self._state.agents.columns
        flies = columns["kind"] != 0
        status = THERE + ALIVE * (columns["alive"] != 0) + FLIES * flies
        nodes = self._sights.rows("nodes", columns["node"])
        on_edge = np.flatnonzero((columns["edge_share"] > 0.0) & ~flies)
        ends = [self._sights.rows("nodes", columns[name][on_edge]) for name in ("edge_source", "edge_target")]
        on_edges = OnEdges(on_edge, np.column_stack(ends), columns["edge_share"][on_edge])
        in_air = np.flatnonzero(flies & np.isfinite(columns["position"]).all(axis=1))
        headings = _headings(columns["quat"][in_air])
        air = InAir(in_air, columns["position"][in_air], headings)
        version = self._state.agents, self._state.agents.version
        if version != self._listed[0]:
            self._listed = version, list(columns["names"]), sides_in(columns)
        _, names, sides = self._listed
        messages = self._facts.messages
        return Turn(names, status, nodes, sides, on_edges, air, ways, messages, changes, facts, captions, sensed)

    def _ways(self, events: Sequence[tuple[int, Any]]) -> dict[int, list[int]]:
        """Return the rows of the nodes that agents passed which did not simply go from one node to the next one."""
        agents = self._state.agents
        passed: dict[int, list[int] | None] = {}  # number -> ids of nodes; None: it was put elsewhere
        for kind, data in events:
            if kind == kinds.MOVES:
                moves = np.asarray(data).tolist()
                for number, node in zip(moves[::2], moves[1::2], strict=True):
                    known = passed.setdefault(number, [])
                    if known is not None:
                        known.append(node)
            elif kind == kinds.AGENT_CURRENT_NODE and data["agent_name"] in agents.columns["names"]:
                passed[int(agents.columns["numbers"][agents.row(data["agent_name"])])] = None
            elif kind == kinds.SNAPSHOT:
                passed = dict.fromkeys(agents.columns["numbers"].tolist())
        long = {number: way or [] for number, way in passed.items() if not way or len(way) > 1}
        row_of = {number: row for row, number in enumerate(agents.columns["numbers"].tolist())} if long else {}
        found = {row_of[number]: way for number, way in long.items() if number in row_of}
        return {row: self._sights.rows("nodes", way).tolist() for row, way in found.items()}

    # -- slots --------------------------------------------------------------------------------------------------

    def _changes(self, events: Sequence[tuple[int, Any]] = ()) -> Iterator[Change]:
        """Yield the slots that have another value than before."""
        game = self._state.game
        scores = {as_text(of): score for of, score in dict(game.scores).items()}
        values: dict[str, Plain] = {"scores": scores, "is_over": game.over is not None}
        if self._values.get("edition") != self._edition:
            self._values["edition"] = self._edition
            values["colors"] = self._team_colors()
        for slot, value in values.items():
            if slot not in self._slots or not is_same(value, self._values[slot]):
                self._values[slot] = value
                yield self._put(slot, value)
        for kind, data in events:
            if kind == kinds.WORLD:
                yield self._put("world", map_for_viewer(data["world"]))
        for drawing in self._changed_drawings():
            slot = f"drawing {drawing['artist']}"
            if "commands" in drawing:
                yield self._put(slot, drawing)
            else:
                yield slot, to_bytes(None, slot)
                del self._slots[slot]

    def _put(self, slot: str, value: Plain) -> Change:
        self._slots[slot] = to_bytes(value, f"The {slot} of a page")
        return slot, self._slots[slot]

    def _team_colors(self) -> dict[str, Any]:
        """Return side -> its color in each theme."""
        drawing = self._ctx.visual.drawing
        more = [*self._sides, *sorted(teams_of_rules(self._ctx))]
        found: dict[str, Any] = {}
        for theme in VIEWER_THEMES:
            with drawing.themed(THEMES[theme]):
                for side, color in drawing.group_colors(more).items():
                    found.setdefault(side, {})[theme] = list(color)
        return found

    # -- drawings -----------------------------------------------------------------------------------------------

    def _changed_drawings(self) -> list[Drawn]:
        """Return the drawings of the artists that draw something else than before."""
        first, second = VIEWER_THEMES
        artists = self._signs(first)
        drawn = {name: self._drawn(name, artist, first) for name, artist in artists.items()}
        now = {name: commands for name, commands in drawn.items() if commands is not None}
        before = self._commands
        self._commands = now
        changed = [name for name, one in now.items() if not is_same(one, before.get(name))]
        gone = [name for name in before if name not in now]
        others = self._signs(second) if changed else {}
        found: list[Drawn] = [{"artist": name} for name in gone]
        for name in changed:
            other = self._commands_of(name, others.get(name, artists[name]), second) or now[name]
            found.append(self._drawing(name, artists[name], now[name], other))
        return found

    def _signs(self, theme: str) -> dict[str, IArtist]:
        artists, key = self._ctx.visual.artists, (self._edition, self._ctx.visual.artists.edits)
        if self._artists.get(theme, (None,))[0] != key:
            with self._ctx.visual.drawing.themed(THEMES[theme]):
                self._artists[theme] = key, artists.signs()
        return self._artists[theme][1]

    def _drawn(self, name: str, artist: IArtist, theme: str) -> Drawn | None:
        """Return what an artist draws; one that settles draws again when rules may have changed what it reads."""
        settles = getattr(artist.get_drawer(), "settles_in", None)
        key = self._edition, state_of(name, artist), artist.get_visible()
        is_settled = settles is not None and self._at - self._edited_at > settles
        if not is_settled or self._read.get(name) != key:
            self._read[name] = key
            return self._commands_of(name, artist, theme)
        return self._commands.get(name)

    def _commands_of(self, name: str, artist: IArtist, theme: str) -> Drawn | None:
        """Return what an artist draws in a theme, as plain values, with its layer and legend; None: nothing."""
        if not artist.get_visible():
            return None
        with self._ctx.visual.drawing.themed(THEMES[theme]):
            commands = ArtistGroup(self._ctx, {name: artist}).commands()
            legend = [plain_block(block) for block in blocks_of(self._ctx, {name: artist})]
        try:
            plain = commands.to_plain()
        except BadValue:  # it has too many points
            return None
        if not len(plain["kind"]) and not legend:
            return None
        facts = getattr(artist.get_drawer(), "facts", None)
        return {
            "layer": artist.get_layer(),
            "commands": plain,
            "legend": legend,
            "facts": {} if facts is None else facts(self._ctx),
        }

    def _drawing(self, name: str, artist: IArtist, first: Drawn, second: Drawn) -> Drawn:
        """Return a drawing as a page has it, with the colors of both themes."""
        drawer, step = artist.get_drawer(), self._step()
        found: Drawn = {
            "artist": name,
            "layer": int(first["layer"]),
            "in_fog": bool(getattr(drawer, "is_in_fog", False)),
            "follows": not getattr(drawer, "once_a_turn", False),
            **painted(first["commands"], second["commands"], step),
        }
        legend = [_with_letters(block) for block in first["legend"]]
        if legend:
            found["legend"] = legend
        if first["facts"]:
            found["facts"] = first["facts"]
        marks = drawn_marks(artist)
        if marks:
            shifts = [(one.shift[0] * one.least_px, one.shift[1] * one.least_px) for one in marks]
            found["marks"] = {
                "names": [one.name for one in marks],
                "places": np.array([one.current_position for one in marks], np.float64),
                "shifts": np.array(shifts, np.float64),
                "radius": float(marks[0].least_px),
            }
        if isinstance(drawer, RecordedDrawer) and name in self._ctx.visual.artists.drawings.starts:
            found["start"] = in_steps(self._ctx.visual.artists.drawings.starts[name].points, step)
        return found

    # -- captions -----------------------------------------------------------------------------------------------

    def _captions(self, happened: Sequence[tuple[int, Any]]) -> Iterator[Drawn]:
        """Yield the captions of a turn: `words`, the `agent` that they are about, whether `marked` and `major`."""
        events, later = list[Any](), list[Drawn]()
        for kind, data in happened:
            if kind in (kinds.GAME_EVENT, kinds.USER_EVENT):
                events.append(data)
            elif kind == kinds.GAME_SCORES:
                later += self._rises(data["scores"])
            elif kind == kinds.GAME_OVER and data:
                winner = data.get("winner")
                agent = None if winner is None else as_text(winner)
                later.append({"words": ": ".join(ending(data)), "agent": agent, "major": True, "marked": True})
        is_marked = any(event.get("kind") not in _UNMARKED for event in events)
        for words, name in captions_of(events):
            yield {"words": words, "agent": None if name is None else str(name), "major": False, "marked": is_marked}
        yield from later

    def _rises(self, scores: Mapping[Any, float]) -> Iterator[Drawn]:
        """Yield the scores that have risen."""
        now = {as_text(of): score for of, score in dict(scores).items() if isinstance(score, int | float)}
        for of, score in now.items():
            if score > self._scores.get(of, 0):
                yield {"words": f"{of} {as_digits(score)}", "agent": of, "major": True, "marked": True}
        self._scores = now


def _step(columns: GraphColumns) -> float:
    """Return a power of two in whose multiples points are written: small on the map, and small in pixels."""
    extent = float(np.ptp(columns.xy, axis=0).max()) if len(columns.xy) else 0.0
    return min(_PIXEL_STEP, float(2.0 ** np.floor(np.log2(extent / _STEPS)))) if extent > 0.0 else _PIXEL_STEP


def _headings(quat: FloatArray) -> FloatArray:
    """Return where agents look (agents,), in radians; NaN: straight up or down, or nowhere."""
    w, x, y, z = quat.T
    cos, sin = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
    with np.errstate(invalid="ignore"):
        found: FloatArray = np.where(np.hypot(cos, sin) > _LEAST, np.arctan2(sin, cos), np.nan)
    return found


@lru_cache(maxsize=2)  # games that are begun again have the same map
def map_for_viewer(world: bytes) -> bytes:
    """Return a map, as it is saved, as the viewer reads it."""
    return drawn_map(world, _ATTRIBUTES)


def painted(light: Drawn, dark: Drawn, step: float) -> Drawn:
    """Return the `commands` of a drawing as a page has them, and the `colors` of their styles in each theme.

    Args:
        light: the commands as plain values.
        dark: the same in the dark theme.
        step: points are written in multiples of it.
    """
    commands = {**light, "step": step, "points": in_steps(light["points"], step)}
    del commands["color"]
    inks = [light["color"], dark["color"] if len(dark["color"]) == len(light["color"]) else light["color"]]
    styles, rows = np.unique(np.concatenate(inks, axis=1), axis=0, return_inverse=True)
    commands["style"] = rows.ravel().astype(np.int32)
    colors = {theme: styles[:, 4 * i : 4 * i + 4].astype(np.uint8) for i, theme in enumerate(VIEWER_THEMES)}
    return {"commands": commands, "colors": colors}


def _with_letters(block: dict[str, Any]) -> dict[str, Any]:
    """Return a block of a legend whose rows have letters for signs."""
    if "rows" not in block:
        return block
    rows = [LegendRow(*row) for row in block["rows"]]
    return {**block, "rows": [(list(row.color), row.name, row.value, _SIGNS.get(row.sign, "")) for row in rows]}
