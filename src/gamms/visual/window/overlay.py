"""What a window shows beside the artists: trails, hints, names and facts; `panels.py` paints the words."""

from collections import deque
from collections.abc import Callable
from itertools import chain
from typing import Any

import numpy as np

from gamms.deciding import Guarded, phase_of, refused_while_deciding
from gamms.typing import IArtist, IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import AgentData, rgba
from gamms.visual.artist import Artist, looks_of
from gamms.visual.artists import Artists
from gamms.visual.backends.pygame_backend import Canvas
from gamms.visual.camera import Point, WindowCamera, nearest_point
from gamms.visual.constants import Layer
from gamms.visual.default_scene import DefaultScene, artists_of_sights
from gamms.visual.drawers.agents import RING, RING_PX
from gamms.visual.drawing import Drawing, drawing_of
from gamms.visual.page import noted
from gamms.visual.shown_turn import Motion, Moves
from gamms.visual.window.display import Pace
from gamms.visual.window.input import Question, Walk
from gamms.visual.window.panels import Hud, HudLines, Theme, score_line

_USUAL_TRAILS = 8  # turns, where they are switched on by key
_BESIDE_PX = 10.0  # between an agent and its panel
_CELL_PX = 9  # of the grid that keeps labels apart
_NAME_PX = 12  # how high a name is


class Overlay(Guarded):
    """Trails, names, the view of the agent under the pointer, and text, which a window shows beside the artists.

    Args:
        ctx: the context.
        drawing: of the window.
        artists: those that were declared.
        camera: of the window.
        pace: of the window.
        theme: its colours.

    Attributes:
        hud: the text.
        shown: the artists of the turn that is shown.
        trails: the ways of agents.
        has_labels: whether agents have their names beside them.
        turns: how many were shown.
        pointer: the point of the screen under the mouse, if any.
    """

    _called = "ctx.visual.overlay"

    def __init__(
        self, ctx: IContext, drawing: Drawing, artists: Artists, camera: WindowCamera, pace: Pace, theme: Theme
    ) -> None:
        self._phase = phase_of(ctx)
        self._ctx, self._drawing, self._artists, self._camera, self._pace = ctx, drawing, artists, camera, pace
        self._scene = DefaultScene(ctx, theme.map)
        self.hud = Hud(theme)
        self.shown: dict[str, IArtist] = {}
        self.trails, self._usual_trails = Trails(0), _USUAL_TRAILS
        self.has_labels, self.turns = False, 0
        self.pointer: Callable[[], Point | None] = lambda: None
        self._share = 1.0
        self._pinned: str | None = None
        self._fps = (0, "")
        self._failed: Any = None
        self._hinted: tuple[str | None, dict[str, IArtist]] = None, {}  # the agent under the pointer, and its sight

    def keep_trails(self, turns: int) -> None:
        """Show trails of so many turns; 0 shows none until they are switched on."""
        self.trails.turns, self._usual_trails = max(turns, 0), turns or _USUAL_TRAILS

    # -- artists ---------------------------------------------------------------------------------------------

    def begin_turn(self) -> None:
        """Look up which artists draw: those of pictures, in the colours of the theme, and the trails."""
        artists = self._artists.shown(self._scene)
        if self.trails.turns:
            hidden = self._drawing.hidden_agents()
            colors = {look.name: look.color for look in looks_of(artists) if look.name not in hidden}
            for name, drawer in (("past trails", self.trails.draw_past), ("trails", self.trails.draw_last)):
                artists[name] = trails = Artist(self._ctx, drawer, Layer.TRAILS)
                trails.data = {"colors": colors}
        self.shown = artists
        self._hinted = None, {}

    def at(self, share: float) -> dict[str, IArtist]:
        """Return the artists of a frame, after a share of the agents' last moves."""
        self._share = share
        return self.shown | self.hints()

    def hints(self) -> dict[str, IArtist]:
        """Return artists of what the agent under the pointer sees, as far as it is not shown already."""
        name = self._pointed_name()
        if name != self._hinted[0]:
            self._hinted = name, {} if name is None else self._hints_of(name)
        return self._hinted[1]

    def _hints_of(self, name: str) -> dict[str, IArtist]:
        agent: Any = self._ctx.agent.get_agent(name)
        look = next((look for look in looks_of(self.shown) if look.name == name), AgentData(name))
        sights = [self._drawing.carriers.sight(sensor, agent) for sensor in getattr(agent, "sensors", {}).values()]
        unseen = [one for one in sights if one.view is not None and f"sensor_{one.sensor.sensor_id}" not in self.shown]
        colored = {one.sensor.sensor_id: [(rgba(look.color)[:3], one.view)] for one in unseen}
        hints: dict[str, IArtist] = {**artists_of_sights(self._ctx, colored, look.size, self._artists.declared)}
        return {"rings of the hint" if key == "rings" else key: artist for key, artist in hints.items()}

    # -- agents under the pointer ----------------------------------------------------------------------------

    @refused_while_deciding
    def pin(self, at: tuple[float, float]) -> None:
        """Keep the panel of the agent at a point of the screen; where there is none, keep none."""
        self._pinned = self._agent_at(at)

    @refused_while_deciding
    def unpin(self) -> None:
        """Keep no panel."""
        self._pinned = None

    def pointed_at(self) -> tuple[list[str], tuple[float, float], float] | None:
        """Return what is known about the agent under the pointer, else about the one that was clicked.

        Also where it is on the screen, and how many pixels beside it words begin.
        """
        name = self._pointed_name()
        if name is None:
            return None
        look = next((look for look in self._placed_looks() if look.name == name), None)
        if look is None or look.current_position is None:
            return None
        radius = max(look.size * self._camera.scale, look.least_px)
        at = self._camera.world_to_screen(*look.current_position)
        return facts_about(self._ctx, look.name), at, radius + _BESIDE_PX

    def _pointed_name(self) -> str | None:
        pointer = self.pointer()
        name = None if pointer is None else self._agent_at(pointer)
        if (
            name is None
            and self._pinned in self._ctx.agent.agents
            and self._pinned not in self._drawing.hidden_agents(self._share)
        ):
            name = self._pinned
        return name

    def _agent_at(self, at: tuple[float, float]) -> str | None:
        looks = self._placed_looks()
        if not looks:
            return None
        places = np.array([look.current_position for look in looks], np.float64)
        row = nearest_point(self._camera.camera().to_screen(places), *at)
        name = None if row is None else looks[row].name
        return name if name in self._ctx.agent.agents else None

    # -- words -----------------------------------------------------------------------------------------------

    def turn_lines(self, ctx: IContext) -> list[str]:
        """Return what `hud` says unless it is replaced: turn, scores, frames per second."""
        game = ctx.current_game
        turn = self.turns if game is None or not game.turn else game.turn
        speed = "" if self._pace.speed == 1.0 else f" · {self._pace.speed:g}x"
        lines = [f"turn {turn}{speed}"]
        if game is not None and game.scores:
            lines.append(score_line(game.scores))
        return [*lines, *self._left(), self._frames_per_second()]

    def _left(self) -> list[str]:
        """Return how many of each team are left, once an agent is out."""
        positions = self._ctx.agent.positions
        teams, living = positions.teams, positions.living.tolist()
        if len(living) == len(teams):
            return []
        left = dict.fromkeys((str(team) for team in teams if team is not None), 0)
        for row in living:
            if teams[row] is not None:
                left[str(teams[row])] += 1
        return ["left: " + score_line(left)] if left else []

    def _frames_per_second(self) -> str:
        half_second = int(self._pace.now() * 2)
        if self._fps[0] != half_second:
            self._fps = half_second, f"{self._pace.clock.get_fps():.0f} fps"
        return self._fps[1]

    def lines(self, write: HudLines | None) -> list[str]:
        """Return what a function of the context writes; one that fails is logged once."""
        if write is None:
            return []
        try:
            return [str(line) for line in write(self._ctx)]
        except Exception as error:  # noqa: BLE001 - user code, as a drawer is
            if self._failed is not write:  # once, not in each of sixty frames a second
                self._failed = write
                self._ctx.logger.error(f"The HUD could not be written: {type(error).__name__}: {error}")  # noqa: TRY400
            return []

    def paint(self, canvas: Canvas, write: HudLines | None, question: Question | None) -> None:
        """Paint names, the text that a function writes, and what a person is asked."""
        self._paint_labels(canvas, question)
        lines = self.lines(write) if self.hud.is_shown else []
        if self._ctx.is_terminated():  # by the function that writes them
            return
        paused = ["paused: space goes on, . shows one turn"] if self._pace.is_paused else []
        prompt = paused if question is None else [question.words]
        self.hud.paint(canvas, lines, prompt, noted(self._ctx, ""), has_hint=write == self.turn_lines)
        found = self.pointed_at()
        if found is not None:
            self.hud.paint_facts(canvas, *found)

    def _paint_labels(self, canvas: Canvas, question: Question | None) -> None:
        view = self._camera.camera()
        if self.has_labels:
            looks = [look for look in self._placed_looks() if look.name in self._ctx.agent.agents]
            places = np.array([look.current_position for look in looks], np.float64).reshape(-1, 2)
            taken: set[tuple[int, int]] = set()
            flying, hidden = self._flyers(), self._pointed_name()
            for look, (x, y) in zip(looks, view.to_screen(places).tolist(), strict=True):
                radius = max(look.size * view.scale, look.least_px)
                left, top = x + radius + 4, y - 6
                if look.name in flying:  # beside its ring, above its height
                    left, top = x + max(RING * look.size * view.scale, RING_PX) + 4, top - radius - 4
                cells = _cells(left, top, 8 * len(look.name))
                is_seen = 0 <= x <= canvas.width and 0 <= y <= canvas.height and look.name != hidden
                if is_seen and not taken.intersection(cells):
                    taken.update(cells)
                    self.hud.tag(canvas, look.name, left, top)
        if isinstance(question, Walk):
            for number, (x, y) in enumerate(view.to_screen(question.places).tolist()):
                self.hud.tag(canvas, str(number), x, y - 24, is_loud=True)

    def _placed_looks(self) -> list[AgentData]:
        return [look for look in looks_of(self.shown) if look.current_position is not None]

    def _flyers(self) -> set[str]:
        return {agent.name for agent in self._ctx.agent.create_iter() if agent.type == AgentType.AERIAL}

    # -- keys ----------------------------------------------------------------------------------------------

    @refused_while_deciding
    def toggle_labels(self) -> None:
        """Show names, or hide them."""
        self.has_labels = not self.has_labels

    @refused_while_deciding
    def toggle_trails(self) -> None:
        """Show trails, or hide them."""
        self.trails.turns = 0 if self.trails.turns else self._usual_trails
        self.shown = {}


def _cells(left: float, top: float, width: float) -> list[tuple[int, int]]:
    """Return the cells of a coarse grid that a line of text touches."""
    columns = range(int(left // _CELL_PX), int((left + width) // _CELL_PX) + 1)
    rows = range(int(top // _CELL_PX), int((top + _NAME_PX) // _CELL_PX) + 1)
    return [(column, row) for column in columns for row in rows]


def facts_about(ctx: IContext, name: str) -> list[str]:
    """Return an agent in a few lines: name, team, where it is, and what its sensors last sensed."""
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
        lines.append(f"{sensor} ({getattr(kind, 'name', kind)}): {_summary(data)}")
    return lines


def _summary(data: object) -> str:
    """Return what a sensor sensed, in a few words."""
    if isinstance(data, dict):
        counts = [f"{len(part)} {name}" for name, part in data.items() if isinstance(part, dict | list | tuple | set)]
        if counts and len(counts) == len(data):
            return ", ".join(counts)
    if isinstance(data, dict | list | tuple | set):
        few = ", ".join(map(str, data)) if len(data) <= 6 else ""
        return few if 0 < len(few) <= 40 else f"{len(data)} seen" if data else "nothing"
    words = str(data)
    return words if len(words) <= 40 else words[:39] + "…"


_ALPHA = 150
_FEW, _WIDTH_PX, _THIN_PX = 200, 3.0, 1.0  # so many are drawn broad; more of them fast


class Trails:
    """The paths of agents in the last turns.

    Args:
        turns: how many; 0 keeps none.
    """

    def __init__(self, turns: int) -> None:
        self.turns = turns
        self._ways: deque[Moves] = deque()

    def add_turn(self, motion: Motion) -> None:
        """Add the moves of the turn that was just played."""
        if self.turns:
            self._ways.append(motion.moves)
            while len(self._ways) > self.turns:
                self._ways.popleft()

    def draw_past(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw those of the turns before the last, in `data["colors"]`, by agent."""
        ages = list(enumerate(reversed(self._ways)))[1:]
        for age, ways in reversed(ages):
            _draw(ctx, ways, 1.0, data["colors"], round(_ALPHA * (1.0 - age / (self.turns + 1))))

    draw_past.once_a_turn = True  # type: ignore[attr-defined] # then it is over

    def draw_last(self, ctx: IContext, data: dict[str, Any]) -> None:
        """Draw those of the last turn as far as it is shown."""
        if self._ways:
            _draw(ctx, self._ways[-1], float(data.get("_alpha", 1.0)), data["colors"], _ALPHA)


def _draw(ctx: IContext, moves: Moves, share: float, colors: dict[str, Any], alpha: int) -> None:
    by_color: dict[Any, list[list[tuple[float, float]]]] = {}
    paths, ends = moves.paths, [(x, y) for x, y in moves.paths.at(share).tolist()]
    for name, row in moves.rows.items():
        if name in colors:
            by_color.setdefault(rgba(colors[name]), []).append(paths.until(row, share, ends[row]))
    width = _WIDTH_PX if len(moves.rows) <= _FEW else _THIN_PX
    for color, lines in by_color.items():
        points, offsets = list(chain.from_iterable(lines)), np.cumsum([0, *map(len, lines)])
        drawing_of(ctx).render_lines(points, offsets, (*color[:3], alpha), width)
