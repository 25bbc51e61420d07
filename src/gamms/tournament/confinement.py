"""Confines a process to what an entry of a tournament may do: memory, time, files, no network, no other process.

Called in a fresh child before it runs any code of an entry, and never to be undone. Resource limits are those of POSIX;
on Linux, Landlock bounds which files can be opened, and a filter of system calls (seccomp) forbids the rest. Neither
needs privileges, so it works for any user and in containers. What the system does not offer is returned in words.
"""

import ctypes
import os
import platform
import struct
import sys
from collections.abc import Callable, Iterable
from typing import NamedTuple


class Limits(NamedTuple):
    """What a process may use.

    Attributes:
        memory_bytes: of private memory.
        cpu_s: seconds of processor time, of all its threads together.
        file_bytes: how long a file that it writes may be.
        open_files: how many at once.
    """

    memory_bytes: int
    cpu_s: int
    file_bytes: int = 1 << 24
    open_files: int = 128


# -- numbers of Linux -------------------------------------------------------------------------------------------

_SET_DEATH_SIGNAL, _DROP_FROM_BOUNDS, _SET_SECCOMP, _NO_NEW_PRIVILEGES = 1, 24, 22, 38  # of prctl
_KILL = 9
_MOST_CAPABILITIES = 64
_CAPABILITIES_VERSION = 0x20080522
_CREATE_RULESET, _ADD_RULE, _RESTRICT = 444, 445, 446  # Landlock's system calls, on all architectures

_EXECUTE, _WRITE, _READ, _LIST, _TRUNCATE, _CONTROL = 1, 1 << 1, 1 << 2, 1 << 3, 1 << 14, 1 << 15
_OF_FILES = _EXECUTE | _WRITE | _READ | _TRUNCATE | _CONTROL  # the rights that a rule for a file may name
_RIGHTS = {1: 13, 2: 14, 3: 15, 5: 16}  # version of Landlock -> number of its rights on files
_BY_TCP, _BY_SOCKET_AND_SIGNAL = 3, 3

_LOAD, _IF_EQUAL, _IF_AT_LEAST, _IF_SET, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06  # instructions of filters
_NUMBER, _ARCHITECTURE, _FIRST_ARGUMENT = 0, 4, 16  # offsets into what a filter sees
_ALLOW, _KILL_PROCESS, _FAIL = 0x7FFF0000, 0x80000000, 0x00050000  # to the last, the error is added
_NOT_PERMITTED, _NOT_THERE = 1, 38  # errors
_SAME_MEMORY_GROUP = 0x10000  # CLONE_THREAD: what is made is a thread
_X32 = 0x40000000  # from here on: the numbers of another table of x86


class _Machine(NamedTuple):
    """System calls of a kind of processor, by number."""

    architecture: int
    starting: tuple[int, ...]  # a process: kills who calls
    clone: int  # likewise, unless it makes a thread
    absent: tuple[int, ...]  # as if the system did not have them: programs know another way
    forbidden: tuple[int, ...]
    own_only: tuple[int, ...]  # those whose first argument is a process: itself, or 0
    prctl: int


_MACHINES = {
    "x86_64": _Machine(
        0xC000003E,
        starting=(57, 58),  # fork, vfork
        clone=56,
        absent=(435, 425),  # clone3, io_uring_setup
        # socket, ptrace, shmget, semget, msgget, mq_open, process_vm_readv and writev, pidfd_open, pidfd_send_signal,
        # pidfd_getfd, tkill, unshare, setns, mount, keyctl, add_key, request_key, bpf, perf_event_open, userfaultfd,
        # setpriority, sched_setscheduler, sched_setaffinity, ioprio_set
        forbidden=(
            *(41, 101, 29, 64, 68, 240, 310, 311, 434, 424, 438, 200, 272, 308, 165, 250, 248, 249, 321, 298, 323),
            *(141, 144, 203, 251),
        ),
        own_only=(62, 234, 129, 297, 302),  # kill, tgkill, rt_sigqueueinfo, rt_tgsigqueueinfo, prlimit64
        prctl=157,
    ),
    "aarch64": _Machine(
        0xC00000B7,
        starting=(),
        clone=220,
        absent=(435, 425),
        forbidden=(
            *(198, 117, 194, 190, 186, 180, 270, 271, 434, 424, 438, 130, 97, 268, 40, 219, 217, 218, 280, 241, 282),
            *(140, 119, 122, 30),
        ),
        own_only=(129, 131, 138, 240, 261),
        prctl=167,
    ),
}


def die_with_parent(parent: int) -> None:
    """Have this process killed when the one that started it ends, where the system can do that.

    Args:
        parent: the id of that process; if it has ended already, this process exits.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, _KILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)


def confine(limits: Limits, readable: Iterable[str], writable: str) -> list[str]:
    """Confine this process for ever, and return what could not be enforced.

    Args:
        limits: what it may use.
        readable: files and folders that may be read, and programs in them run.
        writable: the folder in which it may write, too.
    """
    missing = _set_limits(limits)
    if sys.platform != "linux":
        return [*missing, *_MISSING]
    _drop_privileges()
    if not _bound_files(readable, writable):
        missing.append("which files can be read and written (needs Linux 5.13 with Landlock)")
    if not _bound_calls():
        missing.append("no network and no other processes (needs Linux with seccomp on x86_64 or aarch64)")
    return missing


_MISSING = ("which files can be read and written (needs Linux)", "no network and no other processes (needs Linux)")


def _set_limits(limits: Limits) -> list[str]:
    import resource  # which Windows does not have

    missing = []
    for name, soft, hard in (
        ("RLIMIT_CORE", 0, 0),
        ("RLIMIT_CPU", limits.cpu_s, limits.cpu_s + 1),
        ("RLIMIT_FSIZE", limits.file_bytes, limits.file_bytes),
        ("RLIMIT_NOFILE", limits.open_files, limits.open_files),
        # Private memory that can be written, not addresses: other languages reserve many of these.
        ("RLIMIT_DATA", limits.memory_bytes, limits.memory_bytes),
    ):
        try:
            resource.setrlimit(getattr(resource, name), (soft, hard))
        except (OSError, ValueError, AttributeError):
            missing.append(f"the limit {name}")
    return missing


def _drop_privileges() -> None:
    """Give up all capabilities that a superuser has, for all programs that are run from here on."""
    libc = ctypes.CDLL(None)
    for capability in range(_MOST_CAPABILITIES):
        libc.prctl(_DROP_FROM_BOUNDS, capability, 0, 0, 0)
    libc.capset(struct.pack("Ii", _CAPABILITIES_VERSION, 0), bytes(24))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)


def _bound_files(readable: Iterable[str], writable: str) -> bool:
    """Let only these files be opened; return whether the system can do that."""
    call = ctypes.CDLL(None, use_errno=True).syscall
    version = call(_CREATE_RULESET, None, 0, 1)
    if version < 1:
        return False
    rights = (1 << _RIGHTS[max(one for one in _RIGHTS if one <= version)]) - 1
    parts = [rights, _BY_TCP, _BY_SOCKET_AND_SIGNAL][: 1 + (version >= 4) + (version >= 6)]
    attributes = struct.pack(f"{len(parts)}Q", *parts)
    rules = call(_CREATE_RULESET, attributes, len(attributes), 0)
    if rules < 0:
        return False
    devices = [("/dev/null", _READ | _WRITE), ("/dev/zero", _READ), ("/dev/urandom", _READ), ("/dev/random", _READ)]
    everything = [
        *((path, _READ | _LIST | _EXECUTE) for path in (*_SYSTEM, *readable)),
        *devices,
        (writable, rights & ~_EXECUTE),
    ]
    for path, allowed in everything:
        _allow(call, rules, path, allowed & rights)
    is_bound = call(_RESTRICT, rules, 0) == 0
    os.close(rules)
    return bool(is_bound)


# What programs of any language read to start: libraries, time zones, how many processors there are.
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


def _bound_calls() -> bool:
    """Let no other process be started or touched, and no socket be opened; return whether the system can do that."""
    machine = _MACHINES.get(platform.machine())
    if machine is None:
        return False
    filters = b"".join(struct.pack("=HBBI", *one) for one in _program(machine, os.getpid()))
    buffer = ctypes.create_string_buffer(filters)
    program = struct.pack("@HxxxxxxP", len(filters) // 8, ctypes.addressof(buffer))
    return bool(ctypes.CDLL(None).prctl(_SET_SECCOMP, 2, program, 0, 0) == 0)


_Instruction = tuple[int, int, int, int]  # code, jump if true, jump if false, operand


def _program(machine: _Machine, process: int) -> list[_Instruction]:
    """Return the filter: each block looks at one call, and returns or falls through to the next."""
    refused = _FAIL | _NOT_PERMITTED
    program: list[_Instruction] = [
        (_LOAD, 0, 0, _ARCHITECTURE),
        (_IF_EQUAL, 1, 0, machine.architecture),
        (_RETURN, 0, 0, _KILL_PROCESS),
        (_LOAD, 0, 0, _NUMBER),
        (_IF_AT_LEAST, 0, 1, _X32),
        (_RETURN, 0, 0, _KILL_PROCESS),
    ]
    answers = [(_KILL_PROCESS, machine.starting), (_FAIL | _NOT_THERE, machine.absent), (refused, machine.forbidden)]
    for answer, numbers in answers:
        for number in numbers:
            program += [(_IF_EQUAL, 0, 1, number), (_RETURN, 0, 0, answer)]

    def by_argument(number: int, *tests: _Instruction) -> list[_Instruction]:
        """Return a block whose tests jump over the first of its two ends, a refusal, to the second, which allows."""
        size = len(tests) + 3
        return [(_IF_EQUAL, 0, size, number), (_LOAD, 0, 0, _FIRST_ARGUMENT), *tests]

    ends: list[_Instruction] = [(_RETURN, 0, 0, refused), (_RETURN, 0, 0, _ALLOW)]
    for number in machine.own_only:
        program += by_argument(number, (_IF_EQUAL, 2, 0, 0), (_IF_EQUAL, 1, 0, process)) + ends
    program += by_argument(machine.prctl, (_IF_EQUAL, 0, 1, _SET_DEATH_SIGNAL)) + ends
    program += by_argument(machine.clone, (_IF_SET, 1, 0, _SAME_MEMORY_GROUP))
    program += [(_RETURN, 0, 0, _KILL_PROCESS), (_RETURN, 0, 0, _ALLOW)]
    return [*program, (_RETURN, 0, 0, _ALLOW)]
