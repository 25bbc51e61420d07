"""Serve the page on which places of a map are chosen, so that it can save them into the scenario file.

A page may change where agents start, the nodes of rules and the roads that are closed, and nothing else: no code, no
other file. It is shown the difference first; what it then saves must be the same.
"""

import base64
import os
import threading
from collections.abc import Sequence
from pathlib import Path

from gamms.arguments import as_path
from gamms.plain import Plain
from gamms.scenario import Scenario, load
from gamms.scenario.edits import Change, Edit, edited
from gamms.web.links import Grant, Handle, Links, Refused, digest_of
from gamms.web.places import assembled, opened, options_of, packed_map, starts_of
from gamms.web.server import Call, Json, Page, Server, Site

_MOST_CHANGES = 10
_MOST_NODES = 10_000


class PlaceEditor(Handle):
    """Serves a page of a map or scenario file until `close`; usable in a `with` statement.

    Args:
        file: an OpenStreetMap, GeoJSON or `.gamms` file, or a scenario file, into which the page can save.
        theme: "light", "dark", or None: as the browser is.
        host: the address; all but loopback need `allow_network`.
        port: 0 takes a free one.
        allow_network: let other machines in, who need the link.

    Attributes:
        url: the address of the page, with its token.

    Raises:
        ScenarioError (ValueError), OSError: the file cannot be loaded.
        MissingExtra (ImportError): the extra `web` is not installed.
        BadValue (ValueError): the address is not loopback, and `allow_network` is not set; or there is no such port.
        NetworkError (ConnectionError): the port is in use, or not allowed.
    """

    def __init__(
        self,
        file: str | os.PathLike[str],
        *,
        theme: str | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        allow_network: bool = False,
    ) -> None:
        self._file: Path = as_path(file, "file")
        self._game, self._is_scenario = opened(self._file)
        self._lock, self._is_closed = threading.Lock(), threading.Event()
        look = {"theme": theme, "editor": self._is_scenario}
        page = assembled(self._game, look, is_scenario=self._is_scenario, connect="'self'")
        self._map_shown = self._game.spec.map
        links = Links()
        calls: dict[str, Call] = {
            "/state": self._state,
            "/starts": self._starts,
            "/preview": self._preview,
            "/save": self._save,
        }
        site = Site(links, {"/": Page(page)}, calls if self._is_scenario else {})
        self._server = Server(site, host=host, port=port, allow_network=allow_network)
        self.url = self._server.link(links.add(Grant("editor")))

    def close(self) -> None:
        """End the server."""
        self._is_closed.set()
        self._server.close()

    # -- what the page calls --------------------------------------------------------------------------------------

    def _state(self, _grant: Grant, _message: Json, _address: str) -> Plain:
        """Return the options of the page as the file is now, and the map, if it is another one than in the page."""
        with self._lock:
            now = load(self._file)
            self._game = self._game if now == self._game else now  # which may have loaded its map
            is_shown = self._game.spec.map == self._map_shown
            return {
                "options": options_of(self._game, is_scenario=True),
                "map": None if is_shown else base64.b64encode(packed_map(self._game)).decode(),
            }

    def _starts(self, _grant: Grant, message: Json, _address: str) -> Plain:
        seed = message.get("seed")
        if type(seed) is not int:
            raise Refused("A seed is a whole number.")
        return starts_of(self._game, [seed])

    def _preview(self, _grant: Grant, message: Json, _address: str) -> Plain:
        edit = self._edit(message)
        return {"difference": edit.diff, "id": digest_of(f"{edit.before}\0{edit.after}")}

    def _save(self, _grant: Grant, message: Json, _address: str) -> Plain:
        with self._lock:
            edit = self._edit(message)
            if digest_of(f"{edit.before}\0{edit.after}") != message.get("id"):
                raise Refused("The file has been changed meanwhile. Look at the difference again.")
            edit.write()
            self._game = edit.game
        return {"is_other_map": edit.game.spec.map != self._map_shown}

    def _edit(self, message: Json) -> Edit:
        given = message.get("changes")
        if not isinstance(given, list) or len(given) > _MOST_CHANGES:
            raise Refused(f"A page gives at most {_MOST_CHANGES} changes.")
        now = load(self._file)
        return edited(self._file, [change for one in given for change in _checked(one, now)], self._game)


def _checked(given: Plain, game: Scenario) -> Sequence[Change]:
    """Return the changes of the file that one of a page means."""
    match given:
        case {"keys": ["teams", str(team), "agents"], "value": list(agents)} if team in game.spec.teams:
            return _of_agents(team, agents, game)
        case {"keys": ["teams", str(team), "near"], "value": [int() | float() as x, int() | float() as y]}:
            return [Change(("teams", team, "near"), [x, y])]
        case {"keys": ["teams", str(team), "within"], "value": int() | float() as metres}:
            return [Change(("teams", team, "within"), metres)]
        case {"keys": ["map", "closed"], "value": list(outlines)} if all(map(_is_outline, outlines)):
            return [Change(("map", "closed"), outlines, is_more=True)]
        case {"keys": ["rules", int(number), "with", "nodes"], "value": list(nodes)} if all(map(_is_node, nodes)):
            return [Change(("rules", number, "with", "nodes"), nodes)]
    raise Refused("A page may change where agents start, the nodes of rules, and which roads are closed.")


def _of_agents(team: str, agents: list[Plain], game: Scenario) -> list[Change]:
    """Return changes that put listed agents elsewhere, and add those that are not there."""
    if len(agents) > _MOST_NODES:
        raise Refused(f"A page puts at most {_MOST_NODES} agents of a team, not {len(agents)}.")
    known = [one.name for one in game.spec.teams[team].agents]
    changes, more = list[Change](), list[Plain]()
    for one in agents:
        match one:
            case {"name": str(name), "node": node} if len(one) == 2 and _is_place(node):
                path = ("teams", team, "agents")
                if name in known:
                    changes.append(Change((*path, known.index(name), "node"), node))
                else:
                    more.append({"name": name, "node": node})
            case _:
                raise Refused("An agent has a name and a node.")
    return [*changes, Change(("teams", team, "agents"), more, is_more=True)] if more else changes


def _is_place(value: Plain) -> bool:
    """Whether a value is the id of a node, [x, y], or a latitude and longitude."""
    match value:
        case bool():
            return False
        case int() | [int() | float(), int() | float()]:
            return True
        case {"lat": int() | float(), "lon": int() | float()}:
            return len(value) == 2
    return False


def _is_node(value: Plain) -> bool:
    match value:
        case {"node_at": place}:
            return len(value) == 1 and not isinstance(place, int) and _is_place(place)
    return type(value) is int


def _is_outline(value: object) -> bool:
    if not isinstance(value, list) or len(value) > _MOST_NODES:
        return False
    return all(isinstance(corner, list) and _is_place(corner) for corner in value)
