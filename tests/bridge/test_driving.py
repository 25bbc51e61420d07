"""Robots play agents: moves go out as waypoints, and turns wait for arrivals."""

import math

import pytest

import gamms
from gamms.bridge import Feed, FixChecks, SimulatedClock, SimulatedRobot, Udp, drive
from gamms.errors import BadType, BadValue, Duplicate, UnknownName


def goes(*nodes):
    return lambda state: state.update(action=nodes[min(state["turn"], len(nodes) - 1)])


@pytest.fixture
def ctx():
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, spacing=100.0))
        ctx.agent.create_agent("anna", start_node_id=0, team="robots", strategy=goes(1, 2, 5))
        ctx.agent.create_agent("bert", start_node_id=8, team="others", strategy=gamms.strategies.random_walk)
        yield ctx


class Scripted:
    """A robot that is where a test says, and keeps what it was sent."""

    def __init__(self, clock, *places):
        self.clock, self.places, self.sent = clock, list(places), []

    def send(self, message):
        self.sent.append(message)

    def __call__(self):
        x, y = self.places.pop(0) if len(self.places) > 1 else self.places[0]
        return {"t": self.clock.now(), "x": x, "y": y}


def test_a_simulated_robot_goes_where_its_agent_goes_and_the_turn_waits_for_it(ctx):
    robot = SimulatedRobot(ctx, "anna", speed=10.0)
    ctx.game.add(drive("anna", robot))
    ctx.game.step()
    assert ctx.agent.get_agent("anna").current_node_id == 1
    assert math.dist(robot.xy, (100.0, 0.0)) <= 3.0
    assert robot.clock.now() == pytest.approx(9.7, abs=0.06)  # 100 m at 10 m/s, less 3 m


def test_a_robot_in_another_phase_than_after_the_turn_is_refused(ctx):
    ctx.game.add(drive("anna", SimulatedRobot(ctx, "anna")), phase="before")
    with pytest.raises(BadValue, match="without phase="):
        ctx.game.step()


def test_two_games_with_simulated_robots_are_the_same(tmp_path):
    def play(path):
        with gamms.create_context(seed=4, logger_config={"level": "ERROR"}) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4, spacing=20.0))
            clock = SimulatedClock()
            for i, name in enumerate(("anna", "bert", "carl")):
                ctx.agent.create_agent(name, start_node_id=i, team="r", strategy=gamms.strategies.random_walk)
                if name != "carl":
                    ctx.game.add(drive(name, SimulatedRobot(ctx, name, clock=clock, speed=5.0 + i, noise_m=0.5)))
            ctx.record.start(path)
            ctx.game.run(6)
            ctx.record.stop()
            assert ctx.game.counts["anna"]["moves"] > 1
        return path.read_bytes()

    first = play(tmp_path / "first.ggr")
    assert first == play(tmp_path / "second.ggr")


def test_a_recording_with_a_robot_replays_without_it(ctx, tmp_path):
    ctx.game.add(drive("anna", SimulatedRobot(ctx, "anna", speed=10.0)))
    ctx.record.start(tmp_path / "game")
    ctx.game.run(3)
    ctx.record.stop()
    noted = ctx.game.data["robots"]["anna"]
    with gamms.create_context() as again:
        assert sum(1 for _ in again.record.replay(tmp_path / "game.ggr"))
        assert again.agent.get_agent("anna").current_node_id == 5
        assert again.game.data["robots"]["anna"] == noted
    gamms.recordings.verify(tmp_path / "game.ggr")


def test_robots_are_sent_off_together_and_wait_for_the_slowest(ctx):
    clock = SimulatedClock()
    ctx.agent.create_agent("carl", start_node_id=6, team="robots", strategy=goes(7))
    ctx.game.add(drive("anna", SimulatedRobot(ctx, "anna", clock=clock, speed=10.0)))
    ctx.game.add(drive("carl", SimulatedRobot(ctx, "carl", clock=clock, speed=5.0)))
    ctx.game.step()
    assert clock.now() == pytest.approx(19.4, abs=0.06)


def test_waypoints_lead_along_the_road():
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.add_nodes([0, 1], [0.0, 100.0], [0.0, 0.0])
        bent = {"id": 0, "source": 0, "target": 1, "length": 141.4, "linestring": [(0, 0), (50, 50), (100, 0)]}
        ctx.graph.graph.add_edge(bent)
        ctx.agent.create_agent("anna", start_node_id=0, strategy=goes(1))
        robot = Scripted(SimulatedClock(), (0, 0), (0, 0), (50, 50), (100, 0))
        ctx.game.add(drive("anna", robot))
        ctx.game.step()
        assert robot.sent == [
            {
                "gamms": 1,
                "type": "waypoints",
                "agent": "anna",
                "turn": 0,
                "way": 1,
                "points": [[0, 0], [50, 50], [100, 0]],
            }
        ]


def test_a_robot_that_never_arrives_does_not_hold_the_game_for_longer_than_the_limit(ctx):
    robot = Scripted(SimulatedClock(), (20.0, 1.0))
    ctx.game.add(drive("anna", robot, limit_s=7.0))
    assert ctx.game.step()
    assert ctx.agent.get_agent("anna").current_node_id == 0
    assert robot.clock.now() == pytest.approx(7.0)
    assert ctx.game.events == [
        {"turn": 1, "kind": "robot_late", "agent": "anna", "node": 0, "status": "ok", "waited_s": 7.0}
    ]
    assert "its robot has not arrived after 7 s (ok)" in ctx.game.observation("anna")["blocked"]


@pytest.mark.parametrize("start", [0.0, 0.35, 1.4, 1.7e9])
def test_a_wait_ends_at_any_time_of_the_clock(ctx, start):
    """The rest of a wait may be less than what a clock can count at its time."""
    robot = Scripted(SimulatedClock(start), (20.0, 1.0))
    ctx.game.add(drive("anna", robot, limit_s=4.0))
    events = ctx.game.run(12).events
    assert [one["waited_s"] for one in events] == pytest.approx([4.0] * 12, abs=0.002)


def test_waypoints_are_sent_again_every_second_from_where_the_robot_is(ctx):
    robot = Scripted(SimulatedClock(), (0, 0), *((x, 0.0) for x in range(100)))
    ctx.game.add(drive("anna", robot, limit_s=2.5))
    ctx.game.step()
    assert [one["way"] for one in robot.sent] == [1, 1, 1]
    assert [one["points"][0][0] for one in robot.sent] == pytest.approx([0, 20, 40], abs=3)
    ctx.game.step()
    assert robot.sent[-1]["way"] == 2


def test_a_robot_without_a_fix_is_waited_for_until_the_limit(ctx):
    clock = SimulatedClock()
    ctx.game.add(drive("anna", lambda: None, limit_s=2.0, clock=clock))
    ctx.game.step()
    assert ctx.game.events[0]["status"] == "no fix"
    assert ctx.game.data["robots"]["anna"] == {"status": "no fix", "waited_s": 2.0}


def test_degrees_on_a_map_without_a_crs_are_warned_about_once(ctx, heard):
    ctx.game.add(drive("anna", lambda: {"lat": 60.0, "lon": 24.0}, limit_s=1.0, clock=SimulatedClock()))
    ctx.game.run(2)
    assert [one["status"] for one in ctx.game.events] == ["off map"] * 2
    (warning,) = [one for one in heard if "latitude" in one]
    assert "set ctx.graph.graph.crs" in warning


def test_fixes_that_stop_coming_are_stale(ctx):
    feed = Feed(clock=SimulatedClock())
    feed.put({"x": 100.0, "y": 0.0})
    feed.clock.sleep(5.0)
    ctx.game.add(drive("anna", feed, limit_s=1.0))
    ctx.game.step()
    assert ctx.game.events[0]["status"] == "stale"
    assert ctx.game.data["robots"]["anna"]["age_s"] == 6.0


def test_an_agent_is_put_on_the_last_node_that_its_late_robot_has_passed():
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 5, spacing=100.0))
        anna = ctx.agent.create_agent("anna", start_node_id=0, speed=4, team="r", strategy=goes(4))
        robot = Scripted(SimulatedClock(), (0, 0), (40, 0), (80, 0), (120, 0), (200, 0), (240, 1))
        ctx.game.add(drive("anna", robot, limit_s=3.0, checks=FixChecks(max_speed=2000.0)))
        ctx.game.step()
        assert anna.current_node_id == 2
        assert ctx.game.events[0]["node"] == 2
        robot.places = [(240.0, 0.0), (400.0, 0.0)]
        ctx.game.step()
        assert anna.current_node_id == 4
        assert robot.sent[-1]["points"][0] == pytest.approx([240, 0])  # not back to the node


def test_in_games_by_metres_the_way_of_a_robot_ends_on_the_edge():
    with gamms.create_context(seed=1, game={"speed_unit": "metres"}, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3, spacing=100.0))
        anna = ctx.agent.create_agent("anna", start_node_id=0, speed=70.0, strategy=goes(2))
        robot = SimulatedRobot(ctx, "anna", speed=10.0)
        ctx.game.add(drive("anna", robot, arrive_m=1.0))
        ctx.game.run(2)
        assert anna.xy == (140.0, 0.0)
        assert robot.xy == pytest.approx((139.0, 0.0), abs=0.6)
        assert ctx.game.data["robots"]["anna"]["off_m"] < 1.0


def test_robots_of_teams_that_move_one_after_another_wait_for_each_other_once(ctx):
    clock = SimulatedClock()
    ctx.game.order = [["robots"], ["others"]]
    ctx.game.add(drive("anna", SimulatedRobot(ctx, "anna", clock=clock, speed=10.0)))
    ctx.agent.get_agent("bert").strategy = goes(7)
    ctx.game.add(drive("bert", SimulatedRobot(ctx, "bert", clock=clock, speed=10.0)))
    ctx.game.step()
    assert clock.now() == pytest.approx(2 * 9.7, abs=0.11)
    assert not ctx.game.events


@pytest.mark.parametrize("order", [[["robots"], ["others"]], [["others"], ["robots"]]])
def test_a_robot_is_late_once_in_a_turn_in_which_teams_move_one_after_another(ctx, order):
    clock = SimulatedClock()
    ctx.game.order = order
    ctx.game.add(drive("anna", lambda: None, limit_s=7.0, clock=clock))
    for turn in range(1, 3):
        ctx.game.step()
        assert clock.now() == pytest.approx(7.0 * turn)
        assert [event["turn"] for event in ctx.game.events] == [*range(1, turn + 1)]
        assert ctx.agent.get_agent("anna").current_node_id == 0


def test_a_long_way_fits_into_a_line_and_goes_on_from_where_the_robot_is():
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx, Udp(to=("127.0.0.1", 9)) as link:
        grid = gamms.graph.grid(1, 700, spacing=10.0)
        grid.graph["crs"] = "EPSG:32635"
        for _, place in grid.nodes(data=True):
            place["x"], place["y"] = place["x"] + 385_000.125, place["y"] + 6_672_000.125
        ctx.graph.attach_networkx_graph(grid)
        ctx.agent.create_agent("anna", start_node_id=0, speed=699, strategy=goes(699))
        robot = SimulatedRobot(ctx, "anna", speed=400.0)
        sent = []

        def send(message):
            sent.append(len(message["points"]))
            link.send(message)
            robot.send(message | {"way": len(sent)})

        ctx.game.add(drive("anna", robot, send=send, limit_s=100.0, checks=FixChecks(max_speed=500.0)))
        ctx.game.step()
        assert ctx.agent.get_agent("anna").current_node_id == 699
        assert sent[0] == 500
        assert link.counts["unsent"] == 0


def test_what_a_plan_decides_goes_to_the_robot_too(ctx):
    robot = SimulatedRobot(ctx, "anna", speed=10.0)
    ctx.game.add(drive("anna", robot))
    ctx.game.command("robots", lambda states: states["anna"].update(action=3))
    ctx.game.step()
    assert math.dist(robot.xy, (0.0, 100.0)) <= 3.0


def test_a_robot_whose_agent_lost_its_node_to_another_is_sent_back(ctx):
    ctx.game.conflicts = gamms.rules.Conflicts(resolve=gamms.rules.by_priority(["others", "robots"]))
    ctx.agent.get_agent("bert").current_node_id = 2
    ctx.agent.get_agent("bert").strategy = goes(1)
    anna = ctx.agent.get_agent("anna")
    anna.strategy = goes(1, 0)
    robot = SimulatedRobot(ctx, "anna", speed=10.0)
    ctx.game.add(drive("anna", robot))
    ctx.game.step()
    assert (anna.current_node_id, math.dist(robot.xy, (100.0, 0.0)) <= 3.0) == (0, True)
    ctx.game.step()
    assert (anna.current_node_id, math.dist(robot.xy, (0.0, 0.0)) <= 3.0) == (0, True)
    assert ctx.game.events == []


def test_an_agent_that_is_deleted_lets_its_robot_stand(ctx, caplog):
    ctx.game.add(drive("anna", SimulatedRobot(ctx, "anna", speed=10.0)))
    ctx.game.step()
    ctx.agent.delete_agent("anna")
    ctx.game.step()
    ctx.visual.draw_commands()
    assert "could not be drawn" not in caplog.text


def test_a_fork_does_not_move_robots(ctx):
    robot = SimulatedRobot(ctx, "anna", speed=10.0)
    rule = drive("anna", robot)
    ctx.game.add(rule)
    ahead = ctx.game.fork(1)
    ahead.run(2)
    assert ahead.ctx.agent.get_agent("anna").current_node_id == 2
    assert robot.clock.now() == 0.0
    assert robot.xy == (0.0, 0.0)


def test_a_game_can_be_reset_and_restored_with_robots_that_drive_back(ctx):
    ctx.game.add(drive("anna", SimulatedRobot(ctx, "anna", speed=10.0)))
    ctx.game.run(2)
    ctx.game.reset()
    ctx.game.run(1)
    assert ctx.agent.get_agent("anna").current_node_id == 1
    assert ctx.game.events == []


def test_closing_the_window_while_a_turn_waits_ends_the_game_after_it(monkeypatch):
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with gamms.create_context(seed=1, vis_engine="PYGAME", vis_kwargs={"simulation_time_constant": 0.0}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3, spacing=100.0))
        ctx.agent.create_agent("anna", start_node_id=0, strategy=goes(1))
        robot = Scripted(SimulatedClock(), (0, 0))
        ctx.game.add(drive("anna", robot))
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        result = ctx.game.run(5)
        assert (result.turns, result.reason) == (1, "closed")
        assert ctx.is_terminated()


def test_an_agent_that_is_out_of_the_game_is_not_waited_for(ctx):
    clock = SimulatedClock()
    ctx.game.add(drive("anna", lambda: None, clock=clock))
    ctx.game.eliminate("anna")
    ctx.game.step()
    assert clock.now() == 0.0


def test_errors_for_wrong_arguments_name_right_ones(ctx):
    ctx.agent.create_agent("kite", start_node_id=0, type="AERIAL", position=(0.0, 0.0, 5.0), speed=1.0)
    cases = [
        (lambda: drive(3, print), BadType, "agent"),
        (lambda: drive("anna", None), BadType, "A feed is a function"),
        (lambda: drive("anna", "gps.txt"), BadType, "A feed is a function"),
        (lambda: drive("anna", list, clock=3), BadType, r"A clock has now\(\) and sleep"),
        (lambda: SimulatedRobot(ctx, "anna", clock=3), BadType, r"A clock has now\(\) and sleep"),
        (lambda: drive("anna", list, send=3), BadType, "send must be a function"),
        (lambda: drive("anna", list, limit_s=math.inf), BadValue, "limit_s must be finite"),
        (lambda: drive("anna", list, checks=3), BadType, "checks must be gamms.bridge.FixChecks"),
        (
            lambda: drive("anna", list, checks=FixChecks(within_m=0)),
            BadValue,
            "within_m of FixChecks must be more than 0",
        ),
        (lambda: drive("anna", Feed(clock=SimulatedClock()), clock=SimulatedClock()), BadValue, "a clock of its own"),
        (lambda: ctx.game.add(drive("ana", list)), UnknownName, "anna"),
        (lambda: ctx.game.add(drive("kite", list)), BadType, "flies"),
    ]
    for call, kind, words in cases:
        with pytest.raises(kind, match=words):
            call()
    ctx.game.add(drive("anna", list))
    with pytest.raises(Duplicate):
        ctx.game.add(drive("anna", list))
    with pytest.raises(BadValue, match="different clocks"):
        ctx.game.add(drive("bert", list, clock=SimulatedClock()))


def test_a_feed_that_returns_nonsense_is_an_error_that_says_what_a_fix_is(ctx):
    ctx.game.add(drive("anna", lambda: {"x": 1.0, "z": 3.0}, clock=SimulatedClock()))
    with pytest.raises(BadValue, match="A fix has no 'z'"):
        ctx.game.step()
