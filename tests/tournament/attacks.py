"""A hostile entry: in its second turn it does what the facts of the scenario name. See test_attacks.py.

Deeds of `REFUSED` raise an error of the system; a game tries all of them. Each of `DONE` has a game of its own.
"""

import ctypes
import errno
import fcntl
import json
import mmap
import os
import platform
import signal
import socket
import threading
import time
from pathlib import Path

HERE = str(Path(__file__).absolute())
ANSWERS = 4  # the descriptor by which a Python entry answers
libc = ctypes.CDLL(None, use_errno=True)
kept = []


def of(*numbers):
    """Return the number of a system call on this machine, given those on x86_64 and aarch64."""
    return numbers[platform.machine() == "aarch64"]


def checked(result):
    """Return the result of a function of C, or raise what went wrong."""
    if result in (-1, ctypes.c_void_p(-1).value):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def call(number, *arguments):
    return checked(libc.syscall(number, *(ctypes.c_long(one) if isinstance(one, int) else one for one in arguments)))


def mapped(size, protection, flags, file=-1):
    libc.mmap.restype = ctypes.c_void_p
    return checked(libc.mmap(None, ctypes.c_size_t(size), protection, flags, file, ctypes.c_long(0)))


def own(name="own"):
    """Return a file of its own, open for reading and writing."""
    return os.open(name, os.O_RDWR | os.O_CREAT, 0o600)


def pair(kind=socket.SOCK_DGRAM):
    return socket.socketpair(socket.AF_UNIX, kind)


def answer(text):
    os.write(ANSWERS, text.encode() + b"\n")
    time.sleep(60)


def act(**actions):
    """Answer the second question with these actions; other agents stay."""
    answer(json.dumps({"type": "turn", "question": 2, "actions": {**GIVEN["stay"], **actions}}))


def say(*messages):
    """Answer the second question with these messages; all agents stay."""
    outbox = {"red_0": messages}
    answer(json.dumps({"type": "turn", "question": 2, "actions": GIVEN["stay"], "outbox": outbox}))


PARENT = os.getppid()
GIVEN = {}  # the facts: "file" of the organiser, "out" of the tournament


def file():
    return GIVEN["file"]


# -- refused ------------------------------------------------------------------------------------------------------

REFUSED = {
    # files of others, and their own
    "chmod": lambda: os.chmod(file(), 0o777),
    "chmod of a folder": lambda: os.chmod(GIVEN["out"], 0),
    "chmod of itself": lambda: os.chmod(HERE, 0),
    "fchmod": lambda: os.fchmod(own(), 0o777),
    "fchmodat2": lambda: call(452, -100, os.fsencode(file()), 0o777, 0),
    "chown": lambda: os.chown(file(), os.getuid(), os.getgid()),
    "lchown": lambda: os.lchown(file(), os.getuid(), os.getgid()),
    "fchown": lambda: os.fchown(own(), os.getuid(), os.getgid()),
    "utime": lambda: os.utime(file(), (0, 0)),
    "futime": lambda: os.utime(own(), (0, 0)),
    "setxattr": lambda: os.setxattr(file(), "user.a", b"1"),
    "fsetxattr": lambda: os.setxattr(own(), "user.a", b"1"),
    "removexattr": lambda: os.removexattr(file(), "user.a"),
    "setxattrat": lambda: call(463, -100, os.fsencode(file()), 0, b"user.a", b"", 0),
    "file_setattr": lambda: call(469, -100, os.fsencode(file()), bytes(32), 32, 0),
    "truncate": lambda: os.truncate(file(), 0),
    "truncate of itself": lambda: os.truncate(HERE, 0),
    "ftruncate": lambda: os.ftruncate(own(), 1 << 20),
    "O_TRUNC without writing": lambda: os.open(HERE, os.O_RDONLY | os.O_TRUNC),
    "O_TRUNC with the access mode 3": lambda: os.open(HERE, 3 | os.O_TRUNC),
    "the access mode 3": lambda: os.open(file(), 3),
    "openat2": lambda: call(437, -100, os.fsencode(file()), bytes(24), 24),
    "fallocate": lambda: os.posix_fallocate(own(), 0, 1 << 20),
    "link": lambda: os.link(HERE, "linked"),
    "link of the organiser's": lambda: os.link(file(), "linked"),
    "symlink": lambda: os.symlink(file(), "linked"),
    "mkfifo": lambda: os.mkfifo("pipe"),
    "mknod": lambda: os.mknod("socket", 0o140600),
    "rename": lambda: os.rename(file(), "mine"),
    "replace": lambda: os.rename("/proc/self/cwd/own", file()) if own() else None,
    "unlink": lambda: os.unlink(file()),
    "mkdir": lambda: os.mkdir(GIVEN["out"] + "/mine"),
    "mkdir beside": lambda: os.mkdir("../mine"),
    "read": lambda: Path(file()).read_text(),
    "write": lambda: Path(file()).write_text("mine"),
    "append": lambda: Path(file()).open("a"),
    "list the tournament": lambda: os.listdir(GIVEN["out"]),
    "list what lies beside": lambda: os.listdir(Path(HERE).parents[1]),
    "list the root": lambda: os.listdir("/"),
    "chroot": lambda: os.chroot("."),
    "open_by_handle_at": lambda: call(of(304, 265), -100, bytes(16), 0),
    "inotify": lambda: checked(libc.inotify_init()),
    "fanotify": lambda: checked(libc.fanotify_init(0, 0)),
    "dnotify": lambda: fcntl.fcntl(os.open(".", os.O_RDONLY), fcntl.F_NOTIFY, 1),
    "a lease": lambda: fcntl.fcntl(own(), fcntl.F_SETLEASE, fcntl.F_WRLCK),
    "flock": lambda: fcntl.flock(os.open(HERE, os.O_RDONLY), fcntl.LOCK_EX),
    # memory that no limit counts
    "memfd_create": lambda: os.memfd_create("hidden"),
    "memfd_secret": lambda: call(447, 0),
    "shared memory": lambda: mmap.mmap(-1, 1 << 20),
    "shared memory by zero": lambda: os.open("/dev/zero", os.O_RDWR),
    "shared memory, to be read": lambda: os.open("/dev/zero", os.O_RDONLY),
    "a mapping that grows": lambda: mapped(1 << 20, 3, 0x122),
    "large pages": lambda: mapped(1 << 21, 3, 0x40022),
    "a file without a name": lambda: os.open(".", os.O_TMPFILE | os.O_RDWR),
    "many addresses": lambda: mapped(1 << 36, 1, 0x4022),
    "shmget": lambda: checked(libc.shmget(0, ctypes.c_size_t(1 << 20), 0o1600)),
    "msgget": lambda: checked(libc.msgget(0, 0o1600)),
    "semget": lambda: checked(libc.semget(0, 1, 0o1600)),
    "mq_open": lambda: call(of(240, 180), b"gamms", 0o102, 0o600, 0),
    "a large pipe": lambda: fcntl.fcntl(ANSWERS, 1031, 1 << 20),
    "vmsplice": lambda: call(of(278, 75), ANSWERS, bytes(16), 0, 0),
    # other processes
    "clone3": lambda: call(435, bytes(88), 88),
    "kill the launcher": lambda: os.kill(PARENT, signal.SIGKILL),
    "stop the launcher": lambda: os.kill(PARENT, signal.SIGSTOP),
    "kill all": lambda: os.kill(-1, signal.SIGKILL),
    "tkill": lambda: call(of(200, 130), PARENT, 9),
    "tgkill": lambda: call(of(234, 131), PARENT, PARENT, 9),
    "sigqueue": lambda: call(of(129, 138), PARENT, 9, bytes(128)),
    "pidfd_open": lambda: os.pidfd_open(PARENT),
    "pidfd_send_signal": lambda: call(424, 0, 9, 0, 0),
    "F_SETOWN": lambda: fcntl.fcntl(pair()[0], fcntl.F_SETOWN, PARENT),
    "F_SETOWN_EX": lambda: fcntl.fcntl(pair()[0], 15, PARENT.to_bytes(8, "big")),
    "F_SETSIG": lambda: fcntl.fcntl(pair()[0], fcntl.F_SETSIG, signal.SIGKILL),
    "FIOSETOWN": lambda: fcntl.ioctl(pair()[0], 0x8901, PARENT.to_bytes(4, "little")),
    "FIOASYNC": lambda: fcntl.ioctl(pair()[0], 0x5452, b"\1\0\0\0"),
    "ptrace": lambda: checked(libc.ptrace(16, PARENT, 0, 0)),
    "process_vm_readv": lambda: call(of(310, 270), PARENT, bytes(16), 1, bytes(16), 1, 0),
    "process_vm_writev": lambda: call(of(311, 271), PARENT, bytes(16), 1, bytes(16), 1, 0),
    "the memory of the launcher": lambda: os.open(f"/proc/{PARENT}/mem", os.O_RDWR),
    "the environment of the launcher": lambda: os.open(f"/proc/{PARENT}/environ", os.O_RDONLY),
    "the command of the launcher": lambda: os.open(f"/proc/{PARENT}/cmdline", os.O_RDONLY),
    "limits of the launcher": lambda: call(of(302, 261), PARENT, 0, bytes(16), 0),
    "processors of the launcher": lambda: os.sched_setaffinity(PARENT, {0}),
    "priority": lambda: os.setpriority(os.PRIO_PROCESS, PARENT, 19),
    "process group": lambda: os.setpgid(0, 0),
    "session": lambda: os.setsid(),
    "not to be looked at": lambda: checked(libc.prctl(4, 0, 0, 0, 0)),
    "to outlive": lambda: checked(libc.prctl(1, 0, 0, 0, 0)),
    # sockets
    "TCP": lambda: socket.socket(socket.AF_INET, socket.SOCK_STREAM),
    "UDP": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
    "a Unix socket": lambda: socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM),
    "a pair of TIPC": lambda: checked(libc.socketpair(30, 1, 0, (ctypes.c_int * 2)())),
    "a datagram by its path": lambda: pair()[0].sendto(b"hello", GIVEN["socket"]),
    "a datagram in parts": lambda: pair()[0].sendmsg([b"hello"], [], 0, GIVEN["socket"]),
    "a file in a message": lambda: socket.send_fds(pair()[0], [b"1"], [own()]),
    "connect": lambda: pair()[0].connect(GIVEN["socket"]),
    "bind": lambda: pair()[0].bind("bound"),
    "an abstract name": lambda: pair()[0].bind("\0gamms"),
    "listen": lambda: pair(socket.SOCK_STREAM)[0].listen(),
    "setsockopt": lambda: pair()[0].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 24),
    # the system
    "io_uring": lambda: call(425, 8, bytes(120)),
    "bpf": lambda: call(of(321, 280), 0, bytes(64), 64),
    "keyctl": lambda: call(of(250, 219), 0, -3, 0),
    "add_key": lambda: call(of(248, 217), b"user", b"gamms", b"1", 1, -3),
    "userfaultfd": lambda: call(of(323, 282), 1),
    "perf_event_open": lambda: call(of(298, 241), bytes(128), 0, -1, -1, 0),
    "unshare": lambda: checked(libc.unshare(0x10000000)),
    "setns": lambda: checked(libc.setns(os.open("/proc/self", os.O_RDONLY), 0)),
    "mount": lambda: checked(libc.mount(b"none", b".", b"tmpfs", 0, 0)),
    "setuid": lambda: os.setuid(1),
    "personality": lambda: checked(libc.personality(0x0400000)),
    "nothing that is known": lambda: call(100_000),
}


# -- too much ------------------------------------------------------------------------------------------------------


def deleted_files():
    for number in range(40):
        kept.append(own(f"file {number}"))
        os.write(kept[-1], bytes(1 << 20))
        os.unlink(f"file {number}")
    time.sleep(60)


def deleted_mappings():
    for number in range(3):
        name, opened = f"file {number}", own(f"file {number}")
        os.write(opened, bytes(1 << 20))
        mapped(4096, 3, 1, opened)
        os.close(opened)
        os.unlink(name)
    time.sleep(60)


def sparse_files():
    for number in range(3):
        os.pwrite(own(f"file {number}"), b"x", (1 << 24) - 1)
    time.sleep(60)


def empty_files():
    for number in range(100_000):
        os.close(own(f"file {number}"))
    time.sleep(60)


def folders():
    for number in range(100_000):
        os.mkdir(f"folder {number}")
    time.sleep(60)


def nested():
    for _ in range(1300):
        os.mkdir("in")
        os.chdir("in")
    time.sleep(60)


def long_names():
    for _ in range(20):
        os.mkdir("x" * 250)
        os.chdir("x" * 250)
    own()
    for _ in range(20):
        os.mkdir("y")
        os.chdir("y")
    time.sleep(60)


def hidden():
    os.mkdir("hidden", 0o300)
    for number in range(20):
        os.write(own(f"hidden/{number}"), bytes(1 << 20))
    time.sleep(60)


def masked():
    os.umask(0o777)
    for number in range(20):
        os.close(os.open(str(number), os.O_WRONLY | os.O_CREAT))
        os.mkdir(f"folder {number}")
    time.sleep(60)


def threads():
    threading.stack_size(1 << 15)
    for _ in range(2_500):
        threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
    time.sleep(60)


def private_pages():
    """Take pages that were mapped to be read, so that they do not count as data until they are written."""
    while True:
        place = mapped(1 << 24, 1, 0x22)
        checked(libc.mprotect(ctypes.c_void_p(place), ctypes.c_size_t(1 << 24), 3))
        ctypes.memset(place, 1, 1 << 24)


def page_tables():
    """Read a byte of each two megabytes: this takes no memory but that of page tables."""
    while True:
        place = mapped(1 << 30, 1, 0x4022)
        for offset in range(0, 1 << 30, 1 << 21):
            ctypes.string_at(place + offset, 1)


def pages_of_files():
    """Map a file of its own many times."""
    opened = own()
    os.write(opened, bytes(1 << 24))
    while True:
        place = mapped(1 << 24, 3, 1, opened)
        ctypes.memset(place, 1, 1 << 24)


def other_threads_files():
    """Start a thread by the system call, with open files of its own."""
    libc.syscall(of(56, 220), ctypes.c_long(0x10100 | 0x800), 0, 0, 0, 0)


def fork():
    os.fork()


def vfork():
    libc.vfork()


def spawn():
    os.posix_spawn("/bin/true", ["true"], {})


def other_program():
    os.execv("/bin/true", ["true"])


def long_fault():
    answer(json.dumps({"type": "failed", "kind": "error", "message": "\x1b[31m" * 90_000}))


def unknown_fault():
    answer('{"type": "failed", "kind": "\\u001b[31m", "message": "\\ud800"}')


def escape_codes():
    raise ValueError("\x1b[2J\x1b]0;mine\x07")


def real_time_signal():
    os.kill(os.getpid(), 40)
    time.sleep(60)


def deep(size=900):
    value = 0
    for _ in range(size):
        value = [value]
    return value


def all_that_is_refused():
    """Try all deeds of `REFUSED`, and raise an error that lists those that were not refused."""
    done = []
    for name, deed in REFUSED.items():
        try:
            deed()
            done.append(name)
        except OSError as error:
            if error.errno not in (errno.EPERM, errno.EACCES, errno.ENOSYS, *ALSO.get(name, [])):
                done.append(f"{name}: {error}")
    raise RuntimeError(f"not refused: {done}")


ALSO = {"many addresses": [errno.ENOMEM]}  # how else the system refuses a deed


DONE = {
    "all that is refused": all_that_is_refused,
    "deleted files": deleted_files,
    "deleted mappings": deleted_mappings,
    "sparse files": sparse_files,
    "empty files": empty_files,
    "folders": folders,
    "nested folders": nested,
    "long names": long_names,
    "a hidden folder": hidden,
    "masked modes": masked,
    "threads": threads,
    "private pages": private_pages,
    "page tables": page_tables,
    "pages of files": pages_of_files,
    "a thread with files of its own": other_threads_files,
    "fork": fork,
    "vfork": vfork,
    "spawn": spawn,
    "another program": other_program,
    "a fault of 900 KB": long_fault,
    "an unknown fault": unknown_fault,
    "escape codes": escape_codes,
    "a real-time signal": real_time_signal,
    "stop itself": lambda: os.kill(os.getpid(), signal.SIGSTOP),
    "kill itself": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "never answer": lambda: time.sleep(60),
    "answer at length": lambda: answer("1" * (1 << 21)),
    "answer nothing": lambda: answer(""),
    "answer deep": lambda: answer("[" * 500_000),
    "act deep": lambda: act(red_0=deep()),
    "act with a long number": lambda: answer('{"type":"turn","question":2,"actions":{"red_0":1' + "0" * 4000 + "}}"),
    "act with no number": lambda: answer('{"type":"turn","question":2,"actions":{"red_0":1e400}}'),
    "act with half a letter": lambda: act(red_0="\ud800"),
    "act for half a letter": lambda: act(**{"\ud800": 1}),
    "say something deep": lambda: say({"channel": "radio", "to": "red", "body": deep()}),
    "say half a letter": lambda: say({"channel": "radio", "to": "red", "body": "\ud800"}),
    "say no message": lambda: say(None, 1, [], {"to": {}}),
    "say it often": lambda: say(*[{"channel": "radio", "to": "red", "body": 1}] * 10_000),
}


def decide(states):
    for state in states.values():
        state["action"] = state["curr_pos"]
    one = next(iter(states.values()))
    GIVEN.update(one["facts"], stay={name: state["curr_pos"] for name, state in states.items()})
    if one["turn"] == 1:
        DONE[GIVEN["deed"]]()


def stay(state):
    state["action"] = state["curr_pos"]
