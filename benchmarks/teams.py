"""One large team that a plan of arrays moves, against a kernel of NumPy, and what conflicts add to its turns."""

import tempfile
from itertools import count, cycle, islice
from pathlib import Path

import numpy as np

import gamms
from gamms import kernels
from gamms.rules import Conflicts

TURNS = 10  # one after the other, as games play them: after a turn of something else, nothing is in the cache
RECORDED_TURNS = 128  # of which each recording of a large team has one keyframe: a round holds its share of them


def lattice(side):
    """Return a context with a square lattice of streets."""
    ctx = gamms.create_context(seed=1, logger_config={"level": "ERROR"})
    ids = np.arange(side * side)
    square = ids.reshape(side, side)
    ends = [square[:, :-1], square[:, 1:], square[:-1], square[1:]]
    near, far = np.concatenate([ends[0].ravel(), ends[2].ravel()]), np.concatenate([ends[1].ravel(), ends[3].ravel()])
    sources, targets = np.concatenate((near, far)), np.concatenate((far, near))
    ctx.graph.graph.add_nodes(ids, ids % side * 10.0, ids // side * 10.0)
    ctx.graph.graph.add_edges(np.arange(len(sources)), sources, targets, np.full(len(sources), 10.0))
    return ctx


def by_stream(arrays):
    """Walk at random, by one stream of the team."""
    return arrays.choose((arrays.rng.random(len(arrays.names), np.float32) * arrays.counts).astype(np.int32))


def by_keys(arrays):
    """Walk at random, by draws of each agent."""
    return arrays.choose(arrays.draw.below(arrays.counts))


def game(agents, side, plan, nodes, conflicts=None, file=None):
    """Return the function that plays some turns of a team, which are recorded if there is a file."""
    ctx, turns = lattice(side), RECORDED_TURNS if file else TURNS
    ctx.agent.create_team("red", nodes)
    ctx.game.command("red", plan, arrays=True)
    ctx.game.conflicts = conflicts
    if file:
        ctx.record.start(file)

    return playing(ctx, agents, turns)


def playing(ctx, agents, turns):
    """Return the function that plays some turns of agents."""

    def play():
        for _ in range(turns):
            ctx.game.step()
        return turns * agents

    return play


def walk(agents, side, *, is_keyed, is_recorded=False):
    """Return the case of a random walk, against a kernel in int32 with kept buffers: degree, draw, neighbour."""

    def make():
        nodes, turns_at_once = np.arange(agents) % (side * side), RECORDED_TURNS if is_recorded else TURNS
        folder = tempfile.TemporaryDirectory() if is_recorded else None
        file = Path(folder.name, "walk.ggr") if is_recorded else None
        ours = game(agents, side, by_keys if is_keyed else by_stream, nodes, file=file)
        columns = lattice(side).graph.columns()
        found = kernels.list_neighborhoods(columns.sources, columns.targets, side * side)
        offsets, targets = (array.astype(np.int32) for array in found)
        degrees, at = np.diff(offsets), nodes.astype(np.int32)
        rng, purpose = np.random.default_rng(1), kernels.compute_purpose_key(1, "agent")
        keys = kernels.compute_name_keys([f"red_{i}" for i in range(agents)]) if is_keyed else None
        share, places, chosen = np.empty(agents, np.float32), np.empty(agents, np.int32), np.empty(agents, np.int32)
        turns = count()

        def floor(_folder=folder):  # which is there as long as the case
            for turn in islice(turns, turns_at_once):
                np.take(degrees, at, out=places)
                if is_keyed:
                    chosen[:] = kernels.convert_to_integers(kernels.draw_bits_rows(purpose, keys, turn), places)
                else:
                    rng.random(out=share, dtype=np.float32)
                    np.multiply(share, places, out=share)
                    chosen[:] = share
                np.take(offsets, at, out=places)
                np.add(places, chosen, out=places)
                np.take(targets, places, out=at)
            return turns_at_once * agents

        return ours, floor

    return make


def conflicts(agents, side, *, apart=True):
    """Return the case of turns with conflicts, against the same without; agents begin anywhere, or side by side."""

    def make():
        nodes = np.random.default_rng(1).permutation(side * side)[:agents] if apart else np.arange(agents)
        return game(agents, side, by_stream, nodes, Conflicts(1)), game(agents, side, by_stream, nodes)

    return make


def deaths(agents, side, *, are_members, are_deleted=False):
    """Return the case of turns after each of which an agent dies and the one that died before returns, against none.

    Or an agent is deleted, and one of its name created.
    """

    def game_of(is_deadly):
        ctx = lattice(side)
        if are_members:
            ctx.agent.create_team("red", range(agents))
            ctx.game.command("red", by_stream, arrays=True)
        for i in range(0 if are_members else agents):
            ctx.sensor.create_sensor(f"near {i}", "NEIGHBOR")
            ctx.agent.create_agent(f"red_{i}", start_node_id=i, sensors=[f"near {i}"], strategy=wander)
        dying = cycle(range(0, agents, 7))
        dead = []

        def fight(ctx):
            for name in dead:
                ctx.game.respawn(name)
            dead[:] = [f"red_{next(dying)}"]
            ctx.game.eliminate(dead[0])

        def replace(ctx):
            i = next(dying)
            more = {"team": "red"} if are_members else {"sensors": [f"near {i}"], "strategy": wander}
            ctx.agent.delete_agent(f"red_{i}")
            ctx.agent.create_agent(f"red_{i}", start_node_id=i, **more)

        if is_deadly:
            ctx.game.add(replace if are_deleted else fight)

        return playing(ctx, agents, TURNS)

    return lambda: (game_of(is_deadly=True), game_of(is_deadly=False))


def wander(state):
    """Go along any edge."""
    state["action"] = state["draw"].choice(state["legal"])
