"""Handles of running servers, and links with secret tokens, which grant permissions to their holders."""

import hashlib
import hmac
import secrets
import threading
from abc import ABC, abstractmethod
from collections.abc import Hashable
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

from gamms.errors import GammsError
from gamms.readonly import NotPickled
from gamms.text import as_text
from gamms.workers import SIGNALS_S


class PartOfServer(NotPickled):
    """Mix-in: a part of a running server, which threads use."""

    _not_pickled = (
        "A server can neither be pickled nor copied, and neither can its parts, because threads use them. Pass on the "
        "scenario, and serve it there."
    )


class Handle(PartOfServer, ABC):
    """A running server; close it with `close` or use it in a `with` statement."""

    _is_closed: threading.Event

    @abstractmethod
    def close(self) -> None:
        """Stop the server."""

    def stay_open(self) -> None:
        """Block until `close` is called or Ctrl-C is pressed."""
        with suppress(KeyboardInterrupt):
            while not self._is_closed.wait(SIGNALS_S):
                pass

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


@dataclass(frozen=True)
class Audience:
    """The knowledge that a client receives: that of a team, that of some agents, or everything.

    Attributes:
        team: the team; None: not that of a team.
        agents: names of agents; the client receives only what the sensors of these agents report.
    """

    team: Hashable = None
    agents: frozenset[str] = frozenset()

    @property
    def is_everything(self) -> bool:
        """Return whether the audience sees everything."""
        return self.team is None and not self.agents

    def has(self, name: str, team: object) -> bool:
        """Return whether an agent belongs to the audience."""
        if self.agents:
            return name in self.agents
        return team is not None and team == self.team

    def __str__(self) -> str:
        """Return a name for display: the team, the agents, or "everything"."""
        return ", ".join(sorted(self.agents)) or ("everything" if self.team is None else as_text(self.team))


@dataclass(frozen=True)
class LinkPermissions:
    """The permissions of the holder of a link.

    Attributes:
        name: the name of the link.
        audience: the knowledge that the holder receives.
        may_control: whether the holder may pause, step, restart and change the game.
        may_play: whether the holder may decide for the agents of the audience.
    """

    name: str
    audience: Audience = Audience()
    may_control: bool = False
    may_play: bool = False


class Links:
    """Grants by token; only digests of the tokens are stored."""

    def __init__(self) -> None:
        self._grants: dict[str, LinkPermissions] = {}
        self._lock = threading.Lock()

    def add(self, grant: LinkPermissions) -> str:
        """Create a token for a grant, and return it."""
        token = secrets.token_urlsafe(24)
        with self._lock:
            self._grants[compute_digest(token)] = grant
        return token

    def find(self, token: object) -> LinkPermissions | None:
        """Return the grant of a token, in constant time; None if the token is unknown."""
        if not isinstance(token, str) or len(token) > 200:
            return None
        digest = compute_digest(token)
        found = None
        with self._lock:
            for known, grant in self._grants.items():
                if hmac.compare_digest(known, digest):
                    found = grant
        return found


def compute_digest(text: str) -> str:
    """Return the SHA-256 digest of a text, in hexadecimal."""
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


class Refused(GammsError, ValueError):
    """A message or call of a client was refused; the client receives the text of the error."""
