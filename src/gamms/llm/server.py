"""One request to an OpenAI-compatible server: bounded in size, and no secret of the client gets out of here."""

import json
import logging
import os
import re
from collections.abc import Mapping
from functools import cache
from traceback import format_exception
from typing import TYPE_CHECKING, Any, NamedTuple, cast
from urllib.parse import urlsplit

from gamms.arguments import as_text
from gamms.errors import BadType, BadValue, MissingKey
from gamms.extras import needing
from gamms.plain import Plain
from gamms.text import printable_line, shown

if TYPE_CHECKING:
    from openai import AsyncOpenAI

_MOST_BYTES = 1 << 20  # of an answer
_MOST_OF_AN_ERROR = 1 << 12  # bytes that are read of what a server says of an error
_MOST_SHOWN = 200  # characters of it
_MOST_WAITING_S = 60.0
_MOST_TOKENS = 1 << 40  # that a server may say it took
_SHORTEST_SECRET = 8  # characters: shorter keys, such as "none", are words that texts may have
_HIDDEN = "<hidden>"
_PUBLIC_HEADERS = re.compile(r"accept|content-type|user-agent|x-stainless-.*|openai-(organization|project|beta)")
_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")
_AGAIN = frozenset({408, 409, 425, 429})  # statuses after which a request may be sent again, as after those from 500 on
_LOGGERS = (  # of the libraries, which log addresses, and at DEBUG what servers send in headers
    *("openai", "openai._base_client", "httpx", "httpx2"),
    *(f"httpcore{version}.{part}" for version in ("", "2") for part in ("connection", "http11", "http2", "proxy")),
)
_UNSPOKEN = frozenset({401, 403, 407})  # statuses whose texts may show parts of keys


class Reply(NamedTuple):
    """What came of one request.

    Attributes:
        text: what the model answered; None: nothing.
        problem: why there is no answer.
        is_passing: whether it may help to ask again.
        wait_s: how long the server wants to be left alone before.
        tokens: of the question and of the answer, as the server counts them; None: it has not said, and they may count.
    """

    text: str | None
    problem: str = ""
    is_passing: bool = False
    wait_s: float = 0.0
    tokens: tuple[int, int] | None = None


class _Refused(Exception):
    """A response that is not read to its end."""

    def __init__(self, reply: Reply) -> None:
        super().__init__()  # without words: libraries log exceptions
        self.reply = reply


def connect(base_url: str, key_variable: str | None = None) -> "AsyncOpenAI":
    """Return a client of an OpenAI-compatible server that follows no redirects and reads no endless errors.

    Args:
        base_url: such as "http://localhost:11434/v1".
        key_variable: the name of the environment variable that holds the key; None: the server needs none.

    Raises:
        BadType, BadValue: the address is none, or holds a password or a query; the name is none.
        MissingKey (KeyError): there is no such variable.
        MissingExtra (ImportError): the library `openai` is not installed.
    """
    address, openai = _as_address(base_url), _library()
    http = _http_client()
    return as_client(openai.AsyncOpenAI(base_url=address, api_key=_key_in(key_variable), http_client=http))


@cache
def _http_client() -> Any:
    """Return what all clients of `connect` send requests with: it takes 40 ms to make, and agents have one each."""
    return _library().DefaultAsyncHttpxClient(follow_redirects=False, event_hooks={"response": [_refuse_errors]})


def as_client(client: object) -> "AsyncOpenAI":
    """Check that a value is a client that can be awaited.

    Raises:
        BadType: it is not.
        MissingExtra (ImportError): the library `openai` is not installed.
    """
    openai = _library()
    if isinstance(client, openai.OpenAI):
        raise BadType("client is an openai.OpenAI, which would stop the game while it waits: make it an AsyncOpenAI.")
    if not isinstance(client, openai.AsyncOpenAI):
        raise BadType(
            "client must be an openai.AsyncOpenAI, the address of a server such as 'http://localhost:11434/v1', or "
            f"None to play what was recorded, not of type {type(client).__name__}."
        )
    made = cast("AsyncOpenAI", client)
    made.chat.completions  # noqa: B018 - which loads what takes a second, and a turn may have less
    return made


def host_of(client: "AsyncOpenAI") -> str:
    """Return the address of a client's server without what may be secret in it: paths are, too, at some gateways."""
    url = urlsplit(str(client.base_url))
    return f"{url.scheme}://{url.hostname}{f':{url.port}' if url.port else ''}"


async def ask(client: "AsyncOpenAI", request: Mapping[str, Plain]) -> Reply:
    """Send a request and return what came of it; only cancelling raises.

    Nothing that the client raises gets out, with its headers: neither as an error nor as the context of one.
    """
    reply: Reply | None = None
    sender = client.with_options(max_retries=0)
    _hide_secrets_of(sender)
    try:
        body = await _body(sender, dict(request))
    except Exception as error:  # noqa: BLE001 - whatever a library of HTTP raises
        reply = _reply_of_error(error)
    _hide_secrets_of(sender)  # again: the key may be what a function has given just now
    reply = _reply_in(body) if reply is None else reply
    return reply._replace(text=without_secrets(reply.text), problem=without_secrets(reply.problem))


def without_secrets(value: Any) -> Any:
    """Return a plain value of JSON without the secrets of any client, also in the keys of dicts."""
    if isinstance(value, str):
        for secret in sorted(_secrets, key=len, reverse=True):
            value = value.replace(secret, _HIDDEN)
        return value
    if isinstance(value, dict):
        return {without_secrets(key): without_secrets(one) for key, one in value.items()}
    return [without_secrets(one) for one in value] if isinstance(value, list) else value


_secrets: set[str] = set()  # of all clients that were used


class _HidingFilter(logging.Filter):
    """Hides secrets in what a library logs."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Let every record pass, without the secrets."""
        text = record.getMessage()
        if record.exc_info and record.exc_info[0] is not None:
            text += "\n" + "".join(format_exception(*record.exc_info))
        safe = without_secrets(text)
        if safe != text:
            record.msg, record.args, record.exc_info = safe, (), None
        return True


_filter = _HidingFilter()


def _hide_secrets_of(client: "AsyncOpenAI") -> None:
    """Hide all texts of a client that must not get out, from now on."""
    headers = [str(one) for name, one in client.default_headers.items() if not _PUBLIC_HEADERS.fullmatch(name.lower())]
    url = urlsplit(str(client.base_url))
    found = [client.api_key, *client.auth_headers.values(), *headers, url.password, url.username, *url.query.split("=")]
    found += [str(one) for one in (client.default_query or {}).values()]
    _secrets.update(word for one in found if one for word in (one, *one.split()) if len(word) >= _SHORTEST_SECRET)
    for name in _LOGGERS:
        logging.getLogger(name).addFilter(_filter)  # which adds it once


def _library() -> Any:
    with needing("Asking a language model", "llm"):
        import openai
    return openai


def _as_address(value: object) -> str:
    text = as_text(value, "base_url")
    try:
        url = urlsplit(text)
        is_address = url.scheme in ("http", "https") and bool(url.hostname) and url.port != 0
    except ValueError:
        is_address = False
    if not is_address or "@" in text or "?" in text or "#" in text:
        raise BadValue(
            "The address of a server is one such as 'https://api.openai.com/v1', without user, password or query. "
            "(What was given is not shown, because it may hold a key. The key goes into an environment variable.)"
        )
    return text


def _key_in(variable: object) -> str:
    if variable is None:
        return "none"  # the library needs one
    if not isinstance(variable, str) or not _VARIABLE.fullmatch(variable):
        raise BadValue(
            "key_variable is the name of an environment variable, such as 'OPENAI_API_KEY', never the key itself. "
            "(What was given is not shown.)"
        )
    if not os.environ.get(variable):
        raise MissingKey(f"There is no key in the environment variable {_cut_name(variable)}: set it first.")
    return os.environ[variable]


def _cut_name(variable: str) -> str:
    """Return a name of a variable, but for one that looks like a key."""
    return shown(variable) if variable.isupper() and len(variable) <= 40 else "that key_variable names"


# -- the exchange -----------------------------------------------------------------------------------------------


async def _body(client: "AsyncOpenAI", fields: dict[str, Any]) -> bytes:
    model, messages = fields.pop("model"), fields.pop("messages")
    # One connection for each request: one that is kept belongs to an event loop, and every game has its own.
    headers = {"Accept-Encoding": "identity", "Connection": "close"}
    create = client.chat.completions.with_streaming_response.create
    sent = create(model=model, messages=messages, extra_body=fields, extra_headers=headers)
    async with sent as response:
        if response.headers.get("content-encoding", "identity") != "identity":
            raise _Refused(Reply(None, "a packed answer, which was not asked for"))
        return await _read(response.http_response, _MOST_BYTES)


async def _read(response: Any, most: int) -> bytes:
    read = bytearray()
    async for part in response.aiter_raw():
        read += part
        if len(read) > most:
            raise _Refused(Reply(None, f"an answer of more than {most} bytes"))
    return bytes(read)


async def _refuse_errors(response: Any) -> None:
    """Read a little of a response that is no success, and no more."""
    if response.status_code < 300:
        return
    read = b""
    if response.status_code not in _UNSPOKEN:
        async for part in response.aiter_raw():
            read += part[:_MOST_OF_AN_ERROR]
            if len(read) >= _MOST_OF_AN_ERROR:
                break
    raise _Refused(_refusal(response.status_code, response.headers, read))


def _reply_of_error(error: Exception) -> Reply:
    """Return what an exception of the client means."""
    openai = _library()
    for one in (error, error.__cause__):
        if isinstance(one, _Refused):
            return one.reply
    if isinstance(error, openai.APIStatusError):
        response = error.response
        return _refusal(response.status_code, response.headers, response.content[:_MOST_OF_AN_ERROR])
    if isinstance(error, (openai.APITimeoutError, TimeoutError)):
        return Reply(None, "timeout", is_passing=True)
    return Reply(None, f"no connection ({type(error).__name__})", is_passing=True, tokens=(0, 0))


def _refusal(status: int, headers: Mapping[str, str], body: bytes) -> Reply:
    """Return the reply of a response that is no success."""
    problem = f"HTTP {status}"
    if status not in _UNSPOKEN:
        said = _error_in(body)
        problem += f": {said}" if said else ""
    try:
        wait = float(headers.get("retry-after") or 0.0)
    except ValueError:
        wait = 0.0
    wait = wait if 0.0 <= wait <= _MOST_WAITING_S else _MOST_WAITING_S
    return Reply(None, problem, is_passing=status in _AGAIN or status >= 500, wait_s=wait, tokens=(0, 0))


def _error_in(body: bytes) -> str:
    """Return what a server says of an error, on one line and cut."""
    try:
        said = _at(json.loads(body), "error", "message")
    except (ValueError, RecursionError):
        said = None
    return printable_line(said[:_MOST_SHOWN]) if isinstance(said, str) else ""


def _reply_in(body: bytes) -> Reply:
    """Return the answer of a model in a response."""
    try:
        plain = json.loads(body)
    except (ValueError, RecursionError):
        return Reply(None, "a response that is no JSON", is_passing=True)
    tokens = (_at(plain, "usage", "prompt_tokens"), _at(plain, "usage", "completion_tokens"))
    counted = tokens if all(type(one) is int and one in range(_MOST_TOKENS) for one in tokens) else None
    message = _at(plain, "choices", 0, "message")
    text = _at(message, "tool_calls", 0, "function", "arguments") or _at(message, "content")
    if not isinstance(text, str) or not text:
        return Reply(None, "a response without an answer", is_passing=True, tokens=counted)
    return Reply(text, tokens=counted)


def _at(value: Any, *path: str | int) -> Any:
    """Return what is at a place in plain values; None if there is nothing."""
    for step in path:
        if isinstance(step, str) and isinstance(value, dict):
            value = value.get(step)
        elif isinstance(step, int) and isinstance(value, list) and step < len(value):
            value = value[step]
        else:
            return None
    return value
