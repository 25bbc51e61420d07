"""The system calls that an entry may make: a table of their numbers, and the seccomp filter made from it.

Calls in `FREE` are allowed. Calls in `BOUND` are allowed if their arguments meet the conditions beside them; a filter
sees numbers, but not the memory that pointers lead to. Calls in `STARTING` kill the caller unless they start a thread.
Calls in `ABSENT` fail as if the system did not have them (ENOSYS), so that programs take another way. Every other call
fails as not permitted (EPERM).

Landlock decides which files `open` opens and `rename` renames. The table leaves out everything that Landlock does not
govern: the mode, owner, times and attributes of files, links, truncation, sockets with addresses, shared memory without
a file, and watches on folders (inotify).
"""

from collections.abc import Iterable
from typing import NamedTuple

Numbers = tuple[int | None, int | None]  # on x86_64, on aarch64; None: does not exist there

FREE: dict[str, Numbers] = {
    # reading and writing open files
    "read": (0, 63),
    "write": (1, 64),
    "readv": (19, 65),
    "writev": (20, 66),
    "pread64": (17, 67),
    "pwrite64": (18, 68),
    "preadv": (295, 69),
    "pwritev": (296, 70),
    "preadv2": (327, 286),
    "pwritev2": (328, 287),
    "lseek": (8, 62),
    "sendfile": (40, 71),
    "copy_file_range": (326, 285),
    "fsync": (74, 82),
    "fdatasync": (75, 83),
    "fadvise64": (221, 223),
    "close": (3, 57),
    "close_range": (436, 436),
    "dup": (32, 23),
    "dup2": (33, None),
    "dup3": (292, 24),
    # files: Landlock decides which
    "creat": (85, None),
    "access": (21, None),
    "faccessat": (269, 48),
    "faccessat2": (439, 439),
    "stat": (4, None),
    "lstat": (6, None),
    "fstat": (5, 80),
    "newfstatat": (262, 79),
    "statx": (332, 291),
    "statfs": (137, 43),
    "fstatfs": (138, 44),
    "readlink": (89, None),
    "readlinkat": (267, 78),
    "getdents": (78, None),
    "getdents64": (217, 61),
    "getcwd": (79, 17),
    "chdir": (80, 49),
    "fchdir": (81, 50),
    "mkdir": (83, None),
    "mkdirat": (258, 34),
    "rmdir": (84, None),
    "unlink": (87, None),
    "unlinkat": (263, 35),
    "rename": (82, None),
    "renameat": (264, 38),
    "renameat2": (316, 276),
    "umask": (95, 166),
    # memory
    "brk": (12, 214),
    "munmap": (11, 215),
    "mprotect": (10, 226),
    "mremap": (25, 216),
    "msync": (26, 227),
    "madvise": (28, 233),
    "mseal": (462, 462),
    "membarrier": (324, 283),
    # threads and waiting
    "set_tid_address": (218, 96),
    "set_robust_list": (273, 99),
    "rseq": (334, 293),
    "arch_prctl": (158, None),
    "futex": (202, 98),
    "futex_waitv": (449, 449),
    "futex_wake": (454, 454),
    "futex_wait": (455, 455),
    "futex_requeue": (456, 456),
    "exit": (60, 93),
    "exit_group": (231, 94),
    "execve": (59, 221),
    "wait4": (61, 260),
    "waitid": (247, 95),
    "sched_yield": (24, 124),
    "sched_getaffinity": (204, 123),
    "sched_getscheduler": (145, 120),
    "sched_getparam": (143, 121),
    "sched_getattr": (315, 275),
    "sched_get_priority_max": (146, 125),
    "sched_get_priority_min": (147, 126),
    "sched_rr_get_interval": (148, 127),
    # signals to the process itself
    "rt_sigaction": (13, 134),
    "rt_sigprocmask": (14, 135),
    "rt_sigreturn": (15, 139),
    "rt_sigpending": (127, 136),
    "rt_sigsuspend": (130, 133),
    "rt_sigtimedwait": (128, 137),
    "sigaltstack": (131, 132),
    "signalfd": (282, None),
    "signalfd4": (289, 74),
    "pause": (34, None),
    "restart_syscall": (219, 128),
    # time
    "time": (201, None),
    "gettimeofday": (96, 169),
    "clock_gettime": (228, 113),
    "clock_getres": (229, 114),
    "nanosleep": (35, 101),
    "clock_nanosleep": (230, 115),
    "alarm": (37, None),
    "getitimer": (36, 102),
    "setitimer": (38, 103),
    "timerfd_create": (283, 85),
    "timerfd_settime": (286, 86),
    "timerfd_gettime": (287, 87),
    # information about the process and the machine
    "getpid": (39, 172),
    "gettid": (186, 178),
    "getppid": (110, 173),
    "getpgrp": (111, None),
    "getpgid": (121, 155),
    "getsid": (124, 156),
    "getuid": (102, 174),
    "geteuid": (107, 175),
    "getgid": (104, 176),
    "getegid": (108, 177),
    "getresuid": (118, 148),
    "getresgid": (120, 150),
    "getgroups": (115, 158),
    "capget": (125, 90),
    "uname": (63, 160),
    "sysinfo": (99, 179),
    "getcpu": (309, 168),
    "getrandom": (318, 278),
    "getrusage": (98, 165),
    "times": (100, 153),
    "getrlimit": (97, 163),
    "setrlimit": (160, 164),
    "getpriority": (140, 141),
    # waiting for open files
    "poll": (7, None),
    "ppoll": (271, 73),
    "select": (23, None),
    "pselect6": (270, 72),
    "epoll_create": (213, None),
    "epoll_create1": (291, 20),
    "epoll_ctl": (233, 21),
    "epoll_wait": (232, None),
    "epoll_pwait": (281, 22),
    "epoll_pwait2": (441, 441),
    "eventfd": (284, None),
    "eventfd2": (290, 19),
    "pipe": (22, None),
    "pipe2": (293, 59),
    "recvfrom": (45, 207),
    "recvmsg": (47, 212),
    "shutdown": (48, 210),
    "getsockopt": (55, 209),
    "getsockname": (51, 204),
    "getpeername": (52, 205),
}


class AllowedValues(NamedTuple):
    """Condition: some bits of an argument must have one of these values.

    Attributes:
        argument: the index of the argument, from 0.
        values: the allowed values of the bits.
        mask: the tested bits of one half of the argument.
        is_upper: test the upper half of the argument instead of the lower half.
    """

    argument: int
    values: tuple[int, ...]
    mask: int = 0xFFFFFFFF
    is_upper: bool = False


class RefusedValue(NamedTuple):
    """Condition: some bits of an argument must not have this value.

    Attributes:
        argument: the index of the argument, from 0.
        value: the refused value of the bits.
        mask: the tested bits of the lower half of the argument.
    """

    argument: int
    value: int
    mask: int


OWN = -1  # in `AllowedValues`: the process that is confined

# Of open: access mode 3 and O_TRUNC without writing need no right of Landlock; O_TMPFILE makes files without a name.
_OPENING = ((0x3, 0x3), (0x200, 0x203), (0x400000, 0x400000))
_AS_THREAD = (
    0x10F00  # CLONE_THREAD with shared memory, files, folder and signals, so that all open files are in one table
)
_FCNTL = (
    *(0, 1030),  # F_DUPFD, F_DUPFD_CLOEXEC
    *(1, 2, 3, 4),  # F_GETFD, F_SETFD, F_GETFL, F_SETFL
    *(5, 6, 7),  # F_GETLK, F_SETLK, F_SETLKW
    *(36, 37, 38),  # F_OFD_GETLK, F_OFD_SETLK, F_OFD_SETLKW
    1032,  # F_GETPIPE_SZ
)
_IOCTL = (
    *(0x5401, 0x802C542A),  # TCGETS, TCGETS2: ask whether a file is a terminal
    0x5413,  # TIOCGWINSZ
    0x541B,  # FIONREAD
    0x5421,  # FIONBIO
    *(0x5450, 0x5451),  # FIONCLEX, FIOCLEX
)
_PRCTL = (
    2,  # PR_GET_PDEATHSIG
    3,  # PR_GET_DUMPABLE
    *(15, 16),  # PR_SET_NAME, PR_GET_NAME
    23,  # PR_CAPBSET_READ
    39,  # PR_GET_NO_NEW_PRIVS
    0x53564D41,  # PR_SET_VMA, which names memory
)

BOUND: dict[str, tuple[Numbers, tuple[AllowedValues | RefusedValue, ...]]] = {
    "open": ((2, None), tuple(RefusedValue(1, *one) for one in _OPENING)),
    "openat": ((257, 56), tuple(RefusedValue(2, *one) for one in _OPENING)),
    "mmap": (
        (9, 222),
        (
            RefusedValue(3, 0x21, 0x21),  # MAP_SHARED and MAP_ANONYMOUS: memory that no limit counts
            RefusedValue(3, 0x100, 0x100),  # MAP_GROWSDOWN: counts as a stack
            RefusedValue(3, 0x40000, 0x40000),  # MAP_HUGETLB: memory that no limit counts
        ),
    ),
    "fcntl": ((72, 25), (AllowedValues(1, _FCNTL),)),
    "ioctl": ((16, 29), (AllowedValues(1, _IOCTL),)),
    "prctl": ((157, 167), (AllowedValues(0, _PRCTL),)),
    "socketpair": ((53, 199), (AllowedValues(0, (1,)),)),  # AF_UNIX
    "sendto": (
        (44, 206),
        (AllowedValues(4, (0,)), AllowedValues(4, (0,), is_upper=True)),
    ),  # no address: the connected peer
    "kill": ((62, 129), (AllowedValues(0, (0, OWN)),)),
    "tgkill": ((234, 131), (AllowedValues(0, (OWN,)),)),
    "rt_sigqueueinfo": ((129, 138), (AllowedValues(0, (OWN,)),)),
    "rt_tgsigqueueinfo": ((297, 240), (AllowedValues(0, (OWN,)),)),
    "prlimit64": ((302, 261), (AllowedValues(0, (0, OWN)),)),
}

STARTING: dict[str, tuple[Numbers, tuple[AllowedValues, ...]]] = {
    "clone": ((56, 220), (AllowedValues(0, (_AS_THREAD,), _AS_THREAD),)),
    "fork": ((57, None), (AllowedValues(0, ()),)),
    "vfork": ((58, None), (AllowedValues(0, ()),)),
}

ABSENT: dict[str, Numbers] = {
    "clone3": (435, 435),
    "openat2": (437, 437),
    "io_uring_setup": (425, 425),
    "io_uring_enter": (426, 426),
    "io_uring_register": (427, 427),
    "splice": (275, 76),
    "tee": (276, 77),
    "vmsplice": (278, 75),
    "pkey_alloc": (330, 289),
    "pkey_free": (331, 290),
    "pkey_mprotect": (329, 288),
}

NEWEST = 469  # the last call of Linux 6.18; a later one answers as if it was absent

MACHINES = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}
"""Machine name -> (column in the tables, architecture number that a filter sees)."""

_LOAD = 0x20  # instructions of filters
_AND = 0x54
_RETURN = 0x06
_IF_EQUAL = 0x15
_IF_ABOVE = 0x25
_NUMBER = 0  # offsets into the data that a filter sees
_ARCHITECTURE = 4
_ARGUMENTS = 16
_ALLOW = 0x7FFF0000  # return values; the error number is added to the last one
_KILL_PROCESS = 0x80000000
_FAIL = 0x00050000
_REFUSE = _FAIL | 1  # EPERM, ENOSYS
_IS_ABSENT = _FAIL | 38

Instruction = tuple[int, int, int, int]  # code, jump if true, jump if false, operand


def filter_for(machine: str, process: int) -> list[Instruction]:
    """Return the seccomp filter for a process on a machine: a list of blocks, one for each system call."""
    column, architecture = MACHINES[machine]
    program: list[Instruction] = [
        (_LOAD, 0, 0, _ARCHITECTURE),
        (_IF_EQUAL, 1, 0, architecture),
        (_RETURN, 0, 0, _KILL_PROCESS),
        (_LOAD, 0, 0, _NUMBER),
    ]
    blocks = [
        *((numbers, _make_block(conditions, _REFUSE, process)) for numbers, conditions in BOUND.values()),
        *((numbers, _make_block(conditions, _KILL_PROCESS, process)) for numbers, conditions in STARTING.values()),
        *((numbers, [(_RETURN, 0, 0, _IS_ABSENT)]) for numbers in ABSENT.values()),
        *((numbers, [(_RETURN, 0, 0, _ALLOW)]) for numbers in FREE.values()),
    ]
    for numbers, block in blocks:
        number = numbers[column]
        if number is not None:
            program += [(_IF_EQUAL, 0, len(block), number), *block]
    return [*program, (_IF_ABOVE, 0, 1, NEWEST), (_RETURN, 0, 0, _IS_ABSENT), (_RETURN, 0, 0, _REFUSE)]


def _make_block(conditions: Iterable[AllowedValues | RefusedValue], refused: int, process: int) -> list[Instruction]:
    """Return the block of a filter that tests the arguments of a call."""
    block: list[Instruction] = []
    for one in conditions:
        if isinstance(one, RefusedValue):
            block += [(_LOAD, 0, 0, _ARGUMENTS + 8 * one.argument), (_AND, 0, 0, one.mask)]
            block += [(_IF_EQUAL, 0, 1, one.value), (_RETURN, 0, 0, refused)]
            continue
        values = [process if value == OWN else value for value in one.values]
        block += [(_LOAD, 0, 0, _ARGUMENTS + 8 * one.argument + 4 * one.is_upper), (_AND, 0, 0, one.mask)]
        block += [(_IF_EQUAL, len(values) - place, 0, value) for place, value in enumerate(values)]
        block.append((_RETURN, 0, 0, refused))
    return [*block, (_RETURN, 0, 0, _ALLOW)]
