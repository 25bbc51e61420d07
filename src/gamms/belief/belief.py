"""The belief of an agent about others: where they were seen last, where they can be, and where they probably are."""

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from hashlib import blake2b
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from gamms.arguments import as_context, as_items, as_name, as_range
from gamms.belief.evidence import (
    HORIZON,
    ExactPosition,
    Observation,
    ObservedNodes,
    Sighting,
    TurnObservations,
    find_last_sightings,
    get_ground_agent,
    get_required,
    is_by_metres,
    join_turns,
    note_senses,
)
from gamms.belief.filter import list_by_node
from gamms.belief.ground import BeliefMap, get_belief_map
from gamms.belief.motion import Motion, as_motion, convert_evidence, get_chain, random_walk
from gamms.belief.reach import ReachBounds, ReachByTurns
from gamms.context import Context
from gamms.core import belief as core
from gamms.errors import TooLarge
from gamms.game.movement.travel import get_mode_graph
from gamms.ir.graph import FloatArray, IntArray, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.typing import IAgent
from gamms.typing.game import AerialState, State
from gamms.visual.appearance import Rgb, find_color_table
from gamms.visual.constants import Layer
from gamms.visual.drawers.graph import render_values
from gamms.visual.drawing import get_drawing
from gamms.visual.legend import ColoredValues, ColorScale, LegendRow, LegendRows

_MOST_BYTES = 1 << 27  # approximate size of the cached results for one map
_MARK = 16  # one in this many turns is cached
_MOST_TURNS = 100_000  # of a game, each of which takes microseconds and bytes in every call
_FAINT = 0.01  # share of the highest probability below which nothing is drawn
# a color, and the sum of the channels of a medium grey
_CAN_BE = (150, 110, 190)
_DARK = 384

Found = tuple[int, int, float]  # row of a node, row of the end of the edge, metres from the node
_UNSEEN: Found = (core.IS_UNSEEN, core.IS_ANYWHERE_ON_NODE, 0.0)
_NOTHING: tuple[IntArray, FloatArray] = (np.zeros(0, np.int64), np.zeros(0))  # that a look covers

StateArray = np.ndarray[Any, Any]  # (targets, states)  numbers, or whether a target can be in a state
Moving = Callable[[StateArray, int], StateArray]  # to a turn
Looking = Callable[[StateArray, int, list[Observation]], StateArray]  # in a turn

# By map, which contexts share with their forks: planners compute beliefs in a new fork each turn.
_worked_out: WeakKeyDictionary[BeliefMap, OrderedDict[bytes, FloatArray]] = WeakKeyDictionary()


def observe(ctx: Context, state: State | AerialState, *, share: bool = True, horizon: int = HORIZON) -> "Belief":
    """Record the agents of other teams that the sensors show, and return the resulting belief.

    Call it in every turn. Observations are stored in `state["memory"]`, one short text per turn.

    Args:
        ctx: the context.
        state: state of the agent, in its strategy.
        share: whether to write the observation to `state["team_memory"]`, too: teammates know it in the next turn.
        horizon: minimum number of turns for which nodes without agents are remembered. Last sightings are never
            forgotten.

    Raises:
        MissingKey (KeyError): in a custom loop, the state has no name, team, turn or memory.
    """
    note_senses(ctx, state, share=share, horizon=horizon)
    return believed(ctx, state)


def believed(ctx: Context, state: State | AerialState) -> "Belief":
    """Return the belief from the memories of an agent and its team, without new observations."""
    memories = get_required(state, "memory"), state.get("team_memory", {})
    return Belief(as_context(ctx, "believed"), join_turns(*memories), state["turn"], state.get("time", 0.0))


def belief_of(ctx: Context, observer: str) -> "Belief":
    """Return the belief of an agent between two turns, for rules, drawers and tests.

    Raises:
        UnknownName (KeyError): the agent does not exist.
    """
    team = getattr(as_context(ctx, "belief_of").agent.get_agent(observer), "team", None)
    shared = {} if team is None else ctx.game.team_memories.get(team, {})
    return Belief(ctx, join_turns(ctx.game.memories.get(observer, {}), shared), ctx.game.turn)


class Belief:
    """A belief about other agents, computed from observations; made by `observe`, `believed` and `belief_of`.

    Args:
        ctx: the context.
        turns: observations by turn.
        turn: the present turn.
        time: elapsed share of the turn, if agents decide at arrivals.

    Attributes:
        turn: the turn.
    """

    def __init__(self, ctx: Context, turns: Mapping[int, TurnObservations], turn: int, time: float = 0.0) -> None:
        self._ctx = ctx
        self.turn = turn
        self._time = time
        self._turns = {then: seen for then, seen in turns.items() if then <= turn}
        self._now: dict[bytes, FloatArray] = {}  # cached results

    @cached_property
    def last_seen(self) -> dict[str, Sighting]:
        """Agent -> its last sighting: where, in which turn and by whom."""
        return find_last_sightings(self._turns)

    # -- possible positions
    # ---------------------------------------------------------------------------------------

    def reachable(self, target: str, speed: float | None = None) -> set[int]:
        """Return the ids of all nodes on which a target of another team can be.

        The target has moved at most at its speed along edges that were open at some time since it was last seen, and
        was never on a node on which a sensor would have shown it for certain. In games by metres a node also stands for
        the edges that leave it, so an empty node in view excludes nothing.

        Args:
            target: name of an agent on the ground, of another team than the observer: sensors do not report mates, so
                the result for a mate is wrong. The result for a dead agent is empty.
            speed: edges or metres per turn; None: the speed of the agent, or one edge if it has none. If the speed
                changes, give its maximum.

        Raises:
            UnknownName (KeyError): the agent does not exist.
            BadType: the agent flies.
            TooLarge: the game is at a turn beyond 100,000.
        """
        return set(get_belief_map(self._ctx.graph.columns()).list_ids(self.are_reachable([target], speed)[0]))

    def are_reachable(self, targets: Sequence[str], speed: float | None = None) -> BoolArray:
        """Return `reachable` of several targets, a mask (targets, nodes), with nodes as in `ctx.graph.columns()`."""
        agents = [get_ground_agent(self._ctx, name) for name in as_items(targets, "targets", "names")]
        paces = [getattr(agent, "speed", None) if speed is None else as_range(speed, "speed") for agent in agents]
        game = None if self._ctx.current_game is None else self._ctx.game
        in_metres = is_by_metres(self._ctx)
        turns = game.turn_seconds if game is not None and game.speed_unit == "metres_per_second" else 1.0
        found = np.zeros((len(agents), get_belief_map(self._ctx.graph.columns()).size), bool)
        # An agent without a speed moves along one edge of any length, even if other agents use metres.
        kinds = [(pace is not None, _get_mode(agent)) for agent, pace in zip(agents, paces, strict=True)]
        for has_pace, mode in dict.fromkeys(kinds):
            lines = [line for line, kind in enumerate(kinds) if kind == (has_pace, mode)]
            names = tuple(targets[line] for line in lines)
            attribute, obeys_turns = (None, False) if mode is None else split_mode(mode)
            if obeys_turns and not has_pace:
                found[lines] = self._find_reached_nodes_with_turns(names, str(attribute))
                continue
            speeds = [(paces[line] or 0.0) * turns for line in lines]
            # with a speed, turn restrictions exclude nothing here
            labels = self._find_reached_nodes(
                names, speeds if has_pace else [1.0] * len(lines), attribute, has_pace and in_metres
            )
            found[lines] = labels > -np.inf
        found[[not getattr(agent, "alive", True) for agent in agents]] = False
        return found

    def _get_map(self, mode: str | None) -> BeliefMap:
        """Return the map of the edges that targets of a mode may use."""
        return get_belief_map(get_mode_graph(self._ctx, mode).columns())

    def _find_reached_nodes(
        self, targets: tuple[str, ...], speeds: list[float], mode: str | None, in_metres: bool
    ) -> FloatArray:
        """Return labels (targets, nodes) of the nodes that targets can have reached; see `ReachBounds`."""
        ground = self._get_map(mode)
        closed = tuple((turn, arc) for turn, seen in self._turns.items() for arc in seen.closed)
        is_free = self._ctx.current_game is not None and self._ctx.game.legal == "any"
        # An agent without a speed moves along a whole edge per turn, and is between nodes only within a turn.
        are_on_edges = in_metres or (is_by_metres(self._ctx) and self._ctx.game.decide == "arrival")
        reach = ReachBounds(
            ground, np.array(speeds), in_metres=in_metres, are_on_edges=are_on_edges, is_free=is_free, closed=closed
        )

        def look(labels: FloatArray, turn: int, seen: list[Observation]) -> FloatArray:
            return reach.observe(labels, turn, seen, targets)

        key = ("reach", ground.digest, targets, speeds, in_metres, are_on_edges, is_free, closed)
        labels = self._apply_turns(key, reach.make_full_reach(0), reach.advance, look)
        return reach.advance(labels, self.turn + 1, self._time) if self._time else labels

    def _find_reached_nodes_with_turns(self, targets: tuple[str, ...], mode: str) -> BoolArray:
        """Return the nodes (targets, nodes) that targets can have reached who obey the turn restrictions of a mode.

        Where roads were closed meanwhile, other turns were legal: then restrictions exclude nothing.
        """
        if any(seen.closed for seen in self._turns.values()):
            return self._find_reached_nodes(targets, [1.0] * len(targets), mode, in_metres=False) > -np.inf
        ground = get_belief_map(self._ctx.graph.columns())
        reach = ReachByTurns(ground, len(targets), mode)

        def move(states: BoolArray, _: int) -> BoolArray:
            return reach.advance(states)

        def look(states: BoolArray, _: int, seen: list[Observation]) -> BoolArray:
            return reach.observe(states, seen, targets)

        key = ("reach with turns", ground.digest, targets, mode)
        return reach.find_nodes(self._apply_turns(key, reach.make_full_reach(), move, look))

    # -- probable positions
    # -----------------------------------------------------------------------------------------

    def probability(self, target: str, motion: Motion | None = None) -> dict[int, float]:
        """Return node -> probability that a target is there, without impossible nodes.

        The probabilities follow from Bayes' rule with all stored observations, for a target that was anywhere at turn
        0. An observation that the model of motion excludes restarts the belief.

        Args:
            target: name of an agent on the ground; the result for a dead agent is empty.
            motion: model of its motion; None: `random_walk()`.

        Raises:
            UnknownName (KeyError): the agent does not exist.
            BadType: the agent flies, or the motion is not a model.
            TooLarge: the game is at a turn beyond 100,000.
        """
        return list_by_node(get_belief_map(self._ctx.graph.columns()), self.probabilities([target], motion)[0])

    def probabilities(self, targets: Sequence[str], motion: Motion | None = None) -> FloatArray:
        """Return `probability` of several targets, (targets, nodes), with the nodes as in `ctx.graph.columns()`."""
        agents = [get_ground_agent(self._ctx, name) for name in as_items(targets, "targets", "names")]
        model = random_walk() if motion is None else as_motion(motion, "motion")
        kinds = [(self._get_metres_per_turn(agent), _get_mode(agent)) for agent in agents]
        if len(set(kinds)) == 1:
            found = self._filter_probabilities(tuple(targets), model, *kinds[0])
        else:
            found = np.zeros((len(agents), get_belief_map(self._ctx.graph.columns()).size))
            for kind in dict.fromkeys(kinds):
                lines = [line for line, one in enumerate(kinds) if one == kind]
                found[lines] = self._filter_probabilities(tuple(targets[line] for line in lines), model, *kind)
        found[[not getattr(agent, "alive", True) for agent in agents]] = 0.0
        return found

    def _get_metres_per_turn(self, agent: IAgent) -> float | None:
        """Return the metres that an agent moves per turn; None if it moves from node to node."""
        speed = getattr(agent, "speed", None)
        if speed is None or not is_by_metres(self._ctx):
            return None
        return float(speed) * (self._ctx.game.turn_seconds if self._ctx.game.speed_unit == "metres_per_second" else 1.0)

    def _filter_probabilities(
        self, names: tuple[str, ...], model: Motion, metres: float | None, mode: str | None
    ) -> FloatArray:
        """Return the probability of each node (targets, nodes), for targets of equal speed and mode."""
        attribute, obeys_turns = (None, False) if mode is None else split_mode(mode)
        turns = attribute if obeys_turns else None
        ground = self._get_map(None if obeys_turns else mode)
        chain = get_chain(model, ground, metres, turns)

        def move(masses: FloatArray, _: int) -> FloatArray:
            return chain.predict(masses, model.steps)

        def look(masses: FloatArray, _: int, seen: list[Observation]) -> FloatArray:
            found: FloatArray = chain.apply_evidence(
                masses[None], *_convert_observations(ground, names, seen, metres or 0.0)
            )[0][0]
            return found

        key = ("probable", ground.digest, names, model.name, model.steps, metres, turns)
        start = np.tile(chain.shares / ground.size, (len(names), 1))
        return chain.sum_by_node(self._apply_turns(key, start, move, look))

    def _apply_turns(self, key: object, start: StateArray, move: Moving, look: Looking) -> StateArray:
        """Apply turns and observations to a start state, continuing from the last cached turn.

        The cache key of a turn is a digest of everything before it, so that cached results never become invalid.

        Raises:
            TooLarge: the present turn is beyond the turns that a belief can follow.
        """
        if self.turn > _MOST_TURNS:
            raise TooLarge(
                f"A belief follows all turns of a game, at most {_MOST_TURNS:,}, and this is turn {self.turn:,}. "
                "Reset the game, or play it without strategies that ask for beliefs."
            )
        digests = [blake2b(repr(key).encode(), digest_size=16).digest()]
        for turn in range(self.turn + 1):
            seen = self._turns.get(turn)
            digests.append(blake2b(digests[-1] + (seen.digest if seen else b""), digest_size=16).digest())
        if digests[-1] in self._now:
            return self._now[digests[-1]]
        kept = _worked_out.setdefault(get_belief_map(self._ctx.graph.columns()), OrderedDict())
        begin = next((turn for turn in range(self.turn, 0, -1) if digests[turn] in kept), 0)
        value = kept[digests[begin]] if begin else start
        for turn in range(begin, self.turn + 1):
            if turn > begin:
                value = move(value, turn)
                # The observations of a turn are left out: teammates share the state before it, but
                # not the observations of it.
                if turn == self.turn or turn % _MARK == 0:
                    kept[digests[turn]] = value
            seen = self._turns.get(turn)
            if seen is not None and seen.observations:
                value = look(value, turn, seen.observations)
        while len(kept) > max(_MARK, _MOST_BYTES // max(1 << 10, value.nbytes)):
            kept.popitem(last=False)
        self._now[digests[-1]] = value
        return value


def _get_mode(agent: IAgent) -> str | None:
    """Return the mode of an agent, by which it may use edges; None: all edges."""
    return getattr(agent, "mode", None)


def _convert_observations(
    ground: BeliefMap, targets: Sequence[str], seen: list[Observation], metres: float
) -> tuple[core.Evidence, IntArray]:
    """Return the observations of a turn in the form of `MotionChain.apply_evidence`.

    A look excludes a part of an edge only if it covers both ends, and the edge is straight. `metres` is the distance
    that the targets move per turn: targets seen within the turn had not moved so far at its beginning.
    """
    looks = [look for one in seen for look in one.looks]
    covered = [_find_missed_nodes(ground, look) for look in looks]
    ends = np.cumsum([0, *(len(rows) for rows, _ in covered)])
    rows, missed = (np.concatenate(parts) for parts in zip(_NOTHING, *covered, strict=True))
    shown = np.array([name not in look.not_shown for look in looks for name in targets], np.bool_)
    found = {name: (ground.find_row(node), one.places.get(name)) for one in seen for name, node in one.found.items()}
    places = [_make_found(ground, *found[name], metres) if name in found else _UNSEEN for name in targets]
    nodes, *on_edges = zip(*places, strict=True)
    kinds = [_get_kind(look) for look in looks]
    evidence = convert_evidence(
        ends, (rows, missed), shown, np.array([nodes], np.int64), kinds, (on_edges[0], on_edges[1])
    )
    return evidence, np.array([0, len(looks)])


def _find_missed_nodes(ground: BeliefMap, look: ObservedNodes) -> tuple[IntArray, FloatArray]:
    """Return the rows of the nodes that a look covers, and the probability that it misses an agent there."""
    rows = np.arange(ground.size) if look.node_ids is None else ground.find_rows(look.node_ids)
    is_there = rows >= 0
    return rows[is_there], (1.0 - np.broadcast_to(look.detection, rows.shape))[is_there]


def _get_kind(look: ObservedNodes) -> int:
    if not look.is_convex:
        return core.LOOKS_AT_NODES
    return core.LOOKS_ALONG_EDGES if look.node_ids is None else core.LOOKS_ALONG_STRAIGHT_EDGES


def _make_found(ground: BeliefMap, row: int, place: ExactPosition | None, metres: float) -> Found:
    """Return the position of a target that was seen."""
    if row < 0:
        return core.IS_UNKNOWN, core.IS_ANYWHERE_ON_NODE, 0.0
    if place is None:
        return row, core.IS_ANYWHERE_ON_NODE, 0.0
    gone = place.time * metres if np.isfinite(metres) else 0.0
    return row, -1 if place.edge is None else ground.find_row(place.edge[1]), place.offset_m - gone


def artist(observer: str, target: str, motion: Motion | None = None, *, can_be: bool = False) -> dict[str, Any]:
    """Return an artist for `ctx.visual.add_artist` that shows the belief of an agent about another one.

    Args:
        observer: name of the agent whose belief is shown.
        target: name of the agent that the belief is about.
        motion: model of the target's motion; None: `random_walk()`.
        can_be: whether to show all possible nodes instead of probabilities.

    Raises:
        BadType: the motion is not a model, or a name is not a string.
    """
    for name in (observer, target):
        as_name(name, "an agent")
    model = random_walk() if motion is None else as_motion(motion, "motion of artist")

    def chances_of(ctx: Context) -> tuple[dict[int, float], float]:
        """Return the shown value of each node, and the highest value."""
        belief = belief_of(ctx, observer)
        found = dict.fromkeys(sorted(belief.reachable(target)), 1.0) if can_be else belief.probability(target, model)
        most = max(found.values(), default=1.0)
        return {node: chance for node, chance in found.items() if chance >= _FAINT * most}, most

    def colors_of(ctx: Context) -> tuple[Rgb, ...]:
        if can_be:
            return (_CAN_BE,)
        return (
            find_color_table("magma")
            if sum(get_drawing(ctx).theme.background[:3]) < _DARK
            else find_color_table("magma")[::-1]
        )

    def draw(ctx: Context, data: dict[str, Any]) -> None:  # noqa: ARG001 - the arguments of every drawer
        chances, most = chances_of(ctx)
        colors = colors_of(ctx)
        places = np.rint(np.array([*chances.values()]) / most * (len(colors) - 1)).astype(np.int64)
        ids = np.array([*chances], np.int64)
        render_values(ctx, {"values": ColoredValues("nodes", ids, colors, places, None)})

    def legend(ctx: Context) -> ColorScale | LegendRows:
        if can_be:
            return LegendRows("", (LegendRow(_CAN_BE, f"{target} can be here"),))
        _, most = chances_of(ctx)
        return ColorScale(
            f"{target}, as {observer} believes", colors_of(ctx)[::12], "0", f"{most / 2:.3g}", f"{most:.3g}"
        )

    draw.__dict__["once_a_turn"] = True  # beliefs are not animated between turns
    return {"drawer": draw, "layer": Layer.VALUES, "legend": legend}
