"""Words beside agents: where they stand, what they say, and which agents on one node are seen."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, UnknownName
from gamms.visual.appearance import AgentData
from gamms.visual.camera import Camera
from gamms.visual.drawers import render_agent
from gamms.visual.labels import Labels, find_dots, sign_boxes
from gamms.visual.layout import Layout

PAGE = (0.0, 0.0, 400.0, 300.0)
places = st.lists(st.tuples(st.floats(0, 400), st.floats(0, 300), st.floats(2, 15)), min_size=1, max_size=40)


def overlap(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


class Drawn:
    """An artist that has drawn an agent as a disc in pixels."""

    def __init__(self, name, x, y, radius):
        self.data = {"agent_data": AgentData(name, (200, 0, 0), 0.0, least_px=radius)}
        self.data["agent_data"].current_position = (x, -y)

    def get_drawer(self):
        return render_agent

    def get_visible(self):
        return True


def put(square, found, taken=(), labels=None):
    """The labels of discs (x, y, radius) on a page, and the artists of the discs."""
    for number in range(len(square.agent.agents), len(found)):
        square.agent.create_agent(f"a{number}", start_node_id=0)
    artists = {f"a{number}": Drawn(f"a{number}", *one) for number, one in enumerate(found)}
    camera = Camera(400, 300, 0.0, 0.0, 1.0)
    square.visual.drawing.has_stacks = False
    return (labels or Labels()).place(camera, 1.0, square, artists, True, Layout(PAGE, list(taken)))


@given(places, st.lists(st.tuples(*[st.floats(0, 300)] * 2, *[st.floats(1, 80)] * 2), max_size=2))
@settings(max_examples=50)
def test_a_label_covers_no_disc_no_other_label_nothing_taken_and_is_on_the_page(found, taken):
    taken = [(x, y, x + width, y + height) for x, y, width, height in taken]
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.graph.add_node({"id": 0, "x": 0.0, "y": 0.0})
        boxes = [label.box for label in put(ctx, found, taken)]
    for number, box in enumerate(boxes):
        for x, y, radius in found:
            side = 0.7 * radius  # the square in a disc
            assert not overlap(box, (x - side, y - side, x + side, y + side))
        assert not any(overlap(box, other) for other in [*boxes[:number], *taken])
        assert PAGE[0] <= box[0] < box[2] <= PAGE[2]
        assert PAGE[1] <= box[1] < box[3] <= PAGE[3]


@given(places)
@settings(max_examples=20)
def test_a_label_that_can_stay_stays(found):
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.graph.add_node({"id": 0, "x": 0.0, "y": 0.0})
        labels = Labels()
        before = put(ctx, found, labels=labels)
        for again in (put(ctx, found, labels=labels), put(ctx, found, labels=labels)):
            assert sorted(label.box for label in again) >= sorted(label.box for label in before)


def test_a_lone_label_is_above_at_the_right_of_its_disc_which_it_does_not_touch(square):
    [label] = put(square, [(200.0, 150.0, 8.0)])
    assert [line.words for line in label.lines] == ["a0"]
    assert label.leader == []
    left, _, _, bottom = label.box
    assert 200.0 < left < 215.0
    assert 135.0 < bottom < 150.0


def test_agents_whose_discs_touch_share_one_label_with_a_line_for_each(square):
    labels = put(square, [(200.0, 150.0, 8.0), (210.0, 150.0, 8.0), (100.0, 50.0, 8.0), (200.0, 160.0, 8.0)])
    assert sorted([line.words for line in label.lines] for label in labels) == [["a0", "a1", "a3"], ["a2"]]


def test_of_many_agents_in_a_knot_five_are_named_and_the_others_counted(square):
    found = [(200.0 + 4.0 * number, 150.0, 20.0) for number in range(9)]
    [label] = put(square, found)
    assert [line.words for line in label.lines] == ["a0", "a1", "a2", "a3", "a4", "+4"]
    assert [line.color is None for line in label.lines] == [False] * 5 + [True]  # a number has no bullet


def test_six_agents_in_a_knot_all_have_a_name_and_a_bullet(square):
    [label] = put(square, [(200.0 + 4.0 * number, 150.0, 20.0) for number in range(6)])
    assert [(line.words, line.color) for line in label.lines] == [(f"a{number}", (200, 0, 0)) for number in range(6)]


def test_a_label_without_room_beside_its_disc_is_at_the_end_of_a_line(square):
    around = [(170.0, 128.0, 230.0, 172.0)]  # a panel over the disc and all that is near
    [label] = put(square, [(200.0, 150.0, 6.0)], around)
    begin, end = np.array(label.leader)
    assert np.hypot(*(begin - (200.0, 150.0))) == pytest.approx(7.5)
    assert not overlap(label.box, around[0])
    assert label.box[0] <= end[0] <= label.box[2]


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
    square.visual.drawing.motion.begin_turn()
    steps = [before, *(centers(square, share) for share in np.linspace(0.0, 1.0, 50))]
    assert np.abs(np.diff(steps, axis=0)).max() < 3.0
    assert np.allclose(steps[0], steps[1])


def centers(ctx, share):
    """Where the dots of all agents are, in pixels."""
    artists = ctx.visual.artists.list_shown()
    ctx.visual.draw_commands(share)
    looks = [artists[name].data["agent_data"] for name in ctx.agent.agents]
    return find_dots(looks, Camera(400, 400, 0.0, 40.0, 10.0)).centers


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

    for number, node in enumerate((5, 6, 9, 10, 13)):
        add(square, [f"agent_{number}"], node, ("red", "blue")[number % 2])
    square.game.add(capture_flag({"red": 5, "blue": 10}))
    square.game.add(reach("red", [6]))
    for agent in square.agent.create_iter():
        agent.register_strategy(lambda state: state.update(action=state["curr_pos"]))
    square.game.step()
    artists, view = square.visual.artists.list_shown(), Camera(400, 400, -5.0, 35.0, 10.0)
    square.visual.draw_commands()
    layout = Layout(PAGE, sign_boxes(square, artists, view))
    found = Labels().place(view, 1.0, square, artists, True, layout)
    assert {label.lines[0].words for label in found} >= {"agent_0", "agent_1", "agent_3"}
    for label in found:
        flags = [(x, y - 0.04 * 300.0, x + 8.0, y) for x, y in ((150.0, 250.0), (250.0, 150.0))]
        goal = (242.0, 242.0, 258.0, 258.0)
        assert not any(overlap(label.box, sign) for sign in [*flags, goal])
