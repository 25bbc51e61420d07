"""What portable forms of strategies get: the views, draws, streets and routes of a batch on a device."""

from collections.abc import Callable, Hashable
from typing import Any, NoReturn

import numpy as np

from gamms import kernels
from gamms.arguments import as_one_shape
from gamms.errors import BadValue
from gamms.game.batch.columns import Table, kept_in, some_rows
from gamms.game.batch.flows import Flows
from gamms.game.batch.libraries import ArrayLibrary, Tensor, refuse_no_actions
from gamms.game.batch.movement import Index, Places
from gamms.game.batch.reports import Lookout
from gamms.game.batch.roads import StreetsOfMaps, refuse_several_maps
from gamms.game.batch.routes import RouteTable, of_asked
from gamms.game.batch.sight import Seen, lookouts
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.batch.surroundings import SeenNodes
from gamms.game.batch.vectors import Vectors
from gamms.game.batch.view import ArrayView, on_ground
from gamms.game.random_streams import ViewDraws
from gamms.game.streets import Streets
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.text import shown
from gamms.typing.sensor_engine import ON_GROUND

ON_DEVICE = "on a device"  # the first part of keys of what is kept there
_ALL_AT_FIRST = 1 << 10  # nodes of a map whose routes are all computed when one is asked for


class DeviceStreets(Streets):
    """The streets of a map on a device: `counts`, `offsets`, `targets` and `legal` are arrays there."""

    def __init__(self, streets: Streets, library: ArrayLibrary) -> None:
        self.__dict__.update(vars(streets))
        self.host, self.library = streets, library
        put, ids = library.put, streets.columns.node_ids
        self.counts, self.offsets, self.targets = map(put, (streets.counts, streets.offsets, streets.targets))
        self._padded, self._row_ids = put(streets.legal), put(ids)
        self._sorted = put(np.argsort(ids, kind="stable"))
        self.x, self.y = map(put, streets.columns.xy.T)

    def ids_of(self, rows: Tensor) -> Tensor:
        """Return the ids of rows of nodes that are known to be such; nothing is read."""
        return self._row_ids[rows]

    def ids(self, rows: Tensor) -> Tensor:
        """Return the ids of nodes; as in `rows`, `step` and `action_to`, one number is read to check what is passed.

        Raises:
            BadType, BadValue: they are no rows of nodes.
        """
        if self._are_integers(rows) and self._holds(self._are_rows(rows)):
            return self.ids_of(rows)
        return self._by_host(self.host.ids, rows)

    def rows(self, ids: Any) -> Tensor:
        """Return the rows of nodes.

        Raises:
            BadType: they are no integers.
            UnknownName (KeyError): one is not on the map.
        """
        xp, nodes = self.library.xp, len(self.columns.node_ids)
        if self._are_integers(ids):
            known = self._row_ids[self._sorted]
            flat = xp.reshape(ids, (-1,)) + 0  # one after the other in memory, as PyTorch wants it
            places = xp.searchsorted(known, flat)
            found = self._sorted[xp.where(places < nodes, places, nodes - 1)]
            if self._holds(self._row_ids[found] == flat):
                return xp.reshape(found, ids.shape)
        return self._by_host(self.host.rows, ids)

    def counts_of(self, rows: Tensor) -> Tensor:
        """Return how many nodes are legal from each of some nodes."""
        return self.counts[rows]

    def step(self, rows: Tensor, actions: Tensor) -> Tensor:
        """Return where actions lead, each the number of a legal node.

        Raises:
            BadType, BadValue: they are no rows of nodes or no such numbers, or do not broadcast to one shape.
        """
        if self._are_integers(rows, actions):
            are_rows = self._are_rows(rows)
            counts = self.counts[self.library.xp.where(are_rows, rows, 0)]
            if self._holds(are_rows & (actions >= 0) & (actions < counts)):
                return self.ends_of(rows, actions)
        return self._by_host(self.host.step, rows, actions)

    def ends_of(self, rows: Tensor, actions: Tensor) -> Tensor:
        """Return what `step` does, of actions that are known to be legal; nothing is read."""
        return self.targets[self.offsets[rows] + actions]

    def action_to(self, rows: Tensor, targets: Tensor) -> Tensor:
        """Return the number of a legal node, by rows; -1 where it is not legal.

        Raises:
            BadType, BadValue: `rows` are no rows of nodes, or `targets` no integers.
        """
        if self._are_integers(rows, targets) and self._holds(self._are_rows(rows)):
            return self.numbers_of(rows, targets)
        return self._by_host(self.host.action_to, rows, targets)

    def numbers_of(self, rows: Tensor, targets: Tensor) -> Tensor:
        """Return what `action_to` does, of rows that are known to be such; nothing is read."""
        xp, first, counts = self.library.xp, self.offsets[rows], self.counts[rows]
        found = xp.full(rows.shape, -1, dtype=xp.int64, device=self.library.device)
        for number in reversed(range(self.legal.shape[1])):
            is_it = self.targets[first + xp.where(counts > number, number, counts - 1)] == targets
            found = xp.where(is_it & (counts > number), number, found)
        return found

    def _are_integers(self, *given: Tensor) -> bool:
        """Whether these are arrays of int64 of one shape on the device, as those of views are."""
        library = self.library
        if not all(library.is_own(one) and library.xp.isdtype(one.dtype, library.xp.int64) for one in given):
            return False
        return len({tuple(one.shape) for one in given}) == 1

    def _are_rows(self, rows: Tensor) -> Tensor:
        return (rows >= 0) & (rows < len(self.columns.node_ids))

    def _holds(self, are_right: Tensor) -> bool:
        """Read whether all are right."""
        self.library.num_reads += 1
        return bool(self.library.xp.all(are_right))

    def _by_host(self, ask: Callable[..., IntArray], *given: Tensor) -> Tensor:
        """Return what the streets of the host say of anything else, which refuse what is wrong by name."""
        library = self.library
        return library.put(ask(*(library.get(one) if library.is_own(one) else one for one in given)))


class DeviceStreetsOfMaps(StreetsOfMaps, DeviceStreets):
    """The nodes of maps that differ in the roads that are open, on a device."""

    def __init__(self, streets: DeviceStreets) -> None:
        super().__init__(streets)
        self.host = StreetsOfMaps(streets.host)


class DeviceDraws(ViewDraws):
    """The keyed draws of the agents of a view, as arrays on the device: bits are int64."""

    _later_keys, _bits_at = staticmethod(kernels.later_keys_signed), staticmethod(kernels.bits_at_signed)

    def __init__(self, first: Tensor, turns: Tensor, xp: Any) -> None:
        super().__init__(first, turns)
        self._xp = xp

    def bits_of(self, counted: Tensor) -> Tensor:
        """Return 64 random bits for each; the next ones are others for those that are counted."""
        return super().bits_of(counted if isinstance(counted, int) else self._xp.astype(counted, self._xp.int64))

    def random(self) -> Tensor:
        """Return a number in [0, 1) for each."""
        return kernels.fraction_signed(self.bits(), self._xp)

    def below(self, n: Tensor) -> Tensor:
        """Return an integer from 0 to `n - 1` for each; `n` is one number, or one for each, from 1 to 2 ** 32.

        Raises:
            BadValue: `n` is one number that is none of these; numbers on the device are not read.
        """
        if isinstance(n, int) and not 1 <= n <= 1 << 32:
            raise BadValue(f"draw.below(n) needs 1 <= n <= 2 ** 32, not {shown(n)}.")
        return kernels.below_signed(self.bits(), n)


class DeviceView(ArrayView):
    """A view whose arrays are on a device: of all games of a batch, of which those that are over are not in its mask.

    What sensors show and what is published is worked out by NumPy where it has no portable form.

    Args:
        state: of the batch on the host, which is only asked for what is not here.
        streets: on the device.
        agents: (agents,) numbers in the roster.
        node, alive, keys: (games, agents) on the device: rows of nodes, who is asked, keys of draws.
        turn: (games,) on the device.
    """

    streets: DeviceStreets

    def __init__(
        self, state: GameArrays, streets: DeviceStreets, agents: IntArray, node: Tensor, alive: Tensor, turn: Tensor,
        keys: Tensor,
    ) -> None:  # fmt: skip
        self._state, self.agents, self.streets = state, agents, streets
        self.roster, self.memory_of, self._shared = state.roster, state.memory_of, state.shared
        self.library, self._movement = streets.library, state.movement
        self.node, self.mask, self.turn = node, alive, turn
        self._known = dict[str, Tensor]()
        self.draw = DeviceDraws(keys, turn, self.xp)
        self._whole, self._sights = self.mask, dict[Hashable, Seen]()

    @property
    def counts(self) -> Tensor:
        """How many nodes are legal for each agent, its own included."""
        if "counts" not in self._known:
            self._known["counts"] = self.streets.counts[self.node]
        return self._known["counts"]

    @property
    def _choices(self) -> Tensor:
        """What is legal for each agent: the rows of their nodes."""
        return self.node

    @property
    def xp(self) -> Any:
        """The functions of the library, as the array API names them."""
        return self.library.xp

    @property
    def games(self) -> Tensor:  # type: ignore[override] # an attribute of views in NumPy
        """The numbers of the games: all, (games,)."""
        return self.library.put(np.arange(len(self._state)))

    def on_host(self) -> ArrayView:
        """Return the view in NumPy, of all games: where agents are on a GPU, they are copied."""
        view = ArrayView(self._state, np.arange(len(self._state)), self.agents)
        return on_ground(view) if self._kinds is ON_GROUND else view

    def of(self, agents: IntArray) -> "DeviceView":
        """Return the view of other agents in the same games, by their numbers in the roster, ascending; copies."""
        return moved(self.on_host().of(agents), self.library)

    def in_games(self, which: IntArray) -> NoReturn:
        """Refuse to leave out games (BadValue)."""
        raise BadValue(
            f"view.in_games({shown(which)}) is for views in NumPy, as shapes never change on a device: ask "
            "view.on_host().in_games(which)."
        )

    def legal_rows(self, which: Index = np.s_[:, :]) -> tuple[Tensor, Tensor]:
        """Return the rows of the legal nodes of each agent, (games, agents, most), and which of these count."""
        xp, table, node = self.xp, self.streets.legal, self.node[which]
        rows = xp.reshape(xp.take(table, xp.reshape(node, (-1,)), axis=0), (*node.shape, table.shape[1]))
        return rows, xp.arange(rows.shape[-1], device=self.library.device) < self.counts[which][..., None]

    def _places(self) -> Places:
        """Return where the agents are: in games by metres some may be on edges."""
        if self._state.places is None:
            xp, shape, streets = self.xp, self.node.shape, self.streets
            none = xp.full((*shape, 3), -1, dtype=xp.int64, device=self.library.device)
            xy = xp.stack((streets.x[self.node], streets.y[self.node]), axis=-1)
            return Places(none, xp.zeros(shape, dtype=xp.float64, device=self.library.device), xy)
        return self._put(self.on_host()._places())

    def action_to(self, nodes: Any) -> Tensor:
        """Return the actions that lead to these nodes, (games, agents); -1 where one is not legal.

        Raises:
            BadType, BadValue: they are no integers, or do not broadcast to (games, agents).
            UnknownName (KeyError): one is not on the map.
        """
        rows = self.streets.rows(nodes)
        if rows.shape != self.node.shape:
            as_one_shape({"nodes": np.empty(tuple(rows.shape))}, tuple(self.node.shape))
        return self.streets.numbers_of(self.node, self.xp.broadcast_to(rows, self.node.shape))

    def towards(self, targets: Tensor, which: Index = np.s_[:, :], allowed: Tensor | None = None) -> Tensor:
        """Return the actions by which agents go towards nodes, rows of them; -1 where no path leads there."""
        if allowed is not None:
            raise BadValue(f"view.towards(allowed=…) is for arrays of NumPy, not for {self.library}.")
        return self.routes().actions(self.node[which], targets)

    def vector(self, others: int = 4) -> Vectors:
        """Return what the agents observe as numbers, (games, agents, entries): a vector of one length for each."""
        return self._put(self.on_host().vector(others))

    def _looked(self, names: tuple[str, ...]) -> Seen:
        """Return what sensors of these names show to all agents of the view, or all sensors; see `seen`."""
        found = self._put(self.on_host().seen(*names))
        return found.of(self._whole[found.at, found.viewers])

    def seen_nodes(self, *names: str) -> SeenNodes:
        """Return which nodes the sensors show to those in the mask; see `ArrayView.seen_nodes`."""
        found = self._put(self.on_host().seen_nodes(*names))
        return some_rows(found, self.mask[found.at, found.viewers])

    def enemies(self) -> Seen:
        """Return which agents of other teams the sensors show; an agent of no team (None) is an enemy of all."""
        return self._of_asked(self.on_host().enemies())

    def mates(self) -> Seen:
        """Return which agents of their own teams the sensors show."""
        return self._of_asked(self.on_host().mates())

    def _of_asked(self, seen: Seen) -> Seen:
        found = self._put(seen)
        return found.of(self.mask[found.at, found.viewers])

    def covered(self) -> Tensor:
        """Return on which nodes the sensors would show agents; see `ArrayView.covered`."""
        return self.library.put(self.on_host().covered()) & self.mask[:, :, None]

    @property
    def living(self) -> Tensor:
        """Which agents are alive, (games, all agents)."""
        everyone = getattr(self._state, "everyone", None)  # where all are on the device
        return self.library.put(self._state.alive) if everyone is None else self.xp.asarray(everyone[1], copy=True)

    @property
    def is_there(self) -> Tensor:
        """Which agents are in the game, dead or alive, (games, all agents); the others have not come yet."""
        return self.library.put(self._state.is_there)

    def _put(self, table: Table) -> Table:
        """Return a named tuple with its arrays of NumPy on the device."""
        put = self.library.put
        return type(table)(*(put(column) if isinstance(column, np.ndarray) else column for column in table))

    @property
    def _blocked(self) -> Tensor:
        """Which agents conflicts have stopped in the last turn, (games, agents)."""
        return self.library.put(self._state.blocked[:, self.agents])

    def routes(self, weight: str | None = "length") -> "DeviceRoutes":  # type: ignore[override] # the same in arrays
        """Return how far it is to nodes, and which action leads there, by rows; `weight` as for `graph.distance`."""
        return kept_in(self._shared, ("routes on a device", weight), lambda: DeviceRoutes(self.streets, weight))

    def flows(self) -> "DeviceFlows":
        """Return what spreads along the edges; it is worked out in NumPy, and kept for the batch."""
        return kept_in(self._shared, "flows on a device", lambda: DeviceFlows(self.streets))

    def keep(self, key: Any, make: Callable[[int], Arrays]) -> Arrays:
        """Return what a strategy remembers of all games of the batch, on the device.

        At first it is what `make(games)` gives, in NumPy; write it as a whole: `kept["x"] = values`.
        """

        def put(games: int) -> Arrays:
            return {name: self.library.put(column) for name, column in make(games).items()}

        return self._state.keep((ON_DEVICE, key), put)

    def _checked(self, given: object, by: str, *, may_aim: bool = False) -> Tensor:  # noqa: ARG002 - none aim here
        """Return actions as integers (games, agents), 0 for those that are not in the mask."""
        chosen = self._as_actions(given, by)
        self.library.num_reads += 1
        if bool(self.xp.any((chosen < 0) | (chosen >= self.counts))):
            host = self.on_host()
            host.mask = self.library.get(self.mask)
            host._checked(self.library.get(chosen), by)
        return chosen

    def _as_actions(self, given: object, by: str) -> Tensor:
        """Return actions as integers (games, agents), 0 for those not in the mask; if they are legal is not read."""
        actions, xp = self.library.own(given, f"{by}: actions"), self.xp
        refuse_no_actions(actions, self.node.shape, by, xp)
        return xp.where(self.mask, xp.astype(actions, xp.int64), 0)

    def sees(self, *names: str) -> Tensor:
        """Return who sees whom, (games, agents, all agents); see `seen`.

        Sensors that show agents around, with no wall, angle or chance, are asked on the device.
        """
        state, key = self._state, ("seen", self.agents.tobytes(), names, self._kinds)
        if key not in state.shared:
            state.shared[key] = lookouts(state.roster, self.agents, names, kinds=self._kinds)
        looks, everyone = state.shared[key], getattr(state, "everyone", None)  # where all are on the device
        if everyone is None or not all(is_portable(one) for one in looks):
            return self.library.put(self.on_host().seen(*names).mask) & self.mask[:, :, None]
        return self._around(looks, *everyone) & self.mask[:, :, None]

    def _around(self, looks: list[Lookout], node: Tensor, alive: Tensor) -> Tensor:
        xp, streets, put = self.xp, self.streets, self.library.put
        dx = streets.x[node][:, None, :] - streets.x[self.node][:, :, None]
        dy = streets.y[node][:, None, :] - streets.y[self.node][:, :, None]
        squares = dx * dx + dy * dy
        found = xp.zeros(squares.shape, dtype=xp.bool, device=self.library.device)
        for look, columns, _, others, *_ in looks:
            who = np.zeros((len(self.agents), len(self.roster.names)), np.bool_)
            who[np.ix_(columns, others)] = True
            who &= self.agents[:, None] != np.arange(len(self.roster.names))
            within = put(who)[None, :, :] & alive[:, None, :]
            found = found | (within if look.radius == np.inf else within & (squares <= look.radius * look.radius))
        return found


def sees_enemies(view: DeviceView) -> Tensor:
    """Return who sees whom of other teams, (games, agents, all agents); of no team (None) are enemies of all."""
    are_mates = view.roster.are_mates(view.agents[:, None], np.arange(len(view.roster.names)))
    return view.sees() & view.library.put(~are_mates)


def nodes_of_all(view: DeviceView) -> Tensor:
    """Return the rows of the nodes of all agents of the games, (games, all agents)."""
    everyone = getattr(view._state, "everyone", None)  # where all are on the device
    return view.library.put(view._state.node) if everyone is None else view.xp.asarray(everyone[0], copy=True)


def is_portable(one: Lookout) -> bool:
    """Whether what sensors show can be worked out on a device, with the same result to the bit."""
    look = one.look
    plain = look.place is None and look.cone is None and look.hides is None and look.chances is None
    plain = plain and look.chance is None and look.quat is None and not (look.noise or look.false_alarms or look.delay)
    return plain and (look.radius == np.inf or 1e-150 < look.radius < 1e150)


class DeviceRoutes:
    """How far it is to targets, and which action leads there, on a device: what `RouteTable` knows.

    On a GPU, and for small maps, these are tables of all nodes, 10 bytes each, for targets that were asked for; else
    `RouteTable` is asked, whose tables are of what is around targets, and which shares its memory.
    """

    def __init__(self, streets: DeviceStreets, weight: str | None) -> None:
        self._library, self._streets, self._host = streets.library, streets, RouteTable(streets.host, weight)
        self._nodes = len(streets.columns.node_ids)
        self._is_dense = self._nodes <= _ALL_AT_FIRST or not self._library.on_host
        self._slot_of, self._used = np.full(self._nodes, -1, np.int64), 0
        self._slots, self._far, self._action = self._library.put(self._slot_of), *self._room(0)
        if self._is_dense:
            self.learn(np.arange(self._nodes if self._nodes <= _ALL_AT_FIRST else 1))

    def _room(self, tables: int) -> tuple[Tensor, Tensor]:
        xp, device = self._library.xp, self._library.device
        shape = tables, self._nodes
        return xp.empty(shape, dtype=xp.float64, device=device), xp.empty(shape, dtype=xp.int16, device=device)

    def learn(self, targets: IntArray) -> None:
        """Compute the tables of targets, rows of nodes, those that are missing."""
        new = np.unique(targets[self._slot_of[targets] < 0])
        if not len(new):
            return
        first, self._used = self._used, self._used + len(new)
        if self._used > self._far.shape[0]:
            known = self._far, self._action
            self._far, self._action = self._room(min(2 * self._used, self._nodes))
            for table, old in zip((self._far, self._action), known, strict=True):
                table[:first, :] = old[:first, :]
        sources, put = np.arange(self._nodes), self._library.put
        self._far[first : self._used, :] = put(self._host.distances(sources, new[:, None]))
        self._action[first : self._used, :] = put(self._host.actions(sources, new[:, None]).astype(np.int16))
        self._slot_of[new] = np.arange(first, self._used)
        self._slots = put(self._slot_of)

    def distances(
        self,
        sources: Tensor,
        targets: Tensor,
        *,
        among: IntArray | None = None,
        asked: Tensor | None = None,
        at: IntArray | None = None,  # noqa: ARG002 - for maps that differ
    ) -> Tensor:
        """Return what `RouteTable.distances` does.

        Without `among`, targets that are new are read; without both, one number is read to check what is passed.

        Raises:
            BadType, BadValue: they are no rows of nodes.
        """
        if not self._is_dense or not self._are_right(sources, targets, among, asked):
            return self._of_host(self._host.distances, sources, targets, asked)
        slots = self._learned(targets, among, asked)
        return self._library.xp.reshape(self._far, (-1,))[slots * self._nodes + sources]

    def actions(
        self, sources: Tensor, targets: Tensor, *, among: IntArray | None = None, asked: Tensor | None = None
    ) -> Tensor:
        """Return the actions that lead to targets, as strategies go a step, -1: there is no path; see `distances`."""
        if not self._is_dense or not self._are_right(sources, targets, among, asked):
            return self._of_host(self._host.actions, sources, targets, asked)
        slots, xp = self._learned(targets, among, asked), self._library.xp
        return xp.astype(xp.reshape(self._action, (-1,))[slots * self._nodes + sources], xp.int64)

    def _are_right(self, sources: Tensor, targets: Tensor, among: IntArray | None, asked: Tensor | None) -> bool:
        """Whether these are rows of nodes on the device, of callers that do not say which of them count."""
        if among is not None or asked is not None:
            return True
        streets, every = self._streets, self._library.xp.all
        if not (streets._are_integers(sources) and streets._are_integers(targets)):
            return False
        return streets._holds(every(streets._are_rows(sources)) & every(streets._are_rows(targets)))

    def _of_host(
        self, ask: Callable[[IntArray, IntArray], Any], sources: Tensor, targets: Tensor, asked: Tensor | None
    ) -> Tensor:
        """Return what the tables of the host say."""
        get, put = self._library.get, self._library.put
        starts, ends = (get(one) if self._library.is_own(one) else one for one in (sources, targets))
        return put(ask(starts, ends) if asked is None else of_asked(ask, starts, ends, get(asked)))

    def _learned(self, targets: Tensor, among: IntArray | None, asked: Tensor | None) -> Tensor:
        """Return the numbers of the tables of targets; of those that are not asked for, of any."""
        xp, library = self._library.xp, self._library
        if among is not None:
            self.learn(among)
        slots = self._slots[targets]
        if among is None and self._used < self._nodes:
            is_new = slots < 0 if asked is None else (slots < 0) & asked
            library.num_reads += 1
            if bool(xp.any(is_new)):
                rows = xp.broadcast_to(targets, is_new.shape)
                self.learn(np.unique(library.get(rows)[library.get(is_new)]))
                slots = self._slots[targets]
        return xp.where(slots < 0, 0, slots)


class DeviceFlows(Flows):
    """What spreads along the edges of a graph on a device: `Flows` works it out on the host."""

    def __init__(self, streets: DeviceStreets) -> None:
        super().__init__(streets.host)
        self._library = streets.library

    def walks(self, nodes: Tensor, turns: int, seed: int = 0) -> Tensor:
        """Walk at random from nodes; see `Flows.walks`."""
        return self._library.put(super().walks(self._library.get(nodes), turns, seed))

    def diffuse(self, masses: Tensor, turns: int = 1, stay: float | None = None) -> Tensor:
        """Return probabilities after random walks; see `Flows.diffuse`."""
        return self._library.put(super().diffuse(self._library.get(masses), turns, stay))

    def within(self, nodes: Tensor, limit: float, weight: str | None = "length") -> Tensor:
        """Return which nodes paths reach that are at most so long; see `Flows.within`."""
        return self._library.put(super().within(self._library.get(nodes), limit, weight))

    def edges(self, sources: Tensor, targets: Tensor) -> Tensor:
        """Return how many edges paths have; see `Flows.edges`."""
        return self._library.put(super().edges(self._library.get(sources), self._library.get(targets)))


class CopiedView(DeviceView):
    """A view of games that are played on the host: copies of its arrays on a device."""

    def __init__(self, view: ArrayView, streets: DeviceStreets) -> None:
        put, state = streets.library.put, view._state
        keys = kernels.as_signed(np.ascontiguousarray(state.draw_keys()[:, view.agents]))
        super().__init__(state, streets, view.agents, *map(put, (view.node, view.mask, view.turn, keys)))
        self._known, self._of_host, self._shared = {"counts": put(view.counts)}, view, view._shared

    def on_host(self) -> ArrayView:
        """Return the view in NumPy."""
        return self._of_host

    def legal_rows(self, which: Index = np.s_[:, :]) -> tuple[Tensor, Tensor]:
        """Return the rows of the legal nodes of each agent, (games, agents, most), and which of these count."""
        rows, counts = self.on_host().legal_rows(which)
        return self.library.put(rows), self.library.put(counts)

    def towards(self, targets: Tensor, which: Index = np.s_[:, :], allowed: Tensor | None = None) -> Tensor:
        """Return the actions by which agents go towards nodes, rows of them; -1 where no path leads there."""
        rows, get = self.library.get(targets), self.library.get
        return self.library.put(self.on_host().towards(rows, which, None if allowed is None else get(allowed)))

    def routes(self, weight: str | None = "length") -> "DeviceRoutes":  # type: ignore[override] # the same in arrays
        """Return how far it is to nodes, and which action leads there, where all games have the same roads."""
        if isinstance(self.streets, DeviceStreetsOfMaps):
            refuse_several_maps("What view.routes() says on a device")
        return super().routes(weight)

    def action_to(self, nodes: Any) -> Tensor:
        """Return the actions that lead to these nodes, (games, agents); -1 where one is not legal."""
        wanted = self.library.get(nodes) if self.library.is_own(nodes) else nodes
        return self.library.put(self.on_host().action_to(wanted))


def moved(view: ArrayView, library: ArrayLibrary) -> DeviceView:
    """Return a view of all games, which are played on the host, with copies of its arrays on a device."""
    state, streets = view._state, view.streets

    def made() -> DeviceStreets:
        if isinstance(streets, StreetsOfMaps):
            return DeviceStreetsOfMaps(DeviceStreets(state.streets, library))
        return DeviceStreets(streets, library)

    return CopiedView(view, kept_in(view._shared, "streets on a device", made))


def columns_of(table: Tensor, agents: IntArray, library: ArrayLibrary) -> Tensor:
    """Return the columns of some agents, of a table (games, agents)."""
    if not len(agents):
        return table[:, :0]
    first, last = int(agents[0]), int(agents[-1])
    if last - first == len(agents) - 1:
        return table[:, first : last + 1]
    return library.xp.take(table, library.put(agents), axis=1)


def with_others(table: Tensor, numbers: IntArray, own: Tensor, axis: int, library: ArrayLibrary) -> Tensor:
    """Return a table (games, agents) with other rows of some games, axis 0, or other columns of some agents, axis 1."""
    most = table.shape[axis]
    if np.array_equal(numbers, np.arange(most)):
        return own
    places = np.arange(most)
    places[numbers] = most + np.arange(len(numbers))
    return library.xp.take(library.xp.concat((table, own), axis=axis), library.put(places), axis=axis)


def only_playing(alive: Tensor, playing: BoolArray, library: ArrayLibrary) -> Tensor:
    """Return who of those that are alive is in a game that goes on."""
    return alive if playing.all() else alive & library.put(playing)[:, None]
