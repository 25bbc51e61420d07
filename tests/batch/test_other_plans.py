"""Games of a batch follow other plans where functions change rules, strategies or sensors; the others go on."""

from queue import SimpleQueue

import pytest
from batch_scenes import WALK, assert_as_alone, assert_as_played, plain, scene

import gamms
from gamms import rules
from gamms.errors import GammsError

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "respawn"}}
SIZES = [2, 40, 300]


def walk_on(state):
    """Go to the last legal node."""
    state["action"] = state["legal"][-1]


def count(ctx):
    """Count turns in the scores."""
    ctx.game.scores["counted"] += 1


def toggle(name, rule, phase="after", every=2):
    """Return a rule that adds another one in games with odd seeds, and removes it again."""

    def change(ctx):
        if ctx.seed % 2 == 0 or ctx.game.turn % every:
            return
        if any(one.name == name for one in ctx.game.rules):
            ctx.game.remove(name)
        else:
            ctx.game.add(rule, name=name, phase=phase)

    return change


def test_a_rule_gets_the_same_context_in_all_turns_also_after_it_has_changed_the_rules():
    told = SimpleQueue()

    def tell(ctx):
        told.put((ctx.seed, ctx))

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(tell)
        ctx.game.add(toggle("counts", count))
        with ctx.game.batch(seeds=range(4)) as games:
            games.run()
            seen = [told.get() for _ in range(told.qsize())]
    of_seed = {seed: {id(one) for of, one in seen if of == seed} for seed in range(4)}
    assert [len(contexts) for contexts in of_seed.values()] == [1] * 4
    assert len(set.union(*of_seed.values())) == 4


def test_an_agent_kept_from_a_game_shows_this_game_after_others_were_played():
    kept = SimpleQueue()

    def keep(ctx):
        if ctx.game.turn == 1 and ctx.seed == 2:
            kept.put(ctx.agent.get_agent("red_0"))
        if ctx.game.turn == 4 and ctx.seed == 2:
            agent = kept.get()
            ctx.game.emit("kept", node=agent.current_node_id)
            assert agent is ctx.agent.get_agent("red_0")

    with scene([TAG], max_turns=5).build(seed=1) as ctx:
        ctx.game.add(keep)
        ctx.game.add(toggle("counts", count))
        with ctx.game.batch(seeds=range(4)) as games, ctx.game.fork(2).ctx as alone:
            games.run()
            (event,) = [one for one in games.result(2).events if one["kind"] == "kept"]
            alone.game.remove("keep")
            alone.game.run(4)
            assert event["node"] == alone.agent.get_agent("red_0").current_node_id


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_games_with_other_rules_change_nothing_in_the_others(phase):
    with scene([TAG], max_turns=9).build(seed=1) as ctx:
        ctx.game.add(toggle("counts", count, phase), phase=phase)
        with ctx.game.batch(seeds=range(6)) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)
            alone.game.remove("change")
            for number in (0, 2, 4):
                alone.game.reset(seed=number)
                assert plain(games.result(number))["events"] == plain(alone.game.run())["events"]


@pytest.mark.parametrize("number", SIZES)
def test_functions_of_a_newcomer_do_in_batches_what_they_do_alone(number):
    class Closest:
        """A resolver: of those that come to the same node, the one whose name comes first may move there."""

        def resolve(self, moves, ctx):
            first = {}
            for name in sorted(moves):
                first.setdefault(moves[name].end, name)
            return [name for name, move in moves.items() if first[move.end] != name]

    def sense_parity(node):
        return node % 3

    def learn(ctx):
        turn = ctx.game.turn
        if turn == 1 + ctx.seed % 3:
            agent = ctx.agent.get_agent("red_0")
            agent.strategy = decide_by_parity
            sensor = gamms.sensor.FunctionSensor(ctx, "parity", sense_parity)
            ctx.sensor.add_sensor(sensor)
            agent.register_sensor("parity", sensor)
        if turn == 4 and ctx.seed % 2:
            ctx.game.conflicts = Closest()
        if turn == 5:
            ctx.game.emit("lot", number=int(ctx.rng.integers(1000)), agents=len(ctx.game.agents))

    def decide_by_parity(state):
        seen = state["sensor"]["parity"][1] if "parity" in state["sensor"] else 0
        state["action"] = state["legal"][(seen + state["draw"].below(3)) % len(state["legal"])]
        if state["turn"] % 2:
            state["deeds"] = []

    with scene([TAG], max_turns=7).build(seed=1) as ctx:
        ctx.game.add(learn, phase="before")
        with ctx.game.batch(seeds=range(number)) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            for one in sorted({0, 1, 2, 3, number - 1} & {*range(number)}):
                alone.game.reset(seed=one)
                assert plain(games.result(one)) == plain(alone.game.run())


def test_a_turn_that_an_error_takes_back_takes_back_the_rules_of_its_games():
    faults = {3}

    def fail(ctx):
        if ctx.seed == 3 and ctx.game.turn in faults:
            faults.clear()
            raise ZeroDivisionError

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(toggle("counts", count, every=3))
        ctx.game.add(fail)
        with ctx.game.batch(seeds=range(4)) as games, ctx.game.fork(0).ctx as alone:
            with pytest.raises(ZeroDivisionError):
                games.run()
            assert games.turn.tolist() == [2] * 4
            assert games.scores["counted"].tolist() == [0] * 4
            games.run()
            assert_as_alone(games, alone)


def test_games_begin_again_with_the_rules_of_the_start():
    def change(ctx):
        if ctx.game.turn == 2:
            ctx.game.add(count, name="counts")
            ctx.agent.get_agent("red_0").strategy = walk_on

    with scene([TAG], max_turns=5).build(seed=1) as ctx:
        ctx.game.add(change)
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            first = [plain(games.result(number)) for number in range(3)]
            games.reset()
            assert games.scores["counted"].tolist() == [0] * 3
            games.run()
            assert [plain(games.result(number)) for number in range(3)] == first
            assert_as_alone(games, alone)


def test_rules_that_are_added_or_removed_in_a_phase_are_called_or_not_in_it_as_alone():
    def first(ctx):
        if ctx.game.turn == 2 and ctx.seed % 2:
            ctx.game.remove("second")
            ctx.game.add(count, name="new", phase="after")
            ctx.game.add(rules.tag("blue", "red", then="respawn"), name="other tag")

    def second(ctx):
        ctx.game.scores["second"] += 1

    with scene([TAG], max_turns=5).build(seed=1) as ctx:
        ctx.game.add(first, name="first")
        ctx.game.add(second, name="second")
        with ctx.game.batch(4) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.scores["second"].tolist() == [5.0, 1.0, 5.0, 1.0]
            assert_as_alone(games, alone)


def test_functions_other_than_rules_and_collectors_may_not_change_the_rules():
    def decide(state):
        state["action"] = state["legal"][0]
        gamms_of[0].game.add(count)

    gamms_of = []
    with scene([TAG], max_turns=3).build(seed=1, strategies={"red": decide}) as ctx:
        gamms_of.append(ctx)
        with pytest.raises(GammsError), ctx.game.batch(2) as games:
            games.step()


def test_agents_whose_strategies_change_keep_what_they_remember():
    def remember(state):
        memory = state["memory"]
        memory["turns"] = memory.get("turns", 0) + 1
        state["action"] = state["legal"][memory["turns"] % len(state["legal"])]

    def change(ctx):
        agent = ctx.agent.get_agent("red_0")
        agent.strategy = remember if ctx.game.turn % 4 < 2 else gamms.strategies.random_walk
        ctx.game.scores["turns"] = ctx.game.memories.get("red_0", {}).get("turns", 0)

    teams = {"red": {"count": 2, "strategy": WALK}, "blue": {"count": 2, "strategy": WALK}}
    with scene([TAG], teams=teams, max_turns=9).build(seed=1) as ctx:
        ctx.game.add(change)
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


OF_SEED = """
import gamms
import numpy as np

def draw(ctx):
    return int(ctx.stream("lot").integers(9))

@gamms.array_rule
def pay(turn):
    kept = turn.keep("paid", lambda games: {"turns": np.zeros(games, np.int64)})["turns"]
    kept[turn.games] += 1
    turn.add_score("paid", turn.games * 0, float(turn.facts["lot"]) * kept[turn.games])

@gamms.array_strategy
def go_by_lot(view):
    return (view["facts"]["lot"] + view["turn"][:, None]) % view.counts

def change(ctx):
    if ctx.game.turn == 3 and ctx.seed % 2:
        ctx.game.add(note, name="notes")
        ctx.agent.get_agent("red_0").strategy = gamms.strategies.stay

def note(ctx):
    ctx.game.scores["noted"] += ctx.game.facts["lot"]
"""


def test_games_whose_facts_follow_from_their_seeds_have_plans_of_their_own(tmp_path):
    (tmp_path / "by_lot.py").write_text(OF_SEED)
    teams = {"red": {"count": 2, "strategy": "by_lot:go_by_lot"}, "blue": {"count": 2, "strategy": WALK}}
    given = {"teams": teams, "facts": {"lot": {"function": "by_lot:draw"}}, "folder": tmp_path}
    made = scene([TAG, {"rule": "by_lot:pay"}, {"rule": "by_lot:change"}], **given)
    with made.batch(6, seed=1) as games:
        games.run()
        assert not games.detached
        for number, seed in enumerate(games.seeds):
            assert plain(games.result(number)) == plain(made.play(seed=seed))


def change_rules(ctx):
    """Add a rule, and give an agent another strategy, in games with odd seeds."""
    if ctx.game.turn == 2 and ctx.seed % 2:
        ctx.game.add(rules.tag("blue", "red", then="respawn"), name="back")
        ctx.agent.get_agent("red_0").strategy = walk_on
    if ctx.game.turn == 5 and ctx.seed % 2:
        ctx.game.remove("back")


@pytest.mark.parametrize("threads", [1, 3])
def test_games_on_several_maps_and_in_several_threads_follow_other_plans(threads):
    maps = [{"grid": {"width": 4, "height": 4}}, {"grid": {"width": 3, "height": 6}}]
    scenario = scene([TAG, f"{__name__}:change_rules"], allow=[__name__])
    with scenario.batch(12, seed=1, maps=maps) as games:
        games.run(4, threads=threads)
        games.reset([1, 4])
        games.run(threads=threads)
        assert not games.detached
        assert_as_played(games, scenario, maps=maps)


def test_an_agent_that_a_rule_has_drawn_for_draws_on_after_another_agent_gets_a_strategy():
    def change(ctx):
        if ctx.game.turn == 1 and ctx.seed % 2:
            ctx.game.observation("red_0")["draw"].below(99)
            ctx.agent.get_agent("blue_0").strategy = walk_on

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(change)
        with ctx.game.batch(12) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_messages_that_a_rule_takes_out_of_the_log_are_not_heard(phase):
    def talk(state):
        if state["turn"] == 2:
            state["outbox"].append({"channel": "radio", "to": None, "body": 1})
        state["action"] = state["legal"][-1 if state["inbox"] else 0]

    def clear(ctx):
        if ctx.game.turn == 3 and ctx.seed:
            ctx.game.messages.clear()

    with scene([], max_turns=6, channels={"radio": {"range_m": 30.0}}).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = talk
        ctx.game.add(clear, phase=phase)
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


def test_shipped_rules_count_a_turn_once_if_a_game_of_another_plan_raises_in_it():
    faults = {4}

    def change(ctx):
        if ctx.game.turn == 2 and ctx.seed == 1:
            ctx.game.add(count)

    def fail(ctx):
        if ctx.game.turn in faults and ctx.seed == 1:
            faults.clear()
            raise ZeroDivisionError

    with scene([], max_turns=8).build(seed=1) as ctx:
        ctx.game.add(rules.resource("fuel", 3.5, per_edge=0.5))
        ctx.game.add(change)
        ctx.game.add(fail)
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            with pytest.raises(ZeroDivisionError):
                games.run()
            games.run()
            assert_as_alone(games, alone)
