"""What an entry is, what it is shown, and what it is not."""

import re
import shutil
import sys
from pathlib import Path

import pytest

from gamms.errors import BadValue
from gamms.scenario import Scenario, ScenarioError
from gamms.tournament import run
from gamms.tournament.entries import found_entries

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
    own, *shared = found_entries(given, folder, folder / "out", [])
    assert own.readable == (str(folder / "alone"),)
    for one, name in zip(shared, ("stay.py", "other.py"), strict=True):
        assert [file.name for file in Path(one.readable[0]).iterdir()] == [name]


def test_the_digest_follows_from_the_files_of_an_entry_not_from_where_they_are(folder):
    for name in ("one", "two", "three"):
        (folder / name).mkdir()
        (folder / name / "stay.py").write_text(STAY + ("\n" if name == "three" else ""))
    given = {name: f"{name}/stay.py:stay" for name in ("one", "two", "three")}
    digests = {one.name: one.digest for one in found_entries(given, folder, folder / "out", [])}
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
def test_what_is_no_entry_is_refused(folder, given, message):
    with pytest.raises(BadValue, match=message):
        found_entries(given, folder, folder / "out", [])


def test_a_function_that_is_not_there_is_an_error_before_any_game(folder):
    with pytest.raises(ScenarioError, match="the entry 'b': there is no function 'sty'"):
        run(grid(), entries={"a": "stay.py:stay", "b": "stay.py:sty"}, seeds=[1], out="out")


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


def test_strategies_of_a_package_are_entries_and_what_is_written_beside_answers_is_no_fault_within_its_bounds(folder):
    (folder / "chat.py").write_text("def chat(state):\n    print('hm')\n    state['action'] = state['curr_pos']\n")
    given = {"chat": "chat.py:chat", "walk": "gamms.strategies:random_walk"}
    assert faults(run(grid(), entries=given, seeds=[1], out="out", move_seconds=20.0)) == {"chat": {}, "walk": {}}
