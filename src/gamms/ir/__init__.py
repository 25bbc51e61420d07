"""Data that engines share: columns of graphs and agents, the state of a game, events, draw commands, packed bytes.

Read `graph.py` first, then `agents.py` and `events.py`. Each changes only by its own verbs, and knows no context.
May import: numpy, and the modules beside this package, such as `gamms.errors`, `gamms.plain` and `gamms.limits`.
"""
