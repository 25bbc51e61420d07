import logging
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from gamms import experiment, strategies
from gamms.errors import BadValue, WriteConflict
from gamms.experiment import variants
from gamms.experiment.variants import compute_digest, hash_function
from gamms.scenario import Scenario, ScenarioError, load

GAME = """
max_turns: 3
map: {grid: {rows: 3, columns: 3}}
teams: {red: {count: 1, strategy: "players:go"}}
"""
PLAYERS = """from .helper import act

def go(state):
    act(state)
"""
STAY = "def act(state):\n    state['action'] = state['curr_pos']\n"
MOVE = "def act(state):\n    state['action'] = state['legal'][-1]\n"
LAZY = "def go(state):\n    from .{} import act\n\n    act(state)\n"
READER = "from pathlib import Path\n\ndef go(state):\n    Path(__file__).with_name('p.txt').read_text()\n"

AT_IMPORT = (
    "from pathlib import Path\n\nRULE = Path(__file__).with_name('p.txt').read_text()\n\n"
    "def go(state):\n    state['action'] = eval(RULE)\n"
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "g.yaml").write_text(GAME)
    (tmp_path / "players.py").write_text(PLAYERS)
    (tmp_path / "helper.py").write_text(STAY)
    return tmp_path


def play(folder, **options):
    return experiment.run(load(folder / "g.yaml"), range(2), out=folder / "out", **options)


def read_ids(rows):
    return [row["id"] for row in rows]


def test_games_are_played_again_when_code_beside_that_of_the_scenario_changes(folder):
    first = play(folder)
    assert read_ids(play(folder)) == read_ids(first)
    (folder / "helper.py").write_text(MOVE)
    again = play(folder)
    assert set(read_ids(again)).isdisjoint(read_ids(first))
    assert [row["moves.red"] for row in again] == [3, 3]
    (folder / "inner").mkdir()
    (folder / "inner" / "more.py").write_text("")
    assert set(read_ids(play(folder))).isdisjoint(read_ids(again))


def test_a_scenario_that_was_loaded_before_its_code_changed_plays_the_code_of_its_rows(folder):
    game = load(folder / "g.yaml")
    assert [row["moves.red"] for row in experiment.run(game, range(2))] == [0, 0]
    (folder / "helper.py").write_text(MOVE)
    assert [row["moves.red"] for row in experiment.run(game, range(2))] == [3, 3]


def test_an_executor_that_has_played_older_code_plays_the_code_of_the_rows(folder):
    with ThreadPoolExecutor(1) as executor:
        assert [row["moves.red"] for row in play(folder, executor=executor)] == [0, 0]
        (folder / "helper.py").write_text(MOVE)
        assert [row["moves.red"] for row in play(folder, executor=executor)] == [3, 3]


def test_declared_files_that_code_reads_at_its_import_are_read_again(folder):
    (folder / "players.py").write_text(AT_IMPORT)
    (folder / "g.yaml").write_text(f"{GAME}\nfiles: [p.txt]\n")
    (folder / "p.txt").write_text("state['curr_pos']")
    assert [row["moves.red"] for row in play(folder)] == [0, 0]
    (folder / "p.txt").write_text("state['legal'][-1]")
    assert [row["moves.red"] for row in play(folder)] == [3, 3]


@pytest.mark.parametrize("name", [".hidden", "env", "results"])
def test_hidden_folders_environments_and_results_hold_no_code_of_a_scenario(folder, name):
    before = compute_digest(load(folder / "g.yaml"))
    (folder / name).mkdir()
    (folder / name / "pyvenv.cfg").write_text("")
    (folder / name / "helper.py").write_text(MOVE)
    assert compute_digest(load(folder / "g.yaml")) == before


def test_a_folder_of_too_many_files_is_refused(folder, monkeypatch):
    monkeypatch.setattr(variants, "_MOST_FILES", 2)
    with pytest.raises(BadValue, match="has more than 2 files and folders: give the scenario"):
        play(folder)


def test_a_module_that_digests_do_not_cover_is_an_error_of_the_row(folder):
    (folder / "players.py").write_text(LAZY.format("linked.helper"))
    (folder / "linked").symlink_to(folder / ".elsewhere", target_is_directory=True)
    (folder / ".elsewhere").mkdir()
    (folder / ".elsewhere" / "helper.py").write_text(MOVE)
    rows = play(folder)
    assert {row["error"].partition(", which")[0] for row in rows} == {
        "The game has loaded linked/helper.py from the folder of the scenario"
    }


@pytest.mark.parametrize("workers", [None, 2])
def test_a_file_that_was_opened_and_not_declared_gets_one_warning(folder, caplog, workers):
    (folder / "players.py").write_text(READER)
    (folder / "p.txt").write_text("secret")
    assert play(folder, workers=workers).errors() == []
    assert [one.getMessage() for one in caplog.records if one.levelno >= logging.WARNING] == [
        (
            "Games have opened p.txt, which the digests of rows do not cover: name files that decide under files: in "
            "the scenario, so that games are played again when they change."
        )
    ]


def test_declared_files_and_maps_count_and_are_not_warned_of(folder, caplog):
    (folder / "players.py").write_text(READER)
    (folder / "p.txt").write_text("1")
    (folder / "g.yaml").write_text(f"{GAME}\nfiles: [p.txt]\n")
    first = play(folder)
    assert not [one for one in caplog.records if "p.txt" in one.getMessage()]
    (folder / "p.txt").write_text("2")
    assert set(read_ids(play(folder))).isdisjoint(read_ids(first))


@pytest.mark.parametrize(("name", "why"), [("../p.txt", "leads out of the folder"), ("none.txt", "there is no file")])
def test_declared_files_are_in_the_folder(folder, name, why):
    with pytest.raises(ScenarioError, match=why):
        load(folder / "g.yaml").replace(files=[name]).code()


def test_a_scenario_without_files_is_recorded_as_before(folder):
    assert "files" not in load(folder / "g.yaml").digests()
    (folder / "p.txt").write_text("1")
    assert "files" in load(folder / "g.yaml").replace(files=["p.txt"]).digests()


def make_function(text, **known):
    known["__name__"] = "__main__"
    exec(text, known)
    return known["f"]


def make_closure(value):
    def f(state):
        return value

    return f


def test_functions_count_by_code_defaults_and_all_values_that_they_use():
    texts = [
        "def f(s): return 1",
        "def f(s): return 2",
        "def f(s, a=1): return 1",
        "def f(s, *, a=1): return 1",
        "def f(s): return K",
        "def f(s): return (lambda: K)()",
        "def g(): return 1\ndef f(s): return g()",
        "def g(): return 2\ndef f(s): return g()",
        "class A:\n  def act(self): return 1\ndef f(s): return A().act()",
        "class A:\n  def act(self): return 2\ndef f(s): return A().act()",
        "class A:\n  def __call__(self, s): return 1\nf = A()",
        "class A:\n  def __call__(self, s): return 2\nf = A()",
        "import functools\n@functools.cache\ndef f(s): return 1",
        "import functools\n@functools.cache\ndef f(s): return 2",
        "def f(s): return f(s - 1)",
    ]
    functions = [make_function(text, K=1) for text in texts]
    functions += [make_function(text, K=2) for text in texts if "K" in text]
    functions += [make_closure(value) for value in (1, 2, "1", [1], {1: 2}, {1, 2}, functions[0], functions[1])]
    found = [hash_function(one) for one in functions]
    assert len(set(found)) == len(found)
    assert found[: len(texts)] == [hash_function(make_function(text, K=1)) for text in texts]
    assert hash_function(make_closure(iter("ab")))
    assert hash_function(make_closure(sys.stdout))


@pytest.mark.parametrize(
    "text",
    [
        "import functools, json\n@functools.wraps(json.dumps)\ndef f(s): return VALUE",
        "import functools\nfrom gamms import strategies\n@functools.wraps(strategies.stay)\ndef f(s): return VALUE",
        "def g(*a): return a\ndef h(a): return a\nk = [g, h][VALUE - 1]\ndef f(s): return k(s)",
        "import collections\nk = collections.deque([VALUE])\ndef f(s): return k",
        "class A(list): pass\nk = A([VALUE])\ndef f(s): return k",
        "class A(float):\n  def act(self): return VALUE\nk = A(1)\ndef f(s): return k.act()",
        "import enum\nclass A(enum.IntEnum):\n  X = 1\n  def act(self): return VALUE\ndef f(s, k=A.X): return k",
        "class A(tuple):\n  def __new__(cls): return (VALUE,)\ndef f(s): return A()",
    ],
)
def test_wrappers_signatures_and_values_of_all_kinds_count(text):
    first, second, again = (hash_function(make_function(text.replace("VALUE", value))) for value in "121")
    assert first == again != second


def test_functions_of_a_program_that_an_installed_tool_runs_count_by_their_code(monkeypatch):
    monkeypatch.setattr(sys.modules["__main__"], "__file__", "/lib/site-packages/tool/__main__.py", raising=False)
    assert hash_function(make_function("def f(s): return 1")) != hash_function(make_function("def f(s): return 2"))


def test_values_that_are_nested_too_deeply_are_refused_in_a_sentence():
    chain = []
    for _ in range(3_000):
        chain = [chain]
    with pytest.raises(BadValue, match="nested too deeply for a digest"):
        hash_function(make_closure(chain))


def test_functions_that_gamms_makes_count_by_what_they_hold_and_files_by_their_content(tmp_path):
    made = [hash_function(strategies.pool([make_closure(value)])) for value in (1, 2, 2)]
    assert made[0] != made[1] == made[2]
    file = tmp_path / "policy"
    found = []
    for content in ("1", "2", "1"):
        file.write_text(content)
        found.append(hash_function(make_closure(file)))
    assert found[0] == found[2] != found[1]


def test_functions_have_the_same_digest_in_every_process():
    text = "class A: x = {'a', 'b', 'c'}\ndef f(s, k=frozenset('xyz')): return s in {'k', 'l', 'm'}, A, print"
    program = f"from gamms.experiment.variants import hash_function\n{text}\nprint(hash_function(f))"
    found = {subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout for _ in range(2)}
    assert found == {f"{hash_function(make_function(text))}\n".encode()}


def test_functions_of_a_program_that_change_give_other_rows(tmp_path):
    game = Scenario(max_turns=2, map={"grid": {"rows": 3, "columns": 3}}, teams={"red": {"count": 1}})

    def run_with(value):
        vary = {"strategies.red": {"mine": make_closure(value)}}
        return read_ids(experiment.run(game, [1], vary, out=tmp_path, collect={"c": make_closure(1)}))

    assert run_with(1) == run_with(1) != run_with(2)
    ids = [read_ids(experiment.run(game, [1], collect={"c": make_closure(value)})) for value in (1, 1, 2)]
    assert ids[0] == ids[1] != ids[2]


def test_rows_of_the_first_format_are_read_and_verified_and_not_continued(folder, monkeypatch):
    code = folder
    with monkeypatch.context() as old:  # a folder as older versions wrote it
        old.setattr("gamms.experiment.running.compute_digest", lambda one, *_: variants.compute_first_digest(one))
        old.setattr("gamms.experiment.running._GamePlan.list_collectors", lambda plan: [*plan.collect])
        old.setattr("gamms.experiment.folders.FORMAT", experiment.folders.FIRST_FORMAT)
        play(code)
    rows = experiment.load(code / "out", folder=code)
    assert rows.verify(sample=2).verdict == "yes"
    (code / "helper.py").write_text(MOVE)  # which the old digest did not cover
    assert len(experiment.load(code / "out")) == 2
    with pytest.raises(WriteConflict, match="are of an older GAMMS and cover less code"):
        play(code)
