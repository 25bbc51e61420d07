"""Final sizes of Reed-Frost epidemics: in each turn, each ill person infects each healthy one with equal chance.

The mean is computed by recursion over the numbers of healthy and ill people, whose new cases are binomial (Abbey, An
examination of the Reed-Frost theory of epidemics, Human Biology 24, 1952). Games draw for each person, who is ill for
one turn and then immune.
"""

from functools import cache
from math import comb
from pathlib import Path

from gamms import experiment
from gamms.scenario import Scenario

PEOPLE, CHANCES = 12, (0.05, 0.1, 0.2)


def infect(ctx, chance):
    """Infect healthy people, who are the living agents; the first ill person is not among them."""
    healthy = ctx.game.agents
    draws = ctx.stream("infection", ctx.game.turn).random(len(healthy))
    ill = ctx.game.data.get("ill", 1)
    cases = [person for person, draw in zip(healthy, draws, strict=True) if draw > (1.0 - chance) ** ill]
    for person in cases:
        ctx.game.eliminate(person)
    ctx.game.data["ill"] = len(cases)
    ctx.game.scores["people"] += len(cases)
    if not cases:
        ctx.game.end("the epidemic is over")


@cache
def find_mean(healthy, ill, chance):
    """Return the expected number of people who fall ill later."""
    stays = (1.0 - chance) ** ill
    mean = 0.0
    for cases in range(1, healthy + 1):
        share = comb(healthy, cases) * (1.0 - stays) ** cases * stays ** (healthy - cases)
        mean += share * (cases + find_mean(healthy - cases, cases, chance))
    return mean


if __name__ == "__main__":
    teams = {"people": {"count": PEOPLE, "strategy": "gamms.strategies:stay"}}
    rule = {"rule": "reed_frost:infect", "with": {"chance": 0.1}}
    town = Scenario(folder=Path(__file__).parent, map={"grid": {"rows": 3, "columns": 4}}, teams=teams, rules=[rule])
    played = experiment.run(town, range(300), {"rules.infect.with.chance": CHANCES})
    means = played.summary(metrics=["score.people"], confidence=0.99)
    rows = []
    for chance, ours, low, high in zip(CHANCES, means["mean"], means["low"], means["high"], strict=True):
        expected = find_mean(PEOPLE, 1, chance)
        rows.append({"result": f"mean final size of {PEOPLE} people, chance {chance}", "expected": expected})
        rows[-1] |= {"ours": ours, "low": low, "high": high, "agrees": low <= expected <= high}
    print(experiment.Table.of(rows))
