"""Pictures, films and pages of recordings. A client: it replays into a context, and draws the context."""

import os
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Literal

import numpy as np

from gamms.arguments import as_known, as_target, explain_call_errors
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.errors import suggest_names as _suggest_names
from gamms.folders import write_whole
from gamms.ir.events import DECISIONS
from gamms.ir.graph import FloatArray
from gamms.knowledge.sides import Side, find_named_side, find_side
from gamms.recorder import Recording
from gamms.recorder.states import State
from gamms.recordings.conversion import make_context_with_map, open_as_version_3, with_sensed
from gamms.text import as_text, shown
from gamms.typing import PictureOptions
from gamms.typing.recorder import IPlayback, pages
from gamms.visual.backends import FILMS, FORMATS
from gamms.visual.drawers.graph import find_typical_edge_length, measure_longer_side
from gamms.visual.fog import Fog

__all__ = ["Fog", "RenderOptions", "render"]

_suggest_names(__name__, __all__)

# around the agent that is followed: on a real map, and on any other
_VIEW_M = 400.0
_VIEW_EDGES = 30.0

_STAMP = 0.6  # share of a picture's width or height that the whole map fills at least, or a crop fills it
_AROUND = 1.4  # how much more than the places of agents a cropped picture shows
AUTO = "auto"  # of `follow`
_CARRIES = 3  # how many events a flag counts as that an agent carries
_PAGE = ".html"
_OF_FILMS = ("fps", "frames_per_turn")  # options that apply only to some formats
_OF_PICTURES = ("view", "width", "height", "fit", "scale_bar", "north", "captions", "legend", "crop")  # and of films

Show = Callable[[str], None]


@dataclass(frozen=True)
class RenderOptions:
    """Options for rendering a recording as a picture or film.

    Attributes:
        first: the first turn of a film; None: from the beginning.
        last: the last turn of a film, or the turn after which a picture shows the game (0: the start); None: the end.
        follow: the name of an agent to keep in the middle; "auto": the agent that most happens to in these turns.
        view: the width of the view with `follow`, map units; None: 400 metres.
        fog: a team, as text: only the views of its sensors are shown.
        width, height: pixels; None: depends on the map.
        fps: frames per second.
        frames_per_turn: the number of film frames for each turn; None: 5.
        title: a line above the picture.
        fit: "page": exactly width and height; "tight": as small as the map allows within these.
        scale_bar: whether to draw a scale bar; None: if map units are metres.
        north: whether to draw a north arrow.
        captions: whether to show the turn and captions of events below the map.
        theme: "light", "dark" or "print"; None: "dark" with `fog`, else "light".
        labels: whether to show the names of agents, or the agents whose names are shown; "auto": if there are few.
        trails: the number of turns for which paths of agents are shown.
        legend: whether colors and signs are explained beside the map.
        crop: whether a picture shows only the part of the map where the living agents are.
        sensors: whether to show the views of sensors.
    """

    first: int | None = None
    last: int | None = None
    follow: str | None = None
    view: float | None = None
    fog: str | None = None
    width: int | None = None
    height: int | None = None
    fps: float = 30.0
    frames_per_turn: int | None = None
    title: str = ""
    fit: Literal["page", "tight"] = "page"
    scale_bar: bool | None = None
    north: bool = False
    captions: bool = True
    theme: Literal["light", "dark", "print"] | None = None
    labels: bool | Literal["auto"] | Collection[str] = "auto"
    trails: int = 0
    legend: bool = True
    crop: bool = False
    sensors: bool = True


@explain_call_errors
def render(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    options: RenderOptions | None = None,
    *,
    map: str | os.PathLike[str] | None = None,
    show: Show = lambda _: None,
) -> int:
    """Make a picture (`.png`, `.svg`), a film (`.mp4`, `.gif`) or a page (`.html`) of a recording.

    A page contains all turns, and opens at the first requested one; with `fog` it contains only the knowledge of the
    team.

    Args:
        path: the recording, of any version.
        out: the output file; an existing file is replaced.
        options: the turns and their look.
        map: the map, for recordings of version 2; see `recordings.context_for`.
        show: called with a line of text that reports the progress.

    Returns:
        The turn of the picture, or the number of turns in the film or page.

    Raises:
        BadValue: a turn does not exist, an option does not apply to the format, the format is unknown, or the team has
        no sensors. UnknownName (KeyError): the agent or the team does not exist. RecordingError (ValueError): the
        recording is damaged; no file is written. MissingExtra (ImportError): a library is not installed.
        OSError: a file cannot be read or written.
    """
    options = options or RenderOptions()
    out = as_target(out)
    suffix = out.suffix.lower()
    _check_format(out, options)
    with open_as_version_3(path, map) as recording:
        _check_turns(recording, options)
        if options.follow == AUTO:
            options = replace(options, follow=_find_most_eventful(recording, options))
        if suffix == _PAGE:
            return _save_page(recording, out, options)
        with make_context_with_map(map) as ctx:
            shown_recording = recording if options.fog is None else with_sensed(recording)
            renderer = _Renderer(ctx, shown_recording, options, show)
            return renderer.save_film(out) if suffix in FILMS else renderer.save_picture(out)


def _check_format(out: Path, options: RenderOptions) -> None:
    """Raise for an unknown format, and for options that do not apply to the format."""
    if not isinstance(options, RenderOptions):
        raise BadType(f"options are RenderOptions(…), not {shown(options)}.")
    suffix = out.suffix.lower()
    default = RenderOptions()
    unused: tuple[str, ...] = ()
    if suffix == _PAGE:
        unused = (*_OF_FILMS, *_OF_PICTURES)
        if options.last is not None:
            raise BadValue("A page holds all turns: give --turns FROM: for where it begins.")
    elif suffix in FORMATS:
        unused = _OF_FILMS
    elif suffix not in FILMS:
        raise BadValue(f"Cannot write {out.suffix or out.name!r}; there are: {', '.join((*FILMS, *FORMATS, _PAGE))}.")
    given = [name for name in unused if getattr(options, name) != getattr(default, name)]
    if given:
        raise BadValue(f"A file {suffix} has no {', '.join(given)}: omit options that apply only to pictures or films.")


def _check_turns(recording: Recording, options: RenderOptions) -> None:
    """Raise for turns that do not exist."""
    first = options.first
    last = options.last
    if (first is not None and first < 1) or (last is not None and last < (first or 0)):
        raise BadValue(f"Turns are counted from 1 on; there are none from {first or 1} to {last or 'the end'}.")
    wanted = max(first or 0, last or 0)
    if wanted > recording.turns:
        raise BadValue(f"There is no turn {wanted}: this recording has {recording.turns} turns.")


def _save_page(recording: Recording, out: Path, options: RenderOptions) -> int:
    """Write a page; return how many turns it has."""
    content = pages["gamms"](
        recording,
        title=options.title,
        theme=options.theme,
        labels=options.labels,
        trails=options.trails,
        sensors=options.sensors,
        turn=max((options.first or 1) - 1, 0),
        follow=options.follow,
        audience=options.fog,
    )
    write_whole(out, content, through_links=True)
    return recording.turns


def _find_most_eventful(recording: Recording, options: RenderOptions) -> str:
    """Return the agent that most happens to in the requested turns, among those that live through them.

    Events that name an agent count, and flags that it carries at the start or the end; then its moves; then its name.

    Raises:
        BadValue: no agent is alive.
    """
    first = max((options.first or 1) - 1, 0)
    last = recording.turns if options.last is None else options.last
    states = recording[first], recording[last]
    sides = [list(map(find_side, state.agents["name"].tolist(), state.agents["team"].tolist())) for state in states]
    wanted = None if options.fog is None else find_named_side(options.fog, chain(*sides))
    living = [_list_living(state, own, wanted) for state, own in zip(states, sides, strict=True)]
    candidates = sorted(living[0] & living[1]) or sorted(living[0]) or sorted(living[1])
    if not candidates:
        raise BadValue(
            f"No agent is alive in turns {first + 1} to {last}, so none can be followed: leave --follow out."
        )
    if AUTO in candidates:  # an agent may have this name
        return AUTO
    counts = Counter[object]()
    for event in recording.events(first + 1, last + 1):
        if event["kind"] not in DECISIONS:
            counts.update(as_text(event[key]) for key in ("agent", "other") if key in event)
    for state in states:
        counts.update(dict.fromkeys(_list_carriers(state), _CARRIES))
    moves = Counter(recording.table("moves", first + 1, last + 1)["agent"].tolist())
    return max(candidates, key=lambda name: (counts[name], moves[name]))


def _list_living(state: State, sides: Sequence[Side], wanted: Side | None) -> set[str]:
    """Return the names of the living agents; of a side, if one is given."""
    agents = zip(state.agents["name"].tolist(), sides, state.agents["alive"].tolist(), strict=True)
    return {name for name, side, is_alive in agents if is_alive and wanted in (None, side)}


def _list_carriers(state: State) -> list[str]:
    """Return the names of the agents that carry a flag."""
    kept = [value.get("carriers") for value in state.data.values() if isinstance(value, Mapping)]
    return [as_text(name) for one in kept if isinstance(one, Mapping) for name in one.values() if name is not None]


class _Renderer:
    """A context into which a recording is replayed, and its declarations."""

    def __init__(self, ctx: Context, recording: Recording, options: RenderOptions, show: Show) -> None:
        self._ctx = ctx
        self._options = options
        self._total = recording.turns
        self._records = ctx.record.replay(recording)
        self._show = show
        self._turn = 0
        self._fog: Fog | None = None

    def save_picture(self, out: Path) -> int:
        """Save a picture of the state after the last requested turn."""
        from gamms.visual import files

        options = self._options
        files.check_sheet(out, options.width, options.height, 96.0)  # fail early
        if options.last == 0:
            self._play_start()
        else:
            self._play(options.last)
        self._begin()
        if options.crop:
            self._crop()
        self._ctx.visual.save(out, options.width, options.height, **self._page)
        return self._turn

    def save_film(self, out: Path) -> int:
        """Film the turns that were asked for."""
        from gamms.visual.files import check_film_plan

        options = self._options
        check_film_plan(out, options.fps, options.width, options.height, options.frames_per_turn)
        self._play(max((options.first or 1) - 1, 0))
        if self._turn == 0:
            next(self._records, None)  # the map and the agents come with the first record
        if options.follow in self._ctx.agent.agents:  # or else it comes in the first turn
            self._follow(options.follow)  # before the size of the film is chosen
        begun = self._turn
        size = options.width, options.height, options.frames_per_turn
        with self._ctx.visual.film(out, options.fps, *size, **self._page):
            self._play(options.last)
            if self._turn == begun:
                raise BadValue(f"There is no turn to film: this recording has {self._turn} turns.")
        return self._turn - begun

    @property
    def _page(self) -> PictureOptions:
        options = self._options
        return {
            "title": options.title,
            "fit": options.fit,
            "scale_bar": options.scale_bar,
            "north": options.north,
            "legend": options.legend,
            "captions": options.captions,
            "theme": options.theme or ("dark" if options.fog else "light"),
            "labels": options.labels,
            "trails": options.trails,
            "sensors": options.sensors,
        }

    def _play(self, last: int | None) -> None:
        """Replay up to and with a turn; the generator stays open for more."""
        visual = self._ctx.visual
        with ExitStack() as watching:
            visual.after_turn.append(self._end_turn)
            watching.callback(visual.after_turn.remove, self._end_turn)
            while last is None or self._turn < last:
                if next(self._records, None) is None:
                    return

    def _play_start(self) -> None:
        """Show the start of a recording: map and agents come with the first record, which may be a move."""
        playbacks = list[IPlayback]()
        self._ctx.visual.show_playback = playbacks.append
        next(self._records, None)
        for playback in playbacks:
            playback.seek(0)
            playback.close()

    def _begin(self) -> None:
        """Make the declarations that need the map and the agents."""
        ctx = self._ctx
        options = self._options
        if options.fog is not None and self._fog is None:
            self._fog = Fog(ctx, options.fog)
        if self._fog is not None:
            self._fog.look()
        if options.follow is not None and ctx.visual.viewpoint.followed is None:
            self._follow(options.follow)

    def _follow(self, name: str) -> None:
        """Keep an agent in the middle."""
        ctx = self._ctx
        as_known(name, "agent", ctx.agent.agents)
        ctx.visual.follow(name, _compute_view_width(ctx) if self._options.view is None else self._options.view)

    def _crop(self) -> None:
        """Show the part of the map where the living agents are, unless that is nearly all of it.

        If the whole map would fill little of the picture, because it is much slimmer, the part fills the picture.
        """
        ctx = self._ctx
        options = self._options
        living = [name for name, agent in ctx.agent.agents.items() if agent.alive]
        if not living:
            return
        places = np.array([ctx.visual.drawing.position_of(name) for name in living])
        low = places.min(axis=0)
        high = places.max(axis=0)
        across, up = (high - low).tolist()
        shape = 1.0 if options.width is None or options.height is None else options.width / options.height
        width = max(_AROUND * across, _AROUND * up * shape, _compute_view_width(ctx))
        columns = ctx.graph.columns()
        on_map = np.ptp(columns.xy, axis=0) * (1.0, shape)  # how wide pictures are that hold its width, and its height
        if on_map.min() < _STAMP * on_map.max():
            width = min(width, float(on_map.min()))
        if width < measure_longer_side(columns):
            x, y = _find_fullest_view(places, np.array([width, width / shape]), columns.xy).tolist()
            ctx.visual.look_at(x, y, width)

    def _end_turn(self) -> None:
        """Count a turn that was replayed; it is filmed right after this."""
        self._turn += 1
        if self._ctx.visual.pictures.films or self._options.fog is not None:
            self._begin()
        self._show(f"Turn {self._turn} of {self._total}")


def _find_fullest_view(places: FloatArray, size: FloatArray, xy: FloatArray) -> FloatArray:
    """Return the middle (2,) of a view that holds most of some places, and is on the map as far as it can be.

    Args:
        places: (agents, 2) the places.
        size: (2,) the width and height of the view.
        xy: (nodes, 2) the nodes of the map.
    """
    low = np.minimum(xy.min(axis=0) + size / 2, xy.mean(axis=0))
    high = np.maximum(xy.max(axis=0) - size / 2, xy.mean(axis=0))
    whole: FloatArray = (places.min(axis=0) + places.max(axis=0)) / 2
    if (np.ptp(places, axis=0) <= size).all():
        return whole
    middles = np.clip(np.vstack([whole, places]), low, high)
    counts = [int((np.abs(places - middle) <= size / 2).all(axis=1).sum()) for middle in middles]
    fullest: FloatArray = middles[int(np.argmax(counts))]
    return fullest


def _compute_view_width(ctx: Context) -> float:
    """Return the default width of the view with `follow`, map units: at most some hundred metres."""
    columns = ctx.graph.columns()
    wanted = _VIEW_EDGES * find_typical_edge_length(columns) if columns.crs is None else _VIEW_M
    widest = measure_longer_side(columns)
    return min(wanted, widest) or wanted
