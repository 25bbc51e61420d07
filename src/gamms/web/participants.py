"""Who takes part in a study: codes and the secrets of their browsers, groups and conditions, kept in a file.

The file has a line of JSON for each thing that happens; `read_lines` and `add_lines` are for any such file.
"""

import hmac
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import Any

from gamms import kernels
from gamms.errors import BadFile
from gamms.plain import Plain
from gamms.text import reason, shown
from gamms.web.links import Refused, digest_of
from gamms.web.live import Live
from gamms.web.server import Json

_MOST_PARTICIPANTS = 10_000
_SECRET = re.compile(r"[A-Za-z0-9_-]{22,100}")
_PRESENT_S = 10.0  # a page that waits asks more often than that
Line = dict[str, Any]


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
        for place, line in enumerate(read_lines(file), 1):
            try:
                self._apply(line)
            except (KeyError, IndexError, TypeError):
                raise _damaged(file, place, shown(line)) from None

    def _apply(self, line: Line) -> None:
        """Take what a line of the file says."""
        if "participant" in line:
            one = Participant(line["participant"], line["number"], None)
            self.by_code.setdefault(one.code, one).secret = line["secret"]
        elif "members" in line:
            group = Group(line["group"], line["condition"], tuple(line["members"]))
            self.groups.append(group)
            for code in group.members:
                self.by_code[code].group = group
        else:
            group = self.groups[line["group"]]
            group.played, group.attempts = line["played"], line["attempt"]

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


def read_lines(file: Path, *keys: str) -> list[Line]:
    """Return the lines of a file; one that has no end, where the program was killed, is cut off.

    Args:
        file: of JSON lines.
        keys: that each of them has.

    Raises:
        BadFile: one of them is no JSON object, or has not all of these keys.
    """
    if not file.exists():
        return []
    data = file.read_bytes()
    whole = data.rfind(b"\n") + 1
    if whole < len(data):
        with file.open("r+b") as torn:
            torn.truncate(whole)
    lines: list[Line] = []
    for number, text in enumerate(data[:whole].splitlines(), 1):
        try:
            line = json.loads(text)
        except ValueError as error:
            raise _damaged(file, number, reason(error)) from None
        if not isinstance(line, dict) or not line.keys() >= set(keys):
            raise _damaged(file, number, shown(line))
        lines.append(line)
    return lines


def _damaged(file: Path, number: int, why: str) -> BadFile:
    return BadFile(f"Line {number} of {str(file)!r} is damaged: {why}. Give another folder as out.")


def add_lines(file: Path, lines: Iterable[Mapping[str, Plain]]) -> None:
    """Add lines to a file, all at once."""
    with file.open("a", encoding="utf-8") as stream:
        stream.write("".join(json.dumps(line) + "\n" for line in lines))
