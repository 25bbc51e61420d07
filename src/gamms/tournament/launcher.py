"""The process that starts those of one entry: a fresh one for each game, confined before it runs any of its code.

It knows the entry, the map and nothing of any game, so that a child, which begins as its copy, finds no seed, opponent
or state in its memory. It has loaded what Python entries need, so that a child is there in milliseconds. Its master
sends one line of JSON at a time and gets one back:

    {"start": scratch folder}, with three open files   ->   {"id": of the process}
    {"end": id, "patience": seconds}                   ->   {"status": of waitpid, "ended": by itself, "cpu_s",
                                                             "memory": whether the kernel ended it for that}
    {"probe": scratch folder}                          ->   {"missing": what cannot be enforced}

When the master ends, so does this process, and with it its children.
"""

import gc
import json
import os
import signal
import socket
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NamedTuple, NoReturn

from gamms.child_processes import die_with_parent
from gamms.tournament.confinement import ControlGroups, Limits, confine

_STEP_S = 0.002
_FREE = 10  # from here on, descriptors are not those that a child is given
_IN, _OUT = 3, 4  # where a Python entry is asked and answers; its standard output is its log
_LONGEST = 1 << 16
_CRASHED = 70
_OF_LAUNCHER = 2  # processes beside the threads of an entry
_FIRST_TO_END = "1000"  # of all processes, where the kernel has to end one


class Setup(NamedTuple):
    """What a launcher needs to know of its entry.

    Attributes:
        command: a program and its arguments; none for Python.
        reference: `file.py:function` or `module:function`; "" for a program.
        readable: the files and folders that it may read.
        packages: the folders in which Python looks for modules of the entry.
        limits: the fields of `Limits`.
        threads: how many it may run.
        landlock: the version of Landlock to rely on.
        map: the file of the map, for Python.
        settings: of the game, for Python.
    """

    command: list[str]
    reference: str
    readable: list[str]
    packages: list[str]
    limits: list[int]
    threads: int
    landlock: int
    map: str
    settings: dict[str, Any]


def main(descriptor: int, master: int, setup: Setup) -> None:
    """Serve a master until it ends.

    Args:
        descriptor: of the socket to it.
        master: the id of its process.
        setup: what it has to know of its entry.
    """
    die_with_parent(master)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the master ends it
    control = socket.socket(fileno=descriptor)
    play: Callable[[int, int], None] | None = None
    if setup.reference:
        from gamms.tournament.host import host_of

        play = host_of(setup.reference, setup.packages, setup.map, setup.settings)
    gc.collect()
    gc.freeze()  # so that collections in children leave the shared pages alone
    memory = setup.limits[0] + setup.limits[0] // 8  # with what the kernel itself takes for the process
    groups = ControlGroups(memory, setup.threads + _OF_LAUNCHER)
    children: set[int] = set()
    try:
        while (message := _received(control)) is not None:
            request, files = message
            if "start" in request:
                id = _started(setup, request["start"], files, play, control)
                children.add(id)
                answer: dict[str, Any] = {"id": id}
            elif "end" in request:
                answer = _ended(request["end"], request["patience"], groups)
                children.discard(request["end"])
            else:
                answer = {"missing": _probed(setup, request["probe"])}
            with suppress(BrokenPipeError):  # where the master has ended
                control.sendall(json.dumps(answer).encode() + b"\n")
    finally:
        for id in children:
            _ended(id, 0.0, groups)


def _received(control: socket.socket) -> tuple[dict[str, Any], list[int]] | None:
    """Return the next message and the files that came with it; None: the master has ended."""
    data, files = b"", list[int]()
    while not data.endswith(b"\n"):
        part, more, _, _ = socket.recv_fds(control, _LONGEST, 3)
        if not part:
            return None
        data, files = data + part, files + more
    return json.loads(data), files


def _started(
    setup: Setup,
    scratch: str,
    files: list[int],
    play: "Callable[[int, int], None] | None",
    control: socket.socket,
) -> int:
    launcher = os.getpid()
    id = os.fork()
    if id:
        for file in files:
            os.close(file)
        return id
    try:
        control.detach()
        _become_entry(setup, scratch, files, launcher)
        if play is None:
            os.execv(setup.command[0], setup.command)  # noqa: S606 - what the caller enters, confined
        play(_IN, _OUT)
    except BaseException:  # noqa: BLE001 - nothing of the launcher may run in the child
        _end_with_traceback()
    finally:
        os._exit(0)


def _become_entry(setup: Setup, scratch: str, files: list[int], launcher: int) -> None:
    """Take on the files, the folder and the limits of an entry, and nothing else."""
    import fcntl

    os.setsid()
    die_with_parent(launcher)
    given, taken, log = (fcntl.fcntl(file, fcntl.F_DUPFD, _FREE) for file in files)
    os.dup2(log, 2)
    if setup.command:
        os.dup2(given, 0)
        os.dup2(taken, 1)
        os.closerange(3, os.sysconf("SC_OPEN_MAX"))
    else:
        os.dup2(2, 1)  # what it prints is its log
        os.dup2(given, _IN)
        os.dup2(taken, _OUT)
        os.closerange(5, os.sysconf("SC_OPEN_MAX"))
    os.chdir(scratch)
    os.environ.update(HOME=scratch, TMPDIR=scratch)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with suppress(OSError):  # not on this system
        Path("/proc/self/oom_score_adj").write_text(_FIRST_TO_END)
    confine(Limits(*setup.limits), setup.readable, scratch, setup.landlock)


def _end_with_traceback() -> NoReturn:
    traceback.print_exc()
    sys.stderr.flush()
    os._exit(_CRASHED)


def _ended(id: int, patience_s: float, groups: ControlGroups) -> dict[str, Any]:
    """End a child and its process group, after waiting for it to end by itself, and say how it did."""
    until, ended = monotonic() + patience_s, True
    while os.waitid(os.P_PID, id, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if monotonic() >= until:
            ended = False
            break
        sleep(_STEP_S)
    with suppress(ProcessLookupError):  # of one that has not begun a group yet
        os.killpg(id, signal.SIGKILL)  # with what it has started, where the system cannot forbid that
    os.kill(id, signal.SIGKILL)
    _, status, used = os.wait4(id, 0)
    cpu_s = used.ru_utime + used.ru_stime
    return {"status": status, "ended": ended, "cpu_s": cpu_s, "memory": groups.has_killed()}


def _probed(setup: Setup, scratch: str) -> list[str]:
    """Return what cannot be enforced on this system, as a child finds it."""
    read, write = os.pipe()
    id = os.fork()
    if not id:
        found = confine(Limits(*setup.limits), setup.readable, scratch, setup.landlock)
        os.write(write, json.dumps(found).encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as answer:
        missing: list[str] = json.loads(answer.read())
    os.waitpid(id, 0)
    return missing
