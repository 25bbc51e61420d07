"""OpenSpiel solves a game of two teams by CFR+, and ranks strategies by payoffs that a population has played.

    python examples/rl/with_openspiel.py     # half a minute

docs/howto/openspiel.md explains the program.
"""

import sys

import pyspiel
from catch import SCENARIO
from open_spiel.python.algorithms import cfr, exploitability
from open_spiel.python.algorithms.expected_game_score import policy_value
from open_spiel.python.egt import alpharank

from gamms import rl, solve
from gamms.scenario import Scenario
from gamms.strategies import chase, flee, random_walk, stay

DUEL = Scenario(
    map={"grid": {"rows": 2, "columns": 3}},
    max_turns=3,
    sensors={"eyes": {"type": "AGENT"}},
    teams={
        "taggers": {"agents": [{"name": "ann", "node": 0}], "sensors": ["eyes"]},
        "runners": {"agents": [{"name": "bob", "node": 5}], "sensors": ["eyes"]},
    },
    rules=[
        {"rule": "tag", "with": {"taggers": "taggers", "tagged": "runners", "hops": 1, "then": "eliminate"}},
        "last_team",
    ],
)


def run_cfr(iterations):
    """Print how far the average policies of CFR+ are from an equilibrium, and what they are worth."""
    game = pyspiel.convert_to_turn_based(solve.openspiel(DUEL, reward="win"))
    solver = cfr.CFRPlusSolver(game)
    for iteration in range(1, iterations + 1):
        solver.evaluate_and_update_policy()
        if iteration in (1, 10, iterations):
            gap = exploitability.exploitability(game, solver.average_policy())
            print(f"CFR+, iteration {iteration}: exploitability {gap:.3f}")
    value, _ = policy_value(game.new_initial_state(), [solver.average_policy()] * 2)
    exact = solve.solve(DUEL, team="taggers", reward="win").value
    print(f"value for the taggers: {value:.3f} by CFR+, {exact:.3f} exactly")


def rank(games):
    """Let alpha-rank order the strategies of both teams by their payoffs against each other."""
    strategies = {"taggers": [stay, random_walk, chase], "runners": [stay, random_walk, flee]}
    wins = rl.Population(SCENARIO, strategies, metric="wins.taggers", games=games).payoffs
    shares = alpharank.compute([wins, 1 - wins], alpha=1)[2].reshape(wins.shape)
    print("wins of the taggers:", wins.round(2).tolist())
    print("alpha-rank:", {team: shares.sum(axis=1 - axis).round(2).tolist() for axis, team in enumerate(strategies)})


if __name__ == "__main__":
    run_cfr(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
    rank(games=200)
