"""Words beside agents: where they stand, what they say, and which agents on one node are seen."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, UnknownName
from gamms.visual.appearance import TEAM_COLORS
from gamms.visual.camera import Camera
from gamms.visual.labels import SIDES, AgentDots, are_free, beside, dots_of, placed

PAGE = (0.0, 0.0, 400.0, 300.0)
places = st.lists(st.tuples(st.floats(0, 400), st.floats(0, 300), st.floats(2, 15)), min_size=1, max_size=40)
boxes_taken = st.lists(st.tuples(*[st.floats(0, 300)] * 2, *[st.floats(1, 80)] * 2), max_size=2)


def put(dots, widths, taken=(), before=None, comes=0.0):
    """The rectangle of each label, or None."""
    count = len(dots.radii)
    rows = np.arange(count)
    boxes = beside(dots, np.column_stack([widths, np.full(count, 12.0)]))
    is_free = are_free(boxes, dots, rows, PAGE, list(taken), np.full(count, comes))
    sides = placed(boxes, is_free, np.full(count, -1) if before is None else before)
    return sides, [None if side < 0 else boxes[row, side].tolist() for row, side in enumerate(sides.tolist())]


def distance(box, center):
    """How far a point is from a rectangle."""
    left, top, right, bottom = box
    return float(np.hypot(max(left - center[0], center[0] - right, 0.0), max(top - center[1], center[1] - bottom, 0.0)))


def overlap(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


@given(places, st.data(), boxes_taken)
def test_a_label_covers_no_dot_no_other_label_nothing_taken_and_is_on_the_page(found, data, taken):
    dots = AgentDots(np.array([one[:2] for one in found]), np.array([one[2] for one in found]))
    widths = np.array(data.draw(st.lists(st.floats(5, 90), min_size=len(found), max_size=len(found))))
    taken = [(x, y, x + width, y + height) for x, y, width, height in taken]
    boxes = [box for box in put(dots, widths, taken)[1] if box is not None]
    for number, box in enumerate(boxes):
        assert all(
            distance(box, center) >= radius - 1e-6 for center, radius in zip(dots.centers, dots.radii, strict=True)
        )
        assert not any(overlap(box, other) for other in [*boxes[:number], *taken])
        assert box[0] >= PAGE[0]
        assert box[1] >= PAGE[1]
        assert box[2] <= PAGE[2]
        assert box[3] <= PAGE[3]


@given(places)
def test_a_label_is_nearer_to_its_own_dot_than_to_any_that_does_not_touch_that(found):
    dots = AgentDots(np.array([one[:2] for one in found]), np.array([one[2] for one in found]))
    for row, box in enumerate(put(dots, np.full(len(found), 40.0))[1]):
        if box is not None:
            gaps = [distance(box, center) - radius for center, radius in zip(dots.centers, dots.radii, strict=True)]
            apart = np.hypot(*(dots.centers - dots.centers[row]).T) >= dots.radii + dots.radii[row]
            assert all(gaps[row] < gap for gap, is_apart in zip(gaps, apart, strict=True) if is_apart)


@given(places)
def test_a_label_that_can_stay_stays(found):
    dots = AgentDots(np.array([one[:2] for one in found]), np.array([one[2] for one in found]))
    widths = np.full(len(found), 30.0)
    sides, _ = put(dots, widths)
    assert put(dots, widths, before=sides)[0].tolist() == sides.tolist()


def test_a_lone_label_is_above_at_the_right_of_its_dot_which_it_does_not_touch():
    dots = AgentDots(np.array([(200.0, 150.0)]), np.array([8.0]))
    [side], [box] = put(dots, np.array([40.0]))
    assert SIDES[side].tolist() == [1, -1]
    assert box[0] > 200.0
    assert box[3] < 150.0
    assert pytest.approx(distance(box, (200.0, 150.0)) - 8.0) == 3.0


@pytest.fixture
def square():
    """A grid on which no name is long."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        yield ctx


def add(ctx, names, node=0, team=None):
    for name in names:
        ctx.agent.create_agent(name, start_node_id=node, team=team)


def words_of(ctx, width=600, height=600, **options):
    """What is written on a picture, besides the legend."""
    svg = ctx.visual.picture(".svg", width, height, scale_bar=False, **options).decode()
    return re.findall(r">([^<>]+)</text>", svg)


def test_names_are_shown_while_they_are_few_in_the_default_look(square):
    for node in range(15):
        add(square, [f"a{node}"], node)
    assert set(words_of(square)) == {f"a{node}" for node in range(15)}
    assert words_of(square, 300, 300) == []
    assert words_of(square, labels=False) == []
    assert len(words_of(square, 300, 300, labels=True)) > 10
    assert words_of(square, labels=["a3", "a7"]) == ["a3", "a7"]
    square.visual.set_graph_visual()
    assert words_of(square) == []


@pytest.mark.parametrize(
    ("labels", "error", "words"),
    [
        ("anna", BadType, "labels is True, False, 'auto' or a list of names of agents, not 'anna'"),
        (5, BadType, "not 5"),
        (["ann"], UnknownName, "Unknown agent 'ann'. Did you mean 'anna'"),
    ],
)
def test_wrong_labels_are_refused(square, labels, error, words):
    add(square, ["anna"])
    with pytest.raises(error, match=words):
        square.visual.picture(".svg", labels=labels)


@pytest.mark.parametrize("count", range(2, 7))
@pytest.mark.parametrize("scale", [0.5, 40.0])
def test_agents_on_one_node_are_seen_beside_each_other(square, count, scale):
    add(square, [f"a{number}" for number in range(count)], node=5, team="red")
    square.visual.draw_commands()
    looks = [artist.data["agent_data"] for name, artist in square.visual.artists.shown().items() if name[0] == "a"]
    dots = dots_of(looks, Camera(600, 600, 0.0, 30.0, scale))
    for row in range(count):
        others = np.delete(dots.centers, row, axis=0)
        assert np.hypot(*(others - dots.centers[row]).T).min() > 0.9 * (dots.radii[row] - 1.5)
    node = Camera(600, 600, 0.0, 30.0, scale).to_screen(np.array([(10.0, 10.0)]))[0]
    assert np.allclose(dots.centers.mean(axis=0), node)


def test_pixels_show_both_of_two_agents_on_one_node(square):
    pytest.importorskip("pygame")
    add(square, ["anna"], 5, "red")
    add(square, ["ben"], 5, "blue")
    for size in (120, 900):
        seen = square.visual.frame(size, size, labels=False, scale_bar=False)
        assert all((seen == color).all(axis=-1).any() for color in TEAM_COLORS[:2])


def test_of_many_agents_on_one_node_each_color_is_counted(square):
    add(square, [f"red_{number}" for number in range(7)], 5, "red")
    add(square, [f"blue_{number}" for number in range(4)], 5, "blue")
    add(square, ["lone"], 9, "blue")
    assert [one for one in words_of(square, labels=True) if one not in ("red", "blue")] == [
        "\u00d77",
        "\u00d74",
        "lone",
    ]
    assert "\u00d77" in words_of(square, labels=False)


def test_agents_that_part_glide_apart_without_a_jump(square):
    add(square, ["anna", "ben"], 5, "red")
    for agent in square.agent.create_iter():
        agent.register_strategy(lambda state: state.update(action=state["curr_pos"] + (state["name"] == "ben")))
    before = centers(square, 1.0)
    square.game.step()
    square.visual.drawing.motion.begin_turn_once()
    steps = [before, *(centers(square, share) for share in np.linspace(0.0, 1.0, 50))]
    assert np.abs(np.diff(steps, axis=0)).max() < 3.0
    assert np.allclose(steps[0], steps[1])


def centers(ctx, share):
    """Where the dots of all agents are, in pixels."""
    artists = ctx.visual.artists.shown()
    ctx.visual.draw_commands(share)
    looks = [artists[name].data["agent_data"] for name in ctx.agent.agents]
    return dots_of(looks, Camera(400, 400, 0.0, 40.0, 10.0)).centers


def test_labels_keep_their_sides_in_the_frames_of_a_film(square):
    from gamms.visual.files import Frames, FrameSource

    pytest.importorskip("pygame")
    for number in range(4):
        add(square, [f"agent_{number}"], number)
    visual = square.visual
    frames = Frames(FrameSource(square, visual.drawing, visual.artists), (400, 400), {"labels": True})
    frames.at(1.0)
    kept = dict(frames._labels._sides)
    assert len(kept) == 4
    add(square, ["aaa"], 8)  # which comes first by name, but has no claim on places that are taken
    frames.begin_turn()
    frames.at(1.0)
    assert {name: side for name, side in frames._labels._sides.items() if name[0] != "aaa"} == kept


@pytest.mark.parametrize("count", [2, 10, 200])
def test_a_picture_of_a_city_has_readable_names_only(count):
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        gamms.osm.helsinki(ctx, resolution=60.0)
        nodes = ctx.graph.columns().node_ids
        for number, node in enumerate(ctx.rng.choice(nodes, count).tolist()):
            ctx.agent.create_agent(f"agent_{number}", start_node_id=node, team=("red", "blue")[number % 2])
        svg = ctx.visual.picture(".svg", 700, 900, labels=True).decode()
    names = re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*>agent_', svg)
    assert len(names) == count if count <= 10 else 20 < len(names) < count
    dots = {(float(x), float(y)) for x, y in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)" r="[3-9]', svg)}
    for x, y in names:
        box = (float(x), float(y) - 8.5, float(x) + 40.0, float(y))
        assert not any(box[0] <= cx <= box[2] and box[1] <= cy <= box[3] for cx, cy in dots)


def test_names_cover_no_flag_and_no_goal(square):
    from gamms.rules import capture_flag, reach
    from gamms.visual.labels import Labels

    for number, node in enumerate((5, 6, 9, 10, 13)):
        add(square, [f"agent_{number}"], node, ("red", "blue")[number % 2])
    square.game.add(capture_flag({"red": 5, "blue": 10}))
    square.game.add(reach("red", [6]))
    for agent in square.agent.create_iter():
        agent.register_strategy(lambda state: state.update(action=state["curr_pos"]))
    square.game.step()
    artists, view = square.visual.artists.shown(), Camera(400, 400, -5.0, 35.0, 10.0)
    square.visual.draw_commands()
    found = Labels().placed(view, 1.0, square, artists, True, PAGE, [])
    assert {label.words for label in found} >= {"agent_0", "agent_1", "agent_3"}
    for label in found:
        box = label.left, label.middle - 6.0, label.left + 40.0, label.middle + 6.0
        flags = [(x, y - 0.04 * 300.0, x + 8.0, y) for x, y in ((150.0, 250.0), (250.0, 150.0))]
        assert not any(overlap(box, flag) for flag in flags)
        assert distance(box, (250.0, 250.0)) > 11.0  # the goal
