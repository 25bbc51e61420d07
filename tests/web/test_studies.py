"""Studies with scripted participants: consent, balanced conditions, practice, one row for each round, and restarts."""

import csv
import itertools
import json
import re
import subprocess
import sys
from collections import Counter
from datetime import UTC, datetime, timedelta
from urllib.error import HTTPError
from urllib.request import ProxyHandler, Request, build_opener

import pytest
from test_playing import Player

from gamms import scenario, web
from gamms.recorder import open as opened
from gamms.web import participants

study_module = sys.modules["gamms.web.study"]  # gamms.web.study is the function
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
    given = {"people": "red", "consent": "Do you agree?", "conditions": CONDITIONS, "rounds": 2, "seconds": 60.0}
    return web.study(ALONE, out=out, **(given | options))


def ask(study, code, browser="the first browser", token=None, **more):
    """Ask as the page does what comes next for a participant."""
    link = study.link(code) if isinstance(code, str) and re.fullmatch(r"[\w.-]{1,64}", code, re.ASCII) else study.url
    address, _, own = link.partition("#")
    url = address.partition("?")[0] + "participant"
    body = json.dumps({"code": code, "secret": f"a secret of {browser}".replace(" ", "-"), **more}).encode()
    try:
        with build_opener(ProxyHandler({})).open(
            Request(url, body, {"Authorization": f"Bearer {token or own}"})
        ) as answer:
            return json.load(answer)["value"]
    except HTTPError as error:
        error.close()
        raise


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
        thread.join(60)
    assert sum(row["participant"] == code for row in study.rows) == count + 1
    return now["practice"], now["round"]


def is_over(player):
    """Whether a player was told that the game is over."""
    return any(told["type"] == "status" and told["over"] for told in player.told)


def test_waiting_ends_with_the_timeout(tmp_path):
    with begun(tmp_path) as study:
        assert not study.wait(1, timeout=0.05)


def test_a_participant_agrees_practises_plays_and_gets_a_row_for_each_round(tmp_path):
    with begun(tmp_path) as study:
        assert ask(study, "P1") == {"stage": "consent", "text": "Do you agree?"}
        assert ask(study, "P1", begin=True)["stage"] == "consent"
        assert ask(study, "P1", agree=True) == {
            "stage": "ready", "text": "", "practice": True, "round": 1, "rounds": 2,
        }  # fmt: skip
        assert [play(study, "P1") for _ in range(3)] == [(True, 1), (False, 1), (False, 2)]
        assert ask(study, "P1", begin=True) == {"stage": "end", "text": "You have played all rounds. Thank you."}
        assert study.wait(1, timeout=60.0)
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


def test_codes_that_are_not_listed_take_no_part(tmp_path):
    with begun(tmp_path, codes=["P1", "P7", "P1"]) as study:
        assert study.codes == ("P1", "P7")
        assert ask(study, "P7", agree=True)["stage"] == "ready"
        with pytest.raises(KeyError, match="P2"):
            study.link("P2")
        with pytest.raises(ValueError, match="a link of its own"):
            study.url  # noqa: B018 - it raises
        assert sum(study.assigned.values()) == 1
    with pytest.raises(ValueError, match=r"A code is 1 to 64 letters.* not 'P 8'"):
        begun(tmp_path, codes=["P 8"])


def test_the_link_of_one_code_is_good_for_no_other_one(tmp_path):
    with begun(tmp_path, codes=["P1", "P2"]) as study:
        token = study.link("P1").partition("#")[2]
        assert token != study.link("P2").partition("#")[2]
        with pytest.raises(HTTPError, match="400"):
            ask(study, "P2", token=token, agree=True)
        assert study._known.by_code == {}
        assert ask(study, "P1", token=token, agree=True)["stage"] == "ready"


def test_one_address_cannot_fill_a_study_by_codes_that_it_makes_up(tmp_path):
    with begun(tmp_path, per_minute=3) as study:
        for number in range(3):
            ask(study, f"P{number}", agree=True)
        with pytest.raises(HTTPError, match="400"):
            ask(study, "P3", agree=True)
        assert ask(study, "P3")["stage"] == "consent"
        assert ask(study, "P2", agree=True)["stage"] == "ready"
        assert len(study._known.by_code) == 3
    with begun(tmp_path / "codes", per_minute=1, codes=["P1", "P2"]) as study:
        assert [ask(study, code, agree=True)["stage"] for code in study.codes] == ["ready"] * 2


def test_rounds_to_which_no_page_connects_take_no_places(tmp_path, monkeypatch):
    monkeypatch.setattr(study_module, "_MOST_AT_ONCE", 2)
    with begun(tmp_path) as study:
        for code in ("P1", "P2", "P3", "P4"):
            ask(study, code, agree=True)
        first = Player(ask(study, "P1", begin=True)["link"].replace("/play", "/"))
        first.read(lambda one: one.told)
        assert ask(study, "P2", begin=True)["stage"] == "play"
        second = Player(ask(study, "P3", begin=True)["link"].replace("/play", "/"))
        second.read(lambda one: one.told)
        playing = [group.members[0] for group in study._known.groups if group.live is not None]
        assert playing == ["P1", "P3"]
        with pytest.raises(HTTPError, match="400"):  # both places are used now
            ask(study, "P4", begin=True)
        assert ask(study, "P2")["stage"] == "ready"
        first.socket.close()
        second.socket.close()


def test_codes_that_are_taken_out_play_no_more_and_others_get_their_conditions(tmp_path):
    with begun(tmp_path) as study:
        for number in range(4):
            ask(study, f"P{number}", agree=True)
        given = {group.members[0]: group.condition for group in study._known.groups}
        play(study, "P1")
        assert ask(study, "P2", begin=True)["stage"] == "play"
        study.take_out("P1")
        command = [sys.executable, "-m", "gamms", "study", "any.yaml", "--out", str(tmp_path), "--take-out", "P[2]"]
        assert subprocess.run(command, check=False, capture_output=True).returncode != 0
        subprocess.run([*command[:-1], "P2*"], check=True, capture_output=True)
        for code in ("P1", "P2", "P22"):
            with pytest.raises(HTTPError, match="400"):
                ask(study, code, agree=True)
        assert [group.live for group in study._known.groups] == [None] * 4
        rest = [given["P0"], given["P3"]]
        assert study.assigned == {name: rest.count(name) for name in CONDITIONS}
        ask(study, "P4", agree=True)
        assert [row["participant"] for row in study.rows] == ["P1"]
    with begun(tmp_path) as study:
        ask(study, "P5", agree=True)
        now = {group.members[0]: group.condition for group in study._known.groups}
        assert sorted(now[code] for code in ("P4", "P5")) == sorted(given[code] for code in ("P1", "P2"))
        assert sorted(one.number for one in study._known.by_code.values()) == [0, 3, 4, 5]
        assert study.assigned == {"short": 2, "long": 2}
        with pytest.raises(HTTPError, match="400"):
            ask(study, "P1")


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


def test_a_code_belongs_to_the_browser_that_has_agreed_with_it(tmp_path):
    with begun(tmp_path) as study:
        ask(study, "P1", agree=True)
        for more in ({}, {"agree": True}, {"begin": True}, {"secret": None}, {"secret": 3}, {"secret": ["a"]}):
            with pytest.raises(HTTPError, match="400"):
                ask(study, "P1", browser="another browser", **more)
        for secret in (None, "", "short", "x" * 101, "with a space and more than 22"):
            with pytest.raises(HTTPError, match="400"):
                ask(study, "P2", agree=True, secret=secret)
        assert ask(study, "P1", agree=True)["stage"] == "ready"  # whose answer may have been lost on its way
    with begun(tmp_path) as study:
        with pytest.raises(HTTPError, match="400"):
            ask(study, "P1", browser="another browser")
        assert ask(study, "P1", begin=True)["stage"] == "play"
        study.release("P1")
        assert ask(study, "P1", browser="another browser")["stage"] == "consent"
        assert ask(study, "P1", browser="another browser", agree=True)["stage"] == "play"
        with pytest.raises(HTTPError, match="400"):
            ask(study, "P1")
        with pytest.raises(KeyError, match="P3"):
            study.release("P3")
    lines = (tmp_path / "participants.jsonl").read_text()
    assert "browser" not in lines
    consent = json.loads(lines.splitlines()[0])
    assert abs(datetime.now(UTC) - datetime.fromisoformat(consent["time"])) < timedelta(minutes=5)


DUEL = scenario.Scenario(
    name="duel",
    map={"grid": {"width": 6, "height": 1}},
    teams={
        "red": {"agents": [{"name": "rita", "node": 0}], "strategy": "human"},
        "blue": {"agents": [{"name": "bob", "node": 5}], "strategy": "human"},
    },
    max_turns=2,
)


def begun_for_two(out, **options):
    """Return a study of pairs in a folder."""
    given = {"consent": "Do you agree?", "practice": 0, "rounds": 2, "seconds": 60.0}
    return web.study(DUEL, out=out, **(given | options))


def paired(study, *codes):
    """Let participants agree and become a pair; return what each of them plays."""
    for code in codes:
        ask(study, code, agree=True)
    return {code: ask(study, code)["role"] for code in codes}


def begin_together(study, *codes):
    """Begin a round of a pair; return who plays, by code."""
    first = ask(study, codes[0], begin=True)
    assert first["stage"] == "wait"
    links = {code: ask(study, code, begin=True)["link"].replace("/play", "/") for code in reversed(codes)}
    return {code: Player(link) for code, link in links.items()}


def finished(study, rows):
    """Wait until the games that are played are over, and there are so many rows."""
    for thread in study._threads:
        thread.join(60)
    assert len(study.rows) == rows
    return study.rows


def test_participants_are_paired_as_they_come_and_the_table_says_with_whom(tmp_path):
    with begun_for_two(tmp_path, conditions={"a": {}, "b": {}}) as study:
        ask(study, "P1", agree=True)
        assert ask(study, "P1") == {"stage": "wait", "within_s": 300.0}
        assert study.assigned == {"a": 0, "b": 0}
        roles = paired(study, "P2") | {"P1": ask(study, "P1")["role"]}
        assert sorted(roles.values()) == ["bob", "rita"]
        assert sorted(study.assigned.values()) == [0, 2]
        others = paired(study, "P3", "P4")
        assert study.assigned == {"a": 2, "b": 2}
        players = begin_together(study, "P1", "P2")
        code_of = {role: code for code, role in roles.items()}
        players[code_of["rita"]].go(0, 1)
        players[code_of["bob"]].question(0)
        players[code_of["bob"]].socket.close()  # leaves, and returns
        link = ask(study, code_of["bob"])["link"].replace("/play", "/")
        players[code_of["bob"]] = Player(link)
        players[code_of["bob"]].go(0, 4)
        players[code_of["bob"]].go(1, 4)
        players[code_of["rita"]].go(1, 2)
        rows = finished(study, 2)
        for player in players.values():
            player.socket.close()
        assert ask(study, "P1")["round"] == 2
    by_role = {row["role"]: row for row in rows}
    assert {role: (row["participant"], row["partner"]) for role, row in by_role.items()} == {
        "rita": (code_of["rita"], code_of["bob"]),
        "bob": (code_of["bob"], code_of["rita"]),
    }
    assert {(row["group"], row["round"], row["choices"], row["missed"]) for row in rows} == {(0, 1, 2, 0)}
    with opened(tmp_path / rows[0]["recording"]) as recording:
        assert recording[2].agents["node"].tolist() == [2, 4]
        assert {event["person"] for event in recording.events() if event["kind"] == "choice"} == {"P1", "P2"}
    with begun_for_two(tmp_path, conditions={"a": {}, "b": {}}) as study:  # all pairs go on
        assert {code: ask(study, code)["role"] for code in ("P3", "P4")} == others
        assert [ask(study, code)["round"] for code in ("P1", "P3")] == [2, 1]


def test_who_has_left_the_page_that_waits_gets_no_partner(tmp_path, monkeypatch):
    monkeypatch.setattr(participants, "_PRESENT_S", 0.0)
    with begun_for_two(tmp_path) as study:
        assert [ask(study, code, agree=True)["stage"] for code in ("P1", "P2")] == ["wait", "wait"]


def test_a_participant_for_whom_no_partner_comes_is_told_so_and_may_wait_again(tmp_path):
    with begun_for_two(tmp_path, partner_within=0.01) as study:
        ask(study, "P1", agree=True)
        while (now := ask(study, "P1"))["stage"] == "wait":
            pass
        assert now == {"stage": "alone", "within_s": 0.01}
        ask(study, "P2", agree=True)  # while the page of the first does not wait
        assert ask(study, "P1")["stage"] == "ready"


def test_a_round_begins_without_a_partner_who_does_not_come_to_it(tmp_path):
    with begun_for_two(tmp_path, partner_within=0.01, seconds=0.05) as study:
        paired(study, "P1", "P2")
        while (now := ask(study, "P1", begin=True))["stage"] == "wait":
            pass
        player = Player(now["link"].replace("/play", "/"))
        rows = finished(study, 2)
        player.socket.close()
        assert ask(study, "P2")["round"] == 2
    assert [row["missed"] for row in rows] == [2, 2]
    with opened(tmp_path / rows[0]["recording"]) as recording:
        absent = [event["outcome"] for event in recording.events() if event["person"] == "P2"]
    assert absent == ["not there"] * 2


def test_neither_of_a_pair_may_choose_for_the_other(tmp_path):
    with begun_for_two(tmp_path) as study:
        paired(study, "P1", "P2")
        players = begin_together(study, "P1", "P2")
        other = players["P2"].question(0)["question"]
        players["P1"].question(0)
        assert "another player" in players["P1"].refused(question=other, move=0)
        for player in players.values():
            player.socket.close()


@pytest.mark.parametrize("name", ["study.jsonl", "rows.jsonl", "participants.jsonl"])
@pytest.mark.parametrize("line", ["{", "[]", '{"odd": 1}', '{"group": 3, "played": 1, "attempt": 1}'])
def test_a_damaged_line_of_the_folder_is_named(tmp_path, name, line):
    begun(tmp_path).close()
    (tmp_path / name).write_text(line + "\n")
    with pytest.raises(ValueError, match=r"line 1, is not a .* study: .* Delete the line|holds another study"):
        begun(tmp_path)


def test_impossible_studies_are_refused_before_they_begin(tmp_path):
    for wrong in ({"codes": 3}, {"codes": "P1"}, {"people": 3}, {"people": [3]}):
        with pytest.raises(TypeError, match=next(iter(wrong))):
            begun(tmp_path, **wrong)
    with pytest.raises(KeyError, match="gren"):
        begun(tmp_path, people="gren")
    with pytest.raises(ValueError, match="give 'bob' another strategy than human"):
        begun(tmp_path, conditions={"a": {"teams.blue.strategy": "human"}})
    with pytest.raises(ValueError, match="nothing to play for 'red'"):
        begun(tmp_path, people=["red", "rita"])
    with pytest.raises(ValueError, match="write strategy: human"):
        begun(tmp_path, people=None)
    with pytest.raises(ValueError, match="partner_within must be more than 0, not -1"):
        begun(tmp_path, partner_within=-1)
    with pytest.raises(ValueError, match="colour"):
        begun(tmp_path, conditions={"a": {"colour": 1}})
