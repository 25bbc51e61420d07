"""The command line: `gamms`.

Read `commands.py` first: all commands in the order of the help, each with its examples. `play.py` has those that play a
game, `recordings.py` those that take a recording; `output.py` is what they share: printing, errors, tables, files.
May import: everything. To add a command, write a function and list it in `commands.py`.
"""

from gamms.cli.commands import app, main

__all__ = ["app", "main"]
