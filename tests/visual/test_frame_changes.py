"""Films paint only what changes: the pictures are those that would be painted again."""

import numpy as np
import pytest

import gamms
from gamms.sensor import SensorType
from gamms.visual.backends import FILMS
from gamms.visual.files import Frames, FrameSource

SIZE = 420, 260


class Witness:
    """A film writer that notes whether each frame differs from the one before."""

    def __init__(self):
        self.before, self.changes = None, []

    def __call__(self, *_):
        return self

    def add(self, canvas):
        now = canvas.bgrx().copy()
        self.changes.append(self.before is None or bool((self.before != now).any()))
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
def test_each_frame_equals_a_fresh_painting(city, case, frames_per_turn, monkeypatch, tmp_path):
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
    at = Frames.paint_frame
    monkeypatch.setattr(Frames, "paint_frame", lambda self, share: painted.append(share) or at(self, share))
    film = city.visual.film(tmp_path / "x.mp4", 10, *SIZE, frames_per_turn=frames_per_turn, title="Walk")
    differences = []
    add = witness.add

    def compared(canvas):
        options = {"title": "Walk", "captions": True}
        fresh = Frames(FrameSource(city, city.visual.drawing, city.visual.artists), SIZE, options)
        fresh._fitted = film._frames._fitted
        fresh._labels._places = dict(film._frames._labels._places)  # a label stays where it was
        differences.append(np.abs(at(fresh, painted[-1]).pixels().astype(int) - canvas.pixels()).max())
        add(canvas)

    witness.add = compared
    city.game.run(max_turns=3)
    film.discard()
    assert len(differences) == 3 * frames_per_turn
    # A static part above is laid on as a transparent surface, which rounds; hairlines of tiles begin elsewhere.
    assert max(differences) <= (40 if case.startswith("followed") else 1)
    assert all(witness.changes)


def test_frames_of_agents_that_stay_do_not_change(city, monkeypatch, tmp_path):
    witness = Witness()
    monkeypatch.setitem(FILMS._factories, ".mp4", witness)
    film = city.visual.film(tmp_path / "x.mp4", 10, *SIZE, frames_per_turn=4, title="Nobody walks", note="today")
    for _ in range(3):
        city.visual.simulate()
    film.discard()
    assert witness.changes[-2:] == [False, False]


def roof(ctx, data):
    ctx.visual.render_polygon([(10, 10), (240, 10), (240, 30), (10, 30)], (0, 90, 0, 120))
    ctx.visual.drawing.render_lines(np.arange(1600.0).reshape(-1, 2) % 97, np.arange(0, 801, 2), (90, 0, 0))


def band(ctx, data):
    ctx.visual.drawing.render_lines(np.arange(1600.0).reshape(-1, 2) % 97, np.arange(0, 801, 2), (226, 226, 226), 3)


band.once_a_turn = True
