"""Who wins a contest, and what becomes of a resolver's answer that makes no sense."""

import pytest

import gamms
from gamms.errors import MissingKey
from gamms.rules import Conflicts, Contest, at_random, by_priority, by_rank, nobody
from gamms.strategies import random_walk, stay
from gamms.typing.game import Move

MOVERS = tuple(
    Move(name, team, start, 9, (start, 9)) for start, (name, team) in enumerate(zip("abc", "xyx", strict=True))
)
CONTEST = Contest(9, 2, MOVERS)


def names(winners):
    return "".join(winner.agent for winner in winners)


def test_teams_win_in_their_order_and_names_decide_within_one():
    assert names(by_priority(["x", "y"])(CONTEST, None)) == "ac"
    assert names(by_priority(("y", "x"))(CONTEST, None)) == "ba"
    assert names(by_priority(["y", "x"])(CONTEST._replace(places=1), None)) == "b"


def test_a_team_without_priority_is_an_error():
    with pytest.raises(KeyError, match=r"not list team 'y' of agent 'b'.*\['x'\]"):
        by_priority(["x"])(CONTEST, None)


def test_a_key_is_called_with_the_agents_and_the_smallest_wins(ctx):
    for name, age in zip("abc", (7, 3, 3), strict=True):
        ctx.agent.create_agent(name, start_node_id=0, age=age)
    assert names(by_priority(lambda agent: agent.age)(CONTEST, ctx)) == "bc"
    assert names(by_priority(lambda agent: -agent.age)(CONTEST, ctx)) == "ab"
    assert names(by_priority(lambda _: 0)(CONTEST, ctx)) == "ab"
    with pytest.raises(TypeError, match="cannot compare the values of its key for a: 7, b: 'b', c: 'c'"):
        by_priority(lambda agent: agent.age if agent.name == "a" else agent.name)(CONTEST, ctx)


@pytest.mark.parametrize("teams", ["red", {"red", "blue"}, 3, None])
def test_priorities_must_be_a_list_or_a_function(teams):
    with pytest.raises(TypeError, match="by_priority needs a list of teams"):
        by_priority(teams)


@pytest.mark.parametrize(("teams", "said"), [([], "at least one team"), (["red", "blue", "red"], "'red' twice")])
def test_priorities_name_every_team_once(teams, said):
    with pytest.raises(ValueError, match=said):
        by_priority(teams)


def test_the_smallest_rank_wins_and_names_decide_between_equals():
    ranks = {"a": 2.5, "b": -1, "c": 2.5}
    assert names(by_rank(lambda name, team: ranks[name])(CONTEST, None)) == "ba"
    assert names(by_rank(lambda name, team: (team, name))(CONTEST, None)) == "ac"


def test_an_agent_whose_rank_is_none_never_wins():
    assert names(by_rank(lambda name, team: None if team == "x" else 0)(CONTEST, None)) == "b"


def test_ranks_that_cannot_be_compared_are_refused():
    with pytest.raises(TypeError, match=r"ranks of agents cannot be compared: \[0, 'b', 0\]"):
        by_rank(lambda name, team: 0 if team == "x" else name)(CONTEST, None)


def test_an_agent_without_a_rank_is_an_error_when_it_is_in_a_contest(ctx):
    ranks = {"a": 0, "b": 1}
    conflicts = Conflicts(1, resolve=by_rank(lambda name, team: ranks[name]))
    moves = {mover.agent: mover for mover in MOVERS}
    alone = {**moves, "c": MOVERS[2]._replace(end=5)}
    assert conflicts.resolve(alone, ctx) == {"b"}
    with pytest.raises(KeyError, match="c"):
        conflicts.resolve(moves, ctx)


def test_ranks_need_a_function():
    with pytest.raises(TypeError, match="by_rank needs a function"):
        by_rank({"a": 1})


def test_a_contest_without_a_winner_stops_all():
    assert names(nobody()(CONTEST, None)) == ""


@pytest.mark.parametrize("factory", [nobody, at_random, by_priority, by_rank])
def test_a_maker_of_resolvers_that_was_not_called_is_refused(factory):
    with pytest.raises(TypeError, match=rf"call it, as in {factory.__name__}\("):
        Conflicts(resolve=factory)


def test_a_resolver_must_be_a_function():
    with pytest.raises(TypeError, match=r"must be a function .* not 'nobody'"):
        Conflicts(resolve="nobody")


@pytest.mark.parametrize(
    ("answer", "error", "said"),
    [
        (None, TypeError, r"must give a list of the winners, names or moves, not None"),
        ("a", TypeError, r"must give a list .* not 'a'"),
        (MOVERS[0], TypeError, r"must give a list"),
        ([None], TypeError, r"must name winners or give their moves, not None"),
        (["z"], ValueError, r"let 'z' win, not one of \['a', 'b', 'c'\]"),
        (["a", "b", "c"], ValueError, r"let 3 win, \['a', 'b', 'c'\], but contest.places is 2"),
    ],
)
def test_an_answer_that_makes_no_sense_names_the_resolver_and_the_node(ctx, answer, error, said):
    def generous(_contest, _ctx):
        return answer

    moves = {mover.agent: mover for mover in MOVERS}
    with pytest.raises(error, match=rf"^The resolver 'generous', asked about node 9, {said}"):
        Conflicts(2, resolve=generous).resolve(moves, ctx)


def test_an_answer_about_an_exchange_names_both_nodes(ctx):
    moves = {"a": Move("a", None, 3, 1, (3, 1)), "b": Move("b", None, 1, 3, (1, 3))}
    with pytest.raises(ValueError, match=r"asked about the exchange of nodes \(1, 3\), let 2 win"):
        Conflicts(allow_swaps=False, resolve=lambda contest, _ctx: contest.movers).resolve(moves, ctx)


def test_an_error_inside_a_resolver_is_not_hidden(ctx):
    with pytest.raises(ZeroDivisionError):
        Conflicts(resolve=lambda _contest, _ctx: 1 // 0).resolve({mover.agent: mover for mover in MOVERS}, ctx)


@pytest.fixture
def crossing():
    """A grid on which ann of red and bob of blue stand far from each other, and red has priority."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("ann", start_node_id=0, team="red", strategy=stay)
        ctx.game.conflicts = Conflicts(resolve=by_priority(["red"]))
        yield ctx


def play_alone(ctx, turns):
    for _ in range(turns):
        ctx.game.step()


def play_in_a_batch(ctx, turns):
    with ctx.game.batch(2) as games:
        for _ in range(turns):
            games.step()


LEFT_OUT = "by_priority does not list team 'blue' of agent 'bob'. Put it into the list ['red']."


@pytest.mark.parametrize("play", [play_alone, play_in_a_batch])
def test_priorities_that_leave_out_a_team_are_refused_before_the_first_contest(crossing, play):
    crossing.agent.create_agent("bob", start_node_id=8, team="blue", strategy=stay)
    with pytest.raises(MissingKey) as caught:
        play(crossing, 1)
    assert str(caught.value) == LEFT_OUT
    assert crossing.game.turn == 0
    crossing.agent.get_agent("bob").team = "red"
    play(crossing, 2)


@pytest.mark.parametrize("play", [play_alone, play_in_a_batch])
def test_priorities_may_leave_out_who_makes_no_contest(crossing, play):
    crossing.agent.create_agent("nobody", start_node_id=8, strategy=stay)
    crossing.agent.create_agent("drone", start_node_id=8, team="blue", type="AERIAL", speed=1.0)
    crossing.agent.create_agent("dead", start_node_id=8, team="blue", strategy=stay)
    crossing.game.eliminate("dead")
    play(crossing, 3)


@pytest.mark.parametrize("play", [play_alone, play_in_a_batch])
def test_an_agent_that_comes_later_needs_a_priority_too(crossing, play):
    def reinforce(ctx):
        if ctx.game.turn == 2:
            ctx.agent.create_agent("bob", start_node_id=8, team="blue", strategy=stay)

    crossing.game.add(reinforce)
    with pytest.raises(MissingKey) as caught:
        play(crossing, 4)
    assert str(caught.value) == LEFT_OUT


def test_ranks_of_agents_are_still_asked_for_in_a_contest_only(crossing):
    crossing.game.conflicts = Conflicts(resolve=by_rank(lambda name, team: {"ann": 1}[name]))
    crossing.agent.create_agent("bob", start_node_id=8, team="blue", strategy=stay)
    play_alone(crossing, 2)


def test_a_rank_that_fails_raises_the_same_error_in_each_turn():
    def fail(name, team):
        raise ZeroDivisionError(name)

    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 4))
        for i in range(6):
            ctx.agent.create_agent(f"a{i}", start_node_id=i, strategy=random_walk)
        ctx.game.conflicts = Conflicts(capacity=1, resolve=by_rank(fail))
        for _ in range(3):
            with pytest.raises(ZeroDivisionError):
                ctx.game.step()
