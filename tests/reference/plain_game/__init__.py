"""The specification of a game: a plain simulator of what the documentation says, independent of the library's engine.

It plays scenarios of a subset, one turn at a time, by dicts, lists and fractions: exact, and slow. What is not in the
subset is refused by its name. `simulator.py` is the turn of docs/game.md, and the file to read first. `moves.py` says
where agents may go and when they are where, `conflicts.py` who has to stay, `contacts.py` who meets whom, `rules.py`
what follows, `sensors.py` who sees whom, `channels.py` who hears what; `streets.py` is the map, and `draws.py` all
chance. It imports nothing of the library.
"""
