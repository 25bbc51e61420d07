"""Array rules and array strategies: functions over arrays (games, agents), also called in games that are played alone.

`declarations.py` declares them and calls them in single games. A rule gets a turn (`turn.py`), a strategy or an
observer a view (`view.py`). `aims.py` finds actions that lead to nodes, and `given.py` takes actions from outside.
"""
