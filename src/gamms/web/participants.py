"""Who takes part in a study: codes and the secrets of their browsers, groups and conditions, kept in a file.

The file has a line of JSON for each thing that happens.
"""

import hmac
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any, TypedDict

from gamms import kernels
from gamms.errors import BadFile
from gamms.folders import add_lines, as_kind, damaged, lines_in
from gamms.web.links import Refused, digest_of
from gamms.web.live import Live
from gamms.web.server import Json

_MOST_PARTICIPANTS = 10_000
_SECRET = re.compile(r"[A-Za-z0-9_-]{22,100}")
_PRESENT_S = 10.0  # a page that waits asks more often than that
_DIGEST = re.compile(r"[0-9a-f]{64}")
_OF_STUDY = "a line of this study"
Line = dict[str, Any]


class _Agreed(TypedDict):
    """The line of a participant who has agreed, or whose code was released."""

    participant: str
    number: int
    secret: str | None


class _Formed(TypedDict):
    """The line of a group that has come together."""

    group: int
    condition: str
    members: list[str]


class _Played(TypedDict):
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
        live: the game that is played; None: none.
        ended: the game that is over, which pages still show.
    """

    number: int
    condition: str
    members: tuple[str, ...]
    played: int = 0
    attempts: int = 0
    ready: set[str] = field(default_factory=set)
    ready_at: float = 0.0
    live: Live | None = None
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
        by_code: all that have agreed.
        groups: in the order in which they came together.

    Raises:
        BadFile: a line of the file is damaged.
    """

    def __init__(self, file: Path, size: int, conditions: Sequence[str], seed: int, partner_within: float) -> None:
        self._file, self._size, self._conditions = file, size, conditions
        self._seed, self._partner_within = seed, partner_within
        self.by_code: dict[str, Participant] = {}
        self.groups: list[Group] = []
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
            self._apply_agreed(as_kind(line, _Agreed))
        elif "members" in line:
            self._apply_formed(as_kind(line, _Formed))
        else:
            self._apply_played(as_kind(line, _Played))

    def _apply_agreed(self, line: _Agreed) -> None:
        secret = line["secret"]
        if secret is not None and not _DIGEST.fullmatch(secret):
            raise BadFile("its secret is no digest")
        one = Participant(line["participant"], line["number"], None)
        self.by_code.setdefault(one.code, one).secret = secret

    def _apply_formed(self, line: _Formed) -> None:
        members = [self.by_code.get(code) for code in line["members"]]
        is_known = line["condition"] in self._conditions and None not in members
        if not is_known or len(members) != self._size or line["group"] != len(self.groups):
            raise BadFile("no such group can come together")
        group = Group(line["group"], line["condition"], tuple(line["members"]))
        self.groups.append(group)
        for member in members:
            if member is not None:
                member.group = group

    def _apply_played(self, line: _Played) -> None:
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
            one = self.by_code[code] = Participant(code, len(self.by_code), None)
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
        group = Group(number, self.condition_of(number), tuple(members[place].code for place in order))
        line: Json = {"group": number, "condition": group.condition, "members": list(group.members)}
        add_lines(self._file, [line])
        self.groups.append(group)
        for member in members:
            member.group = group
        return group

    def condition_of(self, number: int) -> str:
        """Return the condition of the participant who is the number-th to agree, or of that group, from 0."""
        names = self._conditions
        block, place = divmod(number, len(names))
        return names[int(kernels.stream(self._seed, "study", block).permutation(len(names))[place])]
