"""The process of an entry in one game: questions, answers, limits and faults."""

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
from gamms.tournament.confinement import ProcessLimits, find_landlock_version, remove_empty_groups
from gamms.tournament.entries import Entry, list_python_folders
from gamms.tournament.launcher import LauncherSetup
from gamms.tournament.scratch import ScratchLimitExceeded, check_folder, remove_folder

FAULTS = {
    "start": "it did not get ready to play",
    "time": "it took longer than it may for a move",
    "memory": "it used more memory than it may",
    "cpu": "it used more processor time than it may",
    "output": "it wrote more than it may",
    "files": "it took more of the disk than it may",
    "garbage": "its answer was not valid",
    "order": "it answered without a question, or another question than the one asked",
    "process": "it started another process, or more threads than it may",
    "exit": "it ended, or closed its input or output",
    "error": "it raised an error",
    "illegal": "it chose an illegal action",
}
"""The faults by which an entry loses a game, and their meanings."""

MOST_LINE = 1 << 20  # bytes of an answer
MOST_LOG = 1 << 20  # bytes that an entry may write besides answers
_KEPT_LOG = 1 << 14  # bytes of the log that are kept
_MOST_THREADS = 256
_CHECK_INTERVAL_S = 0.02  # seconds between checks of memory, threads and files
_PART = 1 << 16
_PATIENCE_S = 0.2  # seconds for a process to end after it has closed its output
_START_MOVES = 10  # time to get ready, in multiples of the time for a move
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
from gamms.tournament.launcher import LauncherSetup, main
main(int(sys.argv[1]), int(sys.argv[2]), LauncherSetup(**json.loads(sys.argv[3])))
"""


class Fault(NamedTuple):
    """The fault of an entry: a key of `FAULTS`, and a description."""

    kind: str
    detail: str


class EntryFault(GammsError):
    """An entry has committed a fault."""

    def __init__(self, kind: str, detail: str = "") -> None:
        super().__init__(detail or FAULTS[kind])
        self.fault = Fault(kind, detail or FAULTS[kind])


class ResourceLimits(NamedTuple):
    """Resources that an entry may use.

    Attributes:
        move_s: seconds of wall-clock time for a move.
        memory_bytes: bytes of memory.
        cpu_s: seconds of processor time in a game.
    """

    move_s: float
    memory_bytes: int
    cpu_s: int


class _ReadyMessage(msgspec.Struct, tag="ready", tag_field="type"):
    """The entry is ready for questions."""


class _FailedMessage(msgspec.Struct, tag="failed", tag_field="type"):
    """A Python entry has raised an error."""

    kind: str
    message: str


class Answer(msgspec.Struct, tag="turn", tag_field="type"):
    """The answer of an entry: its agents' actions and messages.

    Attributes:
        question: the number of the question.
        actions: agent -> action, as in `state["action"]`.
        outbox: agent -> messages, as in `state["outbox"]`.
    """

    question: int
    actions: dict[str, Any]  # Any: the game decides which actions are legal
    outbox: dict[str, list[Any]] = {}


_decoder = msgspec.json.Decoder(_ReadyMessage | _FailedMessage | Answer)


class Launcher:
    """Starts processes of an entry.

    Args:
        entry: the entry.
        allowed: the resources that it may use.
        map: the file of the map.
        settings: the settings of the game, as plain values.
        scratch: the folder that gets a subfolder for each process.
    """

    def __init__(
        self, entry: Entry, allowed: ResourceLimits, map: Path, settings: Mapping[str, Any], scratch: Path
    ) -> None:
        self.entry = entry
        self.allowed = allowed
        self.scratch = scratch
        ours, theirs = socket.socketpair()
        is_python = not entry.command
        python = list_python_folders() if is_python else []
        limits = ProcessLimits(allowed.memory_bytes, allowed.cpu_s)
        of_package = is_python and ".py:" not in entry.reference
        setup = LauncherSetup(
            command=list(entry.command),
            reference=entry.reference,
            readable=[*python, *entry.readable, *([str(map)] if is_python else [])],
            packages=[str(Path(one).parent) for one in entry.readable] if of_package else [],
            limits=list(limits),
            threads=_MOST_THREADS,
            landlock=find_landlock_version(),
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

    def request(self, message: Mapping[str, object], files: tuple[int, ...] = ()) -> dict[str, Any]:
        """Send a message to the launcher and return its answer; see `launcher.py`."""
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

    def list_missing(self) -> list[str]:
        """Return the limits that this system cannot enforce."""
        with tempfile.TemporaryDirectory(dir=self.scratch) as scratch:
            found: list[str] = self.request({"probe": scratch})["missing"]
        return found

    def close(self) -> None:
        """End the launcher and all processes that it started."""
        self._control.close()
        self._process.wait()
        remove_empty_groups()


class EntryProcess:
    """The process of an entry in one game; use it in a `with` statement.

    Args:
        launcher: the launcher of the entry.

    Attributes:
        launcher: see above.
        scratch: the folder of the process.
        log: the beginning of its output besides answers.
    """

    def __init__(self, launcher: Launcher) -> None:
        self.launcher = launcher
        self._allowed = launcher.allowed
        self.scratch = tempfile.mkdtemp(dir=launcher.scratch)
        os.utime(self.scratch, (0, 0))  # any other time shows that the process has written something
        self._waiting = b""
        self.log = b""
        self._logged = 0
        self._pipes: dict[str, int] = {}
        self._is_over = False
        try:
            given, self._pipes["in"] = os.pipe()
            self._pipes["out"], taken = os.pipe()
            self._pipes["log"], log = os.pipe()
            self._id: int = launcher.request({"start": self.scratch}, (given, taken, log))["id"]
            self._stop()
            for file in (given, taken, log):
                os.close(file)
            for file in self._pipes.values():
                os.set_blocking(file, False)
        except BaseException:
            remove_folder(self.scratch)
            raise

    def begin(self, message: bytes) -> None:
        """Send the start message, and wait until the entry is ready.

        Raises:
            EntryFault: the entry does not get ready.
        """
        with self._run_process():
            answer = self._answer(message, self._allowed.move_s * _START_MOVES)
        if not isinstance(answer, _ReadyMessage):
            raise EntryFault("start", "it has not said that it is ready")

    def ask(self, message: bytes, question: int) -> Answer:
        """Send a question and return the entry's answer.

        Raises:
            EntryFault: the entry does not answer, or breaks a limit.
        """
        with self._run_process():
            self._read("out", MOST_LINE)  # a waiting line is a fault: the question is not even sent
            answer = self._answer(message, self._allowed.move_s)
        if not isinstance(answer, Answer) or answer.question != question:
            raise EntryFault("order", f"it did not answer question {question}")
        return answer

    @contextmanager
    def _run_process(self) -> Iterator[None]:
        """Run the process only within the `with` block, so that it takes no time from its opponent."""
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
            with suppress(EntryFault):
                self._read("log", MOST_LOG)
            if not self._is_over:
                self._end(0.0)
        finally:
            for file in self._pipes.values():
                os.close(file)
            remove_folder(self.scratch)

    def _answer(self, message: bytes, seconds: float) -> object:
        try:
            return _parse_line(self._exchange_line(message, seconds))
        except BrokenPipeError:
            raise self._make_end_fault("input") from None

    def _exchange_line(self, message: bytes, seconds: float) -> bytes:
        """Send bytes and return the line that comes back."""
        until = monotonic() + seconds
        unsent = memoryview(message)
        while b"\n" not in self._waiting:
            left = until - monotonic()
            if left <= 0.0:
                raise EntryFault("time", f"it took longer than {seconds:g} s")
            writing = [self._pipes["in"]] if unsent else []
            reading = [self._pipes["out"], *([self._pipes["log"]] if "log" in self._pipes else [])]
            readable, writable, _ = select.select(reading, writing, [], min(left, _CHECK_INTERVAL_S))
            if writable:
                with suppress(BlockingIOError):
                    unsent = unsent[os.write(self._pipes["in"], unsent[:_PART]) :]
            if self._pipes.get("log") in readable:
                self._read("log", MOST_LOG)
            if self._pipes["out"] in readable and not self._read("out", MOST_LINE):
                raise self._make_end_fault("output")
            self._check_limits()
        line, _, self._waiting = self._waiting.partition(b"\n")
        if unsent:
            raise EntryFault("order", "it answered before it had read the question")
        return line

    def _read(self, pipe: str, most: int) -> bool:
        """Read the available bytes from a pipe; return whether the pipe is open."""
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
                    raise EntryFault("output", f"its answer is longer than {most:,} bytes")
                if b"\n" in data:
                    return True
            else:
                self.log += data[: _KEPT_LOG - len(self.log)]
                self._logged += len(data)
                if self._logged > most:
                    raise EntryFault("output", f"its log is longer than {most:,} bytes")
        return False

    def _check_limits(self) -> None:
        """Check the limits that the system enforces only in part: memory, threads and files."""
        with suppress(OSError):  # not on this system, or the process has ended
            status = Path(f"/proc/{self._id}/status").read_bytes()
            if sum(map(int, _IN_MEMORY.findall(status))) << 10 > self._allowed.memory_bytes:
                raise EntryFault("memory")
            threads = _THREADS.search(status)
            if threads is not None and int(threads[1]) > _MOST_THREADS:
                raise EntryFault("process", f"it started more than {_MOST_THREADS} threads")
        if Path(self.scratch).stat().st_mtime_ns != 0:
            try:
                check_folder(self.scratch, self._id)
            except ScratchLimitExceeded as error:
                raise EntryFault("files", str(error)) from None

    def _make_end_fault(self, what: str) -> EntryFault:
        """Return the fault of a process that has closed a pipe."""
        with suppress(EntryFault):
            self._read("log", MOST_LOG)
        end = self._end(_PATIENCE_S)
        if not end["ended"]:
            return EntryFault("exit", f"it closed its {what}")
        status = end["status"]
        if end["memory"]:
            return EntryFault("memory")
        if os.WIFSIGNALED(status):
            number = os.WTERMSIG(status)
            name = _SIGNALS.get(number, f"signal {number}")
            if end["cpu_s"] >= self._allowed.cpu_s:
                return EntryFault("cpu")
            return EntryFault(*((_BY_SIGNAL[name],) if name in _BY_SIGNAL else ("exit", f"it was ended by {name}")))
        return EntryFault("exit", f"it ended with the exit code {os.WEXITSTATUS(status)}")

    def _end(self, patience_s: float) -> dict[str, Any]:
        self._is_over = True
        with suppress(ProcessLookupError):
            os.kill(self._id, signal.SIGCONT)
        return self.launcher.request({"end": self._id, "patience": patience_s})


def _parse_line(line: bytes) -> object:
    try:
        answer = _decoder.decode(line)
    except (msgspec.MsgspecError, UnicodeError, RecursionError, ValueError) as error:
        raise EntryFault("garbage", f"it answered {line[:60]!r}: {str(error)[:200]}") from None
    if isinstance(answer, _FailedMessage):
        raise EntryFault(answer.kind if answer.kind in ("memory", "error") else "garbage", answer.message)
    return answer
