"""One policy for many cities: pursuers learn from exact play in districts of some, and play in those of others.

    python examples/rl/exact_teacher.py --seconds 600 --width 64     # trains, evaluates, writes the card

The districts are those of the suite, or files `<city>_<number>.gamms` of another folder. In each position that the
learning pursuers reach in training cities, a table of exact play says how many moves each pair of actions loses, and
the network learns to lose few (AggreVaTe, Ross and Bagnell 2014). It gives each action a number from what that leaves
to the evader, so that it plays on all maps.
"""

import argparse
import json
import time
from functools import cache
from pathlib import Path

import networkx as nx
import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

import gamms
from gamms import rl
from gamms.scenario import Scenario
from gamms.solve import exact_evader, exact_pursuers, pursuit
from gamms.strategies import chase

DISTRICTS = Path(gamms.__file__).parent / "data" / "districts"
TRAINING = ("helsinki", "victoria", "bejaia")
ENTRIES = len(rl.pursuit_observation.names)
TURNS, BATCH, EPOCHS, RATE = 8, 512, 2, 2e-3
MOST_LOST = 20  # moves: an action that loses more counts as if it lost as many


def pursuit_in(folder, maps):
    """Return the scenario: two pursuers and an evader who see all and move in turns, from random places."""
    return Scenario(
        name="pursuit",
        map={"file": maps[0]},
        folder=folder,
        sensors={"eyes": {"type": "AGENT"}},
        teams={"red": {"count": 2, "sensors": ["eyes"]}, "blue": {"count": 1, "sensors": ["eyes"]}},
        settings={"order": [["red"], ["blue"]]},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"],
        max_turns=40,
    )


@cache
def solve_on(streets):
    """Return the number of moves until exact pursuers catch: (formations, nodes), before a move of the evader."""
    graph = nx.DiGraph()
    graph.add_nodes_from(range(len(streets.counts)))
    graph.add_edges_from(zip(streets.columns.sources.tolist(), streets.columns.targets.tolist(), strict=True))
    codes = pursuit(graph, pursuers=2).outcomes.codes[1]
    return np.where(codes > 0, codes, 10_000)  # 0: exact pursuers do not catch


def observe_lesson(view):
    """Return the observation of the policy, and then for each pair of actions of the team how many moves it loses."""
    rows, is_legal = view.legal_rows()
    ends = np.sort(np.stack(np.broadcast_arrays(rows[:, 0, :, None], rows[:, 1, None, :])), axis=0)
    evader = view.of(np.array([view.roster.names.index("blue_0")])).node[:, :, None]
    left = solve_on(view.streets)[ends[0] + ends[1] * (ends[1] + 1) // 2, evader]
    left = np.where(is_legal[:, 0, :, None] & is_legal[:, 1, None, :], left, 10_000)
    lost = np.full((len(left), view.num_actions, view.num_actions), MOST_LOST)
    lost[:, : left.shape[1], : left.shape[2]] = np.minimum(left - left.min(axis=(1, 2), keepdims=True), MOST_LOST)
    lesson = np.broadcast_to(lost.reshape(len(lost), 1, -1), (*view.node.shape, view.num_actions**2))
    return np.concatenate([rl.pursuit_observation(view), lesson], axis=2, dtype=np.float32)


def train(scenario, maps, width, seconds, seed=1, num_games=512):
    """Return a network trained for some seconds of CPU time, and its curve: (seconds, loss, share of games won)."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # small networks are faster so
    began = time.process_time()
    learner = {"team": "red", "observation": observe_lesson, "reward": lambda turn: turn.won, "seed": seed}
    env = rl.vector_env(scenario, num_games=num_games, maps=maps, others={"blue": exact_evader}, **learner)
    hidden = [nn.Linear(ENTRIES, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh()]
    network = nn.Sequential(*hidden, nn.Linear(width, 1))
    optimizer = torch.optim.Adam(network.parameters(), lr=RATE)
    curve, done, observed = [], 0.0, env.reset()[0]["observation"]
    while done < 1.0:
        games, ended, won, losses = [], 0, 0.0, []
        for _ in range(TURNS):
            games.append(torch.from_numpy(observed).unflatten(0, (num_games, 2)))
            with torch.no_grad():
                actions = Categorical(logits=score(network, games[-1])).sample()
            observed, rewards, terminated, truncated, _ = env.step(actions.flatten().numpy())
            observed, ended, won = observed["observation"], ended + (terminated | truncated).sum(), won + rewards.sum()
        order = torch.randperm(EPOCHS * TURNS * num_games) % (TURNS * num_games)
        for part in torch.cat(games)[order].split(BATCH):
            losses.append(loss_of(network, part))
            optimizer.zero_grad()
            losses[-1].backward()
            optimizer.step()
        done = (time.process_time() - began) / seconds
        optimizer.param_groups[0]["lr"] = RATE * max(0.0, 1.0 - done)
        if done >= (len(curve) + 1) / 20:
            share = round(won / max(ended, 1), 4)
            curve.append([round(done * seconds, 1), round(sum(losses).item() / len(losses), 4), share])
            print(*curve[-1], flush=True)
    env.close()
    return network, curve


def split(lesson):
    """Return the entries of each action and the moves that each pair loses; the last axis of a lesson has both."""
    actions = round((lesson.shape[-1] + ENTRIES**2 / 4) ** 0.5 - ENTRIES / 2)  # entries * actions + actions ** 2
    entries = lesson[..., : ENTRIES * actions].unflatten(-1, (actions, ENTRIES))
    return entries, lesson[..., ENTRIES * actions :].unflatten(-1, (actions, actions))


def score(network, lesson):
    """Return a number for each action, (games, 2, actions)."""
    entries, _ = split(lesson)
    return network(entries)[..., 0].masked_fill(entries[..., 0] == 0, -1e9)


def loss_of(network, lesson):
    """Return the moves that the team loses in the mean, plus how improbable actions are that lose none."""
    logs = score(network, lesson).log_softmax(dim=2)
    shares, lost = logs.exp(), split(lesson)[1][:, 0]
    mean = torch.einsum("gi,gj,gij->g", shares[:, 0], shares[:, 1], lost)
    loses = torch.stack((lost.amin(dim=2), lost.amin(dim=1)), dim=1)
    return (mean - logs.masked_fill(loses > 0, -1e9).logsumexp(dim=2).mean(dim=1)).mean()


def evaluate(scenario, maps, file, games, seed=0):
    """Compare the policy with `chase` and exact pursuers, against exact evaders."""
    strategies = {"chase": chase, "policy": rl.policy(file, sample=True)}
    named = {Path(one["file"]).stem: one for one in maps}
    options = {"maps": named, "games": games, "seed": seed, "exact": exact_pursuers}
    return rl.evaluate(scenario, strategies, team="red", opponents={"exact": exact_evader}, **options)


def main():
    """Train, evaluate and write the card."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, nargs="?", default=DISTRICTS)
    parser.add_argument("--seconds", type=float, default=600.0, help="CPU time")
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--games", type=int, default=100, help="in each district, for the evaluation")
    parser.add_argument("--out", type=Path, default=Path("pursuit.safetensors"))
    given = parser.parse_args()
    districts = [{"file": path.name} for path in sorted(given.folder.glob("*.gamms"))]
    cities = {True: [], False: []}
    for one in districts:
        cities[one["file"].rpartition("_")[0] in TRAINING].append(one)
    scenario = pursuit_in(given.folder.resolve(), [one["file"] for one in districts])
    network, curve = train(scenario, cities[True], given.width, given.seconds)
    options = {"team": "red", "observation": rl.pursuit_observation, "shared": 0, "maps": cities[True]}
    rl.save_policy(network, given.out, scenario, **options)
    found = evaluate(scenario, cities[False], given.out, given.games)
    print(found)
    table = found.table()
    options = f"--seconds {given.seconds:g} --width {given.width} --games {given.games}"
    card = {
        "command": f"python examples/rl/exact_teacher.py {options}",
        "method": "on training maps: moves lost against a table of exact play, in turns with an exact evader; 40 turns",
        "seeds": {"network": 1, "training games": 1, "test games": 0},
        "curve": {"columns": ["CPU seconds", "loss", "share of training games won"], "rows": curve},
        "training": [one["file"] for one in cities[True]],
        "test": {name: [getattr(cell, "item", lambda cell=cell: cell)() for cell in table[name]] for name in table},
        "gap_closed": found.gap_closed("policy"),
    }
    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in card.items()]
    given.out.with_suffix(".json").write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
