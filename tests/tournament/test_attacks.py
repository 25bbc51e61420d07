"""No hostile entry wins, changes what is the organizer's, exceeds its limits, or ends a tournament.

Each attack of attacks.py is a game against an honest entry, played by the user who runs the tests, and, where that is
root, by an unprivileged user as well.
"""

import ctypes
import json
import os
import runpy
import socket
import subprocess
import sys
import tempfile
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

import gamms
from gamms.scenario import Scenario
from gamms.tournament import players
from gamms.tournament.entries import find_entries
from gamms.tournament.games import Fixture, play
from gamms.tournament.players import Launcher, ResourceLimits
from gamms.tournament.scratch import remove_folder

if sys.platform != "linux":
    pytest.skip("entries are confined on Linux alone", allow_module_level=True)

FILE = Path(__file__).with_name("attacks.py")
ATTACKS = runpy.run_path(str(FILE))
SECRET = "the organizer's"
NOBODY = 65534

# By what each attack of `DONE` loses: one of these faults.
LOSES_BY = {
    "all that is refused": ["error"],
    "deleted files": ["files"],
    "deleted mappings": ["files"],
    "sparse files": ["files"],
    "empty files": ["files"],
    "folders": ["files"],
    "nested folders": ["files"],
    "long names": ["files"],
    "a hidden folder": ["files"],
    "masked modes": ["files", "time"],  # root may read such folders
    "threads": ["process", "error"],  # where a control group refuses them
    "private pages": ["memory", "error"],
    "page tables": ["memory", "error"],
    "pages of files": ["memory"],
    "a thread with files of its own": ["process"],
    "fork": ["process"],
    "vfork": ["process"],
    "spawn": ["process"],
    "another program": ["exit"],
    "a fault of 900 KB": ["error"],
    "an unknown fault": ["garbage"],
    "escape codes": ["error"],
    "a real-time signal": ["exit"],
    "stop itself": ["time"],
    "kill itself": ["exit"],
    "never answer": ["time"],
    "answer at length": ["output"],
    "answer nothing": ["garbage"],
    "answer deep": ["garbage"],
    "act deep": ["illegal"],
    "act with a long number": ["illegal", "garbage"],
    "act with no number": ["illegal", "garbage"],
    "act with half a letter": ["illegal", "garbage"],
    "act for half a letter": ["illegal", "garbage"],
    "say something deep": ["illegal", "garbage"],
    "say half a letter": ["illegal", "garbage"],
    "say no message": ["illegal"],
    "say it often": ["time"],
}


class Arena:
    """Plays attacks, one game each, and tells what came of them.

    Args:
        folder: an empty folder for all that is written.
        landlock: the version of Landlock to rely on; None: that of the system.
    """

    def __init__(self, folder, landlock=None):
        self.out = folder / "out"
        self.out.mkdir()
        self.record = folder / "game.ggr"
        self.file = self.out / "file"
        self.file.write_text(SECRET)
        self.file.chmod(0o640)
        self.before = self.state()
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self.socket.bind(str(folder / "socket"))
        (folder / "socket").chmod(0o777)
        self.facts = {"file": str(self.file), "out": str(self.out), "socket": str(folder / "socket")}
        (folder / "attacks.py").write_text(FILE.read_text())
        entries = find_entries({"bad": "attacks.py:decide", "good": "attacks.py:stay"}, folder, self.out, [])
        with self.game("").build(seed=1) as ctx:
            ctx.graph.save(folder / "map.gamms")
        allowed = ResourceLimits(move_s=20.0, memory_bytes=192 << 20, cpu_s=20)
        self.scratch = self.out / "scratch"
        self.copies = set(self.scratch.iterdir())
        with pytest.MonkeyPatch.context() as patch:
            if landlock is not None:
                patch.setattr(players, "find_landlock_version", lambda: landlock)
            self.launchers = {
                one.name: Launcher(one, allowed, folder / "map.gamms", {}, self.scratch) for one in entries
            }

    def game(self, deed):
        """Return a game of three turns in which nothing happens but the deed of red."""
        return Scenario(
            seed=1,
            max_turns=3,
            map={"grid": {"width": 4, "height": 4}},
            facts={**self.facts, "deed": deed},
            channels={"radio": {"range_m": 1000}},
            teams={name: {"count": 2} for name in ("red", "blue")},
        )

    def state(self):
        """Return all that must not change."""
        status = self.file.stat()
        return [self.file.read_text(), status.st_mode, status.st_uid, status.st_mtime_ns, status.st_nlink]

    def played(self, deed):
        """Play an attack; return its row, and what it has changed."""
        bad = self.launchers["bad"]
        bad.allowed = bad.allowed._replace(move_s=0.5 if "time" in LOSES_BY.get(deed, []) else 20.0)
        row, _ = play(
            self.game(deed), "secret", Fixture("id", {"red": "bad", "blue": "good"}, 1, 1), self.launchers, self.record
        )
        changes = [] if self.state() == self.before else ["the file"]
        with suppress(BlockingIOError):
            changes.append(f"received {self.socket.recv(100)}")
        changes += map(str, set(self.scratch.iterdir()) - self.copies)
        changes += map(str, {*self.out.iterdir()} - {self.file, self.scratch})
        changes += [f"process {one}" for launcher in self.launchers.values() for one in children_of(launcher)]
        return {**row, "changes": changes}

    def close(self):
        """End the launchers."""
        for launcher in self.launchers.values():
            launcher.close()
        self.socket.close()


class ArenaOfNobody:
    """Plays attacks in a process of an unprivileged user."""

    def __init__(self, folder):
        os.chown(folder, NOBODY, NOBODY)
        code = "import runpy, sys; runpy.run_path(sys.argv[1])['serve'](sys.argv[2])"
        words = [sys.executable, "-c", code, __file__, str(folder)]
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def played(self, deed):
        """See `Arena`."""
        print(json.dumps(deed), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())

    def close(self):
        """End the process."""
        self._process.communicate()


def serve(folder):
    """Play the attacks that standard input names, as an unprivileged user."""
    become_nobody()
    arena = Arena(Path(folder))
    for line in sys.stdin:
        print(json.dumps(arena.played(json.loads(line))), flush=True)  # noqa: T201 - its answer
    arena.close()


def children_of(launcher):
    process = launcher._process.pid
    return Path(f"/proc/{process}/task/{process}/children").read_text().split()


def become_nobody():
    """Give up being root; what Python needs stays in reach, also in folders that others cannot enter."""
    needed = {Path(one) for one in (sys.base_prefix, sys.prefix, FILE.parents[2], gamms.__path__[0])}
    ways = [[above for above in reversed(one.parents) if not above.stat().st_mode & 1] for one in needed]
    closed = {way[0] for way in ways if way}
    libc = ctypes.CDLL(None, use_errno=True)

    def mount(source, target, kind, flags, data=None):
        if libc.mount(os.fsencode(source), os.fsencode(target), kind, flags, data) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))

    if closed:  # the mounts that follow are those of this process
        assert libc.unshare(0x20000) == 0
        mount("none", "/", None, 0x44000)
    for top in closed:
        inside = {one: os.open(one, os.O_PATH) for one in sorted(needed) if one.is_relative_to(top)}
        mount("tmpfs", top, b"tmpfs", 0, b"mode=755")
        for place, opened in inside.items():
            place.mkdir(parents=True, exist_ok=True)
            mount(f"/proc/self/fd/{opened}", place, None, 0x5000)
            os.close(opened)
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)
    os.environ["HOME"] = "/"


@contextmanager
def arena_of(kind, **options):
    with ExitStack() as things:
        folder = Path(tempfile.mkdtemp())
        things.callback(remove_folder, folder)
        arena = kind(folder, **options)
        things.callback(arena.close)
        yield arena


@pytest.fixture(scope="module", params=["this user", "nobody"])
def arena(request):
    if request.param == "nobody" and os.getuid() != 0:
        pytest.skip("the tests run as an unprivileged user")
    with arena_of(Arena if request.param == "this user" else ArenaOfNobody) as made:
        yield made


@pytest.mark.parametrize("deed", ATTACKS["DONE"])
def test_an_entry_loses_by_its_own_faults(arena, deed):
    row = arena.played(deed)
    assert row["faults"].get("red") in LOSES_BY[deed], row["details"]
    assert (row["winner"], row["changes"]) == ("blue", [])
    assert len(row["details"]["red"]) <= 1000
    assert deed != "all that is refused" or row["details"] == {"red": "RuntimeError: not refused: []"}
    assert row["details"]["red"].replace("\n", "").isprintable()


@pytest.mark.parametrize("version", [1, 2, 5])
def test_an_older_landlock_lets_an_entry_do_no_more(version):
    with arena_of(Arena, landlock=version) as arena:
        test_an_entry_loses_by_its_own_faults(arena, "all that is refused")
