"""Strategies that react to visible enemies."""

from collections.abc import Iterable, Sequence
from math import inf

import numpy as np

from gamms import belief, kernels
from gamms.arguments import as_context, as_items, as_range, show_as_call
from gamms.belief.motion import as_motion
from gamms.context import Context
from gamms.core import strategies as core
from gamms.core.belief import find_likeliest
from gamms.deciding import get_phase
from gamms.game.movement.routes import RoutesFromNodes
from gamms.game.strategy_specs import CoreStep
from gamms.ir.agents import are_mates
from gamms.ir.graph import FloatArray, IntArray
from gamms.strategies.knowledge import (
    as_known_node,
    as_otherwise,
    check_nodes,
    find_enemies_in_sight,
    find_mates_in_sight,
    get_graph,
    get_graph_of_mode,
    get_node,
    list_legal_on_map,
    move_on,
    move_to,
    move_to_agent,
    offer_steps,
    step_towards,
)
from gamms.strategies.paces import (
    Pace,
    convert_to_turns,
    count_turns,
    count_turns_from,
    count_turns_to,
    find_pace,
    group_by_pace,
)
from gamms.strategies.travel import random_walk, stay
from gamms.typing import AgentType, IContext
from gamms.typing.game import NodeId, State, Strategy
from gamms.typing.routes import get_cached, get_cached_in_moment

_FEW = 8  # number of enemies from which the nearest is found by a search
_NEAR_TURNS = 8.0  # turns within which an agent first searches for a meeting point

Paces = dict[Pace, dict[str, int]]  # nodes of visible agents by name, grouped by pace


@show_as_call
def chase(ctx: IContext, otherwise: Strategy | None = random_walk) -> Strategy:
    """Move toward the nearest visible enemy by road distance; ties go to the first name.

    Args:
        ctx: the context.
        otherwise: the strategy to use if no enemy is visible, or there is no path; None sets no action.
    """
    as_context(ctx, "chase")
    fallback = as_otherwise(otherwise, "chase")

    def strategy(state: State) -> None:
        here = get_node(state, "chase")
        enemies = find_enemies_in_sight(ctx, state, "chase")
        nearest = get_graph(ctx, state).routes.nearest(here, enemies.values())
        move_to_agent(ctx, state, nearest, enemies, fallback, "chase")

    offer_steps(strategy, CoreStep("chase"), fallback)
    return strategy


@show_as_call
def flee(ctx: IContext, otherwise: Strategy | None = stay) -> Strategy:
    """Go to the legal node, maybe the agent's own, that is farthest by road from the nearest visible enemy.

    Distances are measured from the enemy to the node. Ties go to the lowest node id.

    Args:
        ctx: the context.
        otherwise: the strategy to use if no enemy is visible; None sets no action.
    """
    as_context(ctx, "flee")
    fallback = as_otherwise(otherwise, "flee")

    def strategy(state: State) -> None:
        get_node(state, "flee")
        threats = set(find_enemies_in_sight(ctx, state, "flee").values())
        if threats:
            legal = list_legal_on_map(ctx, state)
            routes = get_graph(ctx, state).routes
            distances = np.array(routes.distances_from_nearest(threats, legal), np.float64)
            ids = np.array(legal, np.int64)
            state["action"] = legal[
                core.find_farthest(kernels.as_buffer(distances), kernels.as_buffer(ids), len(legal))
            ]
        else:
            fallback(state)

    offer_steps(strategy, CoreStep("flee"), fallback)
    return strategy


@show_as_call
def guard(ctx: IContext, node: NodeId, radius: float) -> Strategy:
    """Stay near a node, the post, and go after visible enemies that come near it; it always sets an action.

    An enemy is near if its road distance to the post is at most `radius`. The agent goes to the nearest such enemy by
    road; ties go to the first name. It never leaves the radius, but waits at its border. If no enemy is near, or the
    agent is outside the radius, it returns to the post.

    Args:
        ctx: the context.
        node: the post.
        radius: metres, or the unit of the lengths of the edges; may be infinite.

    Raises:
        UnknownName (KeyError), BadType, BadValue: the post is not on the map, or the radius is not a distance.
    """
    as_context(ctx, "guard")
    post = as_known_node(ctx, node, "node of guard")
    reach = as_range(radius, "radius of guard")

    def strategy(state: State) -> None:
        here = get_node(state, "guard")
        graph = get_graph(ctx, state)

        def is_near(place: int) -> bool:
            far: float = graph.distance(place, post)
            return far <= reach

        enemies = {name: at for name, at in find_enemies_in_sight(ctx, state, "guard").items() if is_near(at)}
        target = graph.routes.nearest(here, enemies.values()) if is_near(here) else None
        if target is None:
            move_to(ctx, state, post, stay, "guard")
        else:
            step = step_towards(ctx, state, target, "guard", is_near)
            state["action"] = here if step is None else step

    return strategy


@show_as_call
def intercept(
    ctx: Context, goals: Iterable[NodeId] | None = None, otherwise: Strategy | None = random_walk
) -> Strategy:
    """Cut off a visible enemy instead of following it.

    With goals, each enemy is assumed to take the shortest path to its nearest goal: the agent goes to the node of such
    a path that it reaches no later than the enemy, and among these to the one that it reaches first. If there is none,
    it goes to the node for which it is least late.

    Without goals, it moves toward the nearest enemy. Among several shortest paths it takes the one that leaves the
    enemy the fewest nodes which the enemy reaches before the agent and its visible teammates: the smallest Voronoi cell
    (Huang, Zhang, Ding, Stipanovic, Tomlin: Guaranteed decentralized pursuit-evasion in the plane with multiple
    pursuers, CDC 2011). Minimizing the cell alone would end in a standoff.

    Args:
        ctx: the context.
        goals: ids of the goals of enemies; None: unknown.
        otherwise: the strategy to use if no enemy is visible; None sets no action.

    Raises:
        UnknownName (KeyError), BadType, BadValue: a goal is not on the map, or there are no goals.
    """
    as_context(ctx, "intercept")
    ends = None if goals is None else check_nodes(ctx, goals, "intercept", "goals")
    fallback = as_otherwise(otherwise, "intercept")

    def strategy(state: State) -> None:
        get_node(state, "intercept")
        enemies = find_enemies_in_sight(ctx, state, "intercept")
        if enemies and ends is None:
            state["action"] = _find_confining_node(ctx, state, enemies)
        else:
            meeting = _find_meeting_node(ctx, state, enemies, ends or ()) if enemies else None
            move_to(ctx, state, meeting, fallback, "intercept")

    offer_steps(strategy, None, fallback)
    return strategy


@show_as_call
def safest_exit(ctx: Context, exits: Iterable[NodeId], otherwise: Strategy | None = stay) -> Strategy:
    """Go to the exit that the agent reaches with the greatest lead over any visible enemy, and stay there.

    It looks one step ahead: among the legal nodes that no visible enemy can reach in this turn, it goes to the node
    with the greatest lead at an exit, then to the one nearest to this exit. If no enemy is visible, it goes to the
    nearest exit.

    Args:
        ctx: the context.
        exits: ids of the exit nodes.
        otherwise: the strategy to use if no exit can be reached; None sets no action.

    Raises:
        UnknownName (KeyError), BadType, BadValue: an exit is not on the map, or there are no exits.
    """
    as_context(ctx, "safest_exit")
    ends = check_nodes(ctx, exits, "safest_exit", "exits")
    fallback = as_otherwise(otherwise, "safest_exit")

    def strategy(state: State) -> None:
        here = get_node(state, "safest_exit")
        enemies = find_enemies_in_sight(ctx, state, "safest_exit")
        paces = group_by_pace(ctx, enemies)
        first, reached = get_cached(
            ctx.graph.routes,
            ("safest_exit", state["team"], ends),
            paces,
            lambda: (_find_first_arrivals(ctx, paces, ends), _find_nodes_in_reach(ctx, paces)),
        )
        weight, speed, _ = find_pace(ctx, state.get("name"))
        graph = get_graph(ctx, state)

        def lead(node: int) -> tuple[float, float, int]:
            own = {end: count_turns(move_on(graph, node).distance(node, end, weight), speed) for end in ends}
            return max((first[end] - far if far < inf else -inf, -far, -node) for end, far in own.items())

        if here in ends:
            state["action"] = here
        elif lead(here)[1] == -inf:
            fallback(state)
        else:
            legal = list_legal_on_map(ctx, state)
            state["action"] = max([node for node in legal if node not in reached] or legal, key=lead)

    offer_steps(strategy, None, fallback)
    return strategy


@show_as_call
def follow_belief(
    ctx: Context,
    targets: Iterable[str] | None = None,
    motion: belief.Motion | None = None,
    otherwise: Strategy | None = random_walk,
) -> Strategy:
    """Search for enemies where they most probably are, from the observations of the agent and its team.

    It updates a belief with `gamms.belief.observe` in every turn, and goes to the node with the highest probability per
    turn of travel: the greedy search of Bourgault, Furukawa, Durrant-Whyte (Coordinated decentralized search for a lost
    target in a Bayesian world, IROS 2003).

    Args:
        ctx: the context.
        targets: names of agents on the ground; None: all living agents of other teams.
        motion: model of their motion; None: `gamms.belief.random_walk()`.
        otherwise: the strategy to use if there is no agent to search for; None sets no action.

    Raises:
        BadType: `targets` are not names, or `motion` is not a model.
    """
    as_context(ctx, "follow_belief")
    model = belief.random_walk() if motion is None else as_motion(motion, "motion of follow_belief")
    wanted = None if targets is None else [str(name) for name in as_items(targets, "targets", "names")]
    fallback = as_otherwise(otherwise, "follow_belief")

    def strategy(state: State) -> None:
        here = get_node(state, "follow_belief")
        known = belief.observe(ctx, state)
        names = _list_living_enemies(ctx, state) if wanted is None else wanted
        chances = known.probabilities(names, model).sum(axis=0)
        weight, speed, _ = find_pace(ctx, state["name"])
        far = get_graph(ctx, state).distance_matrix([here], ctx.graph.columns().node_ids, weight)
        turns = convert_to_turns(far, speed)[0]
        row = find_likeliest(kernels.as_buffer(chances), kernels.as_buffer(turns), 0, len(turns))
        node = None if row < 0 else int(ctx.graph.columns().node_ids[row])
        move_to(ctx, state, node, fallback, "follow_belief")

    offer_steps(strategy, None, fallback)
    return strategy


# -- targets of moves
# -------------------------------------------------------------------------------------------------


def _find_meeting_node(ctx: Context, state: State, enemies: dict[str, int], goals: tuple[int, ...]) -> int | None:
    """Return the node on the likely path of an enemy that the agent reaches in time, and first among these."""
    paces = group_by_pace(ctx, enemies)
    nodes, of, arrivals = get_cached(
        ctx.graph.routes, ("intercept", state["team"], goals), paces, lambda: _find_likely_paths(ctx, paces, goals)
    )
    here = state["curr_pos"]
    # The nearest such node is best, so most agents need to search only nearby nodes.
    near = _count_turns(ctx, state, here, nodes)[of]
    late = np.maximum(0.0, near - arrivals)
    best = np.lexsort((of, near, late))[0]
    if late[best] > 0.0 or kernels.widen_distance(near[best]) >= _NEAR_TURNS:
        weight, speed, _ = find_pace(ctx, state.get("name"))
        own = convert_to_turns(get_graph(ctx, state).distance_matrix([here], nodes, weight), speed)[0][of]
        late = np.maximum(0.0, own - arrivals)
        best = np.lexsort((of, own, late))[0]
    return int(nodes[of[best]]) if late[best] < inf else None


def _count_turns(ctx: Context, state: State, source: int, nodes: IntArray) -> FloatArray:
    """Return the turns that an agent needs to nodes, ascending, but infinite for nodes that are far."""
    weight, speed, _ = find_pace(ctx, state.get("name"))
    found = np.full(len(nodes), inf)
    if len(nodes) > 1 and 0.0 < speed < inf:
        near = get_graph(ctx, state).distances(source, weight=weight, cutoff=_NEAR_TURNS * speed)
        ids = np.fromiter(near, np.int64, len(near))
        far = np.fromiter(near.values(), np.float64, len(near))
        at = np.minimum(np.searchsorted(nodes, ids), len(nodes) - 1)
        is_asked = nodes[at] == ids
        found[at[is_asked]] = convert_to_turns(far[is_asked], speed)
    return found


def _find_likely_paths(ctx: Context, paces: Paces, goals: Sequence[int]) -> tuple[IntArray, IntArray, FloatArray]:
    """Return ids of nodes, ascending; then for each node on an enemy's path its index there, and the arrival time."""
    options = list[tuple[int, float]]()
    for (weight, speed, mode), at in _list_places(paces):
        graph = get_graph_of_mode(ctx, mode)
        far, goal = min((count_turns(graph.distance(at, goal, weight), speed), goal) for goal in goals)
        if isinstance(graph, RoutesFromNodes):
            passed = graph.list_lengths(at, goal, weight) or [(at, 0.0)]
            options += [(node, count_turns(gone, speed)) for node, gone in passed]
            continue
        for node in graph.shortest_path(at, goal, weight) if far < inf else [at]:
            rest = count_turns(graph.distance(node, goal, weight), speed)
            options.append((node, far - rest if far < inf else 0.0))
    nodes, of = np.unique([node for node, _ in options], return_inverse=True)
    return nodes, of, np.array([arrival for _, arrival in options])


def _find_confining_node(ctx: Context, state: State, enemies: dict[str, int]) -> int:
    """Return the legal node nearest to the nearest enemy; ties are broken by the smallest Voronoi cell."""
    weight, speed, _ = find_pace(ctx, state.get("name"))
    graph = get_graph(ctx, state)
    name = _find_first_enemy(ctx, state["curr_pos"], enemies)
    far = {
        node: count_turns(move_on(graph, node).distance(node, enemies[name], weight), speed)
        for node in sorted(list_legal_on_map(ctx, state))
    }
    nearest = [node for node, turns in far.items() if turns == min(far.values())]
    if len(nearest) == 1:
        return nearest[0]
    nodes = ctx.graph.columns().node_ids
    each = [move_on(graph, node).distance_matrix([node], nodes, weight)[0] for node in nearest]
    own = 1.0 + convert_to_turns(np.array(each), speed)
    ids = nodes.tolist()
    theirs = count_turns_from(ctx, name, [enemies[name]])[0]
    for (weight, speed, mode), group in group_by_pace(ctx, find_mates_in_sight(ctx, state)).items():
        near = get_graph_of_mode(ctx, mode).distances([*group.values()], weight=weight)
        own = np.minimum(own, convert_to_turns(np.array([near.get(id, inf) for id in ids]), speed))
    sizes = (theirs < own).sum(axis=1).tolist()
    return min(zip(sizes, nearest, strict=True))[1]


def _find_first_enemy(ctx: Context, node: int, enemies: dict[str, int]) -> str:
    """Return the name of the enemy that needs the fewest turns from a node to its own node; ties go to the first."""
    names = list[str]()
    for (weight, speed, mode), group in group_by_pace(ctx, enemies).items():
        graph = get_graph_of_mode(ctx, mode)
        is_searched = len(group) > _FEW and 0.0 < speed < inf
        nearest = graph.routes.nearest(node, group.values(), weight) if is_searched else None
        if nearest is None:
            names += group
        else:  # enemies at equal distances, up to rounding, may need equal numbers of turns
            within = kernels.widen_distance(graph.distance(node, nearest, weight))
            near = graph.distances(node, weight=weight, cutoff=within)
            names += [name for name, at in group.items() if at in near]
    return min(sorted(names), key=lambda name: count_turns_to(ctx, name, node, enemies[name]))


def _find_first_arrivals(ctx: Context, paces: Paces, ends: Sequence[int]) -> dict[int, float]:
    """Return how many turns the fastest of some agents needs to reach each node of `ends`."""
    places = [(get_graph_of_mode(ctx, pace.mode), pace, at) for pace, at in _list_places(paces)]

    def turns(end: int) -> list[float]:
        return [count_turns(graph.distance(at, end, pace.weight), pace.speed) for graph, pace, at in places]

    return {end: min(turns(end), default=inf) for end in ends}


def _find_nodes_in_reach(ctx: Context, paces: Paces) -> set[int]:
    """Return the nodes that at least one of some agents can reach in this turn."""
    near = [
        get_graph_of_mode(ctx, mode).distances([*group.values()], weight=weight, cutoff=speed)
        for (weight, speed, mode), group in paces.items()
    ]
    return set[int]().union(*near)


def _list_places(paces: Paces) -> list[tuple[Pace, int]]:
    """Return the distinct pairs of pace and node of agents."""
    return [(pace, at) for pace, group in paces.items() for at in sorted(set(group.values()))]


# -- targets of searches ---------------------------------------------------------------------------------------------


def _list_living_enemies(ctx: Context, state: State) -> list[str]:
    """Return the names of the living enemies on the ground, sorted."""
    team = state["team"]
    me = state["name"]

    def make() -> list[str]:
        return [
            name
            for name, one in sorted(ctx.agent.agents.items())
            if getattr(one, "alive", True)
            and one.type is not AgentType.AERIAL
            and not are_mates(team, getattr(one, "team", None))
        ]

    return [
        name for name in get_cached_in_moment(ctx.graph.routes, get_phase(ctx), ("enemies", team), make) if name != me
    ]
