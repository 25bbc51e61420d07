"""A game that was recorded plays again and goes on without the server: the same game, to the last byte."""

import json

import pytest
from loopback import Refusal, new_game, outcomes

import gamms
from gamms.llm import MissingDecision, Strategy


def replaying(calls, **options):
    return Strategy(None, "loop-1", "Go east.", calls=calls, **{"seconds": 20, **options})


@pytest.fixture
def played(server, strategy_of, tmp_path):
    """A game of four turns, of which the third is a fallback; its recording, and the file of its decisions."""

    def script(request):
        if "Turn 2." in request["messages"][1]["content"]:
            raise Refusal(400)
        return {"move": 1}

    server.script = script
    calls, file = tmp_path / "game.jsonl", tmp_path / "game.ggr"
    with new_game(strategy_of(calls=calls, price_in=1.0), ["anna", "bert"]) as ctx:
        ctx.record.start(file)
        result = ctx.game.run(4)
    assert outcomes(result) == [*["answer"] * 4, *["HTTP 400"] * 2, *["answer"] * 2]
    server.script = None  # from here on it is not asked
    return result, calls, file


@pytest.mark.parametrize("source", ["game.jsonl", "game.ggr"])
def test_a_game_plays_again_without_the_server(played, tmp_path, source):
    result, _, file = played
    again = tmp_path / "again.ggr"
    with new_game(replaying(tmp_path / source, price_in=1.0), ["anna", "bert"]) as ctx:
        ctx.record.start(again)
        assert ctx.game.run(4) == result
    assert again.read_bytes() == file.read_bytes()


@pytest.mark.parametrize("source", ["game.jsonl", "game.ggr"])
def test_a_recording_goes_on_without_the_server(played, tmp_path, source):
    result, _, file = played
    strategy = replaying(tmp_path / source, price_in=1.0)
    with gamms.recorder.open(file) as recording, recording.resume(1, strategies={"red": strategy}) as ctx:
        later = ctx.game.run(3)
        totals = list(ctx.game.data["llm"].values())
    assert later.events == result.events
    assert totals == [{"calls": 8, "input_tokens": 600, "output_tokens": 60, "cost": 600 / 1e6, "fallbacks": 2}]


def test_a_recording_replays_without_any_strategy(played):
    result, _, file = played
    with gamms.create_context() as ctx:
        for _ in ctx.record.replay(file):
            pass
        assert [event for event in ctx.game.events if event["kind"] == "llm"] == result.events


def test_an_unrecorded_decision_is_an_error_without_a_server(played):
    _, calls, _ = played
    message = r"agent 'anna' in turn 1 is not in '.*game.jsonl'.*its seed"
    ctx = new_game(replaying(calls, price_in=1.0), ["anna", "bert"], seed=2)
    with ctx, pytest.raises(MissingDecision, match=message):
        ctx.game.run(1)


def test_every_call_is_in_the_file(server, strategy_of, tmp_path):
    calls = tmp_path / "calls.jsonl"
    server.script = lambda request: {"move": 1} if len(request["messages"]) > 2 else "hello"
    with new_game(strategy_of(calls=calls)) as ctx:
        ctx.game.run(1)
    header, line = map(json.loads, calls.read_text().splitlines())
    assert header == {"format": "gamms llm decisions 1"}
    assert [one["answered"] for one in line["log"]] == ["hello", '{"move": 1}']
    assert "Your moves:" in line["log"][0]["asked"]
    assert line["log"][1]["asked"] == "That does not count: it has no JSON object. Answer again."
    assert [one["outcome"] for one in line["log"]] == ["answer", "answer"]
    assert all(one["seconds"] >= 0 for one in line["log"])
    assert (line["agent"], line["turn"], line["answer"], line["calls"]) == ("anna", 1, '{"move": 1}', 2)


def test_a_recorded_answer_that_is_no_longer_legal_is_a_fallback(played):
    _, calls, _ = played
    calls.write_text(calls.read_text().replace('{\\"move\\": 1}', '{\\"move\\": 99}'))
    with new_game(replaying(calls, price_in=1.0), ["anna", "bert"]) as ctx:
        result = ctx.game.run(1)
        assert ctx.agent.get_agent("anna").current_node_id == 0
    assert result.errors == []


HEADER = b'{"format": "gamms llm decisions 1"}\n'
LINE = b'{"turn": 1, "agent": "a", "request": "r", "outcome": "answer", "answer": null, "calls": %s, "cost": %s, '
REST = b'"input_tokens": 0, "output_tokens": 0}\n'
BAD = {
    "of another kind": b"hello\n",
    "of another format": b'{"format": "x"}\n',
    "deep": HEADER + b"[" * 100_000 + b"\n",
    "a list": HEADER + b"[]\n",
    "incomplete": HEADER + b'{"turn": 1}\n',
    "negative": HEADER + LINE % (b"-1", b"0") + REST,
    "not finite": HEADER + LINE % (b"1", b"NaN") + REST,
}


@pytest.mark.parametrize("content", BAD.values(), ids=BAD)
def test_a_file_of_another_kind_is_refused_and_left_alone(tmp_path, content):
    file = tmp_path / "calls.jsonl"
    file.write_bytes(content)
    with pytest.raises(gamms.errors.BadFile, match="is not a file of decisions of language models, in line"):
        replaying(file)
    assert file.read_bytes() == content


def test_a_file_goes_on_after_a_program_that_was_killed_as_it_wrote(server, strategy_of, played):
    _, calls, _ = played
    whole = calls.read_bytes()
    calls.write_bytes(whole[:-40])
    server.script = lambda _: {"move": 1}
    server.requests.clear()
    with new_game(strategy_of(calls=calls, price_in=1.0), ["anna", "bert"]) as ctx:
        ctx.game.run(4)
    assert calls.read_bytes().startswith(whole[: whole.rindex(b"\n", 0, -40) + 1])
    with new_game(replaying(calls, price_in=1.0), ["anna", "bert"]) as ctx:
        assert outcomes(ctx.game.run(4)) == ["answer"] * 8


def test_a_file_whose_first_decision_was_cut_off_has_none(tmp_path):
    file = tmp_path / "calls.jsonl"
    file.write_bytes(HEADER + (LINE % (b"1", b"0"))[:-9])
    assert replaying(file) is not None


def test_a_file_that_two_programs_have_begun_is_read(played):
    result, calls, _ = played
    header, lines = calls.read_bytes().split(b"\n", 1)
    calls.write_bytes(header + b"\n" + header + b"\n" + lines)
    with new_game(replaying(calls, price_in=1.0), ["anna", "bert"]) as ctx:
        assert ctx.game.run(4) == result


def test_events_of_another_kind_in_a_recording_are_refused(tmp_path):
    with new_game(None) as ctx:
        ctx.record.start(tmp_path / "game.ggr")
        ctx.game.add(lambda ctx: ctx.game.emit("llm", agent="anna"))
        ctx.game.run(1)
    with pytest.raises(
        gamms.errors.BadFile, match=r"game\.ggr' is not a file of decisions of language models, in turn 1"
    ):
        replaying(tmp_path / "game.ggr")


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    file = tmp_path / "calls.jsonl"
    file.write_bytes(b" " * 100_000)
    with gamms.limits.allowing(1 << 20), pytest.raises(gamms.errors.TooLarge):
        replaying(file)


def test_a_recording_that_is_not_there_is_an_error_at_once(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.ggr"):
        replaying(tmp_path / "none.ggr")
    with pytest.raises(FileNotFoundError, match="no file"):
        replaying(tmp_path / "none" / "calls.jsonl")


def test_a_batch_plays_the_games_that_are_played_alone(server, strategy_of, tmp_path):
    def script(request):
        return {"move": len(request["messages"][1]["content"]) % 2}

    server.script = script
    scenario = gamms.scenario.Scenario(
        map={"grid": {"width": 5, "height": 1}},
        max_turns=3,
        teams={"red": {"count": 2, "strategy": "gamms.strategies:stay"}},
    )
    alone = [scenario.play(seed=seed, strategies={"red": strategy_of()}) for seed in (1, 2)]
    games = scenario.batch(2, seed=1, strategies={"red": strategy_of()})
    games.run()
    assert [games.result(i) for i in range(2)] == alone
    assert outcomes(alone[0]) == ["answer"] * 6
