"""A function of GAMMS in the place of another kind of function is refused before anything is played."""

import pytest

from gamms.scenario import Scenario, ScenarioError
from gamms.scenario.code import OFFERED, find_first_parameter, list_offered_functions
from gamms.scenario.validation import find_kind

TEAMS = {"red": {"count": 1}, "blue": {"count": 1}}


def game(**more):
    return Scenario(**{"map": {"grid": {"width": 3, "height": 2}}, "teams": TEAMS, "max_turns": 1, **more})


def red(**more):
    return game(teams={**TEAMS, "red": {"count": 1, **more}})


def goto(target):
    return red(strategy={"function": "gamms.strategies:goto", "with": {"target": target}})


def tag(**given):
    return game(rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", **given}}])


STRATEGY = {"function": "gamms.strategies:goto", "with": {"target": 1}}
WRONG = {
    "a resolver as a rule": (
        game(rules=["at_random"]),
        r"at_random is a resolver of conflicts, and a rule belongs here\. It belongs into conflicts\.resolve",
    ),
    "a class as a rule": (game(rules=["Contest"]), "Contest is no such function, and a rule belongs here"),
    "a strategy as a rule": (game(rules=["gamms.strategies:stay"]), "stay is a strategy, and a rule belongs here"),
    "a rule as a strategy": (red(strategy="gamms.rules:last_team"), "last_team is a rule, and a strategy belongs here"),
    "a strategy as a plan": (red(plan="gamms.strategies:stay"), "stay is a strategy, and a plan belongs here"),
    "a resolver by its module": (
        game(conflicts={"resolve": "gamms.rules:at_random"}),
        "at_random makes a resolver of conflicts, but is not one itself. Write by_priority, at_random, nobody",
    ),
    "a strategy as a resolver": (game(conflicts={"resolve": "gamms.strategies:stay"}), "stay is a strategy"),
    "a strategy as a sensor": (
        game(sensors={"eyes": {"function": "gamms.strategies:stay"}}),
        "stay is a strategy, and the function of a sensor belongs here",
    ),
    "a strategy as a target": (goto(STRATEGY), r"with\.target: goto is a strategy, and the parameter takes none"),
    "a strategy as a side": (tag(tagged=STRATEGY), r"with\.tagged: goto is a strategy, and the parameter"),
    "a rule as another strategy": (
        red(
            strategy={
                "function": "gamms.strategies:chase",
                "with": {"otherwise": {"function": "gamms.rules:last_team"}},
            }
        ),
        r"with\.otherwise: last_team is a rule",
    ),
}


@pytest.mark.parametrize(("wrong", "message"), WRONG.values(), ids=WRONG)
def test_a_function_of_another_kind_is_refused_by_check(wrong, message):
    with pytest.raises(ScenarioError, match=message):
        wrong.check()


RIGHT = {
    "another strategy": red(strategy={"function": "gamms.strategies:chase", "with": {"otherwise": STRATEGY}}),
    "strategies in a mix": red(
        strategy={"function": "gamms.strategies:mix", "with": {"p": 0.5, "a": STRATEGY, "b": STRATEGY}}
    ),
    "a plan of a search": red(plan={"function": "gamms.planning:mcts", "with": {"iterations": 2}}),
    "a strategy as a policy": red(strategy={"function": "gamms.planning:mcts", "with": {"rollout": STRATEGY}}),
    "a rule that scores": tag(score=1),
}


@pytest.mark.parametrize("right", RIGHT.values(), ids=RIGHT)
def test_a_function_of_the_right_kind_is_played(right):
    right.check()
    right.play(1)


def test_all_that_is_offered_has_a_kind():
    """Strategies and rules that get another annotation would be refused where they belong."""
    kinds = {
        name: find_kind(one, find_first_parameter(one))
        for module in OFFERED
        for name, one in list_offered_functions(module).items()
    }
    others = {name for name, kind in kinds.items() if kind is None}
    assert others == {
        "Conflicts",
        "Contact",
        "Contest",
        "contacts",
        "idleness_table",
        "one_to_one",
        "by_distance",
        "halves",
        "closeness",
        "district",
    }
    resolvers = {name for name, kind in kinds.items() if kind == "resolver"}
    assert resolvers == {"at_random", "by_priority", "by_rank", "nobody"}
    assert {kinds[name] for name in list_offered_functions("gamms.strategies")} == {"strategy", "team strategy"}
