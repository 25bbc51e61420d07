"""Control groups of Linux, by which the kernel bounds the memory and the threads of a launcher and its children.

Only some users may make groups, so these bounds come on top of those in `confinement.py`; where no group can be made,
that is no error. Versions 1 and 2 are both known. A group is made in the one that this process is in, or beside it.
"""

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_PREFIX = "gamms-"  # of the name of a group, before the id of its launcher
_MEMBERS = "cgroup.procs"
_COUNTERS = ("memory.events", "memory.oom_control")  # where versions 2 and 1 count the processes that were killed


class ControlGroups:
    """Groups with bounds, which this process makes and joins; its later children are in them as well.

    Memory that the process took before does not count.

    Args:
        memory_bytes: of all processes in the groups together.
        threads: likewise.
    """

    def __init__(self, memory_bytes: int, threads: int) -> None:
        self._joined = list[Path]()
        self._killed = 0
        limits = {
            "memory.max": memory_bytes,
            "memory.swap.max": 0,
            "memory.limit_in_bytes": memory_bytes,
            "memory.memsw.limit_in_bytes": memory_bytes,
            "pids.max": threads,
        }
        wanted = {"memory", "pids"}
        for parent in list(_parents()):
            group = parent / f"{_PREFIX}{os.getpid()}"
            with suppress(OSError):
                group.mkdir()
                offered = {name: value for name, value in limits.items() if (group / name).exists()}
                bounded = wanted & {name.partition(".")[0] for name in offered}
                for name, value in offered.items():
                    (group / name).write_text(str(value))
                if bounded:
                    (group / _MEMBERS).write_text("0")
                    self._joined.append(group)
                    wanted -= bounded

    def has_killed(self) -> bool:
        """Return whether the kernel has ended a process because the memory was full, since the last call."""
        before, self._killed = self._killed, 0
        for group in self._joined:
            for name in _COUNTERS:
                with suppress(OSError):
                    found = re.search(r"^oom_kill (\d+)$", (group / name).read_text(), re.MULTILINE)
                    self._killed += int(found[1]) if found else 0
        return self._killed > before


def remove_empty() -> None:
    """Remove the groups of launchers that have ended."""
    for parent in _parents():
        for group in parent.glob(f"{_PREFIX}*"):
            if not Path("/proc", group.name.removeprefix(_PREFIX)).exists():
                with suppress(OSError):
                    group.rmdir()


def _parents() -> Iterator[Path]:
    """Yield the groups in which this process may be able to make groups: its own, and in version 2 the one above."""
    try:
        memberships = Path("/proc/self/cgroup").read_text().splitlines()
        mounts = Path("/proc/self/mountinfo").read_text().splitlines()
    except OSError:  # not on this system
        return
    own: dict[str, str] = {}
    for line in memberships:
        _, controllers, path = line.split(":", 2)
        own |= dict.fromkeys(controllers.split(","), path)
    for line in mounts:
        place, _, filesystem = line.partition(" - ")
        root, mount = place.split()[3:5]
        kind, _, options = filesystem.split()[:3]
        offered = [""] if kind == "cgroup2" else sorted({"memory", "pids"} & set(options.split(",")))
        if kind not in ("cgroup", "cgroup2") or not offered or offered[0] not in own:
            continue
        path = own[offered[0]].removeprefix(root if root != "/" else "").strip("/")
        yield Path(mount, path)
        if kind == "cgroup2" and path:
            yield Path(mount, path).parent
