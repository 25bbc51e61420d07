"""Studies with scripted participants: consent, balanced conditions, practice, one row for each round, and restarts."""

import csv
import itertools
import json
import re
from collections import Counter
from urllib.error import HTTPError
from urllib.request import ProxyHandler, Request, build_opener

import pytest
from test_playing import Player

from gamms import scenario, web
from gamms.recorder import open as opened

ALONE = scenario.Scenario(
    name="errand",
    map={"grid": {"width": 6, "height": 1}},
    teams={
        "red": {"agents": [{"name": "rita", "node": 0}], "strategy": "gamms.strategies:stay"},
        "blue": {"agents": [{"name": "bob", "node": 5}], "strategy": "gamms.strategies:random_walk"},
    },
    rules=[{"rule": "reach", "with": {"team": "red", "nodes": [2]}}],
    max_turns=3,
)
CONDITIONS = {"short": {"max_turns": 1}, "long": {}}


def begun(out, **options):
    """Return a study in a folder."""
    given = {"people": "red", "consent": "Do you agree?", "conditions": CONDITIONS, "rounds": 2, "seconds": 20.0}
    return web.study(ALONE, out=out, **(given | options))


def ask(study, code, **more):
    """Ask as the page does what comes next for a participant."""
    address, _, token = study.link("x").partition("#")
    url = address.partition("?")[0] + "participant"
    body = json.dumps({"code": code, **more}).encode()
    with build_opener(ProxyHandler({})).open(Request(url, body, {"Authorization": f"Bearer {token}"})) as answer:
        return json.load(answer)["value"]


def play(study, code):
    """Play the next round of a participant, who goes east; return what it was."""
    now = ask(study, code, begin=True)
    player = Player(now["link"].replace("/play", "/"))
    count = sum(row["participant"] == code for row in study.rows)
    for turn in itertools.count():
        player.read(lambda one, turn=turn: any(Player._of(told, turn) for told in one.told) or is_over(one))
        if is_over(player):
            break
        player.go(turn, turn + 1)
    player.socket.close()
    for thread in study._threads:
        thread.join(5)
    assert sum(row["participant"] == code for row in study.rows) == count + 1
    return now["practice"], now["round"]


def is_over(player):
    """Whether a player was told that the game is over."""
    return any(told["type"] == "status" and told["over"] for told in player.told)


def test_a_participant_agrees_practises_plays_and_gets_a_row_for_each_round(tmp_path):
    with begun(tmp_path) as study:
        assert ask(study, "P1") == {"stage": "consent", "text": "Do you agree?"}
        assert ask(study, "P1", begin=True)["stage"] == "consent"
        assert ask(study, "P1", agree=True) == {"stage": "ready", "practice": True, "round": 1, "rounds": 2}
        assert [play(study, "P1") for _ in range(3)] == [(True, 1), (False, 1), (False, 2)]
        assert ask(study, "P1", begin=True) == {"stage": "end", "rounds": 2}
        assert study.wait(1, timeout=0.1)
        rows = study.rows
    turns = {"short": 1, "long": 2}[rows[0]["condition"]]
    assert [(row["practice"], row["round"], row["seed"], row["attempt"]) for row in rows] == [
        (True, 1, 0, 1),
        (False, 1, 1, 1),
        (False, 2, 2, 1),
    ]
    assert {(row["participant"], row["turns"], row["choices"], row["missed"]) for row in rows} == {
        ("P1", turns, turns, 0)
    }
    with (tmp_path / "rows.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["seconds_mean"] for row in table] == [str(row["seconds_mean"]) for row in rows]
    with opened(tmp_path / rows[0]["recording"]) as recording:
        assert {event["person"] for event in recording.events() if event["kind"] == "choice"} == {"P1"}
    written = b"".join(file.read_bytes() for file in tmp_path.rglob("*") if file.is_file())
    assert b"127.0.0.1" not in written
    assert b"localhost" not in written


def test_a_study_goes_on_where_each_participant_was(tmp_path):
    with begun(tmp_path) as study:
        for code in ("P1", "P2"):
            ask(study, code, agree=True)
        play(study, "P1")
        ask(study, "P1", begin=True)  # and leaves, as the study ends
    with (tmp_path / "rows.jsonl").open("a") as file:
        file.write('{"participant": "P1", "torn')
    with begun(tmp_path) as study:
        assert [ask(study, code)["practice"] for code in ("P1", "P2")] == [False, True]
        play(study, "P1")
        assert [(row["practice"], row["attempt"]) for row in study.rows] == [(True, 1), (False, 2)]
        assert study.assigned == {"short": 1, "long": 1}
    with pytest.raises(ValueError, match="holds another study"):
        begun(tmp_path, rounds=5)


def test_conditions_are_balanced_in_each_block(tmp_path):
    with begun(tmp_path, conditions={name: {} for name in "abc"}) as study:
        given = [study.condition_of(number) for number in range(30)]
        for number in range(6):
            ask(study, f"P{number}", agree=True)
        assert study.assigned == {"a": 2, "b": 2, "c": 2}
    assert all(sorted(given[i : i + 3]) == ["a", "b", "c"] for i in range(0, 30, 3))
    assert len(Counter(tuple(given[i : i + 3]) for i in range(0, 30, 3))) > 1


def test_a_link_without_a_code_or_with_another_token_gives_nothing(tmp_path):
    with begun(tmp_path) as study:
        for code in (None, "", "a/b", "x" * 65, "ü"):
            with pytest.raises(HTTPError, match="400"):
                ask(study, code, agree=True)
        ask(study, "P1", agree=True)
        link = ask(study, "P1", begin=True)["link"]
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/play#[\w-]+", link)
        mallory = Player(study.link("P1").replace("?code=P1", ""))  # with the token of the study alone
        assert "No round" in mallory.refused(question=1, move=1)
        mallory.socket.close()
    with pytest.raises(ValueError, match="holds another study"):
        begun(tmp_path, people="blue")


def test_impossible_studies_are_refused_before_they_begin(tmp_path):
    with pytest.raises(KeyError, match="gren"):
        begun(tmp_path, people="gren")
    with pytest.raises(ValueError, match="give 'bob' another strategy than human"):
        begun(tmp_path, conditions={"a": {"teams.blue.strategy": "human"}})
    with pytest.raises(ValueError, match="colour"):
        begun(tmp_path, conditions={"a": {"colour": 1}})
