"""Who plays in a batch, and where: the agents of each game, and the streets that all games share."""

from collections.abc import Collection, Hashable, Iterable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from gamms import kernels
from gamms.errors import UnknownName
from gamms.game.result import Result
from gamms.game.settings import NamedRule, Plan
from gamms.game.snapshots import GameInternals, Snapshot
from gamms.ir.graph import GraphColumns, IntArray
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.routes import RouteQueries

BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


class PlayedGame(Protocol):
    """The game of a context, as a batch plays it: what `gamms.game.Game` has."""

    ctx: Any  # its own class, which knows this one
    turn: int
    plans: Mapping[Any, Plan]

    @property
    def agents(self) -> list[IAgent]:
        """The living agents."""

    @property
    def rules(self) -> tuple[NamedRule, ...]:
        """In the order in which they are applied."""

    @property
    def facts(self) -> Mapping[str, Any]:
        """What was published."""

    @property
    def scores(self) -> Mapping[Any, float]:
        """By team."""

    @property
    def over(self) -> dict[str, Any] | None:
        """How it has ended."""

    @property
    def internals(self) -> GameInternals:
        """What engines do with it."""

    def settings(self) -> dict[str, Any]:
        """Return all settings."""

    def reset(self, seed: int | None = None) -> None:
        """Begin the game again."""

    def step(self) -> bool:
        """Play one turn."""

    def run(self, max_turns: int | None = None) -> Result:
        """Play turns."""

    def result(self) -> Result:
        """Return the result so far."""

    def snapshot(self) -> Snapshot:
        """Return the game as it is now."""

    def restore(self, snapshot: Snapshot) -> None:
        """Restore a snapshot."""


class Streets:
    """The nodes of a graph, and where an agent may go from each along one edge.

    Attributes:
        columns: of the graph.
        queries: `ctx.graph.routes`.
        counts: (nodes,) how many nodes are legal from each, its own included.
        offsets: (nodes,) where those of each node begin in `targets`.
        targets: rows of nodes; of each node its own first, then its neighbours in the order of `state["legal"]`.
    """

    def __init__(self, columns: GraphColumns, queries: RouteQueries) -> None:
        self.columns, self.queries = columns, queries
        self.offsets, self.targets = kernels.neighborhoods(columns.sources, columns.targets, len(columns.node_ids))
        self.counts: IntArray = np.diff(self.offsets)
        self.offsets = self.offsets[:-1]
        self._ids_are_rows = bool((columns.node_ids == np.arange(len(columns.node_ids))).all())
        self._order = None if self._ids_are_rows else np.argsort(columns.node_ids, kind="stable")
        self._padded: IntArray | None = None

    def ids(self, rows: IntArray) -> IntArray:
        """Return the ids of nodes."""
        return rows if self._ids_are_rows else self.columns.node_ids[rows]

    def rows(self, ids: Any) -> IntArray:
        """Return the rows of nodes.

        Raises:
            UnknownName (KeyError): one is not on the map.
        """
        wanted, known = np.asarray(ids, np.int64), self.columns.node_ids
        if self._order is None:
            found = np.clip(wanted, 0, max(0, len(known) - 1))
        else:
            places = np.searchsorted(known, wanted, sorter=self._order)
            found = self._order[np.minimum(places, len(known) - 1)]
        missing = wanted[known[found] != wanted] if len(known) else wanted
        if missing.size:
            raise UnknownName("node", int(missing.flat[0]))
        return found

    @property
    def legal(self) -> IntArray:
        """The rows of the legal nodes of each node, (nodes, most), behind the last one its own again."""
        if self._padded is None:
            most = int(self.counts.max(initial=1))
            columns = np.minimum(np.arange(most), self.counts[:, None] - 1)
            padded = self.targets[self.offsets[:, None] + columns]
            self._padded = np.where(np.arange(most) < self.counts[:, None], padded, np.arange(len(padded))[:, None])
        return self._padded

    def step(self, rows: IntArray, actions: IntArray) -> IntArray:
        """Return where actions lead, each the number of a legal node."""
        found: IntArray = self.targets[self.offsets[rows] + actions]
        return found

    def action_to(self, rows: IntArray, targets: IntArray) -> IntArray:
        """Return the number of a legal node, by rows; -1 where it is not legal."""
        matches = self.legal[rows] == targets[..., None]
        matches &= np.arange(matches.shape[-1]) < self.counts[rows][..., None]
        return np.where(matches.any(axis=-1), matches.argmax(axis=-1), -1)


class Roster(NamedTuple):
    """The agents of every game of a batch, in the order of their names.

    Attributes:
        names: of the agents, (agents,).
        teams: the teams that agents play for, in the order of their first agents.
        team_of: (agents,) the number of the team of each.
        keys: (agents,) the hashes of the names, for keyed draws.
        agents: of the context that the batch was made from: what does not change, such as their sensors.
    """

    names: tuple[str, ...]
    teams: tuple[Hashable, ...]
    team_of: IntArray
    keys: BitArray
    agents: tuple[IAgent, ...]

    @classmethod
    def of(cls, agents: Iterable[IAgent]) -> "Roster":
        """Return the roster of some agents."""
        ordered = sorted(agents, key=lambda agent: agent.name)
        teams = tuple(dict.fromkeys(agent.team for agent in ordered))
        number = {team: i for i, team in enumerate(teams)}
        names = tuple(agent.name for agent in ordered)
        team_of = np.array([number[agent.team] for agent in ordered], np.int64)
        return cls(names, teams, team_of, kernels.name_keys(names), tuple(ordered))

    def members(self, team: Hashable) -> IntArray:
        """Return the numbers of the agents of a team, ascending.

        Raises:
            UnknownName (KeyError): no agent plays for it.
        """
        if team not in self.teams:
            raise UnknownName("team", team, self.teams)
        return np.flatnonzero(self.team_of == self.teams.index(team))

    def plays_for(self, teams: Collection[Hashable] | None) -> BoolArray:
        """Return which agents are of one of these teams, which need not have agents, (agents,); None: all."""
        is_in = np.array([teams is None or team in teams for team in self.teams], np.bool_)
        found: BoolArray = is_in[self.team_of]
        return found

    def name(self, number: int) -> str:
        """Return the name of an agent; for messages."""
        return shown(self.names[number])
