"""The one door to requests: ask a map server, within bounds of time, of size and of patience."""

import json
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http import HTTPStatus
from ipaddress import ip_address
from threading import Thread
from typing import Any, NoReturn
from urllib.parse import urlsplit

from gamms.errors import NetworkError, PlaceError
from gamms.text import shown

_CONNECTING_S = 10.0  # a server that is there takes the call at once
_BUSY = (429, 503, 504)
_PAUSES_S = (5.0, 30.0)  # before the second and the third try at a busy server
_PATIENCE_S = 300.0  # all pauses of one call together
_MOST_PAUSES = 60
_LOCAL_PAUSE_S = 0.1  # a server on this computer needs no politeness
_ANSWERING = 3.0  # an answer may take so many times the time that a server has to begin it
_MOST_BYTES = 1 << 30
_CHUNK = 4096
_LATER = "Try again later; what was downloaded before works with offline=True."


@dataclass(slots=True, frozen=True)
class Answer:
    """What OSMnx uses of the response of a server; `json()` has been checked."""

    url: str
    status_code: int
    reason: str
    content: bytes
    headers: dict[str, str] = field(default_factory=dict)
    data: Any = None

    @property
    def ok(self) -> bool:
        """Whether this is what was asked for, not an error."""
        return self.status_code < HTTPStatus.BAD_REQUEST

    @property
    def text(self) -> str:
        """The content as text."""
        return self.content.decode("utf-8", "replace")

    def json(self) -> Any:
        """The content as data."""
        return self.data


@dataclass(slots=True)
class MapServer:
    """A server that answers questions about the map; it gets little time and few tries."""

    url: str
    fault_of: Callable[[Any], str]  # what is wrong with the data of an answer
    answer_s: float  # how long it may take to begin an answer
    show: Callable[[str], None]
    waited_s: float = 0.0
    pauses: int = 0

    @property
    def host(self) -> str:
        """Its name, with the port."""
        return urlsplit(self.url).netloc or self.url

    def get(self, url: str, **options: Any) -> Answer:
        """Ask with GET, for data.

        Raises:
            NetworkError: there is no answer, or it is of no use.
            PlaceError: the server does not understand the question.
        """
        return self._checked(self._patiently("GET", url, options))

    def post(self, url: str, **options: Any) -> Answer:
        """Ask with POST, for data; raises what `get` raises."""
        return self._checked(self._patiently("POST", url, options))

    def status(self, url: str, **options: Any) -> Answer:
        """Ask with GET, for any text.

        Raises:
            NetworkError: there is no answer.
        """
        return self._once("GET", url, options)

    def sleep(self, seconds: float) -> None:
        """Wait, unless the server is on this computer.

        Raises:
            NetworkError: that would be too long or too often.
        """
        seconds = min(seconds, _LOCAL_PAUSE_S) if is_local(self.url) else seconds
        self.pauses += 1
        self.waited_s += seconds
        if self.waited_s > _PATIENCE_S or self.pauses > _MOST_PAUSES:
            raise NetworkError(f"{self.host} is busy, and would have us wait for {self.waited_s:.0f} s. {_LATER}")
        if seconds > 1.0:
            self.show(f"{self.host} is busy: waiting {seconds:.0f} s")
        time.sleep(seconds)

    def _patiently(self, method: str, url: str, options: dict[str, Any]) -> Answer:
        for pause in _PAUSES_S:
            answer = self._once(method, url, options)
            if answer.status_code not in _BUSY:
                return answer
            self.sleep(max(pause, _retry_after(answer)))
        return self._once(method, url, options)

    def _once(self, method: str, url: str, options: dict[str, Any]) -> Answer:
        """Ask in a thread of its own: a server that drips holds whoever reads from it, and nobody else."""
        outcome: list[Answer | Exception] = []

        def ask() -> None:
            try:
                outcome.append(self._ask(method, url, options))
            except Exception as error:  # noqa: BLE001 - raised again below, where somebody waits for it
                outcome.append(error)

        asking = Thread(target=ask, daemon=True)
        asking.start()
        asking.join(_ANSWERING * self.answer_s + min(_CONNECTING_S, self.answer_s))
        if not outcome:
            self._too_slow()
        if isinstance(outcome[0], Exception):
            raise outcome[0]
        return outcome[0]

    def _ask(self, method: str, url: str, options: dict[str, Any]) -> Answer:
        import requests

        timeout = (min(_CONNECTING_S, self.answer_s), self.answer_s)
        rest = {name: value for name, value in options.items() if name not in ("stream", "timeout")}
        deadline = time.monotonic() + _ANSWERING * self.answer_s
        try:
            with requests.request(method, url, stream=True, timeout=timeout, **rest) as response:
                content = bytearray()
                for chunk in response.iter_content(_CHUNK):
                    content += chunk
                    self._watch(len(content), deadline)
                head = {name.lower(): text for name, text in response.headers.items()}
                return Answer(str(response.url), response.status_code, str(response.reason), bytes(content), head)
        except requests.exceptions.RequestException as error:
            self._unreachable(error)

    def _watch(self, size: int, deadline: float) -> None:
        if size % (1 << 20) < _CHUNK:
            self.show(f"Downloading from {self.host}: {size / 1e6:.0f} MB")
        if size > _MOST_BYTES:
            raise NetworkError(f"The answer of {self.host} has more than {_MOST_BYTES} bytes. Choose a smaller area.")
        if time.monotonic() > deadline:
            self._too_slow()

    def _unreachable(self, error: Exception) -> NoReturn:
        reason = _root(error)
        if isinstance(reason, TimeoutError) or "timed out" in str(error):
            self._too_slow(error)
        raise NetworkError(
            f"{self.host} cannot be reached, or broke off: {reason}. Check the connection and the address "
            f"{self.url!r} (osmnx.settings); what was downloaded before works with offline=True."
        ) from error

    def _too_slow(self, error: Exception | None = None) -> NoReturn:
        raise NetworkError(
            f"{self.host} timed out: an answer must begin within {self.answer_s:g} s and be there within "
            f"{_ANSWERING * self.answer_s:g} s (osmnx.settings.requests_timeout). Choose a smaller area. {_LATER}"
        ) from error

    def _checked(self, answer: Answer) -> Answer:
        if not answer.ok:
            self._refused(answer)
        try:
            data = json.loads(answer.content, parse_constant=_no_number)
            fault = self.fault_of(data)
        except (ValueError, RecursionError) as error:
            raise NetworkError(
                f"{self.host} did not answer with JSON data, but with {shown(_excerpt(answer))} ({error}). "
                f"It was cut short, or comes from a login page between you and {self.url!r}. {_LATER}"
            ) from error
        if fault:
            raise NetworkError(f"The answer of {self.host} is of no use: {fault}. Choose a smaller area. {_LATER}")
        return Answer(answer.url, answer.status_code, answer.reason, answer.content, answer.headers, data)

    def _refused(self, answer: Answer) -> NoReturn:
        said = f"{self.host} answers {answer.status_code} {answer.reason}, saying {_excerpt(answer)!r}."
        if answer.status_code == HTTPStatus.BAD_REQUEST:
            raise PlaceError(f"{said} It does not understand the question: check location, custom_filter and tags.")
        if answer.status_code in _BUSY:
            raise NetworkError(f"{said} It is busy, after {len(_PAUSES_S) + 1} tries. {_LATER}")
        raise NetworkError(f"{said} Check the address {self.url!r} (osmnx.settings). {_LATER}")


def is_local(url: str) -> bool:
    """Whether a server runs on this computer."""
    host = urlsplit(url).hostname or ""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def _retry_after(answer: Answer) -> float:
    text = answer.headers.get("retry-after", "")
    return float(text) if text.isdecimal() else 0.0


def _root(error: BaseException) -> BaseException:
    """The error that began it: requests wraps it several times."""
    inner = error.__cause__ or error.__context__
    return error if inner is None else _root(inner)


def _excerpt(answer: Answer) -> str:
    return " ".join(re.sub(r"<[^>]*>", " ", answer.text[:4000]).split())[:120]


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")
