"""Starting again: as before the first turn, and equal to a fresh build."""

import numpy as np
import pytest

from gamms.agent import AgentType
from gamms.errors import IllegalMutation
from gamms.sensor import SensorType


def build(grid, seed=3):
    """A game with everything in it that can change."""
    ctx = grid(seed=seed)

    def wander(state):
        state["memory"]["turns"] = state["memory"].get("turns", 0) + 1
        state["team_memory"].setdefault("seen", []).append((state["name"], state["curr_pos"]))
        state["action"] = int(state["rng"].choice(state["legal"]))

    for i in range(4):
        agent = ctx.agent.create_agent(f"a{i}", start_node_id=4 * i, team=i % 2, strategy=wander, meta={"fuel": [9]})
        agent.register_sensor("seen", ctx.sensor.create_sensor(f"s{i}", SensorType.AGENT, detection=0.5, exclude=i % 2))
    drone = ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=5, speed=3.0)
    drone.register_strategy(lambda state: state.update(action=tuple(state["rng"].normal(size=3))))

    @ctx.game.add
    def rule(ctx):
        turn = ctx.game.turn
        ctx.game.data.setdefault("seen", []).append([agent.current_node_id for agent in ctx.game.agents])
        ctx.game.scores["noise"] += float(ctx.rng.random())
        ctx.agent.get_agent("a0").meta["fuel"].append(turn)
        if turn == 2:
            ctx.game.eliminate("a1")
            ctx.agent.get_agent("a2").strategy = None
            ctx.agent.get_agent("a3").team = "third"
        if turn == 3:
            ctx.agent.create_agent("late", start_node_id=0)
            ctx.agent.delete_agent("a3")
            ctx.graph.graph.remove_node(15)
            ctx.graph.add_obstacle_face(1, (1, 1, 1), (1, 2, 1), (2, 1, 0), (2, 2, 0), 1)
            ctx.game.publish(closed=[15])
        if turn == 6:
            ctx.game.end("enough", winner="nobody")

    ctx.game.data["limit"] = {"fuel": 9}
    ctx.game.publish(home=3)
    ctx.game.collect("where", lambda agent: agent.current_node_id, per="agent")
    return ctx


def test_the_same_seed_plays_the_same_game_again(grid):
    with build(grid) as ctx:
        first = ctx.game.run()
        ctx.game.reset()
        assert ctx.game.turn == 0
        assert ctx.game.run() == first
        with build(grid) as fresh:
            assert fresh.game.run() == first


def test_another_seed_is_another_game_that_equals_a_fresh_one(grid):
    with build(grid) as ctx, build(grid, seed=8) as fresh:
        first = ctx.game.run()
        ctx.game.reset(8)
        second = ctx.game.run()
        assert second != first
        assert second.seed == 8
        assert second == fresh.game.run()
        ctx.game.reset(3)
        assert ctx.game.run() == first


def test_a_reset_before_the_first_turn_sets_the_seed(grid):
    with grid(seed=1) as ctx, grid(seed=9) as other:
        ctx.game.reset(9)
        assert ctx.seed == 9
        assert ctx.rng.random() == other.rng.random()


def test_attributes_that_cannot_be_copied_are_kept(ctx, play):
    class Radio:
        def __deepcopy__(self, memo):
            raise TypeError("there is only one")

    agent = play("a", 0, 1)
    agent.radio, agent.array = radio, array = Radio(), np.arange(3)
    ctx.game.step()
    array[0] = 7
    ctx.game.reset()
    assert agent.radio is radio
    assert agent.array.tolist() == [0, 1, 2]


def test_a_thousand_games_leave_nothing_behind(grid):
    with grid(seed=1) as ctx:
        ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: state.update(action=state["legal"][-1]))
        ctx.game.add(lambda ctx: ctx.game.emit("step", agent="a"))
        results = []
        for seed in range(1000):
            ctx.game.reset(seed)
            results.append(ctx.game.run(2))
        assert len(ctx.game.events) == 2
        assert len(ctx.game.memories) == 1
        assert {result.turns for result in results} == {2}


class Nobody:
    """Conflicts in which no agent moves."""

    def resolve(self, moves, ctx):
        return set(moves)


def upset(ctx):
    """Change every setting, the rules, the collectors, the facts and the sensors."""
    game = ctx.game
    game.legal, game.on_illegal, game.on_error, game.speed_unit = "any", "raise", "stay", "metres"
    game.conflicts, game.time_budget, game.max_turns = Nobody(), 60.0, 3
    game.remove("calm")
    game.add(lambda ctx: ctx.game.scores.update(storm=1), name="storm")
    game.collect("late", lambda ctx: ctx.game.turn)
    game.publish(open=True)
    sensor = ctx.sensor.create_sensor("late", SensorType.NEIGHBOR)
    ctx.agent.get_agent("a").register_sensor("late", sensor)
    eyes = ctx.sensor.get_sensor("eyes")
    eyes.range, eyes.fov, eyes.orientation, eyes.at = 5.0, 1.0, (0.0, 1.0), 3
    eyes.notice.team, eyes.notice.exclude, eyes.notice.detection = "red", "blue", 0.5


def settled(ctx):
    """All that `upset` changes."""
    eyes = ctx.sensor.get_sensor("eyes")
    return (
        ctx.game.settings(),
        ctx.game.rules,
        ctx.game.result().collected,
        dict(ctx.game.facts),
        list(ctx.sensor.sensors),
        sorted(ctx.agent.get_agent("a").get_state()["sensor"]),
        (eyes.range, eyes.fov, eyes.orientation, eyes.at),
        (eyes.notice.team, eyes.notice.exclude, eyes.notice.detection),
        sorted(ctx.visual.artists.list_shown()),
    )


@pytest.fixture
def calm(ctx, play):
    """A game of one agent that a rule may upset in turn 2."""
    play("a", 0, 1, 2, 3, 7, 6)
    ctx.agent.get_agent("a").register_sensor("eyes", ctx.sensor.create_sensor("eyes", SensorType.AGENT_ARC))

    def calm(ctx):
        ctx.game.scores["calm"] += 1

    calm.drawer = lambda ctx, data: None
    ctx.game.add(calm)
    ctx.game.collect("turn", lambda ctx: ctx.game.turn)
    ctx.game.publish(open=False)
    ctx.game.max_turns = 6
    return ctx


def test_changes_of_a_rule_in_mid_game_are_undone(calm):
    calm.game.add(lambda ctx: upset(ctx) if ctx.game.turn == 2 else None)
    before = settled(calm)
    first = calm.game.run()
    assert settled(calm) != before
    for _ in range(2):
        calm.game.reset()
        assert settled(calm) == before
        assert calm.game.run() == first
    calm.game.reset(9)
    assert settled(calm) == before


def test_changes_of_the_program_between_turns_are_undone(calm):
    before = settled(calm)
    calm.game.run(2)
    upset(calm)
    calm.game.run(2)
    calm.game.reset()
    assert settled(calm) == before


def test_a_reset_without_a_seed_repeats_the_game_that_was_played_last(grid):
    with build(grid) as ctx:
        ctx.rng.random()  # what the program draws before the first turn belongs to the game
        first = ctx.game.run()
        ctx.game.reset(8)
        second = ctx.game.run()
        ctx.game.reset()
        assert (ctx.seed, ctx.game.run()) == (8, second)
        ctx.game.reset(5)
        ctx.game.reset(3)
        ctx.game.reset()
        assert (ctx.seed, ctx.game.run()) == (3, first)


@pytest.mark.parametrize("phase", ["before", "deeds", "after", "collector"])
@pytest.mark.parametrize("verb", ["step", "run", "reset"])
def test_a_rule_may_neither_play_nor_reset_its_game(ctx, play, phase, verb):
    play("a", 0, 1, 2, 3, 7)
    ctx.game.max_turns = 3

    def call(ctx):
        getattr(ctx.game, verb)()

    if phase == "collector":
        ctx.game.collect("called", call)
    else:
        ctx.game.add(call, phase=phase)
    wanted = rf"ctx.game.{verb} was called in the middle of a turn.*ctx.game.end"
    with pytest.raises(IllegalMutation, match=wanted):
        ctx.game.run()
    with ctx.game.batch(2) as games, pytest.raises(IllegalMutation, match=wanted):
        games.run()


def test_a_reset_to_the_seed_it_has_changes_nothing_before_the_first_turn(grid):
    with grid(seed=3) as ctx, grid(seed=3) as other:
        drawn = ctx.rng.random(), other.rng.random()
        ctx.game.reset(3)
        assert drawn[0] == drawn[1]
        assert ctx.rng.random() == other.rng.random()
