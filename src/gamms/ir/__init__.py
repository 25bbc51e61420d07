"""Data that flows between rooms: columns and values, no behaviour beyond reading them.

Read `graph.py` first. May import: numpy, `gamms.errors`, `gamms.arguments`. Nothing here knows a Context.
"""
