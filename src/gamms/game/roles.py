"""Roles: some agents of a team, chosen by their names or their attributes, for rules that are not about whole teams."""

from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from gamms.arguments import as_items, as_key, as_known, as_mapping, as_name
from gamms.errors import BadType, BadValue, UnknownName
from gamms.plain import Plain, is_same
from gamms.text import shown
from gamms.typing.agent_engine import AgentType, IAgent

_KEYS = ("team", "names", "where")
_SCALARS = (str, int, float, bool)


@dataclass(frozen=True)
class Role:
    """Some agents of a team.

    Attributes:
        team: the team.
        names: the names of the agents; None: agents of all names.
        where: names and values of attributes that the agents have.
    """

    team: Hashable
    names: frozenset[str] | None
    where: tuple[tuple[str, Plain], ...]

    def __str__(self) -> str:
        """Return the team and what its agents have in common."""
        parts = [str(self.team)]
        if self.names is not None:
            parts.append(",".join(sorted(self.names)))
        parts += [f"{name}={value}" for name, value in self.where]
        return "/".join(parts)

    def as_plain(self) -> dict[str, Plain]:
        """Return the mapping from which `as_team_or_role` makes this role."""
        names = {} if self.names is None else {"names": sorted(self.names)}
        return {"team": self.team, **names, **({"where": dict(self.where)} if self.where else {})}

    def is_held_by(self, name: str, type: AgentType, attributes: Mapping[str, Any]) -> bool:
        """Return whether an agent of the team has this role, given its name, type and attributes."""
        if self.names is not None and name not in self.names:
            return False
        return all(is_same(_get_attribute(type, attributes, key), value) for key, value in self.where)

    def has(self, agent: IAgent) -> bool:
        """Return whether an agent has this role."""
        return agent.team == self.team and self.is_held_by(agent.name, agent.type, vars(agent))

    def find_flaw(self, members: Collection[IAgent]) -> UnknownName | None:
        """Return an error if a name or an attribute fits no agent of the team; None: all do.

        Args:
            members: the agents of the team.
        """
        known = sorted(agent.name for agent in members)
        for name in sorted(self.names or ()):
            if name not in known:
                return UnknownName(f"agent of team {shown(self.team)}:", name, known)
        for key, value in self.where:
            values = [_get_attribute(agent.type, vars(agent), key) for agent in members]
            found = [one for one in values if one is not None]
            if not found:
                names = dict.fromkeys(name for agent in members for name in _list_attributes(agent))
                return UnknownName(f"attribute of the agents of team {shown(self.team)}:", key, names)
            if not any(is_same(one, value) for one in found):
                texts = dict.fromkeys(one for one in found if isinstance(one, _SCALARS))
                return UnknownName(f"{key} of the agents of team {shown(self.team)}:", value, texts)
        return None


def _get_attribute(type: AgentType, attributes: Mapping[str, Any], name: str) -> Any:
    """Return an attribute of an agent, or of its `meta`; its type is "basic" or "aerial". None: it has none."""
    if name == "type":
        return type.name.lower()
    if name in attributes:
        return attributes[name]
    meta = attributes.get("meta")
    return meta.get(name) if isinstance(meta, Mapping) else None


def _list_attributes(agent: IAgent) -> Iterator[str]:
    """Yield the names of the attributes that roles can ask for."""
    yield "type"
    for name, value in vars(agent).items():
        if name == "meta" and isinstance(value, Mapping):
            yield from value
        elif not name.startswith("_"):
            yield name


def is_role(given: object) -> bool:
    """Return whether a value is meant as a role: a mapping with a team."""
    return isinstance(given, Mapping) and "team" in given


def as_team_or_role(given: object, name: str = "A team") -> Any:  # Any: a team, a hashable value; or a `Role`
    """Return a team, or a `Role` for a mapping such as `{"team": "red", "names": ["truck"]}`.

    Raises:
        BadType, BadValue: neither a team nor a role.
        UnknownName (KeyError): a key of the mapping is none of a role.
    """
    if not isinstance(given, Mapping):
        return as_key(given, name)
    for key in given:
        as_known(key, "key of a role", _KEYS)
    if "team" not in given:
        raise BadValue(f"The role {shown(given)} has no team: give {{'team': 'red', 'names': ['truck']}}.")
    names = given.get("names")
    where = given.get("where")
    if names is None and where is None:
        raise BadValue(f"The role {shown(given)} needs names or where; for all agents of a team give the team itself.")
    return Role(
        as_key(given["team"], "The team of a role"),
        None if names is None else frozenset(as_name(one, "an agent") for one in _check_names(names)),
        () if where is None else _as_attributes(where),
    )


def as_teams_and_roles(given: object) -> frozenset[Any] | None:  # Any: teams, and a `Role` for each mapping
    """Return one team or role, or several, as a set; None: all agents."""
    if given is None:
        return None
    several = given if isinstance(given, Iterable) and not isinstance(given, (str, Mapping)) else [given]
    return frozenset(as_team_or_role(one) for one in several)


def _check_names(names: object) -> Iterable[object]:
    found = [names] if isinstance(names, str) else as_items(names, "names", "names of agents")
    if not found:
        raise BadValue("names of a role is empty: name at least one agent.")
    return found


def _as_attributes(where: object) -> tuple[tuple[str, Plain], ...]:
    """Return the attributes of a role, sorted by name."""
    known = as_mapping(where, "where")
    if not known:
        raise BadValue("where of a role is empty: give attributes, such as {'kind': 'drone'}.")
    for name, value in known.items():
        if not isinstance(value, _SCALARS):
            raise BadType(f"where[{shown(name)}] must be a text, a number or a bool, not {shown(value)}.")
    return tuple(sorted((as_name(name, "an attribute"), value) for name, value in known.items()))


def read_owner(owner: object) -> Any:  # Any: a team, or a `Role`
    """Return a team, or the role of a mapping.

    Raises:
        BadType, BadValue, UnknownName (KeyError): a mapping is no role.
    """
    return as_team_or_role(owner) if isinstance(owner, Mapping) else owner


def find_roles(owners: Iterable[object]) -> list[Role]:
    """Return the roles among several owners, each once; see `read_owner`."""
    return [*dict.fromkeys(one for one in map(read_owner, owners) if isinstance(one, Role))]


def get_team(member: Hashable) -> Hashable:
    """Return the team of a team or role."""
    return member.team if isinstance(member, Role) else member


def has_attributes(members: Iterable[Hashable] | None) -> bool:
    """Return whether one of several teams and roles asks for attributes, which may change."""
    return any(isinstance(one, Role) and one.where for one in members or ())


def is_among(agent: IAgent, members: Collection[Hashable] | None) -> bool:
    """Return whether an agent is in one of several teams or roles; None: in all."""
    if members is None or agent.team in members:
        return True
    return any(isinstance(one, Role) and one.has(agent) for one in members)
