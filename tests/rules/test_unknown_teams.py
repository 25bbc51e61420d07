import inspect
from functools import partial

import pytest

import gamms
from gamms.errors import BadType
from gamms.rules import capture_flag, last_team, none_left, reach, tag, time_limit
from gamms.strategies import stay
from gamms.typing.game import OWNERS, TEAMS, team_parameters


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


def test_a_team_without_agents_is_warned_about_at_the_first_turn_and_once(game, heard):
    game.add(tag("bleu", "red"))
    assert heard == []
    game.run(3)
    game.reset()
    game.run(1)
    assert heard == ["tag: Unknown team 'bleu'. Did you mean 'blue'? No agent plays for it."]


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
def test_a_misspelt_winner_is_warned_about(game, heard, rule):
    with pytest.raises(BadType, match="winner must be a value such as"):
        rule(winner=["blue"])
    game.add(rule(winner="bleu"))
    game.run(max_turns=2)
    said = f"{rule.func.__name__}: Unknown team 'bleu'. Did you mean 'blue'? No agent plays for it."
    assert heard[:1] == [said]


def test_a_misspelt_winner_is_warned_about_when_it_wins(game, heard):
    game.add(time_limit(2, winner="bleu"))
    game.run()
    assert heard == [
        "time_limit: Unknown team 'bleu'. Did you mean 'blue'? No agent plays for it.",
        "The winner 'bleu' is no team and no agent. Did you mean 'blue'?",
    ]


def test_a_rule_that_is_added_later_is_looked_at_when_it_begins(game, heard):
    game.run(1)
    game.add(reach("green", 3))
    game.run(1)
    assert heard == ["reach: Unknown team 'green'. There are: 'blue', 'red'. No agent plays for it."]


def test_a_rule_that_was_removed_before_a_turn_is_not_looked_at(game, heard):
    game.add(reach("green", 3))
    game.remove("reach")
    game.run(1)
    assert heard == []


def test_sides_that_are_functions_and_teams_that_are_there_are_not_warned_about(game, heard):
    game.add(tag(lambda agent: agent.name == "ann", "blue"))
    game.add(reach({"red": 7, "blue": 8}))
    game.run(2)
    assert heard == []


def test_annotations_say_which_parameters_name_teams():
    assert team_parameters(tag) == {"taggers": TEAMS, "tagged": TEAMS}
    assert team_parameters(reach) == {"team": TEAMS, "winner": TEAMS}
    assert team_parameters(capture_flag) == {"flags": OWNERS}
    assert team_parameters(time_limit) == {"winner": TEAMS}
    assert team_parameters(last_team) == {}
