"""What those who watch want to see: names, trails, one agent's sensors and state."""

from typing import Any

import numpy as np

from gamms.deciding import refused_while_deciding
from gamms.typing import IArtist, IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import AgentData
from gamms.visual.artist import Artist, looks_of
from gamms.visual.backends.pygame import Canvas
from gamms.visual.color import rgba
from gamms.visual.drawers.agents import RING, RING_PX
from gamms.visual.layers import Layer
from gamms.visual.undeclared import Undeclared, artists_of_sights
from gamms.visual.window.asking import Question, Walk
from gamms.visual.window.controls import Controls
from gamms.visual.window.hud import Words, score_line
from gamms.visual.window.internals import Internals
from gamms.visual.window.pointing import facts_about, nearest
from gamms.visual.window.themes import Theme
from gamms.visual.window.trails import Trails

_USUAL_TRAILS = 8  # turns, where they are switched on by key
_BESIDE_PX = 10.0  # between an agent and its panel
_CELL_PX = 9  # of the grid that keeps labels apart
_NAME_PX = 12  # how high a name is


class Onlookers(Internals):
    """The part of a window that shows what was not declared."""

    words: Words
    controls: Controls
    question: Question | None
    has_labels: bool
    _theme: Theme
    _usual: Undeclared  # the default look, in the colours of the theme
    _turns_of_trails: int
    _shown: dict[str, IArtist]
    _share: float
    _is_fresh: bool

    def __init__(self, ctx: IContext, *, simulation_time_constant: float = 2.0) -> None:
        super().__init__(ctx, simulation_time_constant=simulation_time_constant)
        self.turns = 0  # that were shown
        self.trails = Trails(0)
        self._pinned: str | None = None
        self._fps = (0, "")
        self._hinted: tuple[str | None, dict[str, IArtist]] = None, {}  # who is pointed at, and what it sees

    # -- who is on stage -------------------------------------------------------------------------------------

    def onstage_artists(self) -> dict[str, IArtist]:
        """Who draws in the window: those who draw in pictures, in the colours of the theme, and the trails."""
        artists = self._with_marks(self._undeclared_part(self._usual) | self._artists)
        if self.trails.turns:
            hidden = self.hidden_agents()
            colors = {look.name: look.color for look in looks_of(artists) if look.name not in hidden}
            for name, drawer in (("past trails", self.trails.draw_past), ("trails", self.trails.draw_last)):
                artists[name] = trails = Artist(self.ctx, drawer, Layer.TRAILS)
                trails.data = {"colors": colors}
        return artists

    def hints(self) -> dict[str, IArtist]:
        """Artists of what the agent under the pointer sees, as far as it is not shown already."""
        name = self._pointed_name()
        if self._is_fresh or name != self._hinted[0]:
            self._hinted = name, {} if name is None else self._hints_of(name)
        return self._hinted[1]

    def _hints_of(self, name: str) -> dict[str, IArtist]:
        agent: Any = self.ctx.agent.get_agent(name)
        look = next((look for look in looks_of(self._shown) if look.name == name), AgentData(name))
        sights = [self.carriers.sight(sensor, agent) for sensor in getattr(agent, "_sensor_list", {}).values()]
        unseen = [one for one in sights if one.view is not None and f"sensor_{one.sensor.sensor_id}" not in self._shown]
        colored = {one.sensor.sensor_id: [(rgba(look.color)[:3], one.view)] for one in unseen}
        hints: dict[str, IArtist] = {**artists_of_sights(self.ctx, colored, look.size)}
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
        """What is known about the agent under the pointer, else about the one that was clicked.

        Also where it is on the screen, and how many pixels beside it there is room for words.
        """
        name = self._pointed_name()
        if name is None:
            return None
        look = next((look for look in self._placed_looks() if look.name == name), None)
        if look is None or look.current_position is None:
            return None
        radius = max(look.size * self._render_manager.scale, look.least_px)
        at = self._render_manager.world_to_screen(*look.current_position)
        return facts_about(self.ctx, look.name), at, radius + _BESIDE_PX

    def _pointed_name(self) -> str | None:
        pointer = self.controls.pointer
        name = None if pointer is None else self._agent_at(pointer)
        if (
            name is None
            and self._pinned in self.ctx.agent.agents
            and self._pinned not in self.hidden_agents(self._share)
        ):
            name = self._pinned
        return name

    def _agent_at(self, at: tuple[float, float]) -> str | None:
        looks = self._placed_looks()
        if not looks:
            return None
        places = np.array([look.current_position for look in looks], np.float64)
        row = nearest(self._render_manager.camera().to_screen(places), *at)
        name = None if row is None else looks[row].name
        return name if name in self.ctx.agent.agents else None

    # -- words -----------------------------------------------------------------------------------------------

    def turn_lines(self, ctx: IContext) -> list[str]:
        """What `hud` says unless it is replaced: turn, scores, frames per second."""
        game: Any = getattr(ctx, "_game", None)  # asking for `ctx.game` would make one
        turn = self.turns if game is None or not game.turn else game.turn
        speed = "" if self.pace.speed == 1.0 else f" · {self.pace.speed:g}x"
        lines = [f"turn {turn}{speed}"]
        if game is not None and game.scores:
            lines.append(score_line(game.scores))
        return [*lines, *self._left(), self._frames_per_second()]

    def _left(self) -> list[str]:
        """How many of each team are left, once somebody is out."""
        columns = self.ctx.agent.columns  # type: ignore[attr-defined] # of our own engine
        if not columns.out:
            return []
        self.ctx.agent.settle()  # type: ignore[attr-defined] # so that those who were deleted are not counted
        left = dict.fromkeys((str(team) for team in columns.teams if team is not None), 0)
        for team, is_alive in zip(columns.teams, columns.alive, strict=True):
            if team is not None:
                left[str(team)] += is_alive
        return ["left: " + score_line(left)] if left else []

    def _frames_per_second(self) -> str:
        half_second = int(self.pace.now() * 2)
        if self._fps[0] != half_second:
            self._fps = half_second, f"{self.pace.clock.get_fps():.0f} fps"
        return self._fps[1]

    def paint_labels(self, canvas: Canvas) -> None:
        """Write the names beside the agents as far as there is room, and the numbers of a person's choices."""
        view = self._render_manager.camera()
        if self.has_labels:
            looks = [look for look in self._placed_looks() if look.name in self.ctx.agent.agents]
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
                    self.words.tag(canvas, look.name, left, top)
        if isinstance(self.question, Walk):
            for number, (x, y) in enumerate(view.to_screen(self.question.places).tolist()):
                self.words.tag(canvas, str(number), x, y - 24, is_loud=True)

    def _placed_looks(self) -> list[AgentData]:
        return [look for look in looks_of(self._shown) if look.current_position is not None]

    def _flyers(self) -> set[str]:
        return {agent.name for agent in self.ctx.agent.create_iter() if agent.type == AgentType.AERIAL}

    # -- wishes ----------------------------------------------------------------------------------------------

    @refused_while_deciding
    def toggle_labels(self) -> None:
        """Show names, or hide them."""
        self.has_labels = not self.has_labels

    @refused_while_deciding
    def toggle_trails(self) -> None:
        """Show trails, or hide them."""
        usual = self._turns_of_trails or _USUAL_TRAILS
        self.trails.turns = 0 if self.trails.turns else usual
        self._shown = {}


def _cells(left: float, top: float, width: float) -> list[tuple[int, int]]:
    """The cells of a coarse grid that a line of text touches."""
    columns = range(int(left // _CELL_PX), int((left + width) // _CELL_PX) + 1)
    rows = range(int(top // _CELL_PX), int((top + _NAME_PX) // _CELL_PX) + 1)
    return [(column, row) for column in columns for row in rows]
