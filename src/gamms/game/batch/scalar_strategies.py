"""Strategies and plans without an array form in games that are played in arrays: asked as the turn engine asks them."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.deeds import ArrayDeeds
from gamms.game.batch.rule_fork import NeedsTurnEngine, RuleFork
from gamms.game.batch.scalar_rules import RuleContext
from gamms.game.batch.sight import look_of
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import SHOWING_NODES
from gamms.game.batch.turn import ArrayTurn
from gamms.game.batch.view import ArrayView
from gamms.game.facts import PrivateForks
from gamms.game.order import Part
from gamms.game.random_streams import DrawTable
from gamms.game.slots import AgentSlot
from gamms.ir.game_state import GameState, in_conflict
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing import AgentType, IAgent
from gamms.typing.sensor_engine import ISensor

FEWEST, FEWEST_IN_CONTEXT = 16, 64  # games that are faster in arrays, also where strategies may need their context
_FAILURES = ("illegal", "errors", "overruns")  # counts of what goes wrong when agents decide


class Players:
    """The agents of one game that are asked one by one.

    Attributes:
        state: what they remember and know, and why their last actions were not done.
        slots: number in the roster -> what the turn engine holds of each.
        living: the numbers of those that were asked last.
        part: the slots of these, and what is needed to ask them.
        made_for: the context and the number of its cast that the slots were made for.
    """

    def __init__(self, errors: list[dict[str, Any]]) -> None:
        self.state = GameState(errors=errors)
        self.slots: dict[int, AgentSlot] = {}
        self.living: list[int] = []
        self.part: tuple[list[AgentSlot], Part] = [], Part([], None, [], {})
        self.made_for: tuple[RuleFork | None, int] = None, 0

    def show_blocked(self, name: str) -> None:
        """Let the next state of an agent say why its last action was not done."""
        for slot in self.slots.values():
            if slot.name == name:
                slot.show_blocked()


class _NoForks(PrivateForks):
    """Stands for `state["fork"]`, which copies a game that the turn engine plays."""

    __slots__ = ("_fork",)

    def __init__(self, fork: RuleFork) -> None:
        super().__init__(None)
        self._fork = fork

    def __call__(self, *_: object, **__: object) -> Any:
        """Refuse to copy the game."""
        self._fork.refuse("it looks ahead in copies of the game")


class ScalarStrategies:
    """Asks agents, one after the other in each game of a turn, with the states that they get in games played alone.

    Args:
        context: in which agents look around and decide, as far as arrays do not say what they see.
        state: of all games.
        agents: their numbers in the roster, ascending.
        players: of each game; None: none was asked yet.
    """

    def __init__(
        self, context: RuleContext, state: GameArrays, agents: IntArray, players: list[Players | None]
    ) -> None:
        self._context, self._state, self.agents, self._players = context, state, agents, players
        self._numbers = frozenset(agents.tolist())
        self._cells: dict[str, dict[int, list[Any]]] = {}  # sensor -> agent -> what it shows, where arrays say that
        self._fork: RuleFork | None = None  # for which it was worked out what follows
        self._needs_game: dict[int, bool] = {}  # agent -> whether it must be asked in the context of its game
        self._facts: list[Callable[[GameArrays, int], Mapping[str, Any]]] = []

    def functions(self) -> list[Callable[..., object]]:
        """Return the strategies."""
        agents = [self._state.roster.agents[number] for number in self.agents.tolist()]
        return [agent.strategy for agent in agents if agent.strategy is not None]

    def _of(self, game: int) -> Players:
        found = self._players[game]
        if found is None:
            found = self._players[game] = Players(self._state.errors[game])
        return found

    # -- why actions were not done ----------------------------------------------------------------------------------

    def note_blocked(self, game: int, agent: int, why: str | None) -> None:
        """Note why an agent does not do what it wanted; None: arrays do not have the words."""
        if agent in self._numbers:
            name, players = self._state.roster.names[agent], self._of(game)
            blocked = players.state.blocked
            if why is None:
                blocked[name] = self._context.fork.unknown("why a rule has refused a move")
            elif isinstance(blocked.get(name, ""), str):
                blocked.add(name, why)
            players.show_blocked(name)

    def note_stopped(self, turn: ArrayTurn, stopped: BoolArray, ends: IntArray | None) -> None:
        """Note that agents, (games, agents), were stopped by conflicts on the way to nodes; None: by rules."""
        for at, agent in np.argwhere(stopped).tolist():
            why = None if ends is None else in_conflict(int(self._state.streets.ids(ends[at, agent])))
            self.note_blocked(int(turn.games[at]), agent, why)

    def forget_blocked(self, turn: ArrayTurn, agents: Sequence[int], games: Sequence[int] | None = None) -> None:
        """Forget why the last actions of agents were not done, which do something else now."""
        for at in range(len(turn.games)) if games is None else games:
            players = self._players[int(turn.games[at])]
            if players is None or not players.state.blocked:
                continue
            for number in [number for number in agents if turn.alive[at, number]]:
                name = self._state.roster.names[number]
                if players.state.blocked.pop(name, None) is not None:
                    players.show_blocked(name)

    # -- asking -----------------------------------------------------------------------------------------------------

    def decide(self, turn: ArrayTurn, agents: IntArray) -> tuple[IntArray, list[ArrayDeeds]]:
        """Ask some of the agents; return their actions, (games, agents), and what else they do."""
        state, view = self._state, ArrayView(self._state, turn.games, agents)
        node, alive, numbers = state.streets.ids(view.node).tolist(), view.mask.tolist(), agents.tolist()
        deeds: list[tuple[int, int, int, str, Any]] = []
        self._look_at(self._context.fork)
        shown_by = [(cells, self._shown(view, name, cells)) for name, cells in self._cells.items()]

        def ask(fork: RuleFork, at: int) -> None:
            self._look_at(fork)
            for cells, data in shown_by:
                for i, number in enumerate(numbers):
                    if number in cells:
                        cells[number][0] = fork.in_order(data[at * len(numbers) + i])
            columns = [i for i, is_living in enumerate(alive[at]) if is_living]
            living = [numbers[i] for i in columns]
            ends, done = self._ask(fork, turn, at, living, [node[at][i] for i in columns])
            for i, end in zip(columns, ends, strict=True):
                node[at][i] = end
            deeds.extend((at, living[i], *deed) for i, deed in done)

        needs_game = any(self._needs_game[number] for number in numbers)
        self._context.ask(turn, "the strategies of agents", ask, needs_game=needs_game)
        ends = np.array(node, np.int64).reshape(view.node.shape)
        return view.action_to(ends), state.deeds.from_plain(deeds, turn.node)

    def _ask(
        self, fork: RuleFork, turn: ArrayTurn, at: int, living: list[int], starts: list[int]
    ) -> tuple[Sequence[int], list[tuple[int, tuple[int, str, Any]]]]:
        """Ask agents of a game; return the nodes that they go to, and the deeds of each, by its place among them."""
        game = int(turn.games[at])
        players = self._of(game)
        state = players.state
        state.turn = int(turn.turn[at])
        slots, part = self._part(players, fork, game, living)
        for facts in self._facts:
            state.facts.update(facts(self._state, game))
        decisions = fork.decisions(slots, starts, state)
        try:
            fork.ask(decisions, part)
            if decisions.awaited:
                raise NeedsTurnEngine("it is awaited")
        finally:
            decisions.drop()
        self.forget_blocked(turn, living, [at])
        for i, why in decisions.close():
            state.blocked.add(slots[i].name, why)
            slots[i].show_blocked()
            for kind in _FAILURES:
                self._state.counts[kind][game, living[i]] += slots[i].counts[kind]
                slots[i].counts[kind] = 0
        done = []
        for i, action in decisions.actions.items():
            if action.heading != ():
                raise NeedsTurnEngine("it turns agents")
            done += [(i, (order, kind, values)) for order, (kind, values) in enumerate((action.deeds or {}).items())]
        return decisions.ends, done

    def _part(self, players: Players, fork: RuleFork, game: int, living: list[int]) -> tuple[list[AgentSlot], Part]:
        """Return what is needed to ask these agents."""
        if players.made_for != (fork, fork.casting):
            players.made_for, players.slots, players.living = (fork, fork.casting), {}, [-1]
            self._know_facts(players.state, fork)
            forks, table = _NoForks(fork), DrawTable(self._state.seeds[game], players.state)
            for number in self.agents.tolist():
                slot = fork.slot(self._state.roster.names[number], players.state, table, forks)
                slot.carried = tuple(
                    (name, _see_nothing, sensor, self._cells[name][number])
                    if number in self._cells.get(name, ())
                    else (name, sense, sensor, result)
                    for name, sense, sensor, result in slot.carried
                )
                players.slots[number] = slot
        if players.living != living:
            slots = [players.slots[number] for number in living]
            players.living, players.part = living, (slots, fork.part(slots))
        return players.part

    def _know_facts(self, state: GameState, fork: RuleFork) -> None:
        """Let a game have the facts that do not change."""
        state.facts.update(fork.facts)
        state.agent_facts, state.team_facts = fork.private_facts

    def _look_at(self, fork: RuleFork) -> None:
        """Work out once for a context which sensors arrays have, and which agents must be asked in it."""
        if fork is self._fork:
            return
        self._fork, self._cells = fork, {}
        self._facts = [facts for rule in fork.rules_in_arrays if (facts := getattr(rule, "facts_in_game", None))]
        has_reserved = not self._state.roster.is_first.all()
        for number in self.agents.tolist():
            agent = self._state.roster.agents[number]
            needs_game = has_reserved or fork.has_own_strategy(agent)
            for name, sensor in getattr(agent, "sensors", {}).items():
                if _is_in_arrays(sensor, agent):
                    self._cells.setdefault(name, {})[number] = [None]
                elif not _sees_from_node(sensor):
                    needs_game = True
            self._needs_game[number] = needs_game

    def _shown(self, view: ArrayView, name: str, cells: Mapping[int, object]) -> list[dict[str, int]]:
        """Return what a sensor shows to agents, as `data` has it, game by game; nothing to those without one."""
        whom = np.array([number for number in view.agents.tolist() if number in cells], np.int64)
        width = len(view.agents)
        if not len(whom):
            return [{}] * (len(view.games) * width)
        found = view.of(whom).seen(name)
        rank = self._context.fork.rank
        looking = found.at * width + np.searchsorted(view.agents, whom)[found.viewers]
        order = np.lexsort((rank[found.others], looking))
        names = [view.roster.names[number] for number in found.others[order].tolist()]
        nodes = view.streets.ids(found.nodes[order]).tolist()
        ends = np.cumsum(np.bincount(looking, minlength=len(view.games) * width)).tolist()
        return [dict(zip(names[a:b], nodes[a:b], strict=True)) for a, b in pairwise([0, *ends])]


def _see_nothing(_: int) -> None:
    """Leave what a sensor shows as arrays have said."""


def _is_in_arrays(sensor: ISensor, agent: IAgent) -> bool:
    """Whether arrays say what a sensor that shows agents has in its `data`."""
    look = look_of(sensor, agent)
    return look is not None and not look.errs


def _sees_from_node(sensor: ISensor) -> bool:
    """Whether what a sensor shows follows from the node that it looks from."""
    look = sensor.nodes_in_arrays() if sensor.type in SHOWING_NODES and hasattr(sensor, "nodes_in_arrays") else ""
    return not isinstance(look, str) and not look.turns


def _draws_elsewhere(sensor: ISensor, agent: IAgent) -> bool:
    """Whether what a sensor shows follows from draws or looks that only the turn engine counts."""
    return not _is_in_arrays(sensor, agent) and hasattr(sensor, "notice") and bool(sensor.notice.needs_look)


def why_not_asked(game: PlayedGame, agents: Sequence[IAgent], num_games: int) -> str | None:
    """Return why agents cannot be asked one by one in so many games in arrays, in words; None: they can."""
    settings = game.settings()
    sensors = [(agent, sensor) for agent in agents for sensor in getattr(agent, "sensors", {}).values()]
    is_plain = all(agent.type is not AgentType.AERIAL and agent.speed is None for agent in agents)
    closes = any(getattr(agent.strategy, "__closure__", agent.strategy) is not None for agent in agents)
    fewest = FEWEST_IN_CONTEXT if closes else FEWEST
    reasons = [
        (not is_plain or settings["speed_unit"] != "edges" or settings["legal"] != "edges", "moves of several edges"),
        (any(agent.team in settings["plans"] for agent in agents), "a plan"),
        (any(hasattr(agent.strategy, "prepare") for agent in agents), "what it prepares in a game"),
        (not all(getattr(sensor, "sees_world_only", False) for _, sensor in sensors), "sensors that may see more"),
        (any(_draws_elsewhere(sensor, agent) for agent, sensor in sensors), "sensors that err or report late"),
        (game.ctx.agent.block.has_arrays, "agents of a team in arrays"),
        (not settings["team_memory"], "team_memory=False"),
        (bool(settings["channels"]), "channels"),
        (num_games < fewest, f"fewer than {fewest} games"),
    ]
    return next((why for is_so, why in reasons if is_so), None)
