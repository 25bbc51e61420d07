"""What is handed out of what is served: handles to programs, and links with tokens to people."""

import hashlib
import hmac
import secrets
import threading
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

from gamms.errors import GammsError
from gamms.workers import SIGNALS_S


class Handle(ABC):
    """What is served, until `close`; usable in a `with` statement."""

    _is_closed: threading.Event

    @abstractmethod
    def close(self) -> None:
        """End the server."""

    def stay_open(self) -> None:
        """Serve on until `close` or Ctrl-C."""
        with suppress(KeyboardInterrupt):
            while not self._is_closed.wait(SIGNALS_S):
                pass

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass(frozen=True)
class Audience:
    """Whose knowledge is sent: that of a team, that of some agents alone, or everything.

    Attributes:
        team: by its text; an agent without a team is one of its own, by its name.
        agents: names; they know what their sensors report, and not what others of their team do.
    """

    team: str | None = None
    agents: frozenset[str] = frozenset()

    @property
    def is_everything(self) -> bool:
        """Whether nothing is kept from it."""
        return self.team is None and not self.agents

    def has(self, name: str, team: object) -> bool:
        """Whether an agent is one of those whose knowledge it is."""
        return name in self.agents if self.agents else str(name if team is None else team) == self.team

    def __str__(self) -> str:
        """Name it for people: the team, the agents, or everything."""
        return ", ".join(sorted(self.agents)) or self.team or "everything"


@dataclass(frozen=True)
class Grant:
    """What the holder of a link may do.

    Attributes:
        name: of the link.
        audience: whose knowledge it is sent.
        may_control: whether it may pause, step, restart and change the game.
        may_play: whether it may choose for the agents of its audience.
    """

    name: str
    audience: Audience = Audience()
    may_control: bool = False
    may_play: bool = False


class Links:
    """The tokens that were given, and what their holders may do; of the tokens only digests are kept."""

    def __init__(self) -> None:
        self._grants: dict[str, Grant] = {}
        self._lock = threading.Lock()

    def add(self, grant: Grant) -> str:
        """Return a new token for a grant."""
        token = secrets.token_urlsafe(24)
        with self._lock:
            self._grants[digest_of(token)] = grant
        return token

    def find(self, token: object) -> Grant | None:
        """Return what a token grants; None where there is no such token. Takes as long for any token."""
        if not isinstance(token, str) or len(token) > 200:
            return None
        digest, found = digest_of(token), None
        with self._lock:
            for known, grant in self._grants.items():
                if hmac.compare_digest(known, digest):
                    found = grant
        return found


def digest_of(text: str) -> str:
    """Return the SHA-256 of any text, in hexadecimal."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


class Refused(GammsError, ValueError):
    """A message or call of a client cannot be done; it is sent the words."""
