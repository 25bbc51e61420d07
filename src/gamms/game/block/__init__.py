"""A block of games: the state of many games in columns, and how the core plays them.

`state.py` holds the state with scores and events, `columns.py` the agents, and `initial_state.py` the state of the
first turn. `in_core.py`, `strategy_steps.py` and `travelers.py` build what the core plays with. `sensing.py` finds the
agents and nodes that sensors show, and `vectors.py` makes observations numbers.
"""
