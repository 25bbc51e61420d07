"""Films: frames by count and never by the clock, agents that glide along their streets, whole files or none."""

import logging
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

import gamms
from gamms.errors import BadType, BadValue, ContextTerminated, Duplicate
from gamms.visual import Engine
from gamms.visual.backends.pillow_backend import Gif


def frames_of(path):
    """All pictures of a film, and how long each is shown, in seconds."""
    if path.suffix == ".gif":
        with Image.open(path) as film:
            shown = [
                (np.asarray(one.convert("RGB")), one.info["duration"] / 1000) for one in ImageSequence.Iterator(film)
            ]
        return [picture for picture, _ in shown], [seconds for _, seconds in shown]
    with av.open(str(path)) as file:
        pictures = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
        rate = file.streams.video[0].average_rate
    return pictures, [float(1 / rate)] * len(pictures)


def move(ctx, name, node):
    """One turn of the paper's loop, for one agent."""
    agent = ctx.agent.get_agent(name)
    agent.get_state()["action"] = node
    agent.set_state()
    ctx.visual.simulate()


def center_of(picture, color):
    """Where the pixels of about one colour are, in the middle: x, y."""
    near = np.abs(picture.astype(int) - color).max(axis=2) < 60
    rows, columns = np.nonzero(near)
    return columns.mean(), rows.mean()


@pytest.fixture
def plain(ctx):
    """The context with nothing but one red agent on its streets."""
    ctx.visual.set_graph_visual()
    ctx.visual.set_agent_visual("red_0", color=(255, 0, 0), size=0.5)
    return ctx


def test_agents_glide_along_the_street_by_its_length(plain):
    plain.agent.get_agent("red_0").current_node_id = 1
    agent = plain.agent.get_agent("red_0")
    agent.get_state()["action"] = 2
    agent.set_state()
    plain.visual.simulate()
    plain.visual.drawing.motion.begin_turn()
    where = [plain.visual.drawing.position_of("red_0", share) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    np.testing.assert_allclose(where, [(10, 0), (11, 2.5), (12, 5), (11, 7.5), (10, 10)])


def test_a_field_of_view_glides_with_its_agent(tmp_path):
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 20))
        eyes = {"eyes": gamms.sensor.agent_range(range_m=25)}
        east = lambda state: state.update(action=max(state["legal"]))
        ctx.agent.create_agent("anna", start_node_id=8, team="red", sensors=eyes, strategy=east)
        with ctx.visual.film(tmp_path / "a.mp4", 10, 640, 360, 4, captions=False, labels=False, legend=False):
            ctx.game.run(2)
        color = ctx.visual.drawing.group_colors()["red"]
    pictures, _ = frames_of(tmp_path / "a.mp4")
    discs = [center_of(picture, color)[0] for picture in pictures]
    tinted = [np.flatnonzero((picture[..., 0].astype(int) - picture[..., 2] > 8).any(axis=0)) for picture in pictures]
    fields = [(columns[0] + columns[-1]) / 2 for columns in tinted]
    assert len({round(disc) for disc in discs}) >= 8
    assert fields == pytest.approx(discs, abs=3)


def test_where_no_street_leads_agents_glide_straight(plain):
    agent = plain.agent.get_agent("red_0")
    agent.prev_node_id, agent.current_node_id = 2, 0
    plain.visual.simulate()
    plain.visual.drawing.motion.begin_turn()
    assert plain.visual.drawing.position_of("red_0", 0.5) == pytest.approx((5, 5))


def test_who_did_not_move_since_does_not_glide_again(plain):
    move(plain, "red_0", 1)
    plain.visual.simulate()
    plain.visual.drawing.motion.begin_turn()
    plain.visual.simulate()
    plain.visual.drawing.motion.begin_turn()
    assert plain.visual.drawing.position_of("red_0", 0.5) == (10, 0)


def test_a_turn_takes_five_frames(plain, tmp_path):
    with plain.visual.film(tmp_path / "a.gif", fps=10, width=64, height=48) as film:
        move(plain, "red_0", 1)
        move(plain, "red_0", 2)
        assert film.frames == 10


def test_small_signs_keep_their_colors_in_a_gif_of_many_tones(tmp_path):
    tones = np.zeros((120, 160, 3), np.uint8)
    tones[..., 0] = 225 + np.arange(160) % 30
    tones[..., 1] = 225 + np.arange(120)[:, None] % 30
    tones[..., 2] = 235
    colors = [(208, 48, 40), (20, 80, 165), (0, 140, 90)]
    for number, color in enumerate(colors):
        tones[10 * number : 10 * number + 5, :5] = color
    gif = Gif(tmp_path / "a.gif", 160, 120, 10.0)
    gif.add(SimpleNamespace(pixels=lambda: tones))
    gif.finish()
    [picture], _ = frames_of(tmp_path / "a.gif")
    assert [tuple(picture[10 * number + 2, 2].tolist()) for number in range(3)] == colors
    assert np.abs(picture.astype(int) - tones).mean() < 4


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_the_same_turns_give_the_same_bytes(tmp_path, suffix):
    def filmed(name):
        with gamms.create_context(seed=1) as ctx:
            ctx.graph.add_nodes([0, 1], [0, 10], [0, 0])
            ctx.graph.add_edges([0], [0], [1])
            ctx.agent.create_agent("a", start_node_id=0)
            with ctx.visual.film(tmp_path / name, width=96, height=64, frames_per_turn=5):
                move(ctx, "a", 1)
                move(ctx, "a", 1)
        return (tmp_path / name).read_bytes()

    assert filmed(f"one{suffix}") == filmed(f"two{suffix}")


FILM_OF_A_SQUARE = """
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from gamms.visual.backends.av_backend import Mp4

path, picture = Path(sys.argv[1]), np.random.default_rng(1).integers(0, 1 << 24, (200, 320), np.uint32)
film = Mp4(path, 320, 200, 30)
for left in range(0, 60, 4):
    picture[80:100, left : left + 20] = 255
    film.add(SimpleNamespace(bgrx=picture.copy))
film.finish()
sys.stdout.buffer.write(path.read_bytes())
"""


def test_films_do_not_depend_on_earlier_contents_of_memory(tmp_path):
    def filmed(fill):
        command = [sys.executable, "-c", FILM_OF_A_SQUARE, str(tmp_path / f"{fill}.mp4")]
        return subprocess.check_output(command, env={**os.environ, "MALLOC_PERTURB_": str(fill)})  # of glibc

    with ThreadPoolExecutor() as pool:
        zeros, ones, others = pool.map(filmed, (0, 1, 128))
    assert zeros == ones == others


def test_odd_sizes_are_rounded_up_for_mp4(plain, tmp_path):
    with plain.visual.film(tmp_path / "a.mp4", width=101, height=75, frames_per_turn=1):
        plain.visual.simulate()
    assert frames_of(tmp_path / "a.mp4")[0][0].shape == (76, 102, 3)


def test_a_block_that_fails_leaves_nothing_and_the_old_film_stays(plain, tmp_path):
    path = tmp_path / "a.mp4"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), plain.visual.film(path, width=64, height=48, frames_per_turn=1):
        plain.visual.simulate()
        1 / 0  # noqa: B018 - the point
    assert path.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["a.mp4"]
    plain.visual.film(path, width=64, height=48).discard()


def test_a_film_ends_with_its_context(plain, tmp_path):
    with plain.visual.film(tmp_path / "a.gif", width=64, height=48, frames_per_turn=1):
        plain.visual.simulate()
        plain.terminate()
        assert (tmp_path / "a.gif").exists()
        plain.visual.simulate()
    assert len(frames_of(tmp_path / "a.gif")[0]) == 1
    with pytest.raises(ContextTerminated):
        plain.visual.film(tmp_path / "b.gif")


def test_a_film_without_a_turn_is_not_written_and_says_so(plain, tmp_path, caplog):
    with plain.visual.film(tmp_path / "a.mp4", width=64, height=48):
        pass
    assert list(tmp_path.iterdir()) == []
    assert [record.levelno for record in caplog.records] == [logging.WARNING]


def test_two_films_at_once_need_two_files(plain, tmp_path):
    with plain.visual.film(tmp_path / "a.gif", width=64, height=48, frames_per_turn=1):
        with pytest.raises(Duplicate, match=r"a film that is being made named .*a\.gif"):
            plain.visual.film(tmp_path / "." / "a.gif", width=64, height=48)
        with plain.visual.film(tmp_path / "b.gif", width=64, height=48, frames_per_turn=3):
            plain.visual.simulate()
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.gif", "b.gif"]


@pytest.mark.parametrize(
    ("name", "options", "error", "words"),
    [
        ("a.avi", {}, BadValue, r"as '\.avi'; there are: \.mp4, \.gif"),
        ("no/a.mp4", {}, FileNotFoundError, "Create it first"),
        ("a.mp4", {"fps": 0}, BadValue, "fps=0"),
        ("a.mp4", {"width": -1}, BadValue, "positive"),
        ("a.gif", {"width": 40_000, "height": 40_000}, BadValue, "of memory"),
        ("a.mp4", {"width": 20_000, "height": 10}, BadValue, "An MP4 has at most 16384 pixels"),
        ("a.mp4", {"frames_per_turn": 0}, BadValue, "at least one frame"),
        ("a.mp4", {"frames_per_turn": 1.5}, BadType, "frames_per_turn"),
        ("a.mp4", {"background": 7}, BadType, "color"),
    ],
)
def test_an_impossible_film_is_refused_and_nothing_is_written(plain, tmp_path, name, options, error, words):
    with pytest.raises(error, match=words):
        plain.visual.film(tmp_path / name, **options)
    assert list(tmp_path.iterdir()) == []


def test_the_source_of_the_map_is_in_the_film(plain, tmp_path):
    def corner(attribution):
        plain.graph.graph.attribution = attribution
        return plain.visual.frame(320, 200)[180:, 160:]

    assert (corner(None) == 252).mean() > (corner("© OpenStreetMap contributors") == 252).mean()


# -- the scene ----------------------------------------------------------------------------------------------


def test_the_first_frame_shows_the_start(plain, tmp_path):
    start = plain.visual.frame(320, 200)
    with plain.visual.film(tmp_path / "a.gif", fps=10, width=320, height=200, captions=False):
        move(plain, "red_0", 1)
    first = frames_of(tmp_path / "a.gif")[0][0]
    assert center_of(first, (255, 0, 0)) == pytest.approx(center_of(start, (255, 0, 0)), abs=1.5)


# -- a context that films itself ----------------------------------------------------------------------------


@pytest.mark.parametrize(("range_m", "room"), [(2.5, 2.5), (4.5, 4.5), (20.0, 4.5)])
def test_a_film_shows_fields_of_view_up_to_nearly_half_of_the_map_wherever_agents_go(ctx, tmp_path, range_m, room):
    ctx.sensor.create_sensor("eye", gamms.sensor.SensorType.RANGE, sensor_range=range_m)
    red = ctx.agent.get_agent("red_0")
    red.register_sensor("eye", ctx.sensor.get_sensor("eye"))
    with ctx.visual.film(tmp_path / "a.gif") as film:
        red.get_state()
        move(ctx, "red_0", 1)
        camera = film._frames._compute_view(1.0)[0]
        xy = ctx.graph.columns().xy
        corners = camera.to_screen(np.array([xy.min(axis=0) - room, xy.max(axis=0) + room]))
        assert (corners >= 0.0).all()
        assert (corners <= (camera.width, camera.height)).all()


def test_the_papers_loop_is_filmed_without_a_change(tmp_path):
    path = tmp_path / "game.mp4"
    options = {"width": 160, "height": 90, "video": str(path), "fps": 10, "simulation_time_constant": 0.3}
    ctx = gamms.create_context(vis_engine=Engine.OFFSCREEN, vis_kwargs=options)
    ctx.graph.graph.add_node({"id": 0, "x": 0, "y": 0})
    ctx.graph.graph.add_node({"id": 1, "x": 9, "y": 0})
    ctx.graph.graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 9})
    agent = ctx.agent.create_agent("a", start_node_id=0)
    ctx.visual.set_graph_visual(width=1980, height=1080)
    ctx.visual.set_agent_visual("a", color=(255, 0, 0), size=1)
    turns = 0
    while not ctx.is_terminated():
        state = agent.get_state()
        state["action"] = 1
        agent.set_state()
        ctx.visual.simulate()
        turns += 1
        if turns == 2:
            assert ctx.visual.frame().shape == (90, 160, 3)
            ctx.terminate()
    assert len(frames_of(path)[0]) == 6 + 10


def test_offscreen_looks_at_the_given_place(ctx):
    with gamms.create_context(vis_engine=Engine.OFFSCREEN, vis_kwargs={"width": 200, "height": 100}) as ctx:
        ctx.graph.graph.add_node({"id": 0, "x": 0, "y": 0})
        assert ctx.visual.get_viewport() is None
        ctx.visual.look_at(50, 20, 40)
        assert ctx.visual.get_viewport() == (30, 70, 10, 30, 5)
        ctx.visual.add_artist("spot", {"x": 50, "y": 20, "radius": 4, "color": (255, 0, 0)})
        assert center_of(ctx.visual.frame(), (255, 0, 0)) == pytest.approx((99.5, 49.5), abs=0.6)
        ctx.visual.look_at_all()
        assert ctx.visual.get_viewport() is None
        with pytest.raises(BadValue, match="positive width"):
            ctx.visual.look_at(0, 0, 0)


def test_a_misspelt_option_is_warned_about(caplog):
    gamms.create_context(vis_engine=Engine.OFFSCREEN, vis_kwargs={"vidoe": "a.mp4"}).terminate()
    assert "Did you mean 'video'?" in caplog.text


def test_a_bad_option_opens_no_context(tmp_path):
    with pytest.raises(BadValue, match=r"there are: \.mp4"):
        gamms.create_context(vis_engine=Engine.OFFSCREEN, vis_kwargs={"video": str(tmp_path / "a.avi")})
