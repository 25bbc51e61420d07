"""The root of an experiment, and the verification of its folder."""

import json
import os
from collections import Counter
from itertools import combinations
from math import comb

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_hunts import HUNT
from test_series import COLLECTING
from typer.testing import CliRunner

from gamms import cli, experiment
from gamms.errors import BadFile, BadValue, TooLarge
from gamms.experiment import folders
from gamms.experiment.verification import Verification, draw_rows
from gamms.limits import allowing
from gamms.scenario import Scenario

VARY = {"teams.red.count": [1, 2]}
COVERED = ("experiment.json", "journal.jsonl", "series.jsonl", "rows.jsonl", "rows.csv", "games/first.ggr")


@pytest.fixture(scope="module")
def studied(tmp_path_factory):
    """The folder of an experiment with collectors and a recording, its root, and the folder of its code."""
    code = tmp_path_factory.mktemp("code")
    (code / "watching.py").write_text(COLLECTING)
    plain = HUNT.to_dict()
    scenario = Scenario(**{**plain, "rules": [*plain["rules"], "watching:watch"]}, folder=str(code))
    folder = tmp_path_factory.mktemp("studied")
    rows = experiment.run(scenario, range(4), VARY, out=folder)
    (folder / "games").mkdir()
    rows.play(0, record=folder / "games" / "first.ggr")
    return folder, rows.root(), code


@pytest.fixture
def hunts(tmp_path):
    """The folder of an experiment whose code is that of GAMMS, and its rows."""
    return tmp_path / "hunts", experiment.run(HUNT, range(4), VARY, out=tmp_path / "hunts")


def alter_row(folder, number, **values):
    """Write another value into a row and into all files that follow from it, as an author could who cheats."""
    plan, rows = folders.read_rows(folder)
    rows[number] |= values
    (folder / "journal.jsonl").write_bytes(folders.as_lines(rows))
    folders.write_rows(folder, rows, plan["keys"])
    return rows[number]


# -- the root -----------------------------------------------------------------------------------------------------


def test_the_root_does_not_depend_on_how_games_are_played(hunts, tmp_path, pool):
    _, rows = hunts
    for number in (2, 1):
        experiment.run(HUNT, range(4), VARY, out=tmp_path / "parts", shard=(number, 2), executor=pool)
    experiment.merge(tmp_path / "parts")
    roots = [experiment.run(HUNT, range(4), VARY).root(), experiment.load(tmp_path / "parts").root()]
    assert roots == [rows.root()] * 2


def test_the_root_covers_plan_rows_and_recordings_but_no_versions(hunts):
    folder, rows = hunts
    root = rows.root()
    for name in ("experiment.json", "journal.jsonl"):
        text = (folder / name).read_text()
        (folder / name).write_text(text.replace(f'"gamms": "{rows[0]["gamms"]}"', '"gamms": "9.9"'))
    assert experiment.load(folder).root() == root
    rows.play(0, record=folder / "first.ggr")
    assert rows.root() != root
    assert experiment.run(HUNT, range(3), VARY).root() != experiment.run(HUNT, [0, 2, 1], VARY).root()


def test_rows_without_a_plan_have_no_root():
    with pytest.raises(BadValue, match="These rows have no plan"):
        experiment.Rows([{"seed": 1}], ()).root()
    with pytest.raises(BadValue, match="These rows have no folder: pass out="):
        experiment.run(HUNT, [1]).verify()


# -- the files ----------------------------------------------------------------------------------------------------


def test_an_unaltered_folder_is_verified(studied):
    folder, root, code = studied
    found = experiment.load(folder, folder=code).verify(root.upper(), sample=99)
    assert found.is_valid, found.faults
    assert (found.root, found.rows, len(found.played)) == (root, 8, 8)


@given(st.sampled_from(COVERED), st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_any_altered_byte_is_found(studied, name, share, change):
    folder, root, _ = studied
    file = folder / name
    before = file.read_bytes()
    data = bytearray(before)
    data[int(share * len(data))] ^= change
    file.write_bytes(data)
    try:
        assert not experiment.load(folder).verify(root, sample=0).is_valid
    except BadFile:
        pass
    finally:
        file.write_bytes(before)


@pytest.mark.parametrize("name", ["rows.jsonl", "journal.jsonl"])
def test_another_name_of_a_column_without_a_value_is_found(hunts, name):
    folder, rows = hunts
    text = (folder / name).read_text()
    assert '"winner": null' in text
    (folder / name).write_text(text.replace('"winner": null', '"wimner": null', 1))
    changed = experiment.load(folder)
    assert not changed.verify().is_valid
    assert (changed.root() == rows.root()) == (name == "rows.jsonl")


@pytest.mark.parametrize("name", ["rows.jsonl", "rows.csv"])
def test_a_table_that_does_not_follow_from_the_rows_is_a_fault_that_names_the_place(hunts, name):
    folder, rows = hunts
    lines = (folder / name).read_text().splitlines()
    lines[3] = lines[3].replace(str(rows[2 if name == "rows.csv" else 3]["scenario"]), "0" * 64)
    (folder / name).write_text("\n".join(lines) + "\n")
    (fault,) = experiment.load(folder).verify().faults
    if name == "rows.jsonl":
        assert fault.startswith(f"Row {rows[3]['id']} (seed 3): scenario is '0")
    else:
        assert fault.startswith("rows.csv differs from the file made again from the rows, line 4: it has ")


@pytest.mark.parametrize("name", ["rows.jsonl", "rows.csv"])
def test_a_table_that_is_larger_than_its_rows_is_a_fault_that_names_the_place(hunts, name):
    folder, _ = hunts
    lines = (folder / name).read_text().splitlines(keepends=True)
    lines[3] = lines[3].replace("max_turns", "max_turns_of_another")
    (folder / name).write_text("".join(lines))
    (fault,) = experiment.load(folder).verify().faults
    assert fault.startswith(f"{name} is larger than the file made again from the rows, of ")
    assert "bytes, line 4: it has " in fault
    assert "max_turns_of_another" in fault


def test_missing_rows_and_rows_of_another_seed_are_faults(hunts):
    folder, rows = hunts
    lines = (folder / "journal.jsonl").read_text().splitlines()
    lines[0] = lines[0].replace('"seed": 0', '"seed": 5')
    (folder / "journal.jsonl").write_text("\n".join(lines[:-1]) + "\n")
    faults = experiment.load(folder).verify().faults
    assert f"Row {rows[0]['id']} (seed 5): seed is 5, and the plan says 0." in faults
    assert f"1 of 8 rows are missing, such as {rows[7]['id']}: run to the end." in faults


def test_all_rows_are_missing_in_a_folder_without_a_journal(hunts):
    folder, rows = hunts
    (folder / "journal.jsonl").unlink()
    faults = experiment.load(folder).verify(rows.root()).faults
    assert f"8 of 8 rows are missing, such as {rows[0]['id']}: run to the end." in faults


def test_uncovered_parts_are_listed(hunts):
    folder, rows = hunts
    (folder / "notes.txt").write_text("well")
    with (folder / "journal.jsonl").open("a") as journal:
        journal.write(folders.as_lines([{**rows[0], "id": "other"}]).decode())
    notes = experiment.load(folder).verify().notes
    assert any(note.startswith("journal.jsonl has 9 lines for 8 rows: lines of other rows") for note in notes)
    assert "Neither the root nor the rows cover these files: notes.txt." in notes


def test_parquet_is_compared_where_the_same_version_of_pyarrow_is_installed(hunts):
    pa = pytest.importorskip("pyarrow")
    folder, _ = hunts
    file = folder / "rows.parquet"
    data = file.read_bytes()
    file.write_bytes(data.replace(b"PAR1", b"PAR2", 1))
    assert "rows.parquet differs from the file made again" in experiment.load(folder).verify().faults[0]
    file.write_bytes(bytes(100) + data.replace(pa.cpp_version.encode(), b"1.0.0"))  # larger, too
    found = experiment.load(folder).verify()
    assert found.is_valid
    assert "it names pyarrow 1.0.0 as its writer" in found.notes[-1]


# -- games that are played again ----------------------------------------------------------------------------------


def test_a_row_that_its_author_altered_everywhere_is_found_when_its_game_is_played(hunts):
    folder, rows = hunts
    row = alter_row(folder, 5, winner="green")
    root = experiment.load(folder).root()
    assert experiment.load(folder).verify(root, sample=0).is_valid
    expected = rows[5]["winner"]
    (fault,) = experiment.load(folder).verify(root, sample=8).faults
    assert fault == f"Row {row['id']} (seed 1): winner is 'green', and played again {expected!r}."


def test_an_altered_series_is_found_when_its_game_is_played(studied):
    folder, _, code = studied
    file = folder / "series.jsonl"
    before = file.read_bytes()
    lines = [json.loads(line) for line in before.splitlines()]
    lines[0]["value"][0] = 99
    file.write_bytes(folders.as_lines(lines))
    try:
        (fault,) = experiment.load(folder, folder=code).verify(sample=8).faults
    finally:
        file.write_bytes(before)
    assert f"Row {lines[0]['id']} (seed 0): the series 'where' is another one when it is played again" in fault


def test_the_drawn_rows_follow_from_the_root_and_a_seed():
    rows = [{"id": name} for name in "abcdefgh"]
    drawn = Counter()
    for seed in range(800):
        first, second = draw_rows("0" * 64, seed, rows, 2)
        assert draw_rows("0" * 64, seed, rows[::-1], 1) == [first]
        drawn.update([first["id"], second["id"]])
    assert set(drawn) == set("abcdefgh")
    assert max(abs(count - 200) for count in drawn.values()) < 50  # four standard deviations
    assert draw_rows("1" * 64, 0, rows, 8) != draw_rows("0" * 64, 0, rows, 8)


@pytest.mark.parametrize("altered", [0, 1, 3, 6])
def test_the_probability_to_miss_altered_rows_is_that_of_all_samples(altered):
    found = Verification("", 6, ("a", "b"), (), ())
    missing = sum(min(drawn) >= altered for drawn in combinations(range(6), 2))
    assert found.miss_probability(altered / 6) == pytest.approx(missing / comb(6, 2))
    assert found.miss_probability(altered / 6) <= (1 - altered / 6) ** 2 + 1e-12


def test_games_of_functions_need_the_program_and_values_that_it_computes_are_named(tmp_path):
    folder = tmp_path / "sitting"
    vary = {"strategies.red": {"sitting": sit}}
    rows = experiment.run(HUNT, [1], vary, out=folder, collect={"length": lambda result: result.turns})
    found = experiment.load(folder).verify(rows.root())
    assert (found.verdict, found.is_valid, found.played, found.faults) == ("unplayable", False, (), ())
    assert "cannot be played again: The plan does not say how to play row" in found.unplayable[0]
    assert found.unplayable[0].endswith("Give load(…, scenario=…, vary=…) with these functions.")
    found = experiment.load(folder, scenario=HUNT, vary=vary).verify(rows.root())
    assert found.verdict == "yes", found.faults
    assert "A program computed collector.length" in found.notes[-1]


def test_games_of_code_that_is_not_there_cannot_be_played_and_show_no_fault(studied, tmp_path):
    folder, root, code = studied
    found = experiment.load(folder).verify(root, sample=3)
    assert (found.verdict, found.faults, len(found.unplayable)) == ("unplayable", (), 3)
    assert "there is no module 'watching' installed. Give load(…, folder=…)" in found.unplayable[0]
    (tmp_path / "watching.py").write_text(f"{(code / 'watching.py').read_text()}\n")
    changed = experiment.load(folder, folder=tmp_path).verify(root, sample=1)
    assert (changed.verdict, changed.unplayable) == ("no", ())
    assert "The scenario or its code has changed" in changed.faults[0]


def test_a_fault_is_found_beside_games_that_cannot_be_played(tmp_path):
    folder = tmp_path / "mixed"
    rows = experiment.run(HUNT, range(3), {"strategies.red": {"sitting": sit, "own": None}}, out=folder)
    found = experiment.load(folder).verify(rows.root())
    assert (found.verdict, len(found.played), len(found.unplayable)) == ("unplayable", 3, 3)
    assert found.miss_probability(0.5) == 1.0
    row = alter_row(folder, 5, turns=77)
    found = experiment.load(folder).verify(sample=6)
    assert (found.verdict, len(found.unplayable)) == ("no", 3)
    assert found.faults[0].startswith(f"Row {row['id']} (seed 2): turns is 77, and played again ")
    (folder / "rows.csv").write_bytes(b"")
    assert [fault[:8] for fault in experiment.load(folder).verify(sample=0).faults] == ["rows.csv"]


def sit(state):
    state["action"] = state["curr_pos"]


def test_a_game_whose_process_died_is_not_played_again(hunts):
    folder, _ = hunts
    row = alter_row(folder, 0, error="WorkerDied: the process that played it ended")
    found = experiment.load(folder).verify(sample=8)
    assert found.is_valid, found.faults
    assert row["id"] not in found.played
    assert "1 drawn rows were not played again" in found.notes[-1]


# -- folders of strangers -----------------------------------------------------------------------------------------


def test_no_code_is_run_if_the_root_is_another_one(studied, tmp_path):
    folder, root, _ = studied
    code = tmp_path / "watching.py"
    code.write_text(f"{COLLECTING}\nopen({str(tmp_path / 'ran')!r}, 'w')\n")
    other = f"{root[:-1]}{'0' if root[-1] != '0' else '1'}"
    found = experiment.load(folder, folder=tmp_path).verify(other, sample=8)
    assert found.faults[0].startswith(f"The root of the folder is {root}, not {other}")
    assert found.played == ()
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("name", ["games", "first.ggr", "rows.csv", "series.jsonl"])
def test_links_are_refused(hunts, tmp_path, name):
    folder, _ = hunts
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(tmp_path if name == "games" else "/dev/zero")
    try:
        found = experiment.load(folder).verify()
    except BadFile as error:
        text = str(error)
    else:
        (text,) = found.faults
    assert "a link" in text


def test_pipes_sparse_files_and_deep_folders_are_refused(hunts):
    folder, _ = hunts
    os.mkfifo(folder / "pipe.ggr")
    with pytest.raises(BadFile, match="it is a pipe"):
        experiment.load(folder).root()
    (folder / "pipe.ggr").unlink()
    (folder / "large.ggr").touch()
    os.truncate(folder / "large.ggr", 1 << 40)
    with pytest.raises(TooLarge, match="Reading the recordings"):
        experiment.load(folder).verify()
    (folder / "large.ggr").unlink()
    os.truncate(folder / "rows.csv", 1 << 40)
    assert experiment.load(folder).verify().faults[0].startswith("rows.csv is larger than the file made again ")
    folder.joinpath(*"abcdefgh").mkdir(parents=True)
    with pytest.raises(BadFile, match="more than 7 levels deep"):
        experiment.load(folder).verify()


def test_a_folder_of_too_many_files_is_refused(hunts):
    folder, _ = hunts
    for number in range(200):
        (folder / f"{number}.txt").touch()
    with allowing("300K"), pytest.raises(TooLarge, match="Listing the files"):
        experiment.load(folder).verify()


def test_a_plan_of_more_games_than_rows_takes_no_time(hunts):
    folder, _ = hunts
    plan = json.loads((folder / "experiment.json").read_text())
    plan["seeds"] = list(range(10_000))
    plan["variants"] *= 5_000
    (folder / "experiment.json").write_bytes(folders.plan_as_bytes(plan))
    assert "which do not fit together" in experiment.load(folder).verify().faults[0]


def test_plans_and_rows_that_would_take_long_to_check_are_refused(hunts):
    folder, _ = hunts
    before = (folder / "experiment.json").read_bytes()
    plan = json.loads(before)
    plan["collectors"] = ["name" * 10_000] * 100
    (folder / "experiment.json").write_bytes(folders.plan_as_bytes(plan))
    with allowing("25M"), pytest.raises(TooLarge, match="Hashing the ids of the rows"):
        experiment.load(folder).verify()
    (folder / "experiment.json").write_bytes(before)
    _, rows = folders.read_rows(folder)
    for number, row in enumerate(rows):
        row.update(dict.fromkeys(f"score.{number}.{other}" for other in range(2_000)))
    (folder / "journal.jsonl").write_bytes(folders.as_lines(rows))
    with allowing("5M"), pytest.raises(TooLarge, match="A table of 8 rows and 16,"):
        experiment.load(folder).verify()


def test_a_folder_may_be_named_by_a_link(hunts, tmp_path):
    (tmp_path / "link").symlink_to(hunts[0])
    assert experiment.load(tmp_path / "link").verify(hunts[1].root()).is_valid


@pytest.mark.parametrize(
    ("root", "message"),
    [("abc", r"64 hexadecimal digits, .* not 'abc' \(3 characters\)"), ("g" * 64, r"\(64 characters\)")],
)
def test_a_text_that_is_no_root_is_refused(hunts, root, message):
    with pytest.raises(BadValue, match=message):
        hunts[1].verify(root)


# -- the command --------------------------------------------------------------------------------------------------


def test_the_command_prints_the_root_and_verifies_the_folder_by_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hunt.json").write_text(json.dumps(HUNT.to_dict()))
    (tmp_path / "hunts.json").write_text(json.dumps({"scenario": "hunt.json", "seeds": "0:3", "out": "hunts"}))

    def run(*words):
        return CliRunner().invoke(cli.app, ["experiment", *words], catch_exceptions=False)

    output = run("hunts.json", "--workers", "0").output
    root = experiment.load("hunts").root()
    assert f"root for the paper (gamms experiment verify) {root}" in output
    verified = run("verify", "hunts", "--root", root, "--sample", "2")
    assert (verified.exit_code, "2 games played again are equal" in verified.output) == (0, True)
    alter_row(tmp_path / "hunts", 1, turns=77)
    refused = run("verify", "hunts", "--root", root)
    assert (refused.exit_code, "hunts: no." in refused.output) == (1, True)
    assert "turns is 77, and played again" in run("verify", "hunts", "--sample", "3").output


def test_the_command_says_that_games_of_functions_cannot_be_played_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    root = experiment.run(HUNT, range(4), {"strategies.red": [sit]}, out="sitting").root()

    def verify(*words):
        return CliRunner().invoke(cli.app, ["experiment", "verify", "sitting", *words], catch_exceptions=False)

    unplayed = verify("--root", root, "--sample", "4")
    assert unplayed.exit_code == 3
    assert f"sitting: cannot be played again. {root} is the root; the files that follow" in unplayed.output
    assert "a program passed functions for it" in unplayed.output
    assert f"experiment.load('sitting', scenario=…, vary=…).verify('{root}')" in unplayed.output
    assert verify("--root", root, "--sample", "0").exit_code == 0
    table = tmp_path / "sitting" / "rows.csv"
    table.write_bytes(table.read_bytes().replace(b",1,", b",2,", 1))
    refused = verify("--root", root, "--sample", "4")
    assert (refused.exit_code, "sitting: no." in refused.output) == (1, True)


def verify_in(folder, *options):
    return CliRunner().invoke(cli.app, ["experiment", "verify", str(folder), *options])


def test_a_flipped_byte_under_a_root_is_named_as_damage(hunts):
    folder, rows = hunts
    (folder / "game.ggr").write_bytes(b"recording")
    root = rows.root()
    names = [one for one in folders.list_files(folder) if one.suffix != ".parquet"]
    assert len(names) == 5
    for name in names:
        data = (folder / name).read_bytes()
        for place in range(0, len(data), max(1, len(data) // 12)):
            for bit in (1, 128):
                (folder / name).write_bytes(data[:place] + bytes([data[place] ^ bit]) + data[place + 1 :])
                done = verify_in(folder, "--root", root, "--sample", "0")
                assert done.exit_code == 1, (name, place, bit, done.output)
                found = [line for line in done.output.splitlines() if line.startswith("tampered or damaged: ")]
                assert len(found) == 1, (name, place, bit, done.output)
                assert name.name in found[0], (name, place, bit, done.output)
        (folder / name).write_bytes(data)
    assert verify_in(folder, "--root", root, "--sample", "0").exit_code == 0


def test_a_folder_that_cannot_be_read_is_no_damage(hunts, tmp_path):
    folder, _ = hunts
    assert verify_in(tmp_path / "none").exit_code == 2
    assert verify_in(folder, "--root", "12").exit_code == 2
    (folder / "experiment.json").unlink()
    done = verify_in(folder)
    assert (done.exit_code, "tampered" in done.output) == (2, False)
