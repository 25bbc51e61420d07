"""Solve small games: the value of a pursuit or reach-avoid game, and optimal strategies.

    solution = gamms.solve.solve(gamms.scenario.load("pursuit.yaml"))
    print(solution.value, solution.bound)
    scenario.play(strategies={"red": solution.strategy("red")})

`worlds.py` plays a turn from any state by the scenario's own rules; read it first. `table.py` finds all states,
`stages.py` iterates values over them, `solution.py` wraps both for users, and `information.py` computes what sensors
show in each state. `pursuit.py` solves pursuits in turns with full sight, on much larger maps. `responses.py` has
`solve` and best responses to strategies of any kind, `teams_game.py` the game for OpenSpiel, and `mixtures.py` matrix
games of strategies, the double oracle, and best responses to pools.
A client of scenarios, batches, planning and learning: May import: `planning`, `rl` and below. To add a method of best
responses, add it to `responses.py`.
"""

from gamms.errors import suggest_names as _suggest_names
from gamms.solve.mixtures import DoubleOracle, MatrixGame, double_oracle, matrix_game
from gamms.solve.pursuit import (
    PursuitSolution,
    PursuitStrategy,
    cop_number,
    exact_evader,
    exact_pursuers,
    pursuit,
)
from gamms.solve.responses import (
    Evaluation,
    Response,
    best_response,
    evaluate,
    exploitability,
    nash_conv,
    openspiel,
    solve,
)
from gamms.solve.solution import Choice, Solution, SolvedStrategy, TableSolution
from gamms.solve.table import Transition

__all__ = [
    "Choice",
    "DoubleOracle",
    "Evaluation",
    "MatrixGame",
    "PursuitSolution",
    "PursuitStrategy",
    "Response",
    "Solution",
    "SolvedStrategy",
    "TableSolution",
    "Transition",
    "best_response",
    "cop_number",
    "double_oracle",
    "evaluate",
    "exact_evader",
    "exact_pursuers",
    "exploitability",
    "matrix_game",
    "nash_conv",
    "openspiel",
    "pursuit",
    "solve",
]

FOR_SCENARIOS = {"exact_evader": exact_evader, "exact_pursuers": exact_pursuers}  # strategies that a file may name

_suggest_names(__name__, __all__)
