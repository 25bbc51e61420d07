"""Movement: the legal nodes of agents, and the results of their actions, in one game and in a block of games.

Both use the core. `arrivals.py` has the columns of games whose agents decide where they arrive. For one game,
`legality.py` checks actions and finds the moves that they lead to, `travel.py` those by metres, and `moves.py` holds
the moves of a turn. For a block of games, `legal_moves.py` finds legal moves, `courses.py` has the paths of the last
turn, and `roads.py` closed roads. `streets.py` and `routes.py` have the map and distances.
"""
