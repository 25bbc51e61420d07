"""Territories: mappings from nodes to the teams or roles that own them, published by a game as facts."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from math import inf
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from gamms.arguments import as_choice, as_known, as_name, show_as_call
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.game.roles import Role, as_team_or_role, find_roles, get_team, read_owner
from gamms.game.settings import RuleSpec, declared
from gamms.ir.graph import as_node_id
from gamms.rules.endings import disclose_to_all
from gamms.rules.in_core import in_core
from gamms.text import shown
from gamms.typing import ColorType, NodeId, Rule
from gamms.typing.game import OWNERS, TEAMS
from gamms.visual.drawers.rules import TERRITORIES, TerritoryDrawer, as_text

__all__ = ["by_distance", "halves", "published"]

_AXES = ("x", "y")

Territory = Mapping[int, Any]  # node id -> team, or a role as a mapping
Bases = Annotated[Mapping[Any, NodeId | Iterable[NodeId]] | Iterable[tuple[Any, NodeId | Iterable[NodeId]]], OWNERS]
Colors = Mapping[Any, ColorType]  # team -> color


def by_distance(ctx: Context, bases: Bases, weight: str | None = "length") -> dict[int, Any]:
    """Give every node to the team or role whose base is nearest by road, in the shorter direction.

    Args:
        ctx: the context.
        bases: team -> its base, one node or several; or a list of pairs of a team or role and its base.
        weight: cost of edges: "length", another attribute of the edges, or None for 1 per edge.

    Returns:
        node -> team or role; ties go to the first by text. Nodes without a path to any base are left out.

    Raises:
        UnknownName (KeyError), BadType, BadValue: a base is not on the map, an owner is neither a team nor a role, or
            the attribute does not exist.
    """
    graph = ctx.graph.graph
    nearest = dict[int, float]()
    owners = dict[int, Any]()
    for team, base in _list_bases(bases):
        several = base if isinstance(base, Iterable) and not isinstance(base, str) else [base]
        nodes = [as_node_id(node, f"The base of {shown(team)}", graph) for node in several]
        for distances in (graph.distances(source=nodes, weight=weight), graph.distances(target=nodes, weight=weight)):
            for node, metres in distances.items():
                if metres < nearest.get(node, inf):
                    nearest[node] = metres
                    owners[node] = team
    return {node: owners[node] for node in graph.get_nodes() if node in owners}


def _list_bases(bases: object) -> list[tuple[Any, object]]:
    """Return the owners and their bases, by the text of the owners."""
    pairs: object = list(bases.items()) if isinstance(bases, Mapping) else bases
    if not isinstance(pairs, (list, tuple)):
        raise BadType(f"bases must be a mapping from teams to nodes, or a list of pairs, not {shown(bases)}.")
    found = []
    for pair in pairs:
        if not isinstance(pair, (list, tuple)) or len(pair) != 2:
            raise BadType(f"bases has {shown(pair)}, which must be a pair of a team or role and its base.")
        found.append((as_team_or_role(pair[0], "The owner of a base"), pair[1]))
    return [(_as_owner(owner), base) for owner, base in sorted(found, key=lambda one: str(one[0]))]


def _as_owner(owner: object) -> Any:  # Any: a team, or the mapping of a role
    """Return a team, or a role as a plain mapping.

    Raises:
        BadType, BadValue, UnknownName (KeyError): a mapping is no role.
    """
    role = read_owner(owner)
    return role.as_plain() if isinstance(role, Role) else role


def halves(ctx: Context, axis: str = "x", teams: Annotated[Iterable[Any] | None, TEAMS] = None) -> dict[int, Any]:
    """Split the map across an axis into halves with nearly equal numbers of nodes.

    Args:
        ctx: the context.
        axis: "x" for a western and an eastern half, "y" for a southern and a northern half.
        teams: owner of the half with the smaller coordinates, then of the other half, teams or roles; None: the two
            teams of the game, ordered by their text.

    Returns:
        node -> team or role; nodes on the dividing line belong to the second one.

    Raises:
        BadType, BadValue, UnknownName (KeyError): the axis does not exist, there are not two owners, or a mapping is no
            role.
    """
    column = _AXES.index(as_choice(axis, "axis", _AXES))
    sides = [team for team in ctx.agent.teams if team is not None] if teams is None else [*map(_as_owner, teams)]
    if len(sides) != 2:
        raise BadValue(f"A map has two halves, but the teams are {sides}. Give halves(…, teams=(west, east)).")
    columns = ctx.graph.columns()
    along = columns.xy[:, column]
    if len(along) == 0:
        return {}
    is_beyond = (along >= np.median(along)).tolist()
    return {node: sides[beyond] for node, beyond in zip(columns.node_ids.tolist(), is_beyond, strict=True)}


@show_as_call
def published(nodes: Territory, name: str = "territory", colors: Colors | None = None) -> Rule:
    """Make a rule that publishes a territory to all strategies, and draws it.

    Args:
        nodes: node -> team, or role.
        name: name of the fact: `state["facts"][name]`; other rules use it with `territory=name`.
        colors: team -> color; None: the colors of the agents if none are declared elsewhere.

    Raises:
        BadType, BadValue, UnknownName (KeyError): the territory is no mapping from nodes to teams and roles.
    """
    territory = _check_territory(nodes)
    roles = find_roles(territory.values())
    fact = as_name(name, "a fact")
    owned = _pack_territory(territory)

    def prepare(ctx: Context) -> None:
        ctx.game.publish(**{fact: territory})
        ctx.game.data.setdefault(TERRITORIES, {})[fact] = owned

    def published(ctx: Context) -> None:
        if fact not in ctx.game.facts:  # the rule was not added, but called by another rule
            prepare(ctx)

    core_form = in_core("published", fact, territory)
    return declared(
        published,
        RuleSpec(
            prepare=prepare,
            teams=roles,
            owners=list(owned),
            drawer=TerritoryDrawer(fact, colors),
            disclose=disclose_to_all(TERRITORIES, fact),
            core_form=core_form,
        ),
    )


class TerritorySource(NamedTuple):
    """The territory passed to a rule: a mapping, or the name of a fact with a mapping."""

    given: Territory | str

    @property
    def roles(self) -> list[Role]:
        """The roles that own nodes of a territory that is no fact."""
        return [] if isinstance(self.given, str) else find_roles(self.given.values())

    def get_owners(self, facts: Mapping[str, Any]) -> Territory:
        """Return node -> team, or role.

        Raises:
            UnknownName (KeyError): the fact does not exist.
        """
        if not isinstance(self.given, str):
            return self.given
        as_known(self.given, "fact", facts)
        return cast("Territory", facts[self.given])

    def number_owners(
        self, facts: Mapping[str, Any], teams: Sequence[Hashable]
    ) -> tuple[list[int], list[int], list[Role]]:
        """Return the ids of the nodes with owners, the numbers of these, as in `core.rules.Territory`, and the roles.

        Nodes of teams without agents are left out.
        """
        owners = {node: read_owner(owner) for node, owner in self.get_owners(facts).items()}
        roles = [*dict.fromkeys(one for one in owners.values() if isinstance(one, Role))]
        number_of: dict[Hashable, int] = {team: number for number, team in enumerate(teams)}
        number_of |= {role: -2 - number for number, role in enumerate(roles)}
        nodes = [node for node, owner in owners.items() if owner in number_of]
        return nodes, [number_of[owners[node]] for node in nodes], roles


def as_territory(territory: object) -> TerritorySource | None:
    """Check a territory passed to a rule; None for no territory.

    Raises:
        BadType, BadValue, UnknownName (KeyError): neither a mapping from nodes to owners nor the name of a fact.
    """
    if territory is None:
        return None
    return TerritorySource(territory if isinstance(territory, str) else _check_territory(territory))


def list_fact_names(grounds: Iterable[TerritorySource | None]) -> list[str]:
    """Return the names of the facts that are territories of rules."""
    return [one.given for one in grounds if one is not None and isinstance(one.given, str)]


def list_owners(source: TerritorySource | None) -> list[Hashable]:
    """Return the teams of the owners in a territory that is given as a mapping, each once; else none."""
    if source is None or isinstance(source.given, str):
        return []
    return [*dict.fromkeys(get_team(read_owner(owner)) for owner in source.given.values())]


def list_roles(source: TerritorySource | None) -> list[Role]:
    """Return the roles that own nodes of a territory that is given as a mapping; none for other territories."""
    return [] if source is None else source.roles


def _check_territory(territory: object) -> dict[int, Any]:
    if not isinstance(territory, Mapping):
        raise BadType(
            "A territory must be a mapping from nodes to teams, or the name of a published one, "
            f"not {shown(territory)}."
        )
    return {as_node_id(node, "A node of a territory"): _as_owner(owner) for node, owner in territory.items()}


def _pack_territory(territory: Territory) -> dict[Hashable, str]:
    """Return the node ids of each team and of its roles, as text."""
    owned: dict[Hashable, list[int]] = {}
    for node, owner in territory.items():
        team = get_team(read_owner(owner))
        if team is not None:
            owned.setdefault(team, []).append(node)
    return {team: as_text(np.array(sorted(nodes), np.int64)) for team, nodes in owned.items()}
