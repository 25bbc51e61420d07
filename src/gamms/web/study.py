"""Studies: people play a scenario under experimental conditions, alone or in groups; each round gives a table row.

The folder of a study contains `participants.jsonl` with consents and groups, `rows.jsonl` with one row for each
participant and round, `rows.csv` with the same rows, and the recordings in `games`. A study that is started again with
the same folder continues where each participant was. Network addresses are not stored.

The page of a participant requests its next stage from `/participant`: consent, waiting for others, ready for a round,
playing, or the end. A code belongs to the browser that consented with it, which is known by a secret that it generated.
"""

import os
import re
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from html import escape
from itertools import chain
from pathlib import Path
from statistics import fmean, median
from time import monotonic
from typing import Any, TypedDict, Unpack

from gamms.arguments import as_count, as_int, as_items, as_mapping, as_path, as_positive, as_text
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.folders import (
    add_lines,
    cut_torn_line,
    lock_folder,
    open_whole_file,
    read_json_lines,
    refuse_link,
    remove_link,
    write_csv,
)
from gamms.game.result import Result
from gamms.plain import Plain, as_json
from gamms.scenario import Scenario
from gamms.text import reason, shown
from gamms.versions import versions
from gamms.web.bundle import compute_hash
from gamms.web.choices import CHOSEN, EVENT
from gamms.web.links import Handle, LinkPermissions, Links, Refused
from gamms.web.live import Live, ServeOptions
from gamms.web.pages import make_live_page
from gamms.web.participants import ConsentRateLimit, Group, Line, Participant, Participants, RemovedCodes, take_out
from gamms.web.people import People, human
from gamms.web.server import Connection, Json, Page, Server, Site
from gamms.workers import SIGNALS_S

_CODE = re.compile(r"[A-Za-z0-9._-]{1,64}")
_MOST_AT_ONCE = 50  # games
_LINE = "a line of a study"
_FILES = ("study.jsonl", "participants.jsonl", "rows.jsonl")
_THANKS = "You have played all rounds. Thank you."
_ALL = ""  # the name of the link that all participants share
Row = Line


class _Row(TypedDict):
    """The column that every row of a study has."""

    participant: str


class StudyOptions(TypedDict, total=False):
    """The keywords of `study` that have defaults."""

    conditions: Mapping[str, Mapping[str, object]] | None
    """Name -> changes of the scenario, as for `Scenario.replace`; None: one condition, "all", without changes."""
    rounds: int
    """The number of scored rounds of each participant; 1."""
    practice: int
    """The number of practice rounds before them, which are marked in the table; 1."""
    seconds: float
    """The time that a participant has for a choice; 60."""
    codes: Iterable[str] | None
    """The codes of the participants, each with a separate link; None: one link for all, with any code."""
    per_minute: int
    """The maximum number of consents per minute from one network address, if there is one link for all; 60."""
    partner_within: float
    """The time that a participant waits for the others of a group, in seconds; 300."""
    otherwise: Callable[[Any], None]
    """The strategy that decides if the participant makes no choice in time; `gamms.strategies.stay`."""
    seed: int
    """The seed of the study; the rounds of each participant have this seed and the following integers; 0."""
    title: str
    """The title of the pages; the name of the scenario."""
    instructions: str
    """The text above the button that begins a round, such as the goal of the game; none."""
    thanks: str
    """The text of the last page, such as a completion code; "You have played all rounds. Thank you."."""
    port: int
    """See `ServeOptions`."""
    host: str
    """See `ServeOptions`."""
    allow_network: bool
    """See `ServeOptions`."""


def study(
    scenario: Scenario,
    *,
    consent: str,
    out: str | os.PathLike[str],
    people: str | Sequence[str] | None = None,
    **options: Unpack[StudyOptions],
) -> "Study":
    """Serve a study to participants, each with a code; return a handle with the links.

    Each participant reads the consent text, agrees, is assigned a condition, and plays practice rounds, then scored
    rounds. Conditions are balanced: with n conditions, each n consecutive participants (or groups) get all of them, in
    an order derived from the seed. Groups are formed in the order of arrival. A code belongs to the browser that
    consented with it.

    Args:
        scenario: the scenario to play.
        consent: the text of the first page.
        out: the folder of the results. If it contains this study, the study continues.
        people: the team or agent that a participant plays, or several, one for each participant of a group; None: the
            teams and agents with the strategy `human` in the scenario.
        options: see `gamms.web.StudyOptions`.

    Raises:
        MissingExtra (ImportError): the extra `web` is not installed.
        NetworkError (ConnectionError): the port is in use.
        BadType, BadValue: an option is invalid, or the folder contains another study.
        WriteConflict (RuntimeError): the study in the folder is served by another program.
        ScenarioError: the game cannot be built under one of the conditions.
        UnknownName (KeyError): a team or agent does not exist.
    """
    given = people
    if not (people is None or isinstance(people, str)):
        given = [as_text(one, "people") for one in as_items(people, "people", "teams and agents")]
    return Study(scenario, given, as_text(consent, "consent"), as_path(out, "out"), options)


class Study(Handle):
    """A served study; close it with `close` or use it in a `with` statement.

    Attributes:
        folder: the folder of the results.
        codes: the codes of the participants, each with a separate link; None: any code.
    """

    def __init__(
        self, scenario: Scenario, people: str | Sequence[str] | None, consent: str, folder: Path, options: StudyOptions
    ) -> None:
        if not isinstance(scenario, Scenario):
            raise BadType(f"study takes a scenario, not {shown(scenario)}.")
        if unknown := sorted(options.keys() - StudyOptions.__annotations__.keys()):
            raise BadValue(
                f"study has no option {shown(unknown[0])}; there are: {', '.join(StudyOptions.__annotations__)}."
            )
        self.folder = folder
        self._consent = consent
        self._instructions = as_text(options.get("instructions", ""), "instructions")
        self._thanks = as_text(options.get("thanks", _THANKS), "thanks")
        self._options = options
        self._seed = as_int(options.get("seed", 0), "seed")
        self._practice = as_count(options.get("practice", 1), "practice", 0)
        self._rounds = as_count(options.get("rounds", 1), "rounds")
        self._agreed = ConsentRateLimit(as_count(options.get("per_minute", 60), "per_minute"))
        self._partner_within = as_positive(options.get("partner_within", 300.0), "partner_within")
        given = as_mapping(options.get("conditions") or {"all": {}}, "conditions")
        self._variants = {
            as_text(name, "a condition"): _change_scenario(scenario, name, changes) for name, changes in given.items()
        }
        self.codes = _check_codes(options.get("codes"))
        self._people = self._find_people(scenario, people)
        for variant in self._variants.values():
            self._check(variant)
        self._lock = threading.RLock()
        self._shown = deque[Group]()  # groups whose last game is over and still shown
        self._rows: list[Row] = []
        self._is_closed = threading.Event()
        self._threads: list[threading.Thread] = []
        about: Line = {
            "people": self._people[0] if len(self._people) == 1 else list(self._people),
            "conditions": list(self._variants),
            "seed": self._seed,
            "practice": self._practice,
            "rounds": self._rounds,
        }
        title = options.get("title") or scenario.spec.name or "A study"
        self._title = title
        self._links = Links()
        self._tokens = {
            name: self._links.add(LinkPermissions(f"participants {name}"))
            for name in ((_ALL,) if self.codes is None else self.codes)
        }
        self._taken_out = RemovedCodes(self.folder)
        pages = {"/": Page(_make_page(title)), "/play": Page(make_live_page(title))}
        site = Site(self._links, pages, {"/participant": self._answer}, talk=self)
        keywords: Any = {name: options[name] for name in ("port", "host", "allow_network") if name in options}
        with ExitStack() as ending:
            ending.enter_context(lock_folder(self.folder))
            refuse_link(self.folder / "games")
            self._known = self._resume(about)
            self._read_taken_out()
            self._server = Server(site, **keywords)
            ending.callback(self._server.close)
            if not read_json_lines(self.folder / "study.jsonl", _LINE):  # written last, after everything that may raise
                add_lines(self.folder / "study.jsonl", [about])
            self._ending = ending.pop_all()

    def _find_people(self, scenario: Scenario, people: str | Sequence[str] | None) -> tuple[str, ...]:
        """Return the teams and agents that participants play.

        Raises:
            BadValue: there are none.
        """
        if people is None:
            with scenario.build(self._seed) as ctx:
                found = tuple(People.open(ctx).persons)
        else:
            found = (people,) if isinstance(people, str) else tuple(dict.fromkeys(people))
        if not found:
            raise BadValue("No team or agent is played by a person: give people=, or write strategy: human.")
        return found

    def _check(self, variant: Scenario) -> None:
        """Check that all human players of a scenario are participants, and that each has agents to play.

        Raises:
            BadValue: they are not.
        """
        named = [f"participant {number}" for number in range(len(self._people))]
        with variant.build(self._seed, dict(zip(self._people, map(self._make_human, named), strict=True))) as ctx:
            persons = People.open(ctx).persons
        if others := ", ".join(shown(name) for name in persons if name not in named):
            raise BadValue(
                f"In this study participants play {', '.join(self._people)}; give {others} another strategy than "
                "human, or name all of them as people."
            )
        if idle := [one for one, name in zip(self._people, named, strict=True) if name not in persons]:
            raise BadValue(f"There is nothing to play for {shown(idle[0])}: others of the people play all its agents.")

    # -- the handle -----------------------------------------------------------------------------------------------

    @property
    def url(self) -> str:
        """The link for participants, with CODE in place of the code.

        Raises:
            BadValue: each code has a separate link, because of codes=.
        """
        if self.codes is not None:
            raise BadValue("Each of the codes has a link of its own: study.link(code) gives it.")
        return self.link("CODE")

    def link(self, code: str) -> str:
        """Return the link of a participant.

        Raises:
            BadValue: the code is invalid.
            UnknownName (KeyError): the code is not in `codes`.
        """
        name = _ALL if self.codes is None else _check_code(code)
        if name not in self._tokens:
            raise UnknownName("code", code, self._tokens)
        return self._server.link(self._tokens[name], f"/?code={_check_code(code)}")

    @property
    def rows(self) -> list[Row]:
        """The rows of the table: one for each participant and round, in the order in which rounds ended."""
        with self._lock:
            return [dict(row) for row in self._rows]

    @property
    def assigned(self) -> dict[str, int]:
        """Condition -> number of participants."""
        with self._lock:
            counts = dict.fromkeys(self._variants, 0)
            for one in self._known.groups:
                counts[one.condition] += sum(code in self._known.by_code for code in one.members)
        return counts

    def release(self, code: str) -> None:
        """Give a code to the next browser that consents, for example after its cookies were deleted.

        Raises:
            UnknownName (KeyError): no participant has consented with this code.
        """
        with self._lock:
            one = self._known.by_code.get(code)
            if one is None:
                raise UnknownName("participant", code, self._known.by_code)
            self._known.keep_secret(one, None)

    def take_out(self, code: str) -> None:
        """Remove participants from the study: their game ends, and the next participants get their condition.

        Their codes become invalid. Their rows stay in the table.

        Args:
            code: a code, or a pattern with `*`, for all matching codes.

        Raises:
            BadValue: the code is invalid.
        """
        take_out(self.folder, [code])
        self._read_taken_out()

    def _read_taken_out(self) -> None:
        """Remove the participants whose codes were added to the file, by this program or another one."""
        with self._lock:
            if not self._taken_out.is_read_again():
                return
            for one in [one for one in self._known.by_code.values() if self._taken_out.has(one.code)]:
                self._known.take_out(one.code)
                group = one.group
                if group is not None and not any(code in self._known.by_code for code in group.members):
                    self._end(group)

    def condition_of(self, number: int) -> str:
        """Return the condition of a participant (or group) by its number in the order of consent, from 0."""
        return self._known.condition_of(number)

    def wait(self, participants: int, timeout: float | None = None) -> bool:
        """Wait until a number of participants have played all rounds.

        Args:
            participants: the number.
            timeout: seconds; None: no limit.

        Returns:
            Whether they have; False after the timeout or after `close`.
        """
        ends = None if timeout is None else monotonic() + timeout
        while not self._is_closed.is_set():
            with self._lock:
                if sum(len(one.members) for one in self._known.groups if self._is_done(one)) >= participants:
                    return True
            if ends is not None and monotonic() >= ends:
                break
            self._is_closed.wait(SIGNALS_S if ends is None else min(max(ends - monotonic(), 0.0), 0.05))
        return False

    def close(self) -> None:
        """Stop the server and all games; unfinished rounds are played again when the study continues."""
        self._is_closed.set()
        with self._lock:
            games = list(chain.from_iterable((one.live, one.ended) for one in self._known.groups))
        for live in games:
            if live is not None:
                live.close()
        for thread in self._threads:
            thread.join()
        self._ending.close()

    def __repr__(self) -> str:
        """Return the folder and the numbers of participants and rows, without tokens."""
        return f"Study({str(self.folder)!r}, participants={len(self._known.by_code)}, rounds={len(self._rows)})"

    # -- requests of participants ---------------------------------------------------------------------------------

    def _answer(self, grant: LinkPermissions, message: Json, address: str) -> Plain:
        """Return the stage of a participant: "consent", "wait", "alone", "ready", "play" or "end"."""
        code = message.get("code")
        if not isinstance(code, str) or not self._is_known(grant, code):
            raise Refused("This link has no code of a participant. Ask who gave it to you.")
        self._read_taken_out()
        if self._taken_out.has(code):
            raise Refused("This code was taken out of the study. Ask who gave it to you.")
        with self._lock:
            if self.codes is None and code not in self._known.by_code and message.get("agree") is True:
                self._agreed.count(address)
            one = self._known.find_participant(code, message)
            return {"stage": "consent", "text": self._consent} if one is None else self._stage(one, message)

    def _is_known(self, grant: LinkPermissions, code: str) -> bool:
        """Return whether a link and a code belong to this study."""
        name = _ALL if self.codes is None else code
        return grant.name == f"participants {name}" and _CODE.fullmatch(code) is not None

    def _stage(self, one: Participant, message: Json) -> Json:
        """Return the stage of a participant who has consented; begin the next round on request."""
        within: Json = {"within_s": self._partner_within}
        group = one.group or self._known.form_group(one)
        if group is None:
            return {"stage": "alone" if one.came_at is None else "wait", **within}
        if self._is_done(group):
            return {"stage": "end", "text": self._thanks}
        is_practice = group.played < self._practice
        number = group.played + 1 - (0 if is_practice else self._practice)
        where: Json = {"practice": is_practice, "round": number, "rounds": self._rounds}
        if len(self._people) > 1:
            where["role"] = self._people[group.members.index(one.code)]
        if group.live is None:
            if message.get("begin") is not True:
                return {"stage": "ready", "text": self._instructions, **where}
            if not self._may_begin(group, one):
                return {"stage": "wait", **where, **within}
            self._begin(group)
        assert group.live is not None  # noqa: S101 - it was begun just now
        return {"stage": "play", "link": group.live.players[one.code], **where}

    def _is_done(self, group: Group) -> bool:
        return group.played >= self._practice + self._rounds

    def _may_begin(self, group: Group, one: Participant) -> bool:
        """Mark a participant as ready; return whether all of the group are, or the wait for the others is over."""
        if not group.ready:
            group.ready_at = monotonic()
        group.ready.add(one.code)
        there = sum(code in self._known.by_code for code in group.members)
        return len(group.ready) == there or monotonic() - group.ready_at > self._partner_within

    def _make_human(self, name: str) -> Any:  # a strategy, which `Scenario.build` takes
        keywords: Any = {key: self._options[key] for key in ("seconds", "otherwise") if key in self._options}
        if len(self._people) > 1:  # limits the wait for a participant who does not join a round
            keywords["joins_within"] = keywords.get("seconds", 60.0)
        return human(name, **keywords)

    # -- games ------------------------------------------------------------------------------------------------------

    def _begin(self, group: Group) -> None:
        """Begin the next round of a group; if too many games run, end the oldest one without a connected page."""
        playing = [other for other in self._known.groups if other.live is not None]
        if len(playing) >= _MOST_AT_ONCE:
            unused = [other for other in playing if not other.has_joined]
            if not unused:
                raise Refused("Too many play at the moment. Try again in some minutes.")
            self._end(min(unused, key=lambda other: other.began_at))
        if group.ended is not None:
            self._forget(group)
        group.attempts += 1
        self._known.note_round(group)
        file = remove_link(self.folder / "games" / f"{group.number}-{group.played}.ggr")
        file.parent.mkdir(parents=True, exist_ok=True)
        keywords: ServeOptions = {
            "seed": self._seed + group.played,
            "strategies": dict(zip(self._people, map(self._make_human, group.members), strict=True)),
            "record": file,
            "speed": None,
            "title": self._title,
        }
        live = Live(self._variants[group.condition], keywords, _GroupHost(self._server, self._links, group.members))
        group.live = live
        group.has_joined = False
        group.began_at = monotonic()
        thread = threading.Thread(target=self._finish, args=(group, live, file), name="gamms study", daemon=True)
        self._threads = [*(known for known in self._threads if known.is_alive()), thread]
        thread.start()

    def _end(self, group: Group) -> None:
        """End the game of a group without writing rows; the group may begin it again."""
        live = group.live
        group.live = None
        group.ready.clear()
        if live is not None:
            live.close()

    def _forget(self, group: Group) -> None:
        """Stop showing the last game of a group."""
        if group.ended is not None:
            group.ended.close()
            group.ended = None
            self._shown.remove(group)

    def _finish(self, group: Group, live: Live, file: Path) -> None:
        """Wait until a round ends, and write its rows."""
        error = None
        result = None
        try:
            result = live.wait()
        except Exception as raised:  # noqa: BLE001 - the row contains any error of the game
            error = f"{type(raised).__name__}: {reason(raised)}"
        if result is None and error is None:
            return  # the study was closed
        with self._lock:
            if group.live is not live:
                return  # the game was ended by `_end`
            there = [one for code in group.members if (one := self._known.by_code.get(code)) is not None]
            rows = [self._make_row(one, group, result, error, file) for one in there]
            add_lines(self.folder / "rows.jsonl", rows)
            self._rows += rows
            self._write_csv()
            group.played = group.played + 1
            group.attempts = 0
            group.live = None
            group.ended = live
            group.ready.clear()
            # The page shows the end of the game until the next round begins, or until too many others have ended.
            self._shown.append(group)
            if len(self._shown) > _MOST_AT_ONCE:
                self._forget(self._shown[0])

    def _make_row(self, one: Participant, group: Group, result: Result | None, error: str | None, file: Path) -> Row:
        is_practice = group.played < self._practice
        row: Row = {"participant": one.code, "number": one.number, "condition": group.condition}
        if len(self._people) > 1:
            others = [code for code in group.members if code != one.code]
            role = self._people[group.members.index(one.code)]
            row |= {"group": group.number, "role": role, "partner": " ".join(others)}
        row |= {
            "round": group.played + 1 - (0 if is_practice else self._practice),
            "practice": is_practice,
            "attempt": group.attempts,
            "seed": self._seed + group.played,
            "gamms": versions()["gamms"],
            "recording": file.relative_to(self.folder).as_posix(),
            "error": error,
        }
        if result is not None:
            choices = [event for event in result.events if event["kind"] == EVENT and event["person"] == one.code]
            took = [event["seconds"] for event in choices if event["outcome"] == CHOSEN]
            row |= {"choices": len(took), "missed": len(choices) - len(took)}
            row |= {"seconds_mean": round(fmean(took), 3), "seconds_median": round(median(took), 3)} if took else {}
            row |= result.row()
        plain: Row = as_json(row)
        return plain

    # -- the folder -------------------------------------------------------------------------------------------------

    def _resume(self, about: Line) -> Participants:
        """Read the participants and the rows from the folder, if it contains a study.

        Raises:
            BadFile: a line of a file is damaged.
            BadValue: the folder contains another study.
        """
        before = read_json_lines(self.folder / "study.jsonl", _LINE)
        if before and before[0] != about:
            raise BadValue(
                f"{str(self.folder)!r} holds another study: {shown(before[0])}; this one is "
                f"{about}. Give another folder as out."
            )
        self._rows = read_json_lines(self.folder / "rows.jsonl", "a row of a study", _Row)
        counts = Counter(row["participant"] for row in self._rows)
        known = Participants(
            self.folder / "participants.jsonl",
            len(self._people),
            list(self._variants),
            self._seed,
            self._partner_within,
        )
        for name in _FILES:
            cut_torn_line(self.folder / name)
        for group in known.groups:
            there = [code for code in group.members if code in known.by_code] or group.members
            played = min(counts[code] for code in there)
            if group.played != played:
                group.played = played
                group.attempts = 0
        return known

    def _write_csv(self) -> None:
        columns = list(dict.fromkeys(chain.from_iterable(self._rows)))
        with open_whole_file(self.folder / "rows.csv") as whole:
            write_csv(whole, columns, ([row.get(name) for name in columns] for row in self._rows))

    # -- connections, each of which belongs to the game of its participant -------------------------------------------

    def _find_live(self, connection: Connection) -> Live | None:
        one = self._known.by_code.get(connection.grant.name)
        return None if one is None or one.group is None else one.group.live or one.group.ended

    def joined(self, connection: Connection) -> None:
        """Connect a participant to the current round (called by the server)."""
        live = self._find_live(connection)
        if live is not None:
            group = self._known.by_code[connection.grant.name].group
            assert group is not None  # noqa: S101 - it has a game
            group.has_joined = True
            live.joined(connection)

    def left(self, connection: Connection) -> None:
        """Disconnect a participant from the current round (called by the server)."""
        live = self._find_live(connection)
        if live is not None:
            live.left(connection)

    def received(self, connection: Connection, message: Json) -> None:
        """Pass a message of a participant to the current round (called by the server)."""
        live = self._find_live(connection)
        if live is None:
            raise Refused("No round is played now.")
        live.received(connection, message)

    def news(self, connection: Connection) -> Iterable[bytes]:
        """Return the data that a participant has not received yet, in pieces (called by the server)."""
        live = self._find_live(connection)
        return () if live is None else live.news(connection)


def _check_codes(codes: Iterable[str] | None) -> tuple[str, ...] | None:
    """Check codes and remove duplicates; None: participants choose their codes."""
    if codes is None:
        return None
    given = as_items(codes, "codes", "codes of participants")
    return tuple(dict.fromkeys(map(_check_code, given)))


def _check_code(code: object) -> str:
    """Return a code if it is valid.

    Raises:
        BadValue: it is not.
    """
    if not isinstance(code, str) or not _CODE.fullmatch(code):
        raise BadValue(f"A code is 1 to 64 letters, digits, dots, dashes and _, not {shown(code)}.")
    return code


def _change_scenario(scenario: Scenario, condition: str, changes: object) -> Scenario:
    """Return a scenario with the changes of a condition."""
    try:
        return scenario.replace(**{str(path): value for path, value in as_mapping(changes, "what changes").items()})
    except GammsError as error:
        error.add_note(f"In the condition {shown(condition)} of the study.")
        raise


def _make_page(title: str) -> bytes:
    """Return the page on which participants consent and start rounds."""
    page = (Path(__file__).parent.parent / "data" / "study.html").read_text(encoding="utf-8")
    for name in ("script", "style"):
        part = page[page.index(f"<{name}>") + len(name) + 2 : page.index(f"</{name}>")]
        page = page.replace(f"{{{name}_hash}}", compute_hash(part))
    return page.replace("{title}", escape(title)).encode()


class _GroupHost:
    """The server as the game of one group sees it: only the connections of its members."""

    def __init__(self, server: Server, links: Links, codes: tuple[str, ...]) -> None:
        self._server = server
        self._codes = codes
        self.address = server.address
        self.links = links

    @property
    def connections(self) -> list[Connection]:
        """The open connections of the members."""
        return [one for one in self._server.connections if one.grant.name in self._codes]

    def link(self, token: str) -> str:
        """Return the address of the page of the game, with a token in it."""
        return self._server.link(token, "/play")

    def wake(self) -> None:
        """Tell the server that there is new data."""
        self._server.wake()

    def close(self) -> None:
        """Do nothing: the study closes the server."""
