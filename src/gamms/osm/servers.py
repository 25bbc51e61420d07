"""Query Nominatim and Overpass within bounds of time, size and retries, and cache their answers on disk.

The only module that imports the HTTP library. An answer is checked before it is cached and when it is read again.
"""

import hashlib
import json
import math
import re
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from http import HTTPStatus
from ipaddress import ip_address
from pathlib import Path
from threading import RLock, Thread
from typing import Any, NamedTuple, NoReturn, TypeAlias, TypeVar
from urllib.parse import urlencode, urlsplit

from gamms.arguments import as_positive
from gamms.errors import BadValue, NetworkError, PlaceError, TooLarge
from gamms.folders import cache_folder, write_whole
from gamms.limits import max_memory
from gamms.osm.settings import get_setting
from gamms.plugins import require_extra
from gamms.progress import Show
from gamms.text import shown
from gamms.workers import SIGNALS_S

_CONNECT_S = 10.0  # a running server accepts a connection at once
_SEARCH_S = 30.0  # Nominatim answers at once, unlike Overpass
_ANSWER_FACTOR = 3.0  # ratio of the time limits for a whole answer and for its beginning
_BUSY = (HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.GATEWAY_TIMEOUT)
_PAUSES_S = (5.0, 30.0)  # before the second and the third attempt at a busy server
_SEARCH_PAUSE_S = 1.0  # Nominatim's rule: at most one question per second
_STATUS_PAUSE_S = 5.0  # between two questions for a free slot
_MOST_PAUSE_S = 300.0  # all pauses of one call together
_MOST_PAUSES = 60
_LOCAL_PAUSE_S = 0.1  # a server on this computer needs no politeness
_MEMORY_PER_BYTE = 8  # memory for the values of a JSON answer
_CHUNK = 4096
_LATER = "Try again later; earlier downloads work with offline=True."
_ONE_AT_A_TIME = RLock()  # threads take turns at the servers

Json: TypeAlias = Any
"""Data of an answer, which is checked before use."""

T = TypeVar("T")
Read = Callable[[Json], T]  # converts the data of an answer; raises a ValueError if it is not usable


class _HttpAnswer(NamedTuple):
    """An HTTP answer, before it is interpreted."""

    status: int
    reason: str
    content: bytes
    retry_after: str

    @property
    def text(self) -> str:
        """The beginning of the content as text."""
        return self.content[:4000].decode("utf-8", "replace")


class MapServers:
    """The two servers, for one call about the places named `name`.

    Raises:
        BadValue, BadType: a setting is impossible.
        MissingExtra: requests is not installed; offline it is not needed.
    """

    def __init__(self, name: str, show: Show, *, offline: bool) -> None:
        if not offline:
            with require_extra("Loading places by name", "osm-online"):
                import requests  # noqa: F401 - whether it is there
        timeout = as_positive(get_setting("requests_timeout"), "gamms.osm.settings.requests_timeout", hint=" seconds.")
        self._name = name
        self._show = show
        self._offline = offline
        self._timeout_s = timeout
        self._folder = Path(get_setting("cache_folder") or cache_folder("places"))
        self._nominatim = _find_address("nominatim_url")
        self._overpass = _find_address("overpass_url")
        self._paused_s = 0.0
        self._pauses = 0
        self._unsaved: list[tuple[Path, bytes]] = []

    def search(self, query: str | dict[str, str], read: Read[T]) -> T:
        """Ask Nominatim for places, with their outlines.

        Raises:
            PlaceError: offline, the answer is not cached; or the server does not understand the query.
            NetworkError: there is no answer, or it is not usable.
            TooLarge: the answer takes more memory than allowed.
        """
        asked = {"format": "json", "polygon_geojson": "1", "dedupe": "0", "limit": "50"}
        asked |= {"q": query} if isinstance(query, str) else dict(sorted(query.items()))
        if get_setting("nominatim_key") is not None:
            asked["key"] = get_setting("nominatim_key")
        self._show(f"Asking {self._nominatim} where {self._name} is")
        return self._get_cached(f"{self._nominatim}/search", asked, read, self._search)

    def query(self, query: str, read: Read[T]) -> T:
        """Send Overpass a query in its own language, without its settings; raises like `search`."""
        memory = get_setting("overpass_memory")
        size = "" if memory is None else f"[maxsize:{memory}]"
        asked = {"data": f"[out:json][timeout:{math.ceil(self._timeout_s)}]{size};{query}"}
        return self._get_cached(f"{self._overpass}/interpreter", asked, read, self._interpret)

    def save_rest(self) -> None:
        """Cache also answers without shapes: the map was made, so they were no mistake."""
        for path, content in self._unsaved:
            self._save(path, content)

    def _get_cached(
        self, url: str, asked: dict[str, str], read: Read[T], ask: Callable[[str, dict[str, str]], _HttpAnswer]
    ) -> T:
        """Return the answer from the disk, or else from the server."""
        key = hashlib.sha256(f"{url}?{urlencode(asked)}".encode()).hexdigest()
        path = self._folder / f"{key}.json"
        damage = ""
        if (get_setting("use_cache") or self._offline) and path.is_file():
            try:
                return read(_parse_json(path.read_bytes()))
            except (OSError, ValueError, RecursionError) as error:
                damage = str(error)
        if self._offline:
            what = f"its stored copy is damaged ({damage})" if damage else "it was never downloaded"
            raise PlaceError(
                f"There is no map of {self._name} on this computer: {what}. Download it once, without "
                f"offline=True and with the same arguments and settings; answers are stored in '{self._folder}'."
            )
        with _ONE_AT_A_TIME:
            answer = ask(url, asked)
        data, found = _check_answer(url, answer, read)
        # Without a street or an area, the place may be a mistake: such an answer is cached only when the map is made.
        if isinstance(data, dict) and any(element["type"] != "node" for element in data["elements"]):
            self._save(path, answer.content)
        else:
            self._unsaved.append((path, answer.content))
        return found

    def _save(self, path: Path, content: bytes) -> None:
        if not get_setting("use_cache"):
            return
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, content)
        except OSError as error:
            warnings.warn(
                f"The map of {self._name} cannot be stored in {str(self._folder)!r}: {error}. "
                "Set gamms.osm.settings.cache_folder to a folder that you may write into.",
                RuntimeWarning,
                stacklevel=2,
            )

    def _search(self, url: str, asked: dict[str, str]) -> _HttpAnswer:
        if not is_local(url):  # its rules are the user's own
            self._pause(url, _SEARCH_PAUSE_S)
        return self._request_with_retries("GET", url, min(self._timeout_s, _SEARCH_S), params=asked)

    def _interpret(self, url: str, asked: dict[str, str]) -> _HttpAnswer:
        while get_setting("overpass_rate_limit"):
            status = _request("GET", f"{self._overpass}/status", self._timeout_s, self._show).text
            pause_s = _parse_seconds_to_slot(status)
            if not pause_s:
                break
            self._pause(url, pause_s)
        return self._request_with_retries("POST", url, self._timeout_s, data=asked)

    def _request_with_retries(self, method: str, url: str, patience_s: float, **options: dict[str, str]) -> _HttpAnswer:
        for pause_s in _PAUSES_S:
            answer = _request(method, url, patience_s, self._show, **options)
            if answer.status not in _BUSY:
                return answer
            wanted_s = float(answer.retry_after) if answer.retry_after.isdecimal() else 0.0
            self._pause(url, max(pause_s, wanted_s))
        return _request(method, url, patience_s, self._show, **options)

    def _pause(self, url: str, seconds: float) -> None:
        """Wait for a busy server; raise a `NetworkError` if the waits of one call are too many or too long in total."""
        if is_local(url):
            seconds = min(seconds, _LOCAL_PAUSE_S)
        self._pauses += 1
        self._paused_s += seconds
        if self._paused_s > _MOST_PAUSE_S or self._pauses > _MOST_PAUSES:
            raise NetworkError(
                f"{_find_host(url)} is busy: it asks for a total wait of {self._paused_s:.0f} s. {_LATER}"
            )
        if seconds > 1.0:
            self._show(f"{_find_host(url)} is busy: waiting {seconds:.0f} s")
        time.sleep(seconds)


def is_local(url: str) -> bool:
    """Return whether a server runs on this computer."""
    host = urlsplit(url).hostname or ""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


# -- one request ------------------------------------------------------------------------------------------------


def _request(method: str, url: str, patience_s: float, show: Show, **options: dict[str, str]) -> _HttpAnswer:
    """Send a request in a thread of its own: reading from a server that sends single bytes cannot be interrupted."""
    outcome: list[_HttpAnswer | Exception] = []
    most_bytes = max_memory() // _MEMORY_PER_BYTE  # read here: threads do not inherit it

    def ask() -> None:
        try:
            outcome.append(_read(method, url, patience_s, most_bytes, show, options))
        except Exception as error:  # noqa: BLE001 - raised again below, in the thread that waits for it
            outcome.append(error)

    thread = Thread(target=ask, daemon=True)
    thread.start()
    ends = time.monotonic() + _ANSWER_FACTOR * patience_s + min(_CONNECT_S, patience_s)
    while thread.is_alive() and (left := ends - time.monotonic()) > 0.0:
        thread.join(min(left, SIGNALS_S))
    if not outcome:
        raise _make_timeout_error(url, patience_s)
    if isinstance(outcome[0], Exception):
        raise outcome[0]
    return outcome[0]


def _read(
    method: str, url: str, patience_s: float, most_bytes: int, show: Show, options: dict[str, Any]
) -> _HttpAnswer:
    import requests

    named = {"User-Agent": "http_user_agent", "Referer": "http_referer", "Accept-Language": "http_accept_language"}
    headers = {header: value for header, name in named.items() if (value := get_setting(name))}
    timeout = (min(_CONNECT_S, patience_s), patience_s)
    options = {"headers": headers, **get_setting("requests_kwargs"), **options, "stream": True, "timeout": timeout}
    deadline = time.monotonic() + _ANSWER_FACTOR * patience_s
    content = bytearray()
    try:
        with requests.request(method, url, **options) as response:  # noqa: S113 - it is among the options
            for chunk in response.iter_content(_CHUNK):
                content += chunk
                if len(content) % (1 << 20) < _CHUNK:
                    show(f"Downloading from {_find_host(url)}: {len(content) / 1e6:.0f} MB")
                if len(content) > most_bytes:
                    raise TooLarge(
                        f"The answer of {_find_host(url)} has more than {most_bytes} bytes. Choose a smaller area, or "
                        "allow more memory with gamms.limits.allowing('8G')."
                    )
                if time.monotonic() > deadline:
                    raise _make_timeout_error(url, patience_s)
            retry_after = response.headers.get("Retry-After", "")
            return _HttpAnswer(response.status_code, str(response.reason), bytes(content), retry_after)
    except requests.exceptions.RequestException as error:
        reason = _find_first_cause(error)
        if isinstance(reason, TimeoutError) or "timed out" in str(error):
            raise _make_timeout_error(url, patience_s) from error
        raise NetworkError(
            f"{_find_host(url)} cannot be reached, or the connection was lost: {reason}. Check the connection and the "
            f"address {url!r} (gamms.osm.settings); earlier downloads work with offline=True."
        ) from error


def _check_answer(url: str, answer: _HttpAnswer, read: Read[T]) -> tuple[Json, T]:
    """Return the checked data of an answer, and its converted content."""
    host = _find_host(url)
    said = " ".join(re.sub(r"<[^>]*>", " ", answer.text).split())[:120]
    if answer.status >= HTTPStatus.BAD_REQUEST:
        refusal = f"{host} answers {answer.status} {answer.reason}, saying {said!r}."
        if answer.status == HTTPStatus.BAD_REQUEST:
            raise PlaceError(f"{refusal} It cannot parse the query: check location, custom_filter and tags.")
        if answer.status in _BUSY:
            raise NetworkError(f"{refusal} It is busy, after {len(_PAUSES_S) + 1} tries. {_LATER}")
        raise NetworkError(f"{refusal} Check the address {url!r} (gamms.osm.settings). {_LATER}")
    try:
        data = _parse_json(answer.content)
    except (ValueError, RecursionError) as error:
        raise NetworkError(
            f"{host} answered {shown(said)} instead of JSON ({error}). "
            f"The answer was truncated, or a login page intercepted {url!r}. {_LATER}"
        ) from error
    try:
        return data, read(data)
    except ValueError as error:
        raise NetworkError(f"The answer of {host} cannot be used: {error}. Choose a smaller area. {_LATER}") from None


def _parse_json(content: bytes) -> Json:
    return json.loads(content, parse_constant=_refuse_constant)


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _parse_seconds_to_slot(status: str) -> float:
    """Return the seconds until Overpass has a free slot, by its own status page; 0 if unknown."""
    if "slots available now" in status or re.search(r"Rate limit: 0\b", status):
        return 0.0
    with suppress(ValueError):
        free = [datetime.fromisoformat(time) for time in re.findall(r"Slot available after: (\S+Z)", status)]
        if free:
            return max(1.0, (min(free) - datetime.now(UTC)).total_seconds())
    return _STATUS_PAUSE_S if "Currently running queries" in status else 0.0


def _make_timeout_error(url: str, patience_s: float) -> NetworkError:
    return NetworkError(
        f"{_find_host(url)} timed out: an answer must begin within {patience_s:g} s and be complete within "
        f"{_ANSWER_FACTOR * patience_s:g} s (gamms.osm.settings.requests_timeout). Choose a smaller area. {_LATER}"
    )


def _find_first_cause(error: BaseException) -> BaseException:
    """Return the original error: requests wraps it several times."""
    inner = error.__cause__ or error.__context__
    return error if inner is None else _find_first_cause(inner)


def _find_host(url: str) -> str:
    return urlsplit(url).netloc or url


def _find_address(name: str) -> str:
    url = str(get_setting(name))
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise BadValue(
            f"gamms.osm.settings.{name} is {url!r}, which is not the address of a server. "
            "Set one that begins with http:// or https://."
        )
    return url.rstrip("/")
