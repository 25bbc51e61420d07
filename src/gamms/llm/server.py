"""One request to an OpenAI-compatible server: bounded in size, and without leaking secrets of the client."""

import json
import logging
import os
import re
from collections.abc import Mapping
from functools import cache
from itertools import chain, product
from traceback import format_exception
from typing import TYPE_CHECKING, Any, NamedTuple, cast
from urllib.parse import urlsplit

from gamms.arguments import as_text
from gamms.errors import BadType, BadValue, MissingKey
from gamms.plain import Plain
from gamms.plugins import require_extra
from gamms.text import make_printable_line, shown

if TYPE_CHECKING:
    from openai import AsyncOpenAI

_MOST_BYTES = 1 << 20  # the size of an answer
_MOST_OF_AN_ERROR = 1 << 12  # bytes of an error response that are read
_MOST_SHOWN = 200  # characters of an error that are shown
_MOST_WAITING_S = 60.0
_MOST_TOKENS = 1 << 40  # the most tokens that a server may report
_SHORTEST_SECRET = 8  # characters: shorter keys, such as "none", are words that occur in ordinary texts
_HIDDEN = "<hidden>"
_PUBLIC_HEADERS = re.compile(r"accept|content-type|user-agent|x-stainless-.*|openai-(organization|project|beta)")
_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")
_AGAIN = frozenset({408, 409, 425, 429})  # statuses after which a request may be sent again; so may those from 500 on
_LOGGERS = (  # loggers of the libraries, which log addresses and, at DEBUG, response headers
    *("openai", "openai._base_client", "httpx", "httpx2"),
    *(f"httpcore{version}.{part}" for version, part in product(("", "2"), ("connection", "http11", "http2", "proxy"))),
)
_UNSPOKEN = frozenset({401, 403, 407})  # statuses whose error texts may contain parts of keys


class Reply(NamedTuple):
    """The outcome of one request.

    Attributes:
        text: the answer of the model; None: no answer.
        problem: the reason why there is no answer.
        is_passing: whether another attempt may succeed.
        wait_s: the seconds that the server asks to wait before another attempt.
        tokens: the tokens of the question and of the answer, as counted by the server; None: not reported, so the
            reserved tokens count.
    """

    text: str | None
    problem: str = ""
    is_passing: bool = False
    wait_s: float = 0.0
    tokens: tuple[int, int] | None = None


class _RefusedResponse(Exception):
    """A response that is not read to its end."""

    def __init__(self, reply: Reply) -> None:
        super().__init__()  # no message: libraries log exceptions
        self.reply = reply


def connect(base_url: str, key_variable: str | None = None) -> "AsyncOpenAI":
    """Return a client of an OpenAI-compatible server that follows no redirects and bounds the size of errors.

    Args:
        base_url: such as "http://localhost:11434/v1".
        key_variable: the name of the environment variable that holds the key; None: the server needs no key.

    Raises:
        BadType, BadValue: the address is not valid, or holds a password or a query; the name is not valid.
        MissingKey (KeyError): the variable is not set.
        MissingExtra (ImportError): the library `openai` is not installed.
    """
    address = _as_address(base_url)
    openai = _import_library()
    http = _get_http_client()
    return as_client(openai.AsyncOpenAI(base_url=address, api_key=_read_key(key_variable), http_client=http))


@cache
def _get_http_client() -> Any:
    """Return the HTTP client that all clients of `connect` share: making one takes 40 ms, and each agent needs one."""
    return _import_library().DefaultAsyncHttpxClient(follow_redirects=False, event_hooks={"response": [_refuse_errors]})


def as_client(client: object) -> "AsyncOpenAI":
    """Check that a value is an asynchronous client and return it.

    Raises:
        BadType: the value is something else.
        MissingExtra (ImportError): the library `openai` is not installed.
    """
    openai = _import_library()
    if isinstance(client, openai.OpenAI):
        raise BadType("client is an openai.OpenAI, which would block the game while it waits: use openai.AsyncOpenAI.")
    if not isinstance(client, openai.AsyncOpenAI):
        raise BadType(
            "client must be an openai.AsyncOpenAI, the address of a server such as 'http://localhost:11434/v1', or "
            f"None to play recorded decisions, not of type {type(client).__name__}."
        )
    made = cast("AsyncOpenAI", client)
    made.chat.completions  # noqa: B018 - loads modules for a second, which a turn may not have
    return made


def find_host(client: "AsyncOpenAI") -> str:
    """Return the address of a client's server without its path, query and password, which may be secret."""
    url = urlsplit(str(client.base_url))
    return f"{url.scheme}://{url.hostname}{f':{url.port}' if url.port else ''}"


async def ask(client: "AsyncOpenAI", request: Mapping[str, Plain]) -> Reply:
    """Send a request and return its outcome; only cancellation raises.

    Exceptions of the client, which hold its headers, do not leave this function, not even as the context of others.
    """
    reply: Reply | None = None
    sender = client.with_options(max_retries=0)
    _hide_secrets_of(sender)
    try:
        body = await _request_body(sender, dict(request))
    except Exception as error:  # noqa: BLE001 - whatever a library of HTTP raises
        reply = _reply_of_error(error)
    _hide_secrets_of(sender)  # again: a function may have supplied a new key just now
    reply = _reply_in(body) if reply is None else reply
    return reply._replace(text=remove_secrets(reply.text), problem=remove_secrets(reply.problem))


def remove_secrets(value: object) -> Any:
    """Return a plain JSON value without the secrets of any client, in dict keys as well."""
    if isinstance(value, str):
        for secret in sorted(_secrets, key=len, reverse=True):
            value = value.replace(secret, _HIDDEN)
        return value
    if isinstance(value, dict):
        return {remove_secrets(key): remove_secrets(one) for key, one in value.items()}
    return [remove_secrets(one) for one in value] if isinstance(value, list) else value


_secrets: set[str] = set()  # secrets of all clients that were used


class _HidingFilter(logging.Filter):
    """Hides secrets in the log records of a library."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Replace the secrets in a record, and let every record pass."""
        text = record.getMessage()
        if record.exc_info and record.exc_info[0] is not None:
            text += "\n" + "".join(format_exception(*record.exc_info))
        safe = remove_secrets(text)
        if safe != text:
            record.msg = safe
            record.args = ()
            record.exc_info = None
        return True


_filter = _HidingFilter()


def _hide_secrets_of(client: "AsyncOpenAI") -> None:
    """Remember the secret texts of a client, and hide them in logs from now on."""
    headers = [str(one) for name, one in client.default_headers.items() if not _PUBLIC_HEADERS.fullmatch(name.lower())]
    url = urlsplit(str(client.base_url))
    found = [client.api_key, *client.auth_headers.values(), *headers, url.password, url.username, *url.query.split("=")]
    found += [str(one) for one in (client.default_query or {}).values()]
    words = chain.from_iterable((one, *one.split()) for one in found if one)
    _secrets.update(word for word in words if len(word) >= _SHORTEST_SECRET)
    for name in _LOGGERS:
        logging.getLogger(name).addFilter(_filter)  # adding it again has no effect


def _import_library() -> Any:
    with require_extra("Asking a language model", "llm"):
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
            "The address of a server must be like 'https://api.openai.com/v1', without user, password or query. "
            "(Yours is not shown, because it may hold a key. Put the key into an environment variable.)"
        )
    return text


def _read_key(variable: object) -> str:
    if variable is None:
        return "none"  # the library needs one
    if not isinstance(variable, str) or not _VARIABLE.fullmatch(variable):
        raise BadValue(
            "key_variable is the name of an environment variable, such as 'OPENAI_API_KEY', never the key itself. "
            "(Your value is not shown.)"
        )
    if not os.environ.get(variable):
        raise MissingKey(f"The environment variable {_cut_name(variable)} is empty or not set: set it to the key.")
    return os.environ[variable]


def _cut_name(variable: str) -> str:
    """Return the name of a variable, unless it looks like a key."""
    return shown(variable) if variable.isupper() and len(variable) <= 40 else "that key_variable names"


# -- the exchange -----------------------------------------------------------------------------------------------


async def _request_body(client: "AsyncOpenAI", fields: dict[str, Any]) -> bytes:
    model = fields.pop("model")
    messages = fields.pop("messages")
    # One connection for each request: a kept connection belongs to one event loop, and every game has its own loop.
    headers = {"Accept-Encoding": "identity", "Connection": "close"}
    create = client.chat.completions.with_streaming_response.create
    sent = create(model=model, messages=messages, extra_body=fields, extra_headers=headers)
    async with sent as response:
        if response.headers.get("content-encoding", "identity") != "identity":
            raise _RefusedResponse(Reply(None, "a compressed answer, which was not requested"))
        return await _read(response.http_response, _MOST_BYTES)


async def _read(response: Any, most: int) -> bytes:
    read = bytearray()
    async for part in response.aiter_raw():
        read += part
        if len(read) > most:
            raise _RefusedResponse(Reply(None, f"an answer of more than {most} bytes"))
    return bytes(read)


async def _refuse_errors(response: Any) -> None:
    """Read the first bytes of an error response, and raise `_RefusedResponse`."""
    if response.status_code < 300:
        return
    read = b""
    if response.status_code not in _UNSPOKEN:
        async for part in response.aiter_raw():
            read += part[:_MOST_OF_AN_ERROR]
            if len(read) >= _MOST_OF_AN_ERROR:
                break
    raise _RefusedResponse(_make_refusal(response.status_code, response.headers, read))


def _reply_of_error(error: Exception) -> Reply:
    """Return the reply for an exception of the client."""
    openai = _import_library()
    for one in (error, error.__cause__):
        if isinstance(one, _RefusedResponse):
            return one.reply
    if isinstance(error, openai.APIStatusError):
        response = error.response
        return _make_refusal(response.status_code, response.headers, response.content[:_MOST_OF_AN_ERROR])
    if isinstance(error, (openai.APITimeoutError, TimeoutError)):
        return Reply(None, "timeout", is_passing=True)
    return Reply(None, f"no connection ({type(error).__name__})", is_passing=True, tokens=(0, 0))


def _make_refusal(status: int, headers: Mapping[str, str], body: bytes) -> Reply:
    """Return the reply for an error response."""
    problem = f"HTTP {status}"
    if status not in _UNSPOKEN:
        said = _find_error(body)
        problem += f": {said}" if said else ""
    try:
        wait = float(headers.get("retry-after") or 0.0)
    except ValueError:
        wait = 0.0
    wait = wait if 0.0 <= wait <= _MOST_WAITING_S else _MOST_WAITING_S
    return Reply(None, problem, is_passing=status in _AGAIN or status >= 500, wait_s=wait, tokens=(0, 0))


def _find_error(body: bytes) -> str:
    """Return the message of a server's error, on one line and cut."""
    try:
        said = _find_value(json.loads(body), "error", "message")
    except (ValueError, RecursionError):
        said = None
    return make_printable_line(said[:_MOST_SHOWN]) if isinstance(said, str) else ""


def _reply_in(body: bytes) -> Reply:
    """Return the reply that a successful response holds."""
    try:
        plain = json.loads(body)
    except (ValueError, RecursionError):
        return Reply(None, "a response that is not JSON", is_passing=True)
    tokens = (_find_value(plain, "usage", "prompt_tokens"), _find_value(plain, "usage", "completion_tokens"))
    counted = tokens if all(type(one) is int and one in range(_MOST_TOKENS) for one in tokens) else None
    message = _find_value(plain, "choices", 0, "message")
    text = _find_value(message, "tool_calls", 0, "function", "arguments") or _find_value(message, "content")
    if not isinstance(text, str) or not text:
        return Reply(None, "a response without an answer", is_passing=True, tokens=counted)
    return Reply(text, tokens=counted)


def _find_value(value: Any, *path: str | int) -> Any:
    """Return the value at a path in plain values, or None."""
    for step in path:
        if isinstance(step, str) and isinstance(value, dict):
            value = value.get(step)
        elif isinstance(step, int) and isinstance(value, list) and step < len(value):
            value = value[step]
        else:
            return None
    return value
