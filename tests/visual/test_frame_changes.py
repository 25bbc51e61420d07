"""Films paint and convert only what changes: the pictures are those that would be painted again."""

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.sensor import SensorType
from gamms.visual.backends import FILMS
from gamms.visual.backends.av_backend import MOST, SIDE, TILE, paste, planes_of, squares
from gamms.visual.files import Frames, FrameSource

SIZE = 420, 260


class Witness:
    """A film writer that notes in which tiles each frame differs from the one before."""

    def __init__(self):
        self.before, self.changes = None, []

    def __call__(self, *_):
        return self

    def add(self, canvas):
        now = canvas.bgrx().copy()
        self.changes.append(None if self.before is None else squares(self.before, now))
        self.before = now

    def finish(self):
        raise RuntimeError("no film is wanted")

    def discard(self):
        """Do nothing."""


@pytest.fixture
def city():
    """Enough streets for a plate, agents that walk and look, and something static above them."""
    with gamms.create_context(seed=3, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(18, 26))
        for i in range(3):
            eyes = ctx.sensor.create_sensor(f"eyes_{i}", SensorType.RANGE, sensor_range=25.0)
            ctx.agent.create_agent(
                f"walker_{i}",
                start_node_id=40 + 130 * i,
                team=["red", "blue"][i % 2],
                sensors=[eyes.sensor_id],
                strategy=gamms.strategies.random_walk,
            )
        yield ctx


@pytest.mark.parametrize("frames_per_turn", [1, 3])
@pytest.mark.parametrize("case", ["plain", "static above", "followed", "followed above a band", "declared"])
def test_each_frame_is_what_it_would_be_if_it_were_painted_again(city, case, frames_per_turn, monkeypatch, tmp_path):
    if case == "static above":
        above = city.visual.add_artist("roof", {"drawer": roof, "layer": 60})
        above.set_artist_type(gamms.typing.ArtistType.STATIC)
    elif case.startswith("followed"):
        city.visual.follow("walker_1", 90.0)
        if case != "followed":
            city.visual.add_artist("band", {"drawer": band, "layer": 12})
    elif case == "declared":
        city.visual.set_graph_visual(node_size=1)
        for i in range(3):
            city.visual.set_agent_visual(f"walker_{i}", size=4)
    witness = Witness()
    monkeypatch.setitem(FILMS._factories, ".mp4", witness)
    painted = []
    at = Frames.at
    monkeypatch.setattr(Frames, "at", lambda self, share: painted.append(share) or at(self, share))
    film = city.visual.film(tmp_path / "x.mp4", 10, *SIZE, frames_per_turn=frames_per_turn, title="Walk")
    differences = []
    add = witness.add

    def compared(canvas):
        options = {"title": "Walk", "captions": True}
        fresh = Frames(FrameSource(city, city.visual.drawing, city.visual.artists), SIZE, options)
        fresh._fitted = film._frames._fitted
        differences.append(np.abs(at(fresh, painted[-1]).pixels().astype(int) - canvas.pixels()).max())
        add(canvas)

    witness.add = compared
    city.game.run(max_turns=3)
    film.discard()
    assert len(differences) == 3 * frames_per_turn
    # A static part above is laid on as a transparent surface, which rounds; hairlines of tiles begin elsewhere.
    assert max(differences) <= (40 if case.startswith("followed") else 1)
    if case in ("plain", "declared") and frames_per_turn > 1:
        assert sum(changes is not None for changes in witness.changes) >= 3


def test_what_stays_in_place_is_no_change(city, monkeypatch, tmp_path):
    witness = Witness()
    monkeypatch.setitem(FILMS._factories, ".mp4", witness)
    film = city.visual.film(tmp_path / "x.mp4", 10, *SIZE, frames_per_turn=4, title="Nobody walks", note="today")
    for _ in range(3):
        city.visual.simulate()
    film.discard()
    assert witness.changes[-2:] == [[], []]


def roof(ctx, data):
    ctx.visual.render_polygon([(10, 10), (240, 10), (240, 30), (10, 30)], (0, 90, 0, 120))
    ctx.visual.drawing.render_lines(np.arange(1600.0).reshape(-1, 2) % 97, np.arange(0, 801, 2), (90, 0, 0))


def band(ctx, data):
    ctx.visual.drawing.render_lines(np.arange(1600.0).reshape(-1, 2) % 97, np.arange(0, 801, 2), (226, 226, 226), 3)


band.once_a_turn = True


boxes = st.lists(
    st.tuples(st.integers(-90, 500), st.integers(-90, 400), st.integers(0, 90), st.integers(0, 90)), max_size=6
)


@given(boxes, st.sampled_from([(420, 260), (80, 80), (130, 96)]))
def test_tiles_hold_all_boxes_and_lie_in_the_picture(boxes, size):
    width, height = size
    before = np.zeros((height, width), np.uint32)
    now = before.copy()
    for left, top, across, down in boxes:
        now[max(top, 0) : max(top + down, 0), max(left, 0) : max(left + across, 0)] = 7
    tiles = squares(before, now)
    held = np.zeros((height, width), bool)
    for left, top, (x, y) in tiles:
        held[top : top + TILE, left : left + TILE] = True
        assert 0 <= x <= width - SIDE
        assert 0 <= y <= height - SIDE
        assert x % 2 == y % 2 == 0
        assert x <= left
        assert min(left + TILE, width) <= x + SIDE
    for left, top, across, down in boxes:
        assert held[max(top, 0) : max(top + down, 0), max(left, 0) : max(left + across, 0)].all()


def test_too_many_tiles_are_no_tiles():
    before = np.zeros((720, 1280), np.uint32)
    now = before.copy()
    now[: 8 * TILE, : 8 * TILE] = 1
    assert len(squares(before, now)) == MOST
    assert squares(before, before + 1) is None
    assert squares(before[:400, : SIDE - 2].copy(), now[:400, : SIDE - 2].copy()) is None


@pytest.mark.parametrize("size", [(420, 260), (166, 82)])
def test_converted_tiles_are_what_the_whole_picture_would_be(size):
    from av.video.reformatter import VideoReformatter

    width, height = size
    rng = np.random.default_rng(4)
    before = np.kron(rng.integers(0, 256, (height // 2 + 1, width // 2 + 1, 3)), np.ones((2, 2, 1)))[:height, :width]
    after = before.copy()
    after[30:60, 50:120] = 255 - after[30:60, 50:120]

    def converted(pixels):
        frame = av.VideoFrame(pixels.shape[1], pixels.shape[0], "bgra")
        planes_of(frame)[0][:] = (
            np.dstack([pixels, np.full(pixels.shape[:2], 255)]).astype(np.uint8).reshape(pixels.shape[0], -1)
        )
        return VideoReformatter().reformat(frame, format="yuv420p")

    tiles = squares(*(np.ascontiguousarray(pixels[:, :, 0], np.uint32) for pixels in (before, after)))
    strip = np.concatenate([after[y : y + SIDE, x : x + SIDE] for _, _, (x, y) in tiles], axis=1)
    patched = converted(before)
    paste(planes_of(patched), planes_of(converted(strip)), tiles)
    for mine, whole in zip(planes_of(patched), planes_of(converted(after)), strict=True):
        differs = np.abs(mine.astype(int) - whole)
        assert differs[1:-1].max() <= 1
        assert differs.max() <= 32  # colours of the first and last row are mixed with what is not there
