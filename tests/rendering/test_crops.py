"""Pictures that show only the part of the map where the agents are, without a legend."""

import re

import pytest

import gamms
from gamms.errors import BadValue
from gamms.rendering import RenderOptions, render
from gamms.strategies import stay
from gamms.visual.engine import PictureEngine


@pytest.fixture
def recording(tmp_path):
    return recorded(tmp_path, [2450, 2453])


def recorded(folder, nodes):
    """Record a large map with agents on some nodes, and one that is out far away."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(60, 80))
        ctx.agent.create_team("red", nodes, strategy=stay)
        ctx.agent.create_team("blue", [0], strategy=stay)
        ctx.game.add(lambda ctx: ctx.game.eliminate("blue_0"), name="away", phase="before")
        ctx.game.run(1, record=folder / "game.ggr")
    return folder / "game.ggr"


def words(file):
    return re.findall(r">([^<>]+)</text>", file.read_text())


def picture(recording, **options):
    """Return the file of a picture of the end."""
    out = recording.with_name("picture.svg")
    look = RenderOptions(width=400, height=300, captions=False, scale_bar=False, **options)
    render(recording, out, look)
    return out


def test_a_crop_shows_the_part_of_the_map_where_living_agents_are(recording, monkeypatch):
    seen = []
    monkeypatch.setattr(PictureEngine, "look_at", lambda _, *view: seen.append(view))
    picture(recording)
    assert seen == []
    picture(recording, crop=True)
    assert seen == [(515.0, 300.0, 300.0)]  # thirty edges around the two, not around the one that is out


@pytest.mark.parametrize(
    ("size", "width"),
    [({"width": 400, "height": 200}, 700.0), ({"width": 400, "height": 400}, 350.0), ({"width": 400}, 350.0)],
)
def test_a_crop_is_as_high_as_agents_are_apart(tmp_path, monkeypatch, size, width):
    seen = []
    monkeypatch.setattr(PictureEngine, "look_at", lambda _, *view: seen.append(view))
    path = recorded(tmp_path, [50, 50 + 25 * 80])  # 250 metres apart
    render(path, tmp_path / "picture.svg", RenderOptions(crop=True, **size))
    assert seen == [(500.0, 125.0, pytest.approx(width))]


@pytest.mark.parametrize("agents", [[0, 3, 150, 580, 583, 586, 590], [0, 599]])
def test_a_crop_of_a_slim_map_fills_the_picture_and_shows_most_agents(tmp_path, monkeypatch, agents):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(60, 10, spacing=20.0))  # 180 wide, 1180 high
        ctx.agent.create_team("red", agents, strategy=stay)
        ctx.game.run(1, record=tmp_path / "game.ggr")
    seen = []
    monkeypatch.setattr(PictureEngine, "look_at", lambda _, *view: seen.append(view))
    render(tmp_path / "game.ggr", tmp_path / "picture.svg", RenderOptions(crop=True, width=400, height=300))
    [(x, y, width)] = seen
    assert width == pytest.approx(180.0)
    assert x == pytest.approx(90.0)
    places = [(20.0 * (node % 10), 20.0 * (node // 10)) for node in agents]
    shown = [place for place in places if abs(place[1] - y) <= 67.5]
    assert len(shown) == (4 if len(agents) == 7 else 1)
    assert 67.5 <= y <= 1180.0 - 67.5


def test_the_legend_can_be_left_out(recording):
    assert "blue" in words(picture(recording))
    assert words(picture(recording, legend=False, labels=False)) == []


def test_pages_are_not_cropped(recording):
    with pytest.raises(BadValue, match="has no crop"):
        render(recording, recording.with_name("game.html"), RenderOptions(crop=True))
