"""People who play in a served game: their links, what they are asked, and what they choose, over the connections."""

from collections.abc import Callable, Mapping
from typing import Protocol

from gamms.context import Context
from gamms.plain import Plain
from gamms.web.links import Audience, Grant, Refused
from gamms.web.people import People
from gamms.web.server import Connection, Json


class Served(Protocol):
    """What players need of a served game."""

    handlers: dict[str, Callable[[Connection, Json], None]]
    when_joined: list[Callable[[Connection], None]]

    @property
    def connections(self) -> list[Connection]:
        """Those that have joined."""

    def link(self, grant: Grant) -> str:
        """Return the address for the holder of a grant."""


class Players:
    """Sends people their questions and takes their choices; a part of `Live`.

    Args:
        live: the served game.
    """

    def __init__(self, live: Served) -> None:
        self._live = live
        self._people: People | None = None
        live.handlers["choose"] = self._choose
        live.when_joined.append(self._joined)

    def open(self, ctx: Context) -> None:
        """Let people into a game, which begins now."""
        self._people = People.open(ctx)
        self._people.changed.append(self._tell_all)
        for connection in self._live.connections:
            self._joined(connection)

    def links(self) -> dict[str, str]:
        """Return the links of the people of the game, by name."""
        if self._people is None:
            return {}
        self._people.look_up()
        return {
            person.name: self._live.link(
                Grant(person.name, Audience(agents=frozenset(person.agents)), may_play=True),
            )
            for person in self._people.persons.values()
        }

    def let_go(self) -> None:
        """Wait for no person any more in this game."""
        if self._people is not None:
            self._people.let_go()

    def _joined(self, connection: Connection) -> None:
        if self._people is not None and connection.grant.may_play:
            self._people.come(connection.grant.name)
            self._tell(connection, self._people)

    def _choose(self, connection: Connection, message: Json) -> None:
        if self._people is None or not connection.grant.may_play:
            raise Refused("This link is for looking on.")
        choice = {key: value for key, value in message.items() if key != "type"}
        self._people.choose(connection.grant.name, choice)

    def _tell_all(self) -> None:
        for connection in self._live.connections:
            if self._people is not None and connection.grant.may_play:
                self._tell(connection, self._people)

    def _tell(self, connection: Connection, people: People) -> None:
        asked: Mapping[str, Plain] = {
            "type": "questions",
            "questions": people.asked(connection.grant.name),
            "waiting": people.is_waiting,
        }
        connection.tell(asked)
