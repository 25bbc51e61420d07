"""An entry in a game: its process, what it is asked and answers, its limits, and by which fault it loses."""

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple, Self

import msgspec

from gamms.errors import GammsError
from gamms.tournament.confinement import Limits, landlock_version, remove_empty_groups
from gamms.tournament.entries import Entry, python_folders
from gamms.tournament.launcher import Setup
from gamms.tournament.scratch import Overfull, check_folder, remove_folder

FAULTS = {
    "start": "it did not get ready to play",
    "time": "it took longer than it may for a move",
    "memory": "it used more memory than it may",
    "cpu": "it used more processor time than it may",
    "output": "it wrote more than it may",
    "files": "it took more of the disk than it may",
    "garbage": "it answered with what is no answer",
    "order": "it answered when it was not asked, or not what it was asked",
    "process": "it started another process, or more threads than it may",
    "exit": "it ended, or closed its input or output",
    "error": "it raised an error",
    "illegal": "it chose what is not legal",
}
"""By what an entry loses a game, and what that means."""

MOST_LINE = 1 << 20  # bytes of an answer
MOST_LOG = 1 << 20  # bytes that it may write besides
_KEPT_LOG = 1 << 14  # bytes of these that are kept
_MOST_THREADS = 256
_LOOK_S = 0.02  # how often memory, threads and files are looked at
_PART = 1 << 16
_PATIENCE_S = 0.2  # for a process that has closed its output, to end
_START_MOVES = 10  # how many times longer than a move it may take to get ready
_BY_SIGNAL = {"SIGSYS": "process", "SIGXCPU": "cpu", "SIGXFSZ": "files"}
_IN_MEMORY = re.compile(rb"^(?:VmRSS|VmPTE|VmSwap):\s*(\d+) kB$", re.MULTILINE)
_THREADS = re.compile(rb"^Threads:\s*(\d+)$", re.MULTILINE)
_SIGNALS = {one.value: one.name for one in signal.Signals}
_ENVIRONMENT = {
    "LANG": "C.UTF-8",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "PATH": os.defpath,
    "PYTHONDONTWRITEBYTECODE": "1",
    "PYTHONHASHSEED": "0",
}
_MAIN = """
import json, signal, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)  # the master ends it, also while it imports
sys.path[:0] = sys.argv[4:]  # where GAMMS is
from gamms.tournament.launcher import Setup, main
main(int(sys.argv[1]), int(sys.argv[2]), Setup(**json.loads(sys.argv[3])))
"""


class Fault(NamedTuple):
    """Why an entry has lost: a key of `FAULTS`, and what exactly."""

    kind: str
    detail: str


class Faulty(GammsError):
    """An entry has done what it may not."""

    def __init__(self, kind: str, detail: str = "") -> None:
        super().__init__(detail or FAULTS[kind])
        self.fault = Fault(kind, detail or FAULTS[kind])


class Allowed(NamedTuple):
    """What an entry may take.

    Attributes:
        move_s: seconds for a move, by the clock on the wall.
        memory_bytes: of memory.
        cpu_s: seconds of processor time in a game.
    """

    move_s: float
    memory_bytes: int
    cpu_s: int


class _Ready(msgspec.Struct, tag="ready", tag_field="type"):
    """The entry can be asked."""


class _Failed(msgspec.Struct, tag="failed", tag_field="type"):
    """A Python entry has raised an error."""

    kind: str
    message: str


class Answer(msgspec.Struct, tag="turn", tag_field="type"):
    """What an entry's agents do.

    Attributes:
        question: the number of the question.
        actions: agent -> as `state["action"]`.
        outbox: agent -> messages, as `state["outbox"]`.
    """

    question: int
    actions: dict[str, Any]  # Any: the game says what is legal
    outbox: dict[str, list[Any]] = {}


_decoder = msgspec.json.Decoder(_Ready | _Failed | Answer)


class Launcher:
    """Starts processes of an entry.

    Args:
        entry: the entry.
        allowed: what it may take.
        map: the file of the map.
        settings: of the game, as plain values.
        scratch: the folder in which each of its processes gets a folder of its own.
    """

    def __init__(self, entry: Entry, allowed: Allowed, map: Path, settings: Mapping[str, Any], scratch: Path) -> None:
        self.entry, self.allowed, self.scratch = entry, allowed, scratch
        ours, theirs = socket.socketpair()
        is_python = not entry.command
        python = python_folders() if is_python else []
        limits = Limits(allowed.memory_bytes, allowed.cpu_s)
        of_package = is_python and ".py:" not in entry.reference
        setup = Setup(
            command=list(entry.command),
            reference=entry.reference,
            readable=[*python, *entry.readable, *([str(map)] if is_python else [])],
            packages=[str(Path(one).parent) for one in entry.readable] if of_package else [],
            limits=list(limits),
            threads=_MOST_THREADS,
            landlock=landlock_version(),
            map=str(map),
            settings=dict(settings),
        )
        root = str(Path(__file__).resolve().parents[2])
        with theirs:
            given = [str(theirs.fileno()), str(os.getpid()), json.dumps(setup._asdict())]
            words = [sys.executable, "-I", "-c", _MAIN, *given, root]
            self._process = subprocess.Popen(  # noqa: S603 - our own code
                words,
                env=_ENVIRONMENT,
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                start_new_session=True,
            )
        self._control = ours

    def asked(self, message: Mapping[str, object], files: tuple[int, ...] = ()) -> dict[str, Any]:
        """Send a message, and return the answer; see `launcher.py`."""
        socket.send_fds(self._control, [json.dumps(message).encode() + b"\n"], files)
        data = b""
        while not data.endswith(b"\n"):
            part = self._control.recv(_PART)
            if not part:
                raise GammsError(
                    f"The process that starts the entry {self.entry.name!r} has ended; see its error above."
                )
            data += part
        answer: dict[str, Any] = json.loads(data)
        return answer

    def missing(self) -> list[str]:
        """Return what this system cannot enforce."""
        with tempfile.TemporaryDirectory(dir=self.scratch) as scratch:
            found: list[str] = self.asked({"probe": scratch})["missing"]
        return found

    def close(self) -> None:
        """End the launcher, and what it has started."""
        self._control.close()
        self._process.wait()
        remove_empty_groups()


class Player:
    """A process of an entry, for one game; use it in a `with` statement.

    Args:
        launcher: of the entry.

    Attributes:
        launcher: of the entry.
        scratch: the folder of the process.
        log: the beginning of what it has written besides its answers.
    """

    def __init__(self, launcher: Launcher) -> None:
        self.launcher, self._allowed = launcher, launcher.allowed
        self.scratch = tempfile.mkdtemp(dir=launcher.scratch)
        os.utime(self.scratch, (0, 0))  # so that any other time says that something was written
        self._waiting, self.log, self._logged = b"", b"", 0
        self._pipes: dict[str, int] = {}
        self._is_over = False
        try:
            given, self._pipes["in"] = os.pipe()
            self._pipes["out"], taken = os.pipe()
            self._pipes["log"], log = os.pipe()
            self._id: int = launcher.asked({"start": self.scratch}, (given, taken, log))["id"]
            self._stop()
            for file in (given, taken, log):
                os.close(file)
            for file in self._pipes.values():
                os.set_blocking(file, False)
        except BaseException:
            remove_folder(self.scratch)
            raise

    def begin(self, message: bytes) -> None:
        """Say what is played, and wait until it is ready.

        Raises:
            Faulty: it does not get ready.
        """
        with self._running():
            answer = self._answer(message, self._allowed.move_s * _START_MOVES)
        if not isinstance(answer, _Ready):
            raise Faulty("start", "it has not said that it is ready")

    def ask(self, message: bytes, question: int) -> Answer:
        """Return what it answers to a question.

        Raises:
            Faulty: it does not, or what it does is against the rules.
        """
        with self._running():
            self._read("out", MOST_LINE)  # a line that is there already is a fault: the question is not even sent
            answer = self._answer(message, self._allowed.move_s)
        if not isinstance(answer, Answer) or answer.question != question:
            raise Faulty("order", f"it did not answer question {question}")
        return answer

    @contextmanager
    def _running(self) -> Iterator[None]:
        """Let the process run in the `with` block alone: it takes no time from its opponent, and nothing unseen."""
        os.kill(self._id, signal.SIGCONT)
        try:
            yield
        finally:
            if not self._is_over:
                self._stop()

    def _stop(self) -> None:
        os.kill(self._id, signal.SIGSTOP)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            with suppress(Faulty):
                self._read("log", MOST_LOG)
            if not self._is_over:
                self._ended(0.0)
        finally:
            for file in self._pipes.values():
                os.close(file)
            remove_folder(self.scratch)

    def _answer(self, message: bytes, seconds: float) -> object:
        try:
            return _parsed(self._line(message, seconds))
        except BrokenPipeError:
            raise self._end_fault("input") from None

    def _line(self, message: bytes, seconds: float) -> bytes:
        """Send bytes, and return the line that comes back."""
        until, unsent = monotonic() + seconds, memoryview(message)
        while b"\n" not in self._waiting:
            left = until - monotonic()
            if left <= 0.0:
                raise Faulty("time", f"it took longer than {seconds:g} s")
            writing = [self._pipes["in"]] if unsent else []
            reading = [self._pipes["out"], *([self._pipes["log"]] if "log" in self._pipes else [])]
            readable, writable, _ = select.select(reading, writing, [], min(left, _LOOK_S))
            if writable:
                with suppress(BlockingIOError):
                    unsent = unsent[os.write(self._pipes["in"], unsent[:_PART]) :]
            if self._pipes.get("log") in readable:
                self._read("log", MOST_LOG)
            if self._pipes["out"] in readable and not self._read("out", MOST_LINE):
                raise self._end_fault("output")
            self._look()
        line, _, self._waiting = self._waiting.partition(b"\n")
        if unsent:
            raise Faulty("order", "it answered before it had read the question")
        return line

    def _read(self, pipe: str, most: int) -> bool:
        """Take what has come by a pipe; return whether it is open."""
        while "log" in self._pipes or pipe != "log":
            try:
                data = os.read(self._pipes[pipe], _PART)
            except BlockingIOError:
                return True
            if not data:
                if pipe == "log":
                    os.close(self._pipes.pop("log"))
                return False
            if pipe == "out":
                self._waiting += data
                if len(self._waiting) > most:
                    raise Faulty("output", f"its answer is longer than {most:,} bytes")
                if b"\n" in data:
                    return True
            else:
                self.log += data[: _KEPT_LOG - len(self.log)]
                self._logged += len(data)
                if self._logged > most:
                    raise Faulty("output", f"its log is longer than {most:,} bytes")
        return False

    def _look(self) -> None:
        """Check what the system bounds only in part: memory, threads, and what is on the disk."""
        with suppress(OSError):  # not on this system, or the process has ended
            status = Path(f"/proc/{self._id}/status").read_bytes()
            if sum(map(int, _IN_MEMORY.findall(status))) << 10 > self._allowed.memory_bytes:
                raise Faulty("memory")
            threads = _THREADS.search(status)
            if threads is not None and int(threads[1]) > _MOST_THREADS:
                raise Faulty("process", f"it started more than {_MOST_THREADS} threads")
        if Path(self.scratch).stat().st_mtime_ns != 0:
            try:
                check_folder(self.scratch, self._id)
            except Overfull as error:
                raise Faulty("files", str(error)) from None

    def _end_fault(self, what: str) -> Faulty:
        """Return why a process that does not talk any more has ended."""
        with suppress(Faulty):
            self._read("log", MOST_LOG)
        end = self._ended(_PATIENCE_S)
        if not end["ended"]:
            return Faulty("exit", f"it closed its {what}")
        status = end["status"]
        if end["memory"]:
            return Faulty("memory")
        if os.WIFSIGNALED(status):
            number = os.WTERMSIG(status)
            name = _SIGNALS.get(number, f"signal {number}")
            if end["cpu_s"] >= self._allowed.cpu_s:
                return Faulty("cpu")
            return Faulty(*((_BY_SIGNAL[name],) if name in _BY_SIGNAL else ("exit", f"it was ended by {name}")))
        return Faulty("exit", f"it ended with the exit code {os.WEXITSTATUS(status)}")

    def _ended(self, patience_s: float) -> dict[str, Any]:
        self._is_over = True
        with suppress(ProcessLookupError):
            os.kill(self._id, signal.SIGCONT)
        return self.launcher.asked({"end": self._id, "patience": patience_s})


def _parsed(line: bytes) -> object:
    try:
        answer = _decoder.decode(line)
    except (msgspec.MsgspecError, UnicodeError, RecursionError, ValueError) as error:
        raise Faulty("garbage", f"it answered {line[:60]!r}: {str(error)[:200]}") from None
    if isinstance(answer, _Failed):
        raise Faulty(answer.kind if answer.kind in ("memory", "error") else "garbage", answer.message)
    return answer
