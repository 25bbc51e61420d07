"""A turn that an error or Ctrl-C ends before it is counted leaves the game, and its recording, as they were before."""

import io
import signal
import sys
from contextlib import contextmanager, nullcontext, suppress
from copy import deepcopy
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.game.messages import MessageTraffic
from gamms.game.turn import TurnEngine
from gamms.ir.deeds import DeedLog, PlainDeeds
from gamms.recorder.detached import DetachedState
from gamms.rules import Conflicts, meetings, tag
from gamms.scenario import Scenario
from gamms.strategies import random_walk
from gamms.typing.sensor_engine import find_owner
from gamms.visual.engine import PictureEngine
from gamms.visual.shown_turn import PastTurns

TURNS = 5
PACKAGE = str(Path(gamms.__file__).parent)
ERRORS = (ZeroDivisionError, KeyboardInterrupt)
EYES = [
    {"type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.7},
    {"type": "AGENT_RANGE", "sensor_range": 35.0, "delay_turns": 2, "position_noise_m": 9.0},
    {"type": "AGENT", "false_alarm_rate": 0.4},
    {"type": "AGENT_RANGE", "sensor_range": 25.0},
]
SETTINGS = [
    {},
    {"speed_unit": "edges"},
    {"speed_unit": "metres"},
    {"speed_unit": "metres", "decide": "arrival"},
]
GUARDS = {
    "map": {"grid": {"rows": 3, "columns": 3}},
    "sensors": {"eyes": EYES[3]},
    "teams": {"red": {"count": 3, "sensors": ["eyes"]}},
}
WALKERS = {"map": {"grid": {"rows": 6, "columns": 6}}, "teams": {"red": {"count": 30}}}
CHANNELS = {"radio": {"range_m": 30.0, "delay_turns": 1}}


def ring_bell():
    """Yield the error that is due, None: none; after an error and the number of calls until then were sent."""
    error, calls = None, 0
    while True:
        sent = yield error if calls == 1 else None
        error, calls = sent or (error, calls - 1)


BELL = ring_bell()  # generators are not inspected as other variables that functions change are
next(BELL)


def call():
    """Raise the error that is due."""
    error = BELL.send(None)
    if error is not None:
        raise error


def wander(state):
    """Walk and talk, as follows from what the agent knows."""
    seen = [place for _, look in state["sensor"].values() for place in look.values()]
    lot = state["draw"].below(1000) + sum(seen) + len(state.get("inbox", ()))
    lot += int(state["rng"].integers(9))
    node = state["legal"][lot % len(state["legal"])]
    state["action"] = {"node_id": node, "do": {"mark": None, "dig": None} if lot % 2 else {"mark": None}}
    if "outbox" in state:
        state["outbox"].append({"channel": "radio", "to": None, "body": lot % 9})
    call()


def come_and_go(ctx):
    """Let an agent come and another one go before the moves, and count the rest."""
    ctx.game.scores["red"] += len(ctx.game.agents)
    ctx.game.emit("counted", number=int(ctx.rng.integers(99)))
    if ctx.game.turn == 1:
        ctx.agent.create_agent("newcomer", team="blue", start_node_id=7, strategy=wander)
    if ctx.game.turn == 3 and "red_1" in ctx.agent.agents:
        ctx.agent.delete_agent("red_1")
    call()


def pay(ctx):
    """Let teams pay for what their agents do."""
    for deed in ctx.game.performed("mark"):
        ctx.game.scores[deed.team] -= 1
    call()


def refuse_some(ctx):
    """Refuse the move of an agent."""
    agent = ctx.game.agents[ctx.game.turn % len(ctx.game.agents)]
    ctx.game.refuse(agent, "it is tired")
    call()


def watch(ctx):
    """Do nothing after the moves; the check refuses moves."""


def resolve(contest, ctx):
    """Let the first agents win."""
    call()
    return [mover.agent for mover in contest.movers][: contest.places]


watch.check = refuse_some


def build(parts, seed):
    """Return a context with a game of some parts."""
    team = {"count": 2, "speed": parts["speed"], "sensors": ["eyes"] if parts["eyes"] else []}
    game = Scenario(
        map={"grid": {"width": 4, "height": 4, "spacing": 10.0}},
        teams={"red": team, "blue": team},
        sensors={"eyes": parts["eyes"]} if parts["eyes"] else {},
        channels=CHANNELS if parts["talks"] else {},
        settings={"deeds": {"mark": {}, "dig": {"fields": {}, "turns": 1.5}}, **parts["settings"]},
        max_turns=TURNS,
    )
    ctx = game.build(seed=seed, strategies={"red": wander, "blue": wander})
    if parts["order"]:
        ctx.game.order = [["red"], ["blue"]]
    if parts["acts"]:
        ctx.game.add(come_and_go, phase="before")
        ctx.game.add(pay, phase="deeds")
        ctx.game.add(watch)
    if parts["conflicts"]:
        ctx.game.conflicts = Conflicts(1, resolve=resolve)
    return ctx


PARTS = st.fixed_dictionaries(
    {
        "eyes": st.none() | st.sampled_from(EYES),
        "settings": st.sampled_from(SETTINGS),
        "speed": st.sampled_from([1.0, 12.0]),
        "order": st.booleans(),
        "talks": st.booleans(),
        "acts": st.booleans(),
        "conflicts": st.booleans(),
    }
)


def plain(result):
    values = result.to_dict()
    del values["timings"], values["provenance"]
    return values


def play(parts, seed, error=None, calls=0):
    """Play a game in which a function raises at one of its calls; return the result and the recording."""
    file = io.BytesIO()
    BELL.send((error, calls))
    with build(parts, seed) as ctx:
        ctx.record.start(file, sensed=True)
        while ctx.game.turn < TURNS:
            with suppress(*ERRORS):
                ctx.game.step()
        ctx.record.stop()
        return plain(ctx.game.result()), file.getvalue()


def play_batch(parts, seeds, error=None, calls=0):
    BELL.send((error, calls))
    with build(parts, 3) as ctx, ctx.game.batch(seeds=seeds) as games:
        while (games.turn < TURNS).any():
            with suppress(*ERRORS):
                games.step()
        return [plain(games.result(number)) for number in range(len(seeds))]


@settings(deadline=None, max_examples=15)
@given(PARTS, st.sampled_from(ERRORS), st.integers(1, 60), st.sampled_from([[3], [3, 4]]))
def test_a_game_goes_on_after_an_interrupted_turn_as_if_it_had_not_been(parts, error, calls, seeds):
    assert play(parts, 3, error, calls) == play(parts, 3)
    assert play_batch(parts, seeds, error, calls) == play_batch(parts, seeds)


@pytest.mark.parametrize("error", ERRORS)
def test_a_late_sensor_looks_as_often_as_in_a_game_without_the_interrupted_turn(error):
    parts = {"eyes": EYES[1], "settings": {}, "speed": 1.0, "order": False, "talks": False, "acts": False}
    parts["conflicts"] = False
    assert play(parts, 3, error, 7) == play(parts, 3)


def test_a_deed_that_lasts_goes_on_as_in_a_game_without_the_interrupted_turn():
    parts = {"eyes": None, "settings": {}, "speed": 1.0, "order": True, "talks": False, "acts": False}
    parts["conflicts"] = False
    assert play(parts, 3, ZeroDivisionError, 7) == play(parts, 3)
    assert play_batch(parts, [3, 4], ZeroDivisionError, 7) == play_batch(parts, [3, 4])


def record_to_end(ctx):
    """Play a game to its end, also after divisions by zero, and return the bytes of its recording."""
    file = io.BytesIO()
    ctx.record.start(file)
    while ctx.game.turn < TURNS:
        with suppress(ZeroDivisionError):
            ctx.game.step()
    ctx.record.stop()
    return file.getvalue()


def test_reports_are_recorded_as_if_an_interrupted_turn_with_another_map_had_not_been():
    def record(spades):
        def dig(ctx):
            if ctx.game.turn == 2 and next(spades, False):
                ctx.graph.graph.add_node({"id": 99, "x": 1.0, "y": 1.0})

        def walk(state):
            state["action"] = state["legal"][-1]
            if ctx.graph.graph.has_node(99):
                raise ZeroDivisionError

        with gamms.create_context(seed=1) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, 10.0))
            for name, node in (("a", 0), ("b", 4)):
                eyes = ctx.sensor.create_sensor(f"eyes of {name}", "agent_range", sensor_range=12.0)
                ctx.agent.create_agent(name, start_node_id=node, sensors=[eyes], strategy=walk)
            ctx.game.add(dig, phase="before")
            return record_to_end(ctx)

    assert record(spade for spade in [True]) == record(spade for spade in [])


def test_teams_that_have_moved_go_back_when_a_later_team_raises():
    def fail(state):
        state["action"] = state["legal"][-1]
        if state["turn"] == 1 and not state["memory"].setdefault("failed", []):
            state["memory"]["failed"].append(1)
            raise ZeroDivisionError

    def go(state):
        state["action"] = state["legal"][-1]

    with gamms.create_context(seed=1, game={"order": [["red"], ["blue"]]}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 9))
        red = ctx.agent.create_agent("a", start_node_id=0, team="red", strategy=go)
        ctx.agent.create_agent("b", start_node_id=4, team="blue", strategy=fail)
        ctx.game.step()
        before = plain(ctx.game.result()), red.current_node_id, red.prev_node_id, ctx.game.moves
        with pytest.raises(ZeroDivisionError):
            ctx.game.step()
        assert (plain(ctx.game.result()), red.current_node_id, red.prev_node_id, ctx.game.moves) == before
        ctx.game.step()
        assert (ctx.game.turn, red.current_node_id) == (2, 2)


def test_a_turn_in_which_a_rule_raises_after_the_moves_is_counted_alone_and_in_a_batch_of_one():
    def fall(ctx):
        if ctx.game.turn == 2:
            raise ZeroDivisionError

    def walk(state):
        state["action"] = state["legal"][state["draw"].below(len(state["legal"]))]

    game = Scenario(map={"grid": {"rows": 3, "columns": 3}}, teams={"red": {"count": 1}}, max_turns=3)
    with game.build(seed=1, strategies={"red": walk}) as ctx:
        ctx.game.add(fall)
        with ctx.game.batch(1) as games, ctx.game.fork(0).ctx as alone:
            alone.game.reset(seed=0)
            for play_on in (games.run, alone.game.run):
                with pytest.raises(ZeroDivisionError):
                    play_on()
            assert (games.turn.tolist(), alone.game.turn) == ([2], 2)
            games.run()
            assert plain(games.result(0)) == plain(alone.game.run())


class Thing:
    """A value of a program, during whose description Ctrl-C may be pressed."""

    def __init__(self, *, is_interrupted):
        self.is_interrupted = is_interrupted

    def __repr__(self):
        if self.is_interrupted:
            signal.raise_signal(signal.SIGINT)
        return "a thing"


def record_things(interrupted_turn):
    """Return the recording of a game whose data have another thing in each turn."""

    def renew(ctx):
        ctx.game.data["things"] = [Thing(is_interrupted=ctx.game.turn == interrupted_turn)] * ctx.game.turn

    file = io.BytesIO()
    with Scenario(**WALKERS).build(seed=1, strategies={"red": random_walk}) as ctx:
        ctx.game.add(renew)
        ctx.record.start(file)
        for _ in range(3):
            with suppress(KeyboardInterrupt):
                ctx.game.step()
        ctx.record.stop()
    return file.getvalue()


def test_ctrl_c_waits_until_a_counted_turn_is_recorded():
    assert record_things(interrupted_turn=2) == record_things(interrupted_turn=None)


@contextmanager
def pressing_ctrl_c(function):
    """Press Ctrl-C when a function is called first in the block."""

    def press(frame, *_):
        if frame.f_code is function.__code__:
            sys.settrace(before)
            signal.raise_signal(signal.SIGINT)

    before = sys.gettrace()
    sys.settrace(press)
    try:
        yield
    finally:
        sys.settrace(before)


@pytest.mark.parametrize(
    "function", [MessageTraffic.begin_turn, PastTurns.end_turn, TurnEngine._show, PictureEngine.simulate]
)
def test_ctrl_c_between_the_moves_and_the_end_of_a_turn_changes_no_recording(function):
    def record(interrupting):
        file = io.BytesIO()
        with build(parts, 3) as ctx:
            ctx.record.start(file)
            with suppress(KeyboardInterrupt), interrupting:
                ctx.game.step()
            while ctx.game.turn < TURNS:
                ctx.game.step()
            ctx.record.stop()
        return file.getvalue()

    parts = {"eyes": None, "settings": {}, "speed": 1.0, "order": True, "talks": True, "acts": False}
    parts["conflicts"] = False
    BELL.send((None, 0))
    assert record(pressing_ctrl_c(function)) == record(nullcontext())


def test_a_turn_whose_listener_raises_is_recorded():
    def record(is_failing):
        def fail():
            if is_failing and ctx.game.turn == 2:
                raise ZeroDivisionError

        with Scenario(**WALKERS).build(seed=1, strategies={"red": random_walk}) as ctx:
            ctx.visual.after_turn.append(fail)
            return record_to_end(ctx)

    assert record(is_failing=True) == record(is_failing=False)


@contextmanager
def pressing_ctrl_c_at(line):
    """Press Ctrl-C at a line of GAMMS, by its number in the order in which the block executes lines.

    Yields a list; it is empty if the block has fewer lines.
    """
    lines = 0
    pressed = []

    def enter(frame, *_):
        is_ours = PACKAGE in frame.f_code.co_filename and "progress" not in frame.f_code.co_filename
        return count if is_ours and not pressed else None

    def count(_, event, __):
        nonlocal lines
        lines += event == "line"
        if lines == line:
            sys.settrace(before)
            pressed.append(line)
            signal.raise_signal(signal.SIGINT)
        return count

    before = sys.gettrace()
    sys.settrace(enter)
    try:
        yield pressed
    finally:
        sys.settrace(before)


def create(ctx):
    eye = {"type": "agent_range", "sensor_range": 9.0}
    ctx.agent.create_agent("newcomer", team="blue", start_node_id=7, strategy=random_walk, sensors={"eye": eye})


def create_several(ctx):
    ctx.agent.create_team("newcomer", [7, 8], strategy=random_walk)


def delete(ctx):
    ctx.agent.delete_agent("red_1")


def drop_sensor(ctx):
    ctx.agent.get_agent("red_1").deregister_sensor("eyes")


def begin_again(ctx):
    ctx.game.reset(seed=5)


def take_snapshot(ctx):
    ctx.game.snapshot()


@pytest.mark.parametrize(
    ("change", "stride"),
    [(create, 41), (create_several, 41), (delete, 23), (drop_sensor, 5), (begin_again, 307), (take_snapshot, 19)],
)
def test_ctrl_c_leaves_a_game_as_before_or_after_a_change_between_turns(change, stride):
    def play_on(line):
        """Change a game, again if Ctrl-C came before; return all that is known of it, and whether it came."""
        file = io.BytesIO()
        with Scenario(**GUARDS).build(seed=1, strategies={"red": random_walk}) as ctx:
            ctx.record.start(file)
            ctx.game.step()
            ctx.agent.delete_agent("red_0")
            count = len(ctx.agent.agents)
            with suppress(KeyboardInterrupt), pressing_ctrl_c_at(line) as pressed:
                change(ctx)
            if len(ctx.agent.agents) == count:
                change(ctx)
            ctx.game.step()
            agents = [(one.name, one.current_node_id, one.team) for one in ctx.agent.create_iter()]
            owners = {name: find_owner(sensor) for name, sensor in ctx.sensor.sensors.items()}
            ctx.record.stop()
            return (agents, owners, plain(ctx.game.result()), file.getvalue()), bool(pressed)

    after, _ = play_on(0)
    line = 1
    while True:
        found, was_pressed = play_on(line)
        assert found == after, line
        if not was_pressed:
            break
        line += stride
    assert line > 5 * stride


@pytest.mark.parametrize(("phase", "is_needed"), [("before", True), ("deeds", True), ("after", False)])
def test_a_checkpoint_is_taken_only_of_games_whose_rules_may_raise_before_the_moves(phase, is_needed):
    def rule(ctx):
        """Do nothing."""

    with Scenario(**WALKERS).build(seed=1) as ctx:
        ctx.game.add(rule, phase=phase)
        ctx.game.step()
        turns = ctx.game.internals.parts.turns
        assert turns.needs_checkpoint == is_needed
        rule.check = print
        assert turns.needs_checkpoint


def test_no_states_are_made_for_the_checkpoints_of_turns_that_the_core_decides():
    with Scenario(**WALKERS).build(seed=1, strategies={"red": random_walk}) as ctx:
        ctx.game.add(lambda ctx: None, phase="before")
        for _ in range(3):
            ctx.game.step()
        turns = ctx.game.internals.parts.turns
        assert turns.needs_checkpoint
        assert turns.unread is not None


def test_deeds_that_were_wanted_in_an_interrupted_turn_are_not_done_in_the_next_one():
    log = DeedLog()
    log.request_deeds(PlainDeeds(0, [(0, 0, 0, "red_0", "mark", 1, 4, {})]))
    log.go_to([])
    log.do(0, is_first=True)
    assert log.list_rows_in_turn(0, 1, is_moving=False) == []


class Follower:
    """Follows a game that is recorded."""

    begun = 0

    def begin(self, header, state):
        self.begun += 1
        self.state = DetachedState(deepcopy(state))

    def hear(self, log, *, is_over):
        self.state.apply(log)


def test_who_follows_a_game_begins_again_before_the_interrupted_turn():
    parts = {"eyes": EYES[0], "settings": {}, "speed": 1.0, "order": True, "talks": False, "acts": True}
    parts["conflicts"] = False
    follower = Follower()
    BELL.send((ZeroDivisionError, 23))
    with build(parts, 3) as ctx:
        ctx.record.start(io.BytesIO(), sensed=True)
        ctx.record.follow(follower)
        with pytest.raises(ZeroDivisionError):
            ctx.game.run()
        assert follower.begun == 2
        ctx.game.run()
        nodes = {agent.name: agent.current_node_id for agent in ctx.agent.create_iter()}
        keyframe = follower.state.make_keyframe(ctx.game.turn)
        assert dict(zip(keyframe["names"], keyframe["node"].tolist(), strict=True)) == nodes
        assert follower.state.game.scores == ctx.game.scores
        ctx.record.unfollow(follower)


@pytest.mark.parametrize("unit", ["edges", "metres"])
def test_shipped_rules_go_on_after_ctrl_c_at_any_line_that_makes_their_columns(unit):
    making = {"take_agents", "make_scratch", "_make_room", "make_tracks", "renew_rules"}
    lines = {}

    def play(line):
        def trace(frame, event, _):
            if frame.f_code.co_filename != meetings.__file__ or frame.f_code.co_name not in making:
                return None
            if event == "line":
                if frame.f_lineno == line:
                    raise KeyboardInterrupt
                lines.setdefault(frame.f_lineno)
            return trace

        speed = {"speed": 10.0} if unit == "metres" else {}
        with gamms.create_context(seed=1, game={"speed_unit": unit}) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 9, spacing=10.0))
            for team, node in (("red", 0), ("blue", 8)):
                ctx.agent.create_agent(team, start_node_id=node, team=team, strategy=random_walk, **speed)
            ctx.game.add(tag("red", "blue"))
            before = sys.gettrace()
            try:
                sys.settrace(trace)
                ctx.game.run(3)
            except KeyboardInterrupt:
                ctx.game.run(3 - ctx.game.turn)
            finally:
                sys.settrace(before)
            return ctx.game.result().agents, ctx.game.turn

    wanted = play(None)
    assert len(lines) > 20
    for line in [*lines]:
        assert play(line) == wanted


def test_an_agent_goes_on_from_its_place_before_the_turn_if_ctrl_c_comes_while_arrivals_end():
    def walk(state):
        state["action"] = state["legal"][-1]

    def play(stop):
        def trace(frame, event, _):
            nonlocal stop
            if Path(frame.f_code.co_filename).name != "arrivals.py" or frame.f_code.co_name != "close":
                return None
            if event == "line":
                stop -= 1
                if stop == 0:
                    raise KeyboardInterrupt
            return trace

        with gamms.create_context(seed=1, game={"speed_unit": "metres", "decide": "arrival"}) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 9, spacing=10.0))
            agents = [ctx.agent.create_agent(name, start_node_id=0, speed=14.0, strategy=walk) for name in ("a", "b")]
            ctx.game.step()
            before = [one.xy for one in agents]
            was_traced = sys.gettrace()
            try:
                sys.settrace(trace)
                ctx.game.step()
            except KeyboardInterrupt:
                sys.settrace(was_traced)
                assert [one.xy for one in agents] == before
                ctx.game.step()
            finally:
                sys.settrace(was_traced)
            return [one.xy for one in agents]

    wanted = play(0)
    for stop in range(1, 7):
        assert play(stop) == wanted
