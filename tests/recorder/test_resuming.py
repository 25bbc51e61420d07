"""`Recording.resume`: a game goes on from any turn of its recording as it went on then, or otherwise."""

import io
from random import Random

import numpy as np
import pytest
from fuzzing import parts_of, rebuilt

import gamms
from gamms import recorder, scenario
from gamms.agent import AgentType
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir import packed_bytes, packing
from gamms.recorder import RecordingError
from gamms.recorder.formats import blocks
from gamms.rules import Conflicts, at_random, capture_flag, last_team, reach, tag, territory, time_limit
from gamms.sensor import SensorType
from gamms.strategies import chase, first, flee, goto, guard, mix, random_walk

QUIET = {"level": "CRITICAL"}


def context(seed=3, size=8):
    ctx = gamms.create_context(seed=seed, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(size, size, 10.0))
    return ctx


def opened(stream):
    return recorder.open(io.BytesIO(stream.getvalue()))


def add_team(ctx, team, starts, strategy, **more):
    for i, node in enumerate(starts):
        ctx.agent.create_agent(f"{team}_{i}", start_node_id=node, team=team, strategy=strategy, **more)


def played(ctx, turns=None):
    """The recording of a game that is played to its end."""
    stream = io.BytesIO()
    with ctx:
        ctx.record.start(stream)
        ctx.game.run(turns)
        ctx.record.stop()
    return opened(stream)


def assert_goes_on(recording, ctx, turn):
    """Play a game that was resumed, and compare what it comes to with what it came to before."""
    left = recording.turns - turn
    if left:
        again = played(ctx, left)
        assert again.turns == left
        assert list(again.events()) == list(recording.events(turn + 1))
    else:
        assert ctx.game.over == recording[-1].over
        again = None
    for k in range(left + 1 if again else 0):
        one, other = recording[turn + k], again[k]
        for column, values in one.agents.items():
            assert values.tolist() == pytest.approx(other.agents[column].tolist(), nan_ok=True, abs=0), (k, column)
        assert (one.scores, one.data, one.over) == (other.scores, other.data, other.over)
        assert one.graph.packed == other.graph.packed


def assert_goes_on_from_anywhere(make, turns=None):
    recording = played(make(), turns)
    for turn in sorted({0, 1, recording.turns // 2, recording.turns - 1}):
        assert_goes_on(recording, recording.resume(turn, ctx=make()), turn)


# -- what goes on -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("where", [0, "starts of blue", None])
def test_captures_races_and_last_teams_go_on(where):
    def make():
        ctx = context()
        flags = {"red": 0, "blue": 63}
        for team, starts, goal in (("red", (0, 1, 8), 63), ("blue", (63, 62, 55), 0)):
            home = guard(ctx, flags[team], radius=20.0)
            add_team(ctx, team, starts, first(mix(0.6, goto(ctx, goal), home), random_walk))
        ctx.game.conflicts = Conflicts(1, allow_swaps=False, resolve=at_random())
        ground = territory.halves(ctx) if where == 0 else None
        if ground:
            ctx.game.add(territory.published(ground))
        ctx.game.add(tag("red", "blue", then="respawn"))
        ctx.game.add(capture_flag(flags, territory="territory" if ground else None, goal=2))
        if where is not None:
            ctx.game.add(reach("red", where, score=1))
        ctx.game.add(last_team())
        ctx.game.add(time_limit(40))
        return ctx

    assert_goes_on_from_anywhere(make)


def test_flyers_and_agents_with_speed_go_on():
    def circle(state):
        angle = state["turn"] / 3.0
        state["action"] = (np.cos(angle), np.sin(angle), float(state["rng"].normal()))

    def make():
        ctx = context()
        add_team(ctx, "air", (5,), circle, type=AgentType.AERIAL, speed=4.0)
        add_team(ctx, "ground", (0, 7), goto(ctx, 63), speed=2.5)
        ctx.game.add(tag("air", "ground", euclid=25.0, then="respawn"))
        return ctx

    assert_goes_on_from_anywhere(make, turns=15)


@pytest.mark.parametrize(("unit", "speeds"), [("edges", (0.5, 1.5, 0.3)), ("metres", (4.0, 13.0, 25.0))])
def test_parts_of_edges_go_on_from_any_turn(unit, speeds):
    def wander(state):
        state["action"] = 63 if state["rng"].random() < 0.7 else state["legal"][-1]

    def make():
        ctx = context()
        ctx.game.speed_unit = unit
        for i, speed in enumerate(speeds):
            add_team(ctx, f"team_{i}", (i, 8 * i), goto(ctx, 63) if i else wander, speed=speed)
        return ctx

    recording = played(make(), 14)
    for turn in range(14):
        assert_goes_on(recording, recording.resume(turn, ctx=make()), turn)
    with recording.resume(5, ctx=make()) as ctx:
        ends = []
        for _ in range(2):
            ctx.game.run(3)
            ends.append([agent.current_node_id for agent in ctx.agent.create_iter()])
            ctx.game.reset()
        assert ends[0] == ends[1] == recording[8].agents["node"].tolist()


def test_an_agent_that_was_set_elsewhere_between_turns_has_begun_no_edge_there():
    def make():
        ctx = context()
        add_team(ctx, "red", (0,), goto(ctx, 2), speed=0.5)
        return ctx

    stream = io.BytesIO()
    with make() as ctx:
        ctx.record.start(stream)
        ctx.game.step()
        agent = ctx.agent.get_agent("red_0")
        agent.state["action"] = 9
        agent.set_state()
        ctx.visual.simulate()
        ctx.game.run(3)
        ctx.record.stop()
    recording = opened(stream)
    with recording.resume(2, ctx=make()) as ctx:
        ctx.game.run(3)
        assert ctx.agent.get_agent("red_0").current_node_id == recording[5].agents["node"][0]


def test_the_game_of_a_scenario_goes_on_from_its_recording_alone(tmp_path):
    file = tmp_path / "game.yaml"
    file.write_text(
        "map: {grid: {width: 6, height: 6}}\n"
        "teams:\n"
        '  red: {count: 2, strategy: "gamms.strategies:random_walk"}\n'
        '  blue: {count: 2, strategy: "gamms.strategies:random_walk"}\n'
        "rules: [{rule: tag, with: {taggers: red, tagged: blue}}]\n"
        "max_turns: 12\nseed: 4\n"
    )
    recording = played(scenario.load(file).build())
    again = scenario.Scenario(**recording.header["scenario"])
    assert again.play() == scenario.load(file).play()
    assert_goes_on(recording, recording.resume(5, ctx=again.build()), 5)


# -- what begins there ------------------------------------------------------------------------------------------


def race(seed=3):
    ctx = context(seed)
    add_team(ctx, "red", (0, 1), random_walk)
    add_team(ctx, "blue", (62, 63), random_walk)
    return ctx


@pytest.fixture(scope="module")
def recording():
    return played(race(), 20)


def test_another_seed_or_strategy_branches_the_game(recording):
    with recording.resume(10, {"red": random_walk, "blue": random_walk}, seed=99) as ctx:
        assert ctx.seed == 99
        branch = played(ctx, 10)
    assert branch[0].agents["node"].tolist() == recording[10].agents["node"].tolist()
    assert branch[10].agents["node"].tolist() != recording[20].agents["node"].tolist()
    with recording.resume(10, {"red_0": random_walk}) as ctx:
        branch = played(ctx, 10)
    nodes = branch[10].agents["node"].tolist()
    assert nodes[0] == recording[20].agents["node"][0]
    assert nodes[1:] == recording[10].agents["node"].tolist()[1:]  # who has no strategy stays


def test_agents_began_where_the_game_began_not_where_it_was_resumed(recording):
    with recording.resume(10) as ctx:
        assert [ctx.game.start_node(name) for name in ctx.agent.agents] == [0, 1, 62, 63]
        late = ctx.agent.create_agent("late", start_node_id=5)
        assert ctx.game.start_node(late) == 5


def test_a_reset_of_the_recorded_game_is_no_obstacle():
    def make():
        ctx = race()
        ctx.game.add(lambda ctx: ctx.game.emit("turn", n=ctx.game.turn))
        return ctx

    stream = io.BytesIO()
    with make() as ctx:
        ctx.record.start(stream)
        ctx.game.run(6)
        ctx.game.reset(8)
        ctx.game.run(6)
        ctx.record.stop()
    with opened(stream) as found:
        assert found.turns == 12
        with found.resume(9, ctx=make(), seed=8) as ctx:
            assert ctx.game.turn == 3
            assert [event["n"] for event in ctx.game.events] == [1, 2, 3]
            ctx.game.run(3)
            assert [agent.current_node_id for agent in ctx.agent.create_iter()] == found[12].agents["node"].tolist()


def test_a_game_that_was_reset_to_another_seed_goes_on_by_that_seed():
    teams = {"red": {"count": 2, "strategy": "gamms.strategies:random_walk"}}
    game = scenario.Scenario(seed=1, map={"grid": {"width": 6, "height": 6}}, teams=teams)
    stream = io.BytesIO()
    with game.build() as ctx:
        ctx.record.start(stream)
        ctx.game.run(4)
        ctx.game.reset(5)
        ctx.game.run(6)
        ctx.record.stop()
        end = ctx.game.result()
    recording = opened(stream)
    assert (recording.seed, recording.turns) == (1, 10)
    for turn, seed in ((2, 1), (4, 1), (5, 5), (8, 5)):
        with recording.resume(turn, ctx=game.build()) as ctx:
            assert ctx.seed == seed
            if seed == 5:
                ctx.game.run(10 - turn)
                assert [agent.current_node_id for agent in ctx.game.agents] == [
                    one["node"] for one in end.agents.values()
                ]
                begun = game.build(seed=5)
                assert [ctx.game.start_node(agent) for agent in ctx.game.agents] == [
                    agent.current_node_id for agent in begun.game.agents
                ]
                begun.terminate()
    with recording.resume(8, seed=3) as ctx:
        assert ctx.seed == 3


def test_a_replay_leaves_the_game_where_it_was():
    def make():
        ctx = race()
        ctx.game.add(lambda ctx: ctx.game.data.update(lot=float(ctx.rng.random())))
        return ctx

    stream = io.BytesIO()
    with make() as ctx:
        ctx.record.start(stream)
        ctx.game.run(9)
        ctx.record.stop()
        stream.seek(0)
        with make() as other:
            for _ in other.record.replay(stream):
                pass
            assert other.game.turn == ctx.game.turn == 9
            for one in (ctx, other):
                one.game.run(5)
            assert other.game.data == ctx.game.data
            nodes = [[agent.current_node_id for agent in one.agent.create_iter()] for one in (ctx, other)]
            assert nodes[0] == nodes[1]


# -- what cannot be ---------------------------------------------------------------------------------------------


def test_resuming_refuses_unknown_turns_and_strategies(recording):
    with pytest.raises(BadValue, match="no state after 21 turns"):
        recording.resume(21)
    with pytest.raises(UnknownName, match="red"):
        recording.resume(3, {"rde": random_walk})
    with pytest.raises(BadType, match="strategies must be a dict"):
        recording.resume(3, random_walk)
    with pytest.raises(BadType, match="A strategy must be a function"):
        recording.resume(3, {"red": 5})
    with race(4) as ctx:
        with pytest.raises(BadValue, match="vis_engine"):
            recording.resume(3, ctx=ctx, vis_engine=gamms.visual.Engine.NO_VIS)
        ctx.graph.graph.remove_node(40)
        with pytest.raises(RecordingError, match="not those of the recording"):
            recording.resume(3, ctx=ctx)
        assert ctx.agent.get_agent("red_0").current_node_id == 0
        assert ctx.seed == 4


def test_chasing_and_fleeing_go_on():
    def make():
        ctx = context()
        for i, (team, node) in enumerate((("red", 0), ("red", 7), ("blue", 36), ("blue", 27))):
            eyes = ctx.sensor.create_sensor(f"eyes_{i}", SensorType.AGENT_RANGE, sensor_range=60.0)
            move = chase(ctx, otherwise=random_walk) if team == "red" else flee(ctx, otherwise=random_walk)
            name = f"{team}_{i}"
            ctx.agent.create_agent(name, start_node_id=node, team=team, sensors={"eyes": eyes}, strategy=move)
        ctx.game.add(tag("red", "blue", then="respawn"))
        return ctx

    assert_goes_on_from_anywhere(make, turns=16)


def test_a_context_is_as_it_was_when_a_damaged_recording_cannot_be_resumed():
    def make():
        ctx = context()
        add_team(ctx, "red", [0, 9], random_walk, energy=3)
        ctx.game.run(2)
        return ctx

    stream = io.BytesIO()
    with make() as ctx:
        ctx.visual.set_agent_visual("red_0", color=(1, 2, 3), size=4)
        ctx.record.start(stream)
        ctx.game.run(4)
        ctx.record.stop()
    parts = parts_of(stream.getvalue())
    for part in parts:
        if part[0] != blocks.TURNS and part[1]:
            part[1] = packed_bytes.pack_bytes(packing.unpack_parts(part[1], 1 << 20)[0].replace(b"visible", b"visibly"))
    crafted = recorder.open(io.BytesIO(rebuilt(Random(1), parts)))
    with make() as ctx, make() as other:
        with pytest.raises(RecordingError, match="'visible'"):
            crafted.resume(3, ctx=ctx)
        for one in (ctx, other):
            one.game.run(3)
        assert ctx.game.result() == other.game.result()
        assert [agent.current_node_id for agent in ctx.game.agents] == [
            one.current_node_id for one in other.game.agents
        ]


@pytest.mark.parametrize("is_built", [False, True])
def test_an_agent_that_was_deleted_is_in_the_result_where_it_was_last(is_built):
    def build():
        ctx = context()
        add_team(ctx, "red", [0, 9, 20], random_walk)
        return ctx

    def thin_out(ctx):
        if ctx.game.turn == 3:
            ctx.agent.delete_agent("red_1")

    stream = io.BytesIO()
    with build() as ctx:
        ctx.game.add(thin_out)
        ctx.record.start(stream)
        ends = {name: one["node"] for name, one in ctx.game.run(8).agents.items()}
        ctx.record.stop()
    strategies = None if is_built else {"red": random_walk}
    with opened(stream).resume(5, strategies, ctx=build() if is_built else None) as again:
        assert {name: one["node"] for name, one in again.game.run(3).agents.items()} == ends
        assert len(ends) == 3


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_a_game_resumed_at_any_turn_knows_the_agents_that_have_departed_by_then(phase):
    """They are in its result, neither earlier nor later than in that of the game, each where it was last."""

    def thin_out(ctx):
        gone = {2: "red_1", 4: "red_2", 5: "late"}.get(ctx.game.turn)
        if ctx.game.turn == 3:
            ctx.agent.create_agent("late", team="red", start_node_id=4, strategy=random_walk)
        if gone is not None:
            ctx.agent.delete_agent(gone)

    def list_places(ctx):
        return {name: (one["node"], one["alive"], one["team"]) for name, one in ctx.game.result().agents.items()}

    stream = io.BytesIO()
    with context() as ctx:
        add_team(ctx, "red", [0, 9, 20, 3], random_walk)
        ctx.game.add(thin_out, phase=phase)
        ctx.record.start(stream)
        known = [list_places(ctx)]
        for _ in range(7):
            ctx.game.step()
            known.append(list_places(ctx))
        ctx.record.stop()
    assert len({*map(len, known)}) == 2
    for turn in range(8):
        with opened(stream).resume(turn, {"red": random_walk}) as again:
            assert list_places(again) == known[turn]
