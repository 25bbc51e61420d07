"""Whose ground a node is: territories are data, a mapping from nodes to teams that a game publishes as a fact."""

from collections.abc import Callable, Iterable, Mapping
from math import inf
from typing import Any

import numpy as np

from gamms.arguments import as_int, as_name
from gamms.errors import BadType, BadValue, UnknownName
from gamms.rules.drawing import equipped, packed
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.game import Rule
from gamms.visual.drawers.rules import TERRITORIES, TerritoryDrawer

__all__ = ["by_distance", "halves", "published"]

_AXES = ("x", "y")


def by_distance(
    ctx: IContext, bases: Mapping[Any, int | Iterable[int]], weight: str | None = "length"
) -> dict[int, Any]:
    """Give every node to the team whose base is nearest by road, there or back, whichever is shorter.

    Args:
        ctx: the context.
        bases: team -> its node, or several.
        weight: what is short: "length", another attribute of the edges, or None for their number.

    Returns:
        node -> team; of teams equally near the first by text has it. A node that no way joins to any base is
        nobody's and left out.

    Raises:
        UnknownName (KeyError), BadType: a base is no node of the map, or there is no such attribute.
    """
    if not isinstance(bases, Mapping):
        raise BadType(f"bases must be a mapping from teams to nodes, not {shown(bases)}.")
    graph, nearest, whose = ctx.graph.graph, dict[int, float](), dict[int, Any]()
    for team in sorted(bases, key=str):
        base: Any = bases[team]
        nodes = [
            as_int(node, f"The base of {shown(team)}") for node in (base if isinstance(base, Iterable) else [base])
        ]
        for ways in (graph.distances(source=nodes, weight=weight), graph.distances(target=nodes, weight=weight)):
            for node, metres in ways.items():
                if metres < nearest.get(node, inf):
                    nearest[node], whose[node] = metres, team
    return {node: whose[node] for node in graph.get_nodes() if node in whose}


def halves(ctx: IContext, axis: str = "x", teams: Iterable[Any] | None = None) -> dict[int, Any]:
    """Split the map across an axis, with as many nodes on either side as can be.

    Args:
        ctx: the context.
        axis: "x" for a half to the west and one to the east, "y" for one to the south and one to the north.
        teams: whose the half with the smaller coordinates is, and whose the other; None: the two teams that there
            are, the first by text to begin with.

    Returns:
        node -> team; nodes on the dividing line are the second team's.

    Raises:
        BadValue: there is no such axis, or there are not two teams.
    """
    if axis not in _AXES:
        raise BadValue(f"axis must be 'x' or 'y', not {shown(axis)}.")
    agents: Any = ctx.agent  # our own, which knows of teams
    sides = [team for team in agents.teams if team is not None] if teams is None else list(teams)
    if len(sides) != 2:
        raise BadValue(f"A map has two halves, and teams are {sides}. Give halves(…, teams=(west, east)).")
    columns = ctx.graph.columns()
    along = columns.xy[:, _AXES.index(axis)]
    if len(along) == 0:
        return {}
    is_beyond = (along >= np.median(along)).tolist()
    return {node: sides[beyond] for node, beyond in zip(columns.node_ids.tolist(), is_beyond, strict=True)}


def published(nodes: Mapping[int, Any], name: str = "territory", colors: Mapping[Any, Any] | None = None) -> Rule:
    """A rule that does nothing but tell every strategy whose ground is whose, and draw it.

    Args:
        nodes: node -> team.
        name: of the fact: `state["facts"][name]`; other rules take it as `territory=name`.
        colors: team -> colour; None: those of the agents where nothing else is declared.
    """
    territory, fact = _checked(nodes), as_name(name, "a fact")
    owned = packed(territory)

    def prepare(ctx: Any) -> None:
        ctx.game.publish(**{fact: territory})
        ctx.game.data.setdefault(TERRITORIES, {})[fact] = owned

    def published(ctx: Any) -> None:
        if fact not in ctx.game.facts:  # it was not added, but is called by another rule
            prepare(ctx)

    return equipped(published, prepare=prepare, drawer=TerritoryDrawer(fact, colors))


def as_territory(territory: Any) -> Callable[[Any], Mapping[int, Any]] | None:
    """What a rule was given, as a function of the context; None for none.

    Raises:
        BadType: it is neither a mapping from nodes to teams nor the name of a fact.
    """
    if territory is None:
        return None
    if isinstance(territory, str):
        return lambda ctx: _published_as(ctx, territory)
    known = _checked(territory)
    return lambda _: known


def _published_as(ctx: Any, name: str) -> Mapping[int, Any]:
    facts = ctx.game.facts
    if name not in facts:
        raise UnknownName("fact", name, facts)
    territory: Mapping[int, Any] = facts[name]
    return territory


def _checked(territory: Any) -> dict[int, Any]:
    if not isinstance(territory, Mapping):
        raise BadType(
            "A territory must be a mapping from nodes to teams, or the name of a published one, "
            f"not {shown(territory)}."
        )
    return {as_int(node, "A node of a territory"): team for node, team in territory.items()}
