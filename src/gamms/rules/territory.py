"""Territories: mappings from nodes to the teams that own them, published by a game as facts."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from math import inf
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from gamms.arguments import as_choice, as_known, as_name, shown_as_called
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.game.movement.streets import StreetGraph
from gamms.game.settings import RuleSpec, declared
from gamms.ir.graph import IntArray, as_node_id
from gamms.plain import ANYTHING, ID, NAME, Shape, at, dict_of
from gamms.rules.endings import all_know
from gamms.rules.in_core import in_core
from gamms.text import shown
from gamms.typing import ColorType, NodeId, Rule
from gamms.typing.game import OWNERS, TEAMS
from gamms.visual.drawers.rules import TERRITORIES, TerritoryDrawer, as_text

__all__ = ["by_distance", "halves", "published"]

_AXES = ("x", "y")

Territory = Mapping[int, Hashable]  # node id -> team
Colors = Mapping[Any, ColorType]  # team -> color


def by_distance(
    ctx: Context, bases: Annotated[Mapping[Any, NodeId | Iterable[NodeId]], OWNERS], weight: str | None = "length"
) -> dict[int, Hashable]:
    """Give every node to the team whose base is nearest by road, in the shorter direction.

    Args:
        ctx: the context.
        bases: team -> its base, one node or several.
        weight: cost of edges: "length", another attribute of the edges, or None for 1 per edge.

    Returns:
        node -> team; ties go to the first team by text. Nodes without a path to any base are left out.

    Raises:
        UnknownName (KeyError), BadType: a base is not on the map, or the attribute does not exist.
    """
    if not isinstance(bases, Mapping):
        raise BadType(f"bases must be a mapping from teams to nodes, not {shown(bases)}.")
    graph = ctx.graph.graph
    nearest = dict[int, float]()
    owners = dict[int, Hashable]()
    for team in sorted(bases, key=str):
        base: object = bases[team]
        several = base if isinstance(base, Iterable) and not isinstance(base, str) else [base]
        nodes = [as_node_id(node, f"The base of {shown(team)}", graph) for node in several]
        for distances in (graph.distances(source=nodes, weight=weight), graph.distances(target=nodes, weight=weight)):
            for node, metres in distances.items():
                if metres < nearest.get(node, inf):
                    nearest[node] = metres
                    owners[node] = team
    return {node: owners[node] for node in graph.get_nodes() if node in owners}


def halves(
    ctx: Context, axis: str = "x", teams: Annotated[Iterable[Hashable] | None, TEAMS] = None
) -> dict[int, Hashable]:
    """Split the map across an axis into halves with nearly equal numbers of nodes.

    Args:
        ctx: the context.
        axis: "x" for a western and an eastern half, "y" for a southern and a northern half.
        teams: owner of the half with the smaller coordinates, then of the other half; None: the two teams of the game,
            ordered by their text.

    Returns:
        node -> team; nodes on the dividing line belong to the second team.

    Raises:
        BadValue: the axis does not exist, or there are not two teams.
    """
    column = _AXES.index(as_choice(axis, "axis", _AXES))
    sides = [team for team in ctx.agent.teams if team is not None] if teams is None else list(teams)
    if len(sides) != 2:
        raise BadValue(f"A map has two halves, but the teams are {sides}. Give halves(…, teams=(west, east)).")
    columns = ctx.graph.columns()
    along = columns.xy[:, column]
    if len(along) == 0:
        return {}
    is_beyond = (along >= np.median(along)).tolist()
    return {node: sides[beyond] for node, beyond in zip(columns.node_ids.tolist(), is_beyond, strict=True)}


@shown_as_called
def published(nodes: Territory, name: str = "territory", colors: Colors | None = None) -> Rule:
    """Make a rule that publishes a territory to all strategies, and draws it.

    Args:
        nodes: node -> team.
        name: name of the fact: `state["facts"][name]`; other rules use it with `territory=name`.
        colors: team -> color; None: the colors of the agents if none are declared elsewhere.
    """
    territory = _checked(nodes)
    fact = as_name(name, "a fact")
    owned = _packed(territory)

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
            owners=list(owned),
            drawer=TerritoryDrawer(fact, colors),
            disclose=all_know(TERRITORIES, fact),
            keeps=at((TERRITORIES,), dict_of(NAME, ANYTHING)),
            core_form=core_form,
        ),
    )


class TerritorySource(NamedTuple):
    """The territory passed to a rule: a mapping, or the name of a fact with a mapping."""

    given: Territory | str

    def of(self, facts: Mapping[str, Any]) -> Territory:
        """Return node -> team.

        Raises:
            UnknownName (KeyError): the fact does not exist.
        """
        if not isinstance(self.given, str):
            return self.given
        as_known(self.given, "fact", facts)
        return cast("Territory", facts[self.given])

    def rows(self, facts: Mapping[str, Any], streets: StreetGraph, teams: Sequence[Hashable]) -> IntArray:
        """Return the number of the team that owns each node, (nodes,); -1 for nodes of other teams."""
        owners = self.of(facts)
        numbers = np.full(streets.num_nodes, -1)
        for row, node in enumerate(streets.columns.node_ids.tolist()):
            if node in owners and owners[node] in teams:
                numbers[row] = teams.index(owners[node])
        return numbers


def as_territory(territory: object) -> TerritorySource | None:
    """Check a territory passed to a rule; None for no territory.

    Raises:
        BadType: neither a mapping from nodes to teams nor the name of a fact.
    """
    if territory is None:
        return None
    return TerritorySource(territory if isinstance(territory, str) else _checked(territory))


def shapes_of_grounds(grounds: Iterable[TerritorySource | None]) -> dict[str, Shape]:
    """Return the shapes of the facts that are territories of rules, by name."""
    return {one.given: _OWNERS for one in grounds if one is not None and isinstance(one.given, str)}


_OWNERS = dict_of(ID, NAME)


def owners_of(source: TerritorySource | None) -> list[Hashable]:
    """Return the owners in a territory that is given as a mapping, each once; none for other territories."""
    return [] if source is None or isinstance(source.given, str) else [*dict.fromkeys(source.given.values())]


def _checked(territory: object) -> dict[int, Hashable]:
    if not isinstance(territory, Mapping):
        raise BadType(
            "A territory must be a mapping from nodes to teams, or the name of a published one, "
            f"not {shown(territory)}."
        )
    return {as_node_id(node, "A node of a territory"): team for node, team in territory.items()}


def _packed(territory: Mapping[int, Hashable]) -> dict[Hashable, str]:
    """Return the node ids of each team, as text."""
    owned: dict[Hashable, list[int]] = {}
    for node, team in territory.items():
        if team is not None:
            owned.setdefault(team, []).append(node)
    return {team: as_text(np.array(sorted(nodes), np.int64)) for team, nodes in owned.items()}
