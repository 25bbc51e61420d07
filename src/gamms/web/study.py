"""Studies: people who play a scenario one by one under conditions, and a table with a row for each of their rounds.

A folder holds what is known: `participants.jsonl` says who has agreed, `rows.jsonl` has a row for each round, of which
`rows.csv` is made, and `games` the recordings. A study that is begun again with the same folder goes on where each
participant was. Network addresses are written nowhere.
"""

import base64
import csv
import hashlib
import json
import os
import re
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from pathlib import Path
from statistics import fmean, median
from time import monotonic
from types import TracebackType
from typing import Any, Self, TypedDict, Unpack

from gamms import kernels
from gamms.arguments import as_count, as_int, as_mapping, as_path, as_text
from gamms.errors import BadFile, BadType, BadValue, GammsError
from gamms.game.result import Result
from gamms.plain import Plain, as_json
from gamms.scenario import Scenario
from gamms.text import reason, shown
from gamms.versions import versions
from gamms.web.choices import CHOSEN, EVENT
from gamms.web.links import Grant, Links, Refused
from gamms.web.live import Live, ServeOptions
from gamms.web.pages import live_page
from gamms.web.people import People, human
from gamms.web.server import Connection, Json, Page, Server, Site

_CODE = re.compile(r"[A-Za-z0-9._-]{1,64}")
_MOST_PARTICIPANTS = 10_000
_MOST_AT_ONCE = 50  # games
_LOOK_S = 0.5
Row = dict[str, Any]


class StudyOptions(TypedDict, total=False):
    """The keywords of `study` that have defaults."""

    conditions: Mapping[str, Mapping[str, object]] | None
    """Name -> what is changed in the scenario, as for `Scenario.replace`; None: there is one, "all"."""
    rounds: int
    """That count, for each participant; 1."""
    practice: int
    """Rounds before these, which are marked in the table; 1."""
    seconds: float
    """How long a participant may take for a choice; 60."""
    otherwise: Callable[[Any], None]
    """The strategy that decides where the participant does not; `gamms.strategies.stay`."""
    seed: int
    """Of the study: rounds have this one and those that follow, the same for all participants; 0."""
    title: str
    """What stands above the pages; the name of the scenario."""
    port: int
    """See `serve`."""
    host: str
    """See `serve`."""
    allow_network: bool
    """See `serve`."""


def study(
    scenario: Scenario, *, people: str, consent: str, out: str | os.PathLike[str], **options: Unpack[StudyOptions]
) -> "Study":
    """Let people take part in a study, each by a link with a code; returns a handle with the links.

    Each participant reads the consent text and agrees, gets a condition, plays practice rounds, and then those that
    count. Conditions are balanced: in the order in which people agree, each block of as many as there are conditions
    has all of them, in an order that follows from the seed.

    Args:
        scenario: what is played.
        people: the team or agent that a participant plays.
        consent: the text of the first page.
        out: the folder of the results. A study that is there goes on.
        options: `gamms.web.StudyOptions` has them.

    Raises:
        MissingExtra (ImportError): the extra `web` is not installed.
        NetworkError (ConnectionError): the port is in use.
        BadType, BadValue: an option is impossible, or the folder holds another study.
        ScenarioError: the game cannot be built under one of the conditions.
        UnknownName (KeyError): there is no such team or agent.
    """
    return Study(scenario, as_text(people, "people"), as_text(consent, "consent"), as_path(out, "out"), options)


@dataclass
class Participant:
    """Who has agreed to take part.

    Attributes:
        code: of the link.
        number: from 0, in the order in which they agreed.
        condition: its name.
        played: how many rounds are over, those of practice included.
        attempts: how often the next one was begun.
        live: the game that is played; None: none.
    """

    code: str
    number: int
    condition: str
    played: int = 0
    attempts: int = 0
    live: Live | None = None


class Study:
    """A study that is served, until `close`; usable in a `with` statement.

    Attributes:
        folder: of the results.
    """

    def __init__(self, scenario: Scenario, people: str, consent: str, folder: Path, options: StudyOptions) -> None:
        if not isinstance(scenario, Scenario):
            raise BadType(f"study takes a scenario, not {shown(scenario)}.")
        if unknown := sorted(options.keys() - StudyOptions.__annotations__.keys()):
            raise BadValue(
                f"study has no option {shown(unknown[0])}; there is: {', '.join(StudyOptions.__annotations__)}."
            )
        self.folder = folder
        self._people, self._consent, self._options = people, consent, options
        self._seed = as_int(options.get("seed", 0), "seed")
        self._practice = as_count(options.get("practice", 1), "practice", 0)
        self._rounds = as_count(options.get("rounds", 1), "rounds")
        given = as_mapping(options.get("conditions") or {"all": {}}, "conditions")
        self._variants = {
            as_text(name, "a condition"): _changed(scenario, name, changes) for name, changes in given.items()
        }
        for variant in self._variants.values():
            with variant.build(self._seed, {people: self._human("participant")}) as ctx:
                persons = People.open(ctx).persons
                if len(persons) > 1:
                    others = ", ".join(shown(name) for name in persons if name != "participant")
                    raise BadValue(f"In a study one person plays, {people}; give {others} another strategy than human.")
        self._lock = threading.RLock()
        self._participants: dict[str, Participant] = {}
        self._ended: dict[str, Live] = {}  # code -> the game that is over, which pages still show
        self._rows: list[Row] = []
        self._closed = threading.Event()
        self._threads: list[threading.Thread] = []
        self._resume()
        title = options.get("title") or scenario.spec.name or "A study"
        self._title = title
        self._links = Links()
        pages = {"/": Page(_page(title)), "/play": Page(live_page(title))}
        site = Site(self._links, pages, {"/participant": self._answer}, talk=self)
        keywords: Any = {name: options[name] for name in ("port", "host", "allow_network") if name in options}
        self._server = Server(site, **keywords)
        self._token = self._links.add(Grant("participants"))

    # -- the handle -----------------------------------------------------------------------------------------------

    @property
    def url(self) -> str:
        """The link of participants, in which CODE stands for the code of each."""
        return self.link("CODE")

    def link(self, code: str) -> str:
        """Return the link of a participant.

        Raises:
            BadValue: it is no code.
        """
        if not _CODE.fullmatch(code):
            raise BadValue(f"A code is 1 to 64 letters, digits, dots, dashes and _, not {shown(code)}.")
        return self._server.link(self._token, f"/?code={code}")

    @property
    def rows(self) -> list[Row]:
        """The rows of the table so far: one for each participant and round, in the order in which they ended."""
        with self._lock:
            return [dict(row) for row in self._rows]

    @property
    def assigned(self) -> dict[str, int]:
        """How many participants have each condition."""
        with self._lock:
            conditions = [one.condition for one in self._participants.values()]
        return {name: conditions.count(name) for name in self._variants}

    def wait(self, participants: int, timeout: float | None = None) -> bool:
        """Wait until so many participants have played all rounds; returns whether they have."""
        ends = None if timeout is None else monotonic() + timeout
        while not self._closed.is_set():
            with self._lock:
                if (
                    sum(one.played >= self._practice + self._rounds for one in self._participants.values())
                    >= participants
                ):
                    return True
            if ends is not None and monotonic() >= ends:
                break
            self._closed.wait(_LOOK_S if ends is None else min(_LOOK_S, max(ends - monotonic(), 0.0), 0.05))
        return False

    def stay_open(self) -> None:
        """Serve until `close` or Ctrl-C."""
        with suppress(KeyboardInterrupt):
            while not self._closed.wait(_LOOK_S):
                pass

    def close(self) -> None:
        """End the server and all games; those that are under way begin again when the study goes on."""
        self._closed.set()
        with self._lock:
            games = [one.live for one in self._participants.values() if one.live is not None]
            games += self._ended.values()
        for live in games:
            live.close()
        for thread in self._threads:
            thread.join()
        self._server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        """Show the folder and how many take part, without a token."""
        return f"Study({str(self.folder)!r}, participants={len(self._participants)}, rounds={len(self._rows)})"

    # -- what participants ask ------------------------------------------------------------------------------------

    def _answer(self, grant: Grant, message: Json) -> Plain:
        """Return what comes next for a participant: consent, a round that may begin, one to be played, or the end."""
        code = message.get("code")
        if grant.name != "participants" or not isinstance(code, str) or not _CODE.fullmatch(code):
            raise Refused("This link has no code of a participant. Ask who gave it to you.")
        with self._lock:
            one = self._participants.get(code)
            if one is None:
                if message.get("agree") is not True:
                    return {"stage": "consent", "text": self._consent}
                one = self._enrol(code)
            if one.played >= self._practice + self._rounds:
                return {"stage": "end", "rounds": self._rounds}
            is_practice = one.played < self._practice
            number = one.played + 1 - (0 if is_practice else self._practice)
            where: Json = {"practice": is_practice, "round": number, "rounds": self._rounds}
            if one.live is None:
                if message.get("begin") is not True:
                    return {"stage": "ready", **where}
                self._begin(one)
            assert one.live is not None  # noqa: S101 - it was begun just now
            return {"stage": "play", "link": one.live.players[code], **where}

    def _enrol(self, code: str) -> Participant:
        number = len(self._participants)
        if number >= _MOST_PARTICIPANTS:
            raise Refused("This study has all its participants.")
        one = Participant(code, number, self.condition_of(number))
        self._write("participants.jsonl", {"participant": code, "number": number, "condition": one.condition})
        self._participants[code] = one
        return one

    def condition_of(self, number: int) -> str:
        """Return the condition of the participant who is the number-th to agree, from 0."""
        names = list(self._variants)
        block, place = divmod(number, len(names))
        return names[int(kernels.stream(self._seed, "study", block).permutation(len(names))[place])]

    def _human(self, name: str) -> Any:  # a strategy, which `Scenario.build` takes
        keywords: Any = {key: self._options[key] for key in ("seconds", "otherwise") if key in self._options}
        return human(name, **keywords)

    # -- games ------------------------------------------------------------------------------------------------------

    def _begin(self, one: Participant) -> None:
        """Begin the next round of a participant."""
        if sum(other.live is not None for other in self._participants.values()) >= _MOST_AT_ONCE:
            raise Refused("Too many play at the moment. Try again in some minutes.")
        ended = self._ended.pop(one.code, None)
        if ended is not None:
            ended.close()
        one.attempts += 1
        self._write("participants.jsonl", {"participant": one.code, "played": one.played, "attempt": one.attempts})
        file = self.folder / "games" / f"{one.number}-{one.played}.ggr"
        file.parent.mkdir(parents=True, exist_ok=True)
        keywords: ServeOptions = {
            "seed": self._seed + one.played,
            "strategies": {self._people: self._human(one.code)},
            "record": file,
            "speed": None,
            "title": self._title,
        }
        one.live = Live(self._variants[one.condition], keywords, _Room(self._server, self._links, one.code))
        thread = threading.Thread(target=self._finish, args=(one, one.live, file), name="gamms study", daemon=True)
        self._threads = [*(known for known in self._threads if known.is_alive()), thread]
        thread.start()

    def _finish(self, one: Participant, live: Live, file: Path) -> None:
        """Wait until a round is over, and write its row."""
        error, result = None, None
        try:
            result = live.wait()
        except Exception as raised:  # noqa: BLE001 - whatever the game of a caller raises is in the row
            error = f"{type(raised).__name__}: {reason(raised)}"
        if result is None and error is None:
            return  # the study was closed
        with self._lock:
            row = self._row_of(one, result, error, file)
            self._write("rows.jsonl", row)
            self._rows.append(row)
            self._write_csv()
            one.played, one.attempts, one.live = one.played + 1, 0, None
            self._ended[one.code] = live
        # The page shows how it has ended until the next round is begun or the study is closed.

    def _row_of(self, one: Participant, result: Result | None, error: str | None, file: Path) -> Row:
        is_practice = one.played < self._practice
        row: Row = {
            "participant": one.code,
            "number": one.number,
            "condition": one.condition,
            "round": one.played + 1 - (0 if is_practice else self._practice),
            "practice": is_practice,
            "attempt": one.attempts,
            "seed": self._seed + one.played,
            "gamms": versions()["gamms"],
            "recording": file.relative_to(self.folder).as_posix(),
            "error": error,
        }
        if result is not None:
            choices = [event for event in result.events if event["kind"] == EVENT]
            took = [event["seconds"] for event in choices if event["outcome"] == CHOSEN]
            row |= {"choices": len(took), "missed": len(choices) - len(took)}
            row |= {"seconds_mean": round(fmean(took), 3), "seconds_median": round(median(took), 3)} if took else {}
            row |= result.row()
        plain: Row = as_json(row)
        return plain

    # -- the folder -------------------------------------------------------------------------------------------------

    def _resume(self) -> None:
        """Read what is in the folder.

        Raises:
            BadFile: a line of its files is damaged.
            BadValue: it is of another study.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        about = {"people": self._people, "conditions": list(self._variants), "seed": self._seed}
        about |= {"practice": self._practice, "rounds": self._rounds}
        known = self._read("study.jsonl")
        if known and known[0] != about:
            raise BadValue(
                f"{str(self.folder)!r} holds another study: {known[0]}; this one is {about}. "
                "Give another folder as out."
            )
        if not known:
            self._write("study.jsonl", about)
        self._rows = self._read("rows.jsonl")
        lines = self._read("participants.jsonl")
        for line in lines:
            if "condition" in line:
                one = Participant(line["participant"], line["number"], line["condition"])
                one.played = sum(row["participant"] == one.code for row in self._rows)
                self._participants[one.code] = one
        for line in lines:
            one = self._participants[line["participant"]]
            if line.get("played") == one.played:
                one.attempts = line["attempt"]

    def _read(self, name: str) -> list[Row]:
        """Return the lines of a file; one that has no end, where the program was killed, is cut off."""
        file = self.folder / name
        if not file.exists():
            return []
        data = file.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            with file.open("r+b") as torn:
                torn.truncate(whole)
        try:
            return [json.loads(line) for line in data[:whole].splitlines()]
        except ValueError as error:
            raise BadFile(f"{str(file)!r} is damaged: {error}. Give another folder as out.") from None

    def _write(self, name: str, line: Mapping[str, Plain]) -> None:
        with (self.folder / name).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def _write_csv(self) -> None:
        columns = list(dict.fromkeys(name for row in self._rows for name in row))
        with (self.folder / "rows.csv.part").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, columns)
            writer.writeheader()
            writer.writerows(self._rows)
        (self.folder / "rows.csv.part").replace(self.folder / "rows.csv")

    # -- connections, each of which belongs to the game of its participant -------------------------------------------

    def _live_of(self, connection: Connection) -> Live | None:
        code = connection.grant.name
        one = self._participants.get(code)
        return None if one is None else one.live or self._ended.get(code)

    def joined(self, connection: Connection) -> None:
        """See `Talk`."""
        live = self._live_of(connection)
        if live is not None:
            live.joined(connection)

    def left(self, connection: Connection) -> None:
        """See `Talk`."""
        live = self._live_of(connection)
        if live is not None:
            live.left(connection)

    def received(self, connection: Connection, message: Json) -> None:
        """See `Talk`."""
        live = self._live_of(connection)
        if live is None:
            raise Refused("No round is played now.")
        live.received(connection, message)

    def news(self, connection: Connection) -> Iterable[bytes]:
        """See `Talk`."""
        live = self._live_of(connection)
        return () if live is None else live.news(connection)


def _changed(scenario: Scenario, condition: str, changes: object) -> Scenario:
    """Return the scenario of a condition."""
    try:
        return scenario.replace(**{str(path): value for path, value in as_mapping(changes, "what changes").items()})
    except GammsError as error:
        error.add_note(f"In the condition {shown(condition)} of the study.")
        raise


def _page(title: str) -> bytes:
    """Return the page on which participants agree, and go from round to round."""
    page = (Path(__file__).parent.parent / "data" / "study.html").read_text(encoding="utf-8")
    for name in ("script", "style"):
        part = page[page.index(f"<{name}>") + len(name) + 2 : page.index(f"</{name}>")]
        digest = base64.b64encode(hashlib.sha256(part.encode()).digest()).decode()
        page = page.replace(f"{{{name}_hash}}", f"sha256-{digest}")
    return page.replace("{title}", escape(title)).encode()


class _Room:
    """The part of a server that one participant has: what `Live` needs of it."""

    def __init__(self, server: Server, links: Links, code: str) -> None:
        self._server, self._code = server, code
        self.address, self.links = server.address, links

    @property
    def connections(self) -> list[Connection]:
        """Those of the participant."""
        return [one for one in self._server.connections if one.grant.name == self._code]

    def link(self, token: str) -> str:
        """Return the address of the page on which is played."""
        return self._server.link(token, "/play")

    def wake(self) -> None:
        """Let the server send what is new."""
        self._server.wake()

    def close(self) -> None:
        """Leave the server to other participants."""
