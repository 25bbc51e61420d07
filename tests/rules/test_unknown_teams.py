"""Rules that mention teams without agents: refused when the game begins, as in scenario files."""

import inspect
from functools import partial

import pytest

import gamms
from gamms.errors import BadType, UnknownName
from gamms.rules import (
    arrive,
    capture_flag,
    discover,
    hold,
    idleness,
    last_team,
    none_left,
    reach,
    resource,
    respawn,
    tag,
    territory,
    time_limit,
)
from gamms.strategies import stay
from gamms.typing.game import OWNERS, TEAMS, find_team_parameters


@pytest.fixture
def ctx():
    with gamms.create_context(seed=5) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        yield ctx


@pytest.fixture
def game(ctx, heard):
    for name, team in (("ann", "red"), ("bob", "blue")):
        ctx.agent.create_agent(name, start_node_id=len(name), team=team, strategy=stay)
    return ctx.game


NOBODY = "Unknown team 'green'. There are: 'blue', 'red'. The rule {rule!r} mentions it, and no agent plays for it: "
NOBODY += "if its agents come later, declare it by ctx.agent.create_team('green', [])."
MENTIONED = [
    tag("red", "green"),
    tag("green", "red"),
    reach("green", 3),
    reach({"red": 3, "green": 4}),
    reach("red", "starts of green"),
    reach("red", 3, winner="green"),
    arrive("green", 3),
    arrive("red", "starts of green"),
    time_limit(2, winner="green"),
    none_left("green"),
    none_left("red", winner="green"),
    hold(3, 2, teams="green"),
    idleness(3, teams="green"),
    discover(3, teams=["red", "green"]),
    respawn(teams="green"),
    resource("fuel", 3, teams=["green"]),
    capture_flag({"red": 3}, teams="green"),
]


def play_alone(game):
    game.run(3)


def play_by_steps(game):
    game.step()


def play_batch(game):
    with game.batch(2) as games:
        games.run(warn=False)


@pytest.mark.parametrize("play", [play_alone, play_by_steps, play_batch])
@pytest.mark.parametrize("rule", MENTIONED, ids=repr)
def test_a_rule_that_mentions_a_team_without_agents_is_refused_when_the_game_begins(game, rule, play):
    game.max_turns = 3
    game.add(rule)
    for _ in range(2):
        with pytest.raises(UnknownName) as caught:
            play(game)
        assert str(caught.value) == NOBODY.format(rule=rule.__name__)
    assert game.turn == 0
    game.ctx.agent.create_agent("gus", start_node_id=0, team="green", strategy=stay)
    play(game)


def test_all_shipped_rules_with_parameters_that_name_teams_are_tried_here():
    shipped = map(partial(getattr, gamms.rules), gamms.rules.__all__)
    named = {
        rule.__name__ for rule in shipped if inspect.isfunction(rule) and TEAMS in find_team_parameters(rule).values()
    }
    assert named - {"contacts"} == {rule.__name__ for rule in MENTIONED}


def test_changes_after_a_refusal_belong_to_the_start_of_the_game(game):
    game.add(tag("red", "green"))
    with pytest.raises(UnknownName):
        game.run(3)
    game.ctx.agent.create_agent("gus", start_node_id=0, team="green", strategy=stay)
    game.run(3)
    game.reset()
    assert game.ctx.agent.get_agent("gus").team == "green"


def test_a_declared_team_may_be_mentioned_before_its_agents_come(game, heard):
    game.ctx.agent.create_team("green", [])
    game.add(tag("red", "green"))
    game.step()
    game.ctx.agent.create_agent("gus", start_node_id=3, team="green", strategy=stay)
    game.step()
    assert [event["other"] for event in game.events if event["kind"] == "tag"] == ["gus"]
    game.reset(seed=6)
    game.step()
    assert heard == []


def test_a_declared_team_has_no_agents(ctx):
    declared = ctx.agent.create_team("green", [])
    assert (len(declared), ctx.agent.teams, ctx.agent.agents) == (0, {}, {})
    assert len(ctx.agent.create_team("green", [3, 4])) == 2


def test_a_team_whose_agents_are_deleted_or_dead_is_known(game, heard):
    game.eliminate("bob")
    game.ctx.agent.delete_agent("ann")
    game.add(tag("red", "blue"))
    game.step()
    assert heard == []


def test_a_rule_of_the_user_may_create_the_agents_of_a_team_later(game, heard):
    def reinforce(ctx):
        if ctx.game.turn == 1:
            ctx.agent.create_agent("gus", start_node_id=3, team="green", strategy=stay)

    game.add(reinforce)
    game.add(tag("red", "green"))
    game.run(3)
    assert [event["other"] for event in game.events if event["kind"] == "tag"] == ["gus"] * 3
    assert heard == ["tag: Unknown team 'green'. There are: 'blue', 'red'. No agent plays for it."]


def test_a_function_of_the_user_in_a_rule_may_create_agents_too(game):
    game.add(tag("red", "green", then=lambda ctx, tagger, tagged: None))
    game.step()


@pytest.mark.parametrize(
    "rule",
    [
        tag("red", "bleu"),
        reach("red", "starts of bleu"),
        time_limit(2, winner="bleu"),
        capture_flag({"bleu": 3, "red": 4}),
        capture_flag({"red": 4}, territory={1: "bleu"}),
        tag("red", "blue", territory={1: "red", 2: "bleu"}),
        territory.published({1: "bleu"}),
    ],
    ids=repr,
)
def test_a_misspelt_team_is_refused_also_with_rules_of_the_user(game, rule):
    game.add(lambda ctx: None)
    game.add(rule)
    with pytest.raises(UnknownName, match=r"Unknown team 'bleu'\. Did you mean 'blue'\?"):
        game.run(3)


def test_flags_and_nodes_may_have_other_owners_than_teams(game, heard):
    game.add(territory.published({1: "neutral", 2: None}))
    game.add(capture_flag({"neutral": 3, "red": 4}, territory={1: "the sea", 2: "blue"}))
    game.run(2)
    assert heard == []


RULES_WITH_A_WINNER = [partial(time_limit, 2), partial(none_left, "red"), partial(reach, "red", 3)]


def test_these_are_all_rules_with_a_winner():
    rules = map(partial(getattr, gamms.rules), gamms.rules.__all__)
    functions = [rule for rule in rules if inspect.isfunction(rule)]
    have_one = {rule for rule in functions if "winner" in inspect.signature(rule).parameters}
    assert have_one == {rule.func for rule in RULES_WITH_A_WINNER}


@pytest.mark.parametrize("rule", RULES_WITH_A_WINNER, ids=lambda rule: rule.func.__name__)
def test_a_rule_may_say_that_no_team_wins(game, heard, rule):
    game.add(tag("blue", "red"))
    game.add(rule(winner=None))
    assert game.run(max_turns=5).winner is None
    assert heard == []


@pytest.mark.parametrize("rule", RULES_WITH_A_WINNER, ids=lambda rule: rule.func.__name__)
def test_a_winner_must_be_a_valid_team(rule):
    with pytest.raises(BadType, match="winner must be a value such as"):
        rule(winner=["blue"])


def test_a_misspelt_winner_of_a_rule_of_the_user_is_warned_about(game, heard):
    game.add(lambda ctx: ctx.game.end("over", winner="bleu"))
    game.run()
    assert heard == ["The winner 'bleu' is no team and no agent. Did you mean 'blue'?"]


def test_a_rule_that_is_added_later_is_checked_in_the_next_turn(game):
    game.run(1)
    game.add(reach("green", 3))
    with pytest.raises(UnknownName, match="Unknown team 'green'"):
        game.run(1)
    assert game.turn == 1


def test_a_rule_that_was_removed_before_a_turn_is_not_checked(game, heard):
    game.add(reach("green", 3))
    game.remove("reach")
    game.run(1)
    assert heard == []


def test_sides_that_are_functions_and_teams_that_are_there_are_allowed(game, heard):
    game.add(tag(lambda agent: agent.name == "ann", "blue"))
    game.add(reach({"red": 7, "blue": 8}))
    game.run(2)
    assert heard == []


def test_teams_of_any_kind_are_told_how_they_may_come_later(ctx):
    ctx.agent.create_agent("ann", start_node_id=0, team=1, strategy=stay)
    ctx.game.add(tag(1, 2))
    with pytest.raises(UnknownName, match="if its agents come later, create one of them before"):
        ctx.game.step()


def test_annotations_say_which_parameters_name_teams():
    assert find_team_parameters(tag) == {"taggers": TEAMS, "tagged": TEAMS}
    assert find_team_parameters(reach) == {"team": TEAMS, "winner": TEAMS}
    assert find_team_parameters(capture_flag) == {"flags": OWNERS, "teams": TEAMS}
    assert find_team_parameters(time_limit) == {"winner": TEAMS}
    assert find_team_parameters(last_team) == {}
