"""Play the nearest equal of a game here and in other simulators, in turn, and say what each computes.

    python benchmarks/peers.py --python ENV1/bin/python --python ENV2/bin/python

Peers disagree about versions of NumPy, so each may be in an environment of its own: a peer is run in the first of the
given Pythons that has it, and one that none has is named. Rounds alternate between processes; in each, the least CPU
time of many slices is taken, of all threads together.
"""

import argparse
import json
import os
import random
import statistics
import subprocess
import sys
import time
from typing import NamedTuple

_SLICES, _WARM_UP = 60, 20
_SLICES_S = 10.0  # of CPU time, in which fewer slices of what takes long are run


# -- ours -------------------------------------------------------------------------------------------------------------


def lattice(ctx, side):
    """Put a grid of `side` x `side` nodes, 10 m apart, into a context."""
    import numpy as np

    ids = np.arange(side * side).reshape(side, side)
    one = np.concatenate([ids[:, :-1].ravel(), ids[:-1].ravel()])
    other = np.concatenate([ids[:, 1:].ravel(), ids[1:].ravel()])
    y, x = np.indices((side, side)) * 10.0
    ctx.graph.add_nodes(ids.ravel(), x.ravel(), y.ravel())
    ctx.graph.add_edges(np.arange(2 * len(one)), np.concatenate([one, other]), np.concatenate([other, one]))


def ours_alone(side, counts, sensors, capacity=None, tag=False, turns=5):
    """Turns of `ctx.game` of agents that walk at random; all places were looked from before."""
    import gamms
    from gamms import rules

    ctx, choice = gamms.create_context(seed=1), random.Random(1).choice
    lattice(ctx, side)

    def walk(state):
        state["action"] = choice(state["legal"])

    agents = sum(counts.values())
    starts = iter(random.Random(2).sample(range(side * side), agents))
    for team, count in counts.items():
        for i in range(count):
            made = {
                name: ctx.sensor.create_sensor(f"{name}_{team}_{i}", kind, sensor_range=metres)
                for name, (kind, metres) in sensors.get(team, {}).items()
            }
            ctx.agent.create_agent(f"{team}_{i}", team=team, start_node_id=next(starts), sensors=made, strategy=walk)
    for name in sensors["red"]:  # sensors of one kind and range share what they have seen
        ctx.sensor.get_sensor(f"{name}_red_0").sense_many(range(side * side))
    if capacity is not None:
        ctx.game.conflicts = rules.Conflicts(capacity)
    if tag:
        ctx.game.add(rules.tag(*counts))

    def run():
        for _ in range(turns):
            ctx.game.step()
        return turns * agents

    return run


def ours_as_team(side=64, agents=64, metres=61.0, turns=50):
    """Turns of `ctx.game` of a team that looks at 121 nodes around each agent, in arrays, and has goals."""
    import numpy as np

    import gamms
    from gamms import rules

    ctx, rng = gamms.create_context(seed=1), np.random.default_rng(1)
    lattice(ctx, side)
    around = ctx.sensor.create_sensor("around", "RANGE", sensor_range=metres)
    near = ctx.sensor.create_sensor("near", "AGENT_RANGE", sensor_range=metres)
    around.sense_many(range(side * side))
    team = ctx.agent.create_team("red", random.Random(2).sample(range(side * side), agents))
    xy, goals = ctx.graph.columns().xy, rng.integers(side * side, size=agents)

    def walk(arrays):
        reached = np.flatnonzero(arrays.nodes == goals)
        goals[reached] = rng.integers(side * side, size=len(reached))
        _ = team.sense(around).values, team.sense(near).places, xy[goals] - xy[arrays.nodes]
        return arrays.choose(arrays.draw.below(arrays.counts))

    ctx.game.command("red", walk, arrays=True)
    ctx.game.conflicts = rules.Conflicts(1)

    def run():
        ctx.game.run(turns)
        return turns * agents

    return run


def ours_as_walkers(side=200, agents=10_000, turns=10):
    """Turns of `ctx.game` of a team that walks at random, by a plan in arrays."""
    import gamms

    ctx = gamms.create_context(seed=1)
    lattice(ctx, side)
    ctx.agent.create_team("red", random.Random(2).sample(range(side * side), agents))
    ctx.game.command("red", lambda arrays: arrays.choose(arrays.draw.below(arrays.counts)), arrays=True)

    def run():
        for _ in range(turns):
            ctx.game.step()
        return turns * agents

    return run


VIEWS = {"around": ("RANGE", 50.0), "near": ("AGENT_RANGE", 50.0)}
PURSUIT = {"around": ("RANGE", 30.0), "near": ("AGENT_RANGE", 30.0)}


def ours_in_batch(games=64):
    """Turns of many games at once, in each of which 64 agents look around and walk at random."""
    from gamms.scenario import Scenario

    scenario = Scenario(
        map={"grid": {"rows": 64, "columns": 64, "spacing": 10.0}},
        teams={"red": {"count": 64, "sensors": ["near"], "strategy": "gamms.strategies:random_walk"}},
        sensors={"near": {"type": "AGENT_RANGE", "sensor_range": 50.0}},
        conflicts={"capacity": 1},
        max_turns=10**9,
    )
    batch = scenario.batch(games)
    batch.columns()  # it raises if the core does not play the games completely

    def run():
        _ = batch.observe("red").seen("near").others
        batch.step()
        return games * 64

    return run


def ours_as_vectors(games=1024):
    """Turns of many games of three taggers and a runner, with the observations of all as vectors."""
    from gamms.scenario import Scenario

    scenario = Scenario(
        map={"grid": {"rows": 32, "columns": 32, "spacing": 10.0}},
        teams={team: {"count": count, "sensors": ["all"]} for team, count in (("red", 3), ("blue", 1))},
        sensors={"all": {"type": "AGENT"}},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "mutual": False}}],
        max_turns=10**9,
    )
    batch = scenario.batch(games)
    batch.columns()  # it raises if the core does not play the games completely

    def run():
        actions = {}
        for team in batch.teams:
            view = batch.observe(team)
            view.vector(3)
            actions[team] = view.draw.below(view.counts)
        batch.step(actions)
        return games * 4

    return run


def ours_as_drivers(side=30, agents=1000, turns=10):
    """Turns of one second of agents that drive random ways at 13.9 m/s."""
    import gamms
    from gamms.strategies import random_walk

    ctx = gamms.create_context(seed=1, game={"speed_unit": "metres"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(side, side, spacing=100.0))
    for i, node in enumerate(random.Random(2).choices(range(side * side), k=agents)):
        ctx.agent.create_agent(f"a_{i}", start_node_id=node, speed=13.9, strategy=random_walk)

    def run():
        ctx.game.run(turns)
        return turns * agents

    return run


def ours_as_values():
    """Solve a game of two turns, of one pursuer and one evader on 2 x 2 nodes, who move at once."""
    import solve

    scenario = solve.chased(2, 2)

    def run():
        solve.solve(scenario)
        return 1

    return run


def ours_as_distances(side=300):
    """Distances from one node to all of 90,000, from another one each time."""
    import gamms

    ctx, starts = gamms.create_context(seed=1), random.Random(1)
    lattice(ctx, side)
    nodes = list(range(side * side))

    def run():
        ctx.graph.distance_matrix([starts.randrange(side * side)], nodes)
        return 1

    return run


NEAR = {"red": {"near": ("NEIGHBOR", 0.0)}}
OURS = {
    "POGEMA": lambda: ours_alone(64, {"red": 64}, {"red": VIEWS}, capacity=1),
    "POGEMA, agents only": lambda: ours_alone(64, {"red": 64}, {"red": {"near": VIEWS["near"]}}, capacity=1),
    "POGEMA, a team in arrays": ours_as_team,
    "POGEMA, in batch": ours_in_batch,
    "PettingZoo": lambda: ours_alone(16, {"red": 8, "blue": 30}, {"red": PURSUIT}, tag=True, turns=10),
    "VMAS": ours_as_vectors,
    "Mesa": lambda: ours_alone(100, {"red": 1000}, NEAR, turns=1),
    "Mesa, two agents": lambda: ours_alone(20, {"red": 2}, NEAR, turns=100),
    "mesa-frames": ours_as_walkers,
    "JaxMARL": ours_as_vectors,
    "SUMO": ours_as_drivers,
    "OpenSpiel": ours_as_values,
    "SciPy": ours_as_distances,
}


# -- peers ------------------------------------------------------------------------------------------------------------


def pogema(turns=5):
    """64 agents on 64 x 64 cells, views of radius 5."""
    import numpy as np
    from pogema import GridConfig, pogema_v0

    config = GridConfig(
        num_agents=64, size=64, obs_radius=5, density=0.0, max_episode_steps=10**9, on_target="restart", seed=1
    )
    env, rng = pogema_v0(config), np.random.default_rng(1)
    env.reset()

    def run():
        for _ in range(turns):
            env.step(rng.integers(5, size=64).tolist())
        return turns * 64

    return run


def pursuit(turns=2):
    """8 pursuers with views of 7 x 7 cells and 30 evaders on 16 x 16 cells."""
    import numpy as np
    from pettingzoo.sisl import pursuit_v5

    env = pursuit_v5.parallel_env(x_size=16, y_size=16, n_pursuers=8, n_evaders=30, obs_range=7, max_cycles=10**9)
    env.reset(seed=1)
    rng = np.random.default_rng(1)

    def run():
        for _ in range(turns):
            if not env.agents:
                env.reset()
            env.step(dict(zip(env.agents, rng.integers(5, size=len(env.agents)).tolist(), strict=True)))
        return turns * 38

    return run


def mesa(side=100, agents=1000, turns=1):
    """Agents that walk at random on a network of cells."""
    import mesa as library
    import networkx as nx
    from mesa.discrete_space import CellAgent, Network

    class Walker(CellAgent):
        def step(self):
            self.cell = self.cell.neighborhood.select_random_cell()

    model = library.Model(seed=1)
    graph = nx.convert_node_labels_to_integers(nx.grid_2d_graph(side, side))
    network = Network(graph, random=model.random)
    for cell in model.random.sample(list(network.all_cells), agents):
        Walker(model).cell = cell

    def run():
        for _ in range(turns):
            model.agents.do("step")
        return turns * agents

    return run


def mesa_frames(side=200, agents=10_000):
    """10,000 agents, columns of a data frame, that walk at random on 200 x 200 cells; at the border they stay."""
    import numpy as np
    import polars as pl
    from mesa_frames import AgentSetPolars, GridPolars, ModelDF

    directions = np.array([(0, 1), (0, -1), (1, 0), (-1, 0)])

    class Walkers(AgentSetPolars):
        def __init__(self, model):
            super().__init__(model)
            self += pl.DataFrame({"unique_id": np.arange(agents)})

        def step(self):
            at = self.pos.select("dim_0", "dim_1").to_numpy()
            to = np.clip(at + directions[self.random.integers(4, size=agents)], 0, side - 1)
            self.space.move_agents(self.pos["unique_id"], to)

    class World(ModelDF):
        def __init__(self):
            super().__init__(seed=1)
            self.space = GridPolars(self, [side, side], neighborhood_type="von_neumann")
            walkers = Walkers(self)
            self.agents += walkers
            cells = self.random.choice(side * side, agents, replace=False)
            self.space.place_agents(walkers.index, np.stack([cells // side, cells % side], axis=1))

    world = World()

    def run():
        world.agents.do("step")
        return agents

    return run


def vmas(games=1024):
    """Three taggers and a runner that push each other about in the plane, in many environments at once."""
    import torch
    from vmas import make_env

    torch.set_num_threads(1)
    options = {"num_good_agents": 1, "num_adversaries": 3, "num_landmarks": 2}
    env = make_env("simple_tag", num_envs=games, device="cpu", continuous_actions=False, seed=1, **options)
    env.reset()

    def run():
        env.step([env.get_random_action(agent) for agent in env.agents])
        return games * 4

    return run


def jaxmarl(games=1024, turns=50):
    """Three taggers and a runner in the plane, in many environments at once; all turns are one compiled loop."""
    import jax
    from jaxmarl import make

    env = make("MPE_simple_tag_v3")

    def turn(states, key):
        chosen, key = jax.random.split(key)
        drawn = jax.random.randint(chosen, (games, env.num_agents), 0, 5)
        actions = {name: drawn[:, i] for i, name in enumerate(env.agents)}
        seen, states, rewards, *_ = jax.vmap(env.step)(jax.random.split(key, games), states, actions)
        return states, (sum(one.sum() for one in seen.values()), sum(one.sum() for one in rewards.values()))

    play = jax.jit(lambda states, key: jax.lax.scan(turn, states, jax.random.split(key, turns)))
    _, states = jax.vmap(env.reset)(jax.random.split(jax.random.PRNGKey(1), games))
    key = jax.random.PRNGKey(2)

    def run():
        nonlocal states, key
        key, now = jax.random.split(key)
        states, _ = jax.block_until_ready(play(states, now))
        return games * env.num_agents * turns

    return run


def sumo(side=30, agents=1000, turns=10):
    """Cars that drive random ways on a grid of streets of one lane, 100 m long, in steps of one second."""
    import tempfile
    from pathlib import Path

    import libsumo
    import sumo as package

    chosen = random.Random(2)
    generate = [Path(package.SUMO_HOME) / "bin" / "netgenerate", "--grid", f"--grid.number={side}", "--grid.length=100"]
    with tempfile.TemporaryDirectory() as folder:
        net = f"{folder}/net.xml"
        subprocess.run([*generate, f"--output-file={net}"], check=True, stdout=subprocess.DEVNULL)
        libsumo.start(["sumo", "-n", net, "--no-step-log", "--no-warnings", "--time-to-teleport=-1"])
    nodes = [name for name in libsumo.junction.getIDList() if not name.startswith(":")]
    leaving = {name: [e for e in libsumo.junction.getOutgoingEdges(name) if e[0] != ":"] for name in nodes}
    for i in range(agents):
        at, before, way = chosen.choice(nodes), None, []
        for _ in range(400):
            ahead = [edge for edge in leaving[at] if libsumo.edge.getToJunction(edge) != before]
            way.append(chosen.choice(ahead))
            before, at = at, libsumo.edge.getToJunction(way[-1])
        libsumo.route.add(f"way {i}", way)
        libsumo.vehicle.add(f"car {i}", f"way {i}", departPos="random_free", departSpeed="max")
    while libsumo.vehicle.getIDCount() < 0.95 * agents and libsumo.simulation.getTime() < 600:
        libsumo.simulationStep()

    def run():
        done = 0
        for _ in range(turns):
            libsumo.simulationStep()
            done += libsumo.vehicle.getIDCount()
        return done

    return run


def open_spiel():
    """200 iterations of CFR+ in the same game of two turns, which is as exact as 0.0001."""
    import pyspiel

    import solve

    game = pyspiel.convert_to_turn_based(solve.openspiel(solve.chased(2, 2)))

    def run():
        solve.of_cfr(game)
        return 1

    return run


def scipy(side=300):
    """Distances from one node to all of 90,000, from another one each time."""
    import numpy as np
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    ids, starts = np.arange(side * side).reshape(side, side), random.Random(1)
    one = np.concatenate([ids[:, :-1].ravel(), ids[:-1].ravel()])
    other = np.concatenate([ids[:, 1:].ravel(), ids[1:].ravel()])
    graph = coo_array((np.full(len(one), 10.0), (one, other)), shape=(side * side, side * side)).tocsr()
    graph = (graph + graph.T).tocsr()

    def run():
        dijkstra(graph, indices=[starts.randrange(side * side)])
        return 1

    return run


class Peer(NamedTuple):
    """A game there, and what is played here beside it."""

    module: str
    distribution: str
    make: object
    game: str
    computes: str
    our_game: str
    we_compute: str
    unit: str = "agent-step"


_POGEMA = (
    "pogema",
    "pogema",
    pogema,
    "64 x 64 cells, 64 agents, radius 5",
    "three 11 x 11 arrays: obstacles, agents, its goal; no two agents on a cell; a new goal when it is reached",
)
PEERS = {
    "POGEMA": Peer(
        *_POGEMA,
        "`ctx.game`, RANGE and AGENT_RANGE 50 m, `Conflicts(1)`",
        "81 nodes and 280 edges as new containers, who is near by name, all keys of a state; no goals",
    ),
    "POGEMA, agents only": Peer(
        *_POGEMA,
        "`ctx.game`, AGENT_RANGE 50 m, `Conflicts(1)`",
        "who is near by name, legal nodes, all keys of a state; not what lies around, no goals",
    ),
    "POGEMA, a team in arrays": Peer(
        *_POGEMA,
        "`ctx.game`, a plan in arrays, RANGE and AGENT_RANGE 61 m, `Conflicts(1)`",
        "121 nodes around and who is near by ids in arrays, the way to a goal; a new goal when it is reached",
    ),
    "POGEMA, in batch": Peer(
        *_POGEMA,
        "`scenario.batch(64)`, AGENT_RANGE 50 m, capacity 1",
        "who sees whom as pairs, moves with keyed draws; not what lies around, no goals",
    ),
    "PettingZoo": Peer(
        "pettingzoo.sisl.pursuit_v5",
        "pettingzoo",
        pursuit,
        "`pursuit_v5`, 16 x 16 cells, 8 against 30",
        "7 x 7 x 3 arrays for pursuers, catches, rewards; evaders observe nothing",
        "`ctx.game`, RANGE and AGENT_RANGE 30 m, `tag`",
        "views of the 8, moves of all 38, tags and scores",
    ),
    "Mesa": Peer(
        "mesa",
        "Mesa",
        mesa,
        "`Network` of 100 x 100 cells, 1,000 agents",
        "an agent after the other moves to a random neighbour",
        "`ctx.game`, NEIGHBOR",
        "a state of twelve keys, legality, all move at once",
    ),
    "Mesa, two agents": Peer(
        "mesa",
        "Mesa",
        lambda: mesa(20, 2, 100),
        "`Network` of 20 x 20 cells, 2 agents",
        "an agent after the other moves to a random neighbour",
        "`ctx.game`, NEIGHBOR",
        "a state of twelve keys, legality, all move at once",
    ),
    "mesa-frames": Peer(
        "mesa_frames",
        "mesa-frames",
        mesa_frames,
        "`GridPolars` of 200 x 200 cells, 10,000 agents in a data frame",
        "all agents move to a random neighbour, and cells count who is on them",
        "`ctx.game`, a team with a plan in arrays",
        "legal moves of roads, draws by agent, all move at once",
    ),
    "VMAS": Peer(
        "vmas",
        "vmas",
        vmas,
        "`simple_tag`, 3 against 1, 1,024 environments, PyTorch on one core",
        "forces and collisions of discs in the plane, 14 or 16 numbers for each agent, rewards",
        "`scenario.batch(1024)`, AGENT, vectors of 29 numbers, `tag`",
        "who sees whom, legal moves, tags, events, scores; no physics",
    ),
    "JaxMARL": Peer(
        "jaxmarl",
        "jaxmarl",
        jaxmarl,
        "`MPE_simple_tag_v3`, 3 against 1, 1,024 environments, one compiled loop on the CPU",
        "forces and collisions of discs in the plane, 14 or 16 numbers for each agent, rewards",
        "`scenario.batch(1024)`, AGENT, vectors of 29 numbers, `tag`",
        "who sees whom, legal moves, tags, events, scores; no physics",
    ),
    "SUMO": Peer(
        "libsumo",
        "libsumo",
        sumo,
        "1,000 cars on 30 x 30 junctions, 100 m apart, steps of 1 s",
        "distances between cars, right of way at junctions, speeds",
        "`ctx.game` by metres, `random_walk`",
        "legal nodes and ways by metres, places along edges; agents drive through each other",
    ),
    "OpenSpiel": Peer(
        "pyspiel",
        "open_spiel",
        open_spiel,
        "one pursuer and one evader on 2 x 2 nodes, two turns",
        "200 iterations of CFR+ over all histories, to 0.0001",
        "`gamms.solve.solve`",
        "the exact value, by sweeps over positions",
        "game",
    ),
    "SciPy": Peer(
        "scipy",
        "scipy",
        scipy,
        "300 x 300 nodes, from one to all",
        "`csgraph.dijkstra` on a matrix",
        "`ctx.graph.distance_matrix`",
        "the same distances",
        "source",
    ),
}


def least(run):
    """Return the least CPU seconds of an agent-step."""
    first = time.process_time()
    for _ in range(_WARM_UP):
        run()
        if time.process_time() - first > _SLICES_S / 2:
            break
    spent, first = [], time.process_time()
    for _ in range(_SLICES):
        began = time.process_time()
        done = run()
        spent.append((time.process_time() - began) / done)
        if time.process_time() - first > _SLICES_S:
            break
    return min(spent)


def one(name, side):
    """Measure one side in this process, and print seconds per agent-step and the version of what was run."""
    from importlib.metadata import version

    seconds = least((OURS if side == "ours" else {name: PEERS[name].make})[name]())
    print(json.dumps({"seconds": seconds, "version": None if side == "ours" else version(PEERS[name].distribution)}))


def measured(python, name, side):
    """Measure one side in a process of its own; another Python must not find our package."""
    command = [python, __file__, "--one", name, "--side", side]
    printed = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True, env=_environment(python)).stdout
    return json.loads(printed.splitlines()[-1])


def has(python, module):
    """Return whether a Python has a module."""
    code = f"import importlib.util as u, sys; sys.exit(u.find_spec({module!r}) is None)"
    found = subprocess.run([python, "-c", code], check=False, stderr=subprocess.DEVNULL, env=_environment(python))
    return found.returncode == 0


def _environment(python):
    return {key: value for key, value in os.environ.items() if key != "PYTHONPATH" or python == sys.executable}


def compare(name, peer, python, rounds):
    """Return the record of a peer: steps per second of both, and the median of the ratios by round."""
    pairs = [(measured(sys.executable, name, "ours"), measured(python, name, "peer")) for _ in range(rounds)]
    ours, theirs = (min(pair[side]["seconds"] for pair in pairs) for side in (0, 1))
    about = {key: getattr(peer, key) for key in ("game", "computes", "our_game", "we_compute", "unit")}
    ratio = statistics.median(their["seconds"] / our["seconds"] for our, their in pairs)
    return {"version": pairs[0][1]["version"], **about, "steps": 1 / theirs, "our_steps": 1 / ours, "ratio": ratio}


def main():
    """Run each peer that is installed, in turn with ours, and print a line of JSON for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="run only peers whose name begins with one of these")
    parser.add_argument("--python", action="append", default=[], help="the Python of an environment with peers")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    parser.add_argument("--side", default="ours", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        one(options.one, options.side)
        return
    for name, peer in PEERS.items():
        if options.names and not name.startswith(tuple(options.names)):
            continue
        python = next((one for one in [*options.python, sys.executable] if has(one, peer.module)), None)
        found = {"error": "not installed"} if python is None else compare(name, peer, python, options.rounds)
        print(json.dumps({"name": name, **found}), flush=True)


if __name__ == "__main__":
    main()
