"""Games of a batch in which plain functions do what games that share a context cannot: they equal the games alone."""

import gc
import logging
from contextlib import suppress

import numpy as np
import pytest
from batch_scenes import assert_as_alone, assert_as_shown, check_games, plain, scene

import gamms
from gamms.errors import BadValue
from gamms.rules import Conflicts

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
FLAGS = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 24}, "goal": None}}
SAID = logging.getLogger("tests of games that leave")
RADIO = {"radio": {"range_m": 30.0}}


def score(ctx):
    ctx.game.scores["later"] += 1


def number_of_agents(ctx):
    return len(ctx.game.agents)


def swap_teams(ctx):
    for agent in ctx.game.agents:
        agent.team = {"red": "blue", "blue": "red"}[agent.team]


def remove_node(ctx):
    """Remove a node that no agent and no rule needs."""
    agents = ctx.game.agents
    used = {0, 24, *map(ctx.game.start_node, agents)}
    used |= {node for agent in agents for node in (agent.current_node_id, agent.prev_node_id)}
    ctx.graph.graph.remove_node(min({*ctx.graph.graph.get_nodes()} - used))


ACTS = {
    "speed": lambda ctx: setattr(ctx.agent.get_agent("red_0"), "speed", 2),
    "teams": swap_teams,
    "conflicts": lambda ctx: setattr(ctx.game, "conflicts", Conflicts(1)),
    "legal": lambda ctx: setattr(ctx.game, "legal", "any"),
    "most turns": lambda ctx: setattr(ctx.game, "max_turns", ctx.game.turn + 3),
    "order": lambda ctx: setattr(ctx.game, "order", [["blue"], ["red"]]),
    "rule": lambda ctx: ctx.game.add(score),
    "no rule": lambda ctx: ctx.game.remove("tag"),
    "collector": lambda ctx: ctx.game.collect("agents", number_of_agents),
    "data": lambda ctx: setattr(ctx.game, "data", {"new": ctx.seed}),
    "flags": lambda ctx: ctx.game.scores.update(known=len(str(ctx.game.data.get("flags")))),
    "memories": lambda ctx: ctx.game.scores.update(known=len(ctx.game.memories)),
    "events": lambda ctx: ctx.game.events.clear(),
    "messages": lambda ctx: ctx.game.messages.clear(),
    "facts": lambda ctx: ctx.game.publish(flags={"lost": ctx.seed}),
    "attributes": lambda ctx: vars(ctx.agent.get_agent("red_0")).update(tired=True),
    "strategy": lambda ctx: setattr(ctx.agent.get_agent("red_0"), "strategy", gamms.strategies.stay),
    "edge": lambda ctx: ctx.graph.graph.remove_edge(0),
    "node": remove_node,
    "boolean": lambda ctx: ctx.game.scores.update(red=True),
    "place": lambda ctx: ctx.game.scores.update(known=ctx.graph.place(1)[0]),
}


def open_with(act, phase="after"):
    """Return a context with a game in which a rule acts in some games, each from another turn on."""

    def rule(ctx):
        if ctx.game.turn == 2 + ctx.seed % 4 and ctx.seed % 3 == 0:
            ACTS[act](ctx)
        ctx.game.scores["sum"] += sum(agent.current_node_id for agent in ctx.game.agents)

    ctx = scene([TAG, FLAGS], channels=RADIO, max_turns=7).build(seed=1)
    ctx.game.add(rule, phase=phase)
    return ctx


ACTS_IN_PHASES = [(act, phase) for act in ACTS for phase in ("before", "deeds", "after")]
ACTS_IN_PHASES.remove(("order", "deeds"))  # which is refused


@pytest.mark.parametrize(("act", "phase"), ACTS_IN_PHASES)
def test_a_game_goes_on_as_it_does_alone_and_the_others_are_not_affected(act, phase):
    seeds = range(4)
    with open_with(act, phase) as ctx, ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
        games.run()
        assert not games.detached
        assert_as_alone(games, alone)
        assert games.turn.tolist() == [games.result(number).turns for number in seeds]
        games.reset([0, 1], seeds=[2, 5])
        games.run()
        assert plain(games.result(0)) == plain(games.result(2))


def test_scores_in_the_core_are_kept_while_a_game_that_has_left_has_one_that_is_no_number():
    with open_with("boolean") as ctx, ctx.game.batch(seeds=range(4)) as games, ctx.game.fork(0).ctx as alone:
        while not games.is_over.all():
            games.step()
        assert not games.detached
        assert_as_alone(games, alone)


@pytest.mark.parametrize("phase", ["before", "deeds"])
def test_a_turn_in_whose_middle_a_game_leaves_and_then_raises_is_taken_back(phase):
    raises = [True]

    def fail(state):
        if len(state["legal"]) > 5 and next(iter(raises), False):  # in the game that has left
            raise ZeroDivisionError
        gamms.strategies.random_walk(state)

    def change_rules(ctx):
        ctx.game.scores["calls"] += 1
        if ctx.game.turn == 3 and ctx.seed == 1 and ctx.game.legal == "edges":
            ctx.game.legal = "any"

    with scene([TAG], settings={"order": [["blue"], ["red"]]}).build(seed=1) as ctx:
        ctx.game.add(change_rules, phase=phase)
        ctx.agent.get_agent("red_0").register_strategy(fail)
        with ctx.game.batch(seeds=range(3)) as games, ctx.game.fork(0).ctx as alone:
            games.run(3)
            for _ in range(2):
                with pytest.raises(ZeroDivisionError):
                    games.run()
                assert games.turn.tolist() == [3, 3, 3]
            raises.clear()
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


@pytest.mark.parametrize("act", ["speed", "teams", "legal", "edge", "conflicts", "rule"])
def test_games_are_stepped_observed_and_shown_with_those_in_the_core(act):
    with open_with(act) as ctx, ctx.game.batch(seeds=range(6)) as games:
        for turn in range(7):
            view = games.observe("red")
            games.step({"red": (turn + view.games[:, None] + view.agents) % view.counts})
            for number in (0, 1, 3):
                shown = games.context(number).game
                legal = [shown.observation(name)["legal"] for name in view["name"]]
                mine = games.observe("red")["legal"][number].tolist()
                assert [[node for node in one if node >= 0] for one in mine] == [[*one] for one in legal]
        assert games.detached.keys() <= {0, 3}
        assert_as_shown(games)


def test_actions_that_are_illegal_in_a_separate_game_are_refused_before_any_game_plays():
    with open_with("speed") as ctx, ctx.game.batch(seeds=range(4)) as games:
        for _ in range(5):
            games.step()
        assert not games.detached
        turns = games.turn.tolist()
        with pytest.raises(BadValue, match=r"of agent 'red_0' in game 0"):
            games.step({"red": np.where(np.arange(4)[:, None] == 0, 99, 0) + np.zeros((4, 3), np.int64)})
        assert games.turn.tolist() == turns


def test_no_game_has_played_a_turn_in_which_a_separate_one_raises():
    raises = [True]

    def fail(ctx):
        if ctx.seed == 3 and ctx.game.turn >= 6 and next(iter(raises)):
            raise ZeroDivisionError

    with open_with("speed") as ctx:
        ctx.game.add(fail)
        with ctx.game.batch(seeds=range(5)) as games, ctx.game.fork(0).ctx as alone:
            for _ in range(5):
                games.step()
            assert not games.detached
            scores = games.scores["sum"].tolist()
            with pytest.raises(ZeroDivisionError) as caught:
                games.step()
            assert any("of game 3" in note or "In game 3" in note for note in caught.value.__notes__)
            assert games.turn.tolist() == [5] * 5
            assert games.scores["sum"].tolist() == scores
            raises[0] = False
            games.run()
            assert_as_alone(games, alone)


@pytest.mark.parametrize(
    ("act", "phase"), [pair for pair in ACTS_IN_PHASES if pair[0] in ("speed", "rule", "order", "strategy")]
)
def test_a_function_is_called_once_in_each_turn_of_a_game_that_it_changes(act, phase, caplog):
    def rule(ctx):
        ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")
        if ctx.game.turn == 3 and ctx.seed:
            ACTS[act](ctx)

    with scene([TAG, FLAGS], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(rule, phase=phase)
        with ctx.game.batch(seeds=range(3)) as games:
            for _ in range(2):
                games.step()
            games.run()
            first = 1 if phase == "after" else 0
            said = [f"seed {seed}, turn {turn}" for seed in range(3) for turn in range(first, first + 6)]
            assert sorted(caplog.messages) == said
            assert not games.detached


def tell_and_go(state):
    """Go by what was sensed, heard and why the last action failed, and tell where."""
    seen = [len(data) for _, data in state["sensor"].values()]
    heard = sum(message["body"] for message in state["inbox"])
    state["outbox"].append({"channel": "radio", "to": None, "body": sum(seen) + state["curr_pos"]})
    number = sum(seen) + heard + len(state["blocked"] or "") + state["draw"].below(9)
    state["action"] = state["legal"][number % len(state["legal"])]


@pytest.mark.parametrize("parts", [None, [["blue"], ["red"]]])
@pytest.mark.parametrize(
    "more", [{}, {"speed_unit": "edges"}, {"speed_unit": "metres"}, {"speed_unit": "metres", "decide": "arrival"}]
)
def test_a_game_follows_another_plan_in_any_part_of_a_turn_with_what_agents_have_decided(more, parts, caplog):
    def rule(ctx):
        calls = ctx.game.data["calls"] = ctx.game.data.get("calls", 0) + 1
        ctx.logger.warning(f"seed {ctx.seed}, call {calls}")
        ctx.game.scores["moves"] += sum(move.start * move.end for move in ctx.game.moves.values())
        if ctx.seed and calls == 4 + ctx.seed:
            ctx.game.max_turns = 5

    eyes = {"near": {"type": "AGENT_RANGE", "sensor_range": 90.0, "detection": 0.5}}
    team = {"count": 3, "sensors": ["near"], **({"speed": 2.5} if more else {})}
    given = {"teams": {"red": team, "blue": team}, "sensors": eyes, "channels": RADIO, "max_turns": 6}
    with scene([TAG], side=4, settings={"order": parts, **more}, **given).build(seed=1) as ctx:
        ctx.game.conflicts = Conflicts(1)
        for agent in ctx.agent.create_iter():
            agent.strategy = tell_and_go
        ctx.game.add(rule, phase="deeds")
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert len({*caplog.messages}) == len(caplog.messages) == 6 * 3 * len(parts or "1")
            assert_as_alone(games, alone)


def test_rules_that_follow_in_the_turn_see_what_agents_have_sensed_before_a_setting_was_changed():
    def slow_down(ctx):
        if ctx.game.turn == 3:
            ctx.game.max_turns = 8

    def recall(ctx):
        if ctx.game.turn in (3, 4, 6):
            states = [ctx.agent.get_agent(name).state for name in ("red_0", "blue_0")]
            ctx.game.scores["seen"] += sum(len(str(state["sensor"])) + state["action"] for state in states)
            ctx.game.scores["near"] += len(ctx.agent.get_agent("red_1").sensors["next"].data)

    eyes = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}, "next": {"type": "NEIGHBOR"}}
    walkers = {"count": 2, "strategy": "gamms.strategies:random_walk", "sensors": ["near", "next"]}
    with scene([TAG, "respawn"], teams={"red": walkers, "blue": walkers}, sensors=eyes).build(seed=1) as ctx:
        ctx.game.add(slow_down)
        ctx.game.add(recall)
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


def note_seen(state, agent):
    """Return a state of an agent, and the data of its sensors, as texts."""
    names = ("turn", "curr_pos", "sensor", "legal", "action", "memory")
    shown = {name: str(state[name]) for name in names if name in state}
    return {"state": shown, "data": [str(one.data) for one in agent.sensors.values()]}


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
@pytest.mark.parametrize("decide", ["turn", "arrival"])
def test_functions_that_look_back_are_called_once(phase, decide, caplog):
    def recall(ctx):
        ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")
        for agent in ctx.agent.create_iter():
            ctx.game.emit("recalled", by=agent.name, **note_seen(agent.state, agent))
        red = ctx.agent.get_agent("red_0")
        if ctx.game.turn % 2:
            red.sensors["near"].sense(red.current_node_id)
            red.state["read"] = ctx.game.turn
        elif "read" in red.state:
            ctx.game.scores["read"] += 1

    def change(ctx):
        if (ctx.seed, ctx.game.turn) == (1, 4):
            ctx.game.max_turns = 9

    def come_and_go(ctx):
        agents = ctx.agent.agents
        if ctx.game.turn == 2 and "red_3" not in agents:
            like = agents["red_1"]
            given = {"speed": like.speed, "sensors": dict(like.sensors)}
            ctx.agent.create_agent("red_3", start_node_id=0, team="red", strategy=like.strategy, **given)
        if ctx.game.turn == 3 + ctx.seed:
            ctx.agent.delete_agent("blue_1")

    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}
    team = {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": ["near"], "speed": 15.0}
    how = {"settings": {"speed_unit": "metres", "decide": decide}, "max_turns": 7}
    with scene([TAG], teams={"red": team, "blue": team}, sensors=near, **how).build(seed=1) as ctx:
        ctx.agent.get_agent("red_0").strategy = go_by_sight
        ctx.game.add(recall, phase=phase)
        ctx.game.add(change)
        ctx.game.add(come_and_go)
        with ctx.game.batch(3, most_agents={"red": 4}) as games, ctx.game.fork(0).ctx as alone:
            games.step()
            games.reset([2])
            games.run()
            assert not games.detached
            assert len(caplog.messages) == len({*caplog.messages}) + 1 == 7 * 3 + 1
            assert_as_alone(games, alone)


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_functions_read_the_data_of_rules_after_another_game_has_changed(phase):
    def rule(ctx):
        ctx.game.data["own"] = ctx.game.turn
        if ctx.game.turn == 2 + ctx.seed % 2:
            ACTS["flags" if ctx.seed % 2 else "conflicts"](ctx)
        if ctx.game.turn > 3:
            ctx.game.emit("data", keys=sorted(ctx.game.data))

    with scene([FLAGS], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(rule, phase=phase)
        with ctx.game.batch(4) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


def wander(state):
    state["action"] = state["legal"][(state["draw"].below(5) + int(state["rng"].integers(5))) % len(state["legal"])]


def go_by_sight(state):
    ((_, seen),) = state["sensor"].values()
    state["action"] = state["legal"][len(seen) % len(state["legal"])]


def look_again(ctx):
    """Sense, and read what was sensed."""
    agent = ctx.agent.get_agent("red_0")
    agent.sensors["near"].sense(agent.current_node_id)
    ctx.game.emit("looked", seen=sorted(agent.sensors["near"].data))


def draw_once(ctx):
    """Draw from the streams of an agent."""
    state = ctx.game.observation("blue_0")
    ctx.game.emit("drawn", number=state["draw"].below(1000) + int(state["rng"].integers(1000)))


def show_looks(ctx):
    """Read what was sensed last, and look once more."""
    if ctx.game.turn > 4 and ctx.seed % 2:
        ctx.game.emit("read", seen=sorted(ctx.agent.get_agent("red_0").sensors["near"].data))
        look_again(ctx)
        draw_once(ctx)


@pytest.mark.parametrize(
    ("act", "phase"),
    [*((look_again, phase) for phase in ("before", "deeds", "after")), (draw_once, "before"), (draw_once, "after")],
)
def test_a_function_that_looks_or_draws_for_agents_is_called_once_where_they_have_not_decided(act, phase, caplog):
    def rule(ctx):
        ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")
        if ctx.seed % 2 and ctx.game.turn > 2:
            act(ctx)
            act(ctx)

    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 90.0, "detection": 0.5}}
    team = {"count": 3, "sensors": ["near"]}
    with scene([TAG], teams={"red": team, "blue": team}, sensors=near, max_turns=6).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = go_by_sight if agent.team == "red" else wander
        ctx.game.add(rule, phase=phase)
        ctx.game.add(show_looks)
        with ctx.game.batch(seeds=range(4)) as games, ctx.game.fork(0).ctx as alone:
            for _ in range(3):
                games.step()
            games.run()
            assert len({*caplog.messages}) == len(caplog.messages)
            assert not games.detached
            assert_as_alone(games, alone)


@pytest.mark.parametrize("phase", ["before", "deeds"])
def test_sensors_that_err_look_in_a_game_that_leaves_as_often_in_a_turn_as_alone(phase):
    def act(ctx):
        if ctx.seed % 2 and ctx.game.turn == 2:
            ctx.game.max_turns = 5

    def look_again(ctx):
        if ctx.seed % 2 and ctx.game.turn == 2:
            agent = ctx.agent.get_agent("red_0")
            agent.sensors["near"].sense(agent.current_node_id)
            ctx.game.emit("looked", seen=sorted(agent.sensors["near"].data))

    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 90.0, "detection": 0.5}}
    team = {"count": 3, "sensors": ["near"]}
    with scene([], teams={"red": team, "blue": team}, sensors=near, max_turns=6).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = go_by_sight
        ctx.game.add(act, phase=phase)
        ctx.game.add(look_again, phase=phase)
        with ctx.game.batch(seeds=range(4)) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


def test_a_game_that_begins_again_and_leaves_looks_as_often_in_its_turn_as_alone():
    def act(ctx):
        if ctx.seed:
            ctx.game.max_turns = 1

    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 90.0, "detection": 0.5}}
    team = {"count": 3, "sensors": ["near"]}
    with scene([], teams={"red": team, "blue": team}, sensors=near).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = go_by_sight
        ctx.game.add(act, phase="before")
        with ctx.game.batch(seeds=[1, 0]) as games, ctx.game.fork(0).ctx as alone:
            games.step()
            games.reset([0], seeds=[1])
            games.run()
            assert_as_alone(games, alone)


@pytest.mark.parametrize("phase", ["before", "after"])
def test_a_function_that_changes_a_setting_and_raises_keeps_the_change_if_all_had_moved(phase):
    def fail(ctx):
        if ctx.game.turn == 3 and "failed" not in ctx.game.data:
            ctx.game.data["failed"] = True
            ctx.game.legal = "any"
            raise ZeroDivisionError

    with scene([TAG], max_turns=9).build(seed=1) as ctx:
        ctx.game.add(fail, phase=phase)
        ctx.game.add(score)
        with ctx.game.batch(1) as games, ctx.game.fork(0).ctx as alone:
            alone.game.reset(seed=0)
            for play in (games.step, alone.game.step):
                for turn in range(4 if phase == "before" else 3):
                    if turn == (3 if phase == "before" else 2):
                        with pytest.raises(ZeroDivisionError):
                            play()
                    else:
                        play()
            games.run()
            assert plain(games.result(0)) == plain(alone.game.run())
            assert alone.game.legal == ("edges" if phase == "before" else "any")


def test_a_game_that_has_left_cannot_be_reset_in_its_context():
    with open_with("speed") as ctx, ctx.game.batch(seeds=range(3)) as games:
        for _ in range(3):
            games.step()
        with pytest.raises(BadValue, match=r"games.reset\(\[0\]\)"):
            games.context(0).game.reset()
        games.reset([0])
        assert games.turn.tolist() == [0, 3, 3]


def test_strategies_look_ahead_in_a_game_in_which_they_were_set():
    def count_known(state):
        ahead = state["fork"](1)
        state["action"] = state["legal"][(state["turn"] + len(str(ahead))) % len(state["legal"])]

    def learn(ctx):
        if ctx.game.turn == 3:
            ctx.agent.get_agent("red_0").strategy = count_known

    with scene([TAG, "respawn"]).build(seed=1) as ctx:
        ctx.game.add(learn)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_array_functions_go_on_with_what_they_keep_in_a_game_that_leaves(phase):
    @gamms.array_strategy
    def count(view):
        kept = view.keep("steps", lambda games: {"taken": np.zeros((games, 6), np.int64)})["taken"]
        which = view.games[:, None], view.agents
        kept[which] += 1
        return (kept[which] + view.draw.below(view.counts)) % view.counts

    @gamms.array_rule
    def pay(turn):
        kept = turn.keep("paid", lambda games: {"turns": np.zeros(games, np.int64)})["turns"]
        kept[turn.games] += 1
        turn.add_score("paid", np.arange(len(turn.games)), kept[turn.games])

    def slow_down(ctx):
        if ctx.game.turn == 4:
            ctx.agent.get_agent("blue_0").speed = 2

    with scene([TAG, "respawn"]).build(seed=1) as ctx:
        for agent in ctx.game.agents:
            agent.strategy = count
        ctx.game.add(pay)
        ctx.game.add(slow_down, phase=phase)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


OF_SEED = """
import gamms
import numpy as np

def draw(ctx):
    return int(ctx.stream("lot").integers(9))

class Prepared:
    def prepare(self, ctx):
        ctx.game.data["lot"] = int(ctx.stream("lot").integers(9))

    def __call__(self, ctx):
        ctx.game.data["lot"] += ctx.game.facts["lot"] + ctx.game.agents[0].meta["luck"]
        ctx.game.scores["lot"] += ctx.game.data["lot"]

def make_rule():
    return Prepared()

@gamms.array_rule
def pay(turn):
    kept = turn.keep("paid", lambda games: {"turns": np.zeros(games, np.int64)})["turns"]
    kept[turn.games] += 1
    turn.add_score("paid", turn.games * 0, float(turn.facts["lot"]) * kept[turn.games])

def hear(ctx):
    level = draw(ctx)
    return lambda node: node + level

class Planned:
    def prepare(self, ctx):
        self.number = ctx.seed + sum(agent.current_node_id for agent in ctx.agent.create_iter())

    def __call__(self, state):
        number = state["memory"]["sum"] = state["memory"].get("sum", self.number) + state["sensor"]["ear"][1]
        state["action"] = state["legal"][number % len(state["legal"])]

planned = Planned()

def slow_down(ctx):
    ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")
    if ctx.game.turn == 3 and ctx.seed % 2:
        ctx.agent.get_agent("blue_0").speed = 2
"""


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_a_game_takes_along_its_seeded_state(phase, tmp_path, caplog):
    (tmp_path / "by_seed.py").write_text(OF_SEED)
    meta = {"luck": {"function": "by_seed:draw"}}
    team = {"count": 2, "sensors": ["ear"], "meta": meta, "strategy": "by_seed:planned"}
    rules = [{"rule": f"by_seed:{name}"} for name in ("make_rule", "pay")]
    rules += [{"rule": "by_seed:slow_down", "phase": phase}]
    facts = {"lot": {"function": "by_seed:draw"}}
    sensors = {"ear": {"function": "by_seed:hear"}}
    made = scene(rules, teams={"red": team, "blue": team}, facts=facts, sensors=sensors, folder=tmp_path)
    with made.batch(4, seed=1) as games:
        games.run()
        assert not games.detached
        assert len({*caplog.messages}) == len(caplog.messages) == 4 * 12
        for number, seed in enumerate(games.seeds):
            assert plain(games.result(number)) == plain(made.play(seed=seed))


@pytest.mark.parametrize("keeps", [False, True])
@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_array_functions_go_on_in_a_game_that_leaves_after_agents_have_come_and_gone(phase, keeps, caplog):
    @gamms.array_strategy
    def wander(view):
        number = view.keep("turns", lambda games: {"played": np.zeros(games, np.int64)})["played"] if keeps else None
        if number is not None:
            number[view.games] += 1
        return (view.draw.below(view.counts) + (0 if number is None else number[view.games][:, None])) % view.counts

    def rule(ctx):
        ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")
        if ctx.game.turn == 2:
            ctx.agent.create_agent("red_9", start_node_id=3, team="red", strategy=wander)
            ctx.agent.delete_agent("blue_1")
        if ctx.game.turn == 4 + ctx.seed and ctx.seed:
            ctx.agent.get_agent("blue_0").speed = 2

    with scene([TAG, "respawn"], max_turns=8).build(seed=1) as ctx:
        for agent in ctx.game.agents:
            agent.strategy = wander
        ctx.game.add(rule, phase=phase)
        with ctx.game.batch(3, most_agents={"red": ["red_9"]}) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert len({*caplog.messages}) == len(caplog.messages) == 3 * 8
            assert_as_alone(games, alone)


def test_strategies_made_for_each_seed_decide_in_games_that_leave(tmp_path):
    code = """
def slow_down(ctx):
    if ctx.game.turn == 4:
        ctx.agent.get_agent("blue_0").speed = 2
"""
    (tmp_path / "leaving.py").write_text(code)

    def turn_by_seed(ctx):
        seed = ctx.seed

        def act(state):
            steps = state["memory"]["steps"] = state["memory"].get("steps", 0) + seed
            state["action"] = state["legal"][steps % len(state["legal"])]

        return act

    scenario = scene([TAG, "leaving:slow_down"], folder=tmp_path)
    with scenario.batch(3, seed=4, strategies={"red": turn_by_seed}) as games:
        games.run()
        assert not games.detached
        for number in range(3):
            alone = scenario.play(seed=games.seeds[number], strategies={"red": turn_by_seed})
            assert plain(games.result(number)) == plain(alone)


def make_walker(ctx, act):
    """Return a strategy that walks by what it has drawn and remembers, and acts in some games in its third turn."""

    def walk(state):
        legal, seen = state["legal"], state["memory"].setdefault("seen", [])
        seed = ctx.game.scores["seed"]
        SAID.warning(f"seed {seed}, turn {state['turn']}, {state['name']}")
        seen.append([len(data) for _, data in state["sensor"].values()])
        state["action"] = legal[(state["draw"].below(9) + sum(map(sum, seen))) % len(legal)]
        state["team_memory"][state["name"]] = state["curr_pos"]
        if "outbox" in state:
            state["outbox"].append({"channel": "radio", "to": None, "body": len(state["inbox"])})
        if state["turn"] == 3 and seed % 2 and state["name"] != "red_0":
            act(ctx, state)

    return walk


def look_ahead(_, state):
    state["memory"]["ahead"] = state["fork"](1).game.turn


def count_memories(ctx, state):
    state["memory"]["known"] = len(str(ctx.game.memories))


def read_flags(ctx, state):
    state["memory"]["known"] = len(str(ctx.game.data["flags"]))


def go_back_and_forth(_, state):
    state["action"] = [state["curr_pos"], state["legal"][-1], state["curr_pos"]]


def go_on_an_edge(_, state):
    state["action"] = {"edge_id": state["legal_edges"][0]}


def fail_after_reading(ctx, state):
    if len(ctx.game.memories) > 0 and state["name"] == "red_2":
        raise ZeroDivisionError


DECIDES = [look_ahead, count_memories, read_flags, go_back_and_forth, go_on_an_edge, fail_after_reading]
HOW = {
    "channels": {"channels": RADIO},
    "deeds": {"settings": {"deeds": {"rest": {}}}},
    "metres": {"settings": {"speed_unit": "metres"}},
    "edges": {"settings": {"speed_unit": "edges"}},
    "order": {"settings": {"order": [["red"], ["blue"]]}},
    "later": {"settings": {"order": [["blue"], ["red"]]}},
    "later, channels": {"settings": {"order": [["blue"], ["red"]]}, "channels": RADIO},
    "later, metres": {"settings": {"order": [["blue"], ["red"]], "speed_unit": "metres"}, "channels": RADIO},
    "later, edges": {"settings": {"order": [["blue"], ["red"]], "speed_unit": "edges"}},
}


@pytest.mark.parametrize(("act", "how"), [(act, "plain") for act in DECIDES] + [(count_memories, how) for how in HOW])
def test_strategies_look_ahead_read_what_the_core_knows_and_name_edges_as_alone(act, how, caplog):
    def note_look(node):
        SAID.warning(f"look {ctx.seed} {ctx.game.turn}")
        return [node % 7]

    def note_seed(ctx):
        ctx.game.scores["seed"] = ctx.seed

    @gamms.array_strategy
    def turn_left(view):
        return (view.draw.below(view.counts) + view.turn[:, None]) % view.counts

    eyes = {"near": {"type": "AGENT_RANGE", "sensor_range": 90.0, "detection": 0.5}}
    team = {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": ["near"]}
    if how.endswith(("metres", "edges")):
        team["speed"] = 8.0 if how.endswith("metres") else 2
    options = HOW.get(how, {})
    with scene([FLAGS], teams={"red": team, "blue": team}, sensors=eyes, max_turns=6, **options).build(seed=1) as ctx:
        ctx.game.on_error = ctx.game.on_illegal = "stay"
        walk = make_walker(ctx, act)
        ctx.game.add(note_seed, phase="before")
        odd = ctx.sensor.from_function("odd", note_look)
        for agent in ctx.agent.create_iter():
            if agent.team == "red":
                agent.strategy = walk
            elif agent.name == "blue_1":
                agent.strategy = turn_left
            elif agent.name == "blue_2":
                agent.register_sensor("odd", odd)
        with ctx.game.batch(seeds=range(4)) as games, ctx.game.fork(0).ctx as alone:
            for _ in range(2):
                games.step()
            games.run()
            said = [f"seed {s}, turn {t}, red_{i}" for s in range(4) for t in range(6) for i in range(3)]
            assert sorted(one for one in caplog.messages if one.startswith("seed")) == said
            looks = [f"look {seed} {turn}" for seed in range(4) for turn in range(6)]
            assert sorted(one for one in caplog.messages if one.startswith("look")) == looks
            assert games.is_in_arrays
            assert_as_alone(games, alone)


@pytest.mark.parametrize("by_plan", [False, True])
@pytest.mark.parametrize("seeds", [[1], [0, 1, 2, 3]])
def test_an_error_of_a_strategy_that_reads_what_the_core_knows_names_it_and_the_turn_is_played_again(seeds, by_plan):
    def note_seed(ctx):
        ctx.game.scores["seed"] = ctx.seed

    def walk(state):
        calls = state["memory"]["calls"] = state["memory"].get("calls", 0) + 1
        state["action"] = state["legal"][state["draw"].below(len(state["legal"]))]
        if calls == 4 and state["name"] == "red_1" and ctx.game.scores["seed"] % 2 and len(ctx.game.memories):
            raise ZeroDivisionError

    def lead(states):
        for state in states.values():
            walk(state)

    with scene([FLAGS], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(note_seed, phase="before")
        for agent in ctx.agent.create_iter():
            if agent.team == "red":
                agent.strategy = walk
        if by_plan:
            ctx.game.command("red", lead)
        with ctx.game.batch(seeds=seeds) as games, ctx.game.fork(0).ctx as alone:
            for _ in range(3):
                games.step()
            for seed in filter(lambda seed: seed % 2, seeds):
                with pytest.raises(ZeroDivisionError) as caught:
                    games.step()
                number = seeds.index(seed)
                assert f"In game {number} of a batch, with the seed {seed}." in caught.value.__notes__
                assert games.turn.tolist() == [3] * len(seeds)
            games.run()
            alone.game.reset(seed=1)
            with pytest.raises(ZeroDivisionError):
                alone.game.run()
            assert plain(games.result(seeds.index(1))) == plain(alone.game.run())


def read_unnamed(ctx):
    eval("agent.state", {"agent": ctx.agent.get_agent("red_0")})["turn"]


def read_and_catch(ctx):
    with suppress(BadValue):
        read_unnamed(ctx)


def write_unnamed(ctx):
    eval("agent.__dict__.update(tired=True)", {"agent": ctx.agent.get_agent("red_0")})


def draw_unnamed(ctx):
    eval("ctx.game.observation('red_0')['draw'].below(9)", {"ctx": ctx})


SAYS_LOOK = r"has not kept what agent .\w+. has sensed before this turn"
SAYS_DRAW = "draws by the streams of agents while agents move.*draw from ctx.rng, or let a rule do it before or after"


@pytest.mark.parametrize(
    ("act", "phase", "strategy", "said"),
    [
        (read_unnamed, "after", "gamms.strategies:random_walk", f"{SAYS_LOOK}.*reads agent.state"),
        (read_and_catch, "after", "gamms.strategies:random_walk", SAYS_LOOK),
        (draw_unnamed, "deeds", "gamms.strategies:random_walk", SAYS_DRAW),
    ],
)
def test_what_a_batch_has_not_kept_is_refused_if_the_code_of_the_function_does_not_name_it(act, phase, strategy, said):
    def rule(ctx):
        if ctx.game.turn == 2 and ctx.seed == 1 and "tired" not in ctx.game.data:
            ctx.game.data["tired"] = True
            act(ctx)

    team = {"count": 3, "strategy": strategy}
    with scene([TAG], teams={"red": team, "blue": team}, max_turns=6).build(seed=1) as ctx:
        ctx.game.add(rule, phase=phase)
        with ctx.game.batch(3) as games:
            games.step()
            if phase != "after":
                games.step()
            before = games.turn.tolist()
            with pytest.raises(BadValue, match=said) as caught:
                games.step()
            assert any("in turn 2" in note for note in caught.value.__notes__)
            assert "In game 1 of a batch, with the seed 1." in caught.value.__notes__
            assert games.turn.tolist() == before
            games.run()
            assert games.turn.tolist() == [6, 6, 6]


@pytest.mark.parametrize(("act", "phase"), [(write_unnamed, "before"), (draw_unnamed, "deeds")])
def test_what_a_function_does_without_naming_it_stays_in_its_game(act, phase):
    def rule(ctx):
        if ctx.game.turn == 2 and ctx.seed == 1:
            act(ctx)

    def look(ctx):
        ctx.game.emit("seen", tired=[getattr(agent, "tired", None) for agent in ctx.game.agents])

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = wander
        ctx.game.add(rule, phase=phase)
        ctx.game.add(look)
        check_games(ctx, 3)


def test_games_that_draw_globally_by_code_that_names_no_generator_are_refused():
    def draw(ctx):
        ctx.game.scores["drawn"] += eval("__import__('random').randrange(9)")

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(draw)
        with ctx.game.batch(2) as games, pytest.raises(BadValue, match="global generators of random"):
            games.run()


@pytest.mark.parametrize("columns", [None, 7])
def test_a_game_leaves_with_arrays_that_are_kept_by_agent_only_if_all_agents_have_come(columns):
    @gamms.array_strategy
    def count(view):
        more = (columns,) if columns else ()
        kept = view.keep("turns", lambda games: {"played": np.zeros((games, *more), np.int64)})
        kept["played"][view.games] += 1
        return view.draw.below(view.counts)

    def slow_down(ctx):
        if ctx.game.turn == 3 and ctx.seed:
            ctx.agent.get_agent("blue_0").speed = 2

    with scene([TAG, "respawn"], max_turns=6).build(seed=1) as ctx:
        for agent in ctx.game.agents:
            agent.strategy = count
        ctx.game.add(slow_down)
        with ctx.game.batch(2, most_agents={"red": ["red_9"]}) as games, ctx.game.fork(0).ctx as alone:
            if columns:
                with pytest.raises(BadValue, match=r"place for agent .red_9., which has not come.*shape"):
                    games.run()
                assert games.turn.tolist() == [2, 2]
            else:
                games.run()
                assert not games.detached
                assert_as_alone(games, alone)


@pytest.mark.parametrize("name", ["state", "alive"])
def test_a_function_that_looks_back_by_a_name_in_a_variable_is_refused(name):
    def recall(ctx):
        for agent in ctx.game.agents:
            read = getattr(agent, name)
            ctx.game.emit("read", what=str(read["curr_pos"] if isinstance(read, dict) else read))

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(recall)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            if name == "state":
                with pytest.raises(BadValue, match=f"{SAYS_LOOK}.*reads agent.state"):
                    games.run()
                return
            games.run()
            assert games.is_in_arrays
            assert_as_alone(games, alone)


def test_functions_read_the_last_states_of_agents_with_actions_from_outside():
    def recall(ctx):
        for agent in ctx.game.agents:
            ctx.game.emit("recalled", decided=agent.state["turn"], by=agent.name)

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(recall)
        with ctx.game.batch(2) as games:
            games.step()
            games.step({"red": np.zeros((2, 3), np.int64)})
            games.run()
            read = [event for event in games.result(1).events if event["kind"] == "recalled"]
            assert [event["decided"] for event in read] == [event["turn"] - 1 for event in read]
            assert len(read) == 6 * 6


def test_agents_that_share_a_sensor_that_errs_count_looks_each_for_itself():
    def observe(ctx):
        seen = [[*ctx.game.observation(agent)["sensor"]["noisy"][1]] for agent in ctx.game.agents]
        ctx.game.emit("observed", seen=seen)

    with scene(max_turns=3).build(seed=1) as ctx:
        ctx.sensor.create_sensor("noisy", type="AGENT", detection=0.5)
        for agent in ctx.agent.create_iter():
            agent.register_sensor("noisy", ctx.sensor.get_sensor("noisy"))
        ctx.game.add(observe, phase="deeds")
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


def test_a_game_that_leaves_in_its_first_turn_takes_along_what_strategies_remember_from_it():
    def leave(ctx):
        ctx.game.max_turns = 8

    red = {"count": 2, "strategy": "gamms.strategies:random_waypoints"}
    with scene(teams={"red": red}).build(seed=1) as ctx:
        ctx.game.add(leave, phase="deeds")
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


def test_the_order_of_play_cannot_be_changed_while_agents_move():
    turns = [1]

    def turn_around(ctx):
        if ctx.game.turn in turns:
            ctx.game.order = [["blue"], ["red"]]

    with scene(max_turns=4).build(seed=1) as ctx:
        ctx.game.add(turn_around, phase="deeds")
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            with pytest.raises(BadValue, match=r"changes ctx.game.order, or the teams.*In a batch, change it in"):
                games.run()
            assert games.turn.tolist() == [1, 1]
            turns.clear()
            games.run()
            assert_as_alone(games, alone)


def add_events(ctx):
    """Add a rule that tells of each turn."""
    ctx.game.add(lambda ctx: ctx.game.emit("told", at=[one.current_node_id for one in ctx.game.agents]))


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
@pytest.mark.parametrize(
    "change",
    [
        lambda ctx: setattr(ctx.game, "legal", "any"),
        lambda ctx: setattr(ctx.game, "max_turns", 2),
        lambda ctx: setattr(ctx.agent.get_agent("blue_0"), "speed", 2),
        lambda ctx: ctx.game.collect("turn", lambda ctx: ctx.game.turn),
        add_events,
    ],
)
def test_a_game_leaves_whose_rule_replaces_an_agent_and_changes_settings_in_one_turn(change, phase):
    with scene(red=1, blue=1, max_turns=4).build() as ctx:

        def replace(ctx):
            if ctx.seed != 1 and ctx.game.turn < 2 and not ctx.game.data:
                ctx.game.data["is_done"] = True
                ctx.agent.delete_agent("red_0")
                ctx.agent.create_agent("red_0", start_node_id=7, team="red", strategy=gamms.strategies.random_walk)
                change(ctx)

        ctx.game.add(replace, phase=phase)
        ctx.game.add(lambda ctx: ctx.game.emit("part"), phase="deeds")
        check_games(ctx, 4)


@pytest.mark.parametrize("turn", range(2, 7))
def test_what_shipped_rules_remember_goes_back_with_a_turn_of_a_game_that_has_left(turn):
    faults = {turn}

    def recruit(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("scout", start_node_id=0, team="red", strategy=gamms.strategies.stay)

    def fail(ctx):
        if ctx.game.turn in faults and ctx.seed:
            faults.clear()
            raise ZeroDivisionError

    flags = {"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 1}, "goal": None}}
    with scene([flags], side=3, max_turns=9).build(seed=1) as ctx:
        ctx.game.add(recruit)
        ctx.game.add(fail)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            with pytest.raises(ZeroDivisionError):
                games.run()
            games.run()
            assert any(one["kind"] == "take" for number in (0, 1) for one in games.result(number).events)
            assert_as_alone(games, alone)


def replace_all(ctx):
    """Replace one agent, delete another, and create a third, once in turn 1."""
    if ctx.game.turn != 1 or ctx.game.data.get("is_done"):
        return
    ctx.game.data["is_done"] = True
    for name in ("red_0", "blue_0"):
        agent = ctx.agent.get_agent(name)
        ctx.agent.delete_agent(name)
        if name == "red_0":
            node = agent.current_node_id
            ctx.agent.create_agent(name, start_node_id=node, team=agent.team, strategy=agent.strategy)
    ctx.agent.create_agent("late", start_node_id=1, team="red", strategy=gamms.strategies.random_walk)


def tell_moves(ctx):
    """Record the moves that functions see, the tracks, and who was where."""
    agents = ctx.game.agents
    tracks = [
        [one.name, list(track.path), list(track.times)]
        for one, track in zip(agents, ctx.game.tracks(agents), strict=True)
    ]
    moves = [[name, move.start, move.end] for name, move in ctx.game.moves.items()]
    ctx.game.emit("told", moves=moves, tracks=tracks, visits=[[one.agent, one.node] for one in ctx.game.visits()])


@pytest.mark.parametrize("reserved", [None, {"red": ["late"]}])
@pytest.mark.parametrize("order", [None, [["red"], ["blue"]], [["blue"], ["red"]]])
@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_functions_see_the_moves_of_agents_that_were_replaced(phase, order, reserved):
    with scene(red=2, blue=2, max_turns=4).build(seed=1) as ctx:
        ctx.game.order = order
        ctx.game.add(replace_all, phase=phase)
        for told in ("before", "deeds", "after"):
            ctx.game.add(tell_moves, name=f"tell {told}", phase=told)
        with ctx.game.batch(3, most_agents=reserved) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
def test_random_streams_go_on_in_columns_of_their_own(phase):
    def draw(ctx):
        ctx.game.scores["luck"] += int(ctx.rng.integers(1000))
        if ctx.game.turn in (2, 3):  # again in the columns that the first change has made
            ctx.agent.get_agent("red_0").speed = 4 - ctx.game.turn

    with scene(max_turns=6).build(seed=1) as ctx:
        ctx.game.add(draw, phase=phase)
        ctx.game.step()
        with ctx.game.batch(3) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


def test_a_node_where_an_agent_was_cannot_be_removed():
    def remove(ctx):
        if ctx.game.turn == 3 and ctx.seed == 2:
            ctx.graph.graph.remove_node(ctx.game.start_node(ctx.game.agents[0]))

    with scene(red=1, blue=1, max_turns=6).build(seed=1) as ctx:
        for agent in ctx.game.agents:
            agent.strategy = lambda state: state.update(action=max(state["legal"]))
        ctx.game.add(remove, phase="before")
        with ctx.game.batch(seeds=[1, 2]) as games:
            with pytest.raises(BadValue, match="started or was before, was removed from the map") as caught:
                games.run()
            assert any("In game 1" in note for note in caught.value.__notes__)
            assert games.turn.tolist() == [3, 3]


def test_columns_of_a_game_that_changes_in_each_turn_do_not_add_up():
    def recruit(ctx):
        turn = ctx.game.turn
        ctx.agent.create_agent(f"new_{turn}", start_node_id=3, team="red", strategy=gamms.strategies.random_walk)
        if turn > 2:
            ctx.agent.delete_agent(f"new_{turn - 2}")
        assert len(ctx.game.moves) > 0

    def count_contexts():
        gc.collect()
        return sum(type(one) is gamms.context.Context for one in gc.get_objects())

    with scene(max_turns=20).build(seed=1) as ctx:
        ctx.game.add(recruit)
        with ctx.game.batch(1) as games:
            counts = []
            while not games.is_over.all():
                games.step()
                counts.append(count_contexts())
            assert len({*counts[4:]}) == 1


def test_a_game_that_begins_again_is_observed_as_at_the_start():
    with open_with("speed") as ctx, ctx.game.batch(seeds=range(4)) as games:
        start = games.observe("red")
        legal, counts = start["legal"].copy(), start.counts.copy()
        for _ in range(5):
            games.step()
            games.observe("red")
        games.reset()
        again = games.observe("red")
        assert again["legal"].tolist() == legal.tolist()
        assert again.counts.tolist() == counts.tolist()
