"""Child processes that end when their parent process ends, even by a crash."""

import ctypes
import os
import sys
from typing import Any

_SET_DEATH_SIGNAL = 1  # of prctl; SIGKILL
_KILL = 9
_LIBC: Any = ctypes.CDLL(None) if sys.platform == "linux" else None  # loaded here, for a forked child must not load


def die_with_parent(parent: int) -> None:
    """Have this process killed when the one that started it ends; does nothing on systems other than Linux.

    Linux means the thread that started it, which therefore has to live as long.

    Args:
        parent: the id of that process; if it has ended already, this process exits.
    """
    if _LIBC is not None:
        _LIBC.prctl(_SET_DEATH_SIGNAL, _KILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)
