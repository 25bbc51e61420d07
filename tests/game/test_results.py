"""Results, tables, collectors and settings."""

import copy
import json
import pickle
import re
import sys
import threading
import time
from contextlib import nullcontext
from fractions import Fraction

import numpy as np
import pytest

import gamms
from gamms.errors import BadFile, BadType, GammsError, MissingExtra
from gamms.game import Result


def played(ctx, play):
    play("a", 0, 1, 5, team="red")
    play("b", 5, 99, team="blue")

    @ctx.game.add
    def rule(ctx):
        ctx.game.scores["red"] += 1.5
        ctx.game.emit("seen", agent="a", at=(1, 2), by=None if ctx.game.turn == 1 else "b")
        if ctx.game.turn == 2:
            ctx.game.emit("end", ok=True)
            ctx.game.end("done", winner="red")

    ctx.game.collect("node", lambda agent: agent.current_node_id, per="agent")
    ctx.game.collect("late", lambda ctx: {"turn": ctx.game.turn}, every=2)
    return ctx.game.run()


@pytest.mark.parametrize("score", ["three", None, float("nan"), np.array([1.0]), 1j])
def test_scores_that_are_no_numbers_are_refused_and_change_nothing(ctx, score):
    ctx.game.scores["red"] += np.float64(1.5)
    for write in (
        lambda: ctx.game.scores.__setitem__("red", score),
        lambda: ctx.game.scores.update({"blue": 2, "red": score}),
        lambda: ctx.game.scores.update(blue=2, red=score),
        lambda: ctx.game.scores.__ior__({"blue": 2, "red": score}),
        lambda: ctx.game.scores.setdefault("green", score),
        lambda: type(ctx.game.scores)({"blue": 2}, red=score),
    ):
        with pytest.raises(BadType, match=r"The score of '(red|green)' must be a number, not"):
            write()
    assert ctx.game.scores == {"red": 1.5}


def test_scores_are_set_as_those_of_a_dict_are(ctx):
    scores = ctx.game.scores
    assert [scores.setdefault("red", 2), scores.setdefault("red", 5), scores.setdefault("blue")] == [2, 2, 0]
    scores |= {"red": 3}
    scores |= [("green", 1)]
    assert scores is ctx.game.scores == {"red": 3, "blue": 0, "green": 1}
    assert type(scores)({"red": 1}, blue=2) == {"red": 1, "blue": 2}


@pytest.mark.parametrize("conflicts", [None, gamms.rules.Conflicts()])
def test_the_timings_of_a_game_add_up_to_no_more_than_it_took(ctx, play, conflicts):
    play("a", 0, 1, 5, team="red")
    ctx.game.conflicts = conflicts
    ctx.game.add(lambda ctx: time.sleep(1e-4), phase="deeds")
    began = time.perf_counter()
    timings = ctx.game.run(3).timings
    assert 0.0 < sum(timings.values()) <= time.perf_counter() - began
    assert timings["rules"] >= 3e-4


def test_tables_have_columns_of_plain_types(ctx, play):
    result = played(ctx, play)
    agents = result.table("agents")
    assert list(agents) == ["agent", "team", "alive", "node", "moves", "blocked", "illegal", "errors", "overruns"]
    assert agents["agent"].tolist() == ["a", "b"]
    assert [agents[name].dtype.kind for name in ("agent", "alive", "node")] == ["U", "b", "i"]
    seen = result.table("seen")
    assert {name: column.tolist() for name, column in seen.items()} == {
        "turn": [1, 2],
        "agent": ["a", "a"],
        "at": [(1, 2), (1, 2)],
        "by": [None, "b"],
    }
    assert result.table("node")["value"].tolist() == [1, 5, 5, 5]
    assert result.table("node")["agent"].tolist() == ["a", "b", "a", "b"]
    assert result.table("late")["value"].tolist() == [{"turn": 2}]
    assert result.table("events")["kind"].tolist() == ["seen", "seen", "end"]
    assert result.table("scores")["score"].tolist() == [3.0]
    assert result.table("errors")["agent"].tolist() == ["b"]
    assert {len(column) for column in result.table("errors").values()} == {1}
    with pytest.raises(KeyError, match=r"Unknown table 'agent'. Did you mean 'agents'\?"):
        result.table("agent")


def test_tables_of_a_game_in_which_nothing_happened_are_empty(ctx, play):
    play("a", 0)
    result = ctx.game.run(1)
    for name, columns in (
        ("events", ["turn", "kind"]),
        ("errors", ["turn", "agent", "kind", "message"]),
        ("scores", ["of", "score"]),
    ):
        assert list(result.table(name)) == columns
        assert all(len(column) == 0 for column in result.table(name).values())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda plain: plain.pop("turns"), "missing required field `turns`"),
        (lambda plain: plain.update(turns="7"), "Expected `int`, got `str` - at `$.turns`"),
        (lambda plain: plain.update(turns=True), "Expected `int`, got `bool` - at `$.turns`"),
        (lambda plain: plain.update(format="other"), "no 'format' 'gamms result 1'"),
        (lambda plain: plain["events"].append({"turn": 3}), "missing required field `kind` - at `$.events[3]`"),
        (lambda plain: plain["agents"].update(a=3), "Expected `object`, got `int` - at `$.agents[...]`"),
        (lambda plain: plain["collected"]["node"].update(turn=[1]), "columns of different lengths"),
        (lambda plain: plain["collected"].update(node=3), "Expected `object`, got `int` - at `$.collected[...]`"),
    ],
)
def test_a_file_that_is_no_result_is_refused(ctx, play, tmp_path, change, message):
    played(ctx, play).save(tmp_path / "r.json")
    plain = json.loads((tmp_path / "r.json").read_text())
    change(plain)
    (tmp_path / "r.json").write_text(json.dumps(plain))
    with pytest.raises(BadFile, match=re.escape(message)):
        Result.load(tmp_path / "r.json")


@pytest.mark.parametrize("text", ["", "[", "[" * 100_000, "3", "\xff", '{"turns": 1' + "0" * 5000 + "}"])
def test_a_file_that_is_not_even_json_is_refused(tmp_path, text):
    (tmp_path / "r.json").write_text(text, encoding="latin-1")
    with pytest.raises(BadFile, match="is not a result"):
        Result.load(tmp_path / "r.json")


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "r.json").open("wb") as file:
        file.truncate(1 << 30)
    with pytest.raises(BadFile, match="would take about 40"):
        Result.load(tmp_path / "r.json")


def test_a_result_is_printed_as_a_table(ctx, play):
    result = played(ctx, play)
    result.scores["met\x1b"] = 2
    text = str(result).splitlines()
    assert text[0] == f"red won after 2 turns: done (seed {ctx.seed})"
    assert text[2].split() == ["team", "agents", "alive", "moves", "score"]
    assert [line.split() for line in text[3:5]] == [["red", "1", "1", "2", "3"], ["blue", "1", "1", "0", "0"]]
    assert text[7].split() == ["met\\u001b", "2"]
    assert text[-1] == "What strategies did wrong (result.errors): 1 illegal"
    del result.scores["met\x1b"]
    assert repr(result) == f"Result(turns=2, winner='red', reason='done', scores={{'red': 3.0}}, seed={ctx.seed})"


def test_a_notebook_shows_a_table_of_the_teams(ctx, play):
    result = played(ctx, play)
    result.reason = "<done>"
    page = result._repr_html_()
    assert page.startswith("<b>red won after 2 turns: &lt;done&gt;</b>")
    assert "<tr><td>red</td><td>1</td><td>1</td><td>2</td><td>3</td></tr>" in page


def test_tables_become_data_frames(ctx, play):
    pandas = pytest.importorskip("pandas")
    result = played(ctx, play)
    for name in ("agents", "teams", "scores", "events", "errors", "node"):
        frame, table = result.to_pandas(name), result.table(name)
        assert isinstance(frame, pandas.DataFrame)
        assert {column: frame[column].tolist() for column in frame} == {key: one.tolist() for key, one in table.items()}


def test_without_pandas_the_error_says_how_to_get_it(ctx, play, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtra, match=r"\(extra 'notebook'\): pip install "):
        played(ctx, play).to_pandas("agents")


def test_results_are_equal_whatever_time_they_took(ctx, play):
    result = played(ctx, play)
    ctx.game.reset()
    again = ctx.game.run()
    assert again == result
    assert again.timings != result.timings
    again.scores["red"] += 1
    assert again != result
    assert result != "result"


def test_collected_values_are_copies(ctx, play):
    play("a", 0)
    log = []
    ctx.game.add(lambda ctx: log.append(ctx.game.turn))
    ctx.game.collect("log", lambda ctx: log)
    assert ctx.game.run(2).table("log")["value"].tolist() == [[1], [1, 2]]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("x", None), TypeError),
        (("", len), ValueError),
        (("x", len, 0), ValueError),
        (("x", len, 1.5), TypeError),
        (("x", len, 1, "team"), ValueError),
        (("taken", len), ValueError),
    ],
)
def test_an_impossible_collector_is_refused(ctx, arguments, error):
    ctx.game.collect("taken", len)
    with pytest.raises(error) as caught:
        ctx.game.collect(*arguments)
    assert isinstance(caught.value, GammsError)


@pytest.mark.parametrize(
    ("setting", "value", "words"),
    [
        ("legal", "edge", "ctx.game.legal cannot be 'edge'. Did you mean 'edges'?"),
        ("on_illegal", "ignore", "Use one of: 'stay', 'raise'."),
        ("on_error", True, "Use one of: 'raise', 'stay'."),
        ("speed_unit", "meters", "Did you mean 'metres'?"),
        ("conflicts", "none", "must have a method resolve"),
        ("time_budget", 0, "must be more than 0"),
        ("time_budget", "1 s", "must be a number"),
        ("max_turns", -1, "must not be negative"),
        ("max_turns", 1.5, "must be an integer"),
    ],
)
def test_a_setting_is_checked_when_it_is_set(ctx, setting, value, words):
    before = getattr(ctx.game, setting)
    with pytest.raises((ValueError, TypeError)) as caught:
        setattr(ctx.game, setting, value)
    assert words in str(caught.value)
    assert getattr(ctx.game, setting) == before
    with pytest.raises((ValueError, TypeError)):
        gamms.create_context(game={setting: value}, logger_config={"level": "CRITICAL"})


def test_settings_may_be_given_to_the_context():
    with gamms.create_context(game={"legal": "any", "max_turns": 3}, logger_config={"level": "CRITICAL"}) as ctx:
        assert (ctx.game.legal, ctx.game.max_turns, ctx.game.on_error) == ("any", 3, "raise")
    with pytest.raises(KeyError, match=r"Unknown setting of a game 'leagl'. Did you mean 'legal'\?"):
        gamms.create_context(game={"leagl": "any"}, logger_config={"level": "CRITICAL"})
    with pytest.raises(TypeError, match="must be a dict of settings"):
        gamms.create_context(game="fast", logger_config={"level": "CRITICAL"})


@pytest.mark.parametrize(
    ("rule", "phase", "error"), [(None, "during", ValueError), ("rule", "after", TypeError), (3, "before", TypeError)]
)
def test_an_invalid_rule_is_refused(ctx, rule, phase, error):
    with pytest.raises(error):
        ctx.game.add(rule, phase=phase)


def test_numbers_beyond_64_bits_make_a_column_of_objects(ctx, play):
    play("a", 0)
    ctx.game.collect("big", lambda ctx: 2**80)
    column = ctx.game.run(1).table("big")["value"]
    assert (column.dtype, column.tolist()) == (np.dtype(object), [2**80])


def test_a_context_shows_its_seed_its_size_and_its_turn(grid):
    with grid(seed=7) as ctx:
        assert repr(ctx) == "Context(seed=7, nodes=16, agents=0, turn=0)"
        ctx.agent.create_agent("a", start_node_id=0)
        ctx.game.run(2)
        assert repr(ctx) == "Context(seed=7, nodes=16, agents=1, turn=2)"
    assert repr(ctx) == "Context(seed=7, terminated)"


@pytest.mark.parametrize("score", [10**400, -(10**400), Fraction(10**400)])
@pytest.mark.parametrize("how", ["set", "update", "add"])
def test_a_score_that_does_not_fit_into_a_float_is_refused_where_it_is_set(ctx, score, how):
    ctx.game.scores["red"] = 1
    with pytest.raises(gamms.errors.BadValue, match="The score of 'red' must fit into a float, not "):
        if how == "set":
            ctx.game.scores["red"] = score
        elif how == "update":
            ctx.game.scores.update(blue=2, red=score)
        else:
            ctx.game.scores["red"] += score
    assert ctx.game.scores == {"red": 1}


@pytest.mark.parametrize("score", [10**300, 1e308, float("inf"), True, Fraction(1, 3)])
def test_other_scores_are_compared_at_the_time_limit(ctx, score):
    ctx.game.add(gamms.rules.time_limit(1))
    ctx.game.scores["red"] = score
    assert ctx.game.run().scores["red"] == score


def test_a_result_that_is_read_later_tells_of_the_turn_in_which_it_was_made(ctx, play):
    play("a", 0, 1, 5, team="red")
    play("b", 5, 6, 99, team="blue")
    result, copies = ctx.game.run(1), []
    copies += [pickle.loads(pickle.dumps(ctx.game.result())), copy.deepcopy(ctx.game.result())]
    ctx.game.run(1)
    ctx.agent.delete_agent("b")
    ctx.agent.get_agent("a").strategy = None
    for one in (result, *copies):
        assert (one.turns, [*one.agents], one.agents["a"]["node"], one.agents["b"]["moves"]) == (1, ["a", "b"], 1, 1)
        assert one.provenance["strategies"].keys() == {"a", "b"}
        assert one.provenance["strategies"]["a"]
    assert result == copies[0]


def test_a_result_keeps_what_is_set_before_the_rest_is_made(ctx):
    result = ctx.game.run(1)
    result.agents = {"mine": {}}
    assert result.provenance["strategies"] == {}
    assert result.agents == {"mine": {}}


def test_threads_may_read_a_result_first_at_once_and_after_an_error(ctx):
    result, found, are_in = ctx.game.run(1), [], threading.Barrier(2)
    made = vars(result)["_make"]

    def make():
        are_in.wait(timeout=60)  # both have found that nothing is made
        return made()

    def fail():
        raise KeyboardInterrupt

    vars(result)["_make"] = fail
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            _ = result.agents
    vars(result)["_make"] = make
    threads = [threading.Thread(target=lambda: found.append(result.agents), daemon=True) for _ in range(2)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert len(found) == 2
    assert found[0] is found[1]


@pytest.mark.parametrize("per", ["game", "agent"])
def test_a_collector_that_raises_leaves_no_part_of_a_row(ctx, play, per):
    play("a", 0, 0, 0, 0, team="red")
    ctx.game.collect("turns", lambda _: ctx.game.turn if ctx.game.turn != 2 else (one for one in ()), per=per)
    for turn in range(1, 5):
        with pytest.raises(TypeError, match="generator") if turn == 2 else nullcontext():
            ctx.game.step()
    table = ctx.game.result().table("turns")
    assert table["turn"].tolist() == table["value"].tolist() == [1, 3, 4]
    assert {len(column) for column in table.values()} == {3}
