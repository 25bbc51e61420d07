"""A tournament gives the same table however it is played, and what follows from its rows is right."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from glob import glob
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gamms.cli import app
from gamms.errors import BadFile, BadType, BadValue, TooLarge, UnknownName, WriteConflict
from gamms.experiment.statistics import estimate_rate
from gamms.scenario import Scenario, ScenarioError
from gamms.tournament import Table, load, run
from gamms.tournament.page import write_page
from gamms.tournament.table import count_points

GAME = {
    "max_turns": 6,
    "map": {"grid": {"width": 4, "height": 4}},
    "sensors": {"eyes": {"type": "AGENT_RANGE", "sensor_range": 100}},
    "teams": {"red": {"count": 1, "sensors": ["eyes"]}, "blue": {"count": 1, "sensors": ["eyes"]}},
    "rules": [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"],
}
ENTRIES = """
from gamms.strategies import chase, flee, random_walk

def hunt(ctx):
    return chase(ctx)

def run_away(ctx):
    return flee(ctx)

def walk(state):
    random_walk(state)

def fail(state):
    raise ValueError(str(object()))
"""
SECRET = "00112233445566778899aabbccddeeff"
NAMES = ("hunt", "run_away", "walk", "fail")
GIVEN = {name: f"entries.py:{name}" for name in NAMES}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "entries.py").write_text(ENTRIES)
    (tmp_path / "game.yaml").write_text(json.dumps(GAME))
    return tmp_path


def played(out="out", seeds=(1, 2), entries=GIVEN, **options):
    return run(Scenario(**GAME), entries=entries, seeds=seeds, out=out, move_seconds=20.0, **options)


def test_all_play_all_on_both_sides_with_the_same_seeds_and_the_folder_has_the_table(folder, monkeypatch):
    entries = {name: GIVEN[name] for name in ("hunt", "walk", "fail")}
    first = played(entries={name: GIVEN[name] for name in ("hunt", "fail")}, seeds=[1])
    table = played(entries=entries)
    assert table.rows[:2] == first.rows[:2]
    ways = [(row["entries"]["red"], row["entries"]["blue"], row["seed"]) for row in table.rows]
    pairs = [("fail", "hunt"), ("fail", "walk"), ("hunt", "walk")]
    assert ways == [way for a, b in pairs for seed in (1, 2) for way in ((a, b, seed), (b, a, seed))]
    assert table.standings()[-1][:3] == ("fail", 0.0, 8)
    assert table.standings()[-1].faults == {"error": 8}
    assert {row["details"].get("red", "") for row in table.rows} == {"", "ValueError: <object object>"}
    assert {file.name for file in folder.joinpath("out").iterdir()} == {
        *("entries", "games", "logs", "journal.jsonl", "map.gamms", "index.html", "tournament.json"),
    }
    assert {file.stem for file in folder.glob("out/games/*.ggr")} == {row["id"] for row in table.rows}
    manifest = json.loads(folder.joinpath("out/tournament.json").read_text())
    assert sorted(manifest["entries"]) == ["fail", "hunt", "walk"]
    monkeypatch.setattr("gamms.tournament.running.play", None)
    assert same(load("out"), table)
    assert load("out").standings() == table.standings()
    assert load("out").payoffs() == table.payoffs()
    before = {file: file.read_bytes() for file in folder.rglob("out/**/*") if file.is_file()}
    with pytest.raises(WriteConflict, match="another memory_mb"):
        played(memory_mb=300)
    with pytest.raises(WriteConflict, match="another scenario"):
        run(Scenario(**{**GAME, "map": {"grid": {"width": 5, "height": 4}}}), entries=GIVEN, seeds=[1], out="out")
    assert {file: file.read_bytes() for file in folder.rglob("out/**/*") if file.is_file()} == before


def same(table, other):
    return vars(table) | {"_payoffs": None} == vars(other) | {"_payoffs": None}


def test_a_swiss_tournament_pairs_neighbours_who_have_not_met_and_its_folder_has_its_table(folder, monkeypatch):
    table = played(seeds=[1], rounds=2, record=False)
    monkeypatch.setattr("gamms.tournament.running.play", None)
    rounds = {}
    for row in table.rows:
        rounds.setdefault(row["round"], set()).add(frozenset(row["entries"].values()))
    assert {number: len(pairs) for number, pairs in rounds.items()} == {1: 2, 2: 2}
    assert not rounds[1] & rounds[2]
    assert not (folder / "out" / "games").exists()
    assert table.nash_mixture() is None
    assert same(load("out"), table)
    journal = folder / "out" / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:-1]))
    assert [row["id"] for row in load("out").rows] == [row["id"] for row in table.rows[:-1]]
    journal.write_bytes(b"".join(lines[1:]))  # of the first round: who meets in the second is not known
    assert {row["round"] for row in load("out").rows} == {1}


def test_a_folder_of_a_stranger_is_checked(folder):
    with pytest.raises(BadFile, match=r"has no tournament\.json"):
        load("nowhere")
    played("out", seeds=[1], record=False)
    manifest, journal = folder / "out" / "tournament.json", folder / "out" / "journal.jsonl"
    rows = [json.loads(line) for line in journal.read_text().splitlines()]
    for change in ({"winner": "green"}, {"seed": 9}, {"faults": {"green": "time"}}, {"scores": {"red": 1}}):
        journal.write_text("".join(json.dumps({**row, **change}) + "\n" for row in rows))
        with pytest.raises(BadFile, match="is not that of its game"):
            load("out")
    text = json.loads(manifest.read_text())
    for change in (
        {"sides": ["red"]},
        {"seeds": 3},
        {"seeds": [], "rounds": 10**9},
        {"entries": ["hunt"]},
        {"format": "x"},
    ):
        manifest.write_text(json.dumps({**text, **change}))
        with pytest.raises(BadFile, match="tournament"):
            load("out")
    manifest.write_text(json.dumps({**text, "rounds": 10**9}))
    with pytest.raises(TooLarge, match="games"):
        load("out")


def test_a_tournament_that_is_refused_leaves_no_folder(folder):
    before = set(folder.rglob("*"))
    with pytest.raises(ScenarioError, match=r"no function 'nope' in .*entries\.py\. It has"):
        played("new/out", entries={"hunt": "entries.py:hunt", "nope": "entries.py:nope"})
    with pytest.raises(BadType, match="record must be True or False"):
        played("new/out", record="games")
    with pytest.raises(BadValue, match="no such program"):
        played("new/out", entries={"hunt": "entries.py:hunt", "nope": ["entries.py", "nope"]})
    assert set(folder.rglob("*")) == before


KILLED = """
from gamms.scenario import Scenario, ScenarioError
from gamms.tournament import run, running
import json, sys
running._GAMES_OF_A_TASK = 1  # so that there is a moment between some rows and all
if __name__ == "__main__":
    given = json.loads(sys.argv[1])
    game, entries = Scenario(**given["game"]), given["entries"]
    run(game, entries=entries, seeds=range(4), out="killed", move_seconds=20.0, workers=2)
"""


def children(of):
    files = glob(f"/proc/{of}/task/*/children")  # noqa: PTH207 - passes over what has ended meanwhile
    below = [int(one) for file in files for one in read(file).split()]
    return below + [one for child in below for one in children(child)]


def read(file):
    try:
        return Path(file).read_bytes()
    except OSError:  # the thread or the process has ended meanwhile
        return b""


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_a_killed_worker_and_a_killed_runner_change_nothing(folder):
    entries = {name: GIVEN[name] for name in ("hunt", "run_away")}
    (folder / "killed.py").write_text(KILLED)
    words = [sys.executable, "killed.py", json.dumps({"game": GAME, "entries": entries})]
    process = subprocess.Popen(words, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    journal = folder / "killed" / "journal.jsonl"

    def wait_for_more_than(rows):
        while not journal.exists() or len(journal.read_bytes().splitlines()) <= rows:
            assert process.poll() is None
            time.sleep(0.02)

    wait_for_more_than(0)
    workers = [one for one in children(process.pid) if b"gamms.workers" in read(f"/proc/{one}/cmdline")]
    os.kill(workers[0], signal.SIGKILL)
    wait_for_more_than(len(journal.read_bytes().splitlines()))
    below = children(process.pid)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    until = time.monotonic() + 60.0
    while any(Path(f"/proc/{one}").exists() for one in below) and time.monotonic() < until:
        time.sleep(0.02)
    assert not any(Path(f"/proc/{one}").exists() for one in below)
    done = len(journal.read_text().splitlines())
    assert 0 < done < 8
    resumed = played("killed", seeds=range(4), entries=entries, workers=2)
    assert len(journal.read_text().splitlines()) == 8
    assert not (folder / "killed" / "scratch").exists()
    secret = resumed.runs[0]["secret"]
    assert resumed.rows[-2:] == played("alone", seeds=[3], entries=entries, secret=secret).rows


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_of_ray_gives_the_same_table(folder):
    pytest.importorskip("ray")
    there = played("there", executor="ray", workers=2, record=False, secret=SECRET)
    here = played("here", workers=4, record=False, secret=SECRET)
    assert there.rows == here.rows == played("alone", record=False, secret=SECRET).rows


def test_a_file_describes_a_tournament(folder):
    (folder / "cup.yaml").write_text(
        "scenario: game.yaml\nentries: {hunt: entries.py:hunt, fail: entries.py:fail}\nseeds: 0:2\nmove_seconds: 20\n"
    )
    done = CliRunner().invoke(app, ["tournament", "cup.yaml", "--out", "cup", "--workers", "1"])
    assert done.exit_code == 0, done.output
    assert re.search(r"1 +hunt +4 +4 +4 +0 +0\n2 +fail +0 +4 +0 +0 +4 +4 error", done.output)
    for text, said in (
        ("scenario: game.yaml\nentrys: {}\nseeds: 0:2\n", "unknown key 'entrys'. Did you mean 'entries'?"),
        ("scenario: game.yaml\nentries: {}\nseeds: 2\n", "2:3 is the one game with the seed 2, and 0:2 are 2 games."),
        ("scenario: game.yaml\nentries: {}\nseeds: 0-2\n", "cup.yaml: seeds: seeds are 0:50 or 1,2,5, not '0-2'."),
        ("scenario: game.yaml\nentries: {}\nseeds: 2:0\n", "cup.yaml: seeds: seeds: '2:0' is empty; did you mean 0:2?"),
        (
            "scenario: game.yaml\nentries: {a: entries.py:hunt, b: entries.py:hnt}\nseeds: 0:1\n",
            f"the entry 'b': there is no function 'hnt' in {Path.cwd() / 'entries.py'}. Did you mean 'hunt'?",
        ),
    ):
        (folder / "cup.yaml").write_text(text)
        done = CliRunner().invoke(app, ["tournament", "cup.yaml"])
        assert done.exit_code == 1
        assert said in done.output


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"seeds": []}, BadValue, "one seed at least"),
        ({"sides": ("red", "green")}, UnknownName, "green"),
        ({"sides": ("red",)}, BadValue, "two teams"),
        ({"entries": {"a": "entries.py:hunt"}}, BadValue, "two entries"),
        ({"memory_mb": 8}, BadValue, "memory_mb must be at least 64"),
    ],
)
def test_invalid_tournaments_are_refused(folder, options, error, message):
    with pytest.raises(error, match=message):
        played(**options)


# -- what follows from rows ---------------------------------------------------------------------------------------


def row(red, blue, winner, seed=0, faults=(), scores=(0.0, 0.0)):
    return {
        "id": f"{red}-{blue}-{seed}",
        "round": 1,
        "seed": seed,
        "entries": {"red": red, "blue": blue},
        "winner": winner,
        "reason": "over",
        "truncated": False,
        "turns": 3,
        "scores": dict(zip(("red", "blue"), scores, strict=True)),
        "faults": dict.fromkeys(faults, "time"),
        "details": dict.fromkeys(faults, "it took longer"),
    }


def rock_paper_scissors():
    wins = [("paper", "rock"), ("scissors", "paper"), ("rock", "scissors")]
    rows = [row(a, b, "red", seed, scores=(2.0, 1.0)) for a, b in wins for seed in range(5)]
    rows += [row(b, a, "blue", seed, scores=(0.0, 3.0)) for a, b in wins for seed in range(5)]
    rows += [row(one, "dull", "red", seed) for one in ("rock", "paper", "scissors") for seed in range(5)]
    return Table(rows, ["dull", "paper", "rock", "scissors"])


def test_payoffs_cycles_and_the_nash_mixture_of_rock_paper_scissors():
    table = rock_paper_scissors()
    paper = table.payoffs()["paper", "rock"]
    assert paper.points == estimate_rate(5, 5)
    assert (paper.score.value, paper.games, paper.seeds) == (2.0, 10, 5)
    assert table.payoffs()["rock", "paper"].score.value == -2.0
    assert [(one.entries, one.is_certain) for one in table.cycles()] == [(("paper", "rock", "scissors"), True)]
    assert table.nash_mixture() == pytest.approx({"dull": 0.0, "paper": 1 / 3, "rock": 1 / 3, "scissors": 1 / 3})


def test_a_mixture_cannot_be_beaten():
    rng = np.random.default_rng(3)
    names = [f"e{number}" for number in range(6)]
    winners = ("red", "blue", None)
    rows = [row(a, b, winners[rng.integers(3)], seed) for a in names for b in names if a != b for seed in range(3)]
    table = Table(rows, names)
    mixture, payoffs = table.nash_mixture(), table.payoffs()
    assert sum(mixture.values()) == pytest.approx(1.0)
    for one in names:
        gain = sum(
            share * (payoffs[one, other].points.value - payoffs[other, one].points.value)
            for other, share in mixture.items()
            if other != one
        )
        assert gain <= 1e-9


def drawn_games(seed, strengths, seeds):
    """Return rows of all pairs on both sides, with winners drawn from the Bradley-Terry model, some games drawn."""
    rng, rows = np.random.default_rng(seed), []
    for number in range(seeds):
        for a, b in permutations(strengths, 2):
            share = 1.0 / (1.0 + np.exp(strengths[b] - strengths[a]))
            winner = rng.choice(["red", "blue", None], p=[0.8 * share, 0.8 * (1.0 - share), 0.2])
            rows.append(row(a, b, winner, number))
    return rows


def test_ratings_maximize_the_likelihood_of_the_games():
    strengths = {"a": -1.0, "b": 0.0, "c": 0.3, "d": 2.0}
    rows = drawn_games(2, strengths, 10)
    found = {one.entry: one.elo * np.log(10.0) / 400.0 for one in Table(rows, list(strengths)).ratings()}
    assert sum(found.values()) == pytest.approx(0.0)

    def likelihood(shift, ratings):
        theta = {name: one + shift for name, one in ratings.items()}
        whole = sum(-np.log1p(np.exp(-one)) - one / 2.0 for one in theta.values())  # a draw with the average opponent
        for game in rows:
            for entry, points in count_points(game).items():
                other = next(one for one in game["entries"].values() if one != entry)
                whole -= points * np.log1p(np.exp(theta[other] - theta[entry]))
        return whole

    shift = max(np.linspace(-1.0, 1.0, 2001), key=lambda one: likelihood(one, found))
    best = likelihood(shift, found)
    for name, rating in found.items():
        for change in (-0.01, 0.01):
            assert likelihood(shift, {**found, name: rating + change}) < best


def test_ratings_do_not_depend_on_the_order_of_games():
    rows = drawn_games(3, {"a": 0.0, "b": 0.1, "c": 0.2}, 12)
    ratings = Table(rows, ["a", "b", "c"]).ratings()
    for order in range(5):
        by_seed = np.random.default_rng(order).permutation(len(rows))
        shuffled = Table([rows[place] for place in by_seed], ["c", "b", "a"]).ratings()
        assert [one.entry for one in shuffled] == [one.entry for one in ratings]
        assert [one.elo for one in shuffled] == pytest.approx([one.elo for one in ratings])


@pytest.mark.parametrize("seed", range(8))
def test_ratings_have_the_order_of_the_points_where_all_have_met(seed):
    names = ["a", "b", "c", "d", "e"]
    table = Table(drawn_games(seed, dict.fromkeys(names, 0.0), 4), names)
    points = {one.entry: one.points for one in table.standings()}
    found = [points[one.entry] for one in table.ratings()]
    assert found == sorted(found, reverse=True)


def test_equal_ratings_are_in_the_order_of_names():
    ratings = Table(rock_paper_scissors().rows, ["scissors", "rock", "paper", "dull"]).ratings()
    assert [one.entry for one in ratings] == ["paper", "rock", "scissors", "dull"]
    assert ratings[0].elo == pytest.approx(ratings[2].elo)


def test_an_entry_that_wins_all_games_has_a_finite_rating():
    few, many = (Table([row("good", "bad", "red", seed) for seed in range(n)], ["good", "bad"]) for n in (2, 50))
    elo = [table.ratings()[0].elo for table in (few, many)]
    assert 0.0 < elo[0] < elo[1] < 1000.0
    assert math.isnan(few.ratings()[0].low)  # all seeds agree


def test_intervals_of_ratings_are_over_seeds():
    strengths = {"a": 0.0, "b": 0.5, "c": 1.0}
    few, many = (Table(drawn_games(1, strengths, seeds), list(strengths)).ratings() for seeds in (10, 90))
    assert all(one.low < one.elo < one.high for one in (*few, *many))
    assert max(one.high - one.low for one in many) < min(one.high - one.low for one in few)
    rows = drawn_games(1, strengths, 10)
    repeated = Table(rows * 8, list(strengths)).ratings()
    assert repeated[0].high - repeated[0].low > 0.9 * (few[0].high - few[0].low)  # no more evidence


def test_games_in_which_both_have_a_fault_count_in_no_rating():
    both = Table([row("a", "b", None, faults=("red", "blue"))], ["a", "b"])
    assert [(one.entry, one.elo) for one in both.ratings()] == [("a", 0.0), ("b", 0.0)]
    assert [one.points for one in both.standings()] == [0.0, 0.0]
    assert [one.elo for one in Table([], ["a", "b"]).ratings()] == [0.0, 0.0]


def test_a_table_needs_the_names_of_all_entries():
    with pytest.raises(UnknownName, match="Unknown entry 'fair'"):
        Table([row("good", "fair", "red")], ["good", "fare"])
    with pytest.raises(BadType, match="entries must be a list of names, not 'good'"):
        Table([], "good")


def test_the_page_escapes_names_chosen_by_entries(tmp_path):
    evil = "<script>alert(1)</script>"
    rows = [{**row(evil, "b", "blue", faults=("red",)), "details": {"red": f"'\"><img src=x onerror={evil}>"}}]
    write_page(Table(rows, [evil, "b"]), tmp_path, evil)
    page = (tmp_path / "index.html").read_text()
    assert "<script" not in page
    assert "<img" not in page
    assert "&lt;script&gt;alert(1)" in page
    assert "default-src 'none'" in page
    assert "Bootstrap intervals of up to 100 seeds may be too narrow." in page
    assert "nan" not in page
