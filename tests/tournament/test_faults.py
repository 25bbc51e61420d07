"""An entry that does what it may not loses that game, is named with its fault, and leaves nothing behind."""

import json
import os
import sys
import time
from pathlib import Path

import pytest

from gamms.scenario import Scenario
from gamms.tournament.entries import find_entries
from gamms.tournament.games import Fixture, play
from gamms.tournament.players import EntryFault, EntryProcess, Launcher, ResourceLimits
from gamms.tournament.table import count_points

# What each does in its second turn; the scenario says which, so that one launcher serves all tests.
IN_PYTHON = """
import ctypes, os, signal, sys, threading, time

kept = []

def hang():
    time.sleep(60)

def hang_and_ignore_signals():
    for number in (signal.SIGTERM, signal.SIGCONT, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)
    while True:
        pass

def burn():
    for _ in range(3):
        threading.Thread(target=lambda: [pow(3, 10**7) for _ in iter(int, 1)], daemon=True).start()
    while True:
        sum(range(10**6))

def eat():
    while True:
        kept.append(bytearray(1 << 25))

def exit():
    os._exit(0)

def leave():
    sys.exit(3)

def fail():
    raise ValueError("no idea")

def crash():
    ctypes.string_at(0)

def outlive():
    ctypes.CDLL(None).prctl(1, 0, 0, 0, 0)
    for number in range(3, 30):
        try:
            os.close(number)
        except OSError:
            pass
    time.sleep(60)

def fill():
    for number in range(200):
        with open(str(number), "wb") as file:
            file.write(bytes(1 << 20))
    time.sleep(60)

def babble():
    while True:
        sys.stderr.write("x" * 100_000)

def answer_garbage():
    os.write(4, b"no json\\n")

def decide(state):
    state["action"] = state["legal"][0]
    if state["turn"] == 1 and state["facts"]["deed"] == "both fail":
        fail()
    if state["turn"] == 1 and state["team"] == "red":
        chosen = globals().get(state["facts"]["deed"])
        if chosen is not None:
            chosen()
        if state["facts"]["deed"] == "cheat":
            state["action"] = 15
        if state["facts"]["deed"] == "say nothing":
            del state["action"]
"""
IN_ANY_LANGUAGE = """
import json, os, sys, time

def say(**message):
    print(json.dumps(message), flush=True)

deed = None
for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "start":
        say(type="ready")
        continue
    states = message["agents"]
    deed = next(iter(states.values()))["facts"]["deed"]
    actions = {name: state["legal"][0] for name, state in states.items()}
    if message["question"] == 2:
        if deed == "print a gigabyte":
            for _ in range(1 << 10):
                sys.stdout.write("x" * (1 << 20))
        elif deed == "print garbage":
            print("move north", flush=True)
        elif deed == "print numbers that no one can hold":
            print('{"type": "turn", "question": 2, "actions": {"red_0": ' + "9" * 10_000 + "}}", flush=True)
        elif deed == "print brackets":
            print("[" * 100_000, flush=True)
        elif deed == "answer the next question, too":
            both = [json.dumps({"type": "turn", "question": number, "actions": actions}) for number in (2, 3)]
            print("\\n".join(both), flush=True)
            continue
        elif deed == "answer another question":
            message["question"] = 3
        elif deed == "decide for others":
            actions["blue_0"] = 0
        elif deed == "choose lists of lists":
            actions = {name: [None, [1]] for name in states}
        elif deed == "close its input":
            os.close(0)
            say(type="turn", question=2, actions=actions)
            time.sleep(60)
        elif deed == "close its output":
            os.close(1)
            time.sleep(60)
        elif deed == "send a message":
            say(type="turn", question=2, actions=actions, outbox={"red_0": [{"channel": "radio", "body": 1}]})
            continue
    say(type="turn", question=message["question"], actions=actions)
"""


def stays(deed):
    """Return a game of three turns in which nothing happens but the deed of the red entry."""
    return Scenario(
        seed=1,
        max_turns=3,
        map={"grid": {"width": 4, "height": 4}},
        facts={"deed": deed},
        teams={name: {"agents": [{"name": f"{name}_0", "node": node}]} for name, node in (("red", 0), ("blue", 5))},
    )


OTHERS = []  # processes of other tests


@pytest.fixture(scope="module")
def launchers(tmp_path_factory):
    folder = tmp_path_factory.mktemp("entries")
    if sys.platform == "linux":  # whose names are bytes, and need not be UTF-8
        folder /= os.fsdecode(b"f\xfcr zwei")
        folder.mkdir()
    (folder / "entry.py").write_text(IN_PYTHON)
    (folder / "program.py").write_text(IN_ANY_LANGUAGE)
    given = {"python": "entry.py:decide", "program": [sys.executable, "-S", "-I", "program.py"]}
    entries = find_entries(given, folder, folder / "out", [])
    with stays("").build(seed=1) as ctx:
        ctx.graph.save(folder / "map.gamms")
    allowed = ResourceLimits(move_s=10.0, memory_bytes=256 << 20, cpu_s=20)
    (folder / "scratch").mkdir()
    OTHERS[:] = below(os.getpid())
    made = {one.name: Launcher(one, allowed, folder / "map.gamms", {}, folder / "scratch") for one in entries}
    yield made
    for launcher in made.values():
        launcher.close()


def below(process):
    """Return the processes that a process has begun."""
    return [
        int(one) for task in Path(f"/proc/{process}/task").iterdir() for one in (task / "children").read_text().split()
    ]


def descendants():
    """Return the processes below this one, but for those of other tests, such as a browser."""
    found = [one for one in below(os.getpid()) if one not in OTHERS]
    for one in found:  # which grows
        found += below(one)
    return found


def played(launchers, deed, entry, other="python", move_s=10.0):
    launchers[entry].allowed = launchers[entry].allowed._replace(move_s=move_s)
    row, logs = play(stays(deed), "secret", Fixture("id", {"red": entry, "blue": other}, 1, 1), launchers)
    assert len(descendants()) == len(launchers)
    assert not list(launchers[entry].scratch.iterdir())
    return row, logs


def test_entries_that_stay_play_to_the_end(launchers):
    row, logs = played(launchers, "nothing", "program")
    assert (row["reason"], row["turns"], row["faults"], row["winner"]) == ("max_turns", 3, {}, None)
    assert not any(logs.values())


CAN_CONFINE = pytest.mark.skipif(sys.platform != "linux", reason="confined on Linux alone")


@CAN_CONFINE
@pytest.mark.parametrize(
    ("deed", "kind"),
    [
        ("hang", "time"),
        ("hang_and_ignore_signals", "time"),
        ("burn", "time"),
        ("eat", "memory"),
        ("exit", "exit"),
        ("leave", "error"),
        ("fail", "error"),
        ("crash", "exit"),
        ("outlive", "exit"),
        ("fill", "files"),
        ("babble", "output"),
        ("answer_garbage", "garbage"),
        ("cheat", "illegal"),
        ("say nothing", "illegal"),
    ],
)
def test_a_python_entry_loses_by_its_fault(launchers, deed, kind):
    more = {"other": "program", "move_s": 1.0} if kind == "time" else {}  # which has ten seconds for a move
    row, _ = played(launchers, deed, "python", **more)
    assert (row["faults"], row["winner"]) == ({"red": kind}, "blue"), row["details"]
    assert row["turns"] == 2


@CAN_CONFINE
@pytest.mark.parametrize(
    ("deed", "kind"),
    [
        ("print a gigabyte", "output"),
        ("print garbage", "garbage"),
        ("print numbers that no one can hold", "garbage"),
        ("print brackets", "garbage"),
        ("answer the next question, too", "order"),
        ("answer another question", "order"),
        ("decide for others", "illegal"),
        ("choose lists of lists", "illegal"),
        ("close its input", "exit"),
        ("close its output", "exit"),
        ("send a message", "illegal"),
    ],
)
def test_a_program_loses_by_its_fault(launchers, deed, kind):
    row, _ = played(launchers, deed, "program")
    assert (row["faults"], row["winner"]) == ({"red": kind}, "blue"), row["details"]


def test_errors_of_an_entry_are_in_its_log_and_in_the_row(launchers):
    row, logs = played(launchers, "fail", "python")
    assert row["details"] == {"red": "ValueError: no idea"}
    assert b'raise ValueError("no idea")' in logs["red"]


def test_two_that_fail_in_the_same_turn_both_lose(launchers):
    row, _ = play(stays("both fail"), "secret", Fixture("id", {"red": "python", "blue": "python"}, 1, 1), launchers)
    assert (row["winner"], row["faults"]) == (None, {"red": "error", "blue": "error"})
    assert count_points({**row, "entries": {"red": "a", "blue": "b"}}) == {"a": 0.0, "b": 0.0}


def state_of(process):
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]


@CAN_CONFINE
def test_a_process_is_stopped_before_it_is_asked_and_after_a_fault(launchers):
    known = launchers["program"]
    known.allowed = known.allowed._replace(move_s=0.02)
    with EntryProcess(known) as player:
        for _ in range(2):
            until = time.monotonic() + 20.0
            while state_of(player._id) != "T" and time.monotonic() < until:
                time.sleep(0.001)
            assert state_of(player._id) == "T"
            with pytest.raises(EntryFault, match="longer than"):
                player.begin(b"half a line")


def test_a_launcher_whose_master_has_ended_ends_without_a_word(launchers, capfd):
    known = launchers["program"]
    launcher = Launcher(known.entry, known.allowed, known.scratch / "map.gamms", {}, known.scratch)
    probe = {"probe": str(known.scratch)}
    launcher._control.sendall(json.dumps(probe).encode() + b"\n")  # which is answered when nothing listens any more
    launcher.close()
    assert capfd.readouterr().err == ""
