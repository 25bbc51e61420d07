"""The participants of a study: codes, secrets of browsers, groups and conditions, stored in a file.

The file has one line of JSON for each consent, group, round and removal.
"""

import hmac
import re
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from pathlib import Path
from time import monotonic
from typing import Any, NotRequired, TypedDict

from gamms import kernels
from gamms.errors import BadFile, BadValue
from gamms.folders import add_lines, as_kind, make_line_error, read_json_lines
from gamms.text import shown
from gamms.web.links import Refused, compute_digest
from gamms.web.live import Live
from gamms.web.server import Json

_MOST_PARTICIPANTS = 10_000
_SECRET = re.compile(r"[A-Za-z0-9_-]{22,100}")
_PRESENT_S = 10.0  # a waiting page sends requests more often
_DIGEST = re.compile(r"[0-9a-f]{64}")
_OF_STUDY = "a line of this study"
_MINUTE_S = 60.0
_TAKEN_OUT = "taken_out.jsonl"
_PATTERN = re.compile(r"[A-Za-z0-9._*-]{1,64}")
Line = dict[str, Any]


class _ConsentLine(TypedDict):
    """A line of the file: a participant has consented, or a code was released (`secret` is None), and when."""

    participant: str
    number: int
    secret: str | None
    time: NotRequired[str]


class _GroupLine(TypedDict):
    """A line of the file: a group was formed."""

    group: int
    condition: str
    members: list[str]
    place: NotRequired[int]


class _RemovalLine(TypedDict):
    """A line of the file: the code of a participant who was removed, or a removed code or pattern of codes."""

    out: str


class _RoundLine(TypedDict):
    """A line of the file: a group begins a round."""

    group: int
    played: int
    attempt: int


@dataclass
class Group:
    """Participants who play together, or one who plays alone.

    Attributes:
        number: the number of the group, from 0, in the order of forming.
        condition: the name of the condition.
        members: the codes of the members, in the order of the roles that they play.
        played: the number of finished rounds, including practice.
        attempts: the number of times that the next round was begun.
        ready: the codes of members who are ready for the next round.
        ready_at: the time when the first of them became ready, by `time.monotonic()`.
        place: the index in the sequence of conditions: the number of the group, or the index of a removed group.
        live: the current game; None: there is none.
        began_at: the time when it began, by `time.monotonic()`.
        has_joined: whether a page has connected to it.
        ended: the last finished game, while pages still show it.
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
    """A person who has consented.

    Attributes:
        code: the code in the link.
        number: the number of the participant, from 0, in the order of consent.
        secret: the SHA-256 digest of the secret of the participant's browser; None: the code was released.
        group: the group; None: it is not complete yet.
        came_at: the time when the wait for others began, by `time.monotonic()`; None: the participant does not wait.
        seen_at: the time of the last request of the page.
    """

    code: str
    number: int
    secret: str | None
    group: Group | None = None
    came_at: float | None = None
    seen_at: float = 0.0


class Participants:
    """All participants and groups of a study; not thread-safe.

    Args:
        file: the file, which is read first and then appended to.
        size: the number of members of a group.
        conditions: the names of the conditions.
        seed: determines the order of conditions, and the roles in groups.
        partner_within: the maximum wait for other members, in seconds.

    Attributes:
        by_code: code -> participant, without removed participants.
        groups: the groups, in the order of forming.

    Raises:
        BadFile: a line of the file is damaged.
    """

    def __init__(self, file: Path, size: int, conditions: Sequence[str], seed: int, partner_within: float) -> None:
        self._file = file
        self._size = size
        self._conditions = conditions
        self._seed = seed
        self._partner_within = partner_within
        self.by_code: dict[str, Participant] = {}
        self.groups: list[Group] = []
        self._agreed = 0  # consents, including those of removed participants
        for place, line in enumerate(read_json_lines(file, _OF_STUDY), 1):
            try:
                self._apply(line)
            except BadFile as error:
                raise make_line_error(file, place, _OF_STUDY, str(error)) from None

    def _apply(self, line: Line) -> None:
        """Apply a line of the file.

        Raises:
            BadFile: the line is inconsistent with the lines before it.
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
        """Append the numbers of rounds and attempts of a group to the file."""
        add_lines(self._file, [{"group": group.number, "played": group.played, "attempt": group.attempts}])

    def find_participant(self, code: str, message: Json) -> Participant | None:
        """Return the participant who sends a message, after consent if the message contains it; None: no consent yet.

        Raises:
            Refused: the code belongs to another browser, the browser has no secret, or the study is full.
        """
        one = self.by_code.get(code)
        secret = message.get("secret")
        if one is not None and one.secret is not None:
            if not isinstance(secret, str) or not hmac.compare_digest(one.secret, compute_digest(secret)):
                raise Refused("This code is used in another browser. Go on there, or ask who gave it to you.")
            return one
        if message.get("agree") is not True:
            return None
        if not isinstance(secret, str) or not _SECRET.fullmatch(secret):
            raise Refused("This page has no secret of its browser. Allow cookies for it, and load it again.")
        if one is None:
            if len(self.by_code) >= _MOST_PARTICIPANTS:
                raise Refused("This study has all its participants.")
            one = Participant(code, self._agreed, None)
            self.by_code[code] = one
            self._agreed += 1
        self.keep_secret(one, compute_digest(secret))
        return one

    def keep_secret(self, one: Participant, digest: str | None) -> None:
        """Assign a code to the browser whose secret has this digest; None: to the next browser that consents."""
        one.secret = digest
        now = datetime.now(UTC).isoformat(timespec="seconds")
        add_lines(self._file, [{"participant": one.code, "number": one.number, "secret": digest, "time": now}])

    def form_group(self, one: Participant) -> Group | None:
        """Form a group of the participants who have waited longest, and return it; None: there are not enough.

        If the participant has waited too long, `came_at` becomes None until the next request of the page.
        """
        now = monotonic()
        one.seen_at = now
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
        number = len(self.groups)
        members = waiting[: self._size]
        order = kernels.stream(self._seed, "people of a study", number).permutation(len(members)).tolist()
        place = self._find_next_place()
        group = Group(number, self.condition_of(place), tuple(members[one].code for one in order), place=place)
        line: Json = {"group": number, "condition": group.condition, "members": list(group.members)}
        if place != number:
            line["place"] = place
        add_lines(self._file, [line])
        self.groups.append(group)
        for member in members:
            member.group = group
        return group

    def _find_next_place(self) -> int:
        """Return the first index in the sequence of conditions that no present group has."""
        taken = {group.place for group in self.groups if any(code in self.by_code for code in group.members)}
        return next(place for place in range(len(taken) + 1) if place not in taken)

    def take_out(self, code: str) -> None:
        """Remove a participant; when no member of a group is left, the next group gets its condition."""
        self._remove(code)
        add_lines(self._file, [{"out": code}])

    def _remove(self, code: str) -> None:
        one = self.by_code.pop(code)
        if one.group is not None:
            one.group.ready.discard(code)

    def condition_of(self, number: int) -> str:
        """Return the condition of a participant (or group) by its index in the sequence of conditions, from 0."""
        names = self._conditions
        block, place = divmod(number, len(names))
        return names[int(kernels.stream(self._seed, "study", block).permutation(len(names))[place])]


class ConsentRateLimit:
    """Limits the consents per minute from one network address; addresses are forgotten after a minute.

    Args:
        most: the maximum number.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._times: dict[str, deque[float]] = {}

    def count(self, address: str) -> None:
        """Count a consent that came from an address.

        Raises:
            Refused: there are too many.
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
    """The removed codes of a study, in a file to which other programs may append.

    Args:
        folder: the folder of the study.
    """

    def __init__(self, folder: Path) -> None:
        self._file = folder / _TAKEN_OUT
        self._size = 0
        self._patterns: list[str] = []

    def is_read_again(self) -> bool:
        """Read the file if its size has changed; return whether it has.

        Raises:
            BadFile: a line of the file is damaged.
        """
        size = self._file.stat().st_size if self._file.exists() else 0
        if size == self._size:
            return False
        self._size = size
        self._patterns = [
            line["out"] for line in read_json_lines(self._file, "a code that was taken out", _RemovalLine)
        ]
        return True

    def has(self, code: str) -> bool:
        """Return whether a code was removed."""
        return any(fnmatchcase(code, pattern) for pattern in self._patterns)


def take_out(folder: Path, codes: Iterable[str]) -> None:
    """Remove participants from a study, which another program may be serving; see `Study.take_out`.

    Args:
        folder: the folder of the study.
        codes: codes of participants, or patterns with `*`.

    Raises:
        BadValue: a code is invalid, or the folder contains no study.
    """
    if not (folder / "study.jsonl").is_file():
        raise BadValue(f"There is no study in {str(folder)!r}.")
    for code in codes:
        if not _PATTERN.fullmatch(str(code)):
            raise BadValue(
                f"A code is 1 to 64 letters, digits, dots, dashes and _; * is for any of these, not {shown(code)}."
            )
    add_lines(folder / _TAKEN_OUT, [{"out": code} for code in codes])
