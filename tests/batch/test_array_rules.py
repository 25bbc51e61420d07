"""Rules that are written in arrays alone do the same in games alone and in batches."""

import numpy as np
import pytest
from batch_scenes import assert_as_alone, check_games, plain, scene
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue

LAWS = settings(max_examples=12, deadline=None, derandomize=True)
SEEDS = [1, 2**40]
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "respawn"}}
OUT = {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "then": "eliminate"}}


def tolls(chance=0.3, most=6, points=1, out=False):
    """Let agents pay at every fifth node; who has paid often goes back or out, and the game ends."""

    @gamms.array_rule
    def toll(turn):
        paid = turn.keep(("toll", chance), lambda games: {"paid": np.zeros((games, 6), np.int64)})["paid"]
        is_gate = np.arange(len(turn.streets.counts)) % 5 == 0
        visits = turn.visits(is_gate)
        names = turn.roster.keys[visits.agents]
        pays = turn.draw_bits(visits.at, names, "toll") < np.uint64(int(chance * 2**64))
        visits = visits.select(pays)
        np.add.at(paid, (turn.games[visits.at], visits.agents), 1)
        turn.emit(
            "toll",
            visits.at,
            agents={"agent": visits.agents},
            nodes={"node": visits.nodes},
            values={"since": visits.begin.tolist()},
        )
        turn.add_scores(visits.at, visits.agents, points if out else visits.begin * points)
        turn.add_score("gates", visits.at, np.full(len(visits.at), 0.1))
        at, agents = np.nonzero((paid[turn.games] > 2) & turn.alive)
        (turn.eliminate if out else turn.respawn)(at, agents)
        paid[turn.games[at], agents] = 0
        stops = turn.stops(*np.nonzero(turn.alive)).sum()
        assert stops >= 0
        seen = [one for one in turn.new_events("toll") if one.kind == "tag"]
        for one in seen:
            turn.add_score("tags", one.games, 1)
        over = np.flatnonzero(turn.scores("gates") * 10 > most)
        winner = np.where(turn.start_of(np.arange(6)).sum(axis=1) % 2 == 0, "red", "blue")
        turn.end(over, "toll", winner[over].tolist())

    return toll


def same_in_both(scenario, rule, phase="after", turns_before=0, **settings):
    with scenario.build(seed=1) as ctx:
        for name, value in settings.items():
            setattr(ctx.game, name, value)
        ctx.game.add(rule, phase=phase)
        for _ in range(turns_before):
            ctx.game.step()

        def play(games):
            games.run()
            games.reset()
            games.run()

        return check_games(ctx, seeds=SEEDS, play=play)


@LAWS
@given(
    st.builds(tolls, st.sampled_from([0.3, 0.9]), st.integers(3, 9), st.sampled_from([1, 0.1]), st.booleans()),
    st.sampled_from(["before", "after"]),
    st.lists(st.sampled_from([TAG, OUT]), max_size=2, unique_by=str),
    st.sampled_from([None, [["blue"], ["red"]]]),
)
def test_an_array_rule_does_the_same_alone_and_in_batches(rule, phase, rules, order):
    results = same_in_both(scene(rules, side=4, max_turns=10), rule, phase, order=order)
    assert any(result.events for result in results)


def test_an_array_rule_keeps_its_memory_from_before_a_batch():
    same_in_both(scene([TAG], side=4, max_turns=20), tolls(most=99), turns_before=8)


@gamms.array_strategy
def mark(view):
    """Walk at random, and mark others."""
    those = view.only(view.draw.random() < 0.6)
    near = view.draw.below(np.full(view.counts.shape, 7))
    sizes = those.draw.random()
    notes = np.where(sizes < 0.5, {"seen": [1]}, None)
    kinds = {"how": "far", "note": notes, "lit": sizes < 0.3, "to": near}
    view.do("mark", those.mask, whom=near - 1, size=sizes, node=view.node, **kinds)
    view.do("rest", view.draw.random() < 0.3)
    return view.draw.below(view.counts)


@gamms.array_rule
def strike(turn):
    done, resting = turn.performed("mark"), turn.performed("rest")
    first = np.unique(done.at, return_index=True)[1]
    done = done.select(first[(done.values["size"][first] > 0.5) & (done.values["whom"][first] >= 0)])
    turn.emit(
        "strike",
        done.at,
        agents={"agent": done.agents, "other": done.values["whom"]},
        nodes={"at": done.nodes, "there": done.values["node"]},
        values={name: done.values[name].tolist() for name in ("how", "note", "lit", "to")},
    )
    turn.eliminate(done.at, done.values["whom"])
    at = np.flatnonzero((np.bincount(resting.at, minlength=len(turn.games)) > 3) & (turn.turn > 3))
    turn.end(at, "calm", [None] * len(at), truncated=True)


@gamms.array_rule
def count(turn):
    playing = turn.is_playing.sum(axis=1)
    at = np.flatnonzero(playing > turn.alive.sum(axis=1))
    turn.emit("left", at, values={"playing": playing[at].tolist()})


@pytest.mark.parametrize("phase", ["before", "deeds", "after"])
@pytest.mark.parametrize("order", [None, [["blue"], ["red"]]])
def test_it_sees_deeds_in_every_phase(phase, order):
    fields = {"whom": "agent?", "size": "number", "how": ["near", "far"], "node": "node"}
    fields |= {"note": "value?", "lit": "boolean", "to": "integer"}
    scenario = scene([], side=4, max_turns=8, settings={"deeds": {"mark": fields, "rest": {}}, "order": order})
    with scenario.build(seed=1, strategies={"red": mark, "blue": mark}) as ctx:
        ctx.game.add(strike, phase=phase)
        ctx.game.add(count)
        with ctx.game.batch(seeds=SEEDS) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays
            assert_as_alone(games, alone)
        assert {event["kind"] for event in games.result(0).events} >= {"strike", "eliminated"}


def test_it_closes_and_opens_roads():
    @gamms.array_rule
    def tide(turn):
        edges = list(range(0, len(turn.streets.columns.edge_ids), 3))
        is_odd = turn.seeds % 2 == 1
        turn.close_roads(np.flatnonzero(is_odd & (turn.turn == 2)), edges)
        turn.open_roads(np.flatnonzero(is_odd & (turn.turn == 6)), edges)

    same_in_both(scene([TAG], side=4, max_turns=10), tide)


def test_a_scenario_names_it_and_records_the_same_bytes(tmp_path):
    (tmp_path / "rules.py").write_text(
        "import gamms\n\n\n@gamms.array_rule\ndef pay(turn):\n"
        "    at, agents = (turn.alive & (turn.node % 4 == 0)).nonzero()\n    turn.add_scores(at, agents, 1)\n\n\n"
        "def paid(points):\n    @gamms.array_rule\n    def rule(turn):\n"
        "        at, agents = (turn.ends != turn.starts).nonzero()\n        turn.add_scores(at, agents, points)\n"
        "        turn.emit('paid', at, agents={'agent': agents})\n\n    return rule\n"
    )
    rules = [{"rule": "rules:pay"}, {"rule": "rules:paid", "with": {"points": 0.5}}]
    scenario = scene(rules, side=4, max_turns=6, folder=tmp_path)
    with scenario.batch(seeds=SEEDS) as games:
        games.run()
        for number, seed in enumerate(SEEDS):
            result = scenario.play(seed=seed, record=tmp_path / "alone.ggr")
            assert plain(games.result(number)) == plain(result)
            assert result.events
        games.record(len(SEEDS) - 1, tmp_path / "batch.ggr")
    assert (tmp_path / "batch.ggr").read_bytes() == (tmp_path / "alone.ggr").read_bytes()


def test_an_array_rule_is_refused_in_a_single_game_where_it_needs_a_batch():
    @gamms.array_rule
    def publishes(turn):
        turn.publish("storm", turn.turn)

    with pytest.raises(BadType, match="An array rule must be a function of a turn"):
        gamms.array_rule(3)
    with pytest.raises(BadType, match=r"a function of a turn alone, and <lambda>\(turn, agents\) is not"):
        gamms.array_rule(lambda turn, agents: None)
    with scene().build(seed=1) as ctx:
        ctx.game.add(publishes)
        with pytest.raises(BadValue, match=r"turn\.publish of 'storm' is not for array rules"):
            ctx.game.step()
    with scene().build(seed=1) as ctx:
        ctx.game.add(publishes)
        with (
            ctx.game.batch(2) as games,
            pytest.raises(BadValue, match=r"turn\.publish of 'storm' is not for array rules"),
        ):
            games.step()


WRITES = {
    name: lambda turn, name=name: getattr(turn, name).fill(0)
    for name in ("games", "turn", "seeds", "starts", "ends", "took_part", "node", "alive")
}
WRITES["after a verb"] = lambda turn: (turn.eliminate([0], [0]), turn.alive.fill(0))
MISTAKES = {
    "the name of an agent": (lambda turn: turn.eliminate([0], ["red_0"]), BadType, "agents must be an array of int"),
    "no such agent": (lambda turn: turn.respawn([0], [99]), BadValue, "99 is out of range; the 6 agents"),
    "no such game": (
        lambda turn: turn.add_score("red", [7], 1),
        BadValue,
        "7 is out of range; the [12] games of this turn",
    ),
    "a mask of games": (
        lambda turn: turn.end(turn.turn > 0, "over", [None]),
        BadType,
        "at must be an array of integers",
    ),
    "too many winners": (
        lambda turn: turn.end([0], "over", ["red", "blue"]),
        BadValue,
        "winner has a value for each of 1",
    ),
    "too few agents": (lambda turn: turn.emit("x", [0, 0], agents={"agent": [1]}), BadValue, "agent has a value for"),
    "no such node": (
        lambda turn: turn.emit("x", [0], nodes={"node": [25]}),
        BadValue,
        "25 is out of range; the 25 nodes",
    ),
    "one value": (lambda turn: turn.emit("x", [0], values={"how": "fast"}), BadValue, "how has a value for each of 1"),
    "a kind that is no text": (lambda turn: turn.emit(3, [0]), BadType, "a kind of event must be a string, not 3"),
    "NaN": (lambda turn: turn.add_score("red", [0], np.nan), BadType, "The score of 'red' must be a number, not"),
    "nodes by their ids": (lambda turn: turn.visits([1, 2]), BadType, "which must be an array of booleans"),
    "some nodes": (
        lambda turn: turn.visits(np.ones(3, bool)),
        BadValue,
        r"\(3,\), which does not broadcast to \(25,\)",
    ),
    "points of no number": (
        lambda turn: turn.add_score("red", [0], "3"),
        BadType,
        "points must be an array of numbers",
    ),
    "where no agent began": (lambda turn: turn.start_of([9]), BadValue, "agents: 9 is out of range; the 6 agents"),
    "how often no agent stopped": (lambda turn: turn.stops([0], 9), BadValue, "agents: 9 is out of range; the 6"),
    "an event of another turn": (
        lambda turn: turn.emit("seen", [0], values={"turn": [3]}),
        BadValue,
        "give turn= another name",
    ),
    "kept arrays of no games": (
        lambda turn: turn.keep("k", lambda games: {"x": np.zeros(games + 1)}),
        BadValue,
        "first",
    ),
    "an array to keep": (lambda turn: turn.keep("k", np.zeros(2)), BadType, "is a function of the number of games"),
    "one kept array": (lambda turn: turn.keep("k", np.zeros), BadType, "returns name -> array"),
}


def played_alone(rule):
    with scene().build(seed=1) as ctx:
        ctx.game.add(rule)
        ctx.game.step()


def played_in_a_batch(rule):
    with scene().build(seed=1) as ctx:
        ctx.game.add(rule)
        with ctx.game.batch(2) as games:
            games.step()


@pytest.mark.parametrize("play", [played_alone, played_in_a_batch])
@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_a_rule_changes_a_turn_by_its_verbs_alone(write, play):
    with pytest.raises(ValueError, match="read-only"):
        play(gamms.array_rule(write))


@pytest.mark.parametrize("play", [played_alone, played_in_a_batch])
@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=MISTAKES)
def test_a_verb_explains_invalid_arguments(mistake, play):
    call, kind, message = mistake

    @gamms.array_rule
    def rule(turn):
        try:
            call(turn)
        finally:
            assert (turn.alive.all(), turn.scores("red").sum(), turn.new_events("seen")) == (True, 0, [])

    with pytest.raises(kind, match=message):
        play(rule)


def test_verbs_take_lists_and_one_agent_for_several_games():
    @gamms.array_rule
    def rule(turn):
        at = list(range(len(turn.games)))
        turn.eliminate(at, 1)
        turn.respawn(at, [1] * len(at))
        turn.add_score("red", [*at, *at], [0.5] * 2 * len(at))
        turn.add_scores(at, 0, 1)
        far = (turn.stops(at, 1) + turn.start_of([2])[:, 0]).tolist()
        turn.emit("seen", at, agents={"agent": [2] * len(at)}, values={"how": far})
        turn.end(at, ["late"] * len(at), ("red",) * len(at))

    same_in_both(scene(), rule)
