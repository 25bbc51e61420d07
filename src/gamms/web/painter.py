"""Prepare the data of pages, turn by turn: columns of agents, drawings, colors and captions.

A game is replayed in a separate context, whose artists draw all changes in both themes, as for pictures. The viewer
paints these draw commands, and interprets neither rules nor events. `columns.py` encodes the turns, `knowledge.py`
computes what agents sense and know; `docs/page-format.md` describes the format.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from functools import lru_cache
from typing import Any, Self

import numpy as np

from gamms.errors import BadValue
from gamms.ir import events as kinds
from gamms.ir.events import Log, list_events
from gamms.ir.game_state import as_named_edges
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.packing import to_bytes
from gamms.knowledge.fields import find_edge_rows, find_node_rows
from gamms.knowledge.sides import Side, label_sides
from gamms.plain import Plain, is_same
from gamms.recorder.detached import DetachedState
from gamms.recorder.replaying import Replayer
from gamms.recorder.resuming import open_context
from gamms.text import as_text
from gamms.typing import IArtist
from gamms.visual.artist import ArtistGroup, make_state_key
from gamms.visual.captions import UNMARKED, describe_ending, list_rises, write_captions
from gamms.visual.charts import select_charts
from gamms.visual.drawers.marks import get_drawn_marks
from gamms.visual.drawers.rules import find_teams_of_rules
from gamms.visual.legend import LegendRow, list_blocks, make_plain_block
from gamms.visual.recorded_drawings import RecordedDrawer
from gamms.visual.themes import THEMES
from gamms.web.bundle import VIEWER_THEMES
from gamms.web.columns import (
    ALIVE,
    FLIES,
    THERE,
    AgentsOnEdges,
    Change,
    Fact,
    FlyingAgents,
    Turn,
    convert_to_steps,
    encode_drawn_map,
    frame,
    make_part,
)
from gamms.web.knowledge import AgentFacts, KnowledgeTracker, SensedTurn, list_sides_of_agents

_STEPS = 1 << 15  # parts of the larger side of the map, some centimetres for a city
_PIXEL_STEP = 2.0**-4
_SIGNS = {  # characters for the signs of legends
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
    "range": "◌",
}

_UNREAD = {  # kinds of events that no artist reads
    kinds.GAME_FACTS,
    kinds.GAME_CHANCE,
    kinds.GAME_COLLECTED,
    kinds.GAME_PRIVATE_FACTS,
    kinds.AGENT_STRATEGY,
    kinds.AGENT_ATTRIBUTE,
    kinds.DELAYED_LOOKS,
    *kinds.COMPONENTS,
}
_QUIET = _UNREAD | {  # kinds of events that change neither rules nor teams nor the map
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
    kinds.GAME_NAMED_EDGES,
    kinds.GAME_DRIVEN,
    kinds.GAME_MESSAGE,
}
_LEAST = 1e-9
_ATTRIBUTES = {"highway", "name", "tunnel"}

Drawn = dict[str, Any]


class Painter:
    """Replays a game, and encodes its turns in parts for pages and streams.

    Args:
        header: the header of the recording, with the map.
        state: the keyframe of the first state.
        turns: the number of turns before this state.
    """

    def __init__(self, header: Mapping[str, Plain], state: dict[str, Plain], turns: int = 0) -> None:
        self._ctx: Any = open_context(0, None, is_quiet=True)
        self._ctx.record.is_replaying = True  # keeps recorded drawings
        self._replayer = Replayer(self._ctx)
        self._replayer.begin_with(dict(header), state)
        self._state = DetachedState(deepcopy(state), turns)
        sides: Any = header.get("sides") or ()
        self._sides = [side for side in sides if side is not None]
        self._at = turns
        self._is_whole = False
        self._edition = 0  # increases whenever rules, teams or the map may have changed
        self._edited_at = turns
        self._artists: dict[str, tuple[Any, dict[str, IArtist]]] = {}  # theme -> edition, artists by name
        self._read: dict[str, Any] = {}  # artist -> the inputs of its last drawing
        self._commands: dict[str, Drawn] = {}  # artist -> its last drawing in the first theme
        self._scores: dict[str, Any] = {}
        self._listed: tuple[Any, list[str], list[str]] = ((), [], [])  # version, names and sides of the agents
        self._slots: dict[str, bytes] = {}  # slot -> its current value, encoded
        self._values: dict[str, Plain] = {}  # slot -> its current value, for slots that are compared
        self._facts = AgentFacts(self._state)
        self._sights = KnowledgeTracker(self._ctx, self._step, self._ctx.visual.drawing.labels)
        self._looked: list[Mapping[str, Any]] = []  # the data of the last `SENSED` events
        self._following: Sequence[Mapping[str, Any]] = ()  # the data of those that follow the last turn, if known
        self._turns: list[Turn] = []  # turns for the next part
        self._last: Turn | None = None
        list(self._list_changes())
        list(self._facts.list_changes(None, self._get_game_turn()))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Terminate the context."""
        self._ctx.terminate()

    def begin(self) -> None:
        """Begin a part that can be read without earlier parts; it repeats the last turn."""
        changes = list(self._slots.items())
        facts = list(self._facts.list_present())
        last = self._make_turn({}, {}, [], [], [], None) if self._last is None else self._last
        self._turns = [last._replace(changes=changes, facts=facts, captions=[])]
        self._is_whole = True

    def restore(self, state: dict[str, Plain]) -> None:
        """Set the state to a keyframe."""
        self._replayer.apply(kinds.SNAPSHOT, state)
        self._state.restore(deepcopy(state))
        self._edition += 1
        self._edited_at = self._at
        self._last = None
        list(self._list_changes())
        list(self._facts.list_changes(None, self._get_game_turn()))

    def add(self, log: Log) -> None:
        """Apply the log of a turn, and add the turn to the next part."""
        events = list(list_events(log))
        self._looked = [data for kind, data in events if kind == kinds.SENSED] or self._looked
        self._following = ()
        has_sensed = any(kind == kinds.SENSED for kind, _ in events)
        sensed = self._sights.make_sensed_turn(self._looked, self._state) if has_sensed else None
        self._state.apply(log)
        self._replayer.play_log([one for one in log if type(one) is not tuple or one[0] not in _UNREAD])
        self._at += 1
        if any(kind not in _QUIET for kind, _ in events):
            self._edition += 1
            self._edited_at = self._at
        if any(kind in (kinds.WORLD, kinds.SENSORS, kinds.SNAPSHOT) for kind, _ in events):
            self._sights.forget()
        if sensed is not None:
            self._note_views(sensed)
        facts = list(self._facts.list_changes(log, self._get_game_turn()))
        ways = self._find_ways(events)
        named = self._find_named_edges(events)
        self._last = self._make_turn(
            ways, named, list(self._list_changes(events)), facts, list(self._write_captions(events)), sensed
        )
        self._turns.append(self._last)

    def look_ahead(self, looked: Sequence[Mapping[str, Any]]) -> None:
        """Take the sensor reports that follow the last turn: data of `SENSED` events; empty if they are unknown."""
        self._following = looked

    def encode_part(self, *, is_last: bool = True) -> bytes:
        """Encode the turns since the last call as a part; empty if there are none.

        Args:
            is_last: whether to include the sensor reports after the last turn; if they are unknown, earlier ones.
        """
        if not self._turns:
            return b""
        looked = self._following or self._looked
        rest = self._sights.make_sensed_turn(looked, self._state) if is_last and looked else None
        first = self._at - len(self._turns) + 1
        is_early = not self._following
        found = make_part(first, self._turns, self._step(), is_whole=self._is_whole, rest=rest, is_early=is_early)
        self._turns = []
        self._is_whole = False
        return frame(found)

    def _note_views(self, sensed: SensedTurn) -> None:
        """Note which agents each side saw when the turn began, to tell which sides know of its events."""
        columns = self._state.agents.columns
        side_of = dict(zip(columns["names"], list_sides_of_agents(columns), strict=True))
        seen: dict[Side, set[str]] = {}
        for look in sensed.looks:
            if look.agent in side_of:
                seen.setdefault(side_of[look.agent], set()).update(name for name, _ in look.seen.agents)
        for side, names in seen.items():
            self._ctx.visual.drawing.events.views.note(self._get_game_turn(), side, names)

    def _get_game_turn(self) -> int:
        game = self._ctx.current_game
        return 0 if game is None else int(game.turn)

    def _step(self) -> float:
        step: float = self._ctx.visual.drawing.of_map(_step)
        return step

    # -- columns ------------------------------------------------------------------------------------------------

    def _make_turn(
        self,
        ways: Mapping[int, Sequence[int]],
        named: Mapping[int, int],
        changes: Sequence[Change],
        facts: Sequence[Fact],
        captions: Sequence[Drawn],
        sensed: SensedTurn | None,
    ) -> Turn:
        """Return the turn with the current state of agents."""
        columns = self._state.agents.columns
        flies = columns["kind"] != 0
        status = THERE + ALIVE * (columns["alive"] != 0) + FLIES * flies
        nodes = find_node_rows(self._ctx.graph, columns["node"])
        on_edge = np.flatnonzero((columns["edge_share"] > 0.0) & ~flies)
        ends = [find_node_rows(self._ctx.graph, columns[name][on_edge]) for name in ("edge_source", "edge_target")]
        on_edges = AgentsOnEdges(on_edge, np.column_stack(ends), columns["edge_share"][on_edge])
        in_air = np.flatnonzero(flies & np.isfinite(columns["position"]).all(axis=1))
        headings = _compute_headings(columns["quat"][in_air])
        air = FlyingAgents(in_air, columns["position"][in_air], headings)
        version = self._state.agents, self._state.agents.version
        if version != self._listed[0]:
            found = list_sides_of_agents(columns)
            labels = label_sides(found, self._ctx.visual.drawing.labels)
            self._listed = version, list(columns["names"]), [labels[side] for side in found]
        _, names, sides = self._listed
        messages = self._facts.messages
        return Turn(names, status, nodes, sides, on_edges, air, ways, named, messages, changes, facts, captions, sensed)

    def _find_named_edges(self, events: Sequence[tuple[int, Any]]) -> dict[int, int]:
        """Return row of an agent -> row of the edge that its action has named, for those that took one in a turn."""
        agents = self._state.agents
        named: dict[str, tuple[int, int]] = {}
        for kind, data in events:
            if kind == kinds.GAME_NAMED_EDGES:
                named = as_named_edges(data["named_edges"])
        there = {name: edge for name, (_, edge) in named.items() if name in agents.columns["names"]}
        edges = find_edge_rows(self._ctx.graph, [*there.values()]).tolist()
        return dict(zip(map(agents.find_row, there), edges, strict=True))

    def _find_ways(self, events: Sequence[tuple[int, Any]]) -> dict[int, list[int]]:
        """Return row of an agent -> rows of passed nodes, see `columns.Turn.ways`."""
        agents = self._state.agents
        passed: dict[int, list[int] | None] = {}  # agent number -> node ids; None: its position was set
        for kind, data in events:
            if kind == kinds.MOVES:
                moves = np.asarray(data).tolist()
                for number, node in zip(moves[::2], moves[1::2], strict=True):
                    known = passed.setdefault(number, [])
                    if known is not None:
                        known.append(node)
            elif kind == kinds.AGENT_CURRENT_NODE and data["agent_name"] in agents.columns["names"]:
                passed[int(agents.columns["numbers"][agents.find_row(data["agent_name"])])] = None
            elif kind == kinds.SNAPSHOT:
                passed = dict.fromkeys(agents.columns["numbers"].tolist())
        long = {number: way or [] for number, way in passed.items() if not way or len(way) > 1}
        row_of = {number: row for row, number in enumerate(agents.columns["numbers"].tolist())} if long else {}
        found = {row_of[number]: way for number, way in long.items() if number in row_of}
        return {row: find_node_rows(self._ctx.graph, way).tolist() for row, way in found.items()}

    # -- slots --------------------------------------------------------------------------------------------------

    def _list_changes(self, events: Sequence[tuple[int, Any]] = ()) -> Iterator[Change]:
        """Yield the changed slots."""
        game = self._state.game
        scores = {as_text(of): score for of, score in dict(game.scores).items()}
        values: dict[str, Plain] = {"scores": scores, "is_over": game.over is not None}
        if game.collected or "charts" in self._slots:
            values["charts"] = dict[str, Plain](select_charts(game.collected))
        if self._values.get("edition") != self._edition:
            self._values["edition"] = self._edition
            values["colors"] = self._find_team_colors()
        for slot, value in values.items():
            if slot not in self._slots or not is_same(value, self._values[slot]):
                self._values[slot] = value
                yield self._put(slot, value)
        for kind, data in events:
            if kind == kinds.WORLD:
                yield self._put("world", map_for_viewer(data["world"]))
        for drawing in self._list_changed_drawings():
            slot = f"drawing {drawing['artist']}"
            if "commands" in drawing:
                yield self._put(slot, drawing)
            else:
                yield slot, to_bytes(None, slot)
                del self._slots[slot]

    def _put(self, slot: str, value: Plain) -> Change:
        self._slots[slot] = to_bytes(value, f"The {slot} of a page")
        return slot, self._slots[slot]

    def _find_team_colors(self) -> dict[str, Any]:
        """Return side -> theme -> color, 0 to 255."""
        drawing = self._ctx.visual.drawing
        more = [*self._sides, *sorted(find_teams_of_rules(self._ctx))]
        found: dict[str, Any] = {}
        for theme in VIEWER_THEMES:
            with drawing.themed(THEMES[theme]):
                for side, color in drawing.group_colors(more).items():
                    found.setdefault(side, {})[theme] = list(color)
        return found

    # -- drawings -----------------------------------------------------------------------------------------------

    def _list_changed_drawings(self) -> list[Drawn]:
        """Return the changed drawings; removed drawings have only the name of their artist."""
        first, second = VIEWER_THEMES
        artists = self._list_signs(first)
        drawn = {name: self._get_drawing(name, artist, first) for name, artist in artists.items()}
        now = {name: commands for name, commands in drawn.items() if commands is not None}
        before = self._commands
        self._commands = now
        changed = [name for name, one in now.items() if not is_same(one, before.get(name))]
        gone = [name for name in before if name not in now]
        others = self._list_signs(second) if changed else {}
        found: list[Drawn] = [{"artist": name} for name in gone]
        for name in changed:
            other = self._draw_artist(name, others.get(name, artists[name]), second) or now[name]
            found.append(self._make_drawing(name, artists[name], now[name], other))
        return found

    def _list_signs(self, theme: str) -> dict[str, IArtist]:
        artists = self._ctx.visual.artists
        key = (self._edition, self._ctx.visual.artists.edits)
        if self._artists.get(theme, (None,))[0] != key:
            with self._ctx.visual.drawing.themed(THEMES[theme]):
                self._artists[theme] = key, artists.list_signs()
        return self._artists[theme][1]

    def _get_drawing(self, name: str, artist: IArtist, theme: str) -> Drawn | None:
        """Return the drawing of an artist; if its inputs are unchanged, artists with `settles_in` are not called."""
        settles = getattr(artist.get_drawer(), "settles_in", None)
        key = self._edition, make_state_key(name, artist), artist.get_visible()
        is_settled = settles is not None and self._at - self._edited_at > settles
        if not is_settled or self._read.get(name) != key:
            self._read[name] = key
            return self._draw_artist(name, artist, theme)
        return self._commands.get(name)

    def _draw_artist(self, name: str, artist: IArtist, theme: str) -> Drawn | None:
        """Return the drawing of an artist in a theme: plain commands, layer and legend; None: it draws nothing."""
        if not artist.get_visible():
            return None
        with self._ctx.visual.drawing.themed(THEMES[theme]):
            commands = ArtistGroup(self._ctx, {name: artist}).draw_artists()
            legend = [make_plain_block(block) for block in list_blocks(self._ctx, {name: artist})]
        try:
            plain = commands.to_plain()
        except BadValue:  # the drawing has too many points
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

    def _make_drawing(self, name: str, artist: IArtist, first: Drawn, second: Drawn) -> Drawn:
        """Return a drawing in the format of pages, with the colors of both themes."""
        drawer = artist.get_drawer()
        step = self._step()
        found: Drawn = {
            "artist": name,
            "layer": int(first["layer"]),
            "in_fog": bool(getattr(drawer, "is_in_fog", False)),
            "follows": not getattr(drawer, "once_a_turn", False),
            **convert_drawing(first["commands"], second["commands"], step),
        }
        legend = [_replace_signs(block) for block in first["legend"]]
        if legend:
            found["legend"] = legend
        if first["facts"]:
            found["facts"] = first["facts"]
        marks = get_drawn_marks(artist)
        if marks:
            shifts = [(one.shift[0] * one.least_px, one.shift[1] * one.least_px) for one in marks]
            found["marks"] = {
                "names": [one.name for one in marks],
                "places": np.array([one.current_position for one in marks], np.float64),
                "shifts": np.array(shifts, np.float64),
                "radius": float(marks[0].least_px),
            }
        if isinstance(drawer, RecordedDrawer) and name in self._ctx.visual.artists.drawings.starts:
            found["start"] = convert_to_steps(self._ctx.visual.artists.drawings.starts[name].points, step)
        return found

    # -- captions -----------------------------------------------------------------------------------------------

    def _write_captions(self, happened: Sequence[tuple[int, Any]]) -> Iterator[Drawn]:
        """Yield the captions of a turn: `words`, the `agent` or side, and whether it is `marked` and `major`."""
        events = list[Any]()
        later = list[Drawn]()
        for kind, data in happened:
            if kind in (kinds.GAME_EVENT, kinds.USER_EVENT):
                events.append(data)
            elif kind == kinds.GAME_SCORES:
                risen = list_rises(data["scores"], self._scores)
                later += [{"words": words, "agent": of, "major": True, "marked": True} for words, of in risen]
            elif kind == kinds.GAME_OVER and data:
                winner = data.get("winner")
                agent = None if winner is None else as_text(winner)
                later.append({"words": ": ".join(describe_ending(data)), "agent": agent, "major": True, "marked": True})
        is_marked = any(event.get("kind") not in UNMARKED for event in events)
        for words, name in write_captions(events):
            yield {"words": words, "agent": None if name is None else str(name), "major": False, "marked": is_marked}
        yield from later


def _step(columns: GraphColumns) -> float:
    """Return the unit of points, map units: a power of two, small on the map and in pixels."""
    extent = float(np.ptp(columns.xy, axis=0).max()) if len(columns.xy) else 0.0
    return min(_PIXEL_STEP, float(2.0 ** np.floor(np.log2(extent / _STEPS)))) if extent > 0.0 else _PIXEL_STEP


def _compute_headings(quat: FloatArray) -> FloatArray:
    """Return headings (agents,) in radians from quaternions (agents, 4); NaN: straight up or down, or undefined."""
    w, x, y, z = quat.T
    cos = 1.0 - 2.0 * (y * y + z * z)
    sin = 2.0 * (x * y + w * z)
    with np.errstate(invalid="ignore"):
        found: FloatArray = np.where(np.hypot(cos, sin) > _LEAST, np.arctan2(sin, cos), np.nan)
    return found


@lru_cache(maxsize=2)  # restarted games have the same map
def map_for_viewer(world: bytes) -> bytes:
    """Convert the bytes of a saved map to the format of the viewer."""
    return encode_drawn_map(world, _ATTRIBUTES)


def convert_drawing(light: Drawn, dark: Drawn, step: float) -> Drawn:
    """Return the `commands` of a drawing in the format of pages, and the `colors` of their styles by theme.

    Args:
        light: the commands in the light theme, as plain values.
        dark: the commands in the dark theme.
        step: the unit of points.
    """
    commands = {**light, "step": step, "points": convert_to_steps(light["points"], step)}
    del commands["color"]
    inks = [light["color"], dark["color"] if len(dark["color"]) == len(light["color"]) else light["color"]]
    styles, rows = np.unique(np.concatenate(inks, axis=1), axis=0, return_inverse=True)
    commands["style"] = rows.ravel().astype(np.int32)
    colors = {theme: styles[:, 4 * i : 4 * i + 4].astype(np.uint8) for i, theme in enumerate(VIEWER_THEMES)}
    return {"commands": commands, "colors": colors}


def _replace_signs(block: dict[str, Any]) -> dict[str, Any]:
    """Replace the signs in a block of a legend by characters."""
    if "rows" not in block:
        return block
    rows = [LegendRow(*row) for row in block["rows"]]
    return {**block, "rows": [(list(row.color), row.name, row.value, _SIGNS.get(row.sign, "")) for row in rows]}
