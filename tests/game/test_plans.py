"""The plan of a turn: its phases are kept until something changes that they depend on."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.rules import Conflicts, by_priority, tag


def walk(state):
    """Walk to and fro."""
    state["action"] = state["legal"][1 + state["turn"] % (len(state["legal"]) - 1)]


def stand(state):
    state["action"] = state["curr_pos"]


@pytest.fixture
def ctx():
    ctx = gamms.create_context(seed=3, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
    for name, node, team in (("a", 0, "red"), ("b", 1, "blue"), ("c", 10, "blue")):
        ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=walk)
    with ctx:
        yield ctx


def phases(ctx):
    return [entry.phase for entry in ctx.game.internals.parts.turns.plan().entries]


def test_a_plan_has_only_the_phases_that_a_game_needs(ctx):
    assert phases(ctx) == ["decide", "move"]
    ctx.game.conflicts = Conflicts(1)
    assert phases(ctx) == ["decide", "give way", "move"]
    ctx.game.order = [["red"], ["blue"]]
    ctx.game.add_channel("radio", range_m=100.0)
    assert phases(ctx) == [*["decide", "give way", "move", "join"] * 2, "send"]


def test_moves_returns_and_tags_leave_the_plan_as_it_is(ctx):
    ctx.game.add(tag("red", "blue"))
    ctx.game.step()
    plan = ctx.game.internals.parts.turns.plan()
    ctx.game.run(30)
    assert any(event["kind"] == "respawned" for event in ctx.game.events)
    assert ctx.game.internals.parts.turns.plan() is plan


@pytest.mark.parametrize(
    "change",
    [
        lambda ctx: ctx.agent.create_agent("d", start_node_id=5, team="red", strategy=stand),
        lambda ctx: ctx.agent.delete_agent("c"),
        lambda ctx: setattr(ctx.agent.get_agent("a"), "team", "blue"),
        lambda ctx: setattr(ctx.agent.get_agent("a"), "speed", 2),
        lambda ctx: ctx.agent.get_agent("a").decide_by(stand),
        lambda ctx: ctx.agent.get_agent("a").register_sensor("eyes", ctx.sensor.create_sensor("eyes", "agent")),
        lambda ctx: setattr(ctx.game, "on_error", "stay"),
        lambda ctx: ctx.game.command("red", gamms.strategies.random_walk),
        lambda ctx: ctx.game.add(lambda _: None, name="another"),
        lambda ctx: ctx.game.publish(to="red", secret=1),
    ],
)
def test_a_change_ends_the_plan(ctx, change):
    ctx.game.run(2)
    plan = ctx.game.internals.parts.turns.plan()
    change(ctx)
    assert ctx.game.internals.parts.turns.plan() is not plan
    ctx.game.step()


def test_deaths_and_returns_make_no_plan(ctx):
    ctx.game.run(2)
    plan = ctx.game.internals.parts.turns.plan()
    for name in ("a", "b", "a", "c"):
        agent = ctx.agent.get_agent(name)
        agent.alive = not agent.alive
        ctx.game.step()
        assert {move.agent for move in ctx.game.moves.values()} == {one.name for one in ctx.game.agents}
    assert ctx.game.internals.parts.turns.plan() is plan


def test_conflicts_that_a_rule_sets_in_the_middle_of_a_turn_decide_the_moves_of_that_turn(ctx):
    for name, node in (("a", 1), ("b", 6), ("c", 9)):
        ctx.agent.get_agent(name).current_node_id = node
        ctx.agent.get_agent(name).decide_by(lambda state: state.update(action=5))

    def forbid(ctx):
        ctx.game.conflicts = Conflicts(1, resolve=by_priority(["red", "blue"]))

    ctx.game.add(forbid, phase="deeds")
    ctx.game.step()
    assert {agent.name for agent in ctx.game.agents if agent.current_node_id == 5} == {"a"}


def test_the_order_of_play_that_a_rule_sets_in_a_turn_holds_from_the_next_turn_on(ctx):
    asked = []
    for name in ("a", "b", "c"):
        ctx.agent.get_agent(name).decide_by(lambda state: (asked.append(state["name"]), stand(state))[1])

    def turn(ctx):
        if ctx.game.turn == 0:
            ctx.game.order = [["blue"], ["red"]]

    ctx.game.add(turn, phase="deeds")
    for _ in range(3):
        ctx.game.step()
    assert asked == ["a", "b", "c", "b", "c", "a", "b", "c", "a"]


def test_moves_are_counted_in_a_turn_in_which_a_rule_sets_the_order_of_play(ctx):
    def turn(ctx):
        if ctx.game.turn == 1:
            ctx.game.order = [["blue"], ["red"]]

    ctx.game.add(turn, phase="deeds")
    ctx.game.run(4)
    assert [agent["moves"] for agent in ctx.game.result().agents.values()] == [4, 4, 4]


def test_the_node_below_a_drone_follows_it_while_the_plan_stays(ctx):
    def fly(state):
        state["action"] = (10.0, 0.0, 0.0)

    ctx.agent.create_agent("drone", type="AERIAL", start_node_id=0, speed=15.0, strategy=fly)
    below = []
    ctx.game.add(lambda ctx: below.append(ctx.game.internals.state.moves.starts[3]), name="look")
    for _ in range(3):
        ctx.game.step()
    assert below == [0, 1, 3]


def test_a_game_that_a_rule_ends_in_a_part_of_a_turn_skips_the_later_parts(ctx):
    asked = []
    for name in ("a", "b", "c"):
        ctx.agent.get_agent(name).decide_by(lambda state: (asked.append(state["name"]), stand(state))[1])
    ctx.game.order = [["blue"], ["red"]]
    ctx.game.add(lambda ctx: ctx.game.end("enough"), phase="deeds", name="end")
    assert not ctx.game.step()
    assert asked == ["b", "c"]
    assert ctx.game.turn == 1


@given(st.lists(st.lists(st.sampled_from("abcd"), max_size=3, unique=True), min_size=3, max_size=12))
def test_agents_that_die_and_return_play_as_if_each_turn_had_a_plan_of_its_own(changes):
    """Setting a team, to what it is, ends all plans that are kept."""
    played = []
    for has_new_plans in (False, True):
        with gamms.create_context(seed=5, logger_config={"level": "CRITICAL"}) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
            states = []

            def note(state, states=states):
                state["memory"]["asked"] = state["memory"].get("asked", 0) + 1
                states.append(
                    (state["name"], state["curr_pos"], state["blocked"], state["draw"].random(), *state["legal"])
                )
                state["action"] = state["draw"].choice(state["legal"])

            for i, name in enumerate("abcd"):
                eyes = ctx.sensor.create_sensor(name, "agent_range", sensor_range=12.0)
                ctx.agent.create_agent(name, start_node_id=2 * i, team="rb"[i % 2], strategy=note, sensors=[eyes])
            ctx.game.conflicts = Conflicts(1, resolve=by_priority(["r", "b"]), allow_swaps=False)
            ctx.game.add(tag("r", "b", hops=1, then="eliminate"))
            for names in changes:
                for name in names:
                    one = ctx.agent.get_agent(name)
                    (ctx.game.eliminate if one.alive else ctx.game.respawn)(one)
                if has_new_plans:
                    ctx.agent.get_agent("a").team = "r"
                ctx.game.step()
            game = ctx.game
            data = [agent.state.get("sensor") for agent in game.agents]
            played.append((states, game.events, game.scores, game.result().agents, dict(game.memories), data))
    assert played[0] == played[1]


def test_a_shipped_rule_called_by_hand_acts_as_in_a_game(ctx):
    by_hand = tag("red", "blue", score=2)

    def call(ctx):
        by_hand(ctx)

    ctx.game.add(call, name="by hand")
    ctx.game.run(30)
    called = [dict(event) for event in ctx.game.events], dict(ctx.game.scores)
    ctx.game.reset()
    ctx.game.remove("by hand")
    ctx.game.add(tag("red", "blue", score=2))
    ctx.game.run(30)
    assert called == ([dict(event) for event in ctx.game.events], dict(ctx.game.scores))
    assert called[1]["red"] > 0


def test_an_agent_that_took_no_part_stays_where_a_rule_has_put_it(ctx):
    dead = ctx.agent.get_agent("c")

    def put(ctx):
        dead.current_node_id = 2

    ctx.game.add(put, phase="deeds")
    ctx.game.step()
    ctx.game.eliminate(dead)
    dead.current_node_id = 9
    before = dict(ctx.game.counts["c"])
    ctx.game.step()
    assert (dead.current_node_id, dead.alive, ctx.game.counts["c"]) == (2, False, before)


def test_a_rule_that_deletes_an_agent_before_the_moves_leaves_those_of_the_others(ctx):
    for name in ("b", "c"):
        ctx.agent.get_agent(name).decide_by(lambda state: state.update(action=max(state["legal"])))
    where = {name: ctx.agent.get_agent(name).current_node_id for name in ("b", "c")}

    def dismiss(ctx):
        if "a" in ctx.agent.agents:
            ctx.agent.delete_agent("a")

    ctx.game.add(dismiss, phase="deeds")
    ctx.game.step()
    moved = {agent.name: agent.prev_node_id for agent in ctx.game.agents}
    assert moved == where
    assert all(agent.current_node_id > agent.prev_node_id for agent in ctx.game.agents)
