"""Strategies that are written in arrays alone: in a game that is played alone they get a view of one game and agent."""

from collections.abc import Callable
from functools import partial, update_wrapper
from typing import Any, cast, overload
from weakref import WeakKeyDictionary

import numpy as np

from gamms.arguments import as_context
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.channels import Heard, Radio
from gamms.game.batch.columns import Roster
from gamms.game.batch.deeds import DeclaredDeeds
from gamms.game.batch.forms import F, form_declared
from gamms.game.batch.movement import Movement
from gamms.game.batch.sight import SHOWING_AGENTS, Seen
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import SHOWING_NODES, SeenNodes
from gamms.game.batch.view import ArrayStrategy, ArrayView, ViewDraws
from gamms.game.deeds import checked_value
from gamms.game.snapshots import GameInternals
from gamms.game.streets import Streets
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.context import HostContext

_KEPT = "array strategies"  # the key of `state["memory"]` that has what views keep
_LAST = "array strategies, last turn"  # that of the turn in which it was asked last, where it looks at others
_worlds: WeakKeyDictionary[Any, tuple[Any, Movement, dict[Any, Any]]] = WeakKeyDictionary()


@overload
def array_strategy(form: ArrayStrategy, /) -> Callable[[IContext], Callable[[Any], None]]: ...
@overload
def array_strategy(*, of: Callable[..., object]) -> Callable[[F], F]: ...
def array_strategy(form: ArrayStrategy | None = None, /, *, of: Callable[..., object] | None = None) -> Any:
    """Decorator: make a strategy of a function from an `ArrayView` to actions, for batches and for games alone.

    The name stands for a function that makes the strategy, as `gamms.strategies.chase` does: `strategy=hunt(ctx)`, or
    `strategies={"red": hunt}` in a scenario. The actions are the same in both; a batch asks once a turn for all agents.

    `@gamms.array_strategy(of=hurry)` declares the function as the array form of a strategy, or of the plan of a team,
    that is there already and plays in games alone; the name stands for the form then.

    Args:
        form: returns the numbers of legal nodes, (games, agents).
        of: the strategy or plan that does the same with a state, or with those of a team.

    Raises:
        BadType: one of them cannot be called.
    """
    if of is not None:
        return form_declared(of, "array_strategy")
    if not callable(form):
        raise BadType(f"array_strategy needs a function of a view, not {shown(form)}.")
    name = getattr(form, "__name__", "array strategy")

    def make(ctx: IContext) -> Callable[[Any], None]:
        as_context(ctx, name)
        internals = cast("HostContext", ctx).game.internals

        def strategy(state: dict[str, Any]) -> None:
            view = _ViewOfOne(ctx, state, internals)
            node = state["legal"][int(view.checked(form(view), name)[0, 0])]
            done = view.plain_deeds()
            state.get("outbox", []).extend(view.plain_outbox())
            state["action"] = {"node_id": node, "do": done} if done else node

        made: Any = update_wrapper(strategy, form)
        del made.__wrapped__
        form_declared(strategy, name)(form)
        return strategy

    documented: Any = update_wrapper(make, form)
    del documented.__wrapped__  # it takes a context, not a view
    return make


class _DrawsOfOne(ViewDraws):
    """The draws of `state["draw"]`, as those of a view."""

    def __init__(self, draw: Any) -> None:
        self._draw = draw
        super().__init__(np.zeros((1, 1), np.uint64), np.zeros(1, np.int64))

    def bits_of(self, counted: BoolArray | int) -> BitArray:
        """Return 64 random bits, if they count."""
        return np.array([[self._draw.bits() if np.any(counted) else 0]], np.uint64)


class _ViewOfOne(ArrayView):
    """What the state of one agent holds, as a view of one game with one agent."""

    def __init__(self, ctx: IContext, state: dict[str, Any], internals: GameInternals) -> None:
        roster, host = Roster.of(ctx.agent.agents.values()), cast("HostContext", ctx)
        movement, shared = _world(ctx)
        streets = movement.streets
        number, node = roster.names.index(state["name"]), streets.rows(state["curr_pos"])
        game = GameArrays(roster, movement, [ctx.seed], np.full((1, len(roster.names)), node))
        game.turn[0], game.facts, game.shared = state["turn"], state["facts"], shared
        game.blocked[0, number] = "in conflict" in (state.get("blocked") or "")
        game.kept = state["memory"].setdefault(_KEPT, {})
        super().__init__(game, np.zeros(1, np.int64), np.array([number]))
        self.draw = _DrawsOfOne(state["draw"])
        self._host, self._internals, self._memory = host, internals, state["memory"]
        self._sensed, self._inbox, self.deeds, self.outboxes = state["sensor"], state.get("inbox", ()), [], []
        known, columns, none = host.game.channels, streets.columns, np.zeros(len(roster.names), np.int64)
        if known:
            xyz = np.column_stack((columns.xy, np.zeros(len(columns.xy))))
            game.radio = Radio(known, roster, columns.node_ids, xyz, none, 1)
        check = partial(checked_value, ctx=host)
        game.deeds = DeclaredDeeds(state.get("deeds", {}), check, roster, streets, 1)
        legal = streets.ids(streets.legal[node][: int(self.counts[0, 0])])
        if legal.tolist() != list(state["legal"]):
            raise BadValue(
                f"Agent {shown(state['name'])} plays an array strategy, which goes along one edge in a turn: give it "
                "no speed, and leave ctx.game.legal as it is."
            )

    def of(self, agents: IntArray) -> ArrayView:
        """Return the view of other agents in the game, as a batch has it: what their sensors show is looked for again.

        Raises:
            BadValue: a strategy that keeps what it knows of others was not asked in the turn before.
        """
        own, here, memory = self._state, self.roster.agents, self._memory
        turn, name = int(self.turn[0]), self.roster.names[self.agents[0]]
        if own.kept and memory.get(_LAST, turn - 1) not in (turn - 1, turn):
            raise BadValue(
                f"Agent {shown(name)} was not asked since turn {memory[_LAST]}, and what it keeps of others is old: "
                "play this strategy in a batch, where it is asked in all turns."
            )
        memory[_LAST] = turn
        version = self._host.agent.structure_version
        if own.shared.get("of", (None,))[0] != version:
            own.shared["of"] = version, {}
        game = GameArrays(
            self.roster, self.movement, own.seeds, self.streets.rows([[one.current_node_id for one in here]])
        )
        game.alive[0], game.turn[0], game.facts = [one.alive for one in here], self.turn[0], own.facts
        blocked = self._internals.state.blocked
        game.blocked[0] = ["in conflict" in (blocked.get(name) or "") for name in self.roster.names]
        game.shared, game.kept, game.radio = own.shared["of"][1], own.kept, own.radio
        return ArrayView(game, self.games, agents)

    def plain_outbox(self) -> list[dict[str, Any]]:
        """Return what the agent sends, as `state["outbox"]` has it."""
        sent = [box for box in self.outboxes or () if len(box.at)]
        return [{"channel": box.channel, "to": box.to[0], "body": box.bodies[0]} for box in sent]

    def heard(self, channel: str) -> Heard:
        """Return what is in `state["inbox"]`."""
        if self._state.radio is None or channel not in self._state.radio.channels:
            raise UnknownName("channel", channel, () if self._state.radio is None else self._state.radio.channels)
        inbox = [message for message in self._inbox if message["channel"] == channel]
        none = np.zeros(len(inbox), np.int64)
        senders = np.array([self.roster.names.index(message["sender"]) for message in inbox], np.int64)
        turns = np.array([message["turn"] for message in inbox], np.int64)
        overheard = np.array([message["overheard"] for message in inbox], np.bool_)
        return Heard(none, none, senders, [message["body"] for message in inbox], turns, overheard)

    def plain_deeds(self) -> dict[str, dict[str, Any]]:
        """Return what the agent does besides moving, as `state["action"]` has it."""
        known, done = self._state.deeds, [one for one in self.deeds or () if len(one.at)]
        return {one.kind: {key: known.plain(one, key)[0] for key in one.values} for one in done}

    def looked(self, names: tuple[str, ...]) -> Seen:
        """Return what `state["sensor"]` shows."""
        found: dict[str, int] = {}
        for name, (kind, data) in self._sensed.items():
            if kind in SHOWING_AGENTS and (not names or name in names):
                found.update(data)
        own = self.roster.names[self.agents[0]]
        number = {name: i for i, name in enumerate(self.roster.names) if name in found and (names or name != own)}
        nodes = self.streets.rows([found[name] for name in number])
        none = np.zeros(len(number), np.int64)
        return Seen((1, 1, len(self.roster.names)), none, none, np.array([*number.values()], np.int64), nodes)

    def seen_nodes(self, *names: str) -> SeenNodes:
        """Return what `state["sensor"]` shows."""
        found = [np.zeros(0, np.int64)]
        for name, (kind, data) in self._sensed.items():
            if kind in SHOWING_NODES and (not names or name in names):
                found.append(self.streets.rows([*(data if isinstance(data, list) else data["nodes"])]))
        rows = np.concatenate(found)
        rows = np.unique(rows) if len(found) > 2 else rows
        none = np.zeros(len(rows), np.int64)
        return SeenNodes((1, 1, len(self.streets.counts)), none, none, rows)


def _world(ctx: IContext) -> tuple[Movement, dict[Any, Any]]:
    """Return the streets of a context, and what was worked out of them; made once for each revision of the graph."""
    revision = ctx.graph.graph.revision
    known = _worlds.get(ctx)
    if known is None or revision is None or known[0] != revision:
        known = _worlds[ctx] = revision, Movement(Streets(ctx.graph.columns(), ctx.graph.routes)), {}
    return known[1], known[2]
