"""Values of small games: by value iteration and the double oracle of GAMMS, beside algorithms of OpenSpiel.

    python benchmarks/solve.py

One pursuer and one evader on a square grid, who move at once; a point for a catch. Each scenario is solved by
`gamms.solve.solve` and `double_oracle`; small ones, as games of OpenSpiel, also by its CFR+, and by the matrix that
OpenSpiel makes of them with a linear program of SciPy. Times are those of the CPU.
"""

import time

import numpy as np
import pyspiel
from open_spiel.python.algorithms import cfr, expected_game_score, exploitability
from scipy.optimize import linprog

from gamms.scenario import Scenario
from gamms.solve import double_oracle, openspiel, solve

CASES = ((2, 1), (2, 2), (2, 4), (3, 4), (5, 10))  # side of the grid, turns
_ORACLES = CASES[:3]
_CFR = CASES[:2]  # OpenSpiel plays all histories, of which there are 100 times as many with each further turn
_MATRICES = CASES[:1]
_ITERATIONS = 200


def chased(side, turns):
    """A game of an evader that begins in a corner, and of a pursuer in the opposite one, who see each other."""
    return Scenario(
        seed=1,
        max_turns=turns,
        map={"grid": {"width": side, "height": side}},
        sensors={"eyes": {"type": "AGENT"}},
        teams={
            "cops": {"agents": [{"name": "cop", "node": side * side - 1}], "sensors": ["eyes"]},
            "robbers": {"agents": [{"name": "robber", "node": 0}], "sensors": ["eyes"]},
        },
        rules=[
            {"rule": "tag", "with": {"taggers": "cops", "tagged": "robbers", "hops": 1, "then": "eliminate"}},
            "last_team",
        ],
    )


def timed(what):
    """Return what a function gives, and the seconds of CPU that it took."""
    began = time.process_time()
    found = what()
    return found, time.process_time() - began


def of_cfr(game):
    """Return the value of the average strategies of CFR+, and what they can be exploited by."""
    solver = cfr.CFRPlusSolver(game)
    for _ in range(_ITERATIONS):
        solver.evaluate_and_update_policy()
    average = solver.average_policy()
    values = expected_game_score.policy_value(game.new_initial_state(), [average, average])
    return values[0], exploitability.exploitability(game, average)


def of_matrix(game):
    """Return the value of the matrix that OpenSpiel makes of a game, by a linear program."""
    payoffs = np.array(pyspiel.extensive_to_matrix_game(game).row_utilities())
    rows, columns = payoffs.shape
    answer = linprog(
        np.r_[np.zeros(rows), -1.0],
        A_ub=np.c_[-payoffs.T, np.ones(columns)],
        b_ub=np.zeros(columns),
        A_eq=[np.r_[np.ones(rows), 0.0]],
        b_eq=[1.0],
        bounds=[(0, None)] * rows + [(None, None)],
    )
    return -answer.fun


if __name__ == "__main__":
    for side, turns in CASES:
        scenario, case = chased(side, turns), (side, turns)
        solution, seconds = timed(lambda one=scenario: solve(one))
        line = f"{side} x {side}, {turns} turns, {len(solution.table)} states: {solution.value:.9f} in {seconds:.2f} s"
        if case in _ORACLES:
            oracle, seconds = timed(lambda one=scenario: double_oracle(one))
            line += f"; double_oracle {oracle.value:.9f} in {seconds:.2f} s"
        game = pyspiel.convert_to_turn_based(openspiel(scenario)) if case in _CFR else None
        if case in _CFR:
            (value, gain), seconds = timed(lambda one=game: of_cfr(one))
            line += f"; CFR+ {value:.4f}, exploitability {gain:.4f}, in {seconds:.1f} s"
        if case in _MATRICES:
            exact, seconds = timed(lambda one=game: of_matrix(one))
            line += f"; matrix of OpenSpiel {exact:.9f} in {seconds:.2f} s"
        print(line, flush=True)
