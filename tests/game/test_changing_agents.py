"""Games in which agents die, come, leave and change: what is known of the last turn changes nothing."""

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import gamms
from gamms.rules import Conflicts

CHANGES = st.lists(
    st.tuples(
        st.sampled_from(["die", "return", "come", "go", "change team", "be faster", "change strategy"]),
        st.integers(0, 99),
    ),
    max_size=4,
)
ALL_DIE = [[("die", 0)] * 11, [("return", 2)], [("die", 0), ("return", 1), ("return", 5)], []]
NAMES = ["a", "b", "blue_1a", "m", "z"]  # before, between and behind those of a team


def wander(state):
    state["action"] = state["draw"].choice(state["legal"])


def turn_back(state):
    state["action"] = state["legal"][-1] if state["turn"] % 2 else {"node_id": state["curr_pos"], "heading": 1.0}


def spread(arrays):
    return arrays.choose(arrays.draw.below(arrays.counts))


def change(ctx, kind, number):
    """Let something happen to one of the agents, or to none."""
    agents, game = ctx.agent.agents, ctx.game
    alive, dead = [one for one in agents.values() if one.alive], [one for one in agents.values() if not one.alive]
    chosen = (dead if kind == "return" else alive)[number % max(1, len(dead if kind == "return" else alive)) :][:1]
    free = [f"{name}{suffix}" for name in NAMES for suffix in ("", "2", "3") if f"{name}{suffix}" not in agents]
    if kind == "come":
        ctx.agent.create_agent(free[number % len(free)], start_node_id=number % 16, team="red", strategy=wander)
    for one in chosen:
        if kind == "die":
            game.eliminate(one)
        elif kind == "return":
            game.respawn(one, number % 16)
        elif kind == "go":
            ctx.agent.delete_agent(one.name)
        elif kind == "change team":
            one.team = "blue" if one.team == "red" else "red"
        elif kind == "be faster" and number % 3 == 0:
            one.speed = 2
        elif kind == "change strategy":
            one.strategy = turn_back if one.strategy is wander else wander


def played(grid, turns, *, has_team, has_plan, order, phase, conflicts, forgets=False, is_observed=False):
    """Play turns with such changes, after some of which a rule asks who is there, and return all that came of it.

    One that forgets makes everything for each turn and each such question, as after any change of the settings.
    """
    with grid(seed=4) as ctx:
        for number, name in enumerate(NAMES):
            ctx.agent.create_agent(name, start_node_id=number, team="red", strategy=wander)
        if has_team:
            ctx.agent.create_team("blue", range(6), strategy=wander)
        if has_plan:
            ctx.game.command("blue", spread, arrays=True)
        ctx.game.conflicts, ctx.game.order = conflicts, order
        if is_observed:
            ctx.game.internals.after_observing.append(lambda agents, states: None)
        waiting = list(turns)

        def forget(ctx):
            if forgets:
                ctx.game.max_turns = None

        def happen(ctx):
            for kind, number in waiting.pop(0) if waiting else ():
                change(ctx, kind, number)
                forget(ctx)
                if number % 2:
                    ctx.game.data.setdefault("there", []).append([one.name for one in ctx.game.agents])

        ctx.game.add(happen, phase=phase)
        for _ in turns:
            ctx.game.step()
        states = {name: repr(one.state.get("legal")) for name, one in ctx.agent.agents.items()}
        return ctx.game.result(), ctx.game.data, ctx.game.moves, states


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    turns=st.lists(CHANGES, min_size=2, max_size=6),
    has_team=st.booleans(),
    has_plan=st.booleans(),
    order=st.sampled_from([None, [["red"], ["blue"]], [["blue"], ["red"]]]),
    phase=st.sampled_from(["before", "deeds", "after"]),
    conflicts=st.sampled_from([None, Conflicts(2)]),
)
@example(turns=ALL_DIE, has_team=True, has_plan=True, order=None, phase="after", conflicts=Conflicts(2))
@example(turns=ALL_DIE, has_team=False, has_plan=False, order=None, phase="deeds", conflicts=None)
@example(
    turns=[[("change strategy", 1)]] * 3, has_team=True, has_plan=False, order=None, phase="before", conflicts=None
)
def test_a_game_whose_agents_change_is_as_if_nothing_were_known_of_the_last_turn(
    grid, turns, has_team, has_plan, order, phase, conflicts
):
    play = {"order": order, "phase": phase, "conflicts": conflicts}
    play |= {"has_team": has_team, "has_plan": has_plan and has_team}
    assert played(grid, turns, **play) == played(grid, turns, **play, forgets=True)
    if not play["has_plan"]:  # an observer has the states of all
        assert played(grid, turns, **play) == played(grid, turns, **play, is_observed=True)


@pytest.mark.parametrize("goes", ["die", "go"])
def test_members_of_a_team_give_way_in_a_turn_in_which_one_goes_before_they_move(grid, goes):
    with grid(seed=1, side=8) as ctx:
        ctx.agent.create_team("red", range(40))
        ctx.game.command("red", spread, arrays=True)
        ctx.game.conflicts = Conflicts(1)
        ctx.game.add(lambda ctx: change(ctx, goes, ctx.game.turn), phase="deeds")
        for turn in range(1, 6):
            ctx.game.step()
            assert len({agent.current_node_id for agent in ctx.game.agents}) == len(ctx.game.agents) == 40 - turn


@pytest.mark.parametrize("was_asked_for", [False, True])
@pytest.mark.parametrize("others", [0, 5])
def test_an_agent_that_comes_by_the_name_of_a_member_does_not_make_its_move(grid, was_asked_for, others):
    """The member decided in the same turn; the new agent stands where it stood, and some of the others go, too."""

    def replace(ctx):
        node = ctx.agent.block.node[ctx.agent.block.find_row("red_5")]
        for name in ["red_5", *(f"red_{number}" for number in range(others))]:
            ctx.agent.delete_agent(name)
        ctx.agent.create_agent("red_5", start_node_id=int(node), team="red")

    with grid(seed=1, side=8) as ctx:
        ctx.agent.create_team("red", range(8))
        ctx.game.command("red", lambda arrays: arrays.nodes + 8, arrays=True)
        ctx.game.add(replace, phase="deeds")
        if was_asked_for:
            ctx.agent.get_agent("red_5")
        ctx.game.step()
        nodes = {agent.name: agent.current_node_id for agent in ctx.game.agents}
        assert nodes == {"red_5": 5} | {f"red_{number}": number + 8 for number in range(others, 8) if number != 5}
        assert ctx.game.moves["red_5"].path == (5,)


def replace(ctx, kind, number):
    """Let an agent of a team go or come by its name, die or return, or let all go."""
    name, agents = f"red_{number}", ctx.agent.agents
    if kind == "all go":
        for one in list(agents):
            ctx.agent.delete_agent(one)
    if kind in ("go", "go and come") and name in agents:
        ctx.agent.delete_agent(name)
    if kind in ("come", "go and come") and name not in agents:
        ctx.agent.create_agent(name, start_node_id=2 * number, team="red", strategy=wander)
    if kind in ("die", "return") and name in agents and agents[name].alive == (kind == "die"):
        (ctx.game.eliminate if kind == "die" else ctx.game.respawn)(name)


def test_a_restored_game_has_neither_the_agents_that_came_later_nor_their_places_in_its_result(grid):
    with grid(seed=1) as ctx:
        ctx.agent.create_team("red", range(3), strategy=wander)
        ctx.game.step()
        before = ctx.game.snapshot()
        first = ctx.agent.get_agent("red_1")
        for name in ("red_1", "red_7"):
            replace(ctx, "go and come", int(name[-1]))
        ctx.game.step()
        ctx.game.restore(before)
        assert ctx.game.agents[1] is first
        ctx.game.step()
        assert list(ctx.game.result().agents) == ["red_0", "red_1", "red_2"]


def one_by_one(ctx):
    for number in range(4):
        ctx.agent.create_agent(f"red_{number}", start_node_id=number, team="red", strategy=wander)


def members(ctx):
    ctx.agent.create_team("red", range(4), strategy=wander)


def members_asked_for(ctx):
    members(ctx)
    list(ctx.agent.agents.values())


def delete(ctx):
    ctx.agent.delete_agent("red_1")


def as_a_rule(change, phase):
    return lambda ctx: ctx.game.add(lambda ctx: ctx.game.turn == 0 and change(ctx), phase=phase, name="change")


def come_and_go(ctx):
    ctx.agent.create_agent("late", start_node_id=0, team="red")
    ctx.agent.delete_agent("late")


def fail_to_come(ctx):
    with pytest.raises(ValueError, match="speed of agent 'late_1'"):
        ctx.agent.create_team("late", [0, 1], columns={"speed": [1, -1]})


ALL = ["red_0", "red_1", "red_2", "red_3"]
LEFT = [
    ([delete], ["red_0", "red_2", "red_3"]),  # it was not there when the game began
    ([gamms.game.Game.result, delete], ["red_0", "red_2", "red_3"]),
    ([lambda ctx: ctx.game.agents, delete], ["red_0", "red_2", "red_3"]),
    ([as_a_rule(delete, "before")], ALL),
    ([as_a_rule(delete, "deeds")], ALL),
    ([lambda ctx: ctx.agent.block.set(1, "alive", value=False), as_a_rule(delete, "before")], ALL),
    (["step", delete], ALL),
    (["step", delete, "reset"], ALL),
    (["step", "reset", delete], ["red_0", "red_2", "red_3"]),
    (["step", delete, "step", "fork", "reset"], ALL),  # a fork begins where it was made
    (["fork", delete], ["red_0", "red_2", "red_3"]),
    (["step", "snapshot", delete, "step", "restore"], ALL),
    (["step", come_and_go], ["late", *ALL]),
    (["step", "snapshot", come_and_go, "restore"], ALL),
    (["step", fail_to_come], ALL),
]


@pytest.mark.parametrize("create", [one_by_one, members, members_asked_for])
@pytest.mark.parametrize(("deeds", "names"), LEFT, ids=range(len(LEFT)))
def test_the_result_has_all_agents_that_were_there_once_the_game_had_begun(grid, create, deeds, names):
    with grid(seed=2) as ctx:
        create(ctx)
        verbs = {"step": lambda ctx: ctx.game.step(), "reset": lambda ctx: ctx.game.reset()}
        verbs |= {"restore": lambda ctx: ctx.game.restore(moments[-1])}
        moments, now = [], ctx
        for deed in [*deeds, "step"]:
            if deed == "fork":
                now = now.game.fork(1).ctx
            elif deed == "snapshot":
                moments.append(now.game.snapshot())
            elif deed is gamms.game.Game.result:
                now.game.result()
            else:
                verbs.get(deed, deed)(now)
        found = now.game.result().agents
        assert list(found) == names
        assert [name for name, one in found.items() if not one["alive"]] == [
            name for name in names if name not in now.agent.agents
        ]


@pytest.mark.parametrize("create", [one_by_one, members])
def test_all_games_of_a_batch_have_the_agents_that_were_deleted_before(grid, create):
    with grid(seed=2) as ctx:
        create(ctx)
        ctx.game.max_turns = 4
        ctx.game.step()
        delete(ctx)
        games = ctx.game.batch(3)
        games.run()
        for number in (2, 0, 1):
            alone = ctx.game.fork(0)
            alone.reset(seed=number)
            alone.run()
            assert games.result(number) == alone.result()
            assert list(games.result(number).agents) == ALL


@pytest.mark.parametrize("create", [one_by_one, members])
def test_a_team_that_comes_once_a_game_has_begun_is_in_its_batches_and_forks(grid, create):
    with grid(seed=2, max_turns=4) as ctx:
        ctx.agent.create_agent("anna", start_node_id=5, strategy=wander)
        ctx.game.step()
        create(ctx)
        assert ctx.game.internals.starts == {"anna": 5, **{name: int(name[-1]) for name in ALL}}
        games = ctx.game.batch(2)
        games.run()
        alone = ctx.game.fork(0)
        alone.reset(seed=1)
        assert games.result(1) == alone.run()
        assert len(alone.result().agents) == 5


@pytest.mark.parametrize("reading", [None, 1, 7])
def test_moves_and_conflicts_are_counted_while_agents_die_and_return(reading):
    names = [f"a{i}" for i in range(11)]
    moved, chosen = dict.fromkeys(names, 0), dict.fromkeys(names, 0)

    def walk(state):
        state["action"] = state["draw"].choice(state["legal"])
        chosen[state["name"]] += state["action"] != state["curr_pos"]

    def live(ctx):
        for name, move in ctx.game.moves.items():
            moved[name] += move.start != move.end
        changed = ctx.agent.get_agent(ctx.rng.choice(names))
        changed.alive = not changed.alive

    with gamms.create_context(seed=4, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        for i, name in enumerate(names):
            ctx.agent.create_agent(name, start_node_id=i, team="red", strategy=walk)
        ctx.game.conflicts = Conflicts(capacity=1)
        ctx.game.add(live)
        for turn in range(900):
            ctx.game.step()
            if reading and turn % reading == 0:
                ctx.game.snapshot()
        counts = ctx.game.result().agents
        assert {name: counts[name]["moves"] for name in names} == moved
        assert {name: counts[name]["moves"] + counts[name]["blocked"] for name in names} == chosen
