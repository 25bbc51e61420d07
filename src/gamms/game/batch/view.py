"""What array forms of strategies get, and what a learner observes: the agents of a strategy in all games at once."""

from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any

import numpy as np

from gamms import kernels
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.columns import BoolArray
from gamms.game.batch.turn import Arrays, GameArrays
from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.draws import BitArray
from gamms.text import shown

ArrayStrategy = Callable[["ArrayView"], Any]
"""Returns the numbers of legal nodes, (games, agents), which NumPy makes an array of; see docs/batches.md."""

_KEYS = ("curr_pos", "legal", "mask", "name", "team", "turn", "draw", "facts")


class ViewDraws:
    """The keyed draws of the agents of a view: each call gives one number for each, (games, agents).

    They are those that the agents get from `state["draw"]` in the same turn of the same game, call by call.
    """

    def __init__(self, first: BitArray, turns: IntArray) -> None:
        self._of = first, turns
        self._keys: BitArray | None = None
        self._count = 0

    def bits(self) -> BitArray:
        """Return 64 random bits for each."""
        if self._keys is None:
            first, turns = self._of
            self._keys = kernels.later_key_rows(first, turns[:, None])
        self._count += 1
        return kernels.bits_at_rows(self._keys, self._count - 1)

    def random(self) -> FloatArray:
        """Return a number in [0, 1) for each."""
        return kernels.fraction_many(self.bits())

    def below(self, n: IntArray | int) -> IntArray:
        """Return an integer from 0 to `n - 1` for each; `n` is one number, or one for each.

        Raises:
            BadValue: one of `n` is not between 1 and 2 ** 32.
        """
        bounds = np.asarray(n)
        if bounds.size and not (bounds.min() >= 1 and bounds.max() <= 1 << 32):
            raise BadValue(f"view.draw.below(n) needs 1 <= n <= 2 ** 32, not {shown(n)}.")
        return kernels.below_many(self.bits(), bounds)


class ArrayView(Mapping[str, Any]):
    """The agents that one strategy decides for, in all games that are played: arrays (games, agents).

    It has the keys of `state` that have an array form: `view["curr_pos"]` are the ids of nodes, `view["legal"]` those
    of legal nodes (games, agents, most), behind the last one -1, `view["mask"]` which agents are alive; `name` and
    `team` are one for each agent, `turn` one for each game.

    Attributes:
        games: (games,) numbers in the batch.
        agents: (agents,) numbers in the roster: the names in their order.
        node: rows of nodes.
        mask: which agents are alive.
        counts: how many nodes are legal for each agent, its own included.
        turn: (games,) how many turns were played.
        draw: random numbers, one for each agent.
        streets: the graph.
    """

    def __init__(self, state: GameArrays, games: IntArray, agents: IntArray) -> None:
        self._state, self.games, self.agents = state, games, agents
        self.streets = state.streets
        rows = np.s_[:, agents] if len(games) == len(state) else np.ix_(games, agents)
        self.node: IntArray = state.node[rows]
        self.mask: BoolArray = state.alive[rows]
        self.turn = state.turn[games]
        self.counts: IntArray = self.streets.counts[self.node]
        self.draw = ViewDraws(state.draw_keys()[rows], self.turn)

    def __getitem__(self, key: str) -> Any:
        if key == "curr_pos":
            return self.streets.ids(self.node)
        if key == "legal":
            return self._legal()
        if key in ("mask", "turn", "draw"):
            return getattr(self, key)
        roster = self._state.roster
        if key == "name":
            return tuple(roster.names[number] for number in self.agents.tolist())
        if key == "team":
            return tuple(roster.teams[roster.team_of[number]] for number in self.agents.tolist())
        if key == "facts":
            return self._state.facts
        raise UnknownName("key of a view", key, _KEYS)

    def __iter__(self) -> Iterator[str]:
        return iter(_KEYS)

    def __len__(self) -> int:
        return len(_KEYS)

    def _legal(self) -> IntArray:
        padded = self.streets.legal[self.node]
        is_legal = np.arange(padded.shape[-1]) < self.counts[..., None]
        return np.where(is_legal, self.streets.ids(padded), -1)

    def action_to(self, nodes: Any) -> IntArray:
        """Return the actions that lead to these nodes, (games, agents); -1 where one is not legal.

        Raises:
            UnknownName (KeyError): one is not on the map.
        """
        return self.streets.action_to(self.node, self.streets.rows(np.broadcast_to(nodes, self.node.shape)))

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return what a strategy remembers of all games of the batch, at first what `make(games)` gives.

        Index its arrays with `games`.
        """
        return self._state.keep(key, make)

    def checked(self, given: object, by: str) -> IntArray:
        """Return actions as integers (games, agents), 0 for those that are not alive.

        Raises:
            BadType, BadValue: they are no integers, too many or too few, or one is not the number of a legal node.
        """
        actions = np.asarray(given)
        if actions.dtype.kind not in "iu" and actions.size:
            raise BadType(f"{by}: actions are the numbers of legal nodes, not {shown(given)}.")
        if actions.shape != self.node.shape:
            raise BadValue(
                f"{by}: there is one action for each game and agent, an array {self.node.shape}, "
                f"not one of the shape {actions.shape}."
            )
        chosen = np.where(self.mask, actions, 0)
        is_wrong = (chosen < 0) | (chosen >= self.counts)
        if is_wrong.any():
            game, agent = np.argwhere(is_wrong)[0]
            raise BadValue(
                f"{by}: action {chosen[game, agent]} of agent {self._state.roster.name(self.agents[agent])} in game "
                f"{self.games[game]}, turn {self.turn[game]}, is not the number of a legal node: it has "
                f"{self.counts[game, agent]}, numbered from 0."
            )
        return chosen
