"""Data that engines share: columns of graphs and agents, the state of a game, events, draw commands, packed bytes.

Read `graph.py` first, then `agents.py` and `events.py`. Each object changes only through its own methods, and none
knows the context. May import: numpy, and modules next to this package, for example `gamms.errors`, `gamms.plain` and
`gamms.limits`.
"""
