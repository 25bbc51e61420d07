"""What decides for whole teams: plans, and the arrays that some of them get."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.arguments import as_bool, as_function_of, as_key
from gamms.errors import BadType, BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.kernels.draws import BitArray
from gamms.readonly import ReadOnlyMapping
from gamms.text import shown
from gamms.typing.game import TeamPlan


class Plan(NamedTuple):
    """What decides for all living agents of a team."""

    function: "TeamPlan | ArrayPlan"
    arrays: bool = False  # whether it takes arrays and returns nodes


def as_plans(name: str, value: object) -> Mapping[Any, Plan]:
    """Return a read-only mapping from teams to plans; a function stands for a plan of states.

    Raises:
        BadType: it is no mapping, or one of them cannot be called with one argument.
    """
    if not isinstance(value, Mapping):
        raise BadType(f"ctx.game.{name} must be a dict of teams and plans, not {shown(value)}.")
    return ReadOnlyMapping({as_key(team, "A team"): _as_plan(plan) for team, plan in value.items()})


def _as_plan(value: object) -> Plan:
    function, arrays = value if isinstance(value, Plan) else (value, False)
    arrays = as_bool(arrays, "arrays")
    return Plan(as_function_of(function, "A plan", f"the {'arrays' if arrays else 'states'} of its team"), arrays)


@lru_cache(maxsize=64)
def _keys_of(names: tuple[str, ...]) -> BitArray:
    return kernels.name_keys(names)


class TeamDraws:
    """The keyed draws of several agents: each call gives one number for each agent, (agents,).

    They are those that the agents get from their `state["draw"]` in the same turn, call by call.

    Args:
        seed: of the game.
        names: of the agents.
        turn: the number of turns that were played.
    """

    def __init__(self, seed: int, names: tuple[str, ...], turn: int) -> None:
        self._purpose, self._names, self._turn = kernels.purpose_key(seed, "agent"), names, turn
        self._keys: BitArray | None = None
        self._count = 0

    def bits(self) -> BitArray:
        """Return 64 random bits for each agent."""
        if self._keys is None:
            self._keys = _keys_of(self._names)
        self._count += 1
        return kernels.draw_bits_many(self._purpose, self._keys, self._turn, self._count - 1)

    def random(self) -> FloatArray:
        """Return a number in [0, 1) for each agent."""
        return kernels.fraction_many(self.bits())

    def below(self, n: IntArray | int) -> IntArray:
        """Return an integer from 0 to `n - 1` for each agent; `n` is one number, or one for each agent.

        Raises:
            BadValue: one of `n` is not between 1 and 2 ** 32.
        """
        bounds = np.asarray(n)
        if bounds.size and not (bounds.min() >= 1 and bounds.max() <= 1 << 32):
            raise BadValue(f"draw.below(n) needs 1 <= n <= 2 ** 32, not {shown(n)}.")
        return kernels.below_many(self.bits(), bounds)


class TeamArrays:
    """What a plan of arrays gets: the living agents of its team in the order of their names; arrays are read-only.

    Attributes:
        team: the team.
        turn: the number of turns that were played before this one.
        names: of the agents.
        nodes: (agents,) ids of the nodes they are on.
        offsets, targets: (agents + 1,), (legal,): agent `i` may go to `targets[offsets[i]:offsets[i + 1]]`, its own
            node first; None where every node of the graph is legal.
        facts: what was published; read-only.
        team_memory: a copy of what the team remembers; what is written into it counts from the next turn on.
        draw: random numbers, one for each agent.
    """

    def __init__(
        self,
        team: Hashable,
        turn: int,
        seed: int,
        names: tuple[str, ...],
        nodes: list[int],
        legal: Sequence[Sequence[int]] | None,
        facts: Mapping[str, Any],
        team_memory: dict[Any, Any],
    ) -> None:
        self.team: Any = team  # programs look it up in dicts of their own
        self.turn, self.names = turn, names
        self.nodes: IntArray = np.array(nodes, np.int64)
        self.nodes.setflags(write=False)
        self.offsets: IntArray | None = None
        self.targets: IntArray | None = None
        if legal is not None:
            self.offsets, self.targets = _as_rows(legal)
        self.facts, self.team_memory = facts, team_memory
        self.draw = TeamDraws(seed, names, turn)
        self._seed = seed

    @cached_property
    def rng(self) -> np.random.Generator:
        """A NumPy generator of the team and the turn."""
        return kernels.stream(self._seed, "team", str(self.team), self.turn)

    def checked(self, answer: object) -> IntArray:
        """Return the nodes that a plan has chosen, (agents,), as integers.

        Raises:
            BadType: they are no integers.
            BadValue: there are more or fewer than agents.
        """
        try:
            nodes = np.asarray(answer)
        except ValueError:  # rows of several lengths
            nodes = np.asarray(None)
        if nodes.dtype.kind not in "iu" and nodes.size:
            raise BadType(f"A plan of arrays returns the ids of {len(self.names)} nodes, not {shown(answer)}.")
        if nodes.shape != self.nodes.shape:
            raise BadValue(
                f"A plan of arrays returns one node for each agent, an array ({len(self.names)},), "
                f"not one of the shape {nodes.shape}."
            )
        return nodes.astype(np.int64, copy=False)

    def is_legal(self, nodes: IntArray) -> "np.ndarray[Any, np.dtype[np.bool_]]":
        """Return which of these nodes are known to be legal, (agents,)."""
        if self.offsets is None:
            return np.zeros(len(nodes), np.bool_)
        matches = self.targets == np.repeat(nodes, np.diff(self.offsets))
        found: np.ndarray[Any, np.dtype[np.bool_]] = np.logical_or.reduceat(matches, self.offsets[:-1])
        return found


ArrayPlan = Callable[[TeamArrays], Any]
"""Decides for a team in arrays: it returns the ids of nodes (agents,).

Any: all that NumPy makes such an array of, and an awaitable of it.
"""


def _as_rows(rows: Sequence[Sequence[int]]) -> tuple[IntArray, IntArray]:
    """Return rows of ids as read-only offsets (rows + 1,) and ids."""
    offsets = np.zeros(len(rows) + 1, np.int64)
    np.cumsum(list(map(len, rows)), out=offsets[1:])
    ids = np.fromiter(chain.from_iterable(rows), np.int64, int(offsets[-1]))
    for array in (offsets, ids):
        array.setflags(write=False)
    return offsets, ids
