"""The overlay of a window: trails, hints, names and facts; `panels.py` paints the text."""

from collections.abc import Callable
from math import floor, log
from typing import Any

import numpy as np

from gamms.deciding import Guarded, get_phase, refuse_while_deciding
from gamms.ir.game_state import ALL_PLAYED
from gamms.ir.graph import FloatArray
from gamms.knowledge.sides import Side, find_side_of
from gamms.text import as_text
from gamms.typing import IArtist, IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import AgentData, parse_color
from gamms.visual.artist import collect_drawn_looks, list_looks
from gamms.visual.artists import Artists
from gamms.visual.backends.pygame_backend import Canvas
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Point, WindowCamera, find_nearest_point
from gamms.visual.captions import (
    CAPTION_SECONDS,
    CaptionLine,
    Captions,
    ResultCard,
    end_card,
    find_scores,
    score_line,
)
from gamms.visual.charts import ChartHistory
from gamms.visual.default_scene import DefaultScene, make_sight_artists
from gamms.visual.drawing import Drawing
from gamms.visual.labels import AUTO, Choice, Labels, convert_dots, draw_names
from gamms.visual.layout import Layout
from gamms.visual.legend import LegendRows, Pen
from gamms.visual.page import add_source
from gamms.visual.themes import Theme
from gamms.visual.window.display import FrameTiming
from gamms.visual.window.input import NodeChoice, Question
from gamms.visual.window.panels import BADGE_PX, EDGE_PX, Hud, HudLines
from gamms.visual.window.timeline import FOOT_PX, Timeline

_DEFAULT_TRAILS = 8  # turns, where they are switched on by key
# radius of agents: so large, or larger by less than a step of the zoom
_LARGEST_PX = 12.0
_SIZE_STEP = 1.25
_BESIDE_PX = 10.0  # between an agent and its panel


class Overlay(Guarded):
    """Trails, names, the view of the agent under the pointer, and text, which a window shows beside the artists.

    Args:
        ctx: the context.
        drawing: of the window.
        artists: the declared artists.
        camera: of the window.
        pace: the frame timing of the window.
        theme: the theme.

    Attributes:
        hud: paints the text.
        timeline: the timeline at the lower edge.
        shown: the artists of the turn that is shown.
        trails: of how many turns the ways of agents are shown.
        most_trails: of how many, while they are.
        has_captions: whether captions are shown.
        captions: the captions of the last turns.
        labels: whose names are shown.
        has_street_names: whether streets have names where the map is shown close by.
        turns: how many were shown.
        is_over: whether the game, or its recording, has come to its end, which a card says.
        is_replay: whether the turns are those of a recording.
        pointer: the point of the screen under the mouse, if any.
    """

    _called = "ctx.visual.overlay"

    def __init__(
        self, ctx: IContext, drawing: Drawing, artists: Artists, camera: WindowCamera, pace: FrameTiming, theme: Theme
    ) -> None:
        self._phase = get_phase(ctx)
        self._ctx = ctx
        self._drawing = drawing
        self._artists = artists
        self._camera = camera
        self._pace = pace
        self._scene = DefaultScene(ctx, theme)
        self.hud = Hud(theme)
        self.timeline = Timeline(self._find_team)
        self.shown: dict[str, IArtist] = {}
        self.trails = 0
        self.most_trails = _DEFAULT_TRAILS
        self.labels: Choice = AUTO
        self._names = Labels()
        self.turns = 0
        self.has_street_names = True
        self.is_over = False
        self.is_replay = False
        self.has_captions = True
        self._captions = Captions(ctx, drawing)
        self.captions: tuple[CaptionLine, ...] = ()
        self._charts = ChartHistory()
        self.pointer: Callable[[], Point | None] = lambda: None
        self._share = 1.0
        self._pinned: str | None = None
        self._dismissed: int | None = None  # the turn whose card is not shown
        self._failed: Any = None
        self._hinted: tuple[str | None, dict[str, IArtist]] = None, {}  # the agent under the pointer, and its sight

    def set_theme(self, theme: Theme) -> None:
        """Set the theme."""
        self._scene = DefaultScene(self._ctx, theme)
        self.hud.set_theme(theme)
        self.shown = {}

    def clear_timeline(self) -> None:
        """Clear all events, because another game follows."""
        self.timeline = Timeline(self._find_team)
        self._charts = ChartHistory()

    def _find_team(self, name: str) -> str | None:
        agent = self._ctx.agent.agents.get(name)
        return None if agent is None else self._drawing.label_side(find_side_of(agent))

    def show_captions(self, side: Side | None, turn_seconds: float, *, after_jump: bool = False) -> None:
        """Show captions of the present turn, and for some seconds of earlier turns.

        Args:
            side: the side whose knowledge is shown; None: everything is shown.
            turn_seconds: how long a turn is shown.
            after_jump: whether the turns before it were not shown.
        """
        if (game := self._ctx.current_game) is not None:
            self._charts.note(self.turns, game.internals.state.collected)
        if after_jump:
            self._captions = Captions(self._ctx, self._drawing)
        shown_seconds = turn_seconds / self._pace.speed
        self._captions.turns = max(1, round(CAPTION_SECONDS / shown_seconds)) if shown_seconds else 1
        self.captions = self._captions.make_captions(side).lines if self.has_captions else ()

    def keep_trails(self, turns: int) -> None:
        """Set the number of turns of trails; 0 hides trails until they are switched on."""
        self.trails = turns
        self.most_trails = turns or _DEFAULT_TRAILS

    # -- artists ---------------------------------------------------------------------------------------------

    def begin_turn(self) -> None:
        """Update the artists of pictures, in the colors of the theme, and the trails."""
        self.shown = self._artists.list_shown(self.trails, self._scene)
        self._hinted = None, {}

    def limit_sizes(self) -> None:
        """Limit the size of default agents when zooming in, in steps, because each new size needs a new drawing."""
        step = _SIZE_STEP ** floor(log(self._camera.scale, _SIZE_STEP))
        if self._scene.limit_marks(_LARGEST_PX / step):
            self.shown = {}

    def list_artists(self, share: float) -> dict[str, IArtist]:
        """Return the artists of a frame, after a share of the agents' last moves."""
        self._share = share
        return self.shown | self.list_hints()

    def list_hints(self) -> dict[str, IArtist]:
        """Return artists of the view of the agent under the pointer, unless it is already shown."""
        name = self._find_pointed_name()
        if name != self._hinted[0]:
            self._hinted = name, {} if name is None else self._make_hints(name)
        return self._hinted[1]

    def _make_hints(self, name: str) -> dict[str, IArtist]:
        agent: Any = self._ctx.agent.get_agent(name)
        look = next((look for look in list_looks(self.shown) if look.name == name), AgentData(name))
        fog = self._artists.fog
        if fog is None:
            sights = [self._drawing.carriers.sight(sensor, agent) for sensor in getattr(agent, "sensors", {}).values()]
        else:
            sights = [one for one in fog.sights if one.carrier == name]
        unseen = [one for one in sights if one.view is not None and f"sensor_{one.sensor.sensor_id}" not in self.shown]
        colored = {one.sensor.sensor_id: [(parse_color(look.color)[:3], one.view)] for one in unseen}
        hints: dict[str, IArtist] = {**make_sight_artists(self._ctx, colored, look.size, self._artists.declared)}
        return {f"{key} of the hint" if key in ("rings", "sights") else key: artist for key, artist in hints.items()}

    # -- agents under the pointer ----------------------------------------------------------------------------

    @refuse_while_deciding
    def pin(self, at: tuple[float, float] | None) -> None:
        """Pin the panel of the agent at a point of the screen; unpin it if there is no agent, or for None."""
        self._pinned = None if at is None else self._find_agent(at)

    def describe_pointed(self) -> tuple[list[str], tuple[float, float], float] | None:
        """Return text about the agent under the pointer, else about the clicked one.

        Also where it is on the screen, and how many pixels beside it words begin.
        """
        name = self._find_pointed_name()
        if name is None:
            return None
        names, columns = collect_drawn_looks(self.shown)
        if name not in names:
            return None
        row = names.index(name)
        dots = convert_dots(columns[row : row + 1], self._camera.camera())
        x, y = dots.centers[0].tolist()
        fog = self._artists.fog
        facts = list_facts_about(self._ctx, name)
        known = facts if fog is None or fog.is_own(name) else facts[:1]
        return known, (x, y), float(dots.radii[0]) + _BESIDE_PX

    def _find_pointed_name(self) -> str | None:
        pointer = self.pointer()
        name = None if pointer is None else self._find_agent(pointer)
        if (
            name is None
            and self._pinned in self._ctx.agent.agents
            and self._pinned not in self._drawing.hidden_agents(self._share)
        ):
            name = self._pinned
        return name

    def _find_agent(self, at: tuple[float, float]) -> str | None:
        names, columns = collect_drawn_looks(self.shown)
        row = find_nearest_point(convert_dots(columns, self._camera.camera()).centers, *at)
        name = None if row is None else names[row]
        return name if name in self._ctx.agent.agents else None

    # -- words -----------------------------------------------------------------------------------------------

    def write_turn_lines(self, ctx: IContext) -> list[str]:
        """Return the default lines of `hud`: the turn, the scores unless the legend has them, and who is left."""
        game = ctx.current_game
        turn = self.turns if game is None or not game.turn else game.turn
        speed = "" if self._pace.speed == 1.0 else f" · {self._pace.speed:g}x"
        scores = find_scores(ctx, self.timeline.scores)
        explained = {
            row.name for block in self.hud.legend.blocks if isinstance(block, LegendRows) for row in block.rows
        }
        is_said = self.hud.legend.width > 0 and scores.keys() <= explained
        return [
            f"turn {turn}{speed}",
            *([] if is_said or not scores else [score_line(scores)]),
            *self._describe_survivors(),
        ]

    def _describe_survivors(self) -> list[str]:
        """Return how many of each team are left, once an agent is out."""
        positions = self._ctx.agent.positions
        teams = positions.teams
        living = positions.living.tolist()
        if len(living) == len(teams):
            return []
        left = dict.fromkeys((as_text(team) for team in teams if team is not None), 0)
        for row in living:
            if teams[row] is not None:
                left[str(teams[row])] += 1
        return ["left: " + score_line(left)] if left else []

    def write_lines(self, write: HudLines | None) -> list[str]:
        """Return the lines of a function of the context; an error is logged once."""
        if write is None:
            return []
        try:
            return [str(line) for line in write(self._ctx)]
        except Exception as error:  # noqa: BLE001 - user code, as a drawer is
            if self._failed is not write:  # once, not in each of sixty frames a second
                self._failed = write
                self._ctx.logger.error(f"The HUD could not be written: {type(error).__name__}: {error}")  # noqa: TRY400
            return []

    @property
    def foot(self) -> int:
        """Pixels along the lower edge that the timeline takes, if it is shown, besides the usual distance of panels."""
        return FOOT_PX if self.hud.is_shown and self.timeline.is_shown else 0

    def paint(self, canvas: Canvas, write: HudLines | None, question: Question | None) -> None:
        """Paint names, the text that a function writes, the timeline, a person's choices, and how the game ended."""
        self._paint_names(canvas)
        lines = self.write_lines(write) if self.hud.is_shown else []
        if self._ctx.is_terminated():  # the function that makes the lines -> the lines
            return
        has_line = self.foot > 0
        foot = self.foot
        credit = add_source(self._ctx, "")
        has_hint = write == self.write_turn_lines
        prompt = self._prompt(question)
        self.hud.paint(canvas, lines, prompt, credit, foot, has_hint=has_hint)
        if self.hud.is_shown and self._artists.fog is None:  # a team does not know what the program collects
            lines_of_charts = self._charts.list_lines(self.turns)
            self.hud.paint_charts(canvas, lines_of_charts, self._drawing.group_colors(), self._find_team)
        card = self.get_card() if self.hud.is_shown else None
        if self.captions and self.hud.is_shown and not self.hud.has_help and card is None:
            self.hud.paint_captions(canvas, self.captions)
        if has_line:
            done = self.turns - (1.0 - self._share)
            is_running = not self._pace.is_halted
            colors = self._drawing.group_colors()
            self.timeline.paint(canvas, self.hud.theme, colors, self.turns, done, is_running=is_running)
        if isinstance(question, NodeChoice):
            self._paint_choices(canvas, question)
        if card is not None:
            self.hud.paint_card(canvas, card)
        found = self.describe_pointed()
        if found is not None:
            self.hud.paint_facts(canvas, *found)
        pointer = self.pointer()
        if has_line and pointer is not None and (words := self.timeline.describe_events(pointer)):
            self.hud.paint_facts(canvas, words, (pointer[0], canvas.height - EDGE_PX - foot), EDGE_PX)

    def _prompt(self, question: Question | None) -> list[str]:
        if question is not None:
            return [question.words, *([question.hint] if question.hint else [])]
        is_said = self._pace.is_paused and not self.timeline.can_seek
        return ["paused: space goes on, . shows one turn"] if is_said else []

    def get_card(self) -> ResultCard | None:
        """Return the result of the game; None while the game runs, or after the card was dismissed."""
        if not self.is_over or self._share < 1.0 or self._dismissed == self.turns:
            return None
        reason = "end of the recording" if self.is_replay else ALL_PLAYED
        return end_card(self._ctx, self.turns, self.timeline.scores, reason)

    @refuse_while_deciding
    def dismiss(self) -> bool:
        """Dismiss the result card; return False if there is none."""
        is_shown = self.get_card() is not None
        if is_shown:
            self._dismissed = self.turns
        return is_shown

    def _paint_choices(self, canvas: Canvas, question: NodeChoice) -> None:
        """Paint the number of each choice beyond it, seen from the one who is asked, where no other number is."""
        places = self._camera.camera().to_screen(question.places)
        for number, way in enumerate(_compute_directions(places)):
            self.hud.paint_badge(canvas, str(number), places[number] + _find_directions(way))
        half = BADGE_PX / 2
        self.hud.layout.cover(np.hstack([places - half, places + half]))

    def _paint_names(self, canvas: Canvas) -> None:
        """Paint names on the map, but not below the panels of the previous frame."""
        layout = Layout((0.0, 0.0, canvas.width, canvas.height - self.foot), self.hud.layout.areas)
        view = self._camera.camera()
        theme = self.hud.theme
        pen = Pen(view, 1.0, theme.ink[:3])
        draw_names(
            pen,
            1.0,
            self._ctx,
            self.shown,
            self._names,
            layout,
            choice=self.labels,
            has_streets=self.has_street_names,
        )
        paper = Canvas(canvas.width, canvas.height, canvas.surface, paper=theme.background[:3])
        Painting(pen.commands.freeze()).paint(paper, view)

    # -- keys ----------------------------------------------------------------------------------------------

    @refuse_while_deciding
    def toggle_labels(self) -> None:
        """Toggle the names of agents."""
        self.labels = not (self._names.are_shown if self.labels == AUTO else self.labels)

    @refuse_while_deciding
    def toggle_trails(self) -> None:
        """Toggle trails."""
        self.trails = 0 if self.trails else self.most_trails
        self.shown = {}


def list_facts_about(ctx: IContext, name: str) -> list[str]:
    """Return a few lines about an agent: name, team, position, and the last data of its sensors."""
    agent: Any = ctx.agent.get_agent(name)
    team = getattr(agent, "team", None)
    lines = [name if team is None else f"{name} · team {team}"]
    if agent.type == AgentType.AERIAL:
        x, y, z = agent.position
        lines.append(f"at ({x:.1f}, {y:.1f}), {z:.1f} up")
    else:
        lines.append(f"at node {agent.current_node_id}, from {agent.prev_node_id}")
    if not getattr(agent, "alive", True):
        lines.append("out of the game")
    sensed = agent.state.get("sensor") if isinstance(agent.state, dict) else None
    for sensor, (kind, data) in (sensed or {}).items():
        lines.append(f"{sensor} ({getattr(kind, 'name', kind)}): {_summarize_data(data)}")
    return lines


def _summarize_data(data: object) -> str:
    """Return a short text about the data of a sensor."""
    if isinstance(data, dict):
        counts = [f"{len(part)} {name}" for name, part in data.items() if isinstance(part, dict | list | tuple | set)]
        if counts and len(counts) == len(data):
            return ", ".join(counts)
    if isinstance(data, dict | list | tuple | set):
        few = ", ".join(map(str, data)) if len(data) <= 6 else ""
        if 0 < len(few) <= 40:
            return few
        return f"{len(data)} seen" if data else "nothing"
    words = str(data)
    return words if len(words) <= 40 else words[:39] + "…"


_TURNS = (0.0, 0.5, -0.5, 1.0, -1.0, 1.6, -1.6, 2.4, -2.4)  # radians: rotations of a number to avoid others
_OUT_PX = BADGE_PX + 18 * np.arange(6.0)  # from its node, if no direction nearer to it is free


def _compute_directions(places: FloatArray) -> FloatArray:
    """Return unit vectors (places, 2) from the first place to the others; its own is into the widest gap."""
    ways: FloatArray = places - places[0]
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    ways[lengths > 0] /= lengths[lengths > 0, None]
    angles: FloatArray = np.sort(np.arctan2(ways[1:, 1], ways[1:, 0]))
    middle = -np.pi / 2  # up
    if len(angles):
        gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
        middle = angles[gaps.argmax()] + gaps.max() / 2
    ways[lengths == 0] = np.cos(middle), np.sin(middle)
    return ways


def _find_directions(way: FloatArray) -> FloatArray:
    """Return where a number may stand (places, 2), seen from its node, whose way out is a unit vector (2,)."""
    cos = np.cos(_TURNS)
    sin = np.sin(_TURNS)
    turned = np.column_stack([way[0] * cos - way[1] * sin, way[0] * sin + way[1] * cos])
    places: FloatArray = (_OUT_PX[:, None, None] * turned).reshape(-1, 2)
    return places
