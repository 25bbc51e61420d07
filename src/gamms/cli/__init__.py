"""The command line: `gamms`.

Read `commands.py` first: all commands in the order of the help, each with its examples. `play.py` has those that play a
game, `recordings.py` those that take a recording; `output.py` is what they share: printing, errors, tables, files.
May import: everything, but what a command needs of GAMMS besides these, when it runs: `gamms --help` loads little. To
add a command, write a function and list it in `commands.py`.
"""

import signal
import sys
from types import FrameType
from typing import Any


def main() -> None:
    """Run the command line; Ctrl-C ends it with exit code 130, as SIGTERM and a closed terminal do."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # not where `nohup` ignores it
            signal.signal(number, _end)
    try:
        from gamms.cli.commands import run  # which takes a while, and may be interrupted, too

        run()
    except KeyboardInterrupt:
        if sys.stderr is not None:
            sys.stderr.write("gamms: Interrupted.\n")
        sys.exit(130)  # as shells say it of Ctrl-C
    finally:
        # `python -m` ends by the signal itself if Ctrl-C came while a text was run as code, until another one is run.
        exec("")  # noqa: S102


def _end(_number: int, _frame: FrameType | None) -> None:
    """End like Ctrl-C, for which what may not be interrupted is written to its end first."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a shell
        signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.raise_signal(signal.SIGINT)


def __getattr__(name: str) -> Any:  # Any: `app`
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from gamms.cli.commands import app

    return app
