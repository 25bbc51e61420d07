"""A block of games: the state of many games in columns, and how the core plays them.

`state.py` holds the state, `columns.py` its agents and logs, `scores.py` the scores, and `initial_state.py` the state
of the first turn. `in_core.py`, `strategy_steps.py` and `travelers.py` build what the core plays with. `sensing.py`
finds the agents and nodes that sensors show, `vectors.py` makes observations numbers, and `channels.py` checks
messages.
"""
