"""The command line: `gamms`.

Read `commands.py` first: all commands in the order of the help, each with its examples. `play.py` has the commands that
play a game, `recordings.py` those for recordings; `output.py` is shared: printing, errors, tables, files.
May import: everything, but at run time only the parts of GAMMS that a command needs: `gamms --help` loads little. To
add a command, write a function and list it in `commands.py`.
"""

import gc
import signal
import sys
from types import FrameType
from typing import Any


def main() -> None:
    """Run the command line; Ctrl-C, SIGTERM and a closed terminal end it with exit code 130."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # not where `nohup` ignores it
            signal.signal(number, _end)
    try:
        from gamms.cli.commands import run  # takes a while, and may be interrupted, too

        run()
    except KeyboardInterrupt:
        if sys.stderr is not None:
            sys.stderr.write("gamms: Interrupted.\n")
        sys.exit(130)  # the exit code of Ctrl-C in shells
    finally:
        gc.freeze()  # or Python would look through all modules for garbage when it ends: a fifth of a short command
        # After Ctrl-C within code run from a text, `python -m` would end by the signal, unless another text is run.
        exec("")  # noqa: S102


def _end(_number: int, _frame: FrameType | None) -> None:
    """End like Ctrl-C, which first completes writes that must not be interrupted."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a shell
        signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.raise_signal(signal.SIGINT)


def __getattr__(name: str) -> Any:  # Any: `app`
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from gamms.cli.commands import app

    return app
