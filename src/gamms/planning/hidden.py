"""Sample the positions of agents that are out of sight, from the observations of the planning agents and their team."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from gamms import belief, kernels
from gamms.belief.ground import get_belief_map, map_moves
from gamms.context import Context
from gamms.game.movement.travel import get_mode_graph
from gamms.ir.graph import FloatArray, split_mode
from gamms.typing import AgentType, IAgent
from gamms.typing.game import State
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND

_MOST_STEPS = 50  # steps of a teammate that was not seen for long; more change little


class HiddenPositions:
    """The planning agents' knowledge of other agents' positions, and samples of worlds that fit it.

    The agents remember their observations, as `gamms.belief.observe` does; also those of teammates and their own
    positions.

    Args:
        ctx: the context of the copy of the game in which the others are placed.
        states: the states of the planning agents, by name.
        motion: the motion model of other teams.
    """

    def __init__(self, ctx: Context, states: Mapping[str, State], motion: belief.Motion) -> None:
        self._ctx = ctx
        self._states = states
        others = [one for name, one in sorted(ctx.agent.agents.items()) if name not in states and one.alive]
        self._flying = {one.name: one for one in others if one.type is AgentType.AERIAL}
        walking = [one for one in others if one.name not in self._flying]
        teams = {ctx.agent.get_agent(name).team for name in states}
        self._mates = [one for one in walking if one.team in teams - {None}]
        self._enemies = [one for one in walking if one not in self._mates]
        self._seen_in_air: dict[str, Any] = {}
        for kind, data in chain.from_iterable(state["sensor"].values() for state in states.values()):
            if kind in IN_AIR:
                found = {name: place for name, (_, place) in data.items() if name in self._flying}
                self._seen_in_air.update(found)
        self._observe()
        both = [(state.get("memory", {}), state.get("team_memory", {})) for state in states.values()]
        memory = belief.merge(*chain.from_iterable(both))
        now: Any = {"memory": memory, **{key: one for key, one in next(iter(states.values())).items() if key == "turn"}}
        known = belief.believed(ctx, now)
        self._turn = known.turn
        self._last_seen = known.last_seen
        names = [one.name for one in self._enemies]
        self._chances = np.cumsum(known.probabilities(names, motion), axis=1) if names else np.zeros((0, 1))
        self._node_ids = ctx.graph.columns().node_ids

    def place(self) -> dict[str, int]:
        """Place all other agents at sampled positions; return the nodes of agents on the ground.

        The seed of the context and the name of each agent determine the sample.
        """
        ctx = self._ctx
        places = dict[str, int]()
        key = kernels.compute_purpose_key(ctx.seed, "hidden places")
        for enemy, chances in zip(self._enemies, self._chances, strict=True):
            chance = kernels.convert_to_fraction(kernels.draw_bits(key, kernels.compute_name_key(enemy.name), 0))
            places[enemy.name] = int(self._node_ids[_draw_index(chances, chance)])
        for mate in self._mates:
            places[mate.name] = self._walk_randomly(mate, key)
        for name, node in places.items():
            agent: Any = ctx.agent.get_agent(name)
            agent.current_node_id = node
            agent.prev_node_id = node
        for name, flyer in self._flying.items():
            if name in self._seen_in_air:
                for _ in range(2):  # so that its previous position is the same
                    flyer.position = self._seen_in_air[name]
        return places

    def _walk_randomly(self, mate: IAgent, key: int) -> int:
        """Return the node of a teammate after a random walk from its last known node; if unknown, any node."""
        seen = self._last_seen.get(mate.name)
        name = kernels.compute_name_key(mate.name)
        if seen is None or not self._ctx.graph.graph.has_node(seen.node):
            return int(self._node_ids[kernels.convert_to_integer(kernels.draw_bits(key, name, 0), len(self._node_ids))])
        steps = min(self._turn - seen.turn, _MOST_STEPS)
        draws = (kernels.draw_bits(key, name, 0, step) for step in range(steps))
        mode = getattr(mate, "mode", None)
        if mode is not None and split_mode(mode)[1]:
            return self._walk_with_turns(seen.node, split_mode(mode)[0], draws)
        node = seen.node
        near = get_mode_graph(self._ctx, mode).neighborhoods
        for bits in draws:
            ways: Sequence[int] = near[node]
            node = ways[kernels.convert_to_integer(bits, len(ways))]
        return int(node)

    def _walk_with_turns(self, node: int, mode: str, draws: Iterable[int]) -> int:
        """Return the node after a random walk that begins on a node and obeys the turn restrictions of a mode."""
        ground = get_belief_map(self._ctx.graph.columns())
        moves = map_moves(ground, mode)
        place = moves.begin_on(ground.find_row(node))
        for bits in draws:
            ways = [place, *moves.list_ends(place)]
            place = ways[kernels.convert_to_integer(bits, len(ways))]
        return int(self._node_ids[moves.nodes[place]])

    def _observe(self) -> None:
        """Store what the agents observe now; an agent that decides alone also shares it with its team."""
        is_alone = len(self._states) == 1
        mates = {one.name for one in self._mates}
        for name, state in self._states.items():
            here: Any = state["curr_pos"]
            belief.observe(self._ctx, state, share=is_alone)
            if not isinstance(here, tuple):
                belief.note(self._ctx, state, name, here, share=is_alone)
            shown = chain.from_iterable(data.items() for kind, data in state["sensor"].values() if kind in ON_GROUND)
            for mate, node in sorted(pair for pair in shown if pair[0] in mates):
                belief.note(self._ctx, state, mate, int(node), share=is_alone)


def _draw_index(sums: FloatArray, chance: float) -> int:
    """Return the index drawn from weights, given their cumulative sums and a number from 0 to 1."""
    return min(int(np.searchsorted(sums, chance * sums[-1], side="right")), len(sums) - 1)
