"""Finds the places of the agents of a batch between which messages are sent."""

import numpy as np

from gamms.game.batch.channels import Radio
from gamms.game.batch.columns import PlayedGame, kept_in
from gamms.game.batch.state import GameArrays
from gamms.game.messages import ANTENNA, Scene
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray


def scene_of(game: PlayedGame, state: GameArrays, radio: Radio, games: IntArray) -> Scene:
    """Return where the agents of some games are when all have moved.

    Args:
        game: in a context that has the map of these games.
        state: of all games.
        radio: of all games.
        games: their numbers; the same roads are open in all of them.
    """
    streets, movement, shared = state.world(games)
    columns = streets.columns
    node = state.node[games]
    which = np.broadcast_to(games[:, None], node.shape), np.broadcast_to(np.arange(node.shape[1]), node.shape)
    z = kept_in(shared, "heights of nodes", lambda: _heights(game, columns.node_ids))[node]
    xyz = np.concatenate((movement.places(node, which).xy, z[..., None]), axis=-1)

    def is_within(at: IntArray, transmitters: IntArray, hops: int) -> BoolArray:
        found: BoolArray = movement.routes(None).distances(node[at, transmitters][:, None], node[at]) <= hops
        return found

    return Scene(
        teams=radio.teams,
        keys=state.roster.keys,
        turns=state.turn[games] - 1,
        xyz=xyz,
        antennas=xyz + ANTENNA,
        alive=state.alive[games],
        purposes=lambda *purpose: state.purposes(*purpose)[games],
        is_within=is_within,
        visible=game.ctx.graph.visible,
        place_of=lambda node: columns.xy[columns.node_ids == node].tolist(),
    )


def _heights(game: PlayedGame, nodes: IntArray) -> FloatArray:
    """Return the heights of nodes, metres."""
    ground = game.ctx.graph.graph.ground(nodes)
    return np.zeros(len(nodes)) if ground is None else np.asarray(ground.z)
