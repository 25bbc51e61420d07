"""Plays all games of a batch with where agents are, and what they decide, in arrays of another library on a device.

What each game is apart from that (its turn, scores, events, what rules remember) stays in NumPy on the host. A rule may
say, in its attribute `array_trigger`, in which games it may have something to do: only these are read, and the array
form of the rule, in NumPy, is called for them alone. All arrays on the device have the axis of all games, so that their
shapes never change; games that are over are masked.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from gamms.game.batch.arrays import ArrayEngine
from gamms.game.batch.asking import Asking
from gamms.game.batch.columns import PlayedGame, Roster, agents_of, in_turns, kept_in
from gamms.game.batch.device_view import ON_DEVICE, DeviceStreets, DeviceView, columns_of, only_playing, with_others
from gamms.game.batch.forms import form_of
from gamms.game.batch.game_forms import Group
from gamms.game.batch.given import Given, on_host
from gamms.game.batch.libraries import ArrayLibrary, Tensor
from gamms.game.batch.movement import Movement
from gamms.game.batch.scalar_rules import collectors_of
from gamms.game.batch.sight import reports_elsewhere, turns_with_its_agent
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.batch.turn import ArrayTurn
from gamms.game.batch.view import IS_LEGAL, MAY_SKIP, PORTABLE, ArrayView
from gamms.game.batch.why_not import teams_asked
from gamms.game.settings import NamedRule
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels import as_signed
from gamms.text import as_code, shown
from gamms.typing import AgentType

TRIGGER = "array_trigger"
"""An attribute of rules and conflicts: a function of a `DeviceTurn` that returns the games in which there may be
something to do, (games,) on the device; or None: all games, of whose agents nothing is read."""

_COLUMNS = ("node", "starts", "ends", "alive", "took_part")


class DeviceGames(GameArrays):
    """The state of all games of a batch: of the agents on a device, of all else on the host.

    Attributes:
        library: which keeps the arrays on the device.
        there: the columns on the device, (games, agents) each, by name: `node`, `alive`, and of the last turn `starts`,
            `ends`, `took_part`; `moves` counts, `keys` are those of draws.
        turn_there: (games,) on the device, how many turns were played.
    """

    def __init__(
        self, roster: Roster, movement: Movement, seeds: Sequence[int], start: IntArray, library: ArrayLibrary
    ) -> None:
        self.library, self.there = library, dict[str, Tensor]()
        self._node: IntArray
        self._alive: BoolArray
        self._is_old = False  # whether the device knows more than the host
        super().__init__(roster, movement, seeds, start)
        self.streets_there = DeviceStreets(movement.streets, library)
        self.is_on_host = False  # for good, once roads were closed
        self.upload()

    def upload(self) -> None:
        """Put where agents are, as the host knows it, on the device."""
        if self.is_on_host:
            return
        put = self.library.put
        self.there = dict(
            zip(_COLUMNS, map(put, (self._node, *self.last_moves[:2], self._alive, self.last_moves[2])), strict=True)
        )
        self.there |= {"moves": put(self.counts["moves"]), "keys": put(as_signed(self.draw_keys()))}
        self.turn_there = put(self.turn)
        self._is_old = False

    def leave_device(self) -> None:
        """Have on the host alone how agents have moved, and what strategies remember; from now on."""
        self.download()
        self.is_on_host, get = True, self.library.get
        for column, name in zip(self.last_moves[:3], ("starts", "ends", "took_part"), strict=True):
            column[:] = get(self.there[name])
        for key in [key for key in self.kept if isinstance(key, tuple) and key[0] == ON_DEVICE]:
            self.kept[key[1]] = self._read(self.kept.pop(key))
            self._makers[key[1]] = partial(self._made, self._makers.pop(key))
        self.now.clear()

    def _read(self, columns: Arrays) -> Arrays:
        return {name: np.array(self.library.get(column)) for name, column in columns.items()}

    def _made(self, make: Callable[[int], Arrays], games: int) -> Arrays:
        return self._read(make(games))

    def download(self) -> None:
        """Read where agents are."""
        if self._is_old:
            self._is_old, get = False, self.library.get
            self._node, self._alive, moves = (np.array(get(self.there[name])) for name in ("node", "alive", "moves"))
            self.counts["moves"] = moves

    @property
    def node(self) -> IntArray:
        """Where the agents are, read from the device."""
        self.download()
        return self._node

    @node.setter
    def node(self, rows: IntArray) -> None:
        self._node = rows

    @property
    def alive(self) -> BoolArray:
        """Which agents are alive, read from the device."""
        self.download()
        return self._alive

    @alive.setter
    def alive(self, are: BoolArray) -> None:
        self._alive = are

    @property
    def everyone(self) -> tuple[Tensor, Tensor] | None:
        """The nodes of all agents on the device, and who is alive; None: they are on the host."""
        return None if self.is_on_host else (self.there["node"], self.there["alive"])

    def reset(self, games: IntArray, seeds: Sequence[int], start: IntArray) -> None:
        """Begin some games again."""
        self.download()
        super().reset(games, seeds, start)
        self.upload()

    def _with_rows(self, column: Tensor, games: IntArray, rows: Tensor) -> Tensor:
        if not self.library.is_own(column):
            return super()._with_rows(column, games, rows)
        return with_others(column, games, rows, 0, self.library)

    def move(self, ends: Tensor, playing: BoolArray) -> None:
        """Move all agents on the device, in the games that are played."""
        now, xp = self.there, self.library.xp
        self.there = now | {
            "starts": now["node"], "ends": ends, "node": ends, "took_part": now["alive"],
            "moves": now["moves"] + xp.astype(ends != now["node"], xp.int64),
        }  # fmt: skip
        self.turn[playing] += 1
        self.placed[playing] = False
        self.turn_there = self.turn_there + (1 if playing.all() else self.library.put(playing.astype(np.int64)))
        self._is_old = True
        self.now.clear()

    def rows(self, games: IntArray, names: Sequence[str]) -> list[np.ndarray[Any, Any]]:
        """Read columns of some games, all at once."""
        xp, every = self.library.xp, len(games) == len(self)
        which = None if every else self.library.put(games)
        columns = [self.there[name] if every else xp.take(self.there[name], which, axis=0) for name in names]
        return list(self.library.get(xp.stack([xp.astype(column, xp.int64) for column in columns])))

    def write(self, games: IntArray, **columns: np.ndarray[Any, Any]) -> None:
        """Write rows of columns, (games, agents), of some games."""
        for name, rows in columns.items():
            self.there[name] = self._with_rows(self.there[name], games, self.library.put(rows))
        self._is_old = True
        self.now.clear()


class HostTurn(ArrayTurn):
    """The turn of some games in NumPy, for rules: where agents are is read from the device when it is asked for."""

    _state: DeviceGames

    def __init__(self, state: DeviceGames, games: IntArray, *, before_moves: bool = False) -> None:
        self._before_moves = before_moves
        self._before: tuple[IntArray, BoolArray] | None = None
        super().__init__(state, games)

    def _find_agents(self) -> None:
        """Leave them where they are until they are asked for."""

    def __getattr__(self, name: str) -> Any:
        if name not in _COLUMNS:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        node, starts, ends, alive, took_part = self._state.rows(self.games, _COLUMNS)
        self._place_agents(node.copy(), alive != 0)
        if not self._before_moves:
            self.starts, self.ends, self.took_part = starts, ends, took_part != 0
        self._before = self.node.copy(), self.alive.copy()
        self.node.flags.writeable = self.alive.flags.writeable = False
        return self.__dict__[name]

    def _write(self) -> None:
        """Write what has changed to the device."""
        if self._before is not None:
            node, alive = self._before
            changed = np.flatnonzero(((self.node != node) | (self.alive != alive)).any(axis=1))
            if len(changed):
                self._state.write(self.games[changed], node=self.node[changed], alive=self.alive[changed])


class DeviceTurn:
    """What a trigger gets: a turn of all games, in arrays (games, agents) on the device.

    Attributes:
        xp: the functions of the library.
        put: puts an array of NumPy on the device.
        roster: the agents, in the order of their names.
        streets: the graph, on the device.
        node, starts, ends, alive, took_part: see `ArrayTurn`.
    """

    node: Tensor
    starts: Tensor
    ends: Tensor
    alive: Tensor
    took_part: Tensor

    def __init__(self, state: DeviceGames, **columns: Tensor) -> None:
        self._state, self.xp, self.put = state, state.library.xp, state.library.put
        self.roster, self.streets = state.roster, state.streets_there
        self.__dict__.update({name: state.there[name] for name in _COLUMNS} | columns)

    def of(self, column: Tensor, agents: IntArray) -> Tensor:
        """Return the columns of some agents, (games, agents)."""
        return columns_of(column, agents, self._state.library)

    @property
    def nothing(self) -> Tensor:
        """Zeros, (games,)."""
        return self.xp.zeros(len(self._state), dtype=self.xp.int64, device=self._state.library.device)

    def any_of(self, found: Sequence[Tensor]) -> Tensor:
        """Return in which games something is true, of arrays (games, any number)."""
        return self.xp.any(self.xp.concat((*found, self.nothing[:, None] > 0), axis=1), axis=1)

    def are_nodes(self, ids: frozenset[int]) -> Tensor:
        """Return which nodes are among those of these ids, (nodes,)."""
        return self.shared(("nodes", ids), lambda: np.isin(self.streets.columns.node_ids, sorted(ids)))

    def shared(self, key: Hashable, make: Callable[[], np.ndarray[Any, Any]]) -> Tensor:
        """Return on the device what `make()` gives, in NumPy, at the first call."""
        return kept_in(self._state.shared, (ON_DEVICE, key), lambda: self.put(make()))

    def kept(self, key: Hashable) -> Mapping[str, np.ndarray[Any, Any]]:
        """Return what a rule remembers, in NumPy; nothing before it was called."""
        return self._state.kept.get(key, {})

    def start_of(self, agents: IntArray) -> Tensor:
        """Return where agents began, (games, agents)."""
        return self.put(self._state.start[:, agents])


class DeviceEngine(ArrayEngine):
    """Plays the games of a batch in arrays on a device; see `ArrayEngine`."""

    state: DeviceGames

    def __init__(
        self, game: PlayedGame, seeds: Sequence[int], start: IntArray, roster: Roster, library: ArrayLibrary
    ) -> None:
        self.library = library
        super().__init__(game, seeds, start, roster)
        self._resolver = game.settings()["conflicts"]

    def _made_state(self, roster: Roster, movement: Movement, seeds: Sequence[int], start: IntArray) -> GameArrays:
        return DeviceGames(roster, movement, seeds, start, self.library)

    def _step(self, given: Mapping[Hashable, Given], before_moves: Callable[[], object]) -> None:
        """Play one turn of all games that are not over; see `ArrayEngine.step`."""
        state, playing = self.state, ~self.is_over
        if self._has_left():
            super()._step(on_host(given, self.library), before_moves)
            return
        if self._here.rules["before"]:
            self._given(only_playing(state.there["alive"], playing, self.library), given)
            for named, form in self._here.rules["before"]:
                self._play(named, form, ~self.is_over)
            playing = ~self.is_over
        if self._has_left():  # one of them has closed roads
            self._move_all(on_host(given, self.library), before_moves)
            return
        if not playing.any():
            return
        mask = only_playing(state.there["alive"], playing, self.library)
        actions = self._actions(mask, given)
        node = state.there["node"]
        ends = state.streets_there.ends_of(node, actions)
        before_moves()
        state.move(self._unopposed(playing, node, ends), playing)
        for named, form in self._here.rules["after"]:
            self._play(named, form, playing)

    def _has_left(self) -> bool:
        """Have all games on the host once one has closed roads or leaves the arrays; return whether they are there."""
        if (self.state.roads.are_closed or self.state.apart) and not self.state.is_on_host:
            self.state.leave_device()
        return self.state.is_on_host

    def why_slow(self) -> str | None:
        """Return what has games of a device played on the host since they began, in words; None: nothing."""
        why = next(iter(self.state.apart.values()), "closed roads")
        return _copied(why, self.library) if self._has_left() else None

    def _actions(self, mask: Tensor, given: Mapping[Hashable, Given]) -> Tensor:
        """Return what all agents do, (games, agents)."""
        xp, library, parts = self.library.xp, self.library, self._given(mask, given)
        taken = np.zeros(len(self.state.roster.names), np.bool_)
        for agents, _ in parts:
            taken[agents] = True
        for group in self._here.groups:
            agents = group.agents[~taken[group.agents]]
            if len(agents):
                parts.append((agents, self._asked(group, agents, mask)))
                taken[agents] = True
        if not taken.all():
            shape = len(self.state), int((~taken).sum())
            idle = xp.zeros(shape, dtype=xp.int64, device=library.device)
            parts.append((np.flatnonzero(~taken), idle))
        if len(parts) == 1:
            return parts[0][1]
        order = np.argsort(np.concatenate([agents for agents, _ in parts]))
        return xp.take(xp.concat([part for _, part in parts], axis=1), library.put(order), axis=1)

    def _given(self, mask: Tensor, given: Mapping[Hashable, Given]) -> list[tuple[IntArray, Tensor]]:
        """Return the agents and the moves, (games, agents), that were given of each team, checked."""
        parts = []
        if any(one.deeds or one.messages for one in given.values()):  # which no game here has, so they are refused
            playing = ArrayTurn(self.state, np.flatnonzero(~self.is_over))
            Asking(self.state, self._here, given, at_arrivals=False).acts(playing)
        for team, wanted in given.items():
            agents = self.state.roster.members(team)
            view = self._view(agents, mask, is_own=True)
            parts.append((agents, view._checked(wanted.moves_in(view, wanted.moves), f"team {shown(team)}")))
        return parts

    def _asked(self, group: Group, agents: IntArray, mask: Tensor) -> Tensor:
        """Return what the strategy of a group decides."""
        form = getattr(group.form, PORTABLE, None)
        try:
            if form is None:
                return self._asked_on_host(group, agents)
            is_legal = getattr(form, IS_LEGAL, False)
            view = self._view(agents, mask, is_own=is_legal)
            actions = form(view)
            return view._as_actions(actions, group.name) if is_legal else view._checked(actions, group.name)
        except Exception as error:
            games = np.flatnonzero(~self.is_over)
            error.add_note(f"In the strategy {group.name} of a batch, {in_turns(self.state.turn[games], games)}.")
            raise

    def _asked_on_host(self, group: Group, agents: IntArray) -> Tensor:
        games = np.flatnonzero(~self.is_over)
        view = ArrayView(self.state, games, agents)
        actions = np.zeros((len(self.state), len(agents)), np.int64)
        actions[games] = view._checked(group.form(view), group.name)
        return self.library.put(actions)

    def _view(self, agents: IntArray, mask: Tensor, *, is_own: bool = False) -> DeviceView:
        """Return a view; of what is not our own, of copies, since arrays of other libraries can be written to."""
        state, library = self.state, self.library
        node, asked, keys = (
            columns_of(one, agents, library) for one in (state.there["node"], mask, state.there["keys"])
        )
        shown = node, asked, state.turn_there
        if not is_own:
            shown = tuple(library.xp.asarray(one, copy=True) for one in shown)
        return DeviceView(state, state.streets_there, agents, *shown, keys)

    def _unopposed(self, playing: BoolArray, node: Tensor, wanted: Tensor) -> Tensor:
        """Return where agents go when those have stayed that checks refuse to move and conflicts stop."""
        ends, state, xp, put = wanted, self.state, self.library.xp, self.library.put
        for _, check in self._here.checks:
            games = np.flatnonzero(playing)
            refused = np.zeros(state.blocked.shape, np.bool_)
            refused[games] = check(HostTurn(state, games, before_moves=True), self.library.get(wanted)[games])
            ends = xp.where(put(refused), node, ends)
        if self._here.conflicts is not None:
            found = getattr(self._resolver, TRIGGER)(DeviceTurn(state, ends=ends))
            games, stops = np.flatnonzero(playing & self.library.get(found)), np.zeros(state.blocked.shape, np.bool_)
            if len(games):
                turn, moves = HostTurn(state, games, before_moves=True), xp.take(ends, put(games), axis=0)
                rows = self.library.get(moves)
                stops[games] = (rows != turn.node) & self._here.conflicts(turn, rows)
                ends = xp.where(put(stops), node, ends)
            was_blocked = state.blocked[playing]
            if was_blocked.any():  # those that are out did not decide: they stay so
                was_blocked &= ~self.library.get(state.there["alive"])[playing]
            state.blocked[playing] = stops[playing] | was_blocked
        if ends is not wanted:
            state.counts["blocked"][playing] += self.library.get(ends != wanted)[playing]
        return ends

    def _play(self, named: NamedRule, form: Any, playing: BoolArray) -> None:
        """Let a rule do what it does, in the games in which it may have something to do."""
        trigger, games = getattr(named.rule, TRIGGER, None), playing
        found = None if trigger is None else trigger(DeviceTurn(self.state))
        if found is not None:
            games = playing & self.library.get(found)
        chosen = np.flatnonzero(games)
        if len(chosen):
            turn = HostTurn(self.state, chosen)
            try:
                self._call(named, form, turn)
            finally:
                turn._write()

    def view(self, agents: IntArray) -> ArrayView:
        """Return what agents observe, in all games, on the device."""
        if self._has_left():
            return super().view(agents)
        return self._view(agents, self.state.there["alive"])

    def result(self, game: int) -> Any:
        """Return the result of a game so far."""
        self.state.download()
        return super().result(game)


def in_all_games(_: DeviceTurn) -> None:
    """The trigger of a rule that is called for all games, and reads nothing of agents in most turns."""


def engine_for(
    library: ArrayLibrary, game: PlayedGame, seeds: Sequence[int], start: IntArray, roster: Roster
) -> tuple[ArrayEngine, str | None]:
    """Return what plays a game in arrays of a library, and what is slow there, in words; None: nothing."""
    why = _why_not_on_device(game) if roster.is_first.all() else "rows of agents that may come"
    if why is None:
        return DeviceEngine(game, seeds, start, roster, library), _read_in_each_turn(game, library)
    return ArrayEngine(game, seeds, start, roster), _copied(why, library)


def _copied(what: str, library: ArrayLibrary) -> str | None:
    """Say that something is played in NumPy; None: on the host there are no copies."""
    return None if library.on_host else f"{what}, which NumPy plays: {library} gets copies"


def _why_not_on_device(game: PlayedGame) -> str | None:
    """Return what of a game that is played in arrays has no form for other libraries, in words; None: all has."""
    settings = game.settings()
    conflicts = settings["conflicts"]
    agents = agents_of(game)
    has_begun = game.turn > 0 or bool(game.scores) or not all(agent.alive for agent in agents)
    reasons = [
        (has_begun, "a game that has begun"),
        (settings["speed_unit"] != "edges", f"speed_unit={settings['speed_unit']!r}"),
        (settings["legal"] != "edges", f"legal={settings['legal']!r}"),
        (settings["order"] is not None, "an order of play"),
        (bool(settings["deeds"]), "deeds"),
        (bool(settings["channels"]), "channels"),
        (bool(settings["plans"]), "plans of teams"),
        (any(map(reports_elsewhere, agents)), "sensors with position noise, false alarms or delays"),
        (any(map(turns_with_its_agent, agents)), "sensors that turn with their agents"),
        (any(getattr(form_of(one.strategy), MAY_SKIP, False) for one in agents), "strategies that may set no action"),
        *[(True, why) for why in teams_asked(game).values()],
        (any(one.phase not in {"before", "after"} for one in game.rules), "rules of other phases"),
        (any(form_of(one.rule) is None for one in game.rules), "rules without an array form"),
        (bool(collectors_of(game)), "what is collected"),
        (any(agent.type is AgentType.AERIAL or agent.speed is not None for agent in agents), "flights or speeds"),
        (conflicts is not None and not hasattr(conflicts, TRIGGER), f"the conflicts {as_code(conflicts)}"),
    ]
    return next((reason for is_there, reason in reasons if is_there), None)


def _read_in_each_turn(game: PlayedGame, library: ArrayLibrary) -> str | None:
    """Return what reads all agents from the device in each turn, in words; None: nothing, or they are on the host."""
    strategies = [agent.strategy for agent in game.agents if agent.strategy is not None]
    slow = [f"the strategy {as_code(one)}" for one in strategies if not hasattr(form_of(one), PORTABLE)]
    slow += [
        f"the rule {one.name!r}"
        for one in game.rules
        if getattr(one.rule, TRIGGER, None) is None or hasattr(one.rule, "check")
    ]
    return (
        f"{slow[0]}, which is played in NumPy: {library} is read in each turn" if slow and not library.on_host else None
    )
