"""A key never reaches a log, a recording, a result, a file or an error."""

import json
import logging
import re
import traceback

import pytest
from loopback import KEY, Refusal, free_port, new_game, outcomes

import gamms
from gamms.llm import Strategy

ESCAPED = "".join(f"\\u{ord(one):04x}" for one in KEY)
LEAKS = {  # what a server may do to get a key into what others read
    "an answer": lambda request: {"move": KEY},
    "a field": lambda request: {"move": 1, KEY: KEY},
    "an escaped answer": lambda request: f'{{"move": "{ESCAPED}"}}',
    "no JSON": lambda request: f"Bearer {KEY}",
    "a response": lambda request: KEY.encode(),
    "a message": lambda request: {"move": 1, "messages": [{"channel": "radio", "to": None, "body": f"it is {KEY}!"}]},
}
REFUSED = json.dumps({"error": {"message": f"Incorrect API key provided: {KEY}"}}).encode()


def client_of(**given):
    """A client of the library, which takes 0.7 s to load: not where tests are only collected."""
    import openai

    return openai.AsyncOpenAI(**given)


def raising(refusal):
    def script(_):
        raise refusal

    return script


LEAKS |= {f"HTTP {status}": raising(Refusal(status, REFUSED, x_key=KEY)) for status in (301, 400, 401, 429, 500)}


def everything_written(folder):
    return b"".join(file.read_bytes() for file in folder.rglob("*") if file.is_file())


@pytest.mark.parametrize("is_own", [False, True], ids=["address", "client"])
def test_a_server_that_sends_the_key_back_gets_it_nowhere(server, tmp_path, caplog, is_own):
    leaks = iter(LEAKS.values())

    def script(request):
        return next(leaks)(request)

    server.script = script
    client = client_of(base_url=server.url, api_key=KEY) if is_own else server.url
    options = {} if is_own else {"key_variable": "LOOPBACK_KEY"}
    strategy = Strategy(client, "m", "Go.", attempts=1, calls=tmp_path / "calls.jsonl", **options)
    with caplog.at_level(logging.DEBUG), new_game(strategy) as ctx:
        ctx.logger.propagate = True
        ctx.game.add_channel("radio", range_m=100)
        ctx.record.start(tmp_path / "game.ggr", sensed=True)
        result = ctx.game.run(len(LEAKS))
    assert server.headers[0]["authorization"] == f"Bearer {KEY}"
    assert [one["body"] for one in result.messages] == ["it is <hidden>!"]
    result.save(tmp_path / "result.json")
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        recorded = str([*recording.events(), *recording.steps(), recording.header])
    assert KEY not in str(result.to_dict())
    assert KEY not in recorded
    assert KEY.encode() not in everything_written(tmp_path)
    assert KEY not in caplog.text


def test_a_key_is_not_in_printed_or_copied_strategies(strategy_of, tmp_path):
    import copy

    strategy = strategy_of()
    assert re.fullmatch(r"Strategy\('loop-1', http://127\.0\.0\.1:\d+, calls=no file\)", repr(strategy))
    with new_game(strategy) as ctx:
        ctx.game.run(1)
        shown = [repr(one) for one in (strategy, copy.deepcopy(strategy), ctx, ctx.game, *ctx.game.rules)]
        assert KEY not in str(shown)
        assert KEY not in str(ctx.game.result().provenance)


def test_errors_have_no_key_and_no_context_that_has_one(strategy_of):
    def broken(state):
        raise RuntimeError("broken fallback")

    address = f"http://127.0.0.1:{free_port()}/v1"
    strategy = Strategy(address, "m", "Go.", key_variable="LOOPBACK_KEY", fallback=broken, attempts=1)
    with new_game(strategy) as ctx, pytest.raises(RuntimeError, match="broken fallback") as raised:
        ctx.game.run(1)
    assert raised.value.__context__ is None
    whole = traceback.TracebackException.from_exception(raised.value, capture_locals=True)
    assert KEY not in "".join(whole.format())


@pytest.mark.parametrize(
    ("address", "message"),
    [
        (f"https://user:{KEY}@example.org/v1", "without user, password or query"),
        (f"https://example.org/v1?api_key={KEY}", "without user, password or query"),
        (f"https://example.org/v1#{KEY}", "without user, password or query"),
        (KEY, "The address of a server must be like"),
        (f"ftp://{KEY}", "The address of a server must be like"),
        (f"http://[{KEY}/", "The address of a server must be like"),
    ],
)
def test_an_address_holds_no_secrets_and_is_not_shown(address, message):
    with pytest.raises(ValueError, match=message) as raised:
        Strategy(address, "m", "Go.")
    shown = traceback.format_exception(raised.value)
    assert KEY not in str(raised.value)
    assert KEY not in "".join(shown)


def test_the_key_itself_is_no_name_of_a_variable():
    with pytest.raises(ValueError, match="never the key itself") as raised:
        Strategy("http://localhost/v1", "m", "Go.", key_variable=KEY)
    assert KEY not in "".join(traceback.format_exception(raised.value))
    with pytest.raises(KeyError, match="environment variable that key_variable names") as raised:
        Strategy("http://localhost/v1", "m", "Go.", key_variable=KEY.replace("-", "_"))
    assert KEY.replace("-", "_") not in str(raised.value)
    for variable, shown in (("NO_SUCH_KEY", "'NO_SUCH_KEY'"), ("N" * 40, "N" * 40), ("N" * 41, "that key_variable")):
        with pytest.raises(KeyError, match=f"environment variable .*{shown}"):
            Strategy("http://localhost/v1", "m", "Go.", key_variable=variable)


def test_a_server_that_needs_no_key_gets_none(server, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-of-another-server-123")
    with new_game(Strategy(server.url, "m", "Go.")) as ctx:
        assert outcomes(ctx.game.run(1)) == ["answer"]
    assert "sk-of-another-server-123" not in str(server.headers)


def test_secrets_in_headers_and_addresses_of_a_client_are_hidden_too(server, caplog):
    secret = "header-secret-98765"
    client = client_of(
        base_url=server.url,
        api_key="none",
        default_headers={"api-key": secret},
        default_query={"token": "query-secret-4321"},
    )
    server.script = lambda _: f"{secret} query-secret-4321"
    with caplog.at_level(logging.DEBUG), new_game(Strategy(client, "m", "Go.", attempts=1)) as ctx:
        result = ctx.game.run(1)
    assert secret not in str(result.to_dict())
    assert outcomes(result) == ["wrong answer: it has no JSON object"]
    assert "query-secret" not in caplog.text
    assert "<hidden>" in caplog.text  # the library logs the address


def test_a_key_that_a_function_gives_is_hidden_too(server):
    secret = "sk-from-a-function-987"

    async def key():
        return secret

    server.script = lambda _: f"it is {secret}"
    client = client_of(base_url=server.url, api_key=key)
    with new_game(Strategy(client, "m", "Go.", attempts=2)) as ctx:
        result = ctx.game.run(1)
    assert server.headers[0]["authorization"] == f"Bearer {secret}"
    assert server.requests[1]["messages"][2]["content"] == "it is <hidden>"
    assert secret not in str(result.to_dict())
