"""Replays in a window: the line of turns, seeking by click and drag, steps back, trails, and the end."""

import pytest

import gamms
from gamms.visual import Engine
from gamms.visual.appearance import TEAM_COLORS
from gamms.visual.window import engine, panels
from gamms.visual.window.timeline import HEIGHT_PX, Timeline, TimelineMark

TURNS = 8


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A game in which anna walks back and forth, scores twice, and wins, and bert is out in turn 3."""
    path = tmp_path_factory.mktemp("recording") / "game.ggr"
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 5))
        ctx.agent.create_agent(
            "anna", start_node_id=0, team="red", strategy=lambda state: state.update(action=step(state))
        )
        ctx.agent.create_agent("bert", start_node_id=4, team="blue")

        @ctx.game.add
        def rule(ctx):
            if ctx.game.turn == 3:
                ctx.game.eliminate("bert")
            if ctx.game.turn in (2, 5):
                ctx.game.scores["red"] += 1
            if ctx.game.turn == TURNS:
                ctx.game.end("enough", winner="red")

        ctx.record.start(path)
        ctx.game.run()
    return path


def step(state):
    return (state["turn"] + 1) % 5 if state["turn"] < 4 else state["curr_pos"]


@pytest.fixture
def ctx(open_window):
    return open_window(is_empty=True, width=800, height=400, trails=3)


def place_of(ctx, turn):
    """Where a turn is on the line."""
    left, top, width = ctx.visual.overlay.timeline._bar
    return left + width * turn / TURNS, top + HEIGHT_PX / 2


def play(ctx, recording, acts, **options):
    """Replay, and do something in some frames: frame -> function; returns what was seen per frame."""
    seen = []

    def watch(ctx):
        if len(seen) in acts:
            acts[len(seen)]()
        anna = ctx.agent.get_agent("anna")
        seen.append((ctx.visual.overlay.turns, anna.current_node_id, ctx.visual.pace.is_paused))
        return []

    ctx.visual.hud = watch
    for _ in ctx.record.replay(recording, **options):
        pass
    return seen


def test_turns_of_a_replay_are_shown_in_their_order(ctx, recording):
    assert [turn for turn, *_ in play(ctx, recording, {})] == list(range(1, TURNS + 1))


def test_a_click_on_the_line_shows_that_turn_and_the_replay_goes_on_from_there(ctx, recording, person):
    seen = play(ctx, recording, {1: lambda: person.click(*place_of(ctx, 5))})
    assert [turn for turn, *_ in seen] == [1, 2, 5, 6, 7, 8]
    seen = play(ctx, recording, {5: lambda: person.click(*place_of(ctx, 1))})
    assert [turn for turn, *_ in seen] == [1, 2, 3, 4, 5, 6, 1, 2, 3, 4, 5, 6, 7, 8]


def test_a_drag_along_the_line_goes_where_the_hand_is_last(ctx, recording, person):
    seen = play(ctx, recording, {1: lambda: person.drag(place_of(ctx, 2), place_of(ctx, 6))})
    assert [turn for turn, *_ in seen] == [1, 2, 6, 7, 8]
    assert not ctx.visual.camera.is_pointed


def test_a_comma_goes_back_a_turn_and_stands_still(ctx, recording, person):
    acts = {3: lambda: person.press("COMMA"), 5: lambda: person.press("COMMA"), 7: lambda: person.press("PERIOD")}
    seen = play(ctx, recording, acts | {10: lambda: person.press("SPACE")})
    assert [turn for turn, *_ in seen[:12]] == [1, 2, 3, 4, 4, 4, 3, 3, 3, 4, 4, 4]
    assert [node for _, node, _ in seen[:10]] == [1, 2, 3, 4, 4, 4, 3, 3, 3, 4]
    assert seen[-1][0] == TURNS


def test_home_and_end_go_to_the_first_and_the_last_turn_as_in_pages(ctx, recording, person):
    acts = {2: lambda: person.press("END"), 5: lambda: person.press("HOME"), 8: lambda: person.press("SPACE")}
    seen = play(ctx, recording, acts)
    assert [turn for turn, *_ in seen[:9]] == [1, 2, 3, TURNS, TURNS, TURNS, 0, 0, 0]
    assert [turn for turn, *_ in seen[-TURNS:]] == list(range(1, TURNS + 1))


def test_the_button_beside_the_line_stands_still_and_goes_on(ctx, recording, person):
    def click():
        left, top, _ = ctx.visual.overlay.timeline._bar
        person.click(left - 30, top + 10)

    seen = play(ctx, recording, {1: click, 6: click})
    assert [turn for turn, *_ in seen] == [1, 2, 3, 3, 3, 3, 3, 3, *range(4, TURNS + 1)]


def test_a_replay_begins_after_a_turn(ctx, recording):
    assert [turn for turn, *_ in play(ctx, recording, {}, start=5)] == [6, 7, 8]


def test_a_program_can_go_to_a_turn(ctx, recording):
    play(ctx, recording, {})
    ctx.visual.seek(2)
    assert ctx.agent.get_agent("anna").current_node_id == 2
    with pytest.raises(ValueError, match="has 8 turns"):
        ctx.visual.seek(9)


def test_there_is_no_turn_to_go_to_without_a_recording(ctx):
    with pytest.raises(ValueError, match="no recording"):
        ctx.visual.seek(2)


def test_marks_are_of_the_teams_that_they_are_about(ctx, recording):
    play(ctx, recording, {})
    assert ctx.visual.overlay.timeline.marks == (
        TimelineMark(2, "red", "red scores: 1", True),
        TimelineMark(3, "blue", "bert is out", False),
        TimelineMark(5, "red", "red scores: 2", True),
        TimelineMark(8, "red", "red won", True),
    )
    assert ctx.visual.overlay.timeline.describe_events(place_of(ctx, 3)) == ["turn 3: bert is out"]
    assert ctx.visual.overlay.timeline.describe_events(place_of(ctx, 4)) == ["turn 4"]
    assert ctx.visual.overlay.timeline.describe_events((3, 3)) == []


def test_the_score_is_written_once(ctx, recording):
    play(ctx, recording, {})
    assert ctx.visual.overlay.write_turn_lines(ctx) == ["turn 8", "left: red 1 · blue 0"]  # the legend has the scores


def test_a_window_has_the_title_of_the_game(recording, open_window):
    pygame = pytest.importorskip("pygame")
    open_window()  # closes the window after the test
    with gamms.recordings.context_for(recording, vis_engine=Engine.PYGAME):
        assert pygame.display.get_caption()[0] == "red and blue"


def test_the_end_is_announced_and_can_be_dismissed(ctx, recording, person):
    play(ctx, recording, {})
    title, color, lines = ctx.visual.overlay.get_card()
    assert (title, color, lines) == ("red won", TEAM_COLORS[1], ("enough", "red 2 · blue 0", "8 turns"))
    person.press("ESCAPE")
    ctx.visual.update()
    assert ctx.visual.overlay.get_card() is None
    ctx.visual.seek(7)
    assert ctx.visual.overlay.get_card() is None


def test_a_replay_that_stays_open_can_be_played_again(ctx, recording, person):
    play(ctx, recording, {})
    seen = []

    def watch(ctx):
        seen.append(ctx.visual.overlay.turns)
        if len(seen) == 2:
            person.click(*place_of(ctx, 6))
        if seen[-3:] == [6, 7, 8]:
            person.close()
        return []

    ctx.visual.hud = watch
    ctx.visual.stay_open()
    assert seen == [8, 8, 6, 7, 8]
    assert ctx.is_terminated()


def test_a_game_that_is_played_after_a_replay_has_a_line_of_its_own(ctx, recording):
    play(ctx, recording, {})
    playback = ctx.visual.playback
    ctx.visual.simulate()
    assert not playback.is_open
    assert ctx.visual.playback is None
    assert not ctx.visual.overlay.timeline.can_seek


def test_a_drag_on_the_line_of_a_game_moves_neither_its_turns_nor_the_map(open_window, person):
    ctx = open_window()
    ctx.game.run(max_turns=4)
    before = ctx.visual.camera.camera()
    left, top, width = ctx.visual.overlay.timeline._bar
    person.drag((left + width // 2, top + 5), (left + width // 4, top - 50))
    ctx.visual.update()
    assert ctx.visual.camera.camera() == before
    assert (ctx.visual.overlay.turns, ctx.visual.pace.is_halted) == (4, False)


def test_a_press_beside_the_line_is_none_on_it():
    timeline = Timeline(lambda name: None)
    assert timeline.find_place((0, 0)) is None
    assert not timeline.is_button((0, 0))


@pytest.mark.parametrize(("given", "is_asked"), [(True, True), (False, False)])
def test_a_block_whose_game_is_over_stays_open_where_a_person_may_look(monkeypatch, recording, given, is_asked):
    monkeypatch.setattr(engine, "is_watched", lambda: True)
    frames = []

    def watch(ctx):
        frames.append(ctx.visual.overlay.is_over)
        if len(frames) > TURNS + 3:
            ctx.visual.quit()
        return []

    options = {"width": 640, "height": 360, "simulation_time_constant": 0.0, "stay_open": given}
    with gamms.create_context(vis_engine=Engine.PYGAME, vis_kwargs=options) as ctx:
        ctx.visual.hud = watch
        for _ in ctx.record.replay(recording):
            pass
        assert len(frames) == TURNS
    assert (len(frames) > TURNS) == is_asked


def test_the_card_of_the_end_covers_no_panel_in_a_small_window(open_window, recording, monkeypatch):
    ctx, boxes = open_window(is_empty=True, width=400, height=300), []
    paint = panels.Hud.paint_card
    monkeypatch.setattr(
        panels.Hud, "paint_card", lambda self, *given: paint(self, *given) or boxes.append(self.layout.areas)
    )
    for _ in ctx.record.replay(recording):
        pass
    ctx.visual.update()
    *others, card = boxes[-1]
    assert len(others) >= 2
    for left, top, right, low in others:
        assert card[0] >= right or card[2] <= left or card[1] >= low or card[3] <= top


def test_a_turn_that_a_game_did_not_finish_is_not_counted(ctx, tmp_path):
    path = tmp_path / "broken.ggr"
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as played:
        played.graph.attach_networkx_graph(gamms.graph.grid(1, 5))
        played.agent.create_agent("anna", start_node_id=0, team="red", strategy=gamms.strategies.random_walk)
        played.record.start(path)
        played.game.run(max_turns=2)
        state = played.agent.get_agent("anna").get_state()
        state["action"] = state["curr_pos"]
        played.agent.get_agent("anna").set_state()
    with gamms.recorder.open(path) as game:
        assert game.turns == 2
    for _ in ctx.record.replay(path):
        pass
    assert ctx.visual.playback.turn == ctx.visual.overlay.turns == 2


@pytest.mark.parametrize(("width", "height", "is_below"), [(300, 600, True), (900, 300, False)])
def test_the_map_is_beside_the_legend_or_below_it_where_it_is_larger_so(open_window, width, height, is_below):
    ctx = open_window(is_empty=True, width=width, height=height)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
    for team in ("red", "blue"):
        ctx.agent.create_agent(team, start_node_id=0, team=team)
    ctx.visual.update()
    legend = ctx.visual.overlay.hud.legend
    places = ctx.visual.camera.camera().to_screen(ctx.graph.columns().xy)
    assert legend.width > 0
    assert (places[:, 0].max() > width - legend.width) == is_below
    assert not is_below or places[:, 1].min() > legend.height


def test_the_map_lies_above_the_line_of_turns(open_window, recording):
    ctx = open_window(is_empty=True, width=400, height=300)
    for _ in ctx.record.replay(recording):
        pass
    ctx.visual.update()
    places = ctx.visual.camera.camera().to_screen(ctx.graph.columns().xy)
    assert places[:, 1].max() < ctx.visual.overlay.timeline._bar[1]
