"""Questions to people: numbers, clicks, flights, and a window that is closed instead of an answer."""

from itertools import count

import pytest

import gamms
from gamms.agent import AgentType
from gamms.errors import UnknownName
from gamms.visual.window.input import FlightChoice
from gamms.visual.window.panels import Hud


def star(ctx, leaves):
    """A hub, node 0, with ways to so many nodes."""
    graph = ctx.graph.graph
    graph.add_nodes(
        range(leaves + 1), x=[10.0 * i for i in range(leaves + 1)], y=[float(i % 3) for i in range(leaves + 1)]
    )
    graph.add_edges(range(leaves), sources=[0] * leaves, targets=range(1, leaves + 1))
    ctx.agent.create_agent("anna", start_node_id=0)


def ask(ctx, name="anna"):
    return ctx.visual.human_input(name, ctx.agent.get_agent(name).get_state())


@pytest.fixture
def ctx(open_window):
    ctx = open_window(is_empty=True)
    star(ctx, 14)
    return ctx


def test_a_digit_chooses_where_no_longer_number_is_meant(ctx, person):
    person.press("3")
    assert ask(ctx) == 3


def test_the_panel_of_the_one_who_is_asked_covers_no_choice(open_window, person, monkeypatch):
    ctx = open_window(is_empty=True, width=640, height=480)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6))
    ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
    ctx.agent.create_agent("anna", start_node_id=0, team="red", sensors=["near"])
    panels = []
    paint = Hud.paint_facts
    monkeypatch.setattr(
        Hud, "paint_facts", lambda self, *given: paint(self, *given) or panels.append(self.layout.areas[-1])
    )
    frames = count()

    def act(ctx):
        frame = next(frames)
        if frame == 1:
            person.point(320, 240)
        if frame == 3:
            person.press("0")
        return []

    ctx.visual.hud = act
    assert ask(ctx) == 0
    places = ctx.visual.camera.camera().to_screen(ctx.graph.columns().xy[[0, 1, 6]])
    assert places[0].tolist() == [320.0, 240.0]
    assert panels
    for left, top, right, low in panels:
        assert not any(left < x < right and top < y < low for x, y in places)


def test_zero_stays(ctx, person):
    person.press("0")
    assert ask(ctx) == 0


def test_the_keypad_has_digits_too(ctx, person):
    person.press("KP5")
    assert ask(ctx) == 5


@pytest.mark.parametrize(
    ("keys", "node"),
    [(["1", "4"], 14), (["1", "RETURN"], 1), (["1", "BACKSPACE", "2"], 2), (["1", "9"], 9)],
    ids=["beyond nine", "ended by enter", "taken back", "leading nowhere"],
)
def test_digits_are_read_as_one_number(ctx, person, keys, node):
    person.press(*keys)
    assert ask(ctx) == node


def act(ctx, *deeds):
    """Do something in the first frames of a question, one deed in each."""
    left = list(deeds)
    ctx.visual.hud = lambda ctx: left.pop(0)() if left else []


def click(ctx, person, x, y, down=0):
    """A click on a world point, or some pixels below, as it is seen then."""
    across, up = ctx.visual._render_manager.world_to_screen(x, y)
    person.click(across, up + down)
    return []


def test_a_click_on_a_node_chooses_it(ctx, person):
    act(ctx, lambda: click(ctx, person, 130.0, 1.0))
    assert ask(ctx) == 13


def test_a_click_beside_every_node_chooses_nothing(ctx, person):
    act(ctx, lambda: click(ctx, person, 130.0, 1.0, down=100), lambda: person.press("2") or [])
    assert ask(ctx) == 2


def test_a_wrong_key_says_which_are_possible(ctx, person):
    hints = []

    def note():
        hints.append(ctx.visual.question.hint)
        return []

    act(
        ctx,
        lambda: person.press("x") or [],
        note,
        lambda: person.press("w") or [],
        note,
        lambda: person.press("3") or [],
    )
    assert ask(ctx) == 3
    assert hints == ["X is no choice: there is 0 to 14"] * 2
    drone = FlightChoice("drone", (0.0, 0.0, 0.0))
    drone.type_digit(5)
    assert (drone.answer, drone.hint) == (None, "5 is no choice: there are the arrows up and down, and 0")


def near(graph):
    """Ways of 3 m from node 0, in the corner of a map of 2 km."""
    graph.add_nodes(range(4), x=[0.0, 3.0, 0.0, 2000.0], y=[0.0, 0.0, 3.0, 2000.0])
    graph.add_edges(range(3), sources=[0, 0, 3], targets=[1, 2, 0])


@pytest.fixture
def city(open_window):
    ctx = open_window(is_empty=True)
    near(ctx.graph.graph)
    ctx.agent.create_agent("anna", start_node_id=0)
    return ctx


def test_the_camera_stays_where_choices_are_legible(city, person):
    city.visual.look_at(2.0, 1.0, 30.0)
    before = city.visual.get_viewport()
    act(city, lambda: person.press("2") or [])
    ask(city)
    assert city.visual.get_viewport() == before


def test_an_agent_need_not_be_declared_to_be_asked(ctx, person):
    ctx.visual.set_graph_visual()  # the agent has no visual, then
    person.press("4")
    assert ask(ctx) == 4


def test_an_unknown_agent_is_a_key_error_and_leaves_nothing_waiting(ctx):
    with pytest.raises(UnknownName):
        ctx.visual.human_input("nobody", {"curr_pos": 0})
    assert ctx.visual.question is None
    assert not ctx.visual._waiting_user_input


def test_closing_the_window_stays_and_ends_the_context(ctx, person):
    person.close()
    assert ask(ctx) == 0
    assert ctx.is_terminated()


@pytest.fixture
def drone(ctx):
    ctx.agent.create_agent("drone", start_node_id=1, type=AgentType.AERIAL, speed=5.0)
    ctx.visual.update()
    return ctx


def test_a_click_is_the_way_from_the_drone_to_the_point(drone, person):
    view = drone.visual._render_manager
    person._do("MOUSEBUTTONDOWN", button=1, pos=tuple(round(one) for one in view.world_to_screen(40.0, 20.0)))
    dx, dy, dz = ask(drone, "drone")
    assert (dx, dy) == pytest.approx((30.0, 19.0), abs=1.0 / view.scale)
    assert dz == 0


@pytest.mark.parametrize(("key", "way"), [("UP", (0, 0, 1)), ("DOWN", (0, 0, -1)), ("0", (0, 0, 0))])
def test_keys_of_a_drone(drone, person, key, way):
    person.press(key)
    before = drone.visual._render_manager.camera_y
    assert ask(drone, "drone") == way
    assert drone.visual._render_manager.camera_y == before


def test_a_drone_whose_window_is_closed_does_not_move(drone, person):
    person.close()
    assert ask(drone, "drone") == (0.0, 0.0, 0.0)
    assert drone.visual.human_input("drone", {"curr_pos": (1.0, 2.0, 3.0)}) == (0.0, 0.0, 0.0)


def test_a_game_whose_window_is_closed_in_a_question_ends_quietly(ctx, person):
    agent = ctx.agent.get_agent("anna")
    agent.register_strategy(lambda state: state.update(action=ctx.visual.human_input("anna", state)))
    person.press("3")
    ctx.game.step()
    assert agent.current_node_id == 3
    person.close()
    result = ctx.game.run(max_turns=3)
    assert ctx.is_terminated()
    assert (result.turns, agent.current_node_id) == (2, 3)


def test_the_loop_of_the_paper_ends_quietly_when_the_window_is_closed(ctx, person):
    agent, turns = ctx.agent.get_agent("anna"), 0
    person.press("3")
    while not ctx.is_terminated():
        state = agent.get_state()
        state["action"] = ctx.visual.human_input("anna", state)
        agent.set_state()
        ctx.visual.simulate()
        turns += 1
        if turns == 1:
            person.close()
    assert turns == 2
    assert agent.get_state()["curr_pos"] == 3


def test_drawing_choices_without_a_window_draws_the_question():
    with gamms.create_context() as ctx:
        star(ctx, 3)
        data = {"graph_data": gamms.visual.GraphData(), "_input_options": {0: 0, 1: 2}, "_waiting_user_input": True}
        ctx.visual.add_artist("ask", {"drawer": gamms.visual.render_input_overlay, **data})
        before = len(ctx.visual.draw_commands())
        ctx.visual.remove_artist("ask")
        assert before - len(ctx.visual.draw_commands()) == 3  # a way and two rings


@pytest.fixture
def hunt(open_window):
    """Anna, who sees 25 metres far, and two who hunt her: one is near, one is far away."""

    def open_one(*, is_filled=True, **options):
        ctx = open_window(is_empty=True, **options)
        if not is_filled:
            return ctx
        ctx.graph.graph.add_nodes(range(20), x=[10.0 * i for i in range(20)], y=[0.0] * 20)
        ctx.graph.graph.add_edges(range(19), sources=range(19), targets=range(1, 20))
        for kind in ("RANGE", "AGENT_RANGE"):
            ctx.sensor.create_sensor(kind, gamms.sensor.SensorType[kind], sensor_range=25.0)
        ctx.agent.create_agent("anna", start_node_id=5, team="hunted", sensors=["RANGE", "AGENT_RANGE"])
        ctx.agent.create_agent("near", start_node_id=7, team="hunters", strategy=lambda state: state.update(action=7))
        ctx.agent.create_agent("far", start_node_id=12, team="hunters", strategy=lambda state: state.update(action=12))
        return ctx

    return open_one


def shown_in_a_question(ctx, person, name="anna"):
    shown = []

    def note():
        shown.extend(one for one in ("anna", "near", "far") if one in ctx.visual.overlay.shown)
        person.press("0")
        return []

    act(ctx, list, note)
    ask(ctx, name)
    return shown


def test_a_person_sees_only_agents_that_sensors_show(hunt, person):
    assert shown_in_a_question(hunt(), person) == ["anna", "near"]


def test_without_fog_all_is_seen(hunt, person):
    assert shown_in_a_question(hunt(fog=False), person) == ["anna", "near", "far"]


def test_one_who_has_no_sensor_sees_all(hunt, person):
    assert shown_in_a_question(hunt(), person, "far") == ["anna", "near", "far"]


def test_a_program_that_declares_its_graph_shows_its_declarations(hunt, person):
    ctx = hunt()
    ctx.visual.set_graph_visual()
    for name in ("anna", "near", "far"):
        ctx.visual.set_agent_visual(name)
    assert shown_in_a_question(ctx, person) == ["anna", "near", "far"]


def test_the_fog_stays_while_turns_are_shown_and_lifts_at_the_end(hunt, person):
    ctx, shown = hunt(), []
    ctx.agent.get_agent("anna").register_strategy(
        lambda state: state.update(action=ctx.visual.human_input("anna", state))
    )
    ctx.game.add(lambda ctx: ctx.game.turn == 3 and ctx.game.end("enough"))

    def watch(ctx):
        if ctx.visual.question is None:
            shown.append("far" in ctx.visual.overlay.shown)
        else:
            person.press("0")
        return []

    ctx.visual.hud = watch
    ctx.game.run()
    assert shown == [False, False, True]


def test_all_is_seen_while_the_window_stays_open_after_the_last_turn(hunt, person):
    ctx, shown = hunt(), []
    ctx.agent.get_agent("anna").register_strategy(
        lambda state: state.update(action=ctx.visual.human_input("anna", state))
    )

    def watch(ctx):
        shown.append("far" in ctx.visual.overlay.shown)
        if ctx.visual.question is not None:
            person.press("0")
        elif ctx.visual.overlay.is_over:
            ctx.visual.quit()
        return []

    ctx.visual.hud = watch
    ctx.game.run(max_turns=2)
    assert not any(shown)
    ctx.visual.stay_open()
    assert shown[-1]


def test_the_view_of_a_team_that_is_not_there_is_warned_of_once(hunt, caplog):
    ctx = hunt(fog="hnted")
    for _ in range(2):
        ctx.visual.simulate()
    assert [record.message for record in caplog.records].count(
        "fog=: Unknown team 'hnted'. Did you mean 'hunted'? Everything is shown."
    ) == 1


def test_the_view_of_a_team_can_be_shown_all_the_time(hunt):
    ctx = hunt(fog="hunted")
    ctx.visual.simulate()
    assert "far" not in ctx.visual.overlay.shown
    ctx.visual.toggle_theme()
    ctx.visual.update()
    assert "far" not in ctx.visual.overlay.shown
    assert ctx.visual.drawing.theme is ctx.visual.overlay.hud.theme


def test_in_fog_the_panel_tells_of_others_no_more_than_their_names(hunt, person):
    ctx = hunt()
    overlay = ctx.visual.overlay
    told = {}

    def note():
        for name in ("anna", "near"):
            overlay._pinned = name
            told[name] = overlay.describe_pointed()[0]
            told[name, "views"] = list(overlay.list_hints())
        person.press("0")
        return []

    act(ctx, list, note)
    ask(ctx)
    assert told["near"] == ["near · team hunters"]
    assert told["anna"][:2] == ["anna · team hunted", "at node 5, from 5"]
    assert told["near", "views"] == []
