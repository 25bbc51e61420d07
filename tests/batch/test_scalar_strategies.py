"""Strategies without an array form in games that are played in arrays: asked agent by agent, as in games alone."""

import pytest
from batch_scenes import plain, scene, strategy_form

from gamms.errors import BadValue
from gamms.game.batch import games as games_of_batches
from gamms.game.batch import scalar_strategies
from gamms.strategies import chase

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}}}
NEAR = {"sensors": {"near": {"type": "AGENT_RANGE", "sensor_range": 2.0}}, "teams.red.sensors": ["near"]}
SEEDS = [3, 4]


def explore(state):
    visits = state["memory"].setdefault("visits", {})
    visits[state["curr_pos"]] = visits.get(state["curr_pos"], 0) + 1
    state["action"] = min(state["legal"], key=lambda node: (visits.get(node, 0), node))


def flee(state):
    near = {*state["sensor"]["near"][1].values()}
    free = [node for node in state["legal"] if node not in near] or state["legal"]
    state["action"] = state["draw"].choice(free)


def carry(state):
    carriers = [flag["carrier"] for flag in state["facts"]["flags"].values()]
    state["action"] = state["legal"][carriers.count(state["name"]) and -1]


def share(state):
    shared = state["team_memory"]
    shared["turns"] = [*shared.get("turns", []), state["turn"]]
    state["action"] = state["legal"][len(shared["turns"]) % len(state["legal"])]


def draw_from_generator(state):
    state["action"] = int(state["rng"].choice(state["legal"]))


def follow(ctx):
    def strategy(state):
        known = ctx.agent.get_agent("blue_0").current_node_id
        state["action"] = min(state["legal"], key=lambda node: ctx.graph.graph.distance(node, known))

    return strategy


def same(strategies, rules=(TAG,), **more):
    """Return the batch, played, whose games are those that `play` plays."""
    scenario = scene(rules, **more).replace(**NEAR)
    with scenario.batch(seeds=SEEDS, strategies=strategies) as games:
        games.run()
        for number, seed in enumerate(SEEDS):
            assert plain(games.result(number)) == plain(scenario.play(seed=seed, strategies=strategies))
    return games


@pytest.mark.parametrize("strategy", [explore, flee, share, draw_from_generator, follow])
def test_what_strategies_see_draw_and_remember_is_that_of_games_alone(strategy):
    games = same({"red": strategy}, settings={} if strategy is share else {"order": [["blue"], ["red"]]})
    assert "agent by agent" in games.slow
    assert games.is_in_arrays
    assert not games.detached


def with_eyes(**keywords):
    return {"near": {"type": "AGENT_RANGE", "sensor_range": 20.0, "false_alarm_rate": 0.5, **keywords}}


def test_sensors_that_err_and_report_late_show_agents_that_are_asked_what_they_show_alone():
    sees = scene([TAG], max_turns=6, sensors=with_eyes(position_noise_m=6.0, delay_turns=2))
    sees = sees.replace(**{"teams.red.sensors": ["near"]})
    metres = {"teams.red.speed": 7.0, "settings": {"speed_unit": "metres", "decide": "arrival"}}
    for scenario in (sees, sees.replace(**metres)):  # by metres each agent is asked in the context of its game
        with scenario.batch(seeds=[3, 4], strategies={"red": flee}) as games:
            games.run()
            assert games.is_in_arrays
            assert not games.detached
            alone = [scenario.play(seed=seed, strategies={"red": flee}) for seed in (3, 4)]
            assert [plain(games.result(i)) for i in range(2)] == list(map(plain, alone))


def test_agents_that_are_asked_and_share_a_sensor_at_a_place_draw_as_alone():
    with scene([TAG], sensors=with_eyes(at=12)).build(seed=1, strategies={"red": flee}) as ctx:
        shared = ctx.sensor.create_sensor("near", "AGENT_RANGE", at=12, detection=0.5)
        for name in ("red_0", "red_1", "red_2"):
            ctx.agent.get_agent(name).register_sensor("near", shared)
        with ctx.game.batch(seeds=[5]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays
            alone.game.reset(seed=5)
            assert plain(games.result(0)) == plain(alone.game.run())


def test_a_rule_that_is_called_where_agents_share_a_sensor_lets_games_stay_in_arrays():
    sees, seeds = {"settings": {"speed_unit": "metres"}}, SEEDS[:2]
    with scene([TAG], max_turns=4, **sees).build(seed=1, strategies={"red": flee}) as ctx:
        shared = ctx.sensor.create_sensor("near", "AGENT_RANGE", sensor_range=20.0, false_alarm_rate=0.5)
        for name in ("red_0", "red_1", "red_2"):
            ctx.agent.get_agent(name).register_sensor("near", shared)
        ctx.game.add(bonus)
        with ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            for number, seed in enumerate(seeds):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


def test_flags_are_published_to_strategies_that_are_asked_agent_by_agent():
    assert not same({"red": carry}, rules=[TAG, FLAGS], max_turns=40).detached


def test_a_strategy_of_a_team_whose_others_have_no_form_shares_their_memory():
    games = same({"red_0": share, "red_1": chase, "red_2": share})
    assert not games.detached


def test_actions_that_are_not_legal_are_noted_and_leave_agents_where_they_are():
    def astray(state):
        state["action"] = 24 if state["turn"] % 2 else state["legal"][-1]
        if state["blocked"]:
            state["action"] = state["legal"][0]

    assert same({"red": astray}).result(0).errors


def test_what_a_strategy_raises_names_the_game_the_turn_and_the_agent():
    def stumble(state):
        state["action"] = state["legal"][1 // (4 - state["turn"]) * 0]

    with scene([TAG]).batch(seeds=SEEDS, strategies={"red_1": stumble}) as games:
        with pytest.raises(ZeroDivisionError) as raised:
            games.run()
        assert not games.detached
        assert raised.value.__notes__ == [
            "In the strategy of agent 'red_1', in turn 4.",
            "In game 0 of a batch, with the seed 3.",
        ]


def head(goal):
    def strategy(state):
        state["action"] = goal

    return strategy


@pytest.mark.parametrize(
    "options",
    [{"speed": 2}, {"speed": 1.5}, {"speed": 0.4}, {"speed": 17.0, "settings": {"speed_unit": "metres"}}],
)
@pytest.mark.parametrize("goal", [24, 3, 99])
def test_agents_with_speeds_head_for_nodes_out_of_reach(options, goal):
    settings = options.get("settings", {})
    games = same(
        {"red": head(goal)}, settings=settings, teams={"red": {"count": 3, "speed": options["speed"]}}, rules=[]
    )
    assert games.is_in_arrays
    assert not games.detached
    assert bool(games.result(0).errors) is (goal == 99)


def lead(states):
    """Let a team go to the node of its first agent."""
    goal = next(iter(states.values()))["curr_pos"]
    for state in states.values():
        state["action"] = min(state["legal"], key=lambda node: (abs(node - goal), node))


def lead_in_arrays(team):
    return team.choose(team.draw.below(team.counts))


@pytest.mark.parametrize(("plan", "arrays"), [(lead, False), (lead_in_arrays, True)])
def test_plans_without_an_array_form_are_asked_in_each_game(plan, arrays):
    with scene([TAG]).build(seed=1) as ctx:
        ctx.game.command("red", plan, arrays=arrays)
        with ctx.game.batch(seeds=SEEDS) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays
            assert not games.detached
            for number, seed in enumerate(SEEDS):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


def tell(state):
    heard = [message["body"] for message in state["inbox"]]
    state["action"] = state["legal"][len(heard) % len(state["legal"])]
    state["outbox"] += [{"channel": "radio", "to": None, "body": [state["curr_pos"], number]} for number in range(2)]
    if state["turn"] == 3:
        state["outbox"].append({"channel": "radar", "to": None, "body": 1})


def test_agents_that_are_asked_send_and_hear_messages_and_learn_which_could_not_be_sent():
    games = same({"red": tell}, channels={"radio": {"range_m": 20.0, "loss": 0.3}})
    assert not games.detached
    assert games.result(0).messages
    assert [error["turn"] for error in games.result(0).errors] == [3, 3, 3]


def test_games_are_played_alone_where_strategies_need_the_turn_engine():
    def strategy(state):
        state["action"] = state["legal"][state["fork"](1).game.turn % 2]

    games = same({"red": strategy}, max_turns=5)
    assert len(games.detached) == len(SEEDS)


def test_a_strategy_that_keeps_state_in_a_closure_is_refused():
    times = []

    def count(state):
        times.append(1)
        state["action"] = state["legal"][0]

    with scene([TAG]).batch(2, strategies={"red": count}) as games, pytest.raises(BadValue, match="'times'"):
        games.run()


class Counting:
    """A strategy that remembers in an attribute, which is there from the beginning or not."""

    def __init__(self, known):
        self.known = 0
        if not known:
            del self.known

    def __call__(self, state):
        self.known = getattr(self, "known", 0) + 1
        state["action"] = state["legal"][self.known % len(state["legal"])]


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("one_by_one", [True, False])
def test_a_strategy_that_keeps_state_in_its_object_is_refused(known, one_by_one):
    made = scene([TAG]).batch(2, strategies={"red": Counting(known)}, one_by_one=one_by_one)
    with made as games, pytest.raises(BadValue, match="attribute 'known' of Counting"):
        games.step()


def test_agents_that_actions_are_given_to_are_not_asked():
    scenario = scene([TAG]).replace(**NEAR)
    with (
        scenario.batch(seeds=SEEDS, strategies={"red": explore, "blue": explore}) as games,
        scenario.batch(seeds=SEEDS, strategies={"red": explore, "blue": explore}, one_by_one=True) as slow,
    ):
        for turn in range(10):
            for batch in (games, slow):
                batch.step({"red": batch.observe("red").counts - 1} if turn % 3 else {})
        assert [plain(games.result(i)) for i in range(2)] == [plain(slow.result(i)) for i in range(2)]


def test_strategies_that_prepare_games_are_played_one_by_one():
    def strategy(state):
        explore(state)

    strategy.prepare = lambda ctx: ctx.game.data.update(prepared=True)
    assert not same({"red": strategy}).is_in_arrays


def test_what_a_strategy_with_an_array_form_prepares_is_prepared_in_batches():
    def strategy(state):
        state["action"] = state["legal"][-1]

    strategy_form(strategy)(lambda view: view.counts - 1)
    strategy.prepare = lambda ctx: None if ctx.game.rules else ctx.game.add(bonus)
    assert not same({"red": strategy}).is_in_arrays
    with scene([]).batch(1, strategies={"red": strategy}) as games:
        assert games.slow == "strategy, with what it prepares in a game"
        games.run()
        assert games.scores["turns"].tolist() == [12]


def bonus(ctx):
    ctx.game.scores["turns"] += 1


@pytest.mark.parametrize(
    ("strategies", "is_called", "faster"),
    [
        ({"red": explore, "blue": explore}, False, 16),
        ({"red": follow}, False, 64),
        ({}, True, 32),
        ({"red": explore, "blue": explore}, True, None),
    ],
)
def test_games_that_are_faster_one_by_one_are_played_to_their_ends_so(strategies, is_called, faster, monkeypatch):
    monkeypatch.setattr(games_of_batches, "why_slower", scalar_strategies.why_slower)
    for number in [100] if faster is None else [faster - 1, faster]:
        with scene([TAG], max_turns=1).build(seed=1, strategies=strategies) as ctx:
            if is_called:
                ctx.game.add(bonus)
            with ctx.game.batch(number) as games:
                assert games.is_in_arrays  # turn by turn, arrays are faster in any case
                games.run()
                assert games.is_in_arrays is (number == faster)
