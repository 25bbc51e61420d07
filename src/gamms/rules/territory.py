"""Territories: which team owns a node. They are data, a mapping from nodes to teams that a game publishes as a fact."""

from array import array
from collections.abc import Hashable, Iterable, Mapping, Sequence
from math import inf
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from gamms.arguments import as_choice, as_int, as_known, as_name
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.game.settings import RuleSpec, declared
from gamms.game.streets import Streets
from gamms.ir.graph import IntArray
from gamms.rules.endings import all_know
from gamms.rules.in_core import in_core
from gamms.rules.meetings import InTurn
from gamms.text import shown, shown_as_called
from gamms.typing import ColorType, NodeId, Rule
from gamms.typing.game import OWNERS, TEAMS
from gamms.visual.drawers.rules import TERRITORIES, TerritoryDrawer, as_text

__all__ = ["by_distance", "halves", "published"]

_AXES = ("x", "y")

Territory = Mapping[int, Hashable]  # node id -> team
NO_TERRITORY = memoryview(array("q"))  # to the core
Colors = Mapping[Any, ColorType]  # team -> colour


def by_distance(
    ctx: Context, bases: Annotated[Mapping[Any, NodeId | Iterable[NodeId]], OWNERS], weight: str | None = "length"
) -> dict[int, Hashable]:
    """Give every node to the team whose base is nearest by road, there or back, whichever is shorter.

    Args:
        ctx: the context.
        bases: team -> its node, or several.
        weight: what a path costs: "length", another attribute of the edges, or None for their number.

    Returns:
        node -> team; of teams equally near the first by text has it. A node that no path joins to any base is left
        out.

    Raises:
        UnknownName (KeyError), BadType: a base is not a node of the map, or there is no such attribute.
    """
    if not isinstance(bases, Mapping):
        raise BadType(f"bases must be a mapping from teams to nodes, not {shown(bases)}.")
    graph, nearest, owners = ctx.graph.graph, dict[int, float](), dict[int, Hashable]()
    for team in sorted(bases, key=str):
        base = bases[team]
        several = base if isinstance(base, Iterable) else [base]
        nodes = [as_int(node, f"The base of {shown(team)}") for node in several]
        for distances in (graph.distances(source=nodes, weight=weight), graph.distances(target=nodes, weight=weight)):
            for node, metres in distances.items():
                if metres < nearest.get(node, inf):
                    nearest[node], owners[node] = metres, team
    return {node: owners[node] for node in graph.get_nodes() if node in owners}


def halves(
    ctx: Context, axis: str = "x", teams: Annotated[Iterable[Hashable] | None, TEAMS] = None
) -> dict[int, Hashable]:
    """Split the map across an axis, with as nearly as many nodes on either side.

    Args:
        ctx: the context.
        axis: "x" for a half to the west and one to the east, "y" for one to the south and one to the north.
        teams: the owner of the half with the smaller coordinates, then of the other; None: the two teams that there
            are, in the order of their text.

    Returns:
        node -> team; nodes on the dividing line are the second team's.

    Raises:
        BadValue: there is no such axis, or there are not two teams.
    """
    column = _AXES.index(as_choice(axis, "axis", _AXES))
    sides = [team for team in ctx.agent.teams if team is not None] if teams is None else list(teams)
    if len(sides) != 2:
        raise BadValue(f"A map has two halves, and teams are {sides}. Give halves(…, teams=(west, east)).")
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
        name: of the fact: `state["facts"][name]`; other rules take it as `territory=name`.
        colors: team -> colour; None: those of the agents where nothing else is declared.
    """
    territory, fact = _checked(nodes), as_name(name, "a fact")
    owned = _packed(territory)

    def prepare(ctx: Context) -> None:
        ctx.game.publish(**{fact: territory})
        ctx.game.data.setdefault(TERRITORIES, {})[fact] = owned

    def published(ctx: Context) -> None:
        if fact not in ctx.game.facts:  # it was not added, but is called by another rule
            prepare(ctx)

    core_form = in_core("published", fact, territory)
    return declared(
        published,
        RuleSpec(
            prepare=prepare,
            drawer=TerritoryDrawer(fact, colors),
            disclose=all_know(TERRITORIES, fact),
            core_form=core_form,
        ),
    )


class Ground(NamedTuple):
    """A territory that a rule was given: the mapping, or the name of the fact that has it."""

    given: Territory | str

    def of(self, facts: Mapping[str, Any]) -> Territory:
        """Return node -> team.

        Raises:
            UnknownName (KeyError): there is no such fact.
        """
        if not isinstance(self.given, str):
            return self.given
        as_known(self.given, "fact", facts)
        return cast("Territory", facts[self.given])

    def in_turn(self, ctx: Context, turn: InTurn) -> Any:
        """Return the numbers of the teams of a turn that own nodes, (nodes,); -1 for a node of no team that plays."""
        owners = self.of(ctx.game.facts) if isinstance(self.given, str) else self.given
        return turn.roster.owners(owners, turn.numbers)

    def rows(self, facts: Mapping[str, Any], streets: Streets, teams: Sequence[Hashable]) -> IntArray:
        """Return the numbers of the teams that own nodes, (nodes,); -1 for a node of no team that plays."""
        owners = self.of(facts)
        numbers = np.full(streets.num_nodes, -1)
        for row, node in enumerate(streets.columns.node_ids.tolist()):
            if node in owners and owners[node] in teams:
                numbers[row] = teams.index(owners[node])
        return numbers


def as_territory(territory: object) -> Ground | None:
    """Return what a rule was given; None for none.

    Raises:
        BadType: it is neither a mapping from nodes to teams nor the name of a fact.
    """
    if territory is None:
        return None
    return Ground(territory if isinstance(territory, str) else _checked(territory))


def _checked(territory: object) -> dict[int, Hashable]:
    if not isinstance(territory, Mapping):
        raise BadType(
            "A territory must be a mapping from nodes to teams, or the name of a published one, "
            f"not {shown(territory)}."
        )
    return {as_int(node, "A node of a territory"): team for node, team in territory.items()}


def _packed(territory: Mapping[int, Hashable]) -> dict[Hashable, str]:
    """Return the ids of each team's nodes, as text."""
    owned: dict[Hashable, list[int]] = {}
    for node, team in territory.items():
        if team is not None:
            owned.setdefault(team, []).append(node)
    return {team: as_text(np.array(sorted(nodes), np.int64)) for team, nodes in owned.items()}
