"""Servers that are slow, wrong, hostile or not there: the game goes on, in time, with the fallback."""

import logging
import threading
import time

import pytest
from loopback import Refusal, free_port, new_game, outcomes, wait_until

import gamms

HEAD = b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\n"


def raising(refusal):
    def script(_):
        raise refusal

    return script


@pytest.fixture
def stopped():
    """Is set when the test ends, so that a server need not sleep longer."""
    event = threading.Event()
    yield event
    event.set()


def test_a_server_that_is_slow_is_given_up(server, strategy_of, stopped):
    server.script = lambda _: stopped.wait(5) and {"move": 1}
    with new_game(strategy_of(seconds=0.1)) as ctx:
        assert outcomes(ctx.game.run(1)) == ["timeout"]


def test_the_fallback_plays_before_the_deadline_of_the_turn(server, strategy_of, stopped, monkeypatch):
    monkeypatch.setattr(gamms.llm.asking, "_RESERVED_S", 1.0)  # for a machine that is busy
    server.script = lambda _: stopped.wait(5) and {"move": 1}
    fallback = lambda state: state.update(action=state["legal"][-1])
    with new_game(strategy_of(seconds=60, fallback=fallback)) as ctx:
        ctx.game.deadline_s = 2.0
        result = ctx.game.run(1)
        assert ctx.agent.get_agent("anna").current_node_id == 1
    assert outcomes(result) == ["timeout"]
    assert result.errors == []


def test_a_server_that_is_not_there(strategy_of):
    strategy = gamms.llm.Strategy(f"http://127.0.0.1:{free_port()}/v1", "loop-1", "Go.", attempts=1)
    with new_game(strategy) as ctx:
        result = ctx.game.run(2)
    assert outcomes(result) == ["no connection (APIConnectionError)"] * 2
    assert result.table("llm")["input_tokens"].tolist() == [0, 0]


def test_a_server_that_hangs_up(server, strategy_of):
    server.script = lambda _: lambda wfile: wfile.write(b"")
    with new_game(strategy_of(attempts=1)) as ctx:
        assert outcomes(ctx.game.run(1)) == ["no connection (APIConnectionError)"]


def endless(first, again, stopped):
    def write(wfile):
        wfile.write(first)
        while not stopped.is_set():
            wfile.write(again)

    return lambda _: write


@pytest.mark.parametrize(
    ("first", "again", "outcome"),
    [
        (HEAD + b"\r\n", b" " * 65536, "an answer of more than 1048576 bytes"),
        (HEAD, b"x-more: " + b"x" * 65536 + b"\r\n", "no connection (APIConnectionError)"),
        (b"HTTP/1.1 400 No\r\n\r\n", b" " * 65536, "HTTP 400"),
        (b"HTTP/1.1 500 No\r\n\r\n", b" " * 65536, "HTTP 500"),
    ],
    ids=["answer", "headers", "error of ours", "error of the server"],
)
def test_endless_answers_are_cut_off(server, strategy_of, stopped, first, again, outcome):
    server.script = endless(first, again, stopped)
    with new_game(strategy_of(attempts=1)) as ctx:
        assert outcomes(ctx.game.run(1)) == [outcome]


def test_headers_that_come_slowly_are_given_up(server, strategy_of, stopped):
    def write(wfile):
        while not stopped.wait(0.01):
            wfile.write(b"x")

    server.script = lambda _: write
    with new_game(strategy_of(seconds=0.1)) as ctx:
        assert outcomes(ctx.game.run(1)) == ["timeout"]


def test_a_packed_answer_is_not_unpacked(server, strategy_of):
    server.script = lambda _: lambda wfile: wfile.write(HEAD + b"content-encoding: gzip\r\n\r\n\x1f\x8b")
    with new_game(strategy_of(attempts=1)) as ctx:
        assert outcomes(ctx.game.run(1)) == ["a compressed answer, which was not requested"]


def test_redirects_are_not_followed(server, strategy_of):
    server.script = raising(Refusal(307, location=server.url + "/elsewhere"))
    with new_game(strategy_of()) as ctx:
        assert outcomes(ctx.game.run(1)) == ["HTTP 307"]
    assert len(server.requests) == 1


def test_a_busy_server_is_asked_again(server, strategy_of, monkeypatch):
    monkeypatch.setattr(gamms.llm.asking, "_BACKOFF_S", 0.01)
    refusals = iter([Refusal(429, retry_after="0.02"), Refusal(503)])

    def script(_):
        for refusal in refusals:
            raise refusal
        return {"move": 1}

    server.script = script
    with new_game(strategy_of()) as ctx:
        result = ctx.game.run(1)
    assert outcomes(result) == ["answer"]
    assert result.table("llm")["calls"] == [3]
    assert result.table("llm")["input_tokens"] == [100]


def test_a_server_that_wants_more_time_than_there_is_gets_none(server, strategy_of):
    server.script = raising(Refusal(429, retry_after="50"))
    with new_game(strategy_of(seconds=5)) as ctx:
        assert outcomes(ctx.game.run(1)) == ["HTTP 429"]
    assert len(server.requests) == 1


def test_the_agents_of_a_turn_are_asked_together(server, strategy_of):
    waiting = threading.Barrier(3)

    def script(_):
        waiting.wait(30)
        return {"move": 1}

    server.script = script
    with new_game(strategy_of(), ["anna", "bert", "cleo"]) as ctx:
        assert outcomes(ctx.game.run(1)) == ["answer"] * 3


def test_only_so_many_are_asked_at_once(server, strategy_of):
    pair = threading.Barrier(2)

    def script(_):
        pair.wait(30)
        time.sleep(0.01)  # for a third, which is not asked
        return {"move": 1}

    server.script = script
    with new_game(strategy_of(at_once=2), [f"a{i}" for i in range(6)]) as ctx:
        assert outcomes(ctx.game.run(1)) == ["answer"] * 6
    assert server.most_at_once == 2


def test_a_client_of_ones_own_is_bounded_in_time_and_size(server, stopped):
    import openai

    client = openai.AsyncOpenAI(base_url=server.url, api_key="sk-own-client-12345")
    with new_game(gamms.llm.Strategy(client, "loop-1", "Go.", attempts=1)) as ctx:
        server.script = endless(HEAD + b"\r\n", b" " * 65536, stopped)
        assert outcomes(ctx.game.run(1)) == ["an answer of more than 1048576 bytes"]
        server.script = raising(Refusal(400, b'{"error": {"message": "no such field"}}'))
        assert outcomes(ctx.game.run(1))[-1] == "HTTP 400: no such field"
    with new_game(gamms.llm.Strategy(client, "loop-1", "Go.", seconds=0.1)) as ctx:
        server.script = lambda _: stopped.wait(5) and {"move": 1}
        assert outcomes(ctx.game.run(1)) == ["timeout"]


def test_one_warning_says_that_the_fallback_plays(server, strategy_of, caplog):
    server.script = raising(Refusal(500))
    with new_game(strategy_of(attempts=1)) as ctx, caplog.at_level(logging.WARNING, "gamms"):
        ctx.logger.propagate = True
        ctx.game.run(3)
    warnings = [one.getMessage() for one in caplog.records if "fallback" in one.getMessage()]
    assert warnings == ["Agent 'anna' plays its fallback in turn 1: HTTP 500. Further ones are in result.table('llm')."]


def test_the_server_is_left_when_the_game_is_over(server, strategy_of, stopped):
    server.script = lambda _: stopped.wait(5) and {"move": 1}
    with new_game(strategy_of(seconds=0.05)) as ctx:
        ctx.game.run(1)
    stopped.set()
    wait_until(lambda: not server._now)
