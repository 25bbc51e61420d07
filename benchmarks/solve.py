"""Values of games: by value iteration and the double oracle of GAMMS, beside brute force and algorithms of OpenSpiel.

    python benchmarks/solve.py            # small games, by all; OpenSpiel where it is installed
    python benchmarks/solve.py large      # up to as many states as memory allows
    python benchmarks/solve.py large --sides 10 20

One pursuer and one evader on a square grid, who move at once; a point for a catch. Each scenario is solved by
`gamms.solve.solve` and `double_oracle`; small ones, as games of OpenSpiel, also by its CFR+, and by the matrix that
OpenSpiel makes of them with a linear program of SciPy. Large ones are solved once; brute force, a program of its own
without GAMMS, solves small ones of the same kind. Times are those of the CPU.
"""

import argparse
import functools
import resource
import time

import numpy as np
from scipy.optimize import linprog

from gamms.scenario import Scenario
from gamms.solve import double_oracle, openspiel, solve
from gamms.solve.solution import find_rewards, make_setup
from gamms.solve.stages import ValueIteration
from gamms.solve.table import explore

CASES = ((2, 1), (2, 2), (2, 4), (3, 4), (5, 10))  # side of the grid, turns
SIDES = (6, 10, 14, 20, 28)  # of large grids
_BRUTE = ((2, 2), (2, 4), (3, 4), (4, 5))
_ORACLES = CASES[:2]  # best responses search behaviour strategies of whole games: minutes with four turns
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
    from open_spiel.python.algorithms import cfr, expected_game_score, exploitability

    solver = cfr.CFRPlusSolver(game)
    for _ in range(_ITERATIONS):
        solver.evaluate_and_update_policy()
    average = solver.average_policy()
    values = expected_game_score.policy_value(game.new_initial_state(), [average, average])
    return values[0], exploitability.exploitability(game, average)


def value_of(payoffs):
    """Return the value of a matrix game by a linear program."""
    rows, columns = np.shape(payoffs)
    answer = linprog(
        np.r_[np.zeros(rows), -1.0],
        A_ub=np.c_[-np.transpose(payoffs), np.ones(columns)],
        b_ub=np.zeros(columns),
        A_eq=[np.r_[np.ones(rows), 0.0]],
        b_eq=[1.0],
        bounds=[(0, None)] * rows + [(None, None)],
    )
    return -answer.fun


def by_brute_force(side, turns):
    """Return how probably a pursuer catches an evader in so many turns: recursion over all that both may do."""

    def ways(node):
        y, x = divmod(node, side)
        near = [(y, x), (y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
        return [row * side + column for row, column in near if 0 <= row < side and 0 <= column < side]

    @functools.cache
    def value(cop, robber, left):
        if not left:
            return 0.0

        def gain(to, fled):
            return 1.0 if fled in ways(to) else value(to, fled, left - 1)

        return value_of([[gain(to, fled) for fled in ways(robber)] for to in ways(cop)])

    return value(side * side - 1, 0, turns)


def small():
    """Solve small games by all."""
    try:
        import pyspiel
    except ImportError:
        pyspiel = None
        print("OpenSpiel is not installed: without it.")
    for side, turns in CASES:
        scenario, case = chased(side, turns), (side, turns)
        solution, seconds = timed(lambda one=scenario: solve(one))
        line = f"{side} x {side}, {turns} turns, {len(solution.table)} states: {solution.value:.9f} in {seconds:.2f} s"
        if case in _ORACLES:
            oracle, seconds = timed(lambda one=scenario: double_oracle(one))
            line += f"; double_oracle {oracle.value:.9f} in {seconds:.2f} s"
        game = pyspiel.convert_to_turn_based(openspiel(scenario)) if pyspiel and case in _CFR else None
        if game:
            (value, gain), seconds = timed(lambda one=game: of_cfr(one))
            line += f"; CFR+ {value:.4f}, exploitability {gain:.4f}, in {seconds:.1f} s"
        if game and case in _MATRICES:
            payoffs = pyspiel.extensive_to_matrix_game(game).row_utilities()
            exact, seconds = timed(lambda one=payoffs: value_of(one))
            line += f"; matrix of OpenSpiel {exact:.9f} in {seconds:.2f} s"
        print(line, flush=True)


def large(sides):
    """Solve games on larger grids, after small ones that brute force solves, too."""
    for side, turns in _BRUTE:
        found, exact = solve(chased(side, turns)).value, by_brute_force(side, turns)
        print(f"{side} x {side}, {turns} turns: {found:.9f}, {abs(found - exact):.1e} from brute force", flush=True)
    for side in sides:
        setup = make_setup(
            chased(side, 2 * side), ("cops", "robbers"), {}, turns=None, seed=None, max_states=2 * side**4
        )
        table, exploring = timed(lambda one=setup: explore(one, by_winner=False))
        rewards = find_rewards(table, "score", 1.0, "cops")
        stages, solving = timed(lambda one=table, gains=rewards: ValueIteration(one, gains, 1e-9))
        sweeps = len(stages.values) - 1
        actions, memory = len(table.usual.after), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        print(
            f"{side} x {side}, {2 * side} turns: {len(table)} states, {actions} joint actions; explored in "
            f"{exploring:.1f} s, {1e6 * exploring / actions:.1f} us each; {sweeps} sweeps of "
            f"{1e3 * solving / sweeps:.0f} ms, {len(table) * sweeps / solving:.0f} states a second; value "
            f"{stages.values[-1][0]:.6f}; {memory / 1024:.0f} MB at most",
            flush=True,
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", choices=["small", "large"], nargs="?", default="small")
    parser.add_argument("--sides", type=int, nargs="+", default=SIDES, help="of large grids")
    given = parser.parse_args()
    if given.case == "small":
        small()
    else:
        large(given.sides)
