"""Values of small games: what a pursuit or a reach-avoid game is worth, and how to play it best.

    solution = gamms.solve.solve(gamms.scenario.load("pursuit.yaml"))
    print(solution.value, solution.bound)
    scenario.play(strategies={"red": solution.strategy("red")})

`worlds.py` plays a turn from any state by the scenario's own rules; read it first. `table.py` finds all states,
`stages.py` iterates values over them, `solution.py` has what users call, `information.py` says what sensors show of
states. A client of scenarios and batches: May import: `planning`, `rl` and below.
"""

from gamms.solve.solution import Choice, Solution, SolvedStrategy, solve
from gamms.solve.table import Transition

__all__ = ["Choice", "Solution", "SolvedStrategy", "Transition", "solve"]
