"""Who takes part in a study: codes and the secrets of their browsers, groups and conditions, kept in a file.

The file has a line of JSON for each thing that happens.
"""

import hmac
import re
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from time import monotonic
from typing import Any, NotRequired, TypedDict

from gamms import kernels
from gamms.errors import BadFile, BadValue
from gamms.folders import add_lines, as_kind, damaged, lines_in
from gamms.text import shown
from gamms.web.links import Refused, digest_of
from gamms.web.live import Live
from gamms.web.server import Json

_MOST_PARTICIPANTS = 10_000
_SECRET = re.compile(r"[A-Za-z0-9_-]{22,100}")
_PRESENT_S = 10.0  # a page that waits asks more often than that
_DIGEST = re.compile(r"[0-9a-f]{64}")
_OF_STUDY = "a line of this study"
_MINUTE_S = 60.0
_TAKEN_OUT = "taken_out.jsonl"
_PATTERN = re.compile(r"[A-Za-z0-9._*-]{1,64}")
Line = dict[str, Any]


class _ConsentLine(TypedDict):
    """The line of a participant who has agreed, or whose code was released."""

    participant: str
    number: int
    secret: str | None


class _GroupLine(TypedDict):
    """The line of a group that has come together."""

    group: int
    condition: str
    members: list[str]
    place: NotRequired[int]


class _RemovalLine(TypedDict):
    """The line of a code that was taken out."""

    out: str


class _RoundLine(TypedDict):
    """The line of a round that begins."""

    group: int
    played: int
    attempt: int


@dataclass
class Group:
    """Participants who play together, or one who plays alone.

    Attributes:
        number: from 0, in the order in which they came together.
        condition: its name.
        members: the codes, in the order of what they play.
        played: how many rounds are over, those of practice included.
        attempts: how often the next one was begun.
        ready: those who want to begin it.
        ready_at: since when one of them does, by `time.monotonic()`.
        place: of its condition in the order of conditions: its number, or that of a group that was taken out.
        live: the game that is played; None: none.
        began_at: since when, by `time.monotonic()`.
        has_joined: whether a page has connected to that game.
        ended: the game that is over, which pages still show.
    """

    number: int
    condition: str
    members: tuple[str, ...]
    played: int = 0
    attempts: int = 0
    ready: set[str] = field(default_factory=set)
    ready_at: float = 0.0
    place: int = 0
    live: Live | None = None
    began_at: float = 0.0
    has_joined: bool = False
    ended: Live | None = None


@dataclass
class Participant:
    """Who has agreed to take part.

    Attributes:
        code: of the link.
        number: from 0, in the order in which they agreed.
        secret: the SHA-256 of that of the browser to which the code belongs; None: it belongs to none.
        group: that they play in; None: others have to come for it.
        came_at: since when they wait for others, by `time.monotonic()`; None: they do not.
        seen_at: when their page has asked last.
    """

    code: str
    number: int
    secret: str | None
    group: Group | None = None
    came_at: float | None = None
    seen_at: float = 0.0


class Participants:
    """Who takes part; not for several threads at once.

    Args:
        file: where it is kept; what is in it goes on.
        size: how many play together.
        conditions: their names.
        seed: of the order of conditions, and of who plays what.
        partner_within: how long one waits for others, in seconds.

    Attributes:
        by_code: all that have agreed, without those that were taken out.
        groups: in the order in which they came together.

    Raises:
        BadFile: a line of the file is damaged.
    """

    def __init__(self, file: Path, size: int, conditions: Sequence[str], seed: int, partner_within: float) -> None:
        self._file, self._size, self._conditions = file, size, conditions
        self._seed, self._partner_within = seed, partner_within
        self.by_code: dict[str, Participant] = {}
        self.groups: list[Group] = []
        self._agreed = 0  # how many ever
        for place, line in enumerate(lines_in(file, _OF_STUDY), 1):
            try:
                self._apply(line)
            except BadFile as error:
                raise damaged(file, place, _OF_STUDY, str(error)) from None

    def _apply(self, line: Line) -> None:
        """Take what a line of the file says.

        Raises:
            BadFile: it does not fit the lines before it.
        """
        if "participant" in line:
            self._apply_agreed(as_kind(line, _ConsentLine))
        elif "out" in line:
            code = as_kind(line, _RemovalLine)["out"]
            if code not in self.by_code:
                raise BadFile(f"there is no participant {code!r}")
            self._remove(code)
        elif "members" in line:
            self._apply_formed(as_kind(line, _GroupLine))
        else:
            self._apply_played(as_kind(line, _RoundLine))

    def _apply_agreed(self, line: _ConsentLine) -> None:
        secret = line["secret"]
        if secret is not None and not _DIGEST.fullmatch(secret):
            raise BadFile("its secret is no digest")
        one = Participant(line["participant"], line["number"], None)
        self.by_code.setdefault(one.code, one).secret = secret
        self._agreed = max(self._agreed, one.number + 1)

    def _apply_formed(self, line: _GroupLine) -> None:
        members = [self.by_code.get(code) for code in line["members"]]
        is_known = line["condition"] in self._conditions and None not in members
        if not is_known or len(members) != self._size or line["group"] != len(self.groups):
            raise BadFile("no such group can come together")
        number = line["group"]
        group = Group(number, line["condition"], tuple(line["members"]), place=line.get("place", number))
        self.groups.append(group)
        for member in members:
            if member is not None:
                member.group = group

    def _apply_played(self, line: _RoundLine) -> None:
        if not 0 <= line["group"] < len(self.groups):
            raise BadFile("there is no such group")
        group = self.groups[line["group"]]
        group.played = line["played"]
        group.attempts = line["attempt"]

    def note_round(self, group: Group) -> None:
        """Keep how many rounds of a group are over, and how often the next one was begun."""
        add_lines(self._file, [{"group": group.number, "played": group.played, "attempt": group.attempts}])

    def known(self, code: str, message: Json) -> Participant | None:
        """Return the participant who asks; None: one who has to agree first.

        Raises:
            Refused: the code belongs to another browser, or the study is full.
        """
        one, secret = self.by_code.get(code), message.get("secret")
        if one is not None and one.secret is not None:
            if not isinstance(secret, str) or not hmac.compare_digest(one.secret, digest_of(secret)):
                raise Refused("This code is used in another browser. Go on there, or ask who gave it to you.")
            return one
        if message.get("agree") is not True:
            return None
        if not isinstance(secret, str) or not _SECRET.fullmatch(secret):
            raise Refused("This page has no secret of its browser. Allow cookies for it, and load it again.")
        if one is None:
            if len(self.by_code) >= _MOST_PARTICIPANTS:
                raise Refused("This study has all its participants.")
            one = self.by_code[code] = Participant(code, self._agreed, None)
            self._agreed += 1
        self.keep_secret(one, digest_of(secret))
        return one

    def keep_secret(self, one: Participant, digest: str | None) -> None:
        """Let a code belong to the browser whose secret has a digest; None: to the next one that agrees."""
        one.secret = digest
        add_lines(self._file, [{"participant": one.code, "number": one.number, "secret": digest}])

    def group_of(self, one: Participant) -> Group | None:
        """Return the group of a participant who has none, with those who have waited longest; None: others lack.

        One who has waited too long waits no more, and has no `came_at`, until the page asks again.
        """
        one.seen_at = now = monotonic()
        one.came_at = now if one.came_at is None else one.came_at
        waiting = [
            other
            for other in self.by_code.values()
            if other.group is None and other.came_at is not None and now - other.seen_at < _PRESENT_S
        ]
        if len(waiting) < self._size:
            if now - one.came_at > self._partner_within:
                one.came_at = None
            return None
        waiting.sort(key=lambda other: other.came_at or 0.0)
        number, members = len(self.groups), waiting[: self._size]
        order = kernels.stream(self._seed, "people of a study", number).permutation(len(members)).tolist()
        place = self._next_place()
        group = Group(number, self.condition_of(place), tuple(members[one].code for one in order), place=place)
        line: Json = {"group": number, "condition": group.condition, "members": list(group.members)}
        if place != number:
            line["place"] = place
        add_lines(self._file, [line])
        self.groups.append(group)
        for member in members:
            member.group = group
        return group

    def _next_place(self) -> int:
        """Return the first place in the order of conditions that no group has, without those that were taken out."""
        taken = {group.place for group in self.groups if any(code in self.by_code for code in group.members)}
        return next(place for place in range(len(taken) + 1) if place not in taken)

    def take_out(self, code: str) -> None:
        """Take a participant out: another group gets the condition when no member of the group is left."""
        self._remove(code)
        add_lines(self._file, [{"out": code}])

    def _remove(self, code: str) -> None:
        one = self.by_code.pop(code)
        if one.group is not None:
            one.group.ready.discard(code)

    def condition_of(self, number: int) -> str:
        """Return the condition of the participant who is the number-th to agree, or of that group, from 0."""
        names = self._conditions
        block, place = divmod(number, len(names))
        return names[int(kernels.stream(self._seed, "study", block).permutation(len(names))[place])]


class ConsentRateLimit:
    """Bounds how many agree from one network address in a minute; of addresses nothing is kept for longer.

    Args:
        most: of them.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._times: dict[str, deque[float]] = {}

    def count(self, address: str) -> None:
        """Count one who agrees.

        Raises:
            Refused: too many have.
        """
        now = monotonic()
        for known, times in [*self._times.items()]:
            while times and now - times[0] > _MINUTE_S:
                times.popleft()
            if not times:
                del self._times[known]
        times = self._times.setdefault(address, deque())
        if len(times) >= self._most:
            raise Refused("Too many have agreed from your network in the last minute. Try again in a minute.")
        times.append(now)


class RemovedCodes:
    """The codes that were taken out of a study, in a file of its folder, to which another program may add.

    Args:
        folder: of the results.
    """

    def __init__(self, folder: Path) -> None:
        self._file = folder / _TAKEN_OUT
        self._size = 0
        self._patterns: list[str] = []

    def is_read_again(self) -> bool:
        """Read the file if it has grown; return whether it has.

        Raises:
            BadFile: a line of it is damaged.
        """
        size = self._file.stat().st_size if self._file.exists() else 0
        if size == self._size:
            return False
        self._size = size
        self._patterns = [line["out"] for line in lines_in(self._file, "a code that was taken out", _RemovalLine)]
        return True

    def has(self, code: str) -> bool:
        """Whether a code was taken out."""
        return any(fnmatchcase(code, pattern) for pattern in self._patterns)


def take_out(folder: Path, codes: Iterable[str]) -> None:
    """Take participants out of a study, which may be served by another program; see `Study.take_out`.

    Args:
        folder: of the results.
        codes: of participants, or with `*` in them.

    Raises:
        BadValue: one is no code, or there is no study in the folder.
    """
    if not (folder / "study.jsonl").is_file():
        raise BadValue(f"There is no study in {str(folder)!r}.")
    for code in codes:
        if not _PATTERN.fullmatch(str(code)):
            raise BadValue(
                f"A code is 1 to 64 letters, digits, dots, dashes and _; * is for any of these, not {shown(code)}."
            )
    add_lines(folder / _TAKEN_OUT, [{"out": code} for code in codes])
