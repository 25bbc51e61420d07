"""A model: the game as its agents know it, in worlds that fit that, with draws of their own."""

from collections import Counter
from random import random

import networkx as nx
import pytest

import gamms
from gamms.errors import BadType, BadValue, MissingKey, UnknownName
from gamms.planning import Model, closeness


def walk(state):
    state["action"] = state["draw"].choice(state["legal"])


def looking(look, found):
    """A strategy that walks, and keeps what `look` returns of its state."""

    def strategy(state):
        found.append(look(state))
        walk(state)

    return strategy


def play(scenario, look, turns=3, seed=None, before=None):
    """Play some turns in which ann looks; return what she found in each."""
    found = []
    with scenario.build(seed, {"ann": looking(look, found)}) as ctx:
        for turn in range(turns):
            if before is not None:
                before(ctx, turn)
            ctx.game.step()
    return found


def futures(state, worlds=4, turns=4):
    """What happens in some worlds: where all are after each turn."""
    model = Model(state, seed=5)
    found = []
    for number in range(worlds):
        model.sample(number)
        for _ in range(turns):
            found.append({one.name: one.current_node_id for one in model.ctx.agent.create_iter()})
            model.play(1)
    return found, dict(model.game.scores)


def test_a_rollout_takes_three_lines(tag):
    def look(state):
        model = Model(state)
        model.sample(3)
        model.play(5, {"ann": state["legal"][-1]})
        return model.game.turn - state["turn"], model.ctx.agent.get_agent("ann").alive

    assert play(tag, look) == [(5, True)] * 3


def test_the_first_action_is_done_and_then_the_policy(line):
    found = []

    def look(state):
        model = Model(state, rollout=lambda inner: inner.update(action=inner["legal"][0]))
        for turns in (1, 3):
            model.sample(0)
            model.play(turns, {"ann": 1})
            found.append(model.ctx.agent.get_agent("ann").current_node_id)
        model.sample(0)
        found.append(model.ctx.agent.get_agent("ann").current_node_id)
        state["action"] = 0

    line.agent.get_agent("ann").register_strategy(look)
    line.game.step()
    assert found == [1, 1, 0]


def test_a_decision_leaves_the_model_in_world_0_with_what_the_policies_remember(tag):
    def count(inner):
        inner["memory"]["asked"] = inner["memory"].get("asked", 0) + 1
        inner["action"] = inner["curr_pos"]

    def look(state):
        model = Model(state, seed=5, rollout=count)
        model.sample(0)
        seed = model.game.ctx.seed
        model.sample(7)
        assert model.decide() == {"ann": state["curr_pos"]}
        found = model.game.ctx.seed == seed, model.game.memories["ann"]["asked"]
        model.play(1)
        forgetful = Model(state, seed=5, rollout=walk)
        forgetful.sample(7)
        forgetful.decide()
        return *found, model.game.memories["ann"]["asked"], forgetful.game.ctx.seed == seed

    assert play(tag, look, 1) == [(True, 1, 2, True)]


def test_a_world_is_the_same_whenever_it_is_sampled(tag):
    def look(state):
        first = futures(state)
        model = Model(state, seed=5)
        model.sample(9)
        model.play(7)
        return first == futures(state)

    assert play(tag, look) == [True] * 3


def test_worlds_other_turns_and_other_seeds_draw_otherwise(tag):
    def look(state):
        found = []
        for seed, number in ((0, 0), (0, 1), (1, 0)):
            model = Model(state, seed=seed)
            model.sample(number)
            found.append(model.game.ctx.seed)
        return tuple(found)

    seeds = [seed for found in play(tag, look) for seed in found]
    assert len(set(seeds)) == len(seeds)


# -- no future is foreseen -------------------------------------------------------------------------------------------


def test_draws_in_a_model_do_not_depend_on_the_seed_of_the_game(tag):
    stay = {"blue": lambda state: state.update(action=state["curr_pos"])}
    found = []
    for seed in (3, 4):
        seen = []

        def look(state, seen=seen):
            seen.append(futures(state))
            state["action"] = state["curr_pos"]

        with tag.build(seed, {"ann": look, "amy": stay["blue"], **stay}) as ctx:
            ctx.game.run(2)
        found.append(seen)
    assert found[0] == found[1]


@pytest.mark.parametrize("rule", ["opponents", "conflicts", "detection", "rules"])
def test_a_model_does_not_foresee_the_next_draws_of_the_game(line, rule):
    """The next draws of the game, and those of a model of the same turn, are two independent coins."""
    pairs = []
    line.agent.get_agent("bob").current_node_id = 2
    line.game.remove("tag")
    flip = {
        "opponents": lambda ctx: ctx.agent.get_agent("bob").current_node_id == 2,
        "conflicts": lambda ctx: ctx.agent.get_agent("ann").current_node_id == 1,
        "detection": lambda ctx: bool(ctx.agent.get_agent("ann").sensors["eyes"].data),
        "rules": lambda ctx: ctx.game.data["coin"],
    }[rule]

    def meet(state):
        state["action"] = state["legal"][0] if rule != "conflicts" else 1

    def bob(state):
        state["action"] = state["draw"].choice([2, 3]) if rule != "conflicts" else 1

    def look(state):
        model = Model(state, seed=2, rollout=meet, opponents=bob)
        model.sample(0)
        model.play(1)
        if rule == "detection":
            model.ctx.agent.get_agent("ann").get_state()
        pairs.append([flip(model.ctx)])
        meet(state)

    def toss(ctx):
        ctx.game.data["coin"] = int(ctx.stream("coin", ctx.game.turn).integers(2))

    if rule == "conflicts":
        line.game.conflicts = gamms.rules.Conflicts(capacity=1)
    if rule == "detection":
        weak = line.sensor.create_sensor("weak eyes", "agent_range", sensor_range=100.0, detection=0.5)
        line.agent.get_agent("ann").register_sensor("eyes", weak)
    if rule == "rules":
        line.game.add(toss)
    line.agent.get_agent("ann").register_strategy(look)
    line.agent.get_agent("bob").register_strategy(bob)
    for seed in range(40):
        line.game.reset(seed)
        line.game.step()
        if rule == "detection":
            line.agent.get_agent("ann").get_state()
        pairs[-1].append(flip(line))
    told = [pair[0] for pair in pairs]
    came = Counter(pair[1] for pair in pairs)
    assert len(set(told)) == 1, "of one agent with one knowledge, the model draws the same under all seeds"
    assert min(came[False], came[True]) > 8, f"and the game draws both: {came}"


HIDDEN = {
    "the place of an enemy": lambda ctx: setattr(ctx.agent.get_agent("cat"), "current_node_id", 28),
    "its speed": lambda ctx: setattr(ctx.agent.get_agent("cat"), "speed", 2),
    "its strategy": lambda ctx: ctx.agent.get_agent("cat").register_strategy(lambda state: state.update(action=35)),
    "what it remembers": lambda ctx: ctx.game.memories["cat"].update(secret=1),
    "what its team was told": lambda ctx: ctx.game.publish(to="blue", word="fox"),
    "the seed": lambda ctx: ctx.reseed(8),
}


@pytest.mark.parametrize("change", HIDDEN.values(), ids=HIDDEN)
def test_secrets_change_nothing_in_the_model_of_an_agent(tag, change):
    def before(ctx, turn):
        if turn == 1:
            change(ctx)

    first, second = play(tag, futures, 2), play(tag, futures, 2, before=before)
    assert first == second


# -- what is drawn ---------------------------------------------------------------------------------------------------


def test_teammates_are_near_where_they_were_last_known_to_be(tag):
    def look(state):
        model = Model(state)
        seen = gamms.belief.believed(model.ctx, state).last_seen.get("amy")
        found = set()
        for number in range(20):
            model.sample(number)
            found.add(model.ctx.agent.get_agent("amy").current_node_id)
        far = [model.ctx.graph.distance(seen.node, node, None) for node in found] if seen else [0]
        return seen, max(far), state["turn"]

    def tell(state):
        Model(state)
        walk(state)

    found = []
    with tag.build(strategies={"ann": looking(look, found), "amy": tell}) as ctx:
        ctx.game.run(3)
    assert found[0][0] is None
    assert [seen.turn for seen, _, _ in found[1:]] == [0, 1]
    assert all(far <= 1 for _, far, _ in found)


def test_teammates_in_sight_that_tell_nothing_are_where_they_are(tag):
    def look(state):
        model = Model(state)
        found = set()
        for number in range(5):
            model.sample(number)
            found.add(model.ctx.agent.get_agent("amy").current_node_id)
        return found, {state["sensor"]["eyes"][1]["amy"]}

    assert all(found == seen for found, seen in play(tag.replace(**{"sensors.eyes.sensor_range": 99.0}), look))


def test_with_full_information_all_are_where_they_are(tag):
    def look(state):
        model = Model(state, information="full")
        model.sample(4)
        return model.ctx.agent.get_agent("cat").current_node_id

    with pytest.raises(BadValue, match="information: full"):
        play(tag, look, 1)
    full = tag.replace(settings={"information": "full"})
    assert play(full, look, 1) == [35]
    assert full.play().provenance["information"] == "full"
    with pytest.raises(gamms.scenario.ScenarioError, match="Did you mean 'information'"):
        tag.replace(settings={"informaton": "full"})


# -- policies --------------------------------------------------------------------------------------------------------


def test_policies_are_functions_factories_and_names_by_team(tag):
    def still(state):
        state["action"] = state["curr_pos"]

    def look(state):
        places = []
        for opponents in (still, "gamms.strategies:stay", {"blue": lambda ctx: still}, {"blue": still}):
            model = Model(state, rollout="gamms.strategies:chase", opponents=opponents)
            model.sample(1)
            before = model.ctx.agent.get_agent("cat").current_node_id
            model.play(2)
            places.append(model.ctx.agent.get_agent("cat").current_node_id == before)
        return places

    assert play(tag, look, 1) == [[True] * 4]


def test_a_model_draws_nothing_from_the_generators_of_the_process(line):
    def look(state):
        model = Model(state, opponents=lambda inner: inner.update(action=inner["legal"][int(2 * random())]))
        for number in range(3):
            model.sample(number)
            model.play(3)
        state["action"] = 0

    for strategy in (look, walk):
        line.agent.get_agent("ann").register_strategy(strategy)
        line.agent.get_agent("bob").register_strategy(
            lambda state: state.update(action=state["legal"][int(2 * random())])
        )
    moves = []
    for strategy in (look, lambda state: state.update(action=0)):
        line.game.reset()
        line.agent.get_agent("ann").register_strategy(strategy)
        line.game.run(5)
        moves.append(line.game.counts["bob"])
    assert moves[0] == moves[1]


def test_the_end_of_the_game_counts_a_point(tag):
    def look(state):
        model = Model(state)
        model.play(3)
        before = model.lead()
        model.game.end("over", winner="blue")
        return before - model.lead()

    assert play(tag, look, 1) == [1.0]


@pytest.mark.parametrize("teams", [("red", "blue"), (None, None)])
def test_closeness_counts_the_way_by_road(teams):
    """Across the block bob is ten metres away, and each step along the street leads away from him first."""
    found = []
    places = [(0, 0), (0, 10), (0, 20), (10, 20), (10, 10), (10, 0)]
    street = nx.path_graph(len(places))
    for node, (x, y) in enumerate(places):
        street.nodes[node].update(x=float(x), y=float(y))

    def look(state):
        model = Model(state, rollout="stay", opponents="stay")
        for node in (0, 1):
            model.sample(0)
            model.play(1, {"ann": node})
            found.append(closeness(model))
        state["action"] = 0

    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(street)
        agents = ("ann", teams[0], 0, look), ("bob", teams[1], 5, gamms.strategies.stay)
        for name, team, node, strategy in agents:
            eyes = {"eyes": ctx.sensor.create_sensor(f"eyes of {name}", "agent")}
            ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=eyes, strategy=strategy)
        ctx.game.step()
    stayed, gone = found
    assert -1.0 < stayed < gone < 0.0


def test_closeness_of_an_opponent_that_is_not_seen_is_the_least(tag):
    def look(state):
        model = Model(state, rollout="stay", opponents="stay")
        model.play(1)
        return closeness(model)

    assert play(tag, look, 1) == [-2.0]
    near = tag.replace(**{"teams.blue.agents.cat.node": 1})
    assert -2.0 < play(near, look, 1)[0] < -1.0
    blind = tag.replace(**{"sensors": {}, "teams.red.sensors": [], "teams.blue.sensors": []})
    assert play(blind, look, 1)[0] > -2.0


# -- what is refused -------------------------------------------------------------------------------------------------


def test_a_model_needs_the_state_of_a_game(line):
    with pytest.raises(MissingKey, match=r"needs state\['fork'\]"):
        Model(line.agent.get_agent("ann").get_state())
    with pytest.raises(BadType, match="the state of an agent"):
        Model(line)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"opponents": "gamms.strategies:flea"}, BadValue, "is not a strategy of GAMMS"),
        ({"opponents": {"green": walk}}, UnknownName, "team in opponents=.*blue"),
        ({"rollout": 3}, BadType, "rollout is a strategy"),
        ({"sampel": None}, UnknownName, "Did you mean 'sample'"),
        ({"sample": 3}, BadType, "sample is a function"),
        ({"motion": 3}, BadType, "motion"),
        ({"information": "all"}, BadValue, "information"),
    ],
)
def test_impossible_arguments_are_refused(tag, options, error, words):
    with pytest.raises(error, match=words):
        play(tag, lambda state: Model(state, **options), 1)


def test_an_action_for_no_agent_is_refused(tag):
    with pytest.raises(UnknownName, match="Did you mean 'ann'"):
        play(tag, lambda state: Model(state).play(1, {"anna": 3}), 1)


def test_the_seed_of_a_fork_for_deciders_does_not_follow_from_that_of_the_game(tag):
    def look(state):
        return state["fork"](3).game.ctx.seed

    assert play(tag, look, turns=1, seed=4711) == play(tag, look, turns=1, seed=4712)
