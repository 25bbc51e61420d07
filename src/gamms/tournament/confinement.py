"""Confine a process to the resources of an entry: bounded memory, time and files, no network, no other process.

Called in a fresh child before it runs any code of an entry; it cannot be undone. Resource limits are those of POSIX.
On Linux, Landlock bounds which files can be opened, and a filter of system calls (seccomp) forbids the rest. Neither
needs privileges, so both work for any user and in containers. Limits that the system cannot enforce are returned as
texts. Where the user may make control groups (version 1 or 2), these bound the memory and threads of all processes of
an entry together; otherwise these bounds are left out without an error.
"""

import ctypes
import os
import platform
import re
import struct
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from gamms.tournament.system_calls import MACHINES, filter_for

LONGEST_FILE = 1 << 24  # bytes


class ProcessLimits(NamedTuple):
    """Resources that a process may use.

    Attributes:
        memory_bytes: bytes of private memory.
        cpu_s: seconds of processor time, of all its threads together.
        file_bytes: the longest file that it may write, in bytes.
        open_files: the number of files open at the same time.
    """

    memory_bytes: int
    cpu_s: int
    file_bytes: int = LONGEST_FILE
    open_files: int = 128


# -- constants of Linux -----------------------------------------------------------------------------------------

_DROP_FROM_BOUNDS = 24  # options of prctl
_SET_SECCOMP = 22
_NO_NEW_PRIVILEGES = 38
_MOST_CAPABILITIES = 64
_CAPABILITIES_VERSION = 0x20080522
_CREATE_RULESET = 444  # system calls of Landlock, on all architectures
_ADD_RULE = 445
_RESTRICT = 446

_EXECUTE = 1
_WRITE = 1 << 1
_READ = 1 << 2
_LIST = 1 << 3
_TRUNCATE = 1 << 14
_CONTROL = 1 << 15
_REMOVE_FOLDER = 1 << 4
_REMOVE_FILE = 1 << 5
_MAKE_FOLDER = 1 << 7
_MAKE_FILE = 1 << 8
_MOVE = 1 << 13
_OF_FILES = _EXECUTE | _WRITE | _READ | _TRUNCATE | _CONTROL  # the rights that a rule for a file may name
_OF_SCRATCH = _WRITE | _READ | _LIST | _REMOVE_FOLDER | _REMOVE_FILE | _MAKE_FOLDER | _MAKE_FILE | _MOVE | _TRUNCATE
_RIGHTS = {1: 13, 2: 14, 3: 15, 5: 16}  # version of Landlock -> number of its rights on files
_BY_TCP = 3
_BY_SOCKET_AND_SIGNAL = 3

_RESERVED = 64  # address space, in multiples of the memory limit; page tables take an eighth of the memory
_STACK_BYTES = 1 << 23
_SIGNALS = 1 << 10  # pending signals of the process


def find_landlock_version() -> int:
    """Return the version of Landlock on this system; 0: not available."""
    if sys.platform != "linux":
        return 0
    return max(int(ctypes.CDLL(None).syscall(_CREATE_RULESET, None, 0, 1)), 0)


def confine(limits: ProcessLimits, readable: Iterable[str], writable: str, landlock: int) -> list[str]:
    """Confine this process irrevocably, and return descriptions of all limits that could not be enforced.

    Args:
        limits: the resources that it may use.
        readable: files and folders that it may read, and run programs from.
        writable: the folder that it may also write.
        landlock: the version of Landlock to rely on, as returned by `find_landlock_version`.
    """
    missing = _set_limits(limits)
    if sys.platform != "linux":
        return [*missing, f"{_FILES} (needs Linux)", f"{_CALLS} (needs Linux)", f"{_MEMORY} (needs Linux)"]
    _drop_privileges()
    bound = landlock if _restrict_files(readable, writable, landlock) else 0
    if bound < 1:
        missing.append(f"{_FILES} (needs Linux 5.13 with Landlock)")
    if not _restrict_calls():
        missing.append(f"{_CALLS}, {_MEMORY} (needs Linux with seccomp on {' or '.join(MACHINES)})")
        missing += [f"{what} (needs {needed})" for version, what, needed in _BY_VERSION if bound < version]
    return missing


_FILES = "which files can be read and written, the memory of other processes among them"
_CALLS = "no network, no other processes, no changes of the mode, owner, times and attributes of files"
_MEMORY = "how much memory and disk is taken by what is shared or deleted"
# Limits that Landlock enforces from a version on, and the filter of system calls as well.
_BY_VERSION = (
    (3, "that files which can be read are not truncated", "Linux 6.2 with Landlock"),
    (6, "no signals to other processes", "Linux 6.12 with Landlock"),
)


def _set_limits(limits: ProcessLimits) -> list[str]:
    import resource  # not available on Windows

    missing = []
    for name, soft, hard in (
        ("RLIMIT_CORE", 0, 0),
        ("RLIMIT_CPU", limits.cpu_s, limits.cpu_s + 1),
        ("RLIMIT_FSIZE", limits.file_bytes, limits.file_bytes),
        ("RLIMIT_NOFILE", limits.open_files, limits.open_files),
        # Private writable memory: programs of other languages reserve more addresses than they use.
        ("RLIMIT_DATA", limits.memory_bytes, limits.memory_bytes),
        ("RLIMIT_AS", _RESERVED * limits.memory_bytes, _RESERVED * limits.memory_bytes),
        ("RLIMIT_STACK", _STACK_BYTES, _STACK_BYTES),
        ("RLIMIT_SIGPENDING", _SIGNALS, _SIGNALS),
    ):
        if not hasattr(resource, name):  # macOS has no limit on pending signals
            continue
        kind = getattr(resource, name)
        before = resource.getrlimit(kind)[1]
        most = hard if before == resource.RLIM_INFINITY else min(hard, before)
        try:
            resource.setrlimit(kind, (min(soft, most), most))
        except (OSError, ValueError):
            missing.append(f"the limit {name}")
    return missing


def _drop_privileges() -> None:
    """Give up all capabilities of a superuser, in this process and in programs that it runs."""
    libc = ctypes.CDLL(None)
    for capability in range(_MOST_CAPABILITIES):
        libc.prctl(_DROP_FROM_BOUNDS, capability, 0, 0, 0)
    libc.capset(struct.pack("Ii", _CAPABILITIES_VERSION, 0), bytes(24))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)


def _restrict_files(readable: Iterable[str], writable: str, version: int) -> bool:
    """Restrict file access to these paths by Landlock; return whether the system can do that."""
    if version < 1:
        return False
    call = ctypes.CDLL(None, use_errno=True).syscall
    rights = (1 << _RIGHTS[max(one for one in _RIGHTS if one <= version)]) - 1
    parts = [rights, _BY_TCP, _BY_SOCKET_AND_SIGNAL][: 1 + (version >= 4) + (version >= 6)]
    attributes = struct.pack(f"{len(parts)}Q", *parts)
    rules = call(_CREATE_RULESET, attributes, len(attributes), 0)
    if rules < 0:
        return False
    # Not /dev/zero: a shared mapping of it is memory that no limit counts.
    devices = [("/dev/null", _READ | _WRITE), ("/dev/urandom", _READ), ("/dev/random", _READ)]
    everything = [
        *((path, _READ | _LIST | _EXECUTE) for path in (*_SYSTEM, *readable)),
        *devices,
        (writable, _OF_SCRATCH),
    ]
    for path, allowed in everything:
        _allow(call, rules, path, allowed & rights)
    is_bound = call(_RESTRICT, rules, 0) == 0
    os.close(rules)
    return bool(is_bound)


# Files that programs of any language read at start: libraries, time zones, the number of processors.
_SYSTEM = (
    *("/usr", "/lib", "/lib32", "/lib64", "/bin", "/sbin", "/nix/store", "/etc/ld.so.cache", "/etc/ld.so.conf"),
    *("/etc/localtime", "/etc/alternatives", "/etc/ssl/openssl.cnf", "/proc/self", "/proc/cpuinfo", "/proc/meminfo"),
    *("/proc/stat", "/proc/version", "/proc/sys/vm", "/sys/devices/system/cpu"),
)


def _allow(call: Callable[..., int], rules: int, path: str, allowed: int) -> None:
    try:
        opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:  # not on this system
        return
    if not os.path.isdir(path):  # noqa: PTH112 - as light as possible, in every child
        allowed &= _OF_FILES
    call(_ADD_RULE, rules, 1, struct.pack("=Qi", allowed, opened), 0)
    os.close(opened)


def _restrict_calls() -> bool:
    """Install the filter of system calls; return whether the system can do that."""
    if platform.machine() not in MACHINES:
        return False
    filters = b"".join(struct.pack("=HBBI", *one) for one in filter_for(platform.machine(), os.getpid()))
    buffer = ctypes.create_string_buffer(filters)
    program = struct.pack("@HxxxxxxP", len(filters) // 8, ctypes.addressof(buffer))
    return bool(ctypes.CDLL(None).prctl(_SET_SECCOMP, 2, program, 0, 0) == 0)


# -- control groups -----------------------------------------------------------------------------------------------

_GROUP_PREFIX = "gamms-"  # prefix of a group's name, before the id of its launcher
_MEMBERS = "cgroup.procs"
_COUNTERS = ("memory.events", "memory.oom_control")  # where versions 2 and 1 count killed processes


class ControlGroups:
    """Control groups that bound this process and its later children.

    The groups lie in the process's own group or beside it. Memory that the process took before does not count.

    Args:
        memory_bytes: the memory of all processes in the groups together.
        threads: the threads of all processes in the groups together.
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
        for parent in list(_find_parent_groups()):
            group = parent / f"{_GROUP_PREFIX}{os.getpid()}"
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
        """Return whether the kernel has killed a process for lack of memory since the last call."""
        before = self._killed
        self._killed = 0
        for group in self._joined:
            for name in _COUNTERS:
                with suppress(OSError):
                    found = re.search(r"^oom_kill (\d+)$", (group / name).read_text(), re.MULTILINE)
                    self._killed += int(found[1]) if found else 0
        return self._killed > before


def remove_empty_groups() -> None:
    """Remove the groups of launchers that have ended."""
    for parent in _find_parent_groups():
        for group in parent.glob(f"{_GROUP_PREFIX}*"):
            if not Path("/proc", group.name.removeprefix(_GROUP_PREFIX)).exists():
                with suppress(OSError):
                    group.rmdir()


def _find_parent_groups() -> Iterator[Path]:
    """Yield the groups in which this process may be able to make groups: its own, and in version 2 its parent."""
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
