"""How turns are shown: agents glide, time can stand still, and nothing waits where nothing is shown."""

from time import monotonic

import pytest

from gamms.visual.artist import ArtistGroup


class Clock:
    """A clock by which every frame takes a quarter of a second; it knows how many frames there were."""

    def __init__(self):
        self.limits = []

    def tick(self, limit=0):
        self.limits.append(limit)
        return 250

    def get_fps(self):
        return 4.0


@pytest.fixture
def play(open_window):
    """Opens a window by that clock, with an agent that has just walked the bend; its places are noted per frame."""

    def open_one(**options):
        ctx = open_window(**{"simulation_time_constant": 1.0, **options})
        ctx.visual.pace.clock = Clock()
        ctx.agent.create_agent("walker", start_node_id=1)
        state = ctx.agent.get_agent("walker").get_state()
        state["action"] = 2
        ctx.agent.get_agent("walker").set_state()
        ctx.places = []

        def note(ctx, data):
            ctx.places.append((round(data["_alpha"], 3), ctx.visual.drawing.position_of("walker", data["_alpha"])))

        ctx.visual.add_artist("note", {"drawer": note, "layer": 60})
        return ctx

    return open_one


def test_agents_glide_along_the_road_from_where_they_were(play):
    ctx = play()
    ctx.visual.simulate()
    assert [share for share, _ in ctx.places] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert [place for _, place in ctx.places] == [(10, 0), (11, 2.5), (12, 5), (11, 7.5), (10, 10)]


@pytest.mark.parametrize("max_fps", [60, 100])
def test_there_are_no_more_frames_per_second_than_allowed(open_window, max_fps):
    pace = open_window(max_fps=max_fps).visual.pace
    pace.is_capped = True
    began = monotonic()
    for _ in range(11):
        pace.tick(0.0)
    assert monotonic() - began >= 10 / max_fps


@pytest.mark.parametrize(
    ("faster", "slower"), [(["PLUS", "EQUALS"], ["MINUS"]), (["RIGHTBRACKET"] * 2, ["LEFTBRACKET"])]
)
def test_speed_changes_how_many_frames_a_turn_takes(play, person, faster, slower):
    ctx = play()
    person.press(*faster)  # four times as fast
    ctx.visual.simulate()
    assert [share for share, _ in ctx.places] == [0.0, 1.0]
    ctx.places.clear()
    person.press(*slower * 3)  # half as fast
    ctx.visual.simulate()
    assert len(ctx.places) == 9


def test_a_pause_holds_turns_without_duration_too(play, person):
    ctx, frames = play(simulation_time_constant=0.0), []

    def watch(ctx):
        frames.append(ctx.visual.pace.is_paused)
        if len(frames) == 4:
            person.press("SPACE")
        return []

    ctx.visual.hud = watch
    person.press("SPACE")
    ctx.visual.simulate()
    assert frames == [True] * 4 + [False]


@pytest.mark.parametrize(("seconds", "shares"), [(1.0, [0.0, 0.25, 0.5, 0.75, 1.0]), (0.0, [1.0])])
def test_a_step_shows_a_turn_to_its_end_and_stands_still_there(play, person, seconds, shares):
    ctx, paused = play(simulation_time_constant=seconds), []

    def watch(ctx):
        paused.append(ctx.visual.pace.is_paused)
        if len(paused) == len(shares) + 3:
            person.press("PERIOD")
        if len(paused) == 2 * len(shares) + 7:
            person.press("SPACE")
        return []

    ctx.visual.hud = watch
    person.press("PERIOD")
    ctx.visual.simulate()
    assert [share for share, _ in ctx.places] == [*shares, 1.0, 1.0, 1.0, 1.0]
    ctx.places.clear()
    ctx.visual.simulate()
    assert [share for share, _ in ctx.places] == [*shares, 1.0, 1.0, 1.0, 1.0]
    assert paused == [True] * (2 * len(shares) + 7) + [False]


def test_a_turn_without_duration_is_one_frame(play):
    ctx = play(simulation_time_constant=0.0)
    ctx.visual.simulate()
    assert [share for share, _ in ctx.places] == [1.0]


def test_a_loop_of_ones_own_shows_a_turn_by_the_names_of_1_0_0(play):
    ctx = play()
    visual = ctx.visual
    visual._sim_time_constant = 0.5
    visual._toggle_waiting_simulation(True)
    while visual._waiting_simulation:
        visual.handle_input()
        visual.handle_single_draw()
        visual._pygame.display.flip()
        visual.handle_tick()
    assert [share for share, _ in ctx.places] == [0.0, 0.5, 1.0]
    assert visual._simulation_time == 0.0


def test_simulate_can_be_replaced(play):
    ctx, calls = play(), []
    ctx.visual.simulate = lambda: calls.append(ctx.visual._simulation_time)
    ctx.game.step()
    assert calls == [0.0]


def test_an_artist_of_an_agent_knows_how_much_of_its_move_is_shown(play):
    ctx, seen = play(), []
    artist = ctx.visual.set_agent_visual("walker")
    ctx.visual.hud = lambda ctx: seen.append((artist.data["_alpha"], artist.data["agent_data"].current_position)) or []
    ctx.visual.simulate()
    assert seen[0] == (0.0, (10.0, 0.0))
    assert seen[2] == (0.5, (12.0, 5.0))
    assert seen[-1] == (1.0, (10.0, 10.0))


def test_a_drawer_of_an_agent_knows_whether_a_turn_is_shown(play):
    ctx, seen = play(), []
    artist = ctx.visual.set_agent_visual("walker")
    artist.set_drawer(lambda ctx, data: seen.append((data["_alpha"], data["_waiting_simulation"])))
    ctx.visual.simulate()
    ctx.visual.update()
    assert seen == [(0.0, True), (0.25, True), (0.5, True), (0.75, True), (1.0, True), (1.0, False)]


def test_trails_remember_the_last_turns(play):
    ctx = play(trails=2)
    for node in (1, 0, 1):
        agent = ctx.agent.get_agent("red_0")
        agent.get_state()["action"] = node
        agent.set_state()
        ctx.visual.simulate()
    trails = {name: ctx.visual.overlay.shown[name] for name in ("past trails", "trails")}
    commands = ArtistGroup(ctx, trails).draw_artists()
    lines = [commands.points[a:b].tolist() for a, b in zip(commands.offsets, commands.offsets[1:], strict=False)]
    assert lines == [[[10.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [10.0, 0.0]]]
    assert commands.color[:, 3].tolist()[0] < commands.color[:, 3].tolist()[1]
