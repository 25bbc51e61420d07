"""The launcher of one entry: a process that forks a fresh, confined child for each game.

It knows the entry and the map but no game, so a child, which begins as its copy, finds no seed, opponent or state in
its memory. It has already imported the modules that Python entries need, so a child starts within milliseconds. Its
master sends one line of JSON at a time and gets one back:

    {"start": scratch folder}, with three open files   ->   {"id": of the process}
    {"end": id, "patience": seconds}                   ->   {"status": of waitpid, "ended": by itself, "cpu_s",
                                                             "memory": whether the kernel killed it for lack of it}
    {"probe": scratch folder}                          ->   {"missing": limits that cannot be enforced}

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

from gamms.tournament.confinement import ControlGroups, ProcessLimits, confine
from gamms.workers import die_with_parent

_STEP_S = 0.002
_FREE = 10  # lowest descriptor for temporary copies, above those that a child receives
_IN = 3  # descriptors for questions and answers of a Python entry; its standard output is its log
_OUT = 4
_LONGEST = 1 << 16
_CRASHED = 70
_OF_LAUNCHER = 2  # processes beside the threads of an entry
_FIRST_TO_END = "1000"  # out-of-memory score: the kernel kills the entry before any other process


class LauncherSetup(NamedTuple):
    """The description of an entry for its launcher.

    Attributes:
        command: a program and its arguments; empty for Python.
        reference: `file.py:function` or `module:function`; "" for a program.
        readable: the files and folders that the entry may read.
        packages: the folders in which Python looks for modules of the entry.
        limits: the fields of `ProcessLimits`.
        threads: the number of threads that the entry may run.
        landlock: the version of Landlock to rely on.
        map: the file of the map, for Python.
        settings: the settings of the game, for Python.
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


def main(descriptor: int, master: int, setup: LauncherSetup) -> None:
    """Serve a master until it ends.

    Args:
        descriptor: the file descriptor of the socket to the master.
        master: the process id of the master.
        setup: the description of the entry.
    """
    die_with_parent(master)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the master ends it
    control = socket.socket(fileno=descriptor)
    play: Callable[[int, int], None] | None = None
    gc.disable()  # until the modules are imported
    if setup.reference:
        from gamms.tournament.host import make_host

        play = make_host(setup.reference, setup.packages, setup.map, setup.settings)
    gc.collect()
    gc.freeze()  # so that garbage collection in children does not touch the shared pages
    gc.enable()
    memory = setup.limits[0] + setup.limits[0] // 8  # with the memory that the kernel itself takes for the process
    groups = ControlGroups(memory, setup.threads + _OF_LAUNCHER)
    children: set[int] = set()
    try:
        while (message := _receive(control)) is not None:
            request, files = message
            if "start" in request:
                id = _start_child(setup, request["start"], files, play, control)
                children.add(id)
                answer: dict[str, Any] = {"id": id}
            elif "end" in request:
                answer = _end_child(request["end"], request["patience"], groups)
                children.discard(request["end"])
            else:
                answer = {"missing": _probe_limits(setup, request["probe"])}
            with suppress(BrokenPipeError):  # the master has ended
                control.sendall(json.dumps(answer).encode() + b"\n")
    finally:
        for id in children:
            _end_child(id, 0.0, groups)


def _receive(control: socket.socket) -> tuple[dict[str, Any], list[int]] | None:
    """Return the next message and the files that came with it; None: the master has ended."""
    data = b""
    files = list[int]()
    while not data.endswith(b"\n"):
        part, more, _, _ = socket.recv_fds(control, _LONGEST, 3)
        if not part:
            return None
        data += part
        files += more
    return json.loads(data), files


def _start_child(
    setup: LauncherSetup,
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


def _become_entry(setup: LauncherSetup, scratch: str, files: list[int], launcher: int) -> None:
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
        os.dup2(2, 1)  # the entry's printed text is its log
        os.dup2(given, _IN)
        os.dup2(taken, _OUT)
        os.closerange(5, os.sysconf("SC_OPEN_MAX"))
    os.chdir(scratch)
    os.environ.update(HOME=scratch, TMPDIR=scratch)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with suppress(OSError):  # not on this system
        Path("/proc/self/oom_score_adj").write_text(_FIRST_TO_END)
    confine(ProcessLimits(*setup.limits), setup.readable, scratch, setup.landlock)


def _end_with_traceback() -> NoReturn:
    traceback.print_exc()
    sys.stderr.flush()
    os._exit(_CRASHED)


def _end_child(id: int, patience_s: float, groups: ControlGroups) -> dict[str, Any]:
    """Kill a child and its process group after a grace period, and return how it ended."""
    until = monotonic() + patience_s
    ended = True
    while os.waitid(os.P_PID, id, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        if monotonic() >= until:
            ended = False
            break
        sleep(_STEP_S)
    with suppress(ProcessLookupError):  # the child has not started a group yet
        os.killpg(id, signal.SIGKILL)  # with all processes that it started, where the system could not forbid that
    os.kill(id, signal.SIGKILL)
    _, status, used = os.wait4(id, 0)
    cpu_s = used.ru_utime + used.ru_stime
    return {"status": status, "ended": ended, "cpu_s": cpu_s, "memory": groups.has_killed()}


def _probe_limits(setup: LauncherSetup, scratch: str) -> list[str]:
    """Return the limits that cannot be enforced on this system, as determined in a child."""
    read, write = os.pipe()
    id = os.fork()
    if not id:
        found = confine(ProcessLimits(*setup.limits), setup.readable, scratch, setup.landlock)
        os.write(write, json.dumps(found).encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as answer:
        missing: list[str] = json.loads(answer.read())
    os.waitpid(id, 0)
    return missing
