"""No entry can compute what a tournament hides, and everybody can when it has ended."""

import hashlib
import hmac
import json
import shutil
import stat
from pathlib import Path

import pytest
from typer.testing import CliRunner

import gamms
from gamms.cli import app
from gamms.errors import BadFile, BadType, BadValue, WriteConflict
from gamms.experiment.running import InProcessExecutor
from gamms.scenario import Scenario
from gamms.tournament import Table, load, run

GAME = {
    "max_turns": 2,
    "map": {"grid": {"rows": 6, "columns": 6}},
    "sensors": {"eyes": {"type": "AGENT_RANGE", "sensor_range": 10}},
    "teams": {
        "red": {"count": 2, "sensors": ["eyes"]},
        "blue": {"count": 2, "sensors": ["eyes"], "from": {"team": "red", "at_least": 20}},
    },
}
SPY = """
import hashlib
import hmac
import os
from pathlib import Path

LABELS = range(4000, 5000)
TEAMS = ("red", "blue")


def list_hashes(label, team):
    for text in (f"tournament/{label}/{team}", f"{label}/{team}", f"{label}"):
        yield hashlib.sha256(text.encode()).digest()
        yield hmac.digest(b"", text.encode(), "sha256")
        yield hmac.digest(str(label).encode(), text.encode(), "sha256")


def spy(ctx):
    numbers = {size: {int.from_bytes(one[:size], "big") for label in LABELS for team in TEAMS
                      for one in list_hashes(label, team)} for size in (6, 7, 8)}
    found = [ctx.seed in numbers[size] or ctx.seed in {one >> 2 for one in numbers[size]} for size in (6, 7, 8)]
    opened = []
    for place in (OUT, f"/proc/{os.getppid()}/environ", f"/proc/{os.getppid()}/mem", f"/proc/{os.getppid()}/fd"):
        try:
            opened += [os.listdir(place)] if Path(place).is_dir() else [Path(place).read_bytes()]
        except OSError:
            pass
    raise SystemExit(f"found {any(found)}, opened {opened}, {sorted(os.environ)}")
"""
STAY = """
def stay(states):
    for state in states.values():
        state["action"] = state["curr_pos"]


def walk(states):
    for state in states.values():
        state["action"] = state["draw"].choice(state["legal"])
"""
ENTRIES = {"idle": "stay.py:stay", "spy": "spy.py:spy", "walk": "stay.py:walk"}
SECRET = "00112233445566778899aabbccddeeff"


class Interrupted(InProcessExecutor):
    """Is interrupted, as by Ctrl-C, at a task, after the trials and the games of the first pair."""

    def __init__(self):
        super().__init__()
        self.left = len(ENTRIES) + 1

    def submit(self, *given, **more):
        if not self.left:
            raise KeyboardInterrupt
        self.left -= 1
        return super().submit(*given, **more)


def played(out, entries=ENTRIES, seeds=(4711,), **options):
    return run(Scenario(**GAME), entries=entries, seeds=seeds, out=out, move_seconds=20.0, **options)


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A folder with a tournament that was interrupted."""
    folder = tmp_path_factory.mktemp("secrets")
    (folder / "stay.py").write_text(STAY)
    (folder / "spy.py").write_text(f"OUT = {str(folder / 'begun')!r}\n{SPY}")
    with pytest.raises(KeyboardInterrupt):
        played(folder / "begun", executor=Interrupted(), folder=folder)
    return folder


@pytest.fixture(scope="module")
def ended(begun):
    """The same, when the tournament has ended."""
    shutil.copytree(begun / "begun", begun / "ended")
    played(begun / "ended", folder=begun)
    return begun


@pytest.fixture
def folder(ended, tmp_path, monkeypatch):
    """A copy of all that."""
    shutil.copytree(ended, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def read_manifest(out):
    return json.loads((out / "tournament.json").read_text())


def test_until_the_end_the_secret_is_in_a_file_that_only_the_user_may_read(begun):
    [kept] = begun.glob("begun/*.secret")
    secret = kept.read_text()
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600
    assert len(bytes.fromhex(secret)) == 16
    files = [file for file in begun.rglob("begun/**/*") if file.is_file() and file != kept]
    assert {"tournament.json", "journal.jsonl", "map.gamms"} < {file.name for file in files}
    assert {file.suffix for file in files} > {".ggr", ".txt"}
    for file in files:
        content = file.read_bytes()
        assert secret.encode() not in content
        assert bytes.fromhex(secret) not in content
        assert secret not in file.name
    [one] = load(begun / "begun").runs
    assert one["secret"] is None
    assert one["sha256"] == hashlib.sha256(secret.encode()).hexdigest()
    assert len(load(begun / "begun").rows) == 2


def test_an_entry_finds_neither_seeds_nor_secrets(ended):
    spied = [text for row in load(ended / "ended").rows for text in row["details"].values()]
    assert len(spied) == 4
    names = "['HOME', 'LANG', 'OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'PATH', 'PYTHONDONTWRITEBYTECODE', "
    for text in spied:
        assert f"SystemExit: found False, opened [], {names}" in text


def test_at_the_end_the_secret_is_published_with_the_table_and_its_file_is_gone(ended):
    begun = read_manifest(ended / "begun")["runs"][0]
    [one] = read_manifest(ended / "ended")["runs"]
    [kept] = ended.glob("begun/*.secret")
    assert one == {**begun, "secret": kept.read_text()}
    assert load(ended / "ended").runs == [one]
    assert not list(ended.glob("ended/*.secret"))
    assert "secret" not in str(load(ended / "ended")) + (ended / "ended" / "index.html").read_text()


def test_a_referee_computes_all_seeds_from_the_published_secret(ended):
    table = load(ended / "ended")
    for row in table.rows:
        secret = {one["sha256"]: one["secret"] for one in table.runs}[row["run"]]
        digest = hmac.new(secret.encode(), str(row["seed"]).encode(), "sha256").digest()
        seed = int.from_bytes(digest, "big") >> 256 - 62
        with gamms.recorder.open(ended / "ended" / "games" / f"{row['id']}.ggr") as recording:
            assert recording.seed == seed
    starts = {name: int(nodes[0]) for name, nodes in Scenario(**GAME).starts([seed]).items()}
    assert starts != {name: int(nodes[0]) for name, nodes in Scenario(**GAME).starts([row["seed"]]).items()}


def test_a_resumed_tournament_equals_one_with_its_secret_and_that_table_says_so(folder, monkeypatch):
    resumed = load("ended")
    [first] = resumed.runs
    entries = {name: ENTRIES[name] for name in ("idle", "walk")}
    cup = {"scenario": "game.json", "entries": entries, "seeds": [4711], "move_seconds": 20}
    Path("cup.json").write_text(json.dumps(cup))
    Path("game.json").write_text(json.dumps(GAME))
    words = ["tournament", "cup.json", "--out", "again", "--workers", "1", "--secret", first["secret"]]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    said = f"The secret of the run {first['sha256']} was given."
    assert said in done.output
    again = load("again")
    assert again.rows == [row for row in resumed.rows if set(row["entries"].values()) == {"idle", "walk"}]
    [given] = again.runs
    assert (given["secret"], given["is_given"]) == (first["secret"], True)
    assert said in Path("again/index.html").read_text()
    monkeypatch.setattr("gamms.tournament.running.play", None)  # no game is played again
    assert played("again", entries).runs == [given]


def test_added_games_have_a_new_secret_and_old_games_keep_theirs(folder):
    before = load("ended")
    journal = Path("ended/journal.jsonl").read_bytes()
    entries = {name: ENTRIES[name] for name in ("idle", "walk")}
    table = played("ended", entries=entries, seeds=(4711, 4712))
    assert Path("ended/journal.jsonl").read_bytes().startswith(journal)
    old, new = table.runs
    assert [old] == before.runs
    assert old["secret"] != new["secret"]
    assert (new["seeds"], sorted(new["entries"])) == ([4711, 4712], ["idle", "walk"])
    assert [(row["seed"], row["run"]) for row in table.rows] == [
        *[(4711, old["sha256"])] * 2,
        *[(4712, new["sha256"])] * 2,
    ]
    assert table.rows[:2] == [row for row in before.rows if set(row["entries"].values()) == {"idle", "walk"}]


def test_an_interrupted_run_with_another_plan_is_ended_and_its_secret_published(folder):
    [kept] = Path("begun").glob("*.secret")
    secret = kept.read_text()
    Path("stay.py").write_text(f"{STAY}\n# changed\n")
    with pytest.raises(KeyboardInterrupt):
        played("begun", executor=Interrupted())
    old, new = read_manifest(Path("begun"))["runs"]
    assert old["secret"] == secret
    assert new["secret"] is None
    assert old["seeds"] == new["seeds"]
    assert old["sha256"] != new["sha256"]
    rows = [json.loads(line) for line in Path("begun/journal.jsonl").read_text().splitlines()]
    assert [row["run"] for row in rows] == [old["sha256"]] * 2 + [new["sha256"]] * 2


def test_a_lost_secret_is_an_error_with_a_way_out(folder):
    [kept] = Path("begun").glob("*.secret")
    for content in (SECRET, "\udcff"):
        kept.write_text(content, errors="surrogateescape")
        with pytest.raises(BadFile, match=r"is not in .*Put it back"):
            played("begun")
    kept.unlink()
    with pytest.raises(BadFile, match=r"is not in .*\.secret'\. Put it back"):
        played("begun")


def test_a_changed_secret_or_hash_or_row_is_found(folder):
    manifest = Path("ended/tournament.json")
    whole = read_manifest(Path("ended"))
    [one] = whole["runs"]
    forged = {**one, "secret": SECRET, "sha256": hashlib.sha256(SECRET.encode()).hexdigest()}
    for runs, message in (
        ([{**one, "secret": SECRET}], "does not have its SHA-256"),
        ([{**one, "secret": "é"}], "does not have its SHA-256"),
        ([{**one, "secret": "\ud800"}], "half of a surrogate pair"),
        ([{**one, "sha256": forged["sha256"]}], "does not have its SHA-256"),
        ([forged], "belongs to no run"),
        ([], "belongs to no run"),
        ([{"secret": SECRET}], "is not the file of a tournament"),
    ):
        manifest.write_text(json.dumps({**whole, "runs": runs}))
        for read in (load, played):
            with pytest.raises(BadFile, match=message):
                read("ended")
    manifest.write_text(json.dumps(whole))
    journal = Path("ended/journal.jsonl")
    rows = [json.loads(line) for line in journal.read_text().splitlines()]
    del rows[0]["run"]
    journal.write_text("".join(json.dumps(row) + "\n" for row in rows))
    with pytest.raises(BadFile, match=f"The row '{rows[0]['id']}' belongs to no run"):
        load("ended")


def test_a_table_of_a_version_without_secrets_is_read_and_not_continued(folder):
    manifest = Path("ended/tournament.json")
    journal = Path("ended/journal.jsonl")
    whole = read_manifest(Path("ended"))
    del whole["runs"]
    manifest.write_text(json.dumps({**whole, "format": "gamms tournament 1"}))
    rows = [json.loads(line) for line in journal.read_text().splitlines()]
    journal.write_text("".join(json.dumps({key: row[key] for key in row if key != "run"}) + "\n" for row in rows))
    assert len(load("ended").rows) == 6
    assert load("ended").runs == []
    with pytest.raises(WriteConflict, match=r"another format\. Choose another folder"):
        played("ended", seeds=(4711, 4712))


def test_secrets_that_are_no_texts_are_refused(tmp_path):
    with pytest.raises(BadType, match="secret must be a string, not 7"):
        played(tmp_path / "out", secret=7)
    with pytest.raises(BadValue, match="lone surrogate"):
        played(tmp_path / "out", secret="\ud800")


def test_a_tournament_cannot_lie_where_an_entry_may_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "packed_entry").mkdir()
    (tmp_path / "packed_entry" / "__init__.py").write_text(STAY)
    with pytest.raises(BadValue, match=r"The entry 'b' may read .*packed_entry', where .*cup' lies"):
        played("packed_entry/cup", entries={"a": "packed_entry/__init__.py:stay", "b": "packed_entry:walk"})
    assert {file.name for file in (tmp_path / "packed_entry").iterdir()} <= {"__init__.py", "__pycache__"}


def test_games_of_one_label_in_two_runs_are_two_pieces_of_evidence():
    rows = [
        {"run": run, "seed": 0, "entries": {"red": "a", "blue": "b"}, "winner": "red", "faults": {}, "scores": scores}
        for run, scores in (("1", {"red": 1.0, "blue": 0.0}), ("2", {"red": 3.0, "blue": 0.0}))
    ]
    assert Table(rows, ["a", "b"]).payoffs()["a", "b"].seeds == 2
    assert Table([rows[0]] * 2, ["a", "b"]).payoffs()["a", "b"].seeds == 1
