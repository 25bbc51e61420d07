"""What an entry is, what it is shown, and what it is not."""

import json
import re
import shutil
import sys
from pathlib import Path

import pytest

from gamms.errors import BadValue
from gamms.scenario import Scenario, ScenarioError
from gamms.tournament import run
from gamms.tournament.entries import find_entries

PAGE = (Path(__file__).parents[2] / "docs" / "tournaments.md").read_text()
STAY = "def stay(state):\n    state['action'] = state['curr_pos']\n"


def grid(**changes):
    return Scenario(
        seed=3,
        max_turns=4,
        map={"grid": {"width": 4, "height": 4}},
        sensors={"eyes": {"type": "AGENT_RANGE", "sensor_range": 15}},
        teams={name: {"count": 2, "sensors": ["eyes"], "meta": {"key": name}} for name in ("red", "blue")},
        facts={"hint": 4},
        **changes,
    )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stay.py").write_text(STAY)
    return tmp_path


def faults(table):
    return {one.entry: one.faults for one in table.standings()}


def test_an_entry_may_read_its_folder_but_not_that_of_others(folder):
    (folder / "alone").mkdir()
    (folder / "alone" / "alone.py").write_text(STAY)
    (folder / "other.py").write_text(STAY)
    given = {"a": "alone/alone.py:stay", "b": "stay.py:stay", "c": "other.py:stay"}
    own, *shared = find_entries(given, folder, folder / "out", [])
    assert own.readable == (str(folder / "alone"),)
    for one, name in zip(shared, ("stay.py", "other.py"), strict=True):
        assert [file.name for file in Path(one.readable[0]).iterdir()] == [name]


def test_the_digest_follows_from_the_files_of_an_entry_not_from_where_they_are(folder):
    for name in ("one", "two", "three"):
        (folder / name).mkdir()
        (folder / name / "stay.py").write_text(STAY + ("\n" if name == "three" else ""))
    given = {name: f"{name}/stay.py:stay" for name in ("one", "two", "three")}
    digests = {one.name: one.digest for one in find_entries(given, folder, folder / "out", [])}
    assert digests["one"] == digests["two"] != digests["three"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"a": "stay.py:stay"}, "two entries at least, not 1"),
        ({"a": "stay.py:stay", "b": ["no-such-program"]}, "starts 'no-such-program', and there is no such program"),
        ({"a": "stay.py:stay", "b": []}, "The entry 'b' is empty"),
        ({"a": "stay.py:stay", "b": "stay.py"}, "'b' needs the name of a function in 'stay.py'"),
    ],
)
def test_an_invalid_entry_is_refused(folder, given, message):
    with pytest.raises(BadValue, match=message):
        find_entries(given, folder, folder / "out", [])


def test_a_function_that_is_not_there_is_an_error_before_any_game(folder):
    with pytest.raises(ScenarioError, match="the entry 'b': there is no function 'sty'"):
        run(grid(), entries={"a": "stay.py:stay", "b": "stay.py:sty"}, seeds=[1], out="out")


LOOKS = """
import os
from pathlib import Path

HERE = Path(__file__).resolve()
FOUND = []

def tried(deed, *of):
    try:
        FOUND.append((deed.__name__, deed(*of)))
    except OSError:
        pass

def look(ctx):
    out = next(one for one in HERE.parents if one.name == "out")
    for folder in (HERE.parent.parent, out, out / "entries", out.parent, Path.home().parent):
        tried(os.listdir, folder)
    for place in ("entries/00", "entries/01", "scratch/00", "scratch/01", "entries"):
        tried(os.stat, out / place)
    tried(os.rename, HERE, HERE.with_name("other"))
    tried(os.unlink, HERE)
    tried(open, HERE, "a")
    assert FOUND == [], FOUND

    def stay(state):
        state["action"] = state["curr_pos"]

    return stay
"""


def test_copies_of_entries_are_out_of_reach_while_they_play_and_published_afterwards(folder):
    (folder / "look.py").write_text(LOOKS)
    for _ in range(2):  # again in the same folder, over what was published
        table = run(grid(), entries={"look": "look.py:look", "stay": "stay.py:stay"}, seeds=[1], out="out")
        assert [row["details"] for row in table.rows] == [{}, {}]
        assert {one.name for one in folder.glob("out/entries/*/*")} == {"look.py", "stay.py"}
        assert not (folder / "out" / "scratch").exists()


def test_errors_in_a_copied_entry_name_the_published_file(folder):
    (folder / "odd.py").write_text("class Odd(Exception): pass\ndef odd(state): raise Odd(__file__, Odd)\n")
    table = run(grid(), entries={"odd": "odd.py:odd", "stay": "stay.py:stay"}, seeds=[1], out="out")
    assert table.rows[0]["details"] == {"red": "Odd: ('entries/00/odd.py', <class 'odd.Odd'>)"}
    assert 'File "entries/00/odd.py", line 2, in odd' in next(folder.glob("out/logs/*")).read_text()


def test_a_program_that_is_copied_still_runs(folder):
    (folder / "program").write_text('#!/bin/sh\necho \'{"type": "ready"}\'\nread start\nread question\n')
    (folder / "program").chmod(0o755)
    table = run(grid(), entries={"program": ["./program"], "stay": "stay.py:stay"}, seeds=[1], out="out")
    assert table.not_ready == {"program": "exit: it ended with the exit code 0"}


def test_an_entry_that_cannot_play_is_named_before_the_first_game(folder, caplog):
    (folder / "closed").mkdir()
    shutil.copy("/bin/true", folder / "closed" / "python")
    (folder / "shims").mkdir()
    shim = folder / "shims" / "shim"
    shim.write_text(f"#!/bin/sh\nexec {folder / 'closed' / 'python'}\n")
    shim.chmod(0o755)
    (folder / "weights").mkdir()
    (folder / "weights" / "entry.py").write_text(
        "from gamms.rl import policy\ndef make(ctx):\n    return policy('weights.onnx')\n"
    )
    (folder / "late").mkdir()
    (folder / "late" / "entry.py").write_text("def late(state):\n    open('weights.npz')\n")
    given = {
        "late": "late/entry.py:late",
        "shim": ["shims/shim"],
        "missing": [
            sys.executable,
            "-S",
            "-c",
            "import sys; sys.stderr.write('Error: no module\\n  at 1\\n'); sys.exit(2)",
        ],
        "stay": "stay.py:stay",
        "weights": "weights/entry.py:make",
    }
    table = run(grid(), entries=given, seeds=[1], out="out", rounds=1)
    assert set(table.not_ready) == {"late", "missing", "shim", "weights"}
    assert re.fullmatch(r"exit: it ended with the exit code 126 \(.*Permission denied\)", table.not_ready["shim"])
    assert table.not_ready["missing"] == "exit: it ended with the exit code 2 (Error: no module)"
    assert re.fullmatch("error: FileNotFoundError: .*'weights.npz'", table.not_ready["late"])
    assert "There is no file 'weights.onnx'" in table.not_ready["weights"]
    assert caplog.messages == [
        f"The entry {name!r} cannot play: {reason}" for name, reason in sorted(table.not_ready.items())
    ]
    assert f"shim cannot play: {table.not_ready['shim']}" in str(table)
    assert "weights cannot play: " in (folder / "out" / "index.html").read_text()
    assert json.loads((folder / "out" / "tournament.json").read_text())["not_ready"] == table.not_ready
    assert table.standings()[0].entry == "stay"


def test_modules_beside_a_package_do_not_take_the_place_of_those_of_the_launcher(folder, monkeypatch):
    (folder / "place" / "bots").mkdir(parents=True)
    (folder / "place" / "bots" / "__init__.py").write_text(STAY)
    (folder / "place" / "platform.py").write_text(f"open({str(folder / 'ran')!r}, 'w')\nfrom sys import platform\n")
    monkeypatch.syspath_prepend(folder / "place")
    table = run(grid(), entries={"bots": "bots:stay", "stay": "stay.py:stay"}, seeds=[1], out="out")
    assert table.not_ready == {}
    assert not (folder / "ran").exists()


SHOWN = """
import gc, os, sys
from gamms.strategies import chase

def stay(state):
    state["action"] = state["curr_pos"]

def look(ctx):
    chase(ctx)  # which looks at the map and the teams

    def plan(states):
        for name, state in states.items():
            assert set(state) == {
                "curr_pos", "sensor", "name", "team", "turn", "legal", "draw", "rng", "memory", "team_memory", "facts",
                "blocked",
            }, sorted(state)
            assert state["facts"] == {"hint": 4} and state["name"] == name
            kind, seen = state["sensor"]["eyes"]
            assert kind.name == "AGENT_RANGE" and isinstance(seen, dict)
            assert ctx.agent.get_agent(name).current_node_id == state["curr_pos"]
            assert state["memory"].get("turns", 0) == state["turn"]
            assert state["team_memory"] == ({"seen": {"a", state["turn"]}} if state["turn"] else {})
            state["memory"]["turns"] = state["turn"] + 1
            state["team_memory"]["seen"] = {"a", state["turn"] + 1}
            state["action"] = state["draw"].choice(state["legal"])
        others = [agent for agent in ctx.agent.agents.values() if agent.team != state["team"]]
        assert len(others) == 2 and {agent.current_node_id for agent in others} == {0}
        assert not any(hasattr(agent, "meta") and agent.meta.get("key") for agent in others)
        texts = [one for one in gc.get_objects() if isinstance(one, (str, dict))]
        assert not any("other-entry" in str(one) for one in [*texts, sys.argv, sys.path, dict(os.environ)])
        assert not set(os.environ) & {"SECRET", "PYTHONPATH", "USER"}
    return plan
"""


def test_a_python_entry_sees_its_states_and_nothing_of_its_opponent(folder, monkeypatch):
    monkeypatch.setenv("SECRET", "s3cr3t")
    (folder / "look.py").write_text(SHOWN)
    (folder / "other_entry.py").write_text(STAY)
    entries = {"look": "look.py:look", "other-entry": "other_entry.py:stay"}
    table = run(grid(), entries=entries, seeds=[5], out="out", move_seconds=20.0)
    assert [row["details"] for row in table.rows] == [{}, {}]


def test_the_programs_of_the_page_play(folder):
    (folder / "entry.py").write_text(re.search(r"without GAMMS:\n\n```python no-run\n(.*?)```", PAGE, re.DOTALL)[1])
    given = {"python": [sys.executable, "-S", "entry.py"], "stay": "stay.py:stay"}
    if shutil.which("node"):
        (folder / "entry.js").write_text(re.search(r"```javascript\n(.*?)```", PAGE, re.DOTALL)[1])
        given["javascript"] = ["node", "entry.js"]
    table = run(grid(), entries=given, seeds=[1], out="out", move_seconds=20.0)
    assert faults(table) == {name: {} for name in given}


def test_strategies_of_a_package_are_entries_and_limited_output_beside_answers_is_no_fault(folder):
    (folder / "chat.py").write_text("def chat(state):\n    print('hm')\n    state['action'] = state['curr_pos']\n")
    given = {"chat": "chat.py:chat", "walk": "gamms.strategies:random_walk"}
    assert faults(run(grid(), entries=given, seeds=[1], out="out", move_seconds=20.0)) == {"chat": {}, "walk": {}}
